"""Tables: every number with its unit, and the same numbers as in the result, in a Dataset, a DataFrame and a file."""

from __future__ import annotations

import io
import math
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import openpyxl
import pandas as pd
import pint
import pytest
import xarray as xr

import every_kind as made
import rverror
from every_kind import DRIVE, ELASTIC, HOSTILE, KINDS, MODEL, THETA, TOLERANCES, diagnosis, every_kind, run
from rverror import InputError, to_pandas, to_xarray
from rverror.base.viewed import Viewed
from rverror.geartrain.action_line import CONTACT_AXES
from rverror.views.tables import columns, table

UREG: pint.UnitRegistry[float] = pint.UnitRegistry()


def dataset(kind: str, **more: Any) -> xr.Dataset:
    return to_xarray(every_kind()[kind][0], **more)


def row_units(found: xr.Dataset, name: str) -> list[str] | None:
    """Units of the rows of a variable that has not one for all."""
    variable = found[name]
    first = [c for c in found.coords.values() if c.dims == variable.dims[:1] and str(c.name).endswith("unit")]
    own = [c for c in first if str(c.name).startswith(name)] or [c for c in first if str(c.name) == "unit"] or first
    return list(map(str, own[0].values)) if own else None


def quantities(found: xr.Dataset) -> Iterator[tuple[str, list[Any]]]:
    """Every variable of numbers as quantities, one for each of its rows."""
    for name, variable in found.variables.items():
        if variable.dtype.kind not in "fi":
            continue
        if "units" in variable.attrs:
            yield str(name), [UREG.Quantity(variable.values, variable.attrs["units"])]
            continue
        own = row_units(found, str(name))
        assert own is not None, f"{name} has no unit"
        yield str(name), [UREG.Quantity(v, u) for v, u in zip(variable.values, own, strict=True)]


def test_every_kind_is_tried() -> None:
    assert set(KINDS) == set(every_kind())


@pytest.mark.parametrize("kind", KINDS)
def test_units_for_people_are_the_same_quantities(kind: str) -> None:
    core, shown = (dict(quantities(dataset(kind, display=display))) for display in (False, True))
    assert core
    assert core.keys() == shown.keys()
    for name, rows in core.items():
        for a, b in zip(rows, shown[name], strict=True):
            np.testing.assert_allclose(b.to(a.units).magnitude, a.magnitude, rtol=1e-12, err_msg=name)


@pytest.mark.parametrize("kind", KINDS)
def test_a_dataset_comes_back_from_its_file(kind: str, tmp_path: Path) -> None:
    found = dataset(kind)
    found.to_netcdf(tmp_path / "result.nc", engine="scipy")
    with xr.open_dataset(tmp_path / "result.nc", engine="scipy") as back:
        xr.testing.assert_identical(back.load(), found)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("display", [False, True])
def test_each_dimension_makes_a_frame_of_the_same_values_and_units(kind: str, display: bool) -> None:
    result = every_kind()[kind][0]
    found = dataset(kind, display=display)
    seen = set()
    for rows in table(result).dims:
        frame = to_pandas(result, rows=rows, display=display)
        assert len(frame) == found.sizes[rows]
        assert frame.attrs["kind"] == found.attrs["kind"]
        for name, one in found.variables.items():
            column = str(name).removeprefix(f"{rows}_")
            if one.dims == (rows,) and not str(name).endswith("unit"):
                kept = frame[column].to_numpy(one.dtype)
                np.testing.assert_array_equal(kept, one.values, err_msg=str(name), strict=True)
                assert frame.attrs["units"].get(column, "") == one.attrs.get("units", "")
                seen.add(name)
            if one.dims == ():
                assert frame.attrs[str(name)] == one.values.item()
                assert frame.attrs["units"][str(name)] == one.attrs["units"]
    rows_of_one = {name for name, one in found.variables.items() if len(one.dims) == 1}
    assert rows_of_one - seen <= {name for name in found.variables if str(name).endswith("unit")}


@pytest.mark.parametrize("kind", KINDS)
def test_attributes_say_where_it_comes_from(kind: str) -> None:
    found = dataset(kind)
    assert found.attrs["rverror"] == rverror.__version__
    assert found.attrs["kind"]
    for name in ("Model", "Diagnosis", "ErrorBudget"):
        assert dataset(name).attrs["model"] == HOSTILE


