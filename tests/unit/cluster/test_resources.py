"""What jobs ask for covers what was measured, grows with each attempt, and is stated by every rule."""

import re

import pandas as pd
import pytest
import yaml

from limo.cases.cost import MEMORY, PART, memory_mib, prior_seconds
from limo.cluster.profile import names, read_profile
from limo.cluster.resources import (
    ATTEMPTS,
    GATHERED,
    MEMORY_MARGIN,
    OF_A_CASE,
    SCRIPTS,
    SNAKEMAKE_MIB,
    TIME_MARGIN,
    script_memory,
    script_minutes,
    solve_memory,
    solve_minutes,
)
from limo.errors import ConfigError


@pytest.fixture(scope="module")
def measured(root, loaded) -> pd.DataFrame:
    """Kept runs that converged, with what was predicted of them (s, MiB)."""
    rows = pd.read_csv(root / "docs/data/performance.csv")
    rows = rows[(rows.status == "converged") & rows.level.isin(loaded.config.mesh_levels)].copy()
    predicted = []
    for r in rows.itertuples():
        size = loaded.config.mesh_levels[r.level].degrees_of_freedom
        case = {
            "mesh_level": {"degrees_of_freedom": size},
            "mesh": {"symmetry": r.symmetry, "element": "C3D20R"},
            "n_pouches": r.n_pouches,
            "ventricular_pressure": r.ventricular_pressure,
            "actuation_pressure_max": r.pressure_max,
            "engine": r.engine,
        }
        fixed, growth = MEMORY[r.engine]
        predicted.append((prior_seconds(case), fixed + growth * size * PART[r.symmetry] / 1000))
    rows[["seconds", "mib"]] = predicted
    assert len(rows) > 50
    return rows


def test_margins_cover_every_kept_run_and_little_more(measured):
    time, memory = measured.cpu_seconds / measured.seconds, measured.memory_mib / measured.mib
    assert 1.3 < time.max() < TIME_MARGIN < 2 * time.max()
    assert 1.1 < memory.max() < MEMORY_MARGIN < 1.2 * memory.max()


def test_a_job_asks_for_twice_as_much_with_each_attempt(make_case):
    case = make_case(engine="newton")
    alone = [solve_memory(case, attempt) - SNAKEMAKE_MIB for attempt in range(1, ATTEMPTS + 1)]
    assert alone == [pytest.approx(MEMORY_MARGIN * memory_mib(case) * factor, abs=1) for factor in (1, 2, 4)]
    times = [solve_minutes(1200.0, attempt) for attempt in range(1, ATTEMPTS + 1)]
    assert times == [46, 90, 178], "2 min to begin, and 44 min for 20 that are predicted"
    assert solve_minutes(0.0) == 2


def test_a_dataset_asks_by_the_number_of_its_cases():
    few, many = (script_memory("gather_study", count=n) for n in (10, 1000))
    assert many - few == pytest.approx(990 * GATHERED["gather_study"][2])
    assert script_minutes("gather_study", count=1000) > script_minutes("gather_study", count=10)


def test_every_rule_with_a_script_states_memory_and_time(root):
    for file in (root / "workflow/rules").glob("*.smk"):
        for name, body in re.findall(r"^rule (\w+):\n(.*?)(?=^\S|\Z)", file.read_text(), flags=re.MULTILINE | re.DOTALL):
            if "script:" in body:
                assert re.search(r"^        mem_mb=", body, re.MULTILINE), name
                assert re.search(r"^        runtime=", body, re.MULTILINE), name
                known = name in {*SCRIPTS, *GATHERED, *OF_A_CASE, "solve_case", "time_case"}
                assert known, f"{name}: limo.cluster.resources has no numbers of it"


def test_profiles_name_executors_and_put_no_two_cases_into_one_job(root):
    assert names() == ["googlebatch", "kubernetes", "lsf", "slurm"]
    for name in names():
        profile = read_profile(name)
        data = yaml.safe_load((profile.folder / "config.yaml").read_text())
        assert (profile.executor, data["retries"]) == (name, ATTEMPTS - 1)
        assert all(group.partition("=")[2] == "{case}" for group in data["groups"])
        assert "group-components" not in data
        assert "slurm-array-jobs" not in data
    with pytest.raises(ConfigError, match="--on slurm"):
        read_profile("nowhere")
