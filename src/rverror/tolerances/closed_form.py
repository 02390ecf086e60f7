"""Error budget in closed form: mean, variance, worst case and root sum of squares of a stack of tolerances.

All of it follows from TE = nominal + x @ influence, page ``theory/budget.md``.  Angles are rad throughout.  A deviation
is TE less its mean over the revolution, the offset: the zero of a joint is set on the machine.

The worst peak-to-peak is a distance of two angles, the sum of the lengths ``|w(t1) - w(t2)|`` of each group's wave.
A walk from angle to farthest angle gives a good pair; by Cauchy and Schwarz one matrix product bounds all pairs, and
only those that the bound leaves open are computed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rverror.base.arrays import Array, Integers
from rverror.base.errors import check_kind
from rverror.base.viewed import Viewed
from rverror.tolerances.sampling_rule import SamplingRule, WorstGroup
from rverror.tolerances.stacking import Stack

_STARTS = 8
_ROWS = 256  # of pairs whose bounds, and
_PAIRS = 4096  # pairs whose sums, are held at a time
_SLACK = 1e-9  # rounding of a bound, relative
_DIRECTIONS = 128  # of a half turn


class GroupWaves:
    """Waves w of groups at their limits, whose distance ``sum |w(t1) - w(t2)|`` is the peak-to-peak that they can make.

    Boxes are waves of one number, shape (n, boxes); circles of two, shape (n, circles) each.
    """

    def __init__(self, groups: Sequence[WorstGroup], scaled: Array, nominal: Array | None = None) -> None:
        """Sum the rows of instances that move as one; the nominal error is a wave that is always at its limit."""
        self.count = scaled.shape[1]
        rows = [group.radius * scaled[group.components].sum(axis=0) for group in groups]
        waves = [wave[0] if len(wave) == 1 else wave[0] + 1j * wave[1] for wave in rows]
        waves += [] if nominal is None else [nominal]
        #: (n, groups); of vectors x + i y.
        self.waves = np.array(waves, dtype=np.complex128).reshape(-1, self.count).T.copy()

    def distance(self, i: Integers, j: Integers) -> Array:
        """Distance of pairs of angles."""
        return np.asarray(np.abs(self.waves[i] - self.waves[j]).sum(axis=-1), dtype=np.float64)

    def size(self) -> Array:
        """Sum of ``|w|`` at each angle, shape (n,)."""
        return np.asarray(np.abs(self.waves).sum(axis=1), dtype=np.float64)

    def peak_to_peaks(self) -> Array:
        """Largest peak-to-peak of each group alone; of vectors seen from many directions, to 1e-4."""
        turns = np.exp(1j * np.pi * np.arange(_DIRECTIONS)[:, None] / _DIRECTIONS)
        seen = ((turns if wave.imag.any() else turns[:1]) * wave for wave in self.waves.T)
        return np.array([np.ptp(wave.real, axis=1).max() for wave in seen])

    def farthest(self) -> tuple[float, int, int]:
        """Largest distance of two angles, exact, and their places."""
        best, first, second = self.walk()
        if best == 0:
            return 0.0, first, second
        features = self._features()
        square, ones = np.einsum("nf,nf->n", features, features), np.ones(self.count)
        # |f|^2 + |g|^2 - 2 f g as one product
        one, other = np.column_stack([-2 * features, square, ones]), np.column_stack([features, ones, square])
        for start in range(0, self.count, _ROWS):
            rows = slice(start, start + _ROWS)
            bound = one[rows] @ other[start:].T
            # `nonzero` of two axes takes five times as long
            i, j = np.divmod(np.flatnonzero(bound > best**2 * (1 - _SLACK)), bound.shape[1])
            later = j > i
            i, j = i[later] + start, j[later] + start
            for part in range(0, i.size, _PAIRS):
                pairs = slice(part, part + _PAIRS)
                found = self.distance(i[pairs], j[pairs])
                at = int(found.argmax())
                if found[at] > best:
                    best, first, second = float(found[at]), int(i[pairs][at]), int(j[pairs][at])
        return best, first, second

    def walk(self) -> tuple[float, int, int]:
        """Good pair: from some angles to the farthest one, and on from there as long as that helps."""
        every = np.arange(self.count)
        best = (0.0, 0, 0)
        for start in range(0, self.count, max(self.count // _STARTS, 1)):
            at, reached = start, -1.0
            while True:
                found = self.distance(np.full_like(every, at), every)
                to = int(found.argmax())
                if found[to] <= reached:
                    break
                reached = float(found[to])
                best = max(best, (reached, at, to))
                at = to
        return best

    def _features(self) -> Array:
        """Points whose Euclidean distance is a bound on `distance`, by Cauchy and Schwarz."""
        usual = np.sqrt(2 * self.waves.var(axis=0))
        waves, weight = np.concatenate([self.waves.real, self.waves.imag], axis=1), np.tile(usual, 2)
        moving = np.ptp(waves, axis=0) > 0
        points = (waves - waves.mean(axis=0))[:, moving] * np.sqrt(usual.sum() / weight[moving])
        return np.ascontiguousarray(points)


_CONSTANT = 1e-12  # of a waveform's size: below it is rounding


@dataclass(frozen=True)
class Contribution:
    """What one entry, the tolerance of a source, does to the output error."""

    label: str
    width: float  #: T, core unit
    dimension: str  #: a key of `units.CORE_UNITS`
    components: int  #: its number of toleranced components
    #: rad^2; variance of its deviation, mean over the revolution, with half of every covariance with another entry
    mean_square: float
    #: Of all entries' `mean_square`; these add up to 1, or are all 0 where every entry moves the offset alone.  Below 0
    #: where correlation with others takes off more than the entry adds.
    share: float
    worst_peak_to_peak: float  #: largest peak-to-peak of the entry alone
    worst_part: float  #: its part of the worst case of all, `WorstCase.peak_to_peak`
    rss: float  #: root sum of squares of the largest peak-to-peaks of its groups alone
    offset_deviation: float  #: standard deviation of the offset that it makes
    worst_offset: float  #: largest offset that it makes, to either side of its mean
    effect: str  #: ``"wave"``, ``"offset"`` where it moves the offset alone, ``"nothing"``


@dataclass(frozen=True)
class WorstCase:
    """Largest output errors within the tolerances, exact for the linear map at the angles given."""

    lower: Array  #: (n,); lower end of the envelope of TE
    upper: Array  #: (n,); its upper end
    offset: tuple[float, float]  #: least and largest offset
    peak_to_peak: float  #: largest peak-to-peak of any unit, nominal error included
    peak_to_peak_nominal: float  #: the nominal error's part of it; the rest is `Contribution.worst_part`
    peak_to_peak_angles: tuple[int, int]  #: places of the highest and the lowest angle
    peak_to_peak_values: Array  #: (m,); components of that unit, core units, less their means
    maximum: float  #: largest \|deviation\| of any unit


@dataclass(frozen=True)
class Budget(Viewed):
    """Closed-form error budget.

    Attributes
    ----------
    theta : ndarray, shape (n,), optional
        Nominal output angle.
    mean : ndarray, shape (n,)
        Expected TE.
    standard_deviation, deviation_standard_deviation : ndarray, shape (n,)
        Of TE, and of the deviation.
    offset_mean, offset_deviation : float
        Mean and standard deviation of the offset.
    nominal_peak_to_peak, nominal_mean_square : float
        Of the deviation of `mean`.
    mean_square : float
        Expected square of the rms over the revolution: `nominal_mean_square` and that of all entries.
    rss : float
        Root sum of squares of the largest peak-to-peaks of all groups alone, nominal error not included.
    worst : WorstCase
    contributions : tuple of Contribution
        In the order of the entries.
    """

    theta: Array | None
    mean: Array
    standard_deviation: Array
    deviation_standard_deviation: Array
    offset_mean: float
    offset_deviation: float
    nominal_peak_to_peak: float
    nominal_mean_square: float
    mean_square: float
    rss: float
    worst: WorstCase
    contributions: tuple[Contribution, ...]

    @property
    def rms(self) -> float:
        """Root of the expected mean square; the expected rms is a little below."""
        return math.sqrt(self.mean_square)


def budget(stack: Stack) -> Budget:
    """Closed-form error budget of a stack.

    Parameters
    ----------
    stack : Stack

    Returns
    -------
    Budget

    Examples
    --------
    >>> import rverror
    >>> from rverror.tolerances.stacking import stack
    >>> from rverror.tolerances.declared import tolerance
    >>> unit = rverror.Model(rverror.reducer("RV-40E"))
    >>> result = budget(stack(unit, [tolerance("crank.eccentricity", "5 um", crank=0, disc=0)]))
    >>> f"{result.worst.peak_to_peak * 180 / np.pi * 3600:.2f}"  # arcsec
    '18.51'
    """
    check_kind("stack", stack, Stack, "make it with stack(model, tolerances)")
    scaled = stack.scaled()
    offset = scaled.mean(axis=1)
    deviation = scaled - offset[:, None]
    size = np.abs(scaled).max(axis=1, initial=0.0)
    deviation[np.abs(deviation).max(axis=1, initial=0.0) <= _CONSTANT * size] = 0.0
    nominal_offset = float(stack.nominal.mean())
    nominal = stack.nominal - nominal_offset

    variance = by_entry(stack.rules, scaled) + _shared(stack, scaled)
    deviating = by_entry(stack.rules, deviation) + _shared(stack, deviation)
    offsets = by_entry(stack.rules, offset[:, None])[:, 0]
    offset_variance = float(offsets.sum() + _shared(stack, offset[:, None]).sum())
    mean_squares = deviating.mean(axis=1)
    total = float(mean_squares.sum())

    worst, parts = _worst_case(stack, scaled, offset, deviation)
    entries = []
    for e, rule in enumerate(stack.rules):
        rows = rule.components
        groups, middle = rule.worst_groups(), rule.distribution.middle
        shift = middle * deviation[rows].sum(axis=0)
        reach = 1 + abs(middle)  # of the farther limit from the mean
        waves = bool(deviation[rows].any())
        entries.append(
            Contribution(
                label=stack.labels[e],
                width=float(stack.width[e]),
                dimension=stack.components[rows.start].dimension,
                components=rows.stop - rows.start,
                mean_square=float(mean_squares[e]),
                share=float(mean_squares[e]) / total if total else 0.0,
                worst_peak_to_peak=GroupWaves(groups, deviation, shift).farthest()[0],
                worst_part=float(parts[e]),
                rss=reach * float(np.linalg.norm(GroupWaves(groups, deviation).peak_to_peaks())),
                offset_deviation=math.sqrt(offsets[e]),
                worst_offset=float(GroupWaves(groups, offset[:, None]).size()[0])
                + abs(middle * float(offset[rows].sum())),
                effect="wave" if waves else "offset" if size[rows].any() else "nothing",
            )
        )
    nominal_square = float(nominal @ nominal) / nominal.size
    return Budget(
        theta=stack.theta,
        mean=stack.nominal,
        standard_deviation=np.sqrt(np.maximum(variance.sum(axis=0), 0.0)),
        deviation_standard_deviation=np.sqrt(np.maximum(deviating.sum(axis=0), 0.0)),
        offset_mean=nominal_offset,
        offset_deviation=math.sqrt(max(offset_variance, 0.0)),
        nominal_peak_to_peak=float(np.ptp(nominal)),
        nominal_mean_square=nominal_square,
        mean_square=nominal_square + total,
        rss=math.sqrt(sum(entry.rss**2 for entry in entries)),
        worst=worst,
        contributions=tuple(entries),
    )


def by_entry(rules: Sequence[SamplingRule], scaled: Array) -> Array:
    """Variance that each entry makes at each angle, shape (entries, n).

    ``w @ rule.covariance() @ w`` as squares of the instances' waves and of their sums, which rounding does not make
    negative where the sums cancel.
    """
    variances = []
    for rule in rules:
        waves = scaled[rule.components].reshape(rule.instances, rule.terms, -1)
        own = np.einsum("itn,itn->n", waves, waves)
        alike = np.array(rule.alike)
        shared = np.sum([(waves[alike == group].sum(axis=0) ** 2).sum(axis=0) for group in set(rule.alike)], axis=0)
        rho = rule.remaining_correlation
        variances.append(rule.distribution.variance * ((1 - rho) * own + rho * shared))
    return np.array(variances)


def _shared(stack: Stack, scaled: Array) -> Array:
    """What correlation between entries adds to the variance of each, shape (entries, n): half of every covariance."""
    added = np.zeros((len(stack.rules), scaled.shape[1]))
    if stack.dependence is not None:
        np.add.at(added, stack.entry, scaled * (stack.dependence.between @ scaled))
    return added


# --- worst case -------------------------------------------------------------------------------------------------------


def _worst_case(stack: Stack, scaled: Array, offset: Array, deviation: Array) -> tuple[WorstCase, Array]:
    """Worst case, and the part of each entry in its peak-to-peak."""
    groups = stack.worst_groups
    at_middle = stack.at_middle()
    middle_offset = float(at_middle.mean())
    centred = at_middle - middle_offset
    reach = GroupWaves(groups, scaled).size()
    offset_reach = float(GroupWaves(groups, offset[:, None]).size()[0])
    peak_to_peak, high, low, values, parts = worst_pair(stack, deviation, centred, deviation)
    worst = WorstCase(
        lower=at_middle - reach,
        upper=at_middle + reach,
        offset=(middle_offset - offset_reach, middle_offset + offset_reach),
        peak_to_peak=peak_to_peak,
        peak_to_peak_nominal=float(stack.nominal[high] - stack.nominal[low]),
        peak_to_peak_angles=(high, low),
        peak_to_peak_values=values * stack.width[stack.entry],
        maximum=float((np.abs(centred) + GroupWaves(groups, deviation).size()).max()),
    )
    return worst, parts


def worst_pair(stack: Stack, scaled: Array, at_middle: Array, rows: Array) -> tuple[float, int, int, Array, Array]:
    """Largest peak-to-peak of any unit, the places of its two angles, and the standard values that make it.

    The first angle is the higher one of what no part's error can change.  Last, what the values of each entry make of
    the rows of its components, from the second to the first.
    """
    peak_to_peak, high, low = GroupWaves(stack.worst_groups, scaled, at_middle).farthest()
    if at_middle[high] < at_middle[low]:
        high, low = low, high
    between = rows[:, high] - rows[:, low]
    values = np.zeros(between.size)
    for group in stack.worst_groups:
        direction = between[group.components].sum(axis=0)
        length = float(np.hypot.reduce(direction))
        if length > 0:
            values[group.components] += group.radius * direction / length
    values += stack.middle
    parts = np.bincount(stack.entry, values * between, len(stack.rules)).astype(np.float64)
    return peak_to_peak, high, low, values, parts
