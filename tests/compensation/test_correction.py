"""The correction: sign and factor, proven by a joint that has it in its command path, and the limits of its forms."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rverror
from gear_runs import UNIT
from rverror.compensation.correction import Correction, from_effects, wave_sum
from rverror.compensation.making import CompensatedOrder, Compensation, HeldError
from rverror.compensation.table_files import by_points, held_by
from rverror.runs.order_table import OrderCase, OrderTable, TableCondition

ARCSEC = np.pi / 648000
FORWARD, REVERSE = TableCondition(direction=1.0, torque=50e3), TableCondition(direction=-1.0, torque=50e3)


def correction_of(orders: dict[float, complex], ratio: float = 49.0, **more: Any) -> Correction:
    """The same waves in both directions, arcsec."""
    k = np.array(list(orders), dtype=float)
    z = np.array(list(orders.values())) * ARCSEC
    cases = tuple(OrderCase(condition=c, orders=k, waves=z) for c in (FORWARD, REVERSE))
    return Correction(ratio, OrderTable(cases=cases), **more)


def compensation_of(correction: Correction, rms: float = 1.0) -> Compensation:
    held = HeldError(rms * ARCSEC, math.nan, math.nan)
    orders = tuple(CompensatedOrder(k, (), ARCSEC, ARCSEC, "measured") for k in correction.orders.tolist())
    return Compensation(correction, orders, held, held, rverror.Model(rverror.Drive(ratio=correction.ratio)))


def joint(error: Callable[[np.ndarray], np.ndarray], ratio: float, command: np.ndarray) -> np.ndarray:
    """Where the output of a joint goes whose input is told an angle: nominal angle and the error there."""
    nominal = command / ratio
    return nominal + error(nominal)


@pytest.mark.parametrize("ratio", [49.0, -14.0])
@pytest.mark.parametrize("form", ["waves", "csv", "json", "linuxcnc"])
def test_a_joint_with_the_table_in_its_command_path_has_less_error(form: str, ratio: float, tmp_path: Path) -> None:
    """The joint is a function of the input's angle alone; what is read back from the file is added to its command."""
    waves = {1.0: 40 - 30j, 39.0: 6j, 40.0: 3 + 2j}
    te = correction_of(waves).table.cases[0]
    made = correction_of({k: -z for k, z in waves.items()}, ratio)
    table: Any = made
    if form != "waves":
        rverror.compensation.save_compensation(tmp_path / "table", compensation_of(made), format=form)
        table = rverror.compensation.load_compensation(tmp_path / "table", ratio)
    theta = np.linspace(-7.0, 9.0, 4001)
    for condition in (FORWARD, REVERSE):
        error = lambda angle: wave_sum(angle, te.orders, te.waves)  # noqa: E731
        plain = joint(error, ratio, ratio * theta) - theta
        added = table.at(theta, condition)
        right = joint(error, ratio, ratio * (theta + added)) - theta
        wrong = joint(error, ratio, ratio * (theta - added)) - theta
        left = 0.12 if form == "linuxcnc" else 0.01
        assert np.sqrt(np.mean(right**2)) < left * np.sqrt(np.mean(plain**2))
        assert np.sqrt(np.mean(wrong**2)) == pytest.approx(2 * np.sqrt(np.mean(plain**2)), rel=0.1)


def test_points_are_solved_for_where_the_input_then_stands(tmp_path: Path) -> None:
    """So large a wave that to first order 35 arcsec of it stay: a table by points leaves what is between them."""
    made = correction_of({40.0: -600.0})
    written = rverror.compensation.save_compensation(tmp_path / "t.csv", compensation_of(made))
    table = rverror.compensation.load_compensation(tmp_path / "t.csv", 49.0)
    theta = np.linspace(0, 2 * np.pi, 4001)
    moved = theta + table.at(theta, FORWARD)
    left = moved + 600 * ARCSEC * np.cos(40 * moved) - theta
    assert np.sqrt(np.mean(left**2)) < 1.5 * written.between


def test_the_csv_table_is_added_to_the_inputs_command(tmp_path: Path) -> None:
    """Read as its header says, without rverror: input command = ratio * output angle + correction, degrees."""
    made = correction_of({3.0: -20.0}, ratio=-14.0)
    rverror.compensation.save_compensation(tmp_path / "t.csv", compensation_of(made))
    lines = (tmp_path / "t.csv").read_text().splitlines()
    assert "# added: input command = ratio * output_angle + correction" in lines
    rows = np.array([[float(cell) for cell in line.split(",")] for line in lines if line[0].isdigit()])
    command = np.radians(-14.0 * rows[:, 0] + rows[:, 1])
    output = command / -14.0 + 20 * ARCSEC * np.cos(3 * command / -14.0)
    np.testing.assert_allclose(output, np.radians(rows[:, 0]), atol=0.01 * ARCSEC)


