"""Results as pandas DataFrames and xarray Datasets, units and origin kept in their attributes.

Each kind of result is described once, as variables along named dimensions; a Dataset holds them all, a DataFrame those
along one dimension.  pandas and xarray come with the extra ``tables``.
"""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import itertools
import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import singledispatch
from typing import TYPE_CHECKING, Any

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.base.numbers import way
from rverror.base.text import describe
from rverror.base.units import ARCSEC
from rverror.base.version import __version__
from rverror.diagnosis.result import Diagnosis
from rverror.geartrain.mechanism import DIMENSIONS, Drive, Reducer
from rverror.model.catalogue import source
from rverror.model.compose import Influence, transmission_error_by_effect
from rverror.model.effects import Effect, Model
from rverror.runs.measurement import Run
from rverror.statics.loaded_state import Equilibrium
from rverror.statics.rigidity import TorsionCurve
from rverror.tolerances.allocation import Allocation, FrontPoint, Verification
from rverror.tolerances.closed_form import Budget
from rverror.tolerances.control_variate import LEVELS, SIZES, ContactCorrection
from rverror.tolerances.full_budget import ErrorBudget
from rverror.tolerances.sampling import VirtualUnits
from rverror.tolerances.stacking import Stack, Tolerance

if TYPE_CHECKING:
    from pandas import DataFrame
    from xarray import Dataset


@dataclass(frozen=True)
class Unit:
    """Core unit, unit for people, both in pint's notation, and how many of the first make one of the second."""

    core: str
    shown: str
    size: float = 1.0


NUMBER = Unit("dimensionless", "dimensionless")
POSITION = Unit("rad", "deg", math.radians(1))
ANGLE = Unit("rad", "arcsec", ARCSEC)
SQUARE = Unit("rad**2", "arcsec**2", ARCSEC**2)
LENGTH = Unit("mm", "um", 1e-3)
SIZE = Unit("mm", "mm")
TORQUE = Unit("N*mm", "N*m", 1e3)
FORCE = Unit("N", "N")
STIFFNESS = Unit("N/mm", "N/mm")
TIME = Unit("s", "s")
TEMPERATURE = Unit("kelvin", "kelvin")
PER_ARCSEC = Unit("1/arcsec", "1/arcsec")

#: Dimensions that are too long to stand side by side as columns.
LONG = frozenset({"theta", "sample", "virtual_unit"})

_SIGNAL = {"angle": ANGLE, "torque": TORQUE}
_GEOMETRY = {"length": SIZE, "angle": POSITION, "torque": TORQUE}
_CONTACTS = {
    "pin": ("disc", "pin", "xy"),
    "cam": ("disc", "crank", "xy"),
    "carrier": ("crank", "xy"),
    "mesh": ("crank", "flank", "xy"),
}
_STAGES = ("declared", "refitted", "after")


@dataclass(frozen=True)
class Each:
    """Units of a variable whose rows have units of their own, and the variable that tells them."""

    name: str
    units: tuple[Unit, ...]


@dataclass(frozen=True)
class Variable:
    """Values along named dimensions.

    Attributes
    ----------
    dims : tuple of str
    values : array_like
        Core units.
    unit : Unit or Each, optional
        None for text; the rows of an `Each` are the first dimension.
    bare : bool
        Whether a column that it makes is named by its place alone.
    """

    dims: tuple[str, ...]
    values: Any
    unit: Unit | Each | None = None
    bare: bool = False

    def shown(self, *, display: bool) -> Any:
        """Values in core units, or in those for people."""
        values = np.array(self.values)
        if self.unit is None:
            return values if values.size else values.astype(str)
        if not display:
            return values
        if isinstance(self.unit, Unit):
            return values if self.unit.size == 1 else values / self.unit.size
        sizes = np.array([unit.size for unit in self.unit.units])
        return values / sizes.reshape(-1, *[1] * (values.ndim - 1))

    def spreads(self, rows: str) -> bool:
        """Whether it makes columns along one of its dimensions: not too many of them."""
        return rows in self.dims and not LONG & set(self.dims) - {rows}

    def units_shown(self) -> str | list[str]:
        """Unit for people: one, or one a row where these differ; empty for text."""
        if isinstance(self.unit, Each):
            return _texts(self.unit, display=True)
        return self.unit_text(display=True)

    def unit_text(self, row: Any = None, *, display: bool) -> str:
        """Unit of all values, or of one row; empty for text, and where rows differ."""
        unit = self.unit
        if isinstance(unit, Each):
            unit = unit.units[row] if isinstance(row, int) else None
        return _text(unit, display=display) if unit else ""


