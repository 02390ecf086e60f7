"""Suspected units by their own equilibrium: the most probable unit of the lot that has a unit's amplitudes.

Page ``theory/lots.md``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt
import scipy

from rverror.base.arrays import Array
from rverror.base.chance import chi_square
from rverror.base.text import describe
from rverror.base.threads import each
from rverror.lots.moments import LotEstimate
from rverror.lots.processes import Process
from rverror.lots.result import Interval, Outsider, Shift
from rverror.lots.simulated import COMPLIANCES, Simulator, Solve, State

_FEW = 12  # parts of a kind that are told by themselves: a pin or lobe that is gross carries nothing, and hides
_SUSPECTS = 20  # least likely units that are fitted: half a second each, a tenth of a lot's time
_HOPS = 16  # to other local minima: of members that the first fit left far away each came near enough in one of three
_DIRECTIONS, _RADII = 8, (1.0, 2.0)  # of sizes that fits start from, over the plausible one: 30 to 90 um are near
_FITTED = 2  # of these for each part, those of the best score to first order; one where a member does as well
_COOLED = 3.0  # by which the noise's variance is divided at each step
_FALL = 0.01  # share of the squares, or squares, by which a step has to lower them
_AS_SAID = (0.25, 0.75)  # of the fall that the slopes say: less asks for shorter steps, more allows longer ones
_DAMPING = 1e4  # from which on a step leads nowhere


@dataclass(frozen=True)
class Prior:
    """Errors of a unit's parts before it is measured: independent and normal, shape (components,), core units."""

    middle: Array
    spread: Array


@dataclass(frozen=True)
class FittedUnit:
    """A unit beside some amplitudes, and what is left of them.

    Attributes
    ----------
    sizes : ndarray, shape (components,)
        Of its part errors about their means, standard deviations.
    left : ndarray, shape (d,)
        Of the amplitudes, in which noise has unit variance.
    slopes : ndarray, shape (d, components)
        Change of its own amplitudes per standard deviation.
    """

    sizes: Array
    left: Array
    slopes: Array

    @property
    def distance(self) -> float:
        """Minus twice the log posterior, but for a constant: squares of what is left and of the sizes."""
        return float(self.left @ self.left + self.sizes @ self.sizes)

    @property
    def misfit(self) -> float:
        """Distance over what chance makes of it, if more: the model lacks something, all the more of large errors."""
        return max(1.0, self.distance / len(self.left))

    @property
    def score(self) -> float:
        """Minus twice the log evidence by Laplace's approximation, one step on, but for a constant."""
        covariance = self.slopes @ self.slopes.T + np.eye(len(self.left))
        away = self.left + self.slopes @ self.sizes
        return float(away @ np.linalg.solve(covariance, away) + np.linalg.slogdet(covariance)[1])

    @property
    def noise(self) -> float:
        """Variance of the noise, if all that is left is noise."""
        return float(self.left @ self.left) / len(self.left)

    def drawn(self, rng: np.random.Generator) -> Array:
        """Sizes near its own, from their posterior by its slopes, with noise somewhat larger than what is left."""
        precision = self.slopes.T @ self.slopes / (_COOLED * max(self.noise, 1.0)) + np.eye(len(self.sizes))
        root = np.linalg.cholesky(precision)
        away = scipy.linalg.solve_triangular(root, rng.standard_normal(len(self.sizes)), lower=True, trans="T")
        return np.asarray(self.sizes + away)


def fitted(solve: Solve, values: Array, prior: Prior, sizes: Array) -> FittedUnit | None:
    """A unit of some sizes beside amplitudes; None where it has no equilibrium."""
    solved = solve(prior.middle + prior.spread * sizes)
    if solved is None:
        return None
    return FittedUnit(sizes, values - solved.values, (solved.influence * prior.spread[:, None]).T)


