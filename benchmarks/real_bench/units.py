"""Virtual test-bench units of every kind that a real bench makes, drawn from a seed.

A unit is a reducer whose parts differ a little from what its model file declares, an effect (or several, or none) that
the file does not declare, and the runs of a bench with its noise.  What a family adds to that stands at its function.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

import rverror

from . import compiled
from .simulator import Law, PartErrors, Reality, Springs, put_effect, transmission_error

ARCSEC = math.pi / 648000
TURN = 2 * math.pi
POINTS = 2048  # samples a revolution
#: White noise, and the innovation of an autoregressive part with its memory from sample to sample, arcsec.
WHITE, INNOVATION, MEMORY = 0.4, 0.12, 0.9
VISIBLE = 0.25  # arcsec rms: about the noise of the mean of three revolutions
UNCERTAINTY = 0.3  # um, 1 sigma of a declared component
STIFFNESS = {
    "pin_contact": 2e5,
    "crank_bearing": 3e5,
    "carrier_bearing": 3e5,
    "gear_mesh": 2e5,
    "sun_support": 1e2,
    "main_bearing": 1e6,
}
INDICES = ("disc", "crank", "pin", "lobe", "harmonic")
OUTSIDE = "not in the catalogue"

Effect = dict[str, Any]  # as in truth.json: key, indices, sizes as strings with their units


@dataclass(frozen=True)
class Kind:
    """How an undeclared effect is drawn: its indices, its parameters, and its size, log-uniform in um or arcsec."""

    indices: Callable[[Any], dict[str, list[Any]]]
    parameters: tuple[str, ...]
    least: float
    most: float
    unit: str = "um"
    weight: float = 1.0


def _none(unit: Any) -> dict[str, list[Any]]:
    return {}


def _over(*names: str, harmonics: tuple[int, ...] = ()) -> Callable[[Any], dict[str, list[Any]]]:
    def indices(unit: Any) -> dict[str, list[Any]]:
        counts = {"disc": unit.discs, "crank": unit.cranks, "pin": unit.pins, "lobe": unit.disc_lobes}
        given: dict[str, list[Any]] = {name: list(range(counts[name])) for name in names}
        return given | ({"harmonic": list(harmonics)} if harmonics else {})

    return indices


WAVE, POLAR, PLANE = ("cos", "sin"), ("radial", "tangential"), ("x", "y")
KINDS: dict[str, Kind] = {
    "cycloid.disc_pitch": Kind(_over("disc", harmonics=(1, 2, 3)), WAVE, 0.5, 12),
    "cycloid.disc_profile": Kind(_over("disc", harmonics=(1, 2, 3, 4)), WAVE, 0.5, 10),
    "crank.eccentricity": Kind(_over("crank", "disc"), POLAR, 0.5, 12),
    "cycloid.disc_bore_position": Kind(_over("disc", "crank"), POLAR, 0.7, 12),
    "coupling.carrier_bore_position": Kind(_over("crank"), POLAR, 2, 25, weight=0.3),
    "coupling.carrier_runout": Kind(_none, PLANE, 2, 30, weight=0.3),
    "cycloid.pin_position": Kind(_over("pin"), POLAR, 5, 25),
    "cycloid.pin_radius": Kind(_over("pin"), ("deviation",), 3, 20),
    "cycloid.pin_circle": Kind(
        _over(harmonics=(0, 1, 2, 3)), ("radial_cos", "radial_sin", "tangential_cos", "tangential_sin"), 2, 20
    ),
    "cycloid.profile_modification": Kind(_none, ("equidistant", "shift"), 2, 20),
    "cycloid.disc_lobe": Kind(_over("disc", "lobe"), ("deviation",), 5, 40, weight=0.3),
    "involute.planet_eccentricity": Kind(_over("crank"), PLANE, 4, 60),
    "involute.sun_eccentricity": Kind(_none, PLANE, 8, 80, weight=0.4),
    "involute.sun_offset": Kind(_none, PLANE, 8, 80, weight=0.4),
    "involute.center_distance": Kind(_over("crank"), POLAR, 8, 80, weight=0.4),
    "involute.planet_pitch": Kind(_over("crank", harmonics=(1, 2, 3)), WAVE, 3, 40),
    "involute.sun_pitch": Kind(_over(harmonics=(1, 2, 3)), WAVE, 3, 40),
    "crank.bearing_clearance": Kind(_none, ("clearance",), 0.8, 12),
    "sensor.encoder_eccentricity": Kind(_none, WAVE, 0.4, 15, "arcsec"),
    "sensor.encoder_ellipticity": Kind(_none, WAVE, 0.4, 10, "arcsec"),
}

#: Fixed in the sun, whose turns a reducer of any ratio does not repeat from turn to turn.
SUN = ("involute.sun_eccentricity", "involute.sun_pitch")

#: Reducers of other ratios: of the shared bench's real-8, of source 003, and of other tooth numbers.
REDUCERS: tuple[dict[str, Any], ...] = (
    {
        "sun_teeth": 14, "planet_teeth": 34, "module": 1.25, "disc_lobes": 29, "pins": 30, "pin_circle_radius": 52,
        "pin_radius": 2.5, "eccentricity": 1.1, "cranks": 3, "discs": 2,
    },
    {
        "sun_teeth": 12, "planet_teeth": 30, "module": 2.0, "disc_lobes": 39, "pins": 40, "pin_circle_radius": 76.5,
        "pin_radius": 3, "eccentricity": 1.3, "cranks": 3, "discs": 2,
    },
    {
        "sun_teeth": 11, "planet_teeth": 25, "module": 1.5, "disc_lobes": 39, "pins": 40, "pin_circle_radius": 64,
        "pin_radius": 3, "eccentricity": 1.25, "cranks": 2, "discs": 2,
    },
    {
        "sun_teeth": 16, "planet_teeth": 37, "module": 1.25, "disc_lobes": 31, "pins": 32, "pin_circle_radius": 60,
        "pin_radius": 3, "eccentricity": 1.2, "cranks": 2, "discs": 2,
    },
    {
        "sun_teeth": 13, "planet_teeth": 35, "module": 1.25, "disc_lobes": 33, "pins": 34, "pin_circle_radius": 58,
        "pin_radius": 2.5, "eccentricity": 1.15, "cranks": 3, "discs": 2,
    },
)  # fmt: skip


@dataclass
class Recording:
    """One run: true output angles in the order of the bench, and what the bench does to their readings."""

    direction: int
    theta: np.ndarray  # rad, input over ratio, at the bench's zero
    torque: float = 20.0  # N*m
    added: np.ndarray | float = 0.0  # arcsec: drift, slips, spikes
    kept: np.ndarray | None = None  # samples that the file holds


@dataclass
class Unit:
    """One unit as drawn; `write` simulates it."""

    seed: int
    family: str
    random: np.random.Generator
    what: str = "nothing special"
    parameters: dict[str, Any] | None = None  # of the reducer; none for the RV-40E
    true: list[Effect] = field(default_factory=list)  # what is declared, as it is
    declared: list[Effect] = field(default_factory=list)
    undeclared: list[Effect] = field(default_factory=list)
    runs: list[Recording] = field(default_factory=list)
    factors: dict[str, float] | None = None  # true over declared stiffness
    backlash: float = 20.0  # um
    law: dict[str, float] | None = None  # exponent and reference of pins and flanks
    marks: float | None = None  # rad by which the gear's marks are ahead of the bench's zero; none where they are on it
    counts: tuple[int, int] | None = None  # bits of input and output encoder
    also_true: list[str] = field(default_factory=list)  # names that are right as well
    more: dict[str, Any] = field(default_factory=dict)  # for truth.json
    memory: float = MEMORY
    loudness: tuple[float, float] = (1.0, 1.0)  # of white and slow noise
    wandering: float = 0.0  # arcsec, rms of what runs wander by
    first_order: bool = False  # whether what is quadratic in the pins' errors is left out

    @property
    def reducer(self) -> Any:
        if self.parameters is None:
            return rverror.reducer("RV-40E")
        return rverror.Reducer(**(self.parameters | {"pressure_angle": math.radians(20)}))

    @property
    def noise_rms(self) -> float:
        """arcsec."""
        return math.hypot(*self._noise_parts(), self.wandering)

    def _noise_parts(self) -> tuple[float, float]:
        slow = INNOVATION / math.sqrt(1 - MEMORY**2)  # its rms stays, whatever its memory
        return WHITE * self.loudness[0], slow * self.loudness[1]

    def noise(self, count: int) -> np.ndarray:
        """Noise of one run, arcsec."""
        white, slow = self._noise_parts()
        steps = self.random.normal(size=count) * slow * math.sqrt(1 - self.memory**2)
        wave, value = np.empty(count), self.random.normal() * slow
        for i, step in enumerate(steps):
            wave[i] = value = self.memory * value + step
        return wave + white * self.random.normal(size=count)


# --- drawing ------------------------------------------------------------------------------------------------------


def size_text(value: float, unit: str) -> str:
    """As the shared units write it."""
    return f"{value:.3f} um" if unit == "um" else f"{value:.4f} arcsec"


def declared_sources(unit: Any, *, discs_only: bool) -> list[tuple[str, dict[str, int], float]]:
    """Sources that the shop floor measured, with the spread of their components, um."""
    discs = [("cycloid.disc_pitch", {"disc": k, "harmonic": 1}, 2.0) for k in range(unit.discs)]
    if discs_only:
        return discs
    cams = [("crank.eccentricity", {"crank": j, "disc": k}, 1.0) for j in range(unit.cranks) for k in range(unit.discs)]
    return [*discs, *cams, ("coupling.carrier_bore_position", {"crank": 0}, 1.5)]


def names_of(effect: Effect) -> tuple[str, tuple[tuple[str, Any], ...]]:
    """Key and indices."""
    return effect["key"], tuple((name, effect[name]) for name in INDICES if name in effect)


def declare(unit: Unit, *, discs_only: bool = False, large: bool = False) -> None:
    """Draw the declared parts, as they are and as they were measured."""
    for key, indices, sigma in declared_sources(unit.reducer, discs_only=discs_only):
        names = KINDS[key].parameters
        values = unit.random.normal(size=2) * sigma
        if large:
            values *= unit.random.uniform(5, 10) / np.hypot(*values)
        wrong = values + UNCERTAINTY * unit.random.normal(size=2)
        unit.true.append({"key": key, **indices, **{n: f"{v:.6f} um" for n, v in zip(names, values, strict=True)}})
        unit.declared.append({"key": key, **indices, **{n: f"{v:.4f} um" for n, v in zip(names, wrong, strict=True)}})


def draw_effect(unit: Unit, key: str) -> Effect:
    """One effect of a key, on indices that are not declared, at a size from barely visible to large."""
    kind, random = KINDS[key], unit.random
    taken = {names_of(effect) for effect in (*unit.declared, *unit.undeclared)}
    for _ in range(1000):
        choice = {name: values[random.integers(len(values))] for name, values in kind.indices(unit.reducer).items()}
        if names_of({"key": key, **choice}) not in taken:
            break
    else:
        raise LookupError(f"{key} is declared on all its indices")
    size = math.exp(random.uniform(math.log(kind.least), math.log(kind.most)))
    names = kind.parameters
    if key == "cycloid.pin_circle" and choice["harmonic"] == 0:
        names = ("radial_cos", "tangential_cos")
    direction = random.normal(size=len(names))
    match key:
        case "crank.bearing_clearance":
            direction = np.ones(1)
        case "cycloid.pin_radius" | "cycloid.disc_lobe":  # a pin that is too thin only unloads itself
            direction = np.where(random.random(1) < 0.7, 1.0, -1.0)
        case "cycloid.profile_modification":  # material comes off
            direction = np.array([abs(direction[0]), 0.5 * direction[1]])
    values = size * direction / np.hypot.reduce(direction)
    return {"key": key, **choice, **{n: size_text(v, kind.unit) for n, v in zip(names, values, strict=True)}}


def draw_keys(unit: Unit, count: int) -> list[str]:
    """Keys of undeclared effects; some may come twice."""
    weights = np.array([kind.weight for kind in KINDS.values()])
    return [str(key) for key in unit.random.choice(list(KINDS), size=count, p=weights / weights.sum())]


def undeclare(unit: Unit, count: int = 1, *, large: bool = False) -> None:
    """Draw the declared parts, and effects beside them.

    Where cams are what is missing, the shop floor measured the discs alone; and now and then so too elsewhere.
    """
    keys = draw_keys(unit, count)
    declare(unit, discs_only="crank.eccentricity" in keys or unit.random.random() < 0.1, large=large)
    while keys:
        try:
            unit.undeclared.append(draw_effect(unit, keys[0]))
        except LookupError:  # it has but one index set, and that is taken
            keys[0] = draw_keys(unit, 1)[0]
        else:
            keys.pop(0)


def draw_line(unit: Unit) -> None:
    """Add a line of an order that no source has."""
    random = unit.random
    kind = random.random()
    if kind < 0.5:
        order = float(random.choice([11.3, 17.63, 23.37, 64.5]))
    elif kind < 0.7:
        order = float(random.choice([7, 36, 51, 93, 131]))
    else:
        while True:
            order = round(float(math.exp(random.uniform(math.log(4), math.log(250)))), 2)
            fundamentals = (unit.reducer.disc_lobes, unit.reducer.pins, unit.reducer.ratio - 1)
            near = [abs(order - f * max(round(order / f), 1)) for f in fundamentals]
            if min(near) > 0.4 and abs(order - round(order)) > 0.1:
                break
    amplitude, phase = random.uniform(1, 3), random.uniform(0, TURN)
    unit.undeclared.append(
        {
            "key": OUTSIDE,
            "order": order,
            "cos": f"{amplitude * math.cos(phase):.4f} arcsec",
            "sin": f"{amplitude * math.sin(phase):.4f} arcsec",
        }
    )


def wrong_stiffness(unit: Unit, spread: float = 0.25) -> None:
    """Draw what the stiffnesses really are; the play of the gears is off too."""
    unit.factors = {name: round(float(np.exp(spread * unit.random.normal())), 4) for name in STIFFNESS}
    unit.backlash = round(20 * float(np.exp(0.4 * unit.random.normal())), 1)
    unit.more["true_gear_backlash"] = f"{unit.backlash} um"


def power_law(unit: Unit) -> None:
    """Pins and flanks close by a power law about a force that nobody knows."""
    random = unit.random
    reference = [math.exp(random.uniform(math.log(20), math.log(2000))) for _ in range(2)]
    unit.law = {
        "exponent": 10 / 9,
        "pin_reference_newton": round(reference[0], 1),
        "flank_reference_newton": round(reference[1], 1),
    }
    unit.more["contact_law"] = unit.law


def grid(turns: float = 3.0, *, start: float = 0.0) -> np.ndarray:
    """Angles of one run, 2048 a revolution."""
    count = int(round(POINTS * turns, 6))
    return TURN * (start + turns * np.arange(count) / count)


def both_ways(unit: Unit, theta: np.ndarray, *, torques: tuple[float, ...] = (20.0,)) -> None:
    """Run forward, and back over the same angles."""
    for torque in torques:
        unit.runs += [Recording(1, theta, torque), Recording(-1, theta[::-1], torque)]


# --- families -----------------------------------------------------------------------------------------------------


def plain(unit: Unit) -> None:
    """One effect is missing."""
    unit.what = "one effect is missing"
    undeclare(unit)
    both_ways(unit, grid())


def nothing(unit: Unit) -> None:
    """Nothing is missing; the stiffnesses or the contact law may be wrong."""
    unit.what = "nothing is missing"
    declare(unit, discs_only=unit.random.random() < 0.1)
    both_ways(unit, grid())
    if unit.random.random() < 0.5:
        power_law(unit)
        unit.what += ", pins and gear flanks close by a power law, force ~ closing^(10/9)"


def stiffness(unit: Unit) -> None:
    """All declared stiffnesses are wrong, one effect is missing."""
    unit.what = "one effect is missing"
    undeclare(unit)
    both_ways(unit, grid())
    wrong_stiffness(unit)


def law(unit: Unit) -> None:
    """Pins and flanks close by a power law."""
    unit.what = "pins and gear flanks close by a power law, force ~ closing^(10/9)"
    undeclare(unit)
    both_ways(unit, grid())
    power_law(unit)


def two(unit: Unit) -> None:
    """Two effects are missing."""
    unit.what = "two effects"
    undeclare(unit, 2)
    both_ways(unit, grid())


def three(unit: Unit) -> None:
    """Three effects are missing."""
    unit.what = "three effects"
    undeclare(unit, 3)
    both_ways(unit, grid())


def marks(unit: Unit) -> None:
    """The whole gear train stands turned; encoders keep to the bench's zero."""
    unit.what = "the bench's zero is not on the gear's marks"
    undeclare(unit)
    both_ways(unit, grid())
    unit.marks = float(unit.random.uniform(0, TURN))
    unit.more["marks_ahead_deg"] = round(math.degrees(unit.marks), 4)


