"""A diagnosis for people and for programs."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from rverror.base.arrays import Array
from rverror.base.numbers import brief, count_of, way
from rverror.base.text import describe
from rverror.diagnosis.next_run import Coverage, Measurement, folds, to_place, to_separate
from rverror.diagnosis.result import Addition, Diagnosis, Line
from rverror.geartrain.mechanism import Drive, Mechanism
from rverror.geartrain.source import IndexValue
from rverror.model.catalogue import CATALOGUE
from rverror.runs.measuring_chain import BenchUncertainty, uncertainty_of
from rverror.runs.spectrum import frames_of_order
from rverror.views.bench_report import BESIDE, bench_json, budget_of, of_figures, of_orders, order_json
from rverror.views.blocks import Sentence, Sheet, some_of
from rverror.views.by_order import turns_of
from rverror.views.describing import content, content_of, described, sheet, sheet_of, table
from rverror.views.fields import COUNT, OWN, OWN_NAME, Field, about, arrays, entry, rows, same_unit, value_at
from rverror.views.model_report import name_of, sizes_of
from rverror.views.order_report import alone, kinds_of_causes, passport_json, passports, resonances, resonances_json
from rverror.views.shown_units import ANGLE, NUMBER, PERCENT, POSITION, TORQUE, Unit, unit_of
from rverror.views.variables import Table, Variable

_STAGES = {"before": "as declared", "before_refitted": "declared sizes refitted", "after": "with what was added"}
_RESIDUAL = ("rms", "peak_to_peak", "heldout_rms")
_SAMPLES = {
    **{name: name for name in ("theta", "measured", "before", "after")},
    **{"residual_before": "residual.0", "residual_after": "residual.1"},
}
_PARTS = ("housing", "carrier", "disc", "crank", "planet", "sun", "output")  # frames that are parts


_SUFFIXES = {"angle": "arcsec", "torque": "newton_metre"}  # of keys in JSON of what was measured


def _measured(quantity: str, thing: Any, *names: str, **places: str) -> dict[str, Any]:
    """Entries of sizes of what was measured, by their names or under others."""
    where, unit = {name: name for name in names} | places, unit_of(quantity)
    return entry(thing, **{f"{name}_{_SUFFIXES[quantity]}": (place, unit) for name, place in where.items()})


def stated_bench(diagnosis: Diagnosis) -> BenchUncertainty | None:
    """What the model says of the encoders, as uncertainty of an angle; a torque is not read by them."""
    if diagnosis.quantity != "angle":
        return None
    return uncertainty_of(diagnosis.declared.encoders, diagnosis.declared.mechanism.ratio)


# --- orders and their sampling ----------------------------------------------------------------------------------------


def samples_per_turn(diagnosis: Diagnosis) -> float:
    """Samples an output turn of the coarsest run; infinite where traces do not keep it, as those of a drive."""
    if isinstance(diagnosis.declared.mechanism, Drive) or not diagnosis.traces:
        return math.inf
    return min(float(trace.theta.size / turns_of(trace.theta)) for trace in diagnosis.traces)


def sideband_frames(mechanism: Mechanism, order: float) -> tuple[str, ...]:
    """Frames of which an order that fits none is a sideband, once or twice an output turn away.

    Parameters
    ----------
    mechanism : Reducer or Drive
    order : float
        Per output turn.

    Returns
    -------
    tuple of str
        Empty where the order fits a frame itself, or where there is none beside it.

    Examples
    --------
    >>> from rverror import reducer
    >>> [sideband_frames(reducer("RV-40E"), order) for order in (77, 78, 36)]
    [('1 below housing 39 x 2',), (), ()]
    """
    if frames_of_order(mechanism, order):
        return ()
    for away in (-1, 1, -2, 2):
        near = [f for f in frames_of_order(mechanism, order - away) if order - away > 2.5]
        if near:
            return (f"{abs(away)} {'above' if away > 0 else 'below'} {near[0]}",)
    return ()


# --- what to measure next ---------------------------------------------------------------------------------------------


def coverage_of(diagnosis: Diagnosis) -> Coverage:
    """What the runs of a diagnosis cover."""
    torques = {torque for trace in diagnosis.traces if (torque := trace.torque) is not None}
    longest = max(diagnosis.traces, key=lambda trace: turns_of(trace.theta), default=None)
    part = longest.theta if longest is not None and turns_of(longest.theta) < 1 else None
    return Coverage(
        directions=frozenset(1.0 if trace.direction > 0 else -1.0 for trace in diagnosis.traces) or frozenset({1.0}),
        samples_per_turn=samples_per_turn(diagnosis),
        torques=frozenset(torques),
        marks=all(trace.index != "unknown" for trace in diagnosis.traces),
        shared_zero=any(
            one.index == other.index not in ("", "unknown") and one.direction != other.direction
            for one in diagnosis.traces
            for other in diagnosis.traces
        ),
        travel=None if part is None else (float(part[0]), float(2 * part[-1] - part[-2])),
    )


def next_steps(diagnosis: Diagnosis) -> list[tuple[Addition | None, Measurement]]:
    """What to measure next, with the addition that each measurement is about; of runs: a table's passport says more."""
    if diagnosis.shares:
        return []
    coverage, unit = coverage_of(diagnosis), diagnosis.declared.mechanism
    found: list[tuple[Addition | None, Measurement]] = []
    for addition in diagnosis.added:
        keys = (addition.effect.key, *(key for key, _ in addition.indistinguishable))
        if all(key in CATALOGUE and CATALOGUE[key].is_cause for key in keys):
            steps = to_separate(unit, addition.effect, addition.indistinguishable, coverage)
            found += [(addition, step) for step in steps]
    steps = to_place(unit, [line.order for line in diagnosis.unexplained], coverage)
    reading = diagnosis.quantity == "angle"
    return found + [(None, step) for step in steps if reading or step.name != "encoder"]


