"""The part of the accuracy page on the square airbag."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from limo.accuracy.statistics import exponent
from limo.errors import ResultError
from limo.reports.markdown import markdown_table, number, read_rows, signed_percent
from limo.schema.accuracy import Airbag
from limo.store.files import write_whole
from limo.store.statuses import CONVERGED

#: columns that name a run of an airbag
AIRBAG_KEYS = ["airbag", "series", "element", "engine", "planes", "path", "divisions"]


#: the series that others are compared with: the same bricks on the finest meshes
TRUSTED = ("C3D20R", "newton")


#: what is asked of the quadratic elements against published values: relative error of height and smooth draw-in of the edge
ASKED = ("S8", "S8R", "C3D20R")


#: what CalculiX expands shells to
EXPANDED = {"S8": "C3D20", "S8R": "C3D20R"}


#: elements that the paper finds to lock or to fail, and how far (relative) a height may be off at most to speak against it
LOCKING, LOCKED = ("S3", "S4R"), 0.05


#: the draw-in of the edge's middle is no target: it grows with the mesh without a limit, in tension fields, too
WITHIN = {"height": 0.01, "edge_draw_in_smooth": 0.02}


#: states whose potential energies (J) are no further apart are the same
LEVEL = 0.005


# --------------------------------------------------------------------------------------------------------------------
# rows of the square airbags


def keep_airbags(datasets: Sequence[Path], file: Path) -> None:
    """Write the runs of gathered airbags into a CSV file, without their shapes."""
    table = pd.concat([_airbag_rows(path) for path in datasets])
    write_whole(file, lambda aside: table.to_csv(aside, index=False))


def _airbag_rows(file: Path) -> pd.DataFrame:
    try:
        dataset = xr.load_dataset(file)
        rows = dataset.drop_vars("displacement").to_dataframe()
        rows.insert(0, "airbag", dataset.attrs["airbag"])
        return rows[[*AIRBAG_KEYS, *(c for c in rows if c not in AIRBAG_KEYS)]].round(4)
    except (OSError, ValueError, KeyError) as error:
        raise ResultError(f"{file}: not the dataset of an airbag ({error})") from None


def read_airbags(file: Path) -> pd.DataFrame:
    """The rows that ``keep_airbags`` wrote. Raises ``ResultError``."""
    rows = read_rows(file, "airbags", AIRBAG_KEYS, dtype={"path": str, "reason": object})
    return rows.fillna({"reason": ""})


def observed_order(divisions: np.ndarray, values: np.ndarray, limit: float) -> float:
    """p of |value - limit| ~ n^-p by least squares in logarithms; NaN of fewer than three errors."""
    return -exponent(divisions, np.abs(np.asarray(values, float) - limit))[0]


def finest_limit(rows: pd.DataFrame, planes: str) -> float:
    """Height (mm) of the bricks of engine newton on the finest mesh with these planes; of several paths the highest."""
    selected = (rows.element == TRUSTED[0]) & (rows.engine == TRUSTED[1]) & (rows.planes == planes)
    best = rows[selected & (rows.status == CONVERGED)]
    return float(best[best.divisions == best.divisions.max()].height.max()) if len(best) else float("nan")


def published_height(airbag: Airbag) -> float:
    """The largest published height (mm), which is that of the finest mesh; NaN of none."""
    return max((r.value for r in airbag.references if r.quantity == "height"), default=float("nan"))


def published_densities(airbag: Airbag) -> list[int]:
    """Elements along half a side of the meshes that published heights are of."""
    return sorted({r.divisions for r in airbag.references if r.quantity == "height" and r.divisions})


def published_draw_in(airbag: Airbag) -> float:
    """Mean of the published draw-ins (mm) of the middle of an edge; NaN of none."""
    collected = [r.value for r in airbag.references if r.quantity == "edge_draw_in"]
    return float(np.mean(collected)) if collected else float("nan")


# --------------------------------------------------------------------------------------------------------------------
# the section


def airbag_report(rows: pd.DataFrame, airbags: Mapping[str, Airbag], pictures: Mapping[str, Sequence[str]]) -> str:
    """The section *Square airbag*; ``pictures`` (markdown) by airbag."""
    parts = [
        "## Square airbag",
        "The model is a quarter of the upper sheet (`config/airbags`). Raw rows are in `docs/gallery/data/airbag.csv`.",
        "- `n`: elements along half a side.\n"
        "- `w_M`: height of the centre.\n"
        "- `u_B`: how far the middle of an edge moves in.\n"
        "- `u_B smooth`: the same by an even parabola through the inner half of the edge. The middle itself lies in a fold.\n"
        "- `u corner`: how far the corner moves in along x and y.\n"
        "- `via 100, 10 p`: the pressure passes 100 p and 10 p first. This irons out wrinkles that otherwise stay where they "
        "first appeared.",
        "Shells turn on the planes of symmetry, where CalculiX cannot hold them. So do `hinged` bricks. CPU seconds are of one "
        "thread.",
        "A sheet has many wrinkled equilibrium states. On one mesh their heights differ by some percent, so compare the paths of "
        "the same bricks. An error or an order below that scatter is not significant.",
    ]
    for name, group in rows.groupby("airbag", sort=False):
        if name not in airbags:
            raise ResultError(
                f"a table has rows of {name}, which is no airbag of the configuration: `snakemake accuracy` renews it"
            )
        airbag = airbags[name]
        parts.append(f"### `{name}`: {airbag.description}")
        height = published_height(airbag)
        if np.isfinite(height):
            off, sizes = _off_published(group, airbag), " and ".join(map(str, published_densities(airbag)))
            density = f"meshes with as many elements as published ones (n = {sizes}) and " if sizes else ""
            parts += [
                f"Published values (`config/airbags/{name}.yaml`) are w_M = {number(height)} mm and u_B = "
                f"{number(published_draw_in(airbag))} mm. The table compares {density}the finest mesh with them. The published "
                "draw-in is that of the middle of an edge, which grows with the mesh without a limit (`docs/performance.md`). So "
                "u_B itself is no target; the smooth one is compared with it. The diagonal is taut, so the corner cannot move in "
                "that far while the centre rises. `lowest` marks the path with the least potential energy Pi among equal bricks "
                "on equal planes.",
                markdown_table(_against_published(off, airbag)),
                _within_both(off, airbag),
                *_by_the_other_engine(group),
            ]
        planes = sorted(group.planes.unique())
        limits = ", ".join(f"{number(finest_limit(group, p))} mm with {p} planes" for p in planes)
        parts += [
            f"Convergence towards w_M of newton's bricks on their finest mesh ({limits}):",
            markdown_table(_convergence(group)),
            _locking(group),
            *pictures.get(name, ()),
            "Every run:",
            markdown_table(_runs(group, height)),
        ]
    return "\n\n".join(filter(None, parts))


def _off_published(rows: pd.DataFrame, airbag: Airbag) -> pd.DataFrame:
    """The converged runs of the elements that are asked to meet published values; relative errors in columns ``off_*``."""
    published = {"height": published_height(airbag), "edge_draw_in_smooth": published_draw_in(airbag)}
    good = rows[(rows.status == CONVERGED) & rows.element.isin([*ASKED, *EXPANDED.values()])]
    return good.assign(**{f"off_{key}": good[key] / value - 1 for key, value in published.items()})


def _within_both(off: pd.DataFrame, airbag: Airbag) -> str:
    """Which of the asked elements meet the published height and, smoothly, draw-in on which meshes of published density."""
    near = off.divisions.isin(published_densities(airbag))
    for key, most in WITHIN.items():
        near &= off[f"off_{key}"].abs() <= most
    collected = [f"{row.series} at n = {row.divisions}" for row in off[near].itertuples()]
    never = [element for element in ASKED if element not in set(off[near].element)]
    listed = "\n" + "".join(f"\n- {run}" for run in collected) if collected else " none."
    return f"Within both bounds on meshes of published density:{listed}" + (
        f"\n\nNever within both there: {', '.join(never)}." * bool(never)
    )


def _by_the_other_engine(rows: pd.DataFrame) -> list[str]:
    """How far CalculiX's shells are from the bricks it makes of them, written out and solved by newton along the same path."""
    good, sentences = rows[rows.status == CONVERGED], []
    for shell, brick in EXPANDED.items():
        shells = good[good.element == shell]
        bricks = good[(good.element == brick) & (good.engine == TRUSTED[1]) & (good.planes == "hinged")]
        both = shells.merge(bricks, on=["path", "divisions"], suffixes=("", "_brick"))
        if len(both):
            apart = (both.height / both.height_brick - 1).abs()
            finest = bricks.loc[bricks.divisions.idxmax()]
            sentences.append(
                f"CalculiX makes {brick} of {shell}. The same bricks written out and solved by newton end within "
                f"{apart.median():.1%} of its height (median of {len(both)} meshes, at most {apart.max():.1%}). "
                f"At n = {finest.divisions} they end at {number(finest.height)} mm."
            )
    return sentences


