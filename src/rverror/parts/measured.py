"""A measured part, the places of a unit for it, and its errors where it is mounted.  Page ``theory/matching.md``."""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from rverror.base.errors import InputError
from rverror.base.text import did_you_mean, shown
from rverror.geartrain.cycloid import LOBE_PROFILE, first_root
from rverror.geartrain.mechanism import Reducer
from rverror.geartrain.source import VECTORS, IndexValue
from rverror.model.catalogue import source
from rverror.model.effects import Effect

#: Kinds of parts: the frame in which the sources of a kind are fixed, and the index that counts such parts in a unit,
#: None where a unit has one.  A roller is a pin that is measured by itself, before it has a groove.
KINDS: dict[str, tuple[str, str | None]] = {
    "crank": ("crank", "crank"),
    "planet": ("planet", "crank"),
    "disc": ("disc", "disc"),
    "roller": ("housing", "pin"),
    "housing": ("housing", None),
    "carrier": ("carrier", None),
    "sun": ("sun", None),
}


@dataclass(frozen=True)
class MeasuredPart:
    """One part with its measured errors.

    Attributes
    ----------
    kind : str
        One of `KINDS`.
    serial : str
        Serial number, unique within its kind.
    errors : tuple of Effect
        Its errors, each with the indices of its source but for the one that counts parts of this kind: the bore of a
        disc has ``crank``, not ``disc``.
    origin : str
        File, and row or feature, from which it was read.
    made_for : int
        Of a disc: the place at which its lobes stand so to its bores.
    count : int
        Of a class of rollers, whose name is the serial number: how many there are; their spread is the uncertainty.

    Raises
    ------
    InputError
        If the kind is unknown, an error belongs to another kind, the same error is given twice, or anything but rollers
        is counted.

    Examples
    --------
    >>> from rverror.model.effects import effect
    >>> disc = MeasuredPart("disc", "D17", (effect("cycloid.disc_bore_position", crank=0, radial="3 um"),))
    >>> print(disc.at(1)[0])
    cycloid.disc_bore_position (disc 1, crank 0): radial 3 um
    """

    kind: str
    serial: str
    errors: tuple[Effect, ...]
    origin: str = ""
    made_for: int = 0
    count: int = 1

    def __post_init__(self) -> None:
        """Check that the errors are this part's."""
        if self.kind not in KINDS:
            hint = did_you_mean(self.kind, KINDS)
            raise InputError(f"part {self.serial}: kind {shown(self.kind)} is none of {', '.join(KINDS)};{hint}")
        if self.count < 1 or (self.count > 1 and self.kind != "roller"):
            raise InputError(
                f"{self.kind} {self.serial}: count = {self.count}: must be 1, or more of a class of rollers"
            )
        frame, counted = KINDS[self.kind]
        seen = set()
        for error in self.errors:
            entry = source(error.key)
            names = {index.name for index in entry.indices}
            uncounted = counted is not None and counted not in names  # of all such parts of a unit at once
            if entry.frame != frame or uncounted or set(error.indices) != names - {counted}:
                raise InputError(f"part {self.serial}: {error} is no error of a {self.kind}")
            this = (error.key, tuple(sorted(error.indices.items())))
            if this in seen:
                raise InputError(f"part {self.serial}: {error} is given twice; keep one")
            seen.add(this)

    def at(self, place: int | None = None) -> tuple[Effect, ...]:
        """Its errors where it is mounted.

        Parameters
        ----------
        place : int, optional
            Which crank, planet, disc or groove of the unit; not given where a unit has one such part.

        Returns
        -------
        tuple of Effect
            With all indices of their sources.
        """
        counted = KINDS[self.kind][1]
        if (counted is None) != (place is None):
            raise ValueError(f"place = {place}: a {self.kind} has {'no' if counted is None else 'a'} place")
        if place is None:
            return self.errors
        return tuple(replace(error, indices=_all_indices(error, place)) for error in self.errors)


def _all_indices(error: Effect, place: int) -> dict[str, IndexValue]:
    """All indices in the order of the source; the one that an error of a part lacks is its place."""
    return {index.name: error.indices.get(index.name, place) for index in source(error.key).indices}


@dataclass(frozen=True)
class Place:
    """Where a unit takes a part.

    Attributes
    ----------
    kind : str
        Of the part, a key of `KINDS`.
    number : int, optional
        Which crank, planet, disc or groove; None where a unit has one such part.
    turns : tuple of int
        By how many pitches of its bores a disc may be turned there, a sun by how many teeth; of other parts 0 alone.
    made_for : int
        First place of a disc whose discs fit here, turned or not: places of one number take the same discs.
    """

    kind: str
    number: int | None
    turns: tuple[int, ...]
    made_for: int = 0

    def __str__(self) -> str:
        """Kind and number for people: ``disc 1``."""
        return self.kind if self.number is None else f"{self.kind} {self.number}"


def disc_turns(reducer: Reducer, made_for: int, place: int) -> tuple[int, ...]:
    """Steps by which a disc made for one place can be turned to stand right at another.

    Parameters
    ----------
    reducer : Reducer
    made_for, place : int

    Returns
    -------
    tuple of int
        Pitches of the bores, counter-clockwise; empty where it does not fit.

    Examples
    --------
    >>> import rverror
    >>> unit = rverror.reducer("RV-40E")
    >>> disc_turns(unit, 0, 0), disc_turns(unit, 0, 1)
    ((0,), (1,))
    """
    cranks, discs = reducer.cranks, reducer.discs
    return tuple(
        s
        for s in range(cranks)
        if (reducer.disc_lobes * s * discs - (made_for - place) * cranks) % (cranks * discs) == 0
    )


