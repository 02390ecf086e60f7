"""The torsion curve as drawn: branches apart, the lost motion that `lost_motion` computes."""

from __future__ import annotations

import re

import numpy as np
import pytest

from drawn import legend, line
from rverror import InputError, Model, lost_motion, reducer
from rverror.base.units import ARCSEC
from rverror.statics import TorsionCurve, torsion_curve

MODEL = Model(reducer("RV-40E"))
SHARES = (-1.0, -0.03, 0.0, 0.03, 1.0)


@pytest.fixture(scope="module")
def curve() -> TorsionCurve:
    return torsion_curve(MODEL, [0.0, 0.1], torques=[share * 412e3 for share in SHARES][::-1])


def test_branches_are_drawn_apart_in_order(curve: TorsionCurve) -> None:
    ax = curve.plot()
    x, y = line(ax, "torque counter-clockwise")
    assert x == pytest.approx([12.36, 412])
    mean = curve.angle.mean(axis=1)[::-1] / ARCSEC
    assert y == pytest.approx(mean[-2:])
    x, y = line(ax, "torque clockwise")
    assert x == pytest.approx([-412, -12.36])
    assert y == pytest.approx(mean[:2])
    assert list(line(ax, "no torque: middle of the play")[0]) == [0.0]
    assert "mean and range over 2 angles" in ax.get_title()


@pytest.mark.parametrize("rated", ["412 N*m", 412e3])
def test_the_lost_motion_is_marked(curve: TorsionCurve, rated: float | str) -> None:
    ax = curve.plot(rated=rated)
    (label,) = [text for text in legend(ax) if text.startswith("lost motion")]
    x, y = line(ax, label)
    assert x == pytest.approx([-12.36, 12.36])
    expected = float(np.mean(lost_motion(MODEL, [0.0, 0.1]))) / ARCSEC
    assert y[1] - y[0] == pytest.approx(expected)
    assert y == pytest.approx(curve.angle.mean(axis=1)[[3, 1]] / ARCSEC)  # on the curve
    stated = re.search(r"(\S+) arcsec", label)
    assert stated
    assert float(stated[1]) == pytest.approx(expected, rel=5e-3)


def test_the_lost_motion_is_read_on_its_own_branch() -> None:
    """Halfway between two points of a branch, whatever the other branch and the point without torque say."""
    turn = np.array([-9.0, -5.0, 0.0, 3.0, 5.0]) * ARCSEC
    ax = TorsionCurve(np.array([-4e4, -2e4, 0.0, 2e4, 4e4]), turn[:, None]).plot(rated="1000 N*m")
    assert line(ax, "lost motion at ±3 %: 11 arcsec")[1] == pytest.approx([-7.0, 4.0])


def test_a_curve_of_one_branch_has_no_lost_motion() -> None:
    one = TorsionCurve(np.array([1e5, 2e5]), np.array([[1e-4], [2e-4]]))
    assert legend(one.plot()) == ["torque counter-clockwise"]
    with pytest.raises(InputError, match=r"12\.36 N\*m, 3 % of the rated torque"):
        one.plot(rated="412 N*m")
