"""Plots can be read: in a notebook, in any axes, in grey, and however long what they draw is."""

from __future__ import annotations

import io
import pickle
import re
from dataclasses import replace
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from drawn import legend, line, luminance, overlapping_texts
from every_kind import compensation, diagnosis, every_kind
from rverror import InputError, Model, draw, effect, equilibrium, reducer, run_from_arrays
from rverror.base.units import ARCSEC
from rverror.diagnosis.result import Trace
from rverror.tolerances.closed_form import Budget, WorstCase
from rverror.views import new_figure
from rverror.views.plots.budgets import cost_against_limit
from rverror.views.plots.figure import COLUMNS, for_drawing, svg_element, to_bytes
from rverror.views.plots.labels import labelled

UNIT = reducer("RV-40E")
MODEL = Model(UNIT, (effect("crank.eccentricity", crank=0, disc=1, radial="4 um"),), "unit 7")
WORDS = ("measured", "declared model", "sensor.encoder_eccentricity", "noise of the mean of 8 periods, rms", "after",
         "involute.planet_pitch (crank 1, harmonic 1)",
         "a_name_without_any_blank_to_break_it_at_that_goes_on_and_on")  # fmt: skip


# --- in a notebook ----------------------------------------------------------------------------------------------------


@pytest.fixture
def shell() -> Any:
    """What runs the cells of a notebook, without a kernel around it."""
    core = pytest.importorskip("IPython.core.interactiveshell")
    config = pytest.importorskip("traitlets.config").Config()
    config.HistoryManager.enabled = False
    yield core.InteractiveShell.instance(config=config)
    core.InteractiveShell.clear_instance()


def shown(shell: Any, cell: str) -> dict[str, Any]:
    """What a cell shows at its end, in all forms that the page may choose from."""
    done = shell.run_cell(cell)
    assert done.success, done.error_in_exec
    return {} if done.result is None else shell.display_formatter.format(done.result)[0]


@pytest.mark.parametrize(
    ("values", "numbers"), [([0.02, 1.0, 50.0], {"0.1", "1", "10"}), ([2.0, 5.0], {"2", "3", "4"})]
)
def test_logarithmic_axes_have_plain_numbers(values: list[float], numbers: set[str]) -> None:
    figure, (ax,) = new_figure()
    ax.plot([0.0, 1.0, 2.0][: len(values)], values)
    labelled(ax, x="x", y="y", legend="", yscale="log")
    figure.draw_without_rendering()
    drawn = {one.get_text() for which in ("major", "minor") for one in ax.get_yticklabels(which=which)}
    assert numbers <= drawn
    assert all(re.fullmatch(r"[0-9.]*", one) for one in drawn)


def test_a_cell_that_ends_with_a_plot_shows_its_picture(shell: Any) -> None:
    """Axes that pyplot made are shown by it at the end of the cell: these are words here, so no picture comes twice."""
    shell.push({"unit": MODEL})
    assert shown(shell, "unit.plot()")["image/png"][:4] == b"\x89PNG"
    both = shown(
        shell, "import rverror; figure, axes = rverror.views.new_figure(2); unit.plot(axes[0]); unit.plot(axes[1])"
    )
    assert both["image/png"] == to_bytes(shell.user_ns["figure"], "png")
    assert shown(shell, "figure")["image/png"] == both["image/png"]
    assert shown(shell, "ax = unit.plot()") == {}
    assert set(shown(shell, "import matplotlib.pyplot as plt; unit.plot(plt.figure().add_subplot())")) == {"text/plain"}
    assert shown(shell, "plt.get_fignums()")["text/plain"] == "[1]"  # ours are none of pyplot's
    shell.run_cell("plt.close('all')")


