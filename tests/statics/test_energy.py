"""The equilibrium against an energy written down anew: least energy, balance, virtual work, limits and extremes.

`Train` shares nothing with the package but the numbers of a `Reducer`, and reads errors through the independent model
of `oracle`.  It knows where discs, cams, bores, pins and planets are, moves each as a rigid body, to first order, and
takes from it how far every contact closes.  Normals of pins are perpendicular to the sliding of the nominal motion,
lines of action are tangents of the base circles.  Plane vectors are complex numbers.

Rounding.  A solver that divides by a stiffness matrix K leaves forces out of balance by some eps size |K| |x| (the
backward error of Gaussian elimination); `Train.unbalanced` adds to that the documented 1e-9 of the load.  Where a
statement holds beyond that, one Newton step with the matrix of this file takes the rest out first (`settled`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import Phase, assume, given, reject, settings, strategies as st

import rverror
from oracle import Errors, put
from rverror.model.catalogue import source
from rverror.model.compose import source_matrix
from rverror.model.effects import Effect
from rverror.statics.loaded_state import Equilibrium, NotConvergedError
from strategies import reducers, variant

#: Seeds of random arrays do not shrink to anything simpler, and trying takes minutes.
SEEDED = settings(phases=[Phase.explicit, Phase.reuse, Phase.generate])
ARCSEC = math.pi / 180 / 3600
EPS = float(np.finfo(np.float64).eps)
SHARE = 1e-9  # of the load at the crank circle, which convergence leaves out of balance
#: Golden-ratio steps: irregular against every order, and the same each time.
ANGLES = 2 * np.pi * np.mod(0.05 + 0.6180339887 * np.arange(12), 1)

Array = np.ndarray


def along(a: Array, b: Array) -> Array:
    """Scalar product of plane vectors."""
    return np.asarray((np.conj(a) * b).real)


def moment(arm: Array, force: Array) -> Array:
    return np.asarray((np.conj(arm) * force).imag)


def plane(vectors: Array) -> Array:
    """Vectors (..., 2, n) as complex numbers with the angles first."""
    return np.moveaxis(vectors[..., 0, :] + 1j * vectors[..., 1, :], -1, 0)


def waves(coefficients: Array, angle: Array) -> Array:
    """Sum of c cos(h angle) + s sin(h angle); coefficients c - i s, harmonics on the last axis."""
    h = np.arange(coefficients.shape[-1])
    return np.asarray((coefficients * np.exp(1j * h * angle[..., None])).real.sum(axis=-1))


def beside(*parts: Array, lead: tuple[int, ...]) -> Array:
    return np.concatenate([np.broadcast_to(p, (*lead, *p.shape[len(lead) :])).reshape(*lead, -1) for p in parts], -1)


class Train:
    """Energy of a loaded gear train at n angles over poses (..., n, unknowns).

    Unknowns are x, y and angle of carrier, discs and cranks, x and y of the sun.  Contacts come in two rows: those that
    only push (pins by disc, then two flanks by crank) and bearings (cams by disc, carrier bores, main bearing, sun
    support), whose gap counts beyond its clearance in any direction.
    """

    def __init__(self, model: rverror.Model, theta: Array, *, sense: Array | float, torque: float) -> None:
        unit = self.unit = model.mechanism
        assert isinstance(unit, rverror.Reducer)
        self.theta, self.torque, n = theta, torque, theta.size
        self.sense = np.broadcast_to(np.asarray(sense, float), theta.shape)
        errors, clearance = Errors(unit, 1), {"crank": 0.0, "coupling": 0.0}
        for effect in model.effects:
            family, name = effect.key.split(".")
            if name == "bearing_clearance":
                clearance[family] += effect.values[0]
                continue
            for parameter, size in zip(source(effect.key).parameters, effect.values, strict=True):
                put(errors, unit, 0, (effect.key, dict(effect.indices), parameter.name), size)

        # where everything is; axes angle, (disc, crank or pin)
        lean = theta[:, None]
        crank_turn = -unit.disc_lobes * lean  # a disc turns back by 1/z_c of what its centre goes round
        aside = np.exp(1j * (crank_turn + 2 * np.pi * np.arange(unit.discs) / unit.discs))
        self.eccentric = unit.eccentricity * aside  # of discs from the housing's axis, of cams from the crank's
        place = np.exp(1j * (lean + 2 * np.pi * np.arange(unit.cranks) / unit.cranks))
        self.axis = unit.crank_radius * place  # of cranks in the housing, of bores on discs and carrier

        # pins: the normal is perpendicular to the sliding of the nominal motion, and points inwards
        self.pin = unit.pin_circle_radius * np.exp(2j * np.pi * np.arange(unit.pins) / unit.pins)
        to_pin = self.pin - self.eccentric[..., None]
        sliding = -1j * unit.disc_lobes * self.eccentric[..., None] + 1j * to_pin  # of the disc there, per unit theta
        normal = 1j * sliding / abs(sliding)
        self.normal = np.where(along(self.pin, normal) < 0, normal, -normal)
        self.on_disc = to_pin + unit.pin_radius * self.normal
        psi = np.angle(self.on_disc) - lean[..., None]
        centre = errors.pin_centre[0] + errors.pins_at_disc[0][:, None]
        pin = along(self.normal, centre) + errors.pin_radius[0] + waves(errors.profile[0][:, None], psi)
        ahead = 1j * self.on_disc / abs(self.on_disc)
        pin = pin - waves(errors.flanks[0][:, None], psi) * along(self.normal, ahead)

        # planets: on the line that touches both base circles, for the flank that drives forward and the other
        self.flank = flank = np.array([1, -1])
        alpha = unit.pressure_angle
        sun_base, base = (unit.module * z / 2 * math.cos(alpha) for z in (unit.sun_teeth, unit.planet_teeth))
        self.sun_base, lowered = sun_base, place[..., None] * np.exp(-1j * flank * alpha)
        self.foot = -base * lowered  # from the planet's axis
        line = self.axis[..., None] + self.foot - sun_base * lowered
        self.line = line / abs(line)
        self.ratio = 1 + unit.planet_teeth / unit.sun_teeth * unit.pins
        carrier, planet, sun = (np.exp(1j * turn) for turn in (lean, crank_turn, self.ratio * lean))
        planet_off = errors.planet_axis[0] * carrier + errors.planet_toothing[0] * planet
        sun_off = errors.sun_axis[0] + errors.sun_toothing[0] * sun
        late = errors.lead[0][:, None] + flank * errors.spline_play[0][:, None] / 2  # planet behind its crank
        mesh = along(self.line, (sun_off - planet_off)[..., None] + 1j * self.foot * late)
        mesh = mesh - (unit.gear_backlash + math.cos(alpha) * errors.thinning[0]) / 2

        cam = errors.disc_bore[0] * carrier[..., None] - errors.cam[0] * aside[..., None]
        bore = -errors.carrier_bore[0] * carrier
        cams, k = unit.discs * unit.cranks, unit.stiffness
        self.push_stiffness = np.repeat([k.pin_contact, k.gear_mesh], [unit.discs * unit.pins, 2 * unit.cranks])
        counts = [cams, unit.cranks, 1, 1]
        self.pull_stiffness = np.repeat([k.crank_bearing, k.carrier_bearing, k.main_bearing, k.sun_support], counts)
        self.clearance = np.repeat([clearance["crank"], clearance["coupling"], 0.0, 0.0], counts)
        self.push_error = beside(pin, mesh, lead=(n,))
        self.pull_error = beside(cam, bore, np.zeros((n, 2)), lead=(n,))
        self.unknowns = 3 + 3 * unit.discs + 3 * unit.cranks + 2
        units = np.broadcast_to(np.eye(self.unknowns)[:, None], (self.unknowns, n, self.unknowns))
        self.push_rows, self.pull_rows = (np.moveaxis(rows, 0, -1) for rows in self.moved(units))

    def moved(self, x: Array) -> tuple[Array, Array]:
        """How far the contacts close, and what gaps open in bearings, as the parts move to first order."""
        body = x[..., :-2].reshape(*x.shape[:-1], -1, 3)
        shift, turn = body[..., 0] + 1j * body[..., 1], 1j * body[..., 2]
        sun = x[..., -2, None] + 1j * x[..., -1, None]
        disc, crank = slice(1, 1 + self.unit.discs), slice(1 + self.unit.discs, None)
        at_pin = shift[..., disc, None] + turn[..., disc, None] * self.on_disc
        at_flank = shift[..., crank, None] + turn[..., crank, None] * self.foot
        bore = shift[..., disc, None] + turn[..., disc, None] * self.axis[:, None]
        cam = shift[..., None, crank] + turn[..., None, crank] * self.eccentric[..., None]
        on_carrier = shift[..., :1] + turn[..., :1] * self.axis
        push = beside(-along(self.normal, at_pin), along(self.line, sun[..., None] - at_flank), lead=x.shape[:-1])
        return push, beside(bore - cam, shift[..., crank] - on_carrier, shift[..., :1], sun, lead=x.shape[:-1])

    def nominal_motion(self) -> Array:
        """Motion of all parts per unit of output turn, (n, unknowns)."""
        n, discs, cranks = self.sense.size, self.unit.discs, self.unit.cranks
        centre = np.concatenate([np.zeros((n, 1)), -1j * self.unit.disc_lobes * self.eccentric, 1j * self.axis], axis=1)
        turn = np.repeat([1.0, 1.0, -self.unit.disc_lobes], [1, discs, cranks])
        body = np.stack([centre.real, centre.imag, np.broadcast_to(turn, centre.shape)], axis=-1)
        return np.concatenate([body.reshape(n, -1), np.zeros((n, 2))], axis=1)

    def closing(self, x: Array) -> tuple[Array, Array]:
        push, pull = self.moved(x)
        return push + self.push_error, pull + self.pull_error

    def forces(self, x: Array) -> tuple[Array, Array]:
        """Size of those that push; vectors of the bearings."""
        push, pull = self.closing(x)
        distance = abs(pull)
        share = np.maximum(distance - self.clearance, 0) / np.where(distance > 0, distance, 1)
        return self.push_stiffness * np.maximum(push, 0), self.pull_stiffness * share * pull

    def energy(self, x: Array) -> Array:
        """Springs, and the load, which turns the carrier back."""
        push, pull = self.closing(x)
        squares = (self.push_stiffness * np.maximum(push, 0) ** 2).sum(axis=-1)
        squares = squares + (self.pull_stiffness * np.maximum(abs(pull) - self.clearance, 0) ** 2).sum(axis=-1)
        return np.asarray(squares / 2 + self.sense * self.torque * x[..., 2])

    def change(self, x: Array, step: Array) -> tuple[Array, Array]:
        """What a step adds to the energy, and what rounding can hide of it.

        Each spring's share is k/2 (p1 - p0) (p1 + p0): differences are taken where nothing cancels.
        """

        def springs(stiffness: Array, before: Array, after: Array, difference: Array) -> Array:
            both = (before > 0) & (after > 0)
            before, after = np.maximum(before, 0), np.maximum(after, 0)
            return stiffness / 2 * np.where(both, difference, after - before) * (after + before)

        (push, pull), (closer, further) = self.closing(x), self.moved(step)
        there = pull + further
        total = abs(pull) + abs(there)
        longer = (2 * along(pull, further) + abs(further) ** 2) / np.where(total > 0, total, 1)
        parts = [
            springs(self.push_stiffness, push, push + closer, closer),
            springs(self.pull_stiffness, abs(pull) - self.clearance, abs(there) - self.clearance, longer),
            (self.sense * self.torque * step[..., 2])[..., None],
        ]
        # closings are sums of positions times angles and of errors; a step is as exact as its own sum
        lengths = np.abs(self.push_rows) @ np.abs(x)[..., None], np.abs(self.pull_rows) @ np.abs(x)[..., None]
        steps = np.abs(self.push_rows) @ np.abs(step)[..., None], np.abs(self.pull_rows) @ np.abs(step)[..., None]
        rounding = sum(abs(part).sum(axis=-1) for part in parts)
        for k, length, moved, error in zip(
            (self.push_stiffness, self.pull_stiffness),
            lengths,
            steps,
            (abs(self.push_error), abs(self.pull_error) + self.clearance),
            strict=True,
        ):
            rounding = rounding + (k * moved[..., 0] * (length[..., 0] + error + moved[..., 0])).sum(axis=-1)
        return sum(part.sum(axis=-1) for part in parts), 8 * EPS * rounding

    def closed(self, x: Array) -> Array:
        """Which pins and flanks carry."""
        return np.asarray(self.closing(x)[0] > 0)

    def touching(self, x: Array) -> Array:
        """Which contacts carry, bearings among them."""
        push, pull = self.closing(x)
        return np.concatenate([push > 0, abs(pull) > self.clearance], axis=-1)

    def gradient(self, x: Array, closed: Array | None = None) -> Array:
        """Forces and moments out of balance, with the pins and flanks held shut that are named, or those that carry."""
        push, pull = self.forces(x)
        if closed is not None:
            push = self.push_stiffness * closed * self.closing(x)[0]
        found = (push[..., None] * self.push_rows).sum(axis=-2)
        found += along(pull[..., None], self.pull_rows).sum(axis=-2)
        found[..., 2] += self.sense * self.torque
        return found

    def matrix(self, x: Array | None = None, closed: Array | None = None) -> Array:
        """Second derivative of the energy; without a pose, all contacts closed and all bearings without clearance."""
        push, share, across = np.ones(self.push_error.shape), np.ones(self.pull_error.shape), self.pull_rows
        if x is not None:
            pull = self.closing(x)[1]
            distance = np.where(abs(pull) > 0, abs(pull), 1)
            push = (self.closed(x) if closed is None else closed).astype(float)
            share = np.maximum(1 - self.clearance / distance, 0)
            across = (pull / distance)[..., None]
        held = np.swapaxes(self.push_rows, -1, -2) @ ((self.push_stiffness * push)[..., None] * self.push_rows)
        sprung = (self.pull_stiffness * share)[..., None] * self.pull_rows
        either = (np.conj(np.swapaxes(self.pull_rows, -1, -2)) @ sprung).real
        if x is None:
            return np.asarray(held + either)
        radial = along(across, self.pull_rows)
        pushed = (self.pull_stiffness * (share > 0) * (1 - share))[..., None] * radial
        return np.asarray(held + either + np.swapaxes(radial, -1, -2) @ pushed)

    def unbalanced(self, x: Array) -> Array:
        """What a converged pose may leave of each force and moment, (n,): see the head of this file."""
        size = np.abs(self.matrix()).sum(axis=-1).max(axis=-1)
        rounding = 8 * self.unknowns * EPS * size * np.abs(x).max(axis=-1)
        return np.asarray(np.maximum(SHARE * self.torque / self.unit.crank_radius, rounding))

    def settled(self, x: Array, closed: Array | None = None) -> Array:
        """The pose near `x` that leaves nothing out of balance while the pins and flanks that carry stay those.

        What no contact holds stays where it is.
        """
        closed = self.closed(x) if closed is None else closed
        best, least = x, np.abs(self.gradient(x, closed)).max(axis=1)
        for _ in range(3):
            matrix = self.matrix(x, closed)
            trace = 1e-14 * np.einsum("nii->ni", self.matrix())[..., None] * np.eye(self.unknowns)
            x = x - np.linalg.solve(matrix + trace, self.gradient(x, closed)[..., None])[..., 0]
            left = np.abs(self.gradient(x, closed)).max(axis=1)  # a journal that nothing presses may be thrown far
            best, least = np.where((left < least)[:, None], x, best), np.minimum(left, least)
        return best

    def rounding(self, x: Array) -> float:
        """What a force may round by: closings are lengths times angles, known to eps of all turns."""
        lengths = (np.abs(self.pull_rows) @ np.abs(x)[..., None]).max() + np.abs(self.push_error).max() + 0.01
        stiffest = max(self.push_stiffness.max(), self.pull_stiffness.max())
        return float(EPS * (16 + 2 * self.ratio * np.abs(self.theta).max()) * lengths * stiffest)


def flat(pose: Mapping[str, Array]) -> Array:
    """`Equilibrium.pose` in the order of `Train`, (n, unknowns)."""
    n = pose["sun"].shape[-1]
    return np.concatenate([pose[part].reshape(-1, n) for part in ("carrier", "disc", "crank", "sun")]).T


# --- random gear trains -------------------------------------------------------------------------------------------

KEYS = (
    "cycloid.pin_position",
    "cycloid.pin_radius",
    "cycloid.pin_circle",
    "cycloid.disc_profile",
    "cycloid.disc_pitch",
    "cycloid.disc_bore_position",
    "crank.eccentricity",
    "crank.index",
    "coupling.carrier_bore_position",
    "coupling.carrier_runout",
    "involute.planet_eccentricity",
    "involute.sun_eccentricity",
    "involute.sun_offset",
    "involute.center_distance",
    "involute.tooth_thinning",
    "involute.spline_clearance",
)


def random_effects(rng: np.random.Generator, unit: rverror.Reducer, *, count: int, size: float) -> list[rverror.Effect]:
    """Errors of many sources at random places, lengths and arcs at the eccentricity's radius up to `size`, mm."""
    effects = []
    for key in rng.choice(KEYS, count):
        entry, indices = source(key), {}
        for index in entry.indices:
            allowed = list(index.tried(unit))
            indices[index.name] = (
                min(3, chosen)
                if isinstance(chosen := allowed[rng.integers(len(allowed))], int) and index.name == "harmonic"
                else chosen
            )  # the oracle knows harmonics up to 3
        values = [
            rng.uniform(max(p.least, -1), 1) * (size / unit.eccentricity if p.dimension == "angle" else size)
            for p in entry.parameters
        ]
        # not as a user types it: at a small eccentricity such arcs are angles of which `rverror.effect` warns
        effects.append(Effect(str(key), indices, tuple(values)))
    return effects