def test_the_csv_table_names_a_direction_without_a_run(tmp_path: Path) -> None:
    """Its column is zero; a controller that is set by the file alone must be able to see why."""
    both = correction_of({3.0: -20.0})
    one = replace(both, table=replace(both.table, cases=both.table.cases[:1]))
    for name, made in (("both", both), ("forward", one)):
        rverror.compensation.save_compensation(tmp_path / name, compensation_of(made))
        said = "# reverse: not measured, so nothing is added" in (tmp_path / name).read_text().splitlines()
        reverse = rverror.compensation.load_compensation(tmp_path / name, both.ratio).reverse
        assert said == (not reverse.any()) == (name == "forward")


def test_the_json_table_is_applied_as_its_own_sentence_says(tmp_path: Path) -> None:
    """Read without rverror: the sentence under "added" is the formula, its sign with it."""
    made = correction_of({3.0: -20.0 + 5j}, ratio=-14.0)
    rverror.compensation.save_compensation(tmp_path / "t.json", compensation_of(made), format="json")
    data = json.loads((tmp_path / "t.json").read_text())
    formula = re.fullmatch(
        r"input command = ratio \* \(theta \+ sum of (.*) \+ (.*)\), theta the output .*", data["added"]
    )
    assert formula is not None
    theta = np.linspace(0, 2 * np.pi, 721)
    names = {"theta": theta, "cos": np.cos, "sin": np.sin}
    (one,) = [case for case in data["conditions"] if case["direction"] == "forward"]
    total = sum(eval(part, {**names, **wave}) for wave in one["waves"] for part in formula.groups())
    nominal = theta + ARCSEC * total
    output = nominal + wave_sum(nominal, np.array([3.0]), -made.table.cases[0].waves)
    np.testing.assert_allclose(output, theta, atol=0.01 * ARCSEC)


def test_linuxcnc_adds_nominal_less_forward(tmp_path: Path) -> None:
    """As its source reads a file of type 0: bare triplets, growing, 256 at most; trim = nominal - forward."""
    made = correction_of({2.0: -30.0})
    rverror.compensation.save_compensation(tmp_path / "t.comp", compensation_of(made), format="linuxcnc")
    rows = np.array([[float(cell) for cell in line.split()] for line in (tmp_path / "t.comp").read_text().splitlines()])
    assert rows.shape == (256, 3)
    assert (np.diff(rows[:, 0]) > 0).all()
    assert rows[0, 0] == 0
    assert rows[-1, 0] == 360
    # the joint leads by 30 arcsec at its zero: it arrives there
    assert rows[0, 1] * 3600 == pytest.approx(30, abs=0.01)
    trim = rows[:, 0] - rows[:, 1]
    np.testing.assert_allclose(trim * 3600, -30 * np.cos(2 * np.radians(rows[:, 0])), atol=0.01)


def test_an_equilibrium_with_the_table_errs_less() -> None:
    """The error of the loaded gear train itself, solved where the input stands after the correction."""
    model = rverror.Model(
        UNIT,
        (
            rverror.effect("crank.eccentricity", crank=0, disc=1, radial="6 um", tangential="3 um"),
            rverror.effect("sensor.encoder_eccentricity", cos="30 arcsec"),
        ),
    )
    theta = 2 * np.pi * np.arange(1024) / 1024
    te = rverror.equilibrium(model, theta, torque=50e3, direction=1.0).transmission_error
    run = rverror.run_from_arrays(
        input_angle=UNIT.ratio * np.concatenate([theta, theta + 2 * np.pi]),
        te=np.tile(te, 2),
        direction="forward",
        torque=50e3,
    )
    made = rverror.compensate(rverror.Model(UNIT), [run])
    moved = theta + made.correction.at(theta, FORWARD)
    output = moved + rverror.equilibrium(model, moved, torque=50e3, direction=1.0).transmission_error
    left = output - theta
    assert np.std(left) < 0.02 * np.std(te)


def test_between_points_a_straight_line_leaves_the_sagitta_of_a_wave() -> None:
    """At the crest between two points cos(pi k / N) of it is left; the rms is that of c - c sinc^2-like chords."""
    for count in (64, 256, 1024):
        order = 8.0
        found = correction_of({order: 10.0}).between(count, FORWARD) / ARCSEC
        worst = 10 * (1 - math.cos(math.pi * order / count))
        assert 0.3 * worst < found < worst
    # the error of linear interpolation is of second order: half the step, a quarter of it
    assert correction_of({order: 10.0}).between(2048, FORWARD) / ARCSEC == pytest.approx(found / 4, rel=0.02)


