"""Faults of a run: what is found, what is left alone, and how often chance is taken for a fault."""

from __future__ import annotations

import dataclasses
import functools
import math
import time
from itertools import product
from pathlib import Path

import numpy as np
import pytest
import scipy
from hypothesis import example, given, settings, strategies as st

import rverror
from recordings import bench
from rverror.base.arrays import Array
from rverror.base.units import ARCSEC
from rverror.runs.fault_bounds import FaultBounds
from rverror.runs.faults import Faults, find_faults
from rverror.runs.faults_as_read import NEAR, Sides
from rverror.runs.measurement import load_run
from rverror.runs.virtual_bench import coloured_noise, quantised

TURN = 2 * math.pi
POINTS = 2048
N = 3 * POINTS
THETA = TURN / POINTS * np.arange(N)
#: Some 0.5 arcsec: what is white of it, what is correlated.
WHITE, SLOW = 0.4 * ARCSEC, 0.28 * ARCSEC
CORRELATIONS = (4, 10, 20, 40)


def noise(seed: int, correlation: float = 10, n: int = N) -> Array:
    random = np.random.default_rng(seed)
    return WHITE * random.standard_normal(n) + coloured_noise(
        n, rms=SLOW, step=1, correlation=correlation, random=random
    )


@functools.cache
def gear_error(unit: int, torque: float) -> Array:
    """One turn of a loaded unit whose errors open contacts: kinks everywhere, steps from contact to contact."""
    random = np.random.default_rng(unit)

    def some(size: float) -> str:
        return f"{size * random.standard_normal():.3f} um"

    effects = [
        rverror.effect("cycloid.disc_pitch", disc=disc, harmonic=h, cos=some(4), sin=some(4))
        for disc in (0, 1)
        for h in (1, 2, 3)
    ]
    effects += [
        rverror.effect("cycloid.pin_position", pin=pin, radial=some(12), tangential=some(12))
        for pin in (5, 17, 28)[: 3 * (unit % 2)]
    ]
    effects.append(rverror.effect("cycloid.disc_lobe", disc=0, lobe=5, deviation=some(10)))
    effects.append(rverror.effect("crank.bearing_clearance", clearance="5 um"))
    model = rverror.Model(rverror.reducer("RV-40E"), tuple(effects))
    return rverror.equilibrium(model, THETA[:POINTS], torque=torque, direction=1.0).transmission_error


UNITS = [(unit, torque) for unit in range(4) for torque in (5e3, 20e3)]


def as_read(unit: int = 1, torque: float = 5e3, *, seed: int | None = 0) -> Array:
    """Three turns of a unit, with noise unless the seed is None."""
    error = np.tile(gear_error(unit, torque), 3)
    return error if seed is None else error + noise(seed)


def spikes_of(found: Faults) -> list[int]:
    return [int(i) for i in found.spikes]


# --- clean runs -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("unit", "torque"), UNITS)
def test_gear_error_is_no_fault(unit: int, torque: float) -> None:
    exact = as_read(unit, torque, seed=None)
    near_nyquist = 2 * ARCSEC * np.cos(1080 * THETA) + 1.5 * ARCSEC * np.cos(1560 * THETA)
    uneven = np.sort(THETA + 0.4 * THETA[1] * np.random.default_rng(unit).uniform(-1, 1, N))
    at_uneven = np.interp(uneven % TURN, THETA[:POINTS], exact[:POINTS])
    runs = {
        "exact": (THETA, exact),
        "noisy": (THETA, exact + noise(unit)),
        "near the Nyquist order": (THETA, exact + near_nyquist + noise(unit)),
        "coarse counts": (THETA, quantised(THETA + exact + 0.1 * noise(unit), 2**17) - THETA),
        "fine counts": (THETA, quantised(THETA + exact + 0.1 * noise(unit), 2**23) - THETA),
        "few samples": (THETA[::4], (exact + noise(unit))[::4]),
        "part of a turn": (THETA[:205], (exact + noise(unit))[:205]),
        "backwards": (THETA[::-1], (exact + noise(unit))[::-1]),
        "uneven": (uneven, at_uneven + noise(unit)),
    }
    for name, (theta, error) in runs.items():
        found = find_faults(theta, error)
        assert found.notes() == (), name
        assert found.kept.all()


