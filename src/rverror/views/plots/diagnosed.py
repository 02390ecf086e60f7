"""Plots of a diagnosis: waveform, residual, spectrum, runs and candidates; axes in, axes out.

Options that are not described here mean what `drawing.draw` says of them.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np
import scipy

from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.base.numbers import brief
from rverror.base.text import describe, file_name
from rverror.diagnosis.result import Diagnosis, Trace
from rverror.views.by_order import residual_spectrum
from rverror.views.plots import style
from rverror.views.plots.figure import (
    ORDER,
    Axes,
    Figure,
    axes_for,
    axes_of_rows,
    for_drawing,
    in_shown_unit,
    labelled,
    legend_below,
    new_figure,
    over_angle,
    plain,
    shown_unit,
    signal_label,
    stated,
    tallest,
)
from rverror.views.plots.passports import table_figure
from rverror.views.plots.peaks import LOBE, SIDELOBES, frame_name, name_peaks, resolution, strongest
from rverror.views.plots.waveforms import unit_name
from rverror.views.set_aside import LABELS, marks

_BEFORE, _AFTER = style.ORANGE, style.BLUE
_BAND = 0.75  # of its colour, that the model's band has under what was measured
_HIGHEST = 260.0
_NEIGHBOURS = 25  # lines whose median stands for what noise leaves
_STANDS_OUT = 8.0  # times that median, of all lines
_SAME_ORDER = 1e-6
_RANKED = 10  # candidates for which there is room
_TICK_UP, _CARET_UP_BASE = 2, 10  # matplotlib's markers that stand on their point
_MARKERS = {"aside": (_TICK_UP, 9.0, 1.2), "slip": (_CARET_UP_BASE, 7.0, 0.0)}  # marker, its size and line width


def waveform(trace: Trace, *, quantity: str = "angle", unit: str = "", ax: Axes | None = None) -> Axes:
    """Measured against predicted error of one run over a turn, before and after; `quantity` is the diagnosis's.

    What was measured is the thin black line over the model's band, so a good fit does not hide it.  Marks on the axis
    tell where samples were set aside and where the reading slips.  `unit`, where given, is named in the title.
    """
    ax = axes_for(ax)
    rows = (in_shown_unit(v, quantity) for v in (trace.measured, trace.before, trace.after))
    angle, measured, before, after = for_drawing(np.degrees(trace.theta), *rows)
    over: dict[str, Any] = {"color": style.BLACK, "lw": 0.7, "zorder": 2.5}
    ax.plot(angle, measured, label="measured, mean of revolutions", **over)
    ax.plot(angle, before, color=_BEFORE, lw=1.2, ls=style.DASHED, label="declared model")
    if not np.allclose(trace.before, trace.after):
        ax.plot(angle, after, color=_AFTER, lw=2.4, alpha=_BAND, label="with what was added")
    _mark(ax, trace)
    return over_angle(ax, unit, *_trace_title(trace), y=signal_label(quantity))


def _mark(ax: Axes, trace: Trace) -> None:
    """Marks on the axis where samples were set aside and where the reading slips."""
    for one in marks(trace):
        marker, size, width = _MARKERS[one.kind]
        look: dict[str, Any] = {
            "marker": marker,
            "ms": size,
            "mew": width,
            "ls": "none",
            "color": style.BLACK,
            "clip_on": False,
        }
        on_axis = np.zeros(one.angles.size)
        ax.plot(np.degrees(one.angles), on_axis, transform=ax.get_xaxis_transform(), label=LABELS[one.kind], **look)


def diagnosis_waveform(diagnosis: Diagnosis, *, run: int = 0, ax: Axes | None = None) -> Axes:
    """`waveform` of one run of a diagnosis."""
    return waveform(_trace(diagnosis, run), quantity=diagnosis.quantity, unit=unit_name(diagnosis.declared), ax=ax)


def residual(diagnosis: Diagnosis, *, run: int = 0, ax: Axes | None = None) -> Axes:
    """Residual of one run before and after, over a turn; of stretches left out of the fit, where there are any.

    Marks on the axis are as in `waveform`.
    """
    trace = _trace(diagnosis, run)
    ax = axes_for(ax)
    unit = shown_unit(diagnosis.quantity)
    looks = (("before", _BEFORE, style.DASHED, 1.2), ("after", _AFTER, "solid", 0.9))
    for (word, colour, dashes, width), rest in zip(looks, trace.residual, strict=True):
        values = in_shown_unit(rest - rest.mean(), diagnosis.quantity)
        label = f"{word}, rms {brief(float(np.sqrt(np.mean(values**2))), 3)} {unit}"
        ax.plot(*for_drawing(np.degrees(trace.theta), values), color=colour, ls=dashes, lw=width, label=label)
    ax.axhline(0, color=style.BLACK, lw=0.4)
    _mark(ax, trace)
    what = "residual, left-out stretches" if trace.left_out else "residual"
    title = [what, unit_name(diagnosis.declared), *_trace_title(trace)]
    return over_angle(ax, *title, y=f"measured less model, {unit}")


def runs(diagnosis: Diagnosis, *, ax: Axes | None = None) -> Axes:
    """Rms of the residual of each run before and after; of stretches left out of the fit, where there are any."""
    unit = shown_unit(diagnosis.quantity)
    pairs = np.array([[np.std(values) for values in trace.residual] for trace in diagnosis.traces]).reshape(-1, 2)
    before, after = in_shown_unit(pairs, diagnosis.quantity).T
    ax, at = axes_of_rows(ax, [", ".join(_trace_title(trace)) for trace in diagnosis.traces], upwards=False)
    ax.hlines(at, after, before, color=style.GREY, lw=2.0)
    ax.plot(before, at, "s", color=_BEFORE, mec=style.BLACK, ms=8, label="before")
    ax.plot(after, at, "o", color=_AFTER, mec=style.BLACK, ms=6, label="after")
    noise = float(in_shown_unit(np.array([diagnosis.noise_rms]), diagnosis.quantity)[0])
    label = f"noise of a single reading, {brief(noise, 3)} {unit}"
    ax.axvline(noise, color=style.BLACK, ls=style.DASHES[2], lw=1.0, label=label)
    held = all(trace.left_out for trace in diagnosis.traces) and bool(diagnosis.traces)
    return labelled(
        ax,
        "residual of each run",
        "left-out stretches" if held else "",
        unit_name(diagnosis.declared),
        x=f"rms of the residual, {unit}",
        xlim=(0, 1.08 * max(noise, float(pairs.size and max(before.max(), after.max()))) or 1.0),
    )


def candidates(diagnosis: Diagnosis, *, ax: Axes | None = None) -> Axes:
    """Candidates by their score behind the best: what a linear step with each takes off the objective."""
    ranking = diagnosis.candidates
    shown = ranking[:_RANKED]
    ax, _ = axes_of_rows(ax, [plain(describe(one.key, one.indices)) for one in shown], upwards=False)
    # fits at the load choose, not these scores of linear waveforms
    alike = [
        cause for one in diagnosis.added for cause in ((one.effect.key, one.effect.indices), *one.indistinguishable)
    ]
    behind = [ranking[0].heldout_gain - candidate.heldout_gain for candidate in shown]
    for at, (candidate, difference) in enumerate(zip(shown, behind, strict=True)):
        face = _AFTER if (candidate.key, candidate.indices) in alike else "white"
        ax.plot([difference], [at], "o", color=_AFTER, mfc=face, ms=5)
    gain = f"the best takes off {brief(ranking[0].heldout_gain, 3)}" if ranking else "none was scored"
    added = ", ".join(plain(describe(one.effect.key, one.effect.indices)) for one in diagnosis.added)
    title = f"candidates: {gain}\n" + (f"added: {added}" if added else "nothing added")
    ax.set(xlabel="score behind the best, fall of the objective by a linear step (a number)", title=title)
    ax.title.set_fontsize("medium")
    if not ranking:
        ax.set_xlim(0, 1)
        return ax
    _spread(ax, behind)
    from matplotlib.lines import Line2D

    marks = [("white", "others")]
    if added:
        marks.insert(0, (_AFTER, "added at the load, and what cannot be told from it"))
    handles = [Line2D([], [], marker="o", ls="", color=_AFTER, mfc=face, label=label) for face, label in marks]
    legend_below(ax, columns=2, handles=handles)
    return ax


def _spread(ax: Axes, behind: list[float]) -> None:
    """Linear, but where differences reach over decades: then logarithmic above the smallest one."""
    apart = sorted(value for value in behind if value > 0)
    if apart and apart[-1] > 30 * max(apart[0], 1.0):
        start = 10.0 ** math.floor(math.log10(max(apart[0], 1.0)))
        ax.set_xscale("symlog", linthresh=start, linscale=0.5)
        ax.set_xlim(left=-0.3 * start)


def order_spectrum(diagnosis: Diagnosis, *, run: int = 0, highest: float | None = None, ax: Axes | None = None) -> Axes:
    """Order spectrum of the residual of one run before and after, with the strongest peaks named by their frames.

    Where `highest` is left out, orders up to 260 are shown, what was found above it, or what the run holds.  The floor
    is the median of 25 neighbouring lines of the residual after: what noise leaves, as lines are few.
    """
    trace = _trace(diagnosis, run)
    ax = axes_for(ax)
    found = residual_spectrum(trace)
    order, before, after = found.order, *(in_shown_unit(v, diagnosis.quantity) for v in (found.before, found.after))
    shown = order <= (highest or _last_found(diagnosis))
    middle = float(np.median(after))
    bottom = max(middle / 30, 1e-5)
    ax.vlines(*_stems(order[shown], bottom, before[shown]), color=_BEFORE, lw=1.6, label="residual before")
    ax.vlines(*_stems(order[shown], bottom, after[shown]), color=_AFTER, lw=0.9, label="residual after")
    floor = scipy.ndimage.median_filter(after, size=min(_NEIGHBOURS, after.size), mode="nearest")
    shown_floor = for_drawing(order[shown], np.maximum(floor, bottom)[shown])
    ax.plot(*shown_floor, color=style.BLACK, lw=1.0, ls=style.DASHED, label="noise floor")
    within = resolution(order)
    apart = max(2, math.ceil(np.count_nonzero(shown) / 52), LOBE if within else 1)
    size = np.where(shown, before, 0.0)
    lobes = SIDELOBES * float(size.max(initial=0.0)) if within else 0.0
    least = np.maximum(_STANDS_OUT * np.maximum(floor, middle), max(bottom, lobes))
    for line in diagnosis.unexplained:
        least[np.abs(order - line.order) <= max(within, _SAME_ORDER)] = bottom
    chosen = strongest(size, floor=least, apart=apart)
    ax.margins(x=0.01)
    top = max(float(size.max(initial=0.0)), float(after[shown].max(initial=0.0)), 10 * bottom)
    name = partial(frame_name, diagnosis.declared.mechanism, within=within)
    title = ["residual spectrum", unit_name(diagnosis.declared), *_trace_title(trace)]
    labelled(ax, *title, x=ORDER, y=f"amplitude, {shown_unit(diagnosis.quantity)}")
    name_peaks(ax, order[chosen], before[chosen], name, bottom=bottom, top=top)
    return ax


def _stems(order: Array, bottom: float, size: Array) -> tuple[Array, float, Array]:
    place, height = tallest(order, size)
    return place, bottom, height


def _last_found(diagnosis: Diagnosis) -> float:
    found = [line.order for line in diagnosis.unexplained] + [o for a in diagnosis.added for o in a.orders]
    return max([_HIGHEST, *(1.05 * order for order in found)])


def diagnosis_figure(diagnosis: Diagnosis) -> Figure:
    """Waveform of each run and the residual spectrum of the first, in one figure; of tables passport and shares."""
    if diagnosis.shares:
        return table_figure(diagnosis)
    figure, axes = new_figure(len(diagnosis.traces) + 1)
    for trace, ax in zip(diagnosis.traces, axes[:-1], strict=True):
        waveform(trace, quantity=diagnosis.quantity, unit=unit_name(diagnosis.declared), ax=ax)
    order_spectrum(diagnosis, ax=axes[-1])
    return figure


def _trace(diagnosis: Diagnosis, run: int) -> Trace:
    count = len(diagnosis.traces)
    if diagnosis.shares:
        raise InputError("order tables have no waveform; draw the table with kind='passport', or use diagnosis_figure")
    if not 0 <= run < count:
        raise InputError(f"run = {run}: this diagnosis has {count} run{'s' if count != 1 else ''}, counted from 0")
    return diagnosis.traces[run]


def _trace_title(trace: Trace) -> list[str]:
    """File, torque and direction of a run."""
    return [plain(file_name(trace.name)), *stated(torque=trace.torque, direction=trace.direction)]
