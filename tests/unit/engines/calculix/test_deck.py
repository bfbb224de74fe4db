"""The CalculiX input file, read back; and the stages on the solver's clock."""

from dataclasses import dataclass

import numpy as np
import pytest

from limo.engines.calculix.deck import actuation_pressure_at, stage_times, write_deck
from limo.mechanics.build import build_model
from limo.schema.numerics import Mesh
from limo.schema.section import PLANNED

VENTRICULAR, MAXIMUM = 13.8, 100.0  # kPa


@dataclass(frozen=True)
class Card:
    """A keyword with its parameters and the numbers and names on its data lines."""

    name: str
    options: dict[str, str]
    rows: list[list[str]]


def parse_deck(text):
    cards = []
    for line in text.splitlines():
        if line.startswith("**"):
            continue
        cells = [c.strip() for c in line.split(",")]
        if line.startswith("*"):
            options = dict(c.split("=", 1) if "=" in c else (c, "") for c in cells[1:])
            cards.append(Card(cells[0], options, []))
        else:
            cards[-1].rows.append(cells)
    return cards


def flat(card):
    return [c for row in card.rows for c in row if c]


@pytest.fixture(params=[("C3D20R", "quarter"), ("C3D20", "full"), ("S8R", "full")], ids=lambda p: "-".join(p))
def written(request, device_mesh, make_case, tmp_path):
    """(model, deck's cards, stage times) of a device with E_hat = 0.5."""
    element, symmetry = request.param
    case = make_case(mesh=Mesh(element=element, symmetry=symmetry), ventricular_pressure=VENTRICULAR,
                     actuation_pressure_max=MAXIMUM, stiffness_ratio=0.5)  # fmt: skip
    model = build_model(case, device_mesh("limo", 8, symmetry))
    times = write_deck(model, tmp_path / "deck.inp")
    return model, parse_deck((tmp_path / "deck.inp").read_text()), times


def cards_of(cards, name, **options):
    return [c for c in cards if c.name == name and options.items() <= c.options.items()]


# --------------------------------------------------------------------------------------------------------------------
# the clock


@pytest.mark.parametrize("preset", ["fast", "paper"])
def test_solver_clock_keeps_damping_times_rate(loaded, preset):
    """Quasi-statically only damping over duration matters: alpha_solver / solver time = alpha_stage / time, stage by stage."""
    numerics = loaded.config.numerics_presets[preset]
    times = stage_times(numerics, MAXIMUM)
    solver_damping = max(getattr(numerics, s).damping for s in PLANNED)
    for time, following in zip(times, [*times[1:], None], strict=True):
        stage = getattr(numerics, time.name)
        duration = stage.duration or MAXIMUM / stage.rate
        assert solver_damping / time.duration == pytest.approx(stage.damping / duration)
        assert following is None or following.start == pytest.approx(time.end)
    assert [t.name for t in times] == ["fit", "hold", "ramp"]
    assert times[0].start == 0


def test_undamped_stages_run_in_their_own_time(loaded):
    numerics = loaded.config.numerics_presets["paper"]
    undamped = numerics.model_copy(update={s: getattr(numerics, s).model_copy(update={"damping": 0.0}) for s in PLANNED})
    durations = [t.duration for t in stage_times(undamped, MAXIMUM)]
    assert durations == pytest.approx([numerics.fit.duration, numerics.hold.duration, MAXIMUM / numerics.ramp.rate])


def test_actuation_pressure_is_zero_until_the_ramp_then_rises_at_its_rate(loaded):
    numerics = loaded.config.numerics_presets["fast"]
    times = stage_times(numerics, MAXIMUM)
    ramp = times[-1]
    at = actuation_pressure_at(times, MAXIMUM, np.array([0.0, ramp.start, ramp.start + 7.0 * ramp.scale, ramp.end, 2 * ramp.end]))
    np.testing.assert_allclose(at, [0.0, 0.0, 7.0 * numerics.ramp.rate, MAXIMUM, MAXIMUM])


# --------------------------------------------------------------------------------------------------------------------
# the deck


def test_no_data_line_has_more_than_sixteen_entries(written):
    _, cards, _ = written
    assert max(len([c for c in row if c]) for card in cards for row in card.rows) <= 16


def test_nodes_and_elements_come_back_as_they_were(written):
    model, cards, _ = written
    (node_card,), (element_card,) = cards_of(cards, "*NODE"), cards_of(cards, "*ELEMENT")
    rows = np.array(node_card.rows, float)
    np.testing.assert_array_equal(rows[:, 0], np.arange(1, len(model.nodes) + 1))
    np.testing.assert_allclose(rows[:, 1:], model.nodes, atol=1e-9)
    expected = model.mesh.quads if model.element.is_shell else model.expansion.bricks
    read = np.array(flat(element_card), int).reshape(len(expected), -1)
    np.testing.assert_array_equal(read[:, 0], np.arange(1, len(expected) + 1))
    np.testing.assert_array_equal(read[:, 1:] - 1, expected)
    assert element_card.options["TYPE"] == model.element.name


