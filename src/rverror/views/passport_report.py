"""The passport of orders for people and for programs: JSON, text, a section of the HTML report."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np

from rverror.base.numbers import brief, in_arcsec, rounded, way
from rverror.base.text import joined
from rverror.base.units import ARCSEC
from rverror.diagnosis.order_passport import DirectionLaw, OrderPassport, SpeedPeak
from rverror.diagnosis.wave_fit import WavePart
from rverror.runs.measuring_chain import BenchUncertainty
from rverror.views.bench_report import BESIDE
from rverror.views.html import escaped, number, scrolled
from rverror.views.svg import Branch, branches

#: N*mm in 1000 N*m, and rad/s in 1000 rpm: slopes are told per so much.
KILONEWTON_METRE, THOUSAND_RPM = 1e6, 1000.0 * math.pi / 30.0
#: Columns of the text.
COLUMNS = 100
#: Orders for which the page draws the amplitude over the torque.
DRAWN = 6
_WIDTH, _HEIGHT = 250, 190  # px of a picture, so wide as a tile of the page
_CURVE = 61  # points of a law
_PARTS = ("constant_arcsec", "per_1000_newton_metre_arcsec", "per_1000_rpm_arcsec", "per_kelvin_arcsec")
_SHARED = {"constant": "constant", "load": "load", "speed": "speed", "temperature": "temperature", "left": "left over"}


def passport_json(passports: Sequence[OrderPassport], *, bench: BenchUncertainty | None = None) -> list[dict[str, Any]]:
    """Passports as plain data for `json.dump`: arcsec, N*m, rpm and degrees, None where not told.

    Parameters
    ----------
    passports : sequence of OrderPassport
    bench : BenchUncertainty, optional
        Of the bench, where it is stated.

    Returns
    -------
    list of dict
        ``phase_deg`` is None where the disc of a part holds zero; ``shares`` are parts of 1;
        ``bench_uncertainty_arcsec`` is that of amplitude and constants, and None where no bench is stated.
    """
    return [_order_json(one, bench) for one in passports]


def _order_json(one: OrderPassport, bench: BenchUncertainty | None) -> dict[str, Any]:
    temperature = one.reference_temperature
    return {
        "order": rounded(one.order, 10),
        "amplitude_arcsec": in_arcsec(one.amplitude),
        "low": in_arcsec(one.low),
        "high": in_arcsec(one.high),
        "bench_uncertainty_arcsec": None if bench is None else in_arcsec(bench.of_order(one.order)),
        "confidence": one.confidence,
        "directions": [_law_json(law) for law in one.laws],
        "constants": None if one.constants is None else one.constants.relation,
        "loads": None if one.loads is None else one.loads.relation,
        "shares": {name: rounded(share, 4) for name, share in one.shares.items()},
        "bent": one.bent,
        "peak": None if one.peak is None else _peak_json(one.peak),
        "reference_input_speed_rpm": rounded(_rpm(one.reference_speed)),
        "reference_temperature_degc": None if temperature is None else rounded(temperature - 273.15),
        "kinds": list(one.kinds),
    }


def _law_json(law: DirectionLaw) -> dict[str, Any]:
    return {
        "direction": way(law.direction),
        "cases": law.cases,
        "constant_arcsec": _part_json(law.constant, 1.0),
        "per_1000_newton_metre_arcsec": _part_json(law.slope, KILONEWTON_METRE),
        "per_1000_rpm_arcsec": _part_json(law.speed, THOUSAND_RPM),
        "per_kelvin_arcsec": _part_json(law.temperature, 1.0),
        "bent": law.bent,
        "largest_deviation_arcsec": in_arcsec(law.deviation),
        "largest_deviation_torque_nm": None if law.deviation_torque is None else rounded(law.deviation_torque / 1e3),
        "not_told": list(law.not_told),
    }


def _part_json(part: WavePart | None, size: float) -> dict[str, Any] | None:
    if part is None:
        return None
    return {
        "amplitude": in_arcsec(part.amplitude * size),
        "phase_deg": rounded(math.degrees(np.angle(part.value))) if part.told else None,
        "low": in_arcsec(part.low * size),
        "high": in_arcsec(part.high * size),
    }


def _peak_json(peak: SpeedPeak) -> dict[str, Any]:
    return {
        "direction": way(peak.direction),
        "torque_nm": None if peak.torque is None else rounded(peak.torque / 1e3),
        "input_speed_rpm": rounded(_rpm(peak.speed)),
        "low_rpm": rounded(_rpm(peak.low)),
        "high_rpm": rounded(_rpm(peak.high)),
        "frequency_hz": rounded(peak.frequency),
        "low_hz": rounded(peak.low_frequency),
        "high_hz": rounded(peak.high_frequency),
        "amplitude_arcsec": in_arcsec(peak.amplitude),
        "median_arcsec": in_arcsec(peak.median),
        "series": peak.series,
        "of": peak.of,
    }


def _rpm(speed: float | None) -> float | None:
    return None if speed is None else speed * 30.0 / math.pi


def passport_text(passports: Sequence[OrderPassport], *, bench: BenchUncertainty | None = None) -> str:
    """Passports as a table of 100 columns, then of each order its shares, its peak and the kinds of causes.

    Parameters
    ----------
    passports : sequence of OrderPassport
    bench : BenchUncertainty, optional
        Of the bench, where it is stated.

    Returns
    -------
    str
        Angles in arcsec.
    """
    return joined(passport_lines(passports, bench=bench))


def passport_lines(passports: Sequence[OrderPassport], *, bench: BenchUncertainty | None = None) -> list[str]:
    """Lines of `passport_text`."""
    if not passports:
        return ["No order is in the cases."]
    percent = f"{100 * passports[0].confidence:g} %"
    lines = [
        f"Orders, arcsec; [{percent} interval] of the size; phase in degrees where the part is told from zero",
        "",
        _row("order", "amplitude", "", "constant", "per 1000 N*m of load", "law"),
    ]
    for one in passports:
        for place, law in enumerate(one.laws):
            head = ("", "") if place else (brief(one.order, 6), _told(one.amplitude, one.low, one.high))
            parts = _with_phase(law.constant, 1.0), _with_phase(law.slope, KILONEWTON_METRE)
            lines.append(_row(*head, way(law.direction), *parts, "bent" if law.bent else ""))
    for one in passports:
        lines += ["", *_wrapped(f"Order {brief(one.order, 6)}: {_shares(one)}", "  ")]
        for words in (*_of_bench(one, bench), *_beside(one), *one.kinds):
            lines += _wrapped(f"  - {words}", "    ")
    return lines


def _wrapped(words: str, indent: str) -> list[str]:
    return textwrap.wrap(words, COLUMNS, subsequent_indent=indent)


def _row(order: str, amplitude: str, direction: str, constant: str, slope: str, law: str) -> str:
    return f"{order:>7s} {amplitude:>18s}  {direction:7s} {constant:>27s} {slope:>27s}  {law:4s}".rstrip()


def _size(value: float) -> str:
    """Arcsec to three digits, or to hundredths below 1: no encoder tells more."""
    return brief(value, 3) if value >= 1.0 else f"{value:.2f}"


def _told(value: float, low: float, high: float, size: float = 1.0) -> str:
    sizes = [_size(one * size / ARCSEC) if math.isfinite(one) else "?" for one in (value, low, high)]
    return f"{sizes[0]} [{sizes[1]}, {sizes[2]}]"


def _with_phase(part: WavePart | None, size: float) -> str:
    if part is None:
        return "not told"
    phase = f" at {round(math.degrees(np.angle(part.value)))}" if part.told else ""
    return _told(part.amplitude, part.low, part.high, size) + phase


def _shares(one: OrderPassport) -> str:
    told = [f"{_SHARED[name]} {100 * share:.0f} %" for name, share in one.shares.items() if share is not None]
    return ", ".join(told) + " of the mean power"


def _beside(one: OrderPassport) -> list[str]:
    """What the table has no room for: temperature and speed, where the law bends, the peak."""
    found = []
    for name, size, unit in (("speed", THOUSAND_RPM, "1000 rpm"), ("temperature", 1.0, "K")):
        told = []
        for law in one.laws:
            part = law.speed if name == "speed" else law.temperature
            if part is not None and part.told:
                told.append(f"{way(law.direction)} {_told(part.amplitude, part.low, part.high, size)}")
        if told:
            found.append(f"with the {name}: {', '.join(told)} per {unit}")
    bends = []
    for law in one.laws:
        if law.bent:
            at = "" if law.deviation_torque is None else f" at {brief(law.deviation_torque / 1e3, 3)} N*m"
            bends.append(f"{way(law.direction)} up to {_size(law.deviation / ARCSEC)}{at}")
    if bends:
        found.append(f"bent, light loads or another law are in it: off the straight line {', '.join(bends)}")
    if one.peak is not None:
        found.append(_peak_words(one.peak))
    return found


def _of_bench(one: OrderPassport, bench: BenchUncertainty | None) -> list[str]:
    """What the bench leaves uncertain of an order."""
    if bench is None:
        return []
    amplitude = bench.of_order(one.order) / ARCSEC
    if not amplitude:
        return ["no stated part of the bench has this order"]
    why = "all of it may be the bench's" if one.amplitude < amplitude * ARCSEC else "the same in every run"
    return [f"amplitude and constant ± {_size(amplitude)} ({BESIDE}), {why}; slopes are free of it"]


def _peak_words(peak: SpeedPeak) -> str:
    speeds = [brief(v * 30.0 / math.pi) for v in (peak.speed, peak.low, peak.high)]
    where = f"largest at {speeds[0]} rpm (between {speeds[1]} and {speeds[2]}"
    if peak.low_frequency is not None and peak.high_frequency is not None:
        where += f", {brief(peak.low_frequency, 3)} to {brief(peak.high_frequency, 3)} Hz"
    sizes = f"{_size(peak.amplitude / ARCSEC)}, median {_size(peak.median / ARCSEC)}"
    return f"{where}): {sizes}; in {peak.series} of {peak.of} series over the speed"


def passport_html(passports: Sequence[OrderPassport], *, bench: BenchUncertainty | None = None) -> str:
    """Passports as a section of an HTML page: a table, pictures of the strongest orders, the kinds of causes.

    Parameters
    ----------
    passports : sequence of OrderPassport
    bench : BenchUncertainty, optional
        Of the bench, where it is stated.

    Returns
    -------
    str
        Elements for `html.document`, whose style they use.
    """
    if not passports:
        return ""
    data = passport_json(passports, bench=bench)
    rows = []
    for one, told in zip(passports, data, strict=True):
        for place, (law, side) in enumerate(zip(one.laws, told["directions"], strict=True)):
            head = ["", ""] if place else [number(told["order"]), _cell(told, "amplitude_arcsec") + _after(told)]
            cells = [escaped(way(law.direction))]
            cells += [_part_cell(side[key]) for key in _PARTS]
            rows.append([*head, *cells, "bent" if law.bent else ""])
    heads = [
        "order",
        "amplitude" + (f" (± {BESIDE})" if bench else ""),
        "direction",
        "constant",
        "per 1000 N*m",
        "per 1000 rpm",
        "per K",
        "law",
    ]
    percent = f"{100 * passports[0].confidence:g} %"
    strongest = [one for one in passports if _has_load(one)][:DRAWN]
    pictures = "".join(f'<figure class="tile">{_picture(one)}</figure>' for one in strongest)
    words = "\n".join(
        f"<li><strong>Order {number(told['order'])}</strong>: "
        f"{escaped('; '.join([_shares(one), *_of_bench(one, bench), *_beside(one)]))}"
        f"<ul>{''.join(f'<li>{escaped(kind)}</li>' for kind in one.kinds)}</ul></li>"
        for one, told in zip(passports, data, strict=True)
    )
    return (
        "<h2>Passport of the orders</h2>\n"
        f"<p>Arcsec, with {percent} intervals of the size and, where a part is told from zero, its phase in degrees. A "
        "law is bent where no straight line over the load holds.</p>\n"
        f"{scrolled(heads, rows, numbers=(0,))}\n"
        + (f'{_KEY}\n<div class="tiles">{pictures}</div>\n' if pictures else "")
        + f"<h3>Which kinds of causes can do that</h3>\n<ul>{words}</ul>"
    )


_KEY = (
    '<p class="key"><span><svg width="40" height="12" viewBox="0 0 40 12" aria-hidden="true">'
    '<path class="after" d="M0 6H40M17 6a3 3 0 1 0 6 0a3 3 0 1 0-6 0z"/></svg>forward</span>'
    '<span><svg width="40" height="12" viewBox="0 0 40 12" aria-hidden="true">'
    '<path class="before" stroke-dasharray="6 4" d="M0 6H40"/><path class="before" d="M17 3h6v6h-6z"/></svg>reverse'
    "</span><span>marks: measured; lines: constant and load part</span></p>"
)


def _cell(told: dict[str, Any], key: str) -> str:
    high = "?" if told["high"] is None else number(told["high"])
    return f"{number(told[key])} [{number(told['low'])}, {high}]"


def _after(told: dict[str, Any]) -> str:
    stated = told["bench_uncertainty_arcsec"]
    return "" if stated is None else f" ± {number(stated)}"


def _part_cell(told: dict[str, Any] | None) -> str:
    if told is None:
        return "–"
    phase = "" if told["phase_deg"] is None else f" at {number(told['phase_deg'])}°"
    return _cell(told, "amplitude") + phase


def _has_load(one: OrderPassport) -> bool:
    return any(law.slope is not None for law in one.laws)


def _picture(one: OrderPassport) -> str:
    drawn = []
    for law in one.laws:
        if law.slope is None:
            continue
        torque = np.linspace(0.0, float(law.torque.max()), _CURVE)
        size = np.abs(law.constant.value + law.slope.value * torque)
        drawn.append(
            Branch(
                look="after" if law.direction > 0 else "before",
                dashed=law.direction < 0,
                points=(law.torque / 1e3, np.abs(law.waves) / ARCSEC),
                line=(torque / 1e3, size / ARCSEC),
            )
        )
    return branches(
        drawn,
        width=_WIDTH,
        height=_HEIGHT,
        title=f"Amplitude of order {brief(one.order, 6)} over the output torque",
        label=f"order {brief(one.order, 6)}, arcsec",
        caption="output torque, N*m",
    )
