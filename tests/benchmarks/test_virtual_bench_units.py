"""Units of the virtual bench: what is drawn, what the files say, and how answers are judged."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rverror
from pages import ROOT

sys.path.append(str(ROOT / "benchmarks"))

from real_bench import judging, units


@pytest.mark.parametrize("family", units.FAMILIES)
def test_units_of_every_family_are_files_that_load(family: str, tmp_path: Path) -> None:
    unit = units.draw(3, family)
    truth = units.write(unit, [np.zeros(run.theta.size) for run in unit.runs], [1.0] * len(unit.undeclared), tmp_path)
    assert truth["undeclared"] == units.draw(3, family).undeclared
    assert json.loads((tmp_path / "truth.json").read_text()) == truth
    model = rverror.load_model(tmp_path / "model.toml")
    assert model.mechanism.ratio == pytest.approx(unit.reducer.ratio)
    declared = {units.names_of(effect) for effect in unit.declared}
    assert len(model.effects) == len(declared) == len(unit.declared)
    names = [units.names_of(effect) for effect in unit.undeclared if effect["key"] != units.OUTSIDE]
    assert len({*names} | declared) == len(names) + len(declared)
    for key, indices in names:
        sizes = next(effect for effect in unit.undeclared if units.names_of(effect) == (key, indices))
        given = {name: size for name, size in sizes.items() if isinstance(size, str) and name != "key"}
        rverror.effect(key, **dict(indices), **given)  # raises where the catalogue has no such thing
    for run in unit.runs:
        read = rverror.load_run(tmp_path / f"{'forward' if run.direction > 0 else 'reverse'}_{run.torque:g}Nm.csv")
        assert read.torque == pytest.approx(run.torque * 1e3)
    if family == "plain":
        noise = np.std(read.output_angle - read.input_angle / 121) * 648000 / math.pi
        assert noise == pytest.approx(truth["noise_rms_arcsec"], rel=0.05)


def test_the_mechanism_is_simulated_as_the_run_went() -> None:
    """A mark ahead of the zero turns the gear train's wave, not the encoder's; the reverse run is read backwards."""
    unit = units.Unit(seed=0, family="plain", random=np.random.default_rng(0))
    wave = {"key": "cycloid.disc_bore_position", "disc": 1, "crank": 0, "radial": "5.000 um", "tangential": "2.000 um"}
    order_one = {"key": "sensor.encoder_eccentricity", "cos": "3.0000 arcsec", "sin": "0.0000 arcsec"}
    theta = 2 * np.pi * np.arange(32) / 32 / 40
    there, back = units.Recording(1, theta), units.Recording(1, theta[::-1])
    simulated = units.Simulated(unit)
    np.testing.assert_allclose(simulated.readings(there, [wave]), simulated.readings(back, [wave])[::-1], atol=1e-9)
    aligned = simulated.readings(there, [wave])
    unit.marks = 2 * np.pi / 40 / 32 * 5
    turned = units.Simulated(unit)
    np.testing.assert_allclose(turned.readings(there, [wave])[:-5], aligned[5:], atol=1e-9)
    both = turned.readings(there, [wave, order_one]) - turned.readings(there, [wave])
    np.testing.assert_allclose(both, 3 * units.ARCSEC * np.cos(theta), atol=1e-12)


def test_the_compiled_bench_moves_as_the_oracle_does() -> None:
    """Also where a ratio is no whole number, laws are not linear and bearings have clearance."""
    unit = units.Unit(seed=0, family="plain", random=np.random.default_rng(3), parameters=units.REDUCERS[0])
    units.wrong_stiffness(unit)
    units.power_law(unit)
    for key in ("crank.bearing_clearance", "involute.sun_eccentricity", "cycloid.pin_circle", "cycloid.disc_lobe"):
        unit.undeclared.append(units.draw_effect(unit, key))
    units.both_ways(unit, np.linspace(1, 11, 40), torques=(30.0,))
    for run in unit.runs:
        slow = units.Simulated(unit, slow=True).readings(run, unit.undeclared)
        fast = units.Simulated(unit).readings(run, unit.undeclared)
        assert 0 < abs(fast - slow).max() < 0.01 * units.ARCSEC


def test_where_the_compiled_bench_finds_no_pose_the_oracle_does(monkeypatch: pytest.MonkeyPatch) -> None:
    unit = units.draw(3, "plain")
    run = units.Recording(1, np.linspace(0, 1, 6))
    expected = units.Simulated(unit).readings(run, unit.true)

    def half(reducer: Any, angles: np.ndarray, *_: Any, **__: Any) -> Any:
        found = np.array([np.nan, 1.0, np.nan, 1.0, np.nan, 1.0])
        return found, np.isnan(found)

    monkeypatch.setattr(units.compiled, "transmission_error", half)
    got = units.Simulated(unit).readings(run, unit.true)
    np.testing.assert_allclose(got[::2], expected[::2], atol=0.01 * units.ARCSEC)
    np.testing.assert_array_equal(got[1::2], 1.0)


def answer(*keys: str, verdict: str = "explained", held_out: float = 0.5, lines: tuple[float, ...] = ()) -> Any:
    added = []
    for names in keys:
        key, *others = names.split("|")
        alike = [{"key": other, "indices": {}} for other in others]
        added.append({"key": key, "indices": {}, "parameters": {}, "indistinguishable_from": alike})
    return {
        "verdict": verdict,
        "added": added,
        "after": {"heldout_rms_arcsec": held_out},
        "unexplained_orders": [{"order": order} for order in lines],
    }


def truth(*keys: str, what: str = "", order: float | None = None, also: tuple[str, ...] = ()) -> Any:
    undeclared: list[dict[str, Any]] = [{"key": key} for key in keys]
    if order is not None:
        undeclared.append({"key": units.OUTSIDE, "order": order})
    return {"undeclared": undeclared, "what": what, "noise_rms_arcsec": 0.49, "also_true": list(also)}


@pytest.mark.parametrize(
    ("true", "found", "expected"),
    [
        (truth("a"), answer("a"), "right"),
        (truth("a"), answer("b|a"), "right"),
        (truth("a"), answer("b|c|d|e|a"), "wide"),
        (truth("a"), answer("a", held_out=0.6), "poor"),
        (truth("a"), answer("b"), "wrong"),
        (truth("a"), answer("a", "b"), "wrong"),
        (truth("a"), answer(verdict="nothing_missing"), "missed"),
        (truth("a", "b"), answer("a"), "missed"),
        (truth("a", "b"), answer("b|a", "a"), "right"),
        (truth(), answer(verdict="nothing_missing"), "right"),
        (truth(), answer(verdict="unexplained"), "line"),
        (truth(), answer("a"), "false"),
        (truth(what="stiffness"), answer("crank.bearing_compliance"), "right"),
        (truth(), answer("crank.bearing_compliance"), "false"),
        (truth(also=("sensor.drift",)), answer("sensor.drift|sensor.ratio_error"), "right"),
        (truth(order=17.63), answer(verdict="unexplained", lines=(17.6,)), "right"),
        (truth(order=17.63), answer(verdict="unexplained", lines=(17.0,)), "line"),
        (truth("a", order=17.63), answer("a", verdict="unexplained", lines=(17.6,)), "right"),
    ],
)
def test_answers_are_judged(true: Any, found: Any, expected: str) -> None:
    assert judging.outcome(true, found) == expected


def test_sizes_count_where_the_indices_are_right() -> None:
    true = truth()
    true["undeclared"] = [{"key": "a", "disc": 1, "cos": "2.000 um", "sin": "-1.000 um"}]
    found = answer("a")
    found["added"][0] |= {
        "indices": {"disc": 1},
        "parameters": {
            "cos": {"value": 2.1, "unit": "um", "low": 1.8, "high": 2.4},
            "sin": {"value": 0.0, "unit": "um", "low": -0.5, "high": 0.5},
        },
    }
    assert judging.sizes_inside(true, found) == (1, 2)
    found["added"][0]["indices"] = {"disc": 0}
    assert judging.sizes_inside(true, found) == (0, 0)


@pytest.mark.parametrize(
    "error",
    [
        {"key": "cycloid.pin_position", "pin": 3, "radial": "9.000 um", "tangential": "6.000 um"},
        {
            "key": "cycloid.pin_circle", "harmonic": 3, "radial_cos": "6.000 um", "radial_sin": "2.000 um",
            "tangential_cos": "-1.000 um", "tangential_sin": "4.000 um",
        },
    ],
)  # fmt: skip
def test_pins_are_counted_from_the_marks_that_were_found(error: dict[str, Any]) -> None:
    """The unit with marks two pitches back and pins counted from there reads the same, by the simulator."""
    theta = 2 * np.pi * np.arange(64) / 64
    unit = units.Unit(seed=0, family="plain", random=np.random.default_rng(0))
    unit.marks = math.radians(30.0)
    true = units.Simulated(unit).readings(units.Recording(1, theta), [error])
    note = "index unknown: the gear's marks are 12 +- 0.01 deg ahead of it, or whole turns of the crank, 9 deg"
    told = judging.counted_from_marks({"undeclared": [error], "marks_ahead_deg": 30.0}, {"notes": [note]})
    unit.marks = math.radians(12.0)
    again = units.Simulated(unit).readings(units.Recording(1, theta), told)
    assert np.ptp(true) > 1e-7
    np.testing.assert_allclose(again, true, atol=1e-10)
    assert judging.counted_from_marks({"undeclared": [error]}, {"notes": []}) == [error]
