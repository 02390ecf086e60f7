"""The rules by which tables are diagnosed, one by one: noise, thresholds of a claim, what laws may do, intervals."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

import rverror
from gear_runs import OTHER, UNIT
from order_tables import CAM, HEAD, LOADS, empty, table_of, waves_of, with_wave
from rverror.base.chance import student
from rverror.base.units import ARCSEC
from rverror.diagnosis.gears.fit import Fit, evaluated
from rverror.diagnosis.journal import Journal
from rverror.diagnosis.orders.order_search import chance, described
from rverror.diagnosis.orders.table_set import noise_of_cases, table_set
from rverror.diagnosis.orders.tables import diagnose_tables, laws_of, widened
from rverror.diagnosis.policy import POLICY, Policy
from rverror.diagnosis.result import Addition, Diagnosis
from rverror.model.effects import Effect, Model
from rverror.runs.order_table import OrderTable

TORSION = "load.torsion_wave"
Wave = Callable[[float, float], complex]


def quiet(_: str) -> None:
    """Nobody listens."""


def told(table: OrderTable, *keys: str, model: Model | None = None, **policy: object) -> Diagnosis:
    """Claims alone, no set that accounts for everything; stiffness as declared, a few sources suspected."""
    rules = replace(POLICY, keys=keys, refit_stiffness=False, near_claims=0.0, **policy)  # type: ignore[arg-type]
    return diagnose_tables(model or Model(UNIT), [table], quiet, policy=rules)


def claims(found: Diagnosis) -> list[str]:
    return [one.effect.key for one in found.added if not one.effect.key.startswith("empirical.")]


def laws(found: Diagnosis) -> dict[tuple[str, int], Addition]:
    return {
        (one.effect.key, int(one.effect.indices["harmonic"])): one
        for one in found.added
        if one.effect.key.startswith("empirical.")
    }


def fit_of(table: OrderTable, model: Model, policy: Policy = POLICY) -> Fit:
    """State of a table under the noise that it states, its sizes as the model has them."""
    sigmas, _ = noise_of_cases(table.cases, floor=0.0)
    run_set = table_set(UNIT, table.cases, sigmas, policy=replace(policy, regular=1e12), anywhere=False)
    return evaluated(run_set, model, Model(UNIT))


# --- noise ------------------------------------------------------------------------------------------------------------


def unstated(wave: Wave, loads: tuple[float, ...]) -> OrderTable:
    table = with_wave(empty([7, 16], loads, sigma=1.0), 7, wave)
    return replace(table, cases=tuple(replace(case, sigma=None) for case in table.cases))


def test_a_parabola_over_the_load_is_no_noise() -> None:
    table = unstated(lambda d, t: 3 + d * 1j * t / 100 + (2 - 1j) * (t / 100) ** 2, (10, 60, 90, 200, 310, 400))
    (sigma, *_), _ = noise_of_cases(table.cases, floor=0.0)
    assert sigma == pytest.approx(np.zeros(4), abs=1e-12 * ARCSEC)


def test_what_a_parabola_leaves_of_a_cubic_counts_once_for_each_value_to_spare() -> None:
    """Of (t/h)^3 at five even loads the third orthogonal polynomial (-1, 2, 0, -2, 1) is left, 12/10 of it.

    Its squares make 14.4 in each direction, for complex waves of size c 14.4 c^2; 2 (5 - 3) numbers are to spare in
    each, so sigma^2 = 2 14.4 c^2 / 8 = 3.6 c^2.
    """
    table = unstated(lambda d, t: (0.3 + 0.4j) * ((t - 300) / 100) ** 3 * d, (100, 200, 300, 400, 500))
    (sigma, *_), _ = noise_of_cases(table.cases, floor=0.0)
    assert sigma == pytest.approx(np.array([0.5 * math.sqrt(3.6), 0.0] * 2) * ARCSEC, abs=1e-9 * ARCSEC)


# --- thresholds of a claim --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("share", "least"), [(0.25, 0.3), (0.35, 0.3), (0.45, 0.5), (0.55, 0.5), (0.65, 0.7), (0.75, 0.7)]
)
def test_a_claim_takes_its_share_of_what_is_left(share: float, least: float) -> None:
    """Waves a + b forward and a - b in reverse: the encoder makes a, which has |a|^2/(|a|^2 + |b|^2) of the power."""
    table = with_wave(
        empty([1, 2], (50, 150, 250), sigma=0.05),
        1,
        lambda d, _: 20 * (math.sqrt(share) + 1j * d * math.sqrt(1 - share)),
    )
    found = told(table, HEAD.key, claim_takes=least)
    assert claims(found) == ([HEAD.key] if share > least else [])
    if claims(found):
        assert any(f"removes {100 * share:.0f} % of what is left of order 1" in note for note in found.added[0].notes)


def test_a_claim_takes_its_share_of_what_is_measured() -> None:
    """A second cam beside a declared one makes all that is left of order 16, and a small part of what is measured."""
    second = rverror.effect("crank.eccentricity", crank=0, disc=1, radial="-1 um", tangential="2 um")
    declared = Model(UNIT, (CAM,))
    table = table_of(Model(UNIT, (CAM, second)), loads=(50e3, 150e3, 250e3), noise=0.02)
    at = np.array([16.0])
    power = [
        (abs(both) ** 2, abs(both - one) ** 2)
        for d in (1.0, -1.0)
        for t in (50e3, 150e3, 250e3)
        for both, one in [(waves_of(m, d, t, at)[0] for m in (Model(UNIT, (CAM, second)), declared))]
    ]
    share = sum(rest for _, rest in power) / sum(whole for whole, _ in power)
    assert 0.01 < share < 0.09
    for counts, expected in ((0.7 * share, 1), (1.4 * share, 0), (POLICY.claim_counts, 0)):
        assert len(claims(told(table, CAM.key, model=declared, claim_counts=counts))) == expected


# --- what a load-proportional cause must answer for -------------------------------------------------------------------


def torsion_table(wave: Wave, loads: tuple[float, ...] = (20, 60, 120, 200, 300)) -> OrderTable:
    return with_wave(empty([1, 3, 16], loads, sigma=0.05), 3, wave)


def test_constants_of_each_direction_are_no_reason_against_what_grows_with_the_load() -> None:
    """Constants of 20 arcsec, of another phase in each direction, beside a flange of 10 arcsec at 1000 N m.

    Of all that is measured it takes a hundredth, of what changes with the load all.
    """
    wave: Wave = lambda d, t: (20 if d > 0 else -6 + 15j) + 10j * d * t / 1000  # noqa: E731
    found = told(torsion_table(wave), TORSION, claim_counts=1e-3)
    assert claims(found) == [TORSION]
    assert claims(told(torsion_table(lambda d, t: 10j * d * t / 1000), TORSION)) == [TORSION]


def test_constants_of_opposite_sign_are_no_compliance() -> None:
    """One that lags by T C takes (sum T)^2/(5 sum T^2) = 0.66 of what is 5 arcsec forward and -5 in reverse."""
    loads = np.array([20, 60, 120, 200, 300])
    assert loads.sum() ** 2 / (5 * (loads**2).sum()) == pytest.approx(0.66, abs=0.005)
    found = told(torsion_table(lambda d, _: 5 * d), TORSION)
    assert claims(found) == []
    assert ("empirical.order_by_direction", 3) in laws(found)


def test_one_load_that_is_astray_makes_no_claim() -> None:
    """Of three loads the largest: a slope takes 0.84 of what changes with the load, and foretells the others worse."""
    loads = np.array([50.0, 150.0, 300.0])
    about = loads - loads.mean()
    assert (about[2] ** 2 / (about @ about)) / (2 / 3) == pytest.approx(0.84, abs=0.005)
    found = told(torsion_table(lambda d, t: 4 * d * (t > 200), (50, 150, 300)), TORSION)
    assert claims(found) == []
    (fate,) = [one for one in found.history if one.key == TORSION and one.indices == {"harmonic": 3}][:1]
    assert (fate.fate, fate.why) == ("fell", "loads that its sizes did not see are predicted worse with it")
    assert claims(told(torsion_table(lambda d, t: 4 * d * t / 300, (50, 150, 300)), TORSION)) == [TORSION]


@pytest.mark.parametrize(
    ("loads", "directions", "values"),
    [((50, 150, 250), (1.0, -1.0), 8), ((50, 150, 250), (1.0,), 4), ((50,), (1.0, -1.0), 4), ((50,), (1.0,), 2)],
)
def test_the_chance_has_as_many_values_as_the_conditions_tell(
    loads: tuple[float, ...], directions: tuple[float, ...], values: int
) -> None:
    """Of M values two sizes take the share x or more by (1 - x)^((M - 2)/2): where M is 2 they always do."""
    table = with_wave(
        empty([1, 2], loads, sigma=0.05, directions=directions), 1, lambda d, t: 20 + 8j * d + 6 * (t - 150) / 100
    )
    model = Model(UNIT, (Effect(HEAD.key, {}, (20 * ARCSEC, 0.0)),))
    order, share, odds = chance(fit_of(table, model), 0)
    assert order == 1.0
    assert odds == pytest.approx((1 - share) ** ((values - 2) / 2))
    if len(loads) > 1 and len(directions) > 1:
        assert 0.5 < share < 0.95


# --- what laws may do -------------------------------------------------------------------------------------------------


def test_laws_leave_the_sizes_of_causes_alone() -> None:
    """An encoder that is 1 arcsec short of what is measured keeps its size: a law describes the rest."""
    table = with_wave(empty([1, 2], (50, 150, 250), sigma=0.05), 1, lambda *_: 20 - 9j)
    short = Model(UNIT, (Effect(HEAD.key, {}, (19 * ARCSEC, 9 * ARCSEC)),))
    fit = fit_of(table, short)
    state = described(fit, laws_of(Model(UNIT), fit.run_set), Journal(quiet))  # type: ignore[arg-type]
    (law,) = state.effects()
    assert (law.key, law.indices["harmonic"]) == ("empirical.order", 1)
    assert law.values == pytest.approx((ARCSEC, 0.0), abs=1e-3 * ARCSEC)
    assert state.covariance.shape == (2, 2)
    # beside a free encoder the same law is left nothing to describe
    free = replace(state, held=False)
    assert free.left(free.best) == pytest.approx(np.zeros(24), abs=0.05)
    assert abs(free.sizes(0)[0]) < 0.9 * ARCSEC


def test_the_noise_of_an_order_is_widened_to_what_a_fit_leaves_of_it() -> None:
    """Waves of 3 arcsec where 0.05 are noise: their real and imaginary parts have the mean square 3^2/2."""
    table = with_wave(empty([1, 7], (50, 150, 250), sigma=0.05), 7, lambda d, t: 3 * np.exp(1j * (t + d)))
    for sigma in widened(fit_of(table, Model(UNIT))):
        assert sigma / ARCSEC == pytest.approx(np.array([0.05, 3 / math.sqrt(2)] * 2), rel=1e-9)


# --- sizes and intervals ----------------------------------------------------------------------------------------------


def test_peak_to_peak_of_two_waves() -> None:
    """a cos x + b cos 2x with b > a/4 reaches a + b at 0 and -b - a^2/(8 b) where cos x = -a/(4 b)."""
    table = empty([1, 2], (50, 150, 250), sigma=0.05)
    table = with_wave(
        with_wave(table, 1, lambda d, t: 20 * (t > 200) * (d > 0)), 2, lambda d, t: 10 * (t > 200) * (d > 0)
    )
    found = told(table, "sensor.output_tilt")
    assert found.before.peak_to_peak / ARCSEC == pytest.approx(20 + 10 + 10 + 400 / 80, rel=1e-5)
    assert found.before.rms / ARCSEC == pytest.approx(math.sqrt((400 + 100) / 2 / 6), rel=1e-9)


#: Over four even loads it is orthogonal to a constant, a slope and a parabola; its mean square is 1.
CUBIC = {50.0: 1 / math.sqrt(5), 100.0: -3 / math.sqrt(5), 150.0: 3 / math.sqrt(5), 200.0: -1 / math.sqrt(5)}
#: Of real and imaginary part, arcsec, with the model's own error.
SIGMA = math.hypot(0.05, POLICY.model_error / ARCSEC)


@pytest.fixture(scope="module")
def scattered() -> Diagnosis:
    """Constants of 2 arcsec in three orders, of which one scatters by five times its noise, one by that, one not."""
    table = empty([2, 3, 7], tuple(CUBIC), sigma=0.05)
    for order, times in ((2, 1.0), (3, 0.0), (7, 5.0)):
        table = with_wave(table, order, lambda _, t, times=times: 2 + times * SIGMA * CUBIC[t] * (1 + 1j))
    return told(table, "sensor.output_tilt")


def test_the_interval_of_a_law_is_as_wide_as_its_own_order_scatters(scattered: Diagnosis) -> None:
    """Student's of 16 numbers less 6 of the laws, times the deviation of a mean of eight."""
    found = laws(scattered)
    assert set(found) == {("empirical.order", harmonic) for harmonic in (2, 3, 7)}
    for harmonic, times in ((2, 1.0), (3, 1.0), (7, 5.0)):
        for estimate, value in zip(found["empirical.order", harmonic].estimates, (2.0, 0.0), strict=True):
            assert estimate.value / ARCSEC == pytest.approx(value, abs=1e-3)
            half = times * student(0.025, 10) * SIGMA / math.sqrt(8)
            assert (estimate.high - estimate.value) / ARCSEC == pytest.approx(half, rel=1e-3)
            assert (estimate.value - estimate.low) / ARCSEC == pytest.approx(half, rel=1e-3)


