"""Every kind of result: its table, its report and its JSON, registered where each is described."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from rverror.base.errors import InputError
from rverror.base.numbers import count_of
from rverror.model.effects import Effect
from rverror.statics.friction import Efficiency
from rverror.tolerances.allocation_result import FrontPoint
from rverror.tolerances.declared import Tolerance
from rverror.views import compensation_report, dynamics_report, life_report, lot_report  # noqa: F401

from rverror.views import budget_report, diagnosis_table  # noqa: F401  # isort: skip
from rverror.views.allocation_report import front_table, tolerances_table
from rverror.views.blocks import Listing, Sheet, title
from rverror.views.describing import content, described, has_sheet, own_columns, sheet, table, with_options
from rverror.views.model_report import effects_table
from rverror.views.static_report import efficiencies_table
from rverror.views.variables import Table

__all__ = ["content", "described", "has_sheet", "sheet", "table", "with_options"]

#: Tables of results of one kind that stand in a row.
_SEQUENCES: Mapping[type, Callable[[Any], Table]] = {
    Effect: effects_table,
    Tolerance: tolerances_table,
    FrontPoint: front_table,
    Efficiency: efficiencies_table,
}


@table.register
def _of_sequence(result: Sequence) -> Table:  # type: ignore[type-arg]
    kinds = {type(item) for item in result}
    made = _SEQUENCES.get(kinds.pop()) if len(kinds) == 1 else None
    if made is None:
        names = ", ".join(kind.__name__ for kind in _SEQUENCES)
        raise InputError(f"{type(result).__name__}: a table is made of a row of results of one kind: {names}")
    return made(result)


@sheet.register(list)
@sheet.register(tuple)
def _of_row(thing: Sequence[Any]) -> Sheet:
    """Effects, tolerances, points of a front or efficiencies, as the columns of their table."""
    listed = own_columns(thing)
    count = sum(len(block.rows) for block in listed if isinstance(block, Listing))
    return title(described(thing).kind, count_of(count, "row")) + listed
