"""A lot's processes: orders of the runs, units that are drawn, and standard deviations with intervals."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import compress
from typing import Any

import numpy as np
import pytest
import scipy

import rverror
from gear_runs import OTHER, TURN, UNIT, red
from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.base.units import ARCSEC
from rverror.diagnosis.gears.reducers import curved
from rverror.lots.amplitudes import Amplitudes, LotUnit, amplitudes_of
from rverror.lots.identifiable import question_of
from rverror.lots.made import lot
from rverror.lots.moments import LotEstimate, MomentMatching, interval
from rverror.lots.own_equilibrium import OwnEquilibrium
from rverror.lots.processes import UnitParts, processes_of
from rverror.lots.result import Change, Interval, Lot, Outsider, Shift
from rverror.lots.shifts import ShiftedUnits, ShiftEffect, ShiftSource
from rverror.lots.simulated import Simulator, State
from rverror.model.effects import Effect, Model
from rverror.statics.loaded_state import SOFTENING, NotConvergedError
from rverror.tolerances.loaded_units import LoadedTurn

MODEL = Model(UNIT)
THETA = TURN * np.arange(128) / 128
COARSE = TURN * np.arange(66) / 66  # to order 32, twice the crank's
TOLERANCES = tuple(
    rverror.tolerance(key, width, **more)
    for key, width, more in (
        ("crank.eccentricity", "10 um", {}),
        ("cycloid.pin_position", "10 um", {}),
        ("cycloid.disc_pitch", "10 um", {"harmonic": 1}),
        ("sensor.encoder_eccentricity", "10 arcsec", {}),
    )
)


def run(error: Array, theta: Array = THETA, direction: float = 1.0, **told: object) -> rverror.Run:
    return rverror.run_from_arrays(
        input_angle=UNIT.ratio * theta, output_angle=theta + error, direction=direction, **{"torque": "50 N*m", **told}
    )


def units_of(errors: Sequence[Array], labels: Sequence[Mapping[str, str]] | None = None) -> list[LotUnit]:
    """Units of one forward run each."""
    return [
        LotUnit(f"{number:03}", (run(error),), {} if labels is None else labels[number])
        for number, error in enumerate(errors)
    ]


def made(
    seed: int,
    count: int,
    deviation: Mapping[str, float],
    rms: float = 0.2,
    *,
    odd: bool = False,
    ways: Sequence[float] = (1.0, -1.0),
    spoilt: Mapping[int, Effect] | None = None,
) -> list[LotUnit]:
    """Units with other stiffness than is declared, at 50 N*m; by number what is wrong with those that are spoilt.

    With `odd` those of machine B have an encoder that is 5 arcsec off, and the last ten are 3 arcsec off across it.
    """
    rng = np.random.default_rng(seed)
    truth = replace(OTHER, contact_law=curved(UNIT).contact_law, gear_backlash=UNIT.gear_backlash)
    processes = processes_of(MODEL, run(COARSE, COARSE), TOLERANCES)
    found = []
    for number in range(count):
        effects = [
            Effect(p.key, dict(i), tuple(rng.normal(size=2) * deviation.get(p.key, 0.0)))
            for p in processes
            for i in p.instances
        ]
        if odd and number % 2:
            effects.append(rverror.effect("sensor.encoder_eccentricity", cos="5 arcsec"))
        if odd and number >= count - 10:
            effects.append(rverror.effect("sensor.encoder_eccentricity", sin="3 arcsec"))
        if spoilt and number in spoilt:
            effects.append(spoilt[number])
        runs = []
        for direction in ways:
            theta = COARSE if direction > 0 else COARSE[::-1]
            error = rverror.equilibrium(
                Model(truth, tuple(effects)), theta, torque="50 N*m", direction=direction
            ).transmission_error
            noise = red(1000 * seed + 2 * number + (direction > 0), theta.size, rms, 0.3)
            runs.append(run(error + noise + rng.normal() * 1e-4, theta, direction))
        found.append(LotUnit(f"{number:03}", tuple(runs), {"machine": "AB"[number % 2]}))
    return found


# --- orders -----------------------------------------------------------------------------------------------------------


def noise(seed: int, count: int = 40, rms: float = 0.3) -> list[Array]:
    rng = np.random.default_rng(seed)
    return list(rng.normal(size=(count, THETA.size)) * rms * ARCSEC)


@pytest.mark.parametrize("theta", [THETA, THETA[::-1], np.linspace(0.3, 0.3 + 2 * TURN, 700)])
def test_a_wave_is_the_amplitude_of_its_order(theta: Array) -> None:
    """Whatever the samples, the offset and the direction; what is over a whole turn or two counts alike."""
    error = 3 * ARCSEC * np.cos(7 * theta) - 2 * ARCSEC * np.sin(40 * theta) + 1e-3
    way = float(np.sign(theta[-1] - theta[0]))
    found = amplitudes_of(MODEL, [LotUnit(str(k), (run(error, theta, way),)) for k in range(3)])
    count = len(found.orders)
    cosine, sine = found.values[1, :count] / ARCSEC, found.values[1, count:] / ARCSEC
    assert cosine[6] == pytest.approx(3 / math.sqrt(2))
    assert sine[39] == pytest.approx(-2 / math.sqrt(2))
    assert np.sum(found.values[1] ** 2) == pytest.approx(np.var(error), rel=1e-2)


def test_amplitudes_of_waves_are_those_of_runs() -> None:
    wave = 2 * ARCSEC * np.cos(5 * THETA + 0.4)
    found = amplitudes_of(MODEL, units_of([wave] * 3))
    assert found.of_waves(wave) == pytest.approx(found.values[0], abs=1e-12)
    assert found.waves(found.values, THETA.size)[1, 0] == pytest.approx(wave, abs=1e-12)


def test_over_turns_a_covariance_is_the_mean_of_that_of_waves_begun_anywhere() -> None:
    """Waves of two conditions, begun at each of 64 samples, as no order is above 32."""
    rng, orders = np.random.default_rng(2), np.array([1, 2, 5, 16, 31])
    conditions = amplitudes_of(MODEL, made(1, 3, {})).conditions
    empty = np.zeros((0, 4 * len(orders)))
    one = Amplitudes((), {}, conditions, orders, empty, np.ones(4 * len(orders)), 64, marked=False)
    first, second = rng.normal(size=(2, 1, 4 * len(orders)))
    turned = [
        [one.of_waves(np.roll(one.waves(unit, 64), by, axis=-1)).ravel() for unit in (first, second)]
        for by in range(64)
    ]  # fmt: skip
    form, expected = np.outer(first, second), np.mean([np.outer(a, b) for a, b in turned], axis=0)
    assert one.over_turns(form + form.T) == pytest.approx(expected + expected.T, abs=1e-12)
    assert replace(one, marked=True).over_turns(form) is form


def test_the_noise_of_an_amplitude_is_told_beside_strong_parts() -> None:
    """Seven orders in a row that parts make do not count as noise."""
    rng = np.random.default_rng(3)
    waves = np.cos(np.arange(36, 43)[:, None] * THETA) * ARCSEC
    units = units_of([one + rng.normal(size=7) @ waves for one in noise(4, 60)])
    found = amplitudes_of(MODEL, units)
    expected = (0.3 * ARCSEC) ** 2 / THETA.size
    assert found.noise == pytest.approx(np.full(found.noise.size, expected), rel=0.25)
    assert np.median(found.noise) == pytest.approx(expected, rel=0.06)


def test_the_noise_of_an_amplitude_falls_with_the_order_as_coloured_noise_does() -> None:
    """Of 120 units with e[t] = e[t-1]/2 + w[t]: the spectrum of an autoregression, at every third of the orders."""
    theta, rms = TURN * np.arange(512) / 512, 0.3 * ARCSEC
    rng = np.random.default_rng(5)
    white = rng.normal(size=(120, 600)) * rms
    coloured = scipy.signal.lfilter([1.0], [1.0, -0.5], white)[:, -512:]
    found = amplitudes_of(MODEL, [LotUnit(f"{n:03}", (run(one, theta),)) for n, one in enumerate(coloured)])
    expected = rms**2 / np.abs(1 - 0.5 * np.exp(-1j * TURN * found.orders / 512)) ** 2 / 512
    ratio = found.noise[: found.orders.size] / expected
    assert [float(np.median(some)) for some in np.array_split(ratio, 6)] == pytest.approx([1.0] * 6, abs=0.08)


def test_units_without_a_run_of_each_condition_are_left_out_and_counted() -> None:
    pairs = [LotUnit(str(k), (run(e), run(e[::-1], THETA[::-1], -1.0))) for k, e in enumerate(noise(1, 4))]
    found = amplitudes_of(MODEL, [*pairs, LotUnit("9", (run(noise(2, 1)[0]),))])
    assert found.serials == ("0", "1", "2", "3")
    assert found.notes == ("left out: 1 unit without a run of forward at 50 N*m, reverse at 50 N*m (9)",)


@pytest.mark.parametrize(
    ("units", "said"),
    [
        (lambda: units_of(noise(1, 2)), "takes 3 or more"),
        (lambda: [*units_of(noise(1, 3)), *units_of(noise(2, 1))], "serial '000' stands for 2 units"),
        (
            lambda: [LotUnit("a", (run(noise(1, 1)[0], index="unknown"), run(noise(1, 1)[0])))],
            "unit a: index is 'unknown' in some of its runs",
        ),
        (lambda: [LotUnit("a", (run(noise(1, 1)[0], torque=None),))], "output_torque"),
        (lambda: [LotUnit("a", (run(noise(1, 1)[0][:64], THETA[:64]),))], "it takes a whole turn"),
        (lambda: [], "0 units with a run of one condition: it takes 3 or more"),
    ],
)
def test_what_is_no_lot_is_refused_in_one_line(units: object, said: str) -> None:
    with pytest.raises(InputError, match=said) as told:
        lot(MODEL, units())  # type: ignore[operator]
    assert "\n" not in str(told.value)


# --- processes --------------------------------------------------------------------------------------------------------


def test_processes_are_all_parts_of_a_kind_and_none_twice() -> None:
    processes = processes_of(MODEL, run(THETA))
    by_key = {p.key: p for p in processes if not p.indices}
    assert len(by_key["crank.eccentricity"].instances) == UNIT.cranks * UNIT.discs
    assert len(by_key["cycloid.pin_position"].instances) == UNIT.pins
    assert "cycloid.pin_circle" not in {p.key for p in processes}  # the pins say the same
    parts = UnitParts(processes)
    names = [
        (parts.effects[e].key, str(parts.effects[e].indices), p.name)
        for e, p in zip(parts.effect, parts.parameters, strict=True)
    ]
    assert len(set(names)) == len(names) == len(parts.process)
    assert sum(len(one.at) for one in parts.effects) == len(parts.process)


def test_tolerances_say_which_parts_vary_and_none_twice() -> None:
    processes = processes_of(MODEL, run(THETA), TOLERANCES)
    assert [p.key for p in processes] == [one.key for one in TOLERANCES]
    with pytest.raises(InputError, match="has two"):
        processes_of(MODEL, run(THETA), (*TOLERANCES, TOLERANCES[0]))


def simulator() -> Simulator:
    """Of four processes at two conditions and few orders."""
    conditions = amplitudes_of(MODEL, made(1, 3, {})).conditions
    orders = np.array([1, 2, 14, 15, 16, 17, 30, 32])
    amplitudes = Amplitudes(
        (),
        {},
        conditions,
        orders,
        np.zeros((0, 4 * len(orders))),
        np.full(4 * len(orders), (0.02 * ARCSEC) ** 2),
        THETA.size,
    )
    return Simulator(MODEL, UnitParts(processes_of(MODEL, run(THETA), TOLERANCES)), amplitudes)


def test_changes_with_processes_and_stiffness_are_those_of_solved_units() -> None:
    """Central differences of units that are solved anew; that a pin's force turns as it is pressed in is left out."""
    one = simulator()
    standard = np.random.default_rng(2).standard_normal((3, len(one.parts.process)))
    state = State(np.array([2e-3, 1e-3, 1.5e-3, 1e-5]), np.full(6, 0.05))
    draws = one.draws(state, standard)
    assert draws.values == pytest.approx(one.values(state, standard), abs=1e-6)
    step = 1e-6
    for number in range(3):
        move = step * (np.arange(4) == number)
        ahead, behind = (one.values(replace(state, deviation=state.deviation + s * move), standard) for s in (1, -1))
        change = (ahead - behind) / (2 * step)
        assert draws.by_process[:, number] == pytest.approx(change, abs=5e-3 * abs(change).max())
    move = 1e-4 * (np.arange(6) == 0)
    ahead, behind = (one.values(replace(state, compliance=state.compliance + s * move), standard) for s in (1, -1))
    change = (ahead - behind) / 2e-4
    assert draws.by_compliance[:, 0] == pytest.approx(change, abs=5e-3 * abs(change).max())


