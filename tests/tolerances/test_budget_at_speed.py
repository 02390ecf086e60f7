"""Budgets at speed: the loaded state's at a crawl, closed forms, full solutions of drawn units, and rankings."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import rverror
from rverror import Effect, Model, effect, tolerance
from rverror.app.command_line import main
from rverror.dynamics import modes, speed_response
from rverror.geartrain import Stiffness
from rverror.model import Bench
from rverror.tolerances import Stack, Tolerance, stack
from strategies import variant

UNIT = rverror.reducer("RV-40E")
SMALL = variant(UNIT, pins=12, disc_lobes=11, eccentricity=3.0, pin_radius=6.0, name="small")
RATIO = 0.02
SWINGING = Bench(load_inertia="500 kg*m^2", damping_ratio=RATIO)
#: Waves of every frame, one part that moves the offset alone, one beyond the contacts, one that only misreads.
EVERY = (
    tolerance("crank.eccentricity", "1 um"),
    tolerance("cycloid.pin_position", "1 um", pin=[0, 3]),
    tolerance("cycloid.disc_pitch", "1 um", harmonic=[1, 2]),
    tolerance("crank.bearing_clearance", "1 um", mean="1 um"),
    tolerance("involute.planet_eccentricity", "1 um", parameters=["x"]),
    tolerance("load.torsion", 1e-10, mean=1e-10),
    tolerance("sensor.encoder_eccentricity", "1 arcsec"),
)


def by_linearise(
    model: Model, tolerances: tuple[Tolerance, ...], made: Stack, torque: float, direction: float
) -> Stack:
    """The stack at no speed, by virtual work on the equilibrium."""
    state = rverror.statics.linearise(model, made.theta, torque=torque, direction=direction)
    rows = []
    for one in made.components:
        told = rverror.influence(
            model.mechanism, made.theta, one.key, forces=state.forces, direction=direction, torque=torque, **one.indices
        )
        rows.append(told.matrix[[label.split()[-1] for label in told.labels].index(one.parameter)])
    means = [tolerances[entry].mean.get(c.parameter, 0.0) for c, entry in zip(made.components, made.entry, strict=True)]
    nominal = state.state.transmission_error + np.array(means) @ np.array(rows)
    return replace(made, nominal=nominal, influence=np.array(rows))


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_at_a_crawl_it_is_the_budget_of_the_loaded_state(direction: float) -> None:
    model = Model(SMALL, (effect("crank.eccentricity", crank=0, disc=0, tangential="5 um"),), bench=SWINGING)
    made = stack(model, EVERY, torque="100 N*m", direction=direction, input_speed="0.001 rpm")
    still = by_linearise(model, EVERY, made, 100e3, direction)
    size = np.abs(still.influence).max(axis=1, keepdims=True)
    assert (np.abs(made.influence - still.influence) <= 1e-6 * size).all()
    np.testing.assert_allclose(made.nominal, still.nominal, atol=1e-6 * np.ptp(still.nominal))
    moving, static = rverror.tolerances.budget(made), rverror.tolerances.budget(still)
    assert moving.worst.peak_to_peak == pytest.approx(static.worst.peak_to_peak, rel=1e-5)
    assert moving.rms == pytest.approx(static.rms, rel=1e-5)
    for one, other in zip(moving.contributions, static.contributions, strict=True):
        assert one.share == pytest.approx(other.share, abs=1e-6)
        assert one.effect == other.effect


def test_with_stiff_bearings_it_is_the_closed_form_at_a_crawl() -> None:
    """Rigid bearings, all pins of the loaded side carry: what the closed form takes for granted.

    Two cams hold a disc by one direction more than they need, and share it by their compliance: no error of theirs.
    """
    stiff = Stiffness(crank_bearing=1e9, carrier_bearing=1e9, main_bearing=1e9, gear_mesh=1e9, pin_contact=1e3)
    model, of_gears = Model(variant(SMALL, stiffness=stiff), bench=SWINGING), (*EVERY[1:3], EVERY[4])
    made = stack(model, of_gears, torque="100 N*m", input_speed="0.001 rpm")
    closed = stack(model, of_gears, made.theta)
    size = np.abs(closed.influence).max(axis=1, keepdims=True)
    assert (np.abs(made.influence - closed.influence) <= 1e-4 * size).all()


def wavy_base(share: np.ndarray | float) -> np.ndarray:
    """Growth of a wave on which a heavy load rides: order times speed over its natural frequency."""
    return np.abs(1 + np.square(share) / (1 - np.square(share) + 2j * RATIO * share))


#: Two waves of the discs, of orders 40 and 80, the first with the wider tolerance.
RIVALS = (
    tolerance("cycloid.disc_pitch", "3 um", disc=0, harmonic=1),
    tolerance("cycloid.disc_pitch", "1 um", disc=0, harmonic=2),
)


def test_near_a_critical_speed_another_tolerance_comes_first() -> None:
    """One inertia on one contact: each order grows by the textbook's factor, and the orders' squares add up.

    In reverse, where the angle falls with time; both directions are held against solved units below.
    """
    model, direction = Model(UNIT, bench=SWINGING), -1.0
    crawl = stack(model, RIVALS, direction=direction, input_speed="0 rpm")
    still = [entry.mean_square for entry in rverror.tolerances.budget(crawl).contributions]
    assert still[0] > 3 * still[1]
    first = modes(model, direction=direction).frequency[0]
    critical = 2 * math.pi * first * UNIT.ratio / 80
    orders = np.arange(1, crawl.theta.size // 2)
    leads = []
    for share in (0.5, 1.0):
        found = rverror.tolerances.budget(stack(model, RIVALS, direction=direction, input_speed=share * critical))
        grown = wavy_base(share * orders / 80) ** 2
        for entry, rows, before in zip(
            found.contributions, (crawl.influence[:2], crawl.influence[2:]), still, strict=True
        ):
            squares = (np.abs(np.fft.rfft(rows))[:, 1 : orders.size + 1] ** 2).sum(axis=0)
            assert entry.mean_square == pytest.approx(before * (squares @ grown) / squares.sum(), rel=0.02)
        leads.append(max(found.contributions, key=lambda entry: entry.share).label)
    assert leads == ["cycloid.disc_pitch(disc=0, harmonic=1)", "cycloid.disc_pitch(disc=0, harmonic=2)"]


def drawn_effects(made: Stack, values: np.ndarray) -> tuple[Effect, ...]:
    """A unit's errors, component by component."""
    pairs = zip(made.components, values, strict=True)
    return tuple(effect(one.key, **one.indices, **{one.parameter: float(value)}) for one, value in pairs)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_drawn_units_in_full_are_as_the_linear_ones(direction: float) -> None:
    """The whole response of a unit, its own loaded state and stiffness, at a speed where orders have grown."""
    model, of_gears = Model(SMALL, bench=Bench(load_inertia="50 kg*m^2")), EVERY[:3]
    speed = 0.9 * 2 * math.pi * modes(model, torque=412e3, direction=direction).frequency[0] * SMALL.ratio / 12
    made = stack(model, of_gears, torque=412e3, direction=direction, input_speed=speed)
    crawl = stack(model, of_gears, torque=412e3, direction=direction, input_speed=0.0)
    assert np.ptp(made.scaled(), axis=1).max() > 2 * np.ptp(crawl.scaled(), axis=1).max()
    draws = made.standard(np.random.default_rng(3).random((4, made.dimensions)))
    for values in draws * made.width[made.entry]:
        unit = model.with_effects(*drawn_effects(made, values))
        full = speed_response(unit, [speed], torque=412e3, direction=direction).transmission_error[0]
        linear = made.nominal + values @ made.influence
        # pins that meet the load a little earlier or later are not linear: some 5 % of 1 um
        left = np.ptp(full - linear) / np.ptp(linear - made.nominal)
        assert left < 0.05
        assert np.ptp(full - full.mean()) == pytest.approx(np.ptp(linear), rel=0.05)


