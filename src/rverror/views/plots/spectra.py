"""Order spectra of models, runs and loaded states, with named peaks and, where there is noise, its floor; their map.

Options that are not described here mean what `drawing.draw` says of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.directions import Direction
from rverror.base.errors import InputError, check_each
from rverror.base.numbers import way
from rverror.geartrain.kinematics import fundamental_orders, true_period, whole_turn
from rverror.geartrain.mechanism import Drive, Mechanism, Reducer
from rverror.model.compose import transmission_error_by_effect
from rverror.model.effects import Model
from rverror.model.results import Equilibrium
from rverror.runs.measurement import Run
from rverror.runs.spectrum import even_travel, frames_of_order, harmonics, noise_spectrum, revolutions
from rverror.views.by_order import short_frame, turns_of
from rverror.views.plots import style
from rverror.views.plots.figure import Axes, axes_for, axes_of_rows, for_drawing, heat_map, span_of
from rverror.views.plots.labels import ORDER, labelled, letters, plain, stated
from rverror.views.plots.waveforms import MOST_TURNS, Signal, parts_of, run_title, signals_of, state_title
from rverror.views.shown_units import ANGLE, unit_of

_TURN = 2 * math.pi
_LEAST_SHARE = 1e-3  # of the strongest line, below which a line of an exact waveform is not shown
_STANDS_OUT = 4.0  # times the noise's rms amplitude: chance leaves one line in 10^7 above it
_SEEN = 0.03  # of the strongest line, up to the last of which orders are shown
_ROWS = ((style.BLUE, "solid"), (style.ORANGE, style.DASHED))
_OPEN = 1.5  # times the largest line, that the ordinate shows
#: Bins over which the window of a part of a turn spreads a line to either side, and the share of it beside them.
_LOBE, _SIDELOBES = 5, 0.05
_NAMED = 8  # peaks that are named
_ALONE = 3.0  # times the resolution, within which no other order of a frame may lie
_FONT = 7.0  # points
_SLOPE = 35.0  # degrees, of names
_APART = 4.5  # letters, between neighbours of that slope
_HIGHEST = 260.0  # order of a map, where none is given
_COLUMNS = 520  # that can be told apart
_BY = {"torque": "output torque, N*m", "temperature": "temperature, degC"}
_PART = 0.1  # of a line's amplitude, from which on an effect is named as a cause of it


@dataclass(frozen=True)
class Lines:
    """Amplitudes by order, and the rms amplitude that noise alone leaves there, where it is known.

    `apart` is the distance of the bins of a windowed spectrum, which hit no order exactly; 0 for harmonics.
    """

    order: Array
    size: Array
    floor: Array | None = None
    floor_name: str = ""
    apart: float = 0.0


def lines_of(theta: Array, values: Array) -> Lines:
    """Order spectrum of one row at even angles, rad, of whole turns or of a part of one.

    Over a part of a turn no order repeats: a parabola is taken off and a Hann window put on, so that what grows along
    the run does not spill over all orders.  Orders are then resolved no finer than two per travel.
    """
    turns, n = turns_of(theta), theta.size
    if turns == round(turns):
        size = np.abs(harmonics(values))
        return Lines(np.arange(1, size.size + 1, dtype=np.float64) / turns, size)
    at, window = np.linspace(-1.0, 1.0, n), np.hanning(n)
    rest = values - np.polyval(np.polyfit(at, values, 2), at)
    bins = np.arange(4, int(0.8 * n))  # padded to twice the travel, they lie half a travel's order apart
    size = np.abs(np.fft.rfft(rest * window * 2 / window.sum(), 2 * n))[bins]  # a line's sum is its amplitude
    return Lines(bins / (2 * turns), size, apart=1 / (2 * turns))


def run_lines(signal: Signal, mechanism: Mechanism) -> Lines:
    """Order spectrum of one direction of a run: of the mean of its periods, or of its travel where that is shorter.

    The mechanism gives the period; where there are two periods or more, they give the floor.
    """
    whole = revolutions(signal.theta, signal.values, turns=true_period(mechanism))
    if whole is None:
        return lines_of(*even_travel(signal.theta, signal.values))
    theta, periods = whole
    found = lines_of(theta, periods.mean(axis=0))
    count, n = periods.shape
    # a mean of so many periods has so much less variance, and a line two coefficients
    floor = 2 * np.sqrt(noise_spectrum(periods) / (count * n))
    return replace(found, floor=floor, floor_name=f"{way(signal.direction)}: noise of the mean of {count} periods, rms")


# --- plots ------------------------------------------------------------------------------------------------------------


def model_spectrum(
    model: Model,
    *,
    direction: Direction = "forward",
    torque: Any = None,
    highest: float | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Order spectrum of a model's transmission error in closed form, with the effects that make its strongest lines.

    Where `highest` is left out, the last line of 3 % of the strongest is the last to be shown.  An exact waveform
    has no noise, so there is no floor.  A drive that repeats after many turns is windowed.

    Raises
    ------
    ValueError
        If an effect needs a torque or a time.
    """
    turn, turns = whole_turn(model.mechanism), true_period(model.mechanism)
    span = float(turns) if turns <= MOST_TURNS else MOST_TURNS - 0.5  # no whole number of turns: windowed
    theta = _TURN * span * np.arange(round(turn.size * span)) / round(turn.size * span)
    parts = parts_of(model, theta, direction=direction, torque=torque)
    whole = lines_of(theta, parts.rows.sum(axis=0))
    name = causes_of(model, theta, parts.rows)
    title = [*stated(model, torque=torque, direction=direction), "closed form"]
    return draw_lines([("total", whole)], name, title=title, highest=highest, ax=ax)


