"""The cases that a peer and engine newton both solve: their numbers, meshes and closed forms. Needs numpy alone; SI units.

Both are a quarter of the upper sheet of a cushion of two equal sheets: flat in z = 0, planes of symmetry x = 0 and y = 0, and an
outer edge that stays in z = 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Sheet:
    """``size`` (m): half a side of the square or the radius of the disc. E, p in Pa, thickness in m, density in kg / m^3."""

    size: float
    thickness: float
    youngs_modulus: float
    poisson_ratio: float
    pressure: float
    density: float = 1000.0  # of explicit relaxation alone


CASES = {
    "airbag": Sheet(0.848528 / 2, 0.6e-3, 588e6, 0.4, 5e3),  # config/airbags/classical.yaml
    "mylar": Sheet(0.2, 0.05e-3, 3e9, 0.3, 1e3),
}
#: nodes of an element by the corners of a square: its four nodes in turn, and the triangles of a cross through its centre
_CORNERS = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])


def square(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes (k, 2) of the unit square and quads (n n, 4)."""
    x, y = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1))
    column, row = np.meshgrid(np.arange(n), np.arange(n))
    places = np.stack([column, row], axis=-1).reshape(-1, 1, 2) + _CORNERS
    return np.column_stack([x.ravel(), y.ravel()]), places[..., 0] + (n + 1) * places[..., 1]


def quarter_disc(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes (k, 2) of a quarter of the unit disc and quads (3 n n, 4): three blocks of n x n."""
    middle, diagonal = 0.5, 0.4  # where the blocks meet
    points, block = square(n)
    s, t = points[:, :1], points[:, 1:]
    origin, right, top, corner = (np.array(p) for p in ((0, 0), (middle, 0), (0, middle), (diagonal, diagonal)))
    inner = (1 - s) * (1 - t) * origin + s * (1 - t) * right + s * t * corner + (1 - s) * t * top
    angle = math.pi / 4 * t
    low = (1 - s) * ((1 - t) * right + t * corner) + s * np.hstack([np.cos(angle), np.sin(angle)])
    angle = math.pi / 4 * (2 - s)
    high = (1 - t) * ((1 - s) * top + s * corner) + t * np.hstack([np.cos(angle), np.sin(angle)])
    blocks = np.vstack([inner, low, high])
    _, first, number = np.unique(np.round(blocks, 9), axis=0, return_index=True, return_inverse=True)
    quads = np.vstack([block, block + len(points), block + 2 * len(points)])
    return blocks[first], number.ravel()[quads]


def crossed(nodes: np.ndarray, quads: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same area as four triangles a quad, which meet at its centre."""
    centres = len(nodes) + np.arange(len(quads))
    triangles = [np.column_stack([quads[:, k], quads[:, (k + 1) % 4], centres]) for k in range(4)]
    return np.vstack([nodes, nodes[quads].mean(axis=1)]), np.vstack(triangles)


def with_middles(nodes: np.ndarray, quads: np.ndarray, is_round: bool) -> tuple[np.ndarray, np.ndarray]:
    """Quads of eight nodes; those on the rim of a disc (``is_round``) lie on its circle."""
    edges = np.stack([quads, np.roll(quads, -1, axis=1)], axis=-1)
    unique, number = np.unique(np.sort(edges, axis=-1).reshape(-1, 2), axis=0, return_inverse=True)
    middles = nodes[unique].mean(axis=1)
    if is_round:
        rim = (np.abs(np.linalg.norm(nodes, axis=1) - 1) < 1e-9)[unique].all(axis=1)
        middles[rim] /= np.linalg.norm(middles[rim], axis=1, keepdims=True)
    return np.vstack([nodes, middles]), np.hstack([quads, len(nodes) + number.reshape(-1, 4)])


def mesh(case: str, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes (k, 2) in m and quads (m, 4) of a case."""
    nodes, quads = square(n) if case == "airbag" else quarter_disc(n)
    return nodes * CASES[case].size, quads


def on_edge(case: str, nodes: np.ndarray) -> np.ndarray:
    """Which nodes (k, 2) in m lie on the outer edge."""
    far = nodes.max(axis=1) if case == "airbag" else np.linalg.norm(nodes, axis=1)
    return far > CASES[case].size * (1 - 1e-6)


def mylar_balloon() -> dict[str, float]:
    """Rim and height (m) and volume (m^3, the quarter of the upper sheet) of two inextensible discs of radius R.

    They hold no stress around the axis. Its meridian has dz/dr = -r^2 / sqrt(a^4 - r^4) and the length R, with the rim a; Paulsen
    (1994), *Amer. Math. Monthly* 101, 953-958: a = 0.7627 R, thickness 0.9139 R, V = 1.2185 R^3.
    """
    # r = a sqrt(sin s) takes the root out of the ends; G = Gauss-Legendre in s of s = v^2 takes that of the sine
    v, weight = np.polynomial.legendre.leggauss(200)
    root = math.sqrt(math.pi / 2)
    v, weight = root * (v + 1) / 2, root * weight / 2
    s = v**2
    half = np.sqrt(np.sin(s))
    length = np.sum(weight * v / half)  # int ds / (2 sqrt(sin s)), of a = 1
    rise = np.sum(weight * v * half)  # int sqrt(sin s) / 2 ds
    volume = math.pi * np.sum(weight * v * np.sin(s) * half)  # int pi r^2 |dz|
    radius = CASES["mylar"].size
    rim = radius / length
    return {"rim": rim, "height": rim * rise, "volume": rim**3 * volume / 4}


def measure(case: str, nodes: np.ndarray, elements: np.ndarray, moved: np.ndarray) -> dict[str, float]:
    """Height, draw-in of the edge's middle and the smooth one, rim (m) and volume (m^3) from displacements (k, 3) in m.

    ``elements`` of three or four corners. Smooth: the value a of a + b s^2 fitted to the inner half of an edge.
    """
    size, placed = CASES[case].size, np.column_stack([nodes, 0 * nodes[:, 0]]) + moved
    found = {"height": float(placed[np.argmin(np.linalg.norm(nodes, axis=1)), 2]), "volume": _volume(elements, placed)}
    if case == "mylar":
        edge = np.linalg.norm(placed[on_edge(case, nodes)][:, :2], axis=1)
        return found | {"rim": float(edge.mean())}
    middle, smooth = [], []
    for axis in (0, 1):
        along = nodes[:, 1 - axis]
        edge = (nodes[:, axis] > size * (1 - 1e-6)) & (along <= size / 2 * (1 + 1e-9))
        middle.append(-moved[edge, axis][np.argmin(along[edge])])
        smooth.append(np.polynomial.polynomial.polyfit((along[edge] / size) ** 2, -moved[edge, axis], 1)[0])
    return found | {"draw_in": float(np.mean(middle)), "smooth_draw_in": float(np.mean(smooth))}


def _volume(elements: np.ndarray, placed: np.ndarray) -> float:
    """Volume (m^3) between triangles or bilinear quads and z = 0; a quad is the mean of both its cuts into triangles."""
    cuts = [(0, 1, 2)] if elements.shape[1] == 3 else [(0, 1, 2), (0, 2, 3), (0, 1, 3), (1, 2, 3)]
    total = 0.0
    for cut in cuts:
        a, b, c = (placed[elements[:, k]] for k in cut)
        doubled = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
        total += np.sum(doubled * (a + b + c)[:, 2]) / 6
    return float(total if elements.shape[1] == 3 else total / 2)
