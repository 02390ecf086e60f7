"""Standard deviations of processes from the covariance of a lot's amplitudes, matched with units drawn and solved.

Page ``theory/lots.md``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
import scipy

from rverror.base.arrays import Array
from rverror.base.chance import chi_square
from rverror.base.progress import Progress
from rverror.lots.simulated import COMPLIANCES, Draws, Simulator, State

#: Spread of the logarithm of a stiffness about what a model states, where it states none.
STIFFNESS = 0.2
_SMALL = 4.0  # times the least: below it the slope is that of a vanishing size, above it that of the drawn units
_ROUNDS = (4, 8)  # with weights that follow the state; and steps at most with weights that are kept
_ROUGH = 4  # every such unit is drawn in these first rounds, which only come near
_NARROW = 0.01  # of the statistics' variance: what some hundred units tell of a direction is not known better
_RENEWALS = (2, 4)  # of the weights, until the state stays: at most, of a first estimate, and of one that begins nearer
_SETTLED = 0.1  # fall of the objective, a chi-square
_STEP = 4.0  # times which a variance changes in one step
_EXCHANGED, _SHARED = 0.9, 0.1  # correlation of what two processes show; and the least share that is worth a start
_STARTS = 2
_DOUBTED = 0.05  # chance of so large a chi-square, below which a fit is poor
_WEIGHED = 3  # times the amplitudes: units of whose covariance the weights of a round are made
_SHARE = 0.3  # of the drawn covariance that is taken block by block: units are only a few times its size


@dataclass(frozen=True)
class Sample:
    """What a lot says: mean and covariance of its units' whitened amplitudes; without known marks about none.

    Attributes
    ----------
    mean : ndarray, shape (d,)
    covariance : ndarray, shape (d, d)
    units : int
    """

    mean: Array
    covariance: Array
    units: int


@dataclass(frozen=True)
class LotEstimate:
    """A lot's processes.

    Attributes
    ----------
    state : State
    covariance : ndarray, shape (processes + 6, processes + 6)
        Of variances and compliances.
    chi_square : float
        Of the quadratic forms, as the lot has them and as the drawn units do.
    freedom : int
        Of the chi-square.
    draws : Draws
        Units of the state.
    influence : ndarray, shape (d, components)
        Mean change of a unit's amplitudes per core unit of each component, of more units than `draws` are.
    weight : ndarray, shape (d, d)
        Inverse covariance of the amplitudes of one unit, of the same.
    """

    state: State
    covariance: Array = field(repr=False)
    chi_square: float
    freedom: int
    draws: Draws = field(repr=False)
    influence: Array = field(repr=False)
    weight: Array = field(repr=False)

    @property
    def variance_error(self) -> Array:
        """Standard errors of the variances, shape (processes,)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)[:-COMPLIANCES]))

    @property
    def poor(self) -> bool:
        """Whether chance makes so large a chi-square less often than in one lot of 20."""
        return self.chi_square > chi_square(_DOUBTED, self.freedom)

    def means(self, rows: Array, simulator: Simulator, mean: Array, units: int) -> tuple[Array, Array]:
        """Systematic errors that a lot's mean shows beside what is drawn, and their standard errors.

        Parameters
        ----------
        rows : ndarray, shape (r, components)
            Of each the combination of components' means.
        simulator : Simulator
        mean : ndarray, shape (d,)
            Of the lot's whitened amplitudes.
        units : int

        Returns
        -------
        sizes, errors : ndarray, shape (r,)
            Core units.  What the lot does not tell is as a workshop makes it, about the drawing's mean.
        """
        prior, draws = simulator.parts.plausible, self.draws
        of, soft = self.influence * prior, draws.by_compliance.mean(axis=0).T * STIFFNESS
        whole = draws.mean_covariance(units) + of @ of.T + soft @ soft.T
        scaled = rows * prior
        gain = np.linalg.solve(whole, of @ scaled.T).T
        variance = np.einsum("rp,rp->r", scaled, scaled) - np.einsum("rd,dr->r", gain, of @ scaled.T)
        return rows @ simulator.parts.middle + gain @ (mean - draws.mean), np.sqrt(np.maximum(variance, 0.0))


class _Weights(NamedTuple):
    """How statistics are made of amplitudes, and their inverse covariance."""

    forms: Array  # (a, d, d): quadratic ones
    of_mean: Array  # (6, d): linear ones
    inverse: Array  # (a + 6, a + 6)


class _Distance(NamedTuple):
    """How far the statistics of a state are from those of a lot."""

    objective: float
    chi_square: float  # of the quadratic forms alone
    away: Array
    slope: Array  # (statistics, variances and compliances)


