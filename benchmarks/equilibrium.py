"""Cost of the loaded equilibrium of an RV-40E over one revolution of 4096 angles, with a dozen part errors.

    python benchmarks/equilibrium.py [angles of the plain minimisation]

and of a prediction with the influence of every error and stiffness, from poses that are near; of its wear over 6000
hours, which solves the equilibrium at each step of hours; and of a lot of 1000 virtual units with clearances.

It is set against `scipy.optimize.minimize` on the same energy, written for this file angle by angle with its gradient
and second derivative; that runs on a few angles and is scaled up, and its output errors must agree with the solver's.
Beside it stands how many floating-point operations the kernel's own lines ask for, counted as they run as plain Python:
at a few thousand million a second they are the limit.  Peak memory is that of a process of its own which solves one
revolution.  BLAS and the kernel run on one thread unless the environment says otherwise, the lot on all cores.
"""

from __future__ import annotations

import os

_THREADS = os.environ.get("NUMBA_NUM_THREADS")
for _name in (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "NUMBA_NUM_THREADS",
):
    os.environ.setdefault(_name, "1")

import cmath  # noqa: E402
import math  # noqa: E402
import platform  # noqa: E402
import subprocess  # noqa: E402
import sys  # noqa: E402
from collections.abc import Callable  # noqa: E402
from dataclasses import replace  # noqa: E402
from time import perf_counter  # noqa: E402

import numpy as np  # noqa: E402
import scipy  # noqa: E402
from scipy.optimize import minimize  # noqa: E402

import rverror  # noqa: E402
from rverror.base.threads import threads  # noqa: E402
from rverror.model.effects import Effect  # noqa: E402
from rverror.statics.loaded_state import statics_of  # noqa: E402
from rverror.statics.prediction import Predictor  # noqa: E402

ANGLES, REPEATS = 4096, 3
ARCSEC = math.pi / 180 / 3600
TORQUES = (412.0, 20.0)  # N*m
CLEARANCES = (0.0, 5.0)  # um
AIMS = {0.0: 6.0, 5.0: 15.0}  # us an angle on one core
AIM_WEAR = 5.0  # s
LOT, LOT_ANGLES, AIM_LOT = 1000, 512, 30.0  # units, angles in either direction, s on 2 cores
#: key, indices, parameter and size in um; the plain energy below knows these sources
ERRORS: tuple[tuple[str, dict[str, int], str, float], ...] = (
    ("cycloid.pin_position", {"pin": 3}, "tangential", 5.0),
    ("cycloid.pin_position", {"pin": 11}, "radial", 4.0),
    ("cycloid.pin_position", {"pin": 17}, "radial", -5.0),
    ("cycloid.pin_position", {"pin": 30}, "radial", -5.0),
    ("crank.eccentricity", {"crank": 0, "disc": 0}, "radial", 5.0),
    ("crank.eccentricity", {"crank": 1, "disc": 0}, "tangential", -5.0),
    ("cycloid.disc_bore_position", {"disc": 1, "crank": 1}, "tangential", 5.0),
    ("cycloid.disc_bore_position", {"disc": 0, "crank": 0}, "radial", 5.0),
    ("coupling.carrier_bore_position", {"crank": 0}, "tangential", 5.0),
    ("coupling.carrier_bore_position", {"crank": 1}, "radial", -4.0),
)


def model_of(unit: rverror.Reducer, clearance: float) -> rverror.Model:
    """The reducer with its errors, and clearance in um of both kinds of bearings."""
    effects = [rverror.effect(key, **indices, **{name: f"{size} um"}) for key, indices, name, size in ERRORS]
    if clearance:
        bearings = ("crank.bearing_clearance", "coupling.bearing_clearance")
        effects += [rverror.effect(key, clearance=f"{clearance} um") for key in bearings]
    return rverror.Model(unit, tuple(effects))


