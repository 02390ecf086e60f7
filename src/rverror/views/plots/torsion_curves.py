"""Plots of a torsion curve and of its loop: turn of the output over the torque on it."""

from __future__ import annotations

from typing import Any

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.statics.friction import Hysteresis
from rverror.statics.rigidity import TorsionCurve, on_its_branch
from rverror.views.plots import style
from rverror.views.plots.figure import Axes, axes_for, in_shown_unit, legend_below

_PERCENT = 3.0  # of the rated torque, at which makers read the lost motion
_ABOUT = 4.0  # times that torque, to which the inset of a loop reaches


def torsion(curve: TorsionCurve, *, rated: float | str | None = None, ax: Axes | None = None) -> Axes:
    """Turn of the output over the torque on it, mean of the angles at which the input was held, and its spread.

    The branches of either sense are drawn apart: between them lies the play, which torques other than zero do not show.

    Parameters
    ----------
    curve : TorsionCurve
    rated : float or str or quantity, optional
        Rated torque, N*mm: marks the lost motion between +-3 % of it.

    Raises
    ------
    InputError
        If the curve does not reach +-3 % of the rated torque.
    """
    order = np.argsort(curve.torque, kind="stable")
    torque, angle = curve.torque[order], in_shown_unit(curve.angle[order], "angle")
    mean = angle.mean(axis=1)
    lost = _lost_motion(torque, mean, rated)
    ax = axes_for(ax, height=3.8)
    shown = in_shown_unit(torque, "torque")
    for sign, colour, mark, word in (
        (-1, style.VERMILLION, "s", "clockwise"),
        (1, style.BLUE, "o", "counter-clockwise"),
    ):
        at = np.sign(torque) == sign
        if not at.any():
            continue
        if angle.shape[1] > 1:
            ax.fill_between(shown[at], angle[at].min(axis=1), angle[at].max(axis=1), color=colour, alpha=0.25, lw=0)
        dashes = "solid" if sign > 0 else style.DASHED
        ax.plot(shown[at], mean[at], color=colour, ls=dashes, marker=mark, ms=4, lw=1.2, label=f"torque {word}")
    if (torque == 0).any():
        ax.plot([0.0], [0.0], "o", color=style.BLACK, mfc="white", ms=5, label="no torque: middle of the play")
    ax.axhline(0, color=style.BLACK, lw=0.4)
    ax.axvline(0, color=style.BLACK, lw=0.4)
    _finish(ax, "torsion", lost, f"mean and range over {angle.shape[1]} angles" if angle.shape[1] > 1 else "")
    return ax


def loop(found: Hysteresis, *, rated: float | str | None = None, ax: Axes | None = None) -> Axes:
    """Turn of the output as the torque rises and as it falls, mean of the angles at which the input was held.

    Parameters
    ----------
    found : Hysteresis
    rated : float or str or quantity, optional
        Rated torque, N*mm: marks the lost motion between +-3 % of it, at the midpoints of the loop's width.

    Raises
    ------
    InputError
        If the loop does not reach +-3 % of the rated torque.

    Notes
    -----
    Windup at the rated torque is many times the loop's width, so that an inset shows what lies about the lost motion.
    """
    order = np.argsort(found.torque, kind="stable")
    torque = found.torque[order]
    rising, falling = (in_shown_unit(branch[order].mean(axis=1), "angle") for branch in (found.rising, found.falling))
    lost = _lost_motion(torque, (rising + falling) / 2, rated)
    ax = axes_for(ax, height=5.0)
    shown = in_shown_unit(torque, "torque")
    _branches(ax, shown, rising=rising, falling=falling)
    angles = found.rising.shape[1]
    _finish(ax, "loop of the torsion curve", lost, f"mean over {angles} angles" if angles > 1 else "")
    if lost is not None:
        near = ax.inset_axes((0.58, 0.1, 0.4, 0.42))
        _branches(near, shown, rising=rising, falling=falling)
        _mark(near, lost)
        reach = _ABOUT * float(in_shown_unit(np.array([lost[0]]), "torque")[0])
        inside = np.abs(shown) <= reach
        near.set(xlim=(-reach, reach), ylim=(rising[inside].min(), falling[inside].max()))
        near.tick_params(labelsize="x-small")
        ax.indicate_inset_zoom(near)
    return ax


def _branches(ax: Axes, torque: Array, *, rising: Array, falling: Array) -> None:
    ax.fill_between(torque, rising, falling, color=style.GREY, alpha=0.3, lw=0)
    ax.plot(torque, rising, color=style.BLUE, marker="o", ms=3, lw=1.2, label="torque rises")
    ax.plot(torque, falling, color=style.VERMILLION, ls=style.DASHED, marker="s", ms=3, lw=1.2, label="torque falls")
    ax.axhline(0, color=style.BLACK, lw=0.4)
    ax.axvline(0, color=style.BLACK, lw=0.4)


def _finish(ax: Axes, what: str, lost: tuple[float, float, float] | None, held: str) -> None:
    """The lost motion where it is asked for, and words."""
    if lost is not None:
        _mark(ax, lost)
    ax.set(xlabel="torque on the output, N*m", ylabel="turn of the output, arcsec")
    ax.set_title(", ".join(text for text in (what, "input held", held) if text))
    legend_below(ax, columns=2)


def _mark(ax: Axes, lost: tuple[float, float, float]) -> None:
    where, low, high = lost
    at_ends = in_shown_unit(np.array([-where, where]), "torque")
    label = f"lost motion at +-{_PERCENT:g} %: {high - low:.3g} arcsec"
    ax.plot(at_ends, [low, high], "D", color=style.BLACK, ms=4, label=label)


def _lost_motion(torque: Array, angle: Array, rated: Any) -> tuple[float, float, float] | None:
    """The torque, and the curve on both sides of it, each read on its own branch; none where no torque is rated."""
    if rated is None:
        return None
    where, ends = units.to_core(rated, "torque") * _PERCENT / 100, []
    for end in (-where, where):
        try:
            ends.append(float(on_its_branch(torque, angle, end)))
        except ValueError as problem:
            raise InputError(
                f"the curve holds no torques on both sides of {end / 1e3:g} N*m, {_PERCENT:g} % of the rated "
                "torque; compute it for more torques"
            ) from problem
    return where, ends[0], ends[1]
