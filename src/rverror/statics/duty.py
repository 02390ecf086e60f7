r"""Duties of several phases: efficiency of a whole cycle, and the temperature at which it gives off what it loses.

A unit whose losses P leave through the thermal resistance R_th stands at

.. math:: T = T_{ambient} + R_{th}\, P(T),

and P falls as the oil grows thin: one temperature alone solves it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import scipy

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.numbers import with_unit
from rverror.base.quantities import Checked, NumberField, above_zero, quantity
from rverror.base.viewed import OneLine
from rverror.geartrain.mechanism import Friction, doubt_torque
from rverror.geartrain.thermal import GROWTH
from rverror.model.effects import Effect, Model, check_model, effect
from rverror.statics.friction import Efficiency, declared_friction, efficiency

_PALMGREN = 2 / 3  # power of viscosity times speed by which a rolling bearing's drag grows
_WALTHER = 0.7  # mm^2/s
_REFERENCE = (313.15, 373.15)  # kelvin, at which makers of lubricants print the viscosity


@dataclass(frozen=True, kw_only=True)
class DutyPhase(Checked):
    """One phase of a duty cycle.

    Parameters
    ----------
    torque : float or quantity
        Size of the output torque, N*mm; 0 where nothing is carried.
    speed : float or quantity
        Size of the input speed, rad/s; 0 where it stands.
    hours : float
        How long it lasts in a cycle; only the shares of the phases count.

    Raises
    ------
    ValueError
        If torque or speed is below 0, or the hours are not above.

    Examples
    --------
    >>> DutyPhase(torque="412 N*m", speed="1815 rpm", hours=3).torque
    412000.0
    """

    torque: float = field(metadata=quantity("torque", least=0.0))
    speed: float = field(metadata=quantity("angular_speed", least=0.0))
    hours: float = field(default=1.0, metadata=quantity("number", above=0.0))

    def __post_init__(self) -> None:
        """Convert to core units and check."""
        given = self.torque
        super().__post_init__()
        if not isinstance(given, (int, float)):  # a plain number may still be doubted
            object.__setattr__(self, "torque", units.InCore(self.torque))


def duty_words(duty: Sequence[DutyPhase]) -> str:
    """A duty as a person reads it; the hours where there are several phases.

    Parameters
    ----------
    duty : sequence of DutyPhase

    Returns
    -------
    str

    Examples
    --------
    >>> duty_words([DutyPhase(torque="412 N*m", speed="1815 rpm")])
    '412 N*m, 1815 rpm at the input'
    """
    said = [f"{with_unit(one.torque, 'torque')}, {with_unit(one.speed, 'angular_speed')} at the input" for one in duty]
    return (
        said[0] if len(duty) == 1 else "; ".join(f"{one}, {at.hours:g} h" for one, at in zip(said, duty, strict=True))
    )


def checked_duty(duty: Any) -> tuple[DutyPhase, ...]:
    """Phases of a duty, one or a sequence.

    Raises
    ------
    ValueError
        If it is neither.
    """
    phases = (duty,) if isinstance(duty, DutyPhase) else tuple(duty) if isinstance(duty, Sequence) else ()
    if not phases or not all(isinstance(one, DutyPhase) for one in phases):
        raise ValueError(f"duty = {duty!r}: give one or several DutyPhase(torque='412 N*m', speed='1815 rpm', hours=3)")
    return phases


@dataclass(frozen=True, kw_only=True)
class Lubricant(Checked):
    """How drag follows temperature and speed: by the viscosity of an oil, or of a grease's base oil.

    Parameters
    ----------
    viscosity_40, viscosity_100 : float or quantity
        Kinematic, at 40 and at 100 degC, mm^2/s, as makers print them.
    temperature : float or quantity
        At which `Friction.drag` counts, kelvin.
    speed : float or quantity
        Of the input, at which it counts, rad/s.
    viscous : float
        Share of the drag that the oil makes there; the rest, of seals, is alike at any temperature and speed.

    Raises
    ------
    ValueError
        If a size is not above 0, the oil does not grow thinner, or the share is not within 0 to 1.

    Notes
    -----
    Walther (ASTM D341): log log (viscosity + 0.7) falls in proportion to the logarithm of the temperature.  Palmgren:
    the viscous torque of a rolling bearing grows with (viscosity times speed)^(2/3).

    Examples
    --------
    >>> oil = Lubricant(viscosity_40="150 cSt", viscosity_100="15 cSt", temperature="20 degC", speed="1815 rpm")
    >>> round(oil.viscosity(313.15)), round(oil.drag(4000.0, temperature=293.15, speed=oil.speed))
    (150, 4000)
    """

    viscosity_40: float = field(metadata=quantity("viscosity", above=0.0))
    viscosity_100: float = field(metadata=quantity("viscosity", above=1 - _WALTHER))
    temperature: float = field(metadata=quantity("temperature", above=0.0))
    speed: float = field(metadata=quantity("angular_speed", above=0.0))
    viscous: float = field(default=1.0, metadata=quantity("number", least=0.0, most=1.0, remedy=", a share"))

    def __post_init__(self) -> None:
        """Convert to core units and check."""
        super().__post_init__()
        if not self.viscosity_40 > self.viscosity_100:
            raise ValueError(
                f"viscosity_100 = {self.viscosity_100:g} mm^2/s: must be below viscosity_40 = "
                f"{self.viscosity_40:g} mm^2/s"
            )

    def viscosity(self, temperature: float) -> float:
        """Kinematic viscosity at a temperature in kelvin, mm^2/s."""
        thick = [math.log(math.log(one + _WALTHER)) for one in (self.viscosity_40, self.viscosity_100)]
        first, last = map(math.log, _REFERENCE)
        slope = (thick[0] - thick[1]) / (last - first)
        return math.exp(math.exp(thick[0] - slope * (math.log(temperature) - first))) - _WALTHER

    def drag(self, drag: float, *, temperature: float, speed: float) -> float:
        """What a drag becomes at another temperature in kelvin and another input speed in rad/s."""
        thinner = self.viscosity(temperature) * speed / (self.viscosity(self.temperature) * self.speed)
        return drag * float(1 - self.viscous + self.viscous * thinner**_PALMGREN)


@dataclass(frozen=True, kw_only=True)
class DutyEfficiency(OneLine):
    """What a reducer loses over a duty cycle, and how warm it is then.

    Attributes
    ----------
    duty : tuple of DutyPhase
    phases : tuple of Efficiency
        Of each phase, at its drag.
    ambient, housing, inside : float
        Temperature of the surroundings, of the housing, and of what is in it with the oil, kelvin.
    """

    duty: tuple[DutyPhase, ...]
    phases: tuple[Efficiency, ...]
    ambient: float
    housing: float
    inside: float

    @property
    def _speeds(self) -> Array:
        """Speed of the output in each phase, rad/s, times the phase's share of the hours."""
        hours = np.array([one.hours for one in self.duty])
        turning = np.array([one.speed / abs(at.ratio) for one, at in zip(self.duty, self.phases, strict=True)])
        return np.asarray(hours / hours.sum() * turning)

    @property
    def power(self) -> tuple[float, float]:
        """What comes out and what goes in, in the mean over the cycle, N*mm/s."""
        out, into = self._speeds @ [[side.mean() for side in one.out_and_in()] for one in self.phases]
        return float(out), float(into)

    @property
    def mean(self) -> float:
        """Energy that comes out over energy that goes in; 0 where none does."""
        out, into = self.power
        return out / into if into else 0.0

    @property
    def losses(self) -> Mapping[str, float]:
        """Mean power that each kind of contact takes, N*mm/s, keyed as `Efficiency.losses`."""
        rows = [[row.mean() for row in one.losses.values()] for one in self.phases]
        return dict(zip(self.phases[0].losses, map(float, self._speeds @ rows), strict=True))

    @property
    def growth(self) -> Effect:
        """Growth of housing and parts by their rise above the surroundings, to add to a model."""
        rise = units.InCore(self.inside - self.ambient)
        inside = dict.fromkeys(("discs", "cranks", "carrier", "gears"), rise)
        return effect(GROWTH, housing=units.InCore(self.housing - self.ambient), **inside, origin="duty")