def test_axes_stand_first_or_by_name() -> None:
    for given in (Figure().add_subplot(), new_figure()[1][0]):
        assert MODEL.plot(given) is given
        assert draw(MODEL, given) is given
        assert MODEL.plot(given, kind="spectrum") is MODEL.plot(ax=given, kind="spectrum") is given
    with pytest.raises(InputError, match=r"ax = 'spectrum': a plot is chosen by its name, kind='spectrum'"):
        MODEL.plot("spectrum")  # type: ignore[arg-type]


def test_axes_stay_matplotlibs_own() -> None:
    ax = MODEL.plot()
    assert type(ax) is Axes
    again = pickle.loads(pickle.dumps(ax.figure))
    assert again.axes[0]._repr_png_()[:4] == b"\x89PNG"


# --- legends and names ------------------------------------------------------------------------------------------------


def axes_of(layout: str | None, size: tuple[float, float], rows: int, columns: int) -> list[Axes]:
    figure = Figure(figsize=size, layout=layout)
    figure.subplots(rows, columns, squeeze=False)
    return figure.axes


SHAPES = [
    ("constrained", (9.0, 6.0), 2, 2),
    ("constrained", (5.0, 4.0), 1, 1),
    (None, (9.0, 4.0), 1, 2),
]


@pytest.mark.parametrize("shape", SHAPES, ids=str)
@pytest.mark.parametrize("place", ["below", "beside"])
def test_legends_lie_inside_the_figure_and_over_no_line(shape: Any, place: Any) -> None:
    rng = np.random.default_rng(7)
    for count in (3, 5):
        axes = axes_of(*shape)
        ax = axes[-1]
        for _ in range(count):
            ax.plot(rng.standard_normal(50), label=" ".join(rng.choice(WORDS, rng.integers(1, 3))))
        title = rng.choice(WORDS, 3)
        labelled(ax, *title, x="output angle, deg", y="transmission error, arcsec", legend=place)
        ax.figure.draw_without_rendering()
        box, frame = ax.get_legend().get_window_extent(), ax.get_window_extent()
        outer = ax.figure.bbox
        assert outer.x0 <= box.x0
        assert box.x1 <= outer.x1
        assert outer.y0 <= box.y0
        assert box.y1 <= outer.y1
        assert box.y1 <= frame.y0 or box.x0 >= frame.x1
        assert not any(box.overlaps(other.get_tightbbox(for_layout_only=True)) for other in axes[:-1])
        assert frame.height > 0.2 * outer.height / shape[2]
        assert frame.width > 0.3 * outer.width / shape[3]
        title = ax.title.get_window_extent()
        assert outer.x0 <= title.x0
        assert title.x1 <= outer.x1
        assert overlapping_texts(ax) == []
        assert len(legend(ax)) == count


# --- titles and constants ---------------------------------------------------------------------------------------------


def test_titles_say_unit_torque_and_direction() -> None:
    theta = 2 * np.pi * np.arange(32) / 32
    state = equilibrium(MODEL, theta[::-1], torque="20 N*m")
    assert state.plot().get_title() == "unit 7, 20 N*m, reverse, loaded equilibrium"
    assert MODEL.plot(direction=-1.0, torque="412 N*m").get_title() == "unit 7, 412 N*m, reverse, closed form"
    run = run_from_arrays(input_angle=121 * theta, output_angle=theta, torque="20 N*m", direction="forward")
    assert run.plot(ratio=MODEL).get_title() == "unit 7, run, 20 N*m, forward"
    found = replace(diagnosis(), declared=replace(MODEL, name="unit 7"))
    for kind in ("waveform", "residual"):
        title = found.plot(kind=kind).get_title().replace("\n", " ")
        assert "unit 7" in title
        assert title.endswith("20 N*m, forward")


