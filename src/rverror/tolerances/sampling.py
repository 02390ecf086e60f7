"""Statistics of very many virtual units: drawn in chunks by any executor, resumed where they were left.

Page ``theory/virtual-units.md``.
"""

from __future__ import annotations

import hashlib
import io
import math
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeVar

import numpy as np
import scipy

from rverror.base.arrays import Array
from rverror.base.errors import InputError, check_kind
from rverror.base.progress import Progress
from rverror.base.text import PathLike, write_file
from rverror.base.units import named_core
from rverror.base.version import __version__
from rverror.base.viewed import Viewed
from rverror.tolerances.extremes import Extremes, Kernel, kernel
from rverror.tolerances.stacking import Stack

Result = TypeVar("Result")
Size = Literal["peak_to_peak", "max", "rms", "offset"]

#: Virtual units where no number is given.
COUNT = 2**16
#: Most variates of a unit for which there are direction numbers of Sobol sequences.
MOST_SOBOL_DIMENSIONS = 21201

_LONGEST_CHUNK = 2**14
_CHUNKS = 12  # that a job has at least, where it has enough units: as many workers share it
_STEP = 1024  # units drawn at a time
_CELL = 2.0**-30  # distance of neighbouring Sobol points


class IntervalEstimate(NamedTuple):
    """A quantile or a yield with its interval."""

    value: float
    low: float  #: lower end, of units that count as independent; infinite where there are too few of them
    high: float  #: upper end


