"""Runs of a drive through the coordinates of their rows say what they say sample by sample."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import rverror
from rverror.base.units import ARCSEC
from rverror.diagnosis.gears.fit import Fit, evaluated, fitted
from rverror.diagnosis.noise import RunNoise
from rverror.diagnosis.policy import POLICY
from rverror.diagnosis.samples.drive_set import DriveSet, candidates_of_drive, drive_set
from rverror.diagnosis.samples.drives import compressed
from rverror.diagnosis.samples.records import records_of_drive

DRIVE = rverror.Model(rverror.Drive(ratio=20.0, shafts={"motor": 20.0, "idler": 7.0}))


def run_of(seed: int, *, swings: bool) -> rverror.Run:
    rng = np.random.default_rng(seed)
    time = 0.01 * np.arange(700)
    theta = 0.5 * np.sin(2.0 * time) if swings else 1.7 * time
    error = 8 * np.cos(20 * theta) + 30 * time + np.cumsum(rng.normal(0, 0.1, time.size)) + rng.normal(size=time.size)
    return rverror.run_from_arrays(input_angle=20 * theta, te=error * ARCSEC, time=time, direction="mixed")


def bench_of(
    seed: int, *, swings: tuple[bool, ...], noise: RunNoise, orders: tuple[float, ...], slow: bool
) -> DriveSet:
    records, _ = records_of_drive(DRIVE, [run_of(seed + at, swings=one) for at, one in enumerate(swings)])
    bench = drive_set(DRIVE, records, POLICY, candidates_of_drive(DRIVE, records, POLICY))
    made = [replace(record, noise=noise, orders=orders, slow=slow) for record in records]
    return replace(bench, records=tuple(made))


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 1000),
    swings=st.sampled_from([(False,), (True,), (True, False)]),
    memory=st.sampled_from([0.0, 0.6, 0.97]),
    walk=st.sampled_from([0.0, 0.05]),
    orders=st.sampled_from([(), (33.0,), (33.0, 12.4)]),
    slow=st.booleans(),
)
def test_a_compressed_fit_is_the_fit_to_every_sample(
    seed: int, swings: tuple[bool, ...], memory: float, walk: float, orders: tuple[float, ...], slow: bool
) -> None:
    """Rows that settle may be sums of each other: over a swing the two bows and the lost motion nearly are."""
    noise = RunNoise(np.array([memory]), 0.8 * ARCSEC, walk)
    bench = bench_of(seed, swings=swings, noise=noise, orders=orders, slow=slow)
    model = DRIVE.with_effects(*(rverror.Effect(key, dict(at), sizes) for key, at, sizes in CAUSES))
    every = evaluated(bench, model, DRIVE)
    few = compressed(every)
    assert few.bench.sights[0].width < 0.1 * every.bench.sights[0].width
    same(few, every)
    same(fitted(few), fitted(every))


CAUSES: tuple[tuple[str, dict[str, Any], tuple[float, ...]], ...] = (
    ("shaft.eccentricity", {"shaft": "motor", "harmonic": 1}, (5 * ARCSEC, -2 * ARCSEC)),
    ("sensor.drift", {}, (20 * ARCSEC,)),
)


def same(few: Fit, every: Fit) -> None:
    size = np.sqrt(np.maximum(np.diag(every.gram), 1e-300))
    assert few.bench.freedom == every.bench.freedom
    assert few.data == pytest.approx(every.data, rel=1e-6)
    assert few.gram / np.outer(size, size) == pytest.approx(every.gram / np.outer(size, size), abs=1e-6)
    assert few.moment / size == pytest.approx(every.moment / size, abs=1e-6 * np.sqrt(every.data))


def test_rows_that_are_sums_of_others_take_nothing_more_off() -> None:
    """One line twice: a direction that rounding leaves would be a whole row of so few."""
    noise = RunNoise(np.zeros(0), ARCSEC)
    bench = bench_of(3, swings=(True,), noise=noise, orders=(33.0, 33.0), slow=True)
    once = bench_of(3, swings=(True,), noise=noise, orders=(33.0,), slow=True)
    twice, single = (compressed(evaluated(b, DRIVE, DRIVE)) for b in (bench, once))
    assert twice.data == pytest.approx(single.data, rel=1e-9)
