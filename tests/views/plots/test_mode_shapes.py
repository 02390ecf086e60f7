"""Drawings of natural modes: parts stand where the mode moves them, by what is said."""

from __future__ import annotations

import re

import numpy as np
import pytest
from matplotlib.axes import Axes

from drawn import alike_in_grey, line, overlapping_texts
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


def magnified(ax: Axes) -> float:
    (told,) = [match for text in ax.texts if (match := re.match(r"moved ([\d.e+]+) times", text.get_text()))]
    return float(told[1])


@pytest.mark.parametrize("mode", [1, 3, 4, 8])
def test_parts_stand_where_the_mode_moves_them(found: Modes, mode: int) -> None:
    ax = found.plot(mode=mode)
    scale, angle = magnified(ax), THETA + np.radians(3)  # marks are ahead of the bench's zero
    for disc in (0, 1):
        x, y, turn = scale * found.shape[f"disc {disc}"][:, mode - 1]
        (centre,) = [
            item.get_xydata()[0]
            for item in ax.get_lines()
            if item.get_marker() == "+" and item.get_color() == ("#0072B2", "#E69F00")[disc]
        ]
        rest = 1.25 * np.array([np.cos(np.pi * disc - 39 * angle), np.sin(np.pi * disc - 39 * angle)])
        np.testing.assert_allclose(centre, rest + np.array([x, y]), atol=1e-2)
        # a lobe's outline turns with its disc
        drawn = np.array(line(ax, f"disc {disc}, its centre and cams"))
        still = np.array([item.get_data() for item in ax.get_lines() if item.get_gid() == "at rest"][disc])
        arm = still - rest[:, None]
        np.testing.assert_allclose(drawn - still, np.array([[x], [y]]) + turn * np.array([-arm[1], arm[0]]), atol=2e-2)
    carrier = scale * found.shape["carrier"][:, mode - 1]
    ring = np.array(line(ax, "carrier, crank 0 filled"))[:, 0]
    bore = 27 * np.array([np.cos(angle), np.sin(angle)])
    np.testing.assert_allclose(ring, bore + carrier[:2] + carrier[2] * np.array([-bore[1], bore[0]]), atol=2e-2)


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
    told = [text.get_text() for text in modes(Model(unit), torque="100 N*m").plot().texts]
    assert not any(text.startswith("angles beside one another") for text in told)  # the carrier alone, by no other
    assert any(text.startswith("held by: ") for text in told)


def test_shafts_that_only_rounding_turns_are_not_told_of() -> None:
    """Three cranks turn against one another, and by symmetry neither sun, carrier, input nor load with them."""
    found = modes(Model(reducer("RV-40E", cranks=3), bench=BENCH), torque="100 N*m")
    shafts = np.abs([found.shape[name][-1] for name in ("input", "carrier", "load")]).max(axis=0)
    cranks = np.abs([found.shape[f"crank {number}"][-1] for number in range(3)]).max(axis=0)
    still = np.flatnonzero((shafts < 1e-9 * cranks) & (found.frequency > 0))
    assert still.size
    for mode in (int(still[0]) + 1, int(np.flatnonzero(found.frequency > 0)[0]) + 1):
        told = [text.get_text() for text in found.plot(mode=mode).texts]
        assert any(text.startswith("angles beside one another") for text in told) is (mode - 1 not in still)