# --- table ------------------------------------------------------------------------------------------------------------


@described.register
def diagnosis_table(result: Diagnosis) -> Table:
    """What a diagnosis tells: verdict, sizes, rivals, what to measure next, and the numbers behind it."""
    signal, bench, unit = unit_of(result.quantity), stated_bench(result), result.declared.mechanism
    of_rms: dict[str, Field] = {} if bench is None else {"bench_uncertainty": (lambda _: bench.of("rms"), ANGLE)}
    shares = same_unit(PERCENT, "parts", "compliance", "measuring_chain", "empirical", "left")
    variables = {
        **_added(result, signal),
        **rows("stage", _stages(result, bench), stage="0", **same_unit(signal, *_RESIDUAL, within="1.")),
        **arrays("", result, noise_rms=signal),
        **rows(
            "unexplained",
            result.unexplained,
            "unexplained_",
            order=NUMBER,
            **same_unit(signal, "amplitude", "low", "high", "cos", "sin"),
            **of_orders(bench),
            frames=lambda one: one.frames or sideband_frames(unit, one.order),
            alias_of=lambda one: _folds(one, result),
        ),
        **rows("unseen", result.validation, "unseen_", file=None, before=signal, after=signal, **of_rms),
        **rows("share", result.shares, "share_", order=NUMBER, amplitude=signal, **shares),
        **rows("candidate", result.candidates, "candidate_", key=None, indices=None, heldout_gain=NUMBER),
        **rows(
            "elastic",
            result.elastic,
            "elastic_",
            ("elastic_unit", "dimension"),
            name=None,
            **same_unit(OWN, "declared", "value", "low", "high"),
            determined=None,
        ),
        **passports(result.passport, bench),
        **resonances(result.resonances),
        **_declared(result),
        **_traces(result, signal),
        **_angles_of(result, "set_aside", "set_aside"),
        **_angles_of(result, "slip", "slips"),
        **budget_of(bench),
    }
    about_it = {"model": name_of(result.declared), "candidates_tried": result.tried}
    about_it |= about(result, "verdict", "quantity", "notes")
    named = (describe(one.effect.key, one.effect.indices) for one in result.added)
    causes = [one for one in result.added if _is_cause(one)]
    return Table(
        variables,
        about_it,
        title=(name_of(result.declared), result.verdict.replace("_", " "), *named),
        verdict=_verdict(result),
        sentences=(*(said for one in causes for said in _about(one, result)), *_steps(result)),
        remarks=_remarks(result, bench),
        shown={
            "added": ("effect", "parameter", "value", "interval", "unit"),
            "unexplained": ("order", "amplitude", "interval", "bench_uncertainty", "frames", "alias_of"),
            **({} if _tells_loads(result) else {"passport": (), "law": ()}),
            **dict.fromkeys(("", "candidate", "set_aside", "slip"), ()),
        },
    )


