"""The square airbag: mesh, constraints, deck, what is measured, and its dataset."""

import re
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from limo.airbag import solve as airbag_solution
from limo.airbag.model import Run, build_model, degrees_of_freedom, run_content, runs_of, sheet
from limo.airbag.solve import centre_stress, gather, measure, potential_energy, solve_run
from limo.engines.calculix.inflation import damping, end_time, write_deck
from limo.engines.engine import EngineSettings
from limo.engines.load_path import LoadPath, count_stages
from limo.engines.newton.assembly import Assembly
from limo.errors import ResultError
from limo.figures import airbag_convergence, airbag_shapes, style
from limo.figures.airbag_shapes import surface
from limo.reports.accuracy import report
from limo.reports.accuracy_airbag import airbag_report, keep_airbags, observed_order, read_airbags
from limo.schema.accuracy import Airbag
from limo.schema.element import element as find_element
from limo.schema.figures import AIRBAG_FIGURES

ELEMENTS = ("S3", "S4", "S4R", "S6", "S8", "S8R", "C3D20R", "C3D20")
NODES = {"S3": 3, "S4": 4, "S4R": 4, "S6": 6, "S8": 8, "S8R": 8, "C3D20R": 8, "C3D20": 8}


PUBLISHED = [
    {"quantity": "height", "value": 50.0, "divisions": 2, "source": "nobody"},
    {"quantity": "edge_draw_in", "value": 10.0, "source": "nobody"},
]


@pytest.fixture(scope="module")
def airbag(loaded) -> Airbag:
    return loaded.airbags["classical"]


def flat_airbag(**changes) -> Airbag:
    values = {"side": 200.0, "thickness": 0.5, "youngs_modulus": 600.0, "poisson_ratio": 0.4, "pressure": 5.0}
    return Airbag(**(values | {"series": [{"element": "S8R", "divisions": [2]}]} | changes))


# --------------------------------------------------------------------------------------------------------------------
# configuration


def test_shipped_airbags_are_those_of_the_literature_and_of_the_paper(loaded):
    classical, paper = loaded.airbags["classical"], loaded.airbags["paper"]
    assert classical.side * np.sqrt(2) == pytest.approx(1200, rel=1e-6)
    assert paper.side == pytest.approx(1000 * np.sqrt(0.5), rel=1e-6)
    for airbag in (classical, paper):
        assert {s.element for s in airbag.series} >= set(ELEMENTS) - {"C3D20"}
        assert {s.engine for s in airbag.series if s.element == "C3D20R"} == {"calculix", "newton"}
        assert min(len(s.divisions) for s in airbag.series) >= 5


@pytest.mark.parametrize(
    ("engine", "change", "same"),
    [
        ("calculix", {"description": "other words", "time_limit": 9.0, "references": []}, True),
        ("calculix", {"numerics": {"newton": {"fit_steps": 7}}}, True),
        ("calculix", {"numerics": {"rise": 2.0}}, False),
        ("newton", {"numerics": {"rise": 2.0}}, True),
        ("newton", {"numerics": {"newton": {"fit_steps": 7}}}, False),
        ("newton", {"pressure": 6.0}, False),
    ],
)
def test_a_run_depends_on_what_its_engine_looks_at(engine, change, same):
    run = Run("C3D20R", engine, 2, (100.0,))
    assert (run_content(flat_airbag(), run) == run_content(flat_airbag(**change), run)) == same


def test_every_run_has_a_name_of_its_own(airbag):
    runs = runs_of(airbag)
    assert len(runs) == sum(len(s.divisions) for s in airbag.series)
    assert all(re.fullmatch(r"\w+", name) for name in runs)
    assert len({run.series for run in runs.values()}) == len(airbag.series), "and every series has one for people"


# --------------------------------------------------------------------------------------------------------------------
# mesh and constraints


@pytest.mark.parametrize("element", ELEMENTS)
def test_the_mesh_is_its_own_mirror_image_and_covers_the_quarter(element):
    flat = sheet(200.0, 3, find_element(element))
    assert flat.quads.shape[1] == NODES[element]
    number = {tuple(place): n for n, place in enumerate(flat.lattice)}
    mirror = np.array([number[y, x] for x, y in flat.lattice])
    assert {frozenset(e) for e in flat.quads} == {frozenset(mirror[e]) for e in flat.quads}
    corners = flat.nodes[flat.quads[:, : 3 if element in ("S3", "S6") else 4], :2]
    following = np.roll(corners, -1, axis=1)
    areas = 0.5 * (corners[..., 0] * following[..., 1] - corners[..., 1] * following[..., 0]).sum(axis=1)
    assert (areas > 0).all(), "all normals up"
    assert areas.sum() == pytest.approx(100.0**2)
    assert set(np.unique(flat.quads)) == set(range(len(flat.nodes))), "no node without element"


