"""Runs: measured or simulated angles, made of a file or in memory, checked alike.

A run file is comma-separated text: ``# key: value`` lines, one line of column names with the unit in brackets, rows of
numbers.  A bench's own files are read by a mapping.  Whatever is wrong is refused in one line, or, where a part is
usable, left out and counted in `notes`.
"""

from __future__ import annotations

import io
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from numbers import Real
from typing import Any

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.errors import InputError, check_kind
from rverror.base.text import PathLike, check_path, shown, split_lines, write_file
from rverror.base.viewed import Viewed
from rverror.geartrain.kinematics import OperatingConditions
from rverror.geartrain.mechanism import Drive, Reducer
from rverror.geartrain.torque_over_turn import TorqueWaves, fitted_torque
from rverror.model.catalogue import source
from rverror.model.effects import Model
from rverror.runs.bench.file import read_bench_file
from rverror.runs.bench.mapping import BenchMapping, given_mapping
from rverror.runs.checks import checked, fitted_slope
from rverror.runs.integration import INTEGRATED, without_line
from rverror.runs.order_file import is_order_file, load_orders, refuse_order_file
from rverror.runs.order_table import OrderTable
from rverror.runs.reading import (
    DIMENSIONS,
    HEADER_KEYS,
    HEADER_LINE,
    STATED,
    OfFile,
    Reading,
    check_lengths,
    header_lines,
    refuse,
    row_of,
    stated_value,
)

_BLOCKS = 16  # of a torque column, over which noise is averaged
#: Range of their means over the torque up to which it is constant: a brake holds its torque no better.
_STEADY = 0.02
_BY_NOISE = 6.0  # standard deviations of a mean: of sixteen the range is 3.5, and hardly ever so many


