"""The housing as output: against an energy written down anew in the frame of the held carrier, and by invariants."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import rverror
from rverror import Model, Reducer, effect
from rverror.geartrain import OperatingConditions, Stiffness
from rverror.geartrain.action_line import Contacts, ErrorVector
from rverror.geartrain.contacts import motion
from rverror.model.catalogue import CATALOGUE
from rverror.statics.energy import Geometry, Layout
from rverror.statics.loaded_state import statics_of
from rverror.statics.prediction import Predictor, turned
from strategies import angles, reducers

UNIT = rverror.reducer("RV-40E", output="housing")


def turned_over(unit: Reducer) -> Reducer:
    return replace(unit, output="carrier")


def errors_of(unit: Reducer) -> tuple[rverror.Effect, ...]:
    """One of each kind of contact."""
    return (
        effect("cycloid.pin_position", pin=3, radial="8 um", tangential="-5 um"),
        effect("cycloid.disc_pitch", disc=0, harmonic=2, cos="4 um", sin="3 um"),
        effect("crank.eccentricity", crank=0, disc=0, radial="6 um", tangential="2 um"),
        effect("coupling.carrier_bore_position", crank=1, radial="3 um", tangential="5 um"),
        effect("involute.planet_eccentricity", crank=0, x="9 um", y="-4 um"),
    )


# --- ratio and frames -------------------------------------------------------------------------------------------------


def test_ratios_of_the_sources() -> None:
    """000's and 003's units with the carrier held: 120 and 100 turns of the input against one of the housing."""
    assert UNIT.ratio == -120
    assert rverror.reducer("RV-003", output="housing").ratio == -100
    assert UNIT.output_turn == pytest.approx(-121 / 120)


@given(unit=reducers())
@settings(max_examples=30, deadline=None)
def test_willis(unit: Reducer) -> None:
    """Seen from the carrier, sun and housing turn as in any train with a held arm: -(z2/z1) z_p."""
    other = replace(unit, output="housing")
    turns = rverror.geartrain.frame_orders(other)
    sun, housing = (turns[part] - turns["carrier"] for part in ("sun", "housing"))
    assert sun / housing == pytest.approx(-unit.planet_teeth / unit.sun_teeth * unit.pins)
    assert other.ratio == pytest.approx(sun / housing)
    assert other.exact_ratio.denominator == unit.exact_ratio.denominator


# --- all is turned by -theta: exact invariants ------------------------------------------------------------------------


@given(unit=reducers(), theta=angles(), direction=st.sampled_from([1.0, -1.0]))
@settings(max_examples=15, deadline=None)
def test_closed_form_is_that_of_the_carrier_turned_back(unit: Reducer, theta: np.ndarray, direction: float) -> None:
    """With the sun held in the housing, a carrier that leads by e leaves the housing behind by e R/(R - 1)."""
    other = replace(unit, output="housing")
    more = unit.ratio / (unit.ratio - 1)
    on_the_bench = "involute.sun_offset"  # the motor's axis
    for key, entry in CATALOGUE.items():
        if entry.acts != "contacts" or not entry.applies_to(unit) or key == on_the_bench:
            continue
        indices = next(iter(entry.candidates(unit)))
        here = rverror.influence(other, theta, key, direction=direction, torque=50e3, **indices).matrix
        there = rverror.influence(unit, -theta, key, direction=-direction, torque=more * 50e3, **indices).matrix
        # what cancels is next to nothing, not nothing: of a compliance 2 kN over 30 mm, times 2^-52, is 1e-14
        rounding = 1e-13 + 1e-9 * np.abs(there).max()
        np.testing.assert_allclose(here, -more * there, rtol=1e-9, atol=rounding, err_msg=key)


def test_what_stands_on_the_bench_stands_on_the_carrier() -> None:
    """An offset of the motor's axis turns with the carrier: seen from there, it stands still."""
    theta = np.linspace(0, 2, 5)
    unit = replace(UNIT, cranks=3)
    where = motion(unit, OperatingConditions(theta, 1.0))
    error = CATALOGUE["involute.sun_offset"].vector(where)
    assert isinstance(where, Contacts)
    assert isinstance(error, ErrorVector)
    radial = np.stack([np.cos(where.turns["carrier"]), np.sin(where.turns["carrier"])])
    np.testing.assert_allclose(error.vector[0, 0, 0], radial, atol=1e-14)