def test_a_constant_that_would_flatten_the_waves_is_taken_off_and_stated() -> None:
    """A tangential error of all carrier bores lags by e / r6 = 38.197 arcsec for 5 um and has no wave at all."""
    bores = tuple(effect("coupling.carrier_bore_position", crank=j, tangential="5 um") for j in range(2))
    lagging = MODEL.with_effects(*bores)
    for kind in ("waveform", "stacked"):
        ax, alone = lagging.plot(kind=kind), MODEL.plot(kind=kind)
        x, y = line(ax, "total")
        assert x == pytest.approx(line(alone, "total")[0])
        free = line(alone, "total")[1]
        stated = re.search(r"about (\S+), arcsec", ax.get_ylabel())
        assert stated
        assert float(stated[1]) == pytest.approx(-38.197 + free.mean(), rel=1e-3)
        assert y + float(stated[1]) == pytest.approx(free - 38.197, abs=5e-3)
        constants = [
            float(label.replace("\n", " ").split("about ")[1]) for label in legend(ax) if "carrier_bore" in label
        ]
        assert sum(constants) == pytest.approx(-38.197, rel=1e-3)
        assert np.ptp(ax.get_ylim()) < 2.5 * np.ptp(y)
        assert alone.get_ylabel() == "transmission error, arcsec"  # its own constant is less than the wave


def envelope_of(offset: float) -> Any:
    """Budget of one wave of 5 arcsec and a shift of the whole, drawn."""
    wave = 5 * ARCSEC * np.abs(np.cos(np.linspace(0, 2 * np.pi, 90)))
    edge = wave + offset * ARCSEC
    worst = WorstCase(-edge, edge, (0.0, 0.0), 0.0, 0.0, (0, 0), np.zeros(0), 0.0)
    zero, third = np.zeros(90), wave / 3
    numbers = dict.fromkeys(("offset_mean", "offset_deviation", "nominal_peak_to_peak", "nominal_mean_square"), 0.0)
    found = Budget(None, zero, third + offset * ARCSEC / 3, third, **numbers, mean_square=0.0, rss=0.0, worst=worst,
                   contributions=())  # fmt: skip
    return found.plot(kind="envelope"), edge / ARCSEC


def test_an_offset_that_would_flatten_the_envelope_is_taken_off_and_stated() -> None:
    ax, edge = envelope_of(2.0)
    assert legend(ax) == ["one standard deviation", "worst case", "expected"]
    assert line(ax, "worst case")[1] == pytest.approx(-edge)
    ax, edge = envelope_of(40.0)
    worst = next(label for label in legend(ax) if label.startswith("worst case"))
    stated = re.search(r"less (\S+) arcsec either way", worst)
    assert stated
    assert float(stated[1]) == pytest.approx(40, rel=5e-3)
    assert line(ax, worst)[1] - float(stated[1]) == pytest.approx(-edge, abs=0.15)
    assert "of the wave" in legend(ax)[0]


# --- long traces ------------------------------------------------------------------------------------------------------


def test_a_long_trace_keeps_its_peaks_and_its_file_stays_small() -> None:
    rng = np.random.default_rng(3)
    theta = np.linspace(0, 20 * np.pi, 200_000)
    error = 5 * np.cos(40 * theta) + 0.2 * rng.standard_normal(theta.size)
    error[[123_457, 180_001]] = 31.0, -27.0
    run = run_from_arrays(input_angle=121 * theta, te=error * ARCSEC, ratio=UNIT)
    ax = run.plot(ratio=UNIT)
    x, y = line(ax, "forward")
    assert (y.max(), y.min()) == pytest.approx((31.0, -27.0))
    assert (x[0], x[-1]) == pytest.approx((0, 3600))
    assert x[np.argmax(y)] == pytest.approx(np.degrees(theta[123_457]))
    assert x.size <= 2 * COLUMNS + 4
    # in each column of points the line reaches as high and as low as the data
    column, kept = (np.minimum((at / at[-1] * COLUMNS).astype(int), COLUMNS - 1) for at in (theta, x))
    for edge in (np.maximum, np.minimum):
        whole, drawn = (np.zeros(COLUMNS) for _ in range(2))
        edge.at(whole, column, error)
        edge.at(drawn, kept, y)
        assert np.isclose(drawn, whole, atol=1e-6).mean() > 0.99  # but for samples on the border of two
    assert len(svg_element(ax.figure)) < 150_000
    assert len(svg_element(run.plot(kind="spectrum", ratio=UNIT, highest=5000).figure)) < 800_000


