"""Errors that grow along a run of a reducer (drift, ratio error, time offset), from what differs between its turns.

Whatever the gear train does repeats every whole period.  Less the mean of its periods a run holds only noise and what
grows, so that is found and taken off first, whatever else is missing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.linalg import helmert

from rverror.base.arrays import Array
from rverror.base.chance import variance_ratio
from rverror.diagnosis.policy import POLICY, Policy
from rverror.diagnosis.result import Addition
from rverror.diagnosis.samples.account import addition_of
from rverror.diagnosis.samples.coloured import kept_share, orthonormal
from rverror.diagnosis.samples.fit import SampleFit, fitted, held_out_gain
from rverror.diagnosis.samples.regressors import DECLARED, EFFECT, OFFSET, Term
from rverror.diagnosis.samples.runs import RunData, influence_rows
from rverror.diagnosis.search import Journal, Likelihood, Name, find_missing
from rverror.geartrain.mechanism import Drive, Reducer
from rverror.model.catalogue import CATALOGUE, source
from rverror.model.effects import Effect, Model
from rverror.runs.measurement import Run
from rverror.runs.spectrum import Revolutions


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
    model: Model,
    names: Sequence[str],
    values: Sequence[Array],
    rows: Sequence[Mapping[str, Array]],
    *,
    journal: Journal | None = None,
    policy: Policy = POLICY,
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
    journal : Journal, optional
    policy : Policy
    """
    declared = [e for e in model.effects if not source(e.key).periodic]
    told = [key for key in rows[0] if all(key in run for run in rows)]
    rows = [{key: run[key] for key in told} for run in rows]
    between = {key: _joined([_contrasts(run[key]) for run in rows]) for key in told}
    exact = [e for e in declared if not e.uncertainty]
    contrasts = [_contrasts(run) for run in values]
    signal = _joined(contrasts)
    signal = signal - sum((e.values[0] * between[e.key] for e in exact), np.zeros_like(signal))
    data = _data(model, names, contrasts, signal, policy)
    # no offsets: contrasts hold none
    base = [Term(OFFSET, "nothing", np.zeros((1, signal.size)))] + [
        Term(DECLARED, e.key, between[e.key][None], {}, (), float(e.uncertainty), e.values)
        for e in declared
        if e.uncertainty
    ]
    pool = tuple(
        Term(EFFECT, key, row[None])
        for key, row in between.items()
        if policy.tries(source(key))
        if np.linalg.norm(row) > policy.differs * np.linalg.norm(_joined([run[key] for run in rows]))
    )
    likelihood = GrowthLikelihood(data, pool, policy, journal or Journal(lambda text: None))
    _, outcome = find_missing(likelihood, likelihood.fitted(base))
    fit = outcome.found
    added = tuple(addition_of(data, fit, t, pool, fit.terms[: fit.terms.index(t) + 1]) for t in fit.terms if t in pool)
    sizes = {t.name: float(fit.values(t)[0]) for t in fit.terms if t.kind == DECLARED}
    refitted = tuple(replace(e, values=(sizes.get(e.key, e.values[0]),)) for e in declared)
    return Growth(tuple(declared), refitted, added, tuple(rows))


def _contrasts(periods: Array) -> Array:
    """What differs between periods, in one row less than these: independent rows, each as noisy as one period."""
    return np.asarray(helmert(len(periods)) @ periods, dtype=np.float64)


def _joined(parts: Sequence[Array]) -> Array:
    return np.concatenate([part.ravel() for part in parts])


def _data(model: Model, names: Sequence[str], values: Sequence[Array], signal: Array, policy: Policy) -> RunData:
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
        floor=policy.floor,
        policy=policy,
    )


@dataclass(frozen=True, eq=False)
class GrowthLikelihood(Likelihood[SampleFit, Term]):
    """Likelihood of what differs between the periods of runs; nothing is dropped, and lines do not compete.

    Attributes
    ----------
    data : RunData
        Contrasts between periods.
    candidates : tuple of Term
    policy : Policy
    journal : Journal
    """

    data: RunData
    candidates: tuple[Term, ...]
    policy: Policy
    journal: Journal

    def fitted(self, terms: Sequence[Term]) -> SampleFit:
        """Joint fit of terms."""
        return fitted(self.data, terms)

    def added(self, found: SampleFit) -> Sequence[Name]:
        """Name what was added, in order."""
        return [(t.name, t.indices) for t in found.terms if t.kind == EFFECT]

    def rank(self, found: SampleFit) -> list[Term]:
        """Sources whose waveform those that were found do not make up."""
        return self._apart(found.terms, [term for term in self.candidates if term not in found.terms])

    def refit(self, found: SampleFit, ranking: Sequence[Term]) -> Iterator[SampleFit]:
        """Refit with one source more, the one that leaves least first."""
        trials = [self.fitted([*found.terms, term]) for term in ranking]
        yield from sorted(trials, key=lambda trial: float(trial.residual @ trial.residual))

    def fails(self, found: SampleFit, trial: SampleFit) -> str:
        """Tell why the last source does not hold, alone or beside all others; empty where it does.

        Two that are missing at once count as noise for each other.
        """
        last, others = trial.terms[-1], [*found.terms, *(t for t in self.rank(found) if t is not trial.terms[-1])]
        why = self._doubt(found, trial)
        if why and len(others) > len(found.terms) and self._apart(others, [last]):
            return self._doubt(self.fitted(others), self.fitted([*others, last]))
        return why

    def _apart(self, known: Sequence[Term], terms: Sequence[Term]) -> list[Term]:
        basis = orthonormal(np.concatenate([t.rows for t in known]))
        return [term for term in terms if kept_share(basis, term.rows) > self.policy.apart]

    def _doubt(self, found: SampleFit, trial: SampleFit) -> str:
        if not trial.significant(trial.terms[-1], self.policy.false_alarm / len(self.candidates)):
            return "not significant under the noise between periods"
        if held_out_gain(self.data, found, trial) <= 0:
            return "left-out periods fit worse with it"
        return "" if self._beyond_wander(found, trial) else "periods that wander at random may look like it"

    def _beyond_wander(self, found: SampleFit, trial: SampleFit) -> bool:
        """Tell whether the means of the periods lie nearer to the trial than their own scatter about it explains.

        Noise with a long memory moves whole turns, which the spectrum within a turn does not show.
        """
        labels = self.data.labels
        count = int(labels.max()) + 1
        size = np.bincount(labels, minlength=count)
        before, after = (np.bincount(labels, f.residual, count) / size for f in (found, trial))
        left = count - sum(t.kind == EFFECT for t in trial.terms)
        if left < 1:
            return False
        gain = float(before @ before - after @ after)
        return gain > float(after @ after) / left * variance_ratio(self.policy.wander, 1, left)
