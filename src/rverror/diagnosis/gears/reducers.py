"""The closed loop for a reducer: its runs sample by sample, its sizes and stiffness through the loaded equilibrium."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

from rverror.base.errors import InputError
from rverror.base.threads import each
from rverror.diagnosis.gears.account import account
from rverror.diagnosis.gears.fit import Fit, RunSet, as_compared, begun, fitted, renoised
from rverror.diagnosis.gears.hunt import Hunt, Node, nearly_noise, onto, turned_to
from rverror.diagnosis.gears.late_faults import second_look
from rverror.diagnosis.gears.record import Record, records_of
from rverror.diagnosis.gears.waveform import Named
from rverror.diagnosis.journal import Journal
from rverror.diagnosis.policy import POLICY, Policy
from rverror.diagnosis.result import Diagnosis, Progress
from rverror.geartrain.kinematics import fundamental_orders
from rverror.geartrain.mechanism import Mechanism, Reducer
from rverror.geartrain.source import Source
from rverror.model import sensor
from rverror.model.catalogue import CATALOGUE, source
from rverror.model.effects import Effect, Model
from rverror.runs.measurement import Run
from rverror.runs.order_table import OrderTable


def diagnose_reducer(declared: Model, runs: Sequence[Run], tell: Progress, *, policy: Policy = POLICY) -> Diagnosis:
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

    Raises
    ------
    InputError
        If a run cannot be used; the message says why.
    """
    if not runs:
        raise InputError("no run given; diagnose needs one or more run files")
    unit = curved(declared.mechanism)
    journal = Journal(tell)
    records, notes = records_of(declared, runs, policy)
    model, anywhere = with_marks(replace(declared, mechanism=unit), runs)
    tell("predicting the declared model")
    bench = RunSet.of(unit, records, policy, points=_points(records), anywhere=anywhere)
    first = begun(bench, model, model)
    candidates, late = (candidates_of(model, records, policy, late=late) for late in (False, True))
    hunt = Hunt(candidates, policy, journal, late, patient=anywhere)
    if anywhere:
        hunt, first = placed(hunt, first)
    tell("refitting declared sizes and stiffness within their uncertainty")
    root = Node(fitted(renoised(fitted(first))))
    best, done = hunt.best([root], policy.expansions)
    if not done and not hunt.only_faults(best):
        other, done = hunt.widened().best([root], policy.wider_expansions)
        best = other if done else min(best, other, key=lambda node: node.score)
    for _ in range(policy.looks):
        fit = onto(best.fit.bench.anchored(best.fit.model.index_offset), best.fit) if anywhere else best.fit
        calm = nearly_noise(fit)  # in a residual that is more than noise, kinks would be faults
        least = policy.by_chance * policy.model_error
        changed = second_look(fit.bench.records, fit.residual, least=least) if calm else None
        renewed = renoised(fit if changed is None else onto(fit.bench.with_records(changed), fit), calm=done)
        best = hunt.pruned(Node(fitted(renewed), best.lines, best.slow))
        done = hunt.complete(best)
        if changed is None and (done or hunt.pins):
            break
        bare = [replace(r, orders=(), slow=False) for r in best.fit.bench.records]
        root = Node(fitted(onto(best.fit.bench.with_records(bare), root.fit)))
        if not done:
            hunt = hunt.with_candidates((*hunt.candidates, *hunt.late), pins=True)
            best, done = hunt.best([root, best], policy.again)
    best, beside = hunt.ripples_apart(best) if anywhere and done else (best, [])
    beside += hunt.opposites(best) if done else []
    return account(declared, model, runs, hunt, root, best, done, notes, beside)


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


def placed(hunt: Hunt, first: Fit) -> tuple[Hunt, Fit]:
    """Angles of the marks, by how well the declared waveform fits; what is missing may turn the match."""
    coarse = onto(hunt.coarse(Node(first)), first)
    unit = first.bench.unit
    repeat = 2 * math.pi / fundamental_orders(unit)["crank"]
    alike = all(source(e.key).repeats_with_crank(unit, e.indices) for e in first.bench.around(first.model))
    span = repeat if alike else 2 * math.pi
    count = hunt.policy.offsets if alike else hunt.policy.offsets * 8

    def left_at(offset: float) -> tuple[float, float]:
        return as_compared(fitted(turned_to(coarse, offset), steps=1).objective), offset

    trials = sorted(each(left_at, [span * at / count for at in range(count)]))
    offsets = tuple(angle for _, angle in trials)
    return replace(hunt, offsets=offsets), renoised(turned_to(first, offsets[0]))


def candidates_of(model: Model, records: Sequence[Record], policy: Policy, *, late: bool = False) -> tuple[Named, ...]:
    """Sources of the catalogue that the runs can show and the model does not have, tried late or not."""
    return offered(model, records, lambda entry: policy.tries(entry) and entry.late == late)


def offered(model: Model, records: Sequence[Record], wanted: Callable[[Source], bool]) -> tuple[Named, ...]:
    """Sources that are wanted, that the runs can show and the model does not have, with all their indices."""
    unit = model.mechanism
    assert isinstance(unit, Reducer)
    taken = [(e.key, dict(e.indices)) for e in model.effects]
    return tuple(
        (key, indices)
        for key, entry in CATALOGUE.items()
        if entry.applies_to(unit) and wanted(entry)
        if not any(entry.lacks(unit, record) for record in records)
        for indices in entry.candidates(unit)
        if (key, dict(indices)) not in taken
    )
