"""rverror: the output error of rotary vector (RV) reducers, from part errors to transmission error and back."""
# ruff: noqa: I001, E402 - the imports stand by doors, in each by rooms; before them, what numpy reads as it is imported

import os as _os
import sys as _sys
import warnings as _warnings
from importlib import import_module
from typing import TYPE_CHECKING, Any

# before numpy, which reads it
from rverror.base.threads import one_for_a_diagnosis as _one_for_a_diagnosis

_one_for_a_diagnosis(_os.environ, _sys.orig_argv, _sys.modules)

# What is declared of a unit, and its error in closed form: hardly a program does without.
from rverror.base.errors import InputError
from rverror.base.text import describe
from rverror.base.units import ARCSEC, to_core, to_display
from rverror.base.version import __version__
from rverror.geartrain.action_line import ErrorVector
from rverror.geartrain.kinematics import Conditions, folded_order, frame_orders, fundamental_orders
from rverror.geartrain.mechanism import (
    BearingPreload,
    ContactLaw,
    Drive,
    Friction,
    Inertia,
    Reducer,
    Stiffness,
    StiffnessUncertainty,
    preset_origins,
    presets,
    reducer,
)
from rverror.geartrain.source import Index, Parameter, Source
from rverror.geartrain.torque_over_turn import GravityArm
from rverror.model.catalogue import CATALOGUE, extended
from rverror.model import results as _results
from rverror.model.results import Equilibrium, Influence
from rverror.model.compose import influence, transmission_error, transmission_error_by_effect
from rverror.model.effects import Effect, Model, effect
from rverror.model.ends import Bench, Encoders
from rverror.model.model_file import append_effects, load_model, save_model
from rverror.base import viewed as _viewed

# Loaded when they are first asked for: making their classes takes longer than numpy.
if TYPE_CHECKING:
    # What errors do to the output under load and at speed.
    from rverror.statics.duty import DutyEfficiency, DutyPhase, Lubricant, duty_efficiency
    from rverror.statics.friction import Efficiency, Hysteresis, efficiency, hysteresis
    from rverror.statics.hertz import ContactPressure, PressurePeak, RollerBearing, contact_pressure
    from rverror.statics.loaded_state import Linearisation, NotConvergedError, equilibrium, linearise
    from rverror.statics.rigidity import TorsionCurve, backlash, lost_motion, torsion_curve, torsional_stiffness
    from rverror.statics.running_in import FittedRunningIn, fit_running_in
    from rverror.statics.worn_contacts import RunningIn, Wear, WearCoefficients, wear
    from rverror.dynamics.at_speed import CriticalSpeed, SpeedResponse, speed_response
    from rverror.dynamics.natural_modes import Modes, modes
    from rverror.dynamics.running_up import RunUp, run_up

    # Runs and diagnosis: what a bench measured or would measure, and what the model lacks.
    from rverror.runs.bench.draft import draft_mapping
    from rverror.runs.bench.mapping import load_mapping
    from rverror.runs.measuring_chain import BenchUncertainty, bench_uncertainty
    from rverror.runs.measurement import Run, load_run, run_from_arrays, write_run
    from rverror.runs.order_file import load_orders, orders_from_arrays, write_orders
    from rverror.runs.order_fit import order_table_from_runs
    from rverror.runs.order_table import OrderTable
    from rverror.runs.virtual_bench import coloured_noise, simulate, simulate_runs
    from rverror.diagnosis.loop import diagnose
    from rverror.diagnosis.order_passport import passport
    from rverror.diagnosis.policy import Policy
    from rverror.diagnosis.result import Diagnosis
    from rverror.diagnosis.validation import validated
    from rverror.app.batch import diagnose_folder

    # Compensation: what a controller adds to the command, and what it leaves.
    from rverror.compensation.correction import Correction
    from rverror.compensation.making import compensate
    from rverror.compensation.outcome import Compensation
    from rverror.compensation.table_files import load_compensation, save_compensation

    # Tolerances: what they make of the error, and which to buy.
    from rverror.tolerances import cost as costs
    from rverror.tolerances import distribution as distributions
    from rverror.tolerances.allocation import Allocation, FrontPoint, allocate, cost_front, terms  # noqa: F401
    from rverror.tolerances.closed_form import Budget, budget
    from rverror.tolerances.full_budget import ErrorBudget, error_budget
    from rverror.tolerances.loaded_allocation import allocate_at_load
    from rverror.tolerances.sampling import VirtualUnits, virtual_units
    from rverror.tolerances.specification import Limit, limit
    from rverror.tolerances.stacking import Stack, stack
    from rverror.tolerances.declared import Tolerance, tolerance
    from rverror.tolerances.tolerance_file import load_tolerances, save_widths

    # Lots: what the processes made, told from many measured units.
    from rverror.lots.as_made import tolerances_as_made
    from rverror.lots.compressed import compress_lot, load_amplitudes
    from rverror.lots.folder import lot_units
    from rverror.lots.made import lot
    from rverror.lots.of_drives import DriveLot, lot_of_drives
    from rverror.lots.outsider_diagnosis import diagnose_outsiders
    from rverror.lots.result import Lot

    # Measured parts: from a measuring machine's file to a unit with its uncertainty.
    from rverror.parts.measured import MeasuredPart
    from rverror.parts.parts_table import save_parts
    from rverror.parts.reading import PartsRead, load_parts
    from rverror.parts.unit import UnitError, unit_error, unit_of_parts
    from rverror.matching.matched import match
    from rverror.matching.result import Matched

    # A unit over its life: what grows and what jumped, told from runs at different times.
    from rverror.life.compared import compare_runs
    from rverror.life.over_life import trend
    from rverror.life.result import RunsCompared, Trend

    # Pictures and tables: any result as text, JSON, page, table or plot.
    from rverror.views.envelope import input_files
    from rverror.views.report import to_csv, to_html, to_json, to_text
    from rverror.views.tables import to_pandas, to_xarray
    from rverror.views.plots.drawing import draw, order_map
    from rverror.views.plots.figure import new_figure
    from rverror.views.plots.style import line_style

    # Reference cases for other tools.
    from rverror.reference.cases import read_case
    from rverror.reference.comparison import Comparison, compare

