"""The compiled loops over virtual units, against numpy and scipy."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.special
from hypothesis import given
from hypothesis import strategies as st

from rverror.tolerances.distribution import normal_quantile
from rverror.tolerances.extremes import folded_kernel


@given(
    st.sampled_from([1, 2, 129, 300, 514, 768, 1025, 2600, 4096]),
    st.integers(0, 9),
    st.integers(1, 70),
    st.integers(0, 2**32),
)
def test_extremes_of_any_number_of_tiles_waves_and_units(angles: int, waves: int, units: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    waveforms, nominal = rng.normal(size=(waves, angles)), rng.normal(size=angles)
    values = rng.normal(size=(units, waves))
    te = nominal + values @ waveforms
    te -= te.mean(axis=1, keepdims=True)
    found = folded_kernel(waveforms, nominal, tolerance=1e-12).extremes(values)
    np.testing.assert_allclose(found.peak_to_peak, np.ptp(te, axis=1), rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.max, np.abs(te).max(axis=1), rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.rms, np.sqrt((te**2).mean(axis=1)), rtol=0, atol=1e-12)


@given(st.integers(1, 60), st.integers(1, 90), st.integers(0, 2**32))
def test_normal_values_are_those_of_scipy(rows: int, columns: int, seed: int) -> None:
    uniform = np.random.default_rng(seed).random((rows, columns + 3))[:, 1:-2]
    np.testing.assert_allclose(normal_quantile(uniform), scipy.special.ndtri(uniform), rtol=2e-15, atol=0)


@pytest.mark.parametrize("end", [0.0, 1.0])
def test_normal_values_of_tails(end: float) -> None:
    """Beyond each of the limits between the formulas, 0.075 and exp(-25), up to the last number below 1."""
    away = 2.0 ** -np.linspace(1, 52, 4000)
    uniform = np.abs(end - away)
    np.testing.assert_allclose(normal_quantile(uniform), scipy.special.ndtri(uniform), rtol=2e-15, atol=0)
