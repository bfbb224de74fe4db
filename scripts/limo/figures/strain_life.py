"""Strain-life figure: the E-N curve with the cases of the study on it, and the device that fails first (paper, Fig. fatigue)."""

from __future__ import annotations

import textwrap

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.cm import ScalarMappable

from limo.figures import pictures, style
from limo.figures.cycles import life_scale, pictures_of
from limo.figures.pressure_volume import curve_label
from limo.measure import states
from limo.measure.fatigue import cycles_to_failure, strain_amplitude
from limo.schema.fatigue import Fatigue

_MARKERS = ("o", "s", "^", "D", "v", "P", "*", "X")


def draw(dataset: xr.Dataset, measured: pd.DataFrame | None, shapes: xr.Dataset):
    """(a) Amplitude over cycles with each case's peak amplitude near seams; (b) cycles of the case with the largest one."""
    fatigue = Fatigue.model_validate_json(dataset.attrs["fatigue"])
    figure, (left, right) = style.panels(2, width=7.4, height=4.5, width_ratios=[1.35, 1.0])
    _curve(left, dataset, fatigue)
    _device(right, dataset, shapes, fatigue)
    style.legend(figure, left.get_legend_handles_labels()[0], style.gaps(dataset), 4)
    return figure


def _curve(axis, dataset: xr.Dataset, fatigue: Fatigue) -> None:
    """Amplitude over cycles with its elastic and plastic branch; a case in the endurance range is hollow, at its end."""
    dataset = states.lowest(dataset)
    last = fatigue.endurance_cycles.value
    cycles = np.logspace(0, np.log10(last), 400)
    elastic, plastic = strain_amplitude(cycles, fatigue)
    axis.loglog(cycles, elastic + plastic, color="black", label=r"total, $\varepsilon_a$")
    axis.loglog(cycles, elastic, "--", color="0.45", lw=1.0, label=r"elastic, $\sigma_f'/E\,(2N_f)^b$")
    axis.loglog(cycles, plastic, ":", color="0.45", lw=1.0, label=r"plastic, $\varepsilon_f'(2N_f)^c$")
    dims = list(dataset.case_status.dims)
    varying = [d for d in dims if dataset.sizes[d] > 1]
    cases = dataset.stack(case=dims) if dims else dataset.expand_dims("case")
    colors = dataset.sizes[varying[-1]] if varying else 1  # what varies last has the colour, all else the marker
    lowest = float(sum(strain_amplitude(np.array(last), fatigue)))
    for k in range(cases.sizes["case"]):
        case = cases.isel(case=k)
        amplitude = float(case.fatigue_amplitude_peak)
        look = {"color": style.COLORS[k % colors % len(style.COLORS)], "marker": _MARKERS[k // colors % len(_MARKERS)], "ls": ""}
        if not np.isfinite(amplitude):
            axis.plot([], [], **look | {"marker": "x"}, label=f"{curve_label(case, varying)}: not measured")
            continue
        life, _ = cycles_to_failure(np.array([amplitude]), fatigue)
        end, note, mfc = (life[0], "", look["color"]) if np.isfinite(life[0]) else (last, ", endurance", "none")
        axis.plot(end, amplitude, **look, mfc=mfc, label=curve_label(case, varying) + note)
        lowest = min(lowest, amplitude)
    axis.set(xlabel="Cycles to failure $N_f$ [-]", ylabel=r"Strain amplitude $\varepsilon_a$ [-]", xlim=(1, 2 * last))
    axis.set_ylim(0.6 * lowest, 1.5 * float((elastic + plastic)[0]))


def _device(axis, dataset: xr.Dataset, shapes: xr.Dataset, fatigue: Fatigue) -> None:
    """Cycles near seams of the case with the largest peak amplitude, deformed; an empty panel where no case has one."""
    cases = [case for line in pictures.case_grid(shapes, "n_pouches")[2] for case in line]
    peaks = [float(pictures.study_case(dataset, case).fatigue_amplitude_peak) for case in cases]
    peaks = [peak if pictures.last_frame(case) is not None else np.nan for peak, case in zip(peaks, cases, strict=True)]
    worst = int(np.nanargmax(peaks)) if np.isfinite(peaks).any() else 0
    case, scale = cases[worst], life_scale(shapes, fatigue)
    images = pictures_of(case, scale, fatigue, 560) if np.isfinite(peaks[worst]) else None
    pictures.show(axis, images[1] if images else None, pictures.empty_reason(dataset, case, "no strain amplitudes"))
    if images is None:
        return
    words = [pictures.names(case, pictures.varying(shapes)), pictures.pressure_label(case, pictures.last_frame(case))]
    axis.set_title("(b) " + ",\n".join(word for word in words if word), loc="left")
    below = axis.inset_axes((0.02, 0.02, 0.96, 0.035))
    bar = axis.figure.colorbar(ScalarMappable(scale.norm, scale.map), below, orientation="horizontal", extend="max")
    star = "\n".join(["", *textwrap.wrap(pictures.STAR, 44)]) if pictures.is_touching(case, pictures.last_frame(case)) else ""
    bar.set_label(f"Expected cycles $N_f$ [-] near seams{star}")
