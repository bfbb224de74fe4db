"""What an iteration takes on ever larger models, measured up to what the machine holds.

The full device is meshed finer and finer, by a constant factor of displacements. Each model is iterated a few times from its flat
state: time and memory of a direct solver depend on the pattern of its matrix and not on the state. The last sizes predict memory
and time of the next one, which is not tried if it would take more than there is.
"""

from __future__ import annotations

import tempfile
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from limo.accuracy.sizes import COLUMNS, MEASURED
from limo.cases.case import Case
from limo.config.project import Project
from limo.engines.engine import EngineSettings
from limo.engines.find import find_engine
from limo.errors import LimoError
from limo.mechanics.build import build_model
from limo.mesh.device import mesh_device
from limo.mesh.layers import degrees_of_freedom_of
from limo.schema.numerics import LARGEST_MESH, Mesh, MeshLevel
from limo.store.machine import machine_memory

#: exponents of time and memory by which the second size is foreseen; the others by the two before them
TIME, MEMORY = 1.6, 1.2


def scaling_case(project: Project, engine: str, displacements: int) -> Case:
    """The configuration's device for this, with a mesh of about that many displacements."""
    wanted = project.config.scaling
    name = project.default().numerics
    return Case(
        device=project.devices[wanted.device],
        device_name=wanted.device,
        n_pouches=wanted.n_pouches,
        ventricular_pressure=wanted.ventricular_pressure,
        actuation_pressure_max=wanted.ventricular_pressure + 40.0,
        aspect_ratio=2.0,
        stiffness_ratio=1.0,
        mesh=Mesh(symmetry="full"),
        mesh_level=MeshLevel(degrees_of_freedom=displacements),
        numerics=project.config.numerics_presets[name].for_engine(engine),
        numerics_name=name,
        engine=engine,
    )


def measure_scaling(project: Project, engine: str, settings: EngineSettings) -> pd.DataFrame:
    """A row of ``COLUMNS`` for each size of the configuration's ``scaling``, smallest first.

    Every size has a process of its own, whose end, whatever it is, is a row.
    """
    wanted, rows = project.config.scaling, []
    limits = {"cpu_seconds": 60.0 * wanted.minutes, "memory_mib": wanted.memory * machine_memory()}
    size = wanted.start
    while size <= LARGEST_MESH:
        if rows and any(_foreseen(rows, what, size) > most for what, most in limits.items()):
            break
        case = scaling_case(project, engine, size)
        try:
            with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
                row = pool.submit(_measure, case, settings).result()
        except (BrokenProcessPool, LimoError, MemoryError) as error:
            row = {"status": f"failed: {error}".splitlines()[0], "displacements": size}
        rows.append({"engine": engine} | row)
        if row["status"] != MEASURED:
            break
        size = round(size * wanted.factor)
    return pd.DataFrame(rows, columns=[*COLUMNS])


def _foreseen(rows: list[dict[str, Any]], what: str, size: float) -> float:
    """A value of the next size by the power law through the last two."""
    last, power = rows[-1], {"cpu_seconds": TIME, "memory_mib": MEMORY}[what]
    if len(rows) > 1:
        grown = np.log(last["displacements"] / rows[-2]["displacements"])
        power = max(power, float(np.log(last[what] / rows[-2][what]) / grown))
    return last[what] * (size / last["displacements"]) ** power


def _measure(case: Case, settings: EngineSettings) -> dict[str, Any]:
    """Mesh a case and let its engine iterate a few times: a row without its engine."""
    model = build_model(case, mesh_device(case.mesh_content()))
    with tempfile.TemporaryDirectory() as folder:
        sample = find_engine(case.engine).sample(model, Path(folder), settings)
    return {
        "displacements": degrees_of_freedom_of(model.mesh),
        "elements": len(model.mesh.quads),
        "build": sample.build,
        "status": MEASURED if sample.iterations else sample.reason,
        "iterations": sample.iterations,
        "cpu_seconds": sample.cpu_seconds,
        "memory_mib": sample.memory,
    }
