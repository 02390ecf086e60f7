"""Tables as controllers take them, written and read back: CSV, Fourier coefficients as JSON, LinuxCNC."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.directions import DIRECTIONS
from rverror.base.errors import InputError
from rverror.base.numbers import brief, way
from rverror.base.text import PathLike, read_text, shown, split_lines, write_file
from rverror.base.units import ARCSEC
from rverror.compensation.correction import FEWEST, Correction
from rverror.compensation.outcome import Compensation
from rverror.geartrain.mechanism import Drive, Reducer
from rverror.model.effects import Model
from rverror.runs.measurement import ratio_of
from rverror.runs.order_table import OrderCase, OrderTable, TableCondition

FORMATS = ("csv", "json", "linuxcnc")
#: Points of a joint's table in LinuxCNC: EMCMOT_COMP_SIZE.
LINUXCNC_POINTS = 256
_TURN = 2 * math.pi
_KIND = "compensation"
_BETWEEN = 0.1  # of the error that stays anyway, which straight lines between the points may leave
_COLUMNS = "output_angle[deg],forward[deg],reverse[deg]"
_ADDED = "input command = ratio * output_angle + correction"
_SUM = (
    "input command = ratio * (theta + sum of cos_arcsec * cos(order * theta) + sin_arcsec * sin(order * theta)), "
    "theta the output angle that is commanded"
)
_CONDITION = {
    "torque": ("output_torque_newton_metre", "torque"),
    "input_speed": ("input_speed_rpm", "angular_speed"),
    "temperature": ("temperature_celsius", "temperature"),
}


@dataclass(frozen=True, eq=False)
class CommandTable:
    """A correction by points: straight from one to the next.

    Attributes
    ----------
    ratio : float
        R, input turns per output turn.
    angle : ndarray, shape (n,)
        Commanded output angle, rad, growing.
    forward, reverse : ndarray, shape (n,)
        What is added in each direction, as an angle of the output, rad.
    """

    ratio: float
    angle: Array
    forward: Array
    reverse: Array

    @property
    def periodic(self) -> bool:
        """Whether it spans a turn and repeats; else the ends hold beyond."""
        return math.isclose(self.angle[-1] - self.angle[0], _TURN, abs_tol=1e-6)

    def at(self, theta: Array, condition: TableCondition) -> Array:
        """What is added at commanded output angles in the direction of a condition, rad, shape (n,)."""
        where = self.angle[0] + np.mod(theta - self.angle[0], _TURN) if self.periodic else theta
        return np.interp(where, self.angle, self.forward if condition.direction > 0 else self.reverse)


@dataclass(frozen=True)
class WrittenTable:
    """What was written, and what the form of the table costs.

    Attributes
    ----------
    format : str
    torque : float, optional
        Load at which it holds, N*mm; None of JSON, which has all, and where no run states one.
    points : int
        Zero of JSON.
    expected : float
        Error with it: what stays on data left out, what the form leaves between its points and cannot hold, rms, rad.
    between : float
        What straight lines between the points leave, rms, rad.
    slipped : float
        What the table leaves of its own waves where its zero slips by a degree, rms, rad.
    waves : float
        Rms of those waves, rad.
    left_out : tuple of float
        Orders that the form cannot hold.
    """

    format: str
    torque: float | None
    points: int
    expected: float
    between: float
    slipped: float
    waves: float
    left_out: tuple[float, ...]


def save_compensation(
    path: PathLike, made: Compensation, *, format: str = "csv", torque: Any | None = None, overwrite: bool = False
) -> WrittenTable:
    """Write the table of a compensation for a controller, in one step or not at all.

    Parameters
    ----------
    path : str or path-like
    made : Compensation
    format : {"csv", "json", "linuxcnc"}
        Points of the output angle with what is added to the input's command; waves of all conditions; or triplets of a
        LinuxCNC joint in degrees of the output, ``COMP_FILE_TYPE = 0``.
    torque : float, str or quantity, optional
        Load of a table by points; plain numbers are N*mm.  The middle one of those measured where left out.
    overwrite : bool
        Whether an existing file may be replaced.

    Returns
    -------
    WrittenTable

    Raises
    ------
    InputError
        If nothing survives, the format is unknown, or the file exists or cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import rverror
    >>> theta = np.linspace(0, 4 * np.pi, 2001)
    >>> te = 2e-5 * np.cos(14 * theta) + 1e-6 * np.random.default_rng(1).normal(size=2001)
    >>> unit = rverror.Model(rverror.Drive(ratio=14.0))
    >>> made = rverror.compensate(unit, [rverror.run_from_arrays(input_angle=14 * theta, te=te)])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     written = save_compensation(Path(folder, "table.csv"), made)
    ...     table = load_compensation(Path(folder, "table.csv"), unit)
    >>> added = table.at(np.zeros(1), made.correction.condition(1.0))
    >>> bool(abs(added[0] + 2e-5) < 1e-6), written.format
    (True, 'csv')
    """
    if format not in FORMATS:
        raise InputError(f"format = {shown(format)}: must be one of {', '.join(FORMATS)}")
    if not made.worth:
        raise InputError(f"{path}: nothing survives on data left out, so no table is written: {made.stays[0]}")
    load = None if torque is None else units.named_core("torque", torque, "torque")
    correction = made.correction.of_orders(held_by(made.correction, format))
    if not correction.orders.size:
        raise InputError(f"{path}: the {format} table can hold none of the orders; use json, which holds any")
    both = [correction.condition(sense, load) for sense in (1.0, -1.0)]
    at = both[0].torque
    points, between = _points(correction, format, both, _BETWEEN * made.after.rms)
    if format == "json":
        text = json.dumps(correction_json(made.correction, made.index), indent=1) + "\n"
    else:
        table = by_points(correction, at, points)
        text = _csv(table, made, at) if format == "csv" else _linuxcnc(table)
    write_file(path, text, overwrite=overwrite)
    left_out = np.setdiff1d(made.correction.orders, correction.orders)
    lost = max(made.correction.of_orders(left_out).rms(condition) for condition in both)
    worse = max(both, key=correction.rms)
    return WrittenTable(
        format=format,
        torque=None if format == "json" else at,
        points=points,
        expected=math.sqrt(made.after.rms**2 + between**2 + lost**2),
        between=between,
        slipped=correction.slipped(math.radians(1), worse),
        waves=correction.rms(worse),
        left_out=tuple(left_out.tolist()),
    )


def held_by(correction: Correction, format: str) -> Array:
    """Orders of a correction that a format can hold.

    Parameters
    ----------
    correction : Correction
    format : str

    Notes
    -----
    A table by points over a turn has whole orders only; LinuxCNC's 256 points have no more than 63 orders of a turn.
    """
    orders = correction.orders
    low, high = correction.reach or (0.0, _TURN)
    if format != "json" and correction.reach is None:
        orders = orders[orders == np.round(orders)]
    if format == "linuxcnc":
        orders = orders[orders * FEWEST <= math.floor((LINUXCNC_POINTS - 1) * _TURN / (high - low))]
    return orders


def by_points(correction: Correction, torque: float | None, points: int) -> CommandTable:
    """A correction at one load by even points from end to end of its reach, or of a turn."""
    low, high = correction.reach or (0.0, _TURN)
    angle = np.linspace(low, high, points)
    forward, reverse = (correction.settled(angle, correction.condition(sense, torque)) for sense in (1.0, -1.0))
    return CommandTable(correction.ratio, angle, forward, reverse)


def load_compensation(path: PathLike, ratio: Reducer | Drive | Model | float) -> Correction | CommandTable:
    """Read a table that `save_compensation` wrote.

    Parameters
    ----------
    path : str or path-like
        What kind of file it is shows in its content.
    ratio : Reducer, Drive, Model or float
        Input turns per output turn; a LinuxCNC table holds none of its own.

    Returns
    -------
    Correction or CommandTable
        Both tell with ``at(theta, condition)`` what is added, as an angle of the output.

    Raises
    ------
    InputError
        If it is no such table, or one for another ratio.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import rverror
    >>> theta = np.linspace(0, 4 * np.pi, 2001)
    >>> te = 2e-5 * np.cos(14 * theta) + 1e-6 * np.random.default_rng(1).normal(size=2001)
    >>> unit = rverror.Model(rverror.Drive(ratio=14.0))
    >>> made = rverror.compensate(unit, [rverror.run_from_arrays(input_angle=14 * theta, te=te)])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     written = save_compensation(Path(folder, "table.csv"), made)
    ...     table = load_compensation(Path(folder, "table.csv"), unit)
    >>> added = table.at(np.zeros(1), made.correction.condition(1.0))
    >>> bool(abs(added[0] + 2e-5) < 1e-6)
    True
    """
    text, wanted = read_text(path), ratio_of(ratio)
    try:
        found = _read(text.lstrip(), wanted)
    except (LookupError, TypeError, ValueError) as problem:
        raise InputError(f"{path}: no compensation table ({problem}); give one of `rverror compensate`") from problem
    if not math.isclose(found.ratio, wanted, rel_tol=1e-6):
        raise InputError(
            f"{path}: made for a ratio of {brief(found.ratio)}, the model's is {brief(wanted)}; make a table for it"
        )
    return found


# --- writing ----------------------------------------------------------------------------------------------------------


def _points(correction: Correction, format: str, conditions: list[TableCondition], allowed: float) -> tuple[int, float]:
    """Number of points, and what they leave between them."""
    if format == "json":
        return 0, 0.0
    low, high = correction.reach or (0.0, _TURN)
    turns = (high - low) / _TURN
    points = LINUXCNC_POINTS
    if format == "csv":
        points = math.ceil(turns * max(correction.points(c, allowed) for c in conditions)) + 1
    return points, max(correction.between(round((points - 1) / turns), c) for c in conditions)


def _csv(table: CommandTable, made: Compensation, torque: float | None) -> str:
    load = "" if torque is None else f"# output_torque: {units.to_display(torque, 'torque'):g} N*m\n"
    measured = {case.condition.direction for case in made.correction.table.cases}
    load += "".join(f"# {way(sense)}: not measured, so nothing is added\n" for sense in {1.0, -1.0} - measured)
    head = (
        f"# kind: {_KIND}\n# ratio: {table.ratio!r}\n# added: {_ADDED}\n{load}"
        f"# index: {made.index}\n# turn: {'repeats' if table.periodic else 'part; the ends hold beyond'}\n{_COLUMNS}\n"
    )
    factor = math.degrees(table.ratio)
    rows = zip(np.degrees(table.angle), factor * table.forward, factor * table.reverse, strict=True)
    return head + "".join(f"{a:.9f},{f:.9f},{r:.9f}\n" for a, f, r in rows)


def _linuxcnc(table: CommandTable) -> str:
    """Triplets nominal, forward, reverse, degrees of the output: where the joint arrives at a nominal position.

    LinuxCNC adds the nominal position less the one it arrives at, and reads up to the first line that is no triplet.
    """
    angle = np.degrees(table.angle)
    rows = zip(angle, angle - np.degrees(table.forward), angle - np.degrees(table.reverse), strict=True)
    return "".join(f"{a:.9f} {f:.9f} {r:.9f}\n" for a, f, r in rows)


def correction_json(correction: Correction, index: str = "") -> dict[str, Any]:
    """Waves of a correction as plain data: what its JSON table holds."""
    return {
        "kind": _KIND,
        "ratio": correction.ratio,
        "added": _SUM,
        "index": index,
        "reach_deg": None if correction.reach is None else [math.degrees(end) for end in correction.reach],
        "conditions": [
            {
                "direction": way(case.condition.direction),
                **{
                    name: None if (v := getattr(case.condition, field)) is None else units.to_display(v, dimension)
                    for field, (name, dimension) in _CONDITION.items()
                },
                "waves": [
                    {"order": k, "cos_arcsec": z.real / ARCSEC, "sin_arcsec": -z.imag / ARCSEC}
                    for k, z in zip(case.orders.tolist(), case.waves.tolist(), strict=True)
                ],
            }
            for case in correction.table.cases
        ],
    }


# --- reading ----------------------------------------------------------------------------------------------------------


def _read(text: str, ratio: float) -> Correction | CommandTable:
    """Table of a text; a LinuxCNC table has the ratio that is given, and says where the joint arrives."""
    if text.startswith("{"):
        return _from_json(json.loads(text))
    if text.startswith("#"):
        return _from_csv(split_lines(text))
    angle, forward, reverse = _triplets(split_lines(text), None)
    return CommandTable(ratio, angle, angle - forward, angle - reverse)


def _from_json(data: Mapping[str, Any]) -> Correction:
    _check_kind(data["kind"])
    low, high = data["reach_deg"] or (None, None)
    return Correction(
        float(data["ratio"]),
        OrderTable(cases=tuple(map(_case, data["conditions"])), index=data["index"]),
        None if low is None or high is None else (math.radians(low), math.radians(high)),
    )


def _check_kind(kind: str) -> None:
    if kind != _KIND:
        raise ValueError(f"it is of kind {shown(kind)}")


def _case(entry: Mapping[str, Any]) -> OrderCase:
    known = {
        field: units.parse(f"{entry[name]!r} {units.DISPLAY_UNITS[dimension]}", dimension)
        for field, (name, dimension) in _CONDITION.items()
        if entry[name] is not None
    }
    waves = entry["waves"]
    return OrderCase(
        condition=TableCondition(direction=DIRECTIONS[entry["direction"]], **known),
        orders=np.array([float(w["order"]) for w in waves]),
        waves=np.array([complex(w["cos_arcsec"], -w["sin_arcsec"]) for w in waves], dtype=np.complex128) * ARCSEC,
    )


def _from_csv(lines: list[str]) -> CommandTable:
    stated = (line[1:].partition(":") for line in lines if line.startswith("#"))
    head = {key.strip(): value.strip() for key, _, value in stated}
    _check_kind(head["kind"])
    body = [line for line in lines if not line.startswith("#")]
    if body[0] != _COLUMNS:
        raise ValueError(f"its columns are not {_COLUMNS}")
    ratio = float(head["ratio"])
    angle, forward, reverse = _triplets(body[1:], ",")
    return CommandTable(ratio, angle, forward / ratio, reverse / ratio)


def _triplets(lines: list[str], delimiter: str | None) -> Array:
    """Angle, forward and reverse of rows in degrees, rad."""
    rows = np.array([line.split(delimiter) for line in lines if line.strip()], dtype=np.float64)
    if len(rows) < 2 or rows.shape[1] != 3 or not np.isfinite(rows).all() or np.any(np.diff(rows[:, 0]) <= 0):
        raise ValueError("it takes two or more rows of angle, forward, reverse, all finite, with growing angles")
    return np.radians(rows).T


def table_sentences(table: WrittenTable) -> list[str]:
    """What the form of a table costs, in lines."""
    load = "" if table.torque is None else f" at {units.to_display(table.torque, 'torque'):g} N*m"
    lines = []
    if table.points:
        lines.append(
            f"Table{load}, {table.points} points: linear interpolation leaves {brief(table.between / ARCSEC, 2)} "
            f"arcsec rms; {brief(table.expected / ARCSEC, 3)} arcsec rms are expected with the table."
        )
    lines.append(
        f"If the zero is off by 1 deg, {brief(table.slipped / ARCSEC, 3)} arcsec rms remain of the "
        f"{brief(table.waves / ARCSEC, 3)} that the table removes."
    )
    if table.left_out:
        lines.append(f"A {table.format} table cannot hold orders {', '.join(map(brief, table.left_out))}: they remain.")
    return lines
