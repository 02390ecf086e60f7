"""Errors that grow along a run of a reducer (drift, ratio error, time offset), from what differs between its turns.

Whatever the gear train does repeats every whole period.  Less the mean of its periods a run holds only noise and what
grows, so that is found and taken off first, whatever else is missing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.linalg import helmert

from rverror.base.arrays import Array
from rverror.base.chance import variance_ratio
from rverror.base.units import ARCSEC
from rverror.diagnosis.coloured import kept_share, orthonormal
from rverror.diagnosis.drive_fit import DriveFit, fitted, held_out_gain
from rverror.diagnosis.drive_result import addition_of
from rverror.diagnosis.drive_runs import RunData, influence_rows
from rverror.diagnosis.drive_terms import DECLARED, EFFECT, OFFSET, Term
from rverror.diagnosis.result import Addition
from rverror.geartrain.mechanism import Drive, Reducer
from rverror.model.catalogue import CATALOGUE, source
from rverror.model.effects import Effect, Model
from rverror.runs.measurement import Run
from rverror.runs.spectrum import Revolutions

_FALSE_ALARM = 3e-4  # chance that any of them passes by luck
_WANDER = 0.01  # chance that the means of the turns wander by as much
_FLOOR = 1e-3 * ARCSEC
_APART = 1e-4  # a source keeps this share of its power beside what is there, or is not tried
_NOTHING = 1e-6  # share of a row that must differ between turns


@dataclass(frozen=True)
class Growth:
    """What grows along the runs.

    Attributes
    ----------
    printed, declared : tuple of Effect
        Declared errors that grow, as printed, and with their fitted sizes.
    added : tuple of Addition
        What was found.
    rows : tuple of mapping of str to ndarray, shape (periods, n)
        Influence of each source that grows, for each run.
    """

    printed: tuple[Effect, ...]
    declared: tuple[Effect, ...]
    added: tuple[Addition, ...]
    rows: tuple[Mapping[str, Array], ...]

    def fitted(self, count: int | None = None) -> list[Array]:
        """Error of each run by what was declared, as fitted, and by the first `count` additions, or all; rad."""
        return self._of((*self.declared, *(addition.effect for addition in self.added[:count])))

    def missed(self, count: int | None = None) -> list[Array]:
        """All that was fitted, less the first `count` additions and what was declared; as printed where it is None."""
        known = self._of(self.printed) if count is None else self.fitted(count)
        return [every - part for every, part in zip(self.fitted(), known, strict=True)]

    def _of(self, effects: Sequence[Effect]) -> list[Array]:
        sizes = [sum((e.values[0] for e in effects if e.key == key), 0.0) for key in self.rows[0]]
        return [np.tensordot(sizes, np.array(list(run.values())), 1) for run in self.rows]


def growth_rows(unit: Reducer, run: Run, theta: Array, cut: Callable[[Array], Revolutions]) -> dict[str, Array]:
    """Influence of every source that grows along a run, cut into periods as the run is, rad per unit.

    Parameters
    ----------
    unit : Reducer
    run : Run
    theta : ndarray, shape (samples,)
        Nominal output angle, rad.
    cut : callable
        Cuts a row of samples into periods.

    Returns
    -------
    dict of str to ndarray, shape (periods, n)
        Without the sources that need what the run does not tell.
    """
    return {
        key: cut(influence_rows(run, unit, theta, key, {})[0]).values
        for key, entry in CATALOGUE.items()
        if entry.applies_to(unit) and not entry.periodic and not entry.lacks(unit, run)
    }


def growing_errors(
    model: Model, names: Sequence[str], values: Sequence[Array], rows: Sequence[Mapping[str, Array]]
) -> Growth:
    """Find what grows along the runs, and refit what was declared of it within its uncertainty.

    Parameters
    ----------
    model : Model
        Declared.
    names : sequence of str
        Of the runs.
    values : sequence of ndarray, shape (periods, n)
        Measured error of each run, rad.
    rows : sequence of mapping of str to ndarray, shape (periods, n)
        From `growth_rows`.

    Returns
    -------
    Growth
    """
    declared = [e for e in model.effects if not source(e.key).periodic]
    keys = [key for key in rows[0] if all(key in run for run in rows)]
    rows = [{key: run[key] for key in keys} for run in rows]
    between = {key: _joined([_contrasts(run[key]) for run in rows]) for key in keys}
    exact = [e for e in declared if not e.uncertainty]
    contrasts = [_contrasts(run) for run in values]
    signal = _joined(contrasts)
    signal = signal - sum((e.values[0] * between[e.key] for e in exact), np.zeros_like(signal))
    data = _data(model, names, contrasts, signal)
    # no offsets: contrasts hold none
    base = [Term(OFFSET, "nothing", np.zeros((1, signal.size)))] + [
        Term(DECLARED, e.key, between[e.key][None], {}, (), float(e.uncertainty), e.values)
        for e in declared
        if e.uncertainty
    ]
    pool = [
        Term(EFFECT, key, row[None])
        for key, row in between.items()
        if np.linalg.norm(row) > _NOTHING * np.linalg.norm(_joined([run[key] for run in rows]))
    ]
    fit = fitted(data, base)
    while (more := _winner(data, fit, pool)) is not None:
        fit = more
    added = tuple(addition_of(data, fit, t, pool, fit.terms[: fit.terms.index(t) + 1]) for t in fit.terms if t in pool)
    sizes = {t.name: float(fit.values(t)[0]) for t in fit.terms if t.kind == DECLARED}
    refitted = tuple(replace(e, values=(sizes.get(e.key, e.values[0]),)) for e in declared)
    return Growth(tuple(declared), refitted, added, tuple(rows))


def _contrasts(periods: Array) -> Array:
    """What differs between periods, in one row less than these: independent rows, each as noisy as one period."""
    return np.asarray(helmert(len(periods)) @ periods, dtype=np.float64)


def _joined(parts: Sequence[Array]) -> Array:
    return np.concatenate([part.ravel() for part in parts])


def _data(model: Model, names: Sequence[str], values: Sequence[Array], signal: Array) -> RunData:
    ends = np.cumsum([0, *(run.size for run in values)])
    turns = np.repeat(np.arange(sum(len(run) for run in values)), [run.shape[1] for run in values for _ in run])
    return RunData(
        drive=Drive(ratio=model.mechanism.ratio),
        names=tuple(names),
        slices=tuple(slice(int(a), int(b)) for a, b in pairwise(ends)),
        theta=np.concatenate([np.linspace(0, 2 * np.pi * len(run), run.size) for run in values]),
        direction=np.ones(signal.size),
        clock=np.concatenate([np.arange(run.size, dtype=np.float64) for run in values]),
        signal=signal,
        labels=turns,
        quantity="angle",
        floor=_FLOOR,
    )


def _winner(data: RunData, fit: DriveFit, pool: Sequence[Term]) -> DriveFit | None:
    """Fit with one more source: the one that leaves least, if it is significant and helps on left-out turns.

    Alone, or beside all others: two that are missing at once count as noise for each other.
    """
    apart = _apart(fit.terms, [term for term in pool if term not in fit.terms])
    trials = []
    for term in apart:
        trial = fitted(data, [*fit.terms, term])
        others = [*fit.terms, *(t for t in apart if t is not term)]
        beside = len(others) > len(fit.terms) and _apart(others, [term])
        if _settles(data, fit, trial) or (
            beside and _settles(data, fitted(data, others), fitted(data, [*others, term]))
        ):
            trials.append(trial)
    return min(trials, key=lambda trial: float(trial.residual @ trial.residual), default=None)


def _apart(known: Sequence[Term], terms: Sequence[Term]) -> list[Term]:
    """Terms whose waveform those that are known do not make up."""
    basis = orthonormal(np.concatenate([t.rows for t in known]))
    return [term for term in terms if kept_share(basis, term.rows) > _APART]


def _settles(data: RunData, fit: DriveFit, trial: DriveFit) -> bool:
    term = trial.terms[-1]
    return (
        trial.significant(term, _FALSE_ALARM)
        and held_out_gain(data, fit, trial) > 0
        and _beyond_wander(data, fit, trial)
    )


def _beyond_wander(data: RunData, fit: DriveFit, trial: DriveFit) -> bool:
    """Tell whether the means of the turns lie nearer to the trial than their own scatter about it explains.

    Noise with a long memory moves whole turns, which the spectrum within a turn does not show.
    """
    count = int(data.labels.max()) + 1
    size = np.bincount(data.labels, minlength=count)
    before, after = (np.bincount(data.labels, f.residual, count) / size for f in (fit, trial))
    left = count - sum(t.kind == EFFECT for t in trial.terms)
    if left < 1:
        return False
    gain = float(before @ before - after @ after)
    return gain > float(after @ after) / left * variance_ratio(_WANDER, 1, left)
