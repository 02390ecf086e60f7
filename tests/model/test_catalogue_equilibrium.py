"""The catalogue against the loaded equilibrium: the rigid limit, finite differences, random reducers, orders.

Every entry is covered by being in the catalogue.  Closed form and equilibrium share the error vectors of the sources,
so the first three statements are about forces, signs and projection; the vectors themselves, and what compliance makes
of them, are held against the independent model of `oracle`.
"""

from __future__ import annotations

import dataclasses
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

import rverror
from oracle import REALISTIC, Oracle
from oracle_cases import CASES as ORACLE_CASES
from rverror import CATALOGUE, Model, Reducer
from rverror.base.arrays import cross, dot, radial_and_tangential
from rverror.geartrain import Stiffness
from rverror.geartrain.action_line import Clearance, Compliance, ContactForces, Contacts, ErrorVector
from rverror.geartrain.contacts import closed_form_forces, pose
from rverror.geartrain.kinematics import OperatingConditions
from rverror.model.compose import source_matrix
from rverror.statics import Linearisation
from rverror.statics.prediction import predict
from strategies import Array, angles, in_phase_reducers, reducers, scaled, variant
from tried import index_sets, period_and_samples

PRESETS = pytest.mark.parametrize("name", ["RV-40E", "RV-003"])
SENSES = pytest.mark.parametrize("sense", [1, -1], ids=["forward", "reverse"])
#: What acts in a reducer.
#: Less the one that has no error of its own and turns all others, the windup's ripple too.
KEYS = [
    key
    for key, entry in CATALOGUE.items()
    if entry.applies_to(rverror.reducer("RV-40E")) and key != "sensor.index_offset"
]
#: Golden-ratio steps: irregular against every order, and the same each time.
ANGLES = 2 * np.pi * np.mod(0.05 + 0.6180339887 * np.arange(16), 1)
RATED = 412e3
#: Bearings 1e4 times as stiff as pins, carrier bearings 1e3 times stiffer still.
RIGID = Stiffness(
    pin_contact=2e5, crank_bearing=2e9, carrier_bearing=2e12, gear_mesh=2e8, sun_support=1e3, main_bearing=2e12
)
#: The same for clearances: a force in equal cams finds its share of the clearance only where that is less than the cams
#: give way, and in carrier bearings 1e7 times as stiff as the pins rounding leaves no digits of so small a difference.
RIGID_WITH_PLAY = dataclasses.replace(RIGID, crank_bearing=2e8, carrier_bearing=2e10, main_bearing=2e10)
SHARING = {"crank.bearing_compliance": "crank_bearing", "coupling.bearing_compliance": "carrier_bearing"}
#: Half of what is asked for.  What these stiffnesses leave is 2e-3 at the most: the cams of a crank, in parallel with a
#: carrier bearing 1e3 times as stiff, take that share of a separating force.
LIMIT = 5e-3


def rms(values: Array) -> Array:
    return np.asarray(np.sqrt(np.mean(values**2, axis=-1)))


def parts(motion: Contacts, key: str, indices: dict[str, Any]) -> tuple[ErrorVector | Clearance | Compliance, ...]:
    error = CATALOGUE[key].vector(motion, **indices)
    return error if isinstance(error, tuple) else (error,)


def uncancelled(motion: Contacts, forces: ContactForces, key: str, indices: dict[str, Any]) -> Array:
    """Size of each column were all its contacts to pull one way: zero is what is far below it."""
    total: Array = np.zeros((len(CATALOGUE[key].parameters), motion.theta.size))
    for part in parts(motion, key, indices):
        if isinstance(part, Clearance):
            force = forces[part.contact]
            total += np.sqrt(dot(force, force)).reshape(-1, motion.theta.size).sum(axis=0)
            continue
        force = forces[part.contact][part.at]
        if isinstance(part, Compliance):
            work = RATED * dot(force, force)
            axes = tuple(range(work.ndim - 1))
            total += [np.broadcast_to(np.abs(work * term).sum(axis=axes), motion.theta.shape) for term in part.share]
            continue
        axes = tuple(range(force.ndim - 1))
        total += [np.broadcast_to(np.abs(force * term).sum(axis=axes), motion.theta.shape) for term in part.vector]
    return rms(total)


