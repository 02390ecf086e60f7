"""Plots of the output error against speed: amplitudes by order, Campbell diagram, map of orders over speed."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.base.numbers import way, with_unit
from rverror.dynamics.at_speed import CriticalSpeed, SpeedResponse
from rverror.views.plots.figure import (
    BLACK,
    GREY,
    ORDER,
    axes_for,
    check_axes,
    in_shown_unit,
    legend_beside,
    line_style,
    shown_unit,
    span_of,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SPEED = "input speed, rpm"
_MOST = 12  # orders whose lines are told apart
_DECADES = 3.0  # of the colours, down from the largest


def speed_amplitudes(response: SpeedResponse, *, most: int = 5, ax: Axes | None = None) -> Axes:
    """Amplitude of the largest orders over the input speed, their peaks marked.

    Parameters
    ----------
    response : SpeedResponse
    most : int
        So many orders are drawn, those that are largest at some speed; the title says of how many.
    """
    check_axes(ax)
    leading = _leading(response, most)
    ax = axes_for(ax, height=4.2)
    speed = in_shown_unit(response.speed, "angular_speed")
    size = in_shown_unit(np.abs(response.waves), "angle")
    for number, at in enumerate(leading):
        ax.plot(speed, size[:, at], label=_named(response.order[at]), **line_style(number))
    _mark_critical(ax, response, leading, lambda one: float(in_shown_unit(np.array(one.amplitude), "angle")))
    ax.set(xlabel=_SPEED, ylabel=f"amplitude, {shown_unit('angle')}", title=_title("error by order", response, leading))
    ax.set_ylim(bottom=0)
    legend_beside(ax)
    return ax


def _mark_critical(
    ax: Axes, response: SpeedResponse, leading: npt.NDArray[np.intp], height: Callable[[CriticalSpeed], float]
) -> None:
    """Ring the critical speeds of the orders that are drawn."""
    peaks = [one for one in response.critical_speeds if one.order in response.order[leading]]
    if peaks:
        places = in_shown_unit(np.array([one.speed for one in peaks]), "angular_speed")
        heights = [height(one) for one in peaks]
        ax.plot(places, heights, "o", color=BLACK, markerfacecolor="none", label="critical")


def campbell(response: SpeedResponse, *, most: int = 5, ax: Axes | None = None) -> Axes:
    """Frequencies that the largest orders drive over the input speed, against the natural ones; critical speeds marked.

    Parameters
    ----------
    response : SpeedResponse
    most : int
        So many orders are drawn, those that are largest at some speed; the title says of how many.
    """
    check_axes(ax)
    leading = _leading(response, most)
    ax = axes_for(ax, height=4.2)
    last = float(in_shown_unit(response.speed.max(), "angular_speed"))
    hertz = response.speed.max() / (2 * np.pi * response.ratio)
    for number, at in enumerate(leading):
        ax.plot([0, last], [0, response.order[at] * hertz], label=_named(response.order[at]), **line_style(number))
    top = 1.15 * float(response.order[leading].max()) * hertz
    natural = response.frequency[response.frequency > 0]
    if natural.size:  # how far away the first one is, is what a diagram without crossings says
        top = max(top, 1.1 * float(natural.min()))
    low = response.frequency <= top
    for of_sun, label, colour in ((False, "natural frequency", BLACK), (True, "of the sun's support", GREY)):
        shown = response.frequency[low & (response.of_sun_support == of_sun)]
        if shown.size:
            ax.hlines(shown, 0, last, label=label, colors=colour, linewidth=0.8)
    _mark_critical(ax, response, leading, lambda one: one.order * one.speed / (2 * np.pi * response.ratio))
    ax.set(xlabel=_SPEED, ylabel="frequency, Hz", title=_title("Campbell diagram", response, leading))
    ax.set(xlim=(0, max(last, 1e-9)), ylim=(0, max(top, 1e-9)))
    legend_beside(ax)
    return ax


def speed_map(response: SpeedResponse, *, highest: float = 260.0, ax: Axes | None = None) -> Axes:
    """Amplitude against order and input speed.

    Parameters
    ----------
    response : SpeedResponse
    highest : float
        Highest order to show.
    ax : Axes, optional
        The colour bar takes its place from it.
    """
    ax = axes_for(ax, height=4.2)
    from matplotlib.colors import LogNorm

    count = response.theta.size
    every = np.arange(1, count // 2 + 1) / response.period
    shown = every <= highest
    waves = 2 * np.fft.rfft(response.transmission_error)[:, 1:][:, shown] / count
    size = in_shown_unit(np.abs(waves), "angle")
    largest = span_of(float(size.max(initial=0.0)))
    step = 1 / response.period
    orders = np.append(every[shown], every[shown][-1] + step) - step / 2
    speeds = _edges(in_shown_unit(response.speed, "angular_speed"))
    # of even lightness, large is dark: the same order in grey and for colour-blind eyes
    least = largest / 10**_DECADES
    scale = LogNorm(least, largest)
    drawn = ax.pcolormesh(speeds, orders, np.maximum(size, least).T, norm=scale, cmap="YlGnBu", rasterized=True)
    ax.set(xlabel=_SPEED, ylabel=ORDER, title=_title("orders over speed", response))
    ax.figure.colorbar(drawn, ax=ax, label=f"amplitude, {shown_unit('angle')}", extend="min")
    return ax


def _edges(speeds: Array) -> Array:
    """Where the column of each speed begins and ends: halfway to its neighbours."""
    if speeds.size == 1:
        return np.array([speeds[0] - 0.5, speeds[0] + 0.5])
    middle = (speeds[1:] + speeds[:-1]) / 2
    return np.concatenate([[2 * speeds[0] - middle[0]], middle, [2 * speeds[-1] - middle[-1]]])


def _leading(response: SpeedResponse, most: int) -> npt.NDArray[np.intp]:
    """Places of the largest orders, from the lowest order up."""
    if not 1 <= most <= _MOST:
        raise InputError(f"most = {most}: must be 1 to {_MOST} orders, more are not told apart")
    if not response.order.size:
        raise InputError("the error has no order: no part errs, and nothing is drawn")
    size = np.abs(np.vstack([response.crawl_waves, response.waves])).max(axis=0)
    return np.sort(np.argsort(-size, kind="stable")[:most])


def _named(order: float) -> str:
    return f"order {order:.6g}"


def _title(what: str, response: SpeedResponse, leading: npt.NDArray[np.intp] | None = None) -> str:
    parts = [what, with_unit(response.torque, "torque"), way(response.direction)]
    if leading is not None and leading.size < response.order.size:
        parts.append(f"the largest {leading.size} of {response.order.size} orders")
    return ", ".join(parts)
