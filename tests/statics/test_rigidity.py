"""Lost motion, backlash, stiffness: hand calculations, limits, bounds of statics, symmetry, published slopes."""

from __future__ import annotations

import math
import re
from dataclasses import asdict, replace

import numpy as np
import pint
import pytest
from scipy.optimize import brentq

import rverror
from oracle import Errors, Oracle, put
from pages import DOCS
from rverror.geartrain.contacts import closed_form_forces, pose
from rverror.geartrain.mechanism import Stiffness
from rverror.statics.rigidity import TorsionCurve, backlash, lost_motion, torsion_curve, torsional_stiffness

ARCSEC = math.pi / 180 / 3600
PER_ARCMIN = 1e-3 * math.radians(1 / 60)  # N*mm/rad to N*m/arcmin
#: Windup of the trace of torque that stands for none.
NO_LOAD = 0.03 * ARCSEC
#: Off the places where pins or flanks of both sides are equal.
THETA = 2 * np.pi / 40 * (np.arange(8) + 0.3) / 8
RATED = 412e3
GAP = 5e-3
RIGID = Stiffness(
    pin_contact=1e8, crank_bearing=1e8, carrier_bearing=1e8, gear_mesh=1e8, sun_support=1e2, main_bearing=1e8
)


def model(*effects: rverror.Effect, preset: str = "RV-40E", **changes: object) -> rverror.Model:
    return rverror.Model(rverror.reducer(preset, **({"rated_torque": RATED} | changes)), effects)


def all_pins(gap: float = GAP) -> rverror.Effect:
    return rverror.effect("cycloid.pin_radius", pin="all", deviation=-gap)


def feedback(unit: rverror.Reducer) -> float:
    return unit.disc_lobes * unit.planet_teeth / unit.sun_teeth / unit.ratio


def arms(unit: rverror.Reducer, theta: np.ndarray = THETA) -> np.ndarray:
    """Arms of the contact normals, (discs, pins, n), from the triangle of housing centre, pin and pitch point."""
    a, z_c, z_p, r_p = unit.eccentricity, unit.disc_lobes, unit.pins, unit.pin_circle_radius
    lead = 2 * np.pi * np.arange(unit.discs) / unit.discs
    phi = -z_c * theta + lead[:, None, None] - 2 * np.pi * np.arange(z_p)[:, None] / z_p
    side = np.sqrt(r_p**2 + (a * z_p) ** 2 - 2 * r_p * a * z_p * np.cos(phi))  # pin to pitch point
    return np.asarray(a * z_c * r_p * np.sin(phi) / side)


def free_turn(unit: rverror.Reducer, gap: float = GAP) -> np.ndarray:
    """The longest arm of either side closes first; the discs' turn reaches the output less the feedback."""
    arm = arms(unit)
    return np.asarray(feedback(unit) * gap * (1 / arm.max(axis=(0, 1)) - 1 / arm.min(axis=(0, 1))))


# --- play -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("changes", [{}, {"cranks": 3}, {"stiffness": RIGID}, {"preset": "RV-003"}])
def test_uniform_gap_of_the_pins(changes: dict) -> None:
    """2 F e / (a z_c), but for the pin that stands next to the place of the longest arm, at any stiffness."""
    gapped = model(all_pins(), gear_backlash=0.0, **changes)
    unit = gapped.mechanism
    found = backlash(gapped, THETA)
    np.testing.assert_allclose(found, free_turn(unit), atol=NO_LOAD)
    limit = 2 * feedback(unit) * GAP / (unit.eccentricity * unit.disc_lobes)
    assert (found > limit - NO_LOAD).all()
    assert (found < 1.004 * limit + NO_LOAD).all()


def test_uniform_gap_with_the_cranks_held_and_with_the_sun_held() -> None:
    """Held cranks let the discs turn by 2 e / (a z_c); held at the sun the output gets F = 117/121 of it."""
    gapped = model(all_pins(), gear_backlash=0.0)
    cranks_held = 2 * GAP / (1.25 * 39)
    assert cranks_held / ARCSEC == pytest.approx(42.31, abs=0.01)
    assert backlash(gapped, THETA).mean() / cranks_held == pytest.approx(117 / 121, rel=2e-3)


