"""Thermal growth: a similarity leaves the output alone, and each part grows as its own errors would have it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

import rverror
from rverror import Effect, Model, Reducer
from rverror.geartrain.contacts import closed_form_forces, pose
from rverror.geartrain.cycloid import profile
from rverror.geartrain.mechanism import Stiffness
from rverror.geartrain.thermal import EXPANSION
from rverror.model.compose import source_matrix
from rverror.statics.loaded_state import linearise
from strategies import Array, angles, reducers

PARTS = ("housing", "discs", "cranks", "carrier", "gears")
ARCSEC = math.pi / 648000
SOFT = Stiffness(pin_contact=5e4, crank_bearing=1e5, carrier_bearing=2e5, gear_mesh=4e4, main_bearing=5e4)
UNITS = {
    "RV-40E": rverror.reducer("RV-40E"),
    "soft": rverror.reducer("RV-40E", stiffness=SOFT),
    "one disc, three cranks": rverror.reducer("RV-003", discs=1),
    "four discs, pins out of phase": rverror.reducer("RV-40E", disc_lobes=38, pins=39, discs=4, cranks=3),
}


def growth(unit: Reducer, theta: Array, direction: int) -> dict[str, Array]:
    found = rverror.influence(unit, theta, "thermal.growth", direction=direction)
    return dict(zip(found.labels, found.matrix, strict=True))


def column(unit: Reducer, theta: Array, direction: int, key: str, parameter: str, **indices: Any) -> Array:
    found = rverror.influence(unit, theta, key, direction=direction, **indices)
    return np.asarray(found.matrix[found.labels.index(parameter)])


@given(reducers(), angles(), st.sampled_from([1, -1]))
def test_same_rise_of_all_parts_is_a_similarity(unit: Reducer, theta: Array, direction: int) -> None:
    motion = pose(unit, theta, direction=direction)
    matrix = source_matrix(motion, closed_form_forces(motion), "thermal.growth", {})
    assert np.abs(matrix.sum(axis=0)).max() < 1e-11 * np.abs(matrix).max()


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize("torque", [1e3, 20e3, 412e3])
@pytest.mark.parametrize("name", UNITS)
def test_same_rise_of_all_parts_leaves_the_equilibrium(name: str, torque: float, direction: int) -> None:
    """At any stiffness, also where errors and modification have lifted pins off.

    The contact forces of the state say so exactly, two solutions to what the solver leaves open.
    """
    unit = UNITS[name]
    theta = np.linspace(0.1, 0.3, 9)
    errors = (
        rverror.effect("cycloid.pin_position", pin=3, radial="4 um"),
        rverror.effect("crank.eccentricity", crank=1, disc=0, radial="5 um"),
        rverror.effect("cycloid.profile_modification", equidistant="4 um"),
    )
    warm = rverror.effect("thermal.growth", **dict.fromkeys(PARTS, 40.0))

    def output(*more: Effect) -> Array:
        model = Model(unit, errors + more)
        return rverror.equilibrium(model, theta, torque=torque, direction=direction).transmission_error

    state = linearise(Model(unit, errors), theta, torque=torque, direction=direction)
    matrix = source_matrix(state.motion, state.forces, "thermal.growth", {})
    assert np.abs(matrix.sum(axis=0)).max() < 1e-9 * np.abs(matrix).max()
    change = output(warm) - output()
    lopsided = output(rverror.effect("thermal.growth", housing=40.0)) - output()
    assert np.abs(lopsided).min() > 50 * ARCSEC
    assert np.abs(change).max() < 1e-7 * np.abs(lopsided).max()


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize("name", UNITS)
def test_each_part_grows_as_its_own_errors(name: str, direction: int) -> None:
    """Written with the other sources of the catalogue, whose signs the independent model has settled."""
    unit = UNITS[name]
    theta = np.linspace(-1, 1, 31)
    found = growth(unit, theta, direction)
    cranks, discs = range(unit.cranks), range(unit.discs)

    def total(key: str, parameter: str, *sets: dict[str, int]) -> Array:
        return np.sum([column(unit, theta, direction, key, parameter, **indices) for indices in sets], axis=0)

    both = [{"crank": j, "disc": k} for j in cranks for k in discs]
    ring = column(unit, theta, direction, "cycloid.pin_circle", "radial_cos", harmonic=0)
    pins = column(unit, theta, direction, "cycloid.pin_radius", "deviation", pin="all")
    expected = {
        "housing": unit.pin_circle_radius * ring + unit.pin_radius * pins,
        "cranks": unit.eccentricity * total("crank.eccentricity", "radial", *both),
        "carrier": unit.crank_radius
        * total("coupling.carrier_bore_position", "radial", *({"crank": j} for j in cranks)),
        # larger gears at the same distance mesh as the same gears at a smaller one
        "gears": -unit.crank_radius * total("involute.center_distance", "radial", *({"crank": j} for j in cranks)),
    }
    size = max(np.abs(row).max() for row in found.values())
    for part, row in expected.items():
        np.testing.assert_allclose(found[part], EXPANSION * row, rtol=1e-9, atol=1e-12 * size, err_msg=part)
    bores = unit.crank_radius * total("cycloid.disc_bore_position", "radial", *both)
    flanks = found["discs"] - EXPANSION * bores
    np.testing.assert_allclose(flanks, EXPANSION * grown_profile(unit, theta, direction), rtol=2e-6, atol=1e-9 * size)


def grown_profile(unit: Reducer, theta: Array, direction: int) -> Array:
    """Output error of profiles larger by the factor 1 + eps, over eps, from points of the profile and its normals."""
    motion: Any = pose(unit, theta, direction=direction)
    forces = closed_form_forces(motion)["pin"]
    carried = (forces * motion.pin_normal).sum(axis=-2)
    roll = motion.eccentric[:, None] - 2 * np.pi * np.arange(unit.pins)[:, None] / unit.pins
    here, step = profile(unit, roll.ravel()), 1e-5
    along = profile(unit, roll.ravel() + step) - profile(unit, roll.ravel() - step)
    outward = np.stack([along[1], -along[0]]) / np.hypot(*along)
    material = (here * outward).sum(axis=0).reshape(roll.shape)  # towards the pin: as a thicker pin
    return np.asarray((carried * material).sum(axis=(0, 1)))


@pytest.mark.parametrize("direction", [1, -1])
def test_a_warmer_housing_gives_play_and_warmer_discs_take_it(direction: int) -> None:
    """Ten kelvin on the RV-40E: the pin circle grows by 7.4 um, the pins by 0.35 um."""
    theta = np.linspace(0, 2 * np.pi, 4096, endpoint=False)
    found = {
        part: direction * 10 * row.mean() / ARCSEC for part, row in growth(UNITS["RV-40E"], theta, direction).items()
    }
    K, phi = 0.78125, (np.arange(4000) + 0.5) / 4000 * math.pi  # by quadrature over the loaded half
    root = np.sqrt(1 + K * K - 2 * K * np.cos(phi))
    arm = 48.75 * np.sin(phi) / root
    opened = 11.5e-5 * (64 * (1 - K * np.cos(phi)) / root - 3)
    expected = -117 / 121 * (arm * opened).sum() / (arm**2).sum() / ARCSEC
    assert found["housing"] == pytest.approx(expected, rel=5e-3)
    assert found["housing"] == pytest.approx(-27.4, abs=0.1)
    assert found["discs"] == pytest.approx(-found["housing"], rel=0.02)
    assert abs(found["cranks"]) < 0.3
    # separating force of the gears, tan(alpha)/(R r1) of it at all bores, times 3.1 um
    separating = 11.5e-5 * 27 * math.tan(math.radians(20)) / (121 * 6.75) / ARCSEC
    assert found["gears"] == pytest.approx(separating, rel=1e-9)
    assert found["carrier"] == pytest.approx(-separating, rel=1e-9)


def test_four_contacts_each_with_a_term_for_every_part() -> None:
    vectors = rverror.CATALOGUE["thermal.growth"].vector(pose(UNITS["RV-40E"], [0.1, 0.2]))
    assert isinstance(vectors, tuple)
    touched = {v.contact: {PARTS[i] for i, term in enumerate(v.vector) if term.any()} for v in vectors}
    assert touched == {
        "pin": {"housing", "discs"},
        "cam": {"discs", "cranks"},
        "carrier": {"carrier"},
        "mesh": {"gears"},
    }
    assert all(len(v.vector) == len(PARTS) for v in vectors)


def test_rises_are_differences_of_temperature() -> None:
    assert rverror.effect("thermal.growth", discs="12 delta_degC").values == (0, 12, 0, 0, 0)
    with pytest.raises(ValueError, match=r"thermal\.growth: discs: 'degC' is a temperature, not a rise"):
        rverror.effect("thermal.growth", discs="12 degC")
