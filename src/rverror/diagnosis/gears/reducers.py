"""The closed loop for a reducer: its runs sample by sample, its sizes and stiffness through the loaded equilibrium."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from rverror.base.errors import InputError
from rverror.base.progress import Progress
from rverror.base.threads import each
from rverror.diagnosis.causes import Named, identity, named
from rverror.diagnosis.gears.account import account, run_notes
from rverror.diagnosis.gears.fit import (
    Fit,
    RunSet,
    as_compared,
    evaluated,
    first_state,
    fitted,
    fitted_from_coarse,
    onto,
    with_estimated_noise,
    with_noise_of,
    with_walk,
)
from rverror.diagnosis.gears.moves import marked, turned_to
from rverror.diagnosis.gears.record import Record, records_of
from rverror.diagnosis.gears.residual_faults import nearly_noise, without_residual_faults
from rverror.diagnosis.gears.score import Hypothesis
from rverror.diagnosis.gears.search import Search
from rverror.diagnosis.journal import Journal
from rverror.diagnosis.policy import POLICY, Policy
from rverror.diagnosis.result import Diagnosis
from rverror.diagnosis.size_prior import WORKSHOP, SizePrior
from rverror.geartrain.kinematics import fundamental_orders
from rverror.geartrain.mechanism import Mechanism, Reducer
from rverror.geartrain.source import Source
from rverror.model import sensor
from rverror.model.catalogue import CATALOGUE, source
from rverror.model.effects import Effect, Model
from rverror.runs.measurement import Run
from rverror.runs.order_table import OrderTable
from rverror.statics.loaded_state import each_solved

NoiseRule = Callable[[Search, Hypothesis, Fit], Fit]

_PLACING = 512  # angles a turn on which the marks are looked for
_RIPPLES = 3  # to either side of marks that were found: declared sizes are seldom known less well


def diagnose_reducer(
    declared: Model, runs: Sequence[Run], tell: Progress, *, policy: Policy = POLICY, prior: SizePrior = WORKSHOP
) -> Diagnosis:
    """Find what the model of a reducer lacks.

    Parameters
    ----------
    declared : Model
        Of a `Reducer`.
    runs : sequence of Run
        Each in one direction, over any travel.
    tell : callable
        Called with a line of text as the work goes on.
    policy : Policy
    prior : SizePrior

    Raises
    ------
    InputError
        If a run cannot be used; the message says why.
    """
    if not runs:
        raise InputError("no run given; diagnose needs one or more run files")
    unit = curved(declared.mechanism)
    journal = Journal(tell)
    records, notes = records_of(declared, runs)
    model, anywhere = with_marks(replace(declared, mechanism=unit), runs)
    if anywhere and any(run.load_column is not None for run in runs):
        raise InputError(
            "output_torque changes over the turn, and the gear's marks are not known to be at the bench's zero: the "
            "torque goes with the bench's angle; set that zero on the marks, or diagnose runs under a constant torque"
        )
    tell("predicting the declared model")
    run_set = replace(RunSet.of(unit, records, policy, points=_points(records), anywhere=anywhere), prior=prior)
    first = first_state(run_set, model, model)
    candidates = offered(model, records, policy.tries)
    notes += run_set.prior.notes(candidates)
    first, offsets = placed(first) if marks_are_free(model) else (first, ())
    tell("refitting declared sizes and stiffness within their uncertainty")
    search = Search(fitted(with_estimated_noise(fitted_from_coarse(first))), candidates, policy, journal, offsets)
    search, best, done = searched_repeatedly(search)
    if search.spent > policy.budget:
        beyond = "rivals may fit as well that were not fitted" if done else "a larger one may find more"
        notes.append(f"the search ended at its budget of {policy.budget} solutions; {beyond}")
    beside = search.opposites(best) if done else []
    if offsets and done:
        best, more = ripples_apart(search, best)
        beside += more
    notes += run_notes(best.fit, unit)
    return account(declared, runs, search, best, done, notes, beside)


def searched_repeatedly(search: Search, noise_rule: NoiseRule | None = None) -> tuple[Search, Hypothesis, bool]:
    """Search, and again under the noise that the best set leaves, until nothing changes.

    Parameters
    ----------
    search : Search
    noise_rule : callable, optional
        What gives that noise to every set; `with_own_noise` where left out, to such as are complete.

    Returns
    -------
    Search
        The last one.
    Hypothesis
        The best set.
    bool
        Whether nothing is left beside it.
    """
    best, done = search.best(swap=False)
    policy = search.policy
    for _ in range(policy.looks):
        fit = onto(best.fit.run_set.anchored(best.fit.model.index_offset), best.fit)
        changed = None
        if not fit.run_set.linear and nearly_noise(fit):  # in a residual that is more than noise, kinks would be faults
            least = policy.by_chance * policy.model_error
            changed = without_residual_faults(fit.run_set.records, fit.residual, least=least)
        seen = fit if changed is None else onto(fit.run_set.with_records(changed), fit)
        if noise_rule:
            latest = noise_rule(search, best, seen)
        elif done:
            latest = with_own_noise(search, best, seen, [] if changed else search.parts(best))
        else:
            latest = with_estimated_noise(seen)
        root = fitted(onto(latest.run_set.bare, search.root.fit))
        search = search.anew(root)
        before = best.names
        best, done = search.best(search.score.of(fitted(latest)))
        settled = done and (best.names <= before if noise_rule is None else best.names == before)
        if changed is None and (settled or search.spent > policy.budget):
            break
    return search, best, done


def with_own_noise(search: Search, best: Hypothesis, seen: Fit, parts: Sequence[Hypothesis]) -> Fit:
    """A complete set under the noise that it leaves, or that a part of it leaves where that is as likely.

    A random walk makes order 1 and a drift: once they are fitted, what is left is quieter than it was.  So each cause
    stands against noise that is estimated without it; what does not repeat with the turns stands against a random walk
    beside the noise, of which a slope is the largest wave.

    Parameters
    ----------
    search : Search
    best : Hypothesis
    seen : Fit
        Of the same sizes.
    parts : sequence of Hypothesis
        The set without each cause.

    Returns
    -------
    Fit
        Of the same sizes.
    """
    own = with_estimated_noise(seen, calm=True)
    if own.data > own.bound:  # of a run that holds copies: what was noise would be none
        return seen
    for part in parts:
        bare = onto(seen.run_set.with_records(part.fit.run_set.records), part.fit)
        if _slopes(part) < _slopes(best):
            with_all, without = (with_walk(fit, own) for fit in (seen, bare))
        else:
            with_all, without = own, with_estimated_noise(bare, calm=True)
        if without.deviance < with_all.deviance + search.score.by_chance(best, part):
            return with_noise_of(seen, without)
    return own


def _slopes(one: Hypothesis) -> int:
    """How much of a set does not repeat with the turns."""
    return sum(not source(e.key).periodic for e in one.fit.added) + one.slow


def curved(unit: Mechanism) -> Reducer:
    """The reducer with pins that follow their discs' profiles, as far as nothing else is stated."""
    assert isinstance(unit, Reducer)
    law = unit.contact_law
    return replace(unit, contact_law=replace(law, profile_curvature=law.profile_curvature or 1.0))


