"""Order tables: what is read, what is refused and in which words, what is written, and the same from arrays."""

from __future__ import annotations

import cmath
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

import rverror
from recordings import recording
from remedy import REMEDY
from rverror import load_run
from rverror.base.errors import InputError
from rverror.runs import OrderTable, load_orders, orders_from_arrays, write_orders
from rverror.runs.measurement import read_run
from rverror.runs.order_file import is_order_file, orders_text
from rverror.runs.order_table import OrderCase, TableCondition

ARCSEC = math.pi / 648000
HEAD = "# kind: orders\n# index: unknown\n"
NAMES = "direction,input_speed[rpm],temperature[degC],output_torque[N*m],order,amplitude[arcsec],phase[deg]\n"
ROWS = """forward,100,25,200,40,2,30
forward,100,25,200,1,60,-0.5
reverse,100,25,200,40,1.5,180
forward,100,25,300,40,2.5,45
forward,100,25,200,39,3,-90
"""
GOOD = HEAD + NAMES + ROWS
#: The shortest of each form; rows start at line 3.
POLAR = "# kind: orders\ndirection,order,amplitude[arcsec],phase[deg]\n"
PLANE = "# kind: orders\ndirection,order,cos[arcsec],sin[arcsec]\n"
SIGMA = "# kind: orders\ndirection,order,amplitude[arcsec],phase[deg],sigma[arcsec]\n"


def load(folder: Path, content: str) -> OrderTable:
    path = folder / "orders.csv"
    path.write_text(content, encoding="utf-8")
    return load_orders(path)


def refused(folder: Path, content: str) -> str:
    """The one line of a refusal, without the name of the file."""
    with pytest.raises(InputError) as caught:
        load(folder, content)
    line = str(caught.value)
    assert "\n" not in line
    assert line.startswith(str(folder / "orders.csv"))
    assert REMEDY.search(line), line
    return line.removeprefix(str(folder / "orders.csv"))


def same_waves(one: OrderTable, other: OrderTable, *, rtol: float = 1e-12) -> None:
    assert len(one.cases) == len(other.cases)
    for a, b in zip(one.cases, other.cases, strict=True):
        assert a.condition.direction == b.condition.direction
        for name in ("torque", "input_speed", "temperature"):
            written, read = getattr(a.condition, name), getattr(b.condition, name)
            assert (read is None) == (written is None)
            assert written is None or abs(read - written) <= 1e-12 * max(1.0, abs(written))
        np.testing.assert_allclose(b.orders, a.orders, rtol=1e-14)
        assert (np.abs(a.waves - b.waves) <= rtol * np.abs(a.waves)).all()
        assert (a.sigma is None) == (b.sigma is None)
        if a.sigma is not None:
            np.testing.assert_allclose(b.sigma, a.sigma, rtol=rtol)


# --- what is read -----------------------------------------------------------------------------------------------------


def test_good_file(tmp_path: Path) -> None:
    table = load(tmp_path, GOOD)
    assert table.path == str(tmp_path / "orders.csv")
    assert table.index == "unknown"
    assert table.metadata == {"kind": "orders", "index": "unknown"}
    assert table.notes == ()
    conditions = [(c.condition.direction, c.condition.torque) for c in table.cases]
    assert conditions == [(1.0, 200e3), (-1.0, 200e3), (1.0, 300e3)]  # as they appear
    assert table.cases[0].condition.input_speed == pytest.approx(100 * 2 * math.pi / 60, rel=1e-15)
    assert table.cases[0].condition.temperature == pytest.approx(298.15, rel=1e-15)
    assert table.cases[0].orders.tolist() == [1, 39, 40]  # growing
    expected = [cmath.rect(size * ARCSEC, math.radians(at)) for size, at in ((60, -0.5), (3, -90), (2, 30))]
    np.testing.assert_allclose(table.cases[0].waves, expected, rtol=1e-14)
    np.testing.assert_allclose(table.cases[1].waves, [-1.5 * ARCSEC], rtol=1e-14)
    assert all(case.sigma is None for case in table.cases)


