"""Planar statics of an RV gear train at given angles, one compiled loop.

Unknowns x, displacements from the nominal pose, mm and rad, in the order

    disc 0 .. disc nd-1 (x, y, angle) | sun (x, y) | carrier (x, y, angle) | crank 0 .. crank nc-1 (x, y, angle)

because discs, sun and carrier touch nothing but cranks: the second derivative of the energy is then block diagonal but
for its last 3 nc rows (an arrow), and each block is eliminated by itself.

Energy: sum over pins and flanks of k/2 max(p, 0)^2, over bearings of k/2 max(|d| - c, 0)^2, less the work of the load.
All closings p and d are linear in x, so the energy is convex, and its least value is the equilibrium.

Preload: a radial clearance c = -q below 0.  With m = |d| a bearing stores k/2 ((m + q)^2 + max(q - m, 0)^2), rollers of
both sides.  For m < q that is k m^2 + k q^2, a spring 2k in each direction; beyond it, k/2 (m + q)^2, whose force is
k (1 + q/m) d and whose second derivative is k (1 + q/m) across d and k along it: what a clearance has, with c = -q.
Force and energy pass into each other at m = q, where the stiffness along d falls from 2k to k: convex still.

Pin i against disc k.  The disc turns by +1 while its centre O = a e(eps) turns by -z_c: its instant centre in the
housing lies where v = a (-z_c) e'(eps) = (a - s) e'(eps), at P = s e(eps) with s = a (1 + z_c) = a z_p.  The contact
normal of a profile that is enveloped by the pin passes the pin's centre Q and P, so n = (P - Q) / |P - Q|, into the
disc.  Its arm about the disc's centre is l = (P - O) x n = a z_c e(eps) x n, and p = e - n.(x, y) - l angle.

Lobe l of a disc.  A pin's centre draws R e(phi / z_c) - a e(phi / z_c + phi) on the disc, nearest to its centre, a
root, at phi = 0.  Disc k has its eccentric at 2 pi k / n_d at theta = 0, where it leads pin 0 by that, so its roots
are at 2 pi (l - k / n_d) / z_c, and crests half a pitch ahead of them.  Roots are counted from that which the
eccentric points at, or the next: l >= z_p k / n_d.  An error e of a lobe closes e cos(z_c away / 2)^2, away the angle
from its crest, less than half a pitch.

Gear mesh j at the pitch point r_1 e(beta_j).  The sun pushes the planet along n = +-cos(al) t + sin(al) r (upper sign:
the flank that carries forward).  p = e + n.(sun - crank) +- r_b2 * crank angle - backlash / 2, r_b2 = r_2 cos(al).
A spline with play b turns the planet by b / (2 r_s) over its crank either way, so either flank loses r_b2 times that.

Bearings: d = cam less bore of the disc, and crank axis less bore of the carrier.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np


class Train(NamedTuple):
    """Numbers of a gear train: lengths in mm, angles in rad, stiffnesses in N/mm."""

    pins: int
    discs: int
    cranks: int
    lobes: int
    ratio: float
    pin_circle: float
    pin_radius: float
    eccentricity: float
    crank_circle: float
    sun_base: float
    planet_base: float
    pressure_angle: float
    backlash: float
    k_pin: float
    k_cam: float
    k_bore: float
    k_mesh: float
    k_sun: float
    k_main: float
    preload_cam: float = 0.0
    preload_bore: float = 0.0
    spline_radius: float = np.nan


class Unit(NamedTuple):
    """Part errors of one unit, mm and rad, in the frames of the catalogue; nd discs, nc cranks, zp pins.

    A wave is a row (harmonic, cos, sin); those of discs and planets have their disc or crank in front:
    (disc, is_pitch, harmonic, cos, sin) and (crank, harmonic, cos, sin).
    """

    pin_place: np.ndarray  # (zp, 2): radial, tangential
    pin_radius: np.ndarray  # (zp,)
    disc_waves: np.ndarray  # (.., 5)
    bores: np.ndarray  # (nd, nc, 2): radial, tangential, in the disc
    cams: np.ndarray  # (nc, nd, 2): along and across the eccentric direction
    carrier_bores: np.ndarray  # (nc, 2): radial, tangential
    runout: np.ndarray  # (2,): x, y in the carrier
    sun_eccentricity: np.ndarray  # (2,): x, y in the sun
    sun_offset: np.ndarray  # (2,): x, y in the housing
    planet_eccentricity: np.ndarray  # (nc, 2): x, y in the planet
    centre_distance: np.ndarray  # (nc, 2): radial, tangential
    sun_waves: np.ndarray  # (.., 3)
    planet_waves: np.ndarray  # (.., 4)
    crank_lead: np.ndarray  # (nc,): lead of the crank over its planet, rad
    thinning: np.ndarray  # (nc,): tooth thickness lost in the mesh, sun and planet together
    clearance: np.ndarray  # (2,): radial, of cam and of carrier bearings, preload taken off: below 0 they are preloaded
    grinding: np.ndarray  # (2,): equidistant and shift of the profiles, positive removes material
    input_turn: np.ndarray  # (1,): the sun turned by this
    lobes: np.ndarray  # (nd, zc): material of each lobe at its crest
    spline: np.ndarray  # (nc,): play along the spline's pitch circle, side to side


_OPTIONS = {"error_model": "numpy", "fastmath": {"contract", "reassoc", "nsz"}}
#: What Python calls.
compiled = numba.njit(cache=True, **_OPTIONS)
#: What compiled functions alone call: compiled in two thirds of the time.
inner = numba.njit(no_cpython_wrapper=True, no_cfunc_wrapper=True, **_OPTIONS)


@inner
def contact_angle(t, pin, k, i, ex, ey, ct, st):
    """Angle of pin i's contact about the centre of disc k, in the disc's frame."""
    beta = 2 * np.pi * i / t.pins
    cx = t.pin_circle * np.cos(beta) + t.pin_radius * pin[k, i, 0] - t.eccentricity * ex
    cy = t.pin_circle * np.sin(beta) + t.pin_radius * pin[k, i, 1] - t.eccentricity * ey
    return np.arctan2(cy * ct - cx * st, cx * ct + cy * st)


@inner
def closings(t, u, theta, pin, flank, eps, radial, cam, bore):
    """Rows and errors of all contacts at one angle.

    pin (nd, zp, 4): n_x, n_y, l, e; flank (nc, 2, 4): n_x, n_y, l, e less half the backlash; eps (nd, 2) and radial
    (nc, 2): unit vectors of the eccentric directions and of the cranks; cam (nc, nd, 2), bore (nc, 2): errors d.
    """
    ct, st = np.cos(theta), np.sin(theta)
    a, zp, zc, turn = t.eccentricity, t.pins, t.lobes, 2 * np.pi
    for j in range(t.cranks):
        radial[j, 0], radial[j, 1] = np.cos(theta + turn * j / t.cranks), np.sin(theta + turn * j / t.cranks)
    for k in range(t.discs):
        ex, ey = np.cos(turn * k / t.discs - zc * theta), np.sin(turn * k / t.discs - zc * theta)
        eps[k, 0], eps[k, 1] = ex, ey
        for i in range(zp):
            gx, gy = np.cos(turn * i / zp), np.sin(turn * i / zp)
            qx, qy = t.pin_circle * gx, t.pin_circle * gy
            nx, ny = a * zp * ex - qx, a * zp * ey - qy
            size = 1 / np.sqrt(nx * nx + ny * ny)
            nx, ny = nx * size, ny * size
            e = (nx * gx + ny * gy) * (u.pin_place[i, 0] + u.grinding[1]) + (ny * gx - nx * gy) * u.pin_place[i, 1]
            pin[k, i, 0], pin[k, i, 1], pin[k, i, 2] = nx, ny, a * zc * (ex * ny - ey * nx)
            pin[k, i, 3] = e + u.pin_radius[i] - u.grinding[0]
        if np.any(u.lobes[k] != 0.0):
            first = np.ceil(k * zp / t.discs - 1e-9) - k / t.discs + 0.5
            for i in range(zp):
                place = zc / turn * contact_angle(t, pin, k, i, ex, ey, ct, st) - first
                near = np.floor(place + 0.5)
                pin[k, i, 3] += u.lobes[k, int(near) % zc] * np.cos(np.pi * (place - near)) ** 2
        for w in range(u.disc_waves.shape[0]):
            if int(u.disc_waves[w, 0]) != k:
                continue
            pitch, h, wc, ws = u.disc_waves[w, 1], int(u.disc_waves[w, 2]), u.disc_waves[w, 3], u.disc_waves[w, 4]
            for i in range(zp):
                psi = contact_angle(t, pin, k, i, ex, ey, ct, st)
                wave = wc * np.cos(h * psi) + ws * np.sin(h * psi)
                # pitch moves the profile along the tangent, away from the pin by that times n
                if pitch:
                    cx, cy = np.cos(psi) * ct - np.sin(psi) * st, np.sin(psi) * ct + np.cos(psi) * st
                    wave *= pin[k, i, 0] * cy - pin[k, i, 1] * cx
                pin[k, i, 3] += wave
    sun, planet = t.ratio * theta, -zc * theta
    cs, ss, cp, sp = np.cos(sun), np.sin(sun), np.cos(planet), np.sin(planet)
    sx = u.sun_offset[0] + cs * u.sun_eccentricity[0] - ss * u.sun_eccentricity[1]
    sy = u.sun_offset[1] + ss * u.sun_eccentricity[0] + cs * u.sun_eccentricity[1]
    ca, sa = np.cos(t.pressure_angle), np.sin(t.pressure_angle)
    for j in range(t.cranks):
        rx, ry, beta = radial[j, 0], radial[j, 1], theta + turn * j / t.cranks
        shift, lead = u.centre_distance[j], 0.0
        px = rx * shift[0] - ry * shift[1] + cp * u.planet_eccentricity[j, 0] - sp * u.planet_eccentricity[j, 1]
        py = ry * shift[0] + rx * shift[1] + sp * u.planet_eccentricity[j, 0] + cp * u.planet_eccentricity[j, 1]
        for w in range(u.sun_waves.shape[0]):  # teeth of the sun ahead, along +t
            chi = u.sun_waves[w, 0] * (beta - sun)
            lead += u.sun_waves[w, 1] * np.cos(chi) + u.sun_waves[w, 2] * np.sin(chi)
        for w in range(u.planet_waves.shape[0]):  # ahead about the planet is along -t at the pitch point
            if int(u.planet_waves[w, 0]) == j:
                chi = u.planet_waves[w, 1] * (beta + np.pi - planet)
                lead += u.planet_waves[w, 2] * np.cos(chi) + u.planet_waves[w, 3] * np.sin(chi)
        dx, dy = sx - px - ry * lead, sy - py + rx * lead
        for side in range(2):
            s = 1.0 - 2 * side
            nx, ny = -s * ca * ry + sa * rx, s * ca * rx + sa * ry
            flank[j, side, 0], flank[j, side, 1], flank[j, side, 2] = nx, ny, -s * t.planet_base
            flank[j, side, 3] = (
                nx * dx + ny * dy + s * (t.sun_base * u.input_turn[0] - t.planet_base * u.crank_lead[j])
                - 0.5 * (t.backlash + ca * u.thinning[j])
            )  # fmt: skip
            if u.spline[j] > 0.0:
                flank[j, side, 3] -= t.planet_base * u.spline[j] / (2 * t.spline_radius)
        for k in range(t.discs):
            ex, ey, c, b = eps[k, 0], eps[k, 1], u.cams[j, k], u.bores[k, j]
            cam[j, k, 0] = ex * c[0] - ey * c[1] - rx * b[0] + ry * b[1]
            cam[j, k, 1] = ey * c[0] + ex * c[1] - ry * b[0] - rx * b[1]
        b = u.carrier_bores[j]
        bore[j, 0] = -(rx * b[0] - ry * b[1]) - (ct * u.runout[0] - st * u.runout[1])
        bore[j, 1] = -(ry * b[0] + rx * b[1]) - (st * u.runout[0] + ct * u.runout[1])


@compiled
def add_bearing(k, c, d0, d1, arm0, arm1, crank0, crank1, at, cr, g, block, coupling, crank, j):
    """Add a bearing between part ``at`` (arm of its angle) and a crank (row ``cr`` of g) to gradient and matrices.

    d = crank + crank_arm angle - part - arm angle; block (3, 3) of the part, coupling (3, 3 nc), crank (3 nc, 3 nc).
    """
    m = np.sqrt(d0 * d0 + d1 * d1)
    if m <= c:
        return
    if m <= -c:  # both sides carry
        across, turned = 2 * k, 0.0
    else:  # the second derivative is k along d, and this across it
        across = k * (1 - c / m)
        turned = (k - across) / (m * m)
    f0, f1 = across * d0, across * d1
    k00, k01, k11 = across + turned * d0 * d0, turned * d0 * d1, across + turned * d1 * d1
    ka0, ka1 = k00 * arm0 + k01 * arm1, k01 * arm0 + k11 * arm1
    kc0, kc1 = k00 * crank0 + k01 * crank1, k01 * crank0 + k11 * crank1
    g[at] -= f0
    g[at + 1] -= f1
    g[at + 2] -= f0 * arm0 + f1 * arm1
    g[cr] += f0
    g[cr + 1] += f1
    g[cr + 2] += f0 * crank0 + f1 * crank1
    block[0, 0] += k00
    block[0, 1] += k01
    block[1, 1] += k11
    block[0, 2] += ka0
    block[1, 2] += ka1
    block[2, 2] += arm0 * ka0 + arm1 * ka1
    o = 3 * j
    coupling[0, o] -= k00
    coupling[0, o + 1] -= k01
    coupling[1, o] -= k01
    coupling[1, o + 1] -= k11
    coupling[0, o + 2] -= kc0
    coupling[1, o + 2] -= kc1
    coupling[2, o] -= ka0
    coupling[2, o + 1] -= ka1
    coupling[2, o + 2] -= arm0 * kc0 + arm1 * kc1
    crank[o, o] += k00
    crank[o, o + 1] += k01
    crank[o + 1, o + 1] += k11
    crank[o, o + 2] += kc0
    crank[o + 1, o + 2] += kc1
    crank[o + 2, o + 2] += crank0 * kc0 + crank1 * kc1
