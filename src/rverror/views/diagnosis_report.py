"""A diagnosis for people and for programs."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rverror.base import units
from rverror.base.numbers import brief, count_of, rounded, way
from rverror.base.text import describe
from rverror.base.units import ARCSEC
from rverror.diagnosis.next_run import Circumstances, Measurement, folds, to_place, to_separate
from rverror.diagnosis.result import (
    Addition,
    Candidate,
    Diagnosis,
    ElasticEstimate,
    Line,
    OrderShare,
    Residual,
    Trace,
    Validation,
)
from rverror.geartrain.mechanism import Drive, Mechanism, Reducer
from rverror.geartrain.source import IndexValue
from rverror.model import empirical
from rverror.model.catalogue import CATALOGUE
from rverror.model.effects import Effect
from rverror.runs.measuring_chain import BenchUncertainty, uncertainty_of
from rverror.views.bench_report import BESIDE, bench_json, bench_sheet
from rverror.views.blocks import Ends, Sentence, Sheet, Verbatim, columns_of, grid, line, notes, section, title
from rverror.views.by_order import beside, leading_orders, samples_per_turn, turns_of
from rverror.views.envelope import InputFile, enveloped
from rverror.views.passport_report import passport_json, passport_sheet
from rverror.views.resonance_report import resonance_sheet, resonances_json

#: What accounts for the power of an order, as `OrderShare` names it and as people do.
SHARES = {
    "parts": "parts",
    "compliance": "compliance",
    "measuring_chain": "measuring chain",
    "empirical": "law only",
    "left": "nothing",
}
_ANGLE_DIGITS = 9  # so that samples of many turns stay apart


@dataclass(frozen=True)
class _Scale:
    """Unit in which the signal is shown, and the ending of its keys in JSON."""

    unit: str
    suffix: str
    size: float

    def __call__(self, value: float) -> float:
        return value / self.size


_SCALES = {"angle": _Scale("arcsec", "arcsec", ARCSEC), "torque": _Scale("N*m", "newton_metre", 1e3)}


def stated_bench(diagnosis: Diagnosis) -> BenchUncertainty | None:
    """What the model says of the encoders, as uncertainty of an angle; a torque is not read by them."""
    if diagnosis.quantity != "angle":
        return None
    return uncertainty_of(diagnosis.declared.encoders, diagnosis.declared.mechanism.ratio)


def _at_order(bench: BenchUncertainty | None, order: float) -> float | None:
    """Uncertainty of an order's amplitude, arcsec."""
    return None if bench is None else bench.of_order(order) / ARCSEC


def _residual_json(residual: Residual, scale: _Scale) -> dict[str, float | None]:
    names = ("rms", "peak_to_peak", "heldout_rms")
    return {f"{name}_{scale.suffix}": rounded(scale(getattr(residual, name))) for name in names}


def _cause_json(key: str, indices: Mapping[str, IndexValue]) -> dict[str, Any]:
    return {"key": key, "indices": dict(indices)}


def _size(value: float, dimension: str) -> float | None:
    return rounded(units.to_display(value, dimension))


def _addition_json(addition: Addition, scale: _Scale) -> dict[str, Any]:
    entry = CATALOGUE.get(addition.effect.key)
    return {
        **_cause_json(addition.effect.key, addition.effect.indices),
        "parameters": {
            estimate.name: {
                "value": _size(estimate.value, estimate.dimension),
                "unit": units.DISPLAY_UNITS[estimate.dimension],
                "low": _size(estimate.low, estimate.dimension),
                "high": _size(estimate.high, estimate.dimension),
            }
            for estimate in addition.estimates
        },
        "indistinguishable_from": [_cause_json(*cause) for cause in addition.indistinguishable],
        "orders": [rounded(order) for order in addition.orders],
        f"heldout_rms_{scale.suffix}": rounded(scale(addition.heldout_rms)),
        "notes": list(addition.notes),
        "summary": entry.summary if entry else "",
        "frame": entry.frame if entry else "",
        "candidates": _candidates_json(addition.candidates),
    }


