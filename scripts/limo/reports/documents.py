"""Everything in the documents that is generated and needs no solver: written anew, or compared with what is there."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from pathlib import Path

import pandas as pd

from limo.config.json_schemas import json_schemas
from limo.config.load import load_config
from limo.errors import LimoError
from limo.reports import (
    accuracy,
    beats,
    before,
    blocks,
    cluster,
    configuration,
    entry,
    fabric,
    gallery,
    geometry,
    overhead,
    paper_check,
    peer,
    performance,
    readme,
    reliability,
    rooms,
)
from limo.store.files import write_whole

#: where the kept data lie in the project's folder
DATA, GALLERY = Path("docs/data"), Path("docs/gallery")
#: the datasets that the paper is checked with, and those beside them
CHECKED, BESIDE = GALLERY / "standard/data", {"as_in_paper": GALLERY / "as_in_paper/data", "calculix": GALLERY / "data"}


def _parts(document: str, parts: Callable[[Path], dict[str, Callable[[], str]]]) -> Callable[[Path], str]:
    """A document that is written by hand between its generated parts."""
    return lambda root: blocks.renewed(_read(root / document), parts(root))


def _accuracy(root: Path) -> str:
    data = root / GALLERY / "data"
    return accuracy.report(data / "airbag.csv", data / "accuracy.nc", str(root / "config/config.yaml"))


def _performance(root: Path) -> str:
    rows = performance.read_measurements(root / DATA / "performance.csv")
    measured = overhead.read_overhead(root / DATA / "overhead.csv"), entry.read_entry(root / DATA / "entry.csv")
    beside = cluster.read_cluster(root / DATA / "cluster.csv"), peer.read_peer(root / DATA / "peer.csv")
    return performance.report(rows, *measured, *beside, before.read_before(root / DATA / "before.csv"))


def _gallery(config: str, part: str) -> Callable[[Path], str]:
    return lambda root: gallery.page_of(load_config(str(root / "config" / config)), root / GALLERY / part)


def _exploration(name: str) -> Callable[[Path], str]:
    def made(root: Path) -> str:
        from limo.reports.exploration import kept_page  # with all that surrogates take

        return kept_page(root / GALLERY / name / "exploration.nc")

    return made


def _explorations(root: Path) -> dict[str, Callable[[], str]]:
    from limo.reports.explorations import parts  # with all that surrogates take

    return parts(root / GALLERY)


def _paper_table(root: Path) -> str:
    return _compared(root).to_csv(index=False)


def _paper_page(root: Path) -> str:
    return paper_check.page_of(_compared(root), CHECKED, Path("docs/paper_check.csv"), BESIDE, geometry.INFERRED)


def _compared(root: Path) -> pd.DataFrame:
    beside = {name: root / folder for name, folder in BESIDE.items()}
    return paper_check.compared(root / CHECKED, beside, root / geometry.INFERRED)


def _schema(name: str) -> Callable[[Path], str]:
    return lambda _: json.dumps(json_schemas()[name], indent=2) + "\n"


#: what makes the text of each document from the project's folder
DOCUMENTS: dict[str, Callable[[Path], str]] = {
    "README.md": _parts("README.md", readme.parts),
    "docs/accuracy.md": _accuracy,
    "docs/beat.md": _parts("docs/beat.md", beats.parts),
    "docs/configuration.md": _parts("docs/configuration.md", lambda _: configuration.parts()),
    "docs/explore.md": _parts("docs/explore.md", _explorations),
    "docs/fabric.md": _parts("docs/fabric.md", fabric.parts),
    "docs/geometry.md": _parts("docs/geometry.md", geometry.parts),
    "docs/gallery/README.md": _gallery("config.yaml", ""),
    "docs/gallery/standard/README.md": _gallery("standard.yaml", "standard"),
    "docs/gallery/as_in_paper/README.md": _gallery("as_in_paper.yaml", "as_in_paper"),
    "docs/gallery/best_heart/README.md": _exploration("best_heart"),
    "docs/gallery/best_heart_by_chance/README.md": _exploration("best_heart_by_chance"),
    "docs/paper_check.csv": _paper_table,
    "docs/paper_check.md": _paper_page,
    "docs/performance.md": _performance,
    "docs/reliability.md": lambda root: reliability.renewed(_read(root / "docs/reliability.md"), root / DATA),
    "docs/where_is_what.md": _parts("docs/where_is_what.md", rooms.parts),
    **{f"workflow/schemas/{name}": _schema(name) for name in json_schemas()},
}


def stale(root: Path, names: Iterable[str] = ()) -> dict[str, str]:
    """The text that documents (none named: all) should have, of those that have another one.

    Raises ``LimoError`` for a name that is no generated document, and for data that cannot be read.
    """
    collected = {}
    for name in list(names) or DOCUMENTS:
        if name not in DOCUMENTS:
            raise LimoError(f"{name}: no generated document; there are {', '.join(DOCUMENTS)}; for example limo docs README.md")
        text = DOCUMENTS[name](root)
        if not (root / name).exists() or _read(root / name) != text:
            collected[name] = text
    return collected


def write_documents(root: Path, names: Iterable[str] = ()) -> list[str]:
    """Write the documents that are not up to date, and return their names. Raises as ``stale``."""
    collected = stale(root, names)
    for name, text in collected.items():
        write_whole(root / name, lambda path, text=text: path.write_text(text, encoding="utf-8"))
    return list(collected)


def _read(file: Path) -> str:
    try:
        return file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise LimoError(f"{file}: no document ({error}); run limo docs in the project's folder") from None