def assert_close(
    found: Array, closed: Array, *, size: Array, limit: float, what: str, bound: float | Array = 0.0
) -> None:
    """Each column to `limit` of its rms; to that of its uncancelled size where less than a hundredth of it is left.

    And to what finite stiffness is known to leave, `bound`.
    """
    size = np.maximum(size, 0.01 * size.max())  # a column of nothing, where the difference of two solutions rounds
    scale = np.where(rms(closed) < 0.01 * size, size, rms(closed))
    wrong, whole = rms(found - closed), rms(closed)
    assert (wrong <= limit * scale + bound).all(), f"{what}: rms of the difference {wrong}, of the closed form {whole}"


@cache
def preset(name: str, *, stiffness: Stiffness = RIGID) -> Reducer:
    return rverror.reducer(name, stiffness=stiffness)


def linearised(unit: Reducer, theta: Array, *, sense: int, torque: float = RATED) -> tuple[Contacts, Linearisation]:
    """State without errors, and its motion with what the measuring chain needs."""
    loaded = rverror.statics.linearise(Model(unit), theta, torque=torque, direction=sense)
    return dataclasses.replace(loaded.motion, time=theta / 0.3, torque=torque), loaded


@cache
def rigid(name: str, sense: int) -> tuple[Contacts, ContactForces, ContactForces]:
    """Motion, closed form and solved forces of a preset at `ANGLES`."""
    motion, loaded = linearised(preset(name), ANGLES, sense=sense)
    return motion, closed_form_forces(motion), loaded.forces


# --- the rigid limit ----------------------------------------------------------------------------------------------


@SENSES
@PRESETS
@pytest.mark.parametrize("key", KEYS)
def test_closed_form_is_the_rigid_limit(key: str, name: str, sense: int) -> None:
    motion, closed, solved = rigid(name, sense)
    for indices in index_sets(CATALOGUE[key], motion.reducer):
        expected, found = (source_matrix(motion, forces, key, indices) for forces in (closed, solved))
        size = uncancelled(motion, closed, key, indices)
        assert (size > 0).any(), f"{key} {indices} is not felt at any of ANGLES: take more of them"
        assert_close(found, expected, size=size, limit=LIMIT, what=f"{key} {indices}")


def carrying(state: rverror.model.Equilibrium) -> Array:
    return np.asarray(dot(state.contact_forces["pin"], state.contact_forces["pin"]) > 0)


@cache
def angles_between_pins(name: str) -> Array:
    """Angles at which no pin stands near the turn from drive to coast side, where a touch would open or close it."""
    unit = preset(name)
    motion = pose(unit, 2 * np.pi * np.mod(0.05 + 0.6180339887 * np.arange(99), 1), direction=1)
    assert isinstance(motion, Contacts)
    nearest = np.abs(motion.pin_arm).min(axis=(0, 1)) / (unit.eccentricity * unit.disc_lobes)
    return np.asarray(motion.theta[nearest > 0.04][:8])


