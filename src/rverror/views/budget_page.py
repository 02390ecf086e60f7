"""A budget and an allocation as one HTML page each: every number is one of the JSON's, every text is escaped here."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rverror.base.numbers import brief, count_of, rounded
from rverror.base.units import ARCSEC
from rverror.tolerances.allocation import Allocation
from rverror.tolerances.full_budget import ErrorBudget
from rverror.views.budget_report import (
    OF_ESTIMATE,
    allocation_json,
    allocation_text,
    budget_json,
    budget_text,
    limited_by,
    within,
)
from rverror.views.envelope import InputFile
from rverror.views.html import document, escaped, escaped_lines, inputs, number, scrolled, tiles
from rverror.views.svg import Bar, bars, histogram

Data = Mapping[str, Any]

_WIDTHS = {"wide": 760, "narrow": 340}
_SHOWN = 15  # bars for which there is room
_TOLD = ("p50", "p95", "p99")
_SIZES = {
    "peak_to_peak_arcsec": "peak-to-peak",
    "max_arcsec": "largest distance from the offset",
    "rms_arcsec": "rms",
    "offset_arcsec": "offset",
}


def budget_html(found: ErrorBudget, *, limit: float | None = None, files: Sequence[InputFile] = ()) -> str:
    """Budget as one HTML page that needs nothing else.

    Parameters
    ----------
    found : ErrorBudget
    limit : float, optional
        Of the peak-to-peak, rad: the yield is told at it.
    files : sequence of InputFile, optional
        What it was made from.

    Returns
    -------
    str

    Examples
    --------
    >>> import rverror
    >>> cams = [rverror.tolerance("crank.eccentricity", "5 um")]
    >>> found = rverror.error_budget(rverror.Model(rverror.reducer("RV-40E")), cams, count=512, index_count=0)
    >>> "What each tolerance contributes" in budget_html(found)
    True
    """
    data = budget_json(found, limit=limit, files=files)
    sizes = found.units.peak_to_peak / ARCSEC
    sections = [
        _budget_head(data),
        _figure("What each tolerance contributes", *_contribution_pictures(data)),
        _contributions(data),
        _figure("Peak-to-peak of the units", *_distribution_pictures(data, sizes)),
        _quantiles(data),
        _at_load(data["limits"], data.get("all_limits")),
        _loaded_shares(data["limits"]),
        inputs(data["inputs"], data["version"]),
        _as_text(budget_text(found, limit=limit)),
    ]
    return document(f"rverror: error budget of {data['model']}", "\n".join(part for part in sections if part))


def allocation_html(found: Allocation, *, files: Sequence[InputFile] = ()) -> str:
    """Allocation as one HTML page that needs nothing else.

    Parameters
    ----------
    found : Allocation
    files : sequence of InputFile, optional
        What it was made from.

    Returns
    -------
    str

    Examples
    --------
    >>> import rverror
    >>> unit = rverror.Model(rverror.reducer("RV-40E"))
    >>> cams = rverror.stack(unit, [rverror.tolerance("crank.eccentricity", "5 um")])
    >>> costs = [rverror.costs.Reciprocal(12.0, 0.005)]
    >>> found = rverror.allocate(cams, costs, limit="37 arcsec", kind="worst", verify=1000)
    >>> "What holds each tolerance" in allocation_html(found)
    True
    """
    data = allocation_json(found, files=files)
    sections = [
        _allocation_head(found, data),
        _at_load(data["verified"], data.get("all_limits")),
        _figure("Cost of each tolerance", *_cost_pictures(data)),
        _entries(data),
        _rates(data),
        f"<h2>How good it is</h2>\n<p>{escaped(data['proof'])}.</p>",
        inputs(data["inputs"], data["version"]),
        _as_text(allocation_text(found)),
    ]
    return document("rverror: tolerances of least cost", "\n".join(part for part in sections if part))


# --- the budget --------------------------------------------------------------------------------------------------


def _budget_head(data: Data) -> str:
    p99 = data["peak_to_peak_arcsec"]["p99"]
    entries = data["contributions"]
    first = max(entries, key=lambda entry: entry["share_of_variance"])
    said = f"99 % of the units stay within {brief(p99['value'])} arcsec peak-to-peak (95 % interval of this estimate "
    said += f"{_ends(p99)}). " + (
        f"{first['label']} makes most of it, {round(100 * first['share_of_variance'])} % of the variance."
        if first["share_of_variance"]
        else "No tolerance moves more than the offset."
    )
    for one in data["limits"]:
        said += f" At the load, contacts that open included, P99 of the {_named(one)} is {brief(one['p99']['value'])} "
        said += f"{one['unit']} (interval {_ends(one['p99'])})."
    good = data["yield"]
    boxes = [
        ("P99 of the peak-to-peak, 95 % interval of the estimate", f"{number(p99['value'])} arcsec [{_ends(p99)}]"),
        ("worst case, all parts at their limits", f"{number(data['peak_to_peak_arcsec']['worst_case'])} arcsec"),
        ("limit of the peak-to-peak", "none given" if good is None else f"{number(data['limit_arcsec'])} arcsec"),
        (
            "yield at the limit, 95 % interval of the estimate",
            "–"
            if good is None
            else f"{_percent(good['value'])} % [{_percent(good['low'])} to {_percent(good['high'])}]",
        ),
    ]
    speed = data["input_speed_rpm"]
    about = [
        data["model"],
        data["direction"],
        "closed form, contacts closed" if speed is None else "",
        "" if speed is None else f"input at {brief(speed)} rpm",
        f"{count_of(len(entries), 'tolerance')}, {count_of(data['components'], 'component')}",
        f"{data['units']} virtual units, seed {data['seed']}",
    ]
    return _head(f"Error budget of {data['model']}", about, said, boxes)


def _contributions(data: Data) -> str:
    heads = ["tolerance", "fixed in", "orders", "T", "limits", "unit", "share of variance, %"]
    heads += ["p-p of 1 unit, arcsec", "Sobol index, total", "± (half of 95 % interval)", "worst alone, arcsec"]
    heads += ["part of the worst case, arcsec"]
    rows = []
    for one in sorted(data["contributions"], key=lambda entry: -entry["share_of_variance"]):
        total = _sobol(one)
        two = one["lower_limit"] is not None
        rows.append(
            [
                f"<code>{escaped(one['label'])}</code>",
                escaped(one["frame"]),
                escaped(_orders(one["orders"])),
                number(one["width"]),
                f"{number(one['lower_limit'])} to {number(one['upper_limit'])}" if two else "within T",
                escaped(one["unit"]),
                number(round(100 * one["share_of_variance"], 1)),
                number(one["peak_to_peak_per_unit_arcsec"]),
                number(None if total is None else total["value"]),
                number(None if total is None else rounded((total["high"] - total["low"]) / 2, 3)),
                number(one["worst_peak_to_peak_alone_arcsec"]),
                number(one["part_of_worst_case_arcsec"]),
            ]
        )
    quiet = [one["label"] for one in data["contributions"] if one["effect"] != "wave"]
    told = f"<p>In closed form moves the offset alone, or nothing: {escaped(', '.join(quiet))}.</p>" if quiet else ""
    return (
        scrolled(heads, rows, numbers=(3, *range(6, 12)))
        + told
        + '<p class="soft">T: half of what the limits leave, or the longest vector. Share of variance: of the mean '
        "square over the turn. p-p of 1 unit: sensitivity, the largest of one component. Sobol index: of the "
        "peak-to-peak, alone and together with others; none where a tolerance is correlated with another; its interval "
        f"is the {OF_ESTIMATE}.</p>"
    )


def _sobol(entry: Data) -> Data | None:
    """Total index of a contribution; None where it has none."""
    total: Data | None = entry["sobol_total"]
    return None if total is None or total["value"] is None or entry["effect"] != "wave" else total


def _orders(orders: Sequence[float]) -> str:
    few = ", ".join(brief(order, 6) for order in orders[:4])
    return f"{few}, … ({len(orders)})" if len(orders) > 4 else few or "–"


def _contribution_pictures(data: Data) -> tuple[list[str], list[tuple[str, str]]]:
    moving = [one for one in data["contributions"] if one["effect"] == "wave"]
    moving = sorted(moving, key=lambda one: -one["share_of_variance"])[:_SHOWN]
    rows, told = [], False
    for one in moving:
        own = [Bar(look="after", value=100 * one["share_of_variance"])]
        total = _sobol(one)
        if total is not None:
            value, low, high = (100 * total[name] for name in ("value", "low", "high"))
            own.append(Bar(look="before", value=value, low=low, high=high))
            told = True
        rows.append((one["label"], own))
    key = [("after", "share of the variance")]
    key += [("before", f"total Sobol index of the peak-to-peak, with the {OF_ESTIMATE}")] if told else []
    if not rows:
        return [], []
    title = "share of each tolerance"
    return [bars(rows, width=width, title=title, caption="contribution, %") for width in _WIDTHS.values()], key


def _distribution_pictures(data: Data, sizes: Any) -> tuple[list[str], list[tuple[str, str]]]:
    if not np.ptp(sizes) > 1e-9:
        return [], []
    lines = [("level", data["peak_to_peak_arcsec"][p]["value"], p.upper()) for p in _TOLD]
    lines = [(look, place, f"{name} {brief(place)}") for look, place, name in lines]
    if data["limit_arcsec"] is not None:
        good = data["yield"]
        name = f"limit {brief(data['limit_arcsec'])}: {_percent(good['value'])} % within"
        lines.append(("limit", data["limit_arcsec"], name))
    said = {"title": "distribution of the peak-to-peak", "label": "share of the units per arcsec"}
    caption = "peak-to-peak, arcsec"
    return [histogram(sizes, lines, width=width, caption=caption, **said) for width in _WIDTHS.values()], []


def _quantiles(data: Data) -> str:
    rows = []
    for key, name in _SIZES.items():
        one = data[key]
        told = [f"{number(one[p]['value'])} [{_ends(one[p])}]" for p in _TOLD]
        rows.append([name, number(one["nominal"]), *told, number(one["worst_case"])])
    heads = ["arcsec", "nominal", *(f"{p.upper()} [95 % interval]" for p in _TOLD), "worst case"]
    return scrolled(heads, rows, numbers=range(1, 6)) + (
        f'<p class="soft">P99: what 99 % of the units do not exceed. [..]: {OF_ESTIMATE}, of {data["units"]} drawn '
        "units; it tells how well the quantile is known, not how far units scatter. Nominal: all toleranced values at "
        "their means.</p>"
    )


def _named(entry: Data) -> str:
    """Quantity and torque of a limit."""
    return str(entry["quantity"]).replace("_", " ") + ("" if entry["torque"] is None else f" at {entry['torque']}")


def _at_load(entries: Sequence[Data], together: Data | None) -> str:
    """Limits at the load, with yields."""
    if not entries:
        return ""
    rows, closed_head = [], [""] if "closed_form_yield" in entries[0] else []
    for one in entries:
        told = "–" if one["yield"] is None else _yield(one["yield"], one["interval"])
        closed = [one["closed_form_yield"]] if "closed_form_yield" in one else []
        rows.append(
            [
                escaped(_named(one)),
                escaped(one["limit"] or "–"),
                *(number(one[p]["value"]) for p in _TOLD),
                escaped(one["unit"]),
                told,
                *("–" if share is None else f"{_percent(share)} %" for share in closed),
            ]
        )
    if len(entries) > 1 and together is not None and together["yield"] is not None:
        rows.append(["all limits together", *[""] * 5, _yield(together["yield"], together["interval"]), *closed_head])
    heads = ["at the load", "limit", *(p.upper() for p in _TOLD), "unit", "yield [interval]"]
    heads += ["yield in closed form"] if closed_head else []
    return (
        "<h2>At the load, contacts that open included</h2>\n"
        + scrolled(heads, rows, numbers=(2, 3, 4))
        + (
            f'<p class="soft">{entries[0]["units"]} units drawn afresh and solved by the equilibrium. [..]: '
            f"{100 * entries[0]['confidence']:g} % interval of the yield. P99 of the stiffness: what 99 % of the units "
            "do not fall below. A quantile is left out where it is only known to be far within the limit.</p>"
        )
    )


def _loaded_shares(entries: Sequence[Data]) -> str:
    """What each tolerance makes of each quantity at the load."""
    told = [one for one in entries if one["shares"]]
    if not told:
        return ""
    labels = [share["label"] for share in told[0]["shares"]]
    order = sorted(range(len(labels)), key=lambda e: -max(one["shares"][e]["value"] or 0.0 for one in told))
    rows = [
        [
            f"<code>{escaped(labels[e])}</code>",
            *(f"{number(rounded(one['shares'][e]['value'], 2))} [{_ends(one['shares'][e], 2)}]" for one in told),
        ]
        for e in order
    ]
    heads = ["total Sobol index [95 % interval]", *map(_named, told)]
    return "<h2>What each tolerance makes at the load</h2>\n" + scrolled(heads, rows, numbers=range(1, len(heads)))


def _yield(share: float, interval: Sequence[float]) -> str:
    return f"{_percent(share)} % [{_percent(interval[0])} to {_percent(interval[1])}]"


# --- the allocation ----------------------------------------------------------------------------------------------


def _allocation_head(found: Allocation, data: Data) -> str:
    what, loaded = limited_by(found), bool(data["verified"])
    binds = "limit" in [entry["held_by"] for entry in data["entries"]]
    said = f"Least cost {within(found)}: {brief(data['cost'])}, before "
    said += f"{'unknown' if data['cost_before'] is None else brief(data['cost_before'])}. "
    said += "The limit holds some widths." if binds else "Bounds and grades alone hold the widths."
    check, per = data["closed_form"], "percent_of_limits" if loaded else "arcsec"
    price, ends = data[f"shadow_price_per_{per}"], f"{number(check['low_arcsec'])} to {number(check['high_arcsec'])}"
    before, after, unit = (
        (data["used_before_percent"], data["used_percent"], "%")
        if loaded
        else (data["value_before_arcsec"], data["value_arcsec"], "arcsec")
    )
    boxes = [
        ("cost, before → after", f"{number(data['cost_before'])} → {number(data['cost'])}"),
        (
            f"{what}, before → after" + (", upper end of its 95 % interval" if found.kind == "yield" else ""),
            f"{number(before)} → {number(after)} {unit}",
        ),
        (
            f"closed form, contacts closed: P{100 * check['level']:g} of the peak-to-peak, "
            f"{100 * data['confidence']:g} % interval of the estimate",
            f"{number(check['quantile_arcsec'])} arcsec [{ends}]",
        ),
        (
            f"{'1 % more of all limits' if loaded else 'one arcsec more'} would save",
            "–" if price is None else number(price),
        ),
    ]
    if loaded:
        both = data["all_limits"]
        boxes[2:2] = [("verified yield of all limits", _yield(both["yield"], both["interval"]))]
        if data["cost_scaled_alike"] is not None:
            boxes[1:1] = [("cost, all widths scaled alike to the same yield", number(data["cost_scaled_alike"]))]
    speed = data["input_speed_rpm"]
    about = [
        data["model"],
        within(found),
        "" if loaded else "closed form, contacts closed" if speed is None else f"input at {brief(speed)} rpm",
        f"{data['verified'][0]['units']} fresh units solved at the load, seed {data['seed']}"
        if loaded
        else f"checked by {check['units']} fresh units, seed {check['seed']}",
    ]
    return _head("Tolerances of least cost", about, said, boxes)


def _cost_pictures(data: Data) -> tuple[list[str], list[tuple[str, str]]]:
    entries = sorted(data["entries"], key=lambda entry: -max(entry["cost"] or 0, entry["cost_before"] or 0))[:_SHOWN]
    rows = [
        (
            one["label"],
            [
                Bar(look=look, value=one[name])
                for look, name in (("before", "cost_before"), ("after", "cost"))
                if one[name] is not None
            ],
        )
        for one in entries
    ]
    key = [("before", "as given"), ("after", "allocated")]
    return [bars(rows, width=width, title="costs", caption="cost") for width in _WIDTHS.values()], key


def _entries(data: Data) -> str:
    held = {
        "limit": "limit of the error",
        "upper bound": "its upper bound",
        "lower bound": "its lower bound",
        "grade": "its grades",
        "fixed": "fixed",
    }
    rows = [
        [
            f"<code>{escaped(one['label'])}</code>",
            number(one["width_before"]),
            number(one["width"]),
            escaped(one["unit"]),
            number(one["width"] / one["width_before"]),
            number(one["cost_before"]),
            number(one["cost"]),
            held[one["held_by"]] + (f": {escaped(one['grade'])}" if one["grade"] else ""),
        ]
        for one in data["entries"]
    ]
    heads = ["tolerance", "T before", "T allocated", "unit", "times", "cost before", "cost allocated", "held by"]
    return "<h2>What holds each tolerance</h2>\n" + scrolled(heads, rows, numbers=(1, 2, 4, 5, 6))


def _rates(data: Data) -> str:
    per = "percent_of_limits" if data["verified"] else "arcsec"
    rows = [
        [
            f"<code>{escaped(one['label'])}</code>",
            *(number(one[name]) for name in (f"cost_per_{per}_gained", f"saved_per_{per}_given_up")),
        ]
        for one in data["entries"]
    ]
    step = "1 % of all limits" if data["verified"] else "an arcsec"
    heads = ["from the width as given", f"cost of {step} gained", f"saved by {step} given up"]
    return "<h2>What to tighten, what to relax</h2>\n" + scrolled(heads, rows, numbers=(1, 2))


# --- both --------------------------------------------------------------------------------------------------------


def _head(title: str, about: Sequence[str | None], said: str, boxes: Sequence[tuple[str, str]]) -> str:
    line = "; ".join(item for item in about if item)
    return (
        f'<h1>{escaped(title)}</h1>\n<p class="soft">{escaped(line)}</p>\n'
        f'<div class="verdict"><p>{escaped(said)}</p></div>\n{tiles(boxes)}'
    )


def _figure(heading: str, pictures: Sequence[str], key: Sequence[tuple[str, str]]) -> str:
    if not pictures:
        return ""
    swatches = "".join(
        f'<span><svg width="26" height="10" aria-hidden="true"><rect class="{look}" width="26" height="10"/></svg>'
        f"{escaped(name)}</span>"
        for look, name in key
    )
    boxes = "\n".join(f'<div class="{name}">{one}</div>' for name, one in zip(_WIDTHS, pictures, strict=True))
    return f'<figure><h2>{escaped(heading)}</h2>\n<div class="key">{swatches}</div>\n{boxes}</figure>'


def _as_text(text: str) -> str:
    return f"<details><summary>The same as text</summary>\n<pre>{escaped_lines(text)}</pre></details>"


def _ends(one: Data, digits: int = 4) -> str:
    return " to ".join("–" if one[end] is None else brief(one[end], digits) for end in ("low", "high"))


def _percent(share: float) -> str:
    return f"{100 * share:.4g}"
