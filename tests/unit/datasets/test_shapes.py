"""Shapes of a study: what is kept for its figures, how it is packed, and the full and smooth device that is made of it."""

from __future__ import annotations

import ctypes
from dataclasses import replace
from importlib import import_module
from io import BytesIO

import numpy as np
import pytest
import xarray as xr

from limo.cases.case import describe
from limo.cases.plan import make_plan
from limo.datasets.shapes import gather_shapes, write_shapes
from limo.datasets.study import gather_study
from limo.figures import deformation, pictures, render, strain_life, style
from limo.figures.render import Camera, Scale, Scene
from limo.measure.case import measure_case
from limo.mechanics.build import build_model
from limo.mechanics.layer import inside_out, layer_state, surface_points
from limo.mesh.file import write_mesh
from limo.mesh.surface import Surface, facets, full_device, mirrors, surface_of
from limo.schema.figures import FIGURES, NEEDS, SHAPES
from limo.schema.study import Study
from limo.store.files import write_json
from tests.helpers.cases import configured, moved, write_case
from tests.helpers.patches import grid

PRESSURES = [0.0, 13.8, 23.8, 43.8, 60.0]
AXES = {"n_pouches": [4, 8], "ventricular_pressure": [3.8]}


def study(**changes) -> Study:
    values = {
        "axes": AXES, "actuation_pressure_max": 60.0, "outputs": ["volumes", "stress", "strain", "fatigue"],
        "mesh": {"level": "preview", "symmetry": "quarter", "element": "C3D20R"},
        "frames": [0, "P_v + 10", "P_v + 20", "P_v + 40", "max"], "figures": [f for f in FIGURES if f != "afterload"],
    }  # fmt: skip
    return Study.model_validate(values | changes)


@pytest.fixture(scope="module")
def solved(tmp_path_factory, loaded, device_mesh):
    """A study of N_p = 4, which failed, and N_p = 8 with made-up frames: (configuration, cases, meshes, model of N_p = 8)."""
    configuration = configured(loaded, s=study())
    folder, meshes = tmp_path_factory.mktemp("cases"), tmp_path_factory.mktemp("meshes")
    plan = make_plan(configuration, folder)
    for case in plan.cases.values():
        if case.n_pouches == 4:
            write_json(folder / case.case_id / "status.json", {"status": "diverged", "reason": "no increment was small enough"})
            volumes = {n: ("increment", np.array([400.0, 399.0])) for n in ("ventricle_volume", "actuation_volume")}
            coords = {"actuation_pressure": ("increment", np.array([0.0, 2.0])), "stage": ("increment", np.array([1, 2]))}
            xr.Dataset(volumes, coords=coords).to_netcdf(folder / case.case_id / "volumes.nc")
            continue
        model = build_model(case, device_mesh())
        write_mesh(model.mesh, meshes / f"{case.mesh_id}.vtu")
        write_case(folder / case.case_id, model, {p: moved(model, p) for p in PRESSURES})
        write_json(folder / case.case_id / "case.json", describe(case))
        write_json(folder / case.case_id / "status.json", {"status": "converged", "reason": "", "solver": {}})
        mesh_file = meshes / f"{case.mesh_id}.vtu"
        measure_case(case, plan.wanted[case.case_id], loaded.config.fatigue, mesh_file, folder / case.case_id)
    return configuration, folder, meshes, model


@pytest.fixture(scope="module")
def shapes(solved, tmp_path_factory):
    """The study's shapes as they come back from their file."""
    configuration, folder, meshes, _ = solved
    file = tmp_path_factory.mktemp("study") / "shapes.nc"
    write_shapes(gather_shapes(configuration, "s", folder, meshes), file)
    assert file.stat().st_size < 200_000
    return xr.load_dataset(file)


def eight(shapes) -> xr.Dataset:
    return pictures.case_grid(shapes, "n_pouches")[2][0][1]


def test_shapes_keep_the_displacements_of_the_middle_surface(shapes, solved):
    model, case = solved[3], eight(shapes)
    frame = pictures.frame_at(case, 43.8)
    surface = surface_of(case, case.displacement.values[frame])
    expected = model.mesh.nodes + model.expansion.midsurface(moved(model, 43.8))
    np.testing.assert_allclose(surface.points[surface.quads], expected[model.mesh.quads], atol=0.01)
    np.testing.assert_array_equal(surface.layer, model.mesh.layer)
    assert float(case.frame_pressure[frame]) == pytest.approx(43.8)


