"""Virtual units in closed form, contacts closed: their peak-to-peaks, and how these go with the widths."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rverror.base.arrays import Array
from rverror.tolerances.extremes import Kernel, kernel
from rverror.tolerances.loaded_units import Solved
from rverror.tolerances.specification import Limit
from rverror.tolerances.stacking import Stack

_CHUNK = 1_000_000  # numbers in the draws of one chunk of units


@dataclass(frozen=True)
class ClosedFormUnits:
    """Units of a stack in closed form, to be solved as `LoadedUnits` are.

    Attributes
    ----------
    stack : Stack
    limits : tuple of Limit
        One, of the transmission error.
    """

    stack: Stack
    limits: tuple[Limit, ...]

    @cached_property
    def _kernel(self) -> Kernel:
        return kernel(self.stack.scaled(), self.stack.nominal)

    def solved(
        self,
        drawn: Array,
        widths: Array,
        *,
        slopes: bool = False,
        decide: bool = False,  # all are solved to the end
        near: Solved | None = None,  # nothing is found sooner from there
        progress: Callable[[int], None] | None = None,
    ) -> Solved:
        """Peak-to-peaks of units; the parameters are those of `LoadedUnits.solved`."""
        stack, count = self.stack, len(drawn)
        ratio, by_angle = (widths / stack.width)[stack.entry], np.ascontiguousarray(stack.influence.T)
        belongs = (stack.entry[:, None] == np.arange(widths.size)).astype(np.float64)
        slope, nominal = np.empty((count, widths.size)), np.empty(count)
        step = max(1, _CHUNK // stack.entry.size)
        for first in range(0, count, step):
            part = slice(first, min(first + step, count))
            high, low = self._kernel.places(drawn[part] * ratio)
            slope[part] = (drawn[part] * (by_angle[high] - by_angle[low])) @ belongs
            nominal[part] = stack.nominal[high] - stack.nominal[low]
            if progress is not None:
                progress(part.stop)
        turns = (slope @ widths + nominal)[:, None]
        return Solved(turns, (), turns[..., None], slope[:, None, None]) if slopes else Solved(turns, ())
