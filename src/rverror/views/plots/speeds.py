"""Plots of the output error at speed: Campbell diagram, map of orders over speed, run-up."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.base.numbers import with_unit
from rverror.dynamics.at_speed import SpeedResponse
from rverror.dynamics.running_up import RunUp
from rverror.runs.spectrum import frames_of_order
from rverror.views.by_order import short_frame
from rverror.views.plots import style
from rverror.views.plots.figure import Axes, axes_for, for_drawing, heat_map, lines
from rverror.views.plots.labels import ORDER, labelled, plain, stated
from rverror.views.shown_units import ANGLE, SPEED

_SPEED = "input speed, rpm"
_MOST = 12  # orders whose lines are told apart
_LARGEST = 5  # orders that are drawn where no number is given
_BEYOND = 1.05  # times the highest of these, up to which a map is drawn
_ROWS = 260  # of a map that can be told apart
_APART = 0.045  # of what an axis shows, between texts
_LINE = 10.0  # points, of small text


def campbell(response: SpeedResponse, *, most: int = _LARGEST, ax: Axes | None = None) -> Axes:
    """Frequencies that the largest orders drive over the input speed, against the natural ones; crossings named.

    Parameters
    ----------
    response : SpeedResponse
    most : int
        So many orders are drawn, those that are largest at some speed; the title says of how many.

    Notes
    -----
    Lines are named by order and frames.  Beside the diagram stand the frequencies of the modes, numbered from the
    lowest up, and of each numbered crossing mode, order and input speed; of more than a dozen those of the orders with
    the largest error.  A ring is a critical speed.
    """
    ax = axes_for(ax, height=4.8)
    leading = _leading(response, most)
    fastest = float(response.speed.max())
    last = SPEED.of(fastest)
    hertz = fastest / (2 * np.pi * response.ratio)
    for number, at in enumerate(leading):
        order = float(response.order[at])
        ax.plot([0, last], [0, order * hertz], label=_framed(response, order), **style.line_style(number))
    top = 1.15 * float(response.order[leading].max()) * hertz
    natural = response.frequency[response.frequency > 0]
    if natural.size:  # how far away the first one is, is what a diagram without crossings says
        top = max(top, 1.1 * float(natural.min()))
    low = response.frequency <= top
    for of_sun, label, colour, width in (
        (False, "natural frequency", style.BLACK, 0.8),
        (True, "of the sun's support", style.GREY, 1.6),
    ):
        shown = response.frequency[low & (response.of_sun_support == of_sun)]
        if shown.size:
            ax.hlines(shown, 0, last, label=label, colors=colour, linewidth=width)
    critical = [one for one in response.critical_speeds if one.order in response.order[leading]]
    if critical:
        speed, order = np.array([(one.speed, one.order) for one in critical]).T
        rings = SPEED.of(speed), order * speed / (2 * np.pi * response.ratio)
        ax.plot(*rings, "o", color=style.BLACK, mfc="none", label="critical")
    found = _crossings(response, leading, last, top)
    lines = [f"mode {mode + 1}: {response.frequency[mode]:.4g} Hz" for mode in np.flatnonzero(low)]
    lines += ["crossings: mode, order, rpm"] if found else []
    for number, (speed, frequency, mode, order) in enumerate(found, start=1):
        ax.plot([speed], [frequency], "s", color=style.BLACK, ms=3, gid="crossing")
        before = found[: number - 1]
        near = sum(speed - at < _APART * last and abs(frequency - of) < _APART * top for at, of, *_ in before)
        above = (-7, 3 + _LINE * near)  # neighbours stand above one another
        ax.annotate(str(number), (speed, frequency), xytext=above, textcoords="offset points", fontsize="x-small")
        lines.append(f"{number}: mode {mode}, order {order:.6g}, {speed:.0f}")
    return labelled(
        ax,
        *_title("Campbell diagram", response, leading),
        x=_SPEED,
        y="frequency, Hz",
        xlim=(0, max(last, 1e-9)),
        ylim=(0, max(top, 1e-9)),
        legend="beside",
        legend_title="\n".join(lines),
    )


def _framed(response: SpeedResponse, order: float) -> str:
    """An order with the frames whose errors it shows: the two of which it is the least multiple."""
    frames = sorted(
        (short_frame(frame) for frame in frames_of_order(response.reducer, order)),
        key=lambda frame: int(frame.rpartition(" x ")[2]) if " x " in frame else 1,
    )
    return f"order {order:.6g}" + (f": {', '.join(frames[:2])}" if frames else "")


def _crossings(
    response: SpeedResponse, leading: npt.NDArray[np.intp], last: float, top: float
) -> list[tuple[float, float, int, float]]:
    """Input speed, frequency, mode and order of crossings in the diagram, from the lowest speed up."""
    size, found = _largest(response), []
    for at in sorted(leading.tolist(), key=lambda at: -size[at]):
        order = float(response.order[at])
        for mode, frequency in enumerate(response.frequency.tolist()):
            speed = SPEED.of(frequency * 2 * np.pi * response.ratio / order)
            if 0 < speed <= last and frequency <= top:
                found.append((speed, frequency, mode + 1, order))
    return sorted(found[:_MOST])


def speed_map(response: SpeedResponse, *, highest: float | None = None, ax: Axes | None = None) -> Axes:
    """Amplitude against order and input speed; where orders lie too close to be seen, the largest of each cell.

    Parameters
    ----------
    response : SpeedResponse
    highest : float, optional
        Highest order to show; a little beyond the largest orders of the error where left out.
    ax : Axes, optional
        The colour bar takes its place from it.
    """
    if response.speed.size < 2:
        raise InputError("a map is drawn over the speed; give two input speeds or more")
    ax = axes_for(ax, height=4.2)
    count = response.theta.size
    every = np.arange(1, count // 2 + 1) / response.period
    if highest is None:
        largest = response.order[_leading(response, _LARGEST)] if response.order.size else np.array([math.inf])
        highest = _BEYOND * float(largest.max())
    some = every[every <= highest]
    sizes = np.abs(2 * np.fft.rfft(response.transmission_error)[:, 1 : some.size + 1] / count).T
    together = -(-some.size // _ROWS)
    starts = np.arange(0, some.size, together)
    size = ANGLE.of(np.maximum.reduceat(sizes, starts))
    of = f", largest of {together} orders" if together > 1 else ""
    heat_map(ax, [(SPEED.of(response.speed), some[starts], size)], label=f"amplitude, {ANGLE.shown}{of}")
    return labelled(ax, *_title("orders over speed", response), x=_SPEED, y=ORDER, legend="")


def _leading(response: SpeedResponse, most: int) -> npt.NDArray[np.intp]:
    """Places of the largest orders, from the lowest order up."""
    if not 1 <= most <= _MOST:
        raise InputError(f"most = {most}: must be 1 to {_MOST} orders, more are not told apart")
    if not response.order.size:
        raise InputError("the error has no order: no part errs, and nothing is drawn")
    return np.sort(np.argsort(-_largest(response), kind="stable")[:most])


def _largest(response: SpeedResponse) -> Array:
    """Largest amplitude of each order over the speeds."""
    sizes: Array = np.abs(np.vstack([response.crawl_waves, response.waves])).max(axis=0)
    return sizes


def _title(what: str, response: SpeedResponse, leading: npt.NDArray[np.intp] | None = None) -> list[str]:
    parts = [what, plain(response.reducer.name), *stated(torque=response.torque, direction=response.direction)]
    if leading is not None and leading.size < response.order.size:
        parts.append(f"the largest {leading.size} of {response.order.size} orders")
    return parts


def run_up_waveform(found: RunUp, *, ax: Axes | None = None) -> Axes:
    """Error over the time about its mean at a crawl, windup and vibration; grey where contacts would have to pull.

    Parameters
    ----------
    found : RunUp
    """
    ax = axes_for(ax, height=4.2)
    error = ANGLE.of(found.transmission_error - found.crawl.mean())
    ax.plot(*for_drawing(found.time, error), color=style.BLACK, lw=0.8, label="error")
    rest = (("vibration", ANGLE.of(found.vibration)), ("windup", ANGLE.of(found.windup)))
    lines(ax, found.time, rest, lw=1.2)
    pulls = found.output_torque < 0
    if pulls.any():
        across = ax.get_xaxis_transform()
        ax.fill_between(
            found.time, 0, 1, where=pulls, transform=across, color=style.GREY, alpha=0.4, label="contacts pull"
        )
    last = with_unit(float(found.speed[-1]), "angular_speed")
    title = f"run-up from {with_unit(float(found.speed[0]), 'angular_speed')} to {last}"
    return labelled(
        ax,
        title,
        *stated(torque=found.torque, direction=found.direction),
        x="time, s",
        y="transmission error, arcsec",
        xlim=(float(np.min(found.time)), float(np.max(found.time))),
        legend="beside",
    )
