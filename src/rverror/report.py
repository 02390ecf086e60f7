"""A diagnosis for people and for programs: text, JSON and one HTML page."""

from __future__ import annotations

import html
import math
from typing import Any

from rverror import units
from rverror.diagnose import Addition, Diagnosis, Residual, describe
from rverror.units import ARCSEC

_VERDICTS = {
    "explained": "explained: what was added accounts for all that is significant",
    "nothing_missing": "nothing missing: the declared model accounts for all that is significant",
    "unexplained": "unexplained: significant lines remain that no candidate accounts for",
}
_NEXT_STEPS = {
    "reverse": "a run in reverse: causes that share an order differ in it",
    "load": "runs at another load: contacts open differently, which tells parts of one frame apart",
    "encoder": "the output encoder remounted by 90 degrees: its own error turns with it, the gear's does not",
}


def _arcsec(value: float) -> float:
    return value / ARCSEC


def _number(value: float, digits: int = 6) -> float | None:
    return float(f"{value:.{digits}g}") if math.isfinite(value) else None


def _residual_json(residual: Residual) -> dict[str, float | None]:
    return {
        "rms_arcsec": _number(_arcsec(residual.rms)),
        "peak_to_peak_arcsec": _number(_arcsec(residual.peak_to_peak)),
        "heldout_rms_arcsec": _number(_arcsec(residual.heldout_rms)),
    }


def _addition_json(addition: Addition) -> dict[str, Any]:
    parameters = {}
    for estimate in addition.estimates:
        parameters[estimate.name] = {
            "value": _number(units.to_display(estimate.value, estimate.dimension)),
            "unit": units.DISPLAY_UNITS[estimate.dimension],
            "low": _number(units.to_display(estimate.low, estimate.dimension)),
            "high": _number(units.to_display(estimate.high, estimate.dimension)),
        }
    return {
        "key": addition.effect.key,
        "indices": dict(addition.effect.indices),
        "parameters": parameters,
        "indistinguishable_from": [
            {"key": key, "indices": dict(indices)} for key, indices in addition.indistinguishable
        ],
        "orders": [_number(order) for order in addition.orders],
        "heldout_rms_arcsec": _number(_arcsec(addition.heldout_rms)),
        "notes": list(addition.notes),
    }


def to_json(diagnosis: Diagnosis) -> dict[str, Any]:
    """Diagnosis as plain data for `json.dump`; keys are only ever added.

    Parameters
    ----------
    diagnosis : Diagnosis

    Returns
    -------
    dict
        Sizes in arcsec and um; numbers that are not determined are None.
    """
    return {
        "verdict": diagnosis.verdict,
        "noise_rms_arcsec": _number(_arcsec(diagnosis.noise_rms)),
        "before": _residual_json(diagnosis.before),
        "before_refitted": _residual_json(diagnosis.before_refitted),
        "after": _residual_json(diagnosis.after),
        "added": [_addition_json(addition) for addition in diagnosis.added],
        "unexplained_orders": [
            {
                "order": _number(line.order),
                "amplitude_arcsec": _number(_arcsec(line.amplitude)),
                "low": _number(_arcsec(line.low)),
                "high": _number(_arcsec(line.high)),
                "frames": list(line.frames),
            }
            for line in diagnosis.unexplained
        ],
        "candidates": [
            {"key": c.key, "indices": dict(c.indices), "heldout_gain": _number(c.heldout_gain)}
            for c in diagnosis.candidates
        ],
        "candidates_tried": diagnosis.tried,
        "notes": list(diagnosis.notes),
    }


