"""Lines of any order in what a fit leaves: their order and size, and how often noise is taken for one."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import rverror
from gear_runs import TURN, UNIT, begin, red
from rverror.base.arrays import Array
from rverror.base.units import ARCSEC
from rverror.diagnosis.gears.fit import Fit, evaluated, with_estimated_noise
from rverror.diagnosis.gears.spectrum import best_lines, explained, leading, line_at
from rverror.diagnosis.policy import POLICY

MODEL = rverror.Model(UNIT)
N = 1024


def left(wave: Array | float, seed: int = 0, *, turns: float = 1.0, runs: int = 1, memory: float = 0.7) -> Fit:
    """A fit of which a wave in noise is left; closed form, so that nothing is solved."""
    theta = TURN / N * np.arange(round(N * turns))
    made = [
        rverror.run_from_arrays(
            input_angle=UNIT.ratio * theta,
            output_angle=theta + wave + red(100 * seed + i, theta.size, 0.3, memory),
            direction="forward",
        )
        for i in range(runs)
    ]
    return begin(MODEL, made)


@pytest.mark.parametrize("order", [56.5, 23.37, 11.3, 5.27])
@pytest.mark.parametrize("turns", [1.0, 3.0])
def test_a_line_of_no_part_is_found_with_its_order(order: float, turns: float) -> None:
    """1.5 arcsec in 0.3 of noise: the order to 0.05 over one turn, to a third of it over three."""
    theta = TURN / N * np.arange(round(N * turns))
    fit = left(1.5 * ARCSEC * np.cos(order * theta + 0.4), turns=turns)
    (line,) = best_lines(fit, POLICY, outside=True)
    assert line.order == pytest.approx(order, abs=0.05 / turns)
    assert abs(line.waves[0]) == pytest.approx(1.5 * ARCSEC, rel=0.1)
    assert np.angle(line.waves[0]) == pytest.approx(0.4, abs=0.2)


def test_readings_that_wander_have_no_slow_line_and_a_slow_sine_is_one() -> None:
    """Two runs of three turns, readings that walk by 0.01 arcsec a sample: half of such pairs had a slow line."""
    theta = TURN / 2048 * np.arange(3 * 2048)

    def slow_lines(seed: int, wave: Array | float) -> list[bool]:
        made = []
        for i in range(2):
            walk = np.cumsum(np.random.default_rng([900 + seed, i]).normal(0, 0.01 * ARCSEC, theta.size))
            angle = theta + walk + red(100 * seed + i, theta.size, 0.5, 0.3) + wave
            made.append(
                rverror.run_from_arrays(input_angle=UNIT.ratio * theta, output_angle=angle, direction="forward")
            )
        fit = begin(MODEL, made)
        found = [best_lines(one, POLICY, outside=False) for one in (fit, with_estimated_noise(fit, calm=True))]
        return [any(line.order < 1 for line in lines) for lines in found]

    assert not any(any(slow_lines(seed, 0.0)) for seed in range(6))
    assert all(slow_lines(0, 2 * ARCSEC * np.cos(0.6 * theta)))


def test_lines_come_the_most_significant_first_and_no_lobe_of_theirs() -> None:
    theta = TURN / N * np.arange(3 * N)
    wave = ARCSEC * (np.cos(11.3 * theta) + 2 * np.cos(23.37 * theta) + 1.5 * np.cos(91.7 * theta))
    found = best_lines(left(wave, turns=3), POLICY, outside=True, most=5)
    assert [line.order for line in found] == pytest.approx([91.7, 23.37, 11.3], abs=0.02)


def test_a_part_s_order_is_no_line_of_the_outside() -> None:
    """Order 16 is the cranks'; asked for all orders it is a line too."""
    theta = TURN / N * np.arange(N)
    fit = left(2 * ARCSEC * np.cos(16 * theta))
    assert best_lines(fit, POLICY, outside=True) == []
    (line,) = best_lines(fit, POLICY, outside=False)
    assert line.order == pytest.approx(16, abs=0.05)


def test_what_is_free_already_is_not_found_again() -> None:
    theta = TURN / N * np.arange(3 * N)
    fit = left(2 * ARCSEC * np.cos(23.37 * theta), turns=3)
    records = [replace(r, orders=(23.37,)) for r in fit.run_set.records]
    freed = with_estimated_noise(replace(fit, run_set=fit.run_set.with_records(records)))
    assert best_lines(freed, POLICY, outside=False) == []


@pytest.mark.parametrize("memory", [0.0, 0.7, 0.95])
def test_noise_is_seldom_taken_for_a_line(memory: float) -> None:
    """One in a thousand runs by the policy: two in sixty have a chance of 2e-3."""
    wrong = sum(bool(best_lines(left(0.0, s, memory=memory), POLICY, outside=False)) for s in range(60))
    assert wrong <= 1


