"""Standard deviations of processes from the covariance of a lot's amplitudes, matched with units drawn and solved.

Page ``theory/lots.md``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
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
_ROUNDS = (4, 8)  # rough steps of a first estimate; and steps at most with weights that are kept
_ROUGH = 4  # every such unit is drawn where an estimate need only come near
_NARROW = 0.01  # of the statistics' variance: what some hundred units tell of a direction is not known better
_RENEWALS = (2, 4)  # of the weights, until the state stays: at most, of a first estimate, and of one that begins nearer
_SETTLED = 0.1  # fall of the objective, a chi-square
_SIZES, _FARTHER = 4, 1.5  # tries of where an interval ends, and times that it does so farther than before
_STEP = 4.0  # times which a variance changes in one step
_AFTER = 3  # rough steps of a start
_NEAR = 500.0  # deviance that these leave at most (430 in four lots): a start that is farther is given up
_MAKES = 0.15  # of all power: processes without which there is a start
_AGAIN = 0.02  # of a workshop's deviation, with which processes that vanished begin again
_LINEAR_STEPS = 40  # of the linear estimate, which need only come near
_BLOCKS = 8  # of the drawn units, one at a time left out
_LIKELIER = 2.0  # standard errors of a difference of deviances that are chance
_DOUBTED = 0.05  # chance of so large a chi-square, below which a fit is poor
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
    others : tuple of LotEstimate
        Other states that are as likely.
    """

    state: State
    covariance: Array = field(repr=False)
    chi_square: float
    freedom: int
    draws: Draws = field(repr=False)
    influence: Array = field(repr=False)
    weight: Array = field(repr=False)
    others: tuple[LotEstimate, ...] = ()

    @property
    def variance_error(self) -> Array:
        """Standard errors of the variances, shape (processes,)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)[:-COMPLIANCES]))

    def interval(self, process: int) -> tuple[float, float]:
        """Standard deviations between which that of a process is, in this state or in one as likely."""
        low, high = interval(float(self.state.deviation[process] ** 2), float(self.variance_error[process]))
        ends = [other.interval(process) for other in self.others]
        return min([low, *(end[0] for end in ends)]), max([high, *(end[1] for end in ends)])

    def shares(self, noise: Array) -> Array:
        """Share of the variance that each process makes, where the noise has a variance, (d,) to (processes,)."""
        power = np.einsum("cdd,d->c", self.draws.squares, noise) * self.state.deviation**2
        return np.asarray(power / power.sum())

    def more_elsewhere(self, noise: Array) -> list[int]:
        """Processes above zero in another fit and not in this one: of each fit the one whose share grows most."""
        alone, found = replace(self, others=()), list[int]()
        for other in self.others:
            at = int(np.argmax(other.shares(noise) - self.shares(noise)))
            if alone.interval(at)[0] == 0 < other.interval(at)[0] and at not in found:
                found.append(at)
        return found

    @property
    def poor(self) -> bool:
        """Whether chance makes so large a chi-square less often than in one lot of 20."""
        return self.chi_square > chi_square(_DOUBTED, self.freedom)

    def states_within(self, count: int, rng: np.random.Generator) -> list[State]:
        """States that the lot does not tell from the estimate: so many, drawn from its errors."""
        size, processes = np.sqrt(np.diag(self.covariance)), len(self.state.deviation)
        alike = self.covariance / np.outer(size, size)  # hardly positive where the lot leaves a sum of processes alone
        changes = size * rng.multivariate_normal(np.zeros(len(size)), alike, count, check_valid="ignore")
        variances = np.maximum(self.state.deviation**2 + changes[:, :processes], 0.0)
        return list(map(State, np.sqrt(variances), self.state.compliance + changes[:, processes:]))

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


class Likelihood(NamedTuple):
    """That of a lot at a state, were amplitudes normal.

    Attributes
    ----------
    deviance : ndarray, shape (blocks,)
        Minus twice its logarithm, each without one block of the drawn units.
    weights : ndarray, shape (2, d, d)
        Inverse covariances of either half of them.
    drawn : ndarray, shape (n, d)
        These units with noise, about their mean.
    units : int
        Of the lot.
    """

    deviance: Array
    weights: Array
    drawn: Array
    units: int

    @classmethod
    def of(cls, sample: Sample, values: Array, covariance: Callable[[Array], Array]) -> Likelihood:
        """That of a lot whose units are as those that are drawn.

        Parameters
        ----------
        sample : Sample
        values : ndarray, shape (n, d)
            Of the drawn units about their mean, without noise.
        covariance : callable
            Of some of these.
        """
        noise, found = np.eye(values.shape[1]), list[float]()
        for block in np.array_split(np.arange(len(values)), _BLOCKS):
            made = covariance(np.delete(values, block, axis=0)) + noise
            misfit = np.trace(np.linalg.solve(made, sample.covariance)) + np.linalg.slogdet(made)[1]
            found.append(sample.units * float(misfit))
        weights = np.array([np.linalg.inv(covariance(half) + noise) for half in np.array_split(values, 2)])
        drawn = values + np.random.default_rng(1).standard_normal(values.shape)
        return cls(np.array(found), weights, drawn, sample.units)

    def above(self, other: Likelihood) -> tuple[float, float]:
        """Deviance over that of another state, and how much of it may be chance.

        That of the drawn units is told by a jackknife, that of the lot by the spread of the likelihood ratio over units
        of the other state (Vuong 1989).
        """
        difference, forms = self.deviance - other.deviance, self.weights - other.weights
        of_drawn = np.var(difference) * (len(difference) - 1)
        ratios = np.einsum("hud,ud->hu", other.drawn @ forms, other.drawn)
        of_lot = self.units * max(float(np.cov(ratios)[0, 1]), 0.0)  # noise of the halves' weights has none in common
        return float(difference.mean()), _LIKELIER * math.sqrt(of_drawn + of_lot)


class _Fit(NamedTuple):
    """A state with the units that are drawn there, and how far their statistics are from a lot's."""

    state: State
    draws: Draws
    weights: _Weights
    distance: _Distance


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
        Others: of the first half the inverse covariance of amplitudes is made, of the second that of the statistics; of
        all of them the standard errors, mean influence and inverse covariance of the estimate.
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
            Whether rough steps are left out, and other starts where the fit is not poor.

        Returns
        -------
        LotEstimate
        """
        for _ in range(0 if again else _ROUNDS[0]):
            state = self._rough(state)
        fit, *others = [self._renewed(state, _RENEWALS[again])]
        if not again or fit.distance.chi_square > chi_square(_DOUBTED, self._freedom(fit.weights)):
            fit, *others = self._elsewhere(fit)
        return replace(self._told(fit), others=tuple(map(self._told, others)))

    def _renewed(self, state: State, times: int) -> _Fit:
        """Steps with statistics that are made at a state, and again where it moves, until it stays."""
        draws = self.simulator.draws(state, self.standard)
        for _ in range(times):
            before, weights = state, self._weights_at(state)
            state, draws, distance = self._settled(state, draws, weights)
            if self._near(before, state, distance, weights):
                break
        else:  # by statistics of another state errors are those of another one too
            weights = self._weights_at(state)
            distance = self._distance(draws, state, weights)
        return _Fit(state, draws, weights, distance)

    def _rough(self, state: State) -> State:
        """A step by few units and weights that follow the state."""
        draws = self.simulator.draws(state, self.standard[::_ROUGH])
        # of a covariance that is too large where contacts open: nothing runs away by it
        weight = np.asarray(np.linalg.inv(draws.covariance(state.deviation)))
        weights = self._weights(draws, weight, draws.squares, draws.values)
        distance = self._distance(draws, state, weights)
        self.tell(f"rough step: chi-square {distance.objective:.3g}")
        return self._stepped(state, distance, weights, 0.3)

    def _elsewhere(self, fit: _Fit) -> list[_Fit]:
        """The most likely of some fits, and those as likely: each begins without one of the processes that make most.

        Statistics that are made at a state are nearly blind to what others make where other contacts are open, so that
        each fits its own; the likelihood of the whole covariance is not.
        """
        found = [(fit, self._likelihood(fit.state))]
        for start in self._without(fit.state):
            try:
                for _ in range(_AFTER):
                    start = self._rough(start)
                if self._likelihood(start).above(found[0][1])[0] > _NEAR:
                    continue
                other = self._renewed(start, 1)
            except np.linalg.LinAlgError:  # so far off that statistics do not vary
                continue
            if not any(self._near(one.state, other.state, one.distance, one.weights) for one, _ in found):
                found.append((other, self._likelihood(other.state)))
        (best, least), *others = sorted(found, key=lambda one: float(one[1].deviance.mean()))
        told = [best]
        for one, there in others:
            above, chance = there.above(least)
            self.tell(f"another fit: deviance {above:.3g} larger, {chance:.3g} by chance")
            told += [one] if above < chance else []
        return told

    def _likelihood(self, state: State) -> Likelihood:
        """That of the sample with the prior."""
        values = self.simulator.values(state, self.fresh)
        found = Likelihood.of(self.sample, self.simulator.amplitudes.about_mean(values), self._made)
        return found._replace(deviance=found.deviance + self._prior(state))

    def _without(self, state: State) -> list[State]:
        """States in which one of the processes that make most makes nothing, and the others as much as is likely.

        Were influences the same in all units, the covariance would be the sum of v J J' and that of noise, and each
        step of the MM algorithm (Zhou, Hu, Qiao, Cho 2019) would make it likelier.
        """
        least = np.maximum(self.least, _AGAIN * self._workshop) ** 2
        some = np.maximum(state.deviation**2, least)
        squares = self.simulator.draws(replace(state, deviation=np.sqrt(some)), self.standard[::_ROUGH]).squares
        power = np.einsum("cdd->c", squares) * state.deviation**2
        rows, noise, units = squares.reshape(len(squares), -1), np.eye(squares.shape[1]), self.sample.units
        found = []
        for empty in np.argsort(-power)[: np.sum(power > _MAKES * power.sum())]:
            variance = np.where(np.arange(len(some)) == empty, 0.0, some)
            for _ in range(_LINEAR_STEPS):
                weight = np.linalg.inv((variance @ rows).reshape(noise.shape) + noise)
                more = rows @ (weight @ self.sample.covariance @ weight).ravel()
                variance = variance * np.sqrt(more / (rows @ weight.ravel() + 1 / (units * self._workshop**2)))
            found.append(replace(state, deviation=np.maximum(np.sqrt(variance), self.least)))
        return found

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

    @staticmethod
    def _freedom(weights: _Weights) -> int:
        """Quadratic forms less the variances they tell, two for each; linear ones are as many as the compliances."""
        return max(len(weights.forms) // 2, 1)

    # --- statistics ---------------------------------------------------------------------------------------------------

    def _made(self, values: Array) -> Array:
        """Covariance of drawn units, over all turns where there are no marks."""
        amplitudes = self.simulator.amplitudes
        return amplitudes.over_turns(sample_of(values, marked=amplitudes.marked).covariance)

    def covariance_with(self, state: State, shift: Array) -> Array:
        """Covariance of the amplitudes of one unit, noise included, shape (d, d), where parts are shifted.

        Parameters
        ----------
        state : State
        shift : ndarray, shape (components,)
            Core units.

        Raises
        ------
        NotConvergedError
            If no unit with it has an equilibrium.
        """
        standard = shift / state.deviation[self.simulator.parts.process]
        return self._covariance_of(self.simulator.values(state, self.fresh + standard))

    def _weight(self, values: Array) -> Array:
        return np.asarray(np.linalg.inv(self._covariance_of(values)))

    def _covariance_of(self, values: Array) -> Array:
        """Of units drawn for it alone; amplitudes of one order keep their covariances, others lose a share."""
        made, kept = self._made(values), 1 - _SHARE * ~self.simulator.amplitudes.same_order
        return np.asarray(made * kept + np.eye(len(made)))

    def _weights_at(self, state: State) -> _Weights:
        """Weights that are made with the inverse covariance of the amplitudes of a state's units."""
        draws = self.simulator.draws(state, self.others)
        mine, units = (self.simulator.values(state, some) for some in np.array_split(self.fresh, 2))
        of = self.simulator.parts.process
        means = np.array(
            [draws.influence[:, of == c] @ draws.influence[:, of == c].T for c in range(len(draws.squares))]
        )
        kinds = np.concatenate([draws.squares, self.simulator.amplitudes.over_turns(means)])
        return self._weights(draws, self._weight(mine), kinds, units)

    def _weights(self, draws: Draws, weight: Array, kinds: Array, units: Array) -> _Weights:
        """Quadratic forms W K W, K the mean of J J' or of J times its own, of each process; and their covariance.

        It is made of units that are drawn for it alone; of n of them the inverse of that of p statistics is too large
        by (n - 1) / (n - p - 2) (Hartlap, Simon, Schneider 2007).
        """
        forms = np.array([weight @ kind @ weight for kind in kinds])
        forms /= np.sqrt(np.einsum("ade,ade->a", forms, forms))[:, None, None]
        amplitudes = self.simulator.amplitudes
        noisy = amplitudes.about_mean(units) + np.random.default_rng(1).standard_normal(units.shape)
        spread = np.cov(np.array([np.einsum("ud,ud->u", noisy @ form, noisy) for form in forms]))
        shifted = draws.influence * self.simulator.parts.plausible
        whole = draws.mean_covariance(self.sample.units) + shifted @ shifted.T
        of_mean = np.linalg.solve(whole, draws.by_compliance.mean(axis=0).T).T[: COMPLIANCES * amplitudes.marked]
        too_large = (len(units) - 1) / max(len(units) - len(forms) - 2, 1)
        of_forms = _inverse(spread * (1 / (self.sample.units - 1) + 1 / len(draws.values)) * too_large)
        return _Weights(forms, of_mean, scipy.linalg.block_diag(of_forms, _inverse(of_mean @ whole @ of_mean.T)))

    def _distance(self, draws: Draws, state: State, weights: _Weights) -> _Distance:
        """Statistics of the sample less those of the drawn units, and how these change with the state."""
        amplitudes, forms, count = self.simulator.amplitudes, weights.forms, len(draws.values)
        about = amplitudes.about_mean(draws.values)
        pressed = np.array([about @ form for form in forms])  # (a, u, d)
        made = np.einsum("aud,ud->a", pressed, about) / (count - amplitudes.marked)
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

    def _raised(self, state: State, slope: Array, weights: _Weights) -> Array:
        """Slopes, those of processes that may be none as far as their intervals go, one process at a time."""
        slope, variance = slope.copy(), state.deviation**2
        farthest = np.zeros_like(variance)
        for _ in range(_SIZES):
            error = np.sqrt(np.diag(self._covariance(slope, weights))[: len(variance)])
            end = variance + 1.96 * error
            more = (variance < 2.5 * error) & (end > _FARTHER * farthest)
            if not more.any():
                break
            farthest[more] = np.maximum(end, 4 * farthest)[more]
            slope[:, np.flatnonzero(more)] = self._secants(state, farthest * more, weights)
        return slope

    def _secants(self, state: State, variance: Array, weights: _Weights) -> Array:
        """Changes of the statistics where one process at a time goes from none to a variance, over that.

        Its draws have either sign: what they share with those of others cancels.
        """
        contrast, found = np.array([-1.0, 0.5, 0.5]), []
        state = replace(state, deviation=np.where(state.deviation > self.least, state.deviation, 0.0))
        for none_and_both in self.simulator.raised(state, self.standard[::_ROUGH], np.sqrt(variance)):
            samples = [sample_of(values, marked=self.simulator.amplitudes.marked) for values in none_and_both]
            covariance = np.tensordot(contrast, [one.covariance for one in samples], 1)
            of_forms = np.einsum("ade,de->a", weights.forms, covariance)
            found.append(np.r_[of_forms, weights.of_mean @ (contrast @ [one.mean for one in samples])])
        return np.asarray(np.transpose(found) / variance[variance > 0])

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

    def _covariance(self, slope: Array, weights: _Weights) -> Array:
        """Of the errors of variances and compliances.

        A variance is known no worse than by its prior, an exponential of this mean and standard deviation.
        """
        prior = np.concatenate([2 * self._workshop**2, np.full(COMPLIANCES, STIFFNESS)])
        known = slope.T @ weights.inverse @ slope * np.outer(prior, prior) + np.eye(len(prior))
        size = np.sqrt(np.diag(known))
        inverse = np.linalg.pinv(known / np.outer(size, size), hermitian=True)
        return np.asarray(inverse * np.outer(prior / size, prior / size))

    def _told(self, fit: _Fit) -> LotEstimate:
        state, draws, weights, distance = fit
        blocks = np.array_split(self.fresh, -(-len(self.fresh) // len(self.standard)))  # influences are large
        fresh = [self.simulator.draws(state, some) for some in blocks]
        # noise of slopes is information that is none: the more units, the less
        slopes = [distance.slope, *(self._distance(some, state, weights).slope for some in fresh)]
        slope = np.average(slopes, axis=0, weights=[len(draws.values), *(len(some.values) for some in fresh)])
        slope = self._raised(state, slope, weights)
        freedom = self._freedom(weights)
        covariance = self._covariance(slope, weights)
        covariance *= max(distance.chi_square / freedom, 1.0)  # what the model lacks widens all intervals
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
