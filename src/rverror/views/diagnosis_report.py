"""A diagnosis for people and for programs: text, JSON and the pictures of its page."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rverror.base import units
from rverror.base.numbers import brief, rounded, way
from rverror.base.text import describe, file_name, joined
from rverror.base.units import ARCSEC
from rverror.base.version import __version__
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
from rverror.views import svg
from rverror.views.bench_report import BESIDE, bench_json, bench_lines, plus_minus
from rverror.views.by_order import beside, leading_orders, residual_spectrum, samples_per_turn, short_frame, turns_of
from rverror.views.diagnosis_page import AS_MEASURED, AS_TOLD, SHARES, effect_toml, page
from rverror.views.envelope import InputFile, enveloped
from rverror.views.passport_report import passport_html, passport_json, passport_lines
from rverror.views.resonance_report import resonance_html, resonance_lines, resonances_json
from rverror.views.set_aside import LABELS, marks

_VERDICTS = {
    "explained": "explained: what was added accounts for all that is significant",
    "nothing_missing": "nothing missing: the declared model accounts for all that is significant",
    "unexplained": "unexplained: significant lines remain that no candidate accounts for",
}
_WIDTHS = (960, 400)  # px, of pictures on a desktop and on a phone
_ANGLES = (math.inf, 90.0)  # degrees of the waveforms on them: forty waves a turn fill a phone's width with ink
_HIGHEST_SHOWN = 260.0
_NAMED = (8, 5)  # lines named in a spectrum of each width
_LISTED = 12  # unexplained lines in the text
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


def diagnosis_text(diagnosis: Diagnosis, *, files: Sequence[InputFile] = ()) -> str:
    """Diagnosis as a text report.

    Parameters
    ----------
    diagnosis : Diagnosis
    files : sequence of InputFile, optional
        What it was made from: see `rverror.input_files`.

    Returns
    -------
    str
        Ends with a line end.  Characters that cannot be printed show as their escapes.

    Examples
    --------
    >>> import numpy as np, rverror
    >>> theta, rng = np.linspace(0, 8 * np.pi, 4001), np.random.default_rng(1)
    >>> run = rverror.run_from_arrays(input_angle=14 * theta, te=1e-6 * rng.standard_normal(theta.size))
    >>> found = rverror.diagnose(rverror.Model(rverror.Drive(ratio=14.0, shafts={"motor": 14.0})), [run])
    >>> print(diagnosis_text(found).splitlines()[0])
    Verdict: nothing missing: the declared model accounts for all that is significant
    >>> diagnosis_json(found)["verdict"], diagnosis_json(found)["added"]
    ('nothing_missing', [])
    """
    scale, bench = _SCALES[diagnosis.quantity], stated_bench(diagnosis)
    lines = [f"Verdict: {_VERDICTS[diagnosis.verdict]}", ""]
    declared = diagnosis.declared
    lines.append(f"Declared: {declared.name or declared.mechanism.name}, {len(declared.effects)} effects")
    lines += [f"Run: {trace.name}, {way(trace.direction)}" for trace in diagnosis.traces]
    if _tells_loads(diagnosis):
        lines += ["", *passport_lines(diagnosis.passport, bench=bench)]
    if diagnosis.resonances:
        lines += ["", *resonance_lines(diagnosis.resonances)]
    of_rms = None if bench is None else bench.of("rms") / ARCSEC
    of_peak = None if bench is None or diagnosis.conditions else bench.of("peak_to_peak") / ARCSEC
    beside = [plus_minus(of_rms), plus_minus(of_peak, 2), plus_minus(of_rms)]
    heads = [
        f"{head:>{width}}" for head, width in zip(("rms", "peak-to-peak", "held-out rms"), (9, 15, 15), strict=True)
    ]
    heads = [head + " " * len(more) for head, more in zip(heads, beside, strict=True)]
    lines += ["", f"{'residual, ' + scale.unit:<26}{''.join(heads)}".rstrip() + (f"  (± {BESIDE})" if bench else "")]
    for label, residual in (
        ("before (as declared)", diagnosis.before),
        ("before, sizes refitted", diagnosis.before_refitted),
        ("after", diagnosis.after),
    ):
        rms, peak, heldout = (scale(x) for x in (residual.rms, residual.peak_to_peak, residual.heldout_rms))
        sizes = [f"{rms:>9.3f}", f"{peak:>15.2f}", f"{heldout:>15.3f}"]
        lines.append(f"{label:<26}" + "".join(size + more for size, more in zip(sizes, beside, strict=True)))
    lines.append(f"{'noise':<26}{scale(diagnosis.noise_rms):>9.3f}")
    lines += bench_lines(bench, whole=not diagnosis.conditions)
    lines += _validation_lines(diagnosis, scale, plus_minus(of_rms))
    lines += _share_lines(diagnosis, scale)
    causes = [addition for addition in diagnosis.added if _is_cause(addition)]
    for number, addition in enumerate(causes, 1):
        lines += ["", *_addition_lines(number, addition, scale)]
    lines += _law_lines([addition for addition in diagnosis.added if addition not in causes])
    lines += _elastic_lines(diagnosis)
    lines += _order_lines(diagnosis, scale)
    if diagnosis.unexplained:
        lines += ["", *_unexplained_lines(diagnosis, scale)]
    lines += _candidate_lines(diagnosis)
    lines += _next_lines(diagnosis)
    if diagnosis.notes:
        lines += ["", "Notes", *(f"  {note}" for note in diagnosis.notes)]
    if files:
        lines += ["", "Inputs (sha256)", *(f"  {item.sha256}  {item.path}" for item in files)]
        lines.append(f"rverror {__version__}")
    return joined(lines)


def _addition_lines(number: int, addition: Addition, scale: _Scale) -> list[str]:
    lines = [f"Added {number}: {describe(addition.effect.key, addition.effect.indices)}"]
    for estimate in addition.estimates:
        sizes = (estimate.value, estimate.low, estimate.high)
        value, low, high = (units.to_display(size, estimate.dimension) for size in sizes)
        told = math.isfinite(low)
        # two digits of the interval: a compliance in arcsec/(N*m) has none of them among the first three decimals
        digits = max(3, 1 - math.floor(math.log10(high - low))) if told and high > low else 3
        interval = f"95 % [{low:.{digits}f}, {high:.{digits}f}]" if told else "not determined by these runs"
        unit = f"{units.DISPLAY_UNITS[estimate.dimension]} "
        lines.append(f"  {estimate.name:<12}{value:>10.{digits}f} {unit:<8}{interval}")
    orders = ", ".join(f"{order:g}" for order in addition.orders)
    shows = f"at orders {orders}" if orders else "at no order: constant, or growing along the run"
    lines.append(f"  {shows}; held-out rms {scale(addition.heldout_rms):.3f} {scale.unit} once added")
    if addition.indistinguishable:
        names = ", ".join(describe(key, indices) for key, indices in addition.indistinguishable)
        lines.append(f"  these runs cannot tell it from: {names}")
    return lines + [f"  note: {note}" for note in addition.notes]


def _tells_loads(diagnosis: Diagnosis) -> bool:
    """Tell whether a passport says more than one size of each order: of a table, or of runs at three loads."""
    return bool(diagnosis.conditions) or any(law.slope is not None for one in diagnosis.passport for law in one.laws)


def _is_cause(addition: Addition) -> bool:
    """Tell whether an addition is more than a law; a source of one's own is, while the catalogue does not hold it."""
    entry = CATALOGUE.get(addition.effect.key)
    return entry is None or entry.is_cause


