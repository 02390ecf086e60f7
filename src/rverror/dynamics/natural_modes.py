"""Natural frequencies and shapes of a gear train about a loaded state, and what each of them hangs on."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array, Flags
from rverror.base.directions import Direction, direction_sign
from rverror.base.viewed import Viewed
from rverror.dynamics.train import SUPPORTED, Train, loaded_reducer, natural_motions, whole_inertia
from rverror.geartrain.contacts import pose
from rverror.geartrain.mechanism import Inertia
from rverror.model.effects import Model, check_model
from rverror.model.readings import stand
from rverror.statics.loaded_state import statics_of

_ALIKE = 1e-6  # of two motions that differ by less neither moves most: far above rounding, far below what differs


@dataclass(frozen=True)
class Modes(Viewed):
    """Natural modes of a gear train about a loaded state, from the lowest frequency up.

    Attributes
    ----------
    frequency : ndarray, shape (m,)
        Undamped, Hz; 0 where nothing holds the motion.
    damping_ratio : ndarray, shape (m,)
        0 where nothing holds it.  By contact that of the mode alone: what damping couples it with is left out.
    shape : mapping of str to ndarray
        Motion of each part at a modal mass of 1 kg: x and y (mm per mm) and angle (rad per mm), (3, m); of a sun whose
        angle is held (2, m); of input and load the angle, (1, m).  What moves most, weighed by the root of its mass or
        inertia, moves the positive way; of several alike the first does.
    strain_energy : mapping of str to ndarray, each of shape (m,)
        Share that each group of contacts, by its name in ``[reducer.stiffness]``, and each spring of ``[bench]`` holds.
    kinetic_energy : mapping of str to ndarray, each of shape (m,)
        Share of each mass and inertia, by its name in ``[reducer.inertia]`` or ``[bench]``.
    sensitivity : mapping of str to ndarray, each of shape (m,)
        Change of the frequency with the logarithm of each stiffness and inertia, Hz: with 1 % more of it the frequency
        grows by a hundredth of that.  The contacts that carry are taken as those that do.
    of_sun_support : ndarray of bool, shape (m,)
        Whether the sun's support holds more than half of the strain energy: no mode of the machine.
    inertia : Inertia
        What was reckoned with.
    estimated : tuple of str
        Which of it was estimated from the geometry.
    torque, theta, direction : float
        Where: N*mm, rad, +1 or -1.
    model : Model
        Whose modes they are.
    """

    frequency: Array
    damping_ratio: Array
    shape: Mapping[str, Array]
    strain_energy: Mapping[str, Array]
    kinetic_energy: Mapping[str, Array]
    sensitivity: Mapping[str, Array]
    of_sun_support: Flags
    inertia: Inertia
    estimated: tuple[str, ...]
    torque: float
    theta: float
    direction: float
    model: Model

    @property
    def lowest(self) -> int | None:
        """Number of the lowest mode of the machine, from 0: neither free nor of the sun's support; None without one."""
        own = np.flatnonzero((self.frequency > 0) & ~self.of_sun_support)
        return int(own[0]) if own.size else None


def modes(model: Model, *, torque: Any | None = None, theta: Any = 0.0, direction: Direction = "forward") -> Modes:
    """Natural modes of a reducer about its loaded state at one angle.

    Parameters
    ----------
    model : Model
        Of a reducer; its effects, stiffness, inertia and bench count.
    torque : float or quantity, optional
        Size of the output torque, N*mm; the rated torque where left out.  0 is the limit of a vanishing load.
    theta : float or quantity
        Nominal output angle, rad.
    direction : {"forward", "reverse"} or +1 or -1

    Returns
    -------
    Modes

    Raises
    ------
    InputError
        If the model is no reducer, or there is no torque.
    NotConvergedError
        If there is no equilibrium.

    Notes
    -----
    K phi = omega^2 M phi with the contacts that carry held closed; what the frequencies change with comes from
    d omega^2 = phi^T (dK - omega^2 dM) phi / phi^T M phi.  Source 001 has the equation without the bench.

    Examples
    --------
    >>> import rverror
    >>> bench = rverror.model.Bench(input_inertia="1e-4 kg*m^2", position_control_stiffness=0)
    >>> found = modes(rverror.Model(rverror.reducer("RV-40E"), bench=bench))
    >>> bool(found.frequency[0] == 0 and found.frequency[1] > 0)  # nothing holds the input: one free turn of the train
    True
    """
    check_model(model)
    direction = direction_sign(direction)
    unit, size = loaded_reducer(model, torque)
    angle = units.to_core(theta, "angle")
    train = Train(unit, model.bench)
    where = stand(model, pose(unit, [angle], torque=units.InCore(size), direction=direction)).gears
    state = statics_of(unit, where).settled(model.effects)
    groups = {name: matrix[0] for name, matrix in train.stiffness(state).items()}
    value, phi = natural_motions(np.asarray(sum(groups.values())), train.mass)
    # the first of those that move most tells the sign: of cranks alike another would by rounding
    moved = np.abs(phi) * np.sqrt(train.mass)[:, None]
    most = (moved > (1 - _ALIKE) * moved.max(axis=0)).argmax(axis=0)
    phi *= np.where(phi[most, np.arange(most.size)] < 0, -1.0, 1.0)
    frequency = np.sqrt(value) / (2 * math.pi)
    # phi has a modal mass of one tonne
    strain = {
        name: np.divide((phi * (matrix @ phi)).sum(axis=0), value, out=np.zeros_like(value), where=value > 0)
        for name, matrix in groups.items()
    }
    kinetic = {name: (own[:, None] * phi**2).sum(axis=0) for name, own in train.inertias.items()}
    ratio = np.where(value > 0, model.bench.ratio_of_modes, 0.0)
    if model.bench.damping_times:
        lost = (phi * (train.damping(groups) @ phi)).sum(axis=0)
        ratio = np.divide(lost, 2 * np.sqrt(value), out=np.zeros_like(value), where=value > 0)
    changes = {name: frequency * share / 2 for name, share in strain.items()}
    changes |= {name: -frequency * share / 2 for name, share in kinetic.items()}
    return Modes(
        frequency=frequency,
        damping_ratio=ratio,
        shape={name: phi[list(at)] * math.sqrt(units.unit_factor("kg", "mass")) for name, at in train.parts.items()},
        strain_energy=strain,
        kinetic_energy=kinetic,
        sensitivity=changes,
        of_sun_support=strain["sun_support"] > SUPPORTED,
        inertia=whole_inertia(unit),
        estimated=tuple(name for name in train.inertias if getattr(unit.inertia, name, 0.0) is None),
        torque=size,
        theta=angle,
        direction=direction,
        model=model,
    )
