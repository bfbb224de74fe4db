"""What an exploration may say, designs as studies, and rounds that learn from what came of those before."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import yaml

from limo.cases.grid import study_cases
from limo.config.load import load_config
from limo.config.yaml_file import parse
from limo.errors import ConfigError, LimoError, ResultError
from limo.explore.checks import check_designs, largest_volume
from limo.explore.claims import shares
from limo.explore.designs import can_be_made, own_design, project_of, space_of, study_of, with_studies, written
from limo.explore.found import dataset_of, held_out_of, known_from
from limo.explore.learn import Corrected, quality_of
from limo.explore.recommend import recommended, robust
from limo.explore.rounds import count_of, explored, preset_of, read_exploration, rounds_on_disk, write_round
from limo.explore.sampling import sample
from limo.explore.search import propose
from limo.explore.steps import held_out, is_over, learn, learned_of, propose_round, solved_finely
from limo.explore.surrogate import Process, TwoFidelities
from limo.explore.telling import Told, tell, violation
from limo.figures import exploration as figures
from limo.figures import style
from limo.reports.exploration import compared, keep_exploration, kept_page, page
from limo.reports.explorations import beside_chance
from limo.schema.exploration import Exploration
from limo.store.files import write_netcdf
from limo.store.results import Results

from .stand_in import goals

CONTENT = {
    "space": {
        "n_pouches": [4, 6, 8, 10],
        "aspect_ratio": [1, 3],
        "stiffness_ratio": [0.5, 1.5],
        "thickness": [0.12, 0.3],
        "seam_shift": [-0.15, 0.15],
    },
    "at": {"ventricular_pressure": [13.8], "actuation_pressure_max": 100},
    "goals": {"efficiency_90ml": "maximise", "von_mises_peak": "minimise"},
    "constraints": {"stroke_volume": ">= 90", "contact_front_back": "none"},
    "budget": {"shells": 48, "standard": 8},
    "baseline": 8,
    "tolerance": {"thickness": 0.01},
}


def exploration(**changes) -> Exploration:
    return Exploration.model_validate(CONTENT | changes)


@pytest.fixture(scope="module")
def project(root):
    return load_config(root / "config/config.yaml")


# --- what it may say ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"space": {"n_pouches": [8]}}, "at least 2"),
        ({"space": {"n_pouches": 8}}, "one range at least"),
        ({"space": {"n_pouches": [4, 8], "thickness": [0.3, 0.12]}}, "a lower and a higher end"),
        ({"space": {"n_pouches": [4, 8], "thickness": []}}, "at least 2"),
        ({"space": {"n_pouches": [4, 8], "aspect_ratio": [0.5, 3]}}, "greater than or equal to 1"),
        ({"space": {"n_pouches": [4, 4]}}, "none twice"),
        ({"goals": {}}, "at least 1"),
        ({"goals": {"efficiency_90ml": "more"}}, "'maximise' or 'minimise'"),
        ({"constraints": {"stroke_volume": "90"}}, "a bound such as '>= 90'"),
        ({"budget": {"shells": 120}}, "at least 2"),
        ({"budget": {"shells": 10, "standard": 5}}, "more than 10 designs for 5 inputs"),
        ({"budget": {"shells": 48, "standard": 48}}, "many designs by one preset"),
        ({"first": 49}, "first and held_out within the budget"),
        ({"first": 40, "held_out": 10}, "first and held_out within the budget"),
        ({"held_out": 30}, "held_out of at most half"),
        ({"worth": 1}, "less than 1"),
        ({"baseline": 12}, "baseline as one of"),
    ],
    ids=lambda x: str(x)[:40],
)
def test_what_cannot_be_is_one_message(tmp_path, changes, words):
    with pytest.raises(ConfigError) as error:
        parse(Exploration, CONTENT | changes, tmp_path / "best.yaml")
    assert words in str(error.value)
    assert "best.yaml" in str(error.value)


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"goals": {"beauty": "maximise"}}, "goals.beauty"),
        ({"constraints": {"beauty": "none"}}, "constraints.beauty"),
        ({"budget": {"shells": 48, "exact": 5}}, "preset"),
        ({"device": "heart"}, "device"),
        ({"constraints": {"stroke_volume": ">= 500"}}, "constraints.stroke_volume"),
        ({"constraints": {"efficiency_90ml": ">= 1"}}, "constraints.efficiency_90ml"),
        ({"at": {"ventricular_pressure": [13.8], "actuation_pressure_max": 10}}, "actuation_pressure_max"),
    ],
    ids=lambda x: str(x)[:40],
)
def test_what_the_project_does_not_have_is_refused_before_anything_is_solved(project, tmp_path, changes, key):
    with pytest.raises(ConfigError) as error:
        check_designs(project, exploration(**changes), tmp_path / "best.yaml")
    assert error.value.key == key
    assert error.value.example


def test_no_device_holds_more_than_a_sphere_of_its_fabric(project):
    """The device holds 300 ml; its bound grows with the area."""
    pattern = project.devices["limo"].pattern
    most = largest_volume(pattern, 8)
    assert 350 < most < 480
    assert largest_volume(pattern, 4) == pytest.approx(most, rel=2e-3), "the outline is that of all devices"
    wider = pattern.model_copy(update={"width_scale": 1.1})
    assert 1.1 < largest_volume(wider, 8) / most < 1.1**1.5, "all but the valve edge is wider"


def test_explorations_of_the_project_are_sound_and_none_has_the_name_of_a_study(project, root, tmp_path):
    names = [file.stem for file in (root / "config/explorations").glob("*.yaml")]
    found = {name: read_exploration(project, root / "config/config.yaml", name) for name in names}
    assert "best_heart" in found
    assert sum(found["best_heart"].rounds) == found["best_heart"].searched
    (tmp_path / "explorations").mkdir()
    (tmp_path / "explorations/afterload.yaml").write_text(yaml.safe_dump(CONTENT))
    with pytest.raises(ConfigError, match="no study has"):
        read_exploration(project, tmp_path / "config.yaml", "afterload")


def test_the_preset_of_more_designs_is_the_cheap_one_in_any_order():
    for budget in ({"shells": 48, "standard": 5}, {"standard": 5, "shells": 48}):
        assert (exploration(budget=budget).cheap, exploration(budget=budget).fine) == ("shells", "standard")


# --- designs --------------------------------------------------------------------------------------------------------------


def test_a_design_is_a_study_with_its_numbers(project):
    one = exploration()
    design = written(one, {"n_pouches": 8.0, "aspect_ratio": 1.5, "stiffness_ratio": 0.8, "thickness": 0.25, "seam_shift": 0.1})
    made = project_of(project, one, {"d": design}, "shells")
    (case,) = study_cases(made, "d").values()
    assert (case.n_pouches, case.aspect_ratio, case.stiffness_ratio, case.ventricular_pressure) == (8, 1.5, 0.8, 13.8)
    assert case.device.material.thickness == 0.25
    assert case.device.material.areal_density == pytest.approx(170 * 0.25 / 0.19, abs=1e-6), "of the same fibre and coating"
    assert case.device.pattern.seams.fractions[8] == [0.0, 1.1]
    study = made.studies["d"]
    assert {"stress", "contact", "volumes"} == set(study.outputs)
    own = own_design(one, project.devices["limo"])
    (as_it_is,) = list(study_cases(project_of(project, one, {"d": own}, "shells"), "d").values())
    assert as_it_is.device == project.devices["limo"]


def test_layouts_that_cannot_be_cut_are_no_designs(project):
    """Seams of ten pouches that leave the array are found before anything is meshed."""
    wide = exploration(space={"n_pouches": [4, 10], "seam_shift": [-0.5, 1.0]}, baseline=None, tolerance={})
    allowed = can_be_made(project, wide)
    assert allowed({"n_pouches": 10.0, "seam_shift": 0.0})
    assert not allowed({"n_pouches": 10.0, "seam_shift": 0.9})
    designs = space_of(wide).from_unit(sample(space_of(wide), 16, 1, allowed))
    assert all(allowed(design) for design in designs)
    none = exploration(space={"n_pouches": [10, 12], "seam_shift": [0.9, 1.0]}, baseline=None, tolerance={})
    with pytest.raises(LimoError, match="widen the space"):
        sample(space_of(none), 8, 1, can_be_made(project, none))


def test_a_failed_design_is_told_and_has_no_numbers(project, tmp_path):
    one = exploration()
    made = project_of(project, one, {"d": own_design(one, project.devices["limo"])}, "shells")
    (case,) = study_cases(made, "d").values()
    told = tell(made, one, "d", tmp_path, [case.case_id])
    assert (told.status, told.is_solved) == ("missing", False)
    assert np.isnan(list(told.values.values())).all()


def test_violations_of_bounds_and_of_never():
    one = exploration(constraints={"stroke_volume": ">= 90", "von_mises_max": "<= 40", "contact_front_back": "none"})
    assert violation(one, "stroke_volume", 80) == 10
    assert violation(one, "von_mises_max", 30) == -10
    assert violation(one, "contact_front_back", float("nan")) < 0 < violation(one, "contact_front_back", 55.0)


# --- learning from a closed form in the place of a device -----------------------------------------------------------------


def told_of(design: dict) -> Told:
    """Goals of the stand-in; more than 9 pouches and thick fabric touch, and a little seam shift costs stroke."""
    one = exploration()
    place = space_of(one).to_unit([{**design, "n_pouches": float(design["n_pouches"])}])
    first, second = goals(place)[0]
    touches = 40.0 if design["n_pouches"] == 10 and design["thickness"] > 0.25 else float("nan")
    values = {"efficiency_90ml": -first, "von_mises_peak": second, "stroke_volume": 100 + 100 * design["seam_shift"]}
    values["contact_front_back"] = touches
    if design["thickness"] < 0.13:
        return Told("diverged", "no equilibrium", dict.fromkeys(values, float("nan")), dict.fromkeys(values, float("nan")))
    return Told("converged", "", values, dict.fromkeys(values, 0.0))


@pytest.fixture(scope="module")
def searched(project, tmp_path_factory):
    """A whole search of the stand-in."""
    results, one = Results(tmp_path_factory.mktemp("explored")), exploration(worth=0)
    search(project, results, one)
    return results, one


def search(project, results: Results, one: Exploration) -> list[dict]:
    """Search the stand-in; its files are written as the rules write them. Returns the designs of each round."""
    files, rounds = results.exploration("best"), []
    for number in range(count_of(one)):
        proposed = propose_round(project, "best", one, number, results)
        write_round(files.round(number), proposed)
        told = {}
        for name, design in proposed["designs"].items():
            each = told_of(design)
            plain = [{n: None if np.isnan(v) else v for n, v in values.items()} for values in (each.values, each.scatter)]
            told[name] = {"status": each.status, "reason": each.reason, "values": plain[0], "scatter": plain[1]}
        write_round(files.told(number), {"told": told, "cases": {}})
        rounds.append(proposed["designs"])
    return rounds


def learned_and_held_out(results: Results, one: Exploration):
    """What the rounds on disk teach, and the designs that they never learned from."""
    return learn(one, results, "best", len(one.rounds)), held_out(one, results, "best")


def designs_of(results: Results, numbers) -> list[dict]:
    return [d for n in numbers for d in json.loads(results.exploration("best").round(n).read_text())["designs"].values()]


def test_rounds_spend_the_budget_and_no_design_twice(searched):
    results, one = searched
    designs = designs_of(results, range(len(one.rounds)))
    assert len(designs) == one.searched == 48
    assert len({json.dumps(design, sort_keys=True) for design in designs}) == 48
    assert designs[0] == {"n_pouches": 8, "aspect_ratio": 2.0, "stiffness_ratio": 1.0, "thickness": 0.19, "seam_shift": 0.0}
    assert [preset_of(one, n) for n in (0, len(one.rounds))] == ["shells", "standard"]


def test_later_designs_are_better_and_more_of_them_feasible(searched):
    results, one = searched
    learned, tested = learned_and_held_out(results, one)
    begun = np.arange(len(learned.told)) < one.beginning
    assert learned.feasible[~begun].mean() > learned.feasible[begun].mean()
    assert np.isin(learned.front, np.flatnonzero(~begun)).mean() > 0.6
    assert not learned.feasible[~learned.solved].any(), "what failed is never a number"
    assert (len(learned.told), len(tested.told)) == (44, 4)


def test_designs_that_are_held_out_are_samples_and_nothing_learns_from_them(searched):
    results, one = searched
    learned, tested = learned_and_held_out(results, one)
    assert not {json.dumps(d, sort_keys=True) for d in learned.designs} & {json.dumps(d, sort_keys=True) for d in tested.designs}
    samples = space_of(one).from_unit(sample(space_of(one), one.rounds[0], one.seed))
    assert [written(one, d) for d in samples[-4:]] == list(tested.designs)
    quality = quality_of(learned, tested)["stroke_volume"]
    mean, _ = learned.process("stroke_volume").predict(tested.places[tested.solved])
    error = np.sqrt(np.mean((tested.values("stroke_volume")[tested.solved] - mean) ** 2))
    known = learned.values("stroke_volume")[learned.solved]
    assert quality.held_out.error == pytest.approx(error / np.ptp(known), rel=1e-9)
    assert quality.held_out.designs == tested.solved.sum()


def test_a_surrogate_that_fails_on_designs_held_out_is_not_to_be_used(searched):
    """Leaving out looks fine, as all that was learned from lies on a line; what is held out lies elsewhere."""
    results, one = searched
    learned, tested = learned_and_held_out(results, one)
    moved = [
        Told(t.status, t.reason, t.values | {"stroke_volume": t.values["stroke_volume"] + 50}, t.scatter) for t in tested.told
    ]
    assert quality_of(learned, tested)["stroke_volume"].is_used
    assert not quality_of(learned, learned_of(one, tested.designs, moved))["stroke_volume"].is_used


def test_a_search_that_is_not_worth_it_ends_and_says_so(project, tmp_path):
    """Rounds after two batches of which no design is expected to add enough have no designs; the finer preset goes on."""
    results, one = Results(tmp_path), exploration(worth=0.9, budget={"shells": 60, "standard": 5}, batch=4)
    whole = search(project, results, one)
    assert [len(designs) for designs in whole] == [26, 4, 4, *[0] * 7, 5]
    assert is_over(one, results, "best", 4)
    assert not is_over(exploration(worth=0.0), results, "best", 3)


def test_what_is_recommended_is_feasible_and_says_why(searched):
    results, one = searched
    fine, reasons = solved_finely(one, results, "best")
    why = list(reasons.values())
    assert why[0] == "the device as it is"
    assert len(why) == one.budget["standard"] == len(set(why))
    assert any("robust" in each for each in why)
    assert [each.startswith("proposed by both presets") for each in why] == [False] * 4 + [True] * 4
    told = fine.told[: one.fine_rounds[0]]
    assert all(each.is_solved and violation(one, "stroke_volume", each.values["stroke_volume"]) <= 0 for each in told)


def test_a_robust_design_keeps_away_from_a_bound(searched):
    """With a tolerance as wide as the feasible range of the seam shift, the robust one lies further inside than the best one."""
    results, one = searched
    designs = designs_of(results, range(len(one.rounds)))
    wide = exploration(tolerance={"seam_shift": 0.1}, constraints={"stroke_volume": ">= 97"})
    learned = learned_of(wide, designs, [told_of(design) for design in designs])
    number = robust(learned)
    assert learned.design(number)["seam_shift"] > -0.03
    assert set(recommended(learned, 3).values()) <= set(np.flatnonzero(learned.feasible))


def test_designs_on_disk_are_studies_of_the_project_and_those_of_another_space_are_not(searched, project):
    results, one = searched
    made = explored(project, {"best": one}, results)
    assert len(made.studies) == one.searched + one.budget["standard"]
    assert rounds_on_disk(results, "best", exploration(seed=2)) == []
    assert explored(project, {"best": exploration(seed=2)}, results).studies == {}


def test_the_page_has_front_effects_indices_and_what_is_better_than_the_device(searched, project):
    results, one = searched
    learned, tested = learned_and_held_out(results, one)
    dataset = dataset_of(learned, tested, *solved_finely(one, results, "best"), project.devices["limo"])
    assert (dataset.index_total >= dataset.index_first - 0.1).all()
    assert int(dataset.on_front.sum()) == len(learned.front)
    efficiency = dataset.sel(quantity="stroke_volume")
    strongest = str(dataset.input.values[int(efficiency.index_total.argmax())])
    assert strongest == "seam_shift", "which alone decides the stroke of the stand-in"
    assert float(dataset.sel(quantity="stroke_volume").surrogate_error) < 0.05
    assert bool(dataset.sel(quantity="stroke_volume").surrogate_used)
    drawn = figures.every(dataset)
    assert list(drawn) == ["front", "effects", "slices", "indices", "interactions", "designs"]
    for figure in drawn.values():
        style.close(figure)
    assert figures.names(dataset) == list(drawn)
    write_netcdf(dataset, results.exploration("best").dataset)
    kept = keep_exploration("best", results, results.root / "gallery")
    assert [file.name for file in kept] == ["exploration.nc", *(f"{name}.png" for name in drawn), "README.md"]
    assert kept_page(kept[0]) == kept[-1].read_text()
    with pytest.raises(ResultError, match="no exploration"):
        keep_exploration("none", results, results.root / "gallery")
    text = page(one, "best", dataset, list(drawn), {})
    assert "44 designs by `shells`" in text
    assert "4 more are held out" in text
    assert float(dataset.slice.sel(line=dataset.line[0]).isnull().mean()) < 1
    assert "Beside the device as it is" in compared(one, dataset)


def test_a_surrogate_that_is_no_good_is_not_to_be_used():
    random, one = np.random.default_rng(1), exploration(trusted_below=0.1)
    designs = [written(one, d) for d in space_of(one).from_unit(sample(space_of(one), 40, 1))]
    noise = [
        Told(
            "converged",
            "",
            {q: float(random.normal()) for q in (*one.goals, *one.constraints)},
            {q: 0.0 for q in (*one.goals, *one.constraints)},
        )
        for _ in designs
    ]
    assert not any(tested.is_used for tested in quality_of(learned_of(one, designs, noise)).values())


def test_a_study_of_a_design_of_one_number_of_pouches(project):
    one = exploration(space={"n_pouches": 6, "aspect_ratio": [1, 3]}, baseline=6, tolerance={})
    assert space_of(one).names == ["aspect_ratio"]
    study = study_of(one, written(one, {"aspect_ratio": 2.5}), "shells", project.devices["limo"])
    assert study.axes.n_pouches == [6]


# --- the paper's statements in a larger space -----------------------------------------------------------------------------


def as_the_paper_says(design: dict, sign: float) -> Told:
    """A device of which all statements of the paper hold by a wide margin, or with a negative sign of none but the stroke's."""
    ratio, stiffness = design["aspect_ratio"], design["stiffness_ratio"]
    values = {
        "efficiency_90ml": 0.7 - sign * 0.1 * ((ratio - 2.5) ** 2 + 4 * (stiffness - 0.75) ** 2),
        "stroke_volume": 150 - sign * 8 * (stiffness - 0.75) ** 2,
        "von_mises_peak": 20 + sign * (3 * ratio + 8 * stiffness),
        "contact_front_back": float("nan"),
    }
    return Told("converged", "", values, dict.fromkeys(values, 0.0))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_statements_of_the_paper_are_told_apart_in_a_larger_space(sign):
    one = exploration()
    designs = [written(one, d) for d in space_of(one).from_unit(sample(space_of(one), 64, 1))]
    learned = learned_of(one, designs, [as_the_paper_says(design, sign) for design in designs])
    texts, numbers, held = shares(learned)
    assert numbers == [4, 6, 8, 10]
    assert held.shape == (8, 4)
    for text, row in zip(texts, held, strict=True):
        if "hardly" in text or sign > 0:
            assert (row > 0.85).all(), text
        else:
            assert (row < 0.15).all(), text


