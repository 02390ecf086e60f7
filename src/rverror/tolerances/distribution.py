"""Distributions of a part's error within its tolerance, each for a tolerance of width 1.

Every distribution scales with the width T of its tolerance: a value is T times a standard draw.  A `Scalar` one gives
each component by itself, a `Planar` one the two components of a vector together.  Page ``theory/budget.md``.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import scipy

from rverror.base.arrays import Array
from rverror.base.errors import InputError

#: Share of the parts outside the tolerance at a capability of 1, for an amplitude: that of +-3 sigma.
OUTSIDE = 0.0027

_LARGEST_SHAPE = 1.5  # of a logarithm: one part in 700 is then 90 times the median
_FAR = 8.5  # of a normal variable: beyond it lies 1e-17
_STEPS = 341
_NODES = 48  # of a class: one half of a normal variable is integrated to 1e-12
_SMALLEST_UNIFORM = 2.0**-54  # so that no normal quantile is infinite


class Distribution(ABC):
    """What all distributions have."""

    name: ClassVar[str]  #: as in tolerance files
    #: Whether the tolerance limits the length of a vector, not each component: the worst case is a circle.
    vector: ClassVar[bool] = False

    @property
    def middle(self) -> float:
        """Middle of the limits less the mean, in widths; not 0 where one tail is longer than the other."""
        return 0.0

    @property
    @abstractmethod
    def variance(self) -> float:
        """Variance of one component of the standard draw, whose mean is 0."""


class Scalar(Distribution):
    """Distribution of one component."""

    @abstractmethod
    def quantile(self, probability: Array) -> Array:
        """Standard values below which lie the given shares of the parts, any shape."""

    def from_normal(self, z: Array) -> Array:
        """Standard values as monotone images of standard normal ones, any shape."""
        return self.quantile(np.asarray(scipy.special.ndtr(z)))

    def class_means(self, classes: int) -> Array:
        """Mean standard value of each class of parts sorted by size into classes of equal number, smallest first.

        By Gauss' quadrature over the normal variable of which the values are images.
        """
        nodes, weights = np.polynomial.legendre.leggauss(_NODES)
        ends = normal_quantile(np.arange(classes + 1) / classes)[:, None]
        half = np.diff(ends, axis=0) / 2
        z = ends[:-1] + half * (1 + nodes)
        density = np.exp(-z * z / 2) / math.sqrt(2 * math.pi)
        means = classes * np.sum(half * weights * density * self.from_normal(z), axis=1)
        return np.asarray(means, dtype=np.float64)

    def class_correlation(self, classes: int) -> float:
        """Correlation of two parts of one class, Pearson's: the share of the classes' means in the variance."""
        return float(np.mean(self.class_means(classes) ** 2)) / self.variance

    def widest_class(self, classes: int) -> float:
        """Half the width of the widest class within the limits, in widths."""
        ends = np.clip(self.quantile(np.arange(classes + 1) / classes) - self.middle, -1.0, 1.0)
        ends[0], ends[-1] = -1.0, 1.0
        return float(np.diff(ends).max()) / 2


class Planar(Distribution):
    """Distribution of a vector whose phase is uniform."""

    vector: ClassVar[bool] = True
    variates: ClassVar[int]  #: uniform variates that one vector takes

    @abstractmethod
    def pairs(self, uniform: Array) -> Array:
        """Standard vectors, shape (..., 2), from uniform variates, shape (..., variates)."""


@dataclass(frozen=True)
class Uniform(Scalar):
    """Each component anywhere in +-T alike."""

    name: ClassVar[str] = "uniform"
    variance: ClassVar[float] = 1 / 3

    def quantile(self, probability: Array) -> Array:
        """``2 u - 1``."""
        return 2 * probability - 1


@dataclass(frozen=True)
class Triangular(Scalar):
    """Each component in +-T, the density falling from the middle to both ends along straight lines."""

    name: ClassVar[str] = "triangular"
    variance: ClassVar[float] = 1 / 6

    def quantile(self, probability: Array) -> Array:
        """From the area of the triangle on the nearer side."""
        side = probability - 0.5
        return np.asarray(np.sign(side) * (1 - np.sqrt(1 - 2 * np.abs(side))), dtype=np.float64)


@dataclass(frozen=True)
class _Process(Scalar):
    """Distribution of a process that is known by its capability."""

    capability: float = 1.0

    def __post_init__(self) -> None:
        """Check the capability."""
        if not 0 < self.capability < math.inf:
            raise InputError(
                f"capability = {self.capability:g}: must be above 0; give the Cp of the process, such as 1.33"
            )

    def quantile(self, probability: Array) -> Array:
        """Values of the normal quantiles, `from_normal`."""
        return self.from_normal(normal_quantile(probability))


@dataclass(frozen=True)
class Normal(_Process):
    """Each component normal, the tolerance T at 3 Cp sigma.

    Attributes
    ----------
    capability : float
        Process capability Cp, above 0: T / (3 sigma).
    """

    name: ClassVar[str] = "normal"

    @property
    def sigma(self) -> float:
        """Standard deviation in widths."""
        return 1 / (3 * self.capability)

    @property
    def variance(self) -> float:
        """``sigma**2``."""
        return self.sigma**2

    def from_normal(self, z: Array) -> Array:
        """``sigma z``."""
        return self.sigma * z


@dataclass(frozen=True)
class Lognormal(_Process):
    """Each component an exponential of a normal variable: one tail is longer than the other.

    At a capability of 1 the limits are its quantiles of -3 and +3 sigma, as those of `Normal` are.

    Attributes
    ----------
    capability : float
        Process capability Cp, above 0: width between the limits over that between the quantiles of -3 and +3 sigma,
        whose middle is that of the limits.
    shape : float
        Standard deviation of the logarithm, not 0; below 0 the longer tail is the lower one.
    """

    name: ClassVar[str] = "lognormal"
    shape: float = field(kw_only=True)

    def __post_init__(self) -> None:
        """Check the values."""
        super().__post_init__()
        if not 0 < abs(self.shape) <= _LARGEST_SHAPE:
            raise InputError(
                f"shape = {self.shape:g}: the standard deviation of the logarithm must be from 0 to {_LARGEST_SHAPE:g} "
                "and not 0; give one such as 0.3, or distribution = 'normal'"
            )
        if abs(self.middle) >= 1:
            raise InputError(f"capability = {self.capability:g}: the mean lies beyond a limit; give a larger one")

    @property
    def _scale(self) -> float:
        return 1 / (self.capability * math.sinh(3 * self.shape))

    @property
    def middle(self) -> float:
        """``(cosh(3 sigma) - exp(sigma**2 / 2)) / (Cp sinh(3 sigma))``, sigma the shape."""
        return (math.cosh(3 * self.shape) - math.exp(self.shape**2 / 2)) * self._scale

    @property
    def variance(self) -> float:
        """``exp(sigma**2) (exp(sigma**2) - 1) / (Cp sinh(3 sigma))**2``."""
        square = self.shape**2
        return math.exp(square) * math.expm1(square) * self._scale**2

    def from_normal(self, z: Array) -> Array:
        """``(exp(sigma z) - exp(sigma**2 / 2)) / (Cp sinh(3 sigma))``, sigma the shape."""
        return np.asarray((np.exp(self.shape * z) - math.exp(self.shape**2 / 2)) * self._scale, dtype=np.float64)


@dataclass(frozen=True)
class Rayleigh(Normal):
    """Vector of normal components: its amplitude is a Rayleigh variable, its phase uniform.

    Attributes
    ----------
    capability : float
        Process capability Cp, above 0.  At 1 the amplitude exceeds T in 0.27 % of the parts, as with +-3 sigma.
    """

    name: ClassVar[str] = "rayleigh"
    vector: ClassVar[bool] = True

    @property
    def sigma(self) -> float:
        """Standard deviation of each component in widths, ``1 / (Cp sqrt(-2 ln 0.0027))``."""
        return 1 / (self.capability * math.sqrt(-2 * math.log(OUTSIDE)))


@dataclass(frozen=True)
class TruncatedNormal(_Process):
    """Each component normal with T at 3 Cp sigma, and parts beyond +-T sorted out.

    Attributes
    ----------
    capability : float
        Process capability Cp before sorting, above 0.
    """

    name: ClassVar[str] = "truncated_normal"

    @property
    def variance(self) -> float:
        """``(1 - 2 k phi(k) / (2 Phi(k) - 1)) / k**2`` with k = 3 Cp."""
        k = 3 * self.capability
        density = math.exp(-k * k / 2) / math.sqrt(2 * math.pi)
        return (1 - 2 * k * density / math.erf(k / math.sqrt(2))) / k**2

    def quantile(self, probability: Array) -> Array:
        """Normal quantile of the share within the cut, from the nearer side."""
        k = 3 * self.capability
        side = np.asarray(probability) - 0.5
        tail = float(scipy.special.ndtr(-k)) + (0.5 - np.abs(side)) * math.erf(k / math.sqrt(2))
        return np.asarray(-np.sign(side) * scipy.special.ndtri(tail) / k, dtype=np.float64)


@dataclass(frozen=True)
class Samples(Scalar):
    """Measured values, resampled along straight lines between neighbours.

    Attributes
    ----------
    values : tuple of float
        Core units; at least two different ones.

    Notes
    -----
    The i-th smallest of N stands at the probability (i - 1/2) / N; beyond the first and the last the quantile is flat.
    So the mean is that of the values exactly and nothing lies beyond them.
    """

    values: tuple[float, ...]
    name: ClassVar[str] = "samples"

    def __post_init__(self) -> None:
        """Check the values."""
        _check_samples(self.values)
        if min(self.values) == max(self.values):
            raise InputError(f"samples: all {len(self.values)} values are equal; give at least two different ones")

    @property
    def mean(self) -> float:
        """Mean of the values, core units."""
        return math.fsum(self.values) / len(self.values)

    @property
    def width(self) -> float:
        """Largest deviation of a value from the mean, core units."""
        return max(abs(value - self.mean) for value in self.values)

    @property
    def variance(self) -> float:
        """Of the piecewise straight quantile, in widths squared."""
        return _mean_square(self._standard())

    def quantile(self, probability: Array) -> Array:
        """Straight lines between the values."""
        return _interpolated(probability, self._standard())

    def class_means(self, classes: int) -> Array:
        """From the integral of the piecewise straight quantile, exact."""
        ends = np.arange(classes + 1) / classes
        number = len(self.values)
        knots = np.union1d(ends, (np.arange(number) + 0.5) / number)
        heights = self.quantile(knots)
        below = np.concatenate([[0.0], np.cumsum(np.diff(knots) * (heights[1:] + heights[:-1]) / 2)])
        return np.asarray(classes * np.diff(np.interp(ends, knots, below)), dtype=np.float64)

    def _standard(self) -> Array:
        return (np.sort(self.values) - self.mean) / self.width


@dataclass(frozen=True)
class Circle(Planar):
    """Vector anywhere in a circle of radius T alike."""

    name: ClassVar[str] = "circle"
    variates: ClassVar[int] = 2
    variance: ClassVar[float] = 1 / 4

    def pairs(self, uniform: Array) -> Array:
        """Amplitude ``sqrt(u1)``, phase ``2 pi u2``."""
        return _polar(np.sqrt(uniform[..., 0]), uniform[..., 1])


@dataclass(frozen=True)
class Ring(Planar):
    """Vector of length T exactly: a sorted part at a random assembly phase."""

    name: ClassVar[str] = "ring"
    variates: ClassVar[int] = 1
    variance: ClassVar[float] = 1 / 2

    def pairs(self, uniform: Array) -> Array:
        """Phase ``2 pi u``."""
        return _polar(np.ones(uniform.shape[:-1]), uniform[..., 0])


@dataclass(frozen=True)
class SampledAmplitude(Planar):
    """Vector of a measured length at a random phase.

    Attributes
    ----------
    values : tuple of float
        Measured lengths, core units, not negative, resampled as `Samples` does.
    """

    values: tuple[float, ...]
    name: ClassVar[str] = "samples"
    variates: ClassVar[int] = 2

    def __post_init__(self) -> None:
        """Check the values."""
        _check_samples(self.values)
        if min(self.values) < 0:
            raise InputError(f"samples: {min(self.values):g} is no length of a vector; give values of 0 or more")
        if max(self.values) == 0:
            raise InputError("samples: all values are 0; give the measured lengths")

    @property
    def width(self) -> float:
        """Largest value, core units."""
        return max(self.values)

    @property
    def variance(self) -> float:
        """Half the mean square length, in widths squared."""
        return _mean_square(self._standard()) / 2

    def pairs(self, uniform: Array) -> Array:
        """Amplitude by the quantile of the values at u1, phase ``2 pi u2``."""
        return _polar(_interpolated(uniform[..., 0], self._standard()), uniform[..., 1])

    def _standard(self) -> Array:
        return np.sort(self.values) / self.width


def normal_correlation(one: Scalar, other: Scalar, correlation: float) -> float:
    """Correlation, -1 to 1, that two normal variables need for the given one of their images, Pearson's.

    By quadrature over the one and what the other has beside it; the images' correlation grows with it.

    Raises
    ------
    InputError
        If no normal variables give so large a correlation: two distributions of different shape are never quite alike.

    Examples
    --------
    >>> round(normal_correlation(Uniform(), Uniform(), -0.5), 6)  # 2 sin(pi rho / 6)
    -0.517638
    >>> normal_correlation(Normal(), Normal(1.33), 0.5)
    0.5
    """
    both_normal = isinstance(one, Normal) and isinstance(other, Normal)
    if both_normal or correlation == 0 or (one == other and correlation == 1):
        return correlation
    z = np.linspace(-_FAR, _FAR, _STEPS)
    weight = np.exp(-z * z / 2) / np.exp(-z * z / 2).sum()
    first, second = one.from_normal(z), other.from_normal(z)
    spread = math.sqrt(float(weight @ (first - weight @ first) ** 2) * float(weight @ (second - weight @ second) ** 2))
    first = (first - weight @ first) * weight

    def reached(r: float) -> float:
        given = other.from_normal(r * z[:, None] + math.sqrt(1 - r * r) * z) @ weight
        return float(first @ given) / spread

    low, high = reached(-1.0), reached(1.0)
    if not low <= correlation <= high:
        raise InputError(
            f"correlation {correlation:g} of a {one.name} and a {other.name} distribution: only {low:.3f} to "
            f"{high:.3f} is possible; give one of these, or the same distribution to both"
        )
    return float(scipy.optimize.brentq(lambda r: reached(r) - correlation, -1.0, 1.0, xtol=1e-10))


def normal_quantile(uniform: Array) -> Array:
    """Standard normal values of uniform variates, finite at 0 and 1 too."""
    ends = _SMALLEST_UNIFORM, 1 - 2 * _SMALLEST_UNIFORM
    return np.asarray(scipy.special.ndtri(np.clip(uniform, *ends)), dtype=np.float64)


def turned(pairs: Array, uniform: Array) -> Array:
    """Vectors, shape (..., 2), each turned by 2 pi times its uniform variate, shape (...)."""
    cos, sin = np.moveaxis(_polar(np.ones(uniform.shape), uniform), -1, 0)
    x, y = pairs[..., 0], pairs[..., 1]
    return np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)


def _polar(amplitude: Array, turns: Array) -> Array:
    angle = 2 * np.pi * turns
    return np.stack([amplitude * np.cos(angle), amplitude * np.sin(angle)], axis=-1)


def _check_samples(values: tuple[float, ...]) -> None:
    if not values:
        raise InputError("samples: there are none; give at least two measured values")
    if not all(math.isfinite(value) for value in values):
        raise InputError("samples: a value is not finite; leave it out")


def _mean_square(knots: Array) -> float:
    """Mean square of the piecewise straight quantile through sorted knots."""
    ends = (knots[0] ** 2 + knots[-1] ** 2) / 2
    low, high = knots[:-1], knots[1:]
    return float((ends + ((low * low + low * high + high * high) / 3).sum()) / knots.size)


def _interpolated(probability: Array, knots: Array) -> Array:
    return np.interp(np.asarray(probability) * knots.size - 0.5, np.arange(knots.size), knots)
