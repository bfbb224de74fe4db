"""Where results lie: every path is what it always was, and the same for a pattern and a name."""

from __future__ import annotations

from pathlib import Path

from limo.store.results import Results

CASE = {
    "described": "case.json", "status": "status.json", "volumes": "volumes.nc", "frames": "frames.nc",
    "own_mesh": "mesh.vtu", "measures": "measures.nc", "fields": "fields", "picture": "case.png", "run": "run",
    "progress": "run/progress.json", "numerics": "run/numerics.json", "lock": "lock",
}  # fmt: skip


def test_files_of_a_case_have_their_names():
    for name in ("limo_np4_pv3.8", "{case}"):
        files = Results(Path("results")).case(name)
        assert {key: str(getattr(files, key)) for key in CASE} == {k: f"results/cases/{name}/{v}" for k, v in CASE.items()}
        assert str(files.kept.frames) == f"results/cases/{name}/.kept/frames.nc"
        assert [file.name for file in files.solved] == ["case.json", "status.json", "volumes.nc", "frames.nc"]


def test_other_results_have_their_names():
    results = Results(Path("results"))
    study, airbag = results.study("stress"), results.airbag("paper")
    assert {str(file) for file in (study.dataset, study.table, study.shapes, study.figure("design", "pdf"))} == {
        "results/studies/stress/study.nc",
        "results/studies/stress/study.csv",
        "results/studies/stress/shapes.nc",
        "results/studies/stress/figures/design.pdf",
    }
    assert str(airbag.run("{run}")) == "results/airbags/paper/runs/{run}.nc"
    assert str(airbag.dataset) == "results/airbags/paper/airbag.nc"
    assert str(results.mesh("limo_np4")) == "results/meshes/limo_np4.vtu"
    assert str(results.kept_names("{study}")) == "results/kept/{study}.txt"
    assert str(results.log("solve_case", "{case}")) == "results/logs/solve_case/{case}.log"
    assert str(results.benchmark("solve_case", "{case}")) == "results/benchmarks/solve_case/{case}.tsv"


def test_cases_are_folders_in_their_order(tmp_path):
    results = Results(tmp_path)
    assert results.case_ids() == []
    for name in ("b", "a"):
        results.case(name).folder.mkdir(parents=True)
    (results.cases / "c").touch()
    assert results.case_ids() == ["a", "b"]
