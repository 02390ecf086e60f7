"""Residual of a diagnosis by order, before and after; turns and sampling of its runs; what an order stands beside."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rverror.base.arrays import Array
from rverror.diagnosis.result import Diagnosis, Trace
from rverror.geartrain.mechanism import Drive, Mechanism
from rverror.runs.spectrum import amplitude, frames_of_order, harmonics

_SIDEBANDS = (-1, 1, -2, 2)


@dataclass(frozen=True)
class RunSpectrum:
    """Amplitudes of one run's mean residual, core units, shape (m,) each."""

    order: Array
    before: Array
    after: Array


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


def _windowed(values: Array) -> Array:
    """Values less their parabola, under a window so scaled that a line's sum over it is its amplitude."""
    at = np.linspace(-1.0, 1.0, values.size)
    basis = np.stack([np.ones_like(at), at, at**2])
    rest = values - np.linalg.lstsq(basis.T, values, rcond=None)[0] @ basis
    window = np.hanning(values.size)
    return np.asarray(rest * window * 2 / window.sum(), dtype=np.float64)


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
