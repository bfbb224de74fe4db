"""Meshing of the flat pattern, stacking and sealing of the layers, and the mesh file."""

import meshio
import numpy as np
import pytest
from shapely import MultiLineString, Point

from limo.errors import MeshError, ResultError
from limo.geometry.pattern import flat_pattern
from limo.mesh.device import mesh_device, mesh_to_target
from limo.mesh.file import read_mesh, write_mesh
from limo.mesh.flat import mesh_pattern, smallest_jacobian
from limo.mesh.layers import FACES, LAYERS, degrees_of_freedom_of, layered
from limo.schema.numerics import MeshLevel

# a seam on the axis, a pouch across the axis, one pouch a face, and straight seams
DEVICES = [("limo", 8), ("limo", 6), ("limo", 2), ("mini_limo", 6)]
WALL, ENDO, EPI = range(3)
FRONT, BACK = range(2)


@pytest.fixture(params=DEVICES, ids=lambda p: f"{p[0]}-{p[1]}", scope="module")
def device(request):
    return request.param


@pytest.fixture
def made(coarse, device):
    return coarse(*device)


@pytest.fixture
def full(device_mesh, device):
    return device_mesh(*device, "full")


def sorted_rows(points):
    """Points (n, 3) as a sorted list of rows, for comparing sets of points bit by bit."""
    return np.sort(np.ascontiguousarray(points).view("f8,f8,f8"), axis=0)


def nodes_of(mesh, layer, face=FRONT):
    return np.unique(mesh.quads[(mesh.layer == layer) & (mesh.face == face)])


# --------------------------------------------------------------------------------------------------------------------
# the flat mesh


def test_smallest_jacobian_finds_a_folded_element():
    square = np.array([[0, 0], [2, 0], [2, 2], [0, 2], [1, 0], [2, 1], [1, 2], [0, 1]], float)
    folded = square.copy()
    folded[2] = [0.3, 0.3]
    folded[5], folded[6] = (folded[1] + folded[2]) / 2, (folded[2] + folded[3]) / 2
    ratio = smallest_jacobian(np.vstack([square, folded]), np.arange(16).reshape(2, 8))
    assert ratio[0] == pytest.approx(1.0)
    assert ratio[1] < 0


def test_area_of_every_patch_is_that_of_the_pattern(made, quad_areas):
    areas = quad_areas(made.flat.nodes, made.flat.quads)
    for k, region in enumerate(made.pattern.regions):
        assert areas[made.flat.region == k].sum() == pytest.approx(made.pattern.polygon(region).area, rel=4e-3)
    whole = sum(made.pattern.polygon(r).area for r in made.pattern.regions)
    assert areas.sum() == pytest.approx(whole, rel=1e-3)


def test_masks_mark_the_curves_they_are_named_after(made):
    flat, pattern = made.flat, made.pattern
    valve = np.isclose(flat.nodes[:, 1], 0.0, atol=1e-9)
    np.testing.assert_array_equal(flat.on_valve, valve)
    np.testing.assert_array_equal(flat.on_axis, flat.nodes[:, 0] == 0.0)
    assert flat.nodes[flat.on_valve, 0].max() == pytest.approx(pattern.half_width)
    for kind, mask in (("outer", flat.on_outer), ("seam", flat.on_seam)):
        lines = MultiLineString([c.points for c in pattern.curves if c.kind == kind])
        distances = np.array([lines.distance(Point(n)) for n in flat.nodes])
        assert distances[mask].max() < 0.1, f"a node off the {kind} curve is marked"
        assert distances[~mask].min() > 0.1, f"a node on the {kind} curve is not marked"


@pytest.mark.parametrize(("device_name", "n_pouches", "wanted"), [("limo", 8, 16000), ("mini_limo", 4, 24000)])
def test_full_model_is_about_as_large_as_asked_for_and_unfolded(loaded, quad_areas, device_name, n_pouches, wanted):
    pattern = flat_pattern(loaded.devices[device_name].pattern, n_pouches)
    flat = mesh_to_target(pattern, wanted, 0.8)
    assert smallest_jacobian(flat.nodes, flat.quads).min() > 0
    assert quad_areas(flat.nodes, flat.quads).min() > 0
    assert degrees_of_freedom_of(layered(flat, pattern, "full")) == pytest.approx(wanted, rel=0.2)


