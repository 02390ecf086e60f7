"""Search of causes in order tables: one after another, by a linear step beside everything, then refitted at the load.

A table of a real unit is never explained to its noise, a fraction of an arcsecond.  What is left of an order has few
independent values, of each direction a constant and a slope over the load, so that some sizes of a cause that is none
take a good part of it.  A cause is therefore made a claim only where it is significant, takes half of what is left of
an order or more, and predicts loads that its sizes did not see.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy

from rverror.base.arrays import Array, Flags
from rverror.base.chance import chi_square
from rverror.base.text import describe
from rverror.diagnosis.causes import Named, caused, identity, named
from rverror.diagnosis.gears.fit import Fit, bounds, evaluated, fitted, solved, stepped, without_effect
from rverror.diagnosis.gears.ranking import Columns, columns_of
from rverror.diagnosis.journal import Journal
from rverror.diagnosis.orders.table_set import TableSet
from rverror.model.catalogue import source
from rverror.model.effects import Effect
from rverror.model.empirical import ORDER
from rverror.statics.loaded_state import NotConvergedError

_STEPS = 20  # of a refit at the load, at most.  Chosen for time
_MOST = 16  # additions at most.  Chosen: ends a search that turns in a circle


def conditions_of(fit: Fit) -> TableSet:
    """The conditions of tables, of a fit to them."""
    assert isinstance(fit.run_set, TableSet)
    return fit.run_set


@dataclass(frozen=True, eq=False)
class Linear:
    """The table about a state of the fit: everything that is free, and blocks beside it.

    Attributes
    ----------
    fit : Fit
        Where it is linear.
    blocks : tuple of Columns
    held : bool
        Whether everything but the blocks keeps its size.
    """

    fit: Fit
    blocks: tuple[Columns, ...] = ()
    held: bool = False

    @property
    def run_set(self) -> TableSet:
        """The conditions."""
        return conditions_of(self.fit)

    @cached_property
    def free(self) -> Flags:
        """Which values of the fit may move: not those that are exact, nor those at a bound."""
        low, high = bounds(self.fit)
        return np.asarray(self.fit.free & (low < 0) & (high > 0) & (not self.held))

    @cached_property
    def rows(self) -> Array:
        """All rows that are free, shape (k, m)."""
        own = np.concatenate(self.fit.rows, axis=1)[1:][self.free]
        return np.concatenate([own, *(np.concatenate(block.rows, axis=1) for block in self.blocks)])

    @cached_property
    def weights(self) -> Array:
        """Inverse variances of priors, shape (k,)."""
        prior = [np.array(self.run_set.deviation(*block.name)) ** -2.0 for block in self.blocks]
        return np.concatenate([self.fit.weights[self.free], *prior])

    @cached_property
    def departure(self) -> Array:
        """How far each value is from the middle of its prior, shape (k,)."""
        own = self.fit.departure[self.free]
        return np.concatenate([own, np.zeros(sum(len(b.directions) for b in self.blocks))])

    def step(self, kept: Array | None = None) -> Array:
        """Step that lowers the objective most, of all numbers or of those that are kept, shape (k,)."""
        rest = np.concatenate(self.fit.rows, axis=1)[0]
        rows = self.rows if kept is None else self.rows[:, kept]
        right = rows @ (rest if kept is None else rest[kept]) - self.weights * self.departure
        return solved(rows @ rows.T, right, self.weights)

    def left(self, step: Array) -> Array:
        """What a step leaves, shape (m,)."""
        return np.asarray(np.concatenate(self.fit.rows, axis=1)[0] - step @ self.rows)

    @cached_property
    def best(self) -> Array:
        """The best step, shape (k,)."""
        return self.step()

    @cached_property
    def objective(self) -> float:
        """Squares and priors at the best step."""
        rest = self.left(self.best)
        return float(rest @ rest + self.weights @ (self.departure + self.best) ** 2)

    @cached_property
    def squares(self) -> Array:
        """What the best step leaves of each order, shape (n,)."""
        return self.run_set.by_order(self._of_cases(self.left(self.best) ** 2))

    def _of_cases(self, values: Array) -> list[Array]:
        """All numbers, those of each condition."""
        return np.split(values, np.cumsum([at.size for at in self.run_set.places])[:-1])

    @cached_property
    def measured(self) -> Array:
        """Squares of what is measured of each order, shape (n,)."""
        return self.run_set.by_order(one.whiten(one.measured) ** 2 for one in self.run_set.observations)

    @cached_property
    def left_out(self) -> list[Array]:
        """What is left of each condition with sizes from the others, in units of its noise.

        Every third load is left out in its turn; every third condition where loads are few.
        """
        loads = np.array([case.condition.torque or 0.0 for case in self.run_set.cases])
        distinct = np.unique(loads)
        place = np.searchsorted(distinct, loads) if distinct.size > 2 else np.arange(loads.size)
        of = np.repeat(place % 3, [at.size for at in self.run_set.places])
        rest = np.zeros(of.size)
        for fold in np.unique(of):
            rest[of == fold] = self.left(self.step(of != fold))[of == fold]
        return self._of_cases(rest)

    @property
    def left_out_squares(self) -> float:
        """Squares of conditions that are left out."""
        return float(sum(rest @ rest for rest in self.left_out))

    def places(self, number: int) -> slice:
        """Where the sizes of a block stand in a step."""
        first = int(self.free.sum()) + sum(len(b.directions) for b in self.blocks[:number])
        return slice(first, first + len(self.blocks[number].directions))

    def sizes(self, number: int) -> Array:
        """Sizes of a block at the best step."""
        return self.best[self.places(number)]

    def effects(self) -> list[Effect]:
        """Blocks as effects, at their best sizes."""
        return [caused(block.name, self.sizes(number)) for number, block in enumerate(self.blocks)]

    @cached_property
    def covariance(self) -> Array:
        """Covariance of what is free, shape (k, k)."""
        return np.asarray(np.linalg.pinv(self.rows @ self.rows.T + np.diag(self.weights), hermitian=True))

    def possible(self) -> bool:
        """Tell whether every block's sizes can be: of the sign that they have."""
        return all(
            (self.sizes(n) >= [p.least for p in source(b.name[0]).parameters]).all() for n, b in enumerate(self.blocks)
        )

    def beside(self, block: Columns) -> Linear:
        """The same with one block more."""
        return replace(self, blocks=(*self.blocks, block))


