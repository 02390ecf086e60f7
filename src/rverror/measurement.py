"""Runs: measured or simulated angles, their files and their checks.

A run file is comma-separated text: ``# key: value`` lines, one line of column names with the unit in brackets, rows of
numbers.  Whatever is wrong with it is refused in one line, or, where a part is usable, left out and counted in `notes`.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NoReturn

import numpy as np

from rverror import units
from rverror.errors import InputError
from rverror.kinematics import Array, motion_direction
from rverror.model import Model
from rverror.reducer import Drive, Reducer
from rverror.textfile import PathLike, did_you_mean, read_text, shown, some, split_lines, write_text

#: Fewest usable samples of a run.
LEAST_SAMPLES = 16
#: Largest share of rows without a number that is left out; a run with more is refused.
MOST_UNUSABLE = 0.1
#: A step longer than this many median steps is a gap.
GAP = 3.0

_COLUMNS = {"input_angle": "angle", "output_angle": "angle", "te": "angle", "time": "time"}
_EXAMPLES = {"input_angle": "deg", "output_angle": "deg", "te": "arcsec", "time": "s"}
_HEADER_KEYS = ("direction", "output_torque", "temperature", "index")
_DIRECTIONS = {"forward": 1.0, "reverse": -1.0, "mixed": 0.0}
_HEADER_LINE = re.compile(r"#+\s*([A-Za-z_][\w .\-/]*?)\s*:\s*(.*?)\s*$")
_COLUMN = re.compile(r"([^\[\]]*?)\s*(?:\[([^\[\]]*)\])?$")
_TORQUE = re.compile(r"torque\s*\[[^\[\]]+\]", re.IGNORECASE)
# Angles beyond this are no reading of an encoder, and their products overflow.
_LARGEST = 1e15


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
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
        Size of the output torque, N*mm.
    temperature : float, optional
        K.
    index : str
        Label of the zero: empty (aligned, with an offset of its own), ``"unknown"``, or a label shared with other runs.
    metadata : mapping of str to str
        Every header key, as written.
    notes : tuple of str
        What was left out, changed or noticed, counted.
    extra : mapping of str to ndarray
        Other columns in their own unit, by their name as written; NaN where a cell holds no number.

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
    temperature: float | None = None
    index: str = ""
    metadata: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    extra: Mapping[str, Array] = field(default_factory=dict)

    @property
    def size(self) -> int:
        """Number of samples."""
        return int(self.direction.size)

    def nominal_angle(self, ratio: Reducer | Drive | Model | float) -> Array:
        """Nominal output angle theta, input angle / ratio; output less error where there is no input angle.

        Parameters
        ----------
        ratio : Reducer, Drive, Model or float
            Input turns per output turn.

        Returns
        -------
        ndarray, shape (n,)
            rad.

        Raises
        ------
        InputError
            If the ratio contradicts the run.
        """
        value = _ratio(ratio)
        if self.input_angle is None:
            assert self.output_angle is not None  # checked when the run was made
            return self.output_angle if self.te_column is None else self.output_angle - self.te_column
        self._check_ratio(value)
        return self.input_angle / value

    def error(self, ratio: Reducer | Drive | Model | float) -> Array:
        """Transmission error, actual output angle less nominal output angle; its offset is left in.

        Parameters
        ----------
        ratio : Reducer, Drive, Model or float
            Input turns per output turn.

        Returns
        -------
        ndarray, shape (n,)
            rad, positive where the output leads.  The file's own te column where it has one.

        Raises
        ------
        InputError
            If the ratio contradicts the run.
        """
        theta = self.nominal_angle(ratio)
        if self.te_column is None and (self.output_angle is None or self.input_angle is None):
            _refuse(
                self.path,
                "a torque record holds one angle, so it has no transmission error; only a [drive] model is diagnosed "
                "from it",
            )
        if self.te_column is None:
            assert self.output_angle is not None  # checked when the run was made
            return self.output_angle - theta
        if self.input_angle is not None and self.output_angle is not None:
            difference = self.te_column - (self.output_angle - theta)
            worst = float(np.max(np.abs(difference - np.mean(difference))))
            # Room for the rounding of printed columns: 0.1 arcsec, or 1 % of a large error.
            allowed = max(0.1 * units.ARCSEC, 0.01 * float(np.std(self.te_column)))
            if worst > allowed:
                _refuse(
                    self.path,
                    f"te differs from output_angle - input_angle / {_ratio(ratio):g} by up to "
                    f"{worst / units.ARCSEC:.3g} arcsec, allowed are {allowed / units.ARCSEC:.2g}; "
                    "leave out te, or check the ratio",
                )
        return self.te_column.copy()

    def _check_ratio(self, ratio: float) -> None:
        assert self.input_angle is not None
        if self.output_angle is None:
            # Direction tells the sign: it was stated, or read with the sign known then.
            travel = _travel(self.input_angle, self.direction)
            if travel * ratio < 0:
                _refuse(
                    self.path,
                    f"with the ratio {ratio:g} the nominal angle runs against the run's direction; correct "
                    f"'direction' or the sign of the ratio, and for mixed directions give load_run the ratio",
                )
            return
        theta = self.input_angle / ratio
        if np.ptp(theta) < 0.01:  # rad: play alone can do anything in so short a run
            return
        slope = _slope(theta, self.output_angle)
        measured = ratio / slope if slope else np.inf
        if slope < 0:
            _refuse(
                self.path,
                f"the output turns {'with' if measured > 0 else 'against'} the input, the model's ratio of {ratio:g} "
                f"says otherwise; the run's ratio is about {measured:.4g}: change the sign of the ratio or of a column",
            )
        if not 0.5 < slope < 2:
            _refuse(
                self.path,
                f"the run's ratio is about {measured:.4g}, the model's {ratio:g} (a factor of 2 is the bound); "
                "check the units of the columns, their order, and the model",
            )


def load_run(path: PathLike, ratio: Reducer | Drive | Model | float | None = None) -> Run:
    """Read a run file.

    Parameters
    ----------
    path : str or path-like
    ratio : Reducer, Drive, Model or float, optional
        Checked against the angles; only a run of input angle and error with mixed directions needs its sign.

    Returns
    -------
    Run

    Raises
    ------
    InputError
        If the file cannot be used; one line that names file, line, column, bound and remedy.
    """
    name = str(path)
    lines = split_lines(read_text(path))
    first = next((i for i, line in enumerate(lines) if line.strip() and not line.lstrip().startswith("#")), None)
    if first is None:
        what = "has no columns" if any(line.strip() for line in lines) else "is empty"
        _refuse(name, f"the file {what}; write 'input_angle[deg],output_angle[deg]' and rows of numbers")
    header = _header(name, lines[:first])
    names, dimensions, factors = _columns(name, lines[first], first + 1)
    rows = [i for i in range(first + 1, len(lines)) if lines[i].strip() and not lines[i].lstrip().startswith("#")]
    if not rows:
        _refuse(name, f"line {first + 1}: no rows below the column names; {LEAST_SAMPLES} samples or more are needed")
    _check_later_comments(name, lines, first)
    table = _numbers(name, lines, rows, dimensions)
    columns: dict[str, Array] = {}
    extra: dict[str, Array] = {}
    for label, dimension, factor, values in zip(names, dimensions, factors, table.T, strict=True):
        if dimension is None:
            extra[label] = values
        else:
            with np.errstate(over="ignore"):  # what overflows is left out below, and counted
                columns[label] = values * factor
    return _assemble(
        name,
        columns,
        extra,
        labels=np.array(rows) + 1,
        noun="line",
        stated=_stated_direction(name, header),
        stated_at=f"line {header['direction'][1]}: " if "direction" in header else "",
        torque=_header_value(name, header, "output_torque", "torque"),
        temperature=_header_value(name, header, "temperature", "temperature"),
        index=header["index"][0] if "index" in header else "",
        metadata={text: value for value, _, text in header.values()},
        notes=_header_notes(header),
        ratio=ratio,
    )


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
    extra: Mapping[str, Any] | None = None,
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
        Plain numbers are N*mm and K.
    index : str, optional
        Label of the zero.
    metadata : mapping of str to str, optional
    extra : mapping of str to array_like, optional
        Other columns.
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
    given = {"input_angle": input_angle, "output_angle": output_angle, "te": te, "time": time}
    columns = {name: _row(name, value, _COLUMNS[name]) for name, value in given.items() if value is not None}
    others = {name: _row(name, value, None) for name, value in (extra or {}).items()}
    sizes = {name: values.size for name, values in (columns | others).items()}
    if len(set(sizes.values())) > 1:
        listed = ", ".join(f"{name} {size}" for name, size in sizes.items())
        _refuse("", f"the columns differ in length ({listed}); give all the same number of samples")
    stated = _DIRECTIONS.get(direction) if isinstance(direction, str) else float(direction)
    if stated not in (1.0, -1.0, 0.0) or (stated == 0 and direction != "mixed"):
        _refuse("", f"direction = {shown(direction)}: must be 'forward', 'reverse', 'mixed', +1 or -1")
    return _assemble(
        "",
        columns,
        others,
        labels=np.arange(next(iter(sizes.values()), 0)),
        noun="sample",
        stated=stated,
        stated_at="",
        torque=_plain("torque", torque, "torque"),
        temperature=_plain("temperature", temperature, "temperature"),
        index=index,
        metadata=dict(metadata or {}),
        notes=[],
        ratio=ratio,
    )


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
    write_text(path, run_text(run, comments=comments, path=str(path)), overwrite=overwrite)


def run_text(run: Run, *, comments: Iterable[str] = (), path: str = "") -> str:
    """Text of a run file.

    Parameters
    ----------
    run : Run
    comments : iterable of str
        Lines to put first.
    path : str
        Name of the file for messages.

    Returns
    -------
    str

    Raises
    ------
    InputError
        If a text would not read back.
    """
    head = [f"# {line}" for text in comments for line in split_lines(text)]
    for line in head:
        if (match := _HEADER_LINE.match(line)) and match[1].lower() in _HEADER_KEYS:
            _refuse(path, f"the comment {shown(line)} would be read as a header key; write it otherwise")
    senses = set(run.direction.tolist())
    keys = {"direction": {(1.0,): "forward", (-1.0,): "reverse"}.get(tuple(senses), "mixed")}
    if run.torque is not None:
        keys["output_torque"] = f"{units.to_display(run.torque, 'torque'):.15g} N*m"
    if run.temperature is not None:
        keys["temperature"] = f"{run.temperature - 273.15:.12g} degC"
    if run.index:
        keys["index"] = run.index
    keys |= {key: value for key, value in run.metadata.items() if key.lower() not in _HEADER_KEYS}
    for key, value in keys.items():
        line = f"# {key}: {value}"
        match = _HEADER_LINE.match(line)
        if len(split_lines(line)) > 1 or match is None or match.groups() != (key, value.strip()):
            _refuse(path, f"the header {shown(line)} would not read back; use a plain word for the key and one line")
        head.append(line)
    columns = {
        "time[s]": run.time,
        "input_angle[deg]": None if run.input_angle is None else np.rad2deg(run.input_angle),
        "output_angle[deg]": None if run.output_angle is None else np.rad2deg(run.output_angle),
        "te[arcsec]": None if run.te_column is None else run.te_column / units.ARCSEC,
    }
    table = {name: values for name, values in (columns | dict(run.extra)).items() if values is not None}
    for name in run.extra:
        match = _COLUMN.match(name)
        if match is None or not match[1] or match[1].lower() in _COLUMNS or re.search(r"[,;\r\n#]", name):
            _refuse(path, f"the column name {shown(name)} would not read back; use a plain word and [unit]")
    body = io.StringIO()
    np.savetxt(body, np.column_stack(list(table.values())), fmt="%.15g", delimiter=",")
    return "\n".join([*head, ",".join(table), body.getvalue()])


def _refuse(path: str, message: str) -> NoReturn:
    comma = path and message.startswith("line ")
    raise InputError(f"{path or 'run'}{', ' if comma else ': '}{message}")


def _ratio(value: Reducer | Drive | Model | float) -> float:
    if isinstance(value, Model):
        value = value.mechanism
    number = value.ratio if isinstance(value, (Reducer, Drive)) else float(value)
    if not np.isfinite(number) or number == 0:
        raise InputError(f"ratio = {number:g}: must be a finite number other than 0, input turns per output turn")
    return number


# --- the header -------------------------------------------------------------------------------------------------------

_Header = dict[str, tuple[str, int, str]]  # lower-case key: value, line, key as written


def _header(path: str, lines: Sequence[str]) -> _Header:
    found: _Header = {}
    for number, line in enumerate(lines, 1):
        match = _HEADER_LINE.match(line.strip())
        if match is None:
            continue
        key, value = match.groups()
        known = key.lower() if key.lower() in _HEADER_KEYS else key
        if known in found and known in _HEADER_KEYS and found[known][0] != value:
            _refuse(
                path,
                f"line {number}: {key} = {shown(value)}, but line {found[known][1]} says {shown(found[known][0])}; "
                "leave one of them",
            )
        found[known] = (value, number, key)
    return found


def _header_notes(header: _Header) -> list[str]:
    notes = []
    for key, (_, line, _) in header.items():
        if key not in _HEADER_KEYS and (hint := did_you_mean(key, _HEADER_KEYS)):
            notes.append(f"header key {shown(key)} in line {line} has no meaning here and is only kept;{hint}")
    return notes


def _header_value(path: str, header: _Header, key: str, dimension: str) -> float | None:
    if key not in header:
        return None
    value, line, _ = header[key]
    try:
        number = units.parse(value, dimension)
    except ValueError as error:
        _refuse(path, f"line {line}: {key}: {error}")
    return _checked(path, f"line {line}: {key}", number, dimension)


def _checked(path: str, what: str, number: float, dimension: str) -> float:
    if dimension == "temperature" and number < 0:
        _refuse(path, f"{what}: {number:g} K lies below absolute zero; check the sign and the unit")
    return abs(number) if dimension == "torque" else number


def _stated_direction(path: str, header: _Header) -> float | None:
    """+1, -1, 0 for mixed, None where nothing is said."""
    if "direction" not in header:
        return None
    value, line, _ = header["direction"]
    if value.lower() not in _DIRECTIONS:
        hint = did_you_mean(value, _DIRECTIONS)
        _refuse(
            path, f"line {line}: direction = {shown(value)}: must be forward, reverse or mixed;{hint or ' use one'}"
        )
    return _DIRECTIONS[value.lower()]


def _check_later_comments(path: str, lines: Sequence[str], first: int) -> None:
    for number in range(first + 1, len(lines)):
        line = lines[number].strip()
        if line.startswith("#") and (match := _HEADER_LINE.match(line)) and match[1].lower() in _HEADER_KEYS:
            _refuse(
                path,
                f"line {number + 1}: {match[1]} stands among the rows; write it above the column names, and each run "
                "in a file of its own",
            )


# --- the columns ------------------------------------------------------------------------------------------------------


def _columns(path: str, line: str, number: int) -> tuple[list[str], list[str | None], list[float]]:
    where = f"line {number}"
    for sign, word in ((";", "semicolons"), ("\t", "tabs")):
        if sign in line and line.count(sign) >= line.count(","):
            _refuse(
                path, f"{where}: the columns are separated by {word}; use ',' between cells and '.' as decimal sign"
            )
    cells = [cell.strip().strip('"').strip() for cell in line.split(",")]
    if all(_number(cell) is not None for cell in cells):
        _refuse(
            path, f"{where}: numbers where the column names should be; write 'input_angle[deg],output_angle[deg]' first"
        )
    names: list[str] = []
    dimensions: list[str | None] = []
    factors: list[float] = []
    seen: dict[str, int] = {}
    for place, cell in enumerate(cells, 1):
        at = f"{where}, column {place}"
        if not cell:
            _refuse(path, f"{at}: the column has no name; name it or delete the comma")
        match = _COLUMN.match(cell)
        if match is None:
            _refuse(path, f"{at}: {shown(cell)} is no column name; write it like 'input_angle[deg]'")
        name, unit = match[1].strip(), match[2]
        known = name.lower() if name.lower() in _COLUMNS else None
        key = known or cell
        if key in seen:
            _refuse(path, f"{at}: {key} stands in column {seen[key]} too; leave one of them")
        seen[key] = place
        names.append(key)
        if known is None:
            dimensions.append(None)
            factors.append(1.0)
            continue
        if not (unit or "").strip():
            _refuse(path, f"{at}: {known} has no unit; write '{known}[{_EXAMPLES[known]}]'")
        try:
            factor = units.unit_factor(str(unit).strip(), _COLUMNS[known])
        except ValueError as error:
            # The remedy of the units edge knows the dimension only, this one the column.
            _refuse(path, f"{at}: {known}: {str(error).partition(';')[0]}; write '{known}[{_EXAMPLES[known]}]'")
        dimensions.append(_COLUMNS[known])
        factors.append(factor)
    _check_needed(path, where, names)
    return names, dimensions, factors


def torque_column(names: Iterable[str]) -> str | None:
    """Name of the column that makes a run of one angle a torque record, like ``torque[N*m]``; None where there is none.

    Parameters
    ----------
    names : iterable of str
        Names of columns, with units.

    Returns
    -------
    str or None
    """
    return next((name for name in names if _TORQUE.fullmatch(name)), None)


def _check_needed(path: str, where: str, names: Sequence[str]) -> None:
    have = [name for name in names if name in _COLUMNS and name != "time"]
    if len(have) >= 2 or (have in (["input_angle"], ["output_angle"]) and torque_column(names) is not None):
        return
    missing = [name for name in ("input_angle", "output_angle", "te") if name not in have]
    hint = ""
    for name in names:
        if name in _COLUMNS:
            continue
        bare = re.split(r"[\[(]", name)[0].strip().lower()
        guess = (
            next((known for known in missing if bare == known), None)
            or (re.search(r"'(\w+)'", did_you_mean(bare, missing)) or [None, None])[1]
        )
        if guess:
            hint = f" did you mean '{guess}[{_EXAMPLES[guess]}]' by {shown(name)}?"
            break
    what = f"besides {have[0]} there is no" if have else "there is no"
    listed = " and no ".join(missing) if have else "input_angle, output_angle or te"
    _refuse(
        path,
        f"{where}: {what} {listed}, so the transmission error cannot be told;{hint} give input_angle[deg] and "
        "output_angle[deg], or te[arcsec] and one of them",
    )


# --- the rows ---------------------------------------------------------------------------------------------------------


def _numbers(path: str, lines: Sequence[str], rows: Sequence[int], dimensions: Sequence[str | None]) -> Array:
    """Parse all rows at once; only where that fails look at each line."""
    try:
        table: Array = np.loadtxt([lines[i] for i in rows], delimiter=",", dtype=np.float64, ndmin=2)
        if table.shape == (len(rows), len(dimensions)):
            return table
    except ValueError:
        pass
    table = np.full((len(rows), len(dimensions)), np.nan)
    for row, i in enumerate(rows):
        cells = lines[i].partition("#")[0].split(",")
        if len(cells) != len(dimensions):
            if ";" in lines[i]:
                remedy = "use ',' between cells and '.' as decimal sign"
            elif len(cells) == 2 * len(dimensions):
                remedy = "if the comma is the decimal sign, write '.' for it"
            else:
                remedy = "complete the row or delete it"
            plural = "s" if len(cells) > 1 else ""
            _refuse(path, f"line {i + 1}: {len(cells)} cell{plural}, but {len(dimensions)} column names; {remedy}")
        for column, cell in enumerate(cells):
            value = _number(cell.strip())
            if value is not None:
                table[row, column] = value
    return table


def _number(cell: str) -> float | None:
    try:
        return None if "_" in cell else float(cell)
    except ValueError:
        return None


def _row(name: str, value: Any, dimension: str | None) -> Array:
    """One column given in memory, core units; values that are not finite stay for the check of the rows."""
    factor = 1.0
    if dimension is not None and units.is_quantity(value):
        try:
            factor = units.unit_factor(str(value.units), dimension)
        except ValueError as error:
            _refuse("", f"{name}: {error}")
    try:
        array = np.array(getattr(value, "magnitude", value), dtype=np.float64)
    except (TypeError, ValueError):
        _refuse("", f"{name} holds something that is no number; give an array of numbers or a quantity")
    if array.ndim != 1:
        _refuse("", f"{name} has the shape {array.shape}; give one row of samples")
    with np.errstate(over="ignore"):  # what overflows is left out below, and counted
        return np.asarray(array * factor, dtype=np.float64)


def _plain(name: str, value: Any | None, dimension: str) -> float | None:
    if value is None:
        return None
    try:
        number = units.to_core(value, dimension)
    except ValueError as error:
        _refuse("", f"{name}: {error}")
    return _checked("", name, number, dimension)


# --- from columns to a run --------------------------------------------------------------------------------------------


def _assemble(
    path: str,
    columns: dict[str, Array],
    extra: dict[str, Array],
    *,
    labels: np.ndarray[Any, np.dtype[Any]],
    noun: str,
    stated: float | None,
    stated_at: str,
    torque: float | None,
    temperature: float | None,
    index: str,
    metadata: Mapping[str, str],
    notes: list[str],
    ratio: Reducer | Drive | Model | float | None,
) -> Run:
    _check_needed(path, "columns", [*columns, *extra])
    usable = np.logical_and.reduce([np.abs(values) < _LARGEST for values in columns.values()])  # false for NaN
    dropped = int(np.count_nonzero(~usable))
    if dropped:
        listed = some((labels[~usable]).tolist())
        plural = "s" if dropped > 1 else ""
        where = f"({noun}{plural} {listed})"
        if dropped > MOST_UNUSABLE * usable.size:
            _refuse(
                path,
                f"{dropped} of {usable.size} rows hold no number in a needed column {where}, at most "
                f"{100 * MOST_UNUSABLE:.0f} % may be left out; repair or export the file again",
            )
        notes.append(f"{dropped} row{plural} without a number left out {where}")
    count = int(np.count_nonzero(usable))
    if count < LEAST_SAMPLES:
        _refuse(path, f"{count} usable samples; {LEAST_SAMPLES} or more are needed: measure a longer run")
    if dropped:
        columns = {name: values[usable] for name, values in columns.items()}
        extra = {name: values[usable] for name, values in extra.items()}
        labels = labels[usable]
    time = columns.get("time")
    if time is not None:
        _check_time(path, time, labels, noun, notes)
    for name in ("input_angle", "output_angle"):
        if name in columns:
            columns[name] = _unwrapped(path, name, columns[name], notes)
    leading = "input_angle" if "input_angle" in columns else "output_angle"
    if time is not None:
        _note_gaps("time", time, "s", labels, noun, notes)
    else:
        _note_gaps(leading, np.rad2deg(columns[leading]), "deg", labels, noun, notes)
    sense, sure = _sense(columns, None if ratio is None else _ratio(ratio))
    direction = _direction(
        path,
        leading,
        sense * columns[leading],
        stated=stated,
        stated_at=stated_at,
        sure=sure,
        labels=labels,
        noun=noun,
        notes=notes,
    )
    run = Run(
        path=path,
        input_angle=columns.get("input_angle"),
        output_angle=columns.get("output_angle"),
        te_column=columns.get("te"),
        direction=direction,
        time=time,
        torque=torque,
        temperature=temperature,
        index=index,
        metadata=metadata,
        notes=tuple(notes),
        extra=extra,
    )
    if ratio is not None:
        run.nominal_angle(ratio)  # refuses a ratio that contradicts the angles
    return run


def _check_time(path: str, time: Array, labels: Any, noun: str, notes: list[str]) -> None:
    steps = np.diff(time)
    back = np.flatnonzero(steps < 0)
    if back.size:
        _refuse(
            path,
            f"{noun} {labels[back[0] + 1]}: time runs back from {time[back[0]]:.9g} s to {time[back[0] + 1]:.9g} s; "
            "put the rows in order, and each run in a file of its own",
        )
    repeated = np.flatnonzero(steps == 0)
    if repeated.size == steps.size:
        _refuse(path, f"time stands still at {time[0]:.9g} s; leave the column out or repair it")
    if repeated.size:
        plural = "s" if repeated.size > 1 else ""
        notes.append(
            f"{repeated.size} repeated time stamp{plural} ({noun}{plural} {some(labels[repeated + 1].tolist())})"
        )


def _unwrapped(path: str, name: str, angle: Array, notes: list[str]) -> Array:
    """Undo the jumps of an angle that is kept within one turn."""
    jumps = np.abs(np.diff(angle)) > np.pi
    if not jumps.any() or np.ptp(angle) > 2 * np.pi * (1 + 1e-9):
        return angle
    whole = np.unwrap(angle)
    steps = np.abs(np.diff(whole))
    if not (steps[jumps] <= 10 * np.median(steps[steps > 0]) if steps.any() else jumps).any():
        return angle  # a gap, not a jump by a whole turn
    if np.median(steps) > np.pi / 2:
        _refuse(
            path,
            f"{name} stays within one turn and moves {np.rad2deg(np.median(steps)):.0f} deg between samples, at most "
            "90 deg can be unwrapped safely; write the angle that counts turns, or sample more often",
        )
    count = int(np.count_nonzero(jumps))
    notes.append(f"{name} unwrapped: {count} jump{'s' if count > 1 else ''} by a turn removed")
    return np.asarray(whole, dtype=np.float64)


def _note_gaps(name: str, values: Array, unit: str, labels: Any, noun: str, notes: list[str]) -> None:
    steps = np.abs(np.diff(values))
    if not steps.any():
        return
    median = float(np.median(steps[steps > 0]))
    gaps = np.flatnonzero(steps > GAP * median * (1 + 1e-9))
    if gaps.size:
        longest = gaps[np.argmax(steps[gaps])]
        notes.append(
            f"{gaps.size} gap{'s' if gaps.size > 1 else ''} in {name} (step above {GAP:g} times the median of "
            f"{median:.4g} {unit}; the longest, {steps[longest]:.4g} {unit}, after {noun} {labels[longest]})"
        )


def _slope(x: Array, y: Array) -> float:
    """Least-squares slope of y over x; 0 where x does not move."""
    x = x - np.mean(x)
    power = float(x @ x)
    return float(x @ y) / power if power > 0 else 0.0


def _travel(angle: Array, direction: Array) -> float:
    """Way made along the stated direction, so that it is positive where the two agree."""
    return float(np.diff(angle) @ direction[1:])


def _sense(columns: Mapping[str, Array], ratio: float | None) -> tuple[float, bool]:
    """Sign that turns the leading angle into one that grows with theta, and whether it is known."""
    if "input_angle" not in columns:
        return 1.0, True
    if "output_angle" in columns:
        # The measured sign, not the model's: a ratio of the wrong sign is refused later, by name.
        slope = _slope(columns["input_angle"], columns["output_angle"])
        return (-1.0 if slope < 0 else 1.0), True
    return (1.0, False) if ratio is None else (float(np.sign(ratio)), True)


def _direction(
    path: str,
    name: str,
    angle: Array,
    *,
    stated: float | None,
    stated_at: str,
    sure: bool,
    labels: Any,
    noun: str,
    notes: list[str],
) -> Array:
    reach = float(np.ptp(angle))
    if reach == 0:
        _refuse(path, f"{name} does not move, so there is nothing to compare; give the run of a turning drive")
    steps = np.abs(np.diff(angle))
    # Less than ten typical steps back and forth is jitter of the encoder, not a reversal.
    jitter = min(10 * float(np.median(steps[steps > 0])), reach / 4)
    if stated:
        if sure:
            _check_direction(path, name, angle, stated, stated_at, jitter, labels, noun)
        return np.full(angle.size, stated)
    direction = smooth_direction(angle, jitter)
    if stated is None:
        turns = int(np.count_nonzero(np.diff(direction)))
        found = f"{turns} reversals" if turns else ("forward" if direction[0] > 0 else "reverse")
        notes.append(f"no direction in the header; read from {name}: {found}")
    if not sure:
        notes.append(
            "direction read from input_angle for a positive ratio; give load_run the ratio where it is negative"
        )
    return direction


def _check_direction(
    path: str, name: str, angle: Array, stated: float, stated_at: str, jitter: float, labels: Any, noun: str
) -> None:
    word, opposite = ("forward", "reverse") if stated > 0 else ("reverse", "forward")
    way = stated * angle
    if way[-1] < way[0]:
        verb = "falls" if stated > 0 else "grows"
        _refuse(
            path,
            f"{stated_at}direction says {word}, but the output angle {verb} from first to last row; write {opposite}",
        )
    back = np.maximum.accumulate(way) - way
    worst = int(np.argmax(back))
    bound = max(jitter, 0.01 * float(np.ptp(angle)))
    if back[worst] > bound:
        _refuse(
            path,
            f"{noun} {labels[worst]}: direction says {word}, but {name} has gone back by "
            f"{np.rad2deg(back[worst]):.4g} deg (bound {np.rad2deg(bound):.3g} deg); write 'mixed' or split the run",
        )


def smooth_direction(angle: Array, jitter: float) -> Array:
    """Direction of motion of an angle that jitters.

    Parameters
    ----------
    angle : ndarray, shape (n,)
        rad.
    jitter : float
        A way back counts as a reversal only where it is longer than this, rad.

    Returns
    -------
    ndarray, shape (n,)
        +1 or -1, turning at the extreme itself, not where the way back has grown long enough.
    """
    extremes = [0]
    low = high = 0
    sense = 0
    values = angle.tolist()
    for i, value in enumerate(values):
        if value >= values[high]:
            high = i
        if value <= values[low]:
            low = i
        if sense >= 0 and values[high] - value > jitter:
            if sense:  # before the first way longer than the jitter there is no reversal
                extremes.append(high)
            sense, low = -1, i
        elif sense <= 0 and value - values[low] > jitter:
            if sense:
                extremes.append(low)
            sense, high = 1, i
    extremes.append(high if sense > 0 else low if sense < 0 else angle.size - 1)
    places = np.unique(extremes)
    # A line through the extremes moves as the angle does, without its jitter.
    return motion_direction(np.interp(np.arange(angle.size), places, angle[places]))
