"""Principal strains of the device's two surfaces and the lines along the largest (paper, *Principal strain fields*).

The endocardial surface is the inner side of wall and endocardium, the epicardial surface the outer side of wall and
epicardium. Strains are Green-Lagrange and refer to the flat state, whose plane is the fabric's: there a direction is an
angle, and the streamlines of v_1 are lines in a plane that deform with the device. They are followed here, because VTK's
hyperstreamlines are tubes, one a call.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from limo.mechanics.constitutive import warp_and_weft
from limo.mechanics.layer import flat_areas, nodal
from limo.mesh.elements import QUAD8_TRIANGLES
from limo.mesh.layers import LAYERS, DeviceMesh

#: the device's surfaces and the layers they consist of
DEVICE_SIDES = {"endocardial": ("wall", "endo"), "epicardial": ("wall", "epi")}
_KEPT = 4  # of so many points of a streamline one is kept
_SURFACE = {"endocardial": 0, "epicardial": 2}  # inner and outer


def on_side(mesh: DeviceMesh, side: str) -> np.ndarray:
    """Elements (k,) of the endocardial or epicardial surface."""
    return np.flatnonzero(np.isin(mesh.layer, [LAYERS.index(n) for n in DEVICE_SIDES[side]]))


def side_values(mesh: DeviceMesh, values: np.ndarray, side: str) -> np.ndarray:
    """Values (m, 3, 4, ...) on inner, middle and outer surfaces -> those on a surface of the device (k, 4, ...)."""
    return values[on_side(mesh, side), _SURFACE[side]]


def membrane_principal(strain: np.ndarray) -> np.ndarray:
    """Largest principal strain (...,) within the fabric's plane, of strains (..., 3, 3).

    An isotropic layer without pressure across has its largest strain in its plane, unless both strains there are negative. Then
    nothing is stretched.
    """
    xx, yy, xy = strain[..., 0, 0], strain[..., 1, 1], 0.5 * (strain[..., 0, 1] + strain[..., 1, 0])
    return 0.5 * (xx + yy) + np.hypot(0.5 * (xx - yy), xy)


def inplane_angle(strain: np.ndarray) -> np.ndarray:
    """Angle (...,) of v_1 within the fabric's plane to the x axis, in degrees from -90 to 90.

    0 is around the device (circumferential), 90 along it (from valve to apex).
    """
    xx, yy, xy = strain[..., 0, 0], strain[..., 1, 1], 0.5 * (strain[..., 0, 1] + strain[..., 1, 0])
    return np.degrees(0.5 * np.arctan2(2 * xy, xx - yy))


def angle_between(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Angle (...,) in degrees, 0 to 90, between lines at the angles ``first`` and ``second`` in degrees."""
    turned = np.abs(np.mod(first - second, 180.0))
    return np.minimum(turned, 180.0 - turned)


def facing_pairs(mesh: DeviceMesh) -> tuple[np.ndarray, np.ndarray]:
    """Elements (p,) of the endocardium and those of the epicardium that cover them in the flat state."""
    centre = np.round(mesh.nodes[mesh.quads[:, :4], :2].mean(axis=1), 6)
    sorted_by = {}
    for name in ("endo", "epi"):
        elements = np.flatnonzero(mesh.layer == LAYERS.index(name))
        order = np.lexsort((centre[elements, 1], centre[elements, 0], mesh.face[elements]))
        sorted_by[name] = elements[order]
    return sorted_by["endo"], sorted_by["epi"]


@dataclass(frozen=True)
class DirectionSummary:
    """Where v_1 points on the pouches: area shares and medians, angles in degrees.

    ``around``: share of the area where v_1 is within 45 degrees of the circumferential direction, by side;
    ``angle``: area median of the angle to it; ``between``: area median of the angle between v_1 of the endocardial and of
    the epicardial surface at the same place of the flat pattern; ``between_at_seams``: the same near seams only.
    """

    around: dict[str, float]
    angle: dict[str, float]
    between: float
    between_at_seams: float


def directions(mesh: DeviceMesh, strain: np.ndarray, near_seam: np.ndarray) -> DirectionSummary:
    """Sum up v_1 on the pouches from strains (m, 3, 4, 3, 3) on inner, middle and outer surfaces.

    ``near_seam`` (m, 4) marks the points that count as near a seam.
    """
    endo, epi = facing_pairs(mesh)
    angle = {"endocardial": inplane_angle(strain[endo, 0]), "epicardial": inplane_angle(strain[epi, 2])}
    weight, seam = flat_areas(mesh)[endo], near_seam[endo]
    between = angle_between(angle["endocardial"], angle["epicardial"])
    away = {side: angle_between(a, np.zeros_like(a)) for side, a in angle.items()}
    return DirectionSummary(
        around={s: float(weight[a < 45].sum() / weight.sum()) for s, a in away.items()},
        angle={s: _median(a, weight) for s, a in away.items()},
        between=_median(between, weight),
        between_at_seams=_median(between[seam], weight[seam]),
    )


def angle_to_warp(mesh: DeviceMesh, strain: np.ndarray, warp: np.ndarray, side: str) -> float:
    """Area median over a surface of the device of the angle between v_1 and the warp, in degrees; NaN without yarns.

    Strains (m, 3, 4, 3, 3) on inner, middle and outer surfaces; ``warp`` (m,): angle of the warp to the axis of the device in
    degrees, NaN on fabric without yarns.
    """
    elements = on_side(mesh, side)
    elements = elements[np.isfinite(warp[elements])]
    angle = inplane_angle(strain[elements, _SURFACE[side]])
    return _median(angle_between(angle, 90.0 - warp[elements][:, None]), flat_areas(mesh)[elements])


