"""Contact pressure against Hertz's own figures, the drawn profile and the integral behind Stribeck's number."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.integrate import quad

import rverror
from rverror import Model, Reducer
from rverror.geartrain.cycloid import profile, trochoid_curvature
from rverror.statics import RollerBearing, contact_pressure
from strategies import reducers

UNIT = rverror.reducer("RV-40E")
THETA = 2 * np.pi / 40 * np.arange(32) / 32
BEARING = RollerBearing(rollers=14, roller_diameter="5 mm", roller_length="8 mm", race_diameter="20 mm")


def pressed(unit: Reducer = UNIT, torque: str = "412 N*m", **more: object) -> rverror.statics.ContactPressure:
    return contact_pressure(Model(unit), THETA, torque=torque, disc_width=9.0, gear_width=8.0, **more)


def test_pressure_over_the_strip_is_the_force() -> None:
    """The pressure stands over the strip as half an ellipse, whose volume is the force."""
    found = pressed(cam_bearing=BEARING)
    for contact, width in (("pin", 9.0), ("mesh", 8.0), ("cam", 8.0)):
        ellipse = math.pi / 2 * found.pressure[contact] * found.half_width[contact] * width
        np.testing.assert_allclose(ellipse, found.force[contact], rtol=1e-12, atol=1e-9)


def test_gears_by_the_handbooks_steel_number() -> None:
    """p = 0.418 sqrt(F E / (b R)) for steel on steel, at the pitch point: R = sin 20 deg (6.75 || 20.25) mm."""
    found = pressed()
    radius = math.sin(math.radians(20)) * 6.75 * 20.25 / 27
    by_hand = 0.418 * np.sqrt(found.force["mesh"] * 206e3 / (8 * radius))
    np.testing.assert_allclose(found.pressure["mesh"], by_hand, rtol=1e-3)
    # two planets share 412 N*m / 121 at the sun's base circle
    np.testing.assert_allclose(
        found.force["mesh"].mean(), 412e3 / 121 / 2 / (6.75 * math.cos(math.radians(20))), rtol=1e-3
    )


@given(unit=reducers(), at=st.floats(0.05, 2 * math.pi - 0.05))
@settings(max_examples=40, deadline=None)
def test_a_pins_radius_is_that_of_the_drawn_profile(unit: Reducer, at: float) -> None:
    """1/r + 1/rho, with rho of three points of the profile that the disc is cut to."""
    step = 1e-4
    (x, y) = profile(unit, at + step * np.arange(-2, 3))
    second = [(-c[4] + 16 * c[3] - 30 * c[2] + 16 * c[1] - c[0]) / (12 * step**2) for c in (x, y)]
    first = [(c[0] - 8 * c[1] + 8 * c[3] - c[4]) / (12 * step) for c in (x, y)]
    drawn = (first[0] * second[1] - first[1] * second[0]) / np.hypot(*first) ** 3
    kappa = float(trochoid_curvature(unit, np.array([at]))[0])
    together = 1 / (unit.pin_radius * (1 - unit.pin_radius * kappa))
    assert together == pytest.approx(1 / unit.pin_radius + drawn, rel=1e-3)


def test_stribecks_number() -> None:
    """Rollers that close by cos(psi) and carry by its power 10/9: F = Z Q / (2 pi) int cos^(19/9)."""
    share = quad(lambda psi: math.cos(psi) ** (19 / 9), -math.pi / 2, math.pi / 2)[0] / (2 * math.pi)
    found = pressed(cam_bearing=BEARING)
    whole = pressed().force
    assert "cam" not in whole
    state = rverror.equilibrium(Model(UNIT), THETA, torque="412 N*m")
    total = np.hypot(*np.moveaxis(state.contact_forces["cam"], -2, 0))
    np.testing.assert_allclose(found.force["cam"] * 14 * share, total, rtol=1e-9)


def test_twice_the_torque_presses_by_the_root_of_two() -> None:
    """Once all contacts of the loaded side are closed, and play taken up, forces are in proportion."""
    light, heavy = pressed(torque="206 N*m"), pressed()
    np.testing.assert_allclose(heavy.pressure["mesh"] / light.pressure["mesh"], math.sqrt(2), rtol=1e-6)


def test_peak_is_the_largest_and_says_where() -> None:
    error = rverror.effect("cycloid.pin_position", pin=5, radial="-20 um")
    theta = np.linspace(0, 2 * np.pi, 200)
    found = contact_pressure(Model(UNIT, (error,)), theta, torque="100 N*m", disc_width="9 mm", gear_width="8 mm")
    peak = next(one for one in found.peaks() if one.contact == "pin")
    assert peak.indices["pin"] == 5  # it stands 20 um towards the discs
    at = int(np.argmin(np.abs(found.theta - peak.theta)))
    assert found.pressure["pin"][peak.indices["disc"], 5, at] == peak.pressure == found.pressure["pin"].max()
    assert peak.ripple > next(one for one in pressed(torque="100 N*m").peaks() if one.contact == "pin").ripple


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"disc_width": 0.0}, "disc_width = 0 mm: must be above 0"),
        ({"gear_width": "-1 mm"}, "gear_width = -1 mm: must be above 0"),
        ({"youngs_modulus": "0 GPa"}, "youngs_modulus = 0 MPa: must be above 0"),
        ({"poisson_ratio": 0.5}, "poisson_ratio = 0.5: must lie between 0 and 0.5"),
    ],
)
def test_what_no_part_has_is_refused(given: dict[str, object], says: str) -> None:
    sizes = {"disc_width": 9.0, "gear_width": 8.0} | given
    with pytest.raises(ValueError, match=says):
        contact_pressure(Model(UNIT), THETA, torque="100 N*m", **sizes)
    with pytest.raises(ValueError, match="rollers = 2"):
        RollerBearing(rollers=2, roller_diameter=5.0, roller_length=8.0, race_diameter=20.0)
