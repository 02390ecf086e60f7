"""Virtual units solved at the load: the size of each quantity that is limited, and how it goes with the widths.

Every quantity is a turn of the output: the difference between two angles under one torque, or at one angle between
torques of both senses.  A limit is met where the largest of these turns is within what it allows.
Page ``theory/at-the-load.md``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt
import scipy

from rverror.base.arrays import Array, Integers
from rverror.base.threads import each
from rverror.base.units import InCore
from rverror.base.viewed import OneLine
from rverror.geartrain.action_line import Clearance, Compliance, ErrorVector
from rverror.geartrain.contacts import pose
from rverror.geartrain.mechanism import Reducer
from rverror.geartrain.source import IndexValue
from rverror.geartrain.torque_over_turn import TorqueLaw
from rverror.model.catalogue import source
from rverror.model.effects import Effect, Model
from rverror.model.readings import added, stand, unread
from rverror.statics.energy import by_contact, solve
from rverror.statics.loaded_state import NotConvergedError, Settled, Statics, check_found, statics_along
from rverror.tolerances.specification import Limit
from rverror.tolerances.stacking import Stack

if TYPE_CHECKING:  # numba takes a while to import
    from rverror.statics.kernel import Problem, Solution

_Poses = Sequence[list[Array] | None]  # by limit

#: Angles of a turn between which the highest and lowest output is sought.
FINE = 4096
#: Angles of a turn at which lost motion, backlash and stiffness are solved.
POSITIONS = 48

#: Of a problem, what differs from angle to angle, or may.
_BY_ANGLE = (
    "pin_rows", "profile_lever", "curvature", "rows", "pin_error", "slide_error", "row_error", "pin_stiffness",
    "row_stiffness", "load", "sense", "tolerance", "heavy",
)  # fmt: skip
_STEP = 16  # of these angles is solved first
#: About so many of the highest and of the lowest places so far the step is halved.  Of 64 states of the list of source
#: 004 that misses 1.3 % of the peak-to-peak at the most and 0.2 % in the mean, with an eighth of the angles.
_HALVED = (32, 24, 12, 6)
#: Share of a limit below which the first angles decide: of the same states they miss 19 % at the most.
CLEAR = 0.75
_KEPT = 3  # highest and lowest places of a unit whose slopes are told: other widths may make another one the highest


# --- what the errors of a unit close ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Instance:
    """Where the drawn components of one instance of a source stand among its parameters."""

    key: str
    indices: Mapping[str, IndexValue]
    at: tuple[tuple[int, int], ...]  #: parameter, component

    @property
    def unit(self) -> Effect:
        """Effect of no size."""
        return Effect(self.key, self.indices, (0.0,) * len(source(self.key).parameters))

    def effect(self, values: Array) -> Effect:
        """Effect of the components' values, shape (components,)."""
        own = list(self.unit.values)
        for parameter, component in self.at:
            own[parameter] = float(values[component])
        return replace(self.unit, values=tuple(own))


def instances_of(stack: Stack) -> tuple[Instance, ...]:
    """Where each component of a stack stands, an instance of an entry at a time."""
    found: dict[tuple[Any, ...], Instance] = {}
    for number, (component, entry) in enumerate(zip(stack.components, stack.entry, strict=True)):
        names = [parameter.name for parameter in source(component.key).parameters]
        name = (int(entry), *sorted(component.indices.items()))
        one = found.get(name, Instance(component.key, dict(component.indices), ()))
        found[name] = replace(one, at=(*one.at, (names.index(component.parameter), number)))
    return tuple(found.values())


