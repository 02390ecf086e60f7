"""Output error against input speed: by order and in total, critical speeds, and contacts that would have to pull."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from rverror.base.arrays import Array
from rverror.base.directions import Direction, direction_sign
from rverror.base.errors import InputError, renamed
from rverror.base.quantities import row
from rverror.base.viewed import Viewed
from rverror.dynamics.loaded_motion import MovingReducer, ReducedMotion, moving_reducer
from rverror.geartrain.mechanism import Reducer
from rverror.model.effects import Effect, Model, check_model
from rverror.model.readings import added, unread
from rverror.statics.loaded_state import Settled

#: Share of the largest amplitude at a speed from which an order is told.
_TOLD = 0.01
#: Growth over the amplitude at a crawl from which a peak is critical.
CRITICAL = 2.0
#: How near a natural frequency a peak is taken for its.
NEAR = 0.1
#: Share of a contact's forces that would have to pull from which an error at speed is no prediction.
PULLED = 0.01
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
    reducer : Reducer
    torque, direction : float
        N*mm; +1 or -1.
    by_effect : ndarray, shape (effects + 1, s, n), optional
        Part of each effect of the model in the error, linear about the loaded state, rad; last what is left: what the
        load does whatever the errors, and what contacts that open make of them.  They add up to the error.
    effects : tuple of Effect
        Those of the model.
    """

    speed: Array
    theta: Array
    transmission_error: Array
    crawl: Array
    period: int
    frequency: Array
    of_sun_support: np.ndarray[tuple[int], np.dtype[np.bool_]]
    pulled: Mapping[str, Array]
    reducer: Reducer
    torque: float
    direction: float
    by_effect: Array | None = None
    effects: tuple[Effect, ...] = ()

    @property
    def ratio(self) -> float:
        """Input turns per output turn."""
        return self.reducer.ratio

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
        """Orders that have, at some speed, a hundredth of the largest amplitude there, (o,).

        What is above half the samples of a turn appears at a lower order (`folded_order`): 976, 584 and 1952 of an
        RV-40E are the second, third and fourth wave of its cycloid mesh, 3120, 4680 and 6240.
        """
        return self._strong_orders / self.period

    @property
    def waves(self) -> Array:
        """Amplitude times exp(i phase) of each of `order` at each speed, rad, (s, o).

        The error is the sum of amplitude times cos(order theta + phase).
        """
        return np.asarray(_waves(self.transmission_error)[:, self._strong_orders])

    @property
    def effect_waves(self) -> Array:
        """The same of each row of `by_effect`, rad, (effects + 1, s, o).

        Raises
        ------
        InputError
            If the effects were not asked for.
        """
        if self.by_effect is None:
            raise InputError("the response was not asked for by effect; call speed_response with by_effect=True")
        return np.asarray(_waves(self.by_effect)[..., self._strong_orders])

    @property
    def crawl_waves(self) -> Array:
        """The same at no speed, (o,)."""
        return np.asarray(_waves(self.crawl)[self._strong_orders])

    @cached_property
    def _strong_orders(self) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
        every = np.abs(_waves(np.vstack([self.crawl, self.transmission_error])))[:, 1:]
        largest = np.maximum(every.max(axis=1, keepdims=True), np.finfo(np.float64).tiny)
        return 1 + np.flatnonzero((every >= _TOLD * largest).any(axis=0))

    @cached_property
    def critical_speeds(self) -> tuple[CriticalSpeed, ...]:
        """Peaks of orders over the speeds, the highest first.

        A peak is larger than at the speeds beside it and twice that at a crawl; at either end there is none.
        """
        size, crawl = np.abs(self.waves), np.abs(self.crawl_waves)
        inner, order = size[1:-1], self.order
        tops = (inner > size[:-2]) & (inner >= size[2:]) & (inner >= CRITICAL * crawl)
        found = [self._critical(1 + top, order[at], size[:, at], crawl[at]) for at, top in np.argwhere(tops.T).tolist()]
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


@renamed(speeds="input_speeds")
def speed_response(
    model: Model,
    input_speeds: Any,
    *,
    torque: Any | None = None,
    direction: Direction = "forward",
    kept: int | None = None,
    by_effect: bool = False,
) -> SpeedResponse:
    """Output error of a reducer at each of some input speeds, by harmonic balance.

    Parameters
    ----------
    model : Model
        Of a reducer; its effects, stiffness, inertia and bench count.  What only misreads the output does not.
    input_speeds : array_like or quantity, shape (s,)
        Of the input, rad/s, 0 or more; a list may hold strings such as ``"100 rpm"``.
    torque : float or quantity, optional
        Size of the output torque, N*mm, that resists the motion; the rated torque where left out.
    direction : {"forward", "reverse"} or +1 or -1
    kept : int, optional
        How many modes of the mean stiffness keep their inertia; where left out those up to two and a half times the
        highest frequency that the meshes drive.
    by_effect : bool
        Also tell what each effect does; that takes as long again for every effect.

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
    (of the RV-40E's 4096 a turn up to 2048; higher ones appear folded, see `SpeedResponse.order`), coupled by K(theta).
    Sources 001 and 004 have M x'' + C x' + K x.

    Examples
    --------
    >>> import rverror
    >>> bench = rverror.model.Bench(load_inertia="5 kg*m^2")
    >>> cam = rverror.effect("crank.eccentricity", crank=0, disc=0, tangential="5 um")
    >>> found = speed_response(rverror.Model(rverror.reducer("RV-40E"), (cam,), bench=bench), ["600 rpm", "6000 rpm"])
    >>> bool(found.peak_to_peak[1] > 2 * found.peak_to_peak[0])  # order 40 meets the load's natural frequency
    True
    """
    check_model(model)
    rows, direction = _speeds(input_speeds), direction_sign(direction)
    made = moving_reducer(model, torque=torque, direction=direction, fastest=float(rows.max()), kept=kept)
    moving, beyond = made.motion, added(unread(model).effects, made.where.read)
    motions = [(moving.response(turn), turn) for turn in map(made.turn, rows.tolist())]
    errors = np.array([moving.error(*one) for one in motions]) + beyond
    return SpeedResponse(
        speed=rows,
        theta=made.theta,
        transmission_error=errors,
        crawl=moving.error(moving.response(0.0), 0.0) + beyond,
        period=made.period,
        frequency=made.frequency,
        of_sun_support=made.of_sun_support,
        pulled=_pulled(moving, made.settled, motions),
        reducer=made.unit,
        torque=made.torque,
        direction=direction,
        by_effect=_by_effect(made, model, rows, errors) if by_effect else None,
        effects=model.effects,
    )