def test_stress_lies_where_it_was_computed(shapes, solved):
    """The map of points gives back the stress in the middle of elements, of a smooth state, within what averaging costs."""
    model, case = solved[3], eight(shapes)
    frame = pictures.last_frame(case)
    surface = surface_of(case, case.displacement.values[frame], case.von_mises.values[frame])
    stress = inside_out(model.mesh, layer_state(model, moved(model, 60.0), surface_points()).von_mises).max(axis=1).mean(axis=1)
    mean = surface.values[surface.quads[:, :4]].mean(axis=1)
    assert np.corrcoef(mean, stress)[0, 1] > 0.98
    assert np.median(np.abs(mean / stress - 1)) < 0.05


def test_a_failed_case_is_a_gap_with_its_reason(shapes):
    ((failed, good),) = pictures.case_grid(shapes, "n_pouches")[2]
    assert int(failed.mesh_number) == -1
    assert "case.json" in str(failed.shape_reason.values)
    assert pictures.last_frame(failed) is None
    assert not np.isfinite(failed.displacement).any()
    assert str(good.shape_reason.values) == ""


def test_a_study_of_failures_has_shapes_without_points(solved, tmp_path):
    configuration, _, meshes, _ = solved
    found = gather_shapes(configuration, "s", tmp_path, meshes)
    write_shapes(found, tmp_path / "shapes.nc")
    assert found.sizes["point"] == 0
    assert (found.mesh_number == -1).all()


def test_the_largest_event_is_kept(shapes):
    case = eight(shapes)
    before, after = case.event_pressure.values
    assert 20.0 <= before < after <= 20.2
    assert float(case.event_jump) == pytest.approx(10.0, abs=0.5)
    difference = np.linalg.norm(np.diff(case.event_displacement.values, axis=0)[0], axis=1)
    np.testing.assert_allclose(difference[np.isfinite(difference)], 7.0, atol=0.02)


def test_lines_lie_on_the_deformed_surface(shapes, solved):
    model, case = solved[3], eight(shapes)
    known = case.line_number.sel(side="epicardial").values >= 0
    line = case.line_place.sel(side="epicardial").values[known]
    points = model.mesh.nodes + model.expansion.midsurface(moved(model, 60.0))
    nearest = np.min(np.linalg.norm(line[:, None] - points, axis=2), axis=1)
    assert known.sum() > 500
    assert nearest.max() < 8.0  # elements are 9 mm
    assert set(case.line_face.sel(side="epicardial").values[known]) == {0}


def test_a_mirrored_quarter_is_the_full_device(device_mesh):
    quarter, full = (_flat(device_mesh("limo", 8, symmetry)) for symmetry in ("quarter", "full"))
    made = full_device(quarter, "quarter", 8)

    def key(s: Surface) -> list[tuple]:
        centre = np.round(s.points[s.quads[:, :4]].mean(axis=1)[:, :2], 6)
        return sorted(zip(*centre.T, s.layer, s.face, s.pouch, strict=True))

    assert key(made) == key(full)
    corners = made.flat[made.quads[:, :4]]
    side = np.roll(corners, -1, axis=1) - corners
    turned = side[..., 0] * np.roll(side, -1, axis=1)[..., 1] - side[..., 1] * np.roll(side, -1, axis=1)[..., 0]
    assert (turned.sum(axis=1) > 0).all()  # a mirror turns nothing over in the flat state


def _flat(mesh) -> Surface:
    return Surface(mesh.nodes[:, :2], mesh.nodes, mesh.quads, mesh.layer, mesh.face, mesh.pouch)


def test_mirrors_of_lines_are_those_of_surfaces():
    assert {tuple(m) for m in mirrors("quarter")} == {(1, 1, 1), (-1, 1, 1), (1, 1, -1), (-1, 1, -1)}
    assert [tuple(m) for m in mirrors("full")] == [(1, 1, 1)]


def cylinder(radius: float = 50.0) -> Surface:
    flat, quads = grid(4, 4)
    angle = flat[:, 0]
    points = np.stack([radius * np.sin(angle), radius * flat[:, 1], radius * np.cos(angle)], axis=1)
    none = np.zeros(len(quads), int)
    return Surface(flat, points, quads, none, none, none, flat[:, 0] ** 2)


def test_facets_follow_the_true_shape_without_holes():
    found = facets(cylinder())
    across = np.hypot(found.points[:, 0], found.points[:, 2])
    np.testing.assert_allclose(across, 50.0, rtol=1e-3)
    radial = found.points * [1, 0, 1] / across[:, None]
    np.testing.assert_allclose(np.abs((found.normals * radial).sum(axis=1)), 1.0, atol=5e-3)
    np.testing.assert_allclose(found.values, np.arctan2(found.points[:, 0], found.points[:, 2]) ** 2, atol=5e-3)
    # the border is the outline of the patch and nothing within it
    ends = found.points[found.borders.ravel()]
    angle = np.arctan2(ends[:, 0], ends[:, 2])
    assert np.maximum(np.abs(angle), np.abs(ends[:, 1] / 50.0)).min() > 1 - 1e-6


