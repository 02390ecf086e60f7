"""A diagnosis for people and for programs."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from rverror.base import units
from rverror.base.numbers import brief, count_of, in_arcsec, rounded, way
from rverror.base.text import describe
from rverror.base.units import ARCSEC
from rverror.diagnosis.next_run import folds
from rverror.diagnosis.result import (
    Addition,
    Candidate,
    Diagnosis,
    Line,
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
from rverror.views.blocks import Ends, Sentence, Sheet, Verbatim, grid, line, notes, section, title
from rverror.views.by_order import beside, leading_orders, samples_per_turn, turns_of
from rverror.views.envelope import InputFile, enveloped
from rverror.views.fields import OWN, Field, Place, entry, listing
from rverror.views.next_measurement import next_steps
from rverror.views.passport_report import passport_json, passport_sheet
from rverror.views.resonance_report import resonance_sheet, resonances_json
from rverror.views.variables import ANGLE, NUMBER, PERCENT, TORQUE, Unit

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
class _Signal:
    """Unit in which the signal is shown, and the ending of its keys in JSON."""

    unit: Unit
    suffix: str

    def of(self, thing: Any, *names: str, **places: str) -> dict[str, Any]:
        """Entries of sizes, by their names or under others."""
        where = {name: name for name in names} | places
        return entry(thing, **{f"{name}_{self.suffix}": (place, self.unit) for name, place in where.items()})


SIGNALS = {"angle": _Signal(ANGLE, "arcsec"), "torque": _Signal(TORQUE, "newton_metre")}
_RESIDUAL = {"rms": "rms", "peak_to_peak": "peak-to-peak", "heldout_rms": "held-out rms"}


def stated_bench(diagnosis: Diagnosis) -> BenchUncertainty | None:
    """What the model says of the encoders, as uncertainty of an angle; a torque is not read by them."""
    if diagnosis.quantity != "angle":
        return None
    return uncertainty_of(diagnosis.declared.encoders, diagnosis.declared.mechanism.ratio)


def _at_order(bench: BenchUncertainty | None, order: float) -> dict[str, float | None]:
    """Uncertainty of an order's amplitude."""
    return {"bench_uncertainty_arcsec": None if bench is None else in_arcsec(bench.of_order(order))}


def _cause(key: str, indices: Mapping[str, IndexValue]) -> dict[str, Any]:
    return {"key": key, "indices": dict(indices)}


def _unit_of(row: Any) -> str:
    return units.DISPLAY_UNITS[row.dimension]


def _addition(addition: Addition, signal: _Signal) -> dict[str, Any]:
    known = CATALOGUE.get(addition.effect.key)
    return {
        **_cause(addition.effect.key, addition.effect.indices),
        "parameters": {
            one.name: entry(one, one.dimension, value=OWN, unit=_unit_of, low=OWN, high=OWN)
            for one in addition.estimates
        },
        "indistinguishable_from": [_cause(*cause) for cause in addition.indistinguishable],
        **entry(addition, orders=NUMBER, notes=None),
        **signal.of(addition, "heldout_rms"),
        "summary": known.summary if known else "",
        "frame": known.frame if known else "",
    }


def _ranking(candidates: Sequence[Candidate]) -> list[dict[str, Any]]:
    """Candidates with the differences of their scores."""
    best = candidates[0] if candidates else None

    def behind(candidate: Candidate) -> float:
        assert best is not None
        difference = best.heldout_gain - candidate.heldout_gain
        return difference if difference > 1e-9 * abs(best.heldout_gain) else 0.0

    return [
        entry(candidate, key=None, indices=None, heldout_gain=NUMBER, behind_best=(behind, NUMBER))
        for candidate in candidates
    ]


def _validation(one: Validation, signal: _Signal) -> dict[str, Any]:
    each = zip(one.orders, one.before_by_order, one.after_by_order, strict=True)
    return {
        "file": one.file,
        "before": signal.of(one, rms="before"),
        "after": signal.of(one, rms="after"),
        "by_order": [
            {"order": rounded(row[0]), "before": signal.of(row, rms="1"), "after": signal.of(row, rms="2")}
            for row in each
        ],
    }