def test_a_wave_is_what_the_design_says(tmp_path: Path) -> None:
    """amplitude cos(order theta + phase) is cos times cos(order theta) and sin times sin(order theta)."""
    polar = load(tmp_path, POLAR + "reverse,40,2,30\n").cases[0]
    plane = load(tmp_path, PLANE + f"reverse,40,{2 * math.cos(math.radians(30))!r},-1\n").cases[0]
    np.testing.assert_allclose(plane.waves, polar.waves, rtol=1e-14)
    theta = np.linspace(0, 1, 50)
    error = 2 * ARCSEC * np.cos(40 * theta + math.radians(30))
    np.testing.assert_allclose((polar.waves[0] * np.exp(40j * theta)).real, error, atol=1e-18)


@pytest.mark.parametrize(
    "content",
    [
        "# kind: orders\n# direction: reverse\n# output_torque: 20 N*m\n# input_speed: 100 rpm\n"
        "# temperature: 25 degC\norder,amplitude[arcsec],phase[deg]\n40,2,30\n",
        "#kind:  Orders\n# Direction: Reverse\n# output_torque: 20000 N*mm\n"
        "input_speed[rad/s],temperature[K],order,amplitude[deg],phase[rad]\n"
        f"{100 * math.pi / 30!r},298.15,40,{2 / 3600!r},{math.pi / 6!r}\n",
        "# kind: orders\n# output_torque: 20 N*m\ndirection,input_speed[deg/s],temperature[degC],output_torque[kN*m],"
        "order,amplitude[urad],phase[deg]\n"
        f'"reverse", 600 ,25,0.02,40,{2 * ARCSEC * 1e6!r},390\n# a remark\n\n',
    ],
    ids=["header", "core units", "other units, and a header that agrees"],
)
def test_conditions_from_header_or_columns_in_any_unit(tmp_path: Path, content: str) -> None:
    (case,) = load(tmp_path, content).cases
    assert case.condition.direction == -1
    assert case.condition.torque == pytest.approx(20e3, rel=1e-14)
    assert case.condition.input_speed == pytest.approx(100 * math.pi / 30, rel=1e-14)
    assert case.condition.temperature == pytest.approx(298.15, rel=1e-14)
    np.testing.assert_allclose(case.waves, [cmath.rect(2 * ARCSEC, math.pi / 6)], rtol=1e-13)


def test_the_same_text_in_other_clothes(tmp_path: Path) -> None:
    plain = load(tmp_path, GOOD)
    for text in ("\ufeff" + GOOD, GOOD.replace("\n", "\r\n"), GOOD.replace(",", " , "), GOOD.rstrip("\n")):
        same_waves(plain, load(tmp_path, text), rtol=0)


def test_conditions_that_are_not_told_are_not_known(tmp_path: Path) -> None:
    condition = load(tmp_path, POLAR + "forward,40,2,30\n").cases[0].condition
    assert condition == TableCondition(direction=1.0)


def test_sigma(tmp_path: Path) -> None:
    case = load(tmp_path, SIGMA + "forward,40,2,30,0.2\nforward,39,1,0,0.1\n").cases[0]
    np.testing.assert_allclose(case.sigma, [0.1 * ARCSEC, 0.2 * ARCSEC], rtol=1e-14)


def test_no_load_and_standstill_are_conditions(tmp_path: Path) -> None:
    condition = load(tmp_path, HEAD + NAMES + "forward,0,25,0,1,2,30\n").cases[0].condition
    assert (condition.torque, condition.input_speed) == (0.0, 0.0)


# --- what is left out, and counted ------------------------------------------------------------------------------------


@pytest.mark.parametrize("row", ["forward,39,,", "forward,39,-,0", "forward,39,nan,0", "forward,39,inf,0"])
def test_rows_without_a_number_are_left_out_and_counted(tmp_path: Path, row: str) -> None:
    table = load(tmp_path, POLAR + f"forward,40,2,30\n{row}\nforward,1,3,0\n")
    assert table.cases[0].orders.tolist() == [1, 40]
    assert table.notes == ("1 row without a number left out (line 4)",)


def test_a_condition_without_a_number_costs_its_row(tmp_path: Path) -> None:
    table = load(tmp_path, GOOD.replace("forward,100,25,300", "forward,100,25,?"))
    assert len(table.cases) == 2
    assert table.notes == ("1 row without a number left out (line 7)",)


def test_doubled_rows_are_left_out_and_counted(tmp_path: Path) -> None:
    table = load(tmp_path, POLAR + "forward,40,2,-180\nforward,40,2.0,180\nreverse,40,2,30\nforward,40.0,2,-180\n")
    assert [case.orders.tolist() for case in table.cases] == [[40], [40]]
    assert table.notes == ("2 doubled rows left out (lines 4, 6)",)


