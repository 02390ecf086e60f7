"""Plots: axes in, axes out; what is drawn is what was computed, with its unit."""

from __future__ import annotations

import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from rverror import Diagnosis, Drive, InputError, Model, effect, reducer, transmission_error
from rverror.diagnosis import Trace
from rverror.plot import (
    diagnosis_figure,
    model_waveform,
    new_figure,
    order_spectrum,
    svg_element,
    to_bytes,
    waveform,
)
from rverror.units import ARCSEC
from test_report import COS, SIN, outcome

MODEL = Model(
    reducer("RV-40E"),
    (
        effect("crank.eccentricity", crank=0, disc=1, radial="4 um", tangential="1 um"),
        effect("cycloid.pin_circle", harmonic=2, radial_cos="3 um"),
        effect("involute.tooth_thinning", member="sun", thinning="20 um"),
    ),
    "test unit",
)


@pytest.fixture(scope="session")
def found(tmp_path_factory: pytest.TempPathFactory) -> Diagnosis:
    return outcome(tmp_path_factory.getbasetemp() / "diagnosis-of-the-example").diagnosis


@pytest.fixture
def ax() -> Axes:
    return new_figure()[1][0]


def legend(axes: Axes) -> list[str]:
    box = axes.get_legend()
    assert box is not None
    return [text.get_text() for text in box.get_texts()]


def line(axes: Axes, label: str) -> tuple[Any, Any]:
    (drawn,) = [item for item in axes.get_lines() if item.get_label() == label]
    return drawn.get_xdata(), drawn.get_ydata()


def stems(axes: Axes, label: str) -> tuple[Any, Any]:
    (drawn,) = [c for c in axes.collections if isinstance(c, LineCollection) and c.get_label() == label]
    ends = np.array([segment[1] for segment in drawn.get_segments()])
    return ends[:, 0], ends[:, 1]


# --- what all share ---------------------------------------------------------------------------------------------------

DRAWINGS = {
    "waveform": lambda found, ax: waveform(found.traces[0], ax=ax),
    "order_spectrum": lambda found, ax: order_spectrum(found, ax=ax),
    "model_waveform": lambda found, ax: model_waveform(MODEL, ax=ax),
}


@pytest.mark.parametrize("name", DRAWINGS)
def test_axes_in_the_same_axes_out(found: Diagnosis, ax: Axes, name: str) -> None:
    assert DRAWINGS[name](found, ax) is ax
    assert len(ax.figure.axes) == 1


@pytest.mark.parametrize("name", DRAWINGS)
def test_without_axes_each_call_makes_its_own(found: Diagnosis, name: str) -> None:
    first, second = (DRAWINGS[name](found, None) for _ in range(2))
    assert isinstance(first, Axes)
    assert first is not second
    assert first.figure is not second.figure


@pytest.mark.parametrize("name", DRAWINGS)
def test_axes_have_units_title_and_legend(found: Diagnosis, ax: Axes, name: str) -> None:
    DRAWINGS[name](found, ax)
    assert ax.get_ylabel().endswith(", arcsec")
    assert ax.get_xlabel() in ("output angle, deg", "order, per output turn")
    assert ax.get_title()
    assert len(legend(ax)) >= 2
    assert all(legend(ax))


@pytest.mark.parametrize("name", DRAWINGS)
def test_colours_of_one_picture_differ(found: Diagnosis, ax: Axes, name: str) -> None:
    DRAWINGS[name](found, ax)
    handles = [*ax.get_lines(), *(c for c in ax.collections if isinstance(c, LineCollection))]
    colours = [mpl.colors.to_hex(np.atleast_2d(mpl.colors.to_rgba_array(h.get_color()))[0]) for h in handles]
    assert len(set(colours)) == len(colours)


# --- waveform ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("run", "word"), [(0, "forward"), (1, "reverse")])
def test_waveform_draws_the_trace(found: Diagnosis, ax: Axes, run: int, word: str) -> None:
    trace = found.traces[run]
    waveform(trace, ax=ax)
    assert ax.get_title() == f"{word}.csv ({word})"
    labels = legend(ax)
    assert len(labels) == 3
    for label, values in zip(labels, (trace.measured, trace.before, trace.after), strict=True):
        x, y = line(ax, label)
        assert x == pytest.approx(np.degrees(trace.theta))
        assert y == pytest.approx(values / ARCSEC)
    assert [word in label for word, label in zip(("measured", "declared", "added"), labels, strict=True)] == [True] * 3
    low, high = ax.get_xlim()
    assert high - low == pytest.approx(360, rel=1e-2)