def _candidates_json(candidates: Sequence[Candidate]) -> list[dict[str, Any]]:
    """Candidates with the differences of their scores; standard errors where the score of each fold is known."""
    rows = []
    for candidate in candidates:
        best = candidates[0]
        behind = best.heldout_gain - candidate.heldout_gain
        rows.append(
            {
                **_cause_json(candidate.key, candidate.indices),
                "heldout_gain": rounded(candidate.heldout_gain),
                "standard_error": rounded(standard_error(candidate.fold_gains), 3),
                "behind_best": rounded(behind if behind > 1e-9 * abs(best.heldout_gain) else 0.0),
                "behind_best_standard_error": rounded(error_behind(candidate, best), 3),
            }
        )
    return rows


def standard_error(scores: Sequence[float]) -> float | None:
    """Of a sum of as many scores as there are folds."""
    return float(np.sqrt(len(scores)) * np.std(scores, ddof=1)) if len(scores) > 1 else None


def error_behind(candidate: Candidate, best: Candidate) -> float | None:
    """Standard error of the difference to the best, from scores that belong together."""
    if candidate is best or len(candidate.fold_gains) != len(best.fold_gains):
        return None
    return standard_error([leader - own for leader, own in zip(best.fold_gains, candidate.fold_gains, strict=True)])


def _elastic_json(elastic: ElasticEstimate) -> dict[str, Any]:
    sizes = {key: _size(getattr(elastic, key), elastic.dimension) for key in ("declared", "value", "low", "high")}
    unit = units.DISPLAY_UNITS[elastic.dimension]
    return {"name": elastic.name, "unit": unit, **sizes, "told": bool(elastic.told)}


def _share_json(share: OrderShare, scale: _Scale) -> dict[str, Any]:
    shares = {name: rounded(getattr(share, name)) for name in SHARES}
    return {
        "order": rounded(share.order),
        f"amplitude_{scale.suffix}": rounded(scale(share.amplitude)),
        "shares": shares,
    }


def _validation_json(one: Validation, scale: _Scale) -> dict[str, Any]:
    def rms(size: float) -> dict[str, float | None]:
        return {f"rms_{scale.suffix}": rounded(scale(size))}

    rows = zip(one.orders, one.before_by_order, one.after_by_order, strict=True)
    by_order = [{"order": rounded(order), "before": rms(a), "after": rms(b)} for order, a, b in rows]
    return {"file": one.file, "before": rms(one.before), "after": rms(one.after), "by_order": by_order}


