"""How wrong each setting of the device is: its runs against an ensemble on the finest mesh (paper, *LIMO inflation convergence*).

Errors are taken against the mean of the reference. What the members of an ensemble differ among themselves is the scatter of
paths: a smaller error says nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from limo.accuracy.roles import studies_of
from limo.accuracy.runs import Run
from limo.accuracy.surfaces import Surface
from limo.cases.case import Case
from limo.config.project import Project
from limo.config.settings import Setting, setting_of
from limo.schema.numerics import Numerics
from limo.schema.study import Variant

#: curves that are compared, and values
CURVES = ("ventricle_volume", "actuation_volume_change")
_VALUES = ("stroke_volume", "pressure_90ml", "efficiency_90ml", "von_mises_peak", "fatigue_cycles_min")
_DECADES = ("fatigue_cycles_min",)
#: what the paper says of its mesh: how far the largest w is from that of the finest one
PAPER_HEIGHT = 0.02
#: errors of a run and what they are about; all over the reference's value except the distances, which are over L
ERRORS = {
    "ventricle_volume": "relative L2 of V_v over the ramp",
    "actuation_volume": "relative L2 of Delta V_a over the ramp",
    "stroke": "stroke at P_a,max",
    "pressure_90ml": "P_a at a stroke of 90 ml",
    "efficiency_90ml": "efficiency at a stroke of 90 ml",
    "stress": "top-5 % von Mises stress at P_a,max",
    "cycles": "fewest cycles near seams, in decades",
    "height": "largest w at P_a,max",
    "chamfer": "symmetric Chamfer distance of the surfaces at P_a,max over L",
}


def chamfer(first: Surface, second: Surface) -> float:
    """d_c of two surfaces in mm: mean distance of points on each from the other (paper, *LIMO inflation convergence*).

    The paper takes distances between points of two clouds; the spacing of those is a floor that surfaces do not have.
    """
    return float(0.5 * second.distances(first.cloud).mean() + 0.5 * first.distances(second.cloud).mean())


def changes_of(project: Project, subject: str, case: Case) -> dict[str, str]:
    """What a run has instead of the default of its engine, and which part of a setting that is.

    The default is what a study of the subject says without its variants: the first of ``ROLES`` that the engine solves. Keys are
    words such as ``medium`` or ``fit.damping 1e+06``; values ``level``, ``symmetry``, ``element``, ``contact``, ``numerics`` or
    ``fabric``. The meshes that a fit begins on go with the level, and its ways with contact.
    """
    default = _default_of(project, subject, case.engine)
    meshes = ((n, getattr(case.mesh, n), getattr(default.mesh, n)) for n in ("level", "symmetry", "element"))
    changes = {value: name for name, value, usual in meshes if value != usual}
    here, usual = case.numerics, default.numerics.for_engine(case.engine)
    follows = ["newton.fit_on"] * (case.mesh.level != default.mesh.level)
    if here.contact.content() != usual.contact.content():
        parts = [key for key in ("front_back", "endo_epi") if getattr(here.contact, key)]
        changes["contact of " + " and ".join(parts) if parts else "no contact"] = "contact"
        follows += ["newton.fit_via", *(key for key in _flat(here) if key.startswith("contact."))]
    plain = _flat(usual)
    changes |= {
        f"{key} {_word(value)}": "numerics"
        for key, value in _flat(here).items()
        if key not in follows and value != plain.get(key)
    }
    fabric, usual = (d.material.model_dump() for d in (case.device, default.device))
    return changes | {f"{key} {_word(value)}": "fabric" for key, value in fabric.items() if value != usual[key]}


def _default_of(project: Project, subject: str, engine: str) -> Setting:
    """The setting of the first study of a subject that an engine solves, without its variants; else of its first study."""
    settings = [
        setting_of(project.config, project.devices, project.studies[name].model_copy(update={"variants": {}}), Variant())
        for name in studies_of(project, subject).values()
    ]
    return next((setting for setting in settings if setting.engine == engine), settings[0])


def _flat(numerics: Numerics) -> dict[str, object]:
    """Numerics with dotted keys."""
    flat = {}
    for key, value in numerics.model_dump(exclude={"description"}).items():
        flat |= {f"{key}.{k}": v for k, v in value.items()} if isinstance(value, dict) else {key: value}
    return flat


def _word(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def preset_of(project: Project, run: Run) -> str:
    """Name of the accuracy preset that a run was solved with, or nothing."""
    for name, preset in project.config.presets.items():
        numerics = project.config.numerics_presets[preset.numerics].for_engine(preset.engine)
        device = project.devices[run.case.device_name]
        same = (preset.mesh, preset.engine, numerics) == (run.case.mesh, run.case.engine, run.case.numerics)
        if same and run.case.device == device:
            return name
    return ""


# --------------------------------------------------------------------------------------------------------------------
# errors


def errors_of(run: Run, reference: Sequence[Run]) -> dict[str, float]:
    """``ERRORS`` of a run against the mean of a reference; NaN for what one of them lacks."""
    errors = {
        "ventricle_volume": _curve_error(run, reference, "ventricle_volume"),
        "actuation_volume": _curve_error(run, reference, "actuation_volume_change"),
    }
    for name, value in (
        ("stroke", stroke_of),
        ("pressure_90ml", pressure_of),
        ("efficiency_90ml", efficiency_of),
        ("stress", stress_of),
    ):
        expected = np.mean([value(r) for r in reference])
        errors[name] = abs(value(run) / expected - 1.0)
    errors["cycles"] = abs(decades_of(run) - np.mean([decades_of(r) for r in reference]))
    surfaces = [r.surface for r in reference if r.surface is not None]
    errors |= {"height": np.nan, "chamfer": np.nan}
    if run.surface is not None and surfaces:
        expected = np.mean([s.height[np.argmax(s.pressure)] for s in surfaces])
        errors["height"] = abs(run.surface.height[np.argmax(run.surface.pressure)] / expected - 1.0)
        length = run.case.device.pattern.length
        errors["chamfer"] = float(np.mean([chamfer(run.surface, s) for s in surfaces])) / length
    return {name: float(errors[name]) for name in ERRORS}


def scatter_of(members: Sequence[Run]) -> dict[str, float]:
    """Mean error of each member of an ensemble against the mean of the others: what paths alone make of a setting."""
    each = [errors_of(run, [r for r in members if r is not run]) for run in members]
    return {name: float(np.mean([e[name] for e in each])) for name in ERRORS}


def mean_of(members: Sequence[Run]) -> Run:
    """What an ensemble gives on average: its mean curves and values; it has no surface."""
    values = members[0].values.copy()
    for name in (*CURVES, *_VALUES):
        if name in values:
            each = np.array([run.values[name].values for run in members])
            values[name] = (values[name].dims, 10 ** np.log10(each).mean(axis=0) if name in _DECADES else each.mean(axis=0))
    return replace(members[0], values=values, surface=None)


def _curve_error(run: Run, reference: Sequence[Run], name: str) -> float:
    """||c - c_ref|| / ||c_ref|| over the ramp; NaN for a run that ends before the reference."""
    expected = np.mean([r.values[name].values for r in reference], axis=0)
    known = np.isfinite(expected)
    return np.linalg.norm(run.values[name].values[known] - expected[known]) / np.linalg.norm(expected[known])


def stroke_of(run: Run) -> float:
    """Stroke (ml) at P_a,max."""
    return float(run.values.stroke_volume[-1])


def pressure_of(run: Run) -> float:
    """P_a (kPa) at a stroke of 90 ml."""
    return float(run.values.pressure_90ml)


def efficiency_of(run: Run) -> float:
    """Efficiency at a stroke of 90 ml."""
    return float(run.values.efficiency_90ml)


def stress_of(run: Run) -> float:
    """Top-5 % von Mises stress (MPa) at P_a,max; NaN where it is not measured."""
    return float(run.values.von_mises_peak.sel(frame="max")) if "von_mises_peak" in run.values else np.nan


def decades_of(run: Run) -> float:
    """Decadic logarithm of the fewest cycles near seams; NaN where they are not measured."""
    return float(np.log10(run.values.fatigue_cycles_min)) if "fatigue_cycles_min" in run.values else np.nan
