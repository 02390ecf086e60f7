"""Parts of what files say of them: every error of a serial number once."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from rverror.base.errors import InputError
from rverror.base.text import describe, did_you_mean, shown
from rverror.geartrain.mechanism import Mechanism
from rverror.model.catalogue import source
from rverror.model.effects import Effect
from rverror.parts.measured import KINDS, MeasuredPart


@dataclass(frozen=True)
class Finding:
    """What one place of a file says of a part.

    Attributes
    ----------
    where : str
        File and line, for messages.
    kind, serial : str
        Of the part.
    origin : str
        File, and what was measured.
    error : Effect, optional
        None where the part has no error there.
    """

    where: str
    kind: str
    serial: str
    origin: str
    error: Effect | None


def collected(findings: Iterable[Finding], mechanism: Mechanism) -> tuple[MeasuredPart, ...]:
    """Parts in the order found, each with the errors that all files have of it.

    Raises
    ------
    InputError
        If a kind is unknown, a serial number is missing, an error is no error of such a part of the mechanism, or a
        part has the same error twice.
    """
    errors: dict[tuple[str, str], dict[str, Finding]] = {}
    origins: dict[tuple[str, str], dict[str, None]] = {}
    for one in findings:
        if one.kind not in KINDS:
            hint = did_you_mean(one.kind, KINDS)
            raise InputError(f"{one.where}: kind {shown(one.kind)} is none of {', '.join(KINDS)};{hint} correct it")
        if not one.serial:
            raise InputError(f"{one.where}: no serial number; give every {one.kind} one")
        part = (one.kind, one.serial)
        given = errors.setdefault(part, {})
        origins.setdefault(part, {}).setdefault(one.origin)
        if one.error is None:
            continue
        name = describe(one.error.key, one.error.indices)
        if name in given:
            raise InputError(
                f"{one.where}: {one.kind} {shown(one.serial)} has {name} already, from {given[name].where}; keep one, "
                "or correct the serial number"
            )
        _check(one, one.error, mechanism)
        given[name] = one
    return tuple(
        MeasuredPart(
            kind, serial, tuple(one.error for one in given.values() if one.error), "; ".join(filter(None, origins[key]))
        )
        for key, given in errors.items()
        for kind, serial in [key]
    )


def _check(one: Finding, error: Effect, mechanism: Mechanism) -> None:
    """Refuse what is no error of such a part of the mechanism, at its first place."""
    indices = {index.name: error.indices.get(index.name, 0) for index in source(error.key).indices}
    try:
        MeasuredPart(one.kind, one.serial, (error,))
        source(error.key).check_indices(mechanism, indices)
    except ValueError as problem:
        raise InputError(f"{one.where}: {problem}; correct it") from problem
