"""The registry: every error source once.

To add a source, write one function that returns its `ErrorVector` in the module of its sub-assembly, and one `Source`
entry below.  The contract test, the command line, files and diagnosis pick it up from here.  A source of your own that
stays outside the package is added for the length of a block by `extended`.
"""

from __future__ import annotations

import difflib
import math
import numbers
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from itertools import chain, product
from types import MappingProxyType

from rverror import coupling, crank, cycloid, empirical, involute, load, sensor, shaft, thermal
from rverror.action_line import SourceVector
from rverror.kinematics import fundamental_orders
from rverror.reducer import Drive, Reducer

IndexValue = int | str
Indices = Mapping[str, IndexValue]
Mechanism = Reducer | Drive


@dataclass(frozen=True)
class Index:
    """An index of a source: which values a mechanism allows, and which of them diagnosis tries."""

    name: str
    allowed: Callable[[Mechanism], Sequence[IndexValue]]
    tried: Callable[[Mechanism], Sequence[IndexValue]]


@dataclass(frozen=True)
class Parameter:
    """A parameter of a source: name, dimension (a key of `units.CORE_UNITS`) and the size that a workshop can make.

    `plausible` is the largest size that no one would be surprised at, `least` the smallest that exists, core units.
    """

    name: str
    dimension: str
    plausible: float
    least: float = -math.inf


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
    periodic : bool
        Whether the waveform repeats with the drive; what grows along a run does not.
    tried : bool
        Whether diagnosis tries it: not where all that it does within a run is constant, or is done by other sources.
    late : bool
        Whether diagnosis tries it only where all others leave lines of its frame: a rare cause of many index values.
    """

    key: str
    vector: Callable[..., SourceVector]
    indices: tuple[Index, ...]
    parameters: tuple[Parameter, ...]
    frame: str
    orders: Callable[[Mechanism, Indices], tuple[float, ...]]
    reference: str
    summary: str
    periodic: bool = True
    tried: bool = True
    late: bool = False

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
                raise ValueError(f"{self.key}: {index.name} = {value!r}; it must be one of {_span(allowed)}")

    @property
    def at_output(self) -> bool:
        """Whether it moves or misreads the output beyond the gear train, whose contacts do not feel it."""
        return self.key.partition(".")[0] in ("sensor", "shaft", "load", "empirical")

    def applies_to(self, mechanism: Mechanism) -> bool:
        """Tell whether the source can act in this kind of mechanism."""
        family = self.key.partition(".")[0]
        if isinstance(mechanism, Drive):
            return family in ("sensor", "shaft") and self.key != "sensor.index_offset"  # it has no marks
        return family != "shaft"

    def check_mechanism(self, mechanism: Mechanism) -> None:
        """Check that the source can act in this kind of mechanism.

        Raises
        ------
        ValueError
            Naming the sources that can.
        """
        if not self.applies_to(mechanism):
            kind, can = (
                ("[drive]", "sensor.* and shaft.*")
                if isinstance(mechanism, Drive)
                else ("[reducer]", "all but shaft.*")
            )
            raise ValueError(f"{self.key} does not act in a {kind} model; {can} do")

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


def _rv(mechanism: Mechanism) -> Reducer:
    assert isinstance(mechanism, Reducer)
    return mechanism


def _all(values: Callable[[Mechanism], Sequence[IndexValue]], name: str) -> Index:
    return Index(name, values, values)


def _harmonic(first: int, tried: int) -> Index:
    return Index("harmonic", lambda m: range(first, 1000), lambda m: range(first, tried + 1))


CRANK = _all(lambda m: range(_rv(m).cranks), "crank")
DISC = _all(lambda m: range(_rv(m).discs), "disc")
LOBE = _all(lambda m: range(_rv(m).disc_lobes), "lobe")
PIN = _all(lambda m: range(_rv(m).pins), "pin")
PIN_OR_ALL = Index("pin", lambda m: [*range(_rv(m).pins), "all"], lambda m: [*range(_rv(m).pins), "all"])
MEMBER = _all(lambda m: ("sun", "planet"), "member")
FRAME = _all(lambda m: tuple(fundamental_orders(_rv(m))), "frame")
SHAFT = _all(lambda m: sorted(m.shafts) if isinstance(m, Drive) else (), "shaft")

_UM = 1e-3
_ARCSEC = 4.84813681109536e-06


def _lengths(plausible_um: float, *names: str) -> tuple[Parameter, ...]:
    return tuple(Parameter(name, "length", plausible_um * _UM) for name in names)


def _clearance(plausible_um: float) -> tuple[Parameter, ...]:
    return (Parameter("clearance", "length", plausible_um * _UM, least=0.0),)


def _angles(plausible_arcsec: float, *names: str) -> tuple[Parameter, ...]:
    return tuple(Parameter(name, "angle", plausible_arcsec * _ARCSEC) for name in names)


def _constant(mechanism: Mechanism, indices: Indices) -> tuple[float, ...]:
    return ()


def _leads(frame: str) -> Callable[[Mechanism, Indices], tuple[float, ...]]:
    """The frame's fundamental order, times the source's harmonic where it has one."""

    def orders(mechanism: Mechanism, indices: Indices) -> tuple[float, ...]:
        harmonic = int(indices.get("harmonic", 1))
        return (harmonic * fundamental_orders(_rv(mechanism))[frame],) if harmonic else ()

    return orders


def _bore_orders(mechanism: Mechanism, indices: Indices) -> tuple[float, ...]:
    """A single disc loads its bores along the eccentric direction, which doubles the order."""
    unit = _rv(mechanism)
    once = fundamental_orders(unit)["disc"]
    return (2 * once, once) if unit.discs == 1 else (once,)


def _carrier_bore_orders(mechanism: Mechanism, indices: Indices) -> tuple[float, ...]:
    """Constant where two or more discs balance."""
    return _bore_orders(mechanism, indices) if _rv(mechanism).discs == 1 else ()


def _carrier_runout_orders(mechanism: Mechanism, indices: Indices) -> tuple[float, ...]:
    """Nothing where two or more discs balance."""
    unit = _rv(mechanism)
    return (fundamental_orders(unit)["carrier"],) if unit.discs == 1 else ()


def _cam_clearance_orders(mechanism: Mechanism, indices: Indices) -> tuple[float, ...]:
    """All cam forces turn alike but for their phases: only common multiples of cranks and discs stay."""
    unit = _rv(mechanism)
    return (math.lcm(unit.cranks, unit.discs) * fundamental_orders(unit)["bearing"],)


def _carrier_clearance_orders(mechanism: Mechanism, indices: Indices) -> tuple[float, ...]:
    """Constant where two or more discs balance."""
    unit = _rv(mechanism)
    return (unit.cranks * fundamental_orders(unit)["bearing"],) if unit.discs == 1 else ()


def _sun_pitch_orders(mechanism: Mechanism, indices: Indices) -> tuple[float, ...]:
    cancels = int(indices["harmonic"]) % _rv(mechanism).cranks != 0
    return () if cancels else _leads("sun")(mechanism, indices)


def _one_pin_orders(mechanism: Mechanism, indices: Indices) -> tuple[float, ...]:
    """Discs pass a pin one after another: only multiples of the number of discs stay."""
    if indices.get("pin") == "all":
        return _all_pins_orders(mechanism, indices)
    unit = _rv(mechanism)
    return (unit.discs * fundamental_orders(unit)["housing"],)


def _pin_circle_orders(mechanism: Mechanism, indices: Indices) -> tuple[float, ...]:
    """A wave h over the pins meets the crank h + m z_p times a turn; the discs keep multiples of their number."""
    unit, harmonic = _rv(mechanism), int(indices["harmonic"])
    waves = [abs(harmonic + m * unit.pins) for m in range(-unit.discs, unit.discs + 1)]
    kept = [w for w in waves if w % unit.discs == 0 and w > 0]
    return (min(kept) * fundamental_orders(unit)["housing"],) if kept else ()


def _all_pins_orders(mechanism: Mechanism, indices: Indices) -> tuple[float, ...]:
    """What is alike at all pins ripples as pins enter and leave the loaded half."""
    return _pin_circle_orders(mechanism, {"harmonic": 0})


def _empirical_orders(mechanism: Mechanism, indices: Indices) -> tuple[float, ...]:
    return (int(indices["harmonic"]) * fundamental_orders(_rv(mechanism))[str(indices["frame"])],)


def _fixed(*orders: float) -> Callable[[Mechanism, Indices], tuple[float, ...]]:
    return lambda mechanism, indices: orders


def _coupling_orders(mechanism: Mechanism, indices: Indices) -> tuple[float, ...]:
    return (abs(int(indices["harmonic"]) * mechanism.ratio),)


def _shaft_orders(mechanism: Mechanism, indices: Indices) -> tuple[float, ...]:
    assert isinstance(mechanism, Drive)
    return (abs(int(indices["harmonic"]) * mechanism.shafts[str(indices["shaft"])]),)


_SOURCES = (
    Source(
        "involute.center_distance", involute.center_distance, (CRANK,), _lengths(30, "radial", "tangential"),
        "carrier", _constant, "000, delta_11", "planet axis against its crank",
    ),
    Source(
        "involute.sun_eccentricity", involute.sun_eccentricity, (), _lengths(50, "x", "y"),
        "sun", _constant, "004, table 2", "eccentricity of the sun's toothing",
    ),
    Source(
        "involute.sun_offset", involute.sun_offset, (), _lengths(100, "x", "y"),
        "housing", _constant, "004, table 2", "offset of the sun's axis",
    ),
    Source(
        "involute.planet_eccentricity", involute.planet_eccentricity, (CRANK,), _lengths(50, "x", "y"),
        "planet", _leads("planet"), "004, table 2", "eccentricity of a planet's toothing",
    ),
    Source(
        "involute.sun_pitch", involute.sun_pitch, (_harmonic(1, 4),), _lengths(50, "cos", "sin"),
        "sun", _sun_pitch_orders, "001, section 2", "cumulative pitch error of the sun",
    ),
    Source(
        "involute.planet_pitch", involute.planet_pitch, (CRANK, _harmonic(1, 3)), _lengths(50, "cos", "sin"),
        "planet", _leads("planet"), "001, section 2", "cumulative pitch error of a planet",
    ),
    Source(
        "involute.tooth_thinning", involute.tooth_thinning, (MEMBER,), _lengths(150, "thinning"),
        "direction", _constant, "003, wear tables", "tooth thickness lost to wear or backlash, half a flank",
    ),
    Source(
        "involute.spline_clearance", involute.spline_clearance, (CRANK,), _clearance(100),
        "direction", _constant, "003, T_e = k_c C + b", "play of the planet's spline, half to either side",
    ),
    Source(
        "crank.eccentricity", crank.eccentricity, (CRANK, DISC), _lengths(30, "radial", "tangential"),
        "crank", _leads("crank"), "000, delta_21; 001; 004", "displacement of one cam",
    ),
    Source(
        "crank.bearing_clearance", crank.bearing_clearance, (), _clearance(30),
        "bearing", _cam_clearance_orders, "000, outlook; 004, tables 2 and 4", "radial clearance of all cam bearings",
    ),
    Source(
        "crank.index", crank.index, (CRANK,), _angles(600, "angle"),
        "crank", _constant, "001, section 2", "lead of a crank over its planet gear",
    ),
    Source(
        "cycloid.disc_profile", cycloid.disc_profile, (DISC, _harmonic(1, 4)), _lengths(30, "cos", "sin"),
        "disc", _leads("disc"), "000, delta_31; 002, e_pd", "profile error of a disc, normal",
    ),
    Source(
        "cycloid.disc_pitch", cycloid.disc_pitch, (DISC, _harmonic(1, 4)), _lengths(30, "cos", "sin"),
        "disc", _leads("disc"), "001; 002, e_Apd", "pitch error of a disc, tangential",
    ),
    Source(
        "cycloid.disc_lobe", cycloid.disc_lobe, (DISC, LOBE), _lengths(50, "deviation"),
        "disc", _leads("disc"), "none: a local defect", "one worn or damaged lobe of a disc", late=True,
    ),
    Source(
        "cycloid.pin_position", cycloid.pin_position, (PIN,), _lengths(50, "radial", "tangential"),
        "housing", _one_pin_orders, "001; 002, e_R and e_AR; 004", "displacement of one pin",
    ),
    Source(
        "cycloid.pin_circle", cycloid.pin_circle, (_harmonic(0, 6),),
        _lengths(50, "radial_cos", "radial_sin", "tangential_cos", "tangential_sin"),
        "housing", _pin_circle_orders, "001, table 1", "wave of all pins around the pin circle",
    ),
    Source(
        "cycloid.pin_radius", cycloid.pin_radius, (PIN_OR_ALL,), _lengths(30, "deviation"),
        "housing", _one_pin_orders, "000; 001; 004", "radius of one pin or of all",
    ),
    Source(
        "cycloid.profile_modification", cycloid.profile_modification, (), _lengths(50, "equidistant", "shift"),
        "disc", _all_pins_orders, "000, outlook; 002, e_rrp and e_rp",
        "profile of all discs ground off, equidistant and by shift of the tool's pin circle",
    ),
    Source(
        "cycloid.disc_bore_position", cycloid.disc_bore_position, (DISC, CRANK), _lengths(30, "radial", "tangential"),
        "disc", _bore_orders, "000, outlook; 001", "displacement of one crank bore in a disc",
    ),
    Source(
        "coupling.carrier_bore_position", coupling.carrier_bore_position, (CRANK,),
        _lengths(30, "radial", "tangential"), "carrier", _carrier_bore_orders, "000, delta_41; 004",
        "displacement of one crank bore in the carrier",
    ),
    Source(
        "coupling.bearing_clearance", coupling.bearing_clearance, (), _clearance(30),
        "bearing", _carrier_clearance_orders, "000, outlook; 004, tables 2 and 4",
        "radial clearance of all crank bearings in the carrier",
    ),
    Source(
        "coupling.carrier_runout", coupling.carrier_runout, (), _lengths(50, "x", "y"),
        "carrier", _carrier_runout_orders, "001, table 3", "bore circle against the carrier's axis",
    ),
    Source(
        "thermal.growth", thermal.growth, (),
        tuple(Parameter(p, "temperature_rise", 60.0) for p in ("housing", "discs", "cranks", "carrier", "gears")),
        "direction", _all_pins_orders, "000 and 001, named as missing; 003, outlook",
        "temperature rise of each part, grown as steel", tried=False,
    ),
    Source(
        "load.torsion", load.torsion, (),
        (Parameter("compliance", "compliance", 20 * _ARCSEC / 1e3, least=0.0),),
        "direction", _constant, "000 and 001, named as missing; 003, outlook",
        "compliance of the output side beyond the contacts",
    ),
    Source(
        "sensor.encoder_eccentricity", sensor.encoder_eccentricity, (), _angles(300, "cos", "sin"),
        "output", _fixed(1.0), "measuring chain", "output encoder or coupling, once a turn",
    ),
    Source(
        "sensor.encoder_ellipticity", sensor.encoder_ellipticity, (), _angles(100, "cos", "sin"),
        "output", _fixed(2.0), "measuring chain", "output encoder, twice a turn",
    ),
    Source(
        "sensor.input_coupling", sensor.input_coupling, (_harmonic(1, 2),), _angles(7200, "cos", "sin"),
        "sun", _coupling_orders, "measuring chain", "input coupling or encoder, an angle of the input shaft",
    ),
    Source(
        "sensor.index_offset", sensor.index_offset, (), _angles(3600, "offset"),
        "output", _constant, "measuring chain",
        "gear's marks ahead of the bench's zero; turns the waveform of all other gear errors", tried=False,
    ),
    Source(
        "sensor.ratio_error", sensor.ratio_error, (), (Parameter("slope", "slope", 0.1),),
        "output", _constant, "measuring chain", "error that grows with the output angle", periodic=False,
    ),
    Source(
        "sensor.drift", sensor.drift, (), _angles(600, "total"),
        "output", _constant, "measuring chain", "slow drift of a run, first to last sample", periodic=False,
    ),
    Source(
        "sensor.time_offset", sensor.time_offset, (), (Parameter("offset", "time", 0.1),),
        "output", _constant, "measuring chain", "delay between the two encoders", periodic=False,
    ),
    Source(
        "shaft.eccentricity", shaft.eccentricity, (SHAFT, _harmonic(1, 4)), _angles(36000, "cos", "sin"),
        "shaft", _shaft_orders, "any drive", "a named shaft of a [drive] model",
    ),
    Source(
        "empirical.order", empirical.order, (FRAME, _harmonic(1, 1)), _angles(60, "cos", "sin"),
        "output", _empirical_orders, "none: what was measured",
        "an order as measured, in a frame; describes and does not explain: no size of a part follows from it",
        tried=False,
    ),
)  # fmt: skip

_OWN: Mapping[str, Source] = MappingProxyType({source.key: source for source in _SOURCES})
_ADDED: ContextVar[Mapping[str, Source]] = ContextVar("sources added by `extended`", default=MappingProxyType({}))


class _Catalogue(Mapping[str, Source]):
    """The package's own sources, then those of the `extended` blocks around the call."""

    def __getitem__(self, key: str) -> Source:
        return _OWN[key] if key in _OWN else _ADDED.get()[key]

    def __iter__(self) -> Iterator[str]:
        return chain(_OWN, _ADDED.get())

    def __len__(self) -> int:
        return len(_OWN) + len(_ADDED.get())


