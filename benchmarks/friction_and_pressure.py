"""Cost of what is told beside the error: friction, hysteresis, contact pressure, the bench's uncertainty.

    python benchmarks/friction_and_pressure.py [--angles 1024] [--repeats 3]

Each is set against the result that it stands beside, in one process: efficiency and contact pressure against the
equilibrium over the same angles, hysteresis against the torsion curve over the same torques, the bench's uncertainty of
every figure against a short diagnosis of a drive.  The ratios hold on any machine; the times are of this one.
BLAS runs on one thread unless the environment says otherwise.
"""

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"):
    os.environ.setdefault(_name, "1")

import argparse  # noqa: E402
from collections.abc import Callable, Sequence  # noqa: E402
from dataclasses import dataclass  # noqa: E402
from typing import Any  # noqa: E402

import numpy as np  # noqa: E402
from equilibrium import best, model_of  # noqa: E402

import rverror  # noqa: E402

TORQUE = "412 N*m"
TORQUES = [f"{sign}{size} N*m" for sign in ("", "-") for size in (50, 100, 200, 412)]
RUBS = rverror.geartrain.Friction(pin=0.05, mesh=0.05, crank_bearing=0.002, crank_bearing_radius=15.0)
WIDTHS = {"disc_width": "9 mm", "gear_width": "8 mm"}
ENCODERS: dict[str, Any] = {"output_encoder": "1.24 arcsec", "input_encoder": "0.39 arcsec", "output_counts": 2**23}
PLACES = 8  # angles at which the input is held


@dataclass(frozen=True)
class Cost:
    """Time of a result and of the one that it stands beside, s."""

    name: str
    beside: str
    own: float
    plain: float

    @property
    def ratio(self) -> float:
        """Own time over that of the other."""
        return self.own / self.plain


def diagnosed() -> rverror.Diagnosis:
    """A short diagnosis of a drive."""
    theta = np.linspace(0, 8 * np.pi, 2001)
    te = 1e-5 * np.cos(14 * theta) + 1e-6 * np.random.default_rng(1).standard_normal(theta.size)
    run = rverror.run_from_arrays(input_angle=14 * theta, te=te)
    return rverror.diagnose(rverror.Model(rverror.Drive(ratio=14.0, shafts={"motor": 14.0})), [run])


def every_figure() -> list[float]:
    """Uncertainty of each figure of a report, and of a dozen orders."""
    found = rverror.runs.bench_uncertainty(14.0, **ENCODERS)
    whole = [found.of("reading"), found.of("peak_to_peak"), found.of("rms")]
    return whole + [found.of_order(order) for order in range(1, 13)]


def costs(angles: int, repeats: int) -> list[Cost]:
    """Every cost, each the shortest of several runs."""
    model = model_of(rverror.reducer("RV-40E"), 0.0)
    theta = 2 * np.pi * np.arange(angles) / angles
    held = 2 * np.pi / 40 * np.arange(PLACES) / PLACES

    def cost(name: str, beside: str, own: Callable[[], object], plain: Callable[[], object]) -> Cost:
        own(), plain()  # what is loaded and kept on the first call is no part of it
        # by turns, so that a machine that is busy for a while slows both
        times = [(best(own, 1), best(plain, 1)) for _ in range(repeats)]
        return Cost(name, beside, *(min(each) for each in zip(*times, strict=True)))

    return [
        cost(
            "rverror.statics.efficiency",
            "equilibrium",
            lambda: rverror.statics.efficiency(model, theta, torque=TORQUE, friction=RUBS, direction=1.0),
            lambda: rverror.equilibrium(model, theta, torque=TORQUE, direction=1.0),
        ),
        cost(
            "rverror.statics.contact_pressure",
            "equilibrium",
            lambda: rverror.statics.contact_pressure(model, theta, torque=TORQUE, direction=1.0, **WIDTHS),
            lambda: rverror.equilibrium(model, theta, torque=TORQUE, direction=1.0),
        ),
        cost(
            "rverror.statics.hysteresis",
            "torsion_curve",
            lambda: rverror.statics.hysteresis(model, held, torques=TORQUES, friction=RUBS),
            lambda: rverror.statics.torsion_curve(model, held, torques=TORQUES),
        ),
        cost(
            "rverror.runs.bench_uncertainty",
            "diagnose",
            every_figure,
            diagnosed,
        ),
    ]


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--angles", type=int, default=1024)
    parser.add_argument("--repeats", type=int, default=3)
    options = parser.parse_args(arguments)
    print(f"RV-40E, ten errors, {TORQUE}, {options.angles} angles; best of {options.repeats} runs")
    for cost in costs(options.angles, options.repeats):
        print(f"{cost.name:32s}{1e3 * cost.own:9.2f} ms, {cost.ratio:6.3g} times {cost.beside}")


if __name__ == "__main__":
    main()
