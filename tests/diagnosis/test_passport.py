"""The passport of orders: laws that were put in come out, intervals hold the truth, nothing unknown is told."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.stats import f

from recordings import recording
from rverror import InputError
from rverror.base.units import ARCSEC
from rverror.diagnosis.order_passport import OrderPassport, passport
from rverror.diagnosis.wave_fit import WavePart, both_ways, disc_factor, fit_waves
from rverror.runs import load_orders
from rverror.runs.order_table import OrderCase, TableCondition

TORQUES = tuple(np.linspace(0.0, 1.8e6, 10))
Law = Callable[[float, float, float, float], complex]


def table(
    law: Law,
    *,
    order: float = 39.0,
    directions: Sequence[float] = (1.0, -1.0),
    torques: Sequence[float] = TORQUES,
    speeds: Sequence[float] = (10.0,),
    temperatures: Sequence[float] = (298.0,),
    noise: float = 0.0,
    sigma: float | None = None,
    seed: int = 0,
) -> list[OrderCase]:
    """Cases of one order, every combination, of a law of direction, torque, speed and temperature."""
    rng = np.random.default_rng(seed)
    return [
        OrderCase(
            condition=TableCondition(direction=d, torque=q, input_speed=v, temperature=t),
            orders=np.array([order]),
            waves=np.array([law(d, q, v, t) + noise * complex(*rng.normal(size=2))]),
            sigma=None if sigma is None else np.array([sigma]),
        )
        for d, v, t, q in itertools.product(directions, speeds, temperatures, torques)
    ]


def one(cases: Sequence[OrderCase], **options: float) -> OrderPassport:
    (found,) = passport(cases, **options)
    return found


@pytest.mark.parametrize("freedom", [2.0, 7.0, 40.0])
def test_a_disc_holds_two_squares_over_their_noise(freedom: float) -> None:
    """By chance: 95 % of the ratios of a pair's size to an independent estimate of its deviation."""
    rng = np.random.default_rng(int(freedom))
    draws = 40_000
    size = np.hypot(*rng.normal(size=(2, draws)))
    estimate = np.sqrt(rng.chisquare(freedom, draws) / freedom)
    within = float(np.mean(size <= disc_factor(freedom) * estimate))
    assert abs(within - 0.95) < 4 * math.sqrt(0.95 * 0.05 / draws)


@pytest.mark.parametrize("stated", [False, True])
@pytest.mark.parametrize("count", [3, 12])
def test_intervals_cover_what_was_put_in(count: int, stated: bool) -> None:
    """Thousands of orders, each a draw; sizes from nothing to ten times the noise."""
    draws, noise = 1500, 1e-6
    rng = np.random.default_rng([count, stated])

    def complexes(*shape: int) -> np.ndarray:
        return rng.normal(size=shape) + 1j * rng.normal(size=shape)

    scale = 5e-6 * rng.uniform(0.0, 1.0, size=draws)
    constant, slope = complexes(2, draws) * scale, complexes(2, draws) * scale * 1e-6
    cases, power = [], np.zeros(draws)
    for at, torque in itertools.product((0, 1), np.linspace(0.0, 1e6, count)):
        true = constant[at] + slope[at] * torque
        power += np.abs(true) ** 2
        cases.append(
            OrderCase(
                condition=TableCondition(direction=1.0 - 2.0 * at, torque=float(torque)),
                orders=np.arange(1.0, draws + 1),
                waves=true + noise * complexes(draws),
                sigma=np.full(draws, noise) if stated else None,
            )
        )
    held = np.zeros(5)
    for found in passport(cases):
        place = int(found.order) - 1
        for at, law in enumerate(found.laws):
            c, s = constant[at, place], slope[at, place]
            assert law.slope is not None
            held += [
                abs(law.constant.value - c) <= law.constant.radius,
                abs(law.slope.value - s) <= law.slope.radius,
                law.constant.low <= abs(c) <= law.constant.high,
                law.slope.low <= abs(s) <= law.slope.high,
                (found.low <= math.sqrt(power[place] / (2 * count)) <= found.high),
            ]
    share = held / (2 * draws)
    # four deviations of a binomial; a given noise is widened where the misfit is larger by chance, never narrowed
    chance = 4 * math.sqrt(0.95 * 0.05 / (2 * draws))
    assert (share[:2] >= 0.95 - chance).all()
    assert (share[:2] <= (0.985 if stated else 0.95 + chance)).all()
    # an amplitude's interval is a shadow of its disc, so it covers more often, not less
    assert (share[2:4] >= share[:2]).all()
    assert share[4] >= 0.95 - math.sqrt(2) * chance


