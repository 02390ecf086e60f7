"""What an error source is: one entry says where it acts, in which frame it is fixed, and what its sizes are called.

A sub-assembly's file holds its sources whole: the functions that return their error vectors, and at its end `SOURCES`,
one `Source` for each.  The catalogue only joins them.
"""

from __future__ import annotations

import math
import numbers
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from itertools import product
from typing import Protocol

import numpy as np

from rverror.base.arrays import Array
from rverror.base.units import ARCSEC, CORE_UNITS, DISPLAY_UNITS, to_display
from rverror.geartrain.action_line import SourceVector
from rverror.geartrain.kinematics import fundamental_orders
from rverror.geartrain.mechanism import Drive, Mechanism, Reducer

IndexValue = int | str
Indices = Mapping[str, IndexValue]
Orders = Callable[[Mechanism, Indices], tuple[float, ...]]

_ACTS = frozenset({"contacts", "output", "reading", "marks"})
_FOLLOWS = frozenset({"angle", "time", "speed"})
_OF_RUNS = frozenset({"time", "torque"})  # that a source may need
#: Names of two parameters that are one vector, or one wave: it turns with the part.
VECTORS = ("x", "y"), ("cos", "sin"), ("radial_cos", "radial_sin"), ("tangential_cos", "tangential_sin")
#: Frames whose errors meet their contacts again after one turn of the crank against the carrier.
_CARRIER_SIDE = frozenset({"carrier", "disc", "crank", "planet", "bearing", "direction"})


class Known(Protocol):
    """What is known of a run beside its angles: a `Run`, or the `OperatingConditions` that come of it."""

    @property
    def time(self) -> Array | None:
        """Time of each sample, s."""

    @property
    def torque(self) -> object:
        """Size of the output torque, N*mm, or what it is over the angle."""


@dataclass(frozen=True)
class Index:
    """An index of a source.

    Attributes
    ----------
    name : str
    allowed, tried : callable
        Which values a mechanism allows, and which of them diagnosis tries.
    equivalents : callable
        ``equivalents(mechanism, value) -> sequence of (value, sign)``: where the same error, or the opposite one, does
        what only the contacts tell from it here.
    anywhere : sequence, optional
        Values that every mechanism allows, where the mechanism does not matter.
    """

    name: str
    allowed: Callable[[Mechanism], Sequence[IndexValue]]
    tried: Callable[[Mechanism], Sequence[IndexValue]]
    equivalents: Callable[[Mechanism, IndexValue], Sequence[tuple[IndexValue, float]]] = lambda mechanism, value: ()
    anywhere: Sequence[IndexValue] | None = None

    def beyond(self, value: object) -> str:
        """What is wrong with a value whatever the mechanism; empty where one may allow it."""
        number = isinstance(value, numbers.Integral) and not isinstance(value, bool)
        if self.anywhere is not None:
            return "" if number and value in self.anywhere else f"it must be one of {_span(self.anywhere)}"
        if isinstance(value, str) or (number and value >= 0):  # type: ignore[operator]
            return ""
        return "it must be a whole number, counted from 0"


#: Times `Parameter.plausible`, from which on a plain number was meant in another unit.  Of lengths that is 0.3 mm and
#: more; grade IT11 of ISO 286-1 has 0.22 mm on a part of 120 mm.  Numbers in um are a thousand times off.
BEYOND_WORKSHOPS = 10.0


@dataclass(frozen=True)
class Parameter:
    """A parameter of a source: name, dimension (a key of `units.CORE_UNITS`) and the size that a workshop can make.

    `plausible` is the largest size that no one would be surprised at, `least` the smallest that exists, core units.
    """

    name: str
    dimension: str
    plausible: float
    least: float = -math.inf

    def doubt(self, what: str, given: object, size: float) -> None:
        """Warn of a plain number that no workshop makes: it was meant in another unit.

        Parameters
        ----------
        what : str
            Name of the size, for the warning.
        given : object
            As it was typed; what has a unit is believed.
        size : float
            The same in the core unit.

        Warns
        -----
        UserWarning
            If a plain length or angle is beyond `BEYOND_WORKSHOPS` times `plausible`.
        """
        times = abs(size) / self.plausible
        if isinstance(given, (int, float)) and self.dimension in ("length", "angle") and times > BEYOND_WORKSHOPS:
            core, shown = CORE_UNITS[self.dimension], DISPLAY_UNITS[self.dimension]
            warnings.warn(
                f"{what} = {given:g} is taken as {given:g} {core}, {times:.0f} times what a workshop makes "
                f"({to_display(self.plausible, self.dimension):g} {shown}); write '{given:g} {shown}', or "
                f"'{given:g} {core}' where that is meant",
                stacklevel=3,
            )


