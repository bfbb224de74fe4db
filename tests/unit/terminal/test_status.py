"""Where cases are, from fabricated folders: nobody's word but that of the files."""

import io
import json
import os
import time

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rich.console import Console

from limo.cases.case import describe
from limo.cases.cost import seconds_left, share_done
from limo.cases.plan import make_plan
from limo.cluster.slurm import Job
from limo.config.project import Project
from limo.engines.calculix.deck import stage_times
from limo.schema.study import Study
from limo.store.files import write_json
from limo.store.progress import report, solving
from limo.terminal.monitor import changes, failed, table, watch
from limo.terminal.status import STATUSES, CaseStatus, Sweep, case_status, short_names, to_plain
from tests.helpers.cases import STATUS

PREDICTED = 400.0


@pytest.fixture
def folder(tmp_path, make_case):
    """The folder of the case, which nobody has begun."""
    return tmp_path / "cases" / make_case().case_id


def begin(folder, case, pressure=None, clock=None, iterations=5):
    """What CalculiX leaves in a folder on its way to a pressure (kPa) of the ramp, or to a time of its clock."""
    times = stage_times(case.numerics, case.actuation_pressure_max)
    end = clock if clock is not None else times[2].start + pressure / case.actuation_pressure_max * times[2].duration
    run = folder / "run"
    run.mkdir(parents=True, exist_ok=True)
    (run / "deck.inp").write_text("** deck\n")
    rows = [(1, 1, "U", 0.0), (1, 2, " ", 0.5 * end), (2, 1, " ", end)]
    sta = "".join(f"     1{n:11d}{a:6d}{u}{4:5d} {t:13.6E} {t:13.6E} {1.0:13.6E}\n" for n, a, u, t in rows)
    (run / "deck.sta").write_text("SUMMARY OF JOB INFORMATION\n  STEP      INC     ATT  ITRS     TOT TIME\n" + sta)
    lines = [f"     1     3     1{k:6d}        0  0.2408E+05  0.1000E+03  0.0000E+00  0.0000E+00\n" for k in range(iterations)]
    (run / "deck.cvg").write_text("  STEP   INC  ATT   ITER     CONT.\n" + "".join(lines))


def end(folder, case, **changed):
    write_json(folder / "case.json", describe(case))
    write_json(folder / "status.json", STATUS | changed)


def test_a_case_waits_until_it_is_begun(folder, make_case):
    status = case_status(make_case(), folder, PREDICTED)
    assert (status.status, status.stage, status.actuation_pressure, status.actuation_pressure_max) == ("waiting", "", None, 60.0)
    assert status.seconds_left == PREDICTED


def test_a_running_case_tells_stage_pressure_and_counts(folder, make_case):
    case = make_case()
    with solving(folder):
        assert case_status(case, folder, PREDICTED).status == "running"
        begin(folder, case, pressure=45.0, iterations=12)
        status = case_status(case, folder, PREDICTED)
    assert (status.status, status.stage) == ("running", "ramp")
    assert status.actuation_pressure == pytest.approx(45.0, abs=0.01)
    assert (status.increments, status.cutbacks, status.iterations) == (2, 1, 12)
    assert 0 < status.seconds_left < 0.2 * PREDICTED, "three quarters of the ramp are done within no time"


@pytest.mark.parametrize(("share", "stage"), [(0.5, "fit"), (1.0, "hold"), (1.5, "hold"), (2.0, "ramp")])
def test_the_stage_is_the_one_that_the_solver_is_in(folder, make_case, share, stage):
    case = make_case()
    fit, hold, _ = stage_times(case.numerics, case.actuation_pressure_max)
    clock = share * fit.end if share <= 1 else fit.end + (share - 1) * hold.duration
    with solving(folder):
        begin(folder, case, clock=clock)
        status = case_status(case, folder, PREDICTED)
    assert (status.stage, status.actuation_pressure) == (stage, 0.0)


def test_a_stage_is_over_where_the_solver_rounds_its_end_down(folder, make_case, loaded):
    fast = loaded.config.numerics_presets["fast"]
    case = make_case(numerics=fast.model_copy(update={"fit": fast.fit.model_copy(update={"duration": 1.23456749})}))
    with solving(folder):
        begin(folder, case, clock=1.23456749)
        assert "1.234567E+00" in (folder / "run/deck.sta").read_text()
        assert case_status(case, folder, PREDICTED).stage == "hold"


def test_the_rate_is_that_since_the_process_began(folder, make_case):
    case = make_case()
    with solving(folder):
        begin(folder, case, pressure=10.0, iterations=100)
        long_ago = time.time() - 50
        os.utime(folder / "lock", (long_ago, long_ago))
        status = case_status(case, folder, PREDICTED)
    assert status.iterations_per_second == pytest.approx(2.0, rel=0.1)
    assert status.seconds == pytest.approx(50.0, abs=3)


