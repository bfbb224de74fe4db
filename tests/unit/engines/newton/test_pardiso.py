"""The binding to PARDISO: solutions, inertia, reuse, errors and threads."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import csr_array, random_array, triu
from scipy.sparse.linalg import spsolve

from limo.engines.newton import pardiso
from limo.engines.newton.pardiso import FactorisationError, SymmetricSolver, elimination_order, set_threads

ROOT = Path(__file__).parents[4]
SIZE = 120


def matrix(seed: int, shift: float = 0.0) -> csr_array:
    """A sparse symmetric matrix; the same pattern for every seed, positive with a large ``shift``."""
    pattern = random_array((SIZE, SIZE), density=0.04, rng=np.random.default_rng(0))
    pattern.data = np.random.default_rng(seed).normal(size=pattern.nnz)
    diagonal = csr_array((np.random.default_rng(seed + 100).normal(size=SIZE) + shift, (range(SIZE), range(SIZE))))
    return csr_array(pattern + pattern.T + diagonal)


def upper(full: csr_array) -> csr_array:
    part = csr_array(triu(full, format="csr"))
    part.sort_indices()
    return part


@pytest.fixture
def solver():
    """A solver of the pattern of ``matrix``, released after the test."""
    set_threads(1)
    part = upper(matrix(1))
    made = SymmetricSolver(part.indptr, part.indices)
    yield made
    made.close()


@pytest.mark.parametrize("shift", [0.0, 20.0])
def test_the_solution_is_that_of_scipy(solver, shift):
    full, right = matrix(1, shift), np.random.default_rng(2).normal(size=SIZE)
    solver.factorise(upper(full).data)
    np.testing.assert_allclose(solver.solve(right), spsolve(full.tocsc(), right), rtol=1e-9)


def test_negative_pivots_are_as_many_as_negative_eigenvalues(solver):
    counts = []
    for shift in (0.0, 2.0, 4.0, 20.0):
        full = matrix(1, shift)
        counts.append(int((np.linalg.eigvalsh(full.toarray()) < 0).sum()))
        assert solver.factorise(upper(full).data) == counts[-1]
    assert counts[0] > counts[1] > counts[2] > counts[3] == 0


def test_a_solver_of_definite_matrices_tells_them_from_others_and_goes_on():
    part, right = upper(matrix(1)), np.random.default_rng(6).normal(size=SIZE)
    definite = SymmetricSolver(part.indptr, part.indices, definite=True)
    for shift in (20.0, 4.0, 0.0, 20.0):
        full = matrix(1, shift)
        least = np.linalg.eigvalsh(full.toarray()).min()
        assert definite.factorise(upper(full).data) == (least < 0)
        if least > 0:
            np.testing.assert_allclose(full @ definite.solve(right), right, atol=1e-9)
    definite.close()


def plate(count: int) -> tuple[csr_array, np.ndarray]:
    """A stiff matrix of three unknowns at each of ``count`` x ``count`` nodes, coupled to the eight around; their nodes."""
    line = np.eye(count) + np.eye(count, k=1) + np.eye(count, k=-1)
    coupled = csr_array(np.kron(np.kron(line, line), np.ones((3, 3))))
    mixed = np.random.default_rng(4).permutation(3 * count**2)
    return csr_array(coupled + 30.0 * csr_array(np.eye(3 * count**2)))[mixed][:, mixed], mixed // 3


def test_an_order_by_groups_keeps_groups_together_and_is_the_same_again():
    full, node = plate(8)
    part = upper(full)
    order = elimination_order(part.indptr, part.indices, node)
    assert sorted(order) == list(range(len(node)))
    assert (node[order].reshape(-1, 3) == node[order][::3, None]).all()
    assert np.array_equal(order, elimination_order(part.indptr, part.indices, node))
    assert np.array_equal(order, elimination_order(full.indptr, full.indices, node)), "one triangle or both"


def test_an_order_by_groups_takes_less_than_one_by_unknowns_and_solves_the_same():
    full, node = plate(40)
    part, right = upper(full), np.random.default_rng(5).normal(size=full.shape[0])
    memory = []
    for groups in (None, node):
        made = SymmetricSolver(part.indptr, part.indices, definite=True, groups=groups)
        assert made.factorise(part.data) == 0
        np.testing.assert_allclose(full @ made.solve(right), right, atol=1e-9)
        memory.append(made._parameters[16])
        made.close()
    assert memory[1] < memory[0]


@pytest.mark.parametrize("groups", [[0, 0, 0], [0, 1, 2]])
def test_groups_without_neighbours_have_an_order(groups):
    part = csr_array(np.diag([1.0, 2.0, 4.0]))
    assert sorted(elimination_order(part.indptr, part.indices, np.array(groups))) == [0, 1, 2]
    made = SymmetricSolver(part.indptr, part.indices, definite=True, groups=np.array(groups))
    made.factorise(part.data)
    np.testing.assert_allclose(made.solve(np.ones(3)), [1.0, 0.5, 0.25])
    made.close()


def test_one_analysis_serves_other_values_of_the_same_pattern(solver):
    right = np.random.default_rng(3).normal(size=SIZE)
    for seed in (1, 2, 3):
        full = matrix(seed)
        assert np.array_equal(upper(full).indices, upper(matrix(1)).indices)
        solver.factorise(upper(full).data)
        np.testing.assert_allclose(full @ solver.solve(right), right, atol=1e-9)


def test_a_factor_solves_for_several_right_sides_and_keeps_them(solver):
    full = matrix(1)
    solver.factorise(upper(full).data)
    for seed in (4, 5):
        right = np.random.default_rng(seed).normal(size=SIZE)
        before = right.copy()
        np.testing.assert_allclose(full @ solver.solve(right), before, atol=1e-9)
        assert np.array_equal(right, before)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_values_that_are_no_numbers_are_an_error(solver, value):
    """PARDISO itself would return a solution."""
    values = upper(matrix(1)).data
    values[7] = value
    with pytest.raises(FactorisationError, match="no numbers"):
        solver.factorise(values)


def test_an_error_code_of_pardiso_is_an_error_here(solver, monkeypatch):
    class Refusing:
        def pardiso(self, *arguments):
            arguments[-1]._obj.value = -4

    with monkeypatch.context() as patch:
        patch.setattr(pardiso, "_library", Refusing)
        with pytest.raises(FactorisationError, match=r"zero pivot \(-4, phase 22\)"):
            solver.factorise(upper(matrix(1)).data)


def test_the_memory_of_the_factors_is_known_and_given_back(solver):
    solver.factorise(upper(matrix(1)).data)
    assert 0 < solver.memory < 10
    solver.close()
    assert not solver._handle.any()
    solver.close()  # twice does no harm


def test_many_solvers_in_a_row_do_not_keep_their_memory():
    """Each of these factors takes 40 MiB."""
    script = """
