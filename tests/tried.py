"""Of every source and mechanism: the indices that tests try, and over how much of a turn."""

from __future__ import annotations

from itertools import product
from typing import Any

from rverror import Reducer
from rverror.geartrain.kinematics import samples_needed, true_period
from rverror.geartrain.mechanism import Mechanism
from rverror.geartrain.source import Source


def index_sets(entry: Source, mechanism: Mechanism) -> list[dict[str, Any]]:
    """First, second and last value of every index that diagnosis tries."""
    values = []
    for index in entry.indices:
        tried = list(index.tried(mechanism))
        values.append([tried[i] for i in sorted({0, min(1, len(tried) - 1), len(tried) - 1})])
    return [dict(zip([i.name for i in entry.indices], chosen, strict=True)) for chosen in product(*values)]


def period_and_samples(mechanism: Mechanism) -> tuple[int, int]:
    """Output turns until all stands as before, and enough samples for the fourth harmonic of the highest mesh order."""
    turns = true_period(mechanism)
    per_turn = 2 * samples_needed(mechanism) if isinstance(mechanism, Reducer) else 4096
    return turns, max(4096, per_turn) * turns
