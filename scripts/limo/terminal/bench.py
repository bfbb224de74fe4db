"""What ``limo tensile`` and ``limo measured`` do: fit, draw and keep a modulus; compare a study with measured curves."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
import yaml

from limo.bench.compare import comparison, study_curves
from limo.bench.curves import SAME_PRESSURE
from limo.bench.device import put_modulus
from limo.bench.tensile import Fit, fit_tensile, report, tensile_dataset, to_json
from limo.config.project import Project
from limo.config.yaml_file import parse
from limo.datasets.variables import SYMBOLS, place
from limo.errors import ConfigError, LimoError, ResultError
from limo.figures import style
from limo.figures.tensile_test import draw
from limo.schema.bench import SIZES, MeasuredCurves, TensileTest
from limo.store.files import UNREADABLE, write_whole
from limo.store.results import Results
from limo.terminal.settings import with_settings

_COMMAND = "limo tensile"
_SET = _COMMAND, "--set units.force=kN"


def test_of(files: Sequence[Path], keys: dict[str, Any], settings: Iterable[str]) -> TensileTest:
    """A tensile test by the words of a command: keys of ``TensileTest``, and settings such as ``units.force=kN``.

    Raises ``ConfigError`` for what is none.
    """
    data = with_settings({"data": [str(f) for f in files]} | {k: v for k, v in keys.items() if v is not None}, settings, *_SET)
    if "window" in data:
        data.setdefault("method", "window")
    return parse(TensileTest, data, Path(_COMMAND))


def curves_of(file: Path | None, settings: Sequence[str]) -> MeasuredCurves | None:
    """Measured curves by the words of a command; None where it names no file. Raises ``ConfigError`` for what is none."""
    if file is None:
        if settings:
            raise ConfigError(
                "limo measured", "--set", settings[0], "--data with it; a study has its keys in its own file", "--data mine.csv"
            )
        return None
    return parse(MeasuredCurves, with_settings({"data": str(file)}, settings, *_SET), Path("limo measured"))


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


# --------------------------------------------------------------------------------------------------------------------
# measured curves


def measured_table(project: Project, name: str, results: Path, measured: MeasuredCurves | None = None) -> str:
    """What was understood of the measured curves of a study, a line a case with its errors, and efficiencies side by side.

    Raises ``ConfigError`` for curves that cannot be read or a study without any, ``ResultError`` for a dataset that is none.
    """
    curves = study_curves(project, name, measured)
    if curves is None:
        expected = "measured curves: the key measured of the study, or a file as an option"
        raise ConfigError(project.files[f"studies/{name}"], "measured", None, expected, f"limo measured {name} --data mine.csv")
    lines = [*curves.understood]
    file = Results(results).study(name).dataset
    if not file.exists():
        return "\n".join([*lines, f"{file}: not gathered yet, nothing to compare with; snakemake --cores 2 {name} does that"])
    try:
        with xr.open_dataset(file) as opened:
            dataset = opened.load()
    except UNREADABLE as error:
        raise ResultError(f"{file}: not a study's dataset ({error})") from None
    found = comparison(dataset, curves, measured or project.studies[name].measured_curves)
    dims = list(dataset.case_status.dims)
    rows = []
    for index in np.ndindex(*(dataset.sizes[d] for d in dims)):
        at = dict(zip(dims, index, strict=True))
        case, errors = dataset.isel(at), found.isel(at)
        low, high = errors.measured_range.values
        rows.append(
            {SYMBOLS[d]: place(case[d].item()) for d in dims if dataset.sizes[d] > 1 or d == "n_pouches"}
            | {f"error of {label}": _percent(errors[f"measured_error_{quantity}"]) for quantity, label in _LABELS.items()}
            | {
                "P_a [kPa]": f"{low:g} to {high:g}" if np.isfinite(low) else "-",
                "N_p": place(case.n_pouches.item()) + (" (beyond)" if int(errors.measured_beyond) else ""),
                "status": str(case.case_status.values),
                "": str(errors.measured_reason.values),
            }
        )
    lines += ["", "relative L2 errors, measured curves interpolated to N_p:", pd.DataFrame(rows).to_string(index=False)]
    if np.isfinite(found.measurement_efficiency_90ml).any():
        lines += ["", "efficiency at a stroke of 90 ml:", *_efficiencies(dataset, found)]
    return "\n".join(lines)


_LABELS = {"io_ratio": "dV_v/V_a", "stroke_volume": "stroke", "actuation_volume_change": "dV_a"}


def _percent(value: xr.DataArray) -> str:
    return f"{float(value):.1%}" if np.isfinite(value) else "-"


def _efficiencies(dataset: xr.Dataset, found: xr.Dataset) -> list[str]:
    """A line a measured device, and one for each simulated N_p at the same P_v."""
    lines = []
    for k in range(found.sizes["measurement"]):
        one = found.isel(measurement=k)
        pressure, count = float(one.measurement_ventricular_pressure), float(one.measurement_n_pouches)
        if np.isfinite(one.measurement_efficiency_90ml):
            where = f"P_v = {pressure:g} kPa" if np.isfinite(pressure) else "P_v unknown"
            lines.append(f"  measured, N_p = {count:g}, {where}: {float(one.measurement_efficiency_90ml):.1%}")
    rest = {d: 0 for d in dataset.case_status.dims if d not in ("n_pouches", "ventricular_pressure")}
    for pressure in dataset.ventricular_pressure.values:
        at = found.measurement_ventricular_pressure
        if not (np.abs(at - pressure) < SAME_PRESSURE).any():
            continue
        eta = dataset.efficiency_90ml.isel(rest).sel(ventricular_pressure=pressure)
        lines += [
            f"  simulated, N_p = {n}, P_v = {pressure:g} kPa: {_percent(e)}"
            for n, e in zip(eta.n_pouches.values, eta, strict=True)
        ]
    return lines
