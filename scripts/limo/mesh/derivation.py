"""The flat pattern behind a published mesh, derived anew: candidates are meshed as its authors mesh, and elements counted.

The authors publish the connectivity of their mesh of N_p = 8 without coordinates. Their public geometries of other devices are
straight lines and Bezier curves, meshed by plain gmsh with one characteristic length and recombined. So the number of elements on
every curve and in every patch of the published mesh is a measurement of lengths and areas: a curve with n elements is between
(n - 2) and n characteristic lengths long, since gmsh recombines with even numbers only.

``derive`` walks through all patterns whose lengths and areas agree, from several starts, and meshes what it meets. The patterns
that fit are the remaining freedom; the pattern in their middle is the result.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
import shapely

from limo.errors import LimoError
from limo.mesh.flat import gmsh_model
from limo.store.files import write_whole

#: characteristic length over the device's length: 40 elements on the valve edge, 0.7932 L, leave 0.0198 to 0.0209
SIZE = 0.02
#: quarter perimeter of the valve over the device's length (paper, *Computation of the initial configuration*)
HALF_WIDTH = 0.3966
#: elements of the published mesh on the curves of a face's right half; those of the valve and the apex edge are whole
CURVES = {
    "valve_edge": 40,
    "outline_low": 16,
    "outline_side": 18,
    "outline_top": 22,
    "apex_edge": 20,
    "array_low0": 2,
    "array_low1": 4,
    "array_low2": 20,
    "array_side": 18,
    "array_top2": 20,
    "array_top1": 6,
    "array_top0": 4,
    "central_seam": 44,
    "off_centre_seam": 50,
}
#: elements of the published mesh in the patches of a face; pouches have them in both layers
PATCHES = {"background": 894, "inner_pouch": 499, "outer_pouch": 373}
#: a curve of n elements is n - WINDOW to n characteristic lengths long: gmsh takes the next even number
WINDOW = 1.99
#: nodes and elements of the published mesh
NODES, ELEMENTS = 25509, 8764
#: how far the count of a patch may be from the published one: corners that move by 0.001 L change it by up to 1 %
NOISE = 0.01
#: elements of a patch in such meshes over its area in squares of the characteristic length: a first guess that guides a walk, and
#: as a matrix of patches by measures
_DENSITIES = (1.342, 1.238, 1.312)
FIRST_GUESS = np.hstack([np.zeros((3, 1)), np.diag(_DENSITIES), np.zeros((3, 14))])
#: what a walk starts and stays within: coordinates over L, first those of the outline, then of the array, last of the seam
RANGES = {
    "outline_x1": (0.37, 0.53),
    "outline_y1": (0.20, 0.36),
    "outline_x2": (0.36, 0.56),
    "outline_y2": (0.52, 0.74),
    "outline_x3": (0.16, 0.22),
    "array_y0": (0.04, 0.18),
    "array_x1": (0.005, 0.045),
    "array_y1": (0.04, 0.20),
    "array_x2": (0.03, 0.14),
    "array_y2": (0.04, 0.24),
    "array_x3": (0.32, 0.48),
    "array_y3": (0.18, 0.42),
    "array_x4": (0.32, 0.50),
    "array_y4": (0.52, 0.74),
    "array_x5": (0.10, 0.24),
    "array_y5": (0.90, 0.98),
    "seam_x_top": (0.03, 0.09),
    "seam_x_control": (0.15, 0.70),
    "seam_y_control": (0.25, 0.75),
}
#: least distance of the array from the outline, and of the array's corners from one another in height, over L
MARGIN = 0.01
#: length of a walk's steps, over L, steps between two patterns that are meshed, steps before the first, and the first temperature
STEP, THINNING, COOLING, HOT = 0.012, 60, 6000, 100.0
#: meshes after which a walk learns what counts follow from
LEARNING = 50


@dataclass(frozen=True)
class Candidate:
    """A pattern of N_p = 8: ``values`` (19,) are the coordinates of ``RANGES`` over L."""

    values: np.ndarray

    def __getitem__(self, name: str) -> float:
        return float(self.values[list(RANGES).index(name)])

    @property
    def outline(self) -> np.ndarray:
        """Corners (5, 2) from the valve edge to the apex."""
        corners = [[self[f"outline_{c}{k}"] for c in "xy"] for k in (1, 2)]
        return np.array([[HALF_WIDTH, 0.0], *corners, [self["outline_x3"], 1.0], [0.0, 1.0]])

    @property
    def array(self) -> np.ndarray:
        """Corners (8, 2) of the pouch array from the axis below to the axis above, the seam's end among them."""
        corners = [[self[f"array_{c}{k}"] for c in "xy"] for k in range(1, 6)]
        top = self["array_y5"]
        return np.array([[0.0, self["array_y0"]], *corners, [self["seam_x_top"], top], [0.0, top]])

    @property
    def seam(self) -> np.ndarray:
        """Start, control point and end (3, 2) of the off-centre seam, a quadratic Bezier curve from above to below."""
        return np.array([self.array[6], [self["seam_x_control"], self["seam_y_control"]], self.array[1]])

    def seam_points(self, count: int = 60) -> np.ndarray:
        """Points (count, 2) of the seam at equal steps of its parameter, from below to above."""
        t = np.linspace(1.0, 0.0, count)[:, None]
        start, control, end = self.seam
        return (1 - t) ** 2 * start + 2 * t * (1 - t) * control + t**2 * end

    def lengths(self) -> np.ndarray:
        """Lengths (14,) of the curves of ``CURVES`` over L."""
        outline, array = (np.linalg.norm(np.diff(points, axis=0), axis=1) for points in (self.outline, self.array))
        seam = np.linalg.norm(np.diff(self.seam_points(), axis=0), axis=1).sum()
        return np.array([2 * HALF_WIDTH, *outline[:3], 2 * outline[3], *array, self["array_y5"] - self["array_y0"], seam])

    def areas(self) -> np.ndarray:
        """Areas (3,) of the patches of ``PATCHES`` over L^2: the whole background, one pouch each."""
        face = shapely.Polygon([[0.0, 0.0], *self.outline])
        array, seam = self.array, self.seam_points()
        inner = shapely.Polygon([array[0], *seam, array[7]])
        outer = shapely.Polygon([*array[1:7], *seam[::-1][1:-1]])
        return np.array([2 * (face.area - inner.area - outer.area), inner.area, outer.area])

    def is_sound(self) -> bool:
        """Whether it lies in ``RANGES`` and can be cut: curves that do not cross, the array inside of the outline."""
        low, high = np.array(list(RANGES.values())).T
        if (self.values < low).any() or (self.values > high).any():
            return False
        array, seam = shapely.Polygon(self.array), shapely.LineString(self.seam_points()[1:-1])
        face = shapely.Polygon([[0.0, 0.0], *self.outline])
        if not (face.is_valid and array.is_valid and np.diff(self.array[1:6, 1]).min() > -MARGIN and array.contains(seam)):
            return False
        return face.contains(array) and shapely.LineString(self.outline).distance(array) >= MARGIN

    def measures(self) -> np.ndarray:
        """What counts follow from: one, areas and lengths (18,) in characteristic lengths."""
        return np.concatenate([[1.0], self.areas() / SIZE**2, self.lengths() / SIZE])

    def misfit(self, surrogate: np.ndarray = FIRST_GUESS) -> float:
        """How far the counts that are expected of it are from the published ones; zero where none differs.

        100 for each characteristic length beyond the window of a curve. For a patch half a square of the relative difference over
        ``NOISE``; the expected counts are ``surrogate`` (3, 18) times the measures.
        """
        counts, measures = np.array(list(CURVES.values())), self.measures()
        units = measures[4:]
        outside = np.maximum(units - counts, 0.0) + np.maximum(counts - WINDOW - units, 0.0)
        off = surrogate @ measures / np.array(list(PATCHES.values())) - 1
        return float(100 * outside.sum() + 0.5 * ((off / NOISE) ** 2).sum())

    def rounded(self, digits: int = 3) -> Candidate:
        """The same with fewer digits."""
        return Candidate(np.round(self.values, digits))


