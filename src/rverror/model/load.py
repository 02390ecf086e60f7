"""Load: what the output torque does beyond the contacts of the gear train."""

from __future__ import annotations

from rverror.base.units import ARCSEC
from rverror.geartrain.action_line import ErrorVector, output_terms, output_wave
from rverror.geartrain.kinematics import Pose, stated_load
from rverror.geartrain.source import Parameter, Source, constant, harmonics, input_order, own_order, windups


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
    return output_terms(-stated_load(pose, "load.torsion"))


def torsion_wave(pose: Pose, *, harmonic: int) -> ErrorVector:
    """Wave of the compliance beyond the contacts over the output angle: a flange or coupling that gives way unevenly.

    Parameters
    ----------
    pose : Pose
    harmonic : int
        h, waves a turn of the output: 3 for a flange on three cranks or bolts.

    Returns
    -------
    ErrorVector
        Terms cos, sin, rad per N*mm: the output lags by (c cos(h theta) + s sin(h theta)) times the torque.

    Raises
    ------
    ValueError
        If the pose has no torque.

    Notes
    -----
    In proportion to the load, and opposite in the two directions.  No source text has it.
    """
    return output_wave(harmonic * pose.theta, -stated_load(pose, "load.torsion_wave"))


def input_torsion_wave(pose: Pose, *, harmonic: int) -> ErrorVector:
    """Wave of the input coupling's compliance over the input angle.

    Parameters
    ----------
    pose : Pose
    harmonic : int
        h, waves a turn of the input: 1 for a bent coupling, 2 for an oval or a jointed one.

    Returns
    -------
    ErrorVector
        Terms cos, sin, rad at the output per N*mm of output torque; a shaft that gives way by k at the input has
        k / R^2 here.

    Raises
    ------
    ValueError
        If the pose has no torque.

    Notes
    -----
    In proportion to the load, and opposite in the two directions.  No source text has it.
    """
    return output_wave(harmonic * pose.ratio * pose.theta, -stated_load(pose, "load.input_torsion_wave"))


SOURCES = (
    Source(
        "load.torsion_wave", torsion_wave, (harmonics(1, 6),), windups(10, "cos", "sin"),
        "output", own_order, "none: a bench's couplings", "compliance beyond the contacts, uneven over a turn",
        acts="output", needs=("torque",), tried=False, in_tables=True,
        equation=r"$\delta = \mp T (c\cos h\theta + s\sin h\theta)$",
    ),
    Source(
        "load.input_torsion_wave", input_torsion_wave, (harmonics(1, 2),), windups(10, "cos", "sin"),
        "sun", input_order, "none: a bench's couplings", "compliance of the input coupling, uneven over its turn",
        acts="output", needs=("torque",), tried=False, in_tables=True,
        equation=r"$\delta = \mp T (c\cos hR\theta + s\sin hR\theta)$",
    ),
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
