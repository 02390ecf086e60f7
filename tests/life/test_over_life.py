"""What grows in one unit: lives of the trial's simulator, which solves exact poses and knows more than the model."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import rverror
from pages import ROOT
from rverror.app.command_line import main
from rverror.base.units import ARCSEC
from rverror.life.growth import Course, Term
from rverror.life.over_life import remaining
from rverror.life.result import Remaining, Trend
from rverror.life.sessions import history_of, sessions_of
from rverror.life.unit_state import unit_state
from rverror.lots.result import Interval
from rverror.views.life_report import remaining_words

sys.path.append(str(ROOT))

from benchmarks.trend_trial import make

SESSIONS = 7


@pytest.fixture(scope="module")
def life(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """A planet whose pitch error grows by some um, at 60 N*m, measured on a bench that is mounted anew each time."""
    folder = tmp_path_factory.mktemp("life")
    with (
        pytest.MonkeyPatch.context() as patch
    ):  # 256 samples have orders up to 128: three waves of what turns with a planet
        patch.setattr(make, "SAMPLES", make.SAMPLES // 2)
        patch.setattr(make, "THETA", make.THETA[::2])
        make.write(make.simulate(7, "growing", SESSIONS), folder / "runs")
    truth = json.loads((folder / "runs" / "truth.json").read_text(encoding="utf-8"))
    (folder / "runs" / "model.toml").rename(folder / "model.toml")
    return folder, truth


def said(folder: Path, *words: str) -> dict[str, Any]:
    assert main([*words, "--json", str(folder / "found.json")]) == 0
    return dict(json.loads((folder / "found.json").read_text(encoding="utf-8")))


def test_time_that_remains_is_that_at_which_the_limit_is_passed() -> None:
    """Lost motion of 60 arcsec that a known play opens by 0.02 arcsec an hour, linear: 90 arcsec 1500 hours later."""
    at, size = np.array([0.0, 100, 250, 400, 500]), 10 * rverror.ARCSEC
    columns = np.array([0.0, 2.0])  # arcsec of lost motion per arcsec of size
    history = SimpleNamespace(
        at=at, rows=np.array([[1.0, 0.0], [0.0, 1.0]]), lost_motion=(1,),
        amplitudes=SimpleNamespace(values=np.zeros((5, 2)) + np.array([0.0, 55 * rverror.ARCSEC])),
    )  # fmt: skip
    course = Course("linear", 0.0, 500.0)
    fit = SimpleNamespace(
        terms=(Term(0, course),), sizes=(np.array([size / 2]),), covariance=(np.array([[(size / 20) ** 2]]),)
    )
    search = SimpleNamespace(
        unit=SimpleNamespace(history=history, influences=columns[None, :, None]),
        components=np.ones((1, 1)), places=(np.array([0]),), ways=lambda found, number: (np.array([1.0]), [fit]),
    )  # fmt: skip
    made = course.grown(at)[:, None] * columns * size / 2
    made = made - made.mean(axis=0) + made.mean(axis=0)
    left = remaining(cast(Any, search), cast(Any, fit), made, rverror.limit("lost_motion", "90 arcsec"))
    now = 55 + 10 * (1 - course.grown(at).mean())
    assert left.now == pytest.approx(now * rverror.ARCSEC)
    assert left.time is not None
    # 10 arcsec in 500 hours; times are told to a tenth
    assert left.time.value == pytest.approx((90 - now) / 10 * 500, rel=0.12)
    assert left.time.low < left.time.value < left.time.high < 1.4 * left.time.value


def test_what_grows_is_named_with_its_rate_and_how_long_it_lasts(
    life: tuple[Path, dict[str, Any]], capsys: pytest.CaptureFixture[str]
) -> None:
    folder, truth = life
    change = truth["change"]
    page = str(folder / "page.html")
    model = str(folder / "model.toml")
    limit = ("--limit", "transmission error 90 arcsec")
    found = said(folder, "trend", str(folder / "runs"), "--model", model, *limit, "--html", page)
    assert "1 cause grows" in capsys.readouterr().out
    assert not found["jumps"]
    named = found["growing"][0]
    places = [(named["key"], named["indices"]), *((o["key"], o["indices"]) for o in named["indistinguishable_from"])]
    assert (change["key"], change["indices"]) in places
    assert {one["key"] for one in found["growing"]} == {change["key"]}
    if named["indices"] == change["indices"]:
        for one in found["growing"]:
            low, high = one["interval"]
            assert low < change["rate_per_hour"][one["parameter"]] < high
    variables = found["variables"]
    # the mounting of the last session is in what it measured, not in what is said of the unit
    assert 0.5 < variables["now"]["values"] / np.mean(variables["peak_to_peak"]["values"]) < 1.5
    assert "planet_pitch" in Path(page).read_text(encoding="utf-8")


def test_the_state_of_a_unit_makes_its_error_and_what_a_part_does_there(life: tuple[Path, dict[str, Any]]) -> None:
    """Against the exact simulator: the mean error of the sessions, and what the planet's pitch has done to them."""
    folder, truth = life
    model = rverror.load_model(folder / "model.toml")
    runs = [rverror.load_run(path, model) for path in sorted((folder / "runs").glob("*.csv"))]
    history = history_of(model, sessions_of(runs)[1])
    state = unit_state(model, history)
    waves = slice(0, len(history.variance) - history.own_zeros)
    mean = history.values.mean(axis=0)[waves]
    # the unit with none of its errors leaves nine tenths of it or more
    assert np.linalg.norm(mean - (history.whitening @ state.with_changes(-state.values[None])[0])[waves]) > 0.9 * (
        np.linalg.norm(mean)
    )
    assert np.linalg.norm(mean - (history.whitening @ state.amplitudes)[waves]) < 0.1 * np.linalg.norm(mean)
    # the pitch grows in proportion to time: its slope over the sessions, less what the mounting does in order 1
    change, spread = truth["change"], history.at - history.at.mean()
    seen = spread @ history.amplitudes.values / (spread @ spread)
    effects, sizes = state.parts.effects, np.zeros(len(state.values))
    for number, (at, parameter) in enumerate(zip(state.parts.effect, state.parts.parameters, strict=True)):
        if effects[at].key == change["key"] and dict(effects[at].indices) == change["indices"]:
            sizes[number] = change["rate_per_hour"][parameter.name] * 1e-3
    assert np.count_nonzero(sizes) == 2
    order = np.tile(history.amplitudes.orders, 2 * len(history.amplitudes.conditions))
    about = np.abs(order - 40) < 3
    for influence in state.influences:
        assert np.linalg.norm((influence @ sizes - seen)[about]) < 0.2 * np.linalg.norm(seen[about])


