"""Static condensation: what is linear between the discs and the held sun is taken out of the equilibrium beforehand.

Only pins open and close by turns; bearings without clearance are springs, and the loaded flanks stay closed.  With the
unknowns split into those of the discs, d, and the others, r,

    K = K_dd - K_dr K_rr^-1 K_rd,    f = f_d - K_dr K_rr^-1 f_r,    x_r = K_rr^-1 (f_r - K_rd x_d),

the discs alone (three unknowns each) take the pose of least energy of the whole gear train.  K_rr is regular: with the
discs held, their cams hold the cranks, the cranks the carrier, and its support the sun.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rverror.base.arrays import Array
from rverror.statics.energy import Closed, Flags, Geometry, Layout, Steps, System, held, minimise

_MOST_STEPS = 8
_FEW = 0.7  # of the angles: then the others are left out of the next step


@dataclass(frozen=True)
class Stretch:
    """Contact geometry at some angles, and what it condenses to, made once.

    Attributes
    ----------
    contacts : Geometry
    """

    contacts: Geometry

    @cached_property
    def condensed(self) -> Condensed:
        """Without clearance, onto the discs."""
        return condensed(self.contacts)


@dataclass(frozen=True)
class Condensed:
    """Stiffness of a gear train without clearance at n angles, condensed onto its discs; loaded flanks are closed.

    Attributes
    ----------
    discs : slice
        Unknowns of the discs.
    others : ndarray of int
        All other unknowns.
    inverse : ndarray, shape (n, others, others)
        Flexibility of the others with the discs held.
    carried : ndarray, shape (n, discs, others)
        Share of a force on the others that the discs carry, negative.
    matrix : ndarray, shape (n, discs, discs)
        Stiffness that the discs feel but for their pins, without which the train has one free motion.
    held : ndarray, shape (n, discs, discs)
        The same with a trace that holds it: a step from where all pins are open then leads far away, and no farther.
    pins : ndarray, shape (n, discs, 3, pins)
        How each pin closes with x, y and angle of its disc.
    on_pins : ndarray, shape (n, discs, 3, 3, pins)
        Stiffness that each disc feels of each pin.
    flanks : ndarray, shape (n, flanks, size)
        Rows of the loaded flanks times their stiffness, zero for the others.
    """

    discs: slice
    others: np.ndarray[tuple[int], np.dtype[np.intp]]
    inverse: Array
    carried: Array
    matrix: Array
    held: Array
    pins: Array
    on_pins: Array
    flanks: Array

    def settled(self, whole: System, torque: float, start: Array | None) -> tuple[Array, Steps, Flags]:
        """Pose of least energy with the loaded flanks closed, as of `energy.minimise`.

        Parameters
        ----------
        whole : System
            Of the same geometry, without clearance.
        torque : float
            Size of its load, N*mm, above 0.
        start : ndarray, shape (n, size), optional
            Poses that are likely near.

        Returns
        -------
        x : ndarray, shape (n, size)
        steps : ndarray of int, shape (n,)
        found : ndarray of bool, shape (n,)
        """
        # of springs and loaded flanks at the nominal pose
        springs = whole.spring_force + (whole.flank_error[:, None] @ self.flanks)[:, 0]
        force = whole.load - springs
        if start is None:
            x, steps, found = minimise(self._system(whole, springs), torque)
        else:
            x, steps, found = self._newton(whole, self._on_discs(force), start[:, self.discs], whole.tolerance(torque))
            left = np.flatnonzero(~found)
            if left.size:
                x[left], more, found[left] = minimise(self._system(whole, springs).take(left), torque, x[left])
                steps[left] += more
        return self._all(x, force), steps, found

    def _newton(self, whole: System, force: Array, start: Array, tolerance: float) -> tuple[Array, Steps, Flags]:
        """Plain Newton steps, exact once no pin opens or closes; angles that do not settle need a line search."""
        x, at = start.copy(), np.arange(len(start))
        steps, found = np.zeros(len(x), dtype=np.intp), np.zeros(len(x), dtype=np.bool_)
        parts = self.matrix, self.held, self.pins, self.on_pins, whole.pin_error, force
        for step in range(_MOST_STEPS + 1):
            matrix, stiff, rows, on_pins, errors, pull = parts
            now = x[at]
            closing = np.einsum("kdc,kdcp->kdp", now.reshape(*rows.shape[:2], 3), rows) + errors
            pressed = np.einsum("kdcp,kdp->kdc", rows, np.maximum(closing, 0)).reshape(now.shape)
            gradient = np.einsum("kij,kj->ki", matrix, now) + whole.reducer.stiffness.pin_contact * pressed - pull
            moving = np.abs(gradient).max(axis=1) > tolerance
            found[at[~moving]] = True
            if step == _MOST_STEPS or not moving.any():
                break
            if moving.mean() < _FEW:
                at, now, gradient, closing = at[moving], now[moving], gradient[moving], closing[moving]
                parts = _, stiff, _, on_pins, _, _ = tuple(part[moving] for part in parts)
            x[at] = now - _solved(_with_pins(stiff, on_pins, closing > 0), gradient)
            steps[at] += 1
        return x, steps, found

    def _system(self, whole: System, springs: Array) -> System:
        """Energy of the discs alone, from the force of springs and loaded flanks at the nominal pose."""
        n, count = len(whole.load), self.matrix.shape[-1]
        return replace(
            whole,
            first_disc=0,
            load=self._on_discs(whole.load),
            spring_matrix=self.matrix,
            spring_scale=np.abs(self.matrix).sum(axis=2).max(axis=1),
            spring_force=self._on_discs(springs),
            flank_rows=np.zeros((n, 0, count)),
            flank_error=np.zeros((n, 0)),
            journal_rows=np.zeros((n, 0, 2, count)),
            driving_flanks=np.zeros((n, 0), dtype=np.bool_),
        )

    def answer(self, whole: System, closed: Closed, force: Array) -> Array:
        """Change of the pose, (n, size), with a force on all parts, the closed pins held closed."""
        matrix = _with_pins(self.matrix, self.on_pins, closed.pins > 0)
        return self._all(_solved(matrix, self._on_discs(force)), force)

    def _on_discs(self, force: Array) -> Array:
        return np.asarray(force[:, self.discs] + (self.carried @ force[:, self.others, None])[..., 0])

    def _all(self, discs: Array, force: Array) -> Array:
        x = np.empty_like(force)
        x[:, self.discs] = discs
        # K_rr^-1 K_rd is the transpose of K_dr K_rr^-1
        x[:, self.others] = (self.inverse @ force[:, self.others, None])[..., 0]
        x[:, self.others] += (discs[:, None] @ self.carried)[:, 0]
        return x


def condensed(contacts: Geometry) -> Condensed:
    """Condense the springs and loaded flanks of a geometry onto its discs.

    Parameters
    ----------
    contacts : Geometry

    Returns
    -------
    Condensed
    """
    reducer = contacts.motion.reducer
    layout = Layout(reducer)
    discs = slice(layout.disc[0], layout.disc[0] + 3 * reducer.discs)
    others = np.delete(np.arange(layout.size), discs)
    flanks = contacts.driving_flanks[..., None] * (reducer.stiffness.gear_mesh * contacts.flank_rows)
    matrix = contacts.all_springs.matrix + np.swapaxes(contacts.flank_rows, 1, 2) @ flanks
    inverse = np.asarray(np.linalg.inv(matrix[:, others[:, None], others]), dtype=np.float64)
    across = matrix[:, discs, others]
    carried = -across @ inverse
    pins = np.ascontiguousarray(contacts.pin_rows.transpose(0, 2, 1, 3))
    on_pins = reducer.stiffness.pin_contact * pins[:, :, :, None] * pins[:, :, None]
    matrix = matrix[:, discs, discs] + carried @ np.swapaxes(across, 1, 2)
    return Condensed(
        discs=discs,
        others=others,
        inverse=inverse,
        carried=carried,
        matrix=matrix,
        held=held(matrix),
        pins=pins,
        on_pins=on_pins,
        flanks=flanks,
    )


def _with_pins(matrix: Array, on_pins: Array, closed: Flags) -> Array:
    """Stiffness of the discs with pins (n, discs, pins) that carry."""
    total, blocks = matrix.copy(), np.einsum("kdabp,kdp->kdab", on_pins, closed.astype(np.float64))
    for k in range(blocks.shape[1]):
        total[:, 3 * k : 3 * k + 3, 3 * k : 3 * k + 3] += blocks[:, k]
    return total


def _solved(matrix: Array, right: Array) -> Array:
    """Answers to a stack of systems that closed pins, or a trace of stiffness, make regular."""
    return np.asarray(np.linalg.solve(matrix, right[..., None])[..., 0])