def test_a_statement_needs_its_values_in_the_space():
    one = exploration(
        space={"n_pouches": [4, 8], "aspect_ratio": [1, 2], "stiffness_ratio": [0.5, 1.5]}, baseline=None, tolerance={}
    )
    designs = [written(one, d) for d in space_of(one).from_unit(sample(space_of(one), 24, 1))]
    texts, _, held = shares(learned_of(one, designs, [as_the_paper_says(design, 1.0) for design in designs]))
    assert all("E_hat" in text for text in texts), "AR = 2.5 and 3 are beyond the space"
    assert len(texts) == len(held) == 5


# --- both presets ---------------------------------------------------------------------------------------------------------


def test_a_search_by_both_presets_goes_where_the_finer_one_is_better(project):
    """By the finer preset efficiency falls with AR as much as it rises by the cheap one: nothing is proposed at high AR."""
    one = exploration(goals={"efficiency_90ml": "maximise"}, constraints={}, worth=0)
    space = space_of(one)
    designs = [written(one, d) for d in space.from_unit(sample(space, 32, 1))]

    def told(design, slope):
        return Told("converged", "", {"efficiency_90ml": 0.5 + slope * design["aspect_ratio"]}, {"efficiency_90ml": 0.0})

    cheap = learned_of(one, designs, [told(design, 0.1) for design in designs])
    fine = learned_of(one, designs[:8], [told(design, -0.1) for design in designs[:8]])
    by_cheap = propose(space, cheap.knowledge(), 4, 1)
    by_both = propose(space, Corrected(cheap, fine).knowledge(), 4, 1)
    column = space.names.index("aspect_ratio")
    assert by_cheap.places[0, column] > 0.7
    assert by_both.places[0, column] < 0.3
    assert Corrected(cheap, learned_of(one, designs[:3], [told(d, -0.1) for d in designs[:3]])).knowledge() is None


