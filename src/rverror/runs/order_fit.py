"""The orders of measured or simulated runs, by least squares: what makes an order table of samples."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from rverror.base.arrays import Array
from rverror.base.errors import InputError, check_each
from rverror.base.numbers import count_of
from rverror.geartrain.mechanism import Drive, Reducer
from rverror.model.effects import Model
from rverror.runs.measurement import Run, ratio_of
from rverror.runs.order_table import OrderCase, OrderTable, TableCondition
from rverror.runs.reading import HEADER_KEYS

_TURN = 2 * math.pi
#: Orders below this look like the offset where the travel is less than a turn.
_SLOW = 1.5
#: Highest degree of the polynomial that takes what is slow over less than a turn.  Chosen: of a wave of order 1, the
#: strongest there is, it leaves (2 n + 1) j_n(pi) = 1.4e-4 at most, n = 10, j the spherical Bessel function.
_DEGREE = 9
#: Waves over the travel beside an order, on either side, by which the noise there is told, and how many times the
#: power of white noise the median of theirs must have to count as colour: by chance in one of a hundred.
_BESIDE = 12
_COLOURED = 2.0


def order_table_from_runs(
    runs: Sequence[Run], ratio: Reducer | Drive | Model | float, orders: Sequence[float]
) -> OrderTable:
    """Orders of runs, by least squares with an offset, or with a slow law where a run is less than a turn.

    Parameters
    ----------
    runs : sequence of Run
        One for each condition, each in one direction.
    ratio : Reducer, Drive, Model or float
        Input turns per output turn.
    orders : sequence of float
        Waves per output turn, in any sequence.

    Returns
    -------
    OrderTable
        A case for each run, in their sequence.  The input speed is that of a run with time.

    Raises
    ------
    InputError
        If the travel of a run cannot tell two orders, or one and the offset, apart: they are nearer than one wave over
        it, or it is less than a turn and an order is below 1.5; if the samples are too few or too far apart; if two
        runs have one condition, a run turns both ways, or the zeros of the runs have different labels.

    Notes
    -----
    The fit is over whole output turns, as many as a run has, else over its travel; samples beyond are counted in the
    notes.  theta is the nominal output angle in both directions, as the run counts it.

    Over less than a turn nothing is periodic: a ratio that is off, drift, or the encoder's order 1 would end in a step
    and leave D/(pi n) of it, n waves over the travel, in every order.  A polynomial takes them along, of the degree
    that the waves of the lowest order leave room for, 9 at most.

    ``sigma`` takes all that the fit leaves, orders that are not asked for included, for white noise, but for an order
    beside which there is clearly more: there it is the median of the waves about it, some dozen on either side.  It is
    never below the rounding of the angles.

    Examples
    --------
    >>> import numpy as np, rverror
    >>> theta = 2 * np.pi * np.arange(512) / 512
    >>> run = rverror.run_from_arrays(input_angle=121 * theta, te=2e-5 * np.cos(40 * theta + 0.5), direction="forward")
    >>> case = order_table_from_runs([run], 121, [39, 40]).cases[0]
    >>> case.orders, abs(case.waves).round(9), round(float(np.angle(case.waves[1])), 9)
    (array([39., 40.]), array([0.e+00, 2.e-05]), 0.5)
    """
    check_each("runs", runs, Run, "give a list of runs, such as [load_run(path)]")
    wanted = checked_orders(orders)
    if not runs:
        raise InputError("orders: there is no run; give one or more")
    names = [run.path or f"run {number}" for number, run in enumerate(runs, 1)]
    cases: list[OrderCase] = []
    notes: list[str] = []
    for name, run in zip(names, runs, strict=True):
        case = _case(name, run, ratio, wanted, notes)
        for other, before in zip(names, cases, strict=False):
            if before.condition == case.condition:
                raise InputError(f"{name}: the condition is that of {other}; give one run of each, or a table of each")
        cases.append(case)
    labels = sorted({run.index for run in runs})
    if len(labels) > 1:
        listed = ", ".join(repr(label) for label in labels)
        raise InputError(f"orders: the zeros of the runs have different labels ({listed}); make a table of each")
    keys = dict.fromkeys(key for run in runs for key in run.metadata if key.lower() not in HEADER_KEYS)
    metadata = {key: runs[0].metadata[key] for key in keys if len({run.metadata.get(key) for run in runs}) == 1}
    differing = keys.keys() - metadata
    if differing:
        notes.append(
            f"{count_of(len(differing), 'header key')} not alike in all runs left out ({', '.join(sorted(differing))})"
        )
    return OrderTable(cases=tuple(cases), index=labels[0], metadata=metadata, notes=tuple(notes))


def checked_orders(orders: Sequence[float]) -> Array:
    """Orders that are asked for, growing.

    Raises
    ------
    InputError
        If there is none, one is no number above 0, or one is asked for twice.

    Examples
    --------
    >>> checked_orders([40, 1.5])
    array([ 1.5, 40. ])
    """
    try:
        found = np.array(orders, dtype=np.float64)
    except (TypeError, ValueError) as problem:
        raise InputError(f"orders = {orders!r}: must be numbers, in waves per output turn") from problem
    if found.ndim != 1 or not found.size:
        raise InputError("orders: there is none; give one or more, in waves per output turn")
    for order in found.tolist():
        if not (math.isfinite(order) and order > 0):
            raise InputError(f"orders: {order:g} must be a number above 0, in waves per output turn")
    found.sort()
    same = np.flatnonzero(np.diff(found) == 0)
    if same.size:
        raise InputError(f"orders: {found[same[0]]:g} is asked for twice; give each once")
    return found


def _case(name: str, run: Run, ratio: Reducer | Drive | Model | float, orders: Array, notes: list[str]) -> OrderCase:
    direction = float(run.direction[0])
    if (run.direction != direction).any():
        raise InputError(f"{name}: the run turns both ways; split it where it turns")
    if run.load_column is not None:
        raise InputError(f"{name}: output_torque changes over the turn, and a table has one for all; diagnose the run")
    theta, error = run.nominal_angle(ratio), run.error(ratio)
    angle, signal, travel, left_out = whole_turns(theta, error)
    _check_told_apart(name, orders, travel, step=travel / angle.size)
    degree = 0 if travel > _TURN * (1 - 1e-9) else min(int(orders[0] * travel / _TURN), _DEGREE)
    unknowns = 2 * orders.size + 1 + degree
    if angle.size <= unknowns:
        raise InputError(
            f"{name}: {angle.size} samples for {count_of(orders.size, 'order')} and the offset, more than {unknowns} "
            "are needed; measure more samples, or ask for fewer orders"
        )
    if left_out:
        notes.append(f"{name}: {count_of(left_out, 'sample')} beyond the last whole turn left out")
    if degree:
        notes.append(
            f"{name}: over {travel / _TURN:.3g} of a turn what is slow is taken off by a polynomial of degree {degree}"
        )
    notes += [f"{name}: {note}" for note in run.notes]
    waves = angle[:, None] * orders
    slow = np.polynomial.legendre.legvander(2 * (angle - angle[0]) / travel - 1, degree)
    base = np.hstack([np.cos(waves), np.sin(waves), slow])
    # by QR: unlike the normal equations it keeps all digits where orders are near to one another
    q, r = np.linalg.qr(base)
    sizes = np.linalg.solve(r, q.T @ signal)
    left = signal - base @ sizes
    noise = math.sqrt(float(left @ left) / (angle.size - unknowns))
    noise = max(noise, float(np.spacing(np.abs(angle).max(initial=1.0))))
    k = orders.size
    spread = (np.linalg.inv(r) ** 2).sum(axis=1)[: 2 * k].reshape(2, -1).mean(axis=0)
    speed = None if run.time is None else float(abs(ratio_of(ratio)) * np.ptp(theta) / np.ptp(run.time))  # its mean
    colour = _colour(angle, left, orders, turns=travel / _TURN, degree=degree)
    return OrderCase(
        condition=TableCondition(
            direction=direction, torque=run.torque, input_speed=speed, temperature=run.temperature
        ),
        orders=orders.copy(),
        waves=sizes[:k] - 1j * sizes[k : 2 * k],
        sigma=noise * np.sqrt(spread * colour),
    )


def _colour(angle: Array, left: Array, orders: Array, *, turns: float, degree: int) -> Array:
    """Power of what is left beside each order, over that of white noise: 1 where it is not clearly more, shape (k,).

    The power of a wave of white noise has an exponential law, so that its mean is the median over log 2.  The
    median does not ask for orders that stand there and are not asked for.
    """
    highest = (angle.size - 1) / (2 * turns)
    white = 2 * float(left @ left) / angle.size**2  # of cosine's and sine's size, each
    found = np.ones(orders.size)
    for place, order in enumerate(orders.tolist()):
        steps = np.arange(1, _BESIDE + orders.size + 1)  # farther where orders of the table stand between
        about = order + np.stack([-steps, steps], axis=1).ravel() / turns
        apart = (np.abs(about[:, None] - orders) * turns > 0.5).all(axis=1)
        about = about[apart & (about * turns > max(degree / 2, 0.5)) & (about < highest)][: 2 * _BESIDE]
        if about.size < _BESIDE or not white:
            continue
        power = [abs(2 / angle.size * complex(left @ np.exp(-1j * one * angle))) ** 2 / 2 for one in about.tolist()]
        ratio = float(np.median(power)) / math.log(2) / white
        found[place] = ratio if ratio > _COLOURED else 1.0
    return found


def whole_turns(theta: Array, error: Array) -> tuple[Array, Array, float, int]:
    """Samples of the whole turns of a run, or of all of it where it has none, their travel, and how many are beyond.

    Each sample stands for a step, so that N even ones of a turn of N make a whole turn.

    Parameters
    ----------
    theta, error : ndarray, shape (n,)

    Returns
    -------
    angle, signal : ndarray, shape (m,)
        In growing order of the angle, rad.
    travel : float
        rad.
    left_out : int
    """
    along = np.argsort(theta, kind="stable")
    angle, signal = theta[along], error[along]
    reach = float(angle[-1] - angle[0])
    step = reach / (angle.size - 1)
    turns = math.floor((reach + 1.5 * step) / _TURN)
    if not turns:
        return angle, signal, reach + step, 0
    kept = angle < angle[0] + turns * _TURN - step / 2
    return angle[kept], signal[kept], turns * _TURN, int(np.count_nonzero(~kept))


def _check_told_apart(name: str, orders: Array, travel: float, *, step: float) -> None:
    turns = travel / _TURN
    if turns < 1 - 1e-9 and orders[0] < _SLOW:
        raise InputError(
            f"{name}: order {orders[0]:g} needs a whole output turn, the run has {turns:.3g}; measure a turn, or ask "
            f"for orders from {_SLOW:g} up"
        )
    with_offset = np.concatenate([[0.0], orders])
    near = np.flatnonzero(np.diff(with_offset) * turns < 1 - 1e-9)
    if near.size:
        low, high = with_offset[near[0]], with_offset[near[0] + 1]
        other = f"order {low:g}" if near[0] else "the offset"
        raise InputError(
            f"{name}: order {high:g} and {other} are {(high - low) * turns:.3g} of a wave apart over the travel of "
            f"{math.degrees(travel):.4g} deg, 1 is needed; measure a longer run, or leave one of them out"
        )
    if orders[-1] * step > math.pi * (1 - 1e-9):
        raise InputError(
            f"{name}: order {orders[-1]:g} has {_TURN / (orders[-1] * step):.3g} samples a wave, more than 2 are "
            "needed; measure more samples, or leave it out"
        )
