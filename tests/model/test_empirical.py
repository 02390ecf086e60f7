"""Empirical orders, and sources that stay outside the package."""

from __future__ import annotations

import contextlib
import dataclasses
import re
import threading
from typing import Any

import numpy as np
import pytest

import rverror
from pages import DOCS, text
from rverror import CATALOGUE, Drive, InputError, Model
from rverror.geartrain.kinematics import OperatingConditions, Pose, fundamental_orders, true_period
from rverror.geartrain.source import Source
from rverror.model.catalogue import extended, source
from rverror.statics.prediction import predict
from strategies import Array

ARCSEC = np.pi / 648000
UNITS = {
    "RV-40E": rverror.reducer("RV-40E"),
    "broken ratio": rverror.reducer("RV-40E", planet_teeth=24, cranks=3),
}
FRAMES = tuple(fundamental_orders(UNITS["RV-40E"]))


def period(unit: rverror.Reducer) -> Array:
    turns = true_period(unit)
    return np.asarray(2 * np.pi * np.arange(4096 * turns) / 4096)


def empirical(frame: str, harmonic: int, **sizes: Any) -> rverror.Effect:
    return rverror.effect("empirical.order", frame=frame, harmonic=harmonic, **sizes)


# --- what it is -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", UNITS)
@pytest.mark.parametrize(
    ("frame", "harmonic", "key", "indices", "share"),
    [
        ("output", 2, "sensor.encoder_ellipticity", {}, 1e-9),
        ("planet", 1, "involute.planet_eccentricity", {"crank": 0}, 1e-9),
        ("planet", 2, "involute.planet_pitch", {"crank": 1, "harmonic": 2}, 1e-9),
        ("sun", 6, "involute.sun_pitch", {"harmonic": 6}, 1e-9),
        # pins that enter and leave the loaded half put a ripple of the cycloid mesh on these
        ("crank", 1, "crank.eccentricity", {"crank": 1, "disc": 0}, 0.01),
        ("disc", 3, "cycloid.disc_pitch", {"disc": 1, "harmonic": 3}, 0.01),
        ("housing", 2, "cycloid.pin_circle", {"harmonic": 2}, 0.05),
    ],
)
def test_an_error_fixed_in_a_frame_is_spanned_by_its_empirical_order(
    name: str, frame: str, harmonic: int, key: str, indices: dict[str, Any], share: float
) -> None:
    """The orders are those that errors of the parts have in the closed form, whatever the tooth numbers."""
    unit = UNITS[name]
    theta = period(unit)
    wave = rverror.influence(unit, theta, key, **indices).matrix
    basis = rverror.influence(unit, theta, "empirical.order", frame=frame, harmonic=harmonic).matrix
    basis = np.vstack([basis, np.ones_like(theta)])
    left = wave - np.linalg.lstsq(basis.T, wave.T, rcond=None)[0].T @ basis
    assert np.ptp(wave) > 0
    assert np.ptp(left, axis=1).max() < share * np.ptp(wave)


@pytest.mark.parametrize("name", UNITS)
@pytest.mark.parametrize("frame", FRAMES)
def test_sizes_are_the_cosine_and_the_sine_of_so_many_whole_waves(name: str, frame: str) -> None:
    """Both terms at the start and a quarter wave on, and as many waves in a period as the frame's order says."""
    unit = UNITS[name]
    order = 3 * fundamental_orders(unit)[frame]
    model = Model(unit, (empirical(frame, 3, cos="2 arcsec", sin="-1 arcsec"),))
    start = rverror.transmission_error(model, np.array([0.0, np.pi / 2, np.pi, 2 * np.pi]) / order, direction=1)
    np.testing.assert_allclose(start / ARCSEC, [2, -1, -2, 2], rtol=1e-9)
    turns = true_period(unit)
    fine = 2 * np.pi * turns * np.arange(16384 * turns) / (16384 * turns)  # the highest order is 4,680
    lines = abs(np.fft.rfft(rverror.transmission_error(model, fine, direction=1))) * 2 / fine.size
    assert lines.argmax() == round(order * turns)
    assert lines.max() / ARCSEC == pytest.approx(np.hypot(2, 1), rel=1e-6)


