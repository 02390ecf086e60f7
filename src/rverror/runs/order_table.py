"""Order tables: what a bench's report prints of a run, the waves of some orders under each condition."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from rverror.base.arrays import Array
from rverror.base.viewed import Viewed

Waves = npt.NDArray[np.complex128]


@dataclass(frozen=True, kw_only=True)
class TableCondition:
    """Under what the waves were measured.

    Attributes
    ----------
    direction : float
        +1 forward, -1 reverse.
    torque : float, optional
        Size of the output torque, N*mm; it resists the motion.
    input_speed : float, optional
        rad/s.
    temperature : float, optional
        K.
    """

    direction: float
    torque: float | None = None
    input_speed: float | None = None
    temperature: float | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class OrderCase:
    """The waves of one condition.

    Attributes
    ----------
    condition : TableCondition
    orders : ndarray, shape (k,)
        Per output turn, growing.
    waves : ndarray of complex, shape (k,)
        z of each, rad: the error holds Re(z exp(i order theta)), so that its cosine's size is the real part and its
        sine's the negative imaginary one.  theta, the output angle, grows in both directions.
    sigma : ndarray, shape (k,), optional
        Standard deviation of the real and of the imaginary part, rad.
    """

    condition: TableCondition
    orders: Array
    waves: Waves
    sigma: Array | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class OrderTable(Viewed):
    """Waves of some orders under several conditions.

    Attributes
    ----------
    path : str
        File, as given; empty where the table was made in memory.
    cases : tuple of OrderCase
    index : str
        Label of the zero, as a run has it.
    metadata : mapping of str to str
        Every header key, as written.
    notes : tuple of str
        What was left out, changed or noticed, counted.

    Notes
    -----
    An order that a case does not hold is not known there, not zero.
    """

    path: str = ""
    cases: tuple[OrderCase, ...]
    index: str = ""
    metadata: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
