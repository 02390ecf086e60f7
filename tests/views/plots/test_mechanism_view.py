"""The mechanism as drawn: pins touch the discs, arrows at their stated scales hold the parts in balance."""

from __future__ import annotations

import re

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.patches import Circle

from drawn import arrows
from rverror import Drive, InputError, Model, Reducer, effect, equilibrium, reducer
from rverror.views.plots.figure import to_bytes

UNITS = {
    "RV-40E": reducer("RV-40E"),
    "RV-003": reducer("RV-003"),
    "three discs": reducer("RV-40E", discs=3, cranks=3),
    "one disc": reducer("RV-40E", discs=1, cranks=3),
}
THETA = 0.7
ERRORS = (
    effect("crank.eccentricity", crank=0, disc=1, radial="4 um"),
    effect("cycloid.pin_position", pin=30, radial="6 um", tangential="-2 um"),
    effect("cycloid.disc_profile", disc=0, harmonic=1, cos="3 um"),
    effect("coupling.carrier_bore_position", crank=1, tangential="2 um"),
)


def pins(ax: Axes) -> tuple[np.ndarray, float]:
    found = [p for p in ax.patches if isinstance(p, Circle) and (p.get_gid() or "").startswith("pin ")]
    (radius,) = {p.radius for p in found}
    return np.array([p.center for p in found]), radius


def outline(ax: Axes, disc: int) -> np.ndarray:
    (found,) = [item for item in ax.get_lines() if item.get_gid() == f"disc {disc}"]
    return np.asarray(found.get_xydata())


def scale(ax: Axes, what: str) -> float:
    """Core units for each mm of the drawing, from the words of the key."""
    first, *told = key(ax)
    assert first == "10 mm of an arrow are"
    (text,) = [text for text in told if what in text]
    stated = re.search(r": (\S+) (N|um)$", text)
    assert stated
    return float(stated[1]) * {"N": 1.0, "um": 1e-3}[stated[2]] / 10


def key(ax: Axes) -> list[str]:
    box = ax.get_legend()
    assert box is not None
    return box.get_title().get_text().splitlines()


def off_outline(point: np.ndarray, edge: np.ndarray) -> float:
    """Distance of a point to a line of chords."""
    start, chord = edge[:-1], np.diff(edge, axis=0)
    along = ((point - start) * chord).sum(axis=1) / (chord**2).sum(axis=1)
    nearest = start + np.clip(along, 0, 1)[:, None] * chord
    return float(np.hypot(*(point - nearest).T).min())


def moment(tails: np.ndarray, vectors: np.ndarray) -> float:
    return float((tails[:, 0] * vectors[:, 1] - tails[:, 1] * vectors[:, 0]).sum())


# --- geometry ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", UNITS)
@pytest.mark.parametrize("theta", [0.0, THETA, 5.1])
def test_every_pin_touches_every_disc_and_enters_none(name: str, theta: float) -> None:
    unit = UNITS[name]
    ax = unit.plot(theta=theta)
    centres, radius = pins(ax)
    assert len(centres) == unit.pins
    assert radius == unit.pin_radius
    assert np.hypot(*centres.T) == pytest.approx(unit.pin_circle_radius)
    for disc in range(unit.discs):
        edge = outline(ax, disc)
        gaps = [off_outline(centre, edge) - radius for centre in centres]
        assert np.abs(gaps).max() < 3e-3  # chords of the drawn line
        assert np.abs(edge[0] - edge[-1]).max() < 1e-9


def test_force_arrows_start_where_pin_and_disc_touch() -> None:
    unit = UNITS["RV-40E"]
    ax = unit.plot(theta=THETA)
    centres, radius = pins(ax)
    for disc in range(2):
        tails, vectors = arrows(ax, f"pin force, disc {disc}")
        assert 10 < len(tails) <= 20  # the half that drives
        away = np.sqrt(((tails[:, None] - centres) ** 2).sum(axis=2))
        assert away.min(axis=1) == pytest.approx(radius)
        assert max(off_outline(tail, outline(ax, disc)) for tail in tails) < 5e-3
        inward = tails - centres[away.argmin(axis=1)]
        assert (vectors * inward).sum(axis=1) == pytest.approx(np.hypot(*vectors.T) * radius)


