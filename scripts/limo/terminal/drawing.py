"""Pictures of flat patterns before anything is solved, and files of cutting patterns."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D

from limo.cases.case import Case
from limo.cases.grid import study_cases
from limo.config.load import load_config
from limo.config.project import Project
from limo.errors import ConfigError
from limo.figures import style
from limo.figures.flat_pattern import LINES, draw_pattern
from limo.geometry.cutting import DXF_VERSIONS, cutting_lines, dxf, svg
from limo.geometry.pattern import flat_pattern
from limo.mesh.device import mesh_device
from limo.mesh.file import read_mesh
from limo.mesh.layers import DeviceMesh
from limo.store.digest import number_label
from limo.store.files import write_whole
from limo.store.results import Results

_ROW = 4  # panels in a row
EPICARDIUM = 2  # the layer of a mesh that lies on the pouches of the wall


def draw_studies(config_file: str, studies: Sequence[str], results: Path, kind: str = "png", meshes: bool = False) -> list[Path]:
    """Draw the devices of each study (none: all) as ``patterns/STUDY.png`` (or svg) in the results; returns the files.

    ``meshes``: with the mesh of one layer, which is made where it is not there yet.
    """
    loaded = load_config(config_file, studies)
    loaded.require(studies, config_file, "limo check --draw afterload")
    files = []
    for name in studies or loaded.studies:
        figure = draw_study(loaded, name, results, meshes)
        files.append(results / "patterns" / f"{name}.{kind}")
        write_whole(files[-1], lambda path, figure=figure: style.save(figure, path))
        style.close(figure)
    return files


def draw_study(loaded: Project, name: str, results: Path, meshes: bool = False):
    """One panel for each flat pattern of a study."""
    cases: dict[str, Case] = {}
    variants: dict[str, list[str]] = {}
    for point, case in study_cases(loaded, name).items():
        cases.setdefault(case.mesh_id, case)
        variants.setdefault(case.mesh_id, []).append(point.variant)
    told_apart = len({tuple(dict.fromkeys(named)) for named in variants.values()}) > 1
    rows = -(-len(cases) // _ROW)
    columns = min(len(cases), _ROW)
    style.plt.rcParams.update(style.SETTINGS)
    figure, axes = style.plt.subplots(
        rows,
        columns,
        figsize=(0.6 + 2.6 * columns, 0.8 + 3.2 * rows),
        layout="constrained",
        squeeze=False,
        sharex=True,
        sharey=True,
    )
    for axis in axes.flat[len(cases) :]:
        axis.set_visible(False)
    scaled = len({case.device.pattern.width_scale for case in cases.values()}) > 1
    for axis, case in zip(axes.flat, cases.values(), strict=False):
        pattern = flat_pattern(case.device.pattern, case.n_pouches)
        title = f"$N_p$ = {case.n_pouches}" + (f", width {case.device.pattern.width_scale:g}" if scaled else "")
        title += f", {', '.join(dict.fromkeys(variants[case.mesh_id]))}" * told_apart
        if meshes:
            mesh = _mesh(case, results)
            _draw_mesh(axis, mesh)
            title += f", {len(mesh.quads)} elements"
        draw_pattern(axis, pattern)
        axis.set_title(title, loc="left")
        axis.set_xlabel("x [mm]")
    for row in axes:
        row[0].set_ylabel("y [mm]")
    handles = [Line2D([], [], color=color, lw=width, label=label) for label, color, width in LINES.values()]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
    figure.suptitle(f"{name}: flat pattern of one face, device {loaded.studies[name].device}", fontsize=9)
    return figure


def _mesh(case: Case, results: Path) -> DeviceMesh:
    file = Results(results).mesh(case.mesh_id)
    return read_mesh(file, case.mesh.symmetry) if file.exists() else mesh_device(case.mesh_content())


def _draw_mesh(axis, mesh: DeviceMesh) -> None:
    """The elements of wall and endocardium of the front face."""
    chosen = mesh.quads[(mesh.layer != EPICARDIUM) & (mesh.face == 0)]
    corners = mesh.nodes[chosen[:, [0, 4, 1, 5, 2, 6, 3, 7, 0]], :2]
    for sign in (1.0, -1.0):
        axis.add_collection(LineCollection(corners * [sign, 1.0], colors="0.6", linewidths=0.25, zorder=1.5))


def write_pattern(
    config_file: str,
    device: str,
    n_pouches: int,
    folder: Path,
    width_scale: float | None = None,
    allowance: float = 0.0,
    dxf_version: str = DXF_VERSIONS[0],
    seams: str = "lines",
) -> list[Path]:
    """Write the cutting pattern of a device as SVG and DXF to scale into a folder; returns the files.

    Lengths in mm; ``seams`` as ``cutting_lines`` has it. Raises ``ConfigError`` for a device that is not there and for a layout
    that cannot be cut.
    """
    loaded = load_config(config_file)
    loaded.require_device(device, "limo pattern", "DEVICE", "limo pattern limo 6")
    if n_pouches not in range(2, 17, 2):
        raise ConfigError("limo pattern", "N_P", n_pouches, "an even number from 2 to 16", "limo pattern limo 6")
    for key, value, low, high in (("--width-scale", width_scale, 0.5, 1.5), ("--allowance", allowance, 0.0, 50.0)):
        if value is not None and not low <= value <= high:
            raise ConfigError("limo pattern", key, value, f"a number from {low:g} to {high:g}", f"{key} {max(low, 1.0):g}")
    if dxf_version not in DXF_VERSIONS:
        known = f"one of: {', '.join(DXF_VERSIONS)}"
        raise ConfigError("limo pattern", "--dxf-version", dxf_version, known, f"--dxf-version {DXF_VERSIONS[-1]}")
    shape = loaded.devices[device].pattern
    if width_scale is not None:
        shape = shape.model_copy(update={"width_scale": width_scale})
    lines = cutting_lines(flat_pattern(shape, n_pouches, loaded.files[f"devices/{device}"]), allowance, seams)
    name = f"{device}_np{n_pouches}" + (f"_w{number_label(width_scale)}" if width_scale is not None else "")
    title = f"LIMO device {device}, N_p = {n_pouches}, one face, L = {shape.length:g} mm, allowance {allowance:g} mm"
    files = [folder / f"{name}.svg", folder / f"{name}.dxf"]
    for file, text in zip(files, (svg(lines, title), dxf(lines, dxf_version)), strict=True):
        write_whole(file, lambda path, text=text: path.write_text(text, encoding="utf-8"))
    return files
