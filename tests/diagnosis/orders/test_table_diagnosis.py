"""Order tables: what waves say of a cause, what chance says as well, and what only laws describe."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import beta

import rverror
from gear_runs import OTHER, TURN, UNIT
from order_tables import CAM, HEAD, LOADS, NOISE, ORDERS, table_of, with_wave
from recordings import recording
from rverror.app import diagnosis_commands
from rverror.app.command_line import main
from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.base.units import ARCSEC
from rverror.diagnosis.gears.fit import evaluated, fitted
from rverror.diagnosis.gears.grid import whole
from rverror.diagnosis.gears.score import Hypothesis
from rverror.diagnosis.gears.search import Search
from rverror.diagnosis.gears.waveform import LoadCase, Waveform
from rverror.diagnosis.orders import tables
from rverror.diagnosis.orders.order_search import Linear, blocks_of, chance
from rverror.diagnosis.orders.table_set import TableObservation, noise_of_cases, table_set
from rverror.diagnosis.policy import POLICY
from rverror.geartrain.kinematics import OperatingConditions
from rverror.model.catalogue import source
from rverror.model.effects import Effect, Model
from rverror.runs.order_table import OrderCase, TableCondition
from rverror.statics.prediction import predict

EXAMPLE = Path(__file__).parents[3] / "examples" / "rv-81" / "model.toml"


SEEN = LOADS[::2]
#: Where it is not asked which of all sources it is: some of the gears, of what is read, and of what gives way.
SOME = replace(
    POLICY,
    keys=(
        "crank.eccentricity", "cycloid.disc_bore_position", "cycloid.pin_circle", "involute.planet_pitch",
        "sensor.encoder_eccentricity", "sensor.encoder_ellipticity", "sensor.output_tilt",
        "load.torsion_wave", "load.input_torsion_wave",
    ),
)  # fmt: skip


@pytest.fixture(scope="module")
def found() -> rverror.Diagnosis:
    """Of a unit with other stiffness than is declared, that lacks a cam's error and an encoder's."""
    return rverror.diagnose(Model(UNIT), [table_of(Model(OTHER, (CAM, HEAD)), loads=SEEN)])


def test_missing_causes_are_named_and_their_sizes_held(found: rverror.Diagnosis) -> None:
    keys = {one.effect.key: one for one in found.added}
    assert found.verdict == "explained"
    assert set(keys) == {CAM.key, HEAD.key} or CAM.key in {k for one in found.added for k, _ in one.indistinguishable}
    for estimate, true in zip(keys[HEAD.key].estimates, HEAD.values, strict=True):
        assert estimate.low <= true <= estimate.high
        assert estimate.high - estimate.low < 2 * ARCSEC
    assert keys[HEAD.key].orders == (1.0,)
    assert found.after.heldout_rms < 1.5 * found.noise_rms
    assert found.noise_rms == pytest.approx(NOISE * ARCSEC * math.sqrt(ORDERS.size), rel=0.03)


def test_rivals_of_a_set_that_accounts_for_everything_fit_as_well(found: rverror.Diagnosis) -> None:
    """Nothing in the gear train makes order 1; half a turn on a cam of the other crank and disc is the same.

    A bore makes a cam's order too, but over the loads not the same waves.
    """
    rivals = {one.effect.key: {key for key, _ in one.indistinguishable} for one in found.added}
    assert set(rivals) == {HEAD.key, CAM.key}
    assert rivals[HEAD.key] == set()
    assert CAM.key in rivals[CAM.key]
    assert "cycloid.disc_bore_position" not in rivals[CAM.key]


def test_whole_sets_are_searched_from_the_claims_as_well_and_under_the_policy_of_runs(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What is not explained yet may have any size, as in runs; of orders, each has its own."""
    began: list[tuple[float, list[set[str]]]] = []

    class Watched(Search):
        def best(self, *also: Hypothesis, swap: bool = True) -> tuple[Hypothesis, bool]:
            began.append((self.root.fit.run_set.policy.regular, [{e.key for e in one.fit.added} for one in also]))
            return super().best(*also, swap=swap)

    monkeypatch.setattr(tables, "Search", Watched)
    table = table_of(Model(OTHER, (CAM, HEAD)), loads=SEEN)
    rverror.diagnose(Model(UNIT), [table], policy=replace(POLICY, keys=(CAM.key, HEAD.key)))
    assert began == [(POLICY.regular, [{CAM.key, HEAD.key}])]