@pytest.mark.parametrize("frame", FRAMES)
@pytest.mark.parametrize("direction", [1, -1])
def test_it_is_read_and_felt_by_no_contact(frame: str, direction: int) -> None:
    """Under load it comes on top of what the gear train does: the same at any load and in both directions."""
    theta = np.linspace(0.1, 1.7, 9)
    part = rverror.effect("cycloid.pin_position", pin=3, radial="20 um")
    line = empirical(frame, 2, cos="4 arcsec", sin="1 arcsec")
    alone = rverror.transmission_error(Model(UNITS["RV-40E"], (line,)), theta)
    for torque in (20e3, 412e3):
        states = [
            rverror.equilibrium(Model(UNITS["RV-40E"], effects), theta, torque=torque, direction=direction)
            for effects in ((part,), (part, line))
        ]
        without, with_it = (state.transmission_error for state in states)
        np.testing.assert_allclose(with_it - without, alone, rtol=0, atol=1e-12)
        for contact, force in states[0].contact_forces.items():
            np.testing.assert_array_equal(states[1].contact_forces[contact], force)


@pytest.mark.parametrize("torque", [None, 20e3])
@pytest.mark.parametrize("frame", FRAMES)
def test_a_run_is_predicted_with_it(frame: str, torque: float | None) -> None:
    theta = 2 * np.pi * np.arange(512) / 512
    model = Model(UNITS["RV-40E"], (rverror.effect("crank.index", crank=0, angle="1 mrad"),))
    line = empirical(frame, 3, cos="4 arcsec", sin="-3 arcsec")
    order = 3 * fundamental_orders(UNITS["RV-40E"])[frame]
    conditions = OperatingConditions(theta, 1.0, torque)
    found, without = predict(model.with_effects(line), conditions), predict(model, conditions)
    wave = np.stack([np.cos(order * theta), np.sin(order * theta)])
    np.testing.assert_allclose(found.matrix[-2:], wave, rtol=0, atol=1e-12)
    added = found.transmission_error - without.transmission_error
    np.testing.assert_allclose(added / ARCSEC, np.array([4, -3]) @ wave, rtol=0, atol=1e-6)


def test_a_frame_without_a_reducer_is_refused() -> None:
    angle = np.zeros(3)
    bare = Pose(ratio=121.0, theta=angle, direction=np.ones(3))
    assert source("empirical.order").vector(bare, frame="output", harmonic=2) is not None
    with pytest.raises(ValueError, match="frame 'sun' needs the pose of a reducer"):
        source("empirical.order").vector(bare, frame="sun", harmonic=2)


def test_it_is_no_candidate_and_says_that_it_explains_nothing() -> None:
    entry = CATALOGUE["empirical.order"]
    assert not entry.tried
    assert entry.at_output
    assert "does not explain" in entry.summary
    assert not entry.applies_to(Drive(ratio=20.0))


# --- model files ------------------------------------------------------------------------------------------------------

FILE = '[reducer]\npreset = "RV-40E"\n\n[[effect]]\nkey = "empirical.order"\n'


@pytest.mark.parametrize("frame", FRAMES)
def test_model_file(tmp_path: Any, frame: str) -> None:
    file, again = tmp_path / "model.toml", tmp_path / "again.toml"
    file.write_text(f'{FILE}frame = "{frame}"\nharmonic = 36\ncos = "1 arcsec"\n')
    model = rverror.load_model(file)
    assert model.effects == (empirical(frame, 36, cos=ARCSEC),)
    rverror.save_model(again, model)
    assert rverror.load_model(again) == model


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ('frame = "wheel"\nharmonic = 2', r"line 6: empirical.order: frame = 'wheel'; it must be one of 'output', "),
        ('frame = "sun"\nharmonic = 0', r"line 7: empirical.order: harmonic = 0; it must be one of 1 to 999"),
        ('frame = "sun"', r"line 5: empirical.order: index 'harmonic' is missing"),
        ("harmonic = 2", r"line 5: empirical.order: index 'frame' is missing"),
    ],
)
def test_model_file_with_a_mistake(tmp_path: Any, lines: str, message: str) -> None:
    file = tmp_path / "model.toml"
    file.write_text(f'{FILE}{lines}\ncos = "1 arcsec"\n')
    with pytest.raises(InputError, match=message):
        rverror.load_model(file)