def test_gaps_and_turns_back_of_a_long_trace_stay() -> None:
    there = np.linspace(0, 1, 30_000)
    x = np.concatenate([there, [np.nan], there[::-1]])
    y = np.concatenate([there**2, [np.nan], 2 - there])
    thin, values = for_drawing(x, y)
    (gap,) = np.flatnonzero(np.isnan(thin))
    assert (thin[0], thin[gap - 1], thin[gap + 1], thin[-1]) == (0, 1, 1, 0)
    assert (values[gap - 1], values[gap + 1]) == (1, 2)
    assert thin.size < 10_000
    still = for_drawing(np.random.default_rng(1).standard_normal(50_000), np.sin(np.arange(50_000.0)))
    assert still[0].size < 10_000
    assert for_drawing(there[:4000], y[:4000])[0].size == 4000  # short ones are drawn as they are


# --- in grey ----------------------------------------------------------------------------------------------------------

_APART = 0.25  # of all greys: what a laser printer's screen keeps apart at this line width


def greys(ax: Axes, words: tuple[str, ...]) -> list[float]:
    """Luminance of the first lines whose labels begin so."""
    found = [*ax.get_lines(), *ax.collections]
    firsts = [next(item for item in found if str(item.get_label()).startswith(word)) for word in words]
    return [luminance(np.atleast_2d(mpl.colors.to_rgba_array(item.get_color()))[0][:3]) for item in firsts]


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("waveform", ("measured", "declared", "with what was added")),
        ("residual", ("before", "after")),
        ("spectrum", ("residual before", "residual after")),
    ],
)
def test_before_and_after_are_apart_in_grey(kind: str, words: tuple[str, ...]) -> None:
    shades = sorted(greys(diagnosis().plot(kind=kind), words))
    assert min(np.diff(shades)) > _APART


@pytest.mark.parametrize(("kind", "after"), [("orders", "after"), ("waveform", "compensated")])
def test_compensated_is_apart_from_measured_in_grey(kind: str, after: str) -> None:
    shades = greys(compensation().plot(kind=kind), ("measured", after))
    assert abs(shades[0] - shades[1]) > _APART


def test_a_perfect_fit_does_not_hide_what_was_measured() -> None:
    """Black of the measured line is seen in nearly every column of points of the axes."""
    theta = np.linspace(0, 2 * np.pi, 1024)
    wave = 9 * ARCSEC * np.cos(20 * theta)
    ax = replace(diagnosis(), traces=(Trace("run.csv", 1.0, theta, wave, 0 * wave, wave),)).plot()
    pixels = mpl.image.imread(io.BytesIO(to_bytes(ax.figure, "png")))[..., :3]
    box = ax.get_window_extent()
    scale = 130 / ax.figure.dpi
    inside = pixels[
        round((ax.figure.bbox.height - box.y1) * scale) + 5 : round((ax.figure.bbox.height - box.y0) * scale) - 5,
        round(box.x0 * scale) + 5 : round(box.x1 * scale) - 5,
    ]
    dark = (inside.max(axis=2) < 0.35).any(axis=0)
    assert dark.mean() > 0.95


# --- costs ------------------------------------------------------------------------------------------------------------


def test_no_cost_is_drawn_where_no_limit_is_met() -> None:
    from rverror.tolerances import FrontPoint

    missed = tuple(FrontPoint(limit * ARCSEC, None, "too tight") for limit in (10.0, 5.0))
    ax = cost_against_limit(every_kind()["Allocation"][0], front=missed)
    assert np.isnan(line(ax, "least cost")[1]).all()
    assert list(line(ax, "cannot be met: no cost")[0]) == [5, 10]
    to_bytes(ax.figure, "png")