@dataclass(frozen=True)
class Source:
    """One error source.

    Attributes
    ----------
    key : str
        Fixed name, module and function.
    vector : callable
        ``vector(pose, **indices) -> ErrorVector``, one term per parameter; several in a tuple where it
        sits at several contacts; a `Clearance` for bearings.
    indices, parameters : tuple
        What names one error, and its components.
    frame : str
        Where the error is fixed: housing, carrier, disc, crank, planet, sun, output; ``direction`` where only the
        direction of motion changes it, ``bearing`` where the load does.
    orders : callable
        ``orders(mechanism, indices) -> tuple of float``: the orders that lead its waveform in the closed form, the
        strongest first; empty where the output shift is constant or nothing at all.
    reference : str
        Source text and equation or section.
    summary : str
        One line for people.
    equation : str
        Its error vector, LaTeX between dollar signs; symbols as on the catalogue page.
    hidden : str
        Why it leaves no wave in a record, where it does not.
    acts : str
        ``"contacts"`` of the gear train; ``"output"``, which it moves or misreads beyond the gear train, whose
        contacts do not feel it; ``"marks"``, whose angle it shifts, so that the waveform of all contacts turns.
    in_reducers, in_drives : bool
        In which kinds of mechanism it can act.
    needs : tuple of str
        What must be known for its waveform beside the angles: ``"time"`` or ``"torque"`` of the run, or the name of a
        reducer's parameter that may be left out.
    follows : str
        ``"angle"`` of the output; ``"time"`` or ``"speed"`` for what a clock adds.
    periodic : bool
        Whether the waveform repeats with the drive; what grows along a run does not.
    alike_at_pins : callable
        ``alike_at_pins(indices) -> bool``: whether it is the same at all pins, so that it repeats pin by pin.
    tried : bool
        Whether diagnosis tries it: not where all that it does within a run is constant, or is done by other sources.
    starts : tuple of tuple of float
        Sizes, as shares of what is plausible, from which a fit is begun as well: where contacts that open and close can
        make it look like an error of the opposite sign, or are all that shows it, no linear step tells its size.
    in_lots : bool
        Whether its size varies from part to part by itself; not what stands for many parts that have sizes of their
        own, or for how a whole batch was ground.
    in_tables : bool, optional
        Whether diagnosis tries it in order tables; where left out, as in runs.  A free line of a run says as much as
        some do, and the orders of a table do not show what a damaged lobe does.

    Raises
    ------
    ValueError
        If `acts`, `follows` or `needs` is none of its words.
    """

    key: str
    vector: Callable[..., SourceVector]
    indices: tuple[Index, ...]
    parameters: tuple[Parameter, ...]
    frame: str
    orders: Orders
    reference: str
    summary: str
    equation: str = ""
    hidden: str = ""
    acts: str = "contacts"
    in_reducers: bool = True
    in_drives: bool = False
    needs: tuple[str, ...] = ()
    follows: str = "angle"
    periodic: bool = True
    alike_at_pins: Callable[[Indices], bool] = lambda indices: False
    tried: bool = True
    starts: tuple[tuple[float, ...], ...] = ()
    in_lots: bool = True
    in_tables: bool | None = None

    def __post_init__(self) -> None:
        """Check the words among the fields: a misspelt one would silently mean something else."""
        geometry = {field.name for field in fields(Reducer)}
        for name, words, known, more in (
            ("acts", (self.acts,), _ACTS, set()),
            ("follows", (self.follows,), _FOLLOWS, set()),
            ("needs", self.needs, _OF_RUNS, geometry),
        ):
            if wrong := [word for word in words if word not in known | more]:
                other = " or a parameter of a reducer" if more else ""
                choices = ", ".join(sorted(known))
                raise ValueError(f"{self.key}: {name} = {wrong[0]!r}; it must be one of {choices}{other}")

    @property
    def is_cause(self) -> bool:
        """Whether diagnosis names it as a cause, in runs or in tables."""
        return self.tried or bool(self.in_tables)

    def check_indices(self, mechanism: Mechanism, indices: Indices) -> None:
        """Check that the indices are those of the source and within the mechanism.

        Raises
        ------
        ValueError
            Naming the index, its value and what is allowed.
        """
        self.check_mechanism(mechanism)
        names = [index.name for index in self.indices]
        for name in indices:
            if name not in names:
                known = f"its indices are {', '.join(names)}" if names else "it has no index"
                raise ValueError(f"{self.key}: no index {name!r}; {known}")
        for index in self.indices:
            allowed = index.allowed(mechanism)
            if index.name not in indices:
                raise ValueError(f"{self.key}: index {index.name!r} is missing; give one of {_span(allowed)}")
            value = indices[index.name]
            if not isinstance(value, (numbers.Integral, str)) or isinstance(value, bool) or value not in allowed:
                counted = ", counted from 0" if 0 in allowed else ""
                raise ValueError(f"{self.key}: {index.name} = {value!r}; it must be one of {_span(allowed)}{counted}")

    @property
    def at_output(self) -> bool:
        """Whether the contacts of the gear train do not feel it."""
        return self.acts != "contacts"

    def applies_to(self, mechanism: Mechanism) -> bool:
        """Tell whether the source can act in this kind of mechanism."""
        return self.in_drives if isinstance(mechanism, Drive) else self.in_reducers

    def check_mechanism(self, mechanism: Mechanism) -> None:
        """Check that the source can act in this kind of mechanism.

        Raises
        ------
        ValueError
            Naming the sources that can.
        """
        if not self.applies_to(mechanism):
            drive = isinstance(mechanism, Drive)
            where = "[drive] model; sensor.* and shaft.* do" if drive else "[reducer] model; all but shaft.* do"
            raise ValueError(f"{self.key} does not act in a {where}")

    def lacks(self, mechanism: Mechanism, run: Known) -> str:
        """Name the first of its `needs` that neither the mechanism nor a run gives; empty where it has all."""
        for name in self.needs:
            value = getattr(run if hasattr(run, name) else mechanism, name)
            if name == "torque" and value is None:
                value = getattr(run, "load", None)
            if value is None or (name == "torque" and not np.any(value)):  # no torque, no windup
                return name
        return ""

    def repeats_with_crank(self, mechanism: Mechanism, indices: Indices) -> bool:
        """Tell whether its effect on the gear train repeats with every turn of the crank against the carrier.

        True for what turns with the carrier, the cranks or nothing, and for what is alike at all pins, because the
        carrier moves on by one pin meanwhile.  The sun turns z2/z1 times, so it depends.
        """
        if self.at_output or self.frame in _CARRIER_SIDE or self.alike_at_pins(indices):
            return True
        whole = isinstance(mechanism, Reducer) and mechanism.planet_teeth % mechanism.sun_teeth == 0
        return self.frame == "sun" and whole

    def candidates(self, mechanism: Mechanism) -> Iterable[dict[str, IndexValue]]:
        """Index sets that diagnosis tries, in order."""
        names = [index.name for index in self.indices]
        for values in product(*(index.tried(mechanism) for index in self.indices)):
            yield dict(zip(names, values, strict=True))


