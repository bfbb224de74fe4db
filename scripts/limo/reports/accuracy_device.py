"""The part of docs/accuracy.md about the device: what every setting costs and how wrong it is, from the kept dataset alone.

Whatever a run is needed for that is not in the dataset says *not measured*.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
import xarray as xr

from limo.accuracy.errors import CURVES, PAPER_HEIGHT
from limo.accuracy.statistics import (
    PAPER_CHAMFER,
    SHELLS,
    exponent,
    meshes_of,
    models_of,
    richardson,
    rows_of,
    scaling_of,
    scatter_row,
    settings_of,
    sizes_of,
)
from limo.reports.markdown import markdown_table, number, percent, signed_percent
from limo.schema.config import Preset
from limo.store.statuses import CONVERGED, USABLE

NOT_MEASURED = "not measured"
#: the mesh of which the paper says how near it is to the finest
PAPER_LEVEL = "medium"
#: elements that are compared with the default one on the same mesh
COMPARED = ("C3D20", SHELLS)
#: memory (MiB) of the machine that models have to fit into
MEMORY = 24 * 1024
_COLUMNS = {
    "volumes": "error_volumes",
    "V_v": "error_ventricle_volume",
    "Delta V_a": "error_actuation_volume",
    "stroke": "error_stroke",
    "P_a at 90 ml": "error_pressure_90ml",
    "eta at 90 ml": "error_efficiency_90ml",
    "stress": "error_stress",
    "w": "error_height",
    "d_c / L": "error_chamfer",
}
_HEAD = """## The device

There are two devices with the outline `limo`. `np4` has N_p = 4 at P_v = 13.8 kPa, as in the paper. `np8` has N_p = 8 at
P_v = 3.8 kPa.

- **Settings** (`config/studies/accuracy_*`): engine newton, one setting at a time around bricks whose layers touch.
- **Reference** (`reference_*`): the mean of runs on the finest mesh, whose layers touch. Their flat states differ by a fraction
  of a thickness.
- **Scatter** (`scatter_*`): such runs on coarser meshes. They show how far apart runs of the same setting end.
- **Referee** (`referee_*`): CalculiX, which has no contact, one setting at a time; `shells_*`: the shells that it expands itself.

The columns of errors are:

- `volumes`: the larger relative L2 error of V_v and Delta V_a over the ramp.
- `stress`: the error of the top-5 % von Mises stress at P_a,max.
- `w`: the error of the largest w at P_a,max.
- `d_c`: the symmetric Chamfer distance of the surfaces at P_a,max.

**An error within the scatter is not significant**; it is marked with ~. `within 2 %` and `harmless` mean: within the larger
of the paper's 2 % and the scatter. All runs keep 21 frames. These change no curve but cost newton iterations
(`docs/methods.md`). Rows and curves are in `docs/gallery/data/accuracy.nc`.