def test_every_result_that_can_be_looked_at_has_a_table() -> None:
    kinds = {type(result) for result, _ in every_kind().values()}
    assert set(Viewed.__subclasses__()) <= kinds


# --- what is in them --------------------------------------------------------------------------------------------------


def test_influence_times_size_is_the_transmission_error() -> None:
    found = dataset("Influence")
    size = UREG.Quantity(5.0, "um")
    per = UREG.Quantity(found["influence"].sel(parameter="tangential").values, row_units(found, "influence")[1])
    cause = rverror.effect("crank.eccentricity", crank=0, disc=1, tangential="5 um")
    alone = rverror.Model(MODEL.mechanism, (cause,))
    error = rverror.transmission_error(alone, found["theta"].values)
    np.testing.assert_allclose((per * size).to("rad").magnitude, error, rtol=1e-12, atol=1e-20)


def test_an_order_table_has_a_row_for_each_wave() -> None:
    """Both forms of a wave: amplitude cos(order theta + phase) is cos cos(order theta) + sin sin(order theta)."""
    frame = to_pandas(every_kind()["OrderTable"][0], display=True)
    assert frame["order"].tolist() == [1, 39, 39, 39]  # growing within a case
    assert frame["case"].tolist() == [0, 0, 1, 2]
    assert frame["direction"].tolist() == [1, 1, -1, 1]
    assert frame["torque"].tolist() == [20, 20, 20, 60]
    assert frame["amplitude"].tolist() == pytest.approx([7, 2, 1.5, 3])
    assert frame["phase"].tolist() == pytest.approx([-170, 10, 0, 90])
    assert frame["cos"].tolist() == pytest.approx([7 * np.cos(np.radians(170)), 2 * np.cos(np.radians(10)), 1.5, 0])
    assert frame["sin"].tolist() == pytest.approx([7 * np.sin(np.radians(170)), -2 * np.sin(np.radians(10)), 0, -3])
    assert frame["sigma"].tolist() == pytest.approx([0.2, 0.1, 0.1, 0.1])
    assert frame["input_speed"].tolist() == pytest.approx([10 * 60 / (2 * np.pi)] * 4)
    assert frame.attrs["units"]["input_speed"] == "rpm"
    bare = to_pandas(rverror.runs.orders_from_arrays(direction=1, order=[1], cos=[1e-5], sin=[0.0]))
    assert list(bare.columns) == ["case", "direction", "order", "amplitude", "phase", "cos", "sin"]


def test_a_state_has_the_angles_of_the_bench() -> None:
    result, _ = every_kind()["Equilibrium"]
    ahead = MODEL.with_effects(rverror.effect("sensor.index_offset", offset="5 deg"))
    state = rverror.equilibrium(ahead, result.theta, torque=made.TORQUE, direction=1.0)
    np.testing.assert_array_equal(dataset("Equilibrium")["theta"].values, result.theta)
    np.testing.assert_allclose(to_xarray(state)["theta"].values, result.theta, rtol=0, atol=1e-15)


def test_a_model_alone_tells_its_effects() -> None:
    frame = to_pandas(MODEL, display=True)
    assert frame[["key", "parameter", "value", "unit"]].values.tolist() == [
        ["crank.eccentricity", "radial", pytest.approx(4.0), "um"],
        ["crank.eccentricity", "tangential", pytest.approx(1.0), "um"],
        ["cycloid.pin_position", "radial", pytest.approx(-2.0), "um"],
        ["cycloid.pin_position", "tangential", 0.0, "um"],
        ["crank.index", "angle", pytest.approx(3.0), "arcsec"],
    ]
    assert frame["uncertainty"].tolist() == pytest.approx([1.0, 1.0, *[np.nan] * 3], nan_ok=True)
    assert frame["indices"].tolist()[:3] == ["crank 0, disc 1", "crank 0, disc 1", "pin 3"]


def test_a_disc_takes_from_its_pins_what_it_gives_its_cams() -> None:
    """A force named after the wrong part or axis would break it."""
    found = dataset("Equilibrium")
    onto_disc, onto_cams = found["pin_force"].sum("pin"), found["cam_force"].sum("crank")
    np.testing.assert_allclose(onto_disc.values, onto_cams.transpose(*onto_disc.dims).values, rtol=1e-6, atol=1e-3)