def deepest(lag: float, train: Oracle, errors: Errors, i: int, mode: np.ndarray) -> float:
    """How deep the deepest pin stands in its disc at angle i, the mechanism moved by `lag` along its freedom."""
    moved = np.zeros((1, THETA.size, train.unknowns))
    moved[0, i] = lag * mode
    return float(train.contacts(moved, errors)[0][0, i, : train.unit.discs * train.unit.pins].max())


def test_uniform_gap_in_the_independent_geometry() -> None:
    """The rigid mechanism of exact profiles, moved along its one freedom until a pin touches."""
    unit = model(gear_backlash=0.0).mechanism
    pins = unit.discs * unit.pins
    turn = np.zeros(THETA.size)
    for sense in (1, -1):
        train = Oracle(unit, THETA, sense=sense)
        errors = Errors(unit, 1)
        put(errors, unit, 0, ("cycloid.pin_radius", {"pin": "all"}, "deviation"), -GAP)
        still = np.zeros((1, THETA.size, train.unknowns))
        gradient = train.contacts(still, errors)[1][0]
        for i in range(THETA.size):
            mode = np.linalg.svd(gradient[i, pins:])[2][-1]  # what leaves bearings and meshes closed
            mode = mode / mode[2]

            turn[i] += brentq(deepest, 0, 3e-4, args=(train, errors, i, -sense * mode), xtol=1e-13)
    # the exact profile's curvature: what first order leaves out
    np.testing.assert_allclose(backlash(rverror.Model(unit, (all_pins(),)), THETA), turn, rtol=1e-3)


def test_uniform_gap_in_the_rigid_limit_at_three_percent() -> None:
    gapped = model(all_pins(), gear_backlash=0.0, stiffness=RIGID)
    np.testing.assert_allclose(lost_motion(gapped, THETA), free_turn(gapped.mechanism), rtol=2e-3)


@pytest.mark.parametrize("cranks", [2, 3, 4])
@pytest.mark.parametrize("play", [0.0, 5e-3, 40e-3])
def test_gear_backlash(cranks: int, play: float) -> None:
    """(z2/z1) / (R r2 cos(alpha)) times the play of each mesh, however many share the torque."""
    expected = play * 3 / (121 * 20.25 * math.cos(math.radians(20)))
    found = backlash(model(gear_backlash=play, cranks=cranks), THETA)
    np.testing.assert_allclose(found, expected, atol=NO_LOAD)


def test_plays_add_up() -> None:
    """Play of the meshes turns all cranks, that of the pins the discs, that of the carrier bearings the carrier."""
    clearance = rverror.effect("coupling.bearing_clearance", clearance=2e-3)
    both = backlash(model(all_pins(), clearance, gear_backlash=10e-3), THETA)
    alone = backlash(model(all_pins(), gear_backlash=0.0), THETA) + backlash(model(gear_backlash=10e-3), THETA)
    np.testing.assert_allclose(both, alone + 2 * 2e-3 / 27, rtol=1e-3, atol=2 * NO_LOAD)


def test_gear_backlash_shifts_the_branches_at_any_load() -> None:
    step = lost_motion(model(gear_backlash=30e-3), THETA) - lost_motion(model(gear_backlash=20e-3), THETA)
    np.testing.assert_allclose(step, 10e-3 / (121 * 6.75 * math.cos(math.radians(20))), rtol=1e-6)


@pytest.mark.parametrize("member", ["sun", "planet"])
def test_tooth_thinning(member: str) -> None:
    """thinning / (r1 R); source 003 measured 157 arcsec/mm against 170."""
    worn = rverror.effect("involute.tooth_thinning", member=member, thinning="50 um")
    slope = (lost_motion(model(worn, preset="RV-003"), THETA) - lost_motion(model(preset="RV-003"), THETA)) / 0.050
    np.testing.assert_allclose(slope, 1 / (12 * 101), rtol=1e-6)
    assert slope[0] / ARCSEC == pytest.approx(157, rel=0.09)


