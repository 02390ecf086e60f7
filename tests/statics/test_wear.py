"""Wear: Archard's law by hand on both bodies, mass balance, sharing of the load in the long run, and what it costs."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import example, given, settings

import rverror
from pages import DOCS, text
from rverror import Model, Reducer
from rverror.geartrain.cycloid import profile, trochoid_curvature
from rverror.statics import Wear, WearCoefficients, wear
from strategies import reducers

Array = npt.NDArray[np.float64]
UNIT = rverror.reducer("RV-40E")
NEW = Model(UNIT)
TORQUE, SPEED, DISC, GEAR = 412e3, 190.0, 9.0, 8.0
SLIGHT = 1e-20  # mm^2/N: nothing that a contact would notice
TURNED = 100 * 3600 * SPEED / UNIT.ratio  # rad of output in a hundred hours
LOBE = (0.5, 2.0)  # roll angles at which a flank carries well


def worn(model: Model = NEW, hours: Any = (0, 100), direction: float | None = 1.0, **more: Any) -> Wear:
    by = {name: more.pop(name) for name in ("disc", "pin", "sun", "planet") if name in more}
    duty = {"torque": TORQUE, "input_speed": SPEED, "disc_width": DISC, "gear_width": GEAR} | more
    return wear(model, hours=hours, coefficients=WearCoefficients(**by), direction=direction, **duty)


def along_profile(unit: Reducer, phase: Array) -> Array:
    """Length of profile per roll angle, by differences."""
    step = 1e-5
    x, y = profile(unit, phase + step) - profile(unit, phase - step)
    return np.hypot(x, y) / (2 * step)


def contacts_by_hand(torque: float = TORQUE) -> tuple[Array, Array, Array]:
    """Roll angle, force and sliding per rad of output of every contact of disc 0, from the motion of rigid bodies."""
    theta = 2 * np.pi * np.arange(40) / 1600
    state = rverror.equilibrium(NEW, theta, torque=torque)
    force = np.hypot(*np.moveaxis(state.contact_forces["pin"][0], 1, 0))
    a, radius, gamma = UNIT.eccentricity, UNIT.pin_circle_radius, 2 * np.pi * np.arange(40)[:, None] / 40
    cam, pin = np.exp(-39j * theta), radius * np.exp(1j * gamma)
    normal = a * 40 * cam - pin
    touched = pin + UNIT.pin_radius * normal / abs(normal)
    velocity = a * -39j * cam + 1j * (touched - a * cam)  # of the disc there; the pin stands
    return np.mod(-39 * theta - gamma, 2 * np.pi), force, abs(velocity)


def test_depth_of_a_lobe_by_hand() -> None:
    """One passage takes k F / b times sliding over what the contact runs along; 40 pins pass a lobe in a turn.

    The sixteen waves of a lobe leave 1.4 % of the largest depth at most.
    """
    found = worn(disc=SLIGHT)
    phase, force, slides = contacts_by_hand()
    runs = 39 * along_profile(UNIT, phase.ravel()).reshape(phase.shape)
    depth = SLIGHT * force / DISC * slides / runs * 40 * TURNED / (2 * np.pi)
    told = np.interp(phase, found.roll_angle, found.lobe_depth[-1])
    np.testing.assert_allclose(told, depth, atol=0.015 * depth.max())


def test_sliding_over_running_is_the_closed_form() -> None:
    phase, _, slides = contacts_by_hand()
    K = UNIT.short_width_coefficient
    rho = UNIT.pin_circle_radius * np.sqrt(1 + K**2 - 2 * K * np.cos(phase))
    expected = (rho - UNIT.pin_radius) / (rho * (1 - trochoid_curvature(UNIT, phase) * UNIT.pin_radius))
    runs = 39 * along_profile(UNIT, phase.ravel()).reshape(phase.shape)
    np.testing.assert_allclose(slides / runs, expected, rtol=1e-7)


def test_depth_of_a_fixed_pin_by_hand() -> None:
    """A place of the pin is passed twice in each mesh, where its normal swings out and back.

    At a hundredth of the torque, where the strip of contact is a hundredth of the way of the normal.
    """
    found = worn(pin=SLIGHT, torque=TORQUE / 100)
    phase, force, slides = (row.ravel() for row in contacts_by_hand(TORQUE / 100))
    by = np.argsort(phase)
    phase, force, slides = phase[by], force[by], slides[by]
    fine = np.linspace(1e-3, np.pi - 1e-3, 20001)
    angle = -np.angle(1 - UNIT.short_width_coefficient * np.exp(1j * fine))
    turns = np.gradient(angle, fine)
    taken = SLIGHT / (DISC * UNIT.pin_radius) * np.interp(fine, phase, force) * np.interp(fine, phase, slides)
    depth = taken / np.abs(turns) * TURNED / (2 * np.pi)
    outward, back = turns > 0, turns < 0
    at = np.linspace(1.2, 2.0, 9)  # far from where it halts, so that the strip's width counts for nothing
    where = np.interp(at, fine, angle)
    expected = np.interp(where, angle[outward], depth[outward])
    expected += np.interp(where, angle[back][::-1], depth[back][::-1])
    np.testing.assert_allclose(np.interp(at, found.roll_angle, found.pin_depth[-1]), expected, rtol=0.03)


def test_a_fixed_pin_wears_most_where_its_contact_halts() -> None:
    """At the longest arm, cos(phi) = K, the normal turns back."""
    found = worn(pin=SLIGHT)
    deepest = found.roll_angle[np.argmax(found.pin_depth[-1])]
    assert abs(math.cos(deepest) - UNIT.short_width_coefficient) < 0.1


def test_worn_volume_is_the_work_of_friction() -> None:
    """Per coefficient: k times what friction takes, over its coefficient, on the equilibrium at other angles."""
    found = worn(disc=SLIGHT, pin=2 * SLIGHT, sun=3 * SLIGHT, planet=4 * SLIGHT)
    rubs = rverror.geartrain.Friction(pin=1e-6, mesh=1e-6)
    theta = 2 * np.pi / 40 * np.arange(47) / 47
    losses = rverror.statics.efficiency(NEW, theta, torque=TORQUE, friction=rubs).losses
    by_pins, by_mesh = (1e6 * losses[kind].mean() * SLIGHT * TURNED for kind in ("pin", "mesh"))
    for body, expected in {"disc": by_pins, "pin": 2 * by_pins, "sun": 3 * by_mesh, "planet": 4 * by_mesh}.items():
        assert found.volume[body][-1] == pytest.approx(expected, rel=1e-4), body


def mass_balance(unit: Reducer, found: Wear) -> float:
    """Volume under the depths of all lobes over the volume that was lost."""
    under = found.lobe_depth[-1] @ along_profile(unit, found.roll_angle) * 2 * np.pi / found.roll_angle.size
    return float(under * unit.disc_lobes * unit.discs * DISC / found.volume["disc"][-1])


def test_depths_of_the_lobes_hold_the_volume() -> None:
    assert mass_balance(UNIT, worn(disc=SLIGHT)) == pytest.approx(1, abs=2e-3)


def test_turning_pins_lose_their_volume_all_around() -> None:
    error = rverror.effect("cycloid.pin_radius", pin=3, deviation="4 um")
    found = worn(Model(UNIT, (error,)), pin=1e-13, pins="turning")
    depth = found.pin_depth[-1][0] + found.each_pin[-1]
    volume = 2 * np.pi * UNIT.pin_radius * DISC * UNIT.discs * depth.sum()
    assert volume == pytest.approx(found.volume["pin"][-1], rel=1e-9)
    assert np.argmax(depth) == 3  # it stands proud
    deviation = {e.indices["pin"]: e.values[0] for e in found.effects if e.key == "cycloid.pin_radius"}
    assert deviation["all"] + deviation[3] == pytest.approx(-depth[3], rel=1e-9)


def test_hours_and_coefficient_can_be_interchanged() -> None:
    """So can speed: only their product counts, with all feed-back of wear on the load."""
    first, second = worn(disc=1e-13, pin=1e-13), worn(hours=[0, 50], input_speed=SPEED / 4, disc=8e-13, pin=8e-13)
    np.testing.assert_allclose(first.sizes, second.sizes, rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(first.lost_motion, second.lost_motion, rtol=1e-9)


@pytest.mark.parametrize(
    ("joint", "key", "count"),
    [
        ("cam_bearing", "crank.bearing_clearance", 1),
        ("carrier_bearing", "coupling.bearing_clearance", 1),
        ("spline", "involute.spline_clearance", UNIT.cranks),
    ],
)
def test_a_joint_alone_gains_what_it_gains_beside_others(joint: str, key: str, count: int) -> None:
    gains = {"cam_bearing": 1e-13, "carrier_bearing": 3e-13, "spline": 5e-13}
    alone, all_of_them = (
        wear(
            NEW, torque=TORQUE, input_speed=SPEED, hours=[0, 1], direction=1.0, disc_width=DISC, gear_width=GEAR,
            coefficients=WearCoefficients(**some),
        ).effects
        for some in ({joint: gains[joint]}, gains)
    )  # fmt: skip
    assert [effect.key for effect in alone] == [key] * count
    expected = [effect.values for effect in all_of_them if effect.key == key]
    np.testing.assert_allclose([effect.values for effect in alone], expected, rtol=1e-3)
    assert np.all(np.array(expected) > 0)


def test_little_wear_is_proportional_to_time_and_none_is_none() -> None:
    found = worn(hours=[1, 2], disc=1e-16)
    np.testing.assert_allclose(
        2 * found.lobe_depth[1], found.lobe_depth[2], rtol=1e-4, atol=1e-5 * found.lobe_depth.max()
    )
    assert found.hours[0] == 0
    theta = np.linspace(0, 0.15, 7)
    before, after = (rverror.equilibrium(m, theta, torque=TORQUE) for m in (NEW, found.model_at(0)))
    np.testing.assert_array_equal(before.transmission_error, after.transmission_error)


def test_model_between_two_hours_and_outside() -> None:
    found = worn(disc=1e-13)
    half, whole = (np.array([e.values for e in found.model_at(h).effects]) for h in (50, 100))
    np.testing.assert_allclose(half, whole / 2)
    with pytest.raises(ValueError, match=r"hours = 101: must lie within 0 to 100"):
        found.model_at(101)


def test_steps_are_short_enough() -> None:
    """Heun's steps of a quarter of the elastic approach leave a percent of what wear does to the load."""
    once, often = (worn(hours=np.linspace(0, 1000, n), disc=3e-13) for n in (2, 17))
    np.testing.assert_allclose(once.lobe_depth[-1], often.lobe_depth[-1], atol=0.01 * often.lobe_depth.max())