def test_columns_and_keys_without_a_meaning_are_noted(tmp_path: Path) -> None:
    table = load(tmp_path, "# kind: orders\n# temperatur: 5\n# bench: north\ndirection,order,amplitude[arcsec],"
                 "phase[deg],rank,comment\nforward,40,2,30,1,good\n")  # fmt: skip
    assert table.metadata["bench"] == "north"
    assert any("'temperatur' in line 2" in note and "did you mean 'temperature'?" in note for note in table.notes)
    assert "2 columns of the file left out, not asked for: 'rank', 'comment'" in table.notes
    assert len(table.notes) == 2


def test_a_column_of_sigma_without_any_number_is_noted(tmp_path: Path) -> None:
    table = load(tmp_path, SIGMA + "forward,40,2,30,\n")
    assert table.cases[0].sigma is None
    assert table.notes == ("sigma holds no number and is left out",)


# --- what is refused --------------------------------------------------------------------------------------------------

ROW = "forward,40,2,30\n"
WRONG = {
    "no kind": (POLAR.replace("# kind: orders\n", "# te: x\n") + ROW, ", line 1: ", "write '# kind: orders'"),
    "other kind": (POLAR.replace("orders", "runs") + ROW, ", line 1: kind = 'runs'", "must be orders"),
    "empty": ("", "the file is empty", "give one"),
    "no rows": (POLAR, ", line 2: no rows below the column names", "measure or export it"),
    "no direction": (
        "# kind: orders\norder,amplitude[arcsec],phase[deg]\n40,2,30\n",
        ", line 2: there is no direction",
        "write",
    ),
    "a direction": (POLAR + "foward,40,2,30\n", ", line 3: direction = 'foward'", "did you mean 'forward'?"),
    "mixed": (
        "# kind: orders\n# direction: mixed\norder,cos[deg],sin[deg]\n1,1,1\n",
        ", line 2: direction = 'mixed'",
        "must be forward or reverse",
    ),
    "no direction in a cell": (POLAR + ROW + ",39,2,30\n", ", line 4: direction = ''", "forward or reverse"),
    "two directions": (
        "# kind: orders\n# direction: reverse\n" + POLAR[15:] + ROW,
        ", line 4: direction = forward, but line 2 says reverse",
        "leave one",
    ),
    "order 0": (POLAR + ROW + "forward,0,2,30\n", ", line 4: order = 0: must be above 0", "must be"),
    "order below 0": (POLAR + "forward,-40,2,30\n", ", line 3: order = -40: must be above 0", "must be"),
    "order a word": (POLAR + "forward,mean,2,30\n", ", line 3: order is no number", "delete the row"),
    "order nan": (POLAR + "forward,nan,2,30\n", ", line 3: order is no number", "delete the row"),
    "no order": (
        "# kind: orders\ndirection,ordr,cos[deg],sin[deg]\nforward,1,1,1\n",
        ", line 2: there is no order",
        "did you mean 'order' by 'ordr'?",
    ),
    "no phase column": (
        "# kind: orders\ndirection,order,amplitude[arcsec]\nforward,40,2\n",
        ", line 2: amplitude without phase",
        "give phase[deg]",
    ),
    "no amplitude column": (
        "# kind: orders\ndirection,order,phase[deg]\nforward,40,2\n",
        ", line 2: phase without amplitude",
        "give amplitude[arcsec]",
    ),
    "neither": (
        "# kind: orders\ndirection,order\nforward,40\n",
        ", line 2: there is no amplitude and no cos",
        "give amplitude",
    ),
    "an empty phase": (POLAR + ROW + "forward,39,2,\n", ", line 4: amplitude without phase", "give phase as a number"),
    "amplitude below 0": (
        POLAR + "forward,40,-2,30\n",
        ", line 3: amplitude = -2 arcsec: must be 0 or more",
        "180 deg",
    ),
    "cos alone": (
        "# kind: orders\ndirection,order,cos[arcsec]\nforward,40,2\n",
        ", line 2: cos without sin",
        "give both",
    ),
    "sin alone": (
        "# kind: orders\ndirection,order,sin[arcsec]\nforward,40,2\n",
        ", line 2: sin without cos",
        "give both",
    ),
    "an empty sin": (PLANE + "forward,40,2,\n", ", line 3: cos without sin", "give sin as a number"),
    "an empty cos": (PLANE + "forward,40,,2\n", ", line 3: sin without cos", "give cos as a number"),
    "both forms": (
        "# kind: orders\ndirection,order,amplitude[deg],phase[deg],cos[deg],sin[deg]\nforward,1,1,1,1,1\n",
        ", line 2: amplitude and phase beside cos and sin",
        "leave one form",
    ),
    "no unit": (
        POLAR.replace("[arcsec]", "") + ROW,
        ", line 2, column 3: amplitude has no unit",
        "write 'amplitude[arcsec]'",
    ),
    "another dimension": (
        POLAR.replace("[arcsec]", "[mm]") + ROW,
        ", line 2, column 3: amplitude: 'mm' is no unit of angle",
        "write 'amplitude[arcsec]'",
    ),
    "percent": (POLAR.replace("[deg]", "[percent]") + ROW, "'percent' is no unit of angle", "write 'phase[deg]'"),
    "no torque's unit": (
        GOOD.replace("[N*m]", "[N]"),
        ", line 3, column 4: output_torque: 'N' is no unit of torque",
        "write 'output_torque[N*m]'",
    ),
    "no speed's unit": (
        GOOD.replace("[rpm]", "[Hz]"),
        ", line 3, column 2: input_speed: 'Hz' is no unit of angular speed",
        "write 'input_speed[rpm]'",
    ),
    "an order's unit": (
        POLAR.replace("order,", "order[Hz],") + ROW,
        ", line 2, column 2: order has no unit",
        "write 'order'",
    ),
    "a header's unit": (
        "# output_torque: 20\n" + POLAR + ROW,
        ", line 1: output_torque: '20' has no unit",
        "write it like",
    ),
    "twice": (
        POLAR + ROW + "reverse,40,9,9\nforward,40,2,31\n",
        ", line 5: order 40 stands in line 3 with another wave",
        "leave one",
    ),
    "twice, another sigma": (
        SIGMA + "forward,40,2,30,1\nforward,40,2,30,2\n",
        ", line 4: order 40 stands in line 3",
        "leave one",
    ),
    "header and column": (
        "# output_torque: 300 N*m\n" + GOOD,
        ", line 5: output_torque = 200 N*m, but line 1 says 300 N*m",
        "leave one",
    ),
    "torque below 0": (
        GOOD.replace("25,300", "25,-300"),
        ", line 7: output_torque = -300 N*m: must be 0 or more",
        "give its size",
    ),
    "speed below 0": (
        GOOD.replace("forward,100,25,300", "forward,-100,25,300"),
        ", line 7: input_speed = -100 rpm: must be 0 or more",
        "give its size",
    ),
    "too cold": (
        GOOD.replace("25,300", "-300,300"),
        ", line 7: temperature = -300 degC: lies below absolute zero",
        "check",
    ),
    "sigma 0": (SIGMA + "forward,40,2,30,0\n", ", line 3: sigma = 0 arcsec: must be above 0", "leave the column out"),
    "sigma below 0": (
        SIGMA + "forward,40,2,30,-1\n",
        ", line 3: sigma = -1 arcsec: must be above 0",
        "leave the column out",
    ),
    "sigma in some rows": (
        SIGMA + "forward,40,2,30,1\nforward,39,2,30,\n",
        ", line 4: no sigma, but other rows have one",
        "give it in every row or in none",
    ),
    "nothing usable": (
        POLAR + "forward,40,,\nforward,39,-,3\n",
        "no usable rows (lines 3, 4)",
        "give 1 or more with a number",
    ),
    "a short row": (POLAR + ROW + "forward,40,2\n", ", line 4: 3 cells, but 4 column names", "complete the row"),
    "a column twice": (
        POLAR.replace("order,", "order,order,") + "forward,1,1,1,1\n",
        ", line 2, column 3: 'order' and column 2 are both order",
        "leave one",
    ),
    "a key among the rows": (
        POLAR + ROW + "# direction: reverse\n" + ROW,
        ", line 4: direction stands among the rows",
        "write it above the column names",
    ),
    "a key twice": (
        "# temperature: 5 degC\n# temperature: 6 degC\n" + POLAR + ROW,
        ", line 2: temperature = '6 degC', but line 1 says '5 degC'",
        "leave one",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_said_in_one_line(tmp_path: Path, name: str) -> None:
    content, what, remedy = WRONG[name]
    line = refused(tmp_path, content)
    assert what in line
    assert remedy in line


@given(st.binary(max_size=200), st.integers(0, len(GOOD)))
def test_damaged_files_are_read_or_refused_in_one_line(tmp_path_factory: Any, junk: bytes, at: int) -> None:
    path = tmp_path_factory.getbasetemp() / "damaged-orders.csv"
    raw = GOOD.encode()
    path.write_bytes(raw[:at] + junk + raw[at:])
    told = ""
    try:
        load_orders(path)
    except InputError as problem:
        told = str(problem)
    assert told == "" or told.startswith(str(path))
    assert "\n" not in told


# --- wherever a run file is taken -------------------------------------------------------------------------------------


def test_load_run_reads_a_table_where_the_header_says_so(tmp_path: Path) -> None:
    path = tmp_path / "orders.csv"
    path.write_text(GOOD, encoding="utf-8")
    assert is_order_file(path)
    found = load_run(path)
    assert isinstance(found, OrderTable)
    same_waves(found, load_orders(path), rtol=0)
    assert isinstance(load_run(path, mapping=rverror.runs.load_mapping(mapping(tmp_path))), OrderTable)
    for given_mapping in (None, mapping(tmp_path)):
        with pytest.raises(InputError, match=r"orders\.csv: an order table holds no samples, .* give a run file here"):
            read_run(path, mapping=given_mapping)


def mapping(folder: Path) -> Path:
    path = folder / "bench.toml"
    path.write_text('[columns]\noutput_angle = { name = "a", unit = "deg" }\nte = { name = "b", unit = "deg" }\n')
    return path


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b"# kind: orders\n", True),
        (b"\xef\xbb\xbf\n# remark\n#Kind : ORDERS \r\na,b\n", True),
        (b"# kind: runs\n# kind: orders\n", False),
        (b"a,b\n# kind: orders\n", False),
        (b"", False),
        (b"\x00\xff\n", False),
    ],
)
def test_what_an_order_file_is(tmp_path: Path, content: bytes, expected: bool) -> None:
    (tmp_path / "x").write_bytes(content)
    assert is_order_file(tmp_path / "x") is expected


