"""Result types of what a model is asked most."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from rverror.base.arrays import Array
from rverror.base.viewed import Viewed
from rverror.geartrain.kinematics import OperatingConditions


@dataclass(frozen=True)
class Influence(Viewed):
    """Influence of one source on the output error.

    Attributes
    ----------
    matrix : ndarray, shape (terms, n)
        rad of output per mm (or rad, or unit) of each parameter.
    labels : tuple of str
        Name of each parameter.
    theta : ndarray, shape (n,)
        Nominal output angle, rad.
    key : str
        The source.
    """

    matrix: Array
    labels: tuple[str, ...]
    theta: Array
    key: str


@dataclass(frozen=True)
class Equilibrium(Viewed):
    """Loaded state of a reducer at n angles.

    Attributes
    ----------
    transmission_error : ndarray, shape (n,)
        rad; holds the elastic windup, a lag of the output against the load.
    pose : mapping of str to ndarray
        Displacement of each part from its nominal pose in the housing frame, x and y in mm and angle in rad:
        ``"carrier"`` (3, n), ``"disc"`` (discs, 3, n), ``"crank"`` (cranks, 3, n), ``"sun"`` x and y (2, n).
    contact_forces : mapping of str to ndarray
        Force of the driving on the driven part at each contact, N (spline: N*mm), keyed and shaped as in
        `action_line.CONTACT_AXES`.
    loaded_pins : ndarray of int, shape (discs, n)
        Pins that carry on each disc.
    steps : ndarray of int, shape (n,)
        Newton steps that each angle took.
    residual : ndarray, shape (n,)
        Largest force or moment out of balance, as a share of the load at the crank circle.  Convergence asks for 1e-9,
        or for what floating-point numbers can tell where preload is many times the load.
    theta : ndarray, shape (n,)
        Nominal output angle as the bench reads it, rad.
    model : Model, optional
        Whose state it is, as `equilibrium` was given it.
    conditions : OperatingConditions, optional
        As the bench reads them: angles, direction, torque and time.
    """

    transmission_error: Array
    pose: Mapping[str, Array]
    contact_forces: Mapping[str, Array]
    loaded_pins: npt.NDArray[np.intp]
    steps: npt.NDArray[np.intp]
    residual: Array
    theta: Array
    model: Any = None  # a `Model`, which knows of this file
    conditions: OperatingConditions | None = None
