"""Rows of order tables from files: text that says ``# kind: orders``, or a bench's report by way of a mapping."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from itertools import compress

import numpy as np

from rverror.base.directions import DIRECTIONS
from rverror.base.numbers import count_of
from rverror.base.text import PathLike, did_you_mean, shown
from rverror.runs.bench.columns import BenchFile
from rverror.runs.bench.file import (
    contents,
    header_values,
    open_bench_file,
    standard_rules,
    unknown_word,
)
from rverror.runs.bench.mapping import BenchMapping, ColumnRule
from rverror.runs.bench.text import number_in
from rverror.runs.reading import (
    ORDER_COLUMNS,
    ORDER_KEYS,
    Reading,
    Stated,
    bare_name,
    refuse,
)

#: What the header's ``kind`` says of an order table.
KIND = "orders"
#: Conditions that a bench may print with the sign of the motion; a table has their size.
_SIZES = ("output_torque", "input_speed")
#: Columns that need another: what is not known without it, and what to give.
_PAIRS = (
    ("cos", "sin", "", "both, or amplitude and phase"),
    ("sin", "cos", "", "both, or amplitude and phase"),
    ("amplitude", "phase", ", so the waves are not known", "phase[deg], or cos[arcsec] and sin[arcsec]"),
    ("phase", "amplitude", ", so the waves are not known", "amplitude[arcsec], or cos[arcsec] and sin[arcsec]"),
)


def read_order_rows(path: PathLike, mapping: BenchMapping) -> Reading:
    """Read the rows of an order table.

    Parameters
    ----------
    path : str or path-like
    mapping : BenchMapping
        Without `orders` the columns are named as in an order table, and the header says what it is.

    Raises
    ------
    InputError
        If it cannot be used; one line that names file, line, column, bound and remedy.
    """
    file = open_bench_file(path, mapping, ORDER_COLUMNS)
    if mapping.orders:
        rules = dict(mapping.orders)
        check_order_columns(mapping.path, "[orders]", rules)
    else:
        _check_kind(file, header_values(file, mapping, ORDER_KEYS, []))
        rules = standard_rules(file, mapping, ORDER_COLUMNS)
        names = [entry.name for entry in file.entries]
        check_order_columns(file.path, file.place, rules, others=names)
    read, entries, header = contents(file, mapping, rules, ORDER_KEYS)
    stated, notes = dict(read.stated), list(read.notes)
    # A line of units, a footer: no row.  Of a row with some numbers the table's own checks say what is missing.
    kept = np.logical_or.reduce([np.isfinite(values) for values in read.columns.values()])
    if not kept.all():
        left = count_of(int(np.count_nonzero(~kept)), "row")
        notes.append(f"{left} without any number left out {read.listed(~kept)}")
    columns, labels = {key: values[kept] for key, values in read.columns.items()}, read.labels[kept]
    if "direction" in header:
        where = header["direction"].at
        stated["direction"] = _direction(file, where, header["direction"].text), where
    if "direction" in rules:
        words = zip(labels, compress(file.words(entries["direction"]), kept), strict=True)
        signs = [_direction(file, f"{file.noun} {label}", word, rules["direction"]) for label, word in words]
        columns["direction"] = np.array(signs)
    elif "direction" not in stated:
        file.refuse(
            f"{file.place or 'columns'}: there is no direction; write '# direction: forward' above the names, a "
            "column 'direction', or direction in [header] or [orders] of the mapping"
        )
    if mapping.orders:
        for key in _SIZES:
            if key in columns and (columns[key] < 0).any():
                columns[key] = np.abs(columns[key])
                notes.append(f"{key} has the sign of the motion; its size is taken")
        if "amplitude" in rules and rules["amplitude"].sign < 0:  # the error counts the other way
            columns["amplitude"], columns["phase"] = -columns["amplitude"], columns["phase"] + math.pi
    return replace(read, labels=labels, columns=columns, stated=stated, notes=tuple(dict.fromkeys(notes)))


def _check_kind(file: BenchFile, stated: Mapping[str, Stated]) -> None:
    if "kind" not in stated:
        file.refuse(f"line 1: the header does not say what the rows are; write '# kind: {KIND}' first")
    kind = stated["kind"]
    if kind.text.lower() != KIND:
        file.refuse(f"{kind.at}: kind = {shown(kind.text)}: must be {KIND}")


def check_order_columns(path: str, where: str, given: Collection[str], *, others: Sequence[str] = ()) -> None:
    """Refuse rows that do not tell which order they are of, or how large and where its wave is.

    Parameters
    ----------
    path, where : str
        File and place, for the message.
    given : collection of str
        Known columns.
    others : sequence of str
        All columns as written, of which one may be meant.

    Raises
    ------
    InputError
    """

    unknown = [name for name in others if bare_name(name) not in given]

    def meant(*missing: str) -> str:
        """Another column that may be meant."""
        hints = ((name, did_you_mean(bare_name(name), missing)) for name in unknown)
        return next((f"{hint.rstrip('?')} by {shown(name)}?" for name, hint in hints if hint), "")

    if "order" not in given:
        refuse(path, f"{where}: there is no order;{meant('order')} give the waves per output turn as a column 'order'")
    if {"cos", "sin"} <= set(given) and (both := [name for name in ("amplitude", "phase") if name in given]):
        refuse(path, f"{where}: {' and '.join(both)} beside cos and sin; leave one form of them")
    for one, other, why, remedy in _PAIRS:
        if one in given and other not in given:
            refuse(path, f"{where}: {one} without {other}{why};{meant(other)} give {remedy}")
    if not {"cos", "amplitude"} & set(given):
        refuse(
            path,
            f"{where}: there is no amplitude and no cos;{meant('amplitude', 'phase', 'cos', 'sin')} give "
            "amplitude[arcsec] and phase[deg], or cos[arcsec] and sin[arcsec]",
        )


def _direction(file: BenchFile, at: str, word: str, rule: ColumnRule | None = None) -> float:
    meaning = word.strip().lower()
    if rule and rule.words:
        if meaning not in rule.words:
            file.refuse(f"{at}: direction = {shown(word)}: {unknown_word(rule.words, rule.where.stated_at)}")
        return DIRECTIONS[rule.words[meaning]]
    number = DIRECTIONS.get(meaning) or number_in(word, file.decimal)
    if not number or math.isnan(number):
        hint = did_you_mean(word, DIRECTIONS) or ' write other words as forward = "..." and reverse = "..." in [orders]'
        file.refuse(f"{at}: direction = {shown(word)}: must be forward or reverse, or a number above or below 0;{hint}")
    return math.copysign(1.0, number)
