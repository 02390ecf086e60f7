"""Drawing of a reducer at one output angle: parts to size, forces, error vectors and natural modes as arrows."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array, radial_and_tangential, unit_vectors
from rverror.base.directions import Direction, direction_sign
from rverror.base.errors import InputError
from rverror.base.numbers import brief, way, with_unit
from rverror.dynamics.natural_modes import Modes
from rverror.geartrain.action_line import CONTACT_AXES, Clearance, Compliance, Contacts
from rverror.geartrain.contacts import closed_form_forces, pose
from rverror.geartrain.cycloid import pin_positions, profile
from rverror.geartrain.kinematics import frame_orders
from rverror.geartrain.mechanism import Reducer
from rverror.model.catalogue import source
from rverror.model.effects import Model
from rverror.statics.loaded_state import equilibrium
from rverror.views.plots import style
from rverror.views.plots.figure import Axes, axes_for
from rverror.views.plots.labels import labelled, plain

_DISCS = (style.BLUE, style.ORANGE, style.GREEN, style.PURPLE)
_PER_LOBE = 256  # points of an outline: chords of 3 um at a pin circle of 64 mm, at a lobe's tip far less
_KEY = 10.0  # mm of the drawing, of which the scales are told
_LONGEST = 0.3  # of the pin circle's radius, of the longest arrow of a scale
_LIGHT_TORQUE = 1e5  # N*mm, for a reducer without a rated torque
_LEAST = 1e-3  # of the longest arrow, below which one is not drawn
_FULL = {"width": 0.017, "headwidth": 3.6, "headlength": 5.0, "headaxislength": 4.5, "linewidth": 0.2, "zorder": 5}
_HOLLOW = {"width": 0.032, "headwidth": 3.0, "headlength": 4.0, "headaxislength": 3.6, "linewidth": 0.9, "zorder": 6}


@dataclass(frozen=True)
class PartPositions:
    """Where the parts of a reducer stand at one angle, nominal, in the housing frame, mm and rad.

    Attributes
    ----------
    outline : ndarray, shape (discs, 2, m)
        Of each disc, closed.
    disc : ndarray, shape (discs, 2)
        Centres.
    pins : ndarray, shape (pins, 2)
    cranks : ndarray, shape (cranks, 2)
    sun_angle, planet_angle : float
        Of the marks; the sun stands in the middle.
    contact : mapping of str to ndarray
        Point of each contact that has one, shaped as in `CONTACT_AXES` but for the flanks of a mesh.
    """

    outline: Array
    disc: Array
    pins: Array
    cranks: Array
    sun_angle: float
    planet_angle: float
    contact: Mapping[str, Array]


def part_positions(motion: Contacts) -> PartPositions:
    """Where the parts stand in the first sample of a nominal motion, as `pose` has it.

    A pin at the angle g lies (E - g) / z_c from a root on a disc whose eccentric points along E; with g = 2 pi i / z_p
    all pins agree that the disc's roots lie a whole number of lobes from -E / z_c.
    """
    unit = motion.reducer
    eccentric = motion.eccentric[:, 0]
    turns, theta = frame_orders(unit), float(motion.theta[0])
    centre = unit.eccentricity * _along(eccentric)
    shape = profile(unit, np.linspace(0, 2 * np.pi * unit.disc_lobes, _PER_LOBE * unit.disc_lobes + 1))
    cos, sin = np.cos(-eccentric / unit.disc_lobes), np.sin(-eccentric / unit.disc_lobes)
    turned = np.moveaxis(np.array([[cos, -sin], [sin, cos]]), -1, 0) @ shape
    pins = unit.pin_circle_radius * _along(pin_positions(unit))
    position = _along(motion.crank_position[:, 0])
    cranks = unit.crank_radius * position
    return PartPositions(
        outline=turned + centre[..., None],
        disc=centre,
        pins=pins,
        cranks=cranks,
        sun_angle=turns["sun"] * theta,
        planet_angle=turns["planet"] * theta,
        contact={
            "pin": pins + unit.pin_radius * motion.pin_normal[..., 0],
            "cam": cranks + centre[:, None],
            "carrier": cranks,
            "mesh": np.repeat(unit.sun_pitch_radius * position[:, None], 2, axis=1),
        },
    )


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
    ax : Axes, optional
        Its aspect is made equal.

    Returns
    -------
    Axes

    Raises
    ------
    InputError
        If the model is no reducer.

    Notes
    -----
    An error arrow is the sum of all declared errors at its contact, displacement of the driving surface less that of
    the driven one.  Radii of cams are for sight only: no error depends on them.
    """
    whole = model if isinstance(model, Model) else Model(model)
    unit = whole.mechanism
    if not isinstance(unit, Reducer):
        raise InputError("the mechanism of a [drive] is not known; a drawing needs a [reducer] model")
    angle = units.to_core(theta, "angle")
    direction = direction_sign(direction)
    motion = _posed(whole, angle, direction)
    forces, load = forces_at(whole, motion, theta=angle, torque=torque)
    errors, unseen = error_vectors(whole, motion, forces)
    where = part_positions(motion)

    ax = axes_for(ax, width=9.0, height=6.0)
    draw_parts(ax, unit, where)
    key = [f"{_KEY:g} mm of an arrow are"]
    for name, contacts in (("pins and sun", ("pin", "mesh")), ("the bearings of the cranks", ("cam", "carrier"))):
        size = _contact_arrows(ax, unit, where, {key: forces[key] for key in contacts})
        key.append(f"at {name}: {brief(_KEY * size, 3)} N")
    if size := _contact_arrows(ax, unit, where, errors, error=True):
        key.append(f"of errors, driving less driven surface: {1e3 * _KEY * size:.3g} um")
    if unseen:
        key.append("not drawn, angles: " + plain(", ".join(unseen)))
    how = "closed form" if torque is None else "equilibrium"
    name = plain(whole.name or unit.name)
    title = [f"{name} at {math.degrees(angle):.4g} deg", way(direction), with_unit(load, "torque"), how]
    return _finish(ax, title, key)


