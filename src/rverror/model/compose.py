"""The composer: model -> influence of every source -> output error."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rverror.base.arrays import Array
from rverror.base.errors import check_kind
from rverror.geartrain.action_line import ContactForces, project, project_all
from rverror.geartrain.contacts import closed_form_forces, pose
from rverror.geartrain.kinematics import Pose, whole_turn
from rverror.geartrain.mechanism import Drive, Mechanism, Reducer
from rverror.geartrain.source import IndexValue
from rverror.model.catalogue import source
from rverror.model.effects import Effect, Model, check_model
from rverror.model.readings import stand
from rverror.model.results import Influence


def influence(
    mechanism: Mechanism,
    theta: Any | None,
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
    theta : array_like, str or quantity, shape (n,) or one angle, or OperatingConditions
        Nominal output angle, rad; or the conditions of a run, in place of direction, time and torque.  None for the
        angles of one output turn that hold the orders of mechanism and source.
    key : str
        A key of the catalogue.
    direction : {"forward", "reverse"} or +1 or -1, or array_like of them, optional
        Read from the angles where left out.
    time : array_like or quantity, shape (n,), optional
        Needed by ``sensor.time_offset``.
    torque : float, quantity, array_like or callable, optional
        Needed by ``load.torsion``; as `equilibrium` takes it.
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
    check_kind("key", key, str, "give a key of the catalogue and its indices, such as 'crank.index', crank=0")
    remedy = "give reducer('RV-40E'), model.mechanism, or ask model.influence(theta, key)"
    check_kind("mechanism", mechanism, (Reducer, Drive), remedy)
    entry = source(key)
    entry.check_indices(mechanism, indices)
    angles = whole_turn(mechanism, entry.orders(mechanism, indices)) if theta is None else theta
    motion = pose(mechanism, angles, direction=direction, time=time, torque=torque)
    matrix = source_matrix(motion, closed_form_forces(motion) if forces is None else forces, key, indices)
    return Influence(matrix, tuple(p.name for p in entry.parameters), motion.theta, key)


def source_matrix(motion: Pose, forces: ContactForces, key: str, indices: Mapping[str, IndexValue]) -> Array:
    """Influence of one source, (terms, n), by contact forces from `closed_form_forces` or `linearise`."""
    return project(forces, source(key).vector(motion, **indices), motion.theta.size)


def source_matrices(
    motion: Pose, forces: ContactForces, named: Sequence[tuple[str, Mapping[str, IndexValue]]]
) -> Array:
    """Influence of every parameter of sources by key and indices, one under another in their order, (parameters, n)."""
    vectors = (source(key).vector(motion, **indices) for key, indices in named)
    influence = np.empty((sum(len(source(key).parameters) for key, _ in named), motion.theta.size))
    project_all(forces, vectors, influence)
    return influence


def effect_matrix(motion: Pose, forces: ContactForces, effects: tuple[Effect, ...]) -> Array:
    """Influence of every parameter of every effect, one under another in their order, (parameters, n)."""
    return source_matrices(motion, forces, [(effect.key, effect.indices) for effect in effects])


def effect_values(effects: tuple[Effect, ...]) -> Array:
    """Values of every parameter of every effect, in the order of `effect_matrix`, core units."""
    return np.array([value for effect in effects for value in effect.values], dtype=np.float64)


def transmission_error(
    model: Model,
    theta: Any | None = None,
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
    theta : array_like, str or quantity, shape (n,) or one angle, or OperatingConditions, optional
        Nominal output angle, rad; or the conditions of a run, in place of direction, time and torque.  `Model.angles`
        where left out.
    direction, time, torque, forces : optional
        As in `influence`.

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
    rows = _influences(model, theta, forces, direction=direction, time=time, torque=torque)
    return np.asarray(effect_values(model.effects) @ np.concatenate(rows), dtype=np.float64)


def transmission_error_by_effect(
    model: Model,
    theta: Any | None = None,
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
    theta : array_like, str or quantity, shape (n,) or one angle, or OperatingConditions, optional
        Nominal output angle, rad; or the conditions of a run, in place of direction, time and torque.  `Model.angles`
        where left out.
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
    rows = _influences(model, theta, forces, direction=direction, time=time, torque=torque)
    parts = [np.array(effect.values) @ part for effect, part in zip(model.effects, rows[1:], strict=True)]
    return np.array(parts, dtype=np.float64).reshape(len(parts), rows[0].shape[1])


def _influences(model: Model, theta: Any | None, forces: ContactForces | None, **conditions: Any) -> list[Array]:
    """Influence matrix of each effect, after one without rows."""
    check_model(model)
    where = stand(model, pose(model.mechanism, model.angles if theta is None else theta, **conditions))
    used = closed_form_forces(where.gears) if forces is None else forces
    return [
        np.zeros((0, where.read.theta.size)),
        *(source_matrix(where.of(effect.key), used, effect.key, effect.indices) for effect in model.effects),
    ]