def test_a_killed_case_is_stale_at_once(folder, make_case):
    case = make_case()
    begin(folder, case, pressure=45.0)
    (folder / "lock").write_text("process 1 on some machine\n")
    status = case_status(case, folder, PREDICTED)
    assert (status.status, status.stage, status.seconds_left) == ("stale", "ramp", PREDICTED)
    assert "snakemake again" in status.reason
    assert failed([status])


def test_without_locks_growing_files_tell_that_a_case_runs(folder, make_case):
    case = make_case()
    begin(folder, case, pressure=45.0)
    assert case_status(case, folder, PREDICTED).status == "running"
    for file in (folder / "run").iterdir():
        os.utime(file, (time.time() - 1000,) * 2)
    assert case_status(case, folder, PREDICTED).status == "stale"


def test_what_an_earlier_run_left_is_not_the_place_of_this_one(folder, make_case):
    case = make_case()
    begin(folder, case, pressure=45.0)
    for file in (folder / "run").iterdir():
        os.utime(file, (time.time() - 1000,) * 2)
    with solving(folder):
        status = case_status(case, folder, PREDICTED)
    assert (status.status, status.stage, status.iterations) == ("running", "", None)


def test_a_script_that_failed_crashed_its_case_and_says_why(folder, make_case):
    case = make_case()
    begin(folder, case, pressure=5.0)
    (folder / "lock").write_text("")
    log = folder.parents[1] / "logs" / "solve_case" / f"{folder.name}.log"
    log.parent.mkdir(parents=True)
    log.write_text("2026-01-01 INFO limo: predicted\n2026-01-01 ERROR limo: no space left on device\n")
    status = case_status(case, folder, PREDICTED)
    assert status.status == "crashed"
    assert "no space left on device" in status.reason
    assert status.seconds_left is None
    with solving(folder):
        assert case_status(case, folder, PREDICTED).status == "running", "it is tried again"


def job_of(case, state, reason=""):
    return Job("7", state, reason, case.case_id)


def test_a_cluster_tells_that_a_case_is_queued_or_runs_elsewhere(folder, make_case):
    case = make_case()
    status = case_status(case, folder, PREDICTED, job_of(case, "PENDING", "Priority"))
    assert (status.status, status.reason, status.seconds_left) == ("queued", "", PREDICTED)
    held = case_status(case, folder, PREDICTED, job_of(case, "PENDING", "QOSMaxJobsPerUserLimit"))
    assert held.reason == "job 7 waits: QOSMaxJobsPerUserLimit"
    begin(folder, case, pressure=30.0)
    folder.joinpath("lock").touch()
    assert case_status(case, folder, PREDICTED).status == "stale", "nobody holds the lock on this machine"
    assert case_status(case, folder, PREDICTED, job_of(case, "RUNNING")).status == "running"


def test_a_case_whose_job_slurm_ended_says_why(folder, make_case, tmp_path):
    case, log = make_case(), tmp_path / "7.log"
    begin(folder, case, pressure=30.0)
    folder.joinpath("lock").touch()
    log.write_text("slurmstepd: error: *** JOB 7 ON n1 CANCELLED AT 2026-01-01T00:00:00 DUE TO TIME LIMIT ***")
    status = case_status(case, folder, PREDICTED, None, log)
    assert (status.status, status.reason) == ("crashed", f"its job ran out of time ({log})")


@pytest.mark.parametrize("how", ["converged", "diverged", "timed_out", "crashed"])
def test_a_case_that_ended_says_how_and_what_it_took(folder, make_case, how):
    case = make_case()
    begin(folder, case, pressure=5.0)
    end(folder, case, status=how, reason="" if how == "converged" else "because", actuation_pressure_reached=31.5)
    status = case_status(case, folder, PREDICTED)
    assert (status.status, status.actuation_pressure, status.increments, status.cutbacks) == (how, 31.5, 200, 7)
    assert (status.iterations, status.iterations_per_second, status.seconds) == (900, 10.0, 90.0)
    assert status.seconds_left is None
    assert failed([status]) == (how != "converged")


def test_a_result_that_does_not_fit_waits_to_be_solved_again(folder, make_case):
    case = make_case()
    end(folder, case)
    assert case_status(make_case(frames=(0.0, 30.0)), folder, PREDICTED).status == "waiting"
    write_json(folder / "case.json", describe(case) | {"code": "another"})
    status = case_status(case, folder, PREDICTED)
    assert (status.status, status.seconds_left) == ("waiting", PREDICTED)
    with solving(folder):
        assert case_status(case, folder, PREDICTED).status == "running"