Reference and referee take long. Their runs are solved once and kept with their curves and surfaces in
`docs/gallery/data/<study>_runs.nc`. Without that file they are solved again."""
#: of CPU time over size that engines may not exceed; newton: begun flat, without contact
EXPONENTS = {"newton": 1.62}
_SCALING = (
    "The exponent of CPU time comes from whole runs that differ only in mesh level and symmetry. The time of an iteration and "
    "the memory come from models of the full device (`scaling` in `config/config.yaml`). These are iterated a few times from the "
    "flat state, up to a limit of memory and time."
)
_TO_MEASURE = "`make accuracy` measures it."


def device_report(dataset: xr.Dataset | None, presets: dict[str, Preset]) -> str:
    """The section *The device*; without a dataset the questions without answers."""
    parts = [_HEAD]
    if dataset is None:
        return "\n\n".join([*parts, _TO_MEASURE, markdown_table(_presets(None, presets)), _answers({})])
    rows = rows_of(dataset)
    builds, machines = (", ".join(sorted(set(rows[name][rows[name] != ""]))) for name in ("build", "machine"))
    parts.append(
        "CPU seconds are of one thread, by the operating system's accounting, with two cases side by side. They are the median "
        "of `timed` solves; a case of less than a minute is solved several times for that. Machines and builds: "
        f"{machines}; {builds}." + " Seconds of different machines are not to be compared." * ("," in machines)
    )
    names = list(dict.fromkeys(rows.device))
    parts += ["### Presets", markdown_table(pd.concat([_presets(rows[rows.device == name], presets, name) for name in names]))]
    parts += ["### Answers", _answers({name: _answers_of(dataset, rows[rows.device == name]) for name in names})]
    parts += ["### What it takes to solve larger models", _SCALING, markdown_table(_scaling(rows, sizes_of(dataset)))]
    for name in names:
        parts += [f"### Every setting of `{name}`", markdown_table(_settings(rows[rows.device == name]))]
    return "\n\n".join(parts)


# --------------------------------------------------------------------------------------------------------------------
# tables


def _presets(rows: pd.DataFrame | None, presets: dict[str, Preset], device: str = "-") -> pd.DataFrame:
    """A line a preset: what it is, what it costs and how wrong it is."""
    table = []
    for name, preset in presets.items():
        selected = None if rows is None else _solved_by(rows, name)
        line = {"device": device, "preset": name, "level": preset.mesh.level, "symmetry": preset.mesh.symmetry}
        line |= {
            "engine": preset.engine,
            "solutions": preset.branches,
            "status": "-" if selected is None else selected.status,
            "CPU of one [s]": NOT_MEASURED if selected is None else f"{selected.cpu_seconds:.0f}",
        }
        line |= {"memory [MiB]": NOT_MEASURED if selected is None else f"{selected.memory_mib:.0f}"}
        for label in ("volumes", "stroke", "stress"):
            line[f"error of {label}"] = NOT_MEASURED if selected is None else error_text(selected, _COLUMNS[label], rows)
        table.append(line)
    return pd.DataFrame(table)


def _solved_by(rows: pd.DataFrame, preset: str) -> pd.Series | None:
    """The run of a preset from the flat state as it is, one that converged if there is one."""
    runs = rows[(rows.kind == "run") & (rows.branch == 0) & (rows.part != "scatter")]
    selected = _first(settings_of(rows), preset=preset)
    return _first(runs, preset=preset) if selected is None else selected


def _settings(rows: pd.DataFrame) -> pd.DataFrame:
    """A line a run, the scatter of both ensembles first; with the machine where there are several."""
    table, several = [], rows.machine.nunique() > 1
    for row in rows.sort_values("kind", ascending=False, kind="stable").itertuples():
        what = row.setting if row.kind == "run" else f"{row.kind} of {row.setting}"
        line = {
            "setting": what if row.branch == 0 or row.kind != "run" else f"{what}, branch {row.branch:.0f}",
            "instead of the default": row.change or "-",
            "engine": row.engine,
            "dof": f"{row.degrees_of_freedom:.0f}",
            "status": f"{row.status}: {row.reason}" if row.reason else row.status,
        }
        selected = row._asdict()
        line |= {label: error_text(selected, column, rows if row.kind == "run" else None) for label, column in _COLUMNS.items()}
        line["cycles [decades]"] = number(selected["error_cycles"], 2)
        line["dissipated"] = percent(row.dissipated_fraction)
        line["CPU [s]"] = number(row.cpu_seconds, 0)
        line["timed"] = number(row.timed, 0)
        line["iterations"] = number(row.iterations, 0)
        line["memory [MiB]"] = number(row.memory_mib, 0)
        table.append(line | ({"machine": row.machine} if several else {}))
    return pd.DataFrame(table)


def _scaling(rows: pd.DataFrame, sizes: pd.DataFrame) -> pd.DataFrame:
    """Exponents over the displacements that are solved for, the largest model that was tried, and what fits into the machine."""
    table = []
    for model, group in scaling_of(rows).groupby("model", sort=False):
        size, models = group.solved_degrees_of_freedom, models_of(group, sizes).sort_values("displacements")
        largest, (power, _) = models.iloc[-1], exponent(size, group.cpu_seconds)
        table.append(
            {
                "model": model,
                "runs": len(group),
                "displacements": f"{size.min():.0f} to {size.max():.0f}",
                "exponent of CPU time": number(power, 2),
                "bound": _below(power, EXPONENTS.get(group.engine.iloc[0], np.nan)),
                "of an iteration": number(exponent(models.displacements, models.seconds_per_iteration)[0], 2),
                "of memory": number(exponent(models.displacements, models.memory_mib)[0], 2),
                "largest model": number(largest.displacements, 0),
                "s an iteration": number(largest.seconds_per_iteration, 1),
                "MiB": number(largest.memory_mib, 0),
                "extrapolated from the last two: displacements in 24 GiB": number(_fitting(models) if len(sizes) else np.nan, 0),
            }
        )
    return pd.DataFrame(table)


def _below(power: float, bound: float) -> str:
    """A bound, and whether an exponent is not above it; a dash where one of them is not known."""
    return "-" if np.isnan(power + bound) else f"{bound:g}, {'met' if power <= bound else '**not met**'}"


def _fitting(models: pd.DataFrame) -> float:
    """Displacements of which the memory is ``MEMORY``, by the power law through the two largest models; NaN of fewer."""
    if len(models) < 2:
        return float("nan")
    before, last = models.iloc[-2], models.iloc[-1]
    power = np.log(last.memory_mib / before.memory_mib) / np.log(last.displacements / before.displacements)
    return float(last.displacements * (MEMORY / last.memory_mib) ** (1 / power))


# --------------------------------------------------------------------------------------------------------------------
# questions

#: what runs whose layers pass each other vary of the default, and what the run with contact beside them varies
APART = {"contact": "", "level, contact": "level", "level, contact, numerics": "level"}
QUESTIONS = {
    "preview": "What does `preview` cost, and how large are its errors?",
    "symmetry": "How much does quarter symmetry change the volumes?",
    "elements": "How far do elements differ on one mesh?",
    "damping": "How much damping is harmless?",
    "mesh": "Which mesh is the cheapest with small errors?",
    "paper": "Are the settings within the paper's 2 %?",
    "scatter": "How large are the scatter of paths and the discretisation error?",
    "limit": "How far is the reference from the limit of ever finer meshes?",
    "engines": "How far do CalculiX and newton differ?",
    "contact": "What does it change that layers touch?",
}


def _answers(found: dict[str, dict[str, list[str]]]) -> str:
    """Each question with the answer of each device."""
    lines = []
    for key, question in QUESTIONS.items():
        each = [_answer(device, answers[key]) for device, answers in found.items()] or [f"  - {NOT_MEASURED}."]
        lines.append("\n".join([f"- **{question}**", *each]))
    return "\n".join(lines)


def _answer(device: str, findings: list[str]) -> str:
    """The findings of one device: a single one beside its name, several as a list below it."""
    if len(findings) == 1:
        return f"  - `{device}`: {findings[0]}."
    return "\n".join([f"  - `{device}`:", *(f"    - {finding}." for finding in findings)])


def _answers_of(dataset: xr.Dataset, rows: pd.DataFrame) -> dict[str, list[str]]:
    """The findings of one device by the keys of ``QUESTIONS``."""
    return {
        "preview": _preview(rows),
        "symmetry": _symmetry(dataset, rows),
        "elements": _elements(dataset, rows),
        "damping": _damping(dataset, rows),
        "mesh": _mesh(rows),
        "paper": _paper(rows),
        "scatter": _scatter(rows),
        "limit": _limit(rows),
        "engines": _engines(dataset, rows),
        "contact": _contact(dataset, rows),
    }


def differences(dataset: xr.Dataset, run: int, other: int) -> dict[str, float]:
    """How far a row is from another: relative L2 of the curves over the ramp, and relative differences of values; signed."""
    collected = {}
    for name in CURVES:
        selected, theirs = dataset[name].values[[run, other]].astype(float)
        known = np.isfinite(theirs)
        collected[name] = (
            float(np.linalg.norm((selected - theirs)[known]) / np.linalg.norm(theirs[known])) if known.any() else np.nan
        )
    for name in ("stroke", "stress", "height", "cpu_seconds"):
        selected, theirs = dataset[name].values[[run, other]].astype(float)
        collected[name] = float(selected / theirs - 1.0)
    return collected | {"volumes": max(collected[name] for name in CURVES)}


def _compared(dataset: xr.Dataset, run: pd.Series, other: pd.Series) -> str:
    collected = differences(dataset, run.name, other.name)
    stroke, stress = signed_percent(collected["stroke"]), signed_percent(collected["stress"])
    times = f", CPU time {number(1 + collected['cpu_seconds'], 2)} times" if run.machine == other.machine else ""
    return f"volumes {percent(collected['volumes'])}, stroke {stroke}, stress {stress}{times}"


def _preview(rows: pd.DataFrame) -> list[str]:
    selected = _first(settings_of(rows), preset="preview")
    if selected is None:
        return [NOT_MEASURED]
    return [
        f"{selected.cpu_seconds:.0f} s of CPU time and {selected.memory_mib:.0f} MiB; "
        f"volumes {error_text(selected, 'error_volumes', rows)}, stroke {error_text(selected, 'error_stroke', rows)}, "
        f"stress {error_text(selected, 'error_stress', rows)}"
    ]


def _against_default(dataset: xr.Dataset, settings: pd.DataFrame, varied: str) -> list[str]:
    """The runs that differ from the default of their engine in one column alone, each beside it."""
    lines = []
    for _, run in settings[settings.varied == varied].iterrows():
        if (base := _first(settings, varied="", engine=run.engine)) is not None:
            lines.append(f"{run[varied]} against {base[varied]} with {run.engine}: {_compared(dataset, run, base)}")
    return lines


def _symmetry(dataset: xr.Dataset, rows: pd.DataFrame) -> list[str]:
    return _with_scatter(_against_default(dataset, settings_of(rows), "symmetry"), rows)


def _elements(dataset: xr.Dataset, rows: pd.DataFrame) -> list[str]:
    settings, lines = settings_of(rows), []
    reduced, full = _first(settings, element="S8R"), _first(settings, element="S8")
    if reduced is not None and full is not None:
        lines.append(f"S8R against S8: {_compared(dataset, reduced, full)}")
        if (bricks := _first(settings, varied="", engine=reduced.engine)) is not None:
            lines.append(f"S8R of the full device against {_named(bricks)}: {_compared(dataset, reduced, bricks)}")
    usable = rows[(rows.kind == "run") & (rows.branch == 0) & rows.status.isin(USABLE)]
    for _, run in usable[usable.varied.isin(["element", "level, element"]) & usable.element.isin(COMPARED)].iterrows():
        plain = settings[settings.varied.isin(["", "level"])]
        if (base := _first(plain, level=run.level, engine=run.engine)) is not None:
            off = " and ".join(error_text(row, "error_stroke", rows) for row in (run, base))
            lines.append(
                f"{run.element} against {_named(base)}: {_compared(dataset, run, base)}. Their "
                f"strokes are off the reference by {off}" + f"; {run.element} is {run.status}" * (run.status != CONVERGED)
            )
    return _with_scatter(lines, rows)


def _damping(dataset: xr.Dataset, rows: pd.DataFrame) -> list[str]:
    settings, lines = settings_of(rows), []
    scatter = scatter_row(rows, "scatter")
    for _, run in settings[settings.change.str.contains("damping")].iterrows():
        if (base := _first(settings, varied="", engine=run.engine)) is None:
            continue
        collected = differences(dataset, run.name, base.name)
        verdict = ""
        if scatter is not None:
            bounds = {name: max(PAPER_HEIGHT, scatter[f"error_{name}"]) for name in ("volumes", "stress")}
            harmless = all(abs(collected[name]) <= bound for name, bound in bounds.items())
            verdict = " is harmless" if harmless else " is not harmless"
        lines.append(
            f"{run.change} 1/s{verdict}: {_compared(dataset, run, base)}, dissipated {percent(run.dissipated_fraction)} instead "
            f"of {percent(base.dissipated_fraction)}"
        )
    return _with_scatter(lines, rows)


def _mesh(rows: pd.DataFrame) -> list[str]:
    """The cheapest mesh whose volumes, or V_v alone, are within the paper's 2 %, or within the scatter where that is larger."""
    settings, scatter = meshes_of(settings_of(rows)), scatter_row(rows, "reference")
    levels = settings[np.isfinite(settings.error_volumes)]
    if levels.empty or scatter is None:
        return [NOT_MEASURED]
    return [
        _cheapest(rows, levels, scatter, "error_volumes", "both volumes"),
        _cheapest(rows, levels, scatter, _COLUMNS["V_v"], "V_v"),
    ]


