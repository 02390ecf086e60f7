"""Features of a part, of which each row of a file is a reading: places, circles, lobes and teeth become errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.base.numbers import brief
from rverror.base.text import some
from rverror.geartrain.mechanism import Reducer
from rverror.geartrain.source import IndexValue
from rverror.model.effects import Effect
from rverror.parts import fits
from rverror.parts.mapping import Feature

#: Largest part of a turn without a reading of a circle, rad.
_WIDEST_GAP = np.pi / 3
#: Decimals of a size in mm: a picometre.
_DECIMALS = 9
_PITCH = {"sun": "involute.sun_pitch", "planet": "involute.planet_pitch", "disc": "cycloid.disc_pitch"}
_ECCENTRICITY = {"sun": "involute.sun_eccentricity", "planet": "involute.planet_eccentricity"}


@dataclass(frozen=True)
class Readings:
    """Readings of one part.

    Attributes
    ----------
    where : str
        File and line of the first, for messages.
    columns : mapping of str to ndarray, shape (n,)
        By the names of the feature's columns, core units.
    sigmas : mapping of str to float
        Stated uncertainties, of the columns that have one.
    """

    where: str
    columns: Mapping[str, Array]
    sigmas: Mapping[str, float]


@dataclass(frozen=True)
class Fitted:
    """Errors of a part, and what was not made an error of it: sizes in words, mm or rad."""

    errors: tuple[Effect, ...]
    left: Mapping[str, tuple[float, str]]


def feature_errors(feature: Feature, kind: str, readings: Readings, reducer: Reducer) -> Fitted:
    """Errors that readings of a feature tell.

    Parameters
    ----------
    feature : Feature
    kind : str
        Of the part.
    readings : Readings
    reducer : Reducer
        Its nominal sizes.

    Returns
    -------
    Fitted

    Raises
    ------
    InputError
        If readings are missing, or do not tell the errors apart.
    """
    try:
        match feature.name:
            case "lobes":
                return _lobes(feature, readings, reducer)
            case "teeth":
                return _teeth(feature, kind, readings, reducer)
            case _:
                return _places(feature, kind, readings, reducer)
    except fits.UntoldError as error:
        raise InputError(f"{readings.where}, [{feature.name}]: {error}") from error


def _made(key: str, indices: Mapping[str, IndexValue], values: Array, sigmas: Array, common: float) -> Effect:
    """An error with the largest uncertainty of its components; without one where none is known."""
    sigma = None if np.isnan(sigmas).all() else float(np.hypot(np.nanmax(sigmas), common))
    sizes = tuple(round(float(value), _DECIMALS) + 0.0 for value in values)
    return Effect(key, MappingProxyType(dict(indices)), sizes, None if sigma is None else float(f"{sigma:.3g}"))


def _stated(readings: Readings, *columns: str) -> float | None:
    """Largest of the stated uncertainties of some columns; None where one has none."""
    given = [readings.sigmas.get(name) for name in columns if name in readings.columns]
    return None if None in given else max(each for each in given if each is not None)


def _order(readings: Readings, count: int, noun: str) -> npt.NDArray[np.intp]:
    """Row of each number, from 0 or from 1."""
    numbers = readings.columns["number"]
    start = 0 if numbers.min() == 0 else 1
    places = numbers - start
    odd = (places != np.rint(places)) | (places < 0) | (places >= count)
    if odd.any():
        raise InputError(
            f"{readings.where}: number {brief(float(numbers[odd.argmax()]))}: a unit has {noun} {start} to "
            f"{start + count - 1}; correct it"
        )
    found = np.bincount(places.astype(int), minlength=count)
    for wrong, problem in (
        (found == 0, "missing; measure all of them"),
        (found > 1, "measured twice; keep one row of each"),
    ):
        if wrong.any():
            raise InputError(f"{readings.where}: {noun} {some(np.flatnonzero(wrong) + start)} of {count} {problem}")
    return np.argsort(places)


def _check_gap(readings: Readings, angles: Array, widest: float) -> None:
    """Refuse a scan with too wide a gap, such as half a turn."""
    turned = np.sort(angles % (2 * np.pi))
    gaps = np.diff(turned, append=turned[:1] + 2 * np.pi)
    if gaps.max() > widest * (1 + 1e-9):
        start = np.degrees(turned[gaps.argmax()])
        raise InputError(
            f"{readings.where}: no readings from {start:.1f} to {start + np.degrees(gaps.max()):.1f} deg, at most "
            f"{np.degrees(widest):.1f} deg may be missing; scan a whole turn, and check the unit of the angle"
        )


# --- places and circles -----------------------------------------------------------------------------------------------


def _nominal(kind: str, reducer: Reducer) -> tuple[str, str, float, Array]:
    """Source of places, the index that counts them, the radius of their circle, and their angles."""
    sources = {
        "housing": ("cycloid.pin_position", "pin", reducer.pin_circle_radius, reducer.pins),
        "disc": ("cycloid.disc_bore_position", "crank", reducer.crank_circle_radius, reducer.cranks),
        "carrier": ("coupling.carrier_bore_position", "crank", reducer.crank_circle_radius, reducer.cranks),
        "crank": ("crank.eccentricity", "disc", reducer.eccentricity, reducer.discs),
    }
    key, index, radius, count = sources[kind]
    return key, index, float(radius or 0.0), 2 * np.pi * np.arange(count) / count


def _places(feature: Feature, kind: str, readings: Readings, reducer: Reducer) -> Fitted:
    key, index, radius, angles = _nominal(kind, reducer)
    if feature.name == "circles":
        centres, sigmas, form = _circles(readings, angles.size, index)
    else:
        order = _order(readings, angles.size, f"{index}s")
        centres = (readings.columns["x"] + 1j * readings.columns["y"])[order]
        sigmas, form = np.full(centres.size, _stated(readings, "x", "y") or np.nan), {}
    errors, kept = fits.place_errors(angles, radius, centres, feature.datum)
    kept_sigmas = np.sqrt(kept**2 @ np.repeat(np.where(np.isnan(sigmas), 0.0, sigmas), 2) ** 2).reshape(-1, 2)
    kept_sigmas[np.isnan(sigmas)] = np.nan
    if feature.harmonics:
        found, left = _ring_waves(feature, angles, errors, kept, _stated(readings, "x", "y"))
    else:
        found = [_made(key, {index: i}, errors[i], kept_sigmas[i], feature.common) for i in range(angles.size)]
        left = {} if not np.isnan(sigmas).all() else {"places taken as exact, no uncertainty is stated": (np.nan, "")}
    if "diameter" in readings.columns:
        half = readings.columns["diameter"][order] / 2 - reducer.pin_radius
        sigma = np.array([(_stated(readings, "diameter") or np.nan) / 2])
        found += [
            _made("cycloid.pin_radius", {"pin": i}, half[i : i + 1], sigma, feature.common) for i in range(half.size)
        ]
    return Fitted(tuple(found), {**form, **left})


def _circles(readings: Readings, count: int, index: str) -> tuple[fits.Points, Array, dict[str, tuple[float, str]]]:
    """Centres of circles with their uncertainties, and the form that is left."""
    columns = readings.columns
    numbers = np.unique(columns["number"])
    _order(Readings(readings.where, {"number": numbers}, {}), count, f"{index}s")
    centres, sigmas, form = [], [], []
    for number in numbers:
        here = columns["number"] == number
        _check_gap(readings, columns["angle"][here], _WIDEST_GAP)
        points = columns["radius"][here] * np.exp(1j * columns["angle"][here])
        centre, estimate = fits.circle(points, _stated(readings, "radius"))
        centres.append(centre)
        sigmas.append(float(estimate.sigmas[:2].max()))
        form.append(estimate.rms)
    return np.array(centres), np.array(sigmas), {"form of the circles left out, rms": (max(form), "length")}


def _ring_waves(
    feature: Feature, angles: Array, errors: Array, kept: Array, stated: float | None
) -> tuple[list[Effect], dict[str, tuple[float, str]]]:
    """Waves of a pin ring, and the rms of what they leave."""
    waves = np.hstack([fits.ring_waves(angles, h) for h in range(feature.harmonics + 1)])
    solve = np.linalg.pinv(waves)
    values = solve @ errors.ravel()
    left = errors.ravel() - waves @ values
    free = round(float(np.trace(kept)) - np.linalg.matrix_rank(kept @ waves))
    sigma = fits.reading_sigma(float(left @ left), free, None) if stated is None else stated
    sigmas = sigma * np.sqrt(np.sum((solve @ kept) ** 2, axis=1))
    found = [
        _made("cycloid.pin_circle", {"harmonic": h}, values[4 * h :][:4], sigmas[4 * h :][:4], feature.common)
        for h in range(feature.harmonics + 1)
    ]
    return found, {f"left out by waves 0 to {feature.harmonics}, rms": (float(np.sqrt(np.mean(left**2))), "length")}


# --- teeth ------------------------------------------------------------------------------------------------------------


def _teeth(feature: Feature, kind: str, readings: Readings, reducer: Reducer) -> Fitted:
    count = {"sun": reducer.sun_teeth, "planet": reducer.planet_teeth, "disc": reducer.disc_lobes}[kind]
    columns, order = readings.columns, _order(readings, count, "teeth")
    angles = feature.zero + feature.sense * 2 * np.pi * np.arange(count) / count
    single, eccentric = "pitch" in columns, "runout" in columns
    pitch = "pitch" if single else "cumulative"
    harmonics = min(feature.harmonics, (count - 1) // 2)
    rows = fits.tooth_rows(angles, harmonics, eccentric=eccentric, single=single)
    data = columns[pitch][order]
    weights = np.ones(count)
    sigma = _stated(readings, pitch, *(["runout"] if eccentric else []))
    if eccentric:
        around = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        rows = np.block([
            [rows, np.zeros((count, 1))],
            [np.zeros((count, 2 * harmonics)), around, np.zeros((count, 1)), np.ones((count, 1))],
        ])  # fmt: skip
        data = np.concatenate([data, columns["runout"][order]])
        weights = np.ones(2 * count)
        if sigma is not None:
            weights = sigma / np.repeat([readings.sigmas[pitch], readings.sigmas["runout"]], count)
    found = fits.least_squares([(rows * weights[:, None], data * weights)], sigma, orthogonal=True)
    pairs = [(found.values[i : i + 2], found.sigmas[i : i + 2]) for i in range(0, 2 * harmonics + 2 * eccentric, 2)]
    waves = [_made(_PITCH[kind], {"harmonic": h}, *pair, feature.common) for h, pair in enumerate(pairs[:harmonics], 1)]
    if eccentric:
        waves.append(_made(_ECCENTRICITY[kind], {}, *pairs[-1], feature.common))
    return Fitted(tuple(waves), {f"left out by waves 1 to {harmonics}, rms": (found.rms, "length")})


# --- lobes ------------------------------------------------------------------------------------------------------------


def _lobes(feature: Feature, readings: Readings, reducer: Reducer) -> Fitted:
    columns, angles = readings.columns, readings.columns["angle"]
    _check_gap(readings, angles, 2 * np.pi / reducer.disc_lobes)
    place = feature.place
    if "radius" in columns:
        points = columns["radius"] * np.exp(1j * angles)
    else:
        place = place or 0
        points = fits.lobe_points(reducer, angles, columns["deviation"], place)
    if place is not None and place >= reducer.discs:
        raise InputError(f"{readings.where}: place = {place}: the unit has discs 0 to {reducer.discs - 1}; correct it")
    found = fits.fit_lobes(
        reducer, points, harmonics=feature.harmonics, lobe_harmonics=feature.lobe_harmonics,
        sigma=_stated(readings, "radius", "deviation"), place=place,
    )  # fmt: skip
    values, sigmas = (
        np.split(each, np.cumsum(_sizes(feature))) for each in (found.estimate.values, found.estimate.sigmas)
    )
    errors: list[Effect] = []
    for key, part in (("cycloid.disc_profile", 1), ("cycloid.disc_pitch", 2)):
        errors += [
            _made(
                key,
                {"harmonic": h + 1},
                values[part][2 * h : 2 * h + 2],
                sigmas[part][2 * h : 2 * h + 2],
                feature.common,
            )
            for h in range(feature.harmonics)
        ]
    over, over_sigmas = (np.insert(each[3], 1, filler) for each, filler in ((values, 0.0), (sigmas, np.nan)))
    errors += [
        _made(
            "cycloid.lobe_profile",
            {"harmonic": m},
            over[2 * m : 2 * m + 2],
            over_sigmas[2 * m : 2 * m + 2],
            feature.common,
        )
        for m in range(feature.lobe_harmonics + 1)
    ]
    errors += [
        _made("cycloid.disc_lobe", {"lobe": lobe}, values[4][i : i + 1], sigmas[4][i : i + 1], feature.common)
        for i, lobe in enumerate(found.lobes)
    ]
    left = {
        f"made for place {found.place} of the discs, as its lobes stand": (np.nan, ""),
        "left out by the waves, rms": (found.estimate.rms, "length"),
    }
    if feature.datum == "bores":
        errors += _bores(found, sigmas[0], reducer, feature.common)
    else:
        left["displacement of the lobes taken out as that of the setup"] = (abs(found.displacement), "length")
        left["turn of the lobes taken out as that of the setup"] = (abs(found.turn), "angle")
    return Fitted(tuple(errors), left)


def _sizes(feature: Feature) -> Sequence[int]:
    """Numbers of setup, profile, pitch and lobe profile among the values of a fit of lobes."""
    return 3, 2 * feature.harmonics, 2 * feature.harmonics, 2 * feature.lobe_harmonics + 1


def _bores(found: fits.LobeFit, sigmas: Array, reducer: Reducer, common: float) -> list[Effect]:
    """Lobes that are displaced against the bores are bores displaced against the lobes."""
    key, index, radius, angles = _nominal("disc", reducer)
    errors = -(found.displacement * np.exp(-1j * angles) + 1j * radius * found.turn)
    sigma = np.array([np.hypot(sigmas[:2].max(), radius * sigmas[2])])
    return [_made(key, {index: j}, np.array([error.real, error.imag]), sigma, common) for j, error in enumerate(errors)]