@dataclass(frozen=True, kw_only=True, eq=False)
class Run(OfFile, Viewed):
    """Angles of one pass over the test bench.

    Attributes
    ----------
    path : str
        File, as given; empty where the run was made in memory.
    input_angle, output_angle : ndarray, shape (n,), optional
        Angles as read, unwrapped, rad.
    te_column : ndarray, shape (n,), optional
        Transmission error as read, rad.
    direction : ndarray, shape (n,)
        +1 where the nominal output angle grows, -1 where it falls.
    time : ndarray, shape (n,), optional
        s.
    torque : float, optional
        Size of the output torque, N*mm; None where it changes over the turn.
    load_column : ndarray, shape (n,), optional
        Output torque as read where it changes over the turn, N*mm: positive where it resists forward motion.
    torque_record : ndarray, shape (n,), optional
        Torque that a record of one angle holds in place of an error, N*mm.
    temperature : float, optional
        K.
    index : str
        Label of the zero: empty (aligned, with an offset of its own), ``"unknown"``, or a label shared with other runs.
    metadata : mapping of str to str
        Every header key, as written.
    notes : tuple of str
        What was left out, changed or noticed, counted.

    Notes
    -----
    Transmission error and nominal angle need the ratio, which a run file does not hold: see `nominal_angle` and
    `error`.  Both take a `Reducer`, `Drive`, `Model` or number.
    """

    path: str = ""
    input_angle: Array | None = None
    output_angle: Array | None = None
    te_column: Array | None = None
    direction: Array
    time: Array | None = None
    torque: float | None = None
    load_column: Array | None = None
    torque_record: Array | None = None
    temperature: float | None = None
    index: str = ""
    metadata: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @property
    def size(self) -> int:
        """Number of samples."""
        return int(self.direction.size)

    def nominal_angle(self, ratio: Reducer | Drive | Model | float) -> Array:
        """Nominal output angle theta, input angle / ratio; output less error where there is no input angle.

        Parameters
        ----------
        ratio : Reducer, Drive, Model or float
            Input turns per output turn; `error` and `conditions` take it too.

        Returns
        -------
        ndarray, shape (n,)
            rad.

        Raises
        ------
        InputError
            If the ratio contradicts the run.
        """
        value = ratio_of(ratio)
        if self.input_angle is None:
            assert self.output_angle is not None  # checked when the run was made
            return self.output_angle if self.te_column is None else self.output_angle - self.te_column
        self._check_ratio(self.input_angle, value)
        return self.input_angle / value

    def conditions(self, ratio: Reducer | Drive | Model | float) -> OperatingConditions:
        """Where and how it was measured, as predictions take it; without a torque where it has none, or one of 0.

        A torque that changes over the turn is that of `torque_waves`.
        """
        theta, waves = self.nominal_angle(ratio), self.torque_waves(ratio)
        return OperatingConditions(
            theta,
            self.direction,
            self.torque or None,
            self.time,
            temperature=self.temperature,
            load=None if waves is None else waves(theta),
        )

    def torque_waves(self, ratio: Reducer | Drive | Model | float) -> TorqueWaves | None:
        """Output torque over the nominal angle without the noise of its column; None where it does not change.

        Raises
        ------
        InputError
            As `nominal_angle`, and if the torque is no function of the angle.
        """
        if self.load_column is None:
            return None
        theta = self.nominal_angle(ratio)
        try:
            return fitted_torque(theta, self.load_column)
        except ValueError as problem:
            self.refuse(str(problem))

    def check_effects(self, model: Model, name: str) -> None:
        """Check that the run tells what the effects of a model need.

        Parameters
        ----------
        model : Model
        name : str
            Of the run, for the message.

        Raises
        ------
        InputError
            Naming the effect, what it needs and the remedy.
        """
        known = self.conditions(model)
        words = {"time": ("a time[s] column", "file"), "torque": ("the output_torque", "file")}
        for item in model.effects:
            missing = source(item.key).lacks(model.mechanism, known)
            if missing:
                what, where = words.get(missing, (f"the reducer's {missing}", "model"))
                raise InputError(f"{name}: {item.key} needs {what}; add it to the {where} or remove the effect")

    def error(self, ratio: Reducer | Drive | Model | float) -> Array:
        """Transmission error, actual output angle less nominal output angle; its offset is left in.

        Returns
        -------
        ndarray, shape (n,)
            rad, positive where the output leads.  The file's own te column where it has one.  Where an angle is the
            integral of a speed, less the straight line in time that an offset of the speed makes.

        Raises
        ------
        InputError
            As `nominal_angle`, and if te contradicts the angles.
        """
        theta = self.nominal_angle(ratio)
        if self.te_column is None:
            if self.output_angle is None or self.input_angle is None:
                self.refuse(
                    "a torque record holds one angle, so it has no transmission error; only a [drive] model is "
                    "diagnosed from it"
                )
            made = self.output_angle - theta
            if INTEGRATED in self.metadata and self.time is not None:
                return without_line(made, theta=theta, time=self.time)
            return made
        if self.input_angle is not None and self.output_angle is not None:
            difference = self.te_column - (self.output_angle - theta)
            worst = float(np.max(np.abs(difference - np.mean(difference))))
            # Room for the rounding of printed columns: 0.1 arcsec, or 1 % of a large error.
            allowed = max(0.1 * units.ARCSEC, 0.01 * float(np.std(self.te_column)))
            if worst > allowed:
                self.refuse(
                    f"te differs from output_angle - input_angle / {ratio_of(ratio):g} by up to "
                    f"{worst / units.ARCSEC:.3g} arcsec, allowed are {allowed / units.ARCSEC:.2g}; "
                    "leave out te, or check the ratio"
                )
        return self.te_column.copy()

    def _check_ratio(self, input_angle: Array, ratio: float) -> None:
        if self.output_angle is None:
            # Direction tells the sign: it was stated, or read with the sign known then.
            travel = float(np.diff(input_angle) @ self.direction[1:])
            if travel * ratio < 0:
                self.refuse(
                    f"with the ratio {ratio:g} the nominal angle runs against the run's direction; correct "
                    f"'direction' or the sign of the ratio, and for mixed directions give load_run the ratio"
                )
            return
        theta = input_angle / ratio
        if np.ptp(theta) < 0.01:  # rad: play alone can do anything in so short a run
            return
        slope = fitted_slope(theta, self.output_angle)
        measured = ratio / slope if slope else np.inf
        if slope < 0:
            self.refuse(
                f"the output turns {'with' if measured > 0 else 'against'} the input, the model's ratio of {ratio:g} "
                f"says otherwise; the run's ratio is about {measured:.4g}: change the sign of the ratio or of a column"
            )
        if not 0.5 < slope < 2:
            self.refuse(
                f"the run's ratio is about {measured:.4g}, the model's {ratio:g} (a factor of 2 is the bound); "
                "check the units of the columns, their order, and the model"
            )


