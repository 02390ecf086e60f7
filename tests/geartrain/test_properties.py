"""Invariants of any RV reducer, on random geometries: ratios, statics, symmetries, scaling, the cycloid profile."""

from __future__ import annotations

import math
from itertools import product
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import rverror
from rverror import Effect, Model, Reducer
from rverror.base.arrays import cross, dot, radial_and_tangential
from rverror.geartrain.action_line import ContactForces, Contacts, ErrorVector, project, project_all
from rverror.geartrain.contacts import closed_form_forces, pose
from rverror.geartrain.cycloid import (
    disc_pitch,
    disc_profile,
    lobe_profile,
    pin_circle,
    pin_position,
    pin_positions,
    pin_radius,
    profile,
)
from rverror.geartrain.feedback import feedback_factor, loop_gain
from rverror.geartrain.involute import sun_pitch
from rverror.geartrain.kinematics import frame_orders, true_period
from rverror.model.compose import source_matrix
from strategies import Array, angles, in_phase_reducers, reducers, scaled, smallest_convex_radius, variant

DIRECTIONS = st.sampled_from([1, -1])
#: Parameters whose error vector turns over in a mirror; the others keep their sign.
TANGENTIAL = {"tangential", "angle", "y", "total"}
#: Sources whose waves are waves of an angle or of a tangential vector, so that the cosine turns over, not the sine.
TURNING_WAVES = {
    "involute.sun_pitch",
    "involute.planet_pitch",
    "cycloid.disc_pitch",
    "sensor.encoder_eccentricity",
    "sensor.encoder_ellipticity",
    "sensor.encoder_distortion",
    "sensor.input_coupling",
    "empirical.order",
}


def contacts(unit: Reducer, theta: Array, direction: int) -> Contacts:
    motion = pose(unit, theta, direction=direction, torque=20e3)
    assert isinstance(motion, Contacts)
    return motion


def solved(unit: Reducer, theta: Array, direction: int) -> tuple[Contacts, ContactForces]:
    motion = contacts(unit, theta, direction)
    return motion, closed_form_forces(motion)


def some_indices(key: str, unit: Reducer) -> list[dict[str, Any]]:
    """First and last value of every index that diagnosis tries."""
    indices = rverror.CATALOGUE[key].indices
    ends = [sorted({0, len(i.tried(unit)) - 1}) for i in indices]
    return [
        {i.name: i.tried(unit)[place] for i, place in zip(indices, places, strict=True)} for places in product(*ends)
    ]


def acting(unit: Reducer) -> list[tuple[str, dict[str, Any]]]:
    keys = [key for key, entry in rverror.CATALOGUE.items() if entry.applies_to(unit)]
    return [(key, indices) for key in keys for indices in some_indices(key, unit)]


# --- ratios ---------------------------------------------------------------------------------------------------------


@given(reducers())
def test_ratio_follows_from_rolling_without_slip(unit: Reducer) -> None:
    """Willis: from the carrier, sun and planet turn as z2 to z1; from the crank, disc and ring as z_p to z_c."""
    turns = frame_orders(unit)
    sun, planet = turns["sun"] - turns["carrier"], turns["planet"] - turns["carrier"]
    assert sun * unit.sun_teeth == pytest.approx(-planet * unit.planet_teeth, rel=1e-12)
    disc, ring = turns["disc"] - turns["crank"], turns["housing"] - turns["crank"]
    assert disc * unit.disc_lobes == pytest.approx(ring * unit.pins, rel=1e-12)
    assert unit.ratio == pytest.approx(1 + unit.planet_teeth / unit.sun_teeth * unit.pins, rel=1e-12)
    assert turns["sun"] == pytest.approx(unit.ratio, rel=1e-15)
    assert turns["crank"] - turns["carrier"] == pytest.approx(-unit.pins, rel=1e-12)


@given(reducers())
def test_true_period_makes_every_turn_whole(unit: Reducer) -> None:
    turns = true_period(unit)
    assert (turns * unit.exact_ratio).denominator == 1
    assert all((n * unit.exact_ratio).denominator > 1 for n in range(1, turns))
    assert unit.sun_teeth % turns == 0


@given(reducers())
def test_feedback_factor_is_the_sum_of_all_steps(unit: Reducer) -> None:
    closed = feedback_factor(unit)
    assert closed == pytest.approx(unit.disc_lobes * unit.planet_teeth / unit.sun_teeth / unit.ratio, rel=1e-12)
    gain = loop_gain(unit)
    assert -1 < gain < 0
    assert closed == pytest.approx(sum(gain**n for n in range(200)), rel=1e-12)


# --- statics --------------------------------------------------------------------------------------------------------


#: Powers of 1/s by which what a unit s times as large does with a parameter falls.
SCALING = {"length": 1, "contact_compliance": 2}