@pytest.mark.parametrize("element", ["S6", "S8"])
def test_mid_side_nodes_lie_between_their_corners(element):
    flat = sheet(200.0, 3, find_element(element))
    count = 3 if element == "S6" else 4
    corners = flat.nodes[flat.quads[:, :count]]
    assert np.allclose(flat.nodes[flat.quads[:, count:]], 0.5 * (corners + np.roll(corners, -1, axis=1)))


def test_degrees_of_freedom_are_those_of_the_bricks():
    shell, brick = (build_model(flat_airbag(), Run(e, "calculix", 3)) for e in ("S8R", "C3D20R"))
    assert degrees_of_freedom(shell) == degrees_of_freedom(brick) == 3 * len(brick.nodes)


@pytest.mark.parametrize("planes", ["symmetric", "hinged"])
def test_bricks_may_turn_about_the_edge_and_about_hinged_planes_alone(planes):
    model = build_model(flat_airbag(), Run("C3D20R", "newton", 2, (), planes))
    assembly, flat = Assembly(model), model.mesh
    heights = model.nodes[:, 2]

    def allowed(u: np.ndarray) -> bool:
        return np.allclose(assembly.expand(assembly.gather_free(u)), u)

    turned = np.zeros_like(model.nodes)
    edge = np.flatnonzero((flat.lattice[:, 0] == flat.size - 1) & (flat.lattice[:, 1] > 0))
    for nodes in (model.expansion.bottom[edge], model.expansion.top[edge]):
        turned[nodes, 0] = heights[nodes]
    assert allowed(turned)
    hinged = np.zeros_like(model.nodes)
    plane = np.flatnonzero(flat.on_x)
    for nodes in (model.expansion.bottom[plane], model.expansion.top[plane]):
        hinged[nodes, 0] = heights[nodes]
    assert allowed(hinged) == (planes == "hinged")
    lifted = np.zeros_like(model.nodes)
    lifted[:, 2] = 1.0
    assert not allowed(lifted)


# --------------------------------------------------------------------------------------------------------------------
# deck


def test_deck_goes_through_the_path_and_rests(tmp_path):
    airbag = flat_airbag(numerics={"rise": 3.0, "hold": 2.0})
    write_deck(build_model(airbag, Run("S8R", "calculix", 2, (100.0, 10.0))), (100.0, 10.0, 1.0), tmp_path / "deck.inp")
    text = (tmp_path / "deck.inp").read_text()
    table = re.search(r"NAME=PATH\n((?:[\d.].*\n)+)", text).group(1).replace("\n", ", ")
    points = np.array([float(x) for x in table.strip(", ").split(",")]).reshape(-1, 2)
    assert np.allclose(points, [(0, 0), (1, 100), (2, 10), (3, 1), (5, 1)])
    assert "DEVICE, P, 0.005" in text
    assert end_time(airbag.numerics) == 5.0


def test_damping_makes_the_share_of_the_pressure_that_is_asked_for():
    airbag = flat_airbag(numerics={"damping_share": 0.2, "rise": 4.0})
    velocity, mass_per_area = 0.5 * airbag.side / 4.0, 170e-12
    assert mass_per_area * damping(build_model(airbag, Run("S8R", "calculix", 2))) * velocity == pytest.approx(0.2 * 5e-3)


# --------------------------------------------------------------------------------------------------------------------
# what is measured


def test_measures_of_a_known_displacement():
    model = build_model(flat_airbag(), Run("S8", "calculix", 4))
    x, y = model.mesh.nodes[:, 0], model.mesh.nodes[:, 1]
    folds = np.where((x == 100) & (y == 0), 3.0, 0.0) + 0.0
    moved = np.column_stack(
        [-(10 - 4 * (y / 200) ** 2) * (x == 100) - folds, -(10 - 4 * (x / 200) ** 2) * (y == 100), 30 - x / 10]
    )
    found = measure(model, moved)
    assert found["height"] == pytest.approx(30)
    assert found["edge_draw_in"] == pytest.approx(10 + 3 / 2)
    assert found["corner_draw_in"] == pytest.approx(9)
    assert found["asymmetry"] == pytest.approx(0, abs=1e-12)
    assert 10 < found["edge_draw_in_smooth"] < 10 + 3 / 2, "a fold at the middle counts less than it is deep"


def test_stress_at_the_centre_of_a_stretched_sheet():
    airbag = flat_airbag()
    for element in ("S4", "S8"):
        model = build_model(airbag, Run(element, "calculix", 2))
        moved = 1e-5 * model.mesh.nodes
        assert centre_stress(model, moved) == pytest.approx(600 / (1 - 0.4) * 1e-5, rel=1e-3)
        moved[:, 1] = 0.0
        assert centre_stress(model, moved) == pytest.approx(600 / (1 - 0.4**2) * 1e-5, rel=1e-3)


