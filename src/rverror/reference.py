"""Reference cases for other tools, and how far another tool is off, by order."""

from __future__ import annotations

import hashlib
import io
import json
import math
import os
import tempfile
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal, NoReturn

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

import rverror
from rverror import units
from rverror.action_line import CONTACT_AXES, Array
from rverror.catalogue import source
from rverror.compose import closed_form_forces, effect_matrix, pose, transmission_error
from rverror.equilibrium import equilibrium, linearise
from rverror.errors import InputError
from rverror.kinematics import frame_orders
from rverror.measurement import Run
from rverror.model import Effect, Model, effect
from rverror.model_file import save_model
from rverror.reducer import Reducer, reducer
from rverror.textfile import PathLike, did_you_mean, read_text, shown
from rverror.units import ARCSEC

Method = Literal["equilibrium", "closed"]

METHODS: tuple[Method, ...] = ("equilibrium", "closed")
#: Of case.json and case.npz; grows when a reader of the old form would misread the new one.
FORMAT = 1
#: Angles of a turn: what the orders of the gear and cycloid mesh need.
POINTS = 4096
_FORCE_ANGLES = 64
_LEADING = 12  # orders told in case.json
_SHARE = 0.01  # of the largest order, below which none is told
_LEAST = 1e-3 * ARCSEC
_NO_MATTER = 0.1 * ARCSEC  # waves that a coarse run may miss
_PER_WAVE = 8  # angles a wave of the largest order; a cubic spline then keeps a thousandth of it
_SAME_ANGLE = 1e-6  # of a step
_TURN = 2 * math.pi
_FAR_BETTER = 1 / 3
_AS_GOOD = 1.5
_FITS = 0.01  # rms of a difference, as a share of the case's, that asks for no hint
_PEAKS = 40
_WORDS = {"equilibrium": "equilibrium", "closed": "closed form"}


@dataclass(frozen=True)
class Known:
    """A number found otherwise, to hold a case against.

    Attributes
    ----------
    method : {"closed", "equilibrium"}
    order : int
        Per output turn; 0 is the offset.
    size : float
        Amplitude, or the offset with its sign, rad.
    tolerance : float
        Share of it.
    where : str
        File of the repository that derives or checks it.
    """

    method: Method
    order: int
    size: float
    tolerance: float
    where: str


@dataclass(frozen=True)
class Definition:
    """What a reference case is, before it is solved.

    Attributes
    ----------
    name : str
        Of its folder.
    shows : str
        The one thing that it isolates.
    model : Model
    torque : float
        Size of the output torque, N*mm.
    direction : float
        +1 forward, -1 reverse.
    closed_form : str
        What holds of the closed form; empty where it does not and is left out.
    known : tuple of Known
    """

    name: str
    shows: str
    model: Model
    torque: float = 412e3
    direction: float = 1.0
    closed_form: str = ""
    known: tuple[Known, ...] = ()


@dataclass(frozen=True, eq=False)
class SolvedCase:
    """A reference case with its numbers.

    Attributes
    ----------
    definition : Definition
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
    ratio : float
    direction : float
    turns : mapping of str to float
        Turns of each part per output turn.
    arrays : mapping of str to ndarray
    """

    name: str
    version: str
    ratio: float
    direction: float
    turns: Mapping[str, float]
    arrays: Mapping[str, npt.NDArray[Any]]

    def waveform(self, method: Method, *, opposite: bool = False) -> Array | None:
        """Transmission error of the case, rad; None where it holds none by this method."""
        found = self.arrays.get(f"{'opposite' if opposite else 'transmission_error'}_{method}")
        return None if found is None else np.asarray(found, dtype=np.float64)


@dataclass(frozen=True)
class OrderDifference:
    """One order of a comparison, rad; a wave is amplitude * cos(order * theta - phase).

    Attributes
    ----------
    order : int
    case, theirs, difference : complex
        amplitude * exp(i phase); the difference is theirs less the case's.
    """

    order: int
    case: complex
    theirs: complex
    difference: complex