def test_marks_that_are_ahead_turn_what_the_gears_do() -> None:
    """By whole steps of the angles, so that a whole period is rolled on."""
    model, of_gears, steps = Model(SMALL, bench=SWINGING), EVERY[1:3], 7
    plain = stack(model, of_gears, torque="100 N*m", input_speed="100 rpm")
    assert plain.theta is not None
    marks = effect("sensor.index_offset", offset=float(plain.theta[steps]))
    ahead = stack(model.with_effects(marks), of_gears, torque="100 N*m", input_speed="100 rpm")
    for one, other in ((ahead.nominal, plain.nominal), (ahead.influence, plain.influence)):
        np.testing.assert_allclose(one, np.roll(other, -steps, axis=-1), atol=1e-6 * np.abs(other).max())


def test_angles_beside_a_speed_are_refused() -> None:
    with pytest.raises(rverror.InputError, match="theta: at a speed the angles are those of one period"):
        stack(Model(SMALL), EVERY[:1], [0.0, 0.1], input_speed="100 rpm", torque=1e5)
    with pytest.raises(rverror.InputError, match="speed: give one"):
        stack(Model(SMALL), EVERY[:1], input_speed=["100 rpm", "200 rpm"], torque=1e5)


TEXT = """
[[tolerance]]
key = "cycloid.disc_pitch"
tolerance = "3 um"
indices = { harmonic = [1, 2] }
cost = { curve = "reciprocal", price = 10.0, at = "3 um" }

[[tolerance]]
key = "crank.eccentricity"
tolerance = "3 um"
cost = { curve = "reciprocal", price = 10.0, at = "3 um" }
"""


def test_budget_and_allocation_at_a_speed_from_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model, path, widths, out = (
        Model(SMALL, bench=SWINGING),
        tmp_path / "m.toml",
        tmp_path / "t.toml",
        tmp_path / "o.json",
    )
    rverror.save_model(path, model)
    widths.write_text(TEXT)
    given = [str(path), str(widths), "--speed", "300 rpm", "--torque", "100 N*m", "--json", str(out)]
    items = rverror.load_tolerances(widths, model)
    made = stack(model, items, input_speed="300 rpm", torque="100 N*m")
    assert main(["budget", *given, "--units", "512"]) == 0
    told = json.loads(out.read_text())
    assert told["input_speed_rpm"] == pytest.approx(300)
    assert told["limits"] == []
    worst = rverror.tolerances.budget(made).worst.peak_to_peak
    told = dict(zip(*(told["variables"][name]["values"] for name in ("size", "size_worst_case")), strict=True))
    assert told["peak-to-peak"] == pytest.approx(math.degrees(worst) * 3600, rel=1e-3)
    assert "about the loaded state at 300 rpm" in capsys.readouterr().out
    limit = f"{math.degrees(worst) * 3600 / 2:.6f} arcsec"
    assert main(["allocate", *given, "--kind", "worst", "--limit", limit, "--units", "1000"]) == 0
    told = json.loads(out.read_text())
    found = rverror.allocate(model, items, input_speed="300 rpm", torque="100 N*m", limit=limit, kind="worst")
    assert told["cost"] == pytest.approx(found.cost, rel=1e-3)
    assert told["input_speed_rpm"] == pytest.approx(300)
    assert "at 300 rpm" in capsys.readouterr().out.splitlines()[0]
    assert main(["budget", str(path), str(widths), "--speed", "-3 rpm"]) == 2
    assert "--speed: '-3 rpm' is not above 0" in capsys.readouterr().err