def test_potential_energy_of_known_states():
    airbag = flat_airbag()
    model = build_model(airbag, Run("C3D20R", "newton", 2, planes="symmetric"))
    lifted = np.tile([0, 0, 7.0], (len(model.nodes), 1))
    low = airbag.thickness / 2
    assert potential_energy(model, lifted) == pytest.approx(-5e-6 * 100**2 * (7 - low) / 3), "planes of symmetry stay open here"
    stretched = 1e-3 * model.nodes * [1, 1, 0]
    energy = 1e-3 * 600 / (1 - 0.4) * 1e-3**2 * 100**2 * 0.5  # E / (1 - nu) e^2 of plane stress, which is not free to thin here
    constrained = energy * (1 - 0.4) / ((1 + 0.4) * (1 - 2 * 0.4)) * 1.0
    pressed = 5e-6 * (100.1) ** 2 * low / 3
    assert potential_energy(model, stretched) - pressed == pytest.approx(constrained, rel=2e-3)
    assert np.isnan(potential_energy(build_model(airbag, Run("S8R", "calculix", 2)), np.zeros((21, 3))))


def test_observed_order_of_a_power():
    n = np.array([4, 8, 16, 32])
    assert observed_order(n, 216.7 - 50.0 * n**-1.5, 216.7) == pytest.approx(1.5)
    assert np.isnan(observed_order(n[:2], [1.0, 2.0], 3.0))


# --------------------------------------------------------------------------------------------------------------------
# dataset, table and figures


@pytest.fixture
def ends_with(monkeypatch):
    """``ends_with(outcome)``: runs end with status, reason and last state, or without one, that ``outcome(model)`` says."""

    def make(outcome):
        def inflate(model, levels, folder, settings):
            status, reason, state = outcome(model)
            states = [] if state is None else [state]
            count = len(states)
            return LoadPath(
                status, reason, np.zeros(count, int), np.zeros(count), np.arange(count, dtype=float), states.__getitem__,
                precision="float64", is_static=True, in_process=True, iterations=count_stages() | {"fit": 7}, rejected=1,
                build={}, cpu_seconds=2.0, wall_seconds=2.0, memory=50.0,
            )  # fmt: skip

        monkeypatch.setattr(airbag_solution, "find_engine", lambda name: SimpleNamespace(inflate=inflate))

    return make


@pytest.fixture
def dataset(ends_with, tmp_path) -> xr.Dataset:
    """Three runs without a solver: a parabolic cap on squares, one on triangles, and a failure without a state."""
    airbag = flat_airbag(references=[{"quantity": "height", "value": 40.0, "source": "nobody"}])

    def cap(model):
        if model.element.name == "S4R":
            return "diverged", "too many cutbacks", None
        moved = np.zeros_like(model.nodes)
        moved[:, 2] = 40 - 0.003 * (model.nodes[:, :2] ** 2).sum(axis=1)
        return "converged", "", moved

    ends_with(cap)
    runs = [Run("S3", "calculix", 3, (100.0,)), Run("S8R", "calculix", 2), Run("S8R", "calculix", 4), Run("S4R", "calculix", 2)]
    files = [tmp_path / f"{run.name}.nc" for run in runs]
    for run, file in zip(runs, files, strict=True):
        solve_run(airbag, run, EngineSettings()).to_netcdf(file)
    gather(airbag, "cap", [xr.load_dataset(file) for file in files]).to_netcdf(tmp_path / "gathered.nc")
    return xr.load_dataset(tmp_path / "gathered.nc")


def test_dataset_has_a_row_a_run_and_failures_have_a_reason(dataset):
    assert dataset.sizes["run"] == 4
    assert list(dataset.status.values) == ["converged"] * 3 + ["diverged"]
    assert dataset.reason.values[-1] == "too many cutbacks"
    assert np.allclose(dataset.height.values[:3], 40)
    assert np.isnan(dataset.height.values[-1])
    assert np.isnan(dataset.displacement.values[-1]).all()
    assert list(dataset.path.values) == ["100, 1", "1", "1", "1"]
    assert list(dataset.series.values)[:2] == ["S3 (via 100 p)", "S8R (straight up)"]
    assert list(dataset.element.values) == ["S3", "S8R", "S8R", "S4R"]
    assert all({"units", "long_name"} <= set(v.attrs) for n, v in dataset.items() if n not in airbag_solution.TEXT)


def test_displacements_beyond_the_side_are_no_result(ends_with):
    ends_with(lambda model: ("converged", "", 1e11 + 0 * model.nodes))
    run = solve_run(flat_airbag(), Run("S4", "calculix", 2), EngineSettings())
    assert run.status.item() == "diverged"
    assert "1e+11" in run.reason.item()