def fibre_aligned_share(mesh: DeviceMesh, stress: np.ndarray, warp: np.ndarray) -> float:
    """int (N_1^2 + N_2^2) / int (N_1^2 + N_2^2 + 2 N_12^2) of membrane stress along warp 1 and weft 2; NaN without yarns.

    Second Piola-Kirchhoff stress (m, 4, 3, 3) on the middle surface in the flat device's axes. One where yarns bear all, a half
    where a load runs at 45 degrees to them. ``warp`` (m,) as of ``angle_to_warp``.
    """
    woven = np.isfinite(warp)
    if not woven.any():
        return float("nan")
    axes = np.stack([warp_and_weft(angle)[:2] for angle in warp[woven]])[:, None]  # (w, 1, 2, 3)
    along = axes @ stress[woven] @ np.swapaxes(axes, -1, -2)
    area = flat_areas(mesh)[woven]
    normal = (area * (along[..., 0, 0] ** 2 + along[..., 1, 1] ** 2)).sum()
    return float(normal / (normal + 2 * (area * along[..., 0, 1] ** 2).sum()))


def _median(values: np.ndarray, weights: np.ndarray) -> float:
    if not values.size:
        return float("nan")
    order = np.argsort(values, axis=None)
    share = np.cumsum(weights.ravel()[order]) / weights.sum()
    return float(values.ravel()[order][np.searchsorted(share, 0.5)])


# --------------------------------------------------------------------------------------------------------------------
# streamlines


@dataclass(frozen=True)
class Streamline:
    """A line along v_1: ``flat`` (k, 2) and ``deformed`` (k, 3) in mm, and ``strain`` (k,), E_1 along it."""

    flat: np.ndarray
    deformed: np.ndarray
    strain: np.ndarray


def streamlines(
    mesh: DeviceMesh,
    strain: np.ndarray,
    points: np.ndarray,
    side: str,
    face: int = 0,
    spacing: float = 5.0,
    step: float = 0.5,
    longest: float = 60.0,
) -> list[Streamline]:
    """Lines along v_1 on a surface of one face.

    ``strain`` (m, 3, 4, 3, 3) on inner, middle and outer surfaces; ``points`` (n, 3) deformed positions in mm of the mesh's
    nodes. Lines start on a grid of ``spacing`` mm. They are followed both ways by the midpoint rule in steps of ``step`` mm, up
    to ``longest`` mm. They keep every fourth point and end at the border. The strain, not its direction, is interpolated (linear
    on triangles), so that the meaningless sign of v_1 never matters.
    """
    from matplotlib.tri import LinearTriInterpolator, Triangulation  # takes 0.4 s, and only figures have such lines

    elements = on_side(mesh, side)
    elements = elements[mesh.face[elements] == face]
    values, node, quads = nodal_part(mesh, strain[elements, _SURFACE[side]], elements)
    flat = mesh.nodes[node, :2]
    grid = Triangulation(*flat.T, quads[:, QUAD8_TRIANGLES].reshape(-1, 3))
    finder = grid.get_trifinder()
    fields = [LinearTriInterpolator(grid, c, finder) for c in (values[:, 0, 0], values[:, 1, 1], values[:, 0, 1])]
    places = [LinearTriInterpolator(grid, points[node, k], finder) for k in range(3)]

    def tensor(points_in_plane: np.ndarray) -> np.ndarray:
        xx, yy, xy = (np.ma.filled(f(points_in_plane[:, 0], points_in_plane[:, 1]), np.nan) for f in fields)
        return np.stack([np.stack([xx, xy], -1), np.stack([xy, yy], -1)], -2)

    def direction(points_in_plane: np.ndarray, along: np.ndarray | None) -> np.ndarray:
        angle = np.radians(inplane_angle(tensor(points_in_plane)))
        vector = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        return vector if along is None else vector * np.where((vector * along).sum(axis=1) < 0, -1.0, 1.0)[:, None]

    low, high = flat.min(axis=0), flat.max(axis=0)
    starts = [np.arange(a + spacing / 2, b, spacing) for a, b in zip(low, high, strict=True)]
    seeds = np.stack(np.meshgrid(*starts), axis=-1).reshape(-1, 2)
    seeds = seeds[finder(*seeds.T) >= 0]
    halves = []
    for sign in (1.0, -1.0):
        points_in_plane, along = seeds.copy(), sign * direction(seeds, None)
        path = [points_in_plane]
        for _ in range(int(longest / 2 / step)):
            middle = direction(points_in_plane + 0.5 * step * along, along)
            points_in_plane = points_in_plane + step * middle
            along = direction(points_in_plane, middle)
            path.append(points_in_plane)
        halves.append(np.stack(path, axis=1))
    lines = []
    for back, forth in zip(halves[1], halves[0], strict=True):
        line = np.vstack([back[:0:-1], forth])
        inside = np.isfinite(line).all(axis=1)
        inside[inside] = finder(*line[inside].T) >= 0
        line = line[inside][::_KEPT]
        if len(line) > 2:
            deformed = np.stack([np.ma.filled(p(*line.T), np.nan) for p in places], axis=1)
            lines.append(Streamline(line, deformed, membrane_principal(tensor(line))))
    return lines


def nodal_part(mesh: DeviceMesh, values: np.ndarray, elements: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """``layer.nodal`` for some of the elements (k,), averaged over all layers among them: values, nodes and quads (k, 8)."""
    none = np.zeros(len(elements), int)
    part = replace(mesh, quads=mesh.quads[elements], layer=none, face=mesh.face[elements], pouch=none)
    return nodal(part, values)


def area_of_side(mesh: DeviceMesh, side: str) -> np.ndarray:
    """Flat areas (k, 4) in mm^2 of the points of a surface of the device."""
    return flat_areas(mesh)[on_side(mesh, side)]