def test_the_model_file_of_the_page_loads(tmp_path: Any) -> None:
    page = text(DOCS / "adding-an-effect.md")
    file = tmp_path / "model.toml"
    file.write_text(page.partition("```toml\n")[2].partition("```")[0])
    (effect,) = rverror.load_model(file).effects
    assert (effect.key, dict(effect.indices)) == ("empirical.order", {"frame": "output", "harmonic": 36})


def test_the_page_tells_the_orders_of_the_frames() -> None:
    page = " ".join(text(DOCS / "adding-an-effect.md").split())
    said = page.partition("the order of an error fixed in the frame: ")[2].partition(" of an RV-40E")[0]
    told: dict[str, float] = {}
    for group in re.split(r", (?=\d)", said):  # 40 for `carrier`, `disc`
        number, _, names = group.partition(" for ")
        told |= dict.fromkeys(re.findall(r"`([^`]+)`", names), float(number))
    assert told == fundamental_orders(UNITS["RV-40E"])


# --- sources outside the package --------------------------------------------------------------------------------------


def mine(key: str = "sensor.coupling_offset") -> Source:
    return dataclasses.replace(source("sensor.encoder_eccentricity"), key=key)


def test_a_source_is_known_within_its_block_and_nowhere_else(tmp_path: Any) -> None:
    file = tmp_path / "model.toml"
    file.write_text(FILE.replace("empirical.order", mine().key) + 'cos = "1 arcsec"\n')
    before = dict(CATALOGUE)
    with extended(mine()):
        assert dict(CATALOGUE) == before | {mine().key: mine()}
        assert len(CATALOGUE) == len(before) + 1
        assert list(CATALOGUE)[-1] == mine().key
        model = rverror.load_model(file)
        theta = np.linspace(0, 1, 5)
        np.testing.assert_allclose(rverror.transmission_error(model, theta), ARCSEC * np.cos(theta))
        with pytest.raises(TypeError):
            CATALOGUE["new"] = mine()  # type: ignore[index]
    assert dict(CATALOGUE) == before
    with pytest.raises(InputError, match="no error source"):
        rverror.load_model(file)


def test_blocks_nest_and_an_error_leaves_nothing_behind() -> None:
    with extended(mine("sensor.a")):
        with contextlib.suppress(RuntimeError), extended(mine("sensor.b"), mine("load.c")):
            assert {"sensor.a", "sensor.b", "load.c"} <= set(CATALOGUE)
            raise RuntimeError
        assert "sensor.a" in CATALOGUE
        assert "sensor.b" not in CATALOGUE
    assert "sensor.a" not in CATALOGUE


def test_another_thread_sees_the_package_alone() -> None:
    seen: list[bool] = []
    with extended(mine()):
        thread = threading.Thread(target=lambda: seen.append(mine().key in CATALOGUE))
        thread.start()
        thread.join()
    assert seen == [False]


@pytest.mark.parametrize("key", ["crank.index", "sensor.a"])
def test_a_key_that_is_taken_is_refused(key: str) -> None:
    with (
        extended(mine("sensor.a")),
        pytest.raises(ValueError, match=f"{key}: the catalogue has a source of this key"),
        extended(mine(key)),
    ):
        pass
    with pytest.raises(ValueError, match=r"sensor\.a: the"), extended(mine("sensor.a"), mine("sensor.a")):
        pass
