"""Least squares for waves: complex parts with the disc in which each lies, from given noise or from the misfit.

Real and imaginary part share one design and one noise, so the region of a part in the complex plane is a disc.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy

from rverror.base.arrays import Array
from rverror.base.errors import former_name
from rverror.runs.order_table import Waves

#: Of all discs and intervals.
CONFIDENCE = 0.95
#: Chance of a straight law's residuals below which it is called bent, and below which its discs reach to a bent one's.
FLAGGED, WIDENED = 0.01, 0.1
#: Noise is never taken below this share of the waves: they come from files of few digits.
ROUNDING = 1e-9


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
        The true part lies within so much of `value`, at 95 %.
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
    def significant(self) -> bool:
        """Whether zero is outside the disc."""
        return self.low > 0.0

    told = former_name("told", "significant")


@dataclass(frozen=True, kw_only=True, eq=False)
class WaveFit:
    """Parts by least squares.

    Attributes
    ----------
    parts : tuple of WavePart
        One for each column of the design.
    noise : float
        Standard deviation of a case's real and imaginary part that the parts' discs stand on, rad: root mean square
        over the cases; infinite where neither sigma nor misfit tells it.
    bent : bool
        Whether the residuals are larger than sigma lets them be, or hold a bend.
    """

    parts: tuple[WavePart, ...]
    noise: float
    bent: bool


def disc_factor(freedom: float) -> float:
    """Radius of the disc that holds a complex part at 95 %, over the standard deviation of its real part.

    Two squares over a noise of `freedom` degrees follow Fisher's law with 2 and `freedom`, whose quantile is closed.

    Examples
    --------
    >>> round(disc_factor(math.inf), 3), round(disc_factor(10.0), 3)
    (2.448, 2.865)
    """
    miss = math.log(1.0 - CONFIDENCE)
    if math.isinf(freedom):
        return math.sqrt(-2.0 * miss)
    return math.sqrt(freedom * math.expm1(-2.0 / freedom * miss))


def fit_waves(design: Array, waves: Waves, *, sigma: Array | None = None, bend: Array | None = None) -> WaveFit:
    """Fit complex parts to waves.

    Parameters
    ----------
    design : ndarray, shape (n, p)
        Of full rank, n >= p.
    waves : ndarray of complex, shape (n,)
    sigma : ndarray, shape (n,), optional
        Standard deviation of each real and imaginary part.  Where the misfit is larger, the misfit counts.
    bend : ndarray, shape (n,), optional
        Column of a law that is not straight, to see whether the residuals hold it.

    Returns
    -------
    WaveFit

    Notes
    -----
    Where the residuals hold the bend, discs reach farther by what the parts move beside it.
    """
    weight = np.ones(waves.size) if sigma is None else 1.0 / sigma
    value, spread, misfit = _least_squares(design * weight[:, None], waves * weight)
    count, spare = waves.size, waves.size - design.shape[1]
    least = 0.0 if sigma is None else 1.0
    dust = ROUNDING * math.sqrt(float(np.mean(np.abs(waves * weight) ** 2)))
    found = misfit / (2 * spare) if spare else math.inf
    if sigma is not None and (not spare or found <= 1.0):
        variance, freedom = 1.0, math.inf
    else:
        variance, freedom = max(found, dust**2), max(2.0 * spare, 2.0)
    bent = sigma is not None and spare > 0 and misfit > float(scipy.special.chdtri(2 * spare, FLAGGED))
    moved = np.zeros(value.size)
    if bend is not None and spare > 2 and misfit > count * dust**2:  # below the last digits it is the files' own
        curved, _, less = _least_squares(np.column_stack([design, bend]) * weight[:, None], waves * weight)
        others = max(less / (2 * (spare - 1)), least, 1e-300)
        chance = (1.0 + max(misfit - less, 0.0) / others / (2 * (spare - 1))) ** -(spare - 1.0)
        bent = bent or chance < FLAGGED
        if chance < WIDENED:
            moved = np.abs(value - curved[:-1])
    scale, factor = math.sqrt(variance), disc_factor(freedom)
    parts = tuple(
        WavePart(
            value=complex(v),
            deviation=float(d * scale + far / factor),
            radius=float(d * scale * factor + far),
            freedom=freedom,
        )
        for v, d, far in zip(value, spread, moved, strict=True)
    )
    return WaveFit(parts=parts, noise=scale * math.sqrt(float(np.mean(1.0 / weight**2))), bent=bent)


def _least_squares(design: Array, waves: Waves) -> tuple[Waves, Array, float]:
    """Parts, their deviations for noise of 1, and the sum of the squared residuals."""
    columns = np.abs(design).max(axis=0)  # torque and constant are many powers of ten apart
    basis, triangle = np.linalg.qr(design / columns)
    inverse = np.linalg.pinv(triangle) / columns[:, None]
    value = inverse @ (basis.T @ waves)
    left = waves - design @ value
    return value, np.linalg.norm(inverse, axis=1), float(np.vdot(left, left).real)


@dataclass(frozen=True, kw_only=True, eq=False)
class DirectionLaw:
    """One order in one direction of motion.

    Attributes
    ----------
    direction : float
        +1 forward, -1 reverse.
    cases : int
        How many hold the order.
    constant : WavePart
        rad; at no load where `slope` is told, else the mean over the torques; at the reference speed and temperature.
    slope : WavePart or None
        rad per N*mm of the size of the torque; None below three torques.
    temperature : WavePart or None
        rad per K.
    speed : WavePart or None
        rad per rad/s of input speed.
    not_determined : tuple of str
        What the cases do not determine, and why.
    bent : bool
        Whether the straight law does not hold: the misfit is larger than the noise, or light loads bend it.
    noise : float
        Standard deviation of real and imaginary part of a case that the discs stand on, rad.
    torque : ndarray, shape (n,)
        the size of the torque of the cases that the law was read from, N*mm, growing; NaN where not known.
    waves : ndarray of complex, shape (n,)
        Their waves, rad.
    """

    direction: float
    cases: int
    constant: WavePart
    slope: WavePart | None
    temperature: WavePart | None
    speed: WavePart | None
    not_determined: tuple[str, ...]
    bent: bool
    noise: float
    torque: Array
    waves: Waves

    not_told = former_name("not_told", "not_determined")


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


def both_ways(forward: WavePart, reverse: WavePart) -> BothWays:
    """Compare a part of the forward with that of the reverse motion.

    Parameters
    ----------
    forward, reverse : WavePart
    """
    deviation = math.hypot(forward.deviation, reverse.deviation)
    freedom = min(forward.freedom, reverse.freedom)
    radius = deviation * disc_factor(freedom)

    def half(value: complex) -> WavePart:
        return WavePart(value=value / 2, deviation=deviation / 2, radius=radius / 2, freedom=freedom)

    common, different = half(forward.value + reverse.value), half(forward.value - reverse.value)
    relation = None
    if common.significant and different.significant:
        sizes = abs(forward.amplitude - reverse.amplitude) <= radius and forward.significant and reverse.significant
        relation = "mirrored" if sizes else "different"
    elif common.significant or different.significant:
        relation = "alike" if common.significant else "opposite"
    return BothWays(common=common, different=different, relation=relation)