def test_what_does_the_same_is_told_as_one_and_what_does_nothing_not_at_all() -> None:
    """A bore of the carrier does what its runout does; the sun's support is so soft that the sun shows nowhere."""
    model = Model(replace(UNIT, stiffness=replace(UNIT.stiffness, sun_support=1.0)))
    units = made(5, 12, {"crank.eccentricity": 2e-3})
    amplitudes = amplitudes_of(model, units)
    question = question_of(model, amplitudes, processes_of(model, units[0].runs[0]))
    silent = {p.key for p in question.silent}
    assert {"involute.sun_eccentricity", "involute.sun_offset"} <= silent
    kept = {p.key for p in question.simulator.parts.processes}
    assert "crank.eccentricity" in kept
    together = {
        p.key: {o.key for o in others}
        for p, others in zip(question.simulator.parts.processes, question.alike, strict=True)
    }
    carrier = {"coupling.carrier_bore_position", "coupling.carrier_runout"}
    assert any(carrier == {key} | others for key, others in together.items()) or carrier & silent


# --- standard deviations ----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def told() -> Lot:
    return lot(
        MODEL,
        made(8, 40, {"crank.eccentricity": 2e-3, "cycloid.pin_position": 2.5e-3}, 0.14, odd=True, ways=(1.0,)),
        tolerances=TOLERANCES,
    )


