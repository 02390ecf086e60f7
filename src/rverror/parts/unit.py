"""A unit of measured parts: which part is mounted where, its model, and its error with an interval."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rverror.base.arrays import Array
from rverror.base.errors import InputError, check_each
from rverror.base.text import PathLike, describe, read_text, shown, some, split_lines
from rverror.base.viewed import OneLine
from rverror.geartrain.mechanism import Mechanism, Reducer
from rverror.geartrain.source import rv
from rverror.model.catalogue import source
from rverror.model.compose import transmission_error, transmission_error_by_effect
from rverror.model.effects import Effect, Model, check_model
from rverror.parts.measured import KINDS, MeasuredPart, disc_turns, mounted, places_of

_DRAWN = 2000


@dataclass(frozen=True)
class UnitError(OneLine):
    """Transmission error of a unit whose errors are known to within an uncertainty, in closed form; of `unit_error`.

    Attributes
    ----------
    transmission_error : ndarray, shape (n,)
        Its mean, rad.
    sigma : ndarray, shape (n,)
        1 sigma of it, rad.
    peak_to_peak : float
        Of the mean, rad.
    interval : tuple of float
        95 % interval of the peak-to-peak, rad.
    """

    transmission_error: Array
    sigma: Array
    peak_to_peak: float
    interval: tuple[float, float]


def unit_of_parts(
    model: Model,
    parts: Sequence[MeasuredPart],
    places: Mapping[str, Sequence[str]] | None = None,
    *,
    turns: Mapping[str, Sequence[int]] | None = None,
) -> Model:
    """Model of the unit that is assembled of measured parts.

    Parameters
    ----------
    model : Model
        What else is known of the unit.
    parts : sequence of MeasuredPart
    places : mapping of str to sequence of str, optional
        Serial numbers by kind, in the order of the places: ``{"disc": ["D17", "D18"]}``.  Of a kind that is left out
        there must be as many parts as places; they take these in their order.
    turns : mapping of str to sequence of int, optional
        By how many pitches of their bores discs are turned counter-clockwise from where they were measured, a sun by
        how many teeth, in the same order: ``{"disc": [0, 1]}``.  Where they are left out discs are turned by the fewest
        with which their lobes stand right.

    Returns
    -------
    Model
        With the errors of the parts as they stand, and their uncertainties, behind its own effects.

    Raises
    ------
    InputError
        If a serial number is unknown, a place has no part, a disc does not fit so, or the model declares an error that
        was measured.

    Examples
    --------
    >>> from rverror.geartrain.mechanism import reducer
    >>> from rverror.model.effects import effect
    >>> discs = [
    ...     MeasuredPart(
    ...         "disc", name, (effect("cycloid.disc_pitch", harmonic=1, cos=f"{size} um", uncertainty="0.2 um"),)
    ...     )
    ...     for name, size in (("D17", 2), ("D18", 3))
    ... ]
    >>> unit = unit_of_parts(Model(reducer("RV-40E")), discs, {"disc": ["D18", "D17"]})
    >>> print(unit.effects[0], "of", unit.effects[0].origin)
    cycloid.disc_pitch (disc 0, harmonic 1): cos 3 um of disc D18
    """
    check_model(model)
    check_each("parts", parts, MeasuredPart, "give those of rverror.load_parts(...)")
    found = {(part.kind, part.serial): part for part in parts}
    declared = {describe(effect.key, effect.indices) for effect in model.effects}
    added: list[Effect] = []
    for kind, serials in mounted_parts(parts, model.mechanism, places).items():
        reducer = rv(model.mechanism)
        turned = (turns or {}).get(kind, [None] * len(serials))
        if len(turned) != len(serials):
            raise InputError(f"turns of {kind}: {len(turned)} for {len(serials)} in a unit; give one for each place")
        for place, serial, turn in zip(places_of(reducer, kind), serials, turned, strict=True):
            part = found[kind, serial]
            origin = f"{kind} {part.serial}" + (f", {part.origin}" if part.origin else "")
            added += [replace(error, origin=origin) for error in _at_place(part, reducer, place.number, turn)]
    twice = [name for error in added if (name := describe(error.key, error.indices)) in declared]
    if twice:
        raise InputError(f"{twice[0]}: it is measured, and the model declares it too; take it out of the model")
    return model.with_effects(*added)


def _at_place(part: MeasuredPart, reducer: Reducer, place: int | None, turn: int | None) -> tuple[Effect, ...]:
    """Errors of a part where it is mounted and turned, a disc by the fewest pitches of its bores if none are given."""
    if part.kind != "disc" or place is None:
        return mounted(part, reducer, place, turn or 0)
    ways = disc_turns(reducer, part.made_for, place)
    if not (ways if turn is None else turn % reducer.cranks in ways):
        so = "" if turn is None else f" turned by {turn} pitches of its bores"
        raise InputError(
            f"disc {part.serial}: its lobes stand as those of disc {part.made_for}, and do not fit at place {place}"
            f"{so}; choose another, or correct its made_for in the table of parts"
        )
    return mounted(part, reducer, place, ways[0] if turn is None else turn)


def places_in_list(path: PathLike, unit: int) -> tuple[dict[str, tuple[str, ...]], dict[str, tuple[int, ...]]]:
    """Parts of one unit of a list for the assembly shop, as ``rverror match --save`` writes it.

    Parameters
    ----------
    path : str or path-like
        CSV with a column ``unit``, one for each place such as ``crank_0``, ``disc_1`` or ``housing`` with serial
        numbers, and ``disc_1_turn`` where discs are turned; other columns do not count.
    unit : int
        Its number in the list.

    Returns
    -------
    places : dict of str to tuple of str
    turns : dict of str to tuple of int
        As `unit_of_parts` takes them.

    Raises
    ------
    InputError
        If the file is no such list, or has no such unit.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     size = Path(folder, "units.csv").write_text("unit,disc_0,disc_1,disc_1_turn\\n17,D4,D2,1\\n")
    ...     places_in_list(Path(folder, "units.csv"), 17)
    ({'disc': ('D4', 'D2')}, {'disc': (0, 1)})
    """
    lines = split_lines(read_text(path))
    rows = list(csv.DictReader(lines, delimiter=";" if ";" in lines[0] else ",") if lines else ())
    numbers = [row.get("unit") or "" for row in rows]
    if str(unit) not in numbers:
        listed = f"{', '.join(numbers[:5])} ..." if any(numbers) else "no numbers in a column unit"
        raise InputError(f"{path}: no unit {unit}: the list has {listed}; give one that `rverror match --save` wrote")
    row = rows[numbers.index(str(unit))]
    serials, turned = dict[str, dict[int, str]](), dict[str, dict[int, str]]()
    for name, text in row.items():
        match = re.fullmatch(rf"({'|'.join(KINDS)})(?:_(\d+))?(_turn)?", name or "")
        if match:
            held = turned if match[3] else serials
            held.setdefault(match[1], {})[int(match[2] or 0)] = (text or "").strip()
    odd = [text for at in turned.values() for text in at.values() if not re.fullmatch(r"-?\d{1,9}", text)]
    if odd:
        raise InputError(f"{path}, unit {unit}: a part turned by {shown(odd[0])}; give a whole number")
    for kind, at in serials.items():
        if sorted(at) != list(range(len(at))):
            raise InputError(f"{path}: columns of {kind} {some(sorted(at))}; give one for each place, from {kind}_0 on")
    places = {kind: tuple(at[place] for place in sorted(at)) for kind, at in serials.items()}
    turns = {
        kind: tuple(int(turned[kind].get(place, 0)) for place in range(len(places[kind])))
        for kind in turned
        if kind in places
    }
    return places, turns


def mounted_parts(
    parts: Sequence[MeasuredPart], mechanism: Mechanism, places: Mapping[str, Sequence[str]] | None = None
) -> dict[str, tuple[str, ...]]:
    """Serial numbers of the parts at the places of a unit, as for `unit_of_parts`.

    Returns
    -------
    dict of str to tuple of str
        By kind.

    Raises
    ------
    InputError
        If a kind or a serial number is unknown, a part has two places, or a place has no part.
    """
    reducer = rv(mechanism)
    measured = {kind: {part.serial: part.count for part in parts if part.kind == kind} for kind in KINDS}
    mounted = {}
    for kind in dict.fromkeys([*(part.kind for part in parts), *(places or {})]):
        chosen = tuple((places or {}).get(kind, measured.get(kind, ())))
        unknown = [serial for serial in chosen if serial not in measured.get(kind, ())]
        if unknown or kind not in KINDS:
            known = ", ".join([*[*measured.get(kind, ())][:5], "..."])
            wrong = shown([*unknown, ""][0])
            raise InputError(f"place {shown(kind)}: {wrong} is not among the measured parts, {known}; correct it")
        count = len(places_of(reducer, kind))
        if len(chosen) != count or any(number > measured[kind][serial] for serial, number in Counter(chosen).items()):
            example = ",".join([*measured[kind], "..."][:count])
            raise InputError(f"{len(chosen)} parts of kind {kind} for {count} in a unit; say which, each once, in the "
                             f"order of the places: {kind}={example}")  # fmt: skip
        mounted[kind] = chosen
    return mounted


def unit_error(model: Model, theta: Any | None = None, *, direction: Any | None = None, seed: int = 0) -> UnitError:
    """Transmission error in closed form, with the uncertainty that the declared effects have.

    Parameters
    ----------
    model : Model
    theta, direction
        As for `rverror.transmission_error`; one output turn where left out.
    seed : int
        Of the units that are drawn for the interval of the peak-to-peak.

    Returns
    -------
    UnitError

    Examples
    --------
    >>> from rverror.geartrain.mechanism import reducer
    >>> from rverror.model.effects import effect
    >>> cam = effect("crank.eccentricity", crank=0, disc=0, radial="5 um", uncertainty="0.5 um")
    >>> found = unit_error(Model(reducer("RV-40E"), (cam,)))
    >>> [round(value / found.peak_to_peak, 2) for value in found.interval]
    [0.81, 1.2]
    """
    mean = transmission_error(model, theta, direction=direction)
    marks = tuple(effect for effect in model.effects if source(effect.key).acts == "marks")
    changes = tuple(
        replace(effect, values=tuple(row))
        for effect in model.effects
        if effect.uncertainty and effect not in marks
        for row in (effect.uncertainty * np.eye(len(effect.values))).tolist()
    )
    by_change = transmission_error_by_effect(replace(model, effects=(*changes, *marks)), theta, direction=direction)
    jacobian = by_change[: len(changes)].reshape(-1, mean.size)
    units = mean + np.random.default_rng(seed).standard_normal((_DRAWN, len(jacobian))) @ jacobian
    low, high = np.quantile(np.ptp(units, axis=1), (0.025, 0.975))
    sigma = np.sqrt(np.sum(jacobian**2, axis=0))
    return UnitError(mean, sigma, float(np.ptp(mean)), (float(low), float(high)))
