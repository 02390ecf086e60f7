"""Residual of a diagnosis by order, before and after, with the frames that each order fits."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rverror.base.arrays import Array
from rverror.diagnosis.result import Diagnosis, Trace
from rverror.geartrain.mechanism import Drive, Mechanism
from rverror.runs.spectrum import amplitude, frames_of_order, harmonics

_NEIGHBOURS = 25  # lines whose median stands for what noise leaves
_STANDS_OUT = 5.0  # times that median: chance leaves one noise line in 10^7 above it
_SAME_ORDER = 1e-6
_SAME_LINE = 0.02
_MULTIPLES = 8
_SIDEBANDS = (-1, 1, -2, 2)


@dataclass(frozen=True)
class RunSpectrum:
    """Amplitudes of one run's mean residual, core units, shape (m,) each."""

    order: Array
    before: Array
    after: Array


@dataclass(frozen=True)
class OrderSize:
    """One order of the residual, all runs together.

    Attributes
    ----------
    order : float
        Per output turn.
    frames : tuple of str
    beside : tuple of str
        From `beside`.
    before, after : float
        Amplitude, root mean square over the runs, core units.
    runs : tuple of (float, float)
        Amplitude before and after of each run; NaN where a run's travel does not resolve the order.
    """

    order: float
    frames: tuple[str, ...]
    beside: tuple[str, ...]
    before: float
    after: float
    runs: tuple[tuple[float, float], ...]


def short_frame(frame: str) -> str:
    """Name of a frame as a picture has room for it."""
    short = frame.replace("carrier, disc or crank", "carrier/disc/crank")
    return short.replace("output side (encoder, coupling)", "output side")


def turns_of(trace: Trace) -> float:
    """Output turns that a trace spans, whole where it spans whole turns."""
    step = trace.theta[1] - trace.theta[0]
    turns = float(trace.theta[-1] - trace.theta[0] + step) / (2 * math.pi)
    return float(round(turns)) if abs(turns - round(turns)) < 1e-3 * turns else turns


def samples_per_turn(diagnosis: Diagnosis) -> float:
    """Samples an output turn of the coarsest run; infinite where traces do not keep it, as those of a drive."""
    if isinstance(diagnosis.declared.mechanism, Drive) or not diagnosis.traces:
        return math.inf
    return min(float(trace.theta.size / turns_of(trace)) for trace in diagnosis.traces)


def residual_spectrum(trace: Trace) -> RunSpectrum:
    """Amplitude of each order of measured less predicted; mean of stretches left out of the fit, where there are any.

    Over a part of a turn no order repeats: a parabola is taken off and a Hann window put on, so that what grows along
    the run does not spill over all orders.  Orders are then resolved no finer than two per travel.
    """
    turns, n = turns_of(trace), trace.theta.size
    if turns != round(turns):
        bins = np.arange(4, int(0.8 * n))  # padded to twice the travel, they lie half a travel's order apart
        before, after = (np.abs(np.fft.rfft(_windowed(values), 2 * n))[bins] for values in trace.residual)
        return RunSpectrum(bins / (2 * turns), before, after)
    before, after = (amplitude(harmonics(values), n) for values in trace.residual)
    return RunSpectrum(np.arange(1, before.size + 1, dtype=np.float64) / turns, before, after)


def windowed_amplitude(theta: Array, values: Array, order: Array) -> Array:
    """Amplitudes at any orders of a signal over a part of a turn at even angles, parabola off and Hann window on."""
    rest = _windowed(values)
    return np.asarray([abs(np.sum(rest * np.exp(-1j * k * theta))) for k in order], dtype=np.float64)


def _windowed(values: Array) -> Array:
    """Values less their parabola, under a window so scaled that a line's sum over it is its amplitude."""
    at = np.linspace(-1.0, 1.0, values.size)
    basis = np.stack([np.ones_like(at), at, at**2])
    rest = values - np.linalg.lstsq(basis.T, values, rcond=None)[0] @ basis
    window = np.hanning(values.size)
    return np.asarray(rest * window * 2 / window.sum(), dtype=np.float64)