def test_intervals_hold_what_the_processes_made(told: Lot) -> None:
    """Of 40 units whose stiffness is not the declared one; what was not spread is not above zero."""
    by_key = {one.key: one for one in told.processes}
    for key, truth in (("crank.eccentricity", 2e-3), ("cycloid.pin_position", 2.5e-3)):
        size = by_key[key].deviation
        assert size is not None
        assert truth in size
        assert by_key[key].above_zero
        assert size.high - size.low < truth
    pitch = by_key["cycloid.disc_pitch"]
    assert not pitch.above_zero
    assert pitch.deviation is not None
    assert pitch.deviation.high < 1.2e-3
    assert sum(one.share for one in told.processes) == pytest.approx(1)


def test_what_is_odd_is_named_and_moves_nothing_else(told: Lot) -> None:
    """The encoders of a machine and those of the last units; no unit is called odd, and their spread has neither."""
    (group,) = told.differences
    assert (group.label, group.value, group.units) == ("machine", "B", 20)
    assert [(one.key, one.parameter) for one in group.causes] == [("sensor.encoder_eccentricity", "cos")]
    assert 5 * ARCSEC in group.causes[0].size
    encoder = next(one for one in told.processes if one.key == "sensor.encoder_eccentricity")
    assert encoder.deviation is not None
    assert encoder.deviation.high < 1 * ARCSEC
    (change,) = told.changes
    assert (change.cause.key, change.cause.parameter, change.course) == (group.causes[0].key, "sin", "step")
    assert abs(int(change.since) - 30) <= 1
    assert change.cause.size.value == pytest.approx(3 * ARCSEC, abs=0.15 * ARCSEC)  # four errors
    assert (told.outsiders, told.units) == ((), 40)  # 15 of machine A before the change would be too few
    assert told.chance > 1e-3
    assert told.notes == ()


