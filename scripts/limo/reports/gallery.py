"""The gallery: datasets of the studies, small enough to keep, figures drawn from them alone, and a page of both.

``data/<study>.nc`` and ``data/<study>_shapes.nc`` are what a study's figures are drawn from: no solver, and no other file;
``data/material.nc`` is the tensile test with its fit. A set in a folder of its own (another preset of the same studies) keeps
the curves alone: surfaces on a fine mesh are too large, so figures of them are drawn from the results, once. It grows case by
case, so that days of solving may be spread over days, and over machines.
"""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import tempfile
from collections.abc import Iterable
from importlib import import_module
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from limo.bench.compare import study_curves
from limo.cases.cost import duration
from limo.cases.plan import Plan, make_plan
from limo.config.builds import with_found_builds
from limo.config.load import load_config
from limo.config.project import Project
from limo.datasets.curves import absent, at_end, completed
from limo.datasets.shapes import gather_shapes
from limo.datasets.study import gather_study
from limo.errors import LimoError
from limo.figures import style, tensile_test
from limo.measure.states import lowest
from limo.reports.markdown import markdown_table
from limo.schema.device import Pattern
from limo.schema.figures import SHAPES
from limo.store.files import write_netcdf, write_whole
from limo.store.results import Results
from limo.store.statuses import CONVERGED, USABLE

#: bytes that the data of all studies, those of sets included, may take together
LARGEST_DATA = 9_000_000
PAGE = "README.md"
#: the fit of the fabric's modulus, which is no study: where it is made, kept and drawn
MATERIAL, MATERIAL_KEPT, MATERIAL_FIGURE = Path("material/tensile_test.nc"), "material.nc", "material_tensile_test.png"
#: how curves are kept
SQUEEZED = {"dtype": "float32", "zlib": True, "shuffle": True, "complevel": 9}
_EXAMPLE = "limo gallery afterload"


def keep(loaded: Project, studies: Iterable[str], results: Path, gallery: Path, part: str = "") -> list[Path]:
    """Take the datasets of studies (none: all that are gathered, and the tensile test) from ``results``; returns what is kept.

    ``part``: the set that they are kept as, without their shapes, from the cases that are solved (no studies: those of the
    configuration's that have one). Cases that the set holds already and that are not in ``results`` stay.

    Raises ``LimoError`` for a study that is named and not gathered (in a set: of which nothing is solved), for a set that was
    kept with another configuration, and when the gallery's data would exceed ``LARGEST_DATA``; nothing is copied then.
    """
    named, data = list(studies), gallery / part / "data"
    with tempfile.TemporaryDirectory() as folder:
        aside = Path(folder)
        packed = _packed_set(loaded, named, results, data, aside) if part else _packed_all(loaded, named, results, data, aside)
        ours = {MATERIAL_KEPT, *(f"{name}{shapes}.nc" for name in loaded.studies for shapes in ("", "_shapes"))}
        stay = [f for f in gallery.glob("**/data/*.nc") if f.name in ours and f not in packed]
        total = sum(f.stat().st_size for f in (*stay, *packed.values()))
        if total > LARGEST_DATA:
            raise LimoError(f"{gallery}: {total / 1e6:.1f} MB of data together; {LARGEST_DATA / 1e6:g} MB is the most")
        for target, source in packed.items():
            write_whole(target, lambda path, source=source: shutil.copyfile(source, path))
    return list(packed)


def _packed_all(loaded: Project, named: list[str], results: Path, data: Path, aside: Path) -> dict[Path, Path]:
    """What the gallery itself is to hold of gathered studies, by where it is to stand; what is not packed yet is in ``aside``."""
    packed: dict[Path, Path] = {}
    for name in named or loaded.studies:
        files = Results(results).study(name)
        if name in named and not files.dataset.exists():
            raise LimoError(f"{files.dataset}: not gathered yet; snakemake --cores 2 {name} does that")
        if files.dataset.exists():
            packed[data / f"{name}.nc"] = _pack(_read(files.dataset), aside / f"{name}.nc")
        if files.shapes.exists():
            packed[data / f"{name}_shapes.nc"] = files.shapes
    if not named and (results / MATERIAL).exists():
        packed[data / MATERIAL_KEPT] = results / MATERIAL
    return packed


