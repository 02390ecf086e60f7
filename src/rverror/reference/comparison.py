"""How far another tool's waveform is off a reference case, by order, and which mix-up would explain it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from rverror.base.arrays import Array
from rverror.base.numbers import brief, in_arcsec, rounded
from rverror.base.units import ARCSEC
from rverror.model.ends import Encoders
from rverror.reference.cases import (
    DIGITS,
    SHIPPED,
    WORDS,
    Method,
    StoredCase,
    phase_of,
    wave_json,
    waveform,
    waves_of,
)
from rverror.runs.measurement import Run
from rverror.runs.measuring_chain import BenchUncertainty, uncertainty_of
from rverror.views.bench_report import bench_json, of_figures
from rverror.views.describing import described, entries
from rverror.views.fields import COUNT, about, arrays, rows, same_unit
from rverror.views.shown_units import ANGLE, POSITION
from rverror.views.variables import Table

_TURN = 2 * math.pi
_NO_MATTER = 0.1 * ARCSEC  # waves that a coarse run may miss
_PER_WAVE = 8  # angles a wave of the largest order; a cubic spline then keeps a thousandth of it
_SAME_ANGLE = 1e-6  # of a step
_LEAST = 1e-6 * ARCSEC  # of a difference by order that is told to people
_TOLD = 100  # orders of a table


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
    orders : tuple of OrderDifference
        All below half the number of angles, worst first.
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
    orders: tuple[OrderDifference, ...]
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
    wanted = waveform(case.arrays, method)
    if wanted is None:
        run.refuse(f"the case {case.name} has no closed form, since it does not hold there; leave out --method closed")
    angle = np.sort(case.arrays["theta"] % _TURN)  # from 0 on, whatever the direction
    found, notes = _on_case_angles(run, case, angle, wanted)
    difference = found - wanted
    about = difference - difference.mean()
    waves = [waves_of(values) for values in (wanted, found, difference)]
    worst = np.argsort(-np.abs(waves[2]), kind="stable")
    return Comparison(
        run=run.path or "run",
        case=case.name,
        version=case.version,
        method=method,
        offset=float(difference.mean()),
        rms=float(np.std(difference)),
        largest=float(np.abs(about).max()),
        largest_at=float(angle[np.abs(about).argmax()]),
        peak_to_peak=float(np.ptp(found)),
        case_rms=float(np.std(wanted)),
        case_peak_to_peak=float(np.ptp(wanted)),
        orders=tuple(OrderDifference(int(i) + 1, *(complex(wave[i]) for wave in waves)) for i in worst),
        notes=(*run.notes, *notes),
        bench=None if encoders is None else uncertainty_of(encoders, case.ratio),
    )


def _on_case_angles(run: Run, case: StoredCase, case_angle: Array, wanted: Array) -> tuple[Array, list[str]]:
    """Error of a run at the angles of a case, mean of its whole turns, and what was done for it."""
    ways = set(run.direction.tolist())
    if len(ways) > 1:
        run.refuse("the run turns back and forth; split it and give the part in one direction")
    notes = []
    if ways != {case.direction}:
        way, cases = ("forward", "reverse") if case.direction < 0 else ("reverse", "forward")
        notes.append(f"the run goes {way}, the case {cases}; compared at the same angles")
    theta, error = run.nominal_angle(case.ratio), run.error(case.ratio)
    angle, first = np.unique(theta, return_index=True)
    values = error[first]
    step = np.diff(angle)
    turns = int((angle[-1] - angle[0] + 1.5 * float(np.median(step))) / _TURN)
    if turns < 1:
        run.refuse(
            f"the run covers {math.degrees(angle[-1] - angle[0]):.6g} deg of the output, a case is a whole turn of "
            "360 deg; give one or more whole turns"
        )
    targets = _targets(case_angle, angle[0], turns)
    if not _samples_at(angle, targets):
        resolved = _check_step(run, step, wanted)
        notes.append(
            f"{angle.size} angles differ from the case's; interpolated by a cubic spline onto its {wanted.size} a "
            f"turn, good for orders below {resolved:.0f}"
        )
    if turns > 1:
        notes.append(f"{turns} whole turns: their mean is compared")
    return _interpolated(angle, values, targets, turns).mean(axis=0), notes


def _targets(theta: Array, start: float, turns: int) -> Array:
    """Angles of a case in each of the turns from a start on, shape (turns, n)."""
    slack = _SAME_ANGLE * _TURN / theta.size
    once = start + (theta - start + slack) % _TURN - slack
    return np.asarray(once + _TURN * np.arange(turns)[:, None], dtype=np.float64)


def _samples_at(angle: Array, targets: Array) -> bool:
    """Whether there is a sample at every target."""
    right = np.clip(np.searchsorted(angle, targets), 1, angle.size - 1)
    off = np.minimum(np.abs(targets - angle[right - 1]), np.abs(angle[right] - targets))
    return bool((off <= _SAME_ANGLE * _TURN / targets.shape[1]).all())


def _check_step(run: Run, step: Array, wanted: Array) -> float:
    """Order up to which a spline through these steps is good; refused where the case's largest is above it."""
    waves = np.abs(waves_of(wanted))
    longest = float(step.max())
    resolved = _TURN / longest / _PER_WAVE
    largest = int(waves.argmax()) + 1
    if waves.max() >= _NO_MATTER and largest > resolved:
        run.refuse(
            f"the angles lie up to {math.degrees(longest):.4g} deg apart, the case's largest order {largest} needs "
            f"{math.degrees(_TURN / largest / _PER_WAVE):.3g} deg or less ({_PER_WAVE} a wave); give more angles, best "
            f"the case's own {wanted.size}"
        )
    return resolved


