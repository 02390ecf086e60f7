"""Direction, torque, temperature and index of a bench's run: stated by the mapping, or standing in the file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rverror.base import units
from rverror.base.text import did_you_mean, shown
from rverror.runs.bench.columns import BenchFile, some_names
from rverror.runs.bench.mapping import BenchMapping, HeaderRule
from rverror.runs.bench.numerals import number_in
from rverror.runs.bench.unit_words import meant_unit
from rverror.runs.reading import HEADER_KEYS, ORDER_CONDITIONS, STATED, Header, Stated, checked_value


def read_header(file: BenchFile, mapping: BenchMapping, notes: list[str]) -> Header:
    """Header of a run: from the mapping, or from a file that names it as a run file does.

    Parameters
    ----------
    notes : list of str
        Gets what has no meaning but may be meant.

    Raises
    ------
    InputError
        If a value is missing, has no unit or is none.
    """
    stated = header_values(file, mapping, HEADER_KEYS, notes)
    direction = stated.get("direction")
    if direction and direction.text.lower() not in STATED:
        hint = did_you_mean(direction.text, STATED)
        file.refuse(
            f"{direction.at}: direction = {shown(direction.text)}: must be forward, reverse or mixed;"
            f"{hint or ' without it the angles tell'}"
        )
    return Header(
        stated=STATED[direction.text.lower()] if direction else None,
        stated_at=f"{direction.at}: " if direction else "",
        torque=header_quantity(file, "output_torque", stated),
        temperature=header_quantity(file, "temperature", stated),
        index=stated["index"].text if "index" in stated else "",
        metadata={key: value.text for key, value in stated.items()},
    )


def header_values(file: BenchFile, mapping: BenchMapping, keys: Sequence[str], notes: list[str]) -> dict[str, Stated]:
    """Values of the header by key, as written.

    Parameters
    ----------
    keys : sequence of str
        Those that have a meaning.
    notes : list of str
        Gets what has none but may be meant.

    Raises
    ------
    InputError
        If a value is missing.
    """
    # A file whose columns have names of its own may say "Direction: CW" or "Index: 3": there only a mapping tells.
    stated: dict[str, Stated] = {}
    if not mapping.columns and not mapping.orders:
        properties = {key.lower(): Stated(text=text, at=f"{key} in the file") for key, text in file.properties.items()}
        stated = dict(file.header) or {key: properties[key] for key in keys if key in properties}
    notes += [
        f"header key {shown(key)} in {value.at} has no meaning here and is only kept;{hint}"
        for key, value in stated.items()
        if key not in keys and (hint := did_you_mean(key, keys))
    ]
    for key, rule in mapping.header.items():
        stated[key] = Stated(text=rule.text or _property(file, key, rule), at=rule.where.stated_at)
    return stated


def header_quantity(file: BenchFile, key: str, stated: Mapping[str, Stated]) -> float | None:
    """Value of a condition in its core unit; None where the header has none.

    Raises
    ------
    InputError
        If it has no unit or is none.
    """
    if key not in stated:
        return None
    dimension, at = ORDER_CONDITIONS[key], stated[key].at
    try:
        number = units.parse(stated[key].text, dimension)
    except ValueError as error:
        file.refuse(f"{at}: {key}: {error}")
    return checked_value(file.path, f"{at}: {key}", number, dimension)


def _property(file: BenchFile, key: str, rule: HeaderRule) -> str:
    """Text of a property, with the mapping's unit where it has none."""
    name, at = rule.where.property, rule.where.stated_at
    if name not in file.properties:
        hint = did_you_mean(name, list(file.properties))
        file.refuse(f"there is no property {shown(name, 60)} ({at});{hint} the file has {some_names(file.properties)}")
    text = file.properties[name]
    if rule.words:
        if text.strip().lower() not in rule.words:
            file.refuse(f"{key}: the property {shown(name, 60)} is {shown(text)}, {unknown_word(rule.words, at)}")
        return rule.words[text.strip().lower()]
    number, _, unit = text.partition(" ")
    value = number_in(number, file.decimal)
    if value is None or key not in ORDER_CONDITIONS:
        return text
    unit = meant_unit(unit.strip())
    if rule.unit and unit not in ("", rule.unit):
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