def test_discs_wear_alike_in_their_own_frames() -> None:
    found = worn(disc=1e-13)
    by_disc = [[e.values for e in found.effects if e.indices["disc"] == disc] for disc in (0, 1)]
    np.testing.assert_allclose(by_disc[0], by_disc[1], rtol=1e-9, atol=1e-9 * found.lobe_depth.max())


def test_a_mirror_turns_forward_wear_into_reverse() -> None:
    forward, reverse, both = (worn(disc=SLIGHT, pin=SLIGHT, direction=d) for d in (1.0, -1.0, None))
    for name in ("lobe_depth", "pin_depth"):
        one, other, half = (getattr(found, name)[-1] for found in (forward, reverse, both))
        np.testing.assert_allclose(one, other[::-1], atol=1e-3 * one.max())
        np.testing.assert_allclose((one + other) / 2, half, atol=1e-9 * one.max())


def test_without_errors_every_pin_wears_alike() -> None:
    """A turn by one pin changes nothing: each pin loses as much in a whole turn, and a turn of the crank tells it."""
    nothing = rverror.effect("cycloid.pin_position", pin=3, radial=0.0)  # asks for the whole turn
    whole, one = (worn(Model(UNIT, effects), disc=SLIGHT, pin=SLIGHT, pins="turning") for effects in ((nothing,), ()))
    assert np.abs(whole.each_pin[-1]).max() < 1e-3 * whole.pin_depth[-1][0]
    assert (one.each_pin == 0).all()
    np.testing.assert_allclose(whole.lobe_depth[-1], one.lobe_depth[-1], atol=2e-3 * one.lobe_depth[-1].max())


