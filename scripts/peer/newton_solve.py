"""One solve by engine newton, in the project's environment: ``python newton_solve.py CASE MODEL N`` prints a line of JSON.

Models: ``c3d20r`` and ``shell8r``, straight up; with ``_via`` through 100 and 10 times the pressure. Planes of symmetry are
hinges.
"""

from __future__ import annotations

import json
import resource
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from cases import CASES, measure, mesh, on_edge, with_middles

from limo.airbag import model as airbags
from limo.config.load import load_config
from limo.engines.newton import inflation
from limo.mechanics.model import Model
from limo.mechanics.volumes import flux
from limo.schema.accuracy import Airbag
from limo.schema.solver import Solver

ROOT = Path(__file__).parents[2]


@dataclass(frozen=True)
class Flat:
    """A flat mesh in mm, as ``limo.airbag`` wants it."""

    nodes: np.ndarray
    quads: np.ndarray
    on_edge: np.ndarray

    @property
    def layer(self) -> np.ndarray:
        """All of the wall."""
        return np.full(len(self.quads), airbags.LAYERS.index("wall"))

    @property
    def is_corner(self) -> np.ndarray:
        """Which nodes are corners of elements."""
        return np.isin(np.arange(len(self.nodes)), self.quads[:, :4])

    @property
    def on_x(self) -> np.ndarray:
        """Which nodes lie on the plane x = 0."""
        return self.nodes[:, 0] < 1e-9

    @property
    def on_y(self) -> np.ndarray:
        """Which nodes lie on the plane y = 0."""
        return self.nodes[:, 1] < 1e-9


def build(case: str, element: str, n: int) -> Model:
    """The model of a case, with the numerics of the project's airbag."""
    sheet, size = CASES[case], CASES[case].size
    shipped = load_config(str(ROOT / "config/config.yaml")).airbags["classical"]
    airbag = Airbag.model_validate(
        shipped.model_dump()
        | {
            "side": 2e3 * size,
            "thickness": 1e3 * sheet.thickness,
            "youngs_modulus": 1e-6 * sheet.youngs_modulus,
            "poisson_ratio": sheet.poisson_ratio,
            "pressure": 1e-3 * sheet.pressure,
        }
    )
    nodes, quads = mesh(case, n)
    nodes, quads = with_middles(nodes / size, quads, is_round=case == "mylar")
    flat = Flat(1e3 * size * np.column_stack([nodes, 0 * nodes[:, 0]]), quads, on_edge(case, nodes * size))
    model = airbags.build_model(airbag, airbags.Run(element, "newton", 2))
    layer = airbags.expand(flat, airbag.thickness)
    fixed, equations = airbags._held(flat, layer, False)
    return replace(
        model,
        mesh=flat,
        expansion=layer,
        nodes=layer.nodes,
        reference_start=len(layer.nodes),
        fixed=fixed,
        equations=equations,
        pressures=(replace(model.pressures[0], quads=np.arange(len(quads))),),
    )


def main(case: str, name: str, n: int) -> None:
    """Solve and print what came out, what it cost and how it ended."""
    element, _, via = name.partition("_")
    model = build(case, element.upper(), n)
    # kernels are read from their cache, which the first solve on a machine fills
    before = resource.getrusage(resource.RUSAGE_SELF)
    path = inflation.inflate(model, [100.0, 10.0, 1.0] if via else [1.0], Solver())
    after = resource.getrusage(resource.RUSAGE_SELF)
    moved = model.midsurface(path.displacements(len(path.stage) - 1)) * 1e-3 if len(path.stage) else None
    found = {}
    if moved is not None:
        nodes, quads = model.mesh.nodes[:, :2] * 1e-3, model.mesh.quads
        found = measure(case, nodes, quads[:, :4], moved)
        found["volume"] = abs(float(flux(model.mesh.nodes * 1e-3 + moved, quads).sum()))
    found |= {
        "version": path.build["version"],
        "elements": len(model.mesh.quads),
        "iterations": sum(path.iterations.values()),
        "converged": path.status == "converged",
        "cpu_seconds": after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime,
        "memory_mib": after.ru_maxrss / 1024,
    }
    if path.status != "converged":
        found["reason"] = path.reason
    print(json.dumps(found))


main(sys.argv[1], sys.argv[2], int(sys.argv[3]))
