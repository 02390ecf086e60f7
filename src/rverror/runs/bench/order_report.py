"""Order tables as the reports of benches print them, by way of a mapping: long, or with columns for each order."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from itertools import compress

import numpy as np

from rverror.base.arrays import Array
from rverror.base.numbers import count_of, way, with_unit
from rverror.base.text import PathLike, shown
from rverror.runs.bench.columns import BenchFile
from rverror.runs.bench.file import found_entry, left_out_columns, open_bench_file
from rverror.runs.bench.header import header_quantity, header_texts, unknown_word
from rverror.runs.bench.mapping import BenchMapping, DirectionRule
from rverror.runs.bench.values import core_values
from rverror.runs.reading import ORDER_COLUMNS, ORDER_CONDITIONS, STATED, OrderRows, listed, refuse

#: Conditions that a bench may print with the sign of the motion; a table has their size.
_SIZES = ("output_torque", "input_speed")


def read_bench_orders(path: PathLike, mapping: BenchMapping) -> OrderRows:
    """Read an order table by a mapping.

    Parameters
    ----------
    path : str or path-like
    mapping : BenchMapping
        With `orders`.

    Raises
    ------
    InputError
        If it cannot be used; one line that names file, line, column, bound and remedy.
    """
    rules, name = mapping.orders, str(path)
    if rules.direction is None and "direction" not in mapping.header:
        refuse(mapping.path, "there is no direction; write direction = { name = \"...\" } in [orders], or direction = "
                             '"forward" in [header]')  # fmt: skip
    file = open_bench_file(path, mapping)
    notes = list(file.notes)
    texts, places = header_texts(file, mapping, {}, notes)
    entries = {
        key: [found_entry(file, mapping, where) for where in rules.of_orders(rule.where)]
        for key, rule in rules.columns.items()
    }
    used = [entry for own in entries.values() for entry in own]
    arrays = file.read(used)
    if len({array.size for array in arrays}) > 1:
        sizes = ", ".join(f"{shown(e.name, 60)} {array.size}" for e, array in zip(used, arrays, strict=True))
        file.refuse(f"the columns differ in length ({sizes}); export them again")
    stored = iter(arrays)
    numbers = {
        key: [core_values(file, key, rules.columns[key], entry, next(stored), notes) for entry in own]
        for key, own in entries.items()
    }
    # A line of units, a footer: no row.  Of a row with some numbers the table's own checks say what is missing.
    kept = np.any([np.isfinite(values) for own in numbers.values() for values in own], axis=0)
    labels = file.rows(kept.size)
    if not kept.all():
        left = labels[~kept].tolist()
        notes.append(f"{count_of(len(left), 'row')} without any number left out {listed(file.noun, left)}")
    lines = labels[kept].tolist()
    times = len(rules.orders) or 1
    columns = {
        key: np.stack([v[kept] for v in own], axis=1).ravel() if len(own) > 1 else np.repeat(own[0][kept], times)
        for key, own in numbers.items()
    }
    if rules.orders:
        columns["order"] = np.tile(rules.orders, len(lines))
    if rules.direction is None:
        senses = [_stated_direction(name, places["direction"], texts["direction"])] * len(lines)
    else:
        entry = found_entry(file, mapping, rules.direction.where)
        used.append(entry)
        words = compress(file.words(entry), kept.tolist())
        senses = [
            _direction(file, rules.direction, f"{file.noun} {label}", word)
            for label, word in zip(lines, words, strict=True)
        ]
    notes += left_out_columns(file, used)
    stated = {
        key: (value, places[key]) for key in ORDER_CONDITIONS
        if (value := header_quantity(file, key, texts, places)) is not None
    }  # fmt: skip
    rows = OrderRows(
        path=name,
        labels=tuple(label for label in lines for _ in range(times)),
        noun=file.noun,
        directions=tuple(sense for sense in senses for _ in range(times)),
        columns=_turned(columns, mapping),
        stated=stated,
        index=texts.get("index", ""),
        metadata=texts,
        notes=tuple(dict.fromkeys(notes)),
    )
    return _of_sizes(rows)


def _turned(columns: Mapping[str, Array], mapping: BenchMapping) -> dict[str, Array]:
    """Phases as those of a cosine whose amplitude is positive."""
    rules, result = mapping.orders, dict(columns)
    if rules.sine and "phase" in result:  # A sin(x) is A cos(x - 90 deg)
        result["phase"] = result["phase"] - math.pi / 2
    if "amplitude" in rules.columns and rules.columns["amplitude"].sign < 0:  # the error counts the other way
        result["amplitude"], result["phase"] = -result["amplitude"], result["phase"] + math.pi
    return result


def _of_sizes(rows: OrderRows) -> OrderRows:
    """Torques and speeds without the sign of the motion, where each direction has one sign.

    Raises
    ------
    InputError
        If a direction has both: a load that drives is no load that resists.
    """
    senses, columns, notes = np.array(rows.directions), dict(rows.columns), list(rows.notes)
    for key in [key for key in _SIZES if key in columns and (columns[key] < 0).any()]:
        values = columns[key]
        for sense in np.unique(senses).tolist():
            against = (senses == sense) & (values < 0)
            if against.any() and (values[senses == sense] > 0).any():
                row = int(np.argmax(against))
                size = with_unit(values[row], ORDER_COLUMNS[key])
                rows.refuse(
                    f"{rows.at(row)}: {key} = {size}, but above 0 in other rows {way(sense)}; the load resists the "
                    "motion and has one sign in a direction: split the table, or correct the direction"
                )
        columns[key] = np.abs(values)
        notes.append(f"{key} has the sign of the motion; its size is taken")
    return replace(rows, columns=columns, notes=tuple(notes))


def _stated_direction(path: str, at: str, text: str) -> float:
    value = STATED.get(text.strip().lower(), 0.0)
    if not value:
        refuse(path, f"{at}: direction = {shown(text)}: must be forward or reverse; write forward = \"...\" and "
                     'reverse = "..." beside its property')  # fmt: skip
    return value


def _direction(file: BenchFile, rule: DirectionRule, where: str, word: str) -> float:
    at = rule.where.stated_at
    if rule.words:
        if word.strip().lower() not in rule.words:
            file.refuse(f"{where}: direction = {shown(word)}: {unknown_word(rule.words, at)}")
        return STATED[rule.words[word.strip().lower()]]
    number = STATED.get(word.strip().lower()) or file.parse(word)
    if not number or math.isnan(number):
        file.refuse(
            f"{where}: direction = {shown(word)}: must be forward, reverse or a number above or below 0; "
            f'write forward = "..." and reverse = "..." beside its name ({at})'
        )
    return math.copysign(1.0, number) * rule.sign