@dataclass(frozen=True)
class _Closings:
    """How far each component closes every contact: rows of a sparse matrix, those of one angle together."""

    width: int  # contacts of an angle: pins, their ways along the profiles where these count, flanks and bearings
    matrix: Any  # sparse, shape (angles * width, components); mm per core unit

    def closed(self, values: Array, places: Integers) -> Array:
        """What the components' values close at some angles, mm, shape (places, width)."""
        every = places.size * self.width == self.matrix.shape[0]
        rows = self.matrix if every else self.matrix[self._rows(places)]  # to pick all of them takes thrice the product
        return np.asarray((rows @ values).reshape(-1, self.width), dtype=np.float64)

    def work(self, forces: Array, places: Integers) -> Array:
        """Work of forces on all contacts at some angles by one unit of each component, shape (places, components)."""
        own = np.arange(0, forces.size + 1, self.width, dtype=np.int32)  # of each angle its own contacts
        shape = places.size, self.matrix.shape[0]
        forced = scipy.sparse.csr_array((forces.ravel(), self._rows(places), own), shape=shape)
        return np.asarray((forced @ self.matrix).toarray(), dtype=np.float64)

    def _rows(self, places: Integers) -> npt.NDArray[np.int32]:
        return np.asarray((places[:, None] * self.width + np.arange(self.width)).ravel(), dtype=np.int32)


@dataclass(frozen=True)
class LoadedTurn:
    """Even angles of a turn in one direction under one torque, and what the components do there."""

    statics: Statics
    effects: tuple[Effect, ...]  # of the declared model
    closings: _Closings
    yielding: tuple[tuple[Clearance | Compliance, Instance], ...]
    nominal: Array  # (n,), rad: what the declared model adds beyond the contacts
    beyond: Array  # (components, n), rad per core unit: what components add there

    @classmethod
    def of(
        cls,
        model: Model,
        every: Sequence[Instance],
        *,
        angles: int,
        direction: float,
        torque: float | TorqueLaw,
        reads: bool,
    ) -> LoadedTurn:
        """Lay out a turn; `reads` tells whether what only misreads the output counts."""
        theta = 2 * np.pi * np.arange(angles) / angles
        load = torque if callable(torque) else InCore(torque)
        where = stand(model, pose(model.mechanism, theta, direction=direction, torque=load))
        statics, count = statics_along(where.gears), 1 + max((at for one in every for _, at in one.at), default=-1)
        counted = {"contacts", "output", *(("reading",) if reads else ())}
        beyond, yielding = np.zeros((count, angles)), []
        rows, columns, sizes = [np.empty(0, np.intp)], [np.empty(0, np.intp)], [np.empty(0)]
        slides = statics.reducer.contact_law.profile_curvature > 0
        width, number = _numbered(statics.reducer, len(statics.contacts.sparse[1]), angles, slides=slides)
        for one in every:
            acts = source(one.key).acts
            if acts not in counted:
                continue
            if acts != "contacts":
                vector = source(one.key).vector(where.read, **one.indices)
                assert isinstance(vector, ErrorVector)
                for parameter, component in one.at:
                    beyond[component] += vector.vector[parameter, 0]
                continue
            parts = statics.contacts.closings(one.unit)
            if isinstance(parts, (Clearance, Compliance)):
                yielding.append((parts, one))
                continue
            for part in (part for part in parts if slides or not part.slides):
                at = number[part.contact][part.at]
                for parameter, component in one.at:
                    size = np.broadcast_to(part.rows[parameter], at.shape)
                    some = size != 0
                    rows.append(at[some])
                    columns.append(np.full(rows[-1].size, component))
                    sizes.append(size[some])
        place = np.concatenate(rows), np.concatenate(columns)
        matrix = scipy.sparse.csr_array((np.concatenate(sizes), place), shape=(angles * width, count))
        # with indices of 32 bits, which a product reads a quarter sooner
        matrix.indices, matrix.indptr = matrix.indices.astype(np.int32), matrix.indptr.astype(np.int32)
        closings = _Closings(width, matrix)
        nominal = added((model if reads else unread(model)).effects, where.read)
        return cls(statics, model.effects, closings, tuple(yielding), nominal, beyond)

    @cached_property
    def problem(self) -> Problem:
        """Equilibrium of the declared model at all angles."""
        return self.statics.problem(self.effects, response=False)

    @cached_property
    def first(self) -> tuple[Integers, Problem]:
        """The places that are solved first."""
        count = len(self.nominal)
        places = np.arange(0, count, _STEP if count == FINE else 1)
        return places, _some(self.problem, places)

    def state(
        self, values: Array, places: Integers | None = None, *, near: Array | None = None, response: bool = False
    ) -> TurnState:
        """Settled poses of a unit, its components' values in core units; near the poses given, if any.

        With a response it has its `TurnState.influence`.

        Raises
        ------
        NotConvergedError
            If the equilibrium was not found at some angle.
        """
        at, problem = self.first if places is None else (places, _some(self.problem, places))
        closed = self.closings.closed(values, at)
        pins, rows = problem.pin_error, problem.row_error.shape[1]
        count = pins[0].size
        clearance = problem.clearance.copy()
        for part, one in self.yielding:
            if isinstance(part, Clearance):
                clearance[self._bearings(part.contact)] += max(one.effect(values).values[0], 0.0)
        problem = problem._replace(
            pin_error=pins + closed[:, :count].reshape(pins.shape),
            row_error=problem.row_error + closed[:, -rows:],
            clearance=clearance,
        )
        if problem.share:
            slides = closed[:, count : 2 * count].reshape(pins.shape)
            problem = problem._replace(slide_error=problem.slide_error + slides)
        if any(isinstance(part, Compliance) for part, _ in self.yielding):
            problem = self._softened(problem, values, at)
        solution = solve(problem, near=near, response=response or self.statics.idle)
        check_found(solution, self.statics.motion.theta[at], idle=self.statics.idle)
        return TurnState(self, at, problem, solution)

    def _bearings(self, contact: str) -> slice:
        cranks = self.statics.reducer.cranks
        cams = self.statics.reducer.discs * cranks
        return slice(0, cams) if contact == "cam" else slice(cams, cams + cranks)

    def _softened(self, problem: Problem, values: Array, places: Integers) -> Problem:
        """The same with contacts that give way more than nominal."""
        effects = tuple(one.effect(values) for part, one in self.yielding if isinstance(part, Compliance))
        try:
            softer = _some(self.statics.problem((*self.effects, *effects), response=False), places)
        except ValueError as error:
            raise NotConvergedError(str(error)) from error
        return problem._replace(pin_stiffness=softer.pin_stiffness, row_stiffness=softer.row_stiffness)

    def read(self, state: TurnState, values: Array) -> Array:
        """Output as it is read, rad, shape (places,)."""
        return state.output + (self.nominal + values @ self.beyond)[state.places]