def test_the_output_is_where_the_carrier_has_turned_to() -> None:
    found = dataset("Equilibrium")
    np.testing.assert_array_equal(found["carrier_rotation"], found["transmission_error"])


def test_an_efficiency_has_rows_for_angles_and_for_parts() -> None:
    result, _ = every_kind()["Efficiency"]
    found = to_xarray(result, display=True)
    np.testing.assert_allclose(found["efficiency"], 100 * result.efficiency)
    assert found["mean_efficiency"].item() == pytest.approx(100 * result.mean)
    assert found["share"].sel(part="drag").item() == pytest.approx(100 * result.by_part["drag"])
    np.testing.assert_allclose(found["loss"].sel(part="pin"), result.losses["pin"] / 1e3)
    np.testing.assert_allclose(found["input_torque"], result.input_torque / 1e3)
    assert (found.attrs["drives"], found.attrs["direction"]) == ("input", "forward")
    rows = to_pandas(every_kind()["Efficiencies"][0], display=True)
    assert rows[["drives", "direction"]].values.tolist() == [["input", "forward"], ["output", "reverse"]]
    lost = rows[[name for name in rows.columns if name.startswith("lost_")]].sum(axis=1)
    assert (lost + rows["efficiency"]).tolist() == pytest.approx([100, 100])  # what is not lost comes out
    assert rows["torque"].tolist() == pytest.approx([made.TORQUE / 1e3] * 2)


def test_contact_pressures_and_their_peaks() -> None:
    result, _ = every_kind()["ContactPressure"]
    found = to_xarray(result, display=True)
    for contact in ("pin", "mesh", "cam"):
        np.testing.assert_allclose(found[f"{contact}_force"], result.force[contact])
        np.testing.assert_allclose(found[f"{contact}_pressure"], result.pressure[contact])
        np.testing.assert_allclose(found[f"{contact}_half_width"], 1e3 * result.half_width[contact])
    np.testing.assert_allclose(found["pin_place"], np.degrees(result.place))
    rows = to_pandas(result, display=True)
    for row, peak in zip(rows.to_dict("records"), result.peaks(), strict=True):
        assert row["contact"] == peak.contact
        assert row["indices"] == ", ".join(f"{name} {at}" for name, at in peak.indices.items())
        sizes = [row[name] for name in ("pressure", "force", "theta", "ripple")]
        assert sizes == pytest.approx([peak.pressure, peak.force, np.degrees(peak.theta), 100 * peak.ripple])


def test_loaded_pins_are_those_with_a_force() -> None:
    found = dataset("Equilibrium")
    carry = (np.hypot(found["pin_force"].sel(xy="x"), found["pin_force"].sel(xy="y")) > 0).sum("pin")
    np.testing.assert_array_equal(carry.values, found["loaded_pins"].values)


def test_only_the_driving_flanks_carry() -> None:
    found = dataset("Equilibrium")
    assert found.sizes["flank"] == 2
    for name in ("mesh_force", "spline_torque"):
        assert (found[name].sel(flank=1) == 0).all()
        assert (found[name].sel(flank=0) != 0).any("theta").all()


def test_every_contact_of_an_equilibrium_is_told() -> None:
    found = dataset("Equilibrium")
    told = {str(name).rpartition("_")[0] for name in found if str(name).endswith(("_force", "_torque"))} - {"largest"}
    assert told == set(CONTACT_AXES) - {"output"}


def test_a_diagnosis_by_what_was_added() -> None:
    frame = to_pandas(diagnosis("unexplained"), display=True)
    assert frame[["parameter", "value", "low", "high", "unit"]].values.tolist() == [
        ["cos", pytest.approx(5), pytest.approx(4), pytest.approx(6), "arcsec"],
        ["sin", pytest.approx(-2), pytest.approx(-3), pytest.approx(-1), "arcsec"],
    ]
    assert frame["orders"].tolist() == ["1, 80.5"] * 2
    assert frame["heldout_rms"].tolist() == pytest.approx([2.5, 2.5])
    assert frame.attrs["verdict"] == "unexplained"
    assert frame.attrs["noise_rms"] == pytest.approx(1.5)
    assert frame.attrs["units"]["noise_rms"] == "arcsec"


