"""States from which a set of causes is fitted: at an offer's sizes, in equivalent places, from declared starts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from rverror.base.arrays import Array
from rverror.base.threads import each
from rverror.diagnosis.gears.fit import Fit, RunSet
from rverror.diagnosis.gears.ranking import Offer
from rverror.diagnosis.gears.score import named
from rverror.diagnosis.gears.waveform import Waveform
from rverror.geartrain.mechanism import Mechanism
from rverror.model.catalogue import source
from rverror.model.effects import Effect, Model
from rverror.statics.loaded_state import NotConvergedError


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


class Starts:
    """What the declared model does at each start of its candidates, solved once, wherever the marks are.

    Parameters
    ----------
    declared : Model
    """

    def __init__(self, declared: Model) -> None:
        """Nothing is solved yet."""
        self.declared = declared
        self._plain: dict[object, list[Waveform]] = {}
        self._made: dict[object, list[Waveform] | None] = {}

    def of(self, bench: RunSet, effects: Sequence[Effect]) -> tuple[list[Waveform], list[list[Waveform] | None], int]:
        """Waveforms of what is declared, those with each effect, and how many had to be solved.

        They are None where there is no equilibrium.
        """
        where = tuple((c.direction, c.torque, None if c.turn.closed else c.turn) for c in bench.conditions)
        names = [(where, named(effect), effect.values) for effect in effects]
        new = [(name, effect) for name, effect in zip(names, effects, strict=True) if name not in self._made]
        base = bench.solve(self.declared) if new or where not in self._plain else []
        plain = self._plain.setdefault(where, [wave.bare for wave in base])

        def solve(effect: Effect) -> list[Waveform] | None:
            try:
                return [wave.bare for wave in bench.solve(self.declared.with_effects(effect), base)]
            except NotConvergedError:
                return None

        self._made |= zip([name for name, _ in new], each(solve, [effect for _, effect in new]), strict=True)
        return plain, [self._made[name] for name in names], len(new)


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
