r"""The equilibrium of one angle at a time, compiled.

The unknowns x are the displacements of carrier, discs and cranks (x, y, angle each) and sun (x, y), in the order of
`layout.Layout`.  A contact closes by

.. math:: p_c = J_c x + e_c ,

a pin that follows its disc's profile by :math:`p - \kappa s^2 / 2`, s its way along the profile and kappa the profile's
curvature.  It carries :math:`f_c = F_0 (k_c p_c / F_0)^n` where it is closed, n = 1 if it is linear.  A bearing of
radial clearance c carries :math:`k (|d| - c)` along the displacement d of its journal; where c is negative, a preload,
its far side carries as well.  The pose has the least energy

.. math:: E(x) = \sum_c \frac{f_c p_c}{n + 1} + \tfrac12 \sum_b k_b \langle |d_b| - c_b \rangle^2 - f \cdot x .

Newton's method with a line search finds it.  The matrix of second derivatives is factorised as L D L' within its
envelope, row by row (A. Jennings, A compact storage scheme for the solution of symmetric linear simultaneous equations,
Comput. J. 9, 1966): in this order of the parts most of it is empty.  One more solution, for a unit torque on the
output, gives the change of every contact force, by which virtual work tells every influence.

Angles do not depend on one another: `solve` may run on slices of them in several threads.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from rverror.base.arrays import Array
from rverror.base.compiled import compiled, inlined

Integers = npt.NDArray[np.intp]
Flags = npt.NDArray[np.bool_]

# where an angle's first start comes from
GIVEN, NEAR, COLD = 0, 1, 2  # the pose itself, to be told of and not solved; a pose that is likely near; nowhere

#: Of the reference force: at less, the tangent of a power law, which falls to nothing, is held, so that the matrix is
#: regular.  What closes less, below 1e-9 of 0.5 um with the default stiffness, carries nothing that counts.
_LEAST_SHARE = 1e-9
_EPSILON = 2.220446049250313e-16
#: Of stiffness times displacement: rounding in sums of which the parts cancel, 90 times the spacing of numbers.
_ROUNDING = 2e-14
#: Of a diagonal entry: what is added where the matrix may be singular, as of parts that no closed contact holds.
_TRACE = 1e-12
#: Of a diagonal entry: a pivot below it has lost all but four of its digits.
_REGULAR = 1e-12
#: Work of a whole Newton step over the tolerance, mm, below which a pose creeps along on rounding alone.  An output
#: that gives way by less than 1 mrad under its torque is then within 1e-10 rad of its place.
_CREEPING = 1e-8
_PATIENT = 40  # steps after which creeping ends
_HALVINGS = 40  # of a step, to 1e-12 of it
_TOGETHER = 64  # angles of which each but the first starts from the one before


class Problem(NamedTuple):
    """A loaded gear train at n angles; an axis of m is 1, alike at all angles, or n."""

    pin_rows: Array  # (n, discs, 3, pins): closing with x, y, angle of the disc
    profile_lever: Array  # (m, discs, pins): way along the profile with the disc's angle; 0 where nothing asks for it
    curvature: Array  # (m, discs, pins): of the curve on which a pin's centre stands, 1/mm; likewise
    mesh_normal: Array  # (n, cranks, 2, 2): flank, xy
    arms: Array  # (n, joints, 2, 2): of a bearing's two parts, xy
    parts: Integers  # (joints, 2): their first unknowns, the second below 0 for what is fixed
    envelope: Integers  # (unknowns,): first column of each row of the matrix that is not empty
    first_disc: int  # first unknown
    first_crank: int
    base_radius: float  # of the planets, mm: lever of a flank
    longest: float  # mm that a step may move anything
    pin_exponent: float
    flank_exponent: float
    share: float  # of the curvature that counts
    reference_force: float  # N
    pin_error: Array  # (n, discs, pins), mm
    slide_error: Array  # (n, discs, pins), along the profile
    flank_error: Array  # (n, 2 cranks)
    joint_error: Array  # (n, joints, 2)
    clearance: Array  # (joints,)
    pin_stiffness: Array  # (m, discs, pins), N/mm
    flank_stiffness: Array  # (m, 2 cranks)
    joint_stiffness: Array  # (m, joints)
    declared: Array  # (6,): pins, cams, carrier bores, meshes, sun support, main bearing, N/mm
    load: Array  # (n, unknowns), N and N*mm
    sense: Array  # (n,): of the carrier's motion
    output_turn: float  # turn of the output per turn of the carrier
    tolerance: float  # what may be out of balance, N and N*mm
    easy: float  # torque over that of the load at which all contacts settle easily
    most_near: int  # Newton steps from a pose that is likely near
    most_cold: int
    most_unloading: int  # at each load on the way down


class Closings(NamedTuple):
    """How far every contact has closed at n angles."""

    pins: Array  # (n, discs, pins), mm
    slides: Array  # (n, discs, pins), way along the profile, mm, where that counts or a response is told
    flanks: Array  # (n, 2 cranks)
    joints: Array  # (n, joints, 2)
    joint_force: Array  # (n, joints, 2), N


class Forces(NamedTuple):
    """What contacts carry at n angles, how stiff they are, and what is out of balance; empty where nobody asks."""

    pins: Array  # (n, discs, pins), N
    pin_tangent: Array  # N/mm
    flanks: Array  # (n, 2 cranks)
    flank_tangent: Array
    joint_tangent: Array  # (n, joints, 3): xx, xy, yy
    energy: Array  # (n,), N*mm
    gradient: Array  # (n, unknowns), N and N*mm
    unbalanced: Array  # (n,): what rounding leaves of the gradient
    matrix: Array  # (n, unknowns, unknowns): of second derivatives; empty where nobody asks for it


class Response(NamedTuple):
    """Changes at n angles per unit of output torque, the closed contacts held closed; empty where nobody asks."""

    pins: Array  # (n, discs, pins): force into the disc
    slides: Array  # (n, discs, pins): force along the profile, as the normal turns
    flanks: Array  # (n, 2 cranks)
    joints: Array  # (n, joints, 2)
    pose: Array  # (n, unknowns)
    softening: Array  # (n, 10): of the output angle, rad, in the order of `loaded_state.SOFTENING`


class _Scratch(NamedTuple):
    """State of one angle, beside its closings."""

    pin_force: Array
    pin_tangent: Array
    flank_force: Array
    flank_tangent: Array
    joint_tangent: Array
    gradient: Array
    springs: Array  # lower triangle, as the matrix
    matrix: Array
    factor: Array
    inverse: Array  # of the pivots
    step: Array
    trial: Array
    near: Array
    balance: Array  # energy, what rounding leaves of it, and of the gradient


@inlined
def _copy(source: Array, target: Array) -> None:
    for r in range(len(source)):
        target[r] = source[r]


# --- energy and its derivatives ---------------------------------------------------------------------------------------


@inlined
def pressed(closing: float, stiffness: float, exponent: float, reference: float) -> tuple[float, float]:
    """Force and tangent stiffness of a contact that only pushes.

    Parameters
    ----------
    closing : float
        mm; nothing is carried at 0 or below.
    stiffness : float
        N/mm, at the reference force.
    exponent : float
        Of the power law; 1 is linear.
    reference : float
        N.

    Returns
    -------
    force : float
        N.
    tangent : float
        N/mm.
    """
    if closing <= 0.0:
        return 0.0, 0.0
    if exponent == 1.0:
        return stiffness * closing, stiffness
    share = stiffness * closing / reference
    secant = stiffness * share ** (exponent - 1.0)
    tangent = secant if share >= _LEAST_SHARE else stiffness * _LEAST_SHARE ** (exponent - 1.0)
    return secant * closing, exponent * tangent


@inlined
def _pins(problem: Problem, i: int, x: Array, closings: Closings, s: _Scratch) -> float:
    """Energy of the pins; adds their forces to the gradient."""
    discs, count = s.pin_force.shape
    exponent, energy = problem.pin_exponent, 0.0
    for k in range(discs):
        at = problem.first_disc + 3 * k
        dx, dy, turn = x[at], x[at + 1], x[at + 2]
        row, error = problem.pin_rows[i, k], problem.pin_error[i, k]
        stiffness = problem.pin_stiffness[min(i, len(problem.pin_stiffness) - 1), k]
        closing, force, tangent = closings.pins[i, k], s.pin_force[k], s.pin_tangent[k]
        for p in range(count):
            closing[p] = row[0, p] * dx + row[1, p] * dy + row[2, p] * turn + error[p]
        c = min(i, len(problem.curvature) - 1)
        slide, lever, curvature = closings.slides[i, k], problem.profile_lever[c, k], problem.curvature[c, k]
        if problem.share > 0.0:
            along = problem.slide_error[i, k]
            for p in range(count):
                slide[p] = row[0, p] * dy - row[1, p] * dx + lever[p] * turn + along[p]
                closing[p] -= 0.5 * problem.share * curvature[p] * slide[p] * slide[p]
        if exponent == 1.0:
            for p in range(count):
                tangent[p] = stiffness[p] if closing[p] > 0.0 else 0.0
                force[p] = tangent[p] * closing[p]
        else:
            for p in range(count):
                force[p], tangent[p] = pressed(closing[p], stiffness[p], exponent, problem.reference_force)
        on_x, on_y, moment, work = 0.0, 0.0, 0.0, 0.0
        for p in range(count):
            on_x += force[p] * row[0, p]
            on_y += force[p] * row[1, p]
            moment += force[p] * row[2, p]
            work += force[p] * closing[p]
        if problem.share > 0.0:  # the force turns with the normal
            for p in range(count):
                sideways = force[p] * problem.share * curvature[p] * slide[p]
                on_x += sideways * row[1, p]
                on_y -= sideways * row[0, p]
                moment -= sideways * lever[p]
        s.gradient[at] += on_x
        s.gradient[at + 1] += on_y
        s.gradient[at + 2] += moment
        energy += work
    return energy / (exponent + 1.0)


@inlined
def _flank(problem: Problem, i: int, c: int, x: Array) -> float:
    """How far a flank closes with a pose: the sun along the normal, the planet against it and by its base circle."""
    side = c % 2
    sun, crank = len(x) - 2, problem.first_crank + 3 * (c // 2)
    nx, ny = problem.mesh_normal[i, c // 2, side, 0], problem.mesh_normal[i, c // 2, side, 1]
    lever = problem.base_radius * (1 - 2 * side)
    closing: float = nx * (x[sun] - x[crank]) + ny * (x[sun + 1] - x[crank + 1]) + lever * x[crank + 2]
    return closing


@inlined
def _push_flank(problem: Problem, i: int, c: int, force: float, gradient: Array) -> None:
    """Add what a flank's force does to its parts."""
    side = c % 2
    sun, crank = len(gradient) - 2, problem.first_crank + 3 * (c // 2)
    fx, fy = force * problem.mesh_normal[i, c // 2, side, 0], force * problem.mesh_normal[i, c // 2, side, 1]
    gradient[sun] += fx
    gradient[sun + 1] += fy
    gradient[crank] -= fx
    gradient[crank + 1] -= fy
    gradient[crank + 2] += force * problem.base_radius * (1 - 2 * side)


@inlined
def _flanks(problem: Problem, i: int, x: Array, closings: Closings, s: _Scratch) -> float:
    """Energy of the gear flanks; adds their forces to the gradient."""
    m, energy = min(i, len(problem.flank_stiffness) - 1), 0.0
    for c in range(len(s.flank_force)):
        closing = _flank(problem, i, c, x) + problem.flank_error[i, c]
        force, tangent = pressed(
            closing, problem.flank_stiffness[m, c], problem.flank_exponent, problem.reference_force
        )
        closings.flanks[i, c], s.flank_force[c], s.flank_tangent[c] = closing, force, tangent
        _push_flank(problem, i, c, force, s.gradient)
        energy += force * closing
    return energy / (problem.flank_exponent + 1.0)


@inlined
def _joint(problem: Problem, i: int, q: int, x: Array) -> tuple[float, float]:
    """How far a pose displaces a bearing's first part against its second one."""
    a, b = problem.parts[q, 0], problem.parts[q, 1]
    dx, dy = x[a], x[a + 1]
    if a + 2 < len(x):  # the sun has no angle
        dx += problem.arms[i, q, 0, 0] * x[a + 2]
        dy += problem.arms[i, q, 0, 1] * x[a + 2]
    if b >= 0:
        dx -= x[b] + problem.arms[i, q, 1, 0] * x[b + 2]
        dy -= x[b + 1] + problem.arms[i, q, 1, 1] * x[b + 2]
    return dx, dy


@inlined
def _push_joint(problem: Problem, i: int, q: int, fx: float, fy: float, gradient: Array) -> None:
    """Add what a bearing's force does to its parts."""
    a, b = problem.parts[q, 0], problem.parts[q, 1]
    gradient[a] += fx
    gradient[a + 1] += fy
    if a + 2 < len(gradient):
        gradient[a + 2] += problem.arms[i, q, 0, 0] * fx + problem.arms[i, q, 0, 1] * fy
    if b >= 0:
        gradient[b] -= fx
        gradient[b + 1] -= fy
        gradient[b + 2] -= problem.arms[i, q, 1, 0] * fx + problem.arms[i, q, 1, 1] * fy


@inlined
def bearing(dx: float, dy: float, stiffness: float, clearance: float) -> tuple[float, float, float, float, float]:
    """What a bearing does whose journal is displaced: it floats in a clearance, and a preload presses it all around.

    On the rim of its clearance a journal is stiff along its displacement, and across it as far as its force turns.
    Rollers on both sides of a preloaded bearing carry until the load lifts those behind.

    Parameters
    ----------
    dx, dy : float
        Displacement, mm.
    stiffness : float
        N/mm.
    clearance : float
        Radial, mm; below 0 a preload.

    Returns
    -------
    secant : float
        Force over displacement, N/mm.
    energy : float
        N*mm.
    xx, xy, yy : float
        Tangent stiffness, N/mm.
    """
    if clearance == 0.0:
        return stiffness, 0.5 * stiffness * (dx * dx + dy * dy), stiffness, 0.0, stiffness
    distance = math.sqrt(dx * dx + dy * dy)
    closing, behind = max(distance - clearance, 0.0), max(-clearance - distance, 0.0)
    energy = 0.5 * stiffness * (closing * closing + behind * behind)
    if behind > 0.0:
        return 2.0 * stiffness, energy, 2.0 * stiffness, 0.0, 2.0 * stiffness
    if closing == 0.0 or distance == 0.0:
        return 0.0, energy, 0.0, 0.0, 0.0
    across = stiffness * closing / distance
    ux, uy, along = dx / distance, dy / distance, stiffness - across
    return across, energy, across + along * ux * ux, along * ux * uy, across + along * uy * uy


@inlined
def _joints(problem: Problem, i: int, x: Array, closings: Closings, s: _Scratch) -> float:
    """Energy of the bearings; adds their forces to the gradient."""
    m, energy = min(i, len(problem.joint_stiffness) - 1), 0.0
    for q in range(len(problem.parts)):
        dx, dy = _joint(problem, i, q, x)
        dx += problem.joint_error[i, q, 0]
        dy += problem.joint_error[i, q, 1]
        secant, work, xx, xy, yy = bearing(dx, dy, problem.joint_stiffness[m, q], problem.clearance[q])
        closings.joints[i, q, 0], closings.joints[i, q, 1] = dx, dy
        closings.joint_force[i, q, 0], closings.joint_force[i, q, 1] = secant * dx, secant * dy
        s.joint_tangent[q, 0], s.joint_tangent[q, 1], s.joint_tangent[q, 2] = xx, xy, yy
        _push_joint(problem, i, q, secant * dx, secant * dy, s.gradient)
        energy += work
    return energy


@inlined
def _evaluate(
    problem: Problem, i: int, x: Array, load: float, rounding: float, closings: Closings, s: _Scratch
) -> None:
    """Contacts, energy and gradient of a pose.

    The load is `load` times that of the problem, `rounding` what `_spring_matrix` tells.
    """
    energy, size, far = 0.0, 0.0, 0.0
    for r in range(len(x)):
        force = load * problem.load[i, r]
        s.gradient[r] = -force
        energy -= force * x[r]
        size += abs(force * x[r])
        far = max(far, abs(x[r]))
    work = _pins(problem, i, x, closings, s) + _flanks(problem, i, x, closings, s) + _joints(problem, i, x, closings, s)
    s.balance[0] = energy + work
    s.balance[1] = rounding * far * far + 4.0 * _EPSILON * (size + work)
    s.balance[2] = rounding * far


@inlined
def _add_between(
    matrix: Array, a: int, ax: float, ay: float, b: int, bx: float, by: float, xx: float, xy: float, yy: float
) -> None:
    """Add a bearing's stiffness between two parts, or of one with itself: rows of the first, columns of the second.

    The parts' angles move the bearing by the arms (ax, ay) and (bx, by).
    """
    matrix[a, b] += xx
    matrix[a, b + 1] += xy
    matrix[a + 1, b] += xy
    matrix[a + 1, b + 1] += yy
    if a + 2 < len(matrix):
        matrix[a + 2, b] += xx * ax + xy * ay
        matrix[a + 2, b + 1] += xy * ax + yy * ay
    if b + 2 < len(matrix):
        x, y = xx * bx + xy * by, xy * bx + yy * by
        matrix[a, b + 2] += x
        matrix[a + 1, b + 2] += y
        if a + 2 < len(matrix):
            matrix[a + 2, b + 2] += ax * x + ay * y


@inlined
def _add_joint(problem: Problem, i: int, q: int, xx: float, xy: float, yy: float, matrix: Array) -> None:
    """Add a bearing's stiffness to the lower triangle."""
    a, b = problem.parts[q, 0], problem.parts[q, 1]
    ax, ay = problem.arms[i, q, 0, 0], problem.arms[i, q, 0, 1]
    bx, by = problem.arms[i, q, 1, 0], problem.arms[i, q, 1, 1]
    _add_between(matrix, a, ax, ay, a, ax, ay, xx, xy, yy)
    if b >= 0:
        _add_between(matrix, b, bx, by, b, bx, by, xx, xy, yy)
        if a > b:
            _add_between(matrix, a, ax, ay, b, bx, by, -xx, -xy, -yy)
        else:
            _add_between(matrix, b, bx, by, a, ax, ay, -xx, -xy, -yy)


@inlined
def _add_flank(problem: Problem, i: int, c: int, tangent: float, matrix: Array) -> None:
    """Add a flank's stiffness to the lower triangle; the sun comes last."""
    side = c % 2
    sun, crank = len(matrix) - 2, problem.first_crank + 3 * (c // 2)
    x, y = problem.mesh_normal[i, c // 2, side, 0], problem.mesh_normal[i, c // 2, side, 1]
    lever = problem.base_radius * (1 - 2 * side)
    xx, xy, yy, tx, ty = tangent * x * x, tangent * x * y, tangent * y * y, tangent * lever * x, tangent * lever * y
    matrix[crank, crank] += xx
    matrix[crank + 1, crank] += xy
    matrix[crank + 1, crank + 1] += yy
    matrix[crank + 2, crank] -= tx
    matrix[crank + 2, crank + 1] -= ty
    matrix[crank + 2, crank + 2] += tangent * lever * lever
    matrix[sun, crank] -= xx
    matrix[sun, crank + 1] -= xy
    matrix[sun, crank + 2] += tx
    matrix[sun, sun] += xx
    matrix[sun + 1, crank] -= xy
    matrix[sun + 1, crank + 1] -= yy
    matrix[sun + 1, crank + 2] += ty
    matrix[sun + 1, sun] += xy
    matrix[sun + 1, sun + 1] += yy


@inlined
def _spring_matrix(problem: Problem, i: int, s: _Scratch) -> float:
    """Stiffness of the bearings without clearance, and what rounding leaves of a gradient per displacement."""
    matrix, m = s.springs, min(i, len(problem.joint_stiffness) - 1)
    matrix[:] = 0.0
    for q in range(len(problem.parts)):
        if problem.clearance[q] == 0.0:
            stiffness = problem.joint_stiffness[m, q]
            _add_joint(problem, i, q, stiffness, 0.0, stiffness, matrix)
    largest = 0.0
    for r in range(len(matrix)):
        total = 0.0
        for c in range(len(matrix)):
            total += abs(matrix[r, c]) if c <= r else abs(matrix[c, r])
        largest = max(largest, total)
    return _ROUNDING * largest


@inlined
def _assemble(problem: Problem, i: int, turning: float, closings: Closings, s: _Scratch) -> None:
    """Lower triangle of the second derivative; `turning` is the share that counts of how the pins' forces turn.

    Without it the matrix has no negative part.
    """
    matrix = s.matrix
    for r in range(len(matrix)):
        for c in range(problem.envelope[r], r + 1):
            matrix[r, c] = s.springs[r, c]
    discs, count = s.pin_force.shape
    for k in range(discs):
        row, tangent, slide, force = problem.pin_rows[i, k], s.pin_tangent[k], closings.slides[i, k], s.pin_force[k]
        c = min(i, len(problem.curvature) - 1)
        lever, curvature = problem.profile_lever[c, k], problem.curvature[c, k]
        xx, yx, yy, tx, ty, tt = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        if problem.share > 0.0:
            for p in range(count):
                bend = problem.share * curvature[p]
                turned, less = bend * slide[p], turning * bend * force[p]
                x, y, t = row[0, p] + turned * row[1, p], row[1, p] - turned * row[0, p], row[2, p] - turned * lever[p]
                xx += tangent[p] * x * x - less * row[1, p] * row[1, p]
                yx += tangent[p] * y * x + less * row[0, p] * row[1, p]
                yy += tangent[p] * y * y - less * row[0, p] * row[0, p]
                tx += tangent[p] * t * x + less * lever[p] * row[1, p]
                ty += tangent[p] * t * y - less * lever[p] * row[0, p]
                tt += tangent[p] * t * t - less * lever[p] * lever[p]
        else:
            for p in range(count):
                xx += tangent[p] * row[0, p] * row[0, p]
                yx += tangent[p] * row[1, p] * row[0, p]
                yy += tangent[p] * row[1, p] * row[1, p]
                tx += tangent[p] * row[2, p] * row[0, p]
                ty += tangent[p] * row[2, p] * row[1, p]
                tt += tangent[p] * row[2, p] * row[2, p]
        at = problem.first_disc + 3 * k
        matrix[at, at] += xx
        matrix[at + 1, at] += yx
        matrix[at + 1, at + 1] += yy
        matrix[at + 2, at] += tx
        matrix[at + 2, at + 1] += ty
        matrix[at + 2, at + 2] += tt
    for c in range(len(s.flank_force)):
        if s.flank_tangent[c] > 0.0:
            _add_flank(problem, i, c, s.flank_tangent[c], matrix)
    for q in range(len(problem.parts)):
        if problem.clearance[q] != 0.0:
            _add_joint(problem, i, q, s.joint_tangent[q, 0], s.joint_tangent[q, 1], s.joint_tangent[q, 2], matrix)


# --- linear equations -------------------------------------------------------------------------------------------------


@inlined
def _factorise(envelope: Integers, matrix: Array, factor: Array, inverse: Array, trace: float) -> bool:
    """L D L' of the matrix and a share of its diagonal; whether all pivots are positive and have digits left.

    L is below the diagonal of the factor, one over D in the inverse pivots.
    """
    largest, regular = 0.0, True
    for r in range(len(matrix)):
        largest = max(largest, matrix[r, r])
    for r in range(len(matrix)):
        first = envelope[r]
        for c in range(first, r):
            entry = matrix[r, c]
            for k in range(max(first, envelope[c]), c):
                entry -= factor[r, k] * factor[c, k]
            factor[r, c] = entry
        own = max(matrix[r, r], 1e-9 * largest)  # each in its own unit
        pivot = matrix[r, r] + trace * own
        for c in range(first, r):
            entry = factor[r, c] * inverse[c]
            pivot -= factor[r, c] * entry
            factor[r, c] = entry
        if pivot <= (0.0 if trace > 0.0 else _REGULAR * own):
            regular = False
            if abs(pivot) < _TRACE * own:  # what rounding has left
                pivot = _TRACE * own
        inverse[r] = 1.0 / pivot
    return regular


@inlined
def _back_substitute(envelope: Integers, factor: Array, inverse: Array, right: Array) -> None:
    """Overwrite a right-hand side by the answer."""
    for r in range(len(right)):
        total = right[r]
        for k in range(envelope[r], r):
            total -= factor[r, k] * right[k]
        right[r] = total
    for r in range(len(right)):
        right[r] *= inverse[r]
    for r in range(len(right) - 1, -1, -1):
        total = right[r]
        for k in range(envelope[r], r):
            right[k] -= factor[r, k] * total


# --- Newton's method --------------------------------------------------------------------------------------------------


@inlined
def _hold(problem: Problem, i: int, driven: bool, closings: Closings, s: _Scratch) -> None:
    """Hold contacts closed, each by its declared stiffness: of the loaded side, or those that are closed.

    Journals are held in the middle of their clearances, or where they are closed on the rim.
    """
    discs, count = s.pin_force.shape
    for k in range(discs):
        at, m, c = (
            problem.first_disc + 3 * k,
            min(i, len(problem.pin_stiffness) - 1),
            min(i, len(problem.curvature) - 1),
        )
        for p in range(count):
            x, y, turn = problem.pin_rows[i, k, 0, p], problem.pin_rows[i, k, 1, p], problem.pin_rows[i, k, 2, p]
            on = turn * problem.sense[i] < 0.0 if driven else closings.pins[i, k, p] > 0.0
            stiffness = problem.pin_stiffness[m, k, p] if on else 0.0
            force = stiffness * closings.pins[i, k, p] - s.pin_force[k, p]
            turned = problem.share * problem.curvature[c, k, p] * closings.slides[i, k, p]
            s.gradient[at] += force * (x + turned * y)
            s.gradient[at + 1] += force * (y - turned * x)
            s.gradient[at + 2] += force * (turn - turned * problem.profile_lever[c, k, p])
            s.pin_tangent[k, p] = stiffness
    for c in range(len(s.flank_force)):
        on = (c % 2 == 0) == (problem.sense[i] > 0.0) if driven else closings.flanks[i, c] > 0.0
        stiffness = problem.flank_stiffness[min(i, len(problem.flank_stiffness) - 1), c] if on else 0.0
        _push_flank(problem, i, c, stiffness * closings.flanks[i, c] - s.flank_force[c], s.gradient)
        s.flank_tangent[c] = stiffness
    for q in range(len(problem.parts)):
        if problem.clearance[q] != 0.0:
            stiffness = problem.joint_stiffness[min(i, len(problem.joint_stiffness) - 1), q]
            dx, dy = closings.joints[i, q, 0], closings.joints[i, q, 1]
            distance = math.sqrt(dx * dx + dy * dy)
            rim = 0.0 if driven or distance == 0.0 else problem.clearance[q] / distance
            fx, fy = stiffness * (1.0 - rim) * dx, stiffness * (1.0 - rim) * dy
            fx, fy = fx - closings.joint_force[i, q, 0], fy - closings.joint_force[i, q, 1]
            _push_joint(problem, i, q, fx, fy, s.gradient)
            s.joint_tangent[q, 0], s.joint_tangent[q, 1], s.joint_tangent[q, 2] = stiffness, 0.0, stiffness


@inlined
def _newton(
    problem: Problem,
    i: int,
    x: Array,
    driven: bool,
    rim: bool,
    load: float,
    tolerance: float,
    most: int,
    rounding: float,
    closings: Closings,
    s: _Scratch,
) -> tuple[int, bool]:
    """Newton steps from a pose until the forces balance; the scratch holds the state and matrix of the last pose.

    First, if so told, it goes where the loaded side alone carries, and to where journals are on the rims of their
    clearances.  A step is halved until the energy falls below the most that the last steps had: a journal that slides
    along the curved rim of its clearance is pressed into it by each straight step, and comes out by the next one.
    Where rounding hides the fall, the slope at the end must not be as steep upwards as it was downwards.
    """
    size = len(x)
    before, work, slope, length, here, hidden = math.inf, math.inf, 0.0, 1.0, 0.0, 0.0
    last, second, third, fourth = -math.inf, -math.inf, -math.inf, -math.inf  # energies of the last steps
    steps, halvings, free = 0, 0, True
    _copy(x, s.trial)
    while True:
        _evaluate(problem, i, s.trial, load, rounding, closings, s)
        energy, unbalanced = s.balance[0], s.balance[2]
        if not free:
            ahead = 0.0
            for r in range(size):
                ahead += s.gradient[r] * s.step[r]
            falls = energy <= max(max(last, second), max(third, fourth)) + 1e-4 * length * slope
            falls = falls or (energy < here + hidden and ahead <= -0.8 * slope)
            if not falls and halvings < _HALVINGS:
                halvings += 1
                length *= 0.5
                for r in range(size):
                    s.trial[r] = x[r] + length * s.step[r]
                continue
        _copy(s.trial, x)
        free = driven or rim
        if free:
            _hold(problem, i, driven, closings, s)
            driven, rim = False, rim and driven
        turning = 0.0 if free else 1.0
        while True:
            _assemble(problem, i, turning, closings, s)
            if not free and turning == 1.0:
                left = 0.0
                for r in range(size):
                    left = max(left, abs(s.gradient[r]))
                # what is as small as rounding is let go once it shrinks no more
                moving = left > tolerance and (left > unbalanced or left < 0.5 * before)
                if not moving or not (work > _CREEPING * tolerance or steps < _PATIENT):
                    return steps, not math.isnan(energy)
                if steps == most:
                    return steps, False
                before = left
            if _factorise(problem.envelope, s.matrix, s.factor, s.inverse, _TRACE):
                break
            if problem.share == 0.0 or turning == 0.0:
                break
            turning = 0.0
        for r in range(size):
            s.step[r] = -s.gradient[r]
        _back_substitute(problem.envelope, s.factor, s.inverse, s.step)
        slope, far = 0.0, 0.0
        for r in range(size):
            slope += s.gradient[r] * s.step[r]
            far = max(far, abs(s.step[r]))
        if not free:
            steps += 1
            work, length, halvings, here, hidden = -slope, 1.0, 0, energy, s.balance[1]
            last, second, third, fourth = energy, last, second, third
            if far > problem.longest:  # farther goes only what nothing holds, some 1e10 mm by its trace of stiffness
                slope *= problem.longest / far
                for r in range(size):
                    s.step[r] *= problem.longest / far
        for r in range(size):
            s.trial[r] = x[r] + s.step[r]


@inlined
def _stages(problem: Problem, factor: float) -> int:
    """Loads on the way down, each by a factor, from one at which all contacts settle easily."""
    return max(math.ceil(math.log(problem.easy) / math.log(factor)), 0)


@inlined
def _settle(
    problem: Problem, i: int, x: Array, start: int, rounding: float, closings: Closings, s: _Scratch
) -> tuple[int, bool]:
    """Pose of least energy from one start after another: Newton steps, and whether it was found.

    0: the pose at hand, if it is likely near, or given.  1: that with the journals on the rims of their clearances.  2:
    all of the loaded side closed.  3 and 4: from a heavy load downwards, by factors of 8 and of 3.  There a journal
    slides along the rim of its clearance on next to no force: Newton steps are short there, and the place where a
    somewhat greater load put it is close.
    """
    floats = False
    for q in range(len(problem.clearance)):
        floats = floats or problem.clearance[q] > 0.0
    _copy(x, s.near)
    attempt, stage, stages, total = 2 if start == COLD else 0, 0, 0, 0
    while True:
        load = (8.0 if attempt == 3 else 3.0) ** stage
        driven = attempt >= 2 and stage == stages
        if attempt == 1:
            _copy(s.near, x)
        if driven:
            x[:] = 0.0
        most = problem.most_near if attempt < 2 else problem.most_cold if attempt == 2 else problem.most_unloading
        if start == GIVEN:
            most = 0
        tolerance = problem.tolerance * load * (1e4 if stage else 1.0)  # looser on the way down
        rim = floats and attempt >= 1
        steps, found = _newton(problem, i, x, driven, rim, load, tolerance, most, rounding, closings, s)
        total += steps
        if stage:
            stage -= 1
            continue
        if found or attempt == 4 or start == GIVEN:
            return total, found
        attempt += 1 if floats or attempt else 2
        if attempt >= 3:
            stage = stages = _stages(problem, 8.0 if attempt == 3 else 3.0)


# --- what the state tells ---------------------------------------------------------------------------------------------


@inlined
def _tell(problem: Problem, i: int, forces: Forces, s: _Scratch) -> None:
    """Write forces, stiffness and balance of one angle."""
    forces.energy[i], forces.unbalanced[i] = s.balance[0], s.balance[2]
    for k in range(len(s.pin_force)):
        _copy(s.pin_force[k], forces.pins[i, k])
        _copy(s.pin_tangent[k], forces.pin_tangent[i, k])
    _copy(s.flank_force, forces.flanks[i])
    _copy(s.flank_tangent, forces.flank_tangent[i])
    for q in range(len(s.joint_tangent)):
        _copy(s.joint_tangent[q], forces.joint_tangent[i, q])
    _copy(s.gradient, forces.gradient[i])
    for r in range(len(s.matrix) if len(forces.matrix) else 0):
        for c in range(r + 1):
            entry = s.matrix[r, c] if c >= problem.envelope[r] else 0.0
            forces.matrix[i, r, c] = entry
            forces.matrix[i, c, r] = entry


@inlined
def _answer(problem: Problem, right: Array, s: _Scratch) -> None:
    """Overwrite a force by the displacement that it makes, the closed contacts held closed."""
    left = s.step
    _copy(right, left)
    for trace in (0.0, _TRACE):
        if _factorise(problem.envelope, s.matrix, s.factor, s.inverse, trace):
            break
    right[:] = 0.0
    for refinement in range(2):  # takes off what a trace of stiffness costs, some 1e-8
        _back_substitute(problem.envelope, s.factor, s.inverse, left)
        for r in range(len(right)):
            right[r] += left[r]
        if trace == 0.0 or refinement:
            break
        # what is left of the force, which stands on the carrier alone
        left[:] = 0.0
        left[2] = -problem.output_turn
        for r in range(len(right)):
            left[r] -= s.matrix[r, r] * right[r]
            for c in range(problem.envelope[r], r):
                left[r] -= s.matrix[r, c] * right[c]
                left[c] -= s.matrix[r, c] * right[r]


@inlined
def _respond(problem: Problem, i: int, x: Array, closings: Closings, response: Response, s: _Scratch) -> None:
    """Write the changes of one angle per unit of output torque.

    A contact that gives way by dp more under the force that it carries opens by dp: the output moves by -lambda dp,
    lambda the change of its force per unit of output torque.
    """
    pose, softening = response.pose[i], response.softening[i]
    pose[:] = 0.0
    pose[2] = -problem.output_turn  # on the carrier
    _answer(problem, pose, s)
    softening[:] = 0.0
    _respond_pins(problem, i, x, closings, response, s)
    m = min(i, len(problem.flank_stiffness) - 1)
    for c in range(len(s.flank_force)):
        change, closing = s.flank_tangent[c] * _flank(problem, i, c, pose), closings.flanks[i, c]
        response.flanks[i, c] = change
        if closing > 0.0:
            linear = problem.flank_stiffness[m, c] * closing
            softening[3] -= change * linear / problem.declared[3]
            softening[6] -= change / 2.0  # half of the backlash is on each side
            softening[8] += change * closing * math.log(linear / problem.reference_force) / problem.flank_exponent
    joints = len(problem.parts)
    cams = joints - 2 - len(s.flank_force) // 2
    for q in range(joints):
        dx, dy = _joint(problem, i, q, pose)
        fx = s.joint_tangent[q, 0] * dx + s.joint_tangent[q, 1] * dy
        fy = s.joint_tangent[q, 1] * dx + s.joint_tangent[q, 2] * dy
        response.joints[i, q, 0], response.joints[i, q, 1] = fx, fy
        work = fx * closings.joint_force[i, q, 0] + fy * closings.joint_force[i, q, 1]
        if problem.clearance[q] < 0.0:
            dx, dy = closings.joints[i, q, 0], closings.joints[i, q, 1]
            if math.sqrt(dx * dx + dy * dy) < -problem.clearance[q]:
                work /= 2.0  # rollers on both sides give way half as far
        kind = 1 if q < cams else 2 if q < joints - 2 else 5 if q == joints - 2 else 4
        softening[kind] -= work / problem.declared[kind]


@inlined
def _respond_pins(problem: Problem, i: int, x: Array, closings: Closings, response: Response, s: _Scratch) -> None:
    """The pins' part of `_respond`."""
    discs, count = s.pin_force.shape
    pose, yielded, by_exponent, by_curvature = response.pose[i], 0.0, 0.0, 0.0
    for k in range(discs):
        at, m = problem.first_disc + 3 * k, min(i, len(problem.pin_stiffness) - 1)
        dx, dy, turn = pose[at], pose[at + 1], pose[at + 2]
        row, lever, curvature = problem.pin_rows[i, k], problem.profile_lever[i, k], problem.curvature[i, k]
        tangent, change = s.pin_tangent[k], response.pins[i, k]
        slide, along = closings.slides[i, k], response.slides[i, k]
        for p in range(count):
            change[p] = tangent[p] * (row[0, p] * dx + row[1, p] * dy + row[2, p] * turn)
            along[p] = row[0, p] * dy - row[1, p] * dx + lever[p] * turn
        if problem.share > 0.0:
            for p in range(count):
                change[p] -= tangent[p] * problem.share * curvature[p] * slide[p] * along[p]
        else:
            error = problem.slide_error[i, k]
            for p in range(count):
                slide[p] = row[0, p] * x[at + 1] - row[1, p] * x[at] + lever[p] * x[at + 2] + error[p]
        force = s.pin_force[k]
        for p in range(count):
            by_curvature += curvature[p] * slide[p] * (0.5 * change[p] * slide[p] + force[p] * along[p])
        for p in range(count):
            along[p] = -problem.share * curvature[p] * (slide[p] * change[p] + force[p] * along[p])
        stiffness, closing = problem.pin_stiffness[m, k], closings.pins[i, k]
        for p in range(count):
            if closing[p] > 0.0:
                linear = stiffness[p] * closing[p]
                yielded += change[p] * linear
                by_exponent += change[p] * closing[p] * math.log(linear / problem.reference_force)
    softening = response.softening[i]
    softening[0] = -yielded / problem.declared[0]
    softening[7] = by_exponent / problem.pin_exponent
    softening[9] = -by_curvature


# --- many angles ------------------------------------------------------------------------------------------------------


def scratch(problem: Problem) -> _Scratch:
    """Memory for the state of one angle, which `solve` needs for itself.

    Parameters
    ----------
    problem : Problem

    Returns
    -------
    tuple of ndarray
    """
    discs, pins = problem.pin_rows.shape[1], problem.pin_rows.shape[3]
    flanks, joints, size = problem.flank_error.shape[1], len(problem.parts), len(problem.envelope)
    return _Scratch(
        np.empty((discs, pins)),
        np.empty((discs, pins)),
        np.empty(flanks),
        np.empty(flanks),
        np.empty((joints, 3)),
        np.empty(size),
        np.empty((size, size)),
        np.empty((size, size)),
        np.empty((size, size)),
        np.empty(size),
        np.empty(size),
        np.empty(size),
        np.empty(size),
        np.empty(3),
    )


@compiled
def solve(
    problem: Problem,
    x: Array,
    start: int,
    steps: Integers,
    found: Flags,
    closings: Closings,
    forces: Forces,
    response: Response,
    s: _Scratch,
) -> None:
    """Find the poses of least energy, and tell of the contacts there.

    Parameters
    ----------
    problem : Problem
    x : ndarray, shape (n, unknowns)
        Poses, mm and rad; overwritten unless they are given.
    start : int
        `GIVEN`, `NEAR` or `COLD`.
    steps : ndarray of int, shape (n,)
        Overwritten: Newton steps of each angle.
    found : ndarray of bool, shape (n,)
        Overwritten: whether the forces balance.
    closings : Closings
        Overwritten.
    forces : Forces
        Overwritten, unless empty.
    response : Response
        Overwritten, unless empty.
    """
    for i in range(len(x)):
        rounding = _spring_matrix(problem, i, s)
        first = start
        if start == COLD and i % _TOGETHER and found[i - 1]:
            _copy(x[i - 1], x[i])
            first = NEAR
        steps[i], found[i] = _settle(problem, i, x[i], first, rounding, closings, s)
        if len(forces.energy):
            _tell(problem, i, forces, s)
        if len(response.pose):
            _respond(problem, i, x[i], closings, response, s)