def test_chance_is_no_fault() -> None:
    """Of a thousand such runs three lost a sample, and none had a slip."""
    spikes = 0
    for seed in range(60):
        found = find_faults(THETA, noise(seed, CORRELATIONS[seed % 4]), residual=True)
        assert found.slips == ()
        spikes += found.spikes.size
    assert spikes <= 2


@pytest.mark.parametrize("n", [57, 205, POINTS])
def test_chance_is_no_fault_in_short_runs(n: int) -> None:
    found = [find_faults(THETA[:n], noise(seed, CORRELATIONS[seed % 4], n), residual=True) for seed in range(60)]
    assert sum(each.spikes.size for each in found) <= 2
    assert sum(len(each.slips) for each in found) == 0


def test_what_a_fit_left_is_no_slip() -> None:
    """Lines and drift that no fit took are slow, and pulses of a pin come again in each turn."""
    for seed, order in enumerate((1, 3, 17.63, 40, 120)):
        line = 2 * ARCSEC * np.cos(order * THETA + seed)
        assert find_faults(THETA, line + noise(seed, 40), residual=True).slips == ()
    assert find_faults(THETA, 10 * ARCSEC * THETA / THETA[-1] + noise(1), residual=True).slips == ()
    pulses = 4 * ARCSEC * np.isin(np.arange(N) % POINTS, [100, 151, 152, 900, 901, 902])
    assert find_faults(THETA, pulses + noise(2), residual=True).kept.all()


@pytest.mark.parametrize(("unit", "torque"), UNITS)
def test_spikes_beside_the_ends_are_set_aside_as_read(unit: int, torque: float) -> None:
    """Each end turned over gives its samples neighbours on both sides."""
    for places in ([0, 9], [1], [2, N - 3], [3, 11, N - 12], [5], [7, N - 8], [N - 2], [N - 1, 40]):
        error = as_read(unit, torque)
        error[places] += 200 * ARCSEC * np.resize([1, -2], len(places))
        assert spikes_of(find_faults(THETA, error)) == sorted(places), places


def test_waves_that_end_anywhere_have_no_spikes_at_their_ends() -> None:
    """Turned over, an end foretells but roughly: in waves far above the noise that is no reason."""
    rng = np.random.default_rng(4)
    for order in (3.0, 9.0, 40.0):
        for phase in np.arange(12) * TURN / 12:
            error = 3 * ARCSEC * np.sin(order * THETA + phase) + 0.01 * ARCSEC * rng.standard_normal(N)
            assert find_faults(THETA, error).spikes.size == 0, (order, phase)


@pytest.mark.parametrize("slope", [-6.0, 6.0])
def test_spikes_beside_the_ends_are_found_on_a_slope(slope: float) -> None:
    """A run may begin and end where the error rises; what a parabola takes out changes nothing."""
    level = as_read(1, 20e3)
    tilted = level + slope * ARCSEC * np.arange(N)
    assert find_faults(THETA, tilted).notes() == ()
    for place in [*range(8), *range(N - 8, N)]:
        error = tilted.copy()
        error[place] += 100 * ARCSEC
        assert spikes_of(find_faults(THETA, error)) == [place]


def test_an_error_that_bends_beside_an_end_has_no_spike() -> None:
    """A contact that closes bends the error, and the run may end in the middle of it."""
    for seed, (steepest, samples) in enumerate(product((2.0, 4.0, 8.0), (1, 2, 3, 4))):
        bent = as_read(1, 20e3, seed=seed)
        bent[N - 1 - samples :] -= steepest * ARCSEC * np.arange(samples + 1)
        if samples > 1:  # one sample that is off by itself may be either
            assert find_faults(THETA, bent).notes() == (), (steepest, samples)


@pytest.mark.parametrize("seed", range(4))
def test_what_comes_again_in_each_turn_is_the_gears_also_as_read(seed: int) -> None:
    """Sharp lobes, of hardly the same height in each turn, are none; a spike beside them is one."""
    rng = np.random.default_rng(seed)
    lobes = np.arange(60, POINTS, 97)
    at = (lobes + POINTS * np.arange(3)[:, None]).ravel()
    error = as_read(0, 20e3) + 0.05 * ARCSEC * rng.standard_normal(N)
    error[at] += rng.uniform(20, 30, at.size) * ARCSEC
    alone = POINTS + 155 + 97 * seed
    error[alone] += 25 * ARCSEC
    assert spikes_of(find_faults(THETA, error)) == [alone]
    # once in one turn only they are twenty spikes
    error[at[at > POINTS]] -= 25 * ARCSEC
    assert set(spikes_of(find_faults(THETA, error))) >= {*lobes.tolist(), alone}