def one_turn(unit: Unit) -> None:
    """One turn in each direction."""
    unit.what = "one turn in each direction"
    undeclare(unit)
    both_ways(unit, grid(1.0))


def part_turn(unit: Unit) -> None:
    """Part of a turn in each direction."""
    unit.what = "a joint that cannot turn round"
    undeclare(unit)
    start = float(unit.random.choice([0.0, unit.random.uniform(0, 1)]))
    both_ways(unit, grid(float(unit.random.uniform(60, 330)) / 360, start=start))


def odd_ratio(unit: Unit) -> None:
    """Another reducer."""
    unit.parameters = REDUCERS[int(unit.random.choice(len(REDUCERS), p=[0.4, 0.15, 0.15, 0.15, 0.15]))]
    unit.what = f"ratio {unit.reducer.ratio:.3f}, {unit.reducer.cranks} cranks"
    undeclare(unit)
    both_ways(unit, grid())


def counts(unit: Unit) -> None:
    """Encoder counts at uneven speed, with spikes, from anywhere."""
    random = unit.random
    unit.what = "encoder counts, uneven speed, spikes, a start anywhere"
    undeclare(unit)
    unit.counts = (18, 23)
    turns, start = random.uniform(2.2, 4.0), random.uniform(0, 1)
    ripple, waves = random.uniform(0.3, 3.0), random.uniform(2, 12)
    jitter = random.uniform(0.1, 0.4)
    for direction in (1, -1):
        count = int(POINTS * turns)
        at = np.arange(count) + ripple * np.sin(TURN * waves * np.arange(count) / POINTS + random.uniform(0, TURN))
        at = np.sort(at + random.uniform(-jitter, jitter, size=count))
        theta = TURN * (start + at / POINTS)
        spikes = np.zeros(count)
        hit = random.choice(count, size=int(random.integers(2, 8)), replace=False)
        spikes[hit] = random.choice([-1, 1], size=hit.size) * random.uniform(20, 60)
        unit.runs.append(Recording(direction, theta[::direction], added=spikes))