def test_waveform_shows_the_model_once_where_nothing_was_added(found: Diagnosis, ax: Axes) -> None:
    trace = replace(found.traces[0], after=found.traces[0].before)
    waveform(trace, ax=ax)
    assert len(legend(ax)) == len(ax.get_lines()) == 2


@pytest.mark.parametrize("name", ["bench/a/forward.csv", "C:\\bench\\forward.csv", "forward.csv"])
def test_titles_hold_the_file_name_without_its_folder(found: Diagnosis, ax: Axes, name: str) -> None:
    waveform(replace(found.traces[0], name=name), ax=ax)
    assert ax.get_title() == "forward.csv (forward)"


# --- order spectrum ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("run", [0, 1])
def test_spectrum_shows_the_encoder_before_and_not_after(found: Diagnosis, ax: Axes, run: int) -> None:
    order_spectrum(found, run=run, ax=ax)
    assert ("forward", "reverse")[run] in ax.get_title()
    assert legend(ax) == ["residual before", "residual after"]
    orders, before = stems(ax, "residual before")
    again, after = stems(ax, "residual after")
    assert (orders == again).all()
    assert orders[0] == 1
    assert orders[-1] == 260
    assert before[0] == pytest.approx(math.hypot(COS, SIN), rel=0.03)
    assert after[0] < 0.1
    assert np.argmax(before) == 0
    names = [text.get_text() for text in ax.texts]
    assert any(name.startswith("1\n") for name in names)


def test_spectrum_is_that_of_the_residual(found: Diagnosis, ax: Axes) -> None:
    """Against sums of cosines and sines, written out."""
    trace = found.traces[0]
    order_spectrum(found, highest=50, ax=ax)
    orders, drawn = stems(ax, "residual before")
    assert list(orders) == list(range(1, 51))
    rest = (trace.measured - trace.before) / ARCSEC
    for order, size in zip(orders, drawn, strict=True):
        turn = np.exp(1j * order * trace.theta)
        assert size == pytest.approx(abs(2 * np.mean(rest * turn)), abs=1e-4)


def test_a_period_of_several_turns_has_broken_orders(ax: Axes, found: Diagnosis) -> None:
    theta = 4 * np.pi * np.arange(512) / 512
    wave = 5 * ARCSEC * np.cos(3.5 * theta)
    nothing = np.zeros(512)
    trace = Trace("idler.csv", 1.0, theta, wave, nothing, 0.9 * wave)
    worm = Model(Drive(ratio=-14.0, shafts={"motor": 14.0, "idler": 3.5}))
    order_spectrum(replace(found, traces=(trace,), declared=worm), ax=ax)
    orders, before = stems(ax, "residual before")
    assert orders[:3] == pytest.approx([0.5, 1.0, 1.5])
    assert orders[np.argmax(before)] == 3.5
    assert before.max() == pytest.approx(5.0)
    assert any(text.get_text().startswith("3.5\n") and "idler" in text.get_text() for text in ax.texts)


def test_a_model_that_is_right_leaves_nothing_to_draw_but_axes(found: Diagnosis, ax: Axes) -> None:
    exact = tuple(replace(t, before=t.measured, after=t.measured, left_out=None) for t in found.traces)
    order_spectrum(replace(found, traces=exact), ax=ax)
    low, high = ax.get_ylim()
    assert 0 < low < high
    assert not ax.texts
    to_bytes(ax.figure, "png")


def test_named_peaks_stand_apart(found: Diagnosis, ax: Axes) -> None:
    order_spectrum(found, ax=ax)
    places = sorted(text.xy[0] for text in ax.texts)
    assert 1 <= len(places) <= 6
    assert min(np.diff(places), default=math.inf) >= 5


# --- model waveform ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_model_waveform_draws_each_effect_and_their_sum(ax: Axes, direction: float) -> None:
    model_waveform(MODEL, direction=direction, ax=ax)
    assert ax.get_title() == "test unit"
    labels = legend(ax)
    assert labels[-1] == "total"
    total = np.zeros(4096)
    for item, label in zip(MODEL.effects, labels[:-1], strict=True):
        assert item.key in label
        x, y = line(ax, label)
        alone = transmission_error(Model(MODEL.mechanism, (item,)), np.radians(x), direction=direction)
        assert y == pytest.approx(alone / ARCSEC, abs=1e-9)
        total += y
    assert line(ax, "total")[1] == pytest.approx(total, abs=1e-9)


