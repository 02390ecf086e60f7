"""Order spectra: heights are amplitudes, the floor is the noise, names fit and do not lie over one another."""

from __future__ import annotations

import numpy as np
import pytest

from drawn import legend, line, stems
from rverror import Drive, InputError, Model, Run, effect, equilibrium, reducer, run_from_arrays, transmission_error
from rverror.base.units import ARCSEC
from rverror.runs.spectrum import frames_of_order
from rverror.views.plots.figure import axes_for
from rverror.views.plots.spectra import frame_name, name_peaks, strongest

UNIT = reducer("RV-40E")
WORM = Drive(ratio=360.0, shafts={"worm": 360.0})


def run_of(theta: np.ndarray, error: np.ndarray, ratio: float = 121.0, direction: str = "forward") -> Run:
    return run_from_arrays(input_angle=ratio * theta, te=error * ARCSEC, direction=direction, ratio=ratio)


def names(ax) -> list[list[str]]:
    return [text.get_text().split(": ") for above in ax.child_axes for text in above.get_xticklabels()]


# --- amplitudes -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("turns", [1, 2, 3])
def test_a_pure_wave_is_as_high_as_its_amplitude(turns: int) -> None:
    theta = 2 * np.pi * np.arange(512 * turns) / 512
    ax = run_of(theta, 7.25 * np.cos(40 * theta + 0.3)).plot(kind="spectrum", ratio=UNIT)
    order, size = stems(ax, "forward")
    assert order[np.argmax(size)] == 40
    assert size.max() == pytest.approx(7.25, rel=1e-6)
    assert np.sort(size)[-2] < 1e-3 if size.size > 1 else True
    assert names(ax) == [["40", "carrier/disc/crank 40"]]


def test_a_models_spectrum_is_that_of_its_error() -> None:
    model = Model(
        UNIT,
        (
            effect("crank.eccentricity", crank=0, disc=1, radial="4 um"),
            effect("cycloid.disc_pitch", disc=0, harmonic=1, cos="3 um"),
            effect("cycloid.pin_circle", harmonic=2, radial_cos="3 um"),
        ),
    )
    ax = model.plot(kind="spectrum", highest=130)
    order, size = stems(ax, "total")
    theta = 2 * np.pi * np.arange(8192) / 8192
    error = transmission_error(model, theta, direction=1.0) / ARCSEC
    for one, height in zip(order, size, strict=True):
        assert height == pytest.approx(abs(2 * np.mean(error * np.exp(-1j * one * theta))), rel=1e-3)
    assert ["40", "cycloid.disc_pitch + 1"] in names(ax) or ["40", "crank.eccentricity + 1"] in names(ax)
    assert ["78", "cycloid.pin_circle"] in names(ax)
    assert order.max() <= 130


def test_a_drive_that_repeats_after_two_turns_has_half_orders() -> None:
    waves = (
        effect("shaft.eccentricity", shaft="idler", harmonic=1, cos="30 arcsec"),
        effect("sensor.encoder_eccentricity", cos="12 arcsec", sin="-5 arcsec"),
    )
    order, size = stems(Model(Drive(ratio=-14.0, shafts={"idler": 3.5}), waves).plot(kind="spectrum"), "total")
    assert dict(zip(order, size, strict=True)) == pytest.approx({1.0: 13.0, 3.5: 30.0})


def test_a_drive_that_hardly_ever_repeats_is_windowed() -> None:
    wave = effect("shaft.eccentricity", shaft="odd", harmonic=1, cos="30 arcsec")
    ax = Model(Drive(ratio=10.0, shafts={"odd": 3.141}), (wave,)).plot(kind="spectrum")
    order, size = stems(ax, "total")
    assert abs(order[np.argmax(size)] - 3.141) < 0.04
    assert size.max() == pytest.approx(30, rel=0.05)


def test_high_orders_of_a_drive_do_not_fold() -> None:
    wave = effect("shaft.eccentricity", shaft="screw", harmonic=4, cos="30 arcsec")
    ax = Model(Drive(ratio=10.0, shafts={"screw": 1500.0}), (wave,)).plot(kind="spectrum")
    order, size = stems(ax, "total")
    assert order[np.argmax(size)] == 6000


