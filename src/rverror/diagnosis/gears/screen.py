"""What each candidate would take off the objective, beside all that is free, as far as the prediction is linear."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from rverror.base.arrays import Array
from rverror.diagnosis.gears.fit import Fit, as_compared, bounds, counted, scale_of, solved
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

    def seen(number: int) -> tuple[Array, list[Array]]:
        new = bench.sights[number].whiten(rows[number])
        return new @ fit.rows[number].T, [new[first:last] @ new[first:last].T for first, last in pairwise(ends)]

    for both, blocks in bench.of_each(seen):
        moment += both[:, 0]
        cross += both[:, 1:]
        own = [total + block for total, block in zip(own, blocks, strict=True)]
    low, high = bounds(fit)
    pull = fit.moment / fit.scale - fit.pull * fit.off
    stopped = ((low == 0) & (pull < 0)) | ((high == 0) & (pull > 0))  # at a bound, and would go on
    free = fit.free & ~stopped & (not hold)
    count, counts = int(free.sum()), np.diff(ends)
    found = dict[int, Proposal]()
    for more in set(counts.tolist()):  # those of as many parameters together
        alike = np.flatnonzero(counts == more).tolist()
        at = ends[alike][:, None] + np.arange(more)
        entries = [source(named[i][0]).parameters for i in alike]
        whole = np.empty((len(alike), count + more, count + more))
        whole[:, :count, :count] = fit.gram[free][:, free]
        whole[:, count:, :count] = cross[at][..., free]
        whole[:, :count, count:] = whole[:, count:, :count].swapaxes(1, 2)
        whole[:, count:, count:] = [own[i] for i in alike]
        prior = [[1 / (policy.workshop * p.plausible) ** 2 for p in entry] for entry in entries]
        steps, objectives = _solved(
            fit, whole, _beside(fit.moment[free], moment[at]), _beside(fit.pull[free], np.array(prior)),
            _beside(fit.off[free], np.zeros(at.shape)),
        )  # fmt: skip
        least = np.array([[p.least for p in entry] for entry in entries])
        can = np.all(steps[:, count:] >= least, axis=1).tolist()  # others cannot be of that sign
        for i, step, objective, right in zip(alike, steps, objectives, can, strict=True):
            if right:
                everything = np.zeros(size)
                everything[free] = step[:count]
                found[i] = Proposal(named[i], as_compared(float(objective)), step[count:], everything)
    return sorted((found[i] for i in sorted(found)), key=lambda one: one.objective)


def _beside(values: Array, rows: Array) -> Array:
    """The same values before each of some rows."""
    return np.concatenate([np.broadcast_to(values, (len(rows), values.size)), rows], axis=1)


def _solved(fit: Fit, gram: Array, moment: Array, weight: Array, off: Array) -> tuple[Array, Array]:
    """Steps that lower the objective most and what they leave, what each explains being noise no more."""
    bound, policy = fit.bound, fit.bench.policy
    scale = np.full((len(gram), 1), fit.scale)
    for _ in range(6):
        step = solved(gram / scale[..., None], moment / scale - weight * off, weight)
        left = fit.data - 2 * np.einsum("ci,ci->c", step, moment) + np.einsum("ci,cij,cj->c", step, gram, step)
        again = np.array([[scale_of(float(one), bound, policy)] for one in left])
        settled = np.abs(again - scale) < 0.01 * scale
        if settled.all():
            break
        scale = np.where(settled, scale, again)
    squares = np.array([counted(max(float(one), 1e-9), bound, policy) for one in left])
    return step, squares + np.einsum("ci,ci->c", weight, (off + step) ** 2)
