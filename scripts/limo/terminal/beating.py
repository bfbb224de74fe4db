"""What ``limo beat`` does: a device's surface in a circulation, its numbers and pictures, or a sweep of them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from limo.beat.bands import Members
from limo.beat.periodic import MMHG, PERIODIC_STATE, Beating, beating
from limo.beat.surface import Surface, surfaces_beside, write_surfaces
from limo.beat.sweep import swept
from limo.config.yaml_file import parse, read_yaml
from limo.errors import ConfigError, ResultError
from limo.figures import beat as figure
from limo.figures import style
from limo.schema.beat import Beat
from limo.store.files import write_netcdf
from limo.store.results import Results
from limo.terminal.settings import with_settings

COMMAND = "limo beat"


def beat_of(folder: Path, name: str, settings: Sequence[str]) -> Beat:
    """A circulation of ``folder``, or of a file, with settings such as ``driver.rate=80 1/min``.

    Raises ``ConfigError`` for one that is not there, and for a mistake in it.
    """
    file = Path(name) if name.endswith((".yaml", ".yml")) else folder / f"{name}.yaml"
    if not file.exists():
        known = ", ".join(sorted(path.stem for path in folder.glob("*.yaml")))
        raise ConfigError(COMMAND, "--in", name, f"a file, or one of: {known}", "--in healthy")
    return parse(Beat, with_settings(read_yaml(file), settings, COMMAND, "--set 'driver.rate=80 1/min'"), file)


def read_surface(study: str, results: Path, n_pouches: int | None, kept: Path | None = None) -> tuple[Surface, str]:
    """The surface of one device of a study, or of a study's file, and a name for it; ``kept``: where all are kept, too.

    Surfaces are fitted once for a study, and lie beside its dataset.
    """
    file = Path(study) if study.endswith(".nc") else Results(results).study(study).dataset
    surfaces = surfaces_beside(file)
    if kept is not None:
        write_surfaces(surfaces, kept, kept=True)
    if n_pouches is None and len(surfaces) == 1:
        n_pouches = next(iter(surfaces))
    if n_pouches not in surfaces:
        raise ConfigError(COMMAND, "--device", n_pouches, f"one of {', '.join(map(str, surfaces))}", "--device 8")
    return surfaces[n_pouches], f"{Path(study).stem}_np{n_pouches}"


def values_of(texts: Sequence[str]) -> dict[str, np.ndarray]:
    """Keys and values of a sweep: ``driver.rate=40:120:9``, in kPa, ml, s and 1/min."""
    keys = {}
    for text in texts:
        key, _, span = text.partition("=")
        try:
            low, high, count = span.split(":")
            keys[key] = np.linspace(float(low), float(high), int(count))
        except ValueError:
            raise ConfigError(
                COMMAND, "--over", text, "KEY=LOW:HIGH:COUNT, in kPa, ml, s and 1/min", "--over driver.rate=40:120:9"
            ) from None
    return keys


def run_beat(surface: Surface, beat: Beat, folder: Path, *, band: bool = False) -> str:
    """Beat, write the last beat and its picture into ``folder``; returns what is printed, with ``band`` the ranges of numbers."""
    found = beating(surface, beat)
    if not np.isfinite(found.numbers["stroke_volume"]).all():
        raise ResultError(found.reason)
    folder.mkdir(parents=True, exist_ok=True)
    dataset = found.dataset()
    dataset.attrs |= {"device": surface.device, "circulation": beat.model_dump_json()}
    write_netcdf(dataset, folder / "beat.nc")
    drawn = figure.draw(dataset)
    style.save(drawn, folder / "beat.png")
    style.close(drawn)
    ranges = _ranges(surface, beat) if band else []
    return "\n".join([*_lines(found, surface), *ranges, f"  {folder / 'beat.nc'}, {folder / 'beat.png'}"])


def _ranges(surface: Surface, beat: Beat) -> list[str]:
    """What the left device's numbers range over if any inner P_v is left out of its surface."""
    between = {name: f"{low:.3g} to {high:.3g}" for name, (low, high) in Members(surface).bands(beat).items()}
    return [
        f"  with any one P_v left out: {between['stroke_volume']} ml a beat, {between['cardiac_output']} l/min, P_a up to "
        f"{between['actuation_peak']} kPa, {between['power']} W"
    ]


def run_sweep(surface: Surface, beat: Beat, keys: dict[str, np.ndarray], folder: Path) -> str:
    """Beat with every combination of values and write ``folder/sweep.nc``; returns what is printed."""
    dataset = swept(surface, beat, keys)
    folder.mkdir(parents=True, exist_ok=True)
    dataset.attrs |= {"device": surface.device, "circulation": beat.model_dump_json()}
    write_netcdf(dataset, folder / "sweep.nc")
    status = dataset.status.values.ravel()
    lines = [f"{surface.device}: {(status == PERIODIC_STATE).sum()} of {status.size} beat periodically"]
    lines += [f"  {reason}" for reason in dict.fromkeys(r for r in dataset.reason.values.ravel() if r)][:5]
    return "\n".join([*lines, f"  {folder / 'sweep.nc'}"])


def _lines(found: Beating, surface: Surface) -> list[str]:
    between = max(float(np.max(errors)) for name, errors in surface.left_out().items() if name.startswith("ventricle"))
    missed = float(np.sqrt((surface.misfit()[:, 0] ** 2).mean()))
    lines = [
        f"{surface.device}: {found.status} after {found.beats} beats, drift {100 * found.drift:.2g} % a beat",
        *([f"  {found.reason}"] if found.reason else []),
        f"  the surface misses V_v of the study by {missed:.1f} ml; between two P_v, leaving one out changes {between:.0f} ml",
    ]
    for k in range(len(found.traces)):
        n = {name: float(value[k]) for name, value in found.numbers.items()}
        pressures = [f"{n[name] / MMHG:.0f}" for name in ("arterial_systolic", "arterial_diastolic", "arterial_mean")]
        lines += [
            f"  {'left' if k == 0 else 'right'}: {n['stroke_volume']:.1f} ml a beat, {n['cardiac_output']:.2f} l/min, ejection "
            f"fraction {100 * n['ejection_fraction']:.0f} %, arteries {pressures[0]}/{pressures[1]} mmHg, mean {pressures[2]}",
            f"    P_a up to {n['actuation_peak']:.1f} kPa, air {n['air']:.0f} ml a beat, {n['power']:.1f} W from the source; "
            f"work on the blood {n['blood_work']:.0f} mJ, {100 * n['pouch_efficiency']:.0f} % of that on the pouches, "
            f"{100 * n['source_efficiency']:.0f} % of the source's",
        ]
    return lines
