"""Speeds in place of angles: their integral, what it leaves open, and what it makes of noise."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rverror
from remedy import REMEDY
from rverror import ARCSEC, Run, load_run
from rverror.base.errors import InputError
from rverror.runs import write_run
from rverror.runs.integration import integrated, without_line
from rverror.runs.reading import Reading

R = 121.0
MAPPING = """
[columns]
input_speed = {{ name = "n1", unit = "{unit}" }}
output_speed = {{ name = "n2", unit = "{unit}", sign = -1 }}
time = {{ name = "t", unit = "s" }}
[file]
decimal = "."
separator = ","
{more}
"""
PER_RADIAN = {"rpm": 30 / math.pi, "deg/s": 180 / math.pi, "rad/s": 1.0}
#: cos and sin of the orders of a known error, arcsec.
WAVES = {1: (8.0, -5.0), 2: (0.0, 3.0), 40: (6.0, 2.0), 78: (1.0, 4.0)}
SPEED = 2 * math.pi / 4  # rad/s of the output: a turn in 4 s


def angle_of(columns: dict[str, np.ndarray]) -> np.ndarray:
    labels = np.arange(columns["time"].size)
    return integrated(Reading(path="", columns=columns, labels=labels, noun="sample")).columns["output_angle"]


def error(theta: np.ndarray) -> np.ndarray:
    return np.asarray(sum(a * np.cos(k * theta) + b * np.sin(k * theta) for k, (a, b) in WAVES.items())) * ARCSEC


def slope(theta: np.ndarray) -> np.ndarray:
    """Of the error over the angle."""
    parts = (k * (b * np.cos(k * theta) - a * np.sin(k * theta)) for k, (a, b) in WAVES.items())
    return np.asarray(sum(parts)) * ARCSEC


def measured(
    folder: Path,
    *,
    turns: float = 3.0,
    samples: int = 1600,
    sense: float = 1.0,
    offsets: tuple[float, float] = (0.0, 0.0),
    unit: str = "rpm",
    more: str = "",
    change: Any = None,
    noise: np.ndarray | None = None,
) -> tuple[Run, np.ndarray]:
    """A drive that turns almost evenly, its two speeds as a file holds them; the run, and where the output stood."""
    time = np.arange(round(turns * samples) + 1) * 4 / samples
    theta = sense * (SPEED * time + 0.02 * np.sin(3 * time))
    rate = sense * (SPEED + 0.06 * np.cos(3 * time))
    speeds = [R * rate + offsets[0], rate * (1 + slope(theta)) + offsets[1]]
    if noise is not None:
        speeds[1] = speeds[1] + noise
    rows = np.stack([time, speeds[0] * PER_RADIAN[unit], -speeds[1] * PER_RADIAN[unit]], axis=1)
    lines = [",".join(f"{value:.17g}" for value in row) for row in rows]
    if change is not None:
        lines = change(lines)
    (folder / "run.csv").write_text("\n".join(["t,n1,n2", *lines]))
    (folder / "bench.toml").write_text(MAPPING.format(unit=unit, more=more))
    return load_run(folder / "run.csv", R, mapping=folder / "bench.toml"), theta


def off_mean(values: np.ndarray) -> np.ndarray:
    return np.asarray(values - values.mean())


def shrunk(order: int, samples: int) -> float:
    """What a spline's integral makes of a wave: by hand, from its slopes 3 (f1 - f-1)/(f1 + 4 f0 + f-1) of a wave."""
    x = 2 * math.pi * order / samples
    return x / 2 / math.tan(x / 2) + x / 4 * math.sin(x) / (2 + math.cos(x))


def test_numbers_of_the_theory_page() -> None:
    """What a wave of few samples loses, by the spline itself; what one turn's line takes of an order 1."""
    for samples, spline, trapezoid in ((10, 0.25, 33), (20, 0.014, 8.2)):
        step = 2 * math.pi / samples
        time = step * np.arange(40 * samples + 1)
        angle = angle_of({"time": time, "output_speed": np.cos(time)})
        inside = slice(10 * samples, 30 * samples)
        kept = 2 * np.mean(angle[inside] * np.sin(time[inside]))
        assert kept == pytest.approx(shrunk(1, samples), abs=1e-9)
        assert 1e3 * (1 - kept) == pytest.approx(spline, rel=0.02)
        assert 1e3 * (1 - step / 2 / math.tan(step / 2)) == pytest.approx(trapezoid, rel=0.02)
    theta = np.linspace(0, 2 * math.pi, 2001)[:-1]
    taken = np.sin(theta) - without_line(np.sin(theta), theta=theta, time=theta)
    assert abs(taken[0]) == pytest.approx(0.95, abs=0.01)


