"""Volumes by the divergence theorem: orders of convergence on smooth surfaces, and invariances."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from limo.mechanics.volumes import flux, flux_triangles, volumes
from limo.mesh.elements import QUAD8
from limo.mesh.layers import DeviceMesh

METHODS = pytest.mark.parametrize("method", [flux, flux_triangles], ids=["curved", "triangles"])


def patch(surface, n):
    """n x n curved quadrilaterals with their nodes on surface(u, v), u and v from 0 to 1; returns (points, quads)."""
    cells = np.stack(np.meshgrid(np.arange(n), np.arange(n)), axis=-1).reshape(-1, 1, 2)
    u, v = ((cells + (QUAD8 + 1) / 2) / n).reshape(-1, 2).T
    return np.stack(surface(u, v), axis=1), np.arange(8 * n * n).reshape(-1, 8)


def sphere_octant(u, v, axes=(1.0, 1.0, 1.0)):
    """An eighth of an ellipsoid about a corner of the cube; no poles."""
    x, y = np.tan(u * np.pi / 4), np.tan(v * np.pi / 4)
    r = np.sqrt(1 + x**2 + y**2)
    return axes[0] * x / r, axes[1] * y / r, axes[2] / r


def cylinder_quarter(u, v):
    return 2.0 * np.cos(u * np.pi / 2), 2.0 * np.sin(u * np.pi / 2), 3.0 * v


# surface and its flux 1/3 int x . n dS: a third of an octant of a ball or ellipsoid; r (area) / 3 for the cylinder
SURFACES = {
    "sphere": (sphere_octant, np.pi / 18),
    "ellipsoid": (lambda u, v: sphere_octant(u, v, (2.0, 1.0, 0.5)), None),
    "cylinder": (cylinder_quarter, 2.0 * (np.pi * 3.0) / 3.0),
}


def exact_flux(name):
    surface, value = SURFACES[name]
    return flux(*patch(surface, 64)).sum() if value is None else value


def closed_ellipsoid(n, axes=(2.0, 1.0, 0.5)):
    """All six patches of a closed ellipsoid, normals outwards; neighbours share their edge curves exactly."""
    points, quads = patch(lambda u, v: sphere_octant(2 * u - 1, 2 * v - 1), n)
    # quaternions: none, half a turn about x, quarter turns about y and x either way
    turns = [[0, 0, 0, 1], [1, 0, 0, 0], *([0, s, 0, 1] for s in (1, -1)), *([s, 0, 0, 1] for s in (1, -1))]
    parts = [Rotation.from_quat(t).apply(points) * axes for t in turns]
    return np.vstack(parts), np.vstack([quads + k * len(points) for k in range(6)])


def orders(method, name):
    errors = np.array([abs(method(*patch(SURFACES[name][0], n)).sum() - exact_flux(name)) for n in (2, 4, 8)])
    return np.log2(errors[:-1] / errors[1:])


@pytest.mark.parametrize("name", SURFACES)
def test_curved_quadrilaterals_converge_with_order_four(name):
    assert orders(flux, name).min() > 3.7


@pytest.mark.parametrize("name", SURFACES)
def test_flat_triangles_converge_with_order_two(name):
    np.testing.assert_allclose(orders(flux_triangles, name), 2.0, atol=0.25)


@METHODS
def test_closed_ellipsoid_has_its_volume(method):
    """4/3 pi a b c, to the accuracy of a 12 x 12 mesh a side."""
    assert method(*closed_ellipsoid(12)).sum() == pytest.approx(4 / 3 * np.pi, rel=3e-5 if method is flux else 6e-3)


@METHODS
def test_volume_of_a_closed_surface_does_not_depend_on_where_it_is(method):
    points, quads = closed_ellipsoid(3)
    points = points + 0.05 * np.sin(3 * points[:, [1, 2, 0]])  # no symmetry left
    volume = method(points, quads).sum()
    turned = Rotation.random(random_state=5).apply(points)
    assert method(turned, quads).sum() == pytest.approx(volume, rel=1e-12)
    assert method(np.add(points, [3.0, -7.0, 11.0]), quads).sum() == pytest.approx(volume, rel=1e-9)
    assert method(points * [-1, 1, 1], quads).sum() == pytest.approx(-volume, rel=1e-12), "a mirror image is inside out"
    assert method(2 * points, quads).sum() == pytest.approx(8 * volume, rel=1e-12)


@METHODS
def test_order_of_elements_and_their_first_node_do_not_matter(method):
    points, quads = patch(sphere_octant, 4)
    value = method(points, quads)
    shuffled = np.random.default_rng(6).permutation(len(quads))
    np.testing.assert_allclose(method(points, quads[shuffled]), value[shuffled], rtol=1e-13)
    turned = quads[:, [1, 2, 3, 0, 5, 6, 7, 4]]
    assert method(points, turned).sum() == pytest.approx(value.sum(), rel=1e-13 if method is flux else 1e-3)


@METHODS
def test_plane_has_the_flux_of_a_cone_and_none_through_the_origin(method):
    """Area times distance over three, whatever the elements' shape in the plane."""
    points, quads = patch(lambda u, v: (u + 0.2 * v**2, v + 0.1 * np.sin(3 * u), 0 * u), 4)
    area = 3.0 * method(np.add(points, [0, 0, 1.0]), quads).sum()
    assert method(points, quads).sum() == pytest.approx(0.0, abs=1e-14)
    assert method(np.add(points, [5.0, -2.0, 0.6]), quads).sum() == pytest.approx(0.6 * area / 3)


