"""Suspected units by their own equilibrium: the most probable unit of the lot that has a unit's amplitudes.

Page ``theory/lots.md``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt
import scipy

from rverror.base.arrays import Array
from rverror.base.threads import each
from rverror.lots.moments import LotEstimate
from rverror.lots.simulated import COMPLIANCES, Simulator, SolvedUnit, State

_LEADING, _FURTHER = 7, 2  # parts of either list that are tried; and those that are fitted from all starts
_STARTS = 6  # where a start leads to a minimum that is no member in 1 of 20, all of them do in one of 6e7
_STEPS, _LAST = 5, 20  # at each variance of the noise, and at the last, its own
_FALL = 0.01  # share of the squares, or squares, by which a step has to lower them
_DAMPING = 1e4  # from which on a step leads nowhere

Solve = Callable[[Array], SolvedUnit | None]


@dataclass(frozen=True)
class Prior:
    """Errors of a unit's parts before it is measured: independent and normal, shape (components,), core units."""

    middle: Array
    spread: Array


@dataclass(frozen=True)
class NearestUnit:
    """The most probable unit with some amplitudes.

    Attributes
    ----------
    sizes : ndarray, shape (components,)
        Of its part errors about their means, standard deviations.
    left : ndarray, shape (d,)
        Of the amplitudes, in which noise has unit variance.
    solved : SolvedUnit
    """

    sizes: Array
    left: Array
    solved: SolvedUnit

    @property
    def distance(self) -> float:
        """Minus twice the log posterior: squares of what is left and of the sizes."""
        return float(self.left @ self.left + self.sizes @ self.sizes)


def nearest(solve: Solve, values: Array, prior: Prior, start: Array, enough: float = 0.0) -> NearestUnit | None:
    """Fit a unit to amplitudes from a start, to a local minimum of its distance.

    The noise is taken to be as large as what the start leaves, and its variance is then a tenth each time.

    Parameters
    ----------
    solve : callable
        Of part errors, core units; None where there is no equilibrium.
    values : ndarray, shape (d,)
        Whitened amplitudes.
    prior : Prior
    start : ndarray, shape (components,)
        Standard deviations.
    enough : float
        Distance from which on no smaller one is sought.

    Returns
    -------
    NearestUnit or None
        None where the start has no equilibrium.
    """

    def unit(sizes: Array) -> NearestUnit | None:
        solved = solve(prior.middle + prior.spread * sizes)
        return None if solved is None else NearestUnit(sizes, values - solved.values, solved)

    now = unit(start)
    if now is None:
        return None
    noise = max(float(now.left @ now.left) / len(values), 1.0)
    while True:
        noise = max(noise / 10, 1.0)
        now = _settled(unit, now, prior, noise, enough)
        if noise == 1.0:
            return now


def _settled(
    unit: Callable[[Array], NearestUnit | None], now: NearestUnit, prior: Prior, noise: float, enough: float
) -> NearestUnit:
    """Damped steps under one variance of the noise."""

    def squares(one: NearestUnit) -> float:
        return float(one.left @ one.left / noise + one.sizes @ one.sizes)

    damping, count = 0.0, len(now.left)
    for _ in range(_LAST if noise == 1.0 else _STEPS):
        slopes = _slopes(now, prior)
        covariance, pull = slopes @ slopes.T, slopes.T @ now.left / noise - now.sizes
        while True:
            damped = covariance + noise * (1 + damping) * np.eye(count)
            step = (pull - slopes.T @ scipy.linalg.solve(damped, slopes @ pull, assume_a="pos")) / (1 + damping)
            other = unit(now.sizes + step)
            if other is not None and squares(other) < squares(now):
                break
            damping = max(10 * damping, 0.1)
            if damping > _DAMPING:
                return now
        fallen, now, damping = squares(now) - squares(other), other, damping / 10
        if now.distance < enough or fallen < _FALL * max(squares(now), 1 / _FALL):
            break
    return now


@dataclass(frozen=True)
class GrossError:
    """An error of one part that no process of the lot has made.

    Attributes
    ----------
    effect : int
        Number among `UnitParts.effects`.
    sizes, errors : ndarray, shape (parameters,)
        Of its parameters, and their standard errors, core units.
    gain : float
        Twice the logarithm of its odds against a member of the lot.
    """

    effect: int
    sizes: Array
    errors: Array
    gain: float


