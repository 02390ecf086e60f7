"""Types of arrays, plane vectors along the last but one axis of one, slopes of waves; the samples are the last one."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Integers = npt.NDArray[np.intp]
Flags = npt.NDArray[np.bool_]


def radial_and_tangential(angle: Array) -> tuple[Array, Array]:
    """Unit vectors at an angle and a quarter turn ahead of it.

    Parameters
    ----------
    angle : ndarray, shape (..., n)
        Angles in the housing frame, rad.

    Returns
    -------
    radial, tangential : ndarray, shape (..., 2, n)
        The tangential one points counter-clockwise.
    """
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c, s], axis=-2), np.stack([-s, c], axis=-2)


def only(index: int) -> slice:
    """Slice that keeps one entry and its axis."""
    return slice(index, index + 1)


def dot(a: Array, b: Array) -> Array:
    """Scalar product over the xy axis: of vectors (..., 2, n), whose leading axes broadcast, to (..., n)."""
    return np.asarray(np.einsum("...an,...an->...n", a, b), dtype=np.float64)


def norms(vectors: Array) -> Array:
    """Lengths of vectors, shape (..., 2, n), as (..., 1, n)."""
    squares = dot(vectors, vectors)
    return np.asarray(np.sqrt(squares, out=squares)[..., None, :])


def unit_vectors(vectors: Array) -> Array:
    """Vectors, shape (..., 2, n), scaled to length 1; a zero vector stays zero."""
    length = norms(vectors)
    return np.asarray(vectors / np.where(length > 0, length, 1.0), dtype=np.float64)


def cross(a: Array, b: Array) -> Array:
    """z component of the vector product over the xy axis, of vectors as `dot` takes them."""
    return np.asarray(a[..., 0, :] * b[..., 1, :] - a[..., 1, :] * b[..., 0, :], dtype=np.float64)


def slope(rows: Array, step: float, power: int = 1) -> Array:
    """Derivative of periodic rows over the angle, by their Fourier series.

    Parameters
    ----------
    rows : ndarray, shape (..., n)
        At even angles of one period.
    step : float
        Waves per radian of the longest wave.
    power : int
        Which derivative.

    Returns
    -------
    ndarray, shape (..., n)
    """
    count = rows.shape[-1]
    # of the shortest wave, which has no slope at its samples, the inverse leaves an imaginary part out
    return np.asarray(np.fft.irfft(np.fft.rfft(rows) * (1j * step * np.arange(count // 2 + 1)) ** power, count))
