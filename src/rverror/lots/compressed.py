"""Large lots: units that are split into orders one by one, and files that hold what is kept of them.

A file has lines of JSON: a head that says of what it was made, then a line for each unit, its amplitudes as 32-bit
numbers in base64, which of 30 arcsec leaves 2e-6.  Nothing is left out yet and no noise is estimated, so that files of
parts of a lot make the lot.

Page ``theory/lots.md``.
"""

from __future__ import annotations

import base64
import hashlib
import json
import os
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from typing import IO, Any

import numpy as np

from rverror.base.errors import InputError, check_each
from rverror.base.numbers import count_of
from rverror.base.progress import Progress
from rverror.base.text import PathLike, check_name, some
from rverror.base.version import __version__
from rverror.lots.amplitudes import Amplitudes, Condition, UnitAmplitudes, joined_units, split_unit
from rverror.lots.folder import LotPart, UnitFiles, list_units
from rverror.model.effects import Model, check_model
from rverror.runs.bench.mapping import BenchMapping, given_mapping
from rverror.runs.measurement import ratio_of

#: Units of a task.
TOGETHER = 32

_HEAD = {"format": "rverror lot", "version": 2}
_AHEAD = 64  # tasks that wait for workers: enough for a cluster, and no more in memory than these
_AGAIN = "compress the runs again"
_SINGLE = np.dtype("<f4")  # of amplitudes in a file


@dataclass(frozen=True)
class LotInputs:
    """Parts of a lot: folders of units, and files of units that are split into orders.

    Attributes
    ----------
    model : Model
    mapping : BenchMapping or None
        By which runs are read.
    parts : tuple of LotPart
    """

    model: Model
    mapping: BenchMapping | None
    parts: tuple[LotPart, ...]

    @property
    def files(self) -> tuple[str, ...]:
        """Everything that is read."""
        return tuple(file for part in self.parts for file in part.files)

    @property
    def notes(self) -> tuple[str, ...]:
        """What was noticed as the parts were listed."""
        return tuple(note for part in self.parts for note in part.notes)

    @property
    def unread(self) -> tuple[UnitFiles, ...]:
        """Units whose runs are still to be read."""
        return tuple(unit for part in self.parts for unit in part.units)

    def amplitudes(self, *, executor: Executor | None = None, progress: Progress | None = None) -> Amplitudes:
        """Units of all parts as one lot, ready for `lot`: of a unit only amplitudes of orders are kept.

        Parameters
        ----------
        executor : concurrent.futures.Executor, optional
            Where runs are read and split; it stays open.  This process where left out.
        progress : callable, optional
            Called with a line of text.

        Returns
        -------
        Amplitudes

        Raises
        ------
        InputError
            If a run or a file cannot be used, or fewer than three units are left.
        """
        tell, found = progress or (lambda text: None), list[UnitAmplitudes]()
        total = sum(len(part.serials) for part in self.parts)
        for part in self.parts:
            if not part.units:
                found += _units_in(part.path)
            for some_units in _split(self, part.units, executor):
                found += some_units
                tell(f"{len(found)} of {total} units read")
        lot = joined_units(found)
        return replace(lot, notes=(*self.notes, *lot.notes))

    def compressed(
        self,
        out: PathLike,
        *,
        overwrite: bool = False,
        executor: Executor | None = None,
        progress: Progress | None = None,
    ) -> Compression:
        """Write a file with the amplitudes of all units.

        Parameters
        ----------
        out : str or path-like
            File, written in one step.
        overwrite : bool
            Whether an existing file may be replaced.
        executor : concurrent.futures.Executor, optional
            Where runs are read and split; it stays open.  This process where left out.
        progress : callable, optional
            Called with a line of text.

        Returns
        -------
        Compression

        Raises
        ------
        InputError
            If a run or a file cannot be used, or the file cannot be written.

        Notes
        -----
        Units that are done stand in the file ``OUT.begun`` until all are.  A call after one that was stopped takes them
        from there, if names, sizes and times of their files, the ratio of the model, the mapping and the version of
        rverror are as they were.  Memory holds the runs of one unit for each worker, some units' amplitudes, and the
        names of all.
        """
        if not overwrite and os.path.lexists(out):
            raise InputError(f"{out}: the file exists; choose another name or allow overwriting")
        tell, unread = progress or (lambda text: None), self.unread
        head = _made_of(self.model, self.mapping)
        stamps = {unit.serial: _stamp(unit) for unit in unread}
        begun, whole = f"{os.fspath(out)}.begun", f"{os.fspath(out)}.tmp"
        try:
            with open(begun, "a+b") as file:
                place = _left(file, head, stamps)  # where the line of each unit begins
                todo = [unit for unit in unread if unit.serial not in place]
                for units in _split(self, todo, executor):
                    for unit in units:
                        place[unit.serial] = file.tell()
                        file.write(_line([stamps[unit.serial], _told(unit)]))
                    file.flush()
                    tell(f"{len(place)} of {len(unread)} units read")
                total = sum(len(part.serials) for part in self.parts)
                with open(whole, "wb") as made:
                    made.write(_line({**head, "notes": self.notes, "units": total}))
                    made.writelines(map(_line, _gathered(self, file, place)))
            os.replace(whole, out)
        except OSError as error:
            raise InputError(f"{out}: cannot write it ({error.strerror}); choose another place") from error
        os.unlink(begun)
        return Compression(total, len(todo))


