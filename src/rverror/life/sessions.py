"""Sessions: the runs of one unit that were measured at one time, as amplitudes of orders and lost motion.

Page ``theory/trend.md``.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.chance import chi_square
from rverror.base.errors import InputError, refusing
from rverror.base.text import shown
from rverror.lots.amplitudes import Amplitudes, LotUnit, condition_of, joined_units, orders_about, split_unit
from rverror.model.effects import Model
from rverror.runs.measurement import Run

#: Header keys that say when a run was measured, with an example; the first that all runs have counts.
CLOCKS = {"hours": "120", "cycles": "2e5", "date": "2026-03-01"}
_NEAR = 16  # orders to either side, at least, whose noise is alike
# steps of amplitudes of which noise is told at least: their lower quartile is known to a sixth then.
_POOLED = 150
_MEDIAN = 0.4549  # of a chi-square of one degree of freedom
#: Sessions of which fewer do not tell how well a zero or a mounting repeats.
FEW = 5


@dataclass(frozen=True)
class Session:
    """Runs of one time.

    Attributes
    ----------
    at : float
        Hours, or cycles; of dates the hours since the first.
    label : str
        As the header has it.
    runs : tuple of Run
        One for each condition.
    """

    at: float
    label: str
    runs: tuple[Run, ...]


def sessions_of(runs: Iterable[Run]) -> tuple[str, tuple[Session, ...]]:
    """Sort the runs of a unit by the time at which they were measured.

    Parameters
    ----------
    runs : iterable of Run
        Each with ``hours``, ``cycles`` or ``date`` in its header, all of them with the same.

    Returns
    -------
    unit : str
        Of the time: ``"hour"`` or ``"cycle"``.
    sessions : tuple of Session
        In the order of time; runs of one time are one session.

    Raises
    ------
    InputError
        If a run does not say when it was measured, or the time cannot be read.

    Examples
    --------
    >>> import numpy as np, rverror
    >>> angle = np.linspace(0, 7, 100)
    >>> made = rverror.run_from_arrays
    >>> runs = [made(input_angle=angle, te=0 * angle, metadata={"hours": text}) for text in ("5", "0", "5")]
    >>> unit, sessions = sessions_of(runs)
    >>> unit, [(one.at, len(one.runs)) for one in sessions]
    ('hour', [(0.0, 1), (5.0, 2)])
    """
    given = list(runs)
    heads = [{key.lower(): value for key, value in run.metadata.items()} for run in given]
    clock = next((name for name in CLOCKS if heads and all(name in head for head in heads)), None)
    if clock is None:
        odd = next((run.path for run, head in zip(given, heads, strict=True) if not head.keys() & set(CLOCKS)), "")
        raise InputError(
            f"{odd or 'runs'}: the header does not say when it was measured; give all runs a line "
            "'# hours: 120', '# cycles: 2e5' or '# date: 2026-03-01'"
        )
    times = [_time(run, clock, head[clock]) for run, head in zip(given, heads, strict=True)]
    first = min(times) if clock == "date" else 0.0
    alike = [[n for n, other in enumerate(times) if other == time] for time in sorted(set(times))]
    sessions = tuple(
        Session(times[some[0]] - first, heads[some[0]][clock], tuple(given[n] for n in some)) for some in alike
    )
    return "cycle" if clock == "cycles" else "hour", sessions


def _time(run: Run, clock: str, text: str) -> float:
    """Hours or cycles of a header's line."""
    with refusing(f"{run.path or 'a run'}: {clock} = {shown(text)} cannot be read (", f"); write '{CLOCKS[clock]}'"):
        if clock == "date":
            when = datetime.fromisoformat(text)
            time = (when if when.tzinfo else when.replace(tzinfo=UTC)).timestamp() / 3600
        elif clock == "hours" and any(letter.isalpha() for letter in text.lower().replace("e", "")):
            time = units.to_core(text, "time") / 3600
        else:
            time = float(text)
        if not 0 <= time < math.inf:
            raise ValueError("must be 0 or more")
    return time


