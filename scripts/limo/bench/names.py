"""Which quantity a column's name means, in the words that machines and people use."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from limo.bench import units


@dataclass(frozen=True)
class Meaning:
    """What a name may mean: a quantity for each kind of unit that decides it, and one where there is no unit.

    ``rest``: the words that say which specimen it is. ``unit``: the one within the name, or "".
    """

    by_kind: Mapping[str, str]
    default: str
    rest: str
    unit: str

    def quantity(self, unit: str) -> str:
        """The quantity of a column in a unit; "" where the unit is of none that the name may mean."""
        if not unit:
            return self.default
        return next((q for kind, q in self.by_kind.items() if units.is_unit(unit, kind)), "")


@dataclass(frozen=True)
class Vocabulary:
    """The quantities of a kind of file.

    ``kinds``: kind of the unit of each quantity, of ``units.WANTED``, or ``text``, or "" for a count. ``meaning``: what the
    words of a name mean: quantities by kind of unit, the one without a unit, and the words that are left; or None.
    ``assumed``: quantities whose own name without a unit means the wanted one.
    """

    kinds: Mapping[str, str]
    meaning: Callable[[str], tuple[Mapping[str, str], str, str] | None]
    assumed: tuple[str, ...]
    example: str


#: units that behind a name without brackets are rather the name of a specimen
_NO_SUFFIX = {*"0123456789ABCDEFGHIJKMOPQRSTUVWXYZ", *"abcdefhijknopqrtuvwxyz", "-", "--"}
_BRACKETS = re.compile(r"[(\[{<]([^()\[\]{}<>]*)[)\]}>]")


def plain(text: str) -> str:
    """A name in small letters, its words divided by single blanks; Greek letters as words."""
    text = unicodedata.normalize("NFKC", text)
    text = re.sub(r"(?<=[a-z])(?=[A-Z][a-z])", " ", text)
    text = re.sub(r"[∆Δ]|\bdelta\b", " delta ", text, flags=re.IGNORECASE).replace("ε", " strain ").replace("σ", " stress ")
    text = text.replace("η", " efficiency ")
    return re.sub(r"[^\w%#]+|_", " ", text.casefold()).strip()


def understand(name: str, vocabulary: Vocabulary) -> Meaning | None:
    """What a column's name means; None where no word of it says so, or several say different things."""
    brackets = _BRACKETS.findall(name)
    base = _BRACKETS.sub(" ", name).strip()
    found = vocabulary.meaning(plain(base)) or vocabulary.meaning(plain(name))
    unit = next((b for b in reversed(brackets) if units.is_any_unit(b) or (found and _fits(b, found[0], listed=False))), "")
    if not unit:
        for cut in _cuts(base):
            meant = vocabulary.meaning(plain(cut[0]))
            if meant and cut[1] not in _NO_SUFFIX and _fits(cut[1], meant[0], listed=True):
                found, unit = meant, cut[1]
                break
    if found is None:
        return None
    return Meaning(found[0], found[1], _as_written(found[2], base), unit)


def _as_written(rest: str, name: str) -> str:
    """The words that are left of a name as it has them; of one that stands there twice the last: names of devices do."""
    left, written = rest.split(), []
    for word in reversed(re.findall(r"[^\W_]+", name)):
        if word.casefold() in left:
            left.remove(word.casefold())
            written.insert(0, word)
    return " ".join(written) or rest


def _fits(text: str, by_kind: Mapping[str, str], *, listed: bool) -> bool:
    return any(kind in units.WANTED and units.is_unit(text, kind, listed=listed) for kind in by_kind)


def _cuts(name: str) -> list[tuple[str, str]]:
    """A name before and after what may stand before its unit: / , in, a blank, an underscore."""
    places = [m.span() for m in re.finditer(r"\s*/\s*|\s*[,;:]\s*|\s+in\s+|\s+|_|\.(?=[A-Za-z%])", name)]
    return [(name[:a], name[b:]) for a, b in places if name[:a].strip() and name[b:].strip()]


