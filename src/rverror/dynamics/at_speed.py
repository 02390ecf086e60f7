"""Output error against input speed: by order and in total, critical speeds, and contacts that would have to pull."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.base.viewed import Viewed
from rverror.dynamics.loaded_motion import ReducedMotion, loaded_motion
from rverror.dynamics.train import Train, loaded_reducer
from rverror.geartrain.contacts import pose
from rverror.geartrain.kinematics import fundamental_orders, samples_needed, true_period
from rverror.geartrain.mechanism import Reducer
from rverror.model.catalogue import source
from rverror.model.effects import Model
from rverror.model.readings import added, stand, unread
from rverror.statics.loaded_state import Tangent, statics_of

#: Times the highest frequency that the meshes drive: modes up to there keep their inertia.
REACH = 2.5
#: Share of the largest amplitude at a speed from which an order is told.
_TOLD = 0.01
#: Growth over the amplitude at a crawl from which a peak is critical.
CRITICAL = 2.0
#: How near a natural frequency a peak is taken for its.
NEAR = 0.1
#: Share of a contact's forces that would have to pull from which an error at speed is no prediction.
PULLED = 0.01
_MOST_ANGLES = 2**16  # of one period: two gigabytes
_EVERY = 16  # angle is looked at for contacts that pull


@dataclass(frozen=True)
class CriticalSpeed:
    """A speed at which an order peaks.

    Attributes
    ----------
    speed : float
        Of the input, rad/s.
    order : float
        Per output turn.
    amplitude : float
        rad.
    growth : float
        Times the amplitude at a crawl.
    frequency : float
        Natural frequency of the mean stiffness that is within a tenth of the peak's, Hz; nan where none is.
    of_sun_support : bool
        Whether that mode is one of the sun's support, and none of the machine.
    """

    speed: float
    order: float
    amplitude: float
    growth: float
    frequency: float
    of_sun_support: bool


@dataclass(frozen=True)
class SpeedResponse(Viewed):
    """Output error of a reducer at each of some input speeds.

    Attributes
    ----------
    speed : ndarray, shape (s,)
        Of the input, rad/s.
    theta : ndarray, shape (n,)
        Nominal output angle over one true period, rad.
    transmission_error : ndarray, shape (s, n)
        rad.
    crawl : ndarray, shape (n,)
        The same at no speed: the equilibrium's.
    period : int
        Output turns after which it repeats.
    frequency : ndarray, shape (m,)
        Natural frequencies of the mean stiffness, as far as they keep their inertia, Hz.
    of_sun_support : ndarray of bool, shape (m,)
        Which of them are modes of the sun's support.
    pulled : mapping of str to ndarray, each of shape (s,)
        Largest share of the force of all pins, and of all flanks, with which closed contacts would have to pull.  The
        error is no prediction where it is above 0.01: contacts open there, and that is not solved.
    ratio, torque, direction : float
        Input turns per output turn; N*mm; +1 or -1.
    """

    speed: Array
    theta: Array
    transmission_error: Array
    crawl: Array
    period: int
    frequency: Array
    of_sun_support: np.ndarray[tuple[int], np.dtype[np.bool_]]
    pulled: Mapping[str, Array]
    ratio: float
    torque: float
    direction: float

    @property
    def peak_to_peak(self) -> Array:
        """Largest less smallest error at each speed, rad, (s,)."""
        return np.asarray(np.ptp(self.transmission_error, axis=1))

    @property
    def rms(self) -> Array:
        """Root of the mean square without the mean at each speed, rad, (s,)."""
        return np.asarray(self.transmission_error.std(axis=1))

    @property
    def order(self) -> Array:
        """Orders that have, at some speed, a hundredth of the largest amplitude there, (o,)."""
        return self._told / self.period

    @property
    def waves(self) -> Array:
        """Amplitude times exp(i phase) of each of `order` at each speed, rad, (s, o).

        The error is the sum of amplitude times cos(order theta + phase).
        """
        return np.asarray(_waves(self.transmission_error)[:, self._told])

    @property
    def crawl_waves(self) -> Array:
        """The same at no speed, (o,)."""
        return np.asarray(_waves(self.crawl)[self._told])

    @cached_property
    def _told(self) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
        every = np.abs(_waves(np.vstack([self.crawl, self.transmission_error])))[:, 1:]
        largest = np.maximum(every.max(axis=1, keepdims=True), np.finfo(np.float64).tiny)
        return 1 + np.flatnonzero((every >= _TOLD * largest).any(axis=0))

    @cached_property
    def critical_speeds(self) -> tuple[CriticalSpeed, ...]:
        """Peaks of orders over the speeds, the highest first.

        A peak is larger than at the speeds beside it and twice that at a crawl; at either end there is none.
        """
        size, crawl = np.abs(self.waves), np.abs(self.crawl_waves)
        found = []
        for at, order in enumerate(self.order):
            row = size[:, at]
            inner = row[1:-1]
            tops = (inner > row[:-2]) & (inner >= row[2:]) & (inner >= CRITICAL * crawl[at])
            found += [self._critical(top, order, row, crawl[at]) for top in (1 + np.flatnonzero(tops)).tolist()]
        return tuple(sorted(found, key=lambda one: -one.amplitude))

    def _critical(self, top: int, order: float, row: Array, crawl: float) -> CriticalSpeed:
        """Peak of a parabola through the three speeds about a top."""
        near = slice(top - 1, top + 2)
        middle = self.speed[top]
        curve = np.polyfit(self.speed[near] - middle, row[near], 2)
        shift = -curve[1] / (2 * curve[0]) if curve[0] < 0 else 0.0
        speed = middle + shift
        frequency = order * speed / self.ratio / (2 * math.pi)
        amplitude = float(np.polyval(curve, shift))
        beside = np.abs(self.frequency - frequency)
        mode = int(beside.argmin())
        tied = beside[mode] <= NEAR * frequency
        return CriticalSpeed(
            speed=float(speed),
            order=float(order),
            amplitude=amplitude,
            growth=amplitude / crawl if crawl > 0 else math.inf,
            frequency=float(self.frequency[mode]) if tied else math.nan,
            of_sun_support=bool(tied and self.of_sun_support[mode]),
        )


def _waves(rows: Array) -> Array:
    """Fourier series of rows over one period, (..., n // 2 + 1), as amplitude times exp(i phase); the mean doubled."""
    return np.asarray(2 * np.fft.rfft(rows) / rows.shape[-1])


def speed_response(
    model: Model,
    speeds: Any,
    *,
    torque: Any | None = None,
    direction: float = 1.0,
    kept: int | None = None,
) -> SpeedResponse:
    """Output error of a reducer at each of some input speeds, by harmonic balance.

    Parameters
    ----------
    model : Model
        Of a reducer; its effects, stiffness, inertia and bench count.  What only misreads the output does not.
    speeds : array_like or quantity, shape (s,)
        Of the input, rad/s, 0 or more; a list may hold strings such as ``"100 rpm"``.
    torque : float or quantity, optional
        Size of the output torque, N*mm, that resists the motion; the rated torque where left out.
    direction : float
        +1 forward, -1 reverse.
    kept : int, optional
        How many modes of the mean stiffness keep their inertia; where left out those up to two and a half times the
        highest frequency that the meshes drive.

    Returns
    -------
    SpeedResponse

    Raises
    ------
    InputError
        If the model is no reducer, there is no torque, the speeds are none, no periodic motion is found at one, or
        errors of the sun repeat after too many turns.
    NotConvergedError
        If there is no equilibrium at some angle.

    Notes
    -----
    M y'' + C y' + K(theta) y = -M (X'' + x_s'') about the equilibrium x_s(theta), over all orders that the samples hold
    (4096 a turn of the RV-40E), coupled by K(theta).  Sources 001 and 004 have M x'' + C x' + K x.

    Examples
    --------
    >>> import rverror
    >>> bench = rverror.Bench(load_inertia="5 kg*m^2")
    >>> cam = rverror.effect("crank.eccentricity", crank=0, disc=0, tangential="5 um")
    >>> found = speed_response(rverror.Model(rverror.reducer("RV-40E"), (cam,), bench=bench), ["600 rpm", "6000 rpm"])
    >>> bool(found.peak_to_peak[1] > 2 * found.peak_to_peak[0])  # order 40 meets the load's natural frequency
    True
    """
    unit, size = loaded_reducer(model, torque)
    rows = _speeds(speeds)
    period = _period(model, unit)
    count = samples_needed(unit) * period
    theta = 2 * math.pi * period * np.arange(count) / count
    where, halfway = (
        stand(model, pose(unit, angle, torque=size, direction=direction)) for angle in (theta, theta + theta[1] / 2)
    )
    train = Train(unit, model.bench)
    tangents = list(statics_of(unit, where.gears).tangents(model.effects))
    between = np.concatenate([one.x for one in statics_of(unit, halfway.gears).tangents(model.effects)])
    whole = loaded_motion(train, tangents, where.gears.theta, 2 * math.pi * period, between)
    frequency, on_support = whole.mean_modes()
    if kept is None:
        driven = max(fundamental_orders(unit).values()) * rows.max() / unit.ratio / (2 * math.pi)
        kept = int((frequency <= REACH * driven).sum())
    moving = whole.reduced(max(kept, 1))
    pulling = _Pulling(moving, tangents)
    beyond = added(unread(model).effects, where.read)
    errors, pulled = np.empty((rows.size, count)), {name: np.zeros(rows.size) for name in ("pins", "flanks")}
    per_square: Array | None = None  # what is driven grows with the square of the speed
    for at, speed in enumerate(rows):
        turn = direction * float(speed) / unit.ratio
        moved = moving.response(turn, None if per_square is None else turn**2 * per_square)
        per_square = moved / turn**2 if turn else None
        errors[at] = moving.error(moved, turn) + beyond
        for name, share in pulling.shares(moved, turn).items():
            pulled[name][at] = share
    return SpeedResponse(
        speed=rows,
        theta=theta,
        transmission_error=errors,
        crawl=moving.error(np.zeros((moving.basis.shape[1], count)), 0.0) + beyond,
        period=period,
        frequency=frequency[: moving.basis.shape[1]],
        of_sun_support=on_support[: moving.basis.shape[1]],
        pulled=pulled,
        ratio=unit.ratio,
        torque=size,
        direction=direction,
    )


def _period(model: Model, unit: Reducer) -> int:
    """Output turns after which the error repeats: one where nothing has a broken order, as the sun's may be."""
    turning = [(source(one.key), one.indices) for one in unread(model).effects]
    orders = [order for entry, indices in turning for order in entry.orders(unit, indices)]
    # several planets hide some orders of the sun in what is told of it, and not in every error
    whole = all(float(order).is_integer() for order in orders) and all(entry.frame != "sun" for entry, _ in turning)
    period = 1 if whole else true_period(unit)
    if period * samples_needed(unit) > _MOST_ANGLES:
        raise InputError(
            f"ratio = {unit.ratio:g}: the error repeats after {period} output turns only, too many for one balance; "
            "leave out the errors that turn with the sun"
        )
    return period


def _speeds(speeds: Any) -> Array:
    """Row of speeds, rad/s."""
    try:
        if isinstance(speeds, Sequence):
            listed = [speeds] if isinstance(speeds, str) else speeds
            rows = np.array([units.to_core(one, "angular_speed") for one in listed], dtype=np.float64)
        else:
            rows = np.atleast_1d(units.to_core_array(speeds, "angular_speed"))
    except ValueError as error:
        raise InputError(f"speeds: {error}") from error
    if rows.ndim != 1 or not rows.size or not (rows >= 0).all():
        raise InputError("speeds: give a row of input speeds, each 0 or more; the direction is said by itself")
    return rows


@dataclass(frozen=True)
class _Pulling:
    """How closed contacts are loaded as the parts move, at some of the angles."""

    moving: ReducedMotion
    tangents: Sequence[Tangent]

    @cached_property
    def _contacts(self) -> tuple[tuple[Array, Array], ...]:
        """Rows of pins and flanks, (n, contacts, size), times their stiffness, and forces at rest, (n, contacts)."""
        train = self.moving.whole.train
        made: tuple[list[Array], ...] = ([], [], [], [])
        for tangent in self.tangents:  # each but the last has a whole number of strides
            pressed, closing = tangent.pin[::_EVERY], tangent.contacts.pin_rows[::_EVERY]
            rows = np.zeros((*pressed.shape, train.size))
            for k in range(pressed.shape[1]):
                first = train.place(f"disc {k}")[0]
                rows[:, k, :, first : first + 3] = np.swapaxes(closing[:, :, k], 1, 2)
            rows *= pressed[..., None]
            flanks = (tangent.flank[..., None] * train.flank_rows(tangent))[::_EVERY]
            parts = (rows, tangent.pin_force[::_EVERY], flanks, tangent.flank_force[::_EVERY])
            for whole, part in zip(made, parts, strict=True):
                whole.append(part)
        pins, pin_force, flanks, flank_force = map(np.concatenate, made)
        n = len(pins)
        return (pins.reshape(n, -1, train.size), pin_force.reshape(n, -1)), (flanks, flank_force)

    def shares(self, moved: Array, speed: float) -> dict[str, float]:
        """Largest share of the force with which closed pins, and flanks, would have to pull."""
        pose = self.moving.pose(moved, speed, slice(None, None, _EVERY))
        found = {}
        for name, (rows, rest) in zip(("pins", "flanks"), self._contacts, strict=True):
            force = rest + (rows @ pose.T[..., None])[..., 0]
            pull = np.where(rest > 0, np.maximum(-force, 0.0), 0.0).sum(axis=1)
            found[name] = float((pull / np.maximum(rest.sum(axis=1), np.finfo(float).tiny)).max())
        return found