def _law_lines(laws: Sequence[Addition]) -> list[str]:
    """Laws that describe an order, a line each."""
    if not laws:
        return []
    lines = ["", "Added beside them, to describe orders that no cause explains: no part is behind these"]
    for law in laws:
        sizes = ", ".join(
            f"{e.name} {brief(units.to_display(e.value, e.dimension))} {units.DISPLAY_UNITS[e.dimension]}"
            for e in law.estimates
        )
        lines.append(f"  {describe(law.effect.key, law.effect.indices)}: {sizes}")
    return lines


def _elastic_lines(diagnosis: Diagnosis) -> list[str]:
    if not diagnosis.elastic:
        return []
    told = [elastic for elastic in diagnosis.elastic if elastic.told]
    lines = ["", AS_TOLD]
    if told:
        lines.append(f"  {'':<16}{'declared':>12}{'fitted':>12}")
    for row in map(_elastic_json, told):
        ends = "95 % [{}, {}]".format(*(_few(row[end]) for end in ("low", "high")))
        if row["low"] is None and row["high"] is None:
            ends = "not determined by these runs"
        unit = "" if row["unit"] == "dimensionless" else row["unit"]
        lines.append(f"  {row['name']:<16}{_few(row['declared']):>12}{_few(row['value']):>12} {unit:<6}{ends}")
    rest = ", ".join(elastic.name for elastic in diagnosis.elastic if not elastic.told)
    return [*lines, f"  not told by these runs: {rest}"] if rest else lines


