"""Plots: axes in, axes out; what is drawn is what was computed, with its unit."""

from __future__ import annotations

import math
import pickle
import re
import subprocess
import sys
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any
from unittest import mock
from xml.etree import ElementTree as ET

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from diagnosed_example import COS, SIN, outcome
from drawn import alike_in_grey, cut_off, line, overlapping_texts, stems, units_missing
from every_kind import compensation, drive_lot, every_kind, lot, matched, runs_compared, trend
from pages import DOCS
from rverror import (
    Diagnosis,
    Drive,
    InputError,
    Model,
    Run,
    allocate,
    effect,
    equilibrium,
    error_budget,
    influence,
    limit,
    reducer,
    run_from_arrays,
    tolerance,
    transmission_error,
)
from rverror.base.units import ARCSEC
from rverror.base.viewed import Viewed
from rverror.diagnosis.result import Trace
from rverror.dynamics import modes, run_up, speed_response
from rverror.geartrain import Friction
from rverror.model import Bench
from rverror.runs import orders_from_arrays
from rverror.statics import WearCoefficients, hysteresis, torsion_curve, wear
from rverror.tolerances.cost import Reciprocal
from rverror.views.plots.diagnosed import order_spectrum, waveform
from rverror.views.plots.drawing import PICTURES, draw
from rverror.views.plots.figure import new_figure, svg_element, to_bytes
from rverror.views.plots.page_figures import figure_of
from rverror.views.plots.waveforms import model_waveform

SWING = Bench(load_inertia="100 kg*m^2")
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


def peaks(axes: Axes) -> list[str]:
    return [text.get_text() for above in axes.child_axes for text in above.get_xticklabels()]


# --- what all share ---------------------------------------------------------------------------------------------------

