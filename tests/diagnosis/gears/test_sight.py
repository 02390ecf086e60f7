"""How a run sees waveforms of the gear train, and what is added beyond them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import rverror
from gear_runs import TURN, UNIT, record_of
from rverror.base.units import ARCSEC
from rverror.diagnosis.gears.fit import RunSet
from rverror.diagnosis.gears.sight import EverySample
from rverror.diagnosis.gears.waveform import Waveform
from rverror.diagnosis.policy import POLICY


@pytest.mark.parametrize("offset", [0.0, 0.37])
def test_a_waveform_of_one_turn_of_the_crank_is_read_at_the_samples(offset: float) -> None:
    """Also where the marks stand elsewhere: then it is read that much further on."""
    record = replace(record_of(np.zeros(900)), theta=np.sort(np.random.default_rng(7).uniform(0, TURN, 900)))
    bench, full = RunSet.of(UNIT, [record], POLICY, points=512, anywhere=False), EverySample(record)
    repeat = bench.conditions[0].repeat(UNIT)
    assert repeat.points * repeat.step == pytest.approx(TURN / 16)
    error = 5 * ARCSEC * np.cos(16 * repeat.theta) + ARCSEC * np.sin(64 * repeat.theta)
    wave = Waveform(repeat, error, np.zeros((0, repeat.points)), np.zeros((9, repeat.points)), (), UNIT)
    angle = record.theta + offset
    expected = 5 * ARCSEC * np.cos(16 * angle) + ARCSEC * np.sin(64 * angle)
    assert full.of_wave(wave, error[None], offset)[0] == pytest.approx(expected, abs=1e-3 * ARCSEC)
    slope = -80 * ARCSEC * np.sin(16 * angle) + 64 * ARCSEC * np.cos(64 * angle)
    assert full.change(wave, offset) == pytest.approx(slope, abs=1e-3 * ARCSEC)


def test_only_a_sun_is_added_by_its_influence_and_only_where_it_must() -> None:
    """Where its turns do not close with the output's."""
    odd = replace(UNIT, sun_teeth=10, module=54 / 37, crank_circle_radius=None)
    for unit, apart in ((UNIT, False), (odd, True)):
        bench = RunSet.of(unit, [record_of(np.zeros(64))], POLICY, points=64, anywhere=False)
        assert bench.apart("involute.sun_pitch") is apart
        effects = (
            rverror.effect("involute.sun_pitch", harmonic=2, cos="6 um"),
            rverror.effect("crank.eccentricity", crank=0, disc=0, radial="1 um"),
            rverror.effect("sensor.encoder_eccentricity", cos="1 arcsec"),
        )
        assert bench.around(rverror.Model(unit, effects)) == (effects[1:2] if apart else effects[:2])
        assert not any(bench.apart(effect.key) for effect in effects[1:])


def test_a_coarser_bench_has_fewer_angles_of_the_same_turn() -> None:
    bench = RunSet.of(UNIT, [record_of(np.zeros(2048))], POLICY, points=2048, anywhere=False)
    turn = bench.coarser(512).conditions[0].turn
    assert (turn.points, turn.start) == (512, bench.conditions[0].turn.start)
    assert turn.points * turn.step == pytest.approx(TURN)
    assert bench.coarser(2048) is bench
