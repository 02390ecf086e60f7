"""Large lots: files of compressed units make the lot that their runs make, and what was stopped goes on."""

from __future__ import annotations

import base64
import json
import tracemalloc
from collections.abc import Callable, Sequence
from concurrent.futures import BrokenExecutor, Future, ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rverror
from gear_runs import TURN, UNIT
from rverror import InputError
from rverror.base.units import ARCSEC
from rverror.lots.amplitudes import Amplitudes, amplitudes_of
from rverror.lots.compressed import TOGETHER, Compression, lot_inputs
from rverror.lots.folder import lot_units
from rverror.lots.made import lot

MODEL = rverror.Model(UNIT)


def load(paths: Any, model: rverror.Model = MODEL) -> Amplitudes:
    return lot_inputs(paths, model).amplitudes()


def compress(paths: Any, out: Path, mapping: Path | None = None, **more: Any) -> Compression:
    return lot_inputs(paths, MODEL, mapping).compressed(out, **more)


def put(
    root: Path, serials: Sequence[str], *, samples: int = 64, ways: Sequence[float] = (1.0,), index: str = ""
) -> Path:
    """Units with runs of their own waves, at angles that are not even."""
    for serial in serials:
        rng = np.random.default_rng([ord(letter) for letter in serial])
        theta = TURN * (np.arange(samples) + rng.uniform(-0.2, 0.2, samples)) / samples
        waves = rng.normal(size=(2, 20)) @ np.cos(np.arange(1, 21)[:, None] * theta + rng.uniform(0, TURN, 20)[:, None])
        (root / serial).mkdir(parents=True)
        for way, error in zip(ways, 30 * ARCSEC * waves, strict=False):
            order = slice(None, None, int(way))
            run = rverror.run_from_arrays(
                input_angle=UNIT.ratio * theta[order], te=error[order], direction=way, torque="50 N*m", index=index
            )
            rverror.runs.write_run(root / serial / f"run{way:+.0f}.csv", run)
    return root


def many(root: Path, count: int, samples: int = 64) -> Path:
    """So many units of one run."""
    text = (put(root, ["0000"], samples=samples) / "0000" / "run+1.csv").read_text("utf-8")
    for number in range(1, count):
        (root / f"{number:04}").mkdir()
        (root / f"{number:04}" / "run+1.csv").write_text(text, "utf-8")
    return root


def check_same(found: Amplitudes, expected: Amplitudes) -> None:
    assert (found.serials, found.labels, found.conditions) == (expected.serials, expected.labels, expected.conditions)
    assert found.orders.tolist() == expected.orders.tolist()
    assert (found.samples, found.marked) == (expected.samples, expected.marked)
    assert found.notes == expected.notes
    assert np.abs(found.values - expected.values).max() < 1e-5 * ARCSEC
    assert found.noise == pytest.approx(expected.noise, rel=1e-4)


def test_parts_of_a_lot_make_the_lot(tmp_path: Path) -> None:
    """Of units that differ in their samples, conditions and labels, in files, folders and both."""
    put(tmp_path / "a", ["a2", "a10"], ways=(1.0, -1.0))
    put(tmp_path / "a", ["a1"], samples=48, ways=(1.0, -1.0))
    put(tmp_path / "b", ["b1"])
    put(tmp_path / "b", ["b2", "b3"], ways=(1.0, -1.0))
    (tmp_path / "a" / "units.csv").write_text("serial,machine\na10,M1\na2,M2\ngone,M2\n", "utf-8")
    units, notes = zip(*(lot_units(tmp_path / name, MODEL) for name in "ab"), strict=True)
    whole = amplitudes_of(MODEL, [unit for some in units for unit in some])
    expected = replace(whole, notes=(*(n for some in notes for n in some), *whole.notes))
    assert expected.labels == {"machine": ("M1", "M2", "", "", "")}
    assert len(expected.orders) == 23
    check_same(load([tmp_path / "a", tmp_path / "b"]), expected)
    for name in "ab":
        done = compress(tmp_path / name, tmp_path / f"{name}.jsonl")
        assert (done.units, done.read) == (3, 3)
    check_same(load([tmp_path / "a.jsonl", tmp_path / "b.jsonl"]), expected)
    check_same(load([tmp_path / "a.jsonl", tmp_path / "b"]), expected)
    compress([tmp_path / "a.jsonl", tmp_path / "b"], tmp_path / "all.jsonl")
    check_same(load(tmp_path / "all.jsonl"), expected)
    assert not [*tmp_path.glob("*.begun"), *tmp_path.glob("*.tmp")]


