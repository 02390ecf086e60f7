"""The table of checked numbers (RV-40E, 5 um unless said): what theory says each part error does to the output.

The numbers were computed twice outside this package, in closed form and by an equilibrium of the whole gear train.
Each is also written here as its formula, so that neither a misprint nor the code decides alone.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import rverror
from rverror.base.arrays import Array, radial_and_tangential
from rverror.geartrain.action_line import ErrorVector, project
from rverror.geartrain.contacts import closed_form_forces, pose
from rverror.geartrain.kinematics import folded_order

ARCSEC = math.pi / 648000
E = 0.005  # mm
Z1, Z2, Z_C, Z_P, R = 9, 27, 39, 40, 121
R1, R6, R_P, A = 6.75, 27.0, 64.0, 1.25  # mm
F = 117 / 121
UNIT = rverror.reducer("RV-40E")
THETA = 2 * np.pi * np.arange(4096) / 4096 + 1e-4
BOTH = pytest.mark.parametrize("direction", [1, -1])
EXACT: dict[str, float] = {"rtol": 1e-9, "atol": 0}


def rows(key: str, direction: int, unit: rverror.Reducer = UNIT, **indices: Any) -> dict[str, Array]:
    """Influence of one source by parameter name, rad per mm or rad."""
    found = rverror.influence(unit, THETA, key, direction=direction, **indices)
    return dict(zip(found.labels, found.matrix, strict=True))


def over_cams(parameter: str, key: str, direction: int) -> Array:
    parts = [rows(key, direction, disc=k, crank=j)[parameter] for k in range(UNIT.discs) for j in range(UNIT.cranks)]
    return np.sum(parts, axis=0)


def amplitude(waveform: Array, order: int) -> float:
    return float(2 * abs(np.fft.rfft(waveform)[order]) / waveform.size)


def by_hand(direction: int, contact: str, vector: Array) -> Array:
    motion = pose(UNIT, THETA, direction=direction)
    return project(closed_form_forces(motion), ErrorVector(contact=contact, vector=vector), THETA.size)[0]


def sun_turned(direction: int) -> Array:
    """The sun's teeth move by r1 along the tangent at every pitch point per rad; the line of action takes its part."""
    _, tangential = radial_and_tangential(THETA + np.pi * np.arange(2)[:, None])
    return by_hand(direction, "mesh", (R1 * tangential)[None, :, None])


def ring_turned(direction: int) -> Array:
    return R_P * rows("cycloid.pin_circle", direction, harmonic=0)["tangential_cos"]


@BOTH
def test_sun_turned(direction: int) -> None:
    np.testing.assert_allclose(sun_turned(direction), 1 / R, **EXACT)


def test_sun_that_leads_its_reading_turns_the_output_alike() -> None:
    leads = rverror.influence(UNIT, np.array([0.0, 2 * np.pi]), "sensor.input_coupling", harmonic=1).matrix[0]
    np.testing.assert_allclose(leads, 1 / R, **EXACT)


@BOTH
def test_pin_ring_turned(direction: int) -> None:
    np.testing.assert_allclose(ring_turned(direction), 120 / 121, **EXACT)


@BOTH
def test_pin_ring_and_sun_turned_together_turn_the_output_as_much(direction: int) -> None:
    np.testing.assert_allclose(ring_turned(direction) + sun_turned(direction), 1, **EXACT)


@BOTH
def test_every_crank_turned_against_its_planet(direction: int) -> None:
    total = sum(rows("crank.index", direction, crank=j)["angle"] for j in range(2)) * E / A
    np.testing.assert_allclose(total, -(Z2 / Z1) / R * E / A, **EXACT)
    np.testing.assert_allclose(total / ARCSEC, -20.456, atol=5e-4)


@BOTH
def test_tangential_at_all_cams(direction: int) -> None:
    total = over_cams("tangential", "crank.eccentricity", direction) * E
    np.testing.assert_allclose(total, -(Z2 / Z1) / R * E / A, **EXACT)  # a crank that leads by e/a
    np.testing.assert_allclose(total / ARCSEC, -20.456, atol=5e-4)


@BOTH
def test_tangential_at_all_disc_bores(direction: int) -> None:
    total = over_cams("tangential", "cycloid.disc_bore_position", direction) * E
    np.testing.assert_allclose(total, F * E / R6, **EXACT)  # each disc turned by e/r6 on its cranks
    np.testing.assert_allclose(total / ARCSEC, 36.934, atol=5e-4)


@BOTH
def test_tangential_at_all_carrier_bores(direction: int) -> None:
    total = sum(rows("coupling.carrier_bore_position", direction, crank=j)["tangential"] for j in range(2)) * E
    np.testing.assert_allclose(total, -E / R6, **EXACT)
    np.testing.assert_allclose(total / ARCSEC, -38.197, atol=5e-4)


