"""Predicted times: monotonic, learned from what finished, and a schedule that is nearly the best."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st

from limo.cases.case import describe
from limo.cases.cost import duration, memory_mib, predict, prior_seconds, ranks, schedule
from limo.cases.solved import Solved
from limo.schema.numerics import Mesh, MeshLevel
from limo.store.statuses import SolveStatus


def solved(case, seconds, status="converged"):
    return Solved(case.case_id, describe(case), SolveStatus(status=status, solver_cpu_seconds=seconds))


def at_level(make_case, dof, **changes):
    return make_case(mesh_level=MeshLevel(degrees_of_freedom=dof), **changes)


def test_prior_is_near_what_was_measured(make_case):
    """Quarter model of level preview up to 60 kPa, stock solver."""
    measured = {4: 418, 6: 280, 8: 464, 10: 208}
    guessed = predict([at_level(make_case, 21000, n_pouches=n) for n in measured])
    assert np.all(np.abs(np.log(np.array(guessed) / list(measured.values()))) < np.log(2))
    assert sum(guessed) == pytest.approx(sum(measured.values()), rel=0.3)


def test_cost_grows_with_size_pressure_and_part_of_the_device(make_case):
    known = [solved(at_level(make_case, d, n_pouches=n), s) for d, n, s in [(21000, 4, 900), (70000, 8, 300), (21000, 8, 700)]]
    for evidence in ([], known):
        sizes = predict([at_level(make_case, d) for d in (12000, 21000, 70000, 250000, 400000)], evidence)
        assert sizes == sorted(sizes)
        parts = predict([make_case(mesh=Mesh(symmetry=s)) for s in ("quarter", "front_back", "full")], evidence)
        assert parts == sorted(parts)
    further = predict([make_case(actuation_pressure_max=p) for p in (20.0, 60.0, 140.0)])
    assert further == sorted(further)


def test_shells_take_as_long_as_measured_and_a_way_back_as_long_as_the_ramp(make_case, root):
    """The standard set: what its solutions took, on the machine that solved them."""
    with xr.open_dataset(root / "docs/gallery/standard/data/afterload.nc") as kept:
        measured = kept.solver_time.squeeze().sum("branch").to_series() / 2
    shells = {"mesh": Mesh(level="medium", element="SHELL8R"), "engine": "newton"}
    guessed = [
        predict([at_level(make_case, 250000, n_pouches=n, ventricular_pressure=p, actuation_pressure_max=most, **shells)])[0]
        for n in (4, 6, 8, 10)
        for p, most in ((3.8, 60.0), (13.8, 100.0), (23.8, 140.0))
    ]
    assert sum(guessed) == pytest.approx(measured.sum(), rel=0.35)
    assert memory_mib(at_level(make_case, 250000, **shells)) < memory_mib(at_level(make_case, 250000, engine="newton"))
    up, back = predict([make_case(), make_case(cycle=((make_case().ventricular_pressure, 0.0),))])
    assert 1.5 * up < back < 2 * up


def test_finished_cases_correct_the_prior(make_case):
    """On a machine that is three times as slow everywhere."""
    cases = [make_case(n_pouches=n, ventricular_pressure=p) for n in (4, 6, 8) for p in (3.8, 13.8)]
    known = [solved(c, 3 * prior_seconds(c.to_dict())) for c in cases]
    (other,) = predict([make_case(n_pouches=10, ventricular_pressure=23.8)], known)
    assert other / prior_seconds(make_case(n_pouches=10).to_dict()) == pytest.approx(3.0, rel=0.1)


def test_small_cases_tell_little_about_large_ones(make_case):
    """Previews that took three times their prior do not make a case at `medium` three times as dear."""
    small = [at_level(make_case, 21000, n_pouches=n) for n in (4, 6, 8, 10)]
    known = [solved(case, 3 * prior_seconds(case.to_dict())) for case in small]
    large, again = at_level(make_case, 250000), at_level(make_case, 21000)
    assert predict([again], known)[0] == pytest.approx(3 * prior_seconds(again.to_dict()), rel=0.25)
    assert predict([large], known)[0] < 1.5 * prior_seconds(large.to_dict())


def test_a_near_case_tells_more_than_a_far_one(make_case):
    known = [
        solved(make_case(n_pouches=n), f * prior_seconds(make_case(n_pouches=n).to_dict())) for n, f in ((4, 4.0), (10, 0.5))
    ]
    few, many = predict([make_case(n_pouches=4, aspect_ratio=2.1), make_case(n_pouches=10, aspect_ratio=2.1)], known)
    assert few / prior_seconds(make_case(n_pouches=4).to_dict()) > 2
    assert many / prior_seconds(make_case(n_pouches=10).to_dict()) < 1


def test_cases_that_failed_or_cannot_be_read_and_other_kinds_tell_nothing(make_case):
    case = make_case()
    useless = [
        *(solved(case, 1e6, status) for status in ("diverged", "timed_out", "crashed")),
        solved(case, 0.0),
        solved(case, None),
        solved(make_case(numerics_name="paper"), 1e6),
        Solved("x", {}, SolveStatus(status="converged", solver_cpu_seconds=1e6)),
        Solved("x", {"case": {"n_pouches": 4}}, SolveStatus(status="converged", solver_cpu_seconds=1e6)),
    ]
    assert predict([case], useless) == predict([case])


def test_longest_first():
    assert ranks({"a": 5.0, "b": 9.0, "c": 1.0}) == {"c": 1, "a": 2, "b": 3}
    assert ranks({"a": 5.0, "b": 9.0, "c": 1.0}, {"c"}) == {"c": 3, "b": 2, "a": 1}, "what others wait for"
    assert ranks({}) == {}


@given(st.lists(st.just(0.0) | st.floats(1e-6, 1e5), max_size=40), st.integers(1, 8))
def test_schedule_lies_between_its_bounds(costs, cores):
    wall = schedule(costs, cores)
    best = max([sum(costs) / cores, *costs], default=0.0)
    greedy = sum(costs) / cores + (1 - 1 / cores) * max(costs, default=0.0)  # Graham: no list in any order takes longer
    assert best * (1 - 1e-9) <= wall <= greedy * (1 + 1e-9)
    assert schedule(costs, 1) == pytest.approx(sum(costs))


def test_longest_first_lets_two_cores_finish_together():
    assert schedule([418, 280, 464, 208], 2) == 698


def test_durations_are_for_people():
    assert [duration(s) for s in (0, 41.3, 1370, 19800)] == ["0 s", "41 s", "23 min", "5.5 h"]


def test_memory_is_that_of_the_runs_that_were_measured(loaded, make_case, root):
    rows = pd.read_csv(root / "docs/data/performance.csv")
    rows = rows[(rows.build != "stock") & rows.level.isin(["preview", "paper", "coarse"])].dropna(subset="memory_mib")
    assert len(rows) > 20
    for row in rows.itertuples():
        mesh = Mesh(level=row.level, symmetry=row.symmetry, element="C3D20R")
        case = make_case(engine=row.engine, mesh=mesh, mesh_level=loaded.config.mesh_levels[row.level])
        assert memory_mib(case) == pytest.approx(row.memory_mib, rel=0.25), row
