"""Torque on the output that changes over its turn: an arm's weight, and what a measured column tells of such a load.

A torque is signed here, whatever the motion: positive resists forward motion.  Without friction the pose knows the
torque alone, not the motion, so that what carries is the side that the torque closes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import zip_longest
from typing import Any

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.quantities import Checked, quantity

#: Torque over the output angle: N*mm at angles in rad.
TorqueLaw = Callable[[Array], Array]

_TURN = 2 * math.pi
#: Waves a turn of what is fitted to a column: an arm's weight has one, arms on linkages and balancers a few.  Beyond, a
#: brake's ripple of 1 % of the torque moves the windup by 1 % of it.
_HARMONICS = 6
#: Share of the largest torque that a column may be off its waves by, rms: more is no function of the angle.
_SCATTER = 0.2
_FINEST = 1e-9  # of the torque, rms: what is off by less is rounded
_PLACES = 4096  # angles of a turn between which crossings are looked for: far more than the waves have


@dataclass(frozen=True, kw_only=True)
class GravityArm(Checked):
    """Weight on an arm that turns with the output about a level axis, as a torque over the output angle.

        T(theta) = m g l cos(theta - offset)

    Parameters
    ----------
    mass : float, str or quantity
        Of arm and payload, tonne.
    lever : float, str or quantity
        From the axis to their centre of gravity, mm.
    offset : float, str or quantity
        Output angle at which the arm is level and forward motion lifts it, rad.
    gravity : float, str or quantity
        mm/s^2.

    Raises
    ------
    ValueError
        If mass, lever or gravity is not above 0.

    Examples
    --------
    Half a turn on it is level again, and forward motion lowers it:

    >>> arm = GravityArm(mass="20 kg", lever="0.5 m", offset="30 deg")
    >>> (arm(np.radians([30, 120, 210])) / 1e3).round(1).tolist()
    [98.1, 0.0, -98.1]
    """

    mass: float = field(metadata=quantity("mass", above=0.0))
    lever: float = field(metadata=quantity("length", above=0.0, remedy="; the offset says which way the arm points"))
    offset: float = field(default=0.0, metadata=quantity("angle"))
    gravity: float = field(default=9810.0, metadata=quantity("acceleration", above=0.0))

    def __call__(self, theta: Any) -> Array:
        """Torque at output angles, rad: N*mm, of their shape."""
        return np.asarray(self.mass * self.gravity * self.lever * np.cos(np.asarray(theta) - self.offset))


@dataclass(frozen=True)
class TorqueWaves:
    """Torque over the output angle by its waves, c_0 + sum of c_h cos(h theta) + s_h sin(h theta), N*mm.

    Parameters
    ----------
    cos : tuple of float
        From h = 0 on.
    sin : tuple of float
        From h = 1 on.

    Examples
    --------
    >>> waves = TorqueWaves((0.0, 2e3), (0.0,))
    >>> waves.peak, np.degrees(waves.crossings()).round(6).tolist()
    (2000.0, [90.0, 270.0])
    """

    cos: tuple[float, ...]
    sin: tuple[float, ...]

    def __call__(self, theta: Any) -> Array:
        """Torque at output angles, rad: N*mm, of their shape."""
        return np.asarray(np.array([*self.cos, *self.sin]) @ _waves(np.asarray(theta), len(self.sin)))

    @property
    def peak(self) -> float:
        """Largest size within a turn, N*mm."""
        return peak_torque(self)

    def crossings(self) -> tuple[float, ...]:
        """Angles of the first turn at which it changes its sign, rad."""
        theta = _TURN / _PLACES * np.arange(_PLACES + 1)
        value = self(theta)
        at = np.flatnonzero((value[:-1] < 0) != (value[1:] < 0))
        share = value[at] / (value[at] - value[at + 1])
        return tuple((theta[at] + share * _TURN / _PLACES).tolist())


def peak_torque(torque: TorqueLaw) -> float:
    """Largest size within a turn of the output, N*mm.

    Raises
    ------
    ValueError
        If it is not a finite number everywhere.

    Examples
    --------
    >>> round(peak_torque(GravityArm(mass="20 kg", lever="0.5 m", offset="30 deg")))
    98100
    """
    theta = np.linspace(0, _TURN, _PLACES, endpoint=False)
    return float(np.abs(units.to_core_array(torque(theta), "torque")).max())


def _waves(theta: Array, harmonics: int) -> Array:
    angle = np.arange(harmonics + 1).reshape(-1, *[1] * theta.ndim) * theta
    return np.concatenate([np.cos(angle), np.sin(angle[1:])])


def shared_torques(torques: Sequence[TorqueWaves | None], share: float) -> list[TorqueWaves | None]:
    """One torque for those that are the same but for noise: their mean.

    Parameters
    ----------
    torques : sequence of TorqueWaves or None
    share : float
        Of the largest, within which two are the same at every angle.

    Returns
    -------
    list of TorqueWaves or None
        Of each.

    Examples
    --------
    >>> one, other = TorqueWaves((0.0, 1000.0), (0.0,)), TorqueWaves((4.0, 1000.0), (0.0,))
    >>> shared_torques([one, None, other], 0.01)[2]
    TorqueWaves(cos=(2.0, 1000.0), sin=(0.0,))
    """
    theta = _TURN / _PLACES * np.arange(_PLACES)
    groups: list[list[TorqueWaves]] = []
    for one in filter(None, torques):
        like = (group for group in groups if np.abs(group[0](theta) - one(theta)).max() < share * one.peak)
        group = next(like, None)
        if group is None:
            groups.append(group := [])
        group.append(one)
    means = {id(one): _mean(group) for group in groups for one in group}
    return [None if one is None else means[id(one)] for one in torques]


def _mean(torques: Sequence[TorqueWaves]) -> TorqueWaves:
    def mean(rows: list[tuple[float, ...]]) -> tuple[float, ...]:
        return tuple(math.fsum(sizes) / len(rows) for sizes in zip_longest(*rows, fillvalue=0.0))

    return TorqueWaves(mean([one.cos for one in torques]), mean([one.sin for one in torques]))


def fitted_torque(theta: Array, torque: Array) -> TorqueWaves:
    """Torque over the angle by least squares from what a bench recorded.

    Parameters
    ----------
    theta : ndarray, shape (n,)
        Output angle, rad.
    torque : ndarray, shape (n,)
        As read, N*mm; positive resists forward motion.

    Returns
    -------
    TorqueWaves
        Of six waves a turn at most, of fewer over a part of a turn, as many as the noise lets stand out (Schwarz's
        criterion): each takes noise into the windup, white one of sigma as sigma sqrt((1 + 2 h) / n).

    Raises
    ------
    ValueError
        If it is no function of the angle, as a load that is changed within the run.

    Examples
    --------
    >>> theta = np.linspace(0, 6.2, 500)
    >>> noise = np.random.default_rng(1).normal(size=500)
    >>> fit = fitted_torque(theta, 1e3 * (100 * np.cos(theta) + noise))
    >>> bool(abs(fit(theta) - 1e5 * np.cos(theta)).max() < 1e3)
    True
    """
    most = min(max(int(_HARMONICS * np.ptp(theta) / _TURN * (1 + 1 / theta.size)), 1), _HARMONICS)
    floor, fits = _FINEST**2 * float(np.mean(torque**2)), []
    for harmonics in range(most + 1):
        rows = _waves(theta, harmonics)
        sizes = np.linalg.lstsq(rows.T, torque, rcond=1e-10)[0]
        square = float(np.mean((torque - sizes @ rows) ** 2))
        cost = theta.size * math.log(max(square, floor)) + 2 * harmonics * math.log(theta.size)
        fits.append((cost, harmonics, sizes, math.sqrt(square), float(np.abs(sizes @ rows).max())))
    _, harmonics, sizes, scatter, peak = min(fits, key=lambda fit: fit[:2])
    if scatter > _SCATTER * peak:
        raise ValueError(
            f"output_torque is {scatter / 1e3:.3g} N*m rms off what it is over the output angle, {peak / 1e3:.3g} N*m "
            f"at most, and may be {100 * _SCATTER:g} % of that: split the run where the load changes, or repair it"
        )
    return TorqueWaves(tuple(sizes[: harmonics + 1].tolist()), tuple(sizes[harmonics + 1 :].tolist()))
