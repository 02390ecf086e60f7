"""The loaded equilibrium against an independent planar model, exact identities, limits and symmetries.

First-order statements (exact rows, influences as derivatives) are checked at a load and at errors so light that nothing
of second order in the displacements is left; contacts open and close there as they do at a thousand times both.
"""

from __future__ import annotations

import dataclasses
import math
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

import rverror
from oracle import Errors, Oracle, Springs, put
from rverror.geartrain.contacts import pose
from rverror.geartrain.kinematics import frame_orders
from rverror.model.compose import influence, source_matrix
from rverror.statics import energy
from rverror.statics.loaded_state import NotConvergedError

ARCSEC = math.pi / 180 / 3600
#: Golden-ratio steps: irregular against every order, and the same each time.
ANGLES = 2 * np.pi * np.mod(0.05 + 0.6180339887 * np.arange(10), 1)
FEATHER = 1e-4  # N*mm; turns the output by 2e-13 rad

Term = tuple[str, dict[str, Any], str, float]

#: Errors of 5 um of all kinds, among them pins drawn back and pushed forward; pins lift off at 20 and at 412 N*m.
SEVERAL: tuple[Term, ...] = (
    ("cycloid.disc_pitch", {"disc": 0, "harmonic": 1}, "cos", 5e-3),
    ("cycloid.disc_pitch", {"disc": 1, "harmonic": 2}, "sin", -5e-3),
    ("crank.eccentricity", {"crank": 0, "disc": 0}, "radial", 5e-3),
    ("crank.eccentricity", {"crank": 1, "disc": 0}, "tangential", -5e-3),
    ("cycloid.disc_bore_position", {"disc": 1, "crank": 1}, "tangential", 5e-3),
    ("cycloid.disc_bore_position", {"disc": 0, "crank": 0}, "radial", 5e-3),
    ("coupling.carrier_bore_position", {"crank": 0}, "tangential", 5e-3),
    ("coupling.carrier_bore_position", {"crank": 1}, "radial", 5e-3),
    ("cycloid.pin_position", {"pin": 3}, "tangential", 5e-3),
    ("cycloid.pin_position", {"pin": 17}, "radial", -5e-3),
    ("cycloid.pin_position", {"pin": 30}, "radial", -5e-3),
)


def model_of(unit: rverror.Reducer, terms: tuple[Term, ...], scale: float = 1.0) -> rverror.Model:
    return rverror.Model(unit, tuple(rverror.effect(k, **i, **{name: size * scale}) for k, i, name, size in terms))


def at(unit: rverror.Reducer, **stiffness: float) -> rverror.Reducer:
    return rverror.reducer(unit.name, stiffness=dataclasses.replace(unit.stiffness, **stiffness))


def rms(values: np.ndarray) -> np.ndarray:
    return np.sqrt(np.mean(values**2, axis=-1))


# --- the independent model ----------------------------------------------------------------------------------------


def oracle_of(unit: rverror.Reducer, *, sense: int, torque: float) -> Oracle:
    k = unit.stiffness
    springs = Springs(
        pin=k.pin_contact, cam=k.crank_bearing, carrier=k.carrier_bearing,
        mesh=k.gear_mesh, sun=k.sun_support, main=k.main_bearing,
    )  # fmt: skip
    return Oracle(unit, ANGLES, sense=sense, torque=torque, springs=springs)


