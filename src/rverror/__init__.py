"""rverror: the output error of rotary vector (RV) reducers, from part errors to transmission error and back."""

from rverror.allocate import Allocation, allocate, cost_front
from rverror.batch import diagnose_folder
from rverror.budget import Budget, budget
from rverror.budget_report import allocation_json, allocation_text, budget_json, budget_text
from rverror.catalogue import CATALOGUE
from rverror.compose import influence, transmission_error, transmission_error_by_effect
from rverror.diagnose import Diagnosis, diagnose
from rverror.equilibrium import Equilibrium, Linearisation, equilibrium, linearise
from rverror.error_budget import ErrorBudget, error_budget
from rverror.errors import InputError
from rverror.measurement import Run, load_run, run_from_arrays, write_run
from rverror.model import Effect, Model, effect
from rverror.model_file import append_effects, load_model, save_model
from rverror.reducer import Drive, Reducer, Stiffness, reducer
from rverror.report import to_json, to_text
from rverror.rigidity import TorsionCurve, backlash, lost_motion, torsion_curve, torsional_stiffness
from rverror.simulate import simulate, simulate_runs
from rverror.tables import to_pandas, to_xarray
from rverror.tolerance import Stack, Tolerance, stack, tolerance
from rverror.tolerance_file import load_tolerances, save_widths
from rverror.virtual_units import VirtualUnits, virtual_units

__version__ = "0.1.0"

__all__ = [
    "CATALOGUE",
    "Allocation",
    "Budget",
    "Diagnosis",
    "Drive",
    "Effect",
    "Equilibrium",
    "ErrorBudget",
    "InputError",
    "Linearisation",
    "Model",
    "Reducer",
    "Run",
    "Stack",
    "Stiffness",
    "Tolerance",
    "TorsionCurve",
    "VirtualUnits",
    "allocate",
    "allocation_json",
    "allocation_text",
    "append_effects",
    "backlash",
    "budget",
    "budget_json",
    "budget_text",
    "cost_front",
    "diagnose",
    "diagnose_folder",
    "effect",
    "equilibrium",
    "error_budget",
    "influence",
    "linearise",
    "load_model",
    "load_run",
    "load_tolerances",
    "lost_motion",
    "reducer",
    "run_from_arrays",
    "save_model",
    "save_widths",
    "simulate",
    "simulate_runs",
    "stack",
    "to_json",
    "to_pandas",
    "to_text",
    "to_xarray",
    "tolerance",
    "torsion_curve",
    "torsional_stiffness",
    "transmission_error",
    "transmission_error_by_effect",
    "virtual_units",
    "write_run",
]
