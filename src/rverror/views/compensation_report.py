"""A compensation: orders, error before and after, what stays, data that no fit saw."""

from __future__ import annotations

from typing import Any

from rverror.base import units
from rverror.base.numbers import count_of
from rverror.compensation.outcome import Compensation, HeldError
from rverror.compensation.table_files import WrittenTable, correction_json, table_told
from rverror.runs.measuring_chain import uncertainty_of
from rverror.views.bench_report import BESIDE, bench_json
from rverror.views.blocks import Sentence, Sheet, line, notes, title
from rverror.views.describing import content, sheet, table
from rverror.views.fields import Column, Field, about, alike, entry, for_people, in_json, in_table, listing, rows
from rverror.views.model_report import name_of
from rverror.views.variables import ANGLE, NUMBER, Table

_BENCH_REPEATS = "The bench's own error repeats as the gears' does, so the table holds it, and the output keeps it."


_ORDER = (
    Column("order", NUMBER),
    Column("", "order", "order", "order"),
    Column("amplitude", ANGLE, "amplitude_arcsec", "amplitude, arcsec"),
    Column("left", ANGLE, "left_arcsec", "left, arcsec"),
    Column("law", key="law", head="over direction and condition"),
    Column("frames", lambda one: "; ".join(one.frames), head="fits"),
    Column("", "frames", "frames"),
)
_UNSEEN = (
    Column("file", head="seen by no fit, rms, arcsec"),
    Column("before", ANGLE, head="without"),
    Column("after", ANGLE, head="with"),
)


@table.register
def _table(result: Compensation) -> Table:
    stages = (("before", result.before), ("after", result.after))
    variables = {
        **rows("order", result.orders, **in_table(_ORDER)),
        **rows("stage", stages, stage="0", **alike(ANGLE, "rms", "low", "high", within="1.")),
        **rows("unseen", result.unseen, "unseen_", **in_table(_UNSEEN)),
    }
    told = about(result, "index", "stays", "notes", model=name_of(result.model))
    return Table("Compensation", "order", variables, told)


@content.register
def _content(made: Compensation, *, table: WrittenTable | None = None) -> dict[str, Any]:
    """`table` is what was written of it, None where nothing was."""
    return {
        **entry(made, worth=None, stays=None, notes=None),
        "before": _held(made.before),
        "after": _held(made.after),
        "bench_uncertainty": bench_json(uncertainty_of(made.model.encoders, made.model.mechanism.ratio)),
        "orders": [entry(one, **in_json(_ORDER)) for one in made.orders],
        "validation": [
            {
                "file": one.file,
                "before": entry(one, rms_arcsec=("before", ANGLE)),
                "after": entry(one, rms_arcsec=("after", ANGLE)),
            }
            for one in made.unseen
        ],
        "table": None if table is None else _written(table),
        "correction": correction_json(made.correction, made.index),
    }


def _held(one: HeldError) -> dict[str, Any]:
    return entry(one, heldout_rms_arcsec=("rms", ANGLE), low=ANGLE, high=ANGLE)


def _written(made: WrittenTable) -> dict[str, Any]:
    return {
        "output_torque_newton_metre": None if made.torque is None else units.to_display(made.torque, "torque"),
        "points": made.points or None,
        **entry(
            made,
            format=None,
            expected_rms_arcsec=("expected", ANGLE),
            between_points_rms_arcsec=("between", ANGLE),
            waves_rms_arcsec=("waves", ANGLE),
            slipped_by_one_degree_rms_arcsec=("slipped", ANGLE),
            orders_left_out="left_out",
        ),
    }


@sheet.register
def _sheet(thing: Compensation, *, table: WrittenTable | None = None) -> Sheet:
    verdict = f"{count_of(len(thing.orders), 'order')} compensated" if thing.worth else "nothing to compensate"
    bench = uncertainty_of(thing.model.encoders, thing.model.mechanism.ratio)

    def beside(of: Any) -> dict[str, Field]:
        """Column of the bench's uncertainty, where one is stated."""
        return {} if bench is None else {f"± {BESIDE}": (of, ANGLE)}

    of_rms = beside(lambda _: bench and bench.of("rms"))
    held: dict[str, Field] = {
        "error of data left out, arcsec": "0",
        "rms": ("1.rms", ANGLE),
        **of_rms,
        "one more, 95 %": ("1", ANGLE),
    }
    of_orders = beside(lambda one: bench and bench.of_order(one.order))
    return (
        *title("Compensation", name_of(thing.model)),
        Sentence(verdict),
        *listing((("without", thing.before), ("with", thing.after)), held),
        *listing(thing.unseen, {**for_people(_UNSEEN), **of_rms}),
        *listing(thing.orders, {**for_people(_ORDER), **of_orders}),
        *(Sentence(f"Stays: {text}") for text in thing.stays),
        *line(_BENCH_REPEATS if bench and thing.worth else ""),
        *(() if table is None else map(Sentence, table_told(table))),
        *notes(thing.notes),
    )
