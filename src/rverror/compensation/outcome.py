"""What a compensation is: the correction, what it leaves of data left out, what stays and why."""

from __future__ import annotations

from dataclasses import dataclass, field

from rverror.base.arrays import Array
from rverror.base.viewed import Viewed
from rverror.compensation.correction import Correction
from rverror.model.effects import Model


@dataclass(frozen=True)
class CompensatedOrder:
    """One order that is compensated.

    Attributes
    ----------
    order : float
        Per output turn.
    frames : tuple of str
        Which it fits.
    amplitude : float
        Root of the mean squared amplitude over the conditions, rad.
    left : float
        The same of what stretches or conditions left out keep of it, rad.
    law : str
        How it hangs on direction and condition; ``"measured"`` where each condition has its own wave, ``"predicted"``
        where the model alone says it.
    """

    order: float
    frames: tuple[str, ...]
    amplitude: float
    left: float
    law: str


@dataclass(frozen=True)
class HeldError:
    """Error of data that were left out, and in what interval that of the next run is expected.

    Attributes
    ----------
    rms : float
        Root of the mean square of all that was left out, rad.
    low, high : float
        95 % interval of the rms of one further turn, stretch or condition; NaN where fewer than two were left out.
    """

    rms: float
    low: float
    high: float


@dataclass(frozen=True)
class Unseen:
    """A run or table that no fit saw: rms with the offset of each direction taken off, without and with the table."""

    file: str
    before: float
    after: float


@dataclass(frozen=True, eq=False)
class CompensatedTrace:
    """Error of a run without and with the correction, rad; with it from stretches left out, or of a run never seen."""

    name: str
    theta: Array
    before: Array
    after: Array
    unseen: bool = False


@dataclass(frozen=True, eq=False)
class Compensation(Viewed):
    """Result of `compensate`.

    Attributes
    ----------
    correction : Correction
        Empty where nothing survives.
    orders : tuple of CompensatedOrder
        The largest first.
    before, after : HeldError
        Of data left out, without and with the correction.
    model : Model
        From which causes were taken.
    index : str
        Label of the zero to which the angles are tied.
    stays : tuple of str
        What stays, and why.
    notes : tuple of str
        Warnings: what was set aside, what lies outside of what was measured.
    unseen : tuple of Unseen
        What no fit saw.
    traces : tuple of CompensatedTrace
        For plots; empty of order tables.

    Examples
    --------
    >>> import numpy as np, rverror
    >>> theta = np.linspace(0, 4 * np.pi, 2001)
    >>> run = rverror.run_from_arrays(input_angle=14 * theta, te=1e-6 * np.random.default_rng(1).normal(size=2001))
    >>> made = rverror.compensate(rverror.Model(rverror.Drive(ratio=14.0)), [run])
    >>> made.worth, made.correction.orders.size
    (False, 0)
    """

    correction: Correction
    orders: tuple[CompensatedOrder, ...]
    before: HeldError
    after: HeldError
    model: Model
    index: str = ""
    stays: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    unseen: tuple[Unseen, ...] = ()
    traces: tuple[CompensatedTrace, ...] = field(default=())

    @property
    def worth(self) -> bool:
        """Whether anything survives."""
        return bool(self.orders)
