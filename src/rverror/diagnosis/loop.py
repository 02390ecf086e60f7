"""The closed loop: find what a model lacks in measured runs, name it, and show the error before and after."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from rverror.base.errors import InputError, check_each
from rverror.base.progress import Progress
from rverror.base.threads import at_most, cores
from rverror.diagnosis.gears.reducers import diagnose_reducer
from rverror.diagnosis.orders.runs_by_order import passport_of_runs, resonances_of_runs
from rverror.diagnosis.orders.tables import diagnose_tables
from rverror.diagnosis.policy import POLICY, Policy
from rverror.diagnosis.result import Diagnosis
from rverror.diagnosis.samples.drives import diagnose_drive
from rverror.diagnosis.size_prior import MadeTo, SizePrior
from rverror.geartrain.mechanism import Drive
from rverror.model.catalogue import source
from rverror.model.effects import Model, check_model
from rverror.runs.measurement import Run
from rverror.runs.order_table import OrderTable


def diagnose(
    model: Model,
    runs: Sequence[Run | OrderTable],
    *,
    progress: Progress | None = None,
    policy: Policy = POLICY,
    jobs: int | None = None,
    prior: Sequence[MadeTo] = (),
) -> Diagnosis:
    """Find the effects that a model lacks in measured runs.

    Of a reducer all samples of all runs are explained at once, at their load: declared sizes, stiffness, backlash and
    contact law are refitted within what is known of them, beside an offset of each run, slips of the reading, lines
    that no part has, what settles, and coloured noise.  Every source of the catalogue is scored by a linear step, the
    leading ones are solved and refitted at the load, and sets of causes compare by evidence.  Only a set that leaves
    nothing significant is named.  Of a drive the same, but that every effect is linear.  Of order tables
    every wave of every condition is explained at once, and what no cause accounts for is described by laws over load
    and direction.

    Parameters
    ----------
    model : Model
        What was declared, with its uncertainty.
    runs : sequence of Run or OrderTable
        Measured runs of any travel, of a reducer each in one direction; or order tables of a reducer.
    progress : callable, optional
        Called with a line of text as the work goes on.
    policy : Policy
        Every threshold, and which sources are tried.
    jobs : int, optional
        Threads that fit candidates side by side, for runs of a reducer, one for each core where left out; the result is
        the same.
    prior : sequence of Tolerance
        How a reducer's parts are made, as a lot tells: an error is expected as large as the root mean square that its
        tolerance says, mean and all; what is in none is expected as a workshop makes it.

    Returns
    -------
    Diagnosis

    Raises
    ------
    InputError
        If a run or the prior cannot be used; the message says why.
    ValueError
        If the catalogue has no such key as the policy's, or the mechanism none that is in the prior.

    Notes
    -----
    docs/theory/diagnosis.md, docs/theory/drives.md.  Runs of a reducer may begin anywhere and need no whole turn, but
    48 samples or more, to tell noise from error.  Spikes, slips and gaps are set aside and told in the
    notes.  Every run has an offset of its own, but for those of one index label; where the index is unknown, the angle
    of the gear's marks is fitted.

    Examples
    --------
    A drive of which only the motor's order is known; what it lacks is an eccentric motor shaft.

    >>> import numpy as np
    >>> import rverror
    >>> theta, rng = np.linspace(0, 8 * np.pi, 4001), np.random.default_rng(1)
    >>> error = 2e-5 * np.cos(14 * theta) + 1e-6 * rng.standard_normal(theta.size)
    >>> run = rverror.run_from_arrays(input_angle=14 * theta, te=error)
    >>> found = rverror.diagnose(rverror.Model(rverror.Drive(ratio=14.0, shafts={"motor": 14.0})), [run])
    >>> found.verdict, found.added[0].effect.key, dict(found.added[0].effect.indices)
    ('explained', 'shaft.eccentricity', {'shaft': 'motor', 'harmonic': 1})
    """
    check_model(model)
    check_each("runs", runs, (Run, OrderTable), "give a list of runs, such as [load_run(path)]")
    check_each("prior", prior, MadeTo, "give load_tolerances(path)")
    if jobs is not None and jobs < 1:
        raise InputError(f"jobs: {jobs} threads do no work; give 1 or more")
    for key in policy.keys:
        source(key)  # which names the nearest where there is none
    tell = progress or (lambda text: None)
    tables = [run for run in runs if isinstance(run, OrderTable)]
    samples = [run for run in runs if not isinstance(run, OrderTable)]
    if tables and samples:
        raise InputError(
            f"{tables[0].path or 'an order table'} is an order table, {samples[0].path or 'another input'} a run; "
            "diagnose tables by themselves, or make a table of the runs (rverror.runs.order_table_from_runs)"
        )
    if tables and isinstance(model.mechanism, Drive):
        raise InputError(
            f"{tables[0].path or 'an order table'}: order tables are diagnosed for a [reducer]; of a [drive] give runs"
        )
    unit = model.mechanism
    if prior and isinstance(unit, Drive):
        raise InputError("prior: the search for a drive's causes knows none; leave it out")
    sizes = SizePrior.of(prior, unit)
    with at_most(jobs or cores()):
        if tables:
            return diagnose_tables(model, tables, tell, policy=policy, prior=sizes)
        if isinstance(unit, Drive):
            found = diagnose_drive(model, samples, tell, policy=policy)
        else:
            resonances, notes, telling = resonances_of_runs(model, samples, policy=policy)
            found = diagnose_reducer(model, telling, tell, policy=policy, prior=sizes)
            found = replace(found, resonances=resonances, notes=(*found.notes, *notes))
        return replace(found, passport=passport_of_runs(unit, samples))