def _numbered(reducer: Reducer, rows: int, angles: int, *, slides: bool) -> tuple[int, dict[str, Array]]:
    """Number of contacts of an angle, and the place of each in `_Closings` by the contact that a closing names."""
    pins = reducer.discs * reducer.pins
    width = pins * (2 if slides else 1) + rows
    every: Any = np.arange(angles * width).reshape(angles, width)
    pin = every[:, :pins].reshape(angles, reducer.discs, -1)
    along = every[:, width - rows - pins : width - rows].reshape(angles, reducer.discs, -1)
    return width, {**by_contact(reducer, pin=pin, row=every[:, width - rows :]), "along": along}


# --- one unit ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class TurnState:
    """Settled poses of one unit at some angles."""

    line: LoadedTurn
    places: Integers
    problem: Problem
    solution: Solution

    @property
    def output(self) -> Array:
        """Turn of the output, less what acts beyond the contacts, rad."""
        return (self._settled.unloaded() if self.line.statics.idle else self._settled).transmission_error

    def influence(self) -> Array:
        """Change of the output per core unit of each component, rad, shape (places, components)."""
        line, solution = self.line, self.solution
        k = len(self.places)
        changes = [solution.pin_change.reshape(k, -1), solution.row_change]
        if self.problem.share:
            changes.insert(1, solution.slide_change.reshape(k, -1))
        found = line.closings.work(np.concatenate(changes, axis=1), self.places)
        found += line.beyond[:, self.places].T
        for part, one in line.yielding:
            if isinstance(part, Compliance) and part.share.shape[-1] > 1:
                part = replace(part, share=part.share[..., self.places])
            rows = self._settled.yielding(part)
            for parameter, component in one.at:
                found[:, component] += rows[parameter]
        return found

    @cached_property
    def _settled(self) -> Settled:
        return Settled(self.line.statics.contacts, self.line.statics.reducer, self.problem, self.solution)


