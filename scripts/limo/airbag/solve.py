"""Solve the runs of an airbag, measure them, and gather them into one dataset with a row a run."""

from __future__ import annotations

import json
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import xarray as xr

from limo.airbag.model import Run, build_model, degrees_of_freedom
from limo.engines.engine import EngineSettings
from limo.engines.find import find_engine
from limo.mechanics.constitutive import cauchy, second_piola_kirchhoff
from limo.mechanics.energy import part_energy_and_extremes
from limo.mechanics.kinematics import lame
from limo.mechanics.model import Model
from limo.mechanics.volumes import flux
from limo.schema.accuracy import Airbag
from limo.store.digest import number_label

#: units and long name of what is measured of a run that converged; without a result they are NaN
MEASURED = {
    "height": ("mm", "height of the centre, w_M"),
    "edge_draw_in": ("mm", "how far the middle of an edge moves in"),
    "edge_draw_in_smooth": ("mm", "the same without the folds beside it: value of an even parabola through half the edge"),
    "corner_draw_in": ("mm", "how far the corner moves in along x and y, mean of the two"),
    "asymmetry": ("mm", "difference of the corner's displacements along x and y"),
    "stress": ("MPa", "largest principal Cauchy stress at the centre"),
    "potential_energy": ("J", "strain energy less p V of the quarter of the upper sheet; of bricks only"),
}
#: the same for what every run has
COUNTED = {
    "divisions": ("1", "elements along half a side"),
    "degrees_of_freedom": ("1", "three displacements a node of the expanded layer"),
    "cpu_seconds": ("s", "CPU time of the solver"),
    "iterations": ("1", "Newton iterations, those of rejected attempts included"),
    "rejected": ("1", "attempts that were rejected"),
    "memory": ("MiB", "largest memory of the solver's process; of engine newton of the whole Python"),
}
TEXT = ("series", "element", "engine", "planes", "path", "status", "reason")


def solve_run(airbag: Airbag, run: Run, settings: EngineSettings) -> xr.Dataset:
    """Solve one run; what fails is a row with status and reason."""
    model = build_model(airbag, run)
    row, displacements = _solve(model, run, airbag.time_limit, settings)
    row |= {
        "series": run.series,
        "element": run.element,
        "engine": run.engine,
        "planes": run.planes,
        "path": ", ".join(map(number_label, (*run.path, 1.0))),
        "divisions": run.divisions,
        "degrees_of_freedom": degrees_of_freedom(model),
    }
    measured = dict.fromkeys(MEASURED, np.nan)
    grid = np.full((model.mesh.size, model.mesh.size, 3), np.nan, np.float32)
    if displacements is not None:
        moved = model.midsurface(displacements)
        if row["status"] == "converged" and not np.abs(moved).max() < airbag.side:
            row |= {"status": "diverged", "reason": f"displacements of {np.abs(moved).max():.3g} mm"}
        if row["status"] == "converged":
            measured = measure(model, moved) | {"potential_energy": potential_energy(model, displacements)}
        column, line = model.mesh.lattice.T
        grid[line, column] = moved
    return _dataset(row | measured, grid)


def _solve(model: Model, run: Run, time_limit: float, settings: EngineSettings) -> tuple[dict, np.ndarray | None]:
    """How a run ended and what it cost; displacements (n, 3) in mm of the last accepted state, None without one."""
    settings = replace(settings, solver=settings.solver.model_copy(update={"time_limit": time_limit}))
    engine, levels = find_engine(run.engine), (*run.path, 1.0)
    with tempfile.TemporaryDirectory(prefix="limo_airbag_") as name, engine.inflate(model, levels, Path(name), settings) as path:
        last = len(path.stage) - 1
        state = path.displacements(last) if last >= 0 else None
    row = {
        "status": path.status,
        "reason": path.reason,
        "cpu_seconds": path.cpu_seconds,
        "iterations": sum(path.iterations.values()),
        "rejected": path.rejected,
        "memory": path.memory,
    }
    return row, state


