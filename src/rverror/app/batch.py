"""Many units at once: a folder of them diagnosed through any executor, resumed where it was left."""

from __future__ import annotations

import json
import multiprocessing
import os
import signal
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor, as_completed
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from urllib.parse import quote

from rverror.app.terminal import make_folder
from rverror.base.errors import InputError
from rverror.base.memory import keep_freed_memory
from rverror.base.numbers import count_of
from rverror.base.progress import Progress
from rverror.base.text import PathLike, check_name, is_printable, read_text, write_file
from rverror.base.threads import BLAS_THREADS, KERNEL_THREADS, cores
from rverror.base.version import __version__
from rverror.diagnosis.loop import diagnose
from rverror.model.model_file import load_model
from rverror.runs.bench.file import RUN_SUFFIXES, folders_of_runs
from rverror.runs.bench.mapping import load_mapping
from rverror.runs.measurement import read_run
from rverror.statics.loaded_state import NotConvergedError
from rverror.views.describing import described, enveloped, input_files
from rverror.views.diagnosis_report import diagnosis_content
from rverror.views.fields import about, rows, same_unit
from rverror.views.shown_units import NUMBER, TIME
from rverror.views.variables import Table

MODEL = "model.toml"
SUMMARY = "summary.csv"
OVERVIEW = "summary.html"

_OWN_SUMMARY, _OWN_PAGE = "unit,state,", "<title>rverror"  # what files of any version hold
_MOST_WORKERS = 61  # a limit of Windows

#: What a worker sends back: what became of the unit, content of the result and page, empty where it failed.
_Answer = tuple["UnitOutcome", str, str]


@dataclass(frozen=True)
class UnitOutcome:
    """What became of one unit.

    Attributes
    ----------
    unit : str
        Name of its folder.
    state : str
        ``diagnosed`` now, ``kept`` from an earlier call with the same inputs and version, or ``failed``.
    verdict : str
        As in `Diagnosis`; empty where it failed.
    keys : tuple of str
        Catalogue keys of what was added.
    before, after : float or None
        Held-out rms of the declared model as printed and with what was added, in `rms_unit`.
    rms_unit : str
        ``arcsec``, or ``N*m`` for a torque ripple.
    seconds : float or None
        Time in the worker; None where the result was kept.
    error : str
        One line where it failed, else empty.
    """

    unit: str
    state: str
    verdict: str = ""
    keys: tuple[str, ...] = ()
    before: float | None = None
    after: float | None = None
    rms_unit: str = ""
    seconds: float | None = None
    error: str = ""


@dataclass(frozen=True)
class Batch:
    """Result of `diagnose_folder`.

    Attributes
    ----------
    outcomes : tuple of UnitOutcome
        In the order of the names.
    notes : tuple of str
        Folders with runs that were no units.
    folder : str
        Name of the folder.
    """

    outcomes: tuple[UnitOutcome, ...]
    notes: tuple[str, ...] = ()
    folder: str = ""

    def of(self, state: str) -> tuple[UnitOutcome, ...]:
        """Outcomes of that state: ``diagnosed``, ``kept`` or ``failed``."""
        return tuple(outcome for outcome in self.outcomes if outcome.state == state)


@dataclass(frozen=True)
class _Unit:
    """A folder with its runs, its model, the mapping by which they are read, and where result and page go."""

    name: str
    folder: Path
    model: str
    runs: tuple[str, ...]
    result: Path
    page: Path | None
    mapping: str | None

    @property
    def inputs(self) -> list[str]:
        """Files of which the result is made."""
        return [self.model, *self.runs] + ([] if self.mapping is None else [self.mapping])


