"""Static condensation: what is linear between the discs and the held sun is taken out of the equilibrium beforehand.

Only pins open and close by turns; bearings without clearance are springs, and the loaded flanks stay closed.  With the
unknowns split into those of the discs, d, and the others, r,

    K = K_dd - K_dr K_rr^-1 K_rd,    f = f_d - K_dr K_rr^-1 f_r,    x_r = K_rr^-1 (f_r - K_rd x_d),

the discs alone (three unknowns each) take the pose of least energy of the whole gear train.  K_rr is regular: with the
discs held, their cams hold the cranks, the cranks the carrier, and its support the sun.

Flanks that close by a power law f(p) are condensed at their tangent stiffness k under the force that all carry without
errors.  What their law adds to that, q = f(p) - k p, one force for each loaded flank, is unknown beside the discs.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rverror.base.arrays import Array
from rverror.geartrain.mechanism import Reducer
from rverror.statics.energy import (
    Closed,
    Elastic,
    Flags,
    Layout,
    Steps,
    System,
    flank_lever,
    held,
    minimise,
    with_discs,
)

_MOST_STEPS = 8
_MOST_STEPS_BY_LAW = 12
_FEW = 0.7  # of the angles: then the others are left out of the next step


@dataclass(frozen=True)
class Stretch(Elastic):
    """A gear train at some angles under a torque, and what it condenses to, made once.

    Attributes
    ----------
    torque : float
        Size of the torque on the carrier, N*mm, above 0.
    like : Stretch, optional
        The same without compliances beyond the nominal ones.
    """

    torque: float

    like: Stretch | None = None

    @cached_property
    def condensed(self) -> Condensed:
        """Without clearance, onto the discs."""
        if self.like is not None and not self.more.keys() - {"pin"}:
            return self.like.condensed  # pins have no part in it
        return condensed(self)

    def softer(self, more: Mapping[str, Array]) -> Stretch:
        """The same with contacts that give way `more`, as of `energy.Errors.compliance`."""
        return replace(self, more=more, like=self) if more else self


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
    flanks : ndarray, shape (n, flanks, size)
        Rows of the loaded flanks times their stiffness, zero for the others.
    flank_stiffness : ndarray, shape (n or 1, flanks or 1)
        That stiffness: the tangent under a common force.
    common_closing : ndarray, shape (n or 1, flanks or 1)
        How far a flank closes under that force, mm.
    loaded : ndarray, shape (n, cranks, size)
        Rows of the loaded flanks alone.
    driving : ndarray of bool, shape (n, cranks, 2)
        Which flank of each mesh that is.
    torque : float
        Under which all this is so, N*mm.
    """

    discs: slice
    others: np.ndarray[tuple[int], np.dtype[np.intp]]
    inverse: Array
    carried: Array
    matrix: Array
    held: Array
    pins: Array
    flanks: Array
    flank_stiffness: Array
    common_closing: Array
    loaded: Array
    driving: Flags
    torque: float

    def with_pins(self, rows: Array) -> Condensed:
        """The same with pins that close by other rows, (n, 3, discs, pins), with x, y and angle of their disc."""
        return replace(self, pins=np.ascontiguousarray(rows.transpose(0, 2, 1, 3)))

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
        if whole.flank_law.linear:
            return self._settled(whole, whole.flank_error, torque, start)
        return self._settled_by_law(whole, torque, start)

    def _settled_by_law(self, whole: System, torque: float, start: Array | None) -> tuple[Array, Steps, Flags]:
        """`settled` with flanks of a power law: Newton steps of the discs and of what the law adds to each flank."""
        errors, stiffness = self._loaded(whole.flank_error), self._loaded(whole.flank_stiffness)
        soft, common = self._loaded(self.flank_stiffness), self._loaded(self.common_closing)
        law, before = whole.flank_law, np.zeros(len(errors), dtype=np.intp)
        if start is None:
            ahead = law.force(common, stiffness) / soft - common
            start, before, _ = self._settled(whole, whole.flank_error + self._of_all_flanks(ahead), torque, None)
        closing = (self.loaded @ start[..., None])[..., 0] + errors
        closing = np.where(closing > 0, closing, common)
        # soft * closing is in the condensed stiffness, soft * error in the force
        added = law.force(closing, stiffness) - soft * closing
        force = whole.load - whole.spring_force - ((soft * errors)[:, None] @ self.loaded)[:, 0]
        x, added, steps, found = self._newton_by_law(whole, force, start[:, self.discs], added)
        return self._all(x, force - (added[:, None] @ self.loaded)[:, 0]), before + steps, found

    def _newton_by_law(
        self, whole: System, force: Array, start: Array, added: Array
    ) -> tuple[Array, Array, Steps, Flags]:
        """Discs, (n, discs), and what the law adds to the force of each loaded flank, (n, cranks)."""
        tolerance = whole.tolerance(self.torque)
        lever = max(1.0, np.abs(flank_lever(whole.reducer)).max())
        at, count = np.arange(len(start)), start.shape[1]
        unknown, steps = np.concatenate([start, added], axis=1), np.zeros(len(start), dtype=np.intp)
        found = np.zeros(len(start), dtype=np.bool_)
        parts = (
            self.matrix,
            self.pins,
            *self._flanks_on_discs,
            whole.pin_error,
            whole.pin_stiffness,
            self._on_discs(force),
            self._loaded(whole.flank_error) + (self._on_others(self.loaded) @ self._free(force)[..., None])[..., 0],
            self._loaded(whole.flank_stiffness),
            self._loaded(self.flank_stiffness),
        )
        for step in range(_MOST_STEPS_BY_LAW + 1):
            matrix, rows, across, own, errors, stiffness, pull, apart, flank, soft = parts
            discs, added = unknown[at, :count], unknown[at, count:]
            closing = np.einsum("kdc,kdcp->kdp", discs.reshape(*rows.shape[:2], 3), rows) + errors
            carried, tangent = whole.pin_law.pressed(closing, stiffness)
            gradient = np.einsum("kdcp,kdp->kdc", rows, carried).reshape(discs.shape) - pull
            gradient += (matrix @ discs[..., None])[..., 0] + (added[:, None] @ across)[:, 0]
            closing = apart + (across @ discs[..., None])[..., 0] - (own @ added[..., None])[..., 0]
            carried, of_flanks = whole.flank_law.pressed(closing, flank)
            missing = carried - soft * closing - added
            left = np.maximum(np.abs(gradient).max(axis=1), lever * np.abs(missing).max(axis=1))
            moving = left > tolerance
            found[at[~moving]] = True
            if step == _MOST_STEPS_BY_LAW or not moving.any():
                break
            if moving.mean() < _FEW:
                at, parts = at[moving], tuple(part[moving] for part in parts)
                gradient, missing, tangent, of_flanks = (
                    part[moving] for part in (gradient, missing, tangent, of_flanks)
                )
                matrix, rows, across, own, *_, soft = parts
            # held by a trace: where all pins are open the train has one free motion
            joint = _joint(_with_pins(held(matrix), rows, tangent), across, own, of_flanks - soft)
            unknown[at] += _solved(joint, np.concatenate([-gradient, -missing], axis=1))
            steps[at] += 1
        return unknown[:, :count], unknown[:, count:], steps, found

    @cached_property
    def _flanks_on_discs(self) -> tuple[Array, Array]:
        """Closing of the loaded flanks with the discs, the others following, and less with their own forces."""
        held = self._on_others(self.loaded)
        across = self.loaded[:, :, self.discs] + held @ np.swapaxes(self.carried, 1, 2)
        return across, held @ self.inverse @ np.swapaxes(held, 1, 2)

    def _on_others(self, rows: Array) -> Array:
        return rows[..., self.others]

    def _free(self, force: Array) -> Array:
        """Displacement of the others under a force, the discs held."""
        return np.asarray((self.inverse @ force[:, self.others, None])[..., 0])

    def _loaded(self, of_flanks: Array) -> Array:
        """What belongs to the one flank of each mesh that carries, (n, cranks)."""
        n, cranks = self.loaded.shape[:2]
        pairs = np.broadcast_to(of_flanks, (n, 2 * cranks)).reshape(n, cranks, 2)
        return np.asarray((pairs * self.driving).sum(axis=2), dtype=np.float64)

    def _of_all_flanks(self, of_loaded: Array) -> Array:
        """The same, at its place among all flanks."""
        return np.asarray((of_loaded[..., None] * self.driving).reshape(len(of_loaded), -1), dtype=np.float64)

    def _settled(
        self, whole: System, flank_error: Array, torque: float, start: Array | None
    ) -> tuple[Array, Steps, Flags]:
        """`settled` with flanks of their condensed stiffness."""
        # of springs and loaded flanks at the nominal pose
        springs = whole.spring_force + (flank_error[:, None] @ self.flanks)[:, 0]
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
        law, parts = whole.pin_law, (self.matrix, self.held, self.pins, whole.pin_error, force)
        stiffness = whole.pin_stiffness
        for step in range(_MOST_STEPS + 1):
            matrix, stiff, rows, errors, pull = parts
            now = x[at]
            closing = np.einsum("kdc,kdcp->kdp", now.reshape(*rows.shape[:2], 3), rows) + errors
            carried, tangent = law.pressed(closing, stiffness)
            pressed = np.einsum("kdcp,kdp->kdc", rows, carried).reshape(now.shape)
            gradient = np.einsum("kij,kj->ki", matrix, now) + pressed - pull
            moving = np.abs(gradient).max(axis=1) > tolerance
            found[at[~moving]] = True
            if step == _MOST_STEPS or not moving.any():
                break
            if moving.mean() < _FEW:
                at, now, gradient, tangent = at[moving], now[moving], gradient[moving], tangent[moving]
                stiffness = stiffness[moving]
                parts = _, stiff, rows, _, _ = tuple(part[moving] for part in parts)
            x[at] = now - _solved(_with_pins(stiff, rows, tangent), gradient)
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
            flank_stiffness=np.zeros((n, 0)),
            journal_rows=np.zeros((n, 0, 2, count)),
            driving_flanks=np.zeros((n, 0), dtype=np.bool_),
        )

    def answer(self, whole: System, closed: Closed, force: Array, more: Array) -> Array:
        """Change of the pose, (n, size), with a force on all parts, the closed pins held closed.

        `more` is what stiffens each disc besides, (n, discs, 3, 3).
        """
        matrix = _with_pins(self.matrix, self.pins, whole.pin_law.tangent(closed.pins, whole.pin_stiffness))
        matrix = with_discs(matrix, more)
        if whole.flank_law.linear:
            return self._answer(matrix, force)
        return self._answer_by_law(matrix, whole, closed, force)

    def _answer(self, matrix: Array, force: Array) -> Array:
        return self._all(_solved(matrix, self._on_discs(force)), force)

    def _answer_by_law(self, matrix: Array, whole: System, closed: Closed, force: Array) -> Array:
        """`answer` with the tangent stiffness of the loaded flanks where they are."""
        tangent = self._loaded(whole.flank_law.tangent(closed.flanks, whole.flank_stiffness))
        more, (across, own) = tangent - self._loaded(self.flank_stiffness), self._flanks_on_discs
        apart = (self._on_others(self.loaded) @ self._free(force)[..., None])[..., 0]
        right = np.concatenate([self._on_discs(force), -more * apart], axis=1)
        found, count = _solved(_joint(matrix, across, own, more), right), matrix.shape[-1]
        return self._all(found[:, :count], force - (found[:, None, count:] @ self.loaded)[:, 0])

    def _on_discs(self, force: Array) -> Array:
        return np.asarray(force[:, self.discs] + (self.carried @ force[:, self.others, None])[..., 0])

    def _all(self, discs: Array, force: Array) -> Array:
        x = np.empty_like(force)
        x[:, self.discs] = discs
        # K_rr^-1 K_rd is the transpose of K_dr K_rr^-1
        x[:, self.others] = self._free(force)
        x[:, self.others] += (discs[:, None] @ self.carried)[:, 0]
        return x