@dataclass(frozen=True)
class VirtualUnits(Viewed):
    """Sizes of the output error of many virtual units.

    Attributes
    ----------
    peak_to_peak, max, rms, offset : ndarray, shape (units,)
        rad, as in `Extremes`.
    seed : int
    kept : int
        Chunks that were there from an earlier call.
    """

    peak_to_peak: Array
    max: Array
    rms: Array
    offset: Array
    seed: int
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
            Of the interval.

        Raises
        ------
        InputError
            If a probability is not between 0 and 1.

        Notes
        -----
        Quasi-random units scatter less than the independent ones for which the interval holds.
        """
        check_share("probability", probability)
        check_share("confidence", confidence)
        found = order_statistics(np.sort(getattr(self, of)), probability, confidence)
        return found if of == "offset" else found._replace(low=max(found.low, 0.0))

    def yield_at(self, limit: Any, of: Size = "peak_to_peak", *, confidence: float = 0.95) -> IntervalEstimate:
        """Share of the units that do not exceed a limit: rad, a string such as ``"60 arcsec"`` or a quantity.

        `of` and `confidence` as for `quantile`; the interval is that of Clopper and Pearson.
        """
        check_share("confidence", confidence)
        good = int((getattr(self, of) <= named_core("limit", limit, "angle")).sum())
        return IntervalEstimate(good / self.count, *share_interval(good, self.count, confidence))


@dataclass(frozen=True)
class Sampler:
    """What turns uniform variates into sizes: all that a worker needs of a stack, without its long arrays."""

    stack: Stack  #: draws, and has neither samples nor components
    kernel: Kernel

    def sizes(self, uniforms: Array) -> Extremes:
        """Sizes of units by variates, shape (units, dimensions); rad."""
        return self.kernel.extremes(self.stack.standard(uniforms))


def sampler(stack: Stack) -> Sampler:
    """Make a stack ready for very many units."""
    ready = kernel(stack.scaled(), stack.nominal)
    no_samples = np.empty((stack.influence.shape[0], 0))
    return Sampler(replace(stack, nominal=np.empty(0), influence=no_samples, components=(), theta=None), ready)


@dataclass(frozen=True)
class _Chunks:
    """What a worker needs: how units are drawn and sized, and how they are cut into chunks."""

    sampler: Sampler
    count: int
    chunk: int
    seed: int

    @property
    def chunks(self) -> int:
        """Number of chunks."""
        return -(-self.count // self.chunk)

    def span(self, index: int) -> slice:
        """Units of a chunk."""
        return slice(index * self.chunk, min((index + 1) * self.chunk, self.count))

    def __call__(self, index: int) -> Array:
        """Sizes of one chunk, those of `Extremes`, shape (4, units)."""
        span, dimensions = self.span(index), self.sampler.stack.dimensions
        blocks = uniforms(span.stop - span.start, dimensions, seed=self.seed, index=index)
        return np.concatenate([self.sampler.sizes(block) for block in blocks], axis=1)


def virtual_units(
    stack: Stack,
    count: int = COUNT,
    *,
    seed: int = 0,
    executor: Executor | None = None,
    folder: PathLike | None = None,
    progress: Progress | None = None,
) -> VirtualUnits:
    """Draw virtual units of a model and its tolerances, and compute the sizes of their output errors.

    Parameters
    ----------
    stack : Stack
        Of `rverror.tolerances.stack`.
    count : int
        Number of units.
    seed : int
        0 or more; another one gives independent units.
    executor : concurrent.futures.Executor, optional
        Where the chunks are computed: threads, processes, Dask's ``client.get_executor()``; it stays open.  Left out:
        in this process, one after another.  The numbers are the same in all cases, bit for bit.
    folder : str or path-like, optional
        Where each chunk is written as soon as it is done; made where missing.  Called again after an interruption,
        with the same stack and settings, what is there is not computed again.
    progress : callable, optional
        Called with a line of text after each chunk.

    Returns
    -------
    VirtualUnits

    Raises
    ------
    InputError
        If a setting is unusable, the folder cannot be written, or the workers are lost.

    Notes
    -----
    Memory: the results, a few numbers for each unit, and in each worker the waveforms and a block of units.

    The work is many small matrix products, for which BLAS threads wait on one another, on a busy machine for most of
    the time: start Python with ``OMP_NUM_THREADS=1`` and give more workers instead.

    Examples
    --------
    >>> import rverror
    >>> from rverror.base.units import ARCSEC
    >>> from rverror.tolerances.stacking import stack
    >>> cams = [rverror.tolerance("crank.eccentricity", "5 um")]
    >>> units = virtual_units(stack(rverror.Model(rverror.reducer("RV-40E")), cams), 2000)
    >>> p95 = units.quantile(0.95)
    >>> print(f"{p95.value / ARCSEC:.0f} arcsec")
    26 arcsec
    """
    check_kind("stack", stack, Stack, "make it with stack(model, tolerances)")
    check_kind("count", count, int, "give a number of units such as 65536")
    if count < 1:
        raise InputError(f"count = {count}: no unit to draw; give 1 or more")
    check_seed(seed)
    job = _Chunks(sampler(stack), int(count), chunk_length(count), int(seed))
    store = None if folder is None else _Store(Path(folder), _digest(stack, job))
    results = np.empty((len(Extremes._fields), job.count))
    missing = []
    for index in range(job.chunks):
        found = None if store is None else store.read(index)
        if found is None:
            missing.append(index)
        else:
            results[:, job.span(index)] = found
    for index, sizes in computed(job, missing, executor, progress, f"{job.count} virtual units"):
        if store is not None:
            store.write(index, sizes)
        results[:, job.span(index)] = sizes
    peak_to_peak, largest, rms, offset = results
    return VirtualUnits(peak_to_peak, largest, rms, offset, job.seed, job.chunks - len(missing))


def uniforms(count: int, dimensions: int, *, seed: int, index: int, plain: bool = False) -> Iterator[Array]:
    """Uniform variates of one chunk, a block at a time: between 0 and 1, never 0 or 1.

    Parameters
    ----------
    count : int
        Units of the chunk.
    dimensions : int
        Variates of a unit.
    seed, index : int
        0 or more; the variates depend on these alone.
    plain : bool
        Plain random numbers, as where there are more variates than Sobol sequences have.  Else the first points of a
        Sobol sequence with a scramble of its own, each in the middle of its cell of 2**-30.

    Yields
    ------
    ndarray, shape (units, dimensions)
    """
    rng = np.random.default_rng(np.random.SeedSequence(entropy=seed, spawn_key=(index,)))
    sobol = not plain and 0 < dimensions <= MOST_SOBOL_DIMENSIONS
    points = scipy.stats.qmc.Sobol(dimensions, scramble=True, bits=30, seed=rng) if sobol else None
    for start in range(0, count, _STEP):
        rows = min(_STEP, count - start)
        if points is None:
            yield np.maximum(rng.random((rows, dimensions)), 2.0**-54)
        else:
            whole = 1 << (rows - 1).bit_length()  # scipy warns of any other number
            yield points.random(whole)[:rows] + _CELL / 2


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
    low = float(ordered[below - 1]) if below else -math.inf
    high = float(ordered[above]) if above < count else math.inf
    return IntervalEstimate(float(np.quantile(ordered, probability)), low, high)


def share_interval(good: float, count: float, confidence: float) -> tuple[float, float]:
    """Interval of a share of which so many of so many units were seen, of Clopper and Pearson."""
    tail = (1 - confidence) / 2
    low = float(scipy.special.betaincinv(good, count - good + 1, tail)) if good > 0 else 0.0
    high = float(scipy.special.betaincinv(good + 1, count - good, 1 - tail)) if good < count else 1.0
    return low, high


def chunk_length(count: int) -> int:
    """Largest power of two that leaves enough chunks, within limits."""
    return min(_LONGEST_CHUNK, 1 << max(4, (max(1, count // _CHUNKS)).bit_length() - 1))


def computed(
    task: Callable[[int], Result],
    indices: Sequence[int],
    executor: Executor | None,
    progress: Progress | None,
    what: str,
) -> Iterator[tuple[int, Result]]:
    """Results of a task for each index, in their order; progress tells after each how many of `what` there are.

    The task must pickle where the executor has other processes; without an executor it runs in this one.  Workers that
    are lost are an InputError.
    """
    try:
        results = map(task, indices) if executor is None else executor.map(task, indices)
        for done, found in enumerate(zip(indices, results, strict=True), 1):
            if progress is not None:
                progress(f"{what}: {100 * done / len(indices):.0f} %")
            yield found
    except BrokenExecutor as problem:
        raise InputError(
            f"the workers were lost ({type(problem).__name__}: {problem}); start again, with fewer if memory ran out; "
            'what is in folder= is kept; a script needs an `if __name__ == "__main__":`'
        ) from problem


@dataclass(frozen=True)
class _Store:
    """Folder of jobs: a file for each chunk that is done, by the digest of its job."""

    folder: Path
    digest: str

    def __post_init__(self) -> None:
        """Make the folder."""
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or error
            raise InputError(f"{self.folder}: cannot use the folder ({reason}); choose another") from error

    def path(self, index: int) -> Path:
        """File of a chunk."""
        return self.folder / f"units-{self.digest}-{index:06d}.npy"

    def read(self, index: int) -> Array | None:
        """Chunk from its file; None where there is none, or half of one."""
        try:
            return np.asarray(np.load(self.path(index), allow_pickle=False), dtype=np.float64)
        except (OSError, ValueError, EOFError):
            return None

    def write(self, index: int, sizes: Array) -> None:
        """Write a chunk in one step."""
        content = io.BytesIO()
        np.save(content, sizes)
        write_file(self.path(index), content.getvalue(), overwrite=True)


def _digest(stack: Stack, job: _Chunks) -> str:
    """Beginning of the SHA-256 of all that the numbers depend on."""
    tied = () if stack.dependence is None else (stack.dependence.factor, stack.dependence.between)
    classes = () if stack.dependence is None else stack.dependence.classes
    said = (__version__, np.__version__, scipy.__version__, job.count, job.seed, stack.rules, classes)
    sha = hashlib.sha256(repr(said).encode())
    for array in (stack.nominal, stack.influence, stack.entry, stack.width, *tied):
        sha.update(repr(array.shape).encode() + np.ascontiguousarray(array).tobytes())
    return sha.hexdigest()[:16]
