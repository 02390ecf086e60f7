"""How far another tool's waveform is off a reference case, by order, and which mix-up would explain it."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy

from rverror.base.arrays import Array
from rverror.base.numbers import in_arcsec, rounded
from rverror.base.text import joined
from rverror.base.units import ARCSEC
from rverror.model.ends import Encoders
from rverror.reference.cases import (
    DIGITS,
    LEAST,
    WORDS,
    Method,
    StoredCase,
    about_mean,
    has_phase,
    rms_of,
    wave_json,
    waves_of,
)
from rverror.runs.measurement import Run
from rverror.runs.measuring_chain import BenchUncertainty, Figure, uncertainty_of
from rverror.runs.reading import refuse
from rverror.views.bench_report import BESIDE, bench_json, bench_sheet, plus_minus
from rverror.views.blocks import as_text, section
from rverror.views.envelope import InputFile, enveloped
from rverror.views.report import to_json, to_text

_TURN = 2 * math.pi
_NO_MATTER = 0.1 * ARCSEC  # waves that a coarse run may miss
_PER_WAVE = 8  # angles a wave of the largest order; a cubic spline then keeps a thousandth of it
_SAME_ANGLE = 1e-6  # of a step
_FAR_BETTER = 1 / 3
_AS_GOOD = 1.5
_FITS = 0.01  # rms of a difference, as a share of the case's, that asks for no hint
_PEAKS = 40
_FIGURES: tuple[Figure, Figure] = ("peak_to_peak", "rms")  # beside which the uncertainty of the run's bench stands


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
    other_wave, opposite = case.waveform(other), case.waveform(method, opposite=True)
    fits = [
        (f"{what} fits", rms_of(about_mean(their_wave - wave[order])), remedy)
        for what, wave, remedy in (
            (f"the case's {WORDS[other]}", other_wave, f"your tool shares its assumptions; see --method {other}"),
            ("the case in the other direction", opposite, _DIRECTION),
        )
        if wave is not None
    ]
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
        other_rms=None if other_wave is None else rms_of(about_mean(their_wave - other_wave[order])),
        orders=tuple(OrderDifference(int(i) + 1, *(complex(wave[i]) for wave in waves)) for i in worst),
        hints=_hints(about_mean(their_wave), about_mean(case_wave), fits, case.turns),
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
    taken = _taken(angle, targets)
    if taken is None:
        resolved = _check_step(name, step, wanted)
        values = _interpolated(angle, values, targets, turns)
        notes.append(
            f"{angle.size} angles differ from the case's; interpolated by a cubic spline onto its {wanted.size} a "
            f"turn, good for orders below {resolved:.0f}"
        )
    else:
        values = values[taken]
        if left := angle.size - taken.size:
            notes.append(f"{left} of {angle.size} angles are none of the case's, and were left out")
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


def _taken(angle: Array, targets: Array) -> npt.NDArray[np.intp] | None:
    """Samples that lie at the targets; None where one of them has none."""
    right = np.clip(np.searchsorted(angle, targets), 1, angle.size - 1)
    nearest = np.where(targets - angle[right - 1] < angle[right] - targets, right - 1, right)
    step = float(targets[1] - targets[0])
    return nearest if (np.abs(angle[nearest] - targets) <= _SAME_ANGLE * step).all() else None


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


def _hints(
    theirs: Array, case: Array, others: Sequence[tuple[str, float, str]], turns: Mapping[str, float]
) -> tuple[str, ...]:
    """Mix-ups that bring the run far nearer to the case; those that do so equally well, simple ones first."""
    plain, scale = rms_of(theirs - case), rms_of(case)
    if scale < LEAST or plain <= _FITS * scale:
        return ()
    mirrored = np.roll(theirs[::-1], 1)  # angles from 0 on: theta -> -theta keeps the first in place
    tried = [
        *others,
        ("the run with its sign turned fits", rms_of(-theirs - case), _SIGN),
        ("the run with its angles mirrored, theta for -theta, fits", rms_of(mirrored - case), _MIRROR),
        ("the run with sign and angles turned fits", rms_of(-mirrored - case), _BOTH),
    ]
    best = min(rms for _, rms, _ in tried)
    lead, shifted = _shift(theirs, case)
    if shifted <= _FAR_BETTER * min(plain, best):
        place = f"{math.degrees(lead):.4g} deg of the output{_in_turns(lead, turns)}"
        best = shifted
        tried = [(f"the run fits where its angles are taken to lead the case's by {place}", shifted, _ZERO)]
    if best > _FAR_BETTER * plain:
        return ()
    return tuple(
        f"{what} (rms {rms / ARCSEC:.3g} arcsec instead of {plain / ARCSEC:.3g}): {remedy}"
        for what, rms, remedy in tried
        if rms <= max(_AS_GOOD * best, _FITS * scale)
    )


_DIRECTION = "check the direction of motion and of the load, and which flanks and pins carry"
_SIGN = "the error is the output angle less input angle / R, positive where the output leads"
_MIRROR = "theta grows counter-clockwise, in forward motion; check the sense of rotation of your angles"
_ZERO = "check where theta = 0 lies"
_BOTH = "angles and error count counter-clockwise; your tool may look from the other side or count clockwise"


def _shift(theirs: Array, case: Array) -> tuple[float, float]:
    """Smallest lead of the run's angles at which it fits best, rad, and the rms left."""
    n = theirs.size
    lines, order = np.fft.rfft(theirs), np.arange(n // 2 + 1)
    fit = np.fft.irfft(lines * np.conj(np.fft.rfft(case)), n)  # of theirs, so many angles on
    peaks = np.flatnonzero((fit >= np.roll(fit, 1)) & (fit >= np.roll(fit, -1)))
    found = []
    for peak in peaks[np.argsort(-fit[peaks], kind="stable")][:_PEAKS]:
        lead = float((_TURN * peak / n + math.pi) % _TURN - math.pi)
        for _ in range(4):
            moved = lines * np.exp(1j * order * lead)
            slope, rest = np.fft.irfft(1j * order * moved, n), np.fft.irfft(moved, n) - case
            power = float(slope @ slope)
            lead -= float(slope @ rest) / power if power > 0 else 0.0
        found.append((lead, rms_of(np.fft.irfft(lines * np.exp(1j * order * lead), n) - case)))
    least = min((rms for _, rms in found), default=math.inf)
    near = [item for item in found if item[1] <= max(1.05 * least, 1e-3 * rms_of(case))]
    return min(near, key=lambda item: abs(item[0]), default=(0.0, math.inf))


def _in_turns(lead: float, turns: Mapping[str, float]) -> str:
    """Lead in turns of crank and sun where it is a whole number of them."""
    carrier = turns.get("carrier", 1.0)
    rates = {
        f"{part} turns {where}": turns[part] - base
        for where, base in (("against the carrier", carrier), ("in the housing", 0.0))
        for part in ("crank", "sun")
        if part in turns
    }
    counts = {what: abs(lead / _TURN * rate) for what, rate in rates.items()}
    whole = [
        f"{round(count)} {what}" for what, count in counts.items() if round(count) and abs(count - round(count)) < 5e-3
    ]
    return f", {' or '.join(whole)}" if whole else ""


# --- telling ----------------------------------------------------------------------------------------------------------


@to_text.register
def comparison_text(found: Comparison, *, most: int = 12) -> str:
    """Comparison as text.

    Parameters
    ----------
    most : int
        Orders told.

    Returns
    -------
    str
        Angles in arcsec.
    """
    of_peak, of_rms = (
        "" if found.bench is None else f"{plus_minus(found.bench.of(figure) / ARCSEC)} ({BESIDE})"
        for figure in _FIGURES
    )
    lines = [
        f"{found.run} against the case {found.case}, {WORDS[found.method]} (rverror {found.version}); arcsec",
        *(f"note: {note}" for note in found.notes),
        "",
        f"{'peak-to-peak':28s} theirs {_arcsec(found.peak_to_peak)}{of_peak}   case {_arcsec(found.case_peak_to_peak)}",
        f"{'offset, theirs less case':28s} {_arcsec(found.offset)}",
        f"{'rms of the difference':28s} {_arcsec(found.rms)}{of_rms}   without the offset; the case's own rms "
        f"{_arcsec(found.case_rms)}",
        f"{'largest difference':28s} {_arcsec(found.largest)}   at {math.degrees(found.largest_at):.4g} deg",
    ]
    if found.other_rms is not None:
        word = WORDS["closed" if found.method == "equilibrium" else "equilibrium"]
        lines.append(f"{f'rms against the {word}':28s} {_arcsec(found.other_rms)}{of_rms}")
    lines += as_text(section("What the bench leaves uncertain", *bench_sheet(found.bench))).splitlines()
    told = [line for line in found.orders[:most] if abs(line.difference) >= 1e-6 * ARCSEC]
    if told:
        lines += [
            "",
            "By order, worst first; a wave is amplitude * cos(order * theta - phase)",
            "order" + "".join(f" {name:>11s} {'phase':>8s}" for name in ("theirs", "case", "difference")),
            *(
                f"{line.order:5d} {_polar(line.theirs)} {_polar(line.case)} {_polar(line.difference)}".rstrip()
                for line in told
            ),
        ]
    else:
        lines += ["", "No order differs by 1e-6 arcsec or more"]
    if found.hints:
        lines += ["", *(f"hint: {hint}" for hint in found.hints)]
    return joined(lines)


def _arcsec(value: float) -> str:
    return f"{value / ARCSEC:.4g}"


def _polar(wave: complex) -> str:
    phase = f"{math.degrees(math.atan2(wave.imag, wave.real)):z8.2f}" if has_phase(wave) else f"{'-':>8s}"
    return f"{abs(wave) / ARCSEC:11.4g} {phase}"


@to_json.register
def comparison_json(found: Comparison, *, most: int = 100, files: Sequence[InputFile] = ()) -> dict[str, Any]:
    """Comparison as plain data for `json.dump`; keys are only ever added.

    Parameters
    ----------
    most : int
        Orders told.
    files : sequence of InputFile, optional
        What it was made from.

    Returns
    -------
    dict
        Angles in arcsec, phases in deg.
    """
    content = {
        "run": os.fspath(found.run),
        "case": found.case,
        "case_version": found.version,
        "method": WORDS[found.method],
        "peak_to_peak_arcsec": in_arcsec(found.peak_to_peak, DIGITS),
        "case_peak_to_peak_arcsec": in_arcsec(found.case_peak_to_peak, DIGITS),
        "case_rms_arcsec": in_arcsec(found.case_rms, DIGITS),
        "offset_difference_arcsec": in_arcsec(found.offset, DIGITS),
        "rms_difference_arcsec": in_arcsec(found.rms, DIGITS),
        "largest_difference_arcsec": in_arcsec(found.largest, DIGITS),
        "largest_difference_at_deg": rounded(math.degrees(found.largest_at), DIGITS),
        "rms_against_other_method_arcsec": in_arcsec(found.other_rms, DIGITS),
        "orders": [
            {
                "order": line.order,
                **{name: wave_json(getattr(line, name)) for name in ("theirs", "case", "difference")},
            }
            for line in found.orders[:most]
        ],
        "bench_uncertainty": bench_json(found.bench),
        "hints": list(found.hints),
        "notes": list(found.notes),
    }
    return enveloped("Comparison", content, files)
