"""States of the project's own engine, imposed on CalculiX and let go."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from limo.engines.calculix import build as ccx_build
from limo.engines.calculix import deck
from limo.engines.calculix import run as calculix
from limo.engines.calculix.frd import FrdFile
from limo.mechanics.model import Model
from limo.mesh.elements import HEX20
from limo.schema.solver import Solver


def handed_to_calculix(model: Model, u: np.ndarray, folder: Path, before: float, after: float) -> tuple[str, list[np.ndarray]]:
    """Three static steps of CalculiX: a state imposed at P_a = ``before``, all that is free let go, P_a raised to ``after``.

    Returns the log and the displacements (n, 3) of the bricks' nodes at the end of each step. A brick apart from the device
    keeps one displacement free in the first step: CalculiX wants an equation to solve.
    """
    count, bricks = len(model.nodes), len(model.expansion.bricks)
    lines = [*deck.geometry(model), "*NODE, NSET=ALL"]
    lines += [f"{count + k + 1}, {500 + x:g}, {y:g}, {z:g}" for k, (x, y, z) in enumerate(HEX20)]
    numbers = [str(n) for n in (bricks + 1, *range(count + 1, count + 21))]
    lines += [f"*ELEMENT, TYPE={model.element.name}, ELSET=APART", ", ".join(numbers[:11]) + ",", ", ".join(numbers[11:])]
    lines += [*deck._sets(model), *deck._materials(model, 0.0), "*SOLID SECTION, ELSET=APART, MATERIAL=FABRIC"]
    lines += deck.constraints(model)
    held = [f"{count + k + 1}, {d}, {d}" for k in range(20) for d in (1, 2, 3) if (k, d) != (6, 1)]
    dependent = {equation.terms[0][:2] for equation in model.equations}
    used = np.zeros((count, 3), bool)
    used[np.unique(model.expansion.bricks)] = used[model.reference_start :] = True
    imposed = [(n, d) for n, d in zip(*np.nonzero(used), strict=True) if (n, d) not in dependent and (n, d) not in {*model.fixed}]
    imposed = [f"{n + 1}, {d + 1}, {d + 1}, {deck.number(u[n, d])}" for n, d in imposed]
    true = [f"{n + 1}, {d + 1}, {d + 1}" for n, d in model.fixed]
    true += [f"{n + 1}, {d + 1}, {d + 1}, {deck.number(value)}" for (n, d), value in model.prescribed.items()]
    for boundary, rows, pressure in (("", imposed, before), (", OP=NEW", true, before), (", OP=NEW", true, after)):
        lines += ["*STEP, NLGEOM, INC=100", "*STATIC", "1, 1", "*CONTROLS, PARAMETERS=FIELD", "1e-6, 1e-4, , , 1e-6"]
        lines += [f"*BOUNDARY{boundary}", *rows, *held]
        for load in model.pressures:
            value = 1e-3 * (load.ventricular * model.loading.ventricular_pressure + load.actuation * pressure)
            lines += ["*DLOAD", f"{load.surface.upper()}, {deck.BRICK_SIDE[load.side]}, {deck.number(value)}"]
        lines += ["*NODE OUTPUT, FREQUENCY=100", "U", "*END STEP"]
    folder.mkdir(parents=True)
    (folder / "deck.inp").write_text("\n".join(lines) + "\n")
    outcome = calculix.run(folder, ccx_build.find_ccx(Solver()), Solver(), 3.0)
    assert outcome.status == "converged", outcome.reason
    with FrdFile(folder / "deck.frd") as frd:
        states = [frd.displacements(frame, count + 20)[: model.reference_start] for frame in frd.frames]
    return (folder / "ccx.log").read_text(), states
