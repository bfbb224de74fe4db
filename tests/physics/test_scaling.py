"""Ever larger models, iterated for real by both engines."""

from __future__ import annotations

import os
import signal
from dataclasses import replace

import pytest

from limo.accuracy import scaling
from limo.accuracy.scaling import measure_scaling
from limo.accuracy.sizes import COLUMNS, MEASURED, read_scaling
from limo.engines.engine import EngineSettings
from limo.engines.find import find_engine
from limo.schema.accuracy import Scaling
from limo.schema.solver import Solver


@pytest.fixture(autouse=True)
def broken_pipes_are_errors():
    """gmsh, which other tests call in this process, lets a broken pipe end it; Python makes it an error."""
    signal.signal(signal.SIGPIPE, signal.SIG_IGN)


@pytest.fixture
def small(loaded):
    """Measure small models of the full device, each of six times the displacements of the one before."""

    def make(engine, **changes):
        wanted = Scaling(n_pouches=2, start=3000, factor=6, **changes)
        project = replace(loaded, config=loaded.config.model_copy(update={"scaling": wanted}))
        command = find_engine(engine).build(Solver(), "config/config.yaml").command
        return measure_scaling(project, engine, EngineSettings(command=command))

    return make


@pytest.mark.parametrize("engine", ["newton", "calculix"])
def test_larger_models_take_more(small, engine, tmp_path, monkeypatch):
    monkeypatch.setattr(scaling, "LARGEST_MESH", 50_000)  # two sizes
    rows = small(engine)
    assert list(rows.columns) == [*COLUMNS]
    assert list(rows.status) == [MEASURED] * 2
    first, second = rows.itertuples()
    assert second.displacements > 2 * first.displacements
    assert second.memory_mib >= first.memory_mib  # equal where these tests took more: a process inherits the peak of its parent
    assert second.cpu_seconds / second.iterations > first.cpu_seconds / first.iterations
    assert rows.iterations.ge(find_engine(engine).SAMPLED).all()
    (tmp_path / "table.csv").write_text(rows.to_csv(index=False))
    assert list(read_scaling(tmp_path)["size_status"][1]) == [MEASURED] * 2


def test_sizes_end_where_one_would_take_too_much(small, monkeypatch):
    """Sizes of 3, 18 and 108 thousand take 9, 324 and 11664 s; the power law through the first two foresees the third."""
    monkeypatch.setattr(scaling, "_measure", quadratic)
    assert list(small("newton", minutes=200).cpu_seconds) == [9, 324, 11664]
    assert list(small("newton", minutes=190).cpu_seconds) == [9, 324]


def test_no_size_is_tried_that_does_not_fit(small):
    rows = small("newton", memory=1e-3)
    assert len(rows) == 1, "the first is tried whatever it takes"


def test_what_kills_a_size_is_its_row(small, monkeypatch):
    monkeypatch.setattr(scaling, "_measure", killed)
    rows = small("newton")
    (status,) = rows.status
    assert status.startswith("failed: A process in the process pool was terminated abruptly")


def quadratic(case, _):
    """A row of a size whose time grows with its square."""
    size = case.mesh_level.degrees_of_freedom
    return {"displacements": size, "status": MEASURED, "cpu_seconds": 9 * (size / 3000) ** 2, "memory_mib": 1.0}


def killed(*_):
    """What the kernel does to a process when memory runs out."""
    os.kill(os.getpid(), signal.SIGKILL)
