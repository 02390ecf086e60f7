"""Least energy of the gear train at one angle after another: damped Newton steps on a convex function, compiled.

The second derivative is an arrow: blocks of discs, sun and carrier on the diagonal, each coupled to the cranks alone.
With block B, its coupling C and the cranks' own matrix D a step solves (D - sum C' B^-1 C) y = .., then each block.
Along a step all closings are linear, so the energy's slope is found from them alone; a step whose slope at its end is
not small against that at its start is shortened (or stretched) to where it is, which a convex function always has.
"""

from __future__ import annotations

import numpy as np
from benchmarks.load_trial.kernel import add_bearing, inner

STEPS = 60  # at most, from a near pose
HEAVY, DOWN = 256.0, 400  # without one: down from so many times the load by halves, with so many steps at each
BALANCE = 1e-9  # force or moment left, of load / crank circle


@inner
def cholesky(m, n):
    """Put the lower factor of m, whose upper half is given, in its lower half; False where m is not positive."""
    for c in range(n):
        pivot = m[c, c]
        for q in range(c):
            pivot -= m[c, q] * m[c, q]
        if not pivot > 1e-10 * abs(m[c, c]) + 1e-9:
            return False
        m[c, c] = np.sqrt(pivot)
        inverse = 1 / m[c, c]
        for r in range(c + 1, n):
            value = m[c, r]
            for q in range(c):
                value -= m[r, q] * m[c, q]
            m[r, c] = value * inverse
    return True


@inner
def assemble(t, x, pin, flank, eps, radial, cam, bore, clearance, load, g, blocks, coupling, crank):
    """Gradient g and second derivative (upper halves) of the energy at x."""
    nd, nc, a, rc = t.discs, t.cranks, t.eccentricity, t.crank_circle
    sun, carrier, first = 3 * nd, 3 * nd + 2, 3 * nd + 5
    g[:] = 0.0
    blocks[:] = 0.0
    coupling[:] = 0.0
    crank[:] = 0.0
    for k in range(nd):
        x0, x1, x2 = x[3 * k], x[3 * k + 1], x[3 * k + 2]
        f0 = f1 = f2 = b00 = b01 = b02 = b11 = b12 = b22 = 0.0
        for i in range(t.pins):
            n0, n1, n2 = pin[k, i, 0], pin[k, i, 1], pin[k, i, 2]
            p = pin[k, i, 3] - n0 * x0 - n1 * x1 - n2 * x2
            if p > 0.0:
                f0 += p * n0
                f1 += p * n1
                f2 += p * n2
                b00 += n0 * n0
                b01 += n0 * n1
                b02 += n0 * n2
                b11 += n1 * n1
                b12 += n1 * n2
                b22 += n2 * n2
        s, b = t.k_pin, blocks[k]
        g[3 * k], g[3 * k + 1], g[3 * k + 2] = -s * f0, -s * f1, -s * f2
        b[0, 0], b[0, 1], b[0, 2] = s * b00, s * b01, s * b02
        b[1, 1], b[1, 2], b[2, 2] = s * b11, s * b12, s * b22
    b, s = blocks[nd], t.k_sun
    b[0, 0] = b[1, 1] = s
    b[2, 2] = 1.0  # the sun has no third unknown
    g[sun], g[sun + 1] = s * x[sun], s * x[sun + 1]
    b, s = blocks[nd + 1], t.k_main
    b[0, 0] = b[1, 1] = s
    g[carrier], g[carrier + 1], g[carrier + 2] = s * x[carrier], s * x[carrier + 1], -load
    for j in range(nc):
        o = first + 3 * j
        y0, y1, y2 = x[o], x[o + 1], x[o + 2]
        t0, t1 = -rc * radial[j, 1], rc * radial[j, 0]
        for k in range(nd):
            c0, c1 = -a * eps[k, 1], a * eps[k, 0]
            at = 3 * k
            d0 = cam[j, k, 0] + y0 + c0 * y2 - x[at] - t0 * x[at + 2]
            d1 = cam[j, k, 1] + y1 + c1 * y2 - x[at + 1] - t1 * x[at + 2]
            add_bearing(t.k_cam, clearance[0], d0, d1, t0, t1, c0, c1, at, o, g, blocks[k], coupling[k], crank, j)
        d0 = bore[j, 0] + y0 - x[carrier] - t0 * x[carrier + 2]
        d1 = bore[j, 1] + y1 - x[carrier + 1] - t1 * x[carrier + 2]
        add_bearing(
            t.k_bore, clearance[1], d0, d1, t0, t1, 0.0, 0.0, carrier, o, g, blocks[nd + 1], coupling[nd + 1], crank, j
        )
        for side in range(2):
            n0, n1, n2 = flank[j, side, 0], flank[j, side, 1], flank[j, side, 2]
            p = flank[j, side, 3] + n0 * (x[sun] - y0) + n1 * (x[sun + 1] - y1) - n2 * y2
            if p > 0.0:
                f, s, q = t.k_mesh * p, t.k_mesh, 3 * j
                g[sun] += f * n0
                g[sun + 1] += f * n1
                g[o] -= f * n0
                g[o + 1] -= f * n1
                g[o + 2] -= f * n2
                b, c = blocks[nd], coupling[nd]
                b[0, 0] += s * n0 * n0
                b[0, 1] += s * n0 * n1
                b[1, 1] += s * n1 * n1
                c[0, q] -= s * n0 * n0
                c[0, q + 1] -= s * n0 * n1
                c[0, q + 2] -= s * n0 * n2
                c[1, q] -= s * n1 * n0
                c[1, q + 1] -= s * n1 * n1
                c[1, q + 2] -= s * n1 * n2
                crank[q, q] += s * n0 * n0
                crank[q, q + 1] += s * n0 * n1
                crank[q, q + 2] += s * n0 * n2
                crank[q + 1, q + 1] += s * n1 * n1
                crank[q + 1, q + 2] += s * n1 * n2
                crank[q + 2, q + 2] += s * n2 * n2