def test_a_diagnosis_of_a_torque_ripple_is_in_newton_metres() -> None:
    found = to_pandas(diagnosis(quantity="torque"), rows="stage", display=True)
    assert found["heldout_rms"].tolist() == pytest.approx([12, 10, 3, np.nan], nan_ok=True)
    assert found.attrs["units"]["heldout_rms"] == "N*m"


def test_what_nothing_explains_and_who_came_near() -> None:
    lines = to_pandas(diagnosis("unexplained"), rows="unexplained", display=True)
    assert lines[["order", "amplitude", "low", "high"]].values.tolist() == [
        pytest.approx([36.0, 7, 6, 8]),
        pytest.approx([39.5, 2, 1, 3]),
    ]
    assert lines["frames"].tolist() == ["", f"{HOSTILE}; input shaft"]
    near = to_pandas(diagnosis(), rows="candidate")
    assert near["heldout_gain"].tolist() == [3.5, -1.0]


def test_a_diagnosis_without_additions_has_the_same_columns() -> None:
    none, some = to_pandas(diagnosis("nothing_missing")), to_pandas(diagnosis("explained"))
    assert len(none) == 0
    assert list(none.columns) == list(some.columns)


def test_waveforms_of_runs_of_any_length_stand_one_after_another() -> None:
    frame = to_pandas(diagnosis(), rows="sample", display=True)
    assert frame["run"].value_counts().to_dict() == {0: 20, 1: 30}
    first, second = (frame[frame["run"] == at] for at in (0, 1))
    assert set(first["residual_before"].round(9)) == {5.0}  # 9 less 4
    assert set(second["residual_before"].round(9)) == {6.0}  # of stretches left out
    assert set(second["residual_after"].round(9)) == {3.0}
    assert first["theta"].tolist() == pytest.approx(np.arange(20) * 18.0)
    runs = to_pandas(diagnosis(), rows="run")
    assert runs["torque"].tolist() == pytest.approx([20e3, np.nan], nan_ok=True)


def test_what_the_runs_say_of_stiffness_backlash_and_contact_law() -> None:
    frame = to_pandas(diagnosis(), rows="elastic", display=True)
    assert frame["name"].tolist() == [row.name for row in ELASTIC]
    assert frame["unit"].tolist() == ["N/mm", "N/mm", "um", "dimensionless", "dimensionless"]
    assert frame["declared"].tolist() == pytest.approx([2.5e5, 3e5, 20, 1, 1])
    assert frame["value"].tolist() == pytest.approx([2.25e5, 3.1e5, 31, 1.125, 1])
    assert frame["low"].tolist() == pytest.approx([2e5, 2e5, 29, np.nan, 1], nan_ok=True)
    assert frame["high"].tolist() == pytest.approx([2.5e5, 4e5, 33, np.nan, 1.25], nan_ok=True)
    assert frame["determined"].tolist() == [True, False, True, True, False]
    core = to_pandas(diagnosis(), rows="elastic")
    assert core["unit"].tolist()[1:4] == ["N/mm", "mm", "dimensionless"]
    assert core["value"].tolist() == [row.value for row in ELASTIC]


def test_what_was_set_aside_stands_with_its_run_and_angle() -> None:
    found = diagnosis()
    second = replace(found.traces[1], set_aside=np.radians([12.0]), slips=None)
    found = replace(found, traces=(found.traces[0], second))
    aside, slips = (to_pandas(found, rows=rows, display=True) for rows in ("set_aside", "slip"))
    assert aside["run"].tolist() == [0, 0, 0, 1]
    assert aside["theta"].tolist() == pytest.approx([30, 31, 750, 12])
    assert aside.attrs["units"]["theta"] == "deg"
    assert slips["run"].tolist() == [0, 0]
    assert slips["theta"].tolist() == pytest.approx([-90, 400])


@pytest.mark.parametrize("rows", ["elastic", "set_aside", "slip"])
def test_a_drive_has_no_stiffness_and_nothing_set_aside_but_the_same_columns(rows: str) -> None:
    none, some = (to_pandas(diagnosis(mechanism=unit), rows=rows) for unit in (DRIVE, MODEL.mechanism))
    assert len(none) == 0
    assert list(none.columns) == list(some.columns)


