"""Drawing of a reducer at one output angle: its parts to size, contact forces and error vectors to stated scales."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array, radial_and_tangential, unit_vectors
from rverror.base.directions import Direction, direction_sign
from rverror.base.errors import InputError
from rverror.base.numbers import way
from rverror.geartrain.action_line import CONTACT_AXES, Clearance, Compliance, Contacts
from rverror.geartrain.contacts import closed_form_forces, pose
from rverror.geartrain.cycloid import pin_positions, profile
from rverror.geartrain.kinematics import frame_orders
from rverror.geartrain.mechanism import Reducer
from rverror.model.catalogue import source
from rverror.model.effects import Model
from rverror.statics.loaded_state import equilibrium
from rverror.views.plots import style
from rverror.views.plots.figure import Axes, axes_for, legend_beside, plain

_DISCS = (style.BLUE, style.ORANGE, style.GREEN, style.PURPLE)
_PER_LOBE = 64  # points of an outline, evenly along it
_KEY = 10.0  # mm of the drawing: arrow that states a scale
_LIGHT_TORQUE = 1e5  # N*mm, for a reducer without a rated torque
_LEAST = 1e-3  # of the longest arrow, below which one is not drawn
_GROUPS: Mapping[str, tuple[str, ...]] = {
    "forces of pins and sun": ("pin", "mesh"),
    "forces in the bearings of the cranks": ("cam", "carrier"),
}


@dataclass(frozen=True)
class Places:
    """Where the parts of a reducer stand at one angle, nominal, in the housing frame, mm and rad.

    Attributes
    ----------
    outline : ndarray, shape (discs, 2, m)
        Of each disc, closed.
    disc : ndarray, shape (discs, 2)
        Centres.
    pins : ndarray, shape (pins, 2)
    cranks : ndarray, shape (cranks, 2)
    sun : ndarray, shape (2,)
    turned : mapping of str to ndarray
        Angle of the marks: of ``"sun"``, (1,), and of ``"planet"``, (cranks,).
    contact : mapping of str to ndarray
        Point of each contact that has one, shaped as in `CONTACT_AXES` but for the flanks of a mesh.
    """

    outline: Array
    disc: Array
    pins: Array
    cranks: Array
    sun: Array
    turned: Mapping[str, Array]
    contact: Mapping[str, Array]

    def moved(self, shape: Mapping[str, Array], scale: float) -> Places:
        """Where they are as each part moves by so many times its x, y and angle, to first order.

        Parameters
        ----------
        shape : mapping of str to ndarray
            As of `Modes`, of one mode; the pins stand.
        scale : float
        """
        carrier, sun = scale * shape["carrier"], scale * shape["sun"]
        discs = [scale * shape[f"disc {k}"] for k in range(len(self.disc))]
        cranks = np.array([scale * shape[f"crank {j}"] for j in range(len(self.cranks))])
        cams = np.stack(
            [_carried(cams.T, at, by).T for cams, at, by in zip(self.contact["cam"], self.disc, discs, strict=True)]
        )
        return replace(
            self,
            outline=np.stack(
                [_carried(line, at, by) for line, at, by in zip(self.outline, self.disc, discs, strict=True)]
            ),
            disc=self.disc + np.array([by[:2] for by in discs]),
            cranks=self.cranks + cranks[:, :2],
            sun=self.sun + sun[:2],
            turned={"sun": self.turned["sun"] + sun[2:].sum(), "planet": self.turned["planet"] + cranks[:, 2]},
            contact={**self.contact, "cam": cams, "carrier": _carried(self.cranks.T, np.zeros(2), carrier).T},
        )


def _carried(points: Array, centre: Array, by: Array) -> Array:
    """Points (2, m) of a part whose centre moves by x and y, and which turns by an angle about it."""
    arm = points - centre[:, None]
    return np.asarray(points + by[:2, None] + by[2] * np.stack([-arm[1], arm[0]]), dtype=np.float64)


def places(motion: Contacts) -> Places:
    """Where the parts stand in the first sample of a nominal motion, as `pose` has it.

    A pin at the angle g lies (E - g) / z_c from a root on a disc whose eccentric points along E; with g = 2 pi i / z_p
    all pins agree that the disc's roots lie a whole number of lobes from -E / z_c.
    """
    unit = motion.reducer
    eccentric = motion.eccentric[:, 0]
    turns, theta = frame_orders(unit), float(motion.theta[0])
    centre = unit.eccentricity * _along(eccentric)
    shape = profile(unit, _rolls(unit))
    cos, sin = np.cos(-eccentric / unit.disc_lobes), np.sin(-eccentric / unit.disc_lobes)
    turned = np.moveaxis(np.array([[cos, -sin], [sin, cos]]), -1, 0) @ shape
    pins = unit.pin_circle_radius * _along(pin_positions(unit))
    position = _along(motion.crank_position[:, 0])
    cranks = unit.crank_radius * position
    return Places(
        outline=turned + centre[..., None],
        disc=centre,
        pins=pins,
        cranks=cranks,
        sun=np.zeros(2),
        turned={
            "sun": np.array([turns["sun"] * theta]),
            "planet": np.full(unit.cranks, turns["planet"] * theta),
        },
        contact={
            "pin": pins + unit.pin_radius * motion.pin_normal[..., 0],
            "cam": cranks + centre[:, None],
            "carrier": cranks,
            "mesh": np.repeat(unit.sun_pitch_radius * position[:, None], 2, axis=1),
        },
    )


def _rolls(unit: Reducer) -> Array:
    """Roll angles of a whole outline, evenly along it: over the roll angle points crowd at a lobe's tip."""
    fine = np.linspace(0, 2 * np.pi, 20 * _PER_LOBE + 1)
    length = np.append(0.0, np.cumsum(np.hypot(*np.diff(profile(unit, fine)))))
    lobe = np.interp(np.arange(_PER_LOBE) / _PER_LOBE * length[-1], length, fine)
    turns = 2 * np.pi * np.arange(unit.disc_lobes)[:, None]
    return np.append((turns + lobe).ravel(), 2 * np.pi * unit.disc_lobes)


