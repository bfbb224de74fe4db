"""Compression that wrinkles would take away, on sheets whose strains are known on paper."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from limo.mechanics.tension_field import averaged, compression_share, energies, membrane_strain
from limo.schema.element import element
from tests.helpers.patches import grid

NU = 0.3


def sheet(n=8):
    points, quads = grid(n, n)
    mesh = SimpleNamespace(nodes=np.column_stack([points, 0 * points[:, 0]]), quads=quads, layer=np.zeros(len(quads), int))
    modulus = np.full(len(quads), 200.0)
    return SimpleNamespace(mesh=mesh, element=element("C3D20R"), poisson_ratio=NU, youngs_modulus=modulus)


@pytest.mark.parametrize(
    ("first", "second", "kept"),
    [(2e-3, 1e-3, 1.0), (2e-3, -NU * 2e-3, 1.0), (2e-3, -2e-3, (1 - NU**2) / (2 - 2 * NU)), (-1e-3, -1e-3, 0.0)],
)
def test_taut_wrinkled_and_slack_sheets_keep_what_a_tension_field_keeps(first, second, kept):
    """Along axes turned by 30 degrees, which changes nothing."""
    turn = np.array([[np.sqrt(0.75), -0.5], [0.5, np.sqrt(0.75)]])
    strain = turn @ np.diag([first, second]) @ turn.T
    whole, relaxed = energies(strain[None], np.array([200.0]), NU)
    assert relaxed / whole == pytest.approx(kept, abs=1e-9)


def test_a_stretched_sheet_has_its_strain_wherever_it_is_turned_to():
    model = sheet()
    x, y, _ = model.mesh.nodes.T
    gradient = np.array([[1.02, 0.01], [0.0, 0.97]])
    flat = np.column_stack([np.stack([x, y], axis=1) @ gradient.T, 0 * x])
    turn = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    for points in (flat, flat @ turn):
        strain, area = membrane_strain(model, points)
        np.testing.assert_allclose(strain, np.broadcast_to(0.5 * (gradient.T @ gradient - np.eye(2)), strain.shape), atol=1e-14)
        assert area.sum() == pytest.approx(4.0)


def test_wrinkles_carry_compression_and_a_flat_sheet_does_not():
    """Pressed together by 2 % and stretched by 1 % across: flat, and thrown into waves whose strains cancel."""
    model = sheet(24)
    x, y, _ = model.mesh.nodes.T
    pressed = np.column_stack([0.98 * x, 1.01 * y, 0 * x])
    whole, relaxed = energies(np.array([np.diag([0.5 * (0.98**2 - 1), 0.5 * (1.01**2 - 1)])]), np.array([200.0]), NU)
    assert compression_share(model, pressed) == pytest.approx(1 - float(relaxed[0] / whole[0]))
    waves = 4  # three elements a half wave, of the height that takes 2 %
    k = np.pi * waves
    height = 2 * np.sqrt(0.5 * (1 - 0.98**2)) / k
    wrinkled = pressed + np.stack([0 * x, 0 * x, height * np.sin(k * x)], axis=1)
    assert compression_share(model, wrinkled) < 0.05
    strain, area = membrane_strain(model, wrinkled)
    modulus = model.youngs_modulus
    alone = energies(strain, modulus, NU)
    assert 1 - float(alone[1] @ area / (alone[0] @ area)) > 0.2, "element by element crests and flanks carry compression"


def test_layers_that_lie_on_each_other_are_not_mixed():
    model = sheet(4)
    half = model.mesh.nodes[model.mesh.quads[:, :4], 0].mean(axis=1) > 0
    model.mesh.layer = half.astype(int)
    values = np.where(half, 1.0, 3.0)
    np.testing.assert_array_equal(averaged(model, values, np.ones(len(values))), values)
    model.mesh.layer = 0 * model.mesh.layer
    mixed = averaged(model, values, np.ones(len(values)))
    assert mixed.min() > 1.0
    assert mixed.max() < 3.0
