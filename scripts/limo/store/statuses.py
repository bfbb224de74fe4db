"""The words for how a case ended."""

from __future__ import annotations

USABLE = ("converged", "degraded")