#: Where each of them is; two are modules.
_LATER = {
    "Allocation": "tolerances.allocation",
    "BenchUncertainty": "runs.measuring_chain",
    "Budget": "tolerances.closed_form",
    "Comparison": "reference.comparison",
    "Compensation": "compensation.outcome",
    "ContactPressure": "statics.hertz",
    "Correction": "compensation.correction",
    "CriticalSpeed": "dynamics.at_speed",
    "Diagnosis": "diagnosis.result",
    "DriveLot": "lots.of_drives",
    "DutyEfficiency": "statics.duty",
    "DutyPhase": "statics.duty",
    "Efficiency": "statics.friction",
    "ErrorBudget": "tolerances.full_budget",
    "FittedRunningIn": "statics.running_in",
    "FrontPoint": "tolerances.allocation",
    "Hysteresis": "statics.friction",
    "Limit": "tolerances.specification",
    "Linearisation": "statics.loaded_state",
    "Lot": "lots.result",
    "Lubricant": "statics.duty",
    "MeasuredPart": "parts.measured",
    "Matched": "matching.result",
    "Modes": "dynamics.natural_modes",
    "NotConvergedError": "statics.loaded_state",
    "OrderTable": "runs.order_table",
    "PartsRead": "parts.reading",
    "Policy": "diagnosis.policy",
    "PressurePeak": "statics.hertz",
    "RollerBearing": "statics.hertz",
    "Run": "runs.measurement",
    "RunUp": "dynamics.running_up",
    "RunningIn": "statics.worn_contacts",
    "RunsCompared": "life.result",
    "SpeedResponse": "dynamics.at_speed",
    "Stack": "tolerances.stacking",
    "Tolerance": "tolerances.declared",
    "TorsionCurve": "statics.rigidity",
    "Trend": "life.result",
    "UnitError": "parts.unit",
    "VirtualUnits": "tolerances.sampling",
    "Wear": "statics.worn_contacts",
    "WearCoefficients": "statics.worn_contacts",
    "allocate": "tolerances.allocation",
    "allocate_at_load": "tolerances.loaded_allocation",
    "backlash": "statics.rigidity",
    "bench_uncertainty": "runs.measuring_chain",
    "budget": "tolerances.closed_form",
    "coloured_noise": "runs.virtual_bench",
    "compare": "reference.comparison",
    "compensate": "compensation.making",
    "compare_runs": "life.compared",
    "compress_lot": "lots.compressed",
    "contact_pressure": "statics.hertz",
    "cost_front": "tolerances.allocation",
    "diagnose": "diagnosis.loop",
    "diagnose_folder": "app.batch",
    "diagnose_outsiders": "lots.outsider_diagnosis",
    "draft_mapping": "runs.bench.draft",
    "draw": "views.plots.drawing",
    "duty_efficiency": "statics.duty",
    "efficiency": "statics.friction",
    "equilibrium": "statics.loaded_state",
    "error_budget": "tolerances.full_budget",
    "fit_running_in": "statics.running_in",
    "hysteresis": "statics.friction",
    "input_files": "views.envelope",
    "limit": "tolerances.specification",
    "line_style": "views.plots.style",
    "linearise": "statics.loaded_state",
    "load_amplitudes": "lots.compressed",
    "load_compensation": "compensation.table_files",
    "load_mapping": "runs.bench.mapping",
    "load_orders": "runs.order_file",
    "load_parts": "parts.reading",
    "load_run": "runs.measurement",
    "load_tolerances": "tolerances.tolerance_file",
    "lost_motion": "statics.rigidity",
    "lot": "lots.made",
    "lot_of_drives": "lots.of_drives",
    "lot_units": "lots.folder",
    "match": "matching.matched",
    "modes": "dynamics.natural_modes",
    "new_figure": "views.plots.figure",
    "order_map": "views.plots.drawing",
    "order_table_from_runs": "runs.order_fit",
    "orders_from_arrays": "runs.order_file",
    "passport": "diagnosis.order_passport",
    "read_case": "reference.cases",
    "run_from_arrays": "runs.measurement",
    "run_up": "dynamics.running_up",
    "save_compensation": "compensation.table_files",
    "save_parts": "parts.parts_table",
    "save_widths": "tolerances.tolerance_file",
    "simulate": "runs.virtual_bench",
    "simulate_runs": "runs.virtual_bench",
    "speed_response": "dynamics.at_speed",
    "stack": "tolerances.stacking",
    "terms": "tolerances.allocation",
    "to_csv": "views.report",
    "to_html": "views.report",
    "to_json": "views.report",
    "to_pandas": "views.tables",
    "to_text": "views.report",
    "to_xarray": "views.tables",
    "tolerance": "tolerances.declared",
    "tolerances_as_made": "lots.as_made",
    "torsion_curve": "statics.rigidity",
    "torsional_stiffness": "statics.rigidity",
    "trend": "life.over_life",
    "unit_error": "parts.unit",
    "unit_of_parts": "parts.unit",
    "validated": "diagnosis.validation",
    "virtual_units": "tolerances.sampling",
    "wear": "statics.worn_contacts",
    "write_orders": "runs.order_file",
    "write_run": "runs.measurement",
}
_LATER_MODULES = {"costs": "tolerances.cost", "distributions": "tolerances.distribution"}