@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize("torque", ["20 N*m", "412 N*m"])
def test_equilibrium_is_that_of_the_carrier_under_more_torque(direction: float, torque: str) -> None:
    """Work: what the output turns more than the carrier, by R/(R - 1), it carries less."""
    stiff = replace(UNIT, stiffness=Stiffness(sun_support=1e-3))  # where the sun is held is the one thing that differs
    theta = np.linspace(0.1, 6, 7)
    errors = errors_of(UNIT)
    here = rverror.equilibrium(Model(stiff, errors), theta, torque=torque, direction=direction)
    load = float(torque.split()[0]) * 1e3 * 121 / 120
    there = rverror.equilibrium(Model(turned_over(stiff), errors), -theta, torque=load, direction=-direction)
    np.testing.assert_allclose(here.transmission_error, -121 / 120 * there.transmission_error, rtol=1e-6)
    np.testing.assert_allclose(here.contact_forces["pin"], there.contact_forces["pin"], atol=1e-4)


def test_pins_carry_what_turns_the_housing_against_its_load() -> None:
    """Moment of the pins' forces about the axis, on the housing: the output torque, against the motion."""
    theta = np.linspace(0, 2, 5)
    state = rverror.equilibrium(Model(UNIT, errors_of(UNIT)), theta, torque="100 N*m", direction=1.0)
    forces = state.contact_forces["pin"]  # of pins on discs
    place = 2 * np.pi * np.arange(UNIT.pins)[:, None] / UNIT.pins
    normal = motion(UNIT, OperatingConditions(theta, 1.0)).pin_normal  # type: ignore[attr-defined]
    point = UNIT.pin_circle_radius * np.stack([np.cos(place), np.sin(place)], axis=1) + UNIT.pin_radius * normal
    moment = -(point[..., 0, :] * forces[..., 1, :] - point[..., 1, :] * forces[..., 0, :]).sum(axis=(0, 1))
    main = -state.pose["carrier"][:2] * UNIT.stiffness.main_bearing  # on the axis: no moment
    assert main.shape == (2, 5)
    np.testing.assert_allclose(moment, 100e3, rtol=1e-8)  # drives forward; the load resists


# --- an energy of its own, seen by who stands on the carrier ---------------------------------------------------------


