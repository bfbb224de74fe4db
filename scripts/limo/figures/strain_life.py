"""Strain-life figure: the E-N curve of the fatigue estimate and where the cases of the study lie on it (paper, Fig. fatigue)."""

from __future__ import annotations

import numpy as np
import pandas as pd
import xarray as xr

from limo.config import Fatigue
from limo.fatigue import cycles_to_failure, strain_amplitude
from limo.figures import style
from limo.figures.pressure_volume import curve_label

_MARKERS = ("o", "s", "^", "D", "v", "P", "*", "X")


def draw(dataset: xr.Dataset, measured: pd.DataFrame | None = None):
    """(a) Amplitude over cycles with its elastic and plastic branch, and each case's peak amplitude near seams on it.

    A case in the endurance range is hollow, at the end of the curve.
    """
    fatigue = Fatigue.model_validate_json(dataset.attrs["fatigue"])
    dataset = style.first_branch(dataset)
    figure, (axis,) = style.panels(1, width=5.5, height=3.6)
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
        at, note, mfc = (life[0], "", look["color"]) if np.isfinite(life[0]) else (last, ", endurance", "none")
        axis.plot(at, amplitude, **look, mfc=mfc, label=curve_label(case, varying) + note)
        lowest = min(lowest, amplitude)
    axis.set(xlabel="Cycles to failure $N_f$ [-]", ylabel=r"Strain amplitude $\varepsilon_a$ [-]", xlim=(1, 2 * last))
    axis.set_ylim(0.6 * lowest, 1.5 * float((elastic + plastic)[0]))
    figure.legend(*axis.get_legend_handles_labels(), loc="outside right upper")
    return figure