def _few(value: float | None) -> str:
    return "-" if value is None else brief(value)


def _validation_lines(diagnosis: Diagnosis, scale: _Scale, beside: str) -> list[str]:
    """What is left of measurements that no fit saw."""
    lines = [""] if diagnosis.validation else []
    for one in diagnosis.validation:
        lines.append(
            f"Not seen by any fit: {one.file or 'in memory'}: rms {scale(one.before):.3f}{beside} before, "
            f"{scale(one.after):.3f}{beside} {scale.unit} after" + (f" ({BESIDE})" if beside else "")
        )
    return lines


def _share_lines(diagnosis: Diagnosis, scale: _Scale) -> list[str]:
    """What accounts for the power of each order."""
    if not diagnosis.shares:
        return []
    lines = ["", "What accounts for the power of each order, %"]
    lines.append(f"{'order':>10}{scale.unit:>10}" + "".join(f"{name:>17}" for name in SHARES.values()))
    for one in diagnosis.shares:
        shares = "".join(f"{round(100 * getattr(one, name)):>17d}" for name in SHARES)
        lines.append(f"{one.order:>10g}{scale(one.amplitude):>10.2f}{shares}")
    return lines


def _order_lines(diagnosis: Diagnosis, scale: _Scale) -> list[str]:
    rows = leading_orders(diagnosis, most=8)
    if not rows:
        return []
    bench = stated_bench(diagnosis)
    beside = f", ± {BESIDE}" if bench else ""
    lines = [
        "",
        f"Leading orders of the residual of the mean turn, {scale.unit}: before, after{beside}, frames that they fit",
    ]
    for row in rows:
        frames = "; ".join((*row.frames, *row.beside)) or "no frame of this drive"
        more = plus_minus(_at_order(bench, row.order))
        lines.append(f"  {row.order:>8.6g}  {scale(row.before):>8.3f}  {scale(row.after):>8.3f}{more}  {frames}")
    return lines


