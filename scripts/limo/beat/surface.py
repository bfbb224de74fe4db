"""Surfaces of a device: V_v and V_a over P_v and P_a, a sheet for loading and one for unloading, from a study of legs.

The volumes of a sheet are the gradient of one potential, fitted to those of the study (``limo.beat.potential``). A fine table of
them is bilinear within its cells. So a volume is continuous and rises with its own pressure, and a closed way on a sheet costs
nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import xarray as xr
from scipy.interpolate import PchipInterpolator

from limo.beat.potential import Potential, fitted
from limo.errors import ResultError
from limo.measure.states import lowest
from limo.store.files import UNREADABLE, write_netcdf
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
    """``volumes`` (2, 2, m, n) in ml: sheets, V_v and V_a, over ``ventricular`` (m,) and ``actuation`` (n,) in kPa.

    ``known``: the potentials of both sheets where they have been fitted before; that takes seconds. ``lacking``: the same of the
    surfaces that lack one inner P_v each, in the order of these.
    """

    device: str
    ventricular: np.ndarray
    actuation: np.ndarray
    volumes: np.ndarray
    known: tuple[Potential, Potential] | None = None
    lacking: tuple[tuple[Potential, Potential], ...] | None = None

    @cached_property
    def places(self) -> tuple[np.ndarray, np.ndarray]:
        """P_v (M,) and P_a (N,) in kPa of the table."""
        return tuple(
            np.linspace(p[0], p[-1], 1 + round((p[-1] - p[0]) / step))
            for p, step in ((self.ventricular, STEP_VENTRICULAR), (self.actuation, STEP_ACTUATION))
        )

    @cached_property
    def potentials(self) -> tuple[Potential, Potential]:
        """Of both sheets."""
        return self.known or tuple(fitted(self.ventricular, self.actuation, sheet) for sheet in self.volumes)

    @cached_property
    def table(self) -> np.ndarray:
        """Volumes (2, 2, M, N) in ml at ``places``."""
        return np.stack([potential.volumes(*self.places) for potential in self.potentials])

    def misfit(self) -> np.ndarray:
        """What the potentials miss the study's volumes by (2, 2, m, n), in ml: of each sheet, V_v and V_a."""
        return np.stack([p.volumes(self.ventricular, self.actuation) for p in self.potentials]) - self.volumes

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

    def without(self, k: int) -> Surface:
        """The same without the ``k``-th P_v, an inner one."""
        keep = np.arange(len(self.ventricular)) != k
        known = None if self.lacking is None else self.lacking[k - 1]
        return Surface(self.device, self.ventricular[keep], self.actuation, self.volumes[:, :, keep], known)

    def left_out(self) -> dict[str, np.ndarray]:
        """What leaving each inner P_v out changes there: root mean square over P_a in ml, (m - 2,), by volume and sheet.

        Each volume for itself, by monotone cubics over P_v. The potentials are fitted to all, and both volumes of one belong
        together; so this is an upper estimate of their error between two P_v.
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

    def slopes(self) -> xr.Dataset:
        """Volumes in ml at ``places``, and their slopes in ml/kPa."""
        p_v, p_a = self.places
        dims = ("sheet", "ventricular_pressure", "actuation_pressure")
        values = {}
        for v, (name, symbol) in enumerate((("ventricle_volume", "V_v"), ("actuation_volume", "V_a"))):
            volume = self.table[:, v]
            values[name] = dims, volume, {"units": "ml", "long_name": symbol}
            for axis, (along, places, text) in enumerate((("ventricular", p_v, "P_v"), ("actuation", p_a, "P_a"))):
                slope = np.gradient(volume, places, axis=1 + axis)
                values[f"{name}_by_{along}_pressure"] = dims, slope, {"units": "ml/kPa", "long_name": f"d{symbol} / d{text}"}
        return xr.Dataset(values, {"sheet": list(SHEETS), dims[1]: p_v, dims[2]: p_a}, {"device": self.device})


def surfaces_of(dataset: xr.Dataset) -> dict[int, Surface]:
    """The surfaces of all devices of a study, by N_p. Raises as ``surface_of``."""
    return {int(n): surface_of(dataset, int(n)) for n in dataset.n_pouches.values}


def write_surfaces(surfaces: Mapping[int, Surface], file: Path, *, kept: bool = False) -> None:
    """Write the surfaces of one study with their potentials and their tables, which take some MB.

    ``kept``: without tables, but with the potentials of surfaces that lack one P_v each, for bands.
    """
    one = next(iter(surfaces.values()))
    dims = ("n_pouches", "sheet")
    potentials = [surface.potentials for surface in surfaces.values()]
    data = {
        "volume": ((*dims, "of", "ventricular_pressure", "actuation_pressure"), [s.volumes for s in surfaces.values()]),
        "coefficient": ((*dims, "a", "b"), [[p.coefficients for p in pair] for pair in potentials]),
        "knot": ("c", potentials[0][0].actuation),
    }
    coordinates = {
        "n_pouches": list(surfaces),
        "sheet": list(SHEETS),
        "of": ["ventricle", "pouches"],
        "ventricular_pressure": ("ventricular_pressure", one.ventricular, {"units": "kPa", "long_name": "P_v"}),
        "actuation_pressure": ("actuation_pressure", one.actuation, {"units": "kPa", "long_name": "P_a"}),
    }
    dataset = xr.Dataset(data, coordinates)
    dataset.volume.attrs |= {"units": "ml", "long_name": "volumes of the study"}
    dataset.coefficient.attrs |= {"units": "mJ", "long_name": "of the potential, on cubic splines over P_v and the knots"}
    dataset.knot.attrs |= {"units": "kPa", "long_name": "knots over P_a"}
    packed = ["volume"]
    if kept:
        inner = range(1, len(one.ventricular) - 1)
        lacking = [[s.without(k).potentials for k in inner] for s in surfaces.values()]
        values = [[[p.coefficients for p in pair] for pair in each] for each in lacking]
        dataset["lacking_coefficient"] = ("n_pouches", "lacking", "sheet", "a_lacking", "b"), values
        dataset.lacking_coefficient.attrs |= {"units": "mJ", "long_name": "coefficients without one inner P_v"}
    else:
        tables = xr.concat([surface.slopes() for surface in surfaces.values()], "n_pouches")
        renamed = {"ventricular_pressure": "place_ventricular", "actuation_pressure": "place_actuation"}
        dataset = dataset.merge(tables.rename(renamed), combine_attrs="drop")
        packed += list(tables.data_vars)
    small = {"zlib": True, "dtype": "float32", "complevel": 9, "shuffle": True}
    write_netcdf(dataset, file, dict.fromkeys(packed, small), checked=False)


def read_surfaces(file: Path) -> dict[int, Surface]:
    """What ``write_surfaces`` wrote. Raises ``ResultError``."""
    try:
        with xr.open_dataset(file) as opened:
            dataset = opened.load()
        p_v, p_a = (dataset[f"{name}_pressure"].values for name in ("ventricular", "actuation"))
        knots = dataset.knot.values
        return {
            int(n): Surface(
                f"N_p = {int(n)}",
                p_v,
                p_a,
                dataset.volume.values[k].astype(float),
                tuple(Potential(p_v, knots, c) for c in dataset.coefficient.values[k]),
                _lacking(dataset.lacking_coefficient.values[k], p_v, knots) if "lacking_coefficient" in dataset else None,
            )
            for k, n in enumerate(dataset.n_pouches.values)
        }
    except (*UNREADABLE, AttributeError) as error:
        raise ResultError(f"{file}: no surfaces of a study ({error})") from None


def _lacking(coefficients: np.ndarray, p_v: np.ndarray, knots: np.ndarray) -> tuple[tuple[Potential, Potential], ...]:
    """The potentials that lack one inner P_v each, from coefficients (m - 2, 2, a, b)."""
    places = [np.delete(p_v, k) for k in range(1, len(p_v) - 1)]
    return tuple(tuple(Potential(p, knots, c) for c in pair) for p, pair in zip(places, coefficients, strict=True))


def surfaces_beside(file: Path) -> dict[int, Surface]:
    """The surfaces of all devices of a study's dataset. They are fitted once, and lie beside it. Raises ``ResultError``."""
    aside = file.with_name(f"{file.stem}_surfaces.nc")
    if not (aside.exists() and file.exists() and aside.stat().st_mtime >= file.stat().st_mtime):
        try:
            with xr.open_dataset(file) as dataset:
                write_surfaces(surfaces_of(dataset.load()), aside)
        except UNREADABLE:
            raise ResultError(f"{file}: no dataset of a study; snakemake {file.parent.name} makes it") from None
        except ResultError as error:
            raise ResultError(f"{file}: {error}") from None
    return read_surfaces(aside)


def surface_of(dataset: xr.Dataset, n_pouches: int | None = None) -> Surface:
    """The surface of one device of a study with ``actuation: [0, max, 0]``; of least energy among branches.

    Raises ``ResultError``, which names what is lacking and what to change in the study.
    """
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