# --------------------------------------------------------------------------------------------------------------------
# tensile tests

_NOT = (
    r"\b(true|wahre?|max|maximum|peak|rate|speed|velocity|set ?point|target|command|soll\w*|modulus|energy|work|ratio|temp\w*)\b"
)
_PULL = {
    "how far": r"(elongation|extension|displacements?|displ?|stroke|cross ?head|traverse|travel|position|deformation|\w*weg|"
    r"verlängerung|längenänderung|allongement|déplacement|course|alargamiento|desplazamiento|allungamento|spostamento|"
    r"extensometer|ext|delta l|dl)",
    "strain": r"(strain|dehnung|epsilon|eps|déformation|deformación)",
    "force": r"(force|load|\w*kraft|last|effort|charge|fuerza|carga|forza|carico|f)",
    "stress": r"(stress|\w*spannung|contrainte|tensión|sforzo|sigma)",
    "time": r"(time|\w*zeit|temps|tiempo|tempo|t)",
    "specimen": r"(specimens?|samples?|coupon|strip|probe|probekörper|prüfkörper|éprouvette|muestra|test ?piece|name|label|id)",
}
_ORDER = (("how far", "strain"), ("force", "stress"), ("time",), ("specimen",))
_FAR, _HARD = {"length": "elongation", "strain": "strain"}, {"force": "force", "stress": "stress"}
_BY_GROUP = {
    "how far": (_FAR, "elongation"), "strain": (_FAR, "strain"), "force": (_HARD, "force"), "stress": (_HARD, "stress"),
    "time": ({"time": "time"}, "time"), "specimen": ({}, "specimen"),
}  # fmt: skip


def _tensile(text: str) -> tuple[Mapping[str, str], str, str] | None:
    if not text or re.search(_NOT, text):
        return None
    hits = {group: re.findall(rf"(?<!\w){words}(?:\s?\d+)?(?!\w)", text) for group, words in _PULL.items()}
    found = [[g for g in pair if hits[g]] for pair in _ORDER]
    pulled = [groups for groups in found[:2] if groups]
    if len(pulled) > 1:
        return None
    chosen = (pulled or [groups for groups in found[2:] if groups] or [[]])[0]
    if not chosen:
        return None
    group = chosen[-1]
    by_kind, default = _BY_GROUP[group]
    rest = text
    for known in chosen:
        rest = re.sub(rf"(?<!\w){_PULL[known]}(?=\s?\d*(?!\w))", " ", rest)
    return by_kind, default, " ".join(rest.split())


TENSILE = Vocabulary(
    kinds={"elongation": "length", "force": "force", "strain": "strain", "stress": "stress", "time": "time", "specimen": "text"},
    meaning=_tensile,
    assumed=("elongation", "force", "time"),
    example="columns: {elongation: 1, force: 2}",
)


# --------------------------------------------------------------------------------------------------------------------
# measured curves

# letters of symbols such as P_a and V_v; an A or a V elsewhere is rather the name of a device
_POUCHES_LETTER, _VENTRICLE_LETTER = (rf"(?<=\bp ){letter}|(?<=\bv ){letter}|(?<=\bdv ){letter}" for letter in "av")
_OF_POUCHES = rf"(actuat\w*|pouch|pouches|inflation|inflate\w*|air|input|in|supply|{_POUCHES_LETTER}|pa|va|dva)"
_OF_VENTRICLE = rf"(ventric\w*|stroke|output|out|chamber|eject\w*|heart|after ?load|{_VENTRICLE_LETTER}|pv|vv|dvv|sv)"
_CHANGED = r"(delta|changes?|dva|dvv|dv|d|stroke|output|out|eject\w*|sv)"
_PRESSURE, _VOLUME = r"(pressure|press|druck|p|pa|pv|after ?load)", r"(volume|vol|volumen|va|vv|dva|dvv|dv|v|sv|stroke)"
_OTHERS = {
    "n_pouches": r"(n ?p|n ?pouches|number of pouches|no of pouches|pouches)",
    "efficiency": r"(efficienc\w*|eta)",
    "time": r"(time|zeit|temps|t)",
    "cycle": r"(cycles?|loops?|zyklus)",
    "direction": r"(direction|phase|branch|loading|richtung)",
    "label": r"(label|name|device|bag|sample|specimen|id|curve|series)",
}
_KINDS = {"n_pouches": "", "efficiency": "strain", "time": "time", "cycle": "", "direction": "text", "label": "text"}