@pytest.mark.parametrize(("name", "sense"), [("RV-40E", 1), ("RV-003", -1)], ids=["RV-40E forward", "RV-003 reverse"])
@pytest.mark.parametrize("key", KEYS)
def test_closed_form_is_the_finite_difference(key: str, name: str, sense: int) -> None:
    """The equilibrium solved again with a small error of either sign, or none where a negative one does not exist."""
    entry, theta = CATALOGUE[key], angles_between_pins(name)
    assert theta.size == 8
    nominal = pose(preset(name), theta, direction=sense, torque=RATED)
    assert isinstance(nominal, Contacts)
    for indices in index_sets(entry, nominal.reducer):
        timed = key == "sensor.time_offset"  # the clock is the run's, so here the prediction of a run is solved again
        motion = dataclasses.replace(nominal, time=theta / 0.3 if timed else None)
        play = key in SHARING or isinstance(parts(motion, key, indices)[0], Clearance)
        unit = preset(name, stiffness=RIGID_WITH_PLAY if play else RIGID)

        def solved(
            values: dict[str, Any],
            unit: Reducer = unit,
            indices: dict[str, Any] = indices,
            time: Array | None = motion.time,
        ) -> tuple[Array, Array | None]:
            model = Model(unit, (rverror.effect(key, **indices, **values),))
            if time is not None:
                return predict(model, OperatingConditions(theta, sense, RATED, time)).transmission_error, None
            state = rverror.equilibrium(model, theta, torque=RATED, direction=sense)
            return state.transmission_error, carrying(state)

        closed = closed_form_forces(motion)
        slopes = []
        for parameter in entry.parameters:
            step = 2e-5 * parameter.plausible  # 0.2 to 3 nm, where the pins are pressed in by 3 um
            if key in SHARING:  # equal bearings share a force: a softer one takes less of it
                step = 0.02 / getattr(unit.stiffness, SHARING[key])
            back = max(-step, parameter.least)
            (ahead, touching), (behind, before) = (solved({parameter.name: size}) for size in (step, back))
            if touching is not None:
                np.testing.assert_array_equal(touching, before, err_msg="a contact opened or closed")
            slopes.append((ahead - behind) / (step - back))
        assert_close(
            np.array(slopes),
            source_matrix(motion, closed, key, indices),
            size=uncancelled(motion, closed, key, indices),
            limit=LIMIT,
            what=f"{key} {indices}",
        )


# --- random reducers ----------------------------------------------------------------------------------------------


def rigid_of_its_size(unit: Reducer) -> Reducer:
    """The same reducer with a crank circle of 1 mm, on bearings that are rigid for any number of lobes.

    Displacements and turns weigh alike at that size, which the solver's trace of stiffness needs where stiffnesses
    differ 1e7-fold.  The meshes are as soft as the pins: four planets on one sun share their load equally only where
    the meshes give way before the cranks do, as three do on any meshes.
    """
    stiffness = Stiffness(
        pin_contact=1e5, crank_bearing=1e9, carrier_bearing=1e12, gear_mesh=1e5, sun_support=1.0, main_bearing=1e12
    )
    return variant(scaled(unit, 1 / unit.crank_radius), stiffness=stiffness)


def given_way(motion: Contacts, forces: ContactForces) -> dict[str, Array]:
    """What the forces of pins are off at the most: their stiffness times the way that their disc's cams give way.

    A disc that the cams' forces F displace by F / k_cam closes a pin by no more than that, whatever the pin carries:
    one near its turn from drive to coast side carries as little itself, and a single lobe may meet no other pin.
    """
    stiffness = motion.reducer.stiffness
    way = np.sqrt(dot(forces["cam"], forces["cam"])).max(axis=1) / stiffness.crank_bearing
    none = {name: np.zeros_like(force) for name, force in forces.items()}
    return none | {"pin": stiffness.pin_contact * way[:, None, None] * motion.pin_normal}


def compare_all(unit: Reducer, theta: Array, *, sense: int) -> None:
    """Closed form and solved forces of every source."""
    motion, loaded = linearised(unit, theta, sense=sense, torque=1e3)
    closed = closed_form_forces(motion)
    off = given_way(motion, closed)
    for key in KEYS:
        for indices in index_sets(CATALOGUE[key], unit):
            expected, found = (source_matrix(motion, forces, key, indices) for forces in (closed, loaded.forces))
            size = uncancelled(motion, closed, key, indices)
            bound = uncancelled(motion, off, key, indices)
            assert_close(found, expected, size=size, limit=2 * LIMIT, what=f"{key} {indices}", bound=bound)


