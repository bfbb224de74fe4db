"""The discrete model of a device: which nodes are held, moved and tied, and which pressures act on which faces."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Protocol

import numpy as np

from limo.geometry.valve import ValveEllipse
from limo.mechanics.contact import contact_of
from limo.mechanics.model import KPA, Equation, Expansion, Fabric, Loading, Model, Pressure, Weave, expand, layer_thickness
from limo.mesh.layers import FACES, LAYERS, DeviceMesh
from limo.schema.device import Device, Sheet
from limo.schema.device import Weave as Yarns
from limo.schema.element import element
from limo.schema.numerics import Mesh, Numerics

#: heights of the perturbed flat states of branches, over the thickness of the fabric
PERTURBATION = 0.05


#: kPa under which layers pass each other by the share of the thickness that is stated
CONTACT_PRESSURE = 100.0
#: thicknesses between points of two layers beyond which they do not touch
CONTACT_SPAN = 6.0


class Described(Protocol):
    """What a model of a device is made of besides a mesh (``limo.cases.case.Case`` is such a description). Pressures in kPa."""

    device: Device
    ventricular_pressure: float
    actuation_pressure_max: float
    aspect_ratio: float
    stiffness_ratio: float
    mesh: Mesh
    numerics: Numerics
    frames: tuple[float, ...]
    branch: int

    @property
    def case_id(self) -> str:
        """Its name."""


def pressures(mesh: DeviceMesh, *, like_shells: bool) -> tuple[Pressure, ...]:
    """Wall P_v, endocardium P_v - P_a, epicardium P_a, all pushing away from the fluid (paper, boundary conditions).

    On the front the fluid is below (bottom side), on the back above. CalculiX puts the pressure of a shell on its bottom
    side whatever its sign: ``like_shells`` does the same on the back, which costs the exact mirror symmetry of the two.
    """
    weights = {"wall": (1.0, 0.0), "endo": (1.0, -1.0), "epi": (0.0, 1.0)}
    loads = []
    for face in FACES:
        for layer in LAYERS:
            name = f"{layer}_{face}"
            if name not in mesh.surfaces:
                continue
            ventricular, actuation = weights[layer]
            side, sign = "bottom", 1.0
            if face == "back":
                side, sign = ("bottom", -1.0) if like_shells else ("top", 1.0)
            loads.append(Pressure(name, mesh.surfaces[name], side, sign * ventricular, sign * actuation))
    return tuple(loads)


def valve_displacements(aspect_ratio: float, mesh: DeviceMesh) -> dict[int, np.ndarray]:
    """Displacements (3,) in mm that move each valve node onto the ellipse, its arc length along the edge kept.

    Front nodes go to z > 0, back nodes to z < 0, nodes shared by both to z = 0; v = 0 (paper, Eqs. valve).
    """
    nodes = np.flatnonzero(mesh.on_valve)
    if not len(nodes):
        return {}
    x = mesh.nodes[nodes, 0]
    half_width = np.abs(x).max()
    ellipse = ValveEllipse.from_perimeter(half_width, aspect_ratio)
    placed = ellipse.place(np.abs(x))
    back = np.zeros(len(mesh.nodes), bool)
    back[mesh.quads[mesh.face == 1]] = True
    side = np.where(back[nodes] & ~mesh.on_outer[nodes], -1.0, 1.0)
    z = np.where(mesh.on_outer[nodes], 0.0, placed[:, 1] * side)
    return {int(n): np.array([np.sign(xi) * p[0] - xi, 0.0, zi]) for n, xi, p, zi in zip(nodes, x, placed, z, strict=True)}


def perturbed(mesh: DeviceMesh, seed: int, amplitude: float) -> DeviceMesh:
    """The mesh with random heights (standard deviation ``amplitude`` in mm), but on the outer and the valve edge."""
    heights = np.random.default_rng(seed).normal(0.0, amplitude, len(mesh.nodes))
    nodes = mesh.nodes.copy()
    nodes[:, 2] += np.where(mesh.on_outer | mesh.on_valve, 0.0, heights)
    return replace(mesh, nodes=nodes)


def described(case: Described) -> dict[str, Any]:
    """The values of a ``Model`` that do not depend on its mesh."""
    material = case.device.material
    fabric = _fabric(material, case.stiffness_ratio)
    if material.pouch_sheet is not None:
        fabric = replace(fabric, epicardium=_fabric(material.pouch_sheet, 1.0))
    return {
        "name": case.case_id,
        "element": element(case.mesh.element),
        "fabric": fabric,
        "loading": Loading(
            case.ventricular_pressure,
            case.actuation_pressure_max,
            case.frames,
            tuple(getattr(case, "cycle", ())),
            tuple(getattr(case, "syringe", ())),
        ),
        "numerics": case.numerics,
        "length": case.device.pattern.length,
    }


def _fabric(sheet: Sheet, stiffness_ratio: float) -> Fabric:
    """A sheet of fabric as it is solved; yarns of equal moduli that are an isotropic fabric's are one."""
    modulus, ratio, weave = sheet.youngs_modulus, sheet.poisson_ratio, sheet.weave
    if weave is not None and _is_isotropic(weave):
        modulus, ratio, weave = weave.warp_modulus, weave.poisson_ratio, None
    yarns = None if weave is None else Weave(**weave.model_dump())
    return Fabric(modulus, ratio, sheet.thickness, sheet.areal_density, stiffness_ratio, yarns, sheet.bending_factor)


