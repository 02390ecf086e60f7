"""How far another tool's waveform is off a reference case, by order, and which mix-up would explain it."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy

from rverror.base.arrays import Array
from rverror.base.numbers import in_arcsec, rounded
from rverror.base.units import ARCSEC
from rverror.model.ends import Encoders
from rverror.reference.cases import (
    DIGITS,
    LEAST,
    WORDS,
    Method,
    StoredCase,
    about_mean,
    rms_of,
    wave_json,
    waves_of,
)
from rverror.runs.measurement import Run
from rverror.runs.measuring_chain import BenchUncertainty, Figure, uncertainty_of
from rverror.runs.reading import refuse
from rverror.views.bench_report import BESIDE, bench_json, bench_sheet
from rverror.views.blocks import Sheet, facts, grid, line, notes, section, title
from rverror.views.describing import content, sheet

_TURN = 2 * math.pi
_NO_MATTER = 0.1 * ARCSEC  # waves that a coarse run may miss
_PER_WAVE = 8  # angles a wave of the largest order; a cubic spline then keeps a thousandth of it
_SAME_ANGLE = 1e-6  # of a step
_FAR_BETTER = 1 / 3
_AS_GOOD = 1.5
_FITS = 0.01  # rms of a difference, as a share of the case's, that asks for no hint


@dataclass(frozen=True)
class OrderDifference:
    """One order of a comparison, rad; a wave is amplitude * cos(order * theta - phase).

    Attributes
    ----------
    case, theirs, difference : complex
        amplitude * exp(i phase); the difference is theirs less the case's.
    """

    order: int
    case: complex
    theirs: complex
    difference: complex


@dataclass(frozen=True)
class Comparison:
    """How far a run is off a reference case; the offsets are compared on their own.

    Attributes
    ----------
    run, case, version : str
        Names, and the version of rverror that wrote the case.
    method : {"equilibrium", "closed"}
        Of the case's waveform.
    offset, rms, largest : float
        Mean difference; root mean square and largest size of the difference without it, rad.
    largest_at : float
        Angle of the largest difference, rad.
    peak_to_peak, case_rms, case_peak_to_peak : float
        Of the run, and of the case, rad.
    other_rms : float, optional
        rms of the difference against the other method; None where the case holds none.
    orders : tuple of OrderDifference
        All below half the number of angles, worst first.
    hints : tuple of str
        Mix-ups of convention that would explain far the most of the difference.
    notes : tuple of str
        What was interpolated, averaged or left out.
    bench : BenchUncertainty, optional
        Of the bench that measured the run, where it is stated.
    """

    run: str
    case: str
    version: str
    method: Method
    offset: float
    rms: float
    largest: float
    largest_at: float
    peak_to_peak: float
    case_rms: float
    case_peak_to_peak: float
    other_rms: float | None
    orders: tuple[OrderDifference, ...]
    hints: tuple[str, ...]
    notes: tuple[str, ...]
    bench: BenchUncertainty | None = None


# --- comparing --------------------------------------------------------------------------------------------------------


def compare(
    run: Run, case: StoredCase, *, method: Method = "equilibrium", encoders: Encoders | None = None
) -> Comparison:
    """Compare the transmission error of a run with that of a reference case.

    Parameters
    ----------
    run : Run
        One or more whole turns in one direction.
    case : StoredCase
    method : {"equilibrium", "closed"}
        With which of the case's waveforms.
    encoders : Encoders, optional
        How the bench read the angles, of a run that was measured.

    Returns
    -------
    Comparison

    Raises
    ------
    InputError
        If the run does not cover a turn, is too coarse for the case's largest order or turns back, or the case holds
        no waveform by this method.
    """
    name = run.path or "run"
    wanted = case.waveform(method)
    if wanted is None:
        refuse(
            name, f"the case {case.name} has no closed form, since it does not hold there; leave out --method closed"
        )
    found, notes = _on_case_angles(name, run, case, wanted)
    order = np.argsort(case.arrays["theta"] % _TURN, kind="stable")  # from 0 on, whatever the direction
    angle, case_wave, their_wave = case.arrays["theta"][order] % _TURN, wanted[order], found[order]
    difference = their_wave - case_wave
    about = about_mean(difference)
    other: Method = "closed" if method == "equilibrium" else "equilibrium"
    other_wave = case.waveform(other)
    other_rms = None if other_wave is None else rms_of(about_mean(their_wave - other_wave[order]))
    waves = [waves_of(values) for values in (case_wave, their_wave, difference)]
    worst = np.argsort(-np.abs(waves[2]), kind="stable")
    return Comparison(
        run=name,
        case=case.name,
        version=case.version,
        method=method,
        offset=float(difference.mean()),
        rms=rms_of(about),
        largest=float(np.abs(about).max()),
        largest_at=float(angle[np.abs(about).argmax()]),
        peak_to_peak=float(np.ptp(their_wave)),
        case_rms=rms_of(about_mean(case_wave)),
        case_peak_to_peak=float(np.ptp(case_wave)),
        other_rms=other_rms,
        orders=tuple(OrderDifference(int(i) + 1, *(complex(wave[i]) for wave in waves)) for i in worst),
        hints=_hints(about_mean(their_wave), about_mean(case_wave), other, other_rms),
        notes=(*run.notes, *notes),
        bench=None if encoders is None else uncertainty_of(encoders, case.ratio),
    )


def _on_case_angles(name: str, run: Run, case: StoredCase, wanted: Array) -> tuple[Array, list[str]]:
    """Error of a run at the angles of a case, mean of its whole turns, and what was done for it."""
    ways = set(run.direction.tolist())
    if len(ways) > 1:
        refuse(name, "the run turns back and forth; split it and give the part in one direction")
    notes = []
    if ways != {case.direction}:
        way, cases = ("forward", "reverse") if case.direction < 0 else ("reverse", "forward")
        notes.append(f"the run goes {way}, the case {cases}; compared at the same angles")
    theta, error = run.nominal_angle(case.ratio), run.error(case.ratio)
    angle, first = np.unique(theta, return_index=True)
    values = error[first]
    if angle.size < 2:
        refuse(name, "the nominal angle does not move; check the columns")
    step = np.diff(angle)
    turns = int((angle[-1] - angle[0] + 1.5 * float(np.median(step))) / _TURN)
    if turns < 1:
        refuse(
            name,
            f"the run covers {math.degrees(angle[-1] - angle[0]):.6g} deg of the output, a case is a whole turn of "
            "360 deg; give one or more whole turns",
        )
    targets = _targets(case, angle[0], turns)
    if not _samples_at(angle, targets):
        resolved = _check_step(name, step, wanted)
        notes.append(
            f"{angle.size} angles differ from the case's; interpolated by a cubic spline onto its {wanted.size} a "
            f"turn, good for orders below {resolved:.0f}"
        )
    values = _interpolated(angle, values, targets, turns)
    if turns > 1:
        notes.append(f"{turns} whole turns: their mean is compared")
    mean = np.empty(wanted.size)
    mean[_places(case, targets[: wanted.size])] = values.reshape(turns, wanted.size).mean(axis=0)
    return mean, notes


def _targets(case: StoredCase, start: float, turns: int) -> Array:
    """Angles of the case in the turns from a start on, growing."""
    theta = case.arrays["theta"]
    slack = _SAME_ANGLE * _TURN / theta.size
    one = np.sort((theta - start + slack) % _TURN) - slack + start
    return np.asarray((one + _TURN * np.arange(turns)[:, None]).ravel(), dtype=np.float64)


def _places(case: StoredCase, targets: Array) -> npt.NDArray[np.intp]:
    """Index in the case of each angle of one turn."""
    theta = case.arrays["theta"]
    number = np.rint(case.direction * (targets - theta[0]) / _TURN * theta.size).astype(np.intp)
    return np.asarray(number % theta.size, dtype=np.intp)


def _samples_at(angle: Array, targets: Array) -> bool:
    """Whether there is a sample at every target."""
    right = np.clip(np.searchsorted(angle, targets), 1, angle.size - 1)
    off = np.minimum(np.abs(targets - angle[right - 1]), np.abs(angle[right] - targets))
    return bool((off <= _SAME_ANGLE * (targets[1] - targets[0])).all())


def _check_step(name: str, step: Array, wanted: Array) -> float:
    """Order up to which a spline through these steps is good; refused where the case's largest is above it."""
    waves = np.abs(waves_of(wanted))
    longest = float(step.max())
    resolved = _TURN / longest / _PER_WAVE
    largest = int(waves.argmax()) + 1
    if waves.max() >= _NO_MATTER and largest > resolved:
        refuse(
            name,
            f"the angles lie up to {math.degrees(longest):.4g} deg apart, the case's largest order {largest} needs "
            f"{math.degrees(_TURN / largest / _PER_WAVE):.3g} deg or less ({_PER_WAVE} a wave); give more angles, best "
            f"the case's own {wanted.size}",
        )
    return resolved