def test_spline_clearance() -> None:
    """clearance / r_s (z2/z1) / R, 729 arcsec/mm; source 003's table has 45 and 80 arcsec at 0.046 and 0.097 mm."""

    def lost(clearance: float) -> np.ndarray:
        splines = [rverror.effect("involute.spline_clearance", crank=j, clearance=clearance) for j in range(3)]
        return lost_motion(model(*splines, preset="RV-003"), THETA)

    slope = (lost(0.097) - lost(0.046)) / 0.051
    np.testing.assert_allclose(slope, 2.5 / (7 * 101), rtol=1e-6)
    assert slope[0] / ARCSEC == pytest.approx((80 - 45) / 0.051, rel=0.07)


@pytest.mark.parametrize("percent", [0.0, 3.0])
def test_carrier_bearing_clearance(percent: float) -> None:
    loose = rverror.effect("coupling.bearing_clearance", clearance=5e-3)
    step = lost_motion(model(loose), THETA, percent=percent) - lost_motion(model(), THETA, percent=percent)
    np.testing.assert_allclose(step, 2 * 5e-3 / 27, rtol=1e-3)
    assert step[0] / ARCSEC == pytest.approx(2 * 38.2, abs=0.1)


def test_lost_motion_begins_at_the_backlash_and_grows() -> None:
    gapped = model(all_pins(), rverror.effect("crank.bearing_clearance", clearance=2e-3))
    lost = [lost_motion(gapped, THETA, percent=p) for p in (0.0, 1.0, 3.0, 10.0, 100.0)]
    np.testing.assert_array_equal(lost[0], backlash(gapped, THETA))
    assert (np.diff(lost, axis=0) > 0).all()


# --- stiffness ------------------------------------------------------------------------------------------------------


def series(unit: rverror.Reducer) -> dict[str, np.ndarray]:
    """Compliance of each kind of contact with all others rigid, the mean of both senses, rad/(N*mm), by hand."""
    k, f, cranks = unit.stiffness, feedback(unit), unit.cranks
    r1 = unit.module * unit.sun_teeth / 2
    r6 = unit.module * (unit.sun_teeth + unit.planet_teeth) / 2
    drive = [f**2 / (k.pin_contact * (np.maximum(s * arms(unit), 0) ** 2).sum(axis=(0, 1))) for s in (1, -1)]
    one = np.ones(THETA.size)
    # M = F / discs turns a disc against its pins, whose force across the eccentric direction is at least M / (a z_c)
    across = (1 / (unit.eccentricity * unit.disc_lobes)) ** 2
    apart = math.tan(unit.pressure_angle) / (unit.ratio * r1)  # the meshes push the cranks outwards
    return {
        "pin_contact": (drive[0] + drive[1]) / 2,
        "crank_bearing": one * f**2 * (across + 1 / r6**2) / (unit.discs * cranks * k.crank_bearing),
        "carrier_bearing": one * (1 / r6**2 + apart**2) / (cranks * k.carrier_bearing),
        "gear_mesh": one / (cranks * k.gear_mesh * (unit.ratio * r1 * math.cos(unit.pressure_angle)) ** 2),
    }


@pytest.mark.parametrize("cranks", [2, 3])
@pytest.mark.parametrize("part", ["pin_contact", "crank_bearing", "carrier_bearing", "gear_mesh"])
def test_one_compliant_part(part: str, cranks: int) -> None:
    """k sum(l^2)/F^2 of the pins, n k r6^2 of the carrier bearings, n k (R r1 cos(alpha))^2 of the meshes, the cams."""
    soft = replace(RIGID, **{part: 1e5})
    found = torsional_stiffness(model(stiffness=soft, cranks=cranks), THETA)
    expected = series(rverror.reducer("RV-40E", stiffness=soft, cranks=cranks))
    assert (expected[part] > 0.4 * sum(expected.values())).all()
    np.testing.assert_allclose(found, 1 / sum(expected.values()), rtol=3e-3 if part == "gear_mesh" else 1e-3)