def condensed(stretch: Stretch) -> Condensed:
    """Condense the springs and loaded flanks of a gear train onto its discs.

    Parameters
    ----------
    stretch : Stretch

    Returns
    -------
    Condensed
    """
    contacts, stiff = stretch.contacts, stretch.elasticity
    layout = Layout(stretch.reducer)
    discs = slice(layout.disc[0], layout.disc[0] + 3 * stretch.reducer.discs)
    others = np.delete(np.arange(layout.size), discs)
    closing = stiff.flank_law.closing(common_flank_force(stretch.reducer, stretch.torque), stiff.flank)
    flank_stiffness = stiff.flank_law.tangent(closing, stiff.flank)
    driving = contacts.driving_flanks.reshape(-1, stretch.reducer.cranks, 2)
    flanks = (contacts.driving_flanks * flank_stiffness)[..., None] * contacts.flank_rows
    matrix = stretch.all_springs.matrix + np.swapaxes(contacts.flank_rows, 1, 2) @ flanks
    inverse = np.asarray(np.linalg.inv(matrix[:, others[:, None], others]), dtype=np.float64)
    across = matrix[:, discs, others]
    carried = -across @ inverse
    matrix = matrix[:, discs, discs] + carried @ np.swapaxes(across, 1, 2)
    return Condensed(
        discs=discs,
        others=others,
        inverse=inverse,
        carried=carried,
        matrix=matrix,
        held=held(matrix),
        pins=contacts.pins_by_disc,
        flanks=flanks,
        flank_stiffness=flank_stiffness,
        common_closing=closing,
        loaded=(driving[..., None] * contacts.flank_rows.reshape(*driving.shape, -1)).sum(axis=2),
        driving=driving,
        torque=stretch.torque,
    )


