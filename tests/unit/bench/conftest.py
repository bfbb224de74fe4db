"""What the tests of files from a laboratory share: fixtures of each kind, and how a coupon of them is described."""

from __future__ import annotations

from pathlib import Path

import pytest

from limo.schema.bench import TensileTest

FIXTURES = Path(__file__).parent / "fixtures"
#: the coupon of all tensile fixtures, in mm
COUPON = {"length": 100.0, "width": 15.0, "thickness": 0.12}


@pytest.fixture
def tensile():
    """``tensile(name, **keys)``: the test of a fixture, or of a path."""

    def make(name: str | Path, **keys) -> TensileTest:
        return TensileTest(**({"data": str(FIXTURES / name)} | COUPON | keys))

    return make
