"""A diagnosis as variables: what was added, what is left, the waveforms, what runs say of stiffness."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rverror.base.arrays import Array
from rverror.base.text import describe
from rverror.diagnosis.result import Diagnosis
from rverror.views.describing import content, sheet, table
from rverror.views.diagnosis_report import SIGNALS, diagnosis_content, diagnosis_sheet
from rverror.views.fields import COUNT, OWN, about, alike, arrays, rows
from rverror.views.model_report import inside, name_of
from rverror.views.variables import NUMBER, POSITION, TORQUE, Table, Unit, Variable

content.register(Diagnosis, diagnosis_content)
sheet.register(Diagnosis, diagnosis_sheet)


@table.register
def _diagnosis_table(result: Diagnosis) -> Table:
    signal = SIGNALS[result.quantity].unit
    stages = (("declared", result.before), ("refitted", result.before_refitted), ("after", result.after))
    variables = {
        **_added(result, signal),
        **rows(
            "stage",
            stages,
            stage="0",
            **alike(signal, "rms", "peak_to_peak", "heldout_rms", within="1."),
        ),
        **arrays("", result, noise_rms=signal),
        **rows(
            "unexplained",
            result.unexplained,
            "unexplained_",
            order=NUMBER,
            **alike(signal, "amplitude", "low", "high", "cos", "sin"),
            frames=lambda line: "; ".join(line.frames),
        ),
        **rows(
            "candidate",
            result.candidates,
            "candidate_",
            key=None,
            indices=lambda one: inside(one.indices),
            heldout_gain=NUMBER,
        ),
        **rows(
            "elastic",
            result.elastic,
            "elastic_",
            ("elastic_unit", "dimension"),
            name=None,
            **alike(OWN, "declared", "value", "low", "high"),
            told=None,
        ),
        **_traces(result, signal),
        **_angles_of(result, "set_aside", "set_aside"),
        **_angles_of(result, "slip", "slips"),
    }
    told = {"model": name_of(result.declared), "candidates_tried": result.tried}
    told |= about(result, "verdict", "quantity", "notes")
    return Table("Diagnosis", "added", variables, told, frozenset({"sample_run", "sample_theta"}))


def _added(result: Diagnosis, signal: Unit) -> dict[str, Variable]:
    each = [(at, added, size) for at, added in enumerate(result.added) for size in added.estimates]
    return rows(
        "added",
        each,
        "added_",
        ("added_unit", "2.dimension"),
        number=("0", COUNT),
        key="1.effect.key",
        indices=lambda row: inside(row[1].effect.indices),
        parameter="2.name",
        **alike(OWN, "value", "low", "high", within="2."),
        orders=lambda row: ", ".join(f"{order:g}" for order in row[1].orders),
        heldout_rms=("1.heldout_rms", signal),
        indistinguishable_from=lambda row: "; ".join(describe(*one) for one in row[1].indistinguishable),
        notes=lambda row: "\n".join(row[1].notes),
    )


def _angles_of(result: Diagnosis, dim: str, name: str) -> dict[str, Variable]:
    """Angles, as travelled, at which something is marked in the runs, with the number of the run."""
    marked = [
        (at, angle)
        for at, trace in enumerate(result.traces)
        if (found := getattr(trace, name)) is not None
        for angle in found.tolist()
    ]
    return rows(dim, marked, f"{dim}_", run=("0", COUNT), theta=("1", POSITION))


def _joined(values: Sequence[Array]) -> Array:
    return np.concatenate(values) if values else np.zeros(0)


def _traces(result: Diagnosis, signal: Unit) -> dict[str, Variable]:
    """Waveforms of all runs one after another, for each has angles of its own."""
    traces = result.traces
    samples = {
        "run": [np.full(trace.theta.size, at) for at, trace in enumerate(traces)],
        **{name: [getattr(trace, name) for trace in traces] for name in ("theta", "measured", "before", "after")},
        **{f"residual_{name}": [trace.residual[at] for trace in traces] for at, name in enumerate(("before", "after"))},
    }
    units = {"run": NUMBER, "theta": POSITION}
    return {
        **rows("run", traces, "run_", name=None, direction=NUMBER, torque=TORQUE, index=None),
        **{
            f"sample_{name}": Variable(("sample",), _joined(values), units.get(name, signal))
            for name, values in samples.items()
        },
    }