def settle(oracle: Oracle, errors: Errors, start: np.ndarray | None = None) -> np.ndarray:
    """Pose of least energy, (case, angle, unknowns), where the oracle's plain Newton steps may run in circles.

    A step is halved while the force along it has turned round: past the minimum of the energy along the step.  As in
    `Oracle.solve`, the first step holds shut what carries in the start, or everything.
    """
    load = np.zeros(oracle.unknowns)
    load[2] = -oracle.sense * oracle.torque
    held: np.ndarray | bool = False
    if start is not None:
        compression, _, _, one_sided = oracle.contacts(start, Errors(oracle.unit, len(start)))
        held = one_sided & (compression <= 0)
    u = np.zeros((errors.sun_turn.size, oracle.theta.size, oracle.unknowns)) + (0 if start is None else start)

    def state(u: np.ndarray, open_: np.ndarray | bool | None) -> tuple[np.ndarray, np.ndarray]:
        compression, gradient, stiffness, one_sided = oracle.contacts(u, errors)
        k = np.where(one_sided & (compression <= 0) if open_ is None else open_, 0.0, stiffness)
        force = np.einsum("cam,camq->caq", k * compression, gradient) - load
        return force, np.swapaxes(gradient * k[..., None], -1, -2) @ gradient

    force, hessian = state(u, held)
    for turn in range(100):
        trace = 1e-12 * np.einsum("caii->cai", hessian).max(axis=-1)
        step = -np.linalg.solve(hessian + trace[..., None, None] * np.eye(oracle.unknowns), force[..., None])[..., 0]
        if turn and abs(step).max() < 1e-10:
            return u + step
        length, slope = np.ones(force.shape[:2]), abs((force * step).sum(axis=-1))
        for _ in range(6 if turn else 0):
            past = (state(u + length[..., None] * step, None)[0] * step).sum(axis=-1) > 0.3 * slope
            length[past] /= 2
        u = u + length[..., None] * step
        force, hessian = state(u, None)
    raise ArithmeticError(f"the oracle did not settle; last step {abs(step).max():.1e}")


def oracle_output(unit: rverror.Reducer, terms: tuple[Term, ...], *, sense: int, torque: float) -> np.ndarray:
    """Output error at `ANGLES`, rad.  The oracle has no back flanks; its play is what thinner teeth would leave."""
    oracle, errors = oracle_of(unit, sense=sense, torque=torque), Errors(unit, 1)
    for key, index, name, size in terms:
        put(errors, unit, 0, (key, index, name), size)
    errors.thinning[:] += unit.gear_backlash / math.cos(unit.pressure_angle)
    pose_without_errors = settle(oracle, Errors(unit, 1))
    return np.asarray(settle(oracle, errors, pose_without_errors)[0, :, 2])


@pytest.mark.parametrize("sense", [1, -1], ids=["forward", "reverse"])
@pytest.mark.parametrize("torque", [20e3, 412e3], ids=["20 N*m", "412 N*m"])
@pytest.mark.parametrize("name", ["RV-40E", "RV-003"])
def test_transmission_error_is_that_of_the_oracle_to_first_order(name: str, torque: float, sense: int) -> None:
    """What the kinematics of first order leave out is quadratic in the errors, and below 0.03 arcsec at 1.25 um.

    Errors, play and load at a quarter open the same contacts.  Three cranks get more play: else back flanks touch.
    """
    left_out = {}
    for scale in (1.0, 0.25):
        unit = rverror.reducer(name, gear_backlash=scale * (0.02 if name == "RV-40E" else 0.06))
        load, terms = scale * torque, tuple((k, i, n, scale * size) for k, i, n, size in SEVERAL)
        found = rverror.equilibrium(model_of(unit, terms), ANGLES, torque=load, direction=sense)
        clean = rverror.equilibrium(rverror.Model(unit), ANGLES, torque=load, direction=sense)
        assert (found.loaded_pins != clean.loaded_pins).mean() > 0.5, "the errors must open and close contacts"
        assert np.ptp(found.transmission_error) > 10 * scale * ARCSEC
        wrong = (found.transmission_error - oracle_output(unit, terms, sense=sense, torque=load)) / ARCSEC
        left_out[scale] = wrong - wrong.mean()
    assert abs(left_out[0.25]).max() < 0.03
    assert rms(left_out[1.0]) < 0.02 * 10  # 2 % of the swing
    assert rms(left_out[1.0]) == pytest.approx(16 * rms(left_out[0.25]), rel=0.25)