def test_facets_are_not_joined_across_a_seam():
    whole = cylinder()
    parted = replace(whole, pouch=(np.arange(16) % 4 > 1).astype(int))
    assert len(facets(parted).points) > len(facets(whole).points)
    assert len(facets(parted).borders) > len(facets(whole).borders)


def test_a_picture_shows_the_surface_in_its_colours_and_repeats():
    scale = Scale("viridis", 0.0, 1.0)
    camera = Camera(azimuth=0.0, elevation=0.0, centre=(0.0, 0.0, 0.0))
    first, second = (render.render(Scene().add(facets(cylinder()), scale=scale), camera, 120) for _ in range(2))
    other = render.render(Scene().add(facets(cylinder()), color="#ffffff"), Camera(), 120)
    again = render.render(Scene().add(facets(cylinder()), scale=scale), camera, 120)
    assert first.shape == (120, 92, 3)
    np.testing.assert_array_equal(first, second)
    np.testing.assert_array_equal(first, again)  # the picture between leaves nothing behind
    assert (first != other).any()
    assert (first[0] == 255).all()
    centre, edge = first[60, 46].astype(int), first[60, 46 + 27].astype(int)
    assert centre[2] > centre[1]  # dark blue in the middle
    assert edge[1] > edge[2] + 20  # green to yellow at the sides
    shown = (first < 250).any(axis=2)
    assert np.ptp(np.flatnonzero(shown.any(axis=1))) == pytest.approx(120 * 100 / 170, abs=2)  # 100 mm high, of 170 mm
    assert np.ptp(np.flatnonzero(shown.any(axis=0))) == pytest.approx(120 * 100 * np.sin(1) / 170, abs=2)


def test_the_camera_sees_the_valve_on_top_and_the_back_from_behind():
    small = replace(cylinder(), points=cylinder().points * 0.5, values=None)
    rows = np.flatnonzero((render.render(Scene().add(facets(small), color="#000000"), Camera(), 100) < 128).any(axis=(1, 2)))
    assert rows.mean() < 40  # y = 0 is the valve
    aside = replace(small, points=small.points + np.array([40.0, 0.0, 0.0]))
    sides = []
    for back in (False, True):
        image = render.render(Scene().add(facets(aside), color="#000000"), Camera(azimuth=0.0, back=back), 100)
        sides.append(np.flatnonzero((image < 128).any(axis=(0, 2))).mean() - image.shape[1] / 2)
    assert sides[0] * sides[1] < 0