def _along(angle: Array) -> Array:
    """Unit vectors (..., 2)."""
    return np.asarray(radial_and_tangential(angle[..., None])[0][..., 0], dtype=np.float64)


def forces_at(model: Model, motion: Contacts, *, theta: float, torque: Any | None) -> tuple[dict[str, Array], float]:
    """Force of the driving on the driven part at each contact, N, and the torque that they belong to, N*mm.

    Parameters
    ----------
    model : Model
        Of a reducer.
    motion : Contacts
        Of one sample.
    theta : float
        As the bench reads it, rad.
    torque : float or quantity, optional
        With one the loaded equilibrium; the closed form at the rated torque where left out.
    """
    direction, contacts = float(motion.direction[0]), [key for key in CONTACT_AXES if key != "output"]
    if torque is not None:
        state = equilibrium(model, [theta], torque=torque, direction=direction)
        return {key: state.contact_forces[key][..., 0] for key in contacts}, units.to_core(torque, "torque")
    load = motion.reducer.rated_torque or _LIGHT_TORQUE
    per_torque = closed_form_forces(motion)
    return {key: direction * load * per_torque[key][..., 0] for key in contacts}, load


def error_vectors(model: Model, motion: Contacts, forces: Mapping[str, Array]) -> tuple[dict[str, Array], list[str]]:
    """Sum of the errors of a model at each contact, mm, and the keys of those that are angles and have no vector.

    Displacement of the driving surface less that of the driven one, as `ErrorVector` has it; of a gear mesh it is the
    driving flank's.  A journal lies off centre along its force, from `forces_at`.
    """
    total = {key: np.zeros_like(force) for key, force in forces.items() if force.shape[-1] == 2}
    angles = []
    for effect in model.effects:
        entry = source(effect.key)
        found = None if entry.at_output else entry.vector(motion, **effect.indices)
        parts = found if isinstance(found, tuple) else (found,)
        for part in parts:
            if isinstance(part, Clearance):
                along = unit_vectors(forces[part.contact][..., None])[..., 0]
                total[part.contact] -= effect.values[0] * along
            elif isinstance(part, Compliance):  # as far as the contact gives way under its force
                given = np.tensordot(effect.values, part.share, axes=1)[..., :1]
                total[part.contact][part.at] -= given * forces[part.contact][part.at]
            elif part is None or part.contact not in total:
                angles.append(effect.key)
            else:
                for value, term in zip(effect.values, part.vector, strict=True):
                    total[part.contact][part.at] += value * term[..., 0]
    total["mesh"][:, 1 if motion.direction[0] > 0 else 0] = 0.0  # the idle flank
    return total, list(dict.fromkeys(angles))


