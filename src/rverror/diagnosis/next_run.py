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
from rverror.diagnosis.pairs import Cause, Circumstances as Circumstances, Pair, closed_form_states, is_delay
from rverror.geartrain.kinematics import folded_order, samples_needed
from rverror.geartrain.mechanism import Drive, Mechanism, Reducer
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
    separates: tuple[Cause, ...] = ()


@dataclass(frozen=True)
class Fold:
    """An order above the Nyquist order that would show at a line's, and the frames it fits."""

    order: float
    frames: tuple[str, ...]


def _in_gears(entry: Source) -> bool:
    return not entry.at_output


def _has(*dimensions: str) -> Callable[[Source], bool]:
    return lambda entry: any(parameter.dimension in dimensions for parameter in entry.parameters)


def _is_drift(entry: Source) -> bool:
    return entry.follows == "time"


def _is_reading(entry: Source) -> bool:
    return entry.frame == "output" and entry.periodic


def _is_input_coupling(entry: Source) -> bool:
    return entry.acts == "reading" and entry.frame == "sun"


def _depends_on_load(entry: Source) -> bool:
    """Play and ground-off profile: what they do changes with the load that closes them."""
    return entry.frame == "bearing" or any(parameter.least == 0.0 for parameter in entry.parameters)


def _percent(shares: Sequence[float]) -> str:
    low, high = (100 * share for share in (min(shares), max(shares)))
    if high < 1:
        return "less than 1 %"
    return f"{low:.0f} %" if round(low) == round(high) else f"{low:.0f} to {high:.0f} %"


def _load(bench: Circumstances, mechanism: Mechanism, factor: float) -> str:
    """``, for instance 2 N*m where these had 20 N*m``; nothing where no load is known."""
    known = sorted(bench.torques)
    if not known:
        return ""
    now = known[0] if factor < 1 else known[-1]
    wanted = factor * now
    if isinstance(mechanism, Reducer) and mechanism.rated_torque and factor > 1:
        wanted = min(wanted, mechanism.rated_torque)
        if wanted < 1.5 * now:
            return ""
    high, low = (f"{to_display(value, 'torque'):.3g} N*m" for value in (wanted, now))
    return f", for instance {high} where these had {low}"


def _other_direction(bench: Circumstances) -> str:
    return "in reverse" if bench.directions == {1.0} else "forward"


def _another_speed(bench: Circumstances) -> str:
    one_way = len(bench.directions) == 1
    return "a run at another speed" + (f", and one {_other_direction(bench)}" if one_way else "")


def _alike_over_a_part(pairs: Sequence[Pair]) -> str:
    """That a part of a turn hides what whole turns show."""
    low, high = pairs[0].bench.travel or (0.0, 2 * math.pi)
    named, others = pairs[0].effect, " or ".join(describe(*pair.other) for pair in pairs)
    return (
        f"over {math.degrees(high - low):.3g} deg {describe(named.key, named.indices)} cannot be told from {others} "
        f"({_percent([p.now for p in pairs])} of the waveform differs), over whole turns "
        f"{_percent([p.whole for p in pairs])} does"
    )


@dataclass(frozen=True)
class _Rule:
    """When a measurement separates a pair, and how to say it."""

    name: str
    helps: Callable[[Pair], bool]
    what: Callable[[Circumstances, Mechanism], str]
    why: Callable[[Sequence[Pair]], str]


def _always(text: str) -> Callable[[object], str]:
    return lambda _: text


def _plain(text: str) -> Callable[[Circumstances, Mechanism], str]:
    return lambda bench, mechanism: text