def line(unit: Unit) -> None:
    """A line of an order that no source has, alone or beside an effect."""
    unit.what = "an order that no source has"
    if unit.random.random() < 0.4:
        unit.what += " beside an effect"
        undeclare(unit)
    else:
        declare(unit)
    draw_line(unit)
    both_ways(unit, grid())


def three_loads(unit: Unit) -> None:
    """Three loads, both ways each."""
    unit.what = "three loads"
    undeclare(unit)
    both_ways(unit, grid(), torques=(5.0, 60.0, 200.0))


def large_declared(unit: Unit) -> None:
    """Declared parts are poor: 5 to 10 um."""
    unit.what = "large declared errors"
    undeclare(unit, large=True)
    both_ways(unit, grid())


def sometimes(unit: Unit, share: float = 0.6) -> None:
    """Effect or nothing."""
    if unit.random.random() < share:
        undeclare(unit)
    else:
        declare(unit)
        unit.what += ", nothing is missing"


def drift(unit: Unit) -> None:
    """The reading drifts and settles."""
    unit.what = "a slow drift that settles"
    sometimes(unit)
    both_ways(unit, grid())
    for run in unit.runs:
        size = unit.random.uniform(2, 10) * unit.random.choice([-1, 1])
        settling = unit.random.uniform(0.1, 0.5)
        run.added = run.added + size * (1 - np.exp(-np.arange(run.theta.size) / run.theta.size / settling))
    unit.also_true = ["sensor.drift", "sensor.ratio_error"]


