"""Statistics of very many virtual units: drawn in chunks by any executor, resumed where they were left.

Page ``theory/virtual-units.md``.
"""

from __future__ import annotations

import hashlib
import io
import math
import os
import zipfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from dataclasses import dataclass, fields, is_dataclass, replace
from pathlib import Path
from typing import Any, Literal, TypeVar

import numpy as np
import numpy.typing as npt
import scipy

from rverror.base.arrays import Array
from rverror.base.chance import student
from rverror.base.directions import Direction
from rverror.base.errors import InputError, renamed
from rverror.base.text import PathLike, write_bytes
from rverror.base.units import named_core
from rverror.base.version import __version__
from rverror.base.viewed import Viewed
from rverror.model.effects import Model
from rverror.tolerances.declared import Tolerance
from rverror.tolerances.extremes import TOLERANCE, Extremes, Kernel, kernel
from rverror.tolerances.stacking import Stack, laid_out

Result = TypeVar("Result")
Draws = Literal["sobol", "random"]
Size = Literal["peak_to_peak", "max", "rms", "offset"]

#: Virtual units where no number is given.
COUNT = 2**16
#: Most variates of a unit for which there are direction numbers of Sobol sequences.
MOST_SOBOL_DIMENSIONS = 21201

_LONGEST_CHUNK = 2**14
_REPLICATES = 12  # chunks that a job has at least, where it has enough units: their scatter makes intervals
_STEP = 1024  # units drawn at a time
_CELL = 2.0**-30  # distance of neighbouring Sobol points
IN_FLIGHT = 64  # chunks handed to an executor at a time
_SIZES = ("peak_to_peak", "max", "rms", "offset")
_FORMAT = 1  # of the chunk files


@dataclass(frozen=True)
class IntervalEstimate:
    """A quantile or a yield with its intervals."""

    value: float  #: from all units together
    #: Lower end of the interval that counts the units as independent, or of that of the scrambles where it reaches
    #: farther.  Where there are too few units the ends are infinite, the lower one of a quantile 0.
    low: float
    high: float  #: upper end
    scramble_low: float  #: from the scatter of the chunks, each a scramble of its own; nan where there is one chunk
    scramble_high: float  #: upper end


@dataclass(frozen=True)
class VirtualUnits(Viewed):
    """Sizes of the output error of many virtual units.

    Attributes
    ----------
    peak_to_peak, max, rms, offset : ndarray, shape (units,)
        rad, as in `Extremes`.
    chunk : int
        Units of each chunk; the last may be shorter.
    draws : str
        ``sobol`` or ``random``.
    seed : int
    error_bound : float
        rad; no peak-to-peak is off by more, of waves left out and of rounding.
    kept : int
        Chunks that were there from an earlier call.
    """

    peak_to_peak: Array
    max: Array
    rms: Array
    offset: Array
    chunk: int
    draws: Draws
    seed: int
    error_bound: float
    kept: int

    @property
    def count(self) -> int:
        """Number of units."""
        return self.peak_to_peak.size

    def quantile(self, probability: float, of: Size = "peak_to_peak", *, confidence: float = 0.95) -> IntervalEstimate:
        """Size that so large a share of the units does not exceed, rad.

        Parameters
        ----------
        probability : float
            Between 0 and 1: 0.99 for P99.
        of : str
            ``peak_to_peak``, ``max``, ``rms`` or ``offset``.
        confidence : float
            Of the intervals.

        Raises
        ------
        InputError
            If a probability is not between 0 and 1.

        Notes
        -----
        ``low`` and ``high`` are order statistics x_(l), x_(u) with P(K < l) and P(K >= u) at most half of what the
        confidence leaves, K binomial; or the pooled quantiles at ``probability`` +- (t sigma + 1 / units), sigma from
        the scatter of the chunks (Woodruff 1952), where these reach farther.
        """
        check_share("probability", probability)
        check_share("confidence", confidence)
        sizes = getattr(self, of)
        value = float(np.quantile(sizes, probability))
        ends = order_statistics(np.sort(sizes), probability, confidence)
        low, high = (ends.low if of == "offset" else max(ends.low, 0.0)), ends.high
        margin = self._scatter(sizes <= value, confidence) + 1 / self.count  # no share is known to less than a unit
        shares = np.clip([probability - margin, probability + margin], 0, 1)
        scramble = [math.nan] * 2 if math.isnan(margin) else np.quantile(sizes, shares).tolist()
        return IntervalEstimate(value, min(low, *scramble), max(high, *scramble), *scramble)

    def yield_at(self, limit: Any, of: Size = "peak_to_peak", *, confidence: float = 0.95) -> IntervalEstimate:
        """Share of the units that do not exceed a limit: rad, a string such as ``"60 arcsec"`` or a quantity.

        Notes
        -----
        `of` and `confidence` as for `quantile`.  ``low`` and ``high`` are those of Clopper and Pearson, or of Student
        from the scatter of the chunks, where these reach farther.
        """
        check_share("confidence", confidence)
        within = getattr(self, of) <= named_core("limit", limit, "angle")
        good = int(within.sum())
        low, high = share_interval(good, self.count, confidence)
        value, margin = good / self.count, self._scatter(within, confidence)
        scramble = [math.nan] * 2 if math.isnan(margin) else np.clip([value - margin, value + margin], 0, 1).tolist()
        return IntervalEstimate(value, min(low, *scramble), max(high, *scramble), *scramble)

    def _scatter(self, hits: npt.NDArray[np.bool_], confidence: float) -> float:
        """Half the width of the interval of a share of the units, from its scatter between the chunks."""
        starts = np.arange(0, self.count, self.chunk)
        chunks = starts.size
        if chunks < 2:
            return math.nan
        lengths = np.diff(starts, append=self.count)
        differences = np.add.reduceat(hits.astype(np.float64), starts) - lengths * hits.mean()
        variance = chunks / (chunks - 1) * float((differences**2).sum()) / self.count**2
        return student((1 - confidence) / 2, chunks - 1) * math.sqrt(variance)