#: The surest and cheapest first; each pair takes every rule that helps.
_RULES = (
    _Rule(
        "marks",
        lambda p: not p.bench.marks and p.effect.key == p.other[0],
        _plain("the same runs with the bench's zero on the marks of crank and carrier"),
        _always("they differ in phase alone, which an unknown zero hides"),
    ),
    _Rule(
        "sampling",
        lambda p: p.folded_together,
        lambda bench, mechanism: f"runs with {_needed(mechanism)} samples an output turn or more",
        _always("their orders differ, but fold onto each other at this sampling"),
    ),
    _Rule(
        "reverse",
        lambda p: (
            len(p.bench.directions) == 1 and p.differs(p.both) and p.differs(p.both, p.now) and not p.either(_is_drift)
        ),
        lambda bench, mechanism: f"a run {_other_direction(bench)} at the same load",
        lambda pairs: (
            f"in one direction another leaves {_percent([p.now for p in pairs])} of the waveform, in both "
            f"directions together {_percent([p.both for p in pairs])}"
        ),
    ),
    _Rule(
        "whole turn",
        lambda p: p.bench.travel is not None and p.differs(p.whole, p.now),
        _plain("a run over a whole output turn or more"),
        _alike_over_a_part,
    ),
    _Rule(
        "return",
        lambda p: p.one_of(_is_drift),
        _plain("a run there and back over the same angles at once"),
        _always("a drift goes on with the time; what follows the angle retraces its way, what the speed changes sign"),
    ),
    _Rule(
        "speed",
        lambda p: p.one_of(is_delay),
        lambda bench, mechanism: _another_speed(bench),
        _always("a delay shifts the reading in proportion to the speed; nothing else does"),
    ),
    _Rule(
        "encoder",
        lambda p: p.one_of(_is_reading),
        _plain("the same runs with the output encoder remounted by 90 degrees"),
        _always("the encoder's own error turns with it, nothing else does"),
    ),
    _Rule(
        "input coupling",
        lambda p: p.one_of(_is_input_coupling),
        _plain("the same runs with the input encoder or its coupling remounted by 90 degrees on the input shaft"),
        _always("an error of encoder or coupling turns with it, one inside the drive does not"),
    ),
    _Rule(
        "temperature",
        lambda p: p.one_of(_has("temperature_rise")),
        _plain("the same run at a temperature 20 K higher or lower"),
        _always("thermal growth follows the temperature; the others stay"),
    ),
    _Rule(
        "two loads",
        lambda p: p.one_of(_has("compliance")) or (p.one_of(_depends_on_load) and p.both_are(_in_gears)),
        lambda bench, mechanism: f"a run at a much heavier load{_load(bench, mechanism, 10)}",
        _always("what play and compliance do changes with the load; a part error's waveform settles as pins close"),
    ),
    _Rule(
        "heavy load",
        lambda p: p.both_are(_in_gears) and p.differs(p.now) and not p.one_of(_depends_on_load),
        lambda bench, mechanism: f"a run at a much heavier load{_load(bench, mechanism, 10)}",
        lambda pairs: (
            "with all loaded pins closed the waveforms are the linear ones, and "
            f"{_percent([p.now for p in pairs])} of one is then out of the other's reach"
        ),
    ),
    _Rule(
        "light load",
        lambda p: p.both_are(_in_gears) and not p.differs(p.both),
        lambda bench, mechanism: f"a run at a much lighter load{_load(bench, mechanism, 0.1)}",
        _always(
            "under full contact their waveforms are one and the same; at light load each lifts other pins off, "
            "and only that can break the tie"
        ),
    ),
    _Rule(
        "longer",
        lambda p: p.differs(p.now),
        _plain("a longer run: four times as many revolutions, or cycles of the motion, halve what noise leaves open"),
        lambda pairs: f"their waveforms differ by {_percent([p.now for p in pairs])}, less than the noise resolves",
    ),
    _Rule(
        "shared zero",
        lambda p: not p.bench.shared_zero and p.both_are(_in_gears) and p.differs(p.zero, p.both),
        _plain("forward and reverse runs from one zero, both with the same '# index:' label"),
        _always("their lost motion differs, which counts as far as backlash and clearances are known"),
    ),
)
_LAST = _Rule(
    "parts",
    lambda p: True,
    _plain("the parts themselves, on a measuring machine"),
    _always("no run on this bench is known to separate them"),
)

#: What proves a cause that nothing else explains as well.
_PROOFS: tuple[tuple[str, Callable[[Source], bool]], ...] = (
    ("encoder", _is_reading),
    ("input coupling", _is_input_coupling),
)


def _needed(mechanism: Mechanism) -> int:
    if isinstance(mechanism, Drive):
        highest = max([abs(mechanism.ratio), *map(abs, mechanism.shafts.values())])
        return int(2 ** math.ceil(math.log2(16 * highest + 1)))
    return samples_needed(mechanism)


