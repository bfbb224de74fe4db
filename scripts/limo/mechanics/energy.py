"""Energy balance of the ramp: what the pressures put in, what the fabric stores, and what damping takes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from limo.mechanics import shell
from limo.mechanics.kinematics import deformation_gradient, energy_and_extremes, green_lagrange
from limo.mechanics.model import Model
from limo.mechanics.volumes import flux
from limo.mesh.elements import gauss


def conjugate_volumes(model: Model, displacements: np.ndarray) -> tuple[float, float]:
    """Volumes (mm^3, full device) whose changes times P_v and P_a are the work of the model's pressures.

    They are swept by the loaded faces of the bricks, while ``volumes.volumes`` reports those of the middle surface, on which
    shells are loaded. The two differ by half a thickness times a change of area. Exact for P_a, whose faces close; for P_v up
    to what half a thickness sweeps where the outer edge turns (0.3 % on a real ramp). Both up to the 2 x 2 points that C3D20R
    integrates pressures with. ``displacements`` (n, 3) in mm.
    """
    x = model.nodes + displacements
    swept = np.zeros(2)
    for load in model.pressures:
        sign = 1.0 if load.side == "bottom" else -1.0
        surface = np.mean([x[nodes] for nodes in model.loaded(load.side)], axis=0)
        volume = sign * flux(surface, model.mesh.quads[load.quads]).sum()
        swept += volume * np.array([load.ventricular, load.actuation])
    return tuple(float(v) for v in model.mesh.copies * swept)


def energy_and_extremes_of(model: Model, displacements: np.ndarray) -> tuple[float, float, float]:
    """Strain energy of the full device in mJ (N mm), with the quadrature of the model's element and what its contact stores;
    smallest det F and stretch across the layer."""
    energy, *extremes = part_energy_and_extremes(model, displacements)
    if (touching := model.touching) is not None:
        energy += touching.energy(model.middle(displacements))
    return model.mesh.copies * energy, *extremes


def part_energy_and_extremes(model: Model, displacements: np.ndarray) -> tuple[float, float, float]:
    """The same of the part that is modelled."""
    layer = model.expansion
    if not model.element.plane_stress:
        moved, points = displacements[: len(layer.nodes)], model.element.gauss_points
        law = model.youngs_modulus, model.poisson_ratio, points, model.stiffness
        return energy_and_extremes(layer.nodes, layer.bricks, moved, *law)
    local, weights = gauss(model.element.gauss_points, 3)
    deformation, jacobian = deformation_gradient(layer.nodes, layer.bricks, displacements, local)
    deformation = deformation @ shell.layer_axes(model, local)
    density = shell.energy_density(green_lagrange(deformation), shell.stiffness(model))
    layered = shell.thinned(model, deformation)
    energy = float(np.einsum("mg,mg,g->", density, jacobian, weights))
    return energy, float(np.linalg.det(layered).min()), float(np.linalg.norm(layered[..., 2], axis=-1).min())


def stored_energy(model: Model, displacements: np.ndarray) -> float:
    """Strain energy of the full device in mJ (N mm)."""
    return energy_and_extremes_of(model, displacements)[0]


@dataclass(frozen=True)
class EnergyBalance:
    """Energies of the ramp in mJ: work of P_a and P_v on the device, change of strain energy, and the rest."""

    actuation_work: float
    ventricular_work: float
    strain_energy_change: float

    @property
    def dissipated(self) -> float:
        """Work that was neither stored nor given to the ventricle; kinetic energy at the end is counted here too."""
        return self.actuation_work + self.ventricular_work - self.strain_energy_change

    @property
    def dissipated_fraction(self) -> float:
        """Dissipated share of the actuation work."""
        return self.dissipated / self.actuation_work if self.actuation_work else float("nan")


def ramp_balance(
    actuation_pressure: np.ndarray, ventricular_pressure: float, conjugate: np.ndarray, strain_energy_change: float
) -> EnergyBalance:
    """Balance over a ramp: pressures (n,) and P_v in kPa, conjugate volumes (n, 2) in mm^3, energies in mJ.

    W_a = int P_a dV_a (trapezoidal over the increments), W_v = P_v (V_v(end) - V_v(start)); kPa mm^3 = 1e-3 mJ.
    """
    ventricle, actuation = conjugate.T
    return EnergyBalance(
        float(np.trapezoid(actuation_pressure, actuation)) * 1e-3,
        float(ventricular_pressure * (ventricle[-1] - ventricle[0])) * 1e-3,
        strain_energy_change,
    )
