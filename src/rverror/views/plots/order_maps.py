"""Order map: amplitude against order and load or temperature, over runs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rverror.base import units
from rverror.base.errors import InputError, check_each
from rverror.base.numbers import way
from rverror.geartrain.mechanism import Drive, Reducer
from rverror.model.effects import Model
from rverror.runs.measurement import Run
from rverror.views.plots.figure import Axes, axes_of_rows, heat_map
from rverror.views.plots.labels import ORDER, labelled, stated
from rverror.views.plots.spectra import Lines, mechanism_of, run_lines
from rverror.views.plots.waveforms import signals_of
from rverror.views.shown_units import unit_of

_HIGHEST = 260.0
_COLUMNS = 520  # that can be told apart
_BY = {"torque": "output torque, N*m", "temperature": "temperature, degC"}


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