def to_separate(
    mechanism: Mechanism, effect: Effect, others: Sequence[Cause], bench: Circumstances
) -> tuple[Measurement, ...]:
    """Measurements that would tell a named cause from others that explain the runs as well.

    Parameters
    ----------
    mechanism : Reducer or Drive
    effect : Effect
        The named cause with its fitted size.
    others : sequence of (str, mapping)
        Keys and indices of the others.
    bench : Circumstances
        What the runs cover.

    Returns
    -------
    tuple of Measurement
        The surest first; where there is no other, what would prove the cause, if anything does.

    Examples
    --------
    >>> from rverror import effect, reducer
    >>> bench = Circumstances(directions=frozenset({1.0}), samples_per_turn=4096)
    >>> found = effect("crank.eccentricity", crank=0, disc=0, radial="5 um")
    >>> bore = ("cycloid.disc_bore_position", {"disc": 0, "crank": 0})
    >>> to_separate(reducer("RV-40E"), found, [bore], bench)[0].what
    'a run in reverse at the same load'
    """
    if not others:
        entry = source(effect.key)
        proofs = {name for name, fits in _PROOFS if fits(entry)}
        return tuple(
            Measurement(rule.name, rule.what(bench, mechanism), rule.why(())) for rule in _RULES if rule.name in proofs
        )
    whole = closed_form_states(mechanism)
    seen = closed_form_states(mechanism, bench.travel) if bench.travel else whole
    pairs = [Pair(mechanism, effect, other, bench, seen, whole) for other in others]
    helped = [(rule, [pair for pair in pairs if rule.helps(pair)]) for rule in _RULES]
    stuck = [pair for pair in pairs if not any(pair in settled for _, settled in helped)]
    chosen = [(rule, settled) for rule, settled in [*helped, (_LAST, stuck)] if settled]
    return tuple(
        Measurement(rule.name, rule.what(bench, mechanism), rule.why(settled), tuple(pair.other for pair in settled))
        for rule, settled in chosen
    )


def folds(mechanism: Mechanism, order: float, samples_per_turn: float, *, most: int = 2) -> tuple[Fold, ...]:
    """Orders above the Nyquist order that would show at `order`, with the frames they fit.

    Parameters
    ----------
    mechanism : Reducer or Drive
    order : float
        Of the line, per output turn.
    samples_per_turn : float
    most : int
        Up to which multiple of the sampling.

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
    above = sorted(
        {float(k * samples_per_turn + side * order) for k in range(1, most + 1) for side in (-1, 1)} - {float(order)}
    )
    return tuple(
        Fold(high, tuple(frames_of_order(mechanism, high)))
        for high in above
        if high > samples_per_turn / 2 and math.isclose(folded_order(high, samples_per_turn), order, abs_tol=1e-6)
    )


def to_place(mechanism: Mechanism, orders: Sequence[float], bench: Circumstances) -> tuple[Measurement, ...]:
    """Measurements that would place lines which no candidate explains.

    Parameters
    ----------
    mechanism : Reducer or Drive
    orders : sequence of float
        Of the lines, per output turn.
    bench : Circumstances

    Returns
    -------
    tuple of Measurement
    """
    if not orders:
        return ()
    found = []
    if math.isfinite(bench.samples_per_turn):
        what = f"a run with {_another_sampling(mechanism, bench.samples_per_turn)} samples an output turn"
        known = [f for order in orders for f in folds(mechanism, order, bench.samples_per_turn) if f.frames]
        above = f"order {known[0].order:g}, {known[0].frames[0]}," if known else "a line above it"
        why = (
            f"the Nyquist order was {bench.samples_per_turn / 2:g}: {above} would have folded to here; what folded "
            "then moves, a true line stays"
        )
        found.append(Measurement("sampling", what, why))
    if len(bench.directions) == 1:
        what = f"a run {_other_direction(bench)} at the same load"
        found.append(Measurement("reverse", what, "what changes with the direction comes from loaded contacts"))
    angle = _half_period(orders[0])
    found.append(
        Measurement(
            "encoder",
            f"the same runs with the output encoder remounted by {angle:.4g} degrees",
            f"order {orders[0]:g} then changes its sign if it is the encoder's, and stays if it is the gear's",
        )
    )
    what = f"a run at another load{_load(bench, mechanism, 10)}"
    found.append(Measurement("load", what, "a line that keeps its size comes from the measuring chain or rigid parts"))
    return tuple(found)


def _half_period(order: float) -> float:
    """Smallest angle from 5 degrees on by which an encoder is remounted to turn the phase of an order by 180 degrees.

    A small one, because the order is known to some digits only.
    """
    half = 180.0 / order
    return half * (2 * math.ceil((5.0 / half - 1) / 2 - 1e-9) + 1) if half < 5.0 else half


def _another_sampling(mechanism: Mechanism, now: float) -> int:
    """Samples a turn that hold every known order and put what folded at the present ones elsewhere."""
    return max(_needed(mechanism), math.ceil(2.5 * now))
