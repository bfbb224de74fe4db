"""A thin binding to PARDISO in Intel's MKL (package ``mkl``): symmetric factors with one analysis and a count of pivots.

SciPy's own direct solver neither keeps its analysis nor tells the inertia of a matrix. A Newton iteration on one pattern needs
both. MKL's manual calls the parameters used here ``iparm``; they are numbered from one there.
"""

from __future__ import annotations

import ctypes
import time
from functools import cache
from importlib.metadata import files

import numpy as np
import pymetis
from scipy.sparse import csr_array

from limo.engines.newton.build import mkl_version
from limo.errors import SolverNotFoundError

_POSITIVE_DEFINITE, _SYMMETRIC_INDEFINITE = 2, -2
_ANALYSE, _FACTORISE, _SOLVE, _RELEASE = 11, 22, 33, -1
# iparm, counted from zero
_CUSTOM, _ORDERING, _OWN_ORDER, _REFINEMENT, _PIVOT_PERTURBATION, _SCALING, _MATCHING = 0, 1, 4, 7, 9, 10, 12
_PEAK, _PERMANENT, _FACTOR_MEMORY, _PIVOTING, _NEGATIVE, _SINGLE, _ZERO_BASED = 14, 15, 16, 20, 22, 27, 34
_NESTED_DISSECTION = 2
_ZERO_PIVOT, _NO_MEMORY = -4, -2
_ERRORS = {
    -1: "inconsistent input",
    _NO_MEMORY: "not enough memory",
    -3: "reordering failed",
    _ZERO_PIVOT: "zero pivot",
    -7: "singular diagonal",
    -10: "out-of-core file",
}


NO_NUMBERS = "the matrix holds values that are no numbers"


class FactorisationError(Exception):
    """PARDISO could not factorise or solve; the message says which code it gave."""

    def __init__(self, message: str, code: int = 0):
        super().__init__(message)
        self.no_memory = code == _NO_MEMORY


@cache
def _library() -> ctypes.CDLL:
    mkl_version()
    for file in files("mkl") or ():
        if file.name.startswith("libmkl_rt.so"):
            return ctypes.CDLL(str(file.locate().resolve()))
    raise SolverNotFoundError("the package mkl holds no libmkl_rt; install it again with `make setup`")


def set_threads(threads: int) -> None:
    """Threads of every factorisation of this process. One thread repeats to the bit."""
    library = _library()
    library.MKL_Set_Threading_Layer(1 if threads == 1 else 3)  # sequential, or GNU's OpenMP
    library.MKL_Set_Num_Threads(threads)


