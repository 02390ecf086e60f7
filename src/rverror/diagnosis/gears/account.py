"""What is said of a reducer's search: sizes with intervals, what fits as well, what is left, and the waveforms."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rverror.base.arrays import Array, Flags
from rverror.base.text import describe
from rverror.diagnosis.gears.fit import Fit, as_declared, evaluated, fitted, onto, solved
from rverror.diagnosis.gears.record import Record, left_beside
from rverror.diagnosis.gears.score import Hypothesis, bent, unsure
from rverror.diagnosis.gears.search import Search
from rverror.diagnosis.gears.spectrum import MOST_LINES, TOLD_ORDER, LineFound, best_lines, leading, line_at
from rverror.diagnosis.gears.waveform import SOFT_BOUNDS, soft_values
from rverror.diagnosis.result import Addition, Candidate, Diagnosis, ElasticEstimate, Estimate, Line, Residual, Trace
from rverror.geartrain.kinematics import fundamental_orders, samples_needed
from rverror.geartrain.mechanism import Reducer
from rverror.geartrain.torque_over_turn import TorqueWaves
from rverror.model.catalogue import source
from rverror.model.effects import Effect, Model
from rverror.runs.measurement import Run
from rverror.runs.spectrum import even_travel, frames_of_order, harmonics
from rverror.statics.loaded_state import SOFTENING

_TURN = 2 * math.pi


def account(
    declared: Model, runs: Sequence[Run], search: Search, best: Hypothesis, done: bool, notes: list[str],
    beside: Sequence[Fit] = (),
) -> Diagnosis:  # fmt: skip
    """Say what a search came to.

    Parameters
    ----------
    declared : Model
        As given: without the marks, which are a size of what is searched where they are unknown.
    runs : sequence of Run
    search : Search
    best : Hypothesis
        With what was added.
    done : bool
        Whether nothing significant is left.
    notes : list of str
    beside : sequence of Fit
        Of the best's set, at sizes that chance does not tell from its own: intervals hold theirs too.
    """
    if best.fit.added and not done:
        names = " with ".join(describe(e.key, e.indices) for e in best.fit.added)
        notes.append(f"the best candidate, {names}, leaves more than noise: not named")
        search.journal.note("fell", (best.fit.added[-1].key, best.fit.added[-1].indices), "leaves more than noise")
        best = search.score.of(fitted(onto(best.fit.run_set.bare, search.root.fit)))
    fit, halves = best.fit, half_widths(best.fit, beside)
    for record, rest in zip(fit.run_set.records, fit.residual, strict=True):
        notes += [f"{record.name}: {text}, in the residual of the fit" for text in record.more]
        notes += fit.run_set.slow_notes(record, rest) if record.slow else []
    plain = fit.run_set.bare
    as_printed = evaluated(plain, replace(as_declared(fit).model, effects=fit.printed), fit.declared)
    refitted = fitted(onto(plain, search.root.fit)) if fit.added or best.lines else fit
    # a line is no part of the model: it stays in what the model leaves
    lined = fit.run_set.with_free((), slow=best.slow)
    after = evaluated(lined, fit.model, fit.declared, fit.waves) if best.lines else fit
    lines = line_estimates(fit, best_lines(fit, search.policy, outside=False, most=MOST_LINES))
    held = residual(fit).heldout_rms if fit.added else 0.0
    added = tuple(_addition(search, best, at, halves, held) for at in range(len(fit.added)))
    for one in added:
        search.journal.note("added", (one.effect.key, one.effect.indices), "significant, and nothing more is left")
    unclear = not done and not lines and not added
    if unclear:
        notes.append("what is left is more than noise, and no cause or line of the catalogue's orders accounts for it")
    kept = fit.model.effects[: len(fit.declared.effects)]
    result = replace(fit.model, effects=(*kept, *(one.effect for one in added)))
    if len(fit.declared.effects) > len(declared.effects):
        notes.append(offset_note(fit, declared, halves))
    return Diagnosis(
        verdict="unexplained" if lines or unclear else "explained" if added else "nothing_missing",
        noise_rms=noise_rms(fit),
        before=residual(as_printed, hold=True),
        before_refitted=residual(refitted),
        after=residual(after),
        added=added,
        unexplained=lines,
        model=result,
        declared=declared,
        candidates=_candidates(search),
        tried=len(search.candidates),
        traces=tuple(_traces(runs, as_printed, after)),
        notes=tuple(dict.fromkeys([*notes, *_strained(fit)])),
        history=tuple(search.journal.fates),
        elastic=elastic_within(fit, halves),
    )


def noise_rms(fit: Fit) -> float:
    """Root mean square of the noise: of the residual where nothing else is left, else of its model."""
    total, count = 0.0, 0.0
    for record, rest in zip(fit.run_set.records, fit.residual, strict=True):
        noise = record.whiten.noise
        clean = record.without_nuisance(rest)[record.kept]
        used = max(clean.size - len(record.nuisance) - 1, 1)
        size = float(clean @ clean) / used
        wanders = noise.step**2 * clean.size / 6  # variance of a random walk about its mean
        total += min(size, 1.1 * noise.rms**2 + wanders) * used
        count += used
    return math.sqrt(total / count)


def blocks(record: Record) -> Array:
    """Number of the block of each sample that is left out together: turns, or sixths of less than two."""
    turns = math.floor(record.turns + 0.02)
    at = (record.theta - record.theta.min()) / _TURN
    if turns >= 2:
        return np.asarray(np.minimum(np.floor(at + 1e-6), turns - 1), dtype=np.intp)
    if len(record.senses) > 1:  # it comes by the same angles again
        at = np.arange(at.size)
    return np.asarray(np.minimum(np.floor(at / at.max() * 6), 5), dtype=np.intp)


def residual(fit: Fit, *, hold: bool = False) -> Residual:
    """Size of the residual, and of stretches left out of the fit (nothing but offsets is fitted where `hold`)."""
    rests = fit.residual
    clean = [r.without_nuisance(rest)[r.kept] for r, rest in zip(fit.run_set.records, rests, strict=True)]
    whole = np.concatenate(clean)
    left = np.concatenate([one[r.kept] for r, one in zip(fit.run_set.records, left_out(fit, hold=hold), strict=True)])
    return Residual(float(np.sqrt(np.mean(whole**2))), float(np.ptp(whole)), float(np.sqrt(np.mean(left**2))))


def left_out(fit: Fit, *, hold: bool = False) -> list[Array]:
    """Residual of each record, every stretch with sizes and offset from the others alone."""
    records, free = fit.run_set.records, fit.free
    labels = [blocks(r) for r in records]
    result = [np.zeros_like(rest) for rest in fit.residual]
    # no stretch tells how another one settles, or what lies beyond a slip
    settled = [r.slow_part(rest) if r.slow or r.slips else 0.0 for r, rest in zip(records, fit.residual, strict=True)]
    for fold in range(max(int(label.max()) + 1 for label in labels)):
        step = np.zeros(fit.moment.size)
        if not hold and free.any():
            # the fit's own sizes are the best for all: what counts is how they move without these stretches
            gram, moment = np.zeros_like(fit.gram), -fit.moment
            for record, white, label in zip(records, fit.rows, labels, strict=True):
                kept = white[:, label[record.whiten.usable] != fold % (label.max() + 1)]
                gram += kept[1:] @ kept[1:].T
                moment += kept[1:] @ kept[0]
            step[free] = solved(gram[np.ix_(free, free)] / fit.scale, moment[free] / fit.scale, fit.weights[free])
        for number, (record, label) in enumerate(zip(records, labels, strict=True)):
            if fold > label.max():
                continue
            out = label == fold
            rest = fit.residual[number] - step @ fit.raw[number] - settled[number]
            rows = replace(record, zero="", slow=False, slips=()).nuisance
            result[number][out] = left_beside(rest, rows, ~out & record.kept)[out]
    return result


def spread(fit: Fit) -> Array:
    """Variance of each value, shape (k,), with what the model's own errors may move it by.

    They leave so many squares, of all samples (`unsure`) and of what was added (`bent`), at worst where fitted values
    could make them: shared by all of these, they add as much to the variance that comes of the noise.  What comes of a
    prior does not grow.
    """
    policy, own = fit.run_set.policy, fit.covariance
    times = shared(fit, unsure(fit, policy) + bent(fit, policy))
    return np.asarray(np.diag(own) + times * np.einsum("ij,jk,ik->i", own, fit.gram / fit.scale, own))


def shared(fit: Fit, squares: float) -> float:
    """Squares for each value that the fit may move."""
    return squares / max(int(fit.free.sum()), 1)


def half_widths(fit: Fit, beside: Sequence[Fit] = ()) -> list[float]:
    """Half widths of the intervals of all values, which reach as far as those of fits that do as well."""
    reach = [
        np.abs(_values(one) - _values(fit)) + [one.run_set.half_width(float(own)) for own in spread(one)]
        for one in (fit, *beside)
    ]
    return [float(one) for one in np.max(reach, axis=0)]


def _values(fit: Fit) -> Array:
    """All values in the units of their intervals; shared zeros, which nothing is said of, as 0."""
    sizes = [value for effect in fit.model.effects for value in effect.values]
    soft = np.where(fit.run_set.soft, soft_values(fit.model.mechanism), 0.0)
    return np.array([*sizes, *soft, *np.zeros(len(fit.run_set.zeros))])


def _addition(search: Search, node: Hypothesis, number: int, halves: Sequence[float], held: float) -> Addition:
    fit, effect = node.fit, node.fit.added[number]
    made = "the prior says" if fit.run_set.prior.covered else "a workshop makes"
    own, prior = halves[fit.places(number)], fit.run_set.deviation(effect.key, effect.indices)
    estimates, notes = estimated(effect, own)
    for one, half, usual in zip(estimates, own, prior, strict=True):
        if half > fit.run_set.half_width(usual**2 / 2):
            notes.append(f"{one.name}: the runs do not tell it; its interval is what {made}")
    search.journal.tell(f"looking for what fits as well as {describe(effect.key, effect.indices)}")
    alike = search.as_good(node, number)
    origin = "found by rverror diagnose in " + ", ".join(r.name for r in fit.run_set.records)
    return Addition(replace(effect, origin=origin), estimates, alike, _orders(fit, number), held, tuple(notes))


def estimated(effect: Effect, halves: Sequence[float]) -> tuple[tuple[Estimate, ...], list[str]]:
    """Sizes with their intervals of such half widths, and what is said of those that no workshop makes."""
    estimates, notes = [], []
    for parameter, value, half in zip(source(effect.key).parameters, effect.values, halves, strict=True):
        low = max(value - half, parameter.least)
        estimates.append(Estimate(parameter.name, parameter.dimension, value, low, value + half))
        if abs(value) > parameter.plausible:
            notes.append(f"{parameter.name}: larger than a workshop makes; the cause may be another of the same order")
    return tuple(estimates), notes


def _orders(fit: Fit, number: int) -> tuple[float, ...]:
    """Orders at which an added effect changes the prediction, the strongest first; over less than a turn its source's
    own."""
    effect, record = fit.added[number], fit.run_set.records[0]
    if fit.run_set.linear or record.turns < 0.99:
        return tuple(map(abs, source(effect.key).orders(fit.run_set.unit, effect.indices)))
    without = evaluated(fit.run_set, fit.model_with(instead_of=number), fit.declared)
    theta, change = even_travel(record.theta, without.residual[0] - fit.residual[0])
    size = np.pad(np.abs(harmonics(change)), 1)
    orders = np.arange(1, size.size - 1) / round(theta.size * (theta[1] - theta[0]) / _TURN)
    peaks = (size[1:-1] >= size[:-2]) & (size[1:-1] > size[2:]) & (size[1:-1] > 1e-3 * fit.run_set.policy.least_line)
    return leading(orders, np.where(peaks, size[1:-1], 0.0), size.max())


def line_estimates(fit: Fit, left: Sequence[LineFound]) -> tuple[Line, ...]:
    """Free lines of the fit and significant lines that are left, the strongest first."""
    policy = fit.run_set.policy
    found = list(left)
    for order in fit.run_set.lines:
        bare = [replace(r, orders=tuple(o for o in r.orders if o != order)) for r in fit.run_set.records]
        found.append(line_at(bare, fit.residual, order))
    turns = max(r.turns for r in fit.run_set.records)
    result = []
    for line in found:
        wave = np.array(line.waves)
        size = float(np.mean(np.abs(wave)))
        variance = size**2 / max(line.power, 1e-9)  # the power is that of all runs together
        half = fit.run_set.half_width(variance * (1 + shared(fit, unsure(fit, policy))))
        order = round(line.order) if abs(line.order - round(line.order)) < TOLD_ORDER / turns else line.order
        frames = frames_of_order(fit.run_set.unit, float(order), tolerance=max(policy.order_tolerance, 0.3 / turns))
        mean = complex(np.mean(wave))
        result.append(
            Line(float(order), size, max(size - half, 0.0), size + half, tuple(frames), mean.real, -mean.imag)
        )
    return tuple(sorted(result, key=lambda line: -line.amplitude))


def _candidates(search: Search) -> tuple[Candidate, ...]:
    ranked = sorted(search.moves.leading, key=lambda offer: offer.objective)[:20]
    return tuple(Candidate(*offer.names[0], offer.without - offer.objective) for offer in ranked)


def elastic_within(fit: Fit, halves: Sequence[float]) -> tuple[ElasticEstimate, ...]:
    """What the runs say of stiffness, backlash and contact law, with half the width of each value's interval."""
    unit, now = fit.run_set.unit, fit.model.mechanism
    if not isinstance(unit, Reducer) or not isinstance(now, Reducer):
        return ()
    count = sum(len(e.values) for e in fit.model.effects)
    stated, values = soft_values(unit).tolist(), soft_values(now).tolist()
    result = []
    for at in np.flatnonzero(fit.run_set.soft).tolist():
        own, half, name = count + at, halves[count + at], SOFTENING[at]
        known = fit.run_set.half_width(1 / max(fit.weights[own], 1e-300))
        if at < 6:
            value = getattr(now.stiffness, name)
            sizes = getattr(unit.stiffness, name), value, value * math.exp(-half), value * math.exp(half)
        else:
            sizes = stated[at], values[at], *np.clip([values[at] - half, values[at] + half], *SOFT_BOUNDS[at]).tolist()
        dimension = "stiffness" if at < 6 else "length" if name == "gear_backlash" else "number"
        result.append(ElasticEstimate(name, dimension, *sizes, determined=half**2 < 0.5 * known**2))
    return tuple(result)


