"""The page of the error at speed: its text is what the code gives, and what it claims follows by hand."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest
import speed_page

import rverror
from pages import DOCS, text
from rverror.dynamics import modes
from rverror.model import Bench

PAGE = DOCS / "theory" / "error-at-speed.md"
RPM = math.pi / 30
ARCSEC = math.pi / 648000
NUMBER = re.compile(r"\d+(?:\.\d+)?")


def table(head: str) -> list[list[str]]:
    """Rows of the table of the page whose first column has a head."""
    lines = text(PAGE).splitlines()
    first = next(at for at, line in enumerate(lines) if line.startswith(f"| {head} |"))
    rows = []
    for line in lines[first + 2 :]:
        if not line.startswith("|"):
            break
        rows.append([cell.strip() for cell in line.strip("|").split("|")])
    return rows


def test_the_page_is_what_the_code_gives() -> None:
    """To one unit in the last place of a number, which another machine may round the other way."""
    stale = (
        "docs/theory/error-at-speed.md is out of date: python docs/_ext/speed_page.py > docs/theory/error-at-speed.md"
    )
    written, made = text(PAGE), speed_page.markdown()
    assert NUMBER.split(written) == NUMBER.split(made), stale
    for one, other in zip(NUMBER.findall(written), NUMBER.findall(made), strict=True):
        unit = 10.0 ** -len(one.partition(".")[2])
        assert abs(float(one) - float(other)) < 1.01 * unit, f"{stale}: {one} is {other}"


@pytest.mark.parametrize("name", speed_page.PICTURES)
def test_pictures_of_the_page_are_drawn_with_their_words(name: str) -> None:
    drawn, words = speed_page.picture(name), speed_page.PICTURES[name][3]
    assert drawn.startswith(f'<figure class="drawn"><svg role="img" aria-label="{words}" ')
    assert drawn.count(words) == 2
    assert f"<!-- picture: {name} -->" in text(PAGE)


def test_the_code_on_the_page_is_its_example() -> None:
    """The model that a reader makes is the one of which the page tells."""
    made: dict[str, object] = {}
    (code,) = re.findall(r"```python\n(.*?)```", text(PAGE), flags=re.DOTALL)
    exec(code, made)
    assert made["model"] == speed_page.MODEL


def test_orders_and_what_they_drive() -> None:
    orders = rverror.geartrain.fundamental_orders(speed_page.MODEL.mechanism)
    found = {
        int(k): float(f)
        for row in table("order")[:5]
        for k, f in zip(row[0].split(","), row[2].split(","), strict=True)
    }
    for order, frequency in found.items():
        assert frequency == order * 15 / 60
    assert set(orders.values()) - {1.0} <= set(found)  # order 1 comes from outside


def test_peaks_stand_where_orders_meet_the_first_frequency() -> None:
    first = speed_page.first_frequency(speed_page.ARM)
    lines = text(PAGE).splitlines()
    rows = [line for line in lines if re.match(r"\| \d+ \| [a-z ]+ \| [\d.]+ \| \d+ \|", line)]
    assert len(rows) == 6
    for line in rows:
        order, _, crawl, speed, frequency, amplitude, times = (cell.strip() for cell in line.strip("|").split("|"))
        assert float(speed) == pytest.approx(60 * first * 121 / float(order), rel=0.02)
        assert float(frequency) == pytest.approx(first, rel=0.02)
        assert float(times) == pytest.approx(math.hypot(1, 1 / 0.06), rel=0.05)
        rounded = 0.05 + 0.5 * float(crawl) + 0.005 * float(times)
        assert float(amplitude) == pytest.approx(float(crawl) * float(times), abs=rounded)
    assert int(rows[0].split("|")[1]) == 78


def test_the_cam_leads_at_a_crawl_and_not_at_speed() -> None:
    found = speed_page.response()
    assert found.order[np.abs(found.crawl_waves).argmax()] == 40
    assert found.order[np.unravel_index(np.abs(found.waves).argmax(), found.waves.shape)[1]] == 78
    assert max(share.max() for share in found.pulled.values()) < 0.01


def test_remedies_do_what_is_said() -> None:
    rows = {row[0]: [float(cell) for cell in row[1:]] for row in table("change")}
    own = rows["as it is"]
    assert set(rows) == set(speed_page.remedies())
    for name in ("half the ovality of the pin circle", "half the clearance", "twice the damping"):
        assert rows[name][0] == own[0]
        assert rows[name][1] < own[1]
    assert rows["contacts stiffer by a quarter"][0] / own[0] == pytest.approx(math.sqrt(1.25), abs=0.005)
    assert rows["contacts stiffer by a quarter"][3] > own[3]  # a peak moved to where it works
    assert rows["a quarter of the inertia"][0] / own[0] == pytest.approx(2, abs=0.01)
    assert rows["a quarter of the inertia"][1] < own[1] / 3
    # a peak of one order halves
    for change in ("as it is", "twice the damping"):
        assert speed_page.response(change).critical_speeds[0].order == 78
    whole, damped = (speed_page.response(one).critical_speeds[0].amplitude for one in ("as it is", "twice the damping"))
    assert damped / whole == pytest.approx(0.5, abs=0.02)


def test_a_run_up_passes_the_peaks_with_less() -> None:
    run, found = speed_page.running(), speed_page.response()
    still = np.ptp(found.transmission_error - found.crawl, axis=1).max()
    assert np.ptp(run.vibration[run.time <= 1]) < 0.3 * still
    # order 80 passes faster than its damping lets it grow
    w = 2 * math.pi * speed_page.first_frequency(speed_page.ARM)
    rate = 80 * np.gradient(run.speed, run.time) / 121
    assert rate[np.searchsorted(run.speed[run.time <= 1], w / 80 * 121)] > 2 * (0.03 * w) ** 2
    assert run.output_torque.max() > 412e3 + 20e3 * 1.5 * 1815 * RPM / 121
    assert run.output_torque.min() > 0


def test_the_measured_frequency_is_that_of_a_load_on_the_measured_windup() -> None:
    """J = k / (2 pi f)^2; with the output held, the input's, the sun's and the cranks' make the same inertia."""
    stiffness = speed_page.MEASURED_STIFFNESS / math.radians(1 / 60)
    for frequency in (51.0, 51.5, 52.5):
        assert speed_page.load_81(frequency) == pytest.approx(stiffness / (2 * math.pi * frequency) ** 2, rel=0.03)
    unit = speed_page.unit_81_as_stiff_as_measured()
    assert unit.ratio == 81
    own = modes(rverror.Model(unit, bench=Bench()), torque="1000 N*m").inertia
    assert own.sun_inertia is not None
    assert own.crank_inertia is not None
    # the sun turns 81 times, the cranks 81 * 22 / 44 times against a held carrier
    reflected = 81**2 * (speed_page.input_81(51.5) + own.sun_inertia / 1e3) + 3 * 40.5**2 * own.crank_inertia / 1e3
    assert reflected == pytest.approx(speed_page.load_81(51.5), rel=0.05)


def test_the_guesses_matter_little_once_the_windup_is_the_measured_one() -> None:
    """Two cranks and thin pins in place of three and thick ones: the same load to a few per cent."""
    other = replace(speed_page.unit_81(), cranks=2, pin_radius=4.0)
    stiffness = np.mean(rverror.statics.torsional_stiffness(rverror.Model(other), np.linspace(0, 0.1, 9)))
    scale = speed_page.MEASURED_STIFFNESS / (stiffness * math.radians(1 / 60) / 1e3)
    scaled = replace(speed_page.unit_81(scale), cranks=2, pin_radius=4.0)
    inertia = speed_page.load_81(51.5)
    frequency = speed_page.first_frequency(Bench(load_inertia=1e3 * inertia), scaled, torque=1e6)
    assert frequency == pytest.approx(51.5, rel=0.03)
