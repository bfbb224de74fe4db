"""Raw measurements in, the report out."""

import pandas as pd
import pytest

from limo.cases.grid import study_cases
from limo.cases.plan import make_plan
from limo.config.project import Project
from limo.errors import ResultError
from limo.reports.before import COLUMNS as BEFORE
from limo.reports.before import EARLIER, read_before
from limo.reports.cluster import read_cluster
from limo.reports.entry import read_entry
from limo.reports.overhead import COLUMNS, read_overhead
from limo.reports.peer import read_peer
from limo.reports.performance import _levers, measurements, read_measurements, record, report
from limo.schema.study import Study
from limo.store.files import write_json
from tests.helpers.curves import history_of


@pytest.fixture
def measured(loaded, tmp_path):
    """Rows of one solved case of two: it took 120 s for half of its run."""
    study = Study(
        description="a change", axes={"n_pouches": [4, 6], "ventricular_pressure": [3.8]}, actuation_pressure_max=60,
    )  # fmt: skip
    one = Project(loaded.config, loaded.devices, {"base": study}, loaded.files)
    case = next(iter(study_cases(one, "base").values()))
    folder = tmp_path / "cases" / case.case_id
    folder.mkdir(parents=True)
    history_of(case, 26.0).to_netcdf(folder / "volumes.nc")
    status = {
        "status": "timed_out", "solver": {"version": "2.20", "build": "stock"}, "elements": 100,
        "actuation_pressure_reached": 26.0, "iterations_by_stage": {"fit": 10, "hold": 5, "ramp": 85}, "rejected_attempts": 3,
        "increments": 20, "dissipated_fraction": 0.04, "solver_cpu_seconds": 120.0, "python_cpu_seconds": 2.0,
        "solver_wall_seconds": 130.0, "solver_memory_mib": 100.0,
    }  # fmt: skip
    write_json(folder / "status.json", status)
    return measurements(one, make_plan(one, tmp_path), "levers", ["base"], tmp_path)


def test_a_row_says_what_was_run_what_it_cost_and_how_far_it_came(measured):
    assert len(measured) == 1, "the case that is not on disk has no row"
    row = measured.iloc[0]
    assert (row.study, row.change, row.engine, row.build) == ("base", "a change", "calculix", "stock")
    assert (row.iterations_fit, row.iterations_ramp, row.cpu_seconds) == (10, 85, 120.0)
    assert row.stroke == pytest.approx(52.0), "2 ml a kPa"
    # fit 20 s at 1e7 1/s, hold and ramp of 240 s at 1e6 1/s, which run ten times longer
    assert row.path_share == pytest.approx((20 + 200 + 2400 * 26 / 60) / (20 + 200 + 2400), rel=1e-4)


def test_a_new_measurement_takes_the_place_of_the_old_one(measured, tmp_path):
    file = tmp_path / "table.csv"
    record(measured, file)
    record(measured.assign(cpu_seconds=60.0), file)
    record(measured.assign(batch="again"), file)
    rows = read_measurements(file)
    assert list(rows.cpu_seconds) == [60.0, 120.0]
    assert list(rows.batch) == ["levers", "again"]