def test_rivals_of_a_claim_make_as_much_of_its_order() -> None:
    """Order 7 is no part's, so that no set accounts for everything: the cam is a claim."""
    table = with_wave(table_of(Model(UNIT, (CAM, HEAD)), loads=SEEN, noise=0.3), 7, lambda d, t: 30.0)
    keys = ("crank.eccentricity", "cycloid.disc_bore_position", "sensor.encoder_eccentricity")
    told = rverror.diagnose(Model(UNIT), [table], policy=replace(POLICY, keys=keys))
    rivals = {one.effect.key: one.indistinguishable for one in told.added if source(one.effect.key).is_cause}
    assert rivals.pop(HEAD.key) == ()
    ((named, others),) = rivals.items()
    assert {CAM.key, "cycloid.disc_bore_position"} <= {named, *(key for key, _ in others)}
    for key, indices in others:
        assert 16.0 in source(key).orders(UNIT, indices)


def test_of_two_bores_of_one_order_both_are_named() -> None:
    """Alike on both discs they nearly cancel: one bore is claimed, and no second one takes half of what it leaves."""
    sizes = ((20.0, -12.0), (18.0, -9.0))
    lacking = tuple(
        rverror.effect("cycloid.disc_bore_position", disc=disc, crank=0, radial=f"{-r} um", tangential=f"{-t} um")
        for disc, (r, t) in enumerate(sizes)
    )
    keys = ("crank.eccentricity", "cycloid.disc_bore_position", "cycloid.disc_pitch", "cycloid.disc_profile")
    table = table_of(Model(OTHER, lacking), loads=(60e3, 250e3), seed=2)
    told = rverror.diagnose(Model(UNIT), [table], policy=replace(POLICY, keys=keys))
    causes = [one for one in told.added if source(one.effect.key).is_cause]
    assert [one.effect.key for one in causes] == ["cycloid.disc_bore_position"] * 2
    assert len({(one.effect.indices["disc"]) for one in causes}) == 2
    assert len({(one.effect.indices["crank"]) for one in causes}) == 1  # on the other one both do nearly the same
    assert told.after.heldout_rms < 2 * told.noise_rms


def test_rms_is_the_root_of_half_the_squared_amplitudes(found: rverror.Diagnosis) -> None:
    table = table_of(Model(OTHER, (CAM, HEAD)), loads=SEEN)
    power = np.mean([np.sum(np.abs(case.waves) ** 2) / 2 for case in table.cases])
    assert found.before.rms == pytest.approx(math.sqrt(power), rel=1e-6)  # a reducer without errors predicts none


def test_shares_of_an_order_make_one_and_name_the_chain(found: rverror.Diagnosis) -> None:
    """Of an order that neither makes nothing but noise is measured, and no share of it is known."""
    for share in found.shares:
        total = share.parts + share.compliance + share.measuring_chain + share.empirical + share.left
        if share.amplitude > 5 * NOISE * ARCSEC:
            assert total == pytest.approx(1.0, abs=1e-9)
        if share.amplitude < NOISE * ARCSEC:
            assert math.isnan(total)
    assert {math.isnan(share.parts) for share in found.shares} == {True, False}
    by_order = {share.order: share for share in found.shares}
    assert by_order[1.0].measuring_chain == pytest.approx(1.0, abs=0.01)
    assert by_order[16.0].parts == pytest.approx(1.0, abs=0.02)


def test_a_table_that_no_fit_saw_is_foretold(found: rverror.Diagnosis) -> None:
    """At loads between, with other noise: the declared model leaves all, the result hardly more than the noise."""
    unseen = table_of(Model(OTHER, (CAM, HEAD)), loads=(90e3, 250e3), seed=5)
    held = rverror.diagnosis.validated(found, [unseen]).validation[0]
    assert held.before == pytest.approx(found.before.rms, rel=0.05)
    assert held.after < 2 * found.noise_rms
    assert np.hypot.reduce(held.after_by_order) == pytest.approx(held.after, rel=1e-9)


