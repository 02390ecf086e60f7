"""MAT files of version 5 to 7: the numbers that scipy reads, and every damage refused where scipy might crash."""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import scipy
import scipy.io
import scipy.sparse
from hypothesis import given, strategies as st

from rverror.runs.bench import mat_file
from rverror.runs.bench.mat import open_mat
from rverror.runs.bench.mat_file import DamagedError, MatVariable, mat_variables

CONTENT = {
    "vector": np.arange(40.0),
    "column": np.arange(40.0)[:, None],
    "matrix": np.arange(12, dtype=np.int16).reshape(3, 4),
    "single": np.float32([1.5, 2.5]),
    "short": np.uint8(3),
    "long": np.array([2**60], dtype=np.int64),
    "empty": np.zeros((0, 0)),
    "three": np.arange(24.0).reshape(2, 3, 4),
    "structure": {"a": np.arange(7.0), "b": {"c": np.zeros((0, 2)), "d": 5.0}},
    "complex": np.arange(5) + 1j,
    "text": "hello",
    "cell": np.array([1.0, "a", np.arange(3)], dtype=object),
    "structures": np.zeros(3, dtype=[("p", "f8")]),
    "sparse": scipy.sparse.eye(4).tocsc(),
    "flags": np.array([True, False]),
}
PROBLEMS = {
    "complex": "holds complex numbers",
    "text": "holds text",
    "cell": "is a MATLAB cell array",
    "structures": "is an array of structures",
    "sparse": "is a sparse matrix",
    "flags": "holds true and false",
}


def saved(content: dict[str, object], *, compressed: bool = False) -> bytes:
    out = io.BytesIO()
    scipy.io.savemat(out, content, do_compression=compressed)
    return out.getvalue()


def same(variable: MatVariable, expected: object) -> None:
    """A variable against what scipy makes of it."""
    if variable.fields:
        for field in variable.fields:
            same(field, np.asarray(expected)[field.name][0, 0])
    elif not variable.problem and variable.array is not None:
        np.testing.assert_array_equal(variable.array, expected)
        assert variable.shape == np.shape(expected)


@pytest.mark.parametrize("compressed", [False, True])
def test_what_scipy_writes_and_reads(compressed: bool) -> None:
    raw = saved(CONTENT, compressed=compressed)
    read = scipy.io.loadmat(io.BytesIO(raw))
    found = list(mat_variables(raw))
    assert [variable.name for variable in found] == list(CONTENT)
    for variable in found:
        assert variable.problem.startswith(PROBLEMS.get(variable.name, ""))
        assert bool(variable.problem) == (variable.name in PROBLEMS)
        same(variable, read[variable.name])


FILES = sorted((Path(scipy.__file__).parent / "io" / "matlab" / "tests" / "data").glob("*.mat"))


@pytest.mark.skipif(not FILES, reason="scipy is installed without its tests' data")
def test_files_of_matlab_itself() -> None:
    """scipy's own collection, MATLAB 5.3 to 7.4 on four machines: what it reads is read, with the same numbers."""
    seen = 0
    for file in FILES:
        raw = file.read_bytes()
        try:
            classes = {name: kind for name, _, kind in scipy.io.whosmat(io.BytesIO(raw))}
            read = scipy.io.loadmat(io.BytesIO(raw))
        except Exception:
            continue
        if 0 in raw[:4]:
            continue
        for variable in mat_variables(raw):
            assert variable.name in classes or not variable.name or variable.problem
            if variable.name in read:
                same(variable, read[variable.name])
                seen += 1
            if variable.array is not None and not variable.problem and variable.name:
                kind = classes[variable.name]
                assert variable.array.dtype == {"double": "f8", "single": "f4"}.get(kind, kind)
    assert seen > 60


def element(kind: int, content: bytes) -> bytes:
    return struct.pack("<II", kind, len(content)) + content + b"\0" * (-len(content) % 8)


def matrix(*elements: bytes, flags: int = 6, sizes: tuple[int, ...] = (1, 2), name: bytes = b"x") -> bytes:
    head = [element(6, struct.pack("<II", flags, 0)), element(5, struct.pack(f"<{len(sizes)}i", *sizes))]
    return element(14, b"".join([*head, element(1, name), *elements]))


def file(*elements: bytes) -> bytes:
    return b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + b"".join(elements)


def packed(content: bytes, cut: int = 0) -> bytes:
    raw = zlib.compress(content)
    return struct.pack("<II", 15, len(raw) - cut) + raw[: len(raw) - cut]


def structure(*fields: bytes, length: int = 4, names: bytes = b"a\0\0\0") -> bytes:
    return matrix(element(5, struct.pack("<i", length)), element(1, names), *fields, flags=2, sizes=(1, 1))


def nested(levels: int) -> bytes:
    inner = matrix(NUMBERS)
    for _ in range(levels):
        inner = structure(inner)
    return inner


NUMBERS = element(9, struct.pack("<dd", 1.5, 2.5))
HEAD = b"MATLAB 5.0 MAT-file".ljust(124)


