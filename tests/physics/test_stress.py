"""Strain, stress and equilibrium against CalculiX's own values on a converged case."""

from __future__ import annotations

import re
from types import SimpleNamespace

import numpy as np
import pytest

from limo.engines.calculix import build as ccx_build
from limo.engines.calculix import run as calculix
from limo.engines.calculix.deck import write_deck
from limo.engines.calculix.frd import FrdFile
from limo.measure.stress import top_average
from limo.mechanics.build import build_model
from limo.mechanics.equilibrium import residual
from limo.mechanics.layer import flat_areas, layer_state, surface_points
from limo.mesh.elements import gauss
from limo.schema.solver import Solver
from tests.helpers.cases import small_mesh, with_, woven

PRESSURE = 10.0  # kPa


def printed(text: str, name: str, elements: int) -> np.ndarray:
    """A table of *EL PRINT (xx, yy, zz, xy, xz, yz) as tensors (m, 8, 3, 3)."""
    rows = text[text.index(f" {name} (elem") :].split("\n\n")[1].strip().splitlines()
    xx, yy, zz, xy, xz, yz = np.array([row.split()[2:] for row in rows], float).T
    return np.stack([xx, xy, xz, xy, yy, yz, xz, yz, zz], axis=1).reshape(elements, 8, 3, 3)


def double_precision(restart: bytes, single: np.ndarray) -> np.ndarray:
    """Displacements (n, 3) in double precision: where the restart file holds (temperature, u) that rounds to ``single``."""
    node, axis = np.unravel_index(np.abs(single).argmax(), single.shape)
    for shift in range(8):
        values = np.frombuffer(restart, "<f8", (len(restart) - shift) // 8, shift)
        with np.errstate(all="ignore"):
            hits = np.flatnonzero(values.astype(np.float32) == np.float32(single[node, axis]))
        for hit in hits:
            start = hit - 4 * node - 1 - axis
            found = values[max(start, 0) : start + 4 * len(single)]
            if found.size == 4 * len(single):
                found = found.reshape(-1, 4)[:, 1:]
                with np.errstate(all="ignore"):
                    if np.array_equal(found.astype(np.float32), single.astype(np.float32)):
                        return found.copy()
    raise AssertionError("the restart file does not hold the displacements of the frame")


@pytest.fixture(scope="module", params=["isotropic", "woven"])
def converged(request, case, tmp_path_factory):
    """The whole loading of a coarse quarter of the device (about 100 elements), with CalculiX's own stresses at its end.

    Of woven fabric, too, whose yarns turn by large rotations.
    """
    folder = tmp_path_factory.mktemp("stress")
    case = with_(case, actuation_pressure_max=PRESSURE)
    if request.param == "woven":
        fabric = woven(case.device.material, bending_factor=None)
        case = with_(case, device=case.device.model_copy(update={"material": fabric}))
    model = build_model(case, small_mesh(case, 3000, "quarter"))
    deck = folder / "deck.inp"
    times = write_deck(model, deck)
    only_last = (
        "*RESTART, WRITE\n*NODE OUTPUT, FREQUENCY=999999\nU\n*EL PRINT, ELSET=DEVICE, FREQUENCY=999999, GLOBAL=YES\nS, E\n"
    )
    text, count = re.subn(r"\*NODE OUTPUT, FREQUENCY=1\nU\n", only_last, deck.read_text())
    assert count == 1
    deck.write_text(text)
    outcome = calculix.run(folder, ccx_build.find_ccx(Solver()), Solver(), times[-1].end)
    assert outcome.status == "converged", outcome.reason
    count = len(model.expansion.nodes)
    with FrdFile(folder / "deck.frd") as frd:
        single = frd.displacements(frd.frames[-1], len(model.nodes))[:count]
    table = (folder / "deck.dat").read_text()
    return SimpleNamespace(
        model=model,
        single=single,
        double=double_precision((folder / "deck.rout").read_bytes(), single),
        stress=printed(table, "stresses", len(model.mesh.quads)),
        strain=printed(table, "strains", len(model.mesh.quads)),
    )


def test_strain_and_stress_are_those_of_calculix_at_every_integration_point(converged):
    """Green-Lagrange strain and Cauchy stress; CalculiX prints seven digits."""
    assert np.abs(converged.double).max() > 10.0
    state = layer_state(converged.model, converged.double, gauss(2, 3)[0])
    for ours, theirs in ((state.strain, converged.strain), (state.cauchy, converged.stress)):
        size = np.linalg.norm(theirs, axis=(-2, -1))
        assert (np.linalg.norm(ours - theirs, axis=(-2, -1)) < 1e-4 * size).all()
    # the two stresses differ by far more than that, so it is the Cauchy stress that is printed
    assert np.abs(state.second_piola - converged.stress).max() > 0.1 * np.abs(converged.stress).max()


def test_stored_frames_are_precise_enough_for_the_peak_stress(converged):
    """Single precision costs single points up to a per cent, and the peak less than one part in a thousand."""
    single, double = (layer_state(converged.model, u, surface_points()).von_mises for u in (converged.single, converged.double))
    areas = np.tile(flat_areas(converged.model.mesh), (1, 3))
    assert np.abs(single - double).max() < 0.02 * double.max()
    assert top_average(single, areas) == pytest.approx(top_average(double, areas), rel=1e-3)


def test_the_converged_frame_is_in_equilibrium_and_another_pressure_is_not(converged):
    """To the tolerance that the solver was given, damping included; in single precision only over the thickness."""
    double = residual(converged.model, converged.double, PRESSURE)
    single = residual(converged.model, converged.single, PRESSURE)
    assert double.full < 0.02
    assert double.resultant < 0.02
    assert single.resultant < 0.02
    assert single.full < 3 * single.floor
    assert residual(converged.model, converged.double, 0.9 * PRESSURE).resultant > 0.03