@pytest.mark.parametrize("sense", [1, -1], ids=["forward", "reverse"])
@pytest.mark.parametrize("name", ["RV-40E", "RV-003"])
def test_pins_that_follow_their_profiles_leave_little_of_it(name: str, sense: int) -> None:
    """Most of what is quadratic is there: of eleven errors at once 0.03 arcsec at most are left, under half of it."""
    left = {}
    for share in (0.0, 1.0):
        law = rverror.geartrain.ContactLaw(profile_curvature=share)
        unit = rverror.reducer(name, gear_backlash=0.02 if name == "RV-40E" else 0.06, contact_law=law)
        found = rverror.equilibrium(model_of(unit, SEVERAL), ANGLES, torque=20e3, direction=sense)
        wrong = found.transmission_error - oracle_output(unit, SEVERAL, sense=sense, torque=20e3)
        left[share] = rms(wrong - wrong.mean()) / ARCSEC
    assert left[1.0] < min(0.03, left[0.0] / 2)


@pytest.mark.parametrize(
    "term",
    [
        ("cycloid.disc_pitch", {"disc": 0, "harmonic": 1}, "cos", 5e-3),
        ("cycloid.pin_circle", {"harmonic": 2}, "tangential_cos", 5e-3),
        ("coupling.carrier_bore_position", {"crank": 1}, "tangential", 8e-3),
        ("cycloid.profile_modification", {}, "shift", 8e-3),
    ],
    ids=lambda term: term[0],
)
def test_alone_an_error_is_exact_to_thousandths_of_an_arcsec(term: Term) -> None:
    """Those that turn normals most: beside exact poses a quarter of what straight profiles leave, or less."""
    left = {}
    for share in (0.0, 1.0):
        unit = rverror.reducer("RV-40E", contact_law=rverror.geartrain.ContactLaw(profile_curvature=share))
        wrong, clean = (
            rverror.equilibrium(model_of(unit, terms), ANGLES, torque=20e3, direction=1).transmission_error
            - oracle_output(unit, terms, sense=1, torque=20e3)
            for terms in ((term,), ())
        )
        left[share] = rms(wrong - clean - (wrong - clean).mean()) / ARCSEC
    assert left[1.0] < min(left[0.0] / 4, 0.004)


def test_difference_from_the_oracle_is_of_second_order() -> None:
    """A tenth of all errors and of the load opens the same contacts; what is left out falls more than tenfold."""
    unit = rverror.reducer("RV-40E", gear_backlash=2e-3)
    terms = tuple((k, i, n, size / 10) for k, i, n, size in SEVERAL)
    found = rverror.equilibrium(model_of(unit, terms), ANGLES, torque=2e3, direction=1).transmission_error
    wrong = (found - oracle_output(unit, terms, sense=1, torque=2e3)) / ARCSEC
    assert np.ptp(found) > 2.5 * ARCSEC
    assert abs(wrong).max() < 3e-3


def test_back_flanks_close_when_the_play_is_used_up() -> None:
    """Of three planets one that leads by more than the play stops the sun from giving way."""
    tight, loose = (rverror.reducer("RV-003", gear_backlash=play) for play in (0.02, 0.2))
    for lead, same in ((1e-3, True), (10e-3, False)):
        change = []
        for unit in (tight, loose):
            models = model_of(unit, (("crank.index", {"crank": 0}, "angle", lead),)), rverror.Model(unit)
            wrong, clean = (rverror.equilibrium(m, ANGLES, torque=20e3, direction=1) for m in models)
            change.append((wrong.transmission_error - clean.transmission_error).mean())
        difference = abs(change[0] - change[1])
        assert (difference < 0.01 * ARCSEC) if same else (difference > 5 * ARCSEC)


# --- rows that hold at any stiffness ------------------------------------------------------------------------------