def with_clearance(cam: float, carrier: float) -> list[rverror.Effect]:
    keys = {"crank.bearing_clearance": cam, "coupling.bearing_clearance": carrier}
    return [rverror.effect(key, clearance=size) for key, size in keys.items() if size > 0]


def rated(unit: rverror.Reducer) -> float:
    """Torque that a reducer of that size is made for: the RV-40E's, by the cube of the pin circle."""
    return 412e3 * (unit.pin_circle_radius / 64) ** 3


CONTACTS = ("pin_contact", "crank_bearing", "carrier_bearing", "gear_mesh", "main_bearing")
stiffnesses = st.builds(
    lambda k, sun: rverror.geartrain.Stiffness(**dict(zip(CONTACTS, k, strict=True)), sun_support=sun),
    st.tuples(*[st.floats(4, 7).map(lambda exponent: 10**exponent)] * 5),
    st.floats(1.5, 4).map(lambda exponent: 10**exponent),
)
clearances = st.one_of(st.just(0.0), st.floats(1e-4, 20e-3))


@st.composite
def models(draw: st.DrawFn, *, floating: bool = True) -> rverror.Model:
    unit = draw(reducers())
    unit = variant(unit, stiffness=draw(stiffnesses), gear_backlash=draw(st.sampled_from([0.0, 2e-3, 20e-3])))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    effects = random_effects(rng, unit, count=draw(st.integers(0, 12)), size=draw(st.floats(0, 20e-3)))
    play = with_clearance(draw(clearances), draw(clearances)) if floating else []
    return rverror.Model(unit, (*effects, *play))