def _points(records: Sequence[Record]) -> int:
    """Angles a turn at which the gears are solved: those of even samples, so that these lie on the grid."""
    counts = [round(r.theta.size / r.turns) for r in records]
    return int(min(max(max(counts), 1024), 4096)) if len(set(counts)) == 1 and counts[0] >= 1024 else 2048


def with_marks(declared: Model, runs: Sequence[Run | OrderTable]) -> tuple[Model, bool]:
    """The model with the angle of its marks as one size more, where the bench's zero is not on them."""
    unknown = {run.index == "unknown" for run in runs}
    if len(unknown) > 1:
        odd = next(run for run in runs if (run.index == "unknown") != (runs[0].index == "unknown"))
        raise InputError(
            f"{odd.path or 'a run'}: index is {odd.index or 'aligned'!r}, that of {runs[0].path or 'run 1'} "
            f"{runs[0].index or 'aligned'!r}; all runs or none may have a zero that is not on the gear's marks"
        )
    stated = any(source(e.key).acts == "marks" for e in declared.effects)
    if unknown == {False} or stated:
        return declared, stated
    offset = Effect(sensor.MARKS.key, {}, (0.0,), math.pi, "found by rverror diagnose: index unknown")
    return declared.with_effects(offset), True


def marks_are_free(model: Model) -> bool:
    """Whether the angle of the marks is fitted: not where it is declared without an uncertainty."""
    return any(source(e.key).acts == "marks" and e.uncertainty for e in model.effects)


