"""The passport of orders: how each depends on load, direction, speed and temperature, and what can do that.

Per order and direction the waves are fitted as constant + slope times the size of the torque + part (temperature) +
part (input speed); see docs/theory/passport.md.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import scipy

from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.diagnosis.passport_kinds import kinds_of
from rverror.diagnosis.wave_fit import BothWays, WaveFit, WavePart, both_ways, fit_waves
from rverror.runs.order_table import OrderCase, Waves

#: Orders that lie nearer are one.
SAME_ORDER = 1e-6
#: Torques and speeds that differ by less than this share of the largest are one setting: benches hold them so.
SAME_SETTING = 0.01
#: K; temperatures that differ by less are one: the oil's is held and read no better.
SAME_TEMPERATURE = 1.0
#: A straight line through two torques cannot be wrong, so a load law takes three.
TORQUES_OF_A_LAW = 3
#: A maximum over speed counts from so many times the median on, and so many standard deviations above it.
STANDS_OUT, CLEAR = 2.0, 4.0
#: Of the maximum, to which amplitudes fall on both sides: a resonance falls below its half power, a step does not.
HALF_POWER = math.sqrt(0.5)
#: Speeds below which no maximum has two neighbours, and from which on a peak leaves most steps between them alone.
SPEEDS_OF_A_PEAK, SPEEDS_OF_STEPS = 3, 6
#: Share of orders under one straight law that are taken for it, by Chow's test.
ONE_LAW = 0.95
#: Cases to spare from which a law is read at the reference alone: discs are then a fifth wider than with known noise,
#: and hold the truth where load and speed or temperature do not simply add.
ENOUGH = 4
#: Share of the largest torque within which light loads bend a law: below it fewer pins and teeth carry.
LIGHT = 0.1
#: Conditions beside the load, and what they are called.
NAMES = {"speed": "input speed", "temperature": "temperature"}
_SHARED = {"constant": "constant", "torque": "load", "speed": "speed", "temperature": "temperature", "left": "left"}


@dataclass(frozen=True, kw_only=True, eq=False)
class DirectionLaw:
    """One order in one direction of motion.

    Attributes
    ----------
    direction : float
        +1 forward, -1 reverse.
    cases : int
        How many hold the order.
    constant : WavePart
        rad; at no load where `slope` is told, else the mean over the torques; at the reference speed and temperature.
    slope : WavePart or None
        rad per N*mm of the size of the torque; None below three torques.
    temperature : WavePart or None
        rad per K.
    speed : WavePart or None
        rad per rad/s of input speed.
    not_told : tuple of str
        What the cases do not tell apart, and why.
    bent : bool
        Whether the straight law does not hold: the misfit is larger than the noise, or keeps together along the load.
    deviation : float
        Largest size of a residual of the law, rad, over the cases that it was read from.
    deviation_torque : float or None
        the size of the torque at which it stands, N*mm.
    noise : float
        Standard deviation of real and imaginary part of a case that the discs stand on, rad.
    torque : ndarray, shape (n,)
        the size of the torque of the cases that the law was read from, N*mm, growing; NaN where not known.
    waves : ndarray of complex, shape (n,)
        Their waves, rad.
    """

    direction: float
    cases: int
    constant: WavePart
    slope: WavePart | None
    temperature: WavePart | None
    speed: WavePart | None
    not_told: tuple[str, ...]
    bent: bool
    deviation: float
    deviation_torque: float | None
    noise: float
    torque: Array
    waves: Waves


@dataclass(frozen=True, kw_only=True)
class SpeedPeak:
    """Largest amplitude of an order over the input speed, between smaller ones.

    Attributes
    ----------
    direction : float
    torque : float or None
        the size of the torque of the series where it stands out most, N*mm.
    speed : float
        Input speed of the largest amplitude, rad/s.
    low, high : float
        Neighbouring input speeds, rad/s, of all series in which a peak stands out; it lies between them.
    amplitude : float
        rad.
    median : float
        Of the amplitudes of that series, rad.
    frequency : float or None
        Of the order at `speed`, Hz; None where the ratio is not known.
    low_frequency, high_frequency : float or None
        Hz, at `low` and `high`.
    series : int
        Series over speed, of one direction, torque and temperature, in which a peak stands out ...
    of : int
        ... of so many.
    """

    direction: float
    torque: float | None
    speed: float
    low: float
    high: float
    amplitude: float
    median: float
    frequency: float | None
    low_frequency: float | None
    high_frequency: float | None
    series: int
    of: int


@dataclass(frozen=True, kw_only=True, eq=False)
class OrderPassport:
    """How one order depends on load, direction, speed and temperature.

    Attributes
    ----------
    order : float
        Per output turn.
    amplitude, low, high : float
        Root of the mean power over the cases, rad, and its interval; 0 to infinite where nothing tells the noise.
    confidence : float
        Of all intervals.
    laws : tuple of DirectionLaw
        Forward first.
    constants, loads : BothWays or None
        The laws' constants and slopes in both directions; None where one is missing or the conditions differ.
    shares : mapping of str to float or None
        Of the mean power over the cases: ``constant``, ``load``, ``speed``, ``temperature``, ``left``; each part's own
        power over the sum of all, so they add up to 1.  None where the cases do not tell a part.
    peak : SpeedPeak or None
    reference_speed, reference_temperature : float or None
        Where the constants stand, rad/s and K.
    kinds : tuple of str
        Which kinds of causes can do that.
    """

    order: float
    amplitude: float
    low: float
    high: float
    confidence: float
    laws: tuple[DirectionLaw, ...]
    constants: BothWays | None
    loads: BothWays | None
    shares: Mapping[str, float | None]
    peak: SpeedPeak | None
    reference_speed: float | None
    reference_temperature: float | None
    kinds: tuple[str, ...]

    @property
    def bent(self) -> bool:
        """Whether a straight law does not hold in a direction."""
        return any(law.bent for law in self.laws)

    @property
    def alike(self) -> bool:
        """Whether the constants of both directions agree within the noise."""
        return self.constants is not None and self.constants.relation == "alike"

    @property
    def alike_load(self) -> bool:
        """Whether the load parts of both directions agree within the noise."""
        return self.loads is not None and self.loads.relation == "alike"

    @property
    def opposite(self) -> bool:
        """Whether the load parts agree within the noise but for their sign."""
        return self.loads is not None and self.loads.relation == "opposite"

    @property
    def mirrored(self) -> bool:
        """Whether the load parts' sizes agree within the noise, and their phases neither way."""
        return self.loads is not None and self.loads.relation == "mirrored"


