"""MAT files of version 5 to 7: numbers and what holds them, every length checked against what is there.

scipy.io reads such files too, but trusts them: of the 2,592 files that the tests make of a small one by a single wrong
byte, some 70 end the process (scipy 1.17).

Source: MATLAB, MAT-File Format, level 5 (tags, array flags, dimensions, name, data).
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

#: Largest content of one compressed variable.
MOST_BYTES = 2_000_000_000
_HEADER = 128
_ORDERS = {b"\x00\x01IM": "<", b"\x01\x00MI": ">"}
_MATRIX, _COMPRESSED = 14, 15
# Types of elements; programs other than MATLAB write unsigned whole numbers and UTF-8 where it writes signed and bytes.
_TEXTS, _INTEGERS, _FLAGS, _MATRICES = (1, 2, 16), (5, 6), (6,), (_MATRIX,)
_STORED = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_CLASSES = {6: "f8", 7: "f4", 8: "i1", 9: "u1", 10: "i2", 11: "u2", 12: "i4", 13: "u4", 14: "i8", 15: "u8"}
_STRUCTURE, _OPAQUE = 2, 17
_LOGICAL, _COMPLEX = 0x0200, 0x0800
_DEEPEST = 20
_OTHERS = {
    1: "is a MATLAB cell array; store each cell as a plain vector",
    3: "is a MATLAB object; store its columns as plain vectors",
    4: "holds text; take a column of numbers",
    5: "is a sparse matrix; store full(...) of it",
    16: "is a MATLAB function; take a column of numbers",
    17: "is a MATLAB table or object; store its columns as plain vectors",
    18: "is a MATLAB object; store its columns as plain vectors",
}


class DamagedError(Exception):
    """What is wrong with a file."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MatVariable:
    """A variable, or a field of a structure.

    Attributes
    ----------
    shape : tuple of int
    array : ndarray, optional
        Real numbers; None where it holds none.
    fields : tuple of MatVariable
        Of a single structure.
    problem : str
        Why it is no column, with the remedy; empty where it may be one.
    """

    name: str
    shape: tuple[int, ...] = (0, 0)
    array: np.ndarray[Any, np.dtype[Any]] | None = None
    fields: tuple[MatVariable, ...] = ()
    problem: str = ""


def mat_variables(raw: bytes) -> Iterator[MatVariable]:
    """Variables of a file, one after another.

    Parameters
    ----------
    raw : bytes
        The whole file.

    Yields
    ------
    MatVariable

    Raises
    ------
    DamagedError
        If anything in it reaches beyond what holds it, or is of no known kind.
    """
    order = _ORDERS.get(raw[124:_HEADER])
    if order is None:
        raise DamagedError("its header names no version")
    for kind, content in _elements(memoryview(raw)[_HEADER:], order, inside=False):
        if kind == _COMPRESSED:
            unpacked = list(_elements(_decompressed(content), order, inside=False))
            if [kind for kind, _ in unpacked] != [_MATRIX]:
                raise DamagedError("compressed data that are no variable")
            content = unpacked[0][1]
        elif kind != _MATRIX:
            raise DamagedError(f"an element of type {kind} among the variables")
        yield _variable(content, order, 0)


def _elements(data: memoryview, order: str, *, inside: bool) -> Iterator[tuple[int, memoryview]]:
    """Type and content of the elements in a stretch of bytes; those inside a variable fill up to eight bytes."""
    place = 0
    while place < len(data):
        if len(data) - place < 8:
            raise DamagedError("it ends within a tag")
        kind, size = struct.unpack(f"{order}II", data[place : place + 8])
        start, end = place + 8, place + 8 + size
        if inside and kind >> 16:  # four bytes or less stand in the tag itself
            kind, size = kind & 0xFFFF, kind >> 16
            if size > 4:
                raise DamagedError(f"a short element of {size} bytes")
            start, end = place + 4, place + 8
        elif inside:
            end += -size % 8
        if start + size > len(data):
            raise DamagedError("it ends within a variable")
        yield kind, data[start : start + size]
        place = end