@given(reducers(), angles(), DIRECTIONS)
def test_torque_balance_of_the_whole(unit: Reducer, theta: Array, direction: int) -> None:
    """Per unit of output torque the sun brings 1/R and the housing, through its pins, the rest."""
    motion, forces = solved(unit, theta, direction)
    pin, _ = radial_and_tangential(pin_positions(unit)[:, None])
    housing = cross(unit.pin_circle_radius * pin, forces["pin"]).sum(axis=(0, 1))  # the force line meets the pin centre
    np.testing.assert_allclose(housing, (unit.ratio - 1) / unit.ratio, rtol=1e-9)

    radial, _ = radial_and_tangential(motion.crank_position[:, None])
    sun = cross(unit.sun_pitch_radius * radial, forces["mesh"]).sum(axis=(0, 1))  # at the pitch points
    np.testing.assert_allclose(sun, 1 / unit.ratio, rtol=1e-9)

    bore, _ = radial_and_tangential(motion.crank_position)
    carrier = cross(unit.crank_radius * bore, forces["carrier"]).sum(axis=0)
    np.testing.assert_allclose(carrier, 1, rtol=1e-9)
    np.testing.assert_array_equal(forces["output"], 1)


@given(reducers(), angles(), DIRECTIONS)
def test_every_disc_is_in_equilibrium(unit: Reducer, theta: Array, direction: int) -> None:
    motion, forces = solved(unit, theta, direction)
    scale = np.abs(forces["pin"]).sum(axis=1).max()
    np.testing.assert_allclose(forces["pin"].sum(axis=1), forces["cam"].sum(axis=1), atol=1e-12 * scale)

    eccentric, _ = radial_and_tangential(motion.eccentric)
    pin, _ = radial_and_tangential(pin_positions(unit)[:, None])
    from_disc = unit.pin_circle_radius * pin - unit.eccentricity * eccentric[:, None]
    by_pins = cross(from_disc, forces["pin"]).sum(axis=1)
    bore, _ = radial_and_tangential(motion.crank_position)
    by_cams = cross(unit.crank_radius * bore, forces["cam"]).sum(axis=1)
    np.testing.assert_allclose(by_pins, by_cams, rtol=1e-9)


@given(reducers(), angles(), DIRECTIONS)
def test_cranks_are_in_equilibrium_together(unit: Reducer, theta: Array, direction: int) -> None:
    """Discs turn the cranks by their eccentricity, the planets hold them through the splines."""
    motion, forces = solved(unit, theta, direction)
    eccentric, _ = radial_and_tangential(motion.eccentric[:, None])
    by_discs = cross(unit.eccentricity * eccentric, forces["cam"]).sum(axis=(0, 1))
    by_splines = forces["spline"].sum(axis=(0, 1, 2))
    np.testing.assert_allclose(by_discs, -by_splines, rtol=1e-9)

    outward, _ = radial_and_tangential(motion.crank_position[:, None])
    on_planets = cross(-unit.planet_pitch_radius * outward, forces["mesh"]).sum(axis=(1,))
    np.testing.assert_allclose(on_planets, forces["spline"].sum(axis=(1, 2)), rtol=1e-9)
    both = forces["cam"].sum(axis=0) + forces["mesh"].sum(axis=1)
    np.testing.assert_allclose(forces["carrier"], both, rtol=1e-12, atol=1e-15)


@given(st.one_of(in_phase_reducers(), reducers(cranks=(3, 4), discs=(1, 1))), angles(), DIRECTIONS)
def test_every_crank_passes_the_same_torque(unit: Reducer, theta: Array, direction: int) -> None:
    """The floating sun drives all planets alike, so the discs must turn all cranks alike."""
    motion, forces = solved(unit, theta, direction)
    eccentric, _ = radial_and_tangential(motion.eccentric[:, None])
    each = cross(unit.eccentricity * eccentric, forces["cam"]).sum(axis=0)
    np.testing.assert_allclose(each, -forces["spline"].sum(axis=(1, 2)), rtol=1e-9)


@given(in_phase_reducers(), angles(), DIRECTIONS)
def test_discs_in_phase_leave_no_force_on_the_main_bearing(unit: Reducer, theta: Array, direction: int) -> None:
    _, forces = solved(unit, theta, direction)
    for name in ("pin", "cam", "carrier"):
        total = forces[name].reshape(-1, 2, theta.size).sum(axis=0)
        assert np.abs(total).max() < 1e-9 * np.abs(forces[name]).max()


