"""The statements of the paper that can be tested, against the datasets of the studies: a verdict each, computed and never typed.

A statement about many cases is counted: ``reproduced`` where it holds for all of them, ``not`` where it holds for less than
half. One about a number has two bands around the paper's value. Cases that failed count as cases where it does not hold; those
that are degraded are judged, and counted beside the verdicts.

Each judge reads the paper in one way, which stands in the table. Where a sentence can be read in another way, a second judge has
that reading, and its verdict is shown if it is another one. What the paper describes over the ramp is judged from P_v up to the
first contact of front and back, beyond which the model without contact means nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from limo.datasets.curves import at_end
from limo.errors import LimoError
from limo.measure.states import in_contact, lowest
from limo.reports.markdown import markdown_table, read_rows
from limo.store.files import write_whole
from limo.store.statuses import DEGRADED, MISSING, USABLE

Judge = Callable[[xr.Dataset], tuple[str, str]]
VERDICTS = ("reproduced", "partly", "not", "no data")
#: kPa over which the fastest rise of V_a is taken, and the share of V_a at P_a,max from which on a ratio counts
RISE, ONSET_SHARE = 2.0, 0.05
#: kPa above P_v at which the pouches have begun to inflate
BEGUN = 1.0
#: the frame in which stresses are compared that P_a - P_v is equal in
ABOVE = "P_v + 40"
#: the table of an inference beside the datasets whose geometry came from it
INFERRED = "inference.csv"
SEALED = ("seam", "valve_edge", "outer_edge")


@dataclass(frozen=True)
class Statement:
    """A statement of the paper: where it stands, what it says and which number, the study that tests it, and how.

    ``readings`` are judges by how they read the paper, the one that counts first. A judge takes the study's dataset and returns
    what was found and the verdict. ``known`` says what is known about a difference and is shown only where there is one.
    """

    section: str
    text: str
    paper: str
    study: str
    readings: Mapping[str, Judge]
    known: str

    @property
    def reading(self) -> str:
        """How the judge that counts reads the paper."""
        return next(iter(self.readings))


def counted(checks: Iterable[bool], of: str) -> tuple[str, str]:
    """Verdict on a statement about many: all, at least half of them, or fewer; ``of`` names them."""
    collected = [bool(c) for c in checks]
    share = sum(collected) / len(collected)
    verdict = "reproduced" if share == 1 else "partly" if share >= 0.5 else "not"
    return f"{sum(collected)} of {len(collected)} {of}", verdict


def graded(value: float, low: float, high: float, wider: float) -> str:
    """Verdict on a number: within [low, high], within ``wider`` of it, or not; what is no number is not."""
    if low <= value <= high:
        return "reproduced"
    return "partly" if low - wider <= value <= high + wider else "not"


# --------------------------------------------------------------------------------------------------------------------
# what is looked at


def _end(dataset: xr.Dataset, name: str) -> xr.DataArray:
    """A curve's value at the case's own P_a,max; NaN for one that failed before."""
    return at_end(dataset[name]).where(dataset.case_status.isin(USABLE))


def _each(array: xr.DataArray) -> np.ndarray:
    return array.values.ravel()


def _falling(array: xr.DataArray, dim: str) -> list[bool]:
    """Whether neighbours along ``dim`` fall, one entry a pair; what is no number does not."""
    return [bool(v) for v in (array.diff(dim) < 0).values.ravel()]


def _range(values: np.ndarray, form: str = "{:.1f}") -> str:
    known = values[np.isfinite(values)]
    return f"{form} to {form}".format(known.min(), known.max()) if len(known) else "none"


def up_to_contact(dataset: xr.Dataset) -> xr.Dataset:
    """The same without the part of the curves beyond the first frame in which front and back would touch, where that is known.

    All of it where they do touch in the models: what is marked there is where they are pressed into each other, in places.
    """
    if "contact_front_back" not in dataset or in_contact(dataset):
        return dataset
    clear = ~(dataset.actuation_pressure >= dataset.contact_front_back)
    return dataset.assign({n: v.where(clear) for n, v in dataset.data_vars.items() if "actuation_pressure" in v.dims})


def onset_pressures(dataset: xr.Dataset, name: str = "actuation_volume_change") -> xr.DataArray:
    """P_a (kPa) at which the tangent to a pouch volume where it rises fastest, over ``RISE`` kPa, meets zero, by case."""
    step = float(dataset.actuation_pressure.diff("actuation_pressure").median())
    span = max(1, round(RISE / step))
    volume, pressure = dataset[name], dataset.actuation_pressure
    slope = (volume.shift(actuation_pressure=-span) - volume) / (pressure.shift(actuation_pressure=-span) - pressure)
    steepest = slope.fillna(-np.inf).argmax("actuation_pressure")
    position = {"actuation_pressure": steepest}
    return (pressure.isel(position) - volume.isel(position) / slope.isel(position)).where(
        slope.notnull().any("actuation_pressure")
    )


def _peak(dataset: xr.Dataset, frame: str = "max") -> xr.DataArray:
    """Top-5 % von Mises stress (MPa) in a frame, at P_a,max if none is named."""
    return dataset.von_mises_peak.sel(frame=frame)


def _relative(values: xr.DataArray, dim: str, reference: float) -> dict[float, float]:
    """Values over the one at ``reference`` along ``dim``, less one, for the others."""
    change = values / values.sel({dim: reference}) - 1
    return {float(k): float(v) for k, v in zip(values[dim].values, change.values, strict=True) if k != reference}


def _percentages(changes: dict[float, float], symbol: str) -> str:
    return ", ".join(f"{symbol} {k:g}: {v:+.1%}" for k, v in changes.items())


# --------------------------------------------------------------------------------------------------------------------
# the judges


def _onset(name: str, *, clear: bool) -> Judge:
    """Where the tangent to a pouch volume meets zero, over the ramp up to contact if ``clear``."""

    def judge(d: xr.Dataset) -> tuple[str, str]:
        away = onset_pressures(up_to_contact(d) if clear else d, name) - d.ventricular_pressure
        text, verdict = counted(_each(np.abs(away) <= 3.0), "cases within 3 kPa")
        return f"{text}; {_range(_each(away), '{:+.1f}')} kPa from P_v", verdict

    return judge


def _sharp_rise(d: xr.Dataset) -> tuple[str, str]:
    low = d.sel(ventricular_pressure=3.8)
    position = low.actuation_volume_change.interp(actuation_pressure=[3.8, 20.0, 60.0])
    before, after = (position.isel(actuation_pressure=k + 1) - position.isel(actuation_pressure=k) for k in (0, 1))
    times = (before / 16.2) / (after / 40.0)
    text, verdict = counted(_each(times >= 2.0), "devices rise at least twice as fast below 20 kPa as above")
    return f"{text}; {_range(_each(times))} times", verdict


def _ratio_above_one(name: str, *, clear: bool) -> Judge:
    """Whether the ratio exceeds one at P_a,max, or before contact if ``clear``."""

    def judge(d: xr.Dataset) -> tuple[str, str]:
        solved = d.case_status.isin(USABLE)
        ratio = _each(at_end(up_to_contact(d)[name]).where(solved) if clear else _end(d, name))
        text, verdict = counted(ratio > 1.0, "cases before contact" if clear else "cases at P_a,max")
        return f"{text}; {_range(ratio, '{:.2f}')}", verdict

    return judge


def _ratio_begins_at_one(d: xr.Dataset) -> tuple[str, str]:
    begun = d.io_ratio.interp(actuation_pressure=d.ventricular_pressure + BEGUN)
    text, verdict = counted(_each(np.abs(begun - 1.0) <= 0.2), f"cases within 0.2 of one at P_v + {BEGUN:g} kPa")
    return f"{text}; {_range(_each(begun), '{:.2f}')}", verdict


def _ratio_starts_at_one(d: xr.Dataset) -> tuple[str, str]:
    started = d.io_ratio_of_change.where(d.actuation_volume_change >= ONSET_SHARE * _end(d, "actuation_volume_change"))
    first = started.isel(actuation_pressure=started.notnull().argmax("actuation_pressure"))
    text, verdict = counted(_each(np.abs(first - 1.0) <= 0.2), "cases within 0.2 of one at their onset")
    return f"{text}; {_range(_each(first), '{:.2f}')}", verdict


def _mean_ratio_falls(d: xr.Dataset) -> tuple[str, str]:
    """The mean ratio from P_v on of two neighbouring devices, over the pressures that both reach before contact."""
    clear = up_to_contact(d).io_ratio.where(d.case_status.isin(USABLE)).where(d.actuation_pressure >= d.ventricular_pressure)
    more, fewer = clear.isel(n_pouches=slice(1, None)), clear.isel(n_pouches=slice(None, -1))
    fewer = fewer.assign_coords(n_pouches=more.n_pouches)
    both = more.notnull() & fewer.notnull()
    lead = (fewer.where(both).mean("actuation_pressure") / more.where(both).mean("actuation_pressure") - 1) * 100
    text, verdict = counted(_each(lead > 0), "steps to more pouches")
    return f"{text}; fewer pouches lead by {_range(_each(lead), '{:+.0f}')} %", verdict


def _falls_with_pouches(name: str) -> Judge:
    def judge(d: xr.Dataset) -> tuple[str, str]:
        values = _end(d, name) if "actuation_pressure" in d[name].dims else d[name]
        return counted(_falling(values, "n_pouches"), "steps to more pouches")

    return judge


def _efficiency_range(d: xr.Dataset) -> tuple[str, str]:
    eta = 100 * _each(d.efficiency_90ml)
    text, verdict = counted((eta >= 43) & (eta <= 89), "cases")
    return f"{text}; {_range(eta)} %", verdict


def _efficiency_rises(d: xr.Dataset) -> tuple[str, str]:
    return counted(_falling(-d.efficiency_90ml, "ventricular_pressure"), "steps to a higher P_v")


def _jump(d: xr.Dataset) -> tuple[str, str]:
    case = d.sel(n_pouches=6, ventricular_pressure=3.8)
    middle, jump = (_each(v) for v in (0.5 * (case.buckling_before + case.buckling_after), case.buckling_jump))
    known = np.isfinite(middle)
    if not known.any():
        return "no jump", "not"
    largest, nearest = int(np.nanargmax(np.abs(jump))), int(np.nanargmin(np.abs(middle - 30.0)))
    text, verdict = f"{jump[largest]:+.1f} ml at {middle[largest]:.1f} kPa", graded(middle[largest], 26.0, 34.0, 4.0)
    if nearest != largest:
        text += f", the largest of {known.sum()}; {jump[nearest]:+.1f} ml at {middle[nearest]:.1f} kPa"
        verdict = "partly" if verdict == "not" and 26.0 <= middle[nearest] <= 34.0 else verdict
    return text, verdict


def _concentrated(d: xr.Dataset) -> tuple[str, str]:
    share = d.von_mises_peak_share.sel(frame="max", zone=list(SEALED)).sum("zone", skipna=False)
    times = _each(share / d.zone_share.sel(zone=list(SEALED)).sum("zone", skipna=False))
    text, verdict = counted(times >= 1.5, "cases with at least 1.5 times their share of the area")
    return f"{text}; {_range(times)} times", verdict


def _more_with_fewer(d: xr.Dataset) -> tuple[str, str]:
    peak = _peak(d)
    more = float((peak.sel(n_pouches=4) / peak.sel(n_pouches=10) - 1).max())
    return f"N_p = 4 over 10: {more:+.0%} at most", graded(more, 0.35, 0.65, 0.25)


def _weakly_with_pressure(frame: str) -> Judge:
    def judge(d: xr.Dataset) -> tuple[str, str]:
        peak = _peak(d, frame)
        spread = _each((peak.max("ventricular_pressure") - peak.min("ventricular_pressure")) / peak.mean("ventricular_pressure"))
        text, verdict = counted(spread <= 0.15, "devices within 15 %")
        return f"{text}; {_range(100 * spread, '{:.0f}')} %", verdict

    return judge


def _outside_around(d: xr.Dataset) -> tuple[str, str]:
    share = _each(d.direction_around.sel(frame="max", side="epicardial"))
    text, verdict = counted(share > 0.5, "devices on most of the pouch area")
    return f"{text}; {_range(100 * share, '{:.0f}')} % of it", verdict


def _orthogonal(d: xr.Dataset) -> tuple[str, str]:
    angle = _each(d.direction_between.sel(frame="max"))
    text, verdict = counted(angle >= 60.0, "devices with a median angle of 60 degrees or more")
    return f"{text}; {_range(angle, '{:.0f}')} degrees", verdict


def _aligned(d: xr.Dataset) -> tuple[str, str]:
    position, all_over = (d[n].sel(frame="max") for n in ("direction_between_at_seams", "direction_between"))
    text, verdict = counted(_each(position < all_over), "devices with a smaller median angle near seams")
    return f"{text}; {_range(_each(position), '{:.0f}')} degrees there", verdict


def _valve_range(d: xr.Dataset) -> tuple[str, str]:
    eta = 100 * _each(d.efficiency_90ml)
    text, verdict = counted((eta >= 58.3) & (eta <= 67.8), "within one point of that range")
    return f"{text}; {_range(eta)} %", verdict


def _largest_at(name: str, dim: str, where: float, among: Sequence[float]) -> Judge:
    """Whether the largest value along a design axis is at ``where``; at a neighbour ``among`` it is so partly."""

    def judge(d: xr.Dataset) -> tuple[str, str]:
        values = _end(d, name) if "actuation_pressure" in d[name].dims else d[name]
        values = values.squeeze(drop=True)
        if not values.notnull().all():
            return "cases are missing", "not"
        collected = float(values[dim][int(values.values.argmax())])
        listed = ", ".join(f"{k:g}: {v:.3g}" for k, v in zip(values[dim].values, values.values, strict=True))
        return f"at {collected:g} ({listed})", "reproduced" if collected == where else "partly" if collected in among else "not"

    return judge


def _stroke_over_valves(d: xr.Dataset) -> tuple[str, str]:
    stroke = _each(_end(d, "stroke_volume"))
    spread = float((stroke.max() - stroke.min()) / stroke.mean())
    return f"{_range(stroke)} ml, {spread:.0%} apart", graded(spread, 0.0, 0.05, 0.05)


def _stress_over_valves(d: xr.Dataset) -> tuple[str, str]:
    changes = _relative(_peak(d).squeeze(drop=True), "aspect_ratio", 3.0)
    return _percentages(changes, "AR"), graded(min(changes.values()), -0.12, -0.04, 0.04)


def _softer(d: xr.Dataset) -> tuple[str, str]:
    changes = _relative(_peak(d).squeeze(drop=True), "stiffness_ratio", 1.0)
    below = {k: v for k, v in changes.items() if k < 1}
    return _percentages(below, "E_hat"), graded(float(np.mean(list(below.values()))), -0.14, -0.06, 0.05)


def _stiffer(d: xr.Dataset) -> tuple[str, str]:
    changes = _relative(_peak(d).squeeze(drop=True), "stiffness_ratio", 1.0)
    return _percentages({1.25: changes[1.25]}, "E_hat"), graded(changes[1.25], 0.0, 0.10, 0.04)


def _hardly_changes(d: xr.Dataset) -> tuple[str, str]:
    curves = d.stroke_volume.squeeze(drop=True)
    first = curves.isel(variant=0)
    apart = {str(v): _distance(curves.sel(variant=v), first) for v in curves.variant.values[1:]}
    told = {0.0: "not tested (same solution)"}  # equilibria know no rate: the engine solves one case for both
    text = ", ".join(f"{k} {'not known (no solution)' if np.isnan(v) else told.get(v, f'{v:.1%}')}" for k, v in apart.items())
    text = f"stroke differs from {curves.variant.values[0]} by: {text}"
    compared = [value for value in apart.values() if value > 0]
    if not compared:
        return text, "no data"
    verdict = graded(max(compared), 0.0, 0.05, 0.05)
    return text, "partly" if verdict == "reproduced" and len(compared) < len(apart) else verdict


def _distance(curve: xr.DataArray, other: xr.DataArray) -> float:
    """Relative L2 distance over the ramp of ``other``; NaN, which no band holds, where the curve ends before it."""
    position = {"actuation_pressure": np.flatnonzero(other.notnull())}
    return float(np.linalg.norm((curve - other).isel(position)) / np.linalg.norm(other.isel(position)))


def _rest_volume(d: xr.Dataset) -> tuple[str, str]:
    volume = float(d.ventricle_volume.sel(n_pouches=8, ventricular_pressure=3.8).isel(actuation_pressure=0))
    return f"{volume:.0f} ml (N_p = 8)", graded(volume, 285.0, 315.0, 15.0)


def _with(n_pouches: int, judge: Judge) -> Judge:
    """A judge of one device of a study of several."""
    return lambda d: judge(d.sel(n_pouches=[n_pouches]))


def _designs(reading: str, judge: Judge) -> dict[str, Judge]:
    """The readings of a statement about a change of the design, of which the paper does not say the number of pouches."""
    return {f"N_p = {n}: {reading}": _with(n, judge) for n in (6, 8)}


_GEOMETRY = "The seams of N_p = 6 and 10 are not public"
_SCATTER = "On coarse meshes strokes vary between meshes and between wrinkle states (docs/accuracy.md)."
_FOLD = "The softest design has the largest value here, with contact and without."
_STEPS = "every step to more pouches at a P_v"
STATEMENTS = (
    Statement("Pressure-volume", "V_a starts to grow when P_a comes near P_v", "P_a near P_v", "afterload",
              {"up to contact, the tangent to V_a at its fastest rise meets zero there": _onset("actuation_volume", clear=True),
               "the same of the change since P_a = 0, over all of the ramp": _onset("actuation_volume_change", clear=False)},
              "The epicardium is loaded by P_a alone and bulges before the endocardium gives way."),
    Statement("Pressure-volume", "V_a rises sharply up to some 20 kPa, then gradually", "P_a about 20 kPa at P_v = 3.8",
              "afterload", {"slope from P_v to 20 kPa over that from 20 to 60 kPa": _sharp_rise},
              f"{_GEOMETRY}. Wide pouches snap open at once, narrow ones fold open one by one."),
    Statement("Pressure-volume", "less in, more out: the ratio exceeds one for all devices", "> 1", "afterload",
              {"Delta V_v / V_a before contact, else at P_a,max": _ratio_above_one("io_ratio", clear=True),
               "Delta V_v / V_a at P_a,max": _ratio_above_one("io_ratio", clear=False),
               "Delta V_v over the change of V_a at P_a,max": _ratio_above_one("io_ratio_of_change", clear=False)},
              f"{_GEOMETRY}."),
    Statement("Pressure-volume", "the ratio starts close to one", "about 1", "afterload",
              {f"Delta V_v / V_a at P_v + {BEGUN:g} kPa, when pouches begin to inflate": _ratio_begins_at_one,
               "Delta V_v over the change of V_a, when 5 % of that is reached": _ratio_starts_at_one},
              "The change of V_a grows faster than the stroke while the endocardium is still pushed outwards."),
    Statement("Pressure-volume", "fewer pouches, more stroke", "falls with N_p", "afterload",
              {f"stroke at P_a,max, {_STEPS}": _falls_with_pouches("stroke_volume")}, f"{_GEOMETRY}. {_SCATTER}"),
    Statement("Afterload", "fewer pouches, higher ratio", "falls with N_p", "afterload",
              {f"mean Delta V_v / V_a from P_v up to contact, {_STEPS}": _mean_ratio_falls,
               f"Delta V_v / V_a at P_a,max, {_STEPS}": _falls_with_pouches("io_ratio"),
               f"Delta V_v over the change of V_a at P_a,max, {_STEPS}": _falls_with_pouches("io_ratio_of_change")},
              f"{_GEOMETRY}. The layout of the seams decides how much volume goes into the pouches. Other meshes, elements, "
              "lengths and contact leave the order as it is."),
    Statement("Afterload", "efficiencies at 90 ml", "43 to 89 %", "afterload",
              {"every device and P_v within that range": _efficiency_range}, f"{_GEOMETRY}. {_SCATTER}"),
    Statement("Afterload", "efficiency rises with P_v", "rises", "afterload",
              {"at 90 ml, every step to a higher P_v of a device": _efficiency_rises}, _SCATTER),
    Statement("Afterload", "efficiency falls with N_p", "falls", "afterload",
              {f"at 90 ml, {_STEPS}": _falls_with_pouches("efficiency_90ml")}, f"{_GEOMETRY}. {_SCATTER}"),
    Statement("Buckling", "N_p = 6 jumps at P_v = 3.8 kPa", "about 30 kPa", "buckling",
              {"the largest jump of the stroke within 4 kPa of 30": _jump},
              "Where a fold snaps depends on the wrinkle state and on the mesh."),
    Statement("Stress", "stress concentrates on seams and in buckled regions", "qualitative", "stress",
              {"the highest 5 % lie near seams and edges 1.5 times as often as their area": _concentrated},
              "The zones of this row are only seams and edges. Folds elsewhere count against it."),
    Statement("Stress", "fewer pouches, up to 50 % more peak stress", "+50 %", "stress",
              {"top 5 % at P_a,max, N_p = 4 over 10, the largest over P_v": _more_with_fewer},
              f"{_GEOMETRY}. Contact stops N_p = 4 where it is in the model."),
    Statement("Stress", "peak stress depends weakly on P_v", "weak", "stress",
              {"top 5 % at each P_v's own P_a,max, within 15 %": _weakly_with_pressure("max"),
               f"top 5 % at {ABOVE}, within 15 %": _weakly_with_pressure(ABOVE)},
              "P_a,max - P_v rises from 56 to 116 kPa with P_v, and the stress follows that difference, on "
              "coarse meshes, too."),
    Statement("Strain", "outside, the largest strain runs around the device", "predominantly", "strain_paths",
              {"within 45 degrees of around on most of the area": _outside_around},
              "Wrinkles of the outer wall turn it locally."),
    Statement("Strain", "inside, it runs about at right angles to that", "about 90 degrees", "strain_paths",
              {"median angle between both surfaces of at least 60 degrees": _orthogonal},
              "The angle is largest where pouches begin to fill, and falls as P_a rises. It is largest on pouches on the axis, "
              "as the figure shows. At the sides both run around the device. Meshes, engines and contact leave that as it is."),
    Statement("Strain", "at seams the directions of both surfaces align", "aligned", "strain_paths",
              {"median angle near seams below that of all": _aligned},
              "Near a seam the directions turn within an element or two."),
    Statement("Valve support", "efficiency over AR", "59.3 to 66.8 %", "valve_support",
              _designs("every AR within one point of that range", _valve_range),
              "The paper does not say the number of pouches of this study. Finer meshes and softer elements are more efficient; "
              "its own element on its own density is the column as_in_paper."),
    Statement("Valve support", "efficiency is largest at AR = 2.5", "2.5", "valve_support",
              _designs("at 90 ml, neighbours are partly so", _largest_at("efficiency_90ml", "aspect_ratio", 2.5, (2.0, 3.0))),
              "It is largest at AR = 1 or 1.5 here, with contact and without. The differences are hardly larger than those "
              "between solutions of one design."),
    Statement("Valve support", "AR hardly changes the stroke", "little", "valve_support",
              _designs("strokes at P_a,max within 5 %", _stroke_over_valves), _SCATTER),
    Statement("Valve support", "smaller AR, less peak stress than at AR = 3", "-8 %", "valve_support",
              _designs("top 5 % at P_a,max, the lowest over AR", _stress_over_valves), _SCATTER),
    Statement("Compliance", "E_hat below one, less peak stress", "about -10 %", "compliance",
              _designs("top 5 % at P_a,max, mean of those below one", _softer), _SCATTER),
    Statement("Compliance", "E_hat = 1.25, more peak stress", "up to +8 %", "compliance",
              _designs("top 5 % at P_a,max", _stiffer), _SCATTER),
    Statement("Compliance", "the largest stroke is that of E_hat = 0.75", "0.75", "compliance",
              _designs("at P_a,max, neighbours are partly so", _largest_at("stroke_volume", "stiffness_ratio", 0.75, (0.5, 1.0))),
              _FOLD),
    Statement("Compliance", "the largest efficiency is that of E_hat = 0.75", "0.75", "compliance",
              _designs("at 90 ml, neighbours are partly so", _largest_at("efficiency_90ml", "stiffness_ratio", 0.75, (0.5, 1.0))),
              _FOLD),
    Statement("Initial conditions", "symmetry and loading rate hardly change the curves", "very weakly", "symmetry",
              {"relative L2 distance of the stroke over the ramp within 5 %": _hardly_changes},
              "Halves of a device may fold differently and end in another wrinkle state. Newton computes "
              "equilibria, which do not depend on the rate."),
    Statement("Geometry", "the device holds 300 ml", "300 ml", "afterload",
              {"V_v of N_p = 8 at P_v = 3.8 kPa and P_a = 0, within 15 ml": _rest_volume},
              "Widths are those of the device that these data were computed on (docs/geometry.md)."),
)  # fmt: skip


# --------------------------------------------------------------------------------------------------------------------
# the table


def check(datasets: Mapping[str, xr.Dataset], inferred: Mapping[str, str] | None = None) -> pd.DataFrame:
    """One row a statement from the datasets of studies by name; a statement whose study is not among them has no verdict.

    ``inferred``: by statement, whether unknown geometry of these datasets was inferred from it (``used``) or not (``held out``).
    Without an inference no statement was used.

    Numbers and verdicts are those of the solutions of least energy at rest. Where studies have several branches, ``branches``
    counts those with that verdict, of those of which every case was solved.
    """
    rows, inferred = [], inferred or {}
    for statement in STATEMENTS:
        shown, branches, lacks = _branches(datasets.get(statement.study))
        first = statement.readings[statement.reading]
        ours, verdict = (lacks, "no data") if lacks else _found(first, shown) if branches else ("-", "no data")
        collected = [(ours, verdict)] if lacks or not branches else [_found(first, branch) for branch in branches]
        degraded = _degraded(shown) if branches and verdict != "no data" else ""
        differing = {} if lacks or not branches else _differing(statement, shown, verdict)
        rows.append(
            {
                "section": statement.section,
                "statement": statement.text,
                "paper": statement.paper,
                "reading": statement.reading,
                "ours": ours + degraded,
                "verdict": verdict,
                "branches": f"{sum(v == verdict for _, v in collected)} of {len(collected)}",
                "read otherwise": "; ".join(f"{name}: {other} ({text})" for name, (text, other) in differing.items()),
                "inference": inferred.get(statement.text, ""),
                "study": statement.study,
                "what is known": "" if verdict in ("reproduced", "no data") else statement.known,
            }
        )
    several = any("branch" in d.dims for d in datasets.values())
    return pd.DataFrame(rows).drop(columns=[] if several else "branches").replace({"inference": {"": "not used"}})


def _branches(dataset: xr.Dataset | None) -> tuple[xr.Dataset | None, list[xr.Dataset], str]:
    """The lowest solutions of a study, the branches of which every case was solved (the first in any case), and what it lacks."""
    if dataset is None:
        return None, [], ""
    first, *others = [dataset.sel(branch=b) for b in dataset.branch] if "branch" in dataset.dims else [dataset]
    missing = int((first.case_status == MISSING).sum())
    lacks = f"{missing} of {first.case_status.size} cases are not solved yet" if missing else ""
    return lowest(dataset), [first, *(branch for branch in others if not (branch.case_status == MISSING).any())], lacks


def _degraded(dataset: xr.Dataset) -> str:
    """How many cases of a study are degraded; nothing for none."""
    count = int((dataset.case_status == DEGRADED).sum())
    return f" ({count} of {dataset.case_status.size} cases degraded)" if count else ""


def _differing(statement: Statement, dataset: xr.Dataset, verdict: str) -> dict[str, tuple[str, str]]:
    """What the other readings of a statement find, where that is another verdict, by reading."""
    found = {name: _found(judge, dataset) for name, judge in statement.readings.items() if name != statement.reading}
    return {name: (text, other) for name, (text, other) in found.items() if other not in (verdict, "no data")}


def _found(judge: Judge, dataset: xr.Dataset) -> tuple[str, str]:
    """What one branch has to say to a statement: what was found and the verdict."""
    try:
        return judge(on_grid(dataset))
    except (AttributeError, KeyError, ValueError, IndexError) as error:  # other outputs, or another grid
        return f"not in this dataset: {error}".replace("\n", " ")[:120], "no data"


def judged(statement: Statement, dataset: xr.Dataset, begins: str = "") -> tuple[str, str]:
    """What one solution of a study has to say to a statement, by its reading that counts, or by the first that ``begins`` so."""
    name = next((name for name in statement.readings if name.startswith(begins)), statement.reading)
    return _found(statement.readings[name], dataset)


def on_grid(dataset: xr.Dataset) -> xr.Dataset:
    """One branch without design axes that do not vary."""
    designs = ("aspect_ratio", "stiffness_ratio", "width_scale")
    return dataset.isel({d: 0 for d in designs if d in dataset.dims and dataset.sizes[d] == 1})


def read_studies(data: Path) -> dict[str, xr.Dataset]:
    """The datasets in a folder, ``<study>/study.nc`` or ``<study>.nc``, that statements need. Raises ``LimoError``."""
    collected = {name: read_dataset(data, name) for name in dict.fromkeys(statement.study for statement in STATEMENTS)}
    return {name: dataset for name, dataset in collected.items() if dataset is not None}


def read_dataset(data: Path, name: str) -> xr.Dataset | None:
    """The dataset of a study in such a folder; None without one. Raises ``LimoError`` for one that cannot be read."""
    dataset = None
    for file in (p for p in (data / f"{name}.nc", data / name / "study.nc") if p.exists()):
        try:
            dataset = xr.load_dataset(file)
        except (OSError, ValueError) as error:
            raise LimoError(f"{file}: not a study's dataset ({error})") from None
    return dataset


def read_inferred(data: Path, otherwise: Path | None = None) -> dict[str, str]:
    """By statement, whether an inference used it (``limo infer --table``): that beside the datasets, else the other; or none."""
    file = next((f for f in (data / INFERRED, otherwise) if f and f.exists()), None)
    if file is None:
        return {}
    rows = read_rows(file, "an inference", ("kind", "name", "inference"), keep_default_na=False)
    return dict(rows[rows.kind == "statement"][["name", "inference"]].itertuples(index=False))


def write_check(
    data: Path, table: Path, page: Path, beside: Mapping[str, Path] | None = None, inferred: Path | None = None
) -> str:
    """Write the table as CSV and as a page of documentation; returns a line with the count of each verdict.

    ``beside``: by name the datasets of other models, whose verdicts get a column each. ``inferred``: the table of an inference
    of what these datasets' geometry leaves open.
    """
    rows = compared(data, beside, inferred)
    write_whole(table, lambda path: rows.to_csv(path, index=False))
    write_whole(page, lambda path: path.write_text(page_of(rows, data, table, beside, inferred), encoding="utf-8"))
    return _counts(rows.verdict)


def compared(data: Path, beside: Mapping[str, Path] | None = None, inferred: Path | None = None) -> pd.DataFrame:
    """The table of a folder of datasets, with a column for those of each of the others, and where a statement holds."""
    rows = check(read_studies(data), read_inferred(data, inferred))
    holds = {"ours": rows.verdict == "reproduced"}
    for name, folder in (beside or {}).items():
        other = check(read_studies(folder))
        otherwise = ("; " + other["read otherwise"]).where(other["read otherwise"] != "", "")
        rows.insert(list(rows).index("study"), name, other.verdict + ": " + other.ours + otherwise)
        holds[name] = other.verdict == "reproduced"
    if beside:
        held = [", ".join(name for name, held in holds.items() if held[k]) or "none" for k in rows.index]
        rows.insert(list(rows).index("study"), "holds in", held)
    return rows


def _counts(verdicts: pd.Series) -> str:
    counts = verdicts.value_counts()
    return ", ".join(f"{counts.get(v, 0)} {v}" for v in VERDICTS)


def page_of(
    rows: pd.DataFrame, data: Path, table: Path, beside: Mapping[str, Path] | None = None, inferred: Path | None = None
) -> str:
    """The page of documentation about a table."""
    beside = beside or {}
    also = "".join(f" --beside {name}={folder}" for name, folder in beside.items())
    also += f" --inference {inferred}" if inferred else ""
    sentences = (
        f"Generated by `limo paper-check --data {data}{also}`; do not edit. The same table is in `{table.name}`. A "
        "statement about many cases is `reproduced` if it holds for all of them, and `partly` if it holds for at least half. A "
        "statement about a number has two bands, which `scripts/limo/reports/paper_check.py` states. `reading` says how a judge "
        "reads the paper; `read otherwise` lists other readings with their verdicts where these differ. Nothing is tuned to turn "
        "a row green, except the documented geometry (`docs/geometry.md`). `inference` says whether unknown geometry is "
        "inferred from a row (`used`), or a row is `held out` to test that; `not used`: neither."
    )
    if inferred:
        sentences += f" That inference is `{inferred}`; these data have the geometry that it begins with."
    if "branches" in rows:
        sentences += (
            " Numbers and verdicts are those of the solution of each case that has the least energy at rest. `branches` counts "
            "the flat states, the exact one and slightly perturbed ones, whose solutions have the same verdict."
        )
    counted_verdicts = [f"{_counts(rows.verdict)}."]
    for name, folder in beside.items():
        sentences += f" The column `{name}` has the results of the datasets in `{folder}`."
        counted_verdicts.append(f"In `{name}`: {_counts(rows[name].str.split(':').str[0])}.")
    if beside:
        sentences += f" `ours` and `verdict` are of `{data}`. `holds in` names the sets in which a statement is reproduced."
    return "\n\n".join(["# The paper's statements", sentences, " ".join(counted_verdicts), markdown_table(rows)]) + "\n"