def _some(problem: Problem, places: Integers) -> Problem:
    """The same at some of its angles."""
    rows: dict[str, Any] = {name: getattr(problem, name) for name in _BY_ANGLE}
    return problem._replace(**{name: row[places] for name, row in rows.items() if len(row) == len(problem.load)})


# --- units and their sizes --------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Solved(OneLine):
    """Turns of units that limits are about.

    Attributes
    ----------
    turns : ndarray, shape (units, limits)
        rad, as `Limit.turned` takes it; infinite where no equilibrium was found.
    failures : tuple of str
        Units without an equilibrium, and why.
    near : ndarray, shape (units, limits, kept)
        rad; the largest turns at places of a unit that are apart, for widths that are near.
    slopes : ndarray, shape (units, limits, kept, entries)
        Change of each per width of each entry, rad per core unit; of no entry where that was not wanted.
    poses : tuple
        Of each unit and limit, at the angles that are solved first: starts for the same units with other widths.
    """

    turns: Array
    failures: tuple[str, ...]
    near: Array
    slopes: Array
    poses: tuple[_Poses, ...] = ()


class _LargestTurns(NamedTuple):
    """The largest turns of a unit for one limit, at places that are apart."""

    turns: Array  # rad
    changes: Array  # per core unit of each component
    poses: list[Array]  # first ones, under each torque