def test_runs_in_which_a_line_stands_alike_tell_it_together() -> None:
    """Of four runs the power is the sum, at any phase."""
    theta = TURN / N * np.arange(N)
    wave = 0.4 * ARCSEC * np.cos(23.37 * theta)
    alone, four = left(wave, runs=1), left(wave, runs=4)
    power = [line_at(f.run_set.records, f.residual, 23.37).power for f in (alone, four)]
    assert power[1] / power[0] == pytest.approx(4, rel=0.5)


def test_power_is_what_a_line_takes_off_the_squares() -> None:
    theta = TURN / N * np.arange(N)
    fit = left(ARCSEC * np.cos(30 * theta))
    (record,), (rest,) = fit.run_set.records, fit.residual
    rows = np.stack([np.cos(30 * theta), np.sin(30 * theta)])
    power, (sizes,) = explained([record], [rest], [rows])
    before, after = (float(np.sum(record.whiten(r[None]) ** 2)) for r in (rest, rest - sizes @ rows))
    assert power == pytest.approx(before - after)
    assert power == pytest.approx(line_at([record], [rest], 30.0).power)
    assert math.hypot(*sizes) == pytest.approx(ARCSEC, rel=0.1)


def test_no_line_is_smaller_than_the_equilibrium_is_right_to() -> None:
    theta = TURN / N * np.arange(N)
    run = rverror.run_from_arrays(
        input_angle=UNIT.ratio * theta,
        output_angle=theta + 0.02 * ARCSEC * np.cos(23.37 * theta) + red(0, N, 1e-3),
        direction="forward",
    )
    assert best_lines(begin(MODEL, [run]), POLICY, outside=False) == []
    assert best_lines(begin(MODEL, [run]), replace(POLICY, model_error=0.005 * ARCSEC), outside=False)


@pytest.mark.parametrize(("share", "reported"), [(0.02, False), (-0.02, False), (0.04, True), (-0.04, True)])
def test_a_line_of_the_gears_within_some_percent_of_the_prediction_is_the_model_s_own_error(
    share: float, reported: bool
) -> None:
    """A cam is larger or smaller than declared; three percent are beyond what its model claims.

    Each is seen in the noise, and what is as large at an order of no part is a line, also beside the cam's.
    """
    theta = TURN / N * np.arange(N)
    declared = rverror.Model(UNIT, (rverror.effect("crank.eccentricity", crank=0, disc=0, radial="30 um"),))
    predicted = rverror.transmission_error(declared, theta, direction=1.0)
    size = 2 * abs(np.mean(predicted * np.exp(-16j * theta)))
    beside, far = (share * size * np.cos(order * theta) for order in (17.4, 23.37))
    for wave, orders in (
        (share * predicted, [16] * reported),
        (beside, [17.4]),
        (share * predicted + far, [16] * reported + [23.37]),
    ):
        run = rverror.run_from_arrays(
            input_angle=UNIT.ratio * theta,
            output_angle=theta + predicted + wave + red(5, N, 0.01 * size / ARCSEC, 0.0),
            direction="forward",
        )
        found = best_lines(begin(declared, [run]), POLICY, outside=False, most=3)
        assert sorted(line.order for line in found) == pytest.approx(orders, abs=0.1)


@pytest.mark.parametrize(("share", "reported"), [(0.02, False), (0.045, True)])
def test_nor_is_a_line_of_the_gears_within_some_percent_of_what_was_added(share: float, reported: bool) -> None:
    """A large cam is bent by what is not of first order, which shows at twice its order."""
    theta = TURN / N * np.arange(N)
    cam = rverror.Model(UNIT, (rverror.effect("crank.eccentricity", crank=0, disc=0, radial="30 um"),))
    predicted = rverror.transmission_error(cam, theta, direction=1.0)
    size = float(np.std(predicted))
    for order, orders in ((32, [32] * reported), (23.37, [23.37])):
        run = rverror.run_from_arrays(
            input_angle=UNIT.ratio * theta,
            output_angle=theta
            + predicted
            + share * size * np.cos(order * theta)
            + red(5, N, 2e-3 * size / ARCSEC, 0.0),
            direction="forward",
        )
        fit = evaluated(begin(cam, [run]).run_set, cam, MODEL)
        assert fit.added
        found = best_lines(fit, POLICY, outside=False, most=3)
        assert [line.order for line in found] == pytest.approx(orders, abs=0.1)


def test_orders_of_a_wave_are_its_strongest_in_order() -> None:
    sizes = np.array([0.0, 5.0, 3.2, 10.0, 2.9, 4.0, 3.1])
    assert leading(np.arange(7.0), sizes, 10.0) == (3.0, 1.0, 5.0, 2.0)