def diagnose_folder(
    folder: PathLike,
    *,
    out: PathLike,
    model: PathLike | None = None,
    mapping: PathLike | None = None,
    pages: bool = False,
    executor: Executor | None = None,
    jobs: int | None = None,
    progress: Progress | None = None,
) -> Batch:
    """Diagnose every unit of a folder, except those whose result is there already.

    A unit is a subfolder with ``model.toml`` and one or more ``*.csv`` runs; with a mapping, runs of any format that
    `load_run` reads, by the ending of their name.  With a `model`, a subfolder with runs and no ``model.toml`` is a
    unit too, of that model.  Its result is ``OUT/<unit>.json``, as ``rverror diagnose --json`` writes it, on disk as
    soon as the unit is done; ``OUT/summary.csv`` lists all units.
    A unit that cannot be diagnosed does not stop the others.

    Parameters
    ----------
    folder : str or path-like
    out : str or path-like
        Folder of the results; made where missing.
    model : str or path-like, optional
        Model file of every unit that has no ``model.toml`` of its own.
    mapping : str or path-like, optional
        How the bench names its columns, for all units.
    pages : bool
        Whether each unit gets its page ``OUT/<unit>.html``, and all ``OUT/summary.html``, undiagnosed units first.
        A result whose page is missing or of another result is made again.
    executor : concurrent.futures.Executor, optional
        Where the work is done; it stays open.  Its workers read the files of `folder` themselves, under its absolute
        path.  Left out, one process for each core of this machine, with one BLAS thread each.
    jobs : int, optional
        Number of processes where no executor is given.
    progress : callable, optional
        Called with a line of text as units are done.

    Returns
    -------
    Batch

    Raises
    ------
    InputError
        If the folder holds no unit, the model or the mapping cannot be used, or the results cannot be written; what is
        wrong with one unit is in its outcome.

    Notes
    -----
    A result is kept if names and SHA-256 of its model, runs and mapping and the version of rverror are those that it
    states.  One of other inputs is replaced.

    The processes start afresh and import the script that called: a script needs ``if __name__ == "__main__":``.
    """
    tell = progress or (lambda text: None)
    if jobs is not None and jobs < 1:
        raise InputError(f"jobs: {jobs} processes cannot work; give 1 or more")
    root = Path(folder) if executor is None else Path(folder).absolute()  # workers elsewhere have another folder
    target = Path(out)
    if mapping is not None and Path(mapping).name == MODEL:
        raise InputError(f"{mapping}: this is the name of a unit's model; give the mapping another")
    both = _of_all(model, load_model, executor), _of_all(mapping, load_mapping, executor)
    units, notes = _units(root, target, *both, pages=pages)
    for unit in units:
        if target.resolve().is_relative_to(unit.folder.resolve()):
            raise InputError(f"{out}: the results would lie in the folder of unit {unit.name}; choose another folder")
    make_folder(target, "choose another")
    _check_nothing_is_lost(target, units)
    for note in notes:
        tell(note)

    outcomes = {unit.name: outcome for unit in units if (outcome := _earlier(unit)) is not None}
    todo = [unit for unit in units if unit.name not in outcomes]
    if replaced := sum(os.path.lexists(unit.result) for unit in todo):
        tell(f"{replaced} of {len(units)} units: earlier results, of other inputs or another version, are replaced")
    if outcomes:
        tell(f"{len(outcomes)} of {len(units)} units: results of the same inputs and version are there and kept")
    if todo:
        count = min(jobs or cores(), len(todo), _MOST_WORKERS)
        with processes(count) if executor is None else nullcontext(executor) as pool:
            outcomes |= _work(pool, todo, tell)

    from rverror.views.report import to_csv, to_html  # all kinds of results

    batch = Batch(tuple(outcomes[unit.name] for unit in units), notes, root.resolve().name)
    write_file(target / SUMMARY, to_csv(batch), overwrite=True)
    if pages:
        urgent = sorted(batch.outcomes, key=lambda each: (_URGENCY.get(each.verdict, 0), each.unit))
        write_file(target / OVERVIEW, to_html(replace(batch, outcomes=tuple(urgent))), overwrite=True)
    return batch


def _of_all(path: PathLike | None, load: Callable[[PathLike], object], executor: Executor | None) -> str | None:
    """Path of a file for every unit, whose folder may be another where the workers are; refused before any work."""
    if path is None:
        return None
    check_name(path)
    load(path)
    return os.fspath(path) if executor is None else str(Path(path).absolute())


