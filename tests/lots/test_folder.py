"""A folder of units: what is read, in which order, with which labels, and one line for what cannot be."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

import pytest

import rverror
from rverror import InputError
from rverror.lots.folder import lot_units

DEMO = resources.files("rverror") / "data" / "demo"
RUN = (DEMO / "forward.csv").read_text(encoding="utf-8")


@pytest.fixture
def model() -> rverror.Model:
    return rverror.load_model(DEMO / "model.toml")  # type: ignore[arg-type]


def put(root: Path, *serials: str, table: str | None = None) -> Path:
    for serial in serials:
        (root / serial).mkdir(parents=True)
        (root / serial / "forward.csv").write_text(RUN, encoding="utf-8")
    if table is not None:
        (root / "units.csv").write_text(table, encoding="utf-8")
    return root


def test_names_are_in_natural_order(tmp_path: Path, model: rverror.Model) -> None:
    """Hidden files and folders, files beside the units and folders without runs are none of them."""
    put(tmp_path, "u10", "u2", "U1", ".hidden")
    (tmp_path / "u2" / ".forward.csv").write_text("no run", encoding="utf-8")
    (tmp_path / "u2" / "photo.png").write_bytes(b"\x89PNG")
    (tmp_path / "empty").mkdir()
    (tmp_path / "readme.txt").write_text("notes", encoding="utf-8")
    units, notes = lot_units(tmp_path, model)
    assert [unit.serial for unit in units] == ["U1", "u2", "u10"]
    assert [len(unit.runs) for unit in units] == [1, 1, 1]
    assert all(unit.labels == {} for unit in units)
    assert notes == ()


@pytest.mark.parametrize(("comma", "ends", "mark"), [(",", "\n", ""), (";", "\r\n", "\ufeff")])
def test_the_table_has_order_and_labels(tmp_path: Path, model: rverror.Model, comma: str, ends: str, mark: str) -> None:
    rows = [
        "# made in March",
        "date,Serial,machine",
        '2026-03-01,b,"A, old"',
        " 2026-03-02 ,a",
        "# pause",
        ",gone,B",
        "",
    ]
    rows = [row if '"' in row else row.replace(",", comma) for row in rows]
    rows[2] = rows[2].replace(",b,", f"{comma}b{comma}")
    put(tmp_path, "a", "b", "c2", "c10", table=mark + ends.join(rows))
    units, notes = lot_units(tmp_path, model)
    assert [unit.serial for unit in units] == ["b", "a", "c2", "c10"]
    assert units[0].labels == {"date": "2026-03-01", "machine": "A, old"}
    assert units[1].labels == {"date": "2026-03-02"}
    assert units[2].labels == {}
    table = tmp_path / "units.csv"
    assert notes == (
        f"left out: 1 unit in {table} without a folder of runs (gone)",
        f"without labels: 2 units not in {table}; they stand last (c2, c10)",
    )


def test_with_a_mapping_runs_have_other_endings(tmp_path: Path, model: rverror.Model) -> None:
    put(tmp_path, "a")
    (tmp_path / "a" / "forward.csv").rename(tmp_path / "a" / "forward.TXT")
    mapping = tmp_path / "bench.toml"
    columns = [f'{name} = {{ name = "{name}[deg]", unit = "deg" }}' for name in ("input_angle", "output_angle")]
    mapping.write_text("\n".join(["[columns]", *columns, ""]), encoding="utf-8")
    with pytest.raises(InputError, match="no subfolder holds a run"):
        lot_units(tmp_path, model)
    units, _ = lot_units(tmp_path, model, mapping)
    assert len(units[0].runs) == 1


HOSTILE = {
    "no column 'serial'": "date,machine\n1,A\n",
    "did you mean 'serials'": "serials,machine\na,A\n",
    "line 3: serial 'a' stands above too": "serial,machine\na,A\na,B\n",
    "line 2: 3 cells for 2 columns": "serial,machine\na,A,B\n",
    "line 2: no serial": "serial,machine\n,A\n",
    "two columns 'machine'": "serial,machine,Machine\na,A,B\n",
    "the table is empty": "# nothing\n\n",
    "correct the quotes": 'serial,machine\na,"A\n',
}


@pytest.mark.parametrize("said", HOSTILE)
def test_a_table_that_is_none_is_refused_in_one_line(tmp_path: Path, model: rverror.Model, said: str) -> None:
    put(tmp_path, "a", table=HOSTILE[said])
    with pytest.raises(InputError) as problem:
        lot_units(tmp_path, model)
    assert said in str(problem.value)
    assert str(problem.value).startswith(str(tmp_path / "units.csv"))
    assert "\n" not in str(problem.value)


def test_a_folder_without_units_is_refused(tmp_path: Path, model: rverror.Model) -> None:
    with pytest.raises(InputError, match="cannot read the folder"):
        lot_units(tmp_path / "none", model)
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match=r"no subfolder holds a run \(.csv\); give a folder with one subfolder"):
        lot_units(tmp_path, model)


def test_a_run_that_cannot_be_used_is_named(tmp_path: Path, model: rverror.Model) -> None:
    """Order tables, runs of another ratio, names that cannot be printed."""
    put(tmp_path, "a", "b")
    path = tmp_path / "b" / "forward.csv"
    path.write_text("# kind: orders\ndirection,order,cos[arcsec],sin[arcsec]\nforward,1,1,0\n", encoding="utf-8")
    with pytest.raises(InputError, match="order") as problem:
        lot_units(tmp_path, model)
    assert str(problem.value).startswith(str(path))
    path.write_text(RUN, encoding="utf-8")
    with pytest.raises(InputError, match="ratio") as problem:
        lot_units(tmp_path, rverror.Model(rverror.Drive(ratio=10.0)))
    assert str(tmp_path / "a" / "forward.csv") in str(problem.value)
    put(tmp_path, "c\x07")
    with pytest.raises(InputError, match="cannot be printed"):
        lot_units(tmp_path, model)
