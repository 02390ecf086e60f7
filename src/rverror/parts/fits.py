"""Least squares of readings of a part: its errors, what the datum takes, and how sure each of them is."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from rverror.base.arrays import Array
from rverror.base.chance import chi_square
from rverror.geartrain.cycloid import first_root, loaded_share, profile
from rverror.geartrain.mechanism import Reducer

#: Points of a plane, x + 1j y.
Points = npt.NDArray[np.complex128]

#: Above it the residual is more than the stated uncertainty leaves by chance in one part of a hundred.
_CHANCE = 0.01
#: Largest condition number of a normal matrix whose columns are scaled.
_WORST_CONDITION = 1e10
#: Uncertainties by which a single lobe must stand out, and most of them.
_STANDS_OUT, _MOST_LOBES = 5.0, 10
#: Rows of a scan that are worked on at a time, and points of a lobe's profile.
_ROWS, _POINTS = 50_000, 4096
#: Displacement at which the fit of a setup has settled, mm.
_SETTLED = 1e-9


class UnresolvedError(ValueError):
    """Readings that do not tell apart what is fitted to them; the message has the remedy."""


class LeastSquares(NamedTuple):
    """Errors by least squares.

    Attributes
    ----------
    values, sigmas : ndarray, shape (p,)
        And 1 sigma of each; NaN where nothing tells it.
    rms : float
        Of the residuals, by their degrees of freedom; NaN where there are none.
    reading : float
        Uncertainty of a reading that is taken: as stated, or `rms` where nothing is or that is too large for chance.
    """

    values: Array
    sigmas: Array
    rms: float
    reading: float


def least_squares(blocks: Iterable[tuple[Array, Array]], sigma: float, *, orthogonal: bool = False) -> LeastSquares:
    """Fit errors to readings.

    Parameters
    ----------
    blocks : iterable of (ndarray of shape (n, p), ndarray of shape (n,))
        Readings per unit of each error, and the readings; of many readings some at a time.
    sigma : float
        Stated uncertainty of a reading; NaN where none is.
    orthogonal : bool
        Whether nothing that is left in the readings can look like what is fitted: residuals then say nothing of it.

    Returns
    -------
    LeastSquares

    Raises
    ------
    UnresolvedError
        If there are fewer readings than errors, or the readings do not tell these apart.

    Examples
    --------
    >>> import numpy as np
    >>> found = least_squares([(np.ones((4, 1)), np.array([1.0, 2.0, 3.0, 2.0]))], 1.0)
    >>> found.values.tolist(), found.sigmas.tolist()
    ([2.0], [0.5])
    """
    parts = [(part.T @ part, part.T @ data, data @ data, data.size) for part, data in blocks]
    gram, moment, square, count = (sum(each) for each in zip(*parts, strict=True))
    scale = np.sqrt(np.diag(gram))
    free = count - scale.size
    unresolved = UnresolvedError(
        "the readings do not tell the errors apart; measure more places, or ask for fewer harmonics"
    )
    if free < 0 or not scale.all():
        raise unresolved
    values, vectors = np.linalg.eigh(gram / np.outer(scale, scale))
    if values[0] * _WORST_CONDITION < values[-1]:
        raise unresolved
    inverse = (vectors / values) @ vectors.T / np.outer(scale, scale)
    found = inverse @ moment
    left = max(float(square - moment @ found), 0.0)
    used = sigma if orthogonal and sigma > 0 else reading_sigma(left, free, sigma)
    rms = np.sqrt(left / free) if free else np.nan
    return LeastSquares(found, used * np.sqrt(np.diag(inverse)), float(rms), used)


def reading_sigma(left: float, free: int, stated: float) -> float:
    """Uncertainty of a reading: as stated, or what residuals say where nothing is or they are too large for chance.

    Parameters
    ----------
    left : float
        Sum of squared residuals.
    free : int
        Their degrees of freedom.
    stated : float
        NaN where nothing is.

    Returns
    -------
    float
        NaN where nothing tells it.

    Examples
    --------
    >>> reading_sigma(9.0, 10, 1.0), reading_sigma(40.0, 10, 1.0), reading_sigma(40.0, 10, np.nan)
    (1.0, 2.0, 2.0)
    """
    if stated > 0 and not (free > 0 and left > stated**2 * chi_square(_CHANCE, free)):
        return stated
    return float(np.sqrt(left / free)) if free > 0 else np.nan


# --- places -----------------------------------------------------------------------------------------------------------


def place_errors(angles: Array, radius: float, centres: Points, datum: str) -> tuple[Array, Array]:
    """Errors of places on a circle, in the frame that the datum gives.

    Parameters
    ----------
    angles : ndarray, shape (n,)
        Nominal, rad.
    radius : float
        Nominal, mm.
    centres : ndarray of complex, shape (n,)
        Measured, x + 1j y, mm.
    datum : str
        ``fit``, ``axis`` or ``given``: the setup may have moved and turned the part, turned it, or neither.

    Returns
    -------
    errors : ndarray, shape (n, 2)
        Radial and tangential, mm.
    kept : ndarray, shape (2 n, 2 n)
        What the datum leaves of errors, taken one after another.
    """
    nominal = radius * np.exp(1j * angles)
    centre = centres.mean() if datum == "fit" else 0.0
    middle = nominal.mean() if datum == "fit" else 0.0
    turn = 1.0 if datum == "given" else np.exp(1j * np.angle(np.sum(np.conj(nominal - middle) * (centres - centre))))
    errors = (((centres - centre) / turn) - (nominal - middle)) * np.exp(-1j * angles)
    moved = [np.exp(-1j * angles), 1j * np.exp(-1j * angles)] if datum == "fit" else []
    moved += [] if datum == "given" else [np.full(angles.size, 1j * radius)]
    setup = np.array([_pairs(each) for each in moved]).reshape(-1, 2 * angles.size).T
    kept = np.eye(2 * angles.size) - setup @ np.linalg.pinv(setup)
    return _pairs(errors).reshape(-1, 2), kept


def _pairs(numbers: Points) -> Array:
    """Real and imaginary parts in turn."""
    return np.ascontiguousarray(numbers, dtype=np.complex128).view(np.float64)


def ring_waves(angles: Array, harmonics: int, errors: Array, kept: Array, sigma: float) -> LeastSquares:
    """Waves 0 to `harmonics` of errors of places, radial cos and sin and tangential cos and sin of each.

    Parameters
    ----------
    errors, kept : ndarray
        Of `place_errors`.
    sigma : float
        Stated uncertainty of a reading; NaN where none is.

    Returns
    -------
    LeastSquares
        With the rms of what the waves leave.
    """
    units = [(h, unit, wave) for h in range(harmonics + 1) for unit in (1, 1j) for wave in (np.cos, np.sin)]
    waves = np.stack([_pairs(unit * wave(h * angles)) for h, unit, wave in units], axis=1)
    solve = np.linalg.pinv(waves)
    left = errors.ravel() - waves @ solve @ errors.ravel()
    free = round(float(np.trace(kept))) - int(np.linalg.matrix_rank(kept @ waves))
    used = sigma if sigma > 0 else reading_sigma(float(left @ left), free, sigma)
    sigmas = used * np.sqrt(np.sum((solve @ kept) ** 2, axis=1))
    return LeastSquares(solve @ errors.ravel(), sigmas, float(np.sqrt(np.mean(left**2))), used)


def circle(points: Points, sigma: float) -> tuple[complex, LeastSquares]:
    """Circle through points, by the least squares of their distances from it.

    Parameters
    ----------
    points : ndarray of complex, shape (n,)
        mm.

    Returns
    -------
    complex
        Its centre.
    LeastSquares
        Of the last step: x, y, radius.
    """
    centre = complex(points.mean())
    for _ in range(30):
        away = points - centre
        far = np.abs(away)
        rows = np.stack([away.real / far, away.imag / far, np.ones(points.size)], axis=1)
        estimate = least_squares([(rows, far)], sigma)
        step = complex(*estimate.values[:2])
        centre += step
        if abs(step) < _SETTLED:
            break
    return centre, estimate


# --- teeth ------------------------------------------------------------------------------------------------------------


def tooth_rows(angles: Array, harmonics: int, *, single: bool, runout: bool) -> Array:
    """Pitch deviations, and runouts below them, per unit of each wave's cos and sin, the eccentricity and constants.

    Parameters
    ----------
    angles : ndarray, shape (z,)
        Of all teeth in order, rad.
    harmonics : int
    single : bool
        Whether each tooth is compared with the one before, not with the first.
    runout : bool
        Whether there are runouts, which tell the eccentricity.

    Returns
    -------
    ndarray, shape (z, 2 harmonics + 1), or (2 z, 2 harmonics + 4)
    """
    waves = [wave(h * angles) for h in range(1, harmonics + 1) for wave in (np.cos, np.sin)]
    rows = np.stack([*waves, *([-np.sin(angles), np.cos(angles)] if runout else [])], axis=1)
    rows = rows - np.roll(rows, 1, axis=0) if single else rows
    one = np.ones((angles.size, 1))
    if not runout:
        return np.hstack([rows, one])
    around = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return np.block([[rows, one, 0 * one], [np.zeros((angles.size, 2 * harmonics)), around, 0 * one, one]])


# --- lobes ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class LobeFit:
    """Errors of a disc's lobes.

    Attributes
    ----------
    place : int
        Of the discs that have their roots where these are.
    estimate : LeastSquares
        Setup x, y, turn; cos and sin of the harmonics 1 to H of the profile, then of the pitch; cos 0 and cos and sin
        of 1 to M of the profile of all lobes; the single lobes.
    lobes : tuple of int
        The single lobes.
    displacement : complex
        Of the lobes, x + 1j y in the disc's frame, mm.
    turn : float
        Of the lobes, rad.
    """

    place: int
    estimate: LeastSquares
    lobes: tuple[int, ...]
    displacement: complex
    turn: float


@dataclass(frozen=True)
class _Feet:
    """Feet of points on the nominal profile: in the disc's frame, roll angle, lobe, share of it, normal, distance."""

    foot: Points
    roll: Array
    lobe: npt.NDArray[np.int64]
    share: Array
    normal: Points
    distance: Array