def test_cams_stand_an_eccentricity_off_their_cranks() -> None:
    unit = UNITS["three discs"]
    ax = unit.plot(theta=THETA)
    cams = np.array([p.center for p in ax.patches if isinstance(p, Circle) and not p.get_gid()]).reshape(3, 3, 2)
    turn = THETA + 2 * np.pi * np.arange(3) / 3
    cranks = unit.crank_radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    lead = -39 * THETA + 2 * np.pi * np.arange(3) / 3
    offset = 1.25 * np.stack([np.cos(lead), np.sin(lead)], axis=1)
    assert cams == pytest.approx(cranks + offset[:, None])


# --- forces -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize("torque", [None, "20 N*m"])
@pytest.mark.parametrize("name", ["RV-40E", "RV-003"])
def test_arrows_at_their_scale_hold_every_part(name: str, torque: str | None, direction: float) -> None:
    """Moments about the housing axis: T on the carrier, T (R - 1) / R from the housing; each disc in balance."""
    unit = UNITS[name]
    ax = Model(unit, ERRORS).plot(kind="mechanism", theta=THETA, torque=torque, direction=direction)
    size = 20e3 if torque else unit.rated_torque or 100e3
    assert f"{size / 1e3:g} N*m, {'equilibrium' if torque else 'closed form'}" in ax.get_title()
    assert ("forward" if direction > 0 else "reverse") in ax.get_title()
    load = direction * size
    by_pins, by_bearings = scale(ax, "pins"), scale(ax, "bearings")
    carrier = arrows(ax, "carrier force")
    assert len(carrier[0]) == unit.cranks
    assert by_bearings * moment(*carrier) == pytest.approx(load, rel=2e-3)
    sun = arrows(ax, "mesh force")
    assert by_pins * moment(*sun) == pytest.approx(load / unit.ratio, rel=2e-3)
    ring = sum(by_pins * moment(*arrows(ax, f"pin force, disc {k}")) for k in range(unit.discs))
    assert ring == pytest.approx(load * (unit.ratio - 1) / unit.ratio, rel=2e-3)
    for disc in range(unit.discs):
        onto, off = (arrows(ax, f"{key} force, disc {disc}") for key in ("pin", "cam"))
        assert by_pins * onto[1].sum(axis=0) == pytest.approx(by_bearings * off[1].sum(axis=0), rel=5e-3, abs=2)
        assert by_pins * moment(*onto) == pytest.approx(by_bearings * moment(*off), rel=5e-3, abs=abs(load) * 2e-3)


def test_forces_at_a_load_are_those_of_the_equilibrium() -> None:
    model = Model(UNITS["RV-40E"], ERRORS)
    ax = model.plot(kind="mechanism", theta=THETA, torque="20 N*m")
    state = equilibrium(model, [THETA], torque="20 N*m")
    for disc in range(2):
        _, vectors = arrows(ax, f"pin force, disc {disc}")
        assert len(vectors) == state.loaded_pins[disc, 0]
        drawn = np.sort(scale(ax, "pins") * np.hypot(*vectors.T))
        solved = np.linalg.norm(state.contact_forces["pin"][disc, :, :, 0], axis=-1)
        assert drawn == pytest.approx(np.sort(solved[solved > 0]), rel=1e-6)


@pytest.mark.parametrize("load", ["3 N*m", "20 N*m", "412 N*m"])
def test_scales_are_round_and_the_longest_arrow_takes_its_room(load: str) -> None:
    """Three tenths of the pin circle's radius of 64 mm; the next of 1, 2 and 5 is at most 2.5 times as coarse."""
    ax = UNITS["RV-40E"].plot(torque=load)
    for what in ("pins", "bearings"):
        assert f"{10 * scale(ax, what):.6e}"[:8] in ("1.000000", "2.000000", "5.000000")
    names = ("pin force, disc 0", "pin force, disc 1", "mesh force")
    longest = max(float(np.hypot(*arrows(ax, name)[1].T).max()) for name in names)
    assert 0.3 * 64 / 2.5 * (1 - 1e-6) <= longest <= 0.3 * 64 * (1 + 1e-6)


# --- errors -----------------------------------------------------------------------------------------------------------