@dataclass(frozen=True)
class Table:
    """What a result holds.

    Attributes
    ----------
    kind : str
    rows : str
        Dimension of the rows of its DataFrame.
    variables : mapping of str to Variable
        By name; one that has the name of a dimension labels it.
    about : mapping of str to str, number or mapping
        Where it comes from.
    labels : frozenset of str
        Variables that tell where values belong: coordinates.
    """

    kind: str
    rows: str
    variables: Mapping[str, Variable]
    about: Mapping[str, Any] = field(default_factory=dict)
    labels: frozenset[str] = frozenset()

    @property
    def dims(self) -> tuple[str, ...]:
        """Every dimension that can be the rows of a table."""
        found = (dim for variable in self.variables.values() for dim in variable.dims if variable.spreads(dim))
        return tuple(dict.fromkeys(found))


def to_pandas(result: Any, *, rows: str = "", display: bool = False, **options: Any) -> DataFrame:
    """Result as a DataFrame.

    Parameters
    ----------
    result
        A Run, Model, Effect, Reducer, Drive, Influence, Equilibrium, TorsionCurve, Diagnosis, Tolerance, Stack, Budget,
        ErrorBudget, VirtualUnits or Allocation; or a list or tuple of Effect, Tolerance or FrontPoint.
    rows : str, optional
        What a row is: a dimension of the Dataset.  Where left out: the sample of a run, the angle of an
        equilibrium or influence, the parameter of a model, what a diagnosis added, the tolerance of a budget or
        allocation.  A diagnosis has the rows ``added``, ``stage`` (before and after), ``unexplained``, ``candidate``,
        ``run`` and ``sample`` (waveforms), a budget ``tolerance`` and ``theta``.
    display : bool
        Whether values are in the units in which people read them (arcsec, um, N*m; positions in deg) in place of core
        units (rad, mm, N*mm).
    **options
        As for `to_xarray`.

    Returns
    -------
    DataFrame
        Names of columns hold no unit.  ``attrs["units"]`` has that of each numeric column in pint's notation; where
        the rows have units of their own, the column ``unit`` tells them.  Other attrs: the kind of the result, the
        version of rverror, and what has one value for all rows.

    Raises
    ------
    InputError
        If pandas is not installed, no table is made of such a result, or an option is not one of its.

    Notes
    -----
    A variable of several dimensions becomes several columns, named by the places along the others:
    ``pin_force_0_12_x``.  What has no value along the rows stands in another table of the same result.

    pandas drops attrs in some operations, and in files: before writing text, put the units into the names as a run
    file has them, ``frame.rename(columns=lambda name: f"{name}[{units[name]}]" if name in units else name)``.

    Examples
    --------
    >>> import numpy as np, rverror
    >>> angle = np.linspace(0, 6, 100)
    >>> run = rverror.run_from_arrays(input_angle=121 * angle, output_angle=angle, torque="20 N*m")
    >>> frame = rverror.to_pandas(run)
    >>> list(frame.columns), frame.attrs["units"]["output_angle"], frame.attrs["torque"]
    (['input_angle', 'output_angle', 'direction'], 'rad', 20000.0)

    And back:

    >>> angles = {name: frame[name] for name in ("input_angle", "output_angle")}
    >>> again = rverror.run_from_arrays(**angles, torque=frame.attrs["torque"])
    >>> bool((again.output_angle == run.output_angle).all())
    True
    """
    pandas = _library("pandas")
    table = described(result, **options)
    found, told = columns(table, rows=rows, display=display)
    frame: DataFrame = pandas.DataFrame(found)
    about: dict[str, Any] = {"kind": table.kind, "rverror": __version__, **table.about}
    for name, variable in table.variables.items():
        if not variable.dims:
            about[name] = variable.shown(display=display).item()
            told[name] = variable.unit_text(display=display)
    frame.attrs.update(about | {"units": {name: unit for name, unit in told.items() if unit}})
    return frame