def exact_rows(unit: rverror.Reducer) -> list[tuple[str, list[Term], float]]:
    """Name, unit errors, and change of output per mm or rad; from the gears' numbers alone."""
    gears = unit.planet_teeth / unit.sun_teeth
    ratio = 1 + gears * unit.pins
    cranks, discs = range(unit.cranks), range(unit.discs)
    radius = unit.module * (unit.sun_teeth + unit.planet_teeth) / 2
    return [
        (
            "cams ahead of their cranks",
            [("crank.eccentricity", {"crank": j, "disc": k}, "tangential", 1.0) for j in cranks for k in discs],
            -gears / ratio / unit.eccentricity,
        ),
        (
            "disc bores ahead",
            [("cycloid.disc_bore_position", {"crank": j, "disc": k}, "tangential", 1.0) for j in cranks for k in discs],
            unit.disc_lobes * gears / ratio / radius,
        ),
        (
            "carrier bores ahead",
            [("coupling.carrier_bore_position", {"crank": j}, "tangential", 1.0) for j in cranks],
            -1 / radius,
        ),
        (
            "cranks ahead of their planets",
            [("crank.index", {"crank": j}, "angle", 1.0) for j in cranks],
            -gears / ratio,
        ),
        (
            "pin ring turned",
            [("cycloid.pin_circle", {"harmonic": 0}, "tangential_cos", 1.0)],
            (ratio - 1) / ratio / unit.pin_circle_radius,
        ),
    ]


stiffnesses = st.builds(
    lambda *k: dict(
        zip(("pin_contact", "crank_bearing", "carrier_bearing", "gear_mesh", "main_bearing"), k, strict=True)
    ),
    *[st.floats(4, 7).map(lambda exponent: 10**exponent)] * 5,
)


@given(stiffness=stiffnesses, name=st.sampled_from(["RV-40E", "RV-003"]), sense=st.sampled_from([1, -1]))
def test_exact_rows_hold_at_any_stiffness(stiffness: dict[str, float], name: str, sense: int) -> None:
    unit = rverror.reducer(name, stiffness=rverror.geartrain.Stiffness(**stiffness), gear_backlash=0.0)
    angles = ANGLES[:4]
    forces = rverror.statics.linearise(rverror.Model(unit), angles, torque=FEATHER, direction=sense).forces
    motion = pose(unit, angles, direction=sense)
    for what, terms, expected in exact_rows(unit):
        total = np.zeros(angles.size)
        for key, index, name_, size in terms:
            labels = influence(unit, angles, key, direction=sense, **index).labels
            total += size * source_matrix(motion, forces, key, index)[labels.index(name_)]
        np.testing.assert_allclose(total, expected, rtol=1e-9, atol=1e-9 * abs(expected), err_msg=what)


@given(stiffness=stiffnesses, name=st.sampled_from(["RV-40E", "RV-003"]), sense=st.sampled_from([1, -1]))
def test_exact_rows_hold_for_solved_poses(stiffness: dict[str, float], name: str, sense: int) -> None:
    """Finite errors under load, by the difference of two solved poses; the play is shared, so nothing closes it."""
    unit = rverror.reducer(name, stiffness=rverror.geartrain.Stiffness(**stiffness), gear_backlash=1e-4)
    angles, step = ANGLES[:4], 1e-6
    clean = rverror.equilibrium(rverror.Model(unit), angles, torque=100 * FEATHER, direction=sense).transmission_error
    for what, terms, expected in exact_rows(unit):
        wrong = model_of(unit, tuple(terms), step)
        found = rverror.equilibrium(wrong, angles, torque=100 * FEATHER, direction=sense).transmission_error - clean
        np.testing.assert_allclose(found / step, expected, rtol=1e-5, err_msg=what)


@pytest.mark.parametrize(("name", "five_um"), [("RV-40E", (-20.456, 36.934, -38.197))])
def test_published_sizes_of_the_exact_rows(name: str, five_um: tuple[float, ...]) -> None:
    """The design's figures for 5 um at the rated load."""
    unit = rverror.reducer(name)
    clean = rverror.equilibrium(rverror.Model(unit), ANGLES, torque=412e3, direction=1).transmission_error
    for (what, terms, _), expected in zip(exact_rows(unit)[:3], five_um, strict=True):
        found = rverror.equilibrium(model_of(unit, tuple(terms), 5e-3), ANGLES, torque=412e3, direction=1)
        change = (found.transmission_error - clean) / ARCSEC
        assert change == pytest.approx(expected, rel=2e-3), what
        assert np.ptp(change) < 0.06, what


