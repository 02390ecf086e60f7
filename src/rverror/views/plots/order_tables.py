"""Plots of order tables: passports of orders, what accounts for each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from rverror.base.errors import InputError
from rverror.base.numbers import brief, way
from rverror.base.units import ARCSEC
from rverror.diagnosis.order_passport import SAME_ORDER, SAME_SETTING, OrderPassport, passport
from rverror.diagnosis.result import Diagnosis
from rverror.runs.order_table import OrderCase, OrderTable
from rverror.views.plots import style
from rverror.views.plots.figure import Axes, axes_for
from rverror.views.plots.labels import labelled
from rverror.views.shown_units import ANGLE, SPEED, TORQUE

_MARKS = "osD^vP"  # one an order
_MOST = 6  # orders whose passports are drawn
_CURVE = 121  # points of a law
#: Share of an order's power: its name, colour and hatch.
_SHARES = {
    "parts": ("part errors", style.BLUE, ""),
    "compliance": ("compliance", style.ORANGE, "//"),
    "measuring_chain": ("measuring chain", style.GREY, ".."),
    "empirical": ("law only", "white", "xx"),
    "left": ("nothing", "white", ""),
}


def _look(number: int, order: float, sense: float) -> dict[str, Any]:
    """Look and name of the n-th order in one direction."""
    colour = style.line_style(number)["color"]
    return {
        "color": colour,
        "marker": _MARKS[number],
        "ls": "solid" if sense > 0 else style.DASHED,
        "mfc": colour if sense > 0 else "white",
        "label": f"order {brief(order, 6)}, {way(sense)}",
    }


def strongest_orders(found: OrderTable | Diagnosis, *, ax: Axes | None = None) -> Axes:
    """Passports of the strongest orders of a table or a diagnosis over the torque, as `passport_plot` draws them.

    A table that tells no load law is drawn over the input speed, where it holds several speeds.
    """
    if isinstance(found, Diagnosis):
        return passport_plot(found.passport, ax=ax)
    passports = passport(found.cases)
    speeds = [speed for case in found.cases if (speed := case.condition.input_speed) is not None]
    several = bool(speeds) and max(speeds) - min(speeds) > SAME_SETTING * max(speeds)
    if several and not _has_load_law(passports):
        return _over_speed(found.cases, passports, ax)
    return passport_plot(passports, ax=ax)


def _has_load_law(passports: Sequence[OrderPassport]) -> bool:
    return any(law.slope is not None for one in passports for law in one.laws)


def _over_speed(cases: Sequence[OrderCase], passports: Sequence[OrderPassport], ax: Axes | None) -> Axes:
    """Measured amplitudes of the strongest orders over the input speed."""
    ax = axes_for(ax, height=4.2)
    for number, one in enumerate(passports[:_MOST]):
        for law in one.laws:
            points = [
                (case.condition.input_speed, abs(wave))
                for case in cases
                if case.condition.direction == law.direction and case.condition.input_speed is not None
                for wave in case.waves[np.abs(case.orders - one.order) <= SAME_ORDER]
            ]
            speed, size = np.array(sorted(points)).reshape(-1, 2).T
            ax.plot(SPEED.of(speed), ANGLE.of(size), ms=4, lw=0.8, **_look(number, one.order, law.direction))
    x, y = "input speed, rpm", "amplitude, arcsec"
    return labelled(ax, "orders against speed", x=x, y=y, yscale="log", legend="beside")


def passport_plot(passports: Sequence[OrderPassport], *, ax: Axes | None = None) -> Axes:
    """Amplitude of the six strongest orders over the size of the output torque, with constant and load part as lines.

    Forward is drawn with whole lines and filled marks, reverse with dashes and open ones.

    Parameters
    ----------
    passports : sequence of OrderPassport
        The strongest first.
    ax : Axes, optional

    Raises
    ------
    InputError
        If no order was measured at several torques.
    """
    if not _has_load_law(passports):
        raise InputError("no order was measured at two torques or more; a passport is drawn over the torque")
    ax = axes_for(ax, height=4.2)
    for number, one in enumerate(passports[:_MOST]):
        for law in one.laws:
            look = _look(number, one.order, law.direction)
            if law.slope is not None:
                torque = np.linspace(0.0, float(law.torque.max()), _CURVE)
                size = np.abs(law.constant.value + law.slope.value * torque)
                ax.plot(TORQUE.of(torque), ANGLE.of(size), lw=1.2, **look | {"marker": "", "label": None})
            ax.plot(TORQUE.of(law.torque), ANGLE.of(np.abs(law.waves)), ms=5, **look | {"ls": "none"})
    return labelled(
        ax,
        "orders over the load",
        x="size of the output torque, N*m",
        y="amplitude, arcsec",
        yscale="log",  # the strongest order is often tens of times the next
        legend="beside",
        legend_title="lines: constant and load part",
    )


def order_shares(diagnosis: Diagnosis, *, ax: Axes | None = None) -> Axes:
    """What accounts for the power of each order of diagnosed tables, as bars that make 100 % together.

    A part that works against the others stands below zero.

    Raises
    ------
    InputError
        If no table was diagnosed.
    """
    if not diagnosis.shares:
        raise InputError("no order table was diagnosed, so no order has shares; give order tables to diagnose")
    ax = axes_for(ax, height=4.2)
    at = np.arange(len(diagnosis.shares))
    up, down = np.zeros(at.size), np.zeros(at.size)
    for name, (label, face, hatch) in _SHARES.items():
        part = 100 * np.array([getattr(share, name) for share in diagnosis.shares])
        look: dict[str, Any] = {"color": face, "hatch": hatch, "edgecolor": "black", "linewidth": 0.5}
        ax.bar(at, part, bottom=np.where(part < 0, down, up), label=label, **look)
        up, down = up + np.maximum(part, 0), down + np.minimum(part, 0)
    ticks = [f"{brief(one.order, 6)}\n{one.amplitude / ARCSEC:.3g}" for one in diagnosis.shares]
    ax.set_xticks(at, ticks, size="x-small")
    ax.axhline(0, color="black", lw=0.8)
    return labelled(
        ax,
        "what accounts for each order",
        x="order, per output turn, and its amplitude, arcsec",
        y="share of the power, %",
        legend="beside",
    )