def published_nodes(curves: Mapping[str, int] = CURVES, patches: Mapping[str, int] = PATCHES) -> int:
    """Nodes of the whole mesh of 8-node elements that such counts make, by Euler's formula.

    A patch of F elements with B edges on its border and h holes has E = (4 F + B) / 2 edges and V = E - F + 1 - h corners. Both
    layers of a pouch share its border, front and back the outer edge, but not the valve edge.
    """
    outer = curves["valve_edge"] + curves["apex_edge"] + 2 * sum(n for name, n in curves.items() if name.startswith("outline"))
    array = {name: n for name, n in curves.items() if name.startswith("array")}
    border = 2 * sum(array.values())
    inner = curves["central_seam"] + curves["off_centre_seam"] + array["array_low0"] + array["array_top0"]
    side = curves["off_centre_seam"] + border // 2 - array["array_low0"] - array["array_top0"]

    def inside(elements: int, edges: int, holes: int = 0) -> int:
        total = (4 * elements + edges) // 2
        return total - elements + 1 - holes + total - 2 * edges

    pouches = 2 * (inside(patches["inner_pouch"], inner) + inside(patches["outer_pouch"], side))
    face = inside(patches["background"], outer + border, 1) + 2 * pouches
    seams = 2 * border + 2 * curves["central_seam"] - 1 + 2 * (2 * curves["off_centre_seam"] - 1)
    valve = 2 * curves["valve_edge"] - 1
    return 2 * (face + seams + valve) + 2 * outer - valve