def _units(
    root: Path, out: Path, model: str | None, mapping: str | None, *, pages: bool
) -> tuple[tuple[_Unit, ...], tuple[str, ...]]:
    """Units of a folder in the order of their names, and a note for each subfolder with runs but no model."""
    found, notes = [], []
    for path, runs in folders_of_runs(root, ".csv" if mapping is None else RUN_SUFFIXES).items():
        name = path.name if is_printable(path.name) else ascii(path.name)
        summary, has_model = path / SUMMARY, (path / MODEL).is_file()
        results = path.resolve() == out.resolve() or (summary.is_file() and _OWN_SUMMARY in read_text(summary))
        own = str(path / MODEL) if has_model else model
        if has_model or (own and runs and not results):
            page = out / f"{path.name}.html" if pages else None
            found.append(_Unit(name, path, str(own), runs, out / f"{path.name}.json", page, mapping))
        elif runs and not results:
            notes.append(f"{name}: left out, for it holds runs but no {MODEL}; --model gives one for all")
    if not found:
        what = f"no subfolder holds a {MODEL}" + ("" if model is None else ", nor any run")
        raise InputError(f"{root}: {what}; give a folder with one subfolder for each unit")
    return tuple(found), tuple(notes)


def _check_nothing_is_lost(out: Path, units: Sequence[_Unit]) -> None:
    """Refuse to write over what no batch has written."""
    pages = [unit.page for unit in units if unit.page is not None]
    if out / OVERVIEW in pages:
        raise InputError(f"{out / OVERVIEW}: the overview and a unit's page have one name; rename the unit's folder")
    marks = {out / SUMMARY: _OWN_SUMMARY} | dict.fromkeys([*pages, out / OVERVIEW] if pages else [], _OWN_PAGE)
    for path, mark in marks.items():
        if os.path.lexists(path) and mark not in read_text(path):
            raise InputError(f"{path}: no batch has written this file; rename it or choose another folder")


