"""Studies, displaced models and cases written to disk without a solver."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import xarray as xr

from limo.cases.case import Case
from limo.config.project import Project
from limo.geometry.pattern import flat_pattern
from limo.mesh.device import mesh_to_target
from limo.mesh.layers import DeviceMesh, layered
from limo.schema.device import Material
from limo.schema.numerics import Mesh, MeshLevel
from limo.schema.study import Study
from limo.store.digest import digest
from limo.store.files import write_json
from tests.helpers.shared import kept


def study(**changes):
    values = {
        "axes": {"n_pouches": [8], "ventricular_pressure": [3.8]}, "actuation_pressure_max": 60.0,
        "frames": [0, "P_v + 10", "max"], "mesh": {"level": "preview", "symmetry": "quarter", "element": "C3D20R"},
        "outputs": ["volumes"],
    }  # fmt: skip
    return Study.model_validate(values | changes)


def woven(material: Material, **changes) -> Material:
    """The fabric with yarns, and with a pouch sheet of another weave, thickness and bending stiffness."""
    yarns = {"warp_modulus": 400.0, "weft_modulus": 150.0, "poisson_ratio": 0.4, "shear_modulus": 40.0, "angle": 25.0}
    plain = material.model_dump(exclude={"pouch_sheet"})
    other = {**yarns, "warp_modulus": 90.0, "poisson_ratio": 0.2, "angle": -60.0}
    outer = {**plain, "thickness": 0.12, "weave": other, "bending_factor": 0.5}
    values = {"weave": yarns, "bending_factor": 0.3, "pouch_sheet": outer} | changes
    return Material.model_validate(plain | {key: value for key, value in values.items() if value is not None})


def without_studies(root: Path, folder: Path) -> Path:
    """The shipped configuration in ``folder``, without its studies; returns the folder that studies belong into."""
    shutil.copytree(root / "config", folder / "config")
    studies = folder / "config" / "studies"
    for file in studies.iterdir():
        file.unlink()
    return studies


def configured(loaded, **studies) -> Project:
    return Project(loaded.config, loaded.devices, studies, loaded.files)


def moved(model, pressure):
    """A smooth, stretched and bent state of the model, more of it with pressure."""
    x, y, z = model.expansion.nodes.T
    s = pressure / 60.0
    height = 10 * np.sin(np.pi * y / 140) * np.cos(np.pi * x / 140)
    return np.stack([0.03 * s * x, 0.01 * s * y, (0.2 + s) * height - 0.01 * s * z], axis=1)


def write_case(folder, model, displacements, cycle=()):
    """``displacements`` by P_a; ``cycle``: lists of P_v, P_a and displacements by the leg of a cycle."""
    folder.mkdir(parents=True, exist_ok=True)
    pressures = list(displacements)
    p = np.unique(np.concatenate([np.linspace(0, 60, 121), 20 + np.linspace(0, 0.2, 5)]))
    volume = 400 - 80 * p / 60 - 10 * (p > 20.1)
    history = xr.Dataset(
        {"ventricle_volume": ("increment", volume), "actuation_volume": ("increment", p)},
        coords={"actuation_pressure": ("increment", p), "stage": ("increment", np.where(p > 0, 2, 1))},
    )
    history.to_netcdf(folder / "volumes.nc")
    u = np.array(list(displacements.values()), np.float32)
    frames = xr.Dataset(
        {
            "displacement": (("frame", "node", "axis"), u),
            "motion": (("frame", "derivative", "node", "axis"), np.zeros((len(u), 2, *u.shape[1:]), np.float32)),
            "event_displacement": (("event", "end", "node", "axis"), np.stack([0 * u[0], 0 * u[0] + [0, 0, 7.0]])[None]),
        },
        coords={
            "requested_pressure": ("frame", pressures), "actuation_pressure": ("frame", pressures),
            "event_pressure": (("event", "end"), [[20.1, 20.15]]),
        },
    )  # fmt: skip
    if cycle:
        legs = [(leg, state) for leg, states in cycle.items() for state in states]
        frames["cycle_leg"] = "cycle_frame", [leg for leg, _ in legs]
        frames["cycle_ventricular_pressure"] = "cycle_frame", [p for _, (p, _, _) in legs]
        frames["cycle_actuation_pressure"] = "cycle_frame", [p for _, (_, p, _) in legs]
        frames["cycle_displacement"] = ("cycle_frame", "node", "axis"), np.array([u for _, (*_, u) in legs], np.float32)
    frames.to_netcdf(folder / "frames.nc")
    write_json(folder / "status.json", {"status": "converged", "reason": ""})


STATUS = {
    "status": "converged", "reason": "", "actuation_pressure_reached": 60.0, "increments": 200, "rejected_attempts": 7,
    "iterations": 900, "iterations_by_stage": {"fit": 300, "hold": 0, "ramp": 600}, "solver_wall_seconds": 90.0,
    "solver_cpu_seconds": 80.0,
}  # fmt: skip


def shaken(model, size=0.01, seed=1):
    """Smooth large displacements plus a little disorder."""
    x, y, _ = model.nodes.T
    smooth = np.stack([0.02 * x, -0.01 * y, 5 * np.sin(x / 30) * np.cos(y / 40)], axis=1)
    return smooth + size * np.random.default_rng(seed).uniform(-1, 1, model.nodes.shape)


def with_(case: Case, **changes) -> Case:
    """A case with other values; ``symmetry`` and ``element`` reach into its mesh."""
    mesh = {k: changes.pop(k) for k in ("symmetry", "element") if k in changes}
    return replace(case, **changes, mesh=Mesh(**{**case.mesh.model_dump(), **mesh}))


def small_mesh(case: Case, degrees_of_freedom: int, symmetry: str) -> DeviceMesh:
    """A very coarse mesh of the case's device; gmsh makes it once for all tests."""
    level = MeshLevel(degrees_of_freedom=degrees_of_freedom)
    pattern = flat_pattern(case.device.pattern, case.n_pouches)
    name = digest([case.device.pattern.model_dump(mode="json"), case.n_pouches, level.model_dump(mode="json")])
    flat = kept(f"flat_{name}", lambda: mesh_to_target(pattern, level.degrees_of_freedom, level.grading))
    return layered(flat, pattern, symmetry)