def blocks_of(fit: Fit, candidates: Sequence[Named]) -> list[Columns]:
    """Every candidate that a model does not have and the table can show."""
    taken = {named(e) for e in fit.model.effects}
    free = [c for c in candidates if identity(c) not in taken]
    made = columns_of(fit, free) if free else []
    # a size that a workshop makes does more than noise to some number
    return [b for b in made if any(np.abs(b.plausible[:, None] * rows).max() > 1 for rows in b.rows)]


def searched(fit: Fit, candidates: Sequence[Named], journal: Journal) -> Fit:
    """Add what the waves ask for, one after another, and refit everything at the load.

    Parameters
    ----------
    fit : Fit
        Of what is declared, and found already.
    candidates : sequence of Named
    journal : Journal
    """
    left = list(candidates)
    for _ in range(_MOST):
        journal.round += 1
        more = _next(Linear(fit), blocks_of(fit, left), journal, claims=True)
        if more is None:
            break
        name = more.blocks[-1].name
        journal.tell(f"added {describe(*name)}")
        left.remove(name)  # what is dropped once would be the best again
        fit = _pruned(refitted(fit, more), journal)
    return fit


def _pruned(fit: Fit, journal: Journal) -> Fit:
    """The fit without causes that others make needless: at the load one makes orders that by a linear step it does not.

    Each is taken out by a linear step, and the least needed one refitted away.
    """
    while fit.added:
        least = [
            (Linear(without_effect(fit, n)).objective - chi_square(fit.run_set.policy.false_alarm, len(e.values)), n)
            for n, e in enumerate(fit.added)
        ]
        objective, number = min(least)
        if objective > Linear(fit).objective:
            break
        gone = fit.added[number]
        journal.note("dropped", (gone.key, gone.indices), "needless once all are refitted at the load")
        model = fit.model_with(instead_of=number)
        fit = fitted(evaluated(fit.run_set, model, fit.declared, fit.waves), steps=_STEPS, enough=1.0)
    return fit


def described(fit: Fit, laws: Sequence[Named], journal: Journal) -> Linear:
    """Laws over load and direction for what no cause accounts for, down to the noise; the causes keep their sizes.

    Fitted together with laws a cause would be free to be anything: the laws would make up for it.

    Parameters
    ----------
    fit : Fit
        Under the noise alone.
    laws : sequence of Named
    journal : Journal
    """
    state, pool = Linear(fit, held=True), blocks_of(fit, laws)
    for _ in pool:
        journal.round += 1
        more = _next(state, pool, journal, claims=False)
        if more is None:
            break
        state = more
    return state