import resource, numpy as np
from limo.engines.newton import pardiso
from limo.engines.newton.pardiso import SymmetricSolver, set_threads
set_threads(1)
n = 2300
indptr = np.concatenate([[0], np.cumsum(np.arange(n, 0, -1))])
indices = np.concatenate([np.arange(i, n) for i in range(n)])
values = np.where(indices == np.repeat(np.arange(n), np.arange(n, 0, -1)), 2.0 * n, 1.0)
peaks = []
for _ in range(6):
    solver = SymmetricSolver(indptr, indices)
    assert solver.factorise(values) == 0 and solver.memory > 30
    solver.close()
    peaks.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
print(peaks[-1] - peaks[0])
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert float(done.stdout) < 60


def test_two_threads_agree_with_one():
    """Threads are chosen once a process."""
    script = """
import sys, numpy as np
from scipy.sparse import csr_array, triu
from limo.engines.newton import pardiso
from limo.engines.newton.pardiso import SymmetricSolver, set_threads
from tests.unit.engines.newton.test_pardiso import SIZE, matrix, upper
set_threads(int(sys.argv[1]))
part = upper(matrix(1))
solver = SymmetricSolver(part.indptr, part.indices)
print(solver.factorise(part.data), *solver.solve(np.arange(SIZE, dtype=float)))
"""
    command = [sys.executable, "-c", script]
    said = [subprocess.run([*command, n], capture_output=True, text=True, check=True, cwd=ROOT).stdout for n in ("1", "1", "2")]
    one, again, two = (np.array(s.split(), float) for s in said)
    assert len(one) == SIZE + 1
    assert np.array_equal(one, again)
    assert one[0] == two[0]
    np.testing.assert_allclose(two, one, rtol=1e-10)