def test_rendering_without_the_system_library_says_what_to_install(monkeypatch):
    def missing(name):
        raise OSError(f"{name}: cannot open shared object file")

    monkeypatch.setenv("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
    monkeypatch.setattr(ctypes, "CDLL", missing)
    with pytest.raises(render.LimoError, match="libegl1"):
        render.render(Scene(), Camera())


def test_scales_clip_and_mark_what_is_unknown():
    shown = Scale("viridis", 1.0, 100.0, log=True).colours(np.array([0.1, 1.0, 10.0, 1e6, np.nan]))
    np.testing.assert_array_equal(shown[0], shown[1])
    assert shown[4].max() == shown[4].min()
    assert len(np.unique(Scale("viridis", 0, 1, levels=4).colours(np.linspace(0, 1, 99)), axis=0)) == 4


@pytest.mark.parametrize("figure", [f for f in FIGURES if f in SHAPES])
def test_every_figure_of_surfaces_is_drawn_alike_twice_from_the_files_alone(solved, shapes, figure):
    configuration, folder, _, _ = solved
    dataset, module = gather_study(configuration, "s", folder), import_module(f"limo.figures.{figure}")
    written = []
    for _ in range(2):
        drawn, file = module.draw(dataset, None, shapes), BytesIO()
        drawn.savefig(file, format="png", metadata={"Software": None}, dpi=50)
        images = [image.get_array() for axis in drawn.findobj(lambda a: hasattr(a, "get_images")) for image in axis.get_images()]
        texts = " ".join(text.get_text() for text in drawn.findobj(lambda a: hasattr(a, "get_text")))
        written.append(file.getvalue())
        style.close(drawn)
    assert written[0] == written[1]
    pictured = [image for image in images if image.ndim == 3 and image.shape[0] > 100]
    assert len(pictured) >= 1
    for image in pictured:
        assert 0.05 < (np.asarray(image) < 250).any(axis=2).mean() < 0.9
    assert "diverged" in texts  # N_p = 4


def test_the_curves_beside_a_surface_are_those_of_all_branches(root):
    curves = xr.load_dataset(root / "docs/gallery/data/afterload.nc")
    both = xr.concat([curves, curves.assign(stroke_volume=curves.stroke_volume + 1.0)], "branch").assign_coords(branch=[0, 1])
    case = xr.Dataset(coords={"n_pouches": 6, "ventricular_pressure": 3.8, "aspect_ratio": 2.0, "branch": 0})
    found = pictures.branches_of(both, case).squeeze()
    np.testing.assert_allclose(found.stroke_volume.diff("branch").dropna("actuation_pressure", how="all"), 1.0, atol=1e-4)
    assert "branch" not in pictures.study_case(both, case).dims


def test_the_strain_life_figure_shows_the_device_that_fails_first(root):
    data = root / "docs/gallery/data"
    dataset, surfaces = xr.load_dataset(data / "fatigue.nc"), xr.load_dataset(data / "fatigue_shapes.nc")
    for size in (1.0, -1.0):  # the largest amplitude, and the smallest
        changed = dataset.assign(fatigue_amplitude_peak=1.0 + size * dataset.fatigue_amplitude_peak)
        first = changed.fatigue_amplitude_peak.where(
            changed.fatigue_amplitude_peak == changed.fatigue_amplitude_peak.max(), drop=True
        )
        drawn = strain_life.draw(changed, None, surfaces)
        title = drawn.axes[1].get_title(loc="left")
        style.close(drawn)
        assert f"$N_p$ = {first.n_pouches.item():g}, $P_v$ = {first.ventricular_pressure.item():g} kPa" in title
    nothing = strain_life.draw(dataset.assign(fatigue_amplitude_peak=np.nan * dataset.fatigue_amplitude_peak), None, surfaces)
    assert "no strain amplitudes" in nothing.axes[1].texts[0].get_text()
    assert "not measured" in nothing.axes[0].get_legend_handles_labels()[1][-1]
    style.close(nothing)


def test_a_study_of_surfaces_needs_its_frames(loaded):
    plain = study(outputs=["volumes"], figures=["pressure_volume"])
    drawn = study(outputs=["volumes"], figures=["deformation"])
    assert 60.0 not in plain.needed_frames(3.8)
    assert 60.0 in drawn.needed_frames(3.8)


def test_figures_have_modules_captions_and_needs(root):
    for figure in FIGURES:
        assert import_module(f"limo.figures.{figure}").draw
        assert (root / f"workflow/report/{figure}.rst").exists()
    assert {*NEEDS, *SHAPES} <= {*FIGURES}


def up_to(shapes, highest: float, contact: int = 0) -> xr.Dataset:
    """The same shapes of a study that stops at ``highest`` kPa, or does in all states touch."""
    requested = shapes.frame_requested.where(shapes.frame_requested <= highest)
    known = {"frame_requested": requested, "frame_pressure": shapes.frame_pressure.where(requested.notnull())}
    return shapes.assign(known | {"frame_contact": xr.full_like(shapes.frame_contact, contact)})


def written_on(figure) -> str:
    return " ".join(" ".join(text.get_text() for text in figure.findobj(lambda a: hasattr(a, "get_text"))).split())


@pytest.mark.parametrize(("highest", "columns"), [(60.0, 5), (43.8, 4), (30.0, 3), (13.8, 2), (5.0, 2)])
def test_no_two_panels_of_a_device_show_the_same_pressure(shapes, highest, columns):
    cut = up_to(shapes, highest)
    assert len(deformation.columns_of([eight(cut)])) == columns


def test_the_figure_says_why_it_has_fewer_panels_and_what_a_star_means(solved, shapes, tmp_path):
    configuration, folder, _, _ = solved
    dataset = gather_study(configuration, "s", folder)
    plain = deformation.draw(dataset, None, up_to(shapes, 60.0))
    assert "fewer" not in written_on(plain)
    assert "*" not in written_on(plain)
    low = deformation.draw(dataset, None, up_to(shapes, 13.8, contact=1))
    assert len(low.axes) == 2 * 2 + 1, "two pictures for each case, and the colour bar"
    assert "fewer pictures" in written_on(low)
    for module in ("deformation", "von_mises", "cycles", "design", "strain_life"):
        figure = import_module(f"limo.figures.{module}").draw(dataset, None, up_to(shapes, 60.0, contact=1))
        assert "kPa*" in written_on(figure)
        assert "front and back pass each other" in written_on(figure)
        style.close(figure)
    style.close(plain)
    style.close(low)
