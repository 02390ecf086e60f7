"""A compensation for programs: orders, error before and after, what stays, data that no fit saw."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from rverror.base import units
from rverror.base.numbers import in_arcsec
from rverror.compensation.outcome import Compensation, HeldError
from rverror.compensation.table_files import WrittenTable, correction_json
from rverror.runs.measuring_chain import uncertainty_of
from rverror.views.bench_report import bench_json
from rverror.views.envelope import InputFile, enveloped


def compensation_json(
    made: Compensation, *, files: Sequence[InputFile] = (), table: WrittenTable | None = None
) -> dict[str, Any]:
    """Compensation as plain data for `json.dump`; `table` is what was written of it, None where nothing was."""
    return enveloped(
        "Compensation",
        {
            "worth": made.worth,
            "before": _held(made.before),
            "after": _held(made.after),
            "bench_uncertainty": bench_json(uncertainty_of(made.model.encoders, made.model.mechanism.ratio)),
            "orders": [
                {
                    "order": one.order,
                    "frames": list(one.frames),
                    "amplitude_arcsec": in_arcsec(one.amplitude),
                    "left_arcsec": None if math.isnan(one.left) else in_arcsec(one.left),
                    "law": one.law,
                }
                for one in made.orders
            ],
            "stays": list(made.stays),
            "notes": list(made.notes),
            "validation": [
                {
                    "file": one.file,
                    "before": {"rms_arcsec": in_arcsec(one.before)},
                    "after": {"rms_arcsec": in_arcsec(one.after)},
                }
                for one in made.unseen
            ],
            "table": None if table is None else _table(table),
            "correction": correction_json(made.correction, made.index),
        },
        files,
    )


def _held(one: HeldError) -> dict[str, float | None]:
    return {
        "heldout_rms_arcsec": in_arcsec(one.rms),
        "low": None if math.isnan(one.low) else in_arcsec(one.low),
        "high": None if math.isnan(one.high) else in_arcsec(one.high),
    }


def _table(table: WrittenTable) -> dict[str, Any]:
    return {
        "format": table.format,
        "output_torque_newton_metre": None if table.torque is None else units.to_display(table.torque, "torque"),
        "points": table.points or None,
        "expected_rms_arcsec": in_arcsec(table.expected),
        "between_points_rms_arcsec": in_arcsec(table.between),
        "waves_rms_arcsec": in_arcsec(table.waves),
        "slipped_by_one_degree_rms_arcsec": in_arcsec(table.slipped),
        "of_itself_arcsec": in_arcsec(table.of_itself),
        "orders_left_out": list(table.left_out),
    }