def _posed(model: Model, theta: float, direction: float) -> Contacts:
    """Nominal motion of a reducer in one sample, as the gears' marks have it."""
    motion = pose(model.mechanism, [theta + model.index_offset], direction=direction)
    assert isinstance(motion, Contacts)
    return motion


def _contact_arrows(
    ax: Axes, unit: Reducer, where: PartPositions, vectors: Mapping[str, Array], *, error: bool = False
) -> float:
    """Draw arrows of contacts to one scale, those of a disc in its colour; what a mm of them is, 0 without any."""
    longest = max(float(np.linalg.norm(of, axis=-1).max(initial=0.0)) for of in vectors.values())
    if not longest:
        return 0.0
    size = _round_up(_KEY * longest / (_LONGEST * unit.pin_circle_radius)) / _KEY
    for key, of in vectors.items():
        at, what = where.contact[key], f"{key} {'error' if error else 'force'}"
        parts = [(f"{what}, disc {k}", k) for k in range(unit.discs)] if key in ("pin", "cam") else [(what, None)]
        for name, k in parts:
            chosen = slice(None) if k is None else k
            colour = style.VERMILLION if error else _colour(k)
            _arrows(ax, at[chosen], of[chosen] / size, colour=colour, hollow=error, gid=name)
    return size