def _is_isotropic(weave: Yarns) -> bool:
    shear = weave.warp_modulus / (2 * (1 + weave.poisson_ratio))
    return weave.warp_modulus == weave.weft_modulus and abs(weave.shear_modulus - shear) <= 1e-12 * shear


def build_model(case: Described, mesh: DeviceMesh, *, like_shells: bool | None = None) -> Model:
    """Constraints and loads of a case on a mesh.

    ``like_shells`` (default: whether the element is a shell) puts pressures where CalculiX puts those of shells.

    Bricks: x = 0: u_x = 0 on all nodes; z = 0 at the outer edge: u_z = 0 on middle nodes, and u_x, u_y equal and u_z
    opposite on bottom and top. Valve: middle nodes prescribed at corners, bottom + top - 2 reference = 0 at mid-sides,
    so that the edge may rotate. Shells: the nodes of the mesh are prescribed.
    """
    values, thickness = described(case), case.device.material.thickness
    shell = values["element"].is_shell
    if case.branch:
        mesh = perturbed(mesh, case.branch, PERTURBATION * thickness)
    values |= {"mesh": mesh, "expansion": expand(mesh, layer_thickness(mesh, values["fabric"]))}
    touch = case.numerics.contact
    values["contact"] = contact_of(
        mesh,
        front_back=touch.front_back,
        endo_epi=touch.endo_epi,
        penalty=KPA * CONTACT_PRESSURE / (touch.penetration * thickness),
        reach=touch.penetration * thickness,
        span=CONTACT_SPAN * thickness,
    )
    values["pressures"] = pressures(mesh, like_shells=shell if like_shells is None else like_shells)
    displacements = valve_displacements(case.aspect_ratio, mesh)
    if shell:
        prescribed = {(n, d): float(u[d]) for n, u in displacements.items() for d in range(3)}
        nodes = {"nodes": mesh.nodes, "reference_start": len(mesh.nodes)}
        return Model(**values, **nodes, prescribed=prescribed, fixed=(), equations=())
    return Model(**values, **_constraints(mesh, values["expansion"], displacements))


def _held_in_place(mesh: DeviceMesh) -> list[tuple[int, int]]:
    """Nodes and directions of the outer edge that hold a closed device as a rigid body, beside its planes of symmetry.

    Its ends on the axis and its widest point: six directions of a full device.
    """
    if mesh.on_valve.any():
        return []
    edge = np.flatnonzero(mesh.on_outer & mesh.is_corner)
    x, y, _ = mesh.nodes[edge].T
    low, high, side = (int(edge[k]) for k in (np.lexsort((np.abs(x), y))[0], np.lexsort((np.abs(x), -y))[0], x.argmax()))
    held = {"quarter": [(low, 1)], "front_back": [(low, 1), (low, 0), (high, 0)]}
    return held.get(mesh.symmetry, [(low, 0), (low, 1), (low, 2), (high, 0), (high, 2), (side, 2)])


def _constraints(mesh: DeviceMesh, expansion: Expansion, displacements: dict[int, np.ndarray]) -> dict[str, Any]:
    """Nodes of a model of bricks, those of reference included, and how they are held, moved and tied."""
    bottom, middle, top = expansion.bottom, expansion.middle, expansion.top
    prescribed, fixed, equations, references = {}, [], [], []
    for node, u in displacements.items():
        if middle[node] >= 0:
            prescribed |= {(int(middle[node]), d): float(u[d]) for d in range(3)}
            continue
        reference = len(expansion.nodes) + len(references)
        references.append(mesh.nodes[node])
        prescribed |= {(reference, d): float(u[d]) for d in range(3)}
        equations += [Equation(((int(bottom[node]), d, 1.0), (int(top[node]), d, 1.0), (reference, d, -2.0))) for d in range(3)]
    taken = set(prescribed)
    for node in np.flatnonzero(mesh.on_axis):
        triple = (bottom[node], middle[node], top[node])
        fixed += [(int(n), 0) for n in triple if n >= 0 and (int(n), 0) not in taken]
    fixed += [(int(middle[node]), d) for node, d in _held_in_place(mesh)]
    taken |= set(fixed)
    if mesh.symmetry != "full":
        for node in np.flatnonzero(mesh.on_outer):
            low, mid, high = int(bottom[node]), int(middle[node]), int(top[node])
            if mid >= 0 and (mid, 2) not in taken:
                fixed.append((mid, 2))
            signs = (-1.0, -1.0, 1.0)
            equations += [Equation(((low, d, 1.0), (high, d, signs[d]))) for d in range(3) if (low, d) not in taken]
    return {
        "nodes": np.vstack([expansion.nodes, *references]) if references else expansion.nodes,
        "reference_start": len(expansion.nodes),
        "prescribed": prescribed,
        "fixed": tuple(fixed),
        "equations": tuple(equations),
    }