def _unexplained_lines(diagnosis: Diagnosis, scale: _Scale) -> list[str]:
    sampling, unit, bench = samples_per_turn(diagnosis), diagnosis.declared.mechanism, stated_bench(diagnosis)
    lines = ["Lines that remain (order per output turn, amplitude with 95 % interval, frames that it fits)"]
    for line in diagnosis.unexplained[:_LISTED]:
        size = f"{scale(line.amplitude):.3f} {scale.unit} [{scale(line.low):.3f}, {scale(line.high):.3f}]"
        if bench:
            size += f"{plus_minus(_at_order(bench, line.order))} ({BESIDE})"
        frames = "; ".join(line.frames or beside(unit, line.order)) or "no frame of this drive: not in the catalogue"
        lines.append(f"  {line.order:>8.6g}  {size}  {frames}")
        above = [f"{f.order:g} ({'; '.join(f.frames)})" for f in folds(unit, line.order, sampling) if f.frames]
        if above:
            lines.append(f"            could fold from {', '.join(above)}")
    if len(diagnosis.unexplained) > _LISTED:
        lines.append(f"  and {len(diagnosis.unexplained) - _LISTED} more")
    effect = _as_measured(diagnosis.unexplained[0], unit)
    return [
        *lines,
        "",
        "The remaining lines fit no source of the catalogue.",
        "An effect of your own is one function and one catalogue entry: see docs/adding-an-effect.md.",
        *([AS_MEASURED.format(**effect), *(f"  {line}" for line in effect_toml(effect))] if effect else ()),
    ]


def _as_measured(line: Line, unit: Mechanism) -> dict[str, Any] | None:
    """A line as an effect of the model file, where it is a whole order of a reducer."""
    order, most = round(line.order), len(empirical.ORDER.indices[1].allowed(unit))
    if isinstance(unit, Drive) or abs(line.order - order) > 1e-6 or order > most or not math.isfinite(line.cos):
        return None
    sizes = {name: f"{size / ARCSEC:.4g} arcsec" for name, size in (("cos", line.cos), ("sin", line.sin))}
    return {"key": empirical.ORDER.key, "frame": "output", "harmonic": order, **sizes}


def _candidate_lines(diagnosis: Diagnosis) -> list[str]:
    if not diagnosis.candidates:
        return []
    lines = [
        "",
        f"Best of {diagnosis.tried} candidates (what each would take off chi-square, as far as the model is linear)",
    ]
    for candidate in diagnosis.candidates[:5]:
        error = standard_error(candidate.fold_gains)
        spread = "" if error is None else f" +- {error:<8.3g}"
        lines.append(f"  {candidate.heldout_gain:>10.1f}{spread}  {describe(candidate.key, candidate.indices)}")
    return lines


def _next_lines(diagnosis: Diagnosis) -> list[str]:
    steps = _next(diagnosis)
    if not steps:
        return []
    lines = ["", "What to measure next"]
    for at, (addition, step) in enumerate(steps, 1):
        lines.append(f"  {at}. {step.what}: {step.why}")
        if addition and step.separates:
            others = ", ".join(describe(key, indices) for key, indices in step.separates)
            lines.append(f"     separates {describe(addition.effect.key, addition.effect.indices)} from {others}")
    return lines


def _summary(diagnosis: Diagnosis) -> str:
    """The outcome in one or two sentences."""
    scale = _SCALES[diagnosis.quantity]
    bench = stated_bench(diagnosis)
    before, after, noise, spread = (
        brief(float(f"{scale(value):.3g}"))
        for value in (
            diagnosis.before.heldout_rms,
            diagnosis.after.heldout_rms,
            diagnosis.noise_rms,
            bench.of("rms") if bench else 0.0,
        )
    )
    beside = f" ± {spread} ({BESIDE})" if bench else ""
    fall = f"Held-out rms {before} before, {after}{beside} {scale.unit} after; the noise floor is {noise}."
    names = ", ".join(describe(a.effect.key, a.effect.indices) for a in diagnosis.added if _is_cause(a))
    laws = sum(not _is_cause(a) for a in diagnosis.added)
    twins = sum(len(a.indistinguishable) for a in diagnosis.added)
    if names and twins:
        names += f" (or one of {twins} other{'s' if twins > 1 else ''} that these runs cannot tell from it)"
    orders = ", ".join(f"{line.order:g}" for line in diagnosis.unexplained[:6])
    return {
        "explained": f"What the model lacked: {names}. {fall}",
        "nothing_missing": f"The declared model accounts for all that is significant. {fall}",
        "unexplained": (f"Added: {names}. " if names else "")
        + (f"Beside {'them' if names else 'what was declared'} {laws} laws only describe. " if laws else "")
        + f"Significant lines remain that no candidate accounts for, at order {orders}. {fall}",
    }[diagnosis.verdict]


