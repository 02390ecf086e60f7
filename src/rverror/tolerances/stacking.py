"""Tolerances of a model, and the stack of influences and draws that budget and allocation compute with.

A unit's output error over a revolution is TE(theta) = nominal(theta) + sum_c x_c W_c(theta), one term per toleranced
component c: one parameter of one instance of a source.  x_c = mean + T s_c with the width T of the component's
tolerance and a standard draw s_c of width 1, so all that follows is linear in the widths.  Page ``theory/budget.md``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array, Integers
from rverror.base.directions import Direction, direction_sign
from rverror.base.errors import InputError, check_each, renamed
from rverror.base.viewed import OneLine
from rverror.dynamics.at_speed import influences_at_speed
from rverror.geartrain.contacts import closed_form_forces, pose
from rverror.geartrain.mechanism import Reducer, core_torque
from rverror.model.catalogue import source
from rverror.model.compose import source_matrix, transmission_error
from rverror.model.effects import Effect, Model, check_model
from rverror.model.readings import stand
from rverror.tolerances.cost import Choice
from rverror.tolerances.declared import Tolerance
from rverror.tolerances.dependence import Dependence, correlations, dependence, fits, places
from rverror.tolerances.distribution import Scalar, normal_quantile
from rverror.tolerances.sampling_rule import Component, SamplingRule, WorstGroup

#: Angles of one revolution where none are given: the mesh orders of an RV-40E need them.
ANGLES = 4096

_ROUNDING = 1e-12  # relative
_SOLVED = 1e-9  # relative: the pose at a load and the motion about it are found to some 1e-10


@dataclass(frozen=True)
class Stack(OneLine):
    """A model and its tolerances as arrays.

    Attributes
    ----------
    nominal : ndarray, shape (n,)
        rad; output error of the declared model with all toleranced values at their means.
    influence : ndarray, shape (m, n)
        rad per core unit (mm, rad) of each component.
    components : tuple of Component, length m
    entry : ndarray of int, shape (m,)
        Tolerance to which each component belongs.
    width : ndarray, shape (entries,)
        Widths T as given, core units.
    labels : tuple of str
        Name of each entry.
    rules : tuple of SamplingRule
        How each entry is drawn.
    theta : ndarray, shape (n,), optional
        Nominal output angle, rad.
    speed : float, optional
        Input speed, rad/s; None for the closed form at a crawl.
    dependence : Dependence, optional
        Correlation between entries; None where all are independent.
    model : str
        Name of the unit, for people.
    choices : tuple of Choice
        What may be bought for each entry; empty where that is not said.
    """

    nominal: Array
    influence: Array
    components: tuple[Component, ...]
    entry: Integers
    width: Array
    labels: tuple[str, ...]
    rules: tuple[SamplingRule, ...]
    theta: Array | None = field(default=None)
    speed: float | None = field(default=None)
    dependence: Dependence | None = field(default=None)
    model: str = ""
    choices: tuple[Choice, ...] = ()

    def scaled(self, width: Array | None = None) -> Array:
        """Influence of the standard draws, rad, shape (m, n): `influence` times the width of each component.

        Widths, one for each entry, are in core units; those as given where left out.
        """
        used = self.width if width is None else np.asarray(width, dtype=np.float64)
        return self.influence * used[self.entry][:, None]

    @property
    def dimensions(self) -> int:
        """Uniform variates that one unit takes."""
        return self.rules[-1].variates.stop if self.rules else 0

    @property
    def variate_entry(self) -> Integers:
        """Entry to which each variate belongs, shape (dimensions,)."""
        counts = [rule.variates.stop - rule.variates.start for rule in self.rules]
        return np.repeat(np.arange(len(self.rules), dtype=np.intp), counts)

    def standard(self, uniforms: Array) -> Array:
        """Standard draws s, shape (units, m), width 1 and mean 0, from variates in 0..1, shape (units, dimensions)."""
        drawn = np.empty((uniforms.shape[0], self.influence.shape[0]))
        if self.dependence is not None:
            uniforms = self.dependence.matched(uniforms)
        for rule in self.rules:
            if not rule.joined:
                drawn[:, rule.components] = rule.standard(uniforms[:, rule.variates])
        together = [rule for rule in self.rules if rule.joined]
        if self.dependence is not None and together:
            normal = normal_quantile(np.concatenate([uniforms[:, rule.variates] for rule in together], axis=1))
            normal = normal @ self.dependence.factor.T
            for rule in together:
                assert isinstance(rule.distribution, Scalar)
                count = rule.instances * rule.terms
                drawn[:, rule.components] = rule.distribution.from_normal(normal[:, :count])
                normal = normal[:, count:]
        return drawn

    @property
    def middle(self) -> Array:
        """Middle of the limits of each standard draw, whose mean is 0, shape (m,)."""
        return np.array([rule.distribution.middle for rule in self.rules])[self.entry]

    def at_middle(self, width: Array | None = None) -> Array:
        """Output error with all toleranced values in the middle of their limits, rad, shape (n,)."""
        return self.nominal + self.middle @ self.scaled(width)

    @property
    def worst_groups(self) -> tuple[WorstGroup, ...]:
        """Components that the worst case chooses together."""
        return tuple(group for rule in self.rules for group in rule.worst_groups())


@renamed(speed="input_speed")
def stack(
    model: Model,
    tolerances: Sequence[Tolerance],
    theta: Any = None,
    *,
    direction: Direction = "forward",
    torque: Any = None,
    input_speed: Any = None,
) -> Stack:
    """Lay a model and its tolerances out as arrays.

    Parameters
    ----------
    model : Model
    tolerances : sequence of Tolerance
    theta : array_like or quantity, shape (n,), optional
        Nominal output angle, rad; `ANGLES` over one revolution where left out.
    direction : {"forward", "reverse"} or +1 or -1, optional
    torque : float or quantity, optional
        Needed by ``load.torsion``; at a speed the load, the rated one where left out.
    input_speed : float or quantity, optional
        Of the input, rad/s: influences are then those of the loaded reducer in motion, over the angles of one period.

    Returns
    -------
    Stack

    Raises
    ------
    ValueError
        If there is no tolerance, one does not fit the mechanism, or the angles are unusable.
    InputError
        If there are angles beside a speed, or as `influences_at_speed`.

    Examples
    --------
    >>> import rverror
    >>> unit = rverror.Model(rverror.reducer("RV-40E"))
    >>> cams = stack(unit, [rverror.tolerance("crank.eccentricity", "5 um")])
    >>> cams.influence.shape, cams.dimensions, str(cams.components[0])
    ((8, 4096), 8, 'crank.eccentricity(crank=0, disc=0).radial')
    """
    check_model(model)
    remedy = "give load_tolerances(path), or a list such as [tolerance('crank.eccentricity', '5 um')]"
    check_each("tolerances", tolerances, Tolerance, remedy)
    if not tolerances:
        raise InputError("no tolerance; give at least one")
    direction = direction_sign(direction)
    every = [(item.key, indices) for item in tolerances for indices in item.instances(model.mechanism)]
    if input_speed is None:
        theta = 2 * np.pi * np.arange(ANGLES) / ANGLES if theta is None else theta
        load = None if torque is None else units.InCore(core_torque(model.mechanism, torque))
        where = stand(model, pose(model.mechanism, theta, direction=direction, torque=load))
        forces = closed_form_forces(where.gears)
        nominal = transmission_error(model, where.read.theta, direction=direction, torque=load, forces=forces)
        angles, rounding = where.read.theta, _ROUNDING
        sources = (source_matrix(where.of(key), forces, key, indices) for key, indices in every)
    else:
        if theta is not None:
            raise InputError("theta: at a speed the angles are those of one period; leave them out")
        none = [Effect(key, indices, (0.0,) * len(source(key).parameters)) for key, indices in every]
        moving = influences_at_speed(model, input_speed, none, torque=torque, direction=direction)
        angles, nominal, matrices, input_speed = moving
        sources, rounding = (matrix for matrix in matrices), _SOLVED
    joined = {e for pair in correlations(tolerances) for e in pair}
    partner = {e: (f, fit) for pair, fit in fits(tolerances).items() for e, f in (pair, pair[::-1])}
    lever = model.mechanism.crank_radius if isinstance(model.mechanism, Reducer) else 1.0
    components: list[Component] = []
    rules: list[SamplingRule] = []
    rows: list[Array] = []
    means: list[float] = []
    for e, item in enumerate(tolerances):
        chosen = [i for i, p in enumerate(source(item.key).parameters) if p in item.chosen]
        instances = item.instances(model.mechanism)
        first = rules[-1].variates.stop if rules else 0
        classes, class_of = item.classes, tuple[int, ...]()
        if e in partner:
            other, fit = partner[e]
            classes, class_of = fit.classes, places(instances, tolerances[other].instances(model.mechanism))
        law = item.distribution, item.correlation, item.random_phase, e in joined
        rules.append(SamplingRule(first, len(components), len(instances), len(chosen), *law, classes, class_of))
        least = rounding / (lever if item.chosen[0].dimension == "length" else 1.0)  # below it an influence is rounding
        for indices in instances:
            rows.append(_without_rounding(next(sources)[chosen], least, rounding))
            components += [Component(item.key, indices, p.name, p.dimension) for p in item.chosen]
            means += [item.mean.get(p.name, 0.0) for p in item.chosen]
    influence = np.concatenate(rows)
    return Stack(
        nominal=nominal + np.array(means) @ influence,
        influence=influence,
        components=tuple(components),
        entry=np.repeat(np.arange(len(rules), dtype=np.intp), [rule.instances * rule.terms for rule in rules]),
        width=np.array([item.width for item in tolerances]),
        labels=_distinct([item.label for item in tolerances]),
        rules=tuple(rules),
        theta=angles,
        speed=input_speed,
        dependence=dependence(tolerances, rules, components),
        model=model.name or model.mechanism.name or "the model",
        choices=tuple(item.choice for item in tolerances),
    )


def _without_rounding(rows: Array, least: float, rounding: float) -> Array:
    """Rows of which only rounding is left, or of which only rounding is no constant, made exactly so."""
    size = np.abs(rows).max(axis=1, keepdims=True)
    steady = np.ptp(rows, axis=1, keepdims=True) <= rounding * size + least
    return np.where(size <= least, 0.0, np.where(steady, rows.mean(axis=1, keepdims=True), rows))


def _distinct(labels: Sequence[str]) -> tuple[str, ...]:
    """Number labels that come more than once."""
    return tuple(f"{t} #{labels[: i + 1].count(t)}" if labels.count(t) > 1 else t for i, t in enumerate(labels))