def test_marks_that_are_unknown_stay_so_in_a_file_and_of_some_units_make_it_so_for_all(tmp_path: Path) -> None:
    for name, index in (("a", "unknown"), ("b", "")):
        put(tmp_path / name, [name + letter for letter in "123"], index=index)
        compress(tmp_path / name, tmp_path / f"{name}.jsonl")
    known, turned, both = (load([tmp_path / f"{n}.jsonl" for n in names]) for names in ("b", "a", "ab"))
    assert (known.marked, turned.marked, both.marked) == (True, False, False)
    assert (known.notes, turned.notes) == ((), ())
    assert both.notes == ("no marks are used: those of 3 units are unknown (a1, a2, a3)",)


def test_executors_give_the_same_file_byte_for_byte(tmp_path: Path) -> None:
    many(tmp_path / "lot", 2 * TOGETHER + 3)
    compress(tmp_path / "lot", tmp_path / "one.jsonl")
    with ThreadPoolExecutor(2) as executor:
        compress(tmp_path / "lot", tmp_path / "two.jsonl", executor=executor)
    assert (tmp_path / "one.jsonl").read_bytes() == (tmp_path / "two.jsonl").read_bytes()


def test_what_was_stopped_goes_on(tmp_path: Path) -> None:
    """Units that are done are not read again, but those whose files have changed are."""
    folder, out = many(tmp_path / "lot", 2 * TOGETHER), tmp_path / "lot.jsonl"

    def stop(text: str) -> None:
        if text == f"{TOGETHER} of {2 * TOGETHER} units read":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        compress(folder, out, progress=stop)
    assert not out.exists()
    run = put(tmp_path / "other", ["other"]) / "other" / "run+1.csv"
    (folder / "0003" / "run+1.csv").write_bytes(run.read_bytes())
    (folder / "units.csv").write_text("serial,machine\n0005,new\n", "utf-8")
    done = compress(folder, out)
    assert done.read == TOGETHER + 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["lot", "lot.jsonl", "other"]
    found = load(out)
    assert found.serials[:2] == ("0005", "0000")
    assert found.labels["machine"][:2] == ("new", "")
    check_same(found, load(folder))


def test_memory_grows_by_names_alone(tmp_path: Path) -> None:
    """A unit has two columns of 256 numbers, 4 kB; its names take some 0.7 kB."""
    peaks = []
    for count in (2 * TOGETHER, 6 * TOGETHER):
        folder = many(tmp_path / str(count), count, 256)
        tracemalloc.start()
        compress(folder, tmp_path / f"{count}.jsonl")
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert (peaks[1] - peaks[0]) / (4 * TOGETHER) < 2000


def edited(path: Path, line: int, **changed: Any) -> None:
    """Change what a line of a file says."""
    lines = path.read_text("utf-8").splitlines()
    lines[line] = json.dumps(json.loads(lines[line]) | changed)
    path.write_text("\n".join(lines), "utf-8")


def cut(path: Path, *, size: float) -> None:
    path.write_bytes(path.read_bytes()[: int(path.stat().st_size * size)])