def test_half_the_size_gives_about_four_times_the_elements(loaded):
    pattern = flat_pattern(loaded.devices["mini_limo"].pattern, 6)
    counts = [len(mesh_pattern(pattern, size, 0.8).quads) for size in (6.0, 3.0)]
    assert 3.0 < counts[1] / counts[0] < 5.0


def test_failure_of_gmsh_is_a_mesh_error(loaded):
    with pytest.raises(MeshError, match="N_p = 6"):
        mesh_pattern(flat_pattern(loaded.devices["mini_limo"].pattern, 6), -1.0, 0.8)


# --------------------------------------------------------------------------------------------------------------------
# layers and symmetry


def test_epicardium_shares_exactly_the_seam_nodes_with_the_endocardium(full):
    for face in (FRONT, BACK):
        endo, epi = nodes_of(full, ENDO, face), nodes_of(full, EPI, face)
        shared = np.intersect1d(endo, epi)
        np.testing.assert_array_equal(shared, np.intersect1d(np.flatnonzero(full.on_seam), epi))
        only_endo, only_epi = (full.nodes[np.setdiff1d(a, shared)] for a in (endo, epi))
        assert len(only_endo) > 0
        np.testing.assert_array_equal(sorted_rows(only_endo), sorted_rows(only_epi))


def test_wall_meets_the_pouches_only_on_seams(full):
    for face in (FRONT, BACK):
        for layer in (ENDO, EPI):
            assert full.on_seam[np.intersect1d(nodes_of(full, WALL, face), nodes_of(full, layer, face))].all()


def test_front_and_back_share_exactly_the_outer_edge(full):
    front, back = (np.unique(full.quads[full.face == f]) for f in (FRONT, BACK))
    np.testing.assert_array_equal(np.intersect1d(front, back), np.flatnonzero(full.on_outer))


def test_pouches_of_a_layer_share_seam_nodes_only(full):
    for pouch in range(full.pouch.max()):
        for layer in (ENDO, EPI):
            one, next_one = (np.unique(full.quads[(full.pouch == p) & (full.layer == layer)]) for p in (pouch, pouch + 1))
            assert full.on_seam[np.intersect1d(one, next_one)].all()


def test_full_mesh_is_its_own_mirror_image(full):
    """Nodes and elements are the same set under x -> -x, with pouch p of a face turned into pouch N - 1 - p."""
    per_face = (full.pouch.max() + 1) // 2

    def elements(mirror):
        centre = full.nodes[full.quads].mean(axis=1)[:, :2] * [mirror, 1]
        in_face = np.where(full.pouch < 0, -1, full.pouch % per_face)
        pouch = np.where((in_face >= 0) & (mirror < 0), per_face - 1 - in_face, in_face)
        rows = np.column_stack([centre, full.layer, full.face, pouch]).round(7) + 0.0
        return rows[np.lexsort(rows.T)]

    np.testing.assert_allclose(elements(-1), elements(1), atol=2e-7)
    left, right = (sorted_rows(full.nodes[s * full.nodes[:, 0] > 0] * [s, 1, 1]) for s in (-1, 1))
    np.testing.assert_array_equal(left, right)


def test_pouches_count_from_left_to_right_on_the_front_then_on_the_back(full, device):
    assert full.pouch.max() + 1 == device[1]
    per_face = device[1] // 2
    centres = np.array([full.nodes[full.quads[full.pouch == p]][..., 0].mean() for p in range(device[1])])
    assert (np.diff(centres[:per_face]) > 0).all()
    np.testing.assert_allclose(centres[:per_face], centres[per_face:], atol=1e-9)
    assert ((full.face == BACK) == (full.pouch >= per_face))[full.pouch >= 0].all()