@dataclass(frozen=True)
class Compression:
    """What `LotInputs.compressed` wrote.

    Attributes
    ----------
    units : int
        In the file.
    read : int
        Of these, units whose runs were read now, not taken from a file or from what a stopped call has left.
    """

    units: int
    read: int


def lot_inputs(
    paths: PathLike | Sequence[PathLike], model: Model, mapping: PathLike | BenchMapping | None = None
) -> LotInputs:
    """List parts of a lot, in the order in which they were made, and check that they belong together and to the model.

    No run is read yet: `LotInputs.amplitudes` does that, or `LotInputs.compressed`, which writes a file.

    Parameters
    ----------
    paths : str, path-like or sequence of them
        Folders as `lot_units` reads them, and files of compressed units.
    model : Model
        Whose units they are.
    mapping : str, path-like or BenchMapping, optional
        How the bench names its columns.

    Returns
    -------
    LotInputs

    Raises
    ------
    InputError
        If a part cannot be used, was made with another ratio, or shares a serial with another.
    """
    check_model(model)
    given = [paths] if isinstance(paths, (str, os.PathLike)) else paths
    check_each("paths", given, (str, os.PathLike), "give a folder of units, a file of a compressed lot, or a list")
    if not given:
        raise InputError("paths: there is none; give a folder of units, or a file of a compressed lot")
    mapping = given_mapping(mapping)
    parts, owner = list[LotPart](), dict[str, str]()
    for path in given:
        check_name(path)
        part = _part_of(path, model) if os.path.isfile(path) else list_units(path, mapping)
        if twice := [serial for serial in part.serials if serial in owner]:
            raise InputError(
                f"{part.path}: {count_of(len(twice), 'serial')} ({some(twice)}) that {owner[twice[0]]} has too; give "
                "each unit once, with a serial of its own"
            )
        owner.update(dict.fromkeys(part.serials, part.path))
        parts.append(part)
    return LotInputs(model, mapping, tuple(parts))


def _made_of(model: Model, mapping: BenchMapping | None) -> dict[str, Any]:
    """What amplitudes depend on."""
    return {
        **_HEAD,
        "rverror": __version__,
        "ratio": float(ratio_of(model)),
        "mapping": "" if mapping is None else hashlib.sha256(repr(mapping).encode()).hexdigest(),
    }


# --- reading runs -----------------------------------------------------------------------------------------------------


def _split(
    inputs: LotInputs, units: Sequence[UnitFiles], executor: Executor | None
) -> Iterator[tuple[UnitAmplitudes, ...]]:
    """Units as amplitudes, some at a time, in their order."""
    tasks = [units[at : at + TOGETHER] for at in range(0, len(units), TOGETHER)]
    if executor is None:
        yield from (_split_some(inputs.model, inputs.mapping, task) for task in tasks)
        return
    waiting: deque[Future[tuple[UnitAmplitudes, ...]]] = deque()
    try:
        for task in tasks:
            # workers elsewhere have another folder
            there = [replace(unit, runs=tuple(map(os.path.abspath, unit.runs))) for unit in task]
            waiting.append(executor.submit(_split_some, inputs.model, inputs.mapping, there))
            if len(waiting) == _AHEAD:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()
    except (BrokenExecutor, CancelledError) as problem:
        raise InputError(
            f"a worker was lost ({problem}); start again, with fewer processes if memory ran out"
        ) from problem
    finally:
        for future in waiting:
            future.cancel()


def _split_some(model: Model, mapping: BenchMapping | None, units: Sequence[UnitFiles]) -> tuple[UnitAmplitudes, ...]:
    """Work of one task: a unit's samples are gone before the next is read."""
    return tuple(split_unit(model, unit.read(model, mapping)) for unit in units)


# --- what a stopped call has left -------------------------------------------------------------------------------------