def test_the_spectrum_of_a_state() -> None:
    model = Model(UNIT, (effect("sensor.encoder_eccentricity", cos="3 arcsec", sin="4 arcsec"),))
    theta = 2 * np.pi * np.arange(64) / 64
    state = equilibrium(model, theta, torque="412 N*m")
    ax = state.plot(kind="spectrum")
    order, size = stems(ax, "loaded equilibrium")
    assert size[list(order).index(1.0)] == pytest.approx(5, rel=1e-3)
    assert ["1", "sensor.encoder_eccentricity"] in names(ax)
    assert ax.get_title() == "RV-40E, 412 N*m, forward, loaded equilibrium"
    with pytest.raises(InputError, match=r"even angles"):
        equilibrium(model, theta**2, torque="412 N*m").plot(kind="spectrum")


def test_peaks_of_a_loaded_state_have_their_causes() -> None:
    """Waves have the effect that makes them unloaded; order 80 has the clearance, contacts that open none."""
    waves = (
        effect("crank.eccentricity", crank=0, disc=1, radial="4 um"),
        effect("cycloid.disc_pitch", disc=0, harmonic=1, cos="3 um"),
        effect("cycloid.pin_circle", harmonic=2, radial_cos="3 um"),
    )
    theta = 2 * np.pi * np.arange(192) / 192
    unloaded = names(Model(UNIT, waves).plot(kind="spectrum", highest=90))
    state = equilibrium(Model(UNIT, waves), theta, torque="412 N*m")
    assert set(map(tuple, unloaded)) <= set(map(tuple, names(state.plot(kind="spectrum"))))
    light = equilibrium(Model(UNIT, waves), theta, torque="20 N*m").plot(kind="spectrum")
    heights = dict(zip(*stems(light, "loaded equilibrium"), strict=True))
    assert {cause.split(" ")[0] for _, cause in names(light)} & {"no", "housing"}  # what pins make as they lift off
    for order, cause in names(light):
        wave = [one for one in waves if cause.startswith(one.key)]
        if wave:
            alone = transmission_error(Model(UNIT, (wave[0],)), theta, direction=1.0) / ARCSEC
            assert abs(2 * np.mean(alone * np.exp(-1j * float(order) * theta))) > 0.1 * heights[float(order)]
    play = Model(UNIT, (effect("crank.bearing_clearance", clearance="5 um"),))
    loose = equilibrium(play, theta, torque="20 N*m")
    assert names(loose.plot(kind="spectrum"))[0] == ["80", "crank.bearing_clearance"]
    right = equilibrium(Model(UNIT), theta, torque="20 N*m").plot(kind="spectrum")
    assert not any("." in cause for _, cause in names(right))  # nothing is declared, so nothing is named


# --- noise ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("periods", "points", "sigma"), [(3, 1024, 0.5), (8, 512, 2.0)])
def test_the_floor_is_the_rms_amplitude_that_noise_leaves(periods: int, points: int, sigma: float) -> None:
    """White noise of sigma leaves 2 sigma / sqrt(n) in a line of n readings, the mean of N periods 1/sqrt(N) of it."""
    theta = 2 * np.pi * np.arange(points * periods) / points
    noise = sigma * np.random.default_rng(3).standard_normal(theta.size)
    ax = run_of(theta, 40 * np.cos(78 * theta) + noise).plot(kind="spectrum", ratio=UNIT, highest=200)
    label = f"forward: noise of the mean of {periods} periods, rms"
    _, floor = line(ax, label)
    expected = 2 * sigma / np.sqrt(points * periods)
    assert np.median(floor) == pytest.approx(expected, rel=0.1)
    order, size = stems(ax, "forward")
    rest = size[order != 78]
    shown_share = rest.size / 199  # lines far below the floor fall out of the picture
    assert np.sqrt(np.mean(rest**2) * shown_share) == pytest.approx(expected, rel=0.15)
    assert names(ax) == [["78", "housing 39 x 2"]]


def test_one_period_has_no_floor() -> None:
    theta = 2 * np.pi * np.arange(700) / 512
    ax = run_of(theta, np.cos(40 * theta)).plot(kind="spectrum", ratio=UNIT)
    assert legend(ax) == []
    order, size = stems(ax, "forward")
    assert (order[np.argmax(size)], size.max()) == (40.0, pytest.approx(1.0, rel=1e-3))


