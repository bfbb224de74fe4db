"""Which folders the project can lie in: blanks and apostrophes are fine, other programs give some characters a meaning.

Set-up runs this file before anything is installed: it needs nothing but Python.
"""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Iterable

from limo.errors import LimoError

_SEPARATOR = "search paths are split there"
_SHELL = ".venv/bin/activate has the shell read more than a name there"
_VARIABLE = "Snakemake and setuptools take what follows for a variable"
_SCRIPT = "programs of .venv/bin break there"
_NETCDF = "netCDF takes it for a /"
_BYTE = "it is no UTF-8"
#: What no program of the project gets past, and why.
REFUSED = {
    ":": _SEPARATOR,
    ";": _SEPARATOR,
    '"': _SHELL,
    "`": _SHELL,
    "$": _SHELL,
    "\\": _NETCDF,
    "{": _VARIABLE,
    "}": _VARIABLE,
    "'''": _SCRIPT,
}


def check_folder(folder: str | os.PathLike[str]) -> None:
    """Raise ``LimoError`` with path, characters and remedy if the project cannot work in ``folder`` or where that leads to.

    Both the path as it was typed and the one without symbolic links are looked at.
    """
    for path in dict.fromkeys((os.fspath(folder), os.path.realpath(folder))):
        if found := _refused(path):
            what = ", ".join(f"{_shown(text)} ({why})" for text, why in found.items())
            raise LimoError(
                f"{_shown(path)}: the project cannot work in this folder, because its path has {what}; move it to a path without "
                "that, for example ~/limo (blanks and apostrophes are fine), and call make clean-setup, then make setup there"
            )


def check_results(folder: str | os.PathLike[str]) -> None:
    """The same for a folder that ``results`` is written to, where only datasets have to be written."""
    path = os.path.realpath(folder)
    if "\\" in path:
        raise LimoError(f"{_shown(path)}: no dataset can be written here, because the path has \\ ({_NETCDF}); run elsewhere")


def check_archive(words: Iterable[str]) -> None:
    """Raise ``LimoError`` with what to do instead if ``words`` ask Snakemake for an archive where there is no conda.

    Snakemake packs the environments of conda into it. The project's own set-up needs none of them.
    """
    if any(word.partition("=")[0] == "--archive" for word in words) and not shutil.which("conda"):
        raise LimoError(
            "snakemake --archive packs environments of conda, which is not installed; without it: git archive --output "
            "limo.tar.gz HEAD holds the project with the versions of all packages (requirements.lock), tar -czf results.tar.gz "
            "results what was solved; unpack both in one folder and call make setup there"
        )


def _refused(path: str) -> dict[str, str]:
    found = {text: why for text, why in REFUSED.items() if text in path}
    for character in path:
        if ord(character) < 32 or ord(character) == 127:
            found[character] = _SCRIPT
        elif 0xDC80 <= ord(character) <= 0xDCFF:  # how Python holds a byte that is no character
            found[character] = _BYTE
    return found


def _shown(text: str) -> str:
    """Text as it is, or with the characters that cannot be printed written out."""
    return text if text.isprintable() else ascii(text)


if __name__ == "__main__":
    try:
        check_folder(sys.argv[1])
    except LimoError as error:
        sys.exit(str(error))