def test_a_budget_of_numbers_and_of_waves() -> None:
    result, _ = every_kind()["ErrorBudget"]
    found = dataset("ErrorBudget")
    np.testing.assert_array_equal(found["lower"], result.closed.worst.lower)
    labels = [one.label for one in result.closed.contributions]
    total = dict(zip(labels, result.indices.total, strict=True))
    assert found["sobol_total"].values.tolist() == [total[str(name)] for name in found["tolerance"].values]
    assert found["share"].sum().item() == pytest.approx(1.0)
    worst = found["size_worst_case"].sel(size="peak-to-peak").item()
    nominal = result.closed.worst.peak_to_peak_nominal
    assert worst == pytest.approx(found["worst_part"].sum().item() + nominal)
    (loaded,) = result.at_load.verified.limits
    assert found["p99"].item() == loaded.quantile(0.99).value
    assert found[f"sobol_total, {loaded.limit.label}"].sum().item() > 0


def test_widths_of_an_allocation_have_their_units() -> None:
    result, _ = every_kind()["Allocation"]
    frame = to_pandas(result, display=True)
    assert frame["unit"].tolist() == ["um", "arcsec", "um"]
    assert frame["width_before"].tolist() == pytest.approx([5, 3, 2])
    assert frame["grade"].tolist()[:2] == ["", ""]
    assert frame["cost"].sum() == pytest.approx(to_pandas(result, rows="stage")["total_cost"].iloc[1])


def test_a_front_says_why_a_limit_cannot_be_met() -> None:
    frame = to_pandas(every_kind()["Front"][0], display=True)
    assert frame["limit"].tolist() == pytest.approx([5, 60])
    assert np.isnan(frame["cost"][0])
    assert "5 arcsec" in frame["reason"][0]
    assert frame["reason"][1] == ""


def test_tolerances_and_effects_by_the_row() -> None:
    assert to_pandas(list(TOLERANCES), display=True)["width"].tolist() == pytest.approx([5, 3, 2])
    pd.testing.assert_frame_equal(to_pandas(list(MODEL.effects)), to_pandas(MODEL))


def test_a_reducer_has_all_its_parameters() -> None:
    frame = to_pandas(rverror.reducer("RV-40E"), display=True).set_index("parameter")
    assert frame.loc["pressure_angle"].tolist() == [pytest.approx(20), "deg"]
    assert frame.loc["rated_torque"].tolist() == [pytest.approx(412), "N*m"]
    assert frame.loc["stiffness.main_bearing"].tolist() == [1e6, "N/mm"]
    rubs = replace(rverror.reducer("RV-40E"), friction=made.FRICTION)
    told = to_pandas(rubs, display=True).set_index("parameter")
    assert told.loc["friction.crank_bearing"].tolist() == [0.0025, "dimensionless"]
    assert told.loc["friction.crank_bearing_radius"].tolist() == [10, "mm"]
    assert told.loc["friction.drag"].tolist() == [4, "N*m"]
    assert {name for name in told.index if name.startswith("friction")} - set(frame.index) == {
        f"friction.{name}" for name in ("pin", "mesh", "crank_bearing", "crank_bearing_radius", "drag")
    }
    again = {name: row.value for name, row in frame.iterrows() if "." not in name and row.unit == "dimensionless"}
    assert all(getattr(rverror.reducer("RV-40E"), name) == value for name, value in again.items())


# --- a run there and back ---------------------------------------------------------------------------------------------


def same(one: rverror.Run, other: rverror.Run) -> None:
    for name in ("input_angle", "output_angle", "time", "direction", "te_column"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)
    assert (one.torque, one.temperature, one.index) == (other.torque, other.temperature, other.index)
    assert dict(one.metadata) == dict(other.metadata)


def test_a_run_goes_to_a_frame_and_back() -> None:
    there = run()
    frame = to_pandas(there)
    back = rverror.run_from_arrays(
        **{name: frame[name] for name in ("input_angle", "output_angle", "time")},
        direction=frame.attrs["direction"],
        **{name: frame.attrs[name] for name in ("torque", "temperature", "index", "metadata")},
    )
    same(back, there)


