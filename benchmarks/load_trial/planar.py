"""Planar quasi-static equilibrium of a whole RV gear train over many angles; see `kernel` for the equations.

train = train_of(rverror.load_model("examples/rv40e.toml").mechanism)
solved = solve(train, perfect(train), theta, 412e3)
solved.output                                       # transmission error, rad, shape (n,)
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from benchmarks.load_trial.kernel import Train, Unit, closings, compiled, inner
from benchmarks.load_trial.newton import BALANCE, DOWN, HEAVY, STEPS, along, assemble, newton_step, slope

Array = npt.NDArray[np.float64]


@inner
def settle(t, x, load, most, pin, flank, eps, radial, cam, bore, clearance, g, blocks, coupling, crank, v, p, r):
    """Move x to the least energy; steps taken, -1 where the balance was not reached in ``most`` steps.

    Work arrays: g, v as x; blocks (nd + 2, 3, 3), coupling (nd + 2, 3, 3 nc), crank (3 nc, 3 nc); p, r as closings.
    """
    bound = BALANCE * abs(load) / t.crank_circle
    carrier = 3 * t.discs + 2
    ridge, count = 0.0, 0
    while True:
        assemble(t, x, pin, flank, eps, radial, cam, bore, clearance, load, g, blocks, coupling, crank)
        left = 0.0
        for i in range(x.size):
            rotates = (i % 3 == 2) if i < carrier else ((i - carrier) % 3 == 2)
            if i == 3 * t.discs or i == 3 * t.discs + 1:
                rotates = False
            force = abs(g[i]) / t.crank_circle if rotates else abs(g[i])
            if not force <= left:  # so that what is no number stays one that is not in balance
                left = force
        if left <= bound:
            return count
        if count == most or ridge > 1e6 * t.k_pin:
            return -1
        if not newton_step(t, g, blocks, coupling, crank, ridge, v):
            ridge = max(10 * ridge, 1e-7 * t.k_pin)
            continue
        ridge = 0.0
        count += 1
        start = 0.0
        for i in range(x.size):
            start += g[i] * v[i]
        along(t, x, pin, flank, eps, radial, cam, bore, v, p, r)
        low, high, s = 0.0, 0.0, 1.0
        slope_low, slope_high = start, 0.0
        for _ in range(40):
            here = slope(t, x, v, load, clearance, p, r, s)
            if abs(here) <= 0.3 * abs(start) or (high > 0.0 and high - low < 1e-12 * high):
                break
            if here < 0.0:
                low, slope_low = s, here
            else:
                high, slope_high = s, here
            if high > 0.0:  # between the secant and the middle, so that either end moves
                s = 0.5 * (low + high)
                secant = low - slope_low * (high - low) / (slope_high - slope_low)
                s = 0.5 * (s + secant)
            else:
                s = 2.0 * s
        for i in range(x.size):
            x[i] += s * v[i]


@compiled
def over_angles(t, u, thetas, loads, reference, start, known, poses, steps):
    """Solve at each angle; poses (n, unknowns), steps (n,), negative where not settled.

    reference (n, unknowns) or (0, 0): poses of a like unit at the same angles, whose change from angle to angle is
    added to the neighbour's pose; start (n, unknowns): where each angle starts if ``known``.
    """
    nd, nc, n = t.discs, t.cranks, 3 * t.discs + 5 + 3 * t.cranks
    pin, flank = np.zeros((nd, t.pins, 4)), np.zeros((nc, 2, 4))
    eps, radial = np.zeros((nd, 2)), np.zeros((nc, 2))
    cam, bore = np.zeros((nc, nd, 2)), np.zeros((nc, 2))
    g, v, x = np.zeros(n), np.zeros(n), np.zeros(n)
    blocks, coupling, crank = np.zeros((nd + 2, 3, 3)), np.zeros((nd + 2, 3, 3 * nc)), np.zeros((3 * nc, 3 * nc))
    contacts = nd * t.pins + 2 * nc + 2 * nc * (nd + 1)
    p, r = np.zeros(contacts), np.zeros(contacts)
    warm = False
    for m in range(thetas.size):
        closings(t, u, thetas[m], pin, flank, eps, radial, cam, bore)
        like = reference.shape[0] > 0
        for i in range(n):  # loops, as numba compiles them in half the time of slices
            if known:
                x[i] = start[m, i]
            elif like:
                x[i] = reference[m, i] + (x[i] - reference[m - 1, i] if warm else 0.0)
        heavy, most = 1.0, STEPS
        if not (known or warm or like):
            heavy, most = HEAVY, DOWN
            x[:] = 0.0
        while True:
            done = settle(
                t, x, heavy * loads[m], most, pin, flank, eps, radial, cam, bore, u.clearance, g, blocks, coupling,
                crank, v, p, r,
            )  # fmt: skip
            if heavy == 1.0:
                if done >= 0 or most == DOWN:
                    break
                heavy, most = 2 * HEAVY, DOWN  # once more, from rest under a heavy load downwards
                x[:] = 0.0
            heavy /= 2
        warm = done >= 0
        for i in range(n):
            poses[m, i] = x[i]
        steps[m] = done


@dataclass(frozen=True)
class Solved:
    """Output error at each angle, rad; poses (n, unknowns); Newton steps; and whether each angle has settled."""

    output: Array
    poses: Array
    steps: npt.NDArray[np.int64]

    @property
    def settled(self) -> npt.NDArray[np.bool_]:
        """True where forces and moments are in balance."""
        return self.steps >= 0


_NOTHING = np.zeros((0, 0))


def solve(
    train: Train,
    unit: Unit,
    theta: Array,
    load: float | Array,
    *,
    near: Array | None = None,
    start: Array | None = None,
) -> Solved:
    """Solve the statics at the angles theta, rad, with the input held at its nominal angle.

    Parameters
    ----------
    load : float or array
        Torque on the output that resists forward motion, N mm; below 0 for reverse.
    near : array, shape (n, unknowns), optional
        Poses of a like unit at these angles and this load.
    start : array, shape (n, unknowns), optional
        Where each angle starts, in place of its neighbour's pose.
    """
    theta = np.atleast_1d(np.asarray(theta, dtype=float))
    loads = np.zeros(theta.shape) - load
    poses = np.zeros((theta.size, unknowns(train)))
    steps = np.zeros(theta.size, dtype=np.int64)
    over_angles(
        train,
        unit,
        theta,
        loads,
        _NOTHING if near is None else np.ascontiguousarray(near),
        _NOTHING if start is None else np.ascontiguousarray(start),
        start is not None,
        poses,
        steps,
    )
    return Solved(poses[:, 3 * train.discs + 4].copy(), poses, steps)


def unknowns(train: Train) -> int:
    """Number of unknowns: three for each disc, crank and the carrier, two for the sun."""
    return 3 * train.discs + 5 + 3 * train.cranks


def train_of(mechanism: Any) -> Train:
    """Read the numbers of a reducer of rverror.

    Raises
    ------
    ValueError
        If it has what is not written here: power laws, a turning housing.
    """
    law, preload = mechanism.contact_law, mechanism.bearing_preload
    if (law.pin_exponent, law.flank_exponent, law.profile_curvature) != (1, 1, 0):
        raise ValueError("only linear contacts with straight normals are judged")
    if mechanism.output != "carrier":
        raise ValueError("a turning housing is not judged")
    z1, z2, stiffness = mechanism.sun_teeth, mechanism.planet_teeth, mechanism.stiffness
    base = mechanism.module / 2 * np.cos(mechanism.pressure_angle)
    return Train(
        pins=mechanism.pins,
        discs=mechanism.discs,
        cranks=mechanism.cranks,
        lobes=mechanism.disc_lobes,
        ratio=1 + z2 / z1 * mechanism.pins,
        pin_circle=mechanism.pin_circle_radius,
        pin_radius=mechanism.pin_radius,
        eccentricity=mechanism.eccentricity,
        crank_circle=mechanism.module * (z1 + z2) / 2,
        sun_base=z1 * base,
        planet_base=z2 * base,
        pressure_angle=mechanism.pressure_angle,
        backlash=mechanism.gear_backlash,
        k_pin=stiffness.pin_contact,
        k_cam=stiffness.crank_bearing,
        k_bore=stiffness.carrier_bearing,
        k_mesh=stiffness.gear_mesh,
        k_sun=stiffness.sun_support,
        k_main=stiffness.main_bearing,
        preload_cam=preload.crank_bearing,
        preload_bore=preload.carrier_bearing,
        spline_radius=math.nan if mechanism.spline_radius is None else mechanism.spline_radius,
    )


def perfect(train: Train) -> Unit:
    """Make a unit without any error, whose arrays may be filled."""
    nd, nc, zp = train.discs, train.cranks, train.pins
    return Unit(
        pin_place=np.zeros((zp, 2)),
        pin_radius=np.zeros(zp),
        disc_waves=np.zeros((0, 5)),
        bores=np.zeros((nd, nc, 2)),
        cams=np.zeros((nc, nd, 2)),
        carrier_bores=np.zeros((nc, 2)),
        runout=np.zeros(2),
        sun_eccentricity=np.zeros(2),
        sun_offset=np.zeros(2),
        planet_eccentricity=np.zeros((nc, 2)),
        centre_distance=np.zeros((nc, 2)),
        sun_waves=np.zeros((0, 3)),
        planet_waves=np.zeros((0, 4)),
        crank_lead=np.zeros(nc),
        thinning=np.zeros(nc),
        clearance=-np.array([train.preload_cam, train.preload_bore]),
        grinding=np.zeros(2),
        input_turn=np.zeros(1),
        lobes=np.zeros((nd, train.lobes)),
        spline=np.zeros(nc),
    )
