"""Which column of a bench may be which, by its name: what a draft proposes, and what it leaves to the reader."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from rverror.base.text import shown
from rverror.runs.bench.columns import Entry
from rverror.runs.bench.unit_words import COUNTS, meant_unit, unit_scale
from rverror.runs.reading import COLUMNS

#: Words of a name that tell a column, German compounds such as Antriebswinkel among them.
_SIDES = {
    "input_angle": r"antrieb.*|eingang.*|input.*|motor.*|moteur.*|entr[ée]e.*|输入.*|电机.*|in|an|ein|drive|mot|1",
    "output_angle": r"abtrieb.*|ausgang.*|output.*|sortie.*|输出.*|out|ab|aus|load|joint|2",
    "time": r"zeit.*|uhr.*|time.*|temps.*|时间.*|t",
}
#: Words of a shaft that mean its angle where nothing else is said; a motor's column may be a current, a load a torque.
_PLAIN = re.compile(r"(an|ab)trieb.*|(ein|aus)gang.*|(in|out)(put.*)?|entr[ée]e.*|sortie.*|输入.*|输出.*")
_ANGLE = re.compile(r"(angle|theta|phi|alpha|pos|enc|[θφϕα]).*|.*(winkel|角).*")
#: Of columns that name a shaft, as angles do, but hold something else.
_OTHER = re.compile(
    r"torque|moment|couple|speed|drehzahl|geschw|beschl|vel|accel|freq|current|strom|volt|temp|power|force|kraft|last"
    r"|error|fehler|[扭转]矩|速|电流"
)
_WORD = re.compile(r"[^\W\d_]+|\d+")
_HUMP = re.compile(r"(?<=[a-zäöüß])(?=[A-ZÄÖÜ])")
_BRACKETS = re.compile(r"[\[(][^\[\]()]*[\])]")
_USUAL = {"angle": ("deg", "rad", "turn", "arcmin", "arcsec"), "time": ("s", "ms")}


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
        return f"guessed from the name {names}, {told}"


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
    found: dict[str, list[Entry]] = {key: [] for key in _SIDES}
    for entry in entries:
        words = _words(entry.name)
        sides = [key for key, pattern in _SIDES.items() if any(re.fullmatch(pattern, word) for word in words)]
        if len(sides) == 1 and not entry.problem and _may_be(COLUMNS[sides[0]], entry):
            found[sides[0]].append(entry)
    return {key: _guess(fitting, COLUMNS[key]) for key, fitting in found.items()}


def _guess(fitting: Sequence[Entry], dimension: str) -> Guess:
    if dimension == "angle":  # where some names say that they are angles, a shaft's name alone says less
        said = [entry for entry in fitting if unit_of(entry, "angle") or _says(_ANGLE, entry)]
        fitting = said or [entry for entry in fitting if _says(_PLAIN, entry)]
    return Guess(fitting=tuple(fitting), unit=unit_of(fitting[0], dimension) if len(fitting) == 1 else "")


def _says(pattern: re.Pattern[str], entry: Entry) -> bool:
    return any(map(pattern.fullmatch, _words(entry.name)))


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
    word = entry.unit or " ".join(_words(entry.name)[1:][-1:])
    if dimension == "angle" and word in COUNTS:
        return COUNTS[0]
    try:
        scale = unit_scale(meant_unit(word), dimension)
    except ValueError:
        return ""
    return next((known for known in _USUAL[dimension] if unit_scale(known, dimension) == scale), meant_unit(word))