def to_xarray(result: Any, *, display: bool = False, **options: Any) -> Dataset:
    """Result as a Dataset.

    Parameters
    ----------
    result
        As for `to_pandas`.
    display : bool
        As for `to_pandas`.
    **options
        What a result does not hold itself.

        - Run: `ratio` (Reducer, Drive, Model or float), for ``theta`` and ``transmission_error``.
        - Model: `theta`, at which the transmission error is computed by effect in closed form, with `direction`,
          `torque` and `time` as `transmission_error` takes them.
        - Equilibrium: `torque` and `model`.
        - TorsionCurve: `theta`.
        - Allocation: `stack`, to check that it is its own.

    Returns
    -------
    Dataset
        Every variable of numbers has its unit in ``attrs["units"]``, in pint's notation; where rows have units of
        their own, a coordinate whose name ends in ``unit`` tells them.  ``attrs`` of the Dataset: the kind of the
        result, the version of rverror, and what else is known of its origin.

    Raises
    ------
    InputError
        If xarray is not installed, no table is made of such a result, or an option is not one of its.

    Notes
    -----
    It can be written by ``to_netcdf``, also with scipy alone, and comes back the same.

    Examples
    --------
    >>> import rverror
    >>> unit = rverror.Model(rverror.reducer("RV-40E"))
    >>> theta = [0.0, 0.1]
    >>> state = rverror.equilibrium(unit, theta, torque="412 N*m")
    >>> found = rverror.to_xarray(state, torque="412 N*m", model=unit)
    >>> found["pin_force"].dims, found["pin_force"].attrs["units"], found.attrs["model"]
    (('disc', 'pin', 'xy', 'theta'), 'N', 'RV-40E')
    """
    xarray = _library("xarray")
    table = described(result, **options)
    data: dict[str, Any] = {}
    coordinates: dict[str, Any] = {}
    for name, variable in table.variables.items():
        values = variable.shown(display=display)
        unit = variable.unit_text(display=display)
        if values.dtype.kind in "OU":
            values = np.array([_writable(text) for text in values.ravel()], dtype=str).reshape(values.shape)
        place = coordinates if name in table.labels or name in variable.dims else data
        place[name] = (variable.dims, values, {"units": unit} if unit else {})
        if isinstance(variable.unit, Each):
            coordinates[variable.unit.name] = (
                variable.dims[:1],
                np.array(_texts(variable.unit, display=display), dtype=str),
            )
    about = {"kind": table.kind, "rverror": __version__, **table.about}
    found: Dataset = xarray.Dataset(data, coordinates, {name: _attribute(value) for name, value in about.items()})
    return found


def _library(name: str) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise InputError(f"tables need {name}; install it with: pip install 'rverror[tables]'") from error


def described(result: Any, /, **options: Any) -> Table:
    """Description of a result, from which every kind of table is made.

    Parameters
    ----------
    result, **options
        As for `to_xarray`.

    Returns
    -------
    Table

    Raises
    ------
    InputError
        If no table is made of such a result, or an option is not one of its.
    """
    known = list(inspect.signature(_table.dispatch(type(result))).parameters)[1:]
    for name in options:
        if name not in known:
            takes = f"it takes {', '.join(known)}" if known else "it takes none"
            raise InputError(f"{type(result).__name__}: no option {name!r}; {takes}")
    return _table(result, **options)


def columns(table: Table, *, rows: str = "", display: bool = False) -> tuple[dict[str, Any], dict[str, str]]:
    """Variables along one dimension as columns.

    Parameters
    ----------
    table : Table
    rows, display
        As for `to_pandas`.

    Returns
    -------
    columns, units : dict
        Arrays, and the unit of each; empty for text and where the rows have units of their own.

    Raises
    ------
    InputError
        If there is no such dimension, or two columns would have one name.
    """
    chosen = rows or table.rows
    if chosen not in table.dims:
        raise InputError(f"rows = {rows!r}: a {table.kind} has no such rows; give one of {', '.join(table.dims)}")
    found: dict[str, Any] = {}
    told: dict[str, str] = {}
    for name, variable in table.variables.items():
        if not variable.spreads(chosen):
            continue
        values = variable.shown(display=display)
        for column, place in _places(table, name, chosen):
            if column in found:
                raise InputError(f"{table.kind}: two columns have the name {column!r}; rename one, or use to_xarray")
            found[column], told[column] = values[place], variable.unit_text(place[0], display=display)
        if isinstance(variable.unit, Each) and variable.dims[0] == chosen:
            found[variable.unit.name.removeprefix(f"{chosen}_")] = _texts(variable.unit, display=display)
    return found, told


def _places(table: Table, name: str, rows: str) -> Iterator[tuple[str, tuple[Any, ...]]]:
    """Name and place of each column that a variable makes."""
    variable = table.variables[name]
    short = [] if variable.bare else [name.removeprefix(f"{rows}_")]
    shape = np.shape(variable.values)
    others = [(dim, size) for dim, size in zip(variable.dims, shape, strict=True) if dim != rows]
    for chosen in itertools.product(*(range(size) for _, size in others)):
        at = iter(chosen)
        place = tuple(slice(None) if dim == rows else next(at) for dim in variable.dims)
        words = [str(_label(table, dim, i)) for (dim, _), i in zip(others, chosen, strict=True)]
        yield "_".join([*short, *words]), place


def _label(table: Table, dim: str, at: int) -> Any:
    return np.asarray(table.variables[dim].values)[at] if dim in table.variables else at


def _text(unit: Unit, *, display: bool) -> str:
    return unit.shown if display else unit.core


def _texts(each: Each, *, display: bool) -> list[str]:
    return [_text(unit, display=display) for unit in each.units]


def _writable(text: Any) -> str:
    """Text that a file in UTF-8 can hold."""
    return str(text).encode("utf-8", "backslashreplace").decode("utf-8")


