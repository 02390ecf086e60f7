"""What the gears do and what the bench reads: the one place that tells them apart.

A source acts at the contacts of the gear train, beyond them on the output, on its reading alone, or on the gear's marks
(`Source.acts`).  The gear train stands at the bench's angle and the offset of its marks; whatever acts beyond the
contacts keeps to the bench's zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rverror.base.arrays import Array
from rverror.geartrain.action_line import ErrorVector
from rverror.geartrain.contacts import motion
from rverror.geartrain.kinematics import Pose
from rverror.model.catalogue import source
from rverror.model.effects import Effect, Model


@dataclass(frozen=True)
class Stand:
    """One motion as the bench reads it, and where the gear train stands meanwhile: the same where no marks are off."""

    read: Pose
    gears: Pose

    def of(self, key: str) -> Pose:
        """The motion that a source follows."""
        return self.read if source(key).at_output else self.gears


def stand(model: Model, read: Pose) -> Stand:
    """Where the gear train of a model stands as the bench reads a motion.

    Parameters
    ----------
    model : Model
    read : Pose
        Of its mechanism.

    Returns
    -------
    Stand
    """
    ahead = model.index_offset
    return Stand(read, motion(model.mechanism, read.at(read.theta + ahead)) if ahead else read)


def felt(effects: Sequence[Effect]) -> tuple[Effect, ...]:
    """Effects that the contacts of the gear train feel."""
    return tuple(e for e in effects if not source(e.key).at_output)


def beyond(effects: Sequence[Effect]) -> tuple[Effect, ...]:
    """Effects that turn the output, or its reading, and no contact feels."""
    return tuple(e for e in effects if source(e.key).acts in ("output", "reading"))


def unread(model: Model) -> Model:
    """The model as its output really turns: without what only misreads it."""
    return replace(model, effects=tuple(e for e in model.effects if source(e.key).acts != "reading"))


def misread(model: Model) -> tuple[Effect, ...]:
    """The rest of `unread`: what the measuring chain adds to the motion."""
    return tuple(e for e in model.effects if source(e.key).acts == "reading")


def added(effects: Sequence[Effect], read: Pose) -> Array:
    """What effects beyond the contacts add to the output, rad, shape (n,); of whole rows: some grow along them."""
    total = np.zeros(read.theta.size)
    for effect in beyond(effects):
        error = source(effect.key).vector(read, **effect.indices)
        assert isinstance(error, ErrorVector)
        total += np.array(effect.values) @ error.vector[:, 0]
    return total
