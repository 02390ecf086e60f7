"""The command read, drafts of mappings, and --mapping where runs are diagnosed."""

from __future__ import annotations

import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from bench_files import INPUT, OUTPUT, TIME, N, hdf5, mat, tdms
from pages import ROOT
from rverror.app import command_line as cli, diagnose_folder
from rverror.app.command_line import main
from rverror.base.errors import InputError
from rverror.runs.bench.draft import draft_mapping
from rverror.runs.bench.mapping import load_mapping
from rverror.runs.measurement import load_run

#: A worm gear with an order of its worm that its model does not declare.
TURN = np.linspace(0, 6, 1500)
WORM_TE = 30 / 3600 * np.sin(2 * np.pi * TURN) + 1e-4 * np.random.default_rng(3).normal(size=TURN.size)
MODEL = "[drive]\nratio = 100.0\n[drive.shafts]\nworm = 100.0\n"
MAPPING = """
[file]
encoding = "cp1252"
[columns]
input_angle = { name = "Schnecke [°]", unit = "deg" }
te = { name = "Fehler ['']", unit = "arcsec" }
"""


def german(folder: Path, name: str = "run.csv", preamble: str = "Prüfstand 3;;\nLast;20 N*m;\n") -> Path:
    rows = "".join(f"{360 * a:.5f};{3600 * e:.4f}\n" for a, e in zip(TURN, WORM_TE, strict=True)).replace(".", ",")
    file = folder / name
    file.write_bytes((preamble + "Schnecke [°];Fehler ['']\n" + rows).encode("cp1252"))
    return file


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    german(tmp_path)
    (tmp_path / "bench.toml").write_text(MAPPING, encoding="utf-8")
    (tmp_path / "worm.toml").write_text(MODEL)
    return tmp_path


def refused(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    assert main(list(arguments)) == 2
    out, err = capsys.readouterr()
    assert out == ""
    lines = err.splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("rverror: error: ")
    return lines[0]


# --- read -------------------------------------------------------------------------------------------------------------


def test_read_writes_a_run_file_that_is_the_run(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["read", "run.csv", "--mapping", "bench.toml", "-o", "out.csv"]) == 0
    out, err = capsys.readouterr()
    assert out == ""
    notes = [line.removeprefix("rverror: run.csv: ") for line in err.splitlines() if "run.csv: " in line]
    assert "separator found in line 3: semicolon" in notes
    assert err.splitlines()[-1] == "rverror: wrote out.csv"
    plain = load_run("out.csv")
    read = load_run("run.csv", mapping="bench.toml")
    np.testing.assert_allclose(plain.input_angle, read.input_angle, rtol=1e-13)
    np.testing.assert_allclose(plain.te_column, read.te_column, rtol=1e-13)
    assert plain.metadata == {"direction": "forward"}  # no note is read back as a value
    lines = (bench / "out.csv").read_text().splitlines()
    assert lines[0] == "# (read from run.csv by bench.toml)"
    assert [line[3:-1] for line in lines[1:] if line.startswith("# (")] == notes

    assert main(["read", "run.csv", "--mapping", "bench.toml"]) == 0
    assert capsys.readouterr().out == (bench / "out.csv").read_text()
    assert main(["read", "out.csv", "-o", "again.csv"]) == 0
    assert "# (read from out.csv)\n" in (bench / "again.csv").read_text()
    assert main(["read", "out.csv", "-o", "again.csv"]) == 0
    assert "replacing again.csv" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("read run.csv", ("run.csv, line 1", "no UTF-8", "mapping", "--draft")),
        ("read none.csv --mapping bench.toml", ("none.csv", "no such file")),
        ("read run.csv --mapping none.toml", ("none.toml", "no such file")),
        ("read run.csv --mapping worm.toml", ("worm.toml, line 1", "unknown table of a mapping 'drive'")),
        ("read run.csv --mapping bench.toml -o bench.toml", ("bench.toml", "also an input")),
        ("read run.csv --mapping bench.toml -o run.csv", ("run.csv", "also an input")),
        ("read run.csv --mapping bench.toml -o none/out.csv", ("none/out.csv", "no folder")),
        ("read run.csv --mapping bench.toml --draft", ("--draft", "leave out")),
        ("read . --mapping bench.toml", ("folder", "give a file")),
        ("diagnose worm.toml run.csv --mapping none.toml", ("none.toml", "no such file")),
        ("diagnose worm.toml run.csv --mapping bench.toml --json bench.toml", ("bench.toml", "also an input")),
        ("diagnose worm.toml run.csv", ("run.csv, line 1", "--draft")),
        ("diagnose-batch . --out out --mapping none.toml", ("none.toml", "no such file")),
    ],
)
def test_refused_in_one_line(
    bench: Path, capsys: pytest.CaptureFixture[str], arguments: str, words: tuple[str, ...]
) -> None:
    before = (bench / "bench.toml").read_bytes()
    line = refused(capsys, *arguments.split())
    for word in words:
        assert word in line
    assert (bench / "bench.toml").read_bytes() == before


