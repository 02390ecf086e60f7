"""Plots of the error against speed: what is drawn is what was found."""

from __future__ import annotations

import numpy as np
import pytest

from drawn import alike_in_grey, legend, line, overlapping_texts
from rverror import InputError, Model, effect, reducer
from rverror.base.units import ARCSEC
from rverror.dynamics import SpeedResponse, speed_response
from rverror.model import Bench

RPM = np.pi / 30
MODEL = Model(
    reducer("RV-40E"),
    (
        effect("crank.eccentricity", crank=0, disc=0, tangential="5 um"),
        effect("cycloid.pin_position", pin=3, radial="3 um"),
    ),
    bench=Bench(load_inertia="100 kg*m^2"),
)


@pytest.fixture(scope="module")
def found() -> SpeedResponse:
    return speed_response(MODEL, np.linspace(1000, 2000, 21) * RPM, torque="100 N*m")


def test_the_largest_orders_are_drawn_and_their_critical_speeds_ringed() -> None:
    found = speed_response(MODEL, np.linspace(600, 1000, 21) * RPM, torque="100 N*m")
    ax = found.plot(most=2)
    assert [name.partition(":")[0] for name in legend(ax) if name.startswith("order")] == ["order 40", "order 78"]
    top = found.critical_speeds[0]
    assert top.order == 78
    rings = np.transpose(line(ax, "critical"))
    place = [top.speed / RPM, 78 * top.speed / (2 * np.pi * 121)]
    assert np.abs(rings - place).max(axis=1).min() < 1e-9


def test_lines_of_orders_meet_the_natural_frequency_at_the_critical_speed(found: SpeedResponse) -> None:
    ax = found.plot(kind="campbell")
    x, y = line(ax, "order 40: carrier/disc/crank 40")
    assert x.tolist() == pytest.approx([0, 2000])
    assert y.tolist() == pytest.approx([0, 40 * 2000 / 60 / 121])
    (natural,) = [c for c in ax.collections if c.get_label() == "natural frequency"]
    lowest = natural.get_segments()[0][0, 1]
    assert lowest == pytest.approx(found.frequency[0])
    top = found.critical_speeds[0]
    assert top.order == 40
    assert np.interp(top.speed / RPM, x, y) == pytest.approx(lowest, rel=0.02)


def test_crossings_are_numbered_and_named() -> None:
    """Input speed at which order times output speed is the frequency: 60 f R / order."""
    found = speed_response(MODEL, np.array([500, 9000]) * RPM, torque="100 N*m")
    ax = found.plot(kind="campbell", most=3)
    told = ax.get_legend().get_title().get_text().splitlines()
    assert told[0] == f"mode 1: {found.frequency[0]:.4g} Hz"
    rows = [text.replace(",", "").split() for text in told[told.index("crossings: mode, order, rpm") + 1 :]]
    assert [row[0] for row in rows] == [f"{number}:" for number in range(1, len(rows) + 1)]
    points = [item for item in ax.get_lines() if item.get_gid() == "crossing"]
    assert len(points) == len(rows) >= 2
    for (_, _, mode, _, order, rpm), point in zip(rows, points, strict=True):
        frequency = found.frequency[int(mode) - 1]
        assert float(rpm) == pytest.approx(60 * frequency * 121 / float(order), abs=0.6)
        assert point.get_xydata()[0] == pytest.approx([60 * frequency * 121 / float(order), frequency])


@pytest.mark.parametrize(("last", "kept"), [(2000, 1), (9000, 1), (12000, 8)])
def test_a_diagram_can_be_read_in_grey_and_nothing_lies_over_another(last: float, kept: int) -> None:
    errors = tuple(effect("cycloid.disc_pitch", disc=0, harmonic=at, cos="3 um") for at in (1, 2, 3))
    ends = Bench(input_inertia="1e-4 kg*m^2", position_control_stiffness="200 N*m/rad", load_inertia="5 kg*m^2")
    model = Model(MODEL.mechanism, (*MODEL.effects, *errors), bench=ends)
    ax = speed_response(model, np.array([100, last]) * RPM, torque="412 N*m", kept=kept).plot(kind="campbell")
    assert overlapping_texts(ax) == []
    assert alike_in_grey(ax) == []


def test_a_diagram_without_crossings_shows_how_far_the_first_natural_frequency_is() -> None:
    found = speed_response(MODEL, np.array([10.0, 20.0]) * RPM, torque="100 N*m")
    ax = found.plot(kind="campbell", most=1)
    (natural,) = [c for c in ax.collections if c.get_label() == "natural frequency"]
    assert natural.get_segments()[0][0, 1] == pytest.approx(found.frequency[0])
    assert ax.get_ylim()[1] > found.frequency[0] > 40 * 20 / 60 / 121


def test_the_map_is_darkest_where_the_error_is_largest(found: SpeedResponse) -> None:
    ax = found.plot(kind="order_map", highest=100)
    (mesh,) = [c for c in ax.collections if hasattr(c, "get_coordinates")]
    drawn = np.asarray(mesh.get_array()).reshape(100, 21)
    order, speed = np.unravel_index(drawn.argmax(), drawn.shape)
    assert order + 1 == 40
    assert speed == np.abs(found.waves[:, found.order.tolist().index(40.0)]).argmax()
    assert drawn.max() == pytest.approx(np.abs(found.waves).max() / ARCSEC)


def test_the_map_reaches_beyond_the_largest_orders_and_shows_the_largest_of_each_cell() -> None:
    """Without errors a cycloid drive has its meshes alone, of order 1560; six orders share a cell."""
    found = speed_response(Model(reducer("RV-40E")), np.array([100.0, 200.0]) * RPM, torque="100 N*m")
    ax = found.plot(kind="order_map")
    (mesh,) = [c for c in ax.collections if hasattr(c, "get_coordinates")]
    drawn = np.asarray(mesh.get_array()).reshape(-1, 2)
    highest = np.sort(found.order[np.argsort(-np.abs(found.crawl_waves))][:5])[-1]
    assert highest > 1000
    assert ax.get_ylim()[1] == pytest.approx(1.05 * highest, rel=0.02)
    assert drawn.shape[0] <= 260
    assert drawn.max() == pytest.approx(np.abs(found.waves).max() / ARCSEC)


def test_too_many_orders_and_none_are_refused(found: SpeedResponse) -> None:
    with pytest.raises(InputError, match="most = 13: must be 1 to 12 orders"):
        found.plot(most=13)