def test_the_interval_of_a_line_is_that_of_a_mean_over_the_conditions(scattered: Diagnosis) -> None:
    lines = {line.order: line for line in scattered.unexplained}
    assert set(lines) == {2.0, 3.0, 7.0}
    for order, times in ((2.0, 1.0), (3.0, 0.0), (7.0, 5.0)):
        line = lines[order]
        assert line.amplitude / ARCSEC == pytest.approx(math.sqrt(4 + 2 * (times * SIGMA) ** 2), rel=1e-6)
        half = student(0.025, 7) * SIGMA / math.sqrt(8)
        assert (line.high - line.amplitude) / ARCSEC == pytest.approx(half, rel=1e-6)
        assert (line.amplitude - line.low) / ARCSEC == pytest.approx(half, rel=1e-6)


def test_a_stiffness_that_makes_up_for_what_is_missing_is_said_to() -> None:
    """Those that moved by more of their uncertainty than the policy lets pass, with by how much."""
    modified = rverror.effect("cycloid.profile_modification", equidistant="20 um", shift="0 um")
    table = table_of(Model(OTHER, (modified, CAM)), loads=LOADS[::2], noise=0.005)
    rules = replace(POLICY, keys=(HEAD.key,), strained=float(chi2.sf(0.4**2, 1)))
    found = diagnose_tables(Model(UNIT, (modified, CAM)), [table], quiet, policy=rules)
    moved = {
        one.name: abs(math.log(one.value / one.declared)) / 0.25
        for one in found.elastic
        if one.dimension == "stiffness"
    }
    notes = [note for note in found.notes if "it makes up for what no cause explains" in note]
    expected = {name: by for name, by in moved.items() if by > 0.4}
    assert expected
    assert len(expected) < len(moved)
    assert len(notes) == len(expected)
    for name, by in expected.items():
        assert f"{name} moved by {by:.1f} of its uncertainty" in " ".join(notes)
    calm = diagnose_tables(
        Model(UNIT, (modified, CAM)), [table], quiet, policy=replace(rules, strained=POLICY.strained)
    )
    assert not any("moved by" in note for note in calm.notes)


def test_what_stands_at_no_load_is_no_reason_for_or_against_a_cause() -> None:
    """Of seven loads causes are looked for on five, and not on the unloaded one, where nothing holds the contacts.

    60 arcsec there would be 0.8 of the power of the encoder's order, of which it could then not take half.
    """
    loads = (0, 20, 60, 120, 200, 300, 400)
    table = with_wave(empty([1, 2], loads, sigma=0.05), 1, lambda _, t: 20 - 9j if t else 60j)
    found = told(table, HEAD.key)
    assert claims(found) == [HEAD.key]
    five = with_wave(empty([1, 2], (0, 20, 60, 120, 200), sigma=0.05), 1, lambda _, t: 20 - 9j if t else 60j)
    assert claims(told(five, HEAD.key)) == []  # of five loads none is left out