#: Every error source by key.
CATALOGUE: Mapping[str, Source] = _Catalogue()


@contextmanager
def extended(*sources: Source) -> Iterator[None]:
    """Add sources to the catalogue within a ``with`` block: models, files and diagnosis know them there.

    Parameters
    ----------
    *sources : Source
        A key is ``family.name``.  The family says where the source acts: one of ``sensor``, ``load`` and ``empirical``
        beyond the gear train, with its vector at the contact ``output``; any other at the contacts of the gear train.

    Raises
    ------
    ValueError
        If a key is taken.

    Notes
    -----
    Nothing stays behind: after the block, and in other threads and processes, the catalogue is as it was.  docs page
    ``adding-an-effect.md``.

    Examples
    --------
    >>> from dataclasses import replace
    >>> mine = replace(source("sensor.encoder_eccentricity"), key="sensor.coupling_offset")
    >>> with extended(mine):
    ...     source("sensor.coupling_offset").frame
    'output'
    >>> "sensor.coupling_offset" in CATALOGUE
    False
    """
    added = dict(_ADDED.get())
    for entry in sources:
        if entry.key in _OWN or entry.key in added:
            raise ValueError(f"{entry.key}: the catalogue has a source of this key; give yours another")
        added[entry.key] = entry
    token = _ADDED.set(MappingProxyType(added))
    try:
        yield
    finally:
        _ADDED.reset(token)


def source(key: str) -> Source:
    """Look up a source.

    Parameters
    ----------
    key : str
        Such as ``"crank.eccentricity"``.

    Returns
    -------
    Source

    Raises
    ------
    ValueError
        If there is none; the message names the nearest.

    Examples
    --------
    >>> source("cycloid.disc_pitch").frame
    'disc'
    """
    if key not in CATALOGUE:
        close = difflib.get_close_matches(key, CATALOGUE, n=1, cutoff=0.5)
        hint = f"did you mean {close[0]!r}?" if close else "`rverror sources` lists them"
        raise ValueError(f"no error source {key!r}; {hint}")
    return CATALOGUE[key]