def refitted(fit: Fit, state: Linear) -> Fit:
    """The fit with a linear state's blocks, refitted at the load."""
    effects = state.effects()
    step = np.zeros(fit.moment.size)
    step[state.free] = state.best[: int(state.free.sum())]
    for share in (1.0, 0.5, 0.0):  # what bends so much that it does not stand is begun nearer to nothing
        sized = [replace(e, values=tuple(share * v for v in e.values)) for e in effects]
        model = stepped(fit.model, share * step).with_effects(*sized)
        try:
            return fitted(evaluated(fit.run_set, model, fit.declared, fit.waves), steps=_STEPS, enough=1.0)
        except NotConvergedError:
            continue
    return fit


def _next(state: Linear, pool: Sequence[Columns], journal: Journal, *, claims: bool) -> Linear | None:
    """The state with the best block more that is a cause; none where none is."""
    taken = {identity(b.name) for b in state.blocks}
    trials = [state.beside(block) for block in pool if identity(block.name) not in taken]
    trials = sorted((t for t in trials if t.possible()), key=lambda t: t.objective)
    policy = state.run_set.policy
    for trial in trials[:_MOST]:
        block, gain = trial.blocks[-1], state.objective - trial.objective
        if gain < chi_square(policy.false_alarm / len(pool), len(block.directions)):
            return None
        beyond = state.squares > state.run_set.most_of_noise
        if claims and beyond.any() and not _takes(state, block, beyond):
            journal.note("fell", block.name, "takes less than half of what is left of any order")
        elif trial.left_out_squares > state.left_out_squares:
            journal.note("fell", block.name, "loads that its sizes did not see are predicted worse with it")
        else:
            journal.note("added", block.name, f"lowers the objective by {gain:.3g}")
            return trial
    return None


def _takes(state: Linear, block: Columns, beyond: Flags) -> bool:
    """Tell whether a block takes half of what is left of an order, and a good part of what is measured of it.

    Of what changes with the load alone where the block does nothing without one: a constant of another cause is no
    reason against it.
    """
    if "torque" in source(block.name[0]).needs:
        state = replace(state, blocks=(*state.blocks, *_constants(state)))
    before, after = state.squares, state.beside(block).squares
    policy = state.run_set.policy
    much = before - after > policy.claim_counts * state.measured
    return bool((beyond & much & (after < (1 - policy.claim_takes) * before)).any())


def _constants(state: Linear) -> list[Columns]:
    """Waves of any size that are the same at all loads, of each direction."""
    run_set, found = state.run_set, []
    for place in range(run_set.orders.size):
        for sense in sorted({case.condition.direction for case in run_set.cases}):
            rows = []
            for case, at, sigma in zip(run_set.cases, run_set.places, run_set.sigmas, strict=True):
                own = (at == place) & (case.condition.direction == sense)
                first = np.arange(at.size) < case.orders.size
                rows.append(np.stack([own & first, own & ~first]) / sigma)
            found.append(Columns((ORDER.key, {"frame": "output", "harmonic": place}), np.eye(2), tuple(rows)))
    return found


def rivals(fit: Fit, number: int, candidates: Sequence[Named]) -> list[Named]:
    """Other causes that, in one's place, take of its leading order what it takes: nine tenths of it or more.

    By a linear step, and whatever else they take: a table of few orders tells no more, so that what comes as near may
    be the cause.
    """
    bare, at = _leading(fit, number)
    without, own = Linear(bare), Linear(fit).squares[at]
    most = own + 0.1 * (without.squares[at] - own)
    found = []
    for block in blocks_of(bare, candidates):
        trial = without.beside(block)
        if identity(block.name) != named(fit.added[number]) and trial.possible() and trial.squares[at] < most:
            found.append((trial.objective, (block.name[0], dict(block.name[1]))))
    return [name for _, name in sorted(found, key=lambda pair: pair[0])]


def _leading(fit: Fit, number: int) -> tuple[Fit, int]:
    """The state without an added effect, and the place of the order of which that leaves most more."""
    bare = without_effect(fit, number)
    return bare, int(np.argmax(Linear(bare).squares - Linear(fit).squares))


def chance(fit: Fit, number: int) -> tuple[float, float, float]:
    """Leading order of an added effect, what share of what is left of it without it it takes, and the chance of that.

    Of the M values that a law over the load has p sizes that mean nothing take a share x or more with the chance of
    the beta distribution of p/2 and (M - p)/2: where there are as many sizes as values that is 1.
    """
    run_set = conditions_of(fit)
    bare, at = _leading(fit, number)
    before, after = Linear(bare).squares, Linear(fit).squares
    sizes = len(fit.added[number].values)
    values = float(run_set.values[1][at])
    share = min(max(1 - after[at] / max(float(before[at]), 1e-300), 0.0), 1.0)
    odds = 1.0 if sizes >= values else float(scipy.special.betaincc(sizes / 2, (values - sizes) / 2, share))
    return float(run_set.orders[at]), share, odds