def test_names_that_cannot_be_printed(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "rename the file" in refused(capsys, "read", "a\nb.csv")
    assert "rename the file" in refused(capsys, "read", "run.csv", "--mapping", "a\nb.toml")


# --- drafts -----------------------------------------------------------------------------------------------------------


def test_a_draft_is_filled_in_and_read(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The stranger's way: draft, refused while empty, names copied from its remarks, read."""
    assert main(["read", "run.csv", "--draft", "-o", "new.toml"]) == 0
    capsys.readouterr()
    text = (bench / "new.toml").read_text(encoding="utf-8")
    assert '#   "Schnecke [°]"  unit °' in text
    assert "#   'Last;20 N*m;'" in text
    line = text.splitlines().index(next(each for each in text.splitlines() if each.startswith("input_angle"))) + 1
    assert f"new.toml, line {line}: name is empty" in refused(capsys, "read", "run.csv", "--mapping", "new.toml")
    text = text.replace('name = ""', 'name = "Schnecke [°]"', 1).replace(
        'output_angle = { name = "", unit = "deg" }', ""
    )
    text = text.replace('# te = { name = ""', "te = { name = \"Fehler ['']\"")
    text = text.replace('# output_torque = "20 N*m"', "output_torque = { property = 'Last' }")
    (bench / "new.toml").write_text(text, encoding="utf-8")
    run = load_run("run.csv", mapping="new.toml")
    np.testing.assert_allclose(run.te_column, np.radians(WORM_TE), atol=1e-9)
    assert run.torque == pytest.approx(20e3)
    assert not any("found" in note and "names" not in note for note in run.notes)  # the draft states it all


@pytest.mark.parametrize(
    ("content", "lines"),
    [
        ("a,b\n1.5,2.5\n2,3\n3,4\n", ['separator = ","', 'decimal = "."', '#   "a"', '#   "b"']),
        ("x\n\na b\n 1.5  2\n2 3\n3 4\n", ['separator = " "', 'decimal = "."', '#   "a"']),
        ("x\ty\nangle\ttime\n[°]\tms\n1,5\t2\n2\t3\n3\t4\n",
         ['separator = "\\t"', 'decimal = ","', '#   "angle"  unit °', '#   "time"  unit ms']),
        ("1;2\n2;3\n3;4\n", ["skip = 0", '#   "column 1"',
                              "# No names stand above the numbers: write column = 1, 2, ... instead of name."]),
        ("% a;b\n1;2\n2;3\n3;4\n", ['#   "a"', '#   "b"']),
        ("a;b\n1,234;2\n2;3\n3;4\n",
         ["decimal = \"\"  # '1,234' may be 1.234 or 1234: write \".\" or \",\""]),
        ('"a\\b";"c""d"\n1;2\n2;3\n3;4\n', ['#   "a\\\\b"', '#   "c\\"d"']),
    ],
)  # fmt: skip
def test_what_a_draft_finds_in_text(tmp_path: Path, content: str, lines: list[str]) -> None:
    file = tmp_path / "run.txt"
    file.write_text(content, encoding="utf-8")
    draft = draft_mapping(file).splitlines()
    for line in lines:
        assert line in draft


def test_drafts_of_other_formats(tmp_path: Path) -> None:
    file = hdf5(tmp_path, **{"m/wide": np.zeros((2, 3)), "m/tall": np.zeros((3, 2))})
    assert '#   "in"  240 samples' in draft_mapping(file)
    assert '#   "m/wide/2"  3 samples' in draft_mapping(file)
    assert '#   "m/tall/2"  3 samples' in draft_mapping(file)
    assert '#   "G/in"  240 samples' in draft_mapping(tdms(tmp_path, root={"Last": 20.0}))
    assert "#   'Last = 20.0'" in draft_mapping(tdms(tmp_path, root={"Last": 20.0}))
    assert '#   "s/one"  1 sample\n' in draft_mapping(mat(tmp_path, s={"one": 1.0}))
    for content in (b"", b"nothing but words\n", b"5\n6\n7\n"):
        (tmp_path / "run.txt").write_bytes(content)
        with pytest.raises(InputError, match="no rows of two numbers or more"):
            draft_mapping(tmp_path / "run.txt")
    (tmp_path / "run.txt").write_bytes("a;b\n1;2\n2;3\n3;4\n".encode("utf-16"))
    assert 'encoding = "utf-16"' in draft_mapping(tmp_path / "run.txt")


def drafted_columns(file: Path, content: str) -> dict[str, str]:
    """Lines of [columns] that a draft fills in, by key."""
    file.write_text(content, encoding="utf-8")
    guessed = [line.partition(" = ") for line in draft_mapping(file).splitlines() if "# guessed" in line]
    return {key: value for key, _, value in guessed}


ROWS = "\n1,5;2,25;3\n2;3;4\n3;4;5\n"


@pytest.mark.parametrize(
    ("names", "input_angle", "output_angle"),
    [
        ("Antrieb [°];Abtrieb [°];Moment [Nm]", ("Antrieb [°]", "deg"), ("Abtrieb [°]", "deg")),
        ("Antriebswinkel (Grad);Abtriebswinkel (Grad);Antriebsdrehzahl (1/min)",
         ("Antriebswinkel (Grad)", "deg"), ("Abtriebswinkel (Grad)", "deg")),
        ("phi_in;phi_out;M", ("phi_in", ""), ("phi_out", "")),
        ("phi_an_rad;phi_ab_rad;n_an", ("phi_an_rad", "rad"), ("phi_ab_rad", "rad")),
        ("theta1 (rad);theta2 (rad);T", ("theta1 (rad)", "rad"), ("theta2 (rad)", "rad")),
        ("MotorAngle [deg];LoadAngle [deg];MotorSpeed", ("MotorAngle [deg]", "deg"), ("LoadAngle [deg]", "deg")),
        ("in;out;torque", ("in", ""), ("out", "")),
        ("input angle [rev];output angle [arcmin];x",
         ("input angle [rev]", "turn"), ("output angle [arcmin]", "arcmin")),
        ("motor encoder [counts];load encoder [counts];x",
         ("motor encoder [counts]", "counts"), ("load encoder [counts]", "counts")),
        ("angle entrée [°];angle sortie [°];couple", ("angle entrée [°]", "deg"), ("angle sortie [°]", "deg")),
        ("输入角度(deg);输出角度(deg);扭矩", ("输入角度(deg)", "deg"), ("输出角度(deg)", "deg")),
        ("Eingang;Ausgang;n\n[rad];[rad];[1/min]", ("Eingang", "rad"), ("Ausgang", "rad")),
        ("channel 1;channel 2;channel 3", None, None),  # 1 and 2 of anything
        ("input torque;output torque;load", None, None),
        ("Antrieb [Nm];Abtrieb [V];x", None, None),  # the unit says what it is
        ("motor frequency;input error;output elastic", None, None),
        ("motor;load;drive", None, None),  # a current and a torque, more often than not
        ("input output;angle;x", None, None),
    ],
)  # fmt: skip
def test_a_draft_guesses_angles_by_the_names_of_shafts(
    tmp_path: Path, names: str, input_angle: tuple[str, str] | None, output_angle: tuple[str, str] | None
) -> None:
    columns = drafted_columns(tmp_path / "run.txt", names + ROWS)
    for key, expected in (("input_angle", input_angle), ("output_angle", output_angle)):
        if expected is None:
            assert key not in columns
            continue
        name, unit = expected
        assert columns[key].startswith(f'{{ name = "{name}", unit = "{unit}"')
        assert ("write its unit" in columns[key]) == (not unit)
        assert ("counts_per_turn = 0" in columns[key]) == (unit == "counts")


def test_columns_that_fit_alike_are_left_to_the_reader(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (bench / "two.txt").write_text("Motor A [°];Motor B [°];Abtrieb [°]" + ROWS, encoding="utf-8")
    assert main(["read", "two.txt", "--draft", "-o", "two.toml"]) == 0
    err = capsys.readouterr().err.splitlines()
    assert err[0] == "rverror: two.txt: input_angle: not guessed, for 'Motor A [°]' and 'Motor B [°]' fit alike"
    assert err[1] == "rverror: two.txt: output_angle: guessed from the name 'Abtrieb [°]', unit deg"
    assert "# not guessed, for 'Motor A [°]' and 'Motor B [°]' fit alike:" in (bench / "two.toml").read_text("utf-8")
    assert "name is empty" in refused(capsys, "read", "two.txt", "--mapping", "two.toml")


def test_a_draft_of_plain_names_reads_the_file(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Nothing to fill in: the guess, confirmed by the one who hands it over, gives the angles."""
    rows = [f"12:00:{t:06.3f};{a:.6f};{b:.6f}".replace(".", ",") for t, a, b in zip(TIME, INPUT, OUTPUT, strict=True)]
    (bench / "run.txt").write_text("\n".join(["Uhrzeit;Antrieb [°];Abtrieb [°]", *rows]), encoding="utf-8")
    assert main(["read", "run.txt", "--draft", "-o", "new.toml"]) == 0
    assert capsys.readouterr().err.count("guessed from the name") == 3
    run = load_run("run.txt", 121.0, mapping="new.toml")
    np.testing.assert_allclose(np.degrees(run.input_angle), INPUT, atol=1e-6)
    np.testing.assert_allclose(np.degrees(run.output_angle), OUTPUT, atol=1e-6)
    np.testing.assert_allclose(run.time, TIME, atol=1e-4)


# --- diagnosis --------------------------------------------------------------------------------------------------------


def test_diagnosis_of_a_german_file(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Verdict, cause and size are those of the standard file of the same run."""
    arguments = ["diagnose", "worm.toml", "run.csv", "--mapping", "bench.toml", "--json", "found.json"]
    assert main(arguments) == 0
    assert "separator found in line 3" in capsys.readouterr().out
    found = json.loads((bench / "found.json").read_text())
    assert [Path(file["path"]).name for file in found["files"]] == ["worm.toml", "run.csv", "bench.toml"]
    assert main(["read", "run.csv", "--mapping", "bench.toml", "-o", "out.csv"]) == 0
    assert main(["diagnose", "worm.toml", "out.csv", "--json", "plain.json"]) == 0
    plain = json.loads((bench / "plain.json").read_text())
    assert (found["verdict"], found["before"]) == (plain["verdict"], pytest.approx(plain["before"]))
    assert [added["key"] for added in found["added"]] == [added["key"] for added in plain["added"]]
    assert found["added"], "the worm's order is there to be found"


def test_a_folder_of_units(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for unit, name in (("one", "run.csv"), ("two", "run.TXT")):
        (bench / "units" / unit).mkdir(parents=True)
        (bench / "units" / unit / "model.toml").write_text(MODEL)
        german(bench / "units" / unit, name)
    (bench / "units" / "two" / "notes.md").write_text("no run")
    with ThreadPoolExecutor(1) as here:
        batch = diagnose_folder("units", out="out", mapping="bench.toml", executor=here)
        assert [(each.unit, each.state) for each in batch.outcomes] == [("one", "diagnosed"), ("two", "diagnosed")]
        assert batch.outcomes[0].keys == batch.outcomes[1].keys != ()
        assert main(["diagnose-batch", "units", "--out", "out", "--mapping", "bench.toml"]) == 0
        assert "2 kept" in capsys.readouterr().out
        (bench / "bench.toml").write_text(MAPPING + "# another\n", encoding="utf-8")
        again = diagnose_folder("units", out="out", mapping="bench.toml", executor=here)
        assert [each.state for each in again.outcomes] == ["diagnosed"] * 2
        without = diagnose_folder("units", out="none", executor=here)  # the text is none then, and .TXT no run
    assert "no UTF-8" in without.outcomes[0].error
    assert "no run beside the model" in without.outcomes[1].error


def test_a_mapping_named_as_the_model(bench: Path) -> None:
    (bench / "units" / "one").mkdir(parents=True)
    (bench / "units" / "one" / "model.toml").write_text(MODEL)
    (bench / "model.toml").write_text(MAPPING, encoding="utf-8")
    with pytest.raises(InputError, match="name of a unit's model; give the mapping another"):
        diagnose_folder("units", out="out", mapping="model.toml")
    with pytest.raises(InputError, match="no such file"):
        diagnose_folder("units", out="out", mapping="none.toml")


def test_the_shipped_mapping_reads_the_file_that_it_shows(tmp_path: Path) -> None:
    """The file in its remarks, with the rows of a run."""
    path = ROOT / "examples" / "bench-mapping.toml"
    counts = np.round(INPUT / 360 * 4000).astype(int)
    shown = [line.removeprefix("#").strip() for line in path.read_text(encoding="utf-8").splitlines()]
    start = next(i for i, line in enumerate(shown) if line.startswith("Prüfstand"))
    rows = [f"{t:.3f};{c};{-o:.5f};20.1;40.2".replace(".", ",") for t, c, o in zip(TIME, counts, OUTPUT, strict=True)]
    file = tmp_path / "run.csv"
    file.write_bytes("\n".join([*shown[start : start + 3], *rows]).encode("cp1252"))
    run = load_run(file, 121.0, load_mapping(path))
    np.testing.assert_allclose(np.degrees(run.output_angle), OUTPUT, atol=1e-5)
    np.testing.assert_allclose(np.degrees(run.input_angle), INPUT, atol=0.045)
    assert (run.torque, run.temperature) == (pytest.approx(20e3), pytest.approx(313.15))
    assert any("2 columns of the file left out" in note for note in run.notes)
    assert run.size == N
    first = "".join(shown[start + 3]).split(";")
    assert len(first) == 5


def test_help_names_the_mapping(capsys: pytest.CaptureFixture[str]) -> None:
    for command in ("read", "diagnose", "diagnose-batch"):
        with pytest.raises(SystemExit):
            cli.main([command, "--help"])
        assert "--mapping BENCH.toml" in " ".join(capsys.readouterr().out.split())
