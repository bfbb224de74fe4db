"""Inflation of a square airbag (paper, *Square airbag inflation convergence*): a quarter of its upper sheet.

The sheet is flat, 0 <= x, y <= side / 2, with its centre M at the origin, the middle B of an edge at (side / 2, 0) and a
corner at (side / 2, side / 2). A uniform follower pressure p acts from below.

    x = 0: u_x = 0,   y = 0: u_y = 0,   outer edge: u_z = 0, free to rotate

Planes of symmetry are ``symmetric``, held through the thickness, for bricks, or ``hinged``: held in the middle of the sheet,
which may then turn there and fold. Shells are always hinged, because CalculiX cannot hold their rotations without rigid knots.
Units: mm, N, MPa, tonne, s; pressures of the configuration in kPa.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from limo.mechanics.model import Equation, Model, Pressure, expand
from limo.mesh.elements import QUAD8, QUAD9_TRIANGLES
from limo.schema.accuracy import Airbag
from limo.schema.device import Material
from limo.store.digest import number_label

#: elements with mid-side nodes, and triangles
QUADRATIC, TRIANGULAR = ("S6", "S8", "S8R", "C3D20R", "C3D20"), ("S3", "S6")
#: mass per area (g / m^2). It enters no equilibrium: damping and the shift of the engine newton are relative to it
AREAL_DENSITY = 170.0


@dataclass(frozen=True)
class Run:
    """One solution of an airbag: element type, engine, elements along half a side, path to p in multiples of it, planes."""

    element: str
    engine: str
    divisions: int
    path: tuple[float, ...] = ()
    planes: str = "hinged"

    @property
    def name(self) -> str:
        """Its name among the runs of its airbag, as a file has it."""
        passed = "".join(f"_{number_label(x)}p" for x in self.path)
        return f"{self.element}_{self.planes}_{self.engine}{passed}_{self.divisions}".replace(".", "d")

    @property
    def series(self) -> str:
        """Its series for people: the element, and what else tells it from other series of the element."""
        way = f"via {', '.join(map(number_label, self.path))} p" if self.path else "straight up"
        engine, planes = ["newton"] * (self.engine == "newton"), [self.planes] * self.element.startswith("C3D")
        return f"{self.element} ({', '.join([*engine, *planes, way])})"


def runs_of(airbag: Airbag) -> dict[str, Run]:
    """All runs of an airbag by their names, in the order of its configuration."""
    runs = (Run(s.element, s.engine, n, tuple(s.path), s.chosen_planes) for s in airbag.series for n in s.divisions)
    return {run.name: run for run in runs}


def run_content(airbag: Airbag, run: Run) -> dict[str, Any]:
    """What the result of a run depends on: not words, other runs, limits of time or the numerics of the other engine."""
    sheet = airbag.model_dump(mode="json", include={"side", "thickness", "youngs_modulus", "poisson_ratio", "pressure"})
    return {**sheet, "numerics": airbag.numerics.for_engine(run.engine), "run": asdict(run) | {"path": list(run.path)}}


@dataclass(frozen=True)
class Sheet:
    """A structured mesh of the quarter.

    ``nodes`` (n, 3) in mm; ``quads`` (m, k) in the order of CalculiX, triangles for S3 and S6; ``lattice`` (n, 2) column and
    row of each node among ``size`` a direction, ``step`` of them a side of an element: 2 with mid-side nodes, 1 without.
    """

    nodes: np.ndarray
    quads: np.ndarray
    lattice: np.ndarray
    size: int
    step: int

    def node_at(self, column: int, row: int) -> int:
        """Number of the node at a place of the lattice."""
        return int(np.flatnonzero((self.lattice == (column, row)).all(axis=1))[0])

    @property
    def is_corner(self) -> np.ndarray:
        """Which nodes (n,) are corners of elements."""
        return (self.lattice % self.step == 0).all(axis=1)

    @property
    def on_x(self) -> np.ndarray:
        """Which nodes (n,) lie on the plane of symmetry x = 0."""
        return self.lattice[:, 0] == 0

    @property
    def on_y(self) -> np.ndarray:
        """Which nodes (n,) lie on the plane of symmetry y = 0."""
        return self.lattice[:, 1] == 0

    @property
    def on_edge(self) -> np.ndarray:
        """Which nodes (n,) lie on the outer edge."""
        return (self.lattice == self.size - 1).any(axis=1)


def sheet(side: float, divisions: int, element: str) -> Sheet:
    """The quarter as ``divisions`` x ``divisions`` squares, or each of them as two triangles cut along x = y; ``side`` in mm.

    The mesh is its own mirror image at x = y, as the airbag is.
    """
    step = 2 if element in QUADRATIC else 1
    size = step * divisions + 1
    cell = (np.vstack([QUAD8, [[0, 0]]]) + 1).astype(int) * step // 2  # nine places of a square; without mid-sides some coincide
    corners = step * np.stack(np.meshgrid(np.arange(divisions), np.arange(divisions)), axis=-1).reshape(-1, 2)
    places = corners[:, None] + cell  # (m, 9, 2)
    if element in TRIANGULAR:
        kept = QUAD9_TRIANGLES[:, : 6 if step == 2 else 3]
        places = places[:, kept].reshape(-1, kept.shape[1], 2)
    else:
        places = places[:, : 8 if step == 2 else 4]
    numbers, elements = np.unique(places[..., 0] + size * places[..., 1], return_inverse=True)
    lattice = np.stack([numbers % size, numbers // size], axis=1)
    nodes = np.column_stack([0.5 * side * lattice / (size - 1), np.zeros(len(lattice))])
    return Sheet(nodes, elements.reshape(places.shape[:2]), lattice, size, step)


@dataclass(frozen=True)
class AirbagModel(Model):
    """What an engine solves: shells (``expansion`` is None), or the sheet written out as one layer of bricks.

    ``mesh`` is a ``Sheet``, ``case`` only what engines read of one.
    """

    airbag: Airbag
    run: Run

    def under(self, level: float) -> AirbagModel:
        """The same under ``level`` p, for the engine newton."""
        return replace(self, case=_case(self.airbag, self.run, level))

    @property
    def is_shell(self) -> bool:
        """Whether CalculiX makes the layer itself."""
        return self.expansion is None

    @property
    def youngs_modulus(self) -> np.ndarray:
        """E (m,) in MPa of every element."""
        return np.full(len(self.mesh.quads), self.airbag.youngs_modulus)

    @property
    def degrees_of_freedom(self) -> int:
        """Three displacements a node of the layer, whoever expands it; with mid-sides a corner has three nodes, else two."""
        if self.run.element not in QUADRATIC:
            return 6 * len(self.mesh.nodes)
        return 3 * (2 * len(self.mesh.nodes) + int(self.mesh.is_corner.sum()))

    def midsurface(self, displacements: np.ndarray) -> np.ndarray:
        """Displacements of the model's nodes -> those of the sheet's nodes (n, 3) in mm."""
        return displacements if self.is_shell else self.expansion.midsurface(displacements)


def _case(airbag: Airbag, run: Run, level: float = 1.0) -> SimpleNamespace:
    """What engines read of a case: ``level`` p is the ventricular pressure of its fit, and there is no ramp."""
    elastic = {key: getattr(airbag, key) for key in ("youngs_modulus", "poisson_ratio", "thickness")}
    material = Material(**elastic, areal_density=AREAL_DENSITY)
    return SimpleNamespace(
        mesh=SimpleNamespace(element=run.element),
        device=SimpleNamespace(material=material, pattern=SimpleNamespace(length=airbag.side)),
        numerics=airbag.numerics,
        ventricular_pressure=level * airbag.pressure,
        actuation_pressure_max=0.0,
        frames=(),
    )


def build_model(airbag: Airbag, run: Run) -> AirbagModel:
    """Nodes and constraints of one run."""
    flat = sheet(airbag.side, run.divisions, run.element)
    is_shell = not run.element.startswith("C3D")
    layer = None if is_shell else expand(flat, airbag.thickness)
    nodes = flat.nodes if is_shell else layer.nodes
    fixed, equations = [], []
    for mask, direction in ((flat.on_x, 0), (flat.on_y, 1), (flat.on_edge, 2)):
        line = np.flatnonzero(mask)
        if is_shell:
            held = line
        elif run.planes == "symmetric" and direction < 2:
            held = np.concatenate([layer.bottom[line], layer.middle[line], layer.top[line]])
        else:
            held = layer.middle[line]
            ends = [(int(layer.bottom[n]), int(layer.top[n])) for n in line if layer.middle[n] < 0]
            equations += [Equation(((low, direction, 1.0), (high, direction, 1.0))) for low, high in ends]
        fixed += [(int(n), direction) for n in held if n >= 0]
    loads = (Pressure("sheet", np.arange(len(flat.quads)), "bottom", 1.0, 0.0),)
    case = _case(airbag, run)
    return AirbagModel(case, flat, layer, nodes, len(nodes), {}, tuple(fixed), tuple(equations), loads, airbag, run)