class PlainEnergy:
    """Energy of one angle in forward motion: contacts one by one, each with the row of its closing."""

    def __init__(self, unit: rverror.Reducer, theta: float, *, torque: float, clearance: float) -> None:
        k = unit.stiffness
        self.torque, self.size = torque, 3 + 3 * unit.discs + 3 * unit.cranks + 2
        push: list[tuple[float, float, np.ndarray]] = []  # stiffness, error, row
        pull: list[tuple[float, float, complex, np.ndarray]] = []  # stiffness, clearance, error, row
        disc = [3 + 3 * d for d in range(unit.discs)]
        crank = [3 + 3 * unit.discs + 3 * j for j in range(unit.cranks)]
        turn = -unit.disc_lobes * theta
        aside = [cmath.exp(1j * (turn + 2 * math.pi * d / unit.discs)) for d in range(unit.discs)]
        place = [cmath.exp(1j * (theta + 2 * math.pi * j / unit.cranks)) for j in range(unit.cranks)]
        axis = {"radial": 1.0, "tangential": 1j}

        def error(key: str, **where: int) -> complex:
            """Radial and tangential part of all errors there, mm."""
            parts = [s * axis[name] for k_, at, name, s in ERRORS if k_ == key and at == where]
            return 1e-3 * sum(parts, 0j)

        def row(*parts: tuple[int, complex, complex]) -> np.ndarray:
            """Displacement of bodies (first unknown, sign, arm from the body's centre)."""
            found = np.zeros(self.size, complex)
            for at, sign, arm in parts:
                found[at] += sign
                found[at + 1] += 1j * sign
                if arm:
                    found[at + 2] += sign * 1j * arm
            return found

        for d in range(unit.discs):
            centre = unit.eccentricity * aside[d]
            for i in range(unit.pins):
                radial = cmath.exp(2j * math.pi * i / unit.pins)
                pin = unit.pin_circle_radius * radial
                normal = unit.pins * centre - pin  # towards the pitch point
                normal /= abs(normal)
                closing = (normal.conjugate() * row((disc[d], -1, pin - centre))).real
                given = (normal.conjugate() * error("cycloid.pin_position", pin=i) * radial).real
                push.append((k.pin_contact, given, closing))
        base = unit.planet_pitch_radius * math.cos(unit.pressure_angle)
        for j in range(unit.cranks):
            for flank in (1, -1):
                lean = place[j] * cmath.exp(-1j * flank * unit.pressure_angle)
                line = 1j * flank * lean
                sides = row((crank[j], -1, -base * lean))
                sides[-2:] += [1, 1j]
                push.append((k.gear_mesh, -unit.gear_backlash / 2, (line.conjugate() * sides).real))
            bore = unit.crank_radius * place[j]
            for d in range(unit.discs):
                cam = unit.eccentricity * aside[d]
                gap = error("cycloid.disc_bore_position", disc=d, crank=j) * place[j]
                gap -= error("crank.eccentricity", crank=j, disc=d) * aside[d]
                pull.append((k.crank_bearing, clearance, gap, row((disc[d], 1, bore), (crank[j], -1, cam))))
            gap = -error("coupling.carrier_bore_position", crank=j) * place[j]
            pull.append((k.carrier_bearing, clearance, gap, row((crank[j], 1, 0), (0, -1, bore))))
        pull.append((k.main_bearing, 0.0, 0j, row((0, 1, 0))))
        sun = np.zeros(self.size, complex)
        sun[-2:] = [1, 1j]
        pull.append((k.sun_support, 0.0, 0j, sun))
        self.push_k, self.push_error, self.push_rows = (np.array(part) for part in zip(*push, strict=True))
        self.pull_k, self.clearance, self.pull_error, self.pull_rows = (
            np.array(part) for part in zip(*pull, strict=True)
        )
        # angles as arcs at the crank circle: all unknowns are lengths, which a plain minimiser needs
        self.unit_of = np.ones(self.size)
        self.unit_of[2:-2:3] = 1 / unit.crank_radius
        self.push_rows, self.pull_rows = self.push_rows * self.unit_of, self.pull_rows * self.unit_of
        self.load = np.zeros(self.size)
        self.load[2] = -torque * self.unit_of[2]

    def both(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        """Energy and gradient."""
        pushed = np.maximum(self.push_rows @ x + self.push_error, 0)
        gap = self.pull_rows @ x + self.pull_error
        distance = np.abs(gap)
        beyond = np.maximum(distance - self.clearance, 0)
        energy = 0.5 * (self.push_k @ pushed**2 + self.pull_k @ beyond**2) - self.load @ x
        force = self.pull_k * beyond * gap / np.where(distance > 0, distance, 1)
        gradient = (self.push_k * pushed) @ self.push_rows + (force.conj() @ self.pull_rows).real - self.load
        return float(energy), gradient

    def second(self, x: np.ndarray) -> np.ndarray:
        """Second derivative where contacts stay."""
        closed = self.push_rows @ x + self.push_error > 0
        gap = self.pull_rows @ x + self.pull_error
        distance = np.where(gap == 0, 1, np.abs(gap))
        share = np.maximum(1 - self.clearance / distance, 0)
        radial = ((gap / distance).conj()[:, None] * self.pull_rows).real
        found = self.push_rows.T @ ((self.push_k * closed)[:, None] * self.push_rows)
        found += (self.pull_rows.conj().T @ ((self.pull_k * share)[:, None] * self.pull_rows)).real
        touching = np.where(share > 0, 1 - share, 0)
        return np.asarray(found + radial.T @ ((self.pull_k * touching)[:, None] * radial))

    def output(self, method: str) -> float:
        """Turn of the carrier in the pose of least energy, rad."""
        second = None if method == "BFGS" else self.second
        options = {"gtol": 1e-7 * self.torque * self.unit_of[2], "maxiter": 5000}
        found = minimize(self.both, np.zeros(self.size), jac=True, hess=second, method=method, options=options)
        return float(found.x[2] * self.unit_of[2])


def worn(model: rverror.Model) -> rverror.statics.Wear:
    """Wear at the rated torque and 15 rpm."""
    bodies = dict.fromkeys(("disc", "pin", "sun", "planet"), "1e-10 mm^3/(N*m)")
    return rverror.statics.wear(
        model,
        torque="412 N*m",
        input_speed="1815 rpm",
        hours=6000,
        coefficients=rverror.statics.WearCoefficients(**bodies),
        disc_width="9 mm",
        gear_width="8 mm",
    )


class Counted(float):
    """A number that counts the operations in which it takes part."""

    done = 0

    def _of(name: str) -> Callable[..., Counted]:  # noqa: N805
        def counted(self: float, *others: float) -> Counted:
            Counted.done += 1
            return Counted(getattr(float, name)(self, *map(float, others)))

        return counted

    __add__, __radd__, __sub__, __rsub__ = _of("__add__"), _of("__radd__"), _of("__sub__"), _of("__rsub__")
    __mul__, __rmul__, __truediv__, __rtruediv__ = (
        _of("__mul__"), _of("__rmul__"), _of("__truediv__"), _of("__rtruediv__")
    )  # fmt: skip
    __pow__, __rpow__ = _of("__pow__"), _of("__rpow__")


def report_operations(torque: str, clearance: str) -> None:
    """Operations of a prediction an angle, and its steps; in a process in which the kernel runs as plain Python."""
    from rverror.statics import kernel

    found = kernel.solve

    def counting(
        problem: kernel.Problem, start: int, first: int, last: int, solution: kernel.Solution, scratch: object
    ) -> None:
        count = np.vectorize(Counted, otypes=[object])
        floats = {name: row for name, row in problem._asdict().items() if getattr(row, "dtype", None) == np.float64}
        counted = {name: count(row) for name, row in floats.items()}
        state = [count(np.nan_to_num(row)) if row.dtype == np.float64 else row for row in solution]
        blank = [count(np.nan_to_num(row)) for row in scratch]
        Counted.done = 0
        found(problem._replace(**counted), start, first, last, kernel.Solution._make(state), kernel._Scratch(*blank))
        for row, told in zip(solution, state, strict=True):
            row[...] = told
        print(Counted.done / len(solution.x), solution.steps.mean())

    theta = np.linspace(0, 2 * np.pi, 7)
    predictor = Predictor(
        rverror.reducer("RV-40E"), rverror.geartrain.OperatingConditions(theta, 1.0, float(torque) * 1e3)
    )
    model = model_of(rverror.reducer("RV-40E"), float(clearance))
    near = predictor.predict(model)
    kernel.solve = counting
    predictor.predict(moved(model), near)


def operations(*, torque: float, clearance: float) -> tuple[float, float]:
    """Floating-point operations of the kernel in a prediction from near poses, an angle, and its Newton steps."""
    out = subprocess.run(
        [sys.executable, __file__, "--operations", str(torque), str(clearance)],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"}, check=True, capture_output=True, text=True,
    )  # fmt: skip
    count, steps = map(float, out.stdout.split())
    return count, steps


def moved(model: rverror.Model) -> rverror.Model:
    """The model with all sizes 2 % larger."""
    return replace(model, effects=tuple(replace(e, values=tuple(1.02 * v for v in e.values)) for e in model.effects))


def lot() -> float:
    """Time of the equilibria of many units with random errors of all bores, cams and pins and both clearances, s."""
    unit = rverror.reducer("RV-40E")
    keys = (
        "crank.eccentricity",
        "cycloid.disc_bore_position",
        "cycloid.pin_position",
        "coupling.carrier_bore_position",
    )
    places = [(key, indices) for key in keys for indices in rverror.CATALOGUE[key].candidates(unit)]
    theta = 2 * np.pi * np.arange(LOT_ANGLES) / LOT_ANGLES
    both = rverror.geartrain.OperatingConditions(np.tile(theta, 2), np.repeat([1.0, -1.0], LOT_ANGLES), 412e3)
    statics, rng = statics_of(unit, both), np.random.default_rng(1)
    start = perf_counter()
    for _ in range(LOT):
        effects = [Effect(key, indices, tuple(rng.normal(0, 2e-3, 2))) for key, indices in places]
        for key in ("crank.bearing_clearance", "coupling.bearing_clearance"):
            effects.append(Effect(key, {}, (rng.uniform(0, 8e-3),)))
        found = statics.settled(tuple(effects))
        assert found.solution.found.all()
    return perf_counter() - start


def best(task: Callable[[], object], repeats: int = REPEATS) -> float:
    """Shortest of several runs, s."""
    times = []
    for _ in range(repeats):
        start = perf_counter()
        task()
        times.append(perf_counter() - start)
    return min(times)


def peak_memory(*, torque: float | None, clearance: float) -> float:
    """Peak resident memory of a process that solves one revolution, MiB; that of the imports alone without torque."""
    asked = "none" if torque is None else str(torque)
    out = subprocess.run(
        [sys.executable, __file__, "--memory", asked, str(clearance)], check=True, capture_output=True, text=True
    )
    return float(out.stdout)


def report_memory(torque: str, clearance: str) -> None:
    """What a child process prints."""
    import resource  # of Unix systems

    if torque != "none":
        model = model_of(rverror.reducer("RV-40E"), float(clearance))
        theta = 2 * np.pi * np.arange(ANGLES) / ANGLES
        rverror.equilibrium(model, theta, torque=float(torque) * 1e3, direction=1)
    size = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    print(size / (2**20 if sys.platform == "darwin" else 2**10))


def main() -> None:
    if "--memory" in sys.argv:
        report_memory(*sys.argv[-2:])
        return
    if "--operations" in sys.argv:
        report_operations(*sys.argv[-2:])
        return
    few = int(sys.argv[1]) if len(sys.argv) > 1 else 12
    unit = rverror.reducer("RV-40E")
    theta = 2 * np.pi * np.arange(ANGLES) / ANGLES
    chosen = (np.arange(few) * 2531 + 17) % ANGLES

    print(f"RV-40E, {len(ERRORS)} errors, one revolution of {ANGLES} angles, forward")
    print(
        f"Python {platform.python_version()}, numpy {np.__version__}, scipy {scipy.__version__}, "
        f"BLAS threads {os.environ['OMP_NUM_THREADS']}"
    )
    print(f"best of {REPEATS} runs; the plain minimisations ran on {few} angles, built anew at each")
    imports = peak_memory(torque=None, clearance=0.0) if os.name == "posix" else math.nan
    for clearance in CLEARANCES:
        for torque in TORQUES:
            model = model_of(unit, clearance)
            load = torque * 1e3

            def whole(model: rverror.Model = model, load: float = load) -> rverror.model.Equilibrium:
                return rverror.equilibrium(model, theta, torque=load, direction=1)

            state = whole()
            time = best(whole) / ANGLES * 1e6
            print()
            print(f"{torque:g} N*m, {clearance:g} um of clearance in cam and carrier bearings")
            steps = f"{state.steps.mean():.1f} Newton steps, at most {state.steps.max()}"
            print(f"  {'rverror.equilibrium':36s}{time:10.1f} us an angle, aim {AIMS[clearance]:g}; {steps}")
            predictor = Predictor(unit, rverror.geartrain.OperatingConditions(theta, 1.0, load))
            near, next_one = predictor.predict(model), moved(model)
            warm = best(lambda p=predictor, m=next_one, n=near: p.predict(m, n)) / ANGLES * 1e6
            print(f"  {'a prediction with all derivatives':36s}{warm:10.1f} us an angle, aim {AIMS[clearance]:g}")
            count, few_steps = operations(torque=torque, clearance=clearance)
            speed = f"{count / warm / 1e3:.1f} Gflop/s; {few_steps:.1f} Newton steps"
            print(f"  {'  operations of its kernel':36s}{count:10.0f} an angle, {speed}")
            for method in ("BFGS", "trust-exact"):

                def plain(method: str = method, load: float = load, clearance: float = clearance) -> list[float]:
                    angles = theta[chosen].tolist()
                    energies = (PlainEnergy(unit, a, torque=load, clearance=clearance / 1e3) for a in angles)
                    return [energy.output(method) for energy in energies]

                apart = abs(np.array(plain()) - state.transmission_error[chosen]).max() / ARCSEC
                looped = best(plain, 1) / few * 1e6
                name = f"scipy minimize, {method}"
                print(
                    f"  {name:36s}{looped:10.0f} us an angle, {looped / time:.0f} times; differs by {apart:.0e} arcsec"
                )
            if os.name == "posix":
                peak = peak_memory(torque=torque, clearance=clearance)
                print(f"  {'peak memory of the process':36s}{peak:10.0f} MiB; imports {imports:.0f}")
    print()
    print("rverror.statics.wear, 6000 hours at 412 N*m in both directions, 1e-10 mm^3/(N*m) for all bodies")
    for name, model in (("no error", rverror.Model(unit)), (f"{len(ERRORS)} errors", model_of(unit, 0.0))):
        print(f"  {name:36s}{best(lambda model=model: worn(model), 1):10.1f} s, aim {AIM_WEAR:g}")
    print()
    if _THREADS is None:
        del os.environ["NUMBA_NUM_THREADS"]
    print(
        f"{LOT} virtual units with clearances at 412 N*m, {LOT_ANGLES} angles in both directions, {threads()} threads"
    )
    print(f"  {'all equilibria':36s}{lot():10.1f} s, aim {AIM_LOT:g} on 2 cores")


if __name__ == "__main__":
    main()
