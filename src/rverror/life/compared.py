"""Two measurements of a unit: which orders differ, and which cause makes it so."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from rverror.base.errors import InputError, check_each, check_kind
from rverror.base.progress import Progress
from rverror.geartrain.mechanism import Drive, Reducer
from rverror.life.over_life import changes_found, searched
from rverror.life.result import Changed, OrderChange, RunsCompared
from rverror.life.sessions import History, Session, history_of
from rverror.lots.result import Interval
from rverror.model.effects import Model
from rverror.runs.checks import fitted_slope
from rverror.runs.measurement import Run

_LEVEL = 0.01  # of pairs that do not differ, those in which an order is named
_NORMAL = 1.96
_ONCE = "one measurement each: what a repeat of the same state would differ by is not known; measure each state twice"
_POOLED_ERROR = 1 / 6  # relative standard error of a noise that 150 steps tell, as many as `history_of` takes at least
_WHOLE = 0.02  # by which a ratio that is read of the angles may miss a whole number: errors of the angles do that


def compare_runs(
    before: Sequence[Run], after: Sequence[Run], model: Model | None = None, *, progress: Progress | None = None
) -> RunsCompared:
    """Tell what changed between two measurements of a unit, order by order and cause by cause.

    Parameters
    ----------
    before, after : sequence of Run
        One for each condition, over a turn of the output or more.
    model : Model, optional
        Of a reducer: causes are looked for as well.  Where it is left out the ratio is read of the angles.
    progress : callable, optional
        Called with a line of text.

    Returns
    -------
    RunsCompared

    Raises
    ------
    InputError
        If runs do not fit the model, or the measurements have no condition in common.

    Notes
    -----
    Page ``theory/trend.md``.  Of pairs that differ in nothing but noise one in a hundred has an order named, whatever
    the number of orders.

    Examples
    --------
    >>> import numpy as np, rverror
    >>> theta = 2 * np.pi * np.arange(512) / 512
    >>> noise = np.random.default_rng(0).normal(0, 1e-6, (2, 512))
    >>> runs = [
    ...     rverror.run_from_arrays(input_angle=theta, te=size * np.cos(4 * theta) + some, direction="forward")
    ...     for size, some in zip((5e-5, 1e-5), noise)
    ... ]
    >>> found = rverror.life.compare_runs(runs[:1], runs[1:], rverror.Model(rverror.Drive(ratio=1.0)))
    >>> [(one.order, round(one.before, 6), round(one.after, 6)) for one in found.orders]
    [(4, 5e-05, 1e-05)]
    """
    for name, runs in (("before", before), ("after", after)):
        check_each(name, runs, Run, "give a list of runs, such as [load_run(path)]")
        if not len(runs):
            raise InputError(f"{name}: no run; give one or more")
    notes = list[str]()
    if model is None:
        ratio = _ratio(before[0])
        model = Model(Drive(ratio=ratio))
        notes.append(f"ratio {ratio:g}, read of the angles; a model states it")
    check_kind("model", model, Model, "give load_model(path)")
    notes.append(_ONCE)
    sessions = (Session(0.0, "before", tuple(before)), Session(1.0, "after", tuple(after)))
    history = history_of(model, sessions)
    changed: tuple[Changed, ...] = ()
    if isinstance(model.mechanism, Reducer):
        search, found = searched(model, sessions, history, progress or (lambda text: None))
        history, changed = search.unit.history, changes_found(search, found)
    return RunsCompared(
        tuple(map(str, history.amplitudes.conditions)),
        _orders(history),
        changed,
        float(np.sqrt(2 * history.amplitudes.noise.mean())),
        (*notes, *history.amplitudes.notes),
    )


def _ratio(run: Run) -> float:
    """Input turns per output turn of a run that has both angles, whole where it nearly is."""
    if run.input_angle is None or run.output_angle is None:
        return 1.0  # the error stands in a column of its own, and the angle is the output's
    slope = fitted_slope(run.input_angle, run.output_angle)
    if not slope:
        raise InputError(f"{run.path or 'a run'}: the output does not turn; give the model")
    ratio = 1 / slope
    return float(round(ratio)) if abs(ratio - round(ratio)) < _WHOLE and round(ratio) else ratio


def _orders(history: History) -> tuple[OrderChange, ...]:
    """Orders that differ beyond noise."""
    amplitudes = history.amplitudes
    conditions = amplitudes.conditions
    parts = amplitudes.values.reshape(2, len(conditions), 2, -1)[..., 1:]
    noise = amplitudes.noise.reshape(len(conditions), 2, -1)[:, 0, 1:]
    apart = (np.diff(parts, axis=0)[0] ** 2).sum(axis=1)
    tests = apart.size
    # how often an exponential of mean 1 exceeds a power over a mean that is known to a sixth only
    over = apart / (4 * np.maximum(noise, np.finfo(np.float64).tiny))  # of files that are the same both are 0
    chance = np.minimum(tests * (1 + over * _POOLED_ERROR**2) ** (-(_POOLED_ERROR**-2)), 1.0)
    size = math.sqrt(2) * np.sqrt((parts**2).sum(axis=2))
    found = []
    for order, number in zip(*np.nonzero(chance.T < _LEVEL), strict=True):
        was, now = size[:, number, order].tolist()
        error = _NORMAL * math.sqrt(2 * noise[number, order])
        found.append(
            OrderChange(
                order=int(amplitudes.orders[1:][order]),
                condition=str(conditions[number]),
                before=was,
                after=now,
                interval=Interval(now, max(now - error, 0.0), now + error),
                difference=math.sqrt(2 * apart[number, order]),
                chance=float(chance[number, order]),
            )
        )
    return tuple(sorted(found, key=lambda one: -one.difference))
