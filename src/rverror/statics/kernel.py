r"""The equilibrium of one angle at a time, compiled.

The unknowns x are the displacements of carrier, discs and cranks (x, y, angle each) and sun (x, y), in the order of
`energy.Layout`.  A contact closes by

.. math:: p_c = J_c x + e_c ,

a pin that follows its disc's profile by :math:`p - \kappa s^2 / 2`, s its way along the profile and kappa the profile's
curvature.  The row J_c of a pin holds x, y and angle of its disc; the rows of a flank and of x and y of a bearing hold
a few unknowns each, whose columns are listed.  A contact carries :math:`f_c = F_0 (k_c p_c / F_0)^n` where it is
closed, n = 1 if it is linear.  A bearing of radial clearance c carries :math:`k (|d| - c)` along the displacement d of
its journal; where c is negative, a preload, its far side carries as well.  The pose has the least energy

.. math:: E(x) = \sum_c \frac{f_c p_c}{n + 1} + \tfrac12 \sum_b k_b \langle |d_b| - c_b \rangle^2 - f \cdot x .

Newton's method with a line search finds it.  The matrix of second derivatives is factorised as L D L' within its
envelope, row by row (A. Jennings, A compact storage scheme for the solution of symmetric linear simultaneous equations,
Comput. J. 9, 1966): in this order of the parts most of it is empty.  One more solution, for a unit torque on the
output, gives the change of every contact force, by which virtual work tells every influence.

Angles do not depend on one another: `solve` may run on parts of them in several threads.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rverror.base.arrays import Array, Flags, Integers
from rverror.base.compiled import compiled, inlined

# where an angle's first start comes from
GIVEN, NEAR, COLD = 0, 1, 2  # poses that are not to be solved; poses that are likely near; nothing

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
#: Angles of which each but the first starts from the one before; a thread has whole blocks of them, so that poses do
#: not depend on how many there are.
BLOCK = 64
_FIRST_DISC = 3  # its first unknown
# contacts as they are, or held closed, each by its declared stiffness: those that are closed, all of the loaded side
_FREE, _CLOSED, _DRIVEN = 0, 1, 2
#: Places in `loaded_state.SOFTENING`; those of rows are in the problem.
_PIN_CONTACT, _BACKLASH, _PIN_EXPONENT, _FLANK_EXPONENT, _CURVATURE = 0, 6, 7, 8, 9


class Problem(NamedTuple):
    """A loaded gear train at n angles; an axis of m is 1, alike at all angles, or n.

    Its rows are those of the gear flanks, two for each crank, and two of each bearing: cams (disc by crank), carrier
    bores, main bearing, sun support.
    """

    pin_rows: Array  # (n, discs, 3, pins): closing with x, y, angle of the disc
    profile_lever: Array  # (m, discs, pins): way along the profile with the disc's angle; 0 where nothing asks for it
    curvature: Array  # (m, discs, pins): of the curve on which a pin's centre stands, 1/mm; likewise
    rows: Array  # (n, rows, width)
    columns: Integers  # (rows, width): unknowns of their entries, the last ones first
    envelope: Integers  # (unknowns,): first column of each row of the matrix that is not empty
    pin_error: Array  # (n, discs, pins), mm
    slide_error: Array  # (n, discs, pins), along the profile
    row_error: Array  # (n, rows)
    clearance: Array  # (bearings,), mm; below 0 a preload
    pin_stiffness: Array  # (m, discs, pins), N/mm
    row_stiffness: Array  # (m, rows)
    kind: Integers  # (rows,): of `loaded_state.SOFTENING`
    declared: Array  # (6,): stiffness of each of these kinds
    pin_exponent: float
    flank_exponent: float
    reference_force: float  # N
    share: float  # of the curvature that counts
    load: Array  # (n, unknowns), N and N*mm
    sense: Array  # (n,): of the carrier's motion that the load resists
    push: Array  # (unknowns,): load per unit of which changes are asked for
    longest: float  # mm that a step may move anything
    tolerance: Array  # (m,): what may be out of balance, N and N*mm
    heavy: Array  # (m,): a load at which all contacts settle easily, over the problem's
    most: tuple[int, int, int]  # Newton steps from a pose that is likely near; from none; at each load on the way down


class Solution(NamedTuple):
    """What is found at n angles; the matrix, the changes, and ways along profiles that do not count, may be empty."""

    x: Array  # (n, unknowns): poses, mm and rad
    steps: Integers  # (n,): Newton steps
    found: Flags  # (n,): whether the forces balance
    pins: Array  # (n, discs, pins): closing, mm
    slides: Array  # (n, discs, pins): way along the profile, mm
    rows: Array  # (n, rows): closing, mm
    pin_force: Array  # (n, discs, pins), N
    row_force: Array  # (n, rows), N
    pin_tangent: Array  # (n, discs, pins), N/mm
    row_tangent: Array  # (n, rows)
    coupling: Array  # (n, bearings): tangent stiffness of one component with the other
    energy: Array  # (n,), N*mm
    gradient: Array  # (n, unknowns), N and N*mm
    unbalanced: Array  # (n,): what rounding leaves of the gradient
    # second derivative of the energy
    matrix: Array  # (n, unknowns, unknowns)
    # changes per unit of the push, the closed contacts held closed
    pin_change: Array  # (n, discs, pins): of the force into the disc
    slide_change: Array  # (n, discs, pins): of the force along the profile, as the normal turns
    row_change: Array  # (n, rows)
    pose_change: Array  # (n, unknowns)
    softening: Array  # (n, 10): of the output angle, rad, per unit of each of `loaded_state.SOFTENING`


class _Scratch(NamedTuple):
    """State of one angle, beside what the solution holds."""

    turned: Array  # rows of the pins with the normals of where they have moved to, if these turn
    less: Array  # stiffness of a disc's pins that the turning of their forces takes off, below 0
    springs: Array  # lower triangle, as the matrix
    matrix: Array
    factor: Array
    inverse: Array  # of the pivots
    step: Array
    trial: Array
    near: Array
    balance: Array  # energy, what rounding leaves of it, and of the gradient, and of that per displacement


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
def _pins(problem: Problem, i: int, x: Array, hold: int, solution: Solution, s: _Scratch) -> float:
    """Energy of the pins; adds their forces to the gradient."""
    discs, count = problem.pin_error.shape[1:]
    exponent, energy, gradient = problem.pin_exponent, 0.0, solution.gradient[i]
    c, m = min(i, len(problem.curvature) - 1), min(i, len(problem.pin_stiffness) - 1)
    for k in range(discs):
        at = _FIRST_DISC + 3 * k
        dx, dy, turn = x[at], x[at + 1], x[at + 2]
        row, error, stiffness = problem.pin_rows[i, k], problem.pin_error[i, k], problem.pin_stiffness[m, k]
        closing, force, tangent = solution.pins[i, k], solution.pin_force[i, k], solution.pin_tangent[i, k]
        for p in range(count):
            closing[p] = row[0, p] * dx + row[1, p] * dy + row[2, p] * turn + error[p]
        if problem.share > 0.0:
            slide, along, now = solution.slides[i, k], problem.slide_error[i, k], s.turned[k]
            lever, curvature = problem.profile_lever[c, k], problem.curvature[c, k]
            for p in range(count):
                slide[p] = row[0, p] * dy - row[1, p] * dx + lever[p] * turn + along[p]
                turned = problem.share * curvature[p] * slide[p]
                closing[p] -= 0.5 * turned * slide[p]
                now[0, p] = row[0, p] + turned * row[1, p]
                now[1, p] = row[1, p] - turned * row[0, p]
                now[2, p] = row[2, p] - turned * lever[p]
        if hold == _FREE and exponent != 1.0:
            for p in range(count):
                force[p], tangent[p] = pressed(closing[p], stiffness[p], exponent, problem.reference_force)
        else:
            for p in range(count):
                on = row[2, p] * problem.sense[i] < 0.0 if hold == _DRIVEN else closing[p] > 0.0
                tangent[p] = stiffness[p] if on else 0.0
                force[p] = tangent[p] * closing[p]
        row = s.turned[k] if problem.share > 0.0 else row
        on_x, on_y, moment, work = 0.0, 0.0, 0.0, 0.0
        for p in range(count):
            on_x += force[p] * row[0, p]
            on_y += force[p] * row[1, p]
            moment += force[p] * row[2, p]
            work += force[p] * closing[p]
        gradient[at] += on_x
        gradient[at + 1] += on_y
        gradient[at + 2] += moment
        energy += work
    return energy / (exponent + 1.0)


@inlined
def _closing(problem: Problem, i: int, r: int, x: Array) -> float:
    """How far a row closes with a pose."""
    closing = 0.0
    for w in range(problem.columns.shape[1]):
        closing += problem.rows[i, r, w] * x[problem.columns[r, w]]
    return closing


@inlined
def _others(problem: Problem, i: int, x: Array, hold: int, solution: Solution) -> float:
    """Energy of gear flanks and bearings; adds their forces to the gradient."""
    closing, force, tangent = solution.rows[i], solution.row_force[i], solution.row_tangent[i]
    flanks, m, energy = len(closing) - 2 * len(problem.clearance), min(i, len(problem.row_stiffness) - 1), 0.0
    exponent, reference, stiffness = problem.flank_exponent, problem.reference_force, problem.row_stiffness[m]
    for r in range(len(closing)):
        closing[r] = problem.row_error[i, r] + _closing(problem, i, r, x)
    for r in range(flanks):
        if hold == _FREE:
            force[r], tangent[r] = pressed(closing[r], stiffness[r], exponent, reference)
        else:
            on = (r % 2 == 0) == (problem.sense[i] > 0.0) if hold == _DRIVEN else closing[r] > 0.0
            tangent[r] = stiffness[r] if on else 0.0
            force[r] = tangent[r] * closing[r]
        energy += force[r] * closing[r] / (exponent + 1.0)
    for q in range(len(problem.clearance)):
        r, clearance = flanks + 2 * q, problem.clearance[q]
        secant, work, xx, xy, yy = bearing(closing[r], closing[r + 1], stiffness[r], clearance)
        if hold != _FREE:  # in the middle of its clearance, or where it is closed on the rim
            distance = math.sqrt(closing[r] ** 2 + closing[r + 1] ** 2)
            rim = 0.0 if hold == _DRIVEN or distance == 0.0 else clearance / distance
            secant, xx, xy, yy = stiffness[r] * (1.0 - rim), stiffness[r], 0.0, stiffness[r]
        force[r], force[r + 1] = secant * closing[r], secant * closing[r + 1]
        tangent[r], tangent[r + 1], solution.coupling[i, q] = xx, yy, xy
        energy += work
    for r in range(len(closing)):
        for w in range(problem.columns.shape[1]):
            solution.gradient[i, problem.columns[r, w]] += problem.rows[i, r, w] * force[r]
    return energy


@inlined
def _evaluate(problem: Problem, i: int, x: Array, hold: int, load: float, solution: Solution, s: _Scratch) -> None:
    """Contacts, energy and gradient of a pose; the load is `load` times that of the problem."""
    energy, size, far = 0.0, 0.0, 0.0
    for r in range(len(x)):
        force = load * problem.load[i, r]
        solution.gradient[i, r] = -force
        energy -= force * x[r]
        size += abs(force * x[r])
        far = max(far, abs(x[r]))
    work = _pins(problem, i, x, hold, solution, s) + _others(problem, i, x, hold, solution)
    s.balance[0] = energy + work
    s.balance[1] = s.balance[3] * far * far + 4.0 * _EPSILON * (size + work)
    s.balance[2] = s.balance[3] * far


@inlined
def _add(problem: Problem, i: int, r: int, q: int, stiffness: float, matrix: Array) -> None:
    """Add the lower triangle of a stiffness between two rows, of which only the first stands on the left."""
    for w in range(problem.columns.shape[1]):
        a, force = problem.columns[r, w], stiffness * problem.rows[i, r, w]
        for v in range(w if r == q else 0, problem.columns.shape[1]):
            b = problem.columns[q, v]
            if a >= b:
                matrix[a, b] += force * problem.rows[i, q, v]


@inlined
def _add_pins(stiffness: Array, x: Array, y: Array, t: Array, sign: float, matrix: Array, at: int) -> None:
    """Add the lower triangle of stiffness along the rows (sign x, y, t) of a disc's pins."""
    xx, yx, yy, tx, ty, tt = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for p in range(len(stiffness)):
        xx += stiffness[p] * x[p] * x[p]
        yx += stiffness[p] * y[p] * x[p]
        yy += stiffness[p] * y[p] * y[p]
        tx += stiffness[p] * t[p] * x[p]
        ty += stiffness[p] * t[p] * y[p]
        tt += stiffness[p] * t[p] * t[p]
    matrix[at, at] += xx
    matrix[at + 1, at] += sign * yx
    matrix[at + 1, at + 1] += yy
    matrix[at + 2, at] += sign * tx
    matrix[at + 2, at + 1] += ty
    matrix[at + 2, at + 2] += tt


