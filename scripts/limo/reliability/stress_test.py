"""What a stress test found, case by case, and a check of forces that neither the judge nor CalculiX knows of."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from limo.cases.case import Case
from limo.config.project import Project
from limo.engines.newton.assembly import Assembly
from limo.errors import ResultError
from limo.measure.frames import open_case
from limo.mechanics.equilibrium import mass_forces, rounding_noise, through_thickness, unconstrained, with_references
from limo.reliability.stress_cases import stress_cases
from limo.store.files import read_json, write_whole
from limo.store.results import Results
from limo.store.statuses import MISSING, SolveStatus

SMALLEST_FORCE = 1e-9  # N, for devices at which nothing pulls
CHECKS = (
    *("largest_displacement", "smallest_volume_ratio", "smallest_thickness", "residual", "residual_floor", "viscous_share"),
    *("energy_created", "largest_jump", "smallest_ventricle"),
)
COLUMNS = (
    *("box", "number", "engine", "case_id", "n_pouches", "ventricular_pressure", "actuation_pressure_max", "aspect_ratio"),
    *("stiffness_ratio", "thickness", "youngs_modulus", "width_scale", "status", "first_status", "attempts", "rung"),
    *("actuation_pressure_reached", "iterations", "solver_cpu_seconds", "dissipated_fraction", *CHECKS),
    *("forces_residual", "reason"),
)


def gather_stress_test(cases: Iterable[tuple[str, int, str, str]], results: Path) -> list[dict[str, Any]]:
    """One row a case, (box, number, engine, case id), in the order of ``COLUMNS``; a case that cannot be read says why."""
    rows = []
    for box, number, engine, case_id in cases:
        files = Results(results).case(case_id)
        row = {"box": box, "number": number, "engine": engine, "case_id": case_id}
        try:
            case = Case.from_dict(read_json(files.described)["case"])
            row |= _what_it_is(case) | _what_came_out(SolveStatus.from_json(read_json(files.status), files.status))
            row["forces_residual"] = forces_residual(case, Results(results).mesh(case.mesh_id), files.folder)
        except (ResultError, IndexError, KeyError, TypeError, ValueError) as error:
            row = {"status": MISSING} | row | {"reason": row.get("reason") or str(error)}
        rows.append({name: _short(row.get(name)) for name in COLUMNS})
    return rows


def record_stress_test(loaded: Project, results: Path, file: Path) -> str:
    """Write a row for each case of the stress test that is solved; says how many that are."""
    loaded.require_sound("stress_test")
    cases = [(*key, case.case_id) for key, case in stress_cases(loaded).items()]
    done = [c for c in cases if Results(results).case(c[3]).status.exists()]
    write_rows(gather_stress_test(done, results), file)
    return f"{file}: {len(done)} of {len(cases)} cases"


def _what_it_is(case: Case) -> dict[str, Any]:
    material = case.device.material
    names = ("n_pouches", "ventricular_pressure", "actuation_pressure_max", "aspect_ratio", "stiffness_ratio")
    return {n: getattr(case, n) for n in names} | {
        "thickness": material.thickness,
        "youngs_modulus": material.youngs_modulus,
        "width_scale": case.device.pattern.width_scale,
    }


def _what_came_out(status: SolveStatus) -> dict[str, Any]:
    names = ("status", "reason", "actuation_pressure_reached", "iterations", "solver_cpu_seconds", "dissipated_fraction")
    attempts = status.attempts
    last = next((a for a in attempts if a.status == status.status), attempts[-1])
    return (
        {n: getattr(status, n) for n in names}
        | {n: status.checks.get(n) for n in CHECKS}
        | {"attempts": len(attempts), "first_status": status.first_status, "rung": last.rung}
    )


def forces_residual(case: Case, mesh_file: Path, folder: Path) -> float | None:
    """Largest residual of the stored frames over the load (2-norms of sums over the thickness), forces by ``newton.assembly``.

    The judge computes them with ``mechanics.equilibrium``, CalculiX by itself. What rounding of a frame alone makes is taken off;
    nodes of which something is constrained are left out, because there its forces across the layer do not cancel. Where no
    pressure acts, the forces of what is held count as load.
    """
    model, frames = open_case(case, mesh_file, folder)
    assembly, free, residuals = Assembly(model), unconstrained(model), []
    for k, pressure in enumerate(frames.pressure):
        motion = frames.motion[k].astype(float) if frames.motion is not None else np.full(1, np.nan)
        if not np.isfinite(motion).all():
            continue
        u = with_references(model, frames.displacement[k])
        inside, pressed = assembly.forces(u, case.ventricular_pressure, float(pressure))
        shaken, _ = assembly.forces(u + rounding_noise(u, frames.displacement.dtype), case.ventricular_pressure, float(pressure))
        moving = mass_forces(model, with_references(model, frames.damping * motion[0] + motion[1]))
        out, noise, load = (
            np.linalg.norm(through_thickness(model, forces)[free])
            for forces in (inside - pressed + moving, shaken - inside, pressed)
        )
        held = np.linalg.norm(through_thickness(model, inside))
        residuals.append(max(out - noise, 0.0) / (load or max(held, SMALLEST_FORCE)))
    return max(residuals, default=None)


def _short(value: Any) -> Any:
    return "" if value is None else float(f"{value:.5g}") if isinstance(value, float) else value


def write_rows(rows: Iterable[Mapping[str, Any]], path: Path) -> None:
    """Write rows as CSV, as a whole."""

    def write(aside: Path) -> None:
        with aside.open("w", newline="", encoding="utf-8") as handle:
            writer = csv.DictWriter(handle, COLUMNS, lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)

    write_whole(path, write)
