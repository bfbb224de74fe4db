"""Which case stands for which, from configurations and fabricated results."""

from __future__ import annotations

import os
import shutil
import time
from dataclasses import replace

import pytest

from limo.cases.case import Case, describe, solve_code
from limo.cases.grid import study_cases
from limo.cases.plan import make_plan
from limo.cases.solved import holds, keep, restore, solved_cases
from limo.config.project import Project
from limo.schema.solver import Recovery
from limo.schema.study import Study
from limo.store.files import read_json, stamp_of, write_json
from limo.store.results import CaseFiles


@pytest.fixture
def studies(loaded):
    """``studies(name={...}, ...)``: the shipped configuration with these studies, N_p = 8 at 3.8 kPa unless they say else."""

    def make(build="2.20-abc", **changes) -> Project:
        base = {"axes": {"n_pouches": [8], "ventricular_pressure": [3.8]}, "actuation_pressure_max": 60}
        made = {n: Study(**(base | c)) for n, c in changes.items()}
        return Project(loaded.config, loaded.devices, made, loaded.files, builds={"calculix": build})

    return make


@pytest.fixture
def results(tmp_path):
    """A folder of results, and ``results.solve(plan)``: write what solving a plan would have written."""

    class Results:
        path = tmp_path

        def solve(self, plan, status="converged", reached=None, **changes) -> None:
            for case_id in plan.to_solve:
                case = plan.cases[case_id]
                folder = tmp_path / "cases" / case_id
                at = case.actuation_pressure_max if reached is None else reached
                write_json(folder / "case.json", describe(case) | changes)
                write_json(folder / "status.json", {"status": status, "actuation_pressure_reached": at})

    return Results()


def only(plan, name):
    """The one case that serves a study."""
    (case_id,) = plan.of_study(name)
    return plan.cases[case_id]


# --------------------------------------------------------------------------------------------------------------------
# before anything is solved


def test_the_case_that_goes_furthest_serves_all(studies, results):
    loaded = studies(short={"actuation_pressure_max": 40}, long={"actuation_pressure_max": 60}, middle={})
    plan = make_plan(loaded, results.path)
    assert len(plan.to_solve) == 1
    assert {plan.of_study(n)[0] for n in loaded.studies} == plan.to_solve
    assert only(plan, "short").actuation_pressure_max == 60


def test_what_is_measured_of_a_short_study_is_measured_of_the_case_that_serves_it(studies, results):
    short = {"actuation_pressure_max": 40, "outputs": ["volumes", "stress"], "frames": [0, "max"]}
    plan = make_plan(studies(short=short, long={"frames": [0, "max"], "outputs": ["volumes"]}), results.path)
    (case_id,) = plan.to_solve
    assert plan.cases[case_id].frames == (0.0, 40.0, 60.0)
    assert plan.wanted[case_id].pressures == {"stress": (0.0, 40.0)}


@pytest.mark.parametrize("outputs", [["volumes"], ["volumes", "contact"]])
def test_the_end_of_a_study_without_maps_is_no_frame_of_the_case_that_serves_it(studies, results, outputs):
    short = {"actuation_pressure_max": 40, "frames": [0, 7, "max"], "outputs": outputs}
    plan = make_plan(studies(short=short, long={"frames": [0, "max"], "outputs": ["volumes"]}))
    assert only(plan, "short").frames == (0.0, 7.0, 60.0)
    assert [wanted.outputs for wanted in plan.wanted.values()] == [("contact",)] * (len(outputs) - 1)


@pytest.mark.parametrize(
    "change",
    [
        {"reuse": "exact"},
        {"outputs": ["volumes", "fatigue"]},  # the largest amplitude of the whole ramp
        {"mesh": {"level": "coarse", "symmetry": "quarter"}},
        {"mesh": {"level": "preview", "symmetry": "quarter", "element": "C3D20"}},
        {"mesh": {"level": "preview", "symmetry": "front_back"}},
        {"numerics": "paper"},
        {"axes": {"n_pouches": [8], "ventricular_pressure": [3.8], "stiffness_ratio": [1.0 + 1e-9]}},
    ],
    ids=["exact", "fatigue", "level", "element", "symmetry", "damping", "E_hat by a hair"],
)
def test_nothing_else_serves(studies, results, change):
    plan = make_plan(studies(short={"actuation_pressure_max": 40} | change, long={}), results.path)
    assert len(plan.to_solve) == 2
    assert only(plan, "short").actuation_pressure_max == 40