def _set_aside(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """Runs in which something was set aside or the reading slips, with the angles as travelled."""
    found = []
    for at, trace in enumerate(diagnosis.traces):
        angles, slips = (
            [rounded(angle, _ANGLE_DIGITS) for angle in np.degrees([] if given is None else given).tolist()]
            for given in (trace.set_aside, trace.slips)
        )
        if angles or slips:
            found.append({"run": trace.name, "label": _label(trace, at), "angles_deg": angles, "slips_deg": slips})
    return found


def _label(trace: Trace, at: int) -> str:
    return f"{at + 1} {way(trace.direction)}"


def _next_entries(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    return [
        {
            **entry(step, name=None, what=None, why=None),
            "about": _cause(addition.effect.key, addition.effect.indices) if addition else None,
            "separates": [_cause(*cause) for cause in step.separates],
        }
        for addition, step in next_steps(diagnosis)
    ]


def _declared_entries(diagnosis: Diagnosis) -> dict[str, Any]:
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
        "effects": [_effect(*pair) for pair in zip(declared.effects, fitted, strict=True)],
    }


def _effect(effect: Effect, fitted: Effect | None) -> dict[str, Any]:
    parameters = CATALOGUE[effect.key].parameters
    first = parameters[0]
    values = zip(parameters, effect.values, fitted.values if fitted else [None] * len(parameters), strict=True)
    return {
        **_cause(effect.key, effect.indices),
        "parameters": {
            row[0].name: entry(
                row, row[0].dimension, value=("1", OWN), refitted=("2", OWN), unit=lambda of: _unit_of(of[0])
            )
            for row in values
        },
        "uncertainty": entry(effect, first.dimension, value=("uncertainty", OWN), unit=lambda _: _unit_of(first))
        if effect.uncertainty
        else None,
    }


def diagnosis_json(diagnosis: Diagnosis, *, files: Sequence[InputFile] = ()) -> dict[str, Any]:
    """Diagnosis as plain data, as `to_json` tells it.

    Sizes in arcsec and um; numbers that are not determined are None.  Keys of a torque ripple end in ``newton_metre``
    instead of ``arcsec``.
    """
    return enveloped("Diagnosis", diagnosis_content(diagnosis), files, listed="files")


def diagnosis_content(diagnosis: Diagnosis) -> dict[str, Any]:
    """What `diagnosis_json` holds but for files and version."""
    signal = SIGNALS[diagnosis.quantity]
    sampling, bench = samples_per_turn(diagnosis), stated_bench(diagnosis)
    return {
        **entry(diagnosis, verdict=None, candidates_tried="tried", notes=None),
        **signal.of(diagnosis, "noise_rms"),
        **{stage: signal.of(getattr(diagnosis, stage), *_RESIDUAL) for stage in _STAGES},
        "bench_uncertainty": bench_json(bench, whole=not diagnosis.shares),
        "added": [_addition(addition, signal) for addition in diagnosis.added],
        "unexplained_orders": [_line(line, diagnosis) for line in diagnosis.unexplained],
        "by_order": [
            {
                **entry(row, order=NUMBER, frames=None, beside=None),
                **signal.of(row, "before", "after"),
                **_at_order(bench, row.order),
                "runs": [signal.of(run, before="0", after="1") for run in row.runs],
            }
            for row in leading_orders(diagnosis)
        ],
        "candidates": _ranking(diagnosis.candidates),
        "next_measurements": _next_entries(diagnosis),
        "declared": _declared_entries(diagnosis),
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
        "stiffness": [
            entry(
                one,
                one.dimension,
                name=None,
                unit=_unit_of,
                declared=OWN,
                value=OWN,
                low=OWN,
                high=OWN,
                told=lambda row: bool(row.told),
            )
            for one in diagnosis.elastic
        ],
        "passport": passport_json(diagnosis.passport, bench=bench),
        "resonances": resonances_json(diagnosis.resonances),
        "shares": [
            {
                **entry(share, order=NUMBER),
                **signal.of(share, "amplitude"),
                "shares": entry(share, **dict.fromkeys(SHARES, NUMBER)),
            }
            for share in diagnosis.shares
        ],
        "validation": [_validation(one, signal) for one in diagnosis.validation],
        "set_aside": _set_aside(diagnosis),
        "unit": signal.unit.shown,
        "suffix": signal.suffix,
    }


def _line(line: Line, diagnosis: Diagnosis) -> dict[str, Any]:
    signal, unit, sampling = SIGNALS[diagnosis.quantity], diagnosis.declared.mechanism, samples_per_turn(diagnosis)
    could_fold = [] if math.isinf(sampling) else folds(unit, line.order, sampling)
    return {
        **entry(line, order=NUMBER, low=signal.unit, high=signal.unit, frames=None),
        **signal.of(line, "amplitude"),
        **_at_order(stated_bench(diagnosis), line.order),
        "beside": [] if line.frames else list(beside(unit, line.order)),
        "as_effect": _as_measured(line, unit),
        "could_fold_from": None
        if math.isinf(sampling)
        else [entry(fold, order=NUMBER, frames=None) for fold in could_fold if fold.frames],
    }


def _tells_loads(diagnosis: Diagnosis) -> bool:
    """Tell whether a passport says more than one size of each order: of a table, or of runs at three loads."""
    return bool(diagnosis.shares) or any(law.slope is not None for one in diagnosis.passport for law in one.laws)


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
_PARTS = ("housing", "carrier", "disc", "crank", "planet", "sun", "output")  # frames that are parts
_RANKED = 10  # candidates that are listed


def diagnosis_sheet(diagnosis: Diagnosis) -> Sheet:
    """Diagnosis as a report: what is missing, what to measure next, then the numbers behind it."""
    data, bench = diagnosis_content(diagnosis), stated_bench(diagnosis)
    causes = [one for one, added in zip(data["added"], diagnosis.added, strict=True) if _is_cause(added)]
    laws = [one for one in data["added"] if one not in causes]
    whole = not diagnosis.shares
    passport = passport_sheet(diagnosis.passport, bench=bench) if _tells_loads(diagnosis) else ()
    shares: dict[str, Field] = {"order": None, f"amplitude, {data['unit']}": f"amplitude_{data['suffix']}"}
    shares |= {head: (f"shares.{name}", PERCENT) for name, head in SHARES.items()}
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
        *section("Orders over load, speed and temperature", *passport),
        *section("Natural frequencies that orders show over the speed", *resonance_sheet(diagnosis.resonances)),
        *section("What accounts for the power of each order, %", *listing(data["shares"], shares)),
        *section("Residual by order", *_by_order(data)),
        *section("Stiffness, backlash and contact law", *_stiffness(data)),
        *section("Candidates by a linear step", *_candidates(diagnosis, data)),
        *section("What was declared", *_declared(data)),
        *section("What the bench leaves uncertain", *bench_sheet(bench, whole=whole)),
        *notes(data["notes"]),
    )


