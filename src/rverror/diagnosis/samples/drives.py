"""The closed loop for any geared drive: every effect is linear, and runs need neither whole turns nor one direction."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from rverror.base.progress import Progress
from rverror.base.threads import each
from rverror.diagnosis.causes import Named, identity, named
from rverror.diagnosis.gears.account import account
from rverror.diagnosis.gears.fit import Fit, evaluated, fitted, with_estimated_noise, with_noise_of, without_effect
from rverror.diagnosis.gears.moves import with_offer
from rverror.diagnosis.gears.ranking import Offer, columns_of, singles
from rverror.diagnosis.gears.reducers import searched_repeatedly
from rverror.diagnosis.gears.score import Hypothesis
from rverror.diagnosis.gears.search import Search
from rverror.diagnosis.gears.spectrum import MOST_LINES, best_lines, taken_off
from rverror.diagnosis.gears.trial import Trial
from rverror.diagnosis.journal import Journal
from rverror.diagnosis.policy import POLICY, Policy
from rverror.diagnosis.result import Addition, Diagnosis
from rverror.diagnosis.samples.drive_set import DriveSet, candidates_of_drive, distinguishable, drive_set, less
from rverror.diagnosis.samples.records import records_of_drive
from rverror.model.catalogue import source
from rverror.model.effects import Model
from rverror.runs.measurement import Run

#: Independent values of what is not explained yet: as many as there are, so that squares count as they are.  What is
#: left of a drive moves nothing that a declared size does not make.
_ANY = 1e9
_NOTHING = 1e-4  # share of its power by which a wave would have to be enormous: it is made up by others
_TOGETHER = 6  # lines that are added at once
_FITTED = 3  # candidates that lead by a linear step and are fitted beside everything
#: Fields of a result that are sizes of what was measured, and that hold some; traces, and what is theirs alone.
_SIZES = ("noise_rms", "rms", "peak_to_peak", "heldout_rms", "amplitude", "cos", "sin", "value", "low", "high")
_HOLDING = ("before", "before_refitted", "after", "added", "effect", "estimates", "values", "unexplained")
_TRACED = ("traces", "measured", "left_out")


def diagnose_drive(
    model: Model, runs: Sequence[Run], progress: Progress | None = None, *, policy: Policy = POLICY
) -> Diagnosis:
    """Find the effect that the model of a geared drive lacks in measured runs.

    Parameters
    ----------
    model : Model
        Of a `Drive`: what was declared, with its uncertainty.
    runs : sequence of Run
        Each may turn both ways, over any travel, unevenly.
    progress : callable, optional
        Called with a line of text as the work goes on.
    policy : Policy

    Returns
    -------
    Diagnosis
        Of a torque record (one angle and a ``torque[..]`` column) `quantity` is ``torque`` and sizes are in N*mm.

    Raises
    ------
    InputError
        If a run cannot be used; the message says why.

    Notes
    -----
    docs/theory/drives.md.
    """
    journal = Journal(progress or (lambda text: None))
    records, notes = records_of_drive(model, runs)
    torque = records[0].quantity == "torque"
    declared = replace(model, effects=()) if torque else model
    candidates = candidates_of_drive(declared, records, policy)
    policy = replace(policy, most_effects=len(candidates), regular=_ANY)
    run_set = drive_set(declared, records, policy, candidates)
    root = fitted(evaluated(with_first_noise(run_set), declared, declared))
    turns = max(record.turns for record in records)
    search = DriveSearch(root, distinguishable(model.mechanism, candidates, turns, policy), policy, journal)
    last, best, _ = searched_repeatedly(search, with_noise_left)
    for name in candidates:
        if identity(name) not in {named(e) for e in best.fit.added}:
            journal.note("fell", name, "not significant under the noise of the runs, or no more than what was tried")
    if len({sense for record in records for sense in record.senses}) == 1:
        notes.append("runs in one direction only: lost motion does not show; add a reverse run")
    journal.tell("searching the residual for lines of any order")
    # what is left of a drive changes nothing of what a cause makes, so all that was found is told
    found = account(declared, runs, last, best, True, notes)
    found = replace(found, tried=len(candidates), added=_in_order(best, found.added))
    return _as_torque(found, model, records[0].unit) if torque else found


def _in_order(best: Hypothesis, added: Sequence[Addition]) -> tuple[Addition, ...]:
    """Errors that grow along a run first, since without them no other figure means much; then the largest first."""
    made = [np.concatenate(parts) for parts in best.fit.added_linearly]
    keys = [(source(one.effect.key).periodic, -float(row @ row)) for one, row in zip(added, made, strict=True)]
    return tuple(added[at] for at in sorted(range(len(added)), key=lambda at: keys[at]))


def _as_torque(found: Diagnosis, model: Model, unit: float) -> Diagnosis:
    """A result in N*mm, of which nothing enters the model."""
    scaled: Diagnosis = _scaled(found, unit)
    added = tuple(
        replace(one, notes=(), estimates=tuple(replace(e, dimension="torque") for e in one.estimates))
        for one in scaled.added
    )
    return replace(scaled, added=added, model=model, declared=model, quantity="torque")


def _scaled(thing: Any, unit: float) -> Any:
    """A part of a result with all its sizes times a unit."""
    if isinstance(thing, tuple):
        return tuple(_scaled(one, unit) for one in thing)
    if isinstance(thing, float | np.ndarray):
        return unit * thing
    sized = {name: getattr(thing, name, None) for name in (*_SIZES, *_HOLDING, *_TRACED)}
    return replace(thing, **{name: _scaled(one, unit) for name, one in sized.items() if one is not None})


def with_first_noise(run_set: DriveSet) -> DriveSet:
    """The runs under the noise that is left when all that may be regular is out of each by itself.

    A cause that no one has taken out yet would pass for noise: a drift of 21 arcsec makes a worm's noise a walk.
    """
    rows = run_set.influences(Model(run_set.unit), (), run_set.candidates)
    records = []
    for record, own in zip(run_set.records, rows, strict=True):
        rest, count = less(record.error, np.concatenate([record.nuisance, record.settling, own]))
        records.append(replace(record, noise=run_set.noise_in(record, rest, float(count))))
    return replace(run_set, records=tuple(records))


def with_noise_left(search: Search, best: Hypothesis, seen: Fit) -> Fit:
    """A set under the noise that it leaves, or that the part of it leaves which is as likely, noise and all.

    Causes, lines and drift are taken out one after another as long as noise that is estimated without them makes up
    for them.

    Parameters
    ----------
    search : Search
    best : Hypothesis
    seen : Fit
        Of the same sizes.
    """
    now, fit = best, fitted(with_estimated_noise(seen, calm=True))
    while now.names:
        parts = search.parts(now)
        fits = each(lambda part: fitted(with_estimated_noise(part.with_rows.fit, calm=True)), parts)
        both = zip(parts, fits, strict=True)
        gains = [other.deviance - fit.deviance - search.score.by_chance(now, part) for part, other in both]
        least = int(np.argmin(gains))
        if gains[least] > 0:
            break
        now, fit = parts[least], fits[least]
    return with_noise_of(seen, fit)


class DriveSearch(Search):
    """A search among causes that are linear in their sizes: a linear step is the fit, and there is one minimum."""

    widest, rounds = 1, 10**6

    def expand_beam(self) -> bool:
        """Expand the leading set alone, by all that it offers."""
        return self.expand(self._leader, self._more)

    def nothing_left(self, one: Hypothesis) -> bool:
        """Tell whether all that a set offers was fitted beside it: where it leads, none of that was better."""
        return (one.names, self._more.__name__) in self._expanded

    def challengers(self, one: Hypothesis) -> Iterator[Trial]:
        """None: there is one minimum, and all places were beside each cause when it was added."""
        yield from ()

    def _more(self, one: Hypothesis) -> Iterator[Trial]:
        """One cause more, or what is regular: a linear step is the fit, so nothing is left to try."""
        models = [with_offer(one.fit.model, offer) for offer in self._leading(one)[:_FITTED]]
        fits = each(lambda model: fitted(evaluated(one.fit.run_set, model, one.fit.declared)), models)
        self.keep(self.score.of(fit) for fit in fits)
        self.keep(self.regular(one))
        yield from ()

    def _leading(self, one: Hypothesis) -> list[Offer]:
        """Candidates that a linear step makes the set better by, the best first."""
        offers = singles(*self.moves.influences(one), self.score.cost)
        return [offer for offer in offers if offer.score < offer.without]

    def regular(self, one: Hypothesis) -> list[Hypothesis]:
        """A set with what is regular and no part's; or with many lines, where one takes off more than any cause."""
        found, whole = self.with_settling(one), one.with_rows
        room = MOST_LINES - len(one.lines)
        for most in (1, min(room, _TOGETHER)) if room else ():
            lines = tuple(line.order for line in best_lines(whole.fit, self.policy, outside=True, most=most))
            if lines:
                found.append(self.with_free(one, (*one.lines, *lines), slow=one.slow))
            if not lines or found[-1].score > min((o.score for o in self._leading(one)), default=one.score):
                break
        return found

    def as_good(self, one: Hypothesis, number: int) -> tuple[Named, ...]:
        """Candidates that fit as well in the place of a cause, however large."""
        return self._once(("in place", number), one.fit, lambda: self._in_place(one, number))

    def _in_place(self, one: Hypothesis, number: int) -> tuple[Named, ...]:
        fit = one.with_rows.fit
        rest, cause = without_effect(fit, number), fit.added[number]
        run_set, added = fit.run_set, {named(e) for e in fit.added}
        assert isinstance(run_set, DriveSet)
        others = [name for name in run_set.candidates if identity(name) not in added]
        own, *blocks = [
            np.concatenate(block.rows, axis=1) for block in columns_of(rest, [(cause.key, cause.indices), *others])
        ]
        white = np.concatenate(rest.rows, axis=1)
        there = white[1:][np.linalg.norm(white[1:], axis=1) > 0]
        basis = np.linalg.qr((there / np.linalg.norm(there, axis=1)[:, None]).T)[0]
        least = taken_off(white[0], np.concatenate([own, there]))[0] + 2 * fit.scale * math.log(run_set.policy.alike)
        found = []
        for name, block in zip(others, blocks, strict=True):
            beyond = np.sum((block - (block @ basis) @ basis.T) ** 2, axis=1)
            if (beyond < _NOTHING * np.sum(block**2, axis=1)).all():
                continue
            if taken_off(white[0], np.concatenate([block, there]))[0] > least:
                found.append(name)
        return tuple(found)
