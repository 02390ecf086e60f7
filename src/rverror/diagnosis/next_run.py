"""What to measure next: the run that would separate causes which explain the same residual, or place a line.

The answer follows from what the catalogue says of each cause: the frame it is fixed in, its orders, whether the
direction or the load changes it, and the waveforms that the closed form gives it in either direction.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from rverror.base.text import describe
from rverror.base.units import to_display
from rverror.diagnosis.causes import Named
from rverror.diagnosis.pairs import Coverage as Coverage, Pair, closed_form_states, is_delay
from rverror.geartrain.kinematics import folded_order, samples_needed
from rverror.geartrain.mechanism import Mechanism, Reducer
from rverror.geartrain.source import Source
from rverror.model.catalogue import source
from rverror.model.effects import Effect
from rverror.runs.spectrum import frames_of_order


@dataclass(frozen=True)
class Measurement:
    """A measurement and what it would settle.

    Attributes
    ----------
    name : str
        Short name of the rule, for programs.
    what : str
        What to do, for people.
    why : str
        What then differs.
    separates : tuple of cause
        Key and indices of each cause that it tells from the one that was named; empty where it proves that one.
    """

    name: str
    what: str
    why: str
    separates: tuple[Named, ...] = ()


@dataclass(frozen=True)
class Fold:
    """An order above the Nyquist order that would show at a line's, and the frames it fits."""

    order: float
    frames: tuple[str, ...]


def _in_gears(entry: Source) -> bool:
    return not entry.at_output


def _has(dimension: str) -> Callable[[Source], bool]:
    return lambda entry: any(parameter.dimension == dimension for parameter in entry.parameters)


_gives_way, _warms = _has("compliance"), _has("temperature_rise")


def _is_drift(entry: Source) -> bool:
    return entry.follows == "time"


def _is_reading(entry: Source) -> bool:
    return entry.frame == "output" and entry.periodic


def _is_input_coupling(entry: Source) -> bool:
    return entry.acts == "reading" and entry.frame == "sun"


def _depends_on_load(entry: Source) -> bool:
    """Play and ground-off profile: what they do changes with the load that closes them."""
    return entry.frame == "bearing" or any(parameter.least == 0.0 for parameter in entry.parameters)


@dataclass(frozen=True)
class _Rule:
    """When a measurement separates a pair, and how to say it; in braces stands what `_words` has."""

    name: str
    what: str
    why: str
    helps: Callable[[Pair], bool]


#: The surest and cheapest first; each pair takes every rule that helps.
_RULES = (
    _Rule(
        "marks",
        "the same runs with the bench's zero on the marks of crank and carrier",
        "they differ in phase alone, which an unknown zero hides",
        lambda p: not p.coverage.marks and p.effect.key == p.other[0],
    ),
    _Rule(
        "reverse",
        "a run {direction} at the same load",
        "in one direction another leaves {now} of the waveform, in both directions together {both}",
        lambda p: len(p.coverage.directions) == 1 and p.differs(p.both, p.now) and not p.either(_is_drift),
    ),
    _Rule(
        "whole turn",
        "a run over a whole output turn or more",
        "over {travel} deg {named} cannot be distinguished from {others} ({now} of the waveform differs), over "
        "whole turns {whole} does",
        lambda p: p.coverage.travel is not None and p.differs(p.whole, p.now),
    ),
    _Rule(
        "return",
        "a run there and back over the same angles at once",
        "a drift goes on with the time; what follows the angle retraces its way, what the speed changes sign",
        lambda p: p.one_of(_is_drift),
    ),
    _Rule(
        "speed",
        "a run at another speed{and_back}",
        "a delay shifts the reading in proportion to the speed; nothing else does",
        lambda p: p.one_of(is_delay),
    ),
    _Rule(
        "encoder",
        "the same runs with the output encoder remounted by 90 degrees",
        "the encoder's own error turns with it, nothing else does",
        lambda p: p.one_of(_is_reading),
    ),
    _Rule(
        "input coupling",
        "the same runs with the input encoder or its coupling remounted by 90 degrees on the input shaft",
        "an error of encoder or coupling turns with it, one inside the drive does not",
        lambda p: p.one_of(_is_input_coupling),
    ),
    _Rule(
        "temperature",
        "the same run at a temperature 20 K higher or lower",
        "thermal growth follows the temperature; the others stay",
        lambda p: p.one_of(_warms),
    ),
    _Rule(
        "heavy load",
        "a run at a much heavier load{heavier}",
        "what play and compliance do changes with the load; a part error's waveform settles as pins close, and "
        "{now} of it is then out of the other's reach",
        lambda p: p.one_of(_gives_way) or (p.both_are(_in_gears) and (p.one_of(_depends_on_load) or p.differs(p.now))),
    ),
    _Rule(
        "light load",
        "a run at a much lighter load{lighter}",
        "under full contact their waveforms are one and the same; at light load each lifts other pins off, and only "
        "that can break the tie",
        lambda p: p.both_are(_in_gears) and not p.differs(p.both),
    ),
    _Rule(
        "longer",
        "a longer run: four times as many revolutions, or cycles of the motion, halve what noise leaves open",
        "their waveforms differ by {now}, less than the noise resolves",
        lambda p: p.differs(p.now),
    ),
)
_LAST = _Rule(
    "parts",
    "the parts themselves, on a measuring machine",
    "no run on this bench is known to separate them",
    lambda p: True,
)

