"""A folder of units: what is done, kept, replaced and failed, and that each result is that of one diagnosis."""

from __future__ import annotations

import csv
import json
import os
import re
import shutil
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

import pytest

import rverror
from rverror import Drive, InputError, Model, effect, save_model, simulate
from rverror.app import batch, command_line as cli, diagnose_folder
from rverror.base.threads import threads
from rverror.runs import write_run

WORM = Drive(ratio=-14.0, shafts={"motor": 14.0, "idler": 3.5})
MOTOR = effect("shaft.eccentricity", shaft="motor", harmonic=1, cos="30 arcsec", sin="-10 arcsec")
IDLER = effect("shaft.eccentricity", shaft="idler", harmonic=1, cos="12 arcsec", sin="7 arcsec")


def measured(path: Path, *effects: rverror.Effect, direction: float = 1.0) -> None:
    run = simulate(Model(WORM, effects), points=64, revolutions=4, direction=direction)
    write_run(path, run, overwrite=True)


@pytest.fixture
def plant(tmp_path: Path) -> Path:
    """Three units: one lacks the idler's error, one lacks nothing, one has a run that is no run."""
    folder = tmp_path / "plant"
    for name in ("a-idler", "b-complete", "c-broken"):
        (folder / name).mkdir(parents=True)
        save_model(folder / name / "model.toml", Model(WORM, (MOTOR,)))
    measured(folder / "a-idler" / "forward.csv", MOTOR, IDLER)
    measured(folder / "a-idler" / "reverse.csv", MOTOR, IDLER, direction=-1.0)
    measured(folder / "b-complete" / "forward.csv", MOTOR)
    (folder / "c-broken" / "forward.csv").write_text("no run\n", encoding="utf-8")
    return folder


class Counting(ThreadPoolExecutor):
    """Threads that note the unit of each task."""

    def __init__(self) -> None:
        super().__init__(2)
        self.given: list[str] = []

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        self.given.append(args[0].folder.name)
        return super().submit(fn, *args, **kwargs)


def done(folder: Path, said: list[str] | None = None, **options: Any) -> tuple[batch.Batch, list[str]]:
    """Batch, and the units that were handed to the executor."""
    with Counting() as executor:
        told = None if said is None else said.append
        result = diagnose_folder(folder, out=folder.parent / "out", executor=executor, progress=told, **options)
    return result, executor.given


def states(result: batch.Batch) -> dict[str, str]:
    return {outcome.unit: outcome.state for outcome in result.outcomes}


def table(folder: Path) -> dict[str, dict[str, str]]:
    with (folder / "summary.csv").open(encoding="utf-8", newline="") as file:
        return {row["unit"]: row for row in csv.DictReader(file)}