def count_elements(candidate: Candidate, size: float = SIZE) -> dict[str, int]:
    """Elements on the curves and in the patches of a candidate, meshed by gmsh as the authors mesh.

    All patches are plane surfaces, recombined with gmsh's defaults; ``size`` is the characteristic length at every point. Raises
    ``MeshError`` where gmsh fails.
    """
    with gmsh_model("a candidate", {}) as model:
        return _counted(model, candidate, size)


def _counted(model, candidate: Candidate, size: float) -> dict[str, int]:
    """Curves and patches of the whole face, its mesh, and the counts; ``model`` is gmsh's."""
    geo, points = model.geo, {}

    def point(place: Sequence[float]) -> int:
        key = tuple(np.round(place, 9).tolist())
        if key not in points:
            points[key] = geo.addPoint(*key, 0.0, size)
        return points[key]

    def chain(corners: np.ndarray) -> list[int]:
        return [geo.addLine(point(a), point(b)) for a, b in pairwise(corners)]

    def bezier(corners: np.ndarray) -> int:
        return geo.addBezier([point(corners[0]), geo.addPoint(*corners[1], 0.0, size), point(corners[2])])

    mirror = np.array([-1.0, 1.0])
    right = candidate.outline[:4]
    outline = chain(np.vstack([right[:1] * mirror, right, (right * mirror)[::-1]]))
    array, array_left = chain(candidate.array), chain((candidate.array * mirror)[::-1])
    central, seam = geo.addLine(point(candidate.array[7]), point(candidate.array[0])), bezier(candidate.seam)
    bezier(candidate.seam * mirror)
    loops = {
        "background": [geo.addCurveLoop(outline), geo.addCurveLoop([*array, *array_left])],
        "inner_pouch": [geo.addCurveLoop([array[0], -seam, array[6], central])],
        "outer_pouch": [geo.addCurveLoop([*array[1:6], seam])],
    }
    patches = {name: geo.addPlaneSurface(loop) for name, loop in loops.items()}
    geo.synchronize()
    for patch in patches.values():
        model.mesh.setRecombine(2, patch)
    model.mesh.generate(2)
    curves = dict(zip(CURVES, [*outline[:5], *array, central, seam], strict=True))
    tags = {name: (1, tag) for name, tag in curves.items()} | {name: (2, tag) for name, tag in patches.items()}
    return {name: sum(map(len, model.mesh.getElements(*tag)[1])) for name, tag in tags.items()}


def fits(counts: Mapping[str, int], noise: float = NOISE) -> bool:
    """Whether all curves have the published counts, and the patches within ``noise`` of theirs."""
    return all(counts[c] == n for c, n in CURVES.items()) and all(abs(counts[p] / n - 1) <= noise for p, n in PATCHES.items())


def walk(start: int, meshes: int) -> Iterator[tuple[Candidate, dict[str, int]]]:
    """Patterns that should have the published counts, each with what its mesh counts, from a random start of seed ``start``.

    Metropolis's walk with the density exp(-misfit / temperature) over the sound patterns cools to a temperature of 1. Then every
    ``THINNING``-th pattern is meshed. After each ``LEARNING`` meshes the expected counts become those of a linear fit to all.
    """
    random = np.random.default_rng(start)
    low, high = np.array(list(RANGES.values())).T
    here = Candidate(random.uniform(low, high))
    while not here.is_sound():
        here = Candidate(random.uniform(low, high))
    surrogate, misfit = FIRST_GUESS, here.misfit()
    measures, counted = [], []
    for step in range(COOLING + THINNING * meshes):
        temperature = max(1.0, HOT ** (1.0 - 1.3 * step / COOLING))
        chosen = random.random(len(low)) < random.choice([1.5, 4.0, 19.0]) / len(low)
        there = Candidate(here.values + np.where(chosen, random.normal(0.0, STEP, len(low)), 0.0))
        if there.is_sound():
            other = there.misfit(surrogate)
            if other < misfit or random.random() < np.exp((misfit - other) / temperature):
                here, misfit = there, other
        if step >= COOLING and (step - COOLING) % THINNING == 0:
            counts = count_elements(here)
            measures.append(here.measures())
            counted.append([counts[patch] for patch in PATCHES])
            yield here, counts
            if len(measures) % LEARNING == 0:
                surrogate = np.linalg.lstsq(np.array(measures), np.array(counted, float))[0].T
                misfit = here.misfit(surrogate)