def test_material_that_stands_proud_is_worn_off() -> None:
    """The lobes of a disc that is too large on one side lose more there, and no more than they had too much."""
    high = rverror.effect("cycloid.disc_profile", disc=0, harmonic=1, cos="2 um")
    found = worn(Model(UNIT, (high,)), hours=[0, 3000], direction=None, disc=3e-13)
    lost = {(e.indices["disc"], e.indices["harmonic"]): e.values for e in found.effects if e.key == high.key}
    cos, sin = lost[0, 1]
    assert -2e-3 < cos < -0.3e-3
    assert abs(sin) < -0.2 * cos
    assert -cos > abs(lost[1, 1][0])


def test_lost_motion_of_thinned_teeth_is_the_closed_form() -> None:
    """Source 003's slope: 1 / (r1 R) on the thickness that both gears lose together."""
    found = worn(sun=1e-12, planet=1e-12)
    thinner = found.thinning["sun"][-1] + found.thinning["planet"][-1]
    more = found.lost_motion[-1] - found.lost_motion[0]
    assert more == pytest.approx(thinner / (UNIT.sun_pitch_radius * UNIT.ratio), rel=1e-6)


def involute_length(base: float, low: float, high: float) -> float:
    """Length of an involute between two roll angles, by points."""
    roll = np.linspace(low, high, 20001)
    point = base * (1 - 1j * roll) * np.exp(1j * roll)
    return float(np.abs(np.diff(point)).sum())