@dataclass(frozen=True)
class Comparison:
    """How far a run is off a reference case; the offsets are compared on their own.

    Attributes
    ----------
    run, case, version : str
        Names, and the version of rverror that wrote the case.
    method : {"equilibrium", "closed"}
        Of the case's waveform.
    offset, rms, largest : float
        Mean difference; root mean square and largest size of the difference without it, rad.
    largest_at : float
        Angle of the largest difference, rad.
    peak_to_peak, case_rms, case_peak_to_peak : float
        Of the run, and of the case, rad.
    other_rms : float, optional
        rms of the difference against the other method; None where the case holds none.
    orders : tuple of OrderDifference
        All below half the number of angles, worst first.
    hints : tuple of str
        Mix-ups of convention that would explain far the most of the difference.
    notes : tuple of str
        What was interpolated, averaged or left out.
    """

    run: str
    case: str
    version: str
    method: Method
    offset: float
    rms: float
    largest: float
    largest_at: float
    peak_to_peak: float
    case_rms: float
    case_peak_to_peak: float
    other_rms: float | None
    orders: tuple[OrderDifference, ...]
    hints: tuple[str, ...]
    notes: tuple[str, ...]


def _force_array(key: str) -> tuple[str, str, str]:
    parts, _, axes = CONTACT_AXES[key].rpartition(": ")
    return f"{axes.strip('()')}, m", "N*mm" if key == "spline" else "N", f"equilibrium, force of {parts}"


#: Arrays of case.npz: axes, unit, and what they hold.
ARRAYS: Mapping[str, tuple[str, str, str]] = {
    "theta": ("n", "rad", "nominal output angle, input angle / R"),
    "transmission_error_closed": ("n", "rad", "closed form"),
    "transmission_error_equilibrium": ("n", "rad", "equilibrium, elastic windup included"),
    "opposite_closed": ("n", "rad", "the same angles, motion and load the other way; closed form"),
    "opposite_equilibrium": ("n", "rad", "the same angles, motion and load the other way; equilibrium"),
    "influence_labels": ("parameters", "-", "source, indices and name of each parameter"),
    "influence_closed": ("parameters, n", "rad per mm or rad", "closed form"),
    "influence_equilibrium": ("parameters, n", "rad per mm or rad", "equilibrium, closed contacts held closed"),
    "force_theta": ("m", "rad", "angles of the contact forces, some of theta"),
    **{f"force_{key}": _force_array(key) for key in CONTACT_AXES if key != "output"},
}


# --- the cases --------------------------------------------------------------------------------------------------------


def _case(name: str, shows: str, unit: Reducer, *effects: Effect, **rest: Any) -> Definition:
    return Definition(name, shows, Model(unit, effects, name.replace("-", " ")), **rest)


def definitions() -> tuple[Definition, ...]:
    """The reference cases; errors are 5 um, the load is 412 N*m, forward, unless a case says otherwise.

    Returns
    -------
    tuple of Definition
    """
    unit = reducer("RV-40E")
    several = (
        effect("crank.eccentricity", crank=0, disc=0, radial="4 um", tangential="-2 um"),
        effect("cycloid.disc_pitch", disc=1, harmonic=1, cos="3 um", sin="2 um"),
        effect("cycloid.pin_position", pin=7, radial="-4 um", tangential="6 um"),
        effect("cycloid.pin_circle", harmonic=2, radial_cos="2 um", tangential_sin="3 um"),
        effect("cycloid.disc_bore_position", disc=0, crank=1, radial="2 um", tangential="3 um"),
        effect("coupling.carrier_bore_position", crank=0, tangential="4 um"),
        effect("involute.planet_eccentricity", crank=1, x="5 um", y="-3 um"),
    )
    pins = "with rigid bearings and equal contacts; rms_from_equilibrium_arcsec is what that leaves out"
    return (
        _case(
            "perfect-unit",
            "no error: elastic windup alone, and what the change of loaded pins leaves",
            unit,
            closed_form="exact: zero",
            known=(Known("closed", 0, 0.0, 0.0, "docs/theory/principle.md"),),
        ),
        _case(
            "one-cam",
            "one cam of one crank too eccentric: order 40",
            unit,
            effect("crank.eccentricity", crank=0, disc=0, radial="5 um"),
            closed_form="within 0.1 arcsec at rated load",
            known=tuple(Known(m, 40, 18.467 / 2 * ARCSEC, 1e-3, "docs/theory/crank.md") for m in METHODS),
        ),
        _case(
            "disc-pitch",
            "first harmonic of one disc's pitch error: order 40 through the loaded pins",
            unit,
            effect("cycloid.disc_pitch", disc=0, harmonic=1, cos="5 um"),
            closed_form=pins,
            known=(Known("closed", 40, 6.725 * ARCSEC, 1e-3, "docs/theory/cycloid.md"),),
        ),
        _case(
            "one-pin",
            "one pin displaced along the pin circle: orders 78 h, the odd multiples of 39 cancel",
            unit,
            effect("cycloid.pin_position", pin=7, tangential="5 um"),
            closed_form=pins,
        ),
        _case(
            "carrier-bore",
            "one crank bore of the carrier displaced tangentially: a constant, no wave of order 1",
            unit,
            effect("coupling.carrier_bore_position", crank=0, tangential="5 um"),
            closed_form="exact",
            known=(Known("closed", 0, -38.197 / 2 * ARCSEC, 1e-4, "docs/theory/coupling.md"),),
        ),
        _case(
            "planet-eccentricity",
            "one planet eccentric: order 40 through the gear mesh and the cranks",
            unit,
            effect("involute.planet_eccentricity", crank=0, x="5 um"),
            closed_form="exact",
            known=tuple(Known(m, 40, 0.672 * ARCSEC, 1e-3, "docs/theory/involute.md") for m in METHODS),
        ),
        _case(
            "bearing-clearance",
            "radial clearance of all cam bearings at 20 N*m: order 80, and a lag",
            unit,
            effect("crank.bearing_clearance", clearance="5 um"),
            torque=20e3,
            known=(Known("equilibrium", 80, 2.7 * ARCSEC, 0.02, "tests/test_clearance.py"),),
        ),
        _case("several-errors", "errors of cams, discs, pins, bores and a planet together", unit, *several,
              closed_form=pins),
        _case("several-errors-reverse", "the same in reverse: the other side's pins and flanks carry", unit, *several,
              direction=-1.0, closed_form=pins),
        _case(
            "unit-003",
            "another geometry, source 003's unit with three cranks: one cam, and one disc's pitch",
            reducer("RV-003"),
            effect("crank.eccentricity", crank=0, disc=0, radial="5 um"),
            effect("cycloid.disc_pitch", disc=1, harmonic=1, sin="5 um"),
            closed_form=pins,
        ),
    )  # fmt: skip