@dataclass(frozen=True)
class Derivation:
    """What came out: the ``result``, what its mesh ``counts``, the ``values`` (n, 19) of all patterns that fit, and their counts.

    ``starts`` (n,) says which start each is from; ``meshed`` counts the patterns that were meshed.
    """

    result: Candidate
    counts: dict[str, int]
    values: np.ndarray
    all_counts: pd.DataFrame
    starts: np.ndarray
    meshed: int


def derive(starts: int = 8, meshes: int = 200) -> Derivation:
    """Walk from ``starts`` seeds and mesh ``meshes`` patterns of each; the result is the best near the middle of those that fit.

    Raises ``LimoError`` where none fits.
    """
    kept: list[np.ndarray] = []
    rows, origins, meshed = [], [], 0
    for start in range(starts):
        for candidate, counts in walk(start, meshes):
            meshed += 1
            if fits(counts):
                kept.append(candidate.values)
                rows.append(counts)
                origins.append(start)
    if not kept:
        raise LimoError(f"no candidate of {meshed} has the published counts; more starts or meshes may find one")
    values = np.array(kept)
    result, counts = _middle(values, meshes)
    return Derivation(result, counts, values, pd.DataFrame(rows), np.array(origins), meshed)


def _middle(values: np.ndarray, meshes: int) -> tuple[Candidate, dict[str, int]]:
    """Of patterns around the middle of those that fit the one whose rounded coordinates have the counts nearest to the published.

    Raises ``LimoError`` where none of them fits.
    """
    random, spread = np.random.default_rng(0), values.std(axis=0)
    best, best_counts, least = None, {}, np.inf
    for k in range(meshes):
        there = Candidate(values.mean(axis=0) + (0.25 * random.normal(size=len(spread)) * spread if k else 0.0)).rounded()
        if not there.is_sound():
            continue
        counts = count_elements(there)
        off = max(abs(counts[p] / n - 1) for p, n in PATCHES.items()) + sum(counts[c] != n for c, n in CURVES.items())
        if off < least:
            best, best_counts, least = there, counts, off
    if best is None or least >= NOISE:
        raise LimoError(f"no pattern near the middle of the {len(values)} that fit has the published counts")
    return best, best_counts


def table_of(found: Derivation) -> pd.DataFrame:
    """What is kept of a derivation, a row a coordinate (over L), a count, and a number of the run.

    ``low`` and ``high`` are the 5th and 95th percentile of a coordinate over all patterns that fit, and the extremes of a count.
    """
    spread = np.percentile(found.values, [5, 95], axis=0)
    rows = [
        {"kind": "coordinate", "name": name, "value": found.result[name], "low": low, "high": high}
        for name, low, high in zip(RANGES, *spread, strict=True)
    ]
    for kind, published in (("curve", CURVES), ("patch", PATCHES)):
        for name, count in published.items():
            each = found.all_counts[name]
            ends = {"low": each.min(), "high": each.max(), "published": count}
            rows.append({"kind": kind, "name": name, "value": found.counts[name], **ends})
    run = {"starts": len(set(found.starts)), "meshed": found.meshed, "fit": len(found.values)}
    run["nodes"] = published_nodes({c: found.counts[c] for c in CURVES}, found.counts)
    rows += [{"kind": "run", "name": name, "value": value} for name, value in run.items()]
    rows[-1]["published"] = NODES
    return pd.DataFrame(rows, columns=["kind", "name", "value", "low", "high", "published"])


def write_derivation(file: Path, starts: int, meshes: int) -> str:
    """Derive the outline, keep its table, and return what to print: the result, how far its counts are off, and the freedom."""
    found = derive(starts, meshes)
    table = table_of(found)
    write_whole(file, lambda path: table.to_csv(path, index=False, float_format="%.5g"))
    shown = table.assign(off=table.value - table.published).drop(columns="published")
    return shown.to_string(index=False, float_format=lambda value: f"{value:.3f}".rstrip("0").rstrip("."), na_rep="")
