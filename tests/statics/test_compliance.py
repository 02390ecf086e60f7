"""Compliances of contacts as error sources: exact in the equilibrium, proportional to the load in the closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import rverror
from rverror.geartrain.kinematics import OperatingConditions
from rverror.geartrain.mechanism import BearingPreload, ContactLaw, Reducer
from rverror.model.effects import Effect, Model, effect
from rverror.statics.loaded_state import NotConvergedError
from rverror.statics.prediction import predict

THETA = 2 * np.pi * np.mod(0.05 + 0.6180339887 * np.arange(24), 1)
LINE = ContactLaw(pin_exponent=10 / 9, flank_exponent=10 / 9)
PARTS = (
    effect("cycloid.pin_position", pin=3, radial="3 um", tangential="-2 um"),
    effect("crank.eccentricity", crank=1, disc=0, radial="4 um"),
    effect("involute.planet_eccentricity", crank=0, x="5 um"),
)
SOFT = (
    effect("cycloid.pin_compliance", pin=5, compliance="2 um/kN"),
    effect("cycloid.pin_compliance_wave", harmonic=2, cos="1 um/kN", sin="-0.5 um/kN"),
    effect("crank.bearing_compliance", crank=0, disc=1, compliance="1.5 um/kN"),
    effect("coupling.bearing_compliance", crank=1, compliance="-0.5 um/kN"),
    effect("involute.mesh_compliance", crank=1, compliance="2 um/kN"),
    effect("involute.sun_compliance_wave", harmonic=2, cos="1 um/kN"),
    effect("involute.planet_compliance_wave", crank=0, harmonic=1, sin="1 um/kN"),
)
CLEARANCE = (effect("crank.bearing_clearance", clearance="5 um"),)
#: Sources of which all contacts together are one declared stiffness.
UNIFORM = {
    "cycloid.pin_compliance": ({"pin": "all"}, "pin_contact"),
    "crank.bearing_compliance": ({"crank": "all", "disc": "all"}, "crank_bearing"),
    "coupling.bearing_compliance": ({"crank": "all"}, "carrier_bearing"),
    "involute.mesh_compliance": ({"crank": "all"}, "gear_mesh"),
}


@pytest.mark.parametrize("preload", [0.0, 0.0005, 0.002], ids=["none", "a little", "more than the load lifts"])
@pytest.mark.parametrize("law", [ContactLaw(), LINE], ids=["linear", "line contact"])
@pytest.mark.parametrize("key", UNIFORM)
def test_all_contacts_softer_are_a_declared_stiffness(key: str, law: ContactLaw, preload: float) -> None:
    indices, name = UNIFORM[key]
    tight = BearingPreload(crank_bearing=preload, carrier_bearing=preload)
    unit = rverror.reducer("RV-40E", contact_law=law, bearing_preload=tight)
    declared = getattr(unit.stiffness, name)
    more = 0.4 / declared
    softer = replace(unit, stiffness=replace(unit.stiffness, **{name: 1 / (1 / declared + more)}))
    one = predict(Model(unit, (*PARTS, Effect(key, indices, (more,)))), OperatingConditions(THETA, -1.0, 50e3))
    other = predict(Model(softer, PARTS), OperatingConditions(THETA, -1.0, 50e3))
    scale = np.abs(other.transmission_error).max()
    np.testing.assert_allclose(one.transmission_error, other.transmission_error, rtol=0, atol=1e-9 * scale)
    np.testing.assert_allclose(one.matrix[:-1], other.matrix, rtol=0, atol=1e-8 * np.abs(other.matrix).max())
    # per mm/N, and per logarithm of the declared compliance
    assert one.softening is not None
    row = list(rverror.statics.loaded_state.SOFTENING).index(name)
    np.testing.assert_allclose(one.matrix[-1] / declared, one.softening[row], rtol=1e-9, atol=1e-12 * scale)


@pytest.mark.parametrize("clearance", [(), CLEARANCE], ids=["", "with clearance"])
@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize("law", [ContactLaw(), LINE], ids=["linear", "line contact"])
def test_rows_are_the_derivatives(
    monkeypatch: pytest.MonkeyPatch, law: ContactLaw, direction: float, clearance: tuple[Effect, ...]
) -> None:
    monkeypatch.setattr("rverror.statics.energy.GRADIENT_TOLERANCE", 1e-12)
    effects = (*PARTS, *clearance, *SOFT)
    unit = rverror.reducer("RV-40E", contact_law=law)
    where, step = OperatingConditions(THETA, direction, 200e3), 1e-10
    rows = predict(Model(unit, effects), where).matrix
    at = sum(len(e.values) for e in (*PARTS, *clearance))
    scale = np.abs(rows[at:]).max()
    for index in range(len(effects) - len(SOFT), len(effects)):
        one = effects[index]
        for term in range(len(one.values)):
            ends = []
            for sign in (1, -1):
                values = tuple(v + sign * step * (i == term) for i, v in enumerate(one.values))
                moved = (*effects[:index], replace(one, values=values), *effects[index + 1 :])
                ends.append(predict(Model(unit, moved), where).transmission_error)
            slope = (ends[0] - ends[1]) / (2 * step)
            assert np.median(np.abs(slope - rows[at])) < 1e-6 * scale, one.key
            at += 1


@pytest.mark.parametrize("entry", SOFT, ids=lambda one: one.key)
def test_the_closed_form_lags_by_load_times_square_of_the_influence(entry: Effect) -> None:
    unit = rverror.reducer("RV-40E")
    one, three, back = (
        rverror.transmission_error(Model(unit, (entry,)), THETA, torque=torque, direction=sense)
        for torque, sense in ((100e3, 1), (300e3, 1), (100e3, -1))
    )
    np.testing.assert_allclose(three, 3 * one, rtol=1e-12, atol=1e-18)
    if entry.key in ("coupling.bearing_compliance", "involute.mesh_compliance"):  # the same forces either way
        np.testing.assert_allclose(back, -one, rtol=1e-9)
    if len(entry.values) == 1 and entry.values[0] > 0:
        assert (one <= 0).all()
        assert (back >= 0).all()


def test_one_of_two_meshes_by_hand() -> None:
    """Each flank carries T / (R n r1 cos(alpha)); the output lags by c T over the square of the lever."""
    unit = rverror.reducer("RV-40E")
    lever = unit.ratio * unit.cranks * unit.sun_pitch_radius * np.cos(unit.pressure_angle)
    found = rverror.influence(unit, THETA, "involute.mesh_compliance", torque=100e3, direction=1, crank=0)
    np.testing.assert_allclose(found.matrix, -100e3 / lever**2, rtol=1e-12)


def test_without_a_torque_it_is_asked_for() -> None:
    unit = rverror.reducer("RV-40E")
    with pytest.raises(ValueError, match="a compliance needs the torque; give torque"):
        rverror.influence(unit, THETA, "cycloid.pin_compliance", pin=0)


def test_influences_about_a_loaded_state_need_no_other_torque() -> None:
    unit = rverror.reducer("RV-40E")
    model = Model(unit, (*PARTS, *SOFT))
    loaded = rverror.statics.linearise(model, THETA, torque=50e3, direction=1)
    rows = predict(model, OperatingConditions(THETA, 1.0, 50e3)).matrix
    at = sum(len(e.values) for e in PARTS)
    for one in SOFT:
        found = rverror.influence(unit, THETA, one.key, direction=1, forces=loaded.forces, **one.indices).matrix
        np.testing.assert_allclose(found, rows[at : at + len(found)], rtol=0, atol=1e-7 * np.abs(rows[at:]).max())
        at += len(found)


def test_stiffer_than_rigid_is_refused() -> None:
    unit = rverror.reducer("RV-40E")
    model = Model(unit, (effect("cycloid.pin_compliance", pin="all", compliance="-6 um/kN"),))
    with pytest.raises(NotConvergedError, match=r"pin: compliances of -6 um/kN .* they must be above -5 um/kN"):
        rverror.equilibrium(model, THETA, torque=50e3, direction=1)


def test_a_wave_around_the_pins_is_of_order_78_and_grows_with_the_load() -> None:
    unit: Reducer = rverror.reducer("RV-40E")
    theta = 2 * np.pi * np.arange(4096) / 4096
    wave = effect("cycloid.pin_compliance_wave", harmonic=2, cos="2 um/kN")
    amplitude = []
    for torque in (200e3, 400e3):
        turns = [
            rverror.equilibrium(Model(unit, some), theta, torque=torque, direction=1).transmission_error
            for some in ((wave,), ())
        ]
        lines = np.abs(np.fft.rfft(turns[0] - turns[1]))
        assert lines[1:].argmax() + 1 == 78
        amplitude.append(lines[78])
    assert amplitude[1] / amplitude[0] == pytest.approx(2.0, rel=1e-3)
