"""Unknown geometry inferred from a stated half of the paper's statements, from solved studies alone; the other half tests it.

The seams of N_p = 6 and 10 are positions f, multiples of the reference seam. A study has cases at some positions. Curves between
them are interpolated, so that nothing is solved here. For places between the outermost positions the study ``Inference.devices``
is judged with the interpolated devices put in. With s the penalty of a verdict (0 reproduced, 1 partly, 2 not) the belief is

    p(f | statements used) ~ exp(-sum of s over them - sum of ((f - f_prior) / spread)^2 / 2).

The numbers of pouches of a study of designs are believed alike from the statements used of it, each as likely before.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from limo.config.yaml_file import parse, read_yaml
from limo.datasets.curves import at_end
from limo.errors import ConfigError, LimoError
from limo.explore.posterior import Posterior, posterior
from limo.explore.sampling import sample
from limo.explore.space import Input, Space
from limo.measure.states import lowest
from limo.reports.paper_check import STATEMENTS, Statement, judged, read_dataset
from limo.schema.inference import Inference
from limo.store.files import write_whole
from limo.store.statuses import USABLE

PENALTIES = {"reproduced": 0.0, "partly": 1.0, "not": 2.0}
#: places at which devices are judged
PLACES = 512
#: how many more statements than unknowns an inference takes at least
SPARE = 1
#: numbers that are shown over all positions: words and factor, by variable
NUMBERS = {
    "stroke_volume": ("stroke at P_a,max [ml]", 1.0),
    "io_ratio": ("Delta V_v / V_a at P_a,max", 1.0),
    "efficiency_90ml": ("efficiency at 90 ml [%]", 100.0),
}
COLUMNS = ("kind", "name", "study", "inference", "prior", "inferred", "deviation", "low", "high", "chance_before", "chance")


@dataclass(frozen=True)
class SeamStudy:
    """Solved devices of one number of pouches at several seam positions (variant, unknown); the first ones are the prior."""

    n_pouches: int
    positions: np.ndarray
    cases: xr.Dataset

    @property
    def names(self) -> list[str]:
        """What the unknowns are called."""
        off_axis = self.positions.shape[1]
        return [f"N_p = {self.n_pouches}, seam {k + 1}" if off_axis > 1 else f"N_p = {self.n_pouches}" for k in range(off_axis)]

    def at(self, place: np.ndarray) -> xr.Dataset:
        """Its cases at other positions (unknown,): numbers interpolated linearly, texts those of the nearest variant."""
        weights = self._weights(place)
        nearest = int(np.argmin(np.linalg.norm(self.positions - place, axis=1)))
        whole = {n: v.isel(variant=nearest, drop=True) for n, v in self.cases.data_vars.items()}
        whole |= {
            n: (v * xr.DataArray(weights, dims="variant")).sum("variant", skipna=False).transpose(*whole[n].dims)
            for n, v in self.cases.data_vars.items()
            if v.dtype.kind == "f"
        }
        return xr.Dataset(whole)

    def _weights(self, place: np.ndarray) -> np.ndarray:
        """Weights (variant,) of linear radial functions with a linear trend, which reproduce the variants themselves."""
        from scipy.interpolate import RBFInterpolator

        return RBFInterpolator(self.positions, np.eye(len(self.positions)), kernel="linear", degree=1)(place[None])[0]

    def inputs(self) -> list[Input]:
        """Its unknowns between the outermost positions."""
        ends = zip(self.names, self.positions.min(axis=0), self.positions.max(axis=0), strict=True)
        return [Input(name, float(low), float(high)) for name, low, high in ends]


@dataclass(frozen=True)
class Inferred:
    """What is believed of seams: the belief, and of each statement about the devices its verdict at every place."""

    belief: Posterior
    first: np.ndarray
    verdicts: Mapping[str, np.ndarray]
    studies: Sequence[SeamStudy] = ()


def read_inference(file: Path) -> Inference:
    """The inference that a file describes. Raises ``ConfigError`` for statements that are none, and for too few of them."""
    asked = parse(Inference, read_yaml(file), file)
    known = {s.text: s for s in STATEMENTS}
    for key in ("used", "held_out"):
        for text in getattr(asked, key):
            if text not in known:
                raise ConfigError(file, key, text, "a statement of docs/paper_check.md", f"{key}: [{STATEMENTS[4].text}]")
            if known[text].study not in (asked.devices, *asked.designs):
                expected = f"a statement about {', '.join((asked.devices, *asked.designs))}"
                raise ConfigError(file, key, text, expected, f"{key}: [{STATEMENTS[4].text}]")
    return asked


def infer(file: Path, data: Path) -> pd.DataFrame:
    """What is inferred from the datasets in a folder: a row an unknown, and a row a statement with its verdict before and after.

    Numbers have their value at the prior's positions, and in ``low`` and ``high`` the least and the most of all positions solved.
    ``inferred``: of a position the mean of the belief, ``low`` and ``high`` the ends of what holds 90 % of it; of a statement its
    most likely verdict, ``chance_before`` and ``chance`` how likely it is reproduced by the prior and by the belief; of numbers
    of pouches the most likely one. Raises ``ConfigError`` for a mistake in ``file`` and too few statements for the unknowns,
    ``LimoError`` for datasets that are not there or lack cases.
    """
    asked = read_inference(file)
    found = inferred_seams(file, asked, data)
    belief = found.belief
    rows = [
        {"kind": "position", "name": name, "study": asked.seams, "prior": prior, "inferred": float(f"{value:.3g}")}
        | {"deviation": deviation, "low": low, "high": high}
        for name, prior, value, deviation, low, high in zip(
            belief.space.names, found.first, belief.mean, belief.deviation, *belief.interval, strict=True
        )
    ]
    for statement in (s for s in STATEMENTS if s.study == asked.devices):
        verdicts = found.verdicts[statement.text]
        likely = max(dict.fromkeys(verdicts), key=lambda verdict, v=verdicts: belief.chance(v == verdict)[1])
        row = _tested(statement, asked, verdicts[0], likely)
        rows.append(row | dict(zip(("chance_before", "chance"), belief.chance(verdicts == "reproduced"), strict=True)))
    rows += [row | {"study": asked.seams} for study in found.studies for row in numbers_of(study)]
    for name in asked.designs:
        rows += _number_of_pouches(asked, name, data)
    return pd.DataFrame(rows, columns=list(COLUMNS))


def inferred_seams(file: Path, asked: Inference, data: Path) -> Inferred:
    """What is believed of the seams; errors as ``infer``. The first place is the prior's."""
    devices, seams = (read_dataset(data, name) for name in (asked.devices, asked.seams))
    if devices is None or seams is None:
        name = asked.devices if devices is None else asked.seams
        raise LimoError(f"{data}: no dataset of {name}; snakemake --cores 2 {name} makes it")
    devices, seams = (lowest(d) for d in (devices, seams))
    studies = seam_studies(seams, f"{data}/{asked.seams}")
    about = {s.text: s for s in STATEMENTS if s.study == asked.devices}
    used = [text for text in asked.used if text in about]
    space = Space(tuple(each for study in studies for each in study.inputs()))
    if len(used) < len(space.inputs) + SPARE:
        expected = (
            f"{len(space.inputs) + SPARE} or more statements about {asked.devices} for {len(space.inputs)} unknown positions"
        )
        raise ConfigError(file, "used", f"{len(used)} of them", expected, f"used: [{', '.join(list(about)[:2])}]")
    first = np.concatenate([study.positions[0] for study in studies])
    prior_place = np.array([[each.to_unit(f) for each, f in zip(space.inputs, first, strict=True)]])
    places = np.vstack([prior_place, sample(space, PLACES, 0)])
    verdicts: dict[str, list[str]] = {text: [] for text in about}
    designs = space.from_unit(places)
    for place in designs:
        tried = with_seams(devices, studies, [np.array([place[name] for name in study.names]) for study in studies])
        for text, statement in about.items():
            verdicts[text].append(judged(statement, tried)[1])
    penalty = np.array([_penalty([verdicts[text][k] for text in used]) for k in range(len(places))])
    values = np.array([list(place.values()) for place in designs])
    prior = -0.5 * (((values - first) / asked.prior_spread) ** 2).sum(axis=1)
    found = {text: np.array(each) for text, each in verdicts.items()}
    return Inferred(posterior(space, places, prior, penalty), first, found, studies)


