"""Which of several solutions of a case is the lowest, and which device rests otherwise than its neighbours.

A fitted device has several states at rest. The one of least potential energy is the one that is compared with others; from
there on its path decides. Devices that differ in their seams alone have nearly the same energy at rest: their outline, not
their seams, holds P_v. One that lies above the others has folded otherwise.
"""

from __future__ import annotations

import json

import numpy as np
import xarray as xr

from limo.store.statuses import USABLE

#: energy at rest above the median of devices with other N_p, over that median, from which a device has folded otherwise
FOLDED_OTHERWISE = 0.02
#: devices without which there is no median to speak of
LEAST_NEIGHBOURS = 3
#: between several remarks on a case, whose words before a colon are those of all cases of which they hold
REMARKS_APART = "; "
#: variables of ``state_variables``: units and meaning
STATES = {
    "lowest_branch": ("1", "branch of least potential energy at rest, which figures show"),
    "energy_above_others": ("1", "potential energy at rest above the median of devices with other N_p, over that median"),
}


def rest_energy(dataset: xr.Dataset) -> xr.DataArray | None:
    """Pi in mJ at rest of each case that can be used, NaN elsewhere; None in a dataset from before energies were kept."""
    if "potential_energy" not in dataset:
        return None
    return dataset.potential_energy.isel(actuation_pressure=0, drop=True).where(dataset.case_status.isin(USABLE))


def lowest(dataset: xr.Dataset) -> xr.Dataset:
    """Of each case the solution of least energy at rest, without ``branch``; the first one where none is known.

    A dataset that is open lazily is loaded: xarray 2026.9.0 picks no text from such a file (``findings``).
    """
    if "branch" not in dataset.dims:
        return dataset
    dataset.load()
    energy = rest_energy(dataset)
    if energy is None:
        return dataset.isel(branch=0, drop=True)
    return dataset.isel(branch=energy.fillna(np.inf).argmin("branch")).drop_vars("branch")


def energy_above_others(dataset: xr.Dataset) -> xr.DataArray:
    """(Pi - median) / |median| of the lowest state of each case, the median over N_p; NaN with fewer than three of these."""
    shown = lowest(dataset)
    energy = rest_energy(shown)
    if energy is None or "n_pouches" not in energy.dims:
        return xr.full_like(shown.case_status, np.nan, dtype=float)
    enough = energy.count("n_pouches") >= LEAST_NEIGHBOURS
    median = energy.median("n_pouches").where(enough)
    return (energy - median) / np.abs(median)


def state_variables(dataset: xr.Dataset) -> xr.Dataset:
    """The variables of ``STATES`` that a study's dataset has."""
    found = {"energy_above_others": energy_above_others(dataset)}
    if dataset.sizes.get("branch", 1) > 1:
        found["lowest_branch"] = dataset.branch[rest_energy(dataset).fillna(np.inf).argmin("branch")].drop_vars("branch")
    return xr.Dataset({n: v.assign_attrs(units=STATES[n][0], long_name=STATES[n][1]) for n, v in found.items()})


def folded_otherwise(dataset: xr.Dataset) -> list[str]:
    """What stands under figures of devices that rest above others: one line each."""
    above = energy_above_others(dataset)
    dims = list(above.dims)
    places = above.stack(case=dims) if dims else above.expand_dims("case")
    lines = []
    for k in np.flatnonzero(places.values > FOLDED_OTHERWISE):
        case = places.isel(case=k)
        where = f"N_p = {int(case.n_pouches)}, P_v = {float(case.ventricular_pressure):g} kPa"
        lines.append(
            f"{where}: folded otherwise than devices with other N_p, {100 * float(case):.1f} % above their energy at rest"
        )
    return lines


def in_contact(dataset: xr.Dataset) -> bool:
    """Whether front and back touch in the models of all cases of a study: their curves then mean something beyond contact."""
    settings = json.loads(dataset.attrs.get("config", "{}")).get("settings", {})
    names = [str(v) for v in np.atleast_1d(dataset.variant.values)] if "variant" in dataset.coords else list(settings)
    touch = [(settings[name]["numerics"].get("contact") or {}).get("front_back", False) for name in names if name in settings]
    return bool(touch) and all(touch)


def remarked(dataset: xr.Dataset) -> list[str]:
    """What of the results of a study is not physical, or coarse: one line each, with the number of cases."""
    if "case_remarks" not in dataset:
        return []
    texts = [str(text) for text in lowest(dataset).case_remarks.values.ravel()]
    cases: dict[str, list[str]] = {}
    for what, _, details in (remark.partition(": ") for text in texts if text for remark in text.split(REMARKS_APART)):
        cases.setdefault(what, []).append(details)
    if len(texts) == 1:
        return [f"{what}: {details[0]}" for what, details in cases.items()]
    return [f"{what}, in {len(details)} of {len(texts)} cases" for what, details in cases.items()]