def measure(model: Model, moved: np.ndarray) -> dict[str, float]:
    """``MEASURED`` from displacements (n, 3) in mm of the sheet's nodes.

    Wrinkles end at the edge as folds, and its middle lies in one of them. The even parabola a + b s^2, fitted to the draw-in
    over |s| <= side / 4 from there, does without.
    """
    sheet, last = model.mesh, model.mesh.size - 1
    middle, corner = moved[sheet.node_at(last, 0)], moved[sheet.node_at(last, last)]
    smooth = []
    for axis in (0, 1):
        edge = (sheet.lattice[:, axis] == last) & (sheet.nodes[:, 1 - axis] <= model.length / 4)
        along = sheet.nodes[edge, 1 - axis] / model.length
        smooth.append(np.polynomial.polynomial.polyfit(along**2, -moved[edge, axis], 1)[0])
    return {
        "height": float(moved[sheet.node_at(0, 0), 2]),
        "edge_draw_in": float(-(middle[0] + moved[sheet.node_at(0, last), 1]) / 2),
        "edge_draw_in_smooth": float(np.mean(smooth)),
        "corner_draw_in": float(-(corner[0] + corner[1]) / 2),
        "asymmetry": float(abs(corner[0] - corner[1])),
        "stress": centre_stress(model, moved),
    }


def centre_stress(model: Model, moved: np.ndarray) -> float:
    """Largest principal Cauchy stress (MPa) at M from the stretches of the elements' sides there, along x and y.

    By symmetry they are principal. Plane stress: E_3 = -nu / (1 - nu) (E_1 + E_2).
    """
    sheet, fabric = model.mesh, model.fabric
    placed, stretch = sheet.nodes + moved, []
    for axis in (0, 1):
        line = [sheet.node_at(*((k, 0) if axis == 0 else (0, k))) for k in range(sheet.step + 1)]
        lengths = [np.linalg.norm(np.diff(x[line], axis=0), axis=1).sum() for x in (placed, sheet.nodes)]
        stretch.append(lengths[0] / lengths[1])
    along = [0.5 * (x**2 - 1) for x in stretch]
    across = -fabric.poisson_ratio / (1 - fabric.poisson_ratio) * sum(along)
    deformation = np.diag([*stretch, np.sqrt(max(1 + 2 * across, 1e-6))])
    second_piola = second_piola_kirchhoff(np.diag([*along, across]), *lame(fabric.youngs_modulus, fabric.poisson_ratio))
    return float(cauchy(deformation, second_piola).diagonal().max())


def potential_energy(model: Model, displacements: np.ndarray) -> float:
    """Pi = W - p V in J of a brick model's state (n, 3) in mm; NaN of shells, whose layer the solver makes itself.

    W is the strain energy and V the volume between the sheet and the plane of its edge. Equilibria are stationary points of
    Pi, stable ones its minima. So of two wrinkled states on one mesh the lower one is nearer to rest for good.
    """
    if model.element.is_shell:
        return np.nan
    energy = part_energy_and_extremes(model, displacements)[0]
    surface = np.mean([(model.nodes + displacements)[nodes] for nodes in model.loaded("bottom")], axis=0)
    volume = flux(surface, model.mesh.quads).sum()
    return float(1e-3 * energy - 1e-6 * model.loading.ventricular_pressure * volume)  # mJ, kPa mm^3


def _dataset(row: dict, grid: np.ndarray) -> xr.Dataset:
    """One run; its displacements on the lattice of the mesh, NaN where that has no node."""
    known = MEASURED | COUNTED
    data = {name: ("run", [row[name]], {"units": known[name][0], "long_name": known[name][1]}) for name in known}
    data |= {name: ("run", np.array([row[name]], object)) for name in TEXT}
    attributes = {"units": "mm", "long_name": "displacement (x, y, z) of the last accepted state on the lattice of the mesh"}
    data["displacement"] = (("run", "row", "column", "direction"), grid[None], attributes)
    return xr.Dataset(data)


def gather(airbag: Airbag, name: str, runs: list[xr.Dataset]) -> xr.Dataset:
    """All runs of an airbag; lattices are padded with NaN to the largest."""
    size = max(run.sizes["row"] for run in runs)
    padded = [run.pad({d: (0, size - run.sizes[d]) for d in ("row", "column")}) for run in runs]
    dataset = xr.concat(padded, "run", data_vars="all", coords="minimal", compat="equals", join="exact")
    for variable in ("divisions", "degrees_of_freedom", "iterations", "rejected"):
        dataset[variable] = dataset[variable].astype("int32").assign_attrs(dataset[variable].attrs)
    for variable in TEXT:
        # files keep the width of the first text that they were read from, which would cut the others
        dataset[variable] = ("run", dataset[variable].values.astype(object))
    dataset["displacement"].encoding = {"zlib": True, "dtype": "float32"}
    return dataset.assign_attrs(
        airbag=name, config=json.dumps(airbag.model_dump(mode="json")), side=airbag.side, pressure=airbag.pressure
    )