# --------------------------------------------------------------------------------------------------------------------
# a device


def lens(height_endo, height_epi, n=12):
    """A quarter model of a round pouch of radius 1 between two paraboloids, on no wall; half of it at x >= 0."""

    def cap(height):
        return patch(lambda u, v: (u * np.sin(v * np.pi), 3.0 - u * np.cos(v * np.pi), height * (1 - u**2)), n)

    (endo, quads), (epi, _) = cap(height_endo), cap(height_epi)
    nodes, quads, layer = np.vstack([endo, epi]), np.vstack([quads, quads + len(endo)]), np.repeat([1, 2], len(quads))
    nowhere = np.zeros(len(nodes), bool)
    mesh = DeviceMesh(nodes, quads, layer, 0 * layer, 0 * layer, nowhere, nowhere, nowhere, nowhere, "quarter")
    return mesh, mesh.nodes


def test_pouch_between_two_paraboloids_has_its_volume():
    """pi R^2 (h_epi - h_endo) / 2 a pouch, of which the full device has two; the endocardium bounds the ventricle."""
    ventricle, actuation = volumes(*lens(-0.25, 0.5))
    assert actuation == pytest.approx(2 * np.pi * 0.75 / 2, rel=1e-5)
    assert ventricle == pytest.approx(-2 * np.pi * 0.25 / 2, rel=1e-5)


def inflated(mesh):
    """Middle surface of a symmetric inflated state: even in x, opposite in z on the two faces, pouches apart off the seams."""
    x, y = mesh.nodes[:, 0] / 60, mesh.nodes[:, 1] / 140
    face = np.ones(len(x))
    face[mesh.quads[mesh.face == 1]] = -1
    face[mesh.on_outer] = 0
    epi = np.zeros(len(x))
    epi[mesh.quads[mesh.layer == 2]] = 1
    epi[mesh.on_seam] = 0
    return mesh.nodes + np.column_stack([-3 * x * y, -2 * y * x**2, face * (30 * (1.2 - x**2) + 4 * epi * (1 + y))])


@METHODS
def test_models_of_every_symmetry_give_the_volumes_of_the_full_device(device_mesh, method):
    meshes = [device_mesh("limo", 8, s) for s in ("full", "front_back", "quarter")]
    full, half, quarter = (volumes(m, inflated(m), method) for m in meshes)
    # triangles halve quadrilaterals along a diagonal, which a mirror image turns
    accuracy = 1e-12 if method is flux else 1e-3
    assert half == pytest.approx(full, rel=accuracy)
    assert quarter == pytest.approx(full, rel=accuracy)
    assert min(full) > 1e4


def test_flat_device_is_empty(device_mesh):
    mesh = device_mesh("limo", 8, "full")
    np.testing.assert_allclose(volumes(mesh, mesh.nodes), 0.0, atol=1e-9)


def test_pouches_grow_outwards_on_both_faces(device_mesh, quad_areas):
    """Every epicardium lifted by h off its face adds the flux of a plane, area times h over three, to V_a and nothing to V_v."""
    mesh = device_mesh("limo", 8, "full")
    single = replace(mesh, nodes=mesh.nodes[mesh.quads].reshape(-1, 3), quads=np.arange(mesh.quads.size).reshape(-1, 8))
    lift = np.where(mesh.face == 0, 1.0, -1.0) * (mesh.layer == 2)
    points = single.nodes + np.outer(np.repeat(lift, 8), [0, 0, 0.3])
    area = quad_areas(mesh.nodes, mesh.quads)[mesh.layer == 2].sum()
    ventricle, actuation = volumes(single, points)
    assert ventricle == pytest.approx(0.0, abs=1e-9)
    assert actuation == pytest.approx(0.3 * area / 3)
