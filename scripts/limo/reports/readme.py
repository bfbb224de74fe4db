"""The measured numbers of README.md, from the data that are kept in git, each with its mesh level and machine.

Every time of a case comes from ``docs/data/performance.csv`` or ``docs/gallery/data/accuracy.nc``, which name the machine.
"""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from limo.accuracy.statistics import settings_of
from limo.cases.cost import duration, schedule
from limo.config.load import load_config
from limo.datasets.curves import at_end
from limo.measure.states import lowest
from limo.reports.accuracy_airbag import TRUSTED, published_draw_in, published_height, read_airbags
from limo.reports.accuracy_device import error_text
from limo.reports.kept import AS_IN_PAPER, FIRST, STANDARD, Kept, grids, made_with, reference_of, stock_factor
from limo.reports.markdown import markdown_table, number
from limo.reports.performance import slowest
from limo.store.statuses import CONVERGED, USABLE

#: the mesh level on which elements are compared, and the airbag with published values
COMPARED, AIRBAG = "coarse", "classical"
#: P_a (kPa) from which on the scatter of strokes is called that of the end of a ramp
LATE = 40.0
UNKNOWN = "not recorded"


def parts(root: Path) -> dict[str, Callable[[], str]]:
    """What makes the generated parts of README.md, by their names; ``root``: the project's folder."""
    made = {"sweep": sweep, "sets": sets, "accuracy": accuracy, "presets": presets, "times": times, "limits": limits}
    kept = Kept(root)
    return {name: partial(part, kept) for name, part in made.items()}


# --------------------------------------------------------------------------------------------------------------------
# tables


def sweep(kept: Kept) -> str:
    """What the first sweep takes and prints: the results of the gallery, the times of the recorded grid."""
    dataset = lowest(kept.study("pressure_volume"))
    level, engine, _ = made_with(dataset)
    grid = grids(kept).get((level, engine), kept.costs.iloc[:0])
    rows, seconds, memory = [], [], []
    for n in dataset.n_pouches.values:
        case = dataset.sel(n_pouches=n).squeeze()
        cost = grid[(grid.n_pouches == n) & (grid.ventricular_pressure == float(case.ventricular_pressure))]
        cost = cost[(cost.aspect_ratio == float(case.aspect_ratio)) & (cost.stiffness_ratio == float(case.stiffness_ratio))]
        cost = cost[cost.iterations == float(case.iterations)]  # another run has another time
        seconds += [*(cost.cpu_seconds + cost.python_seconds)]
        memory += [*cost.memory_mib]
        rows.append(
            {
                "N_p": n,
                "stroke at 60 kPa": f"{number(float(at_end(case.stroke_volume)), 0)} ml",
                "ratio": number(float(at_end(case.io_ratio)), 2),
                "front touches back from": f"{number(float(case.contact_front_back), 0)} kPa".replace("- kPa", "-"),
                "efficiency at 90 ml": f"{number(100 * float(case.efficiency_90ml), 0)} %",
                "dissipated": f"{number(100 * float(case.dissipated_fraction), 0)} %",
                "iterations": number(float(case.iterations), 0),
                **({"CPU": f"{cost.cpu_seconds.iloc[0]:.0f} s"} if len(cost) else {}),
            }
        )
    prints = "The sweep prints:"
    if len(seconds) == len(rows):
        prints = (
            f"The sweep takes about {duration(schedule(seconds, 2))} on two cores and {max(memory):.0f} MiB per case. "
            f"Without the faster build it takes {number(stock_factor(kept))} times as long. It prints:"
        )
    machine = f" CPU: {text_of(grid.machine)}, two cases side by side." * bool(seconds)
    made = f"Mesh level `{level}`, engine {engine} ({text_of(grid.build)})"
    where = wrapped(f"{made}, P_v = {float(dataset.ventricular_pressure[0]):g} kPa.{machine}")
    return "\n\n".join([wrapped(prints), markdown_table(pd.DataFrame(rows).fillna("-")), where])


