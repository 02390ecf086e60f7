"""Drawings of natural modes: parts stand where the mode moves them, by what is said."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.axes import Axes

from drawn import alike_in_grey, arrows, overlapping_texts
from rverror import InputError, Model, effect, reducer
from rverror.dynamics import Modes, modes
from rverror.model import Bench

UNIT = reducer("RV-40E")
BENCH = Bench(
    input_inertia="1e-4 kg*m^2",
    position_control_stiffness="200 N*m/rad",
    input_coupling_stiffness="3000 N*m/rad",
    load_inertia="5 kg*m^2",
    load_coupling_stiffness="1e6 N*m/rad",
)
THETA = 0.2


@pytest.fixture(scope="module")
def found() -> Modes:
    marks = effect("sensor.index_offset", offset="3 deg")
    return modes(Model(UNIT, (marks,), bench=BENCH), torque="100 N*m", theta=THETA)


@pytest.mark.parametrize("mode", [1, 3, 4, 8])
def test_arrows_show_how_far_the_mode_moves_points(found: Modes, mode: int) -> None:
    ax = found.plot(mode=mode)
    angle = THETA + np.radians(3)  # marks are ahead of the bench's zero
    cranks = 27 * np.stack([np.cos(angle + np.array([0, np.pi])), np.sin(angle + np.array([0, np.pi]))], axis=1)
    lead = [1.25 * np.array([np.cos(np.pi * k - 39 * angle), np.sin(np.pi * k - 39 * angle)]) for k in (0, 1)]
    points = {"carrier": (np.zeros(2), cranks)} | {f"disc {k}": (lead[k], cranks + lead[k]) for k in (0, 1)}
    drawn, moved = list[float](), list[float]()
    for part, (centre, at) in points.items():
        x, y, turn = found.shape[part][:, mode - 1]
        arm = at - centre
        expected = np.array([x, y]) + turn * np.stack([-arm[:, 1], arm[:, 0]], axis=1)
        tails, vectors = arrows(ax, part)
        for tail, vector in zip(tails, vectors, strict=True):
            row = int(np.argmin(np.hypot(*(at - tail).T)))
            np.testing.assert_allclose(tail, at[row], atol=1e-9)
            drawn += vector.tolist()
            moved += expected[row].tolist()
    scale = np.dot(drawn, moved) / np.dot(moved, moved)  # one for all
    np.testing.assert_allclose(drawn, scale * np.array(moved), atol=1e-6 * np.abs(drawn).max())


def told(ax: Axes) -> list[str]:
    box = ax.get_legend()
    assert box is not None
    return box.get_title().get_text().splitlines()


def test_the_lowest_mode_of_the_machine_is_drawn_where_none_is_asked_for(found: Modes) -> None:
    ax = found.plot()
    assert ax.get_title().startswith(f"RV-40E, mode 1 of 20, {found.frequency[0]:.4g} Hz")
    support = int(np.flatnonzero(found.of_sun_support)[0])
    assert "of the sun's support" in found.plot(mode=support + 1).get_title()
    free = modes(Model(UNIT, bench=Bench(position_control_stiffness=0)), torque="100 N*m")
    assert free.plot().get_title().startswith("RV-40E, mode 3 of")  # 1 is free, 2 the support
    assert free.plot(mode=1).get_title().startswith("RV-40E, mode 1 of")
    for mode in (0, 21):
        with pytest.raises(InputError, match=f"mode = {mode}: this reducer has modes 1 to 20"):
            found.plot(mode=mode)


@pytest.mark.parametrize("mode", [1, 2, 6])
def test_a_drawing_can_be_read_in_grey_and_nothing_lies_over_another(found: Modes, mode: int) -> None:
    ax = found.plot(mode=mode)
    assert overlapping_texts(ax) == []
    assert alike_in_grey(ax) == []


def test_a_held_sun_and_three_cranks_are_drawn() -> None:
    unit = reducer("RV-40E", cranks=3)
    held, moving = told(modes(Model(unit), torque="100 N*m").plot())
    assert held.startswith("held by: ")
    assert moving.startswith("moving: ")
