"""The closed loop on order tables of a reducer."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from rverror.base.arrays import Array
from rverror.base.chance import student
from rverror.base.errors import InputError
from rverror.base.progress import Progress
from rverror.diagnosis.causes import Named
from rverror.diagnosis.gears.account import elastic_within, estimated
from rverror.diagnosis.gears.fit import Fit, evaluated, fitted
from rverror.diagnosis.gears.reducers import curved, marks_are_free, offered, with_marks
from rverror.diagnosis.gears.score import Hypothesis
from rverror.diagnosis.gears.search import Search
from rverror.diagnosis.gears.spectrum import leading
from rverror.diagnosis.journal import Journal
from rverror.diagnosis.order_passport import passport
from rverror.diagnosis.orders.critical_conditions import critical_notes
from rverror.diagnosis.orders.order_search import Linear, chance, conditions_of, described, rivals, searched
from rverror.diagnosis.orders.resonances import resonances_of, resonant_parts, slowest, without
from rverror.diagnosis.orders.table_set import TableSet, joined, noise_of_cases, table_set
from rverror.diagnosis.policy import POLICY, Policy
from rverror.diagnosis.result import Addition, Diagnosis, ElasticEstimate, Line, OrderShare, Residual
from rverror.diagnosis.size_prior import WORKSHOP, SizePrior
from rverror.geartrain.mechanism import Reducer
from rverror.geartrain.source import Source
from rverror.model.catalogue import source
from rverror.model.effects import Model
from rverror.model.empirical import LAWS, tells_directions
from rverror.runs.order_table import OrderCase, OrderTable, Waves
from rverror.runs.spectrum import frames_of_order

_LOADS = 5  # of each direction on which causes are looked for; all are fitted in the end.  Chosen for time
_POINTS = 2048  # angles at which a residual's peaks are looked for


def diagnose_tables(
    declared: Model, tables: Sequence[OrderTable], tell: Progress, *,
    policy: Policy = POLICY, prior: SizePrior = WORKSHOP,
) -> Diagnosis:  # fmt: skip
    """Find what the model of a reducer lacks in order tables.

    Parameters
    ----------
    declared : Model
        Of a `Reducer`.
    tables : sequence of OrderTable
    tell : callable
        Called with a line of text as the work goes on.
    policy : Policy
    prior : SizePrior

    Raises
    ------
    InputError
        If a table cannot be used; the message says why.
    """
    given, policy = policy, replace(policy, regular=1e12)  # each order has its own size: none is of one not known
    measured = joined(tables)
    notes = [f"{table.path}: {note}" if table.path else note for table in tables for note in table.notes]
    unit = curved(declared.mechanism)
    model, anywhere = with_marks(replace(declared, mechanism=unit), tables)
    _check(model, measured)
    resonances = resonances_of(measured, ratio=unit.ratio, policy=policy)
    resonant, unsure = resonant_parts(measured, resonances)
    cases = without(measured, resonant)
    own_noise, said = noise_of_cases(cases, floor=policy.model_error)
    noise = [np.hypot(*both) for both in zip(own_noise, unsure, strict=True)]
    notes += said + _conditions(cases) + critical_notes(declared, cases, resonances)
    journal = Journal(tell)
    tell(f"predicting the declared model under {len(cases)} conditions")
    some = _some_of(cases)
    made = partial(table_set, unit, policy=policy, anywhere=anywhere, prior=prior)
    plain = made(cases, noise)
    wide = plain.with_discrepancy(policy.line_share)
    run_set = made([cases[n] for n in some], [wide.sigmas[n] for n in some])
    first = evaluated(run_set, model, model)
    root = fitted(first, steps=6)
    candidates = candidates_of(model, run_set, policy)
    notes += run_set.prior.notes(candidates)
    found = searched(root, candidates, journal)
    # what changes with the speed alone is in no model, so no set of causes leaves noise
    one_speed = len({case.condition.input_speed for case in cases}) == 1
    complete = _complete_set(root, found, candidates, given, journal) if one_speed else None
    if complete is not None:
        found = evaluated(run_set, complete[1].fit.model, model, complete[1].fit.waves)
    tell("refitting everything under all conditions")
    whole = evaluated(wide, found.model, model)
    scattered = replace(wide, sigmas=tuple(widened(whole)))
    causes = fitted(evaluated(scattered, found.model, model, whole.waves), steps=8, enough=1.0)
    tell("describing what no cause accounts for")
    laws = described(evaluated(plain, causes.model, model, causes.waves), laws_of(model, plain), journal)
    result = causes.model.with_effects(*laws.effects())
    final = evaluated(plain, result, model, causes.waves)
    as_printed = evaluated(plain, replace(model, effects=final.printed), model)
    refitted = evaluated(plain, root.model, model)
    tell("looking for what does as well")
    named = len(causes.added)
    alike = [complete[0].as_good(complete[1], n) if complete else rivals(found, n, candidates) for n in range(named)]
    origin = "found by rverror diagnose in " + ", ".join(table.path or "a table" for table in tables)
    after = _residual(final, _left_by_laws(causes, laws))
    added = tuple(_claim(causes, found, n, alike[n], origin, after) for n in range(named))
    added += tuple(_law(laws, n, origin, after) for n in range(len(laws.blocks)))
    lines = _lines(final, named)
    if marks_are_free(model):
        notes.append(
            "index unknown: where the gear's marks stand was fitted with everything else; the zero is one for all"
        )
    elastic = elastic_within(causes, [_reach(causes, float(v)) for v in np.diag(causes.covariance)])
    notes += _strained_stiffness(causes, elastic)
    if lines and named:
        notes.append(
            "a cause that is named here is a claim, since more than noise is left: each claim states the probability "
            "that as many meaningless parameters remove as much"
        )
    result = replace(result, effects=(*result.effects[: len(model.effects)], *(one.effect for one in added)))
    return Diagnosis(
        verdict="unexplained" if lines else "explained" if named else "nothing_missing",
        noise_rms=_rms_of(own_noise),
        before=_residual(as_printed, as_printed.residual, resonant),
        before_refitted=_residual(refitted, left_out(Linear(refitted)), resonant),
        after=after,
        added=added,
        unexplained=lines,
        model=result,
        declared=declared,
        candidates=(),
        tried=len(candidates),
        traces=(),
        notes=tuple(dict.fromkeys(notes)),
        history=tuple(journal.fates),
        elastic=elastic,
        passport=passport(measured, ratio=unit.ratio),
        shares=_shares(final),
        resonances=resonances,
    )


def _complete_set(
    root: Fit, claims: Fit, candidates: Sequence[Named], policy: Policy, journal: Journal
) -> tuple[Search, Hypothesis] | None:
    """A set of causes that leaves nothing but noise, and the search with its rivals; none where there is none.

    Claims are made one after another, so of two causes that make the same orders the first is often what resembles
    both, and the next makes up for it.  Where claims come near the noise, whole sets are compared as they are for runs,
    under the policy of runs: what is not explained yet is of any size.
    """
    if claims.data > policy.near_claims * claims.bound:
        return None
    run_set = replace(root.run_set, policy=policy)
    first, then = (fitted(evaluated(run_set, fit.model, fit.declared, fit.waves)) for fit in (root, claims))
    search = Search(first, candidates, policy, journal)
    best, done = search.best(*([search.score.of(then)] if claims.added else []))
    return (search, best) if done else None


def _check(model: Model, cases: Sequence[OrderCase]) -> None:
    for item in model.effects:
        needs = source(item.key).needs
        if "time" in needs:
            raise InputError(f"{item.key} needs the time of samples, which an order table has not; remove the effect")
        if "torque" in needs and any(case.condition.torque is None for case in cases):
            raise InputError(f"{item.key} needs output_torque[N*m] under every condition; add it or remove the effect")


def _conditions(cases: Sequence[OrderCase]) -> list[str]:
    """What the conditions do not tell."""
    at = [case.condition for case in cases]
    torques = {c.torque for c in at}
    notes = []
    if len({c.direction for c in at}) == 1:
        notes.append("one direction only: causes that share an order cannot be told apart; add the other direction")
    if None in torques:
        notes.append("no output_torque: predicted by the closed form (rigid, all loaded pins in contact)")
    elif len(torques) == 1:
        notes.append("one load only: compliance and rigid part errors cannot be told apart; add loads")
    if len({c.input_speed for c in at}) > 1:
        notes.append(
            "conditions differ in speed, which the model does not know: what the natural frequencies add is taken off "
            "the waves as far as their laws tell it; near others an order is larger than any load makes it"
        )
    if len({c.temperature for c in at}) > 1:
        notes.append("conditions differ in temperature, which the model knows as thermal.growth only")
    return notes


def _some_of(cases: Sequence[OrderCase]) -> list[int]:
    """The slowest conditions of a few loads of each direction, evenly from the smallest to the largest."""
    loads = sorted({case.condition.torque or 0.0 for case in cases})
    if len(loads) > _LOADS:
        loads = [load for load in loads if load > 0]
        loads = [loads[round(at)] for at in np.linspace(0, len(loads) - 1, _LOADS)]
    return [n for n in slowest(cases) if (cases[n].condition.torque or 0.0) in loads]


def candidates_of(model: Model, run_set: TableSet, policy: Policy) -> tuple[Named, ...]:
    """Sources of the catalogue that a table can show and the model does not have.

    Some only where there are several loads to tell them by.
    """
    several = len({record.torque for record in run_set.records}) > 1

    def wanted(entry: Source) -> bool:
        in_table = entry.in_tables and (several or "torque" not in entry.needs)
        return entry.periodic and policy.allows(entry) and (entry.tried if entry.in_tables is None else bool(in_table))

    return offered(model, run_set.records, wanted)


def laws_of(model: Model, run_set: TableSet) -> tuple[Named, ...]:
    """Laws over load and direction by which every whole order of a table can be described."""
    unit = model.mechanism
    assert isinstance(unit, Reducer)
    both = len({case.condition.direction for case in run_set.cases}) > 1
    loaded = len({record.torque for record in run_set.records if record.torque}) > 1
    return tuple(
        (law.key, {**indices, "harmonic": round(order)})
        for order in run_set.orders.tolist()
        if order.is_integer()  # they are told to six digits
        for law in LAWS
        if loaded or "torque" not in law.needs
        for indices in law.candidates(unit)
        if indices["frame"] == "output" and (both or not tells_directions(law, indices))
    )


def _strained_stiffness(fit: Fit, elastic: Sequence[ElasticEstimate]) -> list[str]:
    """Stiffnesses farther from where they were declared than is known of them: they make up for what is missing."""
    known = fit.run_set.gears.stiffness_uncertainty
    return [
        f"{one.name} moved by {abs(math.log(one.value / one.declared)) / spread:.1f} of its uncertainty: it makes up "
        "for what no cause explains, and is not measured by it"
        for one in elastic
        if one.dimension == "stiffness" and (spread := getattr(known, one.name))
        if abs(math.log(one.value / one.declared)) > fit.run_set.policy.most_strain * spread
    ]


def widened(fit: Fit) -> list[Array]:
    """Standard deviations by which each order is as far off as a fit leaves it.

    What causes leave is of no size that is known before.  Taken for noise of the size that was allowed for, it would
    drive declared sizes and stiffness to many times their uncertainty to make up for it.
    """
    run_set = conditions_of(fit)
    more = np.sqrt(np.maximum(Linear(fit).squares / run_set.values[0], 1.0))
    return [sigma * more[at] for sigma, at in zip(run_set.sigmas, run_set.places, strict=True)]


# --- sizes ------------------------------------------------------------------------------------------------------------


def _rms_of(rests: Sequence[Array]) -> float:
    """Root of the mean over conditions of half the sum of squared amplitudes."""
    return math.sqrt(float(np.mean([0.5 * float(rest @ rest) for rest in rests])))


def _residual(fit: Fit, left: Sequence[Array], unknown: Sequence[Waves] = ()) -> Residual:
    """Sizes of what is left; of a model that does not know what was taken off the waves, with that."""
    run_set = conditions_of(fit)
    more = [np.concatenate([part.real, part.imag]) for part in unknown] or [np.zeros_like(rest) for rest in left]
    rests, held = ([a + b for a, b in zip(one, more, strict=True)] for one in (fit.residual, left))
    return Residual(_rms_of(rests), _peaks(run_set, rests), _rms_of(held))


def _peaks(run_set: TableSet, rests: Sequence[Array]) -> float:
    """Largest peak-to-peak of the waves of a condition, over a turn."""
    theta = 2 * math.pi * np.arange(_POINTS) / _POINTS
    spans = []
    for case, rest in zip(run_set.cases, rests, strict=True):
        count = case.orders.size
        waves = rest[:count] + 1j * rest[count:]
        spans.append(float(np.ptp((waves @ np.exp(1j * np.outer(case.orders, theta))).real)))
    return max(spans)


def left_out(state: Linear) -> list[Array]:
    """Residual of each condition with sizes from the others: every third load is left out in its turn."""
    return [rest * sigma for rest, sigma in zip(state.left_out, state.run_set.sigmas, strict=True)]


def _left_by_laws(causes: Fit, laws: Linear) -> list[Array]:
    """Residual of each condition with the sizes of causes and laws from the others.

    What a cause without some loads predicts otherwise moves the laws of these loads no less: both are added up.
    """
    own = zip(left_out(laws), left_out(Linear(causes)), causes.residual, strict=True)
    return [left + (cause - rest) for left, cause, rest in own]


def _reach(fit: Fit, variance: float) -> float:
    """Half width of an interval; what is left counts as noise of its size already."""
    run_set = conditions_of(fit)
    free = int(fit.free.sum())
    spare = max(float(run_set.values[1].sum()) - free, 4.0)
    return math.sqrt(variance) * student((1 - run_set.policy.confidence) / 2, spare)


def _claim(fit: Fit, few: Fit, number: int, alike: Sequence[Named], origin: str, after: Residual) -> Addition:
    """A cause, with its rivals and with what chance does as much; from the loads on which it was looked for."""
    effect = fit.added[number]
    variances = np.diag(fit.covariance)[fit.places(number)].tolist()
    estimates, notes = estimated(effect, [_reach(fit, variance) for variance in variances])
    order, share, odds = chance(few, number)
    notes.append(
        f"removes {100 * share:.0f} % of what is left of order {order:g} without it; the probability that as many "
        f"meaningless parameters remove as much is {100 * odds:.2g} %"
    )
    orders = _orders(fit, number)
    return Addition(replace(effect, origin=origin), estimates, tuple(alike), orders, after.heldout_rms, tuple(notes))


def _law(laws: Linear, number: int, origin: str, after: Residual) -> Addition:
    """A law that describes an order."""
    effect = replace(laws.effects()[number], origin=origin)
    (at,) = np.flatnonzero(laws.run_set.orders == effect.indices["harmonic"])
    numbers = float(laws.run_set.values[0][at])
    # a law that does not hold leaves more than noise of its order
    more = max(1.0, float(laws.squares[at]) / numbers)
    size = student((1 - laws.run_set.policy.confidence) / 2, max(numbers - 2 * len(LAWS), 4.0))
    variances = np.diag(laws.covariance)[laws.places(number)]
    halves = [size * math.sqrt(more * variance) for variance in variances.tolist()]
    estimates, _ = estimated(effect, halves)
    orders = source(effect.key).orders(laws.run_set.unit, effect.indices)
    notes = ("describes an order and explains nothing: no part is behind it",)
    return Addition(effect, estimates, (), orders, after.heldout_rms, notes)


def _orders(fit: Fit, number: int) -> tuple[float, ...]:
    """Orders at which an effect acts, the strongest first."""
    run_set = conditions_of(fit)
    power = run_set.by_order(part**2 for part in fit.added_linearly[number])
    return leading(run_set.orders, np.sqrt(power), math.sqrt(power.max()))


def _lines(fit: Fit, named: int) -> tuple[Line, ...]:
    """Orders of which more than noise is left beside the named causes: what laws describe is not explained."""
    run_set = conditions_of(fit)
    laws = fit.added_linearly[named:]
    rests = [rest + sum((law[n] for law in laws), np.zeros_like(rest)) for n, rest in enumerate(fit.residual)]
    squares = run_set.by_order((rest / s) ** 2 for rest, s in zip(rests, run_set.sigmas, strict=True))
    cases = run_set.values[0] / 2
    size = np.sqrt(run_set.by_order(rest**2 for rest in rests) / cases)
    deviation = np.sqrt(run_set.by_order(sigma**2 for sigma in run_set.sigmas) / 2) / cases  # of a mean of all
    result = []
    for n in np.flatnonzero((squares > run_set.most_of_noise) & (size > run_set.policy.least_line)).tolist():
        order, mean = float(run_set.orders[n]), float(size[n])
        half = student((1 - run_set.policy.confidence) / 2, max(float(cases[n]) - 1, 1.0)) * float(deviation[n])
        frames = frames_of_order(run_set.unit, order, tolerance=run_set.policy.order_tolerance)
        result.append(Line(order, mean, max(mean - half, 0.0), mean + half, tuple(frames)))
    return tuple(sorted(result, key=lambda line: -line.amplitude))


def _kind(entry: Source) -> str:
    """What kind of cause a source is: a field of `OrderShare`."""
    if not entry.is_cause:
        return "empirical"
    if entry.acts == "reading":
        return "measuring_chain"
    soft = any(parameter.dimension in ("compliance", "contact_compliance") for parameter in entry.parameters)
    return "compliance" if soft else "parts"


def _shares(fit: Fit) -> tuple[OrderShare, ...]:
    """Of each order, what share of its power each kind of cause accounts for; the shares of an order make one.

    They are not numbers where no more than noise is measured.
    """
    run_set = conditions_of(fit)
    measured = [observation.measured for observation in run_set.observations]

    def along(parts: Sequence[Array]) -> Array:
        return run_set.by_order(one * part for one, part in zip(measured, parts, strict=True))

    total, cases = along(measured), run_set.values[0] / 2
    kinds = ("parts", "compliance", "measuring_chain", "empirical")
    taken = {kind: np.zeros(run_set.orders.size) for kind in kinds} | {"left": along(fit.residual)}
    for effect, part in zip(fit.added, fit.added_linearly, strict=True):
        taken[_kind(source(effect.key))] += along(part)
    taken["parts"] += total - sum(taken.values())  # declared, and what is not linear
    power = np.where(Linear(fit).measured > run_set.most_of_noise, total, math.nan)
    return tuple(
        OrderShare(
            order=float(order),
            amplitude=math.sqrt(total[n] / cases[n]),
            **{kind: float(share[n] / power[n]) for kind, share in taken.items()},
        )
        for n, order in enumerate(run_set.orders)
    )


def left_of_table(model: Model, table: OrderTable) -> tuple[float, Array, Array]:
    """What a model leaves of a table as it stands: rms of all, the orders, and the rms of each, rad.

    Parameters
    ----------
    model : Model
    table : OrderTable
    """
    assert isinstance(model.mechanism, Reducer)
    white = [np.ones(2 * case.orders.size) for case in table.cases]
    run_set = table_set(model.mechanism, table.cases, white, policy=POLICY, anywhere=False)
    rests = evaluated(run_set, model, model).residual
    power = run_set.by_order(0.5 * rest**2 for rest in rests) / len(rests)
    return _rms_of(rests), run_set.orders, np.sqrt(power)
