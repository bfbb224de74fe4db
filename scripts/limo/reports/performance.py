"""What runs cost: raw measurements of solved cases as a table, and the report that is generated from it.

Rows come from the status that every solved case keeps (CPU time by the operating system's accounting). A batch is a name for
runs that were measured together; ratios are taken within one case only.
"""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
import xarray as xr

from limo.cases.case import Case
from limo.cases.cost import schedule
from limo.cases.grid import study_cases
from limo.cases.plan import Plan, make_plan
from limo.config.builds import open_project
from limo.config.project import Project
from limo.engines.find import find_engine
from limo.errors import LimoError
from limo.measure.ramp import ramp_of
from limo.reports.before import SETTINGS, WITHIN, accurate, before_section, no_higher, share, times_less, within_scatter
from limo.reports.cluster import cluster_table
from limo.reports.entry import entry_table
from limo.reports.markdown import markdown_table, number, read_rows, shown, signed_percent
from limo.reports.overhead import NOTHING, PLANNING
from limo.reports.peer import peer_section
from limo.schema.section import ENGINES
from limo.store.files import read_json, write_whole
from limo.store.machine import processor
from limo.store.results import CaseFiles, Results
from limo.store.statuses import CONVERGED

#: columns that name a run; a new measurement of the same run takes the place of the old one
KEYS = ["batch", "study", "n_pouches", "ventricular_pressure", "aspect_ratio", "stiffness_ratio", "variant", "branch"]


def measurements(loaded: Project, plan: Plan, batch: str, studies: list[str], results: Path = Path("results")) -> pd.DataFrame:
    """One row a case of the studies that is on disk; cases that are not are left out."""
    rows = []
    for name in studies:
        study = loaded.studies[name]
        for point, case in study_cases(loaded, name).items():
            files, variant = Results(results).case(plan.served[name][point]), point.variant
            if files.status.exists():
                what = study.variants[variant].description if variant else study.description
                rows.append({"batch": batch, "study": name, "variant": variant or "-", "change": what} | _row(case, files))
    return pd.DataFrame(rows)


def _row(case: Case, files: CaseFiles) -> dict:
    status = read_json(files.status)
    build = status["solver"]
    with xr.open_dataset(files.volumes) as history:
        history = history.load()
    ramp = ramp_of(history)
    volume = ramp.ventricle_volume.values
    return {
        "machine": processor(),
        "n_pouches": case.n_pouches,
        "ventricular_pressure": case.ventricular_pressure,
        "aspect_ratio": case.aspect_ratio,
        "stiffness_ratio": case.stiffness_ratio,
        "branch": case.branch,
        "engine": case.engine,
        "build": build.get("build", build.get("version", "")),
        "level": case.mesh.level,
        "symmetry": case.mesh.symmetry,
        "elements": status["elements"],
        "pressure_max": case.actuation_pressure_max,
        "status": status["status"],
        "pressure_reached": round(status["actuation_pressure_reached"], 4),
        "path_share": round(_share(case, history), 6),
        **{f"iterations_{stage}": count for stage, count in status["iterations_by_stage"].items()},
        "rejected": status["rejected_attempts"],
        "increments": status["increments"],
        "factorisations": status.get("factorisations"),
        "factor_seconds": status.get("factor_seconds"),
        "setup_seconds": status.get("setup_seconds"),
        "cpu_seconds": status.get("fit_cpu_seconds", 0.0) + status["solver_cpu_seconds"],
        "fit_seconds": status.get("fit_cpu_seconds", 0.0),
        "attempts": len(status.get("attempts", [])) or 1,
        "python_seconds": status["python_cpu_seconds"],
        "wall_seconds": status["solver_wall_seconds"],
        "memory_mib": status["solver_memory_mib"],
        "dissipated_fraction": status["dissipated_fraction"],
        "rest_volume": round(float(volume[0]), 3) if len(volume) else None,
        "stroke": round(float(volume[0] - volume[-1]), 3) if len(volume) else None,
    }


