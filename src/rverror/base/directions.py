"""Directions of motion: words or signs at the edge, signs inside."""

from __future__ import annotations

from typing import Any, Literal, TypeAlias

import numpy as np

from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.base.text import shown

#: One direction, as users give it.
Direction: TypeAlias = Literal["forward", "reverse"] | float

#: Sign of each direction: the output angle grows forward.
DIRECTIONS = {"forward": 1.0, "reverse": -1.0}


def direction_signs(direction: Any) -> Array:
    """Sign of each of some directions.

    Parameters
    ----------
    direction : {"forward", "reverse"} or +1 or -1, or array_like of them
        Of any shape.

    Returns
    -------
    ndarray
        +1 or -1, of the same shape, () for a single one.

    Raises
    ------
    InputError
        If one of them is neither.

    Examples
    --------
    >>> direction_signs(["forward", "reverse"]).tolist(), float(direction_signs(-1))
    ([1.0, -1.0], -1.0)
    """
    given = np.asarray(direction)
    if given.dtype.kind in "iuf":
        wrong = ~np.isin(given, (-1, 1))
    else:
        given = np.asarray(direction, dtype=object)
        words = [DIRECTIONS.get(one.strip().lower(), one) if isinstance(one, str) else one for one in given.flat]
        wrong = np.array([isinstance(one, bool | np.bool_) or one not in (-1, 1) for one in words]).reshape(given.shape)
        given = np.array(words, dtype=object).reshape(given.shape)
    if wrong.any():
        first = np.asarray(direction, dtype=object)[wrong].flat[0]
        raise InputError(f"direction = {shown(first)}: must be 'forward' or 'reverse', +1 or -1")
    return given.astype(np.float64)


def direction_sign(direction: Direction) -> float:
    """Sign of one direction.

    Parameters
    ----------
    direction : {"forward", "reverse"} or +1 or -1

    Returns
    -------
    float
        +1 or -1.

    Raises
    ------
    InputError
        If it is neither, or not one.

    Examples
    --------
    >>> direction_sign("reverse"), direction_sign(1)
    (-1.0, 1.0)
    """
    sign = direction_signs(direction)
    if sign.ndim:
        raise InputError(f"direction: {sign.size} are given; give one, 'forward' or 'reverse'")
    return float(sign)
