"""Least squares for waves: complex parts with the disc in which each lies, from given noise or from the misfit.

Real and imaginary part share one design and one noise, so the region of a part in the complex plane is a disc.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from rverror.base.arrays import Array
from rverror.runs.order_table import Waves

#: Standard deviations of the chance law beyond which residuals keep together: of straight laws one in a hundred.
SYSTEMATIC = 2.33
#: Chance of a straight law's residuals below which it is called bent, and below which its discs reach to a bent one's.
FLAGGED, WIDENED = 0.01, 0.1
#: Noise is never taken below this share of the waves: they come from files of few digits.
ROUNDING = 1e-9
_LARGEST_CORRELATION = 0.9  # of neighbours; beyond it intervals are told by few cases and grow without bound


@dataclass(frozen=True, kw_only=True)
class WavePart:
    """One complex part of a wave and where it can lie.

    Attributes
    ----------
    value : complex
        As `OrderCase.waves`: rad, or rad per unit of what it goes with.
    deviation : float
        Standard deviation of its real and of its imaginary part; infinite where the cases cannot tell it.
    radius : float
        The true part lies within so much of `value`, at the confidence asked for.
    freedom : float
        Degrees of freedom of the noise: twice the cases less twice the parts; infinite where the noise was given.
    """

    value: complex
    deviation: float
    radius: float
    freedom: float

    @property
    def amplitude(self) -> float:
        """Size of `value`."""
        return abs(self.value)

    @property
    def low(self) -> float:
        """Smallest size within the disc: 0 where the disc holds zero."""
        return max(abs(self.value) - self.radius, 0.0) if math.isfinite(self.radius) else 0.0

    @property
    def high(self) -> float:
        """Largest size within the disc."""
        return abs(self.value) + self.radius

    @property
    def told(self) -> bool:
        """Whether zero is outside the disc."""
        return self.low > 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class WaveFit:
    """Parts by least squares.

    Attributes
    ----------
    parts : tuple of WavePart
        One for each column of the design.
    residual : ndarray of complex, shape (n,)
    noise : float
        Standard deviation of a case's real and imaginary part that the parts' discs stand on, rad: root mean square
        over the cases; infinite where neither sigma nor misfit tells it.
    freedom : float
    variance : float
        Of a residual's real and imaginary part, over sigma where it was given; without the growth of the notes.
    misfit : float
        Sum of the squared residuals, over sigma where it was given.
    spare : int
        Cases less columns.
    bent : bool
        Whether the residuals are larger than sigma lets them be, keep together from neighbour to neighbour, hold a
        bend, or one lies astray of all others.
    """

    parts: tuple[WavePart, ...]
    residual: Waves
    noise: float
    freedom: float
    variance: float
    misfit: float
    spare: int
    bent: bool


def disc_factor(confidence: float, freedom: float) -> float:
    """Radius of the disc that holds a complex part, over the standard deviation of its real part.

    Two squares over a noise of `freedom` degrees follow Fisher's law with 2 and `freedom`, whose quantile is closed.

    Examples
    --------
    >>> round(disc_factor(0.95, math.inf), 3), round(disc_factor(0.95, 10.0), 3)
    (2.448, 2.865)
    """
    miss = 1.0 - confidence
    if math.isinf(freedom):
        return math.sqrt(-2.0 * math.log(miss))
    return math.sqrt(freedom * math.expm1(-2.0 / freedom * math.log(miss)))


def fit_waves(
    design: Array,
    waves: Waves,
    *,
    confidence: float,
    sigma: Array | None = None,
    neighbours: Sequence[tuple[int, int]] = (),
    bend: Array | None = None,
) -> WaveFit:
    """Fit complex parts to waves.

    Parameters
    ----------
    design : ndarray, shape (n, p)
        Of full rank, n >= p.
    waves : ndarray of complex, shape (n,)
    confidence : float
        Of the discs.
    sigma : ndarray, shape (n,), optional
        Standard deviation of each real and imaginary part.  Where the misfit is larger, the misfit counts.
    neighbours : sequence of (int, int)
        Pairs of cases that follow each other along the load or along the speed.
    bend : ndarray, shape (n,), optional
        Column of a law that is not straight, to see whether the residuals hold it.

    Returns
    -------
    WaveFit

    Notes
    -----
    Where residuals keep together, the cases are fewer than they look: variances grow by (1 + r)/(1 - r), the factor of
    a first-order autoregression with the correlation r of neighbours, and the degrees of freedom fall by it.  Where one
    case lies astray, discs reach farther by what the parts move without it; where the residuals hold a bend, by what
    the parts move beside it.
    """
    weight = np.ones(waves.size) if sigma is None else 1.0 / sigma
    weighed = design * weight[:, None]
    columns = np.abs(weighed).max(axis=0)  # torque and constant are many powers of ten apart
    basis, triangle = np.linalg.qr(weighed / columns)
    value = np.linalg.solve(triangle, basis.T @ (waves * weight)) / columns
    left = (waves - design @ value) * weight
    spread = np.linalg.norm(np.linalg.inv(triangle), axis=1) / columns
    spare = waves.size - design.shape[1]
    misfit = float(np.vdot(left, left).real)
    dust = ROUNDING * math.sqrt(float(np.mean(np.abs(waves * weight) ** 2)))
    variance, freedom = _noise(misfit, spare, given=sigma is not None)
    strained = sigma is not None and _strained(misfit, spare)
    # bends below the last digits are the files' own
    visible = misfit > waves.size * dust**2
    together, growth = _together(left, basis, neighbours) if visible else (False, 1.0)
    astray = _astray(left, basis, given=sigma is not None) if visible else None
    moved = np.zeros(value.size)
    curved = 1.0
    if visible and bend is not None and spare > 2:
        curved, along, found = _curved(left, basis, bend * weight, given=sigma is not None)
        if curved < WIDENED:
            moved = np.abs(np.linalg.solve(triangle, along) / columns * found)
    if astray is not None:
        free = 1.0 - float(basis[astray] @ basis[astray])
        alone = np.abs(np.linalg.solve(triangle, basis[astray]) / columns * left[astray] / free)
        moved = np.maximum(moved, alone)
    variance = max(variance, dust**2)
    freedom = max(freedom / growth, 2.0) if freedom > 0 else freedom
    scale = math.sqrt(variance * growth)
    factor = disc_factor(confidence, freedom) if math.isfinite(scale) else math.inf
    parts = tuple(
        WavePart(
            value=complex(v),
            deviation=float(d * scale + far / factor),
            radius=float(d * scale * factor + far),
            freedom=freedom,
        )
        for v, d, far in zip(value, spread, moved, strict=True)
    )
    return WaveFit(
        parts=parts,
        residual=left / weight,
        noise=scale * math.sqrt(float(np.mean(1.0 / weight**2))),
        freedom=freedom,
        variance=variance,
        misfit=misfit,
        spare=spare,
        bent=strained or together or astray is not None or curved < FLAGGED,
    )


def _noise(misfit: float, spare: int, *, given: bool) -> tuple[float, float]:
    """Variance of a part of a residual and its degrees of freedom: what was given or the misfit, the larger of both."""
    found = misfit / (2 * spare) if spare > 0 else 0.0
    if given and found <= 1.0:
        return 1.0, math.inf
    return (found, 2.0 * spare) if spare > 0 else (math.inf, 2.0)


def _strained(misfit: float, spare: int) -> bool:
    """Whether the misfit is larger than a chi-square of the given noise is once in a hundred."""
    return spare > 0 and misfit > float(scipy.special.chdtri(2 * spare, FLAGGED))


def _astray(left: Waves, basis: Array, *, given: bool) -> int | None:
    """Case whose residual, of all, is no chance beside the noise that the others tell; one table in a hundred has one.

    The square of a residual over the variance without its case follows Fisher's law; the bound is shared by the cases.
    """
    spare = left.size - basis.shape[1] - 1
    if spare < 2:
        return None
    square = np.abs(left) ** 2
    free = np.maximum(1.0 - np.sum(basis**2, axis=1), ROUNDING)
    alone = square / free
    others = np.maximum((float(square.sum()) - alone) / (2 * spare), 1.0 if given else 0.0)
    worst = int(np.argmax(alone / np.maximum(others, np.finfo(np.float64).tiny)))
    chance = (1.0 + float(alone[worst]) / max(float(others[worst]), 1e-300) / (2 * spare)) ** -float(spare)
    return worst if left.size * chance < FLAGGED else None


def _curved(left: Waves, basis: Array, bend: Array, *, given: bool) -> tuple[float, Array, complex]:
    """Chance of so much of a bend in the residuals of a straight law, the bend's share of each column, and its size."""
    along = basis.T @ bend
    beyond = bend - basis @ along
    square = float(beyond @ beyond)
    if square <= ROUNDING * float(bend @ bend):
        return 1.0, along, 0j
    spare = left.size - basis.shape[1] - 1
    size = complex(beyond @ left) / square
    gained = abs(size) ** 2 * square
    others = (float(np.vdot(left, left).real) - gained) / (2 * spare)
    others = max(others, 1.0 if given else 0.0, 1e-300)
    return (1.0 + gained / others / (2 * spare)) ** -float(spare), along, size


