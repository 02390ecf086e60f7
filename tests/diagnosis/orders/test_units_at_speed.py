"""Units measured at several speeds: sizes of their errors with and without what natural frequencies add, and flags."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import rverror
from at_speed import CAM, RING, RPM, at_speed, with_load
from gear_runs import red
from rverror.diagnosis.orders.tables import diagnose_tables
from rverror.diagnosis.policy import POLICY
from rverror.diagnosis.result import Diagnosis
from rverror.dynamics import SpeedResponse
from rverror.model.effects import Model
from rverror.runs.order_table import OrderTable

UM = 1e-3  # mm
KEYS = (RING.key, CAM.key)
RULES = replace(POLICY, keys=KEYS, refit_stiffness=False)
NO_SEARCH = replace(RULES, keys=("sensor.drift",))  # of which a table tells nothing


@pytest.fixture(scope="module")
def table() -> OrderTable:
    """A ring that is no circle, at two loads and both directions, with a load that swings at 36 Hz."""
    model = with_load(RING)
    cases = [
        case
        for torque in (60e3, 120e3)
        for way in (1.0, -1.0)
        for case in at_speed(model, torque=torque, direction=way, orders=(40.0, 78.0, 156.0)).cases(noise=0.05, seed=1)
    ]
    return OrderTable(cases=tuple(cases))


@pytest.fixture(scope="module")
def corrected(table: OrderTable) -> Diagnosis:
    """By a model that says nothing of the bench."""
    return diagnose_tables(Model(rverror.reducer("RV-40E")), [table], lambda _: None, policy=RULES)


def ring_of(found: Diagnosis) -> tuple[float, float, float]:
    """Size of the wave of two around the pins, um."""
    (added,) = [one for one in found.added if one.effect.key == RING.key and one.effect.indices["harmonic"] == 2]
    (size,) = [one for one in added.estimates if one.name == "radial_cos"]
    return size.low / UM, size.value / UM, size.high / UM


def test_the_size_of_an_error_is_corrected_for_a_natural_frequency(
    table: OrderTable, corrected: Diagnosis, monkeypatch: pytest.MonkeyPatch
) -> None:
    """6 um; without the correction what swings counts as error."""
    unit, found = Model(rverror.reducer("RV-40E")), corrected
    low, value, high = ring_of(found)
    assert low <= 6.0 <= high
    assert value == pytest.approx(6.0, abs=0.5)
    assert found.resonances[0].orders == (78.0, 156.0)
    monkeypatch.setattr("rverror.diagnosis.orders.resonances._LEAST_SPEEDS", 10**6)
    blind = diagnose_tables(unit, [table], lambda _: None, policy=RULES)
    assert blind.resonances == ()
    sizes = [one for one in blind.added if one.effect.key == RING.key and one.effect.indices["harmonic"] == 2]
    assert not sizes or not ring_of(blind)[0] <= 6.0 <= ring_of(blind)[2]
    # the declared model knows of neither: what is left of the waves as measured
    measured = math.sqrt(np.mean([0.5 * float(np.sum(np.abs(case.waves) ** 2)) for case in table.cases]))
    assert found.before.rms == pytest.approx(measured, rel=1e-3)
    assert found.after.rms < 0.1 * found.before.rms


@pytest.fixture(scope="module")
def responses() -> dict[float, SpeedResponse]:
    """A wave of two at the pins, fourteen speeds each way."""
    speeds = [f"{n} rpm" for n in RPM]
    return {
        way: rverror.dynamics.speed_response(with_load(RING), speeds, torque=100e3, kept=2, direction=way)
        for way in (1.0, -1.0)
    }


def runs_of_speeds(responses: dict[float, SpeedResponse], noise: float) -> dict[float, list[rverror.Run]]:
    """One turn of each."""
    unit = rverror.reducer("RV-40E")
    runs: dict[float, list[rverror.Run]] = {1.0: [], -1.0: []}
    for way, own in runs.items():
        response = responses[way]
        every = response.theta.size // 1024
        theta = response.theta[::every]
        for number, (speed, error) in enumerate(zip(response.speed, response.transmission_error, strict=True)):
            own.append(
                rverror.run_from_arrays(
                    input_angle=unit.ratio * theta[:: int(way)],
                    te=error[::every][:: int(way)] + red(number, theta.size, noise),
                    time=theta * unit.ratio / speed,
                    direction="forward" if way > 0 else "reverse",
                    torque="100 N*m",
                )
            )
    return runs


def test_causes_come_from_the_slowest_runs(responses: dict[float, SpeedResponse]) -> None:
    """All runs as they stand fit no size at any speed but the least; the slowest two hold it."""
    runs, unit = runs_of_speeds(responses, 0.5), Model(rverror.reducer("RV-40E"))
    found = rverror.diagnose(unit, [*runs[1.0], *runs[-1.0]], policy=RULES)
    assert found.verdict == "explained"
    low, value, high = ring_of(found)
    assert low <= 6.0 <= high
    assert value == pytest.approx(6.0, abs=0.2)
    assert any("2 of 28" in note for note in found.notes)


def test_runs_of_several_speeds_tell_what_their_table_tells(responses: dict[float, SpeedResponse]) -> None:
    """Frequency and flags forward, the size from a table of all."""
    model, unit, runs = with_load(RING), rverror.reducer("RV-40E"), runs_of_speeds(responses, 0.1)
    found = rverror.diagnose(Model(unit), runs[1.0], policy=replace(RULES, keys=("sensor.drift",), looks=0))
    (one,) = found.resonances
    truth = at_speed(model, torque=100e3, rpm=(100.0,)).frequency
    assert one.low <= truth <= one.high
    assert set(rverror.to_json(found)["resonances"][0]) == {"frequency_hz", "low", "high", "damping_ratio"}
    assert any(note.startswith("near a critical speed: ") for note in found.notes)
    assert any("order_table_from_runs" in note and "1 of 14" in note for note in found.notes)
    assert len(found.traces) == 1
    table = rverror.runs.order_table_from_runs([*runs[1.0], *runs[-1.0]], unit, (40, 78, 156, 200))
    low, value, high = ring_of(rverror.diagnose(Model(unit), [table], policy=RULES))
    assert low <= 6.0 <= high
    assert value == pytest.approx(6.0, abs=0.5)


def test_the_models_own_natural_frequency_flags_conditions_too(table: OrderTable) -> None:
    """With few speeds nothing is found; the model that knows its load says where orders are magnified."""
    few = replace(table, cases=tuple(case for case in table.cases if (case.condition.input_speed or 0) > 200))
    found = diagnose_tables(with_load(), [few], lambda _: None, policy=NO_SEARCH)
    assert found.resonances == ()
    (flag,) = [note for note in found.notes if note.startswith("near a critical speed") and "36" in note]
    assert "the model's" in flag
    silent = diagnose_tables(Model(rverror.reducer("RV-40E")), [few], lambda _: None, policy=NO_SEARCH)
    assert not [note for note in silent.notes if "critical" in note]


def test_a_frequency_is_tied_to_the_mode_that_makes_it(table: OrderTable, corrected: Diagnosis) -> None:
    """The model that knows the load has the mode; one that says nothing of the bench does not reach it."""
    knows = diagnose_tables(with_load(), [table], lambda _: None, policy=NO_SEARCH)
    for found, said in ((knows, "so it can be this mode"), (corrected, "does not reach")):
        (note,) = [note for note in found.notes if "of the model's modes" in note]
        assert said in note
        assert ("[bench]" in note) == (found is corrected)


def test_what_is_told_of_natural_frequencies(corrected: Diagnosis) -> None:
    text, page = rverror.to_text(corrected), rverror.to_html(corrected)
    for words in ("Natural frequencies from orders against speed", "78, 156", "near a critical speed"):
        assert words in text
        assert words in page
