"""The gallery: datasets of the studies, small enough to keep, figures drawn from them alone, and a page of both.

``data/<study>.nc`` and ``data/<study>_shapes.nc`` are what a study's figures are drawn from: no solver, and no other file;
``data/material.nc`` is the tensile test with its fit. A set in a folder of its own (another preset of the same studies) keeps
the curves alone: surfaces on a fine mesh are too large, so figures of them are drawn from the results, once.
"""

from __future__ import annotations

import hashlib
import re
import shutil
import tempfile
from collections.abc import Iterable
from importlib import import_module
from pathlib import Path

import numpy as np
import xarray as xr

from limo.config import Loaded, load_config
from limo.cost import duration
from limo.errors import LimoError
from limo.figures import SHAPES, style, tensile_test
from limo.figures.measured import read_measured
from limo.files import write_netcdf, write_whole

#: bytes that the data of all studies, those of sets included, may take together
LARGEST_DATA = 5_000_000
PAGE = "README.md"
#: the fit of the fabric's modulus, which is no study: where it is made, kept and drawn
MATERIAL, MATERIAL_KEPT, MATERIAL_FIGURE = Path("material/tensile_test.nc"), "material.nc", "material_tensile_test.png"
#: how curves are kept
SQUEEZED = {"dtype": "float32", "zlib": True, "shuffle": True, "complevel": 9}
_EXAMPLE = "limo gallery afterload"


def keep(loaded: Loaded, studies: Iterable[str], results: Path, gallery: Path, part: str = "") -> list[Path]:
    """Take the datasets of studies (none: all that are gathered, and the tensile test) from ``results``; returns what is kept.

    ``part``: the set that they are kept as, without their shapes.

    Raises ``LimoError`` for a study that is named and not gathered, and when the gallery's data would exceed
    ``LARGEST_DATA``; nothing is copied then.
    """
    named, data = list(studies), gallery / part / "data"
    copies: dict[Path, Path] = {}
    for name in named or loaded.studies:
        folder = results / "studies" / name
        if name in named and not (folder / "study.nc").exists():
            raise LimoError(f"{folder / 'study.nc'}: not gathered yet; snakemake --cores 2 {name} does that")
        for file, kept in (("study.nc", f"{name}.nc"), ("shapes.nc", f"{name}_shapes.nc"))[: 1 if part else 2]:
            if (folder / file).exists():
                copies[data / kept] = folder / file
    if not named and not part and (results / MATERIAL).exists():
        copies[data / MATERIAL_KEPT] = results / MATERIAL
    ours = {MATERIAL_KEPT, *(f"{name}{shapes}.nc" for name in loaded.studies for shapes in ("", "_shapes"))}
    stay = [f for f in gallery.glob("**/data/*.nc") if f.name in ours and f not in copies]
    with tempfile.TemporaryDirectory() as folder:
        packed = {target: _packed(source, Path(folder) / target.name) for target, source in copies.items()}
        total = sum(f.stat().st_size for f in (*stay, *packed.values()))
        if total > LARGEST_DATA:
            raise LimoError(f"{gallery}: {total / 1e6:.1f} MB of data together; {LARGEST_DATA / 1e6:g} MB is the most")
        for target, source in packed.items():
            write_whole(target, lambda path, source=source: shutil.copyfile(source, path))
    return list(copies)


def _packed(source: Path, target: Path) -> Path:
    """The file to keep: the curves of a ``study.nc`` go packed into ``target``, anything else is packed already."""
    if source.name != "study.nc":
        return source
    dataset = _read(source)
    curves = [n for n, v in dataset.data_vars.items() if v.size > 1000 and v.dtype.kind == "f"]
    write_netcdf(dataset, target, dict.fromkeys(curves, SQUEEZED), checked=False)
    return target


def draw(loaded: Loaded, studies: Iterable[str], gallery: Path, results: Path | None = None) -> list[Path]:
    """Draw the figures of studies (none: all that the gallery holds) from its data, and its page; returns the files.

    Shapes that it does not hold are taken from ``results``; where there are none, their figures stay as they are.

    Raises ``LimoError`` for a study whose data are not there.
    """
    named, files = list(studies), []

    def add(name: str, drawn) -> None:
        files.append(gallery / name)
        write_whole(files[-1], lambda path: style.save(drawn, path))
        style.close(drawn)

    for name in named or _kept(loaded, gallery):
        dataset, shapes = _read(gallery / "data" / f"{name}.nc"), gallery / "data" / f"{name}_shapes.nc"
        if results is not None and not shapes.exists():
            shapes = results / "studies" / name / "shapes.nc"
        study = loaded.studies[name]
        measured = read_measured(Path(study.measured)) if study.measured else None
        for figure in study.figures:
            if figure in SHAPES and not shapes.exists():
                continue
            surfaces = [_read(shapes)] if figure in SHAPES else []
            add(f"{name}_{figure}.png", import_module(f"limo.figures.{figure}").draw(dataset, measured, *surfaces))
    if not named and (gallery / "data" / MATERIAL_KEPT).exists():
        add(MATERIAL_FIGURE, tensile_test.draw(_read(gallery / "data" / MATERIAL_KEPT)))
    page = gallery / PAGE
    write_whole(page, lambda path: path.write_text(_page(loaded, gallery), encoding="utf-8"))
    return [*files, page]