def _share(case: Case, history: xr.Dataset) -> float:
    """Share of the run that was done."""
    if not history.sizes["increment"]:
        return 0.0
    reached = history.solver_time.values, history.actuation_pressure.values
    return find_engine(case.engine).share_done(case.numerics, case.actuation_pressure_max, *reached)


def record(rows: pd.DataFrame, file: Path) -> None:
    """Put rows into a CSV file, in place of earlier ones of the same runs."""
    if file.exists():
        before = read_measurements(file)
        rows = pd.concat([before, rows]).drop_duplicates(KEYS, keep="last")
    write_whole(file, lambda path: rows.to_csv(path, index=False))


def record_batch(config_file: str, batch: str, studies: list[str], results: Path, file: Path) -> str:
    """Put the costs of the solved cases of studies (none: those that the configuration runs) into the table; says what it did."""
    loaded = open_project(config_file, studies, "limo performance record levers levers --config config/levers/config.yaml")
    rows = measurements(loaded, make_plan(loaded, results), batch, studies or loaded.config.studies, results)
    if rows.empty:
        raise LimoError(f"{results}: none of the cases is solved; run the studies first")
    record(rows, file)
    return f"{len(rows)} cases into {file}"


def read_measurements(file: Path) -> pd.DataFrame:
    """The rows of a CSV file that ``record`` wrote. Raises ``ResultError``."""
    return read_rows(file, "measurements", KEYS)


# --------------------------------------------------------------------------------------------------------------------
# the report

#: a change pays when it takes less than this share of the CPU time, moves the stroke at the end by less than this, and
#: dissipates at most this many times as much
PAYS, HARMLESS, DISSIPATES = 0.95, 0.03, 1.2
#: variants of the batch `levers` that others are compared with
BASES = ("base", "newton", "flat")
#: variants of the batches `levers` and `stock` that stand for an engine, a build and a deck
BUILDS = ("base", "paper", "newton")
#: the deck of a row that is not of the paper's, by engine
DECKS = {"calculix": "fast", "newton": "-"}
CASE = ["n_pouches", "ventricular_pressure", "aspect_ratio", "stiffness_ratio"]


def report(
    rows: pd.DataFrame,
    overhead: pd.DataFrame,
    entry: pd.DataFrame,
    cluster: pd.DataFrame,
    peer: pd.DataFrame,
    before: pd.DataFrame,
) -> str:
    """docs/performance.md of raw measurements, and of those of the modules that arguments are named after; gaps say so."""
    rows = with_iterations(rows)
    machines = ", ".join(sorted(rows.machine.dropna().unique()))
    parts = [
        "# What it costs",
        "Generated by `limo performance report` from `docs/data/performance.csv`; do not edit. CPU seconds are of one thread, by "
        f"the operating system's accounting, with two cases side by side on: {machines}. `docs/solver.md` describes the tuned "
        "build of CalculiX, `docs/methods.md` both engines.",
        "## Targets",
        markdown_table(_targets(rows, overhead, before, entry)),
        "## Whole grids",
        "A grid has 19 cases: `afterload`, `valve_support` and `compliance` as `config/grids` has them. On two cores the longest "
        "cases start first.",
        markdown_table(_grids(rows)),
        "## The engines against each other",
        "Both engines solve the same cases on the same meshes, level `preview`. Strokes are in ml at P_a,max, volumes at rest in "
        "ml, CPU in s.",
        markdown_table(_engines(rows)),
        "## One change at a time",
        "Two cases at P_v = 3.8 kPa (`config/levers`): a small one by both engines, and one of the size of `standard` for the "
        "levers of engine newton. Each change is compared with the first line of its case and engine. It pays if it takes less "
        f"than {PAYS:.0%} of the CPU time. It must also move the stroke by less than {HARMLESS:.0%} and dissipate at most "
        f"{DISSIPATES:g} times as much. CPU time includes that on coarser meshes, at whose states at rest a case begins.",
        markdown_table(_levers(rows)),
        "## Builds, and the deck of the paper",
        "All rows are the same case on `preview` (`config/levers`, `config/stock`). The deck `paper` was stopped by a time "
        "limit. Its CPU time is extrapolated in proportion to the share of the solver's clock that it reached. This is a lower "
        "bound, because the costly snaps of the ramp lie beyond.",
        markdown_table(_builds(rows)),
        "## An earlier build beside today's",
        *before_section(before),
        "## A peer beside the engine newton",
        *peer_section(peer),
        "## To enter the project",
        "Written by `limo performance beside CHECKOUT`: medians of CPU time in this checkout and in an older one, measured in "
        "turns. `--solve` adds what a solve imports, and `--tests` the wall time of the tests, once each.",
        entry_table(entry),
        "Imports take longer than a small case of engine newton. Kernels need Numba, which takes longest with its first kernel; "
        "results need xarray, which brings pandas. So a process beside Snakemake imports once and forks for every script of a "
        "case (`scripts/limo/warm.py`); its own imports, once a sweep, are those above.",
        "## Sweeps on a cluster",
        "Written by `limo performance cluster`: a study of very coarse cases, whose solve is replaced by a second of waiting. "
        "Rules, scripts and Slurm are real; its only node is this machine. Cases are of volumes alone. Time and memory are "
        "those of all processes of a job, looked at every 0.2 s. Memory is without the script, which the rule's request covers.",
        cluster_table(cluster),
        "## How far seconds are to be trusted",
        "CPU seconds depend on what else runs on the machine, so compare them within a batch only. These runs were measured in "
        "several batches, with the same iterations and results. Where the wall time exceeds the CPU time, other work shared the "
        "cores.",
        markdown_table(_same_runs(rows)),
    ]
    return "\n\n".join(parts) + "\n"


