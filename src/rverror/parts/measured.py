"""A measured part, and its errors at the place of a unit where it is mounted."""

from __future__ import annotations

from dataclasses import dataclass, replace

from rverror.base.errors import InputError
from rverror.base.text import did_you_mean, shown
from rverror.geartrain.source import IndexValue
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
        if counted is None or place is None:
            return self.errors
        return tuple(replace(error, indices=_ordered(error, counted, place)) for error in self.errors)


def _ordered(error: Effect, counted: str, place: int) -> dict[str, IndexValue]:
    """All indices, in the order of the source."""
    given: dict[str, IndexValue] = {**error.indices, counted: place}
    return {index.name: given[index.name] for index in source(error.key).indices}