@dataclass(frozen=True)
class OwnEquilibrium:
    """Members of a lot, to which suspected units are held.

    Attributes
    ----------
    simulator : Simulator
    state : State
        What the lot's processes make.
    root : ndarray, shape (6, 6)
        Of the covariance of the state's compliances.
    seed : int
        Of the units from which fits start.
    """

    simulator: Simulator
    state: State
    root: Array
    seed: int = 0

    @classmethod
    def of(cls, simulator: Simulator, estimate: LotEstimate, seed: int = 0) -> OwnEquilibrium:
        """Of an estimate, whose errors a unit must not be taken for.

        A variance is one standard error larger, a unit's stiffnesses are as uncertain as the lot's.
        """
        deviation = np.sqrt(estimate.state.deviation**2 + estimate.variance_error)
        soft = estimate.covariance[-COMPLIANCES:, -COMPLIANCES:]
        root = np.asarray(np.linalg.cholesky(soft + 1e-12 * np.eye(COMPLIANCES)))
        return cls(simulator, replace(estimate.state, deviation=deviation), root, seed)

    def distances(self, values: Array, middle: Array, enough: float) -> Array:
        """Distance of each unit from the nearest member, of those that are farthest from the best of all starts.

        After each start the nearer half of the units is left as it is.

        Parameters
        ----------
        values : ndarray, shape (units, d)
            Whitened amplitudes.
        middle : ndarray, shape (units, components)
            Mean errors of the parts of each.
        enough : float
            Distance from which on no nearer member is sought.

        Returns
        -------
        ndarray, shape (units,)
        """
        least = np.full(len(values), np.inf)
        for number, start in enumerate(self._starts):

            def distance(unit: int, start: Array = start) -> float:
                found = nearest(
                    self._solve, values[unit], Prior(self._middle(middle[unit]), self._spread), start, enough
                )
                return found.distance if found else math.inf

            farthest = np.argsort(-least)[: max(len(values) >> number, 1)]
            some = farthest[least[farthest] >= enough]
            least[some] = np.minimum(least[some], each(distance, some.tolist()))
        return least

    def gross_errors(self, values: Array, middle: Array) -> tuple[GrossError, ...]:
        """Gross errors that may have made a unit what it is, the likeliest first; none where it may be a member.

        Tried are the parts that lead in the nearest member.

        Parameters
        ----------
        values : ndarray, shape (d,)
        middle : ndarray, shape (components,)

        Returns
        -------
        tuple of GrossError
        """
        usual = Prior(self._middle(middle), self._spread)
        nearly = self._fits(values, usual, self._starts)
        if not nearly:
            return ()
        member = min(nearly, key=lambda one: one.distance)
        priors = {effect: self._prior(usual, effect) for effect in self._leading(member, usual)}
        found = {
            effect: self._fits(values, prior, [member.sizes * self._spread / prior.spread])
            for effect, prior in priors.items()
        }

        def score(effect: int) -> float:
            return min((_score(one, priors[effect]) for one in found[effect]), default=math.inf) + self._cost(effect)

        for effect in sorted(found, key=score)[:_FURTHER]:
            found[effect] += self._fits(values, priors[effect], self._starts)
        leader = min(found, key=score)
        if not found[leader]:
            return ()
        best_of = min(found[leader], key=lambda one: _score(one, priors[leader]))
        for effect in self._alike(leader):  # no fit goes from a part to another that does nearly the same
            prior = priors.setdefault(effect, self._prior(usual, effect))
            starts = self._moved(best_of, priors[leader], leader, prior, effect)
            found[effect] = found.get(effect, []) + self._fits(values, prior, starts)
        ranked = sorted((effect for effect in found if found[effect]), key=score)
        best = {effect: min(found[effect], key=lambda one: _score(one, priors[effect])) for effect in ranked}
        # a member may be near where a gross error has led
        ends = [best[effect].sizes * priors[effect].spread / self._spread for effect in ranked[:_FURTHER]]
        least = min(_score(one, usual) for one in nearly + self._fits(values, usual, ends))
        return tuple(
            _gross_error(effect, self._effect == effect, best[effect], priors[effect], least - score(effect))
            for effect in ranked
            if score(effect) < least
        )

    @cached_property
    def _solve(self) -> Solve:
        return self.simulator.linearised_at(self.state, self.root)

    @cached_property
    def _starts(self) -> list[Array]:
        """Drawn members: from a perfect unit, all of whose pins carry, a fit hardly finds those that do not."""
        return list(np.random.default_rng(self.seed).standard_normal((_STARTS, len(self._spread))))

    @cached_property
    def _spread(self) -> Array:
        """Standard deviation of each part error, core units, and of what the stiffnesses are off."""
        return np.concatenate([self.state.deviation[self.simulator.parts.process], np.ones(COMPLIANCES)])

    @cached_property
    def _gross(self) -> Array:
        """Standard deviation of an error that no process made: the largest that surprises no one."""
        return np.array(
            [*(parameter.plausible for parameter in self.simulator.parts.parameters), *np.ones(COMPLIANCES)]
        )

    @cached_property
    def _effect(self) -> npt.NDArray[np.intp]:
        """Effect of each error, none of the stiffnesses."""
        return np.concatenate([self.simulator.parts.effect, np.full(COMPLIANCES, -1)])

    def _middle(self, middle: Array) -> Array:
        return np.concatenate([middle, np.zeros(COMPLIANCES)])

    def _prior(self, usual: Prior, effect: int) -> Prior:
        """A member's with a gross error."""
        return replace(usual, spread=np.where(self._effect == effect, self._gross, self._spread))

    def _alike(self, effect: int) -> list[int]:
        """Other parts of a kind of which a unit has few."""
        parts = self.simulator.parts
        process = parts.process[parts.effect == effect][0]
        others = np.unique(parts.effect[parts.process == process])
        return [other for other in others.tolist() if other != effect] if len(others) <= _LEADING else []

    def _moved(self, one: NearestUnit, prior: Prior, at: int, other: Prior, to: int) -> list[Array]:
        """Sizes of a unit whose gross error is another part's, of either sign."""
        error = one.sizes[self._effect == at]
        bare = np.where(np.isin(self._effect, (at, to)), 0.0, one.sizes * prior.spread / other.spread)
        moved = np.array([bare, bare])
        moved[:, self._effect == to] = error, -error
        return list(moved)

    def _cost(self, effect: int) -> float:
        """Minus twice the logarithm of a part's chance: all kinds are alike, and the parts of a kind."""
        parts = self.simulator.parts
        process = parts.processes[parts.process[parts.effect == effect][0]]
        return 2 * math.log(len(parts.processes) * len(process.instances))

    def _fits(self, values: Array, prior: Prior, starts: Sequence[Array]) -> list[NearestUnit]:
        found = each(lambda start: nearest(self._solve, values, prior, start), starts)
        return [one for one in found if one is not None]

    def _leading(self, member: NearestUnit, usual: Prior) -> list[int]:
        """Parts that are farthest from their means in a member, and those that as gross errors would explain most.

        The latter to first order: by the odds of amplitudes that a part makes more of.
        """
        effect, slopes = self._effect, _slopes(member, usual)
        covariance = slopes @ slopes.T + np.eye(len(slopes))
        away = np.linalg.solve(covariance, member.left + slopes @ member.sizes)
        pull, information = slopes.T @ away, slopes.T @ np.linalg.solve(covariance, slopes)
        more, gains = self._gross / self._spread, []
        for number in range(len(self.simulator.parts.effects)):
            own = np.flatnonzero(effect == number)
            inner = np.eye(len(own)) + more[own, None] * information[np.ix_(own, own)] * more[own]
            along = more[own] * pull[own]
            gains.append(float(along @ np.linalg.solve(inner, along) - np.linalg.slogdet(inner)[1]))
        lists = np.bincount(effect[effect >= 0], member.sizes[effect >= 0] ** 2), np.array(gains)
        return list(dict.fromkeys(at for one in lists for at in np.argsort(-one)[:_LEADING].tolist()))


def _slopes(one: NearestUnit, prior: Prior) -> Array:
    return np.asarray((one.solved.influence * prior.spread[:, None]).T)


def _score(one: NearestUnit, prior: Prior) -> float:
    """Minus twice the logarithm of the evidence, by Laplace's approximation, but for a constant."""
    slopes = _slopes(one, prior)
    return one.distance + float(np.linalg.slogdet(slopes @ slopes.T + np.eye(len(slopes)))[1])


def _gross_error(effect: int, own: npt.NDArray[np.bool_], one: NearestUnit, prior: Prior, gain: float) -> GrossError:
    slopes = _slopes(one, prior)
    covariance = np.linalg.inv(slopes.T @ slopes + np.eye(len(own)))
    sizes = (prior.middle + prior.spread * one.sizes)[own]
    return GrossError(effect, sizes, np.sqrt(np.diag(covariance)[own]) * prior.spread[own], gain)