def _stages(result: Diagnosis, bench: BenchUncertainty | None) -> list[tuple[str, Any]]:
    """Residuals and noise, and what the bench leaves uncertain of them."""
    found: list[tuple[str, Any]] = [(words, getattr(result, stage)) for stage, words in _STAGES.items()]
    found = [*(found if result.added else found[:-1]), ("noise", {"rms": result.noise_rms})]
    if bench is not None:
        peak = math.nan if result.shares else bench.of("peak_to_peak")
        sizes = {"rms": bench.of("rms"), "peak_to_peak": peak, "heldout_rms": bench.of("rms")}
        found.append((f"± {BESIDE}", sizes))
    return found


def _added(result: Diagnosis, signal: Unit) -> dict[str, Variable]:
    each = [(at, added, size) for at, added in enumerate(result.added) for size in added.estimates]
    return rows(
        "added",
        each,
        "added_",
        ("added_unit", "2.dimension"),
        effect=lambda row: describe(row[1].effect.key, row[1].effect.indices),
        number=("0", COUNT),
        key="1.effect.key",
        indices="1.effect.indices",
        parameter="2.name",
        **same_unit(OWN, "value", "low", "high", within="2."),
        orders="1.orders",
        heldout_rms=("1.heldout_rms", signal),
        indistinguishable_from=lambda row: "; ".join(describe(*one) for one in row[1].indistinguishable),
        notes="1.notes",
    )


def _declared(result: Diagnosis) -> dict[str, Variable]:
    """Declared sizes, and what the fit made of them: its model has them first."""
    declared, fitted = sizes_of(result.declared.effects), sizes_of(result.model.effects)
    return rows(
        "declared",
        [(*size, refitted) for size, (*_, refitted) in zip(declared, fitted, strict=False)],
        "declared_",
        ("declared_unit", "2.dimension"),
        effect=lambda row: describe(row[1].key, row[1].indices),
        parameter="2.name",
        value=("3", OWN),
        sigma=("1.uncertainty", OWN),
        refitted=("4", OWN),
    )


def _angles_of(result: Diagnosis, dim: str, name: str) -> dict[str, Variable]:
    """Angles, as travelled, at which something is marked in the runs, with the number of the run."""
    marked = [
        (at, angle)
        for at, trace in enumerate(result.traces)
        if (found := getattr(trace, name)) is not None
        for angle in found.tolist()
    ]
    return rows(dim, marked, f"{dim}_", run=("0", COUNT), theta=("1", POSITION))


def _traces(result: Diagnosis, signal: Unit) -> dict[str, Variable]:
    """Waveforms of all runs one after another, for each has angles of its own."""
    traces, sampled = result.traces, math.isfinite(samples_per_turn(result))
    joined: dict[str, Array] = {
        name: np.concatenate([np.zeros(0), *(value_at(trace, place) for trace in traces)])
        for name, place in _SAMPLES.items()
    }
    number = np.repeat(np.arange(len(traces)), np.array([trace.theta.size for trace in traces], dtype=int))
    return {
        **rows(
            "run",
            traces,
            "run_",
            name=None,
            direction=lambda one: way(one.direction),
            torque=TORQUE,
            index=None,
            samples_per_turn=(lambda one: one.theta.size / turns_of(one.theta) if sampled else None, NUMBER),
        ),
        **arrays("sample", number, "sample_", run=("", NUMBER)),
        **arrays("sample", joined, "sample_", **(same_unit(signal, *joined) | {"theta": POSITION})),
    }


def _folds(line: Line, diagnosis: Diagnosis) -> str:
    """Orders above half of the sampling that would show where a line is."""
    sampling = samples_per_turn(diagnosis)
    if math.isinf(sampling):
        return ""  # the sampling is not kept
    found = [fold for fold in folds(diagnosis.declared.mechanism, line.order, sampling) if fold.frames]
    return ", ".join(f"{brief(fold.order)} ({'; '.join(fold.frames)})" for fold in found)


# --- for programs -----------------------------------------------------------------------------------------------------