def nearest(solve: Solve, values: Array, prior: Prior, start: Array, enough: float = 0.0) -> FittedUnit | None:
    """Fit a unit to amplitudes from a start, to a local minimum of its distance, in damped steps.

    The noise is taken to be as large as what the start leaves, and less at each step.  Steps are damped less after one
    that did what the slopes said, and more after one that did not.

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
        Distance below which no nearer unit is sought.

    Returns
    -------
    FittedUnit or None
        None where the start has no equilibrium.
    """
    now = fitted(solve, values, prior, start)
    if now is None:
        return None
    noise, damping = now.noise, 0.0
    while now.distance >= enough:
        noise = max(noise / _COOLED, 1.0)
        before = float(now.left @ now.left / noise + now.sizes @ now.sizes)
        covariance, pull = now.slopes @ now.slopes.T, now.slopes.T @ now.left / noise - now.sizes
        while True:
            damped = covariance + noise * (1 + damping) * np.eye(len(values))
            along = scipy.linalg.solve(damped, now.slopes @ pull, assume_a="pos")
            step = (pull - now.slopes.T @ along) / (1 + damping)
            other = fitted(solve, values, prior, now.sizes + step)
            fallen = before - (other.left @ other.left / noise + other.sizes @ other.sizes) if other else -math.inf
            if fallen > 0 or damping > _DAMPING:
                break
            damping = max(10 * damping, 0.1)
        if other and fallen > 0:
            change = now.slopes @ step
            share = fallen / float(2 * pull @ step - change @ change / noise - step @ step)
            damping = damping / 10 if share > _AS_SAID[1] else max(2 * damping, 0.1) if share < _AS_SAID[0] else damping
            now = other
        if noise == 1.0 and fallen < _FALL * max(before, 1 / _FALL):
            break
    return now


def hopped(
    solve: Solve, values: Array, prior: Prior, enough: float, rng: np.random.Generator, start: Array | None = None
) -> FittedUnit | None:
    """Fit a unit to amplitudes again and again, each time from a draw about the nearest so far (basin hopping).

    Where contacts open there are many local minima, and draws from the prior rarely lead to the nearest unit.

    Parameters
    ----------
    solve, values, prior, enough
        As for `nearest`.
    rng : numpy.random.Generator
    start : ndarray, shape (components,), optional
        Standard deviations; a draw from the prior where left out.

    Returns
    -------
    FittedUnit or None
        None where no start has an equilibrium.
    """
    best = None if start is None else nearest(solve, values, prior, start, enough)
    for _ in range(_HOPS):
        if best and best.distance < enough:
            break
        sizes = best.drawn(rng) if best else rng.standard_normal(len(prior.spread))
        other = nearest(solve, values, prior, sizes, enough)
        best = other if other and (best is None or other.distance < best.distance) else best
    return best


