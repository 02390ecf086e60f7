"""Shafts of any geared drive of which only the orders are known."""

from __future__ import annotations

from rverror.geartrain.action_line import ErrorVector, output_wave
from rverror.geartrain.kinematics import DrivePose
from rverror.geartrain.mechanism import Drive, Mechanism
from rverror.geartrain.source import Index, Indices, Source, angles, harmonics


def eccentricity(pose: DrivePose, *, shaft: str, harmonic: int) -> ErrorVector:
    """One shaft's error in the reading of the output, c cos(h o theta) + s sin(h o theta), o its turns per output turn.

    Parameters
    ----------
    pose : DrivePose
    shaft : str
        Name of the shaft in the drive.
    harmonic : int
        h, waves per turn of the shaft.

    Returns
    -------
    ErrorVector
        Terms cos, sin, as angles of the output.
    """
    return output_wave(harmonic * pose.drive.shafts[shaft] * pose.theta)


def _orders(mechanism: Mechanism, indices: Indices) -> tuple[float, ...]:
    assert isinstance(mechanism, Drive)
    return (abs(int(indices["harmonic"]) * mechanism.shafts[str(indices["shaft"])]),)


def _names(mechanism: Mechanism) -> list[str]:
    return sorted(mechanism.shafts) if isinstance(mechanism, Drive) else []


SOURCES = (
    Source(
        "shaft.eccentricity", eccentricity, (Index("shaft", _names, _names), harmonics(1, 4)),
        angles(36000, "cos", "sin"), "shaft", _orders, "any drive", "a named shaft of a [drive] model",
        acts="output", in_reducers=False, in_drives=True,
        equation=r"$\delta = c\cos ho\theta + s\sin ho\theta$, the shaft turning $o$ times a turn",
    ),
)  # fmt: skip
