"""What the data hold of spoilt units: python -m benchmarks.lot_trial.spoilt SEED [SEED ...].

For each spoilt unit of a lot of the kind machine all that its error changes, solved exactly: its distance from other
units, by their covariance at the true processes and stiffnesses, and the share of that distance squared along the
influences of the part.  No test names a unit more often than one that knows the change beforehand.
"""

from __future__ import annotations

import argparse

import numpy as np
from benchmarks.load_trial.parts import Error
from benchmarks.load_trial.planar import Array
from benchmarks.lot_trial import make

import rverror
from rverror.lots.amplitudes import LotUnit, amplitudes_of
from rverror.lots.identifiable import Question, question_of
from rverror.lots.moments import MomentMatching, sample_of
from rverror.lots.processes import processes_of
from rverror.lots.simulated import COMPLIANCES, State
from rverror.statics.loaded_state import SOFTENING

DRAWN, MEASURED = 120, 40  # units that tell the covariance; and those that tell noise and orders


def asked(lot: make.Lot) -> Question:
    """What the first units of a lot can be asked."""
    model, torque = rverror.load_model(make.MODEL), f"{lot.torques[0]} N*m"
    units = []
    for serial, outputs in list(zip(lot.serials, lot.outputs, strict=True))[:MEASURED]:
        ways = zip((1.0, -1.0), np.radians(lot.inputs), np.radians(outputs), strict=True)
        runs = (
            rverror.run_from_arrays(input_angle=i, output_angle=o, direction=way, torque=torque) for way, i, o in ways
        )
        units.append(LotUnit(serial, tuple(runs)))
    amplitudes = amplitudes_of(model, units)
    return question_of(model, amplitudes, processes_of(model, amplitudes.conditions[0]))


def true_state(plan: make.Plan, question: Question) -> State:
    """Processes and stiffnesses as they are."""
    true = {make.name_of(key): (key, size) for key, size in plan.deviations.items()}
    sizes = []
    for process in question.simulator.parts.processes:
        harmonic = f" (harmonic {process.indices['harmonic']})" if process.indices else ""
        key, size = true.get(process.key + harmonic, ("", 0.0))
        sizes.append(size * (make.ARCSEC if key == make.ENCODER else make.UM))
    softer = [-np.log(plan.factors[name]) for name in SOFTENING[:COMPLIANCES]]
    return State(np.maximum(sizes, question.least), np.array(softer))


def told(seed: int) -> None:
    """Print a line for each spoilt unit of a lot."""
    plan = make.draw_plan(seed, "machine", None)
    question, train, labels = (
        asked(make.simulate(seed, "plain", MEASURED)),
        make.true_train(plan),
        make.draw_labels(plan),
    )
    simulator, state = question.simulator, true_state(plan, question)
    rng, count = np.random.default_rng(seed), len(simulator.parts.process)
    standard = rng.standard_normal((DRAWN, count))
    fresh = rng.standard_normal((3 * simulator.scale.size, count))
    drawn = simulator.draws(state, standard)
    matching = MomentMatching(simulator, sample_of(drawn.values), standard, standard, fresh, question.least, print)
    weight = matching._weight(simulator.values(state, fresh))
    theta = 2 * np.pi * np.arange(make.SAMPLES) / make.SAMPLES

    def amplitudes(errors: list[Error]) -> Array:
        waves = (make.true_outputs(plan, errors, train, theta) - theta)[None]
        return np.asarray((simulator.amplitudes.of_waves(waves).reshape(1, -1) * simulator.scale)[0])

    for serial, error in make.draw_spoilt(plan, train).items():
        own = make.draw_errors(plan, serial, train) + make.shifted(plan, serial, labels, train)
        change = amplitudes([*own, error]) - amplitudes(own)
        parts = [e.key == error.key and dict(e.indices) == error.indices for e in simulator.parts.effects]
        of = drawn.influence[:, np.array(parts)[simulator.parts.effect]]
        along = change @ weight @ of
        squared, part = change @ weight @ change, along @ np.linalg.solve(of.T @ weight @ of, along)
        sizes = ", ".join(f"{value / make.UM:.0f}" for value in error.values)
        print(
            f"{seed} {serial:04d} {plan.torque} N*m {error.key} {sizes} um: distance {squared**0.5:.1f}, share along "
            f"its influences {part / squared:.2f}",
            flush=True,
        )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0], allow_abbrev=False)
    parser.add_argument("seeds", nargs="+", type=int)
    for number in parser.parse_args().seeds:
        told(number)
