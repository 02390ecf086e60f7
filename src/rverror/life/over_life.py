"""A unit over its life: from its runs at different times to what grows, what jumped, and how long it lasts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy

from rverror.base.arrays import Array
from rverror.base.errors import InputError, check_each, check_kind
from rverror.base.numbers import count_of
from rverror.base.progress import Progress
from rverror.geartrain.mechanism import Reducer
from rverror.life.growth import Fitted, GrowthSearch
from rverror.life.result import Changed, Grown, Remaining, Trend
from rverror.life.sessions import History, Session, history_of, sessions_of
from rverror.life.unit_state import unit_state
from rverror.lots.result import Interval
from rverror.lots.shifts import ShiftSource
from rverror.model.catalogue import source
from rverror.model.effects import Model
from rverror.runs.measurement import Run
from rverror.tolerances.specification import Limit

_WAVES = 512  # angles of a turn
_DRAWS = 200  # of what is known of the causes, for the time that remains
_FURTHEST = 100.0  # times the time that was measured: beyond it nothing is predicted
_TIMES = 120  # at which a limit is asked for, each 10 % after the last
_SAME = 0.9  # of the noise, which is no change of it


def trend(model: Model, runs: Sequence[Run], *, limit: Limit | None = None, progress: Progress | None = None) -> Trend:
    """Tell what grows and what jumped in a unit that was measured again and again.

    Parameters
    ----------
    model : Model
        Of a reducer.  What the unit is off by itself need not be declared: only what changes is asked for.
    runs : sequence of Run
        Each over a turn of the output or more, with its torque, and with ``hours``, ``cycles`` or ``date`` in its
        header.  Runs of one time are a session; forward and reverse with one ``index`` tell the lost motion.
    limit : Limit, optional
        Of ``"transmission_error"``, peak-to-peak, or ``"lost_motion"`` as the runs measure it, mean over a turn.
    progress : callable, optional
        Called with a line of text.

    Returns
    -------
    Trend

    Raises
    ------
    InputError
        If runs do not fit the model, say no time, or make fewer than three sessions.

    Notes
    -----
    Page ``theory/trend.md``.  A jump of the measuring chain is told as such; a mounting that differs from session to
    session is taken for what it is.
    """
    if not isinstance(model.mechanism, Reducer):
        raise InputError("a trend needs a [reducer] model; of a [drive] two measurements are compared: compare-runs")
    check_each("runs", runs, Run, "give a list of runs, such as [load_run(path)]")
    tell = progress or (lambda text: None)
    unit, sessions = sessions_of(runs)
    if len(sessions) < 3:
        raise InputError(f"runs: {count_of(len(sessions), 'session')}; a trend takes 3 or more, two are compared")
    history = history_of(model, sessions)
    if limit is not None:
        check_kind("limit", limit, Limit, "give limit('lost_motion', '90 arcsec')")
        if limit.quantity not in ("transmission_error", "lost_motion") or limit.value is None:
            raise InputError(f"limit: of {limit.quantity}; runs over a life tell transmission_error and lost_motion")
        if limit.quantity == "lost_motion" and not history.lost_motion:
            raise InputError(
                "limit: the runs tell no lost motion; give forward and reverse runs of a session one '# index: A'"
            )
    search, found = searched(model, sessions, history, tell)
    history = search.unit.history
    changed = changes_found(search, found)
    measured, made = history.amplitudes.values, made_by(search, found)
    lost, explained = (_quantity(history, "lost_motion", some) for some in (measured, made))
    return Trend(
        model.mechanism.name or "reducer", unit, history.at, tuple(map(str, history.amplitudes.conditions)), changed,
        None if limit is None else remaining(search, found, made, limit),
        _quantity(history, "transmission_error", measured), lost,
        explained - explained.mean(axis=0) + lost.mean(axis=0), _chance(found), history.amplitudes.notes,
    )  # fmt: skip


def searched(
    model: Model, sessions: Sequence[Session], history: History, tell: Progress
) -> tuple[GrowthSearch, Fitted]:
    """Causes of the changes between sessions, with the noise that they leave."""
    tell(f"{count_of(len(sessions), 'session')}: the unit at the load")
    search = GrowthSearch(unit_state(model, history))
    tell("causes that change")
    found = search.found()
    if found.terms:  # once what changed is known, it is no noise
        again = history_of(model, sessions, made_by(search, found))
        if np.median(again.amplitudes.noise / history.amplitudes.noise) <= _SAME:
            search = GrowthSearch(replace(search.unit, history=again))
            tell("causes that change")
            found = search.found()
    return search, found


def made_by(search: GrowthSearch, found: Fitted) -> Array:
    """Amplitudes that causes add to each session, rad, shape (sessions, conditions * 2 * k)."""
    unit = search.unit
    changes = np.zeros((len(unit.history.at), len(unit.values)))
    for term, sizes in zip(found.terms, found.sizes, strict=True):
        changes += term.course.grown(unit.history.at)[:, None] * search.spread(term.cause, sizes)
    some, back = np.unique(changes, axis=0, return_inverse=True)
    return unit.with_changes(some)[back] - unit.amplitudes


def changes_found(search: GrowthSearch, found: Fitted) -> tuple[Changed, ...]:
    """Causes of a fitted set with their intervals and rivals, the most evident first."""
    changed = []
    for number, term in enumerate(found.terms):
        others = search.fitted(found.terms[:number] + found.terms[number + 1 :], found)
        weights, ways = search.ways(found, number)
        cause, course = search.causes[term.cause], term.course
        since = _mixed(weights, np.array([one.terms[number].course.since for one in ways]), np.zeros(len(ways)))
        rivals = [search.causes[one.terms[-1].cause] for one in search.rivals(found, number, others)]
        changed.append(
            Changed(
                cause.key, cause.indices, course.kind, course.since, since.low, since.high, course.settling,
                tuple(_grown(weights, ways, number, cause, k) for k in range(len(cause.parameters))),
                source(cause.key).acts == "reading",
                tuple(dict.fromkeys((o.key, tuple(o.indices.items())) for o in rivals if o.label != cause.label)),
                others.score - found.score,
            )
        )  # fmt: skip
    return tuple(sorted(changed, key=lambda one: -one.evidence))


def _grown(weights: Array, ways: Sequence[Fitted], number: int, cause: ShiftSource, k: int) -> Grown:
    """A parameter of a cause, over its possible courses."""
    size = np.array([one.sizes[number][k] for one in ways])
    error = np.sqrt([one.covariance[number][k, k] for one in ways])
    rate = np.array([one.terms[number].course.rate for one in ways])
    change, growth = _mixed(weights, size, error), _mixed(weights, rate * size, rate * error)
    return Grown(cause.parameters[k], cause.dimension, change, growth)


def _mixed(weight: Array, mean: Array, error: Array) -> Interval:
    """Mean and 95 % interval of a mixture of normal distributions: weight, mean, standard deviation of each."""
    middle = float(weight @ mean)
    if not error.any():
        order = np.argsort(mean)
        share = np.cumsum(weight[order])
        low, high = mean[order][np.minimum(np.searchsorted(share, [0.025, 0.975]), len(mean) - 1)]
    else:
        at = np.linspace((mean - 6 * error).min(), (mean + 6 * error).max(), 4001)
        below = scipy.special.ndtr((at[:, None] - mean) / np.maximum(error, 1e-300)) @ weight
        low, high = np.interp([0.025, 0.975], below, at)
    return Interval(middle, float(low), float(high))


def _chance(found: Fitted) -> float:
    """How often noise leaves as much between sessions as the causes do."""
    freedom = (len(found.left) - 1) * found.left.shape[1]
    return float(scipy.special.chdtrc(freedom, float(np.sum(found.left**2 / (1 + found.missed)))))


def remaining(search: GrowthSearch, found: Fitted, made: Array, limit: Limit) -> Remaining:
    """Time until a limit is met no more, by draws of what is known of the causes."""
    assert limit.value is not None
    history = search.unit.history
    start = history.amplitudes.values.mean(axis=0) + made[-1] - made.mean(axis=0)
    now = float(_worst(history, limit.quantity, start[None])[0])
    growing = [number for number, term in enumerate(found.terms) if term.course.kind != "step"]
    if not growing:
        return Remaining(limit.quantity, limit.value, now, None)
    influence = search.unit.influences.mean(axis=0)
    columns = [influence @ search.components[:, search.places[found.terms[number].cause]] for number in growing]
    ways = [search.ways(found, number) for number in growing]
    span = float(history.at[-1] - history.at[0])
    ahead = np.concatenate([[0.0], np.geomspace(1e-3, _FURTHEST, _TIMES)]) * span
    random = np.random.default_rng(0)  # the same draws each time: a result is not a matter of luck
    left = []
    for _ in range(_DRAWS):
        change = np.zeros((len(ahead), history.amplitudes.values.shape[1]))
        for number, column, (weights, options) in zip(growing, columns, ways, strict=True):
            one = options[random.choice(len(options), p=weights)]
            root = np.linalg.cholesky(one.covariance[number])
            size = one.sizes[number] + root @ random.standard_normal(len(root))
            more = one.terms[number].course.grown(history.at[-1] + ahead) - 1.0
            change += more[:, None] * (column @ size)
        over = np.flatnonzero(_worst(history, limit.quantity, start + change) > limit.value)
        left.append(math.inf if not over.size else float(ahead[over[0]]))
    low, middle, high = (float(np.quantile(left, q, method="inverted_cdf")) for q in (0.025, 0.5, 0.975))
    time = None if math.isinf(low) else Interval(middle, low, high)
    return Remaining(limit.quantity, limit.value, now, time)


def _quantity(history: History, name: str, amplitudes: Array) -> Array:
    """Peak-to-peak error of each condition or lost motion of each torque, rad, shape (n, conditions or torques).

    Forward the load holds the output back, in reverse it does so the other way: their difference is below 0.
    """
    if name == "lost_motion":
        rows = -history.rows[list(history.lost_motion)]
        return np.asarray(amplitudes @ rows.T)
    return np.asarray(np.ptp(history.amplitudes.waves(amplitudes, _WAVES), axis=2))


def _worst(history: History, name: str, amplitudes: Array) -> Array:
    """The largest under any condition, rad, shape (n,)."""
    return np.asarray(np.abs(_quantity(history, name, amplitudes)).max(axis=1))
