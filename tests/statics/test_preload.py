"""Preloaded bearings: against two springs that face each other, linear limits, and finite differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import rverror
from rverror import Model, Reducer, effect
from rverror.base.errors import InputError
from rverror.geartrain import BearingPreload, OperatingConditions, Stiffness
from rverror.statics import kernel
from rverror.statics.loaded_state import SOFTENING, statics_of

bearing = kernel.bearing.py_func  # machine code holds it only in what calls it
UNIT = rverror.reducer("RV-40E")
THETA = 2 * np.pi / 40 * np.arange(16) / 16
ERRORS = (
    effect("crank.eccentricity", crank=0, disc=0, radial="3 um", tangential="2 um"),
    effect("cycloid.disc_pitch", disc=1, harmonic=2, cos="3 um", sin="1 um"),
)


def with_preload(cams: float = 0.0, carrier: float = 0.0, unit: Reducer = UNIT) -> Reducer:
    return replace(unit, bearing_preload=BearingPreload(crank_bearing=cams, carrier_bearing=carrier))


def turn(unit: Reducer, errors: tuple[rverror.Effect, ...] = ERRORS, torque: float = 100e3) -> np.ndarray:
    return rverror.equilibrium(Model(unit, errors), THETA, torque=torque, direction=1.0).transmission_error


@pytest.mark.parametrize("torque", [5e3, 412e3])
def test_pressed_all_around_is_twice_as_stiff(torque: float) -> None:
    """More preload than the load presses in: two springs that face each other, 2 k in all, whatever it is."""
    twice = replace(UNIT.stiffness, crank_bearing=2 * UNIT.stiffness.crank_bearing)
    linear = turn(replace(UNIT, stiffness=twice), torque=torque)
    for size in (0.1, 0.2):
        np.testing.assert_allclose(turn(with_preload(size), torque=torque), linear, rtol=1e-7)


def test_no_preload_is_the_unit_as_it_was() -> None:
    np.testing.assert_array_equal(turn(with_preload()), turn(UNIT))
    # and next to none moves the output by next to none
    np.testing.assert_allclose(turn(with_preload(1e-9, 1e-9)), turn(UNIT), atol=1e-10)


def test_clearance_takes_from_preload() -> None:
    """What a bearing plays is what wear has taken less what it was pressed in."""
    loose, tight = (effect("crank.bearing_clearance", clearance=c) for c in (0.005, 0.008))
    np.testing.assert_allclose(turn(with_preload(0.003), (*ERRORS, tight)), turn(UNIT, (*ERRORS, loose)), rtol=1e-7)
    equal = effect("crank.bearing_clearance", clearance=0.003)
    np.testing.assert_allclose(turn(with_preload(0.003), (*ERRORS, equal)), turn(UNIT), rtol=1e-7)


@given(share=st.floats(0.0, 3.0), force=st.floats(1.0, 5e3), angle=st.floats(0, 6.28))
@settings(max_examples=40, deadline=None)
def test_a_bearing_is_two_springs_that_face_each_other(share: float, force: float, angle: float) -> None:
    """F = k (d + p) less k (p - d) while the far side is pressed; its work is its energy, its slope its stiffness."""
    k, p = 3e5, share * force / 3e5
    displacement = force / (2 * k) if force / (2 * k) < p else force / k - p
    where = displacement * np.array([np.cos(angle), np.sin(angle)])

    def pushed(at: np.ndarray) -> np.ndarray:
        return bearing(*at, k, -p)[0] * at

    assert np.hypot(*pushed(where)) == pytest.approx(force, rel=1e-9)
    _, _, xx, xy, yy = bearing(*where, k, -p)
    matrix, step = np.array([[xx, xy], [xy, yy]]), 1e-7 * max(displacement, 1e-6)
    for way in np.eye(2):
        before, after = (pushed(where + s * step * way) for s in (-1, 1))
        if abs(displacement - p) > 10 * step:  # not across the bend
            np.testing.assert_allclose((after - before) / (2 * step), matrix @ way, rtol=1e-4, atol=1e-4 * k)
        energy = [bearing(*(where + s * step * way), k, -p)[1] for s in (-1, 1)]
        assert (energy[1] - energy[0]) / (2 * step) == pytest.approx(float(pushed(where) @ way), abs=1e-3 * force)


@pytest.mark.parametrize("sizes", [(0.003, 0.0), (0.0, 0.002), (0.05, 0.05)])
def test_changes_are_those_of_the_equilibrium(sizes: tuple[float, float]) -> None:
    """Influences, stiffness and clearance by finite differences, on both sides of the bend."""
    unit = with_preload(*sizes)
    errors = (*ERRORS, effect("crank.bearing_clearance", clearance=0.001))
    where = OperatingConditions(THETA, 1.0, torque=100e3)
    found = statics_of(unit, where).predict(errors)
    at = 0
    for number, one in enumerate(errors):
        for k in range(len(one.values)):
            ends = []
            for step in (-1e-6, 1e-6):
                values = tuple(v + step * (n == k) for n, v in enumerate(one.values))
                ends.append(turn(unit, (*errors[:number], replace(one, values=values), *errors[number + 1 :])))
            change = (ends[1] - ends[0]) / 2e-6
            np.testing.assert_allclose(change, found.matrix[at], atol=2e-3 * np.abs(found.matrix).max())
            at += 1
    for name in ("crank_bearing", "carrier_bearing", "pin_contact"):
        soft = [
            replace(unit, stiffness=Stiffness(**{name: getattr(unit.stiffness, name) * np.exp(-step)}))
            for step in (-1e-4, 1e-4)
        ]
        change = (turn(soft[1], errors) - turn(soft[0], errors)) / 2e-4
        row = found.softening[SOFTENING.index(name)]
        np.testing.assert_allclose(change, row, atol=2e-3 * np.abs(found.softening[:6]).max())


def test_files_hold_it(tmp_path) -> None:
    path = tmp_path / "model.toml"
    rverror.save_model(path, Model(with_preload(0.002)))
    assert '[reducer.bearing_preload]\ncrank_bearing = "2 um"' in path.read_text()
    assert rverror.load_model(path).mechanism == with_preload(0.002)
    path.write_text('[reducer]\npreset = "RV-40E"\n[reducer.bearing_preload]\ncrank_bearing = "-2 um"\n')
    with pytest.raises(InputError, match=r"line 4.*crank_bearing = -0.002 mm: must be 0 or more"):
        rverror.load_model(path)