@given(unit=st.one_of(reducers(discs=(1, 1)), in_phase_reducers()), theta=angles(12), sense=st.sampled_from([1, -1]))
def test_any_reducer_has_the_closed_form_as_its_rigid_limit(unit: Reducer, theta: Array, sense: int) -> None:
    """One disc, or discs that mesh in phase; two to four cranks."""
    compare_all(rigid_of_its_size(unit), theta, sense=sense)


out_of_phase = reducers(cranks=(3, 4), discs=(2, 4)).filter(lambda unit: unit.pins % unit.discs > 0)


@given(unit=out_of_phase, theta=angles(12), sense=st.sampled_from([1, -1]))
def test_discs_out_of_phase_have_it_too(unit: Reducer, theta: Array, sense: int) -> None:
    """Where the number of discs does not divide that of the pins, the discs carry unequal moments."""
    compare_all(rigid_of_its_size(unit), theta, sense=sense)


def test_a_lobe_that_only_a_pin_near_its_turn_meets_has_it_too() -> None:
    """At one angle of twelve, where its force is 1e-4 of the others': the way that the disc gives is 13 % of it."""
    unit, lobe = rigid_of_its_size(rverror.reducer("RV-40E", disc_lobes=38, pins=39, cranks=3)), {"disc": 1, "lobe": 37}
    theta = np.linspace(0, 2 * np.pi / 39, 400, endpoint=False) + 1e-4
    motion, _ = linearised(unit, theta, sense=1, torque=1e3)
    felt = np.abs(source_matrix(motion, closed_form_forces(motion), "cycloid.disc_lobe", lobe)[0])
    least = theta[np.argmin(np.where(felt > 0, felt, np.inf))]
    compare_all(unit, np.append(least, theta[felt == 0][7::11][:11]), sense=1)


def cams_of_least_energy(motion: Contacts, pins: Array) -> Array:
    """Least-squares forces (disc, crank, 2, n) on equal cams that balance discs and cranks, from statics alone.

    Each disc passes on the force Q_k and the moment M_k of its pins; each crank takes the same torque.
    """
    unit, n = motion.reducer, motion.theta.size
    radial, _ = radial_and_tangential(motion.crank_position)
    eccentric, _ = radial_and_tangential(motion.eccentric)
    shape = (unit.discs, unit.cranks, 2)
    rows, right = [], []
    force = pins.sum(axis=1)
    for k in range(unit.discs):
        for axis in range(2):
            row = np.zeros((n, *shape))
            row[:, k, :, axis] = 1
            rows.append(row)
            right.append(force[k, axis])
        row = np.zeros((n, *shape))
        row[:, k] = np.moveaxis(np.stack([-radial[:, 1], radial[:, 0]], axis=1), -1, 0)
        rows.append(row)
        right.append((motion.pin_arm[k] * dot(pins[k], motion.pin_normal[k])).sum(axis=0) / unit.crank_radius)
    torque = cross(eccentric, force).sum(axis=0) / unit.cranks
    for j in range(unit.cranks):
        row = np.zeros((n, *shape))
        row[:, :, j] = np.moveaxis(np.stack([-eccentric[:, 1], eccentric[:, 0]], axis=1), -1, 0)
        rows.append(row)
        right.append(torque)
    matrix = np.stack(rows, axis=1).reshape(n, len(rows), -1)
    found = np.linalg.pinv(matrix, rcond=1e-9) @ np.stack(right, axis=-1)[..., None]
    return np.moveaxis(found.reshape(n, *shape), 0, -1)


@given(unit=reducers(cranks=(3, 4)), theta=angles(12), sense=st.sampled_from([1, -1]))
def test_cam_forces_are_those_of_least_energy(unit: Reducer, theta: Array, sense: int) -> None:
    """Any number of discs, in phase or not.

    Two cranks are left out: both stand at their dead centres together, where no cam can even out what two discs out of
    phase put on the cranks, and the pins must.
    """
    motion, loaded = linearised(rigid_of_its_size(unit), theta, sense=sense, torque=1e3)
    closed = closed_form_forces(motion)
    expected = cams_of_least_energy(motion, closed["pin"])
    np.testing.assert_allclose(closed["cam"], expected, atol=1e-9 * np.abs(expected).max())
    difference = loaded.forces["cam"] - expected
    assert np.sqrt(np.mean(difference**2)) < LIMIT * np.sqrt(np.mean(expected**2))