def duty_efficiency(
    model: Model,
    theta: Any,
    *,
    duty: DutyPhase | Sequence[DutyPhase],
    friction: Friction | None = None,
    direction: Any | None = None,
    drives: str = "input",
    method: str = "equilibrium",
    lubricant: Lubricant | None = None,
    ambient: Any = "20 degC",
    thermal_resistance: Any = 0.0,
    inside_resistance: Any = 0.0,
    temperature: Any | None = None,
) -> DutyEfficiency:
    """Efficiency of a duty cycle, and the steady temperature at which its losses leave.

    Parameters
    ----------
    model : Model
        Of a reducer.
    theta : array_like, str or quantity, shape (n,) or one angle
        Nominal output angle, rad.
    duty : DutyPhase or sequence of DutyPhase
    friction, direction, drives, method
        As `efficiency` takes them.
    lubricant : Lubricant, optional
        How the drag follows temperature and speed; it stays as it is where left out.
    ambient : float or quantity
        Temperature of the surroundings, kelvin.
    thermal_resistance, inside_resistance : float or quantity
        From the housing to the surroundings, and from what is inside to the housing, K s/(N mm); ``"0.3 K/W"``.
    temperature : float or quantity, optional
        Of the whole unit, where it is known: nothing is solved then.

    Returns
    -------
    DutyEfficiency

    Raises
    ------
    ValueError
        As `efficiency`, or if the duty is none or a resistance is below 0.
    NotConvergedError
        As `efficiency`.

    Notes
    -----
    A cycle is short against the time in which the unit warms, so all phases see one temperature.  Losses fall as it
    rises, so the mean loss P lies between 0 and what it is at the ambient temperature, and there is one alone at which
    P(ambient + (R + R_inside) P) = P.  The coefficients of friction themselves do not follow the temperature.

    Examples
    --------
    >>> import numpy as np, rverror
    >>> unit = rverror.Model(rverror.reducer("RV-40E"))
    >>> cycle = [DutyPhase(torque="412 N*m", speed="1815 rpm", hours=1), DutyPhase(torque=0, speed="3000 rpm", hours=2)]
    >>> rubs = Friction(pin=0.05, drag="4 N*m")
    >>> found = duty_efficiency(unit, np.linspace(0, 0.15, 9), duty=cycle, friction=rubs, thermal_resistance="0.3 K/W")
    >>> round(found.mean, 2), round(found.housing - found.ambient)
    (0.9, 7)
    """
    check_model(model)
    phases = checked_duty(duty)
    doubt_torque(model.mechanism, [one.torque for one in phases])
    friction = declared_friction(model) if friction is None else friction
    around = above_zero("ambient", ambient, "temperature")
    resistance = NumberField("thermal_resistance", least=0.0)
    outer = resistance.core("thermal_resistance", thermal_resistance)
    inner = resistance.core("inside_resistance", inside_resistance)

    def at(housing: float, inside: float) -> DutyEfficiency:
        asked: dict[str, Any] = {"direction": direction, "drives": drives, "method": method}
        found = []
        for one in phases:
            drag = lubricant.drag(friction.drag, temperature=inside, speed=one.speed) if lubricant else friction.drag
            rubs, torque = replace(friction, drag=units.InCore(drag)), units.InCore(one.torque)
            found.append(efficiency(model, theta, torque=torque, friction=rubs, **asked))
        return DutyEfficiency(duty=phases, phases=tuple(found), ambient=around, housing=housing, inside=inside)

    def warmed(power: float) -> DutyEfficiency:
        return at(around + outer * power, around + (outer + inner) * power)

    if temperature is not None:
        given = above_zero("temperature", temperature, "temperature")
        return at(given, given)
    most = sum(warmed(0.0).losses.values())
    if lubricant is None or outer + inner == 0:  # they do not follow the temperature
        return warmed(most)
    left = scipy.optimize.brentq(lambda power: sum(warmed(power).losses.values()) - power, 0, most, rtol=1e-10)
    return warmed(float(left))
