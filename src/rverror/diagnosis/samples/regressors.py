"""What may enter the fit of a drive: offsets, declared effects, candidates, nuisances and lines, as rows of samples."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from rverror.base.arrays import Array
from rverror.base.text import describe
from rverror.diagnosis.samples.runs import RunData, influence_rows
from rverror.geartrain.contacts import pose
from rverror.geartrain.source import IndexValue
from rverror.model.catalogue import CATALOGUE, source
from rverror.model.compose import source_matrix
from rverror.model.effects import Model
from rverror.runs.measurement import Run

#: Kinds of terms; `BESIDE` is a bow that goes with a drift, significant or not.
OFFSET, DECLARED, EFFECT, NUISANCE, LINE = "offset", "declared", "effect", "nuisance", "line"
BESIDE = "beside a drift"
#: Name of the nuisance that bends over time.
BOW = "slow curvature over time"


@dataclass(frozen=True, eq=False)
class Term:
    """Rows that enter a fit as one block.

    Attributes
    ----------
    kind : str
        One of `OFFSET`, `DECLARED`, `EFFECT`, `NUISANCE`, `LINE`, `BESIDE`.
    name : str
        A key of the catalogue, or words.
    rows : ndarray, shape (k, n)
        Over the samples of all runs.
    indices : mapping
        Of the effect.
    orders : tuple of float
        That it leads with, per output turn.
    sigma : float
        Standard deviation of each value as known beforehand; infinite where nothing is.
    means : tuple of float
        Values as known beforehand.
    """

    kind: str
    name: str
    rows: Array
    indices: Mapping[str, IndexValue] = field(default_factory=dict)
    orders: tuple[float, ...] = ()
    sigma: float = np.inf
    means: tuple[float, ...] = ()

    @property
    def size(self) -> int:
        """Number of its rows."""
        return len(self.rows)

    @property
    def label(self) -> str:
        """Name for people."""
        return describe(self.name, self.indices)


def offset_terms(data: RunData) -> list[Term]:
    """Constant of each run."""
    return [
        Term(OFFSET, f"offset of {name}", _own(data, at, np.ones((1, at.stop - at.start))))
        for name, at in zip(data.names, data.slices, strict=True)
    ]


def declared_terms(model: Model, runs: Sequence[Run], data: RunData) -> list[Term]:
    """Declared effects that were measured with an uncertainty, which the fit may change within it.

    Returns
    -------
    list of Term
        No term for a torque record: declared errors of an angle do not show in it.
    """
    if data.quantity != "angle":
        return []
    return [
        Term(
            DECLARED, e.key, _effect_rows(runs, data, e.key, e.indices), dict(e.indices), (),
            float(e.uncertainty), e.values,
        )
        for e in model.effects
        if e.uncertainty
    ]  # fmt: skip


def candidate_terms(model: Model, runs: Sequence[Run], data: RunData) -> list[Term]:
    """Effects of the catalogue that may be missing.

    Parameters
    ----------
    model : Model
    runs : sequence of Run
    data : RunData

    Returns
    -------
    list of Term
        Of those that the runs sample densely enough; for a torque record of shafts alone.
    """
    unit = model.mechanism
    result = []
    for key, entry in CATALOGUE.items():
        if not entry.applies_to(unit) or not data.policy.tries(entry):
            continue
        if data.quantity == "torque" and entry.acts == "reading":
            continue  # no encoder's error makes torque
        if any(entry.lacks(unit, run) for run in runs):
            continue
        for indices in entry.candidates(unit):
            rows = _effect_rows(runs, data, key, indices)
            orders = tuple(abs(order) for order in entry.orders(unit, indices))
            if max(orders, default=0.0) < data.highest_order:
                result.append(Term(EFFECT, key, rows, dict(indices), orders))
    # a shaft that the user named goes before the measuring chain where they cannot be told apart
    return sorted(result, key=lambda term: source(term.name).acts == "reading")


def nuisance_terms(data: RunData) -> list[Term]:
    """What the catalogue has no key for: a bow of a run over time or angle, lost motion between directions."""
    terms = []
    bow = {BOW: data.clock}
    if data.turns < 1:
        bow["slow curvature over the angle"] = data.theta
    powers = (1, 2, 3) if data.quantity == "torque" else (2, 3)
    for name, over in bow.items():
        rows = [_own(data, at, np.stack([_centred_power(over[at], power) for power in powers])) for at in data.slices]
        terms.append(Term(NUISANCE, name, np.concatenate(rows)))
    if np.unique(data.direction).size > 1 and any(np.unique(data.direction[at]).size > 1 for at in data.slices):
        terms.append(Term(NUISANCE, "lost motion", data.direction[None] / 2))
    return terms


def line_term(data: RunData, order: float) -> Term:
    """Cosine and sine of an order, of its own size and phase in each run.

    Parameters
    ----------
    data : RunData
    order : float
        Per output turn.

    Returns
    -------
    Term
        Two rows for each run.
    """
    waves = np.stack([np.cos(order * data.theta), np.sin(order * data.theta)])
    rows = np.concatenate([_own(data, at, waves[:, at]) for at in data.slices])
    return Term(LINE, f"order {order:g}", rows, orders=(order,))


def prior_sum(declared: Sequence[Term], data: RunData) -> Array:
    """What declared terms of an uncertain size predict, as declared."""
    total = np.zeros_like(data.signal)
    for term in declared:
        total += np.array(term.means) @ term.rows
    return total


def implausible(term: Term, values: Array, quantity: str) -> list[str]:
    """Parameters larger than a workshop makes.

    Parameters
    ----------
    term : Term
    values : ndarray, shape (k,)
        Core units.
    quantity : str
        Of the signal; of a torque nothing is known.

    Returns
    -------
    list of str
        Their names.
    """
    if term.kind != EFFECT or quantity != "angle":
        return []
    sizes = zip(source(term.name).parameters, values, strict=True)
    return [p.name for p, value in sizes if abs(value) > p.plausible]


def _effect_rows(runs: Sequence[Run], data: RunData, key: str, indices: Mapping[str, IndexValue]) -> Array:
    parts = []
    for run, at in zip(runs, data.slices, strict=True):
        count = at.stop - at.start  # those of the end: a torque record loses its start
        theta = run.nominal_angle(data.drive) if data.quantity == "angle" else data.theta[at]
        if data.quantity == "angle":
            parts.append(influence_rows(run, data.drive, theta, key, indices)[:, -count:])
        else:
            motion = pose(data.drive, theta, direction=data.direction[at])
            parts.append(source_matrix(motion, {"output": np.ones((1, count))}, key, indices))
    return np.concatenate(parts, axis=1)


def _own(data: RunData, at: slice, rows: Array) -> Array:
    """Rows of one run among all samples."""
    result = np.zeros((len(rows), data.theta.size))
    result[:, at] = rows
    return result


def _centred_power(values: Array, power: int) -> Array:
    middle, half = (values.max() + values.min()) / 2, max(float(np.ptp(values)) / 2, 1e-300)
    return np.asarray(np.polynomial.legendre.Legendre.basis(power)((values - middle) / half), dtype=np.float64)