seeds = st.integers(0, 2**32 - 1)


def drawn_load(rng: np.random.Generator, model: rverror.Model) -> float:
    """0.05 N*m to twice the rated torque."""
    assert isinstance(model.mechanism, rverror.Reducer)
    return float(np.exp(rng.uniform(math.log(50), math.log(2 * rated(model.mechanism)))))


def solved(model: rverror.Model, theta: Array, *, sense: Array | float, torque: float) -> Equilibrium:
    """The equilibrium; refusals pass where journals drift at less than a thousandth of the rated load, nowhere else."""
    try:
        return rverror.equilibrium(model, theta, torque=torque, direction=sense)
    except NotConvergedError:
        floating = any(effect.key.endswith("bearing_clearance") for effect in model.effects)
        if not floating or torque > 1e-3 * rated(model.mechanism):
            raise
        reject()


def solve(model: rverror.Model, theta: Array, *, sense: Array | float, torque: float) -> tuple[Train, Array]:
    """The energy, and the pose that the package finds."""
    state = solved(model, theta, sense=sense, torque=torque)
    return Train(model, theta, sense=sense, torque=torque), flat(state.pose)


# --- least energy -------------------------------------------------------------------------------------------------


def perturbations(rng: np.random.Generator, train: Train, x: Array) -> Array:
    """Steps (many, n, unknowns): random ones and single coordinates of all sizes, towards neighbours and to no load."""
    n, size = x.shape
    turns = np.ones(size)
    turns[2:-2:3] = 1 / train.unit.crank_radius
    directions = rng.normal(size=(24, n, size)) * turns
    directions[12:] *= rng.random((12, n, size)) < 0.2  # few parts at a time
    coordinates = np.repeat(np.eye(size) * turns, n, axis=0).reshape(size, n, size)
    lengths = 10.0 ** np.arange(-10, 0)
    random = directions * rng.choice(lengths, (24, 1, 1))
    single = [sign * length * coordinates for sign in (1, -1) for length in lengths[1::3]]
    to_next = np.roll(x, -1, axis=0) - x
    towards = [share * to for to in (to_next, -x) for share in (1.0, 0.1, 1e-3, -0.1)]
    return np.concatenate([random, *single, towards])