@pytest.mark.parametrize("path", ["no-such-file", ".", "a\0b"])
def test_what_cannot_be_read_is_no_order_file(path: str) -> None:
    assert not is_order_file(path)


# --- tables in memory -------------------------------------------------------------------------------------------------


def test_arrays_make_what_a_file_makes(tmp_path: Path) -> None:
    made = orders_from_arrays(
        direction=["forward", "forward", "reverse", 1, 1.0],
        torque=np.array([200, 200, 200, 300, 200]) * 1e3,
        input_speed="100 rpm",
        temperature="25 degC",
        order=[40, 1, 40, 40, 39],
        amplitude=np.array([2, 60, 1.5, 2.5, 3]) * ARCSEC,
        phase=np.radians([30, -0.5, 180, 45, -90]),
        index="unknown",
    )
    same_waves(load(tmp_path, GOOD), made)
    assert (made.path, made.index) == ("", "unknown")


def test_arrays_may_be_quantities() -> None:
    import pint

    unit = pint.UnitRegistry()
    table = orders_from_arrays(
        direction=-1, order=[40.0], cos=[2.0] * unit.arcsec, sin=[-1.0] * unit.arcsec, sigma=[0.1] * unit.arcsec,
        torque=[20.0] * unit("N*m"), input_speed=100.0 * unit("rpm"), temperature=unit.Quantity([25.0], "degC"),
    )  # fmt: skip
    (case,) = table.cases
    np.testing.assert_allclose(case.waves, [(2 + 1j) * ARCSEC], rtol=1e-14)
    np.testing.assert_allclose(case.sigma, [0.1 * ARCSEC], rtol=1e-14)
    assert case.condition.torque == pytest.approx(20e3)
    assert case.condition.temperature == pytest.approx(298.15)
    assert case.condition.input_speed == pytest.approx(100 * math.pi / 30)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"direction": "mixed"}, "direction = 'mixed': must be 'forward' or 'reverse'"),
        ({"direction": 0}, "direction = 0: must be 'forward' or 'reverse'"),
        ({"direction": True}, "direction = True: must be"),
        ({"direction": None}, "direction = None: must be"),
        ({"direction": [1]}, r"the columns differ in length .*direction 1.* give all the same"),
        ({"order": [40, 0]}, "row 1: order = 0: must be above 0"),
        ({"order": [40, np.nan]}, "row 1: order is no number"),
        ({"order": [40, 40]}, "row 1: order 40 stands in row 0 with another wave"),
        ({"order": 40}, "order has the shape"),
        ({"order": ["x", "y"]}, "order holds something that is no number"),
        ({"sin": None}, "columns: cos without sin"),
        ({"sin": [0, np.nan]}, "row 1: cos without sin"),
        ({"cos": [np.nan] * 2, "sin": [np.nan] * 2}, "no usable rows"),
        ({"amplitude": [1, 1]}, "amplitude beside cos and sin"),
        ({"cos": None, "sin": None}, "no amplitude and no cos"),
        ({"torque": "20 mm"}, "torque: 'mm' is no unit of torque"),
        ({"torque": -1}, "all rows: output_torque = -0.001 N\\*m: must be 0 or more"),
        ({"torque": [1, -1]}, "row 1: output_torque = -0.001 N\\*m: must be 0 or more"),
        ({"temperature": -1.0}, "below absolute zero"),
        ({"sigma": [1, 0]}, "row 1: sigma = 0 arcsec: must be above 0"),
        ({"sigma": [1, np.nan]}, "row 1: no sigma, but other rows have one"),
        ({"order": [], "cos": [], "sin": [], "direction": []}, "no usable rows; give 1 or more"),
    ],
)
def test_wrong_arrays_are_refused_in_one_line(change: dict[str, Any], told: str) -> None:
    good: dict[str, Any] = {"direction": "forward", "order": [40, 39], "cos": [1e-5, 0], "sin": [0, 1e-5]}
    orders_from_arrays(**good)
    with pytest.raises(InputError, match=f"^order table: .*{told}") as caught:
        orders_from_arrays(**good | change)
    assert "\n" not in str(caught.value)
    assert REMEDY.search(str(caught.value)), caught.value


