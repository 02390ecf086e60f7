"""rverror: the output error of rotary vector (RV) reducers, from part errors to transmission error and back."""
# ruff: noqa: E402 - before the imports, what numpy reads as it is imported

import os as _os
import sys as _sys
from typing import TYPE_CHECKING

# before numpy, which reads it
from rverror.base.threads import one_for_a_diagnosis as _one_for_a_diagnosis

_one_for_a_diagnosis(_os.environ, _sys.orig_argv, _sys.modules)

from rverror.base.lazy import attach as _attach

# The names of a first program, and the rooms, whose names are `rverror.statics.linearise` and the like.  Each is loaded
# when it is first asked for: making the classes of all results takes longer than numpy.
if TYPE_CHECKING:
    from rverror import (
        app as app,
        base as base,
        compensation as compensation,
        diagnosis as diagnosis,
        dynamics as dynamics,
        geartrain as geartrain,
        life as life,
        lots as lots,
        matching as matching,
        model as model,
        parts as parts,
        reference as reference,
        runs as runs,
        statics as statics,
        tolerances as tolerances,
        views as views,
    )
    from rverror.base.errors import InputError as InputError
    from rverror.base.units import ARCSEC as ARCSEC
    from rverror.base.version import __version__ as __version__
    from rverror.compensation.making import compensate as compensate
    from rverror.diagnosis.loop import diagnose as diagnose
    from rverror.diagnosis.result import Diagnosis as Diagnosis
    from rverror.geartrain.mechanism import Drive as Drive, Reducer as Reducer, presets as presets, reducer as reducer
    from rverror.life.over_life import trend as trend
    from rverror.lots.made import lot as lot
    from rverror.matching.matched import match as match
    from rverror.model.catalogue import CATALOGUE as CATALOGUE
    from rverror.model.compose import influence as influence, transmission_error as transmission_error
    from rverror.model.effects import Effect as Effect, Model as Model, effect as effect
    from rverror.model.model_file import load_model as load_model, save_model as save_model
    from rverror.parts.reading import load_parts as load_parts
    from rverror.runs.measurement import Run as Run, load_run as load_run, run_from_arrays as run_from_arrays
    from rverror.runs.virtual_bench import simulate as simulate
    from rverror.statics.loaded_state import equilibrium as equilibrium
    from rverror.statics.rigidity import lost_motion as lost_motion
    from rverror.tolerances.allocation import allocate as allocate
    from rverror.tolerances.declared import tolerance as tolerance
    from rverror.tolerances.full_budget import error_budget as error_budget
    from rverror.tolerances.specification import limit as limit
    from rverror.tolerances.tolerance_file import load_tolerances as load_tolerances
    from rverror.views.plots.drawing import draw as draw
    from rverror.views.report import to_html as to_html, to_json as to_json, to_text as to_text
    from rverror.views.tables import to_pandas as to_pandas, to_xarray as to_xarray
else:
    #: Former names that the rooms do not have either, and what stands in their place.
    _RENAMED = {
        "allocation_json": "to_json",
        "allocation_text": "to_text",
        "budget_json": "to_json",
        "budget_text": "to_text",
        "costs": "tolerances.cost",
        "distributions": "tolerances.distribution",
    }
    __getattr__, __dir__ = _attach(__name__, renamed=_RENAMED)
