"""Which studies are asked for by the targets of a workflow."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from pathlib import Path

from limo.config.load import ALL
from limo.store.results import Results


def asked_studies(targets: Collection[str], results: Results, groups: Mapping[str, Iterable[str]]) -> list[str]:
    """The studies that targets name, for ``load_config``: by their names, by files in their folders, or by rules of ``groups``.

    Without targets these are those that the configuration runs. Names of other rules and files are among them: nobody knows
    studies yet.
    """
    names: list[str] = []
    for target in targets or [ALL]:
        path = Path(target)
        if results.studies in path.parents:
            names.append(path.relative_to(results.studies).parts[0])
        else:
            names += groups.get(target, [target])
    return names