def test_a_run_that_no_fit_saw_is_foretold(found: rverror.Diagnosis) -> None:
    theta = TURN * np.arange(1024) / 1024
    model = Model(OTHER, (CAM, HEAD))
    error = predict(model, OperatingConditions(theta, 1.0, 90e3)).transmission_error
    run = rverror.run_from_arrays(input_angle=49 * theta, te=error + 3e-4, torque=90e3, direction="forward")
    held = rverror.diagnosis.validated(found, [run]).validation[0]
    assert held.after < 0.05 * held.before


def test_nothing_is_named_where_nothing_is_missing() -> None:
    told = rverror.diagnose(Model(UNIT, (CAM,)), [table_of(Model(OTHER, (CAM,)), loads=SEEN, seed=3)])
    assert told.verdict == "nothing_missing"
    assert told.added == ()
    assert told.before_refitted.rms < 1.3 * told.noise_rms


def test_an_order_of_no_part_is_described_and_not_named() -> None:
    """Of order 7 a constant and a part that grows with the load, alike in both directions."""
    table = table_of(Model(OTHER, (HEAD,)), loads=SEEN, seed=4)
    at = int(np.flatnonzero(ORDERS == 7)[0])
    cases = []
    for case in table.cases:
        waves = case.waves.copy()
        assert case.condition.torque is not None
        waves[at] += (1.5 + 4e-6 * case.condition.torque * 1j) * ARCSEC
        cases.append(replace(case, waves=waves))
    told = rverror.diagnose(Model(UNIT), [replace(table, cases=tuple(cases))])
    laws = {
        (one.effect.key, one.effect.indices.get("sense")): one.estimates for one in told.added if one.orders == (7.0,)
    }
    assert told.verdict == "unexplained"
    assert [line.order for line in told.unexplained] == [7.0]
    assert set(laws) == {("empirical.order", None), ("empirical.order_by_load", "alike")}
    constant, slope = laws["empirical.order", None], laws["empirical.order_by_load", "alike"]
    assert constant[0].low <= 1.5 * ARCSEC <= constant[0].high
    # Re(z exp(i 7 theta)) with z = i b T is -b T sin(7 theta)
    assert slope[1].low <= -4e-6 * ARCSEC <= slope[1].high
    assert {share.order: share for share in told.shares}[7.0].empirical == pytest.approx(1.0, abs=0.02)
    assert told.after.rms < 1.5 * told.noise_rms


def test_waves_of_a_grid_are_those_that_were_put_in_and_turn_with_the_marks() -> None:
    turn = whole(0.0, TURN, 512)
    rng = np.random.default_rng(1)
    orders = np.array([1.0, 3.5, 7.0, 48.0])
    waves = rng.normal(size=4) + 1j * rng.normal(size=4)
    case = OrderCase(condition=TableCondition(direction=1.0), orders=orders, waves=waves)
    observation = TableObservation(case, np.ones(8), LoadCase(1.0, None, turn), UNIT)

    def rows(shift: float) -> Array:
        return np.asarray([np.real(np.exp(1j * np.outer(turn.theta + shift, orders)) @ waves) + 0.3])

    assert observation.of_grid(turn, rows(0.0), 0.0)[0] == pytest.approx(observation.measured, abs=1e-12)
    assert observation.of_grid(turn, rows(0.0), 0.4)[0] == pytest.approx(
        observation.of_grid(turn, rows(0.4), 0.0)[0], abs=1e-12
    )


def test_the_change_with_the_marks_is_the_derivative() -> None:
    rng, turn = np.random.default_rng(3), whole(0.0, TURN, 256)
    case = OrderCase(condition=TableCondition(direction=1.0), orders=np.array([3.0, 16.0]), waves=np.zeros(2, complex))
    observation = TableObservation(case, np.ones(4), LoadCase(1.0, None, turn), UNIT)
    wave = Waveform(turn, rng.normal(size=256), np.zeros((0, 256)), np.zeros((10, 256)), (), UNIT)
    here, there = (observation.of_wave(wave, wave.error[None], 0.3 + step)[0] for step in (-1e-6, 1e-6))
    assert observation.change(wave, 0.3) == pytest.approx((there - here) / 2e-6, rel=1e-6)


