"""Where every contact of a gear train stands, and what it carries in closed form: the five sub-assemblies in one walk.

Torque goes from the output to the pins, from the pins to the cams, from the input to the planets, and from both to the
carrier's bores; the feedback of the carrier is in the first step.
"""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np

from rverror.base import units
from rverror.base.arrays import unit_vectors
from rverror.base.directions import direction_signs
from rverror.geartrain.action_line import ContactForces, Contacts
from rverror.geartrain.coupling import carrier_forces
from rverror.geartrain.crank import cam_forces, spline_torque
from rverror.geartrain.cycloid import pin_contacts, pin_forces
from rverror.geartrain.involute import mesh_forces, mesh_normal
from rverror.geartrain.kinematics import (
    DrivePose,
    OperatingConditions,
    Pose,
    frame_orders,
    motion_direction,
    resisted_motion,
    stated_load,
)
from rverror.geartrain.mechanism import Drive, Mechanism, doubt_torque


def pose(
    mechanism: Mechanism,
    theta: Any,
    *,
    direction: Any | None = None,
    time: Any | None = None,
    torque: Any | None = None,
) -> Pose:
    """Nominal motion of a mechanism, with the geometry of every contact where it is a reducer.

    Parameters
    ----------
    mechanism : Reducer or Drive
    theta : array_like or quantity, shape (n,), or OperatingConditions
        Nominal output angle, rad; or the conditions of a run, which say all of the following too.
    direction : {"forward", "reverse"} or +1 or -1, or array_like of them, optional
        One for all samples, or one for each; read from the angles where left out.
    time : array_like or quantity, shape (n,), optional
        Time of each sample, s.
    torque : float, str, quantity, array_like or callable, optional
        Size of the load torque at the output, N*mm; needed by ``load.torsion``.  Or a torque at each angle, positive
        where it resists forward motion, or a function of the angle.

    Returns
    -------
    Pose
        A `Contacts` for a reducer, a `DrivePose` for a drive.

    Raises
    ------
    ValueError
        If the angles are not a row of finite numbers or the direction is no direction.
    """
    if isinstance(theta, OperatingConditions):
        if not direction is time is torque is None:
            raise ValueError("conditions say direction, time and torque themselves; leave these out beside them")
        return motion(mechanism, theta)
    number: Any = getattr(torque, "magnitude", torque)
    over_angle = callable(torque) or np.ndim(number) > 0
    if torque is not None and not callable(torque):
        doubt_torque(mechanism, torque)
    size, load = (None, torque) if over_angle else (torque, None)
    return _placed(mechanism, theta=theta, direction=direction, time=time, torque=size, load=load)


def motion(mechanism: Mechanism, conditions: OperatingConditions) -> Pose:
    """`pose` under conditions, which are checked as angles are.

    Parameters
    ----------
    mechanism : Reducer or Drive
    conditions : OperatingConditions

    Returns
    -------
    Pose
    """
    return _placed(mechanism, **{field.name: getattr(conditions, field.name) for field in fields(OperatingConditions)})


def _placed(
    mechanism: Mechanism, *, theta: Any, direction: Any, time: Any, torque: Any, load: Any, **more: Any
) -> Pose:
    """Pose in core units, with one direction and load per angle, and refused where nothing can be at them."""
    angle = np.atleast_1d(units.to_core_array(theta, "angle"))
    if angle.ndim != 1 or angle.size == 0:
        raise ValueError(f"theta has the shape {angle.shape}; give a row of one or more angles")
    sense = motion_direction(angle) if direction is None else direction_signs(direction)
    clock = None if time is None else units.to_core_array(time, "time")
    if load is not None:
        if torque is not None:
            raise ValueError("torque and load: give one of them, a size for all angles or a torque at each")
        load = units.to_core_array(load(angle) if callable(load) else load, "torque")
    for name, row in (("direction", sense), ("time", clock), ("torque", load)):
        if row is not None and row.shape not in ((), angle.shape):
            raise ValueError(f"{name} has the shape {row.shape}; give one value per angle, {angle.shape}")
    sense = np.array(np.broadcast_to(sense, angle.shape))
    load = None if load is None else np.array(np.broadcast_to(load, angle.shape))
    size = None if torque is None else units.named_core("torque", torque, "torque")
    same = {"theta": angle, "direction": sense, "time": clock, "torque": size, "load": load, **more}
    if isinstance(mechanism, Drive):
        return DrivePose(ratio=mechanism.ratio, drive=mechanism, **same)
    reducer = mechanism
    turns = {part: order * angle for part, order in frame_orders(reducer).items()}
    phases = 2 * np.pi * np.arange(reducer.discs) / reducer.discs
    eccentric = turns["crank"] + phases[:, None]
    position = turns["carrier"] + (2 * np.pi * np.arange(reducer.cranks) / reducer.cranks)[:, None]
    normal, arm, point = pin_contacts(reducer, eccentric)
    return Contacts(
        ratio=reducer.ratio,
        reducer=reducer,
        turns=turns,
        sense=frame_orders(reducer)["carrier"] * resisted_motion(sense, load),
        eccentric=eccentric,
        crank_position=position,
        pin_normal=normal,
        pin_arm=arm,
        pin_point=point,
        mesh_normal=mesh_normal(reducer, position),
        **same,
    )


def closed_form_forces(where: Pose) -> ContactForces:
    """Contact forces per unit of output torque, rigid bearings and equal contact stiffness.

    Parameters
    ----------
    where : Pose
        From `pose`.

    Returns
    -------
    mapping of str to ndarray
        For every key of `action_line.CONTACT_AXES`; only ``output`` for a drive.  Under a known torque ``"load"`` is
        that torque with the sign of the motion, shape (1, n), for what gives way under it.
    """
    output = np.ones((1, where.theta.size))
    if not isinstance(where, Contacts):
        return {"output": output}
    pins = pin_forces(where)
    cams = cam_forces(where, pin_forces=pins)
    meshes = mesh_forces(where)
    bores = carrier_forces(cam_forces=cams, mesh_forces=meshes)
    known = where.torque is not None or where.load is not None
    load = {"load": stated_load(where, "load")[None]} if known else {}
    return {
        **load,
        "pin": pins,
        "cam": cams,
        "cam direction": unit_vectors(cams * where.resisted),
        "carrier": bores,
        "carrier direction": unit_vectors(bores * where.resisted),
        "mesh": meshes,
        "spline": spline_torque(where.reducer, where.sense),
        "output": output,
    }
