"""Tables for the terminal: the results of a study, and where the time of its cases went."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from limo.bench.check import check_files
from limo.cases.cost import duration, memory_mib, plan_costs, schedule
from limo.cases.grid import study_cases
from limo.cases.plan import make_plan
from limo.config.builds import open_project
from limo.datasets.variables import COORDINATES, SYMBOLS, place
from limo.errors import ResultError
from limo.measure.states import folded_otherwise, remarked, rest_energy
from limo.reports.markdown import shown
from limo.store.files import UNREADABLE

#: ml of an empty pouch that count as none
LEAST_VOLUME = 0.1


def plan_table(config_file: str, names: Sequence[str], results: Path, cores: int) -> str:
    """One line a study (none named: all): its cases, those solved or served by others, and the CPU time of the rest.

    The last line is about all of them together: cases that they share are solved once, the longest first on ``cores``; the
    memory is that of the largest.
    Raises ``ConfigError`` for a mistake in what is named or a study that it does not have, and ``LimoError`` with all mistakes if
    none is named.
    """
    loaded = open_project(config_file, names, "limo check pressure_volume", strict=not names, all_engines=False)
    plan = make_plan(loaded, results)
    costs = plan_costs(plan)
    lines = [f"{config_file}: valid; {', '.join(f'{engine} {build}' for engine, build in sorted(loaded.builds.items()))}"]
    together: set[str] = set()
    for name in names or loaded.studies:
        own_cases, serving = study_cases(loaded, name), plan.served[name]
        cases = set(serving.values())
        left, begun = cases & plan.to_solve, plan.with_fits(cases) & plan.to_solve
        together |= cases
        others = sum(serving[key] != case.case_id for key, case in own_cases.items())
        parts = [
            f"{len(cases)} cases on {len({plan.cases[c].mesh_id for c in cases})} meshes",
            f"{len(cases - left)} solved",
            *([f"{others} of {len(own_cases)} served by a case beyond them"] if others else []),
            *([f"{len(left)} to solve in {duration(sum(costs[c] for c in begun))} of CPU time"] if left else []),
        ]
        default = "  (default)" if name in loaded.config.studies else ""
        lacking = [engine for engine in loaded.engines_of(name) if engine not in loaded.builds]
        lines.append(f"  {name}: {', '.join(parts)}" + default + "".join(f"  (no {engine} here)" for engine in lacking))
    left, begun = together & plan.to_solve, plan.with_fits(together) & plan.to_solve
    wall = duration(schedule((costs[c] for c in begun), max(cores // loaded.config.solver.threads, 1)))
    total = f"  together {len(together)} distinct cases, {len(left)} to solve"
    if left:
        largest = max(memory_mib(plan.cases[c]) for c in left)
        total += (
            f" in {duration(sum(costs[c] for c in begun))} of CPU time, about {wall} on {cores} cores, {largest:.0f} MiB a case"
        )
    lines.append(total)
    return "\n".join([*lines, *check_files(loaded, names or loaded.studies)])


def study_table(path: Path) -> str:
    """One line a case: stroke, ratio and the rest at P_a,max, and the paths of the study's figures.

    With the output contact: the P_a of the first stored frame in which front and back would touch, too. Raises ``ResultError``
    where the file is no dataset of a study.
    """
    try:
        with xr.open_dataset(path) as opened:
            dataset = opened.load()
    except UNREADABLE as error:
        raise ResultError(f"{path}: not a study's dataset ({error})") from None
    if "case_status" not in dataset:
        raise ResultError(f"{path}: not a study's dataset (no case_status); for example results/studies/NAME/study.nc")
    dims = list(dataset.case_status.dims)
    dataset = dataset.assign(energy=energy) if (energy := rest_energy(dataset)) is not None else dataset
    cases = dataset.stack(case=dims)
    rows = []
    for k in range(cases.sizes["case"]):
        case = cases.isel(case=k)
        reached = float(case.actuation_pressure_reached)
        at_end = case.sel(actuation_pressure=reached, method="ffill") if np.isfinite(reached) else None
        rows.append(
            {_header(name, text): place(case[name].item()) for name, text in SYMBOLS.items() if name in dims}
            | {
                "P_a [kPa]": f"{reached:.1f}" if at_end is not None else "-",
                "stroke [ml]": _number(at_end, "stroke_volume", ".1f"),
                "ratio": _number(at_end, "io_ratio", ".2f"),
                **({"Pi at rest [mJ]": _energy(case)} if "energy" in case else {}),
                **({"touches [kPa]": _number(case, "contact_front_back", ".1f")} if "contact_front_back" in case else {}),
                "eta(90 ml)": _number(case, "efficiency_90ml", ".1%"),
                "dissipated": _number(case, "dissipated_fraction", ".1%"),
                "iterations": _number(case, "iterations", ".0f"),
                "solver CPU [s]": _number(case, "solver_time", ".0f"),
                "status": str(case.case_status.values),
            }
            | _check(case)
        )
    lines = [str(dataset.attrs.get("title", path)), pd.DataFrame(rows).to_string(index=False)]
    for k in range(cases.sizes["case"]):
        case = cases.isel(case=k)
        if reason := str(case.case_reason.values) or str(case.efficiency_90ml_reason.values):
            lines.append(f"  {case.case_id.values}: {reason}")
    if "lowest_branch" in dataset:
        lines.append("* the solution of least energy at rest, which figures show")
    lines += [*folded_otherwise(dataset), *remarked(dataset)]
    lines += _inside_out(cases)
    figures = sorted((path.parent / "figures").glob("*.p*"))
    return "\n".join([*lines, *(f"figure: {f}" for f in figures)])


def _inside_out(cases: xr.Dataset) -> list[str]:
    """Which empty pouches have layers that lie in each other: the model has no contact between them, and dV_a counts that."""
    rest = cases.actuation_volume.isel(actuation_pressure=0)
    below = rest.where(rest < -LEAST_VOLUME, drop=True)
    if not below.size:
        return []
    low = f"{float(below.min()):.1f} ml"
    low = low if below.size == 1 else f"{low} to {float(below.max()):.1f} ml"
    return [
        f"V_a at rest is {low} in {below.size} of {rest.size} cases: layers of empty pouches lie in each other, as nothing keeps "
        "them apart in the model. dV_a counts that volume; give each case cross_check: 1 to see how far engines differ by it"
    ]


def _energy(case: xr.Dataset) -> str:
    """The potential energy at rest, with a star for the lowest of several solutions."""
    is_lowest = "lowest_branch" in case and float(case.lowest_branch) == float(case.branch)
    return _number(case, "energy", ".1f") + "*" * is_lowest


def _header(name: str, symbol: str) -> str:
    units = COORDINATES[name][0]
    return symbol if units in ("", "1") else f"{symbol} [{units}]"


def _check(case: xr.Dataset) -> dict[str, str]:
    """How far a case is from the other engine's, where a study asks for that."""
    if "check_status" not in case:
        return {}
    return {
        "other engine": str(case.check_status.values) or "-",
        "stroke differs": _number(case, "check_stroke_difference", ".1%"),
        "V_v at rest differs": _number(case, "check_rest_difference", "+.2%"),
        **({"Pi at rest differs": _number(case, name, "+.2%")} if (name := "check_energy_difference") in case else {}),
    }


def _number(case: xr.Dataset | None, name: str, form: str) -> str:
    return "-" if case is None else shown(float(case[name]), form)