def _earlier(unit: _Unit) -> UnitOutcome | None:
    """Outcome of an earlier result with the same inputs and version, and its page where one is asked for."""
    try:
        data = json.loads(read_text(unit.result))
        files = {Path(f["path"]).name: f["sha256"] for f in data["files"]}
        now = {Path(f.path).name: f.sha256 for f in input_files(unit.inputs)}
        page = "" if unit.page is None else read_text(unit.page)
        outcome = replace(_outcome(unit, data), state="kept")
    except (InputError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return None  # no result, or of inputs that cannot be read any more
    # the page is of that result if it has its version and inputs
    same_page = unit.page is None or all(word in page for word in (__version__, *files.values()))
    return outcome if same_page and data["version"] == __version__ and files == now else None


def _outcome(unit: _Unit, data: Mapping[str, Any]) -> UnitOutcome:
    """Outcome from the content of a result."""
    sizes = [data[part][f"heldout_rms_{data['suffix']}"] for part in ("before", "after")]
    before, after = (None if size is None else float(size) for size in sizes)
    keys = tuple(str(addition["key"]) for addition in data["added"])
    return UnitOutcome(unit.name, "diagnosed", str(data["verdict"]), keys, before, after, str(data["unit"]))


def _diagnose_unit(unit: _Unit) -> _Answer:
    """Work of one task; never raises, since not every exception survives the way back from another process."""
    start = time.perf_counter()
    outcome, content, page = UnitOutcome(unit.name, "failed"), "", ""
    try:
        if not unit.runs:
            raise InputError(f"{unit.folder}: no run beside the model; add one or more *.csv")
        for path in unit.inputs:
            check_name(path)
        # Hashed before they are read: a file that changes meanwhile leaves a hash that no longer fits, and is redone.
        files = input_files(unit.inputs)
        model = load_model(unit.model)
        found = diagnose(model, [read_run(path, model, unit.mapping) for path in unit.runs])
        if unit.page is not None:
            from rverror.views.report import to_html  # all kinds of results, for this option alone

            page = to_html(found, files=files)
        data = enveloped(diagnosis_content(found), files)
        outcome, content = _outcome(unit, data), json.dumps(data, indent=1) + "\n"
    except (InputError, NotConvergedError) as problem:
        outcome = replace(outcome, error=" ".join(str(problem).split()))
    except Exception as problem:  # a fault of the program: one unit of a night's work must not take the others along
        error = f"{unit.folder}: {type(problem).__name__}: {problem}; report it with the files of the unit"
        outcome = replace(outcome, error=" ".join(error.split()))
    return replace(outcome, seconds=time.perf_counter() - start), content, page


def _work(executor: Executor, units: Sequence[_Unit], tell: Progress) -> dict[str, UnitOutcome]:
    """Diagnose units and write each result as it comes, so that an interrupted batch loses only what was under way."""
    outcomes = dict[str, UnitOutcome]()
    pending = dict[Future[_Answer], _Unit]()
    try:
        for unit in units:
            try:
                pending[executor.submit(_diagnose_unit, unit)] = unit
            except BrokenExecutor as problem:
                outcomes[unit.name] = UnitOutcome(unit.name, "failed", error=_lost(problem))
        for done, future in enumerate(as_completed(pending), start=1):
            unit = pending[future]
            outcomes[unit.name] = _finish(unit, future)
            tell(f"{done} of {len(units)} units: {one_line(outcomes[unit.name])}")
    finally:
        for future in pending:
            future.cancel()
    return outcomes


def _finish(unit: _Unit, future: Future[_Answer]) -> UnitOutcome:
    """Write the result of a unit."""
    try:
        outcome, content, page = future.result()
    except Exception as problem:  # of the executor: a worker killed, a cluster gone, a version that differs there
        return UnitOutcome(unit.name, "failed", error=_lost(problem))
    try:
        for path, text in ((unit.page, page), (unit.result, content)):
            if path is not None and content:
                write_file(path, text, overwrite=True)
    except InputError as problem:
        return UnitOutcome(unit.name, "failed", error=str(problem), seconds=outcome.seconds)
    return outcome


def _lost(problem: Exception) -> str:
    kind = f"{type(problem).__name__}: {problem}".rstrip(": .")
    remedy = 'start again, with fewer jobs if memory ran out; a script needs an `if __name__ == "__main__":`'
    return " ".join(f"the worker was lost ({kind}); {remedy}".split())


def one_line(outcome: UnitOutcome) -> str:
    """Outcome in one line."""
    if outcome.state == "failed":
        return f"{outcome.unit}: failed: {outcome.error}"
    parts = [outcome.verdict.replace("_", " ")]
    if outcome.keys:
        parts.append(", ".join(outcome.keys))
    if outcome.before is not None and outcome.after is not None:
        parts.append(f"held-out rms {outcome.before:.3g} -> {outcome.after:.3g} {outcome.rms_unit}")
    parts.append("kept" if outcome.seconds is None else f"{outcome.seconds:.1f} s")
    return f"{outcome.unit}: {'; '.join(parts)}"


#: What the overview tells after the units that failed.
_URGENCY = {"unexplained": 1, "explained": 2, "nothing_missing": 3}


@described.register
def _batch_table(result: Batch) -> Table:
    """What failed, and units in a row, each with the way to its page."""
    words = [(one.verdict or one.state).replace("_", " ") for one in result.outcomes]
    counts = ", ".join(f"{words.count(word)} {word}" for word in dict.fromkeys(words))
    columns = rows(
        "unit",
        result.outcomes,
        **same_unit(None, "unit", "state", "verdict", "keys"),
        heldout_rms_before=("before", NUMBER),
        heldout_rms_after=("after", NUMBER),
        rms_unit=None,
        seconds=(lambda one: one.seconds and round(one.seconds, 2), TIME),
        error=None,
    )
    return Table(
        columns,
        about(result, "notes"),
        title=(result.folder, f"{count_of(len(result.outcomes), 'unit')}, rverror {__version__}"),
        verdict=(counts, "."),
        facts={one.unit: one.error for one in result.of("failed")},
        sentences=(
            "Held-out rms: residual of stretches that no fit saw, of the declared model and with the causes added.",
        ),
        shown={"unit": ("unit", "state", "verdict", "keys", "heldout_rms_before", "heldout_rms_after", "rms_unit")},
        links=["" if one.state == "failed" else f"{quote(one.unit)}.html" for one in result.outcomes],
    )


def _begin_work() -> None:
    """Begin a worker; an interrupt is for the parent, which ends the workers: each would print a traceback."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    keep_freed_memory()


@contextmanager
def processes(count: int) -> Iterator[Executor]:
    """Fresh processes that inherit one thread: forked ones would have numpy loaded with all its threads.

    Workers that each take all cores slow one another down.
    """
    names = (*BLAS_THREADS, KERNEL_THREADS)
    before = {name: os.environ[name] for name in names if name in os.environ}
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(count, mp_context=context, initializer=_begin_work)
    try:
        os.environ.update(dict.fromkeys(names, "1"))  # workers start while tasks are handed in
        yield pool
    finally:
        pool.shutdown(cancel_futures=True)
        for name in names:
            os.environ.pop(name, None)
        os.environ.update(before)
