"""Which kinds of causes can make an order depend on load, direction, speed and temperature as it does: rules in words.

Every sentence says what can be, not what is: other causes leave the same, and the orders alone do not tell them apart.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from rverror.base.numbers import brief
from rverror.base.units import ARCSEC
from rverror.diagnosis.wave_fit import BothWays, WavePart

#: Share of an order's amplitude below which a part is not named: in quadrature it is a two-hundredth of the size.
NAMED = 0.1
#: Directions that differ by less than this share of what they have in common have one cause in the main.
MOSTLY = 1.0 / 3.0

RIGID = "errors of form, pitch or position of parts"
_SIDES = "rigid part errors on contacts that change with the direction (drive and coast side), or play that parts cross"
_LIKE_LOAD = (
    "a deflection that does not turn with the torque, such as load that moves from contact to contact, or contacts of "
    "both sides whose stiffness varies half a wave apart"
)
_MIRRORED = "the stiffness of contacts of the drive side, and of their like on the coast side, varying over the angle"


def kinds_of(
    order: float,
    *,
    amplitude: float,
    constants: Sequence[WavePart],
    slopes: Sequence[WavePart | None],
    temperatures: Sequence[WavePart | None],
    speeds: Sequence[WavePart | None],
    both_constants: BothWays | None,
    both_loads: BothWays | None,
    spans: Mapping[str, float],
    settings: Mapping[str, int],
    largest_torque: float,
    peak_frequency: float | None,
    peaked: bool,
    ratio: float | None,
    mixed: Sequence[str],
) -> tuple[str, ...]:
    """Sentences on the kinds of causes that can leave an order's parts.

    Parameters
    ----------
    order : float
    amplitude : float
        rad; a part below a tenth of it is not named.
    constants, slopes, temperatures, speeds : sequence of WavePart or None
        Of each direction.
    both_constants, both_loads : BothWays or None
    spans : mapping of str to float
        Range of ``speed`` and ``temperature`` over the cases.
    settings : mapping of str to int
        How many settings of each there are.
    largest_torque : float
        N*mm.
    peak_frequency : float or None
        Hz.
    peaked : bool
        Whether the order peaks over the input speed.
    ratio : float or None
        Input turns per output turn.
    mixed : sequence of str
        What the cases do not tell apart.

    Returns
    -------
    tuple of str
    """
    floor = NAMED * amplitude
    loaded = all(slope is not None for slope in slopes)
    found = _constant(order, constants, both_constants, floor=floor, loaded=loaded, ratio=ratio)
    found += _load([s for s in slopes if s is not None], both_loads, largest_torque, floor)
    if peaked:
        at = "" if peak_frequency is None else f" near {brief(peak_frequency, 3)} Hz"
        found.append(f"peaks over the speed: can be a natural frequency{at} of the drive or of the bench")
    elif _grows(speeds, spans["speed"], floor):
        cause = "a natural frequency near or beyond the speeds run, or friction"
        found.append(f"changes with the speed: can be {cause}{_two_only(settings['speed'])}")
    if _grows(temperatures, spans["temperature"], floor):
        cause = "fits, play and preload that change as parts warm"
        found.append(f"changes with the temperature: can be {cause}{_two_only(settings['temperature'])}")
    if not found:
        found.append("no part of it is told from the noise")
    return (*found, *mixed)


def _grows(parts: Sequence[WavePart | None], span: float, floor: float) -> bool:
    return any(part is not None and part.told and part.amplitude * span >= floor for part in parts)


def _two_only(settings: int) -> str:
    """A difference of two is a law of nothing: it may be what one fitting of the unit differs from the next."""
    return "" if settings > 2 else "; of two settings only, so it can be anything that changed from one to the other"


def _chain(order: float, ratio: float | None) -> str:
    """Shaft whose turn or half turn the order is, as the measuring chain knows it; empty where none."""
    if abs(order - 1) < 1e-6 or abs(order - 2) < 1e-6:
        return "output"
    if ratio is not None and any(abs(order - k * ratio) < 1e-6 * order for k in (1, 2)):
        return "input"
    return ""


def _constant(
    order: float,
    constants: Sequence[WavePart],
    both: BothWays | None,
    *,
    floor: float,
    loaded: bool,
    ratio: float | None,
) -> list[str]:
    shaft = _chain(order, ratio)
    chain = f"the measuring chain (how the {shaft}'s encoder or coupling sits) or " if shaft else ""
    head = "constant over the load" if loaded else "constant in part, as far as the loads tell"
    if both is None:
        if not any(part.told and part.amplitude >= floor for part in constants):
            return []
        one = " (one direction known, or no like conditions)"
        return [f"{head}{one}: can be {chain}{RIGID}, alike in both directions or not"]
    common, different = both.common, both.different
    found = []
    alike = both.relation == "alike" or different.amplitude <= MOSTLY * common.amplitude
    if alike and common.told and common.amplitude >= floor:
        size = _arcsec(2 * different.amplitude)
        how = (
            f"mostly alike in both directions (they differ by {size} arcsec)"
            if different.told
            else "alike in both directions"
        )
        found.append(f"{head} and {how}: can be {chain}{RIGID}")
    if different.told and different.amplitude >= floor and not alike:
        found.append(f"{head}, but not alike in both directions: can be {_SIDES}")
    return found


def _load(slopes: Sequence[WavePart], both: BothWays | None, torque: float, floor: float) -> list[str]:
    if not any(slope.told and slope.amplitude * torque >= floor for slope in slopes):
        return []
    head = "grows with the load"
    compliance = "can be compliance: stiffness that varies over the angle"
    if both is None or both.relation is None:
        return [f"{head}: {compliance}"]
    ends = {
        "opposite": f"{head}, with opposite sign in the other direction: {compliance} and is the same for both senses "
        "of the torque",
        "alike": f"{head}, alike in both directions: can be {_LIKE_LOAD}",  # one compliance for both senses is opposite
        "mirrored": f"{head}, by as much in both directions and with another phase: {compliance}; can be {_MIRRORED}",
        "different": f"{head}, not alike in both directions: {compliance} and differs between drive and coast side",
    }
    return [ends[both.relation]]


def _arcsec(value: float) -> str:
    return brief(value / ARCSEC, 2) if math.isfinite(value) else "?"
