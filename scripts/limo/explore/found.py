"""What an exploration found, as one dataset: designs, surrogates and how good they are, effects, indices, slices, claims."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr

from limo.datasets.variables import VARIABLES
from limo.explore import sensitivity
from limo.explore.claims import shares
from limo.explore.designs import own_design, written
from limo.explore.front import knee
from limo.explore.learn import Corrected, Learned, Tested, quality_of
from limo.explore.steps import learned_of
from limo.explore.telling import Told
from limo.measure.quantities import MEASURES
from limo.schema.device import Device
from limo.schema.exploration import AS_IT_IS, NEVER, SEARCHED_FINELY, Exploration

#: points of an effect over an input, designs that each is a mean of, and as many of a pair of inputs
STEPS, OVER, PAIR_STEPS, PAIR_OVER = 21, 256, 13, 64
#: units of inputs
UNITS = {"n_pouches": "1", "aspect_ratio": "1", "stiffness_ratio": "1", "thickness": "mm", "seam_shift": "1", "width_scale": "1"}

Data = dict[str, tuple]


def dataset_of(learned: Learned, held_out: Learned, fine: Learned, why: Mapping[str, str], device: Device) -> xr.Dataset:
    """Designs of both presets with their inputs and quantities; effects, indices, slices and quality of the surrogates.

    ``why``: of each design of ``fine``, by its name, why it is there; ``device``: that of the slices, unless it lies outside.
    """
    exploration = learned.exploration
    quantities = [*exploration.goals, *exploration.constraints]
    data: Data = (
        _designs(learned, "design", "") | _designs(held_out, "tested", "tested_") | _designs(fine, "recommended", "recommended_")
    )
    data["on_front"] = "design", _on_front(learned)
    data["recommended_on_front"] = "recommended", _on_front(fine)
    reasons = list(why.values())
    data["why"] = "recommended", np.array(reasons)
    quality = quality_of(learned, held_out)
    first = np.array([not each.startswith(SEARCHED_FINELY) for each in reasons], bool)
    before, after = Corrected(learned, fine.those(first)), Corrected(learned, fine)
    for name in quantities:
        data |= _predicted(before, fine, first, name) | _corrected(after, name)
    explained = [name for name in quantities if name in quality]
    data |= _quality(explained, quality) | _indices(learned, explained) | _effects(learned, explained)
    data |= _slices(learned, explained, device) | _pairs(learned, explained, data["index_second"][1])
    texts, numbers, held = shares(learned)
    long_name = "share of designs for which a statement of the paper holds"
    data["claim_share"] = ("claim", "claim_n_pouches"), held, {"units": "1", "long_name": long_name}
    coordinates = {"input": learned.space.names, "quantity": explained, "recommended": list(why)}
    coordinates |= {"claim": texts, "claim_n_pouches": numbers}
    attributes = {"exploration": exploration.model_dump_json(), "cheap": exploration.cheap, "fine": exploration.fine}
    return xr.Dataset(data, coordinates, attributes)


def known_from(dataset: xr.Dataset) -> Learned:
    """What a dataset of ``dataset_of`` teaches: its designs by the cheap preset, as they were learned from."""
    return _again(dataset, "design", "")


def held_out_of(dataset: xr.Dataset) -> Learned:
    """What came of the designs of a dataset that were held out."""
    return _again(dataset, "tested", "tested_")


def _again(dataset: xr.Dataset, kind: str, prefix: str) -> Learned:
    exploration = Exploration.model_validate_json(dataset.attrs["exploration"])
    inputs, quantities = dataset.input.values.astype(str), [*exploration.goals, *exploration.constraints]
    designs, told = [], []
    for k in range(dataset.sizes[kind]):
        one = dataset.isel({kind: k})
        design = {name: float(one[f"{prefix}{name}"]) for name in inputs}
        designs.append(written(exploration, design))
        values = {name: float(one[f"{prefix}{name}"]) for name in quantities}
        scatter = {name: float(one[f"{prefix}{name}_scatter"]) for name in quantities}
        told.append(Told(str(one[f"{prefix}status"].values), str(one[f"{prefix}reason"].values), values, scatter))
    return learned_of(exploration, designs, told)


def described(name: str) -> tuple[str, str]:
    """Units and meaning of a quantity."""
    found = VARIABLES.get(name) or MEASURES[name]
    return found.units, found.long_name


def _designs(group: Learned, kind: str, prefix: str) -> Data:
    """Inputs, quantities, scatter and status of designs."""
    data: Data = {}
    for k, name in enumerate(group.space.names):
        values = np.array([group.space.inputs[k].from_unit(float(place)) for place in group.places[:, k]], float)
        data[f"{prefix}{name}"] = kind, values, {"units": UNITS[name], "long_name": name.replace("_", " ")}
    for name in (*group.exploration.goals, *group.exploration.constraints):
        units, long_name = described(name)
        scatter = np.array([each.scatter[name] for each in group.told], float)
        data[f"{prefix}{name}"] = kind, group.values(name), {"units": units, "long_name": long_name}
        about = {"units": units, "long_name": f"half range over branches, {long_name}"}
        data[f"{prefix}{name}_scatter"] = kind, scatter, about
    data[f"{prefix}status"] = kind, np.array([each.status for each in group.told], dtype=str)
    data[f"{prefix}reason"] = kind, np.array([each.reason for each in group.told], dtype=str)
    data[f"{prefix}feasible"] = kind, group.feasible
    return data


def _on_front(group: Learned) -> np.ndarray:
    on_front = np.zeros(len(group.told), bool)
    on_front[group.front] = True
    return on_front


def _predicted(before: Corrected, fine: Learned, first: np.ndarray, name: str) -> Data:
    """What was predicted of designs before the finer preset solved them: by the cheap surrogate, then by both."""
    mean, deviation = np.full(len(fine.told), np.nan), np.full(len(fine.told), np.nan)
    cheap = None if before.cheap.exploration.constraints.get(name) == NEVER else before.cheap.process(name)
    for chosen, process in ((first, cheap), (~first, cheap and before.process(name))):
        if process is not None and chosen.any():
            mean[chosen], deviation[chosen] = process.predict(fine.places[chosen])
    units, long_name = described(name)
    return {
        f"predicted_{name}": ("recommended", mean, {"units": units, "long_name": f"before it was solved, {long_name}"}),
        f"predicted_{name}_deviation": ("recommended", deviation, {"units": units, "long_name": "standard deviation"}),
    }


def _corrected(both: Corrected, name: str) -> Data:
    """The cheap surrogate of a quantity corrected by the finer preset at all designs; NaN where that has too few values."""
    count = len(both.cheap.told)
    mean, deviation, error, slope = np.full(count, np.nan), np.full(count, np.nan), np.nan, np.nan
    process = None if both.cheap.exploration.constraints.get(name) == NEVER else both.process(name)
    if process is not None:
        (mean, deviation), error, slope = process.predict(both.cheap.places), process.quality().error, process.rho
    units, long_name = described(name)
    return {
        f"corrected_{name}": ("design", mean, {"units": units, "long_name": f"by both presets, {long_name}"}),
        f"corrected_{name}_deviation": ("design", deviation, {"units": units, "long_name": "standard deviation"}),
        f"corrected_{name}_error": ((), error, {"units": "1", "long_name": "error of leaving a fine value out, over the range"}),
        f"corrected_{name}_slope": ((), slope, {"units": "1", "long_name": "rho of the correction"}),
    }


def _quality(explained: Sequence[str], quality: Mapping[str, Tested]) -> Data:
    tested = [quality[name] for name in explained]
    columns = {
        "surrogate_error": ([t.left_out.error for t in tested], "root mean square error of leaving designs out, over the range"),
        "surrogate_coverage": ([t.left_out.coverage for t in tested], "share of left out designs within their interval of 95 %"),
        "surrogate_designs": ([t.left_out.designs for t in tested], "designs that it knows"),
        "tested_error": ([t.held_out.error for t in tested], "root mean square error of designs held out, over the range"),
        "tested_coverage": ([t.held_out.coverage for t in tested], "share of designs held out within their interval of 95 %"),
        "tested_designs": ([t.held_out.designs for t in tested], "designs held out that were solved"),
        "surrogate_used": ([t.is_used for t in tested], "whether its errors are small enough to use it"),
    }
    return {name: ("quantity", np.array(values), {"long_name": text}) for name, (values, text) in columns.items()}


def _indices(learned: Learned, explained: Sequence[str]) -> Data:
    shape = len(explained), len(learned.space.inputs)
    found = {key: np.full(shape, np.nan) for key in ("first", "first_within", "total", "total_within")}
    second = np.full((*shape, shape[1]), np.nan)
    for k, name in enumerate(explained):
        process = learned.process(name)
        try:
            indices = sensitivity.indices(learned.space, lambda places, p=process: p.predict(places)[0], learned.seed)
        except ValueError:
            continue
        for key in found:
            found[key][k] = getattr(indices, key)
        second[k] = indices.second
    texts = {
        "first": "first-order Sobol index of the surrogate",
        "first_within": "half width of its interval of 95 %",
        "total": "total Sobol index of the surrogate",
        "total_within": "half width of its interval of 95 %",
    }
    data: Data = {f"index_{key}": (("quantity", "input"), found[key], {"units": "1", "long_name": texts[key]}) for key in found}
    text = "second-order Sobol index of a pair of inputs, of the surrogate"
    return data | {"index_second": (("quantity", "input", "other"), second, {"units": "1", "long_name": text})}


def _steps(learned: Learned, i: int, steps: int = STEPS) -> np.ndarray:
    """Places along an input: its categories, or evenly over its range."""
    each = learned.space.inputs[i]
    return (np.arange(len(each.values)) + 0.5) / len(each.values) if each.values else np.linspace(0, 1, steps)


def _effects(learned: Learned, explained: Sequence[str]) -> Data:
    """Means over all other inputs at steps of each one, and the range of 80 % of designs there."""
    random = np.random.default_rng(learned.seed).random((OVER, len(learned.space.inputs)))
    shape = len(explained), len(learned.space.inputs), STEPS
    mean, low, high, at = np.full(shape, np.nan), np.full(shape, np.nan), np.full(shape, np.nan), np.full(shape[1:], np.nan)
    for i, each in enumerate(learned.space.inputs):
        for s, step in enumerate(_steps(learned, i)):
            at[i, s] = each.from_unit(float(step))
            places = random.copy()
            places[:, i] = step
            places = learned.space.snapped(places)
            for q, name in enumerate(explained):
                values = learned.process(name).predict(places)[0]
                mean[q, i, s], (low[q, i, s], high[q, i, s]) = values.mean(), np.quantile(values, (0.1, 0.9))
    dims = ("quantity", "input", "step")
    return {
        "effect": (dims, mean, {"long_name": "mean of the surrogate over all other inputs"}),
        "effect_low": (dims, low, {"long_name": "tenth percentile over all other inputs"}),
        "effect_high": (dims, high, {"long_name": "ninetieth percentile over all other inputs"}),
        "effect_at": (dims[1:], at, {"long_name": "value of the input"}),
    }


def _slices(learned: Learned, explained: Sequence[str], device: Device) -> Data:
    """The surrogates with their standard deviations along each input, through the device as it is and the front's turn."""
    through: dict[str, np.ndarray] = {}
    if (own := own_design(learned.exploration, device)) is not None:
        through[AS_IT_IS] = learned.space.to_unit([own])[0]
    if len(learned.front):
        through["where the front turns"] = learned.places[learned.front[knee(learned.goals[learned.front])]]
    shape = len(explained), len(through), len(learned.space.inputs), STEPS
    mean, deviation = np.full(shape, np.nan), np.full(shape, np.nan)
    for line, place in enumerate(through.values()):
        for i in range(len(learned.space.inputs)):
            steps = _steps(learned, i)
            places = np.repeat(place[None], len(steps), axis=0)
            places[:, i] = steps
            places = learned.space.snapped(places)
            for q, name in enumerate(explained):
                found = learned.process(name).predict(places)
                mean[q, line, i, : len(steps)], deviation[q, line, i, : len(steps)] = found
    dims = ("quantity", "line", "input", "step")
    places = np.array(
        [[each.from_unit(float(x)) for each, x in zip(learned.space.inputs, p, strict=True)] for p in through.values()]
    )
    return {
        "slice": (dims, mean, {"long_name": "surrogate along an input through a design"}),
        "slice_deviation": (dims, deviation, {"long_name": "its standard deviation"}),
        "slice_through": (("line", "input"), places.reshape(len(through), -1), {"long_name": "the design"}),
        "line": ("line", np.array(list(through), dtype=str), {"long_name": "design that slices go through"}),
    }


