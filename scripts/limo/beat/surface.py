"""Surfaces of a device: V_v and V_a over P_v and P_a, a sheet for loading and one for unloading, from a study of legs.

Between the pressures of the study a volume is interpolated by monotone cubics (PCHIP, scipy), first over P_v and then over P_a,
onto a fine table; within a cell of that it is bilinear, with the gradient that belongs to it. So it is continuous, has no
maximum that the study has not, and what flows in along a path is what the volume gains.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import xarray as xr
from scipy.interpolate import PchipInterpolator

from limo.errors import ResultError
from limo.store.statuses import USABLE

SHEETS = ("loading", "unloading")
VOLUMES = ("leg_ventricle_volume", "leg_actuation_volume")
#: kPa between the places of the table over P_v and P_a
STEP_VENTRICULAR, STEP_ACTUATION = 0.25, 0.5
#: share of the range of V_v by which the sheets may differ and still count as one
JOINED = 0.01
#: pressures of a study without which nothing can be interpolated
FEWEST_PRESSURES = 4


@dataclass(frozen=True)
class Surface:
    """``volumes`` (2, 2, m, n) in ml: sheets, V_v and V_a, over ``ventricular`` (m,) and ``actuation`` (n,) in kPa."""

    device: str
    ventricular: np.ndarray
    actuation: np.ndarray
    volumes: np.ndarray

    @cached_property
    def places(self) -> tuple[np.ndarray, np.ndarray]:
        """P_v (M,) and P_a (N,) in kPa of the table."""
        return tuple(
            np.linspace(p[0], p[-1], 1 + round((p[-1] - p[0]) / step))
            for p, step in ((self.ventricular, STEP_VENTRICULAR), (self.actuation, STEP_ACTUATION))
        )

    @cached_property
    def table(self) -> np.ndarray:
        """Volumes (2, 2, M, N) in ml at ``places``."""
        over_ventricular = PchipInterpolator(self.ventricular, self.volumes, axis=2)(self.places[0])
        return PchipInterpolator(self.actuation, over_ventricular, axis=3)(self.places[1])

    @cached_property
    def range(self) -> float:
        """Largest less smallest V_v in ml."""
        return float(np.ptp(self.volumes[:, 0]))

    @cached_property
    def joined(self) -> np.ndarray:
        """P_a (2, M) in kPa at and below which the sheets of V_v are one, and at and above which they are again.

        A heart changes from loading to unloading above the second one, and back below the first one: there nothing jumps. Both
        are the highest P_a where the sheets are one everywhere.
        """
        apart = np.abs(self.table[0, 0] - self.table[1, 0]) > JOINED * self.range
        pressure, last = self.places[1], len(self.places[1]) - 1
        low, high = np.full(len(apart), pressure[-1]), np.full(len(apart), pressure[-1])
        for k in np.flatnonzero(apart.any(axis=1)):
            where = np.flatnonzero(apart[k])
            low[k], high[k] = pressure[max(where[0] - 1, 0)], pressure[min(where[-1] + 1, last)]
        return np.array([low, high])

    def left_out(self) -> dict[str, np.ndarray]:
        """What leaving each inner P_v out changes there: root mean square over P_a in ml, (m - 2,), by volume and sheet.

        The tables are made of all; so this is an upper estimate of their error between two P_v.
        """
        errors = {}
        for s, sheet in enumerate(SHEETS):
            for v, volume in enumerate(("ventricle", "actuation")):
                rows = []
                for k in range(1, len(self.ventricular) - 1):
                    keep = np.arange(len(self.ventricular)) != k
                    found = PchipInterpolator(self.ventricular[keep], self.volumes[s, v, keep])(self.ventricular[k])
                    rows.append(np.sqrt(np.mean((found - self.volumes[s, v, k]) ** 2)))
                errors[f"{volume}_{sheet}"] = np.array(rows)
        return errors

    def dataset(self) -> xr.Dataset:
        """The table with its gradients, to be stored: volumes in ml, gradients in ml/kPa."""
        p_v, p_a = self.places
        dims = ("sheet", "ventricular_pressure", "actuation_pressure")
        values = {}
        for v, (name, symbol) in enumerate((("ventricle_volume", "V_v"), ("actuation_volume", "V_a"))):
            volume = self.table[:, v]
            values[name] = dims, volume, {"units": "ml", "long_name": symbol}
            for axis, (along, places, text) in enumerate((("ventricular", p_v, "P_v"), ("actuation", p_a, "P_a"))):
                slope = np.gradient(volume, places, axis=1 + axis)
                values[f"{name}_by_{along}_pressure"] = dims, slope, {"units": "ml/kPa", "long_name": f"d{symbol} / d{text}"}
        coordinates = {
            "sheet": list(SHEETS),
            "ventricular_pressure": ("ventricular_pressure", p_v, {"units": "kPa", "long_name": "ventricular pressure, P_v"}),
            "actuation_pressure": ("actuation_pressure", p_a, {"units": "kPa", "long_name": "actuation pressure, P_a"}),
        }
        return xr.Dataset(values, coordinates, {"device": self.device})


def surface_of(dataset: xr.Dataset, n_pouches: int | None = None) -> Surface:
    """The surface of one device of a study with ``actuation: [0, max, 0]``; of least energy among branches.

    Raises ``ResultError``, which names what is lacking and what to change in the study.
    """
    from limo.measure.states import lowest

    if VOLUMES[0] not in dataset or dataset.sizes["leg"] < 2:
        raise ResultError('no unloading in this study; a surface needs actuation: [0, "max", 0] there')
    dataset = lowest(dataset)
    known = dataset.n_pouches.values.tolist()
    if n_pouches is None and len(known) == 1:
        n_pouches = known[0]
    if n_pouches not in known:
        raise ResultError(f"N_p = {n_pouches}: one of {', '.join(map(str, known))}, which the study has")
    case = dataset.sel(n_pouches=n_pouches).isel(leg=[0, 1])
    for dim in set(case.case_status.dims) - {"ventricular_pressure"}:
        if case.sizes[dim] > 1:
            raise ResultError(f"several values of {dim}; a surface is of one device")
        case = case.isel({dim: 0})
    case = case.sortby("ventricular_pressure")
    if case.sizes["ventricular_pressure"] < FEWEST_PRESSURES:
        raise ResultError(f"{case.sizes['ventricular_pressure']} values of P_v; a surface needs {FEWEST_PRESSURES} or more")
    unusable = ~case.case_status.isin(USABLE) | case[VOLUMES[0]].isnull().any(["leg", "actuation_pressure"])
    if bool(unusable.any()):
        named = ", ".join(f"{float(p):g}" for p in case.ventricular_pressure[unusable])
        raise ResultError(f"N_p = {n_pouches} did not come to the end of its legs at P_v = {named} kPa")
    volumes = np.stack([case[n].transpose("leg", "ventricular_pressure", "actuation_pressure").values for n in VOLUMES], axis=1)
    return Surface(f"N_p = {n_pouches}", case.ventricular_pressure.values, case.actuation_pressure.values, volumes)