@dataclass(frozen=True, kw_only=True, eq=False)
class _Cases:
    """All cases of one order as arrays; NaN where a condition is not known."""

    direction: Array
    torque: Array
    speed: Array
    temperature: Array
    waves: Waves
    sigma: Array  # NaN where not given

    def at(self, chosen: npt.NDArray[np.bool_] | npt.NDArray[np.intp]) -> _Cases:
        return _Cases(
            direction=self.direction[chosen],
            torque=self.torque[chosen],
            speed=self.speed[chosen],
            temperature=self.temperature[chosen],
            waves=self.waves[chosen],
            sigma=self.sigma[chosen],
        )

    def settings(self) -> dict[str, Array]:
        return {"torque": self.torque, "speed": self.speed, "temperature": self.temperature}


def passport(
    cases: Sequence[OrderCase], *, confidence: float = 0.95, ratio: float | None = None
) -> tuple[OrderPassport, ...]:
    """Tell of every order how it depends on load, direction, speed and temperature.

    Parameters
    ----------
    cases : sequence of OrderCase
        Orders within 1e-6 of each other are one; an order that a case does not hold is not known there.
    confidence : float
        Of the intervals.
    ratio : float, optional
        Input turns per output turn: names the input's orders, and gives peaks over speed their frequency.

    Returns
    -------
    tuple of OrderPassport
        The strongest first.

    Raises
    ------
    InputError
        If there are no cases, or a number of them or an argument cannot be used.

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
    >>> found.laws[0].slope.told, found.bent
    (True, False)
    """
    _check(cases, confidence, ratio)
    found = [
        _passport(order, gathered, confidence=confidence, ratio=None if ratio is None else abs(ratio))
        for order, gathered in _by_order(cases)
    ]
    return tuple(sorted(found, key=lambda one: (-one.amplitude, one.order)))