@given(
    constant=st.tuples(*[st.floats(-50, 50)] * 4),
    slope=st.tuples(*[st.floats(-50, 50)] * 4),
    grows=st.tuples(*[st.floats(-1, 1)] * 4),
)
@settings(max_examples=40, deadline=None)
def test_a_straight_law_comes_back(
    constant: tuple[float, ...], slope: tuple[float, ...], grows: tuple[float, ...]
) -> None:
    c = {1.0: complex(*constant[:2]) * ARCSEC, -1.0: complex(*constant[2:]) * ARCSEC}
    s = {1.0: complex(*slope[:2]) * ARCSEC / 1e6, -1.0: complex(*slope[2:]) * ARCSEC / 1e6}
    warm, fast = complex(*grows[:2]) * ARCSEC, complex(*grows[2:]) * ARCSEC

    def law(d: float, q: float, v: float, t: float) -> complex:
        return c[d] + s[d] * q + warm * (t - 298.0) + fast * (v - 10.0)

    found = one(table(law, speeds=(10.0, 20.0), temperatures=(298.0, 318.0), torques=TORQUES[::3]))
    # the reference is the first of settings that stand equally often
    assert (found.reference_speed, found.reference_temperature) == (10.0, 298.0)
    near = pytest.approx
    for way in found.laws:
        assert way.slope is not None
        assert way.speed is not None
        assert way.temperature is not None
        assert abs(way.constant.value - c[way.direction]) == near(0, abs=1e-7 * ARCSEC)
        assert abs(way.slope.value - s[way.direction]) * 1e6 == near(0, abs=1e-7 * ARCSEC)
        assert abs(way.speed.value - fast) == near(0, abs=1e-7 * ARCSEC)
        assert abs(way.temperature.value - warm) == near(0, abs=1e-7 * ARCSEC)
    assert not found.bent
    assert sum(share or 0.0 for share in found.shares.values()) == near(1.0) or found.amplitude == 0.0


@given(angle=st.floats(0, 2 * math.pi))
@settings(max_examples=20, deadline=None)
def test_a_turn_of_the_zero_changes_no_size(angle: float) -> None:
    cases = table(lambda d, q, v, t: (3 + 1j * d) * 1e-6 + 4e-12 * d * q, noise=2e-7, seed=3)
    turned = [
        OrderCase(condition=case.condition, orders=case.orders, waves=case.waves * np.exp(1j * angle)) for case in cases
    ]
    before, after = one(cases), one(turned)
    assert (after.low, after.high) == pytest.approx((before.low, before.high))
    for was, law in zip(before.laws, after.laws, strict=True):
        assert law.constant.radius == pytest.approx(was.constant.radius)
        assert law.constant.amplitude == pytest.approx(was.constant.amplitude)
    assert after.kinds == before.kinds


def test_orders_that_are_nearly_one_are_one_and_the_strongest_comes_first() -> None:
    cases = table(lambda *_: 1e-6, order=40.0) + table(lambda *_: 5e-6, order=78.0)
    cases += table(lambda *_: 5e-6, order=78.0 + 5e-7, torques=(2e6,))
    found = passport(cases)
    assert [round(one.order, 3) for one in found] == [78.0, 40.0]
    assert found[0].laws[0].cases == len(TORQUES) + 1


def test_a_wave_of_nothing_but_noise_is_not_told() -> None:
    """Zero is outside a disc in one of twenty; of two hundred orders, both directions, constant and slope."""
    told = 0
    for seed in range(100):
        found = one(table(lambda *_: 0.0, noise=1e-6, seed=seed))
        told += sum(law.constant.significant + law.slope.significant for law in found.laws if law.slope is not None)
    assert told <= 400 * 0.05 + 4 * math.sqrt(400 * 0.05 * 0.95)


