"""Reference cases for other tools: what they are, their numbers, and their files."""

from __future__ import annotations

import cmath
import hashlib
import io
import json
import math
import os
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.directions import DIRECTIONS
from rverror.base.errors import InputError
from rverror.base.numbers import in_arcsec, rounded, way
from rverror.base.text import PathLike, did_you_mean, read_bytes, read_text, shown
from rverror.base.units import ARCSEC
from rverror.base.version import __version__
from rverror.geartrain.action_line import CONTACT_AXES
from rverror.geartrain.contacts import closed_form_forces, pose
from rverror.geartrain.kinematics import OperatingConditions, frame_orders
from rverror.geartrain.mechanism import Reducer, reducer
from rverror.model.catalogue import source
from rverror.model.compose import effect_matrix, transmission_error
from rverror.model.effects import Effect, Model, effect
from rverror.runs.order_table import Waves
from rverror.runs.spectrum import harmonics
from rverror.statics.loaded_state import linearise
from rverror.views.html import shipped

Method = Literal["equilibrium", "closed"]

METHODS: tuple[Method, ...] = ("equilibrium", "closed")
#: Of case.json and case.npz; grows when a reader of the old form would misread the new one.
FORMAT = 1
#: Angles of a turn: what the orders of the gear and cycloid mesh need.
POINTS = 4096
_FORCE_ANGLES = 64
#: Digits of a number that is told; the arrays hold all.
DIGITS = 10
_LEADING = 12  # orders told in case.json
_SHARE = 0.01  # of the largest order, below which none is told
_TURN = 2 * math.pi
_AGAIN = "write the case again with `rverror reference-cases`"
#: Waves below this, rad, are next to nothing.
LEAST = 1e-3 * ARCSEC
#: Methods for people.
WORDS: Mapping[Method, str] = {"equilibrium": "equilibrium", "closed": "closed form"}


@dataclass(frozen=True)
class Definition:
    """What a reference case is, before it is solved.

    Attributes
    ----------
    name : str
        Of its folder.
    shows : str
        The one thing that it isolates.
    torque : float
        Size of the output torque, N*mm.
    direction : float
        +1 forward, -1 reverse.
    closed_form : str
        What holds of the closed form; empty where it does not and is left out.
    known : sequence of mapping
        Numbers found otherwise, to hold the case against, as the file of the cases has them.
    """

    name: str
    shows: str
    model: Model
    torque: float
    direction: float
    closed_form: str
    known: Sequence[Mapping[str, Any]]


@dataclass(frozen=True, eq=False)
class SolvedCase:
    """A reference case with its numbers.

    Attributes
    ----------
    arrays : mapping of str to ndarray
        What ``case.npz`` holds, see `ARRAYS`.
    imbalance : float
        Largest residual of the equilibrium, as in `Equilibrium.residual`.
    """

    definition: Definition
    arrays: Mapping[str, npt.NDArray[Any]]
    imbalance: float


@dataclass(frozen=True, eq=False)
class StoredCase:
    """A reference case as read from its files.

    Attributes
    ----------
    name, version : str
        Of the case, and of the rverror that wrote it.
    arrays : mapping of str to ndarray
    """

    name: str
    version: str
    ratio: float
    direction: float
    arrays: Mapping[str, npt.NDArray[Any]]


#: What ``data/reference-cases.toml`` says of the cases, their arrays and a comparison.
SHIPPED: Mapping[str, Any] = tomllib.loads(shipped("reference-cases.toml"))


def _force_array(key: str) -> dict[str, str]:
    parts, _, axes = CONTACT_AXES[key].rpartition(": ")
    unit = "N*mm" if key == "spline" else "N"
    return {"axes": f"{axes.strip('()')}, m", "unit": unit, "what": f"equilibrium, force of {parts}"}


#: Arrays of case.npz: axes, unit, and what they hold.
ARRAYS: Mapping[str, Mapping[str, str]] = {
    **SHIPPED["arrays"],
    **{f"force_{key}": _force_array(key) for key in CONTACT_AXES if key != "output"},
}


# --- the cases --------------------------------------------------------------------------------------------------------


def definitions() -> tuple[Definition, ...]:
    """The reference cases, as ``data/reference-cases.toml`` has them."""
    cases = SHIPPED["case"]
    errors = {case["name"]: case.get("effects", ()) for case in cases}
    return tuple(_definition(case, errors[case.get("same_errors_as", case["name"])]) for case in cases)


