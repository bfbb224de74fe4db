"""A peer beside engine newton: the meshes and closed forms of the script, and what is made of its rows. No peer is needed."""

import importlib.util
import math
import sys

import numpy as np
import pytest

from limo.errors import ResultError
from limo.mechanics.volumes import flux
from limo.reports.peer import AIRBAG, COLUMNS, MODELS, MYLAR, peer_section, read_peer


@pytest.fixture(scope="module")
def cases(root):
    """The module of the cases, which is no part of the package."""
    spec = importlib.util.spec_from_file_location("peer_cases", root / "scripts/peer/cases.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    yield module
    del sys.modules[spec.name]


def areas(nodes: np.ndarray, elements: np.ndarray) -> np.ndarray:
    x, y = np.moveaxis(nodes[elements], -1, 0)
    return (x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum(axis=1) / 2


def test_the_airbag_is_that_of_the_configuration(cases, loaded):
    sheet, airbag = cases.CASES["airbag"], loaded.airbags["classical"]
    assert 2e3 * sheet.size == pytest.approx(airbag.side, rel=1e-6)
    values = 1e3 * sheet.thickness, 1e-6 * sheet.youngs_modulus, sheet.poisson_ratio, 1e-3 * sheet.pressure
    assert values == pytest.approx((airbag.thickness, airbag.youngs_modulus, airbag.poisson_ratio, airbag.pressure))
    assert max(r.value for r in airbag.references if r.quantity == "height") == AIRBAG["height"]


@pytest.mark.parametrize(("case", "count"), [("airbag", 1), ("mylar", 3)])
def test_meshes_cover_the_quarter_and_face_up(cases, case, count):
    exact, off = {"airbag": 1.0, "mylar": math.pi / 4}[case] * cases.CASES[case].size ** 2, []
    for n in (3, 6):
        nodes, quads = cases.mesh(case, n)
        assert len(quads) == count * n * n
        assert len(np.unique(np.round(nodes, 9), axis=0)) == len(nodes)
        assert areas(nodes, quads).min() > 0
        off.append(1 - areas(nodes, quads).sum() / exact)
        more, triangles = cases.crossed(nodes, quads)
        assert areas(more, triangles).min() > 0
        assert areas(more, triangles).sum() == pytest.approx(areas(nodes, quads).sum())
        assert cases.on_edge(case, nodes).sum() == 2 * n + 1
    assert off == pytest.approx([0, 0], abs=1e-12) if case == "airbag" else off[0] / off[1] == pytest.approx(4, rel=0.05)


def test_middles_of_the_rim_lie_on_its_circle(cases):
    nodes, quads = cases.with_middles(*cases.quarter_disc(3), is_round=True)
    assert len(nodes) == 37 + 63, "corners and edges"
    assert quads.shape == (27, 8)
    corners, middles = nodes[quads[:, :4]], nodes[quads[:, 4:]]
    straight = (corners + np.roll(corners, -1, axis=1)) / 2
    bent = np.linalg.norm(middles - straight, axis=-1) > 1e-9
    assert bent.sum() == 6
    assert np.linalg.norm(middles[bent], axis=-1) == pytest.approx(1)


def test_the_closed_form_of_the_mylar_balloon_is_the_published_one(cases):
    found, radius = cases.mylar_balloon(), cases.CASES["mylar"].size
    assert found["rim"] / radius == pytest.approx(0.7627, abs=1e-4)
    assert 2 * found["height"] / radius == pytest.approx(0.9139, abs=1e-4)
    assert 8 * found["volume"] / radius**3 == pytest.approx(1.2185, abs=1e-4)
    assert {key: 1e3 * value for key, value in found.items()} == pytest.approx(MYLAR, rel=1e-4)


def test_what_is_measured_of_a_paraboloid(cases):
    """z = c (1 - r^2 / R^2) over a disc that shrinks to a rim of 0.9 R: volume pi c (0.9 R)^2 / 8; quads and triangles alike."""
    radius = cases.CASES["mylar"].size
    nodes, quads = cases.mesh("mylar", 24)
    for mesh in ((nodes, quads), cases.crossed(nodes, quads)):
        flat = mesh[0]
        moved = np.column_stack([-0.1 * flat, 0.05 * (1 - (flat**2).sum(axis=1) / radius**2)])
        found = cases.measure("mylar", *mesh, moved)
        assert found["height"] == pytest.approx(0.05)
        assert found["rim"] == pytest.approx(0.9 * radius)
        assert found["volume"] == pytest.approx(math.pi * 0.05 * (0.9 * radius) ** 2 / 8, rel=5e-3)
    rng = np.random.default_rng(1)
    moved = 0.001 * rng.normal(size=(len(nodes), 3)) + (0, 0, 0.05)
    moved[cases.on_edge("mylar", nodes), 2] = 0
    moved[:, :2][nodes < 1e-9] = 0  # planes of symmetry: then all three close a body
    placed = np.column_stack([nodes, 0 * nodes[:, 0]]) + moved
    bilinear = cases.measure("mylar", nodes, quads, moved)["volume"]
    eight, eights = _with_straight_sides(placed, quads)
    assert bilinear == pytest.approx(flux(eight, eights).sum(), rel=1e-9), "the project's integral of the same surface"


def _with_straight_sides(placed: np.ndarray, quads: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    middles = (placed[quads] + placed[np.roll(quads, -1, axis=1)]) / 2
    numbers = len(placed) + np.arange(middles.shape[0] * 4).reshape(-1, 4)
    return np.vstack([placed, middles.reshape(-1, 3)]), np.hstack([quads, numbers])


def test_the_smooth_draw_in_does_without_a_fold(cases):
    nodes, quads = cases.mesh("airbag", 8)
    size = cases.CASES["airbag"].size
    share = nodes / size
    moved = np.zeros((len(nodes), 3))
    moved[:, :2] = -0.1 * share * (1 - 0.3 * share[:, ::-1] ** 2)
    found = cases.measure("airbag", nodes, quads, moved)
    assert found["draw_in"] == pytest.approx(0.1)
    assert found["smooth_draw_in"] == pytest.approx(0.1)
    middle = np.isclose(nodes, (size, 0)).all(axis=1) | np.isclose(nodes, (0, size)).all(axis=1)
    moved[middle, :2] *= 1.2
    folded = cases.measure("airbag", nodes, quads, moved)
    assert folded["draw_in"] == pytest.approx(0.12)
    assert folded["smooth_draw_in"] < 0.112


def test_kept_rows_are_shown_with_their_errors(root):
    rows = read_peer(root / "docs/data/peer.csv")
    assert set(rows.code) == {"newton", "kratos"}
    assert set(rows.case) == {"airbag", "mylar"}
    assert set(rows.model) <= set(MODELS)
    text = "\n".join(peer_section(rows))
    one = rows[(rows.case == "airbag") & (rows.code == "kratos")].iloc[0]
    assert f"| {one.elements} | {one.height_mm / AIRBAG['height'] - 1:+.1%} |" in text
    assert all(MODELS[model][1] in text for model in set(rows.model))
    assert ("Other work shared the machine" in text) == (rows.load.max() >= 1.5)
    worse = "\n".join(peer_section(rows.assign(converged=False, load=0.5)))
    assert worse.count("**not at rest**") == len(rows)
    assert "Other work" not in worse


def test_a_gap_says_how_it_is_filled_and_another_table_is_refused(tmp_path):
    assert list(read_peer(tmp_path / "no.csv").columns) == COLUMNS
    assert "scripts/peer/kratos.py" in peer_section(read_peer(tmp_path / "no.csv"))[0]
    (tmp_path / "other.csv").write_text("a,b\n1,2\n")
    with pytest.raises(ResultError, match="no columns case"):
        read_peer(tmp_path / "other.csv")