def causes_of(model: Model, theta: Array, rows: Array) -> Callable[..., str]:
    """Names of peaks: of the effects that make a tenth or more of what is there in closed form, the largest first.

    Parameters
    ----------
    model : Model
    theta, rows : ndarray
        Even angles (n,), and what each effect makes alone (effects, n).

    Returns
    -------
    callable
        Of an order and, where other than effects make it too, the size of the peak: the order, the effect that makes
        most of it, and how many others share in it; empty without any.
    """
    found = [lines_of(theta, row) for row in rows]

    def name(order: float, size: float = 0.0) -> str:
        alone = [float(one.size[int(np.argmin(np.abs(one.order - order)))]) for one in found]
        least = _PART * max([size, *alone])
        keys = [model.effects[i].key for i in np.argsort(alone)[::-1] if alone[i] > least]
        others = f" + {len(keys) - 1}" if len(keys) > 1 else ""
        return f"{order:g}: {keys[0]}{others}" if keys else ""

    return name


def run_spectrum(
    run: Run,
    *,
    ratio: Reducer | Drive | Model | float | None = None,
    highest: float | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Order spectrum of a run, of each direction that it holds, with the noise floor and the frames of its peaks.

    A ratio that is a bare number names no frames.  Where `highest` is left out, the last line that stands out is shown.
    """
    mechanism = mechanism_of(run, ratio)
    signals = signals_of(run, ratio)
    rows = [(way(signal.direction), run_lines(signal, mechanism)) for signal in signals]
    bare = isinstance(ratio, int | float)
    name = "{:.4g}".format if bare else partial(frame_name, mechanism, within=rows[0][1].apart)
    unit, title = unit_of(signals[0].quantity).shown, run_title(run, ratio, signals)
    return draw_lines(rows, name, title=["order spectrum", *title], unit=unit, highest=highest, ax=ax)


def state_spectrum(state: Equilibrium, *, highest: float | None = None, ax: Axes | None = None) -> Axes:
    """Order spectrum of the transmission error of a loaded state at even angles, with the causes of its peaks.

    A peak has the name of the declared effect that makes most of it in closed form at the same angles, at which orders
    fold alike; where none makes a tenth of it, that of the frame that it fits.

    Parameters
    ----------
    state : Equilibrium
    highest : float, optional
        As in `model_spectrum`.

    Raises
    ------
    InputError
        If its angles are few or uneven, or do not grow.
    """
    angle = state.theta
    steps = np.diff(angle)
    if angle.size < 8 or not (steps > 0).all() or np.ptp(steps) > 1e-6 * steps.mean():
        raise InputError("a spectrum needs eight or more even angles that grow; solve the equilibrium at such")
    found = lines_of(angle, ANGLE.of(state.transmission_error))
    frame = partial(frame_name, state.model.mechanism, within=found.apart)
    alone = ANGLE.of(transmission_error_by_effect(state.model, state.conditions))
    causes = causes_of(state.model, angle, alone)

    def name(order: float) -> str:
        size = float(found.size[int(np.argmin(np.abs(found.order - order)))])
        return causes(order, size) or frame(order)

    return draw_lines([("loaded equilibrium", found)], name, title=state_title(state), highest=highest, ax=ax)


def mechanism_of(run: Run, ratio: Reducer | Drive | Model | float | None) -> Mechanism:
    """What turns: the mechanism, or a drive of a bare ratio.

    Raises
    ------
    InputError
        If there is no ratio.
    """
    if ratio is None:
        raise InputError(f"{run.path or 'run'}: orders are counted per output turn; give ratio=, the model or a number")
    if isinstance(ratio, Model):
        return ratio.mechanism
    return ratio if isinstance(ratio, Reducer | Drive) else Drive(ratio=float(ratio))


def draw_lines(
    rows: Sequence[tuple[str, Lines]],
    name: Callable[[float], str],
    *,
    title: Sequence[str],
    unit: str = "arcsec",
    highest: float | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Stems of the first row and rings of the second, floors as lines, the strongest peaks of the first row named.

    Parameters
    ----------
    rows : sequence of (str, Lines)
        Name and lines in the unit shown, at the same orders.
    name : callable
        Text for the order of a peak.
    title : sequence of str
    unit : str
    highest : float, optional
        Where left out, the last order that stands out is shown.
    ax : Axes, optional
    """
    ax = axes_for(ax, height=4.2)
    lines = rows[0][1]
    top = span_of(max(float(found.size.max(initial=0.0)) for _, found in rows))
    floors = [float(np.median(found.floor)) for _, found in rows if found.floor is not None]
    bottom = max(min(floors) / 4, 1e-6 * top) if floors and min(floors) > 0 else _LEAST_SHARE * top
    last = highest or _last(rows, top)
    for number, ((label, found), (colour, dashes)) in enumerate(zip(rows, _ROWS, strict=False)):
        shown = found.order <= last
        high = shown & (found.size > bottom)
        order, size = for_drawing(found.order[high], found.size[high])
        if number == 0:
            ax.vlines(order, bottom, size, color=colour, lw=1.6, label=label)
        else:  # stems over stems would blend into one colour
            ax.plot(order, size, "o", color=colour, ms=3, mfc="white", mew=0.9, label=label)
        if found.floor is not None and found.floor_name:
            floor = for_drawing(found.order[shown], np.maximum(found.floor[shown], bottom))
            ax.plot(*floor, color=style.BLACK, ls=dashes, lw=1.0, label=found.floor_name)
    ax.set_yscale("log")
    limits: dict[str, Any] = {"xlim": (0, last), "ylim": (bottom, _OPEN * top)}
    labelled(
        ax, *title, x=ORDER, y=f"amplitude, {unit}", legend="below" if len(rows) + len(floors) > 1 else "", **limits
    )
    shown = lines.order <= last
    apart = 2 * _LOBE if lines.apart else 1
    name_peaks(ax, lines.order[shown], lines.size[shown], name, floor=_threshold(lines, top)[shown], apart=apart)
    return ax


def _threshold(lines: Lines, top: float) -> Array:
    """Amplitude above which a line is one."""
    share = _SIDELOBES if lines.apart else _LEAST_SHARE
    least = np.full(lines.size.shape, share * top)
    return least if lines.floor is None else np.maximum(least, _STANDS_OUT * lines.floor)


def _last(rows: Sequence[tuple[str, Lines]], top: float) -> float:
    """Order up to which there is something to see."""
    orders = [8.0]
    for _, found in rows:
        out = found.size > np.maximum(_threshold(found, top), _SEEN * top)
        orders += [1.06 * float(order) for order in found.order[out][-1:]]
    ends = max(float(found.order[-1]) for _, found in rows)
    return min(max(orders), ends)


def order_map(
    runs: Sequence[Run],
    *,
    ratio: Reducer | Drive | Model | float,
    by: str = "torque",
    highest: float = _HIGHEST,
    ax: Axes | None = None,
) -> Axes:
    """Amplitude of each order in each of several runs, ordered by load or temperature.

    Parameters
    ----------
    runs : sequence of Run
        Each direction of a run is a row.
    ratio : Reducer, Drive, Model or float
        Input turns per output turn.
    by : {"torque", "temperature"}
        What the rows are ordered by; every run must hold it.
    highest : float
        Highest order to show.
    ax : Axes, optional
        The colour bar takes its place from it.

    Returns
    -------
    Axes

    Raises
    ------
    InputError
        If there is no run, a run does not hold what rows are ordered by, or the ratio contradicts it.

    Examples
    --------
    >>> import rverror
    >>> unit = rverror.Model(rverror.reducer("RV-40E"))
    >>> runs = rverror.runs.simulate_runs(unit, torques=("20 N*m", "40 N*m"), points=512, noise="1 arcsec", seed=1)
    >>> order_map(runs, ratio=unit, highest=50).get_xlabel()
    'order, per output turn'
    """
    check_each("runs", runs, Run, "give a list of runs, such as [load_run(path)]")
    if by not in _BY:
        raise InputError(f"by = {by!r}: rows are ordered by {' or '.join(_BY)}")
    rows = list[tuple[float, str, Lines]]()
    quantities = set[str]()
    for number, run in enumerate(runs):
        name = run.path or f"run {number + 1}"
        value = run.torque if by == "torque" else run.temperature
        if value is None:
            raise InputError(f"{name}: no {by} in the run; add it to the file, or order the map by the other")
        at = units.to_display(value, by)
        for signal in signals_of(run, ratio):
            rows.append((at, f"{at:.4g} {way(signal.direction)}", run_lines(signal, mechanism_of(run, ratio))))
            quantities.add(signal.quantity)
    if not rows:
        raise InputError("an order map needs one run or more")
    if len(quantities) > 1:
        raise InputError("some runs are torque records and others hold an error; draw them apart")
    quantity = quantities.pop()
    rows.sort(key=lambda row: row[0])
    ax, places = axes_of_rows(ax, [label for _, label, _ in rows])
    meshes, columns = [], 1
    for place, (_, _, lines) in zip(places, rows, strict=True):
        shown = lines.order <= highest
        order, size = lines.order[shown], lines.size[shown]
        if order.size < 2:
            continue
        columns = -(-order.size // _COLUMNS)
        starts = np.arange(0, order.size, columns)
        step = order[1] - order[0]
        edges = np.append(order[starts], order[-1] + step) - step / 2
        meshes.append((edges, np.array([place - 0.46, place + 0.46]), np.maximum.reduceat(size, starts)[None]))
    last = min(highest, max(float(lines.order[-1]) for *_, lines in rows))
    labelled(ax, "order map of runs", *stated(ratio), x=ORDER, y=_BY[by], legend="", xlim=(0, last))
    of = f", largest of {columns} lines" if columns > 1 else ""
    heat_map(ax, meshes, label=f"amplitude, {unit_of(quantity).shown}{of}")
    return ax


# --- peaks ------------------------------------------------------------------------------------------------------------


def frame_name(mechanism: Mechanism, order: float, *, within: float = 0.0) -> str:
    """Order and the first frame that it fits, short.

    Parameters
    ----------
    mechanism : Reducer or Drive
    order : float
        Per output turn.
    within : float
        How far the order may be off, `Lines.apart`.  A frame is then named only if its order lies so near, and no other
        one within three times as much.

    Returns
    -------
    str

    Examples
    --------
    >>> from rverror import reducer
    >>> frame_name(reducer("RV-40E"), 78.0)
    '78: housing 39 x 2'
    >>> frame_name(reducer("RV-40E"), 79.2, within=1.5)
    'about 79.2'
    """
    shown, exact = f"{order:g}", order
    if within:
        shown = f"about {order:.3g}" if order < 1e3 else f"about {order:.0f}"
        turning = mechanism.shafts if isinstance(mechanism, Drive) else fundamental_orders(mechanism)
        bases = {abs(turns) for turns in (mechanism.ratio, *turning.values())}
        multiples = {base * (round(order / base) + k) for base in bases for k in (-1, 0, 1)}
        near = {round(one, 6) for one in multiples if one > 0 and abs(one - order) <= _ALONE * within}
        exact = min(near, key=lambda one: abs(one - order), default=order)
        if len(near) > 1 or abs(exact - order) > within:
            return shown
    frames = frames_of_order(mechanism, exact)
    return f"{shown}: {short_frame(frames[0]) if frames else 'no frame'}"


def strongest(size: Array, *, floor: Array, apart: int = 1) -> list[int]:
    """Places of the largest crests above a floor, at least so many places apart, the largest first.

    Parameters
    ----------
    size, floor : ndarray, shape (m,)
    apart : int

    Returns
    -------
    list of int
        Eight at the most.
    """
    # by hand: scipy.signal takes as long to load as a page takes to draw
    before, after = np.pad(size, (1, 0))[:-1], np.pad(size, (0, 1))[1:]
    crests = np.flatnonzero((size > before) & (size >= after) & (size >= floor)).tolist()
    chosen: list[int] = []
    for place in sorted(crests, key=lambda place: -size[place]):
        if len(chosen) < _NAMED and all(abs(place - other) >= apart for other in chosen):
            chosen.append(place)
    return chosen


def name_peaks(
    ax: Axes, order: Array, size: Array, name: Callable[[float], str], *, floor: Array, apart: int = 1
) -> None:
    """Write the names of the strongest lines of a spectrum over its axes.

    Parameters
    ----------
    ax : Axes
    order, size : ndarray, shape (m,)
        Lines that are drawn.
    name : callable
        Text for an order.
    floor : ndarray, shape (m,)
        What a line must exceed to be named.
    apart : int
        Lines between two that are named at least, wherever there is room for the names of neighbours.
    """
    room = int(np.ceil(_APART * order.size / letters(ax, _FONT)))
    chosen = strongest(size, floor=floor, apart=max(apart, room))
    if not chosen:
        return
    ax.vlines(order[chosen], size[chosen], 1e3 * size.max(), colors="0.6", lw=0.4, zorder=0)
    above = ax.secondary_xaxis("top")
    labels = [plain(name(place)) for place in order[chosen]]
    above.set_xticks(order[chosen], labels, rotation=_SLOPE, ha="left", rotation_mode="anchor", fontsize=_FONT)
