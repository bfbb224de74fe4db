"""Documents with generated parts between markers; everything else in them is written by hand.

A part called NAME stands between ``<!-- begin NAME -->`` and ``<!-- end NAME -->``, each on a line of its own.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping

from limo.errors import ResultError

_BLOCK = re.compile(r"^<!-- begin (\w+) -->\n.*?^<!-- end \1 -->$", re.DOTALL | re.MULTILINE)
_MARKER = re.compile(r"<!-- (?:begin|end) (\w+) -->")


def renewed(text: str, parts: Mapping[str, Callable[[], str]]) -> str:
    """A document with all of its generated parts made anew.

    ``parts``: what makes the text of a part, by its name. A part without markers is not made. Raises ``ResultError`` for a
    marker of another name, and for a marker without its other half.
    """

    def made(match: re.Match[str]) -> str:
        name = match.group(1)
        if name not in parts:
            raise ResultError(f"no part of this document is called {name}; there are {', '.join(parts)}")
        return f"<!-- begin {name} -->\n{parts[name]()}\n<!-- end {name} -->"

    if stray := _MARKER.search(_BLOCK.sub("", text)):
        raise ResultError(f"{stray[0]}: a marker without its other half")
    return _BLOCK.sub(made, text)


def by_hand(text: str) -> str:
    """What is written by hand in a document: the text without its generated parts."""
    return _BLOCK.sub("", text)