class SymmetricSolver:
    """Factors of symmetric matrices that share one pattern.

    ``indptr`` (n + 1,), ``indices``: rows of the upper triangle, diagonal included, columns rising, counted from zero.
    ``definite``: only positive definite matrices are wanted, and the first negative pivot ends a factorisation; it takes a
    quarter less time. One whose diagonal is not positive is not begun. ``single``: values, factors and solutions in single
    precision, for half of the memory. ``groups`` (n,): unknowns that share their neighbours, such as the displacements of a
    node; with them the order of elimination is found on the graph of groups, where nested dissection finds better separators.
    Raises ``FactorisationError``.
    """

    def __init__(
        self,
        indptr: np.ndarray,
        indices: np.ndarray,
        *,
        definite: bool = False,
        single: bool = False,
        groups: np.ndarray | None = None,
    ):
        self._kind = _POSITIVE_DEFINITE if definite else _SYMMETRIC_INDEFINITE
        self._indptr = np.ascontiguousarray(indptr, np.int32)
        self._indices = np.ascontiguousarray(indices, np.int32)
        self._size = len(indptr) - 1
        self._handle = np.zeros(64, np.int64)
        self._parameters = np.zeros(64, np.int32)
        self._type = np.float32 if single else np.float64
        self._values = np.zeros(len(indices), self._type)
        self._sides = aligned(2 * self._size, self._type).reshape(2, -1)
        #: CPU time (s) of factorisations and solutions
        self.seconds = 0.0
        #: iterations that refined solutions
        self.refinements = 0
        for place, value in {
            _CUSTOM: 1,
            _ORDERING: _NESTED_DISSECTION,
            _REFINEMENT: 0,
            _PIVOT_PERTURBATION: 12,
            _SCALING: 0,
            _MATCHING: 0,
            _PIVOTING: 1,
            _SINGLE: int(single),
            _ZERO_BASED: 1,
        }.items():
            self._parameters[place] = value
        self._order = None
        if groups is not None:
            self._order = elimination_order(self._indptr, self._indices, groups)
            self._parameters[_OWN_ORDER] = 1
        self._call(_ANALYSE)

    def factorise(self, values: np.ndarray, *, checked: bool = False) -> int:
        """Factorise the matrix with ``values`` (of ``indices``) and return how many of its pivots are negative.

        With ``definite`` 1 stands for one or more; there is nothing to solve with then. PARDISO itself says nothing of values
        that are no numbers and returns a solution; here they are an error, unless they are ``checked`` already.
        """
        if not checked and not np.isfinite(values.sum()):
            raise FactorisationError(NO_NUMBERS)
        if self._kind == _POSITIVE_DEFINITE and values[self._indptr[:-1]].min() <= 0:
            return 1
        self._values = np.ascontiguousarray(values, self._type)
        began = time.process_time()
        code = self._call(_FACTORISE, allowed=(_ZERO_PIVOT,) if self._kind == _POSITIVE_DEFINITE else ())
        self.seconds += time.process_time() - began
        if self._kind == _POSITIVE_DEFINITE:
            return int(code == _ZERO_PIVOT)
        return int(self._parameters[_NEGATIVE])

    def solve(self, right_side: np.ndarray) -> np.ndarray:
        """Solution (n,) with the last factors."""
        began = time.process_time()
        solution = self.substitute(right_side)
        self.seconds += time.process_time() - began
        return solution

    def substitute(self, right_side: np.ndarray) -> np.ndarray:
        """As ``solve``, for those who watch the clock themselves: to ask for it costs as much as a small solution."""
        self._sides[0] = right_side
        self._call(_SOLVE, self._sides[0], self._sides[1])
        return self._sides[1].copy()

    @property
    def memory(self) -> float:
        """MiB that analysis and factors take."""
        analysis = max(self._parameters[_PEAK], self._parameters[_PERMANENT])
        return float(max(analysis, self._parameters[_PERMANENT] + self._parameters[_FACTOR_MEMORY])) / 1024

    def close(self) -> None:
        """Give the memory of the factors back."""
        if self._handle.any():
            self._call(_RELEASE)
            self._handle[:] = 0

    def _call(
        self,
        phase: int,
        right_side: np.ndarray | None = None,
        solution: np.ndarray | None = None,
        allowed: tuple[int, ...] = (),
    ) -> int:
        empty = np.zeros(1, self._type)
        error = ctypes.c_int(0)

        def integer(value: int):
            return ctypes.byref(ctypes.c_int(value))

        def pointer(array: np.ndarray | None):
            return (empty if array is None else array).ctypes.data_as(ctypes.c_void_p)

        _library().pardiso(
            pointer(self._handle),
            integer(1),
            integer(1),
            integer(self._kind),
            integer(phase),
            integer(self._size),
            pointer(self._values),
            pointer(self._indptr),
            pointer(self._indices),
            pointer(self._order),
            integer(1),
            pointer(self._parameters),
            integer(0),
            pointer(right_side),
            pointer(solution),
            ctypes.byref(error),
        )
        if error.value and error.value not in allowed:
            raise FactorisationError(f"PARDISO: {_ERRORS.get(error.value, 'error')} ({error.value}, phase {phase})", error.value)
        return error.value


def aligned(count: int, kind: type) -> np.ndarray:
    """Zeros (count,) that begin at a multiple of 64 bytes: sums over others may be rounded in another order."""
    size = np.dtype(kind).itemsize
    whole = np.zeros(count + 64 // size, kind)
    begin = -whole.ctypes.data % 64 // size
    return whole[begin : begin + count]


def elimination_order(indptr: np.ndarray, indices: np.ndarray, groups: np.ndarray) -> np.ndarray:
    """Unknowns (n,) in the order of their elimination, those of a group together: METIS's nested dissection of the groups' graph.

    ``indptr`` (n + 1,), ``indices``: pattern of the upper triangle, or of the whole matrix; ``groups`` (n,). The same for the
    same pattern.
    """
    names, group = np.unique(groups, return_inverse=True)
    count, group = len(names), group.astype(np.int32)
    first, second = np.repeat(group, np.diff(indptr)), group[indices]
    apart = first != second
    half = csr_array((np.ones(np.count_nonzero(apart), np.int8), (first[apart], second[apart])), shape=(count, count))
    half.data[:] = 1  # sums of duplicates may have gone round to zero
    graph = half + half.T
    graph.sort_indices()
    order = np.arange(count)
    if graph.nnz:
        neighbours = pymetis.CSRAdjacency(graph.indptr, graph.indices)
        order = np.array(pymetis.nested_dissection(neighbours, options=pymetis.Options(seed=1))[0])
    place = np.empty(count, int)
    place[order] = np.arange(count)
    return np.argsort(place[group], kind="stable").astype(np.int32)
