"""Solutions to a tolerance by a factor in single precision: conjugate gradients on the matrix in double precision.

The matrix is scaled to ones on its diagonal, D K D with D_ii = K_ii^-1/2, rounded to single precision and factorised. That
takes half of the memory of a factor in double precision and little more than half of its time. P, the product of the factors,
is the preconditioner of conjugate gradients. They end where

    r_k . P^-1 r_k <= tolerance^2 (r_0 . P^-1 r_0),   r_k = b - K x_k

and the correction P^-1 r_k, which is known by then, is added. A matrix that is indefinite by less than single precision
resolves may have a factor: there a direction p with p . K p <= 0 tells. Saad, *Iterative methods for sparse linear systems*
(2003), section 9.2.
"""

from __future__ import annotations

import time

import numpy as np

from limo.engines.newton import kernels
from limo.engines.newton.pardiso import NO_NUMBERS, FactorisationError, SymmetricSolver, aligned

#: what is left of the right side, in the energy norm of the preconditioner
TOLERANCE = 0.05
#: most iterations; a step that is not so exact goes downhill all the same
MOST = 8


class RefinedSolver:
    """As ``SymmetricSolver`` of definite matrices, with solutions to ``TOLERANCE``.

    ``indptr`` (n + 1,), ``indices``, ``groups`` (n,) as there. ``refinements`` counts iterations of conjugate gradients. Raises
    ``FactorisationError``.
    """

    def __init__(self, indptr: np.ndarray, indices: np.ndarray, *, groups: np.ndarray | None = None):
        self._inner = SymmetricSolver(indptr, indices, definite=True, single=True, groups=groups)
        self._indptr, self._indices = (np.ascontiguousarray(x, np.int32) for x in (indptr, indices))
        self._single = aligned(len(indices), np.float32)
        self._values = np.empty(0)
        self._scale = np.empty(0)
        self._seconds = 0.0
        self.refinements = 0

    def factorise(self, values: np.ndarray) -> int:
        """Factorise the matrix with ``values`` (of ``indices``) and return 0, or 1 where it is seen not to be positive.

        ``values`` are used again by ``solve``: they are not copied.
        """
        diagonal = values[self._indptr[:-1]]
        if not np.isfinite(diagonal).all():
            raise FactorisationError(NO_NUMBERS)
        if diagonal.min() <= 0:
            return 1
        self._values, self._scale = values, 1.0 / np.sqrt(diagonal)
        large = kernels.scale_upper(values, self._indptr, self._indices, self._scale, self._single)
        if large < 0:
            raise FactorisationError(NO_NUMBERS)
        if large:
            return 1  # the minor of two unknowns is negative
        return self._inner.factorise(self._single, checked=True)

    def solve(self, right_side: np.ndarray) -> np.ndarray | None:
        """Solution (n,) with the last factors; None where the matrix turns out not to be positive."""
        began = time.process_time()
        solution = self._conjugate_gradients(right_side)
        self._seconds += time.process_time() - began
        return solution

    def _conjugate_gradients(self, right_side: np.ndarray) -> np.ndarray | None:
        solution, product = np.zeros(len(right_side)), np.empty(len(right_side))
        if not right_side.any():
            return solution
        residual = right_side
        direction = correction = self._corrected(residual)
        energy = first = residual @ correction
        for k in range(MOST):
            kernels.symmetric_product(self._values, self._indptr, self._indices, direction, product)
            curvature = direction @ product
            if not curvature > 0:  # nor where it is no number
                return solution if k else None
            self.refinements += 1
            solution += energy / curvature * direction
            residual = residual - energy / curvature * product
            correction = self._corrected(residual)
            energy, last = residual @ correction, energy
            if energy <= TOLERANCE**2 * first:
                return solution + correction
            direction = correction + energy / last * direction
        return solution

    def _corrected(self, residual: np.ndarray) -> np.ndarray:
        """P^-1 r (n,), with r brought to the range of single precision."""
        scaled = self._scale * residual
        size = np.abs(scaled).max()
        return self._scale * self._inner.substitute(scaled / size) * size if size > 0 else scaled

    @property
    def seconds(self) -> float:
        """CPU time (s) of factorisations and solutions."""
        return self._inner.seconds + self._seconds

    @property
    def memory(self) -> float:
        """MiB that analysis and factors take, and the matrix in single precision."""
        return self._inner.memory + self._single.nbytes / 2**20

    def close(self) -> None:
        """Give the memory of the factors back."""
        self._inner.close()
