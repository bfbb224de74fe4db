"""How the numbers of a device answer to one change: a panel a number, over the axis that a study varies."""

from __future__ import annotations

import numpy as np
import pandas as pd
import xarray as xr

from limo.datasets.curves import at_end
from limo.figures import pictures, style
from limo.measure.states import lowest
from limo.store.statuses import MEASURED, USABLE

#: axes that may be drawn along, the first one that a study varies, and what stands below
ALONG = {
    "fabric_angle": "Warp to axis [degrees]",
    "bending_factor": "Bending factor $f$ [-]",
    "stiffness_ratio": r"Stiffness ratio $\hat E$ [-]",
    "aspect_ratio": "Aspect ratio AR [-]",
    "width_scale": "Width scale [-]",
    "ventricular_pressure": "$P_v$ [kPa]",
    "n_pouches": "$N_p$ [-]",
}
AT_REST, AT_90_ML = "$V_v$ at rest [ml]", "Efficiency at 90 ml [%]"
#: the numbers that a case has however far it came: they are of states that it passed
PASSED = (AT_REST, AT_90_ML)


def numbers_of(dataset: xr.Dataset) -> dict[str, xr.DataArray]:
    """What is drawn, by the text beside its axis: numbers of every case that the study has.

    A case that ended before P_a,max has those of ``PASSED`` alone.
    """
    found = {
        AT_REST: dataset.ventricle_volume.isel(actuation_pressure=0, drop=True),
        "Stroke at $P_{a,max}$ [ml]": at_end(dataset.stroke_volume),
        "Ratio $\\Delta V_v / V_a$ at $P_{a,max}$ [-]": at_end(dataset.io_ratio),
        AT_90_ML: 100 * dataset.efficiency_90ml,
    }
    if "von_mises_peak" in dataset:
        found["Peak von Mises stress [MPa]"] = dataset.von_mises_peak.isel(frame=-1, drop=True)
    if "strain_peak" in dataset:
        found["Peak strain [%]"] = 100 * dataset.strain_peak.isel(frame=-1, drop=True).max("side")
    for name, text in (("fatigue_cycles_min", "worst point"), ("fatigue_cycles_p05", "95 % of area")):
        if name in dataset:
            found[f"Cycles, {text} [$\\log_{{10}}$]"] = np.log10(dataset[name])
    if "direction_around" in dataset:
        share = dataset.direction_around.isel(frame=-1, drop=True)
        found["Outside, $v_1$ around [% of area]"] = 100 * share.sel(side="epicardial", drop=True)
    if "fibre_aligned_share" in dataset and dataset.fibre_aligned_share.notnull().any():
        found["Load along yarns [%]"] = 100 * dataset.fibre_aligned_share.isel(frame=-1, drop=True)
    if "buckling_jump" in dataset:
        jump = np.abs(dataset.buckling_jump).max("event").fillna(0.0)
        found["Largest jump of the stroke [ml]"] = jump.where(dataset.measure_status == MEASURED)
    usable = dataset.case_status.isin(USABLE)
    return {text: values if text in PASSED else values.where(usable) for text, values in found.items()}


def known(numbers: dict[str, xr.DataArray]) -> dict[str, xr.DataArray]:
    """Those of ``numbers_of`` that some case has, as no cycles where nothing ever fails; all of them where none has any."""
    return {text: values for text, values in numbers.items() if np.isfinite(values).any()} or numbers


def draw(dataset: xr.Dataset, measured: pd.DataFrame | None = None):
    """One curve for each of the other axes' values, with bars from branch to branch; measured curves have no place here."""
    varied = [d for d in dataset.case_status.dims if d != "branch" and dataset.sizes[d] > 1]
    along = next((name for name in ALONG if name in varied), "n_pouches")
    others = [d for d in varied if d != along]
    dataset = dataset.isel({d: 0 for d in dataset.case_status.dims if d not in (along, "branch", *others)})
    numbers = known(numbers_of(dataset))
    columns = max(3, (len(numbers) + 1) // 2)
    figure, *rows = style.two_rows(columns, len(numbers) - columns, 2.6 * columns, 5.2)
    axes = [axis for row in rows for axis in row]
    lines = dataset.case_status.isel(branch=0, drop=True) if "branch" in dataset.case_status.dims else dataset.case_status
    lines = lines.isel({along: 0}, drop=True) if along in lines.dims else lines
    points = lines.stack(line=others) if others else lines.expand_dims("line")
    handles = []
    for k in range(points.sizes["line"]):
        case = {d: points.line.values[k][j] if len(others) > 1 else points[d].values[k] for j, d in enumerate(others)}
        chosen, color = dataset.sel(case), style.COLORS[k % len(style.COLORS)]
        name = pictures.names(points.isel(line=k), others) or " "
        of_all, of_lowest = numbers_of(chosen), numbers_of(lowest(chosen))
        for axis, text in zip(axes, numbers, strict=True):
            values, shown = of_all[text], of_lowest[text]
            x = np.atleast_1d(shown[along].values).astype(float)
            (drawn,) = axis.plot(x, np.atleast_1d(shown.values), "o-", color=color, ms=3, label=name)
            if "branch" in values.dims:
                style.bars_of_branches(axis, x, values)
            axis.set_ylabel(text)
            axis.set_xlabel(ALONG[along])
        handles.append(drawn)
    for axis in axes:
        if axis.dataLim.y0 == axis.dataLim.y1 == 0:
            axis.set_ylim(0, 1)  # nothing but zeros
    if along == "bending_factor":
        factors = np.atleast_1d(dataset[along].values)
        for axis in axes:
            axis.set_xscale("log")
            axis.set_xticks(factors, [f"{f:g}" for f in factors])
            axis.set_xticks([], minor=True)
    style.legend(figure, handles, style.gaps(dataset), min(len(handles), 4))
    return figure