def test_the_number_of_points_follows_from_the_highest_order_and_what_may_be_left() -> None:
    few, many = (correction_of({k: 10.0}).points(FORWARD, 0.1 * ARCSEC) for k in (5.0, 40.0))
    assert many == 8 * few
    assert correction_of({5.0: 10.0}).between(few, FORWARD) <= 0.1 * ARCSEC
    assert correction_of({5.0: 10.0}).between(few // 2, FORWARD) > 0.1 * ARCSEC


@pytest.mark.parametrize("order", [1.0, 40.0, 60.0])
def test_a_zero_that_slips_leaves_twice_the_sine_of_half_the_phase(order: float) -> None:
    made = correction_of({order: 10.0})
    theta = 2 * np.pi * np.arange(4096) / 4096
    slip = math.radians(1)
    rest = made.at(theta + slip, FORWARD) - made.at(theta, FORWARD)
    assert made.slipped(slip, FORWARD) == pytest.approx(np.sqrt(np.mean(rest**2)), rel=1e-9)
    assert made.slipped(slip, FORWARD) / ARCSEC == pytest.approx(10 / math.sqrt(2) * 2 * math.sin(order * slip / 2))


def test_a_models_effects_hold_the_correction_and_give_it_back(tmp_path: Path) -> None:
    made = correction_of({1.0: 3 - 4j, 73.857: 2j}, ratio=73.857)
    effects = made.effects()
    back = from_effects(73.857, effects)
    for case, again in zip(made.table.cases, back.table.cases, strict=True):
        np.testing.assert_array_equal(case.orders, again.orders)
        np.testing.assert_allclose(case.waves, again.waves, rtol=1e-15)
    model = rverror.Model(rverror.Drive(ratio=73.857), effects)
    rverror.save_model(tmp_path / "m.toml", model)
    assert rverror.load_model(tmp_path / "m.toml") == model
    theta = np.linspace(0, 7, 50)
    for condition in (FORWARD, REVERSE):
        error = rverror.transmission_error(model, theta, direction=condition.direction)
        np.testing.assert_allclose(error, made.at(theta, condition), atol=1e-15)


def test_between_loads_straight_beyond_them_as_at_the_last() -> None:
    at = [TableCondition(direction=1.0, torque=t) for t in (10e3, 30e3)]
    waves = (np.array([1.0 + 0j]), np.array([3.0 + 2j]))
    made = Correction(
        9.0,
        OrderTable(cases=tuple(OrderCase(condition=c, orders=np.ones(1), waves=w) for c, w in zip(at, waves))),  # noqa: B905
    )
    found = [complex(made.waves(TableCondition(direction=1.0, torque=t))[1][0]) for t in (5e3, 10e3, 20e3, 30e3, 99e3)]
    assert found == [1, 1, 2 + 1j, 3 + 2j, 3 + 2j]
    assert made.at(np.ones(2), REVERSE).tolist() == [0, 0]


def test_a_form_holds_what_it_can() -> None:
    made = correction_of({1.0: 1.0, 40.5: 1.0, 63.0: 1.0, 64.0: 1.0, 240.0: 1.0})
    assert held_by(made, "json").tolist() == [1, 40.5, 63, 64, 240]
    assert held_by(made, "csv").tolist() == [1, 63, 64, 240]
    assert held_by(made, "linuxcnc").tolist() == [1, 63]
    part = correction_of({64.0: 1.0, 40.5: 1.0}, reach=(0.0, math.pi / 2))
    assert held_by(part, "linuxcnc").tolist() == [40.5, 64]


def test_a_table_of_part_of_a_turn_ends_where_it_was_measured() -> None:
    table = by_points(correction_of({4.5: 10.0}, reach=(0.5, 1.5)), None, 101)
    assert (table.angle[0], table.angle[-1]) == (0.5, 1.5)
    ends = table.at(np.array([-3.0, 0.5, 1.5, 4.0]), FORWARD)
    assert ends[0] == ends[1]
    assert ends[2] == ends[3]


def write(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("nominal forward\n", "no compensation table .could not convert string to float: 'nominal'"),
        ("0 0 0\n1 0\n", "no compensation table"),
        ("1 0 0\n0 0 0\n", "growing angles"),
        ("{}", "no compensation table"),
        ("# kind: orders\norder,amplitude\n1,2\n", "no compensation table"),
        ("# kind: compensation\n# ratio: 49.0\noutput_angle[deg],forward[deg],reverse[deg]\n", "two or more rows"),
        ("0 0 nan\n1 0 0\n", "all finite"),
    ],
)
def test_what_is_no_table_is_refused(text: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(rverror.InputError, match=words):
        rverror.compensation.load_compensation(write(tmp_path / "t", text), 49.0)


@pytest.mark.parametrize("form", ["csv", "json"])
def test_a_table_for_another_ratio_is_refused(form: str, tmp_path: Path) -> None:
    rverror.compensation.save_compensation(tmp_path / "t", compensation_of(correction_of({3.0: 1.0})), format=form)
    with pytest.raises(rverror.InputError, match="made for a ratio of 49, the model's is 121; make a table for it"):
        rverror.compensation.load_compensation(tmp_path / "t", 121.0)


def test_an_existing_file_and_an_unknown_form_are_refused(tmp_path: Path) -> None:
    made = compensation_of(correction_of({3.0: 1.0}))
    rverror.compensation.save_compensation(tmp_path / "t", made)
    with pytest.raises(rverror.InputError, match="exists"):
        rverror.compensation.save_compensation(tmp_path / "t", made)
    with pytest.raises(rverror.InputError, match="must be one of csv, json, linuxcnc"):
        rverror.compensation.save_compensation(tmp_path / "u", made, format="xml")