def _strained(fit: Fit) -> list[str]:
    """Declared sizes that the fit moved further than they are uncertain."""
    notes = []
    for stated, now in zip(fit.declared.effects, fit.model.effects, strict=False):
        moved_by = max(abs(np.subtract(now.values, stated.values)))
        if stated.uncertainty and moved_by > fit.run_set.policy.most_strain * stated.uncertainty:
            name = describe(stated.key, stated.indices)
            notes.append(
                f"declared {name} moved by {moved_by / stated.uncertainty:.1f} of its uncertainty: measure it again"
            )
    return notes


def run_notes(fit: Fit, unit: Reducer) -> list[str]:
    """What the runs of a reducer lack, in words."""
    notes = []
    needed = samples_needed(unit)
    for record in fit.run_set.records:
        count = record.theta.size / record.turns
        mesh = {name: fundamental_orders(unit)[name] for name in ("gear mesh", "cycloid mesh")}
        folded = [f"{name} {order:g}" for name, order in mesh.items() if order > count / 2]
        if folded:
            notes.append(
                f"{record.name}: {count:.4g} samples a turn fold {' and '.join(folded)} onto lower orders; {needed} or "
                "more keep them apart"
            )
        if not record.torque:
            notes.append(
                f"{record.name}: no output_torque; predicted by the closed form (rigid, all loaded pins in contact)"
            )
        if record.turns < 0.98:
            notes.append(
                f"{record.name}: {record.turns:.3g} of a turn: drift, ratio error and encoder orders 1 and 2 look "
                "alike over a short travel"
            )
    if len({sense for record in fit.run_set.records for sense in record.senses}) == 1:
        notes.append("runs in one direction only: causes that share an order cannot be told apart; add a reverse run")
    return notes