def _locking(rows: pd.DataFrame) -> str:
    """Whether the elements that the paper finds to lock or to fail do, by their finest mesh."""
    sentences = []
    for element in LOCKING:
        selected = rows[rows.element == element]
        good = selected[selected.status == CONVERGED].sort_values("divisions")
        if selected.empty:
            continue
        if good.empty:
            sentences.append(f"{element} fails on all of {len(selected)} meshes")
            continue
        off = good.height.iloc[-1] / finest_limit(rows, good.planes.iloc[-1]) - 1
        verdict = "locks or fails" if abs(off) > LOCKED else "does not"
        sentences.append(
            f"{element} {verdict}: on its finest mesh (n = {good.divisions.iloc[-1]}) it is {signed_percent(off)} off"
        )
    return f"The paper finds that S3 and S4R lock or fail. Here {'. '.join(sentences)}." if sentences else ""


def _against_published(off: pd.DataFrame, airbag: Airbag) -> pd.DataFrame:
    """The asked elements: a line for each published density, and one for the finest mesh."""
    lowest = off.groupby(["element", "planes", "divisions"]).potential_energy.transform("min")
    good, table = off.assign(lowest=off.potential_energy <= lowest + LEVEL), []
    for series, group in good.groupby("series", sort=False):
        for _, row in group[group.divisions.isin([*published_densities(airbag), group.divisions.max()])].iterrows():
            verdicts = {}
            for name, key in (("w_M", "height"), ("u_B smooth", "edge_draw_in_smooth")):
                error, most = row[f"off_{key}"], WITHIN[key]
                verdict = "met" if abs(error) <= most else "**not met**"
                verdicts[f"{name} within {most:.0%}"] = f"{signed_percent(error)}, {verdict}"
            energy = f"{row.potential_energy:.2f}{', lowest' * row.lowest}" if np.isfinite(row.potential_energy) else "-"
            table.append({"series": series, "n": row.divisions, **verdicts, "Pi [J]": energy})
    return pd.DataFrame(table)