@pytest.mark.parametrize("name", ["RV-40E", "RV-003"])
@pytest.mark.parametrize("sense", [1, -1])
def test_a_reducer_without_errors_has_no_ripple(name: str, sense: int) -> None:
    """Over one turn of the crank, at the rated load: only the elastic windup, which is a lag."""
    unit = rverror.reducer(name)
    theta = 2 * np.pi / 40 * np.arange(80) / 80
    error = rverror.equilibrium(rverror.Model(unit), theta, torque=412e3, direction=sense).transmission_error
    assert np.ptp(error) < 0.1 * ARCSEC
    assert (sense * error < 0).all()


# --- forces -------------------------------------------------------------------------------------------------------

ONE_OF_EACH_CONTACT: list[tuple[str, dict[str, Any]]] = [
    ("cycloid.pin_position", {"pin": 8}),
    ("cycloid.disc_pitch", {"disc": 1, "harmonic": 1}),
    ("crank.eccentricity", {"crank": 1, "disc": 0}),
    ("cycloid.disc_bore_position", {"disc": 1, "crank": 0}),
    ("coupling.carrier_bore_position", {"crank": 1}),
    ("involute.planet_eccentricity", {"crank": 0}),
    ("crank.index", {"crank": 1}),
    ("sensor.encoder_eccentricity", {}),
]


@pytest.mark.parametrize("sense", [1, -1], ids=["forward", "reverse"])
@pytest.mark.parametrize(
    ("key", "index"), ONE_OF_EACH_CONTACT, ids=lambda value: value if isinstance(value, str) else ""
)
def test_forces_are_derivatives_of_the_output(key: str, index: dict[str, Any], sense: int) -> None:
    """At a state in which errors have lifted pins off: a millionth of 20 N*m and of 5 um."""
    unit = rverror.reducer("RV-40E", gear_backlash=2e-8)
    base = model_of(unit, SEVERAL, 1e-6)
    loaded = rverror.statics.linearise(base, ANGLES, torque=0.02, direction=sense)
    matrix = source_matrix(loaded.motion, loaded.forces, key, index)
    labels = influence(unit, ANGLES, key, direction=sense, **index).labels
    step = 1e-13  # no contact switches
    for row, label in zip(matrix, labels, strict=True):
        ahead, behind = (
            rverror.equilibrium(
                base.with_effects(rverror.effect(key, **index, **{label: s})), ANGLES, torque=0.02, direction=sense
            )
            for s in (step, -step)
        )
        np.testing.assert_array_equal(ahead.loaded_pins, behind.loaded_pins)
        slope = (ahead.transmission_error - behind.transmission_error) / (2 * step)
        np.testing.assert_allclose(slope, row, rtol=0, atol=2e-6 * abs(row).max(), err_msg=label)


def moment(point: np.ndarray, force: np.ndarray) -> np.ndarray:
    return np.asarray(point[..., 0, :] * force[..., 1, :] - point[..., 1, :] * force[..., 0, :])