@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize("turns", [0.25, 1, 3])
def test_a_lightly_loaded_gear_that_jumps_does_not_slip(turns: float, direction: float) -> None:
    """Lobes ground off by 12 um and cams off by 2 um hand 5 N*m on in some 80 jumps a turn, of 25 arcsec, one way."""
    cams = (((1.0, 1.8), (1.2, 0.5)), ((-1.9, 1.5), (-1.2, -0.8)))
    effects = [rverror.effect("cycloid.profile_modification", equidistant="3 um", shift="12 um")]
    effects += [
        rverror.effect("crank.eccentricity", crank=crank, disc=disc, radial=f"{r} um", tangential=f"{t} um")
        for crank, discs in enumerate(cams)
        for disc, (r, t) in enumerate(discs)
    ]
    model = rverror.Model(rverror.reducer("RV-40E"), tuple(effects))
    once = rverror.equilibrium(model, THETA[:POINTS], torque=5e3, direction=direction).transmission_error
    n = int(turns * POINTS)
    for seed in range(8):
        read = (np.tile(once, 3) + noise(seed))[:n]
        assert find_faults(THETA[:n], read).notes() == ()
        read[n // 2 :] += 100 * ARCSEC
        assert [slip.index for slip in find_faults(THETA[:n], read).slips] == [n // 2]


def test_a_step_that_comes_again_in_each_turn_is_the_gears() -> None:
    """It stands up over a part of each turn; a step of its size that comes once is a slip."""
    turn = as_read(0, 20e3)
    turn[np.arange(N) % POINTS // 300 == 2] += 40 * ARCSEC
    assert find_faults(THETA, turn).notes() == ()
    turn[4500:] += 40 * ARCSEC
    assert [slip.index for slip in find_faults(THETA, turn).slips] == [4500]


# --- spikes -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("unit", "torque"), UNITS)
def test_spikes_at_twenty_places(unit: int, torque: float) -> None:
    random = np.random.default_rng(unit)
    places = np.sort(random.choice(np.arange(20, N - 20), 20, replace=False))
    error = as_read(unit, torque)
    error[places] += 40 * ARCSEC * random.choice([-1, 1], 20)
    found = find_faults(THETA, error)
    assert spikes_of(found) == places.tolist()
    np.testing.assert_allclose(np.abs(found.sizes), 40 * ARCSEC, atol=10 * ARCSEC)
    assert found.slips == ()
    (note,) = found.notes()
    assert note.startswith("20 spikes set aside (samples ")
    assert " arcsec)" in note
    assert np.flatnonzero(~found.kept).tolist() == places.tolist()


@settings(deadline=None, max_examples=25)
@example(place=289, length=5, size=80.0, sign=1, unit=(0, 20e3))  # beside a sharp lobe
@example(place=2359, length=5, size=200.0, sign=1, unit=(2, 20e3))  # behind it samples look off from its first one
@given(
    place=st.integers(20, N - 30),
    length=st.integers(1, 5),
    size=st.floats(80, 3000),
    sign=st.sampled_from([-1, 1]),
    unit=st.sampled_from([(0, 5e3), (0, 20e3), (2, 5e3), (2, 20e3)]),
)
def test_a_burst_is_set_aside_wherever_it_lies(
    place: int, length: int, size: float, sign: int, unit: tuple[int, float]
) -> None:
    error = as_read(*unit)
    error[place : place + length] += sign * size * ARCSEC
    found = find_faults(THETA, error)
    found_at, whole = set(spikes_of(found)), set(range(place, place + length))
    assert whole <= found_at
    # a kink beside it may go with it, where what foretells a sample reaches over the burst
    assert len(found_at - whole) <= 2
    assert found_at <= set(range(place - NEAR, place + length + NEAR))
    assert found.slips == ()


def test_a_spike_of_eight_times_the_white_noise_is_found_in_the_residual() -> None:
    hits = total = 0
    for seed in range(12):
        random = np.random.default_rng(seed)
        places = random.choice(N, 10, replace=False)
        residual = noise(seed, CORRELATIONS[seed % 4])
        residual[places] += 8 * WHITE * random.choice([-1, 1], places.size)
        hits += np.isin(places, find_faults(THETA, residual, residual=True).spikes).sum()
        total += places.size
    assert hits >= 0.93 * total


def test_spikes_at_both_ends_are_found_in_the_residual() -> None:
    residual = noise(3)
    residual[[0, 2, N - 1]] += 10 * ARCSEC
    assert spikes_of(find_faults(THETA, residual, residual=True)) == [0, 2, N - 1]


@pytest.mark.parametrize("share", [0.02, 0.04])
def test_many_spikes_are_set_aside(share: float) -> None:
    random = np.random.default_rng(1)
    places = random.choice(N, int(share * N), replace=False)
    residual = noise(1)
    residual[places] += 40 * ARCSEC * random.choice([-1, 1], places.size)
    found = find_faults(THETA, residual, residual=True)
    assert np.isin(places, found.spikes).mean() > 0.98
    assert found.spikes.size < 1.05 * places.size


@pytest.mark.parametrize("share", [0.06, 0.1, 0.25])
def test_a_broken_channel_is_refused(share: float) -> None:
    random = np.random.default_rng(1)
    error = as_read()
    places = random.choice(N, int(share * N), replace=False)
    error[places] += 40 * ARCSEC * random.choice([-1, 1], places.size)
    with pytest.raises(ValueError, match=r"of 6144 samples \(.* %\) are spikes, at most 5 % .* check cable") as caught:
        find_faults(THETA, error)
    assert "\n" not in str(caught.value)


# --- slips ------------------------------------------------------------------------------------------------------------


@settings(deadline=None, max_examples=40)
@given(
    place=st.integers(20, N - 20),
    size=st.floats(45, 1e7),
    sign=st.sampled_from([-1, 1]),
    unit=st.sampled_from([(0, 5e3), (0, 20e3), (2, 20e3)]),
)
def test_a_slip_is_certain_as_read(place: int, size: float, sign: int, unit: tuple[int, float]) -> None:
    """From 45 arcsec; of those of 30 one in 30, beside a lobe as sharp, passes for spikes."""
    error = as_read(*unit)
    error[place:] += sign * size * ARCSEC
    found = find_faults(THETA, error)
    (slip,) = found.slips
    assert abs(slip.index - place) <= 1
    assert slip.theta == THETA[slip.index]
    assert slip.size == pytest.approx(sign * size * ARCSEC, abs=max(8 * slip.uncertainty, 3 * ARCSEC))
    assert found.spikes.size == 0
    assert found.shift()[[0, -1]].tolist() == [0, slip.size]


def test_a_small_slip_is_found_in_the_residual() -> None:
    """1 arcsec in noise of 0.5 arcsec, whatever its colour, with a fair uncertainty."""
    misses, off = 0, []
    for seed in range(24):
        place = int(np.random.default_rng(seed).integers(300, N - 300))
        residual = noise(seed, CORRELATIONS[seed % 4])
        residual[place:] += ARCSEC
        found = find_faults(THETA, residual, residual=True).slips
        misses += len(found) != 1
        off += [(slip.size - ARCSEC) / slip.uncertainty for slip in found[:1]]
    assert misses <= 2
    assert 0.5 < np.std(off) < 1.6


def test_the_transition_of_a_slip_is_set_aside() -> None:
    residual = noise(4)
    residual[3000:] += ARCSEC
    residual[2999] += 0.5 * ARCSEC
    found = find_faults(THETA, residual, residual=True)
    (slip,) = found.slips
    out = np.flatnonzero(~found.kept)
    assert out.size < 60
    assert abs(out - 3000).max(initial=0) < 60
    assert found.kept[slip.index]


def test_slips_that_bound_a_stretch() -> None:
    error = as_read(0, 20e3)
    error[2500:2900] += 30 * ARCSEC
    up, down = find_faults(THETA, error).slips
    assert (up.index, down.index) == (2500, 2900)
    assert up.size == pytest.approx(-down.size, rel=0.15)


@pytest.mark.parametrize("power", [8, 12, 17, 22])
def test_a_counter_of_the_output_that_jumps(power: int) -> None:
    step = TURN / 2**23
    error = as_read(0, 20e3)
    reading = quantised(THETA + error, 2**23)
    reading[2500:] += 2**power * step
    found = find_faults(THETA, reading - THETA)
    assert found.count == pytest.approx(step, rel=1e-3)
    (slip,) = found.slips
    assert slip.index == 2500
    assert slip.size == pytest.approx(2**power * step, abs=3 * ARCSEC)
    assert not slip.of_input


@pytest.mark.parametrize("jump", [2**12 * TURN / 2**17 / 121, TURN / 121, -TURN / 121, 30 * TURN / 121])
def test_a_counter_of_the_input_that_jumps_takes_the_shorter_side_along(jump: float) -> None:
    error = as_read(0, 20e3)
    theta = THETA + jump * (np.arange(N) >= 2500)
    found = find_faults(theta, THETA + error - theta)
    (slip,) = found.slips
    assert slip.of_input
    assert not found.kept[:2500].any()
    assert found.kept[2500:].all()
    (note,) = found.notes()
    assert "the counter of the input jumps at sample 2500" in note


def test_a_step_over_a_gap() -> None:
    error = as_read(0, 20e3)
    error[2500:] += 400 * ARCSEC
    have = np.r_[:2500, 2600:N]
    found = find_faults(THETA[have], error[have])
    (slip,), (gap,) = found.slips, found.gaps
    assert slip.index == gap.index == 2500
    assert slip.size == pytest.approx(400 * ARCSEC, rel=0.2)


def test_a_reading_that_slips_too_often_is_refused() -> None:
    residual = noise(1) + 40 * ARCSEC * (np.arange(N) // 250)
    with pytest.raises(ValueError, match=r"the reading slips 2. times, at most 20 times .* check the coupling"):
        find_faults(THETA, residual, residual=True)


def test_the_second_pass_adds_to_the_first() -> None:
    gear = as_read(0, 20e3, seed=None)
    error = gear + noise(5)
    error[1000] += 40 * ARCSEC
    error[2000] += 4 * ARCSEC
    error[3000:] += 30 * ARCSEC
    error[4500:] += 1.5 * ARCSEC
    first = find_faults(THETA, error)
    assert spikes_of(first) == [1000]
    assert [slip.index for slip in first.slips] == [3000]
    second = find_faults(THETA, error - gear - first.shift(), residual=True, earlier=first)
    assert spikes_of(second) == [1000, 2000]
    large, small = second.slips
    assert large.index == 3000
    assert large.size == pytest.approx(30 * ARCSEC, abs=4 * large.uncertainty)
    assert large.uncertainty < first.slips[0].uncertainty
    assert abs(small.index - 4500) < 15
    assert small.size == pytest.approx(1.5 * ARCSEC, abs=4 * small.uncertainty)
    assert spikes_of(first) == [1000]  # the first is what it was


# --- the series of angles ---------------------------------------------------------------------------------------------


def test_samples_missing_at_random() -> None:
    have = np.sort(np.random.default_rng(1).choice(N, N - 61, replace=False))
    found = find_faults(THETA[have], as_read()[have])
    assert found.kept.all()
    missing = N - have.size - (have[0] + N - 1 - have[-1])
    assert sum(gap.samples for gap in found.gaps) == missing
    (note,) = found.notes()
    assert f"{missing} samples missing" in note


def test_a_hole() -> None:
    have = np.r_[:3000, 3307:N]
    found = find_faults(THETA[have], as_read()[have])
    (gap,) = found.gaps
    assert (gap.index, gap.theta, gap.samples) == (3000, THETA[2999], 307)
    assert gap.span == pytest.approx(307 * THETA[1], rel=1e-6)
    assert found.notes() == ("1 gap, 307 samples missing (the widest, 54 deg, before sample 3000)",)


def test_the_noise_is_searched_through_holes() -> None:
    """Neither missing samples nor a hole hide a slip or make one."""
    have = np.sort(np.random.default_rng(2).choice(np.r_[:3000, 3300:N], N - 400, replace=False))
    residual = noise(2)[have]
    assert find_faults(THETA[have], residual, residual=True).slips == ()
    place = int(np.searchsorted(have, 4000))
    residual[place:] += 1.5 * ARCSEC
    (slip,) = find_faults(THETA[have], residual, residual=True).slips
    assert abs(slip.index - place) < 15


@pytest.mark.parametrize("missing", [200, 600])
@pytest.mark.parametrize("memory", [(1.2, -0.8), (1.9, -0.95), (0.9,)])
def test_a_hole_makes_no_fault_of_noise_that_swings(memory: tuple[float, ...], missing: int) -> None:
    """A missing sample is an unknown, and the noise is no whiter for it."""
    rng = np.random.default_rng(3)
    swinging = scipy.signal.lfilter([1.0], [1.0, *(-c for c in memory)], rng.normal(0, 0.1 * ARCSEC, N))
    have = np.sort(rng.choice(N, N - missing, replace=False))
    found = find_faults(THETA[have], swinging[have], residual=True)
    assert found.slips == ()
    assert not found.spikes.size


def remembering(seed: int, memory: float) -> Array:
    """Noise of which each sample remembers the one before, its steps 0.1 arcsec."""
    steps = np.random.default_rng(seed).normal(0, 0.1 * ARCSEC, N + 1000)
    return np.asarray(scipy.signal.lfilter([1.0], [1.0, -memory], steps)[1000:])


def test_a_spike_between_missing_samples_counts_by_what_those_beyond_them_tell() -> None:
    """Of noise with the memory m a sample with two missing to either side has the variance v (1 - m^6)/(1 + m^6) beside
    the rest, of the noise's own v: three times that beside its neighbours."""
    memory, places = 0.99, np.arange(600, N, 700)
    deviation = 0.1 * ARCSEC * math.sqrt((1 - memory**6) / (1 + memory**6) / (1 - memory**2))
    have = np.setdiff1d(np.arange(N), (places[:, None] + [-2, -1, 1, 2]).ravel())
    residual = remembering(1, memory)
    residual[places] += 8.5 * deviation
    found = find_faults(THETA[have], residual[have], residual=True)
    assert np.array_equal(have[spikes_of(found)], places)


def test_a_burst_of_the_residual_is_set_aside_from_its_first_sample_to_its_last() -> None:
    """Of white noise each of its samples would pass alone, 4.5 deviations where 5 are none."""
    for seed in range(6):
        residual = remembering(seed, 0.0)
        residual[3000:3005] = 0.45 * ARCSEC
        found = find_faults(THETA, residual, residual=True)
        assert spikes_of(found) == [*range(3000, 3005)]


def test_the_first_samples_of_noise_that_swings_are_no_spikes() -> None:
    """They have a shorter past: taken for zeros, what was before them would make spikes."""
    for seed in range(10):
        steps = np.random.default_rng(seed).normal(0, 0.1 * ARCSEC, N + 1000)
        swinging = scipy.signal.lfilter([1.0], [1.0, -1.9, 0.95], steps)[1000:]
        assert not find_faults(THETA, swinging, residual=True).spikes.size


def test_doubled_rows() -> None:
    rows = np.sort(np.r_[:N, np.random.default_rng(1).choice(N, 30, replace=False)])
    error = as_read()[rows]
    found = find_faults(THETA[rows], error)
    assert found.doubled == 30
    assert np.count_nonzero(found.kept) == N
    assert found.notes() == ("30 doubled rows left out",)
    again = np.concatenate([[False], np.diff(rows) == 0])
    error[again] += 0.3 * ARCSEC
    other = find_faults(THETA[rows], error)
    assert other.kept.all()
    assert other.notes() == ()


def test_standstill() -> None:
    rows = np.r_[:2000, [2000] * 40, 2001:N]
    error = as_read(seed=None)[rows] + noise(1, n=rows.size)
    found = find_faults(THETA[rows], error)
    assert found.still == ((2000, 40),)
    assert np.count_nonzero(~found.kept) == 39
    assert found.notes() == ("the angle stands still for 40 samples from sample 2000; one of them is kept",)


def test_slow_counts_are_no_standstill() -> None:
    theta = quantised(TURN / 2**17 * np.arange(8000), 2**14)  # each angle eight times
    found = find_faults(theta, noise(1, n=8000))
    assert found.notes() == ()
    assert found.kept.all()


def test_two_runs_in_one_and_both_directions() -> None:
    error = as_read()
    twice = find_faults(np.r_[THETA, THETA], np.r_[error, error])
    assert twice.notes() == (
        "the angle jumps back by 1080 deg at sample 6144: two runs in one, or a counter that starts again",
    )
    lost_motion = np.r_[error, error[::-1] - 60 * ARCSEC]
    both = find_faults(np.r_[THETA, THETA[::-1] - 0.5 * THETA[1]], lost_motion)
    assert both.turned == (N,)
    assert both.slips == ()
    assert both.spikes.size == 0
    assert both.notes() == ()


@settings(deadline=None, max_examples=40)
@given(
    theta=st.lists(st.floats(-1e3, 1e3), min_size=0, max_size=80),
    seed=st.integers(0, 99),
    residual=st.booleans(),
    same=st.booleans(),
)
def test_any_row_of_numbers_is_answered(theta: list[float], seed: int, residual: bool, same: bool) -> None:
    """Whatever the angles: masks and places fit, and nothing is changed."""
    angle = np.array(theta)
    error = np.zeros(angle.size) if same else ARCSEC * np.random.default_rng(seed).standard_cauchy(angle.size)
    before = angle.copy(), error.copy()
    try:
        found = find_faults(angle, error, residual=residual)
    except ValueError:
        return
    np.testing.assert_array_equal(angle, before[0])
    np.testing.assert_array_equal(error, before[1])
    assert found.kept.shape == angle.shape
    assert not found.kept[found.spikes].any()
    assert found.spikes.size == found.sizes.size
    assert all(len(line.splitlines()) == 1 for line in found.notes())


@pytest.mark.parametrize(
    ("theta", "error"), [(THETA, THETA[1:]), (THETA[None], THETA[None]), (THETA, np.full(N, np.nan))]
)
def test_what_is_no_row_of_numbers_is_refused(theta: Array, error: Array) -> None:
    with pytest.raises(ValueError, match="rows of finite numbers, of the same length"):
        find_faults(theta, error)


# --- the virtual bench, time, the page --------------------------------------------------------------------------------


@pytest.mark.parametrize("way", ["forward", "reverse"])
def test_bench_runs(way: str) -> None:
    for unit in ("train-2", "train-3", "train-5"):
        model = rverror.load_model(bench(unit, "model.toml"))
        run = load_run(bench(unit, f"{way}.csv"), model)
        assert find_faults(run.nominal_angle(model), run.error(model)).notes() == ()
    model = rverror.load_model(bench("real-9", "model.toml"))
    run = load_run(bench("real-9", f"{way}_20Nm.csv"), model)
    found = find_faults(run.nominal_angle(model), run.error(model))
    places = {"forward": [406, 3267, 3838, 4459], "reverse": [1845, 2845, 5641, 6193]}
    assert spikes_of(found) == places[way]
    np.testing.assert_allclose(np.abs(found.sizes), 40 * ARCSEC, atol=2 * ARCSEC)


def test_both_passes_are_fast() -> None:
    error, residual = as_read(), noise(1)
    find_faults(THETA, error)
    best = math.inf
    for _ in range(5):  # the machine may be busy
        start = time.process_time()
        find_faults(THETA, residual, residual=True, earlier=find_faults(THETA, error))
        best = min(best, time.process_time() - start)
    assert best < 0.1


def test_the_page_has_every_threshold() -> None:
    page = (Path(__file__).parents[2] / "docs" / "theory" / "faults.md").read_text(encoding="utf-8")
    bounds = FaultBounds()
    for field in dataclasses.fields(bounds):
        assert f"| `{field.name}` | {getattr(bounds, field.name)} |" in page, field.name


@pytest.mark.parametrize("width", [0, 1, 3])
def test_a_step_is_read_half_way_between_its_samples(width: int) -> None:
    """What is even about that place looks alike from both sides: its parabolas meet there, and not at a sample."""
    sides, first = Sides(0.01 * np.arange(120.0)), 60
    middle = first + (width - 1) / 2
    places, steps = sides.steps(sides.fitted((np.arange(120.0) - middle) ** 4), width)
    beside = np.abs(places - first)
    assert abs(steps[beside == 0][0]) < 1e-6 * np.abs(steps[beside == 1]).min()
