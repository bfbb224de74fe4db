"""Numbers as text within a page: bytes of one significance together, deflated, base64. ``page.js`` has the way back."""

from __future__ import annotations

import base64
import zlib

import numpy as np

MISSING = -32768  # stands for no number among steps


def pack_bytes(data: bytes) -> str:
    """Bytes as text."""
    return base64.b64encode(zlib.compress(data, 9)).decode("ascii")


def pack(values: np.ndarray) -> str:
    """Integers as 32-bit ones, anything else in single precision."""
    return _planes(values.astype("<i4" if values.dtype.kind in "iub" else "<f4"))


def pack_steps(values: np.ndarray, step: float) -> str:
    """Numbers as 16-bit multiples of ``step``; what is no number is ``MISSING``."""
    known = np.isfinite(values)
    steps = np.clip(np.round(np.where(known, values, 0.0) / step), -32767, 32767)
    return _planes(np.where(known, steps, MISSING).astype("<i2"))


def _planes(values: np.ndarray) -> str:
    return pack_bytes(np.ascontiguousarray(values).view(np.uint8).reshape(-1, values.itemsize).T.tobytes())
