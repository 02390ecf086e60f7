"""Pin contacts and disc profile against the public package cycloidgen (optional: the `reference` extra).

Its frame is ours, senses too.  Its disc stands at E (cos p, -sin p), turned by p / lobes, at the crank angle p;
our eccentric direction is -z_c theta plus the phase of the disc, and the disc is turned by theta: p = -eccentric.  (The
phase turns its disc by a part of a lobe more, as a second disc is made; the pins' contacts are the same.)  Its normals
point from the disc to the pin, ours from the pin into the disc: normals and arms have opposite signs.  Its profile runs
by t = -roll angle / z_c.  Its R, Rr, E are pin_circle_radius, pin_radius, eccentricity.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

import rverror
from rverror.geartrain.contacts import pose
from rverror.geartrain.cycloid import pin_positions, profile

reference = pytest.importorskip("cycloidgen.core.kinematics", reason="the extra rverror[reference] is not installed")
curve = pytest.importorskip("cycloidgen.core.profile")

TOLERANCE = 1e-9  # mm
UNITS = {
    "RV-40E": rverror.reducer("RV-40E"),
    "RV-003": rverror.reducer("RV-003"),
    "three discs": rverror.reducer("RV-003", discs=3),
    "few lobes": rverror.reducer("RV-40E", disc_lobes=11, pins=12, eccentricity=2.5, pin_radius=5.0),
}
THETA = np.linspace(-1.0, 7.0, 23)


def numbers(unit: rverror.Reducer) -> tuple[float, float, float, int]:
    return unit.pin_circle_radius, unit.pin_radius, unit.eccentricity, unit.disc_lobes


@pytest.fixture(params=UNITS, ids=str)
def unit(request: pytest.FixtureRequest) -> rverror.Reducer:
    return UNITS[request.param]


def test_arms_normals_and_contact_points(unit: rverror.Reducer) -> None:
    motion = pose(unit, THETA, direction=1.0)
    gamma = pin_positions(unit)
    pins = unit.pin_circle_radius * np.stack([np.cos(gamma), np.sin(gamma)], axis=1)
    for k in range(unit.discs):
        for i in range(THETA.size):
            found = reference.contacts_at(*numbers(unit), -float(motion.eccentric[k, i]))
            normal = motion.pin_normal[k, :, :, i]
            np.testing.assert_allclose(found.normals, -normal, rtol=0, atol=1e-10)
            np.testing.assert_allclose(found.moment_arms, -motion.pin_arm[k, :, i], rtol=0, atol=TOLERANCE)
            np.testing.assert_allclose(found.points, pins + unit.pin_radius * normal, rtol=0, atol=TOLERANCE)


def test_same_side_carries_and_shares_alike(unit: rverror.Reducer) -> None:
    """Its torque drives as our load in forward motion; forces in proportion to the arms on that side."""
    motion = pose(unit, THETA[:1], direction=1.0)
    found = reference.contacts_at(*numbers(unit), -float(motion.eccentric[0, 0]))
    arm = np.maximum(motion.pin_arm[0, :, 0], 0)
    np.testing.assert_array_equal(found.loaded_mask, arm > 0)
    np.testing.assert_allclose(found.forces(1e3), 1e3 * arm / (arm**2).sum(), rtol=1e-9, atol=1e-9)


def test_profile(unit: rverror.Reducer) -> None:
    roll = np.linspace(0, 2 * np.pi * unit.disc_lobes, 1001)
    found = curve.disc_profile(-roll / unit.disc_lobes, *numbers(unit))
    np.testing.assert_allclose(profile(unit, roll).T, found, rtol=0, atol=TOLERANCE)


def test_contacts_lie_on_the_profile_and_are_normal_to_it(unit: rverror.Reducer) -> None:
    """Our contact points, seen in disc 0, against its curve at the same polar angle, found by root, not by mapping."""
    motion = pose(unit, THETA[:3], direction=1.0)
    gamma = pin_positions(unit)
    step = np.array([-1e-6, 1e-6])
    for i, theta in enumerate(motion.theta):
        turn = np.array([[np.cos(theta), np.sin(theta)], [-np.sin(theta), np.cos(theta)]])  # housing to disc
        direction = np.array([np.cos(motion.eccentric[0, i]), np.sin(motion.eccentric[0, i])])
        for pin in range(unit.pins):
            normal = motion.pin_normal[0, pin, :, i]
            centre = unit.pin_circle_radius * np.array([np.cos(gamma[pin]), np.sin(gamma[pin])])
            point = turn @ (centre + unit.pin_radius * normal - unit.eccentricity * direction)
            psi = np.arctan2(point[1], point[0])
            assert np.angle(np.exp(1j * (psi - motion.pin_angle[0, pin, i]))) == pytest.approx(0, abs=1e-12)

            def ahead(t: float, psi: float = psi) -> float:
                """By how much its curve, which runs clockwise, is ahead of our contact angle."""
                x, y = curve.disc_profile(np.array([t]), *numbers(unit))[0]
                return float(np.angle(np.exp(1j * (np.arctan2(y, x) - psi))))

            lobe = np.pi / unit.disc_lobes
            t = brentq(ahead, -psi - lobe, -psi + lobe, xtol=1e-15)
            on_curve = curve.disc_profile(np.array([t]), *numbers(unit))[0]
            np.testing.assert_allclose(point, on_curve, rtol=0, atol=TOLERANCE)
            before, after = curve.disc_profile(t + step, *numbers(unit))
            tangent = (after - before) / np.linalg.norm(after - before)
            assert abs(tangent @ (turn @ normal)) < 1e-5  # a difference quotient across a sharp root
            np.testing.assert_allclose(
                curve.profile_normal(np.array([t]), unit.pin_circle_radius, unit.eccentricity, unit.disc_lobes)[0],
                -turn @ normal,
                rtol=0,
                atol=1e-9,
            )


def test_smallest_convex_radius(unit: rverror.Reducer) -> None:
    """Above it the profile is undercut, and both say so at the same pin radius."""
    found = curve.critical_radius(unit.pin_circle_radius, unit.eccentricity, unit.disc_lobes)
    assert unit.smallest_convex_radius == pytest.approx(found, rel=1e-9)
