"""What Slurm's commands and logs say, read."""

import os
import subprocess

import pytest

from limo.cluster import slurm, start
from limo.errors import ClusterError

CASE = "limo_np4_pv3.8_ar2_eh1_preview_fast_0123456789"


@pytest.mark.parametrize(
    ("text", "minutes"), [("30:00", 30), ("2:00:00", 120), ("1-12:00:00", 2160), ("infinite", float("inf")), ("0:30", 0.5)]
)
def test_times_of_slurm(text, minutes):
    assert slurm.minutes_of(text) == minutes


@pytest.mark.parametrize(
    ("comment", "case"),
    [
        (f"rule_{CASE}_measure_case_solve_case", CASE),
        (f"rule_{CASE}_solve_case", CASE),
        (f"rule_solve_case_wildcards_{CASE}", CASE),
        ("rule_gather_study_wildcards_tiny", ""),
        ("rule_mesh_device_wildcards_limo_np4_preview_quarter_0123456789", ""),
        ("interactive", ""),
    ],
)
def test_the_case_of_a_job_stands_in_its_comment(comment, case):
    assert slurm.case_in(comment) == case


@pytest.fixture
def answers(tmp_path, monkeypatch):
    """``answers(program, text, code)``: a program of Slurm that says this."""
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")

    def make(program: str, text: str, code: int = 0) -> None:
        file = tmp_path / program
        file.write_text(f"#!/bin/sh\ncat <<'EOF'\n{text}\nEOF\nexit {code}\n")
        file.chmod(0o755)

    return make


def test_jobs_of_a_folder_are_those_that_snakemake_submitted_from_it(answers, tmp_path):
    folder = tmp_path / "a | b"
    folder.mkdir()
    lines = [
        f"12|PENDING|Resources|rule_{CASE}_solve_case|{folder}",
        f"3|RUNNING|None|rule_gather_study_wildcards_tiny|{folder}",
        f"4|RUNNING|None|(null)|{folder}",
        f"5|RUNNING|None|rule_{CASE}_solve_case|{tmp_path}",
        f"6|COMPLETED|None|rule_{CASE}_solve_case|{folder}",
    ]
    answers("squeue", "\n".join(lines))
    assert slurm.jobs_of(folder) == [slurm.Job("3", "RUNNING", "", ""), slurm.Job("12", "PENDING", "Resources", CASE)]


def test_a_slurm_that_does_not_answer_is_one_message(answers, tmp_path):
    answers("squeue", "", 1)
    with pytest.raises(slurm.NoAnswer, match="Slurm does not answer"):
        slurm.jobs_of(tmp_path)


def test_partitions_have_limits(answers):
    answers("sinfo", "short|30:00|4000|short*\nshort|30:00|8000+|short*\nlong|infinite|16000|long")
    found = slurm.partitions()
    assert found[""] == found["short"] == slurm.Partition("short", 30, 8000)
    assert found["long"].minutes == float("inf")


@pytest.mark.parametrize(
    ("job", "says"),
    [
        (start.Asked("solve_case", CASE, 20, 500, 60, "nowhere"), "no such partition; there are short"),
        (start.Asked("solve_case", CASE, 90, 500, 2400), "asks for 90 min, and partition short ends jobs after 30 min"),
        (start.Asked("solve_case", CASE, 5, 500, 600), "a time limit of 5 min is below the 10 min that are predicted"),
        (start.Asked("solve_case", CASE, 20, 9000, 60), "asks for 9000 MiB, and no node"),
    ],
)
def test_what_no_partition_takes_is_refused(answers, job, says):
    for program in ("sbatch", "squeue", "scancel"):
        answers(program, "")
    answers("sinfo", "short|30:00|8000|short*")
    start.check_slurm([start.Asked("solve_case", CASE, 20, 500, 60)])
    with pytest.raises(ClusterError, match=says):
        start.check_slurm([job])


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("slurmstepd: error: *** JOB 3 ON n1 CANCELLED AT 2026-01-01T00:00:00 DUE TO TIME LIMIT ***", "ran out of time"),
        ("slurmstepd: error: JobId=3 exceeded memory limit (900 > 400), being killed", "ran out of memory"),
        ("slurmstepd: error: *** JOB 3 ON n1 CANCELLED AT 2026-01-01T00:00:00 ***", "was cancelled"),
        ("all is well", ""),
    ],
)
def test_why_a_job_ended_stands_in_its_log(tmp_path, text, says):
    log = tmp_path / f"group_{CASE}_solve_case" / "3.log"
    log.parent.mkdir()
    log.write_text(text)
    assert slurm.logs_of(tmp_path) == {CASE: log}
    assert says in slurm.how_it_ended(log)


def test_the_script_of_the_one_folder_slurm_is_sound(root):
    subprocess.run(["bash", "-n", root / "scripts/slurm.sh"], check=True)