def diagnosis_html(diagnosis: Diagnosis, *, files: Sequence[InputFile] = ()) -> str:
    """Diagnosis as one HTML page, as `to_html` tells it."""
    data = diagnosis_json(diagnosis, files=files)
    runs = [(_label(trace, at), trace) for at, trace in enumerate(diagnosis.traces)]
    pictures = [(f"Run {name}: {file_name(t.name)}", _waveform_pictures(diagnosis, t)) for name, t in runs]
    pictures += [(f"Residual spectrum, run {name}", _spectrum_pictures(diagnosis, t)) for name, t in runs]
    first = passport_html(diagnosis.passport, bench=stated_bench(diagnosis)) if _tells_loads(diagnosis) else ""
    first += resonance_html(diagnosis.resonances)
    told = diagnosis_text(diagnosis, files=files)
    return page(data, summary=_summary(diagnosis), first=first, figures=pictures, text=told)


def _waveform_pictures(diagnosis: Diagnosis, trace: Trace) -> list[str]:
    scale = _SCALES[diagnosis.quantity]
    signal = "transmission error" if diagnosis.quantity == "angle" else "torque"
    measured, before, after = (values / scale.size for values in (trace.measured, trace.before, trace.after))
    angle = np.degrees(trace.theta)
    marked = [(one.kind, np.degrees(one.angles)) for one in marks(trace)]
    pictures = []
    for width, reach in zip(_WIDTHS, _ANGLES, strict=True):
        seen = angle <= angle[0] + reach
        part = "" if seen.all() else f", the first {reach:g} degrees"
        lines = [("measured", measured[seen]), ("before", before[seen]), ("after", after[seen])]
        rest = [("before", (measured - before)[seen]), ("after", (measured - after)[seen])]
        panels = [(f"{signal}, {scale.unit}{part}", lines), (f"residual, {scale.unit}{part}", rest)]
        shown = [(kind, places[places <= angle[0] + reach]) for kind, places in marked]
        title = f"{signal} and residual of {file_name(trace.name)}, {way(trace.direction)}, over the output angle{part}"
        title += "".join(f"; marked: {LABELS[kind]}, {places.size}" for kind, places in shown if places.size)
        pictures.append(svg.waveforms(panels, angle[seen], width=width, title=title, marks=shown))
    return pictures


def _spectrum_pictures(diagnosis: Diagnosis, trace: Trace) -> list[str]:
    scale = _SCALES[diagnosis.quantity]
    found = residual_spectrum(trace)
    rows = leading_orders(diagnosis, most=max(_NAMED))
    highest = max([_HIGHEST_SHOWN, *(1.1 * row.order for row in rows)])
    seen = found.order <= highest
    order, before, after = found.order[seen], found.before[seen] / scale.size, found.after[seen] / scale.size
    peaks: list[svg.Peak] = []
    for row in rows:
        if any(abs(row.order - peak.order) < highest / 40 for peak in peaks):
            continue  # the skirt of a larger line; the table has it
        at = int(np.argmin(np.abs(order - row.order)))
        name = short_frame(row.frames[0]) if row.frames else "no frame"
        peaks.append(svg.Peak(float(row.order), float(max(before[at], after[at])), name))
    title = f"order spectrum of the residual of {file_name(trace.name)}, {way(trace.direction)}, before and after"
    return [
        svg.spectrum(order, before, after, peaks[:most], width=width, title=title, unit=scale.unit)
        for width, most in zip(_WIDTHS, _NAMED, strict=True)
    ]
