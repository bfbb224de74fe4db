"""The generated parts of ``docs/beat.md``: devices in circulations, errors of surfaces, the linear law, a rule of control."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd

from limo.beat.linear import fitted, linear_surface
from limo.beat.periodic import MMHG, PERIODIC_STATE, Beating, beating
from limo.beat.surface import Surface, read_surfaces
from limo.beat.sweep import held, with_keys
from limo.config.yaml_file import parse, read_yaml
from limo.reports.markdown import markdown_table
from limo.schema.beat import Beat

#: kept by ``limo beat surface --keep``, and where circulations are
KEPT, CIRCULATIONS = Path("docs/data/surfaces.nc"), Path("config/beats")
#: the device of tables of one, and pressures (kPa) over which the linear law is fitted: those of a beat
DEVICE, FITTED_VENTRICULAR, FITTED_ACTUATION = 8, (0.5, 20.0), (0.0, 100.0)
#: peripheral resistances of the rule over that of the circulation, and the pressures (kPa) that a driver may have
AFTERLOADS, DRIVER = (0.5, 0.75, 1.0, 1.25, 1.5, 2.0), (20.0, 99.0)
_RESISTANCE, _SOURCE = "systemic.peripheral_resistance", "driver.source_pressure"


def parts(root: Path) -> dict[str, Callable[[], str]]:
    """What makes the text of each part. Raises ``ResultError`` for a dataset that cannot be read."""

    @cache
    def surfaces() -> dict[int, Surface]:
        return read_surfaces(root / KEPT)

    @cache
    def circulations() -> dict[str, Beat]:
        files = sorted((root / CIRCULATIONS).glob("*.yaml"))
        return {file.stem: parse(Beat, read_yaml(file), file) for file in files}

    return {
        "devices": lambda: _devices(surfaces(), circulations()),
        "surfaces": lambda: _surfaces(surfaces()),
        "linear": lambda: _linear(surfaces()[DEVICE], circulations()["healthy"]),
        "rule": lambda: _rule(surfaces()[DEVICE], circulations()["healthy"]),
    }


def _devices(surfaces: dict[int, Surface], circulations: dict[str, Beat]) -> str:
    """Every device in every circulation."""
    rows = [
        {"circulation": name, "N_p": n} | _numbers(beating(surface, beat))
        for name, beat in circulations.items()
        for n, surface in surfaces.items()
    ]
    return markdown_table(pd.DataFrame(rows).fillna(""))


def _numbers(found: Beating) -> dict[str, str]:
    n = {name: float(value[0]) for name, value in found.numbers.items()}
    if found.status != PERIODIC_STATE:
        return {"state": f"{found.status}: {found.reason}"}
    return {
        "state": found.status,
        "stroke [ml]": f"{n['stroke_volume']:.0f}",
        "output [l/min]": f"{n['cardiac_output']:.2f}",
        "ejection fraction [%]": f"{100 * n['ejection_fraction']:.0f}",
        "arteries [mmHg]": f"{n['arterial_systolic'] / MMHG:.0f}/{n['arterial_diastolic'] / MMHG:.0f}",
        "P_a up to [kPa]": f"{n['actuation_peak']:.0f}",
        "air [ml]": f"{n['air']:.0f}",
        "power [W]": f"{n['power']:.1f}",
        "blood over pouches [%]": f"{100 * n['pouch_efficiency']:.0f}",
        "drift [%]": f"{100 * found.drift:.1g}",
    }


def _surfaces(surfaces: dict[int, Surface]) -> str:
    """What leaving a P_v out changes, and how far the sheets lie apart."""
    rows = []
    for n, surface in surfaces.items():
        errors = surface.left_out()
        apart = np.abs(surface.volumes[0] - surface.volumes[1])
        rows.append(
            {
                "N_p": n,
                "range of V_v [ml]": f"{surface.range:.0f}",
                "potential misses V_v: mean, largest [ml]": _mean(surface.misfit()[:, 0]),
                "V_a [ml]": _mean(surface.misfit()[:, 1]),
                "V_v without a P_v: median, largest [ml]": _two(errors["ventricle_loading"], errors["ventricle_unloading"]),
                "V_a without a P_v [ml]": _two(errors["actuation_loading"], errors["actuation_unloading"]),
                "sheets of V_v apart: mean, largest [ml]": f"{apart[0].mean():.1f}, {apart[0].max():.0f}",
            }
        )
    return markdown_table(pd.DataFrame(rows))


def _mean(errors: np.ndarray) -> str:
    return f"{np.sqrt((errors**2).mean()):.1f}, {np.abs(errors).max():.0f}"


def _two(*errors: np.ndarray) -> str:
    each = np.concatenate(errors)
    return f"{np.median(each):.1f}, {each.max():.0f}"


def _linear(surface: Surface, beat: Beat) -> str:
    """The fitted law, and the same circulation with it."""
    law = fitted(surface, FITTED_VENTRICULAR, FITTED_ACTUATION)
    sentence = (
        f"Fitted to {surface.device} between P_v = {FITTED_VENTRICULAR[0]:g} and {FITTED_VENTRICULAR[1]:g} kPa and P_a up to "
        f"{FITTED_ACTUATION[1]:g} kPa: P_v = {law.actuation:.3f} P_a + {law.elastance / MMHG:.3f} V_v - {-law.offset / MMHG:.1f} "
        f"(mmHg, ml), R2 = {law.determination:.2f}, root mean square error {law.error / MMHG:.1f} mmHg."
    )
    rows = [
        {"device": name} | _numbers(beating(one, beat))
        for name, one in (("its surface", surface), ("the linear law", linear_surface(surface, law)))
    ]
    return f"{sentence}\n\n{markdown_table(pd.DataFrame(rows))}"


def _rule(surface: Surface, beat: Beat) -> str:
    """Stroke over afterload, and the source pressure that holds the output."""
    target = float(beating(surface, beat).numbers["cardiac_output"][0])
    rows, needed, against = [], [], []
    for factor in AFTERLOADS:
        loaded = with_keys(beat, {_RESISTANCE: factor * beat.systemic.peripheral_resistance})
        free, pressure = beating(surface, loaded), held(surface, loaded, "cardiac_output", target, _SOURCE, *DRIVER)
        row = {"R_p over that of the circulation": f"{factor:g}"}
        row |= _pressure_and_stroke(free, "same driver: ")
        if np.isfinite(pressure):
            controlled = beating(surface, with_keys(loaded, {_SOURCE: pressure}))
            needed.append(pressure)
            against.append(float(controlled.numbers["arterial_mean"][0]))
            row |= {"held: source [kPa]": f"{pressure:.1f}", "held: mean arterial [mmHg]": f"{against[-1] / MMHG:.0f}"}
        else:
            row |= {"held: source [kPa]": "not reached", "held: mean arterial [mmHg]": ""}
        rows.append(row)
    slope, offset = np.polyfit(against, needed, 1)
    miss = np.abs(slope * np.array(against) + offset - needed).max()
    sentence = (
        f"Output held at {target:.2f} l/min: a source of {slope:.2f} times the mean arterial pressure {offset:+.1f} kPa misses "
        f"what is needed by {miss:.1f} kPa at most."
    )
    return f"{markdown_table(pd.DataFrame(rows))}\n\n{sentence}"


def _pressure_and_stroke(found: Beating, text: str) -> dict[str, str]:
    stroke, pressure = (float(found.numbers[n][0]) for n in ("stroke_volume", "arterial_mean"))
    return {f"{text}stroke [ml]": f"{stroke:.1f}", f"{text}mean arterial [mmHg]": f"{pressure / MMHG:.0f}"}
