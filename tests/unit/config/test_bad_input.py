"""Readers of whatever may lie on a disk: one clean error or a usable answer, never a traceback, a hang or an absurd allocation.

``LIMO_EXAMPLES`` says how many examples each fuzzer takes.
"""

from __future__ import annotations

import json
import os
import re
import resource
import shutil
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from limo.bench.curves import COLUMNS, read_curves
from limo.cases.case import describe
from limo.cases.plan import make_plan
from limo.cases.solved import solved_cases
from limo.config.load import load_config
from limo.config.yaml_file import parse, read_yaml
from limo.datasets.study import read_case
from limo.engines.calculix.frd import FrdFile
from limo.engines.calculix.sta import read_sta
from limo.errors import ConfigError, LimoError, ResultError
from limo.schema.bench import MeasuredCurves
from limo.schema.reliability import StressTest
from limo.schema.solver import Recovery
from limo.schema.study import Study
from limo.store.files import read_json, write_json
from limo.store.results import CaseFiles
from limo.terminal.inspection import CaseFolder, show_case
from limo.terminal.status import case_status

EXAMPLES = int(os.environ.get("LIMO_EXAMPLES", "60"))
fuzzed = settings(
    max_examples=EXAMPLES,
    deadline=5000,
    derandomize=EXAMPLES <= 100,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow, HealthCheck.data_too_large],
)
MOST_MEMORY = 300  # MiB that reading a few bytes may take at most

scalars = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.integers(10**300, 10**310),
    st.floats(),
    st.text(max_size=20),
    st.sampled_from(
        ["../../../etc/passwd", "; rm -rf /", "$(reboot)", "a\nb", "a\0b", "/abs", "~", "P_v +", "nan", "1e400", "-"]
    ),
)
plain = st.recursive(
    scalars, lambda x: st.lists(x, max_size=4) | st.dictionaries(st.text(max_size=8), x, max_size=4), max_leaves=8
)


