"""A contact correction for people and for programs: text and JSON."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from rverror.base.numbers import interval
from rverror.base.text import joined
from rverror.base.units import ARCSEC, named_core
from rverror.tolerances.control_variate import LEVELS, SIZES, ContactCorrection, ControlVariate, Corrected
from rverror.views.envelope import InputFile, enveloped


def contact_text(found: ContactCorrection, *, limit: Any | None = None) -> str:
    """Contact correction as text, angles in arcsec; the yield is told at a limit of the peak-to-peak, as a quantity."""
    return joined(contact_lines(found, limit=_limit(limit)))


def contact_lines(found: ContactCorrection, *, limit: float | None = None) -> list[str]:
    """Lines of `contact_text`."""
    whole, mean = found.peak_to_peak, found.peak_to_peak.mean()
    lines = [
        f"At {found.torque / 1e3:g} N*m: {whole.dear.size} of {found.count} units solved with contacts that open, at "
        f"{found.points} angles (half as many change a peak-to-peak by {found.thinning / ARCSEC:+.2g}, at most "
        f"{found.thinning_most / ARCSEC:.2g})",
        f"Mean peak-to-peak {_told(mean)} (95 % interval of the estimate), {mean.correction / ARCSEC:+.3g} "
        f"({100 * mean.relative:+.3g} %) beside the linear one; correlation {whole.correlation:.2f}, worth "
        f"{whole.variance_reduction:.3g} times as many units",
        "",
        f"{'':14s} {'':>5s} {'linear':>8s} {'at the load [95 %]':>26s} {'change':>8s}",
    ]
    for name in SIZES:
        by = {"mean": getattr(found, name).mean()} | {
            f"P{level * 100:g}": getattr(found, name).quantile(level) for level in LEVELS
        }
        for i, (statistic, one) in enumerate(by.items()):
            head = "" if i else name.replace("_", "-")
            lines.append(
                f"{head:14s} {statistic:>5s} {one.linear / ARCSEC:8.4g} {_told(one):>26s} "
                f"{one.correction / ARCSEC:+8.3g}"
            )
    if limit is not None:
        share = whole.yield_at(limit)
        lines += [
            "",
            f"Yield at {limit / ARCSEC:g} arcsec peak-to-peak: {100 * share.value:.4g} % [{100 * share.low:.4g}, "
            f"{100 * share.high:.4g}] (95 % interval of the estimate), linear {100 * share.linear:.4g} %",
        ]
    if found.failures:
        lines += ["", f"{len(found.failures)} of {found.count} units have no equilibrium and are in no figure:"]
        lines += [f"  {failure}" for failure in found.failures]
    return lines


def contact_json(
    found: ContactCorrection, *, limit: Any | None = None, files: Sequence[InputFile] = ()
) -> dict[str, Any]:
    """Contact correction as plain data for `json.dump`: angles in arcsec, None where not determined."""
    return enveloped("ContactCorrection", contact_content(found, limit=_limit(limit)), files)


def contact_content(found: ContactCorrection, *, limit: float | None = None) -> dict[str, Any]:
    """What `contact_json` tells, without its envelope."""
    sizes: dict[str, Any] = {}
    for name in SIZES:
        one: ControlVariate = getattr(found, name)
        sizes[f"{name}_arcsec"] = {
            "mean": _as_json(one.mean(), ARCSEC),
            **{f"p{level * 100:g}": _as_json(one.quantile(level), ARCSEC) for level in LEVELS},
            "correlation": _determined(one.correlation),
            "slope": _determined(one.slope),
            "variance_reduction": _determined(one.variance_reduction),
        }
    return {
        "torque_nm": found.torque / 1e3,
        "units": found.count,
        "failed": len(found.failures),
        "failures": list(found.failures),
        "angles": found.points,
        "thinning_arcsec": found.thinning / ARCSEC,
        "largest_thinning_arcsec": found.thinning_most / ARCSEC,
        "lag_arcsec": found.lag / ARCSEC,
        **sizes,
        "yield": None if limit is None else _as_json(found.peak_to_peak.yield_at(limit), 1.0),
    }


def _limit(given: Any | None) -> float | None:
    return None if given is None else named_core("limit", given, "angle")


def _told(one: Corrected) -> str:
    return interval(one.value, low=one.low, high=one.high)


def _as_json(one: Corrected, unit: float) -> dict[str, float | None]:
    names = ("value", "low", "high", "linear", "correction")
    return {name: _determined(getattr(one, name) / unit) for name in names} | {"relative": _determined(one.relative)}


def _determined(value: float) -> float | None:
    return value if math.isfinite(value) else None
