"""Virtual test bench: runs computed from a model, as the encoders of a bench would read and write them.

The gear train moves the output by its transmission error, the measuring chain adds what it reads wrongly (sensor.*) and
coloured noise, and each encoder rounds to its counts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import scipy

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.directions import Direction, direction_sign
from rverror.base.errors import InputError, refusing, renamed
from rverror.base.numbers import way
from rverror.base.quantities import COUNT, Checked, NumberField, quantity
from rverror.geartrain.contacts import motion
from rverror.geartrain.kinematics import OperatingConditions, samples_needed
from rverror.geartrain.mechanism import Drive, Mechanism, Reducer, doubt_torque
from rverror.geartrain.torque_over_turn import TorqueLaw
from rverror.model.catalogue import source
from rverror.model.compose import transmission_error
from rverror.model.effects import Model, check_model
from rverror.model.readings import added, misread, unread
from rverror.runs.measurement import Run, run_from_arrays
from rverror.statics.loaded_state import equilibrium

#: Seed of the noise where none is given: a simulation gives the same run each time.
DEFAULT_SEED = 0
#: Label of the zero that the runs of one call share.
SHARED_INDEX = "simulated"

_LARGEST = 5_000_000
_TORQUE = NumberField("torque", "20 N*m", least=0.0, most=1e12)
_AT_ONCE = 4096  # angles solved together: bounds the memory


@renamed(speed="output_speed")
def simulate(
    model: Model,
    *,
    points: int | None = None,
    revolutions: int = 1,
    torque: Any | None = None,
    method: str = "closed",
    direction: Direction = "forward",
    noise: Any | None = None,
    correlation: Any | None = None,
    input_counts: int | None = None,
    output_counts: int | None = None,
    seed: int | None = None,
    output_speed: Any | None = None,
) -> Run:
    """Compute the run that a bench would record; without noise and counts, one that reads every angle exactly.

    Parameters
    ----------
    model : Model
    points : int, optional
        Samples per output turn; what the highest mesh order needs where left out.
    revolutions : int
        Output turns.
    torque : float, quantity or callable, optional
        Size of the output torque, plain numbers N*mm; needed by the equilibrium, and written into the run.  The
        equilibrium also takes 0, the limit of no load.  A function of the output angle, such as a `GravityArm`, becomes
        a column: positive where it resists forward motion.
    method : {"closed", "equilibrium"}
        Closed form, or the loaded equilibrium.
    direction : {"forward", "reverse"} or +1 or -1
    noise : float or quantity, optional
        rms of the noise on the transmission error, plain numbers rad.
    correlation : float or quantity, optional
        Output angle over which the noise's autocorrelation falls to 1/e, plain numbers rad; white where left out or 0.
    input_counts, output_counts : int, optional
        Counts per turn to which each encoder rounds.
    seed : int, optional
        Of the noise; `DEFAULT_SEED` where left out.
    output_speed : float or quantity, optional
        Output speed, plain numbers rad/s; gives the run its time, which ``sensor.time_offset`` needs.

    Returns
    -------
    Run

    Raises
    ------
    InputError
        If a number is out of range or the method cannot be used with the model.

    Notes
    -----
    The noise depends on seed, points, direction and torque alone: closed form and equilibrium, and models that differ,
    get the same under the same conditions; other directions and torques get noise of their own.  The same call gives
    the same run to the last bit on one machine and version of numpy.

    Examples
    --------
    >>> import rverror
    >>> run = simulate(rverror.Model(rverror.reducer("RV-40E")), points=64, noise="0.3 arcsec", output_counts=2**20)
    >>> run.input_angle.size, run.metadata["noise"], run.metadata["seed"]
    (64, '0.3 arcsec', '0')
    """
    return simulate_runs(
        model,
        directions=(direction,),
        torques=(torque,),
        points=points,
        revolutions=revolutions,
        method=method,
        noise=noise,
        correlation=correlation,
        input_counts=input_counts,
        output_counts=output_counts,
        seed=seed,
        output_speed=output_speed,
    )[0]


@renamed(speed="output_speed")
def simulate_runs(
    model: Model,
    *,
    directions: Sequence[Direction] = ("forward", "reverse"),
    torques: Sequence[Any] = (),
    points: int | None = None,
    revolutions: int = 1,
    method: str = "closed",
    noise: Any | None = None,
    correlation: Any | None = None,
    input_counts: int | None = None,
    output_counts: int | None = None,
    seed: int | None = None,
    output_speed: Any | None = None,
) -> tuple[Run, ...]:
    """Compute the runs of one session on the bench: every torque in every direction.

    Parameters
    ----------
    model : Model
    directions : sequence of {"forward", "reverse"} or +1 or -1
    torques : sequence of float, quantity or callable
        As `simulate` takes one; empty for runs without a torque.
    points, revolutions, method, noise, correlation, input_counts, output_counts, seed, output_speed : optional
        As in `simulate`.

    Returns
    -------
    tuple of Run
        Torque by torque, each in all directions.  Where there are several they hold one index, because encoders whose
        zero never moves read them.

    Raises
    ------
    InputError
        As `simulate`, and if two runs would be the same.

    Examples
    --------
    >>> import rverror
    >>> model = rverror.Model(rverror.reducer("RV-40E"))
    >>> runs = simulate_runs(model, torques=("20 N*m", "100 N*m"), points=64)
    >>> [run_label(run.direction[0], run.torque) for run in runs]
    ['forward-20Nm', 'reverse-20Nm', 'forward-100Nm', 'reverse-100Nm']
    """
    check_model(model)
    unit = model.mechanism
    if points is None:
        points = samples_needed(unit) if isinstance(unit, Reducer) else 4096
    if correlation is not None and noise is None:
        raise InputError("correlation: there is no noise to be correlated; give --noise '0.3 arcsec' too")
    with refusing(""):
        bench = _Bench(
            points=points,
            revolutions=revolutions,
            method=method,
            noise=0.0 if noise is None else noise,
            correlation=0.0 if correlation is None else correlation,
            input_counts=input_counts,
            output_counts=output_counts,
            seed=DEFAULT_SEED if seed is None else seed,
            output_speed=output_speed,
        )
        sizes = [_torque(unit, torque, bench.method) for torque in torques] or [None]
    samples = points * bench.revolutions
    if samples > _LARGEST:
        raise InputError(f"points * revolutions = {samples}: must be {_LARGEST} or fewer; ask for fewer")
    timed = [effect.key for effect in model.effects if "time" in source(effect.key).needs]
    if timed and bench.output_speed is None:
        raise InputError(f"{timed[0]} needs time; give a speed, e.g. --speed '10 deg/s', or remove the effect")
    if bench.method == "equilibrium":
        if not isinstance(unit, Reducer):
            raise InputError("method = equilibrium: a [drive] has no geometry; use --method closed")
        if None in sizes:
            raise InputError("method = equilibrium: needs a torque; give one, e.g. --torque '20 N*m'")
    senses = [direction_sign(direction) for direction in directions]
    conditions = [(sense, size) for size in sizes for sense in senses]
    labels = [run_label(*condition) for condition in conditions]
    if twice := [label for i, label in enumerate(labels) if label in labels[:i]]:
        raise InputError(f"{twice[0]}: this run is asked for twice; give each torque and direction once")
    index = SHARED_INDEX if len(conditions) > 1 else ""
    return tuple(_run(model, bench, index, direction, size) for direction, size in conditions)


def run_label(direction: float, torque: float | TorqueLaw | None) -> str:
    """Name of a run among those of one bench; the noise of a run is drawn from the seed and this name.

    Direction and torque, N*mm, are those of `simulate`.

    Examples
    --------
    >>> run_label(-1.0, 20e3), run_label(1.0, None), run_label(1.0, np.cos)
    ('reverse-20Nm', 'forward', 'forward-arm')
    """
    if callable(torque):
        return f"{way(direction)}-arm"
    return way(direction) if torque is None else f"{way(direction)}-{torque / 1e3:.12g}Nm"


def coloured_noise(count: int, *, rms: float, step: float, correlation: float, random: np.random.Generator) -> Array:
    """Stationary Gaussian noise whose autocorrelation falls as exp(-distance / correlation).

    Parameters
    ----------
    count : int
        Samples.
    rms : float
        Of the process; one stretch that is short against the correlation strays from it.
    step : float
        Distance of neighbours.
    correlation : float
        In the unit of `step`; white where 0.
    random : numpy.random.Generator

    Returns
    -------
    ndarray, shape (count,)
        In the unit of `rms`.

    Notes
    -----
    An Ornstein-Uhlenbeck process, sampled: x_k = rho x_(k-1) + sqrt(1 - rho^2) rms e_k.  The first sample has the
    process's own spread, so there is nothing to settle.

    Examples
    --------
    >>> noise = coloured_noise(20_000, rms=0.5, step=0.1, correlation=2.0, random=np.random.default_rng(1))
    >>> bool(0.4 < noise.std() < 0.6)
    True
    """

    drawn = rms * random.standard_normal(count)
    if correlation == 0:
        return drawn
    drawn[1:] *= math.sqrt(-math.expm1(-2 * step / correlation))
    return np.asarray(scipy.signal.lfilter([1.0], [1.0, -math.exp(-step / correlation)], drawn), dtype=np.float64)


def quantised(angle: Array, counts: int) -> Array:
    """Reading of an encoder of so many counts per turn: the nearest of its angles, rad.

    Examples
    --------
    >>> np.degrees(quantised(np.radians([44.0, 46.0]), 4))
    array([ 0., 90.])
    """
    # adding 0 turns -0, which would be printed, into 0
    return np.asarray((np.rint(angle / (2 * math.pi) * counts) + 0.0) * (2 * math.pi) / counts, dtype=np.float64)


_COUNTS = quantity(COUNT, least=1, most=10**12)


@dataclass(frozen=True, kw_only=True)
class _Bench(Checked):
    """What the bench adds to a run, core units."""

    points: int = field(metadata=quantity(COUNT, least=16))
    revolutions: int = field(default=1, metadata=quantity(COUNT, least=1))
    method: str = "closed"
    #: No bench is worse than half a turn.
    noise: float = field(default=0.0, metadata=quantity("angle", "0.3 arcsec", least=0.0, most=math.pi))
    #: Longer than a run that can be diagnosed, it is a constant.
    correlation: float = field(default=0.0, metadata=quantity("angle", "2 deg", least=0.0, most=200 * math.pi))
    input_counts: int | None = field(default=None, metadata=_COUNTS)
    output_counts: int | None = field(default=None, metadata=_COUNTS)
    #: As much as numpy's pool of entropy holds.
    seed: int = field(default=DEFAULT_SEED, metadata=quantity(COUNT, least=0, most=2**128 - 1))
    #: Beyond, times have no digits left.
    output_speed: float | None = field(
        default=None, metadata=quantity("angular_speed", "10 deg/s", least=1e-8, most=1e5)
    )

    def __post_init__(self) -> None:
        """Convert to core units and check."""
        if self.method not in ("closed", "equilibrium"):
            raise InputError(f"method = {self.method!r}: must be 'closed' or 'equilibrium'")
        super().__post_init__()

    @property
    def metadata(self) -> dict[str, str]:
        """Header keys, named as the options."""
        keys: dict[str, str] = {}
        if self.noise:
            keys["noise"] = f"{self.noise / units.ARCSEC:.15g} arcsec"
            keys["noise correlation"] = f"{math.degrees(self.correlation):.15g} deg"
            keys["seed"] = str(self.seed)
        counts = {"input counts": self.input_counts, "output counts": self.output_counts}
        keys |= {name: str(count) for name, count in counts.items() if count is not None}
        if self.output_speed is not None:
            keys["speed"] = f"{math.degrees(self.output_speed):.15g} deg/s"
        return keys


def _torque(mechanism: Mechanism, value: Any | None, method: str) -> float | TorqueLaw | None:
    if value is None or callable(value):
        law: TorqueLaw | None = value
        return law
    size = _TORQUE.core("torque", value)
    doubt_torque(mechanism, value)
    if size == 0 and method != "equilibrium":
        raise InputError(
            "torque = 0 N*m: must be above 0; the limit of no load needs --method equilibrium, or leave the torque out"
        )
    return size


def _run(model: Model, bench: _Bench, index: str, direction: float, torque: float | TorqueLaw | None) -> Run:
    """One run; what is wrong with the arguments has been found before."""
    unit = model.mechanism
    turn = 2 * math.pi * np.arange(bench.points * bench.revolutions) / bench.points
    theta = turn if direction > 0 else 2 * math.pi * bench.revolutions - turn
    time = None if bench.output_speed is None else turn / bench.output_speed
    size, load = (None, torque(theta)) if callable(torque) else (torque, None)
    conditions = OperatingConditions(theta, direction, size, time, speed=bench.output_speed, load=load)
    error = _error(model, conditions, points=bench.points, method=bench.method)
    if bench.noise:
        key = np.random.SeedSequence(bench.seed, spawn_key=tuple(run_label(direction, torque).encode()))
        error = error + coloured_noise(
            turn.size,
            rms=bench.noise,
            step=2 * math.pi / bench.points,
            correlation=bench.correlation,
            random=np.random.Generator(np.random.PCG64(key)),
        )
    input_angle, output_angle = theta * unit.ratio, theta + error
    run = run_from_arrays(
        input_angle=input_angle if bench.input_counts is None else quantised(input_angle, bench.input_counts),
        output_angle=output_angle if bench.output_counts is None else quantised(output_angle, bench.output_counts),
        time=time,
        direction=way(direction),
        torque=size if load is None else load,
        index=index,
    )
    said = {"simulated": f"rverror, {bench.method}; not a measurement", **bench.metadata}
    return replace(run, metadata={**run.metadata, **said})


def _error(model: Model, conditions: OperatingConditions, *, points: int, method: str) -> Array:
    """Gear train at every angle of one turn where every turn is alike, else of all.

    Readings of the measuring chain may drift from turn to turn, so they are added at all angles.
    """
    unit, theta = model.mechanism, conditions.theta
    gears = unread(model)
    alike = isinstance(unit, Reducer) and unit.exact_ratio.denominator == 1
    count = points if alike else theta.size
    places = np.array_split(np.arange(count), math.ceil(count / _AT_ONCE))
    load = conditions.load
    parts = [replace(conditions, theta=theta[at], time=None, load=None if load is None else load[at]) for at in places]
    with refusing(""):  # an effect that lacks a condition, such as the torque
        solved = [
            transmission_error(gears, part) if method == "closed" else equilibrium(gears, part).transmission_error
            for part in parts
        ]
        read = added(misread(model), motion(Drive(ratio=unit.ratio), conditions))  # what is read needs no contacts
    return np.resize(np.concatenate(solved), theta.size) + read