def test_error_arrows_are_the_declared_sizes() -> None:
    ax = Model(UNITS["RV-40E"], ERRORS[:2]).plot(kind="mechanism", theta=THETA)
    to_mm = scale(ax, "errors")
    lead = -39 * THETA + np.pi  # of the cam for disc 1, which is the driven surface
    (tail,), (cam,) = arrows(ax, "cam error, disc 1")
    assert to_mm * cam == pytest.approx(-0.004 * np.array([np.cos(lead), np.sin(lead)]))
    assert np.hypot(*(tail - 27 * np.array([np.cos(THETA), np.sin(THETA)]))) == pytest.approx(1.25)
    at = 2 * np.pi * 30 / 40
    pin = 0.006 * np.array([np.cos(at), np.sin(at)]) - 0.002 * np.array([-np.sin(at), np.cos(at)])
    for disc in range(2):
        _, (vector,) = arrows(ax, f"pin error, disc {disc}")
        assert to_mm * vector == pytest.approx(pin)


def test_errors_at_one_contact_are_added_and_clearance_lies_along_its_force() -> None:
    twice = (ERRORS[0], effect("cycloid.disc_bore_position", disc=1, crank=0, radial="3 um"))
    ax = Model(UNITS["RV-40E"], twice).plot(kind="mechanism")
    (_,), (vector,) = arrows(ax, "cam error, disc 1")  # at 0 the eccentric of disc 1 points along -x
    assert scale(ax, "errors") * vector == pytest.approx([0.007, 0.0], abs=1e-12)
    play = Model(UNITS["RV-40E"], (effect("coupling.bearing_clearance", clearance="5 um"),))
    ax = play.plot(kind="mechanism", theta=THETA)
    _, slack = arrows(ax, "carrier error")
    _, force = arrows(ax, "carrier force")
    assert scale(ax, "errors") * np.hypot(*slack.T) == pytest.approx([0.005, 0.005])
    assert (slack * force).sum(axis=1) == pytest.approx(-np.hypot(*slack.T) * np.hypot(*force.T))


def test_of_a_gear_mesh_the_driving_flank_is_drawn() -> None:
    thin = Model(UNITS["RV-40E"], (effect("involute.tooth_thinning", member="sun", thinning="20 um"),))
    found = {}
    for direction in (1.0, -1.0):
        ax = thin.plot(kind="mechanism", direction=direction)
        tails, vectors = arrows(ax, "mesh error")
        assert len(tails) == 2
        found[direction] = scale(ax, "errors") * vectors
    assert found[1.0] == pytest.approx(-found[-1.0])  # half the thinning off either flank
    assert found[1.0][0] == pytest.approx([0.0, -0.010], abs=1e-9)  # the sun's flank draws back from planet 0, on +x


def test_errors_that_are_angles_are_listed() -> None:
    model = Model(
        UNITS["RV-40E"],
        (effect("crank.index", crank=0, angle="1 arcmin"), effect("sensor.encoder_eccentricity", cos="3 arcsec")),
    )
    ax = model.plot(kind="mechanism")
    assert key(ax)[-1] == "not drawn, angles: crank.index, sensor.encoder_eccentricity"
    assert not [c for c in ax.collections if "error" in (c.get_gid() or "")]


def test_the_gears_marks_may_be_ahead_of_the_bench() -> None:
    ahead = Model(UNITS["RV-40E"], (effect("sensor.index_offset", offset="10 deg"),))
    there = ahead.plot(kind="mechanism", theta="20 deg")
    assert outline(there, 0) == pytest.approx(outline(UNITS["RV-40E"].plot(theta="30 deg"), 0))
    assert "at 20 deg" in there.get_title()


# --- the axes ---------------------------------------------------------------------------------------------------------


def test_lengths_are_true_in_both_directions() -> None:
    ax = UNITS["RV-40E"].plot()
    to_bytes(ax.figure, "png")
    assert ax.get_aspect() == 1.0
    (x0, y0), (x1, y1) = ax.transData.transform([(0, 0), (10, 10)])
    assert x1 - x0 == pytest.approx(y1 - y0, rel=1e-3)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("x, mm", "y, mm")


def test_a_drive_has_no_drawing() -> None:
    with pytest.raises(InputError, match=r"\[reducer\]"):
        Model(Drive(ratio=10.0)).plot(kind="mechanism")


def test_a_reducer_is_drawn_as_its_model() -> None:
    unit: Reducer = UNITS["RV-003"]
    one, other = unit.plot(theta=1.0), Model(unit).plot(kind="mechanism", theta=1.0)
    assert outline(one, 1) == pytest.approx(outline(other, 1))
    assert one.get_title() == other.get_title()
