"""What a lot can tell: which processes show, which do the same, and in which orders they do it.

Page ``theory/lots.md``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy

from rverror.base.arrays import Array
from rverror.lots.amplitudes import Amplitudes
from rverror.lots.processes import Process, UnitParts
from rverror.lots.simulated import Draws, Simulator, State
from rverror.model.effects import Model

#: Relative precision that a workshop's variance must be known with, by itself, to be told at all: its interval then
#: ends below what is plausible.
TOLD = 3.0
#: Correlation of two variances from which on no lot tells them apart: it would take 50 times the units.
ALIKE = 0.99
_SPREAD = 0.1  # of a workshop's: contacts open and close as they do in units that sell
_FEW = 32  # drawn units
_SHARED_OUT = 10  # steps: then the sum is as large as it should be, and its parts are still a workshop's
_NONE = 0.5  # of the standard error that a variance has where there is noise and nothing else: nobody sees it
_STRONG = 1.5  # times the noise, from which on an order's variance over a lot is not chance
_MOST, _OF_EACH = 30, 4  # orders of the strongest variance; and those in which a process would show most


@dataclass(frozen=True)
class Question:
    """What a lot can be asked.

    Attributes
    ----------
    simulator : Simulator
        Of the processes that are told apart, at the orders that tell.
    alike : tuple of tuple of Process
        With each process those that no lot tells from it.
    silent : tuple of Process
        That do not show.
    start : State
    least : ndarray, shape (processes,)
        Standard deviations that no lot tells from none: half of the error that a variance has beside noise alone.
    """

    simulator: Simulator
    alike: tuple[tuple[Process, ...], ...]
    silent: tuple[Process, ...]
    start: State
    least: Array


def question_of(model: Model, amplitudes: Amplitudes, processes: Sequence[Process], seed: int = 0) -> Question:
    """What a lot can be asked, from units drawn with a tenth of a workshop's spread.

    Parameters
    ----------
    model : Model
    amplitudes : Amplitudes
    processes : sequence of Process
    seed : int

    Returns
    -------
    Question
    """
    parts = UnitParts(tuple(processes))
    workshop = np.array([process.plausible for process in processes])
    whole = Simulator(model, parts, amplitudes)
    standard = np.random.default_rng(seed).standard_normal((_FEW, len(parts.process)))
    draws = whole.draws(State(_SPREAD * workshop), standard)
    information = _information(draws, _SPREAD * workshop, len(amplitudes.values))
    own = np.sqrt(np.diag(information)) * workshop**2
    kept, partners = _apart(information, own)
    shown = np.einsum("cdd->cd", draws.squares)
    orders = _orders(amplitudes, shown[kept] * (workshop[kept] ** 2)[:, None])
    few = amplitudes.of_orders(orders)
    chosen = tuple(processes[at] for at in kept)
    found = Simulator(model, UnitParts(chosen), few)
    alone = len(amplitudes.values) / 2 * np.einsum("cde,cde->c", draws.squares, draws.squares)[kept]
    least = np.sqrt(_NONE / np.sqrt(alone))
    return Question(
        found,
        tuple(tuple(processes[other] for other in partners[at]) for at in kept),
        tuple(process for at, process in enumerate(processes) if own[at] < TOLD),
        State(_start(few, shown[kept][:, np.tile(orders, 2 * len(few.conditions))], workshop[kept], least)),
        least,
    )


def _information(draws: Draws, deviation: Array, units: int) -> Array:
    """Fisher information on the variances of a lot of so many units, shape (processes, processes)."""
    triangular = scipy.linalg.solve_triangular
    root, white = np.linalg.cholesky(draws.covariance(deviation)), np.empty_like(draws.squares)
    for row, square in zip(white, draws.squares, strict=True):  # one at a time: of two loads all are half a gigabyte
        row[:] = triangular(root, triangular(root, square, lower=True).T, lower=True)
    return np.asarray(units / 2 * np.einsum("ai,bi->ab", *[white.reshape(len(white), -1)] * 2, optimize=True))


def _apart(information: Array, own: Array) -> tuple[list[int], dict[int, list[int]]]:
    """Processes that are told apart, the clearest first; and with each those that are not told from it."""
    size = np.sqrt(np.maximum(np.diag(information), 1e-300))
    alike = information / np.outer(size, size)
    partners = dict[int, list[int]]()
    for at in np.argsort(-own)[: np.sum(own >= TOLD)].tolist():
        first = next((other for other in partners if alike[at, other] > ALIKE), None)
        if first is None:
            partners[at] = []
        else:
            partners[first].append(at)
    return sorted(partners), partners


def _orders(amplitudes: Amplitudes, shown: Array) -> npt.NDArray[np.bool_]:
    """Orders with more than noise, and those in which each process would show most."""
    count = len(amplitudes.orders)
    power = (amplitudes.variance / amplitudes.noise).reshape(-1, count).mean(axis=0)
    kept = (power > _STRONG) & (power >= np.sort(power)[-min(_MOST, count)])
    for row in shown.reshape(len(shown), shown.shape[1] // count, count).sum(axis=1):
        kept[np.argsort(-row)[:_OF_EACH]] = True
    return np.asarray(kept)


def _start(amplitudes: Amplitudes, shown: Array, workshop: Array, least: Array) -> Array:
    """Standard deviations whose variances make the variance of each order, near a workshop's, and a little more.

    Steps of an expectation-maximisation: what makes an order is shared out as the workshop would have it.
    """
    power = np.maximum(amplitudes.variance / amplitudes.noise - 1, 0.0)
    variance = (_SPREAD * workshop) ** 2
    for _ in range(_SHARED_OUT):
        made = variance @ shown + 1.0
        variance = variance * (shown @ (power / made**2)) / np.maximum(shown @ (1 / made), 1e-300)
    return np.asarray(np.sqrt(variance + (5 * least) ** 2 + (0.02 * workshop) ** 2))