def _span(values: Sequence[IndexValue]) -> str:
    numbers = [v for v in values if isinstance(v, int)]
    words = [repr(v) for v in values if isinstance(v, str)]
    if len(numbers) > 4 and numbers == list(range(numbers[0], numbers[-1] + 1)):
        words = [f"{numbers[0]} to {numbers[-1]}", *words]
    else:
        words = [*map(str, numbers), *words]
    return ", ".join(words) or "none: the mechanism has none"


def rv(mechanism: Mechanism) -> Reducer:
    """The mechanism, which is a reducer wherever a source of the gear train acts."""
    assert isinstance(mechanism, Reducer)
    return mechanism


def every(
    name: str,
    values: Callable[[Reducer], Sequence[IndexValue]],
    equivalents: Callable[[Mechanism, IndexValue], Sequence[tuple[IndexValue, float]]] = lambda mechanism, value: (),
) -> Index:
    """Index of a reducer's source of which diagnosis tries every value."""

    def of(mechanism: Mechanism) -> Sequence[IndexValue]:
        return values(rv(mechanism))

    return Index(name, of, of, equivalents)


def or_all(index: Index) -> Index:
    """An index of which ``"all"`` is allowed beside every value, and diagnosis tries the values alone."""
    return Index(index.name, lambda mechanism: [*index.allowed(mechanism), "all"], index.tried)


def chosen(value: IndexValue) -> slice:
    """Entry of an index, or all of them."""
    return slice(None) if value == "all" else slice(int(value), int(value) + 1)


def harmonics(first: int, tried: int) -> Index:
    """Harmonic from `first` on, of which diagnosis tries those up to `tried`."""
    known = range(first, 1000)
    return Index("harmonic", lambda mechanism: known, lambda mechanism: range(first, tried + 1), anywhere=known)


def own_order(mechanism: Mechanism, indices: Indices) -> tuple[float, ...]:
    """The order of a wave over the output's turn: its harmonic."""
    return (float(indices["harmonic"]),)


def input_order(mechanism: Mechanism, indices: Indices) -> tuple[float, ...]:
    """The order of a wave over the input's turn."""
    return (abs(int(indices["harmonic"]) * mechanism.ratio),)


def _others(count: int, value: IndexValue) -> list[tuple[IndexValue, float]]:
    """All others of so many parts, the error as it is or the opposite."""
    return [(other, sign) for other in range(count) for sign in (1.0, -1.0) if other != value]