@pytest.mark.parametrize("terms", [(), SEVERAL], ids=["no errors", "pins lifted"])
@pytest.mark.parametrize("name", ["RV-40E", "RV-003"])
@pytest.mark.parametrize("sense", [1, -1], ids=["forward", "reverse"])
def test_forces_balance_on_every_body(sense: int, name: str, terms: tuple[Term, ...]) -> None:
    """Statics of a reducer under a unit torque, body by body, from positions of the contacts drawn anew here."""
    unit = rverror.reducer(name, gear_backlash=2e-9)  # more than the errors use up
    forces = rverror.statics.linearise(model_of(unit, terms, 1e-8), ANGLES, torque=2 * FEATHER, direction=sense).forces
    turns = frame_orders(unit)
    gamma = 2 * np.pi * np.arange(unit.pins) / unit.pins
    circle = lambda angle: np.stack([np.cos(angle), np.sin(angle)], axis=-2)  # noqa: E731
    pin = unit.pin_circle_radius * circle(gamma[:, None])  # the force of a pin passes through its centre
    axis = unit.crank_radius * circle(ANGLES + (2 * np.pi * np.arange(unit.cranks) / unit.cranks)[:, None])
    eccentric = unit.eccentricity * circle(
        turns["crank"] * ANGLES + (2 * np.pi * np.arange(unit.discs) / unit.discs)[:, None]
    )
    cams = axis[None] + eccentric[:, None]
    small = {"atol": 1e-9}

    # the housing holds what is neither input, 1/R, nor output, 1: the torques of its pins are 1 - 1/R
    on_discs = moment(pin[None], forces["pin"])
    np.testing.assert_allclose(on_discs.sum(axis=(0, 1)), 1 - 1 / unit.ratio, **small)
    # discs
    np.testing.assert_allclose(forces["pin"].sum(axis=1), forces["cam"].sum(axis=1), **small)
    np.testing.assert_allclose(on_discs.sum(axis=1), moment(cams, forces["cam"]).sum(axis=1), **small)
    # carrier: torque 1, as the rest of the cranks' forces goes to its bearing through the centre
    np.testing.assert_allclose(moment(axis, forces["carrier"]).sum(axis=0), 1, **small)
    # cranks with planets
    mesh = forces["mesh"].sum(axis=1)
    np.testing.assert_allclose(forces["cam"].sum(axis=0) + mesh, forces["carrier"], **small)
    toothing = forces["spline"].sum(axis=1)[:, 0]
    np.testing.assert_allclose(moment(eccentric[:, None], forces["cam"]).sum(axis=0) + toothing, 0, **small)
    # sun: all planets together take the input torque
    base_radius = unit.module * unit.sun_teeth / 2 * math.cos(unit.pressure_angle)
    along = np.sqrt((forces["mesh"] ** 2).sum(axis=-2)).sum(axis=(0, 1))
    assert (along > 0).all()
    np.testing.assert_allclose(along * base_radius, 1 / unit.ratio, rtol=1e-9)


@pytest.mark.parametrize("name", ["RV-40E", "RV-003"])
def test_stiff_bearings_give_the_closed_form(name: str) -> None:
    """Bearings 1e4 times as stiff as pins, carrier bearings stiffer still, as the closed form has them."""
    stiff = rverror.geartrain.Stiffness(
        pin_contact=2e5, crank_bearing=2e9, carrier_bearing=2e12, gear_mesh=2e8, sun_support=1e3, main_bearing=2e12
    )
    unit = rverror.reducer(name, stiffness=stiff)
    motion = pose(unit, ANGLES, direction=1)
    forces = rverror.statics.linearise(rverror.Model(unit), ANGLES, torque=412e3, direction=1).forces
    for key, index in ONE_OF_EACH_CONTACT:
        closed = influence(unit, ANGLES, key, direction=1, **index).matrix
        found = source_matrix(motion, forces, key, index)
        assert (rms(found - closed) < 0.01 * rms(closed)).all(), key


# --- symmetries ---------------------------------------------------------------------------------------------------


def mirrored(unit: rverror.Reducer, terms: tuple[Term, ...]) -> tuple[Term, ...]:
    """The reducer as a mirror on the x axis shows it: what is tangential, or odd in an angle, changes sign."""
    places = {"crank": unit.cranks, "disc": unit.discs, "pin": unit.pins}

    def seen(term: Term) -> Term:
        key, index, name, size = term
        index = {k: -v % places[k] if k in places else v for k, v in index.items()}
        odd = name in ("tangential", "sin", "angle", "y")
        return key, index, name, -size if odd != (key == "cycloid.disc_pitch") else size

    return tuple(seen(term) for term in terms)


MORE: tuple[Term, ...] = (
    *SEVERAL,
    ("cycloid.disc_profile", {"disc": 1, "harmonic": 2}, "sin", 4e-3),
    ("cycloid.disc_profile", {"disc": 0, "harmonic": 1}, "cos", 4e-3),
    ("involute.planet_eccentricity", {"crank": 1}, "y", 5e-3),
    ("involute.planet_eccentricity", {"crank": 0}, "x", 5e-3),
    ("crank.index", {"crank": 1}, "angle", 1e-4),
)


