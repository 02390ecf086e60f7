"""What every JSON result says of its origin: the files that it was made from, and the version."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from rverror.base.errors import InputError
from rverror.base.version import __version__


@dataclass(frozen=True)
class InputFile:
    """A file that a result was made from: path as given, SHA-256 of its bytes, size."""

    path: str
    sha256: str
    bytes: int


def input_files(paths: Sequence[str | os.PathLike[str]]) -> tuple[InputFile, ...]:
    """Hash the files of a result, so that a report says what it was made from.

    Parameters
    ----------
    paths : sequence of str or path-like

    Returns
    -------
    tuple of InputFile

    Raises
    ------
    InputError
        If a file cannot be read.

    Examples
    --------
    >>> from importlib import resources
    >>> [file.bytes > 0 for file in input_files([resources.files("rverror") / "data" / "demo" / "model.toml"])]
    [True]
    """
    found = []
    for path in paths:
        try:
            raw = Path(path).read_bytes()
        except OSError as error:
            raise InputError(f"{path}: cannot read it for its hash ({error.strerror}); check the path") from error
        found.append(InputFile(os.fspath(path), hashlib.sha256(raw).hexdigest(), len(raw)))
    return tuple(found)


def enveloped(
    kind: str, content: Mapping[str, Any], files: Sequence[InputFile] | None = (), *, listed: str = "inputs"
) -> dict[str, Any]:
    """Content of a result with the kind of it, its input files and the version.

    Parameters
    ----------
    kind : str
        Name of the result's class.
    content : mapping
    files : sequence of InputFile or None
        None for a result that lists its inputs by itself.
    listed : str
        Key of the files.

    Returns
    -------
    dict
    """
    told = {} if files is None else {listed: [asdict(file) for file in files]}
    return {"result": kind, **content, **told, "version": __version__}