@pytest.mark.parametrize("preset", ["RV-40E", "RV-003"])
def test_compliance_lies_between_the_bounds_of_statics(preset: str) -> None:
    """Forces share so that sum(f^2 / k) is least: above each part's own least, below any other sharing's."""
    loaded = model(preset=preset)
    unit = loaded.mechanism
    stiffness = asdict(unit.stiffness)
    compliance = 1 / torsional_stiffness(loaded, THETA)
    lower = sum(series(unit).values())
    name = {"pin": "pin_contact", "cam": "crank_bearing", "carrier": "carrier_bearing", "mesh": "gear_mesh"}
    upper = 0.0
    for direction in (1, -1):
        forces = closed_form_forces(pose(unit, THETA, direction=direction))
        upper += sum((forces[c] ** 2).reshape(-1, THETA.size).sum(axis=0) / stiffness[k] for c, k in name.items()) / 2
    assert (lower < compliance).all()
    assert (compliance < upper).all()
    np.testing.assert_allclose(lower, upper, rtol=0.03)  # so the hand calculation is that good


def test_work_of_the_load_is_the_energy_of_the_contacts() -> None:
    """Clapeyron: T Theta = sum(f^2 / k); the branches of a reducer without errors are straight."""
    tight = model(gear_backlash=0.0)
    unit, k = tight.mechanism, tight.mechanism.stiffness
    work = energy = 0.0
    for direction in (1, -1):
        state = rverror.equilibrium(tight, THETA, torque=RATED, direction=direction)
        force = state.contact_forces
        pairs = (
            ("pin", k.pin_contact),
            ("cam", k.crank_bearing),
            ("carrier", k.carrier_bearing),
            ("mesh", k.gear_mesh),
        )
        energy += sum((force[c] ** 2).reshape(-1, THETA.size).sum(axis=0) / stiff for c, stiff in pairs)
        energy += k.main_bearing * (state.pose["carrier"][:2] ** 2).sum(axis=0)
        energy += k.sun_support * (state.pose["sun"] ** 2).sum(axis=0)
        work += 2 * RATED**2 / torsional_stiffness(rverror.Model(unit), THETA) / 2
    np.testing.assert_allclose(work, energy, rtol=1e-6)


def test_branches_without_errors_are_straight() -> None:
    torques = RATED * np.array([0.05, 0.25, 0.5, 1.0])
    angle = torsion_curve(model(gear_backlash=0.0), THETA, torques=torques).angle
    np.testing.assert_allclose(angle / torques[:, None], np.tile(angle[-1] / RATED, (4, 1)), rtol=1e-3)


def test_a_gap_makes_the_curve_harden() -> None:
    """Pins give by T(x) = sum k l/F <l x/F - e>; the curve is its inverse, from mid-play, in series with the rest."""
    hard = dict.fromkeys(("crank_bearing", "carrier_bearing", "gear_mesh", "main_bearing"), 3e6)
    gapped = model(all_pins(), gear_backlash=0.0, stiffness=Stiffness(pin_contact=1e4, **hard))
    unit = gapped.mechanism
    arm, f = arms(unit), feedback(unit)
    middle = f * GAP * (1 / arm.max(axis=(0, 1)) + 1 / arm.min(axis=(0, 1))) / 2
    torques = RATED * np.array([-1.0, -0.5, -0.1, -0.03, 0.0, 0.03, 0.1, 0.5, 1.0])
    curve = torsion_curve(gapped, THETA, torques=torques)
    rest = sum(part for name, part in series(unit).items() if name != "pin_contact")
    turn = curve.angle + middle - torques[:, None] * rest
    closing = np.maximum(turn[:, None, None] * arm / f - GAP, 0)
    np.testing.assert_allclose(
        (1e4 * arm / f * closing).sum(axis=(1, 2)), np.tile(torques, (8, 1)).T, rtol=0.01, atol=1e-3 * RATED
    )
    slopes = [curve.stiffness(low=RATED * a, high=RATED * b) for a, b in ((0.03, 0.1), (0.1, 0.5), (0.5, 1.0))]
    assert (np.diff(slopes, axis=0) > 0).all()
    pins_alone = 1 / series(unit)["pin_contact"]
    assert (torsional_stiffness(gapped, THETA) < pins_alone).all()


