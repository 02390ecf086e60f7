"""Every kind of result: its table, its report and its JSON, registered where each is described."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from rverror.base.errors import InputError
from rverror.model.effects import Effect
from rverror.statics.friction import Efficiency
from rverror.tolerances.allocation_result import FrontPoint
from rverror.tolerances.declared import Tolerance
from rverror.views import (  # noqa: F401
    compensation_report,
    diagnosis_report,
    dynamics_report,
    life_report,
    lot_report,
    tolerance_report,
)
from rverror.views.describing import content, described, sheet, table
from rverror.views.model_report import effects_table
from rverror.views.static_report import efficiencies_table
from rverror.views.tolerance_report import front_table, tolerances_table
from rverror.views.variables import Table

__all__ = ["content", "sheet", "table"]

#: Tables of results of one kind that stand in a row.
_SEQUENCES: Mapping[type, Callable[[Any], Table]] = {
    Effect: effects_table,
    Tolerance: tolerances_table,
    FrontPoint: front_table,
    Efficiency: efficiencies_table,
}


@described.register
def _of_sequence(result: Sequence) -> Table:  # type: ignore[type-arg]
    kinds = {type(item) for item in result}
    made = _SEQUENCES.get(kinds.pop()) if len(kinds) == 1 else None
    if made is None:
        names = ", ".join(kind.__name__ for kind in _SEQUENCES)
        raise InputError(f"{type(result).__name__}: no table is made of it; give a row of results of one kind: {names}")
    return made(result)
