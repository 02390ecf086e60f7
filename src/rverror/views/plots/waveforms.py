"""Plots of the transmission error over the output angle: of models by source, stacked, polar; of runs and states.

Options that are not described here mean what `drawing.draw` says of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.directions import Direction
from rverror.base.errors import InputError
from rverror.base.numbers import brief, way
from rverror.base.text import describe, file_name
from rverror.geartrain.kinematics import true_period, whole_turn
from rverror.geartrain.mechanism import Drive, Reducer
from rverror.model.catalogue import source
from rverror.model.compose import transmission_error_by_effect
from rverror.model.effects import Model
from rverror.model.results import Equilibrium, Influence
from rverror.runs.measurement import Run
from rverror.views.plots import style
from rverror.views.plots.figure import NOTHING, Axes, axes_for, for_drawing, lines, span_of
from rverror.views.plots.labels import OUTPUT_ANGLE, labelled, over_angle, plain, signal_label, stated
from rverror.views.shown_units import ANGLE, unit_of

#: Turns of a drive that repeats later than after one, up to which all of them are drawn.
MOST_TURNS = 16
_TURN = 2 * np.pi
_HATCH = (0.0, 0.0, 0.0, 0.5)
_ORIGIN = 4.0  # centre of polar axes, of their span either side of the base circle below it
_FLATTENED = 2.0  # times the largest wave, that lines with their constants span


@dataclass(frozen=True)
class Parts:
    """Transmission error of a model by effect, arcsec: `theta` (n,) rad, `rows` (lines, n) and a name for each."""

    theta: Array
    rows: Array
    names: tuple[str, ...]

    def largest(self, most: int) -> Parts:
        """The largest rows, the sum of the others as one more."""
        if len(self.names) <= most:
            return self
        order = np.argsort(-np.abs(self.rows).max(axis=1), kind="stable")
        kept, others = np.sort(order[:most]), order[most:]
        rows = np.concatenate([self.rows[kept], self.rows[others].sum(axis=0, keepdims=True)])
        rest = "the other one" if others.size == 1 else f"sum of the {others.size} others"
        return Parts(self.theta, rows, (*(self.names[i] for i in kept), rest))


def parts_of(model: Model, theta: Any | None, **motion: Any) -> Parts:
    """Transmission error of a model by effect, in closed form, over a whole turn where no angles are given."""
    angle = whole_turn(model.mechanism) if theta is None else units.to_core_array(theta, "angle")
    rows = transmission_error_by_effect(model, angle, **motion)
    names = tuple(plain(describe(effect.key, effect.indices)) for effect in model.effects)
    return Parts(angle, ANGLE.of(rows), names)


# --- models -----------------------------------------------------------------------------------------------------------


def model_waveform(
    model: Model,
    *,
    theta: Any = None,
    direction: Direction = "forward",
    time: Any = None,
    torque: Any = None,
    most: int = 6,
    waves: int = 12,
    ax: Axes | None = None,
) -> Axes:
    """Transmission error of a model over one turn by effect and in total, closed form.

    Parameters
    ----------
    model : Model
    theta, direction, time, torque : optional
        As in `draw`.
    most : int
        Effects that get a line of their own, the largest; the sum of the others is one more.
    waves : int
        Where no angles are given, only so many waves of the strongest order are drawn, a whole turn at the most.

    Raises
    ------
    ValueError
        If an effect needs a time or a torque that is not given.
    """
    ax = axes_for(ax)
    drawn, label = _drawn(model, theta, most, waves, direction=direction, time=time, torque=torque)
    angle = np.degrees(drawn.theta)
    lines(ax, angle, zip(drawn.names, drawn.rows, strict=True), lw=0.9)
    ax.plot(*for_drawing(angle, drawn.rows.sum(axis=0)), color=style.BLACK, lw=1.3, label="total")
    title = stated(model, torque=torque, direction=direction)
    return over_angle(ax, *title, "closed form", y=label, legend="beside")


def stacked(
    model: Model,
    *,
    theta: Any = None,
    direction: Direction = "forward",
    time: Any = None,
    torque: Any = None,
    most: int = 5,
    waves: int = 6,
    ax: Axes | None = None,
) -> Axes:
    """Transmission error of a model by effect, each on top of those before it; the last edge is the total.

    An effect that is negative at an angle takes its height off there.  Its options are those of `model_waveform`.
    """
    ax = axes_for(ax, height=3.8)
    drawn, label = _drawn(model, theta, most, waves, direction=direction, time=time, torque=torque)
    whole = np.concatenate([np.zeros((1, drawn.theta.size)), np.cumsum(drawn.rows, axis=0)])
    angle, *edges = for_drawing(np.degrees(drawn.theta), *whole)
    for i, name in enumerate(drawn.names):
        look = style.fill_style(i)
        ax.fill_between(angle, edges[i], edges[i + 1], lw=0.0, alpha=0.55, edgecolor=_HATCH, label=name, **look)
        ax.plot(angle, edges[i + 1], color=style.BLACK, lw=0.5)
    ax.axhline(0, color=style.BLACK, lw=0.5)
    ax.plot(angle, edges[-1], color=style.BLACK, lw=1.6, label="total")
    title = stated(model, torque=torque, direction=direction)
    return over_angle(ax, *title, "closed form", y=label, legend="beside")


def _drawn(model: Model, theta: Any, most: int, waves: int, **motion: Any) -> tuple[Parts, str]:
    """The largest effects at the angles given, or over a few waves of the strongest order; label of the ordinate.

    The ordinate shows all of the error, or what constants leave.
    """
    parts = parts_of(model, theta, **motion)
    shown = (_first_waves(parts, waves) if theta is None else parts).largest(most)
    drawn = about_constants(shown)
    about = "" if drawn is shown else f" about {float(shown.rows.sum(axis=0).mean()):+.4g}"
    return drawn, signal_label("angle", about)


def about_constants(parts: Parts) -> Parts:
    """Rows without their constants, which their names then state, where these would flatten the waves.

    They do where all lines together span more than twice what the largest of them spans, so that no wave has half of
    the height.
    """
    if not parts.names:
        return parts
    drawn = np.concatenate([parts.rows, parts.rows.sum(axis=0, keepdims=True)])
    largest = float(np.ptp(drawn, axis=1).max())
    if largest <= NOTHING or float(np.ptp(drawn)) <= _FLATTENED * largest:
        return parts
    constants = parts.rows.mean(axis=1)
    offsets = [f", about {at:+.4g}" if abs(at) > NOTHING else "" for at in constants]
    names = tuple(name + about for name, about in zip(parts.names, offsets, strict=True))
    return Parts(parts.theta, parts.rows - constants[:, None], names)


def _first_waves(parts: Parts, waves: int) -> Parts:
    """As much of a turn as holds a few waves of the strongest order."""
    total = parts.rows.sum(axis=0)
    waves_of = np.abs(np.fft.rfft(total))[1:]
    if not parts.names or waves_of.max() <= 1e-9 * total.size * (np.abs(total).max() or 1.0):
        return parts
    order = 1 + int(np.argmax(waves_of))
    kept = min(-(-waves * total.size // order) + 1, total.size)
    return Parts(parts.theta[:kept], parts.rows[:, :kept], parts.names)


def model_polar(
    model: Model,
    *,
    theta: Any = None,
    direction: Direction = "forward",
    time: Any = None,
    torque: Any = None,
    ax: Axes | None = None,
) -> Axes:
    """Total transmission error of a model over the output angle, about a circle that stands for its mean.

    A drive that repeats after some turns is drawn over all of them.
    """
    turns = true_period(model.mechanism)
    if theta is None and 1 < turns <= MOST_TURNS:
        theta = np.concatenate([whole_turn(model.mechanism) + _TURN * turn for turn in range(turns)])
    parts = parts_of(model, theta, direction=direction, time=time, torque=torque)
    ax = axes_for(ax, projection="polar", width=6.0, height=6.0)
    total = parts.rows.sum(axis=0)
    mean = float(total.mean())
    reach = 1.05 * span_of(float(np.abs(total - mean).max()))
    ax.plot(*for_drawing(parts.theta, total - mean), lw=0.9, color=style.BLUE, label="total")
    circle = np.linspace(0, _TURN, 361)
    base = f"base circle: mean, {brief(mean, 4)} {ANGLE.shown}"
    ax.plot(circle, np.zeros_like(circle), color=style.BLACK, lw=1.0, ls=style.DASHED, label=base)
    ax.set_rlim(-reach, reach)  # type: ignore[attr-defined]
    ends = [-reach, 0.0, reach]
    ax.set_rticks(ends, [brief(end, 2) for end in ends])  # type: ignore[attr-defined]
    ax.set_rorigin(-_ORIGIN * reach)  # type: ignore[attr-defined]
    title = stated(model, torque=torque, direction=direction)
    outwards = signal_label("angle", " above its mean")
    labelled(ax, *title, "closed form", x=OUTPUT_ANGLE, y=f"outwards: {outwards}")
    ax.yaxis.labelpad = 30
    return ax


# --- runs -------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Signal:
    """Signal of a run in one direction: `theta` rad, `values` of `quantity` as drawn, and where passes begin."""

    theta: Array
    values: Array
    direction: float
    quantity: str
    breaks: npt.NDArray[np.intp]


def signals_of(run: Run, ratio: Reducer | Drive | Model | float | None) -> list[Signal]:
    """What a run holds, one part for each direction: transmission error, or torque where it is a torque record.

    Raises
    ------
    InputError
        If the ratio is needed and missing, or contradicts the run.
    """
    if ratio is None and run.input_angle is not None:
        raise InputError(
            f"{run.path or 'run'}: it holds input angles, and a run file no ratio; give ratio=, the model or the input "
            "turns per output turn"
        )
    used = 1.0 if ratio is None else ratio
    theta = run.nominal_angle(used)
    torque = run.torque_record
    if torque is not None and (run.output_angle is None or run.input_angle is None) and run.te_column is None:
        values, quantity = torque, "torque"
    else:
        values, quantity = run.error(used), "angle"
    values = unit_of(quantity).of(values)
    parts = ((np.flatnonzero(run.direction == sense), sense) for sense in (1.0, -1.0))
    known = ((at, sense, np.flatnonzero(np.diff(at) > 1) + 1) for at, sense in parts if at.size)
    return [Signal(theta[at], values[at], sense, quantity, breaks) for at, sense, breaks in known]


def run_title(run: Run, ratio: Reducer | Drive | Model | float | None, signals: Sequence[Signal]) -> list[str]:
    """Unit where it is known, short name, torque and directions of a run."""
    directions = [signal.direction for signal in signals]
    load = run.torque if run.load_column is None else run.load_column
    return [*stated(ratio), plain(file_name(run.path) or "run"), *stated(torque=load, direction=directions)]


def run_waveform(run: Run, *, ratio: Reducer | Drive | Model | float | None = None, ax: Axes | None = None) -> Axes:
    """Transmission error of a run, or its torque, over the nominal output angle, its offset left in."""
    signals = signals_of(run, ratio)
    ax = axes_for(ax)
    for number, part in enumerate(signals):
        # a gap where a pass ended and another began
        drawn = for_drawing(*(np.insert(row, part.breaks, np.nan) for row in (np.degrees(part.theta), part.values)))
        ax.plot(*drawn, lw=0.9, label=way(part.direction), **style.line_style(number))
    ax.ticklabel_format(axis="y", style="plain", useOffset=False)
    return over_angle(ax, *run_title(run, ratio, signals), y=signal_label(signals[0].quantity))


# --- loaded states ----------------------------------------------------------------------------------------------------


def state_waveform(state: Equilibrium, *, ax: Axes | None = None) -> Axes:
    """Transmission error of a loaded state."""
    values = ANGLE.of(state.transmission_error)
    ax = axes_for(ax)
    ax.plot(*for_drawing(np.degrees(state.theta), values), color=style.BLUE, lw=1.0)
    return over_angle(ax, *state_title(state), y=signal_label("angle"), legend="")


def state_title(state: Equilibrium) -> list[str]:
    """Unit, load and direction of a loaded state."""
    where = state.conditions
    assert where is not None  # as `equilibrium` gives it
    load = where.torque if where.load is None else where.load
    return [*stated(state.model, torque=load, direction=where.direction), "loaded equilibrium"]


# --- influences -------------------------------------------------------------------------------------------------------


def influence_waveform(found: Influence, *, ax: Axes | None = None) -> Axes:
    """Influence of each parameter of a source on the output."""
    unit = unit_of(source(found.key).parameters[0].dimension)
    rows = ANGLE.of(found.matrix) * unit.size
    ax = axes_for(ax)
    lines(ax, np.degrees(found.theta), zip(found.labels, rows, strict=True), lw=1.1)
    if np.abs(rows).max(initial=0.0) <= NOTHING:
        ax.set_ylim(-1, 1)  # rounding is nothing to be seen
    return over_angle(ax, plain(found.key), y=f"influence, {ANGLE.shown} per {unit.shown}")
