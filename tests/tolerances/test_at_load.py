"""Limits at the load: units against models written effect by effect, slopes, yields and least costs of known laws."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import rverror
from gear_runs import UNIT
from rverror.base.units import ARCSEC
from rverror.tolerances import loaded_units as angles
from rverror.tolerances.allocation import allocate_at_load
from rverror.tolerances.constraints import SampleQuantile
from rverror.tolerances.loaded_units import LoadedTurn, LoadedUnits, instances_of
from rverror.tolerances.loaded_yield import loaded_units, standard_draws, verified
from rverror.tolerances.specification import Limit, limit

#: Few pins, so that it is solved quickly, under the same rated torque.
FEW_PINS = {"pins": 12, "disc_lobes": 11, "eccentricity": 3.0, "pin_radius": 6.0}
ARM = rverror.geartrain.GravityArm(mass="20 kg", lever="0.5 m", offset="30 deg")
EVERY_LIMIT = (
    limit("transmission_error", "30 arcsec", torque="20 N*m"),
    limit("transmission_error", "30 arcsec", torque="412 N*m"),
    limit("lost_motion", "60 arcsec"),
    limit("backlash", "60 arcsec"),
    limit("stiffness", "70 N*m/arcmin"),
    limit("transmission_error", "60 arcsec", torque=ARM),
)


def mixed(**changes: Any) -> tuple[rverror.Model, list[rverror.tolerances.Tolerance]]:
    """A model with declared effects, and tolerances of every way in which a source acts."""
    unit = rverror.reducer("RV-40E", **FEW_PINS, **changes)
    declared = (
        rverror.effect("cycloid.pin_position", pin=7, radial="3 um"),
        rverror.effect("crank.bearing_clearance", clearance="1 um"),
        rverror.effect("sensor.encoder_eccentricity", cos="2 arcsec"),
    )
    tolerances = [
        rverror.tolerance("cycloid.pin_position", "4 um"),
        rverror.tolerance("cycloid.disc_pitch", "5 um", harmonic=(1, 2)),
        rverror.tolerance("crank.eccentricity", "3 um"),
        rverror.tolerance("coupling.carrier_bore_position", "4 um"),
        rverror.tolerance("involute.tooth_thinning", "6 um", mean="10 um", member="sun"),
        rverror.tolerance("crank.bearing_clearance", "2 um", mean="3 um"),
        rverror.tolerance("coupling.bearing_clearance", "1 um", mean="2 um"),
        rverror.tolerance("cycloid.profile_modification", "2 um", parameters=("equidistant",), mean="3 um"),
        rverror.tolerance("crank.bearing_compliance", "0.2 um/kN", disc=0, crank=0),
        rverror.tolerance("cycloid.pin_compliance", "0.2 um/kN", pin="all"),
        rverror.tolerance("sensor.encoder_eccentricity", "3 arcsec"),
        rverror.tolerance("load.torsion", "0.01 arcsec/(N*m)", mean="0.02 arcsec/(N*m)"),
    ]
    return rverror.Model(unit, declared), tolerances


def of_effects(units: LoadedUnits, drawn: np.ndarray) -> rverror.Model:
    """The model of one unit, written effect by effect."""
    values = units.means + drawn * units.stack.width[units.stack.entry]
    effects = tuple(one.effect(values) for one in instances_of(units.stack))
    return rverror.Model(units.model.mechanism, (*units.model.effects, *effects))


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"contact_law": rverror.geartrain.ContactLaw(pin_exponent=10 / 9, profile_curvature=1.0)},
        {"output": "housing"},
    ],
    ids=["linear", "power law on curved profiles", "output at the housing"],
)
def test_turns_of_a_unit_are_those_of_its_model_written_effect_by_effect(changes: dict[str, Any]) -> None:
    model, tolerances = mixed(**changes)
    units = loaded_units(model, tolerances, EVERY_LIMIT)
    drawn = standard_draws(units.stack, 3, seed=4, stream=0)
    turns = units.solved(drawn, units.stack.width).turns
    turn, places = (2 * np.pi * np.arange(n) / n for n in (4096, 48))
    for unit in range(3):
        one = of_effects(units, drawn[unit])
        for at, torque in ((0, "20 N*m"), (1, "412 N*m"), (5, ARM)):
            full = np.ptp(rverror.equilibrium(one, turn, torque=torque, direction=1.0).transmission_error)
            assert 0.97 * full <= turns[unit, at] <= full * (1 + 1e-9)  # of all angles, a few of which are solved
        assert turns[unit, 2] == pytest.approx(rverror.lost_motion(one, places).max(), rel=1e-7)
        assert turns[unit, 3] == pytest.approx(rverror.statics.backlash(one, places).max(), rel=1e-7)
        stiffness = units.limits[4].turned(turns[unit, 4])
        assert stiffness == pytest.approx(rverror.statics.torsional_stiffness(one, places).min(), rel=1e-7)


def test_a_head_that_reads_the_tilt_of_the_output_moves_the_error_and_no_lost_motion() -> None:
    """It grows with the torque, so that forward less reverse does not cancel it: it is no motion of the output."""
    model, tolerances = mixed()
    read = model.with_effects(rverror.effect("sensor.output_tilt", x="20 arcsec/(kN*m)"))
    tilted, plain = (loaded_units(one, tolerances, EVERY_LIMIT) for one in (read, model))
    drawn = standard_draws(plain.stack, 2, seed=1, stream=0)
    turns, without = (units.solved(drawn, units.stack.width).turns for units in (tilted, plain))
    error = [limit.quantity == "transmission_error" for limit in EVERY_LIMIT]
    moved = np.abs(turns - without).max(axis=0) > 1e-9
    assert moved.tolist() == error


@pytest.mark.usefixtures("few_angles")  # a slope is that of the turn between two angles, whichever they are
@pytest.mark.parametrize("changes", [{}, {"contact_law": rverror.geartrain.ContactLaw(profile_curvature=1.0)}])
def test_slopes_are_differences_of_solved_units(changes: dict[str, Any]) -> None:
    model, tolerances = mixed(**changes)
    limits = [one for one in EVERY_LIMIT if one.quantity != "backlash"]  # its contacts are about to change
    units = loaded_units(model, tolerances, limits)
    drawn, widths = standard_draws(units.stack, 2, seed=1, stream=0), units.stack.width
    found = units.solved(drawn, widths, slopes=True)
    assert found.near is not None
    assert found.slopes is not None
    first = np.argmax(found.near, axis=2)[..., None]
    for entry in range(len(widths)):
        step = np.where(np.arange(len(widths)) == entry, 1e-5 * widths, 0.0)  # no contact changes within it
        rise = units.solved(drawn, widths + step).turns - units.solved(drawn, widths - step).turns
        told = np.take_along_axis(found.slopes[..., entry], first, axis=2)[..., 0]
        np.testing.assert_allclose(rise / (2 * step[entry]), told, rtol=2e-5, atol=1e-5 * np.abs(told).max())


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_torque_that_is_the_same_at_every_angle_is_that_torque(direction: float) -> None:
    model, tolerances = mixed()
    asked = [
        limit("transmission_error", "30 arcsec", torque=torque)
        for torque in ("20 N*m", lambda theta: np.full(theta.shape, direction * 20e3))
    ]
    units = loaded_units(model, tolerances, asked, direction=direction)
    found = units.solved(standard_draws(units.stack, 2, seed=4, stream=0), units.stack.width, slopes=True)
    assert found.near is not None
    assert found.slopes is not None
    for values in (found.turns, found.near, found.slopes):
        assert np.array_equal(values[:, 0], values[:, 1])


def test_what_may_be_out_of_balance_goes_with_the_torque_at_each_angle() -> None:
    model, tolerances = mixed()
    units = loaded_units(model, tolerances, EVERY_LIMIT[-1:])
    every = instances_of(units.stack)
    turn = LoadedTurn.of(model, every, angles=48, direction=1.0, torque=ARM, reads=False)
    places = np.array([30, 3, 15])
    problem = turn.state(units.means, places).problem
    torque = np.abs(ARM(2 * np.pi * places / 48))
    assert problem.tolerance / problem.tolerance[0] == pytest.approx(torque / torque[0])
    assert problem.heavy * torque == pytest.approx(np.full(3, problem.heavy[0] * torque[0]))


@pytest.mark.usefixtures("few_angles")
def test_budget_of_an_arm_and_what_an_arm_is_no_load_of() -> None:
    model, tolerances = mixed()
    found = rverror.error_budget(model, tolerances, torque=ARM, count=512, index_count=0, loaded_count=16)
    assert found.at_load is not None
    (one,) = found.at_load.verified.limits
    assert one.limit.label == "transmission error at 98.1 N*m arm"
    with pytest.raises(rverror.InputError, match="at each angle under one torque"):
        limit("lost_motion", "60 arcsec", torque=ARM)
    with pytest.raises(rverror.InputError, match="at a speed the load is one for all angles"):
        rverror.error_budget(model, tolerances, torque=ARM, input_speed="60 rpm")


def thinned(width: str = "6 um", **more: Any) -> tuple[rverror.Model, list[rverror.tolerances.Tolerance], float, float]:
    """One tolerance whose lost motion is that of the perfect unit and thinning / (r1 R): and these two, rad."""
    unit = rverror.reducer("RV-40E", **FEW_PINS)
    tolerance = rverror.tolerance("involute.tooth_thinning", width, mean="20 um", member="sun", **more)
    perfect = float(
        rverror.lost_motion(rverror.Model(unit), 2 * np.pi * np.arange(angles.POSITIONS) / angles.POSITIONS).max()
    )
    return rverror.Model(unit), [tolerance], perfect, 1 / (unit.sun_teeth * unit.module / 2 * unit.ratio)


@pytest.mark.usefixtures("few_angles")
def test_yield_is_that_of_a_normal_lost_motion() -> None:
    model, tolerances, perfect, each = thinned()
    sigma = 2e-3  # T is three of them
    for share in (0.5, 0.9, 0.99):
        z = {0.5: 0.0, 0.9: 1.2815515655, 0.99: 2.3263478740}[share]
        asked = Limit("lost_motion", perfect + each * (20e-3 + z * sigma))
        units = loaded_units(model, tolerances, [asked])
        (one,) = verified(units, units.stack.width, count=1000, seed=3, confidence=0.999).limits
        assert one.interval[0] <= share <= one.interval[1]
        assert one.quantile(share).low <= asked.value <= one.quantile(share).high


@pytest.mark.usefixtures("few_angles")
def test_least_cost_brings_a_normal_lost_motion_to_its_limit() -> None:
    """The width that fresh units verify lies between those with 99 % and 99.95 % of good units."""
    cost = rverror.tolerances.cost.Reciprocal(10.0, 0.006)
    model, tolerances, perfect, each = thinned("12 um", cost=cost)
    asked = Limit("lost_motion", perfect + each * 26e-3)
    found = allocate_at_load(model, tolerances, [asked], sample=256, verify=1500, seed=5)
    assert found.verified is not None
    assert found.verified.limits[0].met
    widest, narrow = (3 * 6e-3 / z for z in (2.3263, 3.2905))
    assert narrow < found.widths[0] < widest
    assert found.held_by == ("limit",)
    assert found.cost == pytest.approx(10.0 * 0.006 / found.widths[0])
    assert found.closed_form.value == pytest.approx(0.0, abs=1e-9)  # a lost motion is no transmission error


@pytest.mark.usefixtures("few_angles")
def test_what_makes_no_wave_in_closed_form_begins_at_its_given_width(monkeypatch: pytest.MonkeyPatch) -> None:
    """There a wider one costs nothing: the closed form would begin at the upper bound, whatever it does at the load."""
    cost = rverror.tolerances.cost.Reciprocal(10.0, 0.005)
    tolerances = [
        rverror.tolerance("crank.eccentricity", "5 um", cost=cost, bounds=("1 um", "50 um")),
        rverror.tolerance("coupling.carrier_bore_position", "5 um", cost=cost, bounds=("1 um", "50 um")),
    ]
    tried: list[np.ndarray] = []

    asked = [limit("transmission_error", "60 arcsec", torque="50 N*m")]
    found = LoadedUnits.solved

    def recorded(units: LoadedUnits, drawn: np.ndarray, widths: np.ndarray, **more: Any) -> Any:
        tried.append(widths)
        if len(tried) == 3:  # the unit without spread and the widths as given are solved before
            raise InterruptedError
        return found(units, drawn, widths, **more)

    monkeypatch.setattr(LoadedUnits, "solved", recorded)
    with pytest.raises(InterruptedError):
        allocate_at_load(rverror.Model(UNIT), tolerances, asked, sample=64, verify=500)
    _, given, first = tried
    assert first[1] == given[1] == 5e-3
    assert first[0] > 1.1 * given[0]  # which the closed form chose


@pytest.mark.usefixtures("few_angles")
def test_grades_beside_smooth_costs_meet_two_limits() -> None:
    """Of the grades the one with which all costs least, the smooth width as wide as the limit then leaves it."""
    smooth, table = (
        rverror.tolerances.cost.Reciprocal(10.0, 0.006),
        rverror.tolerances.cost.Grades((0.002, 0.006, 0.010), (30.0, 12.0, 9.0), ("fine", "medium", "coarse")),
    )
    model, tolerances, perfect, each = thinned("12 um", cost=smooth)
    other = rverror.tolerance("involute.tooth_thinning", "6 um", mean="20 um", member="planet", cost=table)
    asked = [Limit("lost_motion", perfect + each * 50e-3), Limit("lost_motion", 1.0, 412e3)]
    found = allocate_at_load(model, [*tolerances, other], asked, sample=256, verify=1500, seed=2)
    assert found.verified is not None
    assert found.verified.together_interval[0] >= 0.99
    z = 2.8  # about where half of the bad units are aimed at
    costs = []
    for grade, price in zip(table.widths, table.prices, strict=True):
        room = (10e-3 / z) ** 2 - (grade / 3) ** 2
        costs.append(price + 10.0 * 0.006 / (3 * math.sqrt(room)) if room > 0 else math.inf)
    assert found.widths[1] == table.widths[int(np.argmin(costs))]
    assert found.cost == pytest.approx(min(costs), rel=0.1)


@pytest.mark.usefixtures("few_angles")
def test_limits_that_no_width_meets_say_what_holds_them_up() -> None:
    model, tolerances, perfect, each = thinned("6 um", cost=rverror.tolerances.cost.Reciprocal(1.0, 0.006))
    low = Limit("lost_motion", perfect + each * 10e-3)  # the mean is 20
    with pytest.raises(rverror.InputError, match=r"lost motion at 12.36 N\*m .*without any spread .* change the means"):
        allocate_at_load(model, tolerances, [low], sample=64, verify=600)
    narrow = Limit("lost_motion", perfect + each * 20.3e-3)
    with pytest.raises(rverror.InputError, match=r"raise the limit or allow finer widths, first of involute\.tooth"):
        allocate_at_load(model, tolerances, [narrow], sample=64, verify=600)


@pytest.mark.usefixtures("few_angles")
def test_a_limit_that_is_met_by_too_little_to_be_verified_is_not_called_out_of_reach() -> None:
    """With the least width 99.5 % of the units are good: it can be, though few units do not verify 99 %."""
    cost = rverror.tolerances.cost.Reciprocal(1.0, 0.006)
    model, tolerances, perfect, each = thinned("6 um", cost=cost, bounds=("6 um", "12 um"))
    sigma = 2e-3  # T is three of them
    asked = Limit("lost_motion", perfect + each * (20e-3 + 2.58 * sigma))
    with pytest.raises(
        rverror.InputError, match=r"the yield of fresh units is 9\d\.\d+ %, not verified .* give 2400 units"
    ):
        allocate_at_load(model, tolerances, [asked], sample=256, verify=600)
    beyond = Limit("lost_motion", perfect + each * (20e-3 + 1.8 * sigma))
    with pytest.raises(rverror.InputError, match=r"99 % of the units use 1[0-9]{2}.* % of this limit; raise the limit"):
        allocate_at_load(model, tolerances, [beyond], sample=256, verify=600)


def test_a_few_units_verify_nothing() -> None:
    model, tolerances, perfect, _ = thinned("6 um", cost=rverror.tolerances.cost.Reciprocal(1.0, 0.006))
    with pytest.raises(rverror.InputError, match=r"verify = 100: too few units .* give 4[0-9][0-9] or more"):
        allocate_at_load(model, tolerances, [Limit("lost_motion", 2 * perfect)], verify=100)


@pytest.mark.parametrize(
    ("said", "problem"),
    [
        (lambda: limit("noise", "3 arcsec"), "quantity = 'noise': must be one of 'transmission_error'"),
        (lambda: limit("lost_motion", "3 N*m"), "lost_motion"),
        (lambda: limit("lost_motion", "0 arcsec"), "must be above 0"),
        (lambda: limit("backlash", "1 arcmin", torque="3 N*m"), "backlash: is read without a torque"),
        (lambda: limit("stiffness", "3 N*m/arcmin", torque="-3 N*m"), "torque = -3 N"),
        (lambda: loaded_units(rverror.Model(rverror.reducer("RV-40E")), [], []), "there is none"),
    ],
)
def test_limits_that_cannot_be_are_refused(said: Any, problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        said()


def test_a_stiffness_and_its_turn_are_each_others_inverse() -> None:
    one = limit("stiffness", "100 N*m/arcmin", torque="412 N*m")
    assert one.turned(one.turned(one.value)) == pytest.approx(one.value)
    assert one.allowed / ARCSEC == pytest.approx(412 * 60 / 100)  # half of the torque, in both senses
    assert one.shown(one.value) == pytest.approx(100.0)


@pytest.mark.usefixtures("few_angles")
def test_quantiles_of_a_sample_change_as_their_slopes_tell() -> None:
    """At the widths of the sample and beside them; a calibrated one has so many times the spread about no spread."""
    model, tolerances = mixed()
    units = loaded_units(model, tolerances, EVERY_LIMIT[:3])
    widths, still = units.stack.width, np.array([0.1, 0.2, 0.3])
    solved = units.solved(standard_draws(units.stack, 32, seed=1, stream=0), widths, slopes=True)
    plain = SampleQuantile.of(units, solved, widths, still, 0.99)
    ratios = np.array([1.5, 0.8, 1.1])
    scaled = replace(plain, ratios=ratios)
    np.testing.assert_allclose(scaled.parts(widths)[0] - still, ratios * (plain.parts(widths)[0] - still))
    for entry in range(len(widths)):
        step = np.where(np.arange(len(widths)) == entry, 1e-6 * widths, 0.0)
        rise = scaled.parts(widths + step)[0] - scaled.parts(widths - step)[0]
        np.testing.assert_allclose(rise / (2 * step[entry]), scaled.parts(widths)[1][:, entry], rtol=1e-4, atol=1e-6)


@pytest.mark.usefixtures("few_angles")
def test_what_a_sample_foretells_too_low_is_mended_by_fresh_units() -> None:
    """One cam, whose peak-to-peak has Rayleigh's distribution: the normal one through a sample ends too early.

    Its P99.8 is 3.53 sigma, drawn through the middle and the tail of a sample 3.2.  With this seed six verifications
    fail where what the first one tells is left out.
    """
    cost = rverror.tolerances.cost.Reciprocal(10.0, 0.005)
    cam = rverror.tolerance("crank.eccentricity", "5 um", crank=0, disc=0, cost=cost)
    model = rverror.Model(UNIT)
    asked = [limit("transmission_error", "20 arcsec", torque="50 N*m")]
    found = allocate_at_load(model, [cam], asked, sample=128, verify=1500, seed=3)
    assert found.verified is not None
    assert found.verified.stream > 1  # the first verification failed
    assert found.verified.limits[0].met
    units = loaded_units(model, [cam], asked)
    drawn = standard_draws(units.stack, 64, seed=9, stream=0)
    size = units.solved(drawn, np.array(found.widths)).turns[:, 0] / np.hypot(*drawn.T)  # per standard draw, nearly one
    sigma = math.sqrt(cam.distribution.variance) * float(size.mean()) / asked[0].allowed
    assert 3.03 < 1 / sigma < 4.03  # from 99 to 99.97 %
