"""Every plot one call away: `draw` finds the picture of a result; the plots themselves are in rooms of their own.

Axes in, axes out.  matplotlib comes with the extra ``plot``.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from functools import partial
from types import MappingProxyType
from typing import Any

from rverror.base.errors import InputError
from rverror.base.text import did_you_mean
from rverror.compensation.outcome import Compensation
from rverror.diagnosis.result import Diagnosis
from rverror.dynamics.at_speed import SpeedResponse
from rverror.dynamics.natural_modes import Modes
from rverror.dynamics.running_up import RunUp
from rverror.geartrain.mechanism import Reducer
from rverror.life.result import RunsCompared, Trend
from rverror.lots.of_drives import DriveLot
from rverror.lots.result import Lot
from rverror.matching.result import Matched
from rverror.model.effects import Model
from rverror.model.results import Equilibrium, Influence
from rverror.runs.measurement import Run
from rverror.runs.order_table import OrderTable
from rverror.statics.friction import Efficiency, Hysteresis
from rverror.statics.hertz import ContactPressure
from rverror.statics.rigidity import TorsionCurve
from rverror.statics.worn_contacts import Wear
from rverror.tolerances.allocation_result import Allocation
from rverror.tolerances.closed_form import Budget
from rverror.tolerances.full_budget import ErrorBudget
from rverror.tolerances.sampling import VirtualUnits
from rverror.views.plots.budgets import at_load, contributions, costs, distribution, envelope, front_of, widths
from rverror.views.plots.compensated import compensated_orders, compensated_waveform
from rverror.views.plots.diagnosed import (
    candidates,
    diagnosis_figure,
    diagnosis_waveform,
    order_spectrum,
    residual,
    runs,
    waveform,
)
from rverror.views.plots.figure import Axes, new_figure, svg_element, to_bytes
from rverror.views.plots.friction_losses import losses
from rverror.views.plots.life_courses import compared_orders, trend_courses
from rverror.views.plots.lots import drive_lot_orders, lot_orders, lot_predicted, lot_processes, lot_shares
from rverror.views.plots.matched_units import matched_errors
from rverror.views.plots.mechanism_view import mechanism
from rverror.views.plots.mode_shapes import mode_shape
from rverror.views.plots.order_maps import diagnosis_map, model_map, order_map
from rverror.views.plots.order_tables import table_amplitudes
from rverror.views.plots.passports import table_passport
from rverror.views.plots.pressures import pressures
from rverror.views.plots.resonances import resonance_plot
from rverror.views.plots.run_ups import run_up_waveform
from rverror.views.plots.spectra import model_spectrum, run_spectrum, state_spectrum
from rverror.views.plots.speeds import campbell, speed_amplitudes, speed_map
from rverror.views.plots.torsion_curves import loop, torsion
from rverror.views.plots.waveforms import (
    influence_waveform,
    model_polar,
    model_waveform,
    run_polar,
    run_waveform,
    stacked,
    state_polar,
    state_waveform,
)
from rverror.views.plots.wear_curves import over_hours, worn_lobe

__all__ = [
    "PICTURES",
    "diagnosis_figure",
    "draw",
    "model_waveform",
    "new_figure",
    "order_map",
    "order_spectrum",
    "svg_element",
    "to_bytes",
    "waveform",
]

#: Plots of each kind of result by name, the usual one first.
PICTURES: Mapping[type, Mapping[str, Callable[..., Axes]]] = MappingProxyType(
    {
        Model: {
            "waveform": partial(model_waveform, most=6, waves=12),
            "stacked": stacked,
            "polar": model_polar,
            "spectrum": model_spectrum,
            "order_map": model_map,
            "mechanism": mechanism,
        },
        Reducer: {"mechanism": mechanism},
        Influence: {"waveform": influence_waveform},
        Equilibrium: {"waveform": state_waveform, "polar": state_polar, "spectrum": state_spectrum},
        TorsionCurve: {"torsion": torsion},
        Hysteresis: {"loop": loop},
        Efficiency: {"losses": losses},
        ContactPressure: {"pressure": pressures},
        Wear: {"hours": over_hours, "lobe": worn_lobe},
        Modes: {"shape": mode_shape},
        SpeedResponse: {"amplitudes": speed_amplitudes, "campbell": campbell, "order_map": speed_map},
        RunUp: {"waveform": run_up_waveform},
        Run: {"waveform": run_waveform, "polar": run_polar, "spectrum": run_spectrum},
        OrderTable: {"amplitudes": table_amplitudes, "passport": table_passport},
        Diagnosis: {
            "waveform": diagnosis_waveform,
            "spectrum": order_spectrum,
            "residual": residual,
            "runs": runs,
            "candidates": candidates,
            "resonances": resonance_plot,
            "order_map": diagnosis_map,
        },
        Compensation: {"orders": compensated_orders, "waveform": compensated_waveform},
        Budget: {"contributions": contributions, "envelope": envelope},
        ErrorBudget: {
            "contributions": contributions,
            "distribution": distribution,
            "envelope": envelope,
            "at_load": at_load,
        },
        VirtualUnits: {"distribution": distribution},
        Allocation: {"widths": widths, "costs": costs, "front": front_of, "at_load": at_load},
        Lot: {"processes": lot_processes, "shares": lot_shares, "orders": lot_orders, "predicted": lot_predicted},
        DriveLot: {"orders": drive_lot_orders},
        Trend: {"courses": trend_courses},
        RunsCompared: {"orders": compared_orders},
        Matched: {"errors": matched_errors},
    }
)


def draw(thing: Any, ax: Axes | None = None, *, kind: str | None = None, **options: Any) -> Axes:
    """Draw a result.

    Parameters
    ----------
    thing : Model or Run or Diagnosis or other result
        One of the kinds of `PICTURES`; each of them has it as its method ``plot``.
    ax : Axes, optional
        Where to draw; a new figure where left out, which a notebook shows where its cell ends with the plot.
    kind : str, optional
        Which of its plots; the usual one where left out.
    **options
        What that plot takes.  Options of one name mean the same in all of them:

        - `theta`: nominal output angles, rad, which the plot chooses where left out.
        - `direction`: +1 forward, -1 reverse.
        - `time`, `torque`: as `transmission_error` takes them.
        - `ratio`: Reducer, Drive, Model or input turns per output turn; needed of a run that holds input angles.
        - `highest`: highest order to show.
        - `run`: which run of a diagnosis, or condition of a lot, counted from 0.
        - `limit`: of the peak-to-peak, rad or with a unit, such as ``"60 arcsec"``.

    Returns
    -------
    Axes

    Raises
    ------
    InputError
        If there is no such plot or option, the axes are of the wrong sort, or matplotlib is not installed.

    Examples
    --------
    >>> import rverror
    >>> unit = rverror.Model(rverror.reducer("RV-40E"), (rverror.effect("crank.index", crank=0, angle="1 arcmin"),))
    >>> draw(unit, kind="stacked").get_ylabel()
    'transmission error, arcsec'
    """
    if isinstance(ax, str):
        raise InputError(f"ax = {ax!r}: a plot is chosen by its name, kind={ax!r}; what stands first are axes")
    plots = next((PICTURES[one] for one in type(thing).__mro__ if one in PICTURES), None)
    if plots is None:
        known = ", ".join(one.__name__ for one in PICTURES)
        raise InputError(f"a {type(thing).__name__} has no plot; these have: {known}; give one of them")
    chosen = next(iter(plots)) if kind is None else kind
    name = type(thing).__name__
    if chosen not in plots:
        hint = did_you_mean(str(chosen), plots)
        raise InputError(f"kind = {chosen!r}: a {name} is drawn as {', '.join(plots)};{hint or ' choose one of them'}")
    taken = [option for option in list(inspect.signature(plots[chosen]).parameters)[1:] if option != "ax"]
    for option in options:
        if option not in taken:
            hint = did_you_mean(option, taken)
            listed = ", ".join(taken) or "no options"
            raise InputError(f"option {option!r}: kind {chosen!r} of a {name} takes {listed};{hint or ' leave it out'}")
    return plots[chosen](thing, ax=ax, **options)
