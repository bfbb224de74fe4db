"""The generated parts of ``docs/beat.md``: devices in circulations, errors of surfaces, the linear law, a rule of control."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from limo.beat.bands import Members
from limo.beat.circulations import FOLDER, read_circulations
from limo.beat.linear import fitted, linear_surface
from limo.beat.periodic import MMHG, PERIODIC_STATE, SIDES, Beating, beating
from limo.beat.surface import Surface, read_surfaces
from limo.beat.sweep import held, with_keys
from limo.reports.markdown import markdown_table
from limo.schema.beat import Beat
from limo.store.files import read_netcdf

#: kept by ``limo beat surface --keep`` and ``limo beat surface_mini --keep``
KEPT, KEPT_MINI = Path("docs/data/surfaces.nc"), Path("docs/data/surfaces_mini.nc")
#: what the authors state for their smaller device of N_p = 6 at this source (kPa), in the circulation ``healthy``
SOURCE, STATED = (
    100.0,
    {"stroke [ml]": "70", "ejection fraction [%]": "28", "arteries [mmHg]": "121/73", "mean arterial [mmHg]": "93"},
)
#: kept by ``limo gallery``: the studies of cycles, of syringes, and of the legs that surfaces are of
CYCLES, SYRINGES, LEGS = (Path("docs/gallery/data") / f"{study}.nc" for study in ("cycle", "syringe", "surface"))
#: the device of tables of one, and pressures (kPa) over which the linear law is fitted: those of a beat
DEVICE, FITTED_VENTRICULAR, FITTED_ACTUATION = 8, (0.5, 20.0), (0.0, 100.0)
#: peripheral resistances of the rule over that of the circulation, and the pressures (kPa) that a driver may have
AFTERLOADS, DRIVER = (0.5, 0.75, 1.0, 1.25, 1.5, 2.0), (20.0, 99.0)
_STUDY = "dataset of a study"
_SENSITIVITY = "dSV/dP [ml/mmHg]"
_RESISTANCE, _SOURCE = "systemic.peripheral_resistance", "driver.source_pressure"


def parts(root: Path) -> dict[str, Callable[[], str]]:
    """What makes the text of each part. Raises ``ResultError`` for a dataset that cannot be read."""

    @cache
    def surfaces() -> dict[int, Surface]:
        return read_surfaces(root / KEPT)

    @cache
    def circulations() -> dict[str, Beat]:
        return read_circulations(root / FOLDER)

    return {
        "cycles": lambda: _cycles(read_netcdf(root / CYCLES, _STUDY)),
        "syringes": lambda: _syringes(read_netcdf(root / SYRINGES, _STUDY)),
        "energy": lambda: _energy(surfaces(), read_netcdf(root / LEGS, _STUDY)),
        "devices": lambda: _devices(surfaces(), circulations()),
        "bands": lambda: _bands(surfaces()[DEVICE], circulations()),
        "surfaces": lambda: _surfaces(surfaces()),
        "authors": lambda: _authors(read_surfaces(root / KEPT_MINI)[6], circulations()["healthy"]),
        "linear": lambda: _linear(surfaces()[DEVICE], circulations()["healthy"]),
        "rule": lambda: _rule(surfaces()[DEVICE], circulations()["healthy"]),
    }


def _devices(surfaces: dict[int, Surface], circulations: dict[str, Beat]) -> str:
    """Every device in every circulation."""
    rows = []
    for name, beat in circulations.items():
        for n, surface in surfaces.items():
            found = beating(surface, beat)
            for k in range(len(found.traces)):
                device = name if k == 0 else f"{name}, {SIDES[k]}"
                rows.append({"circulation": device, "N_p": n} | _numbers(found, k))
    return markdown_table(pd.DataFrame(rows).fillna(""))


def _bands(surface: Surface, circulations: dict[str, Beat]) -> str:
    """Numbers of one device, and their ranges with any one P_v left out."""
    members, rows = Members(surface), []
    for name, beat in circulations.items():
        bands, whole = members.bands(beat), beating(surface, beat).numbers
        row = {"circulation": name}
        for key, text, unit, digits in (
            ("stroke_volume", "stroke [ml]", 1.0, 0),
            ("cardiac_output", "output [l/min]", 1.0, 2),
            ("arterial_mean", "mean arterial [mmHg]", MMHG, 0),
            ("actuation_peak", "P_a up to [kPa]", 1.0, 1),
            ("power", "power [W]", 1.0, 1),
        ):
            low, high = (value / unit for value in bands[key])
            ends = f"{low:.{digits}f} to {high:.{digits}f}" if np.isfinite(low) else "not all periodic"
            row[text] = f"{float(whole[key][0]) / unit:.{digits}f} ({ends})"
        rows.append(row)
    return markdown_table(pd.DataFrame(rows))


def _authors(surface: Surface, beat: Beat) -> str:
    """The smaller device at the authors' pressure beside what they state, with the range if any one P_v is left out."""
    beat = with_keys(beat, {_SOURCE: SOURCE})
    found, bands = beating(surface, beat), Members(surface).bands(beat)
    own = _numbers(found) | {"mean arterial [mmHg]": f"{float(found.numbers['arterial_mean'][0]) / MMHG:.0f}"}
    ends = {
        "stroke [ml]": _ends(bands["stroke_volume"], 1.0),
        "ejection fraction [%]": _ends(bands["ejection_fraction"], 0.01),
        "arteries [mmHg]": f"{_ends(bands['arterial_systolic'], MMHG)} / {_ends(bands['arterial_diastolic'], MMHG)}",
        "mean arterial [mmHg]": _ends(bands["arterial_mean"], MMHG),
    }
    rows = [
        {"": "its surface"} | {name: own[name] for name in STATED},
        {"": "with any one P_v left out"} | ends,
        {"": "stated"} | STATED,
    ]
    return markdown_table(pd.DataFrame(rows))


