"""The loops over very many virtual units, compiled."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from rverror.base.arrays import Array
from rverror.base.compiled import compiled, inlined

#: Units, and waves, that one pass over the samples takes together: it then has more to compute than to load.
TOGETHER = 4


@inlined
def _combine(waves: Array, coordinates: Array, column: int, out: Array) -> None:
    """Write the combinations (units, samples) of waves (r, samples) by the coordinates from a column on."""
    p, q, u, v = out[0], out[1], out[2], out[3]
    p[:] = 0.0
    q[:] = 0.0
    u[:] = 0.0
    v[:] = 0.0
    a, b, c, d = coordinates[0], coordinates[1], coordinates[2], coordinates[3]
    for r in range(0, len(waves), TOGETHER):
        k = column + r
        a0, a1, a2, a3 = a[k], a[k + 1], a[k + 2], a[k + 3]
        b0, b1, b2, b3 = b[k], b[k + 1], b[k + 2], b[k + 3]
        c0, c1, c2, c3 = c[k], c[k + 1], c[k + 2], c[k + 3]
        d0, d1, d2, d3 = d[k], d[k + 1], d[k + 2], d[k + 3]
        w0, w1, w2, w3 = waves[r], waves[r + 1], waves[r + 2], waves[r + 3]
        for s in range(len(p)):
            x0, x1, x2, x3 = w0[s], w1[s], w2[s], w3[s]
            p[s] += a0 * x0 + a1 * x1 + a2 * x2 + a3 * x3
            q[s] += b0 * x0 + b1 * x1 + b2 * x2 + b3 * x3
            u[s] += c0 * x0 + c1 * x1 + c2 * x2 + c3 * x3
            v[s] += d0 * x0 + d1 * x1 + d2 * x2 + d3 * x3


@inlined
def _unfold(even: Array, odd: Array, after: Array) -> None:
    """What repeats, and what changes its sign a half later, as values of the first half and of the one after."""
    for s in range(len(odd)):
        repeats, changes = even[s], odd[s]
        even[s] = repeats + changes
        after[s] = repeats - changes


@inlined
def _fold(even: Array, odd: Array, high: Array, low: Array) -> None:
    """Raise and lower to what both halves reach."""
    for s in range(len(odd)):
        swing = abs(odd[s])
        top, bottom = even[s] + swing, even[s] - swing
        high[s] = top if top > high[s] else high[s]
        low[s] = bottom if bottom < low[s] else low[s]


@compiled
def extremes(
    tiles: Array, ranks: npt.NDArray[np.intp], coordinates: Array, even: Array, odd: Array, high: Array, low: Array
) -> None:
    """Fold combinations of waves on levels into their maxima and minima; the combinations never leave the cache.

    Parameters
    ----------
    tiles : ndarray, shape (tiles, rows, samples)
        Each tile holds so many samples of the last level of `FoldedKernel.levels` and all that are added to them: the
        samples of the last level, of the one before it as many, then from level to level twice as many, a tile's
        length further by the length of the last level.  For each there are as many rows as waves.
    ranks : ndarray of int, shape (levels,)
        Waves of each level, the last one first; multiples of `TOGETHER`.
    coordinates : ndarray, shape (units, sum of the ranks)
        Of the waves, in the same order; units are a multiple of `TOGETHER`.
    even : ndarray, shape (2**(levels - 2) or 1, TOGETHER, samples)
        Scratch memory.
    odd : ndarray, shape (TOGETHER, samples)
        Scratch memory.
    high, low : ndarray, shape (units, samples)
        Raised to the largest and lowered to the smallest of all values that lie a whole number of tiles or of lengths
        of the last level apart.
    """
    for tile in range(len(tiles)):
        waves = tiles[tile]
        for unit in range(0, len(coordinates), TOGETHER):
            numbers = coordinates[unit : unit + TOGETHER]
            row, column, sets = ranks[0], ranks[0], 1
            _combine(waves[:row], numbers, 0, even[0])
            for level in range(1, len(ranks)):
                for part in range(sets):
                    _combine(waves[row : row + ranks[level]], numbers, column, odd)
                    row += ranks[level]
                    for u in range(TOGETHER):
                        if level < len(ranks) - 1:
                            _unfold(even[part, u], odd[u], even[sets + part, u])
                        else:
                            _fold(even[part, u], odd[u], high[unit + u], low[unit + u])
                column += ranks[level]
                sets *= 2
            if len(ranks) == 1:
                odd[:] = 0.0
                for u in range(TOGETHER):
                    _fold(even[0, u], odd[u], high[unit + u], low[unit + u])


@inlined
def _middle(q: float) -> float:
    """Normal quantile of 0.5 + q, within 0.425 of the middle."""
    r = 0.180625 - q * q
    above = 3.3430575583588128105e4 + r * 2.5090809287301226727e3
    above = 4.5921953931549871457e4 + r * (6.7265770927008700853e4 + r * above)
    above = 1.9715909503065514427e3 + r * (1.3731693765509461125e4 + r * above)
    above = 3.3871328727963666080e0 + r * (1.3314166789178437745e2 + r * above)
    below = 2.8729085735721942674e4 + r * 5.2264952788528545610e3
    below = 2.1213794301586595867e4 + r * (3.9307895800092710610e4 + r * below)
    below = 6.8718700749205790830e2 + r * (5.3941960214247511077e3 + r * below)
    below = 1.0 + r * (4.2313330701600911252e1 + r * below)
    return q * above / below


@inlined
def _near(r: float) -> float:
    """Distance from the middle at which exp(-r**2) is left beyond, r up to 5."""
    r -= 1.6
    above = 2.27238449892691845833e-2 + r * 7.74545014278341407640e-4
    above = 1.27045825245236838258e0 + r * (2.41780725177450611770e-1 + r * above)
    above = 5.76949722146069140550e0 + r * (3.64784832476320460504e0 + r * above)
    above = 1.42343711074968357734e0 + r * (4.63033784615654529590e0 + r * above)
    below = 5.47593808499534494600e-4 + r * 1.05075007164441684324e-9
    below = 1.48103976427480074590e-1 + r * (1.51986665636164571966e-2 + r * below)
    below = 1.67638483018380384940e0 + r * (6.89767334985100004550e-1 + r * below)
    return above / (1.0 + r * (2.05319162663775882187e0 + r * below))


@inlined
def _far(r: float) -> float:
    """Distance from the middle at which exp(-r**2) is left beyond, r from 5 on."""
    r -= 5.0
    above = 2.71155556874348757815e-5 + r * 2.01033439929228813265e-7
    above = 2.65321895265761230930e-2 + r * (1.24266094738807843860e-3 + r * above)
    above = 1.78482653991729133580e0 + r * (2.96560571828504891230e-1 + r * above)
    above = 6.65790464350110377720e0 + r * (5.46378491116411436990e0 + r * above)
    below = 1.42151175831644588870e-7 + r * 2.04426310338993978564e-15
    below = 7.86869131145613259100e-4 + r * (1.84631831751005468180e-5 + r * below)
    below = 1.36929880922735805310e-1 + r * (1.48753612908506148525e-2 + r * below)
    return above / (1.0 + r * (5.99832206555887937690e-1 + r * below))


@compiled
def normal_quantile(values: Array, places: npt.NDArray[np.intp], tails: Array) -> None:
    """Standard normal values below which lie given shares (M. J. Wichura, algorithm AS 241, Appl. Stat. 37, 1988).

    Parameters
    ----------
    values : ndarray, shape (n,)
        Shares between 0 and 1, both left out; overwritten by the values, with a relative error of some 1e-15.
    places, tails : ndarray of int and of float, shapes (any,) and (2, as many)
        Scratch memory for so many shares at a time.
    """
    rest, distance = tails[0], tails[1]
    for first in range(0, len(values), len(places)):
        some = values[first : first + len(places)]
        number = 0
        for i in range(len(some)):
            places[number] = i
            rest[number] = some[i] if some[i] < 0.5 else 1.0 - some[i]
            number += rest[number] < 0.075
        for i in range(len(some)):
            some[i] = _middle(some[i] - 0.5)
        for j in range(number):
            rest[j] = math.sqrt(-math.log(rest[j]))
        for j in range(number):
            distance[j] = _near(rest[j])
        for j in range(number):
            away = distance[j] if rest[j] <= 5.0 else _far(rest[j])
            some[places[j]] = math.copysign(away, some[places[j]])


@compiled
def sparse_products(
    start: npt.NDArray[np.intp],
    column: npt.NDArray[np.intp],
    size: Array,
    places: npt.NDArray[np.intp],
    values: Array,
    out: Array,
) -> None:
    """Write the products of values with some blocks of rows of a sparse matrix.

    Parameters
    ----------
    start, column, size : ndarray
        Compressed rows.
    places : ndarray of int, shape (blocks,)
        Which blocks of ``out.shape[1]`` rows.
    values : ndarray, shape (columns,)
    out : ndarray, shape (blocks, rows of a block)
    """
    width = out.shape[1]
    for b in range(len(places)):
        for r in range(width):
            row, total = places[b] * width + r, 0.0
            for e in range(start[row], start[row + 1]):
                total += size[e] * values[column[e]]
            out[b, r] = total


@compiled
def sparse_work(
    start: npt.NDArray[np.intp],
    column: npt.NDArray[np.intp],
    size: Array,
    places: npt.NDArray[np.intp],
    forces: Array,
    out: Array,
) -> None:
    """Add the products of the transposed blocks of rows with forces on them.

    Parameters
    ----------
    start, column, size, places
        As in `sparse_products`.
    forces : ndarray, shape (blocks, rows of a block)
    out : ndarray, shape (blocks, columns)
    """
    width = forces.shape[1]
    for b in range(len(places)):
        for r in range(width):
            row, force = places[b] * width + r, forces[b, r]
            for e in range(start[row], start[row + 1]):
                out[b, column[e]] += size[e] * force