@settings(SEEDED, max_examples=30)
@given(model=models(), seed=seeds)
def test_no_perturbation_lowers_the_energy(model: rverror.Model, seed: int) -> None:
    rng = np.random.default_rng(seed)
    theta = rng.uniform(-7, 7) + np.array([0.0, 1e-3, 0.3, 0.31])
    train, x = solve(model, theta, sense=rng.choice([-1.0, 1.0], theta.size), torque=drawn_load(rng, model))
    steps = perturbations(rng, train, x)
    rise, rounding = train.change(x, steps)
    allowed = train.unbalanced(x) * np.abs(steps).sum(axis=-1) + rounding
    assert (rise >= -allowed).all(), (rise + allowed).min()


def test_the_energy_of_this_file_is_its_own_change() -> None:
    """What `change` writes without cancellation is the difference of two energies, for steps that rounding spares."""
    rng = np.random.default_rng(2)
    unit = rverror.reducer("RV-003")
    model = rverror.Model(unit, (*random_effects(rng, unit, count=8, size=5e-3), *with_clearance(5e-3, 3e-3)))
    train = Train(model, ANGLES, sense=1, torque=412e3)
    x = rng.normal(size=(ANGLES.size, train.unknowns)) * 1e-3
    for length in (1e-4, 1e-2):
        step = rng.normal(size=x.shape) * length
        change, _ = train.change(x, step)
        np.testing.assert_allclose(change, train.energy(x + step) - train.energy(x), rtol=1e-9)
        slope = (train.energy(x + 1e-6 * step) - train.energy(x - 1e-6 * step)) / 2e-6
        np.testing.assert_allclose((train.gradient(x) * step).sum(axis=-1), slope, rtol=1e-5)


# --- forces -------------------------------------------------------------------------------------------------------