def test_orders_that_differ_between_two_sessions_are_those_of_the_cause(
    life: tuple[Path, dict[str, Any]], capsys: pytest.CaptureFixture[str]
) -> None:
    folder, _ = life
    sides = []
    for name, number in (("before", 1), ("after", SESSIONS)):
        (folder / name).mkdir(exist_ok=True)
        for way in ("forward", "reverse"):
            text = (folder / "runs" / f"{number:02d}-{way}.csv").read_text(encoding="utf-8")
            (folder / name / f"{way}.csv").write_text(text, encoding="utf-8")
        sides.append(str(folder / name))
    found = said(folder, "compare-runs", *sides)
    # order 1 is the mounting's; what turns with a planet comes back 40 times a turn, its first harmonic at 40
    assert {one["order"] for one in found["changed"]} >= {1, 40}
    by_size = sorted(
        (one for one in found["changed"] if one["order"] not in (1, 2)), key=lambda one: -one["difference"]
    )
    assert by_size[0]["order"] == 40
    for one in found["changed"]:
        assert one["interval"][0] <= one["after"] <= one["interval"][1]
    assert "ratio 121, read of the angles" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("--limit", "lost motion"), "--limit: 'lost motion'; write"),
        (("--limit", "play 3 arcsec"), "--limit: 'play 3 arcsec'; write"),
        (("--limit", "stiffness 3 N*m/arcmin"), "limit: of stiffness"),
        (("--limit", "lost motion 3 um"), "lost_motion"),
    ],
)
def test_a_limit_that_is_none_is_refused_in_one_line(
    life: tuple[Path, dict[str, Any]], words: tuple[str, ...], text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, _ = life
    assert main(["trend", str(folder / "runs"), "--model", str(folder / "model.toml"), *words]) == 2
    said = capsys.readouterr().err
    assert text in said
    assert len(said.splitlines()) == 1


def edited(run: rverror.Run, **changes: Any) -> rverror.Run:
    from dataclasses import replace

    return replace(run, **changes)


def test_runs_that_tell_no_trend_are_refused(life: tuple[Path, dict[str, Any]]) -> None:
    folder, _ = life
    model = rverror.load_model(folder / "model.toml")
    runs = [rverror.load_run(path, model) for path in sorted((folder / "runs").glob("*.csv"))]
    worm = rverror.Model(rverror.Drive(ratio=14.0))
    third = [edited(run, metadata={"hours": "7"}) for run in runs[4:6]]
    for given, of, text in (
        (runs[:4], model, "2 sessions; a trend takes 3 or more"),
        (runs[:6], worm, "needs a .reducer. model"),
        ([*runs[:5], edited(runs[5], metadata={})], model, "does not say when"),
        ([*runs[:4], *(edited(run, index="unknown") for run in third)], model, "index: unknown"),
        ([*runs[:4], *(edited(run, torque=None) for run in third)], model, "states no torque"),
        ([], model, "does not say when"),
    ):
        with pytest.raises(rverror.InputError, match=text):
            rverror.trend(of, given)
    apart = [edited(run, index=f"{number}") for number, run in enumerate(runs)]
    with pytest.raises(rverror.InputError, match="tell no lost motion"):
        rverror.trend(model, apart, limit=rverror.limit("lost_motion", "90 arcsec"))
    with pytest.raises(rverror.InputError, match="before: no run"):
        rverror.life.compare_runs([], runs[:2])


def test_two_measurements_of_one_state_differ_as_rarely_as_stated() -> None:
    """1 % of pairs are told an order: two of 30 or fewer, but for a chance of 1 in 300.

    A wave that comes anew with 16 times the mean power of a difference is told: 10.4 times is what chance leaves.
    """
    theta, noise, rng = np.linspace(0, 2 * np.pi, 180, endpoint=False), 2e-6, np.random.default_rng(17)
    wave = np.sqrt(16 * 2 * 4 * noise**2 / theta.size) * np.cos(7 * theta)
    told, found = 0, 0
    for _ in range(30):
        one, same, other = (
            rverror.run_from_arrays(
                output_angle=theta, te=3e-4 * np.cos(3 * theta) + new + noise * rng.standard_normal(theta.size)
            )
            for new in (0.0, 0.0, wave)
        )
        told += bool(rverror.life.compare_runs([one], [same]).orders)
        found += any(order.order == 7 for order in rverror.life.compare_runs([one], [other]).orders)
    assert told <= 2
    assert found >= 22


def test_a_measurement_is_like_itself() -> None:
    """Nothing differs, and nothing is noise: the chance is no 0 over 0."""
    theta = np.linspace(0, 2 * np.pi, 180, endpoint=False)
    run = rverror.run_from_arrays(output_angle=theta, te=3e-4 * np.cos(3 * theta))
    assert rverror.life.compare_runs([run], [run]).orders == ()


def test_a_time_beyond_what_was_measured_says_so() -> None:
    """100 hours from the first session to the last; the limit is reached after 400 at least, then after 40."""
    empty = np.empty((3, 0))
    sentences = []
    for low in (400.0, 40.0):
        left = Remaining("transmission_error", 90 * ARCSEC, 30 * ARCSEC, Interval(2 * low, low, 67579.4))
        trend = Trend("a unit", "hour", np.array([0.0, 30.0, 100.0]), (), (), left, empty, empty, empty)
        sentences.append(remaining_words(trend))
    assert "about 800 hours after the last session (95 % interval: 400 to 67600)." in sentences[0]
    assert sentences[0].endswith("That is at least 4 times the time measured so far.")
    assert sentences[1].endswith("(95 % interval: 40 to 67600).")


def test_an_open_end_of_the_time_that_remains_is_said_in_words() -> None:
    empty = np.empty((3, 0))
    for value, words in (
        (800.0, "about 800 hours after the last session (95 % interval: 400 or more)."),
        (np.inf, "at the earliest 400 hours after the last session (95 %)."),
    ):
        left = Remaining("lost_motion", 90 * ARCSEC, 30 * ARCSEC, Interval(value, 400.0, np.inf))
        trend = Trend("a unit", "hour", np.array([0.0, 500.0]), (), (), left, empty, empty, empty)
        assert remaining_words(trend) == f"Lost motion: 30 arcsec now, limit 90 arcsec. It is reached {words}"
