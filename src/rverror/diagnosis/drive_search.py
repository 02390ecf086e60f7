"""The closed loop for any geared drive: every effect is linear, and runs need neither whole turns nor one direction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rverror.diagnosis.drive_fit import FALSE_ALARM, DriveFit, fitted, held_out_gain, pruned, screened
from rverror.diagnosis.drive_lines import add_lines, beats, best_line
from rverror.diagnosis.drive_result import result_of
from rverror.diagnosis.drive_runs import RunData, gather
from rverror.diagnosis.drive_terms import (
    BESIDE,
    BOW,
    EFFECT,
    LINE,
    Term,
    candidate_terms,
    declared_terms,
    nuisance_terms,
    offset_terms,
)
from rverror.diagnosis.result import Candidate, Diagnosis, Progress
from rverror.model.catalogue import source
from rverror.model.effects import Model
from rverror.runs.measurement import Run

_MOST_EFFECTS = 12
_SHARE = 0.5  # of an implausible candidate's gain that lets a plausible one go first


def diagnose_drive(model: Model, runs: Sequence[Run], progress: Progress | None = None) -> Diagnosis:
    """Find the effect that the model of a geared drive lacks in measured runs.

    Every effect is linear in its sizes.  Candidates of the catalogue, slow curvature, lost motion between directions
    and free lines of any order compete; what is significant under the coloured noise of the runs and helps on blocks
    of samples that were left out is added, one after another, and all is refitted together each time.

    Parameters
    ----------
    model : Model
        Of a `Drive`: what was declared, with its uncertainty.
    runs : sequence of Run
        Each may turn both ways, over any travel, unevenly.
    progress : callable, optional
        Called with a line of text as the work goes on.

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
    tell = progress or (lambda text: None)
    data, notes = gather(model, runs)
    base = [*offset_terms(data), *declared_terms(model, runs, data)]
    candidates = candidate_terms(model, runs, data)
    nuisances = nuisance_terms(data)
    fit, ranking = _search(data, base, candidates, nuisances, tell)
    tell("searching the residual for lines of any order")
    fit = add_lines(data, fit)
    return result_of(model, data, base, candidates, fit, ranking, notes)


def _search(
    data: RunData, base: Sequence[Term], candidates: Sequence[Term], nuisances: Sequence[Term], tell: Progress
) -> tuple[DriveFit, tuple[Candidate, ...]]:
    """Add what is significant, the most telling first, until nothing is."""
    fit = fitted(data, base)
    pool = [*candidates, *nuisances]
    accepted = FALSE_ALARM / max(len(pool), 1)
    for _ in range(2 * _MOST_EFFECTS):
        tell(f"fitting {len(pool)} candidates beside {len(fit.terms) - len(base)} found")
        winner = _winner(data, fit, pool, accepted)
        if winner is None:
            if (bowed := _bowed(data, fit, nuisances)) is None:
                break
            fit = bowed
            continue
        line = best_line(data, fit)
        beaten = line is not None and beats(data, line, winner)
        fit = line if line is not None and beaten else pruned(data, winner, accepted)
    if lines := [t for t in fit.terms if t.kind == LINE]:
        fit = pruned(data, fitted(data, [t for t in fit.terms if t not in lines]), accepted)
    tell("scoring candidates on left-out blocks")
    scored = [
        (held_out_gain(data, fit, fitted(data, [*fit.terms, t])), t)
        for t, _, _ in screened(data, fit, pool)
        if t.kind == EFFECT
    ]
    scored.sort(key=lambda pair: -pair[0])
    return fit, tuple(Candidate(t.name, t.indices, gain) for gain, t in scored)


def _bowed(data: RunData, fit: DriveFit, nuisances: Sequence[Term]) -> DriveFit | None:
    """Fit with the bow that goes with a drift: in one direction a slope may be one, and no drift is straight."""
    slopes = [t for t in fit.terms if t.kind == EFFECT and not source(t.name).periodic]
    bow = next(t for t in nuisances if t.name == BOW)
    if not slopes or np.unique(data.direction).size > 1 or any(t.name == BOW for t in fit.terms):
        return None
    parabola = bow.rows[::2]  # of each run; the cubic would run away on a left-out end
    return fitted(data, [*fit.terms, replace(bow, kind=BESIDE, rows=parabola)])


def _winner(data: RunData, fit: DriveFit, pool: Sequence[Term], accepted: float) -> DriveFit | None:
    """Fit with the most telling of the terms that are significant and help on left-out blocks."""
    telling = screened(data, fit, pool)
    best = max((gain for _, gain, _ in telling), default=0.0)
    # a size that no workshop makes goes after plausible ones that do half as well
    for term, _, _ in sorted(telling, key=lambda s: bool(s[2]) or s[1] < _SHARE * best):
        trial = fitted(data, [*fit.terms, term])
        if trial.significant(term, accepted) and held_out_gain(data, fit, trial) > 0:
            return trial
    return None
