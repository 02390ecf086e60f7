"""How a table of a result reads: digits, words, headings, and the verdict before all else."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest

import rverror
from every_kind import every_kind
from rverror import to_html, to_text
from rverror.base.units import ARCSEC
from rverror.diagnosis.next_run import Measurement
from rverror.views import diagnosis_report
from rverror.views.blocks import MOST_ROWS, as_html, as_text, grid
from rverror.views.describing import sheet_of
from rverror.views.shown_units import ANGLE, NUMBER, PERCENT, Unit
from rverror.views.variables import Table, Variable

MM3 = Unit("mm**3", "mm**3")


def text_of(**columns: Variable) -> list[str]:
    """Lines of a table of a dimension "row"."""
    return as_text(sheet_of(Table(columns, kind="Kind", rows="row"))).splitlines()


def column(values: object, unit: Unit | None = NUMBER) -> Variable:
    return Variable(("row",), values, unit)


def test_the_rounding_of_zero_is_zero() -> None:
    """1e-13 of a column's largest is what its floats round; 1e-9 of it is a number."""
    *_, rounding, small = text_of(wave=column([2.5e3, 2.5e-10, 2.5e-6]))
    assert (rounding.strip(), small.strip()) == ("0", "2.5e-06")


def test_a_long_course_says_how_many_of_its_rows_are_shown() -> None:
    """Twenty, from the first to the last; a shorter one is whole."""
    for count, shown in ((30, 20), (20, 20)):
        speeds = Variable(("speed",), np.arange(float(count)), NUMBER)
        error = Variable(("speed",), np.linspace(5.0, 6.0, count), NUMBER)
        lines = as_text(sheet_of(Table({"speed": speeds, "error": error}, kind="Kind", rows="speed"))).splitlines()
        numbers = [line.split()[0] for line in lines if re.match(r" *\d+ +\d", line)]
        assert (len(numbers), numbers[0], numbers[-1]) == (shown, "0", str(count - 1))
        assert ("20 of 30 rows." in lines) == (count > shown)


def test_a_share_has_two_decimals() -> None:
    *_, one, other = text_of(share=column([0.998661, 0.000045], PERCENT))
    assert (one.strip(), other.strip()) == ("99.87", "0")


def test_a_p_value_has_two_digits() -> None:
    assert text_of(chance=column([3.8571e-19]))[-1].strip() == "3.9e-19"


def test_a_direction_is_a_word() -> None:
    *_, one, other = text_of(direction=column([1.0, -1.0]))
    assert (one.strip(), other.strip()) == ("forward", "reverse")


def test_words_have_no_underscores_and_volumes_an_exponent() -> None:
    lines = text_of(part=column(["crank_bearing"], None), volume=column([2.0], MM3))
    assert lines[-2].split() == ["part", "volume,", "mm³"]
    assert lines[-1].split() == ["crank", "bearing", "2"]


def test_bare_ends_of_an_interval_are_those_of_the_column_before_them() -> None:
    sizes = {name: column([value * ARCSEC], ANGLE) for name, value in (("amplitude", 0.2655), ("low", 0.16))}
    lines = text_of(order=column([78.0]), **sizes, high=column([0.37 * ARCSEC], ANGLE), phase=column([1.0]))
    assert lines[-2].split() == ["order", "amplitude,", "arcsec", "interval", "phase"]
    assert lines[-1].split() == ["78", "0.27", "0.16", "to", "0.37", "1"]


def test_a_size_has_the_digits_of_the_half_interval_that_is_known() -> None:
    lines = text_of(p99=column([39.482]), p99_low=column([33.28]), p99_high=column([math.inf]))
    assert lines[-1].split() == ["39", "33", "to", "∞"]


def test_a_size_that_no_row_has_has_no_interval_either() -> None:
    lines = text_of(order=column([78.0]), **{f"p99{end}": column([math.nan]) for end in ("", "_low", "_high")})
    assert lines[-2:] == ["order", "   78"]


@pytest.mark.parametrize(("cell", "counted"), [("crank 0", True), ("disc 1, pin 12", True), ("crank 40", False)])
def test_indices_are_explained_and_orders_of_frames_are_not(cell: str, counted: bool) -> None:
    made = Table({"frames": column([cell], None)}, kind="Kind", rows="row", verdict=("Found", "."))
    assert ("counted from 0" in as_text(sheet_of(made))) is counted


