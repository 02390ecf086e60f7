"""Wrong types answer with one line that says the remedy, never with Python's insides, in every public function."""

from __future__ import annotations

import inspect
import traceback
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rverror
from modules import PUBLIC, named as by_name
from remedy import REMEDY

UNIT = rverror.reducer("RV-40E")
EFFECT = rverror.effect("crank.index", crank=0, angle="1 mrad")
MODEL = rverror.Model(UNIT, (EFFECT,))
THETA = np.linspace(0, 1, 16)
RUN = rverror.run_from_arrays(input_angle=121 * THETA, output_angle=THETA, torque="20 N*m")
CAMS = [rverror.tolerance("crank.eccentricity", "5 um", cost=rverror.tolerances.cost.Reciprocal(12.0, 0.005))]
STACK = rverror.tolerances.stack(MODEL, CAMS, THETA)
FRICTION = rverror.geartrain.Friction(pin=0.1)
ORDERS = rverror.runs.orders_from_arrays(direction=["forward"], order=[40.0], amplitude=[1e-5], phase=[0.0])
FILE = "there-is-no-such-file.csv"

#: A call that each function understands, but for what is not there yet.
CALLS: dict[str, tuple[tuple[Any, ...], dict[str, Any]]] = {
    "Model": ((UNIT, (EFFECT,)), {}),
    "allocate": ((MODEL, CAMS), {"limit": "60 arcsec", "kind": "worst"}),
    "allocate_at_load": ((MODEL, CAMS, [rverror.limit("lost_motion", "1 deg")]), {"sample": 64, "verify": 500}),
    "backlash": ((MODEL, THETA), {}),
    "budget": ((STACK,), {}),
    "compensate": ((MODEL, [RUN]), {}),
    "contact_pressure": ((MODEL, THETA), {"torque": 20e3, "disc_width": 9.0, "gear_width": 8.0}),
    "cost_front": ((STACK, ["60 arcsec"]), {"kind": "worst"}),
    "diagnose": ((MODEL, [RUN]), {}),
    "effect": (("crank.index",), {"crank": 0, "angle": "1 mrad"}),
    "duty_efficiency": (
        (MODEL, THETA),
        {"duty": rverror.statics.DutyPhase(torque=20e3, speed=100.0), "friction": FRICTION, "method": "closed"},
    ),
    "efficiency": ((MODEL, THETA), {"torque": 20e3, "friction": FRICTION}),
    "equilibrium": ((MODEL, THETA), {"torque": 20e3}),
    "error_budget": ((MODEL, CAMS, THETA), {"count": 64, "index_count": 64}),
    "fit_running_in": (
        (MODEL, [0, 1], [0, 1e-6]),
        {
            "coefficients": rverror.statics.WearCoefficients(disc=1e-13),
            "running_in": {},
            "free": ["lasting"],
            "torque": 20e3,
            "input_speed": 100.0,
            "disc_width": 9.0,
            "gear_width": 8.0,
            "direction": 1.0,
        },
    ),
    "frame_orders": ((UNIT,), {}),
    "fundamental_orders": ((UNIT,), {}),
    "hysteresis": ((MODEL, THETA), {"torques": [20e3], "friction": FRICTION}),
    "influence": ((UNIT, THETA, "crank.index"), {"crank": 0}),
    "limit": (("lost_motion", "60 arcsec"), {}),
    "linearise": ((MODEL, THETA), {"torque": 20e3}),
    "load_model": ((FILE,), {}),
    "load_run": ((FILE, UNIT), {}),
    "load_tolerances": ((FILE, MODEL), {}),
    "lost_motion": ((MODEL, THETA), {}),
    "lot_units": ((FILE, MODEL), {}),
    "lot_inputs": ((FILE, MODEL), {}),
    "modes": ((MODEL,), {"torque": 20e3}),
    "order_map": (([RUN, RUN],), {"ratio": UNIT}),
    "order_table_from_runs": (([RUN], UNIT, [40.0]), {}),
    "reducer": (("RV-40E",), {"cranks": 3}),
    "run_up": ((MODEL, [0.0, 0.1], [10.0, 10.0]), {"torque": 20e3}),
    "save_model": ((FILE, MODEL), {}),
    "simulate": ((MODEL,), {"points": 64}),
    "simulate_runs": ((MODEL,), {"points": 64}),
    "speed_response": ((MODEL, 10.0), {"torque": 20e3}),
    "stack": ((MODEL, CAMS, THETA), {}),
    "tolerance": (("crank.eccentricity", "5 um"), {}),
    "torsion_curve": ((MODEL, THETA), {"torques": [20e3]}),
    "torsional_stiffness": ((MODEL, THETA), {}),
    "transmission_error": ((MODEL, THETA), {}),
    "transmission_error_by_effect": ((MODEL, THETA), {}),
    "virtual_units": ((STACK, 64), {}),
    "wear": (
        (MODEL,),
        {
            "torque": 20e3,
            "input_speed": 100.0,
            "hours": [0, 1],
            "coefficients": rverror.statics.WearCoefficients(disc=1e-13),
            "disc_width": 9.0,
            "gear_width": 8.0,
            "direction": 1.0,
        },
    ),
    "write_orders": ((FILE, ORDERS), {}),
    "write_run": ((FILE, RUN), {}),
}
#: What people give in the place of something else.
MISTAKEN = {
    "a number": 3.0,
    "None": None,
    "a preset": "RV-40E",
    "a reducer": UNIT,
    "a model": MODEL,
    "an effect": EFFECT,
    "a list of effects": [EFFECT],
    "a run": RUN,
    "a list of runs": [RUN],
    "tolerances": CAMS,
    "a stack": STACK,
    "a file": Path(FILE),
    "a dict": {"crank": 0},
}
#: Those that take a row of one output turn for no angles at all, which is right, but long.
LONG_WITHOUT = {
    "hysteresis",
    "torsion_curve",
    "torsional_stiffness",
    "contact_pressure",
    "duty_efficiency",
    "efficiency",
    "influence",
}
#: Functions of a few plain values or of other tools' files, and those that take any result.
LEFT_OUT = {
    "bench_uncertainty", "coloured_noise",
    "compare", "compare_runs", "describe", "diagnose_folder", "diagnose_outsiders", "draft_mapping",
    "draw", "extended", "folded_order", "input_files",
    "find_faults", "line_style", "match",
    "load_compensation", "load_mapping", "lot", "lot_of_drives",
    "load_orders", "load_parts", "new_figure", "orders_from_arrays", "passport",
    "places_in_list", "preset_origins", "presets", "read_case", "run_from_arrays",
    "save_compensation", "save_parts", "save_widths",
    "to_core",
    "to_csv", "to_display", "to_html",
    "to_json", "to_pandas", "to_text", "to_xarray", "to_xlsx", "tolerances_as_made", "trend", "unit_error",
    "unit_of_parts", "validated",
}  # fmt: skip


