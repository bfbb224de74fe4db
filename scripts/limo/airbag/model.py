"""Inflation of a square airbag (paper, *Square airbag inflation convergence*): a quarter of its upper sheet.

The sheet is flat, 0 <= x, y <= side / 2, with its centre M at the origin. The middle B of an edge is at (side / 2, 0), a corner
at (side / 2, side / 2). A uniform follower pressure p acts from below.

    x = 0: u_x = 0,   y = 0: u_y = 0,   outer edge: u_z = 0, free to rotate

Planes of symmetry are ``symmetric``, held through the thickness, for bricks, or ``hinged``: held in the middle of the sheet,
which may then turn there and fold. Shells are always hinged, because CalculiX cannot hold their rotations without rigid knots.
Units: mm, N, MPa, tonne, s; pressures of the configuration in kPa.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from limo.mechanics.model import Equation, Expansion, Fabric, Loading, Model, Pressure, expand
from limo.mesh.elements import QUAD8, QUAD9_TRIANGLES
from limo.mesh.layers import LAYERS
from limo.schema.accuracy import Airbag, AirbagSeries
from limo.schema.element import Element, element
from limo.store.digest import number_label

#: mass per area (g / m^2). It enters no equilibrium: damping and the shift of the engine newton are relative to it
AREAL_DENSITY = 170.0
#: what solves a series that says nothing else, so that its name need not say it
USUAL_ENGINE = AirbagSeries.model_fields["engine"].default


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
        engine = [] if self.engine == USUAL_ENGINE else [self.engine]
        planes = [] if element(self.element).is_shell else [self.planes]
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
    def layer(self) -> np.ndarray:
        """The layer (m,) of each element: there is but one, as of a device's wall."""
        return np.full(len(self.quads), LAYERS.index("wall"))

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


def sheet(side: float, divisions: int, element: Element) -> Sheet:
    """The quarter as ``divisions`` x ``divisions`` squares, or each of them as two triangles cut along x = y; ``side`` in mm.

    The mesh is its own mirror image at x = y, as the airbag is.
    """
    step = element.order
    size = step * divisions + 1
    cell = (np.vstack([QUAD8, [[0, 0]]]) + 1).astype(int) * step // 2  # nine places of a square; without mid-sides some coincide
    corners = step * np.stack(np.meshgrid(np.arange(divisions), np.arange(divisions)), axis=-1).reshape(-1, 2)
    places = corners[:, None] + cell  # (m, 9, 2)
    if element.corners == 3:
        kept = QUAD9_TRIANGLES[:, : element.face_nodes]
        places = places[:, kept].reshape(-1, kept.shape[1], 2)
    else:
        places = places[:, : element.face_nodes]
    numbers, elements = np.unique(places[..., 0] + size * places[..., 1], return_inverse=True)
    lattice = np.stack([numbers % size, numbers // size], axis=1)
    nodes = np.column_stack([0.5 * side * lattice / (size - 1), np.zeros(len(lattice))])
    return Sheet(nodes, elements.reshape(places.shape[:2]), lattice, size, step)


def build_model(airbag: Airbag, run: Run) -> Model:
    """Nodes and constraints of one run. There is no ramp: the pressure of the airbag is P_v."""
    made_of = element(run.element)
    flat = sheet(airbag.side, run.divisions, made_of)
    layer = None if made_of.is_shell else expand(flat, airbag.thickness)
    nodes = flat.nodes if layer is None else layer.nodes
    fixed, equations = _held(flat, layer, run.planes == "symmetric")
    return Model(
        name=f"square airbag, {run.name}",
        element=made_of,
        fabric=Fabric(airbag.youngs_modulus, airbag.poisson_ratio, airbag.thickness, AREAL_DENSITY, stiffness_ratio=1.0),
        loading=Loading(airbag.pressure, actuation_pressure_max=0.0, frames=()),
        numerics=airbag.numerics,
        length=airbag.side,
        mesh=flat,
        expansion=layer,
        nodes=nodes,
        reference_start=len(nodes),
        prescribed={},
        fixed=fixed,
        equations=equations,
        pressures=(Pressure("sheet", np.arange(len(flat.quads)), "bottom", 1.0, 0.0),),
    )


def _held(flat: Sheet, layer: Expansion | None, is_symmetric: bool) -> tuple[tuple[tuple[int, int], ...], tuple[Equation, ...]]:
    """What is held at zero, and what is tied: planes of symmetry, the outer edge."""
    fixed, equations = [], []
    for mask, direction in ((flat.on_x, 0), (flat.on_y, 1), (flat.on_edge, 2)):
        line = np.flatnonzero(mask)
        if layer is None:
            held = line
        elif is_symmetric and direction < 2:
            held = np.concatenate([layer.bottom[line], layer.middle[line], layer.top[line]])
        else:
            held = layer.middle[line]
            ends = [(int(layer.bottom[n]), int(layer.top[n])) for n in line if layer.middle[n] < 0]
            equations += [Equation(((low, direction, 1.0), (high, direction, 1.0))) for low, high in ends]
        fixed += [(int(n), direction) for n in held if n >= 0]
    return tuple(fixed), tuple(equations)


def degrees_of_freedom(model: Model) -> int:
    """Three displacements a node of the layer, whoever expands it; with mid-sides a corner has three nodes, else two."""
    between = int(model.mesh.is_corner.sum()) if model.element.order == 2 else 0
    return 3 * (2 * len(model.mesh.nodes) + between)
