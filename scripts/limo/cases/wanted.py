"""What all studies together want of a case."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from limo.cases.grid import study_cases
from limo.config.project import Loaded
from limo.schema.study import OUTPUTS


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
    loaded: Loaded, studies: Iterable[str] | None = None, served: Mapping[str, Mapping[tuple, str]] | None = None
) -> dict[str, Wanted]:
    """What the studies (default: all) want of each case, by its id; cases of which only volumes are wanted are left out.

    ``served``: by study, the id of the case that stands for each of its grid (default: the study's own cases).
    """
    pressures: dict[str, dict[str, set[float]]] = {}
    drawn: dict[str, set[str]] = {}
    for name in loaded.studies if studies is None else studies:
        study = loaded.studies[name]
        if not study.measures:
            continue
        for key, case in study_cases(loaded, name).items():
            case_id = served[name][key] if served else case.case_id
            of_case = pressures.setdefault(case_id, {})
            p_v = case.ventricular_pressure
            for output in study.measures:
                chosen = study.fields_at if output == "fields" else [*study.frames, *study.fields_at]
                of_case.setdefault(output, set()).update(p for p in (study.pressure_of(f, p_v) for f in chosen) if p is not None)
            if "fields" in study.measures:
                drawn.setdefault(case_id, set()).update(o for o in study.measures if o != "fields")
    return {
        case_id: Wanted(
            {o: tuple(sorted(of_case[o])) for o in OUTPUTS if o in of_case},
            tuple(o for o in OUTPUTS if o in drawn.get(case_id, ())),
        )
        for case_id, of_case in pressures.items()
    }
