"""What may be deleted, and that nothing else is."""

import os
import shutil
import time
from pathlib import Path

import pytest

from limo.cases.case import describe
from limo.cases.grid import study_cases
from limo.config.builds import with_found_builds
from limo.config.load import load_config
from limo.errors import LimoError
from limo.store.files import write_json
from limo.store.progress import solving
from limo.terminal.cleaning import delete, describe_rubbish, find_rubbish, readable, size_of
from limo.terminal.cli import main
from tests.helpers.cases import without_studies

CONFIG = "config/config.yaml"
UNUSED = "limo_np4_pv99_ar2_eh1_preview_fast_0123456789"


@pytest.fixture
def results(root, tmp_path, monkeypatch):
    """A used case and an unused one, each with a mesh and leftovers, in a copy of the configuration for the engine newton."""
    studies = without_studies(root, tmp_path)
    shutil.rmtree(tmp_path / "config/levers")
    (studies / "pressure_volume.yaml").write_text(
        "engine: newton\naxes: {n_pouches: [4], ventricular_pressure: [3.8]}\nactuation_pressure_max: 60\n"
    )
    monkeypatch.chdir(tmp_path)
    loaded, _ = with_found_builds(load_config(CONFIG), CONFIG)
    (case,) = study_cases(loaded, "pressure_volume").values()
    folder = tmp_path / "results"
    for name in (case.case_id, UNUSED):
        run = folder / "cases" / name / "run"
        run.mkdir(parents=True)
        (run / "deck.frd").write_bytes(b"x" * 5000)
        (run / "deck.sta").write_bytes(b"x" * 300)
        write_json(folder / "cases" / name / "case.json", describe(case))
        write_json(folder / "cases" / name / "status.json", {"status": "converged"})
    for mesh in (case.mesh_id, "limo_np4_old_quarter_0123456789"):
        (folder / "meshes").mkdir(exist_ok=True)
        (folder / "meshes" / f"{mesh}.vtu").write_bytes(b"x" * 100)
    (folder / "logs/solve_case").mkdir(parents=True)
    (folder / "logs/solve_case" / f"{UNUSED}.log").write_text("a log")
    (folder / "studies/pressure_volume").mkdir(parents=True)
    (folder / "studies/pressure_volume/study.nc").write_text("a dataset")
    return folder, case


def everything(folder: Path) -> set[str]:
    return {str(p.relative_to(folder)) for p in folder.rglob("*") if not p.is_dir()}


def test_unused_cases_and_leftovers_go_and_the_rest_stays(results):
    folder, case = results
    before = everything(folder)
    rubbish = find_rubbish([CONFIG], folder)
    assert everything(folder) == before, "finding deletes nothing"
    delete(rubbish)
    gone = before - everything(folder)
    assert gone == {
        f"cases/{case.case_id}/run/deck.frd",
        *(f"cases/{UNUSED}/{n}" for n in ("case.json", "status.json", "run/deck.frd", "run/deck.sta")),
        "meshes/limo_np4_old_quarter_0123456789.vtu",
        f"logs/solve_case/{UNUSED}.log",
    }
    assert not (folder / "cases" / UNUSED).exists()
    assert find_rubbish([CONFIG], folder) == []


def test_what_it_frees_is_counted_once_and_said(results):
    folder, _ = results
    total = sum(r.size for r in find_rubbish([CONFIG], folder))
    before = sum(p.stat().st_size for p in folder.rglob("*") if p.is_file())
    delete(rubbish := find_rubbish([CONFIG], folder))
    assert before - sum(p.stat().st_size for p in folder.rglob("*") if p.is_file()) == total
    assert readable(total) in describe_rubbish(rubbish, folder).splitlines()[-1]


def test_leftovers_alone_leave_unused_cases(results):
    folder, _ = results
    found = find_rubbish([CONFIG], folder, ["leftovers"])
    assert {r.path.name for r in found} == {"deck.frd"}
    assert len(found) == 2


def test_a_case_that_is_being_solved_stays(results):
    folder, case = results
    with solving(folder / "cases" / UNUSED), solving(folder / "cases" / case.case_id):
        assert find_rubbish([CONFIG], folder) == []


def test_nothing_is_deleted_without_yes(results, capsys):
    folder, _ = results
    before = everything(folder)
    assert main(["clean"]) == 0
    said = capsys.readouterr().out
    assert "nothing was deleted" in said
    assert UNUSED in said
    assert everything(folder) == before
    assert main(["clean", "nonsense"]) == 1
    assert main(["clean", "cases", "--yes"]) == 0
    assert everything(folder) < before
    assert main(["clean", "--yes"]) == 0
    assert main(["clean"]) == 0
    assert "nothing to delete" in capsys.readouterr().out


def test_a_link_goes_and_what_it_leads_to_stays(results, tmp_path):
    folder, _ = results
    elsewhere = tmp_path / "elsewhere"
    shutil.move(folder / "cases" / UNUSED, elsewhere)
    (folder / "cases" / UNUSED).symlink_to(elsewhere)
    before = everything(elsewhere)
    delete(find_rubbish([CONFIG], folder))
    assert not (folder / "cases" / UNUSED).is_symlink()
    assert everything(elsewhere) == before


def test_what_leads_out_of_the_results_is_refused(results, tmp_path):
    folder, _ = results
    shutil.move(folder / "cases", tmp_path / "elsewhere")
    (folder / "cases").symlink_to(tmp_path / "elsewhere")
    before = everything(tmp_path / "elsewhere")
    with pytest.raises(LimoError, match="leads out"):
        find_rubbish([CONFIG], folder)
    assert everything(tmp_path / "elsewhere") == before


def test_half_written_files_go_when_their_process_is_long_gone(results):
    folder, case = results
    (folder / "cases" / UNUSED / "run/deck.frd").unlink()
    (folder / "cases" / case.case_id / "run/deck.frd").unlink()
    old, new, mine = (folder / "cases" / case.case_id / f".{n}.frames.nc" for n in (4194305, 4194306, os.getpid()))
    for file in (old, new, mine):
        file.write_text("half")
    for file in (old, mine):
        os.utime(file, (time.time() - 1e5,) * 2)
    assert [r.path for r in find_rubbish([CONFIG], folder, ["leftovers"])] == [old]


def test_sizes():
    assert [readable(n) for n in (0, 999, 1024, 5 * 2**20, 300 * 2**30)] == ["0 B", "999 B", "1.0 KiB", "5.0 MiB", "300 GiB"]


def test_the_size_of_a_folder_is_that_of_its_files(tmp_path):
    (tmp_path / "a/b").mkdir(parents=True)
    (tmp_path / "a/one").write_bytes(b"1" * 10)
    (tmp_path / "a/b/two").write_bytes(b"2" * 5)
    assert size_of(tmp_path / "a") == 15
