"""The passport of a reducer's runs: waves of its frames' orders, as a table would hold them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rverror.base.errors import InputError
from rverror.diagnosis.order_passport import OrderPassport, passport
from rverror.geartrain.kinematics import fundamental_orders
from rverror.geartrain.mechanism import Reducer
from rverror.runs.measurement import Run
from rverror.runs.order_fit import order_table_from_runs

_FRAMES = ("output", "housing", "crank", "sun")  # one of each order: carrier and disc have the crank's
_HARMONICS = (1, 2)
_SAMPLES_A_WAVE = 5  # below it a wave is told by how the samples happen to lie


def passport_of_runs(unit: Reducer, runs: Sequence[Run]) -> tuple[OrderPassport, ...]:
    """Passport of the orders of the frames, once and twice; empty where the runs cannot tell them apart.

    Parameters
    ----------
    unit : Reducer
    runs : sequence of Run
        Readings that were set aside by a diagnosis are in them: intervals are then wide.

    Returns
    -------
    tuple of OrderPassport
        The strongest first.
    """
    of_frame = fundamental_orders(unit)
    orders = sorted({h * of_frame[frame] for frame in _FRAMES for h in _HARMONICS})
    try:
        samples = [run.size / max(float(np.ptp(run.nominal_angle(unit))) / (2 * np.pi), 1e-9) for run in runs]
        told = [order for order in orders if order * _SAMPLES_A_WAVE < min(samples)]
        return passport(order_table_from_runs(runs, unit, told).cases, ratio=unit.ratio)
    except InputError:  # less than a turn, two runs of one condition, zeros of several labels
        return ()
