"""Plots of a diagnosis and of a compensation: waveforms before and after, orders, candidates.

Options that are not described here mean what `drawing.draw` says of them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import scipy

from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.base.numbers import brief
from rverror.base.text import describe, file_name
from rverror.compensation.outcome import Compensation
from rverror.diagnosis.result import Diagnosis, Trace
from rverror.views.by_order import turns_of
from rverror.views.plots import style
from rverror.views.plots.figure import Axes, axes_for, axes_of_rows, for_drawing, parted
from rverror.views.plots.labels import ORDER, labelled, over_angle, plain, signal_label, stated
from rverror.views.plots.spectra import draw_lines, frame_name, lines_of
from rverror.views.shown_units import ANGLE, unit_of

_BEFORE, _AFTER = style.ORANGE, style.BLUE
_LOOKS = ((_BEFORE, style.DASHED, 1.2), (_AFTER, "solid", 0.9))
_BAND = 0.75  # of its colour, that the model's band has under what was measured
_HIGHEST = 260.0
_NEIGHBOURS = 25  # lines whose median tells what noise leaves
_MEDIAN = math.sqrt(math.log(2))  # of their rms: amplitudes of noise are Rayleigh's
_RANKED = 10  # candidates for which there is room
_DECADES = 30.0  # times the smallest difference of scores, beyond which their axis is logarithmic
_TICK_UP, _CARET_UP_BASE = 2, 10  # matplotlib's markers that stand on their point


def waveform(diagnosis: Diagnosis, *, run: int = 0, ax: Axes | None = None) -> Axes:
    """Measured against predicted error of one run over a turn, before and after.

    What was measured is the thin black line over the model's band, so a good fit does not hide it.  Marks on the axis
    tell where samples were set aside and where the reading slips.
    """
    trace = _trace(diagnosis, run)
    ax = axes_for(ax)
    rows = (unit_of(diagnosis.quantity).of(v) for v in (trace.measured, trace.before, trace.after))
    angle, measured, before, after = for_drawing(np.degrees(trace.theta), *rows)
    over: dict[str, Any] = {"color": style.BLACK, "lw": 0.7, "zorder": 2.5}
    ax.plot(angle, measured, label=", ".join(["measured", *_averaged(trace)]), **over)
    ax.plot(angle, before, color=_BEFORE, lw=1.2, ls=style.DASHED, label="declared model")
    if not np.allclose(trace.before, trace.after):
        ax.plot(angle, after, color=_AFTER, lw=2.4, alpha=_BAND, label="with what was added")
    _mark(ax, trace)
    return over_angle(ax, *_title(diagnosis, trace), y=signal_label(diagnosis.quantity))


def _averaged(trace: Trace) -> list[str]:
    """That a waveform over a whole turn is the mean of the revolutions; one over less is as measured."""
    turns = turns_of(np.sort(trace.theta))
    return ["mean of revolutions"] if turns == round(turns) else []


def _mark(ax: Axes, trace: Trace) -> None:
    """Marks on the axis where samples were set aside and where the reading slips.

    Where the waveform spans whole turns, angles of later turns are folded onto it; else those beyond its ends are not
    shown.
    """
    low, high, turns = float(trace.theta.min()), float(trace.theta.max()), turns_of(np.sort(trace.theta))
    for label, angles, marker, size, width in (
        ("sample set aside", trace.set_aside, _TICK_UP, 9.0, 1.2),
        ("slip of the reading", trace.slips, _CARET_UP_BASE, 7.0, 0.0),
    ):
        if angles is None:
            continue
        if turns == round(turns):
            shown = low + np.mod(angles - low, 2 * math.pi * turns)
        else:
            shown = angles[(angles >= low) & (angles <= high)]
        if shown.size:
            look: dict[str, Any] = {"marker": marker, "ms": size, "mew": width, "ls": "none", "color": style.BLACK}
            place: dict[str, Any] = {"transform": ax.get_xaxis_transform(), "clip_on": False}
            ax.plot(np.degrees(shown), np.zeros(shown.size), label=label, **look, **place)


def residual(diagnosis: Diagnosis, *, run: int = 0, ax: Axes | None = None) -> Axes:
    """Residual of one run before and after, over a turn; of stretches left out of the fit, where there are any.

    Marks on the axis are as in `waveform`.
    """
    trace = _trace(diagnosis, run)
    ax = axes_for(ax)
    rows = {word: rest - rest.mean() for word, rest in zip(("before", "after"), trace.residual, strict=True)}
    _before_and_after(ax, trace.theta, rows, diagnosis.quantity)
    ax.axhline(0, color=style.BLACK, lw=0.4)
    _mark(ax, trace)
    stretches = ["left-out stretches"] if trace.left_out else []
    title = ["residual", *stretches, *_averaged(trace), *_title(diagnosis, trace)]
    return over_angle(ax, *title, y=f"measured less model, {unit_of(diagnosis.quantity).shown}")


def compensated_waveform(made: Compensation, *, run: int | None = None, ax: Axes | None = None) -> Axes:
    """Error of one run without and with the correction: of stretches left out, or of a run that no fit saw.

    Parameters
    ----------
    made : Compensation
    run : int, optional
        Which, counted from 0, the fitted first; the first that no fit saw where left out, else the first.
    """
    if not made.traces:
        raise InputError("the compensation is of order tables and has no waveform; draw kind='orders'")
    if run is None:
        run = next((n for n, trace in enumerate(made.traces) if trace.unseen), 0)
    if not 0 <= run < len(made.traces):
        raise InputError(f"run = {run}: must be 0 to {len(made.traces) - 1}")
    ax = axes_for(ax)
    trace = made.traces[run]
    rank = np.argsort(trace.theta, kind="stable")
    what = "seen by no fit" if trace.unseen else "stretches left out"
    rows = {"measured": trace.before[rank], f"compensated, {what}": trace.after[rank]}
    _before_and_after(ax, trace.theta[rank], rows, "angle")
    return over_angle(ax, *stated(made.model), plain(file_name(trace.name) or "run"), y=signal_label("angle"))


def _before_and_after(ax: Axes, theta: Array, rows: Mapping[str, Array], quantity: str) -> None:
    """Lines before and after, with the rms of each."""
    for (word, row), (colour, dashes, width) in zip(rows.items(), _LOOKS, strict=True):
        values = unit_of(quantity).of(row)
        label = f"{word}: {brief(float(np.sqrt(np.mean(values**2))), 3)} {unit_of(quantity).shown} rms"
        ax.plot(*for_drawing(np.degrees(theta), values), color=colour, ls=dashes, lw=width, label=label)


def compensated_orders(made: Compensation, *, most: int = 16, ax: Axes | None = None) -> Axes:
    """Amplitude of the largest orders without the correction, and what data left out keep of them.

    Parameters
    ----------
    made : Compensation
    most : int
        So many orders are drawn; the title says of how many.
    """
    if not made.worth:
        raise InputError("nothing survives on data left out, so there is no order to draw")
    if most < 1:
        raise InputError(f"most = {most}: must be 1 or more")
    ax = axes_for(ax)
    drawn = sorted(made.orders[:most], key=lambda one: one.order)
    place = np.arange(len(drawn))
    before, left = (ANGLE.of(np.array([getattr(one, of) for one in drawn])) for of in ("amplitude", "left"))
    ax.vlines(place, left, before, color=style.BLACK, lw=0.5, zorder=0)
    ax.plot(place, before, "o", color=_BEFORE, label="measured")
    ax.plot(place, left, "v", color=_AFTER, label="after, on data left out (noise included)")
    ax.set_xticks(place, [f"{one.order:.4g}" for one in drawn])
    of = f"the largest {len(drawn)} of {len(made.orders)}" if len(drawn) < len(made.orders) else ""
    title = ["orders compensated", *stated(made.model), of]
    return labelled(ax, *title, x=ORDER, y=f"amplitude, {ANGLE.shown}", yscale="log")


def candidates(diagnosis: Diagnosis, *, ax: Axes | None = None) -> Axes:
    """Candidates by their score behind the best: what a linear step with each takes off the objective."""
    ranking = diagnosis.candidates
    shown = ranking[:_RANKED]
    ax, at = axes_of_rows(ax, [plain(describe(one.key, one.indices)) for one in shown], upwards=False)
    # fits at the load choose, not these scores of linear waveforms
    alike = [
        cause for one in diagnosis.added for cause in ((one.effect.key, one.effect.indices), *one.indistinguishable)
    ]
    behind = np.array([ranking[0].heldout_gain - candidate.heldout_gain for candidate in shown])
    added = np.array([(candidate.key, candidate.indices) in alike for candidate in shown], dtype=np.bool_)
    alike_too = "added at the load, and what cannot be distinguished from it"
    for mask, face, label in parted(added, (_AFTER, alike_too), ("white", "others")):
        ax.plot(behind[mask], at[mask], "o", color=_AFTER, mfc=face, ms=5, label=label)
    apart = behind[behind > 0]
    if apart.size and apart.max() > _DECADES * max(apart.min(), 1.0):
        ax.set_xscale("symlog", linthresh=max(apart.min(), 1.0), linscale=0.5)
    named = ", ".join(plain(describe(one.effect.key, one.effect.indices)) for one in diagnosis.added)
    return labelled(
        ax,
        f"candidates: the best lowers the objective by {brief(ranking[0].heldout_gain, 3)}"
        if ranking
        else "no candidate was scored",
        f"added: {named}" if named else "nothing added",
        x="score behind the best, fall of the objective by a linear step (a number)",
        xlim=(None, None) if ranking else (0, 1),
    )


def order_spectrum(diagnosis: Diagnosis, *, run: int = 0, highest: float | None = None, ax: Axes | None = None) -> Axes:
    """Order spectrum of the residual of one run before and after, with the strongest peaks named by their frames.

    Where `highest` is left out, orders up to 260 are shown, what was found above it, or what the run holds.  The floor
    is what noise leaves by the median of 25 neighbouring lines of the residual after, as lines are few.
    """
    trace = _trace(diagnosis, run)
    before, after = (lines_of(trace.theta, unit_of(diagnosis.quantity).of(row)) for row in trace.residual)
    lines = min(_NEIGHBOURS, after.size.size)
    floor = scipy.ndimage.median_filter(after.size, size=lines, mode="nearest") / _MEDIAN
    rows = [
        ("residual before", replace(before, floor=floor)),
        ("residual after", replace(after, floor=floor, floor_name="noise, rms")),
    ]
    name = partial(frame_name, diagnosis.declared.mechanism, within=after.apart)
    title = ["residual spectrum", *_title(diagnosis, trace)]
    found = [line.order for line in diagnosis.unexplained] + [o for a in diagnosis.added for o in a.orders]
    last = highest or min(max([_HIGHEST, *(1.05 * order for order in found)]), float(after.order[-1]))
    return draw_lines(rows, name, title=title, unit=unit_of(diagnosis.quantity).shown, highest=last, ax=ax)


def _trace(diagnosis: Diagnosis, run: int) -> Trace:
    count = len(diagnosis.traces)
    if diagnosis.shares:
        raise InputError("order tables have no waveform; draw kind='passport' or kind='shares'")
    if not 0 <= run < count:
        raise InputError(f"run = {run}: this diagnosis has {count} run{'s' if count != 1 else ''}, counted from 0")
    return diagnosis.traces[run]


def _title(diagnosis: Diagnosis, trace: Trace) -> list[str]:
    """Unit, and file, torque and direction of a run."""
    run = [plain(file_name(trace.name)), *stated(torque=trace.torque, direction=trace.direction)]
    return [*stated(diagnosis.declared), *run]