@dataclass(frozen=True)
class GrossError:
    """An error of one part that no process of the lot has made.

    Attributes
    ----------
    effect : int
        Number among `UnitParts.effects`.
    unit : FittedUnit
        The nearest that has it.
    sizes, errors : ndarray, shape (parameters,)
        Of its parameters, and their standard errors, larger by the root of the misfit, core units.
    known : ndarray of bool, shape (parameters,)
        Of which sizes the amplitudes say more than what was known before.
    gain : float
        Twice the logarithm of its odds against a member of the lot.
    """

    effect: int
    unit: FittedUnit
    sizes: Array
    errors: Array
    known: npt.NDArray[np.bool_]
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

    def outsiders(
        self, serials: Sequence[str], values: Array, middle: Array, far: Array, share: Array, *, level: float
    ) -> tuple[Outsider, ...]:
        """Units of which their own equilibrium tells that they are no members, of those suspected and the farthest.

        Parameters
        ----------
        serials : sequence of str
        values : ndarray, shape (units, d)
            Whitened amplitudes.
        middle : ndarray, shape (units, components)
            Mean errors of the parts of each.
        far : ndarray, shape (units,)
            Squared distances, were all linear.
        share : ndarray, shape (units,)
            Of the members, beyond whose distance a unit's parts are asked for; units of a larger share come first.
        level : float
            Chance of one in a lot without any.

        Returns
        -------
        tuple of Outsider
            Without causes where parts of several kinds do it, which are then among the rivals.
        """
        found, effects = list[Outsider](), self.simulator.parts.effects
        suspects, chance = np.lexsort((-far, -share))[:_SUSPECTS].tolist(), level / len(serials)
        asked = each(lambda at: self.gross_errors(values[at], middle[at], chance=chance, usual=share[at]), suspects)
        for unit, errors in zip(suspects, asked, strict=True):
            if errors:
                names = [describe(effects[one.effect].key, effects[one.effect].indices) for one in errors]
                alike = len({effects[one.effect].key for one in errors}) == 1
                chance = len(serials) * math.exp(-errors[0].gain / 2)
                causes, rivals = (self._shifts(errors[0]), names[1:]) if alike else ((), names)
                found.append(Outsider(serials[unit], errors[0].gain, chance, causes, tuple(rivals)))
        return tuple(found)

    def gross_errors(self, values: Array, middle: Array, *, chance: float, usual: float) -> tuple[GrossError, ...]:
        """Gross errors one of which has made a unit, the likeliest first; none where it may be a member.

        Parameters
        ----------
        values : ndarray, shape (d,)
            Whitened amplitudes.
        middle : ndarray, shape (components,)
            Mean errors of the parts.
        chance : float
            Of telling one of a member, or a part of a unit that another has made.
        usual : float
            Share of the members beyond whose distance parts are asked for.

        Returns
        -------
        tuple of GrossError
            With the first its mirror image, and those over which its odds are not beyond the chance.
        """
        spread = np.concatenate([self.state.deviation[self.simulator.parts.process], np.ones(COMPLIANCES)])
        prior = Prior(np.concatenate([middle, np.zeros(COMPLIANCES)]), spread)
        enough, rng = chi_square(usual, len(values)), np.random.default_rng(self.seed)
        member = hopped(self._solve, values, prior, enough, rng)
        if member is None or member.distance < enough:
            return ()
        few = [number for number, process in enumerate(self._process_of_effect) if len(process.instances) <= _FEW]
        errors = [one for one in (self._from_all_sides(number, values, prior, member) for number in few) if one]

        def sought(one: GrossError, beside: FittedUnit) -> GrossError:
            unit = hopped(self._solve, values, self._wider(one.effect, prior), enough, rng, one.unit.sizes)
            return self._gross_error(one.effect, unit or one.unit, prior, beside)

        # part and member are compared once both were sought as thoroughly, the member beside that part too
        errors.sort(key=lambda one: -one.gain)
        named = self._named([*(sought(one, member) for one in errors[:1]), *errors[1:]], member, chance)
        if not named:
            return ()
        sizes = np.where(self._effect == named[0].effect, 0.0, named[0].unit.sizes)
        other = hopped(self._solve, values, prior, enough, rng, sizes)
        member = other if other and other.distance < member.distance else member
        if member.distance < enough:
            return ()
        return tuple(self._named([sought(one, member) for one in named], member, chance))

    def _named(self, errors: Sequence[GrossError], member: FittedUnit, chance: float) -> list[GrossError]:
        """The likeliest part, if its odds over a member are beyond the chance, and beside it its mirror image and those
        over which its odds are not."""
        ranked, needed = sorted(errors, key=lambda one: -one.gain), -2 * math.log(chance)
        if not ranked or ranked[0].gain < needed * member.misfit:
            return []
        mirrored = self._mirrored(ranked[0].effect)
        return [one for one in ranked if ranked[0].gain - one.gain < needed * one.unit.misfit or one.effect in mirrored]

    def _mirrored(self, number: int) -> list[int]:
        """Mirror images of a part: other crank and other disc, which only contacts distinguish."""
        process, effects = self._process_of_effect[number], self.simulator.parts.effects
        places = {name: at for name, at in effects[number].indices.items() if name not in process.indices}
        return [
            other
            for other, one in enumerate(self._process_of_effect)
            if one is process and all(effects[other].indices[name] != at for name, at in places.items())
        ]

    def _wider(self, number: int, usual: Prior) -> Prior:
        """What is known of a unit one of whose parts no process made."""
        return replace(usual, spread=np.where(self._effect == number, self._gross, usual.spread))

    def _from_all_sides(self, number: int, values: Array, usual: Prior, member: FittedUnit) -> GrossError | None:
        """The likeliest error of one part, from sizes all round; None where none of them has an equilibrium.

        No fit goes from no size to a large one, nor from one direction to another.
        """
        own, prior = self._effect == number, self._wider(number, usual)
        starts = np.zeros((len(_RADII) * _DIRECTIONS, len(own)))
        angles = 2 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
        directions = np.array([np.cos(angles), np.sin(angles)]).T[:, : np.count_nonzero(own)]
        starts[:, own] = np.concatenate([radius * directions for radius in _RADII])
        begun = [one for one in each(lambda sizes: fitted(self._solve, values, prior, sizes), list(starts)) if one]
        best = None
        for one in sorted(begun, key=lambda one: one.score)[:_FITTED]:
            unit = nearest(self._solve, values, prior, one.sizes) or one
            error = self._gross_error(number, unit, usual, member)
            best = error if best is None or error.gain > best.gain else best
            if best.gain < 0:  # a member does as well
                break
        return best

    def _gross_error(self, number: int, unit: FittedUnit, usual: Prior, member: FittedUnit) -> GrossError:
        """What a unit says of its part: all kinds are alike beforehand, and the parts of a kind."""
        own, prior = self._effect == number, self._wider(number, usual)
        cost = 2 * math.log(len(self.simulator.parts.processes) * len(self._process_of_effect[number].instances))
        rest = unit.slopes[:, ~own] @ unit.slopes[:, ~own].T + np.eye(len(unit.left))
        information = unit.slopes[:, own].T @ np.linalg.solve(rest, unit.slopes[:, own])
        variance = np.diag(np.linalg.inv(information + np.eye(len(information))))
        sizes = (prior.middle + prior.spread * unit.sizes)[own]
        errors = np.sqrt(variance * unit.misfit) * prior.spread[own]
        return GrossError(number, unit, sizes, errors, variance < 0.5, member.score - unit.score - cost)

    def _shifts(self, error: GrossError) -> tuple[Shift, ...]:
        """Its sizes, those of which the amplitudes say more than what was known before."""
        effect, process = self.simulator.parts.effects[error.effect], self._process_of_effect[error.effect]
        rows = zip(process.parameters, error.sizes.tolist(), error.errors.tolist(), error.known, strict=True)
        return tuple(
            Shift(effect.key, effect.indices, p.name, p.dimension, Interval(x, x - 1.96 * e, x + 1.96 * e))
            for p, x, e, known in rows
            if known
        )

    @cached_property
    def _process_of_effect(self) -> list[Process]:
        return [process for process in self.simulator.parts.processes for _ in process.instances]

    @cached_property
    def _solve(self) -> Solve:
        return self.simulator.linearised_at(self.state, self.root)

    @cached_property
    def _gross(self) -> Array:
        """Standard deviation of an error that no process made: the largest that surprises no one."""
        plausible = [parameter.plausible for parameter in self.simulator.parts.parameters]
        return np.array([*plausible, *np.ones(COMPLIANCES)])

    @cached_property
    def _effect(self) -> npt.NDArray[np.intp]:
        """Effect of each error, none of the stiffnesses."""
        return np.concatenate([self.simulator.parts.effect, np.full(COMPLIANCES, -1)])