def sets(kept: Kept) -> str:
    """The sets of the gallery: mesh level, engine, solves, and their CPU time."""
    rows = []
    for part in (FIRST, STANDARD, AS_IN_PAPER):
        solves = {}
        for dataset in kept.studies(part):
            branches = dataset.branch.broadcast_like(dataset.case_id).values.ravel()
            each = zip(dataset.case_id.values.ravel(), dataset.solver_time.values.ravel(), branches, strict=True)
            solves |= {case_id: (seconds, branch) for case_id, seconds, branch in each if np.isfinite(seconds)}
        seconds = np.array([s for s, _ in solves.values()])
        level, engine, build = made_with(kept.study("pressure_volume", part))
        rows.append(
            {
                "set": f"`{Path('docs/gallery') / part}`",
                "mesh level": f"`{level}`",
                "engine": f"{engine} ({build})",
                "cases": sum(branch == 0 for _, branch in solves.values()),
                "solves": len(solves),
                "CPU of a solve (median, longest)": f"{duration(float(np.median(seconds)))}, {duration(seconds.max())}",
                "CPU of all": duration(seconds.sum()),
                "machine": UNKNOWN,
            }
        )
    return markdown_table(pd.DataFrame(rows))


def accuracy(kept: Kept) -> str:
    """How far results scatter, and how far they are from published ones."""
    branches, mesh = (kept.paths[kept.paths.kind == kind] for kind in ("branch", "mesh"))
    first = kept.paths[(kept.paths.kind == "same") & (kept.paths.run == "run 1")].set_index("pressure").stroke_volume
    spread = branches[branches.pressure > 0].groupby("pressure").stroke_volume.agg(lambda s: s.std() / s.mean())
    end = first.index.max()
    others = mesh[np.isclose(mesh.pressure, end)].set_index("run").stroke_volume / first[end] - 1
    moved, sized = others[others.index.str.startswith("jittered")], others[others.index.str.endswith("displacements")]
    airbags = read_airbags(kept.root / "docs/gallery/data/airbag.csv")
    airbag = load_config(str(kept.root / "config/config.yaml")).airbags[AIRBAG]
    bricks = airbags[(airbags.airbag == AIRBAG) & (airbags.element == TRUSTED[0]) & (airbags.engine == TRUSTED[1])]
    bricks = bricks[(bricks.planes == "symmetric") & (bricks.status == CONVERGED)]
    finest = bricks[bricks.divisions == bricks.divisions.max()].sort_values("potential_energy").iloc[0]
    height, edge = finest.height / published_height(airbag) - 1, finest.edge_draw_in_smooth / published_draw_in(airbag) - 1
    case = "N_p = 8, P_v = 3.8 kPa"
    rows = [
        (
            f"How far do strokes scatter if the flat start is perturbed by 5 % of the thickness? ({case})",
            f"one standard deviation of {branches.run.nunique()} solutions: {100 * spread[10.0]:.1f} % at 10 kPa, at most "
            f"{100 * spread[spread.index >= LATE].max():.1f} % from {LATE:g} kPa on",
            "`coarsest`", "newton", "`docs/reliability.md`",
        ),
        (
            f"How much does another mesh with about as many elements change the stroke at {end:g} kPa? ({case})",
            f"moved nodes {between(moved)}, other element sizes {between(sized)}",
            "`coarsest`", "newton", "`docs/reliability.md`",
        ),
        (
            "Do the solutions agree with published ones? (square airbag)",
            f"height {100 * height:+.1f} %, smoothed draw-in of the wrinkled edge {100 * edge:+.1f} %",
            f"{finest.divisions} elements along half a side", f"{finest.engine}, {finest.element}", "`docs/accuracy.md`",
        ),
    ]  # fmt: skip
    return markdown_table(pd.DataFrame(rows, columns=["question", "measured", "mesh level", "engine", "table"]))


def presets(kept: Kept) -> str:
    """What a preset costs and how large its errors are, on both devices that errors are measured of."""
    devices = [
        (group, settings_of(group).drop_duplicates("preset").set_index("preset")) for _, group in kept.errors.groupby("device")
    ]
    rows = []
    for name in load_config(str(kept.root / "config/config.yaml")).config.presets:
        both = [(group, solved.loc[name]) for group, solved in devices if name in solved.index]
        if not both:
            continue
        _, first = both[0]
        rows.append(
            {
                "preset": f"`{name}`",
                "mesh level": f"`{first.level}`",
                "engine": first.engine,
                "machine": ", ".join(dict.fromkeys(row.machine for _, row in both)),
                "CPU of a solution": f"{listed_numbers(row.cpu_seconds for _, row in both)} s",
                "memory": f"{listed_numbers(row.memory_mib for _, row in both)} MiB",
                "error of volumes": ", ".join(error_text(row, "error_volumes", group) for group, row in both),
                "of stroke": ", ".join(error_text(row, "error_stroke", group) for group, row in both),
                "of stress": ", ".join(error_text(row, "error_stress", group) for group, row in both),
            }
        )
    note = wrapped(
        "N_p = 4 at P_v = 13.8 kPa, then N_p = 8 at 3.8 kPa. Errors are against the finest mesh; ~ marks an error within its "
        "scatter. These runs store 21 states each, which makes them slower (`docs/methods.md`); do not compare with the next "
        "table. The preset `preview` is not the mesh level of the same name: it also chooses the engine. `make sweep` takes that "
        "level with calculix."
    )
    return "\n\n".join([markdown_table(pd.DataFrame(rows)), note])