def _interpolated(angle: Array, values: Array, targets: Array, turns: int) -> Array:
    """Cubic spline through the samples of the whole turns, carried on around their ends."""

    period = turns * _TURN
    inside = angle < angle[0] + period - 0.5 * float(np.median(np.diff(angle)))
    x, y = angle[inside], values[inside]
    x = np.concatenate([x[-_PER_WAVE:] - period, x, x[:_PER_WAVE] + period])
    y = np.concatenate([y[-_PER_WAVE:], y, y[:_PER_WAVE]])
    return np.asarray(scipy.interpolate.CubicSpline(x, y)(targets), dtype=np.float64)


# --- hints ------------------------------------------------------------------------------------------------------------


def _hints(theirs: Array, case: Array, other: Method, other_rms: float | None) -> tuple[str, ...]:
    """Mix-ups that bring the run far nearer to the case; those that do so equally well, simple ones first."""
    plain, scale = rms_of(theirs - case), rms_of(case)
    if scale < LEAST or plain <= _FITS * scale:
        return ()
    mirrored = np.roll(theirs[::-1], 1)  # angles from 0 on: theta -> -theta keeps the first in place
    tried = [
        (f"the case's {WORDS[other]} fits", other_rms, f"your tool shares its assumptions; see --method {other}"),
        ("the run with its sign turned fits", rms_of(-theirs - case), _SIGN),
        ("the run with its angles mirrored, theta for -theta, fits", rms_of(mirrored - case), _MIRROR),
        ("the run with sign and angles turned fits", rms_of(-mirrored - case), _BOTH),
    ]
    found = [(what, rms, remedy) for what, rms, remedy in tried if rms is not None]
    best = min(rms for _, rms, _ in found)
    if best > _FAR_BETTER * plain:
        return ()
    return tuple(
        f"{what} (rms {rms / ARCSEC:.3g} arcsec instead of {plain / ARCSEC:.3g}): {remedy}"
        for what, rms, remedy in found
        if rms <= max(_AS_GOOD * best, _FITS * scale)
    )


