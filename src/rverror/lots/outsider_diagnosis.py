"""Units that are no members, each diagnosed by itself: a gross error is beyond what influences tell."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from rverror.base.errors import InputError
from rverror.base.progress import Progress
from rverror.diagnosis.gears.waveform import softened
from rverror.diagnosis.loop import diagnose
from rverror.lots.result import Lot
from rverror.model.effects import Model
from rverror.runs.measurement import Run
from rverror.statics.loaded_state import SOFTENING, reducer_of


def diagnose_outsiders(
    model: Model, found: Lot, runs: Mapping[str, Sequence[Run]], *, progress: Progress | None = None
) -> Lot:
    """Diagnose those outsiders of a lot whose runs are given, with the stiffness that the lot tells.

    Sizes have the prior of a workshop, not the lot's: what makes a unit an outsider is not made as in the lot.

    Parameters
    ----------
    model : Model
        That the lot was told with.
    found : Lot
    runs : mapping of str to sequence of Run
        By serial.
    progress : callable, optional
        Called with a line of text.

    Returns
    -------
    Lot
        The same, its outsiders with their `diagnosis`.

    Raises
    ------
    InputError
        If a run does not fit the model, or a serial is not that of an outsider.
    """
    unit, tell = reducer_of(model.mechanism, "a lot"), progress or (lambda text: None)
    serials = [one.serial for one in found.outsiders]
    for serial in runs:
        if serial not in serials:
            raise InputError(
                f"runs: unit {serial!r} is no outsider of the lot; give runs of {', '.join(serials) or 'none'}"
            )
    changes = [-math.log(found.stiffness[name].value) if name in found.stiffness else 0.0 for name in SOFTENING]
    stiff = replace(model, mechanism=softened(unit, np.array(changes)))
    outsiders = []
    for one in found.outsiders:
        if one.serial in runs:
            tell(f"unit {one.serial}: no member, diagnosed by itself")
            one = replace(one, diagnosis=diagnose(stiff, list(runs[one.serial]), progress=progress))
        outsiders.append(one)
    return replace(found, outsiders=tuple(outsiders))