def listed_numbers(values: Iterable[float]) -> str:
    """Whole numbers, one after the other."""
    return ", ".join(f"{value:.0f}" for value in values)


def times(kept: Kept) -> str:
    """How long cases and grids take."""
    rows = []
    for (level, _), group in grids(kept).items():
        one = group[(group.n_pouches == 10) & (group.ventricular_pressure == 3.8)].cpu_seconds
        wall = schedule(group.cpu_seconds + group.python_seconds, 2)
        rows.append(
            {
                "mesh level": f"`{level}`",
                "engine": f"{text_of(group.engine)} ({text_of(group.build)})",
                "machine": text_of(group.machine),
                "CPU of a case": f"{group.cpu_seconds.min():.0f} to {group.cpu_seconds.max():.0f} s",
                "of N_p = 10, P_v = 3.8 kPa": f"{one.iloc[0]:.0f} s" if len(one) else "-",
                f"{len(group)} cases on two cores": duration(wall),
                "memory": f"{group.memory_mib.max():.0f} MiB",
            }
        )
    trust = wrapped(
        f"Compare times within one row only. Other work on the machine made the same run up to {number(slowest(kept.costs))} "
        "times as long (`docs/performance.md`)."
    )
    return "\n\n".join([markdown_table(pd.DataFrame(rows)), trust])


# --------------------------------------------------------------------------------------------------------------------
# limits


def limits(kept: Kept) -> str:
    """The limits that have numbers, as a list."""
    made = (geometry, contact, opening, preview, full_integration, wrinkles, ratio)
    return "\n".join(wrapped(f"- {limit(kept)}") for limit in made)


def geometry(kept: Kept) -> str:
    """V_v at rest, which the calibration leaves."""
    rest = {}
    for part in (STANDARD, FIRST):
        volume = kept.loads(part).ventricle_volume.sel(n_pouches=8, ventricular_pressure=3.8)
        rest[kept.level(part)] = float(volume.isel(actuation_pressure=0).squeeze())
    (level, fine), (other, coarse) = rest.items()
    return (
        "**Outlines and seams of N_p = 6 and 10 are not public.** The outline is derived from a published mesh, the seams follow "
        "a rule (`docs/geometry.md`). Nothing is calibrated. The ventricle of N_p = 8 holds "
        f"{fine:.0f} ml at rest (mesh level {level}; {coarse:.0f} ml at {other}). The real device holds 300 ml."
    )


def contact(kept: Kept) -> str:
    """Where layers touch, and in which devices they are pressed into each other in places."""
    passed = kept.loads(STANDARD)[["contact_front_back", "contact_endo_epi"]].to_array().notnull()
    devices = passed.n_pouches.values[passed.any([d for d in passed.dims if d != "n_pouches"]).values]
    collected = ""
    if len(devices):
        names = listed([str(n) for n in devices])
        collected = f" In creases of N_p = {names} they still pass each other by more than a thickness in places."
    return (
        "**Layers touch with engine newton alone, and where `contact` asks for it.** At `standard` front and back, and both "
        f"layers of a pouch, press on each other.{collected} Elsewhere strokes are too large once front and back touch. "
        "Neighbouring pouches and folds of the outer edge pass through each other everywhere; `contact_outer` flags that. "
        "Figures mark states in which front and back pass each other by more than a thickness with a star, and pale where they "
        "have no contact, from the first stored frame on."
    )


def opening(kept: Kept) -> str:
    """How far collapsed pouches open before P_a reaches P_v."""
    loads = kept.loads(STANDARD)
    rest = loads.ventricle_volume.isel(actuation_pressure=0, drop=True)
    share = 100 * loads.actuation_volume / rest
    over = loads.actuation_pressure / loads.ventricular_pressure
    still = over.where(share <= 1).max("actuation_pressure")
    at = share.interp(actuation_pressure=loads.ventricular_pressure)
    return (
        f"**Pouches open before P_a reaches P_v.** V_a is below 1 % of V_v up to P_a = {float(still.min()):.1f} to "
        f"{float(still.max()):.1f} P_v, and {float(at.min()):.1f} to {float(at.max()):.1f} % of it at P_v: more at a higher "
        "P_v, for the outer layer stretches (`docs/methods.md`)."
    )


