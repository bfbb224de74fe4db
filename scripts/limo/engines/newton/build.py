"""Which build of the engine newton is used."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version

from limo.errors import SolverNotFoundError


def mkl_version() -> str:
    """Version of the installed package ``mkl``; raises ``SolverNotFoundError`` without one."""
    try:
        return version("mkl")
    except PackageNotFoundError:
        raise SolverNotFoundError("engine newton needs the package mkl; `make setup` installs it") from None
