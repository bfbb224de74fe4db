"""Models for the tests of the engine newton."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from limo.mechanics.build import build_model
from limo.mechanics.model import Model
from limo.schema.numerics import Mesh
from tests.helpers.cases import with_, woven
from tests.helpers.patches import grid, patch_mesh, patch_model


@pytest.fixture
def make_model(make_case, device_mesh) -> Callable[..., Model]:
    """``make_model(element, symmetry, **changes)``: the coarse device, its pouches and walls of different stiffness.

    ``fabric``: isotropic, or woven, with a pouch sheet of its own weave, thickness and bending.
    """

    def make(element: str = "C3D20R", symmetry: str = "quarter", fabric: str = "isotropic", **changes) -> Model:
        mesh = Mesh(level="preview", symmetry=symmetry, element=element)
        case = make_case(mesh=mesh, stiffness_ratio=0.4, **changes)
        if fabric == "woven":
            case = with_(case, device=case.device.model_copy(update={"material": woven(case.device.material)}))
        return build_model(case, device_mesh(symmetry=symmetry))

    return make


@pytest.fixture
def patch(make_case) -> Model:
    """A flat patch of the layer that nothing holds."""
    points, quads = grid(3, 2)
    return patch_model(make_case(), patch_mesh(np.column_stack([10 * points, 0 * points[:, 0]]), quads))
