"""What the job that looks at a node finds there, with small scripts in the place of CalculiX."""

import pytest

from limo.cases.plan import make_plan
from limo.cluster.handed import hand
from limo.cluster.probe import answer_request
from limo.engines.find import find_builds
from limo.schema.solver import Solver
from limo.store.files import read_json, write_json
from tests.helpers.cases import configured, study


@pytest.fixture
def answer(loaded, tmp_path, monkeypatch):
    """``answer(lines)``: what the job says is lacking on a node where ccx is a shell script of these lines."""
    monkeypatch.setenv("LIMO_PLAN", "")  # so that it is as it was in the end, whatever ``hand`` makes of it

    def make(lines: str, planned: str = "") -> str:
        ccx = tmp_path / "ccx"
        ccx.write_text(f"#!/bin/sh\n{lines}\n")
        ccx.chmod(0o755)
        solver = Solver(command=str(ccx))
        builds = {name: build.id for name, build in find_builds(solver, "config/config.yaml", ["calculix"]).items()}
        plan = make_plan(configured(loaded, one=study(engine="calculix")), tmp_path / "results")
        file = hand(plan, builds | ({"calculix": planned} if planned else {}), tmp_path / "handed")
        request = {"solver": solver.model_dump(mode="json"), "answer": str(tmp_path / "answer.json")}
        write_json(tmp_path / "ask.json", request)
        answer_request(tmp_path / "ask.json", file)
        return read_json(tmp_path / "answer.json")["lacks"]

    return make


def test_a_build_for_another_processor_is_noticed_by_its_signal(answer):
    lacks = answer("kill -s ILL $$")
    assert "engine calculix does not iterate here (crashed: ended by signal 4)" in lacks
    assert "solver: {build: stock}" in lacks


def test_another_build_than_the_planned_one_is_noticed(answer):
    lacks = answer("exit 0", planned="ccx 2.20 tuned elsewhere")
    assert "the sweep was planned with ccx 2.20 tuned elsewhere, which does not run on this node" in lacks