def test_model_waveform_of_a_model_without_effects(ax: Axes) -> None:
    model_waveform(Model(MODEL.mechanism), ax=ax)
    assert legend(ax) == ["total"]
    assert (line(ax, "total")[1] == 0).all()
    assert ax.get_title() == "transmission error"


def test_a_model_of_many_effects_can_be_drawn() -> None:
    """The legend has room for the largest."""
    pins = tuple(effect("cycloid.pin_position", pin=i, radial=1e-4 * (i + 1)) for i in range(40))
    ax = model_waveform(Model(MODEL.mechanism, pins))
    assert len(ax.get_lines()) == 41
    assert legend(ax) == [*(f"cycloid.pin_position (pin {i})" for i in range(28, 40)), "total"]
    assert "28 more" in ax.get_legend().get_title().get_text()
    to_bytes(ax.figure, "png")


# --- figures and files ------------------------------------------------------------------------------------------------


def test_the_figure_has_a_waveform_for_each_run_and_a_spectrum(found: Diagnosis) -> None:
    figure = diagnosis_figure(found)
    titles = [ax.get_title() for ax in figure.axes]
    assert titles == ["forward.csv (forward)", "reverse.csv (reverse)", "residual spectrum, forward.csv"]
    one_way = diagnosis_figure(replace(found, traces=found.traces[1:]))
    assert [ax.get_title() for ax in one_way.axes] == ["reverse.csv (reverse)", "residual spectrum, reverse.csv"]


@pytest.mark.parametrize("rows", [1, 3])
def test_new_figure_grows_with_its_rows(rows: int) -> None:
    figure, axes = new_figure(rows, width=8, height=2)
    assert isinstance(figure, Figure)
    assert len(axes) == rows
    assert tuple(figure.get_size_inches()) == (8, 2 * rows)


def test_files_have_the_kind_that_was_asked() -> None:
    figure = waveform(Trace("a.csv", 1.0, np.linspace(0, 6, 64), *np.ones((3, 64)) * ARCSEC)).figure
    png = to_bytes(figure, "png")
    assert png[:8] == b"\x89PNG\r\n\x1a\n"
    assert (int.from_bytes(png[16:20]), int.from_bytes(png[20:24])) == (1170, 416)  # 9 x 3.2 in at 130 dots an inch
    svg = svg_element(figure)
    assert svg.startswith("<svg")
    root = ET.fromstring(svg)
    assert root.tag == "{http://www.w3.org/2000/svg}svg"
    assert root.find("{http://www.w3.org/2000/svg}metadata") is None


@pytest.mark.parametrize("name", ["<script>--></script>&amp;", "a$_{$.csv", "测试\x07.csv"])
def test_names_are_drawn_as_they_stand(found: Diagnosis, name: str) -> None:
    """No formula, markup or control character is read from a name, and no font's gap is a warning."""
    trace = replace(found.traces[0], name=name)
    shafts = {name: 3.0}
    worm = Model(Drive(ratio=-14.0, shafts=shafts), (effect("shaft.eccentricity", shaft=name, harmonic=1, cos=1e-5),))
    figure, axes = new_figure(3)
    waveform(trace, ax=axes[0])
    order_spectrum(replace(found, traces=(trace,), declared=worm), ax=axes[1])
    model_waveform(replace(worm, name=name), ax=axes[2])
    to_bytes(figure, "png")
    root = ET.fromstring(svg_element(figure))
    assert not [item for item in root.iter() if item.tag.endswith("script")]


def test_drawing_leaves_no_state_behind(found: Diagnosis) -> None:
    before = dict(mpl.rcParams)
    to_bytes(diagnosis_figure(found), "svg")
    assert dict(mpl.rcParams) == before


def test_importing_the_package_needs_no_matplotlib(tmp_path: Path) -> None:
    code = (
        "import sys; sys.modules['matplotlib'] = None; import rverror, rverror.cli, rverror.plot\n"
        "try: rverror.plot.new_figure()\n"
        "except rverror.InputError as problem: print(problem)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path, check=True)
    assert "matplotlib" in done.stdout
    assert "rverror[plot]" in done.stdout
    assert done.stderr == ""


@pytest.mark.parametrize("name", [*DRAWINGS, "diagnosis_figure"])
def test_without_matplotlib_the_error_tells_the_remedy(
    found: Diagnosis, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(InputError, match=r"matplotlib.*pip install 'rverror\[plot\]'"):
        DRAWINGS.get(name, lambda found, _: diagnosis_figure(found))(found, None)
