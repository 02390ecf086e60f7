"""The simulator of benchmarks/real_bench: it is the oracle where that can go, and right where it cannot."""

from __future__ import annotations

import math
import sys
from typing import Any

import numpy as np
import pytest

import rverror
from oracle import REALISTIC, Errors, Oracle, put
from pages import ROOT

sys.path.append(str(ROOT / "benchmarks"))

from real_bench.simulator import (
    Bench,
    Law,
    PartErrors,
    Reality,
    lobe_shape,
    put_effect,
    transmission_error,
    trochoid,
)

ARCSEC = math.pi / 648000
UNIT = rverror.reducer("RV-40E")
#: Golden-ratio steps: irregular against every order, and the same each time.
ANGLES = 2 * np.pi * np.mod(0.05 + 0.6180339887 * np.arange(24), 1)

#: The oracle has no back flanks: so much play that none touches.
LOOSE = Reality(springs=REALISTIC, backlash=0.2)

#: Errors of every kind of contact, um.
MANY: list[tuple[str, dict[str, Any], dict[str, float]]] = [
    ("cycloid.disc_pitch", {"disc": 0, "harmonic": 2}, {"cos": 9, "sin": -7}),
    ("cycloid.disc_profile", {"disc": 1, "harmonic": 4}, {"cos": -6, "sin": 4}),
    ("cycloid.pin_position", {"pin": 11}, {"radial": -20, "tangential": 22}),
    ("cycloid.pin_position", {"pin": 30}, {"radial": 18, "tangential": 9}),
    ("cycloid.pin_radius", {"pin": 4}, {"deviation": 15}),
    ("crank.eccentricity", {"crank": 1, "disc": 0}, {"radial": 8, "tangential": -10}),
    ("cycloid.disc_bore_position", {"disc": 1, "crank": 0}, {"radial": 10, "tangential": 6}),
    ("coupling.carrier_bore_position", {"crank": 0}, {"radial": -12, "tangential": 15}),
    ("involute.planet_eccentricity", {"crank": 0}, {"x": 25, "y": -16}),
]


def errors_of(parts: list[tuple[str, dict[str, Any], dict[str, float]]], scale: float = 1e-3) -> PartErrors:
    errors = PartErrors(UNIT)
    for key, indices, sizes in parts:
        put_effect(errors, UNIT, key, indices, {name: size * scale for name, size in sizes.items()})
    return errors


def outputs(
    parts: list[tuple[str, dict[str, Any], dict[str, float]]],
    theta: np.ndarray = ANGLES,
    *,
    sense: int = 1,
    torque: float = 20e3,
    reality: Reality | None = None,
) -> np.ndarray:
    """Turn of the carrier, arcsec."""
    reality = reality or Reality(springs=REALISTIC)
    return transmission_error(UNIT, theta, errors_of(parts), reality, sense=sense, torque=torque)[0] / ARCSEC


def in_oracle(
    parts: list[tuple[str, dict[str, Any], dict[str, float]]], *, sense: int, torque: float
) -> tuple[Oracle, Errors]:
    """The tests' oracle with the same errors."""
    errors = Errors(UNIT, 1)
    for key, indices, sizes in parts:
        for name, size in sizes.items():
            put(errors, UNIT, 0, (key, indices, name), size * 1e-3)
    errors.thinning += LOOSE.backlash / math.cos(UNIT.pressure_angle)
    return Oracle(UNIT, ANGLES, sense=sense, torque=torque, springs=REALISTIC), errors


@pytest.mark.parametrize("sense", [1, -1], ids=["forward", "reverse"])
def test_it_is_the_oracle_where_contacts_are_linear(sense: int) -> None:
    parts = [(key, indices, {name: size / 20 for name, size in sizes.items()}) for key, indices, sizes in MANY]
    oracle, errors = in_oracle(parts, sense=sense, torque=100e3)
    oracle.base()
    expected = oracle.solve(errors)[0, :, 2] / ARCSEC
    np.testing.assert_allclose(outputs(parts, sense=sense, torque=100e3, reality=LOOSE), expected, atol=1e-3)
    # it counts a wave of the pitch where the pin would touch without it
    smooth = [part for part in parts if part[0] != "cycloid.disc_pitch"]
    oracle, errors = in_oracle(smooth, sense=sense, torque=100e3)
    oracle.base()
    expected = oracle.solve(errors)[0, :, 2] / ARCSEC
    np.testing.assert_allclose(outputs(smooth, sense=sense, torque=100e3, reality=LOOSE), expected, atol=1e-6)