def _attribute(value: Any) -> Any:
    """Attribute that a netCDF file can hold: a number or a text."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, float, str)):
        value = json.dumps(value, ensure_ascii=False)
    return _writable(value) if isinstance(value, str) else value


def _of_dimension(dimension: str) -> Unit:
    """Unit of an error of that dimension, a key of `units.CORE_UNITS`."""
    shown = units.DISPLAY_UNITS[dimension]
    return Unit(units.CORE_UNITS[dimension], shown, units.unit_factor(shown, dimension))


def _per(unit: Unit) -> Unit:
    """Unit of the output error per unit of a parameter."""
    core, shown = (f"({text})" if "/" in text or "*" in text else text for text in (unit.core, unit.shown))
    return Unit(f"rad/{core}", f"arcsec/{shown}", ARCSEC / unit.size)


def _inside(indices: Mapping[str, Any]) -> str:
    return ", ".join(f"{name} {value}" for name, value in indices.items())


def _name(model: Model) -> str:
    return model.name or model.mechanism.name


def _along(dim: str, prefix: str = "", /, **columns: Any) -> dict[str, Variable]:
    """Variables along one dimension; each is values, or values with their unit."""
    return {
        f"{prefix}{name}": Variable((dim,), *(given if isinstance(given, tuple) else (given, None)))
        for name, given in columns.items()
    }


def _single(**values: tuple[Any, Unit]) -> dict[str, Variable]:
    """Variables of one value; those that are None are left out."""
    return {name: Variable((), value, unit) for name, (value, unit) in values.items() if value is not None}


def _angles(theta: Any | None, count: int, *, dim: str = "theta") -> dict[str, Variable]:
    """Nominal output angles of a result that does not hold them itself."""
    if theta is None:
        return {}
    try:
        row = units.to_core_array(theta, "angle")
    except ValueError as error:
        raise InputError(f"theta: {error}") from error
    if row.shape != (count,):
        raise InputError(f"theta has the shape {row.shape}; give the {count} angles that the result was made for")
    return {"theta": Variable((dim,), row, POSITION)}


# --- one entry a kind -------------------------------------------------------------------------------------------------


@singledispatch
def _table(result: Any) -> Table:
    """Description of a result."""
    kinds = sorted(kind.__name__ for kind in _table.registry if kind is not object)
    raise InputError(f"{type(result).__name__}: no table is made of it; give one of {', '.join(kinds)}")


@_table.register
def _of_run(result: Run, *, ratio: Reducer | Drive | Model | float | None = None) -> Table:
    given = {
        "time": (result.time, TIME),
        "input_angle": (result.input_angle, POSITION),
        "output_angle": (result.output_angle, POSITION),
        "te": (result.te_column, ANGLE),
        "direction": (result.direction, NUMBER),
    }
    variables = _along("sample", **{name: pair for name, pair in given.items() if pair[0] is not None})
    if ratio is not None:
        variables |= _along(
            "sample",
            theta=(result.nominal_angle(ratio), POSITION),
            transmission_error=(result.error(ratio), ANGLE),
        )
    if result.extra:
        tags = tuple(Unit(unit, unit) for unit in map(_bracket, result.extra))
        variables |= _along("column", column=list(result.extra))
        extra = np.array(list(result.extra.values()))
        variables["extra"] = Variable(("column", "sample"), extra, Each("column_unit", tags), bare=True)
    variables |= _single(torque=(result.torque, TORQUE), temperature=(result.temperature, TEMPERATURE))
    about = {
        "path": result.path,
        "direction": _senses(result.direction),
        "index": result.index,
        "metadata": dict(result.metadata),
        "notes": "\n".join(result.notes),
    }
    return Table("Run", "sample", variables, about, frozenset({"theta", "time"}))


def _senses(direction: Array) -> str:
    return {(1.0,): "forward", (-1.0,): "reverse"}.get(tuple(set(direction.tolist())), "mixed")


def _bracket(name: str) -> str:
    """Unit that a column's name ends with."""
    return name[name.rindex("[") + 1 : -1] if name.endswith("]") and "[" in name else ""


@_table.register
def _of_reducer(result: Reducer) -> Table:
    rows: list[tuple[str, float, Unit]] = []
    for item in dataclasses.fields(result):
        value = getattr(result, item.name)
        if item.name in ("name", "stiffness") or value is None:
            continue
        rows.append((item.name, value, _GEOMETRY[DIMENSIONS[item.name]] if item.name in DIMENSIONS else NUMBER))
    springs = dataclasses.asdict(result.stiffness)
    rows += [(f"stiffness.{name}", value, STIFFNESS) for name, value in springs.items()]
    return Table("Reducer", "parameter", _named_values(rows), {"name": result.name, "ratio": result.ratio})


@_table.register
def _of_drive(result: Drive) -> Table:
    rows = [("ratio", result.ratio, NUMBER), *((f"shafts.{n}", turns, NUMBER) for n, turns in result.shafts.items())]
    return Table("Drive", "parameter", _named_values(rows), {"name": result.name, "ratio": result.ratio})