def preview(kept: Kept) -> str:
    """Efficiencies on the coarse mesh, and peak stress and cycles of the preset against the mean of the reference."""
    eta = [
        f"{100 * float(d.efficiency_90ml.min()):.0f} to {100 * float(d.efficiency_90ml.max()):.0f} %"
        for d in (kept.loads(FIRST), kept.loads(STANDARD))
    ]
    stress, cycles = [], []
    for _, rows in kept.errors.groupby("device"):
        settings, mean = settings_of(rows), reference_of(rows)
        selected = settings[settings.preset == "preview"].iloc[0]
        stress.append(100 * (1 - selected.stress / mean.stress))
        cycles.append(10 ** (selected.cycles_decades - mean.cycles_decades))
    return (
        f"**Use {kept.level(FIRST)} for orientation only.** Its efficiencies at 90 ml are {eta[0]} instead of {eta[1]} at "
        f"{kept.level(STANDARD)} (`docs/paper_check.md`). Its peak stress is {min(stress):.0f} to {max(stress):.0f} % too low, "
        f"and its cycle counts are {min(cycles):.0f} to {max(cycles):.0f} times too high (`docs/accuracy.md`). Compare results "
        "on one mesh level only."
    )


def full_integration(kept: Kept) -> str:
    """Strokes of both elements on one mesh level, with contact, of the devices of the measured errors."""
    rows = kept.errors[(kept.errors.part == "accuracy") & (kept.errors.level == COMPARED) & kept.errors.status.isin(USABLE)]
    rows = rows[~rows.varied.str.contains("contact")]
    strokes = rows.drop_duplicates(["device", "element"]).pivot(index="device", columns="element", values="stroke")
    less = 100 * (1 - strokes["C3D20"] / strokes["C3D20R"])
    devices = listed([f"{share:.0f} % (N_p = {name.removeprefix('np')})" for name, share in less.items()])
    return (
        "**Full integration (C3D20, CalculiX's S8) is too stiff.** On the mesh level "
        f"`{COMPARED}` the stroke is {devices} less than with C3D20R (`docs/accuracy.md`)."
    )


def wrinkles(kept: Kept) -> str:
    """How far apart the solutions of one case end, over the studies of the fine set."""
    apart = 0.0
    for dataset in kept.studies(STANDARD):
        stroke = dataset.stroke_volume
        if "branch" in stroke.dims:
            low, high = stroke.min("branch"), stroke.max("branch")
            apart = max(apart, float(at_end((high - low) / high).max()))
    return (
        "**Wrinkled states are not unique.** `branches` are solutions of one case from perturbed starts. Differences smaller "
        f"than their scatter are not significant. At {kept.level(STANDARD)} the strokes of one device end within "
        f"{number(100 * apart)} % (`docs/gallery/standard`)."
    )


def ratio(kept: Kept) -> str:
    """The ratio at P_a,max over the number of pouches."""
    low = kept.loads(STANDARD).sel(ventricular_pressure=3.8)
    values = at_end(low.io_ratio).squeeze()
    devices = [str(n) for n in values.n_pouches.values]
    return (
        f"**The ratio grows with N_p here, up to N_p = {devices[int(np.argmax(values.values))]}.** It is "
        f"{listed([number(float(v), 2) for v in values.values])} at P_a = {float(low.actuation_pressure_reached.min()):.0f} kPa "
        f"for N_p = {listed(devices)} (mesh level {kept.level(STANDARD)}, P_v = 3.8 kPa). The paper finds a higher ratio with "
        "fewer pouches."
    )


# --------------------------------------------------------------------------------------------------------------------
# words


def wrapped(text: str) -> str:
    """A paragraph, or an item of a list, in lines as long as those of README.md."""
    indent = "  " if text.startswith("- ") else ""
    whole = text.replace(" = ", "\0=\0")  # a symbol stays with its value
    lines = textwrap.fill(whole, 128, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)
    return lines.replace("\0", " ")


def between(shares: pd.Series) -> str:
    """The range of some changes."""
    return f"{100 * shares.min():+.0f} to {100 * shares.max():+.0f} %"


def listed(words: list[str]) -> str:
    """``a, b and c``."""
    return " and ".join([", ".join(words[:-1]), words[-1]]) if len(words) > 1 else words[0]


def text_of(values: pd.Series) -> str:
    """The different texts of a column, or that there are none."""
    return ", ".join(sorted({str(v) for v in values})) or UNKNOWN
