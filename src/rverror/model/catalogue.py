"""The catalogue: every error source once, joined from the files of the sub-assemblies.

To add a source, write one function that returns its `ErrorVector` in the file of its sub-assembly, and one `Source` in
the `SOURCES` at the end of that file.  The contract test, the command line, files and diagnosis pick it up from here.
A source of your own that stays outside the package is added for the length of a block by `extended`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar

from rverror.base.errors import check_kind
from rverror.base.text import did_you_mean, shown
from rverror.geartrain import coupling, crank, cycloid, involute, thermal
from rverror.geartrain.source import Source
from rverror.model import compensation, empirical, load, sensor, shaft

_FILES = (involute, crank, cycloid, coupling, thermal, load, sensor, shaft, empirical, compensation)

_OWN = {entry.key: entry for file in _FILES for entry in file.SOURCES}
_KNOWN: ContextVar[Mapping[str, Source]] = ContextVar("sources, with those of `extended`", default=_OWN)


class _Catalogue(Mapping[str, Source]):
    """The package's own sources, then those of the `extended` blocks around the call."""

    def __getitem__(self, key: str) -> Source:
        return _KNOWN.get()[key]

    def __iter__(self) -> Iterator[str]:
        return iter(_KNOWN.get())

    def __len__(self) -> int:
        return len(_KNOWN.get())


#: Every error source by key.
CATALOGUE: Mapping[str, Source] = _Catalogue()


@contextmanager
def extended(*sources: Source) -> Iterator[None]:
    """Add sources to the catalogue within a ``with`` block: models, files and diagnosis know them there.

    Parameters
    ----------
    *sources : Source
        A key is ``family.name``.  One that acts beyond the gear train, with its vector at the contact ``output``, says
        so in its field `acts`.

    Raises
    ------
    ValueError
        If a key is taken.

    Notes
    -----
    Nothing stays behind: after the block, and in other threads and processes, the catalogue is as it was.  docs page
    ``adding-an-effect.md``.

    Examples
    --------
    >>> from dataclasses import replace
    >>> mine = replace(source("sensor.encoder_eccentricity"), key="sensor.coupling_offset")
    >>> with extended(mine):
    ...     source("sensor.coupling_offset").frame
    'output'
    >>> "sensor.coupling_offset" in CATALOGUE
    False
    """
    known = dict(_KNOWN.get())
    for entry in sources:
        if entry.key in known:
            raise ValueError(f"{entry.key}: the catalogue has a source of this key; give yours another")
        known[entry.key] = entry
    token = _KNOWN.set(known)
    try:
        yield
    finally:
        _KNOWN.reset(token)


def source(key: str) -> Source:
    """Look up a source.

    Parameters
    ----------
    key : str
        Such as ``"crank.eccentricity"``.

    Returns
    -------
    Source

    Raises
    ------
    ValueError
        If there is none; the message names the nearest.

    Examples
    --------
    >>> source("cycloid.disc_pitch").frame
    'disc'
    """
    check_kind("key", key, str, "give a key of the catalogue, such as 'crank.eccentricity'")
    entry = _KNOWN.get().get(key)
    if entry is None:
        hint = did_you_mean(key, CATALOGUE) or " `rverror sources` lists them"
        raise ValueError(f"no error source {shown(key)};{hint}")
    return entry