@pytest.mark.parametrize("torque", [20e3, 412e3], ids=["20 N*m", "412 N*m"])
@pytest.mark.parametrize("name", ["RV-40E", "RV-003"])
def test_reverse_mirrors_forward(name: str, torque: float) -> None:
    unit = rverror.reducer(name)
    forward = rverror.equilibrium(model_of(unit, MORE), ANGLES, torque=torque, direction=1)
    mirror = rverror.equilibrium(model_of(unit, mirrored(unit, MORE)), -ANGLES, torque=torque, direction=-1)
    np.testing.assert_allclose(mirror.transmission_error, -forward.transmission_error, rtol=0, atol=1e-4 * ARCSEC)
    order = -np.arange(unit.discs) % unit.discs
    np.testing.assert_array_equal(mirror.loaded_pins[order], forward.loaded_pins)


@given(
    torques=st.lists(st.floats(1, 1000), min_size=2, max_size=4, unique=True),
    sense=st.sampled_from([1, -1]),
    scale=st.floats(-2, 2),
)
def test_more_torque_means_more_lag(torques: list[float], sense: int, scale: float) -> None:
    model = model_of(rverror.reducer("RV-40E"), SEVERAL, scale)
    lag = [
        -sense * rverror.equilibrium(model, ANGLES[:3], torque=t * 1e3, direction=sense).transmission_error
        for t in sorted(torques)
    ]
    assert (np.diff(lag, axis=0) > -1e-3 * ARCSEC).all()


def test_load_and_errors_scale_together() -> None:
    """All lengths of errors and play, and the torque, ten times smaller: so is the output, with the same contacts.

    The part that does not scale is of second order: 0.2 arcsec of 40 at the larger size.
    """
    large, small = rverror.reducer("RV-40E", gear_backlash=0.02), rverror.reducer("RV-40E", gear_backlash=0.002)
    full = rverror.equilibrium(model_of(large, SEVERAL), ANGLES, torque=20e3, direction=1).transmission_error
    tenth = rverror.equilibrium(model_of(small, SEVERAL, 0.1), ANGLES, torque=2e3, direction=1).transmission_error
    np.testing.assert_allclose(10 * tenth, full, rtol=0, atol=0.3 * ARCSEC)


def test_angles_are_solved_independently() -> None:
    model = model_of(rverror.reducer("RV-40E"), SEVERAL)
    together = rverror.equilibrium(model, ANGLES, torque=20e3, direction=1)
    backwards = rverror.equilibrium(model, ANGLES[::-1], torque=20e3, direction=1)
    close = {"rtol": 0, "atol": 1e-6 * ARCSEC}
    np.testing.assert_allclose(backwards.transmission_error[::-1], together.transmission_error, **close)
    for i, angle in enumerate(ANGLES):
        alone = rverror.equilibrium(model, [angle], torque=20e3, direction=1)
        np.testing.assert_allclose(alone.transmission_error, together.transmission_error[i], **close)
        np.testing.assert_array_equal(alone.loaded_pins[:, 0], together.loaded_pins[:, i])


def test_direction_may_change_within_a_run() -> None:
    model = model_of(rverror.reducer("RV-40E"), SEVERAL)
    sense = np.where(np.arange(ANGLES.size) % 2, 1.0, -1.0)
    mixed = rverror.equilibrium(model, ANGLES, torque=20e3, direction=sense).transmission_error
    for way in (1, -1):
        alone = rverror.equilibrium(model, ANGLES, torque=20e3, direction=way).transmission_error
        np.testing.assert_allclose(mixed[sense == way], alone[sense == way], rtol=0, atol=1e-6 * ARCSEC)


def test_what_sensors_add_is_added_whole() -> None:
    unit = rverror.reducer("RV-40E")
    encoder = rverror.effect("sensor.encoder_eccentricity", cos="7 arcsec", sin="-2 arcsec")
    model = model_of(unit, SEVERAL)
    without = rverror.equilibrium(model, ANGLES, torque=20e3, direction=1).transmission_error
    with_it = rverror.equilibrium(model.with_effects(encoder), ANGLES, torque=20e3, direction=1).transmission_error
    expected = (7 * np.cos(ANGLES) - 2 * np.sin(ANGLES)) * ARCSEC
    np.testing.assert_allclose(with_it - without, expected, rtol=0, atol=1e-12)


