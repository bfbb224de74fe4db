"""The stress that a step predicts linearly, against its definition."""

from __future__ import annotations

import numpy as np
import pytest

from limo.engines.newton import shell_kernels
from limo.engines.newton.assembly import Assembly
from limo.engines.newton.mixed import MixedStress
from limo.engines.newton.shell import ShellAssembly
from limo.engines.newton.tangent import Tangent
from tests.helpers.matrices import deformed, directions, stiffness, whole


@pytest.fixture(params=["isotropic", "woven"])
def step(request, make_model) -> tuple[Assembly, np.ndarray, np.ndarray]:
    """A state of a device and one after a step of tenths of millimetres (n, 3)."""
    assembly = Assembly(make_model(fabric=request.param))
    u = 0.2 * deformed(assembly)
    return assembly, u, u + assembly.expand(0.1 * directions(assembly)[0])


def stress(assembly: Assembly, u: np.ndarray) -> np.ndarray:
    """J w S (m, g, 6)."""
    return assembly.inside(u)[1].copy()


def predicted(assembly: Assembly, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """S(before) and its slope along the step: five points are exact for what is quadratic."""
    way = after - before
    near, far = (stress(assembly, before + k * way) - stress(assembly, before - k * way) for k in (0.5, 1.0))
    return stress(assembly, before) + (8 * near - far) / 6


def test_the_stress_after_a_step_is_that_before_and_its_slope(step):
    assembly, before, after = step
    mixed = MixedStress(assembly)
    mixed.leave(before)
    mixed.arrive(after, 1.0)
    expected, there = predicted(assembly, before, after), stress(assembly, after)
    scale = np.abs(there).max()
    assert np.abs(mixed.stress - expected).max() < 1e-10 * scale
    assert np.abs(there - expected).max() > 1e-2 * scale, "the quadratic part counts"


def test_a_part_of_a_step_keeps_what_it_did_not_take(step):
    """As the linear system has it: sigma + a (what a whole step would make of it - sigma)."""
    assembly, before, after = step
    mixed, share = MixedStress(assembly), 0.3
    own = mixed.stress = stress(assembly, before) * 0.5
    mixed.leave(before)
    mixed.arrive(before + share * (after - before), share)
    expected = own + share * (predicted(assembly, before, after) - own)
    assert np.abs(mixed.stress - expected).max() < 1e-10 * np.abs(expected).max()


def test_the_first_step_at_a_load_begins_with_the_stress_of_the_state(step):
    assembly, before, after = step
    mixed, share = MixedStress(assembly), 0.3
    mixed.stress = 7 * stress(assembly, before)
    mixed.forget()
    assert mixed.stress is None
    mixed.leave(before)
    mixed.arrive(before + share * (after - before), share)
    part = predicted(assembly, before, before + share * (after - before))
    assert np.abs(mixed.stress - part).max() < 1e-10 * np.abs(part).max()


def test_another_stress_changes_the_geometric_stiffness_alone(step):
    """x . K_G y = sum of J w S : Grad x^T Grad y, which is linear in S."""
    assembly, before, after = step
    tangent, (x, y, _) = Tangent(assembly), directions(assembly)
    other = stress(assembly, after)
    values = tangent.assemble(before, 0.0, 0.0, stress=other)
    difference = whole(tangent, values) - stiffness(tangent, before)
    change = (other - stress(assembly, before))[..., [[0, 3, 4], [3, 1, 5], [4, 5, 2]]]
    slopes = [assembly.slopes(assembly.expand(q))[0].reshape(*change.shape[:2], 3, 3) for q in (x, y)]
    expected = np.einsum("mgKi,mgKL,mgLi->", slopes[0], change, slopes[1])
    assert x @ (difference @ y) == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize("fabric", ["isotropic", "woven"])
def test_shells_predict_the_stress_of_their_displacement_gradients(make_model, fabric):
    """S(Grad u + d) = S(Grad u) + its slope along d + C : d d^T / 2: central differences leave out what is odd."""
    shells = ShellAssembly(make_model("SHELL8R", fabric=fabric))
    rng = np.random.default_rng(5)
    shape = (len(shells.slots), 3 * shells.volume.shape[1], 3)
    slopes, added = 0.02 * rng.normal(size=shape), 0.1 * rng.normal(size=shape)

    def at(gradients: np.ndarray) -> np.ndarray:
        stress, forces = np.empty((*shells.volume.shape, 6)), np.zeros((2 * shells.count, 3))
        tables = shells.slots, shells.gradient, shells.axes, shells.volume, shells.law
        shell_kernels.internal_forces(np.ascontiguousarray(gradients), *tables, stress, forces)
        return stress

    expected = 0.5 * (at(slopes + added) + at(slopes - added)) - at(slopes)
    assert np.abs(shells.quadratic_stress(added) - expected).max() < 1e-10 * np.abs(expected).max()
