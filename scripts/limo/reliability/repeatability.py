"""How far equal and nearly equal runs of one case are apart: repeated, by another build, perturbed, on other meshes."""

from __future__ import annotations

import csv
import hashlib
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from scipy.spatial.transform import Rotation

from limo.cases.case import Case
from limo.config.project import Project
from limo.engines.engine import Build, EngineSettings
from limo.engines.find import find_engine
from limo.measure.ramp import ramp_of
from limo.mechanics.build import build_model
from limo.mechanics.model import Model
from limo.mesh.device import mesh_device
from limo.mesh.file import read_mesh
from limo.mesh.layers import DeviceMesh
from limo.reliability.perturbation import jittered, mirrored, renumbered, rotated
from limo.schema.numerics import Mesh, MeshLevel
from limo.schema.solver import Solver
from limo.solve.beginning import beginning
from limo.solve.case import follow

KINDS = ("same", "build", "branch", "mesh")
COLUMNS = ("kind", "engine", "run", "status", "curve", "pressure", "ventricle_volume", "stroke_volume")
BRANCHES = 12
JITTERS, JITTER = 3, 0.15  # how many meshes, and by which share of an edge nodes move
SIZES = (10000, 12000, 16000)  # displacements of four quarters
TURN = (0.4, -1.1, 0.7)  # rotation vector
STEP = 2.5  # kPa between the stored points of a curve
#: how often a case is timed that takes less than so many seconds
TIMES, SHORT = 3, 60.0
Row = dict[str, object]


def reference_case(loaded: Project, engine: str, maximum: float) -> Case:
    """The case that is repeated: N_p = 8, P_v = 3.8 kPa, on the coarsest mesh, up to a P_a (kPa)."""
    config = loaded.config
    return Case(
        device=loaded.devices["limo"],
        device_name="limo",
        n_pouches=8,
        ventricular_pressure=3.8,
        actuation_pressure_max=maximum,
        aspect_ratio=2.0,
        stiffness_ratio=1.0,
        mesh=Mesh(level="coarsest"),
        mesh_level=config.mesh_levels["coarsest"],
        numerics=config.numerics_presets["fast"],
        numerics_name="fast",
        engine=engine,
    )


def measure(loaded: Project, engine: str, kinds: tuple[str, ...] = KINDS, maximum: float = 60.0) -> Iterator[list[Row]]:
    """The curves of all runs of some kinds, one after the other as they are solved; each is a list of rows."""
    case = reference_case(loaded, engine, maximum)
    mesh, found = mesh_device(case.mesh_content()), find_engine(engine)
    usual = found.build(Solver(), "config/config.yaml")

    def run(kind: str, name: str, model: Model, build: Build = usual) -> list[Row]:
        with tempfile.TemporaryDirectory() as folder:
            status, history = follow(found, model, Path(folder), EngineSettings(command=build.command))
        return _rows(kind, engine, name, status, ramp_of(history), maximum)

    if "same" in kinds:
        for k in (1, 2):
            yield run("same", f"run {k}", build_model(case, mesh))
    if "build" in kinds:
        for name, build in found.builds().items():
            yield run("build", name, build_model(case, mesh), build)
    if "branch" in kinds:
        for k in range(BRANCHES):
            yield run("branch", str(k), build_model(replace(case, branch=k), mesh))
    if "mesh" in kinds:
        for name, make in _meshes(case, mesh).items():
            yield run("mesh", name, make())


def cpu_times(
    case: Case, mesh_file: Path, status: Mapping[str, Any], settings: EngineSettings, fit: Sequence[Path] = ()
) -> list[float]:
    """CPU seconds of the solver of a solved case, and of a short one those of further solves, ``TIMES`` together.

    With those of the case at whose state it begins, whose files are ``fit``, and of that one's. A case that took ``SHORT`` or
    longer, or several attempts, is not solved again. ``status`` is what its solve left.
    """
    before = float(status.get("fit_cpu_seconds", 0.0))
    seconds = [before + float(status["solver_cpu_seconds"])]
    if seconds[0] >= SHORT or len(status["attempts"]) > 1:
        return seconds
    model = build_model(case, read_mesh(mesh_file, case.mesh.symmetry))
    engine = find_engine(case.engine)
    start = beginning(case, fit).on(model)
    while len(seconds) < TIMES:
        with tempfile.TemporaryDirectory() as folder, engine.solve(model, Path(folder), settings, start=start) as path:
            seconds.append(round(before + path.cpu_seconds, 2))
    return seconds


def _meshes(case: Case, mesh: DeviceMesh) -> dict[str, Callable[[], Model]]:
    """Models of the same device on other meshes by what was done to it."""

    def sized(degrees_of_freedom: int) -> Model:
        other = replace(case, mesh_level=MeshLevel(degrees_of_freedom=degrees_of_freedom, grading=case.mesh_level.grading))
        return build_model(other, mesh_device(other.mesh_content()))

    def full() -> Model:
        whole = replace(case, mesh=Mesh(level=case.mesh.level, symmetry="full"))
        return build_model(whole, mesh_device(whole.mesh_content()))

    made: dict[str, Callable[[], Model]] = {
        "renumbered": lambda: build_model(case, renumbered(mesh, 1)),
        "mirrored": lambda: build_model(case, mirrored(mesh)),
    }
    for k in range(1, JITTERS + 1):
        made[f"jittered {k}"] = lambda k=k: build_model(case, jittered(mesh, k, JITTER))
    for size in SIZES:
        made[f"{size} displacements"] = lambda size=size: sized(size)
    made["full device"] = full
    made["full device, rotated"] = lambda: rotated(full(), Rotation.from_rotvec(TURN).as_matrix())
    return made


def _rows(kind: str, engine: str, name: str, status: str, ramp: xr.Dataset, maximum: float) -> list[Row]:
    """A curve every ``STEP`` kPa; ``curve`` is a hash of all its volumes, bit by bit."""
    pressure, volume = ramp.actuation_pressure.values, ramp.ventricle_volume.values
    curve = hashlib.sha256(volume.tobytes() + ramp.actuation_volume.values.tobytes()).hexdigest()[:12]
    grid = np.arange(0.0, maximum + 1e-9, STEP)
    volumes = np.interp(grid, pressure, volume, right=np.nan) if len(pressure) else np.full(len(grid), np.nan)
    return [
        dict(zip(COLUMNS, (kind, engine, name, status, curve, p, repr(float(v)), repr(float(volumes[0] - v))), strict=True))
        for p, v in zip(grid, volumes, strict=True)
    ]


def append_rows(rows: list[Row], path: Path) -> None:
    """Add curves to a CSV, so that a run that is broken off keeps what it has."""
    new = not path.exists()
    with path.open("a", newline="", encoding="utf-8") as handle:
        writer = csv.DictWriter(handle, COLUMNS, lineterminator="\n")
        if new:
            writer.writeheader()
        writer.writerows(rows)
