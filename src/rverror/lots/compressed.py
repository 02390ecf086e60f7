"""Large lots: units that are split into orders one by one, and files that hold what is kept of them.

A file is an ``.npz`` without pickles.  Its ``head`` says of what it was made; a block of units has ``units-N``, their
serials, labels and conditions as JSON, and ``values-N``, their amplitudes as float32, which of 30 arcsec leaves 2e-6.
Nothing is left out yet and no noise is estimated, so that files of parts of a lot make the lot.

Page ``theory/lots.md``.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import zipfile
import zlib
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import islice
from pathlib import Path
from typing import IO, Any

import numpy as np

from rverror.base.errors import InputError, check_each
from rverror.base.numbers import count_of
from rverror.base.text import PathLike, check_name, write_bytes
from rverror.base.version import __version__
from rverror.lots.amplitudes import Amplitudes, Condition, UnitAmplitudes, joined_units, some, split_unit
from rverror.lots.folder import LotFolder, UnitFiles, list_units
from rverror.model.catalogue import source
from rverror.model.effects import Model, check_model
from rverror.runs.bench.mapping import BenchMapping, given_mapping
from rverror.runs.measurement import ratio_of

#: Units of a task, of a chunk that a killed call leaves, and of a block of the file: 0.1 MB of two runs each.
TOGETHER = 32

_FORMAT, _VERSION = "rverror lot", 1
_AHEAD = 64  # tasks that wait for workers: enough for a cluster, and no more in memory than these
_CHUNKS = f"chunk-{'[0-9]' * 8}.npz"
_AGAIN = "compress the runs again"
_BROKEN = (
    zipfile.BadZipFile, zlib.error, ArithmeticError, AttributeError, EOFError, LookupError, MemoryError, RuntimeError,
    TypeError, ValueError,
)  # fmt: skip

Tell = Callable[[str], None]


@dataclass(frozen=True)
class LotFile:
    """A file of units that are split into orders; of these the serials alone are read.

    Attributes
    ----------
    path : str
    head : mapping
        Of what it was made.
    serials : tuple of str
        In the order in which the units were made.
    """

    path: str
    head: Mapping[str, Any]
    serials: tuple[str, ...]

    @property
    def files(self) -> tuple[str, ...]:
        """The file."""
        return (self.path,)

    @property
    def notes(self) -> tuple[str, ...]:
        """What was noticed as it was made."""
        return tuple(self.head["notes"])

    def check(self, model: Model) -> None:
        """Refuse a model of which the amplitudes would have been others.

        Raises
        ------
        InputError
        """
        now = _made_of(model, None)
        if self.head["ratio"] != now["ratio"]:
            raise InputError(
                f"{self.path}: it was made with another model, of ratio {self.head['ratio']:.10g} for "
                f"{now['ratio']:.10g}; {_AGAIN} with this model, or give the model of then"
            )
        if lacking := sorted({*now["needs"]} - {*self.head["needs"]}):
            raise InputError(
                f"{self.path}: it was made with another model, whose effects need no {lacking[0]} of the runs; "
                f"{_AGAIN} with this model"
            )

    def units(self) -> Iterator[UnitAmplitudes]:
        """Units in their order, a block in memory at a time.

        Raises
        ------
        InputError
            If the file is damaged.
        """
        with _opened(self.path) as archive:
            for block in range(self.head["blocks"]):
                told, values = _json(archive, f"units-{block}"), _array(archive, f"values-{block}")
                if values.dtype != np.float32 or values.ndim != 1 or not np.isfinite(values).all():
                    raise ValueError(f"values-{block} are no finite numbers")
                at = 0
                for one in told:
                    conditions = [Condition(float(way), float(torque)) for way, torque in one["conditions"]]
                    labels = {str(name): str(label) for name, label in one["labels"].items()}
                    notes = tuple(map(str, one["notes"]))
                    unit = UnitAmplitudes(
                        str(one["serial"]), labels, {}, int(one["samples"]), notes, marked=bool(one.get("marked", True))
                    )
                    rows = values[at : at + 2 * unit.count * len(conditions)].reshape(len(conditions), 2 * unit.count)
                    at += rows.size
                    yield replace(unit, values=dict(zip(conditions, rows, strict=True)))
                if at != values.size:
                    raise ValueError(f"values-{block} has {values.size} numbers for {at}")


@dataclass(frozen=True)
class LotInputs:
    """Parts of a lot: folders of units, and files of units that are split into orders.

    Attributes
    ----------
    model : Model
    mapping : BenchMapping or None
        By which runs are read.
    parts : tuple of LotFolder or LotFile
    """

    model: Model
    mapping: BenchMapping | None
    parts: tuple[LotFolder | LotFile, ...]

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
        return tuple(unit for part in self.parts if isinstance(part, LotFolder) for unit in part.units)

    def amplitudes(self, *, executor: Executor | None = None, progress: Tell | None = None) -> Amplitudes:
        """The lot of all parts; see `load_amplitudes`."""
        tell, found = progress or (lambda text: None), list[UnitAmplitudes]()
        total = sum(len(part.serials) for part in self.parts)
        for part in self.parts:
            if isinstance(part, LotFile):
                found += part.units()
            else:
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
        progress: Tell | None = None,
    ) -> Compression:
        """Write a file with the amplitudes of all units; see `compress_lot`."""
        if not overwrite and os.path.lexists(out):
            raise InputError(f"{out}: the file exists; choose another name or allow overwriting")
        tell, store = progress or (lambda text: None), Path(f"{os.fspath(out)}.parts")
        made_of, unread = _made_of(self.model, self.mapping), self.unread
        stamps = {unit.serial: _stamp(unit) for unit in unread}
        with _writing(out):
            store.mkdir(exist_ok=True)
        place, notes = _left(store, made_of, stamps)
        todo, done = [unit for unit in unread if unit.serial not in place], len(place)
        number = max((int(path.stem[-8:]) for path in store.glob(_CHUNKS)), default=0)
        for units in _split(self, todo, executor):
            number += 1
            chunk, content = store / f"chunk-{number:08}.npz", io.BytesIO()
            serials = [unit.serial for unit in units]
            _write(content, {**made_of, "notes": [], "stamps": {s: stamps[s] for s in serials}}, units, len(units))
            write_bytes(chunk, content.getvalue(), overwrite=False)
            place |= dict.fromkeys(serials, chunk)
            done += len(units)
            tell(f"{done} of {len(unread)} units read")
        total, whole = sum(len(part.serials) for part in self.parts), store / "whole.npz"
        with _writing(out):
            _write(whole, {**made_of, "notes": self.notes}, _gathered(self, place), total)
            os.replace(whole, out)
            for chunk in (*store.glob(_CHUNKS), *store.glob(".chunk-*.tmp")):
                chunk.unlink()
        with suppress(OSError):  # something of another program is in it
            store.rmdir()
        return Compression(total, len(todo), (*self.notes, *notes))


@dataclass(frozen=True)
class Compression:
    """What `compress_lot` wrote.

    Attributes
    ----------
    units : int
        In the file.
    read : int
        Of these, units whose runs were read now, not taken from a file or from what a stopped call has left.
    notes : tuple of str
        What was noticed, and what of a stopped call was read again.
    """

    units: int
    read: int
    notes: tuple[str, ...]


def lot_inputs(
    paths: PathLike | Sequence[PathLike], model: Model, mapping: PathLike | BenchMapping | None = None
) -> LotInputs:
    """List parts of a lot, and check that they belong together and to the model; no run is read yet.

    Parameters
    ----------
    paths : str, path-like or sequence of them
        Folders as `lot_units` reads them, and files that `compress_lot` wrote.
    model : Model
    mapping : str, path-like or BenchMapping, optional
        How the bench names its columns.

    Returns
    -------
    LotInputs

    Raises
    ------
    InputError
        If a part cannot be used, was made with another model, or shares a serial with another.
    """
    check_model(model)
    given = [paths] if isinstance(paths, (str, os.PathLike)) else paths
    check_each("paths", given, (str, os.PathLike), "give a folder of units, a file of a compressed lot, or a list")
    if not given:
        raise InputError("paths: there is none; give a folder of units, or a file of a compressed lot")
    mapping = given_mapping(mapping)
    parts, owner = list[LotFolder | LotFile](), dict[str, str]()
    for path in given:
        check_name(path)
        is_file = os.path.isfile(path) or (os.fspath(path).endswith(".npz") and not os.path.isdir(path))
        part = _open(path) if is_file else list_units(path, mapping)
        if isinstance(part, LotFile):
            part.check(model)
        if twice := [serial for serial in part.serials if serial in owner]:
            raise InputError(
                f"{part.path}: {count_of(len(twice), 'serial')} ({some(twice)}) that {owner[twice[0]]} has too; give "
                "each unit once, with a serial of its own"
            )
        owner.update(dict.fromkeys(part.serials, part.path))
        parts.append(part)
    return LotInputs(model, mapping, tuple(parts))


def load_amplitudes(
    paths: PathLike | Sequence[PathLike],
    model: Model,
    mapping: PathLike | BenchMapping | None = None,
    *,
    executor: Executor | None = None,
    progress: Tell | None = None,
) -> Amplitudes:
    """Units of a lot, of all sizes, ready for `lot`: of a unit only amplitudes of orders are kept.

    Parameters
    ----------
    paths : str, path-like or sequence of them
        Folders as `lot_units` reads them, and files that `compress_lot` wrote: parts of one lot, in the order in which
        they were made.
    model : Model
        Whose units they are.
    mapping : str, path-like or BenchMapping, optional
        How the bench names its columns.
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
        If a part cannot be used, was made with another model, or shares a serial with another.
    """
    return lot_inputs(paths, model, mapping).amplitudes(executor=executor, progress=progress)


def compress_lot(
    paths: PathLike | Sequence[PathLike],
    model: Model,
    mapping: PathLike | BenchMapping | None = None,
    *,
    out: PathLike,
    overwrite: bool = False,
    executor: Executor | None = None,
    progress: Tell | None = None,
) -> Compression:
    """Write a file with the amplitudes of all units of a lot, or of a part of it.

    Parameters
    ----------
    paths, model, mapping
        As `load_amplitudes` has them; files among the paths are taken over as they are.
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
        If a part or a run cannot be used, or the file cannot be written.

    Notes
    -----
    Units that are done stand in the folder ``OUT.parts`` until all are.  A call after one that was stopped takes them
    from there, if names, sizes and times of their files, the ratio of the model, the mapping and the version of
    rverror are as they were.  Memory holds the runs of one unit for each worker, some units' amplitudes, and the names
    of all.
    """
    inputs = lot_inputs(paths, model, mapping)
    return inputs.compressed(out, overwrite=overwrite, executor=executor, progress=progress)


def _made_of(model: Model, mapping: BenchMapping | None) -> dict[str, Any]:
    """What amplitudes depend on: of a model the ratio, and what its effects ask of the runs beside a torque."""
    return {
        "format": _FORMAT,
        "version": _VERSION,
        "rverror": __version__,
        "ratio": float(ratio_of(model)),
        "needs": ["time"] if any("time" in source(effect.key).needs for effect in model.effects) else [],
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


def _left(
    store: Path, made_of: Mapping[str, Any], stamps: Mapping[str, str]
) -> tuple[dict[str, Path], tuple[str, ...]]:
    """Chunk in which each unit stands that need not be read again, and what is to be said."""
    place, changed, notes = dict[str, Path](), dict[str, None](), list[str]()
    for chunk in sorted(store.glob(_CHUNKS)):
        try:
            file = _open(chunk)
            fits = {**file.head, **made_of} == file.head
            before = {unit.serial: file.head["stamps"][unit.serial] for unit in file.units()} if fits else {}
        except (InputError, LookupError, TypeError):
            before = {}
        if not before:
            notes.append(f"read again: what {chunk} has, of another model, mapping or version, or damaged")
            continue
        place |= {serial: chunk for serial, stamp in before.items() if stamps.get(serial) == stamp}
        changed |= {serial: None for serial, stamp in before.items() if stamps.get(serial, stamp) != stamp}
    if again := [serial for serial in changed if serial not in place]:
        notes.append(f"read again: {count_of(len(again), 'unit')} whose files have changed ({some(again)})")
    return place, tuple(notes)


def _gathered(inputs: LotInputs, place: Mapping[str, Path]) -> Iterator[UnitAmplitudes]:
    """All units in their order, with the labels that they have now."""

    @lru_cache(maxsize=2)  # a chunk holds units that stand one after another
    def units_of(chunk: Path) -> dict[str, UnitAmplitudes]:
        return {unit.serial: unit for unit in _open(chunk).units()}

    for part in inputs.parts:
        if isinstance(part, LotFile):
            yield from part.units()
        else:
            for unit in part.units:
                yield replace(units_of(place[unit.serial])[unit.serial], labels=unit.labels)


# --- the file ---------------------------------------------------------------------------------------------------------


def _write(file: PathLike | IO[bytes], head: Mapping[str, Any], units: Iterable[UnitAmplitudes], total: int) -> None:
    """Write units block by block."""
    rest = iter(units)
    with zipfile.ZipFile(file, "w") as archive:
        blocks = -(-total // TOGETHER)
        _put(archive, "head", _as_bytes({**head, "units": total, "blocks": blocks}))
        for block in range(blocks):
            some_units = list(islice(rest, TOGETHER))
            told = [
                {
                    "serial": unit.serial,
                    "labels": dict(unit.labels),
                    "samples": unit.samples,
                    "marked": unit.marked,
                    "notes": unit.notes,
                    "conditions": [(c.direction, c.torque) for c in unit.values],
                }
                for unit in some_units
            ]
            rows = [np.zeros(0), *(row for unit in some_units for row in unit.values.values())]
            _put(archive, f"units-{block}", _as_bytes(told))
            _put(archive, f"values-{block}", np.concatenate(rows, dtype=np.float32))


def _as_bytes(content: Any) -> np.ndarray[Any, Any]:
    return np.frombuffer(json.dumps(content).encode(), np.uint8)


def _put(archive: zipfile.ZipFile, name: str, values: np.ndarray[Any, Any]) -> None:
    """Add an array as `numpy.savez` does; the date is always the same, and so is the file."""
    with archive.open(zipfile.ZipInfo(f"{name}.npy"), "w", force_zip64=True) as stream:
        np.lib.format.write_array(stream, values, allow_pickle=False)


def _array(archive: zipfile.ZipFile, name: str) -> np.ndarray[Any, Any]:
    stored = io.BytesIO(archive.read(f"{name}.npy"))  # the whole of it, which checks its sum
    return np.asarray(np.lib.format.read_array(stored, allow_pickle=False))


def _json(archive: zipfile.ZipFile, name: str) -> Any:
    return json.loads(_array(archive, name).astype(np.uint8, casting="no").tobytes())


def _open(path: PathLike) -> LotFile:
    """Head and serials of a file, of this format and version."""
    with _opened(path) as archive:
        head = _json(archive, "head") if "head.npy" in archive.namelist() else {}
        if not isinstance(head, dict) or head.get("format") != _FORMAT:
            raise InputError(f"{path}: this .npz is no compressed lot; give one that 'rverror lot --compress' wrote")
        if head["version"] != _VERSION:
            raise InputError(
                f"{path}: a compressed lot of format version {head['version']}, this rverror reads {_VERSION}; {_AGAIN}"
            )
        head |= {"ratio": float(head["ratio"])} | {name: [*map(str, head[name])] for name in ("needs", "notes")}
        told = [one for block in range(head["blocks"]) for one in _json(archive, f"units-{block}")]
        serials = tuple(str(one["serial"]) for one in told)
        if len(serials) != head["units"]:
            raise ValueError(f"{len(serials)} units for {head['units']}")
    return LotFile(os.fspath(path), head, serials)


@contextmanager
def _opened(path: PathLike) -> Iterator[zipfile.ZipFile]:
    """Archive of a file; what is wrong with it is refused in one line."""
    try:
        with open(path, "rb") as file:
            if file.read(4) != b"PK\x03\x04":
                raise InputError(
                    f"{path}: this is no .npz file; give a folder of units, or a file that 'rverror lot --compress' "
                    "wrote"
                )
            with zipfile.ZipFile(file) as archive:
                yield archive
    except InputError:
        raise
    except OSError as error:
        raise InputError(f"{path}: cannot read the file ({error.strerror}); check the path") from error
    except _BROKEN as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:100]
        raise InputError(f"{path}: the file is cut off or damaged ({reason}); {_AGAIN}") from error


@contextmanager
def _writing(out: PathLike) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise InputError(f"{out}: cannot write it ({error.strerror}); choose another place") from error