#: What proves a cause that nothing else explains as well.
_PROOFS = {"encoder": _is_reading, "input coupling": _is_input_coupling}


def _words(coverage: Coverage, mechanism: Mechanism, pairs: Sequence[Pair]) -> dict[str, str]:
    """What rules fill in."""
    low, high = coverage.travel or (0.0, 2 * math.pi)
    direction = "in reverse" if coverage.directions == {1.0} else "forward"
    return {
        "direction": direction,
        "and_back": f", and one {direction}" if len(coverage.directions) == 1 else "",
        "heavier": _load(coverage, mechanism, 10),
        "lighter": _load(coverage, mechanism, 0.1),
        "travel": f"{math.degrees(high - low):.3g}",
        "named": describe(pairs[0].effect.key, pairs[0].effect.indices) if pairs else "",
        "others": " or ".join(describe(*pair.other) for pair in pairs),
        "now": _percent([pair.now for pair in pairs]),
        "both": _percent([pair.both for pair in pairs]),
        "whole": _percent([pair.whole for pair in pairs]),
    }


def _percent(shares: Sequence[float]) -> str:
    low, high = (f"{100 * share:.0f}" for share in (min(shares, default=0.0), max(shares, default=0.0)))
    if high == "0":
        return "less than 1 %"
    return f"{low} %" if low == high else f"{low} to {high} %"


def _load(coverage: Coverage, mechanism: Mechanism, factor: float) -> str:
    """``, for instance 2 N*m where these had 20 N*m``; nothing where no load is known."""
    if not coverage.torques:
        return ""
    now = min(coverage.torques) if factor < 1 else max(coverage.torques)
    most = mechanism.rated_torque if isinstance(mechanism, Reducer) else None
    wanted = min(factor * now, most or math.inf)
    if factor > 1 and wanted < 1.5 * now:
        return ""
    shown = (f"{to_display(value, 'torque'):.3g} N*m" for value in (wanted, now))
    return ", for instance {} where these had {}".format(*shown)


