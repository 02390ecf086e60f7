"""The composer: model -> influence of every source -> output error."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from rverror import units
from rverror.action_line import Array, ContactForces, Contacts, project, unit_vectors
from rverror.catalogue import IndexValue, Mechanism, source
from rverror.coupling import carrier_forces
from rverror.crank import cam_forces, spline_torque
from rverror.cycloid import pin_contacts, pin_forces
from rverror.involute import mesh_forces, mesh_normal
from rverror.kinematics import Pose, frame_orders, motion_direction
from rverror.model import Effect, Model
from rverror.reducer import Drive, Reducer
from rverror.shaft import DrivePose
from rverror.views import Viewed


@dataclass(frozen=True)
class Influence(Viewed):
    """Influence of one source on the output error.

    Attributes
    ----------
    matrix : ndarray, shape (terms, n)
        rad of output per mm (or rad, or unit) of each parameter.
    labels : tuple of str
        Name of each parameter.
    theta : ndarray, shape (n,)
        Nominal output angle, rad.
    key : str
        The source.
    """

    matrix: Array
    labels: tuple[str, ...]
    theta: Array
    key: str


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
    theta : array_like or quantity, shape (n,)
        Nominal output angle, rad.
    direction : float or array_like, optional
        +1 forward, -1 reverse, one value or one per sample; read from the angles where left out.
    time : array_like or quantity, shape (n,), optional
        Time of each sample, s.
    torque : float or quantity, optional
        Size of the load torque at the output, N*mm; needed by ``load.torsion``.

    Returns
    -------
    Pose
        A `Contacts` for a reducer, a `DrivePose` for a drive.

    Raises
    ------
    ValueError
        If the angles are not a row of finite numbers or the direction is neither +1 nor -1.
    """
    angle = units.to_core_array(theta, "angle")
    if angle.ndim != 1 or angle.size == 0:
        raise ValueError(f"theta has the shape {angle.shape}; give a row of one or more angles")
    sense = motion_direction(angle) if direction is None else np.asarray(direction, dtype=np.float64)
    if not np.isin(sense, (-1.0, 1.0)).all():
        raise ValueError("direction must be +1 (forward) or -1 (reverse)")
    clock = None if time is None else units.to_core_array(time, "time")
    for name, row in (("direction", sense), ("time", clock)):
        if row is not None and row.shape not in ((), angle.shape):
            raise ValueError(f"{name} has the shape {row.shape}; give one value per angle, {angle.shape}")
    sense = np.array(np.broadcast_to(sense, angle.shape))
    load = None if torque is None else units.to_core(torque, "torque")
    if isinstance(mechanism, Drive):
        return DrivePose(ratio=mechanism.ratio, theta=angle, direction=sense, time=clock, torque=load, drive=mechanism)
    return _contacts(mechanism, angle, sense, time=clock, torque=load)


def _contacts(
    reducer: Reducer, theta: Array, direction: Array, *, time: Array | None, torque: float | None
) -> Contacts:
    turns = frame_orders(reducer)
    phases = 2 * np.pi * np.arange(reducer.discs) / reducer.discs
    eccentric = turns["crank"] * theta + phases[:, None]
    position = theta + (2 * np.pi * np.arange(reducer.cranks) / reducer.cranks)[:, None]
    pins = pin_contacts(reducer, eccentric=eccentric, disc_angle=theta)
    return Contacts(
        ratio=reducer.ratio,
        theta=theta,
        direction=direction,
        time=time,
        torque=torque,
        reducer=reducer,
        eccentric=eccentric,
        crank_position=position,
        pin_normal=pins.normal,
        pin_arm=pins.arm,
        pin_angle=pins.angle,
        mesh_normal=mesh_normal(reducer, position),
    )


