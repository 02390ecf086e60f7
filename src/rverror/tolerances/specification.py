"""What a reducer must hold at the load: limits of transmission error, lost motion, backlash and stiffness."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from rverror.base import units
from rverror.base.errors import InputError, check_each, check_kind
from rverror.base.numbers import brief
from rverror.geartrain.mechanism import Mechanism, Reducer, doubt_torque
from rverror.geartrain.torque_over_turn import TorqueLaw, peak_torque
from rverror.tolerances.sampling import check_share

#: Dimension of each quantity that can be limited.
QUANTITIES: Mapping[str, str] = {
    "transmission_error": "angle",
    "lost_motion": "angle",
    "backlash": "angle",
    "stiffness": "torsional_stiffness",
}
#: Torque of the makers' lost motion, and those between which they read the stiffness, of the rated one.
LOST_MOTION, STIFFNESS = 0.03, (0.5, 1.0)
#: Torque of a test bench, N*mm: light, so that contacts open.
BENCH_TORQUE = 20e3
#: Share of the units that must be within a limit, where none is said.
LEVEL = 0.99


@dataclass(frozen=True)
class Limit:
    """A limit of one quantity that a share of all units must meet.

    Attributes
    ----------
    quantity : str
        ``"transmission_error"``: its peak-to-peak over a turn.  ``"lost_motion"``: the output's turn between a small
        torque in one sense and the same in the other, input held, the largest over a turn.  ``"backlash"``: the same
        between vanishing torques.  ``"stiffness"``: torque over turn of the loaded branches, the least
        over a turn.
    value : float or None
        The largest angle, rad; of the stiffness the least one, N*mm/rad.  None asks for the distribution alone.
    torque : float or callable, optional
        N*mm: the load of the transmission error, the small torque of the lost motion, the upper end of the branch
        from which the stiffness is read.  The makers' where left out: the rated torque, 3 % of it for the lost motion.
        Of the transmission error also a function of the output angle, signed as in `equilibrium`.
    level : float
        Share of the units.

    Raises
    ------
    InputError
        If the quantity is none of these, or a number is out of its bounds.
    """

    quantity: str
    value: float | None
    torque: float | TorqueLaw | None = None
    level: float = LEVEL

    def __post_init__(self) -> None:
        """Check the numbers."""
        if self.quantity not in QUANTITIES:
            raise InputError(f"quantity = {self.quantity!r}: must be one of {', '.join(map(repr, QUANTITIES))}")
        if self.value is not None and not 0 < self.value < math.inf:
            raise InputError(f"{self.quantity}: limit = {self.value:g}: must be above 0")
        if callable(self.torque) and self.quantity != "transmission_error":
            raise InputError(f"{self.quantity}: is read at each angle under one torque; give a number such as '20 N*m'")
        if self.torque is not None and not 0 < self.largest < math.inf:
            raise InputError(f"{self.quantity}: torque = {self.largest / 1e3:g} N*m: must be above 0")
        if self.quantity == "backlash" and self.torque is not None:
            raise InputError("backlash: is read without a torque; leave torque out, or limit the lost motion")
        check_share("level", self.level, LEVEL)

    def at(self, mechanism: Mechanism) -> Limit:
        """The same with the torque that it is read at."""
        if not isinstance(mechanism, Reducer):
            raise InputError(f"{self.name}: a [drive] has no contacts to be loaded; leave the load out")
        if not callable(self.torque):
            doubt_torque(mechanism, self.torque)
        if self.torque is not None or self.quantity == "backlash":
            return self
        if mechanism.rated_torque is None:
            raise InputError(
                f"{self.name}: at which torque? reducer {mechanism.name!r} has no rated_torque; give it, or a torque"
            )
        share = LOST_MOTION if self.quantity == "lost_motion" else 1.0
        return replace(self, torque=share * mechanism.rated_torque)

    @property
    def name(self) -> str:
        """The quantity for people."""
        return self.quantity.replace("_", " ")

    @property
    def label(self) -> str:
        """Quantity and torque for people."""
        return self.name if self.torque is None else f"{self.name} at {self.load()}"

    @property
    def largest(self) -> float:
        """Torque where it is largest, N*mm; 0 of none."""
        return peak_torque(self.torque) if callable(self.torque) else self.torque or 0.0

    def load(self, digits: int = 4) -> str:
        """Torque for people."""
        return f"{brief(self.largest / 1e3, digits)} N*m{' arm' if callable(self.torque) else ''}"

    @property
    def unit(self) -> str:
        """Unit in which people read the value."""
        return "N*m/arcmin" if self.quantity == "stiffness" else "arcsec"

    @property
    def loads(self) -> tuple[tuple[float, float], ...]:
        """Torques on the output, signed, and weights of the turns under them whose sum is limited; none of a span."""
        torque = self.largest
        if self.quantity == "transmission_error":
            return ()
        if self.quantity == "stiffness":
            inner = torque * STIFFNESS[0] / STIFFNESS[1]
            return (torque, 1.0), (-torque, -1.0), (inner, -1.0), (-inner, 1.0)
        return (torque, 1.0), (-torque, -1.0)

    @property
    def allowed(self) -> float:
        """Largest turn that is within the limit, rad."""
        return math.inf if self.value is None else float(self.turned(self.value))

    def turned(self, value: Any) -> Any:
        """Turn of the output, rad, that is a value of the quantity; and the value of a turn: its own inverse."""
        if self.quantity != "stiffness":
            return value
        return 2 * self.largest * (1 - STIFFNESS[0] / STIFFNESS[1]) / value

    def shown(self, value: Any) -> Any:
        """Value in the unit that people read."""
        if self.quantity == "stiffness":
            return value * 60 * units.ARCSEC / 1e3
        return value / units.ARCSEC


def limit(quantity: str, value: Any = None, *, torque: Any | None = None, level: float = LEVEL) -> Limit:
    """Make a limit from texts with units, quantities or plain numbers in core units.

    Parameters
    ----------
    quantity : str
        As in `Limit`.
    value : float, str, quantity or None
        rad, N*mm/rad, or with a unit, such as ``"60 arcsec"`` or ``"100 N*m/arcmin"``.
    torque : float, str, quantity or callable, optional
        N*mm, or with a unit; or a function of the output angle such as a `GravityArm`, or
        ``lambda theta: numpy.interp(theta, angles, torques, period=2 * numpy.pi)`` of an array.
    level : float
        Share of the units.

    Returns
    -------
    Limit

    Raises
    ------
    InputError
        If a value has the wrong unit or is out of its bounds.

    Notes
    -----
    A plain number for a torque is N*mm; one that can only be meant in N*m is doubted where the limit meets its reducer.

    Examples
    --------
    >>> limit("lost_motion", "60 arcsec").label
    'lost motion'
    """
    check_kind("quantity", quantity, str, f"give one of {', '.join(map(repr, QUANTITIES))}")
    size = None if value is None else units.named_core(quantity, value, QUANTITIES.get(quantity, "angle"))
    if torque is None or callable(torque):
        return Limit(quantity, size, torque, level)
    load = units.named_core("torque", torque, "torque")
    if not isinstance(torque, (int, float)):
        load = units.InCore(load)  # it has a unit: nobody doubts it
    return Limit(quantity, size, load, level)


def check_limits(limits: Sequence[Limit], mechanism: Mechanism) -> tuple[Limit, ...]:
    """Limits of a mechanism with the torques that they are read at.

    Raises
    ------
    InputError
        If there is none, one is given twice, or the mechanism has no contacts.
    """
    check_each("limits", limits, Limit, "give a list such as [limit('transmission_error', '60 arcsec')]")
    if not limits:
        raise InputError("limits: there is none; give one, such as limit('transmission_error', '60 arcsec')")
    found = tuple(one.at(mechanism) for one in limits)
    for number, one in enumerate(found):
        if any((one.quantity, one.torque) == (other.quantity, other.torque) for other in found[:number]):
            raise InputError(f"limits: {one.label} is limited twice; say it once")
    return found