def test_marks_that_are_ahead_are_found() -> None:
    """By 0.04 rad: the waves of the gears are turned by their order times that, the encoder's are not."""
    ahead, table = 0.04, table_of(Model(OTHER, (CAM,)), loads=SEEN, seed=8)
    head = np.array([complex(HEAD.values[0], -HEAD.values[1])] + [0.0] * (ORDERS.size - 1))
    cases = [replace(c, waves=c.waves * np.exp(1j * ORDERS * ahead) + head) for c in table.cases]
    turned = replace(table, cases=tuple(cases), index="unknown")
    stated = Model(UNIT, (CAM, rverror.effect("sensor.index_offset", offset=f"{ahead} rad")))
    exact = rverror.diagnose(stated, [turned], policy=SOME)
    assert ([one.effect.key for one in exact.added], exact.model.index_offset) == ([HEAD.key], ahead)
    assert "index unknown" not in " ".join(exact.notes)
    told = rverror.diagnose(Model(UNIT, (CAM,)), [turned], policy=SOME)
    assert [one.effect.key for one in told.added] == [HEAD.key]
    assert told.model.index_offset == pytest.approx(ahead, abs=0.003)  # CAM's 1 arcsec or so in 0.05 of noise
    assert told.verdict == "explained"
    assert "index unknown" in " ".join(told.notes)


def test_what_gives_way_counts_as_compliance_and_what_is_read_as_the_chain() -> None:
    """A flange's wave of three, and the tilt that one head reads at the order of the crank in the housing."""
    flange = rverror.effect("load.torsion_wave", harmonic=3, cos="10 arcsec/(kN*m)", sin="-8 arcsec/(kN*m)")
    tilt = rverror.effect("sensor.output_tilt", x="6 arcsec/(kN*m)", y="9 arcsec/(kN*m)")
    told = rverror.diagnose(Model(UNIT), [table_of(Model(OTHER, (flange, tilt)), loads=SEEN, seed=9)], policy=SOME)
    found = {one.effect.key: one for one in told.added}
    assert {flange.key, tilt.key} <= set(found)
    for true in (flange, tilt):
        for estimate, value in zip(found[true.key].estimates, true.values, strict=True):
            assert estimate.low <= value <= estimate.high
    shares = {share.order: share for share in told.shares}
    assert shares[3.0].compliance == pytest.approx(1.0, abs=0.02)
    assert shares[15.0].measuring_chain == pytest.approx(1.0, abs=0.02)


def test_one_direction_is_not_described_by_what_differs_between_two() -> None:
    table = table_of(Model(OTHER), loads=SEEN, seed=4)
    cases = tuple(
        replace(case, waves=case.waves + 2 * ARCSEC * (ORDERS == 7))
        for case in table.cases
        if case.condition.direction > 0
    )
    told = rverror.diagnose(Model(UNIT), [replace(table, cases=cases)], policy=SOME)
    assert {one.effect.key for one in told.added} == {"empirical.order"}
    assert any("one direction only" in note for note in told.notes)


def test_noise_is_what_parabolas_over_the_load_leave() -> None:
    rng, law = np.random.default_rng(2), np.array([2.0, -1.0 + 0.5j, 0.3j])
    cases = []
    for direction in (1.0, -1.0):
        for load in np.linspace(10e3, 400e3, 40):
            wave = np.polyval(law, load / 400e3) * ARCSEC
            spread = 0.2 * ARCSEC * (rng.normal(size=2) + 1j * rng.normal(size=2))
            at = TableCondition(direction=direction, torque=float(load))
            cases.append(OrderCase(condition=at, orders=np.array([1.0, 16.0]), waves=wave + spread))
    sigmas, notes = noise_of_cases(cases, floor=0.0)
    # 2 (40 - 3) values of each direction: one standard deviation of their root mean square is 6 %
    assert sigmas[0] == pytest.approx(np.full(4, 0.2 * ARCSEC), rel=0.2)
    assert "states no sigma" in notes[0]
    held = [  # as a bench holds speed and temperature
        replace(case, condition=replace(case.condition, input_speed=100 * (1 + 1e-3 * a), temperature=25 + 0.2 * b))
        for case, (a, b) in zip(cases, rng.uniform(-1, 1, (80, 2)), strict=True)
    ]
    np.testing.assert_allclose(noise_of_cases(held, floor=0.0)[0], sigmas, rtol=1e-12)
    stated = [replace(case, sigma=np.full(2, 1e-6)) for case in cases]
    assert noise_of_cases(stated, floor=0.0) == ([pytest.approx(np.full(4, 1e-6))] * 80, [])
    large = [replace(case, waves=100 * case.waves) for case in cases[:4]]
    few, notes = noise_of_cases(large, floor=0.0)
    rms = math.sqrt(sum(abs(case.waves[0]) ** 2 for case in large) / 4)
    assert few[0][0] / rms == pytest.approx(0.05)
    assert "too few loads" in notes[0]


