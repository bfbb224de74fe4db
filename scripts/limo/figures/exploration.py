"""Figures of an exploration: the front, effects of inputs, what explains what, and designs as lines over all inputs."""

from __future__ import annotations

import json
from collections.abc import Mapping

import numpy as np
import xarray as xr
from matplotlib.lines import Line2D

from limo.figures import pictures, style
from limo.figures.render import Scale, Scene
from limo.mesh.surface import facets
from limo.schema.exploration import AS_IT_IS

#: the figure of surfaces, which the dataset of an exploration does not have
PICTURES = "devices"
TITLES = {
    "front": "The front",
    "effects": "Effects",
    "slices": "Slices",
    "indices": "Shares of the variance",
    "interactions": "Interactions",
    "designs": "Designs",
    PICTURES: "Devices",
}
CAPTIONS = {
    "front": "Every design that was solved; those that miss a constraint are pale. The line is the front by the cheap preset. "
    "Stars are recommended designs by the finer preset, with their scatter over branches, tied to what the cheap preset gave. "
    "Crosses are the front as both presets together predict it, with one standard deviation.",
    "effects": "The surrogate over one input, the mean over all others, and the middle 80 % of designs there.",
    "indices": "First-order and total Sobol indices of the surrogates, with intervals of 95 %. What the total has beyond the "
    "first is interaction with other inputs.",
    "slices": "The surrogate along one input through a design, all others as in it, with its interval of 95 %. Circles mark the "
    "design.",
    "interactions": "The two inputs that act together most on each quantity, the mean over all others.",
    "designs": "Feasible designs over inputs and goals; the front in colour.",
    PICTURES: "Designs solved by the finer preset, at rest and at P_a,max: von Mises stress, highest through the thickness.",
}
_LABELS = {
    "n_pouches": "$N_p$",
    "aspect_ratio": "AR",
    "stiffness_ratio": "$\\hat{E}$",
    "thickness": "t [mm]",
    "seam_shift": "seam shift",
    "width_scale": "width scale",
    "efficiency_90ml": "$\\eta$ at 90 ml",
    "stroke_volume": "$\\Delta V_v$ [ml]",
    "von_mises_peak": "peak stress [MPa]",
}


def names(dataset: xr.Dataset) -> list[str]:
    """The figures that there are: that of the front where there are two goals, of surrogates where there are any."""
    with_front = len(_goals(dataset)) == 2
    learned = ["effects", "slices", "indices"] * bool(dataset.sizes["quantity"])
    pairs = ["interactions"] * bool(np.isfinite(dataset.pair_mean).any())
    return [*["front"] * with_front, *learned, *pairs, "designs"]


def every(dataset: xr.Dataset) -> dict:
    """All figures by their names."""
    goals = _goals(dataset)
    drawing = {
        "front": lambda: front(dataset, goals),
        "effects": lambda: effects(dataset),
        "slices": lambda: slices(dataset),
        "indices": lambda: indices(dataset),
        "interactions": lambda: interactions(dataset),
        "designs": lambda: designs(dataset, goals),
    }
    return {name: drawing[name]() for name in names(dataset)}


def short(design: str) -> str:
    """What tells a design from others of its exploration: its round and its number."""
    return "_".join(design.split("_")[-2:])


def _goals(dataset: xr.Dataset) -> list[str]:
    return list(json.loads(dataset.attrs["exploration"])["goals"])


def _label(dataset: xr.Dataset, name: str) -> str:
    units = dataset[name].attrs.get("units", "1") if name in dataset else "1"
    return _LABELS.get(name, name.replace("_", " ")) + ("" if units in ("", "1") or name in _LABELS else f" [{units}]")


