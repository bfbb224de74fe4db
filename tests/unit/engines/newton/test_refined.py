"""Solutions by a factor in single precision: as exact as asked for, and a matrix that is not positive is seen."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import csr_array, triu

from limo.engines.newton import kernels, refined
from limo.engines.newton.assembly import Assembly
from limo.engines.newton.pardiso import FactorisationError, SymmetricSolver, aligned, set_threads
from limo.engines.newton.refined import TOLERANCE, RefinedSolver
from limo.engines.newton.tangent import Tangent
from limo.engines.newton.unknowns import displacements, means
from tests.helpers.matrices import deformed, directions, whole

ROOT = Path(__file__).parents[4]
SIZE = 200
SHIFT = 1e6  # 1/s^2


@pytest.fixture(autouse=True)
def one_thread() -> None:
    set_threads(1)


def plate(least: float = 1.0) -> csr_array:
    """A stiff symmetric matrix of a chain with far neighbours; ``least`` is its smallest eigenvalue."""
    ones = np.ones(SIZE)
    chain = (
        np.diag(4 * ones)
        - np.diag(ones[1:], 1)
        - np.diag(ones[1:], -1)
        - np.diag(0.5 * ones[9:], 9)
        - np.diag(0.5 * ones[9:], -9)
    )
    scale = np.logspace(0, 3, SIZE)
    matrix = scale[:, None] * (chain + 3 * np.eye(SIZE)) * scale
    return csr_array(matrix + np.where(np.eye(SIZE) > 0, least - np.linalg.eigvalsh(matrix).min(), 0.0))


def upper(matrix: csr_array) -> csr_array:
    part = csr_array(triu(matrix, format="csr"))
    part.sort_indices()
    return part


def solver_of(matrix: csr_array) -> RefinedSolver:
    part = upper(matrix)
    return RefinedSolver(part.indptr, part.indices)


def error(matrix: csr_array, found: np.ndarray, right: np.ndarray) -> float:
    """Error of a solution in the energy norm of the matrix, over the solution."""
    exact = np.linalg.solve(matrix.toarray(), right)
    rest = found - exact
    return float(np.sqrt((rest @ (matrix @ rest)) / (exact @ (matrix @ exact))))


def test_solutions_are_those_in_double_precision_to_the_tolerance():
    matrix, right = plate(), np.random.default_rng(1).normal(size=SIZE)
    solver = solver_of(matrix)
    assert solver.factorise(upper(matrix).data) == 0
    assert error(matrix, solver.solve(right), right) < TOLERANCE / 10
    solver.close()


@pytest.mark.parametrize("tolerance", [1e-2, 1e-6, 1e-12])
def test_more_refinement_is_more_exact(monkeypatch, tolerance):
    monkeypatch.setattr(refined, "TOLERANCE", tolerance)
    matrix, right = plate(), np.random.default_rng(1).normal(size=SIZE)
    solver = solver_of(matrix)
    solver.factorise(upper(matrix).data)
    assert error(matrix, solver.solve(right), right) < 10 * tolerance
    assert solver.refinements >= (2 if tolerance < 1e-8 else 1)
    solver.close()


@pytest.mark.parametrize("size", [1e-60, 1.0, 1e60])
def test_right_sides_beyond_single_precision_are_solved_for(size):
    matrix, right = plate(), np.random.default_rng(1).normal(size=SIZE)
    solver = solver_of(matrix)
    solver.factorise(upper(matrix).data)
    np.testing.assert_allclose(solver.solve(size * right) / size, solver.solve(right), rtol=1e-6, atol=1e-12)
    assert not solver.solve(0 * right).any()
    solver.close()


def test_values_and_right_sides_stay_as_they_are():
    matrix, right = plate(), np.random.default_rng(1).normal(size=SIZE)
    solver, values = solver_of(matrix), upper(matrix).data
    before = values.copy(), right.copy()
    solver.factorise(values)
    solver.solve(right)
    assert np.array_equal(values, before[0])
    assert np.array_equal(right, before[1])
    solver.close()


@pytest.mark.parametrize("least", [-1e4, -1e6, -1e8])
def test_an_indefinite_matrix_is_reported_and_the_next_one_solved(least):
    solver, right = solver_of(plate()), np.random.default_rng(1).normal(size=SIZE)
    assert solver.factorise(upper(plate(least)).data) == 1
    assert solver.factorise(upper(plate()).data) == 0
    assert error(plate(), solver.solve(right), right) < TOLERANCE
    solver.close()


def test_a_diagonal_or_a_minor_that_is_not_positive_needs_no_factor(monkeypatch):
    solver, single = solver_of(plate()), solver_of(plate())._inner
    double = SymmetricSolver(single._indptr, single._indices, definite=True)
    for made in (solver._inner, double):
        monkeypatch.setattr(made, "_call", lambda *arguments, **options: pytest.fail("factorised"))
    values = upper(plate()).data
    for entry, size in ((0, 0.0), (0, -1.0), (1, 1e9)):  # of the first row: its diagonal and what is beside it
        changed = values.copy()
        changed[entry] = size
        assert solver.factorise(changed) == 1
        if entry == 0:
            assert double.factorise(changed) == 1


def test_a_direction_of_negative_curvature_is_no_step():
    """As where single precision has not seen a negative eigenvalue."""
    matrix, right = plate(), np.random.default_rng(1).normal(size=SIZE)
    solver, values = solver_of(matrix), upper(matrix).data
    solver.factorise(values)
    solver._values = -values
    assert solver.solve(right) is None
    solver._values = values
    assert solver.solve(right) is not None
    solver.close()


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_values_that_are_no_numbers_are_an_error(value):
    matrix = plate()
    solver = solver_of(matrix)
    for entry in (0, 7):
        values = upper(matrix).data
        values[entry] = value
        with pytest.raises(FactorisationError, match="no numbers"):
            solver.factorise(values)
    solver.close()


def test_the_compiled_product_is_that_of_the_matrix():
    matrix, vector = plate(), np.random.default_rng(3).normal(size=SIZE)
    part, found = upper(matrix), np.empty(SIZE)
    kernels.symmetric_product(part.data, part.indptr, part.indices, vector, found)
    np.testing.assert_allclose(found, matrix @ vector, rtol=1e-12)
    scale, single = 1 / np.sqrt(matrix.diagonal()), np.empty(len(part.data), np.float32)
    large = kernels.scale_upper(part.data, part.indptr, part.indices, scale, single)
    scaled = scale[:, None] * matrix.toarray() * scale
    np.testing.assert_allclose(csr_array((single, part.indices, part.indptr)).toarray(), np.triu(scaled), rtol=1e-6)
    assert large == (np.abs(np.triu(scaled, 1)) >= 1).sum()


def test_arrays_begin_at_multiples_of_64_bytes():
    for kind in (np.float32, np.float64):
        for count in (1, 7, 1000):
            made = aligned(count, kind)
            assert (made.ctypes.data % 64, made.shape, made.dtype) == (0, (count,), kind)
            assert not made.any()


# --- the tangent of a device ----------------------------------------------------------------------------------------------


@pytest.fixture
def device(make_model) -> tuple[Tangent, np.ndarray, np.ndarray]:
    """The tangent on means of a device, its values at a deformed state, and a right side on the free displacements."""
    assembly = Assembly(make_model())
    tangent = Tangent(assembly, means(assembly))
    u = 0.1 * deformed(assembly)
    return tangent, tangent.assemble(u, 3.8, 20.0, 1e9), directions(assembly)[0]


def test_a_device_takes_one_or_two_refinements(device):
    tangent, values, right = device
    solver = RefinedSolver(tangent.indptr, tangent.indices, groups=tangent.unknowns.groups)
    exact = SymmetricSolver(tangent.indptr, tangent.indices, definite=True)
    assert (solver.factorise(values), exact.factorise(values)) == (0, 0)
    right = tangent.unknowns.reduce(right)
    rest, solution = solver.solve(right) - exact.solve(right), exact.solve(right)
    matrix = whole(tangent, values)
    assert solver.refinements <= 2
    assert rest @ (matrix @ rest) < TOLERANCE**2 * (solution @ (matrix @ solution))
    for made in (solver, exact):
        made.close()


def test_single_precision_takes_less_memory_and_double_none_more(device):
    tangent, values, _ = device
    plain = Tangent(tangent._assembly, displacements(tangent._assembly))
    double = SymmetricSolver(plain.indptr, plain.indices, definite=True, groups=plain.unknowns.groups)
    single = RefinedSolver(tangent.indptr, tangent.indices, groups=tangent.unknowns.groups)
    for solver in (double, single):
        solver.factorise(values if solver is single else plain.assemble(np.zeros_like(plain._assembly.prescribed), 0, 0, 1e9))
    assert 1 < single.memory < double.memory
    for solver in (double, single):
        solver.close()
        solver.close()  # twice does no harm


def test_solutions_repeat_to_the_bit():
    """In processes with other addresses of their arrays."""
    script = """
import sys, numpy as np
held = [np.ones(int(n)) for n in sys.argv[1:]]
from limo.engines.newton.pardiso import set_threads
from tests.unit.engines.newton.test_refined import SIZE, plate, solver_of, upper
set_threads(1)
solver = solver_of(plate())
print(solver.factorise(upper(plate()).data), *solver.solve(np.arange(SIZE, dtype=float)))
"""
    said = [
        subprocess.run([sys.executable, "-c", script, *odd], capture_output=True, text=True, check=True, cwd=ROOT).stdout
        for odd in ((), ("3", "17", "1001"))
    ]
    assert said[0] == said[1]
    assert len(said[0].split()) == SIZE + 1
