"""What all studies together want of a case."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from limo.cases.grid import GridPoint, study_cases
from limo.config.project import Project
from limo.schema.study import OUTPUTS, Study


@dataclass(frozen=True)
class Wanted:
    """What all studies together want of a case: pressures (kPa) of its frames by output.

    ``fields`` are drawn at their pressures with the outputs in ``drawn``.
    """

    pressures: dict[str, tuple[float, ...]]
    drawn: tuple[str, ...] = ()

    @property
    def outputs(self) -> tuple[str, ...]:
        return tuple(o for o in OUTPUTS if o in self.pressures)

    def to_dict(self) -> dict[str, Any]:
        """Plain data from which ``from_dict`` makes the same again."""
        return {"pressures": {k: list(v) for k, v in self.pressures.items()}, "drawn": list(self.drawn)}

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Wanted:
        return cls({k: tuple(v) for k, v in data["pressures"].items()}, tuple(data["drawn"]))


def wanted_cases(
    project: Project, studies: Iterable[str] | None = None, served: Mapping[str, Mapping[GridPoint, str]] | None = None
) -> dict[str, Wanted]:
    """What the studies (default: all) want of each case, by its id; cases of which only volumes are wanted are left out.

    ``served``: by study, the id of the case that stands for each of its grid (default: the study's own cases).
    """
    pressures: dict[str, dict[str, set[float]]] = {}
    drawn: dict[str, set[str]] = {}
    for name in project.studies if studies is None else studies:
        study = project.studies[name]
        for point, case in study_cases(project, name).items() if study.measures else ():
            case_id = served[name][point] if served else case.case_id
            for output, values in _measured_at(study, case.ventricular_pressure).items():
                pressures.setdefault(case_id, {}).setdefault(output, set()).update(values)
            if "fields" in study.measures:
                drawn.setdefault(case_id, set()).update(o for o in study.measures if o != "fields")
    return {
        case_id: Wanted(
            {o: tuple(sorted(by_output[o])) for o in OUTPUTS if o in by_output},
            tuple(o for o in OUTPUTS if o in drawn.get(case_id, ())),
        )
        for case_id, by_output in pressures.items()
    }


def _measured_at(study: Study, ventricular_pressure: float) -> dict[str, list[float]]:
    """The pressures (kPa) at which a study has each output computed of a case at a P_v (kPa)."""
    at_frames = [*study.frames, *study.fields_at]
    chosen = {output: study.fields_at if output == "fields" else at_frames for output in study.measures}
    values = {output: [study.pressure_of(f, ventricular_pressure) for f in entries] for output, entries in chosen.items()}
    return {output: [p for p in each if p is not None] for output, each in values.items()}
