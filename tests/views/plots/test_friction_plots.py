"""Plots of losses to friction, of the loop of the torsion curve and of contact pressure: bars, branches and marks."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from drawn import legend, line, overlapping_texts, units_missing
from every_kind import FRICTION, MODEL, every_kind
from rverror import ARCSEC, InputError, Model, lost_motion, reducer
from rverror.geartrain import Friction
from rverror.statics import ContactPressure, Efficiency, Hysteresis, efficiency, hysteresis

UNIT = Model(reducer("RV-40E"))


def charted() -> list[Efficiency]:
    return [
        efficiency(MODEL, [0.0, 0.1], torque=torque, friction=FRICTION, direction=sense, drives=drives, method="closed")
        for torque in (412e3, 20e3, 100e3, 200e3)
        for drives in ("input", "output")
        for sense in (1.0, -1.0)
    ]


def test_bars_are_the_shares_and_the_efficiency_stands_above() -> None:
    found = charted()
    ax = found[0].plot(beside=found[1:])
    assert overlapping_texts(ax) == []
    assert units_missing(ax) == []
    names = legend(ax)
    assert names == [part.replace("_", " ") for part in found[0].losses]
    by_load = sorted(found, key=lambda one: one.torque)  # bars of one load in the order given
    heights = {group.get_label(): [bar.get_height() for bar in group] for group in ax.containers}
    for part, name in zip(found[0].losses, names, strict=True):
        np.testing.assert_allclose(heights[name], [100 * one.by_part[part] for one in by_load], atol=1e-12)
    told = [text.get_text().strip() for text in ax.texts]
    assert told == [f"{100 * one.mean:.1f} %" for one in by_load]
    tops = [100 * (1 - one.mean) for one in by_load]  # what is lost and what comes out are the whole
    assert [text.get_position()[1] for text in ax.texts] == pytest.approx(tops)
    ticks = [tick.get_text() for tick in ax.get_xticklabels()]
    assert ticks[:4] == [f"20, {side} drives, {way}" for side in ("input", "output") for way in ("forward", "reverse")]
    assert ticks[-1] == "412, output drives, reverse"


def test_what_all_bars_share_is_said_once() -> None:
    forward = [one for one in charted() if one.drives == "input" and one.direction[0] > 0]
    ax = forward[0].plot(beside=forward[1:])
    assert [tick.get_text() for tick in ax.get_xticklabels()] == ["20", "100", "200", "412"]
    assert ax.get_title().endswith("efficiency, input drives, forward")
    with pytest.raises(InputError, match=r"beside holds a float, no Efficiency; give results of efficiency\(\)"):
        forward[0].plot(beside=[0.9])


def test_the_loop_has_both_branches_and_the_lost_motion_between_their_middles() -> None:
    """Little friction: the makers' midpoints are then the curve of a unit without."""
    torques = np.array([412.0, -412, 12.36, -12.36, 60, -60, 0]) * 1e3
    loop = hysteresis(UNIT, [0.0, 0.1], torques=torques, friction=Friction(pin=1e-3))
    ax = loop.plot(rated="412 N*m")
    order = np.argsort(torques)
    for label, branch in (("torque rises", loop.rising), ("torque falls", loop.falling)):
        x, y = line(ax, label)
        np.testing.assert_allclose(x, torques[order] / 1e3)
        np.testing.assert_allclose(y, branch[order].mean(axis=1) / ARCSEC)
    (label,) = [text for text in legend(ax) if text.startswith("lost motion")]
    x, y = line(ax, label)
    assert x == pytest.approx([-12.36, 12.36])
    wanted = lost_motion(UNIT, [0.0, 0.1])
    assert y[1] - y[0] == pytest.approx(wanted.mean() / ARCSEC, rel=1e-3)
    np.testing.assert_allclose(loop.lost_motion("12.36 N*m"), wanted, rtol=1e-3)
    assert "mean over 2 angles" in ax.get_title()


def test_the_lost_motion_of_a_loop_by_hand() -> None:
    """Midpoints at 3 % on either side, read between the torques of that side."""
    rising, falling = np.array([-9.0, -6, -2, 2, 4]) * ARCSEC, np.array([-8.0, -4, 2, 4, 8]) * ARCSEC
    loop = Hysteresis(torque=np.array([-4e4, -2e4, 0.0, 2e4, 4e4]), rising=rising[:, None], falling=falling[:, None])
    assert line(loop.plot(rated="1000 N*m"), "lost motion at ±3 %: 11.2 arcsec")[1] == pytest.approx([-6.75, 4.5])
    assert loop.lost_motion(3e4) == pytest.approx([11.25 * ARCSEC])
    assert loop.lost_motion(4e4) == pytest.approx([14.5 * ARCSEC])  # at its ends
    assert loop.lost_motion(2e4) == pytest.approx([8 * ARCSEC])
    for size, said in ((1e4, "no torques on both sides of 10 N"), (5e4, "50 N"), (0, "torque = 0 N.m: must be above")):
        with pytest.raises(ValueError, match=said):
            loop.lost_motion(size)
    with pytest.raises(InputError, match=r"both sides of \+-412 N\*m, 3 % of the rated torque"):
        loop.plot(rated=412e3 / 0.03)


def test_a_pressure_is_marked_where_it_is_hardest() -> None:
    found = every_kind()["ContactPressure"][0]
    turned = replace(found, theta=found.theta[::-1].copy())  # angles that fall
    for one in (found, turned):
        ax = one.plot()
        for contact in ("pin", "mesh", "cam"):
            hardest = one.pressure[contact].reshape(-1, one.theta.size).max(axis=0)
            x, y = line(ax, f"{contact}, hardest pressed at each angle")
            order = np.argsort(one.theta)
            np.testing.assert_allclose(x, np.degrees(one.theta[order]))
            np.testing.assert_allclose(y, hardest[order])  # MPa are N/mm^2
            (label,) = [text for text in legend(ax) if text.startswith(f"{contact} (")]
            at, most = line(ax, label)
            assert most == pytest.approx([hardest.max()])
            assert math.radians(at[0]) == pytest.approx(one.theta[np.argmax(hardest)])
            stated = re.fullmatch(r".* \((.*)\): (\S+) MPa at (\S+) deg", label)
            assert stated
            assert float(stated[2]) == pytest.approx(hardest.max(), rel=1e-3)
            numbers = [int(word.split()[1]) for word in stated[1].split(", ")]
            assert one.pressure[contact][(*numbers, int(np.argmax(hardest)))] == hardest.max()
            thin = [item for item in ax.get_lines() if item.get_linewidth() == 0.6]
            own = one.pressure[contact][tuple(numbers)][order]
            assert any(np.array_equal(item.get_ydata(), own) for item in thin)


def test_contacts_without_bearings_are_pins_and_flanks() -> None:
    found: ContactPressure = every_kind()["ContactPressure"][0]
    few = {name: {key: of[key] for key in ("pin", "mesh")} for name, of in (
        ("force", found.force), ("pressure", found.pressure), ("half_width", found.half_width)
    )}  # fmt: skip
    assert len(legend(replace(found, **few).plot())) == 4
