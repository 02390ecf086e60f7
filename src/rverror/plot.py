"""Plots of a diagnosis and of a model: axes in, axes out.  matplotlib comes with the extra ``plot``."""

from __future__ import annotations

import io
import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from rverror.action_line import Array
from rverror.by_order import residual_spectrum, turns_of
from rverror.compose import transmission_error_by_effect
from rverror.diagnosis import Diagnosis, Trace, describe
from rverror.errors import InputError
from rverror.model import Model
from rverror.spectrum import frames_of_order
from rverror.units import ARCSEC

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito's colours, which stay apart in print and for colour-blind eyes.
_MEASURED, _BEFORE, _AFTER, _TOTAL = "#A0A0A0", "#E69F00", "#0072B2", "#000000"


_NAMED = 12  # effects for which a legend has room


def new_figure(rows: int = 1, *, width: float = 9.0, height: float = 3.2) -> tuple[Figure, list[Axes]]:
    """Figure with its axes one above the other, without a window.

    Parameters
    ----------
    rows : int
    width, height : float
        Of the figure and of each row, inches.

    Returns
    -------
    Figure, list of Axes

    Raises
    ------
    InputError
        If matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise InputError("plots need matplotlib; install it with: pip install 'rverror[plot]'") from error
    figure = Figure(figsize=(width, height * rows), layout="constrained")
    axes = figure.subplots(rows, 1, squeeze=False)[:, 0]
    return figure, list(axes)


def waveform(trace: Trace, *, ax: Axes | None = None) -> Axes:
    """Measured against predicted error of one run over a turn, before and after.

    Parameters
    ----------
    trace : Trace
        One of `Diagnosis.traces`.
    ax : Axes, optional
        Where to draw; a new figure where left out.

    Returns
    -------
    Axes
    """
    ax = ax or new_figure()[1][0]
    angle = np.degrees(trace.theta)
    same = np.allclose(trace.before, trace.after)
    ax.plot(angle, trace.measured / ARCSEC, color=_MEASURED, lw=2.0, label="measured, mean of revolutions")
    ax.plot(angle, trace.before / ARCSEC, color=_BEFORE, lw=1.0, ls="--", label="declared model")
    if not same:
        ax.plot(angle, trace.after / ARCSEC, color=_AFTER, lw=1.0, label="with what was added")
    ax.set(
        xlabel="output angle, deg",
        ylabel="transmission error, arcsec",
        title=f"{_plain(_base(trace.name))} ({'forward' if trace.direction > 0 else 'reverse'})",
    )
    ax.margins(x=0)
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=3, frameon=False, fontsize="small")
    return ax


def order_spectrum(diagnosis: Diagnosis, *, run: int = 0, highest: float | None = None, ax: Axes | None = None) -> Axes:
    """Order spectrum of the residual of one run before and after, with the strongest peaks named by their frames.

    Parameters
    ----------
    diagnosis : Diagnosis
    run : int
        Which run.
    highest : float, optional
        Highest order to show; 260, or what the run holds.
    ax : Axes, optional

    Returns
    -------
    Axes
    """
    ax = ax or new_figure()[1][0]
    trace = diagnosis.traces[run]
    found, turns = residual_spectrum(trace), turns_of(trace)
    order, before, after = found.order, found.before / ARCSEC, found.after / ARCSEC
    shown = order <= (highest or 260)
    bottom = max(float(np.median(after)) / 30, 1e-5)
    ax.vlines(order[shown], bottom, before[shown], color=_BEFORE, lw=1.6, label="residual before")
    ax.vlines(order[shown], bottom, after[shown], color=_AFTER, lw=0.9, label="residual after")
    ax.set_yscale("log")
    ax.set_ylim(bottom, max(float(before[shown].max(initial=0.0)) * 6, 100 * bottom))
    floor, apart = max(8 * float(np.median(after)), bottom), max(2, round(order[shown][-1] / 16 * turns))
    for i in _peaks(np.where(shown, before, 0.0), floor=floor, apart=apart):
        frames = frames_of_order(diagnosis.declared.mechanism, float(order[i]))
        name = f"{order[i]:g}" + (f"\n{_plain(_short(frames[0]))}" if frames else "\nno frame")
        ax.annotate(
            name,
            (order[i], before[i]),
            (0, 4),
            textcoords="offset points",
            ha="center",
            va="bottom",
            fontsize="x-small",
        )
    ax.set(
        xlabel="order, per output turn",
        ylabel="amplitude, arcsec",
        title=f"residual spectrum, {_plain(_base(trace.name))}",
    )
    ax.legend(loc="upper right", frameon=False, fontsize="small")
    return ax


def _peaks(size: Array, *, floor: float, apart: int) -> list[int]:
    """The six largest lines above a floor that are far enough apart to be named."""
    chosen: list[int] = []
    for i in np.argsort(-size):
        if size[i] > floor and len(chosen) < 6 and all(abs(int(i) - j) >= apart for j in chosen):
            chosen.append(int(i))
    return chosen


def model_waveform(model: Model, *, direction: float = 1.0, ax: Axes | None = None) -> Axes:
    """Transmission error of a model over one turn by effect and in total, closed form.

    Parameters
    ----------
    model : Model
    direction : float
        +1 forward, -1 reverse.
    ax : Axes, optional

    Returns
    -------
    Axes
    """
    ax = ax or new_figure()[1][0]
    theta = np.linspace(0, 2 * np.pi, 4096, endpoint=False)
    parts = transmission_error_by_effect(model, theta, direction=direction) / ARCSEC
    angle = np.degrees(theta)
    named = np.argsort(-np.abs(parts).max(axis=1), kind="stable")[:_NAMED].tolist()
    for i, (effect, part) in enumerate(zip(model.effects, parts, strict=True)):
        label = _plain(describe(effect.key, effect.indices)) if i in named else None
        ax.plot(angle, part, lw=0.6, alpha=0.7, label=label)
    ax.plot(angle, parts.sum(axis=0), color=_TOTAL, lw=1.0, label="total")
    ax.set(
        xlabel="output angle, deg",
        ylabel="transmission error, arcsec",
        title=_plain(model.name or "transmission error"),
    )
    ax.margins(x=0)
    more = len(model.effects) - len(named)
    title = f"the largest, {more} more unnamed" if more else None
    ax.legend(
        loc="upper left",
        bbox_to_anchor=(1.01, 1),
        frameon=False,
        fontsize="x-small",
        title=title,
        title_fontsize="x-small",
    )
    return ax


def diagnosis_figure(diagnosis: Diagnosis) -> Figure:
    """Waveform of each run and the residual spectrum of the first, in one figure.

    Parameters
    ----------
    diagnosis : Diagnosis

    Returns
    -------
    Figure
    """
    figure, axes = new_figure(len(diagnosis.traces) + 1)
    for trace, ax in zip(diagnosis.traces, axes[:-1], strict=True):
        waveform(trace, ax=ax)
    order_spectrum(diagnosis, ax=axes[-1])
    return figure


def to_bytes(figure: Figure, kind: str) -> bytes:
    """Figure as the bytes of a PNG or SVG file."""
    from matplotlib import rc_context

    buffer = io.BytesIO()
    # without metadata a picture holds no address and is the same tomorrow
    nameless = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    options: dict[str, Any] = {"dpi": 130} if kind == "png" else {"metadata": nameless}
    with rc_context({"svg.hashsalt": "rverror"}), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from")  # a box stands for it
        figure.savefig(buffer, format=kind, **options)
    return buffer.getvalue()


def svg_element(figure: Figure) -> str:
    """Figure as an SVG element to put into a page."""
    text = to_bytes(figure, "svg").decode("utf-8")
    return text[text.index("<svg") :]


def _plain(text: str) -> str:
    """Text that is drawn as it stands: no formula between dollar signs, nothing that no font can hold."""
    printable = "".join(letter if letter.isprintable() else " " for letter in text)
    return printable.replace("$", r"\$")


def _base(name: str) -> str:
    return name.replace("\\", "/").rpartition("/")[2]


def _short(frame: str) -> str:
    return frame.replace("carrier, disc or crank", "carrier/disc/crank").replace(
        "output side (encoder, coupling)", "output side"
    )
