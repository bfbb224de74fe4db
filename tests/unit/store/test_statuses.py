"""What ``status.json`` says: read into types and back, and nothing else is taken for it."""

from __future__ import annotations

import pytest

from limo.errors import ResultError
from limo.store.statuses import ENDED, SolveStatus

#: of a newton solve whose first attempt failed
WRITTEN = {
    "case": "limo_np4", "engine": "newton", "status": "converged", "reason": "", "actuation_pressure_reached": 60.0,
    "increments": 57, "degrees_of_freedom": 672, "rest_change": None, "rested": True, "actuation_work_mj": 36.166,
    "dissipated_fraction": -0.031, "checks": {"residual": 0.0026, "error": ""}, "rejected_attempts": 8, "iterations": 261,
    "iterations_by_stage": {"fit": 156, "hold": 96, "ramp": 9}, "solver": {"engine": "newton", "version": "mkl 2026"},
    "threads": 1, "solver_cpu_seconds": 2.15, "solver_wall_seconds": 4.57, "solver_memory_mib": 100.2, "elements": 29,
    "factorisations": 300, "limits": {"residual": 0.02}, "recovery": "fd52-0", "interrupted": False,
    "attempts": [
        {"rung": "as configured", "status": "diverged", "reason": "a snap", "ended_in": "ramp", "elements": 29, "iterations": 9},
        {"rung": "smaller_load_steps", "status": "converged", "reason": ""},
    ],
    "files": {"case.json": {"bytes": 5759, "sha256": "f5ef"}}, "python_cpu_seconds": 1.12,
}  # fmt: skip


def test_a_status_survives_its_types():
    status = SolveStatus.from_json(WRITTEN)
    assert status.to_json() == WRITTEN, "what an engine says besides is kept"
    assert (status.iterations_by_stage["fit"], status.attempts[0].reason, status.first_status) == (156, "a snap", "diverged")
    assert (status.is_usable, status.reached) == (True, float("inf"))


def test_what_a_status_does_not_say_is_not_known():
    status = SolveStatus.from_json({"status": "timed_out"})
    assert status.to_json() == {"status": "timed_out"}
    assert (status.iterations, status.attempts, status.recovery, status.reached) == (None, [], "", 0.0)
    assert status.first_status == "timed_out"


@pytest.mark.parametrize("word", ENDED)
def test_two_words_are_results(word):
    assert SolveStatus(status=word).is_usable == (word in ("converged", "degraded"))


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("status", None),
        ("status", 3),
        ("reason", None),
        ("iterations", True),
        ("iterations", -1),
        ("iterations", 10**400),
        ("iterations", 1.5),
        ("actuation_pressure_reached", 10**400),
        ("actuation_pressure_reached", "60"),
        ("attempts", [3]),
        ("attempts", [{"rung": "no status"}]),
        ("files", {"case.json": 3}),
        ("interrupted", "yes"),
        ("recovery", 1),
    ],
)
def test_what_is_no_status_is_one_error_with_file_and_key(key, value):
    with pytest.raises(ResultError, match=rf"cases/a/status\.json: {key}") as error:
        SolveStatus.from_json(WRITTEN | {key: value}, "cases/a/status.json")
    assert "\n" not in str(error.value)
