"""Pins that follow their discs' profiles: against the trochoid itself, differences, and runs that tell how far."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, strategies as st

import rverror
from gear_runs import UNIT, begin, runs_of
from rverror.diagnosis.gears.account import elastic_within, half_widths
from rverror.diagnosis.gears.fit import fitted
from rverror.geartrain.cycloid import trochoid_curvature
from rverror.geartrain.kinematics import OperatingConditions
from rverror.geartrain.mechanism import ContactLaw, Reducer
from rverror.statics.loaded_state import statics_of
from strategies import reducers

CURVED = ContactLaw(profile_curvature=1.0)
ANGLES = 2 * np.pi * np.mod(0.05 + 0.6180339887 * np.arange(40), 1)


def trochoid(unit: Reducer, phi: np.ndarray) -> np.ndarray:
    """Where the centre of a pin at 0 stands in the frame of a disc whose eccentric direction has turned to phi."""
    return (unit.pin_circle_radius - unit.eccentricity * np.exp(1j * phi)) * np.exp(1j * phi / unit.disc_lobes)


@given(reducers(), st.floats(0.05, 6.2))
def test_curvature_is_that_of_the_trochoid(unit: Reducer, phi: float) -> None:
    """From three points nearby: the circle through them, to the left of the way where it is convex."""
    step = 1e-4
    a, b, c = trochoid(unit, phi + step * np.array([-1, 0, 1]))
    area = ((b - a).real * (c - a).imag - (b - a).imag * (c - a).real) / 2
    circle = 4 * area / (abs(b - a) * abs(c - b) * abs(c - a))
    found = float(trochoid_curvature(unit, np.array(phi)))
    largest = float(np.abs(trochoid_curvature(unit, np.linspace(0, 2 * np.pi, 400))).max())
    assert found == pytest.approx(circle, abs=1e-5 * largest)


@given(reducers(), st.floats(0.3, 6.0), st.floats(-1, 1), st.floats(-1, 1))
def test_a_pin_closes_by_the_distance_from_the_trochoid_to_second_order(
    unit: Reducer, phi: float, inwards: float, along: float
) -> None:
    """Moved by some thousandths of the radius of curvature: the nearest point is sought on the curve itself."""
    curvature = float(trochoid_curvature(unit, np.array(phi)))
    size = 2e-3 * min(1 / max(abs(curvature), 1e-9), 1.0)
    here, step = trochoid(unit, np.array(phi)), 1e-6
    way = trochoid(unit, np.array(phi + step)) - trochoid(unit, np.array(phi - step))
    way = way / abs(way)
    moved = here + size * (along * way + 1j * inwards * way)  # a disc lies to the left of its outline
    speed = abs(trochoid(unit, np.array(phi + step)) - trochoid(unit, np.array(phi - step))) / (2 * step)
    near = phi + np.linspace(-4, 4, 4001) * size / speed
    foot = near[int(np.argmin(abs(moved - trochoid(unit, near))))]
    way = trochoid(unit, foot + step) - trochoid(unit, foot - step)
    inside = ((moved - trochoid(unit, foot)) * np.conj(1j * way / abs(way))).real  # from the tangent at its foot
    expected = size * inwards - curvature * (size * along) ** 2 / 2
    assert inside == pytest.approx(expected, abs=0.05 * size**2 * max(abs(curvature), 0.1))


ERRORS = (
    rverror.effect("cycloid.pin_circle", harmonic=2, tangential_cos="8 um"),
    rverror.effect("coupling.carrier_bore_position", crank=0, radial="8 um"),
)


def test_forces_along_the_turned_normals_hold_each_disc() -> None:
    """What the pins push and what the cams push are the same, and were not along the normals of the error-free pose."""
    state = rverror.equilibrium(
        rverror.Model(rverror.reducer("RV-40E", contact_law=CURVED), ERRORS), ANGLES, torque=20e3, direction=1
    )
    pins, cams = state.contact_forces["pin"], state.contact_forces["cam"]
    largest = np.abs(pins).max()
    assert np.abs(pins.sum(axis=1) - cams.sum(axis=1)).max() < 1e-3 * largest
    motion = statics_of(rverror.reducer("RV-40E"), OperatingConditions(ANGLES, 1.0, 20e3)).motion
    straight = np.linalg.norm(pins, axis=2)[:, :, None] * motion.pin_normal
    assert np.abs(straight.sum(axis=1) - cams.sum(axis=1)).max() > 1e-2 * largest


@pytest.mark.parametrize("torque", [5e3, 20e3, 412e3])
def test_each_pin_closes_with_the_normal_of_the_place_that_it_has_moved_to(torque: float) -> None:
    """p - kappa s^2 / 2, from the rows of straight normals and the pose that was found."""
    unit = rverror.reducer("RV-40E", contact_law=CURVED)
    found = statics_of(unit, OperatingConditions(np.linspace(0, 1, 60), 1.0, torque)).settled(ERRORS)
    rows, where = found.contacts.pin_rows, found.x[:, 3 : 3 + 3 * unit.discs].reshape(-1, unit.discs, 3)
    across = np.stack([-rows[:, :, 1], rows[:, :, 0], found.contacts.profile_lever], axis=2)
    into, along = (np.einsum("nkc,nkcp->nkp", where, one) for one in (rows, across))
    slid = along + found.problem.slide_error
    expected = into + found.problem.pin_error - found.contacts.curvature * slid**2 / 2
    np.testing.assert_allclose(found.solution.pins, expected, rtol=0, atol=1e-12)
    assert (np.abs(found.solution.gradient).max(axis=1) <= found.problem.tolerance).all()


def test_next_to_no_curvature_is_first_order() -> None:
    """The share goes to the statics of straight normals, by the way that turns them."""
    models = [
        rverror.Model(rverror.reducer("RV-40E", contact_law=ContactLaw(profile_curvature=share)), ERRORS)
        for share in (0.0, 1e-9, 1.0)
    ]
    straight, hardly, curved = (
        rverror.equilibrium(model, ANGLES, torque=20e3, direction=1).transmission_error for model in models
    )
    assert np.abs(hardly - straight).max() < 1e-6 * np.abs(curved - straight).max()


def test_largest_curvature_that_is_convex_is_that_of_the_smallest_convex_radius() -> None:
    """By another formula, which bounds the pin radius."""
    for unit in (rverror.reducer("RV-40E"), rverror.reducer("RV-003"), UNIT):
        largest = trochoid_curvature(unit, np.linspace(0, 2 * np.pi, 200_001)).max()
        assert largest == pytest.approx(1 / unit.smallest_convex_radius, rel=1e-6)


def test_a_share_beyond_its_bounds_is_refused() -> None:
    for share in (-0.1, 2.1, float("nan")):
        with pytest.raises(ValueError, match=r"^profile_curvature"):
            ContactLaw(profile_curvature=share)


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_runs_tell_how_far_pins_follow_their_profiles(share: float) -> None:
    """Waves of 25 um around the pins turn normals enough: the interval holds the true share, not the other one."""
    wave = rverror.effect(
        "cycloid.pin_circle", harmonic=2, tangential_cos="25 um", radial_sin="10 um", uncertainty="5 um"
    )
    true = replace(UNIT, contact_law=ContactLaw(profile_curvature=share))
    assumed = replace(UNIT, contact_law=ContactLaw(profile_curvature=1.0 - share))
    fit = fitted(begin(rverror.Model(assumed, (wave,)), runs_of(rverror.Model(true, (wave,)))), steps=30)
    (found,) = [one for one in elastic_within(fit, half_widths(fit)) if one.name == "profile_curvature"]
    assert found.determined
    assert found.low <= share <= found.high
    assert not found.low <= 1.0 - share <= found.high
