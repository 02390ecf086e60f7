"""Faults of the readings that show only in the residual of a fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rverror.base.arrays import Array
from rverror.base.errors import refusing
from rverror.diagnosis.gears.fit import Fit
from rverror.diagnosis.gears.record import Record
from rverror.runs.faults import Faults, find_faults

_BY_NOISE = 4.0  # standard deviations: noise goes beyond once in 16,000 values


def nearly_noise(fit: Fit) -> bool:
    """Tell whether faults of the readings that were not seen before may be all that is left beside noise.

    A fault is large in few values and what is missing shows in all, so none counts as more than noise makes it.
    """
    seen = zip(fit.run_set.observations, fit.residual, strict=True)
    white = (observation.whiten(rest[None]) for observation, rest in seen)
    squares = sum(float(np.minimum(row**2, _BY_NOISE**2).sum()) for row in white)
    return squares <= fit.run_set.policy.nearly_noise * fit.bound


def without_residual_faults(
    before: Sequence[Record], residual: Sequence[Array], *, least: float = 0.0
) -> list[Record] | None:
    """Records without what stands out of the residual of a fit; None where nothing more does.

    Parameters
    ----------
    before : sequence of Record
    residual : sequence of ndarray, shape (n,)
        Of each, rad.
    least : float
        Noise that a run must have to be looked at, rad: with less, the model's own kinks would be faults.
    """
    changed, records = False, []
    for record, rest in zip(before, residual, strict=True):
        records.append(record)
        if record.noise is not None and record.noise.rms < least:
            continue
        clean = np.where(record.kept, record.without_nuisance(rest), 0.0)
        known = Faults(record.theta, record.kept, np.zeros(0, dtype=np.intp), np.zeros(0))
        with refusing(f"{record.name}: "):
            found = find_faults(record.theta, clean, residual=True, earlier=known)
        if found.spikes.size or found.slips:
            changed = True
            slips = tuple(sorted({*record.slips, *(slip.index for slip in found.slips)}))
            records[-1] = replace(record, kept=found.kept, slips=slips, more=(*record.more, *found.notes()))
    return records if changed else None