def test_teeth_lose_their_volume_over_the_flank_that_touches() -> None:
    """From where the planet's tip meets the sun, or the line of action begins, to the sun's own tip; and its mate's."""
    found = worn(sun=SLIGHT, planet=SLIGHT)
    alpha, m, r1, r2 = UNIT.pressure_angle, UNIT.module, UNIT.sun_pitch_radius, UNIT.planet_pitch_radius
    base = r1 * math.cos(alpha), r2 * math.cos(alpha)
    whole = (r1 + r2) * math.sin(alpha)  # of the line of action
    tips = [math.sqrt((r + m) ** 2 - b**2) for r, b in zip((r1, r2), base, strict=True)]
    from_sun = max(whole - tips[1], 0.0), min(tips[0], whole)
    flank = (
        involute_length(base[0], from_sun[0] / base[0], from_sun[1] / base[0]),
        involute_length(base[1], (whole - from_sun[1]) / base[1], (whole - from_sun[0]) / base[1]),
    )
    teeth = UNIT.sun_teeth, UNIT.cranks * UNIT.planet_teeth
    for member, length, number in zip(("sun", "planet"), flank, teeth, strict=True):
        thinner = found.volume[member][-1] / (number * GEAR * length * math.cos(alpha))
        assert found.thinning[member][-1] == pytest.approx(thinner, rel=1e-6), member


def test_in_the_long_run_the_profile_wears_as_a_turn_of_the_disc_would_take_it_off() -> None:
    """Forces that change no more ask for depths that grow as a rigid turn closes the contacts: by their arms."""
    found = worn(hours=[10, 30000, 60000], disc=1e-12)
    carries = (found.roll_angle > LOBE[0]) & (found.roll_angle < LOBE[1])
    K, phi = UNIT.short_width_coefficient, found.roll_angle[carries]
    arm = np.sin(phi) / np.sqrt(1 + K**2 - 2 * K * np.cos(phi))
    by_arm = np.diff(found.lobe_depth[:, carries], axis=0) / arm
    early, late = by_arm[0], by_arm[-1]
    assert early.max() > 2 * early.min()
    assert np.ptp(late) < 0.1 * late.mean()
    # the output lags under load by as much more, what pins turn it by over the feedback of the carrier
    theta = np.arange(31) / 31 * 2 * np.pi / 40
    states = [rverror.equilibrium(found.model_at(h), theta, torque=TORQUE, direction=1.0) for h in found.hours[-2:]]
    lags = states[0].transmission_error.mean() - states[1].transmission_error.mean()
    assert lags == pytest.approx(117 / 121 * late.mean() / (UNIT.eccentricity * UNIT.disc_lobes), rel=0.03)
    # what is left is play, no ripple
    assert found.lost_motion[-1] - found.lost_motion[0] > 100 * (found.peak_to_peak[-1] - found.peak_to_peak[0])