# --- compliant bearings -------------------------------------------------------------------------------------------


#: Reducers on bearings that give way.
COMPLIANT = {
    "RV-40E": rverror.reducer("RV-40E"),
    "RV-003": rverror.reducer("RV-003"),
    "broken ratio": rverror.reducer("RV-40E", planet_teeth=24, cranks=3),
    "four discs": rverror.reducer("RV-003", discs=4),
    "out of phase": rverror.reducer("RV-40E", disc_lobes=38, pins=39, cranks=3),
    "one disc": rverror.reducer("RV-003", discs=1),
}


@cache
def compliant(name: str, sense: int) -> tuple[Contacts, ContactForces, dict[str, Array]]:
    """Solved forces, and the finite difference of every case of the independent model, on bearings that give way.

    At a load and at errors so light that nothing is left of second order in the displacements.
    """
    unit, theta, torque = COMPLIANT[name], ANGLES[:12], RATED / 200
    motion, loaded = linearised(unit, theta, sense=sense, torque=torque)
    terms = [(key, on(unit, index), p.name) for key, index in ORACLE_CASES for p in CATALOGUE[key].parameters]
    rows = iter(Oracle(unit, theta, sense=sense, torque=torque, springs=REALISTIC).influence(terms, step=1e-8))
    cases = {
        repr((key, index)): np.array([next(rows) for _ in CATALOGUE[key].parameters]) for key, index in ORACLE_CASES
    }
    return motion, loaded.forces, cases


def on(unit: Reducer, indices: dict[str, Any]) -> dict[str, Any]:
    """The same on a disc that the reducer has."""
    return indices | {"disc": indices["disc"] % unit.discs} if "disc" in indices else indices


@SENSES
@pytest.mark.parametrize("name", ["RV-40E", "RV-003", "out of phase", "one disc"])
@pytest.mark.parametrize("case", ORACLE_CASES, ids=lambda case: f"{case[0]}-{'-'.join(map(str, case[1].values()))}")
def test_influence_on_compliant_bearings_is_that_of_the_oracle(
    case: tuple[str, dict[str, Any]], name: str, sense: int
) -> None:
    motion, forces, differences = compliant(name, sense)
    key, indices = case[0], on(motion.reducer, case[1])
    found, size = (find(motion, forces, key, indices) for find in (source_matrix, uncancelled))
    if not size.any():  # as a tilt of the pins on a single disc: nothing but the oracle's rounding to compare with
        assert not found.any()
        assert np.abs(differences[repr(case)]).max() < 1e-6
        return
    assert_close(found, differences[repr(case)], size=size, limit=2e-3, what=str(case))


# --- orders -------------------------------------------------------------------------------------------------------

#: How far what is claimed to be constant may ripple, of its uncancelled size.  Discs out of phase ripple with the
#: cycloid mesh as their shares of the load do.
RIPPLE = {"RV-40E": 1e-9, "RV-003": 1e-9, "broken ratio": 1e-9, "four discs": 1e-9, "out of phase": 1e-3}


def orders_of(theta: Array, matrix: Array) -> tuple[Array, Array]:
    """Amplitude of all columns together at each order; `theta` spans whole periods."""
    turns = theta.size * (theta[1] - theta[0]) / (2 * np.pi)
    ripple = matrix - matrix.mean(axis=1, keepdims=True)
    lines = 2 / theta.size * np.sqrt((np.abs(np.fft.rfft(ripple)) ** 2).sum(axis=0))
    return np.arange(lines.size) / turns, lines