def _set_aside_json(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """Runs in which something was set aside or the reading slips, with the angles as travelled."""
    rows = []
    for at, trace in enumerate(diagnosis.traces):
        angles, slips = (
            [] if found is None else [rounded(angle, _ANGLE_DIGITS) for angle in np.degrees(found).tolist()]
            for found in (trace.set_aside, trace.slips)
        )
        if angles or slips:
            rows.append({"run": trace.name, "label": _label(trace, at), "angles_deg": angles, "slips_deg": slips})
    return rows


def _label(trace: Trace, at: int) -> str:
    return f"{at + 1} {way(trace.direction)}"


def bench_of(diagnosis: Diagnosis) -> Circumstances:
    """What the runs of a diagnosis cover."""
    torques = {torque for trace in diagnosis.traces if (torque := trace.torque) is not None}
    longest = max(diagnosis.traces, key=turns_of, default=None)
    part = longest.theta if longest is not None and turns_of(longest) < 1 else None
    return Circumstances(
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


def _next(diagnosis: Diagnosis) -> list[tuple[Addition | None, Measurement]]:
    """What to measure next, with the addition that each measurement is about; of runs: a table's passport says more."""
    if diagnosis.conditions:
        return []
    bench, unit = bench_of(diagnosis), diagnosis.declared.mechanism
    found: list[tuple[Addition | None, Measurement]] = []
    for addition in diagnosis.added:
        keys = (addition.effect.key, *(key for key, _ in addition.indistinguishable))
        if all(key in CATALOGUE and CATALOGUE[key].is_cause for key in keys):
            steps = to_separate(unit, addition.effect, addition.indistinguishable, bench)
            found += [(addition, step) for step in steps]
    steps = to_place(unit, [line.order for line in diagnosis.unexplained], bench)
    reading = diagnosis.quantity == "angle"
    return found + [(None, step) for step in steps if reading or step.name != "encoder"]


def _next_json(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    return [
        {
            "name": step.name,
            "what": step.what,
            "why": step.why,
            "about": _cause_json(addition.effect.key, addition.effect.indices) if addition else None,
            "separates": [_cause_json(*cause) for cause in step.separates],
        }
        for addition, step in _next(diagnosis)
    ]


def _declared_json(diagnosis: Diagnosis) -> dict[str, Any]:
    declared = diagnosis.declared
    unit = declared.mechanism
    what = f"ratio {unit.ratio:.8g}"
    if isinstance(unit, Reducer):
        what += (
            f", {unit.pins} pins, {unit.disc_lobes} lobes, {unit.discs} discs, {unit.cranks} cranks, "
            f"sun {unit.sun_teeth}, planets {unit.planet_teeth} teeth"
        )
    else:
        what += "".join(f", {name} {turns:g}" for name, turns in unit.shafts.items())
    fitted: Sequence[Effect | None] = diagnosis.model.effects[: len(declared.effects)]
    if len(fitted) < len(declared.effects):
        fitted = [None] * len(declared.effects)
    return {
        "name": declared.name or unit.name,
        "mechanism": what,
        "effects": [_effect_json(*pair) for pair in zip(declared.effects, fitted, strict=True)],
    }


def _effect_json(effect: Effect, fitted: Effect | None) -> dict[str, Any]:
    parameters = CATALOGUE[effect.key].parameters
    sigma = None
    if effect.uncertainty:
        dimension = parameters[0].dimension
        sigma = {"value": _size(effect.uncertainty, dimension), "unit": units.DISPLAY_UNITS[dimension]}
    return {
        **_cause_json(effect.key, effect.indices),
        "parameters": {
            parameter.name: {
                "value": _size(value, parameter.dimension),
                "refitted": _size(fitted.values[at], parameter.dimension) if fitted else None,
                "unit": units.DISPLAY_UNITS[parameter.dimension],
            }
            for at, (parameter, value) in enumerate(zip(parameters, effect.values, strict=True))
        },
        "uncertainty": sigma,
    }


def diagnosis_json(diagnosis: Diagnosis, *, files: Sequence[InputFile] = ()) -> dict[str, Any]:
    """Diagnosis as plain data, as `to_json` tells it.

    Sizes in arcsec and um; numbers that are not determined are None.  Keys of a torque ripple end in ``newton_metre``
    instead of ``arcsec``.
    """
    scale = _SCALES[diagnosis.quantity]
    unit = diagnosis.declared.mechanism
    sampling, bench = samples_per_turn(diagnosis), stated_bench(diagnosis)

    def before_and_after(before: float, after: float) -> dict[str, float | None]:
        return {f"before_{scale.suffix}": rounded(scale(before)), f"after_{scale.suffix}": rounded(scale(after))}

    content = {
        "verdict": diagnosis.verdict,
        f"noise_rms_{scale.suffix}": rounded(scale(diagnosis.noise_rms)),
        "before": _residual_json(diagnosis.before, scale),
        "before_refitted": _residual_json(diagnosis.before_refitted, scale),
        "after": _residual_json(diagnosis.after, scale),
        "bench_uncertainty": bench_json(bench, whole=not diagnosis.conditions),
        "added": [_addition_json(addition, scale) for addition in diagnosis.added],
        "unexplained_orders": [
            {
                "order": rounded(line.order),
                f"amplitude_{scale.suffix}": rounded(scale(line.amplitude)),
                "low": rounded(scale(line.low)),
                "high": rounded(scale(line.high)),
                "bench_uncertainty_arcsec": rounded(_at_order(bench, line.order)),
                "frames": list(line.frames),
                "beside": [] if line.frames else list(beside(unit, line.order)),
                "as_effect": _as_measured(line, unit),
                "could_fold_from": None
                if math.isinf(sampling)
                else [
                    {"order": rounded(fold.order), "frames": list(fold.frames)}
                    for fold in folds(unit, line.order, sampling)
                    if fold.frames
                ],
            }
            for line in diagnosis.unexplained
        ],
        "by_order": [
            {
                "order": rounded(row.order),
                "frames": list(row.frames),
                "beside": list(row.beside),
                **before_and_after(row.before, row.after),
                "bench_uncertainty_arcsec": rounded(_at_order(bench, row.order)),
                "runs": [before_and_after(*run) for run in row.runs],
            }
            for row in leading_orders(diagnosis)
        ],
        "candidates": _candidates_json(diagnosis.candidates),
        "candidates_tried": diagnosis.tried,
        "next_measurements": _next_json(diagnosis),
        "declared": _declared_json(diagnosis),
        "runs": [
            {
                "name": trace.name,
                "label": _label(trace, at),
                "direction": way(trace.direction),
                "torque": None if (torque := trace.torque) is None else f"{units.to_display(torque, 'torque'):g} N*m",
                "samples_per_turn": None if math.isinf(sampling) else rounded(trace.theta.size / turns_of(trace)),
            }
            for at, trace in enumerate(diagnosis.traces)
        ],
        "stiffness": [_elastic_json(elastic) for elastic in diagnosis.elastic],
        "passport": passport_json(diagnosis.passport, bench=bench),
        "resonances": resonances_json(diagnosis.resonances),
        "shares": [_share_json(share, scale) for share in diagnosis.shares],
        "validation": [_validation_json(one, scale) for one in diagnosis.validation],
        "set_aside": _set_aside_json(diagnosis),
        "notes": list(diagnosis.notes),
        "unit": scale.unit,
        "suffix": scale.suffix,
    }
    return enveloped("Diagnosis", content, files, listed="files")


def _tells_loads(diagnosis: Diagnosis) -> bool:
    """Tell whether a passport says more than one size of each order: of a table, or of runs at three loads."""
    return bool(diagnosis.conditions) or any(law.slope is not None for one in diagnosis.passport for law in one.laws)


def _is_cause(addition: Addition) -> bool:
    """Tell whether an addition is more than a law; a source of one's own is, while the catalogue does not hold it."""
    entry = CATALOGUE.get(addition.effect.key)
    return entry is None or entry.is_cause


def _as_measured(line: Line, unit: Mechanism) -> dict[str, Any] | None:
    """A line as an effect of the model file, where it is a whole order of a reducer."""
    order, most = round(line.order), len(empirical.ORDER.indices[1].allowed(unit))
    if isinstance(unit, Drive) or abs(line.order - order) > 1e-6 or order > most or not math.isfinite(line.cos):
        return None
    sizes = {name: f"{size / ARCSEC:.4g} arcsec" for name, size in (("cos", line.cos), ("sin", line.sin))}
    return {"key": empirical.ORDER.key, "frame": "output", "harmonic": order, **sizes}


# --- for people -------------------------------------------------------------------------------------------------------

_STAGES = {"before": "as declared", "before_refitted": "declared sizes refitted", "after": "with what was added"}
_SIZES = {"rms": "rms", "peak_to_peak": "peak-to-peak", "heldout_rms": "held-out rms"}
_PARTS = ("housing", "carrier", "disc", "crank", "planet", "sun", "output")  # frames that are parts
_RANKED = 10  # candidates that are listed


def diagnosis_sheet(diagnosis: Diagnosis) -> Sheet:
    """Diagnosis as a report: what is missing, what to measure next, then the numbers behind it."""
    data, bench = diagnosis_json(diagnosis), stated_bench(diagnosis)
    causes = [one for one, added in zip(data["added"], diagnosis.added, strict=True) if _is_cause(added)]
    laws = [one for one in data["added"] if one not in causes]
    return (
        *title("Diagnosis", data["declared"]["name"]),
        Sentence(*_verdict(diagnosis)),
        *_residuals(data),
        *line(_credit(diagnosis)),
        *_sizes_of("what was added", causes),
        *(sentence for one in causes for sentence in _about(one, diagnosis)),
        *section("Laws that only describe orders", *_sizes_of("law", laws)),
        *_steps(data),
        *section("Lines that no source of the catalogue explains", *_lines(data)),
        *section("Measurements that no fit saw", *_validated(data)),
        *section("Orders over load, speed and temperature", *_passport(diagnosis, bench)),
        *section("Natural frequencies that orders show over the speed", *resonance_sheet(diagnosis.resonances)),
        *section("What accounts for the power of each order, %", *_shares(data)),
        *section("Residual by order", *_by_order(data)),
        *section("Stiffness, backlash and contact law", *_stiffness(data)),
        *section("Candidates by a linear step", *_candidates(diagnosis, data)),
        *section("What was declared", *_declared(data)),
        *section("What the bench leaves uncertain", *bench_sheet(bench, whole=not diagnosis.conditions)),
        *notes(data["notes"]),
    )


def _verdict(diagnosis: Diagnosis) -> tuple[str, str]:
    """The outcome in one or two sentences, and the word to be read first."""
    scale, bench = _SCALES[diagnosis.quantity], stated_bench(diagnosis)
    before, after, noise = (
        brief(scale(size), 3)
        for size in (diagnosis.before.heldout_rms, diagnosis.after.heldout_rms, diagnosis.noise_rms)
    )
    spread = f" ± {brief(scale(bench.of('rms')), 3)} ({BESIDE})" if bench else ""
    fall = f"The held-out rms falls from {before} to {after}{spread} {scale.unit}; the noise has {noise}."
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
    return f"{strong}: {rest} {fall}", strong


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
            "Refitting the declared sizes within their uncertainty makes most of this fall; what was added takes off "
            "the rest, which noise does not explain."
        )
    return (
        f"Of this fall in mean square {100 * share:.0f} % are due to what was added, the rest to refitting declared "
        "sizes within their uncertainty."
    )


def _beside(data: Mapping[str, Any], sizes: list[Any]) -> dict[str, list[Any]]:
    """Column of the bench's uncertainty, where the model states a bench."""
    return {f"± {BESIDE}": sizes} if data["bench_uncertainty"] else {}


def _residuals(data: Mapping[str, Any]) -> Sheet:
    stages = [stage for stage in _STAGES if stage != "after" or data["added"]]
    suffix, stated = data["suffix"], data["bench_uncertainty"]
    rows = [(_STAGES[stage], *(data[stage][f"{name}_{suffix}"] for name in _SIZES)) for stage in stages]
    rows.append(("noise", data[f"noise_rms_{suffix}"], None, None))
    if stated:
        rows.append((f"± {BESIDE}", *(stated[f"{name}_arcsec"] for name in _SIZES)))
    return grid((f"residual, {data['unit']}", *_SIZES.values()), rows)


def _named(entry: Mapping[str, Any]) -> str:
    return describe(entry["key"], entry["indices"])


def _sizes_of(head: str, added: Sequence[Mapping[str, Any]]) -> Sheet:
    return grid(
        (head, "parameter", "size", "95 % interval", "unit"),
        [
            (_named(one) if not at else "", name, *_as_known(size["value"], size["low"], size["high"]), size["unit"])
            for one in added
            for at, (name, size) in enumerate(one["parameters"].items())
        ],
    )


def _as_known(value: float | None, low: float | None, high: float | None) -> tuple[float | None, Ends]:
    """Size and interval without the digits that the interval makes meaningless: two of its width are left."""
    if value is None or low is None or high is None or high <= low:
        return value, Ends((low, high))
    digits = 1 - math.floor(math.log10(high - low))
    return round(value, digits), Ends((round(low, digits), round(high, digits)))


def _about(one: Mapping[str, Any], diagnosis: Diagnosis) -> Iterator[Sentence]:
    """What a cause is, where it shows, what cannot be told from it."""
    name, orders = _named(one), ", ".join(brief(order) for order in one["orders"])
    drive = isinstance(diagnosis.declared.mechanism, Drive)
    fixed = "" if drive or one["frame"] not in _PARTS else f", fixed in the {one['frame']}"
    counted = "; indices count from 0" if any(isinstance(value, int) for value in one["indices"].values()) else ""
    shows = f"shows at {'orders' if ',' in orders else 'order'} {orders}" if orders else "shows at no order"
    yield Sentence(f"{name}: {one['summary'] or 'a source of your own'}{fixed}; it {shows}{counted}.")
    if one["indistinguishable_from"]:
        yield Sentence(f"These runs cannot tell {name} from {', '.join(map(_named, one['indistinguishable_from']))}.")
    yield from (Sentence(f"{name}: {note}.") for note in one["notes"])


def _steps(data: Mapping[str, Any]) -> Iterator[Sentence]:
    for at, step in enumerate(data["next_measurements"], 1):
        others = ", ".join(map(_named, step["separates"]))
        tells = f" This tells {_named(step['about'])} from {others}." if others else ""
        why = f": {step['why']}" if step["why"] else ""
        yield Sentence(f"Measure next, {at}: {step['what']}{why}.{tells}", strong=f"Measure next, {at}:")


def _lines(data: Mapping[str, Any]) -> Sheet:
    found = data["unexplained_orders"]
    if not found:
        return ()
    shown = columns_of(
        {
            "unexplained order": [one["order"] for one in found],
            f"amplitude, {data['unit']}": [one[f"amplitude_{data['suffix']}"] for one in found],
            "95 % interval": [Ends((one["low"], one["high"])) for one in found],
            **_beside(data, [one["bench_uncertainty_arcsec"] for one in found]),
            "frames of this order": [_frames(one) for one in found],
            "or an alias of": [_folds(one["could_fold_from"]) for one in found],
        }
    )
    effect = found[0]["as_effect"]
    described = () if effect is None else (
        Sentence(f"To describe order {effect['harmonic']} as measured, which explains nothing, add to the model:"),
        Verbatim("\n".join(["[[effect]]", *(f"{name} = {json.dumps(value)}" for name, value in effect.items())])),
    )  # fmt: skip
    own = "A source of your own is one function and one entry of the catalogue: see docs/adding-an-effect.md."
    return (*shown, Sentence(own), *described)


def _frames(row: Mapping[str, Any]) -> str:
    return "; ".join(row["frames"] or row["beside"]) or "none of this drive"


def _folds(found: Sequence[Mapping[str, Any]] | None) -> str:
    if found is None:
        return "not known: the sampling is not kept"
    return ", ".join(f"{brief(fold['order'])} ({'; '.join(fold['frames'])})" for fold in found) or "none that is known"


def _validated(data: Mapping[str, Any]) -> Sheet:
    rms = f"rms_{data['suffix']}"
    found, of_rms = data["validation"], (data["bench_uncertainty"] or {}).get("rms_arcsec")
    shown = {
        "file": [one["file"] or "in memory" for one in found],
        f"rms before, {data['unit']}": [one["before"][rms] for one in found],
        "after": [one["after"][rms] for one in found],
    }
    return columns_of(shown | _beside(data, [of_rms] * len(found)))


def _passport(diagnosis: Diagnosis, bench: BenchUncertainty | None) -> Sheet:
    return passport_sheet(diagnosis.passport, bench=bench) if _tells_loads(diagnosis) else ()


def _shares(data: Mapping[str, Any]) -> Sheet:
    return grid(
        ("order", f"amplitude, {data['unit']}", *SHARES.values()),
        [
            (one["order"], one[f"amplitude_{data['suffix']}"], *(100 * one["shares"][name] for name in SHARES))
            for one in data["shares"]
        ],
    )


def _by_order(data: Mapping[str, Any]) -> Sheet:
    rows, suffix = data["by_order"], data["suffix"]
    runs = {run["label"]: at for at, run in enumerate(data["runs"])} if len(data["runs"]) <= 4 else {}
    shown: dict[str, list[Any]] = {
        "order": [row["order"] for row in rows],
        f"before, {data['unit']}": [row[f"before_{suffix}"] for row in rows],
        "after": [row[f"after_{suffix}"] for row in rows],
        **_beside(data, [row["bench_uncertainty_arcsec"] for row in rows]),
    }
    for label, at in runs.items():
        shown[f"run {label}"] = [
            f"{brief(row['runs'][at][f'before_{suffix}'])} → {brief(row['runs'][at][f'after_{suffix}'])}"
            if row["runs"][at][f"before_{suffix}"] is not None
            else "–"
            for row in rows
        ]
    explained = "Amplitudes of the mean of turns that were each left out of the fit; over the runs, root mean square."
    return (
        *columns_of(shown | {"frames of this order": [_frames(row) for row in rows]}),
        *line(explained * bool(rows)),
    )


def _stiffness(data: Mapping[str, Any]) -> Sheet:
    rows = data["stiffness"]
    told = [row for row in rows if row["told"]]
    rest = ", ".join(row["name"] for row in rows if not row["told"])
    return (
        *grid(
            ("stiffness, backlash, contact law", "declared", "fitted", "95 % interval", "unit"),
            [
                (row["name"], row["declared"], *_as_known(row["value"], row["low"], row["high"]),
                 "" if row["unit"] == "dimensionless" else row["unit"])
                for row in told
            ],
        ),
        *line(f"These runs do not determine {rest}." if rest else ""),
    )  # fmt: skip


def _candidates(diagnosis: Diagnosis, data: Mapping[str, Any]) -> Sheet:
    rows = data["candidates"][:_RANKED]
    beside = (
        "adds to what was found" if isinstance(diagnosis.declared.mechanism, Drive) else "adds to the declared model"
    )
    explained = (
        f"The best of {data['candidates_tried']}: what each takes off chi-square where it alone {beside}, as far as "
        "the model is linear."
    )
    return (
        *columns_of(
            {
                "candidate": [_named(row) for row in rows],
                "takes off chi-square": [row["heldout_gain"] for row in rows],
                "± 1 s.e.": [row["standard_error"] for row in rows],
                "less than the best by": [row["behind_best"] for row in rows],
                "± 1 s.e. of it": [row["behind_best_standard_error"] for row in rows],
            }
        ),
        *line(explained * bool(rows)),
    )


def _declared(data: Mapping[str, Any]) -> Sheet:
    declared, runs = data["declared"], data["runs"]
    effects = [
        (
            _named(effect) if not at else "", name, size["value"],
            "exact" if effect["uncertainty"] is None else effect["uncertainty"]["value"],
            size["refitted"], size["unit"],
        )
        for effect in declared["effects"]
        for at, (name, size) in enumerate(effect["parameters"].items())
    ]  # fmt: skip
    return (
        Sentence(declared["mechanism"] + ("" if effects else "; no effect is declared")),
        *grid(("effect", "parameter", "declared", "1 sigma", "refitted", "unit"), effects),
        *columns_of(
            {
                "run": [run["name"] for run in runs],
                "direction": [run["direction"] for run in runs],
                "output torque": [run["torque"] or "–" for run in runs],
                "samples an output turn": [run["samples_per_turn"] for run in runs],
            }
        ),
    )
