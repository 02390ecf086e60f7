"""The kernel of very many virtual units: against plain sums."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, strategies as st

import rverror
from rverror.base.units import ARCSEC
from rverror.tolerances.declared import tolerance
from rverror.tolerances.extremes import TOLERANCE, kernel
from rverror.tolerances.stacking import stack

SIZES = ("peak_to_peak", "max", "rms", "offset")


def plain(waveforms: np.ndarray, nominal: np.ndarray, row: np.ndarray) -> dict[str, float]:
    """Sizes of one combination, sample by sample in exact fractions."""
    te = [Fraction(float(value)) for value in nominal]
    for x, waveform in zip(row, waveforms, strict=True):
        te = [value + Fraction(float(x)) * Fraction(float(w)) for value, w in zip(te, waveform, strict=True)]
    mean = sum(te) / len(te)
    return {
        "peak_to_peak": float(max(te) - min(te)),
        "max": float(max(abs(value - mean) for value in te)),
        "rms": math.sqrt(sum((value - mean) ** 2 for value in te) / len(te)),
        "offset": float(mean),
    }


@st.composite
def combinations(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Waveforms, nominal and values: noise, few orders, common repeats, kinks, constants; any number of angles."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    n = draw(st.sampled_from([1, 2, 3, 7, 12, 16, 30, 64, 96]))
    m = draw(st.integers(0, 6))
    theta = 2 * np.pi * np.arange(n) / n
    repeat = draw(st.sampled_from([1, 2, 4, 5]))
    makers = {
        "noise": lambda: rng.normal(size=n),
        "order": lambda: np.cos(repeat * rng.integers(1, 5) * theta + rng.uniform(0, 6)),
        "kink": lambda: np.maximum(np.sin(repeat * theta + rng.uniform(0, 6)), 0),
        "constant": lambda: np.full(n, rng.normal()),
        "drift": lambda: theta,
    }
    kinds = draw(st.lists(st.sampled_from(sorted(makers)), min_size=m, max_size=m))
    waveforms = np.array([makers[kind]() for kind in kinds]).reshape(m, n) * rng.lognormal(0, 2, size=(m, 1))
    nominal = makers[draw(st.sampled_from(sorted(makers)))]() * draw(st.sampled_from([0.0, 1.0]))
    return waveforms, nominal, rng.normal(size=(draw(st.integers(1, 4)), m))


@given(combinations())
def test_sizes_are_those_of_plain_sums(given_arrays) -> None:
    waveforms, nominal, values = given_arrays
    copies = [array.copy() for array in given_arrays]
    ready = kernel(waveforms, nominal)
    found = ready.extremes(values)
    scale = 1 + np.abs(values) @ np.abs(waveforms).max(axis=1) + np.abs(nominal).max()
    high, low = ready.places(values)
    te, every = nominal + values @ waveforms, np.arange(len(values))
    np.testing.assert_allclose(
        te[every, high] - te[every, low], np.ptp(te, axis=1), rtol=0, atol=(TOLERANCE + 1e-13 * scale).max()
    )
    for u, row in enumerate(values):
        expected = plain(waveforms, nominal, row)
        for name in SIZES:
            assert getattr(found, name)[u] == pytest.approx(expected[name], rel=0, abs=TOLERANCE + 1e-13 * scale[u])
    for array, copy in zip(given_arrays, copies, strict=True):
        np.testing.assert_array_equal(array, copy)


def test_a_common_repeat_is_summed_on_one_repeat() -> None:
    theta = 2 * np.pi * np.arange(4096) / 4096
    pair = 5 * ARCSEC * np.array([np.cos(40 * theta), np.sin(40 * theta)])
    first, *others = kernel(pair, 0 * theta).levels
    assert first.shape == (2, 256)  # 40 = 8 * 5
    assert not any(len(level) for level in others)
    alone = 5 * ARCSEC * np.cos(121 * theta)[None]
    assert kernel(alone, 0 * theta).levels[0].shape == (1, 2048)


def test_odd_numbers_of_angles_are_not_folded() -> None:
    theta = 2 * np.pi * np.arange(405) / 405
    pair = 5 * ARCSEC * np.array([np.cos(40 * theta), np.sin(40 * theta)])
    assert [level.shape for level in kernel(pair, 0 * theta).levels] == [(2, 405)]


def test_the_nominal_alone() -> None:
    theta = 2 * np.pi * np.arange(64) / 64
    found = kernel(np.zeros((0, 64)), 3 * np.sin(theta) + 7).extremes(np.zeros((5, 0)))
    np.testing.assert_allclose(found.peak_to_peak, 6, rtol=1e-12)
    np.testing.assert_allclose(found.offset, 7, rtol=1e-12)
    np.testing.assert_allclose(found.rms, 3 / math.sqrt(2), rtol=1e-12)


def test_rows_do_not_depend_on_their_block() -> None:
    rng = np.random.default_rng(0)
    theta = 2 * np.pi * np.arange(4096) / 4096
    waveforms = ARCSEC * np.array([np.cos(k * theta) for k in (1, 40, 78)])
    values = rng.normal(size=(1500, 3))  # several blocks, the last one short
    ready = kernel(waveforms, 0 * theta)
    whole = ready.extremes(values)
    for u in (0, 63, 64, 511, 512, 1499):
        alone = ready.extremes(values[u : u + 1])
        for name in SIZES:
            assert getattr(whole, name)[u] == pytest.approx(getattr(alone, name)[0], rel=1e-11, abs=1e-18)


def test_rv40e_by_orders() -> None:
    """Kinks of loading pins and all: a tenth of the multiplications, the same numbers."""
    sources = ("crank.eccentricity", "cycloid.pin_position", "cycloid.pin_radius", "cycloid.disc_bore_position")
    tolerances = [tolerance(key, "5 um") for key in sources]
    tolerances += [tolerance(f"cycloid.disc_{what}", "5 um", harmonic=(1, 2, 3)) for what in ("pitch", "profile")]
    tolerances += [tolerance("sensor.encoder_eccentricity", "10 arcsec")]
    unit = stack(rverror.Model(rverror.reducer("RV-40E")), tolerances)
    folded = kernel(unit.scaled(), unit.nominal)
    work = folded.factor.size + sum(level.size for level in folded.levels)  # multiplications of a combination
    assert work < 0.2 * unit.influence.size
    values = np.random.default_rng(1).normal(size=(200, len(unit.influence)))
    te = unit.nominal + values @ unit.scaled()
    found = folded.extremes(values)
    assert (np.abs(found.peak_to_peak - np.ptp(te, axis=1)) <= TOLERANCE).all()
    away = te - te.mean(axis=1, keepdims=True)
    np.testing.assert_allclose(found.max, np.abs(away).max(axis=1), rtol=0, atol=1e-9 * ARCSEC)
    np.testing.assert_allclose(found.rms, np.sqrt((away**2).mean(axis=1)), rtol=0, atol=1e-9 * ARCSEC)
    np.testing.assert_allclose(found.offset, te.mean(axis=1), rtol=0, atol=1e-9 * ARCSEC)


@pytest.mark.parametrize(
    ("waveforms", "nominal"),
    [(np.zeros((2, 3)), np.zeros(4)), (np.zeros(3), np.zeros(3)), (np.zeros((2, 0)), np.zeros(0))],
)
def test_shapes_are_checked(waveforms: np.ndarray, nominal: np.ndarray) -> None:
    with pytest.raises(ValueError, match=r"give \(m, n\) and \(n,\)"):
        kernel(waveforms, nominal)


def test_numbers_are_checked() -> None:
    with pytest.raises(ValueError, match="not finite"):
        kernel(np.array([[1.0, np.nan]]), np.zeros(2))
