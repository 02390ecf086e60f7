"""Plots of a diagnosis: what they show is what the report says, for one run and many, errors and torques."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.axes import Axes

from diagnosed_example import outcome
from drawn import alike_in_grey, legend, line, overlapping_texts, stems
from every_kind import diagnosis
from rverror import Diagnosis, InputError
from rverror.base.units import ARCSEC
from rverror.diagnosis.result import Line, Trace


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Diagnosis:
    return outcome(tmp_path_factory.getbasetemp() / "diagnosis-of-the-example").diagnosis


@pytest.fixture(scope="module")
def ripple(found: Diagnosis) -> Diagnosis:
    """The same as a torque ripple: an arcsec read as a millinewton metre."""
    traces = tuple(
        replace(
            t,
            measured=t.measured / ARCSEC,
            before=t.before / ARCSEC,
            after=t.after / ARCSEC,
            left_out=tuple(rest / ARCSEC for rest in t.left_out) if t.left_out else None,
        )
        for t in found.traces
    )
    return replace(found, traces=traces, quantity="torque", noise_rms=found.noise_rms / ARCSEC)


def ticks(ax: Axes) -> list[str]:
    return [tick.get_text() for tick in ax.get_yticklabels()]


@pytest.mark.parametrize("run", [0, 1])
def test_residual_is_that_of_revolutions_left_out(found: Diagnosis, run: int) -> None:
    ax = found.plot(kind="residual", run=run)
    left = found.traces[run].left_out
    assert left is not None
    assert "left-out" in ax.get_title()
    assert ax.get_ylabel() == "measured less model, arcsec"
    for word, rest, label in zip(("before", "after"), left, legend(ax), strict=True):
        _, y = line(ax, label)
        assert y == pytest.approx((rest - rest.mean()) / ARCSEC)
        assert label == f"{word}: {np.std(rest) / ARCSEC:.3g} arcsec rms"


def test_without_left_out_revolutions_the_title_does_not_claim_them(found: Diagnosis) -> None:
    bare = replace(found, traces=tuple(replace(t, left_out=None) for t in found.traces))
    ax = bare.plot(kind="residual")
    assert "left-out" not in ax.get_title()
    trace = bare.traces[0]
    _, y = line(ax, legend(ax)[1])
    assert y == pytest.approx((trace.measured - trace.after) / ARCSEC, abs=1e-9)


@pytest.mark.parametrize("word", ["measured less model, N*m", "amplitude, N*m", "torque, N*m"])
def test_a_torque_ripple_is_drawn_in_newton_metres(ripple: Diagnosis, found: Diagnosis, word: str) -> None:
    kinds = {"measured": "residual", "amplitude": "spectrum", "torque": "waveform"}
    kind = kinds[word.split()[0].rstrip(",")]
    ax, as_error = ripple.plot(kind=kind), found.plot(kind=kind)
    assert word in (ax.get_xlabel(), ax.get_ylabel())
    label = legend(ax)[0].split(": ")[0]
    read = (
        stems if kind == "spectrum" else lambda ax, label: line(ax, next(i for i in legend(ax) if i.startswith(label)))
    )
    of_torque, of_error = (read(one, label)[1] for one in (ax, as_error))
    assert of_torque == pytest.approx(of_error / 1e3)


def test_candidates_are_ranked_by_what_they_lack_of_the_best(found: Diagnosis) -> None:
    data = found.candidates
    ax = found.plot(kind="candidates")
    assert len(ticks(ax)) == min(len(data), 10)
    assert found.added[0].effect.key in ax.get_title()
    points = sorted((int(y), float(x)) for drawn in ax.lines for x, y in drawn.get_xydata())
    for at, (row, label, point) in enumerate(zip(data, ticks(ax), points, strict=False)):
        assert label.startswith(row.key)
        behind = data[0].heldout_gain - row.heldout_gain
        assert point == (at, pytest.approx(behind, rel=1e-4, abs=1e-6))


def test_candidates_where_nothing_was_added_or_scored(found: Diagnosis) -> None:
    assert "nothing added" in replace(found, added=()).plot(kind="candidates").get_title()
    empty = replace(found, added=(), candidates=()).plot(kind="candidates")
    assert "no candidate was scored" in empty.get_title()
    assert ticks(empty) == []


def test_what_cannot_be_told_apart_is_marked(found: Diagnosis) -> None:
    first, other = found.added[0], found.candidates[1]
    marked = replace(first, indistinguishable=((other.key, other.indices),))
    ax = replace(found, added=(marked,)).plot(kind="candidates")
    alike, others = ax.lines
    assert list(alike.get_ydata()) == [0, 1]
    assert alike.get_markerfacecolor() != others.get_markerfacecolor() == "white"
    assert "cannot be distinguished" in legend(ax)[0]


def test_the_spectrum_reaches_what_was_found_and_names_it(found: Diagnosis) -> None:
    trace = found.traces[0]
    wave = 0.05 * ARCSEC * np.cos(900 * trace.theta)
    odd = replace(
        found,
        traces=(replace(trace, measured=trace.measured + wave, left_out=None),),
        unexplained=(Line(900.0, 0.05 * ARCSEC, 0.0, math.inf, ()),),
    )
    ax = odd.plot(kind="spectrum")
    assert stems(ax, "residual before")[0][-1] >= 900
    assert "900: no frame" in [text.get_text() for above in ax.child_axes for text in above.get_xticklabels()]
    assert found.plot(kind="spectrum").get_xlim()[1] == 260


def test_the_floor_is_what_the_lines_after_scatter_about(found: Diagnosis) -> None:
    ax = found.plot(kind="spectrum")
    x, floor = line(ax, "noise, rms")
    order, after = stems(ax, "residual after")
    rest = after[after < 4 * np.interp(order, x, floor)]
    assert np.sqrt(np.sum(rest**2) / x.size) == pytest.approx(np.sqrt(np.mean(floor**2)), rel=0.15)
    assert floor.max() < 5 * floor.min()  # lines that stand out do not lift it


@pytest.mark.parametrize("kind", ["waveform", "residual"])
def test_marks_stand_where_samples_were_set_aside_and_where_the_reading_slips(kind: str) -> None:
    theta = np.radians(20 + np.arange(360.0))
    wave = 9 * ARCSEC * np.cos(2 * theta)
    faults = {"set_aside": np.radians([30.0, 740.0, 745.0]), "slips": np.radians([365.0])}
    trace = Trace("run.csv", 1.0, theta, wave, 0 * wave, 0.9 * wave, **faults)
    ax = replace(diagnosis(), traces=(trace,)).plot(kind=kind)
    bare = replace(diagnosis(), traces=(replace(trace, set_aside=None, slips=np.zeros(0)),)).plot(kind=kind)
    for label, places in (("sample set aside", [30, 20, 25]), ("slip of the reading", [365])):
        x, y = line(ax, label)
        assert x == pytest.approx(places)
        assert not y.any()
        assert label in legend(ax)
        assert label not in legend(bare)
    assert ax.get_xlim() == pytest.approx(bare.get_xlim())
    assert ax.get_ylim() == pytest.approx(bare.get_ylim())
    assert not alike_in_grey(ax)
    assert not overlapping_texts(ax)


@pytest.mark.parametrize("kind", ["waveform", "spectrum", "residual"])
def test_a_run_that_is_not_there(found: Diagnosis, kind: str) -> None:
    for run in (-1, 2):
        with pytest.raises(InputError, match=rf"run = {run}: this diagnosis has 2 runs, counted from 0"):
            found.plot(kind=kind, run=run)
