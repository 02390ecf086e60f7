"""What a bench itself leaves uncertain of measured figures, put together as the GUM does."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

from rverror.model.ends import Encoders

#: Coverage factor of every expanded uncertainty: 95 % of what is normal.
COVERAGE = 2.0
#: Half-width over standard deviation: between limits any value is as likely as another; a sine of unknown phase.
_DIVISORS = {"even": math.sqrt(3), "sine": math.sqrt(2)}

Figure = Literal["reading", "peak_to_peak", "rms", "amplitude"]
#: The most a reading error within plus or minus 1 makes of each figure: any curve, and a wave.
_MOST: Mapping[str, Mapping[str, float]] = {
    "reading": {"even": 1.0, "sine": 1.0},
    "peak_to_peak": {"even": 2.0, "sine": 2.0},
    "rms": {"even": 1.0, "sine": math.sqrt(0.5)},
    "amplitude": {"even": 4 / math.pi, "sine": 1.0},
}
#: How near an order is to one that a part of the bench can have: as near as a line is placed.
_NEAR = 0.05


@dataclass(frozen=True, kw_only=True)
class UncertaintyPart:
    """One part of a bench's uncertainty.

    Attributes
    ----------
    name : str
    limit : float
        How far it may move a figure, rad.
    distribution : str
        ``"even"`` between the limits, or ``"sine"`` of unknown phase.
    order : float
        The order per output turn that a wave has, or of which the orders of a curve are whole multiples: a shaft's
        reading repeats with that shaft.
    """

    name: str
    limit: float
    distribution: str
    order: float

    @property
    def divisor(self) -> float:
        """Limit over standard uncertainty."""
        return _DIVISORS[self.distribution]

    @property
    def standard(self) -> float:
        """Standard uncertainty, rad."""
        return self.limit / self.divisor

    def reaches(self, order: float) -> bool:
        """Whether the part can have an order."""
        times = max(round(order / self.order), 1) if self.distribution == "even" else 1
        return abs(order - times * self.order) <= _NEAR


@dataclass(frozen=True, kw_only=True)
class BenchUncertainty:
    """Budget of a bench.

    Attributes
    ----------
    parts : tuple of UncertaintyPart
        For the error at one angle; the largest first.
    """

    parts: tuple[UncertaintyPart, ...]

    def of(self, figure: Figure) -> float:
        """Expanded uncertainty, k = 2, of a figure, rad: half of its 95 % interval; a reading is of one angle.

        Parameters
        ----------
        figure : {"reading", "peak_to_peak", "rms", "amplitude"}

        Returns
        -------
        float
        """
        return _expanded(self.budget(figure))

    def of_order(self, order: float) -> float:
        """Expanded uncertainty, k = 2, of the amplitude of an order, rad.

        Parameters
        ----------
        order : float
            Per output turn.

        Returns
        -------
        float
            0 where no part of the bench can have the order.
        """
        return _expanded(one for one in self.budget("amplitude") if one.reaches(order))

    def budget(self, figure: Figure) -> tuple[UncertaintyPart, ...]:
        """Parts for a figure: the most that each makes of it, with the standard uncertainty of that.

        Parameters
        ----------
        figure : {"reading", "peak_to_peak", "rms", "amplitude"}

        Returns
        -------
        tuple of UncertaintyPart
        """
        return tuple(replace(one, limit=one.limit * _MOST[figure][one.distribution]) for one in self.parts)


def _expanded(parts: Iterable[UncertaintyPart]) -> float:
    return COVERAGE * math.hypot(*(one.standard for one in parts))


def bench_uncertainty(ratio: float, **encoders: Any) -> BenchUncertainty:
    r"""Uncertainty that the parts of a bench leave in a measured transmission error.

    .. math:: u^2 = \frac{a_o^2}{3} + \frac{a_i^2}{3 R^2} + \frac{(\varphi^2/4)^2}{2} + \frac{q_o^2}{12}
              + \frac{q_i^2}{12 R^2}

    Parameters
    ----------
    ratio : float
        R, input turns per output turn.
    **encoders : float or quantity
        As `rverror.model.Encoders` takes them: accuracy and counts of each encoder, runout and radius of the coupling.
        The runout tilts the coupling by phi, runout over radius, and turns the encoder as a universal joint does, by
        phi^2/4 twice a turn.

    Returns
    -------
    BenchUncertainty

    Raises
    ------
    ValueError
        If the ratio is 0, or as for `Encoders`.

    Notes
    -----
    JCGM 100:2008 (GUM), sections 4.3.7, 5.1.2 and 6.3.3.  Source 004 prints +-0.39 and +-1.24 arcsec for its encoders
    and +-0.1 mm for its couplings.

    Examples
    --------
    >>> from rverror.base.units import ARCSEC
    >>> found = bench_uncertainty(121, output_encoder="1.24 arcsec", input_encoder="0.39 arcsec")
    >>> round(found.of("reading") / ARCSEC, 2), round(found.of("peak_to_peak") / ARCSEC, 2)
    (1.43, 2.86)
    >>> round(found.of_order(1) / ARCSEC, 2), found.of_order(11.3)
    (1.82, 0.0)
    """
    return uncertainty_of(Encoders(**encoders), ratio) or BenchUncertainty(parts=())


def uncertainty_of(encoders: Encoders, ratio: float) -> BenchUncertainty | None:
    """What stated encoders and their coupling leave uncertain.

    Parameters
    ----------
    encoders : Encoders
        As a model file states them.
    ratio : float
        Input turns per output turn.

    Returns
    -------
    BenchUncertainty or None
        None where nothing is stated.

    Raises
    ------
    ValueError
        If the ratio is 0.

    Examples
    --------
    >>> uncertainty_of(Encoders(), 121) is None
    True
    """
    if not (math.isfinite(ratio) and ratio):
        raise ValueError(f"ratio = {ratio:g}: must be a number other than 0, input turns per output turn")
    turns = abs(ratio)
    counts = encoders.output_counts or math.inf, encoders.input_counts or math.inf
    tilt = encoders.coupling_runout / (encoders.coupling_radius or math.inf)
    listed = (
        UncertaintyPart(name="output encoder", limit=encoders.output_encoder, distribution="even", order=1.0),
        UncertaintyPart(name="input encoder", limit=encoders.input_encoder / turns, distribution="even", order=turns),
        UncertaintyPart(name="coupling", limit=tilt**2 / 4, distribution="sine", order=2.0),
        UncertaintyPart(name="output counts", limit=math.pi / counts[0], distribution="even", order=1.0),
        UncertaintyPart(name="input counts", limit=math.pi / counts[1] / turns, distribution="even", order=turns),
    )
    parts = sorted((one for one in listed if one.limit), key=lambda one: -one.standard)
    return BenchUncertainty(parts=tuple(parts)) if parts else None
