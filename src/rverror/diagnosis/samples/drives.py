"""The closed loop for any geared drive: every effect is linear, and runs need neither whole turns nor one direction."""

from __future__ import annotations

from collections.abc import Sequence

from rverror.diagnosis.journal import Journal
from rverror.diagnosis.policy import POLICY, Policy
from rverror.diagnosis.result import Diagnosis, Progress
from rverror.diagnosis.samples.account import result_of
from rverror.diagnosis.samples.lines import add_lines
from rverror.diagnosis.samples.regressors import candidate_terms, declared_terms, nuisance_terms, offset_terms
from rverror.diagnosis.samples.runs import gather
from rverror.diagnosis.samples.search import DriveSearch
from rverror.model.effects import Model
from rverror.runs.measurement import Run


def diagnose_drive(
    model: Model,
    runs: Sequence[Run],
    progress: Progress | None = None,
    *,
    policy: Policy = POLICY,
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
    data, notes = gather(model, runs, policy=policy)
    base = [*offset_terms(data), *declared_terms(model, runs, data)]
    candidates = candidate_terms(model, runs, data)
    search = DriveSearch(data, tuple(candidates), tuple(nuisance_terms(data)), policy, journal)
    found = search.best(search.fitted(base))
    ranking = search.scored(found)
    journal.tell("searching the residual for lines of any order")
    fit = add_lines(data, found)
    return result_of(model, data, base, candidates, fit, ranking, notes, journal.history)