def load_run(
    path: PathLike,
    ratio: Reducer | Drive | Model | float | None = None,
    mapping: PathLike | BenchMapping | None = None,
) -> Run | OrderTable:
    """Read a run file, an order table, or a file of a bench: other text, MAT, HDF5, TDMS.

    Parameters
    ----------
    path : str or path-like
        What kind of file it is shows in its content, not in its name.
    ratio : Reducer, Drive, Model or float, optional
        Checked against the angles; only a run of input angle and error with mixed directions needs its sign.
    mapping : str, path-like or BenchMapping, optional
        The bench's names, units and signs; see docs page ``bench-files.md``.  Without it columns must be named as in a
        run file, and text must be one.  An order table whose header says what it is needs none.

    Returns
    -------
    Run or OrderTable
        The table where the header says ``# kind: orders`` or the mapping has ``[orders]``; see `load_orders`.

    Raises
    ------
    InputError
        If the file cannot be used; one line that names file, line, column, bound and remedy.
    """
    mapping = given_mapping(mapping)
    if is_order_file(path) or (mapping is not None and mapping.orders):
        return load_orders(path, mapping)
    return read_run(path, ratio, mapping)


def read_run(
    path: PathLike,
    ratio: Reducer | Drive | Model | float | None = None,
    mapping: PathLike | BenchMapping | None = None,
) -> Run:
    """Read a run as `load_run` does, where an order table will not do.

    Raises
    ------
    InputError
        If the file cannot be used, or is an order table.
    """
    refuse_order_file(path)
    return _run(read_bench_file(path, given_mapping(mapping) or BenchMapping()), ratio)


def run_from_arrays(
    *,
    input_angle: Any | None = None,
    output_angle: Any | None = None,
    te: Any | None = None,
    time: Any | None = None,
    direction: str | float = "mixed",
    torque: Any | None = None,
    temperature: Any | None = None,
    index: str = "",
    metadata: Mapping[str, str] | None = None,
    torque_record: Any | None = None,
    ratio: Reducer | Drive | Model | float | None = None,
) -> Run:
    """Make a run in memory, with the checks of a run file.

    Parameters
    ----------
    input_angle, output_angle, te : array_like or quantity, shape (n,)
        Two of them, or input and output angle; plain numbers are rad.
    time : array_like or quantity, shape (n,), optional
        Plain numbers are s.
    direction : {"forward", "reverse", "mixed"} or +1 or -1
        Mixed: read from the angles.
    torque, temperature : float, str or quantity, optional
        Plain numbers are N*mm and K.  A torque of shape (n,) is a column: positive where it resists forward motion.
    index : str, optional
        Label of the zero.
    metadata : mapping of str to str, optional
    torque_record : array_like or quantity, shape (n,), optional
        Beside one angle, in place of an error; plain numbers are N*mm.
    ratio : Reducer, Drive, Model or float, optional
        As in `load_run`.

    Returns
    -------
    Run

    Raises
    ------
    InputError
        If the values cannot be used.

    Examples
    --------
    >>> angle = np.linspace(0, 6, 100)
    >>> run = run_from_arrays(input_angle=121 * angle, output_angle=angle + 1e-5, direction="forward")
    >>> bool(np.allclose(run.error(121), 1e-5))
    True
    """
    size: Any = getattr(torque, "magnitude", torque)
    column = torque if np.ndim(size) else None
    given = {"input_angle": input_angle, "output_angle": output_angle, "te": te, "time": time, "output_torque": column}
    given["torque"] = torque_record
    columns = {name: row_of(name, value, DIMENSIONS[name]) for name, value in given.items() if value is not None}
    sizes = {name: values.size for name, values in columns.items()}
    check_lengths("", sizes, "give all the same number of samples")
    sense = STATED.get(direction, math.nan) if isinstance(direction, str) else float(direction)
    if sense not in (1.0, -1.0, 0.0) or (sense == 0 and direction != "mixed"):
        refuse("", f"direction = {shown(direction)}: must be 'forward', 'reverse', 'mixed', +1 or -1")
    stated = {"direction": (sense, "")}
    if torque is not None and column is None:
        stated["output_torque"] = stated_value("", "torque", torque, "torque"), ""
    if temperature is not None:
        stated["temperature"] = stated_value("", "temperature", temperature, "temperature"), ""
    reading = Reading(
        columns=columns,
        labels=np.arange(next(iter(sizes.values()), 0)),
        noun="sample",
        stated=stated,
        index=index,
        metadata=dict(metadata or {}),
    )
    return _run(reading, ratio)


