"""Result of a diagnosis: what was found, how large it is, and what could not be told apart."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from rverror.base.arrays import Array
from rverror.base.errors import former_name
from rverror.base.viewed import Viewed
from rverror.diagnosis.causes import Named
from rverror.diagnosis.order_passport import OrderPassport
from rverror.diagnosis.orders.resonances import Resonance
from rverror.geartrain.source import IndexValue
from rverror.model.effects import Effect, Model


@dataclass(frozen=True)
class Residual:
    """Size of measured minus predicted, rad, offset of each run removed.

    `rms` and `peak_to_peak` over all samples that were not set aside; `heldout_rms` of stretches that the fit did not
    see: every turn in its turn, or every sixth of a run of less than two.
    Slips are taken off, and what settles where the fit holds it; lines stay in.
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
    """One candidate with its score.

    Attributes
    ----------
    key : str
    indices : mapping
    heldout_gain : float
        What a linear step would take off the objective beside everything that is free.
    """

    key: str
    indices: Mapping[str, IndexValue]
    heldout_gain: float


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
        Of the residual of stretches left out, with all that was added, rad.
    notes : tuple of str
        Sizes that no workshop makes or that the runs do not tell, and the like.
    """

    effect: Effect
    estimates: tuple[Estimate, ...]
    indistinguishable: tuple[Named, ...]
    orders: tuple[float, ...]
    heldout_rms: float
    notes: tuple[str, ...]


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
class ElasticEstimate:
    """What runs say of a stiffness, the backlash or an exponent of the contact law.

    Attributes
    ----------
    name : str
        As in the model file.
    dimension : str
        ``stiffness``, ``length`` or ``number``.
    declared, value, low, high : float
        As declared, as fitted, and its interval, core units.
    determined : bool
        Whether its variance is less than half of what it was before the runs.
    """

    name: str
    dimension: str
    declared: float
    value: float
    low: float
    high: float
    determined: bool

    told = former_name("told", "determined")


@dataclass(frozen=True)
class OrderShare:
    """What accounts for the power of one order of a table: shares that make one together.

    A share is that of the measured waves' power which the part points along, so one that works against the others is
    negative.  Of an order that is no more than noise none is known: they are NaN.

    Attributes
    ----------
    order : float
    amplitude : float
        Root of the mean squared amplitude, rad.
    parts : float
        Part errors, declared and found.
    compliance : float
        What gives way under load.
    measuring_chain : float
        Encoders and couplings.
    empirical : float
        Laws that describe and explain nothing.
    left : float
        Nothing.
    """

    order: float
    amplitude: float
    parts: float
    compliance: float
    measuring_chain: float
    empirical: float
    left: float


@dataclass(frozen=True)
class Validation:
    """A result held against data that no fit saw: nothing is fitted to them but the offset of a run.

    Attributes
    ----------
    file : str
    before, after : float
        Root mean square of the residual of the declared model and of the result, rad.
    orders : tuple of float
        Orders of a table; empty for a run.
    before_by_order, after_by_order : tuple of float
        Of each order, rad.
    """

    file: str
    before: float
    after: float
    orders: tuple[float, ...] = ()
    before_by_order: tuple[float, ...] = ()
    after_by_order: tuple[float, ...] = ()


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
        Residual before and after of stretches each of which its own fit did not see, mean of whole turns.
    set_aside : ndarray, shape (k,), optional
        Output angles of samples that cannot be and were left out, rad, as travelled.
    slips : ndarray, shape (k,), optional
        Output angles at which the reading slips, rad, as travelled.
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
    set_aside: Array | None = None
    slips: Array | None = None

    @property
    def residual(self) -> tuple[Array, Array]:
        """Residual before and after: of stretches left out, where the run has them."""
        return self.left_out or (self.measured - self.before, self.measured - self.after)


@dataclass(frozen=True)
class Diagnosis(Viewed):
    """Result of `diagnose`.

    Attributes
    ----------
    verdict : str
        ``explained``, ``nothing_missing`` or ``unexplained``.
    noise_rms : float
        Of what is left of a reading when all that is regular is out, rad.
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
        The best first, beside what was declared.
    tried : int
        Number of candidates.
    traces : tuple of Trace
    notes : tuple of str
        What was set aside, dropped or noticed.
    quantity : str
        Dimension of the signal, ``angle`` or ``torque``: a torque ripple is told by its lines, sizes in N*mm where this
        page says rad, and nothing of it enters the model.
    history : tuple of Fate
        What became of candidates, and why, in order: of a drive of every one, of a reducer of what was added and of
        the best one that is not named.
    elastic : tuple of ElasticEstimate
        What the runs say of a reducer's stiffness, backlash and contact law.
    passport : tuple of OrderPassport
        How each order depends on load, direction, speed and temperature: of order tables, and of a reducer's runs of a
        turn or more, one for each condition.
    shares : tuple of OrderShare
        Of order tables: what accounts for the power of each order.
    validation : tuple of Validation
        Data that no fit saw, before and after.
    resonances : tuple of Resonance
        Natural frequencies that orders show over the speed.
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
    elastic: tuple[ElasticEstimate, ...] = ()
    passport: tuple[OrderPassport, ...] = ()
    shares: tuple[OrderShare, ...] = ()
    validation: tuple[Validation, ...] = ()
    resonances: tuple[Resonance, ...] = ()