def test_a_case_that_must_be_solved_for_itself_serves_too(studies, results):
    loaded = studies(strict={"reuse": "exact", "actuation_pressure_max": 60}, short={"actuation_pressure_max": 40})
    assert len(make_plan(loaded, results.path).to_solve) == 1
    loaded = studies(strict={"reuse": "exact"}, loose={"frames": [0, 9]}, longer={"actuation_pressure_max": 80})
    plan = make_plan(loaded, results.path)
    assert len(plan.to_solve) == 2
    assert plan.of_study("strict") == plan.of_study("loose")
    assert 9.0 in only(plan, "strict").frames


def test_a_better_mesh_that_is_not_solved_serves_nobody(studies, results):
    loaded = studies(quick={"reuse": "better"}, good={"mesh": {"level": "coarse", "symmetry": "quarter"}})
    assert len(make_plan(loaded, results.path).to_solve) == 2


# --------------------------------------------------------------------------------------------------------------------
# afterwards


def test_a_plan_stays_as_it_was_when_its_cases_are_solved(studies, results):
    stress = {"actuation_pressure_max": 50, "outputs": ["volumes", "stress"]}
    loaded = studies(a={}, b=stress, c={"actuation_pressure_max": 40}, d={"reuse": "exact", "actuation_pressure_max": 30})
    before = make_plan(loaded, results.path)
    results.solve(before)
    after = make_plan(loaded, results.path)
    assert not after.to_solve
    assert (after.served, after.wanted) == (before.served, before.wanted)
    assert {n: c.to_dict() for n, c in after.cases.items()} == {n: c.to_dict() for n, c in before.cases.items()}


@pytest.mark.parametrize(
    ("change", "solves"),
    [
        ({"actuation_pressure_max": 50}, False),
        ({"frames": [0]}, False),
        ({"frames": [0, "P_v", 25]}, True),
        ({"actuation_pressure_max": 61}, True),
        ({"actuation_pressure_max": 50, "reuse": "exact"}, True),
        ({"actuation_pressure_max": 50, "outputs": ["volumes", "stress"]}, True),  # nobody kept a frame at 50 kPa
        ({"outputs": ["volumes", "stress"]}, False),
        ({"numerics": "paper"}, True),
        ({"description": "other words", "reuse": "better"}, False),
    ],
)
def test_what_a_solved_case_still_serves_when_its_study_changes(studies, results, change, solves):
    results.solve(make_plan(studies(a={}), results.path))
    plan = make_plan(studies(a=change), results.path)
    assert bool(plan.to_solve) == solves
    for case_id in plan.to_solve:
        wanted = studies(a=change).studies["a"]
        assert plan.cases[case_id].actuation_pressure_max == wanted.actuation_pressure_max, "no further than needed"


def test_a_new_frame_keeps_those_that_are_there(studies, results):
    results.solve(make_plan(studies(a={"frames": [0, 5, "max"]}), results.path))
    plan = make_plan(studies(a={"frames": [0, 9, "max"]}), results.path)
    assert only(plan, "a").frames == (0.0, 5.0, 9.0, 60.0)
    results.solve(plan)
    assert not make_plan(studies(a={"frames": [0, 9, "max"]}), results.path).to_solve


def test_the_least_further_case_is_chosen_and_the_own_one_before_it(studies, results):
    results.solve(make_plan(studies(a={"actuation_pressure_max": 80}), results.path))
    results.solve(make_plan(studies(a={"actuation_pressure_max": 70, "reuse": "exact"}), results.path))
    assert only(make_plan(studies(a={}), results.path), "a").actuation_pressure_max == 70
    results.solve(make_plan(studies(a={"reuse": "exact"}), results.path))
    assert only(make_plan(studies(a={}), results.path), "a").actuation_pressure_max == 60


def test_a_better_mesh_serves_who_says_so_and_may_go_further_too(studies, results):
    good = {"mesh": {"level": "coarse", "symmetry": "quarter"}, "actuation_pressure_max": 80}
    results.solve(make_plan(studies(good=good), results.path))
    assert make_plan(studies(quick={}), results.path).to_solve
    plan = make_plan(studies(quick={"reuse": "better"}), results.path)
    assert not plan.to_solve
    assert only(plan, "quick").mesh.level == "coarse"
    worse = {"reuse": "better", "mesh": {"level": "medium", "symmetry": "quarter"}}
    assert make_plan(studies(quick=worse), results.path).to_solve, "a coarser one is not better"


def test_another_build_or_other_code_starts_anew(studies, results):
    first = make_plan(studies(a={}), results.path)
    results.solve(first)
    other = make_plan(studies(build="2.22-def", a={}), results.path)
    assert other.to_solve
    assert other.to_solve.isdisjoint(first.cases)
    results.solve(first, code="of another day")
    assert make_plan(studies(a={}), results.path).to_solve == first.to_solve
    shorter = make_plan(studies(a={"actuation_pressure_max": 50}), results.path)
    assert only(shorter, "a").actuation_pressure_max == 50, "who has to be solved again stops where it may"


