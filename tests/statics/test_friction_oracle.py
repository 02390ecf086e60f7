"""Losses to friction against the independent oracle: bodies drawn a little later, its own forces, its own balance.

Both have the same law at each contact.  The oracle's geometry is that of the loaded pose, the package's that of the
nominal one: contacts that give way by c move normals and slip by c over the radius of curvature there.  At 0.2 N*m
that is some 1e-5 mm over no less than 0.1 mm.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import given, settings, strategies as st

from oracle import Oracle, Rubbing, Springs
from rverror import Model, Reducer, reducer
from rverror.geartrain import Friction, Stiffness
from rverror.statics import efficiency
from rverror.statics.friction import mean_mesh_slip
from strategies import Array, angles, reducers

TORQUE = 200.0
#: See above; a tenth of a percent of the most that friction can change.
LOADED = 2e-4
PARTS = ("pin", "mesh", "crank_bearing", "carrier_bearing")
#: The oracle's sun has a firm support, lest two planets throw it about.
FIRM = Stiffness(sun_support=1e4)


def drawn(unit: Reducer, theta: Array, *, sense: int, torque: float = TORQUE) -> Oracle:
    k = unit.stiffness
    springs = Springs(
        pin=k.pin_contact,
        cam=k.crank_bearing,
        carrier=k.carrier_bearing,
        mesh=k.gear_mesh,
        sun=k.sun_support,
        main=k.main_bearing,
    )
    return Oracle(unit, theta, sense=sense, torque=torque, springs=springs)


def coefficients(unit: Reducer, share: float) -> tuple[Friction, Rubbing]:
    """The same friction for both; bearings as rolling ones, a twentieth at a fifth of the crank circle."""
    radius = 0.2 * unit.crank_radius
    own = Friction(
        pin=share,
        mesh=share,
        crank_bearing=share / 20,
        crank_bearing_radius=radius,
        carrier_bearing=share / 30,
        carrier_bearing_radius=radius,
    )
    lever = mean_mesh_slip(unit)  # by quadrature in test_friction.py
    return own, Rubbing(pin=share, mesh=share * lever, cam=share / 20 * radius, carrier=share / 30 * radius)


@given(
    unit=reducers(),
    theta=angles(2),
    motion=st.sampled_from([1, -1]),
    drives=st.sampled_from(["input", "output"]),
)
@settings(max_examples=6, deadline=None)
def test_losses_of_forces_without_friction_are_the_limit(unit: Reducer, theta: Array, motion: int, drives: str) -> None:
    """With forces as without friction the loss is wrong by its own share, so the ratio goes to one as f does.

    Of the gears it is known: they carry what the torque at the input needs, 1 + l of the lossless (1 - l where the
    output drives), less what their own couple takes from the sun.
    """
    unit = replace(unit, stiffness=FIRM)
    sign = 1 if drives == "input" else -1
    oracle = drawn(unit, theta, sense=sign * motion)
    ratios, level = {}, 0.0
    for share in (0.02, 0.01):
        own, by = coefficients(unit, share)
        _, first, _ = oracle.rub(oracle.base(), by, motion=motion)
        found = efficiency(Model(unit), theta, torque=TORQUE, friction=own, direction=float(motion), drives=drives)
        made = np.array([found.losses[part] for part in PARTS])
        ratios[share] = made / first
        level = max(level, float(first.sum(axis=0).max()) / TORQUE)
        base = unit.sun_pitch_radius * np.cos(unit.pressure_angle)
        gears = (1 + sign * made.sum(axis=0) / TORQUE) / (1 + sign * by.mesh / base)
        np.testing.assert_allclose(ratios[share][1], gears, rtol=LOADED)
    assert np.abs(ratios[0.02] - 1).max() < 2 * level + LOADED
    assert np.abs(2 * ratios[0.01] - ratios[0.02] - 1).max() < 4 * level**2 + LOADED


@given(
    unit=reducers(),
    theta=angles(2),
    motion=st.sampled_from([1, -1]),
    drives=st.sampled_from(["input", "output"]),
)
@settings(max_examples=6, deadline=None)
def test_forces_with_friction_and_the_torque_at_the_sun(unit: Reducer, theta: Array, motion: int, drives: str) -> None:
    """The oracle's bodies in balance with Coulomb forces at the points of contact: part by part, and at the input."""
    unit = replace(unit, stiffness=FIRM)
    sign = 1 if drives == "input" else -1
    own, by = coefficients(unit, 0.03)
    lost, at_sun = drawn(unit, theta, sense=sign * motion).rubbed(by, motion=motion)
    found = efficiency(Model(unit), theta, torque=TORQUE, friction=own, direction=float(motion), drives=drives)
    for row, part in zip(lost, PARTS, strict=True):
        np.testing.assert_allclose(found.losses[part], row, rtol=LOADED, err_msg=part)
    np.testing.assert_allclose(found.input_torque, sign * motion * at_sun, rtol=LOADED)
    # the oracle's own balance of power: what the sun brings is what the load takes and what slips
    brought = sign * motion * at_sun * abs(unit.ratio)
    np.testing.assert_allclose(brought, TORQUE + sign * lost.sum(axis=0), rtol=LOADED)


def test_what_differs_is_in_proportion_to_the_load() -> None:
    """Ten times the torque, ten times the difference: it is the loaded geometry, and none at no load."""
    unit, theta = reducer("RV-40E"), np.array([0.02, 0.5, 0.9])
    own, by = coefficients(unit, 0.05)
    off = []
    for torque in (4e3, 40e3):
        lost, _ = drawn(unit, theta, sense=1, torque=torque).rubbed(by, motion=1)
        found = efficiency(Model(unit), theta, torque=torque, friction=own, direction=1.0)
        off.append(found.losses["pin"] / lost[0] - 1)
    np.testing.assert_allclose(off[1] / off[0], 10, rtol=0.1)
