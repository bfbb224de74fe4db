"""Tests of the package, of the physics and of the workflow. Whatever starts here keeps what Python compiles.

Containers often forbid it (``PYTHONDONTWRITEBYTECODE``). Each of the hundreds of processes here would compile the package anew,
and each worker the tests.
"""

import os
import sys

os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False
