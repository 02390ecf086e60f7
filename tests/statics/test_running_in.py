"""Running in, joints that loosen, duties of several phases, and what a measured course tells of them."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import pytest

import rverror
from pages import DOCS, text
from rverror import ARCSEC, Model
from rverror.statics import DutyPhase, RunningIn, Wear, WearCoefficients, fit_running_in, wear

UNIT = rverror.reducer("RV-40E")
NEW = Model(UNIT)
TORQUE, SPEED, HOURS = 412e3, 190.0, 100.0
TURNED = HOURS * 3600 * SPEED / UNIT.ratio  # rad of the output
BEARS = {"disc_width": 9.0, "gear_width": 8.0}
SLIGHT = 1e-20  # mm^2/N: nothing that a contact would notice
CARRIES = (0.6, 1.8)  # roll angles at which a flank carries well


def worn(
    by: dict[str, float] | None = None, rough: dict[str, RunningIn] | None = None, hours: Any = HOURS, **more: Any
) -> Wear:
    given = {"torque": TORQUE, "input_speed": SPEED, "direction": 1.0} | BEARS | more
    lasting = WearCoefficients(**(by or {"disc": SLIGHT}))
    return wear(NEW, hours=hours, coefficients=lasting, running_in=rough, **given)


def test_a_roughness_without_end_is_a_larger_coefficient() -> None:
    """But for the ripple that sixteen waves leave about 0 where nothing carries, which is no wear."""
    deep = RunningIn(depth=1e6, coefficient=1e-13)
    bodies = ("disc", "pin", "sun", "planet")
    rough = worn(dict.fromkeys(bodies, 1e-13), dict.fromkeys(bodies, deep))
    plain = worn(dict.fromkeys(bodies, 2e-13))
    np.testing.assert_allclose(rough.lobe_depth, plain.lobe_depth, atol=2e-3 * plain.lobe_depth.max())
    np.testing.assert_allclose(rough.pin_depth, plain.pin_depth, atol=1e-5 * plain.pin_depth.max())
    np.testing.assert_allclose(rough.lost_motion, plain.lost_motion, rtol=1e-4)
    for member in ("sun", "planet"):
        np.testing.assert_allclose(rough.thinning[member], plain.thinning[member], rtol=1e-6)


def test_roughness_by_hand() -> None:
    """Each place loses d (1 - exp(-k0 x / d)), x its pressure times sliding; sixteen waves leave some of its edge."""
    x = worn({"disc": SLIGHT}).lobe_depth[-1] / SLIGHT
    thin = 1e-7  # mm
    found = worn(rough={"disc": RunningIn(depth=thin, coefficient=2 * thin / x.max())})
    expected = thin * (1 - np.exp(-2 * x / x.max()))
    np.testing.assert_allclose(found.lobe_depth[-1], expected, atol=0.03 * thin)


def test_a_surface_that_is_run_in_has_lost_its_roughness_and_the_output_its_play() -> None:
    """A uniform gap costs 2 F d / (a z_c); the notch that is left where lobes have no arm takes some of it."""
    depth = 1e-3
    found = worn(rough={"disc": RunningIn(depth=depth, coefficient=1e-10)}, direction=None, hours=[1000, 2000])
    flank = (found.roll_angle > CARRIES[0]) & (found.roll_angle < CARRIES[1])
    np.testing.assert_allclose(found.lobe_depth[1:, flank], depth, rtol=0.03)
    lost = found.lost_motion - found.lost_motion[0]
    gap = 2 * 117 / 121 * depth / (UNIT.eccentricity * UNIT.disc_lobes)
    assert lost[-1] == pytest.approx(gap, rel=0.1)
    assert lost[2] - lost[1] < 0.03 * lost[1]
    assert np.ptp(found.peak_to_peak) < 0.01 * lost[-1]  # the error stays flat


def test_steps_are_short_enough_however_fast_it_runs_in() -> None:
    rough = dict.fromkeys(("disc", "pin"), RunningIn(depth=3e-3, coefficient=1e-10))
    once, often = (worn({"disc": 1e-13}, rough, hours=hours) for hours in ([0, 600], [0, *np.geomspace(0.1, 600, 12)]))
    assert once.lost_motion[-1] == pytest.approx(often.lost_motion[-1], rel=0.01)


@pytest.mark.parametrize(("direction", "flanks"), [(1.0, 1), (None, 2)])
def test_roughness_of_teeth_in_closed_form(direction: float | None, flanks: int) -> None:
    """The force on flanks is given by the torque, so their course is d (1 - exp(-t / t0)) on each that carries."""
    depth, hours = 1e-3, np.array([0.0, 50, 100, 200, 1e6])
    plain = worn({"sun": SLIGHT}, direction=direction).thinning["sun"][-1] / SLIGHT / HOURS  # per hour and coefficient
    most = flanks * depth / math.cos(UNIT.pressure_angle)
    rough = {"sun": RunningIn(depth=depth, coefficient=most / plain / 100)}
    found = worn({"planet": SLIGHT}, rough, hours=hours, direction=direction)
    np.testing.assert_allclose(found.thinning["sun"], most * (1 - np.exp(-hours / 100)), rtol=1e-6)
    more = (found.lost_motion - found.lost_motion[0])[-1]
    assert more == pytest.approx(most / (UNIT.sun_pitch_radius * UNIT.ratio), rel=1e-4)


def test_splines_in_closed_form() -> None:
    """Torque of a planet over the spline's radius, a turn of it against the carrier each 1/40 of the output's."""
    found = worn({"spline": 1e-14})
    force = TORQUE * 3 / (121 * UNIT.cranks * UNIT.spline_radius)
    clearance = 1e-14 * force * 40 * TURNED / (2 * math.pi)
    assert found.clearance["spline"][-1] == pytest.approx(clearance, rel=1e-4)
    more = found.lost_motion[-1] - found.lost_motion[0]
    assert more == pytest.approx(3 / 121 * clearance / UNIT.spline_radius, rel=1e-3)


def test_bearings_loosen_by_their_load_and_their_turns() -> None:
    theta = 2 * np.pi / 40 * np.arange(61) / 61
    state = rverror.equilibrium(NEW, theta, torque=TORQUE, direction=1.0)
    for joint, contact in (("cam_bearing", "cam"), ("carrier_bearing", "carrier")):
        found = worn({joint: SLIGHT})
        force = np.hypot(*np.moveaxis(state.contact_forces[contact], -2, 0)).mean()
        assert found.clearance[joint][-1] == pytest.approx(SLIGHT * force * 40 * TURNED / (2 * np.pi), rel=1e-3)
    # the carrier's bores take all of the output's torque on the crank circle
    assert force > TORQUE / (UNIT.cranks * UNIT.crank_radius)
    loose = worn({"carrier_bearing": 1e-15})
    more = loose.lost_motion[-1] - loose.lost_motion[0]
    assert more == pytest.approx(2 * loose.clearance["carrier_bearing"][-1] / UNIT.crank_radius, rel=0.01)


def test_a_duty_of_one_phase_is_the_simple_case_and_equal_phases_are_one() -> None:
    simple = worn({"disc": 1e-12, "pin": 1e-12})
    for hours in ([7.0], [1.0, 1.0]):
        duty = [DutyPhase(torque=TORQUE, speed=SPEED, hours=h) for h in hours]
        found = worn({"disc": 1e-12, "pin": 1e-12}, torque=None, input_speed=None, duty=duty)
        np.testing.assert_allclose(found.sizes, simple.sizes, rtol=1e-9, atol=1e-15)
        np.testing.assert_allclose(found.lost_motion, simple.lost_motion, rtol=1e-9)


def test_phases_share_the_hours_in_any_order() -> None:
    """Little wear is the sum of what each phase takes in its share of the hours; standing takes hours alone."""
    heavy, light = (DutyPhase(torque=t, speed=s, hours=h) for t, s, h in ((TORQUE, SPEED, 1), (TORQUE / 4, 300.0, 2)))
    rest = DutyPhase(torque=2 * TORQUE, speed=0, hours=1)  # held, and heavier than all that turns
    found, turned = (
        worn({"disc": SLIGHT}, torque=None, input_speed=None, duty=duty)
        for duty in ([heavy, light, rest], [rest, light, heavy])
    )
    np.testing.assert_allclose(found.lobe_depth, turned.lobe_depth, rtol=1e-9, atol=1e-9 * found.lobe_depth.max())
    assert found.peak_to_peak[0] == pytest.approx(worn().peak_to_peak[0])
    one, other = worn(hours=25.0).lobe_depth[-1], worn(hours=50.0, torque=TORQUE / 4, input_speed=300.0).lobe_depth[-1]
    np.testing.assert_allclose(found.lobe_depth[-1], one + other, rtol=1e-9, atol=1e-9 * one.max())


def test_phases_one_after_the_other_are_a_cycle_to_first_order() -> None:
    """A short cycle against its phases in a row, either order: what they differ by is of second order in the depth."""
    by = {"disc": 3e-13}
    phases = [DutyPhase(torque=TORQUE, speed=SPEED), DutyPhase(torque=TORQUE / 2, speed=2 * SPEED)]
    cycle = worn(by, torque=None, input_speed=None, duty=phases)

    def in_a_row(first: DutyPhase, second: DutyPhase) -> Wear:
        half = worn(by, torque=first.torque, input_speed=first.speed, hours=HOURS / 2)
        return wear(
            half.model_at(HOURS / 2),
            torque=second.torque,
            input_speed=second.speed,
            hours=HOURS / 2,
            coefficients=WearCoefficients(**by),
            direction=1.0,
            **BEARS,
        )

    rows = [in_a_row(*phases).lost_motion[-1], in_a_row(*phases[::-1]).lost_motion[-1]]
    grown = cycle.lost_motion[-1] - cycle.lost_motion[0]
    np.testing.assert_allclose(np.array(rows) - cycle.lost_motion[0], grown, rtol=0.02)


def test_a_fit_finds_what_a_course_was_made_with() -> None:
    hours = [0, 20, 60, 200, 600]
    by, rough = {"disc": 2e-13}, {"disc": RunningIn(depth=0.8e-3, coefficient=1e-11)}
    course = worn(by, rough, hours=hours).lost_motion
    found = fit_running_in(
        NEW,
        hours,
        course,
        coefficients=WearCoefficients(disc=1e-13),
        running_in={"disc": RunningIn(depth=0.5e-3, coefficient=2e-11)},
        torque=TORQUE,
        input_speed=SPEED,
        direction=1.0,
        **BEARS,
    )
    assert found.coefficients.disc == pytest.approx(2e-13, rel=0.02)
    assert found.running_in["disc"].depth == pytest.approx(0.8e-3, rel=0.01)
    assert found.running_in["disc"].coefficient == pytest.approx(1e-11, rel=0.02)
    assert np.abs(found.residual).max() < 0.02 * ARCSEC


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: worn(duty=DutyPhase(torque=1e3, speed=1.0)), "give torque and input_speed, or a duty"),
        (
            lambda: worn(torque=None, input_speed=None, duty=DutyPhase(torque=1e3, speed=0)),
            "no phase both carries and turns; give",
        ),
        (lambda: worn(torque=None), "give torque and input_speed, or a duty"),
        (lambda: worn(torque=None, input_speed=None, duty=[3]), "give one or several DutyPhase"),
        (lambda: worn(rough={"pni": RunningIn(depth=1e-3, coefficient=1e-11)}), "no body 'pni'; give one of disc"),
        (lambda: worn(rough=RunningIn(depth=1e-3, coefficient=1e-11)), "running_in = .*give a mapping"),  # type: ignore[arg-type]
        (lambda: RunningIn(depth=0, coefficient=1e-11), "depth = 0 mm: must be above 0"),
        (lambda: WearCoefficients(spline="-1 um/kN"), "spline = -1 um/kN: must be 0 or more"),
        (lambda: fitted(hours=[0, 10], free=["depth", "lasting"]), "give both from 0 h on, and 2 or more"),
        (lambda: fitted(hours=[5, 10], free=["depth"]), "give both from 0 h on"),
        (lambda: fitted(hours=[0, 10], free=["late"]), "free = .*give some of depth, running_in, lasting"),
    ],
)
def test_what_is_refused(call: Any, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        call()


def fitted(hours: list[float], free: list[str]) -> Any:
    course = np.zeros(len(hours))
    return fit_running_in(
        NEW, hours, course, coefficients=WearCoefficients(disc=1e-13), running_in={}, free=free, torque=TORQUE
    )


def test_the_course_of_the_life_test_is_what_the_page_says() -> None:
    """Two printed numbers are fitted; the others of the printed line are foretold within 10 %."""
    (table,) = re.findall(r"\| hours \| printed.*?\n\| ---.*?\n(.*?)\n\n", text(DOCS / "theory" / "wear.md"), re.DOTALL)
    rows = [[cell.strip() for cell in row.strip("|").split("|")] for row in table.splitlines()]
    hours, told = (np.array([float(row[at]) for row in rows]) for at in (0, 2))
    printed = {float(row[0]): float(row[1]) for row in rows if row[1] != "-"}
    duty = {"torque": TORQUE, "input_speed": "1815 rpm", **BEARS}
    fitted = fit_running_in(
        NEW,
        [0, 600, 1550],
        np.array([0, printed[600], printed[1550]]) * ARCSEC,
        coefficients=WearCoefficients(**dict.fromkeys(("disc", "pin", "sun", "planet"), 1e-13)),
        running_in=dict.fromkeys(("disc", "pin"), RunningIn(depth=0.5e-3, coefficient=1e-11)),
        free=["depth", "lasting"],
        **duty,
    )
    assert fitted.running_in["pin"].depth == pytest.approx(0.54e-3, abs=0.006e-3)
    assert fitted.coefficients.sun == pytest.approx(0.7e-13, abs=0.01e-13)
    course = wear(NEW, hours=hours, coefficients=fitted.coefficients, running_in=fitted.running_in, **duty)
    growth = (course.lost_motion[1:] - course.lost_motion[0]) / ARCSEC
    np.testing.assert_allclose(growth, told, atol=0.02)
    for at, size in zip(hours, growth, strict=True):
        assert size == pytest.approx(printed.get(at, size), rel=0.1)
    late = (printed[1550] - printed[600]) / 950
    assert late == pytest.approx(0.0024, abs=1e-5)
    assert printed[1075] == pytest.approx(printed[600] + 0.0024 * 475, abs=0.005)
    assert np.ptp(course.peak_to_peak) < 0.05 * ARCSEC