def _verdict(diagnosis: Diagnosis) -> tuple[str, str]:
    """The outcome in one or two sentences, and the word to be read first."""
    unit, bench = SIGNALS[diagnosis.quantity].unit, stated_bench(diagnosis)
    before, after, noise = (
        brief(size / unit.size, 3)
        for size in (diagnosis.before.heldout_rms, diagnosis.after.heldout_rms, diagnosis.noise_rms)
    )
    spread = f" ± {brief(bench.of('rms') / unit.size, 3)} ({BESIDE})" if bench else ""
    fall = f"The held-out rms falls from {before} to {after}{spread} {unit.shown}; the noise has {noise}."
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


def _beside(data: Mapping[str, Any], place: Place) -> dict[str, Field]:
    """Column of the bench's uncertainty, where the model states a bench."""
    return {f"± {BESIDE}": place} if data["bench_uncertainty"] else {}


def _residuals(data: Mapping[str, Any]) -> Sheet:
    stages = [stage for stage in _STAGES if stage != "after" or data["added"]]
    suffix, stated = data["suffix"], data["bench_uncertainty"]
    listed = [(_STAGES[stage], *(data[stage][f"{name}_{suffix}"] for name in _RESIDUAL)) for stage in stages]
    listed.append(("noise", data[f"noise_rms_{suffix}"], None, None))
    if stated:
        listed.append((f"± {BESIDE}", *(stated[f"{name}_arcsec"] for name in _RESIDUAL)))
    return grid((f"residual, {data['unit']}", *_RESIDUAL.values()), listed)


def _named(of: Mapping[str, Any]) -> str:
    return describe(of["key"], of["indices"])