__all__ = [
    "ARCSEC",
    "CATALOGUE",
    "Allocation",
    "BearingPreload",
    "Bench",
    "BenchUncertainty",
    "Budget",
    "Comparison",
    "Compensation",
    "Conditions",
    "ContactLaw",
    "ContactPressure",
    "Correction",
    "CriticalSpeed",
    "Diagnosis",
    "Drive",
    "DriveLot",
    "DutyEfficiency",
    "DutyPhase",
    "Effect",
    "Efficiency",
    "Encoders",
    "Equilibrium",
    "ErrorBudget",
    "ErrorVector",
    "FittedRunningIn",
    "Friction",
    "FrontPoint",
    "GravityArm",
    "Hysteresis",
    "Index",
    "Inertia",
    "Influence",
    "InputError",
    "Limit",
    "Linearisation",
    "Lot",
    "Lubricant",
    "Matched",
    "MeasuredPart",
    "Model",
    "Modes",
    "NotConvergedError",
    "OrderTable",
    "Parameter",
    "PartsRead",
    "Policy",
    "PressurePeak",
    "Reducer",
    "RollerBearing",
    "Run",
    "RunUp",
    "RunningIn",
    "RunsCompared",
    "Source",
    "SpeedResponse",
    "Stack",
    "Stiffness",
    "StiffnessUncertainty",
    "Tolerance",
    "TorsionCurve",
    "Trend",
    "UnitError",
    "VirtualUnits",
    "Wear",
    "WearCoefficients",
    "__version__",
    "allocate",
    "allocate_at_load",
    "append_effects",
    "backlash",
    "bench_uncertainty",
    "budget",
    "coloured_noise",
    "compare",
    "compare_runs",
    "compensate",
    "compress_lot",
    "contact_pressure",
    "cost_front",
    "costs",
    "describe",
    "diagnose",
    "diagnose_folder",
    "diagnose_outsiders",
    "distributions",
    "draft_mapping",
    "draw",
    "duty_efficiency",
    "effect",
    "efficiency",
    "equilibrium",
    "error_budget",
    "extended",
    "fit_running_in",
    "folded_order",
    "frame_orders",
    "fundamental_orders",
    "hysteresis",
    "influence",
    "input_files",
    "limit",
    "line_style",
    "linearise",
    "load_amplitudes",
    "load_compensation",
    "load_mapping",
    "load_model",
    "load_orders",
    "load_parts",
    "load_run",
    "load_tolerances",
    "lost_motion",
    "lot",
    "lot_of_drives",
    "lot_units",
    "match",
    "modes",
    "new_figure",
    "order_map",
    "order_table_from_runs",
    "orders_from_arrays",
    "passport",
    "preset_origins",
    "presets",
    "read_case",
    "reducer",
    "run_from_arrays",
    "run_up",
    "save_compensation",
    "save_model",
    "save_parts",
    "save_widths",
    "simulate",
    "simulate_runs",
    "speed_response",
    "stack",
    "to_core",
    "to_csv",
    "to_display",
    "to_html",
    "to_json",
    "to_pandas",
    "to_text",
    "to_xarray",
    "tolerance",
    "tolerances_as_made",
    "torsion_curve",
    "torsional_stiffness",
    "transmission_error",
    "transmission_error_by_effect",
    "trend",
    "unit_error",
    "unit_of_parts",
    "validated",
    "virtual_units",
    "wear",
    "write_orders",
    "write_run",
]