@dataclass(frozen=True)
class LoadedUnits:
    """Units of a model and its tolerances at the loads of some limits, prepared once.

    Attributes
    ----------
    model : Model
    stack : Stack
        Of the model; how its components are drawn.
    means : ndarray, shape (components,)
        Of the components, core units.
    limits : tuple of Limit
        With their torques.
    directions : tuple of float
        Of each limit +1 forward, -1 reverse: of the transmission error.
    """

    model: Model
    stack: Stack
    means: Array
    limits: tuple[Limit, ...]
    directions: tuple[float, ...]
    _lines: dict[tuple[float | TorqueLaw, float, int], LoadedTurn] = field(default_factory=dict, repr=False, init=False)

    def solved(
        self,
        drawn: Array,
        widths: Array,
        *,
        slopes: bool = False,
        decide: bool = False,
        near: Solved | None = None,
        progress: Callable[[int], None] | None = None,
    ) -> Solved:
        """Solve units at the loads of all limits.

        Parameters
        ----------
        drawn : ndarray, shape (units, components)
            Standard draws.
        widths : ndarray, shape (entries,)
            Core units.
        slopes : bool
            Whether the change with the widths is wanted.
        decide : bool
            Whether it is enough to know which side of its limit a unit is on: the peak-to-peak of one that is far
            within is then too small by some per cent.
        near : Solved, optional
            The first of the same units with other widths, from the poses of which equilibria are found sooner.
        progress : callable, optional
            Called with the number of a unit, from 1, as it is done.

        Returns
        -------
        Solved
        """
        values = self.means + drawn * widths[self.stack.entry]
        before = near.poses if near is not None else ()
        none: _Poses = (None,) * len(self.limits)
        largest = np.full((len(drawn), len(self.limits), _KEPT**2), -np.inf)
        slope = np.zeros((*largest.shape, len(widths) if slopes else 0))
        belongs = self.stack.entry[:, None] == np.arange(len(widths))

        def unit(number: int) -> tuple[_Poses, str]:
            starts, poses = before[number] if number < len(before) else none, []
            try:
                for place, (one, way, first) in enumerate(zip(self.limits, self.directions, starts, strict=True)):
                    if one.loads:
                        found = self._between(one, values[number], slopes=slopes, near=first)
                    else:
                        found = self._span(one, way, values[number], slopes=slopes, decide=decide, near=first)
                    largest[number, place, : found.turns.size] = found.turns
                    if slopes:
                        slope[number, place, : found.turns.size] = (found.changes * drawn[number]) @ belongs
                    poses.append(found.poses)
            except NotConvergedError as problem:
                largest[number] = np.inf
                return none, f"unit {number}: {problem}"
            finally:
                if progress is not None:
                    progress(number + 1)
            return poses, ""

        poses, said = zip(*each(unit, range(len(drawn))), strict=True)
        turns, failures = largest.max(axis=2), tuple(filter(None, said))
        return Solved(turns, failures, largest, slope, poses)

    def _span(
        self, limit: Limit, direction: float, values: Array, *, slopes: bool, decide: bool, near: list[Array] | None
    ) -> _LargestTurns:
        """Turns between the highest and the lowest places of a revolution.

        Solved at few angles first, then beside those that are highest and lowest so far: of a wave of a mesh order few
        angles miss the peaks, of what it rides on they do not.
        """
        assert limit.torque is not None
        line = self.line(limit.torque, direction, FINE, reads=True)
        first = line.state(values, near=None if near is None else near[0])
        places, poses, output = first.places, first.solution.x, line.read(first, values)
        for halving, count in enumerate(_HALVED, 1):
            if decide and np.ptp(output) < CLEAR * limit.allowed:
                break
            order = np.argsort(output)
            about = places[np.concatenate([order[:count], order[-count:]])]
            beside = np.array([-1, 1]) * (_STEP >> halving)
            more = np.setdiff1d((about[:, None] + beside) % FINE, places)
            state = line.state(values, more, near=_middle(places, poses, more))
            places, poses = np.concatenate([places, more]), np.concatenate([poses, state.solution.x])
            output = np.concatenate([output, line.read(state, values)])
        high, low = _apart(output, places), _apart(-output, places)
        if not slopes:
            return _LargestTurns(output[high[:1]] - output[low[:1]], np.empty(0), [])
        kept = np.concatenate([high, low])
        changes = line.state(values, places[kept], near=poses[kept], response=True).influence()
        up, down = changes[: high.size], changes[high.size :]
        turns = (output[high][:, None] - output[low]).reshape(-1)
        return _LargestTurns(turns, (up[:, None] - down).reshape(turns.size, -1), [first.solution.x])

    def _between(self, limit: Limit, values: Array, *, slopes: bool, near: list[Array] | None) -> _LargestTurns:
        """Turns between torques at the angles where they are largest."""
        starts: Sequence[Array | None] = near or [None] * len(limit.loads)
        lines = zip(self.between(limit), starts, strict=True)
        states = [(line.state(values, near=first), weight) for (line, weight), first in lines]
        total = np.sum([weight * state.line.read(state, values) for state, weight in states], axis=0)
        if not slopes:
            return _LargestTurns(total.max(keepdims=True), np.empty(0), [])
        largest = np.argsort(-total)[:_KEPT]
        changes = [
            weight * state.line.state(values, largest, near=state.solution.x[largest], response=True).influence()
            for state, weight in states
        ]
        return _LargestTurns(total[largest], np.sum(changes, axis=0), [state.solution.x for state, _ in states])

    def between(self, limit: Limit) -> list[tuple[LoadedTurn, float]]:
        """Turns under each of a limit's torques with its weight; a torque drives the output against the motion."""
        return [
            (self.line(abs(torque), -math.copysign(1.0, torque), POSITIONS, reads=False), weight)
            for torque, weight in limit.loads
        ]

    def line(self, torque: float | TorqueLaw, direction: float, angles: int, *, reads: bool) -> LoadedTurn:
        """Turn under one torque, prepared once; `reads` tells whether what only misreads the output counts."""
        name = torque, direction, angles
        if name not in self._lines:
            self._lines[name] = LoadedTurn.of(
                self.model, instances_of(self.stack), angles=angles, direction=direction, torque=torque, reads=reads
            )
        return self._lines[name]


def _middle(places: Integers, poses: Array, more: Integers) -> Array:
    """Poses in the middle of those at the places of a turn to either side."""
    order = np.argsort(places)
    above = np.searchsorted(places[order], more)
    return np.asarray((poses[order[above - 1]] + poses[order[above % len(order)]]) / 2)


def _apart(output: Array, places: Integers) -> Integers:
    """The highest of some places of a turn, and the next ones that are a coarse step or more from those before."""
    found: list[int] = []
    for at in np.argsort(-output):
        away = np.abs(places[found] - places[at])
        if not (np.minimum(away, FINE - away) < _STEP).any():
            found.append(int(at))
        if len(found) == _KEPT:
            break
    return np.array(found, dtype=np.intp)
