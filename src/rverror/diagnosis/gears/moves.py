"""States from which a set of causes is fitted: at an offer's sizes, in equivalent places, from declared starts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from rverror.base.arrays import Array
from rverror.diagnosis.gears.fit import Fit
from rverror.diagnosis.gears.ranking import Offer
from rverror.diagnosis.gears.score import named
from rverror.geartrain.mechanism import Mechanism
from rverror.model.catalogue import source
from rverror.model.effects import Effect, Model


@dataclass(frozen=True, eq=False)
class Trial:
    """A state on few angles, and the score that a fit of everything may reach from there."""

    fit: Fit
    prospect: float


def with_offer(model: Model, offer: Offer) -> Model:
    """The model with candidates at the sizes of an offer, none far beyond what a workshop makes."""
    effects = []
    for (key, indices), sizes in zip(offer.names, offer.sizes, strict=True):
        most = np.array([0.7 * p.plausible for p in source(key).parameters])
        within = sizes / max(1.0, float((np.abs(sizes) / most).max()))
        effects.append(Effect(key, dict(indices), tuple(map(float, within))))
    return model.with_effects(*effects)


def equivalents(effect: Effect, unit: Mechanism) -> list[Effect]:
    """The same sizes, or the opposite, where contacts alone tell them from these."""
    entry, found = source(effect.key), []
    if entry.starts and all(p.least < 0 for p in entry.parameters):
        found.append(replace(effect, values=tuple(-v for v in effect.values)))
    choices = []
    for index in entry.indices:
        value = effect.indices[index.name]
        choices.append([(value, 1.0), *index.equivalents(unit, value)])
    for combined in list(product(*choices))[1:]:
        indices = {index.name: value for index, (value, _) in zip(entry.indices, combined, strict=True)}
        sign = math.prod(s for _, s in combined)
        found.append(replace(effect, indices=indices, values=tuple(sign * v for v in effect.values)))
    return found


def started(effect: Effect) -> list[Effect]:
    """The cause at each of its starts."""
    plausible = [p.plausible for p in source(effect.key).parameters]
    return [
        replace(effect, values=tuple(float(s * p) for s, p in zip(start, plausible, strict=True)))
        for start in source(effect.key).starts
    ]


def marked(model: Model, offset: float) -> Model:
    """The model with its marks at an offset."""
    effects = tuple(replace(e, values=(offset,)) if source(e.key).acts == "marks" else e for e in model.effects)
    return replace(model, effects=effects)


def distinct(trials: Sequence[Trial], most: int) -> list[Trial]:
    """So many at most, in order, of each set no more than two, whose last cause points elsewhere."""
    ahead: dict[object, list[Array]] = {}
    kept: list[Trial] = []
    for trial in trials:
        added = trial.fit.added
        sizes = np.concatenate([np.array(e.values) / [p.plausible for p in source(e.key).parameters] for e in added])
        way = sizes / max(float(np.linalg.norm(sizes)), 1e-300)
        name = frozenset(map(named, added)), round(trial.fit.model.index_offset / 0.1)
        others = ahead.setdefault(name, [])
        order = np.argsort([str(named(e)) for e in added])
        way = np.concatenate([np.split(way, np.cumsum([len(e.values) for e in added])[:-1])[i] for i in order])
        if len(others) < 2 and all(way @ other < 0.5 for other in others):
            others.append(way)
            kept.append(trial)
        if len(kept) == most:
            break
    return kept
