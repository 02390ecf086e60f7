"""Order maps: what a cell shows is the amplitude of that order in that run."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.colors import LogNorm

from drawn import luminance, neighbours_differ, units_missing
from rverror import InputError, Run, reducer, run_from_arrays
from rverror.base.units import ARCSEC
from rverror.views import order_map

UNIT = reducer("RV-40E")
THETA = 2 * np.pi * np.arange(3 * 512) / 512


def run(torque: str | None, size: float, *, order: int = 40, degrees: str = "20 degC", sense: int = 1) -> Run:
    theta = THETA[::sense]
    return run_from_arrays(
        input_angle=121 * theta,
        te=size * np.cos(order * theta) * ARCSEC,
        direction=sense,
        torque=torque,
        temperature=degrees,
    )


def cell(ax: Axes, row: int, order: float) -> float:
    """What is shown at an order in a row, counted from below."""
    meshes = [c for c in ax.collections if isinstance(c, QuadMesh)]
    (mesh,) = [m for m in meshes if abs(m.get_coordinates()[:, 0, 1].mean() - row) < 1e-9]
    edges = mesh.get_coordinates()[0, :, 0]
    return float(np.ravel(mesh.get_array())[np.searchsorted(edges, order) - 1])


def rows(ax: Axes) -> list[str]:
    return [tick.get_text() for tick in ax.get_yticklabels()]


def test_rows_are_runs_by_torque_and_cells_their_amplitudes() -> None:
    ax = order_map([run("50 N*m", 6.0), run("10 N*m", 3.0), run("10 N*m", 2.0, order=78, sense=-1)], ratio=UNIT)
    assert rows(ax) == ["10 forward", "10 reverse", "50 forward"]
    assert ax.get_ylabel() == "output torque, N*m"
    assert cell(ax, 0, 40) == pytest.approx(3.0)
    assert cell(ax, 1, 78) == pytest.approx(2.0)
    assert cell(ax, 2, 40) == pytest.approx(6.0)
    assert cell(ax, 2, 41) == pytest.approx(6e-3)  # three decades below the largest is the end of the scale
    assert units_missing(ax) == []


def test_rows_by_temperature() -> None:
    ax = order_map(
        [run("5 N*m", 1.0, degrees="40 degC"), run("9 N*m", 2.0, degrees="-5 degC")], ratio=UNIT, by="temperature"
    )
    assert rows(ax) == ["-5 forward", "40 forward"]
    assert ax.get_ylabel() == "temperature, degC"
    assert cell(ax, 0, 40) == pytest.approx(2.0)


def test_colours_are_logarithmic_with_their_unit_and_fall_evenly_in_grey() -> None:
    ax = order_map([run("5 N*m", 4.0)], ratio=UNIT)
    (mesh,) = [c for c in ax.collections if isinstance(c, QuadMesh)]
    assert isinstance(mesh.norm, LogNorm)
    assert (mesh.norm.vmin, mesh.norm.vmax) == (pytest.approx(4e-3), pytest.approx(4.0))
    bar = next(other for other in ax.figure.axes if other is not ax)
    assert bar.get_ylabel() == "amplitude, arcsec"
    assert neighbours_differ([luminance(mesh.cmap(level)) for level in np.linspace(0, 1, 30)])
    assert mesh.cmap.name in colormaps


def test_many_orders_are_drawn_as_the_largest_of_some() -> None:
    long = 2 * np.pi * np.arange(3 * 4096) / 4096
    wave = run_from_arrays(
        input_angle=121 * long, te=5 * np.cos(1083 * long) * ARCSEC, direction="forward", torque="5 N*m"
    )
    ax = order_map([wave], ratio=UNIT, highest=1600)
    assert cell(ax, 0, 1083) == pytest.approx(5.0)
    bar = next(other for other in ax.figure.axes if other is not ax)
    assert bar.get_ylabel() == "amplitude, arcsec, largest of 4 lines"


def test_what_a_run_must_hold() -> None:
    with pytest.raises(InputError, match=r"run 2: no torque in the run"):
        order_map([run("5 N*m", 1.0), run(None, 1.0)], ratio=UNIT)
    with pytest.raises(InputError, match=r"by = 'speed': rows are ordered by torque or temperature"):
        order_map([run("5 N*m", 1.0)], ratio=UNIT, by="speed")
    with pytest.raises(InputError, match=r"one run or more"):
        order_map([], ratio=UNIT)