def _pairs(learned: Learned, explained: Sequence[str], second: np.ndarray) -> Data:
    """Of each quantity the two inputs that act together most, and its mean over all others on both of them."""
    count, steps = len(learned.space.inputs), PAIR_STEPS
    random = np.random.default_rng(learned.seed).random((PAIR_OVER, count))
    chosen = np.zeros((len(explained), 2), int)
    mean, at = np.full((len(explained), steps, steps), np.nan), np.full((len(explained), 2, steps), np.nan)
    for q, name in enumerate(explained):
        if count < 2 or not np.isfinite(second[q]).any():
            continue
        i, j = sorted(np.unravel_index(np.nanargmax(np.triu(second[q], 1)), (count, count)))
        chosen[q] = i, j
        along = [_steps(learned, k, steps) for k in (i, j)]
        for side, (k, places) in enumerate(zip((i, j), along, strict=True)):
            at[q, side, : len(places)] = [learned.space.inputs[k].from_unit(float(x)) for x in places]
        for a, x in enumerate(along[0]):
            places = np.repeat(random, len(along[1]), axis=0)
            places[:, i], places[:, j] = x, np.tile(along[1], PAIR_OVER)
            places = learned.space.snapped(places)
            values = learned.process(name).predict(places)[0].reshape(PAIR_OVER, -1)
            mean[q, a, : len(along[1])] = values.mean(axis=0)
    return {
        "pair": (("quantity", "side"), chosen, {"long_name": "the two inputs that act together most"}),
        "pair_mean": (
            ("quantity", "pair_step", "pair_other"),
            mean,
            {"long_name": "mean of the surrogate over all other inputs"},
        ),
        "pair_at": (("quantity", "side", "pair_step"), at, {"long_name": "values of the two inputs"}),
    }
