"""Plot of a torsion curve: turn of the output over the torque on it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.statics.rigidity import TorsionCurve
from rverror.views.plots.figure import BLACK, BLUE, DASHED, VERMILLION, axes_for, in_shown_unit, legend_below

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_PERCENT = 3.0  # of the rated torque, at which makers read the lost motion


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
    lost = None if rated is None else _lost_motion(torque, mean, units.to_core(rated, "torque") * _PERCENT / 100)
    ax = axes_for(ax, height=3.8)
    shown = in_shown_unit(torque, "torque")
    for sign, colour, mark, word in ((-1, VERMILLION, "s", "clockwise"), (1, BLUE, "o", "counter-clockwise")):
        at = np.sign(torque) == sign
        if not at.any():
            continue
        if angle.shape[1] > 1:
            ax.fill_between(shown[at], angle[at].min(axis=1), angle[at].max(axis=1), color=colour, alpha=0.25, lw=0)
        dashes = "solid" if sign > 0 else DASHED
        ax.plot(shown[at], mean[at], color=colour, ls=dashes, marker=mark, ms=4, lw=1.2, label=f"torque {word}")
    if (torque == 0).any():
        ax.plot([0.0], [0.0], "o", color=BLACK, mfc="white", ms=5, label="no torque: middle of the play")
    ax.axhline(0, color=BLACK, lw=0.4)
    ax.axvline(0, color=BLACK, lw=0.4)
    if lost is not None:
        where, low, high = lost
        at_ends = in_shown_unit(np.array([-where, where]), "torque")
        ax.plot(at_ends, [low, high], "D", color=BLACK, ms=4, label=f"lost motion at +-3 %: {high - low:.3g} arcsec")
    held = f", mean and range over {angle.shape[1]} angles" if angle.shape[1] > 1 else ""
    ax.set(xlabel="torque on the output, N*m", ylabel="turn of the output, arcsec", title=f"torsion, input held{held}")
    legend_below(ax, columns=2)
    return ax


def _lost_motion(torque: Array, angle: Array, where: float) -> tuple[float, float, float]:
    """The torque, and the curve on both sides of it, each read on its own branch."""
    ends = []
    for sign in (-1.0, 1.0):
        branch = np.sign(torque) == sign
        if not branch.any() or not torque[branch].min() <= sign * where <= torque[branch].max():
            raise InputError(
                f"the curve holds no torques on both sides of {sign * where / 1e3:g} N*m, {_PERCENT:g} % of the rated "
                "torque; compute it for more torques"
            )
        ends.append(float(np.interp(sign * where, torque[branch], angle[branch])))
    return where, ends[0], ends[1]