@content.register
def diagnosis_content(diagnosis: Diagnosis) -> dict[str, Any]:
    """Diagnosis as plain data, as `to_json` tells it, but for files and version.

    Sizes in arcsec and um; numbers that are not determined are None.  Keys of a torque ripple end in ``newton_metre``
    instead of ``arcsec``.
    """
    quantity, signal, bench = diagnosis.quantity, unit_of(diagnosis.quantity), stated_bench(diagnosis)
    own = content_of(table(diagnosis))
    variables = {name: of for name, of in own["variables"].items() if of["dimensions"] != ["sample"]}
    sizes = same_unit(OWN, "declared", "value", "low", "high")
    return {
        **own,
        "variables": variables,
        "notes": list(diagnosis.notes),
        **_measured(quantity, diagnosis, "noise_rms"),
        **{stage: _measured(quantity, getattr(diagnosis, stage), *_RESIDUAL) for stage in _STAGES},
        "bench_uncertainty": bench_json(bench, whole=not diagnosis.shares),
        "added": added_json(diagnosis),
        "unexplained_orders": [
            {
                **entry(one, order=NUMBER, low=signal, high=signal, frames=None),
                **_measured(quantity, one, "amplitude"),
                **order_json(bench, one.order),
            }
            for one in diagnosis.unexplained
        ],
        "next_measurements": [
            {
                **entry(step, name=None, what=None, why=None),
                "about": _cause(addition.effect.key, addition.effect.indices) if addition else None,
                "separates": [_cause(*cause) for cause in step.separates],
            }
            for addition, step in next_steps(diagnosis)
        ],
        "stiffness": [
            {**entry(one, one.dimension, name=None, unit=OWN_NAME, **sizes), "determined": bool(one.determined)}
            for one in diagnosis.elastic
        ],
        "passport": passport_json(diagnosis.passport, bench=bench),
        "resonances": resonances_json(diagnosis.resonances),
        "validation": validation_json(diagnosis.validation, quantity),
        "unit": signal.shown,
        "suffix": _SUFFIXES[quantity],
    }


def validation_json(found: Iterable[Any], quantity: str) -> list[dict[str, Any]]:
    """Entries of files that no fit saw."""
    stages = ("before", "after")
    return [{"file": one.file, **{stage: _measured(quantity, one, rms=stage) for stage in stages}} for one in found]


def _cause(key: str, indices: Mapping[str, IndexValue]) -> dict[str, Any]:
    return {"key": key, "indices": dict(indices)}


