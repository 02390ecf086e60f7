"""Result of a diagnosis: what was found, how large it is, and what could not be told apart."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from rverror.base.arrays import Array
from rverror.base.viewed import Viewed
from rverror.geartrain.source import IndexValue
from rverror.model.effects import Effect, Model

Progress = Callable[[str], None]
Alike = tuple[tuple[str, Mapping[str, IndexValue]], ...]


@dataclass(frozen=True)
class Residual:
    """Size of measured minus predicted, rad, offset of each run removed.

    `rms` and `peak_to_peak` over all samples; `heldout_rms` of revolutions that the fit did not see.
    """

    rms: float
    peak_to_peak: float
    heldout_rms: float


@dataclass(frozen=True)
class Estimate:
    """Size of a parameter with its 95 % interval, core units; NaN bounds where the runs do not determine it."""

    name: str
    dimension: str
    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Candidate:
    """One candidate with its score: what it takes off the left-out revolutions' weighted sum of squares.

    `fold_gains` are its parts, one per revolution that was left out.
    """

    key: str
    indices: Mapping[str, IndexValue]
    heldout_gain: float
    fold_gains: tuple[float, ...] = ()


@dataclass(frozen=True)
class Addition:
    """An effect that was added.

    Attributes
    ----------
    effect : Effect
        With its fitted size.
    estimates : tuple of Estimate
    indistinguishable : tuple of (str, mapping)
        Keys and indices of effects that fit as well.
    orders : tuple of float
        Where its waveform shows, the strongest first.
    heldout_rms : float
        Of the residual of left-out revolutions once it was added, rad.
    notes : tuple of str
        Sizes that no workshop makes, and the like.
    candidates : tuple of Candidate
        Of the round that chose it, the best first.
    """

    effect: Effect
    estimates: tuple[Estimate, ...]
    indistinguishable: Alike
    orders: tuple[float, ...]
    heldout_rms: float
    notes: tuple[str, ...]
    candidates: tuple[Candidate, ...] = ()


@dataclass(frozen=True)
class Line:
    """A line of the residual spectrum: order, amplitude with 95 % interval (rad), frames that it fits.

    `cos` and `sin` of the order's multiple of the output angle are the mean of all runs; NaN where the runs have no one
    zero.
    """

    order: float
    amplitude: float
    low: float
    high: float
    frames: tuple[str, ...]
    cos: float = math.nan
    sin: float = math.nan


@dataclass(frozen=True)
class Fate:
    """What became of a candidate in one round of the search: ``fell``, ``added`` or ``dropped``, and why."""

    round: int
    key: str
    indices: Mapping[str, IndexValue]
    fate: str
    why: str


@dataclass(frozen=True)
class Trace:
    """Averaged waveforms of one run for plots.

    Attributes
    ----------
    name : str
    direction : float
        +1 forward, -1 reverse.
    theta : ndarray, shape (n,)
        Nominal output angle, rad.
    measured, before, after : ndarray, shape (n,)
        Measured, declared and fitted error, rad.
    torque : float, optional
        Size of the output torque, N*mm.
    index : str
        Label of the run's zero, as the run file has it.
    left_out : tuple of two ndarray, shape (n,), optional
        Residual before and after, mean of revolutions each of which its own fit did not see.
    """

    name: str
    direction: float
    theta: Array
    measured: Array
    before: Array
    after: Array
    torque: float | None = None
    index: str = ""
    left_out: tuple[Array, Array] | None = None

    @property
    def residual(self) -> tuple[Array, Array]:
        """Residual before and after: of revolutions left out, where the run has them."""
        return self.left_out or (self.measured - self.before, self.measured - self.after)


@dataclass(frozen=True)
class Diagnosis(Viewed):
    """Result of `diagnose`.

    Attributes
    ----------
    verdict : str
        ``explained``, ``nothing_missing`` or ``unexplained``.
    noise_rms : float
        Of what differs between revolutions, rad.
    before, before_refitted, after : Residual
        Declared model as printed, refitted within its uncertainty, and with what was added.
    added : tuple of Addition
    unexplained : tuple of Line
        Significant lines that remain.
    model : Model
        The model with refitted sizes and what was added.
    declared : Model
        The model as given.
    candidates : tuple of Candidate
        Of the last round, the best first.
    tried : int
        Number of candidates.
    traces : tuple of Trace
    notes : tuple of str
        What was dropped or noticed.
    quantity : str
        Dimension of the signal, ``angle`` or ``torque``: a torque ripple is told by its lines, sizes in N*mm where this
        page says rad, and nothing of it enters the model.
    history : tuple of Fate
        What became of every candidate, and why, in order.
    """

    verdict: str
    noise_rms: float
    before: Residual
    before_refitted: Residual
    after: Residual
    added: tuple[Addition, ...]
    unexplained: tuple[Line, ...]
    model: Model
    declared: Model
    candidates: tuple[Candidate, ...]
    tried: int
    traces: tuple[Trace, ...]
    notes: tuple[str, ...]
    quantity: str = "angle"
    history: tuple[Fate, ...] = ()