def _named_values(rows: Sequence[tuple[str, float, Unit]]) -> dict[str, Variable]:
    names, values, own = zip(*rows, strict=True)
    return _along("parameter", parameter=list(names), value=(np.array(values, dtype=float), Each("unit", own)))


@_table.register
def _of_effect(result: Effect) -> Table:
    return Table("Effect", "parameter", _sizes([result]))


@_table.register
def _of_model(
    result: Model,
    *,
    theta: Any | None = None,
    direction: Any | None = None,
    torque: Any | None = None,
    time: Any = None,
) -> Table:
    variables = _sizes(result.effects)
    if theta is not None:
        parts = transmission_error_by_effect(result, theta, direction=direction, torque=torque, time=time)
        variables |= _angles(theta, parts.shape[1])
        variables |= _along("effect", effect=[describe(e.key, e.indices) for e in result.effects])
        variables["transmission_error"] = Variable(("theta",), parts.sum(axis=0), ANGLE)
        variables["by_effect"] = Variable(("effect", "theta"), parts, ANGLE)
        variables |= _load(torque)
    return Table("Model", "parameter", variables, {"model": _name(result), "mechanism": result.mechanism.name})


def _load(torque: Any | None) -> dict[str, Variable]:
    try:
        return _single(torque=(None if torque is None else units.to_core(torque, "torque"), TORQUE))
    except ValueError as error:
        raise InputError(f"torque: {error}") from error


def _sizes(effects: Sequence[Effect]) -> dict[str, Variable]:
    """Every parameter of every effect."""
    rows = [
        (at, effect, parameter, value)
        for at, effect in enumerate(effects)
        for parameter, value in zip(source(effect.key).parameters, effect.values, strict=True)
    ]
    own = Each("unit", tuple(_of_dimension(parameter.dimension) for *_, parameter, _ in rows))
    spread = [math.nan if effect.uncertainty is None else effect.uncertainty for _, effect, *_ in rows]
    return _along(
        "parameter",
        number=(np.array([at for at, *_ in rows], dtype=int), NUMBER),
        key=[effect.key for _, effect, *_ in rows],
        indices=[_inside(effect.indices) for _, effect, *_ in rows],
        parameter=[parameter.name for *_, parameter, _ in rows],
        value=(np.array([value for *_, value in rows], dtype=float), own),
        uncertainty=(np.array(spread, dtype=float), own),
        origin=[effect.origin for _, effect, *_ in rows],
    )


@_table.register
def _of_influence(result: Influence) -> Table:
    dimensions = [_of_dimension(parameter.dimension) for parameter in source(result.key).parameters]
    variables = {
        "theta": Variable(("theta",), result.theta, POSITION),
        **_along("parameter", parameter=list(result.labels)),
        "influence": Variable(
            ("parameter", "theta"), result.matrix, Each("influence_unit", tuple(map(_per, dimensions))), bare=True
        ),
    }
    return Table("Influence", "theta", variables, {"key": result.key})


@_table.register
def _of_equilibrium(result: Equilibrium, *, torque: Any | None = None, model: Model | None = None) -> Table:
    variables = {
        "theta": Variable(("theta",), result.theta, POSITION),
        **_along(
            "theta",
            transmission_error=(result.transmission_error, ANGLE),
            steps=(result.steps, NUMBER),
            residual=(result.residual, NUMBER),
        ),
        "loaded_pins": Variable(("disc", "theta"), result.loaded_pins, NUMBER),
    }
    for part, moved in result.pose.items():
        own = ("disc",) if part == "disc" else ("crank",) if part == "crank" else ()
        variables[f"{part}_displacement"] = Variable((*own, "xy", "theta"), moved[..., :2, :], LENGTH)
        if moved.shape[-2] == 3:
            variables[f"{part}_rotation"] = Variable((*own, "theta"), moved[..., 2, :], ANGLE)
    for contact, axes in _CONTACTS.items():
        variables[f"{contact}_force"] = Variable((*axes, "theta"), result.contact_forces[contact], FORCE)
    spline = result.contact_forces["spline"][:, :, 0]
    variables["spline_torque"] = Variable(("crank", "flank", "theta"), spline, TORQUE)
    variables |= _along("xy", xy=["x", "y"]) | _load(torque)
    return Table("Equilibrium", "theta", variables, {} if model is None else {"model": _name(model)})


@_table.register
def _of_torsion(result: TorsionCurve, *, theta: Any | None = None) -> Table:
    variables = {
        **_along("torque", torque=(result.torque, TORQUE)),
        **_angles(theta, result.angle.shape[1], dim="place"),
        "angle": Variable(("torque", "place"), result.angle, ANGLE),
    }
    return Table("TorsionCurve", "torque", variables, {}, frozenset({"theta"}))