def test_units_to_come_are_as_those_that_are_there(told: Lot) -> None:
    """The measured 95 % quantile has noise in it, and is of 40 units: 1.4 times its standard error is a fifth."""
    for one in told.predicted:
        assert one.quantile.low < one.quantile.value < one.quantile.high
        assert one.mean == pytest.approx(one.seen[0], rel=0.2)
        assert one.quantile.value == pytest.approx(one.seen[1], rel=0.25)
    most = told.processes[0]
    assert most.deviation is not None
    known = most.share * (most.deviation.high - most.deviation.low) / most.deviation.value
    assert one.quantile.high - one.quantile.low > 0.6 * known * one.quantile.value  # it grows with the largest process


def test_capability_is_the_tolerance_over_what_the_process_needs(told: Lot) -> None:
    cams = next(one for one in told.processes if one.key == "crank.eccentricity")
    assert cams.deviation is not None
    needed = cams.deviation.value * math.sqrt(-2 * math.log(0.0027))
    assert cams.capability == pytest.approx(0.01 / needed)


SPREAD = {"crank.eccentricity": 2e-3, "cycloid.pin_position": 2.5e-3}


def unmarked(units: Sequence[LotUnit], seed: int) -> list[LotUnit]:
    """The same units, the runs of each begun at a sample of its own."""
    rng, found = np.random.default_rng(seed), []
    for unit in units:
        by = int(rng.integers(COARSE.size))
        runs = []
        for one in unit.runs:
            way = float(one.direction[0])
            error = np.roll(one.error(MODEL), by if way > 0 else -by)
            runs.append(run(error, one.nominal_angle(MODEL), way, index="unknown"))
        found.append(LotUnit(unit.serial, tuple(runs), unit.labels))
    return found


