"""What ``limo tensile`` does: read files without a configuration, fit, draw, and put the modulus into a device."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import yaml

from limo.bench.schema import SIZES, MeasuredCurves, TensileTest
from limo.bench.tensile import Fit, fit_tensile, report, tensile_dataset, to_json
from limo.errors import ConfigError, LimoError

_COMMAND = "limo tensile"


def test_of(files: Sequence[Path], keys: dict[str, Any], settings: Iterable[str]) -> TensileTest:
    """A tensile test by the words of a command: keys of ``TensileTest``, and settings such as ``units.force=kN``.

    Raises ``ConfigError`` for what is none.
    """
    from limo.config import parse

    data = _with_settings({"data": [str(f) for f in files]} | {k: v for k, v in keys.items() if v is not None}, settings)
    if "window" in data:
        data.setdefault("method", "window")
    return parse(TensileTest, data, Path(_COMMAND))


def curves_of(file: Path | None, settings: Sequence[str]) -> MeasuredCurves | None:
    """Measured curves by the words of a command; None where it names no file. Raises ``ConfigError`` for what is none."""
    from limo.config import parse

    if file is None:
        if settings:
            raise ConfigError(
                "limo measured", "--set", settings[0], "--data with it; a study has its keys in its own file", "--data mine.csv"
            )
        return None
    return parse(MeasuredCurves, _with_settings({"data": str(file)}, settings), Path("limo measured"))


def _with_settings(data: dict[str, Any], settings: Iterable[str]) -> dict[str, Any]:
    """Keys with settings such as ``units.force=kN`` put in their places."""
    for setting in settings:
        name, equals, text = setting.partition("=")
        if not equals:
            raise ConfigError(_COMMAND, "--set", setting, "KEY=VALUE", "--set units.force=kN")
        first, _, inner = name.strip().partition(".")
        value = _value(text)
        if inner:
            data[first] = (data[first] if isinstance(data.get(first), dict) else {}) | {inner: value}
        else:
            data[first] = value
    return data


def _value(text: str) -> Any:
    try:
        value = yaml.safe_load(text)
    except yaml.YAMLError:
        return text
    return text if value is None or isinstance(value, bool) else value


def run_tensile(test: TensileTest, pictures: Path, *, picture: Path | None = None, stated: bool = True) -> tuple[Fit, Path]:
    """Fit a test and draw it as ``picture``, or in the folder ``pictures``; returns the fit and the picture.

    ``stated``: sizes of the coupon that are needed must be among the keys of the test. Raises ``LimoError``.
    """
    try:
        fit = fit_tensile(test)
    except ConfigError as error:
        if hint := _as_options(error.example):
            raise LimoError(f"{error}; as an option: {hint}") from None
        raise
    needed = [s for s in SIZES if any(s in specimen.sizes for specimen in fit.specimens) and s not in test.model_fields_set]
    if stated and needed and not all(set(needed) <= c.model_fields_set for c in test.coupons.values() or [test]):
        options = " ".join(f"--{size}" for size in needed)
        expected = f"the size of the coupon in mm, which its elongations and forces need: {options}"
        raise ConfigError(_COMMAND, needed[0], None, expected, "--length 200 --width 50 --thickness 0.19")
    return fit, draw_fit(fit, picture or pictures / f"{Path(test.files[0]).stem}.png")


def _as_options(example: str) -> str:
    """An example of keys as options of the command, "" where it is none."""
    try:
        keys = yaml.safe_load(example)
    except yaml.YAMLError:
        return ""
    if not isinstance(keys, dict) or not set(keys) <= set(TensileTest.model_fields):
        return ""
    parts = []
    for key, value in keys.items():
        text = str(value) if isinstance(value, str) else yaml.safe_dump(value, default_flow_style=True).split("\n...")[0].strip()
        parts.append(f"--set {shlex.quote(f'{key}={text}')}")
    return " ".join(parts)


def draw_fit(fit: Fit, file: Path) -> Path:
    """Draw a fit as PNG, PDF or SVG; returns the file. Raises ``LimoError`` where it cannot be written."""
    from limo.figures import style
    from limo.figures.tensile_test import draw
    from limo.files import write_whole

    if not re.fullmatch(r"\.(png|pdf|svg)", file.suffix):
        raise ConfigError(_COMMAND, "--picture", str(file), "a file .png, .pdf or .svg", "--picture mine.png")
    figure = draw(tensile_dataset(fit))
    try:
        write_whole(file, lambda path: style.save(figure, path))
    except OSError as error:
        raise LimoError(f"{file}: cannot be written ({error})") from None
    style.close(figure)
    return file


def put_into(fit: Fit, config_file: str, device: str) -> Path:
    """Put the modulus of a fit into a device of a configuration; returns its file. Raises ``LimoError``."""
    from limo.bench.device import put_modulus

    folder = Path(config_file).parent / "devices"
    files = {f.stem: f for f in sorted(folder.glob("*.y*ml"))}
    if device not in files:
        raise ConfigError(_COMMAND, "--into", device, f"one of: {', '.join(files) or 'none in ' + str(folder)}", "--into limo")
    put_modulus(files[device], fit.modulus, fit.origin)
    return files[device]


def tensile_text(fit: Fit, picture: Path, device: Path | None, *, as_json: bool) -> str:
    """What the command prints."""
    if as_json:
        return to_json(fit, picture=str(picture), **({"device": str(device)} if device else {}))
    return "\n".join([report(fit), f"picture: {picture}", *([f"{device}: youngs_modulus and modulus_origin"] if device else [])])