def _convergence(rows: pd.DataFrame) -> pd.DataFrame:
    """One line a series: its finest mesh against the limit of bricks on equal planes, and the observed order."""
    table = []
    for series, group in rows.groupby("series", sort=False):
        good = group[group.status == CONVERGED].sort_values("divisions")
        limit = finest_limit(rows, group.planes.iloc[0])
        finest = good.iloc[-1] if len(good) else pd.Series({"divisions": "-", "height": np.nan})
        table.append(
            {
                "series": series,
                "planes": group.planes.iloc[0],
                "converged": f"{len(good)} of {len(group)}",
                "finest n": finest.divisions,
                "w_M [mm]": number(finest.height),
                "off the limit": signed_percent(finest.height / limit - 1),
                "order of w_M": number(observed_order(good.divisions, good.height, limit)),
                "CPU of all [s]": round(group.cpu_seconds.sum()),
            }
        )
    return pd.DataFrame(table)


def _runs(rows: pd.DataFrame, height: float) -> pd.DataFrame:
    """One line a run; ``height`` (mm) is what others published."""
    fastest = rows.cpu_seconds[rows.status == CONVERGED].min()
    columns = {
        "series": rows.series,
        "n": rows.divisions,
        "dof": rows.degrees_of_freedom,
        "status": [f"{r.status}: {r.reason}" if r.reason else r.status for r in rows.itertuples()],
        "w_M [mm]": rows.height.map(number),
        "off the published": (rows.height / height - 1).map(signed_percent),
        "u_B [mm]": rows.edge_draw_in.map(number),
        "u_B smooth [mm]": rows.edge_draw_in_smooth.map(number),
        "u corner [mm]": rows.corner_draw_in.map(number),
        "stress at M [MPa]": [number(value, 2) for value in rows.stress],
        "Pi [J]": [number(value, 2) for value in rows.potential_energy],
        "CPU [s]": rows.cpu_seconds.map(number),
        "over the fastest": (rows.cpu_seconds / fastest).map(number),
        "iterations": rows.iterations,
        "memory [MiB]": rows.memory.round().astype(int),
    }
    if not np.isfinite(height):
        del columns["off the published"]
    return pd.DataFrame(columns)