@settings(SEEDED, max_examples=30)
@given(model=models(), seed=seeds)
def test_forces_are_stiffness_times_closing_and_balance(model: rverror.Model, seed: int) -> None:
    rng = np.random.default_rng(seed)
    theta = rng.uniform(-7, 7, 3)
    sense, torque = rng.choice([-1.0, 1.0], 3), drawn_load(rng, model)
    state = solved(model, theta, sense=sense, torque=torque)
    train, x = Train(model, theta, sense=sense, torque=torque), flat(state.pose)
    unit, found = train.unit, {key: force for key, force in state.contact_forces.items() if key != "spline"}
    np.testing.assert_array_equal(state.transmission_error, x[:, 2])

    push, pull = train.forces(x)
    pins = push[:, : unit.discs * unit.pins].reshape(train.normal.shape)
    flanks = push[:, unit.discs * unit.pins :].reshape(train.line.shape)
    cams = pull[:, : unit.discs * unit.cranks].reshape(-1, unit.discs, unit.cranks)
    bores = pull[:, unit.discs * unit.cranks : -2]
    rounding = train.rounding(x)
    for key, own in {
        "pin": pins * train.normal, "mesh": flanks * train.line, "cam": cams, "carrier": bores,
    }.items():  # fmt: skip
        np.testing.assert_allclose(plane(found[key]), own, rtol=1e-9, atol=rounding, err_msg=key)
    counted = (np.moveaxis(state.loaded_pins, -1, 0), (pins > rounding).sum(axis=-1), (pins > -rounding).sum(axis=-1))
    assert (counted[0] >= counted[1]).all()
    np.testing.assert_array_equal(state.loaded_pins, (np.abs(found["pin"]).sum(axis=-2) > 0).sum(axis=1))

    worst = np.abs(train.gradient(x)).max(axis=-1) * train.unit.crank_radius / torque
    blur = 100 * rounding * (1 + train.unit.crank_radius) * train.unit.crank_radius / torque
    np.testing.assert_allclose(state.residual, worst, rtol=1e-6, atol=blur)

    # every body, from the forces alone; the load turns the carrier back
    left = train.unbalanced(x)[:, None]
    pin, mesh, cam, carrier = (plane(found[key]) for key in ("pin", "mesh", "cam", "carrier"))
    spline = np.moveaxis(state.contact_forces["spline"][:, :, 0], -1, 0)
    main, sun = (pull[:, at] for at in (-2, -1))
    bodies = {
        "carrier": (carrier.sum(axis=1) - main, moment(train.axis, carrier).sum(axis=1) - sense * torque),
        "discs": (
            pin.sum(axis=2) - cam.sum(axis=2),
            moment(train.on_disc, pin).sum(axis=2) - moment(train.axis[:, None], cam).sum(axis=2),
        ),
        "cranks": (
            cam.sum(axis=1) + mesh.sum(axis=2) - carrier,
            moment(train.eccentric[..., None], cam).sum(axis=1) + spline.sum(axis=2),
        ),
        "sun": (mesh.sum(axis=(1, 2)) + sun, np.zeros(3)),
    }
    for body, (force, turning) in bodies.items():
        for what in (force.real, force.imag, turning):
            assert (np.abs(what) <= 1.01 * left.reshape(-1, *[1] * (what.ndim - 1)) + 100 * rounding).all(), body
    # a planet hands its crank what its teeth turn it by
    np.testing.assert_allclose(spline, moment(train.foot, mesh), rtol=1e-9, atol=100 * rounding)
    # the nominal motion opens and closes nothing, so whatever is in error, the sun takes 1/R of the torque
    motion = train.nominal_motion()
    turning = (train.flank * push[:, unit.discs * unit.pins :].reshape(train.line.shape)).sum(axis=(1, 2))
    allowed = left[:, 0] * np.abs(motion).sum(axis=-1) / train.ratio
    assert (np.abs(turning * train.sun_base - sense * torque / train.ratio) <= allowed).all()


@given(unit=reducers(), seed=seeds)
def test_the_nominal_motion_of_this_file_closes_nothing_but_the_meshes(unit: rverror.Reducer, seed: int) -> None:
    """Pins of both sides and all bearings let it pass; the held sun would have turned by R."""
    theta = np.random.default_rng(seed).uniform(-7, 7, 4)
    train = Train(rverror.Model(unit), theta, sense=1, torque=1.0)
    push, pull = train.moved(train.nominal_motion())
    pins = unit.discs * unit.pins
    small = {"rtol": 0, "atol": 1e-12 * unit.pin_circle_radius * unit.pins}
    np.testing.assert_allclose(push[:, :pins], 0, **small)
    np.testing.assert_allclose(pull[:, :-1], 0, **small)
    flanks = push[:, pins:].reshape(-1, unit.cranks, 2)
    expected = -train.sun_base * train.ratio * np.array([1, -1])
    np.testing.assert_allclose(flanks, np.broadcast_to(expected, flanks.shape), **small)


# --- virtual work -------------------------------------------------------------------------------------------------


@settings(SEEDED, max_examples=30)
@given(model=models(floating=False), seed=seeds)
def test_influence_is_contact_force_per_unit_torque(model: rverror.Model, seed: int) -> None:
    """Two torques a hundredth apart at which the same contacts are closed: between them everything is linear."""
    rng = np.random.default_rng(seed)
    theta, sense = rng.uniform(-7, 7, 6), rng.choice([-1.0, 1.0], 6)
    torque = rng.uniform(0.3, 1.5) * rated(model.mechanism)
    loaded = rverror.statics.linearise(model, theta, torque=torque, direction=sense)
    forces, touching = [], []
    for load in (torque, 1.01 * torque):
        train = Train(model, theta, sense=sense, torque=load)
        x = train.settled(flat(loaded.state.pose))
        forces.append(train.forces(x))
        touching.append(train.touching(x))
    same = (touching[0] == touching[1]).all(axis=-1)
    assume(same.any())
    push, pull = ((after - before) / (0.01 * torque * sense)[:, None] for before, after in zip(*forces, strict=True))
    rounding = train.rounding(x) / (0.01 * torque)
    unit, pins, cams = train.unit, train.normal[0].size, train.axis[0].size * train.eccentric[0].size
    expected = {
        "pin": push[:, :pins].reshape(train.normal.shape) * train.normal,
        "mesh": push[:, pins:].reshape(train.line.shape) * train.line,
        "cam": pull[:, :cams].reshape(-1, unit.discs, unit.cranks),
        "carrier": pull[:, cams:-2],
    }
    for key, per_torque in expected.items():
        found, size = plane(loaded.forces[key]), abs(per_torque[same]).max()
        np.testing.assert_allclose(found[same], per_torque[same], rtol=0, atol=1e-9 * size + rounding, err_msg=key)
    spline = np.moveaxis(loaded.forces["spline"][:, :, 0], -1, 0)
    taken = moment(train.foot, expected["mesh"])
    limit = 1e-9 * abs(taken[same]).max() + rounding * abs(train.foot).max()
    np.testing.assert_allclose(spline[same], taken[same], rtol=0, atol=limit)