def leading_orders(diagnosis: Diagnosis, *, most: int = 16) -> tuple[OrderSize, ...]:
    """Orders that stand out of the residual before or after, those of added effects, and the unexplained ones.

    Parameters
    ----------
    diagnosis : Diagnosis
    most : int
        How many; the largest before come first, and unexplained ones always stay.

    Returns
    -------
    tuple of OrderSize
        The largest before first.
    """
    if not diagnosis.traces:
        return ()
    spectra, known = [residual_spectrum(trace) for trace in diagnosis.traces], None
    if any(turns_of(trace) != round(turns_of(trace)) for trace in diagnosis.traces):
        known = _known_orders(diagnosis)
        spectra = [_at_known(trace, known) for trace in diagnosis.traces]
    order = spectra[0].order
    if not order.size:
        return ()
    pairs = np.array([_at_orders(spectrum, order) for spectrum in spectra])
    together = np.sqrt(np.nanmean(pairs**2, axis=0))
    floor = _running_median(together[1]) if known is None else np.full(order.size, _STANDS_OUT**-2) * together.max()
    wanted = {line.order for line in diagnosis.unexplained}
    named = wanted | {o for addition in diagnosis.added for o in addition.orders}
    out = (together > _STANDS_OUT * floor).any(axis=0) & (together.max(axis=0) > 0)
    chosen = [int(i) for i in np.argsort(-together[0], kind="stable") if out[i] or _is_in(order[i], named)]
    kept = [i for rank, i in enumerate(chosen) if rank < most or _is_in(order[i], wanted)]
    return tuple(
        OrderSize(
            float(order[i]),
            *_names(diagnosis, float(order[i])),
            float(together[0, i]),
            float(together[1, i]),
            tuple((float(before[i]), float(after[i])) for before, after in pairs),
        )
        for i in kept
    )


def _names(diagnosis: Diagnosis, order: float) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Frames of an order and those beside it; of a line, as the search found them with the tolerance of the run."""
    unit = diagnosis.declared.mechanism
    told = [line.frames for line in diagnosis.unexplained if _is_in(order, {line.order})]
    frames = told[0] if told else tuple(frames_of_order(unit, order))
    return frames, () if frames else beside(unit, order)


def _known_orders(diagnosis: Diagnosis) -> Array:
    """Orders that have a name or were found, as far as every trace resolves and holds them."""
    unit = diagnosis.declared.mechanism
    bases = {abs(unit.ratio), *(map(abs, unit.shafts.values()) if isinstance(unit, Drive) else ())}
    orders = {multiple * base for base in bases for multiple in range(1, _MULTIPLES + 1)}
    orders |= {line.order for line in diagnosis.unexplained} | {o for a in diagnosis.added for o in a.orders}
    lowest = max(2 / turns_of(trace) for trace in diagnosis.traces)
    highest = min(0.4 * trace.theta.size / turns_of(trace) for trace in diagnosis.traces)
    return np.array(sorted(order for order in orders if lowest <= order <= highest), dtype=np.float64)


def _at_known(trace: Trace, order: Array) -> RunSpectrum:
    return RunSpectrum(order, *(windowed_amplitude(trace.theta, values, order) for values in trace.residual))


def _at_orders(spectrum: RunSpectrum, order: Array) -> Array:
    """Amplitudes before and after at the orders of another run, shape (2, m)."""
    nearest = np.abs(spectrum.order[:, None] - order).argmin(axis=0)
    there = np.abs(spectrum.order[nearest] - order) < _SAME_LINE
    return np.where(there, np.stack([spectrum.before, spectrum.after])[:, nearest], np.nan)


def beside(mechanism: Mechanism, order: float) -> tuple[str, ...]:
    """Frames of which an order that fits none is a sideband, once or twice an output turn away.

    Parameters
    ----------
    mechanism : Reducer or Drive
    order : float
        Per output turn.

    Returns
    -------
    tuple of str
        Empty where the order fits a frame itself, or where there is none beside it.

    Examples
    --------
    >>> from rverror import reducer
    >>> beside(reducer("RV-40E"), 77), beside(reducer("RV-40E"), 78), beside(reducer("RV-40E"), 36)
    (('1 below housing 39 x 2',), (), ())
    """
    if frames_of_order(mechanism, order):
        return ()
    for away in _SIDEBANDS:
        near = [f for f in frames_of_order(mechanism, order - away) if order - away > 2.5]
        if near:
            return (f"{abs(away)} {'above' if away > 0 else 'below'} {near[0]}",)
    return ()


def _is_in(order: float, orders: set[float]) -> bool:
    return any(abs(order - other) < _SAME_ORDER * max(1.0, order) for other in orders)


def _running_median(values: Array) -> Array:
    """Median over the neighbours of each place, fewer at the ends."""
    half = _NEIGHBOURS // 2
    padded = np.pad(values, half, constant_values=np.nan)
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1)
    return np.asarray(np.nanmedian(windows, axis=1), dtype=np.float64)
