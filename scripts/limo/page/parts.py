"""What all sections of the page have: pictures with captions, and links to files beside it."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from PIL import Image

from limo.page import FOLDER

CAPTIONS = FOLDER.parents[2] / "workflow" / "report"
_QUALITY = 85  # of pictures, in percent
_SHOWN = 0.6  # of a picture's pixels across: sharp on dense screens, and letters as large as those of the page


@dataclass(frozen=True)
class Figure:
    """A figure: its picture as a data URL, caption, size in pixels and files."""

    name: str
    caption: str
    picture: str
    size: tuple[int, int]
    links: list[tuple[str, str]]


def links(results: Path, files: Iterable[Path]) -> list[tuple[str, str]]:
    """Names and relative addresses of those files that are there."""
    return [(file.name, quote(file.relative_to(results).as_posix())) for file in files if file.exists()]


def caption_of(name: str) -> str:
    """The caption of a study's figure; nothing where it has none."""
    caption = CAPTIONS / f"{name}.rst"
    return caption.read_text(encoding="utf-8").replace("``", "") if caption.exists() else ""


def figure(results: Path, png: Path, caption: str, files: Iterable[Path]) -> Figure:
    """A figure as a small picture, with links to its files. Raises ``OSError`` where it is not drawn."""
    with Image.open(png) as image:
        stream, size = io.BytesIO(), tuple(round(_SHOWN * n) for n in image.size)
        image.convert("RGB").save(stream, "WEBP", quality=_QUALITY)
    picture = f"data:image/webp;base64,{base64.b64encode(stream.getvalue()).decode('ascii')}"
    return Figure(png.stem, caption, picture, size, links(results, files))