def common_flank_force(reducer: Reducer, torque: float) -> float:
    """What each loaded flank carries under a torque on the carrier without errors, N."""
    lever = reducer.sun_pitch_radius * math.cos(reducer.pressure_angle)
    return torque / (float(reducer.exact_carrier_ratio) * reducer.cranks * lever)


def _with_pins(matrix: Array, pins: Array, stiffness: Array) -> Array:
    """Stiffness of the discs with that of each pin, (n, discs, pins), that closes by its rows, (n, discs, 3, pins)."""
    return with_discs(matrix, (pins * stiffness[:, :, None]) @ np.swapaxes(pins, 2, 3))


def _joint(matrix: Array, across: Array, own: Array, more: Array) -> Array:
    """Matrix of the discs and of the forces that loaded flanks carry beside their condensed stiffness.

    Discs: matrix d + across' q; flanks: more (across d - own q) - q, `more` what their tangent stiffness is more.
    """
    lower = more[..., None]
    upper = np.concatenate([matrix, np.swapaxes(across, 1, 2)], axis=2)
    under = np.concatenate([lower * across, -lower * own - np.eye(own.shape[-1])], axis=2)
    return np.concatenate([upper, under], axis=1)


def _solved(matrix: Array, right: Array) -> Array:
    """Answers to a stack of systems that closed pins, or a trace of stiffness, make regular; else the smallest ones."""
    try:
        return np.asarray(np.linalg.solve(matrix, right[..., None])[..., 0])
    except np.linalg.LinAlgError:  # a compliance that takes off just the stiffness there is
        return np.asarray((np.linalg.pinv(matrix) @ right[..., None])[..., 0])