def seam_studies(dataset: xr.Dataset, source: str) -> list[SeamStudy]:
    """The numbers of pouches of a study over seams, each with the positions that its configuration states.

    Raises ``LimoError`` where one has fewer than two more usable variants than unknowns.
    """
    settings = json.loads(dataset.attrs["config"])["settings"]
    collected = []
    for n_pouches in map(int, dataset.n_pouches.values):
        one = dataset.sel(n_pouches=n_pouches)
        dims = [d for d in one.case_status.dims if d != "variant"]
        usable = one.case_status.isin(USABLE).all(dims).values
        kept = one.isel(variant=usable)
        listed = [settings[str(v)]["device"]["pattern"]["seams"]["fractions"][str(n_pouches)] for v in one.variant.values[usable]]
        positions = np.array([[f for f in fractions if f > 0] for fractions in listed], float)
        least = positions.reshape(len(positions), -1).shape[1] + 2
        if len(positions) < least or not usable[0]:
            raise LimoError(
                f"{source}: variants = {len(positions)} usable ones of N_p = {n_pouches}; expected {least} or more, the first "
                "among them, to interpolate between; for example variants: {prior: {}, inner: {...}, outer: {...}, far: {...}}"
            )
        collected.append(SeamStudy(n_pouches, positions, kept))
    return collected