def test_the_report_judges_changes_and_targets_by_the_numbers(tmp_path, measured):
    base = measured.assign(
        variant="base", status="converged", path_share=1.0, pressure_reached=60.0, cpu_seconds=100.0, stroke=100.0
    )
    variants = {"faster": (50.0, 101.0), "wrong": (50.0, 110.0), "slower": (99.0, 100.0)}
    rows = [base, *(base.assign(variant=n, change=n, cpu_seconds=c, stroke=s) for n, (c, s) in variants.items())]
    paper = base.assign(batch="stock", variant="paper", cpu_seconds=600.0, path_share=0.1)
    pair = dict.fromkeys(BEFORE, 1) | {"setting": "bricks", "commit": "a", "machine": "a", "cpu_seconds": 1000.0}
    overhead = pd.DataFrame([("no_op", 19, 4.0, 3, "a"), ("dry_run", 1000, 16.0, 3, "a")], columns=COLUMNS)
    beside = read_before(tmp_path / "no.csv"), pd.DataFrame([pair | {"setting": EARLIER}, pair | {"cpu_seconds": 250.0}])
    text, later = (
        report(
            pd.concat([*rows, paper], ignore_index=True),
            overhead,
            read_entry(tmp_path / "entry.csv"),
            read_cluster(tmp_path / "no.csv"),
            read_peer(tmp_path / "no.csv"),
            before,
        )
        for before in beside
    )
    verdict = {n: next(line for line in text.splitlines() if f"| {n} |" in line).split("|")[-2].strip() for n in variants}
    assert verdict == {"faster": "yes", "wrong": "no", "slower": "no"}
    lines = [line for line in text.splitlines() if "deck of the paper on the stock build: calculix" in line]
    assert len(lines) == 1
    assert "60 times" in lines[0]
    assert lines[0].endswith("yes |")
    assert "not measured" in next(line for line in text.splitlines() if "`grid_preview_newton`, 19" in line)
    targets = [[line for line in each.splitlines() if "earlier build's `standard`" in line] for each in (text, later)]
    assert [[line.split("|")[-2].strip() for line in each] for each in targets] == [
        ["not measured"] * 3,
        ["yes", "not measured", "yes"],
    ]
    judged = [line for line in later.splitlines() if line.startswith(("| devices with", "| CPU over the earlier"))]
    assert [line.split("|")[-2].strip() for line in judged] == ["yes", "yes", "not measured"]
    assert "| 4 times |" in targets[1][0]
    assert "| nothing to do in 19 solved cases | at most 5 s | 4 s | yes |" in text
    assert "| dry run of a study of 1,000 cases | at most 15 s | 16 s | no |" in text


@pytest.mark.parametrize(("attempts", "verdict"), [(1, "1.2 times | yes"), (2, "- | not measured")])
def test_iterations_are_compared_with_their_own_factors(tmp_path, measured, attempts, verdict):
    """Of 200 s a case spent 70 on coarser meshes and 10 before it began; its factors took 100."""
    own = {"factor_seconds": 100.0, "setup_seconds": 10.0, "cpu_seconds": 200.0, "fit_seconds": 70.0, "attempts": attempts}
    rows = measured.assign(batch="grid_preview_newton", engine="newton", **own)
    absent = [read(tmp_path / "no.csv") for read in (read_overhead, read_entry, read_cluster, read_peer, read_before)]
    line = next(line for line in report(rows, *absent).splitlines() if "`grid_preview_newton`: iterations over" in line)
    assert f"| {verdict} |" in line


def test_changes_are_compared_with_the_base_of_their_case(measured):
    """Not with those of another case by the same engine."""
    row = measured.assign(batch="levers", engine="newton", status="converged", stroke=100.0)
    rows = [
        row.assign(study=study, variant=name, change=name, cpu_seconds=seconds)
        for study, base, cost in (("small", "newton", 10.0), ("large", "flat", 100.0))
        for name, seconds in (("half", 0.5 * cost), (base, cost))  # measured later than the change
    ]
    table = _levers(pd.concat(rows))
    assert list(table.share) == ["1.00", "0.50"] * 2
    assert list(table.pays) == ["-", "yes"] * 2
    assert _levers(rows[0]).empty, "without its base"


def test_times_of_snakemake_are_read_and_none_where_none_were_measured(tmp_path):
    assert read_overhead(tmp_path / "absent.csv").empty
    (tmp_path / "other.csv").write_text("a,b\n1,2\n")
    with pytest.raises(ResultError, match="no columns what"):
        read_overhead(tmp_path / "other.csv")


def test_a_file_that_is_no_table_is_refused(tmp_path):
    (tmp_path / "other.csv").write_text("a,b\n1,2\n")
    with pytest.raises(ResultError, match="no columns batch"):
        read_measurements(tmp_path / "other.csv")
    with pytest.raises(ResultError, match="not a table"):
        read_measurements(tmp_path / "absent.csv")