def slopes(
    model: rverror.Model, effect: rverror.Effect, theta: Array, *, sense: Array, torque: float, near: Array, step: float
) -> tuple[Array, Array]:
    """Central differences of the output over each parameter (terms, n), and where the same contacts stay closed.

    `step` is a length; angles take it at the crank circle.
    """
    train = Train(model, theta, sense=sense, torque=torque)
    settled = train.settled(near)
    closed, touching, found = train.closed(near), train.touching(settled), []
    same = (touching == train.touching(near)).all(axis=-1)
    for at, parameter in enumerate(source(effect.key).parameters):
        size = step / train.unit.crank_radius if parameter.dimension == "angle" else step
        output = []
        for moved in (size, -size):
            values = tuple(moved if i == at else 0.0 for i in range(len(effect.values)))
            train = Train(model.with_effects(replace(effect, values=values)), theta, sense=sense, torque=torque)
            x = train.settled(near, closed)
            output.append(x[:, 2])
            same &= (train.touching(x) == touching).all(axis=-1)
        found.append((output[0] - output[1]) / (2 * size))
    return np.array(found), same


@settings(SEEDED, max_examples=30)
@given(model=models(floating=False), seed=seeds)
def test_influence_is_the_derivative_of_the_output(model: rverror.Model, seed: int) -> None:
    """Exact for finite errors while no contact opens or closes; the output rounds by a few digits."""
    rng = np.random.default_rng(seed)
    theta, sense = rng.uniform(-7, 7, 4), rng.choice([-1.0, 1.0], 4)
    torque = rng.uniform(0.3, 1.5) * rated(model.mechanism)
    loaded = rverror.statics.linearise(model, theta, torque=torque, direction=sense)
    (effect,) = random_effects(rng, model.mechanism, count=1, size=0.02)
    matrix = source_matrix(loaded.motion, loaded.forces, effect.key, effect.indices)
    near = flat(loaded.state.pose)
    found, same = slopes(model, effect, theta, sense=sense, torque=torque, near=near, step=1e-4)
    assume(same.any())
    limit = 1e-8 * abs(matrix).max() + 8 * EPS * abs(near).max() / 1e-4
    np.testing.assert_allclose(matrix[:, same], found[:, same], rtol=0, atol=limit, err_msg=effect.key)


@pytest.mark.parametrize("name", ["RV-40E", "RV-003"])
def test_influence_is_the_derivative_at_a_finite_clearance(name: str) -> None:
    """Journals turn about their bearings: a step of 0.1 nm on 5 um of clearance leaves (2e-5)^2, and rounding 1e-8."""
    unit, rng = rverror.reducer(name), np.random.default_rng(5)
    model = rverror.Model(unit, (*random_effects(rng, unit, count=6, size=2e-3), *with_clearance(5e-3, 8e-3)))
    sense = np.where(np.arange(ANGLES.size) % 2, 1.0, -1.0)
    loaded = rverror.statics.linearise(model, ANGLES, torque=100e3, direction=sense)
    for effect in random_effects(rng, unit, count=12, size=0.02):
        matrix = source_matrix(loaded.motion, loaded.forces, effect.key, effect.indices)
        near = flat(loaded.state.pose)
        found, same = slopes(model, effect, ANGLES, sense=sense, torque=100e3, near=near, step=1e-7)
        assert same.sum() > 9
        limit = 1e-6 * abs(matrix).max() + 1e-9
        np.testing.assert_allclose(matrix[:, same], found[:, same], rtol=0, atol=limit, err_msg=effect.key)


# --- rows that hold at any stiffness, any load and any errors beside them ---------------------------------------------


def exact_rows(unit: rverror.Reducer) -> dict[str, tuple[list[rverror.Effect], float]]:
    """Errors of one size at all of their places, and the change of output that they make, rad; from teeth and radii.

    Each is what the nominal motion of the gear train, and a turn of one part against the others, makes up for: pins of
    both sides, flanks of both sides and bearings with or without clearance close as before.
    """
    gears, size = unit.planet_teeth / unit.sun_teeth, 5e-3
    ratio = 1 + gears * unit.pins
    cranks, discs, r6 = range(unit.cranks), range(unit.discs), unit.module * (unit.sun_teeth + unit.planet_teeth) / 2
    lead, effect = 1e-3, rverror.effect
    return {
        "cams ahead of their cranks": (
            [effect("crank.eccentricity", crank=j, disc=k, tangential=size) for j in cranks for k in discs],
            -gears / ratio * size / unit.eccentricity,
        ),
        "disc bores ahead": (
            [effect("cycloid.disc_bore_position", crank=j, disc=k, tangential=size) for j in cranks for k in discs],
            unit.disc_lobes * gears / ratio * size / r6,
        ),
        "carrier bores ahead": (
            [effect("coupling.carrier_bore_position", crank=j, tangential=size) for j in cranks],
            -size / r6,
        ),
        "cranks ahead of their planets": (
            [effect("crank.index", crank=j, angle=lead) for j in cranks],
            -gears / ratio * lead,
        ),
        "pin ring turned": (
            [effect("cycloid.pin_circle", harmonic=0, tangential_cos=size)],
            (ratio - 1) / ratio * size / unit.pin_circle_radius,
        ),
    }