def test_every_public_function_is_tried_or_left_out() -> None:
    functions = {name for name, full in PUBLIC.items() if inspect.isfunction(by_name(full))}
    assert functions == set(CALLS) - {"Model"} | LEFT_OUT
    assert not set(CALLS) & LEFT_OUT


def answer(call: Any, arguments: tuple[Any, ...], named: dict[str, Any]) -> Exception | None:
    try:
        call(*arguments, **named)
    except Exception as error:
        return error
    return None


def is_told(error: Exception) -> bool:
    """One line of rverror's own, with a remedy."""
    last = traceback.extract_tb(error.__traceback__)[-1]
    own = isinstance(error, (ValueError, TypeError, UserWarning)) and "rverror" in Path(last.filename).parts
    return own and "\n" not in str(error) and bool(REMEDY.search(str(error)))


@pytest.mark.parametrize("name", CALLS)
def test_what_is_mistaken_is_told(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    call, (arguments, named) = by_name(PUBLIC[name]), CALLS[name]
    parameters = list(inspect.signature(call).parameters.values())
    for place, right in enumerate(arguments):
        for mistaken in MISTAKEN.values():
            like = type(mistaken) is type(right) and not isinstance(mistaken, list)
            left_out = mistaken is None and (name in LONG_WITHOUT or parameters[place].default is None)
            if like or left_out or mistaken is right:
                continue
            error = answer(call, (*arguments[:place], mistaken, *arguments[place + 1 :]), named)
            assert error is None or is_told(error), f"{name}, {parameters[place].name}: {error!r}"


@pytest.mark.parametrize(
    ("call", "remedy"),
    [
        (lambda: rverror.Model("RV-40E", [EFFECT]), r"write Model\(reducer\('RV-40E'\)"),
        (lambda: rverror.Model(UNIT, EFFECT), r"Model\(unit\) \+ one"),
        (lambda: rverror.Model(UNIT, ["crank.index"]), r"make it with effect\("),
        (lambda: rverror.Model(UNIT) + "crank.index", r"make it with effect\("),
        (lambda: rverror.transmission_error(UNIT, THETA), r"write Model\(unit\)"),
        (lambda: rverror.influence(UNIT, THETA, EFFECT), "give a key of the catalogue"),
        (lambda: rverror.influence(THETA, UNIT, "crank.index", crank=0), r"give reducer\('RV-40E'\)"),
        (lambda: rverror.influence(MODEL, THETA, "crank.index", crank=0), r"model\.influence\(theta, key\)"),
        (lambda: rverror.save_model(MODEL, "unit.toml"), "give the path of a file first"),
        (lambda: rverror.error_budget(MODEL, "tolerances.toml"), r"give load_tolerances\(path\)"),
        (lambda: rverror.diagnose(MODEL, RUN), "give a list of runs"),
        (lambda: rverror.diagnose([RUN], MODEL), "model is a list"),
        (lambda: rverror.tolerances.virtual_units(None, count=3), "stack"),
        (lambda: rverror.allocate(MODEL, "tolerances.toml", limit=1e-4), r"give load_tolerances\(path\)"),
    ],
)
def test_the_remedy_fits_the_call(call: Any, remedy: str) -> None:
    with pytest.raises(rverror.InputError, match=remedy):
        call()