@cache
def loaded_turns(name: str, sense: int) -> tuple[Contacts, ContactForces]:
    """State under the rated load of the larger unit over one true period."""
    turns, samples = period_and_samples(COMPLIANT[name])
    theta = 2 * np.pi * turns * np.arange(samples) / samples + 1.3e-4
    motion, loaded = linearised(COMPLIANT[name], theta, sense=sense)
    assert (loaded.state.loaded_pins < motion.reducer.pins / 2).all()  # compliance has opened some of the loaded half
    return motion, loaded.forces


@pytest.mark.parametrize(
    ("name", "sense"),
    [("RV-40E", 1), ("RV-40E", -1), ("RV-003", 1), ("RV-003", -1), *[(n, 1) for n in list(RIPPLE)[2:]]],
)
@pytest.mark.parametrize("key", KEYS)
def test_orders_found_under_load_are_the_orders_claimed(key: str, name: str, sense: int) -> None:
    """Of two or more evenly spaced discs: claimed orders are the strongest of all, claimed constants do not ripple."""
    entry, unit = CATALOGUE[key], COMPLIANT[name]
    motion, forces = loaded_turns(name, sense)
    for indices in index_sets(entry, unit):
        claimed = entry.orders(unit, indices)
        matrix = source_matrix(motion, forces, key, indices)
        if not entry.periodic:
            assert claimed == ()
            continue
        orders, lines = orders_of(motion.theta, matrix)
        if claimed:
            strongest = orders[np.argsort(-lines)[: len(claimed)]]
            np.testing.assert_allclose(claimed, strongest, rtol=1e-9, err_msg=str(indices))
        else:
            assert lines.max() < RIPPLE[name] * uncancelled(motion, forces, key, indices).max(), indices


def one_disc(sun_support: float) -> tuple[Contacts, ContactForces]:
    """A single disc, at a load so light that no back flank closes."""
    unit = rverror.reducer("RV-003", discs=1, stiffness=Stiffness(sun_support=sun_support))
    motion, loaded = linearised(unit, 2 * np.pi * np.arange(4096) / 4096 + 1.3e-4, sense=1, torque=1e-2)
    return motion, loaded.forces


def test_orders_of_one_disc_under_load() -> None:
    """Claimed orders hold on a sun that floats; clearances ripple at twice the claimed order more than at it.

    The couple of a single disc's cams pulls along the eccentric direction, so that three cranks under equal torques
    wind up unequally; the sun must follow them.
    """
    motion, forces = one_disc(1e-6)
    for key in KEYS:
        if not CATALOGUE[key].periodic:
            continue
        for indices in index_sets(CATALOGUE[key], motion.reducer):
            claimed = CATALOGUE[key].orders(motion.reducer, indices)
            orders, lines = orders_of(motion.theta, source_matrix(motion, forces, key, indices))
            strongest = orders[np.argsort(-lines)]
            if not claimed:
                assert lines.max() <= 1e-8 * uncancelled(motion, forces, key, indices).max(), (key, indices)
            elif isinstance(parts(motion, key, indices)[0], Clearance):
                np.testing.assert_allclose(strongest[:2], [2 * claimed[0], claimed[0]], rtol=1e-9, err_msg=key)
            else:
                np.testing.assert_allclose(strongest[: len(claimed)], claimed, rtol=1e-9, err_msg=f"{key} {indices}")


def test_a_supported_sun_gives_one_disc_order_40_of_constant_errors() -> None:
    """A cam bearing's give, felt at its planet, is k (a / r2 cos(alpha))^2 = 640 N/mm: a support of 100 N/mm counts.

    Two discs wind their cranks up alike, and there the same support does nothing at all.
    """
    motion, forces = one_disc(1e2)
    lead = source_matrix(motion, forces, "crank.index", {"crank": 1})
    orders, lines = orders_of(motion.theta, lead)
    assert orders[lines.argmax()] == pytest.approx(40)
    assert lines.max() > 0.3 * abs(lead.mean())
