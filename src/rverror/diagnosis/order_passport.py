"""The passport of orders: how each depends on load, direction, speed and temperature, and what can do that.

Per order and direction the waves are fitted as constant + slope times the size of the torque + part (temperature) +
part (input speed); see docs/theory/passport.md.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from rverror.base.arrays import Array, Flags
from rverror.base.chance import student
from rverror.base.errors import InputError
from rverror.diagnosis.passport_kinds import kinds_of
from rverror.diagnosis.wave_fit import CONFIDENCE, BothWays, DirectionLaw, WaveFit, both_ways, fit_waves
from rverror.runs.order_table import OrderCase, Waves

#: Orders that lie nearer are one.
SAME_ORDER = 1e-6
#: Torques and speeds that differ by less than this share of the largest are one setting: benches hold them so.
SAME_SETTING = 0.01
#: K; temperatures that differ by less are one: the oil's is held and read no better.
SAME_TEMPERATURE = 1.0
#: A straight line through two torques cannot be wrong, so a load law takes three.
TORQUES_OF_A_LAW = 3
#: Cases to spare from which a law is read at the reference alone: discs are then a fifth wider than with known noise,
#: and hold the truth where load and speed or temperature do not simply add.
ENOUGH = 4
#: Share of the largest torque within which light loads bend a law: below it fewer pins and teeth carry.
LIGHT = 0.2
#: Conditions beside the load, and what they are called.
NAMES = {"speed": "input speed", "temperature": "temperature"}
_SHARED = {"constant": "constant", "torque": "load", "speed": "speed", "temperature": "temperature", "left": "left"}
#: One order of a case, NaN where a condition or the noise is not known; number of the case, and its place there.
_NUMBERS = ("order", "direction", "torque", *NAMES, "sigma")
_ROW = np.dtype([(name, "f8") for name in _NUMBERS] + [("wave", "c16"), ("case", "i8"), ("place", "i8")])

Cases = npt.NDArray[Any]


@dataclass(frozen=True, kw_only=True, eq=False)
class OrderPassport:
    """How one order depends on load, direction, speed and temperature.

    Attributes
    ----------
    order : float
        Per output turn.
    amplitude, low, high : float
        Root of the mean power over the cases, rad, and its interval; 0 to infinite where nothing tells the noise.
    laws : tuple of DirectionLaw
        Forward first.
    constants, loads : BothWays or None
        The laws' constants and slopes in both directions; None where one is missing or the conditions differ.
    shares : mapping of str to float or None
        Of the mean power over the cases: ``constant``, ``load``, ``speed``, ``temperature``, ``left``; each part's own
        power over the sum of all, so they add up to 1.  None where the cases do not tell a part.
    reference_speed, reference_temperature : float or None
        Where the constants stand, rad/s and K.
    kinds : tuple of str
        Which kinds of causes can do that.
    """

    order: float
    amplitude: float
    low: float
    high: float
    laws: tuple[DirectionLaw, ...]
    constants: BothWays | None
    loads: BothWays | None
    shares: Mapping[str, float | None]
    reference_speed: float | None
    reference_temperature: float | None
    kinds: tuple[str, ...]

    @property
    def bent(self) -> bool:
        """Whether a straight law does not hold in a direction."""
        return any(law.bent for law in self.laws)


def passport(cases: Sequence[OrderCase], *, ratio: float | None = None) -> tuple[OrderPassport, ...]:
    """Tell of every order how it depends on load, direction, speed and temperature.

    Parameters
    ----------
    cases : sequence of OrderCase
        Orders within 1e-6 of each other are one; an order that a case does not hold is not known there.
    ratio : float, optional
        Input turns per output turn: names the input's orders.

    Returns
    -------
    tuple of OrderPassport
        The strongest first.

    Raises
    ------
    InputError
        If there are no cases, or a number of them cannot be used.

    Examples
    --------
    >>> from rverror.runs.order_table import TableCondition
    >>> table = [
    ...     OrderCase(
    ...         condition=TableCondition(direction=1.0, torque=torque),
    ...         orders=np.array([40.0]),
    ...         waves=np.array([1e-5 + 2e-11j * torque]),
    ...         sigma=np.array([1e-7]),
    ...     )
    ...     for torque in (0.0, 2e5, 4e5)
    ... ]
    >>> (found,) = passport(table)
    >>> found.laws[0].slope.significant, found.bent
    (True, False)
    """
    every = rows_of(cases)
    every = every[np.argsort(every["order"], kind="stable")]
    groups = np.split(every, np.flatnonzero(np.diff(every["order"]) > SAME_ORDER) + 1)
    found = [_passport(group, ratio) for group in groups if group.size]
    return tuple(sorted(found, key=lambda one: (-one.amplitude, one.order)))


def rows_of(cases: Sequence[OrderCase]) -> Cases:
    """Every order of every case as a row of an array.

    Raises
    ------
    InputError
        If there are no cases, or a condition cannot be used.
    """
    if not cases:
        raise InputError("there are no cases; give an order table with one or more conditions")
    found = []
    for number, case in enumerate(cases):
        at, rows = case.condition, np.empty(case.orders.size, dtype=_ROW)
        given = {"direction": at.direction, "torque": at.torque, "speed": at.input_speed, "temperature": at.temperature}
        for name, value in given.items():
            if value is not None and not math.isfinite(value):
                raise InputError(f"case {number + 1}: {name} is not finite; leave out what is not known")
            rows[name] = math.nan if value is None else value
        if at.direction not in (-1.0, 1.0):
            raise InputError(f"case {number + 1}: direction = {at.direction!r}; give +1 forward or -1 reverse")
        if at.torque is not None and at.torque < 0:
            raise InputError(f"case {number + 1}: torque = {at.torque:g} N*mm; give its size, 0 or larger")
        rows["order"], rows["wave"] = case.orders, case.waves
        rows["sigma"] = math.nan if case.sigma is None else case.sigma
        rows["case"], rows["place"] = number, np.arange(case.orders.size)
        found.append(rows)
    return np.concatenate(found)


def _passport(cases: Cases, ratio: float | None) -> OrderPassport:
    order = float(cases["order"][0])
    same = {name: SAME_SETTING * float(np.nanmax(cases[name], initial=0.0)) for name in ("torque", "speed")}
    same["temperature"] = SAME_TEMPERATURE
    ways = [cases[cases["direction"] == sign] for sign in (1.0, -1.0) if (cases["direction"] == sign).any()]
    reference = {name: _reference([one[name] for one in ways], same[name]) for name in NAMES}
    read = [_law(one, reference, same) for one in ways]
    laws = tuple(law for law, *_ in read)
    constants = loads = None
    if len(read) == 2 and _comparable(read[0][2], read[1][2], same):
        constants = both_ways(laws[0].constant, laws[1].constant)
        if laws[0].slope is not None and laws[1].slope is not None:
            loads = both_ways(laws[0].slope, laws[1].slope)
    amplitude, low, high = _mean_amplitude(cases["wave"], laws)
    return OrderPassport(
        order=order,
        amplitude=amplitude,
        low=low,
        high=high,
        laws=laws,
        constants=constants,
        loads=loads,
        shares=_shares([powers for _, powers, _ in read]),
        reference_speed=reference["speed"],
        reference_temperature=reference["temperature"],
        kinds=kinds_of(
            laws,
            constants,
            loads,
            amplitude=amplitude,
            spans={name: _span(cases[name]) for name in ("torque", *NAMES)},
            shaft=_shaft(order, ratio),
        ),
    )


def _shaft(order: float, ratio: float | None) -> str:
    """Shaft whose turn or half turn the order is, as the measuring chain knows it; empty where none."""
    shafts = {"output": 1.0} | ({} if ratio is None else {"input": abs(ratio)})
    near = (name for name, turns in shafts.items() for k in (1, 2) if math.isclose(order, k * turns, rel_tol=1e-6))
    return next(near, "")


def _span(values: Array) -> float:
    """Range of the values that are known."""
    known = values[np.isfinite(values)]
    return float(np.ptp(known)) if known.size else 0.0


def level_of(values: Array, same: float) -> npt.NDArray[np.intp]:
    """Number of the setting of each value, -1 where not known: settings lie farther than `same` apart."""
    order = np.argsort(values)
    levels = np.empty(values.size, dtype=np.intp)
    levels[order] = np.concatenate([[0], np.cumsum(np.diff(values[order]) > same)])[: values.size]
    return np.where(np.isfinite(values), levels, -1)


def _settings(values: Array, same: float) -> int:
    """How many settings are known."""
    return int(level_of(values, same).max(initial=-1)) + 1


def _reference(ways: Sequence[Array], same: float) -> float | None:
    """Setting at which constants are told: of those that all directions have the one of most cases."""
    pooled = np.concatenate(ways)
    if not np.isfinite(pooled).all():
        return None
    levels = level_of(pooled, same)
    of_each = np.split(levels, np.cumsum([values.size for values in ways])[:-1])
    counts = np.array([np.bincount(own, minlength=int(levels.max()) + 1) for own in of_each])
    best = max(range(counts.shape[1]), key=lambda level: (counts[:, level].min(), counts[:, level].sum()))
    return float(pooled[levels == best].mean())


def _comparable(one: Mapping[str, float], other: Mapping[str, float], same: Mapping[str, float]) -> bool:
    """Whether two constants stand at one torque, speed and temperature; what is not known anywhere is left open."""
    return all(
        abs(one[name] - other[name]) <= limit or (math.isnan(one[name]) and math.isnan(other[name]))
        for name, limit in same.items()
    )


def _law(
    cases: Cases, reference: Mapping[str, float | None], same: Mapping[str, float]
) -> tuple[DirectionLaw, Mapping[str, float], Mapping[str, float]]:
    """Law of one direction, the power of each part over its cases, and where the constant stands.

    Where the cases at the reference are enough, constant and slope are theirs alone: load and speed need not add.
    """
    held = cases.size
    loaded = _settings(cases["torque"], same["torque"]) >= TORQUES_OF_A_LAW
    if loaded:
        cases = cases[np.isfinite(cases["torque"])]
    columns, notes = _columns(cases, reference, same, loaded=loaded)
    if cases.size < held:
        notes.append(f"{held - cases.size} of {held} cases hold no torque and are left out")

    def fit(names: Sequence[str], chosen: Flags) -> WaveFit:
        some = cases[chosen]
        return fit_waves(
            np.stack([columns[name][chosen] for name in names], axis=1),
            some["wave"],
            sigma=some["sigma"] if np.isfinite(some["sigma"]).all() else None,
            bend=np.exp(-some["torque"] / (LIGHT * some["torque"].max())) if loaded else None,
        )

    read = np.ones(cases.size, dtype=np.bool_)
    main = fit(tuple(columns), read)
    parts = dict(zip(columns, main.parts, strict=True))
    core = np.all([np.abs(columns[name]) <= same[name] for name in NAMES if name in columns] or [read], axis=0)
    base = [name for name in columns if name not in NAMES]
    torques = _settings(cases["torque"][core], same["torque"])
    if not core.all() and core.sum() >= len(base) + ENOUGH and (torques >= TORQUES_OF_A_LAW or not loaded):
        read, main = core, fit(base, core)
        parts |= dict(zip(base, main.parts, strict=True))
    along = cases[read][np.argsort(cases["torque"][read], kind="stable")]
    law = DirectionLaw(
        direction=float(cases["direction"][0]),
        cases=held,
        constant=parts["constant"],
        slope=parts.get("torque"),
        temperature=parts.get("temperature"),
        speed=parts.get("speed"),
        not_determined=tuple(notes),
        bent=main.bent,
        noise=main.noise,
        torque=along["torque"],
        waves=along["wave"],
    )
    stands = {name: (reference.get(name) or 0.0) if name in columns else float(cases[name].mean()) for name in same}
    waves = {name: part.value * columns[name] for name, part in parts.items()}
    waves["left"] = cases["wave"] - np.sum(list(waves.values()), axis=0)
    return law, {name: float(np.sum(np.abs(wave) ** 2)) for name, wave in waves.items()}, stands


def _columns(
    cases: Cases, reference: Mapping[str, float | None], same: Mapping[str, float], *, loaded: bool
) -> tuple[dict[str, Array], list[str]]:
    """What the law is made of, and what the cases do not tell."""
    columns, notes = {"constant": np.ones(cases.size)}, []
    if loaded:
        columns["torque"] = cases["torque"]
    else:
        few = ("no case holds a torque", "all cases are at one torque", "there are two torques only")
        notes.append(f"load is not determined: {few[_settings(cases['torque'], same['torque'])]}")
    for name, called in NAMES.items():
        column, note = _column(columns, cases[name], reference[name], same[name])
        if column is not None:
            columns[name] = column
        elif note:
            notes.append(f"{called} is not determined: {note}")
    return columns, notes


def _column(
    columns: Mapping[str, Array], values: Array, reference: float | None, same: float
) -> tuple[Array | None, str]:
    """Column of a condition beside those there are, or why its part cannot be told; empty where it does not vary."""
    if _span(values) <= same:
        return None, ""
    if reference is None:
        return None, "some cases do not hold it"
    column = values - reference
    if values.size <= len(columns) + 1:
        return None, "there are too few cases, so that it may be in the other parts"
    others = np.stack(list(columns.values()), axis=1)
    others = others / np.abs(others).max(axis=0)
    alone = column - others @ np.linalg.lstsq(others, column, rcond=None)[0]
    if float(np.abs(alone).max()) <= same:
        with_what = " and ".join(NAMES.get(other, other) for other in columns if other != "constant")
        return None, f"it goes with the {with_what}, whose part may be its own"
    return column, ""


def _mean_amplitude(waves: Waves, laws: Sequence[DirectionLaw]) -> tuple[float, float, float]:
    """Root of the mean power over the cases, and its interval; the lower bound takes the noise's own power off."""
    size = math.sqrt(float(np.mean(np.abs(waves) ** 2)))
    noise = math.sqrt(sum(law.noise**2 * law.cases for law in laws) / waves.size)
    if not math.isfinite(noise):
        return size, 0.0, math.inf
    reach = student((1 - CONFIDENCE) / 2, min(law.constant.freedom for law in laws)) * noise / math.sqrt(waves.size)
    return size, max(math.sqrt(max(size**2 - 2 * noise**2, 0.0)) - reach, 0.0), size + reach


def _shares(powers: Sequence[Mapping[str, float]]) -> dict[str, float | None]:
    """Each part's power over the sum of all."""
    summed = {name: sum(one.get(name, 0.0) for one in powers) for name in _SHARED}
    whole = sum(summed.values()) or 1.0
    varying = {name for one in powers for name in one}
    return {called: summed[name] / whole if name in varying else None for name, called in _SHARED.items()}