def closed_form_forces(motion: Pose) -> ContactForces:
    """Contact forces per unit of output torque, rigid bearings and equal contact stiffness.

    Parameters
    ----------
    motion : Pose
        From `pose`.

    Returns
    -------
    mapping of str to ndarray
        For every key of `action_line.CONTACT_AXES`; only ``output`` for a drive.
    """
    output = np.ones((1, motion.theta.size))
    if not isinstance(motion, Contacts):
        return {"output": output}
    pins = pin_forces(motion)
    cams = cam_forces(motion, pin_forces=pins)
    meshes = mesh_forces(motion)
    bores = carrier_forces(cam_forces=cams, mesh_forces=meshes)
    return {
        "pin": pins,
        "cam": cams,
        "cam direction": unit_vectors(cams * motion.direction),
        "carrier": bores,
        "carrier direction": unit_vectors(bores * motion.direction),
        "mesh": meshes,
        "spline": spline_torque(motion.reducer, motion.direction),
        "output": output,
    }


def influence(
    mechanism: Mechanism,
    theta: Any,
    key: str,
    *,
    direction: Any | None = None,
    time: Any | None = None,
    torque: Any | None = None,
    forces: ContactForces | None = None,
    **indices: IndexValue,
) -> Influence:
    """Influence of one source on the output error.

    Parameters
    ----------
    mechanism : Reducer or Drive
    theta : array_like or quantity, shape (n,)
        Nominal output angle, rad.
    key : str
        A key of the catalogue.
    direction : float or array_like, optional
        +1 forward, -1 reverse; read from the angles where left out.
    time : array_like or quantity, shape (n,), optional
        Needed by ``sensor.time_offset``.
    torque : float or quantity, optional
        Needed by ``load.torsion``.
    forces : mapping of str to ndarray, optional
        Contact forces per unit of output torque, from `linearise`; the closed form where left out.
    **indices
        Which crank, disc, pin, harmonic: the indices of the source.

    Returns
    -------
    Influence
        `matrix` of shape (terms, n) in rad per mm (or rad), and `labels`.

    Raises
    ------
    ValueError
        If the key or an index is unknown or out of range.

    Examples
    --------
    >>> import numpy as np, rverror
    >>> theta = np.linspace(0, 2 * np.pi, 4096)
    >>> bore = influence(rverror.reducer("RV-40E"), theta, "coupling.carrier_bore_position", crank=0)
    >>> bore.labels
    ('radial', 'tangential')
    >>> bool(np.allclose(bore.matrix[1], -1 / (2 * 27)))
    True
    """
    entry = source(key)
    entry.check_indices(mechanism, indices)
    motion = pose(mechanism, theta, direction=direction, time=time, torque=torque)
    matrix = source_matrix(motion, closed_form_forces(motion) if forces is None else forces, key, indices)
    return Influence(matrix, tuple(p.name for p in entry.parameters), motion.theta, key)


def source_matrix(motion: Pose, forces: ContactForces, key: str, indices: Mapping[str, IndexValue]) -> Array:
    """Influence matrix of one source for given contact forces.

    Parameters
    ----------
    motion : Pose
    forces : mapping of str to ndarray
        From `closed_form_forces` or `linearise`.
    key : str
    indices : mapping

    Returns
    -------
    ndarray, shape (terms, n)
    """
    return project(forces, source(key).vector(motion, **indices), motion.theta.size)


def effect_matrix(motion: Pose, forces: ContactForces, effects: tuple[Effect, ...]) -> Array:
    """Influence of every parameter of every effect, one under another.

    Parameters
    ----------
    motion : Pose
    forces : mapping of str to ndarray
    effects : tuple of Effect

    Returns
    -------
    ndarray, shape (parameters, n)
        In the order of the effects and of each source's parameters.
    """
    if not effects:
        return np.zeros((0, motion.theta.size))
    return np.concatenate([source_matrix(motion, forces, e.key, e.indices) for e in effects])


def effect_values(effects: tuple[Effect, ...]) -> Array:
    """Values of every parameter of every effect, in the order of `effect_matrix`, core units."""
    return np.array([value for effect in effects for value in effect.values], dtype=np.float64)