def _cheapest(rows: pd.DataFrame, levels: pd.DataFrame, scatter: pd.Series, column: str, what: str) -> str:
    """The cheapest of ``levels`` of which an error is within the larger of 2 % and the scatter on the finest mesh."""
    bound = max(PAPER_HEIGHT, scatter[column])
    good = levels[levels[column] <= bound].sort_values("cpu_seconds")
    wanted = f"{what} within {percent(bound)} of the finest mesh"
    if good.empty:
        return f"none of {', '.join(dict.fromkeys(map(_named, levels.itertuples())))} has {wanted}"
    best = good.iloc[0]
    named = f", preset `{best.preset}`," if best.preset else ""
    return (
        f"{_named(best)}{named} for {best.cpu_seconds:.0f} s is the cheapest with {wanted}. Its stress is "
        f"off by {error_text(best, 'error_stress', rows)}"
    )


def _paper(rows: pd.DataFrame) -> list[str]:
    """Largest w and d_c / L as the paper takes them: of the mesh that it names, and of its own element at its own density."""
    settings, lines = settings_of(rows), []
    for _, run in settings[settings.varied.isin(["", "level"]) & (settings.level == PAPER_LEVEL)].iterrows():
        if verdicts := _within_paper(run, rows):
            lines.append(f"`{run.level}` against the finest mesh with {run.engine}: {verdicts}")
    usable = rows[(rows.kind == "run") & (rows.branch == 0) & rows.status.isin(USABLE)]
    paper = usable.varied.isin(["level, element", "level, element, contact"])
    selected = _first(usable[paper], level="paper", element="C3D20")
    if selected is not None and (verdicts := _within_paper(selected, rows)):
        lines.append(
            f"The paper's element at its own density (full integration, `paper`): {verdicts}. Its volumes are off by "
            f"{error_text(selected, 'error_volumes', rows)} and its stroke by {error_text(selected, 'error_stroke', rows)}"
        )
    best = settings[settings.error_volumes <= PAPER_HEIGHT].sort_values("cpu_seconds")
    if lines and len(best):
        lines.append(f"Cheapest setting with volumes within 2 %: `{best.iloc[0].setting}`, {best.iloc[0].cpu_seconds:.0f} s")
    elif lines:
        lines.append("No setting has volumes within 2 %")
    return lines or [NOT_MEASURED]


