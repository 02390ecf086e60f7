"""The passport of orders for people and for programs."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from rverror.base.numbers import brief, in_arcsec, rounded, way
from rverror.base.units import ARCSEC
from rverror.diagnosis.order_passport import OrderPassport
from rverror.diagnosis.wave_fit import CONFIDENCE, DirectionLaw, WavePart
from rverror.runs.measuring_chain import BenchUncertainty
from rverror.views.bench_report import BESIDE
from rverror.views.blocks import Sentence, Sheet, grid
from rverror.views.fields import alike, entry
from rverror.views.variables import ANGLE, SPEED

#: N*mm in 1000 N*m, and rad/s in 1000 rpm: slopes are told per so much.
KILONEWTON_METRE, THOUSAND_RPM = 1e6, 1000.0 * math.pi / 30.0
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
        **entry(
            one,
            amplitude_arcsec=("amplitude", ANGLE),
            **alike(ANGLE, "low", "high"),
            **alike(None, "bent", "kinds"),
            constants="constants.relation",
            loads="loads.relation",
            reference_input_speed_rpm=("reference_speed", SPEED),
        ),
        "order": rounded(one.order, 10),
        "bench_uncertainty_arcsec": None if bench is None else in_arcsec(bench.of_order(one.order)),
        "directions": [_law_json(law) for law in one.laws],
        "shares": {name: rounded(share, 4) for name, share in one.shares.items()},
        "reference_temperature_degc": None if temperature is None else rounded(temperature - 273.15),
    }


def _law_json(law: DirectionLaw) -> dict[str, Any]:
    return {
        "direction": way(law.direction),
        "constant_arcsec": _part_json(law.constant, 1.0),
        "per_1000_newton_metre_arcsec": _part_json(law.slope, KILONEWTON_METRE),
        "per_1000_rpm_arcsec": _part_json(law.speed, THOUSAND_RPM),
        "per_kelvin_arcsec": _part_json(law.temperature, 1.0),
        **entry(law, **alike(None, "cases", "bent", "not_told")),
    }


def _part_json(part: WavePart | None, size: float) -> dict[str, Any] | None:
    if part is None:
        return None
    sizes = {name: in_arcsec(getattr(part, name) * size) for name in ("amplitude", "low", "high")}
    return {**sizes, "phase_deg": rounded(math.degrees(np.angle(part.value))) if part.told else None}


def passport_sheet(passports: Sequence[OrderPassport], *, bench: BenchUncertainty | None = None) -> Sheet:
    """Passports as a table of laws, then of each order its shares, its peak and the kinds of causes.

    Parameters
    ----------
    passports : sequence of OrderPassport
    bench : BenchUncertainty, optional
        Of the bench, where it is stated.
    """
    if not passports:
        return (Sentence("No order is in the cases."),)
    rows = []
    for one in passports:
        for place, law in enumerate(one.laws):
            head = ("", "") if place else (brief(one.order, 6), _told(one.amplitude, one.low, one.high))
            parts = _with_phase(law.constant, 1.0), _with_phase(law.slope, KILONEWTON_METRE)
            rows.append((*head, way(law.direction), *parts, "bent" if law.bent else ""))
    return (
        Sentence(
            f"Amplitudes in arcsec with the {100 * CONFIDENCE:g} % interval; phase in degrees where the "
            "part is told from zero; a law is bent where no straight line over the load holds."
        ),
        *grid(("order", "amplitude", "direction", "constant", "per 1000 N*m", "law"), rows),
        *(Sentence(words) for one in passports for words in _words(one, bench)),
    )


def _words(one: OrderPassport, bench: BenchUncertainty | None) -> Iterator[str]:
    """Sentences on one order."""
    yield f"Order {brief(one.order, 6)}: {'; '.join([_shares(one), *_of_bench(one, bench), *_beside(one)])}."
    yield from (f"Order {brief(one.order, 6)} may come from: {kind}." for kind in one.kinds)


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
    """What the table has no room for: temperature and speed."""
    found = []
    for name, size, unit in (("speed", THOUSAND_RPM, "1000 rpm"), ("temperature", 1.0, "K")):
        told = []
        for law in one.laws:
            part = law.speed if name == "speed" else law.temperature
            if part is not None and part.told:
                told.append(f"{way(law.direction)} {_told(part.amplitude, part.low, part.high, size)}")
        if told:
            found.append(f"with the {name}: {', '.join(told)} per {unit}")
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