def lobe_points(reducer: Reducer, angle: Array, deviation: Array, place: int) -> Points:
    """Points at a distance from the nominal profile of a disc, at polar angles of their feet.

    Parameters
    ----------
    angle, deviation : ndarray, shape (n,)
        rad and mm, along the outward normal.
    place : int
        Which disc of the unit.

    Returns
    -------
    ndarray of complex, shape (n,)
        mm.
    """
    feet = _feet(reducer, 1e3 * np.exp(1j * angle), place, steps=0)
    return np.asarray(feet.foot + deviation * feet.normal)


def fit_lobes(
    reducer: Reducer,
    points: Points,
    *,
    harmonics: int,
    lobe_harmonics: int,
    sigma: float = np.nan,
    radial: bool = True,
) -> LobeFit:
    """Fit the errors of a disc's lobes to points of its profile.

    Parameters
    ----------
    reducer : Reducer
    points : ndarray of complex, shape (n,)
        x + 1j y about the axis of the scan, its zero near bore 0 of the disc, mm.
    harmonics, lobe_harmonics : int
        Waves around the disc, and over a lobe.
    sigma : float
        Uncertainty of a reading, mm; NaN where none is stated.
    radial : bool
        Whether that is of the radius, along the ray, not along the normal of the profile.

    Returns
    -------
    LobeFit

    Raises
    ------
    UnresolvedError
        If the points do not tell the errors apart, or are not those of such a disc.
    """
    place, moved, turn, lobes = _place(reducer, points), 0j, 0.0, list[int]()

    def blocks() -> Iterator[tuple[Array, Array, npt.NDArray[np.int64], Array]]:
        for at in range(0, points.size, _ROWS):
            feet = _feet(reducer, (points[at : at + _ROWS] - moved) * np.exp(-1j * turn), place)
            bump = np.sin(np.pi * feet.share) ** 2
            rows = _lobe_rows(feet, harmonics, lobe_harmonics, [bump * (feet.lobe == lobe) for lobe in lobes])
            weight = 1 / (feet.normal * np.exp(-1j * np.angle(feet.foot))).real if radial else np.ones(bump.size)
            yield rows * weight[:, None], feet.distance * weight, feet.lobe, bump * weight

    for _ in range(3 * _MOST_LOBES):
        found = least_squares(((rows, data) for rows, data, _, _ in blocks()), sigma)
        step = complex(*found.values[:2]) * np.exp(1j * turn)
        moved, turn = moved + step, turn + float(found.values[2])
        if abs(step) + abs(found.values[2]) * reducer.pin_circle_radius > _SETTLED:
            continue
        size = np.zeros((2, reducer.disc_lobes))
        for rows, data, lobe, bump in blocks():
            for each, weight in zip(size, ((data - rows @ found.values) * bump, bump**2), strict=True):
                each += np.bincount(lobe, weight, reducer.disc_lobes)
        size[0, lobes] = 0.0
        score = np.abs(size[0]) / np.sqrt(np.maximum(size[1], np.finfo(float).tiny)) / found.reading
        if len(lobes) == _MOST_LOBES or score.max() < _STANDS_OUT:
            return LobeFit(place, found, tuple(lobes), moved * np.exp(-1j * turn), turn)
        lobes = [*lobes, int(score.argmax())]
    raise UnresolvedError(
        "the lobes of the unit are not found in it; check the units, the sign and the zero of its angle"
    )