def numbers_of(study: SeamStudy) -> list[dict[str, object]]:
    """Rows on what depends on seams, by P_v: with the prior's positions, and the least and the most of all that were solved."""
    rows = []
    for ventricular in study.cases.ventricular_pressure.values:
        cases = study.cases.sel(ventricular_pressure=ventricular)
        for name, (words, factor) in NUMBERS.items():
            each = at_end(cases[name]) if "actuation_pressure" in cases[name].dims else cases[name]
            values = factor * each.values.ravel()
            ends = (float(np.nanmin(values)), float(np.nanmax(values))) if np.isfinite(values).any() else (np.nan, np.nan)
            row = {"kind": "number", "name": f"{words}, N_p = {study.n_pouches}, P_v = {ventricular:g} kPa"}
            rows.append(row | {"prior": float(f"{values[0]:.3g}"), "low": ends[0], "high": ends[1]})
    return rows


def with_seams(devices: xr.Dataset, studies: list[SeamStudy], places: Sequence[np.ndarray]) -> xr.Dataset:
    """The devices of a study with those of some numbers of pouches put in, as they would be with seams at other positions."""
    return put_in(devices, {study.n_pouches: study.at(place) for study, place in zip(studies, places, strict=True)})


def put_in(devices: xr.Dataset, others: Mapping[int, xr.Dataset]) -> xr.Dataset:
    """The devices with those of some numbers of pouches replaced, at the coordinates that both have; NaN at the rest."""
    numbers = devices.n_pouches.values.tolist()
    replaced = {}
    for name, own in devices.data_vars.items():
        values = own.transpose("n_pouches", ...).copy() if "n_pouches" in own.dims else None
        for n_pouches, other in others.items() if values is not None else ():
            if name in other and n_pouches in numbers:
                place = numbers.index(n_pouches)
                same = {dim: values[dim] for dim in values.dims[1:] if dim in other[name].coords}
                values[place] = other[name].reindex(same).transpose(*values.dims[1:]).values
        if values is not None:
            replaced[name] = values.transpose(*own.dims)
    return devices.assign(replaced)


def _penalty(verdicts: list[str]) -> float:
    return sum(PENALTIES.get(verdict, 2.0) for verdict in verdicts)


def _tested(statement: Statement, asked: Inference, before: str, after: str) -> dict[str, object]:
    """A row on a statement: whether it was used, and its verdicts with the prior and with what was inferred."""
    role = {**dict.fromkeys(asked.used, "used"), **dict.fromkeys(asked.held_out, "held out")}.get(statement.text, "")
    return {
        "kind": "statement",
        "name": statement.text,
        "study": statement.study,
        "inference": role,
        "prior": before,
        "inferred": after,
    }


def _number_of_pouches(asked: Inference, name: str, data: Path) -> list[dict[str, object]]:
    """Rows on a study of designs: the number of pouches that its statements prefer, and verdicts with the first and with that."""
    dataset = read_dataset(data, name)
    about = [s for s in STATEMENTS if s.study == name]
    if dataset is None or dataset.sizes.get("n_pouches", 1) < 2:
        return []
    dataset = lowest(dataset)
    verdicts: Mapping[int, dict[str, str]] = {
        int(n): {s.text: judged(s, dataset.sel(n_pouches=[n]), f"N_p = {int(n)}: ")[1] for s in about}
        for n in dataset.n_pouches.values
    }
    penalty = {n: _penalty([found[text] for text in asked.used if text in found]) for n, found in verdicts.items()}
    first, least = next(iter(penalty)), min(penalty.values())
    weights = {n: float(np.exp(least - each)) for n, each in penalty.items()}
    chance = {n: weight / sum(weights.values()) for n, weight in weights.items()}
    chosen = max(chance, key=lambda n: (chance[n], -n))
    row = {"kind": "pouches", "name": f"N_p of {name}", "study": name, "prior": first, "inferred": chosen}
    tested = [_tested(s, asked, verdicts[first][s.text], verdicts[chosen][s.text]) for s in about]
    return [row | {"chance_before": 1 / len(chance), "chance": chance[chosen]}, *tested]


def write_inference(file: Path, data: Path, table: Path) -> str:
    """Infer, keep the table, and return what to print."""
    rows = infer(file, data)
    write_whole(table, lambda path: rows.to_csv(path, index=False, float_format="%.3g"))
    return rows.to_string(index=False, na_rep="", float_format=lambda value: f"{value:.3g}")