def test_one_measurement_for_two_causes_stands_once(monkeypatch: pytest.MonkeyPatch) -> None:
    found = every_kind()["Diagnosis"][0]
    (addition,) = found.added
    other = replace(addition, effect=rverror.effect("sensor.encoder_ellipticity", cos=0, sin="3 arcsec"))
    step = Measurement("rule", what="a run in reverse", why="it tells", separates=(("sensor.drift", {}),))
    steps = [(addition, step), (None, Measurement("rule", what="a run at another load", why="")), (other, step)]
    monkeypatch.setattr(diagnosis_report, "next_steps", lambda _: steps)
    text = to_text(found)
    assert re.findall(r"Measure next, (\d): (.*?)[:.]", text) == [
        ("1", "a run in reverse"),
        ("2", "a run at another load"),
    ]
    words = " ".join(text.split())
    assert "sensor.encoder_eccentricity from sensor.drift; sensor.encoder_ellipticity from sensor.drift." in words


def test_a_budget_with_limits_at_the_load_begins_with_the_yield_there() -> None:
    found = every_kind()["ErrorBudget"][0]
    one = found.at_load.verified.limits[0]
    limited = replace(one, limit=replace(one.limit, value=1e-9))  # which no unit meets
    verified = replace(found.at_load.verified, limits=(limited,), together=0.0, together_interval=(0.0, 0.21))
    text = to_text(replace(found, at_load=replace(found.at_load, verified=verified)))
    assert text.splitlines()[1].startswith(
        f"0 % of the units meet the limit of the {one.limit.label} under load (0 to 21)"
    )
    assert "Closed form: 99 % of the units stay within" in text
    assert to_text(found).splitlines()[1].startswith("99 % of the units stay within")


@pytest.mark.parametrize("kind", ["Efficiencies", "DutyEfficiency"])
def test_several_efficiencies_have_their_bars(kind: str) -> None:
    assert "<figure>" in to_html(every_kind()[kind][0])


def test_modes_begin_with_the_lowest_of_the_machine() -> None:
    found = every_kind()["Modes"][0]
    support = np.zeros(found.frequency.size, dtype=bool)
    support[:2] = True
    rest = replace(found, of_sun_support=support)
    lowest = next(f for f, sun in zip(rest.frequency, support, strict=True) if f > 0 and not sun)
    assert f"Lowest mode of the machine: {lowest:.4g} Hz, mode 3;" in to_text(rest)


def test_a_run_up_begins_with_its_error_and_the_speed_of_its_vibration() -> None:
    found = every_kind()["RunUp"][0]
    vibration = np.zeros(found.time.size)
    vibration[[1, 2]] = 3 * ARCSEC, -7 * ARCSEC
    shaken = replace(found, transmission_error=found.crawl + found.windup + vibration)
    speed, error = found.speed[2] * 30 / math.pi, np.ptp(shaken.transmission_error) / ARCSEC
    verdict = f"Peak-to-peak of the error {error:.4g} arcsec; the vibration is largest at {speed:.4g} rpm: 7 arcsec."
    assert to_text(shaken).splitlines()[1] == verdict


def test_results_begin_with_what_they_say() -> None:
    kinds = {name: some[0] for name, some in every_kind().items()}
    state, curve, duty = kinds["Equilibrium"], kinds["TorsionCurve"], kinds["DutyEfficiency"]
    contacts = ("pin", "cam", "carrier", "mesh")
    sizes = {name: np.sqrt((state.contact_forces[name] ** 2).sum(axis=-2)).max() for name in contacts}
    strongest = max(sizes, key=lambda name: sizes[name])
    wide = (state.transmission_error.max() - state.transmission_error.min()) / ARCSEC
    torque, turned = max(zip(curve.torque, curve.angle, strict=True), key=lambda one: abs(one[0]))
    out, into = duty.power
    most = sorted(kinds["Budget"].contributions, key=lambda one: one.share)[-1]
    for name, verdict in {
        "Equilibrium": f"Peak-to-peak {wide:.4g} arcsec; largest contact force {sizes[strongest]:.4g} N ({strongest}).",
        "TorsionCurve": f"Output turns by {turned.mean() / ARCSEC:.4g} arcsec at {torque / 1e3:.4g} N*m.",
        "DutyEfficiency": f"Mean efficiency {100 * out / into:.3g} %; housing at {duty.housing - 273.15:.3g} degC.",
        "Budget": f"{most.label} has the largest share, {100 * most.share:.0f} % of the variance.",
    }.items():
        assert to_text(kinds[name]).splitlines()[1] == verdict
    assert re.fullmatch(
        r"99 % of the units stay within \d+ arcsec peak-to-peak \(.+\)\.",
        to_text(kinds["VirtualUnits"]).splitlines()[1],
    )


def test_a_table_of_links_is_shown_whole() -> None:
    count = MOST_ROWS + 6
    page = as_html(grid(("unit", "state"), [(f"u&{n}", "") for n in range(count)], [f"{n}.html" for n in range(count)]))
    assert page.count("<a href=") == count
    assert '<td><a href="29.html">u&amp;29</a></td>' in page
