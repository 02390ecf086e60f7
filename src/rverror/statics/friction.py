r"""Friction: what pins, gear flanks and bearings lose, and what it does to forces and output.

Each contact c that carries F_c and slides at v_c adds a force or couple f_c F_c against the slip.  With t_c the row by
which the parts' motion V slides there, v_c = t_c . V, the balance of all parts is

.. math:: \sum_c F_c J_c + \sum_c f_c \lvert F_c \rvert\, \mathrm{sign}(v_c)\, t_c = T.

No energy has such forces, so they are the load of one pose of least energy after another.  Nominal motion closes no
contact, J_c V = 0, so the power that goes in comes out again but for the sum of f_c F_c v_c, exactly.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.quantities import above_zero, row
from rverror.base.viewed import Viewed
from rverror.geartrain.action_line import Contacts
from rverror.geartrain.contacts import closed_form_forces, motion, pose
from rverror.geartrain.cycloid import pitch_distance, roll_angles
from rverror.geartrain.kinematics import OperatingConditions, frame_orders
from rverror.geartrain.mechanism import Friction, Reducer, doubt_torque
from rverror.model.effects import Model, check_model
from rverror.model.readings import added, felt, stand, unread
from rverror.statics.energy import Geometry, Layout, samples_first, solve
from rverror.statics.loaded_state import NotConvergedError, Settled, equilibrium, reducer_of, statics_of
from rverror.statics.rigidity import MAKERS_SHARE, on_its_branch

_MOST_ROUNDS = 60
_DEPTH = 6  # rounds that tell the next
_STRICT = 1e-3  # of what may be out of balance in a pose without friction
#: Kinds of contacts that rub, in the order in which they stand side by side; behind them stands what does not.
_KINDS = ("pin", "mesh", "crank_bearing", "carrier_bearing")


@dataclass(frozen=True, kw_only=True)
class Efficiency(Viewed):
    """What a reducer loses to friction along a motion.

    Attributes
    ----------
    theta : ndarray, shape (n,)
        Nominal output angle as the bench reads it, rad.
    direction : ndarray, shape (n,)
        Of the motion: +1 forward, -1 reverse.
    torque : float
        Size of the torque on the output, N*mm.
    ratio : float
        Input turns per output turn.
    drives : str
        ``"input"`` or ``"output"``.
    input_torque : ndarray, shape (n,)
        N*mm, from the balance of the sun: along the motion where the input drives, against it where the output does.
        At no load the running torque; with coefficients of rest in place of motion the starting torque.  0 or less
        where the output drives: self-locking.
    losses : mapping of str to ndarray, shape (n,)
        Power lost over the speed of the output, N*mm, from the slip of each kind of contact: ``"pin"``, ``"mesh"``,
        ``"crank_bearing"``, ``"carrier_bearing"`` and ``"drag"``.
    error_change : ndarray, shape (n,)
        Output error with friction less that without, rad; 0 in closed form, where nothing gives way.
    """

    theta: Array
    direction: Array
    torque: float
    ratio: float
    drives: str
    input_torque: Array
    losses: Mapping[str, Array]
    error_change: Array

    @property
    def efficiency(self) -> Array:
        """Power that comes out over power that goes in, (n,); 0 where none goes in, below 0 where self-locking."""
        return _over(*self.out_and_in())

    @property
    def mean(self) -> float:
        """Work that comes out over work that goes in, over all angles."""
        out, into = self.out_and_in()
        return float(_over(out.sum(), into.sum()))

    @property
    def by_part(self) -> Mapping[str, float]:
        """Share of the work put in that each kind of contact takes, keyed as `losses`."""
        into = self.out_and_in()[1].sum()
        return {part: float(_over(lost.sum(), into)) for part, lost in self.losses.items()}

    @property
    def self_locking(self) -> bool:
        """Whether the output cannot drive it at some angle."""
        return self.drives == "output" and bool((self.input_torque <= 0).any())

    def out_and_in(self) -> tuple[Array, Array]:
        """Power that comes out and power that goes in over the speed of the output, N*mm, (n,) each."""
        at_input, at_output = abs(self.ratio) * self.input_torque, np.full(self.theta.size, self.torque)
        return (at_output, at_input) if self.drives == "input" else (at_input, at_output)


def _over(one: Any, other: Any) -> Array:
    """One over the other, 0 where that is none."""
    return np.asarray(np.divide(one, other, out=np.zeros_like(one), where=other != 0))


def efficiency(
    model: Model,
    theta: Any,
    *,
    torque: Any,
    friction: Friction | None = None,
    direction: Any | None = None,
    drives: str = "input",
    method: str = "equilibrium",
) -> Efficiency:
    """Efficiency, torque at the input and change of the output error under friction.

    Parameters
    ----------
    model : Model
        Of a reducer.
    theta : array_like, str or quantity, shape (n,) or one angle
        Nominal output angle, rad.
    torque : float or quantity
        Size of the output torque, N*mm: against the motion where the input drives, along it where the output does.
    friction : Friction, optional
        The reducer's own where left out.
    direction : {"forward", "reverse"} or +1 or -1, or array_like of them, optional
        Of the motion; read from the angles where left out.
    drives : {"input", "output"}
        From where the power comes.
    method : {"equilibrium", "closed"}
        Forces of the loaded equilibrium with friction in it; or of the closed form, of first order in the coefficients.

    Returns
    -------
    Efficiency

    Raises
    ------
    ValueError
        If the model is no reducer, nothing is said of friction, or the output is to drive with no more torque than the
        drag.
    NotConvergedError
        If forces and friction do not balance at some angle: parts wedge, or the unit is self-locking.

    Notes
    -----
    No load is the limit of a vanishing one; contacts that errors jam rub then all the same.  Pins are fixed in their
    grooves, the gears' addenda are one module, flanks rub as in the mean over their path of contact, and normals are
    those of the error-free pose whatever `ContactLaw.profile_curvature`.  No source text has it; Coulomb's law,
    Niemann's gear loss factor.

    Examples
    --------
    >>> import numpy as np, rverror
    >>> unit = rverror.Model(rverror.reducer("RV-40E"))
    >>> rubs = Friction(pin=0.05, mesh=0.05)
    >>> found = efficiency(unit, np.linspace(0, 0.15, 9), torque="412 N*m", friction=rubs)
    >>> round(found.mean, 2), sorted(found.by_part, key=found.by_part.get)[-1]
    (0.93, 'pin')
    """
    check_model(model)
    unit = _reducer(model)
    friction = declared_friction(model) if friction is None else friction
    if drives not in ("input", "output"):
        raise ValueError(f"drives = {drives!r}: must be 'input' or 'output'")
    if method not in ("closed", "equilibrium"):
        raise ValueError(f"method = {method!r}: must be 'closed' or 'equilibrium'")
    read = pose(unit, theta, torque=torque, direction=direction)
    gears = stand(model, read).gears
    if read.load is not None:
        raise ValueError("torque: it changes over the turn, and losses are found at one; give one size")
    size, sign = read.torque or 0.0, 1.0 if drives == "input" else -1.0
    if not size >= 0:
        raise ValueError(f"torque = {size / 1e3:g} N*m: must be 0 or more; the direction comes from the motion")
    carried = size + sign * friction.drag
    if drives == "output" and not carried > 0:
        raise ValueError(
            f"torque = {size / 1e3:g} N*m: the output drives with more than the drag, {friction.drag / 1e3:g} N*m"
        )
    # the flanks that carry are those of the load, which resists where the input drives
    under = OperatingConditions(gears.theta, sign * gears.direction, carried)
    if method == "closed":
        losses, change = _closed_form_losses(unit, under, friction), np.zeros(gears.theta.size)
        input_torque = (carried + sign * np.sum([*losses.values()], axis=0)) / abs(unit.ratio)
    else:
        try:
            input_torque, losses, change = _in_equilibrium(model, under, sign, friction)
        except NotConvergedError as problem:
            lost = np.sum([*_closed_form_losses(unit, under, friction).values()], axis=0).min() / carried
            if drives == "input" or lost < 1:
                raise
            raise NotConvergedError(
                f"self-locking: friction takes {100 * lost:.0f} % or more of what the output puts in (closed form); "
                "use smaller coefficients of friction, or method='closed' for the losses"
            ) from problem
    return Efficiency(
        theta=read.theta,
        direction=read.direction,
        torque=size,
        ratio=unit.ratio,
        drives=drives,
        input_torque=input_torque,
        losses={**losses, "drag": np.full(gears.theta.size, friction.drag)},
        error_change=change,
    )


@dataclass(frozen=True, kw_only=True)
class Hysteresis(Viewed):
    """Hysteresis loop: turn of the output under a torque that rises or falls, input held.

    Attributes
    ----------
    torque : ndarray, shape (m,)
        Torque on the output, N*mm, in the order in which it was asked for; positive turns it counter-clockwise.
    rising, falling : ndarray, shape (m, n)
        Turn of the output from the middle of the play as the torque rises and as it falls, rad.
    rated_torque : float or None
        Of the reducer, N*mm.
    """

    torque: Array
    rising: Array
    falling: Array
    rated_torque: float | None = None

    @property
    def width(self) -> Array:
        """Falling less rising, (m, n), rad: twice what friction holds back, and play where the torque is small."""
        return self.falling - self.rising

    def lost_motion(self, torque: Any) -> Array:
        """Turn from a torque in one sense to the same in the other, at the middles of the loop, as makers read it.

        Parameters
        ----------
        torque : float or quantity
            Size, N*mm; makers take 3 % of the rated torque.

        Returns
        -------
        ndarray, shape (n,)
            rad.

        Raises
        ------
        ValueError
            If the loop does not reach it in both senses, or it is not above 0.
        """
        size = above_zero("torque", torque, "torque")
        middle = (self.rising + self.falling) / 2
        return on_its_branch(self.torque, middle, size) - on_its_branch(self.torque, middle, -size)

    @property
    def rated_lost_motion(self) -> Array | None:
        """`lost_motion` at 3 % of the rated torque, rad; None where the loop does not reach it, or none is rated."""
        try:
            return None if self.rated_torque is None else self.lost_motion(MAKERS_SHARE * self.rated_torque)
        except ValueError:
            return None


def hysteresis(model: Model, theta: Any, *, torques: Any, friction: Friction | None = None) -> Hysteresis:
    """Branches of the torsion curve that friction holds apart.

    Parameters
    ----------
    model : Model
        Of a reducer.
    theta : array_like, str or quantity, shape (n,) or one angle
        Nominal output angle at which the input is held, rad.
    torques : array_like or quantity, shape (m,)
        Torques on the output, N*mm, of either sign; a list may hold strings such as ``"-20 N*m"``.
    friction : Friction, optional
        The reducer's own where left out.

    Returns
    -------
    Hysteresis

    Raises
    ------
    ValueError
        If the model is no reducer, nothing is said of friction, or the torques are not a row of finite numbers.
    NotConvergedError
        If forces and friction do not balance at some angle.

    Notes
    -----
    Each contact slides as the parts wind up at that torque.  Contacts that still stick after the torque has turned
    round are not followed: the branches are those that a loop reaches once all slide, and bound it from outside.

    Examples
    --------
    >>> import rverror
    >>> unit = rverror.Model(rverror.reducer("RV-40E"))
    >>> loop = hysteresis(unit, [0.0, 0.1], torques=["206 N*m", "412 N*m"], friction=Friction(pin=0.1))
    >>> bool((loop.width > 0).all())
    True
    """
    check_model(model)
    friction = declared_friction(model) if friction is None else friction
    unit, turns = _straight(unread(model)), row("torques", torques, "torque")
    doubt_torque(model.mechanism, torques, name="torques")
    lower, upper = (equilibrium(unit, theta, torque=0.0, direction=side).transmission_error for side in (1.0, -1.0))
    rising, falling = (
        np.array([_wound_up(unit, theta, torque, along, friction) - (lower + upper) / 2 for torque in turns])
        for along in (1.0, -1.0)
    )
    return Hysteresis(torque=turns, rising=rising, falling=falling, rated_torque=_reducer(model).rated_torque)


def _wound_up(model: Model, theta: Any, torque: float, along: float, friction: Friction) -> Array:
    """Turn of the output under a torque on it that rises, along = 1, or falls, rad."""
    unit = _reducer(model)
    by, carried = _coefficients(unit, friction), torque - along * friction.drag
    side = math.copysign(1.0, carried) if carried else -along
    read = pose(unit, theta, torque=units.InCore(abs(torque)), direction=-math.copysign(1.0, torque))
    under = OperatingConditions(stand(model, read).gears.theta, -side, abs(carried))
    settled = statics_of(unit, under).settled(felt(model.effects), response=True)
    yields = -along * settled.solution.pose_change
    sliding = (_slide_rows(settled.contacts) @ yields[..., None])[..., 0]
    change = unit.output_turn * (_slid(settled, by * np.sign(sliding)).solution.x - settled.solution.x)[:, 2]
    return settled.transmission_error + change + added(model.effects, read)


def _reducer(model: Model) -> Reducer:
    return reducer_of(model.mechanism, "friction")


def declared_friction(model: Model) -> Friction:
    """Coefficients of a model's reducer.

    Parameters
    ----------
    model : Model

    Returns
    -------
    Friction

    Raises
    ------
    ValueError
        If the model is no reducer, or no friction is stated.
    """
    unit = _reducer(model)
    if unit.friction == Friction():
        raise ValueError(
            "friction: no coefficients are stated; give them in [reducer.friction] or as friction=Friction(...)"
        )
    return unit.friction


def _straight(model: Model) -> Model:
    """The model with normals of the error-free pose."""
    unit = _reducer(model)
    return replace(model, mechanism=replace(unit, contact_law=replace(unit.contact_law, profile_curvature=0.0)))


def _counts(reducer: Reducer) -> list[int]:
    """How many contacts there are of each kind: pins disc by disc, flanks, cams, carrier bores, other bearings."""
    return [reducer.discs * reducer.pins, 2 * reducer.cranks, reducer.discs * reducer.cranks, reducer.cranks, 2]


def _slide_rows(contacts: Geometry) -> Array:
    """How contacts slide with the pose, or turn where friction has a lever, (n, contacts, unknowns).

    The disc on each pin, a quarter turn ahead of the normal; each planet on the held sun; each crank in its disc and
    in the carrier.
    """
    reducer, closing, layout = contacts.motion.reducer, contacts.pin_rows, Layout(contacts.motion.reducer)
    pins, flanks, cams, bores, _ = _counts(reducer)
    rows = np.zeros((len(closing), sum(_counts(reducer)), layout.size))
    on_pins = np.stack([closing[:, :, 1], -closing[:, :, 0], reducer.pin_radius - contacts.profile_lever], axis=3)
    for k, at in enumerate(layout.disc):
        rows[:, k * reducer.pins : (k + 1) * reducer.pins, at : at + 3] = on_pins[:, k]
    crank = np.array([2 + at for at in layout.crank])
    turning = pins + np.arange(flanks + cams + bores)
    rows[:, turning, np.concatenate([np.repeat(crank, 2), np.tile(crank, reducer.discs + 1)])] = 1.0
    rows[:, turning[flanks:], np.repeat([2 + at for at in (*layout.disc, 0)], reducer.cranks)] = -1.0
    return rows


def pin_slip(contacts: Contacts) -> Array:
    """How fast discs slide on pins along the nominal motion, mm per rad of output, (discs, pins, n).

    A disc turns about the pitch point, so it slides on a pin at its own speed times the distance of the contact from
    there, R_p sqrt(1 + K^2 - 2 K cos(phi)) - r.
    """
    reducer = contacts.reducer
    from_pitch_point = reducer.pin_circle_radius * pitch_distance(reducer, roll_angles(contacts)) - reducer.pin_radius
    return np.asarray(-frame_orders(reducer)["disc"] * contacts.direction * from_pitch_point)


def _nominal_sliding(contacts: Contacts) -> Array:
    """How fast contacts slide along the nominal motion per unit of output speed, mm, or turn, (n, contacts)."""
    turns, n = frame_orders(contacts.reducer), contacts.theta.size
    crank = turns["crank"]
    speeds = [turns["planet"] - turns["sun"], crank - turns["disc"], crank - turns["carrier"], 0.0]
    others = contacts.direction[:, None] * np.repeat(speeds, _counts(contacts.reducer)[1:])
    return np.concatenate([samples_first(pin_slip(contacts)).reshape(n, -1), others], axis=1)


def mean_mesh_slip(reducer: Reducer) -> float:
    """Mean distance from the pitch point at which gear flanks carry: slip per turn of the planet on the sun.

    Parameters
    ----------
    reducer : Reducer

    Returns
    -------
    float
        mm.

    Notes
    -----
    Addenda of one module, paths that end where the mate's involute does, two pairs of teeth that share the force
    equally where they touch: p_b (1 - e1 - e2 + e1^2 + e2^2) / 2 with the contact ratios e1, e2 of either side of the
    pitch point (Niemann's gear loss factor).
    """
    pitch = math.pi * reducer.module * math.cos(reducer.pressure_angle)
    one, other = (length / pitch for length in path_of_contact(reducer))
    return pitch * (1 - one - other + one**2 + other**2) / 2


def path_of_contact(reducer: Reducer) -> tuple[float, float]:
    """Length of the path of contact on either side of the pitch point, mm: to the sun's tip, to the planet's.

    Addenda of one module; a path ends where the mate's involute does.

    Parameters
    ----------
    reducer : Reducer

    Returns
    -------
    tuple of float
    """
    alpha, m = reducer.pressure_angle, reducer.module
    radii = reducer.sun_pitch_radius, reducer.planet_pitch_radius
    sun, planet = (
        min(math.sqrt((r + m) ** 2 - (r * math.cos(alpha)) ** 2) - r * math.sin(alpha), mate * math.sin(alpha))
        for r, mate in (radii, radii[::-1])
    )
    return sun, planet


def _coefficients(reducer: Reducer, friction: Friction) -> Array:
    """Coefficients of friction, times the lever where what slides is a turn, (contacts,)."""
    crank = friction.crank_bearing * (friction.crank_bearing_radius or 0.0)
    carrier = friction.carrier_bearing * (friction.carrier_bearing_radius or 0.0)
    return np.repeat([friction.pin, friction.mesh * mean_mesh_slip(reducer), crank, carrier, 0.0], _counts(reducer))


def _losses(reducer: Reducer, lost: Array) -> dict[str, Array]:
    """Power that each kind of contact takes, from that of all contacts, (n, contacts)."""
    first = np.cumsum([0, *_counts(reducer)[:-1]])
    return dict(zip(_KINDS, np.add.reduceat(lost, first, axis=1).T, strict=False))


def _closed_form_losses(unit: Reducer, under: OperatingConditions, friction: Friction) -> dict[str, Array]:
    where = motion(unit, under)
    assert isinstance(where, Contacts)
    forces, n = closed_form_forces(where), where.theta.size
    size = [np.sqrt((forces[key] ** 2).sum(axis=-2)).reshape(-1, n) for key in ("pin", "mesh", "cam", "carrier")]
    pressed = (under.torque or 0.0) * np.concatenate([*size, np.zeros((2, n))]).T
    return _losses(unit, _coefficients(unit, friction) * pressed * np.abs(_nominal_sliding(where)))


def _in_equilibrium(
    model: Model, under: OperatingConditions, sign: float, friction: Friction
) -> tuple[Array, dict[str, Array], Array]:
    """Torque at the input, losses, and change of the error; the motion is along the load's, or against it."""
    unit, by = _reducer(model), _coefficients(_reducer(model), friction)
    settled = statics_of(_straight(model).mechanism, under).settled(felt(model.effects))
    where = settled.contacts.motion
    sliding = sign * _nominal_sliding(where)
    rub = by * np.sign(sliding)
    slid = _slid(settled, rub)
    trace = 0.0 if under.torque else np.abs(settled.problem.load[:, 2] / float(unit.exact_carrier_ratio))
    at_sun = _sun_torque(unit, rub, _pressing(slid)) * where.sense - trace
    change = unit.output_turn * (slid.solution.x - settled.solution.x)[:, 2]
    return at_sun, _losses(unit, rub * sliding * _pressing(slid)), change


def _pressing(state: Settled) -> Array:
    """What each contact presses, N, (n, contacts): more than its force where rollers on both sides carry."""
    solution, n = state.solution, len(state.x)
    (flank, force), (_, moved) = state.split(solution.row_force), state.split(solution.rows)
    _, stiffness = state.split(state.problem.row_stiffness)
    behind = np.maximum(-state.problem.clearance - np.sqrt((moved**2).sum(axis=-1)), 0.0)
    joints = np.sqrt((force**2).sum(axis=-1)) + 2 * stiffness[..., 0] * behind
    return np.concatenate([solution.pin_force.reshape(n, -1), flank, joints], axis=1)


def _sun_torque(reducer: Reducer, rub: Array, pressing: Array) -> Array:
    """Torque that the input puts on the sun, counter-clockwise."""
    base, (pins, flanks) = reducer.sun_pitch_radius * math.cos(reducer.pressure_angle), _counts(reducer)[:2]
    at, lever = slice(pins, pins + flanks), np.tile([base, -base], reducer.cranks)
    return np.asarray((pressing[:, at] * (lever - rub[:, at])).sum(axis=1))


def _slid(settled: Settled, rub: Array) -> Settled:
    """State with friction, from that without; `rub` is signed as contacts slide.

    Friction is a load of the last pose until it changes no more.  How its last few changes hang together tells where
    that is (D. G. Anderson, Iterative procedures for nonlinear integral equations, J. ACM 12, 1965).
    """
    problem, reducer, theta = settled.problem, settled.reducer, settled.contacts.motion.theta
    on, own = -rub[..., None] * _slide_rows(settled.contacts), -problem.load[:, 2] / float(reducer.exact_carrier_ratio)
    state, load, strict = settled, np.zeros_like(problem.load), problem._replace(tolerance=_STRICT * problem.tolerance)
    loads, changes = np.zeros((0, *load.shape)), np.zeros((0, *load.shape))
    for _ in range(_MOST_ROUNDS):
        pressing = _pressing(state)
        force = (pressing[:, None] @ on)[:, 0]
        if reducer.output == "housing":  # the carrier bears what the housing and the sun put on it
            force[:, 2] += own - _sun_torque(reducer, rub, pressing)
        left = np.abs(state.solution.gradient + load - force).max(axis=1)
        if (left <= np.maximum(strict.tolerance, state.solution.unbalanced)).all():
            break
        loads = np.append(loads, load[None], 0)[-_DEPTH:]
        changes = np.append(changes, (force - load)[None], 0)[-_DEPTH:]
        moved, turned = (np.diff(one, axis=0).transpose(1, 2, 0) for one in (loads, changes))
        share = np.linalg.pinv(turned, rcond=1e-8) @ (force - load)[..., None]
        load = force - ((moved + turned) @ share)[..., 0]
        state = replace(settled, solution=solve(strict._replace(load=problem.load + load), near=state.solution.x))
    bad = left > np.maximum(problem.tolerance, state.solution.unbalanced)
    if bad.any():
        where = ", ".join(f"{math.degrees(a):.4g}" for a in theta[bad][:5])
        raise NotConvergedError(
            f"forces and friction do not balance at {bad.sum()} of {bad.size} angles (theta = {where} deg ...): the "
            "parts wedge; use smaller coefficients of friction"
        )
    return state