def _pins_alike(mechanism: Mechanism, value: IndexValue) -> list[tuple[IndexValue, float]]:
    """The pins beside one, which carry next, and those that another disc meets as this disc meets it."""
    unit = rv(mechanism)
    if not isinstance(value, int):
        return []
    apart = [1, -1, *(k * unit.pins // unit.discs for k in range(1, unit.discs) if k * unit.pins % unit.discs == 0)]
    return [((value + step) % unit.pins, 1.0) for step in apart]


CRANK = every("crank", lambda unit: range(unit.cranks), lambda mechanism, value: _others(rv(mechanism).cranks, value))
DISC = every("disc", lambda unit: range(unit.discs), lambda mechanism, value: _others(rv(mechanism).discs, value))
PIN = every("pin", lambda unit: range(unit.pins), _pins_alike)


def axes_and_corners(share: float, count: int) -> tuple[tuple[float, ...], ...]:
    """Starts of so many components: each alone either way, and all of them in all signs."""
    axes = [tuple(sign * share * (k == at) for k in range(count)) for sign in (1.0, -1.0) for at in range(count)]
    return (*axes, *(tuple(share * sign for sign in signs) for signs in product((1.0, -1.0), repeat=count)))


_SIXTHS = [2 * math.pi * way / 6 for way in range(6)]
#: Starts of two components of one size, in six directions.
AROUND = tuple((0.17 * math.cos(angle), 0.17 * math.sin(angle)) for angle in _SIXTHS)
#: Starts of one size, of any sign and of none.
EITHER_WAY, OPENS = ((0.2,), (-0.2,)), ((0.1,), (0.3,))


def lengths(plausible_um: float, *names: str, least: float = -math.inf) -> tuple[Parameter, ...]:
    """Parameters that are lengths; of a clearance none can be below nothing."""
    return tuple(Parameter(name, "length", plausible_um * 1e-3, least) for name in names)


def compliances(plausible_um_per_kn: float, *names: str) -> tuple[Parameter, ...]:
    """Parameters that are compliances of contacts."""
    return tuple(Parameter(name, "contact_compliance", plausible_um_per_kn * 1e-6) for name in names)


def windups(plausible_arcsec_per_knm: float, *names: str) -> tuple[Parameter, ...]:
    """Parameters that turn the output in proportion to its torque."""
    return tuple(Parameter(name, "compliance", plausible_arcsec_per_knm * ARCSEC / 1e6) for name in names)


def angles(plausible_arcsec: float, *names: str) -> tuple[Parameter, ...]:
    """Parameters that are angles."""
    return tuple(Parameter(name, "angle", plausible_arcsec * ARCSEC) for name in names)


def constant(mechanism: Mechanism, indices: Indices) -> tuple[float, ...]:
    """No orders: the output is shifted and no more."""
    return ()


def leads(frame: str) -> Orders:
    """The frame's fundamental order, times the source's harmonic where it has one."""

    def orders(mechanism: Mechanism, indices: Indices) -> tuple[float, ...]:
        harmonic = int(indices.get("harmonic", 1))
        return (harmonic * fundamental_orders(rv(mechanism))[frame],) if harmonic else ()

    return orders


def bore_orders(mechanism: Mechanism, indices: Indices) -> tuple[float, ...]:
    """A single disc loads its bores along the eccentric direction, which doubles the order."""
    unit = rv(mechanism)
    once = fundamental_orders(unit)["disc"]
    return (2 * once, once) if unit.discs == 1 else (once,)


def pin_wave_orders(mechanism: Mechanism, indices: Indices) -> tuple[float, ...]:
    """A wave h over the pins meets the crank h + m z_p times a turn; the discs keep multiples of their number.

    What is alike at all pins, h = 0, ripples as pins enter and leave the loaded half.
    """
    unit, wave = rv(mechanism), int(indices.get("harmonic", 0))
    waves = [abs(wave + m * unit.pins) for m in range(-unit.discs, unit.discs + 1)]
    kept = [w for w in waves if w % unit.discs == 0 and w > 0]
    return (min(kept) * fundamental_orders(unit)["housing"],) if kept else ()


def clearance_orders(mechanism: Mechanism, indices: Indices) -> tuple[float, ...]:
    """All bearing forces turn alike but for their phases: only common multiples of cranks and discs stay."""
    unit = rv(mechanism)
    return (math.lcm(unit.cranks, unit.discs) * fundamental_orders(unit)["bearing"],)


def bearing_compliance_orders(mechanism: Mechanism, indices: Indices) -> tuple[float, ...]:
    """All bearings of a crank, a disc or the carrier even the turning force out but for the ripple of the pins."""
    return pin_wave_orders(mechanism, {}) if "all" in indices.values() else bore_orders(mechanism, {})
