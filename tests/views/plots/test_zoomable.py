"""Curves of a page that zoom: the data beside a still picture are the data of its lines."""

from __future__ import annotations

import json
import re
import sys

import numpy as np
import pytest

from every_kind import HOSTILE, every_kind
from pages import without_scripts
from rverror import to_html
from rverror.views.plots.figure import Figure, new_figure
from rverror.views.plots.zoomable import figure_element, scripts

X, Y = np.array([0.0, 1.0, 3.0]), np.array([2.0, -1.0, 4.123456789])


def curve(label: str = "measured") -> Figure:
    figure, (ax,) = new_figure()
    ax.plot(X, Y, label=label)
    ax.axhline(0.5)
    ax.set_ylabel("arcsec")
    return figure


def data_of(element: str) -> dict[str, object] | None:
    found = re.search(r'<script type="application/json">(.*?)</script>', element, re.DOTALL)
    return json.loads(found[1]) if found else None


def test_the_data_are_those_of_the_lines_and_a_line_across_the_axes_goes_along() -> None:
    told = data_of(figure_element(curve(), 0))
    (ax,) = told["axes"]
    first, across = (np.array(told["data"][line["data"]]) for line in ax["lines"])
    assert first == pytest.approx(np.column_stack([X, Y]), rel=1e-5)
    assert across == pytest.approx(np.column_stack([ax["xlim"], [0.5, 0.5]]), rel=1e-5)
    assert {line["coordinates"] for line in ax["lines"]} == {"data"}
    assert [plugin["type"] for plugin in told["plugins"]] == ["reset", "zoom", "boxzoom", "mouseposition"]


def test_the_same_figure_has_the_same_data_and_another_number_other_names() -> None:
    one, again, other = (data_of(figure_element(curve(), number)) for number in (0, 0, 1))
    assert one == again
    assert one["id"] != other["id"]


def test_each_line_of_a_title_stands_above_the_next() -> None:
    figure = curve()
    figure.axes[0].set_title("first line\nsecond line", x=0.0, ha="left")
    texts = data_of(figure_element(figure, 0))["axes"][0]["texts"]
    first, second = (next(one for one in texts if one["text"] == f"{name} line") for name in ("first", "second"))
    assert first["position"][0] == second["position"][0] == 0.0
    height = figure.axes[0].bbox.height
    assert (first["position"][1] - second["position"][1]) * height == pytest.approx(1.2 * second["fontsize"], rel=1e-3)


def test_a_gap_of_a_line_is_json_and_stays_a_gap() -> None:
    figure, (ax,) = new_figure()
    ax.plot([0.0, 1.0, 2.0, 3.0], [1.0, np.nan, 2.0, 3.0])
    element = figure_element(figure, 0)
    assert "NaN" not in element.replace('"NaN"', "")  # a bare one is no JSON, and browsers would draw nothing at all
    assert data_of(element)["data"]["data01"] == [[0.0, 1.0], [1.0, "NaN"], [2.0, 2.0], [3.0, 3.0]]


def test_a_name_cannot_end_the_data() -> None:
    element = figure_element(curve(HOSTILE), 0)
    assert element.count("</script>") == 1
    assert HOSTILE not in element


@pytest.mark.parametrize("what", ["logarithm", "names", "legend", "equal", "band"])
def test_what_would_be_drawn_otherwise_stays_still(what: str) -> None:
    figure = curve()
    (ax,) = figure.axes
    change = {
        "logarithm": lambda: ax.set_xscale("symlog"),
        "names": lambda: ax.set_xticks(X, ["a", "b", "c"]),
        "legend": lambda: figure.legend(),
        "equal": lambda: ax.set_aspect("equal"),
        "band": lambda: ax.axvspan(0.5, 1.0),
    }
    change[what]()
    assert data_of(figure_element(figure, 0)) is None


def test_a_page_runs_its_own_scripts_alone_and_none_where_nothing_zooms() -> None:
    page = to_html(every_kind()["SpeedResponse"][0])
    assert page.count("<script>") == len(scripts()) == 3
    assert "<script" not in without_scripts(page)
    assert "script" not in to_html(every_kind()["Budget"][0])


def test_without_the_library_pictures_are_still(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mpld3", None)
    scripts.cache_clear()
    try:
        assert scripts() == ()
        assert figure_element(curve(), 0).endswith("</svg>\n")
    finally:
        scripts.cache_clear()