def test_below_three_torques_only_constants_are_told() -> None:
    found = one(table(lambda d, q, v, t: 1e-6 + 1e-12 * q, torques=(0.0, 1e6)))
    assert all(law.slope is None for law in found.laws)
    assert found.laws[0].not_determined == ("load is not determined: there are two torques only",)
    assert found.loads is None
    assert found.shares["load"] is None
    # torques that a bench cannot hold apart are one
    held = one(table(lambda *_: 1e-6, torques=(9.96e5, 1e6, 1.001e6)))
    assert held.laws[0].not_determined == ("load is not determined: all cases are at one torque",)


def test_one_case_tells_an_amplitude_and_no_interval() -> None:
    found = one(table(lambda *_: 3e-6, directions=(1.0,), torques=(0.0,)))
    assert (found.amplitude, found.low, found.high) == (pytest.approx(3e-6), 0.0, math.inf)
    assert not found.laws[0].constant.significant
    with_noise = one(table(lambda *_: 3e-6, directions=(1.0,), torques=(0.0,), sigma=1e-7))
    assert with_noise.laws[0].constant.low == pytest.approx(3e-6 - math.sqrt(-2 * math.log(0.05)) * 1e-7)


def test_temperature_that_goes_with_the_load_is_not_told() -> None:
    cases = [
        OrderCase(
            condition=TableCondition(direction=1.0, torque=torque, temperature=298.0 + torque / 1e5),
            orders=np.array([39.0]),
            waves=np.array([1e-6 + 2e-12 * torque]),
        )
        for torque in TORQUES
    ]
    (law,) = one(cases).laws
    assert law.temperature is None
    assert law.not_determined == ("temperature is not determined: it goes with the torque, whose part may be its own",)
    assert law.not_determined[0] in one(cases).kinds


def test_constants_at_other_conditions_are_not_compared() -> None:
    forward = table(lambda *_: 1e-6, directions=(1.0,), sigma=1e-8)
    both = one(forward + table(lambda *_: 1e-6, directions=(-1.0,), sigma=1e-8))
    assert both.constants is not None
    assert both.constants.relation == "alike"
    other = table(lambda *_: 1e-6, directions=(-1.0,), temperatures=(318.0,), sigma=1e-8)
    found = one(forward + other)
    assert found.constants is None


@pytest.mark.parametrize(
    ("reverse", "relation"),
    [(1.0, "alike"), (-1.0, "opposite"), (1j, "mirrored"), (0.3, "different"), (0.0, "different")],
)
def test_load_parts_of_both_directions(reverse: complex, relation: str) -> None:
    slope = 3e-12 * (1 + 0.5j)
    found = one(
        table(lambda d, q, v, t: 1e-6 + slope * q * (1.0 if d > 0 else reverse), noise=5e-8, seed=1), ratio=81.0
    )
    assert found.loads is not None
    assert found.loads.relation == relation
    assert found.constants is not None
    assert found.constants.relation == "alike"
    assert any("grows with the load" in kind for kind in found.kinds)
    assert any("constant over the load and alike" in kind for kind in found.kinds)
    # one compliance for both senses of the torque has the opposite sign: it is not named of what is alike
    assert any("stiffness that varies over the angle" in kind for kind in found.kinds) == (relation != "alike")


def test_noise_leaves_a_relation_open() -> None:
    faint = WavePart(value=1e-7, deviation=1e-7, radius=3e-7, freedom=20.0)
    assert both_ways(faint, faint).relation is None


def test_light_loads_that_bend_are_flagged_and_inside_the_intervals() -> None:
    """The line of the heavy loads is the truth; one light load lies off it, then several."""
    constant, slope = 2e-6 + 1e-6j, 3e-12 - 1e-12j
    for reach in (3e4, 1e5, 1.8e5, 3e5):
        cases = table(
            lambda d, q, v, t, reach=reach: constant + slope * q + 2e-6j * math.exp(-q / reach),
            torques=np.linspace(0.0, 1.8e6, 19),
            noise=5e-8,
            seed=7,
        )
        found = one(cases)
        assert found.bent
        for law in found.laws:
            assert law.slope is not None
            assert law.bent
            assert abs(law.constant.value - constant) <= law.constant.radius
            assert abs(law.slope.value - slope) <= law.slope.radius