def test_a_result_is_that_of_one_diagnosis(plant: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for other in ("b-complete", "c-broken"):  # alone, for threads side by side may share out BLAS in another way
        shutil.rmtree(plant / other)
    done(plant)
    unit = plant / "a-idler"
    alone = plant.parent / "alone.json"
    runs = [str(unit / "forward.csv"), str(unit / "reverse.csv")]
    assert cli.main(["diagnose", str(unit / "model.toml"), *runs, "--json", str(alone)]) == 0
    assert (plant.parent / "out" / "a-idler.json").read_bytes() == alone.read_bytes()


def test_summary(plant: Path) -> None:
    result, given = done(plant)
    assert sorted(given) == ["a-idler", "b-complete", "c-broken"]
    assert states(result) == {"a-idler": "diagnosed", "b-complete": "diagnosed", "c-broken": "failed"}
    out = plant.parent / "out"
    assert sorted(p.name for p in out.iterdir()) == ["a-idler.json", "b-complete.json", "summary.csv"]
    rows = table(out)
    assert list(rows) == ["a-idler", "b-complete", "c-broken"]
    assert (rows["a-idler"]["verdict"], rows["a-idler"]["keys"]) == ("explained", "shaft.eccentricity")
    # what the idler does was not declared: its rms is the amplitude by the root of two
    missing = (12**2 + 7**2) ** 0.5 / 2**0.5
    assert float(rows["a-idler"]["heldout_rms_before"]) == pytest.approx(missing, rel=0.02)
    assert float(rows["a-idler"]["heldout_rms_after"]) < 0.02 * missing
    assert rows["a-idler"]["rms_unit"] == "arcsec"
    assert (rows["b-complete"]["verdict"], rows["b-complete"]["keys"]) == ("nothing_missing", "")
    assert float(rows["a-idler"]["seconds"]) > 0
    assert rows["a-idler"]["error"] == rows["b-complete"]["error"] == rows["c-broken"]["verdict"] == ""
    assert "c-broken" in rows["c-broken"]["error"]
    assert "forward.csv" in rows["c-broken"]["error"]
    assert "\n" not in rows["c-broken"]["error"]


def test_nothing_is_done_twice(plant: Path) -> None:
    first, _ = done(plant)
    out = plant.parent / "out"
    before = {p.name: (p.read_bytes(), p.stat().st_mtime_ns) for p in out.glob("*.json")}
    said: list[str] = []
    again, given = done(plant, said)
    assert given == ["c-broken"]  # what failed is tried again
    assert states(again) == {"a-idler": "kept", "b-complete": "kept", "c-broken": "failed"}
    assert {p.name: (p.read_bytes(), p.stat().st_mtime_ns) for p in out.glob("*.json")} == before
    assert "2 of 3 units" in said[0]
    for old, new in zip(first.outcomes[:2], again.outcomes[:2], strict=True):
        assert (old.verdict, old.keys, old.before, old.after) == (new.verdict, new.keys, new.before, new.after)
    assert table(out)["a-idler"]["state"] == "kept"
    assert table(out)["a-idler"]["verdict"] == "explained"


def change_run(unit: Path) -> None:
    measured(unit / "forward.csv", MOTOR, IDLER)


def add_run(unit: Path) -> None:
    measured(unit / "reverse.csv", MOTOR, direction=-1.0)


def change_model(unit: Path) -> None:
    (unit / "model.toml").write_text((unit / "model.toml").read_text(encoding="utf-8") + "# seen\n", encoding="utf-8")


def rename_run(unit: Path) -> None:
    (unit / "forward.csv").rename(unit / "clockwise.csv")


@pytest.mark.parametrize("change", [change_run, add_run, change_model, rename_run])
def test_only_what_changed_is_done_again(plant: Path, change: Callable[[Path], None]) -> None:
    (plant / "c-broken" / "model.toml").unlink()
    done(plant)
    change(plant / "b-complete")
    result, given = done(plant)
    assert given == ["b-complete"]
    assert states(result) == {"a-idler": "kept", "b-complete": "diagnosed"}
    assert done(plant)[1] == []


def test_a_moved_folder_is_not_done_again(plant: Path) -> None:
    done(plant)
    moved = plant.rename(plant.parent / "archive")
    assert done(moved)[1] == ["c-broken"]


@pytest.mark.parametrize(
    ("folder", "page", "words"),
    [
        ("a-idler", "a-idler.html", "no batch has written this file"),
        ("summary", "", "the overview and a unit's page have one name"),
    ],
)
def test_pages_replace_no_other_file(plant: Path, folder: str, page: str, words: str) -> None:
    (plant / "a-idler").rename(plant / folder)
    (plant.parent / "out").mkdir()
    if page:
        (plant.parent / "out" / page).write_text("<p>mine</p>", encoding="utf-8")
    with pytest.raises(InputError, match=words):
        done(plant, pages=True)


@pytest.mark.parametrize(
    "change",
    [
        lambda data: json.dumps({**data, "version": "0.0.9"}),
        lambda data: json.dumps({**data, "files": []}),
        lambda data: json.dumps({**data, "before": {}}),
        lambda data: json.dumps([data]),
        lambda data: "{",
    ],
)
def test_results_that_do_not_hold_are_replaced(plant: Path, change: Callable[[Any], str]) -> None:
    done(plant)
    path = plant.parent / "out" / "a-idler.json"
    good = path.read_bytes()
    path.write_text(change(json.loads(good)), encoding="utf-8")
    _, given = done(plant)
    assert sorted(given) == ["a-idler", "c-broken"]
    assert path.read_bytes() == good


def test_a_unit_that_fails_now_keeps_its_earlier_result(plant: Path) -> None:
    done(plant)
    before = (plant.parent / "out" / "b-complete.json").read_bytes()
    (plant / "b-complete" / "forward.csv").unlink()
    result, _ = done(plant)
    assert states(result)["b-complete"] == "failed"
    assert "no run beside the model" in result.outcomes[1].error
    assert (plant.parent / "out" / "b-complete.json").read_bytes() == before


def test_faults_and_lost_workers_stop_no_other_unit(plant: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Losing(Counting):
        def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
            if args[0].name == "a-idler":
                lost: Future[Any] = Future()
                lost.set_exception(BrokenProcessPool("killed"))
                return lost
            if args[0].name == "c-broken":
                raise BrokenProcessPool("gone")
            return super().submit(fn, *args, **kwargs)

    with Losing() as executor:
        result = diagnose_folder(plant, out=plant.parent / "out", executor=executor)
    assert states(result) == {"a-idler": "failed", "b-complete": "diagnosed", "c-broken": "failed"}
    assert "worker was lost" in result.outcomes[0].error
    monkeypatch.setattr(batch, "diagnose", lambda model, runs: 1 / 0)
    result, _ = done(plant)
    assert states(result) == {"a-idler": "failed", "b-complete": "kept", "c-broken": "failed"}
    assert "ZeroDivisionError" in result.outcomes[0].error


@pytest.mark.skipif(os.name == "nt", reason="no such names there")
def test_names_that_cannot_be_printed_fail_one_unit_and_show_as_escapes(plant: Path) -> None:
    """A control character in a name could clear a terminal or forge a line of the summary."""
    forward = plant / "b-complete" / "forward.csv"
    forward.rename(forward.with_name("for\x1bward.csv"))
    (plant / "c-broken").rename(plant / "c\nbroken")
    result, _ = done(plant)
    assert states(result) == {"a-idler": "diagnosed", "b-complete": "failed", "'c\\nbroken'": "failed"}
    for outcome in result.outcomes[1:]:
        assert "holds characters that cannot be printed; rename the file" in outcome.error
        assert outcome.error.isprintable()


def test_folders_that_are_no_units(plant: Path) -> None:
    (plant / "notes").mkdir()
    (plant / "loose").mkdir()
    measured(plant / "loose" / "run.csv", MOTOR)
    with Counting() as executor:
        for _ in range(2):  # the results lie beside the units, and are no unit
            result = diagnose_folder(plant, out=plant / "results", executor=executor)
            assert list(states(result)) == ["a-idler", "b-complete", "c-broken"]
            assert len(result.notes) == 1
            assert result.notes[0].startswith("loose: left out")


def test_one_model_for_units_that_have_none(plant: Path) -> None:
    """What lacks a model gets the given one; a unit's own stays its own, and results of a batch are no unit."""
    shutil.move(plant / "b-complete" / "model.toml", plant / "plain.toml")
    save_model(plant / "a-idler" / "model.toml", Model(WORM, (MOTOR, IDLER)), overwrite=True)
    (plant / "d-empty").mkdir()
    (plant / "results").mkdir()
    (plant / "results" / "summary.csv").write_text("unit,state,verdict\n", encoding="utf-8")
    result, _ = done(plant, model=plant / "plain.toml")
    assert states(result) == {"a-idler": "diagnosed", "b-complete": "diagnosed", "c-broken": "failed"}
    assert {outcome.verdict for outcome in result.outcomes[:2]} == {"nothing_missing"}
    assert result.notes == ()
    save_model(plant / "plain.toml", Model(WORM, (MOTOR, IDLER)), overwrite=True)
    result, given = done(plant, model=plant / "plain.toml")  # the model is an input like any other
    assert given == ["b-complete", "c-broken"]
    assert result.outcomes[1].verdict == "explained"  # the model has an idler's error that the unit has not
    shutil.rmtree(plant / "a-idler")
    shutil.rmtree(plant / "b-complete")
    (plant / "c-broken" / "forward.csv").unlink()
    (plant / "c-broken" / "model.toml").unlink()
    with pytest.raises(InputError, match=r"holds a model\.toml, nor any run"):
        done(plant, model=plant / "plain.toml")
    with pytest.raises(InputError, match=r"none\.toml"):
        done(plant, model="none.toml")


def test_overview_leads_to_the_page_of_each_unit(plant: Path) -> None:
    out = plant.parent / "out"
    done(plant)
    assert not list(out.glob("*.html"))
    _, given = done(plant, pages=True)  # a result is kept for the sake of its page no longer
    assert sorted(given) == ["a-idler", "b-complete", "c-broken"]
    _, given = done(plant, pages=True)
    assert given == ["c-broken"]
    shown = (out / "summary.html").read_text(encoding="utf-8")
    rows = re.findall(r"<tr>(<td.*?)</tr>", shown)
    cells = [[re.sub(r"<[^>]+>", "", cell) for cell in re.findall(r"<td.*?</td>", row)] for row in rows]
    assert [row[:4] for row in cells] == [
        ["c-broken", "failed", "", ""],
        ["a-idler", "kept", "explained", "shaft.eccentricity"],
        ["b-complete", "kept", "nothing missing", ""],
    ]
    assert re.search(r'<th scope="row">c-broken</th><td>[^<]*forward.csv', shown)
    before, after = map(float, cells[1][4:6])
    assert cells[1][6] == "arcsec"
    missing = (12**2 + 7**2) ** 0.5 / 2**0.5  # as in the summary
    assert before == pytest.approx(missing, rel=0.02)
    assert after < 0.02 * missing
    links = re.findall(r'href="([^"]+)"', shown)
    assert links == ["a-idler.html", "b-complete.html"]
    for link in links:
        assert "<!doctype html>" in (out / link).read_text(encoding="utf-8")
    # a page of an earlier result is none of this one
    measured(plant / "b-complete" / "forward.csv", MOTOR, IDLER)
    done(plant)
    _, given = done(plant, pages=True)
    assert given == ["b-complete", "c-broken"]
    assert "shaft.eccentricity" in (out / "b-complete.html").read_text(encoding="utf-8")


def test_a_page_that_cannot_be_made_is_told(plant: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = rverror.to_html

    def broken(result: object, **options: Any) -> str:
        if isinstance(result, rverror.Diagnosis):
            raise ValueError("no page of this")
        return whole(result, **options)

    monkeypatch.setattr("rverror.views.report.to_html", broken)
    result, _ = done(plant, pages=True)
    assert set(states(result).values()) == {"failed"}
    assert "ValueError: no page of this" in table(plant.parent / "out")["a-idler"]["error"]
    assert not list((plant.parent / "out").glob("a-idler.*"))


@pytest.mark.parametrize(
    ("folder", "out", "words"),
    [
        ("none", "out", "none: cannot read the folder"),
        ("plant/a-idler", "out", "no subfolder holds a model.toml"),
        ("plant", "plant/a-idler", "folder of unit a-idler"),
        ("plant", "plant/a-idler/deep", "folder of unit a-idler"),
        ("plant", "plant/a-idler/model.toml", "folder of unit a-idler"),
        ("plant", "taken", "taken: cannot make the folder"),
        ("plant", "foreign", "no batch has written this file"),
    ],
)
def test_refused_before_any_work(
    plant: Path, folder: str, out: str, words: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(plant.parent)
    Path("taken").write_text("a file", encoding="utf-8")
    Path("foreign").mkdir()
    Path("foreign/summary.csv").write_text("year,sales\n", encoding="utf-8")
    before = sorted(plant.parent.rglob("*"))
    with Counting() as executor, pytest.raises(InputError, match=words):
        diagnose_folder(folder, out=out, executor=executor)
    assert executor.given == []
    assert cli.main(["diagnose-batch", folder, "--out", out]) == 2
    printed, err = capsys.readouterr()
    assert (printed, err.count("\n")) == ("", 1)
    assert words in err
    assert sorted(plant.parent.rglob("*")) == before


def test_command_line_on_processes(
    plant: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The one test that starts real processes: they do the work, and the environment is as before."""
    monkeypatch.chdir(plant.parent)
    monkeypatch.setenv("OMP_NUM_THREADS", "7")
    monkeypatch.delenv("MKL_NUM_THREADS", raising=False)
    (plant / "b-complete" / "model.toml").rename("plain.toml")
    command = ["diagnose-batch", "plant", "--out", "out", "--model", "plain.toml"]
    assert cli.main([*command, "--jobs", "2", "--html"]) == 2
    assert os.environ["OMP_NUM_THREADS"] == "7"
    assert "MKL_NUM_THREADS" not in os.environ
    out, err = capsys.readouterr()
    lines = out.splitlines()
    assert lines[0].startswith("a-idler: explained; shaft.eccentricity; held-out rms 9.8")
    assert lines[1].startswith("b-complete: nothing missing")
    assert lines[2].startswith("3 units: 2 diagnosed, 0 kept, 1 failed")
    assert lines[2].endswith(f"see {Path('out/summary.html')}")
    assert sorted(p.name for p in Path("out").glob("*.html")) == ["a-idler.html", "b-complete.html", "summary.html"]
    last = err.splitlines()[-1]
    assert last.startswith("rverror: error: 1 of 3 units could not be diagnosed (c-broken)")
    assert "Traceback" not in err
    stated = json.loads(Path("out/a-idler.json").read_text(encoding="utf-8"))["files"]
    assert [Path(f["path"]) for f in stated] == [
        Path("plant/a-idler") / name for name in ("model.toml", "forward.csv", "reverse.csv")
    ]

    measured(plant / "c-broken" / "forward.csv", MOTOR)
    monkeypatch.setattr(batch, "diagnose", None)  # not in this process
    assert cli.main([*command, "--jobs", "1"]) == 0
    out, err = capsys.readouterr()
    assert "3 units: 1 diagnosed, 2 kept, 0 failed" in out
    assert "error" not in err


def test_workers_have_one_blas_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "7")
    with batch.processes(1) as pool:
        assert pool.submit(os.getenv, "OMP_NUM_THREADS").result() == "1"
        assert pool.submit(os.getenv, "OPENBLAS_NUM_THREADS").result() == "1"
        assert pool.submit(threads).result() == 1
    assert os.environ["OMP_NUM_THREADS"] == "7"


@pytest.mark.parametrize("jobs", ["0", "-2"])
def test_jobs_must_be_positive(plant: Path, jobs: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["diagnose-batch", str(plant), "--out", str(plant.parent / "out"), "--jobs", jobs]) == 2
    assert "--jobs" in capsys.readouterr().err
    with pytest.raises(InputError, match="give 1 or more"):
        diagnose_folder(plant, out=plant.parent / "out", jobs=int(jobs))
