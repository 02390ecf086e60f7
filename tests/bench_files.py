"""One physical run as files of benches: what every reader must find in them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import scipy.io
from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter

N = 240


RATIO = 121.0


#: The physical run that every file below holds: a reducer with a wave of order 40, 0.01 s between samples.
THETA = np.linspace(0.2, 2.5, N)


TE = 1e-4 * np.sin(40 * THETA)


INPUT, OUTPUT = np.degrees(RATIO * THETA), np.degrees(THETA + TE)


TIME = np.arange(N) * 0.01


def hdf5(folder: Path, name: str = "run.h5", **data: Any) -> Path:
    file = folder / name
    with h5py.File(file, "w") as out:
        for key, values in ({"in": INPUT, "out": OUTPUT} | data).items():
            out[key] = values
    return file


def mat(folder: Path, name: str = "run.mat", keywords: dict[str, Any] | None = None, **data: Any) -> Path:
    file = folder / name
    scipy.io.savemat(file, {"in": INPUT, "out": OUTPUT} | data, **(keywords or {}))
    return file


def tdms(folder: Path, *channels: ChannelObject, segments: int = 1, root: Any = None, group: Any = None) -> Path:
    file = folder / "run.tdms"
    given = channels or (ChannelObject("G", "in", INPUT), ChannelObject("G", "out", OUTPUT))
    with TdmsWriter(file) as writer:
        for part in range(segments):
            at = slice(part * N // segments, (part + 1) * N // segments)
            pieces = [ChannelObject(c.group, c.channel, c.data[at], c.properties) for c in given]
            writer.write_segment([RootObject(root or {}), GroupObject("G", group or {}), *pieces])
    return file