def test_newton_tells_by_what_it_reports(folder, make_case):
    case = make_case(engine="newton")
    with solving(folder):
        assert case_status(case, folder, PREDICTED).status == "running"
        report(stage="fit", fitted=0.4, actuation_pressure=0.0, increments=3, rejected=1, iterations=70)
        fit = case_status(case, folder, PREDICTED)
        (folder / "run" / "progress.json").unlink()
    assert (fit.stage, fit.actuation_pressure, fit.increments, fit.cutbacks, fit.iterations) == ("fit", 0.0, 3, 1, 70)
    with solving(folder):
        report(stage="ramp", fitted=1.0, actuation_pressure=45.0, increments=50, rejected=9, iterations=500)
        ramp = case_status(case, folder, PREDICTED)
    assert (ramp.stage, ramp.actuation_pressure) == ("ramp", 45.0)
    assert ramp.seconds_left < fit.seconds_left < PREDICTED


JUNK = st.one_of(
    st.binary(max_size=200),
    st.sampled_from([json.dumps(STATUS).encode()[:k] for k in range(0, 200, 7)]),
    st.recursive(
        st.one_of(st.none(), st.booleans(), st.floats(), st.text(max_size=5)),
        lambda inner: st.dictionaries(st.sampled_from([*STATUS, "case", "code", "stage", "engine", "frames"]), inner, max_size=4),
        max_leaves=6,
    ).map(lambda data: json.dumps(data).encode()),
    st.integers(1, 300).map(lambda k: (b"     1          3     1U    9  0.100000E+02  nan  0.500000E+00\n" * 5)[:k]),
)
FILES = ("status.json", "case.json", "lock", "run/deck.sta", "run/deck.cvg", "run/deck.inp", "run/progress.json")


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(content=st.dictionaries(st.sampled_from(FILES), JUNK), engine=st.sampled_from(["calculix", "newton"]))
def test_files_of_any_content_have_a_status(tmp_path_factory, make_case, content, engine):
    case = make_case(engine=engine)
    folder = tmp_path_factory.mktemp("any") / "cases" / case.case_id
    for name, data in content.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)
    status = case_status(case, folder, PREDICTED)
    assert status.status in STATUSES
    json.dumps(to_plain_cases([status]), allow_nan=False)


def to_plain_cases(statuses):
    return [vars(s) for s in statuses]


@given(st.floats(0, 1), st.floats(0, 1e5), st.floats(1, 1e5))
def test_time_left_goes_from_what_was_predicted_to_nothing(share, elapsed, predicted):
    assert seconds_left(predicted, 0.0, 0.0) == predicted
    assert seconds_left(predicted, elapsed, 1.0) == 0.0
    # a run at the predicted pace takes what was predicted
    assert seconds_left(predicted, share * predicted, share) == pytest.approx((1 - share) * predicted, abs=1e-6)


@pytest.mark.parametrize("engine", ["calculix", "newton"])
def test_the_shares_of_the_stages_are_a_whole(engine):
    assert share_done(engine, 0.0, 0.0, 0.0) == 0.0
    assert share_done(engine, 1.0, 1.0, 1.0) == pytest.approx(1.0)
    assert share_done(engine, 1.0, 0.0, 0.0) < 0.5 < share_done(engine, 1.0, 1.0, 0.5)


def test_short_names_tell_cases_apart(make_case):
    names = [
        make_case(**c).case_id for c in ({}, {"n_pouches": 4}, {"numerics_name": "paper"}, {"build": "other"}, {"branch": 2})
    ]
    short = short_names(names)
    assert len(set(short.values())) == len(names)
    assert short[names[1]] == "np4_pv3.8_ar2_eh1"
    assert all(value in name for name, value in short.items())
    assert len(short[names[0]]) > len(short[names[1]]), "that name needs more"


@pytest.fixture
def sweep(loaded, tmp_path):
    """Four cases: one that converged, one that runs (while the test looks), one that was killed, one that waits."""
    study = Study(axes={"n_pouches": [4, 6, 8, 10], "ventricular_pressure": [3.8]}, actuation_pressure_max=60, frames=[0])
    one = Project(loaded.config, loaded.devices, {"grid": study}, loaded.files)
    plan = make_plan(one, tmp_path)
    cases = list(plan.cases.values())
    end(tmp_path / "cases" / cases[0].case_id, cases[0])
    begin(tmp_path / "cases" / cases[2].case_id, cases[2], pressure=30.0)
    (tmp_path / "cases" / cases[2].case_id / "lock").touch()
    with solving(tmp_path / "cases" / cases[1].case_id):
        begin(tmp_path / "cases" / cases[1].case_id, cases[1], pressure=15.0)
        yield Sweep(one, make_plan(one, tmp_path), ["grid"], tmp_path, 2)