# --- refusals -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("torque", [-20e3, float("nan"), float("inf"), "-3 N*m"])
def test_torque_must_be_zero_or_more(torque: Any) -> None:
    with pytest.raises(ValueError, match=r"torque|finite"):
        rverror.equilibrium(rverror.Model(rverror.reducer("RV-40E")), [0.0], torque=torque)


def test_torque_needs_its_unit() -> None:
    with pytest.raises(ValueError, match=r"mm.*torque"):
        rverror.equilibrium(rverror.Model(rverror.reducer("RV-40E")), [0.0], torque="20 mm")


def test_a_drive_has_no_equilibrium() -> None:
    with pytest.raises(ValueError, match=r"\[reducer\]"):
        rverror.equilibrium(rverror.Model(rverror.Drive(ratio=14.0)), [0.0], torque=20e3)


@pytest.mark.parametrize("theta", [[float("nan")], [], [[0.0, 1.0]]])
def test_angles_must_be_a_row_of_numbers(theta: Any) -> None:
    with pytest.raises(ValueError, match=r"theta|finite"):
        rverror.equilibrium(rverror.Model(rverror.reducer("RV-40E")), theta, torque=20e3)


@cache
def large_errors() -> tuple[rverror.Model, ...]:
    rng = np.random.default_rng(0)
    unit = rverror.reducer("RV-40E")
    signs = rng.choice([-1, 1], size=(8, len(MORE)))
    return tuple(
        model_of(unit, tuple((k, i, n, 40 * sign * size) for (k, i, n, size), sign in zip(MORE, row, strict=True)))
        for row in signs
    )


def test_errors_of_a_fifth_of_a_millimetre_are_solved_or_refused() -> None:
    for model in large_errors():
        try:
            found = rverror.equilibrium(model, ANGLES, torque=20e3, direction=1)
        except NotConvergedError:  # what it says is tested below
            continue
        assert np.isfinite(found.transmission_error).all()
        assert abs(found.transmission_error).max() < 0.1


def test_what_did_not_converge_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    for limit in ("_MAX_STEPS", "_MAX_STEPS_NEAR", "_MAX_STEPS_UNLOADING"):
        monkeypatch.setattr(energy, limit, 0)
    model = model_of(rverror.reducer("RV-40E"), SEVERAL)
    with pytest.raises(NotConvergedError, match=rf"of {ANGLES.size} angles \(theta = [-0-9., ]+ deg"):
        rverror.equilibrium(model, ANGLES, torque=20e3, direction=1)


def test_errors_that_grow_along_a_run_grow_over_all_angles() -> None:
    unit, points = rverror.reducer("RV-40E"), 1500  # more than are solved together
    theta = 2 * np.pi * np.arange(points) / points
    time = 2 * theta + 0.1 * theta**2  # the output slows down
    gears = model_of(unit, SEVERAL[:3])
    beyond = (
        rverror.effect("sensor.drift", total="30 arcsec"),
        rverror.effect("sensor.time_offset", offset="2 ms"),
        rverror.effect("load.torsion", compliance="2 arcsec/(N*m)"),
    )
    alone = rverror.equilibrium(gears, theta, torque=20e3, time=time)
    every = dataclasses.replace(gears, effects=(*gears.effects, *beyond))
    read = rverror.equilibrium(every, theta, torque=20e3, time=time)
    inner = slice(40, -40)  # the speed is that of neighbours on both sides
    expected = 30 * ARCSEC * time / time[-1] + 2e-3 / (2 + 0.2 * theta) - 40 * ARCSEC
    np.testing.assert_allclose(
        (read.transmission_error - alone.transmission_error)[inner], expected[inner], rtol=0, atol=1e-4 * ARCSEC
    )