@settings(SEEDED, max_examples=30)
@given(model=models(), seed=seeds)
def test_exact_rows_are_influences_to_1e_9(model: rverror.Model, seed: int) -> None:
    rng = np.random.default_rng(seed)
    theta, sense = rng.uniform(-7, 7, 4), rng.choice([-1.0, 1.0], 4)
    torque = rng.uniform(0.01, 1.5) * rated(model.mechanism)
    loaded = rverror.statics.linearise(model, theta, torque=torque, direction=sense)
    for what, (effects, expected) in exact_rows(model.mechanism).items():
        total = sum(np.array(e.values) @ source_matrix(loaded.motion, loaded.forces, e.key, e.indices) for e in effects)
        np.testing.assert_allclose(total, expected, rtol=1e-9, err_msg=what)


@settings(SEEDED, max_examples=30)
@given(model=models(), seed=seeds)
def test_exact_rows_hold_for_finite_errors_under_load(model: rverror.Model, seed: int) -> None:
    """5 um, beside other errors, at any load: the change of a solved pose, and none of any force."""
    rng = np.random.default_rng(seed)
    theta, sense = rng.uniform(-7, 7, 2), rng.choice([-1.0, 1.0], 2)
    torque = rng.uniform(0.1, 1.5) * rated(model.mechanism)
    train, x = solve(model, theta, sense=sense, torque=torque)
    clean, forces = train.settled(x)[:, 2], train.forces(train.settled(x))
    for what, (effects, expected) in exact_rows(model.mechanism).items():
        train, x = solve(model.with_effects(*effects), theta, sense=sense, torque=torque)
        settled = train.settled(x)
        np.testing.assert_allclose(settled[:, 2] - clean, expected, rtol=1e-9, atol=1e-9 * abs(clean).max())
        for before, now in zip(forces, train.forces(settled), strict=True):
            np.testing.assert_allclose(now, before, rtol=0, atol=1e-8 * abs(before).max(), err_msg=what)


@pytest.mark.parametrize("torque", [412e3, 20e3])
@pytest.mark.parametrize("clearance", [0.0, 5e-3])
def test_exact_rows_of_the_rv_40e(torque: float, clearance: float) -> None:
    """Published for 5 um, arcsec, as `equilibrium` returns them at the loads of the published units."""
    unit = rverror.reducer("RV-40E")
    base = rverror.Model(unit, tuple(with_clearance(clearance, clearance)))
    published = {
        "cams ahead of their cranks": -20.456, "disc bores ahead": 36.934, "carrier bores ahead": -38.197,
    }  # fmt: skip
    for sense in (1, -1):
        clean = rverror.equilibrium(base, ANGLES, torque=torque, direction=sense).transmission_error
        for what, (effects, expected) in exact_rows(unit).items():
            model = base.with_effects(*effects)
            found = rverror.equilibrium(model, ANGLES, torque=torque, direction=sense).transmission_error - clean
            # 1e-9 of the load may be out of balance, at two poses
            np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-8 * abs(clean).max(), err_msg=what)
            if what in published:
                assert found / ARCSEC == pytest.approx(published[what], abs=6e-4)


def test_rows_that_need_symmetry_or_open_flanks() -> None:
    """RV-40E: half a turn puts each disc where the other was, so both carry alike whatever the stiffness.

    Harmonic 1 on both discs then cancels, and one mesh of two passes on half of its error; thinner teeth turn the sun
    back by half of what they lost, where the other flanks are open.
    """
    gears = 27 / 9
    mesh = gears / (121 * 2 * 20.25)  # per mm along the pitch circle; over cos(alpha) along the line of action
    rng = np.random.default_rng(3)
    for k in 10 ** rng.uniform(4, 7, (6, 5)):
        stiffness = rverror.geartrain.Stiffness(**dict(zip(CONTACTS, k.tolist(), strict=True)))
        unit = rverror.reducer("RV-40E", stiffness=stiffness)
        for sense in (1, -1):
            loaded = rverror.statics.linearise(rverror.Model(unit), ANGLES, torque=412e3, direction=sense)

            def per_mm(key: str, loaded: rverror.statics.Linearisation = loaded, **indices: Any) -> Array:
                return source_matrix(loaded.motion, loaded.forces, key, indices)

            for key in ("cycloid.disc_profile", "cycloid.disc_pitch"):
                one, other = (per_mm(key, disc=disc, harmonic=1) for disc in (0, 1))
                assert abs(one).max() > 1e-3
                np.testing.assert_allclose(one + other, 0, atol=1e-9 * abs(one).max(), err_msg=key)
            # an axis ahead by e opens the flank that drives forward by e cos(alpha)
            np.testing.assert_allclose(per_mm("involute.center_distance", crank=0)[1], -mesh, rtol=1e-9)
            thinner = per_mm("involute.tooth_thinning", member="sun")[0]
            np.testing.assert_allclose(thinner, -sense / (2 * 6.75 * 121), rtol=1e-9)
    assert mesh * 5e-3 / math.cos(math.radians(20)) / ARCSEC == pytest.approx(0.672, abs=1e-3)


# --- no load ------------------------------------------------------------------------------------------------------


def trains_without_load() -> dict[str, rverror.Model]:
    """Free units turn from stop to stop in their play; preloaded ones stand firm without any torque."""
    rng = np.random.default_rng(4)
    free = rverror.reducer("RV-40E")
    drawn_back = [
        rverror.effect("cycloid.pin_position", pin=i, radial=float(size))
        for i, size in enumerate(rng.uniform(1e-3, 20e-3, free.pins))
    ]
    tight = rverror.reducer("RV-003", gear_backlash=2e-3)
    bores = [
        rverror.effect("coupling.carrier_bore_position", crank=j, tangential=float(size))
        for j, size in enumerate((15e-3, -12e-3, 9e-3))
    ]
    return {
        "nothing": rverror.Model(free),
        "free": rverror.Model(free, tuple(drawn_back)),
        "preloaded": rverror.Model(tight, tuple(bores)),
        "one disc": rverror.Model(rverror.reducer("RV-003", discs=1), tuple(bores)),
    }


