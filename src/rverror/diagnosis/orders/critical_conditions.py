"""What natural frequencies mean for the conditions of a table: which lie near one, and whether the model has it."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.base.numbers import brief, count_of
from rverror.diagnosis.order_passport import rows_of
from rverror.diagnosis.orders.resonances import Resonance, magnified
from rverror.dynamics.at_speed import CRITICAL
from rverror.dynamics.natural_modes import Modes, modes
from rverror.geartrain.mechanism import Reducer
from rverror.model.effects import Model
from rverror.runs.order_table import OrderCase
from rverror.statics.loaded_state import NotConvergedError

_GAP = 1.5  # times the usual step of the speeds
_INERTIA_SPREAD = 0.3  # of the logarithm of an inertia that is estimated: the widths of its parts are not stated


def critical_notes(model: Model, cases: Sequence[OrderCase], found: Sequence[Resonance]) -> list[str]:
    """What is said of conditions near a natural frequency, measured or the model's, and of the model's modes.

    Parameters
    ----------
    model : Model
        Of a reducer, as declared.
    cases : sequence of OrderCase
    found : sequence of Resonance
    """
    unit = model.mechanism
    assert isinstance(unit, Reducer)
    stated = bool(model.bench.given()) or any(value is not None for value in vars(unit.inertia).values())
    notes = [flagged(cases, one.frequency, one.damping_ratio, ratio=unit.ratio, orders=one.orders) for one in found]
    if found or (stated and len({case.condition.input_speed for case in cases}) > 1):
        torques = [case.condition.torque for case in cases if case.condition.torque]
        try:
            its = modes(model, torque=units.InCore(np.median(torques)) if torques else None)
        except (InputError, NotConvergedError) as why:
            return [*notes, f"the model's natural frequencies are not known: {why}"]
        ends = spread(its, unit)
        notes += [tied(one, its, ends, bench=bool(model.bench.given())) for one in found]
        for mode in () if found else _of_the_machine(its):
            own = float(its.frequency[mode]), float(its.damping_ratio[mode])
            orders = {order for case in cases for order in case.orders.tolist()}
            notes.append(flagged(cases, *own, ratio=unit.ratio, orders=orders, whose="the model's "))
    return [*filter(None, notes), *_at_ends(found)]


def flagged(
    cases: Sequence[OrderCase],
    natural: float,
    damping: float,
    *,
    ratio: float,
    orders: Collection[float],
    whose: str = "",
) -> str:
    """Conditions at which an order is magnified twice or more by a natural frequency, in one line; empty where none is.

    Parameters
    ----------
    cases : sequence of OrderCase
    natural : float
        Hz.
    damping : float
    ratio : float
        Input turns per output turn.
    orders : collection of float
        Which are looked at.
    whose : str
        Of which it is.
    """
    rows = rows_of(cases)
    rows = rows[np.isin(np.round(rows["order"], 6), np.round(list(orders), 6)) & (rows["speed"] > 0)]
    near = rows[magnified(rows["order"] * rows["speed"] / (2 * math.pi * abs(ratio)), natural, damping) >= CRITICAL]
    if not near.size:
        return ""
    speeds = {order: near["speed"][near["order"] == order] for order in np.unique(near["order"])}
    listed = ", ".join(f"{order:g} {_span(own)}" for order, own in speeds.items())
    return (
        f"near a critical speed: {count_of(np.unique(near['case']).size, 'condition')} of {len(cases)}, where {whose}"
        f"{brief(natural)} Hz magnifies an order {CRITICAL:g} times or more; order {listed} rpm"
    )


def _span(speeds: Array) -> str:
    low, high = brief(_rpm(float(speeds.min()))), brief(_rpm(float(speeds.max())))
    return f"at {low}" if low == high else f"from {low} to {high}"


def _rpm(speed: float) -> float:
    return units.to_display(speed, "angular_speed")


def _of_the_machine(its: Modes) -> list[int]:
    return np.flatnonzero((its.frequency > 0) & ~its.of_sun_support).tolist()


def spread(its: Modes, unit: Reducer) -> Array:
    """Standard deviation of the logarithm of each frequency by what is known of stiffness and inertias, shape (m,).

    Parameters
    ----------
    its : Modes
    unit : Reducer
    """
    known = dict.fromkeys(its.estimated, _INERTIA_SPREAD) | vars(unit.stiffness_uncertainty)
    squares = np.zeros(its.frequency.size)
    for name, change in its.sensitivity.items():
        squares += (known.get(name, 0.0) * change / np.maximum(its.frequency, 1e-12)) ** 2
    return np.asarray(np.sqrt(squares))


def tied(one: Resonance, its: Modes, deviations: Array, *, bench: bool) -> str:
    """Whether a natural frequency that was measured can be a mode of the model, in a sentence.

    Parameters
    ----------
    one : Resonance
    its : Modes
    deviations : ndarray, shape (m,)
        As `spread` has them.
    bench : bool
        Whether the model says what hangs on both ends.
    """
    own = _of_the_machine(its)
    if not own:
        return ""
    mode = min(own, key=lambda n: abs(math.log(float(its.frequency[n]) / one.frequency)))
    there, wide = float(its.frequency[mode]), math.exp(1.96 * float(deviations[mode]))
    low, high = (end if math.isfinite(end) else one.frequency for end in (one.low, one.high))
    inside = there / wide <= high and there * wide >= low
    verdict = "overlaps with what is measured, so it can be this mode" if inside else "does not reach what is measured"
    said = (
        f"of the model's modes at {its.torque / 1e3:g} N*m number {mode + 1} is nearest to {brief(one.frequency)} Hz: "
        f"{brief(there)} Hz, {brief(there / wide, 3)} to {brief(there * wide, 3)} by what is known of its stiffness "
        f"and inertias, which {verdict}"
    )
    if not bench:
        said += "; the model says nothing of what the bench hangs on both ends ([bench]), which may make it"
    return said


def _at_ends(found: Sequence[Resonance]) -> list[str]:
    """Peaks at a gap or an end of the speeds, in a line each."""
    notes = []
    for one in found:
        for order in one.orders:
            strongest = max((own for own in one.series if own.order == order), key=lambda own: np.abs(own.waves).max())
            speeds = np.unique(strongest.speed)
            steps = np.diff(speeds)
            top = int(np.searchsorted(speeds, strongest.speed[int(np.argmax(np.abs(strongest.waves)))]))
            peak = f"{brief(one.frequency)} Hz: order {order:g} is largest at"
            if top in (0, speeds.size - 1):
                notes.append(
                    f"{peak} the end of the speeds, {brief(_rpm(speeds[top]))} rpm: only a flank of its peak is seen"
                )
            elif max(steps[top - 1], steps[top]) > _GAP * np.median(steps):
                low, highest, high = (brief(_rpm(speed)) for speed in speeds[top - 1 : top + 2])
                notes.append(
                    f"{peak} a gap of the speeds, at {highest} rpm: by itself it tells its peak between {low} and "
                    f"{high} rpm only"
                )
    return notes
