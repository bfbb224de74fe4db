"""Fixtures shared by all tests: the shipped configuration, coarse meshes, cases, and writers of solver files.

With several workers (``make test``) what is dear and can be kept is made by one of them, see ``tests/helpers/shared.py``.
"""

from __future__ import annotations

import contextlib
import os
import struct
from collections.abc import Callable
from functools import cache
from itertools import product
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from limo.cases.case import Case
from limo.config.load import load_config
from limo.config.project import Project
from limo.geometry.pattern import FlatPattern, flat_pattern
from limo.mesh.device import STRATEGIES
from limo.mesh.elements import gauss, quad8_shape
from limo.mesh.flat import FlatMesh, mesh_pattern, smallest_jacobian
from limo.mesh.layers import DeviceMesh, layered
from limo.schema.numerics import Mesh, MeshLevel
from tests.helpers import shared

ROOT = Path(__file__).resolve().parents[1]
COARSE = MeshLevel(degrees_of_freedom=12000, grading=0.8)
#: fixtures that one worker makes for all, dearest first: see ``_schedule``
MADE_ONCE = ("everything", "tested", "solved", "finished", "pretended_once")
#: files of long tests that share something dear, which one worker takes
TOGETHER = (
    "workflow/test_bench_tutorial.py",
    "workflow/test_page.py",
    "workflow/test_paths.py",
    "workflow/test_slurm.py",
    "physics/test_recovery.py",
    "physics/test_stress.py",
)


