"""Tables as controllers take them, written and read back: CSV, Fourier coefficients as JSON, LinuxCNC."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.directions import DIRECTIONS
from rverror.base.errors import InputError
from rverror.base.numbers import brief, way
from rverror.base.text import PathLike, read_text, shown, split_lines, write_text
from rverror.base.units import ARCSEC
from rverror.compensation.correction import Correction, only
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
    periodic : bool
        Whether it spans a turn and repeats; else the ends hold beyond.
    """

    ratio: float
    angle: Array
    forward: Array
    reverse: Array
    periodic: bool

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
    of_itself : float
        What is left of waves that are summed at the command and not where the input then stands, at most, rad; none of
        points, which are solved for that.
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
    of_itself: float
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
    correction, left_out = held_by(made.correction, format)
    if not correction.orders.size:
        raise InputError(f"{path}: the {format} table can hold none of the orders; use json, which holds any")
    forward, reverse = (correction.condition(sense, load) for sense in (1.0, -1.0))
    points, between = _points(correction, format, [forward, reverse], _BETWEEN * made.after.rms)
    if format == "json":
        text = json.dumps(correction_json(made.correction, made.index), indent=1) + "\n"
    else:
        table = by_points(correction, forward.torque, points)
        text = _csv(table, made, forward.torque) if format == "csv" else _linuxcnc(table)
    write_text(path, text, overwrite=overwrite)
    sizes = [correction.rms(c) for c in (forward, reverse)]
    worse = forward if sizes[0] >= sizes[1] else reverse
    rest = replace(made.correction, table=_orders_of(made.correction.table, left_out))
    lost = max(rest.rms(c) for c in (forward, reverse))
    return WrittenTable(
        format=format,
        torque=None if format == "json" else forward.torque,
        points=points,
        expected=math.sqrt(made.after.rms**2 + between**2 + lost**2),
        between=between,
        slipped=correction.slipped(math.radians(1), worse),
        waves=max(sizes),
        of_itself=0.0 if points else max(correction.of_itself(c) for c in (forward, reverse)),
        left_out=left_out,
    )


def held_by(correction: Correction, format: str) -> tuple[Correction, tuple[float, ...]]:
    """The part of a correction that a format can hold, and the orders that it cannot.

    Parameters
    ----------
    correction : Correction
    format : str

    Notes
    -----
    A table by points over a turn has whole orders only; LinuxCNC's 256 points have no more than 63 orders of a turn.
    """
    held = correction
    if format != "json" and correction.reach is None:
        cases = tuple(only(case, case.orders == np.round(case.orders)) for case in held.table.cases)
        held = replace(held, table=replace(held.table, cases=cases))
    if format == "linuxcnc":
        span = _TURN if held.reach is None else held.reach[1] - held.reach[0]
        held = held.limited(math.floor((LINUXCNC_POINTS - 1) * _TURN / span))
    return held, tuple(np.setdiff1d(correction.orders, held.orders).tolist())


def _orders_of(table: OrderTable, orders: tuple[float, ...]) -> OrderTable:
    return replace(table, cases=tuple(only(case, np.isin(case.orders, orders)) for case in table.cases))


def by_points(correction: Correction, torque: float | None, points: int) -> CommandTable:
    """A correction at one load by even points from end to end of its reach, or of a turn."""
    low, high = correction.reach or (0.0, _TURN)
    angle = np.linspace(low, high, points)
    forward, reverse = (correction.settled(angle, correction.condition(sense, torque)) for sense in (1.0, -1.0))
    return CommandTable(correction.ratio, angle, forward, reverse, correction.reach is None)


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
    if text.lstrip().startswith("{"):
        found = _from_json(str(path), text)
        found.check_ratio(wanted, str(path))
        return found
    if text.lstrip().startswith("#"):
        table = _from_csv(str(path), text)
        if not math.isclose(table.ratio, wanted, rel_tol=1e-6):
            Correction(table.ratio, OrderTable(cases=())).check_ratio(wanted, str(path))
        return table
    rows = [_numbers(str(path), n, line.split()) for n, line in enumerate(split_lines(text), 1) if line.strip()]
    return _table(str(path), wanted, rows, difference=True)


# --- writing ----------------------------------------------------------------------------------------------------------