def test_passes_over_a_part_of_a_turn_are_averaged() -> None:
    """To and fro three times over a tenth of a turn, each direction apart; sidelobes of the window are no lines."""
    there = 2 * np.pi * np.linspace(0, 0.1, 600)
    theta = np.concatenate([there, there[::-1]] * 3)
    run = run_from_arrays(input_angle=360 * theta, te=(5 * np.sin(360 * theta)) * ARCSEC, ratio=360.0)
    ax = run.plot(kind="spectrum", ratio=WORM)
    assert legend(ax) == ["forward", "reverse"]
    for way in legend(ax):
        order, size = stems(ax, way)
        assert abs(order[np.argmax(size)] - 360) <= 5
        assert size.max() == pytest.approx(5, rel=0.05)
    assert names(ax) == [["about 359", "input shaft 360"]]


# --- names ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("order", [1.0, 2.0, 36.0, 39.0, 40.0, 78.0, 120.0, 1080.0])
def test_an_exact_order_has_the_first_of_its_frames(order: float) -> None:
    told, *frame = frame_name(UNIT, order).split(": ")
    assert told == f"{order:g}"
    known = frames_of_order(UNIT, order)
    assert frame == (
        [known[0].split(" (")[0].replace("carrier, disc or crank", "carrier/disc/crank")] if known else ["no frame"]
    )


def test_an_order_that_is_not_resolved_is_named_only_where_no_other_is_near() -> None:
    assert frame_name(WORM, 356.0, within=27.0) == "about 356: input shaft 360"
    assert frame_name(WORM, 356.0, within=130.0) == "about 356"  # 720 is not far enough
    assert frame_name(WORM, 500.0, within=27.0) == "about 500: no frame"
    assert frame_name(UNIT, 39.4, within=0.3) == "about 39.4"  # pins or discs
    assert frame_name(UNIT, 77.9, within=0.2) == "about 77.9: housing 39 x 2"


def test_the_strongest_are_crests_that_stand_apart() -> None:
    size = np.array([0, 9, 8, 0, 3, 5, 4, 0, 0, 1.0])
    assert strongest(size, floor=np.full(10, 0.5)) == [1, 5, 9]
    assert strongest(size, floor=np.full(10, 0.5), apart=4) == [1, 5, 9]
    assert strongest(size, floor=np.full(10, 0.5), apart=5) == [1, 9]
    assert strongest(size, floor=np.full(10, 2.0)) == [1, 5]
    assert strongest(size, floor=np.where(size > 8.5, 99, 2.5)) == [5]
    assert strongest(np.zeros(5), floor=np.zeros(5)) == []


@pytest.mark.parametrize("width", [4.0, 5.0, 9.0])
@pytest.mark.parametrize("seed", range(2))
def test_names_lie_over_the_axes_and_apart(width: float, seed: int) -> None:
    """Neighbours slope alike: they are apart as far as their feet are, times the sine."""
    rng = np.random.default_rng(seed)
    order = np.arange(1, 260).astype(float)
    size = 10 ** rng.uniform(-2, 1, order.size)
    ax = axes_for(None, width=width)
    ax.set(xlim=(0, 260), yscale="log", title="title", ylabel="amplitude, arcsec")
    ax.vlines(order, 1e-3, size)
    name_peaks(ax, order, size, lambda o: f"{o:g}: carrier/disc/crank 40 x 2", floor=np.zeros(order.size))
    figure = ax.get_figure(root=True)
    assert figure is not None
    figure.draw_without_rendering()
    (above,) = ax.child_axes
    texts = above.get_xticklabels()
    feet = np.sort(ax.transData.transform([(float(text.get_position()[0]), 1.0) for text in texts])[:, 0])
    assert len(feet) > 1
    assert np.diff(feet).min() * np.sin(np.radians(35)) > 7 * figure.dpi / 72  # the font's size
    boxes = [text.get_window_extent() for text in texts]
    assert max(box.x1 for box in boxes) <= figure.bbox.x1
    assert max(box.y1 for box in boxes) <= ax.title.get_window_extent().y0 + 1
    assert min(box.y0 for box in boxes) >= ax.get_window_extent().y1 - 1
