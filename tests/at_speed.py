"""Order tables over the speed: of a train in its harmonic balance, and of laws that no natural frequency makes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

import rverror
from rverror.base.arrays import Array
from rverror.base.units import ARCSEC
from rverror.model.effects import Model
from rverror.runs.order_table import OrderCase, TableCondition

TURN = 2 * np.pi
#: Makes the orders 78, 156, 234 that meet a frequency of some 35 Hz up to 3000 rpm.
RING = rverror.effect("cycloid.pin_circle", harmonic=2, radial_cos="6 um")
CAM = rverror.effect("crank.eccentricity", crank=0, disc=0, radial="8 um", tangential="-5 um")
RPM = tuple(float(n) for n in range(200, 3000, 200))


@dataclass(frozen=True, eq=False)
class AtSpeed:
    """Waves of a loaded train at some speeds, rad, and its lowest natural frequency, Hz, as a mean over the turn."""

    direction: float
    torque: float
    speed: Array
    orders: Array
    waves: Array
    frequency: float

    def cases(self, *, noise: float, seed: int = 0, stated: bool = True) -> list[OrderCase]:
        """As a bench would tell them, with noise in arcsec."""
        rng, found = np.random.default_rng((seed, round(self.torque))), []
        for speed, row in zip(self.speed.tolist(), self.waves, strict=True):
            spread = noise * ARCSEC * (rng.normal(size=row.size) + 1j * rng.normal(size=row.size))
            found.append(
                OrderCase(
                    condition=TableCondition(direction=self.direction, torque=self.torque, input_speed=speed),
                    orders=self.orders,
                    waves=row + spread,
                    sigma=np.full(row.size, noise * ARCSEC) if stated else None,
                )
            )
        return found


def at_speed(
    model: Model, *, torque: float, direction: float = 1.0, rpm: Sequence[float] = RPM, orders: Sequence[float] = ()
) -> AtSpeed:
    """A train's error at speed by harmonic balance with its two lowest modes, which shares no formula with a fit.

    Its stiffness varies over the turn, and pins follow far faster than its lowest mode: what is seen of that is the
    mean of the natural frequencies at all angles.
    """
    found = rverror.dynamics.speed_response(
        model, [f"{n} rpm" for n in rpm], torque=torque, direction=direction, kept=2
    )
    told = np.array(orders) if orders else found.order[(found.order > 30) & (found.order < 300)]
    waves = [[2 * np.mean(te * np.exp(-1j * k * found.theta)) for k in told] for te in found.transmission_error]
    angles = TURN * (np.arange(37) + 0.3) / 37  # so many that no frame's order stands still
    lowest = [rverror.dynamics.modes(model, torque=torque, theta=a, direction=direction).frequency[0] for a in angles]
    return AtSpeed(direction, torque, found.speed, told, np.array(waves), float(np.mean(lowest)))


def with_load(*effects: rverror.Effect, inertia: float = 5.0, damping: float = 0.03) -> Model:
    """An RV-40E whose load of so many kg m^2 swings at some 35 Hz on the train."""
    bench = rverror.model.Bench(load_inertia=f"{inertia} kg*m^2", damping_ratio=damping)
    return Model(rverror.reducer("RV-40E"), effects, bench=bench)


def by_law(
    law: Callable[[float, Array], Array],
    *,
    orders: Sequence[float],
    speeds: Sequence[float],
    torques: Sequence[float] = (1e5,),
    direction: float = 1.0,
    noise: float = 0.05,
    seed: int = 0,
    stated: bool = True,
) -> list[OrderCase]:
    """Waves of a law of order and input speeds, arcsec, with noise; speeds in rad/s."""
    rng, cases = np.random.default_rng(seed), []
    speed = np.array(speeds)
    for torque in torques:
        waves = np.array([law(order, speed) for order in orders]).T.astype(complex)
        waves = waves + noise * (rng.normal(size=waves.shape) + 1j * rng.normal(size=waves.shape))
        for at, row in zip(speed.tolist(), waves, strict=True):
            cases.append(
                OrderCase(
                    condition=TableCondition(direction=direction, torque=torque, input_speed=at),
                    orders=np.array(orders, dtype=np.float64),
                    waves=row * ARCSEC,
                    sigma=np.full(len(orders), noise * ARCSEC) if stated else None,
                )
            )
    return cases
