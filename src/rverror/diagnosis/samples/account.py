"""What is said of a fit of samples: sizes, what fits as well, lines that remain, waveforms and notes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array
from rverror.diagnosis.result import Addition, Alike, Candidate, Diagnosis, Estimate, Fate, Line, Residual, Trace
from rverror.diagnosis.samples.coloured import kept_share, noise_of_samples, orthonormal
from rverror.diagnosis.samples.fit import SampleFit, fitted, held_out_squares
from rverror.diagnosis.samples.lines import SAME_ORDER, TOLD_ORDER
from rverror.diagnosis.samples.regressors import (
    BESIDE,
    DECLARED,
    EFFECT,
    LINE,
    NUISANCE,
    OFFSET,
    Term,
    implausible,
    prior_sum,
)
from rverror.diagnosis.samples.runs import RunData
from rverror.geartrain.kinematics import true_period
from rverror.model.catalogue import source
from rverror.model.effects import Effect, Model
from rverror.runs.spectrum import frames_of_order

_TURN = 2 * np.pi
_TRACE_POINTS = 2048


def result_of(
    model: Model,
    data: RunData,
    base: Sequence[Term],
    candidates: Sequence[Term],
    fit: SampleFit,
    ranking: Sequence[Candidate],
    notes: Sequence[str],
    history: tuple[Fate, ...],
) -> Diagnosis:
    """Put the outcome of a search into words and numbers.

    Parameters
    ----------
    model : Model
        As declared.
    data : RunData
    base : sequence of Term
        Offsets and declared effects, with which the search began.
    candidates : sequence of Term
    fit : SampleFit
        Final fit, lines included.
    ranking : sequence of Candidate
        Of the last round.
    notes : sequence of str
        From reading the runs.
    history : tuple of Fate
        Of the search.
    """
    added = _in_order([t for t in fit.terms if t.kind == EFFECT])
    declared = [t for t in base if t.kind == DECLARED]
    as_printed = replace(data, signal=data.signal - prior_sum(declared, data))
    offsets = [t for t in base if t.kind == OFFSET]
    additions = tuple(
        _addition(data, fit, term, candidates, [*base, *added[: place + 1]]) for place, term in enumerate(added)
    )
    lines = tuple(sorted(_lines(data, fit), key=lambda line: -line.amplitude))
    settled = "explained" if added else "nothing_missing"
    explained = [t for t in fit.terms if t.kind != LINE]
    before = _residual(as_printed, offsets, fit)
    return Diagnosis(
        verdict="unexplained" if lines else settled,
        noise_rms=float(np.sqrt(np.mean(fit.residual**2))),
        before=before,
        before_refitted=_residual(data, base, fit) if declared else before,
        after=_residual(data, explained, fit),
        added=additions,
        unexplained=lines,
        model=_fitted_model(model, data, fit, additions),
        declared=model,
        candidates=tuple(ranking),
        tried=len(candidates),
        traces=_traces(data, base, fit),
        notes=(*notes, *_told(data, fit)),
        quantity=data.quantity,
        history=history,
    )


def _in_order(terms: Sequence[Term]) -> list[Term]:
    """Errors that grow along a run first, since without them no other figure means much; then as they were found."""
    return sorted(terms, key=lambda t: source(t.name).periodic)


def _residual(data: RunData, terms: Sequence[Term], noise: SampleFit) -> Residual:
    """Size of the residual, and of blocks that the fit did not see."""
    rest = fitted(data, terms, noise=noise).residual
    rest = np.concatenate([rest[at] - rest[at].mean() for at in data.slices])
    squares = held_out_squares(data, terms, noise)
    return Residual(
        float(np.sqrt(np.mean(rest**2))), float(rest.max() - rest.min()), float(np.sqrt(squares / rest.size))
    )


def _addition(
    data: RunData,
    fit: SampleFit,
    term: Term,
    candidates: Sequence[Term],
    so_far: Sequence[Term],
) -> Addition:
    """Describe a term that was added.

    Parameters
    ----------
    data : RunData
    fit : SampleFit
    term : Term
        Of the fit.
    candidates : sequence of Term
        That may explain the same.
    so_far : sequence of Term
        Of the fit up to this one, for the held-out residual.
    """
    values, reaches = fit.values(term), fit.reach(term, np.diag(fit.own_spread(term)))
    estimates = tuple(
        Estimate(
            p.name,
            p.dimension if data.quantity == "angle" else data.quantity,
            float(value),
            float(value - reach),
            float(value + reach),
        )
        for p, value, reach in zip(source(term.name).parameters, values, reaches, strict=True)
    )
    alike = _alike(data, fit, term, candidates)
    notes = [
        f"{name}: larger than a workshop makes; the cause may be another of the same order"
        for name in implausible(term, fit.values(term), data.quantity)
    ]
    for other, replaced in alike:
        if too_large := implausible(other, replaced.values(other), data.quantity):
            parameters = {p.name: p for p in source(other.name).parameters}
            size = np.linalg.norm(replaced.values(other))
            dimension = parameters[too_large[0]].dimension
            notes.append(
                f"in its place {other.label} would have to be {units.to_display(float(size), dimension):.4g} "
                f"{units.DISPLAY_UNITS[dimension]}, larger than a workshop makes"
            )
    effect = Effect(
        term.name,
        dict(term.indices),
        tuple(float(v) for v in values),
        origin="found by rverror diagnose in " + ", ".join(data.names),
    )
    names: Alike = tuple((other.name, dict(other.indices)) for other, _ in alike)
    nuisances = [t for t in fit.terms if t.kind in (NUISANCE, BESIDE)]
    residual = _residual(data, [*so_far, *nuisances], fit)
    return Addition(effect, estimates, names, term.orders, residual.heldout_rms, tuple(notes))


def _alike(data: RunData, fit: SampleFit, term: Term, candidates: Sequence[Term]) -> list[tuple[Term, SampleFit]]:
    """Candidates beside which a term is not needed any more, and the fit with each of them in its place."""
    without = [t for t in fit.terms if t is not term]
    found = []
    for other in candidates:
        rows = np.concatenate([t.rows for t in without])
        if other in fit.terms:
            continue
        beside = np.concatenate([rows, other.rows])
        needless = kept_share(orthonormal(beside), term.rows) < 1e-9
        if not needless:
            both = fitted(data, [*without, other, term], noise=fit)
            needless = not both.significant(term, data.policy.alike)
        if needless:
            found.append((other, fitted(data, [*without, other], noise=fit)))
    return found


def _lines(data: RunData, fit: SampleFit) -> list[Line]:
    lines = []
    for term in fit.terms:
        if term.kind != LINE:
            continue
        values = fit.values(term).reshape(-1, 2)
        sizes = np.hypot(values[:, 0], values[:, 1])
        toward = (values / np.maximum(sizes, 1e-300)[:, None] / len(values)).ravel()
        reach = float(fit.reach(term, toward @ fit.own_spread(term) @ toward))
        size = float(sizes.mean())
        order = _told_order(data, term.orders[0])
        frames = frames_of_order(data.drive, order, tolerance=max(data.policy.order_tolerance, SAME_ORDER / data.turns))
        lines.append(Line(order, size, max(size - reach, 0.0), size + reach, tuple(frames)))
    return lines


def _told_order(data: RunData, order: float) -> float:
    """Order with the digits that the travel gives it; whole where it is that near to a whole one."""
    apart = TOLD_ORDER / data.turns
    unit = 10.0 ** np.floor(np.log10(apart))
    near = round(order)
    return float(near) if abs(order - near) < apart else float(round(order / unit) * unit)


def _told(data: RunData, fit: SampleFit) -> list[str]:
    """What was found that the catalogue has no key for, and what the noise is like."""
    notes = []
    unit = units.DISPLAY_UNITS[data.quantity]
    for term in fit.terms:
        if term.kind not in (NUISANCE, BESIDE):
            continue
        if term.name == "lost motion":
            size, half = float(fit.values(term)[0]), float(fit.reach(term, fit.own_spread(term)[0, 0]))
            value, reach = (units.to_display(x, data.quantity) for x in (size, half))
            interval = f"{100 * fit.confidence:g} % [{value - reach:.4g}, {value + reach:.4g}]"
            notes.append(
                f"the output leads by {value:.4g} {unit} more, {interval}, in forward than in reverse motion: lost "
                "motion or friction, a constant for each direction; no key of the catalogue, so it is taken off and "
                "not added to the model"
            )
            continue
        for name, at in zip(data.names, data.slices, strict=True):
            wave = (fit.values(term) @ term.rows)[at]
            why = "is significant" if term.kind == NUISANCE else "may go with the drift, significant or not"
            size = units.to_display(float(np.ptp(wave)), data.quantity)
            notes.append(f"{name}: {term.name}, {size:.4g} {unit} peak-to-peak, {why}; it is taken off and not named")
    for name, at in zip(data.names, data.slices, strict=True):
        lags = noise_of_samples(fit.residual[at], floor=data.floor).coefficients.size
        colour = f"coloured: each sample depends on the {lags} before" if lags else "white"
        notes.append(f"{name}: noise is {colour}")
    if (data.direction > 0).all() or (data.direction < 0).all():
        notes.append("runs in one direction only: lost motion does not show; add a reverse run")
    return notes


def _fitted_model(model: Model, data: RunData, fit: SampleFit, additions: Sequence[Addition]) -> Model:
    if data.quantity != "angle":
        return model
    sizes = iter([tuple(map(float, fit.values(t))) for t in fit.terms if t.kind == DECLARED])
    effects = [replace(e, values=next(sizes)) if e.uncertainty else e for e in model.effects]
    return replace(model, effects=(*effects, *(a.effect for a in additions)))


def _traces(data: RunData, base: Sequence[Term], fit: SampleFit) -> tuple[Trace, ...]:
    """Waveform of each run and direction on even angles: the mean of its turns, or the travel of a short run."""
    explained = fitted(data, [t for t in fit.terms if t.kind != LINE], noise=fit)
    after = data.signal - explained.residual
    declared = prior_sum([t for t in base if t.kind == DECLARED], data)
    return tuple(
        _trace(data, name, at, sense, declared, after)
        for name, at in zip(data.names, data.slices, strict=True)
        for sense in (1.0, -1.0)
        if np.count_nonzero(data.direction[at] == sense) > 16
    )


def _trace(data: RunData, name: str, at: slice, sense: float, declared: Array, after: Array) -> Trace:
    used = data.direction[at] == sense
    theta = data.theta[at][used]
    n = theta.size
    travel = float(np.ptp(theta)) * n / (n - 1)
    period = _TURN * true_period(data.drive)
    period = next((p for p in (period, _TURN) if travel > p * (1 - 1e-6)), travel)
    passes = max(travel / period, 1.0) * max(1.0, float(np.abs(np.diff(theta)).sum()) / max(travel, 1e-300))
    points = int(np.clip(round(n / passes), 16, _TRACE_POINTS))
    cell = np.round((theta - theta.min()) / period * points).astype(np.intp)
    cell = np.minimum(cell, points - 1) if period == travel else cell % points  # a part of a turn does not close
    count = np.bincount(cell, minlength=points)
    grid = np.arange(points)

    def mean(values: Array) -> Array:
        total = np.bincount(cell, values[at][used], points)
        row = np.interp(grid, grid[count > 0], total[count > 0] / count[count > 0])
        return np.asarray(row - row.mean(), dtype=np.float64)

    angles = theta.min() + period / points * grid
    return Trace(name, sense, angles, mean(data.signal), mean(declared), mean(after))
