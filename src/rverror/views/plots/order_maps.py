"""Order maps: amplitude against order and load or temperature, over runs, over a diagnosis, over torques of a model.

Options that are not described here mean what `drawing.draw` says of them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.directions import Direction
from rverror.base.errors import InputError, check_each
from rverror.base.numbers import way
from rverror.base.text import file_name
from rverror.diagnosis.result import Diagnosis
from rverror.geartrain.mechanism import Drive, Reducer
from rverror.model.effects import Model
from rverror.runs.measurement import Run
from rverror.statics.loaded_state import equilibrium
from rverror.views.by_order import residual_spectrum
from rverror.views.plots.figure import (
    ORDER,
    Axes,
    axes_for,
    check_axes,
    heat_map,
    in_shown_unit,
    labelled,
    plain,
    shown_unit,
    stated,
)
from rverror.views.plots.spectra import lines_of, mechanism_of, run_lines
from rverror.views.plots.waveforms import signals_of, unit_name, unit_of

_HIGHEST = 260.0
_COLUMNS = 520  # that can be told apart
_SHARES = (0.05, 0.1, 0.25, 0.5, 1.0)  # of the rated torque
_BY: Mapping[str, str] = MappingProxyType({"torque": "output torque, N*m", "temperature": "temperature, degC"})


@dataclass(frozen=True)
class _Row:
    """One row of the map: where it stands, what is written there, orders and amplitudes in the unit shown."""

    at: float
    label: str
    order: Array
    size: Array


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
    rows, quantities = [], set()
    for number, run in enumerate(runs):
        name = run.path or f"run {number + 1}"
        value = run.torque if by == "torque" else run.temperature
        if value is None:
            raise InputError(f"{name}: no {by} in the run; add it to the file, or order the map by the other")
        at = units.to_display(value, by)
        for signal in signals_of(run, ratio):
            found = run_lines(signal, mechanism_of(run, ratio))
            quantities.add(signal.quantity)
            size = in_shown_unit(found.size, signal.quantity)
            rows.append(_Row(at, f"{at:.4g} {way(signal.direction)}", found.order, size))
    if len(quantities) > 1:
        raise InputError("some runs are torque records and others hold an error; draw them apart")
    unit = shown_unit(quantities.pop()) if quantities else "arcsec"
    return _map(rows, ylabel=_BY[by], unit=unit, title=["order map of runs", *unit_of(ratio)], highest=highest, ax=ax)


def diagnosis_map(
    diagnosis: Diagnosis, *, which: str = "before", highest: float = _HIGHEST, ax: Axes | None = None
) -> Axes:
    """Amplitude of each order of the residual in each run of a diagnosis.

    Parameters
    ----------
    diagnosis : Diagnosis
    which : {"before", "after"}
        Residual against the declared model, or with what was added.
    highest : float
    ax : Axes, optional
        The colour bar takes its place from it, as in `order_map`.
    """
    if which not in ("before", "after"):
        raise InputError(f"which = {which!r}: must be 'before' or 'after'")
    rows = []
    loads = all(trace.torque is not None for trace in diagnosis.traces)
    for number, trace in enumerate(diagnosis.traces):
        found = residual_spectrum(trace)
        size = in_shown_unit(getattr(found, which), diagnosis.quantity)
        at = units.to_display(trace.torque, "torque") if loads and trace.torque is not None else float(-number)
        label = f"{at:.4g} " if loads else f"{plain(file_name(trace.name))}\n"
        rows.append(_Row(at, label + way(trace.direction), found.order, size))
    ylabel, unit = _BY["torque"] if loads and rows else "", shown_unit(diagnosis.quantity)
    title = [f"order map of the residual {which}", unit_name(diagnosis.declared)]
    return _map(rows, ylabel=ylabel, unit=unit, title=title, highest=highest, ax=ax)


def model_map(
    model: Model,
    *,
    torques: Sequence[Any] | None = None,
    direction: Direction = "forward",
    points: int = 1024,
    highest: float = _HIGHEST,
    ax: Axes | None = None,
) -> Axes:
    """Amplitude of each order of a model's loaded transmission error at several torques.

    Parameters
    ----------
    model : Model
        Of a reducer.
    torques : sequence of float or quantity, optional
        Sizes of the output torque, N*mm; 5, 10, 25, 50 and 100 % of the rated torque where left out.
    direction : {"forward", "reverse"} or +1 or -1
    points : int
        Angles of a turn at which the equilibrium is solved; orders above half of them fold.
    highest : float
    ax : Axes, optional
        The colour bar takes its place from it, as in `order_map`.

    Raises
    ------
    InputError
        If the model is no reducer, or no torque is given and none is rated.
    ValueError
        As in `equilibrium`.
    """
    unit = model.mechanism
    if not isinstance(unit, Reducer):
        raise InputError("an order map over torques needs a [reducer] model; a [drive] has no contacts that bear load")
    if torques is None:
        if unit.rated_torque is None:
            raise InputError(f"reducer {unit.name!r} has no rated_torque; give torques=, e.g. ['20 N*m', '100 N*m']")
        torques = [units.InCore(share * unit.rated_torque) for share in _SHARES]
    check_axes(ax)
    theta = 2 * np.pi * np.arange(points) / points
    rows = []
    for torque in torques:
        state = equilibrium(model, theta, torque=torque, direction=direction)
        found = lines_of(theta, state.transmission_error)
        at = units.to_display(units.to_core(torque, "torque"), "torque")
        rows.append(_Row(at, f"{at:.4g}", found.order, in_shown_unit(found.size, "angle")))
    title = ["order map, loaded", unit_name(model), *stated(direction=direction)]
    return _map(rows, ylabel=_BY["torque"], unit="arcsec", title=title, highest=highest, ax=ax)


def _map(
    rows: Sequence[_Row], *, ylabel: str, unit: str, title: Sequence[str], highest: float, ax: Axes | None
) -> Axes:
    if not rows:
        raise InputError("an order map needs one run or more")
    ax = axes_for(ax, height=1.6 + 0.35 * max(len(rows), 4))
    ordered = sorted(rows, key=lambda row: row.at)
    meshes, columns = [], 1
    for place, row in enumerate(ordered):
        kept = row.order <= highest
        order, size = row.order[kept], row.size[kept]
        if not order.size:
            continue
        columns = -(-order.size // _COLUMNS)
        starts = np.arange(0, order.size, columns)
        step = float(order[1] - order[0]) if order.size > 1 else 1.0
        edges = np.append(order[starts], order[-1] + step) - step / 2
        meshes.append((edges, np.array([place - 0.46, place + 0.46]), np.maximum.reduceat(size, starts)[None]))
    ax.set_yticks(range(len(ordered)), [row.label for row in ordered], fontsize="small")
    last = min(highest, max(float(row.order[-1]) for row in ordered))
    labelled(ax, *title, x=ORDER, y=ylabel, legend="", xlim=(0, last), ylim=(-0.5, len(ordered) - 0.5))
    heat_map(ax, meshes, label=f"amplitude, {unit}" + (f", largest of {columns} lines" if columns > 1 else ""))
    return ax