@BOTH
def test_radial_at_all_cams_makes_no_order_40(direction: int) -> None:
    """Larger eccentricity of all cams: a ripple as the loaded pins change, 40 times per crank turn, and nothing else.

    Taken every 720th of a turn, that order 1560 folds onto 120; seen at any rate it is not 40.
    """
    total = over_cams("radial", "crank.eccentricity", direction) * E / ARCSEC
    assert 0.1 < np.ptp(total) < 0.2
    keys = [("crank.eccentricity", {"crank": j, "disc": k}) for j in range(2) for k in range(2)]
    effects = tuple(rverror.effect(key, radial=E, **indices) for key, indices in keys)
    later = rverror.transmission_error(rverror.Model(UNIT, effects), THETA + 2 * np.pi / 1560, direction=direction)
    np.testing.assert_allclose(later / ARCSEC, total, atol=1e-9)  # so whole multiples of 1560 only
    assert folded_order(1560, 720) == 120
    assert amplitude(total, 40) < 1e-5  # what high harmonics of 1560 fold onto it


@BOTH
@pytest.mark.parametrize("parameter", ["radial", "tangential"])
@pytest.mark.parametrize(("cranks", "peak_to_peak"), [(2, 18.467), (3, 12.31)])
def test_one_cam(direction: int, parameter: str, cranks: int, peak_to_peak: float) -> None:
    unit = rverror.reducer("RV-40E", cranks=cranks)
    waveform = rows("crank.eccentricity", direction, unit, crank=0, disc=0)[parameter] * E
    order_40 = 2 * amplitude(waveform, 40)
    assert order_40 / ARCSEC == pytest.approx(peak_to_peak, rel=1e-3)
    assert order_40 == pytest.approx(F * E / (cranks * R6), rel=1e-3)  # 2 (F / n_discs) e / (n_cranks r6), 2 discs
    rest = waveform - waveform.mean()
    assert np.ptp(rest) == pytest.approx(order_40, rel=2e-3)  # nothing else to speak of


@BOTH
@pytest.mark.parametrize(("key", "expected"), [("cycloid.disc_pitch", 6.725), ("cycloid.disc_profile", 9.90)])
@pytest.mark.parametrize("parameter", ["cos", "sin"])
def test_first_harmonic_of_one_disc(direction: int, key: str, expected: float, parameter: str) -> None:
    waveform = rows(key, direction, disc=0, harmonic=1)[parameter] * E / ARCSEC
    assert amplitude(waveform, 40) == pytest.approx(expected, rel=1e-3)


@BOTH
@pytest.mark.parametrize("key", ["cycloid.disc_pitch", "cycloid.disc_profile"])
@pytest.mark.parametrize("parameter", ["cos", "sin"])
def test_the_same_on_both_discs_equally_oriented_is_nothing(direction: int, key: str, parameter: str) -> None:
    one, other = (rows(key, direction, disc=k, harmonic=1)[parameter] for k in range(2))
    np.testing.assert_allclose(one + other, 0, atol=1e-9 * np.abs(one).max())


@BOTH
def test_one_of_two_gear_meshes(direction: int) -> None:
    """Error e that leads the teeth along the loaded line of action, which carries (z2/z1) / (2 R r2 cos(alpha))."""
    motion = pose(UNIT, THETA, direction=direction)
    flank = 0 if direction > 0 else 1
    normal = motion.mesh_normal[:1, flank : flank + 1]  # type: ignore[attr-defined]
    error = ErrorVector(contact="mesh", vector=direction * normal[None], at=(slice(0, 1), slice(flank, flank + 1)))
    total = project(closed_form_forces(motion), error, THETA.size)[0] * E
    np.testing.assert_allclose(total, E / (2 * R * R1 * math.cos(math.radians(20))), **EXACT)
    np.testing.assert_allclose(total / ARCSEC, 0.672, rtol=1e-3)


@BOTH
@pytest.mark.parametrize("axis", [0, 1])
def test_pin_ring_and_carrier_axis_shifted_together(direction: int, axis: int) -> None:
    """A shift of the ring is a wave of one period; the carrier's shift, fixed in the housing, turns in its frame."""
    ring = rows("cycloid.pin_circle", direction, harmonic=1)
    shift = ring["radial_cos"] - ring["tangential_sin"] if axis == 0 else ring["radial_sin"] + ring["tangential_cos"]
    runout = rows("coupling.carrier_runout", direction)
    cos, sin = np.cos(THETA), np.sin(THETA)
    carrier = cos * runout["x"] - sin * runout["y"] if axis == 0 else sin * runout["x"] + cos * runout["y"]
    sun = rows("involute.sun_offset", direction)["xy"[axis]]
    np.testing.assert_allclose(shift + carrier + sun, 0, atol=1e-9 / R6)
    np.testing.assert_allclose(sun, 0, atol=1e-9 / R6)  # the sun floats: whether it moves along does not matter


@BOTH
def test_table_of_orders(direction: int) -> None:
    """Where an error is fixed decides its order: pins 39 h (two discs leave 78), discs and cranks 40, sun 120."""

    def strongest(waveform: Array) -> int:
        return int(np.argmax(np.abs(np.fft.rfft(waveform - waveform.mean()))))

    assert strongest(rows("cycloid.pin_position", direction, pin=3)["tangential"]) == 78
    assert strongest(rows("involute.planet_eccentricity", direction, crank=1)["x"]) == 40
    assert strongest(rows("cycloid.disc_bore_position", direction, disc=1, crank=0)["radial"]) == 40
    assert strongest(rows("involute.sun_pitch", direction, harmonic=2)["cos"]) == 240  # 120 h; odd h cancel
    np.testing.assert_allclose(rows("involute.sun_pitch", direction, harmonic=1)["cos"], 0, atol=1e-12)