def _stamp(unit: UnitFiles) -> str:
    """Names, sizes and times of a unit's files, taken before they are read: what changes meanwhile is read again."""
    try:
        states = [(os.path.basename(path), os.stat(path)) for path in unit.runs]
    except OSError as error:
        raise InputError(f"{error.filename}: cannot read the run ({error.strerror}); check the path") from error
    return "; ".join(f"{name} {state.st_size} {state.st_mtime_ns}" for name, state in states)


def _left(file: IO[bytes], head: Mapping[str, Any], stamps: Mapping[str, str]) -> dict[str, int]:
    """Where the line of each unit begins that need not be read again; what is of no use, or cut off, is removed."""
    place, end = dict[str, int](), len(_line(head))
    file.seek(0)
    if file.readline() != _line(head):
        file.truncate(0)
        file.write(_line(head))
    with suppress(ValueError):  # what a call was writing as it was stopped
        for line in file:
            if not line.endswith(b"\n"):
                break
            stamp, unit = json.loads(line)
            if stamps.get(unit["serial"]) == stamp:
                place[unit["serial"]] = end
            end += len(line)
    file.truncate(end)
    file.seek(end)
    return place


def _gathered(inputs: LotInputs, begun: IO[bytes], place: Mapping[str, int]) -> Iterator[dict[str, Any]]:
    """All units in their order as a file has them, with the labels that they have now."""
    for part in inputs.parts:
        if not part.units:
            yield from map(_told, _units_in(part.path))
        for unit in part.units:
            begun.seek(place[unit.serial])
            yield {**json.loads(begun.readline())[1], "labels": dict(unit.labels)}


# --- the file ---------------------------------------------------------------------------------------------------------


def _part_of(path: PathLike, model: Model) -> LotPart:
    """A file as a part of a lot: of its units the serials alone are read."""
    with _readable(path) as file:
        first = file.readline()
        if not first.startswith(_line(_HEAD)[:-2]):
            raise InputError(
                f"{path}: no compressed lot that this rverror reads; give a folder of units, or a file that "
                "'rverror lot --compress' wrote"
            )
        head = json.loads(first)
        if float(head["ratio"]) != ratio_of(model):
            raise InputError(
                f"{path}: it was made with another model, of ratio {head['ratio']:.10g} for {ratio_of(model):.10g}; "
                f"{_AGAIN} with this model, or give the model of then"
            )
        serials = tuple(str(json.loads(line)["serial"]) for line in file)
        if len(serials) != head["units"]:
            raise ValueError(f"{len(serials)} units for {head['units']}")
        return LotPart(os.fspath(path), (os.fspath(path),), serials, tuple(map(str, head["notes"])))


def _units_in(path: str) -> Iterator[UnitAmplitudes]:
    """Units of a file in their order, one in memory at a time."""
    with _readable(path) as file:
        file.readline()  # the head
        for line in file:
            yield _unit_of(json.loads(line))


def _line(content: object) -> bytes:
    return json.dumps(content).encode() + b"\n"


def _told(unit: UnitAmplitudes) -> dict[str, Any]:
    """A unit as plain data."""
    runs = [
        (condition.direction, condition.torque, base64.b64encode(row.astype(_SINGLE).tobytes()).decode())
        for condition, row in unit.values.items()
    ]
    return {
        "serial": unit.serial,
        "labels": dict(unit.labels),
        "samples": unit.samples,
        "marked": unit.marked,
        "notes": unit.notes,
        "runs": runs,
    }


def _unit_of(told: Mapping[str, Any]) -> UnitAmplitudes:
    """A unit of plain data."""
    values = {
        Condition(float(direction), float(torque)): np.frombuffer(base64.b64decode(row, validate=True), _SINGLE)
        for direction, torque, row in told["runs"]
    }
    notes, marked = tuple(map(str, told["notes"])), bool(told["marked"])
    unit = UnitAmplitudes(told["serial"], dict(told["labels"]), values, int(told["samples"]), notes, marked=marked)
    if not all(row.size == 2 * unit.count and np.isfinite(row).all() for row in values.values()):
        raise ValueError(f"unit {unit.serial} has no {2 * unit.count} finite amplitudes")
    return unit


@contextmanager
def _readable(path: PathLike) -> Iterator[IO[bytes]]:
    """An open file; what is wrong with it is refused in one line."""
    try:
        with open(path, "rb") as file:
            yield file
    except InputError:
        raise
    except OSError as error:
        raise InputError(f"{path}: cannot read the file ({error.strerror}); check the path") from error
    except (LookupError, TypeError, ValueError) as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:100]
        raise InputError(f"{path}: the file is cut off or damaged ({reason}); {_AGAIN}") from error