@pytest.mark.parametrize("clearance", [0.0, 5e-3], ids=["", "clearance"])
@pytest.mark.parametrize("name", ["nothing", "free", "preloaded", "one disc"])
def test_no_load_is_the_limit_of_falling_loads(name: str, clearance: float) -> None:
    """Output at 2, 1 and 0.5 N*mm, continued to 0 by a parabola: a straight line but for journals that turn."""
    model = trains_without_load()[name].with_effects(*with_clearance(clearance, 1.3 * clearance))
    theta = ANGLES[6:10]
    for sense in (1, -1):
        row = [
            rverror.equilibrium(model, theta, torque=load, direction=sense).transmission_error / ARCSEC
            for load in (2.0, 1.0, 0.5)
        ]
        assert (abs(row[0] - 3 * row[1] + 2 * row[2]) < 1e-4).all(), "loads too heavy to see the limit"
        limit = (row[0] - 6 * row[1] + 8 * row[2]) / 3
        found = rverror.equilibrium(model, theta, torque=0, direction=sense).transmission_error / ARCSEC
        np.testing.assert_allclose(found, limit, rtol=0, atol=1e-3)


def test_the_limit_of_no_load_is_a_state_of_no_load() -> None:
    """Without torque nothing may be out of balance either: the share of a trace of load that convergence leaves."""
    for name, model in trains_without_load().items():
        train, x = solve(model, ANGLES[:4], sense=1, torque=0.0)
        left = np.abs(train.gradient(x)).max(axis=-1)
        assert (left <= train.unbalanced(x)).all(), name


# --- extremes -----------------------------------------------------------------------------------------------------


def many_errors(unit: rverror.Reducer, rng: np.random.Generator, size: float) -> list[rverror.Effect]:
    """Every bore, cam and pin, normally spread."""
    places: list[tuple[str, dict[str, int]]] = [("cycloid.pin_position", {"pin": i}) for i in range(unit.pins)]
    for j in range(unit.cranks):
        places.append(("coupling.carrier_bore_position", {"crank": j}))
        for k in range(unit.discs):
            places += [(key, {"crank": j, "disc": k}) for key in ("crank.eccentricity", "cycloid.disc_bore_position")]
    return [
        rverror.effect(key, **indices, radial=radial, tangential=tangential)
        for (key, indices), (radial, tangential) in zip(places, rng.normal(size=(len(places), 2)) * size, strict=True)
    ]


EXTREME = {
    "RV-40E": ("RV-40E", {}),
    "one disc": ("RV-003", {"discs": 1}),
    "four cranks": ("RV-40E", {"cranks": 4}),
    "three discs": ("RV-003", {"discs": 3}),
    "four of both": ("RV-40E", {"cranks": 4, "discs": 4}),
}


@pytest.mark.parametrize("name", EXTREME)
def test_extreme_inputs_are_solved_or_refused_in_words(name: str) -> None:
    preset, changes = EXTREME[name]
    unit, theta = rverror.reducer(preset, **changes), ANGLES[:2]
    rng, sense, refused = np.random.default_rng(6), 1, list[str]()
    for size in (0.0, 50e-3):
        errors = many_errors(unit, rng, size) if size else []
        for clearance in (0.0, 100e-3):
            model = rverror.Model(unit, (*errors, *with_clearance(clearance, clearance)))
            for torque in (0.0, 1e3, 412e3, 2e6):
                sense = -sense if torque else sense
                try:
                    state = rverror.equilibrium(model, theta, torque=torque, direction=sense)
                except NotConvergedError as refusal:
                    refused.append(str(refusal))
                    continue
                train, x = Train(model, theta, sense=sense, torque=torque), flat(state.pose)
                assert np.isfinite(x).all()
                if torque:
                    left = np.abs(train.gradient(x)).max(axis=-1)
                    assert (left <= train.unbalanced(x)).all(), (size, clearance, torque)
                assert abs(state.transmission_error).max() < 0.02
    assert all("theta = " in words for words in refused)
    assert len(refused) <= 1, "refusals must stay the exception"


# --- which angles are solved together -----------------------------------------------------------------------------


@pytest.mark.parametrize("clearance", [0.0, 5e-3], ids=["", "clearance"])
def test_company_does_not_matter(clearance: float) -> None:
    """1100 angles at once, both ways, cross the border of what is solved together; some of them shuffled, and alone."""
    unit, rng = rverror.reducer("RV-40E"), np.random.default_rng(7)
    model = rverror.Model(
        unit, (*random_effects(rng, unit, count=10, size=5e-3), *with_clearance(clearance, clearance))
    )
    theta = np.sort(rng.uniform(0, 2 * np.pi, 1100))
    sense = rng.choice([-1.0, 1.0], theta.size)
    torque = 20e3
    whole = rverror.statics.linearise(model, theta, torque=torque, direction=sense)
    chosen = np.concatenate([rng.choice(theta.size, 6), [1022, 1023, 1024, 1025, 0, -1]])
    rng.shuffle(chosen)
    train = Train(model, theta[chosen], sense=sense[chosen], torque=torque)
    x = flat(whole.state.pose)[chosen]
    # what may be out of balance in both poses displaces them by no more than this
    allowed = 2 * np.abs(np.linalg.inv(train.matrix(train.settled(x)))).sum(axis=-1) * train.unbalanced(x)[:, None]
    shuffled = rverror.statics.linearise(model, theta[chosen], torque=torque, direction=sense[chosen])
    assert (abs(flat(shuffled.state.pose) - x) <= allowed).all()
    assert allowed[:, 2].max() < 1e-4 * ARCSEC
    for key, force in whole.forces.items():
        size = abs(force).max()
        np.testing.assert_allclose(shuffled.forces[key], force[..., chosen], rtol=0, atol=1e-4 * size, err_msg=key)
    for i, at in enumerate(chosen):
        alone = rverror.equilibrium(
            model, theta[at : at + 1] if at >= 0 else theta[at:], torque=torque, direction=sense[at]
        )
        assert (abs(flat(alone.pose)[0] - x[i]) <= allowed[i]).all()
        np.testing.assert_array_equal(alone.loaded_pins[:, 0], whole.state.loaded_pins[:, at])
