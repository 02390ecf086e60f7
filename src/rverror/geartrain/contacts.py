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
from rverror.geartrain.mechanism import Drive, Mechanism, core_torque, doubt_torque


def pose(
    mechanism: Mechanism,
    theta: Any,
    *,
    direction: Any | None = None,
    time: Any | None = None,
    torque: Any | None = None,
    load: Any | None = None,
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
    torque : float or quantity, optional
        Size of the load torque at the output, N*mm; needed by ``load.torsion``.
    load : array_like, quantity or callable, optional
        In place of the torque: at each angle, positive where it resists forward motion, or a function of the angle.

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
        if not direction is time is torque is load is None:
            raise ValueError("conditions say direction, time and torque themselves; leave these out beside them")
        return motion(mechanism, theta)
    size = None if torque is None else core_torque(mechanism, torque)
    if load is not None and not callable(load):
        doubt_torque(mechanism, load)
    return _placed(mechanism, _checked(theta, direction, time=time, torque=size, load=load))


def torque_or_load(torque: Any | None) -> dict[str, Any]:
    """What a user gives as torque, as `pose` takes it: one size, or a load over the angle.

    Examples
    --------
    >>> sorted(torque_or_load("20 N*m")), sorted(torque_or_load([20e3, -20e3]))
    (['torque'], ['load'])
    """
    size: Any = getattr(torque, "magnitude", torque)
    many = callable(torque) or np.ndim(size) > 0
    return {"load" if many else "torque": torque}


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
    same = {field.name: getattr(conditions, field.name) for field in fields(OperatingConditions)}
    checked = _checked(**{name: same[name] for name in ("theta", "direction", "time", "torque", "load")})
    return _placed(mechanism, {**same, **checked})


def _checked(
    theta: Any, direction: Any | None, *, time: Any | None, torque: Any | None, load: Any | None
) -> dict[str, Any]:
    """Conditions in core units, with one direction per angle, and refused where nothing can be at them."""
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
    return {
        "theta": angle,
        "direction": np.array(np.broadcast_to(sense, angle.shape)),
        "time": clock,
        "torque": None if torque is None else units.to_core(torque, "torque"),
        "load": None if load is None else np.array(np.broadcast_to(load, angle.shape)),
    }


def _placed(mechanism: Mechanism, same: dict[str, Any]) -> Pose:
    if isinstance(mechanism, Drive):
        return DrivePose(ratio=mechanism.ratio, drive=mechanism, **same)
    reducer = mechanism
    turns = {part: order * same["theta"] for part, order in frame_orders(reducer).items()}
    phases = 2 * np.pi * np.arange(reducer.discs) / reducer.discs
    eccentric = turns["crank"] + phases[:, None]
    position = turns["carrier"] + (2 * np.pi * np.arange(reducer.cranks) / reducer.cranks)[:, None]
    normal, arm, point = pin_contacts(reducer, eccentric)
    return Contacts(
        ratio=reducer.ratio,
        reducer=reducer,
        turns=turns,
        sense=frame_orders(reducer)["carrier"] * resisted_motion(same["direction"], same["load"]),
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
