"""Drawing of a natural mode: the mechanism as it stands, and as far as the mode moves it."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.base.numbers import way, with_unit
from rverror.dynamics.natural_modes import Modes
from rverror.geartrain.action_line import Contacts
from rverror.geartrain.contacts import pose
from rverror.geartrain.mechanism import Reducer
from rverror.views.plots import style
from rverror.views.plots.figure import Axes, axes_for, legend_beside, plain
from rverror.views.plots.mechanism_view import Places, draw_parts, places

_SHOWN = 0.12  # of the pin circle's radius: the farthest that anything is drawn from where it stands
_NOTHING = 1e-9  # of the most that any part turns: a shaft that turns by less stands still
_MOST_NAMED = 3  # parts, and contacts, that a mode's energies are told of


def mode_shape(modes: Modes, *, mode: int | None = None, ax: Axes | None = None) -> Axes:
    """Draw one natural mode on the mechanism: at rest thin and grey, moved as `mechanism` draws it.

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
    The motion is magnified, to first order: what turns much grows a little.  Angles of input and load, which have no
    place in the plane, are told beside those of sun and carrier.
    """
    ax = axes_for(ax, width=9.0, height=7.2)
    count = modes.frequency.size
    own = np.flatnonzero((modes.frequency > 0) & ~modes.of_sun_support)
    chosen = 1 + int(own[0] if own.size else 0) if mode is None else mode
    if not 1 <= chosen <= count:
        raise InputError(f"mode = {mode}: this reducer has modes 1 to {count}, from the lowest frequency up")
    unit = modes.model.mechanism
    assert isinstance(unit, Reducer)
    motion = pose(unit, [modes.theta + modes.model.index_offset], direction=modes.direction)
    assert isinstance(motion, Contacts)
    rest = places(motion)
    shape = {part: rows[:, chosen - 1] for part, rows in modes.shape.items()}
    scale = _SHOWN * unit.pin_circle_radius / _farthest(unit, rest, shape)
    for number, line in enumerate((*rest.outline, np.concatenate([rest.cranks, rest.cranks[:1]]).T)):
        label = "at rest" if number == 0 else None
        ax.plot(*line, color=style.GREY, lw=0.6, zorder=0.5, label=label, gid="at rest")
    round_ = np.linspace(0, 2 * np.pi, 181)
    for centres, radius, angles in (
        (rest.sun[None], unit.sun_pitch_radius, rest.turned["sun"]),
        (rest.cranks, unit.planet_pitch_radius, rest.turned["planet"]),
    ):
        for centre, angle in zip(centres, angles, strict=True):
            mark = np.array([[0.55], [1.0]]) * np.array([math.cos(angle), math.sin(angle)])
            for drawn in (np.array([np.cos(round_), np.sin(round_)]), mark.T):
                ax.plot(*(centre[:, None] + radius * drawn), color=style.GREY, lw=0.6, zorder=0.5, gid="at rest")
    draw_parts(ax, unit, rest.moved(shape, scale), range(unit.discs))
    reach = unit.pin_circle_radius + 2.5 * unit.pin_radius
    lines = _told(modes, chosen - 1, shape, scale)
    step = 0.11 * reach
    for number, text in enumerate(lines):
        ax.text(-reach, -reach - (number + 0.8) * step, text, va="center", fontsize="small")
    bottom = -reach - (len(lines) + 0.6) * step
    ax.set_aspect("equal")
    ax.set(xlabel="x, mm", ylabel="y, mm", xlim=(-1.06 * reach, 1.06 * reach), ylim=(bottom, 1.06 * reach))
    legend_beside(ax)
    frequency = float(modes.frequency[chosen - 1])
    name = plain(modes.model.name or unit.name)
    of_sun = ", of the sun's support" if modes.of_sun_support[chosen - 1] else ""
    where = f"{with_unit(modes.torque, 'torque')}, {way(modes.direction)}, at {math.degrees(modes.theta):.4g} deg"
    ax.set_title(f"{name}, mode {chosen} of {count}, {frequency:.4g} Hz{of_sun}\n{where}")
    return ax


def _farthest(unit: Reducer, rest: Places, shape: Mapping[str, Array]) -> float:
    """How far the farthest of what is drawn moves, mm per unit of the mode."""
    moved = rest.moved(shape, 1.0)
    marks = [(unit.sun_pitch_radius, "sun"), (unit.planet_pitch_radius, "planet")]
    turns = [float(np.abs(radius * (moved.turned[name] - rest.turned[name])).max()) for radius, name in marks]
    steps = [
        np.abs(moved.outline - rest.outline).max(),
        np.abs(moved.cranks - rest.cranks).max(),
        np.abs(moved.sun - rest.sun).max(),
        np.abs(moved.contact["carrier"] - rest.contact["carrier"]).max(),
    ]
    # a motion of input or load alone has nothing that could be drawn
    return max(*turns, *(float(one) for one in steps), 1e-12)


def _told(modes: Modes, at: int, shape: Mapping[str, Array], scale: float) -> list[str]:
    """Scale, angles of the shafts beside one another, and what holds and what moves."""
    shafts = {name: float(shape[name][-1]) for name in ("input", "sun", "carrier", "load") if name in shape}
    if len(shape["sun"]) == 2:  # its angle is held
        del shafts["sun"]
    largest = max((abs(value) for value in shafts.values()), default=0.0)
    turned = _NOTHING * max(abs(float(rows[-1])) for rows in shape.values())  # by rounding, where only cranks turn
    beside = shafts.items() if len(shafts) > 1 and largest > turned else ()
    angles = ", ".join(f"{name} {value / largest:+.2g}" for name, value in beside)
    found = [f"moved {scale:.3g} times its size at a modal mass of 1 kg"]
    if angles:
        found.append(f"angles beside one another: {angles}")
    for what, shares in (("held by", modes.strain_energy), ("moving", modes.kinetic_energy)):
        leading = sorted(((float(row[at]), name) for name, row in shares.items()), reverse=True)[:_MOST_NAMED]
        named = [f"{name.replace('_', ' ')} {100 * share:.0f} %" for share, name in leading if share >= 0.01]
        if named:
            found.append(f"{what}: {', '.join(named)}")
    return found