def places_of(reducer: Reducer, kind: str, *, turns: bool = False) -> tuple[Place, ...]:
    """Places that a unit has for one kind of part.

    Parameters
    ----------
    reducer : Reducer
    kind : str
        A key of `KINDS`.
    turns : bool
        Whether discs may be turned where they fit in several ways, and a sun put in at any tooth.

    Returns
    -------
    tuple of Place

    Examples
    --------
    >>> import rverror
    >>> [str(place) for place in places_of(rverror.reducer("RV-40E"), "disc")]
    ['disc 0', 'disc 1']
    """
    counted = KINDS[kind][1]
    if counted is None:  # a housing turned by pins shifts the waveform as a whole
        return (Place(kind, None, tuple(range(reducer.sun_teeth if kind == "sun" and turns else 1))),)
    number = {"crank": reducer.cranks, "disc": reducer.discs, "pin": reducer.pins}[counted]
    if kind != "disc":
        return tuple(Place(kind, n, (0,)) for n in range(number))
    found = []
    for n in range(number):
        least = next(p for p in range(number) if disc_turns(reducer, p, n))
        ways = disc_turns(reducer, least, n)
        found.append(Place(kind, n, ways if turns else ways[:1], least))
    return tuple(found)


def mounted(part: MeasuredPart, reducer: Reducer, place: int | None = None, turn: int = 0) -> tuple[Effect, ...]:
    """Errors of a part at its place of a unit, turned by whole steps, as the model of the unit declares them.

    Parameters
    ----------
    part : MeasuredPart
        A disc's errors are those at the place that it is made for.
    reducer : Reducer
    place : int, optional
        As for `MeasuredPart.at`.
    turn : int
        Steps, counter-clockwise: pitches of the bores of a disc, teeth of a sun, pins of a housing.

    Returns
    -------
    tuple of Effect

    Raises
    ------
    InputError
        If such a part is not turned, or no disc fits there so.

    Examples
    --------
    >>> import rverror
    >>> bore = rverror.effect("cycloid.disc_bore_position", crank=0, radial="3 um")
    >>> print(*mounted(MeasuredPart("disc", "D17", (bore,)), rverror.reducer("RV-40E"), 1, 1))
    cycloid.disc_bore_position (disc 1, crank 1): radial 3 um
    """
    errors = part.at(place)
    steps = {"disc": reducer.cranks, "sun": reducer.sun_teeth, "housing": reducer.pins}.get(part.kind, 1)
    if turn == 0:
        return errors
    if steps == 1:
        raise InputError(
            f"{part.kind} {part.serial}: turn = {turn}: only discs, suns and housings are turned; leave it out"
        )
    shifts = {"pin": (turn, reducer.pins)}
    if part.kind == "disc":
        assert place is not None
        fits = [p for p in range(reducer.discs) if turn % steps in disc_turns(reducer, p, place)]
        if not fits:
            raise InputError(
                f"disc {part.serial}: no disc fits at place {place}, turned by {turn} pitches of its bores"
            )
        # a whole number, as the disc fits
        lobes = first_root(reducer, fits[0]) - first_root(reducer, place) + reducer.disc_lobes * turn / steps
        shifts = {"crank": (turn, steps), "lobe": (round(lobes), reducer.disc_lobes)}
    return tuple(_turned(error, shifts, 2 * math.pi * turn / steps) for error in errors)


def at_first_place(disc: MeasuredPart, reducer: Reducer) -> tuple[MeasuredPart, int]:
    """Express a disc's errors at the first place whose discs are like it, and by how many pitches that turns it.

    Parameters
    ----------
    disc : MeasuredPart
    reducer : Reducer

    Returns
    -------
    disc : MeasuredPart
    turn : int
    """
    first = places_of(reducer, "disc")[disc.made_for].made_for
    turn = disc_turns(reducer, disc.made_for, first)[0]
    errors = tuple(
        replace(error, indices={name: value for name, value in error.indices.items() if name != "disc"})
        for error in mounted(disc, reducer, first, turn)
    )
    return replace(disc, errors=errors, made_for=first), turn


def _turned(error: Effect, shifts: Mapping[str, tuple[int, int]], angle: float) -> Effect:
    """One error, its part turned: features that are counted go to other places, vectors and waves turn."""
    if shifts.keys() & error.indices.keys():
        moved: dict[str, IndexValue] = dict(error.indices)
        for name, (by, count) in shifts.items():
            if isinstance(before := moved.get(name), int):  # "all" stays
                moved[name] = (before + by) % count
        return replace(error, indices=moved)
    if error.key == LOBE_PROFILE:  # from root to root, alike on all lobes
        return error
    names = [parameter.name for parameter in source(error.key).parameters]
    waves = int(error.indices.get("harmonic", 1))  # by which a vector turns, else by the angle itself
    values = list(error.values)
    for x, y in ((names.index(a), names.index(b)) for a, b in VECTORS if a in names):
        turned = complex(values[x], values[y]) * cmath.exp(1j * waves * angle)
        values[x], values[y] = turned.real, turned.imag
    return replace(error, values=tuple(values))