def _interpolated(angle: Array, values: Array, targets: Array, turns: int) -> Array:
    """Cubic spline through the samples of the whole turns, of which the end is the beginning."""
    period = turns * _TURN
    inside = angle < angle[0] + period - 0.5 * float(np.median(np.diff(angle)))
    x, y = np.append(angle[inside], angle[0] + period), np.append(values[inside], values[0])
    return np.asarray(scipy.interpolate.CubicSpline(x, y, bc_type="periodic")(targets), dtype=np.float64)


# --- telling ----------------------------------------------------------------------------------------------------------

#: Sizes of a comparison: key in JSON, name for people, what of the bench's uncertainty is of it.
_SIZES: Mapping[str, Mapping[str, Any]] = SHIPPED["comparison"]
_WAVES = ("theirs", "case", "difference")


@described.register
def _comparison_table(result: Comparison) -> Table:
    bench = result.bench
    sizes = [
        (size["words"], getattr(result, name), bench.of(size["bench"]) if bench and "bench" in size else math.nan)
        for name, size in _SIZES.items()
    ]
    worst = [_polar(one) for one in result.orders[:_TOLD] if abs(one.difference) >= _LEAST]
    waves = {**same_unit(ANGLE, *_WAVES), **same_unit(POSITION, *(f"{name}_phase" for name in _WAVES))}
    rms, own = (brief(value / ARCSEC) for value in (result.rms, result.case_rms))
    by_order = (
        "A wave is amplitude * cos(order * theta - phase)." if worst else "No order differs by 1e-6 arcsec or more."
    )
    return Table(
        {
            **rows("figure", sizes, figure="0", size=("1", ANGLE), bench_uncertainty=("2", ANGLE)),
            **arrays("", result, largest_difference_at=("largest_at", POSITION)),
            **rows("order", worst, order=COUNT, **waves),
        },
        about(result, "run", "case", "notes"),
        title=(result.run, f"case {result.case}", WORDS[result.method], f"rverror {result.version}"),
        verdict=(f"rms of the difference {rms} arcsec", f" without the offset; the case's own rms is {own} arcsec."),
        sentences=(by_order, *((of_figures(bench),) if bench else ())),
        shown={"order": ("order", *(column for name in _WAVES for column in (name, f"{name}_phase")))},
    )


def _polar(one: OrderDifference) -> dict[str, float]:
    """Order with amplitude and phase of each of its waves."""
    waves = {name: getattr(one, name) for name in _WAVES}
    phases = {f"{name}_phase": round(phase_of(wave), 6) for name, wave in waves.items()}
    return {"order": one.order, **{name: abs(wave) for name, wave in waves.items()}, **phases}


@entries.register
def _comparison_content(found: Comparison) -> dict[str, Any]:
    return {
        "case_version": found.version,
        "method": WORDS[found.method],
        **{size["key"]: in_arcsec(getattr(found, name), DIGITS) for name, size in _SIZES.items()},
        "largest_difference_at_deg": rounded(math.degrees(found.largest_at), DIGITS),
        "orders": [
            {"order": one.order, **{name: wave_json(getattr(one, name)) for name in _WAVES}}
            for one in found.orders[:_TOLD]
        ],
        "bench_uncertainty": bench_json(found.bench),
        "notes": list(found.notes),
    }