def test_an_added_value_of_the_finer_preset_is_met(project):
    places = sample(space_of(exploration()), 24, 3)
    low = Process(places, places.sum(axis=1), None, 1)
    both = TwoFidelities(low, places[:8], places[:8].sum(axis=1) + 1, None, 1)
    more = both.with_values(places[8:10], np.array([9.0, 8.0]))
    assert more.predict(places[8:10])[0] == pytest.approx([9.0, 8.0], abs=0.05)
    assert both.predict(places[8:10])[0] == pytest.approx(places[8:10].sum(axis=1) + 1, abs=0.05)


# --- what is kept ---------------------------------------------------------------------------------------------------------


def test_a_kept_dataset_teaches_the_same_again(searched, project):
    results, one = searched
    learned, tested = learned_and_held_out(results, one)
    dataset = dataset_of(learned, tested, *solved_finely(one, results, "best"), project.devices["limo"])
    again = known_from(dataset)
    assert again.places == pytest.approx(learned.places)
    assert again.process("stroke_volume").predict(tested.places)[0] == pytest.approx(
        learned.process("stroke_volume").predict(tested.places)[0]
    )
    assert held_out_of(dataset).places == pytest.approx(tested.places)


def test_a_search_is_compared_with_samples_alone(searched, project, tmp_path):
    """Both are explorations of the same space; that without a search spends its budget on samples."""
    results, one = searched
    found, by_chance = Results(tmp_path), exploration(budget={"shells": 48, "standard": 1}, first=48, held_out=0)
    rounds = search(project, found, by_chance)
    assert [len(each) for each in rounds] == [48, 1]
    datasets = []
    for where, asked in ((results, one), (found, by_chance)):
        datasets.append(
            dataset_of(*learned_and_held_out(where, asked), *solved_finely(asked, where, "best"), project.devices["limo"])
        )
    text = beside_chance(*datasets)
    assert "48 designs of the search beside 48 samples" in text
    row = next(line for line in text.splitlines() if line.startswith("| the worst design"))
    assert float(row.split("|")[-2]) > 1.0, "the search dominates more"
    shared = {json.dumps(d, sort_keys=True) for d in learned_and_held_out(results, one)[0].designs}
    unseen = sum(json.dumps(d, sort_keys=True) not in shared for d in rounds[0].values())
    assert f"predict the {unseen} of these samples" in text