@pytest.mark.parametrize("sense", [1, -1], ids=["forward", "reverse"])
def test_forces_of_the_oracle_balance_at_light_load_and_large_errors(sense: int) -> None:
    """Errors of up to 30 um at 5 N*m."""
    oracle, errors = in_oracle(MANY[1:], sense=sense, torque=5e3)
    bench = Bench(UNIT, ANGLES, errors_of(MANY[1:]), LOOSE, sense=sense, torque=5e3)
    pose = bench.poses()
    compression, gradient, stiffness, one_sided = oracle.contacts(pose[None], errors)
    force = stiffness * np.where(one_sided, np.maximum(compression, 0), compression)
    balance = np.einsum("cam,camq->caq", force, gradient)[0]
    balance[:, 2] += sense * 5e3
    # pins that jam a disc turn its cranks until the back flanks touch, which the oracle has not
    driven = (bench.linear(pose).flanks[:, UNIT.cranks :] < 0).all(axis=1)
    assert driven.mean() > 0.6
    assert abs(balance[driven]).max() < 1e-3 * 5e3 / UNIT.crank_radius


@pytest.mark.parametrize("torque", [5e3, 200e3], ids=["5 N*m", "200 N*m"])
@pytest.mark.parametrize("clearance", [0.0, 6.0])
@pytest.mark.parametrize("exponent", [1.0, 10 / 9])
def test_forces_balance_as_the_derivative_of_an_energy_written_out(
    torque: float, clearance: float, exponent: float
) -> None:
    """Errors of up to 30 um at light load, clearance and a power law: the energy does not fall any way."""
    errors = errors_of(MANY[2:])  # by waves a normal tilts, which the oracle leaves out
    errors.cam_clearance, errors.carrier_clearance = clearance * 1e-3, clearance * 1e-3 / 2
    laws = Law(exponent=exponent, reference=70.0), Law(exponent=exponent, reference=200.0)
    reality = Reality(springs=REALISTIC, pin_law=laws[0], flank_law=laws[1])
    theta = ANGLES[:6]
    bench = Bench(UNIT, theta, errors, reality, sense=1, torque=torque)
    pose = bench.poses()

    def energy(u: np.ndarray) -> np.ndarray:
        at = bench.linear(u)
        total = torque * u[:, 2]
        for closing, stiffness, law in (
            (at.pins.reshape(len(u), -1), REALISTIC.pin, laws[0]),
            (at.flanks, REALISTIC.mesh, laws[1]),
        ):
            force = law.reference * (stiffness * np.maximum(closing, 0) / law.reference) ** law.exponent
            total = total + (force * np.maximum(closing, 0) / (law.exponent + 1)).sum(axis=1)
        distance = np.maximum(np.hypot(at.joints[..., 0], at.joints[..., 1]) - at.clearance, 0)
        return np.asarray(total + (at.stiffness * distance**2 / 2).sum(axis=1))

    step = 1e-8
    for column in range(bench.unknowns):
        move = step * (np.arange(bench.unknowns) == column)
        slope = (energy(pose + move) - energy(pose - move)) / (2 * step)
        assert abs(slope).max() < 1e-4 * torque / UNIT.crank_radius, column


def test_clearances_do_what_the_design_says() -> None:
    count = 128
    theta = 0.3 + 2 * np.pi / 40 * np.arange(count) / count
    clean = outputs([], theta).mean()
    cams = outputs([("crank.bearing_clearance", {}, {"clearance": 5.0})], theta)
    waves = 2 * abs(np.fft.rfft(cams)) / count
    assert waves[2] == pytest.approx(2.73, abs=0.02)
    assert waves[4] == pytest.approx(0.65, abs=0.02)
    assert cams.mean() - clean == pytest.approx(-39, abs=0.2)
    carrier = outputs([("coupling.bearing_clearance", {}, {"clearance": 5.0})], theta)
    assert carrier.mean() - clean == pytest.approx(-38.2, abs=0.05)
    assert carrier.std() < 1e-3


def test_windup_follows_the_power_law_where_bearings_are_rigid() -> None:
    """All of it is then of pins and flanks: sixteen times the load closes them 16^(1/n) times as far."""
    springs = type(REALISTIC)(pin=2e5, cam=1e10, carrier=1e10, mesh=2e5, sun=1e2, main=1e10)
    for exponent in (1.0, 10 / 9, 1.5):
        law = Law(exponent=exponent, reference=100.0)
        reality = Reality(springs=springs, pin_law=law, flank_law=law, backlash=0.0)
        light, heavy = (outputs([], ANGLES[:4], torque=t, reality=reality).mean() for t in (1e3, 16e3))
        assert heavy / light == pytest.approx(16 ** (1 / exponent), rel=2e-3)