@_table.register
def _of_diagnosis(result: Diagnosis) -> Table:
    signal = _SIGNAL[result.quantity]
    residuals = (result.before, result.before_refitted, result.after)
    sizes = {
        name: (np.array([getattr(residual, name) for residual in residuals]), signal)
        for name in ("rms", "peak_to_peak", "heldout_rms")
    }
    variables = {
        **_added(result, signal),
        **_along("stage", stage=list(_STAGES), **sizes),
        **_single(noise_rms=(result.noise_rms, signal)),
        **_unexplained(result, signal),
        **_candidates(result),
        **_traces(result, signal),
    }
    about = {
        "model": _name(result.declared),
        "verdict": result.verdict,
        "quantity": result.quantity,
        "candidates_tried": result.tried,
        "notes": "\n".join(result.notes),
    }
    return Table("Diagnosis", "added", variables, about, frozenset({"sample_run", "sample_theta"}))


def _added(result: Diagnosis, signal: Unit) -> dict[str, Variable]:
    rows = [(at, added, size) for at, added in enumerate(result.added) for size in added.estimates]
    own = Each("added_unit", tuple(_of_dimension(size.dimension) for *_, size in rows))
    alike = ["; ".join(describe(key, indices) for key, indices in added.indistinguishable) for _, added, _ in rows]
    sizes = {name: (_floats(getattr(size, name) for *_, size in rows), own) for name in ("value", "low", "high")}
    return _along(
        "added",
        "added_",
        number=(np.array([at for at, *_ in rows], dtype=int), NUMBER),
        key=[added.effect.key for _, added, _ in rows],
        indices=[_inside(added.effect.indices) for _, added, _ in rows],
        parameter=[size.name for *_, size in rows],
        **sizes,
        orders=[", ".join(f"{order:g}" for order in added.orders) for _, added, _ in rows],
        heldout_rms=(_floats(added.heldout_rms for _, added, _ in rows), signal),
        indistinguishable_from=alike,
        notes=["\n".join(added.notes) for _, added, _ in rows],
    )


def _unexplained(result: Diagnosis, signal: Unit) -> dict[str, Variable]:
    lines = result.unexplained
    sizes = {
        name: (_floats(getattr(line, name) for line in lines), signal)
        for name in ("amplitude", "low", "high", "cos", "sin")
    }
    frames = ["; ".join(line.frames) for line in lines]
    order = (_floats(line.order for line in lines), NUMBER)
    return _along("unexplained", "unexplained_", order=order, **sizes, frames=frames)


def _candidates(result: Diagnosis) -> dict[str, Variable]:
    found = result.candidates
    return _along(
        "candidate",
        "candidate_",
        key=[candidate.key for candidate in found],
        indices=[_inside(candidate.indices) for candidate in found],
        heldout_gain=(_floats(candidate.heldout_gain for candidate in found), NUMBER),
    )


def _traces(result: Diagnosis, signal: Unit) -> dict[str, Variable]:
    """Waveforms of all runs one after another, for each has angles of its own."""
    traces = result.traces
    waves = {
        "measured": [trace.measured for trace in traces],
        "before": [trace.before for trace in traces],
        "after": [trace.after for trace in traces],
        "residual_before": [trace.residual[0] for trace in traces],
        "residual_after": [trace.residual[1] for trace in traces],
    }
    counts = [trace.theta.size for trace in traces]
    return {
        **_along(
            "run",
            "run_",
            name=[trace.name for trace in traces],
            direction=(_floats(trace.direction for trace in traces), NUMBER),
            torque=(_floats(math.nan if trace.torque is None else trace.torque for trace in traces), TORQUE),
            index=[trace.index for trace in traces],
        ),
        **_along(
            "sample",
            "sample_",
            run=(np.repeat(np.arange(len(traces)), counts), NUMBER),
            theta=(_joined([trace.theta for trace in traces]), POSITION),
            **{name: (_joined(rows), signal) for name, rows in waves.items()},
        ),
    }


def _floats(values: Iterable[float]) -> Array:
    return np.array(list(values), dtype=np.float64)


def _joined(rows: Sequence[Array]) -> Array:
    return np.concatenate([np.zeros(0), *rows])


@_table.register
def _of_tolerance(result: Tolerance) -> Table:
    return Table("Tolerance", "tolerance", _widths([result]))


def _widths(tolerances: Sequence[Tolerance]) -> dict[str, Variable]:
    own = Each("unit", tuple(_of_dimension(item.chosen[0].dimension) for item in tolerances))
    return _along(
        "tolerance",
        tolerance=[item.label for item in tolerances],
        key=[item.key for item in tolerances],
        width=(_floats(item.width for item in tolerances), own),
        distribution=[item.distribution.name for item in tolerances],
        correlation=(_floats(item.correlation for item in tolerances), NUMBER),
        random_phase=np.array([item.random_phase for item in tolerances], dtype=bool),
        fixed=np.array([item.fixed for item in tolerances], dtype=bool),
        least=(_floats(item.span[0] for item in tolerances), own),
        largest=(_floats(item.span[1] for item in tolerances), own),
    )