@dataclass(frozen=True)
class History:
    """Sessions of a unit as rows of what they have in common.

    A row holds amplitudes of orders 1 and up of each condition, then lost motions and what else conditions with a
    common zero tell.

    Attributes
    ----------
    at : ndarray, shape (sessions,)
    amplitudes : Amplitudes
        Of orders from 0 up, with the noise of a session.
    rows : ndarray, shape (d, conditions * 2 * k)
        What makes a row of amplitudes: the orders from 1 up, and contrasts of offsets.
    variance : ndarray, shape (d,)
        Of the noise of a row, rad^2.
    lost_motion : tuple of int
        Entries of a row that are lost motions, in the order of torques.
    """

    at: Array
    amplitudes: Amplitudes
    rows: Array
    variance: Array
    lost_motion: tuple[int, ...]

    @property
    def own_zeros(self) -> int:
        """Entries at the end of a row that are contrasts of offsets."""
        return len(self.rows) - 2 * len(self.amplitudes.conditions) * (self.amplitudes.orders.size - 1)

    @cached_property
    def values(self) -> Array:
        """Rows over the root of their noise, shape (sessions, d)."""
        return self.amplitudes.values @ self.whitening.T

    @cached_property
    def whitening(self) -> Array:
        """What makes whitened rows of amplitudes, shape (d, conditions * 2 * k)."""
        return np.asarray(self.rows / np.sqrt(self.variance)[:, None])


def history_of(model: Model, sessions: Sequence[Session], fitted: Array | None = None) -> History:
    """Amplitudes and lost motions of sessions, with the noise that they tell.

    Parameters
    ----------
    model : Model
    sessions : sequence of Session
        Two or more, in the order of time.
    fitted : ndarray, shape (sessions, conditions * 2 * k), optional
        What is known to have changed, which is no noise, rad.

    Returns
    -------
    History

    Raises
    ------
    InputError
        If runs do not fit the model, or fewer than two sessions have a condition in common.
    """
    read = [split_unit(model, LotUnit(one.label, one.runs), noun="session") for one in sessions]
    joined = joined_units(read, least=2, noun="session")
    joined.check_marked("session")
    chosen = [(one, part) for one, part in zip(sessions, read, strict=True) if one.label in joined.serials]
    zeros = np.array([[part.offsets[c] for c in joined.conditions] for _, part in chosen])
    amplitudes = _with_offsets(joined, zeros)
    changed = amplitudes.values - (0.0 if fitted is None else fitted)
    at = np.array([one.at for one, _ in chosen])
    amplitudes = replace(amplitudes, noise=_noise(bumps(changed, at), len(amplitudes.conditions)))
    contrasts, lost = _contrasts(joined, [one for one, _ in chosen])
    waves = np.eye(amplitudes.noise.size)[np.tile(amplitudes.orders > 0, 2 * len(amplitudes.conditions))]
    variance = np.concatenate([waves, contrasts]) ** 2 @ amplitudes.noise
    first = len(waves)
    variance[first:] = np.maximum(variance[first:], repeated(changed @ contrasts.T, at))
    lost_motion = tuple(first + number for number in lost)
    return History(at, amplitudes, np.concatenate([waves, contrasts]), variance, lost_motion)


def bumps(values: Array, at: Array) -> Array:
    """What each session is off from the line between its neighbours, as noise of the variance of a session.

    Of two sessions their difference.

    Parameters
    ----------
    values : ndarray, shape (sessions, ...)
    at : ndarray, shape (sessions,)

    Returns
    -------
    ndarray, shape (sessions - 2, ...), of two sessions (1, ...)

    Examples
    --------
    >>> bumps(np.array([0.0, 1, 3, 4]), np.array([0.0, 1, 3, 4]))  # a growth is no noise
    array([0., 0.])
    """
    if len(values) == 2:
        return np.asarray(np.diff(values, axis=0) / math.sqrt(2))
    share = ((at[1:-1] - at[:-2]) / (at[2:] - at[:-2])).reshape(-1, *[1] * (values.ndim - 1))
    differences = values[1:-1] - (1 - share) * values[:-2] - share * values[2:]
    return np.asarray(differences / np.sqrt(1 + (1 - share) ** 2 + share**2))


def repeated(values: Array, at: Array) -> Array:
    """Variance with which series repeat from session to session, that a jump or a growth hardly alters.

    Parameters
    ----------
    values : ndarray, shape (sessions, series)
    at : ndarray, shape (sessions,)
        Times.

    Returns
    -------
    ndarray, shape (series,)
        Median square of `bumps`, over what it is of normal ones; 0 where sessions are too few to tell.

    Examples
    --------
    >>> series = np.array([0.0, 1, 0, 1, 0, 1, 0, 1, 80])[:, None]
    >>> repeated(series, np.arange(9.0)).round(2)
    array([1.47])
    """
    if len(values) < FEW:
        return np.zeros(values.shape[1])
    return np.asarray(np.median(bumps(values, at) ** 2, axis=0) / _MEDIAN)


