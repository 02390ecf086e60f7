"""One HTML page from the data of a diagnosis: every number on it is one of the JSON's, every text is escaped here."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

from rverror.base.numbers import brief
from rverror.views.bench_report import BESIDE, bench_html
from rverror.views.html import document, escaped, escaped_lines, inputs, number, scrolled, tiles
from rverror.views.set_aside import LABELS
from rverror.views.svg import MARKS

Data = Mapping[str, Any]

AS_MEASURED = "To describe order {harmonic} as it was measured, which explains nothing, add to the model:"
#: What accounts for the power of an order, as `OrderShare` names it and as people do.
SHARES = {
    "parts": "parts",
    "compliance": "compliance",
    "measuring_chain": "measuring chain",
    "empirical": "law only",
    "left": "nothing",
}
_ENDS = ("before", "after")
AS_TOLD = "Stiffness, backlash and contact law as the runs tell them"


def page(data: Data, *, summary: str, first: str = "", figures: Sequence[tuple[str, Sequence[str]]], text: str) -> str:
    """The page, as HTML.

    Parameters
    ----------
    data : mapping
        As `diagnosis_report.diagnosis_json` makes it.
    summary : str
        One sentence on the outcome, plain text.
    first : str
        Sections that come before all others, HTML: the passport of orders, natural frequencies.
    figures : sequence of (str, sequence of str)
        Heading, and SVG elements: for a wide page, then for a narrow one.
    text : str
        The text report, shown at the end as it is.
    """
    title = f"rverror: {data['verdict'].replace('_', ' ')}"
    sections = [
        _head(data, title, summary),
        first,
        _validation(data),
        _shares(data),
        _added(data),
        _unexplained(data),
        _next(data),
        _sizes(data),
        bench_html(data["bench_uncertainty"]),
        _stiffness(data),
        *(_figure(heading, pictures, data) for heading, pictures in figures),
        _orders(data),
        _candidates(data),
        _declared(data),
        _notes(data),
        inputs(data["files"], data["version"]),
        f"<details><summary>The same as text</summary>\n<pre>{escaped_lines(text)}</pre></details>",
    ]
    body = "\n".join(section for section in sections if section)
    return document(title, body)


def name_of(entry: Data) -> str:
    """Key and indices of an effect, as HTML."""
    inside = ", ".join(f"{key} {value}" for key, value in entry["indices"].items())
    return f"<code>{escaped(str(entry['key']))}</code>" + (f" ({escaped(inside)})" if inside else "")


def _head(data: Data, title: str, summary: str) -> str:
    unit = escaped(data["unit"])

    def fall(what: str) -> str:
        return " → ".join(number(_size(data, key, what)) for key in _ENDS) + _beside(data, what)

    leading = [
        (_heading(data, "held-out rms, before → after"), f"{fall('heldout_rms')} {unit}"),
        ("noise floor, rms", f"{number(data['noise_rms_' + data['suffix']])} {unit}"),
        (_heading(data, "peak-to-peak, before → after"), f"{fall('peak_to_peak')} {unit}"),
        ("added", f"{len(data['added'])} of {data['candidates_tried']} candidates"),
    ]
    return (
        f"<h1>{escaped(title)}</h1>\n"
        f'<p class="soft">{escaped(data["declared"]["name"])}</p>\n'
        f'<div class="verdict {escaped(data["verdict"])}"><p>{escaped(summary)}</p></div>\n'
        f"{tiles(leading)}"
    )


def _size(data: Data, key: str, what: str) -> float | None:
    value: float | None = data[key][f"{what}_{data['suffix']}"]
    return value


def _beside(data: Data, what: str) -> str:
    """Uncertainty that stands behind a figure, where the model states a bench."""
    stated = (data["bench_uncertainty"] or {}).get(f"{what}_arcsec")
    return "" if stated is None else f" ± {number(stated)}"


def _of_order(row: Data) -> str:
    """The same of the amplitude of an order."""
    stated = row["bench_uncertainty_arcsec"]
    return "" if stated is None else f" ± {number(stated)}"


def _heading(data: Data, text: str) -> str:
    return f"{text} (± {BESIDE})" if data["bench_uncertainty"] else text


def _added(data: Data) -> str:
    if not data["added"]:
        return ""
    parts = ["<h2>What was added</h2>"]
    for place, added in enumerate(data["added"], 1):
        parts.append(f"<h3>{place}. {name_of(added)}</h3>")
        parts.append(f'<p class="soft">{escaped(added["summary"])}; fixed in: {escaped(added["frame"])}</p>')
        rows = []
        for name, size in added["parameters"].items():
            known = size["low"] is not None
            interval = f"{number(size['low'])} to {number(size['high'])}" if known else "not determined by these runs"
            rows.append([escaped(name), number(size["value"]), escaped(size["unit"]), interval])
        parts.append(scrolled(["parameter", "size", "unit", "95 % interval"], rows, numbers=(1,)))
        orders = ", ".join(brief(order) for order in added["orders"])
        rms = number(added[f"heldout_rms_{data['suffix']}"])
        shows = f"at orders {orders}" if orders else "at no order: it is constant, or grows along the run"
        parts.append(f"<p>Shows {shows}. Held-out rms once added: {rms} {escaped(data['unit'])}.</p>")
        if added["indistinguishable_from"]:
            others = ", ".join(name_of(other) for other in added["indistinguishable_from"])
            parts.append(f"<p><strong>These runs cannot tell it from:</strong> {others}.</p>")
        parts += [f"<p><strong>Note:</strong> {escaped(note)}.</p>" for note in added["notes"]]
    return "\n".join(parts)


def _validation(data: Data) -> str:
    """Measurements that no fit saw."""
    if not data["validation"]:
        return ""
    name = f"rms_{data['suffix']}"
    rows = [
        [escaped(one["file"] or "in memory"), *(number(one[at][name]) + _beside(data, "rms") for at in _ENDS)]
        for one in data["validation"]
    ]
    heads = ["file", _heading(data, f"rms before, {escaped(data['unit'])}"), "rms after"]
    return "<h2>Measurements that no fit saw</h2>\n" + scrolled(heads, rows, numbers=(1, 2))


def _shares(data: Data) -> str:
    """What accounts for the power of each order."""
    if not data["shares"]:
        return ""
    names = data["shares"][0]["shares"]
    rows = [
        [number(one["order"]), number(one[f"amplitude_{data['suffix']}"])]
        + [str(round(100 * one["shares"][name])) for name in names]
        for one in data["shares"]
    ]
    heads = ["order", f"amplitude, {escaped(data['unit'])}", *(f"{SHARES[name]}, %" for name in names)]
    return "<h2>What accounts for the power of each order</h2>\n" + scrolled(heads, rows, numbers=range(len(heads)))


def _unexplained(data: Data) -> str:
    lines = data["unexplained_orders"]
    if not lines:
        return ""
    unit = data["unit"]
    rows = [
        [
            number(line["order"]),
            number(line[f"amplitude_{data['suffix']}"]),
            f"{number(line['low'])} to {number(line['high'])}" + _of_order(line),
            escaped("; ".join([*line["frames"], *line["beside"]])) or "none of this drive",
            _folds(line["could_fold_from"]),
        ]
        for line in lines
    ]
    heads = ["order", f"amplitude, {unit}", _heading(data, "95 % interval"), "fits", "could fold from"]
    return (
        "<h2>Lines that nothing in the catalogue explains</h2>\n"
        + scrolled(heads, rows, numbers=(0, 1))
        + "<p>To add the effect once it is known: one function and one catalogue entry, written out with a worked "
        "example in <code>docs/adding-an-effect.md</code>; the fit, files and this report then take it up.</p>"
        + _as_measured(lines[0]["as_effect"])
    )


def _as_measured(effect: Data | None) -> str:
    if effect is None:
        return ""
    return f"<p>{AS_MEASURED.format(**effect)}</p>\n<pre>{chr(10).join(map(escaped, effect_toml(effect)))}</pre>"


def effect_toml(effect: Data) -> list[str]:
    """Lines of a model file that declare an effect: key, indices and parameters by name, sizes with their unit."""
    return ["[[effect]]", *(f"{name} = {json.dumps(value)}" for name, value in effect.items())]


def _folds(found: Sequence[Data] | None) -> str:
    if found is None:
        return "not known: the sampling is not kept"
    named = [f"{number(fold['order'])}: {escaped('; '.join(fold['frames']))}" for fold in found]
    return "<br>".join(named) or "no known order"


def _next(data: Data) -> str:
    if not data["next_measurements"]:
        return ""
    items = []
    for item in data["next_measurements"]:
        separates = ", ".join(name_of(cause) for cause in item["separates"])
        ending = (
            f'<br><span class="soft">separates {name_of(item["about"])} from {separates}</span>' if separates else ""
        )
        why = f": {escaped(item['why'])}" if item["why"] else ""
        items.append(f"<li><strong>{escaped(item['what'])}</strong>{why}.{ending}</li>")
    return "<h2>What to measure next</h2>\n<ol>" + "\n".join(items) + "</ol>"


def _sizes(data: Data) -> str:
    labels = {"before": "as declared", "before_refitted": "declared sizes refitted", "after": "with what was added"}
    if not data["added"]:
        del labels["after"]  # it is the refitted model
    rows = [
        [
            escaped(label),
            *(number(_size(data, key, what)) + _beside(data, what) for what in ("rms", "peak_to_peak", "heldout_rms")),
        ]
        for key, label in labels.items()
    ]
    rows.append(["noise", number(data["noise_rms_" + data["suffix"]]), "", ""])
    heads = [_heading(data, f"residual, {data['unit']}"), "rms", "peak-to-peak", "held-out rms"]
    return (
        "<h2>Before and after</h2>\n"
        + scrolled(heads, rows, numbers=(1, 2, 3))
        + '<p class="soft">Measured less predicted, offset of each run removed. Held-out: of revolutions that the fit '
        "did not see. Noise: what is left of a reading when all that is regular is out.</p>"
    )


def _stiffness(data: Data) -> str:
    """What the runs say of each; those of which they say nothing in one line."""
    if not data["stiffness"]:
        return ""
    rows = []
    for row in data["stiffness"]:
        if row["told"]:
            open_ended = row["low"] is None and row["high"] is None
            ends = "not determined by these runs" if open_ended else f"{number(row['low'])} to {number(row['high'])}"
            unit = "" if row["unit"] == "dimensionless" else escaped(row["unit"])
            name = f"<code>{escaped(row['name'])}</code>"
            rows.append([name, number(row["declared"]), number(row["value"]), unit, ends])
    heads = ["", "declared", "fitted", "unit", "95 % interval"]
    rest = ", ".join(f"<code>{escaped(row['name'])}</code>" for row in data["stiffness"] if not row["told"])
    parts = [f"<h2>{AS_TOLD}</h2>"]
    parts += [scrolled(heads, rows, numbers=(1, 2))] if rows else []
    parts += [f'<p class="soft">Not told by these runs: {rest}.</p>'] if rest else []
    return "\n".join(parts)


def _figure(heading: str, pictures: Sequence[str], data: Data) -> str:
    boxes = "\n".join(
        f'<div class="{name}">{picture}</div>' for name, picture in zip(("wide", "narrow"), pictures, strict=True)
    )
    after = "with what was added, after" if data["added"] else "declared sizes refitted, nothing added"
    swatches = (("measured", "measured"), ("before", "declared model, before"), ("after", after))
    shown = [(name, label) for name, label in swatches if f'{name}"' in pictures[0]]
    stem = "stem " if 'class="stem' in pictures[0] else ""
    key = "".join(
        f'<span><svg width="26" height="10" aria-hidden="true"><path class="{stem}{name}" d="M1 5H25"/></svg>'
        f"{escaped(label)}</span>"
        for name, label in shown
    )
    key += "".join(
        f'<span><svg width="12" height="12" aria-hidden="true"><path class="{kind}" d="M6 12{MARKS[kind]}"/></svg>'
        f"{escaped(label)}</span>"
        for kind, label in LABELS.items()
        if f'class="{kind}"' in pictures[0]
    )
    return f'<figure><h3>{escaped(heading)}</h3>\n<div class="key">{key}</div>\n{boxes}</figure>'


def _orders(data: Data) -> str:
    if not data["by_order"]:
        return ""
    suffix = data["suffix"]
    runs = data["runs"] if len(data["runs"]) <= 4 else []
    heads = ["order", "fits", "before", _heading(data, "after"), *(f"{run['label']}, before → after" for run in runs)]
    rows = [
        [
            number(row["order"]),
            escaped("; ".join([*row["frames"], *row["beside"]])) or "no frame",
            number(row[f"before_{suffix}"]),
            number(row[f"after_{suffix}"]) + _of_order(row),
            *(f"{number(r[f'before_{suffix}'])} → {number(r[f'after_{suffix}'])}" for r in row["runs"][: len(runs)]),
        ]
        for row in data["by_order"]
    ]
    return (
        "<h3>By order</h3>\n"
        + scrolled(heads, rows, numbers=(0, *range(2, 4 + len(runs))))
        + f'<p class="soft">Amplitudes, {escaped(data["unit"])}, of the mean of revolutions that were each left out of '
        "the fit; before and after are the root mean square over the runs. Several frames at one order: the order "
        "alone does not decide.</p>"
    )


def _candidates(data: Data) -> str:
    rounds = [(f"Round {at}, in which {name_of(added)} was added", added["candidates"])
              for at, added in enumerate(data["added"], 1) if added["candidates"]]  # fmt: skip
    rounds.append(("Last round, against what is left", data["candidates"]))
    parts = [f"<h2>Candidates</h2>\n<p>Of {data['candidates_tried']} tried, ranked by what each takes off the weighted "
             "sum of squares of stretches left out (chi-square, linear influences).</p>"]  # fmt: skip
    for heading, candidates in rounds:
        if not candidates:
            continue
        scores = ("heldout_gain", "standard_error", "behind_best", "behind_best_standard_error")
        rows = [[name_of(c), *(number(c[score]) for score in scores)] for c in candidates[:10]]
        heads = ["candidate", "held-out gain", "± (1 s.e.)", "behind the best", "± (1 s.e.)"]
        parts.append(f"<h3>{heading}</h3>\n" + scrolled(heads, rows, numbers=(1, 2, 3, 4)))
    return "\n".join(parts)


def _declared(data: Data) -> str:
    declared = data["declared"]
    rows = []
    for effect in declared["effects"]:
        sigma = effect["uncertainty"]
        for at, (name, size) in enumerate(effect["parameters"].items()):
            spread = "exact" if sigma is None else f"± {number(sigma['value'])}"
            sizes = number(size["value"]), spread, number(size["refitted"]), escaped(size["unit"])
            rows.append(["" if at else name_of(effect), escaped(name), *sizes])
    heads = ["effect", "parameter", "declared", "1 sigma", "refitted", "unit"]
    body = scrolled(heads, rows, numbers=(2, 3, 4)) if rows else "<p>No effect was declared.</p>"
    names = ("name", "direction", "torque")
    runs = [[*(escaped(run[name] or "–") for name in names), number(run["samples_per_turn"])] for run in data["runs"]]
    return f"<h2>What was declared</h2>\n<p>{escaped(declared['mechanism'])}</p>\n{body}\n<h3>Runs</h3>\n" + scrolled(
        ["run", "direction", "output torque", "samples an output turn"], runs, numbers=(3,)
    )


def _notes(data: Data) -> str:
    if not data["notes"]:
        return ""
    return "<h2>Notes</h2>\n<ul>" + "\n".join(f"<li>{escaped(note)}</li>" for note in data["notes"]) + "</ul>"