@given(reducers(), angles(), DIRECTIONS)
def test_surfaces_only_push(unit: Reducer, theta: Array, direction: int) -> None:
    """Under the load that resists the motion every pin and every flank pushes; the idle flanks carry nothing."""
    motion, forces = solved(unit, theta, direction)
    assert (direction * dot(forces["pin"], motion.pin_normal) >= 0).all()
    along = direction * dot(forces["mesh"], motion.mesh_normal)
    loaded = 0 if direction > 0 else 1
    assert (along[:, loaded] > 0).all()
    assert (along[:, 1 - loaded] == 0).all()
    assert (forces["spline"][:, 1 - loaded] == 0).all()


# --- invariances ----------------------------------------------------------------------------------------------------


@given(reducers(), angles(), DIRECTIONS)
def test_turning_housing_and_sun_turns_the_output_as_much(unit: Reducer, theta: Array, direction: int) -> None:
    motion, forces = solved(unit, theta, direction)
    ring = unit.pin_circle_radius * source_matrix(motion, forces, "cycloid.pin_circle", {"harmonic": 0})[2]
    _, tangential = radial_and_tangential(motion.crank_position)
    turned = ErrorVector(contact="mesh", vector=(unit.sun_pitch_radius * tangential)[None, :, None])
    sun = project(forces, turned, theta.size)[0]
    np.testing.assert_allclose(ring + sun, 1, rtol=1e-9)


@given(reducers(), angles(), DIRECTIONS, st.sampled_from([0, 1]))
def test_shifting_housing_carrier_axis_and_sun_moves_nothing(
    unit: Reducer, theta: Array, direction: int, axis: int
) -> None:
    """Holds also for a single disc, whose pins push the carrier sideways, so that each part alone does something."""
    motion, forces = solved(unit, theta, direction)
    radial_cos, radial_sin, tangential_cos, tangential_sin = source_matrix(
        motion, forces, "cycloid.pin_circle", {"harmonic": 1}
    )
    x, y = source_matrix(motion, forces, "coupling.carrier_runout", {})
    cos, sin = np.cos(theta), np.sin(theta)
    ring = radial_cos - tangential_sin if axis == 0 else radial_sin + tangential_cos
    carrier = cos * x - sin * y if axis == 0 else sin * x + cos * y
    sun = source_matrix(motion, forces, "involute.sun_offset", {})[axis]
    np.testing.assert_allclose(ring + carrier + sun, 0, atol=1e-9 / unit.crank_radius)
    if unit.discs == 1:
        assert np.abs(ring).max() > 1e-3 / unit.pin_circle_radius


@given(reducers(), angles(), DIRECTIONS)
def test_disc_turned_on_its_cranks_is_its_bores_turned(unit: Reducer, theta: Array, direction: int) -> None:
    """A disc whose profile sits turned on its bores: tooth lead R_c d everywhere is all bores back by r6 d.

    The profile's contact points lie at their own radius, so the profile error is written by hand.
    """
    motion, forces = solved(unit, theta, direction)
    pin, _ = radial_and_tangential(pin_positions(unit)[:, None])
    eccentric, _ = radial_and_tangential(motion.eccentric)
    point = unit.pin_circle_radius * pin - unit.eccentricity * eccentric[:, None] + unit.pin_radius * motion.pin_normal
    turned = np.stack([-point[..., 1, :], point[..., 0, :]], axis=-2)
    profile_turned = project(forces, ErrorVector(contact="pin", vector=-turned[None]), theta.size)[0]
    bores = [
        source_matrix(motion, forces, "cycloid.disc_bore_position", {"disc": k, "crank": j})[1]
        for k in range(unit.discs)
        for j in range(unit.cranks)
    ]
    np.testing.assert_allclose(profile_turned, -unit.crank_radius * np.sum(bores, axis=0), rtol=1e-9)
    np.testing.assert_allclose(profile_turned, -feedback_factor(unit), rtol=1e-9)


@given(reducers(), angles(), DIRECTIONS, st.floats(0.01, 100))
def test_lengths_scale(unit: Reducer, theta: Array, direction: int, factor: float) -> None:
    """The same unit s times as large answers an error in mm with 1/s of the angle, an error in rad with the same."""
    small, large = solved(unit, theta, direction), solved(scaled(unit, factor), theta, direction)
    for key, indices in acting(unit):
        if key == "sensor.time_offset":
            continue
        one, other = (source_matrix(*state, key, indices) for state in (small, large))
        # under the same torque forces fall with the size, and a compliance of a contact turns forces into lengths
        power = np.array([SCALING.get(p.dimension, 0) for p in rverror.CATALOGUE[key].parameters])[:, None]
        expected = one / factor**power
        # what cancels between discs or planets leaves rounding of the size of one part, at most 1 / sun radius
        noise = 1e-10 / (factor * min(unit.sun_pitch_radius, unit.eccentricity)) ** power
        assert (np.abs(other - expected) <= 1e-8 * np.abs(expected) + noise).all(), (key, indices)


