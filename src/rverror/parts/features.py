"""Features of a part, of which each row of a file is a reading: places, circles, lobes and teeth become errors."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from rverror.base.arrays import Array, Integers
from rverror.base.errors import InputError
from rverror.base.numbers import brief
from rverror.base.text import some
from rverror.geartrain import coupling, crank, cycloid, involute
from rverror.geartrain.mechanism import Reducer
from rverror.model.effects import Effect
from rverror.parts import fits
from rverror.parts.mapping import Feature

#: Largest part of a turn without a reading of a circle, rad.
_WIDEST_GAP = np.pi / 3
#: Share of the largest uncertainty of an error's components below which one is rounding.
_EXACT = 1e-6
#: Decimals of a size in mm: a picometre.
_DECIMALS = 9
_PITCH = {"sun": involute.SUN_PITCH, "planet": involute.PLANET_PITCH, "disc": cycloid.DISC_PITCH}
_ECCENTRICITY = {"sun": involute.SUN_ECCENTRICITY, "planet": involute.PLANET_ECCENTRICITY}


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

    def stated(self, *names: str) -> float:
        """Largest of the stated uncertainties of some columns; NaN where one has none."""
        return float(np.max([self.sigmas.get(name, np.nan) for name in names if name in self.columns]))


#: What is not made an error, in words: its size in mm or rad, and which of them.
Left = dict[str, tuple[float, str]]


def feature_errors(feature: Feature, kind: str, readings: Readings, reducer: Reducer) -> tuple[list[Effect], Left, int]:
    """Errors that readings of a feature tell, what is left, and as those of which disc its lobes stand.

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
    list of Effect
    dict of str to (float, str)
    int
        0 of what has no lobes.

    Raises
    ------
    InputError
        If readings are missing, or do not tell the errors apart.
    """
    try:
        if feature.name == "lobes":
            return _lobes(feature, readings, reducer)
        if feature.name == "teeth":
            return *_teeth(feature, kind, readings, reducer), 0
        return *_places(feature, kind, readings, reducer), 0
    except fits.UnresolvedError as error:
        raise InputError(f"{readings.where}, [{feature.name}]: {error}") from error


def _errors(key: str, index: str, numbers: Iterable[int], sized: tuple[Array, Array], feature: Feature) -> list[Effect]:
    """An error for each number, of a row of components and of their uncertainties, whose mean square counts."""
    found = []
    for number, row, own in zip(numbers, *sized, strict=True):
        known = own[np.isfinite(own)]
        known = known[known > _EXACT * known.max(initial=0.0)]  # a datum leaves others no error at all
        sigma = float(f"{np.hypot(np.sqrt(np.mean(known**2)), feature.common):.3g}") if known.size else None
        sizes = tuple(round(float(value), _DECIMALS) + 0.0 for value in row)
        found.append(Effect(key, MappingProxyType({index: number} if index else {}), sizes, sigma))
    return found


def _order(where: str, numbers: Array, count: int, noun: str) -> Integers:
    """Row of each number, from 0 or from 1."""
    start = 0 if numbers.min() == 0 else 1
    places = numbers - start
    odd = (places != np.rint(places)) | (places < 0) | (places >= count)
    if odd.any():
        raise InputError(f"{where}: number {brief(float(numbers[odd.argmax()]))}: a unit has {noun} {start} to "
                         f"{start + count - 1}; correct it")  # fmt: skip
    found = np.bincount(places.astype(int), minlength=count)
    for wrong, problem in ((found == 0, "missing; measure all"), (found > 1, "measured twice; remove one row of each")):
        if wrong.any():
            raise InputError(f"{where}: {noun} {some(np.flatnonzero(wrong) + start)} of {count} {problem}")
    return np.argsort(places)


def _check_gap(where: str, angles: Array, widest: float) -> None:
    """Refuse a scan with too wide a gap, such as half a turn."""
    turned = np.sort(angles % (2 * np.pi))
    gaps = np.diff(turned, append=turned[:1] + 2 * np.pi)
    start, gap = np.degrees([turned[gaps.argmax()], gaps.max()])
    if gap > np.degrees(widest) * 1.001:
        raise InputError(f"{where}: no readings from {start:.1f} to {start + gap:.1f} deg, at most "
                         f"{np.degrees(widest):.1f} deg may be missing; scan a whole turn, angles in the "
                         "unit of the mapping")  # fmt: skip


# --- places and circles -----------------------------------------------------------------------------------------------


def _nominal(kind: str, reducer: Reducer) -> tuple[str, str, float, Array]:
    """Source of places, the index that counts them, the radius of their circle, and their angles."""
    key, index, radius, count = {
        "housing": (cycloid.PIN_POSITION, "pin", reducer.pin_circle_radius, reducer.pins),
        "disc": (cycloid.DISC_BORE, "crank", reducer.crank_radius, reducer.cranks),
        "carrier": (coupling.CARRIER_BORE, "crank", reducer.crank_radius, reducer.cranks),
        "crank": (crank.ECCENTRICITY, "disc", reducer.eccentricity, reducer.discs),
    }[kind]
    return key, index, radius, 2 * np.pi * np.arange(count) / count


def _places(feature: Feature, kind: str, readings: Readings, reducer: Reducer) -> tuple[list[Effect], Left]:
    key, index, radius, angles = _nominal(kind, reducer)
    where, columns, count = readings.where, readings.columns, angles.size
    left: Left = {}
    if feature.name == "circles":
        order = _order(where, np.unique(columns["number"]), count, f"{index}s")
        rows = [columns["number"] == number for number in np.unique(columns["number"])]
        for each in rows:
            _check_gap(where, columns["angle"][each], _WIDEST_GAP)
        points = columns["radius"] * np.exp(1j * columns["angle"])
        circles = [fits.circle(points[each], readings.stated("radius")) for each in rows]
        centres = np.array([centre for centre, _ in circles])
        sigma = np.array([estimate.sigmas[:2].max() for _, estimate in circles])
        left["form of the circles, rms"] = (max(estimate.rms for _, estimate in circles), "length")
    else:
        order = _order(where, columns["number"], count, f"{index}s")
        centres, sigma = columns["x"] + 1j * columns["y"], np.full(count, readings.stated("x", "y"))
    errors, kept = fits.place_errors(angles, radius, centres[order], feature.datum)
    if feature.harmonics:
        waves = range(feature.harmonics + 1)
        estimate = fits.ring_waves(angles, feature.harmonics, errors, kept, float(sigma[0]))
        sized = estimate.values.reshape(-1, 4), estimate.sigmas.reshape(-1, 4)
        found = _errors(cycloid.PIN_CIRCLE, "harmonic", waves, sized, feature)
        left[f"waves above {feature.harmonics}, rms"] = (estimate.rms, "length")
    else:
        sigmas = np.sqrt(kept**2 @ np.repeat(sigma, 2) ** 2).reshape(-1, 2)
        found = _errors(key, index, range(count), (errors, sigmas), feature)
        if np.isnan(sigmas).any():
            left["places taken as exact, as no uncertainty is stated"] = (np.nan, "")
    if "diameter" in columns:
        half = columns["diameter"][order, None] / 2 - reducer.pin_radius
        sigmas = np.full((count, 1), readings.stated("diameter") / 2)
        found += _errors(cycloid.PIN_RADIUS, "pin", range(count), (half, sigmas), feature)
    return found, left


# --- teeth ------------------------------------------------------------------------------------------------------------


def _teeth(feature: Feature, kind: str, readings: Readings, reducer: Reducer) -> tuple[list[Effect], Left]:
    count = {"sun": reducer.sun_teeth, "planet": reducer.planet_teeth, "disc": reducer.disc_lobes}[kind]
    columns, order = readings.columns, _order(readings.where, readings.columns["number"], count, "teeth")
    angles = feature.zero + feature.sense * 2 * np.pi * np.arange(count) / count
    names = [name for name in ("pitch", "cumulative", "runout") if name in columns]
    harmonics = min(feature.harmonics, (count - 1) // 2)
    rows = fits.tooth_rows(angles, harmonics, single="pitch" in columns, runout="runout" in columns)
    sigma = readings.stated(*names)
    weights = np.repeat([1.0 if np.isnan(sigma) else sigma / readings.sigmas[name] for name in names], count)
    data = weights * np.concatenate([columns[name][order] for name in names])
    found = fits.least_squares([(rows * weights[:, None], data)], sigma, orthogonal=True)
    width = 2 * harmonics + 2 * ("runout" in columns)
    pairs, sigmas = found.values[:width].reshape(-1, 2), found.sigmas[:width].reshape(-1, 2)
    sized = pairs[:harmonics], sigmas[:harmonics]
    errors = _errors(_PITCH[kind], "harmonic", range(1, harmonics + 1), sized, feature)
    if "runout" in columns:
        errors += _errors(_ECCENTRICITY[kind], "", [0], (pairs[harmonics:], sigmas[harmonics:]), feature)
    return errors, {f"pitch waves above {harmonics}, rms": (found.rms, "length")}


# --- lobes ------------------------------------------------------------------------------------------------------------


def _lobes(feature: Feature, readings: Readings, reducer: Reducer) -> tuple[list[Effect], Left, int]:
    columns, angles, radial = readings.columns, readings.columns["angle"], "radius" in readings.columns
    _check_gap(readings.where, angles, 2 * np.pi / reducer.disc_lobes)
    if (feature.place or 0) >= reducer.discs:
        raise InputError(
            f"{readings.where}: place = {feature.place}: a unit has discs 0 to {reducer.discs - 1}; correct it"
        )
    if radial:
        points = columns["radius"] * np.exp(1j * angles)
    else:
        points = fits.lobe_points(reducer, angles, columns["deviation"], feature.place or 0)
    H, M = feature.harmonics, feature.lobe_harmonics
    sigma = readings.stated("radius", "deviation")
    found = fits.fit_lobes(reducer, points, harmonics=H, lobe_harmonics=M, sigma=sigma, radial=radial)
    if feature.place not in (None, found.place):
        raise InputError(f"{readings.where}: place = {feature.place}, but its lobes stand as those of disc "
                         f"{found.place}; correct place, or the zero of the angle")  # fmt: skip
    # cos 0 has no sine
    both = [np.insert(each, 4 + 4 * H, np.nan) for each in (found.estimate.values, found.estimate.sigmas)]
    both[0] = np.nan_to_num(both[0])
    setup, profile, pitch, over, single = zip(
        *(np.split(each, np.cumsum([3, 2 * H, 2 * H, 2 * M + 2])) for each in both), strict=True
    )
    errors: list[Effect] = []
    for key, index, numbers, width, part in (
        (cycloid.DISC_PROFILE, "harmonic", range(1, H + 1), 2, profile),
        (cycloid.DISC_PITCH, "harmonic", range(1, H + 1), 2, pitch),
        (cycloid.LOBE_PROFILE, "harmonic", range(M + 1), 2, over),
        (cycloid.DISC_LOBE, "lobe", found.lobes, 1, single),
    ):
        errors += _errors(key, index, numbers, (part[0].reshape(-1, width), part[1].reshape(-1, width)), feature)
    left: Left = {
        f"lobes stand as those of disc {found.place} of a unit": (np.nan, ""),
        "higher waves and noise, rms": (found.estimate.rms, "length"),
    }
    if feature.datum == "bores":  # lobes displaced against bores are bores displaced against lobes
        key, index, radius, at = _nominal("disc", reducer)
        moved = -(found.displacement * np.exp(-1j * at) + 1j * radius * found.turn)
        sigmas = np.full((at.size, 1), np.hypot(max(setup[1][:2]), radius * setup[1][2]))
        errors += _errors(key, index, range(at.size), (np.stack([moved.real, moved.imag], axis=1), sigmas), feature)
    else:
        left["displacement of the lobes, taken as that of the setup"] = (abs(found.displacement), "length")
        left["turn of the lobes, taken as that of the setup"] = (abs(found.turn), "angle")
    return errors, left, found.place
