"""Waveforms by source, stacked, polar, of runs and states: what is drawn is what was computed another way."""

from __future__ import annotations

import re

import numpy as np
import pytest

from drawn import legend, line
from rverror import (
    Drive,
    InputError,
    Model,
    effect,
    equilibrium,
    influence,
    reducer,
    run_from_arrays,
    transmission_error,
)
from rverror.base.units import ARCSEC

UNIT = reducer("RV-40E")
MODEL = Model(
    UNIT,
    (
        effect("crank.eccentricity", crank=0, disc=1, radial="4 um"),
        effect("cycloid.pin_circle", harmonic=2, radial_cos="3 um"),
        effect("involute.tooth_thinning", member="sun", thinning="2 um"),
        effect("cycloid.disc_pitch", disc=0, harmonic=1, sin="1 um"),
    ),
)
CAM = Model(UNIT, (effect("crank.eccentricity", crank=0, disc=1, radial="4 um"),))
DRIVE = Model(
    Drive(ratio=-14.0, shafts={"idler": 3.5}),
    (
        effect("shaft.eccentricity", shaft="idler", harmonic=1, cos="30 arcsec"),
        effect("sensor.encoder_eccentricity", cos="20 arcsec", sin="-5 arcsec"),
    ),
)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_the_last_edge_of_the_stack_is_the_total(direction: float) -> None:
    ax = MODEL.plot(kind="stacked", direction=direction)
    x, y = line(ax, "total")
    assert y == pytest.approx(transmission_error(MODEL, np.radians(x), direction=direction) / ARCSEC, abs=1e-9)


def test_each_area_of_the_stack_is_as_high_as_its_effect() -> None:
    ax = MODEL.plot(kind="stacked")
    x, _ = line(ax, "total")
    areas = [c for c in ax.collections if c.get_label() in legend(ax)]
    assert len(areas) == len(MODEL.effects)
    below = np.zeros(x.size)
    for area, item in zip(areas, MODEL.effects, strict=True):
        corners = area.get_paths()[0].vertices  # lower edge out, upper edge back
        height = transmission_error(Model(UNIT, (item,)), np.radians(x), direction=1.0) / ARCSEC
        assert corners[1 : x.size + 1, 1] == pytest.approx(below, abs=1e-9)
        assert corners[x.size + 2 : 2 * x.size + 2, 1][::-1] == pytest.approx(below + height, abs=1e-9)
        below = below + height


def test_what_has_no_line_of_its_own_is_in_the_sum_of_the_others() -> None:
    ax = MODEL.plot(kind="waveform", most=2)
    labels = legend(ax)
    assert labels[2:] == ["sum of the 2 others", "total"]
    assert sum(line(ax, label)[1] for label in labels[:3]) == pytest.approx(line(ax, "total")[1], abs=1e-9)
    sizes = [np.abs(transmission_error(Model(UNIT, (e,)), np.linspace(0, 6, 500))).max() for e in MODEL.effects]
    for place in np.argsort(sizes)[-2:]:
        assert any(MODEL.effects[place].key in label for label in labels[:2])


def test_few_waves_are_shown_of_the_strongest_order() -> None:
    """An eccentric cam waves 40 times a turn, so twelve waves take 108 degrees; an encoder's turn is shown whole."""
    assert line(CAM.plot(), "total")[0][-1] == pytest.approx(108, abs=0.1)
    encoder = CAM.with_effects(effect("sensor.encoder_eccentricity", cos="100 arcsec"))
    assert line(encoder.plot(), "total")[0][-1] == pytest.approx(360, abs=0.1)


def test_angles_may_be_given_and_needed_time_is_asked_for() -> None:
    angles = np.linspace(1, 2, 50)
    x, y = line(CAM.plot(theta=angles), "total")
    assert np.radians(x) == pytest.approx(angles)
    assert y == pytest.approx(transmission_error(CAM, angles) / ARCSEC)
    late = Model(UNIT, (effect("sensor.time_offset", offset="1 ms"),))
    with pytest.raises(ValueError, match=r"time"):
        late.plot()
    assert line(late.plot(theta=angles, time=np.arange(50.0)), "total")[1] == pytest.approx(
        transmission_error(late, angles, time=np.arange(50.0)) / ARCSEC
    )


# --- polar ------------------------------------------------------------------------------------------------------------