def offset_note(fit: Fit, declared: Model, halves: Sequence[float]) -> str:
    """Where unknown marks are, in words, from half of the interval of every value."""
    place = sum(len(e.values) for e in declared.effects)
    if spread(fit)[place] > math.pi**2 / 3:  # that of marks that may be anywhere
        return "index unknown: nothing that shows is declared or found, so the gear's marks cannot be placed"
    value = fit.model.effects[len(declared.effects)].values[0]
    half = math.degrees(halves[place])
    turn = math.degrees(2 * math.pi / fundamental_orders(fit.run_set.gears)["crank"])
    known = [(e.key, e.indices) for e in declared.effects if not source(e.key).at_output]
    again = all(source(key).repeats_with_crank(fit.run_set.unit, indices) for key, indices in known)
    turns = (
        f", or whole turns of the crank, {turn:.4g} deg, from there, and pins are counted from there" if again else ""
    )
    return (
        f"index unknown: the gear's marks are {math.degrees(value):.4g} +- {half:.2g} deg "
        f"ahead of the bench's zero{turns}, fitted together with all sizes; all runs are taken to have the same zero"
    )


def _traces(runs: Sequence[Run], printed: Fit, fit: Fit) -> list[Trace]:
    """Waveforms of each run over one turn, or over what it travels of one."""
    out_before, out_after = left_out(printed, hold=True), left_out(fit)
    before, after = printed.residual, fit.residual
    result = []
    for at, (record, run) in enumerate(zip(fit.run_set.records, runs, strict=True)):
        rows = np.stack(
            [record.error, record.error - before[at], record.error - after[at], out_before[at], out_after[at]]
        )
        torque = None if isinstance(record.torque, TorqueWaves) else record.torque
        aside = record.theta[np.setdiff1d(np.flatnonzero(~record.kept), record.absent)]
        slips = record.theta[list(record.slips)]
        for sense in record.senses:
            theta, mean = _turned_over(record, rows, record.kept & (record.direction == sense))
            measured, first, last = (row - row.mean() for row in mean[:3])
            left = mean[3], mean[4]
            result.append(
                Trace(record.name, sense, theta, measured, first, last, torque, run.index, left, aside, slips)
            )
    return result