DRAWINGS = {
    "waveform": lambda found, ax: waveform(found, ax=ax),
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
    waveform(found, run=run, ax=ax)
    assert ax.get_title() == f"{found.declared.name}, {word}.csv, 20 N*m, {word}"
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
    waveform(replace(found, traces=(trace,)), ax=ax)
    assert len(legend(ax)) == len(ax.get_lines()) == 2


@pytest.mark.parametrize("name", ["bench/a/forward.csv", "C:\\bench\\forward.csv", "forward.csv"])
def test_titles_hold_the_file_name_without_its_folder(found: Diagnosis, ax: Axes, name: str) -> None:
    waveform(replace(found, traces=(replace(found.traces[0], name=name),)), ax=ax)
    assert ax.get_title() == f"{found.declared.name}, forward.csv, 20 N*m, forward"


# --- order spectrum ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("run", [0, 1])
def test_spectrum_shows_the_encoder_before_and_not_after(found: Diagnosis, ax: Axes, run: int) -> None:
    order_spectrum(found, run=run, ax=ax)
    assert ("forward", "reverse")[run] in ax.get_title()
    assert legend(ax) == ["residual before", "residual after", "noise, rms"]
    orders, before = stems(ax, "residual before")
    again, after = stems(ax, "residual after")
    assert orders[0] == again[0] == 1
    assert 250 < orders[-1] <= 260
    assert before[0] == pytest.approx(math.hypot(COS, SIN), rel=0.03)
    assert after[0] < 0.1
    assert np.argmax(before) == 0
    assert any(name.startswith("1: ") for name in peaks(ax))


def test_spectrum_is_that_of_the_residual(found: Diagnosis, ax: Axes) -> None:
    """Against sums of cosines and sines, written out."""
    trace = found.traces[0]
    order_spectrum(found, highest=50, ax=ax)
    orders, drawn = stems(ax, "residual before")
    assert set(orders) <= set(range(1, 51))
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
    assert orders[np.argmax(before)] == 3.5
    assert before.max() == pytest.approx(5.0)
    assert any(name.startswith("3.5: ") and "idler" in name for name in peaks(ax))


def test_a_model_that_is_right_leaves_nothing_to_draw_but_axes(found: Diagnosis, ax: Axes) -> None:
    exact = tuple(replace(t, before=t.measured, after=t.measured, left_out=None) for t in found.traces)
    order_spectrum(replace(found, traces=exact), ax=ax)
    low, high = ax.get_ylim()
    assert 0 < low < high
    assert not peaks(ax)
    to_bytes(ax.figure, "png")


def test_named_peaks_stand_apart(found: Diagnosis, ax: Axes) -> None:
    order_spectrum(found, ax=ax)
    places = sorted(float(place) for above in ax.child_axes for place in above.get_xticks())
    assert 1 <= len(places) <= 8
    assert min(np.diff(places), default=math.inf) >= 5


# --- model waveform ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_model_waveform_draws_each_effect_and_their_sum(ax: Axes, direction: float) -> None:
    model_waveform(MODEL, direction=direction, waves=1000, ax=ax)
    assert ax.get_title() == f"test unit, {'forward' if direction > 0 else 'reverse'}, closed form"
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
    assert ax.get_title() == "RV-40E, forward, closed form"


def test_a_model_of_many_effects_can_be_drawn() -> None:
    """The largest have lines of their own."""
    pins = tuple(effect("cycloid.pin_position", pin=i, radial=1e-4 * (i + 1)) for i in range(40))
    ax = model_waveform(Model(MODEL.mechanism, pins))
    assert [text.split(", about")[0] for text in legend(ax)] == [
        *(f"cycloid.pin_position (pin {i})" for i in range(34, 40)),
        "sum of the 34 others",
        "total",
    ]
    to_bytes(ax.figure, "png")


# --- figures and files ------------------------------------------------------------------------------------------------


def test_the_figure_has_a_waveform_for_each_run_and_a_spectrum(found: Diagnosis) -> None:
    figure = figure_of(found)
    forward, reverse = (f"RV-40E example, as declared, {way}.csv, 20 N*m, {way}" for way in ("forward", "reverse"))
    spectra = [f"residual spectrum, {forward}", f"residual spectrum, {reverse}"]
    assert [ax.get_title() for ax in figure.axes] == [forward, reverse, *spectra]
    one_way = figure_of(replace(found, traces=found.traces[1:]))
    assert [ax.get_title() for ax in one_way.axes] == [reverse, f"residual spectrum, {reverse}"]


@pytest.mark.parametrize("rows", [1, 3])
def test_new_figure_grows_with_its_rows(rows: int) -> None:
    figure, axes = new_figure(rows, width=8, height=2)
    assert isinstance(figure, Figure)
    assert len(axes) == rows
    assert tuple(figure.get_size_inches()) == (8, 2 * rows)


def test_files_have_the_kind_that_was_asked() -> None:
    figure = model_waveform(MODEL).figure
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
    waveform(replace(found, traces=(trace,)), ax=axes[0])
    order_spectrum(replace(found, traces=(trace,), declared=worm), ax=axes[1])
    model_waveform(replace(worm, name=name), ax=axes[2])
    to_bytes(figure, "png")
    root = ET.fromstring(svg_element(figure))
    assert not [item for item in root.iter() if item.tag.endswith("script")]


def test_drawing_leaves_no_state_behind(found: Diagnosis) -> None:
    before = dict(mpl.rcParams)
    to_bytes(figure_of(found), "svg")
    assert dict(mpl.rcParams) == before


def test_importing_the_package_needs_no_matplotlib(tmp_path: Path) -> None:
    code = (
        "import sys; sys.modules['matplotlib'] = None\n"
        "import rverror, rverror.app.command_line, rverror.views.plots.drawing, rverror.views\n"
        "try: rverror.views.new_figure()\n"
        "except rverror.InputError as problem: print(problem)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path, check=True)
    assert "matplotlib" in done.stdout
    assert "rverror[plot]" in done.stdout
    assert done.stderr == ""


@pytest.mark.parametrize("name", [*DRAWINGS, "figure_of"])
def test_without_matplotlib_the_error_tells_the_remedy(
    found: Diagnosis, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(InputError, match=r"matplotlib.*pip install 'rverror\[plot\]'"):
        DRAWINGS.get(name, lambda found, _: figure_of(found))(found, None)


# --- one call ---------------------------------------------------------------------------------------------------------

THETA = 2 * np.pi * np.arange(256) / 256
BARE = Model(reducer("RV-003"))
DRIVE = Model(
    Drive(ratio=-14.0, shafts={"idler": 3.5}), (effect("shaft.eccentricity", shaft="idler", harmonic=1, cos=1e-4),)
)
RUN = run_from_arrays(
    input_angle=121 * np.concatenate([THETA, THETA + 2 * np.pi, 2 * np.pi - THETA]),
    te=1e-5 * np.cos(40 * np.concatenate([THETA, THETA, -THETA])) + 1e-7 * np.sin(np.arange(768) ** 2),
    torque="20 N*m",
)
ORDERS = orders_from_arrays(
    direction=[1, -1] * 30,
    torque=np.repeat([20e3, 50e3, 90e3], 20),
    temperature=np.repeat([293.15, 293.15, 300.15], 20),
    order=np.tile(np.repeat(np.arange(1, 11), 2), 3),
    amplitude=1e-6 * np.arange(1, 61),
    phase=np.zeros(60),
)
TORQUES = run_from_arrays(output_angle=THETA, direction="forward", torque_record=1e3 * (3 + np.cos(13 * THETA)))
NEEDED: dict[tuple[type, str], dict[str, Any]] = {
    (Run, "waveform"): {"ratio": 121.0},
    (Run, "spectrum"): {"ratio": MODEL},
}


@pytest.fixture(scope="module")
def things(found: Diagnosis) -> dict[str, Any]:
    """One or more of every kind that has a plot, the empty ones among them."""
    tolerances = (
        tolerance("crank.eccentricity", "5 um", cost=Reciprocal(10.0, 0.005), bounds=(1e-4, 0.1)),
        tolerance("crank.index", "1 arcmin", cost=Reciprocal(1.0, 1e-4), bounds=(1e-5, 1e-3)),
    )
    asked = [limit("transmission_error", "60 arcsec", torque="9 N*m"), limit("lost_motion", torque="1 N*m")]
    with (
        mock.patch("rverror.tolerances.full_budget.POINTS", 8),
        mock.patch.multiple("rverror.tolerances.loaded_units", FINE=720, POSITIONS=6),  # as the fixture few_angles
    ):
        units = error_budget(MODEL, tolerances, theta=THETA, count=1024, index_count=256, limits=asked, loaded_count=16)
    assert units.at_load is not None
    least = allocate(MODEL, tolerances, THETA, limit="60 arcsec", kind="worst")
    ripple = tuple(replace(t, torque=None, left_out=None) for t in found.traces[:1])
    return {
        "model": MODEL,
        "bare model": BARE,
        "drive": DRIVE,
        "reducer": BARE.mechanism,
        "influence": influence(BARE.mechanism, THETA, "cycloid.pin_circle", harmonic=1),
        "equilibrium": equilibrium(MODEL, THETA, torque="20 N*m"),
        "wear": wear(
            BARE,
            torque="9 N*m",
            input_speed="1000 rpm",
            hours=[0, 50, 100],
            coefficients=WearCoefficients(disc="1e-9 mm^3/(N*m)", pin="1e-9 mm^3/(N*m)"),
            disc_width="9 mm",
            gear_width="8 mm",
            direction=1.0,
        ),
        "torsion": torsion_curve(BARE, [0.0, 0.1], torques=["-9 N*m", 0, "9 N*m"]),
        "hysteresis": hysteresis(BARE, [0.0, 0.1], torques=["-9 N*m", 0, "9 N*m"], friction=Friction(drag="1 N*m")),
        "efficiency": every_kind()["Efficiency"][0],
        "contact pressure": every_kind()["ContactPressure"][0],
        "modes": modes(replace(MODEL, bench=SWING), torque="100 N*m"),
        "speeds": speed_response(replace(MODEL, bench=SWING), np.linspace(40, 80, 9), torque="100 N*m"),
        "run-up": run_up(replace(MODEL, bench=SWING), [0, 0.05], [0, 40], torque="100 N*m", samples=64),
        "run": RUN,
        "torque run": TORQUES,
        "order table": ORDERS,
        "order table over speeds": orders_from_arrays(
            direction=[1, 1, -1, -1],
            order=[39] * 4,
            cos=[1e-5, 1e-6, 3e-6, 2e-6],
            sin=[0] * 4,
            input_speed=[10, 20, 10, 20],
        ),
        "compensation": compensation(),
        "diagnosis": found,
        "nothing added": replace(found, added=(), candidates=()),
        "torque ripple": replace(found, traces=ripple, quantity="torque"),
        "budget": units.closed,
        "error budget": units,
        "virtual units": units.units,
        "allocation": replace(least, verified=units.at_load.verified),
        "front": least,
        "lot": lot(),
        "trend": trend(),
        "runs compared": runs_compared(),
        "matched": matched(),
        "lot of drives": drive_lot(),
    }


def plots(things: dict[str, Any], name: str) -> list[tuple[str, dict[str, Any]]]:
    """Kinds of plot of a thing that can be drawn, with what they need."""
    thing = things[name]
    kinds = [kind for kind in PICTURES[type(thing).__name__] if (kind == "front") == (name == "front")]
    if name == "drive":  # no contacts
        kinds.remove("mechanism")
    if isinstance(thing, Diagnosis):
        kinds = [kind for kind in kinds if kind not in ("passport", "shares")]  # of other measurements
    return [(kind, NEEDED.get((type(thing), kind), {})) for kind in kinds]


NAMES = (
    "model", "bare model", "drive", "reducer", "influence", "equilibrium", "torsion", "hysteresis",
    "efficiency", "contact pressure", "wear", "modes", "speeds", "run-up",
    "run", "torque run", "order table", "order table over speeds", "compensation", "diagnosis",
    "nothing added", "torque ripple", "budget", "error budget", "virtual units", "allocation", "lot",
    "trend", "runs compared", "matched", "lot of drives",
)  # fmt: skip


def test_every_kind_is_tried(things: dict[str, Any]) -> None:
    assert {type(things[name]).__name__ for name in NAMES} == set(PICTURES)


#: Of each kind the fullest one: the others are drawn by the same plots with less in them.
FULLEST = ("model", "reducer", "influence", "equilibrium", "torsion", "hysteresis", "efficiency", "contact pressure",
           "wear", "speeds", "run-up", "run", "order table", "compensation",
           "diagnosis", "torque ripple", "budget", "error budget", "virtual units", "allocation",
           "lot", "trend", "runs compared", "matched", "lot of drives")  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_every_plot_can_be_read(things: dict[str, Any], name: str) -> None:
    """A unit on every axis; a grey print tells the lines apart; no text lies over another, nothing is cut off."""
    for kind, options in plots(things, name):
        ax = things[name].plot(kind=kind, **options)
        where = f"{name}, {kind}"
        assert units_missing(ax) == [], where
        assert ax.get_title(), where
        assert alike_in_grey(ax) == [], where
        if name in FULLEST:
            assert overlapping_texts(ax) == [], where
            assert cut_off(ax) == [], where


@pytest.mark.parametrize("name", FULLEST)
def test_every_plot_takes_axes(things: dict[str, Any], name: str) -> None:
    for kind, options in plots(things, name):
        given = Figure().add_subplot(projection="polar" if kind == "polar" else "rectilinear")
        assert draw(things[name], kind=kind, ax=given, **options) is given
        assert given.has_data()


@pytest.mark.parametrize("name", FULLEST)
def test_axes_of_the_wrong_sort_are_refused(things: dict[str, Any], name: str) -> None:
    sorts = {sort: Figure().add_subplot(projection=sort) for sort in ("rectilinear", "polar", "3d")}
    several = Figure().subplots(2, 2)
    for kind, options in plots(things, name):
        right = "polar" if kind == "polar" else "rectilinear"
        for sort, ax in sorts.items():
            if sort != right:
                with pytest.raises(InputError, match=rf"ax has {sort} axes, this plot needs {right} ones; make them"):
                    things[name].plot(kind=kind, ax=ax, **options)
                assert not ax.has_data()
        with pytest.raises(InputError, match=r"ax is a ndarray, no axes of matplotlib"):
            things[name].plot(kind=kind, ax=several, **options)


def test_the_usual_plot_needs_no_word(found: Diagnosis) -> None:
    assert MODEL.plot().get_legend().get_texts()[-1].get_text() == "total"
    assert found.plot().get_title() == "RV-40E example, as declared, forward.csv, 20 N*m, forward"
    assert BARE.mechanism.plot().get_title().startswith("RV-003 at 0 deg")


def test_an_unknown_kind_names_those_there_are() -> None:
    with pytest.raises(
        InputError,
        match=r"kind = 'spectrun': a Model is drawn as waveform, stacked, polar, spectrum, mechanism; "
        r"did you mean 'spectrum'\?",
    ):
        MODEL.plot(kind="spectrun")


def test_an_unknown_option_names_those_there_are() -> None:
    with pytest.raises(
        InputError,
        match=r"option 'direktion': kind 'stacked' of a Model takes theta, direction, time, torque, most, waves; "
        r"did you mean 'direction'\?",
    ):
        MODEL.plot(kind="stacked", direktion=1.0)
    with pytest.raises(
        InputError, match=r"option 'run': kind 'candidates' of a Diagnosis takes no options; leave it out"
    ):
        draw(Diagnosis(**dict.fromkeys(Diagnosis.__dataclass_fields__)), kind="candidates", run=1)


def test_the_page_names_every_plot() -> None:
    """Each kind in the row of its result, in their order, the usual one first."""
    page = (DOCS / "plots.md").read_text(encoding="utf-8")
    told: dict[str, list[str]] = {}
    name = ""
    for result, kinds in re.findall(r"^\| (`\w+`)? ?\| ([^|]+) \|", page, flags=re.MULTILINE):
        name = result.strip("`") or name  # an empty cell stands for that above
        told.setdefault(name, []).extend(re.findall(r"`(\w+)`", kinds))
    assert told == {kind: list(plots) for kind, plots in PICTURES.items()}


def test_what_has_no_plot_is_told() -> None:
    with pytest.raises(InputError, match=r"a dict has no plot; these have: Model, Reducer, .*Allocation, Lot"):
        draw({})


def test_whatever_is_drawn_has_it_as_a_method_and_stays_what_it_was(things: dict[str, Any]) -> None:
    for name in NAMES:
        thing = things[name]
        assert isinstance(thing, Viewed)
        assert is_dataclass(thing)
        again = pickle.loads(pickle.dumps(thing))
        assert type(again) is type(thing)
        assert [f.name for f in fields(again)] == [f.name for f in fields(thing)]
        with pytest.raises(AttributeError):
            thing.plot = None  # frozen
        assert replace(thing).plot.__func__ is Viewed.plot
    assert pickle.loads(pickle.dumps(MODEL)) == MODEL


def test_without_matplotlib_every_plot_tells_the_remedy(
    things: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    for name in FULLEST:
        for kind, options in plots(things, name):
            with pytest.raises(InputError, match=r"pip install 'rverror\[plot\]'"):
                things[name].plot(kind=kind, **options)