def test_rows_without_a_number_are_counted_in_memory_too() -> None:
    table = orders_from_arrays(direction=1, order=[40, 39], cos=[1e-5, np.nan], sin=[0, np.nan])
    assert table.notes == ("1 row without a number left out (row 1)",)


# --- what is written --------------------------------------------------------------------------------------------------


@st.composite
def tables(draw: st.DrawFn) -> OrderTable:
    """Tables of any number of cases; a condition is known in all of them or in none."""
    sizes = {
        "torque": st.integers(0, 10**9).map(lambda n: n / 128),
        "input_speed": st.integers(0, 10**7).map(lambda n: n / 1024),
        "temperature": st.integers(1, 10**6).map(lambda n: n / 512),
    }
    known = {name: draw(st.booleans()) for name in sizes}
    conditions = draw(
        st.lists(
            st.builds(
                TableCondition,
                direction=st.sampled_from([1.0, -1.0]),
                **{name: sizes[name] if known[name] else st.none() for name in sizes},
            ),
            min_size=1,
            max_size=5,
            unique=True,
        )
    )
    with_sigma = draw(st.booleans())
    angles = st.floats(-1e-3, 1e-3, allow_subnormal=False)
    cases = []
    for condition in conditions:
        orders = sorted(draw(st.sets(st.integers(1, 4000).map(lambda n: n / 8), min_size=1, max_size=6)))
        cos, sin = ([draw(angles) for _ in orders] for _ in range(2))
        sigma = [draw(st.floats(1e-9, 1e-5)) for _ in orders] if with_sigma else None
        cases.append(
            OrderCase(
                condition=condition,
                orders=np.array(orders),
                waves=np.array(cos) - 1j * np.array(sin),
                sigma=None if sigma is None else np.array(sigma),
            )
        )
    return OrderTable(cases=tuple(cases), index=draw(st.sampled_from(["", "unknown", "A 1"])), metadata={"bench": "B"})