def test_mirror_image() -> None:
    """Mirrored at the x axis theta becomes -theta and a torque its opposite; this unit is its own mirror image."""
    effects = (
        all_pins(),
        rverror.effect("crank.bearing_clearance", clearance=2e-3),
        rverror.effect("involute.tooth_thinning", member="sun", thinning="10 um"),
    )
    torques = np.array([-412e3, -20e3, 0.0, 20e3, 412e3])
    ahead = torsion_curve(model(*effects), THETA, torques=torques).angle
    mirrored = torsion_curve(model(*effects), -THETA, torques=torques).angle
    np.testing.assert_allclose(ahead, -mirrored[::-1], atol=1e-3 * ARCSEC)


def test_curve_is_antisymmetric_over_a_period() -> None:
    period = 2 * np.pi / 40 * np.arange(32) / 32
    torques = np.array([-412e3, -206e3, -12e3, 12e3, 206e3, 412e3])
    mean = torsion_curve(model(all_pins()), period, torques=torques).angle.mean(axis=1)
    np.testing.assert_allclose(mean, -mean[::-1], atol=1e-3 * ARCSEC)
    assert (np.diff(mean) > 0).all()


def test_errors_that_only_shift_the_output_leave_the_curve() -> None:
    """Tangential errors of all carrier bores turn the output by -e/r6 under any load."""
    bores = [rverror.effect("coupling.carrier_bore_position", crank=j, tangential="5 um") for j in (0, 1)]
    torques = [-412e3, -12e3, 0.0, 12e3, 412e3]
    shifted = torsion_curve(model(*bores), THETA, torques=torques).angle
    np.testing.assert_allclose(shifted, torsion_curve(model(), THETA, torques=torques).angle, atol=1e-6 * ARCSEC)


def test_output_shaft_is_a_spring_in_series() -> None:
    shaft = rverror.effect("load.torsion", compliance=2e-9)
    with_it, without = (1 / torsional_stiffness(m, THETA) for m in (model(shaft), model()))
    np.testing.assert_allclose(with_it - without, 2e-9, rtol=1e-6)


def test_sensors_do_not_count() -> None:
    chain = (
        rverror.effect("sensor.encoder_eccentricity", cos="20 arcsec"),
        rverror.effect("sensor.time_offset", offset="1 ms"),
    )
    np.testing.assert_array_equal(lost_motion(model(*chain), THETA), lost_motion(model(), THETA))


def test_stiffer_parts_never_soften() -> None:
    base = 1 / torsional_stiffness(model(), THETA)
    for part in ("pin_contact", "crank_bearing", "carrier_bearing", "gear_mesh"):
        stiff = Stiffness(**{part: 2 * getattr(Stiffness(), part)})
        assert (1 / torsional_stiffness(model(stiffness=stiff), THETA) < base).all()


# --- the curve as an object, units, refusals ------------------------------------------------------------------------


def test_slope_of_a_curve_in_any_order() -> None:
    torque = np.array([2e3, 0.0, 1e3, -2e3])
    curve = TorsionCurve(torque, np.outer(torque, [1e-9, 2e-9]))
    np.testing.assert_allclose(curve.stiffness(low=0.0, high="1.5 N*m"), [1e9, 5e8], rtol=1e-12)
    with pytest.raises(ValueError, match=r"3 N\*m lies outside the curve, -2 to 2 N\*m; compute it for more torques"):
        curve.stiffness(low=0.0, high=3e3)
    with pytest.raises(ValueError, match="a slope needs two torques"):
        curve.stiffness(low=1e3, high="1 N*m")


def test_stiffness_is_the_slope_of_both_branches() -> None:
    gapped = model(all_pins(), rverror.effect("crank.eccentricity", crank=0, disc=0, radial="5 um"))
    curve = torsion_curve(gapped, THETA, torques=[-RATED, -RATED / 2, RATED / 2, RATED])
    branches = curve.stiffness(low=RATED / 2, high=RATED), curve.stiffness(low=-RATED, high=-RATED / 2)
    harmonic = 2 / (1 / branches[0] + 1 / branches[1])
    np.testing.assert_allclose(torsional_stiffness(gapped, THETA), harmonic, rtol=1e-9)


