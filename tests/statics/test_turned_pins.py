"""Pins that follow their discs' profiles: against the trochoid itself, differences, and runs that tell how far."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import rverror
from gear_runs import UNIT, begin, runs_of
from rverror.base.units import ARCSEC
from rverror.diagnosis.gears.account import elastic
from rverror.diagnosis.gears.fit import fitted
from rverror.geartrain.cycloid import trochoid_curvature
from rverror.geartrain.kinematics import Conditions
from rverror.geartrain.mechanism import ContactLaw, Reducer
from rverror.model.effects import Effect
from rverror.statics.energy import geometry
from rverror.statics.loaded_state import statics_of
from strategies import reducers

CURVED = ContactLaw(profile_curvature=1.0)


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


@pytest.mark.parametrize("law", [CURVED, ContactLaw(profile_curvature=1.0, pin_exponent=10 / 9)], ids=str)
def test_influences_hold_how_forces_turn(monkeypatch: pytest.MonkeyPatch, law: ContactLaw) -> None:
    """Against central differences; what the answer to a force leaves out, of second order, is below a hundredth."""
    monkeypatch.setattr("rverror.statics.turned_pins._SETTLED", 0.0)
    theta = 2 * np.pi * np.mod(0.05 + 0.6180339887 * np.arange(40), 1)
    statics = statics_of(rverror.reducer("RV-40E", contact_law=law), Conditions(theta, 1.0, 20e3))
    effects = (
        Effect("cycloid.pin_circle", {"harmonic": 2}, (2e-3, -1e-3, 3e-3, 1e-3)),
        Effect("cycloid.disc_pitch", {"disc": 0, "harmonic": 1}, (3e-3, -2e-3)),
        Effect("coupling.carrier_bore_position", {"crank": 0}, (4e-3, 2e-3)),
    )
    rows = statics.predict(effects).matrix
    straight = statics.elastic(rverror.reducer("RV-40E")).predict(effects).matrix
    wrong, turned, at = [], [], 0
    for number, one in enumerate(effects):
        for place in range(len(one.values)):
            ends = []
            for step in (2e-5, -2e-5):
                values = tuple(v + step * (i == place) for i, v in enumerate(one.values))
                some = (*effects[:number], replace(one, values=values), *effects[number + 1 :])
                ends.append(statics.predict(some).transmission_error)
            slope = (ends[0] - ends[1]) / 4e-5
            wrong.append(np.median(abs(slope - rows[at])) / abs(slope).max())
            turned.append(np.median(abs(slope - straight[at])) / abs(slope).max())
            at += 1
    assert max(wrong) < 0.01
    assert max(turned) > 1.5 * max(wrong)


@pytest.mark.parametrize("torque", [5e3, 20e3, 412e3])
def test_a_few_turns_settle_the_normals(monkeypatch: pytest.MonkeyPatch, torque: float) -> None:
    """As many turns as there may be move nothing that counts, at light load and at the rated one."""
    model = rverror.Model(
        rverror.reducer("RV-40E", contact_law=CURVED),
        (
            rverror.effect("cycloid.pin_circle", harmonic=2, tangential_cos="8 um"),
            rverror.effect("coupling.carrier_bore_position", crank=0, radial="8 um"),
        ),
    )
    theta = np.linspace(0, 1, 60)
    found = rverror.equilibrium(model, theta, torque=torque, direction=1).transmission_error
    monkeypatch.setattr("rverror.statics.turned_pins._SETTLED", 0.0)
    most = rverror.equilibrium(model, theta, torque=torque, direction=1).transmission_error
    assert np.sqrt(np.mean((found - most) ** 2)) < 0.003 * ARCSEC


def test_straight_pins_are_those_of_no_curvature() -> None:
    """On straight profiles nothing turns, whatever the share."""
    motion = statics_of(UNIT, Conditions(np.linspace(0, 1, 5), 1.0, 50e3)).motion
    assert geometry(motion).curvature.shape == (5, UNIT.discs, UNIT.pins)
    assert ContactLaw().profile_curvature == 0.0
    with pytest.raises(ValueError, match="profile_curvature"):
        ContactLaw(profile_curvature=-0.1)


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_runs_tell_how_far_pins_follow_their_profiles(share: float) -> None:
    """Waves of 25 um around the pins turn normals enough: the interval holds the true share, not the other one."""
    wave = rverror.effect(
        "cycloid.pin_circle", harmonic=2, tangential_cos="25 um", radial_sin="10 um", uncertainty="5 um"
    )
    true = replace(UNIT, contact_law=ContactLaw(profile_curvature=share))
    assumed = replace(UNIT, contact_law=ContactLaw(profile_curvature=1.0 - share))
    fit = fitted(begin(rverror.Model(assumed, (wave,)), runs_of(rverror.Model(true, (wave,)))), steps=30)
    (found,) = [one for one in elastic(fit) if one.name == "profile_curvature"]
    assert found.told
    assert found.low <= share <= found.high
    assert not found.low <= 1.0 - share <= found.high