@pytest.mark.parametrize(("unit", "sense"), [("rpm", 1.0), ("deg/s", -1.0), ("rad/s", 1.0)])
def test_a_known_error_comes_back(tmp_path: Path, unit: str, sense: float) -> None:
    """To what the spline leaves of waves of 20 samples, 78 a turn at the most: x^4/720, and the input's sixth of it."""
    run, theta = measured(tmp_path, unit=unit, sense=sense)
    left = off_mean(run.error(R)) - off_mean(error(theta))
    bound = sum(math.hypot(a, b) * (1 - shrunk(k, 1600)) for k, (a, b) in WAVES.items())
    assert shrunk(78, 1600) == pytest.approx(1 - (2 * math.pi * 78 / 1600) ** 4 / 720, abs=1e-6)
    # beside them the line's own error: a turn's mean by trapezoids whose ends fall between samples
    assert np.abs(left).max() / ARCSEC < bound + 0.001
    assert run.index == "unknown"
    assert run.direction[0] == sense
    assert np.allclose(run.nominal_angle(R), theta - theta[0], atol=1e-7)
    assert any("output_angle is the integral of output_speed over time: its start is not" in one for one in run.notes)


@pytest.mark.parametrize("offsets", [(0.0, 1e-3), (0.05, 0.0), (0.05, -2e-3)])
def test_offsets_of_the_speeds_become_no_error(tmp_path: Path, offsets: tuple[float, float]) -> None:
    """Of up to 0.2 % of the output's speed, 4700 arcsec over the run; the input's 0.03 % shifts angles by so much."""
    run, theta = measured(tmp_path, offsets=offsets)
    assert run.output_angle is not None
    added = np.ptp((run.output_angle - run.nominal_angle(R)) / ARCSEC)
    assert added > 900
    slipped = abs(offsets[0] / R / SPEED) * 3 * 2 * math.pi * np.abs(slope(theta)).max() / ARCSEC
    left = off_mean(run.error(R)) - off_mean(error(theta))
    assert np.abs(left).max() / ARCSEC < 0.01 + slipped


def test_the_line_of_two_turns_and_more_is_that_of_their_means_and_of_less_the_least_squares(tmp_path: Path) -> None:
    whole, theta = measured(tmp_path, turns=2.3, offsets=(0.0, 1e-3))
    assert np.abs(off_mean(whole.error(R)) - off_mean(error(theta))).max() / ARCSEC < 0.01
    assert not any("less than 2 output turns" in note for note in whole.notes)
    part, theta = measured(tmp_path, turns=1.0, offsets=(0.0, 1e-3))
    assert any("less than 2 output turns some of the slow orders goes with it" in note for note in part.notes)
    line = np.polynomial.Polynomial.fit(part.time, error(theta), 1)(part.time)  # type: ignore[arg-type]
    assert np.abs(off_mean(part.error(R)) - (error(theta) - line)).max() / ARCSEC < 0.01


def test_turns_that_do_not_close_or_are_sampled_unevenly_have_their_means_too() -> None:
    """An order 1 of 20 arcsec: the mean of a turn that lacks its last step is off by 20/800 at most."""
    closed = 2 * math.pi * np.linspace(0, 2, 1601)
    for theta in (closed[:-1], np.sort(np.random.default_rng(4).uniform(0, 6 * math.pi, 4000))):
        wave = 20 * np.sin(theta + 1)
        left = without_line(wave + 7 * theta, theta=theta, time=theta)
        assert np.abs(off_mean(left) - off_mean(wave)).max() < 0.06


def test_written_as_a_run_file_it_stays_what_it_is(tmp_path: Path) -> None:
    run, _ = measured(tmp_path, offsets=(0.0, 1e-3))
    write_run(tmp_path / "angles.csv", run)
    again = load_run(tmp_path / "angles.csv", R)
    assert isinstance(again, Run)
    assert again.metadata["integrated"] == "input_speed, output_speed"
    assert np.abs(again.error(R) - run.error(R)).max() < 1e-9
    assert again.index == "unknown"


def test_an_encoder_at_the_input_and_a_speed_at_the_output(tmp_path: Path) -> None:
    """The usual pair with a gyroscope: angles then stand where the encoder says."""
    time = np.arange(4801) * 4 / 1600
    theta = SPEED * time
    output = SPEED * (1 + slope(theta)) + 1e-3
    rows = (f"{a:.17g},{b:.17g},{c:.17g}" for a, b, c in zip(time, np.degrees(R * theta), output, strict=True))
    (tmp_path / "run.csv").write_text("\n".join(["t,phi,w", *rows]))
    (tmp_path / "bench.toml").write_text(
        '[columns]\ninput_angle = { name = "phi", unit = "deg" }\noutput_speed = { name = "w", unit = "rad/s" }\n'
        'time = { name = "t", unit = "s" }\n'
    )
    run = load_run(tmp_path / "run.csv", R, mapping=tmp_path / "bench.toml")
    assert isinstance(run, Run)
    assert np.abs(off_mean(run.error(R)) - off_mean(error(theta))).max() / ARCSEC < 0.01
    assert run.metadata["integrated"] == "output_speed"


