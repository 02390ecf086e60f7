"""What is limited: peak-to-peak of the transmission error at a load, lost motion, torsional stiffness, unit by unit."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt
from benchmarks.load_trial.kernel import Train, Unit
from benchmarks.load_trial.planar import Array, Solved, solve

ARCSEC = 180 * 3600 / np.pi
COARSE, FINE, PLACES = 1024, 4096, 48
# Largest and smallest coarse samples about which the finer grid is solved.  Of 60 units of each of 20 random lists this
# misses 0.0005 of the peak-to-peak on 4096 angles in the mean; 512 angles and four peaks miss 0.01 to 0.025, because
# pins that close make waves of orders up to some 1000.
PEAKS = 16


class NotSettledError(ArithmeticError):
    """An angle where the balance was not reached."""


def _checked(solved: Solved) -> Solved:
    if not solved.settled.all():
        raise NotSettledError(f"{int((~solved.settled).sum())} of {solved.output.size} angles have not settled")
    return solved


class Turn:
    """Transmission error over one turn of the output, forward at one torque.

    Parameters
    ----------
    torque : float
        N mm.
    like : Unit
        Whose poses start the others: all parts at their means.
    """

    def __init__(self, train: Train, torque: float, like: Unit) -> None:
        self.train, self.torque = train, torque
        self.theta = 2 * np.pi * np.arange(FINE) / FINE
        self.poses = _checked(solve(train, like, self.theta, torque)).poses
        self.coarse = np.arange(0, FINE, FINE // COARSE)

    def whole(self, unit: Unit) -> Array:
        """Error at all angles of the fine grid, arcsec."""
        return ARCSEC * _checked(solve(self.train, unit, self.theta, self.torque, near=self.poses)).output

    def peak_to_peak(self, unit: Unit) -> float:
        """Largest less smallest error, arcsec, the fine grid taken about the extreme samples of the coarse one only."""
        at, ratio = self.coarse, FINE // COARSE
        solved = _checked(solve(self.train, unit, self.theta[at], self.torque, near=self.poses[at]))
        y = solved.output
        fine: list[npt.NDArray[np.int64]] = []
        for sign in (1, -1):
            peak = (sign * y >= sign * np.roll(y, 1)) & (sign * y >= sign * np.roll(y, -1))
            order = np.argsort(np.where(peak, -sign * y, np.inf))[:PEAKS]
            fine += [np.arange(1 - ratio, ratio) + ratio * place for place in order if peak[place]]
        at = np.unique(np.concatenate(fine) % FINE)
        at = at[at % ratio != 0]
        near = (at + ratio // 2) // ratio % COARSE
        start = self.poses[at] + solved.poses[near] - self.poses[self.coarse[near]]
        more = _checked(solve(self.train, unit, self.theta[at], self.torque, start=start)).output
        return float(ARCSEC * (max(y.max(), more.max()) - min(y.min(), more.min())))


class Places:
    """Output at some torques at even angles of the turn, input held.

    Parameters
    ----------
    torques : sequence of float
        N mm, signed: above 0 resists forward motion.
    """

    def __init__(self, train: Train, torques: Iterable[float], like: Unit, places: int = PLACES) -> None:
        self.train = train
        self.theta = 2 * np.pi * np.arange(places) / places
        self.near = {torque: _checked(solve(train, like, self.theta, torque)).poses for torque in torques}

    def output(self, unit: Unit) -> dict[float, Array]:
        """Output angle at each torque, rad, shape (places,)."""
        return {
            torque: _checked(solve(self.train, unit, self.theta, torque, near=near)).output
            for torque, near in self.near.items()
        }


def transmission_errors(train: Train, units: Iterable[Unit], torque: float, like: Unit) -> Array:
    """Peak-to-peak of each unit, arcsec."""
    turn = Turn(train, torque, like)
    return np.array([turn.peak_to_peak(unit) for unit in units])


def lost_motions(train: Train, units: Iterable[Unit], rated: float, like: Unit) -> Array:
    """Largest lost motion of each unit, arcsec: output at +3 % of the rated torque less that at -3 %, input held."""
    places = Places(train, (0.03 * rated, -0.03 * rated), like)
    found = []
    for unit in units:
        # a load that resists forward motion turns the output back, so the one of -3 % stands ahead
        resisting, helping = places.output(unit).values()
        found.append(ARCSEC * (helping - resisting).max())
    return np.array(found)


def stiffnesses(train: Train, units: Iterable[Unit], rated: float, like: Unit) -> Array:
    """Least torsional stiffness of each unit between 50 and 100 % of the rated torque, both branches, N m / arcmin."""
    places = Places(train, (0.5 * rated, rated, -0.5 * rated, -rated), like)
    found = []
    for unit in units:
        half, full, back_half, back = places.output(unit).values()
        turn = 0.5 * ((half - full) + (back - back_half))
        found.append((0.5 * rated / 1e3 / (turn * ARCSEC / 60)).min())
    return np.array(found)
