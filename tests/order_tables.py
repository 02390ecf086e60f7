"""Order tables of the small reducer, as a bench would print them, and single waves that are put in."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

import rverror
from gear_runs import TURN
from rverror.base.arrays import Array
from rverror.base.units import ARCSEC
from rverror.geartrain.kinematics import OperatingConditions
from rverror.model.effects import Model
from rverror.runs.order_table import OrderCase, OrderTable, TableCondition
from rverror.statics.prediction import predict

LOADS = (20e3, 60e3, 120e3, 200e3, 300e3)
#: Fundamental orders of the small reducer: output, housing, crank, twice these, sun and twice.
ORDERS = np.array([1.0, 2.0, 3.0, 7.0, 15.0, 16.0, 30.0, 32.0, 48.0, 49.0, 98.0])
NOISE = 0.05  # arcsec
CAM = rverror.effect("crank.eccentricity", crank=0, disc=0, radial="8 um", tangential="-5 um")
HEAD = rverror.effect("sensor.encoder_eccentricity", cos="20 arcsec", sin="-9 arcsec")


def waves_of(model: Model, direction: float, torque: float, orders: Array = ORDERS) -> Array:
    """Waves of a prediction over one turn by Fourier's sums: the orders are whole."""
    theta = TURN * np.arange(2048) / 2048
    error = predict(model, OperatingConditions(theta, direction, torque)).transmission_error
    return np.asarray([2 * np.mean(error * np.exp(-1j * order * theta)) for order in orders])


def table_of(
    model: Model, *, loads: Sequence[float] = LOADS, seed: int = 0, noise: float = NOISE, stated: bool = True
) -> OrderTable:
    """What a bench would print of a unit, with noise in every number."""
    rng, cases = np.random.default_rng(seed), []
    for direction in (1.0, -1.0):
        for load in loads:
            spread = noise * ARCSEC * (rng.normal(size=ORDERS.size) + 1j * rng.normal(size=ORDERS.size))
            cases.append(
                OrderCase(
                    condition=TableCondition(direction=direction, torque=load),
                    orders=ORDERS,
                    waves=waves_of(model, direction, load) + spread,
                    sigma=np.full(ORDERS.size, noise * ARCSEC) if stated else None,
                )
            )
    return OrderTable(cases=tuple(cases))


def with_wave(table: OrderTable, order: float, wave: Callable[[float, float], complex]) -> OrderTable:
    """The table with a wave more at an order, arcsec, of direction and torque in N m."""
    cases = []
    for case in table.cases:
        at = case.condition
        more = wave(at.direction, (at.torque or 0.0) / 1e3) * ARCSEC
        cases.append(replace(case, waves=case.waves + more * (case.orders == order)))
    return replace(table, cases=tuple(cases))


def empty(
    orders: Sequence[float], loads: Sequence[float], *, sigma: float, directions: Sequence[float] = (1.0, -1.0)
) -> OrderTable:
    """A table whose waves are none; `loads` in N m, `sigma` in arcsec."""
    return OrderTable(
        cases=tuple(
            OrderCase(
                condition=TableCondition(direction=direction, torque=1e3 * load),
                orders=np.array(orders, dtype=np.float64),
                waves=np.zeros(len(orders), complex),
                sigma=np.full(len(orders), sigma * ARCSEC),
            )
            for direction in directions
            for load in loads
        )
    )