@inner
def newton_step(t, g, blocks, coupling, crank, ridge, step):
    """Solve for step = -H^-1 g, the ridge (N/mm) added to the diagonal; False where H is not positive."""
    nd, nc = t.discs, t.cranks
    first, n = 3 * nd + 5, 3 * nc
    arm = t.crank_circle * t.crank_circle
    for j in range(n):
        crank[j, j] += ridge if j % 3 < 2 else ridge * t.planet_base * t.planet_base
        step[first + j] = -g[first + j]
    for b in range(nd + 2):
        m, c = blocks[b], coupling[b]
        at = 3 * b if b <= nd else 3 * nd + 2
        size = 2 if b == nd else 3
        m[0, 0] += ridge
        m[1, 1] += ridge
        m[2, 2] += ridge * arm
        if not cholesky(m, 3):
            return False
        i0, i1, i2 = 1 / m[0, 0], 1 / m[1, 1], 1 / m[2, 2]
        r0 = -g[at] * i0
        r1 = (-g[at + 1] - m[1, 0] * r0) * i1
        r2 = (-g[at + 2] - m[2, 0] * r0 - m[2, 1] * r1) * i2 if size == 3 else 0.0
        step[at], step[at + 1] = r0, r1
        if size == 3:
            step[at + 2] = r2
        for q in range(n):  # columns of L^-1 C
            c[0, q] *= i0
            c[1, q] = (c[1, q] - m[1, 0] * c[0, q]) * i1
            c[2, q] = (c[2, q] - m[2, 0] * c[0, q] - m[2, 1] * c[1, q]) * i2
            step[first + q] -= c[0, q] * r0 + c[1, q] * r1 + c[2, q] * r2
        for q in range(n):
            for s in range(q, n):
                crank[q, s] -= c[0, q] * c[0, s] + c[1, q] * c[1, s] + c[2, q] * c[2, s]
    if not cholesky(crank, n):
        return False
    for q in range(n):
        for s in range(q):
            step[first + q] -= crank[q, s] * step[first + s]
        step[first + q] /= crank[q, q]
    for q in range(n - 1, -1, -1):
        for s in range(q + 1, n):
            step[first + q] -= crank[s, q] * step[first + s]
        step[first + q] /= crank[q, q]
    for b in range(nd + 2):
        m, c = blocks[b], coupling[b]
        at = 3 * b if b <= nd else 3 * nd + 2
        size = 2 if b == nd else 3
        for r in range(size):
            for q in range(n):
                step[at + r] -= c[r, q] * step[first + q]
        if size == 3:
            step[at + 2] /= m[2, 2]
            step[at + 1] -= m[2, 1] * step[at + 2]
            step[at] -= m[2, 0] * step[at + 2]
        step[at + 1] /= m[1, 1]
        step[at] = (step[at] - m[1, 0] * step[at + 1]) / m[0, 0]
    return True