def sizes_of(found: Lot) -> dict[str, tuple[float, float, float]]:
    """Standard deviations and the ends of their intervals, um."""
    return {p.key: (1e3 * p.deviation.value, 1e3 * p.deviation.low, 1e3 * p.deviation.high)
            for p in found.processes if p.deviation}  # fmt: skip


@pytest.fixture(scope="module")
def both_ways() -> list[LotUnit]:
    """Units that are measured forward and reverse, at noise beside which what the model lacks does not show."""
    return made(23, 40, SPREAD, 1.0)


def intervals_hold(found: Lot) -> None:
    above = {one.key for one in found.processes if one.above_zero}
    assert above == set(SPREAD)
    for key, (_, low, high) in sizes_of(found).items():
        assert low <= 1e3 * SPREAD.get(key, 0.0) <= high


def holds(found: Lot) -> None:
    intervals_hold(found)
    assert (found.outsiders, found.differences, found.changes) == ((), (), ())
    assert len(found.conditions) == len(found.predicted) == 2


def test_a_lot_forward_and_reverse_is_told_to_its_end(both_ways: list[LotUnit]) -> None:
    found = lot(MODEL, both_ways, tolerances=TOLERANCES)
    holds(found)
    assert found.means


def without_estimate(matching: MomentMatching, state: State, **_: object) -> LotEstimate:
    """The state at which an estimate begins, by ten units: for what follows from any estimate."""
    draws = matching.simulator.draws(state, matching.standard[:10])
    known, weight = np.eye(len(state.deviation) + len(state.compliance)), np.eye(draws.values.shape[1])
    return LotEstimate(state, 1e-12 * known, 1.0, 1, draws, draws.influence, weight)


