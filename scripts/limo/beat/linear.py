"""The linear law that the device's authors put in the place of a surface, P_v = a P_a + b V_v + c, fitted to a surface.

It has a potential only if dV_a/dP_v = dV_v/dP_a = -a / b; with the compliance of the pouches it is a surface of its own.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from limo.beat.surface import Surface


@dataclass(frozen=True)
class LinearLaw:
    """a, b in kPa/ml, c in kPa of P_v = a P_a + b V_v + c; R^2, and its root mean square error in kPa."""

    actuation: float
    elastance: float
    offset: float
    determination: float
    error: float


def fitted(surface: Surface, ventricular: tuple[float, float], actuation: tuple[float, float]) -> LinearLaw:
    """Least squares over the loading sheet within pressures (kPa)."""
    p_v, p_a = np.meshgrid(*surface.places, indexing="ij")
    inside = (p_v >= ventricular[0]) & (p_v <= ventricular[1]) & (p_a >= actuation[0]) & (p_a <= actuation[1])
    pressure, columns = p_v[inside], np.stack([p_a[inside], surface.table[0, 0][inside], np.ones(inside.sum())], axis=1)
    found, *_ = np.linalg.lstsq(columns, pressure, rcond=None)
    miss = columns @ found - pressure
    return LinearLaw(*map(float, found), float(1 - miss.var() / pressure.var()), float(np.sqrt((miss**2).mean())))


def linear_surface(surface: Surface, law: LinearLaw) -> Surface:
    """The law as a surface at the pressures of another one: V_v from the law, V_a by its potential.

    V_a has the mean compliance over P_a of the other surface, and its mean.
    """
    p_v, p_a = np.meshgrid(surface.ventricular, surface.actuation, indexing="ij")
    ventricle = (p_v - law.actuation * p_a - law.offset) / law.elastance
    pouches = surface.volumes[0, 1]
    compliance = float((pouches[:, -1] - pouches[:, 0]).mean() / (surface.actuation[-1] - surface.actuation[0]))
    actuation = -law.actuation / law.elastance * p_v + compliance * p_a
    actuation += max(pouches.mean() - actuation.mean(), 1.0 - actuation.min())
    one = np.stack([ventricle, actuation])
    return replace(surface, device=f"{surface.device}, linear law", volumes=np.stack([one, one]), known=None)
