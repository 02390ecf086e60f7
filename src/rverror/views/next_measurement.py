"""What to measure next after a diagnosis: what its runs cover, and steps that would tell what they do not."""

from __future__ import annotations

from rverror.diagnosis.next_run import Circumstances, Measurement, to_place, to_separate
from rverror.diagnosis.result import Addition, Diagnosis
from rverror.model.catalogue import CATALOGUE
from rverror.views.by_order import samples_per_turn, turns_of


def bench_of(diagnosis: Diagnosis) -> Circumstances:
    """What the runs of a diagnosis cover."""
    torques = {torque for trace in diagnosis.traces if (torque := trace.torque) is not None}
    longest = max(diagnosis.traces, key=turns_of, default=None)
    part = longest.theta if longest is not None and turns_of(longest) < 1 else None
    return Circumstances(
        directions=frozenset(1.0 if trace.direction > 0 else -1.0 for trace in diagnosis.traces) or frozenset({1.0}),
        samples_per_turn=samples_per_turn(diagnosis),
        torques=frozenset(torques),
        marks=all(trace.index != "unknown" for trace in diagnosis.traces),
        shared_zero=any(
            one.index == other.index not in ("", "unknown") and one.direction != other.direction
            for one in diagnosis.traces
            for other in diagnosis.traces
        ),
        travel=None if part is None else (float(part[0]), float(2 * part[-1] - part[-2])),
    )


def next_steps(diagnosis: Diagnosis) -> list[tuple[Addition | None, Measurement]]:
    """What to measure next, with the addition that each measurement is about; of runs: a table's passport says more."""
    if diagnosis.shares:
        return []
    bench, unit = bench_of(diagnosis), diagnosis.declared.mechanism
    found: list[tuple[Addition | None, Measurement]] = []
    for addition in diagnosis.added:
        keys = (addition.effect.key, *(key for key, _ in addition.indistinguishable))
        if all(key in CATALOGUE and CATALOGUE[key].is_cause for key in keys):
            steps = to_separate(unit, addition.effect, addition.indistinguishable, bench)
            found += [(addition, step) for step in steps]
    steps = to_place(unit, [line.order for line in diagnosis.unexplained], bench)
    reading = diagnosis.quantity == "angle"
    return found + [(None, step) for step in steps if reading or step.name != "encoder"]
