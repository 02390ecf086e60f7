"""Measured parts from files: plain tables of parts, and files of measuring machines by a mapping."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass

from rverror.base.errors import InputError, check_kind
from rverror.base.text import PathLike, read_text
from rverror.geartrain.mechanism import Drive, Mechanism, Reducer
from rverror.parts.collected import Finding, collected
from rverror.parts.measured import MeasuredPart
from rverror.parts.parts_table import is_parts_table, read_parts_table


@dataclass(frozen=True)
class PartsRead:
    """Measured parts, and what was not used of their files.

    Attributes
    ----------
    parts : tuple of MeasuredPart
        In the order of the files.
    notes : tuple of str
        What was dropped, counted; what was assumed.
    """

    parts: tuple[MeasuredPart, ...]
    notes: tuple[str, ...] = ()


def load_parts(
    paths: PathLike | Sequence[PathLike], mechanism: Mechanism, *, mapping: PathLike | None = None
) -> PartsRead:
    """Read measured parts.

    Parameters
    ----------
    paths : str, path-like or sequence of them
        Tables of parts as ``rverror parts`` writes them, or files of a measuring machine.
    mechanism : Mechanism
        For nominal sizes, and the indices that are allowed.
    mapping : str or path-like, optional
        Mapping file, which says what the columns are; not for tables of parts.

    Returns
    -------
    PartsRead

    Raises
    ------
    InputError
        If a file cannot be used; one line with file, line, bound and remedy.
    """
    check_kind("mechanism", mechanism, (Reducer, Drive), "give reducer('RV-40E') or the mechanism of a model")
    notes: list[str] = []
    findings: list[Finding] = []
    for path in [paths] if isinstance(paths, (str, os.PathLike)) else paths:
        if mapping is not None or not is_parts_table(read_text(path)):
            raise InputError(f"{path}: no table of parts as `rverror parts` writes it; give a mapping")
        findings += read_parts_table(path)
    return PartsRead(collected(findings, mechanism), tuple(notes))