def _decompressed(content: memoryview) -> memoryview:
    reader = zlib.decompressobj()
    try:
        found = reader.decompress(content, MOST_BYTES)
    except zlib.error as error:
        raise DamagedError(f"a compressed variable: {error}") from error
    if not reader.eof:
        raise DamagedError(f"a compressed variable is cut off, or holds more than {MOST_BYTES / 1e9:.0f} GB")
    return memoryview(found)


def _variable(content: memoryview, order: str, depth: int) -> MatVariable:
    if depth > _DEEPEST:
        raise DamagedError(f"structures within structures, more than {_DEEPEST} deep")
    if not content:  # a field without a value
        return MatVariable(name="")
    elements = _elements(content, order, inside=True)
    flags = struct.unpack(f"{order}II", _next(elements, _FLAGS, 8))[0]
    of_class = flags & 0xFF
    if of_class == _OPAQUE:  # the only class without dimensions
        return MatVariable(name=_text(_next(elements, _TEXTS)), problem=_OTHERS[of_class])
    sizes = np.frombuffer(_next(elements, _INTEGERS, multiple=4), dtype=f"{order}i4")
    if sizes.size < 2 or (sizes < 0).any():
        raise DamagedError("a variable without its dimensions")
    shape = tuple(sizes.tolist())
    name = _text(_next(elements, _TEXTS))
    if of_class in _OTHERS:
        return MatVariable(name=name, shape=shape, problem=_OTHERS[of_class])
    if of_class == _STRUCTURE:
        if shape != (1, 1):
            problem = "is an array of structures; store each column as a plain vector"
            return MatVariable(name=name, shape=shape, problem=problem)
        return MatVariable(name=name, shape=shape, fields=_fields(elements, order, depth))
    if of_class not in _CLASSES:
        raise DamagedError(f"a variable of unknown class {of_class}")
    if flags & _COMPLEX:
        problem = "holds complex numbers; store real and imaginary part apart"
    else:
        problem = "holds true and false; take a column of numbers" if flags & _LOGICAL else ""
    return MatVariable(name=name, shape=shape, array=_numbers(elements, order, of_class, shape), problem=problem)


def _next(
    elements: Iterator[tuple[int, memoryview]], kinds: tuple[int, ...], size: int = -1, multiple: int = 1
) -> memoryview:
    """Content of the next element, which must be of one of these types and of that size."""
    found, content = next(elements, (0, memoryview(b"")))
    if found not in kinds or (size >= 0 and len(content) != size) or len(content) % multiple:
        raise DamagedError(f"an element of type {found} and {len(content)} bytes where one of type {kinds[0]} belongs")
    return content


def _text(content: memoryview) -> str:
    return bytes(content).rstrip(b"\0").decode("utf-8", errors="replace")


def _fields(elements: Iterator[tuple[int, memoryview]], order: str, depth: int) -> tuple[MatVariable, ...]:
    (length,) = struct.unpack(f"{order}i", _next(elements, _INTEGERS, 4))
    names = _next(elements, _TEXTS)
    if length < 1 or len(names) % length:
        raise DamagedError("a structure without the names of its fields")
    fields = []
    for start in range(0, len(names), length):
        name = _text(names[start : start + length]).partition("\0")[0]
        fields.append(replace(_variable(_next(elements, _MATRICES), order, depth + 1), name=name))
    return tuple(fields)


def _numbers(
    elements: Iterator[tuple[int, memoryview]], order: str, of_class: int, shape: tuple[int, ...]
) -> np.ndarray[Any, np.dtype[Any]]:
    """Real part, in the type of its class: MATLAB stores whole numbers in fewer bytes."""
    kind, content = next(elements, (0, memoryview(b"")))
    size = math.prod(shape)
    if kind not in _STORED or len(content) != size * np.dtype(_STORED[kind]).itemsize:
        raise DamagedError(f"{len(content)} bytes of type {kind} where {size} numbers belong")
    stored = np.frombuffer(content, dtype=order + _STORED[kind])
    return stored.astype(_CLASSES[of_class]).reshape(shape, order="F")
