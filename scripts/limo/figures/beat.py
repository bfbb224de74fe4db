"""A heart over one beat: loops of ventricle and pouches, pressures, volumes and flows."""

from __future__ import annotations

import xarray as xr

from limo.beat.periodic import MMHG
from limo.figures import style


def draw(beat: xr.Dataset):
    """(a) P_v over V_v, (b) P_a over V_a, (c) pressures, (d) flows over time; the right device dashed."""
    figure, upper, lower = style.two_rows(2, 2, 7.5, 6.0)
    time = beat.time.values
    for k, side in enumerate(beat.side.values):
        one, line = beat.sel(side=side), "-" if k == 0 else "--"
        looks = {"ls": line, "label": side if beat.sizes["side"] > 1 else None}
        loops = (one.ventricle_volume, one.ventricular_pressure / MMHG), (one.actuation_volume, one.actuation_pressure)
        for axis, color, (volume, pressure) in zip(upper, style.COLORS, loops, strict=False):
            axis.plot([*volume, volume[0]], [*pressure, pressure[0]], color=color, **looks)
        for name, color in (("ventricular_pressure", 0), ("arterial_pressure", 1), ("venous_pressure", 2)):
            text = name.split("_")[0] if k == 0 else None
            lower[0].plot(time, one[name] / MMHG, color=style.COLORS[color], ls=line, label=text)
        for name, color in (("outflow", 1), ("inflow", 2)):
            lower[1].plot(time, one[name], color=style.COLORS[color], ls=line, label=name if k == 0 else None)
    upper[0].set(xlabel="$V_v$ [ml]", ylabel="$P_v$ [mmHg]")
    upper[1].set(xlabel="$V_a$ [ml]", ylabel="$P_a$ [kPa]")
    lower[0].set(xlabel="Time [s]", ylabel="Pressure [mmHg]")
    lower[1].set(xlabel="Time [s]", ylabel="Flow [ml/s]")
    for axis in (*lower, *(upper[:1] if beat.sizes["side"] > 1 else ())):
        axis.legend()
    return figure