def _within_paper(run: pd.Series, rows: pd.DataFrame) -> str:
    """Whether a run is as near to the finest mesh as the paper says of its own."""
    asked = (("error_height", PAPER_HEIGHT, "largest w"), ("error_chamfer", PAPER_CHAMFER, "d_c / L"))
    return ", ".join(
        f"{label} {error_text(run, column, rows)} (at most {percent(bound)}, {'met' if run[column] <= bound else '**not met**'})"
        for column, bound, label in asked
        if np.isfinite(run[column])
    )


def _scatter(rows: pd.DataFrame) -> list[str]:
    lines = []
    for _, row in rows[rows.kind == "scatter"].iterrows():
        line = (
            f"{row.members:.0f} runs at `{row.level}` differ on average from the mean of the others by "
            f"{percent(row.error_volumes)} in volumes and {percent(row.error_stress)} in stress"
        )
        mean = _first(rows[rows.kind == "mean"], part=row.part, setting=row.setting)
        if row.part != "reference":
            line += (
                f". Their mean is off the reference by {percent(mean.error_volumes)} and {percent(mean.error_stress)}, "
                "which is discretisation error"
            )
        lines.append(line)
    return lines or [NOT_MEASURED]


def _limit(rows: pd.DataFrame) -> list[str]:
    """Stroke and stress over the meshes that differ from the reference's in size alone, those of shells, and their limits."""
    mean, settings = _first(rows[rows.kind == "mean"], part="reference"), settings_of(rows)
    if mean is None:
        return [NOT_MEASURED]
    own = settings[(settings.part == "accuracy") & (settings.engine == mean.engine) & (settings.grading == mean.grading)]
    bricks, shells = own[own.varied == "level"], own[own.element == SHELLS]
    found = []
    for coarser, finest in ((bricks, mean.to_frame().T), (shells, shells[:0])):
        levels = pd.concat([part for part in (coarser, finest) if len(part)]) if len(coarser) else coarser
        levels = levels.sort_values("degrees_of_freedom")
        if len(coarser) and len(levels) > 1:
            found += _tending(levels)
    return found or [NOT_MEASURED]