def amplitudes(*values: float) -> list[tuple[float, float, str]]:
    return [(1.0, 50e3, base64.b64encode(np.array(values, "<f4").tobytes()).decode())]


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda path: path.write_text("serial,machine\n"), "no compressed lot that this rverror reads; give a folder"),
        (lambda path: path.write_bytes(b""), "no compressed lot"),
        (partial(edited, line=0, version=1), "no compressed lot"),
        (partial(edited, line=0, ratio=105.0), "made with another model, of ratio 105 for 49; compress the runs again"),
        (partial(edited, line=0, ratio="x"), "cut off or damaged"),
        (partial(edited, line=0, units=4), "cut off or damaged"),
        (partial(edited, line=0, notes=None), "cut off or damaged"),
        (partial(cut, size=0.1), "cut off or damaged"),
        (partial(cut, size=0.9), "cut off or damaged"),
        (partial(edited, line=2, runs=amplitudes(1.0)), "unit b has no 62 finite amplitudes"),
        (partial(edited, line=2, runs=amplitudes(*61 * [1.0], np.nan)), "unit b has no 62 finite amplitudes"),
        (partial(edited, line=2, runs=[[1.0, 50e3, "~"]]), "cut off or damaged"),
        (partial(edited, line=2, samples=None), "cut off or damaged"),
    ],
)
def test_files_that_cannot_be_used(tmp_path: Path, spoil: Callable[[Path], object], said: str) -> None:
    """One line that names the file."""
    path = tmp_path / "lot.jsonl"
    compress(put(tmp_path / "lot", ["a", "b", "c"]), path)
    spoil(path)
    with pytest.raises(InputError) as caught:
        load(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("parts", "said"),
    [
        (["a", "a.jsonl"], r"a.jsonl: 3 serials \(x, y, z\) that .*a has too; give each unit once"),
        (["a.jsonl", "a"], r"a: 3 serials \(x, y, z\) that .*a.jsonl has too"),
        ([], "paths: there is none"),
        (["none"], r"none: cannot read the folder \(No such file"),
    ],
)
def test_parts_that_do_not_belong_together(tmp_path: Path, parts: Sequence[str], said: str) -> None:
    compress(put(tmp_path / "a", ["x", "y", "z"]), tmp_path / "a.jsonl")
    with pytest.raises(InputError, match=said):
        load([tmp_path / part for part in parts])


def test_what_is_not_overwritten_and_cannot_be_written(tmp_path: Path) -> None:
    folder, out = put(tmp_path / "lot", ["a", "b", "c"]), tmp_path / "lot.jsonl"
    out.write_text("kept", "utf-8")
    with pytest.raises(InputError, match="the file exists; choose another name or allow overwriting"):
        compress(folder, out)
    assert out.read_text("utf-8") == "kept"
    with pytest.raises(InputError, match=r"cannot write it \(No such file or directory\); choose another place"):
        compress(folder, tmp_path / "none" / "lot.jsonl")
    compress(folder, out, overwrite=True)
    assert len(load(out).serials) == 3


def test_a_worker_that_is_lost(tmp_path: Path) -> None:
    class Gone(ThreadPoolExecutor):
        def submit(self, *given: Any, **named: Any) -> Future[Any]:
            raise BrokenExecutor("killed")

    with pytest.raises(InputError, match=r"a worker was lost \(killed\); start again"), Gone() as executor:
        compress(put(tmp_path / "lot", ["a", "b", "c"]), tmp_path / "lot.jsonl", executor=executor)


def test_a_lot_is_asked_of_amplitudes(tmp_path: Path) -> None:
    """They stand in place of units."""

    def stop(text: str) -> None:
        raise KeyboardInterrupt(text)

    with pytest.raises(KeyboardInterrupt, match="3 units, forward at 50 N"):
        lot(MODEL, load(put(tmp_path, ["a", "b", "c"])), progress=stop)


@pytest.mark.parametrize("changed", ["mapping", "damaged"])
def test_what_was_read_otherwise_is_read_again(tmp_path: Path, changed: str) -> None:
    """What a stopped call has left by another mapping, or damaged."""
    folder, out = many(tmp_path / "lot", TOGETHER + 1), tmp_path / "lot.jsonl"
    (tmp_path / "bench.toml").write_text("", "utf-8")

    def stop(text: str) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        compress(folder, out, progress=stop)
    if changed == "damaged":
        cut(tmp_path / "lot.jsonl.begun", size=0.01)
    done = compress(folder, out, tmp_path / "bench.toml" if changed == "mapping" else None)
    assert done.read == TOGETHER + 1