@dataclass(frozen=True)
class Sampler:
    """What turns uniform variates into sizes: all that a worker needs of a stack, without its long arrays."""

    stack: Stack  #: draws, and has neither samples nor components
    kernel: Kernel

    def sizes(self, uniforms: Array) -> tuple[Extremes, float]:
        """Sizes of units by variates, shape (units, dimensions), and the largest bound on their peak-to-peaks; rad."""
        values = self.stack.standard(uniforms)
        return self.kernel.extremes(values), float(self.kernel.bound(values).max(initial=0.0))


def sampler(stack: Stack, tolerance: float = TOLERANCE) -> Sampler:
    """Make a stack ready for very many units; the tolerance as for `virtual_units`."""
    ready = kernel(stack.scaled(), stack.nominal, tolerance=tolerance)
    no_samples = np.empty((stack.influence.shape[0], 0))
    return Sampler(replace(stack, nominal=np.empty(0), influence=no_samples, components=(), theta=None), ready)


@dataclass(frozen=True)
class _Chunks:
    """What a worker needs: how units are drawn and sized, and how they are cut into chunks."""

    sampler: Sampler
    count: int
    chunk: int
    seed: int
    draws: Draws

    @property
    def chunks(self) -> int:
        """Number of chunks."""
        return -(-self.count // self.chunk)

    def span(self, index: int) -> slice:
        """Units of a chunk."""
        return slice(index * self.chunk, min((index + 1) * self.chunk, self.count))

    def __call__(self, index: int) -> tuple[Array, float]:
        """Sizes of one chunk, shape (4, units), and the bound on their error."""
        span = self.span(index)
        sizes = np.empty((len(_SIZES), span.stop - span.start))
        bound, done = 0.0, 0
        dimensions = self.sampler.stack.dimensions
        for block in uniforms(sizes.shape[1], dimensions, seed=self.seed, index=index, draws=self.draws):
            part, off = self.sampler.sizes(block)
            for row, name in zip(sizes, _SIZES, strict=True):
                row[done : done + len(block)] = getattr(part, name)
            bound, done = max(bound, off), done + len(block)
        return sizes, bound


@renamed(speed="input_speed")
def virtual_units(
    model: Model | Stack,
    tolerances: Sequence[Tolerance] | int | None = None,
    theta: Any | None = None,
    *,
    direction: Direction = "forward",
    torque: Any | None = None,
    input_speed: Any | None = None,
    count: int | None = None,
    seed: int = 0,
    executor: Executor | None = None,
    folder: PathLike | None = None,
    draws: Draws = "sobol",
    tolerance: float = TOLERANCE,
    progress: Callable[[str], None] | None = None,
) -> VirtualUnits:
    """Draw virtual units of a model and its tolerances, and compute the sizes of their output errors.

    Parameters
    ----------
    model : Model or Stack
        A stack, of `rverror.tolerances.stack`, stands for model, tolerances and how they are asked; the number of
        units may then stand second.
    tolerances : sequence of Tolerance
    theta, direction, torque, input_speed
        As for `rverror.tolerances.stack`.
    count : int
        Number of units; `COUNT` where left out.
    seed : int
        0 or more; another one gives independent units.
    executor : concurrent.futures.Executor, optional
        Where the chunks are computed: threads, processes, Dask's ``client.get_executor()``; it stays open.  Left out:
        in this process, one after another.  The numbers are the same in all cases, bit for bit.
    folder : str or path-like, optional
        Where each chunk is written as soon as it is done; made where missing.  Called again after an interruption,
        with the same stack and settings, what is there is not computed again.
    draws : str
        ``sobol``: quasi-random units, up to 21201 variates each.  ``random``: plain random ones.
    tolerance : float
        Bound on the error that small waves left out may make of a peak-to-peak, rad; 0 leaves none out.
    progress : callable, optional
        Called with a line of text after each chunk.

    Returns
    -------
    VirtualUnits

    Raises
    ------
    InputError
        If a setting is unusable, the folder holds other files or chunks of another stack, settings or version, or the
        workers are lost.

    Notes
    -----
    Memory: the results, a few numbers for each unit, and in each worker the waveforms and a block of units.

    The work is many small matrix products, for which BLAS threads wait on one another, on a busy machine for most of
    the time: start Python with ``OMP_NUM_THREADS=1`` and give more workers instead.

    Examples
    --------
    >>> import rverror
    >>> from rverror.tolerances.declared import tolerance
    >>> from rverror.base.units import ARCSEC
    >>> unit, cams = rverror.Model(rverror.reducer("RV-40E")), [tolerance("crank.eccentricity", "5 um")]
    >>> units = virtual_units(unit, cams, count=2000)
    >>> p95 = units.quantile(0.95)
    >>> print(f"{p95.value / ARCSEC:.0f} arcsec")
    26 arcsec

    The same, of what is laid out already:

    >>> same = virtual_units(rverror.tolerances.stack(unit, cams), 2000)
    >>> bool((same.peak_to_peak == units.peak_to_peak).all())
    True
    """
    if isinstance(tolerances, int):
        count, tolerances = tolerances, None
    count = COUNT if count is None else count
    stack = laid_out(model, tolerances, theta, direction=direction, torque=torque, input_speed=input_speed)
    if count < 1:
        raise InputError(f"count = {count}: no unit to draw; give 1 or more")
    check_seed(seed)
    _check_draws(draws, stack.dimensions)
    job = _Chunks(sampler(stack, tolerance), int(count), chunk_length(count), int(seed), draws)
    store = None if folder is None else _Store(Path(folder), _digest(stack, job, tolerance), job)
    results = np.empty((len(_SIZES), job.count))
    bound = 0.0
    missing = []
    for index in range(job.chunks):
        found = None if store is None else store.read(index)
        if found is None:
            missing.append(index)
            continue
        results[:, job.span(index)] = found[0]
        bound = max(bound, found[1])
    chunks = computed(job, missing, executor)
    for index, (sizes, off) in told(chunks, progress, f"{job.count} virtual units", len(missing)):
        if store is not None:
            store.write(index, sizes, off)
        results[:, job.span(index)] = sizes
        bound = max(bound, off)
    peak_to_peak, largest, rms, offset = results
    return VirtualUnits(
        peak_to_peak,
        largest,
        rms,
        offset,
        chunk=job.chunk,
        draws=draws,
        seed=job.seed,
        error_bound=bound,
        kept=job.chunks - len(missing),
    )


def uniforms(count: int, dimensions: int, *, seed: int, index: int, draws: Draws = "sobol") -> Iterator[Array]:
    """Uniform variates of one chunk, a block at a time: between 0 and 1, never 0 or 1.

    Parameters
    ----------
    count : int
        Units of the chunk.
    dimensions : int
        Variates of a unit.
    seed, index : int
        0 or more; the variates depend on these alone.
    draws : str
        ``sobol``: the first points of a Sobol sequence with a scramble of its own, each in the middle of its cell of
        2**-30.  ``random``: plain random numbers.

    Yields
    ------
    ndarray, shape (units, dimensions)
    """
    _check_draws(draws, dimensions)
    rng = np.random.default_rng(np.random.SeedSequence(entropy=seed, spawn_key=(index,)))
    sobol = draws == "sobol" and dimensions
    points = scipy.stats.qmc.Sobol(dimensions, scramble=True, bits=30, seed=rng) if sobol else None
    for start in range(0, count, _STEP):
        rows = min(_STEP, count - start)
        if points is None:
            yield np.maximum(rng.random((rows, dimensions)), 2.0**-54)
        else:
            whole = 1 << (rows - 1).bit_length()  # scipy warns of any other number
            yield points.random(whole)[:rows] + _CELL / 2


def _check_draws(draws: str, dimensions: int) -> None:
    if draws not in ("sobol", "random"):
        raise InputError(f"draws = {draws!r}: must be 'sobol' or 'random'")
    if draws == "sobol" and dimensions > MOST_SOBOL_DIMENSIONS:
        raise InputError(
            f"{dimensions} variates a unit: Sobol sequences go up to {MOST_SOBOL_DIMENSIONS}; give draws='random'"
        )


def check_share(name: str, value: float, example: float = 0.95) -> None:
    """Refuse what is no share between 0 and 1."""
    if not 0 < value < 1:
        raise InputError(f"{name} = {value:g}: must lie between 0 and 1, such as {example:g}")


def check_seed(seed: int) -> None:
    """Refuse what seeds nothing."""
    if seed < 0:
        raise InputError(f"seed = {seed}: must be 0 or more")


def order_statistics(ordered: Array, probability: float, confidence: float) -> IntervalEstimate:
    """Quantile of independent numbers in rising order, with the interval that holds whatever their distribution is.

    ``low`` and ``high`` are x_(l), x_(u) with P(K < l) and P(K >= u) at most half of what the confidence leaves, K
    binomial; infinite where there are too few numbers.
    """
    count, tail = ordered.size, (1 - confidence) / 2
    # the least l with P(K <= l) above the tail
    below, above = (int(scipy.stats.binom.ppf(share, count, probability)) for share in (tail, 1 - tail))
    above += 1
    low = float(ordered[below - 1]) if below else -math.inf
    high = float(ordered[above - 1]) if above <= count else math.inf
    return IntervalEstimate(float(np.quantile(ordered, probability)), low, high, math.nan, math.nan)


def share_interval(good: float, count: float, confidence: float) -> tuple[float, float]:
    """Interval of a share of which so many of so many units were seen, of Clopper and Pearson."""
    tail = (1 - confidence) / 2
    low = float(scipy.special.betaincinv(good, count - good + 1, tail)) if good > 0 else 0.0
    high = float(scipy.special.betaincinv(good + 1, count - good, 1 - tail)) if good < count else 1.0
    return low, high


def chunk_length(count: int) -> int:
    """Largest power of two that leaves enough chunks, within limits."""
    return min(_LONGEST_CHUNK, 1 << max(4, (max(1, count // _REPLICATES)).bit_length() - 1))


def computed(
    task: Callable[[int], Result], indices: Iterable[int], executor: Executor | None
) -> Iterator[tuple[int, Result]]:
    """Results of a task for each index as they are done, in any order, no more than a few handed out at a time.

    The task must pickle where the executor has other processes; without an executor it runs in this one.  Workers that
    are lost are an InputError.
    """
    if executor is None:
        for index in indices:
            yield index, task(index)
        return
    waiting = iter(indices)
    pending: dict[Future[Result], int] = {}
    try:
        while True:
            for index in waiting:
                pending[executor.submit(task, index)] = index
                if len(pending) >= IN_FLIGHT:
                    break
            if not pending:
                return
            for future in wait(pending, return_when=FIRST_COMPLETED).done:
                yield pending.pop(future), future.result()
    except BrokenExecutor as problem:
        raise InputError(
            f"the workers were lost ({type(problem).__name__}: {problem}); start again, with fewer if memory ran out; "
            'what is in folder= is kept; a script needs an `if __name__ == "__main__":`'
        ) from problem
    finally:
        for future in pending:
            future.cancel()


def told(results: Iterable[Result], progress: Callable[[str], None] | None, what: str, number: int) -> Iterator[Result]:
    """Results as they come; how many of so many there are is told after each."""
    for done, result in enumerate(results, 1):
        if progress is not None:
            progress(f"{what}: {100 * done / number:.0f} %")
        yield result


@dataclass(frozen=True)
class _Store:
    """Folder of a job: a file for each chunk that is done, which states what job it belongs to."""

    folder: Path
    digest: str
    job: _Chunks

    def __post_init__(self) -> None:
        """Make the folder, or check that it holds nothing but chunks."""
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            names = {entry.name for entry in self.folder.iterdir() if not entry.name.startswith(".")}
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or error
            raise InputError(f"{self.folder}: cannot use the folder ({reason}); choose another") from error
        if not os.access(self.folder, os.W_OK):
            raise InputError(f"{self.folder}: no permission to write in it; choose another folder")
        foreign = sorted(names - {self.path(index).name for index in range(self.job.chunks)})
        if foreign:
            raise InputError(f"{self.folder}: {foreign[0]!r} is no chunk of these units; choose an empty folder")

    def path(self, index: int) -> Path:
        """File of a chunk."""
        return self.folder / f"units-{index:06d}.npz"

    def read(self, index: int) -> tuple[Array, float] | None:
        """Chunk from its file; None where there is none, or half of one."""
        path = self.path(index)
        try:
            raw = path.read_bytes()
        except FileNotFoundError:
            return None
        except OSError as error:
            raise InputError(f"{path}: cannot read the chunk ({error.strerror}); remove it") from error
        try:
            with np.load(io.BytesIO(raw), allow_pickle=False) as file:
                digest, sizes, bound = str(file["job"]), file["sizes"], float(file["bound"])
        except (EOFError, ValueError, KeyError, IndexError, TypeError, zipfile.BadZipFile) as error:
            if raw[:2] in (b"", b"PK") and not isinstance(error, KeyError):
                return None  # half of a file: a full disk, or a copy that was cut short
            raise InputError(f"{path}: this is no chunk of virtual units; choose an empty folder") from error
        if digest != self.digest:
            raise InputError(
                f"{path}: made from another stack, count, seed or version; choose an empty folder or remove the chunks"
            )
        return sizes, bound

    def write(self, index: int, sizes: Array, bound: float) -> None:
        """Write a chunk in one step."""
        content = io.BytesIO()
        np.savez(content, job=np.array(self.digest), sizes=sizes, bound=np.array(bound))
        write_bytes(self.path(index), content.getvalue(), overwrite=True)


def _digest(stack: Stack, job: _Chunks, tolerance: float) -> str:
    """SHA-256 of all that the numbers depend on."""
    versions = (_FORMAT, __version__, np.__version__, scipy.__version__)
    settings = (job.count, job.chunk, job.seed, job.draws, tolerance)
    sha = hashlib.sha256()
    arrays = (stack.nominal, stack.influence, stack.entry, stack.width, stack.blocks, stack.dependence)
    for piece in _pieces((versions, settings, *arrays)):
        sha.update(len(piece).to_bytes(8, "little") + piece)
    return sha.hexdigest()


def _pieces(thing: object) -> Iterator[bytes]:
    """Content of arrays, tuples, dataclasses and plain values."""
    if isinstance(thing, np.ndarray):
        yield f"{thing.dtype.str}{thing.shape}".encode()
        yield np.ascontiguousarray(thing).tobytes()
    elif isinstance(thing, tuple):
        yield f"tuple {len(thing)}".encode()
        for part in thing:
            yield from _pieces(part)
    elif is_dataclass(thing):
        yield type(thing).__qualname__.encode()
        yield from _pieces(tuple((field.name, getattr(thing, field.name)) for field in fields(thing)))
    else:
        yield repr(thing).encode()