def _has(words: str, text: str) -> bool:
    return re.search(rf"\b{words}\b", text) is not None


def _curves(text: str) -> tuple[Mapping[str, str], str, str] | None:
    if not text or re.search(r"\b(rate|flow|max|maximum|set ?point|target|command|temp\w*)\b", text):
        return None
    pressure, volume = _has(_PRESSURE, text), _has(_VOLUME, text)
    if _has(_OTHERS["n_pouches"], text) and not re.search(r"\b(pressure|volume|vol)\b", text):
        pressure = volume = False
    if pressure and volume:  # words before letters; P_v is a pressure, V_a a volume: what stands first says which
        words = re.findall(r"\b(pressure|volume|vol)\b", text)
        pressure = words[-1] == "pressure" if words else text[0] == "p"
        volume = not pressure
    if pressure or volume:
        return _pressure_or_volume(text, pressure)
    for name, words in _OTHERS.items():
        if _has(words, text):
            kind = _KINDS[name]
            return ({kind: name} if kind in units.WANTED else {}), name, ""
    return None


def _pressure_or_volume(text: str, is_pressure: bool) -> tuple[Mapping[str, str], str, str] | None:
    """Which of them it is, of the pouches or of the ventricle, and absolute or as a change."""
    ventricle, pouches = _has(_OF_VENTRICLE, text), _has(_OF_POUCHES, text)
    begins = ("(ventric|stroke|output|out|eject|heart|chamber)", "(actuat|pouch|inflat|air|in)")
    words = [re.search(rf"\b{w}\w*", text) is not None for w in begins]
    if ventricle and pouches:  # words before letters again
        ventricle, pouches = words if any(words) else (_has("(p|v) ?v", text), _has("(p|v) ?a", text))
        if ventricle == pouches:
            return None
    if is_pressure:
        name = "ventricular_pressure" if ventricle else "actuation_pressure"
    elif pouches:
        name = "actuation_volume_change" if _has(_CHANGED, text) else "actuation_volume"
    elif ventricle:
        name = "stroke_volume" if _has(_CHANGED, text) else "ventricle_volume"
    else:
        return None
    known = rf"{_PRESSURE}|{_VOLUME}|{_OF_POUCHES}|{_OF_VENTRICLE}|{_CHANGED}|of|the"
    without_symbols = re.sub(r"\b(p|v|dv) [av]\b", " ", text)
    rest = " ".join(w for w in without_symbols.split() if not re.fullmatch(known, w) or (any(words) and len(w) == 1))
    return {"pressure" if is_pressure else "volume": name}, name, rest


CURVES = Vocabulary(
    kinds={
        "actuation_pressure": "pressure", "ventricular_pressure": "pressure", "actuation_volume_change": "volume",
        "stroke_volume": "volume", "actuation_volume": "volume", "ventricle_volume": "volume", **_KINDS,
    },
    meaning=_curves,
    assumed=(
        "actuation_pressure", "ventricular_pressure", "actuation_volume_change", "stroke_volume", "actuation_volume",
        "ventricle_volume", "time",
    ),
    example="columns: {actuation_pressure: 1, stroke_volume: 2}",
)  # fmt: skip