def _round_up(size: float) -> float:
    """The next 1, 2 or 5 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(size))
    return next(f * power for f in (1, 2, 5, 10) if f * power >= size * (1 - 1e-9))


def _colour(disc: int | None) -> str:
    """Colour of a disc, or of what belongs to none."""
    return style.BLACK if disc is None else _DISCS[disc % len(_DISCS)]


def mode_shape(modes: Modes, *, mode: int | None = None, ax: Axes | None = None) -> Axes:
    """Draw one natural mode on the mechanism: arrows show how far it moves points of the parts.

    Parameters
    ----------
    modes : Modes
    mode : int, optional
        Counted from 1, the lowest frequency; where left out the lowest that is held and none of the sun's support.
    ax : Axes, optional
        Its aspect is made equal.

    Returns
    -------
    Axes

    Raises
    ------
    InputError
        If there is no such mode.

    Notes
    -----
    Arrows stand at the cams of each disc, at the bores of the carrier and on the pitch circles of sun and planets.
    Input and load have no place in the plane.
    """
    ax = axes_for(ax, width=9.0, height=6.0)
    count = modes.frequency.size
    chosen = 1 + (modes.lowest or 0) if mode is None else mode
    if not 1 <= chosen <= count:
        raise InputError(f"mode = {mode}: this reducer has modes 1 to {count}, from the lowest frequency up")
    motion = _posed(modes.model, modes.theta, modes.direction)
    unit, where = motion.reducer, part_positions(motion)
    draw_parts(ax, unit, where)
    moved = _moved(unit, where, {part: rows[:, chosen - 1] for part, rows in modes.shape.items()})
    # a motion of input or load alone has nothing that could be drawn
    longest = max(1e-12, *(float(np.linalg.norm(steps, axis=-1).max()) for _, steps in moved.values()))
    for part, (at, steps) in moved.items():
        colour = _colour(int(part.removeprefix("disc ")) if part.startswith("disc") else None)
        _arrows(ax, at, _LONGEST * unit.pin_circle_radius / longest * steps, colour=colour, gid=part)
    key = []
    for what, shares in (("held by", modes.strain_energy), ("moving", modes.kinetic_energy)):
        share, name = max((float(row[chosen - 1]), name) for name, row in shares.items())
        key.append(f"{what}: {name.replace('_', ' ')} {100 * share:.0f} %")
    frequency = f"{float(modes.frequency[chosen - 1]):.4g} Hz"
    of_sun = ", of the sun's support" if modes.of_sun_support[chosen - 1] else ""
    title = [plain(modes.model.name or unit.name), f"mode {chosen} of {count}", f"{frequency}{of_sun}"]
    state = [with_unit(modes.torque, "torque"), way(modes.direction), f"at {math.degrees(modes.theta):.4g} deg"]
    return _finish(ax, title + state, key)


def _moved(unit: Reducer, where: PartPositions, shape: Mapping[str, Array]) -> dict[str, tuple[Array, Array]]:
    """Points (n, 2) of each part and how far they move, with x, y and angle of the parts in the mode."""
    middle = np.zeros(2)
    on_sun = unit.sun_pitch_radius * _along(np.array([where.sun_angle]))
    on_planet = unit.planet_pitch_radius * _along(np.array([where.planet_angle]))
    points = {"carrier": (middle, where.cranks), "sun": (middle, on_sun)}
    points |= {f"disc {k}": (where.disc[k], where.contact["cam"][k]) for k in range(unit.discs)}
    points |= {f"crank {j}": (centre, centre + on_planet) for j, centre in enumerate(where.cranks)}
    moved = {}
    for part, (centre, at) in points.items():
        x, y, angle = np.append(shape[part], 0.0)[:3]  # the angle of a sun that is held is none
        arm = at - centre
        moved[part] = at, np.array([x, y]) + angle * np.stack([-arm[:, 1], arm[:, 0]], axis=-1)
    return moved


def draw_parts(ax: Axes, unit: Reducer, where: PartPositions) -> None:
    """Draw pins, discs with their cams, gears and carrier."""
    from matplotlib.patches import Circle

    cam = max(2.5 * unit.eccentricity, 0.3 * unit.planet_pitch_radius)  # larger than its eccentricity
    for i, (x, y) in enumerate(where.pins):
        label = "pins" if i == 0 else None
        ax.add_patch(Circle((x, y), unit.pin_radius, fc="0.85", ec="0.3", lw=0.7, gid=f"pin {i}", label=label))
    for k in range(unit.discs):
        look: dict[str, Any] = {"color": _colour(k), "ls": style.DASHES[k % len(style.DASHES)]}
        ax.plot(*where.outline[k], lw=1.2, gid=f"disc {k}", label=f"disc {k}, its centre and cams", **look)
        ax.plot(*where.disc[k], "+", color=look["color"], ms=8, mew=1.4)
        for x, y in where.contact["cam"][k]:
            ax.add_patch(Circle((x, y), cam, fc="none", ec=look["color"], ls=look["ls"], lw=1.0))
    pitch: dict[str, Any] = {"fc": "none", "ec": "0.45", "lw": 0.9, "ls": style.DASHES[3]}
    gears = [(unit.sun_pitch_radius, np.zeros(2), where.sun_angle)]
    gears += [(unit.planet_pitch_radius, centre, where.planet_angle) for centre in where.cranks]
    for number, (radius, centre, angle) in enumerate(gears):
        label = "sun and planets, pitch circles" if number == 0 else None
        ax.add_patch(Circle((centre[0], centre[1]), radius, label=label, gid="gear", **pitch))
        mark = centre + radius * np.array([[0.55], [1.0]]) * np.array([math.cos(angle), math.sin(angle)])
        ax.plot(*mark.T, color="0.45", lw=2.2)
    ring = np.concatenate([where.cranks, where.cranks[:1]])
    ax.plot(*ring.T, color=style.GREY, lw=4.0, alpha=0.6, label="carrier, crank 0 filled", zorder=1)
    ax.plot(*where.cranks[:1].T, "o", color=style.BLACK, ms=6)
    ax.plot(*where.cranks[1:].T, "o", color=style.BLACK, mfc="white", ms=6)


def _arrows(ax: Axes, at: Array, vectors: Array, *, colour: str, hollow: bool = False, gid: str) -> None:
    """Arrows in data units, so that their lengths are to scale; hollow ones are told apart in grey too."""
    x, y = at.reshape(-1, 2).T
    u, v = vectors.reshape(-1, 2).T
    size = np.hypot(u, v)
    seen = size > _LEAST * size.max(initial=0.0)
    look: dict[str, Any] = {**(_HOLLOW if hollow else _FULL), "facecolor": "white" if hollow else colour}
    to_scale: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1, "units": "inches", "minlength": 0}
    ax.quiver(x[seen], y[seen], u[seen], v[seen], edgecolor=colour, gid=gid, **to_scale, **look)


def _finish(ax: Axes, title: Sequence[str], key: Sequence[str]) -> Axes:
    """Equal aspect, units, title, and a legend with what is told."""
    ax.margins(0.04)
    return labelled(ax, *title, x="x, mm", y="y, mm", aspect="equal", legend="beside", legend_title="\n".join(key))