def housing_turn(unit: Reducer, theta: float, direction: float, torque: float, pin: int, by: float) -> float:
    """Turn of a loaded housing whose pin `pin` stands `by` too far out, carrier and input held.

    Written from the drawing of the parts as they stand on the bench, the carrier at rest: pins on a housing that is
    turned by theta, cranks on the carrier, an input at ratio theta.  Minimised by active sets.
    """
    z, cranks, discs = unit.pins, unit.cranks, unit.discs
    size = 3 + 3 * discs + 3 * cranks + 2  # housing, discs, cranks, sun
    stiffness = np.zeros((size, size))
    load = np.zeros(size)
    load[2] = -direction * torque

    def at(first: int, point: np.ndarray, way: np.ndarray, sign: float, row: np.ndarray, centre: np.ndarray) -> None:
        """Motion along a way of a point of a body."""
        row[first : first + 2] += sign * way
        arm = point - centre
        row[first + 2] += sign * float(way[1] * arm[0] - way[0] * arm[1])

    def spring(rows: list[np.ndarray], k: float) -> None:
        for row in rows:
            stiffness[:] += k * np.outer(row, row)

    def unit_vector(angle: float) -> np.ndarray:
        return np.array([math.cos(angle), math.sin(angle)])

    axis = np.zeros(2)
    # with the carrier at rest a crank turns z_p times for each turn of the housing, the same way; the input the other
    crank_turn = unit.pins * theta
    eccentric = [crank_turn + 2 * math.pi * k / discs for k in range(discs)]
    bores = [unit.crank_radius * unit_vector(2 * math.pi * j / cranks) for j in range(cranks)]
    both = np.eye(2)
    for k in range(discs):
        centre = unit.eccentricity * unit_vector(eccentric[k])
        for j in range(cranks):
            place = centre + bores[j]
            rows = []
            for way in both:
                row = np.zeros(size)
                at(3 + 3 * k, place, way, 1, row, centre)
                at(3 + 3 * discs + 3 * j, place, way, -1, row, bores[j])
                rows.append(row)
            spring(rows, unit.stiffness.crank_bearing)
    for j in range(cranks):
        first = 3 + 3 * discs + 3 * j
        spring([np.eye(size)[first], np.eye(size)[first + 1]], unit.stiffness.carrier_bearing)
    spring([np.eye(size)[0], np.eye(size)[1]], unit.stiffness.main_bearing)
    spring([np.eye(size)[-2], np.eye(size)[-1]], unit.stiffness.sun_support)
    rows, gap, k_of = [], [], []
    for k in range(discs):
        centre = unit.eccentricity * unit_vector(eccentric[k])
        for i in range(z):
            pin_at = unit.pin_circle_radius * unit_vector(theta + 2 * math.pi * i / z)
            # the normal passes the pitch point, where disc and housing turn together: on the eccentric, at a z_p
            pitch = unit.eccentricity * z * unit_vector(eccentric[k])
            way = (pitch - pin_at) / float(np.hypot(*(pitch - pin_at)))
            touch = pin_at + unit.pin_radius * way
            row = np.zeros(size)
            at(0, touch, way, 1, row, axis)
            at(3 + 3 * k, touch, way, -1, row, centre)
            rows.append(row)
            gap.append(by * float(unit_vector(theta + 2 * math.pi * i / z) @ way) if i == pin else 0.0)
            k_of.append(unit.stiffness.pin_contact)
    sun_radius = unit.sun_pitch_radius
    for j in range(cranks):
        outward = bores[j] / unit.crank_radius
        tangent = np.array([-outward[1], outward[0]])
        for sense in (1.0, -1.0):  # the sun pushes a planet one way round, or the other
            way = math.cos(unit.pressure_angle) * sense * tangent + math.sin(unit.pressure_angle) * outward
            touch = sun_radius * outward
            row = np.zeros(size)
            row[-2:] += way
            at(3 + 3 * discs + 3 * j, touch, way, -1, row, bores[j])
            rows.append(row)
            gap.append(-unit.gear_backlash / 2)
            k_of.append(unit.stiffness.gear_mesh)
    contact, error, hard = np.array(rows), np.array(gap), np.array(k_of)
    # the input turns against the housing: it pushes the planets against its own sense, which is minus direction
    closed = np.zeros(len(hard), dtype=bool)
    arm = contact[:, 2]
    closed[: discs * z] = arm[: discs * z] * direction < 0
    for j in range(cranks):
        closed[discs * z + 2 * j + (0 if direction < 0 else 1)] = True
    for _ in range(200):
        whole = stiffness + (contact[closed] * hard[closed, None]).T @ contact[closed]
        x = np.linalg.solve(whole, load - (contact[closed] * hard[closed, None]).T @ error[closed])
        now = contact @ x + error > 0
        if (now == closed).all():
            return float(x[2])
        closed = now
    raise AssertionError("no set of contacts")


@pytest.mark.parametrize("sun_support", [1e2, 1e5])
@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_equilibrium_against_an_energy_of_its_own(direction: float, sun_support: float) -> None:
    """What pushes, which pins and flanks, and by how much the housing turns, from the parts as they stand.

    A sun that is held stiffly is held by the carrier, on which its motor stands.
    """
    soft = replace(UNIT.stiffness, sun_support=sun_support, main_bearing=1e5)
    unit = replace(UNIT, stiffness=soft)
    for theta in (0.0, 0.7, 2.9):
        for by in (0.0, 10e-3):
            errors = (effect("cycloid.pin_position", pin=4, radial=by),)
            state = rverror.equilibrium(Model(unit, errors), [theta], torque="412 N*m", direction=direction)
            own = housing_turn(unit, theta, direction, 412e3, 4, by)
            assert state.transmission_error[0] == pytest.approx(own, rel=1e-6)