def by_hand(design: np.ndarray, waves: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Parts by numpy's own least squares, and the radii of their discs at 95 % by Fisher's quantile."""
    value, squares = np.linalg.lstsq(design, waves, rcond=None)[:2]
    freedom = 2 * (design.shape[0] - design.shape[1])
    variance = float(squares[0].real) / freedom * np.diag(np.linalg.inv(design.T @ design))
    return value, np.sqrt(2 * f.ppf(0.95, 2, freedom) * variance)


def test_discs_reach_farther_by_what_a_bend_moves() -> None:
    rng = np.random.default_rng(8)
    load = np.linspace(0.0, 1.8, 12)
    design = np.stack([np.ones(12), load], axis=1)
    waves = 1.0 + 2j * load + 0.01 * (rng.normal(size=12) + 1j * rng.normal(size=12))
    plain = fit_waves(design, waves)
    assert [part.radius for part in plain.parts] == pytest.approx(by_hand(design, waves)[1])
    assert not plain.bent

    bend = np.exp(-load / 0.5)
    curved = waves + 0.3 * bend
    value, radius = by_hand(design, curved)
    moved = np.abs(value - by_hand(np.column_stack([design, bend]), curved)[0][:2])
    found = fit_waves(design, curved, bend=bend)
    assert found.bent
    assert [part.radius for part in found.parts] == pytest.approx(radius + moved)


def test_straight_laws_are_seldom_called_bent() -> None:
    """A bend, and a misfit beyond sigma: each once in a hundred."""
    draws = 400
    bent = sum(
        one(table(lambda d, q, v, t: 1e-6 + 1e-12 * q, directions=(1.0,), noise=1e-7, sigma=1e-7, seed=seed)).bent
        for seed in range(draws)
    )
    assert bent <= draws * 0.02 + 4 * math.sqrt(draws * 0.02 * 0.98)


def test_a_sigma_too_small_is_seen_and_widened() -> None:
    cases = table(lambda d, q, v, t: 1e-6 + 1e-12 * q, noise=3e-7, sigma=1e-7, seed=2)
    with_sigma, without = (
        one(cases),
        one([OrderCase(condition=c.condition, orders=c.orders, waves=c.waves) for c in cases]),
    )
    assert with_sigma.bent
    for law, plain in zip(with_sigma.laws, without.laws, strict=True):
        assert law.constant.radius == pytest.approx(plain.constant.radius)


def resonance(speed: float, *, at: float, damping: float = 0.03) -> complex:
    return 1.0 / complex(1.0 - (speed / at) ** 2, 2.0 * damping * speed / at)


SPEEDS = tuple(np.arange(10.0, 190.0, 10.0))


def test_a_resonance_leaves_the_law_at_the_reference_alone() -> None:
    """A straight law over the speed does not hold: constant and slope are those of the speed of most cases."""
    constant, slope = 1e-6 + 1e-6j, 2e-12

    def law(d: float, q: float, v: float, t: float) -> complex:
        return (constant + slope * q) * resonance(v, at=113.0) / resonance(10.0, at=113.0)

    cases = table(law, directions=(1.0,), noise=3e-8, seed=5)
    cases += table(law, directions=(1.0,), torques=(2e5, 1e6, 1.6e6), speeds=SPEEDS[1:], noise=3e-8, seed=6)
    (found,) = one(cases).laws
    assert found.slope is not None
    assert found.torque.size == len(TORQUES)
    assert abs(found.constant.value - constant) <= found.constant.radius < 2e-7
    assert abs(found.slope.value - slope) <= found.slope.radius < 2e-13


def test_a_slope_that_changes_with_the_temperature_does_not_shift_the_one_at_the_reference() -> None:
    """A mean of both slopes would lie two deviations off the one at 298 K, and no test of the misfit sees it surely."""
    missed, draws, noise = 0, 150, 1e-6
    slope = 8e-12
    for seed in range(draws):
        cases = table(
            lambda d, q, v, t: 3e-6 + slope * q * (1 + 0.2 * (t - 298.0) / 20.0),
            directions=(1.0,),
            temperatures=(298.0, 318.0),
            noise=noise,
            seed=seed,
        )
        (law,) = one(cases).laws
        assert law.slope is not None
        missed += abs(law.slope.value - slope) > law.slope.radius
    assert missed <= draws * 0.05 + 4 * math.sqrt(draws * 0.05 * 0.95)


def test_order_one_is_said_of_the_measuring_chain_and_nothing_for_certain() -> None:
    first = one(table(lambda *_: 3e-4, order=1.0, noise=1e-6), ratio=81.0)
    assert any("measuring chain (how the output's" in kind for kind in first.kinds)
    third = one(table(lambda *_: 3e-4, order=3.0, noise=1e-6), ratio=81.0)
    assert not any("measuring chain" in kind for kind in third.kinds)
    shaft = table(lambda *_: 3e-4, order=162.0, noise=1e-6)
    assert any("measuring chain (how the input's" in kind for kind in one(shaft, ratio=81.0).kinds)
    assert not any("measuring chain" in kind for kind in one(shaft).kinds)
    for kind in (*first.kinds, *third.kinds):
        assert "can be" in kind


def test_constants_that_change_with_the_direction() -> None:
    found = one(table(lambda d, *_: 1e-6 * d, noise=1e-8))
    assert any("drive and coast side" in kind for kind in found.kinds)
    assert not any("and alike" in kind for kind in found.kinds)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"torque": -5.0}, "torque = -5"),
        ({"direction": 0.5}, "direction = 0.5"),
        ({"input_speed": math.nan}, "not finite"),
    ],
)
def test_conditions_that_cannot_be_used(changes: dict[str, float], says: str) -> None:
    condition = TableCondition(**({"direction": 1.0} | changes))
    with pytest.raises(InputError, match=says):
        passport([OrderCase(condition=condition, orders=np.array([1.0]), waves=np.array([1e-6 + 0j]))])


def test_no_cases_are_refused() -> None:
    with pytest.raises(InputError, match="no cases"):
        passport([])


def test_cases_without_conditions_give_constants() -> None:
    cases = [
        OrderCase(condition=TableCondition(direction=1.0), orders=np.array([39.0]), waves=np.array([1e-6 + size * 1j]))
        for size in (1e-8, -1e-8, 2e-8)
    ]
    found = one(cases)
    assert found.laws[0].not_determined == ("load is not determined: no case holds a torque",)
    assert found.laws[0].constant.significant


def test_weights_follow_sigma() -> None:
    """Two waves of unlike noise: their weighted mean, by hand."""
    fit = fit_waves(np.ones((2, 1)), np.array([1.0 + 0j, 2.0]), sigma=np.array([1.0, 2.0]))
    assert fit.parts[0].value == pytest.approx((1.0 + 2.0 / 4) / (1 + 1 / 4))
    assert fit.parts[0].deviation == pytest.approx(1 / math.sqrt(1 + 1 / 4))


@pytest.mark.parametrize("name", ["loads-100rpm-25degC.csv", "loads-100rpm-30degC.csv"])
def test_discs_of_two_halves_of_a_measured_table_meet(name: str) -> None:
    """Constants and slopes from every second load: discs of both halves, as of independent noise, meet in 19 of 20."""
    table = load_orders(recording("rv-81to1", name))
    loads = sorted({case.condition.torque for case in table.cases if case.condition.torque is not None})
    halves = [
        {found.order: found for found in passport([c for c in table.cases if c.condition.torque in kept])}
        for kept in (loads[::2], loads[1::2])
    ]
    met = [
        abs(a.value - b.value) <= math.hypot(a.radius, b.radius)
        for order, found in halves[0].items()
        for one, other in zip(found.laws, halves[1][order].laws, strict=True)
        for a, b in ((one.constant, other.constant), (one.slope, other.slope))
        if a is not None and b is not None
    ]
    assert len(met) == 36  # nine orders, two directions
    assert sum(met) >= 30  # binomial: 0.2 % of fair discs do worse
