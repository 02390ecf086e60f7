r"""Wear of the contacts over operating hours by Archard's law, and what it does to error and lost motion.

A contact under F that slides by s loses the volume k F s from a body whose wear coefficient is k.  A contact that
carries F over a length b and runs over a profile's point at v, sliding at v_s, takes off there, each time it passes,

.. math:: h = k \, \frac{F}{b} \, \frac{v_s}{v} ,

whatever the pressure's half-width is.  On a disc's profile rho is the distance of a pin's centre from the pitch point,
kappa the curvature of the curve that it draws on the disc, and v_s / v = (rho - r) / (rho (1 - kappa r)).

New surfaces are rough.  What stands proud wears faster until it is gone: with x = h / k, pressure times sliding, a
surface whose roughness gives way by d in all and at first wears by the coefficient k_0 has lost

.. math:: h = k x + d \, (1 - \exp(-k_0 x / d)) .

What is worn opens the contact and sheds its load, so the law is integrated in steps, each with the equilibrium of the
unit as it is worn by then.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, NamedTuple

import numpy as np
import scipy

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.directions import Direction, direction_sign
from rverror.base.errors import renamed
from rverror.base.quantities import Checked, above_zero, quantity
from rverror.base.viewed import OneLine, Viewed
from rverror.geartrain.action_line import Contacts
from rverror.geartrain.coupling import BEARING_CLEARANCE as CARRIER_CLEARANCE
from rverror.geartrain.crank import BEARING_CLEARANCE
from rverror.geartrain.cycloid import DISC_PROFILE, LOBE_PROFILE, PIN_RADIUS, roll_angles
from rverror.geartrain.involute import SPLINE_CLEARANCE, TOOTH_THINNING
from rverror.geartrain.kinematics import OperatingConditions, frame_orders, fundamental_orders, true_period
from rverror.geartrain.mechanism import Reducer, doubt_torque
from rverror.model.catalogue import source
from rverror.model.effects import Effect, Model, check_model, effect
from rverror.model.readings import felt
from rverror.model.results import Equilibrium
from rverror.statics.duty import DutyPhase, checked_duty
from rverror.statics.friction import mean_mesh_slip, path_of_contact, pin_slip
from rverror.statics.hertz import pin_contact_radius, pressing, strip_half_width
from rverror.statics.loaded_state import Statics, reducer_of, statics_of
from rverror.statics.rigidity import lost_motion

#: Bodies that wear, as in `WearCoefficients` and `Wear.volume`.
BODIES = ("disc", "pin", "sun", "planet")
#: Joints whose clearance grows.
JOINTS = ("cam_bearing", "carrier_bearing", "spline")
#: How pins stand in the housing.
PINS = ("fixed", "turning")
_WAVES = 16  # on each lobe: 0.2 % rms of the depth, by kinks where a flank begins to carry, are left out
_SLOW_WAVES = 4  # around the disc
_PHASES = 360  # of a pin's mesh with a lobe at which depths are told
_ANGLES = {"turn of the crank": 61, "period": 509}  # primes, so that no order folds onto a low one
_AT_ONCE = 0.25  # depth of a step over the elastic approach: second order leaves 0.25^2 / 6 = 1 % of a contact's share
_MOST_STEPS = 1000
_POINTS = 7  # hours at which a result is told where one number is given
_LOST_AT = 16  # angles over which lost motion is averaged


_ARCHARD = quantity("wear_coefficient", least=0.0)
_GAIN = quantity("contact_compliance", least=0.0)  # of clearance


@dataclass(frozen=True, kw_only=True)
class WearCoefficients(Checked):
    """Archard's wear coefficient of each body: worn volume over force and sliding distance; and what joints gain.

    Parameters
    ----------
    disc, pin, sun, planet : float or quantity
        mm^2/N, which is mm^3/(N mm); a string such as ``"1e-10 mm^3/(N*m)"``.  A body that is left out does not wear.
    cam_bearing, carrier_bearing, spline : float or quantity
        Clearance that the cranks' bearings in the discs, those in the carrier, and the planets' splines gain per newton
        of mean load and turn of the crank against the carrier, mm/N; ``"1e-8 um/kN"``.

    Raises
    ------
    ValueError
        If a value is below 0, or none is above.

    Notes
    -----
    It spans orders of magnitude with lubrication, hardness and load, and no value is assumed.  Archard's dimensionless
    one over the hardness is the same: ``"1e-8 1/GPa"``.

    Examples
    --------
    >>> WearCoefficients(disc="2e-10 mm^3/(N*m)").disc
    2e-13
    """

    disc: float = field(default=0.0, metadata=_ARCHARD)
    pin: float = field(default=0.0, metadata=_ARCHARD)
    sun: float = field(default=0.0, metadata=_ARCHARD)
    planet: float = field(default=0.0, metadata=_ARCHARD)
    cam_bearing: float = field(default=0.0, metadata=_GAIN)
    carrier_bearing: float = field(default=0.0, metadata=_GAIN)
    spline: float = field(default=0.0, metadata=_GAIN)

    def __post_init__(self) -> None:
        """Convert to core units and check."""
        super().__post_init__()
        if not any(getattr(self, name) for name in (*BODIES, *JOINTS)):
            raise ValueError(
                f"no wear coefficient is above 0; give one of {', '.join(BODIES)}, e.g. '1e-10 mm^3/(N*m)'"
            )


@dataclass(frozen=True, kw_only=True)
class RunningIn(Checked):
    """How the roughness of a new body wears off.

    Parameters
    ----------
    depth : float or quantity
        By which its surface gives way until it is run in, mm.
    coefficient : float or quantity
        Archard's of the new surface beyond the lasting one, mm^2/N; it falls with the roughness that is left.

    Raises
    ------
    ValueError
        If a value is not above 0.

    Examples
    --------
    >>> RunningIn(depth="0.5 um", coefficient="1e-8 mm^3/(N*m)").depth
    0.0005
    """

    depth: float = field(metadata=quantity("length", above=0.0))
    coefficient: float = field(metadata=quantity("wear_coefficient", above=0.0))


@dataclass(frozen=True, kw_only=True)
class Wear(Viewed):
    """Wear of a reducer over its hours of operation.

    Attributes
    ----------
    model : Model
        As it was before.
    duty : tuple of DutyPhase
        What it has run through, over and over.
    hours : ndarray, shape (m,)
        Hours of operation.
    peak_to_peak : ndarray, shape (m,)
        Of the gear train's output error under the duty's largest torque, rad; of two directions the larger.
    lost_motion : ndarray, shape (m,)
        rad, mean over a turn; as `lost_motion` has it.
    volume : mapping of str to ndarray, shape (m,)
        Lost by all bodies of a kind, mm^3: ``"disc"``, ``"pin"``, ``"sun"``, ``"planet"``; without what running in
        takes, since the depth of a roughness tells no volume.
    roll_angle : ndarray, shape (q,)
        Where on a lobe, or on a fixed pin: angle by which the eccentric leads the pin that touches there, rad.
    lobe_depth : ndarray, shape (m, q)
        Lost by the discs' lobes along the normal, mm, mean over lobes and discs.
    pin_depth : ndarray, shape (m, q)
        Lost by the pins where a lobe touches them so, mm, mean over pins; alike everywhere where they turn.
    each_pin : ndarray, shape (m, pins)
        Depth of each pin where it carries, less the mean pin's, mm.
    thinning : mapping of str to ndarray, shape (m,)
        Tooth thickness that ``"sun"`` and ``"planet"`` lost on the pitch circle, both flanks together, mm.
    clearance : mapping of str to ndarray, shape (m,)
        What ``"cam_bearing"`` and ``"carrier_bearing"``, in the radius, and ``"spline"`` have gained, mm.
    effects : tuple of Effect
        What wear adds to the model, at the last of the hours.
    sizes : ndarray, shape (m, parameters)
        Values of all parameters of `effects` at each of the hours, core units.
    """

    model: Model
    duty: tuple[DutyPhase, ...]
    hours: Array
    peak_to_peak: Array
    lost_motion: Array
    volume: Mapping[str, Array]
    roll_angle: Array
    lobe_depth: Array
    pin_depth: Array
    each_pin: Array
    thinning: Mapping[str, Array]
    clearance: Mapping[str, Array]
    effects: tuple[Effect, ...]
    sizes: Array

    def model_at(self, hours: float) -> Model:
        """The worn model, for `equilibrium`, `lost_motion`, `transmission_error` and all else.

        Parameters
        ----------
        hours : float
            Between two of `hours` depths are taken as linear.

        Returns
        -------
        Model

        Raises
        ------
        ValueError
            If they lie outside `hours`.
        """
        if not self.hours[0] <= hours <= self.hours[-1]:
            raise ValueError(f"hours = {hours:g}: must lie within 0 to {self.hours[-1]:g}, which were computed")
        sizes = iter([float(np.interp(hours, self.hours, column)) for column in self.sizes.T])
        worn = [replace(one, values=tuple(next(sizes) for _ in one.values)) for one in self.effects]
        return self.model.with_effects(*worn)


@renamed(speed="input_speed")
def wear(
    model: Model,
    *,
    torque: Any = None,
    input_speed: Any = None,
    duty: DutyPhase | Sequence[DutyPhase] | None = None,
    hours: Any,
    coefficients: WearCoefficients,
    disc_width: Any,
    gear_width: Any,
    running_in: Mapping[str, RunningIn] | None = None,
    pins: str = "fixed",
    direction: Direction | None = None,
) -> Wear:
    """Wear of pins, discs, gear flanks and joints over a duty, and the error and lost motion that come of it.

    Parameters
    ----------
    model : Model
        Of a reducer; its errors, stiffnesses and play share the load.
    torque : float or quantity, optional
        Size of the output torque, N*mm; it resists the motion.
    input_speed : float or quantity, optional
        Size of the input speed, rad/s.
    duty : DutyPhase or sequence of DutyPhase, optional
        In place of torque and speed: phases of a cycle that is run through many times, and shares the hours.
    hours : float or array_like or quantity
        Hours of operation: those at which it is told, growing, or the last of seven evenly spaced.
    coefficients : WearCoefficients
    disc_width, gear_width : float or quantity
        Length over which a pin touches one disc, and a planet the sun, mm.
    running_in : mapping of str to RunningIn, optional
        Of ``"disc"``, ``"pin"``, ``"sun"``, ``"planet"``; what is left out is smooth from the first.
    pins : {"fixed", "turning"}
        Fixed pins wear each at its own patch, turning ones evenly all around.
    direction : {"forward", "reverse"} or +1 or -1, optional
        Where left out each for half of the hours.

    Returns
    -------
    Wear

    Raises
    ------
    ValueError
        If the model is no reducer, a size is not above 0, hours fall, or so much is worn that first order is no help.
    NotConvergedError
        As in `equilibrium`.

    Notes
    -----
    Archard (1953).  Source 001 asks for wear rates from contact pressures and gives none; source 003 takes wear as
    given.  Depth is linear in F, so no half-width of contact enters but for fixed pins, whose contact halts at the
    longest arm (Hertz's, of steel).  What the discs lose becomes ``cycloid.lobe_profile``, sixteen waves on each lobe,
    and four of ``cycloid.disc_profile`` for lobes that lose unlike; the patch of a fixed pin is among them, since the
    output cannot tell it from one on all lobes.  Pins that lose unlike, or turn, become ``cycloid.pin_radius``, gears
    ``involute.tooth_thinning``, half of it on either flank even where one direction wears one alone: a constant of the
    error, none of the lost motion.  Turning pins creep: their volume is the same however fast they turn, and the discs'
    an upper bound.  Running in is that of the mean lobe and the mean pin: how unlike they are passes with it.  Lost
    motion is taken at 3 % of the rated torque, or of the duty's largest where none is given.

    Examples
    --------
    >>> import rverror
    >>> unit = rverror.Model(rverror.reducer("RV-40E"))
    >>> worn = wear(
    ...     unit,
    ...     torque="412 N*m",
    ...     input_speed="1815 rpm",
    ...     hours=6000,
    ...     coefficients=WearCoefficients(disc="1e-10 mm^3/(N*m)"),
    ...     disc_width="9 mm",
    ...     gear_width="8 mm",
    ... )
    >>> bool(worn.lost_motion[-1] > worn.lost_motion[0])
    True
    >>> state = rverror.equilibrium(worn.model_at(3000.0), [0.0, 0.1], torque="412 N*m")
    """
    check_model(model)
    unit = reducer_of(model.mechanism, "wear")
    if pins not in PINS:
        raise ValueError(f"pins = {pins!r}: must be one of {', '.join(map(repr, PINS))}")
    if (duty is None) == (torque is None) or (input_speed is None) != (torque is None):
        raise ValueError("give torque and input_speed, or a duty of DutyPhase in place of both")
    if duty is None:
        above_zero("torque", torque, "torque")
        above_zero("input_speed", input_speed, "angular_speed")
        duty = DutyPhase(torque=torque, speed=input_speed)
    cycle = checked_duty(duty)
    doubt_torque(unit, [one.torque for one in cycle])
    works = [one for one in cycle if one.torque and one.speed]
    if not works:
        raise ValueError("duty: no phase both carries and turns; give one a torque and a speed")
    rough = {} if running_in is None else running_in
    if not (isinstance(rough, Mapping) and all(isinstance(one, RunningIn) for one in rough.values())):
        raise ValueError(f"running_in = {rough!r}: give a mapping, {{'pin': RunningIn(depth=.., coefficient=..)}}")
    if bad := [name for name in rough if name not in BODIES]:
        raise ValueError(f"running_in: no body {bad[0]!r}; give one of {', '.join(BODIES)}")
    errors = felt(model.effects)
    alike = all(source(e.key).repeats_with_crank(unit, e.indices) for e in errors)
    sides = (1.0, -1.0) if direction is None else (direction_sign(direction),)
    wearing = _Wearing(
        reducer=unit,
        by=coefficients,
        rough=rough,
        flanks=len(sides),
        disc_width=above_zero("disc_width", disc_width, "length"),
        gear_width=above_zero("gear_width", gear_width, "length"),
        fixed=pins == "fixed",
        alike=alike,
        errors=bool(errors),
    )
    # one turn of the crank against the carrier says all where pins are loaded alike
    turn = 2 * math.pi / fundamental_orders(unit)["carrier"] if alike else 2 * math.pi * true_period(unit)
    angles = _ANGLES["turn of the crank" if alike else "period"]
    theta, told = np.asarray(turn * np.arange(angles) / angles), _row_of_hours(hours)
    whole, size = sum(one.hours for one in cycle), max(one.torque for one in works)
    # every side of every phase, the output's turn that one hour of the duty has of it, rad, and whether it is told
    parts = []
    for one in works:
        turned = 3600 * one.speed / abs(unit.ratio) * one.hours / whole / len(sides)
        for side in sides:
            statics = statics_of(unit, OperatingConditions(theta, side, one.torque))
            parts.append((statics, turned, one.torque == size))
    worn, swings = zip(*_states(wearing, errors, parts, told), strict=True)
    rated = model if unit.rated_torque else replace(model, mechanism=replace(unit, rated_torque=size))
    effects = [wearing.effects(one) for one in worn]
    places = theta[:: max(theta.size // _LOST_AT, 1)]
    depths = _Worn(*map(np.array, zip(*worn, strict=True)))
    return Wear(
        model=model,
        duty=cycle,
        hours=told,
        peak_to_peak=np.array(swings),
        lost_motion=np.array([lost_motion(rated.with_effects(*more), places).mean() for more in effects]),
        volume=dict(zip(BODIES, depths.volume.T, strict=True)),
        roll_angle=_PHASE,
        lobe_depth=depths.lobe,
        pin_depth=depths.pin,
        each_pin=depths.each_pin,
        thinning=dict(zip(("sun", "planet"), depths.thinning.T, strict=True)),
        clearance=dict(zip(JOINTS, depths.joints.T, strict=True)),
        effects=effects[-1],
        sizes=np.array([[value for one in more for value in one.values] for more in effects]),
    )


def _row_of_hours(hours: Any) -> Array:
    """Hours at which to tell, from none on; plain numbers are hours."""
    timed = isinstance(hours, str) or units.is_quantity(hours)
    row = units.to_core_array(hours, "time") / 3600 if timed else np.asarray(hours, dtype=np.float64)
    if row.ndim == 0:
        row = np.linspace(0.0, float(row), _POINTS)
    elif row.ndim == 1 and row.size and row[0] > 0:
        row = np.concatenate([[0.0], row])
    if row.ndim != 1 or not (np.isfinite(row).all() and row.size > 1 and row[0] == 0 and (np.diff(row) > 0).all()):
        raise ValueError(f"hours = {hours!r}: must be above 0, and grow where there are several")
    return row


class _Worn(NamedTuple):
    """What is worn off: lengths in mm, volumes in mm^3; or x, all of that over the coefficient of the body or joint.

    Attributes
    ----------
    lobes : ndarray, complex, shape (discs, waves)
        Depth of each disc's lobes, the real part of sum c_h exp(-i h phi).
    slow : ndarray, complex, shape (discs, slow waves)
        Depth of each disc where it carries, less that of its mean lobe: the real part of sum c_h exp(-i h psi).
    pin : ndarray, shape (q,)
        Depth of the mean pin where a lobe touches it.
    each_pin : ndarray, shape (pins,)
        Depth of each pin where it carries, less that of the mean pin.
    thinning : ndarray, shape (2,)
    volume : ndarray, shape (4,)
    joints : ndarray, shape (3,)
        Clearance gained.
    """

    lobes: Any
    slow: Any
    pin: Array
    each_pin: Array
    thinning: Array
    volume: Array
    joints: Array

    def plus(self, other: _Worn, share: float) -> _Worn:
        """This and a share of another."""
        return _Worn(*(own + share * more for own, more in zip(self, other, strict=True)))

    @property
    def lobe(self) -> Array:
        """Depth of the mean lobe over the roll angle, (..., q)."""
        return _over_phases(self.lobes.mean(axis=-2))


_STEP = 2 * math.pi / _PHASES
_PHASE = np.array(_STEP * (np.arange(_PHASES) + 0.5), dtype=np.float64)
_H = np.arange(_WAVES + 1)
_SLOW = np.arange(1, _SLOW_WAVES + 1)


def _normal(reducer: Reducer, phase: Array) -> Array:
    """Angle of a contact's normal on its pin, from the line to the housing's centre, rad."""
    return np.asarray(-np.angle(1 - reducer.short_width_coefficient * np.exp(1j * phase)))


def _pressed_before(place: Array) -> Array:
    """Share of Hertz's pressure that lies before a place of its strip, -1 to 1."""
    x = np.clip(place, -1.0, 1.0)
    return np.asarray(0.5 + (x * np.sqrt(1 - x**2) + np.arcsin(x)) / math.pi)


def _over_phases(waves: Any) -> Array:
    return np.asarray((waves @ np.exp(-1j * _H[:, None] * _PHASE)).real)


def _waves_of(depth: Array) -> Any:
    """Coefficients of a depth over the roll angle."""
    return depth @ np.exp(1j * _PHASE[:, None] * _H) / _PHASES * np.where(_H == 0, 1.0, 2.0)


@dataclass(frozen=True)
class _Wearing:
    """What wears, and by how much for what it carries."""

    reducer: Reducer
    by: WearCoefficients
    rough: Mapping[str, RunningIn]
    flanks: int  # of each tooth that carry
    disc_width: float
    gear_width: float
    fixed: bool
    alike: bool  # pins
    errors: bool

    def nothing(self) -> _Worn:
        """A new unit."""
        unit = self.reducer
        lobes, slow = (np.zeros((unit.discs, waves.size), dtype=np.complex128) for waves in (_H, _SLOW))
        return _Worn(lobes, slow, np.zeros(_PHASES), np.zeros(unit.pins), np.zeros(2), np.zeros(4), np.zeros(3))

    def rate(self, statics: Statics, state: Equilibrium) -> _Worn:
        """What x grows by per rad of output in the mean over a motion."""
        where, force, unit = statics.motion, pressing(state), self.reducer
        slip, turns = pin_slip(where), frame_orders(unit)
        work = force["pin"] * np.abs(slip)  # N mm per rad
        n = work.shape[-1]
        lobes, slow = self._on_discs(where, slip, work)
        pin, each_pin = self._on_pins(where, force["pin"], work)
        flank = abs(turns["planet"] - turns["sun"]) * mean_mesh_slip(unit) * force["mesh"].sum() / n
        volume = np.array([work.sum() / n, work.sum() / n, flank, flank])
        splines = np.abs(state.contact_forces["spline"]).sum(axis=1).mean() / (unit.spline_radius or math.inf)
        joints = np.array([force["cam"].mean(), force["carrier"].mean(), splines])
        joints = joints * abs(turns["crank"] - turns["carrier"]) / (2 * math.pi)
        return _Worn(lobes, slow, pin, each_pin, volume[2:] * self._thinning(), volume, joints)

    def lost(self, x: _Worn) -> _Worn:
        """What is worn off, from pressure times sliding."""
        by, deep = self.by, self.flanks / math.cos(self.reducer.pressure_angle)
        rough = [self._run_in(*one, surfaces=deep) for one in zip(("sun", "planet"), x.thinning, strict=True)]
        return _Worn(
            by.disc * x.lobes + _waves_of(self._run_in("disc", _over_phases(x.lobes))),
            by.disc * x.slow,
            by.pin * x.pin + self._run_in("pin", x.pin),
            by.pin * x.each_pin,
            x.thinning * [by.sun, by.planet] + rough,
            x.volume * [getattr(by, body) for body in BODIES],
            x.joints * [getattr(by, joint) for joint in JOINTS],
        )

    def _run_in(self, body: str, x: Array, *, surfaces: float = 1.0) -> Array:
        """What of its roughness a body has lost; where several surfaces add, x is their sum."""
        if body not in self.rough:
            return np.zeros_like(x)
        depth = surfaces * self.rough[body].depth
        return np.asarray(-depth * np.expm1(-self.rough[body].coefficient * np.maximum(x, 0.0) / depth))

    def _wears(self, body: str) -> bool:
        return bool(getattr(self.by, body)) or body in self.rough

    def _on_discs(self, where: Contacts, slip: Array, work: Array) -> tuple[Any, Any]:
        unit, n = self.reducer, work.shape[-1]
        lead = roll_angles(where)
        from_pitch_point = unit.pin_radius - slip / (frame_orders(unit)["disc"] * where.direction)
        per_phase = from_pitch_point * pin_contact_radius(where) / unit.pin_radius  # of profile, z_c lobes together
        taken = work / (per_phase * self.disc_width * n)
        lobes = _sums(taken, lead, _H) / (2 * math.pi) * np.where(_H == 0, 1.0, 2.0)
        worked = work.sum(axis=(1, 2))
        by_phase = np.stack([_by_phase(one, phi) for one, phi in zip(work, lead, strict=True)])
        carried = np.divide(
            (by_phase * _over_phases(lobes)).sum(axis=1), worked**2, out=np.zeros_like(worked), where=worked > 0
        )
        return lobes, 2 * carried[:, None] * _sums(work, where.pin_angle, _SLOW)

    def _on_pins(self, where: Contacts, force: Array, work: Array) -> tuple[Array, Array]:
        unit = self.reducer
        if not self._wears("pin") or not work.any():
            return np.zeros(_PHASES), np.zeros(unit.pins)
        mean = work.sum(axis=(0, 2)) / (unit.discs * work.shape[-1])  # of each pin against one disc
        more = np.zeros(unit.pins) if self.alike else mean / mean.mean() - 1
        if not self.fixed:
            depth = mean.mean() / (2 * math.pi * unit.pin_radius * self.disc_width)
            return np.full(_PHASES, depth), depth * more
        lead = roll_angles(where)
        strip = strip_half_width(force / self.disc_width, pin_contact_radius(where)) / unit.pin_radius
        worked = _by_phase(work, lead)
        half = np.divide(_by_phase(work * strip, lead), worked, out=np.zeros(_PHASES), where=worked > 0)
        edge = _normal(unit, _PHASE - _STEP / 2), _normal(unit, _PHASE + _STEP / 2)
        half = np.maximum(half, np.abs(edge[1] - edge[0]) / 100)
        # the strip moves on within a phase, and comes to rest at the longest arm
        moves, middle = np.maximum(np.abs(edge[1] - edge[0]), half / 100), (edge[0] + edge[1]) / 2
        off = _normal(unit, _PHASE)[:, None] - middle
        pressed = (_pressed_before((off + moves / 2) / half) - _pressed_before((off - moves / 2) / half)) / moves
        depth = pressed @ worked / (unit.discs * unit.pins * work.shape[-1]) / (self.disc_width * unit.pin_radius)
        return depth, more * float(worked @ depth / worked.sum())

    def _thinning(self) -> Array:
        """Tooth thickness on the pitch circle that a volume lost by all teeth is, per mm^3: sun, planets."""
        unit = self.reducer
        alpha, (recess, approach) = unit.pressure_angle, path_of_contact(unit)
        thin = []
        for radius, up, down, teeth in (
            (unit.sun_pitch_radius, recess, approach, unit.sun_teeth),
            (unit.planet_pitch_radius, approach, recess, unit.planet_teeth * unit.cranks),
        ):
            foot = radius * math.sin(alpha)  # the involute's radius of curvature at the pitch point
            flank = ((foot + up) ** 2 - (foot - down) ** 2) / (2 * radius * math.cos(alpha))
            thin.append(1 / (teeth * self.gear_width * flank * math.cos(alpha)))
        return np.array(thin)

    def effects(self, worn: _Worn) -> tuple[Effect, ...]:
        """What is worn as errors of the catalogue."""
        made: list[Effect] = []

        def add(wears: bool | float, key: str, **named: Any) -> None:
            if wears:
                made.append(effect(key, **named, origin="wear"))

        lobes = worn.lobes + (_waves_of(worn.pin) if self.fixed else np.zeros(_H.size))
        for key, harmonics, discs, wears in (
            (LOBE_PROFILE, _H, lobes, self._wears("disc") or (self._wears("pin") and self.fixed)),
            (DISC_PROFILE, _SLOW, worn.slow, self.by.disc and self.errors),
        ):
            for disc, waves in enumerate(discs):
                for h, wave in zip(harmonics, waves, strict=True):
                    add(wears, key, disc=disc, harmonic=int(h), cos=-float(wave.real), sin=-float(wave.imag))
        add(self._wears("pin") and not self.fixed, PIN_RADIUS, pin="all", deviation=-float(worn.pin[0]))
        for pin, depth in enumerate(worn.each_pin):
            add(self.by.pin and not self.alike, PIN_RADIUS, pin=pin, deviation=-float(depth))
        for member, size in zip(("sun", "planet"), worn.thinning, strict=True):
            add(self._wears(member), TOOTH_THINNING, member=member, thinning=float(size))
        cam, carrier, spline = worn.joints.tolist()
        add(self.by.cam_bearing, BEARING_CLEARANCE, clearance=cam)
        add(self.by.carrier_bearing, CARRIER_CLEARANCE, clearance=carrier)
        for crank in range(self.reducer.cranks):
            add(self.by.spline, SPLINE_CLEARANCE, crank=crank, clearance=spline)
        return tuple(made)

    def deepest(self, worn: _Worn) -> float:
        """Largest depth between a lobe and a pin, and with it what joints gave."""
        unlike = np.abs(worn.slow).sum(axis=1).max() + np.abs(worn.each_pin).max()
        return float(np.max(worn.lobe + worn.pin) + unlike + worn.joints.max())


def _sums(amount: Array, angle: Array, harmonics: Any) -> Any:
    """Sum over all pins and angles of an amount times each wave exp(i h angle), (discs, waves)."""
    return np.stack([(amount * np.exp(1j * h * angle)).sum(axis=(1, 2)) for h in harmonics], axis=-1)


def _by_phase(amount: Array, lead: Array) -> Array:
    """Sum of an amount about each of the phases, shared between the two on either side."""
    at = np.mod(lead, 2 * math.pi).ravel() / _STEP - 0.5
    low = np.floor(at).astype(np.intp)
    share, size = at - low, amount.ravel()
    beside, shares = np.concatenate([low, low + 1]) % _PHASES, np.concatenate([1 - share, share])
    return np.asarray(np.bincount(beside, shares * np.tile(size, 2), minlength=_PHASES))


def _states(
    wearing: _Wearing, effects: tuple[Effect, ...], parts: Sequence[tuple[Statics, float, bool]], hours: Array
) -> Iterator[tuple[_Worn, float]]:
    """What is worn after each of some hours, by Heun's steps in x, and the error's peak-to-peak."""
    near: list[Array | None] = [None] * len(parts)

    def solved(x: _Worn) -> tuple[_Worn, float, float]:
        """What x grows by in an hour, elastic approach of the most loaded pin, and peak-to-peak."""
        rate, force, swing = wearing.nothing(), 0.0, 0.0
        errors = (*effects, *wearing.effects(wearing.lost(x)))
        for at, (one, turn, told) in enumerate(parts):
            settled = one.settled(errors, near[at])
            near[at], state = settled.x, settled.equilibrium()
            rate = rate.plus(wearing.rate(one, state), turn)
            force = max(force, float(pressing(state)["pin"].max()))
            if told:
                swing = max(swing, float(np.ptp(state.transmission_error)))
        return rate, force / wearing.reducer.stiffness.pin_contact, swing

    x, at, steps = wearing.nothing(), 0.0, 0
    first, approach, swing = solved(x)
    for end in hours:
        while at < end:
            before, allowed = wearing.lost(x), _AT_ONCE * approach

            def deeper(span: float) -> float:
                return wearing.deepest(wearing.lost(x.plus(first, span)).plus(before, -1.0))  # noqa: B023

            whole, count = deeper(hours[-1] - at), 1
            if steps + whole / allowed > _MOST_STEPS:
                raise ValueError(
                    f"some {whole:.2g} mm would be worn off, more than {_MOST_STEPS} steps of a quarter "
                    f"of the pins' elastic approach, {approach:.2g} mm; give fewer hours or a smaller coefficient"
                )
            while (now := deeper((end - at) / count)) > allowed:
                count = max(count + 1, math.ceil(count * now / allowed))
            step = (end - at) / count
            second, *_ = solved(x.plus(first, step))
            x = x.plus(first, step / 2).plus(second, step / 2)
            first, approach, swing = solved(x)
            at, steps = (end if count == 1 else at + step), steps + 1
        yield wearing.lost(x), swing


#: What may be fitted.
FREE = ("depth", "running_in", "lasting")
_FURTHEST = 1e3  # by which a size may be larger or smaller than what it was begun with


@dataclass(frozen=True, kw_only=True)
class FittedRunningIn(OneLine):
    """Running in and lasting wear that explain a measured course.

    Attributes
    ----------
    coefficients : WearCoefficients
        All as they were begun with, times one factor.
    running_in : mapping of str to RunningIn
        All depths times a second factor, all coefficients times a third.
    growth : ndarray, shape (m,)
        Of the lost motion since the first of the hours, as measured, rad.
    wear : Wear
        At the same hours with what was fitted.
    free : tuple of str
        What was fitted; as many of the measured numbers are no test of it.
    """

    coefficients: WearCoefficients
    running_in: Mapping[str, RunningIn]
    growth: Array
    wear: Wear
    free: tuple[str, ...]

    @property
    def residual(self) -> Array:
        """Measured growth less that of `wear`, (m,), rad."""
        return np.asarray(self.growth - (self.wear.lost_motion - self.wear.lost_motion[0]))


def fit_running_in(
    model: Model,
    hours: Any,
    lost_motion: Any,
    *,
    coefficients: WearCoefficients,
    running_in: Mapping[str, RunningIn],
    free: Sequence[str] = FREE,
    **duty: Any,
) -> FittedRunningIn:
    """Depth and speed of running in, and the lasting wear, from a measured course of the lost motion.

    Parameters
    ----------
    model : Model
        Of a reducer, as it was at the first of the hours.
    hours : array_like, shape (m,)
        Of operation, from 0 on.
    lost_motion : array_like or quantity, shape (m,)
        Measured then, rad; only its growth counts.
    coefficients : WearCoefficients
        Where the search begins: bodies and joints keep their shares.
    running_in : mapping of str to RunningIn
        Likewise.
    free : sequence of {"depth", "running_in", "lasting"}
        What is fitted: depths and coefficients of running in, lasting coefficients; each by one factor for all.
    **duty
        The rest of what `wear` takes.

    Returns
    -------
    FittedRunningIn

    Raises
    ------
    ValueError
        As `wear`, or if the course does not begin at 0 or has no more growths than there are factors.

    Notes
    -----
    Least squares over the factors, within 0.001 to 1000.  A course whose first measured hour comes when the unit is run
    in tells the depth and not how fast: leave "running_in" out of `free` then.

    Examples
    --------
    >>> import rverror
    >>> unit = rverror.Model(rverror.reducer("RV-40E"))
    >>> found = fit_running_in(
    ...     unit,
    ...     [0, 600, 1550],
    ...     [0, 10.6 * rverror.ARCSEC, 12.9 * rverror.ARCSEC],
    ...     coefficients=WearCoefficients(disc="1e-10 mm^3/(N*m)"),
    ...     running_in={"disc": RunningIn(depth="1 um", coefficient="5e-8 mm^3/(N*m)")},
    ...     free=["depth", "lasting"],
    ...     torque="412 N*m",
    ...     input_speed="1815 rpm",
    ...     disc_width="9 mm",
    ...     gear_width="8 mm",
    ... )
    >>> bool(abs(found.residual).max() < 0.01 * rverror.ARCSEC)
    True
    """
    check_model(model)
    times, measured = units.to_core_array(hours, "number"), units.to_core_array(lost_motion, "angle")
    chosen = tuple(free)
    if not set(chosen) <= set(FREE) or not chosen:
        raise ValueError(f"free = {free!r}: give some of {', '.join(FREE)}")
    if times.ndim != 1 or times.shape != measured.shape or times[0] != 0 or times.size <= len(chosen):
        raise ValueError(
            f"hours {times.shape} and lost_motion {measured.shape}: give both from 0 h on, and {len(chosen)} or more "
            f"measurements after it to fit {', '.join(chosen)}"
        )
    growth = measured - measured[0]

    def at(factors: Array) -> FittedRunningIn:
        factor = dict.fromkeys(FREE, 1.0) | dict(zip(chosen, factors.tolist(), strict=True))
        lasting = {item.name: factor["lasting"] * getattr(coefficients, item.name) for item in fields(coefficients)}
        by = WearCoefficients(**lasting)
        rough = {
            body: replace(one, depth=one.depth * factor["depth"], coefficient=one.coefficient * factor["running_in"])
            for body, one in running_in.items()
        }
        found = wear(model, hours=times, coefficients=by, running_in=rough, **duty)
        return FittedRunningIn(coefficients=by, running_in=rough, growth=growth, wear=found, free=chosen)

    found = scipy.optimize.least_squares(
        lambda factors: at(factors).residual / np.abs(growth).max(),
        np.ones(len(chosen)),
        bounds=(1 / _FURTHEST, _FURTHEST),
        diff_step=1e-2,  # far above what equilibria leave
        gtol=1e-4,  # some thousandths of the largest growth, and less after the last step
        xtol=1e-4,
    )
    return at(found.x)
