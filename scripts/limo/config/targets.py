"""Which studies a command asks for, as far as its words tell: Snakemake reads a Snakefile before it knows its targets."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from limo.config.load import ALL, RULES
from limo.store.results import Results


def asked_studies(
    words: Iterable[str], config_file: str | Path, results: Results, groups: Mapping[str, Iterable[str]]
) -> list[str]:
    """The studies that the words of a command name, for ``load_config``; such as ``-n afterload``.

    A study is named by itself, by a file in its folder of results, or by a rule of ``groups``. Where no word is a target these
    are the studies that the configuration runs; where all targets are something else there are none.
    """
    explorations = {path.stem for path in Path(config_file).parent.glob("explorations/*.yaml")}
    known = {path.stem for path in Path(config_file).parent.glob("studies/*.y*ml")} | {ALL}
    names: list[str] = []
    others = False
    for word in words:
        parents = Path(word).parents
        if word in known or word in groups:
            names += groups.get(word, [word])
        elif results.studies in parents:
            names.append(Path(word).relative_to(results.studies).parts[0])
        else:
            others = others or word in RULES or word in explorations or results.root in parents
    return names or ([] if others else [ALL])