def test_shapes_are_taken_from_the_padded_lattice(dataset):
    for k, count in ((0, 4), (1, 5), (2, 9)):
        place, size = surface(dataset.isel(run=k), 200.0)
        assert place.shape == (count, count, 3)
        flat = np.linspace(0, 100, count)
        assert np.allclose(place[..., 2], 40 - 0.003 * (flat[:, None] ** 2 + flat**2), atol=1e-4), "centres of squares too"
        assert np.allclose(size, np.abs(place[..., 2]) / 200)


def test_table_keeps_all_and_the_report_is_made_of_it(dataset, tmp_path):
    source, table = tmp_path / "airbag.nc", tmp_path / "airbag.csv"
    dataset.assign_attrs(airbag="cap").to_netcdf(source)
    keep_airbags([source], table)
    airbag = flat_airbag(description="a cap", references=PUBLISHED)
    text = airbag_report(read_airbags(table), {"cap": airbag}, {"cap": ["![a](b.png)"]})
    assert "### `cap`: a cap" in text
    assert "| S8R (straight up) | 2 | -20.0%, **not met** |" in text, "the density of the published mesh"
    assert "| S8R (straight up) | 4 | -20.0%, **not met** |" in text, "the finest"
    assert "| series | n | w_M within 1% | u_B smooth within 2% | Pi [J] |" in text, "the middle of an edge is no target"
    assert re.search(r"\| S3 \(via 100 p\) \| 3 \| 96 \| converged \| 40\.0 \| -20\.0% \|", text)
    assert "| diverged: too many cutbacks | - | - |" in text
    table.write_text("a,b\n1,2\n")
    with pytest.raises(ResultError, match="no columns airbag"):
        read_airbags(table)
    table.write_bytes(b"\x00\xff")
    with pytest.raises(ResultError, match="not a table"):
        read_airbags(table)
    with pytest.raises(ResultError, match="not the dataset of an airbag"):
        keep_airbags([table], tmp_path / "other.csv")


def test_shells_are_compared_with_the_bricks_that_calculix_makes_of_them(dataset, tmp_path):
    dataset.assign_attrs(airbag="cap").to_netcdf(tmp_path / "airbag.nc")
    keep_airbags([tmp_path / "airbag.nc"], tmp_path / "airbag.csv")
    rows = read_airbags(tmp_path / "airbag.csv")
    assert "CalculiX makes" not in airbag_report(rows, {"cap": flat_airbag(references=PUBLISHED)}, {})
    shells = rows[rows.element == "S8R"]
    bricks = shells.assign(element="C3D20R", engine="newton", height=[50.0, 40.0], series="C3D20R (newton, hinged, straight up)")
    text = airbag_report(pd.concat([rows, bricks]), {"cap": flat_airbag(references=PUBLISHED)}, {})
    said = "CalculiX makes C3D20R of S8R. The same bricks written out and solved by newton end within 10.0% of its height"
    assert f"{said} (median of 2 meshes, at most 20.0%)" in text
    assert "At n = 4 they end at 40.0 mm." in text
    assert "Here S3 does not: on its finest mesh (n = 3) it is +0.0% off. S4R fails on all of 1 meshes." in text
    high = bricks.assign(height=[50.0, 44.0])
    text = airbag_report(pd.concat([rows, high]), {"cap": flat_airbag(references=PUBLISHED)}, {})
    assert "S3 locks or fails: on its finest mesh (n = 3) it is -9.1% off" in text


def test_the_kept_rows_are_those_of_the_configuration_and_the_report_is_made_of_them(root, loaded):
    rows = read_airbags(root / "docs/gallery/data/airbag.csv")
    for name, airbag in loaded.airbags.items():
        kept = rows[rows.airbag == name]
        expected = [(run.series, run.divisions) for run in runs_of(airbag).values()]
        assert list(zip(kept.series, kept.divisions, strict=True)) == expected
    written, data = (root / "docs/accuracy.md").read_text(encoding="utf-8"), root / "docs/gallery/data"
    assert written == report(data / "airbag.csv", data / "accuracy.nc", root / "config/config.yaml"), "call limo accuracy"


def test_figures_are_drawn_from_the_dataset_alone(dataset, tmp_path):
    modules = SimpleNamespace(airbag_convergence=airbag_convergence, airbag_shapes=airbag_shapes)
    for name in AIRBAG_FIGURES:
        figure = getattr(modules, name).draw(dataset)
        assert len(figure.axes) >= 3
        style.save(figure, tmp_path / f"{name}.png")
        assert (tmp_path / f"{name}.png").stat().st_size > 10_000