@inlined
def _assemble_springs(problem: Problem, i: int, s: _Scratch) -> None:
    """Stiffness of the bearings without clearance, and what rounding leaves of a gradient per displacement."""
    m, flanks = min(i, len(problem.row_stiffness) - 1), len(problem.columns) - 2 * len(problem.clearance)
    s.springs[:] = 0.0
    for r in range(flanks, len(problem.columns)):
        if problem.clearance[(r - flanks) // 2] == 0.0:
            _add(problem, i, r, r, problem.row_stiffness[m, r], s.springs)
    largest = 0.0
    for r in range(len(s.springs)):
        total = 0.0
        for c in range(len(s.springs)):
            total += abs(s.springs[max(r, c), min(r, c)])
        largest = max(largest, total)
    s.balance[3] = _ROUNDING * largest


@inlined
def _assemble(problem: Problem, i: int, turning: float, solution: Solution, s: _Scratch) -> None:
    """Lower triangle of the second derivative; `turning` is the share that counts of how the pins' forces turn.

    Without it the matrix has no negative part.
    """
    matrix, c = s.matrix, min(i, len(problem.curvature) - 1)
    for a in range(len(matrix)):
        for b in range(problem.envelope[a], a + 1):
            matrix[a, b] = s.springs[a, b]
    for k in range(problem.pin_error.shape[1]):
        row, tangent = s.turned[k] if problem.share > 0.0 else problem.pin_rows[i, k], solution.pin_tangent[i, k]
        _add_pins(tangent, row[0], row[1], row[2], 1.0, matrix, _FIRST_DISC + 3 * k)
        if problem.share > 0.0 and turning > 0.0:
            row, force, curvature = problem.pin_rows[i, k], solution.pin_force[i, k], problem.curvature[c, k]
            for p in range(len(force)):
                s.less[p] = -turning * problem.share * curvature[p] * force[p]
            _add_pins(s.less, row[1], row[0], problem.profile_lever[c, k], -1.0, matrix, _FIRST_DISC + 3 * k)
    tangent, flanks = solution.row_tangent[i], len(problem.columns) - 2 * len(problem.clearance)
    for r in range(len(tangent)):
        q = (r - flanks) // 2
        if tangent[r] > 0.0 and (q < 0 or problem.clearance[q] != 0.0):
            _add(problem, i, r, r, tangent[r], matrix)
            if q >= 0 and solution.coupling[i, q] != 0.0:
                _add(problem, i, r, r + 1 - 2 * ((r - flanks) % 2), solution.coupling[i, q], matrix)


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
def _newton(
    problem: Problem, i: int, x: Array, hold: int, rim: bool, load: float, tolerance: float, most: int,
    solution: Solution, s: _Scratch,
) -> tuple[int, bool]:  # fmt: skip
    """Newton steps from a pose until the forces balance; the scratch holds the matrix of the last pose.

    First, if so asked, it goes where the loaded side alone carries, and to where journals are on the rims of their
    clearances.  A step is halved until the energy falls below the most that the last steps had: a journal that slides
    along the curved rim of its clearance is pressed into it by each straight step, and comes out by the next one.
    Where rounding hides the fall, the slope at the end must not be as steep upwards as it was downwards.
    """
    size, gradient = len(x), solution.gradient[i]
    before, work, slope, length, here, hidden = math.inf, math.inf, 0.0, 1.0, 0.0, 0.0
    last, second, third, fourth = -math.inf, -math.inf, -math.inf, -math.inf  # energies of the last steps
    steps, halvings, judged = 0, 0, False
    _copy(x, s.trial)
    while True:
        _evaluate(problem, i, s.trial, hold, load, solution, s)
        energy, unbalanced = s.balance[0], s.balance[2]
        if judged:
            ahead = 0.0
            for r in range(size):
                ahead += gradient[r] * s.step[r]
            falls = energy <= max(max(last, second), max(third, fourth)) + 1e-4 * length * slope
            falls = falls or (energy < here + hidden and ahead <= -0.8 * slope)
            if not falls and halvings < _HALVINGS:
                halvings += 1
                length *= 0.5
                for r in range(size):
                    s.trial[r] = x[r] + length * s.step[r]
                continue
        _copy(s.trial, x)
        judged = hold == _FREE
        turning = 1.0 if judged else 0.0
        while True:
            _assemble(problem, i, turning, solution, s)
            if turning == 1.0:
                left = 0.0
                for r in range(size):
                    left = max(left, abs(gradient[r]))
                # what is as small as rounding is let go once it shrinks no more
                moving = left > tolerance and (left > unbalanced or left < 0.5 * before)
                if not moving or not (work > _CREEPING * tolerance or steps < _PATIENT):
                    return steps, not math.isnan(energy)
                if steps == most:
                    return steps, False
                before = left
            regular = _factorise(problem.envelope, s.matrix, s.factor, s.inverse, _TRACE)
            if regular or problem.share == 0.0 or turning == 0.0:
                break
            turning = 0.0
        for r in range(size):
            s.step[r] = -gradient[r]
        _back_substitute(problem.envelope, s.factor, s.inverse, s.step)
        slope, far = 0.0, 0.0
        for r in range(size):
            slope += gradient[r] * s.step[r]
            far = max(far, abs(s.step[r]))
        if judged:
            steps += 1
            work, length, halvings, here, hidden = -slope, 1.0, 0, energy, s.balance[1]
            last, second, third, fourth = energy, last, second, third
            if far > problem.longest:  # farther goes only what nothing holds, some 1e10 mm by its trace of stiffness
                slope *= problem.longest / far
                for r in range(size):
                    s.step[r] *= problem.longest / far
        for r in range(size):
            s.trial[r] = x[r] + s.step[r]
        hold = _CLOSED if hold == _DRIVEN and rim else _FREE


@inlined
def _settle(problem: Problem, i: int, x: Array, start: int, solution: Solution, s: _Scratch) -> tuple[int, bool]:
    """Pose of least energy from one start after another: Newton steps, and whether it was found.

    0: the pose at hand, if it is likely near, or given.  1: that with the journals on the rims of their clearances.  2:
    all of the loaded side closed.  3 and 4: from a heavy load downwards, by factors of 8 and of 3.  There a journal
    slides along the rim of its clearance on next to no force: Newton steps are short there, and the place where a
    somewhat greater load put it is close.
    """
    floats, m = False, min(i, len(problem.tolerance) - 1)
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
        most = 0 if start == GIVEN else problem.most[min(max(attempt - 1, 0), 2)]
        tolerance = problem.tolerance[m] * load * (1e4 if stage else 1.0)  # looser on the way down
        rim = floats and attempt >= 1
        hold = _DRIVEN if driven else _CLOSED if rim else _FREE
        steps, found = _newton(problem, i, x, hold, rim, load, tolerance, most, solution, s)
        total += steps
        if stage:
            stage -= 1
            continue
        if found or attempt == 4 or start == GIVEN:
            return total, found
        attempt += 1 if floats or attempt else 2
        if attempt >= 3:  # stages on the way down, from a load at which all contacts settle easily
            stage = stages = max(math.ceil(math.log(problem.heavy[m]) / math.log(8.0 if attempt == 3 else 3.0)), 0)


# --- forces and changes -----------------------------------------------------------------------------------------------


@inlined
def _answer(problem: Problem, pose: Array, s: _Scratch) -> None:
    """Displacement by less than a unit of the push, the closed contacts held closed."""
    left = s.step
    for trace in (0.0, _TRACE):
        if _factorise(problem.envelope, s.matrix, s.factor, s.inverse, trace):
            break
    pose[:] = 0.0
    for refinement in range(2):
        for a in range(len(pose)):  # what is left of the push
            left[a] = -problem.push[a]
        for a in range(len(pose) if refinement else 0):
            left[a] -= s.matrix[a, a] * pose[a]
            for b in range(problem.envelope[a], a):
                left[a] -= s.matrix[a, b] * pose[b]
                left[b] -= s.matrix[a, b] * pose[a]
        _back_substitute(problem.envelope, s.factor, s.inverse, left)
        for a in range(len(pose)):
            pose[a] += left[a]
        if trace == 0.0:  # else the second round takes off what it costs, some 1e-8
            break


@inlined
def _write_changes(problem: Problem, i: int, solution: Solution, s: _Scratch) -> None:
    """Write the changes of one angle per unit of the push, and of the output angle where that is a torque on it.

    A contact that gives way by dp more under the force that it carries opens by dp: the output moves by -lambda dp,
    lambda the change of its force per unit of output torque.
    """
    pose, softening, closing = solution.pose_change[i], solution.softening[i], solution.rows[i]
    change, tangent, coupling = solution.row_change[i], solution.row_tangent[i], solution.coupling[i]
    _answer(problem, pose, s)
    softening[:] = 0.0
    _write_pin_changes(problem, i, solution, s)
    for r in range(len(change)):
        change[r] = _closing(problem, i, r, pose)
    flanks, m = len(change) - 2 * len(problem.clearance), min(i, len(problem.row_stiffness) - 1)
    for r in range(flanks):
        change[r] *= tangent[r]
        if closing[r] > 0.0:
            kind, linear = problem.kind[r], problem.row_stiffness[m, r] * closing[r]
            softening[kind] -= change[r] * linear / problem.declared[kind]
            softening[_BACKLASH] -= change[r] / 2.0  # half of it is on each side
            shut = change[r] * closing[r] * math.log(linear / problem.reference_force)
            softening[_FLANK_EXPONENT] += shut / problem.flank_exponent
    for q in range(len(problem.clearance)):
        r, kind = flanks + 2 * q, problem.kind[flanks + 2 * q]
        dx, dy = change[r], change[r + 1]
        change[r] = tangent[r] * dx + coupling[q] * dy
        change[r + 1] = coupling[q] * dx + tangent[r + 1] * dy
        work = change[r] * solution.row_force[i, r] + change[r + 1] * solution.row_force[i, r + 1]
        if problem.clearance[q] < 0.0 and closing[r] ** 2 + closing[r + 1] ** 2 < problem.clearance[q] ** 2:
            work /= 2.0  # rollers on both sides give way half as far
        softening[kind] -= work / problem.declared[kind]


@inlined
def _write_pin_changes(problem: Problem, i: int, solution: Solution, s: _Scratch) -> None:
    """The pins' part of `_write_changes`."""
    x, pose, softening = solution.x[i], solution.pose_change[i], solution.softening[i]
    c, m = min(i, len(problem.curvature) - 1), min(i, len(problem.pin_stiffness) - 1)
    yielded, by_exponent, by_curvature = 0.0, 0.0, 0.0
    for k in range(problem.pin_error.shape[1]):
        at = _FIRST_DISC + 3 * k
        dx, dy, turn = pose[at], pose[at + 1], pose[at + 2]
        row = s.turned[k] if problem.share > 0.0 else problem.pin_rows[i, k]
        lever, curvature = problem.profile_lever[c, k], problem.curvature[c, k]
        force, tangent, change = solution.pin_force[i, k], solution.pin_tangent[i, k], solution.pin_change[i, k]
        slide, along = s.turned[k, 0], s.turned[k, 1]  # free where no normal turns
        if problem.share > 0.0:
            slide, along = solution.slides[i, k], solution.slide_change[i, k]
        for p in range(len(change)):
            change[p] = tangent[p] * (row[0, p] * dx + row[1, p] * dy + row[2, p] * turn)
        row, error = problem.pin_rows[i, k], problem.slide_error[i, k]
        for p in range(len(change)):
            along[p] = row[0, p] * dy - row[1, p] * dx + lever[p] * turn
            slide[p] = row[0, p] * x[at + 1] - row[1, p] * x[at] + lever[p] * x[at + 2] + error[p]
            by_curvature += curvature[p] * slide[p] * (0.5 * change[p] * slide[p] + force[p] * along[p])
        if problem.share > 0.0:
            for p in range(len(change)):
                along[p] = -problem.share * curvature[p] * (slide[p] * change[p] + force[p] * along[p])
        stiffness, closing = problem.pin_stiffness[m, k], solution.pins[i, k]
        for p in range(len(change)):
            if closing[p] > 0.0:
                linear = stiffness[p] * closing[p]
                yielded += change[p] * linear
                by_exponent += change[p] * closing[p] * math.log(linear / problem.reference_force)
    softening[_PIN_CONTACT] = -yielded / problem.declared[_PIN_CONTACT]
    softening[_PIN_EXPONENT] = by_exponent / problem.pin_exponent
    softening[_CURVATURE] = -by_curvature


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
    size = len(problem.envelope)
    square = (size, size)
    shapes = (problem.pin_rows.shape[1:], problem.pin_rows.shape[3], square, square, square, size, size, size, size, 4)
    return _Scratch(*(np.empty(shape) for shape in shapes))


@compiled
def solve(problem: Problem, start: int, first: int, last: int, solution: Solution, s: _Scratch) -> None:
    """Find the poses of least energy, and the state of the contacts there.

    Parameters
    ----------
    problem : Problem
    start : int
        `GIVEN`, `NEAR` or `COLD`: what the poses are before.
    first, last : int
        At which angles; the first of them begins a block.
    solution : Solution
        Overwritten there, but for poses that are given, and groups that are empty.
    s : tuple of ndarray
        From `scratch`; overwritten.
    """
    for i in range(first, last):
        _assemble_springs(problem, i, s)
        begin = start
        if start == COLD and i % BLOCK and solution.found[i - 1]:
            _copy(solution.x[i - 1], solution.x[i])
            begin = NEAR
        solution.steps[i], solution.found[i] = _settle(problem, i, solution.x[i], begin, solution, s)
        solution.energy[i], solution.unbalanced[i] = s.balance[0], s.balance[2]
        for a in range(len(s.matrix) if len(solution.matrix) else 0):
            for b in range(a + 1):
                entry = s.matrix[a, b] if b >= problem.envelope[a] else 0.0
                solution.matrix[i, a, b], solution.matrix[i, b, a] = entry, entry
        if len(solution.pose_change):
            _write_changes(problem, i, solution, s)