def mirrored(unit: Reducer, key: str, indices: dict[str, Any]) -> tuple[dict[str, Any], Array]:
    """Where an error goes in the mirror y -> -y, and the sign that each of its parameters takes."""
    moved = dict(indices)
    unknown = set(moved) - {"crank", "disc", "pin", "lobe", "harmonic", "member", "sense", "frame", "order", "shaft"}
    assert not unknown, f"{key}: say in mirrored, {__file__}, where {unknown} goes"
    for name, count in (("crank", unit.cranks), ("disc", unit.discs), ("pin", unit.pins)):
        if isinstance(moved.get(name), int):
            moved[name] = -moved[name] % count
    if "lobe" in moved:  # counted from a root, so the first one on one side is the last on the other
        past = indices["disc"] * unit.pins % unit.discs > 0  # the root after the eccentric is the one before it
        moved["lobe"] = (unit.disc_lobes - 1 - moved["lobe"] - past) % unit.disc_lobes
    signs = []
    for parameter in rverror.CATALOGUE[key].parameters:
        name = parameter.name
        flips = name in TANGENTIAL
        if name in ("cos", "sin"):
            turning = key in TURNING_WAVES or indices.get("sense") == "alike"  # in both directions
            flips = (name == "cos") == turning
        elif key == "cycloid.pin_circle":
            flips = name in ("radial_sin", "tangential_cos")
        elif key == "sensor.output_tilt":  # across the head, where a reading of its motion is an angle
            flips = name == "x"
        signs.append(-1.0 if flips else 1.0)
    return moved, np.array(signs)


@given(reducers(), angles(), DIRECTIONS)
def test_mirror_turns_forward_into_reverse(unit: Reducer, theta: Array, direction: int) -> None:
    """In a mirror the unit is itself, runs the other way, and its error changes sign.

    TE_reverse(-theta; mirrored errors) = -TE_forward(theta; errors), for every source, whatever its frame.
    """
    motion, forces = solved(unit, theta, direction)
    image, image_forces = solved(unit, -theta, -direction)
    for key, indices in acting(unit):
        if key == "sensor.time_offset":
            continue
        if key == "cycloid.pin_circle_tilt" and unit.discs > 2:
            continue  # the mirror changes the order of the discs along the axis
        moved, signs = mirrored(unit, key, indices)
        matrix = source_matrix(motion, forces, key, indices)
        other = source_matrix(image, image_forces, key, moved)
        # a wave of high order cancels between the planets but for the rounding of its angle
        compliance = any(p.dimension == "contact_compliance" for p in rverror.CATALOGUE[key].parameters)
        tolerance = 1e-9 * max(np.abs(matrix).max(), 1e-3 if compliance else 1e-3 / unit.pin_circle_radius)
        assert np.abs(signs[:, None] * other + matrix).max() < tolerance, (key, indices)


@given(reducers(), angles(), DIRECTIONS, st.integers(1, 3))
def test_one_pin_further(unit: Reducer, theta: Array, direction: int, steps: int) -> None:
    """The housing has z_p equal sectors: the next pin acts as this one does once the eccentrics have turned by a pitch.

    That takes the output on by -pitch / z_c; where the carrier then stands does not matter to a pin.
    """
    pitch = 2 * math.pi / unit.pins
    later = -steps * pitch / unit.disc_lobes
    here = solved(unit, theta, direction)
    there = solved(unit, theta + later, direction)
    for name in ("pin_position", "pin_radius"):
        one = source_matrix(*here, f"cycloid.{name}", {"pin": 0})
        other = source_matrix(*there, f"cycloid.{name}", {"pin": steps % unit.pins})
        np.testing.assert_allclose(other, one, atol=1e-9 * np.abs(one).max())


@given(in_phase_reducers(), angles(), DIRECTIONS, st.integers(1, 6), st.sampled_from(["disc_pitch", "disc_profile"]))
def test_same_error_on_all_discs_cancels_but_for_multiples_of_their_number(
    unit: Reducer, theta: Array, direction: int, harmonic: int, name: str
) -> None:
    state = solved(unit, theta, direction)
    parts = np.array(
        [source_matrix(*state, f"cycloid.{name}", {"disc": k, "harmonic": harmonic}) for k in range(unit.discs)]
    )
    total = np.abs(parts.sum(axis=0)).max()
    if harmonic % unit.discs:
        assert total < 1e-9 * np.abs(parts).max()
    else:
        np.testing.assert_allclose(parts, np.broadcast_to(parts[:1], parts.shape), atol=1e-9 * np.abs(parts).max())


