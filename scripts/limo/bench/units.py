"""Units as laboratories write them. Only this module and circulations (``schema.beat``) know pint, and load it when needed."""

from __future__ import annotations

import re
import unicodedata
from functools import cache

#: what every quantity is turned into, by its kind
WANTED = {"length": "mm", "force": "N", "stress": "MPa", "pressure": "kPa", "volume": "ml", "strain": "1", "time": "s"}

#: spellings by kind: those of one unit behind its name in pint; case does not count where only one unit is meant
_SPELLINGS = {
    "length": {
        "mm": "mm millimeter millimeters millimetre millimetres",
        "cm": "cm centimeter centimeters centimetre centimetres",
        "m": "m meter meters metre metres",
        "micrometer": "um micron microns micrometer micrometre",
        "inch": 'in inch inches in. "',
        "foot": "ft foot feet",
        "thou": "mil mils thou",
    },
    "force": {
        "N": "N newton newtons",
        "kN": "kN kilonewton kilonewtons",
        "mN": "mN millinewton",
        "cN": "cN centinewton",
        "daN": "daN dekanewton",
        "lbf": "lbf lb lbs lbf. lb. pound pounds pound-force poundforce poundsforce lb-f lb_f",
        "kip": "kip kips klbf",
        "kgf": "kgf kg kp kg-f kg_f",
        "gf": "gf g g-f gram grams pond",
        "ounce * g_0": "ozf oz",
    },
    "stress": {
        "MPa": "MPa N/mm2 N/mm^2 N/mm**2 Nmm-2 N*mm-2 megapascal",
        "kPa": "kPa kN/m2 kN/m^2",
        "Pa": "Pa N/m2 N/m^2",
        "GPa": "GPa kN/mm2 kN/mm^2",
        "psi": "psi lbf/in2 lbf/in^2 lb/in2",
        "ksi": "ksi",
        "bar": "bar",
        "kgf / cm**2": "kgf/cm2 kg/cm2 kgf/cm^2 kg/cm^2 at",
    },
    "pressure": {
        "kPa": "kPa kPag kilopascal",
        "Pa": "Pa pascal N/m2",
        "hPa": "hPa",
        "MPa": "MPa N/mm2",
        "mbar": "mbar millibar mbarg",
        "bar": "bar barg bars",
        "psi": "psi psig lbf/in2",
        "mmHg": "mmHg torr mm_Hg mm-Hg",
        "inHg": "inHg",
        "cmH2O": "cmH2O cmwater cmWS cm_H2O cm-H2O",
        "mmH2O": "mmH2O mmWS",
        "inH2O": "inH2O",
        "atm": "atm",
        "kgf / cm**2": "at kgf/cm2 kg/cm2",
    },
    "volume": {
        "ml": "ml cc ccm cm3 cm^3 cm**3 milliliter milliliters millilitre millilitres",
        "l": "l liter liters litre litres dm3 dm^3",
        "dl": "dl",
        "cl": "cl",
        "microliter": "ul mm3 mm^3 microliter",
        "m**3": "m3 m^3",
        "inch**3": "in3 in^3 cuin cu.in. cu.in",
        "fluid_ounce": "oz fl.oz. fl.oz floz fl_oz oz. fluidounce",
        "gallon": "gal gallon gallons",
        "pint": "pt pint pints",
    },
    "strain": {
        "1": "1 - -- mm/mm in/in m/m n/a none ratio abs abs. absolute",
        "0.01": "% percent pct per_cent percentage",
        "1e-3": "permille permil",
        "1e-6": "microstrain ustrain ue um/m",
    },
    "time": {
        "s": "s sec secs second seconds",
        "ms": "ms msec millisecond milliseconds",
        "minute": "min mins minute minutes",
        "hour": "h hr hrs hour hours",
    },
}


def tidy(text: str) -> str:
    """A unit without what is only typography: widths of characters, brackets, blanks, superscripts."""
    text = unicodedata.normalize("NFKC", text.replace("‰", "permille"))
    text = text.replace("\u03bc", "u").replace("ε", "e").replace("·", "*").replace("⋅", "*").replace("′′", '"').replace("″", '"')
    text = re.sub(r"\s+", "", text)
    while len(text) > 1 and (text[0], text[-1]) in {("(", ")"), ("[", "]"), ("{", "}"), ("<", ">")}:
        text = text[1:-1]
    return text


@cache
def _table(kind: str) -> tuple[dict[str, str], dict[str, str | None]]:
    """Names in pint by spelling, exactly and whatever the case; None where the case tells two units apart."""
    exact, loose = {}, {}
    for name, spellings in _SPELLINGS[kind].items():
        for spelling in spellings.split():
            exact[spelling] = name
            low = spelling.casefold()
            loose[low] = name if loose.get(low, name) == name else None
    return exact, loose


#: spellings whose case alone tells a thousandth from a thousand or a million: no guess is made
_BY_CASE = ("mn", "mpa")


@cache
def name_in_pint(text: str, kind: str, *, listed: bool = False) -> str | None:
    """What pint calls a unit of a kind as someone wrote it; None where it is none, or may be two.

    ``listed``: only spellings that are listed here count, not all that pint knows, to which ``point`` is a length.
    """
    text = tidy(text)
    if not text:
        return None
    exact, loose = _table(kind)
    if text in exact:
        return exact[text]
    low = text.casefold()
    if low == "mpa" and text in ("MPA", "Mpa"):
        return "MPa" if low in loose else None
    if loose.get(low) and low not in _BY_CASE:
        return loose[low]
    return text if not listed and _of_kind(text, kind) else None


def is_unit(text: str, kind: str, *, listed: bool = False) -> bool:
    """Whether a text is a unit of a kind (``name_in_pint``)."""
    return name_in_pint(text, kind, listed=listed) is not None


@cache
def is_any_unit(text: str) -> bool:
    """Whether a text is a listed unit of any kind."""
    return any(name_in_pint(text, kind, listed=True) for kind in _SPELLINGS)


@cache
def factor(text: str, kind: str) -> float:
    """By which a number in a unit is multiplied to have the wanted unit of its kind (``WANTED``).

    Raises ``ValueError`` for what is no unit of the kind.
    """
    name, wanted = name_in_pint(text, kind), WANTED[kind]
    if name is None:
        raise ValueError(f"{text!r} is no unit of {kind}, such as {wanted}")
    if name == wanted:
        return 1.0
    if re.fullmatch(r"[\d.e-]+", name):  # of strain
        return float(name)
    return float(_registry().Quantity(1.0, _written(name)).to("dimensionless" if wanted == "1" else wanted).magnitude)


@cache
def _registry():
    import pint

    return pint.UnitRegistry()


def _written(text: str) -> str:
    """A unit with its exponents as pint writes them: mm2 -> mm**2."""
    return re.sub(r"(?<=[A-Za-z])([23])(?![\w])", r"**\1", text)


def _of_kind(text: str, kind: str) -> bool:
    """Whether pint takes a text for a unit of a kind."""
    if not re.fullmatch(r"[A-Za-z%][\w%*/^.-]{0,30}", text):
        return False
    wanted = "" if WANTED[kind] == "1" else WANTED[kind]
    try:
        one = _registry().Quantity(1.0, _written(text))
        return bool(one.check(_registry().Quantity(1.0, wanted).dimensionality))
    except Exception:  # pint raises whatever its parser met: it is no unit then
        return False