def _together(left: Waves, basis: Array, neighbours: Sequence[tuple[int, int]]) -> tuple[bool, float]:
    """Whether residuals of neighbours keep together, and by what variances grow if they do.

    The correlation's mean and variance under white noise are those of a ratio of squares within what the design leaves
    free, twice over for real and imaginary part (Durbin and Watson).
    """
    spare = left.size - basis.shape[1]
    if not neighbours or spare < 2:
        return False, 1.0
    link = np.zeros((left.size, left.size))
    first, second = np.array(neighbours, dtype=np.intp).T
    link[first, second] = link[second, first] = 0.5
    free = np.eye(left.size) - basis @ basis.T
    inside = free @ link @ free
    mean = float(np.trace(inside)) / spare
    squares = float(np.sum(inside * inside)) - spare * mean**2  # of the form's roots about their mean
    many = 2 * spare
    deviation = math.sqrt(max(2.0 * 2.0 * squares / (many * (many + 2)), 0.0))
    found = float(np.vdot(left, link @ left).real) / float(np.vdot(left, left).real)
    if not found - mean > SYSTEMATIC * deviation or deviation == 0.0:
        return False, 1.0
    # every pair counts half of each of its two squares
    correlation = min((found - mean) * left.size / len(neighbours), _LARGEST_CORRELATION)
    return True, (1.0 + correlation) / (1.0 - correlation)


