"""Command that writes a table for a controller: compensate."""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence

from rverror.app.terminal import (
    MAPPING,
    MODEL,
    RUNS,
    ProgressLine,
    choice,
    command,
    flag,
    option,
    output,
    read_runs,
    results,
    save,
    save_results,
    save_with,
    tell,
)
from rverror.base.errors import InputError
from rverror.base.numbers import with_unit
from rverror.compensation.making import compensate
from rverror.compensation.outcome import Compensation
from rverror.compensation.over_conditions import LEAST_CONDITIONS
from rverror.compensation.table_files import FORMATS, WrittenTable, save_compensation, table_sentences
from rverror.diagnosis.loop import diagnose
from rverror.geartrain.mechanism import Reducer
from rverror.model.compensation import WAVE
from rverror.model.effects import Model
from rverror.model.model_file import load_model
from rverror.runs.measurement import Run
from rverror.runs.order_table import OrderTable
from rverror.views.report import to_text


@command(
    example="unit.toml forward.csv reverse.csv -o table.csv",
    options={
        **MODEL,
        **RUNS,
        **output("TABLE", "table to write", required=True),
        "--format": choice(FORMATS, "csv", "format of the table (default csv)"),
        "--torque": option(
            '"20 N*m"',
            "output torque of the table (default: the upper median of the runs' torques); "
            "a json table holds all measured torques and all given here",
            size="torque",
            action="append",
        ),
        **MAPPING,
        **results(plot="the error before and after"),
        **save("NEW.toml", "write the model with the table added as compensation.wave effects"),
        "--force": flag("replace a table that exists"),
    },
)
def _compensate(options: argparse.Namespace) -> None:
    """Write a table with which a controller cancels the repeatable error.

    Writes a table that a controller adds to its commands so that the repeatable part of the output error cancels,
    and predicts the error that remains.
    """
    if os.path.exists(options.output) and not options.force:
        raise InputError(f"{options.output}: this table exists; give another name, or --force to replace it")
    torques = options.torque or []
    if len(torques) > 1 and options.format != "json":
        raise InputError(
            f"--torque: a {options.format} table has one load, {len(torques)} are given; use --format json"
        )
    model = load_model(options.model)
    if options.save and any(effect.key == WAVE.key for effect in model.effects):
        raise InputError(
            f"{options.model}: it has a table already, which the new one replaces; remove its {WAVE.key} for --save"
        )
    runs, unseen = read_runs(options, model)
    made = compensate(_with_causes(model, runs, unseen, torques), runs, torques=torques, unseen=unseen)
    print(to_text(made), end="")
    table = _written(made, options, torques)
    options.plot = options.plot if made.worth else None
    save_results(made, options, table=table)
    if table is not None:
        save_with(options, made.correction.effects(table.torque))


def _written(made: Compensation, options: argparse.Namespace, torques: Sequence[float]) -> WrittenTable | None:
    """The table, where there is one."""
    if not made.worth:
        tell(f"{options.output}: not written, nothing survives on data left out")
        return None
    table = save_compensation(
        options.output, made, format=options.format, torque=torques[0] if torques else None, overwrite=options.force
    )
    for line in table_sentences(table):
        print(f"  {line}")
    tell(f"wrote {options.output}")
    return table


def _with_causes(
    model: Model, runs: Sequence[Run | OrderTable], unseen: Sequence[Run | OrderTable], torques: Sequence[float]
) -> Model:
    """The model, with causes looked for where a load is asked for of which orders alone say nothing."""
    measured, targets = _loads(runs), [*_loads(unseen), *torques]
    new = sorted({load for load in targets if load not in measured})
    if len(measured) >= LEAST_CONDITIONS:
        new = [load for load in new if not min(measured) <= load <= max(measured)]
    if not new or not measured or not isinstance(model.mechanism, Reducer):
        return model
    loads = ", ".join(with_unit(load, "torque") for load in new)
    tell(f"no run at {loads}: looking for causes, which predict the error at other loads")
    with ProgressLine() as progress:
        return diagnose(model, runs, progress=progress).model


def _loads(runs: Sequence[Run | OrderTable]) -> set[float]:
    loads = [one.torque for one in runs if isinstance(one, Run)]
    loads += [case.condition.torque for one in runs if isinstance(one, OrderTable) for case in one.cases]
    return {float(load) for load in loads if load is not None}