def _definition(case: Mapping[str, Any], errors: Sequence[Mapping[str, Any]]) -> Definition:
    model = Model(
        reducer(case.get("preset", "RV-40E")),
        tuple(effect(**one) for one in errors),
        case["name"].replace("-", " "),
    )
    return Definition(
        case["name"],
        case["shows"],
        model,
        units.parse(case.get("torque", "412 N*m"), "torque"),
        case.get("direction", 1.0),
        case.get("closed_form", ""),
        case.get("known", ()),
    )


def pick(names: Sequence[str]) -> tuple[Definition, ...]:
    """Reference cases by name, all where no name is given.

    Returns
    -------
    tuple of Definition
        In the order of `definitions`, each once.

    Raises
    ------
    InputError
        If there is no such case.
    """
    all_cases = definitions()
    known = [case.name for case in all_cases]
    for name in names:
        if name not in known:
            hint = did_you_mean(name, known)
            raise InputError(f"--case: no case {shown(name)};{hint} give one of {', '.join(known)}")
    return tuple(case for case in all_cases if not names or case.name in names)


def solve(definition: Definition, *, points: int = POINTS) -> SolvedCase:
    """Compute a reference case.

    Parameters
    ----------
    points : int
        Angles of the turn.
    """
    model, direction = definition.model, definition.direction
    turn = _TURN * np.arange(points) / points
    theta = turn if direction > 0 else _TURN - turn
    here = OperatingConditions(theta, direction, definition.torque)
    loaded = linearise(model, here)
    some = np.arange(0, points, max(1, points // _FORCE_ANGLES))
    arrays: dict[str, npt.NDArray[Any]] = {"theta": theta}
    if definition.closed_form:
        arrays["transmission_error_closed"] = transmission_error(model, here)
    arrays["transmission_error_equilibrium"] = loaded.state.transmission_error
    arrays["influence_labels"] = np.array(_labels(model.effects), dtype=np.str_)
    if definition.closed_form:
        motion = pose(model.mechanism, here)
        arrays["influence_closed"] = effect_matrix(motion, closed_form_forces(motion), model.effects)
    arrays["influence_equilibrium"] = effect_matrix(loaded.motion, loaded.forces, model.effects)
    arrays["force_theta"] = theta[some]
    for key, force in loaded.state.contact_forces.items():
        arrays[f"force_{key}"] = force[..., some]
    return SolvedCase(definition, arrays, float(loaded.state.residual.max()))


def _labels(effects: Sequence[Effect]) -> list[str]:
    return [
        " ".join([e.key, *(f"{name}={value}" for name, value in e.indices.items()), parameter.name])
        for e in effects
        for parameter in source(e.key).parameters
    ]


# --- writing ----------------------------------------------------------------------------------------------------------


def case_npz(case: SolvedCase) -> bytes:
    """Bytes of ``case.npz``, the same for the same arrays."""
    whole, arrays = io.BytesIO(), dict[str, Any](case.arrays)
    np.savez(whole, **arrays)
    return whole.getvalue()


def case_json(case: SolvedCase) -> dict[str, Any]:
    """Content of ``case.json``; keys are only ever added within one format.

    Returns
    -------
    dict
    """
    what = case.definition
    unit = what.model.mechanism
    assert isinstance(unit, Reducer)
    arrays = case.arrays
    closed, loaded = (waveform(arrays, method) for method in ("closed", "equilibrium"))
    gap = None if closed is None or loaded is None else float(np.std(loaded - closed))
    return {
        "format": FORMAT,
        "name": what.name,
        "shows": what.shows,
        "version": __version__,
        "conventions": "docs/conventions.md",
        "model": {
            "units": {name: units.CORE_UNITS[name] for name in ("length", "angle", "torque", "stiffness")},
            "reducer": asdict(unit),
            "ratio": unit.ratio,
            "turns_per_output_turn": frame_orders(unit),
            "effects": [_effect_json(item) for item in what.model.effects],
        },
        "direction": way(what.direction),
        "torque": {"value": what.torque, "unit": units.CORE_UNITS["torque"]},
        "angles": {"count": arrays["theta"].size, "first": arrays["theta"][0], "last": arrays["theta"][-1]},
        "phase": "a wave is amplitude * cos(order * theta - phase)",
        "closed_form": _waveform_json(closed)
        | {"holds": what.closed_form or "it does not hold here", "rms_from_equilibrium_arcsec": in_arcsec(gap, DIGITS)},
        "equilibrium": _waveform_json(loaded) | {"largest_residual": rounded(case.imbalance, DIGITS)},
        "known": [{**one, "method": WORDS[one["method"]]} for one in what.known],
        "arrays": {name: ARRAYS[name] for name in arrays},
        "npz_sha256": hashlib.sha256(case_npz(case)).hexdigest(),
    }


def case_files(case: SolvedCase) -> Mapping[str, bytes]:
    """Files of a reference case by name, the one that names the other's hash last."""
    return {
        "case.npz": case_npz(case),
        "case.json": (json.dumps(case_json(case), indent=1) + "\n").encode(),
    }


def _effect_json(item: Effect) -> dict[str, Any]:
    return {
        "key": item.key,
        "indices": dict(item.indices),
        "parameters": {
            parameter.name: {"value": value, "unit": units.CORE_UNITS[parameter.dimension]}
            for parameter, value in zip(source(item.key).parameters, item.values, strict=True)
        },
    }


def _waveform_json(error: Array | None) -> dict[str, Any]:
    if error is None:
        return {"offset_arcsec": None, "rms_arcsec": None, "peak_to_peak_arcsec": None, "orders": []}
    waves = waves_of(error)
    leading = np.argsort(-np.abs(waves), kind="stable")[:_LEADING]
    least = max(LEAST, _SHARE * float(np.abs(waves).max()))
    return {
        "offset_arcsec": in_arcsec(float(error.mean()), DIGITS),
        "rms_arcsec": in_arcsec(float(np.std(error)), DIGITS),
        "peak_to_peak_arcsec": in_arcsec(float(np.ptp(error)), DIGITS),
        "orders": [{"order": int(i) + 1, **wave_json(waves[i])} for i in leading if abs(waves[i]) >= least],
    }


# --- waves of a turn, as case.json and a comparison tell them ---------------------------------------------------------


def waveform(arrays: Mapping[str, npt.NDArray[Any]], method: Method) -> Array | None:
    """Transmission error of a case over growing angles from 0, rad; None where it holds none by this method."""
    values = arrays.get(f"transmission_error_{method}")
    return None if values is None else np.asarray(values[np.argsort(arrays["theta"] % _TURN, kind="stable")])


def waves_of(values: Array) -> Waves:
    """Amplitude * exp(i phase) of orders 1 to below half the angles, of a turn that starts at 0."""
    return np.conj(harmonics(values))


def phase_of(wave: complex) -> float:
    """Phase, rad; not a number where the wave is next to nothing."""
    return cmath.phase(wave) if abs(wave) >= 1e-4 * ARCSEC else math.nan


def wave_json(wave: complex) -> dict[str, Any]:
    """Amplitude and phase."""
    phase = math.degrees(phase_of(wave))
    return {"amplitude_arcsec": in_arcsec(abs(wave), DIGITS), "phase_deg": rounded(phase, DIGITS)}


# --- reading ----------------------------------------------------------------------------------------------------------


def read_case(path: PathLike) -> StoredCase:
    """Read a reference case and check its hash.

    Parameters
    ----------
    path : str or path-like
        Folder of the case, or its ``case.json``.

    Returns
    -------
    StoredCase

    Raises
    ------
    InputError
        If it is no case, of another format, or its arrays are not those that were written.
    """
    described = Path(path, "case.json") if os.path.isdir(path) else Path(path)
    text = read_text(described)
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as problem:
        raise InputError(f"{described}: this is no JSON; give the folder of a case or its case.json") from problem
    if not isinstance(content, dict) or "format" not in content or "npz_sha256" not in content:
        raise InputError(f"{described}: this is no reference case; write one with `rverror reference-cases`")
    if content["format"] != FORMAT:
        raise InputError(f"{described}: format {shown(content['format'])}, this rverror reads {FORMAT}; {_AGAIN}")
    stored = described.with_name("case.npz")
    raw = read_bytes(stored)
    if hashlib.sha256(raw).hexdigest() != content["npz_sha256"]:
        raise InputError(f"{stored}: it is not that of case.json, their hash differs; {_AGAIN}")
    with np.load(io.BytesIO(raw), allow_pickle=False) as archive:
        arrays = {name: archive[name] for name in archive.files}
    try:
        return StoredCase(
            name=str(content["name"]),
            version=str(content["version"]),
            ratio=float(content["model"]["ratio"]),
            direction=DIRECTIONS[content["direction"]],
            arrays=arrays,
        )
    except (KeyError, TypeError, ValueError, AttributeError) as problem:
        raise InputError(f"{described}: something is missing or changed ({problem}); {_AGAIN}") from problem