def test_what_the_model_is_not_right_to_counts_once_for_each_independent_value() -> None:
    """Of N numbers of an order M are independent: a share of the waves' rms has its variance N/M times."""
    cases = [
        OrderCase(
            condition=TableCondition(direction=1.0, torque=load), orders=np.array([5.0]), waves=np.array([3 + 4j])
        )
        for load in (1.0, 2.0, 3.0, 4.0, 5.0)
    ]
    run_set = table_set(UNIT, cases, [np.zeros(2)] * 5, policy=POLICY, anywhere=False).with_discrepancy(0.1)
    first = run_set.sigmas[0]
    # |z|^2 = 25 in two numbers each: rms^2 = 12.5; N = 10, M = 4
    assert first == pytest.approx(np.sqrt(np.full(2, 0.01 * 12.5 * 10 / 4)))


def test_the_chance_of_a_claim_is_that_of_sizes_that_mean_nothing() -> None:
    """Random blocks of two sizes take shares of eight values that are distributed as `chance` says."""
    rng = np.random.default_rng(6)
    shares = []
    for _ in range(4000):
        rows, waves = np.linalg.qr(rng.normal(size=(8, 2)))[0], rng.normal(size=8)
        shares.append(float(np.sum((rows.T @ waves) ** 2) / np.sum(waves**2)))
    order, share, odds = chance_of_cam()
    told = float(np.mean(np.array(shares) >= 0.6))
    assert told == pytest.approx(float(beta.sf(0.6, 1, 3)), abs=4 * math.sqrt(0.064 * 0.936 / 4000))
    assert order == 16.0
    assert odds == pytest.approx((1 - share) ** 3, rel=1e-6)  # of two sizes in eight values
    assert share > 0.95


def chance_of_cam() -> tuple[float, float, float]:
    table = table_of(Model(OTHER, (CAM,)))
    sigmas, _ = noise_of_cases(table.cases, floor=0.0)
    run_set = table_set(UNIT, table.cases, sigmas, policy=replace(POLICY, regular=1e12), anywhere=False)
    model = Model(UNIT)
    fit = fitted(evaluated(run_set, replace(model, effects=(CAM,)), model))
    return chance(fit, 0)


def test_a_linear_step_beside_a_block_reaches_what_a_fit_reaches() -> None:
    """Of a reading that is linear: the same sizes and objective."""
    table = table_of(Model(UNIT, (HEAD,)))
    sigmas, _ = noise_of_cases(table.cases, floor=0.0)
    run_set = table_set(UNIT, table.cases, sigmas, policy=replace(POLICY, regular=1e12), anywhere=False)
    model = Model(UNIT)
    bare = evaluated(run_set, model, model)
    (block,) = blocks_of(bare, [(HEAD.key, {})])
    trial = Linear(bare).beside(block)
    whole_fit = fitted(evaluated(run_set, replace(model, effects=(Effect(HEAD.key, {}, (0.0, 0.0)),)), model), steps=30)
    assert trial.sizes(0) == pytest.approx(np.array(whole_fit.added[0].values), rel=1e-3)
    assert trial.objective == pytest.approx(whole_fit.objective, abs=0.05)


def test_tables_that_do_not_go_together_are_refused() -> None:
    table = table_of(Model(UNIT), loads=(20e3,))
    run = rverror.run_from_arrays(input_angle=np.linspace(0, 300, 400), te=np.zeros(400), direction="forward")
    with pytest.raises(InputError, match="is an order table, another input a run"):
        rverror.diagnose(Model(UNIT), [table, run])
    with pytest.raises(InputError, match=r"order tables are diagnosed for a \[reducer\]"):
        rverror.diagnose(Model(rverror.Drive(ratio=14.0, shafts={})), [table])
    with pytest.raises(InputError, match="tables that are diagnosed together have one zero"):
        rverror.diagnose(Model(UNIT), [table, replace(table, index="unknown")])
    delay = rverror.effect("sensor.time_offset", offset="1 ms")
    with pytest.raises(InputError, match="needs the time of samples"):
        rverror.diagnose(Model(UNIT, (delay,)), [table])