@given(tables())
def test_a_table_comes_back_from_its_file(tmp_path_factory: Any, table: OrderTable) -> None:
    path = tmp_path_factory.getbasetemp() / "round-trip.csv"
    write_orders(path, table, overwrite=True)
    back = load_orders(path)
    same_waves(table, back)
    assert back.index == table.index
    assert back.metadata["bench"] == "B"
    assert back.notes == ()


def test_an_existing_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "orders.csv"
    table = load(tmp_path, GOOD)
    with pytest.raises(InputError, match=r"orders\.csv: the file exists"):
        write_orders(path, table)
    assert path.read_text(encoding="utf-8") == GOOD
    write_orders(path, table, overwrite=True)
    same_waves(load_orders(path), table)


def test_text_for_people(tmp_path: Path) -> None:
    """Numbers as they were written, not with the last digits of a conversion."""
    lines = orders_text(load(tmp_path, GOOD)).splitlines()
    assert lines[:3] == ["# kind: orders", "# index: unknown", NAMES.rstrip()]
    assert lines[3].startswith("forward,100,25,200,1,")
    assert len(lines) == 3 + len(ROWS.splitlines())


def case(direction: float = 1.0, sigma: float | None = None, waves: Any = (1e-5,), **condition: Any) -> OrderCase:
    return OrderCase(
        condition=TableCondition(direction=direction, **condition),
        orders=np.array([40.0]),
        waves=np.array(waves, dtype=complex),
        sigma=None if sigma is None else np.array([sigma]),
    )