def test_white_noise_of_a_speed_falls_with_the_order() -> None:
    """Each of cos and sin has sigma sqrt(2/N)/(k Omega), of N samples; the walk spreads by sigma sqrt(h t)."""
    rng, sigma, samples, cases = np.random.default_rng(3), 1e-3, 400, 500
    count, step = 3 * samples, 4 / samples
    theta = SPEED * step * np.arange(count + 1)
    walks = []
    for _ in range(cases):
        columns = {"time": theta / SPEED, "output_speed": sigma * rng.normal(size=count + 1)}
        walks.append(angle_of(columns))
    walk = np.array(walks)
    spread = walk[:, -1].std()
    assert spread == pytest.approx(sigma * math.sqrt(step * theta[-1] / SPEED), rel=4 / math.sqrt(2 * cases))
    # one wave at a time, beside offset and line: with the line a sine has Legendre's second polynomial, 1/5 beside 1/2
    for order in (3, 10, 40):
        basis = np.stack([np.ones(count + 1), theta, np.cos(order * theta), np.sin(order * theta)], axis=1)
        cosine, sine = np.linalg.lstsq(basis, walk.T, rcond=None)[0][2:].std(axis=1)
        expected = sigma * math.sqrt(2 / count) / (order * SPEED)
        assert cosine == pytest.approx(expected, rel=4 / math.sqrt(2 * cases)), order
        assert sine == pytest.approx(math.sqrt(1.4) * expected, rel=4 / math.sqrt(2 * cases)), order


def no_number(lines: list[str]) -> list[str]:
    return [*lines[:50], lines[50].rsplit(",", 1)[0] + ",x", *lines[51:]]


@pytest.mark.parametrize(
    ("keywords", "says"),
    [
        ({"change": lambda lines: lines[:30] + lines[80:]}, "line 32: a gap of 0.1275 s after steps of 0.0025 s"),
        ({"change": no_number}, "line 52: output_speed holds no number, and input_speed and output_speed cannot be"),
        ({"change": lambda lines: [*lines[:30], lines[29], *lines[30:]]}, "line 32: time does not grow"),
        ({"change": lambda lines: lines[:9]}, "9 samples of input_speed and output_speed; 16 or more"),
        (
            {"more": '[header]\nindex = "A"'},
            "index = 'A': an angle integrated from input_speed and output_speed has no",
        ),
    ],
    ids=["gap", "no number", "time", "short", "zero"],
)
def test_what_cannot_be_integrated_is_refused(tmp_path: Path, keywords: dict[str, Any], says: str) -> None:
    with pytest.raises(InputError) as caught:
        measured(tmp_path, **keywords)
    message = str(caught.value)
    assert message.startswith(str(tmp_path / "run.csv"))
    assert says in message
    assert "\n" not in message
    assert REMEDY.search(message)


@pytest.mark.parametrize(
    ("columns", "says"),
    [
        (
            'input_speed = {name = "n1", unit = "rpm"}\noutput_speed = {name = "n2", unit = "rpm"}',
            "there is no time to",
        ),
        ('input_speed = {name = "n1", unit = "Hz"}', "line 2: input_speed: 'Hz' is no unit of angular speed"),
        (
            'input_speed = {name = "n1", unit = "counts", counts_per_turn = 4}',
            "input_speed in counts; only input_angle",
        ),
        (
            'input_speed = {name = "n1", unit = "rpm"}\ninput_angle = {name = "n2", unit = "deg"}',
            "line 2: input_speed beside input_angle: it would be integrated to it",
        ),
        ('output_speed = {name = "n2", unit = "rpm"}', "besides output_angle there is no"),
    ],
)
def test_a_mapping_that_cannot_be(tmp_path: Path, columns: str, says: str) -> None:
    (tmp_path / "run.csv").write_text("t,n1,n2\n" + "\n".join(f"{i},121,1" for i in range(40)))
    (tmp_path / "bench.toml").write_text(f"[columns]\n{columns}\n")
    with pytest.raises(InputError, match=says.split(":")[0]) as caught:
        load_run(tmp_path / "run.csv", R, mapping=tmp_path / "bench.toml")
    assert says in str(caught.value)


def test_a_diagnosis_takes_such_a_run(tmp_path: Path) -> None:
    """An undeclared wave of the motor shaft is named from speeds with offsets, and no ramp."""
    ratio, samples = 14.0, 2000
    time = np.arange(4 * samples + 1) * 4 / samples
    theta = SPEED * time
    rng = np.random.default_rng(2)
    made = SPEED * (1 + 14 * 20 * ARCSEC * np.cos(14 * theta)) + 1e-3 + 1e-4 * rng.normal(size=theta.size)
    rows = zip(time, np.full(theta.size, ratio * SPEED) + 0.01, made, strict=True)
    (tmp_path / "run.csv").write_text("\n".join(["t,n1,n2", *(f"{a:.17g},{b:.17g},{-c:.17g}" for a, b, c in rows)]))
    (tmp_path / "bench.toml").write_text(MAPPING.format(unit="rad/s", more=""))
    run = load_run(tmp_path / "run.csv", ratio, mapping=tmp_path / "bench.toml")
    model = rverror.Model(rverror.Drive(ratio=ratio, shafts={"motor": 14.0}))
    found = rverror.diagnose(model, [run])
    assert [one.effect.key for one in found.added] == ["shaft.eccentricity"]
    (sine,) = (e for e in found.added[0].estimates if e.name == "sin")
    assert sine.value / ARCSEC == pytest.approx(20, abs=0.5)
