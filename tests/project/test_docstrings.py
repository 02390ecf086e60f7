"""Docstrings hold what the reference promises: parameters of the signature, an example for every public name."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Iterator

import pytest
from numpydoc.validate import validate

from modules import IMPORTABLE, PUBLIC, named

#: What must hold of everything public: sections known and in order, parameters those of the signature.
EVERYWHERE = {"GL06", "GL07", "GL08", "PR02", "PR03", "PR05", "PR06", "SS01"}
#: And of functions of the package: every parameter and what comes back is described.
OF_THE_PACKAGE = {"PR01", "RT01"}
#: Results are shown where they are made.
SHOWN_BY = {
    "Allocation": "allocate",
    "BenchUncertainty": "bench_uncertainty",
    "Budget": "budget",
    "ContactPressure": "contact_pressure",
    "Diagnosis": "diagnose",
    "Effect": "effect",
    "DutyEfficiency": "duty_efficiency",
    "Efficiency": "efficiency",
    "Faults": "find_faults",
    "FittedRunningIn": "fit_running_in",
    "Equilibrium": "equilibrium",
    "ErrorBudget": "error_budget",
    "FrontPoint": "cost_front",
    "Hysteresis": "hysteresis",
    "Influence": "influence",
    "Limit": "limit",
    "Linearisation": "linearise",
    "Lot": "lot",
    "DriveLot": "lot_of_drives",
    "Modes": "modes",
    "OrderTable": "orders_from_arrays",
    "PressurePeak": "contact_pressure",
    "Run": "run_from_arrays",
    "RunUp": "run_up",
    "RunsCompared": "compare_runs",
    "CriticalSpeed": "speed_response",
    "SpeedResponse": "speed_response",
    "Stack": "stack",
    "Tolerance": "tolerance",
    "TorsionCurve": "torsion_curve",
    "VirtualUnits": "virtual_units",
    "Wear": "wear",
}
#: Names without an example, and why.
WITHOUT = {
    "ARCSEC": "a number",
    "CATALOGUE": "a mapping; `rverror sources` prints it",
    "Comparison": "needs the files of another tool; docs/test-your-tool.md",
    "ErrorVector": "docs/adding-an-effect.md",
    "Index": "docs/adding-an-effect.md",
    "InputError": "raised, not called",
    "NotConvergedError": "raised, not called",
    "Parameter": "docs/adding-an-effect.md",
    "PartsRead": "what `load_parts` gives",
    "Source": "docs/adding-an-effect.md",
    "compare": "needs the files of another tool; docs/test-your-tool.md",
    "UnitError": "what `unit_error` gives",
    "diagnose_folder": "starts processes; tests/app/test_batch.py",
    "draft_mapping": "the notebook on a bench's files drafts one",
    "load_mapping": "the notebook on a bench's files writes one",
    "load_orders": "the page on a bench's files reads one",
    "load_run": "the start page reads two runs",
    "diagnose_outsiders": "takes a minute; tests/lots/test_outsider_diagnosis.py",
    "lot_inputs": "needs a folder of runs; tests/lots/test_compressed.py",
    "lot": "takes a minute; tests/lots/test_made.py",
    "Lot": "takes a minute; tests/lots/test_made.py",
    "match": "takes seconds; tests/matching/test_matched.py",
    "Matched": "as `match`",
    "trend": "takes a quarter of a minute; tests/life/test_over_life.py",
    "Trend": "as `trend`",
    "tolerances_as_made": "of a lot; the notebook on lots goes on from it",
    "read_case": "needs the files of a case; docs/test-your-tool.md",
    "write_orders": "the page on a bench's files writes one",
    "write_run": "the notebook on a bench's files writes one",
}


def public_things(module: str) -> Iterator[str]:
    """Full names of the public functions and classes of a module, and of the public members of its classes."""
    loaded = importlib.import_module(module)
    for name, thing in vars(loaded).items():
        if name.startswith("_") or getattr(thing, "__module__", None) != loaded.__name__:
            continue
        if inspect.isfunction(thing):
            yield f"{loaded.__name__}.{name}"
        elif inspect.isclass(thing):
            yield f"{loaded.__name__}.{name}"
            for member, value in vars(thing).items():
                # a function that is a field's default is no method
                method = inspect.isfunction(value) and value.__qualname__ == f"{thing.__qualname__}.{member}"
                if not member.startswith("_") and (method or isinstance(value, property)):
                    yield f"{loaded.__name__}.{name}.{member}"


@pytest.mark.parametrize("module", IMPORTABLE)
def test_docstrings_keep_to_the_signature(module: str) -> None:
    for name in public_things(module):
        wrong = [error for error in validate(name)["errors"] if error[0] in EVERYWHERE]
        assert not wrong, f"{name}: {wrong}"


@pytest.mark.parametrize("name", PUBLIC)
def test_public_functions_describe_every_parameter(name: str) -> None:
    thing = named(PUBLIC[name])
    if inspect.isfunction(thing):
        errors = validate(f"{thing.__module__}.{name}")["errors"]
        returns = inspect.signature(thing).return_annotation not in (None, "None")
        wrong = [error for error in errors if error[0] in OF_THE_PACKAGE - (set() if returns else {"RT01"})]
        assert not wrong, f"{name}: {wrong}"


@pytest.mark.parametrize("name", PUBLIC)
def test_public_names_have_an_example(name: str) -> None:
    shown = ">>>" in (inspect.getdoc(named(PUBLIC[SHOWN_BY.get(name, name)])) or "")
    assert shown != (name in WITHOUT), f"{name}: give an example, or say in WITHOUT why there is none"
