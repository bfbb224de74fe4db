"""The recovery ladder: with what a case that failed is tried again, in which order.

Rungs change how a path is followed; one that is allowed to may also solve the case on another mesh or another part of the
device. Loads and material belong to what a case is. What stands on another mesh than the case names says so and is
``degraded``: under its name it would be another case in disguise.
"""

from __future__ import annotations

from dataclasses import replace

from limo.cases.case import Case
from limo.config.rungs import multiplied
from limo.schema.element import element
from limo.schema.section import PLANNED
from limo.schema.solver import Rung

CONFIGURED = "as configured"  # the name of the first attempt


def climb(case: Case, rung: Rung, failed_stage: str) -> Case:
    """A case with what a rung changes; ``failed`` in its keys stands for ``failed_stage``.

    The case itself where it is so already, and where shells, which are solved as a full device, are asked for a part.
    """
    stage = failed_stage if failed_stage in PLANNED else PLANNED[-1]
    numerics, level = multiplied(case.numerics, case.mesh_level, rung, stage)
    symmetry = case.mesh.symmetry if rung.symmetry is None or element(case.mesh.element).is_shell else rung.symmetry
    return replace(case, numerics=numerics, mesh_level=level, mesh=case.mesh.model_copy(update={"symmetry": symmetry}))
