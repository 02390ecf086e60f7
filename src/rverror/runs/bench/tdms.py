"""TDMS files of LabVIEW and its kin.  npTDMS comes with the extra ``io``."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from rverror.base.errors import InputError
from rverror.base.text import PathLike
from rverror.runs.bench.columns import (
    MOST_COLUMNS,
    BenchFile,
    Entry,
    RawArray,
    kind_problem,
    refused_in_one_line,
    shape_problem,
)
from rverror.runs.reading import refuse

#: Bytes with which a file begins.
SIGNATURE = b"TDSm"
_UNIT_PROPERTIES = ("unit_string", "unit", "units", "NI_UnitDescription")


def open_tdms(path: PathLike) -> BenchFile:
    """List the channels of a file.

    Parameters
    ----------
    path : str or path-like
        An index file beside it is not used, for it may be of another recording.

    Raises
    ------
    InputError
        If npTDMS is not installed, or the file is damaged.
    """
    name = str(path)
    with _opened(name) as file:
        channels = _channels(file)
        if len(channels) > MOST_COLUMNS:
            refuse(name, f"{len(channels):,} channels, at most {MOST_COLUMNS:,} are read; export fewer")
        entries = tuple(_entry(channel) for channel in channels)
        properties = {str(key): str(value) for key, value in file.properties.items()}
        for group in file.groups():
            properties |= {f"{group.name}/{key}": str(value) for key, value in group.properties.items()}
        cut_off = bool(file.file_status.incomplete_final_segment)

    def columns(places: Sequence[int]) -> list[RawArray]:
        with _opened(name) as file:
            again = _channels(file)
            return [np.asarray(again[place][:]) for place in places]

    return BenchFile(
        path=name,
        kind="TDMS",
        entries=entries,
        columns=columns,
        properties=properties,
        notes=("the file ends before its last part is complete; what was written is read",) if cut_off else (),
    )


def _channels(file: Any) -> list[Any]:
    return [channel for group in file.groups() for channel in group.channels()]


@contextmanager
def _opened(path: str) -> Iterator[Any]:
    try:
        from nptdms import TdmsFile
        from nptdms.log import log_manager
    except ImportError as error:
        raise InputError(f"{path}: TDMS files need npTDMS; install it with: pip install 'rverror[io]'") from error
    level = log_manager.log_level
    log_manager.set_level(logging.CRITICAL + 1)  # what npTDMS would print of a file that is cut off, a note says
    try:
        with refused_in_one_line(path, "TDMS"), open(path, "rb") as raw:
            yield TdmsFile.open(raw)
    finally:
        log_manager.set_level(level)


def _entry(channel: Any) -> Entry:
    properties = channel.properties
    unit = next((str(properties[key]).strip() for key in _UNIT_PROPERTIES if key in properties), "")
    dtype = np.dtype(channel.dtype)
    stamps = dtype.kind == "M"
    increment = properties.get("wf_increment", 0.0)
    return Entry(
        name=f"{channel.group_name}/{channel.name}",
        unit="s" if stamps and not unit else unit,
        size=len(channel),
        problem=shape_problem((len(channel),)) or kind_problem(dtype),
        increment=float(increment) if isinstance(increment, int | float) and increment > 0 else 0.0,
    )