def make_gallery(
    config_file: str, studies: list[str], results: Path, gallery: Path, part: str = "", *, redraw: bool = False
) -> list[Path]:
    """Keep and draw studies; with ``redraw`` draw what the gallery, or its set ``part``, already holds.

    Returns the files that were written. Raises ``LimoError`` for what ``keep`` and ``draw`` refuse, and for a set whose name
    is no plain word.
    """
    if part and (not part.isidentifier() or part == "data"):
        raise LimoError(f"--set {part}: a word of letters, digits and _ is wanted, and not data; for example --set standard")
    loaded = load_config(config_file)
    loaded.require(studies, config_file, _EXAMPLE)
    if redraw:
        return draw(loaded, studies, gallery / part)
    return [*keep(loaded, studies, results, gallery, part), *draw(loaded, studies, gallery / part, results)]


def _kept(loaded: Loaded, gallery: Path) -> list[str]:
    return [name for name in loaded.studies if (gallery / "data" / f"{name}.nc").exists()]


def _read(file: Path) -> xr.Dataset:
    try:
        return xr.load_dataset(file)
    except (OSError, ValueError) as error:
        raise LimoError(f"{file}: not a dataset of the gallery ({error}); {_EXAMPLE} makes it") from None


def _page(loaded: Loaded, gallery: Path) -> str:
    names = _kept(loaded, gallery)
    lines = [
        "| study | cases | converged | engine and build | CPU of the solver | longest case | configuration |",
        "|---" * 7 + "|",
    ]
    sections = []
    for name in names:
        dataset = _read(gallery / "data" / f"{name}.nc")
        lines.append(_summary(name, dataset))
        sections.append(f"## {name}\n\n{dataset.attrs['title'].partition(': ')[2] or name}.")
        sections += [
            f"![{figure} of {name}]({name}_{figure}.png)"
            for figure in loaded.studies[name].figures
            if (gallery / f"{name}_{figure}.png").exists()
        ]
        if gaps := style.gaps(dataset):
            sections.append("\n".join(f"- {gap}" for gap in gaps))
    if (gallery / MATERIAL_FIGURE).exists():
        sections.append(f"## material\n\nThe fabric's modulus from a tensile test.\n\n![tensile test]({MATERIAL_FIGURE})")
    sets = sorted(page.parent.name for page in gallery.glob(f"*/{PAGE}"))
    further = "Sets beside this one: " + ", ".join(f"[{name}]({name}/{PAGE})" for name in sets) + "."
    surfaces = [name for name in names if set(loaded.studies[name].figures) & set(SHAPES)]
    bare = any(not (gallery / "data" / f"{name}_shapes.nc").exists() for name in surfaces)
    unkept = "Surfaces are not among these data: figures of them were drawn when the set was made."
    return "\n\n".join(
        [
            "# Gallery",
            "Written by `limo gallery`; do not edit. Datasets are in `data/`; `limo gallery --redraw` draws every figure from "
            "them, without a solver. A case that several studies share was solved once and counts in each. The last column is a "
            "hash of the resolved configuration that each dataset holds as its attribute `config`.",
            *([further] * bool(sets)),
            *([unkept] * bare),
            "\n".join(lines),
            *sections,
        ]
    ) + "\n"  # fmt: skip


def _summary(name: str, dataset: xr.Dataset) -> str:
    """A study's row: what solved its cases, and how long that took."""
    seconds = dataset.solver_time.values
    builds = sorted({re.sub(r" [0-9a-f]{16}\b", "", b) for b in map(str, dataset.solver_build.values.ravel()) if b})
    engines = dataset.attrs["source"].rpartition(" engine ")[2]
    configuration = hashlib.sha256(dataset.attrs["config"].encode()).hexdigest()[:10]
    cells = (
        name,
        str(seconds.size),
        str(int((dataset.case_status == "converged").sum())),
        f"{engines} ({', '.join(builds)})",
        duration(float(np.nansum(seconds))),
        duration(float(np.nanmax(seconds))) if np.isfinite(seconds).any() else "-",
        f"`{configuration}`",
    )
    return "| " + " | ".join(cells) + " |"