def _packed_set(loaded: Project, named: list[str], results: Path, data: Path, aside: Path) -> dict[Path, Path]:
    """The same of a set: the cases that are solved, and of the others those that it holds."""
    packed: dict[Path, Path] = {}
    plan = make_plan(loaded, results)
    for name in named or loaded.config.studies:
        if not any(Results(results).case(case_id).status.exists() for case_id in plan.sources(name)):
            if name in named:
                raise LimoError(f"{results}: no case of {name} is solved; snakemake --cores 2 {name} does that")
            continue
        kept = data / f"{name}.nc"
        packed[kept] = _pack(_grown(loaded, name, plan, results, kept), aside / kept.name)
    return packed


def _grown(loaded: Project, name: str, plan: Plan, results: Path, kept: Path) -> xr.Dataset:
    """A study's dataset of the cases that are solved, and of those that are ``kept``. Raises ``LimoError``."""
    dataset = gather_study(loaded, name, Results(results).cases, plan.sources(name))
    if not kept.exists():
        return dataset
    try:
        return completed(dataset, _read(kept))
    except ValueError as error:
        raise LimoError(f"{kept}: {error}; remove the file to begin it anew") from None


def _pack(dataset: xr.Dataset, target: Path) -> Path:
    """Write a study's dataset with its curves packed."""
    curves = [n for n, v in dataset.data_vars.items() if v.size > 1000 and v.dtype.kind == "f"]
    write_netcdf(dataset, target, dict.fromkeys(curves, SQUEEZED), checked=False)
    return target


def draw(loaded: Project, studies: Iterable[str], gallery: Path, results: Path | None = None) -> list[Path]:
    """Draw the figures of studies (none: all that the gallery holds) from its data, and its page; returns the files.

    Shapes that it does not hold are those of the cases in ``results``; a picture that is there stays as it is where these are
    fewer than it shows.

    Raises ``LimoError`` for a study whose data are not there.
    """
    named, files = list(studies), []

    def add(name: str, drawn) -> None:
        files.append(gallery / name)
        write_whole(files[-1], lambda path: style.save(drawn, path))
        style.close(drawn)

    for name in named or _kept(loaded, gallery):
        dataset, study = _read(gallery / "data" / f"{name}.nc"), loaded.studies[name]
        shapes = _shapes(loaded, name, gallery, results) if set(study.figures) & set(SHAPES) else None
        curves = study_curves(loaded, name)
        measured = None if curves is None else curves.table
        for figure in study.figures:
            file = f"{name}_{figure}.png"
            surfaces = [shapes] if figure in SHAPES else []
            if surfaces and (shapes is None or ((gallery / file).exists() and _bare(dataset, shapes))):
                continue
            add(file, import_module(f"limo.figures.{figure}").draw(dataset, measured, *surfaces))
    if not named and (gallery / "data" / MATERIAL_KEPT).exists():
        add(MATERIAL_FIGURE, tensile_test.draw(_read(gallery / "data" / MATERIAL_KEPT)))
    page = gallery / PAGE
    write_whole(page, lambda path: path.write_text(page_of(loaded, gallery), encoding="utf-8"))
    return [*files, page]


def _shapes(loaded: Project, name: str, gallery: Path, results: Path | None) -> xr.Dataset | None:
    """The shapes of a study, from the gallery or else from ``results``; None where neither has any."""
    kept = gallery / "data" / f"{name}_shapes.nc"
    if kept.exists():
        return _read(kept)
    if results is None:
        return None
    folder = Results(results)
    shapes = gather_shapes(loaded, name, folder.cases, folder.meshes, make_plan(loaded, results).serving(name))
    return shapes if (shapes.mesh_number >= 0).any() else None


