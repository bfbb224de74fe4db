"""The generated parts of ``docs/geometry.md``: the derived outline, counts of its mesh, what remains free, unknown seams."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pandas as pd

from limo.reports.markdown import markdown_table, read_rows

#: kept by ``limo derive-outline --table``
TABLE = Path("docs/data/outline.csv")
#: kept by ``limo infer --table``
INFERRED = Path("docs/data/inference.csv")
_COLUMNS = ("kind", "name", "value", "low", "high", "published")


def parts(root: Path) -> dict[str, Callable[[], str]]:
    """What makes the text of each part. Raises ``ResultError`` for a table that cannot be read."""

    def rows() -> pd.DataFrame:
        return read_rows(root / TABLE, "a derived outline", _COLUMNS).set_index("name")

    def inferred() -> pd.DataFrame:
        return read_rows(
            root / INFERRED, "an inference", ("kind", "name", "inferred", "chance", "low", "high"), keep_default_na=False
        )

    return {"outline": lambda: _outline(rows()), "counts": lambda: _counts(rows()), "seams": lambda: _seams(inferred())}


def _outline(rows: pd.DataFrame) -> str:
    """Coordinates with the range of those that fit equally."""
    found = rows[rows.kind == "coordinate"]
    table = pd.DataFrame(
        {
            "coordinate over L": [f"`{name}`" for name in found.index],
            "`limo`": [f"{value:.3f}" for value in found.value],
            "5 to 95 % of those that fit": [f"{low:.3f} to {high:.3f}" for low, high in zip(found.low, found.high, strict=True)],
        }
    )
    run = rows[rows.kind == "run"].value.astype(int)
    sentence = f"{run.fit} of {run.meshed} patterns from {run.starts} random starts fit."
    return f"{sentence}\n\n{markdown_table(table)}"


def _counts(rows: pd.DataFrame) -> str:
    """Elements of the published mesh and of that of the result."""
    found = rows[rows.kind.isin(["curve", "patch"])]
    table = pd.DataFrame(
        {
            "curve or patch": [name.replace("_", " ") for name in found.index],
            "published": found.published.astype(int).to_list(),
            "`limo`": found.value.astype(int).to_list(),
            "those that fit": [f"{int(low)} to {int(high)}" for low, high in zip(found.low, found.high, strict=True)],
        }
    )
    nodes = rows.loc["nodes"]
    sentence = f"The whole mesh would have {int(nodes.value)} nodes; the published one has {int(nodes.published)}."
    return f"{markdown_table(table)}\n\n{sentence}"


def _seams(rows: pd.DataFrame) -> str:
    """What is believed of seams and numbers of pouches, and how likely each statement is before and after."""
    positions = rows[rows.kind == "position"]
    places = pd.DataFrame(
        {
            "seam": positions.name,
            "rule": positions.prior,
            "believed": positions.inferred + " ± " + positions.deviation,
            "90 % between": positions.low + " and " + positions.high,
        }
    )
    pouches = [
        f"{row['name']}: {row['inferred']}, believed at {100 * float(row['chance']):.0f} %"
        for _, row in rows[rows.kind == "pouches"].iterrows()
    ]
    about = rows[(rows.kind == "statement") & rows.inference.isin(["used", "held out"])]
    statements = pd.DataFrame(
        {
            "statement": about.name,
            "inference": about.inference,
            "with the rule": about.prior,
            "most likely": about.inferred,
            "reproduced by the prior [%]": [_percent(value) for value in about.chance_before],
            "by the belief [%]": [_percent(value) for value in about.chance],
        }
    )
    numbers = rows[rows.kind == "number"]
    depends = pd.DataFrame(
        {"number": numbers.name, "with the rule": numbers.prior, "over all": numbers.low + " to " + numbers.high}
    )
    tables = [
        markdown_table(places),
        f"{'; '.join(pouches)}." if pouches else "",
        markdown_table(statements),
        "How much numbers depend on the seams, over all positions that were solved:" if len(depends) else "",
        markdown_table(depends) if len(depends) else "",
    ]
    return "\n\n".join(table for table in tables if table)


def _percent(value: str) -> str:
    return f"{100 * float(value):.0f}" if value else ""
