"""What came of designs: status, reason, quantities, and how far these scatter over branches."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from limo.config.project import Project
from limo.datasets.study import gather_study
from limo.measure.states import REMARKS_APART, lowest
from limo.schema.exploration import BOUND, NEVER, Exploration
from limo.store.statuses import CONVERGED, DEGRADED, USABLE


@dataclass(frozen=True)
class Told:
    """What came of a design: status and reason, quantities, and their scatter over branches (half of the range)."""

    status: str
    reason: str
    values: dict[str, float]
    scatter: dict[str, float]

    @property
    def is_solved(self) -> bool:
        return self.status in USABLE


def tell(project: Project, exploration: Exploration, name: str, case_folder: Path, sources: list[str]) -> Told:
    """The quantities of a design, a study of ``project``, from the results of its cases ``sources``.

    Of several P_v the worst counts. A design of which a case failed has no numbers.
    """
    dataset = gather_study(project, name, case_folder, sources)
    one = lowest(dataset)
    statuses = one.case_status.values.ravel().astype(str)
    failed = [k for k, status in enumerate(statuses) if status not in USABLE]
    names = (*exploration.goals, *exploration.constraints)
    if failed:
        reason = str(one.case_reason.values.ravel()[failed[0]])
        unknown = dict.fromkeys(names, float("nan"))
        return Told(str(statuses[failed[0]]), reason, unknown, unknown)
    status = DEGRADED if DEGRADED in statuses else CONVERGED
    said = [str(r) for name in ("case_reason", "case_remarks") if name in one for r in one[name].values.ravel()]
    remarks = REMARKS_APART.join(dict.fromkeys(r for each in said for r in each.split(REMARKS_APART) if r))
    values = {quantity: _worst(one, exploration, quantity) for quantity in names}
    branches = [dataset.isel(branch=k) for k in range(dataset.sizes["branch"])] if "branch" in dataset.dims else [one]
    usable = [branch for branch in branches if branch.case_status.isin(USABLE).all()]
    scatter = {name: 0.5 * float(np.ptp([_worst(branch, exploration, name) for branch in usable])) for name in names}
    return Told(status, remarks, values, scatter)


def _worst(dataset: xr.Dataset, exploration: Exploration, quantity: str) -> float:
    """A quantity of a design, the worst over P_v; of a curve and of frames at P_a,max. NaN where it is not known everywhere."""
    values = dataset[quantity]
    if "actuation_pressure" in values.dims:
        values = values.isel(actuation_pressure=-1)
    if "frame" in values.dims:
        values = values.sel(frame="max")
    values = values.values.astype(float).ravel()
    wanted = exploration.goals.get(quantity)
    bound = exploration.constraints.get(quantity, "")
    if bound == NEVER:  # the lowest P_a at which it happens, NaN where it does not
        return float(np.nanmin(values)) if np.isfinite(values).any() else float("nan")
    more_is_better = wanted == "maximise" or bound.strip().startswith(">=")
    return float(values.min() if more_is_better else values.max())


def violation(exploration: Exploration, quantity: str, value: float) -> float:
    """How far a value is beyond a bound, above 0 where it is violated; of ``none`` 1 where it happens and -1 where not."""
    text = exploration.constraints[quantity]
    if text == NEVER:
        return 1.0 if np.isfinite(value) else -1.0
    sign, bound = BOUND.match(text).groups()
    return float(bound) - value if sign == ">=" else value - float(bound)