def test_a_table_goes_from_the_command_line_to_its_page(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Fitted on three loads, validated on a fourth."""
    monkeypatch.setattr(diagnosis_commands, "diagnose", partial(rverror.diagnose, policy=SOME))
    model, page, told = tmp_path / "model.toml", tmp_path / "page.html", tmp_path / "told.json"
    rverror.save_model(model, Model(UNIT))
    seen, unseen = tmp_path / "seen.csv", tmp_path / "unseen.csv"
    for path, loads, seed in ((seen, SEEN, 0), (unseen, (90e3,), 1)):
        rverror.runs.write_orders(path, table_of(Model(OTHER, (HEAD,)), loads=loads, seed=seed))
    picture = tmp_path / "picture.png"
    command = ["diagnose", model, seen, "--validate", unseen, "--json", told, "--report", page, "--plot", picture]
    assert main([str(word) for word in command]) == 0
    assert picture.read_bytes().startswith(b"\x89PNG")
    data = json.loads(told.read_text(encoding="utf-8"))
    assert {entry["key"] for entry in data["added"]} == {HEAD.key}
    assert data["passport"][0]["order"] == 1.0
    assert data["validation"][0]["file"] == str(unseen)
    assert data["validation"][0]["after"]["rms_arcsec"] < 0.1 * data["validation"][0]["before"]["rms_arcsec"]
    text = capsys.readouterr().out
    assert text.index(HEAD.key) < text.index("Measurements that no fit saw") < text.index("with load")
    html = page.read_text(encoding="utf-8")
    assert html.index("Measurements that no fit saw") < html.index("What accounts for the power of each order")
    assert main(["diagnose", str(model), str(seen), "--validate", str(seen)]) == 2
    assert "given twice" in capsys.readouterr().err


@pytest.fixture(scope="module")
def measured() -> rverror.Diagnosis:
    """Of the reducer that others measured, from every second of its loads, which say the same of it."""
    table = rverror.runs.load_orders(recording("rv-81to1", "loads-100rpm-25degC.csv"))
    loads = sorted({case.condition.torque or 0.0 for case in table.cases})[::2]
    seen = tuple(case for case in table.cases if case.condition.torque in loads)
    return rverror.diagnose(rverror.load_model(EXAMPLE), [replace(table, cases=seen)])


def test_a_measured_reducer_s_order_1_is_one_cause_with_two_numbers(measured: rverror.Diagnosis) -> None:
    """Its README: 61.7 arcsec at every load, in both directions, with one phase."""
    (head,) = [one for one in measured.added if one.effect.key == HEAD.key]
    assert math.hypot(*head.effect.values) == pytest.approx(61.7 * ARCSEC, rel=0.01)
    assert head.orders == (1.0,)
    order_1 = {share.order: share for share in measured.shares}[1.0]
    assert order_1.measuring_chain == pytest.approx(1.0, abs=2e-3)


def test_a_measured_reducer_is_foretold_at_another_temperature(measured: rverror.Diagnosis) -> None:
    """The same unit repeats to 1.2 arcsec; most of the power of all orders but the first is claimed by causes."""
    table = rverror.load_run(recording("rv-81to1", "loads-100rpm-30degC.csv"))
    held = rverror.diagnosis.validated(measured, [table]).validation[0]
    assert np.hypot.reduce(held.after_by_order[1:]) < 1.5 * ARCSEC
    power = [(one.amplitude**2, one) for one in measured.shares if one.order > 1]
    named = sum(size * (one.parts + one.compliance + one.measuring_chain) for size, one in power)
    assert named > 0.5 * sum(size for size, _ in power)
    assert measured.verdict == "unexplained"
    sizes = [len(one.effect.values) for one in measured.added if not one.effect.key.startswith("empirical.")]
    assert sum(sizes) <= 25
