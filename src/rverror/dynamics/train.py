"""Coordinates, inertias and springs of a gear train that moves about its loaded state.

To the floating parts of the equilibrium come the angles of the sun, of the input side and of the load, as far as the
bench lets them move.  Masses and moments of inertia that are not given are estimated.  `docs/theory/dynamics.md` has
the equations.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from rverror.base.arrays import Array
from rverror.base.errors import InputError, refusing
from rverror.geartrain.kinematics import frame_orders
from rverror.geartrain.mechanism import OUTPUTS, Inertia, Reducer, core_torque
from rverror.model.effects import Model
from rverror.model.ends import Bench
from rverror.statics.energy import Layout
from rverror.statics.loaded_state import Settled

DENSITY = 7.85e-9  # of steel, tonne/mm^3
#: Sizes that a reducer's parameters do not tell, as shares of its pin circle's radius.
_DISC_WIDTH = 0.15
_PLATE_WIDTH = 0.25  # of each of the carrier's two
_GEAR_WIDTH = 8.0  # of a planet, in modules
_SHAFT_OF_BORE = 0.7  # radius of a crankshaft
_BORE_OF_RIM = 0.8  # at most, of what a disc has between crank circle and rim
_HOLE_OVER_SUN = 2.0  # of a disc, in modules


def whole_inertia(reducer: Reducer) -> Inertia:
    """Mass and moment of inertia of every part: as given, or estimated.

    Parameters
    ----------
    reducer : Reducer

    Returns
    -------
    Inertia
        Without a value that is left out.

    Notes
    -----
    Steel plates and cylinders whose sizes follow from the pin circle, the crank circle and the gears; the table on the
    page of the dynamics has them.  True to some 30 %.

    Examples
    --------
    >>> from rverror.geartrain.mechanism import reducer
    >>> whole = whole_inertia(reducer("RV-40E"))
    >>> 0.5e-3 < whole.disc_mass < 1.2e-3  # a disc of a reducer of this size has a kilogram or less
    True
    """
    width = _DISC_WIDTH * reducer.pin_circle_radius
    plate = reducer.pin_circle_radius - reducer.pin_radius
    # neither bores nor the hole meet one another or the rim, so that some disc is left in any geometry
    apart = reducer.crank_radius / 2 * math.sin(math.pi / max(reducer.cranks, 3))
    bore = min(apart, _BORE_OF_RIM * (plate - reducer.crank_radius))
    over_sun = min(reducer.sun_pitch_radius + _HOLE_OVER_SUN * reducer.module, reducer.crank_radius - bore)
    bored = reducer.cranks * _cylinder(bore, width, off=reducer.crank_radius)
    shaft = _cylinder(_SHAFT_OF_BORE * bore, (reducer.discs + 2) * width)
    parts = {
        "carrier": _cylinder(plate - 2 * reducer.eccentricity, 2 * _PLATE_WIDTH * reducer.pin_circle_radius),
        "disc": _cylinder(plate, width) - _cylinder(over_sun, width) - bored,
        "crank": shaft + _cylinder(reducer.planet_pitch_radius, _GEAR_WIDTH * reducer.module),
        "sun": _cylinder(reducer.sun_pitch_radius, reducer.pin_circle_radius),
    }
    estimated = {f"{part}_{of}": own[at] for part, own in parts.items() for at, of in enumerate(("mass", "inertia"))}
    return Inertia(**estimated | reducer.inertia.given())


def _cylinder(radius: float, length: float, *, off: float = 0.0) -> Array:
    """Mass, and moment of inertia about an axis so far off its own."""
    mass = DENSITY * math.pi * radius**2 * length
    return np.array([mass, mass * radius**2 / 2 + mass * off**2])


#: Of the largest eigenvalue: a mode below it has no frequency.  Rounding leaves some 1e-16 of it for a free motion;
#: one of a hundredth of a Hz beside 16 kHz has 4e-13.
FREE = 1e-14
#: Share of the strain energy above which a mode is one of the sun's support.
SUPPORTED = 0.5


def natural_motions(stiffness: Array, mass: Array) -> tuple[Array, Array]:
    """Squares of the natural frequencies, rising, 0 of free motions; and motions of mass 1 as columns.

    Parameters
    ----------
    stiffness : ndarray, shape (size, size)
    mass : ndarray, shape (size,)
        Diagonal of the mass matrix.

    Returns
    -------
    ndarray, shape (size,)
    ndarray, shape (size, size)
    """
    root = np.sqrt(mass)
    value, vector = np.linalg.eigh(stiffness / np.outer(root, root))
    return np.where(value < FREE * value[-1], 0.0, value), vector / root[:, None]


def loaded_reducer(model: Model, torque: Any | None) -> tuple[Reducer, float]:
    """Reducer of a model and size of its torque, N*mm: the rated one where none is given.

    Raises
    ------
    InputError
        If the model is no reducer, or there is no torque.
    """
    unit = model.mechanism
    if not isinstance(unit, Reducer):
        raise InputError("dynamics need a [reducer] model; a [drive] has no parts that could move")
    if unit.output != OUTPUTS[0]:
        raise InputError(
            f"output = {unit.output!r}: dynamics know the {OUTPUTS[0]} as output only, the housing has no inertia "
            f"there; take output = {OUTPUTS[0]!r} for the modes of the gear train alone"
        )
    if torque is None:
        torque = unit.rated_torque
    if torque is None:
        raise InputError(f"torque: reducer {unit.name!r} has no rated_torque; give one of them, e.g. torque='20 N*m'")
    with refusing(""):
        size = core_torque(unit, torque)
    if size < 0:
        raise InputError(f"torque = {size / 1e3:g} N*m: must be 0 or more; the direction comes from the motion")
    return unit, size


@dataclass(frozen=True)
class Train:
    """What moves of a reducer on its bench.

    Attributes
    ----------
    reducer : Reducer
    bench : Bench
    """

    reducer: Reducer
    bench: Bench

    @cached_property
    def parts(self) -> Mapping[str, tuple[int, ...]]:
        """Coordinates of every part: x, y, angle; x, y; or an angle alone."""
        layout, size = Layout(self.reducer), Layout(self.reducer).size
        motor = self.bench.position_control_stiffness, self.bench.input_coupling_stiffness
        found: dict[str, tuple[int, ...]] = {"carrier": (0, 1, 2)}
        for kind, places in (("disc", layout.disc), ("crank", layout.crank)):
            found |= {f"{kind} {number}": (at, at + 1, at + 2) for number, at in enumerate(places)}
        found["sun"] = (layout.sun, layout.sun + 1)
        if motor != (None, None):
            found["sun"] += (size,)
            size += 1
        if None not in motor:
            found["input"] = (size,)
            size += 1
        if self.bench.load_coupling_stiffness is not None:
            found["load"] = (size,)
        return found

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return 1 + max(max(at) for at in self.parts.values())

    def place(self, part: str) -> tuple[int, ...]:
        """Coordinates of a part; none where it does not move."""
        return self.parts.get(part, ())

    @property
    def sun_angle(self) -> tuple[int, ...]:
        """Coordinate of the sun's angle; none where the input holds it at its nominal one."""
        return self.place("sun")[2:]

    @cached_property
    def inertias(self) -> Mapping[str, Array]:
        """Diagonal of the mass matrix by what it comes from, each of shape (size,)."""
        found: dict[str, Array] = {}

        def put(name: str, value: float, at: tuple[int, ...]) -> None:
            if value:
                found.setdefault(name, np.zeros(self.size))[list(at)] += value

        values = whole_inertia(self.reducer).given() | self.bench.given()  # a bench that has none of them gives none
        for name, at in self.parts.items():
            kind = name.split()[0]
            if len(at) > 1:
                put(f"{kind}_mass", values[f"{kind}_mass"], at[:2])
            put(f"{kind}_inertia", values.get(f"{kind}_inertia", 0.0), at[-1:] if len(at) != 2 else ())
        # what is rigidly coupled turns with its neighbour
        if self.sun_angle and self.bench.input_coupling_stiffness is None:
            put("input_inertia", self.bench.input_inertia, self.sun_angle)
        if self.bench.load_coupling_stiffness is None:
            put("load_inertia", self.bench.load_inertia, self.place("carrier")[2:])
        return found

    @cached_property
    def mass(self) -> Array:
        """Diagonal of the mass matrix, tonne and tonne*mm^2."""
        return np.asarray(np.sum(list(self.inertias.values()), axis=0))

    @cached_property
    def springs(self) -> Mapping[str, Array]:
        """Stiffness matrices, (1, size, size), of the bench's torsional springs by their names in its table."""
        sun, motor, found = self.sun_angle, self.place("input"), {}
        for name, held, against in (
            ("position_control_stiffness", motor or sun, ()),
            ("input_coupling_stiffness", sun, motor),
            ("load_coupling_stiffness", self.place("carrier")[2:], self.place("load")),
        ):
            if (stiffness := getattr(self.bench, name)) is not None:
                twist = np.zeros(self.size)
                twist[list(held)], twist[list(against)] = 1.0, -1.0
                found[name] = stiffness * np.outer(twist, twist)[None]
        return found

    @cached_property
    def reading(self) -> Array:
        """How the output error follows the coordinates: the carrier's angle less the sun's over the ratio."""
        made = np.zeros(self.size)
        made[2] = 1.0
        made[list(self.sun_angle)] = -1 / self.reducer.ratio
        return made

    @cached_property
    def turns(self) -> Array:
        """Turns per output turn of the frame in which each coordinate is written; 0 for angles."""
        turns = frame_orders(self.reducer)
        made = np.zeros(self.size)
        for name, at in self.parts.items():
            if len(at) > 1:
                # the discs' frames stand with their eccentric directions
                made[list(at[:2])] = turns["crank" if name.startswith("disc") else "carrier"]
        return made

    @cached_property
    def quarter_turn(self) -> Array:
        """Matrix that turns each pair of x and y a quarter ahead, to (-y, x); 0 for angles."""
        made = np.zeros((self.size, self.size))
        for at in self.parts.values():
            if len(at) > 1:
                x, y = at[:2]
                made[x, y], made[y, x] = -1.0, 1.0
        return made

    def pose(self, x: Array) -> Array:
        """Pose of the floating parts, (n, unknowns), in these coordinates: the input at its nominal angle.

        A load turns with the carrier: an even torque twists its coupling by an even angle.
        """
        made = self._widened(x)
        made[:, list(self.place("load"))] = x[:, 2:3]
        return made

    def _widened(self, rows: Array) -> Array:
        """Rows over the floating parts, (..., unknowns), over these coordinates: 0 at those that are added."""
        return np.pad(rows, [(0, 0)] * (rows.ndim - 1) + [(0, self.size - rows.shape[-1])])

    def stiffness(self, state: Settled) -> dict[str, Array]:
        """Stiffness matrix of each group of contacts and springs, (n or 1, size, size), in the housing frame.

        Groups have the names of `Stiffness` and of the springs of `Bench`.
        """
        where, reducer, floating = state.contacts, self.reducer, Layout(self.reducer)
        n, cams = len(state.x), reducer.discs * reducer.cranks
        pins = np.zeros((n, self.size, self.size))
        blocks = (state.solution.pin_tangent[:, :, None] * where.pin_rows) @ np.swapaxes(where.pin_rows, 2, 3)
        for k, at in enumerate(floating.disc):
            pins[:, at : at + 3, at : at + 3] = blocks[:, k]
        flanks = self.flank_rows(state)
        joint, (_, own) = state.joint, state.split(where.whole_rows)
        joints = self._widened(own)

        def bearing(at: slice) -> Array:
            rows = joints[:, at]
            pressed = (joint[:, at] @ rows).reshape(n, -1, self.size)
            return np.swapaxes(rows.reshape(n, -1, self.size), 1, 2) @ pressed

        return {
            "pin_contact": pins,
            "crank_bearing": bearing(slice(0, cams)),
            "carrier_bearing": bearing(slice(cams, cams + reducer.cranks)),
            "gear_mesh": np.swapaxes(flanks, 1, 2) @ (state.flank[..., None] * flanks),
            "sun_support": bearing(slice(cams + reducer.cranks + 1, None)),
            "main_bearing": bearing(slice(cams + reducer.cranks, cams + reducer.cranks + 1)),
            **self.springs,
        }

    def damping(self, groups: Mapping[str, Array]) -> Array:
        """Damping matrix by contact, of the stiffness of each group: c = beta k."""
        times = self.bench.damping_times
        return np.asarray(sum(times[name.removesuffix("_stiffness")] * matrix for name, matrix in groups.items()))

    def flank_rows(self, state: Settled) -> Array:
        """How each flank closes with the coordinates, (n, 2 cranks, size): also with the sun's angle."""
        rows, _ = state.split(state.contacts.whole_rows)
        made = self._widened(rows)
        # the flank that drives forwards closes as the sun turns counter-clockwise
        lever = self.reducer.sun_pitch_radius * math.cos(self.reducer.pressure_angle)
        for at in self.sun_angle:
            made[..., at] = lever * np.tile([1.0, -1.0], self.reducer.cranks)
        return made
