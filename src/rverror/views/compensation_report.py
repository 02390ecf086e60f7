"""A compensation: orders, error before and after, what stays, data that no fit saw."""

from __future__ import annotations

from typing import Any

from rverror.base.numbers import brief, count_of
from rverror.base.units import ARCSEC
from rverror.compensation.outcome import Compensation
from rverror.compensation.table_files import WrittenTable, correction_json, table_sentences
from rverror.runs.measuring_chain import uncertainty_of
from rverror.views.bench_report import bench_json, of_figures, of_orders
from rverror.views.blocks import Sentence, Sheet
from rverror.views.describing import described, entries, sheet, sheet_of, table as table_of
from rverror.views.diagnosis_report import validation_json
from rverror.views.fields import about, entry, rows
from rverror.views.model_report import name_of
from rverror.views.shown_units import ANGLE, NUMBER, TORQUE
from rverror.views.variables import Table

_BENCH_REPEATS = "The bench's own error repeats as the gears' does, so the table holds it, and the output keeps it."


@described.register
def _table(result: Compensation) -> Table:
    bench = uncertainty_of(result.model.encoders, result.model.mechanism.ratio)
    stages = (("before", result.before), ("after", result.after))
    variables = {
        **rows("stage", stages, stage="0", rms=("1.rms", ANGLE), low=("1.low", ANGLE), high=("1.high", ANGLE)),
        **rows("unseen", result.unseen, "unseen_", file=None, before=ANGLE, after=ANGLE),
        **rows("order", result.orders, order=NUMBER, amplitude=ANGLE, left=ANGLE, law=None, frames=None),
        **rows("order", result.orders, **of_orders(bench)),
    }
    stays = [f"Remains: {text}." for text in result.stays]
    if bench is not None:
        stays += [of_figures(bench), *[_BENCH_REPEATS] * result.worth]
    strong = f"{count_of(len(result.orders), 'order')} compensated" if result.worth else "Nothing to compensate"
    before, after = (brief(one.rms / ARCSEC, 3) for one in (result.before, result.after))
    fall = f": the held-out rms falls from {before} to {after} arcsec" if result.worth else ""
    return Table(
        variables,
        about(result, "index", "stays", "notes", model=name_of(result.model)),
        title=(name_of(result.model),),
        verdict=(strong, f"{fall}."),
        sentences=tuple(stays),
        rows="order",
    )


@entries.register
def _content(made: Compensation, *, table: WrittenTable | None = None) -> dict[str, Any]:
    """`table` is what was written of it, None where nothing was."""
    return {
        "worth": made.worth,
        **{
            stage: entry(getattr(made, stage), heldout_rms_arcsec=("rms", ANGLE), low=ANGLE, high=ANGLE)
            for stage in ("before", "after")
        },
        "bench_uncertainty": bench_json(uncertainty_of(made.model.encoders, made.model.mechanism.ratio)),
        "validation": validation_json(made.unseen, "angle"),
        "table": None if table is None else _written(table),
        "correction": correction_json(made.correction, made.index),
    }


def _written(made: WrittenTable) -> dict[str, Any]:
    return entry(
        made,
        points=lambda table: table.points or None,
        output_torque_newton_metre=("torque", TORQUE),
        format=None,
        expected_rms_arcsec=("expected", ANGLE),
        between_points_rms_arcsec=("between", ANGLE),
        waves_rms_arcsec=("waves", ANGLE),
        slipped_by_one_degree_rms_arcsec=("slipped", ANGLE),
        orders_left_out="left_out",
    )


@sheet.register
def _sheet(thing: Compensation, *, table: WrittenTable | None = None) -> Sheet:
    return (*sheet_of(table_of(thing)), *(() if table is None else map(Sentence, table_sentences(table))))