def _check(cases: Sequence[OrderCase], confidence: float, ratio: float | None) -> None:
    if not cases:
        raise InputError("there are no cases; give an order table with one or more conditions")
    if not 0.0 < confidence < 1.0:
        raise InputError(f"confidence = {confidence!r}; give a number between 0 and 1, like 0.95")
    if ratio is not None and not (math.isfinite(ratio) and ratio != 0):
        raise InputError(f"ratio = {ratio!r}; give the input turns per output turn")
    for number, case in enumerate(cases, 1):
        condition = case.condition
        given = (condition.torque, condition.input_speed, condition.temperature)
        sizes = {case.orders.size, case.waves.size, case.orders.size if case.sigma is None else case.sigma.size}
        if len(sizes) > 1:
            raise InputError(f"case {number}: orders, waves and sigma differ in length; give one of each per order")
        if condition.direction not in (-1.0, 1.0):
            raise InputError(f"case {number}: direction = {condition.direction!r}; give +1 forward or -1 reverse")
        if not (np.isfinite(case.waves).all() and all(math.isfinite(one) for one in given if one is not None)):
            raise InputError(f"case {number}: a wave or condition is not finite; leave out what is not known")
        if condition.torque is not None and condition.torque < 0:
            raise InputError(f"case {number}: torque = {condition.torque:g} N*mm; give its size, 0 or larger")
        if case.sigma is not None and not (np.isfinite(case.sigma).all() and (case.sigma > 0).all()):
            raise InputError(f"case {number}: a sigma is not above zero; leave sigma out where it is not known")


def _by_order(cases: Sequence[OrderCase]) -> list[tuple[float, _Cases]]:
    rows = sorted(
        (
            (float(order), at, place)
            for at, case in enumerate(cases)
            for place, order in enumerate(case.orders)
        ),
    )  # fmt: skip
    groups: list[list[tuple[float, int, int]]] = []
    for row in rows:
        if groups and row[0] - groups[-1][0][0] <= SAME_ORDER:
            groups[-1].append(row)
        else:
            groups.append([row])

    def known(value: float | None) -> float:
        return math.nan if value is None else value

    found = []
    for group in groups:
        held = [(cases[at], place) for _, at, place in group]
        found.append(
            (
                group[0][0],
                _Cases(
                    direction=np.array([case.condition.direction for case, _ in held]),
                    torque=np.array([known(case.condition.torque) for case, _ in held]),
                    speed=np.array([known(case.condition.input_speed) for case, _ in held]),
                    temperature=np.array([known(case.condition.temperature) for case, _ in held]),
                    waves=np.array([case.waves[place] for case, place in held], dtype=np.complex128),
                    sigma=np.array([math.nan if case.sigma is None else case.sigma[place] for case, place in held]),
                ),
            )
        )
    return found


def _passport(order: float, cases: _Cases, *, confidence: float, ratio: float | None) -> OrderPassport:
    same = {
        "torque": SAME_SETTING * _largest(cases.torque),
        "speed": SAME_SETTING * _largest(cases.speed),
        "temperature": SAME_TEMPERATURE,
    }
    ways = [cases.at(cases.direction == sign) for sign in (1.0, -1.0) if (cases.direction == sign).any()]
    reference = {name: _reference([one.settings()[name] for one in ways], same[name]) for name in NAMES}
    read = [_law(one, reference, same, confidence) for one in ways]
    laws = tuple(law for law, _, _ in read)
    constants = loads = None
    if len(read) == 2 and _comparable(read[0][2], read[1][2], same):
        constants = both_ways(laws[0].constant, laws[1].constant, confidence=confidence)
        if laws[0].slope is not None and laws[1].slope is not None:
            loads = both_ways(laws[0].slope, laws[1].slope, confidence=confidence)
    amplitude, low, high = _mean_amplitude(ways, laws, confidence)
    peak = _peak(order, ways, laws, same, ratio)
    shares = _shares([parts for _, parts, _ in read])
    kinds = kinds_of(
        order,
        amplitude=amplitude,
        constants=[law.constant for law in laws],
        slopes=[law.slope for law in laws],
        temperatures=[law.temperature for law in laws],
        speeds=[law.speed for law in laws],
        both_constants=constants,
        both_loads=loads,
        spans={name: _span(cases.settings()[name]) for name in NAMES},
        settings={name: max(level_of(cases.settings()[name], same[name])) + 1 for name in NAMES},
        largest_torque=_largest(cases.torque),
        peak_frequency=None if peak is None else peak.frequency,
        peaked=peak is not None,
        ratio=ratio,
        mixed=tuple(sorted({note for law in laws for note in law.not_told})),
    )
    return OrderPassport(
        order=order,
        amplitude=amplitude,
        low=low,
        high=high,
        confidence=confidence,
        laws=laws,
        constants=constants,
        loads=loads,
        shares=shares,
        peak=peak,
        reference_speed=reference["speed"],
        reference_temperature=reference["temperature"],
        kinds=kinds,
    )


