"""A result held against measurements that no fit saw."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rverror.diagnosis.gears.reducers import curved
from rverror.diagnosis.orders.tables import left_of_table
from rverror.diagnosis.result import Diagnosis, Validation
from rverror.geartrain.mechanism import Reducer
from rverror.model.catalogue import source
from rverror.model.effects import Model
from rverror.runs.measurement import Run
from rverror.runs.order_table import OrderTable
from rverror.statics.prediction import predict


def validated(found: Diagnosis, unseen: Sequence[Run | OrderTable]) -> Diagnosis:
    """The result with what it leaves of measurements that no fit saw, beside what the declared model leaves.

    Nothing is fitted to them but the offset of each run.  Where the gear's marks are unknown both models have the angle
    that was found: it is no size of a part.

    Parameters
    ----------
    found : Diagnosis
    unseen : sequence of Run or OrderTable

    Returns
    -------
    Diagnosis
        With its `validation`, in the order of what was given.

    Raises
    ------
    InputError
        If a run contradicts the model.

    Examples
    --------
    >>> import numpy as np, rverror
    >>> theta = np.linspace(0, 8 * np.pi, 4001)
    >>> runs = [rverror.run_from_arrays(input_angle=14 * theta, te=2e-5 * np.cos(14 * theta + k)) for k in (0, 0)]
    >>> model = rverror.Model(rverror.Drive(ratio=14.0, shafts={"motor": 14.0}))
    >>> held = rverror.diagnosis.validated(rverror.diagnose(model, runs[:1]), runs[1:]).validation[0]
    >>> held.after < 0.01 * held.before
    True
    """
    marks = [e for e in found.model.effects if source(e.key).acts == "marks"]
    stated = any(source(e.key).acts == "marks" for e in found.declared.effects)
    declared = found.declared if stated else found.declared.with_effects(*marks)
    if isinstance(declared.mechanism, Reducer):  # as the diagnosis took it
        declared = replace(declared, mechanism=curved(declared.mechanism))
    made = [_compared(declared, found.model, one) for one in unseen]
    return replace(found, validation=(*found.validation, *made))


def _compared(declared: Model, result: Model, one: Run | OrderTable) -> Validation:
    if isinstance(one, OrderTable):
        before, orders, before_by_order = left_of_table(declared, one)
        after, _, after_by_order = left_of_table(result, one)
        by_order = (tuple(map(float, row)) for row in (orders, before_by_order, after_by_order))
        return Validation(one.path, before, after, *by_order)
    return Validation(one.path, _rms(declared, one), _rms(result, one))


def _rms(model: Model, run: Run) -> float:
    """What a model leaves of a run, the offset of each direction taken off."""
    run.check_effects(model, run.path or "the run")
    where = run.conditions(model)
    if np.unique(run.direction).size == 1:
        where = replace(where, direction=float(run.direction[0]))
    rest = run.error(model) - predict(model, where).transmission_error
    for sense in np.unique(run.direction):
        rest[run.direction == sense] -= rest[run.direction == sense].mean()
    return float(np.sqrt(np.mean(rest**2)))