def test_every_variable_is_in_the_document_with_its_dimensions(searched, project, root):
    results, one = searched
    dataset = dataset_of(*learned_and_held_out(results, one), *solved_finely(one, results, "best"), project.devices["limo"])
    section = (root / "docs/results.md").read_text(encoding="utf-8").split("## `exploration.nc`")[1].split("\n## ")[0]
    rows = [[cell.strip() for cell in line.split("|")[1:5]] for line in section.splitlines() if line.startswith("| `")]
    told = {name.strip("`"): dims for name, dims, *_ in rows}
    names = {name: "INPUT" for name in space_of(one).names} | {name: "QUANTITY" for name in (*one.goals, *one.constraints)}
    missing = []
    for name, variable in dataset.variables.items():
        plain = name
        for own, word in names.items():
            plain = plain if name in told else plain.replace(own, word)
        group = plain.removeprefix("tested_").removeprefix("recommended_")
        dims = told.get(plain) or told.get(group, "-").replace("design", variable.dims[0] if variable.dims else "")
        if dims != ", ".join(map(str, variable.dims)):
            missing.append((name, variable.dims))
    assert not missing


def test_a_device_without_seams_off_the_axis_has_one_place(project):
    """Four pouches have a seam on the axis alone: to move it is to do nothing, and no budget is spent on that."""
    one = exploration()
    space = space_of(one)
    designs = space.from_unit(sample(space, 64, 1))
    shifts = {n: {d["seam_shift"] for d in designs if d["n_pouches"] == n} for n in (4, 6)}
    assert len(shifts[6]) > 10
    assert [round(shift, 9) for shift in shifts[4]] == [0.0]
    two = [
        study_of(one, written(one, designs[0] | {"n_pouches": 4, "seam_shift": s}), "shells", project.devices["limo"])
        for s in (0, 0.1)
    ]
    cases = [next(iter(study_cases(with_studies(project, {"d": each}), "d").values())) for each in two]
    assert cases[0].case_id == cases[1].case_id, "it is one device"
    with pytest.raises(ConfigError, match="no seam off the axis"):
        parse(Exploration, CONTENT | {"space": {"n_pouches": 4, "seam_shift": [-0.1, 0.1]}}, Path("best.yaml"))
