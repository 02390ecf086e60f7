"""Load: what the output torque does beyond the contacts of the gear train."""

from __future__ import annotations

import numpy as np

from rverror.base.units import ARCSEC
from rverror.geartrain.action_line import ErrorVector
from rverror.geartrain.kinematics import Pose
from rverror.geartrain.source import Parameter, Source, constant


def torsion(pose: Pose) -> ErrorVector:
    """Compliance of the output side beyond the contacts: output shaft, flange, coupling of the bench.

    Parameters
    ----------
    pose : Pose

    Returns
    -------
    ErrorVector
        Term compliance, rad per N*mm: the output lags by compliance times torque in either direction.

    Raises
    ------
    ValueError
        If the pose has no torque.

    Notes
    -----
    Source 000 names loads, source 001 load-induced deformation as missing; source 003 leaves them to an outlook.  The
    windup of the contacts themselves is the equilibrium's; the closed form has none.
    """
    if pose.torque is None:
        raise ValueError("load.torsion needs the torque; give torque, or a run file with output_torque")
    return ErrorVector(contact="output", vector=-(np.abs(pose.torque) * pose.direction)[None, None])


SOURCES = (
    Source(
        "load.torsion", torsion, (),
        (Parameter("compliance", "compliance", 20 * ARCSEC / 1e3, least=0.0),),
        "direction", constant, "000 and 001, named as missing; 003, outlook",
        "compliance of the output side beyond the contacts",
        acts="output", needs=("torque",),
        equation=r"$\delta = \mp e\, T$",
        hidden="constant at constant torque",
    ),
)  # fmt: skip
