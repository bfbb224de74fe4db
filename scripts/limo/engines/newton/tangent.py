"""The consistent tangent of the brick layer, assembled on given unknowns of a model.

    K = -dr/dq,   r(q) = T^T (f_p - f_int)

The tangent per node pair (n, m) is

    K_nm = sum_g w (dN_n/dX_K) A_iKjL (dN_m/dX_L),   A_iKjL = lambda F_iK F_jL + mu (b_ij delta_KL + F_iL F_jK) + delta_ij S_KL

with b = F F^T, plus that of the pressures. Follower pressure on a surface whose edges are held or meet others is
conservative, so K is symmetric. What single edges leave over (half a thickness of the rotating valve edge) is symmetrised. The
2 x 2 points that CalculiX gives the faces of C3D20R leave a rest inside, which is symmetrised too; 3 x 3 points leave none.
Units: mm, N, MPa, tonne, s.
"""

from __future__ import annotations

import numpy as np

from limo.engines.newton import kernels, woven_kernels
from limo.engines.newton.assembly import Assembly
from limo.engines.newton.contact import ContactTangent
from limo.engines.newton.entries import entries_of
from limo.engines.newton.kernels import PAIRS
from limo.engines.newton.pattern import Patterned
from limo.engines.newton.unknowns import Unknowns, displacements
from limo.mesh.elements import gauss, hex20_shape


class Tangent(Patterned):
    """K and the consistent mass M of an assembly on ``unknowns``, by default its free displacements."""

    def __init__(self, assembly: Assembly, unknowns: Unknowns | None = None):
        self._assembly = assembly
        self.unknowns = displacements(assembly) if unknowns is None else unknowns
        self.size = self.unknowns.size
        self._gradient = np.ascontiguousarray(self.unknowns.of_elements(assembly.gradient, assembly.bricks))
        self._plan()
        self._own_mass = self._assemble_mass()
        self.touch()

    def assemble(
        self, u: np.ndarray, ventricular: float, actuation: float, shift: float = 0.0, stress: np.ndarray | None = None
    ) -> np.ndarray:
        """Values of K + shift M on the pattern at displacements (n, 3) in mm, pressures in kPa and a shift in 1/s^2.

        ``stress`` (m, g, 6), J w S in N mm, takes the place of that of the displacements in the geometric stiffness.
        """
        assembly = self._assembly
        values = self._shifted(shift)
        if stress is None:
            stress = assembly.inside(u)[1]
        tables = self._sources, self._places, self._special, self._weights
        states = assembly.slopes(u)[0], stress, self._gradient, assembly.volume
        if assembly.law is None:
            kernels.tangent(*states, assembly.lame, *tables, values)
        else:
            woven_kernels.tangent(*states, assembly.law, *tables, values)
        self._from_faces.add(assembly.faces.tangent(u, ventricular, actuation), values)
        self._contact.add(values, u)
        return values[:-1]

    def _plan(self) -> None:
        """The pattern, and where in its values the entries of element matrices go."""
        keys, factors, sources = entries_of(self._assembly.bricks, self.unknowns, PAIRS)
        unique, inverse = np.unique(keys, return_inverse=True)
        del keys
        places = self._places_of(inverse, factors, sources, len(unique))
        faces = self._assembly.faces
        # the slots of a face are among those of its brick
        self._begin(unique, places, faces.entries(self.unknowns))
        self._contact = ContactTangent(self._assembly, self.unknowns)

    def _places_of(self, places: np.ndarray, factors: np.ndarray, sources: np.ndarray, nowhere: int) -> np.ndarray:
        """Tables for ``kernels.tangent``: an element's entries that count, their places, and factors where any is not one."""
        count, size = len(self._assembly.bricks), 400 * len(PAIRS)
        self._sources = np.flatnonzero(np.bincount(sources % size)).astype(np.int32)
        place = sources // size, np.searchsorted(self._sources, sources % size)
        # what goes nowhere goes behind the last value
        found = np.full((count, len(self._sources)), nowhere, np.int32)
        found[place] = places
        weights = np.ones(found.shape)
        weights[place] = factors
        odd = (weights != 1).any(axis=1)
        self._special = np.where(odd, np.cumsum(odd) - 1, -1).astype(np.int32)
        self._weights = weights[odd]
        return found

    def _assemble_mass(self) -> np.ndarray:
        """Values of the consistent mass on the pattern without contact (3 x 3 x 3 points)."""
        model, bricks = self._assembly.model, self._assembly.bricks
        shell = model.expansion
        local, weights = gauss(3, 3)
        shapes, slopes = hex20_shape(local)
        jacobian = np.einsum("gnd,mnk->mgkd", slopes, shell.nodes[shell.bricks])
        volume = np.linalg.det(jacobian) * weights
        element = model.density[:, None, None] * np.einsum("gn,gp,mg->mnp", shapes, shapes, volume, optimize=True)
        for _ in range(2):  # rows, then columns
            element = self.unknowns.of_elements(element, bricks).swapaxes(1, 2)
        blocks = np.zeros((len(element), 20, len(PAIRS), 20))
        blocks[:, :, :3] = element[:, :, None]
        entries = blocks.reshape(len(element), -1)[:, self._sources]
        entries[self._special >= 0] *= self._weights
        return np.bincount(self._places.ravel(), entries.ravel(), len(self.indices) + 1)[:-1]
