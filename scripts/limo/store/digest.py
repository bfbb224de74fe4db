"""Labels and hashes of plain data."""

from __future__ import annotations

import hashlib
import json
from typing import Any


def number_label(value: float) -> str:
    """A float as part of a name: ``3.8`` -> ``3.8``, ``2.0`` -> ``2``; never an exponent."""
    text = f"{float(value):.6f}".rstrip("0").rstrip(".")
    return text or "0"


def digest(data: Any, length: int = 10) -> str:
    """Hash of plain data, the same for equal content whatever its order of keys."""
    text = json.dumps(data, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()[:length]