def _largest(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(np.abs(known).max(initial=0.0))


def _span(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(np.ptp(known)) if known.size else 0.0


def _levels(values: Array, same: float) -> list[float]:
    """Settings: each begins where a value lies farther than `same` above the first of the last."""
    found: list[float] = []
    for value in np.sort(values):
        if not found or value - found[-1] > same:
            found.append(float(value))
    return found


def level_of(values: Array, same: float) -> list[int]:
    """Number of the setting of each value, -1 where not known."""
    levels = np.array(_levels(values[np.isfinite(values)], same))
    return [int(np.searchsorted(levels, v, side="right")) - 1 if math.isfinite(v) else -1 for v in values]


def _reference(ways: Sequence[Array], same: float) -> float | None:
    """Setting at which constants are told: one that a direction cannot leave, else the one of most cases."""
    if any(not np.isfinite(values).all() for values in ways):
        return None
    for values in ways:
        if float(np.ptp(values)) <= same:
            return float(values.mean())
    pooled = np.concatenate(ways)
    levels = _levels(pooled, same)
    counts = [int(np.sum((pooled >= level) & (pooled <= level + same))) for level in levels]
    level = levels[int(np.argmax(counts))]
    return float(pooled[(pooled >= level) & (pooled <= level + same)].mean())


def _comparable(one: Mapping[str, float], other: Mapping[str, float], same: Mapping[str, float]) -> bool:
    """Whether two constants stand at one torque, speed and temperature; what is not known anywhere is left open."""
    for name, limit in same.items():
        both = (one[name], other[name])
        if any(map(math.isfinite, both)) and not abs(both[0] - both[1]) <= limit:
            return False
    return True


def _law(
    cases: _Cases, reference: Mapping[str, float | None], same: Mapping[str, float], confidence: float
) -> tuple[DirectionLaw, Mapping[str, Waves], Mapping[str, float]]:
    """Law of one direction, the waves of each part in each of its cases, and where the constant stands."""
    held, notes = cases.waves.size, []
    has_load = np.isfinite(cases.torque)
    torques = len(_levels(cases.torque[has_load], same["torque"]))
    loaded = torques >= TORQUES_OF_A_LAW
    if loaded and not has_load.all():
        cases = cases.at(has_load)
        notes.append(f"{held - cases.waves.size} of {held} cases hold no torque and are left out")
    elif not loaded:
        few = {0: "no case holds a torque", 1: "all cases are at one torque"}.get(torques, "there are two torques only")
        notes.append(f"load is not told: {few}")
    settings = cases.settings()
    columns: dict[str, Array] = {"constant": np.ones(cases.waves.size)}
    if loaded:
        columns["torque"] = cases.torque
    base = tuple(columns)
    for name, called in NAMES.items():
        column, note = _column(columns, name, settings[name], reference[name], same[name])
        if column is not None:
            columns[name] = column
        elif note:
            notes.append(f"{called} is not told: {note}")
    fits, main, core = _fits(cases, columns, base, same, confidence)
    worst = int(np.argmax(np.abs(main.residual)))
    kept = cases.at(core)
    at_worst = float(kept.torque[worst])
    kept = kept.at(np.argsort(kept.torque, kind="stable"))
    law = DirectionLaw(
        direction=float(cases.direction[0]),
        cases=held,
        constant=fits["constant"],
        slope=fits.get("torque"),
        temperature=fits.get("temperature"),
        speed=fits.get("speed"),
        not_told=tuple(notes),
        bent=main.bent,
        deviation=float(np.abs(main.residual).max()),
        deviation_torque=at_worst if math.isfinite(at_worst) else None,
        noise=main.noise,
        torque=kept.torque,
        waves=kept.waves,
    )
    stands = {name: float(np.mean(values)) for name, values in settings.items()}
    for name in columns:
        if name != "constant":
            stands[name] = reference.get(name) or 0.0
    waves = {name: np.asarray(part.value * columns[name], dtype=np.complex128) for name, part in fits.items()}
    waves["left"] = cases.waves - np.sum(list(waves.values()), axis=0)
    return law, waves, stands


def _neighbours(cases: _Cases, same: Mapping[str, float]) -> list[tuple[int, int]]:
    """Pairs that follow each other along the load, and along the speed, while nothing else differs."""
    levels = {name: level_of(values, same[name]) for name, values in cases.settings().items()}
    pairs = []
    for along, others in (("torque", ("speed", "temperature")), ("speed", ("torque", "temperature"))):
        rows = zip(*(levels[name] for name in (*others, along)), range(cases.waves.size), strict=True)
        places = [row[-1] for row in sorted(rows)]
        for one, other in itertools.pairwise(places):
            apart = levels[along][one] != levels[along][other]
            if apart and all(levels[name][one] == levels[name][other] for name in others):
                pairs.append((one, other))
    return pairs


def _column(
    columns: Mapping[str, Array], name: str, values: Array, reference: float | None, same: float
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


def _fits(
    cases: _Cases, columns: Mapping[str, Array], base: Sequence[str], same: Mapping[str, float], confidence: float
) -> tuple[dict[str, WavePart], WaveFit, npt.NDArray[np.bool_]]:
    """Parts by name, the fit that the constant is from, and its cases.

    Where the cases at the reference are enough, or Chow's test lets no straight law stand over all conditions, as at a
    resonance, constant and slope are theirs, and speed and temperature those of cases that differ in nothing else.
    """
    every = np.ones(cases.waves.size, dtype=np.bool_)

    def fit(names: Sequence[str], chosen: npt.NDArray[np.bool_]) -> WaveFit:
        part = cases.at(chosen)
        return fit_waves(
            np.stack([columns[name][chosen] for name in names], axis=1),
            part.waves,
            confidence=confidence,
            sigma=part.sigma if np.isfinite(part.sigma).all() else None,
            neighbours=_neighbours(part, same),
            bend=np.exp(-part.torque / (LIGHT * part.torque.max())) if "torque" in names else None,
        )

    joint = fit(tuple(columns), every)
    found = dict(zip(columns, joint.parts, strict=True))
    at_reference = {
        name: np.abs(columns[name]) <= same[name] if name in columns else every for name in NAMES
    }  # fmt: skip
    core = at_reference["speed"] & at_reference["temperature"]
    torques = len(_levels(cases.torque[core], same["torque"])) if "torque" in base else TORQUES_OF_A_LAW
    if core.all() or int(core.sum()) <= len(base) or torques < TORQUES_OF_A_LAW:
        return found, joint, every
    main = fit(base, core)
    if main.spare < ENOUGH and not _another_law(joint, main):
        return found, joint, every
    found |= dict(zip(base, main.parts, strict=True))
    for name, other in (("speed", "temperature"), ("temperature", "speed")):
        alone = at_reference[other]
        if name in columns and not alone.all():
            rest = {one: columns[one][alone] for one in base}
            values = cases.settings()[name][alone]
            if _column(rest, name, values, float(values.mean()), same[name])[0] is not None:
                found[name] = fit((*base, name), alone).parts[-1]
    return found, main, core


def _another_law(joint: WaveFit, main: WaveFit) -> bool:
    """Whether the cases beyond the reference follow another law than those at it, by Chow's test."""
    more = 2 * (joint.spare - main.spare)
    if more <= 0 or main.spare <= 0:
        return False
    gained = max(joint.misfit - main.misfit, 0.0) / more
    return gained > main.variance * float(scipy.special.fdtri(more, 2 * main.spare, ONE_LAW))


def _mean_amplitude(
    ways: Sequence[_Cases], laws: Sequence[DirectionLaw], confidence: float
) -> tuple[float, float, float]:
    """Root of the mean power over the cases, and its interval.

    The sum of squares of n waves over the noise is a noncentral chi-square of 2 n degrees; its parameter's bounds solve
    (P - 2 n - L)^2 = t^2 (4 n + 4 L).  The upper one takes no noise off P, for a misfit may be a law and no noise.
    """
    power = float(sum(np.sum(np.abs(one.waves) ** 2) for one in ways))
    count = sum(one.waves.size for one in ways)
    size = math.sqrt(power / count)
    noise = math.sqrt(sum(law.noise**2 * one.waves.size for one, law in zip(ways, laws, strict=True)) / count)
    if not math.isfinite(noise):
        return size, 0.0, math.inf
    if noise == 0.0:
        return size, size, size
    freedom = min(law.constant.freedom for law in laws)
    t = float(scipy.special.stdtrit(min(freedom, 1e9), 0.5 + confidence / 2))
    told = power / noise**2
    less = max(told - 2 * count, 0.0)
    low = max(less + 2 * t**2 - t * math.sqrt(4 * less + 4 * t**2 + 4 * count), 0.0)
    high = told + 2 * t**2 + t * math.sqrt(4 * told + 4 * t**2 + 4 * count)
    scale = noise / math.sqrt(count)
    return size, scale * math.sqrt(low), scale * math.sqrt(high)


def _shares(parts: Sequence[Mapping[str, Waves]]) -> dict[str, float | None]:
    count = sum(one["constant"].size for one in parts)
    powers: dict[str, float | None] = {}
    for name, called in _SHARED.items():
        held = [float(np.sum(np.abs(one[name]) ** 2)) / count for one in parts if name in one]
        powers[called] = sum(held) if held else None
    whole = sum(power for power in powers.values() if power is not None)
    return {
        called: None if power is None else (power / whole if whole > 0 else 0.0) for called, power in powers.items()
    }


def _peak(
    order: float, ways: Sequence[_Cases], laws: Sequence[DirectionLaw], same: Mapping[str, float], ratio: float | None
) -> SpeedPeak | None:
    """The maximum over speed that stands out most, of all series of one direction, torque and temperature."""
    found: list[tuple[float, SpeedPeak]] = []
    looked_at = 0
    for cases, law in zip(ways, laws, strict=True):
        known = cases.at(np.isfinite(cases.speed))
        groups = list(zip(*(level_of(known.settings()[n], same[n]) for n in ("torque", "temperature")), strict=True))
        for group in sorted(set(groups)):
            series = known.at(np.array([one == group for one in groups], dtype=np.bool_))
            level = np.array(level_of(series.speed, same["speed"]), dtype=np.intp)
            count = int(level.max(initial=-1)) + 1
            if count < SPEEDS_OF_A_PEAK:
                continue
            looked_at += 1
            speed = np.array([series.speed[level == at].mean() for at in range(count)])
            waves = np.array([series.waves[level == at].mean() for at in range(count)])
            size = np.abs(waves)
            top, median = int(np.argmax(size)), float(np.median(size))
            noise = _noise_of(series, waves, law)
            if not 0 < top < count - 1:
                continue
            falls = max(float(size[:top].min()), float(size[top + 1 :].min())) <= HALF_POWER * size[top]
            if falls and size[top] >= max(STANDS_OUT * median, median + CLEAR * noise):
                torque = float(series.torque.mean())
                frequencies = [None if ratio is None else order * v / (2 * math.pi * ratio) for v in speed]
                peak = SpeedPeak(
                    direction=law.direction,
                    torque=torque if math.isfinite(torque) else None,
                    speed=float(speed[top]),
                    low=float(speed[top - 1]),
                    high=float(speed[top + 1]),
                    amplitude=float(size[top]),
                    median=median,
                    frequency=frequencies[top],
                    low_frequency=frequencies[top - 1],
                    high_frequency=frequencies[top + 1],
                    series=1,
                    of=1,
                )
                found.append((float(size[top]) / (median or math.inf), peak))
    if not found:
        return None
    best = max(found, key=lambda one: one[0])[1]
    lowest = min((one for _, one in found), key=lambda one: one.low)
    highest = max((one for _, one in found), key=lambda one: one.high)
    return replace(
        best,
        low=lowest.low,
        low_frequency=lowest.low_frequency,
        high=highest.high,
        high_frequency=highest.high_frequency,
        series=len(found),
        of=looked_at,
    )


def _noise_of(series: _Cases, waves: Waves, law: DirectionLaw) -> float:
    """Noise along a series over speed: sigma; else the law's or that of most steps from speed to speed, the smaller."""
    if np.isfinite(series.sigma).all():
        return float(series.sigma.max())
    if waves.size < SPEEDS_OF_STEPS:
        return law.noise
    # the median of a Rayleigh law is its deviation times sqrt(2 ln 2); a difference has twice the variance
    return min(law.noise, float(np.median(np.abs(np.diff(waves)))) / math.sqrt(4 * math.log(2)))
