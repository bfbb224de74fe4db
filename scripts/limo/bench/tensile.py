"""Young's modulus of the fabric from a tensile test (paper, *Material model calibration*)."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from limo.bench.line import Line, find_line, fit_paper, fit_window
from limo.bench.specimens import Reading, Specimen, read_specimens
from limo.errors import ConfigError
from limo.schema.bench import PLAUSIBLE_MODULUS, SIZES, TensileTest

#: moduli (MPa) and strains at the largest force that are believed of files that name no unit
_WITHOUT_UNITS, _STRAINS_WITHOUT_UNITS = (5.0, 50_000.0), (1e-3, 10.0)
#: a force in N that is larger than this at some point, in a file that names no unit, is rather one in kN
_SMALLEST_FORCE = 1.0
#: strains, stated as shares, that are told because they are large for a fabric
_LARGE_STRAIN = 1.0
#: standard deviation between specimens over their mean that is told
_LARGE_SCATTER = 0.2
#: a parabola's change of slope over the window that is told, and its largest probability by chance
_TREND, _BY_CHANCE = 0.05, 0.01


@dataclass(frozen=True)
class Fit:
    """A tensile test with the line of each specimen. Moduli in MPa.

    ``error`` of the mean: the scatter between specimens over the root of their number, and the root mean square of their own
    errors, which do not shrink with the number because the choice of window is the same for all.
    """

    test: TensileTest
    reading: Reading
    lines: list[Line]

    @property
    def specimens(self) -> list[Specimen]:
        """The specimens, in the order of ``lines``."""
        return self.reading.specimens

    @property
    def moduli(self) -> np.ndarray:
        """E of each specimen."""
        return np.array([line.modulus for line in self.lines])

    @property
    def modulus(self) -> float:
        """Mean of the specimens."""
        return float(self.moduli.mean())

    @property
    def scatter(self) -> float:
        """Standard deviation between specimens; NaN for one."""
        return float(self.moduli.std(ddof=1)) if len(self.lines) > 1 else float("nan")

    @property
    def error(self) -> float:
        """Standard error of the mean."""
        own = np.mean([line.error**2 for line in self.lines])
        between = self.scatter**2 / len(self.lines) if len(self.lines) > 1 else 0.0
        return float(np.sqrt(own + between))

    @property
    def notes(self) -> list[str]:
        """What a reader must know of the fits, one sentence each."""
        said = []
        for specimen, line in zip(self.specimens, self.lines, strict=True):
            said += [f"{specimen.name}: {note}" for note in line.notes]
            if (reach := float(np.ptp(specimen.strain))) > _LARGE_STRAIN and "length" not in specimen.sizes:
                said.append(
                    f"{specimen.name}: strains reach {reach:.0%}; if they are in %, units says so and E is 100 times as large"
                )
            if abs(line.trend) > _TREND and line.trend_probability < _BY_CHANCE:
                how = "falls" if line.trend < 0 else "rises"
                chance = f"p = {line.trend_probability:.1g}" if line.trend_probability > 1e-12 else "p < 1e-12"
                change = f"the slope {how} by {abs(line.trend):.0%} over the window ({chance})"
                said.append(f"{specimen.name}: residuals have a trend, {change}")
        if len(self.lines) > 1 and self.scatter > _LARGE_SCATTER * self.modulus:
            said.append(f"specimens differ by {self.scatter / self.modulus:.0%}: are material, size and units the same?")
        return said

    @property
    def origin(self) -> str:
        """Where the modulus comes from, in a line."""
        files = ", ".join(Path(name).name for name in self.test.files)
        count = f", {len(self.lines)} specimens, scatter {self.scatter:.3g} MPa" if len(self.lines) > 1 else ""
        synthetic = "synthetic " if self.reading.synthetic else ""
        return f"{synthetic}tensile test {files}, method {self.test.method}, +- {self.error:.2g} MPa{count}"


def fit_tensile(test: TensileTest) -> Fit:
    """Read a tensile test and fit a line to each specimen.

    Raises ``ConfigError`` for a file that cannot be read or could mean two things, and for a modulus that is not to be believed:
    negative, below a rubber's, above a metal's, or of points that are on no line.
    """
    reading = read_specimens(test)
    lines = [_fit(test, specimen) for specimen in reading.specimens]
    for specimen, line in zip(reading.specimens, lines, strict=True):
        _check(test, specimen, line)
    return Fit(test, reading, lines)


def _fit(test: TensileTest, specimen: Specimen) -> Line:
    x, y = specimen.strain, specimen.stress
    line = None
    if test.method == "paper":
        line = fit_paper(x, y, test.largest_strain)
    elif test.window is not None:
        line = fit_window(x, y, test.window)
    else:
        line = find_line(x, y, test.largest_strain)
    if line is None:
        below = f"strains below tensile_test.largest_strain = {test.largest_strain:g}"
        where = f"strains of the window {test.window}" if test.window else below
        expected = f"three or more points with rising force at {where}; strains are {x.min():.3g} to {x.max():.3g}"
        in_percent = x.max() > 1 and "length" not in specimen.sizes
        example = "units: {strain: '%'}" if in_percent else "largest_strain: 0.1"
        expected += f", in % they would be {x.min() / 100:.3g} to {x.max() / 100:.3g}" if in_percent else ""
        raise ConfigError(specimen.file, f"specimen {specimen.name}", f"{len(x)} points", expected, example)
    return line


def _check(test: TensileTest, specimen: Specimen, line: Line) -> None:
    """Raises ``ConfigError`` where a modulus cannot be right; it says which unit would make it so."""
    where, value = f"specimen {specimen.name}", f"E = {line.modulus:.4g} MPa"
    stress = specimen.stress
    if "force" in specimen.assumed:
        largest = float(np.abs(stress).max()) * _area(test, specimen)
        if largest < _SMALLEST_FORCE:
            expected = f"forces of {_SMALLEST_FORCE:g} N and more where the file names no unit, which units says; "
            expected += f"forces in kN would give {1000 * line.modulus:.4g} MPa"
            raise ConfigError(specimen.file, where, f"{largest:.3g} N at most", expected, "units: {force: kN}")
    if "elongation" in specimen.assumed:
        reach, (low, high) = float(np.ptp(specimen.strain)), _STRAINS_WITHOUT_UNITS
        if not low <= reach <= high:
            likely = "m" if reach < 1 else "um"
            expected = f"strains up to {low:.1%} to {high:.0%} where the file names no unit, which units says; {likely} perhaps"
            raise ConfigError(specimen.file, where, f"strains up to {reach:.3g}", expected, f"units: {{elongation: {likely}}}")
    if line.modulus <= 0:
        expected = "a positive slope; sign turns the forces, window states other strains"
        raise ConfigError(specimen.file, where, value, expected, "sign: turn")
    if line.r_squared < test.smallest_r_squared:
        expected = (
            f"points on a line, R2 of {test.smallest_r_squared:g} or more and not {line.r_squared:.3f} (smallest_r_squared)"
        )
        example = "method: found" if test.method == "paper" else "{method: window, window: [0.01, 0.05]}"
        raise ConfigError(specimen.file, where, value, f"{expected}; method and window say which points are fitted", example)
    low, high = test.modulus_range
    if specimen.assumed and test.modulus_range == PLAUSIBLE_MODULUS:
        low, high = _WITHOUT_UNITS
    if not low <= line.modulus <= high:
        key = "modulus_range says what is believed"
        because = " of a file that names no unit" if (low, high) == _WITHOUT_UNITS else ", between a rubber's and a metal's"
        expected = f"{low:g} to {high:g} MPa{because}; units says which units the file has, {key}"
        raise ConfigError(specimen.file, where, value, f"{expected}{_likely(specimen, line)}", _unit_example(specimen, line))


def _likely(specimen: Specimen, line: Line) -> str:
    """Units that would give a modulus that can be right, in words; strains of an elongation in m would be a thousand times."""
    modulus, reach = line.modulus, float(np.ptp(specimen.strain))
    if modulus < 1:
        return f"; forces in kN would give {1000 * modulus:.4g} MPa"
    if modulus <= 1e4:
        return ""
    found = [f"elongations in m would give {modulus / 1000:.4g} MPa"] if 1000 * reach <= _STRAINS_WITHOUT_UNITS[1] else []
    found += [f"forces in mN {modulus / 1000:.4g} MPa", f"strains in % {modulus / 100:.4g} MPa"]
    return "; " + ", ".join(found)


def _unit_example(specimen: Specimen, line: Line) -> str:
    is_force, is_length = "width" in specimen.sizes, "length" in specimen.sizes
    if line.modulus < PLAUSIBLE_MODULUS[0] or line.modulus < _WITHOUT_UNITS[0]:
        return "units: {force: kN}" if is_force else "units: {stress: GPa}"
    if is_length and 1000 * float(np.ptp(specimen.strain)) <= _STRAINS_WITHOUT_UNITS[1]:
        return "units: {elongation: m}"
    return "units: {force: mN}" if is_force else "units: {stress: kPa}" if is_length else "units: {strain: '%'}"


def _area(test: TensileTest, specimen: Specimen) -> float:
    coupon = test.coupons.get(specimen.name)
    width, thickness = ((coupon and getattr(coupon, k)) or getattr(test, k) for k in ("width", "thickness"))
    return width * thickness


# --------------------------------------------------------------------------------------------------------------------
# what is kept and printed

#: what is kept of the line of each specimen: units and meaning
_OF_LINES = {
    "modulus": ("MPa", "E of a specimen"),
    "error_fit": ("MPa", "standard error of E by the scatter of the points"),
    "error_window": ("MPa", "standard deviation of E over other windows as good"),
    "intercept": ("MPa", "stress of the line at zero strain"),
    "r_squared": ("1", "share of the variance that the line explains"),
    "trend": ("1", "change of the slope over the window, over the slope"),
    "trend_probability": ("1", "probability of such a trend by chance"),
}


def tensile_dataset(fit: Fit) -> xr.Dataset:
    """A tensile test and its fit: nominal stress F / A_0 (MPa) over strain (l - l_0) / l_0, all specimens behind each other."""
    specimens, lines = fit.specimens, fit.lines
    sizes = [len(s.strain) for s in specimens]
    used = np.concatenate([line.used for line in lines]).astype(np.int8)
    number = np.repeat(np.arange(len(sizes)), sizes).astype(np.int32)
    stored = [
        ("stress", "point", np.concatenate([s.stress for s in specimens]), "MPa", "nominal stress, F / A_0"),
        ("fitted", "point", used, "", "whether the fit uses a point"),
        ("specimen_number", "point", number, "", "specimen of a point, from 0"),
        ("youngs_modulus", (), fit.modulus, "MPa", "Young's modulus, E, mean of the specimens"),
        ("youngs_modulus_error", (), fit.error, "MPa", "standard error of E: scatter, fits and choice of windows"),
        ("youngs_modulus_scatter", (), fit.scatter, "MPa", "standard deviation of E between specimens"),
        ("specimen_name", "specimen", np.array([s.name for s in specimens], str), "", "what the file calls a specimen"),
        ("window", ("specimen", "end"), np.array([line.window for line in lines]), "1", "lowest and highest strain of the fit"),
    ]
    for name, (units, long_name) in _OF_LINES.items():
        values = np.array([getattr(line, name) for line in lines], float)
        stored.append((f"specimen_{name}", "specimen", values, units, long_name))
    variables = {n: (d, v, {"units": u, "long_name": t} if u else {"long_name": t}) for n, d, v, u, t in stored}
    strain = np.concatenate([s.strain for s in specimens])
    return xr.Dataset(
        variables,
        coords={"strain": ("point", strain, {"units": "1", "long_name": "nominal strain, (l - l_0) / l_0"})},
        attrs={
            "title": "tensile test of the fabric", "data": ", ".join(fit.test.files), "synthetic": str(fit.reading.synthetic),
            "method": fit.test.method, "origin": fit.origin, "understood": "\n".join(fit.reading.understood),
            "notes": "\n".join(fit.notes),
        },
    )  # fmt: skip


def specimen_table(fit: Fit) -> pd.DataFrame:
    """A row a specimen and one for their mean: E and its errors (MPa), the window (strains), points, R2, trend of the slope."""
    rows = [
        {
            "specimen": specimen.name, "youngs_modulus [MPa]": line.modulus, "error [MPa]": line.error,
            "error_fit [MPa]": line.error_fit, "error_window [MPa]": line.error_window, "window_from": line.window[0],
            "window_to": line.window[1], "points": line.points, "r_squared": line.r_squared, "trend": line.trend,
            "trend_probability": line.trend_probability,
        }
        for specimen, line in zip(fit.specimens, fit.lines, strict=True)
    ]  # fmt: skip
    if len(rows) > 1:
        rows.append(
            {"specimen": "mean", "youngs_modulus [MPa]": fit.modulus, "error [MPa]": fit.error, "scatter [MPa]": fit.scatter}
        )
    return pd.DataFrame(rows)


def report(fit: Fit) -> str:
    """What was understood, a line a specimen with its fit, the mean, and what a reader must know."""
    rows = [
        {
            "specimen": specimen.name,
            "E [MPa]": with_error(line.modulus, line.error),
            "by fit": f"{line.error_fit:.2g}",
            "by window": f"{line.error_window:.2g}",
            "strains of the fit": f"{line.window[0]:.2%} to {line.window[1]:.2%}",
            "points": f"{line.points} of {len(specimen.strain)}",
            "R2": f"{line.r_squared:.5f}",
            "slope changes": f"{line.trend:+.1%}",
        }
        for specimen, line in zip(fit.specimens, fit.lines, strict=True)
    ]
    mean = f"E = {with_error(fit.modulus, fit.error)} MPa"
    if len(fit.lines) > 1:
        mean += (
            f", mean of {len(fit.lines)} specimens, scatter between them {fit.scatter:.3g} MPa ({fit.scatter / fit.modulus:.1%})"
        )
    table = pd.DataFrame(rows).to_string(index=False)
    return "\n".join([*fit.reading.understood, _sizes(fit), "", table, "", mean, *(f"note: {note}" for note in fit.notes)])


def _sizes(fit: Fit) -> str:
    used = {size for s in fit.specimens for size in s.sizes}
    if not used:
        return "coupon: its size is not needed for strains and stresses"
    stated, sizes = fit.test.model_fields_set, [size for size in SIZES if size in used]
    parts = [f"{size} {getattr(fit.test, size):g} mm" + ("" if size in stated else " (default)") for size in sizes]
    own = f"; {', '.join(fit.test.coupons)} of their own" if fit.test.coupons else ""
    return f"coupon: {', '.join(parts)}{own}; method {fit.test.method}"


def with_error(value: float, error: float) -> str:
    """A number with as many digits as its error allows: two digits of that, 0.01 at most."""
    digits = int(np.clip(1 - np.floor(np.log10(error)), 0, 2)) if error > 0 else 2
    return f"{value:.{digits}f} +- {error:.{digits}f}"


def to_plain(fit: Fit) -> dict[str, Any]:
    """The same for machines: moduli in MPa, strains as shares."""
    return {
        "youngs_modulus": fit.modulus,
        "youngs_modulus_error": fit.error,
        "scatter": None if len(fit.lines) < 2 else fit.scatter,
        "units": "MPa",
        "method": fit.test.method,
        "origin": fit.origin,
        "files": fit.test.files,
        "specimens": [
            {
                "name": specimen.name, "file": specimen.file, "youngs_modulus": line.modulus, "error": line.error,
                "error_fit": line.error_fit, "error_window": line.error_window, "intercept": line.intercept,
                "window": list(line.window), "points": line.points, "r_squared": line.r_squared, "trend": line.trend,
                "trend_probability": line.trend_probability,
            }
            for specimen, line in zip(fit.specimens, fit.lines, strict=True)
        ],
        "understood": fit.reading.understood,
        "notes": fit.notes,
    }  # fmt: skip


def to_json(fit: Fit, **more: Any) -> str:
    """``to_plain`` as text."""
    return json.dumps(to_plain(fit) | more, indent=2)
