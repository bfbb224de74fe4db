"""The rigid elliptic valve support, onto which the flat valve edge is fitted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from limo.schema.device import Pattern


@dataclass(frozen=True)
class ValveEllipse:
    """Rigid valve support, x = a sin(phi), z = b cos(phi), with b = a / AR and a fixed perimeter (mm).

    The paper's Eq. (valve) prints the factor of z upside down; the semi-axis in z is a / AR.
    """

    semi_x: float
    semi_z: float

    @classmethod
    def from_perimeter(cls, quarter_perimeter: float, aspect_ratio: float) -> ValveEllipse:
        """Semi-axes with the given quarter perimeter: a E(m) with m = 1 - 1 / AR^2 (AR >= 1)."""
        from scipy.special import ellipe  # takes 0.1 s

        semi_x = quarter_perimeter / ellipe(1.0 - aspect_ratio**-2)
        return cls(semi_x, semi_x / aspect_ratio)

    def arc(self, phi: np.ndarray | float) -> np.ndarray:
        """Arc length (mm) from x = 0 to the parameter phi: a E(phi, 1 - (b / a)^2)."""
        from scipy.special import ellipeinc

        return self.semi_x * ellipeinc(phi, 1.0 - (self.semi_z / self.semi_x) ** 2)

    def place(self, arc_length: np.ndarray) -> np.ndarray:
        """Points (n, 2) = (x, z) on the quarter ellipse at arc lengths (n,) from x = 0 (paper, Eq. valve stretch).

        Newton's method on the arc length, whose slope lies between b and a; arc lengths outside the quarter are clipped.
        """
        quarter = self.arc(np.pi / 2)
        wanted = np.clip(np.asarray(arc_length, float), 0.0, quarter)
        phi = wanted / quarter * np.pi / 2
        for _ in range(50):
            slope = np.hypot(self.semi_x * np.cos(phi), self.semi_z * np.sin(phi))
            change = (self.arc(phi) - wanted) / slope
            phi = np.clip(phi - change, 0.0, np.pi / 2)
            if np.abs(change).max(initial=0.0) < 1e-14:
                break
        phi[wanted == 0.0], phi[wanted == quarter] = 0.0, np.pi / 2
        points = np.stack([self.semi_x * np.sin(phi), self.semi_z * np.cos(phi)], axis=1)
        points[np.abs(points) < 1e-12 * self.semi_x] = 0.0
        return points


def quarter_perimeter(pattern: Pattern) -> float:
    """A quarter of the valve's perimeter in mm, the same for every aspect ratio (the edge is inextensible); 0 without one."""
    from scipy.special import ellipe

    valve = pattern.valve
    if valve is None:
        return 0.0
    if valve.flat_half_width_over_length is not None:
        return valve.flat_half_width_over_length * pattern.length
    return valve.semi_major_over_length * pattern.length * float(ellipe(1.0 - valve.at_aspect_ratio**-2))