@pytest.fixture(autouse=True)
def modest():
    """No test here may take much memory."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    yield
    assert (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024 < MOST_MEMORY


def refusal(kind: type[LimoError], call) -> str:
    """What the one clean error says that a call may raise; "" where it raises none."""
    try:
        call()
    except kind as error:
        return str(error)
    return ""


# --------------------------------------------------------------------------------------------------------------------
# the configuration


@fuzzed
@given(
    content=st.one_of(st.binary(max_size=300), st.text(max_size=300).map(str.encode), plain.map(lambda x: json.dumps(x).encode()))
)
def test_any_bytes_as_yaml(tmp_path, content):
    file = tmp_path / "config.yaml"
    file.write_bytes(content)
    said = refusal(ConfigError, lambda: read_yaml(file))
    assert str(file) in said or isinstance(read_yaml(file), dict)


@pytest.mark.parametrize("key", ["studies", "solver", "recovery", "mesh_levels"])
def test_a_few_lines_that_stand_for_gigabytes(root, tmp_path, key):
    """References to references: 10^9 entries in 400 bytes."""
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 10)}]" for k in range(1, 9)]
    kept = (root / "config/config.yaml").read_text().splitlines()
    file = tmp_path / "config.yaml"
    file.write_text("\n".join([*lines, f"{key}: *a8", *(x for x in kept if x.startswith("numerics:"))]))
    began = time.monotonic()
    with pytest.raises(ConfigError) as error:
        load_config(file)
    assert len(str(error.value)) < 5000
    assert time.monotonic() - began < 20


@fuzzed
@given(model=st.sampled_from([Study, Recovery, StressTest]), data=st.data())
def test_any_value_of_a_section(model, data):
    names = st.sampled_from(sorted(model.model_fields))
    content = data.draw(st.dictionaries(names | st.text(max_size=5), plain, max_size=6))
    said = refusal(ConfigError, lambda: parse(model, content, Path("some.yaml")))
    assert said == "" or "some.yaml" in said
    assert len(said) < 5000


@fuzzed
@given(name=st.one_of(st.text(max_size=30), st.sampled_from(["../x", "a/b", "a b", "a;b", "$x", "x\n", ".x", "x`id`", "ä"])))
def test_names_become_parts_of_paths_only_if_they_are_plain(make_case, name):
    """What names a case, a mesh or a rule has letters, digits and underscores; so has every path made of it."""
    study = {"axes": {"n_pouches": [4], "ventricular_pressure": [1]}, "actuation_pressure_max": 9}
    for key in ("device", "numerics", "mesh"):
        try:
            made = parse(Study, study | {key: {"level": name} if key == "mesh" else name}, Path("some.yaml"))
        except ConfigError:
            continue
        used = made.mesh.level if key == "mesh" else getattr(made, key)
        assert re.fullmatch(r"[A-Za-z]\w*", used, re.ASCII)
    case = make_case(device_name="limo", numerics_name="fast")
    assert re.fullmatch(r"[\w.]+", case.case_id)
    assert re.fullmatch(r"\w+", case.mesh_id)


@pytest.mark.parametrize("name", ["a\n.yaml", "a b.yaml", "-rf.yaml", "$(x).yaml", "é.yaml"])
def test_file_names_that_are_no_names_are_refused(root, tmp_path, name):
    (tmp_path / "devices").symlink_to(root / "config/devices")
    (tmp_path / "studies").mkdir()
    (tmp_path / "studies" / name).write_text("x: 1\n")
    shutil.copy(root / "config/studies/pressure_volume.yaml", tmp_path / "studies")
    (tmp_path / "config.yaml").write_text((root / "config/config.yaml").read_text())
    with pytest.raises(LimoError, match="file name"):
        load_config(tmp_path / "config.yaml", strict=True)


# --------------------------------------------------------------------------------------------------------------------
# files of solvers


@fuzzed
@given(data=st.data())
def test_a_result_file_with_changed_bytes(frd_bytes, tmp_path, data):
    numbers = np.arange(1, 9)
    good = bytearray(frd_bytes([(1, k, 0.1 * k, numbers, np.full((8, 3), 0.5 * k)) for k in (1, 2)]))
    for _ in range(data.draw(st.integers(0, 6))):
        good[data.draw(st.integers(0, len(good) - 1))] = data.draw(st.integers(0, 255))
    cut = data.draw(st.integers(0, len(good)))
    file = tmp_path / "deck.frd"
    file.write_bytes(bytes(good[:cut]))

    def read():
        with FrdFile(file) as frd:
            for frame in frd.frames:
                assert frd.displacements(frame, 20).shape == (20, 3)

    assert str(file) in (refusal(ResultError, read) or str(file))


@fuzzed
@given(
    text=st.one_of(
        st.binary(max_size=400),
        st.lists(st.text("0123456789.E+-U ", max_size=90), max_size=8).map(lambda x: "\n".join(x).encode()),
    )
)
def test_any_bytes_as_increments(tmp_path, text):
    file = tmp_path / "deck.sta"
    file.write_bytes(text)
    assert all(i.iterations >= 0 for i in read_sta(file))


@fuzzed
@given(content=st.one_of(st.binary(max_size=300), st.text(max_size=200).map(lambda x: f"{','.join(COLUMNS[5:8])}\n{x}".encode())))
def test_any_bytes_as_measured_curves(tmp_path, content):
    file = tmp_path / "measured.csv"
    file.write_bytes(content)
    measured = MeasuredCurves(data=str(file))
    said = refusal(ConfigError, lambda: read_curves(measured))
    assert str(file) in said or set(COLUMNS) <= set(read_curves(measured).table.columns)


# --------------------------------------------------------------------------------------------------------------------
# files of cases


@fuzzed
@given(content=st.one_of(st.binary(max_size=100), plain.map(lambda x: json.dumps(x).encode()), st.just(b"[" * 100_000)))
def test_any_bytes_as_json(tmp_path, content):
    file = tmp_path / "status.json"
    file.write_bytes(content)
    said = refusal(ResultError, lambda: read_json(file))
    assert str(file) in said or isinstance(read_json(file), dict)


status_like = st.fixed_dictionaries(
    {},
    optional={
        "status": st.sampled_from(["converged", "degraded", "diverged", "crashed"]) | plain,
        **dict.fromkeys(
            ("attempts", "recovery", "files", "interrupted", "actuation_pressure_reached", "iterations", "reason"), plain
        ),
        "iterations_by_stage": plain,
        "solver_wall_seconds": plain,
    },
)


@fuzzed
@given(status=status_like, described=plain, sane=st.booleans())
@example(status={"status": "converged", "actuation_pressure_reached": 10**400}, described=None, sane=False)
def test_whatever_stands_in_the_files_of_a_case(loaded, make_case, tmp_path, status, described, sane):
    """Plans, statuses and tables take them for a case or for none, and say nothing else."""
    case = make_case()
    folder = tmp_path / "cases" / case.case_id
    write_json(folder / "status.json", status)
    write_json(folder / "case.json", describe(case) if sane else {"case": described})
    found, damaged = solved_cases(tmp_path)
    assert len(found) + len(damaged) == 1
    plan = make_plan(loaded, tmp_path).with_cases([case])
    assert re.fullmatch(r"\w+-\d+", plan.recovery_of(case.case_id))
    assert case_status(case, folder).case == case.case_id
    assert CaseFolder(folder).status.case == case.case_id
    assert refusal(LimoError, lambda: show_case(tmp_path, [case.case_id])) == ""


@settings(parent=fuzzed, max_examples=max(EXAMPLES // 3, 10))
@given(content=st.binary(max_size=300), magic=st.sampled_from([b"", b"\x89HDF\r\n\x1a\n", b"CDF\x01", b"CDF\x05"]))
def test_any_bytes_as_volumes(make_case, tmp_path, content, magic):
    case = make_case()
    write_json(tmp_path / "status.json", {"status": "converged", "reason": ""})
    (tmp_path / "volumes.nc").write_bytes(magic + content)
    status, values = read_case(case, CaseFiles(tmp_path), np.linspace(0, 60, 5))
    assert (status.status, values) == ("missing", {})
    assert status.reason