#: Names of before, and what has taken their place: until the next version.
_FORMER = {
    "allocation_json": "to_json",
    "allocation_text": "to_text",
    "budget_json": "to_json",
    "budget_text": "to_text",
}


def __getattr__(name: str) -> Any:
    if name in _FORMER:
        _warnings.warn(f"rverror.{name} is rverror.{_FORMER[name]} now; write that", DeprecationWarning, stacklevel=2)
        name = _FORMER[name]
    if name in _LATER_MODULES:
        return import_module(f"{__name__}.{_LATER_MODULES[name]}")
    if name not in _LATER:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_LATER[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)


_results.error_of.register(Model, transmission_error)


@_results.equilibrium_of.register
def _equilibrium_of(model: Model, theta: Any, **conditions: Any) -> Equilibrium:
    found: Equilibrium = __getattr__("equilibrium")(model, theta, **conditions)
    return found


@_viewed.picture_of.register
def _picture_of(thing: _viewed.Viewed, **options: Any) -> Any:
    return __getattr__("draw")(thing, **options)


@_viewed.line_of.register
def _line_of(thing: _viewed.Viewed) -> str:
    from rverror.views.notebook import line

    return line(thing)


@_viewed.page_of.register
def _page_of(thing: _viewed.Viewed) -> str:
    from rverror.views.notebook import page

    return page(thing)