def test_two_materials_cover_the_device(written):
    model, cards, _ = written
    sets = {c.options["ELSET"]: np.array(flat(c), int) - 1 for c in cards_of(cards, "*ELSET")}
    modulus = {"FABRIC": 267.0, "ENDOCARDIUM": 0.5 * 267.0}
    assert [c.options["NAME"] for c in cards_of(cards, "*MATERIAL")] == list(modulus)
    for name, elastic in zip(modulus, cards_of(cards, "*ELASTIC"), strict=True):
        assert [float(c) for c in flat(elastic)] == pytest.approx([modulus[name], 0.33])
        (section,) = [c for c in cards if c.name.endswith("SECTION") and c.options["ELSET"] == name]
        assert section.name == ("*SHELL SECTION" if model.element.is_shell else "*SOLID SECTION")
        assert section.options["MATERIAL"] == name
        assert flat(section) == (["0.19"] if model.element.is_shell else [])
    densities = [float(flat(c)[0]) for c in cards_of(cards, "*DENSITY")]
    assert densities == pytest.approx([8.947e-10] * 2, rel=1e-4), "170 g/m^2 over 0.19 mm in t/mm^3"
    np.testing.assert_array_equal(np.sort(np.concatenate([sets[n] for n in modulus])), np.arange(len(model.mesh.quads)))
    np.testing.assert_array_equal(sets["ENDOCARDIUM"], np.flatnonzero(model.mesh.layer == 1))


def test_every_layer_carries_its_pressure(written):
    """At the end P_v, P_v - P_a,max and P_a,max in MPa, on the inner side; the ramp starts from P_v, P_v and 0."""
    model, cards, times = written
    sets = {c.options["ELSET"]: np.array(flat(c), int) - 1 for c in cards_of(cards, "*ELSET")}
    pv, pa = VENTRICULAR * 1e-3, MAXIMUM * 1e-3
    ends = {"WALL": (pv, pv), "ENDO": (pv, pv - pa), "EPI": (0.0, pa)}
    loads = cards_of(cards, "*DLOAD")
    assert len(loads) == len(model.pressures)
    loaded_quads = []
    for load in loads:
        ((surface, label, factor),) = load.rows
        (amplitude,) = cards_of(cards, "*AMPLITUDE", NAME=load.options["AMPLITUDE"])
        values = np.array(flat(amplitude), float).reshape(-1, 2)
        layer, face = surface.split("_")
        sign = -1.0 if face == "BACK" and model.element.is_shell else 1.0
        expected_label = "P" if model.element.is_shell else ("P1" if face == "FRONT" else "P2")
        assert (label, float(factor)) == (expected_label, 1.0)
        assert (np.diff(values[:, 0]) > 0).all()
        np.testing.assert_allclose(np.interp([times[0].end, times[1].end], *values.T), sign * ends[layer][0], atol=1e-15)
        assert values[-1] == pytest.approx([times[-1].end, sign * ends[layer][1]])
        assert values[0].tolist() == [0.0, 0.0]
        np.testing.assert_array_equal(sets[surface], model.mesh.surfaces[surface.lower()])
        loaded_quads.append(sets[surface])
    np.testing.assert_array_equal(np.sort(np.concatenate(loaded_quads)), np.arange(len(model.mesh.quads)))


def test_constraints_come_back_as_they_were(written):
    model, cards, times = written
    first_step = next(k for k, c in enumerate(cards) if c.name == "*STEP")
    equations = [
        tuple((int(n) - 1, int(d) - 1, float(c)) for n, d, c in np.array(card.rows[1]).reshape(-1, 3))
        for card in cards_of(cards, "*EQUATION")
    ]
    assert equations == [e.terms for e in model.equations]
    assert all(int(c.rows[0][0]) == len(c.rows[1]) // 3 for c in cards_of(cards, "*EQUATION"))
    fixed = [r for c in cards_of(cards[:first_step], "*BOUNDARY") for r in c.rows]
    assert [(int(n) - 1, int(d) - 1) for n, d, _ in fixed] == list(model.fixed)
    (ramped,) = cards_of(cards[first_step:], "*BOUNDARY")
    assert all(r[1] == r[2] for r in ramped.rows)
    values = {(int(n) - 1, int(d) - 1): float(u) for n, d, _, u in ramped.rows}
    assert values == pytest.approx(model.prescribed, abs=1e-9)
    (fitting,) = cards_of(cards, "*AMPLITUDE", NAME=ramped.options["AMPLITUDE"])
    np.testing.assert_allclose(np.array(flat(fitting), float), [0, 0, times[0].end, 1, times[-1].end, 1])


def test_one_dynamic_step_lasts_as_long_as_all_stages(written):
    model, cards, times = written
    (step,), (dynamic,) = cards_of(cards, "*STEP"), cards_of(cards, "*DYNAMIC")
    assert "NLGEOM" in step.options
    assert cards[-1].name == "*END STEP"
    assert float(dynamic.options["ALPHA"]) == pytest.approx(model.numerics.hht_alpha)
    first, length, smallest, largest = map(float, flat(dynamic))
    assert length == pytest.approx(times[-1].end)
    assert smallest < first <= largest <= length


def test_damping_is_that_of_the_most_damped_stage(written):
    _, cards, times = written
    expected = max(t.stage.damping for t in times)
    assert [float(c.options["ALPHA"]) for c in cards_of(cards, "*DAMPING")] == [expected] * 2


def test_displacements_are_written_at_every_increment(written):
    model, cards, _ = written
    (output,) = cards_of(cards, "*NODE OUTPUT")
    assert output.options["FREQUENCY"] == "1"
    assert flat(output) == ["U"]
    assert (output.options.get("OUTPUT") == "2D") == model.element.is_shell, "3D output renumbers the nodes of shells"


def test_writing_twice_gives_the_same_bytes(written, tmp_path):
    model, _, _ = written
    write_deck(model, tmp_path / "again.inp")
    assert (tmp_path / "again.inp").read_bytes() == (tmp_path / "deck.inp").read_bytes()