@pytest.mark.parametrize(("body", "left"), [("disc", 0.004), ("pin", 0.05)])
def test_the_model_holds_what_was_lost(body: str, left: float) -> None:
    """The waves of both discs give lobe and patch back, as material that is less; what sixteen leave is told."""
    found = worn(**{body: SLIGHT})
    told = {0: np.zeros_like(found.roll_angle), 1: np.zeros_like(found.roll_angle)}
    for one in found.effects:
        cos, sin = one.values
        at = int(one.indices["harmonic"]) * found.roll_angle
        told[int(one.indices["disc"])] += cos * np.cos(at) + sin * np.sin(at)
    lost = found.lobe_depth[-1] + found.pin_depth[-1]
    for waves in told.values():
        assert (waves + lost).std() < left * lost.max()
        assert waves.mean() == pytest.approx(-lost.mean(), rel=1e-6)


def test_peak_to_peak_is_that_of_the_worn_model() -> None:
    """Of the direction in which it is larger."""
    errors = (rverror.effect("cycloid.disc_pitch", disc=0, harmonic=1, cos="5 um"),)
    found = worn(Model(UNIT, errors), direction=None, disc=1e-12)
    theta = 2 * np.pi / 40 * np.arange(200) / 200
    for at, hours in enumerate(found.hours):
        model = found.model_at(hours)
        states = [rverror.equilibrium(model, theta, torque=TORQUE, direction=d) for d in (1.0, -1.0)]
        expected = max(float(np.ptp(state.transmission_error)) for state in states)
        assert found.peak_to_peak[at] == pytest.approx(expected, rel=0.02)


def test_the_housing_as_output_wears_as_the_carrier_does() -> None:
    """The same torque on the carrier, the same turns of disc against housing: 120 of the input for one, not 121."""
    turned = rverror.reducer("RV-40E", output="housing")
    one = worn(disc=SLIGHT, pin=SLIGHT, direction=None)
    other = worn(Model(turned), torque=TORQUE / abs(turned.output_turn), disc=SLIGHT, pin=SLIGHT, direction=None)
    for name in ("lobe_depth", "pin_depth"):
        first, second = getattr(one, name)[-1], getattr(other, name)[-1]
        np.testing.assert_allclose(120 * second, 121 * first, atol=0.3 * first.max())


def test_a_wave_of_none_on_all_lobes_is_the_radius_of_all_pins() -> None:
    theta = np.linspace(0, 0.3, 11)
    lobes = [rverror.effect("cycloid.lobe_profile", disc=k, harmonic=0, cos="-3 um") for k in (0, 1)]
    pins = rverror.effect("cycloid.pin_radius", pin="all", deviation="-3 um")
    one, other = (
        rverror.equilibrium(Model(UNIT, effects), theta, torque="20 N*m").transmission_error
        for effects in (tuple(lobes), (pins,))
    )
    np.testing.assert_allclose(one, other, atol=1e-12)


def test_the_table_of_the_page_is_what_it_says() -> None:
    (table,) = re.findall(r"\| hours \| lobe.*?\n\| ---.*?\n(.*?)\n\n", text(DOCS / "theory" / "wear.md"), re.DOTALL)
    rows = np.array([[float(cell) for cell in row.strip("|").split("|")] for row in table.splitlines()])
    found = worn(
        hours=rows[:, 0],
        input_speed="1815 rpm",
        direction=None,
        **dict.fromkeys(("disc", "pin", "sun", "planet"), 1e-13),
    )
    depths = [found.lobe_depth.max(axis=1), found.pin_depth.max(axis=1), *found.thinning.values()]
    np.testing.assert_allclose(rows[:, 1:5], 1e3 * np.transpose(depths), atol=0.0051)
    np.testing.assert_allclose(rows[:, 5], found.lost_motion / rverror.ARCSEC, atol=0.051)
    np.testing.assert_allclose(rows[:, 6], found.peak_to_peak / rverror.ARCSEC, atol=0.0051)


#: K = 0.95 and pins nearly as thick as undercut lets them be: depths have a peak that sixteen waves do not follow.
NEARLY_UNDERCUT = Reducer(
    sun_teeth=6, planet_teeth=10, module=1.7, pressure_angle=math.radians(14), disc_lobes=34, pins=35,
    pin_circle_radius=30.0, pin_radius=1.17, eccentricity=0.8142857, cranks=3, discs=1, gear_backlash=0.02,
)  # fmt: skip


