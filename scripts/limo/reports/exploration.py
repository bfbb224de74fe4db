"""What an exploration found: a dataset of designs, surrogates and indices, pictures, cutting patterns, and a page of them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from limo.config.project import Project
from limo.datasets.variables import VARIABLES
from limo.explore import sensitivity
from limo.explore.designs import pattern_of
from limo.explore.learn import Learned, quality_of
from limo.explore.rounds import round_designs
from limo.explore.steps import learn, learned_of, told_of
from limo.explore.surrogate import FEWEST, Process, TwoFidelities
from limo.explore.telling import Told
from limo.figures import exploration as figures
from limo.figures import style
from limo.geometry.cutting import cutting_lines, dxf, svg
from limo.geometry.pattern import flat_pattern
from limo.measure.quantities import MEASURES
from limo.reports.markdown import markdown_table
from limo.schema.exploration import AS_IT_IS, NEVER, Exploration
from limo.store.files import read_json, read_netcdf, write_netcdf, write_whole
from limo.store.results import ExplorationFiles, Results
from limo.store.statuses import USABLE

#: points of an effect over an input, and designs that each is a mean of
STEPS, OVER = 21, 256
#: units of inputs
UNITS = {"n_pouches": "1", "aspect_ratio": "1", "stiffness_ratio": "1", "thickness": "mm", "seam_shift": "1", "width_scale": "1"}


def write_report(project: Project, name: str, exploration: Exploration, results: Results) -> str:
    """Write dataset, pictures, cutting patterns and page of an exploration whose rounds are all told; returns a line about it."""
    files, rounds = results.exploration(name), len(exploration.rounds)
    learned = learn(exploration, results, name, rounds)
    fine_designs = round_designs(results, name, rounds)
    fine = {design: told_of(told) for design, told in read_json(files.told(rounds))["told"].items()}
    why = read_json(files.round(rounds))["why"]
    dataset = dataset_of(exploration, learned, fine_designs, fine, why)
    write_netcdf(dataset, files.dataset)
    drawn = _draw(dataset, files)
    patterns = _patterns(project, exploration, dataset, files.folder)
    text = page(exploration, name, dataset, drawn, patterns)
    write_whole(files.page, lambda path: path.write_text(text, encoding="utf-8"))
    count = int(dataset.on_front.sum())
    return f"{files.page}: {len(learned.told)} designs, {count} on the front, {len(fine)} solved by {exploration.fine}"


def keep_exploration(name: str, results: Results, gallery: Path) -> list[Path]:
    """Take the dataset of an exploration into the gallery, with its pictures and its page, which are made of it alone.

    Raises ``ResultError`` where there is none.
    """
    dataset = _read(results.exploration(name).dataset)
    kept = ExplorationFiles(gallery / name)
    kept.folder.mkdir(parents=True, exist_ok=True)
    small = {n: {"zlib": True, "complevel": 9} for n, v in dataset.data_vars.items() if v.dtype.kind == "f" and v.dims}
    write_netcdf(dataset, kept.dataset, small)
    drawn = _draw(dataset, kept)
    text = kept_page(kept.dataset)
    write_whole(kept.page, lambda path: path.write_text(text, encoding="utf-8"))
    return [kept.dataset, *(kept.figure(figure) for figure in drawn), kept.page]


def kept_page(file: Path) -> str:
    """The page of a kept dataset. Raises ``ResultError``."""
    dataset = _read(file)
    exploration = Exploration.model_validate_json(dataset.attrs["exploration"])
    return page(exploration, file.parent.name, dataset, figures.names(dataset), {})


def _read(file: Path) -> xr.Dataset:
    return read_netcdf(file, "exploration, which snakemake NAME makes")


def _draw(dataset: xr.Dataset, files: ExplorationFiles) -> list[str]:
    """Draw all figures of a dataset; returns their names."""
    drawn = figures.every(dataset)
    for figure, made in drawn.items():
        style.save(made, files.figure(figure))
        style.close(made)
    return list(drawn)


def dataset_of(
    exploration: Exploration,
    learned: Learned,
    fine_designs: Mapping[str, Mapping[str, float]],
    fine: Mapping[str, Told],
    why: Mapping[str, str],
) -> xr.Dataset:
    """Designs of both presets with their inputs and quantities; effects, indices and quality of the surrogates."""
    quantities = [*exploration.goals, *exploration.constraints]
    by_fine = learned_of(exploration, list(fine_designs.values()), list(fine.values()))
    inputs = [each.name for each in learned.space.inputs]
    data: dict[str, tuple] = {}
    for kind, group in (("design", learned), ("recommended", by_fine)):
        prefix = "" if kind == "design" else "recommended_"
        for name in inputs:
            values = np.array([float(design[name]) for design in group.designs])
            data[f"{prefix}{name}"] = kind, values, {"units": UNITS[name], "long_name": name.replace("_", " ")}
        for name in quantities:
            units, long_name = _described(name)
            data[f"{prefix}{name}"] = kind, group.values(name), {"units": units, "long_name": long_name}
            scatter = np.array([each.scatter[name] for each in group.told])
            data[f"{prefix}{name}_scatter"] = (
                kind,
                scatter,
                {"units": units, "long_name": f"half range over branches, {long_name}"},
            )
        data[f"{prefix}status"] = kind, np.array([each.status for each in group.told])
        data[f"{prefix}reason"] = kind, np.array([each.reason for each in group.told])
        data[f"{prefix}feasible"] = kind, group.feasible
    on_front = np.zeros(len(learned.told), bool)
    on_front[learned.front] = True
    data["on_front"] = "design", on_front
    data["why"] = "recommended", np.array([why[design] for design in fine])
    quality = quality_of(learned)
    for name in quantities:
        process = learned.process(name) if exploration.constraints.get(name) != NEVER else None
        mean, deviation = (
            (np.full(len(fine), np.nan),) * 2 if process is None or not len(fine) else process.predict(by_fine.places)
        )
        units, long_name = _described(name)
        data[f"predicted_{name}"] = "recommended", mean, {"units": units, "long_name": f"by the surrogate, {long_name}"}
        data[f"predicted_{name}_deviation"] = "recommended", deviation, {"units": units, "long_name": "standard deviation"}
        data |= _corrected(learned, by_fine, name, process, (units, long_name))
    explained = [name for name in quantities if name in quality]
    data |= _quality(explained, quality) | _indices(learned, explained) | _effects(learned, explained)
    coordinates = {"input": inputs, "quantity": explained, "recommended": list(fine)}
    attributes = {"exploration": exploration.model_dump_json(), "cheap": exploration.cheap, "fine": exploration.fine}
    return xr.Dataset(data, coordinates, attributes)


def _corrected(learned: Learned, fine: Learned, name: str, process: Process | None, words: tuple[str, str]) -> dict[str, tuple]:
    """The cheap surrogate of a quantity corrected by the finer preset at all designs; NaN where that has too few values."""
    count = len(learned.told)
    mean, deviation, error, slope = np.full(count, np.nan), np.full(count, np.nan), np.nan, np.nan
    known = fine.solved & np.isfinite(fine.values(name)) if len(fine.told) else np.zeros(0, bool)
    if process is not None and known.sum() >= FEWEST:
        scatter = np.array([each.scatter[name] for each in fine.told])
        both = TwoFidelities(process, fine.places[known], fine.values(name)[known], scatter[known], learned.seed)
        (mean, deviation), error, slope = both.predict(learned.places), both.quality().error, both.rho
    units, long_name = words
    return {
        f"corrected_{name}": ("design", mean, {"units": units, "long_name": f"by both presets, {long_name}"}),
        f"corrected_{name}_deviation": ("design", deviation, {"units": units, "long_name": "standard deviation"}),
        f"corrected_{name}_error": ((), error, {"units": "1", "long_name": "error of leaving a fine value out, over the range"}),
        f"corrected_{name}_slope": ((), slope, {"units": "1", "long_name": "rho of the correction"}),
    }


def _described(name: str) -> tuple[str, str]:
    """Units and meaning of a quantity."""
    found = VARIABLES.get(name) or MEASURES[name]
    return found.units, found.long_name


def _quality(explained: list[str], quality: Mapping[str, tuple]) -> dict[str, tuple]:
    columns = list(zip(*(quality[name] for name in explained), strict=True)) or [[], [], [], []]
    names = ("surrogate_error", "surrogate_coverage", "surrogate_designs", "surrogate_used")
    texts = (
        "root mean square error of leaving designs out, over the range",
        "share of designs within their interval of 95 %",
        "designs that it knows",
        "whether its error is small enough to use it",
    )
    return {n: ("quantity", np.array(c), {"long_name": t}) for n, c, t in zip(names, columns, texts, strict=True)}


def _indices(learned: Learned, explained: list[str]) -> dict[str, tuple]:
    shape = len(explained), len(learned.space.inputs)
    found = {key: np.full(shape, np.nan) for key in ("first", "first_within", "total", "total_within")}
    for k, name in enumerate(explained):
        process = learned.process(name)
        try:
            indices = sensitivity.indices(learned.space, lambda places, p=process: p.predict(places)[0], learned.seed)
        except ValueError:
            continue
        for key in found:
            found[key][k] = getattr(indices, key)
    texts = {
        "first": "first-order Sobol index of the surrogate",
        "first_within": "half width of its interval of 95 %",
        "total": "total Sobol index of the surrogate",
        "total_within": "half width of its interval of 95 %",
    }
    return {f"index_{key}": (("quantity", "input"), found[key], {"units": "1", "long_name": texts[key]}) for key in found}


def _effects(learned: Learned, explained: list[str]) -> dict[str, tuple]:
    """Means over all other inputs at steps of each one, and the range of 80 % of designs there."""
    random = np.random.default_rng(learned.seed).random((OVER, len(learned.space.inputs)))
    shape = len(explained), len(learned.space.inputs), STEPS
    mean, low, high, at = (np.full(shape[-len(s) :] if len(s) < 3 else shape, np.nan) for s in ("qis", "qis", "qis", "is"))
    for i, each in enumerate(learned.space.inputs):
        count = len(each.values) or STEPS
        steps = (np.arange(count) + 0.5) / count if each.values else np.linspace(0, 1, STEPS)
        at[i, :count] = [each.from_unit(float(x)) for x in steps]
        for s, step in enumerate(steps):
            places = learned.space.snapped(random)
            places[:, i] = step
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


def _patterns(project: Project, exploration: Exploration, dataset: xr.Dataset, folder: Path) -> dict[str, list[str]]:
    """Cutting patterns of the recommended designs, to scale, by their names."""
    written: dict[str, list[str]] = {}
    for name in dataset.recommended.values:
        design = dataset.sel(recommended=name)
        values = {each: float(design[f"recommended_{each}"]) for each in dataset.input.values}
        pouches = int(values.get("n_pouches", exploration.space.numbers[0]))
        pattern = pattern_of(project, exploration, values | {"n_pouches": pouches})
        lines = cutting_lines(flat_pattern(pattern, pouches))
        title = f"{name}, N_p = {pouches}, one face, L = {pattern.length:g} mm"
        files = {folder / "cutting" / f"{name}.svg": svg(lines, title), folder / "cutting" / f"{name}.dxf": dxf(lines)}
        for file, text in files.items():
            file.parent.mkdir(parents=True, exist_ok=True)
            write_whole(file, lambda path, text=text: path.write_text(text, encoding="utf-8"))
        written[str(name)] = [f"cutting/{file.name}" for file in files]
    return written


def page(exploration: Exploration, name: str, dataset: xr.Dataset, drawn: list[str], patterns: Mapping[str, list[str]]) -> str:
    """The page of an exploration."""
    parts = [f"# {name}\n\n{exploration.description or 'An exploration'}."]
    status = dataset.status.values.astype(str)
    solved = int(np.isin(status, USABLE).sum())
    parts.append(
        f"{len(status)} designs by `{exploration.cheap}`, {solved} of them solved, {int(dataset.feasible.sum())} feasible, "
        f"{int(dataset.on_front.sum())} on the front. {dataset.sizes['recommended']} are solved by `{exploration.fine}`."
    )
    parts.append(
        f"## Recommended\n\n{markdown_table(_recommended(exploration, dataset, patterns))}\n\n{compared(exploration, dataset)}"
    )
    parts.append(f"## How good the surrogates are\n\n{markdown_table(_qualities(dataset))}")
    if text := _corrections(exploration, dataset):
        parts.append(text)
    parts.append(f"## What explains what\n\n{markdown_table(_explained(dataset))}")
    parts += [f"## {figures.TITLES[figure]}\n\n![{figure}]({figure}.png)\n\n{figures.CAPTIONS[figure]}" for figure in drawn]
    return "\n\n".join(parts) + "\n"


def _recommended(exploration: Exploration, dataset: xr.Dataset, patterns: Mapping[str, list[str]]) -> pd.DataFrame:
    rows = []
    for name in dataset.recommended.values:
        one = dataset.sel(recommended=name)
        row = {"why": str(one.why.values), "status": str(one.recommended_status.values)}
        row |= {each: f"{float(one[f'recommended_{each}']):.4g}" for each in dataset.input.values}
        for quantity in (*exploration.goals, *exploration.constraints):
            value, scatter = float(one[f"recommended_{quantity}"]), float(one[f"recommended_{quantity}_scatter"])
            mean, deviation = float(one[f"predicted_{quantity}"]), float(one[f"predicted_{quantity}_deviation"])
            row[quantity] = f"{value:.4g} ± {scatter:.2g}" if np.isfinite(value) else ""
            row[f"{quantity} by the surrogate"] = f"{mean:.4g} ± {deviation:.2g}" if np.isfinite(mean) else ""
        if files := patterns.get(str(name)):
            row["cutting pattern"] = ", ".join(f"[{Path(file).suffix[1:]}]({file})" for file in files)
        rows.append(row)
    return pd.DataFrame(rows)


def compared(exploration: Exploration, dataset: xr.Dataset) -> str:
    """How much better the recommended designs are than the device as it is, by the finer preset, goal by goal."""
    own = np.flatnonzero(dataset.why.values.astype(str) == AS_IT_IS)
    if not len(own) or not bool(dataset.recommended_feasible[own[0]]):
        return ""
    lines, feasible = [], dataset.recommended_feasible.values
    goals = list(exploration.goals)
    for k, goal in enumerate(goals):
        sign = -1.0 if exploration.goals[goal] == "maximise" else 1.0
        ok = feasible.copy()
        for other in goals[:k] + goals[k + 1 :]:  # no worse in the other goal
            turn = -1.0 if exploration.goals[other] == "maximise" else 1.0
            values = turn * dataset[f"recommended_{other}"].values
            ok &= values <= values[own[0]] * (1 + 1e-9 * np.sign(values[own[0]]))
        values = dataset[f"recommended_{goal}"].values
        best = int(np.flatnonzero(ok)[np.argmin(sign * values[ok])]) if ok.any() else int(own[0])
        band = np.hypot(*(float(dataset[f"recommended_{goal}_scatter"][j]) for j in (best, own[0])))
        others = f" at no worse {' or '.join(goals[:k] + goals[k + 1 :])}" if len(goals) > 1 else ""
        what = (
            "the device as it is is the best of them"
            if best == own[0]
            else (
                f"{dataset.why.values[best]!s} has {values[best]:.4g} instead of {values[own[0]]:.4g}, a change of "
                f"{values[best] - values[own[0]]:+.3g} ± {band:.2g}"
            )
        )
        lines.append(f"- {goal}{others}: {what}.")
    return "Beside the device as it is:\n\n" + "\n".join(lines)


def _qualities(dataset: xr.Dataset) -> pd.DataFrame:
    return pd.DataFrame(
        {
            "quantity": str(name),
            "designs": int(one.surrogate_designs),
            "error over the range, leaving designs out [%]": f"{100 * float(one.surrogate_error):.1f}",
            "within their 95 % interval [%]": f"{100 * float(one.surrogate_coverage):.0f}",
            "used": "yes" if bool(one.surrogate_used) else "not to be used",
        }
        for name in dataset.quantity.values
        for one in [dataset.sel(quantity=name)]
    )


def _corrections(exploration: Exploration, dataset: xr.Dataset) -> str:
    """What the finer preset changes, in words."""
    found = [
        f"{name} rho = {float(dataset[f'corrected_{name}_slope']):.2f}, error "
        f"{100 * float(dataset[f'corrected_{name}_error']):.0f} % of the range of its fine values"
        for name in (*exploration.goals, *exploration.constraints)
        if np.isfinite(dataset[f"corrected_{name}_error"])
    ]
    if not found:
        return f"Fewer than {FEWEST} designs are solved by `{exploration.fine}`, so that the cheap surrogate is not corrected."
    return f"Corrected by `{exploration.fine}`, high = rho low + delta: {'; '.join(found)}."


def _explained(dataset: xr.Dataset) -> pd.DataFrame:
    rows = []
    for name in dataset.quantity.values:
        one, row = dataset.sel(quantity=name), {"quantity": str(name)}
        for k, each in enumerate(dataset.input.values):
            first, total = float(one.index_first[k]), float(one.index_total[k])
            row[str(each)] = f"{first:.2f}, {total:.2f} ± {float(one.index_total_within[k]):.2f}" if np.isfinite(total) else ""
        rows.append(row)
    return pd.DataFrame(rows)