@given(reducers(cranks=(2, 4)), angles(), DIRECTIONS, st.integers(1, 8))
def test_sun_pitch_cancels_but_for_multiples_of_the_planets(
    unit: Reducer, theta: Array, direction: int, harmonic: int
) -> None:
    matrix = source_matrix(*solved(unit, theta, direction), "involute.sun_pitch", {"harmonic": harmonic})
    size = 1 / (unit.ratio * unit.sun_pitch_radius)
    if harmonic % unit.cranks:
        np.testing.assert_allclose(matrix, 0, atol=1e-9 * size)
    else:
        chi = harmonic * (1 - unit.ratio) * theta
        np.testing.assert_allclose(matrix, size * np.stack([np.cos(chi), np.sin(chi)]), atol=1e-8 * size)


# --- superposition --------------------------------------------------------------------------------------------------


@settings(max_examples=10)
@given(reducers(), angles(), DIRECTIONS, st.integers(0, 2**32 - 1))
def test_effects_superpose(unit: Reducer, theta: Array, direction: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    time = np.sort(rng.uniform(0, 10, theta.size))
    state = {"direction": direction, "time": time, "torque": 20e3}
    effects = tuple(
        Effect(key, indices, tuple(rng.normal(0, 1e-2, len(rverror.CATALOGUE[key].parameters))))
        for key, indices in acting(unit)
        if key != "sensor.index_offset"  # it turns what the others do
    )
    total = rverror.transmission_error(Model(unit, effects), theta, **state)
    alone = [rverror.transmission_error(Model(unit, (e,)), theta, **state) for e in effects]
    scale = np.abs(alone).max()
    np.testing.assert_allclose(total, np.sum(alone, axis=0), atol=1e-11 * scale)
    rows = rverror.model.transmission_error_by_effect(Model(unit, effects), theta, **state)
    np.testing.assert_allclose(rows, alone, atol=1e-12 * scale)
    twice = tuple(Effect(e.key, e.indices, tuple(2 * v for v in e.values)) for e in effects)
    again = rverror.transmission_error(Model(unit, twice), theta, **state)
    np.testing.assert_allclose(again, 2 * total, atol=1e-11 * scale)


@given(reducers())
def test_no_effect_no_error(unit: Reducer) -> None:
    np.testing.assert_array_equal(rverror.transmission_error(Model(unit), np.linspace(0, 1, 7)), 0)
    assert rverror.model.transmission_error_by_effect(Model(unit), np.linspace(0, 1, 7)).shape == (0, 7)


# --- cycloid profile ------------------------------------------------------------------------------------------------


def disc_outline(unit: Reducer, motion: Contacts, disc: int, points: int) -> Array:
    """The disc's whole nominal profile in the housing at the first sample, (2, points), from a lobe's root on.

    Disc 0 has a root on +x at theta = 0, where a pin stands in it; one lobe passes a pin per crank turn.
    """
    roll = 2 * math.pi * unit.disc_lobes * np.arange(points) / points
    x, y = profile(unit, roll)
    # eccentric k leads by 2 pi k / n: its lobes sit turned back on the bores by what a disc rolls in that angle
    turn = motion.theta[0] - 2 * math.pi * disc / unit.discs / unit.disc_lobes
    shift = unit.eccentricity * np.exp(1j * motion.eccentric[disc, 0])
    outline = (x + 1j * y) * np.exp(1j * turn) + shift
    return np.stack([outline.real, outline.imag])


@settings(max_examples=15)
@given(reducers(), st.floats(-3, 3), st.integers(0, 3))
def test_profile_touches_every_pin_where_the_normal_says(unit: Reducer, start: float, disc: int) -> None:
    disc %= unit.discs
    motion = contacts(unit, np.array([start]), 1)
    points = 1500 * unit.disc_lobes
    outline = disc_outline(unit, motion, disc, points)
    step = float(np.abs(np.diff(outline, axis=1)).max())
    spokes, _ = radial_and_tangential(pin_positions(unit)[:, None])
    for i, pin in enumerate(unit.pin_circle_radius * spokes):
        away = outline - pin
        distance = np.hypot(*away)
        nearest = int(distance.argmin())
        assert distance[nearest] == pytest.approx(unit.pin_radius, abs=2 * step**2 / unit.pin_radius + 1e-9)
        contact = pin[:, 0] + unit.pin_radius * motion.pin_normal[disc, i, :, 0]
        assert np.hypot(*(outline[:, nearest] - contact)) < 2 * step
        along = outline[:, (nearest + 1) % points] - outline[:, nearest - 1]
        along /= np.hypot(*along)
        assert abs(along @ motion.pin_normal[disc, i, :, 0]) < 4 * step / unit.pin_radius


@given(reducers(), st.integers(0, 30))
def test_profile_is_closed_and_has_one_lobe_per_pitch(unit: Reducer, lobe: int) -> None:
    roll = np.linspace(0, 2 * math.pi, 50)
    one = np.array([1, 1j]) @ profile(unit, roll)
    other = np.array([1, 1j]) @ profile(unit, roll + 2 * math.pi * lobe)
    turn = other[0] / one[0]
    assert abs(turn) == pytest.approx(1, rel=1e-12)
    assert abs(turn**unit.disc_lobes - 1) < 1e-9
    np.testing.assert_allclose(other, one * turn, rtol=1e-9)
    assert abs(np.angle(one[-1] / one[0])) == pytest.approx(2 * math.pi / unit.disc_lobes, rel=1e-9)
    radius = np.abs(np.array([1, 1j]) @ profile(unit, np.array([0.0, math.pi])))
    middle = unit.pin_circle_radius - unit.pin_radius
    np.testing.assert_allclose(radius, [middle - unit.eccentricity, middle + unit.eccentricity], rtol=1e-12)


@given(reducers(), angles(size=3))
def test_contact_normals(unit: Reducer, theta: Array) -> None:
    """All normals meet in the pitch point, where housing and disc share their velocity; arms follow from the lines."""
    motion = contacts(unit, theta, 1)
    np.testing.assert_allclose(dot(motion.pin_normal, motion.pin_normal), 1, rtol=1e-12)
    ahead, _ = radial_and_tangential(motion.eccentric)
    # velocity of a disc point P at distance d ahead of its centre: a * n_crank + d * 1 = 0 against the housing
    pitch_point = unit.eccentricity * (1 - frame_orders(unit)["crank"]) * ahead
    spokes, _ = radial_and_tangential(pin_positions(unit)[:, None])
    offset = pitch_point[:, None] - unit.pin_circle_radius * spokes
    assert np.abs(cross(offset, motion.pin_normal)).max() < 1e-9 * unit.pin_circle_radius
    assert (dot(offset, motion.pin_normal) > 0).all()  # from the pin into the disc
    from_disc = unit.pin_circle_radius * spokes - unit.eccentricity * ahead[:, None]
    np.testing.assert_allclose(motion.pin_arm, cross(from_disc, motion.pin_normal), atol=1e-9 * unit.pin_circle_radius)
    largest = unit.eccentricity * unit.disc_lobes
    assert np.abs(motion.pin_arm).max() <= largest * (1 + 1e-12)
    drive = (motion.pin_arm > 0).sum(axis=1)
    assert (np.abs(drive - unit.pins / 2) <= 1).all()  # half the pins drive, half are on the coast side


@given(reducers(), angles(size=3))
def test_contact_angle(unit: Reducer, theta: Array) -> None:
    motion = contacts(unit, theta, 1)
    ahead, _ = radial_and_tangential(motion.eccentric)
    spokes, _ = radial_and_tangential(pin_positions(unit)[:, None])
    point = unit.pin_circle_radius * spokes + unit.pin_radius * motion.pin_normal
    from_disc = point - unit.eccentricity * ahead[:, None]
    found = motion.pin_angle + theta - np.arctan2(from_disc[..., 1, :], from_disc[..., 0, :])
    np.testing.assert_allclose(np.exp(1j * found), 1, atol=1e-9)


@given(reducers())
def test_smallest_convex_radius(unit: Reducer) -> None:
    numeric = smallest_convex_radius(
        pins=unit.pins, pin_circle_radius=unit.pin_circle_radius, eccentricity=unit.eccentricity
    )
    assert unit.smallest_convex_radius == pytest.approx(numeric, rel=1e-5)


@settings(max_examples=10)
@given(reducers(), st.sampled_from([0.98, 1.02]))
def test_undercut_bound_is_where_the_outline_folds(unit: Reducer, share: float) -> None:
    """Below the bound the outline runs one way round its normal; above it, it turns back at the tips."""
    bound = unit.smallest_convex_radius
    roll = np.linspace(0, 2 * math.pi, 4001)
    slow = unit.pin_circle_radius * np.exp(1j * roll / unit.disc_lobes)
    fast = unit.eccentricity * np.exp(1j * unit.pins * roll / unit.disc_lobes)
    centre, tangent = slow - fast, 1j * (slow - unit.pins * fast)
    normal = 1j * tangent / np.abs(tangent)
    outline = centre + share * bound * normal
    along = (np.diff(outline) * np.conj(tangent[:-1] + tangent[1:])).real
    assert (along > 0).all() == (share < 1)


@given(reducers(), angles(), DIRECTIONS)
def test_all_pins_fatter_is_the_sum_of_each_fatter(unit: Reducer, theta: Array, direction: int) -> None:
    motion, forces = solved(unit, theta, direction)
    each = [project(forces, pin_radius(motion, pin=i), theta.size)[0] for i in range(unit.pins)]
    together = project(forces, pin_radius(motion, pin="all"), theta.size)[0]
    np.testing.assert_allclose(np.sum(each, axis=0), together, rtol=1e-9)
    assert (direction * together > 0).all()  # more material pushes the disc ahead


@given(reducers(discs=(1, 1)), angles(), DIRECTIONS, st.integers(1, 5))
def test_error_of_a_disc_is_the_opposite_error_of_the_pins_it_meets(
    unit: Reducer, theta: Array, direction: int, harmonic: int
) -> None:
    """More material on a lobe or on its pin is the same gap; flanks that lead are pins that stay behind."""
    motion, forces = solved(unit, theta, direction)
    fatter = np.array([source_matrix(motion, forces, "cycloid.pin_radius", {"pin": i})[0] for i in range(unit.pins)])
    moved = np.array([source_matrix(motion, forces, "cycloid.pin_position", {"pin": i}) for i in range(unit.pins)])
    psi = motion.pin_angle[0]
    turn = psi + theta - pin_positions(unit)[:, None] + math.pi / 2  # of the flank's tangent against the pin's spoke
    ahead = np.cos(turn) * moved[:, 0] + np.sin(turn) * moved[:, 1]
    waves = np.stack([np.cos(harmonic * psi), np.sin(harmonic * psi)])
    for name, expected in (("disc_profile", waves * fatter), ("disc_pitch", -waves * ahead)):
        found = source_matrix(motion, forces, f"cycloid.{name}", {"disc": 0, "harmonic": harmonic})
        np.testing.assert_allclose(found, expected.sum(axis=1), atol=1e-10 * np.abs(expected).sum(axis=1).max())


@given(reducers(), angles(), DIRECTIONS, st.integers(0, 5))
def test_waves_are_the_error_vectors_that_they_multiply_out_to(
    unit: Reducer, theta: Array, direction: int, harmonic: int
) -> None:
    motion, forces = solved(unit, theta, direction)
    for source in (disc_profile, disc_pitch, lobe_profile):
        waves = source(motion, disc=unit.discs - 1, harmonic=harmonic)
        vectors = ErrorVector(contact=waves.contact, vector=waves.vector, at=waves.at)
        force = forces["pin"][waves.at]
        np.testing.assert_allclose(waves.along(force), vectors.along(force), atol=1e-12 * np.abs(force).max())
        expected = project(forces, vectors, theta.size)
        size = np.abs(force).sum(axis=(0, 1, 2)).max()
        np.testing.assert_allclose(project(forces, waves, theta.size), expected, atol=1e-12 * size)


@given(reducers(), angles(), DIRECTIONS, st.lists(st.tuples(st.integers(0, 3), st.integers(0, 9)), max_size=12))
def test_many_errors_together_are_each_by_itself(
    unit: Reducer, theta: Array, direction: int, chosen: list[tuple[int, int]]
) -> None:
    """Harmonics in any order, the same ones twice, and what is no wave between them."""
    motion, forces = solved(unit, theta, direction)
    makers = (
        lambda h: disc_profile(motion, disc=0, harmonic=h),
        lambda h: disc_pitch(motion, disc=unit.discs - 1, harmonic=h),
        lambda h: sun_pitch(motion, harmonic=h),
        lambda h: pin_circle(motion, harmonic=h),
    )
    errors = [makers[which](harmonic) for which, harmonic in chosen]
    each = [project(forces, error, theta.size) for error in errors]
    found = np.full((sum(map(len, each)), theta.size), np.nan)
    project_all(forces, errors, found)
    size = max(np.abs(forces[contact]).sum(axis=(0, 1, 2)).max() for contact in ("pin", "mesh"))
    np.testing.assert_allclose(found, np.concatenate([found[:0], *each]), rtol=0, atol=1e-12 * size)


@given(reducers(), angles(), DIRECTIONS, st.integers(0, 5))
def test_vectors_alike_at_all_samples_are_those_of_each_sample(
    unit: Reducer, theta: Array, direction: int, harmonic: int
) -> None:
    motion, forces = solved(unit, theta, direction)
    for error in (pin_circle(motion, harmonic=harmonic), pin_position(motion, pin=unit.pins - 1)):
        expected = (forces["pin"][error.at] * error.vector).sum(axis=(1, 2, 3))
        size = np.abs(forces["pin"]).sum(axis=(0, 1, 2)).max()
        np.testing.assert_allclose(project(forces, error, theta.size), expected, rtol=0, atol=1e-12 * size)


@given(reducers(), angles(), DIRECTIONS, st.integers(1, 5))
def test_planet_errors_are_errors_of_its_mounting(unit: Reducer, theta: Array, direction: int, harmonic: int) -> None:
    """Eccentric teeth are a displaced axis that turns with the planet; teeth that lead are a crank that lags."""
    state, crank = solved(unit, theta, direction), unit.cranks - 1
    position = theta + 2 * math.pi * crank / unit.cranks
    planet = -unit.disc_lobes * theta
    radial, tangential = source_matrix(*state, "involute.center_distance", {"crank": crank})
    turn = planet - position  # of the planet's x against the carrier's radius
    x, y = source_matrix(*state, "involute.planet_eccentricity", {"crank": crank})
    size = np.abs([x, y]).max()
    np.testing.assert_allclose(x, np.cos(turn) * radial + np.sin(turn) * tangential, atol=1e-9 * size)
    np.testing.assert_allclose(y, -np.sin(turn) * radial + np.cos(turn) * tangential, atol=1e-9 * size)

    lead = -source_matrix(*state, "crank.index", {"crank": crank})[0] / unit.planet_pitch_radius
    chi = harmonic * (position + math.pi - planet)  # the teeth that face the sun
    found = source_matrix(*state, "involute.planet_pitch", {"crank": crank, "harmonic": harmonic})
    np.testing.assert_allclose(found, lead * np.stack([np.cos(chi), np.sin(chi)]), atol=1e-9 * np.abs(lead).max())


@given(reducers(), angles(), DIRECTIONS)
def test_carrier_runout_is_the_same_shift_of_all_its_bores(unit: Reducer, theta: Array, direction: int) -> None:
    state = solved(unit, theta, direction)
    runout = source_matrix(*state, "coupling.carrier_runout", {})
    each = [source_matrix(*state, "coupling.carrier_bore_position", {"crank": j}) for j in range(unit.cranks)]
    around = 2 * math.pi * np.arange(unit.cranks)[:, None] / unit.cranks
    radial, tangential = np.moveaxis(np.array(each), 1, 0)
    x = (np.cos(around) * radial - np.sin(around) * tangential).sum(axis=0)
    y = (np.sin(around) * radial + np.cos(around) * tangential).sum(axis=0)
    np.testing.assert_allclose(runout, [x, y], atol=1e-10 * np.abs(each).max())


@given(reducers(), angles(), DIRECTIONS)
def test_moved_crank_is_its_bores_and_its_planet_moved_the_other_way(
    unit: Reducer, theta: Array, direction: int
) -> None:
    """A crank whose axis moves against all it touches: nothing but a shift of its axis, which no one can see.

    The carrier bore moves it one way; all cams and the planet on their crank moved back undo that for discs and sun.
    """
    motion, forces = solved(unit, theta, direction)
    crank = unit.cranks - 1
    bore = source_matrix(motion, forces, "coupling.carrier_bore_position", {"crank": crank})
    planet = source_matrix(motion, forces, "involute.center_distance", {"crank": crank})
    total = bore - planet
    for disc in range(unit.discs):
        radial, tangential = source_matrix(motion, forces, "crank.eccentricity", {"crank": crank, "disc": disc})
        turn = motion.crank_position[crank] - motion.eccentric[disc]
        total -= [
            np.cos(turn) * radial + np.sin(turn) * tangential,
            -np.sin(turn) * radial + np.cos(turn) * tangential,
        ]
    np.testing.assert_allclose(total, 0, atol=1e-9 * np.abs(bore).max())


@given(reducers(), angles(), DIRECTIONS)
def test_bore_of_a_disc_is_the_opposite_of_its_cam(unit: Reducer, theta: Array, direction: int) -> None:
    motion, forces = solved(unit, theta, direction)
    disc, crank = unit.discs - 1, unit.cranks - 1
    which = {"disc": disc, "crank": crank}
    along, across = source_matrix(motion, forces, "crank.eccentricity", which)
    turn = motion.eccentric[disc] - motion.crank_position[crank]
    radial, tangential = source_matrix(motion, forces, "cycloid.disc_bore_position", which)
    size = np.abs([radial, tangential]).max()
    np.testing.assert_allclose(along, -np.cos(turn) * radial - np.sin(turn) * tangential, atol=1e-9 * size)
    np.testing.assert_allclose(across, np.sin(turn) * radial - np.cos(turn) * tangential, atol=1e-9 * size)


@given(reducers(), angles(), DIRECTIONS)
def test_pin_circle_waves_are_sums_of_pins(unit: Reducer, theta: Array, direction: int) -> None:
    state = solved(unit, theta, direction)
    each = np.array([source_matrix(*state, "cycloid.pin_position", {"pin": i}) for i in range(unit.pins)])
    for harmonic in (0, 1, 2, 5):
        waves = np.exp(1j * harmonic * pin_positions(unit))
        radial, tangential = np.einsum("p,pcn->cn", waves, each)
        expected = np.stack([radial.real, radial.imag, tangential.real, tangential.imag])
        found = source_matrix(*state, "cycloid.pin_circle", {"harmonic": harmonic})
        np.testing.assert_allclose(found, expected, atol=1e-10 * np.abs(each).max() * unit.pins)


@given(reducers())
def test_a_variant_keeps_what_it_is_not_told(unit: Reducer) -> None:
    assert variant(unit) == unit