@inner
def along(t, x, pin, flank, eps, radial, cam, bore, v, closing, rate):
    """Closings of all contacts at x and their change along v: pins, flanks, then bearings' two components each."""
    nd, nc, a, rc = t.discs, t.cranks, t.eccentricity, t.crank_circle
    sun, carrier, first = 3 * nd, 3 * nd + 2, 3 * nd + 5
    at = 0
    for k in range(nd):
        x0, x1, x2, v0, v1, v2 = x[3 * k], x[3 * k + 1], x[3 * k + 2], v[3 * k], v[3 * k + 1], v[3 * k + 2]
        for i in range(t.pins):
            n0, n1, n2 = pin[k, i, 0], pin[k, i, 1], pin[k, i, 2]
            closing[at] = pin[k, i, 3] - n0 * x0 - n1 * x1 - n2 * x2
            rate[at] = -n0 * v0 - n1 * v1 - n2 * v2
            at += 1
    for j in range(nc):
        o = first + 3 * j
        for side in range(2):
            n0, n1, n2 = flank[j, side, 0], flank[j, side, 1], flank[j, side, 2]
            closing[at] = flank[j, side, 3] + n0 * (x[sun] - x[o]) + n1 * (x[sun + 1] - x[o + 1]) - n2 * x[o + 2]
            rate[at] = n0 * (v[sun] - v[o]) + n1 * (v[sun + 1] - v[o + 1]) - n2 * v[o + 2]
            at += 1
    for j in range(nc):
        o = first + 3 * j
        t0, t1 = -rc * radial[j, 1], rc * radial[j, 0]
        for k in range(nd + 1):
            c0, c1, q = (-a * eps[k, 1], a * eps[k, 0], 3 * k) if k < nd else (0.0, 0.0, carrier)
            e0, e1 = (cam[j, k, 0], cam[j, k, 1]) if k < nd else (bore[j, 0], bore[j, 1])
            closing[at] = e0 + x[o] + c0 * x[o + 2] - x[q] - t0 * x[q + 2]
            closing[at + 1] = e1 + x[o + 1] + c1 * x[o + 2] - x[q + 1] - t1 * x[q + 2]
            rate[at] = v[o] + c0 * v[o + 2] - v[q] - t0 * v[q + 2]
            rate[at + 1] = v[o + 1] + c1 * v[o + 2] - v[q + 1] - t1 * v[q + 2]
            at += 2


@inner
def slope(t, x, v, load, clearance, closing, rate, s):
    """Slope of the energy along v at x + s v, N mm."""
    nd, nc = t.discs, t.cranks
    sun, carrier = 3 * nd, 3 * nd + 2
    pins, total, mesh = nd * t.pins, 0.0, 0.0
    for i in range(pins):
        total += max(closing[i] + s * rate[i], 0.0) * rate[i]
    for i in range(pins, pins + 2 * nc):
        mesh += max(closing[i] + s * rate[i], 0.0) * rate[i]
    total = t.k_pin * total + t.k_mesh * mesh
    at = pins + 2 * nc
    for _ in range(nc):
        for k in range(nd + 1):
            k_bearing, c = (t.k_cam, clearance[0]) if k < nd else (t.k_bore, clearance[1])
            d0, d1 = closing[at] + s * rate[at], closing[at + 1] + s * rate[at + 1]
            m = np.sqrt(d0 * d0 + d1 * d1)
            if m > c:
                total += k_bearing * (2.0 if m <= -c else 1 - c / m) * (d0 * rate[at] + d1 * rate[at + 1])
            at += 2
    for q in range(2):
        total += t.k_sun * (x[sun + q] + s * v[sun + q]) * v[sun + q]
        total += t.k_main * (x[carrier + q] + s * v[carrier + q]) * v[carrier + q]
    return total - load * v[carrier + 2]
