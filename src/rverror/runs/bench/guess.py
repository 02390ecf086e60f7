"""Which column of a bench may be which, by its name: what a draft proposes, and what it leaves to the reader."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from rverror.base.text import shown
from rverror.runs.bench.columns import Entry
from rverror.runs.bench.unit_words import COUNTS, meant_unit, unit_scale
from rverror.runs.reading import COLUMNS

# Beginnings of words, German compounds such as Antriebswinkel among them, and whole words.
_BEGINNINGS = {
    "input_angle": ("antrieb", "eingang", "input", "motor", "moteur", "entrée", "entree", "输入", "电机"),
    "output_angle": ("abtrieb", "ausgang", "output", "sortie", "输出"),
    "time": ("zeit", "uhr", "time", "temps", "时间"),
}
_WHOLE = {
    "input_angle": ("in", "an", "ein", "drive", "mot"),
    "output_angle": ("out", "ab", "aus", "load", "joint"),
    "time": ("t",),
}
#: Words that mean an angle where nothing else is said; a motor's column may be a current, a load a torque.
_PLAIN = ("antrieb", "abtrieb", "eingang", "ausgang", "input", "output", "entrée", "entree", "sortie", "输入", "输出")
_NUMBERED = {"input_angle": "1", "output_angle": "2"}
_ANGLE = re.compile(r"(angle|theta|phi|alpha|pos|enc|[θφϕα]|.*winkel|.*角)")
#: Of columns that name a shaft, as angles do, but hold something else.
_OTHER = re.compile(
    r"torque|moment|couple|speed|drehzahl|geschw|beschl|vel|accel|freq|current|strom|volt|temp|power|force|kraft|last"
    r"|error|fehler|[扭转]矩|速|电流"
)
_WORD = re.compile(r"[^\W\d_]+|\d+")
_HUMP = re.compile(r"(?<=[a-zäöüß])(?=[A-ZÄÖÜ])")
_BRACKETS = re.compile(r"[\[(][^\[\]()]*[\])]")


@dataclass(frozen=True, kw_only=True)
class Guess:
    """What the names of the columns say of one column of a run.

    Attributes
    ----------
    fitting : tuple of Entry
        Columns whose names fit; one is a guess, several are a question.
    unit : str
        In the mapping's words, of the only one; empty where its name does not say it.
    """

    fitting: tuple[Entry, ...] = ()
    unit: str = ""

    def __str__(self) -> str:
        """In words, for whoever has to confirm it."""
        names = " and ".join(shown(entry.name, 60) for entry in self.fitting[:4])
        if len(self.fitting) > 1:
            return f"not guessed, for {names} fit alike"
        told = f"unit {self.unit}" if self.unit else "its unit is not told"
        return f"guessed from the name {names}, {told}" if self.fitting else "no name fits"


def guesses(entries: Sequence[Entry]) -> dict[str, Guess]:
    """Columns that may be input angle, output angle and time, by their names and units.

    Parameters
    ----------
    entries : sequence of Entry
        As the file lists them.

    Returns
    -------
    dict of str to Guess
        For ``input_angle``, ``output_angle`` and ``time``.

    Examples
    --------
    >>> found = guesses([Entry(name="Antrieb [°]", unit="°"), Entry(name="phi_out_rad")])
    >>> str(found["input_angle"]), str(found["output_angle"])
    ("guessed from the name 'Antrieb [°]', unit deg", "guessed from the name 'phi_out_rad', unit rad")
    """
    usable = [entry for entry in entries if not entry.problem]
    return {key: _guess(key, usable) for key in _BEGINNINGS}


def _guess(key: str, entries: Sequence[Entry]) -> Guess:
    fitting = [entry for entry in entries if _side(entry) == key and _may_be(COLUMNS[key], entry)]
    if COLUMNS[key] == "angle":  # where some names say that they are angles, a shaft's name alone says less
        said = [entry for entry in fitting if unit_of(entry, "angle") or _is_angle(entry)]
        fitting = said or [entry for entry in fitting if any(map(_is_plain, _words(entry.name)))]
    return Guess(fitting=tuple(fitting), unit=unit_of(fitting[0], COLUMNS[key]) if len(fitting) == 1 else "")


def _side(entry: Entry) -> str:
    """The column that words of a name mean; empty where none does, or they contradict one another."""
    words = _words(entry.name)
    found = {key for key in _BEGINNINGS for word in words if word.startswith(_BEGINNINGS[key]) or word in _WHOLE[key]}
    if not found and _is_angle(entry):
        numbers = [word for word in words if word.isdigit()]
        found = {key for key, number in _NUMBERED.items() if numbers == [number]}
    return found.pop() if len(found) == 1 else ""


def _is_angle(entry: Entry) -> bool:
    return any(map(_ANGLE.match, _words(entry.name)))


def _is_plain(word: str) -> bool:
    return word.startswith(_PLAIN) or word in ("in", "out")


def _words(name: str) -> list[str]:
    """Words of a name in lower case, groups before it included, its unit in brackets left out."""
    return [word.lower() for word in _WORD.findall(_HUMP.sub(" ", _BRACKETS.sub(" ", name)))]


def _may_be(dimension: str, entry: Entry) -> bool:
    if unit_of(entry, dimension):
        return True
    return not entry.unit and not _OTHER.search(entry.name.lower())


def unit_of(entry: Entry, dimension: str) -> str:
    """Unit of a column in the mapping's words, from its brackets, its attribute or the last word of its name.

    Examples
    --------
    >>> unit_of(Entry(name="Winkel", unit="°"), "angle"), unit_of(Entry(name="theta1_deg"), "angle")
    ('deg', 'deg')
    """
    words = [entry.unit] if entry.unit else _words(entry.name)[1:][-1:]
    for word in words:
        if dimension == "angle" and word in COUNTS:
            return COUNTS[0]
        try:
            scale = unit_scale(meant_unit(word), dimension)
        except ValueError:
            continue
        return next((known for known in _USUAL[dimension] if unit_scale(known, dimension) == scale), meant_unit(word))
    return ""


_USUAL = {"angle": ("deg", "rad", "turn", "arcmin", "arcsec"), "time": ("s", "ms")}