def _with_offsets(joined: Amplitudes, zeros: Array) -> Amplitudes:
    """Amplitudes with order 0, which over the root of two is the offset, as `Amplitudes.of_waves` has it."""
    sessions, conditions = zeros.shape
    parts = joined.values.reshape(sessions, conditions, 2, -1)
    mean = np.stack([zeros * math.sqrt(2), np.zeros_like(zeros)], axis=-1)[..., None]
    values = np.concatenate([mean, parts], axis=-1).reshape(sessions, -1)
    return replace(joined, orders=np.concatenate([[0], joined.orders]), values=values, noise=np.ones(values.shape[1]))


def _noise(off: Array, conditions: int) -> Array:
    """Variance of each amplitude that noise makes, of what sessions are off from their neighbours.

    About an order the lower quartile of the powers, over sessions and orders, over what it is of noise: what one
    session or a few orders add does not reach it.
    """
    power = (off.reshape(len(off), conditions, 2, -1) ** 2).mean(axis=2)  # its variance times an exponential of mean 1
    orders, near = np.arange(power.shape[2]), max(_NEAR, -(-_POOLED // (2 * len(power))))
    about = [power[:, :, orders_about(orders, k, near)] for k in orders]
    found = np.array([np.quantile(some, 0.25, axis=(0, 2)) for some in about]).T / (chi_square(0.75, 2) / 2)
    found[:, 0] *= 2  # order 0 is the offset times the root of two
    return np.tile(found[:, None], (1, 2, 1)).reshape(-1)


def _contrasts(joined: Amplitudes, sessions: Sequence[Session]) -> tuple[Array, list[int]]:
    """Contrasts of the offsets of conditions whose runs share a zero in every session; which of them are lost motions.

    Of a torque in both directions the difference; of several torques each with the mean of those before it.
    """
    conditions = joined.conditions
    # label of the zero of each run, empty where it has one of its own; of two runs of a condition the first counts
    indices = [{condition_of(run): run.index for run in reversed(one.runs)} for one in sessions]
    zeros = [tuple(of_runs[c] for of_runs in indices) for c in conditions]
    directions, torques = np.array([(c.direction, c.torque) for c in conditions]).T
    rows, lost = list[Array](), list[int]()
    for label in dict.fromkeys(zeros):
        if not all(label):
            continue
        sharing, means = np.array([zero == label for zero in zeros]), list[Array]()
        for torque in dict.fromkeys(torques[sharing].tolist()):
            some = (sharing & (torques == torque)) / math.sqrt(2)  # order 0 is the offset times the root of two
            if np.count_nonzero(some) == 2:
                lost.append(len(rows))
                rows.append(some * directions)
            mean = some / np.count_nonzero(some)
            if means:
                rows.append(mean - np.mean(means, axis=0))
            means.append(mean)
    of_offsets = np.array(rows).reshape(len(rows), len(conditions))
    return np.asarray(np.kron(of_offsets, np.eye(1, 2 * (1 + joined.orders.size))), dtype=np.float64), lost


def run_files(paths: Sequence[str], suffixes: tuple[str, ...]) -> list[str]:
    """Files of runs: those given, and of folders all that have one of the endings, their subfolders' too.

    Raises
    ------
    InputError
        If a folder holds none, or a file stands twice.
    """
    found = list[str]()
    for path in paths:
        folder = Path(path)
        if not folder.is_dir():
            found.append(path)
            continue
        inside = [p for p in folder.rglob("*") if p.is_file() and p.name.lower().endswith(suffixes)]
        seen = sorted(str(p) for p in inside if not any(part.startswith(".") for part in p.relative_to(folder).parts))
        if not seen:
            raise InputError(f"{path}: the folder holds no run ({', '.join(suffixes)}); give runs of one unit")
        found += seen
    twice = [path for number, path in enumerate(found) if path in found[:number]]
    if twice:
        raise InputError(f"{twice[0]}: is given twice; give each run once")
    return found
