r"""Friction: what pins, gear flanks and bearings lose, and what it does to forces and output.

Each contact c that carries F_c and slides at v_c adds a force or couple f_c F_c against the slip.  With t_c the row by
which the parts' motion V slides there, v_c = t_c . V, the balance of all parts is

.. math:: \sum_c F_c J_c + \sum_c f_c \lvert F_c \rvert\, \mathrm{sign}(v_c)\, t_c = T.

No energy has such forces, so Newton steps on the balance itself start from the pose without friction.  Nominal motion
closes no contact, J_c V = 0, so the power that goes in comes out again but for the sum of f_c F_c v_c, exactly.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array, cross, radial_and_tangential
from rverror.base.viewed import Viewed
from rverror.geartrain.action_line import Contacts
from rverror.geartrain.contacts import closed_form_forces, motion, pose
from rverror.geartrain.cycloid import pin_positions
from rverror.geartrain.kinematics import Conditions, frame_orders
from rverror.geartrain.mechanism import Friction, Reducer, doubt_torque
from rverror.model.effects import Model, check_model
from rverror.model.readings import added, felt, stand, unread
from rverror.statics.energy import Layout, part_of, refined, samples_first, solve, with_discs
from rverror.statics.loaded_state import NotConvergedError, Settled, Tangent, equilibrium, reducer_of, statics_of
from rverror.statics.rigidity import on_its_branch, row_of_torques

_MOST_STEPS = 40
_MOST_HALVINGS = 12
_MOST_ROUNDS = 30


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
        return _over(*self._out_and_in())

    @property
    def mean(self) -> float:
        """Work that comes out over work that goes in, over all angles."""
        out, into = (np.array([side.sum()]) for side in self._out_and_in())
        return float(_over(out, into)[0])

    @property
    def by_part(self) -> Mapping[str, float]:
        """Share of the work put in that each kind of contact takes, keyed as `losses`."""
        into = np.array([self._out_and_in()[1].sum()])
        return {part: float(_over(np.array([lost.sum()]), into)[0]) for part, lost in self.losses.items()}

    @property
    def self_locking(self) -> bool:
        """Whether the output cannot drive it at some angle."""
        return self.drives == "output" and bool((self.input_torque <= 0).any())

    def _out_and_in(self) -> tuple[Array, Array]:
        """Torques that stand for the power, at the speed of the output."""
        at_input, at_output = abs(self.ratio) * self.input_torque, np.full(self.theta.size, self.torque)
        return (at_output, at_input) if self.drives == "input" else (at_input, at_output)


def _over(one: Array, other: Array) -> Array:
    return np.divide(one, other, out=np.zeros_like(one), where=other != 0)


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
    direction : float or array_like, optional
        Of the motion: +1 forward, -1 reverse; read from the angles where left out.
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
        If forces and friction do not balance at some angle.

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
    friction = _declared(unit) if friction is None else friction
    if drives not in ("input", "output"):
        raise ValueError(f"drives = {drives!r}: must be 'input' or 'output'")
    if method not in ("closed", "equilibrium"):
        raise ValueError(f"method = {method!r}: must be 'closed' or 'equilibrium'")
    read = pose(unit, theta, torque=torque, direction=direction)
    gears = stand(model, read).gears
    size, sign = read.torque or 0.0, 1.0 if drives == "input" else -1.0
    if not size >= 0:
        raise ValueError(f"torque = {size / 1e3:g} N*m: must be 0 or more; the direction comes from the motion")
    carried = size + sign * friction.drag
    if drives == "output" and not carried > 0:
        raise ValueError(
            f"torque = {size / 1e3:g} N*m: the output drives with more than the drag, {friction.drag / 1e3:g} N*m"
        )
    # the flanks that carry are those of the load, which resists where the input drives
    under = Conditions(gears.theta, sign * gears.direction, carried)
    if method == "closed":
        losses, change = _closed_form_losses(unit, under, gears.direction, friction), np.zeros(gears.theta.size)
        input_torque = (carried + sign * np.sum([*losses.values()], axis=0)) / abs(unit.ratio)
    else:
        input_torque, losses, change = _in_equilibrium(model, under, gears.direction, friction)
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
    """Loop of the torsion curve: turn of the output under a torque that rises or falls, input held.

    Attributes
    ----------
    torque : ndarray, shape (m,)
        Torque on the output, N*mm, in the order in which it was asked for; positive turns it counter-clockwise.
    rising, falling : ndarray, shape (m, n)
        Turn of the output from the middle of the play as the torque rises and as it falls, rad.
    """

    torque: Array
    rising: Array
    falling: Array

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
        size = units.named_core("torque", torque, "torque")
        if not size > 0:
            raise ValueError(f"torque = {size / 1e3:g} N*m: must be above 0")
        middle = (self.rising + self.falling) / 2
        return on_its_branch(self.torque, middle, size) - on_its_branch(self.torque, middle, -size)


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
    friction = _declared(_reducer(model)) if friction is None else friction
    unit, turns = _straight(unread(model)), row_of_torques(torques)
    doubt_torque(model.mechanism, torques, name="torques")
    lower, upper = (equilibrium(unit, theta, torque=0.0, direction=side).transmission_error for side in (1.0, -1.0))
    branches = [
        [_wound_up(unit, theta, torque, along, friction) - (lower + upper) / 2 for torque in turns]
        for along in (1.0, -1.0)
    ]
    return Hysteresis(torque=turns, rising=np.array(branches[0]), falling=np.array(branches[1]))


def _wound_up(model: Model, theta: Any, torque: float, along: float, friction: Friction) -> Array:
    """Turn of the output under a torque on it that rises, along = 1, or falls, rad."""
    unit = _reducer(model)
    by, carried = _coefficients(unit, friction), torque - along * friction.drag
    side = math.copysign(1.0, carried) if carried else -along
    read = pose(unit, theta, torque=units.InCore(abs(torque)), direction=-math.copysign(1.0, torque))
    under = Conditions(stand(model, read).gears.theta, -side, abs(carried))
    found = []
    for settled in statics_of(unit, under).solutions(felt(model.effects), matrix=True):
        rows = _rows(settled.contacts.motion)
        push = np.zeros_like(settled.x)
        push[:, 2] = along * unit.output_turn
        yields = refined(settled.matrix, push)
        discs = yields[:, 3 : 3 + 3 * unit.discs].reshape(-1, unit.discs, 3)
        sliding = Sliding(
            pin=np.einsum("nkc,nkcp->nkp", discs, rows.pin),
            joint=yields @ rows.joint.T,
            flank=yields @ rows.flank.T,
        )
        change = unit.output_turn * (_slid(settled, by, sliding).x - settled.x)[:, 2]
        found.append(settled.transmission_error + change)
    return np.concatenate(found) + added(model.effects, read)


def _reducer(model: Model) -> Reducer:
    return reducer_of(model.mechanism, "friction")


def _declared(unit: Reducer) -> Friction:
    if unit.friction == Friction():
        raise ValueError(
            "friction: nothing is said of it; give its coefficients in [reducer.friction] or as friction=Friction(...)"
        )
    return unit.friction


def _straight(model: Model) -> Model:
    """The model with normals of the error-free pose."""
    unit = _reducer(model)
    return replace(model, mechanism=replace(unit, contact_law=replace(unit.contact_law, profile_curvature=0.0)))


@dataclass(frozen=True)
class _Rows:
    """How contacts slide with the pose, and at which lever, samples first.

    Attributes
    ----------
    pin : ndarray, shape (n, discs, 3, pins)
        How far the disc slides on each pin, a quarter turn ahead of the normal, with its x, y and angle.
    joint : ndarray, shape (joints, size)
        Turn of each crank in its disc and in the carrier; none for what supports carrier and sun.
    flank : ndarray, shape (2 cranks, size)
        Turn of each planet on the held sun.
    """

    pin: Array
    joint: Array
    flank: Array


@dataclass(frozen=True)
class Sliding:
    """Speed of each contact along its row: n by (discs, pins), joints and flanks; mm, or mm per turn in rad."""

    pin: Array
    joint: Array
    flank: Array


def _rows(contacts: Contacts) -> _Rows:
    reducer = contacts.reducer
    layout = Layout(reducer)
    normal = contacts.pin_normal
    tangent = np.stack([-normal[:, :, 1], normal[:, :, 0]], axis=2)
    pins, _ = radial_and_tangential(pin_positions(reducer)[:, None])
    eccentric, _ = radial_and_tangential(contacts.eccentric)
    arm = reducer.pin_circle_radius * pins + reducer.pin_radius * normal - reducer.eccentricity * eccentric[:, None]
    pin = samples_first(np.stack([tangent[:, :, 0], tangent[:, :, 1], cross(arm, tangent)], axis=1))
    pairs = [(crank, disc) for disc in layout.disc for crank in layout.crank] + [(crank, 0) for crank in layout.crank]
    joint = np.zeros((len(pairs) + 2, layout.size))
    for row, (crank, other) in zip(joint, pairs, strict=False):
        row[crank + 2], row[other + 2] = 1.0, -1.0
    flank = np.zeros((2 * reducer.cranks, layout.size))
    for j, crank in enumerate(layout.crank):
        flank[2 * j : 2 * j + 2, crank + 2] = 1.0
    return _Rows(pin, joint, flank)


def nominal_sliding(contacts: Contacts, direction: Array) -> Sliding:
    r"""How fast contacts slide along the nominal motion, per unit of output speed.

    A disc turns about the pitch point, so it slides on a pin at its own speed times the distance of the contact from
    there, R_p sqrt(1 + K^2 - 2 K cos(phi)) - r.

    Parameters
    ----------
    contacts : Contacts
    direction : ndarray, shape (n,)
        +1 forward, -1 reverse.

    Returns
    -------
    Sliding
    """
    reducer, turns = contacts.reducer, frame_orders(contacts.reducer)
    lead = contacts.eccentric[:, None] - pin_positions(reducer)[:, None]
    K = reducer.short_width_coefficient
    from_pitch_point = reducer.pin_circle_radius * np.sqrt(1 + K**2 - 2 * K * np.cos(lead)) - reducer.pin_radius
    cams = reducer.discs * reducer.cranks
    joint = [turns["crank"] - turns["disc"]] * cams + [turns["crank"] - turns["carrier"]] * reducer.cranks + [0.0, 0.0]
    return Sliding(
        pin=samples_first(-turns["disc"] * direction * from_pitch_point),
        joint=direction[:, None] * np.array(joint),
        flank=direction[:, None] * np.full(2 * reducer.cranks, turns["planet"] - turns["sun"]),
    )


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


@dataclass(frozen=True)
class _Coefficients:
    """Coefficients of friction, times the lever where what slides is a turn."""

    pin: float
    joint: Array  # (joints,)
    flank: float


def _coefficients(reducer: Reducer, friction: Friction) -> _Coefficients:
    cams = reducer.discs * reducer.cranks
    crank = friction.crank_bearing * (friction.crank_bearing_radius or 0.0)
    carrier = friction.carrier_bearing * (friction.carrier_bearing_radius or 0.0)
    joint = np.array([crank] * cams + [carrier] * reducer.cranks + [0.0, 0.0])
    return _Coefficients(friction.pin, joint, friction.mesh * mean_mesh_slip(reducer))


def _losses(
    reducer: Reducer, by: _Coefficients, sliding: Sliding, *, pin: Array, joint: Array, flank: Array
) -> dict[str, Array]:
    """Power that each kind of contact takes, from the sizes of forces, samples first."""
    cams = reducer.discs * reducer.cranks
    in_joints = by.joint * joint * np.abs(sliding.joint)
    return {
        "pin": by.pin * (pin * np.abs(sliding.pin)).sum(axis=(1, 2)),
        "mesh": by.flank * (flank * np.abs(sliding.flank)).sum(axis=1),
        "crank_bearing": in_joints[:, :cams].sum(axis=1),
        "carrier_bearing": in_joints[:, cams:].sum(axis=1),
    }


def _closed_form_losses(unit: Reducer, under: Conditions, direction: Array, friction: Friction) -> dict[str, Array]:
    where = motion(unit, under)
    assert isinstance(where, Contacts)
    torque, n = under.torque or 0.0, where.theta.size
    forces = closed_form_forces(where)
    size = {key: torque * np.sqrt((forces[key] ** 2).sum(axis=-2)) for key in ("pin", "cam", "carrier", "mesh")}
    joints = np.concatenate([size["cam"].reshape(-1, n), size["carrier"], np.zeros((2, n))])
    return _losses(
        unit,
        _coefficients(unit, friction),
        nominal_sliding(where, direction),
        pin=samples_first(size["pin"]),
        joint=samples_first(joints),
        flank=samples_first(size["mesh"].reshape(-1, n)),
    )


def _in_equilibrium(
    model: Model, under: Conditions, direction: Array, friction: Friction
) -> tuple[Array, dict[str, Array], Array]:
    """Torque at the input, losses, and change of the error."""
    unit, by = _reducer(model), _coefficients(_reducer(model), friction)
    statics = statics_of(_straight(model).mechanism, under)
    found: list[tuple[Array, dict[str, Array], Array]] = []
    first = 0
    for settled in statics.solutions(felt(model.effects), matrix=True):
        n = len(settled.x)
        along = direction[first : first + n]
        first += n
        sliding = nominal_sliding(settled.contacts.motion, along)
        slid = _slid(settled, by, sliding)
        lost = _losses(unit, by, sliding, pin=slid.pin_force, joint=slid.joint_pressed, flank=slid.flank_force)
        at_sun = _sun_torque(unit, by, sliding, slid) * settled.contacts.motion.sense
        trace = 0.0 if under.torque else settled.torque / abs(unit.exact_carrier_ratio)
        found.append((at_sun - trace, lost, unit.output_turn * (slid.x - settled.x)[:, 2]))
    joined = {part: np.concatenate([one[1][part] for one in found]) for part in found[0][1]}
    return np.concatenate([one[0] for one in found]), joined, np.concatenate([one[2] for one in found])


def _sun_torque(reducer: Reducer, by: _Coefficients, sliding: Sliding, slid: Tangent) -> Array:
    """Torque that the input puts on the sun, counter-clockwise."""
    base = reducer.sun_pitch_radius * math.cos(reducer.pressure_angle)
    lever = np.tile([base, -base], reducer.cranks)
    return np.asarray((slid.flank_force * (lever - by.flank * np.sign(sliding.flank))).sum(axis=1))


def _friction(rows: _Rows, by: _Coefficients, sliding: Sliding, slid: Tangent) -> tuple[Array, Array]:
    """Forces of friction on the parts, (n, size), and their change with the pose, (n, size, size)."""
    contacts = slid.contacts
    first = Layout(contacts.motion.reducer).disc[0]
    n = len(slid.x)
    on_pin = -by.pin * np.sign(sliding.pin)[:, :, None] * rows.pin  # per unit of the pin's force
    on_joint = -(by.joint * np.sign(sliding.joint))[..., None] * rows.joint
    on_flank = -(by.flank * np.sign(sliding.flank))[..., None] * rows.flank
    size = np.sqrt((slid.joint_force**2).sum(axis=-1))
    along = slid.joint_force / np.where(size > 0, size, 1.0)[..., None]
    along[slid.joint_pressed > size] = 0.0  # what one side of a preloaded bearing gains the other loses
    force = (slid.joint_pressed[:, None] @ on_joint + slid.flank_force[:, None] @ on_flank)[:, 0]
    on_discs = np.einsum("nki,nkci->nkc", slid.pin_force, on_pin)
    force[:, first : first + on_discs[0].size] += on_discs.reshape(n, -1)
    by_joint = np.einsum("nqa,nqab,nqbd->nqd", along, slid.joint, contacts.joint_rows)
    change = np.swapaxes(on_joint, 1, 2) @ by_joint
    change += np.swapaxes(on_flank, 1, 2) @ (slid.flank[..., None] * contacts.flank_rows)
    blocks = np.einsum("nki,nkbi,nkci->nkbc", slid.pin, on_pin, contacts.pin_rows)
    return force, with_discs(change, blocks, first)


def _slid(settled: Settled, by: _Coefficients, sliding: Sliding) -> Tangent:
    """Pose and forces with friction, from those without, by Newton steps on the balance.

    Where a bearing slides along the rim of its clearance, or flanks change sides, these may go astray; there friction
    is a load of the last pose until it changes no more.
    """
    contacts, problem, reducer = settled.contacts, settled.problem, settled.reducer
    rows, sense = _rows(contacts.motion), contacts.motion.sense
    own = np.abs(problem.load[:, 2])

    def balance(x: Array) -> tuple[Tangent, Array, Array, Array]:
        """State, what is out of balance, its change with the pose, and what may be left."""
        state = settled.at(x)
        slid, forces = state.tangent(), state.forces
        force, change = _friction(rows, by, sliding, slid)
        if reducer.output == "housing":  # the carrier bears what the housing and the sun put on it
            force[:, 2] += sense * own / float(reducer.exact_carrier_ratio) - _sun_torque(reducer, by, sliding, slid)
        left = forces.gradient - force
        return slid, left, state.matrix - change, np.maximum(problem.tolerance, forces.unbalanced)

    x, found = settled.x, balance(settled.x)
    worst = np.abs(found[1]).max(axis=1)
    for _ in range(_MOST_STEPS):
        if (worst <= found[3]).all():
            break
        step, length = -refined(found[2], found[1]), np.ones((len(x), 1))
        for _ in range(_MOST_HALVINGS):
            ahead = balance(x + length * step)
            left = np.abs(ahead[1]).max(axis=1)
            rising = left > np.maximum((1 - 1e-4 * length[:, 0]) * worst, ahead[3])
            if not rising.any():
                break
            length[rising] /= 2
        x, found, worst = x + length * step, ahead, left
    for _ in range(_MOST_ROUNDS):
        far = np.flatnonzero(worst > found[3])
        if not far.size:
            break
        # what is out of balance beside the energy's slope is friction: as a load it leaves a pose of least energy
        loads = problem.load[far] + settled.at(x).forces.gradient[far] - found[1][far]
        x = x.copy()
        x[far] = solve(part_of(problem, far)._replace(load=loads), near=x[far]).x
        found = balance(x)
        worst = np.abs(found[1]).max(axis=1)
    bad = worst > found[3]
    if bad.any():
        where = ", ".join(f"{math.degrees(a):.4g}" for a in contacts.motion.theta[bad][:5])
        raise NotConvergedError(
            f"forces and friction do not balance at {bad.sum()} of {bad.size} angles (theta = {where} deg ...): the "
            "parts wedge; use smaller coefficients of friction"
        )
    return found[0]
