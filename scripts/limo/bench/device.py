"""Put the modulus of a tensile test into a device's file, with its origin, and leave the rest of the file as it is."""

from __future__ import annotations

import json
import re
import tempfile
from pathlib import Path

from limo.config.yaml_file import parse, read_yaml
from limo.errors import LimoError
from limo.schema.device import Device
from limo.store.files import write_whole

_MODULUS = re.compile(r"(?<![\w.])youngs_modulus:[ \t]*(?P<value>[-+.\deE]+)")
_ORIGIN = re.compile(r"modulus_origin:[ \t]*(?P<value>\"(?:[^\"\\]|\\.)*\"|'(?:[^']|'')*'|[^,}\n#]+?)(?=[ \t]*(?:[,}\n#]|$))")


def put_modulus(file: Path, modulus: float, origin: str) -> None:
    """Write ``youngs_modulus`` (MPa) and ``modulus_origin`` into the material of a device's file; comments stay.

    Raises ``ConfigError`` for a file that is no device, ``LimoError`` for one in which the place is not found.
    """
    before = read_yaml(file)
    parse(Device, before, file)
    number = float(f"{modulus:.5g}")
    wanted = before | {"material": before["material"] | {"youngs_modulus": number, "modulus_origin": origin}}
    text, quoted = file.read_text(encoding="utf-8"), json.dumps(origin, ensure_ascii=False)
    places = list(_MODULUS.finditer(text))
    if len(places) == 1:
        place = places[0]
        text = f"{text[: place.start('value')]}{number!r}{text[place.end('value') :]}"
        if origins := list(_ORIGIN.finditer(text)):
            text = f"{text[: origins[0].start('value')]}{quoted}{text[origins[0].end('value') :]}"
        else:
            text = _with_line(text, place.start(), quoted)
        if _read(text) == wanted:
            parse(Device, wanted, file)
            write_whole(file, lambda path: path.write_text(text, encoding="utf-8"))
            return
    raise LimoError(f"{file}: write by hand, in material: youngs_modulus: {number!r}, modulus_origin: {quoted}")


def _read(text: str) -> object:
    """A text as YAML, as the configuration reads it; None where it is none."""
    with tempfile.TemporaryDirectory() as folder:
        aside = Path(folder) / "device.yaml"
        aside.write_text(text, encoding="utf-8")
        try:
            return read_yaml(aside)
        except LimoError:
            return None


def _with_line(text: str, at: int, quoted: str) -> str:
    """The text with the origin behind the modulus: in the same braces, or on a line of its own."""
    end = text.find("\n", at)
    end = len(text) if end < 0 else end
    begin = text.rfind("\n", 0, at) + 1
    if text[begin:at].strip():  # in braces
        place = _MODULUS.match(text, at)
        return f"{text[: place.end()]}, modulus_origin: {quoted}{text[place.end() :]}"
    return f"{text[:end]}\n{text[begin:at]}modulus_origin: {quoted}{text[end:]}"