def _ends(band: tuple[float, float], unit: float) -> str:
    low, high = (value / unit for value in band)
    return f"{low:.0f} to {high:.0f}" if np.isfinite(low) else "not all periodic"


def _each(dataset: xr.Dataset) -> Iterator[tuple[dict[str, str], xr.Dataset]]:
    """Cases of a study over N_p and P_v: how their row begins, and what they have."""
    cases = dataset.squeeze([d for d in dataset.case_status.dims if d not in ("n_pouches", "ventricular_pressure")])
    for n in cases.n_pouches.values:
        for pressure in cases.ventricular_pressure.values:
            case = cases.sel(n_pouches=n, ventricular_pressure=pressure)
            yield {"N_p": str(int(n)), "P_v [kPa]": f"{pressure:g}", "status": str(case.case_status.values)}, case


def _cycles(dataset: xr.Dataset) -> str:
    """What the first cycle takes and leaves, and how far the second one is from it."""
    rows = []
    for row, case in _each(dataset):
        given = float(case.leg_actuation_work.sel(leg=0))
        rows.append(
            row
            | {
                "first cycle takes [mJ]": f"{float(case.hysteresis_dissipated):.0f}",
                "of the ramp's work [%]": f"{100 * float(case.hysteresis_dissipated) / given:.0f}",
                "V_v after it less before [ml]": f"{float(case.residual_ventricle_volume):+.1f}",
                "V_a [ml]": f"{float(case.residual_actuation_volume):+.1f}",
                "second cycle off by [%]": f"{100 * float(case.second_cycle_difference):.1f}",
            }
        )
    return markdown_table(pd.DataFrame(rows))


def _syringes(dataset: xr.Dataset) -> str:
    """The pressure that a volume needs, where it falls on the way there, and what the way there and back takes."""
    rows = []
    for row, case in _each(dataset):
        there = case.leg_pressure_of_volume.sel(leg=1).dropna("given_volume")
        falls = np.diff(there.values)
        rows.append(
            row
            | {
                "V_a [ml]": f"{float(there.given_volume[-1]):.0f}",
                "P_a there [kPa]": f"{float(case.leg_actuation_pressure.sel(leg=1)):.1f}",
                "largest fall of P_a on the way [kPa]": f"{max(0.0, -falls.min()):.1f}",
                "there and back takes [mJ]": f"{float(case.hysteresis_dissipated):.0f}",
                "of the work there [%]": f"{100 * float(case.hysteresis_dissipated / case.leg_actuation_work.sel(leg=1)):.0f}",
            }
        )
    return markdown_table(pd.DataFrame(rows))


def _energy(surfaces: dict[int, Surface], dataset: xr.Dataset) -> str:
    """Along ramps: what snaps take, and how far the work by the surface is from that by the solved volumes."""
    cases = dataset.squeeze([d for d in dataset.case_status.dims if d not in ("n_pouches", "ventricular_pressure")], drop=True)
    rows = []
    for n, surface in surfaces.items():
        ramp = cases.sel(n_pouches=n, leg=0)
        given = ramp.leg_actuation_work.values
        taken = 100 * ramp.leg_dissipated.values / given
        off = 100 * np.array([_work(surface, float(p)) for p in ramp.ventricular_pressure]) / given
        off -= 100 * (given + ramp.leg_ventricular_work.values) / given
        rows.append(
            {
                "N_p": n,
                "work of P_a [mJ]": f"{given.min():.0f} to {given.max():.0f}",
                "snaps take of it [%]": f"{taken.min():.1f} to {taken.max():.1f}",
                "work of both by the surface off by [%]": f"{off.min():+.1f} to {off.max():+.1f}",
            }
        )
    return markdown_table(pd.DataFrame(rows))


def _work(surface: Surface, ventricular: float) -> float:
    """Work (mJ) of P_a and P_v along a ramp at a P_v (kPa) on the sheet of loading."""
    ventricle, pouches = (v[0] for v in surface.potentials[0].volumes(np.array([ventricular]), surface.actuation))
    return float(np.trapezoid(surface.actuation, pouches)) + ventricular * float(ventricle[-1] - ventricle[0])


def _numbers(found: Beating, side: int = 0) -> dict[str, str]:
    n = {name: float(value[side]) for name, value in found.numbers.items()}
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
    rows, needed, against, curve = [], [], [], []
    for factor in AFTERLOADS:
        loaded = with_keys(beat, {_RESISTANCE: factor * beat.systemic.peripheral_resistance})
        free, pressure = beating(surface, loaded), held(surface, loaded, "cardiac_output", target, _SOURCE, *DRIVER)
        row = {"R_p over that of the circulation": f"{factor:g}"}
        row |= _pressure_and_stroke(free, "same driver: ") | {_SENSITIVITY: ""}
        curve.append([float(free.numbers[name][0]) for name in ("arterial_mean", "stroke_volume")])
        if np.isfinite(pressure):
            controlled = beating(surface, with_keys(loaded, {_SOURCE: pressure}))
            needed.append(pressure)
            against.append(float(controlled.numbers["arterial_mean"][0]))
            row |= {"held: source [kPa]": f"{pressure:.1f}", "held: mean arterial [mmHg]": f"{against[-1] / MMHG:.0f}"}
        else:
            row |= {"held: source [kPa]": "not reached", "held: mean arterial [mmHg]": ""}
        rows.append(row)
    pressure, stroke = np.array(curve).T
    for row, slope in zip(rows, np.gradient(stroke, pressure / MMHG), strict=True):
        row[_SENSITIVITY] = f"{slope:.2f}"
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
