"""The named cause and one that explains the runs as well: how far their waveforms differ, and over what."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rverror.base.arrays import Array
from rverror.diagnosis.causes import Named
from rverror.geartrain.action_line import ContactForces
from rverror.geartrain.contacts import closed_form_forces, pose
from rverror.geartrain.kinematics import Pose, true_period
from rverror.geartrain.mechanism import Mechanism
from rverror.geartrain.source import Source
from rverror.model.catalogue import source
from rverror.model.compose import source_matrix
from rverror.model.effects import Effect

_LONGEST_PERIOD = 12  # output turns over which waveforms are compared
_SAME = 0.05  # share, rms, of a waveform below which another is the same: of an error ten times the noise, half of it
_GRID = 2048  # angles a turn for the comparison; orders above half of it fold alike for all

States = Mapping[float, tuple[Pose, ContactForces]]


@dataclass(frozen=True, kw_only=True)
class Coverage:
    """What the runs at hand cover.

    Attributes
    ----------
    directions : frozenset of float
        +1 forward, -1 reverse.
    samples_per_turn : float
        Per output turn, of the coarsest run; infinite where it is not known.
    torques : frozenset of float
        Sizes of the output torque that are known, N*mm.
    marks : bool
        Whether the bench's zero lies on the gear's marks.
    shared_zero : bool
        Whether runs in both directions share one zero.
    travel : (float, float), optional
        Lowest and highest nominal output angle of the longest run where it covers a part of a turn only, rad.
    """

    directions: frozenset[float]
    samples_per_turn: float
    torques: frozenset[float] = frozenset()
    marks: bool = True
    shared_zero: bool = False
    travel: tuple[float, float] | None = None


@dataclass(frozen=True)
class Pair:
    """The named cause and one that explains the runs as well.

    Waveforms are compared at constant speed, at which a delay between the encoders has none: it is left out.

    Attributes
    ----------
    effect : Effect
        The named cause with its size.
    other : tuple of str and mapping
    coverage : Coverage
    seen, whole_turns : mapping of float to (Pose, mapping)
        Motion and closed-form forces in each direction, from `closed_form_states`: over what the runs cover, and over
        whole turns.
    """

    effect: Effect
    other: Named
    coverage: Coverage
    seen: States
    whole_turns: States

    @cached_property
    def entries(self) -> tuple[Source, Source]:
        """Catalogue entries of both."""
        return source(self.effect.key), source(self.other[0])

    @cached_property
    def now(self) -> float:
        """Share of the named cause's waveform that the other cannot make, in the directions that were run."""
        return self._left(self.seen, self.coverage.directions, together=self.coverage.shared_zero)

    @cached_property
    def whole(self) -> float:
        """The same over whole turns."""
        return self._left(self.whole_turns, self.coverage.directions, together=self.coverage.shared_zero)

    @cached_property
    def both(self) -> float:
        """What the other cannot make in both directions over these angles, each with an offset of its own."""
        return self._left(self.seen, frozenset({1.0, -1.0}), together=False)

    def differs(self, share: float, than: float = 0.0) -> bool:
        """Tell whether a share of the waveform that differs exceeds another by more than what counts as the same."""
        return share > than + _SAME

    def one_of(self, test: Callable[[Source], bool]) -> bool:
        """Tell whether exactly one of the two passes a test."""
        return test(self.entries[0]) != test(self.entries[1])

    def either(self, test: Callable[[Source], bool]) -> bool:
        """Tell whether one of the two or both pass a test."""
        return any(test(entry) for entry in self.entries)

    def both_are(self, test: Callable[[Source], bool]) -> bool:
        """Tell whether both pass a test."""
        return all(test(entry) for entry in self.entries)

    def _left(self, over: States, directions: frozenset[float], *, together: bool) -> float:
        if self.either(is_delay):
            return 0.0
        states = [over[way] for way in sorted(directions)]
        wave = np.array(self.effect.values) @ _waveforms(states, (self.effect.key, self.effect.indices), together)
        span = _waveforms(states, self.other, together)
        size, scale = float(np.linalg.norm(wave)), np.linalg.norm(span, axis=1)
        if size <= 1e-9 * float(np.abs(self.effect.values) @ np.ones(len(self.effect.values))) * math.sqrt(wave.size):
            return 0.0  # constant in the closed form: nothing to compare
        usable = span[scale > 1e-9 * math.sqrt(wave.size)]
        if not len(usable):
            return 1.0
        basis = np.linalg.svd(usable / np.linalg.norm(usable, axis=1)[:, None], full_matrices=False)
        rows = basis[2][basis[1] > 1e-6]
        return float(np.linalg.norm(wave - (rows @ wave) @ rows) / size)


def closed_form_states(mechanism: Mechanism, travel: tuple[float, float] | None = None) -> States:
    """Motion and contact forces forward and reverse at constant speed.

    Parameters
    ----------
    mechanism : Reducer or Drive
    travel : (float, float), optional
        Lowest and highest output angle, rad; whole periods of the drive where left out, or turns if those are long.

    Returns
    -------
    mapping of float to (Pose, mapping)
        By direction, +1 and -1.
    """
    turns = min(true_period(mechanism), _LONGEST_PERIOD)
    low, high = travel or (0.0, 2 * math.pi * turns)
    theta = np.linspace(low, high, _GRID if travel else turns * _GRID, endpoint=False)
    motions = {way: pose(mechanism, theta, direction=way, time=way * theta, torque="1 N*mm") for way in (1.0, -1.0)}
    return {way: (motion, closed_form_forces(motion)) for way, motion in motions.items()}


def _waveforms(states: Sequence[tuple[Pose, ContactForces]], cause: Named, together: bool) -> Array:
    """Closed-form waveforms of a source, runs side by side, offsets taken off, shape (terms, runs n)."""
    runs = [source_matrix(motion, forces, *cause) for motion, forces in states]
    if not together:
        runs = [run - run.mean(axis=1, keepdims=True) for run in runs]
    rows = np.concatenate(runs, axis=1)
    return np.asarray(rows - rows.mean(axis=1, keepdims=True), dtype=np.float64)


def is_delay(entry: Source) -> bool:
    """Tell whether a source follows the speed."""
    return entry.follows == "speed"