def _turned_over(record: Record, rows: Array, used: Flags) -> tuple[Array, Array]:
    """Rows over one turn, the mean of all whole ones; over the travel where it is less."""
    order = np.flatnonzero(used)[np.argsort(record.theta[used], kind="stable")]
    theta, rows = record.theta[order], rows[:, order]
    turns = math.floor(record.turns + 0.01)
    if turns < 1:
        return _mean_of_passes(theta, rows, record.theta[used]) if len(record.senses) > 1 else (theta, rows)
    points = round(record.theta.size / record.turns)
    grid = theta[0] + _TURN / points * np.arange(points)
    folded = [[np.interp(grid + _TURN * k, theta, row) for k in range(turns)] for row in rows]
    return grid, np.mean(folded, axis=1)


def _mean_of_passes(theta: Array, rows: Array, travelled: Array) -> tuple[Array, Array]:
    """Rows over even angles, the mean of all times that a run came by them.

    Parameters
    ----------
    theta : ndarray, shape (n,)
        Growing, rad.
    rows : ndarray, shape (k, n)
    travelled : ndarray, shape (n,)
        The angles in the order of time.
    """
    travel = float(np.ptp(theta)) * theta.size / (theta.size - 1)
    passes = max(1.0, float(np.abs(np.diff(travelled)).sum()) / travel)
    points = max(round(theta.size / passes), 2)
    cell = np.minimum(np.floor((theta - theta[0]) / travel * points).astype(np.intp), points - 1)
    count = np.bincount(cell, minlength=points)
    there, grid = count > 0, theta[0] + travel / points * np.arange(points)
    angle, *means = (np.bincount(cell, row, points)[there] / count[there] for row in (theta, *rows))
    return grid, np.array([np.interp(grid, angle, mean) for mean in means])