@_table.register
def _of_stack(result: Stack) -> Table:
    parts = [_of_dimension(component.dimension) for component in result.components]
    variables = {
        **_angles(result.theta, result.nominal.size),
        **_along("theta", nominal=(result.nominal, ANGLE)),
        **_along(
            "component",
            component=[str(component) for component in result.components],
            component_tolerance=(result.entry, NUMBER),
        ),
        "influence": Variable(
            ("component", "theta"), result.influence, Each("influence_unit", tuple(map(_per, parts))), bare=True
        ),
        **_along(
            "tolerance",
            tolerance=list(result.labels),
            width=(result.width, Each("unit", _of_entries(result))),
            distribution=[block.distribution.name for block in result.blocks],
            correlation=(_floats(block.correlation for block in result.blocks), NUMBER),
        ),
    }
    return Table("Stack", "tolerance", variables)


def _of_entries(stack: Stack) -> tuple[Unit, ...]:
    """Unit of the width of each entry of a stack."""
    return tuple(_of_dimension(stack.components[block.components.start].dimension) for block in stack.blocks)


@_table.register
def _of_budget(result: Budget) -> Table:
    entries = result.contributions
    own = Each("unit", tuple(_of_dimension(entry.dimension) for entry in entries))
    angles = (
        "worst_peak_to_peak",
        "worst_part",
        "rss",
        "mean_peak_to_peak",
        "mean_peak_to_peak_error",
        "offset_deviation",
        "worst_offset",
    )
    worst = result.worst
    variables = {
        **_along(
            "tolerance",
            tolerance=[entry.label for entry in entries],
            width=(_floats(entry.width for entry in entries), own),
            components=(np.array([entry.components for entry in entries], dtype=int), NUMBER),
            mean_square=(_floats(entry.mean_square for entry in entries), SQUARE),
            share=(_floats(entry.share for entry in entries), NUMBER),
            **{name: (_floats(getattr(entry, name) for entry in entries), ANGLE) for name in angles},
            effect=[entry.effect for entry in entries],
        ),
        **_angles(result.theta, result.mean.size),
        **_along(
            "theta",
            mean=(result.mean, ANGLE),
            standard_deviation=(result.standard_deviation, ANGLE),
            deviation_standard_deviation=(result.deviation_standard_deviation, ANGLE),
            lower=(worst.lower, ANGLE),
            upper=(worst.upper, ANGLE),
        ),
        **_single(
            total_offset_mean=(result.offset_mean, ANGLE),
            total_offset_deviation=(result.offset_deviation, ANGLE),
            total_nominal_peak_to_peak=(result.nominal_peak_to_peak, ANGLE),
            total_nominal_mean_square=(result.nominal_mean_square, SQUARE),
            total_mean_square=(result.mean_square, SQUARE),
            total_rms=(result.rms, ANGLE),
            total_rss=(result.rss, ANGLE),
            total_worst_peak_to_peak=(worst.peak_to_peak, ANGLE),
            total_worst_peak_to_peak_nominal=(worst.peak_to_peak_nominal, ANGLE),
            total_worst_maximum=(worst.maximum, ANGLE),
            total_worst_offset_low=(worst.offset[0], ANGLE),
            total_worst_offset_high=(worst.offset[1], ANGLE),
        ),
    }
    return Table("Budget", "tolerance", variables)


@_table.register
def _of_error_budget(result: ErrorBudget) -> Table:
    own = Each("component_unit", tuple(_of_dimension(c.dimension) for c in result.stack.components))
    worst, drawn = result.closed.worst, _table(result.units)
    variables = {
        **_table(result.closed).variables,
        **_along(
            "component",
            component=[str(component) for component in result.stack.components],
            worst_peak_to_peak_values=(worst.peak_to_peak_values, own),
            worst_maximum_values=(worst.maximum_values, own),
        ),
        **drawn.variables,
    }
    if result.indices is not None:
        ends = [f"{which}{end}" for which in ("first", "total") for end in ("", "_low", "_high")]
        shares = {f"sobol_{name}": (getattr(result.indices, name), NUMBER) for name in ends}
        variables |= _along("tolerance", **shares)
    about = {"model": _name(result.model), "direction": way(result.direction), **drawn.about}
    if result.contact is not None:
        variables |= _at_load(result.contact)
        about["contact_failures"] = "\n".join(result.contact.failures)
    return Table("ErrorBudget", "tolerance", variables, about)