def with_iterations(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows with ``iterations`` of all stages together, and with what older ones do not say: one attempt, on its own mesh."""
    known = rows.reindex(columns=rows.columns.union(["fit_seconds", "attempts"], sort=False))
    iterations = rows[[c for c in rows if c.startswith("iterations_")]].sum(axis=1)
    return known.assign(iterations=iterations).fillna({"fit_seconds": 0.0, "attempts": 1})


def repeated(rows: pd.DataFrame) -> list[pd.DataFrame]:
    """Rows of one run that was measured in several batches, one table a run; rows from ``with_iterations``.

    Runs are the same if case, engine, build and mesh are, and so are iterations and stroke. A solve that several batches share
    was measured once.
    """
    keys = [*CASE, "engine", "build", "level", "symmetry", "iterations", "stroke"]
    groups = rows[rows.status == CONVERGED].drop_duplicates([*keys, "cpu_seconds"]).groupby(keys, sort=False)
    return [group for _, group in groups if group.batch.nunique() > 1]


def slowest(rows: pd.DataFrame) -> float:
    """Largest ratio of the CPU times of one run in several batches; rows from ``with_iterations``, NaN without such runs."""
    return max((group.cpu_seconds.max() / group.cpu_seconds.min() for group in repeated(rows)), default=float("nan"))


def _same_runs(rows: pd.DataFrame) -> pd.DataFrame:
    """A line a batch of every run that was measured in several."""
    return pd.DataFrame(
        {
            "N_p": row.n_pouches,
            "P_v": row.ventricular_pressure,
            "engine": row.engine,
            "build": row.build,
            "level": row.level,
            "iterations": int(row.iterations),
            "batch": row.batch,
            "machine": row.machine,
            "CPU [s]": round(row.cpu_seconds),
            "wall [s]": round(row.wall_seconds),
        }
        for group in repeated(rows)
        for row in group.itertuples()
    )


def _grids(rows: pd.DataFrame) -> pd.DataFrame:
    table = []
    for batch, group in rows[rows.batch.str.startswith("grid")].groupby("batch", sort=False):
        cases = group.drop_duplicates(CASE)
        wall = schedule(cases.cpu_seconds + cases.python_seconds, 2)
        table.append(
            {
                "batch": batch,
                "engine": _one(cases.engine),
                "build": _one(cases.build),
                "level": _one(cases.level),
                "machine": _one(cases.machine),
                "elements": f"{cases.elements.min()}-{cases.elements.max()}",
                "cases": len(cases),
                "converged": int((cases.status == CONVERGED).sum()),
                "iterations": int(cases.iterations.sum()),
                "CPU [min]": round(cases.cpu_seconds.sum() / 60, 1),
                "longest case [s]": round(cases.cpu_seconds.max()),
                "two cores [min]": round(wall / 60, 1),
                "cores idle": shown(1 - (cases.cpu_seconds + cases.python_seconds).sum() / (2 * wall), ".0%"),
                "memory [MiB]": round(cases.memory_mib.max()),
            }
        )
    return pd.DataFrame(table)


def _engines(rows: pd.DataFrame) -> pd.DataFrame:
    grids = {
        b: group.drop_duplicates(CASE).set_index(CASE)
        for b, group in rows[rows.batch.str.startswith("grid_preview")].groupby("batch")
    }
    by_engine = {_one(group.engine): group for group in grids.values()}
    if by_engine.keys() != {*ENGINES}:
        return pd.DataFrame()
    both = by_engine["calculix"].join(by_engine["newton"], lsuffix="_c", rsuffix="_n", how="inner").reset_index()
    return pd.DataFrame(
        {
            "N_p": both.n_pouches,
            "P_v": both.ventricular_pressure,
            "AR": both.aspect_ratio,
            "E_hat": both.stiffness_ratio,
            "stroke CalculiX": both.stroke_c.round(1),
            "newton": both.stroke_n.round(1),
            "differs": [f"{v:+.1%}" for v in both.stroke_n / both.stroke_c - 1],
            "at rest CalculiX": both.rest_volume_c.round(1),
            "newton ": both.rest_volume_n.round(1),
            "iterations CalculiX": both.iterations_c.astype(int),
            "newton  ": both.iterations_n.astype(int),
            "CPU CalculiX": both.cpu_seconds_c.round(),
            "newton   ": both.cpu_seconds_n.round(),
        }
    )


def _levers(rows: pd.DataFrame) -> pd.DataFrame:
    """A line a change, those of one case and engine together, the one of ``BASES`` first; none without it."""
    table = []
    for (_, engine), group in rows[rows.batch == "levers"].groupby(["study", "engine"], sort=False):
        is_base = group.variant.isin(BASES)
        if not is_base.any():
            continue
        first = group[is_base].iloc[0]
        for row in pd.concat([group[is_base], group[~is_base]]).itertuples():
            share, moved = row.cpu_seconds / first.cpu_seconds, row.stroke / first.stroke - 1
            harmless = abs(moved) < HARMLESS and row.dissipated_fraction <= DISSIPATES * first.dissipated_fraction
            pays = "-" if row.variant == first.variant else "yes" if share < PAYS and harmless else "no"
            table.append(
                {
                    "engine": engine,
                    "N_p": row.n_pouches,
                    "level": first.level,
                    "change": row.change,
                    "status": row.status,
                    "fit": int(row.iterations_fit),
                    "hold": int(row.iterations_hold),
                    "ramp": int(row.iterations_ramp),
                    "CPU [s]": round(row.cpu_seconds),
                    "on coarser meshes": f"{row.fit_seconds:.0f}",
                    "share": f"{share:.2f}",
                    "dissipated": shown(row.dissipated_fraction, ".1%"),
                    "V_v at rest [ml]": number(row.rest_volume),
                    "stroke [ml]": number(row.stroke),
                    "moved": signed_percent(moved),
                    "pays": pays,
                }
            )
    return pd.DataFrame(table)


def _builds(rows: pd.DataFrame) -> pd.DataFrame:
    table, group = [], rows[rows.batch.isin(["levers", "stock"]) & rows.variant.isin(BUILDS)]
    for _, row in group.iterrows():
        table.append(
            {
                "engine": row.engine,
                "build": row.build,
                "deck": "paper" if row.variant == "paper" else DECKS[row.engine],
                "status": row.status,
                "share of the run": f"{row.path_share:.1%}",
                "iterations": int(row.iterations),
                "CPU [s]": round(row.cpu_seconds),
                "s an iteration": round(row.cpu_seconds / max(row.iterations, 1), 3),
                "CPU of the whole run [s]": round(row.cpu_seconds / row.path_share) if row.path_share else None,
            }
        )
    return pd.DataFrame(table)


def _targets(rows: pd.DataFrame, overhead: pd.DataFrame, before: pd.DataFrame, entry: pd.DataFrame) -> pd.DataFrame:
    grids = _grids(rows).set_index("batch") if rows.batch.str.startswith("grid").any() else pd.DataFrame()
    table = []

    def add(name: str, value: float | None, limit: float, unit: str, most: bool = True) -> None:
        value = None if pd.isna(value) else value
        met = "not measured" if value is None else "yes" if (value <= limit if most else value >= limit) else "no"
        bound = f"{'at most' if most else 'at least'} {limit:g} {unit}"
        measured = "-" if value is None else f"{value:,.0f} {unit}" if value >= 1000 else f"{value:.3g} {unit}"
        table.append({"target": name, "bound": bound, "measured": measured, "met": met})

    for batch, limit in (("grid_preview_calculix", 45), ("grid_preview_newton", 10), ("grid_paper_density_newton", 120)):
        complete = batch in grids.index and grids.loc[batch, "cases"] == 19
        add(f"`{batch}`, 19 cases on two cores", grids.loc[batch, "two cores [min]"] if complete else None, limit, "min")
    newton = dict([*rows.groupby("engine")]).get("newton", rows[:0])
    for name, group, limit in (
        ("preview case, newton", newton[newton.batch == "grid_preview_newton"], 1),
        ("quarter of the paper's density, newton, alone", newton[newton.study == "longest"], 12),
        ("half of the paper's density, newton, alone", newton[newton.study == "half"], 30),
    ):
        add(f"{name}: longest case", group.cpu_seconds.max() / 60 if len(group) else None, limit, "min CPU")
    # what is known of factors is of the case itself, not of the states it begins at, and of the attempt that counts
    bare = newton.dropna(subset=["factor_seconds"])
    bare = bare[bare.attempts == 1]
    for batch in ("grid_preview_newton", "grid_paper_density_newton"):
        group = bare[bare.batch == batch]
        iterating = (group.cpu_seconds - group.fit_seconds - group.setup_seconds.fillna(0.0)).sum()
        value = iterating / group.factor_seconds.sum() if len(group) else None
        add(f"`{batch}`: iterations over their factorise and solve", value, 1.25, "times")
    add("memory, newton", newton.memory_mib.max() / 1024 if len(newton) else None, 2, "GiB")
    whole = _builds(rows)
    if len(whole):
        paper = whole[(whole.deck == "paper")]["CPU of the whole run [s]"]
        for engine, limit in (("calculix", 10), ("newton", 100)):
            ours = rows[(rows.batch == "levers") & (rows.variant == {"calculix": "base"}.get(engine, engine))].cpu_seconds
            ratio = paper.max() / ours.min() if len(paper) and len(ours) else None
            add(f"less CPU than the deck of the paper on the stock build: {engine}", ratio, limit, "times", most=False)
    name = f"less CPU than an earlier build's `standard`, median of its devices: {SETTINGS['bricks'].words}"
    add(name, times_less(before, "bricks").median(), 2.5, "times", most=False)
    what = f"the cheapest setting with V_v within {WITHIN:.0%} of its finest mesh"
    name = f"less CPU than an earlier build's `standard`, least of its devices: {what}"
    add(name, accurate(before).min(skipna=False), 5, "times", most=False)
    words = SETTINGS["bricks_paper"].words
    name = f"CPU of all devices over the earlier build's, which is wall time on full cores: {words}"
    add(name, share(before, "bricks_paper"), 0.4, "times")
    words = SETTINGS["bricks"].words
    for what, holds in (
        ("V_v within the scatter of the earlier build's branches", within_scatter),
        ("energy not higher", no_higher),
    ):
        found = 100 * holds(before, "bricks").mean()
        add(f"devices with {what}: {words}", None if pd.isna(found) else found, 100, "%", most=False)
    ratio = before[before.setting == "bricks"].iteration_ratio.median()
    add(f"iterations over their factorise and solve, median of its devices: {words}", ratio, 1.25, "times")
    slower = 1 / times_less(before, "preview").median()
    add("CPU over the earlier build's, median of its devices: preset `preview`", slower, 1, "times")
    touching = times_less(before, "shells") / times_less(before, "standard")
    name = "CPU over that of the same shells that do not touch and are fitted straight, most of its devices: preset `standard`"
    add(name, touching.max(), 1.5, "times")
    more = 1 / times_less(before, "bricks", "memory_mib")
    add(f"memory over that of the earlier build's `standard`: {SETTINGS['bricks'].words}", more.max(), 1, "times")
    for what, name, limit in ((NOTHING, "nothing to do in {} solved cases", 5), (PLANNING, "dry run of a study of {} cases", 15)):
        group = overhead[overhead.what == what]
        cases = f"{group.cases.iloc[0]:,}" if len(group) else "any"
        add(name.format(cases), group.wall_seconds.iloc[0] if len(group) else None, limit, "s")
    warm = entry[entry.what == "solve_warm"].seconds
    add("what a solve of a sweep takes before it begins, newton", warm.iloc[0] if len(warm) else None, 0.4, "s CPU")
    return pd.DataFrame(table)


def _one(values: pd.Series) -> str:
    return ", ".join(sorted({str(v) for v in values}))


def benchmark_table(results: Path) -> str:
    """Solver against python time, memory and iterations of every solved case, meshing, and the time of a dry run.

    CPU seconds of the processes from the operating system's accounting; python includes the start of the interpreter.
    """
    rows = []
    for file in sorted(results.glob("cases/*/status.json")):
        status = read_json(file)
        solver, python = status["solver_cpu_seconds"], status["python_cpu_seconds"]
        rows.append(
            {
                "case": status["case"],
                "status": status["status"],
                "dof": status["degrees_of_freedom"],
                **{f"it. {stage}": count for stage, count in status["iterations_by_stage"].items()},
                "s/it.": round(solver / max(status["iterations"], 1), 3),
                "solver [s]": round(solver, 1),
                "python [s]": round(python, 1),
                "python share": f"{python / max(python + solver, 1e-9):.1%}",
                "memory [MiB]": round(status["solver_memory_mib"]),
            }
        )
    if not rows:
        raise LimoError(f"{results}: no solved cases; `make sweep` makes some")
    table = pd.DataFrame(rows)
    total = table["solver [s]"].sum()
    meshes = [_job_seconds(f) for f in sorted((results / "benchmarks" / "mesh_device").glob("*.tsv"))]
    start = time.perf_counter()
    dry = subprocess.run([sys.executable, "-m", "snakemake", "-n", "--quiet"], capture_output=True, check=False)
    dry_text = f"{time.perf_counter() - start:.1f} s" if dry.returncode == 0 else "failed"
    return "\n".join(
        [
            table.to_string(index=False),
            f"solver CPU of all cases: {total:.0f} s; two side by side: at least {total / 120:.1f} min",
            f"meshing: {', '.join(f'{m:.1f}' for m in meshes) or '-'} s wall each",
            f"snakemake -n: {dry_text} wall",
        ]
    )


def _job_seconds(file: Path) -> float:
    """Wall time in s that Snakemake measured for a job, NaN when there is no such file."""
    try:
        return float(pd.read_csv(file, sep="\t")["s"].iloc[-1])
    except (OSError, ValueError, KeyError):
        return float("nan")