def _place(reducer: Reducer, points: Points) -> int:
    """Disc whose roots are nearest to those of the points."""
    angle, lobes = np.angle(points), reducer.disc_lobes
    rows = [wave(h * angle) for h in (1, lobes) for wave in (np.cos, np.sin)]
    found = np.linalg.lstsq(np.stack([*rows, np.ones(angle.size)], axis=1), abs(points), rcond=None)[0]
    root = np.angle(complex(found[2], found[3])) / (2 * np.pi) - 0.5  # half a lobe before the crest
    away = [(root - first_root(reducer, place) + 0.5) % 1 - 0.5 for place in range(reducer.discs)]
    return int(np.argmin(np.abs(away)))


def _feet(reducer: Reducer, points: Points, place: int, *, steps: int = 3) -> _Feet:
    """Feet of points, at the same polar angle first and then by steps along the profile."""
    rolls = np.linspace(0, 2 * np.pi, _POINTS)
    curve = _complex(profile(reducer, rolls))
    lobes, root = reducer.disc_lobes, first_root(reducer, place)
    along = np.angle(points) * lobes / (2 * np.pi) - root
    lobe = np.floor(along)
    here = points * np.exp(-2j * np.pi * (root + lobe) / lobes)
    roll = np.interp(along - lobe, np.unwrap(np.angle(curve)) * lobes / (2 * np.pi), rolls)
    speed = np.gradient(curve, rolls)
    for _ in range(steps):
        ahead = np.interp(roll, rolls, speed)  # complex
        roll = np.clip(
            roll + ((here - _complex(profile(reducer, roll))) * np.conj(ahead)).real / abs(ahead) ** 2, 0, 2 * np.pi
        )
    foot = _complex(profile(reducer, roll))
    across = -reducer.eccentricity * lobes * loaded_share(reducer, roll) / abs(foot)
    normal = foot / abs(foot) * (np.sqrt(1 - across**2) + 1j * across)
    turned = np.exp(2j * np.pi * (root + lobe) / lobes)
    distance = ((here - foot) * np.conj(normal)).real
    share = np.angle(foot) * lobes / (2 * np.pi)
    return _Feet(foot * turned, roll, lobe.astype(np.int64) % lobes, share, normal * turned, distance)


def _complex(points: Array) -> Points:
    return np.asarray(points[0] + 1j * points[1])


def _lobe_rows(feet: _Feet, harmonics: int, lobe_harmonics: int, single: Sequence[Array]) -> Array:
    """Distance from the nominal profile per unit of each error, shape (n, p)."""
    psi, lead = np.angle(feet.foot), (np.conj(feet.normal) * 1j * feet.foot).real
    around = [wave(h * psi) for h in range(1, harmonics + 1) for wave in (np.cos, np.sin)]
    pitch = [lead / abs(feet.foot) * wave for wave in around]
    over = [wave(m * feet.roll) for m in range(1, lobe_harmonics + 1) for wave in (np.cos, np.sin)]
    setup = [feet.normal.real, feet.normal.imag, lead]
    return np.stack([*setup, *around, *pitch, np.ones(psi.size), *over, *single], axis=1)