@dataclass(frozen=True, kw_only=True)
class BothWays:
    """One part in both directions of motion.

    Attributes
    ----------
    common, different : WavePart
        Half the sum, and half of forward less reverse.
    relation : str or None
        ``alike``: the parts agree within the noise.  ``opposite``: they agree but for the sign.  ``mirrored``: their
        sizes agree, their phases neither way.  ``different``: none of these.  None: the noise leaves it open.
    """

    common: WavePart
    different: WavePart
    relation: str | None


def both_ways(forward: WavePart, reverse: WavePart, *, confidence: float) -> BothWays:
    """Compare a part of the forward with that of the reverse motion.

    Parameters
    ----------
    forward, reverse : WavePart
    confidence : float

    Returns
    -------
    BothWays
    """
    deviation = math.hypot(forward.deviation, reverse.deviation)
    freedom = _welch(forward, reverse)
    factor = disc_factor(confidence, freedom) if math.isfinite(deviation) else math.inf

    def half(value: complex) -> WavePart:
        spread = deviation / 2
        return WavePart(value=value / 2, deviation=spread, radius=spread * factor, freedom=freedom)

    common, different = half(forward.value + reverse.value), half(forward.value - reverse.value)
    # sizes differ along one line alone, for which the disc is wider than need be: an agreement is not found too often
    sizes = abs(forward.amplitude - reverse.amplitude) <= deviation * factor
    relation = None
    if common.told and not different.told:
        relation = "alike"
    elif different.told and not common.told:
        relation = "opposite"
    elif common.told and different.told:
        relation = "mirrored" if sizes and forward.told and reverse.told else "different"
    return BothWays(common=common, different=different, relation=relation)


def _welch(one: WavePart, other: WavePart) -> float:
    """Degrees of freedom of a sum of two variances, by Welch and Satterthwaite."""
    if not math.isfinite(one.deviation + other.deviation):
        return 2.0
    whole = one.deviation**2 + other.deviation**2
    parts = one.deviation**4 / one.freedom + other.deviation**4 / other.freedom
    return whole**2 / parts if parts > 0 else math.inf