def influences_at_speed(
    model: Model,
    speed: Any,
    effects: Sequence[Effect],
    *,
    torque: Any | None = None,
    direction: Direction = "forward",
) -> tuple[Array, Array, list[Array], float]:
    """Output error of a reducer at an input speed, and how it changes with sizes of errors there.

    Parameters
    ----------
    model : Model
        As for `speed_response`; what only misreads the output is in the error.
    speed : float or quantity
        Of the input, rad/s, 0 or more.
    effects : sequence of Effect
        Errors whose influence is asked for; their sizes play no part, and the model need not have them.
    torque, direction
        As for `speed_response`.

    Returns
    -------
    theta : ndarray, shape (n,)
        Nominal output angle over one period, rad.
    transmission_error : ndarray, shape (n,)
        rad.
    matrices : list of ndarray, each of shape (parameters, n)
        rad per core unit of each parameter of each effect.
    speed : float
        Of the input, rad/s.

    Raises
    ------
    InputError, NotConvergedError
        As `speed_response`.

    Notes
    -----
    Linear about the loaded state of the model, the closed contacts held closed: each is the harmonic balance driven by
    what the pose does with the parameter.

    Examples
    --------
    >>> import rverror
    >>> bench = rverror.model.Bench(load_inertia="5 kg*m^2")
    >>> cam = rverror.effect("crank.eccentricity", crank=0, disc=0, tangential="5 um")
    >>> model = rverror.Model(rverror.reducer("RV-40E"), bench=bench)
    >>> _, _, matrices, _ = influences_at_speed(model, "6000 rpm", [cam])
    >>> matrices[0].shape  # radial and tangential
    (2, 4096)
    """
    rows = _speeds(speed)
    if rows.size > 1:
        raise InputError("speed: give one")
    own = float(rows[0])
    made = moving_reducer(model, torque=torque, direction=direction_sign(direction), fastest=own, causes=effects)
    still = made.where.read
    turn = made.turn(own)
    nominal = made.motion.error(made.motion.response(turn), turn) + added(model.effects, still)
    shares = made.shares(effects)
    matrices = []
    for effect in effects:
        units = [replace(effect, values=tuple(unit)) for unit in np.eye(len(effect.values))]
        matrices.append(np.array([next(shares)(turn) + added((one,), still) for one in units]))
    return made.theta, nominal, matrices, own


def _by_effect(made: MovingReducer, model: Model, rows: Array, errors: Array) -> Array:
    """Each effect's part of the error at some speeds, and what the load does whatever they are, (effects + 1, s, n)."""
    moves, shares = unread(model).effects, made.shares(model.effects)
    parts = np.zeros((len(model.effects) + 1, *errors.shape))
    for number, effect in enumerate(model.effects):
        for value, share in zip(effect.values, shares, strict=False):
            parts[number] += value * np.array([share(turn) for turn in map(made.turn, rows.tolist())])
        if effect in moves:
            parts[number] += added((effect,), made.where.read)
    parts[-1] = errors - parts[:-1].sum(axis=0)
    return parts


def _speeds(speeds: Any) -> Array:
    """Row of speeds, rad/s."""
    rows = row("input_speeds", speeds, "angular_speed")
    if not (rows >= 0).all():
        raise InputError("input_speeds: each must be 0 or more; the direction is said by itself")
    return rows


def _pulled(moving: ReducedMotion, state: Settled, motions: Sequence[tuple[Array, float]]) -> dict[str, Array]:
    """Largest share of the force with which closed pins, and flanks, would have to pull in each of some motions."""
    train, solution = moving.whole.train, state.solution
    pressed, closing = solution.pin_tangent[::_EVERY], state.contacts.pin_rows[::_EVERY]
    pins = np.zeros((*pressed.shape, train.size))  # how each contact's force follows the parts
    for k in range(pressed.shape[1]):
        first = train.place(f"disc {k}")[0]
        pins[:, k, :, first : first + 3] = np.swapaxes(closing[:, k], 1, 2) * pressed[:, k, :, None]
    flanks = (state.flank[..., None] * train.flank_rows(state))[::_EVERY]
    poses, n = [moving.pose(moved, speed, slice(None, None, _EVERY)) for moved, speed in motions], len(pins)
    found = {}
    for name, rows, rest in (
        ("pins", pins.reshape(n, -1, train.size), solution.pin_force[::_EVERY].reshape(n, -1)),
        ("flanks", flanks, state.split(solution.row_force)[0][::_EVERY]),
    ):
        forces = np.array([rest + (rows @ pose.T[..., None])[..., 0] for pose in poses])
        pull = np.where(rest > 0, np.maximum(-forces, 0.0), 0.0).sum(axis=-1)
        found[name] = (pull / np.maximum(rest.sum(axis=1), np.finfo(float).tiny)).max(axis=-1)
    return found