def _parameters(effects: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Parameters of effects in rows, the first of each with the effect's name."""
    return [
        {"effect": "" if at else _named(one), "of": one, "name": name, **size}
        for one in effects
        for at, (name, size) in enumerate(one["parameters"].items())
    ]


def _sizes_of(head: str, added: Sequence[Mapping[str, Any]]) -> Sheet:
    heads: dict[str, Field] = {head: "effect", "parameter": "name", **_KNOWN, "unit": None}
    return listing(_parameters(added), heads)


def _as_known(row: Mapping[str, Any]) -> tuple[float | None, Ends]:
    """Size and interval without the digits that the interval makes meaningless: two of its width are left."""
    value, low, high = (row[name] for name in ("value", "low", "high"))
    if value is None or low is None or high is None or high <= low:
        return value, Ends((low, high))
    digits = 1 - math.floor(math.log10(high - low))
    return round(value, digits), Ends((round(low, digits), round(high, digits)))


_KNOWN: Mapping[str, Field] = {
    "size": lambda row: _as_known(row)[0],
    "95 % interval": lambda row: _as_known(row)[1],
}


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
    heads: dict[str, Field] = {
        "unexplained order": "order",
        f"amplitude, {data['unit']}": f"amplitude_{data['suffix']}",
        "95 % interval": lambda one: Ends((one["low"], one["high"])),
        **_beside(data, "bench_uncertainty_arcsec"),
        "frames of this order": _frames,
        "or an alias of": lambda one: _folds(one["could_fold_from"]),
    }
    effect = found[0]["as_effect"]
    described = () if effect is None else (
        Sentence(f"To describe order {effect['harmonic']} as measured, which explains nothing, add to the model:"),
        Verbatim("\n".join(["[[effect]]", *(f"{name} = {json.dumps(value)}" for name, value in effect.items())])),
    )  # fmt: skip
    own = "A source of your own is one function and one entry of the catalogue: see docs/adding-an-effect.md."
    return (*listing(found, heads), Sentence(own), *described)


def _frames(row: Mapping[str, Any]) -> str:
    return "; ".join(row["frames"] or row["beside"]) or "none of this drive"


def _folds(found: Sequence[Mapping[str, Any]] | None) -> str:
    if found is None:
        return "not known: the sampling is not kept"
    return ", ".join(f"{brief(fold['order'])} ({'; '.join(fold['frames'])})" for fold in found) or "none that is known"


def _validated(data: Mapping[str, Any]) -> Sheet:
    rms = f"rms_{data['suffix']}"
    heads: dict[str, Field] = {
        "file": lambda one: one["file"] or "in memory",
        f"rms before, {data['unit']}": f"before.{rms}",
        "after": f"after.{rms}",
        **_beside(data, lambda _: data["bench_uncertainty"]["rms_arcsec"]),
    }
    return listing(data["validation"], heads)


def _by_order(data: Mapping[str, Any]) -> Sheet:
    suffix = data["suffix"]

    def of_run(row: Mapping[str, Any], at: int) -> str:
        before, after = (row["runs"][at][f"{which}_{suffix}"] for which in ("before", "after"))
        return "–" if before is None else f"{brief(before)} → {brief(after)}"

    runs = data["runs"] if len(data["runs"]) <= 4 else []
    heads: dict[str, Field] = {
        "order": None,
        f"before, {data['unit']}": f"before_{suffix}",
        "after": f"after_{suffix}",
        **_beside(data, "bench_uncertainty_arcsec"),
        **{f"run {run['label']}": partial(of_run, at=at) for at, run in enumerate(runs)},
        "frames of this order": _frames,
    }
    explained = "Amplitudes of the mean of turns that were each left out of the fit; over the runs, root mean square."
    return listing(data["by_order"], heads) + line(explained * bool(data["by_order"]))


def _stiffness(data: Mapping[str, Any]) -> Sheet:
    told = [row for row in data["stiffness"] if row["told"]]
    rest = ", ".join(row["name"] for row in data["stiffness"] if not row["told"])
    heads: dict[str, Field] = {"stiffness, backlash, contact law": "name", "declared": None, "fitted": _KNOWN["size"]}
    heads |= {"95 % interval": _KNOWN["95 % interval"]}
    heads |= {"unit": lambda row: "" if row["unit"] == NUMBER.shown else row["unit"]}
    return listing(told, heads) + line(f"These runs do not determine {rest}." if rest else "")


def _candidates(diagnosis: Diagnosis, data: Mapping[str, Any]) -> Sheet:
    ranking = data["candidates"][:_RANKED]
    drive = isinstance(diagnosis.declared.mechanism, Drive)
    explained = (
        f"The best of {data['candidates_tried']}: what each takes off chi-square where it alone adds to "
        f"{'what was found' if drive else 'the declared model'}, as far as the model is linear."
    )
    heads: dict[str, Field] = {
        "candidate": _named,
        "takes off chi-square": "heldout_gain",
        "less than the best by": "behind_best",
    }
    return listing(ranking, heads) + line(explained * bool(ranking))


def _declared(data: Mapping[str, Any]) -> Sheet:
    effects = _parameters(data["declared"]["effects"])
    sizes: dict[str, Field] = {
        "effect": None,
        "parameter": "name",
        "declared": "value",
        "1 sigma": lambda row: "exact" if (sigma := row["of"]["uncertainty"]) is None else sigma["value"],
        "refitted": None,
        "unit": None,
    }
    runs: dict[str, Field] = {
        "run": "name",
        "direction": None,
        "output torque": lambda run: run["torque"] or "–",
        "samples an output turn": "samples_per_turn",
    }
    return (
        Sentence(data["declared"]["mechanism"] + ("" if effects else "; no effect is declared")),
        *listing(effects, sizes),
        *listing(data["runs"], runs),
    )
