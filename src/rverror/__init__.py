"""rverror: the output error of rotary vector (RV) reducers, from part errors to transmission error and back."""

from rverror.batch import diagnose_folder
from rverror.catalogue import CATALOGUE
from rverror.compose import influence, transmission_error, transmission_error_by_effect
from rverror.diagnose import Diagnosis, diagnose
from rverror.equilibrium import Equilibrium, Linearisation, equilibrium, linearise
from rverror.errors import InputError
from rverror.measurement import Run, load_run, run_from_arrays, write_run
from rverror.model import Effect, Model, effect
from rverror.model_file import append_effects, load_model, save_model
from rverror.reducer import Drive, Reducer, Stiffness, reducer
from rverror.report import to_json, to_text
from rverror.rigidity import TorsionCurve, backlash, lost_motion, torsion_curve, torsional_stiffness
from rverror.simulate import simulate, simulate_runs

__version__ = "0.1.0"

__all__ = [
    "CATALOGUE",
    "Diagnosis",
    "Drive",
    "Effect",
    "Equilibrium",
    "InputError",
    "Linearisation",
    "Model",
    "Reducer",
    "Run",
    "Stiffness",
    "TorsionCurve",
    "append_effects",
    "backlash",
    "diagnose",
    "diagnose_folder",
    "effect",
    "equilibrium",
    "influence",
    "linearise",
    "load_model",
    "load_run",
    "lost_motion",
    "reducer",
    "run_from_arrays",
    "save_model",
    "simulate",
    "simulate_runs",
    "to_json",
    "to_text",
    "torsion_curve",
    "torsional_stiffness",
    "transmission_error",
    "transmission_error_by_effect",
    "write_run",
]