def test_what_is_made_by_hand_here_is_what_scipy_reads() -> None:
    for raw in (file(matrix(NUMBERS)), file(packed(matrix(NUMBERS)))):
        for variable in (next(mat_variables(raw)).array, scipy.io.loadmat(io.BytesIO(raw))["x"]):
            np.testing.assert_array_equal(variable, [[1.5, 2.5]])
    raw = file(structure(matrix(NUMBERS)))
    np.testing.assert_array_equal(next(mat_variables(raw)).fields[0].array, [[1.5, 2.5]])
    np.testing.assert_array_equal(scipy.io.loadmat(io.BytesIO(raw))["x"]["a"][0, 0], [[1.5, 2.5]])
    assert next(mat_variables(file(nested(10)))).fields[0].fields


DAMAGED: dict[str, tuple[Callable[[], bytes], str]] = {
    "version": (lambda: HEAD + b"\x00\x01JM" + matrix(NUMBERS), "header names no version"),
    "short": (lambda: b"MATLAB", "header names no version"),
    "type": (lambda: file(matrix(element(8, b"1234567812345678"))), "16 bytes of type 8 where 2 numbers belong"),
    "too few numbers": (lambda: file(matrix(NUMBERS, sizes=(1, 3))), "16 bytes of type 9 where 3 numbers belong"),
    "no numbers": (lambda: file(matrix()), "0 bytes of type 0 where 2 numbers belong"),
    "sizes beyond all": (lambda: file(matrix(NUMBERS, sizes=(2**31 - 1,) * 4)), "numbers belong"),
    "size below 0": (lambda: file(matrix(NUMBERS, sizes=(-1, -2))), "without its dimensions"),
    "one size": (lambda: file(matrix(NUMBERS, sizes=(2,))), "without its dimensions"),
    "class": (lambda: file(matrix(NUMBERS, flags=40)), "unknown class 40"),
    "flags": (lambda: file(element(14, NUMBERS)), "an element of type 9 and 16 bytes where one of type 6 belongs"),
    "among variables": (lambda: file(NUMBERS), "an element of type 9 among the variables"),
    "cut off": (lambda: file(matrix(NUMBERS))[:-4], "it ends within a variable"),
    "cut off in a tag": (lambda: file(matrix(NUMBERS)) + b"\0\0\0", "it ends within a tag"),
    "beyond the variable": (lambda: file(matrix(struct.pack("<II", 9, 400) + bytes(16))), "it ends within a variable"),
    "short element": (lambda: file(matrix(struct.pack("<II", 9 | 7 << 16, 0))), "a short element of 7 bytes"),
    "deep": (lambda: file(nested(30)), "more than 20 deep"),
    "field missing": (lambda: file(structure(names=b"a\0\0\0b\0\0\0")), "where one of type 14 belongs"),
    "names": (lambda: file(structure(matrix(NUMBERS), names=b"a\0\0")), "without the names of its fields"),
    "length of names": (lambda: file(structure(matrix(NUMBERS), length=0)), "without the names of its fields"),
    "compressed twice": (lambda: file(packed(packed(matrix(NUMBERS)))), "compressed data that are no variable"),
    "compressed and cut off": (lambda: file(packed(matrix(NUMBERS), cut=9)), "a compressed variable is cut off"),
    "no compression": (lambda: file(element(15, b"12345678")), "decompressing"),
}


@pytest.mark.parametrize("name", DAMAGED)
def test_damaged(name: str) -> None:
    make, words = DAMAGED[name]
    with pytest.raises(DamagedError, match=words):
        list(mat_variables(make()))


def test_what_is_packed_too_tightly(monkeypatch: pytest.MonkeyPatch) -> None:
    """A small file may hold any amount: it is unpacked up to the bound only."""
    raw = file(packed(matrix(element(9, bytes(96_000)), sizes=(1, 12_000))))
    assert len(raw) < 500
    assert next(mat_variables(raw)).shape == (1, 12_000)
    monkeypatch.setattr(mat_file, "MOST_BYTES", 50_000)
    with pytest.raises(DamagedError, match="holds more than"):
        list(mat_variables(raw))


def test_what_matlab_keeps_without_a_name_is_not_listed(tmp_path: Path) -> None:
    (tmp_path / "a.mat").write_bytes(file(matrix(NUMBERS), matrix(NUMBERS, name=b"")))
    assert [entry.name for entry in open_mat(tmp_path / "a.mat").entries] == ["x"]


def damages(raw: bytes) -> Iterator[bytes]:
    for place in range(116, len(raw)):
        for value in (0, 1, 2, 5, 8, 14, 17, 255):
            yield raw[:place] + bytes([value]) + raw[place + 1 :]


def test_no_single_byte_does_more_than_damage() -> None:
    """Each byte of a small file in turn: variables or `DamagedError`, nothing else."""
    content = {"in": np.arange(3.0), "s": {"x": np.arange(3, dtype=np.int8), "c": "hi"}, "t": "a"}
    outcomes = set()
    for raw in damages(saved(content)):
        try:
            outcomes.add(len(list(mat_variables(raw))))
        except DamagedError:
            outcomes.add(-1)
    assert {-1, 3} <= outcomes


@given(st.binary(max_size=200), st.integers(0, 400))
def test_any_bytes(content: bytes, place: int) -> None:
    raw = saved({"in": np.arange(3.0), "s": {"x": np.arange(3)}})
    for changed in (file(content), raw[:place] + content + raw[place:], raw[:place] + content):
        try:
            list(mat_variables(changed))
        except DamagedError as error:
            found = str(error)
        else:
            found = "read"
        assert found