def front(dataset: xr.Dataset, goals: list[str]):
    """Two goals of all designs."""
    figure, (axis,) = style.panels(1, 6.0, 4.2)
    x, y = (dataset[name].values for name in goals)
    numbers = np.unique(dataset.n_pouches.values) if "n_pouches" in dataset else np.array([0.0])
    colors = {n: style.COLORS[k % len(style.COLORS)] for k, n in enumerate(numbers)}
    for k in range(dataset.sizes["design"]):
        color = colors[float(dataset.n_pouches[k])] if "n_pouches" in dataset else style.COLORS[0]
        axis.plot(x[k], y[k], "o", ms=4, color=color, alpha=0.9 if bool(dataset.feasible[k]) else 0.2, mec="none")
    order = np.flatnonzero(dataset.on_front.values)
    order = order[np.argsort(x[order])]
    axis.plot(x[order], y[order], color="0.3", lw=1)
    corrected = [dataset[f"corrected_{name}"].values[order] for name in goals]
    spread = [dataset[f"corrected_{name}_deviation"].values[order] for name in goals]
    if np.isfinite(corrected).any():
        axis.errorbar(*corrected, spread[1], spread[0], fmt="none", ecolor="0.6", elinewidth=0.7, zorder=0)
    for k in range(dataset.sizes["recommended"]):
        u, v = (float(dataset[f"recommended_{name}"][k]) for name in goals)
        inputs = [f"recommended_{name}" for name in dataset.input.values]
        same = np.all([np.isclose(dataset[n.removeprefix("recommended_")].values, float(dataset[n][k])) for n in inputs], axis=0)
        for j in np.flatnonzero(same)[:1]:
            axis.plot([x[j], u], [y[j], v], color="0.6", lw=0.6)
        spread = [float(dataset[f"recommended_{name}_scatter"][k]) for name in goals]
        color = colors[float(dataset.recommended_n_pouches[k])] if "n_pouches" in dataset else style.COLORS[0]
        own = str(dataset.why[k].values) == AS_IT_IS
        axis.errorbar(
            u, v, spread[1], spread[0], marker="s" if own else "*", ms=7 if own else 11, color=color, mec="k", mew=0.6, lw=1
        )
    axis.set_xlabel(_label(dataset, goals[0]))
    axis.set_ylabel(_label(dataset, goals[1]))
    handles = [Line2D([], [], ls="", marker="o", color=c, label=f"$N_p$ = {n:g}") for n, c in colors.items() if n]
    handles += [Line2D([], [], ls="", marker="*", ms=10, color="0.5", mec="k", label=f"by {dataset.attrs['fine']}")]
    handles += [Line2D([], [], ls="", marker="s", color="0.5", mec="k", label=AS_IT_IS)]
    style.legend(figure, handles, [], min(len(handles), 6))
    return figure


def effects(dataset: xr.Dataset):
    """A row for each quantity, a column for each input."""
    style.plt.rcParams.update(style.SETTINGS)
    rows, columns = dataset.sizes["quantity"], dataset.sizes["input"]
    figure, axes = style.plt.subplots(
        rows, columns, figsize=(1.9 * columns, 1.8 * rows), squeeze=False, sharey="row", layout="constrained"
    )
    for q, name in enumerate(dataset.quantity.values):
        for i, each in enumerate(dataset.input.values):
            axis, at = axes[q, i], dataset.effect_at[i].values
            mean, low, high = (dataset[n][q, i].values for n in ("effect", "effect_low", "effect_high"))
            known = np.isfinite(mean)
            axis.fill_between(at[known], low[known], high[known], color=style.COLORS[0], alpha=0.2, lw=0)
            axis.plot(at[known], mean[known], "o-" if known.sum() < 8 else "-", color=style.COLORS[0], ms=3)
            if q == rows - 1:
                axis.set_xlabel(_label(dataset, str(each)))
            if i == 0:
                axis.set_ylabel(_label(dataset, str(name)), fontsize=7)
    return figure


def slices(dataset: xr.Dataset):
    """A row for each quantity, a column for each input, a line with its band for each design."""
    style.plt.rcParams.update(style.SETTINGS)
    rows, columns = dataset.sizes["quantity"], dataset.sizes["input"]
    size = (1.9 * columns, 1.8 * rows + 0.3)
    figure, axes = style.plt.subplots(rows, columns, figsize=size, squeeze=False, sharey="row", layout="constrained")
    for q, name in enumerate(dataset.quantity.values):
        for i, each in enumerate(dataset.input.values):
            axis, at = axes[q, i], dataset.effect_at[i].values
            for line in range(dataset.sizes["line"]):
                color = style.COLORS[line % len(style.COLORS)]
                mean, within = dataset.slice[q, line, i].values, 1.96 * dataset.slice_deviation[q, line, i].values
                known, here = np.isfinite(mean), float(dataset.slice_through[line, i])
                axis.fill_between(at[known], (mean - within)[known], (mean + within)[known], color=color, alpha=0.2, lw=0)
                axis.plot(at[known], mean[known], "-", color=color, lw=1.2)
                axis.plot(here, np.interp(here, at[known], mean[known]), "o", ms=4, color=color)
            if q == rows - 1:
                axis.set_xlabel(_label(dataset, str(each)))
            if i == 0:
                axis.set_ylabel(_label(dataset, str(name)), fontsize=7)
    colors = [style.COLORS[k % len(style.COLORS)] for k in range(dataset.sizes["line"])]
    handles = [Line2D([], [], color=c, label=str(t)) for c, t in zip(colors, dataset.line.values, strict=True)]
    style.legend(figure, handles, [], 2)
    return figure