def mechanism(
    model: Model | Reducer,
    *,
    theta: Any = 0.0,
    direction: Direction = "forward",
    torque: Any | None = None,
    disc: int | None = None,
    error_scale: float | None = None,
    pin_scale: float | None = None,
    bearing_scale: float | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw a reducer at one output angle: nominal geometry to size, forces and declared errors as arrows.

    Parameters
    ----------
    model : Model or Reducer
    theta : float or quantity
        Nominal output angle, rad.
    direction : {"forward", "reverse"} or +1 or -1
    torque : float or quantity, optional
        Output torque, N*mm, at which the forces are those of the equilibrium, contacts that open included.  Where left
        out they are those of the closed form at the rated torque, or at 100 N*m where none is rated.
    disc : int, optional
        The only disc to draw; all where left out.
    error_scale, pin_scale, bearing_scale : float, optional
        Millimetres of the drawing per mm of error, and per N of the forces of pins and meshes and of those of bearings.
        Round scales are chosen where left out; every scale is stated by an arrow of 10 mm.
    ax : Axes, optional
        Its aspect is made equal.

    Returns
    -------
    Axes

    Raises
    ------
    InputError
        If the model is no reducer or there is no such disc.

    Notes
    -----
    An error arrow is the sum of all declared errors at its contact, displacement of the driving surface less that of
    the driven one.  Radii of cams are for sight only: no error depends on them.
    """
    whole = model if isinstance(model, Model) else Model(model)
    unit = whole.mechanism
    if not isinstance(unit, Reducer):
        raise InputError("the mechanism of a [drive] is not known; a drawing needs a [reducer] model")
    if disc is not None and not 0 <= disc < unit.discs:
        raise InputError(f"disc = {disc}: this reducer has {unit.discs} discs, counted from 0")
    angle = units.to_core(theta, "angle")
    direction = direction_sign(direction)
    motion = pose(unit, [angle + whole.index_offset], direction=direction)
    assert isinstance(motion, Contacts)
    forces, load = forces_at(whole, motion, theta=angle, torque=torque)
    errors, unseen = error_vectors(whole, motion, forces)
    discs = range(unit.discs) if disc is None else range(disc, disc + 1)
    where = places(motion)

    ax = axes_for(ax, width=9.0, height=7.2)
    draw_parts(ax, unit, where, discs)
    keys = []
    for (group, contacts), given in zip(_GROUPS.items(), (pin_scale, bearing_scale), strict=True):
        longest = max(float(np.linalg.norm(forces[key], axis=-1).max(initial=0.0)) for key in contacts)
        scale = given or _round_scale(longest, 0.32 * unit.pin_circle_radius)
        for key in contacts:
            _arrows(ax, where.contact[key], forces[key], scale, key=key, discs=discs)
        keys.append((f"{group}: {_newton(_KEY / scale)}" if longest else f"{group}: none", style.BLACK))
    longest = max(float(np.linalg.norm(vector, axis=-1).max(initial=0.0)) for vector in errors.values())
    if longest:
        scale = error_scale or _round_scale(longest, 0.25 * unit.pin_circle_radius)
        for key, vector in errors.items():
            _arrows(ax, where.contact[key], vector, scale, key=key, discs=discs, error=True)
        keys.append((f"errors, driving less driven surface: {1e3 * _KEY / scale:.3g} um", style.VERMILLION))
    _finish(ax, unit, keys, unseen)
    how = "closed form" if torque is None else "equilibrium"
    name = plain(whole.name or unit.name)
    ax.set_title(f"{name} at {math.degrees(angle):.4g} deg, {way(direction)}, {load / 1e3:.4g} N*m, {how}")
    return ax


def _newton(force: float) -> str:
    return f"{force / 1e3:.3g} kN" if force >= 1e3 else f"{force:.3g} N"


def _round_scale(longest: float, room: float) -> float:
    """Millimetres per unit such that the arrow of a key stands for 1, 2 or 5 times a power of ten."""
    if not longest > 0:
        return 1.0
    rough = _KEY * longest / room
    power = 10.0 ** math.floor(math.log10(rough))
    return _KEY / next(f * power for f in (1, 2, 5, 10) if f * power >= rough * (1 - 1e-9))


def draw_parts(ax: Axes, unit: Reducer, where: Places, discs: range) -> None:
    """Draw pins, some discs with their cams, gears and carrier."""
    from matplotlib.patches import Circle

    for i, (x, y) in enumerate(where.pins):
        label = "pins" if i == 0 else None
        ax.add_patch(Circle((x, y), unit.pin_radius, fc="0.85", ec="0.3", lw=0.7, gid=f"pin {i}", label=label))
    for k in discs:
        look: dict[str, Any] = {"color": _DISCS[k % len(_DISCS)], "ls": style.DASHES[k % len(style.DASHES)]}
        ax.plot(*where.outline[k], lw=1.2, gid=f"disc {k}", label=f"disc {k}, its centre and cams", **look)
        ax.plot(*where.disc[k], "+", color=look["color"], ms=8, mew=1.4)
        for x, y in where.contact["cam"][k]:
            ax.add_patch(Circle((x, y), _cam_radius(unit), fc="none", ec=look["color"], ls=look["ls"], lw=1.0))
    mean: dict[str, Any] = {"color": "0.45", "lw": 0.9, "ls": style.DASHES[3]}
    for label, radius, centres, angles in (
        ("sun and planets, pitch circles", unit.sun_pitch_radius, where.sun[None], where.turned["sun"]),
        (None, unit.planet_pitch_radius, where.cranks, where.turned["planet"]),
    ):
        for number, (centre, angle) in enumerate(zip(centres, angles, strict=True)):
            circle = centre[:, None] + radius * np.array([np.cos(_ROUND), np.sin(_ROUND)])
            ax.plot(*circle, label=label if number == 0 else None, **mean)
            mark = centre + radius * np.array([[0.55], [1.0]]) * np.array([math.cos(angle), math.sin(angle)])
            ax.plot(*mark.T, color="0.45", lw=2.2)
    bores = where.contact["carrier"]
    ring = np.concatenate([bores, bores[:1]])
    ax.plot(
        *ring.T, color=style.GREY, lw=4.0, alpha=0.6, solid_capstyle="round", label="carrier, crank 0 filled", zorder=1
    )
    ax.plot(*where.cranks[:1].T, "o", color=style.BLACK, ms=6)
    ax.plot(*where.cranks[1:].T, "o", color=style.BLACK, mfc="white", ms=6)


_ROUND = np.linspace(0, 2 * np.pi, 181)


def _cam_radius(unit: Reducer) -> float:
    """Radius that shows a cam: larger than its eccentricity, smaller than the planet."""
    return max(2.5 * unit.eccentricity, 0.3 * unit.planet_pitch_radius)


def _arrows(ax: Axes, at: Array, vector: Array, scale: float, *, key: str, discs: range, error: bool = False) -> None:
    """Arrows of one contact, from where it is; those of a disc in its colour."""
    longest = float(np.linalg.norm(vector, axis=-1).max(initial=0.0))
    if not longest:
        return
    parts = [(k, at[k], vector[k]) for k in discs] if key in ("pin", "cam") else [(None, at, vector)]
    for k, points, arrows in parts:
        x, y = points.reshape(-1, 2).T
        u, v = arrows.reshape(-1, 2).T * scale
        seen = np.hypot(u, v) > _LEAST * longest * scale
        colour = style.BLACK if k is None else _DISCS[k % len(_DISCS)]
        what = "error" if error else "force"
        name = f"{key} {what}" + ("" if k is None else f", disc {k}")
        _quiver(
            ax, x[seen], y[seen], u[seen], v[seen], colour=style.VERMILLION if error else colour, hollow=error, gid=name
        )


_FULL = {"width": 0.017, "headwidth": 3.6, "headlength": 5.0, "headaxislength": 4.5, "linewidth": 0.2, "zorder": 5}
_HOLLOW = {"width": 0.032, "headwidth": 3.0, "headlength": 4.0, "headaxislength": 3.6, "linewidth": 0.9, "zorder": 6}


def _quiver(ax: Axes, x: Any, y: Any, u: Any, v: Any, *, colour: str, hollow: bool, gid: str) -> None:
    """Arrows in data units, so that their lengths are to scale; hollow ones are told apart in grey too."""
    look: dict[str, Any] = {**(_HOLLOW if hollow else _FULL), "facecolor": "white" if hollow else colour}
    to_scale: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1, "units": "inches", "minlength": 0}
    ax.quiver(x, y, u, v, edgecolor=colour, gid=gid, **to_scale, **look)


def _finish(ax: Axes, unit: Reducer, keys: list[tuple[str, str]], unseen: list[str]) -> None:
    """Equal aspect, scales as arrows under the drawing, what is not drawn, units."""
    reach = unit.pin_circle_radius + 2.5 * unit.pin_radius
    step = 0.13 * reach
    low = -reach - 0.6 * step
    for number, (text, colour) in enumerate(keys):
        y = low - (number + 0.5) * step
        _quiver(ax, [-reach], [y], [_KEY], [0.0], colour=colour, hollow=colour == style.VERMILLION, gid="scale")
        ax.text(-reach + _KEY + 0.4 * step, y, text, va="center", fontsize="small")
    bottom = low - len(keys) * step
    if unseen:
        text = "not drawn, angles: " + plain(", ".join(unseen))
        ax.text(-reach, bottom - 0.5 * step, text, va="center", fontsize="x-small")
        bottom -= step
    ax.set_aspect("equal")
    ax.set(xlabel="x, mm", ylabel="y, mm", xlim=(-1.06 * reach, 1.06 * reach), ylim=(bottom - 0.4 * step, 1.06 * reach))
    legend_beside(ax)