def kept_by_the_waves(unit: Reducer, torque: float) -> float:
    """Share of a lobe's volume that its mean and sixteen waves hold, from the contact forces and the profile.

    With depth W/s', W the work over the roll angle and s' the length of profile, a projection P on the waves leaves
    the volume under P(W/s') over that under W/s': since P is its own adjoint, sum of W P(s')/s' over sum of W.
    """
    theta = 2 * np.pi / unit.pins * np.arange(47) / 47
    state = rverror.equilibrium(Model(unit), theta, torque=torque, direction=1.0)
    force = np.hypot(*np.moveaxis(state.contact_forces["pin"][0], 1, 0))
    phase = np.mod(-unit.disc_lobes * theta - 2 * np.pi * np.arange(unit.pins)[:, None] / unit.pins, 2 * np.pi)
    K, even = unit.short_width_coefficient, 2 * np.pi * np.arange(4096) / 4096
    work = force * (unit.pin_circle_radius * np.sqrt(1 + K**2 - 2 * K * np.cos(phase)) - unit.pin_radius)
    wave = np.fft.rfft(along_profile(unit, even))[:17] / even.size * np.where(np.arange(17) == 0, 1, 2)
    length = np.tensordot(wave, np.exp(1j * np.arange(17)[:, None, None] * phase), 1).real
    return float((work * length / along_profile(unit, phase.ravel()).reshape(phase.shape)).sum() / work.sum())


@settings(max_examples=6)
@given(reducers())
@example(NEARLY_UNDERCUT)
def test_volume_is_held_on_any_geometry_as_far_as_the_waves_follow_it(unit: Reducer) -> None:
    torque = 1e-3 * unit.stiffness.pin_contact * unit.pin_circle_radius
    found = wear(
        Model(unit),
        torque=torque,
        input_speed=100.0,
        hours=[0, 1],
        coefficients=WearCoefficients(disc=SLIGHT, pin=SLIGHT),
        disc_width=DISC,
        gear_width=GEAR,
        pins="turning",
        direction=1.0,
    )
    assert found.volume["disc"][-1] == found.volume["pin"][-1] > 0
    assert mass_balance(unit, found) == pytest.approx(kept_by_the_waves(unit, torque), abs=2e-3)


def test_coefficients_have_units() -> None:
    assert WearCoefficients(pin="1e-10 mm^3/(N*m)").pin == pytest.approx(1e-13)
    assert WearCoefficients(pin="1e-8 1/GPa").pin == pytest.approx(1e-11)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"disc": -1e-13}, r"disc = -1e-10 mm\^3/\(N\*m\): must be 0 or more"),
        ({}, "no wear coefficient is above 0; give one of disc, pin, sun, planet"),
        ({"disc": "1 mm"}, "disc: .*no unit of wear coefficient"),
        ({"disc": 1e-13, "hours": 0}, "hours = 0: must be above 0"),
        ({"disc": 1e-13, "hours": [0, 3, 2]}, "hours = .*: must be above 0, and grow"),
        ({"disc": 1e-13, "torque": 0}, r"torque = 0 N\*m: must be above 0"),
        ({"disc": 1e-13, "input_speed": "-3 rpm"}, "speed = -3 rpm: must be above 0"),
        ({"disc": 1e-13, "pins": "loose"}, "pins = 'loose': must be one of 'fixed', 'turning'"),
        ({"disc": 1e-13, "direction": 2}, "direction = 2: must be"),
        ({"disc": 1e-3}, "mm would be worn off.*give fewer hours or a smaller coefficient"),
        ({"disc": 1e-13, "model": Model(rverror.Drive(ratio=7.0))}, "wear needs a .reducer. model"),
    ],
)
def test_what_is_refused(given: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        worn(**given)


def test_hours_may_be_a_quantity() -> None:
    assert worn(hours="2 h", disc=SLIGHT).hours[-1] == 2
    assert worn(hours=rverror.base.to_core("30 min", "time") / 3600, disc=SLIGHT).hours[-1] == 0.5


def test_a_unit_without_rated_torque_has_its_duty_for_it() -> None:
    bare = rverror.reducer("RV-40E", rated_torque=None)
    one, other = worn(Model(bare), disc=SLIGHT), worn(disc=SLIGHT)
    np.testing.assert_allclose(one.lost_motion, other.lost_motion, rtol=1e-12)
