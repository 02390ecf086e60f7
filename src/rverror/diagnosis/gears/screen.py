"""What each candidate would take off the objective, beside all that is free, as far as the prediction is linear."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from rverror.base.arrays import Array
from rverror.diagnosis.gears.fit import Fit, as_compared, bounds, counted, deviation, scale_of
from rverror.diagnosis.gears.waveform import Named
from rverror.model.catalogue import source


@dataclass(frozen=True, eq=False)
class Proposal:
    """A candidate, what objective it may reach, and the sizes at which it does.

    Attributes
    ----------
    name : Named
    objective : float
    sizes : ndarray
        Of its parameters.
    step : ndarray
        Of everything else.
    """

    name: Named
    objective: float
    sizes: Array
    step: Array


def screened(
    fit: Fit, named: Sequence[Named], rows: Sequence[Array] | None = None, *, hold: bool = False
) -> list[Proposal]:
    """Candidates, the most promising first.

    Parameters
    ----------
    fit : Fit
        A state; it need not be settled.
    named : sequence of Named
    rows : sequence of ndarray, shape (parameters, n), optional
        Influence of all of them on each record, where it is known already.
    hold : bool
        Whether everything else keeps its size.
    """
    bench, policy = fit.bench, fit.bench.policy
    if rows is None:
        rows = bench.influences(fit.model, fit.waves, named)
    size = fit.moment.size
    ends = np.cumsum([0, *(len(source(key).parameters) for key, _ in named)])
    cross, moment = np.zeros((ends[-1], size)), np.zeros(ends[-1])
    own = [np.zeros((b - a, b - a)) for a, b in pairwise(ends)]
    for sight, white, more in zip(bench.sights, fit.rows, rows, strict=True):
        new = sight.whiten(more)
        both = new @ white.T
        moment += both[:, 0]
        cross += both[:, 1:]
        for block, (first, last) in zip(own, pairwise(ends), strict=True):
            block += new[first:last] @ new[first:last].T
    weights, off = fit.weights, deviation(fit.model, fit.declared, bench.unit, len(bench.zeros))
    low, high = bounds(fit)
    pull = fit.moment / fit.scale - np.where(np.isfinite(weights), weights, 0.0) * off
    stopped = ((low == 0) & (pull < 0)) | ((high == 0) & (pull > 0))  # at a bound, and would go on
    free = np.isfinite(weights) & ~stopped & (not hold)
    gram, first, w, o = fit.gram[np.ix_(free, free)], fit.moment[free], weights[free], off[free]
    result = []
    for name, block, (begin, end) in zip(named, own, pairwise(ends), strict=True):
        parameters, at = source(name[0]).parameters, slice(begin, end)
        prior = np.array([1 / (policy.workshop * p.plausible) ** 2 for p in parameters])
        whole = np.block([[gram, cross[at][:, free].T], [cross[at][:, free], block]])
        right = np.concatenate([first, moment[at]])
        weight, middle = np.concatenate([w, prior]), np.concatenate([o, np.zeros(len(parameters))])
        step, objective = _solved(fit, whole, right, weight, middle)
        low = np.array([p.least for p in parameters])
        if (step[-len(parameters) :] < low).any():  # it cannot be of that sign
            continue
        everything = np.zeros(size)
        everything[free] = step[: -len(parameters)]
        result.append(Proposal(name, objective, step[-len(parameters) :], everything))
    return sorted(result, key=lambda one: one.objective)


def _solved(fit: Fit, gram: Array, moment: Array, weight: Array, off: Array) -> tuple[Array, float]:
    """Step that lowers the objective most and what it leaves, what it explains being noise no more."""
    scale = fit.scale
    for _ in range(6):
        own = gram / scale + np.diag(weight)
        size = np.sqrt(np.maximum(np.diag(own), 1e-300))
        right = moment / scale - weight * off
        step = np.linalg.solve(own / np.outer(size, size) + 1e-12 * np.eye(size.size), right / size) / size
        left = fit.data - 2 * float(step @ moment) + float(step @ gram @ step)
        again = scale_of(left, fit.bound, fit.bench.policy)
        if abs(again - scale) < 0.01 * scale:
            break
        scale = again
    return step, as_compared(counted(max(left, 1e-9), fit.bound, fit.bench.policy) + float(weight @ (off + step) ** 2))
