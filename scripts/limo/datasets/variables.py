"""Every variable of a dataset in one table: dimensions, units, long name and symbol; and where they lie."""

from __future__ import annotations

from dataclasses import dataclass

import xarray as xr

from limo.cases.grid import OWN, GridPoint
from limo.schema.study import Study
from limo.store.statuses import ENDED, MISSING

PAPER = "Lauber, Arfaee, Peirlinck: The mechanics of the Less In More Out artificial heart"


#: how the cases of a study may have ended
STATUSES = (*ENDED, MISSING)


CASE_DIMS = GridPoint._fields


CURVE_DIMS = (*CASE_DIMS, "actuation_pressure")


@dataclass(frozen=True)
class Variable:
    """What is stored under a name: ``dims`` are those of a case or of a curve."""

    dims: tuple[str, ...]
    units: str
    long_name: str


VARIABLES = {
    "ventricle_volume": Variable(CURVE_DIMS, "ml", "ventricle volume, V_v"),
    "actuation_volume": Variable(CURVE_DIMS, "ml", "total pouch volume, V_a"),
    "actuation_volume_change": Variable(CURVE_DIMS, "ml", "pouch volume since P_a = 0, Delta V_a"),
    "stroke_volume": Variable(CURVE_DIMS, "ml", "fluid that left the ventricle since P_a = 0, Delta V_v"),
    "io_ratio": Variable(CURVE_DIMS, "1", "input-output ratio, stroke over total pouch volume, Delta V_v / V_a"),
    "io_ratio_of_change": Variable(CURVE_DIMS, "1", "stroke over change of pouch volume since P_a = 0, Delta V_v / Delta V_a"),
    "potential_energy": Variable(CURVE_DIMS, "mJ", "potential energy of the full device, Pi = U - P_v V_v - P_a V_a"),
    "efficiency_90ml": Variable(CASE_DIMS, "1", "mechanical efficiency at a stroke of 90 ml, eta"),
    "pressure_90ml": Variable(CASE_DIMS, "kPa", "actuation pressure at a stroke of 90 ml"),
    "dissipated_fraction": Variable(CASE_DIMS, "1", "share of the actuation work over the ramp that damping took"),
    "rest_change": Variable(CASE_DIMS, "1", "relative change of V_v over the last part of the hold"),
    "actuation_pressure_reached": Variable(CASE_DIMS, "kPa", "highest actuation pressure of an accepted increment"),
    "solver_time": Variable(CASE_DIMS, "s", "CPU time of the solver, fits on coarser meshes included"),
    "python_time": Variable(CASE_DIMS, "s", "CPU time of deck, volumes and files"),
    "iterations": Variable(CASE_DIMS, "1", "Newton iterations, rejected attempts included"),
    "solver_memory": Variable(CASE_DIMS, "MiB", "peak resident memory of the solver"),
}


TEXTS = {
    "case_id": "name of the case that these results are from",
    "case_status": "how the solve ended, as far as the study's P_a,max",
    "case_reason": "why the case did not converge, or what is doubtful about it",
    "case_remarks": "what of a result that counts is not physical, or coarse",
    "efficiency_90ml_reason": "why there is no efficiency at a stroke of 90 ml",
    "solver_build": "which executable or library solved the case",
}


CHECKS = {
    "check_stroke_volume": Variable(CURVE_DIMS, "ml", "stroke volume of the other engine"),
    "check_stroke_difference": Variable(
        CASE_DIMS, "1", "relative L2 difference of the stroke to the other engine's over the ramp"
    ),
    "check_rest_difference": Variable(CASE_DIMS, "1", "relative difference of V_v at P_a = 0 to the other engine's"),
    "check_energy_difference": Variable(
        CASE_DIMS, "1", "potential energy at rest less the other engine's, over its size; below 0: the study's own state is lower"
    ),
}


COORDINATES = {
    "n_pouches": ("1", "number of pouches, N_p"),
    "ventricular_pressure": ("kPa", "ventricular pressure, P_v"),
    "aspect_ratio": ("1", "aspect ratio of the valve support, AR"),
    "stiffness_ratio": ("1", "endocardial over fabric modulus, E_hat"),
    "width_scale": ("1", "scale of the device's widths"),
    "fabric_angle": ("degree", "angle of the warp to the axis of the device"),
    "bending_factor": ("1", "bending stiffness over that of a plate"),
    "variant": ("", "variant of everything else, as the study names it"),
    "branch": ("1", "0 for the flat state as it is, else the seed of a tiny perturbation of it"),
    "actuation_pressure": ("kPa", "actuation pressure, P_a"),
}


def describe_axes(dataset: xr.Dataset) -> xr.Dataset:
    """The same with units and names on the axes of a grid of cases and of curves."""
    for coordinate in (c for c in COORDINATES if c in dataset.coords):
        units, long_name = COORDINATES[coordinate]
        dataset[coordinate].attrs = {"long_name": long_name} | ({"units": units} if units else {})
    return dataset


def on_axes(dataset: xr.Dataset, study: Study) -> xr.Dataset:
    """The same without the dimensions ``variant``, ``branch`` and those of a device's own where the study does not vary them."""
    fixed = {name: getattr(study.axes, name) is None for name in OWN}
    fixed |= {"variant": not study.variants, "branch": dataset.sizes["branch"] == 1}
    dataset = dataset.isel({dim: 0 for dim, one in fixed.items() if one})
    dataset = dataset.drop_vars([name for name in OWN if fixed[name] and name != "width_scale"])  # which datasets always had
    return dataset if study.variants else dataset.drop_vars("variant")


#: how dimensions are written where there is little room
SYMBOLS = {
    "n_pouches": "N_p",
    "ventricular_pressure": "P_v",
    "aspect_ratio": "AR",
    "stiffness_ratio": "E_hat",
    "width_scale": "width",
    "fabric_angle": "angle",
    "bending_factor": "bending",
    "variant": "variant",
    "branch": "branch",
    "actuation_pressure": "P_a",
}


def place(value: str | float) -> str:
    """A value of an axis for people: a name, or a number as short as it can be."""
    return value if isinstance(value, str) else f"{value:g}"