# --------------------------------------------------------------------------------------------------------------------
# failures


def test_a_case_that_failed_beyond_a_study_serves_it(studies, results):
    results.solve(make_plan(studies(a={}), results.path), "diverged", 55.0)
    assert not make_plan(studies(a={"actuation_pressure_max": 50}), results.path).to_solve


def test_a_case_that_failed_earlier_serves_only_beside_the_study_that_asked_for_it(studies, results):
    loaded = studies(long={}, short={"actuation_pressure_max": 50})
    results.solve(make_plan(loaded, results.path), "diverged", 30.0)
    assert not make_plan(loaded, results.path).to_solve, "it would fail again at the same increment"
    alone = make_plan(studies(short={"actuation_pressure_max": 50}), results.path)
    assert only(alone, "short").actuation_pressure_max == 50
    assert alone.to_solve


def test_a_better_case_that_failed_does_not_stand_in_the_way(studies, results):
    good = {"mesh": {"level": "coarse", "symmetry": "quarter"}}
    results.solve(make_plan(studies(good=good), results.path), "crashed", 3.0)
    plan = make_plan(studies(good=good, quick={"reuse": "better"}), results.path)
    assert only(plan, "quick").mesh.level == "preview"


@pytest.mark.parametrize(
    "spoil",
    [
        lambda folder: (folder / "case.json").unlink(),
        lambda folder: (folder / "case.json").write_text("{"),
        lambda folder: (folder / "case.json").write_text("[]"),
        lambda folder: (folder / "status.json").write_text(""),
        lambda folder: write_json(folder / "case.json", {"case": {}, "code": ""}),
        shutil.rmtree,
    ],
)
def test_a_folder_that_cannot_be_read_is_no_result(studies, results, spoil):
    plan = make_plan(studies(a={}), results.path)
    results.solve(plan)
    (case_id,) = plan.to_solve
    spoil(results.path / "cases" / case_id)
    assert make_plan(studies(a={}), results.path).to_solve == {case_id}


def test_a_folder_under_another_name_or_of_another_version_serves_nobody(studies, results):
    plan = make_plan(studies(a={}), results.path)
    results.solve(plan)
    (case_id,) = plan.to_solve
    (results.path / "cases" / case_id).rename(results.path / "cases" / f"{case_id[:-10]}0123456789")
    assert make_plan(studies(a={"actuation_pressure_max": 50}), results.path).to_solve
    (one,) = solved_cases(results.path)[0].values()
    assert one.case is None


def test_cases_of_a_grid_are_served_by_their_like(studies, results):
    axes = {"n_pouches": [4, 8], "ventricular_pressure": [3.8, 13.8], "aspect_ratio": [1, 2], "stiffness_ratio": [0.5, 1]}
    loaded = studies(a={"axes": axes}, b={"axes": axes, "actuation_pressure_max": 50})
    plan = make_plan(loaded, results.path)
    assert len(plan.to_solve) == 16
    for key, case in study_cases(loaded, "b").items():
        serving = plan.cases[plan.served["b"][key]]
        assert serving.label == case.label
        assert serving.path == case.path


def test_holding_frames_is_a_matter_of_tolerance():
    assert holds((0.0, 13.8), {13.8 + 1e-9})
    assert holds((), set())
    assert not holds((0.0, 13.8), {13.9})


def test_a_case_describes_itself_with_the_code_that_solves_it(make_case):
    described = describe(make_case())
    assert Case.from_dict(described["case"]) == make_case()
    assert described["code"] == solve_code("calculix")


# --------------------------------------------------------------------------------------------------------------------
# what is solved again: interrupted cases, damaged files, another ladder


def rewritten(results, plan, **status):
    """The one case of a plan on disk with other words in its status, as if it had been solved with today's recovery."""
    (case_id,) = plan.to_solve
    base = {"status": "converged", "actuation_pressure_reached": 60.0, "recovery": plan.recovery_of(case_id)}
    write_json(results.path / "cases" / case_id / "status.json", base | status)
    return case_id


def with_ladder(loaded, *names):
    """The same configuration with another ladder of CalculiX."""
    rungs = {"calculix": [{"name": n, "multiply": {"first_increment": 0.5}} for n in names]}
    config = loaded.config.model_copy(update={"recovery": Recovery.model_validate(rungs)})
    return Project(config, loaded.devices, loaded.studies, loaded.files, builds=loaded.builds)