def _at_load(contact: ContactCorrection) -> dict[str, Variable]:
    """Means and quantiles at the load, with what they are without contacts that open."""
    sizes = SIZES
    found = [[one.mean(), *map(one.quantile, LEVELS)] for one in (getattr(contact, size) for size in sizes)]
    variables = {
        **_along("size", size=list(sizes)),
        **_along("statistic", statistic=["mean", *(f"P{level * 100:g}" for level in LEVELS)]),
        **_single(
            torque=(contact.torque, TORQUE),
            contact_lag=(contact.lag, ANGLE),
            contact_thinning=(contact.thinning, ANGLE),
            contact_thinning_most=(contact.thinning_most, ANGLE),
            contact_count=(contact.count, NUMBER),
            contact_points=(contact.points, NUMBER),
        ),
    }
    for name in ("value", "low", "high", "linear"):
        values = np.array([[getattr(one, name) for one in row] for row in found])
        variables[f"contact_{name}"] = Variable(("size", "statistic"), values, ANGLE)
    return variables


@_table.register
def _of_virtual_units(result: VirtualUnits) -> Table:
    sizes = {name: (getattr(result, name), ANGLE) for name in ("peak_to_peak", "max", "rms", "offset")}
    variables = {
        **_along("virtual_unit", **sizes),
        **_single(error_bound=(result.error_bound, ANGLE)),
    }
    about = {"draws": result.draws, "seed": result.seed, "chunk": result.chunk, "form": result.form}
    return Table("VirtualUnits", "virtual_unit", variables, about)


@_table.register
def _of_allocation(result: Allocation, *, stack: Stack | None = None) -> Table:
    if stack is not None and stack.labels != result.labels:
        raise InputError("stack: its tolerances are not those of the allocation; give the stack that was allocated")
    widths = tuple(map(_of_dimension, result.dimensions))
    own = Each("unit", widths)
    prices = Each("bound_price_unit", tuple(Unit(f"1/{u.core}", f"1/{u.shown}", 1 / u.size) for u in widths))
    checks: tuple[Verification, ...] = (result.verified_before, result.verified)
    variables = {
        **_along(
            "tolerance",
            tolerance=list(result.labels),
            width_before=(_floats(result.widths_before), own),
            width=(_floats(result.widths), own),
            grade=[grade or "" for grade in result.grades],
            fixed=np.array(result.fixed, dtype=bool),
            cost_before=(_floats(result.costs_before), NUMBER),
            cost=(_floats(result.costs), NUMBER),
            bound_price=(_floats(result.bound_prices), prices),
            saved_per_arcsec_given_up=(_rates(rate.relax for rate in result.rates), PER_ARCSEC),
            cost_per_arcsec_gained=(_rates(rate.tighten for rate in result.rates), PER_ARCSEC),
        ),
        **_along(
            "stage",
            stage=["before", "after"],
            value=(_floats([result.value_before, result.value]), ANGLE),
            total_cost=(_floats([result.cost_before, result.cost]), NUMBER),
            verified=(_floats(check.quantile for check in checks), ANGLE),
            verified_low=(_floats(check.low for check in checks), ANGLE),
            verified_high=(_floats(check.high for check in checks), ANGLE),
        ),
        **_single(
            limit=(result.limit, ANGLE), gap=(result.gap, NUMBER), shadow_price=(result.shadow_price, PER_ARCSEC)
        ),
    }
    about = {"limited": result.kind, "level": result.level, "proof": result.proof}
    return Table("Allocation", "tolerance", variables, about)


def _rates(values: Iterable[float | None]) -> Array:
    return _floats(math.nan if value is None else value for value in values)


def _of_effects(result: Sequence[Effect]) -> Table:
    return Table("Effects", "parameter", _sizes(result))


def _of_tolerances(result: Sequence[Tolerance]) -> Table:
    return Table("Tolerances", "tolerance", _widths(result))


def _of_front(result: Sequence[FrontPoint]) -> Table:
    best = [point.allocation for point in result]
    variables = _along(
        "limit",
        limit=(_floats(point.limit for point in result), ANGLE),
        cost=(_rates(None if found is None else found.cost for found in best), NUMBER),
        value=(_rates(None if found is None else found.value for found in best), ANGLE),
        reason=[point.reason for point in result],
    )
    return Table("Front", "limit", variables)


_SEQUENCES: Mapping[type, Callable[[Any], Table]] = {
    Effect: _of_effects,
    Tolerance: _of_tolerances,
    FrontPoint: _of_front,
}


@_table.register
def _of_sequence(result: Sequence) -> Table:  # type: ignore[type-arg]
    kinds = {type(item) for item in result}
    entry = _SEQUENCES.get(kinds.pop()) if len(kinds) == 1 else None
    if entry is None:
        names = ", ".join(kind.__name__ for kind in _SEQUENCES)
        raise InputError(f"{type(result).__name__}: a table is made of a row of results of one kind: {names}")
    return entry(result)