def pick(names: Sequence[str]) -> tuple[Definition, ...]:
    """Reference cases by name, all where no name is given.

    Parameters
    ----------
    names : sequence of str

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
    definition : Definition
    points : int
        Angles of the turn.

    Returns
    -------
    SolvedCase
    """
    model, direction, torque = definition.model, definition.direction, definition.torque
    turn = _TURN * np.arange(points) / points
    theta = turn if direction > 0 else _TURN - turn
    loaded = linearise(model, theta, torque=torque, direction=direction)
    some = np.arange(0, points, max(1, points // _FORCE_ANGLES))
    arrays: dict[str, npt.NDArray[Any]] = {"theta": theta}
    if definition.closed_form:
        arrays["transmission_error_closed"] = transmission_error(model, theta, direction=direction, torque=torque)
        arrays["opposite_closed"] = transmission_error(model, theta, direction=-direction, torque=torque)
    back = equilibrium(model, theta, torque=torque, direction=-direction)
    arrays["transmission_error_equilibrium"] = loaded.state.transmission_error
    arrays["opposite_equilibrium"] = back.transmission_error
    arrays["influence_labels"] = np.array(_labels(model.effects), dtype=np.str_)
    if definition.closed_form:
        motion = pose(model.mechanism, theta, direction=direction, torque=torque)
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


def arrays_hash(arrays: Mapping[str, npt.NDArray[Any]]) -> str:
    """SHA-256 over names, types, shapes and contents of arrays, by name; whatever container they lie in.

    Parameters
    ----------
    arrays : mapping of str to ndarray

    Returns
    -------
    str
        Hexadecimal.
    """
    total = hashlib.sha256()
    for name in sorted(arrays):
        array = _portable(arrays[name])
        total.update(f"{name} {array.dtype.str} {array.shape}\n".encode())
        total.update(array.tobytes())
    return total.hexdigest()


def _portable(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Little-endian, C order."""
    return np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("<"))


def case_npz(case: SolvedCase) -> bytes:
    """Bytes of ``case.npz``, the same for the same arrays: no dates, no compression.

    Parameters
    ----------
    case : SolvedCase

    Returns
    -------
    bytes
    """
    whole = io.BytesIO()
    with zipfile.ZipFile(whole, "w") as archive:
        for name, array in case.arrays.items():
            part = io.BytesIO()
            np.lib.format.write_array(part, _portable(array), allow_pickle=False)
            archive.writestr(zipfile.ZipInfo(f"{name}.npy", (1980, 1, 1, 0, 0, 0)), part.getvalue())
    return whole.getvalue()


def case_json(case: SolvedCase) -> dict[str, Any]:
    """Content of ``case.json``; keys are only ever added within one format.

    Parameters
    ----------
    case : SolvedCase

    Returns
    -------
    dict
    """
    what = case.definition
    unit = what.model.mechanism
    assert isinstance(unit, Reducer)
    arrays = case.arrays
    closed = _given(arrays, "closed")
    gap = None if closed is None else _rms(_about_mean(arrays["transmission_error_equilibrium"] - closed))
    return {
        "format": FORMAT,
        "name": what.name,
        "shows": what.shows,
        "version": rverror.__version__,
        "conventions": "docs/conventions.md",
        "model_toml": _toml(what.model),
        "model": {
            "units": {name: units.CORE_UNITS[name] for name in ("length", "angle", "torque", "stiffness")},
            "reducer": asdict(unit),
            "ratio": unit.ratio,
            "turns_per_output_turn": frame_orders(unit),
            "effects": [_effect_json(item) for item in what.model.effects],
        },
        "direction": "forward" if what.direction > 0 else "reverse",
        "torque": {"value": what.torque, "unit": units.CORE_UNITS["torque"]},
        "angles": {"count": arrays["theta"].size, "first": arrays["theta"][0], "last": arrays["theta"][-1]},
        "phase": "a wave is amplitude * cos(order * theta - phase)",
        "closed_form": _waveform_json(closed)
        | {"holds": what.closed_form or "it does not hold here", "rms_from_equilibrium_arcsec": _arcsec(gap)},
        "equilibrium": _waveform_json(_given(arrays, "equilibrium")) | {"largest_residual": _rounded(case.imbalance)},
        "known": [_known_json(item) for item in what.known],
        "arrays": {name: dict(zip(("axes", "unit", "what"), ARRAYS[name], strict=True)) for name in arrays},
        "arrays_sha256": arrays_hash(arrays),
    }


def case_files(case: SolvedCase) -> Mapping[str, bytes]:
    """Files of a reference case by name, the one that names the other's hash last.

    Parameters
    ----------
    case : SolvedCase

    Returns
    -------
    mapping of str to bytes
    """
    return {
        "case.npz": case_npz(case),
        "case.json": (json.dumps(case_json(case), indent=1) + "\n").encode(),
    }


def _toml(model: Model) -> str:
    """Text of the model file, read back and found equal."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.toml"
        save_model(path, model)
        return read_text(path)


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
    waves = _waves(error)
    told = np.argsort(-np.abs(waves), kind="stable")[:_LEADING]
    least = max(_LEAST, _SHARE * float(np.abs(waves).max()))
    return {
        "offset_arcsec": _arcsec(float(error.mean())),
        "rms_arcsec": _arcsec(_rms(_about_mean(error))),
        "peak_to_peak_arcsec": _arcsec(float(np.ptp(error))),
        "orders": [{"order": int(i) + 1, **_wave_json(waves[i])} for i in told if abs(waves[i]) >= least],
    }


def _wave_json(wave: complex) -> dict[str, Any]:
    """Amplitude and phase; a wave of next to nothing has no phase."""
    phase = math.degrees(math.atan2(wave.imag, wave.real)) if _has_phase(wave) else None
    return {"amplitude_arcsec": _arcsec(abs(wave)), "phase_deg": None if phase is None else _rounded(phase)}


def _has_phase(wave: complex) -> bool:
    return abs(wave) >= 1e-4 * ARCSEC


def _known_json(item: Known) -> dict[str, Any]:
    return {
        "method": _WORDS[item.method],
        "order": item.order,
        "arcsec": _arcsec(item.size),
        "tolerance": item.tolerance,
        "where": item.where,
    }


def _rounded(value: float) -> float:
    """Ten digits: what is told; the arrays hold all."""
    return float(f"{value:.10g}")


def _arcsec(value: float | None) -> float | None:
    return None if value is None else _rounded(value / ARCSEC)


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
    described = Path(path)
    try:
        if described.is_dir():
            described = described / "case.json"
    except (OSError, ValueError) as problem:  # ValueError: a null byte in the name
        raise InputError(f"{path!r}: no such case; check the path") from problem
    text = read_text(described)
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as problem:
        raise InputError(f"{described}: this is no JSON; give the folder of a case or its case.json") from problem
    if not isinstance(content, dict) or "format" not in content or "arrays_sha256" not in content:
        raise InputError(f"{described}: this is no reference case; write one with `rverror reference-cases`")
    if content["format"] != FORMAT:
        raise InputError(
            f"{described}: format {shown(content['format'])}, this rverror reads {FORMAT}; "
            "write the case again with `rverror reference-cases`"
        )
    arrays = _read_arrays(described.with_name("case.npz"))
    if arrays_hash(arrays) != content["arrays_sha256"]:
        raise InputError(
            f"{described.with_name('case.npz')}: the arrays are not those of case.json, their hash differs; "
            "write the case again with `rverror reference-cases`"
        )
    try:
        model = content["model"]
        turns = {str(name): float(value) for name, value in model["turns_per_output_turn"].items()}
        case = StoredCase(
            name=str(content["name"]),
            version=str(content["version"]),
            ratio=float(model["ratio"]),
            direction={"forward": 1.0, "reverse": -1.0}[content["direction"]],
            turns=turns,
            arrays=arrays,
        )
        shapes = {arrays[name].shape for name in ("theta", "transmission_error_equilibrium", "opposite_equilibrium")}
        if len(shapes) != 1:
            raise ValueError(f"arrays of different shapes, {shapes}")
    except (KeyError, TypeError, ValueError, AttributeError) as problem:
        raise InputError(
            f"{described}: something is missing or changed ({problem}); write the case again with "
            "`rverror reference-cases`"
        ) from problem
    return case


def _read_arrays(path: Path) -> dict[str, npt.NDArray[Any]]:
    try:
        with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}
    except FileNotFoundError as problem:
        raise InputError(f"{path}: there is no such file; keep case.json and case.npz together") from problem
    except (OSError, ValueError, TypeError, EOFError, NotImplementedError, zipfile.BadZipFile) as problem:
        raise InputError(
            f"{path}: cannot read its arrays; write the case again with `rverror reference-cases`"
        ) from problem


# --- comparing --------------------------------------------------------------------------------------------------------


def compare(run: Run, case: StoredCase, *, method: Method = "equilibrium") -> Comparison:
    """Compare the transmission error of a run with that of a reference case.

    Parameters
    ----------
    run : Run
        One or more whole turns in one direction.
    case : StoredCase
    method : {"equilibrium", "closed"}
        With which of the case's waveforms.

    Returns
    -------
    Comparison

    Raises
    ------
    InputError
        If the run does not cover a turn, is too coarse for the case's largest order or turns back, or the case holds
        no waveform by this method.
    """
    name = run.path or "run"
    wanted = case.waveform(method)
    if wanted is None:
        _refuse(
            name, f"the case {case.name} has no closed form, since it does not hold there; leave out --method closed"
        )
    found, notes = _on_case_angles(name, run, case, wanted)
    order = np.argsort(case.arrays["theta"] % _TURN, kind="stable")  # from 0 on, whatever the direction
    angle, case_wave, their_wave = case.arrays["theta"][order] % _TURN, wanted[order], found[order]
    difference = their_wave - case_wave
    about = _about_mean(difference)
    other: Method = "closed" if method == "equilibrium" else "equilibrium"
    other_wave, opposite = case.waveform(other), case.waveform(method, opposite=True)
    fits = [
        (f"{what} fits", _rms(_about_mean(their_wave - wave[order])), remedy)
        for what, wave, remedy in (
            (f"the case's {_WORDS[other]}", other_wave, f"your tool shares its assumptions; see --method {other}"),
            ("the case in the other direction", opposite, _DIRECTION),
        )
        if wave is not None
    ]
    waves = [_waves(values) for values in (case_wave, their_wave, difference)]
    worst = np.argsort(-np.abs(waves[2]), kind="stable")
    return Comparison(
        run=name,
        case=case.name,
        version=case.version,
        method=method,
        offset=float(difference.mean()),
        rms=_rms(about),
        largest=float(np.abs(about).max()),
        largest_at=float(angle[np.abs(about).argmax()]),
        peak_to_peak=float(np.ptp(their_wave)),
        case_rms=_rms(_about_mean(case_wave)),
        case_peak_to_peak=float(np.ptp(case_wave)),
        other_rms=None if other_wave is None else _rms(_about_mean(their_wave - other_wave[order])),
        orders=tuple(OrderDifference(int(i) + 1, *(complex(wave[i]) for wave in waves)) for i in worst),
        hints=_hints(_about_mean(their_wave), _about_mean(case_wave), fits, case.turns),
        notes=(*run.notes, *notes),
    )


def _refuse(name: str, message: str) -> NoReturn:
    raise InputError(f"{name}: {message}")


def _about_mean(values: Array) -> Array:
    return np.asarray(values - values.mean(), dtype=np.float64)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _given(arrays: Mapping[str, npt.NDArray[Any]], method: str) -> Array | None:
    """Waveform over growing angles from 0, as orders need it."""
    values = arrays.get(f"transmission_error_{method}")
    return None if values is None else np.asarray(values[np.argsort(arrays["theta"] % _TURN, kind="stable")])


def _waves(values: Array) -> npt.NDArray[np.complex128]:
    """Amplitude * exp(i phase) of orders 1 to below half the angles, of a turn that starts at 0."""
    n = values.size
    return np.asarray(np.conj(np.fft.rfft(values))[1 : (n + 1) // 2] * 2 / n, dtype=np.complex128)


def _on_case_angles(name: str, run: Run, case: StoredCase, wanted: Array) -> tuple[Array, list[str]]:
    """Error of a run at the angles of a case, mean of its whole turns, and what was done for it."""
    ways = set(run.direction.tolist())
    if len(ways) > 1:
        _refuse(name, "the run turns back and forth; split it and give the part in one direction")
    notes = []
    if ways != {case.direction}:
        way, cases = ("forward", "reverse") if case.direction < 0 else ("reverse", "forward")
        notes.append(f"the run goes {way}, the case {cases}; compared at the same angles")
    theta, error = run.nominal_angle(case.ratio), run.error(case.ratio)
    angle, first = np.unique(theta, return_index=True)
    values = error[first]
    if angle.size < 2:
        _refuse(name, "the nominal angle does not move; check the columns")
    step = np.diff(angle)
    turns = int((angle[-1] - angle[0] + 1.5 * float(np.median(step))) / _TURN)
    if turns < 1:
        _refuse(
            name,
            f"the run covers {math.degrees(angle[-1] - angle[0]):.6g} deg of the output, a case is a whole turn of "
            "360 deg; give one or more whole turns",
        )
    targets = _targets(case, angle[0], turns)
    taken = _taken(angle, targets)
    if taken is None:
        resolved = _check_step(name, step, wanted)
        values = _interpolated(angle, values, targets, turns)
        notes.append(
            f"{angle.size} angles differ from the case's; interpolated by a cubic spline onto its {wanted.size} a "
            f"turn, good for orders below {resolved:.0f}"
        )
    else:
        values = values[taken]
        if left := angle.size - taken.size:
            notes.append(f"{left} of {angle.size} angles are none of the case's, and were left out")
    if turns > 1:
        notes.append(f"{turns} whole turns: their mean is compared")
    mean = np.empty(wanted.size)
    mean[_places(case, targets[: wanted.size])] = values.reshape(turns, wanted.size).mean(axis=0)
    return mean, notes


def _targets(case: StoredCase, start: float, turns: int) -> Array:
    """Angles of the case in the turns from a start on, growing."""
    theta = case.arrays["theta"]
    slack = _SAME_ANGLE * _TURN / theta.size
    one = np.sort((theta - start + slack) % _TURN) - slack + start
    return np.asarray((one + _TURN * np.arange(turns)[:, None]).ravel(), dtype=np.float64)


def _places(case: StoredCase, targets: Array) -> npt.NDArray[np.intp]:
    """Index in the case of each angle of one turn."""
    theta = case.arrays["theta"]
    number = np.rint(case.direction * (targets - theta[0]) / _TURN * theta.size).astype(np.intp)
    return np.asarray(number % theta.size, dtype=np.intp)


def _taken(angle: Array, targets: Array) -> npt.NDArray[np.intp] | None:
    """Samples that lie at the targets; None where one of them has none."""
    right = np.clip(np.searchsorted(angle, targets), 1, angle.size - 1)
    nearest = np.where(targets - angle[right - 1] < angle[right] - targets, right - 1, right)
    step = float(targets[1] - targets[0])
    return nearest if (np.abs(angle[nearest] - targets) <= _SAME_ANGLE * step).all() else None


def _check_step(name: str, step: Array, wanted: Array) -> float:
    """Order up to which a spline through these steps is good; refused where the case's largest is above it."""
    waves = np.abs(_waves(wanted))
    longest = float(step.max())
    resolved = _TURN / longest / _PER_WAVE
    largest = int(waves.argmax()) + 1
    if waves.max() >= _NO_MATTER and largest > resolved:
        _refuse(
            name,
            f"the angles lie up to {math.degrees(longest):.4g} deg apart, the case's largest order {largest} needs "
            f"{math.degrees(_TURN / largest / _PER_WAVE):.3g} deg or less ({_PER_WAVE} a wave); give more angles, best "
            f"the case's own {wanted.size}",
        )
    return resolved


def _interpolated(angle: Array, values: Array, targets: Array, turns: int) -> Array:
    """Cubic spline through the samples of the whole turns, carried on around their ends."""
    period = turns * _TURN
    inside = angle < angle[0] + period - 0.5 * float(np.median(np.diff(angle)))
    x, y = angle[inside], values[inside]
    x = np.concatenate([x[-_PER_WAVE:] - period, x, x[:_PER_WAVE] + period])
    y = np.concatenate([y[-_PER_WAVE:], y, y[:_PER_WAVE]])
    return np.asarray(CubicSpline(x, y)(targets), dtype=np.float64)


# --- hints ------------------------------------------------------------------------------------------------------------


def _hints(
    theirs: Array, case: Array, others: Sequence[tuple[str, float, str]], turns: Mapping[str, float]
) -> tuple[str, ...]:
    """Mix-ups that bring the run far nearer to the case; those that do so equally well, simple ones first."""
    plain, scale = _rms(theirs - case), _rms(case)
    if scale < _LEAST or plain <= _FITS * scale:
        return ()
    mirrored = np.roll(theirs[::-1], 1)  # angles from 0 on: theta -> -theta keeps the first in place
    tried = [
        *others,
        ("the run with its sign turned fits", _rms(-theirs - case), _SIGN),
        ("the run with its angles mirrored, theta for -theta, fits", _rms(mirrored - case), _MIRROR),
        ("the run with sign and angles turned fits", _rms(-mirrored - case), _BOTH),
    ]
    best = min(rms for _, rms, _ in tried)
    lead, shifted = _shift(theirs, case)
    if shifted <= _FAR_BETTER * min(plain, best):
        place = f"{math.degrees(lead):.4g} deg of the output{_in_turns(lead, turns)}"
        best = shifted
        tried = [(f"the run fits where its angles are taken to lead the case's by {place}", shifted, _ZERO)]
    if best > _FAR_BETTER * plain:
        return ()
    return tuple(
        f"{what} (rms {rms / ARCSEC:.3g} arcsec instead of {plain / ARCSEC:.3g}): {remedy}"
        for what, rms, remedy in tried
        if rms <= max(_AS_GOOD * best, _FITS * scale)
    )


_DIRECTION = "check the direction of motion and of the load, and which flanks and pins carry"
_SIGN = "the error is the output angle less input angle / R, positive where the output leads"
_MIRROR = "theta grows counter-clockwise, in forward motion; check the sense of rotation of your angles"
_ZERO = "check where theta = 0 lies"
_BOTH = "angles and error count counter-clockwise; your tool may look from the other side or count clockwise"


def _shift(theirs: Array, case: Array) -> tuple[float, float]:
    """Smallest lead of the run's angles at which it fits best, rad, and the rms left."""
    n = theirs.size
    lines, order = np.fft.rfft(theirs), np.arange(n // 2 + 1)
    fit = np.fft.irfft(lines * np.conj(np.fft.rfft(case)), n)  # of theirs, so many angles on
    peaks = np.flatnonzero((fit >= np.roll(fit, 1)) & (fit >= np.roll(fit, -1)))
    found = []
    for peak in peaks[np.argsort(-fit[peaks], kind="stable")][:_PEAKS]:
        lead = float((_TURN * peak / n + math.pi) % _TURN - math.pi)
        for _ in range(4):
            moved = lines * np.exp(1j * order * lead)
            slope, rest = np.fft.irfft(1j * order * moved, n), np.fft.irfft(moved, n) - case
            power = float(slope @ slope)
            lead -= float(slope @ rest) / power if power > 0 else 0.0
        found.append((lead, _rms(np.fft.irfft(lines * np.exp(1j * order * lead), n) - case)))
    least = min((rms for _, rms in found), default=math.inf)
    near = [item for item in found if item[1] <= max(1.05 * least, 1e-3 * _rms(case))]
    return min(near, key=lambda item: abs(item[0]), default=(0.0, math.inf))


def _in_turns(lead: float, turns: Mapping[str, float]) -> str:
    """Lead in turns of crank and sun where it is a whole number of them."""
    carrier = turns.get("carrier", 1.0)
    rates = {
        f"{part} turns {where}": turns[part] - base
        for where, base in (("against the carrier", carrier), ("in the housing", 0.0))
        for part in ("crank", "sun")
        if part in turns
    }
    counts = {what: abs(lead / _TURN * rate) for what, rate in rates.items()}
    whole = [f"{round(count)} {what}" for what, count in counts.items() if round(count) and _near_whole(count)]
    return f", {' or '.join(whole)}" if whole else ""


def _near_whole(count: float) -> bool:
    return abs(count - round(count)) < 5e-3


# --- telling ----------------------------------------------------------------------------------------------------------


def comparison_text(found: Comparison, *, most: int = 12) -> str:
    """Comparison as text.

    Parameters
    ----------
    found : Comparison
    most : int
        Orders told.

    Returns
    -------
    str
        Angles in arcsec.
    """
    lines = [
        f"{found.run} against the case {found.case}, {_WORDS[found.method]} (rverror {found.version}); arcsec",
        *(f"note: {note}" for note in found.notes),
        "",
        f"{'peak-to-peak':28s} theirs {_cell(found.peak_to_peak)}   case {_cell(found.case_peak_to_peak)}",
        f"{'offset, theirs less case':28s} {_cell(found.offset)}",
        f"{'rms of the difference':28s} {_cell(found.rms)}   without the offset; the case's own rms "
        f"{_cell(found.case_rms)}",
        f"{'largest difference':28s} {_cell(found.largest)}   at {math.degrees(found.largest_at):.4g} deg",
    ]
    if found.other_rms is not None:
        word = _WORDS["closed" if found.method == "equilibrium" else "equilibrium"]
        lines.append(f"{f'rms against the {word}':28s} {_cell(found.other_rms)}")
    told = [line for line in found.orders[:most] if abs(line.difference) >= 1e-6 * ARCSEC]
    if told:
        lines += [
            "",
            "By order, worst first; a wave is amplitude * cos(order * theta - phase)",
            "order" + "".join(f" {name:>11s} {'phase':>8s}" for name in ("theirs", "case", "difference")),
            *(
                f"{line.order:5d} {_polar(line.theirs)} {_polar(line.case)} {_polar(line.difference)}".rstrip()
                for line in told
            ),
        ]
    else:
        lines += ["", "No order differs by 1e-6 arcsec or more"]
    lines += [f"{'' if i else chr(10)}hint: {hint}" for i, hint in enumerate(found.hints)]
    return "\n".join(lines) + "\n"


def _cell(value: float) -> str:
    return f"{value / ARCSEC:.4g}"


def _polar(wave: complex) -> str:
    phase = f"{math.degrees(math.atan2(wave.imag, wave.real)):8.2f}" if _has_phase(wave) else f"{'-':>8s}"
    return f"{abs(wave) / ARCSEC:11.4g} {phase}"


def comparison_json(found: Comparison, *, most: int = 100) -> dict[str, Any]:
    """Comparison as plain data for `json.dump`; keys are only ever added.

    Parameters
    ----------
    found : Comparison
    most : int
        Orders told.

    Returns
    -------
    dict
        Angles in arcsec, phases in deg.
    """
    return {
        "run": os.fspath(found.run),
        "case": found.case,
        "case_version": found.version,
        "method": _WORDS[found.method],
        "peak_to_peak_arcsec": _arcsec(found.peak_to_peak),
        "case_peak_to_peak_arcsec": _arcsec(found.case_peak_to_peak),
        "case_rms_arcsec": _arcsec(found.case_rms),
        "offset_difference_arcsec": _arcsec(found.offset),
        "rms_difference_arcsec": _arcsec(found.rms),
        "largest_difference_arcsec": _arcsec(found.largest),
        "largest_difference_at_deg": _rounded(math.degrees(found.largest_at)),
        "rms_against_other_method_arcsec": _arcsec(found.other_rms),
        "orders": [
            {
                "order": line.order,
                **{name: _wave_json(getattr(line, name)) for name in ("theirs", "case", "difference")},
            }
            for line in found.orders[:most]
        ],
        "hints": list(found.hints),
        "notes": list(found.notes),
        "version": rverror.__version__,
    }