def pytest_xdist_make_scheduler(config: pytest.Config, log):
    """What several workers take as one: a file of quick tests, or one of ``TOGETHER``; any other test is by itself.

    The marks of ``--dist loadgroup`` are not seen by pytest-xdist 3.8 under pytest 9.2.
    """
    from xdist.scheduler import LoadScopeScheduling

    class Scheduling(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            file = nodeid.partition("::")[0]
            return file if file.removeprefix("tests/").startswith(("unit/", *TOGETHER)) else nodeid

    return Scheduling(config, log)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Order what several workers share."""
    if "PYTEST_XDIST_WORKER" in os.environ:
        _schedule(items)


def _schedule(items: list[pytest.Item]) -> None:
    """Order tests so that no worker waits for another one.

    First comes one test of each fixture of ``MADE_ONCE``, which different workers then make side by side. Long tests that need
    none of them follow, then those that do. The quick ones fill the time of the worker that is done earlier.
    """
    makers: dict[str, pytest.Item] = {}
    for item in items:
        for name in MADE_ONCE:
            if _folder(item) == "workflow" and name in item.fixturenames:
                makers.setdefault(name, item)
    first = [makers[name] for name in MADE_ONCE if name in makers]

    def rank(item: pytest.Item) -> int:
        if item in first:
            return first.index(item) - len(first)
        shares = _folder(item) == "workflow" and not makers.keys().isdisjoint(item.fixturenames)
        return {"workflow": 2 if shares else 0, "physics": 1, "unit": 3}[_folder(item)]

    items.sort(key=rank)


def _folder(item: pytest.Item) -> str:
    return item.path.relative_to(ROOT / "tests").parts[0]


@pytest.fixture(scope="session", autouse=True)
def common_folder(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Where the workers keep what they share."""
    shared.FOLDER = shared.common_folder(tmp_path_factory.getbasetemp())


@pytest.fixture(scope="session")
def root() -> Path:
    """The project's root."""
    return ROOT


@pytest.fixture(scope="session")
def loaded() -> Project:
    """The shipped configuration."""
    with contextlib.chdir(ROOT):
        return load_config("config/config.yaml", strict=True)


@pytest.fixture(scope="session")
def coarse(loaded) -> Callable[..., SimpleNamespace]:
    """``coarse(device, n_pouches)``: its flat pattern and a coarse flat mesh without folds, made once."""

    def without_folds(pattern: FlatPattern) -> FlatMesh:
        for size, strategy in product((9.0, 8.5, 8.0, 7.5, 7.0), STRATEGIES):
            flat = mesh_pattern(pattern, size, COARSE.grading, strategy)
            if smallest_jacobian(flat.nodes, flat.quads).min() > 0.2:
                return flat
        raise AssertionError(f"no coarse mesh with N_p = {pattern.n_pouches}")

    @cache
    def make(device: str, n_pouches: int) -> SimpleNamespace:
        pattern = flat_pattern(loaded.devices[device].pattern, n_pouches)
        flat = shared.kept(f"coarse_{device}_{n_pouches}", lambda: without_folds(pattern))
        return SimpleNamespace(pattern=pattern, flat=flat)

    return make


@pytest.fixture(scope="session")
def device_mesh(coarse) -> Callable[..., DeviceMesh]:
    """``device_mesh(device, n_pouches, symmetry)``: the coarse layered mesh, made once."""

    @cache
    def make(device: str = "limo", n_pouches: int = 8, symmetry: str = "quarter") -> DeviceMesh:
        made = coarse(device, n_pouches)
        return layered(made.flat, made.pattern, symmetry)

    return make


@pytest.fixture(scope="session")
def make_case(loaded) -> Callable[..., Case]:
    """``make_case(**changes)``: a case of the shipped device, N_p = 8, P_v = 3.8 kPa, P_a,max = 60 kPa, coarse quarter model."""

    def make(**changes) -> Case:
        values = {
            "device": loaded.devices["limo"], "device_name": "limo", "n_pouches": 8, "ventricular_pressure": 3.8,
            "actuation_pressure_max": 60.0, "aspect_ratio": 2.0, "stiffness_ratio": 1.0,
            "mesh": Mesh(level="preview", symmetry="quarter", element="C3D20R"), "mesh_level": COARSE,
            "numerics": loaded.config.numerics_presets["fast"], "numerics_name": "fast", "frames": (0.0, 60.0),
        }  # fmt: skip
        return Case(**(values | changes))

    return make


@pytest.fixture(scope="session")
def quad_areas() -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """``quad_areas(nodes, quads)``: signed areas (m,) in the plane, from the Jacobian at 3 x 3 Gauss points."""
    local, weights = gauss(3, 2)
    _, slope = quad8_shape(local)

    def areas(nodes: np.ndarray, quads: np.ndarray) -> np.ndarray:
        jacobian = np.einsum("gnk,enx->egxk", slope, nodes[quads][..., :2])
        return np.linalg.det(jacobian) @ weights

    return areas


@pytest.fixture(scope="session")
def frd_bytes() -> Callable[..., bytes]:
    """``frd_bytes(frames, kind)``: a binary .frd with displacement frames of (step, increment, time, node numbers, u).

    The layout is that of CalculiX 2.20: nodes as float64, one brick, displacements as ``f4`` (format 2) or ``f8`` (format 3);
    no line ends after binary records.
    """

    def build(frames: list[tuple], kind: str = "f4", *, end: bool = True) -> bytes:
        digit = {"f4": 2, "f8": 3}[kind]
        nodes = np.array([(k + 1, (k, 0.0, 0.0)) for k in range(20)], [("n", "<i4"), ("x", "<f8", 3)])
        parts = [b"    1C\n    1UPGM               CalculiX                                        \n"]
        parts += [b"    2C%30d%38d\n" % (20, 3), nodes.tobytes()]
        parts += [b"    3C%30d%38d\n" % (1, 2), struct.pack("<24i", 1, 4, 0, 1, *range(1, 21))]
        for count, (step, increment, time, numbers, u) in enumerate(frames, 1):
            records = np.zeros(len(numbers), [("n", "<i4"), ("u", f"<{kind}", 3)])
            records["n"], records["u"] = numbers, u
            clock = f"{time:.9f}"[:11].encode()
            frame_line = b"  100CL%5d%12s%12d%22d%5d%12d\n" % (100 + count, clock, len(numbers), 1, count, digit)
            parts.append(b"    1PSTEP%26d%12d%12d          \n" % (count, increment, step))
            parts += [frame_line, b" -4  DISP        4    1\n"]
            parts += [b" -5  D%d          1    2    %d    0\n" % (k, k) for k in (1, 2, 3)]
            parts += [b" -5  ALL         1    2    0    0    1ALL\n", records.tobytes()]
        return b"".join(parts) + (b" 9999\n" if end else b"")

    return build