def test_a_run_goes_to_a_dataset_and_back() -> None:
    there = run()
    found = to_xarray(there, display=True)
    back = rverror.run_from_arrays(
        **{name: UREG.Quantity(found[name].values, found[name].attrs["units"]) for name in ("input_angle", "time")},
        te=UREG.Quantity(found["output_angle"].values - found["input_angle"].values / 121, "deg"),
        ratio=121.0,
    )
    np.testing.assert_allclose(back.error(121), there.error(121), atol=1e-12)
    np.testing.assert_array_equal(back.direction, there.direction)
    assert found["torque"].item() == pytest.approx(20)


def test_text_with_units_in_its_names_is_a_run_file(tmp_path: Path) -> None:
    there = rverror.run_from_arrays(input_angle=121 * THETA, output_angle=THETA + 1e-5 * np.sin(THETA))
    for display in (False, True):
        frame = to_pandas(there, display=display)
        units = frame.attrs["units"]
        angles = frame[["input_angle", "output_angle"]].rename(columns=lambda name, u=units: f"{name}[{u[name]}]")
        angles.to_csv(tmp_path / f"{display}.csv", index=False)
        back = rverror.load_run(tmp_path / f"{display}.csv")
        np.testing.assert_allclose(back.output_angle, there.output_angle, rtol=1e-12)


# --- what is refused --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("table", "library"), [(to_pandas, "pandas"), (to_xarray, "xarray")])
def test_a_missing_library_is_named_with_its_remedy(table: Any, library: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(InputError) as refused:
        table(MODEL)
    assert str(refused.value) == f"tables need {library}; install it with: pip install 'rverror[tables]'"


@pytest.mark.parametrize("thing", [3.5, "text", None, [], [MODEL, 3.5], (MODEL,), {"a": 1}])
def test_of_other_things_no_table_is_made(thing: Any) -> None:
    with pytest.raises(InputError, match="no table is made of it"):
        to_pandas(thing)


def test_no_such_rows() -> None:
    with pytest.raises(InputError, match="rows = 'pin': a Diagnosis has no such rows; give one of added, stage"):
        to_pandas(diagnosis(), rows="pin")


def test_a_name_that_is_no_text_goes_into_a_file_as_its_escape(tmp_path: Path) -> None:
    angle = np.linspace(0, 6, 32)
    odd = rverror.run_from_arrays(input_angle=121 * angle, output_angle=angle, metadata={"file": "a\udcff.csv"})
    to_xarray(odd).to_netcdf(tmp_path / "odd.nc", engine="scipy")
    with xr.open_dataset(tmp_path / "odd.nc", engine="scipy") as back:
        assert r"\udcff" in back.attrs["metadata"]


def test_nothing_of_the_result_is_changed() -> None:
    there = run()
    before = there.output_angle.copy()
    frame = to_pandas(there)
    frame["output_angle"] = 0.0
    to_xarray(there)["output_angle"][:] = 0.0
    np.testing.assert_array_equal(there.output_angle, before)


@pytest.mark.parametrize("kind", KINDS)
def test_a_workbook_has_the_rows_of_each_frame_and_no_formula(kind: str) -> None:
    result = replace(MODEL.effects[0], origin="=1+1") if kind == "Effect" else every_kind()[kind][0]
    book = openpyxl.load_workbook(io.BytesIO(rverror.views.to_xlsx(result)))
    single, *sheets = book.worksheets
    told = to_xarray(result, display=True)
    assert {row[0] for row in single.iter_rows(min_row=2, values_only=True)} == {
        name for name, variable in told.data_vars.items() if not variable.dims
    }
    assert sheets
    for sheet in sheets:
        frame = to_pandas(result, rows=sheet.title, display=True)
        head, *rows = sheet.iter_rows(values_only=True)
        assert [str(cell).partition(" [")[0] for cell in head] == list(frame.columns)
        for column, cells in zip(frame.columns, zip(*rows, strict=True), strict=False):
            if frame[column].dtype.kind in "fi":
                known = [math.nan if cell is None else float(cell) for cell in cells]
                np.testing.assert_allclose(known, frame[column].to_numpy(dtype=float), rtol=1e-15)  # 16 digits
        assert all(cell.data_type != "f" for row in sheet.iter_rows() for cell in row)


def test_columns_without_pandas() -> None:
    found, told = columns(table(MODEL), display=True)
    assert found["unit"] == ["um", "um", "um", "um", "arcsec"]
    assert told["value"] == ""
