"""A unit at the load as its sessions show it in the mean: what each part error does there, and how well that is known.

Page ``theory/trend.md``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.geartrain.source import Known, rv
from rverror.life.sessions import History
from rverror.lots.processes import UnitParts, processes_of_source
from rverror.lots.simulated import Simulator, State
from rverror.model.catalogue import CATALOGUE
from rverror.model.effects import Model
from rverror.statics.loaded_state import SOFTENING, NotConvergedError

#: Standard deviations of what is stated of `SOFTENING`: logarithms of compliances, and exponents of a contact law, of
#: which 10/9, line contact, is as likely as 1.  Backlash is no matter of one direction.
_STATED = {"gear_backlash": 0.0, "profile_curvature": 0.0, "pin_exponent": 0.1, "flank_exponent": 0.1}
_COMPLIANCE = 0.25
_START, _LEAST = 0.15, 1e-3  # spreads of parts over a workshop's: the first, and the least of a kind that does not show
_TOLD = 0.1  # of a size of a kind, with which its spread is told
#: Shares of an amplitude that the model may miss, one after another: with the least alone the first step of a unit
#: whose contacts open would be a leap.  The last is what exact poses and contacts make.
_MISSED, _STEPS, _SETTLED = (1.0, 0.3, 0.1, 0.03, 0.01, 0.003), 16, 0.02
_SPREADS = 0.1  # share below which the sessions tell the spreads of parts
_FLOOR = 0.1  # of the mean power of orders, which every order's has in addition
_DRAWS = 7  # states within what the sessions tell
_EVERY = 0.02  # of an influence, what no state tells: exact poses, and samples between which contacts close


@dataclass(frozen=True)
class UnitState:
    """A unit about the state that makes its mean error.

    Attributes
    ----------
    simulator : Simulator
    history : History
    values : ndarray, shape (components,)
        Sizes of all part errors, core units: not told apart, but in sum they make the error.
    softening : ndarray, shape (10,)
        Changes of `SOFTENING` over the model.
    amplitudes : ndarray, shape (conditions * 2 * k,)
        Of the unit, rad.
    influences : ndarray, shape (states, conditions * 2 * k, components)
        Change of an amplitude per core unit of each component, rad: of this state, then of others that make the mean
        error as well.
    """

    simulator: Simulator
    history: History
    values: Array
    softening: Array
    amplitudes: Array
    influences: Array

    @property
    def parts(self) -> UnitParts:
        """Of the unit."""
        return self.simulator.parts

    def with_changes(self, changes: Array) -> Array:
        """Amplitudes with some changes of the part errors, solved at the load, rad, shape (n, conditions * 2 * k).

        Raises
        ------
        InputError
            If a unit with such errors has no equilibrium.
        """
        state = State(np.ones(len(self.parts.processes)), self.softening)
        found = self.simulator.values(state, self.values + changes)
        if len(found) < len(changes):
            raise InputError("the unit with such errors has no equilibrium; check the model and the torque of the runs")
        return np.asarray(found / self.simulator.scale)


def unit_parts(model: Model, run: Known) -> UnitParts:
    """Every part error that diagnosis tries, with play and wear, one process for the parts of a kind."""
    unit = rv(model.mechanism)
    usable = (e for e in CATALOGUE.values() if e.applies_to(unit) and e.tried and e.periodic and not e.lacks(unit, run))
    return UnitParts(tuple(one for entry in usable for one in processes_of_source(entry, unit, entry.parameters)))


@dataclass(frozen=True)
class _At:
    """A unit of some sizes: whitened amplitudes, influences; weighted slopes, and what is left."""

    sizes: Array
    rows: Array
    influence: Array
    slopes: Array
    left: Array


def unit_state(model: Model, history: History) -> UnitState:
    """Solve a unit at the load with part errors that make the mean of its sessions.

    The most probable of all part errors, stiffnesses and exponents: some hundred sizes of which few are told, but
    contacts open and close as they do in the unit.  States drawn about it, as probable, tell how well an influence is
    known.

    Parameters
    ----------
    model : Model
    history : History

    Returns
    -------
    UnitState

    Raises
    ------
    InputError
        If the model has no equilibrium.
    """
    parts = unit_parts(model, history.amplitudes.conditions[0])
    simulator = Simulator(model, parts, history.amplitudes)
    soft = len(SOFTENING)
    rigid = np.array([p.dimension in ("length", "angle") for p in parts.parameters])
    stated = np.array([_STATED.get(name, _COMPLIANCE) for name in SOFTENING])
    most = np.where(rigid, parts.plausible, 0.0)
    prior = np.concatenate([_START * most, stated])
    least = np.concatenate([parts.least, np.full(soft, -math.inf)])
    random = np.random.default_rng(0)  # the same each time: a result is not a matter of luck
    sizes = np.maximum(prior * np.concatenate([random.standard_normal(len(most)), np.zeros(soft)]), least)
    mean, seen = history.values.mean(axis=0), math.sqrt(len(history.at))
    power = mean**2 + _FLOOR * (mean**2).mean()
    of_whitened = history.whitening * np.sqrt(history.amplitudes.noise)  # makes rows of amplitudes over their own noise

    def solved(sizes: Array, weight: Array) -> _At | None:
        try:
            rows, influence, by_softening = simulator.linearised(sizes[:-soft], sizes[-soft:])
        except NotConvergedError:
            return None
        slopes = np.concatenate([influence, by_softening]) @ of_whitened.T
        return _At(sizes, rows, influence, (slopes * weight).T, (mean - of_whitened @ rows) * weight)

    for share in _MISSED:
        weight = seen / np.sqrt(1 + (share * seen) ** 2 * power)
        weight[len(mean) - history.own_zeros :] = 0.0  # play that the unit has had from the start is not asked for
        now, damping = solved(sizes, weight), 0.0
        if now is None:
            raise InputError("the model has no equilibrium under the torque of the runs; check both")
        for _ in range(_STEPS):
            other = solved(np.maximum(now.sizes + _step(now, prior, damping), least), weight)
            if other is None or _cost(other, prior) >= _cost(now, prior):
                damping = max(10 * damping, 1.0)
                continue
            gained = _cost(now, prior) - _cost(other, prior)
            now, damping = other, damping / 10
            if share < _SPREADS:
                prior = np.concatenate([_spreads(now, prior, parts, most), stated])
            if gained < max(_SETTLED * _cost(now, prior), 1.0):
                break
        sizes = now.sizes
    assert now is not None
    root = np.linalg.cholesky(_normal(now, prior))  # others as probable have the prior's spread where nothing tells
    alike = [now.sizes + prior * np.linalg.solve(root.T, random.standard_normal(len(prior))) for _ in range(_DRAWS)]
    drawn = [solved(np.maximum(one, least), weight) for one in alike]
    influences = [one.influence.T / simulator.scale[:, None] for one in (now, *drawn) if one is not None]
    return UnitState(
        simulator, history, now.sizes[:-soft], now.sizes[-soft:], now.rows / simulator.scale, np.array(influences)
    )


def _cost(now: _At, prior: Array) -> float:
    """Minus twice the log posterior."""
    return float(now.left @ now.left + np.sum(_standard(now, prior) ** 2))


def _standard(now: _At, prior: Array) -> Array:
    """Sizes over their standard deviations."""
    return np.divide(now.sizes, prior, out=np.zeros_like(prior), where=prior > 0)


def _normal(now: _At, prior: Array) -> Array:
    """Information on sizes over their standard deviations."""
    slopes = now.slopes * prior
    return np.asarray(slopes.T @ slopes + np.eye(len(prior)))


def _step(now: _At, prior: Array, damping: float) -> Array:
    """Step of Levenberg and Marquardt, damped in units of the prior."""
    normal = _normal(now, prior) + damping * np.eye(len(prior))
    right = prior * (now.slopes.T @ now.left) - _standard(now, prior)
    return np.asarray(prior * np.linalg.solve(normal, right))


def _spreads(now: _At, prior: Array, parts: UnitParts, most: Array) -> Array:
    """Standard deviation of the parts of each kind that makes the sessions most probable.

    A step of MacKay: the sum of the squared sizes of a kind over how many of them are determined.
    """
    count = len(parts.process)
    left_open = np.diag(np.linalg.inv(_normal(now, prior)))[:count]
    determined = np.bincount(parts.process, 1 - left_open)
    squares = np.bincount(parts.process, now.sizes[:count] ** 2)
    spread = np.sqrt(squares / np.maximum(determined, _TOLD))[parts.process]
    return np.clip(spread, _LEAST * most, most)


def known_to(columns: Array) -> Array:
    """Variance of columns that were taken in several states, with what no state tells.

    Parameters
    ----------
    columns : ndarray, shape (states, d, n)

    Returns
    -------
    ndarray, shape (d, n)
    """
    spread = columns.var(axis=0, ddof=1) if len(columns) > 1 else np.zeros(columns.shape[1:])
    mean = columns.mean(axis=0)
    return np.asarray(spread + _EVERY**2 * (mean**2 + (mean**2).mean(axis=0)))
