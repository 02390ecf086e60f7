"""What repeats in a run: nothing in noise, every order above it, and no more than that over a part of a turn."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import rverror
from gear_runs import UNIT, red
from rverror.compensation.over_conditions import law_of
from rverror.runs.order_table import TableCondition

ARCSEC = np.pi / 648000
TURN = 2 * np.pi
DRIVE = rverror.Model(rverror.Drive(ratio=20.0, shafts={"motor": 20.0}))


def run_of(
    orders: dict[float, complex],
    seed: int,
    *,
    turns: float = 3.0,
    points: int = 256,
    noise: float = 1.0,
    drift: float = 0,
) -> rverror.Run:
    theta = TURN * np.arange(round(points * turns)) / points
    error = sum(abs(z) * np.cos(k * theta + np.angle(z)) for k, z in orders.items()) * ARCSEC + np.zeros(theta.size)
    error = error + red(seed, theta.size, noise, 0.7) + drift * ARCSEC * theta / TURN
    return rverror.run_from_arrays(input_angle=20 * theta, te=error, direction="forward")


def test_noise_alone_is_not_compensated() -> None:
    """1 % of runs may; of 60 more than 3 are that in one of 3000 trials."""
    made = [rverror.compensate(DRIVE, [run_of({}, seed, turns=3 if seed % 2 else 2)]) for seed in range(60)]
    assert sum(one.worth for one in made) <= 3
    nothing = next(one for one in made if not one.worth)
    assert nothing.correction.orders.size == 0
    assert nothing.after == nothing.before
    assert "stands out of the noise" in " ".join(nothing.stays)


@pytest.mark.parametrize("turns", [1.0, 2.0, 3.0, 4.5])
def test_orders_above_the_noise_are_found_with_their_size(turns: float) -> None:
    waves = {1.0: 4 - 3j, 20.0: 2.0, 33.0: 1j}
    made = rverror.compensate(DRIVE, [run_of(waves, 5, turns=turns, noise=0.3)])
    assert {one.order for one in made.orders} >= set(waves)
    assert len(made.orders) <= len(waves) + 1
    case = made.correction.table.cases[0]
    for k, z in waves.items():
        # 1-sigma of a wave's real part is noise * sqrt(2/n), times 2 for the colour; 5 of them
        allowed = 10 * 0.3 * math.sqrt(2 / (256 * turns))
        assert abs(case.waves[case.orders == k][0] / ARCSEC + z) < allowed


def test_a_drift_is_no_order_and_hides_none() -> None:
    """Over two turns a slope looks 61 % like order 1 of one turn: neither is taken for the other."""
    steady = rverror.compensate(DRIVE, [run_of({}, 3, turns=2, noise=0.3, drift=8.0)])
    assert not steady.worth
    made = rverror.compensate(DRIVE, [run_of({1.0: 2.0}, 3, turns=2, noise=0.3, drift=8.0)])
    assert made.orders[0].order == 1.0
    assert made.orders[0].amplitude / ARCSEC == pytest.approx(2.0, abs=0.3)
    assert all(one.amplitude / ARCSEC < 0.2 for one in made.orders[1:])


def test_over_a_part_of_a_turn_shafts_alone_are_compensated() -> None:
    made = rverror.compensate(DRIVE, [run_of({1.0: 40.0, 20.0: 2.0}, 7, turns=0.4, points=2048, noise=0.3)])
    assert [one.order for one in made.orders] == [20.0]
    assert made.correction.reach is not None
    assert made.correction.reach[1] == pytest.approx(0.4 * TURN, rel=0.01)


def test_travel_passed_again_and_again_is_compensated_slow_things_too() -> None:
    """A slope of 6 % over 40 degrees, there and back: what plain tables take off, and a wave of the motor."""
    there = np.linspace(0, 0.7, 300)
    theta = np.concatenate([np.concatenate([there, there[::-1]]) for _ in range(6)])
    error = 60 * ARCSEC * theta + 3 * ARCSEC * np.sin(20 * theta) + red(2, theta.size, 0.3)
    run = rverror.run_from_arrays(input_angle=20 * theta, te=error)
    made = rverror.compensate(DRIVE, [run])
    assert made.before.rms > 10 * ARCSEC
    assert made.after.rms < 0.4 * ARCSEC


def test_noise_alone_over_travel_that_is_passed_again_and_again_is_not_compensated() -> None:
    """1 % of runs may; of 60 more than 3 are that in one of 3000 trials."""
    there = np.linspace(0, 0.7, 100)
    theta = np.concatenate([np.concatenate([there, there[::-1]]) for _ in range(6)])
    runs = [rverror.run_from_arrays(input_angle=20 * theta, te=red(seed, theta.size, 1.0, 0.7)) for seed in range(60)]
    assert sum(rverror.compensate(DRIVE, [run]).worth for run in runs) <= 3


def test_orders_onto_which_the_mesh_folds_are_left_out() -> None:
    """At 256 samples a turn the gear mesh of the small unit folds; a table made of that would err between samples."""
    mesh = 27 * 16.0
    image = rverror.geartrain.folded_order(mesh, 256)
    theta = TURN * np.arange(768) / 256
    error = 5 * ARCSEC * np.cos(mesh * theta) + red(1, 768)
    run = rverror.run_from_arrays(input_angle=UNIT.ratio * theta, te=error, direction="forward")
    made = rverror.compensate(rverror.Model(UNIT), [run])
    assert image not in [one.order for one in made.orders]
    assert any("fold onto them" in line for line in made.stays)


def test_the_interval_covers_a_turn_to_come() -> None:
    """Units that change more from turn to turn than any fit knows: each turn has a share of its own of a wave.

    Of 60 intervals of 95 % each less than 51 cover in one of 3000 trials.
    """
    inside = 0
    for seed in range(60):
        chance = np.random.default_rng(seed)
        turns, points = 5, 128
        theta = TURN * np.arange(turns * points) / points
        turn = np.arange(theta.size) // points
        own = chance.normal(size=turns)[turn] * 0.6 * np.cos(12 * theta + chance.uniform(0, 6))
        error = (5 * np.cos(20 * theta) + own) * ARCSEC + red(seed, theta.size, 0.5)
        last = turn == turns - 1
        run = rverror.run_from_arrays(input_angle=20 * theta, te=error, direction="forward")
        fit = replace(run, **{n: getattr(run, n)[~last] for n in ("input_angle", "te_column", "direction")})
        made = rverror.compensate(DRIVE, [fit])
        rest = error[last] + made.correction.at(theta[last], TableCondition(direction=1.0))
        inside += made.after.low <= np.std(rest) <= made.after.high
    assert inside >= 51


# --- over conditions --------------------------------------------------------------------------------------------------


def conditions(count: int = 12) -> list[TableCondition]:
    return [TableCondition(direction=1.0, torque=1e5 * n) for n in range(count)]


def noise(seed: int, count: int) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(count, 2)) @ [1, 1j]


def test_a_law_has_the_terms_that_predict() -> None:
    at = conditions()
    load = np.arange(12) / 11
    for terms, wave in (
        (set(), 0 * load),
        ({(0, 0, 0)}, 30 + 0 * load),
        ({(0, 0, 0), (1, 0, 0)}, 30 - 60j * load),
        ({(2, 0, 0)}, 90j * load**2),
    ):
        law = law_of(wave + noise(4, 12), at, 0.001)
        assert set(law.terms) == terms
        if terms:
            assert abs(law(at[6]) - wave[6]) < 2
            assert law(TableCondition(direction=1.0, torque=1e9)) == pytest.approx(law(at[-1]))
            assert law(TableCondition(direction=1.0)) == pytest.approx(law(at[0]))


def test_noise_has_no_law() -> None:
    found = [law_of(noise(seed, 10), conditions(10), 0.01).terms for seed in range(200)]
    assert sum(map(bool, found)) <= 8


def test_speed_and_temperature_count_where_they_vary() -> None:
    at = [TableCondition(direction=1.0, torque=1e5 * a, input_speed=10.0 * b) for a in range(1, 5) for b in range(1, 5)]
    wave = np.array([40 * c.torque / 4e5 + 25j * c.input_speed / 40 for c in at])
    law = law_of(wave + noise(1, 16), at, 0.001)
    assert set(law.terms) == {(1, 0, 0), (0, 1, 0)}
    assert law.text in ("torque + speed", "speed + torque")


def test_what_is_calculated_has_no_orders_below_a_thousandth_of_an_arcsec() -> None:
    """Without noise hundreds of orders stand out; none that no table needs is taken."""
    model = rverror.Model(UNIT, (rverror.effect("cycloid.pin_position", pin=3, radial="6 um"),))
    runs = rverror.runs.simulate_runs(model, torques=[50e3], method="equilibrium", points=1024, revolutions=2)
    made = rverror.compensate(rverror.Model(UNIT), runs)
    assert made.after.rms < 0.02 * ARCSEC
    assert made.after.rms < 0.01 * made.before.rms
    assert min(one.amplitude for one in made.orders) > 0.001 * ARCSEC


def test_of_one_turn_it_is_said_that_nothing_shows_the_next() -> None:
    made = rverror.compensate(DRIVE, [run_of({20.0: 5.0}, 1, turns=1, points=2048)])
    assert any("nothing shows the next one to be alike" in note for note in made.notes)
    assert made.before.rms / ARCSEC == pytest.approx(math.hypot(5 / math.sqrt(2), 1.0), rel=0.05)
    assert made.after.rms / ARCSEC == pytest.approx(1.0, rel=0.1)