def indices(dataset: xr.Dataset):
    """Bars of first-order and total indices, a panel for each quantity."""
    count = dataset.sizes["quantity"]
    figure, axes = style.panels(count, max(2.6 * count, 4.0), 2.8)
    places = np.arange(dataset.sizes["input"])
    for q, (axis, name) in enumerate(zip(axes, dataset.quantity.values, strict=True)):
        for k, (key, color) in enumerate((("first", style.COLORS[0]), ("total", style.COLORS[1]))):
            values, within = dataset[f"index_{key}"][q].values, dataset[f"index_{key}_within"][q].values
            axis.bar(places + 0.4 * (k - 0.5), values, 0.38, yerr=within, color=color, error_kw={"lw": 0.8})
        axis.set_xticks(
            places, [_label(dataset, str(each)) for each in dataset.input.values], rotation=30, ha="right", fontsize=7
        )
        axis.set_title(_label(dataset, str(name)), fontsize=8)
    handles = [Line2D([], [], lw=6, color=c, label=t) for t, c in (("first order", style.COLORS[0]), ("total", style.COLORS[1]))]
    style.legend(figure, handles, [], 2)
    return figure


def interactions(dataset: xr.Dataset):
    """A map of the mean over the two inputs that act together most, a panel for each quantity."""
    shown = [q for q in range(dataset.sizes["quantity"]) if np.isfinite(dataset.pair_mean[q]).any()]
    figure, axes = style.panels(len(shown), 2.9 * len(shown), 2.7)
    for q, axis in zip(shown, axes, strict=True):
        x, y, values = dataset.pair_at[q, 0].values, dataset.pair_at[q, 1].values, dataset.pair_mean[q].values
        known = np.ix_(np.isfinite(x), np.isfinite(y))
        drawn = axis.contourf(x[np.isfinite(x)], y[np.isfinite(y)], values[known].T, levels=12, cmap="viridis")
        figure.colorbar(drawn, ax=axis)
        i, j = dataset.pair.values[q]
        axis.set_xlabel(_label(dataset, str(dataset.input.values[i])))
        axis.set_ylabel(_label(dataset, str(dataset.input.values[j])))
        axis.set_title(_label(dataset, str(dataset.quantity.values[q])), fontsize=8)
        if np.isfinite(x).sum() < 8:
            axis.set_xticks(x[np.isfinite(x)])
    return figure


def devices(shapes: Mapping[str, xr.Dataset]):
    """Two pictures of each design, at rest and at P_a,max, in von Mises stress."""
    cases = {name: pictures.squeezed(one, ["n_pouches"]).isel(n_pouches=0) for name, one in shapes.items()}
    first = {name: case.isel({d: 0 for d in case.mesh_number.dims}) for name, case in cases.items()}
    highest = max(float(case.von_mises.quantile(0.995)) for case in first.values())
    scale = Scale("viridis", 0.0, pictures.rounded_up(highest))
    across = min(3, len(first))
    down = -(-len(first) // across)
    figure, axes = pictures.picture_figure(down, 2 * across, pictures.Grid(width=1.35, top=0.25))
    for axis in axes.ravel():
        axis.set_axis_off()
    for k, (name, case) in enumerate(first.items()):
        for side, frame in enumerate((pictures.frame_at(case, 0.0), pictures.last_frame(case))):
            axis = axes[k // across, 2 * (k % across) + side]
            image = None
            if frame is not None:
                surface = pictures.device(case, case.displacement.values[frame], case.von_mises.values[frame])
                scene = Scene().add(facets(surface), scale=scale)
                image = pictures.picture(scene, pictures.DEFORMED, float(case.device_length))
            pictures.show(axis, image, "no such frame")
            label = f"{short(name)}, " * (side == 0) + pictures.pressure_label(case, frame)
            axis.set_title(label, fontsize=7, pad=2)
    pictures.colour_bar(figure, scale, "von Mises stress [MPa]", extend="max")
    return figure


def designs(dataset: xr.Dataset, goals: list[str]):
    """Parallel coordinates of feasible designs."""
    figure, (axis,) = style.panels(1, 7.5, 3.6)
    names = [*map(str, dataset.input.values), *goals]
    chosen = np.flatnonzero(dataset.feasible.values)
    values = np.stack([dataset[name].values[chosen] for name in names], axis=1) if len(chosen) else np.empty((0, len(names)))
    if len(chosen):
        low, span = values.min(axis=0), np.maximum(np.ptp(values, axis=0), 1e-12)
        scaled = (values - low) / span
        for line, number in zip(scaled, chosen, strict=True):
            if not bool(dataset.on_front[number]):
                axis.plot(line, color="0.75", lw=0.6)
        for line, number in zip(scaled, chosen, strict=True):
            if bool(dataset.on_front[number]):
                axis.plot(line, color=style.COLORS[1], lw=1.3)
        for k in range(len(names)):
            axis.annotate(f"{low[k]:.3g}", (k, -0.02), ha="center", va="top", fontsize=7)
            axis.annotate(f"{low[k] + span[k]:.3g}", (k, 1.02), ha="center", va="bottom", fontsize=7)
    axis.set_xticks(range(len(names)), [_label(dataset, name) for name in names], fontsize=7)
    axis.set_yticks([])
    axis.set_ylim(-0.12, 1.12)
    return figure
