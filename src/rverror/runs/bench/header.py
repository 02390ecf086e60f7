"""Direction, torque, temperature and index of a bench's run: stated by the mapping, or standing in the file."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.text import did_you_mean, shown
from rverror.runs.bench.columns import BenchFile, Entry
from rverror.runs.bench.mapping import BenchMapping, HeaderRule
from rverror.runs.reading import HEADER_KEYS, ORDER_CONDITIONS, STATED, Header, checked_value

_MOST_LISTED = 8


def read_header(
    file: BenchFile, mapping: BenchMapping, measured: Mapping[str, tuple[Entry, Array]], notes: list[str]
) -> Header:
    """Header of a run: from the mapping, or from a file that names it as a run file does.

    Parameters
    ----------
    measured : mapping of str to (Entry, ndarray)
        Columns whose mean is meant, in their own unit, by key of the header.
    notes : list of str
        Gets what was made of them.

    Raises
    ------
    InputError
        If a value is missing, has no unit or is none.
    """
    texts, places = header_texts(file, mapping, measured, notes)
    direction = texts.get("direction", "").lower()
    if "direction" in texts and direction not in STATED:
        file.refuse(
            f"{places['direction']}: direction = {shown(texts['direction'])}: must be forward, reverse or mixed; "
            "without it the angles tell"
        )
    return Header(
        stated=STATED[direction] if direction else None,
        stated_at=f"{places['direction']}: " if direction else "",
        torque=header_quantity(file, "output_torque", texts, places),
        temperature=header_quantity(file, "temperature", texts, places),
        index=texts.get("index", ""),
        metadata=texts,
    )


def header_texts(
    file: BenchFile,
    mapping: BenchMapping,
    measured: Mapping[str, tuple[Entry, Array]],
    notes: list[str],
) -> tuple[dict[str, str], dict[str, str]]:
    """Values of the header as text, and the place that says each, by key.

    Parameters
    ----------
    measured : mapping of str to (Entry, ndarray)
        Columns whose mean is meant.
    notes : list of str
        Gets what was made of them.

    Raises
    ------
    InputError
        If a value is missing.
    """
    texts: dict[str, str] = {}
    places: dict[str, str] = {}
    # Lines of a file whose columns have names of its own may say "Direction: CW" or "Index: 3": only a mapping tells.
    own = (
        {}
        if mapping.columns or mapping.orders.columns
        else {key.lower(): value for key, value in file.properties.items()}
    )
    for key in dict.fromkeys((*HEADER_KEYS, *mapping.header)):
        rule = mapping.header.get(key)
        if rule is None:
            if key in own:
                texts[key], places[key] = own[key], f"{key} in the file"
            continue
        places[key] = rule.where.stated_at
        if key in measured:
            texts[key] = _mean(file, key, rule, *measured[key], notes)
        else:
            texts[key] = rule.text or _property(file, key, rule)
    return texts, places


def header_quantity(file: BenchFile, key: str, texts: Mapping[str, str], places: Mapping[str, str]) -> float | None:
    """Value of a condition in its core unit; None where the header has none.

    Raises
    ------
    InputError
        If it has no unit or is none.
    """
    if key not in texts:
        return None
    dimension = ORDER_CONDITIONS[key]
    try:
        number = units.parse(texts[key], dimension)
    except ValueError as error:
        file.refuse(f"{places[key]}: {key}: {str(error).partition(';')[0]}; state {key} in [header] of a mapping")
    return checked_value(file.path, f"{places[key]}: {key}", number, dimension)


def _property(file: BenchFile, key: str, rule: HeaderRule) -> str:
    """Text of a property, with the mapping's unit where it has none."""
    name, at = rule.where.property, rule.where.stated_at
    if name not in file.properties:
        hint = did_you_mean(name, list(file.properties))
        listed = ", ".join(shown(each, 60) for each in list(file.properties)[:_MOST_LISTED]) or "none"
        file.refuse(f"there is no property {shown(name, 60)} ({at});{hint} the file has {listed}")
    text = file.properties[name]
    if rule.words:
        if text.strip().lower() not in rule.words:
            file.refuse(f"{key}: the property {shown(name, 60)} is {shown(text)}, {unknown_word(rule.words, at)}")
        return rule.words[text.strip().lower()]
    number, _, word = text.partition(" ")
    value = file.parse(number)
    if value is None or key not in ORDER_CONDITIONS:
        return text
    unit = word.strip() or rule.unit
    if rule.unit and word.strip() and not _same_unit(word.strip(), rule.unit, ORDER_CONDITIONS[key]):
        file.refuse(
            f"{key}: the property {shown(name, 60)} is {shown(text)}, the mapping says {rule.unit} ({at}); leave unit "
            "out, or correct it"
        )
    return f"{value!r} {rule.unit or unit}".strip()


def unknown_word(words: Mapping[str, str], at: str) -> str:
    """What a word that means no direction ought to be, for messages.

    Examples
    --------
    >>> unknown_word({"cw": "forward", "ccw": "reverse"}, "mapping bench.toml, line 3")
    "must be 'cw' or 'ccw' (mapping bench.toml, line 3); correct the words there"
    """
    return f"must be {' or '.join(shown(word) for word in words)}{f' ({at})' if at else ''}; correct the words there"


def _same_unit(one: str, other: str, dimension: str) -> bool:
    try:
        return units.parse(f"1 {one}", dimension) == units.parse(f"1 {other}", dimension)
    except ValueError:  # of a word that pint does not know, such as Nm, only the letters tell
        return one.replace(" ", "").replace("·", "") == other.replace(" ", "").replace("*", "")


def _mean(file: BenchFile, key: str, rule: HeaderRule, entry: Entry, samples: Array, notes: list[str]) -> str:
    """Mean of a measured column, with its unit."""
    what = f"{key} ({shown(entry.name, 60)})"
    valid = samples[np.isfinite(samples)]
    unit = rule.unit or entry.unit
    if not unit:
        file.refuse(f"{what} has no unit ({rule.where.stated_at}); write unit = ... beside its name")
    if not valid.size:
        file.refuse(f"{what} holds no number; choose another column, or state a value in [header]")
    mean = float(np.mean(valid))
    if key == "output_torque" and abs(mean) < 0.5 * float(np.mean(np.abs(valid))):
        file.refuse(
            f"{what} changes its sign ({valid.min():.4g} to {valid.max():.4g} {unit}), so its mean is no load; state a "
            "value in [header], or split the run"
        )
    notes.append(f"{key} is the mean of {shown(entry.name, 60)}: {mean:.6g}, from {valid.min():.6g} to "
                 f"{valid.max():.6g} {unit}")  # fmt: skip
    return f"{mean!r} {unit}"