@pytest.mark.parametrize(
    ("cases", "told"),
    [
        ((), "no usable rows"),
        ((case(torque=1.0), case(-1.0)), "1 of 2 cases have no torque, others have; complete them"),
        ((case(sigma=1e-6), case(-1.0)), "1 of 2 cases have no sigma, others have; complete them"),
        ((case(sigma=0.0),), "must be above 0"),
        ((case(2.0),), "direction = 2.0: must be"),
        ((case(torque=-1.0),), "must be 0 or more"),
        ((case(torque=math.nan),), "not finite"),
        ((case(waves=[math.nan]),), "not finite"),
        ((case(waves=[1e-5, 1e-5]),), "differ in length"),
        ((case(), case(waves=[2e-5])), "with another wave under the same condition"),
    ],
)
def test_a_table_that_would_not_read_back_is_not_written(
    tmp_path: Path, cases: tuple[OrderCase, ...], told: str
) -> None:
    with pytest.raises(InputError, match=re.escape(told)):
        write_orders(tmp_path / "x.csv", OrderTable(cases=cases))
    assert not (tmp_path / "x.csv").exists()


@pytest.mark.parametrize(("key", "value"), [("a: b", "x"), ("a", "x\ny"), ("1", "x"), ("", "x")])
def test_a_header_that_would_not_read_back_is_not_written(key: str, value: str) -> None:
    with pytest.raises(InputError, match="would not read back"):
        orders_text(OrderTable(cases=(case(),), metadata={key: value}))


# --- a real reducer ---------------------------------------------------------------------------------------------------
# Measured by Bilancia et al., Robotics and Computer-Integrated Manufacturing 2025, 10.1016/j.rcim.2024.102838.


@pytest.mark.parametrize("degrees", [25, 30])
def test_the_loads_of_a_real_reducer(degrees: int) -> None:
    """19 loads both ways, nine orders each; order 1 comes from outside the gear train: one size at every load."""
    table = load_orders(recording("rv-81to1", f"loads-100rpm-{degrees}degC.csv"))
    assert len(table.cases) == 38
    assert table.index == "unknown"
    assert table.notes == ()
    for found in table.cases:
        assert found.orders.tolist() == [1, 3, 39, 40, 78, 81, 156, 162, 240]
        assert found.condition.temperature == pytest.approx(273.15 + degrees)
        assert found.condition.input_speed == pytest.approx(100 * math.pi / 30)
        assert np.abs(found.waves[0]) / ARCSEC == pytest.approx(61.7, abs=2.5)


def test_order_78_of_a_real_reducer_grows_with_the_load() -> None:
    """5 arcsec per 1000 N*m in both directions."""
    table = load_orders(recording("rv-81to1", "loads-100rpm-25degC.csv"))
    for direction in (1.0, -1.0):
        loaded = [c for c in table.cases if c.condition.direction == direction and (c.condition.torque or 0) >= 200e3]
        torque = np.array([c.condition.torque for c in loaded]) / 1e6
        waves = np.array([c.waves[4] for c in loaded]) / ARCSEC
        slope = np.linalg.lstsq(np.stack([np.ones_like(torque), torque], axis=1), waves, rcond=None)[0][1]
        assert abs(slope) == pytest.approx(5.0, abs=0.5)
