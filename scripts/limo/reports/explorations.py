"""The generated parts of ``docs/explore.md``: what the kept explorations say of designs, of the search, and of the paper."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from limo.explore.found import held_out_of, known_from
from limo.explore.front import dominated_volume
from limo.explore.learn import Learned, quality_of
from limo.reports.exploration import CLAIMED, claimed, compared
from limo.reports.markdown import markdown_table
from limo.schema.exploration import AS_IT_IS
from limo.store.files import read_netcdf

#: the explorations that are kept: one that searched, and one of its budget that did not
SEARCHED, BY_CHANCE = "best_heart", "best_heart_by_chance"


def parts(gallery: Path) -> dict[str, Callable[[], str]]:
    """What makes the text of each part. Raises ``ResultError`` for a dataset that cannot be read."""

    def kept(name: str) -> xr.Dataset:
        return read_netcdf(gallery / name / "exploration.nc", "exploration, which limo gallery --exploration keeps")

    return {
        "compared": lambda: compared(known_from(kept(SEARCHED)).exploration, kept(SEARCHED)),
        "chance": lambda: beside_chance(kept(SEARCHED), kept(BY_CHANCE)),
        "claims": lambda: f"{CLAIMED}\n\n{markdown_table(claimed(kept(BY_CHANCE)))}",
    }


def beside_chance(searched: xr.Dataset, by_chance: xr.Dataset) -> str:
    """How much of the goals the front of a search dominates beside that of samples alone, and how it predicts those samples."""
    groups = {
        "search": [known_from(searched), held_out_of(searched)],
        "samples alone": [known_from(by_chance), held_out_of(by_chance)],
    }
    goals = {name: np.vstack([each.goals[each.feasible] for each in group]) for name, group in groups.items()}
    first = groups["search"][0]  # the device as it is comes first, where there is one
    worst = np.vstack(list(goals.values())).max(axis=0)
    references = {"the worst design in each goal": worst}
    if (searched.why == AS_IT_IS).any() and first.feasible[0]:
        references[AS_IT_IS] = first.goals[0]
    rows = []
    for text, reference in references.items():
        volumes = {name: dominated_volume(values, reference) for name, values in goals.items()}
        ratio = volumes["search"] / volumes["samples alone"] if volumes["samples alone"] else np.inf
        better = {name: int((values < reference).all(axis=1).sum()) for name, values in goals.items()}
        rows.append(
            {"better than": text}
            | {f"designs, {name}": count for name, count in better.items()}
            | {"hypervolume, search over samples": f"{ratio:.2f}" if np.isfinite(ratio) else "no sample is better"}
        )
    counts = {name: sum(len(each.told) for each in group) for name, group in groups.items()}
    sentence = f"{counts['search']} designs of the search beside {counts['samples alone']} samples, the same preset:"
    unseen = _unseen(groups["search"][0], groups["samples alone"][0])
    errors = quality_of(groups["search"][0], unseen)
    told = pd.DataFrame(
        {
            "quantity": name,
            "error over the range [%]": f"{100 * tested.held_out.error:.1f}",
            "within their 95 % interval [%]": f"{100 * tested.held_out.coverage:.0f}",
        }
        for name, tested in errors.items()
    )
    return (
        f"{sentence}\n\n{markdown_table(pd.DataFrame(rows))}\n\n"
        f"The surrogates of the search predict the {len(unseen.told)} of these samples that it never learned from:\n\n"
        f"{markdown_table(told)}"
    )


def _unseen(learned: Learned, others: Learned) -> Learned:
    """The designs of others that it does not know."""
    away = np.abs(others.places[:, None] - learned.places[None]).max(axis=2).min(axis=1)
    return others.those(away > 1e-9)