def transmission_error(
    model: Model,
    theta: Any,
    *,
    direction: Any | None = None,
    time: Any | None = None,
    torque: Any | None = None,
    forces: ContactForces | None = None,
) -> Array:
    """Transmission error of a model, actual output less input / R, as a sum of influences: one matrix product.

    Parameters
    ----------
    model : Model
    theta : array_like or quantity, shape (n,)
        Nominal output angle, rad.
    direction : float or array_like, optional
        +1 forward, -1 reverse; read from the angles where left out.
    time : array_like or quantity, shape (n,), optional
        Needed by ``sensor.time_offset``.
    torque : float or quantity, optional
        Needed by ``load.torsion``.
    forces : mapping of str to ndarray, optional
        Contact forces per unit of output torque, from `linearise`; the closed form where left out.

    Returns
    -------
    ndarray, shape (n,)
        rad, positive where the output leads.

    Raises
    ------
    ValueError
        If the angles are unusable.

    Examples
    --------
    >>> import numpy as np, rverror
    >>> unit = rverror.Model(rverror.reducer("RV-40E"), (rverror.effect("crank.index", crank=0, angle="4 mrad"),))
    >>> te = transmission_error(unit, np.linspace(0, 1, 5))
    >>> bool(np.allclose(te, -3 / 121 / 2 * 0.004))
    True
    """
    rows = _influences(model, theta, direction=direction, time=time, torque=torque, forces=forces)
    return np.asarray(effect_values(model.effects) @ np.concatenate(rows), dtype=np.float64)


def transmission_error_by_effect(
    model: Model,
    theta: Any,
    *,
    direction: Any | None = None,
    time: Any | None = None,
    torque: Any | None = None,
    forces: ContactForces | None = None,
) -> Array:
    """Part of the transmission error that each effect of a model makes; the rows add up to `transmission_error`.

    Parameters
    ----------
    model : Model
    theta : array_like or quantity, shape (n,)
        Nominal output angle, rad.
    direction, time, torque, forces : optional
        As in `transmission_error`.

    Returns
    -------
    ndarray, shape (effects, n)
        rad.

    Examples
    --------
    >>> import numpy as np, rverror
    >>> lead = rverror.effect("crank.index", crank=0, angle="4 mrad")
    >>> wave = rverror.effect("crank.eccentricity", crank=0, disc=1, radial="5 um")
    >>> unit = rverror.Model(rverror.reducer("RV-40E"), (lead, wave))
    >>> theta = np.linspace(0, 1, 5)
    >>> parts = transmission_error_by_effect(unit, theta)
    >>> parts.shape
    (2, 5)
    >>> bool(np.allclose(parts.sum(axis=0), transmission_error(unit, theta)))
    True
    """
    rows = _influences(model, theta, direction=direction, time=time, torque=torque, forces=forces)
    parts = [np.array(effect.values) @ part for effect, part in zip(model.effects, rows[1:], strict=True)]
    return np.array(parts, dtype=np.float64).reshape(len(parts), rows[0].shape[1])


def _influences(
    model: Model,
    theta: Any,
    *,
    direction: Any | None,
    time: Any | None,
    torque: Any | None,
    forces: ContactForces | None,
) -> list[Array]:
    """Influence matrix of each effect, after one without rows.

    The gear train stands at its marks, the measuring chain at the bench's zero.
    """
    motion = pose(model.mechanism, theta, direction=direction, time=time, torque=torque)
    gears = motion
    if model.index_offset:
        turned = motion.theta + model.index_offset
        gears = pose(model.mechanism, turned, direction=motion.direction, time=time, torque=torque)
    used = closed_form_forces(gears) if forces is None else forces
    return [
        np.zeros((0, motion.theta.size)),
        *(
            source_matrix(motion if source(effect.key).at_output else gears, used, effect.key, effect.indices)
            for effect in model.effects
        ),
    ]