def _points(correction: Correction, format: str, conditions: list[TableCondition], allowed: float) -> tuple[int, float]:
    """Number of points, and what they leave between them."""
    if format == "json":
        return 0, 0.0
    low, high = correction.reach or (0.0, _TURN)
    turns = (high - low) / _TURN
    if format == "linuxcnc":
        points = LINUXCNC_POINTS
    else:
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


def _from_json(path: str, text: str) -> Correction:
    try:
        data = json.loads(text)
        if data["kind"] != _KIND:
            raise ValueError(f"kind is {data['kind']!r}")
        cases = tuple(_case(entry) for entry in data["conditions"])
        reach = data["reach_deg"]
        return Correction(
            float(data["ratio"]),
            OrderTable(path=path, cases=cases, index=data["index"]),
            None if reach is None else (math.radians(reach[0]), math.radians(reach[1])),
        )
    except (ValueError, KeyError, TypeError, IndexError) as problem:
        raise InputError(f"{path}: no compensation table ({problem}); give one of `rverror compensate`") from problem


def _case(entry: Mapping[str, Any]) -> OrderCase:
    known = {
        field: None
        if entry[name] is None
        else units.parse(f"{entry[name]!r} {units.DISPLAY_UNITS[dimension]}", dimension)
        for field, (name, dimension) in _CONDITION.items()
    }
    waves = entry["waves"]
    return OrderCase(
        condition=TableCondition(direction=DIRECTIONS[entry["direction"]], **known),
        orders=np.array([float(w["order"]) for w in waves]),
        waves=np.array([complex(w["cos_arcsec"], -w["sin_arcsec"]) for w in waves], dtype=np.complex128) * ARCSEC,
    )


def _from_csv(path: str, text: str) -> CommandTable:
    lines = split_lines(text)
    stated = (line[1:].partition(":") for line in lines if line.startswith("#"))
    head = {key.strip(): value.strip() for key, _, value in stated}
    body = [(n, line) for n, line in enumerate(lines, 1) if line.strip() and not line.startswith("#")]
    if head.get("kind") != _KIND or not body or body[0][1].strip() != _COLUMNS:
        raise InputError(f"{path}: no compensation table; its header says '# kind: {_KIND}' and then {_COLUMNS}")
    ratio = _numbers(path, 2, [head.get("ratio", "")])[0]
    rows = [_numbers(path, n, line.split(",")) for n, line in body[1:]]
    return _table(path, ratio, rows, difference=False)


def _table(path: str, ratio: float, rows: list[list[float]], *, difference: bool) -> CommandTable:
    """Table of rows in degrees: positions of the output, or what is added to the input."""
    if len(rows) < 2 or any(len(row) != 3 for row in rows) or any(b[0] <= a[0] for a, b in pairwise(rows)):
        raise InputError(
            f"{path}: no compensation table; two or more rows of angle, forward, reverse with growing angles are needed"
        )
    angle, forward, reverse = np.radians(rows).T
    forward, reverse = (angle - one if difference else one / ratio for one in (forward, reverse))
    periodic = math.isclose(angle[-1] - angle[0], _TURN, abs_tol=1e-6)
    return CommandTable(ratio, angle, forward, reverse, periodic)


def _numbers(path: str, line: int, cells: list[str]) -> list[float]:
    try:
        found = [float(cell) for cell in cells]
    except ValueError as problem:
        raise InputError(f"{path}: line {line}: {shown(' '.join(cells))} is no row of numbers") from problem
    if not all(map(math.isfinite, found)):
        raise InputError(f"{path}: line {line}: a number is not finite; write the table again")
    return found


def table_told(table: WrittenTable) -> list[str]:
    """What the form of a table costs, in lines."""
    load = "" if table.torque is None else f" at {units.to_display(table.torque, 'torque'):g} N*m"
    told = []
    if table.points:
        told.append(
            f"table{load} of {table.points} points: straight lines between them leave "
            f"{brief(table.between / ARCSEC, 2)} arcsec rms; {brief(table.expected / ARCSEC, 3)} are expected with it"
        )
    if table.of_itself:
        told.append(
            f"summed at the command and not where the input then stands, the waves leave "
            f"{brief(table.of_itself / ARCSEC, 2)} arcsec at most"
        )
    told.append(
        f"a zero that slips by 1 deg leaves {brief(table.slipped / ARCSEC, 3)} arcsec rms of the "
        f"{brief(table.waves / ARCSEC, 3)} that the table takes off"
    )
    if table.left_out:
        told.append(f"orders {', '.join(map(brief, table.left_out))} stay: a {table.format} table cannot hold them")
    return told