def test_quantities() -> None:
    registry = pint.UnitRegistry()
    degrees = registry.Quantity(np.degrees(THETA), "deg")
    np.testing.assert_allclose(lost_motion(model(), degrees), lost_motion(model(), THETA), rtol=1e-9)
    plain = torsion_curve(model(), THETA, torques=[-20e3, 0, 412e3])
    for torques in (registry.Quantity([-20.0, 0.0, 412.0], "N*m"), ["-20 N*m", 0, "412 N*m"]):
        np.testing.assert_allclose(torsion_curve(model(), THETA, torques=torques).angle, plain.angle, rtol=1e-9)
    assert (plain.angle[1] == 0).all()
    assert (plain.angle[2] > 0).all()  # a counter-clockwise torque turns the output counter-clockwise


def test_refusals() -> None:
    bare = rverror.Model(rverror.reducer("RV-003"))
    for wants_rated in (lost_motion, torsional_stiffness):
        with pytest.raises(
            ValueError, match=r"'RV-003' has no rated_torque.*give it, e\.g\. rated_torque = '412 N\*m'"
        ):
            wants_rated(bare, THETA)
    assert (backlash(bare, THETA) > 0).all()
    drive = rverror.Model(rverror.Drive(ratio=-14.0))
    for function in (lost_motion, backlash, torsional_stiffness):
        with pytest.raises(ValueError, match=r"needs a \[reducer\] model"):
            function(drive, THETA)
    for percent in (-1.0, math.nan, math.inf):
        with pytest.raises(ValueError, match=r"percent = (-1\.0|nan|inf): must be 0 or more"):
            lost_motion(model(), THETA, percent=percent)
    for low, high in ((50.0, 50.0), (-1.0, 50.0), (50.0, math.inf)):
        with pytest.raises(ValueError, match="must be 0 <= low < high"):
            torsional_stiffness(model(), THETA, low=low, high=high)
    for torques in ([], np.zeros((2, 2))):
        with pytest.raises(ValueError, match="give a row"):
            torsion_curve(model(), THETA, torques=torques)


def test_figures_of_the_page() -> None:
    """The table of docs/theory/rigidity.md, and the makers' ranges that it compares with."""
    page = (DOCS / "theory" / "rigidity.md").read_text(encoding="utf-8")
    rows = dict(
        re.findall(r"^\| (torsional stiffness|lost motion at 3 %|backlash) \|[^|]*\| ([\d.]+) [^|]*\|", page, re.M)
    )
    period = 2 * np.pi / 40 * np.arange(16) / 16
    unit = rverror.Model(rverror.reducer("RV-40E"))
    assert float(rows["torsional stiffness"]) == round(float(torsional_stiffness(unit, period).mean()) * PER_ARCMIN)
    for name, values in (("lost motion at 3 %", lost_motion(unit, period)), ("backlash", backlash(unit, period))):
        assert float(rows[name]) == round(float(values.mean()) / ARCSEC / 60, 2)
    shares = dict(re.findall(r"^\| (pins|cams|carrier bearings|gear meshes) \|.*\| ([\d.]+) % \|$", page, re.M))
    parts = {name: float(part.mean()) for name, part in series(unit.mechanism).items()}
    for name, part in zip(("pins", "cams", "carrier bearings", "gear meshes"), parts.values(), strict=True):
        assert float(shares[name]) == round(100 * part / sum(parts.values()), 1)
    gears = {"gear_backlash": 0.0}
    splines = [rverror.effect("involute.spline_clearance", crank=j, clearance=5e-3) for j in (0, 1)]
    plays = {
        "gap": model(all_pins(), **gears),
        "gear backlash": model(gear_backlash=5e-3),
        "tooth thinning": model(rverror.effect("involute.tooth_thinning", member="sun", thinning=5e-3), **gears),
        "spline clearance": model(*splines, **gears),
        "clearance": model(rverror.effect("coupling.bearing_clearance", clearance=5e-3), **gears),
    }
    for name, play in plays.items():
        (stated,) = re.findall(rf"^\| {name} \$.*\| ([\d.]+) arcsec \|$", page, re.M)
        assert float(stated) == pytest.approx(backlash(play, period).mean() / ARCSEC, rel=2e-3, abs=NO_LOAD / ARCSEC)
    scaled = model(stiffness=Stiffness(crank_bearing=4.3e5, carrier_bearing=4.3e5))
    assert torsional_stiffness(scaled, period).mean() * PER_ARCMIN == pytest.approx(108, abs=1)
