"""Results as pandas DataFrames and xarray Datasets, units and origin kept in their attributes.

A Dataset holds every variable of a result, a DataFrame those along one dimension.  pandas and xarray come with the
extra ``tables``.
"""

from __future__ import annotations

import importlib
import json
from typing import TYPE_CHECKING, Any

import numpy as np

from rverror.base.errors import needing
from rverror.base.version import __version__
from rverror.views.kinds import table
from rverror.views.variables import Each, columns

if TYPE_CHECKING:
    from pandas import DataFrame
    from xarray import Dataset


def to_pandas(result: Any, *, rows: str = "", display: bool = False) -> DataFrame:
    """Result as a DataFrame.

    Parameters
    ----------
    result
        A Run, OrderTable, Model, Effect, Reducer, Drive, Influence, Equilibrium, TorsionCurve, Hysteresis, Efficiency,
        ContactPressure, Diagnosis, Tolerance, Budget, ErrorBudget, VirtualUnits or Allocation; or a list or
        tuple of Effect, Tolerance, FrontPoint or Efficiency.
    rows : str, optional
        What a row is: a dimension of the Dataset.  Where left out: the sample of a run, the wave of an order table, the
        angle of an equilibrium or influence, the parameter of a model, what a diagnosis added, the tolerance of a
        budget or allocation.  A diagnosis has the rows ``added``, ``stage`` (before and after), ``unexplained``,
        ``candidate``, ``run``, ``sample`` (waveforms), ``elastic`` (stiffness, backlash, contact law), ``set_aside``
        and ``slip``, a budget ``tolerance`` and ``theta``.
    display : bool
        Whether values are in the units in which people read them (arcsec, um, N*m; positions in deg) in place of core
        units (rad, mm, N*mm).

    Returns
    -------
    DataFrame
        Names of columns hold no unit.  ``attrs["units"]`` has that of each numeric column in pint's notation; where
        the rows have units of their own, the column ``unit`` tells them.  Other attrs: the kind of the result, the
        version of rverror, and what has one value for all rows.

    Raises
    ------
    InputError
        If pandas is not installed, or no table is made of such a result.

    Notes
    -----
    What has other dimensions stands in another table of the same result, what has several in its Dataset alone.

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
    result_table = table(result)
    found, units = columns(result_table, rows=rows, display=display)
    frame: DataFrame = pandas.DataFrame(found)
    about: dict[str, Any] = {"kind": result_table.kind, "rverror": __version__, **result_table.about}
    for name, variable in result_table.variables.items():
        if not variable.dims:
            about[name] = variable.shown(display=display).item()
            units[name] = variable.unit_text(display=display)
    frame.attrs.update(about | {"units": {name: unit for name, unit in units.items() if unit}})
    return frame


def to_xarray(result: Any, *, display: bool = False) -> Dataset:
    """Result as a Dataset.

    Parameters
    ----------
    result
        As for `to_pandas`.
    display : bool
        As for `to_pandas`.

    Returns
    -------
    Dataset
        Every variable of numbers has its unit in ``attrs["units"]``, in pint's notation; where rows have units of
        their own, a coordinate whose name ends in ``unit`` tells them.  ``attrs`` of the Dataset: the kind of the
        result, the version of rverror, and what else is known of its origin.

    Raises
    ------
    InputError
        If xarray is not installed, or no table is made of such a result.

    Notes
    -----
    It can be written by ``to_netcdf``, also with scipy alone, and comes back the same.

    Examples
    --------
    >>> import rverror
    >>> unit = rverror.Model(rverror.reducer("RV-40E"))
    >>> theta = [0.0, 0.1]
    >>> state = rverror.equilibrium(unit, theta, torque="412 N*m")
    >>> found = rverror.to_xarray(state)
    >>> found["pin_force"].dims, found["pin_force"].attrs["units"]
    (('disc', 'pin', 'xy', 'theta'), 'N')
    """
    xarray = _library("xarray")
    result_table = table(result)
    data: dict[str, Any] = {}
    coordinates: dict[str, Any] = {}
    for name, variable in result_table.variables.items():
        values = variable.shown(display=display)
        unit = variable.unit_text(display=display)
        if values.dtype.kind in "OU":
            values = np.array([_writable(text) for text in values.ravel()], dtype=str).reshape(values.shape)
        place = coordinates if name in variable.dims else data
        place[_writable(name).replace("/", " per ")] = (variable.dims, values, {"units": unit} if unit else {})
        if isinstance(variable.unit, Each):
            texts = np.array(variable.unit.texts(display=display), dtype=str)
            coordinates[variable.unit.name] = (variable.dims[:1], texts)
    about = {"kind": result_table.kind, "rverror": __version__, **result_table.about}
    found: Dataset = xarray.Dataset(data, coordinates, {name: _attribute(value) for name, value in about.items()})
    return found


def _library(name: str) -> Any:
    with needing(f"tables need {name}", "tables"):
        return importlib.import_module(name)


def _writable(text: Any) -> str:
    """Text that a file in UTF-8 can hold."""
    return str(text).encode("utf-8", "backslashreplace").decode("utf-8")


def _attribute(value: Any) -> Any:
    """Attribute that a netCDF file can hold: a number or a text."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, float, str)):
        value = json.dumps(value, ensure_ascii=False)
    return _writable(value) if isinstance(value, str) else value
