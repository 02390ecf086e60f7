"""Planar statics of an RV gear train at given angles, one compiled loop.

Unknowns x, displacements from the nominal pose, mm and rad, in the order

    disc 0 .. disc nd-1 (x, y, angle) | sun (x, y) | carrier (x, y, angle) | crank 0 .. crank nc-1 (x, y, angle)

because discs, sun and carrier touch nothing but cranks: the second derivative of the energy is then block diagonal but
for its last 3 nc rows (an arrow), and each block is eliminated by itself.

Energy: sum over pins and flanks of k/2 max(p, 0)^2, over bearings of k/2 max(|d| - c, 0)^2, less the work of the load.
All closings p and d are linear in x, so the energy is convex, and its least value is the equilibrium.

Pin i against disc k.  The disc turns by +1 while its centre O = a e(eps) turns by -z_c: its instant centre in the
housing lies where v = a (-z_c) e'(eps) = (a - s) e'(eps), at P = s e(eps) with s = a (1 + z_c) = a z_p.  The contact
normal of a profile that is enveloped by the pin passes the pin's centre Q and P, so n = (P - Q) / |P - Q|, into the
disc.  Its arm about the disc's centre is l = (P - O) x n = a z_c e(eps) x n, and p = e - n.(x, y) - l angle.

Gear mesh j at the pitch point r_1 e(beta_j).  The sun pushes the planet along n = +-cos(al) t + sin(al) r (upper sign:
the flank that carries forward).  p = e + n.(sun - crank) +- r_b2 * crank angle - backlash / 2, r_b2 = r_2 cos(al).

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
    clearance: np.ndarray  # (2,): radial, of cam and of carrier bearings
    grinding: np.ndarray  # (2,): equidistant and shift of the profiles, positive removes material
    input_turn: np.ndarray  # (1,): the sun turned by this


compiled = numba.njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})


@compiled
def closings(t, u, theta, pin, flank, eps, radial, cam, bore):
    """Rows and errors of all contacts at one angle.

    pin (nd, zp, 4): n_x, n_y, l, e; flank (nc, 2, 3): n_x, n_y, e less half the backlash; eps (nd, 2) and radial
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
        for w in range(u.disc_waves.shape[0]):
            if int(u.disc_waves[w, 0]) != k:
                continue
            pitch, h, wc, ws = u.disc_waves[w, 1], int(u.disc_waves[w, 2]), u.disc_waves[w, 3], u.disc_waves[w, 4]
            for i in range(zp):
                nx, ny = pin[k, i, 0], pin[k, i, 1]
                cx = t.pin_circle * np.cos(turn * i / zp) + t.pin_radius * nx - a * ex  # contact from the disc's centre
                cy = t.pin_circle * np.sin(turn * i / zp) + t.pin_radius * ny - a * ey
                size = 1 / np.sqrt(cx * cx + cy * cy)
                cx, cy = cx * size, cy * size
                psi = np.arctan2(cy * ct - cx * st, cx * ct + cy * st)  # in the disc's frame
                wave = wc * np.cos(h * psi) + ws * np.sin(h * psi)
                # pitch moves the profile along the tangent (-cy, cx), away from the pin by that times n
                pin[k, i, 3] += -wave * (ny * cx - nx * cy) if pitch else wave
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
            flank[j, side, 0], flank[j, side, 1] = nx, ny
            flank[j, side, 2] = (
                nx * dx + ny * dy + s * (t.sun_base * u.input_turn[0] - t.planet_base * u.crank_lead[j])
                - 0.5 * (t.backlash + ca * u.thinning[j])
            )  # fmt: skip
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
    free = k * c / m  # what the turning of the force takes off, times the identity
    f0, f1 = (k - free) * d0, (k - free) * d1
    free /= m * m
    k00, k01, k11 = k - free * d1 * d1, free * d0 * d1, k - free * d0 * d0
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