def write_run(path: PathLike, run: Run, *, comments: Iterable[str] = (), overwrite: bool = False) -> None:
    """Write a run file, in one step or not at all.

    Parameters
    ----------
    path : str or path-like
    run : Run
        Its columns are written with 15 digits, in deg, arcsec and s; its notes are not.
    comments : iterable of str
        Lines to put first.
    overwrite : bool
        Whether an existing file may be replaced.

    Raises
    ------
    InputError
        If the file exists, cannot be written, or a text would not read back.
    """
    check_path(path)
    check_kind("run", run, Run, "write it as write_run(path, run)")
    write_file(path, run_text(run, comments=comments, path=str(path)), overwrite=overwrite)


def run_text(run: Run, *, comments: Iterable[str] = (), path: str = "") -> str:
    """Text of a run file, as `write_run` writes it; `path` names the file in messages."""
    head = [f"# {line}" for text in comments for line in split_lines(text)]
    for line in head:
        if (match := HEADER_LINE.match(line)) and match[1].lower() in HEADER_KEYS:
            refuse(path, f"the comment {shown(line)} would be read as a header key; write it otherwise")
    senses = set(run.direction.tolist())
    keys = {"direction": {(1.0,): "forward", (-1.0,): "reverse"}.get(tuple(senses), "mixed")}
    if run.torque is not None:
        keys["output_torque"] = f"{units.to_display(run.torque, 'torque'):.15g} N*m"
    if run.temperature is not None:
        keys["temperature"] = f"{run.temperature - 273.15:.12g} degC"
    if run.index:
        keys["index"] = run.index
    keys |= {key: value for key, value in run.metadata.items() if key.lower() not in HEADER_KEYS}
    head += header_lines(path, keys)
    columns = {
        "time[s]": run.time,
        "input_angle[deg]": None if run.input_angle is None else np.rad2deg(run.input_angle),
        "output_angle[deg]": None if run.output_angle is None else np.rad2deg(run.output_angle),
        "te[arcsec]": None if run.te_column is None else run.te_column / units.ARCSEC,
        "output_torque[N*m]": None if run.load_column is None else run.load_column / 1e3,
        "torque[N*m]": None if run.torque_record is None else run.torque_record / 1e3,
    }
    table = {name: values for name, values in columns.items() if values is not None}
    body = io.StringIO()
    np.savetxt(body, np.column_stack(list(table.values())), fmt="%.15g", delimiter=",")
    return "\n".join([*head, ",".join(table), body.getvalue()])


def _run(reading: Reading, ratio: Reducer | Drive | Model | float | None) -> Run:
    reading, direction = checked(reading, None if ratio is None else ratio_of(ratio))
    torque, column, notes = _torque(reading)
    run = Run(
        path=reading.path,
        input_angle=reading.columns.get("input_angle"),
        output_angle=reading.columns.get("output_angle"),
        te_column=reading.columns.get("te"),
        direction=direction,
        time=reading.columns.get("time"),
        torque=torque,
        load_column=column,
        torque_record=reading.columns.get("torque"),
        temperature=reading.value("temperature"),
        index=reading.index,
        metadata=reading.metadata,
        notes=(*reading.notes, *notes),
    )
    if ratio is not None:
        run.nominal_angle(ratio)  # refuses a ratio that contradicts the angles
    return run


def _torque(reading: Reading) -> tuple[float | None, Array | None, list[str]]:
    """Size of a torque that stays, or the column of one that changes, N*mm, and what to say of it."""
    column = reading.columns.get("output_torque")
    if column is None:
        return reading.value("output_torque"), None, []
    twice = "output_torque" in reading.stated
    notes = ["output_torque is in the header and a column: the column counts"] if twice else []
    means = np.array([np.mean(part) for part in np.array_split(column, _BLOCKS)])
    size, noise = abs(float(np.mean(column))), float(np.std(np.diff(column))) / math.sqrt(2 * column.size / _BLOCKS)
    if np.ptp(means) > max(_STEADY * size, _BY_NOISE * noise):
        return None, column, notes
    return size, None, [*notes, f"the column output_torque keeps to {size / 1e3:.4g} N*m: one size, against the motion"]


def ratio_of(value: Reducer | Drive | Model | float) -> float:
    """Input turns per output turn of a reducer, drive or model, or as given.

    Raises
    ------
    InputError
        If it is 0 or not finite.
    """
    if isinstance(value, Model):
        value = value.mechanism
    check_kind("ratio", value, (Reducer, Drive, Real), "give a reducer, a model, or input turns per output turn")
    number = value.ratio if isinstance(value, (Reducer, Drive)) else float(value)
    if not np.isfinite(number) or number == 0:
        raise InputError(f"ratio = {number:g}: must be a finite number other than 0, input turns per output turn")
    return number