def to_separate(
    mechanism: Mechanism, effect: Effect, others: Sequence[Named], coverage: Coverage
) -> tuple[Measurement, ...]:
    """Measurements that would tell a named cause from others that explain the runs as well.

    Parameters
    ----------
    mechanism : Reducer or Drive
    effect : Effect
        The named cause with its fitted size.
    others : sequence of (str, mapping)
        Keys and indices of the others.
    coverage : Coverage
        What the runs cover.

    Returns
    -------
    tuple of Measurement
        The surest first; where there is no other, what would prove the cause, if anything does.

    Examples
    --------
    >>> from rverror import effect, reducer
    >>> coverage = Coverage(directions=frozenset({1.0}), samples_per_turn=4096)
    >>> found = effect("crank.eccentricity", crank=0, disc=0, radial="5 um")
    >>> bore = ("cycloid.disc_bore_position", {"disc": 0, "crank": 0})
    >>> to_separate(reducer("RV-40E"), found, [bore], coverage)[0].what
    'a run in reverse at the same load'
    """
    if others:
        whole = closed_form_states(mechanism)
        seen = closed_form_states(mechanism, coverage.travel) if coverage.travel else whole
        pairs = [Pair(effect, other, coverage, seen, whole) for other in others]
        chosen = [(rule, [pair for pair in pairs if rule.helps(pair)]) for rule in _RULES]
        chosen.append((_LAST, [pair for pair in pairs if not any(pair in settled for _, settled in chosen)]))
        chosen = [(rule, settled) for rule, settled in chosen if settled]
    else:
        entry = source(effect.key)
        chosen = [(rule, []) for rule in _RULES if rule.name in _PROOFS and _PROOFS[rule.name](entry)]
    found = []
    for rule, settled in chosen:
        words = _words(coverage, mechanism, settled)
        separates = tuple(pair.other for pair in settled)
        found.append(Measurement(rule.name, rule.what.format(**words), rule.why.format(**words), separates))
    return tuple(found)


def folds(mechanism: Mechanism, order: float, samples_per_turn: float) -> tuple[Fold, ...]:
    """Orders above the Nyquist order that would show at `order`, with the frames they fit.

    Parameters
    ----------
    mechanism : Reducer or Drive
    order : float
        Of the line, per output turn.
    samples_per_turn : float
        Folds about this and twice as much are looked at.

    Returns
    -------
    tuple of Fold
        The lowest first.

    Examples
    --------
    >>> from rverror import reducer
    >>> [fold.order for fold in folds(reducer("RV-40E"), 80, 1000) if "gear mesh 1080" in fold.frames]
    [1080.0]
    """
    if not math.isfinite(samples_per_turn):
        return ()
    above = sorted({float(k * samples_per_turn + side * order) for k in (1, 2) for side in (-1, 1)} - {float(order)})
    return tuple(
        Fold(high, tuple(frames_of_order(mechanism, high)))
        for high in above
        if high > samples_per_turn / 2 and math.isclose(folded_order(high, samples_per_turn), order, abs_tol=1e-6)
    )


def to_place(mechanism: Mechanism, orders: Sequence[float], coverage: Coverage) -> tuple[Measurement, ...]:
    """Measurements that would place lines which no candidate explains.

    Parameters
    ----------
    mechanism : Reducer or Drive
    orders : sequence of float
        Of the lines, per output turn.
    coverage : Coverage

    Returns
    -------
    tuple of Measurement
    """
    if not orders:
        return ()
    words = _words(coverage, mechanism, ())
    found = []
    if isinstance(mechanism, Reducer) and math.isfinite(coverage.samples_per_turn):
        count = max(samples_needed(mechanism), math.ceil(2.5 * coverage.samples_per_turn))
        known = [f for order in orders for f in folds(mechanism, order, coverage.samples_per_turn) if f.frames]
        above = f"order {known[0].order:g}, {known[0].frames[0]}," if known else "a line above it"
        why = (
            f"the Nyquist order was {coverage.samples_per_turn / 2:g}: {above} would have folded to here; what folded "
            "then moves, a true line stays"
        )
        found.append(Measurement("sampling", f"a run with {count} samples an output turn", why))
    if len(coverage.directions) == 1:
        what = f"a run {words['direction']} at the same load"
        found.append(Measurement("reverse", what, "what changes with the direction comes from loaded contacts"))
    what = f"the same runs with the output encoder remounted by {_half_period(orders[0]):.4g} degrees"
    why = f"order {orders[0]:g} then changes its sign if it is the encoder's, and stays if it is the gear's"
    found.append(Measurement("encoder", what, why))
    what = f"a run at another load{words['heavier']}"
    found.append(Measurement("load", what, "a line that keeps its size comes from the measuring chain or rigid parts"))
    return tuple(found)


def _half_period(order: float) -> float:
    """Smallest angle from 5 degrees on by which an encoder is remounted to turn the phase of an order by 180 degrees.

    A small one, because the order is known to some digits only.
    """
    half = 180.0 / order
    return half * (2 * math.ceil((5.0 / half - 1) / 2 - 1e-9) + 1) if half < 5.0 else half