def printed(renderable, width=130):
    to = Console(file=io.StringIO(), width=width)
    to.print(renderable)
    return to.file.getvalue()


def test_the_table_has_a_line_a_case_and_totals(sweep):
    statuses = sweep.look()
    assert sorted(s.status for s in statuses) == ["converged", "running", "stale", "waiting"]
    text = printed(table(sweep, statuses))
    for status in statuses:
        (line,) = [text_line for text_line in text.splitlines() if f" {status.status} " in text_line and "np" in text_line]
        assert str(status.actuation_pressure_max) in line or "60" in line
    assert "[kPa]" in text
    assert "4 cases, 1 running, 1 waiting, 1 stale, 1 converged, about" in text
    assert "process is solving it" in text
    assert max(map(len, printed(table(sweep, statuses), 80).splitlines())) <= 80


def test_variants_and_branches_are_named(loaded, tmp_path):
    axes = {"n_pouches": [6], "ventricular_pressure": [3.8]}
    thick = {"thick": {"description": "0.2 mm", "material": {"thickness": 0.2}}, "as_it_is": {"description": "the device"}}
    studies = {
        "varied": Study(axes=axes, actuation_pressure_max=60, variants=thick, branches=2, engine="newton"),
        "plain": Study(axes=axes, actuation_pressure_max=60, engine="newton"),
    }
    of = Project(loaded.config, loaded.devices, studies, loaded.files)
    both = Sweep(of, make_plan(of, tmp_path), ["varied", "plain"], tmp_path, 2)
    statuses = both.look()
    assert [s.variant for s in statuses] == ["thick", "thick, branch 1", "as_it_is", "as_it_is, branch 1"]
    assert statuses[2].case in make_plan(of, tmp_path).of_study("plain"), "shared with a study that varies nothing"
    assert " thick, branch 1 " in printed(table(both, statuses))
    alone = Sweep(of, make_plan(of, tmp_path), ["plain"], tmp_path, 2)
    assert "variant" not in printed(table(alone, alone.look()))


def test_one_case_that_failed_is_a_failure(sweep):
    statuses = sweep.look()
    assert failed(statuses)
    assert not failed([s for s in statuses if s.status != "stale"])


def test_a_low_terminal_shows_what_runs_and_failed(sweep):
    text = printed(table(sweep, sweep.look(), height=2))
    assert " running " in text
    assert " stale " in text
    assert "(2 cases that wait or ended are not shown" in text
    assert text.count("np") == 3, "two cases, and one with a reason"


def test_machines_get_the_same(sweep):
    data = json.loads(json.dumps(to_plain(sweep, sweep.look())))
    assert data["totals"]["cases"] == 4
    assert data["totals"]["seconds_left"] > 0
    running = next(c for c in data["cases"] if c["status"] == "running")
    assert (running["stage"], running["iterations"]) == ("ramp", 5)


def test_a_log_has_lines_about_what_changed(sweep):
    statuses = sweep.look()
    first = changes({}, statuses)
    assert len(first) == 3, "waiting is no news"
    assert not changes({s.case: s for s in statuses}, statuses)
    before = {s.case: CaseStatus(s.case, "running", stage="fit") for s in statuses}
    assert any("ramp, P_a = 15.0 of 60 kPa" in line for line in changes(before, statuses))


@pytest.mark.parametrize("terminal", [{}, {"force_terminal": True, "_environ": {"TERM": "dumb"}}], ids=["file", "dumb"])
def test_watching_ends_when_it_is_told_and_prints_the_table(sweep, terminal):
    seen = []
    to = Console(file=io.StringIO(), width=130, **terminal)
    watch(sweep, to, 0.01, lambda: len(seen) > 2 or bool(seen.append(1)))
    text = to.file.getvalue()
    assert text.count("  running  ramp, P_a = 15.0") == 1, "the line is not repeated"
    assert text.rstrip().splitlines()[-1].strip().startswith("np")
    assert "4 cases" in text


def test_a_terminal_shows_the_table_in_place_and_leaves_the_last_one(sweep):
    seen = []
    to = Console(file=io.StringIO(), width=130, height=30, force_terminal=True, _environ={"TERM": "xterm"})
    watch(sweep, to, 0.01, lambda: len(seen) > 2 or bool(seen.append(1)))
    text = to.file.getvalue()
    in_place, _, after = text.rpartition("\x1b[?25h")  # the cursor is shown again at the end
    assert in_place.count("4 cases") >= 4, "it is drawn at each look"
    assert "\x1b[1A" in in_place, "the cursor goes back up"
    assert after.count("4 cases") == 1, "the last one stays"