def _bare(dataset: xr.Dataset, shapes: xr.Dataset) -> bool:
    """Whether a case of a study's dataset is usable, but has no shapes."""
    return bool((lowest(dataset).case_status.isin(USABLE) & (shapes.mesh_number < 0)).any())


def make_gallery(
    config_file: str, studies: list[str], results: Path, gallery: Path, part: str = "", *, redraw: bool = False
) -> list[Path]:
    """Keep and draw studies; with ``redraw`` draw what the gallery, or its set ``part``, already holds.

    Returns the files that were written. Raises ``LimoError`` for what ``keep`` and ``draw`` refuse, and for a set whose name
    is no plain word.
    """
    loaded = _loaded(config_file, studies, part)
    if redraw:
        return draw(loaded, studies, gallery / part)
    if part:
        loaded, _ = with_found_builds(loaded, config_file)  # they are in the names of cases
    return [*keep(loaded, studies, results, gallery, part), *draw(loaded, studies, gallery / part, results)]


def lacking_of_set(config_file: str, studies: list[str], results: Path, gallery: Path, part: str) -> list[str]:
    """Files of the cases that neither ``results`` nor a set of the gallery holds, for snakemake to make.

    ``studies`` (none: those that the configuration runs). Raises ``LimoError`` as ``make_gallery``, and without a set.
    """
    if not part:
        raise LimoError(f"--lacking: of which set? for example limo gallery --set standard --lacking --config {config_file}")
    loaded = _loaded(config_file, studies, part)
    loaded, _ = with_found_builds(loaded, config_file)
    plan, wanted = make_plan(loaded, results), {}
    for name in studies or loaded.config.studies:
        dataset = _grown(loaded, name, plan, results, gallery / part / "data" / f"{name}.nc")
        for case_id in dataset.case_id.values[absent(dataset).values].ravel():
            files = Results(results).case(case_id)
            wanted[str(files.measures if case_id in plan.wanted else files.status)] = None
    return list(wanted)


def _loaded(config_file: str, studies: list[str], part: str) -> Project:
    """The configuration, which knows the studies that are named, for a set whose name is a plain word."""
    if part and (not part.isidentifier() or part == "data"):
        raise LimoError(f"--set {part}: a word of letters, digits and _ is wanted, and not data; for example --set standard")
    loaded = load_config(config_file, strict=True)  # the page is about all studies
    loaded.require(studies, config_file, _EXAMPLE)
    return loaded


def _kept(loaded: Project, gallery: Path) -> list[str]:
    return [name for name in loaded.studies if (gallery / "data" / f"{name}.nc").exists()]


def _read(file: Path) -> xr.Dataset:
    try:
        return xr.load_dataset(file)
    except (OSError, ValueError) as error:
        raise LimoError(f"{file}: not a dataset of the gallery ({error}); {_EXAMPLE} makes it") from None