def test_a_head_on_the_carrier_sees_the_tilt_turn_with_the_cranks() -> None:
    """The couple turns once a crank's turn, from the held carrier 40 times, from the housing 39 times."""
    theta = 2 * np.pi * np.arange(512) / 512
    for unit, order in ((UNIT, 40), (turned_over(UNIT), 39)):
        entry = CATALOGUE["sensor.output_tilt"]
        assert entry.orders(unit, {}) == (order,)
        rows = rverror.influence(unit, theta, entry.key, direction=1.0, torque=100e3).matrix
        waves = np.abs(np.fft.rfft(rows, axis=1))
        assert waves.argmax(axis=1).tolist() == [order, order]
        np.testing.assert_allclose(np.hypot(*rows), 100e3, rtol=1e-9)  # a unit vector times the torque


def test_after_a_turn_of_the_crank_the_train_stands_as_it_did_turned_with_the_carrier() -> None:
    """The carrier has gone back by as much as the housing went on."""
    errors, ahead = errors_of(UNIT)[1:], 2 * np.pi / 40
    for unit in (UNIT, turned_over(UNIT)):
        now, then = (
            statics_of(unit, OperatingConditions(np.array([at]), 1.0, torque=100e3)).predict(errors).poses
            for at in (0.3, 0.3 + ahead)
        )
        moved = turned(unit, now, np.array([ahead]))
        np.testing.assert_allclose(moved, then, atol=1e-7 * np.abs(then).max())


def test_the_suns_support_stands_on_what_is_held() -> None:
    """A housing that is pushed aside under all other parts stretches its bearing, and a support that stands in it."""
    for unit, stretched in ((UNIT, 0.0), (turned_over(UNIT), 1.0)):
        where = motion(unit, OperatingConditions(np.array([0.4]), 1.0))
        assert isinstance(where, Contacts)
        layout, aside = Layout(unit), np.zeros(Layout(unit).size)
        aside[[0, *layout.disc, *layout.crank, layout.sun]] = 1.0  # all but the housing, along x
        *bearings, main, support = (Geometry(where).whole_rows[0] @ aside)[2 * unit.cranks :: 2]
        np.testing.assert_allclose(bearings, 0, atol=1e-12)
        assert (main, support) == (1.0, stretched)


@pytest.mark.parametrize("unit", [UNIT, turned_over(UNIT)], ids=["housing", "carrier"])
def test_no_load_takes_off_the_whole_windup_of_its_trace(unit: Reducer) -> None:
    """Perfect parts without play stand where they should: the turn under the trace of load is windup alone."""
    unit = replace(unit, gear_backlash=0.0)
    found = statics_of(unit, OperatingConditions(np.linspace(0.2, 5, 6), 1.0, torque=0.0)).settled(())
    windup = unit.output_turn * found.solution.x[:, 2]
    assert (np.abs(found.transmission_error) < 1e-6 * np.abs(windup)).all()


# --- the same everywhere else -----------------------------------------------------------------------------------------


def test_influences_are_changes_of_the_equilibrium() -> None:
    """Sign and size of the loaded influences, by finite differences."""
    theta = np.linspace(0.2, 5, 6)
    where = OperatingConditions(theta, direction=1.0, torque=412e3)
    errors = errors_of(UNIT)
    rows = Predictor(UNIT, where).predict(Model(UNIT, errors)).matrix
    base = rverror.equilibrium(Model(UNIT, errors), where).transmission_error
    at = 0
    for number, one in enumerate(errors):
        for k in range(len(one.values)):
            step = 1e-6
            values = tuple(v + step * (n == k) for n, v in enumerate(one.values))
            more = (*errors[:number], replace(one, values=values), *errors[number + 1 :])
            change = (rverror.equilibrium(Model(UNIT, more), where).transmission_error - base) / step
            np.testing.assert_allclose(change, rows[at], rtol=1e-3, atol=1e-4 * np.abs(rows).max())
            at += 1


def test_torsional_stiffness_is_seen_from_the_output() -> None:
    """A bearing at the cranks alone gives way: the housing turns R/(R - 1) times under so many times the force."""
    stiff = Stiffness(crank_bearing=1e12, pin_contact=1e12, gear_mesh=1e12, carrier_bearing=3e5, main_bearing=1e12)
    unit = rverror.reducer("RV-40E", output="housing", stiffness=stiff)
    found = rverror.statics.torsional_stiffness(Model(unit), [0.0])
    assert found[0] == pytest.approx(2 * 3e5 * 27**2 * (120 / 121) ** 2, rel=1e-3)