def _tending(levels: pd.DataFrame) -> list[str]:
    """Stroke and stress over ever finer meshes of one element, and Richardson's extrapolation of the two finest."""
    lines = []
    for name, unit in (("stroke", "ml"), ("stress", "MPa")):
        size, values = levels.degrees_of_freedom.to_numpy(float), levels[name].to_numpy(float)
        over = ", ".join(f"{number(v)} (`{level}`)" for v, level in zip(values, levels.level, strict=True))
        second, first = (signed_percent(richardson(size, values, order) / values[-1] - 1) for order in (2.0, 1.0))
        lines.append(
            f"{levels.element.iloc[-1]}: {name} {over} {unit}; Richardson's extrapolation adds {second} (second order) to "
            f"{first} (first order)"
        )
    return lines


def _engines(dataset: xr.Dataset, rows: pd.DataFrame) -> list[str]:
    """Both engines on the same bricks, whose layers do not touch."""
    settings, lines = settings_of(rows), []
    referees = settings[(settings.part == "referee") & settings.varied.isin(["", "level"])]
    for _, run in settings[(settings.part == "accuracy") & settings.varied.isin(APART)].iterrows():
        same = {"level": run.level, "element": run.element, "symmetry": run.symmetry}
        if (other := _first(referees[referees.engine != run.engine], **same)) is not None:
            lines.append(f"{run.engine} against {other.engine} on `{run.level}`: {_compared(dataset, run, other)}")
    return _with_scatter(lines, rows)


