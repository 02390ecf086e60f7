"""What candidates, alone and in pairs, would take off the score of a fit, as far as the prediction is linear.

A block of columns, the change of all runs per unit of some sizes, enters beside everything that is free.  With A the
matrix of what is free, priors included, and C that of the blocks with it, a block sees what is left of itself and of
the residual,

    S = X X' + W - C A^-1 C',    v = X r - C A^-1 b,

and takes v' S^-1 v off.  Squares beyond noise count as a concave function of their sum: the least of its tangents.  So
all of this holds for plain squares divided by one scale after another, and the least objective counts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rverror.base.arrays import Array
from rverror.diagnosis.causes import Named, identity
from rverror.diagnosis.gears.fit import Fit, bounds, counted, inverted
from rverror.model.catalogue import source

_REGULAR = 1e-9  # of two blocks that are as good as one
SCALES = 8  # from that of the fit to that of noise: some per cent of what is taken off


@dataclass(frozen=True, eq=False)
class Columns:
    """Columns of one candidate.

    Attributes
    ----------
    name : Named
    directions : ndarray, shape (columns, parameters)
        Sizes per unit of each column: a unit matrix for the influence of each parameter, or a start.
    rows : tuple of ndarray, shape (columns, width)
        Whitened change of each record.
    start : bool
        Whether it is the change from nothing to a start, which holds for no other sign.
    """

    name: Named
    directions: Array
    rows: tuple[Array, ...]
    start: bool = False

    @property
    def plausible(self) -> Array:
        """Plausible size of each parameter, shape (parameters,)."""
        return np.array([p.plausible for p in source(self.name[0]).parameters])


def columns_of(fit: Fit, names: Sequence[Named]) -> list[Columns]:
    """The influence of each parameter of some candidates, in the state of a fit."""
    run_set = fit.run_set
    rows = run_set.influences(fit.model, fit.waves, names)
    ends = np.cumsum([0, *(len(source(key).parameters) for key, _ in names)])
    white = run_set.of_each(lambda number: run_set.observations[number].whiten(rows[number]))
    return [
        Columns(name, np.eye(last - first), tuple(one[first:last] for one in white))
        for name, first, last in zip(names, ends[:-1], ends[1:], strict=True)
    ]


@dataclass(frozen=True, eq=False)
class Offer:
    """Candidates at the sizes that a linear step gives them.

    Attributes
    ----------
    names : tuple of Named
    sizes : tuple of ndarray
    objective : float
        What may be left.
    score : float
        The same with what the sizes must be worth.
    without : float
        What a linear step leaves without them.
    """

    names: tuple[Named, ...]
    sizes: tuple[Array, ...]
    objective: float
    score: float
    without: float


@dataclass(frozen=True, eq=False)
class _Reduced:
    """What blocks see at one scale: columns padded to the widest block by ones that do nothing."""

    constant: float  # objective of the tangent with no block
    seen: Array  # (blocks, width, blocks, width): S
    moment: Array  # (blocks, width): v
    worth: Array  # (blocks,): ln det(prior) - ln det(posterior)


def singles(fit: Fit, blocks: Sequence[Columns], cost: Callable[[Named], float]) -> list[Offer]:
    """One candidate more, the best first; a start at the size of its step.

    Parameters
    ----------
    fit : Fit
        A state; it need not be settled.
    blocks : sequence of Columns
    cost : callable
        Minus twice the logarithm of the chance that a candidate is missing, before the runs are seen.
    """
    if not blocks:
        return []
    reductions = _reductions(fit, blocks, whole=False)
    steps = np.array([np.linalg.solve(one.seen[:, :, 0], one.moment[..., None])[..., 0] for one in reductions])
    both = zip(reductions, steps, strict=True)
    objectives = np.array([one.constant - (one.moment * step).sum(1) for one, step in both])
    found, without = [], min(one.constant for one in reductions)
    for at, block in enumerate(blocks):
        best = int(objectives[:, at].argmin())
        step = steps[best, at, : len(block.directions)]
        sizes, objective = step @ block.directions, float(objectives[best, at])
        if _can(block, step, sizes):
            score = objective + float(reductions[best].worth[at]) + cost(block.name)
            found.append(Offer((block.name,), (sizes,), objective, score, without))
    return sorted(found, key=lambda offer: round(offer.score, 6))


def pairs(fit: Fit, blocks: Sequence[Columns], cost: Callable[[Named], float], *, most: int) -> list[Offer]:
    """The best pairs of candidates, of blocks with one or two columns."""
    small = [block for block in blocks if len(block.directions) <= 2]
    if len(small) < 2:
        return []
    count = len(small)
    least, steps, worth = np.full((count, count), math.inf), np.zeros((2, count, count)), np.zeros((count, count))
    starts = np.array([block.start for block in small])
    reductions = _reductions(fit, small, whole=True)
    for one in reductions:
        objective, step, own = _pair_objectives(one, starts)
        better = objective < least
        least, steps = np.where(better, objective, least), np.where(better, step, steps)
        worth = np.where(better, own, worth)
    costs = np.array([cost(block.name) for block in small])
    first = dict[object, int]()  # of the blocks of a name
    own = np.array([first.setdefault(identity(block.name), at) for at, block in enumerate(small)])
    apart = (own[:, None] < own) & np.isfinite(least) & np.isfinite(least.T)
    score = np.where(apart, least + worth + costs[:, None] + costs, math.inf)
    found, seen = list[Offer](), set[tuple[int, int]]()
    without = min(one.constant for one in reductions)
    for place in np.argsort(score, axis=None)[: 8 * most]:
        i, j = divmod(int(place), count)
        pair, names_of = (int(own[i]), int(own[j])), (small[i].name, small[j].name)
        if pair in seen or not math.isfinite(score[i, j]):
            continue
        sized = [
            (block, step[: len(block.directions)])
            for block, step in ((small[i], steps[:, j, i]), (small[j], steps[:, i, j]))
        ]
        sizes = tuple(step @ block.directions for block, step in sized)
        if all(_can(block, step, size) for (block, step), size in zip(sized, sizes, strict=True)):
            seen.add(pair)
            found.append(Offer(names_of, sizes, float(least[i, j]), float(score[i, j]), without))
        if len(found) == most:
            break
    return found


def _pair_objectives(one: _Reduced, starts: npt.NDArray[np.bool_]) -> tuple[Array, Array, Array]:
    """Objective of each pair, the step of the second in it, and what their sizes must be worth.

    The objective is infinite where a start would change its sign.

    The first is taken out of the second as what is free was of both; matrices of two columns are written out.
    """
    at = np.arange(len(one.moment))
    v0, v1 = one.moment.T
    a, b, d = one.seen[at, 0, at, 0], one.seen[at, 0, at, 1], one.seen[at, 1, at, 1]
    det = a * d - b * b
    ia, ib, id_ = (d / det)[:, None], (-b / det)[:, None], (a / det)[:, None]
    gain = (ia[:, 0] * v0**2 + 2 * ib[:, 0] * v0 * v1 + id_[:, 0] * v1**2)[:, None]
    r00, r01, r10, r11 = one.seen[:, 0, :, 0], one.seen[:, 1, :, 0], one.seen[:, 0, :, 1], one.seen[:, 1, :, 1]
    q00, q01, q10, q11 = r00 * ia + r01 * ib, r00 * ib + r01 * id_, r10 * ia + r11 * ib, r10 * ib + r11 * id_
    l0 = v0 - q00 * v0[:, None] - q01 * v1[:, None]
    l1 = v1 - q10 * v0[:, None] - q11 * v1[:, None]
    w00, w01, w11 = a - q00 * r00 - q01 * r01, b - q00 * r10 - q01 * r11, d - q10 * r10 - q11 * r11
    det = w00 * w11 - w01 * w01
    regular = det > _REGULAR * a * d
    det = np.where(regular, det, 1.0)
    s0, s1 = (w11 * l0 - w01 * l1) / det, (w00 * l1 - w01 * l0) / det
    objective = one.constant - gain - s0 * l0 - s1 * l1
    # the second's determinant beside the first, in place of its own
    worth = one.worth[:, None] + one.worth + np.log(np.where(regular, det, 1.0) / (a * d - b * b))
    return np.where(regular & ~(starts & (s0 <= 0)), objective, math.inf), np.stack([s0, s1]), worth


def _can(block: Columns, step: Array, sizes: Array) -> bool:
    """Tell whether a candidate can have these sizes: a start keeps its sign, and a clearance is none below nothing."""
    least = np.array([parameter.least for parameter in source(block.name[0]).parameters])
    return bool((sizes >= least).all()) and (not block.start or step[0] > 0)


def _reductions(fit: Fit, blocks: Sequence[Columns], *, whole: bool) -> list[_Reduced]:
    """What blocks see, at some scales from that of the fit down to that of noise."""
    low, high = bounds(fit)
    pull = fit.moment / fit.scale - fit.pull * fit.departure
    stopped = ((low == 0) & (pull < 0)) | ((high == 0) & (pull > 0))  # at a bound, and would go on
    free = fit.free & ~stopped
    ends = np.cumsum([0, *(len(block.directions) for block in blocks)])
    total, width = int(ends[-1]), max(2, *(len(block.directions) for block in blocks))
    places = np.repeat(np.arange(len(blocks)), np.diff(ends)), np.concatenate([np.arange(n) for n in np.diff(ends)])
    cross, moment = np.zeros((total, int(free.sum()))), np.zeros(total)
    products = np.zeros((total, total)) if whole else np.zeros((len(blocks), width, width))
    for number, white in enumerate(fit.rows):
        rows = np.concatenate([block.rows[number] for block in blocks])
        cross += rows @ white[1:][free].T
        moment += rows @ white[0]
        products += rows @ rows.T if whole else _own_products(rows, rows, ends, width)
    prior = np.stack([_prior(block, fit, width) for block in blocks])
    before = np.linalg.slogdet(prior)[1]
    found, policy = [], fit.run_set.policy
    for scale in np.geomspace(fit.scale, 1.0, SCALES if fit.scale > 1 else 1):
        matrix = fit.gram[free][:, free] / scale + np.diag(fit.pull[free])
        right = fit.moment[free] / scale - (fit.pull * fit.departure)[free]
        inverse = inverted(matrix, 1e-12)
        squares = fit.bound + policy.regular * (scale - 1)  # at which a square counts so much less
        tangent = counted(squares, fit.bound, policy) + (fit.data - squares) / scale
        constant = tangent + fit.prior - float(right @ inverse @ right)
        reach = cross @ inverse / scale
        v = np.zeros((len(blocks), width))
        v[places] = moment / scale - reach @ right
        if whole:
            seen = np.zeros((len(blocks), width, len(blocks), width))
            beside = products / scale - reach @ cross.T / scale
            seen[places[0][:, None], places[1][:, None], places[0], places[1]] = beside
        else:
            seen = (products - _own_products(reach, cross, ends, width))[:, :, None] / scale
        numbers = np.arange(len(blocks))
        seen[numbers, :, numbers if whole else 0] += prior
        worth = np.linalg.slogdet(seen[numbers, :, numbers if whole else 0])[1] - before
        found.append(_Reduced(constant, seen, v, worth))
    return found


def _own_products(left: Array, right: Array, ends: npt.NDArray[np.intp], width: int) -> Array:
    """Products of each block's rows of one matrix with its rows of another, (blocks, width, width)."""
    counts = np.diff(ends)
    out = np.zeros((counts.size, width, width))
    for count in set(counts.tolist()):  # blocks of as many rows are one product
        which = np.flatnonzero(counts == count)
        at = ends[which][:, None] + np.arange(count)
        out[which, :count, :count] = left[at] @ right[at].transpose(0, 2, 1)
    return out


def _prior(block: Columns, fit: Fit, width: int) -> Array:
    """Inverse covariance of a block's columns before the runs are seen; 1 where it has none."""
    own, found = block.directions / np.array(fit.run_set.deviation(*block.name)), np.eye(width)
    found[: len(own), : len(own)] = own @ own.T
    return found