_SIGN = "the error is the output angle less input angle / R, positive where the output leads"
_MIRROR = "theta grows counter-clockwise, in forward motion; check the sense of rotation of your angles"
_BOTH = "angles and error count counter-clockwise; your tool may look from the other side or count clockwise"


# --- telling ----------------------------------------------------------------------------------------------------------


@sheet.register
def _comparison_sheet(found: Comparison, *, most: int = 12) -> Sheet:
    def measured(value: float, figure: Figure) -> str:
        bench = "" if found.bench is None else f" ± {found.bench.of(figure) / ARCSEC:.3f} ({BESIDE})"
        return f"{_arcsec(value)}{bench}"

    largest = [one for one in found.orders[:most] if abs(one.difference) >= 1e-6 * ARCSEC]
    waves = ("theirs", "case", "difference")
    heads = ("order", *(head for name in waves for head in (name, "phase")))
    rows = [(one.order, *(cell for name in waves for cell in _polar(getattr(one, name)))) for one in largest]
    other = WORDS["closed" if found.method == "equilibrium" else "equilibrium"]
    of_other = "" if found.other_rms is None else measured(found.other_rms, "rms")
    orders = "By order, worst first, arcsec and deg; a wave is amplitude * cos(order * theta - phase)"
    return (
        *title(
            "Comparison", found.run, f"case {found.case}, {WORDS[found.method]}", f"rverror {found.version}; arcsec"
        ),
        *notes(found.notes),
        *facts(
            {
                "peak-to-peak, theirs": measured(found.peak_to_peak, "peak_to_peak"),
                "peak-to-peak, case": _arcsec(found.case_peak_to_peak),
                "offset, theirs less case": _arcsec(found.offset),
                "rms of the difference, without the offset": measured(found.rms, "rms"),
                "rms of the case": _arcsec(found.case_rms),
                "largest difference": f"{_arcsec(found.largest)} at {math.degrees(found.largest_at):.4g} deg",
                f"rms against the {other}": of_other,
            }
        ),
        *(section(orders, *grid(heads, rows)) if rows else line("No order differs by 1e-6 arcsec or more.")),
        *section("Mix-ups that would explain the difference", *notes(found.hints)),
        *section("What the bench leaves uncertain", *bench_sheet(found.bench)),
    )


def _arcsec(value: float) -> str:
    return f"{value / ARCSEC:.4g}"


def _polar(wave: complex) -> tuple[float, float | None]:
    """Amplitude, arcsec, and phase, deg."""
    polar = wave_json(wave)
    return polar["amplitude_arcsec"], None if polar["phase_deg"] is None else round(polar["phase_deg"], 2)


@content.register
def _comparison_json(found: Comparison, *, most: int = 100) -> dict[str, Any]:
    sizes = {
        "peak_to_peak": found.peak_to_peak,
        "case_peak_to_peak": found.case_peak_to_peak,
        "case_rms": found.case_rms,
        "offset_difference": found.offset,
        "rms_difference": found.rms,
        "largest_difference": found.largest,
        "rms_against_other_method": found.other_rms,
    }
    waves = ("theirs", "case", "difference")
    return {
        "run": os.fspath(found.run),
        "case": found.case,
        "case_version": found.version,
        "method": WORDS[found.method],
        **{f"{name}_arcsec": in_arcsec(size, DIGITS) for name, size in sizes.items()},
        "largest_difference_at_deg": rounded(math.degrees(found.largest_at), DIGITS),
        "orders": [
            {"order": one.order, **{name: wave_json(getattr(one, name)) for name in waves}}
            for one in found.orders[:most]
        ],
        "bench_uncertainty": bench_json(found.bench),
        "hints": list(found.hints),
        "notes": list(found.notes),
    }