def to_text(diagnosis: Diagnosis) -> str:
    """Diagnosis as a text report.

    Parameters
    ----------
    diagnosis : Diagnosis

    Returns
    -------
    str
        Ends with a line end.
    """
    lines = [f"Verdict: {_VERDICTS[diagnosis.verdict]}", ""]
    declared = diagnosis.declared
    lines.append(f"Declared: {declared.name or declared.mechanism.name}, {len(declared.effects)} effects")
    for trace in diagnosis.traces:
        lines.append(f"Run: {trace.name}, {'forward' if trace.direction > 0 else 'reverse'}")
    lines += ["", f"{'residual, arcsec':<26}{'rms':>9}{'peak-to-peak':>15}{'held-out rms':>15}"]
    for label, residual in (
        ("before (as declared)", diagnosis.before),
        ("before, sizes refitted", diagnosis.before_refitted),
        ("after", diagnosis.after),
    ):
        rms, peak, heldout = (_arcsec(x) for x in (residual.rms, residual.peak_to_peak, residual.heldout_rms))
        lines.append(f"{label:<26}{rms:>9.3f}{peak:>15.2f}{heldout:>15.3f}")
    lines.append(f"{'noise between revolutions':<26}{_arcsec(diagnosis.noise_rms):>9.3f}")
    for number, addition in enumerate(diagnosis.added, 1):
        lines += ["", *_addition_lines(number, addition)]
    if diagnosis.unexplained:
        lines += ["", "Lines that remain (order per output turn, amplitude with 95 % interval, frames that it fits)"]
        for line in diagnosis.unexplained[:12]:
            size = f"{_arcsec(line.amplitude):.3f} arcsec [{_arcsec(line.low):.3f}, {_arcsec(line.high):.3f}]"
            frames = "; ".join(line.frames) or "no frame of this drive: not in the catalogue"
            lines.append(f"  {line.order:>8.6g}  {size}  {frames}")
        if len(diagnosis.unexplained) > 12:
            lines.append(f"  and {len(diagnosis.unexplained) - 12} more")
        lines += ["", *_missing_lines(diagnosis)]
    if diagnosis.candidates:
        lines += ["", f"Best of {diagnosis.tried} candidates in the last round (held-out gain in chi-square, linear)"]
        for candidate in diagnosis.candidates[:5]:
            lines.append(f"  {candidate.heldout_gain:>10.1f}  {describe(candidate.key, candidate.indices)}")
    if diagnosis.notes:
        lines += ["", "Notes", *(f"  {note}" for note in diagnosis.notes)]
    return "\n".join(lines) + "\n"


def _addition_lines(number: int, addition: Addition) -> list[str]:
    lines = [f"Added {number}: {describe(addition.effect.key, addition.effect.indices)}"]
    for estimate in addition.estimates:
        sizes = (estimate.value, estimate.low, estimate.high)
        value, low, high = (units.to_display(size, estimate.dimension) for size in sizes)
        interval = f"95 % [{low:.3f}, {high:.3f}]" if math.isfinite(low) else "not determined by these runs"
        lines.append(f"  {estimate.name:<12}{value:>10.3f} {units.DISPLAY_UNITS[estimate.dimension]:<8}{interval}")
    orders = ", ".join(f"{order:g}" for order in addition.orders)
    lines.append(f"  at orders {orders}; held-out rms {_arcsec(addition.heldout_rms):.3f} arcsec once added")
    if addition.indistinguishable:
        names = ", ".join(describe(key, indices) for key, indices in addition.indistinguishable)
        lines.append(f"  these runs cannot tell it from: {names}")
        lines.append(f"  to separate them, measure {_NEXT_STEPS['load']}")
    if addition.effect.key.startswith("sensor.encoder"):
        lines.append(f"  to prove it, measure with {_NEXT_STEPS['encoder']}")
    return lines + [f"  note: {note}" for note in addition.notes]


def _missing_lines(diagnosis: Diagnosis) -> list[str]:
    lines = [
        "The remaining lines fit no source of the catalogue. Profile modification is not among the candidates yet.",
        "An effect of your own is one function and one catalogue entry: see docs/adding-an-effect.md.",
    ]
    if len({trace.direction for trace in diagnosis.traces}) == 1:
        lines.append(f"Measure {_NEXT_STEPS['reverse']}.")
    return lines


def to_html(diagnosis: Diagnosis, figures: list[str]) -> str:
    """Diagnosis as one HTML page that needs nothing else.

    Parameters
    ----------
    diagnosis : Diagnosis
    figures : list of str
        SVG elements to show, as text.

    Returns
    -------
    str
    """
    title = f"rverror: {diagnosis.verdict.replace('_', ' ')}"
    pictures = "\n".join(f"<figure>{figure}</figure>" for figure in figures)
    return f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{html.escape(title)}</title>
<style>
body {{ margin: 0 auto; max-width: 62rem; padding: 1rem; font-family: system-ui, sans-serif; }}
body {{ color: #1a1a1a; background: #fff; }}
pre {{ overflow-x: auto; white-space: pre-wrap; font-size: 0.85rem; line-height: 1.4; }}
figure {{ margin: 1rem 0; background: #fff; }}
figure svg {{ width: 100%; height: auto; }}
@media (prefers-color-scheme: dark) {{ body {{ color: #eee; background: #16181c; }} }}
</style>
</head>
<body>
<h1>{html.escape(title)}</h1>
{pictures}
<pre>{html.escape(to_text(diagnosis))}</pre>
</body>
</html>
"""