def test_units_are_asked_for_their_own_equilibrium_once_the_estimate_is_not_repeated(
    both_ways: list[LotUnit], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A first estimate that fits is the only one; a poor one is repeated, and asked for nothing before."""
    steps = list[str]()

    def estimate(self: MomentMatching, state: State, **_: object) -> LotEstimate:
        steps.append("estimated")
        return without_estimate(self, state)

    def outsiders(*_: object, level: float) -> tuple[Outsider, ...]:
        steps.append("asked")
        return ()

    monkeypatch.setattr(MomentMatching, "estimate", estimate)
    monkeypatch.setattr("rverror.lots.made.outsiders", lambda *_, **__: ())
    monkeypatch.setattr(OwnEquilibrium, "outsiders", outsiders)
    for poor, expected in ((False, ["estimated", "asked"]), (True, ["estimated", "estimated", "asked"])):
        steps.clear()
        monkeypatch.setattr(LotEstimate, "poor", poor)
        lot(MODEL, both_ways, tolerances=TOLERANCES)
        assert steps == expected


def test_without_marks_a_lot_is_told_whatever_the_zeros_of_its_units(both_ways: list[LotUnit]) -> None:
    """Two lots of the same units, begun elsewhere, are the same lot; the means that they hide are not told."""
    first, second = (lot(MODEL, unmarked(both_ways, seed), tolerances=TOLERANCES) for seed in (1, 2))
    for key, size in sizes_of(first).items():
        assert sizes_of(second)[key] == pytest.approx(size, rel=1e-4, abs=1e-6)
    holds(first)
    assert (first.means, first.shifts, first.marked) == ((), (), False)
    assert "groups and changes are not searched" in first.notes[0]
    assert "no systematic error" not in rverror.to_text(first)


def test_spoilt_units_without_marks_are_found_and_the_others_are_told_as_by_themselves() -> None:
    """Two of 42, each with a bore that is far off, move sizes by less than a standard error and no interval's width."""
    spoilt = {
        40: rverror.effect("cycloid.disc_bore_position", disc=1, crank=0, tangential="-90 um"),
        41: rverror.effect("cycloid.disc_bore_position", disc=0, crank=1, tangential="80 um"),
    }
    units = unmarked(made(23, 42, SPREAD, 1.0, spoilt=spoilt), 1)
    found, alone = (lot(MODEL, some, tolerances=TOLERANCES) for some in (units, units[:40]))
    assert {one.serial for one in found.outsiders} == {"040", "041"}
    assert found.units == 40
    assert (found.differences, found.changes) == ((), ())
    intervals_hold(alone)
    for key in SPREAD:
        (size, low, high), (expected, least, most) = sizes_of(found)[key], sizes_of(alone)[key]
        assert size == pytest.approx(expected, abs=(most - least) / (2 * 1.96))
        assert high - low == pytest.approx(most - least, rel=0.2)


def test_gross_errors_of_one_kind_widen_no_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three of 42 units with a cam that is 60 to 70 um off: as members they make cams scatter three times as much, and
    in this lot no unit is then a suspect.  The first estimate bounds what a unit counts."""
    spoilt = {
        3: rverror.effect("crank.eccentricity", disc=1, crank=0, radial="60 um"),
        17: rverror.effect("crank.eccentricity", disc=0, crank=0, tangential="70 um"),
        21: rverror.effect("crank.eccentricity", disc=1, crank=1, tangential="-65 um"),
    }
    monkeypatch.setattr(OwnEquilibrium, "outsiders", lambda *_, level: ())  # which takes most of the time
    found = lot(MODEL, made(23, 42, SPREAD, 1.0, spoilt=spoilt), tolerances=TOLERANCES)
    assert {one.serial for one in found.outsiders} == {"003", "017", "021"}
    assert (found.units, found.notes) == (39, ())
    intervals_hold(found)


def test_a_unit_that_may_be_no_member_is_left_out_of_the_estimate_and_said(monkeypatch: pytest.MonkeyPatch) -> None:
    """A cam six standard deviations off, less than first order tells for sure."""
    spoilt = {5: rverror.effect("crank.eccentricity", disc=1, crank=0, radial="12 um")}
    asked, compared = list[str](), list[int]()

    def outsiders(self: OwnEquilibrium, serials: Sequence[str], *given: Array, level: float) -> tuple[Outsider, ...]:
        asked.extend(compress(serials, given[3] == max(given[3])))
        return ()

    def changes_over_serial(values: Array, *_: object, **__: object) -> tuple[Change, ...]:
        compared.append(len(values))
        return ()

    monkeypatch.setattr(OwnEquilibrium, "outsiders", outsiders)
    monkeypatch.setattr("rverror.lots.made.changes_over_serial", changes_over_serial)
    found = lot(MODEL, made(9, 42, SPREAD, 1.0, spoilt=spoilt), tolerances=TOLERANCES)
    assert (found.units, found.outsiders) == (41, ())
    assert compared == [42, 41]  # nor is it one of the units that are compared with one another
    assert found.notes == ("far from the other units, and left out of the estimate: 005",)
    assert asked == ["005"]
    intervals_hold(found)


def test_an_estimate_is_not_renewed_for_a_unit_that_changes_sides(monkeypatch: pytest.MonkeyPatch) -> None:
    """One of 33 units moves an estimate by the root of 1/33 of its standard errors, about a sixth."""
    cause = Shift("crank.eccentricity", {"disc": 0, "crank": 0}, "radial", "length", Interval(0.0, 0.0, 0.0))
    since = iter(["033", "032", "031"])

    def changes_over_serial(
        values: Array, serials: Sequence[str], *_: object, **__: object
    ) -> tuple[tuple[Change, ShiftEffect], ...]:
        first = next(since)
        change = Change(first, (first, first), "step", 1e-3, cause)
        return ((change, ShiftEffect(np.zeros(1), np.zeros((4, values.shape[1])), np.empty((0, 4, values.shape[1])))),)

    monkeypatch.setattr(MomentMatching, "estimate", without_estimate)
    monkeypatch.setattr(OwnEquilibrium, "outsiders", lambda *_, level: ())
    monkeypatch.setattr("rverror.lots.made.outsiders", lambda *_, **__: ())
    monkeypatch.setattr("rverror.lots.made.changes_over_serial", changes_over_serial)
    found = lot(MODEL, made(9, 42, SPREAD, 1.0), tolerances=TOLERANCES)
    assert (found.changes[0].since, list(since)) == ("032", ["031"])
    assert found.units == 33  # from which the processes are told


def test_what_the_estimate_leaves_unknown_of_a_shift_is_as_large_as_its_states_differ(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """However many states are drawn.  A cam closes gaps that depend on all parts, an encoder's error is only itself."""
    seen = list[ShiftedUnits]()

    def changes_over_serial(*_: object, shifted: ShiftedUnits, **__: object) -> None:
        seen.append(shifted)
        raise InputError("no more is needed")

    monkeypatch.setattr(MomentMatching, "estimate", without_estimate)
    monkeypatch.setattr("rverror.lots.made.changes_over_serial", changes_over_serial)

    def refused(*_: object) -> Array:
        raise NotConvergedError("no equilibrium")

    with pytest.raises(InputError, match="no more"):
        lot(MODEL, made(9, 42, SPREAD, 1.0), tolerances=TOLERANCES)
    unknown = []
    for count in (1, 4):

        def states_within(one: LotEstimate, _: int, __: object, count: int = count) -> list[State]:
            return count * [replace(one.state, deviation=1.5 * one.state.deviation)]

        monkeypatch.setattr(LotEstimate, "states_within", states_within)
        for key, indices, parameter, size in (
            ("crank.eccentricity", {"disc": 0, "crank": 1}, "radial", 0.02),
            ("sensor.encoder_eccentricity", {}, "cos", 10 * ARCSEC),
        ):
            one = ShiftSource(key, indices, (parameter,), "length", np.empty((0, 1)))
            rows = seen[-1].uncertainty(one, np.array([size]))
            assert len(rows) == count
            unknown.append(rows.T @ rows)
    changes = iter([1.0, 5.0, 5.0, 5.0, 5.0])  # of the estimate's state, and of four within its errors
    monkeypatch.setattr(Simulator, "mean_change", lambda *_: np.full(len(unknown[0]), next(changes)))
    np.testing.assert_allclose(seen[-1].uncertainty(one, np.array([size])), (5.0 - 1.0) / math.sqrt(4))
    monkeypatch.setattr(Simulator, "mean_change", refused)
    assert seen[-1].uncertainty(one, np.array([size])).shape == (0, len(unknown[0]))
    assert np.trace(unknown[0]) > 1e-2
    np.testing.assert_allclose(unknown[2], unknown[0], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(unknown[1::2], 0.0, atol=1e-12)


def test_what_a_shift_does_in_the_mean(monkeypatch: pytest.MonkeyPatch) -> None:
    """What influences of many units say where it is small; a large one what the equilibrium of each unit says."""
    some = simulator()
    state = State(np.full(len(some.parts.processes), 1e-3))
    standard = np.random.default_rng(2).standard_normal((3, len(some.parts.process)))
    key, at = "crank.eccentricity", {"disc": 0, "crank": 1}
    small, large = (some.parts.shifted(key, at, {"radial": size}) for size in (1e-7, 0.03))
    assert np.count_nonzero(large) == 1
    errors, solved = some.errors(state, standard), some.draws(state, standard)
    many = 1.1 * solved.influence
    found = some.shift_effects(state, standard, np.array([small, large]), many)
    own = some.shift_effects(state, standard, np.array([small, large]), solved.influence)
    for sign, effect in zip((1.0, -1.0), own.mean(axis=0)[1], strict=True):
        moved = [some.linearised(row + sign * large, np.zeros(len(SOFTENING)))[0] for row in errors]
        expected = np.mean(moved, axis=0) - solved.values.mean(axis=0)
        np.testing.assert_allclose(effect, expected, atol=1e-5 * np.abs(expected).max())
        assert np.abs(expected - sign * solved.influence @ large).max() > 0.01 * np.abs(expected).max()
        np.testing.assert_allclose(
            some.mean_change(state, standard, sign * large), expected, atol=1e-5 * np.abs(expected).max()
        )
    for sign, effect in zip((1.0, -1.0), np.swapaxes(found[:, 0], 0, 1), strict=True):  # each unit's
        np.testing.assert_allclose(effect, [sign * many @ small] * 3, atol=1e-3 * np.abs(many @ small).max())
    state_of = LoadedTurn.state

    def jams(self: LoadedTurn, given: Array, **how: Any) -> Any:
        if np.abs(given).max() > 1.0:
            raise NotConvergedError("no equilibrium")
        return state_of(self, given, **how)

    monkeypatch.setattr(LoadedTurn, "state", jams)
    jammed = some.shift_effects(state, standard, np.array([1e3 * large, large]), many)
    np.testing.assert_allclose(jammed[:, 0], [[1e3 * many @ large, -1e3 * many @ large]] * 3)
    np.testing.assert_array_equal(jammed[:, 1], found[:, 1])
    with pytest.raises(NotConvergedError, match="none of 3 units has an equilibrium with the shift"):
        some.mean_change(state, standard, 1e3 * large)
    with pytest.raises(NotConvergedError, match="none of 3 units has an equilibrium"):
        some.values(state, standard + 1e3 * large / state.deviation[some.parts.process])


def test_an_interval_is_that_of_a_sample_variance() -> None:
    """Of a variance of 50 degrees of freedom: its standard error is v sqrt(2/50), the interval that of chi-square."""
    low, high = interval(4.0, 4.0 * math.sqrt(2 / 50))
    assert (low, high) == pytest.approx((2 * math.sqrt(50 / 71.42), 2 * math.sqrt(50 / 32.36)), rel=1e-3)
    assert interval(1.0, 1.0)[0] == 0
    assert interval(1.0, 1.0)[1] == pytest.approx(math.sqrt(2.96))


def test_a_run_with_a_gap_is_left_out_and_said() -> None:
    """A tenth of a turn without samples: waves of high orders may do anything there."""
    theta = np.delete(THETA, np.arange(40, 53))
    pairs = [LotUnit(str(k), (run(e),)) for k, e in enumerate(noise(1, 4))]
    found = amplitudes_of(MODEL, [*pairs, LotUnit("9", (run(np.zeros(theta.size), theta),))])
    assert found.serials == ("0", "1", "2", "3")
    assert any("unit 9: the run forward at 50 N*m is left out for a gap of 39.4 deg" in note for note in found.notes)


def test_parts_vary_about_the_mean_of_the_drawing() -> None:
    """A clearance of 12 um, which cannot be below none; and a mean that the lot's own mean is told beside."""
    clearance = rverror.tolerance("crank.bearing_clearance", "3 um", mean="12 um")
    parts = UnitParts(processes_of(MODEL, run(THETA), (clearance,)))
    one = replace(simulator(), parts=parts)
    standard = np.array([[0.0], [1.0], [-20.0]])
    errors = one.errors(State(np.array([1e-3]), np.zeros(6)), standard)
    assert errors == pytest.approx(np.array([[12e-3], [13e-3], [0.0]]))


def test_a_lot_of_noise_alone_is_refused_in_one_line() -> None:
    """Noise of 1,000 arcsec beside all that a workshop makes."""
    with pytest.raises(InputError, match="no process shows in these runs at this load"):
        lot(MODEL, units_of(noise(0, 5, 1e3)), tolerances=TOLERANCES)
