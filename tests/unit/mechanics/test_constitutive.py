"""Woven fabric: closed forms, turned axes, and the isotropic one as a special case."""

from __future__ import annotations

from dataclasses import astuple

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from limo.mechanics.build import build_model
from limo.mechanics.constitutive import condensed, isotropic, orthotropic, plane_stress, stress_of, warp_and_weft
from limo.mechanics.kinematics import lame
from limo.mechanics.layer import LayerState
from limo.mechanics.model import Weave
from tests.helpers.cases import with_, woven

YARNS = Weave(400.0, 150.0, 0.4, 40.0, 0.0)
ANGLES = (-90.0, -37.0, 0.0, 20.0, 45.0, 90.0)


def turned(angle: float) -> np.ndarray:
    return orthotropic(*astuple(YARNS)[:4], angle)


@pytest.mark.parametrize("angle", ANGLES)
def test_equal_moduli_are_an_isotropic_fabric(angle):
    modulus, ratio = 267.0, 0.33
    found = orthotropic(modulus, modulus, ratio, modulus / (2 * (1 + ratio)), angle)
    np.testing.assert_allclose(found, isotropic(modulus, ratio), rtol=0, atol=1e-12 * modulus)


@pytest.mark.parametrize("angle", ANGLES)
def test_the_fabric_turns_with_its_yarns(angle):
    """S of a strain that is turned with the fabric is turned; the warp is turned from y towards x."""
    strain = np.random.default_rng(3).normal(0, 0.1, (1, 1, 3, 3))
    strain = strain + np.swapaxes(strain, -1, -2)
    r = Rotation.from_euler("z", -angle, degrees=True).as_matrix()
    np.testing.assert_allclose(warp_and_weft(angle)[0], r @ [0.0, 1.0, 0.0], atol=1e-15)
    there = stress_of(r @ strain @ r.T, turned(angle)[None])
    np.testing.assert_allclose(there, r @ stress_of(strain, turned(0.0)[None]) @ r.T, atol=1e-10)


@pytest.mark.parametrize("angle", ANGLES)
def test_an_off_axis_strip_shears(angle):
    """1 / E_y = c^4 / E_1 + (1 / G - 2 nu / E_1) s^2 c^2 + s^4 / E_2 along y; its shear is that of the textbook."""
    e1, e2, nu, g = astuple(YARNS)[:4]
    q = condensed(turned(angle)[None])[0]
    plane = np.array([[q[0], q[1], q[2]], [q[1], q[3], q[4]], [q[2], q[4], q[5]]])
    strain = np.linalg.inv(plane) @ [0.0, 1.0, 0.0]
    s, c = np.sin(np.radians(angle)), np.cos(np.radians(angle))
    assert strain[1] == pytest.approx(c**4 / e1 + (1 / g - 2 * nu / e1) * s**2 * c**2 + s**4 / e2, rel=1e-12)
    coupling = (2 / e1 + 2 * nu / e1 - 1 / g) * s * c**3 - (2 / e2 + 2 * nu / e1 - 1 / g) * s**3 * c
    assert strain[2] == pytest.approx(coupling, rel=1e-9, abs=1e-16)


def test_plane_stress_of_isotropic_fabric_is_that_of_the_closed_form():
    modulus = np.array([267.0, 100.0])
    laws = np.stack([isotropic(e, 0.33) for e in modulus])
    np.testing.assert_allclose(condensed(laws), plane_stress(modulus, 0.33), rtol=0, atol=1e-12 * 267)
    strain = np.random.default_rng(4).normal(0, 0.1, (2, 5, 3, 3))
    strain = strain + np.swapaxes(strain, -1, -2)
    deformation = np.linalg.cholesky(2 * 0.1 * strain + np.eye(3)).swapaxes(-1, -2)
    states = [LayerState(deformation, *lame(modulus, 0.33), law) for law in (None, laws)]
    np.testing.assert_allclose(states[1].second_piola, states[0].second_piola, rtol=0, atol=1e-12 * 267)


def test_yarns_of_an_isotropic_fabric_are_that_fabric_to_the_bit(make_case, device_mesh):
    case, material = make_case(), make_case().device.material
    modulus, ratio = material.youngs_modulus, material.poisson_ratio
    yarns = {"warp_modulus": modulus, "weft_modulus": modulus, "poisson_ratio": ratio, "angle": 30.0}
    yarns["shear_modulus"] = modulus / (2 * (1 + ratio))
    same = woven(material, weave=yarns, bending_factor=None, pouch_sheet=None)
    models = [
        build_model(with_(case, device=case.device.model_copy(update={"material": m})), device_mesh()) for m in (material, same)
    ]
    assert models[0].fabric == models[1].fabric
    assert models[1].stiffness is None


@pytest.mark.parametrize("factor", [0.05, 1.0, 4.0])
def test_bending_is_scaled_apart_from_stretching(make_case, device_mesh, factor):
    """E t, the mass of an area and nu stay; E t^3 / 12 is scaled."""
    case, material = make_case(), make_case().device.material
    scaled = material.model_copy(update={"bending_factor": factor})
    model = build_model(with_(case, device=case.device.model_copy(update={"material": scaled})), device_mesh())
    plain = build_model(case, device_mesh())
    np.testing.assert_allclose(model.youngs_modulus * model.thickness, plain.youngs_modulus * plain.thickness, rtol=1e-14)
    np.testing.assert_allclose(model.density * model.thickness, plain.density * plain.thickness, rtol=1e-14)
    np.testing.assert_allclose(
        model.youngs_modulus * model.thickness**3, factor * plain.youngs_modulus * plain.thickness**3, rtol=1e-14
    )