def _contact(dataset: xr.Dataset, rows: pd.DataFrame) -> list[str]:
    """Runs whose layers pass each other beside those whose layers touch, on the same mesh."""
    settings, lines = settings_of(rows), []
    for varied, alike in APART.items():
        for _, run in settings[settings.varied == varied].iterrows():
            if (base := _first(settings, varied=alike, level=run.level, engine=run.engine)) is not None:
                changes = ", ".join(change for change in run.change.split(", ") if change != run.level)
                lines.append(f"{changes} on `{run.level}`: {_compared(dataset, run, base)}")
    return lines or [NOT_MEASURED]


# --------------------------------------------------------------------------------------------------------------------
# words


def _named(run) -> str:
    """The mesh of a run and what solves it."""
    return f"{run.element} on `{run.level}` with {run.engine}"


def _with_scatter(lines: list[str], rows: pd.DataFrame, part: str = "scatter", mesh: str = "default") -> list[str]:
    scatter = scatter_row(rows, part)
    if not lines:
        return [NOT_MEASURED]
    if scatter is not None:
        lines = [
            *lines,
            f"The scatter of paths alone on the {mesh} mesh is {percent(scatter.error_volumes)} in volumes and "
            f"{percent(scatter.error_stress)} in stress",
        ]
    return lines


def _first(rows: pd.DataFrame, **wanted: str) -> pd.Series | None:
    for column, value in wanted.items():
        rows = rows[rows[column] == value]
    return rows.iloc[0] if len(rows) else None


def error_text(row: pd.Series | dict, column: str, rows: pd.DataFrame | None) -> str:
    """An error as text, marked where it is within the scatter on the finest mesh."""
    value = row[column]
    if not np.isfinite(value):
        return "-"
    scatter = None if rows is None else scatter_row(rows, "reference")
    return percent(value) + (" ~" if scatter is not None and value <= scatter[column] else "")