def test_polar_draws_the_error_about_its_mean() -> None:
    ax = MODEL.plot(kind="polar")
    assert ax.name == "polar"
    angle, radius = line(ax, "total")
    error = transmission_error(MODEL, angle, direction=1.0) / ARCSEC
    assert radius == pytest.approx(error - error.mean(), abs=1e-9)
    (base,) = [text for text in legend(ax) if text.startswith("base circle")]
    stated = re.search(r"mean, (\S+) arcsec", base)
    assert stated
    assert float(stated[1]) == pytest.approx(error.mean(), rel=1e-3)
    assert (line(ax, base)[1] == 0).all()


def test_polar_closes_after_as_many_turns_as_the_drive_needs() -> None:
    angle, radius = line(DRIVE.plot(kind="polar"), "total")
    assert angle[-1] == pytest.approx(4 * np.pi, abs=1e-2)
    assert radius[-1] == pytest.approx(radius[0], abs=0.5)
    half = np.searchsorted(angle, 2 * np.pi)
    assert abs(radius[half] - radius[0]) > 50


# --- runs -------------------------------------------------------------------------------------------------------------


def test_a_run_is_drawn_by_direction_with_its_offset() -> None:
    there = np.linspace(0, 6, 200)
    theta = np.concatenate([there, there[-2::-1], there[1:]])
    error = (7 + np.sin(theta) + 3 * np.repeat([0, 1, 0], [200, 199, 199])) * ARCSEC
    run = run_from_arrays(input_angle=121 * theta, output_angle=theta + error)
    ax = run.plot(ratio=UNIT)
    assert legend(ax) == ["forward", "reverse"]
    x, y = line(ax, "forward")
    gap = np.isnan(x)
    assert list(np.flatnonzero(gap)) == [
        200
    ]  # nothing is drawn from the end of the first pass to the start of the next
    assert y[~gap] == pytest.approx(7 + np.sin(np.radians(x[~gap])), abs=1e-6)
    x, y = line(ax, "reverse")
    assert y == pytest.approx(10 + np.sin(np.radians(x)), abs=1e-6)


def test_a_torque_record_is_drawn_in_newton_metres() -> None:
    theta = np.linspace(0, 6, 100)
    run = run_from_arrays(output_angle=theta, direction="forward", te=None, torque_record=2e3 * np.sin(theta))
    ax = run.plot()
    assert ax.get_ylabel() == "torque, N*m"
    x, y = line(ax, "forward")
    assert y == pytest.approx(2 * np.sin(np.radians(x)))


def test_a_run_of_input_angles_asks_for_the_ratio() -> None:
    run = run_from_arrays(input_angle=np.linspace(0, 600, 99), te=np.zeros(99), direction="forward")
    for kind in ("waveform", "spectrum"):
        with pytest.raises(InputError, match=r"give ratio="):
            run.plot(kind=kind)


# --- states and influences --------------------------------------------------------------------------------------------


def test_a_state_is_drawn_over_the_angles_that_the_bench_reads() -> None:
    theta = np.linspace(0.1, 0.3, 17)
    ahead = CAM.with_effects(effect("sensor.index_offset", offset="5 deg"))
    state = equilibrium(ahead, theta, torque="100 N*m")
    x, y = state.plot().get_lines()[0].get_xydata().T
    assert np.radians(x) == pytest.approx(theta)
    assert y == pytest.approx(state.transmission_error / ARCSEC)


def test_an_influence_is_the_error_that_a_micrometre_makes() -> None:
    theta = np.linspace(0, 0.5, 40)
    ax = influence(UNIT, theta, "cycloid.pin_position", pin=3).plot()
    assert ax.get_ylabel() == "influence, arcsec per um"
    for name in ("radial", "tangential"):
        one = Model(UNIT, (effect("cycloid.pin_position", pin=3, **{name: "1 um"}),))
        assert line(ax, name)[1] == pytest.approx(transmission_error(one, theta) / ARCSEC)
    encoder = influence(UNIT, theta, "sensor.encoder_eccentricity")
    ax = encoder.plot()
    assert ax.get_ylabel() == "influence, arcsec per arcsec"
    x, y = line(ax, "cos")
    assert np.radians(x) == pytest.approx(theta)
    assert y == pytest.approx(np.cos(theta))