def placed(first: Fit) -> tuple[Fit, tuple[float, ...]]:
    """The state at the angle of the marks where the declared waveform fits best, and all that were tried, in order.

    What is missing may turn the match.
    """
    unit, count = first.run_set.gears, first.run_set.policy.offsets
    coarse = onto(first.run_set.coarser(_PLACING), first)
    span = 2 * math.pi / fundamental_orders(unit)["crank"]
    if not all(source(e.key).repeats_with_crank(unit, e.indices) for e in first.run_set.around(first.model)):
        span, count = 2 * math.pi, 8 * count

    def left_at(offset: float) -> tuple[float, float]:
        return as_compared(fitted(turned_to(coarse, offset), steps=1).objective), offset

    trials = sorted(each(left_at, [span * at / count for at in range(count)]))
    offsets = tuple(angle for _, angle in trials)
    return with_estimated_noise(turned_to(first, offsets[0])), offsets


def ripples_apart(search: Search, one: Hypothesis) -> tuple[Hypothesis, list[Fit]]:
    """The set at the best of marks that are ripples of the cycloid mesh apart, and others within the odds of `alike`.

    As pins begin and cease to carry the error ripples, and the objective has a minimum at every ripple: what was
    declared and found turns with the marks, within what is known of it.  The marks are held until the sizes have turned
    with them: free marks go back to where these sizes fit.
    """
    fit, policy = one.fit, search.policy
    ripple = 2 * math.pi / fundamental_orders(fit.run_set.gears)["cycloid mesh"]
    others = np.ones(fit.moment.size, dtype=np.bool_)
    sizes = [source(e.key).acts != "marks" for e in fit.model.effects for _ in e.values]
    others[: len(sizes)] = sizes

    def at(angle: float) -> Fit:
        offset = fit.model.index_offset + angle
        there = evaluated(fit.run_set.anchored(offset), marked(fit.model, offset), fit.declared)
        return fitted(fitted(there, free=others), steps=30)

    fits = each_solved(at, [step * ripple for step in range(-_RIPPLES, _RIPPLES + 1)]) or [fit]
    best = min(fits, key=lambda other: as_compared(other.objective))
    near = -2 * math.log(policy.alike)
    alike = [other for other in fits if other is not best and other.objective - best.objective < near]
    return search.score.of(best), alike


def offered(model: Model, records: Sequence[Record], wanted: Callable[[Source], bool]) -> tuple[Named, ...]:
    """Sources that are wanted, that the runs can show and the model does not have, with all their indices."""
    unit = model.mechanism
    taken = {named(e) for e in model.effects}
    return tuple(
        (key, indices)
        for key, entry in CATALOGUE.items()
        if entry.applies_to(unit) and wanted(entry)
        if not any(entry.lacks(unit, record) for record in records)
        for indices in entry.candidates(unit)
        if identity((key, indices)) not in taken
    )