def test_backlash_lags_each_way_and_ripples_nothing() -> None:
    for sense in (1, -1):
        loose, tight = (
            outputs([], sense=sense, reality=Reality(springs=REALISTIC, backlash=play)) for play in (0.02, 0.0)
        )
        assert (loose - tight).mean() == pytest.approx(-sense * 2 * 2 * 0.672, abs=5e-3)
        assert (loose - tight).std() < 1e-3


@pytest.mark.parametrize("disc", [0, 1])
def test_a_lobe_has_its_crest_where_the_profile_is_highest(disc: int) -> None:
    s = np.linspace(0, 2 * np.pi, 200001)
    point, first, _ = trochoid(UNIT, disc, s)
    profile = point - 1j * UNIT.pin_radius * first / abs(first)
    shape = lobe_shape(UNIT, disc, 3, np.angle(profile))
    assert abs(profile)[shape.argmax()] == pytest.approx(abs(profile).max(), abs=1e-6)
    assert abs(profile)[shape == 0].min() == pytest.approx(abs(profile).min(), abs=1e-6)
    total = sum(lobe_shape(UNIT, disc, lobe, np.angle(profile)) for lobe in range(UNIT.disc_lobes))
    assert np.asarray(total).max() == pytest.approx(1)
    eccentric = math.pi * disc
    first_lobe = np.mod(np.angle(profile)[lobe_shape(UNIT, disc, 0, np.angle(profile)).argmax()] - eccentric, 2 * np.pi)
    assert 0.5 <= first_lobe / (2 * np.pi / UNIT.disc_lobes) + 1e-3 < 1.5


def test_a_pose_found_from_another_one_is_the_same() -> None:
    errors, reality = errors_of(MANY), Reality(springs=REALISTIC)
    settings = {"sense": 1, "torque": 5e3}
    fresh, _ = transmission_error(UNIT, ANGLES, errors, reality, **settings)
    _, other = transmission_error(UNIT, ANGLES, errors_of(MANY[:3]), reality, **settings)
    again, _ = transmission_error(UNIT, ANGLES, errors, reality, **settings, start=other)
    np.testing.assert_allclose(again / ARCSEC, fresh / ARCSEC, atol=2e-3)


def test_its_errors_are_of_second_order_from_those_of_the_package() -> None:
    """A dozen errors of 5 um: 0.03 to 0.15 arcsec."""
    parts = [
        ("cycloid.disc_pitch", {"disc": 0, "harmonic": 1}, {"cos": 5, "sin": 0}),
        ("cycloid.disc_pitch", {"disc": 1, "harmonic": 2}, {"cos": 0, "sin": -5}),
        ("crank.eccentricity", {"crank": 0, "disc": 0}, {"radial": 5, "tangential": 0}),
        ("crank.eccentricity", {"crank": 1, "disc": 0}, {"radial": 0, "tangential": -5}),
        ("cycloid.disc_bore_position", {"disc": 1, "crank": 1}, {"radial": 0, "tangential": 5}),
        ("coupling.carrier_bore_position", {"crank": 0}, {"radial": 0, "tangential": 5}),
        ("cycloid.pin_position", {"pin": 3}, {"radial": 0, "tangential": 5}),
        ("cycloid.pin_position", {"pin": 17}, {"radial": -5, "tangential": 0}),
        ("crank.bearing_clearance", {}, {"clearance": 5}),
    ]
    theta = 2 * np.pi * np.arange(256) / 256 + 0.01
    model = rverror.Model(
        UNIT, tuple(rverror.effect(key, **i, **{n: f"{v} um" for n, v in sizes.items()}) for key, i, sizes in parts)
    )
    for sense in (1, -1):
        expected = rverror.equilibrium(model, theta, torque=20e3, direction=sense).transmission_error / ARCSEC
        difference = outputs(parts, theta, sense=sense) - expected
        assert 0.01 < difference.std() < 0.2


def test_without_what_is_quadratic_its_errors_are_those_of_the_package() -> None:
    parts = [part for part in MANY if part[0] != "involute.planet_eccentricity"]
    parts.append(("cycloid.disc_lobe", {"disc": 1, "lobe": 7}, {"deviation": 30.0}))
    model = rverror.Model(
        UNIT, tuple(rverror.effect(key, **i, **{n: f"{v} um" for n, v in sizes.items()}) for key, i, sizes in parts)
    )
    theta = 2 * np.pi * np.arange(64) / 64 + 0.01
    for torque in (20e3, 200e3):
        expected = rverror.equilibrium(model, theta, torque=torque, direction=1).transmission_error / ARCSEC
        first, exact = (
            outputs(parts, theta, torque=torque, reality=Reality(springs=REALISTIC, first_order=only))
            for only in (True, False)
        )
        assert (first - expected).std() < 0.12 < (exact - expected).std()
