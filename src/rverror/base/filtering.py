"""A filter over the samples of many series at once, compiled."""

from __future__ import annotations

from rverror.base.arrays import Array
from rverror.base.compiled import compiled

_STRETCH = 512  # samples of a series that the fastest memory holds, with what they become


@compiled
def filtered_into(out: Array, rows: Array, taps: Array) -> None:
    """Convolve each row with a filter.

    Parameters
    ----------
    out : ndarray, shape (k, n)
        Of which all but the first samples, one for each tap but one, are set.
    rows : ndarray, shape (k, n)
    taps : ndarray, shape (m,)
        What a sample counts, then the one before, and so on.
    """
    (count, n), lags = rows.shape, taps.size - 1
    for r in range(count):
        for first in range(lags, n, _STRETCH):
            size = min(_STRETCH, n - first)
            made = out[r, first : first + size]
            made[:] = 0.0
            for lag in range(lags + 1):
                tap, before = taps[lag], rows[r, first - lag : first - lag + size]
                for i in range(size):
                    made[i] += tap * before[i]
