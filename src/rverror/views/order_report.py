"""Orders over load and speed: the passports and natural frequencies that a diagnosis tells."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from rverror.base.numbers import brief, rounded, way
from rverror.base.units import ARCSEC
from rverror.diagnosis.order_passport import OrderPassport
from rverror.diagnosis.orders.resonances import Resonance
from rverror.diagnosis.wave_fit import DirectionLaw, WavePart
from rverror.runs.measuring_chain import BenchUncertainty
from rverror.views.bench_report import of_orders, order_json
from rverror.views.fields import OWN, Field, entry, rows, same_unit, sized
from rverror.views.shown_units import ANGLE, HERTZ, NUMBER, PERCENT, POSITION, SPEED, TEMPERATURE, Unit
from rverror.views.variables import Variable

_PER_LOAD = Unit("rad/(N*mm)", "arcsec/(kN*m)", ARCSEC / 1e6)
_PER_SPEED = Unit("s", "arcsec/krpm", ARCSEC * 30 / (1000 * math.pi))
_PER_KELVIN = Unit("rad/kelvin", "arcsec/kelvin", ARCSEC)
#: Parts of an order's law: name in the code, name for people, unit, key in JSON.
_PARTS = (
    ("constant", "constant", ANGLE, "constant_arcsec"),
    ("slope", "with_load", _PER_LOAD, "per_1000_newton_metre_arcsec"),
    ("speed", "with_speed", _PER_SPEED, "per_1000_rpm_arcsec"),
    ("temperature", "with_temperature", _PER_KELVIN, "per_kelvin_arcsec"),
)


def _phase(part: WavePart | None) -> float:
    """Phase of a part, rad; not a number where its disc holds zero."""
    return float(np.angle(part.value)) if part is not None and part.significant else math.nan


def passports(found: Sequence[OrderPassport], bench: BenchUncertainty | None = None) -> dict[str, Variable]:
    """Passports as variables: the law of each order and direction, and of each order its shares.

    Parameters
    ----------
    found : sequence of OrderPassport
    bench : BenchUncertainty, optional
        Of the bench, where it is stated.
    """
    laws: dict[str, Field] = {"order": ("0.order", NUMBER), "direction": lambda row: way(row[1].direction)}
    for name, words, unit, _ in _PARTS:
        laws |= sized(words, unit, f"1.{name}", "amplitude")
        laws[f"{words}_phase"] = (f"2.{name}", POSITION)
    laws["off_a_straight_line"] = "1.bent"
    sizes = sized("amplitude", ANGLE, value="amplitude") | of_orders(bench)
    shares = same_unit(PERCENT, "constant", "load", "speed", "temperature", "left", within="shares.")
    each = [(one, law, {name: _phase(getattr(law, name)) for name, *_ in _PARTS}) for one in found for law in one.laws]
    return {
        **rows("passport", found, "passport_", order=NUMBER, **sizes),
        **rows("passport", found, "passport_share_", **shares),
        **rows("law", each, "law_", **laws),
    }


def kinds_of_causes(found: Sequence[OrderPassport]) -> list[str]:
    """A sentence for each kind of causes that an order may come from."""
    return [f"Order {brief(one.order, 6)}: {kind}." for one in found for kind in one.kinds]


def passport_json(found: Sequence[OrderPassport], *, bench: BenchUncertainty | None = None) -> list[dict[str, Any]]:
    """Passports as plain data for `json.dump`: arcsec, N*m, rpm and degrees, None where not told.

    Parameters
    ----------
    found : sequence of OrderPassport
    bench : BenchUncertainty, optional
        Of the bench, where it is stated.

    Returns
    -------
    list of dict
        ``phase_deg`` is None where the disc of a part holds zero; ``shares`` are parts of 1;
        ``bench_uncertainty_arcsec`` is that of amplitude and constants, and None where no bench is stated.
    """
    return [
        {
            **entry(
                one,
                amplitude_arcsec=("amplitude", ANGLE),
                **same_unit(ANGLE, "low", "high"),
                **same_unit(None, "bent", "kinds"),
                constants="constants.relation",
                loads="loads.relation",
                shares=NUMBER,
                reference_input_speed_rpm=("reference_speed", SPEED),
                reference_temperature_degc=("reference_temperature", TEMPERATURE),
            ),
            "order": rounded(one.order, 10),
            **order_json(bench, one.order),
            "directions": [_law_json(law) for law in one.laws],
        }
        for one in found
    ]


def _law_json(law: DirectionLaw) -> dict[str, Any]:
    of_part = same_unit(OWN, "amplitude", "low", "high") | {"phase_deg": (_phase, POSITION)}
    parts = {key: (getattr(law, name), unit) for name, _, unit, key in _PARTS}
    return {
        "direction": way(law.direction),
        **{key: None if part is None else entry(part, unit, **of_part) for key, (part, unit) in parts.items()},
        **entry(law, **same_unit(None, "cases", "bent", "not_determined")),
    }


def resonances_json(found: Sequence[Resonance]) -> list[dict[str, Any]]:
    """Natural frequencies as plain data for `json.dump`: Hz, with 95 % intervals; None where a bound is not told.

    Parameters
    ----------
    found : sequence of Resonance
    """
    sizes = same_unit(NUMBER, "low", "high", "damping_ratio")
    return [entry(one, frequency_hz=("frequency", NUMBER), **sizes) for one in found]


def resonances(found: Sequence[Resonance]) -> dict[str, Variable]:
    """Natural frequencies with their orders, and for each order its own one and the speed at which it is largest."""
    peaks = [(order, alone, _largest_at(one, order)) for one in found for order, alone in one.alone.items()]
    return {
        **rows(
            "resonance",
            found,
            "resonance_",
            **sized("frequency", HERTZ, value="frequency"),
            damping_ratio=NUMBER,
            damping_ratio_low=("damping_low", NUMBER),
            damping_ratio_high=("damping_high", NUMBER),
            orders=None,
        ),
        **rows("peak", peaks, "peak_", order=("0", NUMBER), alone=("1", HERTZ), largest_at=("2", SPEED)),
    }


def _largest_at(one: Resonance, order: float) -> float:
    """Input speed at which an order is largest, rad/s."""
    waves = np.concatenate([own.waves for own in one.series if own.order == order])
    speeds = np.concatenate([own.speed for own in one.series if own.order == order])
    return float(speeds[np.argmax(np.abs(waves))])


def alone(found: Sequence[Resonance]) -> str:
    """What is to be doubted of a frequency that one order alone shows."""
    orders = ", ".join(f"{one.orders[0]:g}" for one in found if len(one.orders) == 1)
    return f"Order {orders} alone shows it: what happens at that speed would look the same." if orders else ""