def test_a_case_whose_solver_was_killed_is_solved_again_until_it_is_settled(studies, results):
    loaded = studies(one={})
    plan = make_plan(loaded, results.path)
    results.solve(plan)
    case_id = rewritten(results, plan, status="crashed", interrupted=True)
    again = make_plan(loaded, results.path)
    assert again.to_solve == {case_id}
    assert again.recovery_of(case_id) != plan.recovery_of(case_id), "a change that Snakemake sees"
    rewritten(results, again)
    settled = make_plan(loaded, results.path)
    assert not settled.to_solve
    assert settled.recovery_of(case_id) == again.recovery_of(case_id)


def test_another_ladder_solves_again_what_failed_and_nothing_else(studies, results):
    loaded = studies(one={})
    plan = make_plan(loaded, results.path)
    results.solve(plan)
    case_id = rewritten(results, plan)
    changed = make_plan(with_ladder(loaded, "a"), results.path)
    assert not changed.to_solve
    assert changed.recovery_of(case_id) == plan.recovery_of(case_id)
    tried = [{"rung": "as configured", "status": "diverged"}, {"rung": "smaller_start", "status": "converged"}]
    for attempts in (tried, tried[:1]):
        rewritten(results, plan, status=attempts[-1]["status"], attempts=attempts)
        assert not make_plan(loaded, results.path).to_solve
        changed = make_plan(with_ladder(loaded, "a"), results.path)
        assert changed.to_solve == {case_id}
        assert changed.recovery_of(case_id) != plan.recovery_of(case_id)


def test_a_degraded_case_is_a_result(studies, results):
    loaded = studies(one={})
    plan = make_plan(loaded, results.path)
    results.solve(plan, status="degraded")
    assert not make_plan(loaded, results.path).to_solve
    assert make_plan(loaded, results.path).solved.popitem()[1].status.reached == float("inf")


@pytest.mark.parametrize("damage", ["cut", "changed", "gone", "other size"])
def test_a_case_whose_files_are_damaged_is_solved_again(studies, results, damage):
    loaded = studies(one={})
    plan = make_plan(loaded, results.path)
    results.solve(plan)
    (case_id,) = plan.to_solve
    file = results.path / "cases" / case_id / "volumes.nc"
    file.write_bytes(b"some volumes")
    rewritten(results, plan, files={"volumes.nc": stamp_of(file)})
    assert not make_plan(loaded, results.path).to_solve
    file.touch()
    assert not make_plan(loaded, results.path).to_solve, "touched is not changed"
    if damage == "gone":
        file.unlink()
    else:
        file.write_bytes({"cut": b"some vol", "changed": b"SOME volumes", "other size": b"some more volumes"}[damage])
        os.utime(file, (time.time() + 10, time.time() + 10))
    again = make_plan(loaded, results.path)
    assert again.to_solve == {case_id}
    assert again.recovery_of(case_id) != plan.recovery_of(case_id)


@pytest.fixture
def written(studies, results):
    """A case as a solve leaves it, with second names: case, folder, and what its solve was called."""
    plan = make_plan(studies(one={}), results.path)
    results.solve(plan)
    case_id = rewritten(results, plan)
    folder = results.path / "cases" / case_id
    for name in ("volumes.nc", "frames.nc"):
        (folder / name).write_bytes(b"numbers")
    status = read_json(folder / "status.json") | {"files": {n: stamp_of(folder / n) for n in ("volumes.nc", "frames.nc")}}
    write_json(folder / "status.json", status)
    keep(folder)
    return plan.cases[case_id], folder, plan.recovery_of(case_id)


def removed(folder):
    """What Snakemake does before it starts a job again that was broken off."""
    for file in CaseFiles(folder).solved:
        file.unlink(missing_ok=True)


def test_a_case_that_was_written_and_not_reported_is_put_back(written):
    case, folder, recovery = written
    before = {file: file.read_bytes() for file in CaseFiles(folder).solved}
    removed(folder)
    assert restore(case, folder, recovery)["status"] == "converged"
    assert {file: file.read_bytes() for file in CaseFiles(folder).solved} == before
    removed(folder)
    assert restore(case, folder, recovery), "as often as it is broken off"


@pytest.mark.parametrize("change", ["case", "recovery", "interrupted", "damaged", "nothing kept"])
def test_what_is_not_what_is_asked_for_is_not_put_back(written, change):
    case, folder, recovery = written
    removed(folder)
    aside = folder / ".kept"
    if change == "case":
        case = replace(case, frames=(0.0, 1.0))
    elif change == "recovery":
        recovery = "another-0"
    elif change == "interrupted":
        write_json(aside / "status.json", read_json(aside / "status.json") | {"interrupted": True})
    elif change == "damaged":
        (aside / "frames.nc").write_bytes(b"number")
    else:
        (aside / "status.json").unlink()
    assert restore(case, folder, recovery) is None
    assert not any(file.exists() for file in CaseFiles(folder).solved)