def added_json(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """Entries of what was added."""
    sizes: dict[str, Field] = {"value": OWN, "unit": OWN_NAME, "low": OWN, "high": OWN}
    return [
        {
            **_cause(addition.effect.key, addition.effect.indices),
            "parameters": {one.name: entry(one, one.dimension, **sizes) for one in addition.estimates},
            "indistinguishable_from": [_cause(*cause) for cause in addition.indistinguishable],
            **entry(addition, orders=NUMBER, notes=None),
            **_measured(diagnosis.quantity, addition, "heldout_rms"),
        }
        for addition in diagnosis.added
    ]


# --- for people -------------------------------------------------------------------------------------------------------


@sheet.register
def diagnosis_sheet(diagnosis: Diagnosis) -> Sheet:
    """Diagnosis as a report, its name alone above the verdict, which says the rest."""
    return sheet_of(replace(table(diagnosis), title=(name_of(diagnosis.declared),)))


def _remarks(diagnosis: Diagnosis, bench: BenchUncertainty | None) -> dict[str, Sequence[str]]:
    """Sentences below the tables."""
    own = "A source of your own is one function and one entry of the catalogue: see docs/adding-an-effect.md."
    unknown = ", ".join(one.name for one in diagnosis.elastic if not one.determined)
    return {
        "stage": [_credit(diagnosis)],
        "unexplained": [own] if diagnosis.unexplained else [],
        "law": kinds_of_causes(diagnosis.passport) if _tells_loads(diagnosis) else [],
        "peak": [alone(diagnosis.resonances)],
        "elastic": [f"These runs do not determine {unknown}."] if unknown else [],
        "bench": [] if bench is None else [of_figures(bench, whole=not diagnosis.shares)],
    }


def _tells_loads(diagnosis: Diagnosis) -> bool:
    """Tell whether a passport says more than one size of each order: of a table, or of runs at three loads."""
    return bool(diagnosis.shares) or any(law.slope is not None for one in diagnosis.passport for law in one.laws)


def _is_cause(addition: Addition) -> bool:
    """Tell whether an addition is more than a law; a source of one's own is, while the catalogue does not hold it."""
    entry = CATALOGUE.get(addition.effect.key)
    return entry is None or entry.is_cause


def _verdict(diagnosis: Diagnosis) -> tuple[str, str]:
    """The outcome in one or two sentences."""
    unit, bench = unit_of(diagnosis.quantity), stated_bench(diagnosis)
    before, after, noise = (
        brief(size / unit.size, 3)
        for size in (diagnosis.before.heldout_rms, diagnosis.after.heldout_rms, diagnosis.noise_rms)
    )
    spread = f" ± {brief(bench.of('rms') / unit.size, 3)} ({BESIDE})" if bench else ""
    fall = f"The held-out rms falls from {before} to {after}{spread} {unit.shown}; the noise is {noise} {unit.shown}."
    causes = [added for added in diagnosis.added if _is_cause(added)]
    names = ", ".join(
        describe(added.effect.key, added.effect.indices) + _or_rivals(added.indistinguishable) for added in causes
    )
    orders = ", ".join(f"{line.order:g}" for line in diagnosis.unexplained[:6])
    laws = len(diagnosis.added) - len(causes)
    words = {
        "explained": ("Explained", f"the model lacks {names}, and nothing else that is significant."),
        "nothing_missing": ("Nothing missing", "the declared model accounts for all that is significant."),
        "unexplained": (
            "Unexplained",
            (f"the model lacks {names}, but " if names else "")
            + f"no source of the catalogue accounts for {'orders' if ',' in orders else 'order'} {orders}."
            + (f" {count_of(laws, 'law')} only {'describes' if laws == 1 else 'describe'} orders." if laws else ""),
        ),
    }
    strong, rest = words[diagnosis.verdict]
    return strong, f": {rest} {fall}"


def _or_rivals(others: Sequence[tuple[str, Mapping[str, IndexValue]]]) -> str:
    if len(others) == 1:
        return f" or {describe(*others[0])}"
    return f" (or one of {len(others)} rivals)" if others else ""


def _credit(diagnosis: Diagnosis) -> str:
    """How much of the fall is due to what was added, where refitting declared sizes did a part of it."""
    before, refitted, after = (
        one.heldout_rms**2 for one in (diagnosis.before, diagnosis.before_refitted, diagnosis.after)
    )
    if not diagnosis.added or not before > after:
        return ""
    share = min(max((refitted - after) / (before - after), 0.0), 1.0)
    if share > 0.95:
        return ""
    if share < 0.05:
        return (
            "Refitting the declared sizes within their uncertainty makes most of the fall; what was added takes off "
            "the rest, which noise does not explain."
        )
    return (
        f"Of the fall in mean square, {100 * share:.0f} % is due to what was added, the rest to refitting the "
        "declared sizes within their uncertainty."
    )


def _about(one: Addition, diagnosis: Diagnosis) -> Iterator[str]:
    """What a cause is, where it shows, what cannot be told from it."""
    known, indices = CATALOGUE.get(one.effect.key), one.effect.indices
    name, orders = describe(one.effect.key, indices), ", ".join(brief(order) for order in one.orders)
    summary, frame = (known.summary, known.frame) if known else ("a source of your own", "")
    fixed = f", fixed in the {frame}" if frame in _PARTS and not isinstance(diagnosis.declared.mechanism, Drive) else ""
    shows = f"shows at {'orders' if ',' in orders else 'order'} {orders}" if orders else "shows at no order"
    yield f"{name}: {summary}{fixed}; it {shows}."
    if one.indistinguishable:
        yield f"These runs cannot tell {name} from {some_of([describe(*other) for other in one.indistinguishable])}."
    yield from (f"{name}: {note}." for note in one.notes)


def _steps(diagnosis: Diagnosis) -> Iterator[Sentence]:
    """What to measure next, once for all causes that a measurement tells apart."""
    tells: dict[str, list[str]] = {}
    for addition, step in next_steps(diagnosis):
        pairs = tells.setdefault(step.what + (f": {step.why}" if step.why else ""), [])
        if addition is not None and step.separates:
            others = ", ".join(describe(*other) for other in step.separates)
            pairs.append(f"{describe(addition.effect.key, addition.effect.indices)} from {others}")
    for at, (what, pairs) in enumerate(tells.items(), 1):
        told = f" This tells {'; '.join(pairs)}." if pairs else ""
        yield Sentence(f" {what}.{told}", strong=f"Measure next, {at}:")
