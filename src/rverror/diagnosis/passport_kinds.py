"""Which kinds of causes can make an order depend on load, direction, speed and temperature as it does: rules in words.

Every sentence says what can be, not what is: other causes leave the same, and the orders alone do not tell them apart.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rverror.diagnosis.wave_fit import BothWays, DirectionLaw, WavePart

#: Share of an order's amplitude below which a part is not named: in quadrature it is a two-hundredth of the size.
NAMED = 0.1
#: Directions that differ by less than this share of what they have in common have one cause in the main.
MOSTLY = 1.0 / 3.0

_RIGID = "errors of form, pitch or position of parts"
_SIDES = "rigid part errors on contacts that change with the direction (drive and coast side), or play that parts cross"
_COMPLIANCE = "can be compliance: stiffness that varies over the angle"
_GROWS = {
    None: f": {_COMPLIANCE}",
    "opposite": f", with opposite sign in the other direction: {_COMPLIANCE} and is the same for both senses of the "
    "torque",
    "alike": ", alike in both directions: can be a deflection that does not turn with the torque, such as load that "
    "moves from contact to contact, or contacts of both sides whose stiffness varies half a wave apart",
    "mirrored": f", by the same amount in both directions with another phase: {_COMPLIANCE}, such as that of "
    "contacts on the drive side and of their counterparts on the coast side",
    "different": f", not alike in both directions: {_COMPLIANCE} and differs between drive and coast side",
}
_CHANGES = {
    "speed": "a natural frequency near or beyond the speeds run, or friction",
    "temperature": "fits, play and preload that change as parts warm",
}


def kinds_of(
    laws: Sequence[DirectionLaw],
    constants: BothWays | None,
    loads: BothWays | None,
    *,
    amplitude: float,
    spans: Mapping[str, float],
    shaft: str,
) -> tuple[str, ...]:
    """Sentences on the kinds of causes that can leave an order's parts.

    Parameters
    ----------
    laws : sequence of DirectionLaw
    constants, loads : BothWays or None
    amplitude : float
        rad; a part below a tenth of it is not named.
    spans : mapping of str to float
        Range of ``torque``, ``speed`` and ``temperature`` over the cases.
    shaft : str
        Shaft whose turn or half turn the order is; empty where none.
    """

    def shows(parts: Sequence[WavePart | None], span: float = 1.0) -> bool:
        return any(
            part is not None and part.significant and part.amplitude * span >= NAMED * amplitude for part in parts
        )

    found = []
    chain = f"the measuring chain (how the {shaft}'s encoder or coupling sits) or " if shaft else ""
    head = "constant over the load" if all(law.slope for law in laws) else "constant in part, as far as the loads tell"
    if constants is None:
        if shows([law.constant for law in laws]):
            one = "(only one direction is known, or no condition is known in both)"
            found.append(f"{head} {one}: can be {chain}{_RIGID}, alike in both directions or not")
    elif constants.different.amplitude <= MOSTLY * constants.common.amplitude or constants.relation == "alike":
        if shows([constants.common]):
            found.append(f"{head} and alike in both directions: can be {chain}{_RIGID}")
    elif shows([constants.different]):
        found.append(f"{head}, but not alike in both directions: can be {_SIDES}")
    if shows([law.slope for law in laws], spans["torque"]):
        found.append(f"grows with the load{_GROWS[None if loads is None else loads.relation]}")
    for name, cause in _CHANGES.items():
        if shows([getattr(law, name) for law in laws], spans[name]):
            found.append(f"changes with the {name}: can be {cause}")
    if not found:
        found.append("no part of it is significant against the noise")
    return (*found, *sorted({note for law in laws for note in law.not_determined}))