def test_all_normals_point_along_z(full, quad_areas):
    assert quad_areas(full.nodes, full.quads).min() > 0
    assert (full.nodes[:, 2] == 0).all()
    assert smallest_jacobian(full.nodes, full.quads).min() > 0


def test_named_surfaces_are_complete_and_disjoint(full):
    named = full.surfaces
    layers = np.concatenate([named[f"{layer}_{face}"] for layer in LAYERS for face in FACES])
    np.testing.assert_array_equal(np.sort(layers), np.arange(len(full.quads)))
    for layer, index in (("endo", ENDO), ("epi", EPI)):
        pouches = np.concatenate([v for k, v in named.items() if k.startswith("pouch") and k.endswith(layer)])
        np.testing.assert_array_equal(np.sort(pouches), np.flatnonzero(full.layer == index))


@pytest.mark.parametrize(("symmetry", "copies"), [("front_back", 2), ("quarter", 4)])
def test_full_model_is_a_whole_number_of_partial_ones(device_mesh, device, full, quad_areas, symmetry, copies):
    part = device_mesh(*device, symmetry)
    assert part.copies == copies
    assert len(full.quads) == copies * len(part.quads)
    for layer in (WALL, ENDO, EPI):
        areas = [quad_areas(m.nodes, m.quads)[m.layer == layer].sum() for m in (part, full)]
        assert areas[1] == pytest.approx(copies * areas[0], rel=1e-12)
    on_plane = np.isclose(part.nodes[:, 0], 0.0, atol=1e-9)
    np.testing.assert_array_equal(part.on_axis, on_plane if symmetry == "quarter" else np.zeros_like(on_plane))


# --------------------------------------------------------------------------------------------------------------------
# the file


def test_same_input_gives_the_same_bytes(make_case, tmp_path):
    content = make_case(n_pouches=4, mesh_level=MeshLevel(degrees_of_freedom=9000)).mesh_content()
    for name in ("first.vtu", "second.vtu"):
        write_mesh(mesh_device(content), tmp_path / name)
    assert (tmp_path / "first.vtu").read_bytes() == (tmp_path / "second.vtu").read_bytes()


@pytest.mark.parametrize("symmetry", ["full", "quarter"])
def test_mesh_file_round_trip(device_mesh, tmp_path, symmetry):
    mesh = device_mesh("limo", 8, symmetry)
    write_mesh(mesh, tmp_path / "mesh.vtu")
    again = read_mesh(tmp_path / "mesh.vtu", symmetry)
    for name, value in mesh.__dict__.items():
        np.testing.assert_array_equal(getattr(again, name), value, err_msg=name)


def test_damaged_mesh_files_are_result_errors(device_mesh, tmp_path):
    path = tmp_path / "mesh.vtu"
    write_mesh(device_mesh("limo", 8, "quarter"), path)
    whole = path.read_bytes()
    unmasked = whole.replace(b"on_seam", b"on_team")
    for damaged in (b"", b"not a mesh", whole[: len(whole) // 3], whole[:-30], whole[2000:], unmasked):
        path.write_bytes(damaged)
        with pytest.raises(ResultError, match=r"mesh\.vtu"):
            read_mesh(path, "quarter")
    with pytest.raises(ResultError, match=r"absent\.vtu"):
        read_mesh(tmp_path / "absent.vtu", "quarter")


def test_mesh_of_other_elements_is_a_result_error(tmp_path):
    masks = {k: np.zeros(3, np.int8) for k in ("on_valve", "on_outer", "on_seam", "on_axis")}
    cells = {k: [np.zeros(1, int)] for k in ("layer", "face", "pouch")}
    triangle = meshio.Mesh(np.eye(3), [("triangle", np.array([[0, 1, 2]]))], point_data=masks, cell_data=cells)
    meshio.write(tmp_path / "other.vtu", triangle)
    with pytest.raises(ResultError, match=r"other\.vtu"):
        read_mesh(tmp_path / "other.vtu", "quarter")
