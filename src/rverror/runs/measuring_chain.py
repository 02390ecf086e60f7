"""What a bench itself leaves uncertain of a measured transmission error, put together as the GUM does."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from rverror.base import units

#: Limits within which any value is as likely as another: half-width over standard deviation.
_EVEN = math.sqrt(3)
#: Amplitude of a sine of unknown phase over its standard deviation.
_SINE = math.sqrt(2)


@dataclass(frozen=True, kw_only=True)
class UncertaintyPart:
    """One part of a bench's uncertainty.

    Attributes
    ----------
    name : str
    limit : float
        How far it may move a reading of the error, rad; one standard deviation of noise.
    distribution : str
        ``"even"`` between the limits, ``"sine"`` of unknown phase, ``"normal"``.
    standard : float
        Standard uncertainty, rad.
    """

    name: str
    limit: float
    distribution: str
    standard: float


@dataclass(frozen=True, kw_only=True)
class BenchUncertainty:
    """Budget of a bench.

    Attributes
    ----------
    parts : tuple of UncertaintyPart
        The largest first.
    """

    parts: tuple[UncertaintyPart, ...]

    @property
    def standard(self) -> float:
        """Combined standard uncertainty of the error at one angle, rad."""
        return math.hypot(*(one.standard for one in self.parts))

    @property
    def expanded(self) -> float:
        """Half of the 95 % interval of the error at one angle, rad: 1.96 times the standard uncertainty."""
        return 1.96 * self.standard

    @property
    def expanded_difference(self) -> float:
        """The same of a difference of two readings far from each other, such as a peak-to-peak, rad."""
        return math.sqrt(2) * self.expanded


def bench_uncertainty(
    ratio: float,
    *,
    output_encoder: Any = 0.0,
    input_encoder: Any = 0.0,
    output_counts: int | None = None,
    input_counts: int | None = None,
    coupling_runout: Any = 0.0,
    coupling_radius: Any | None = None,
    noise: Any = 0.0,
    revolutions: int = 1,
) -> BenchUncertainty:
    r"""Uncertainty that the parts of a bench leave in a measured transmission error.

    .. math:: u^2 = \frac{a_o^2}{3} + \frac{a_i^2}{3 R^2} + \frac{(\varphi^2/4)^2}{2} + \frac{q_o^2}{12}
              + \frac{q_i^2}{12 R^2} + \frac{s^2}{n}

    Parameters
    ----------
    ratio : float
        R, input turns per output turn.
    output_encoder, input_encoder : float or quantity
        Accuracy that the maker states, plus or minus, rad.
    output_counts, input_counts : int, optional
        Counts a turn, by which readings are rounded; none where left out.
    coupling_runout, coupling_radius : float or quantity
        Axial runout of the output encoder's coupling, plus or minus, at that radius, mm.  It tilts by phi, runout over
        radius, and turns the encoder as a universal joint does, by phi^2/4 twice a turn: the most a coupling does.
    noise : float or quantity
        Standard deviation of the noise, rad.
    revolutions : int
        Turns over which the error is averaged.

    Returns
    -------
    BenchUncertainty

    Raises
    ------
    ValueError
        If the ratio is 0, a value is below 0, counts or revolutions below 1, or a runout has no radius.

    Notes
    -----
    JCGM 100:2008 (GUM), sections 4.3.7 and 5.1.2.  Source 004 prints +-0.39 and +-1.24 arcsec for its encoders and
    +-0.1 mm for its couplings.

    Examples
    --------
    >>> found = bench_uncertainty(121, output_encoder="1.24 arcsec", input_encoder="0.39 arcsec")
    >>> round(found.expanded / units.ARCSEC, 2)
    1.4
    """
    if not (math.isfinite(ratio) and ratio):
        raise ValueError(f"ratio = {ratio:g}: must be a number other than 0, input turns per output turn")
    given = {"output_encoder": output_encoder, "input_encoder": input_encoder, "noise": noise}
    size = {name: units.named_core(name, value, "angle") for name, value in given.items()}
    runout = units.named_core("coupling_runout", coupling_runout, "length")
    radius = math.inf if coupling_radius is None else units.named_core("coupling_radius", coupling_radius, "length")
    for name, value in {**size, "coupling_runout": runout}.items():
        if not value >= 0:
            raise ValueError(f"{name} = {value:g}: must be 0 or more; it stands for plus or minus")
    for name, count in {
        "output_counts": output_counts,
        "input_counts": input_counts,
        "revolutions": revolutions,
    }.items():
        if count is not None and not count >= 1:
            raise ValueError(f"{name} = {count}: must be 1 or more")
    if runout and not radius < math.inf:
        raise ValueError("coupling_runout has no coupling_radius, at which it was read; give both")
    if not radius > 0:
        raise ValueError(f"coupling_radius = {radius:g} mm: must be above 0")
    rounding = {
        "output counts": math.pi / output_counts if output_counts else 0.0,
        "input counts": math.pi / input_counts / abs(ratio) if input_counts else 0.0,
    }
    listed = [
        ("output encoder", size["output_encoder"], "even", _EVEN),
        ("input encoder", size["input_encoder"] / abs(ratio), "even", _EVEN),
        ("coupling", (runout / radius) ** 2 / 4, "sine", _SINE),
        *((name, half, "even", _EVEN) for name, half in rounding.items()),
        ("noise", size["noise"] / math.sqrt(revolutions), "normal", 1.0),
    ]
    made = (
        UncertaintyPart(name=name, limit=limit, distribution=kind, standard=limit / share)
        for name, limit, kind, share in listed
        if limit
    )
    return BenchUncertainty(parts=tuple(sorted(made, key=lambda one: -one.standard)))