def slip(unit: Unit) -> None:
    """The reading steps once in the middle of a run."""
    unit.what = "a slip of the reading within a run"
    sometimes(unit)
    both_ways(unit, grid())
    run = unit.runs[int(unit.random.integers(len(unit.runs)))]
    at = int(run.theta.size * unit.random.uniform(0.25, 0.75))
    step = unit.random.uniform(5, 30) * unit.random.choice([-1, 1])
    run.added = run.added + step * (np.arange(run.theta.size) >= at)
    unit.more["slip"] = {"run": "forward" if run.direction > 0 else "reverse", "sample": at, "arcsec": round(step, 3)}


def gaps(unit: Unit) -> None:
    """Samples are missing, here and there or in one hole."""
    random = unit.random
    hole = random.random() < 0.5
    unit.what = "a hole in each run" if hole else "samples are missing here and there"
    sometimes(unit, 0.8)
    both_ways(unit, grid())
    for run in unit.runs:
        kept = np.ones(run.theta.size, bool)
        if hole:
            first = int(random.uniform(0.1, 0.8) * kept.size)
            kept[first : first + int(random.uniform(0.01, 0.08) * kept.size)] = False
        else:
            kept[random.choice(kept.size, size=kept.size // 100, replace=False)] = False
        run.kept = kept


def wander(unit: Unit) -> None:
    """The reading wanders as a random walk does."""
    unit.what = "a reading that wanders"
    sometimes(unit, 0.4)
    both_ways(unit, grid())
    step = unit.random.uniform(0.005, 0.05)
    for run in unit.runs:
        walk = np.cumsum(unit.random.normal(size=run.theta.size)) * step
        unit.wandering = max(unit.wandering, float(np.std(walk)))
        run.added = run.added + walk


#: Family, and how often it is drawn.
FAMILIES: dict[str, tuple[Callable[[Unit], None], float]] = {
    "plain": (plain, 2.0),
    "nothing": (nothing, 2.0),
    "stiffness": (stiffness, 1.5),
    "power_law": (law, 1.0),
    "two": (two, 1.0),
    "three": (three, 1.0),
    "marks": (marks, 1.0),
    "one_turn": (one_turn, 1.0),
    "part_turn": (part_turn, 1.0),
    "odd_ratio": (odd_ratio, 1.0),
    "counts": (counts, 1.0),
    "line": (line, 1.0),
    "three_loads": (three_loads, 1.0),
    "large_declared": (large_declared, 1.0),
    "drift": (drift, 0.7),
    "slip": (slip, 0.5),
    "gaps": (gaps, 0.5),
    "wander": (wander, 0.5),
}


def draw(seed: int, family: str, attempt: int = 0) -> Unit:
    """Draw one unit of a family."""
    random = np.random.default_rng([seed, list(FAMILIES).index(family), attempt])
    unit = Unit(seed=seed, family=family, random=random)
    unit.loudness = tuple(random.uniform(0.88, 1.12, size=2))  # type: ignore[assignment]
    unit.memory = math.exp(-1 / random.uniform(6, 13))
    if random.random() < 0.2:
        unit.memory = math.exp(-1 / random.uniform(13, 40))
    FAMILIES[family][0](unit)
    if unit.factors is None and random.random() < 1 / 3:
        wrong_stiffness(unit)
    if unit.factors is not None:
        unit.what += "; all declared stiffnesses are wrong"
        if family == "nothing":
            unit.what += "; nothing else"
    unit.more["noise_memory_samples"] = round(-1 / math.log(unit.memory), 2)
    return unit


# --- simulating ---------------------------------------------------------------------------------------------------


def sizes_of(effect: Effect) -> dict[str, float]:
    """Sizes in mm and rad."""
    scale = {"um": 1e-3, "arcsec": ARCSEC}
    texts = {n: v.split() for n, v in effect.items() if isinstance(v, str) and n not in ("key", *INDICES)}
    return {name: float(value) * scale[unit] for name, (value, unit) in texts.items()}


class Simulated:
    """Noise-free transmission error of a unit, rad.

    `slow` takes the poses of the oracle's bench alone, those of its last call to start from.  Else they are those of
    the compiled simulator, but for units of the first order and where it finds none.
    """

    def __init__(self, unit: Unit, *, slow: bool = False) -> None:
        self.unit, self.reducer, self.slow = unit, unit.reducer, slow or unit.first_order
        factors = unit.factors or dict.fromkeys(STIFFNESS, 1.0)
        k = {name: value * factors[name] for name, value in STIFFNESS.items()}
        springs = Springs(
            pin=k["pin_contact"], cam=k["crank_bearing"], carrier=k["carrier_bearing"],
            mesh=k["gear_mesh"], sun=k["sun_support"], main=k["main_bearing"],
        )  # fmt: skip
        laws = [Law(), Law()]
        if unit.law is not None:
            names = ("pin_reference_newton", "flank_reference_newton")
            laws = [Law(exponent=unit.law["exponent"], reference=unit.law[name]) for name in names]
        self.reality = Reality(
            springs=springs,
            pin_law=laws[0],
            flank_law=laws[1],
            backlash=unit.backlash * 1e-3,
            first_order=unit.first_order,
        )
        self._poses: dict[tuple[int, float], np.ndarray] = {}

    def gear_train(self, run: Recording, effects: list[Effect]) -> np.ndarray:
        """Error of the gear train in the order of the run's samples."""
        own = [
            (effect["key"], {name: effect[name] for name in INDICES if name in effect}, sizes_of(effect))
            for effect in effects
            if not effect["key"].startswith("sensor.") and effect["key"] != OUTSIDE
        ]
        theta = run.theta + (self.unit.marks or 0.0)
        if self.reducer.planet_teeth * self.reducer.pins % self.reducer.sun_teeth == 0 or not any(
            effect["key"] in SUN for effect in effects
        ):
            theta = np.mod(theta, TURN)
        angles, back = np.unique(np.round(theta, 11), return_inverse=True)
        if not self.slow:
            error, lost = compiled.transmission_error(
                self.reducer, angles, own, self.reality, sense=run.direction, torque=run.torque * 1e3
            )
            if lost.any():
                error[lost], _ = self._slowly(run, own, angles[lost], None)
            return error[back]
        name = (run.direction, run.torque)
        start = self._poses.get(name)
        if start is not None and len(start) != angles.size:
            start = None
        error, self._poses[name] = self._slowly(run, own, angles, start)
        return error[back]

    def _slowly(
        self,
        run: Recording,
        effects: list[tuple[str, dict[str, Any], dict[str, float]]],
        angles: np.ndarray,
        start: np.ndarray | None,
    ) -> tuple[np.ndarray, np.ndarray]:
        errors = PartErrors(self.reducer)
        for key, indices, sizes in effects:
            put_effect(errors, self.reducer, key, indices, sizes)
        return transmission_error(
            self.reducer, angles, errors, self.reality, sense=run.direction, torque=run.torque * 1e3, start=start
        )

    def readings(self, run: Recording, effects: list[Effect]) -> np.ndarray:
        """Error of gear train and measuring chain."""
        total = self.gear_train(run, effects)
        for effect in effects:
            order = {"sensor.encoder_eccentricity": 1, "sensor.encoder_ellipticity": 2, OUTSIDE: effect.get("order")}
            if (at := order.get(effect["key"])) is not None:
                sizes = sizes_of(effect)
                total = total + sizes["cos"] * np.cos(at * run.theta) + sizes["sin"] * np.sin(at * run.theta)
        return total

    def shares(self) -> tuple[list[np.ndarray], list[float]]:
        """Error of each run; and the rms that each undeclared effect changes it by, over all runs, arcsec."""
        unit = self.unit
        whole = [self.readings(run, unit.true + unit.undeclared) for run in unit.runs]
        sizes = []
        for i in range(len(unit.undeclared)):
            rest = unit.true + unit.undeclared[:i] + unit.undeclared[i + 1 :]
            changes = [error - self.readings(run, rest) for run, error in zip(unit.runs, whole, strict=True)]
            sizes.append(math.sqrt(np.mean([np.var(change) for change in changes])) / ARCSEC)
        return whole, sizes


# --- files --------------------------------------------------------------------------------------------------------


def model_text(unit: Unit) -> str:
    """The model file."""
    lines = [f"# {unit.what}", "[reducer]"]
    if unit.parameters is None:
        lines.append('preset = "RV-40E"')
    else:
        for name in ("sun_teeth", "planet_teeth", "module"):
            value = unit.parameters[name]
            lines.append(f'{name} = "{value:g} mm"' if name == "module" else f"{name} = {value}")
        lines.append('pressure_angle = "20 deg"')
        for name, value in unit.parameters.items():
            if name in ("disc_lobes", "pins", "cranks", "discs"):
                lines.append(f"{name} = {value}")
            elif name in ("pin_circle_radius", "pin_radius", "eccentricity"):
                lines.append(f'{name} = "{value:g} mm"')
    lines += ['gear_backlash = "20 um"', "", "[reducer.stiffness]"]
    lines += [f'{name} = "{value:g} N/mm"' for name, value in STIFFNESS.items()]
    for effect in unit.declared:
        lines += ["", "[[effect]]"]
        for name, value in effect.items():
            lines.append(f"{name} = {json.dumps(value)}")
        lines.append(f'uncertainty = "{UNCERTAINTY:.4f} um"')
    return "\n".join(lines) + "\n"


def run_text(unit: Unit, run: Recording, error: np.ndarray) -> str:
    """One run file."""
    ratio = unit.reducer.ratio
    given = np.degrees(ratio * run.theta)
    read = np.degrees(run.theta + error) + (run.added + unit.noise(run.theta.size)) / 3600
    if unit.counts is not None:
        given, read = (
            np.round(v / 360 * 2**bits) / 2**bits * 360 for v, bits in zip((given, read), unit.counts, strict=True)
        )
    if run.kept is not None:
        given, read = given[run.kept], read[run.kept]
    head = [
        f"# direction: {'forward' if run.direction > 0 else 'reverse'}",
        f"# output_torque: {run.torque:g} N*m",
        "# temperature: 20 degC",
        *(["# index: unknown"] if unit.marks is not None else []),
        "input_angle[deg],output_angle[deg]",
    ]
    return "\n".join([*head, *(f"{a:.6f},{b:.8f}" for a, b in zip(given, read, strict=True))]) + "\n"


def make(seed: int, family: str, folder: Path, *, first_order: bool = False) -> dict[str, Any]:
    """Draw and simulate a unit and write its folder; what truth.json says.

    Effects that no run shows are drawn anew, but for one in ten; and a unit of which a pose is not found.
    """
    for attempt in range(30):
        unit = draw(seed, family, attempt)
        unit.first_order = first_order
        try:
            errors, effect_rms = Simulated(unit).shares()
        except ArithmeticError as error:
            print(f"{family}-{seed}: {error}; drawn anew")
            continue
        if min(effect_rms, default=VISIBLE) >= VISIBLE or unit.random.random() < 0.1:
            return write(unit, errors, effect_rms, folder)
    raise ArithmeticError(f"{family}-{seed}: none of 30 draws can be seen")


def write(unit: Unit, errors: list[np.ndarray], effect_rms: list[float], folder: Path) -> dict[str, Any]:
    """Write the folder of a simulated unit; what truth.json says."""
    folder.mkdir(parents=True, exist_ok=True)
    for run, error in zip(unit.runs, errors, strict=True):
        name = f"{'forward' if run.direction > 0 else 'reverse'}_{run.torque:g}Nm.csv"
        (folder / name).write_text(run_text(unit, run, error))
    (folder / "model.toml").write_text(model_text(unit))
    truth = {
        "undeclared": unit.undeclared,
        "noise_rms_arcsec": unit.noise_rms,
        "what": unit.what,
        **({"true_over_declared_stiffness": unit.factors} if unit.factors is not None else {}),
        "family": unit.family,
        "seed": unit.seed,
        "effect_rms_arcsec": [round(size, 4) for size in effect_rms],
        **({"kinematics": "first order in the errors of the pins"} if unit.first_order else {}),
        **({"also_true": unit.also_true} if unit.also_true else {}),
        **unit.more,
        "true_declared": unit.true,
    }
    (folder / "truth.json").write_text(json.dumps(truth, indent=1) + "\n")
    return truth


def choose(seed: int, families: tuple[str, ...] = tuple(FAMILIES), *, even: bool = False) -> str:
    """Family of a seed."""
    if even:
        return families[seed % len(families)]
    weights = np.array([FAMILIES[name][1] for name in families])
    return str(np.random.default_rng([seed, 99]).choice(families, p=weights / weights.sum()))