def page_of(loaded: Project, gallery: Path) -> str:
    """The page of a gallery or of a set of it, from its data."""
    names = _kept(loaded, gallery)
    rows, sections, distinct = [], [], {}
    for name in names:
        dataset = _read(gallery / "data" / f"{name}.nc")
        rows.append(_summary(name, dataset))
        solved = zip(dataset.case_id.values.ravel(), dataset.solver_time.values.ravel(), strict=True)
        distinct |= {case_id: seconds for case_id, seconds in solved if np.isfinite(seconds)}
        sections.append(f"## {name}\n\n{dataset.attrs['title'].partition(': ')[2] or name}.")
        sections += [
            f"![{figure} of {name}]({name}_{figure}.png)"
            for figure in loaded.studies[name].figures
            if (gallery / f"{name}_{figure}.png").exists()
        ]
        sections += _band(dataset)
        if gaps := style.gaps(dataset):
            sections.append("\n".join(f"- {gap}" for gap in gaps))
    if (gallery / MATERIAL_FIGURE).exists():
        sections.append(f"## material\n\nThe fabric's modulus from a tensile test.\n\n![tensile test]({MATERIAL_FIGURE})")
    sets = sorted(page.parent.name for page in gallery.glob(f"*/{PAGE}"))
    further = "Sets beside this one: " + ", ".join(f"[{name}]({name}/{PAGE})" for name in sets) + "."
    surfaces = [name for name in names if set(loaded.studies[name].figures) & set(SHAPES)]
    bare = any(not (gallery / "data" / f"{name}_shapes.nc").exists() for name in surfaces)
    unkept = (
        "Surfaces are not among these data. Their figures were drawn when the set was made, so their small print may be older."
    )
    return "\n\n".join(
        [
            "# Gallery",
            "Written by `limo gallery`; do not edit. Datasets are in `data/`; `limo gallery --redraw` draws figures from them, "
            "without a solver. A case that several studies share was solved once and counts in each. The last column is a "
            "hash of the resolved configuration, which each dataset holds as its attribute `config`.",
            *([further] * bool(sets)),
            *_devices(loaded, gallery, names),
            *([unkept] * bare),
            markdown_table(pd.DataFrame(rows)),
            f"Together {len(distinct)} distinct cases, {duration(sum(distinct.values()))} of CPU.",
            *sections,
        ]
    ) + "\n"  # fmt: skip


def _devices(loaded: Project, gallery: Path, names: Iterable[str]) -> list[str]:
    """A sentence on the devices that the datasets are of, by the names that they have in the configuration now."""
    described: dict[str, None] = {}
    for name in names:
        for setting in json.loads(_read(gallery / "data" / f"{name}.nc").attrs["config"])["settings"].values():
            pattern = Pattern.model_validate(setting["device"]["pattern"])
            known = [n for n, device in loaded.devices.items() if device.pattern == pattern]
            called = f"`{known[0]}`" if known else "a device that is not in the configuration"
            described[f"{called} (L = {pattern.length:g} mm, width_scale {pattern.width_scale:g})"] = None
    return [f"These data are of {', '.join(described)}."] if described else []


def _band(dataset: xr.Dataset) -> list[str]:
    """A sentence on how far apart the branches of one case are, which curves hardly show; none where each has only one."""
    stroke = dataset.stroke_volume.where(dataset.case_status.isin(USABLE))
    if "branch" not in stroke.dims:
        return []
    low, high = stroke.min("branch"), stroke.max("branch")
    apart = (high - low).where(stroke.count("branch") > 1)
    if not apart.notnull().any():
        return []
    cases = int(apart.notnull().any("actuation_pressure").sum())
    share = float(at_end(apart / high).max())
    return [
        f"Band ({cases} of {low.size // low.sizes['actuation_pressure']} cases): the strokes of one case differ by at most "
        f"{float(apart.max()):.1f} ml at any P_a. At the highest P_a they differ by at most {100 * share:.1f} %."
    ]


def _summary(name: str, dataset: xr.Dataset) -> dict[str, str]:
    """A study's row: what solved its cases, and how long that took."""
    seconds = dataset.solver_time.values
    builds = sorted({re.sub(r" [0-9a-f]{16}\b", "", b) for b in map(str, dataset.solver_build.values.ravel()) if b})
    engines = dataset.attrs["source"].rpartition(" engine ")[2]
    configuration = hashlib.sha256(dataset.attrs["config"].encode()).hexdigest()[:10]
    return {
        "study": name,
        "cases": str(seconds.size),
        "converged": str(int((dataset.case_status == CONVERGED).sum())),
        "engine and build": f"{engines} ({', '.join(builds)})",
        "CPU of the solver": duration(float(np.nansum(seconds))),
        "longest case": duration(float(np.nanmax(seconds))) if np.isfinite(seconds).any() else "-",
        "configuration": f"`{configuration}`",
    }