@dataclass(frozen=True)
class MomentMatching:
    """The method of simulated moments for one lot.

    Attributes
    ----------
    simulator : Simulator
    sample : Sample
    standard : ndarray, shape (n, components)
        Standard normal draws of the parts, the same throughout.
    others : ndarray, shape (n, components)
        Others, of which statistics are made: a form that is made of a unit's own changes is larger for that unit.
    fresh : ndarray, shape (m, components)
        Others, of the first of which the inverse covariance of amplitudes is made; of all of them that of the estimate,
        and the mean influence.
    least : ndarray, shape (processes,)
        Standard deviations that no lot tells from none; what is less is drawn with these, as none has no slope.
    tell : callable
    """

    simulator: Simulator
    sample: Sample
    standard: Array
    others: Array
    fresh: Array
    least: Array
    tell: Progress

    def estimate(self, state: State, *, again: bool = False) -> LotEstimate:
        """Processes that make a lot like the sample, from a state onwards, `again` where it is near.

        Parameters
        ----------
        state : State
        again : bool
            Whether the rounds with rough weights are left out.

        Returns
        -------
        LotEstimate
        """
        for number in range(0 if again else _ROUNDS[0]):
            draws = self.simulator.draws(state, self.standard[::_ROUGH])
            # of a covariance that is too large where contacts open: nothing runs away by it
            weights = self._weights(draws, np.asarray(np.linalg.inv(draws.covariance(state.deviation))))
            distance = self._distance(draws, state, weights)
            self.tell(f"round {number + 1}: chi-square {distance.objective:.3g}")
            state = self._stepped(state, distance, weights, 0.3)
        draws = self.simulator.draws(state, self.standard)
        for renewal in range(_RENEWALS[again]):
            before, weights = state, self._weights_at(state)
            state, draws, distance = self._settled(state, draws, weights)
            if again and not renewal and distance.chi_square > chi_square(_DOUBTED, self._freedom(weights)):
                state, draws, distance = self._elsewhere(state, draws, distance, weights)
            if self._near(before, state, distance, weights):
                break
        else:  # by weights of another state errors are those of another one too
            weights = self._weights_at(state)
            distance = self._distance(draws, state, weights)
        return self._told(state, draws, distance, weights)

    def _settled(self, state: State, draws: Draws, weights: _Weights) -> tuple[State, Draws, _Distance]:
        """Damped steps until the objective stays."""
        distance, damping = self._distance(draws, state, weights), 0.1
        for number in range(_ROUNDS[1]):
            trial = self._stepped(state, distance, weights, damping)
            solved = self.simulator.draws(trial, self.standard)
            there = self._distance(solved, trial, weights)
            fallen = distance.objective - there.objective
            if fallen > 0:
                state, draws, distance, damping = trial, solved, there, damping / 4
                self.tell(f"step {number + 1}: chi-square {distance.objective:.3g}")
            else:
                damping *= 10
            if abs(fallen) < _SETTLED or damping > 10:
                break
        return state, draws, distance

    def _elsewhere(
        self, state: State, draws: Draws, distance: _Distance, weights: _Weights
    ) -> tuple[State, Draws, _Distance]:
        """The best of some starts, where a fit is poor: of two processes that do nearly the same one makes all.

        Each is judged by weights of its own: by those of units that vary much, units that hardly do fit any lot.
        """
        best, least = (state, draws, distance), self._by_its_own(state, draws)
        for number, start in enumerate(self._exchanged(state, draws, weights)):
            try:
                found = self._settled(start, self.simulator.draws(start, self.standard), weights)
                own = self._by_its_own(*found[:2])
            except np.linalg.LinAlgError:
                continue
            self.tell(f"start {number + 1}: chi-square {own:.3g}, before {least:.3g}")
            if own < least - _SETTLED:
                best, least = found, own
        return best

    def _by_its_own(self, state: State, draws: Draws) -> float:
        """Objective of a state by weights that are made there."""
        return self._distance(draws, state, self._weights_at(state)).objective

    def _exchanged(self, state: State, draws: Draws, weights: _Weights) -> list[State]:
        """States in which one of two processes that are hard to tell apart makes what both did."""
        found = []
        shown = np.einsum("ade,cde->ca", weights.forms, draws.squares)
        size = np.linalg.norm(shown, axis=1)
        alike = shown @ shown.T / np.outer(size, size)
        variance = state.deviation**2
        for kept, emptied in zip(*np.nonzero(alike > _EXCHANGED), strict=True):
            if kept == emptied or variance[emptied] * size[emptied] < _SHARED * variance[kept] * size[kept]:
                continue
            deviation = state.deviation.copy()
            deviation[kept] = math.sqrt(variance[kept] + variance[emptied] * size[emptied] / size[kept])
            deviation[emptied] = self.least[emptied]
            found.append(replace(state, deviation=deviation))
        return found[:_STARTS]

    @staticmethod
    def _freedom(weights: _Weights) -> int:
        """Quadratic forms less the variances they tell, two for each; linear ones are as many as the compliances."""
        return max(len(weights.forms) // 2, 1)

    # --- statistics ---------------------------------------------------------------------------------------------------

    def _weight(self, values: Array) -> Array:
        """Inverse covariance of units drawn for it alone; amplitudes of one order keep theirs, others lose a share."""
        amplitudes = self.simulator.amplitudes
        made = amplitudes.over_turns(sample_of(values, marked=amplitudes.marked).covariance)
        return np.asarray(np.linalg.inv(made * (1 - _SHARE * ~amplitudes.same_order) + np.eye(len(made))))

    def _weights_at(self, state: State) -> _Weights:
        """Weights that are made with the inverse covariance of the amplitudes of a state's units."""
        weight = self._weight(self.simulator.values(state, self.fresh[: _WEIGHED * len(self.sample.mean)]))
        return self._weights(self.simulator.draws(state, self.others), weight, both=True)

    def _weights(self, draws: Draws, weight: Array, *, both: bool = False) -> _Weights:
        """Quadratic forms W K W, K the mean of J J' or of J times its own, of each process; and their covariance."""
        of, units = self.simulator.parts.process, self.sample.units
        kinds = list(draws.squares)
        if both:
            means = [draws.influence[:, of == c] @ draws.influence[:, of == c].T for c in range(len(draws.squares))]
            kinds += list(self.simulator.amplitudes.over_turns(np.array(means)))
        forms = np.array([weight @ kind @ weight for kind in kinds])
        forms /= np.sqrt(np.einsum("ade,ade->a", forms, forms))[:, None, None]
        noisy = draws.about_mean + np.random.default_rng(1).standard_normal(draws.values.shape)
        spread = np.cov(np.array([np.einsum("ud,ud->u", noisy @ form, noisy) for form in forms]))
        drawn = 1 / len(draws.values)
        count, prior = len(forms), self.simulator.parts.plausible
        shifted = draws.influence * prior
        whole = draws.mean_covariance(units) + shifted @ shifted.T
        of_mean = np.linalg.solve(whole, draws.by_compliance.mean(axis=0).T).T[: COMPLIANCES * draws.marked]
        inverse = np.zeros((count + len(of_mean), count + len(of_mean)))
        inverse[:count, :count] = _inverse(spread * (1 / (self.sample.units - 1) + drawn))
        inverse[count:, count:] = _inverse(of_mean @ whole @ of_mean.T)
        return _Weights(forms, of_mean, inverse)

    def _distance(self, draws: Draws, state: State, weights: _Weights) -> _Distance:
        """Statistics of the sample less those of the drawn units, and how these change with the state."""
        forms, about, count = weights.forms, draws.about_mean, len(draws.values)
        pressed = np.array([about @ form for form in forms])  # (a, u, d)
        made = np.einsum("aud,ud->a", pressed, about) / (count - draws.marked)
        noise = np.eye(about.shape[1])
        had = np.einsum("ade,de->a", forms, self.sample.covariance - noise)
        shifted = self.sample.mean - draws.mean
        away = np.concatenate([had - made, weights.of_mean @ shifted])
        twice = 2 * np.maximum(state.deviation, _SMALL * self.least)
        changes = np.concatenate([draws.by_process / twice[:, None], draws.by_compliance], axis=1)
        of_forms = 2 * np.einsum("aud,ucd->ac", pressed, changes, optimize=True) / count
        of_mean = weights.of_mean @ changes.mean(axis=0).T
        for at in np.flatnonzero(state.deviation <= _SMALL * self.least):
            of_forms[:, at] = np.einsum("ade,de->a", forms, draws.squares[at])
            of_mean[:, at] = 0.0
        objective = float(away @ weights.inverse @ away + self._prior(state))
        chi = float((had - made) @ weights.inverse[: len(forms), : len(forms)] @ (had - made))
        return _Distance(objective, chi, away, np.concatenate([of_forms, of_mean]))

    def _prior(self, state: State) -> float:
        """Minus twice the logarithm of the prior: a workshop's deviations, stiffnesses as a model knows them."""
        return float(np.sum((state.deviation / self._workshop) ** 2) + np.sum((state.compliance / STIFFNESS) ** 2))

    @property
    def _workshop(self) -> Array:
        return np.array([process.plausible for process in self.simulator.parts.processes])

    # --- steps --------------------------------------------------------------------------------------------------------

    def _stepped(self, state: State, distance: _Distance, weights: _Weights, damping: float) -> State:
        """The state after a step of least squares within bounds."""
        count, least = len(state.deviation), self.least
        unit, information, pull = self._normal(state, distance, weights)
        information = information + np.diag(np.r_[np.full(count, damping), np.zeros(COMPLIANCES)] + 1e-6)
        now = np.concatenate([state.deviation**2, state.compliance])
        low = np.concatenate([np.maximum(least**2, state.deviation**2 / _STEP), state.compliance - 0.3])
        most = np.maximum(state.deviation**2 * _STEP, (10 * least) ** 2)
        high = np.concatenate([most, state.compliance + 0.3])
        factor = np.linalg.cholesky(information)
        found = scipy.optimize.lsq_linear(
            factor.T, np.linalg.solve(factor, pull), bounds=((low - now) / unit - 1e-12, (high - now) / unit + 1e-12)
        )
        new = now + found.x * unit
        return replace(state, deviation=np.sqrt(np.maximum(new[:count], least**2)), compliance=new[count:])

    def _normal(self, state: State, distance: _Distance, weights: _Weights) -> tuple[Array, Array, Array]:
        """Units of the values, and in these the information on them and the pull."""
        unit = np.concatenate([np.maximum(state.deviation, _SMALL * self.least) ** 2, np.full(COMPLIANCES, STIFFNESS)])
        slope, prior = distance.slope * unit, np.zeros(len(unit))
        prior[-COMPLIANCES:] = 1.0
        information = slope.T @ weights.inverse @ slope + np.diag(prior)
        pull = slope.T @ weights.inverse @ distance.away
        pull[-COMPLIANCES:] -= state.compliance / STIFFNESS
        pull[:-COMPLIANCES] -= unit[:-COMPLIANCES] / (2 * self._workshop**2)
        return unit, information, pull

    def _near(self, before: State, state: State, distance: _Distance, weights: _Weights) -> bool:
        """Whether a state moved by less than a third of its standard errors."""
        unit, information, _ = self._normal(state, distance, weights)
        change = np.concatenate([state.deviation**2 - before.deviation**2, state.compliance - before.compliance])
        return bool(change / unit @ information @ (change / unit) < len(change) / 9)

    def _told(self, state: State, draws: Draws, distance: _Distance, weights: _Weights) -> LotEstimate:
        unit, information, _ = self._normal(state, distance, weights)
        # a variance is known no worse than by its prior, an exponential of this mean and standard deviation
        prior = np.concatenate([2 * self._workshop**2, np.full(COMPLIANCES, STIFFNESS)])
        known = information * np.outer(prior / unit, prior / unit) + np.diag(np.arange(len(unit)) < len(self._workshop))
        size, freedom = np.sqrt(np.diag(known)), self._freedom(weights)
        covariance = np.linalg.pinv(known / np.outer(size, size), hermitian=True) * np.outer(prior / size, prior / size)
        covariance *= max(distance.chi_square / freedom, 1.0)  # what the model lacks widens all intervals
        blocks = np.array_split(self.fresh, -(-len(self.fresh) // len(self.standard)))  # influences are large
        fresh = [self.simulator.draws(state, some) for some in blocks]
        influence = np.asarray(np.mean([some.influence for some in fresh], axis=0))
        weight = self._weight(np.concatenate([some.values for some in fresh]))
        return LotEstimate(state, covariance, distance.chi_square, freedom, draws, influence, weight)


def _inverse(matrix: Array) -> Array:
    """Inverse of a covariance of statistics, none narrower than drawn units tell."""
    size = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    scaled = matrix / np.outer(size, size) + _NARROW * np.eye(len(size))
    return np.asarray(np.linalg.inv(scaled) / np.outer(size, size))


def sample_of(values: Array, *, marked: bool = True) -> Sample:
    """Mean and covariance of units' whitened amplitudes; about none where they have no marks and so no mean."""
    if marked:
        return Sample(values.mean(axis=0), np.cov(values.T), len(values))
    return Sample(np.zeros(values.shape[1]), values.T @ values / len(values), len(values))


def interval(variance: float, error: float) -> tuple[float, float]:
    """Standard deviations between which a process' is, from its variance and that one's standard error.

    Where the variance is known, a chi-square of 2 (v/e)^2 degrees of freedom, as of the variance of a sample; where it
    may be none, the variance plus or less 1.96 errors.
    """
    low, high = math.sqrt(max(variance - 1.96 * error, 0.0)), math.sqrt(variance + 1.96 * error)
    if variance > 2.5 * error:
        freedom = 2 * (variance / error) ** 2
        low = math.sqrt(variance * freedom / chi_square(0.025, freedom))
        high = math.sqrt(variance * freedom / chi_square(0.975, freedom))
    return low, high
