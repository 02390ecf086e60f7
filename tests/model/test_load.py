"""Torsion of the output side: a lag proportional to the torque, of either sign of motion, and nothing else."""

from __future__ import annotations

import math

import numpy as np
import pytest

import rverror
from rverror import Model
from rverror.base.units import to_core

ARCSEC = math.pi / 648000
UNIT = rverror.reducer("RV-40E")
THETA = np.linspace(0, 2 * np.pi / 40, 12)
SOFT = rverror.effect("load.torsion", compliance="0.5 arcsec/(N*m)")


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize("torque", [0.0, 20e3, "412 N*m"])
def test_output_lags_by_compliance_times_torque(direction: int, torque: float | str) -> None:
    te = rverror.transmission_error(Model(UNIT, (SOFT,)), THETA, direction=direction, torque=torque)
    size = {0.0: 0.0, 20e3: 10.0, "412 N*m": 206.0}[torque]
    np.testing.assert_allclose(te / ARCSEC, -direction * size, rtol=1e-12)


def test_lost_motion_between_the_directions_is_twice_the_windup() -> None:
    theta = np.concatenate([THETA, THETA[::-1]])
    te = rverror.transmission_error(Model(UNIT, (SOFT,)), theta, torque=20e3)
    assert np.ptp(te) / ARCSEC == pytest.approx(20)


@pytest.mark.parametrize("direction", [1, -1])
def test_equilibrium_adds_it_to_the_windup_of_the_contacts(direction: int) -> None:
    other = rverror.effect("crank.eccentricity", crank=0, disc=0, radial="5 um")
    for torque in (20e3, 412e3):
        with_it, without = (
            rverror.equilibrium(Model(UNIT, effects), THETA, torque=torque, direction=direction)
            for effects in ((other, SOFT), (other,))
        )
        change = with_it.transmission_error - without.transmission_error
        np.testing.assert_allclose(change / ARCSEC, -direction * 0.5 * torque / 1e3, rtol=1e-9)
        np.testing.assert_array_equal(with_it.loaded_pins, without.loaded_pins)


def test_needs_the_torque_and_says_so() -> None:
    message = r"load\.torsion needs the torque; give torque, or a run file with output_torque"
    with pytest.raises(ValueError, match=message):
        rverror.influence(UNIT, THETA, "load.torsion")
    with pytest.raises(ValueError, match=message):
        rverror.transmission_error(Model(UNIT, (SOFT,)), THETA)


def test_a_compliance_is_not_negative() -> None:
    with pytest.raises(ValueError, match=r"compliance = -1 arcsec/\(N\*m\): must be 0 or more"):
        rverror.effect("load.torsion", compliance="-1 arcsec/(N*m)")


def test_the_tilt_of_the_output_is_mirrored_in_the_eccentric_direction() -> None:
    """Reversed torque pushes a disc as far on the other side of its eccentric direction, which is at -39 theta."""
    unit, theta = rverror.reducer("RV-40E"), np.linspace(0, 2 * np.pi, 4096, endpoint=False)
    waves = []
    for direction in (1.0, -1.0):
        rows = rverror.influence(unit, theta, "sensor.output_tilt", direction=direction, torque=1.0).matrix
        waves.append(np.mean((rows[0] + 1j * rows[1]) * np.exp(39j * theta)))  # what turns with the eccentric
    forward, reverse = waves
    assert abs(forward) == pytest.approx(1.0, abs=0.01)  # all of it, but for the ripple of the pins
    assert np.angle(forward) == pytest.approx(-np.angle(reverse), abs=1e-3)
    # inwards by a tangent of (1/K - (1 - K^2)/(2 K^2) ln((1 + K)/(1 - K)))/(pi/2), against the load across
    k = unit.eccentricity * unit.pins / unit.pin_circle_radius
    inwards = math.atan((1 / k - (1 - k**2) / (2 * k**2) * math.log((1 + k) / (1 - k))) / (math.pi / 2))
    assert abs(np.angle(forward)) == pytest.approx(math.pi / 2 - inwards, abs=0.02)


@pytest.mark.parametrize(("key", "order"), [("load.torsion_wave", 3), ("load.input_torsion_wave", 3 * 121)])
def test_what_gives_way_unevenly_lags_with_the_load(key: str, order: int) -> None:
    unit, theta = rverror.reducer("RV-40E"), np.linspace(0, 2 * np.pi, 4096, endpoint=False)
    size = 1e-9  # rad per N*mm
    for direction, torque in ((1.0, 2e5), (-1.0, 2e5), (1.0, 1e5)):
        rows = rverror.influence(unit, theta, key, direction=direction, torque=torque, harmonic=3).matrix
        wave = 2 * np.mean((rows.T @ [size, 0.0]) * np.exp(-1j * order * theta))
        assert wave == pytest.approx(-direction * torque * size, rel=1e-9)
    with pytest.raises(ValueError, match="needs the torque"):
        rverror.influence(unit, theta, key, direction=1.0, harmonic=3)


@pytest.mark.parametrize(
    ("key", "most"),
    [
        ("empirical.order_by_load", "60 arcsec/(kN*m)"),
        ("load.torsion_wave", "10 arcsec/(kN*m)"),
        ("load.input_torsion_wave", "10 arcsec/(kN*m)"),
        ("sensor.output_tilt", "10 arcsec/(kN*m)"),
    ],
)
def test_plausible_windup_is_stated_per_kilonewton_metre(key: str, most: str) -> None:
    expected = to_core(most, "compliance")
    assert [one.plausible for one in rverror.CATALOGUE[key].parameters] == pytest.approx([expected] * 2, rel=1e-12)
