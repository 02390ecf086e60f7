"""Causes that close the same gaps: against the formulas by which they close them."""

from __future__ import annotations

import numpy as np
import pytest

import rverror
from gear_runs import UNIT
from rverror.base.units import ARCSEC
from rverror.diagnosis.causes import Named
from rverror.diagnosis.gears.contact_gaps import ContactGaps

GAPS = ContactGaps(UNIT)
GROUND: Named = ("cycloid.profile_modification", {})
PINS: Named = ("cycloid.pin_radius", {"pin": "all"})


def test_a_cause_of_more_sizes_that_can_do_what_one_does_is_its_twin() -> None:
    """Pins all 6 um larger close what discs ground 6 um less all around do; no shift, which pins know nothing of."""
    pins = rverror.effect("cycloid.pin_radius", pin="all", deviation="6 um")
    (other,) = GAPS.equivalents(pins, [PINS, GROUND, ("crank.eccentricity", {"crank": 0, "disc": 0})])
    assert (other.key, dict(other.indices)) == GROUND
    assert other.values == pytest.approx([-6e-3, 0.0], abs=1e-9)


def test_a_cause_that_does_nothing_but_what_a_larger_one_can_is_its_twin_in_the_nearest_size() -> None:
    """Ground and shifted discs are no pins of another size, but these are discs that are only ground."""
    ground = rverror.effect("cycloid.profile_modification", equidistant="-6 um", shift="2 um")
    (other,) = GAPS.equivalents(ground, [PINS, GROUND])
    assert (other.key, dict(other.indices)) == PINS
    gaps, own = np.array(ground.values) @ np.asarray(GAPS.of(GROUND)), np.asarray(GAPS.of(PINS))[0]
    assert other.values == pytest.approx([gaps @ own / (own @ own)])


def test_a_crank_s_index_is_one_direction_of_its_centre() -> None:
    """Turned on by an angle, a planet's teeth move along the tangent by it times their radius, module x teeth / 2."""
    index = rverror.effect("crank.index", crank=0, angle="30 arcsec")
    moved: Named = ("involute.center_distance", {"crank": 0})
    (other,) = GAPS.equivalents(index, [moved, ("involute.center_distance", {"crank": 1})])
    assert (other.key, dict(other.indices)) == moved
    assert np.abs(other.values) == pytest.approx([0.0, 30 * ARCSEC * 1.5 * 27 / 2])


def test_what_opens_gaps_nearly_alike_is_tried_in_the_nearest_size() -> None:
    """A pin circle that is too wide opens pins as thinner ones do, but for their distance from the normals' middle."""
    pins = rverror.effect("cycloid.pin_radius", pin="all", deviation="-6 um")
    wide: Named = ("cycloid.pin_circle", {"harmonic": 0})
    others = [PINS, wide, ("cycloid.pin_circle", {"harmonic": 2}), ("crank.eccentricity", {"crank": 0, "disc": 0})]
    assert GAPS.equivalents(pins, others) == []
    (near,) = GAPS.near(pins, others)
    assert (near.key, dict(near.indices)) == wide
    gaps, own = -6e-3 * np.asarray(GAPS.of(PINS))[0], np.asarray(GAPS.of(wide))[0]
    assert near.values[0] == pytest.approx(gaps @ own / (own @ own), rel=1e-3)
    assert near.values[0] > 6e-3  # along the radius it takes more than along the normals


def test_what_closes_no_gaps_of_its_own_has_no_twin() -> None:
    """An encoder is beside the gear train, and a clearance lets go instead of closing."""
    encoder = rverror.effect("sensor.encoder_eccentricity", cos="2 arcsec", sin="1 arcsec")
    play = rverror.effect("crank.bearing_clearance", clearance="6 um")
    everything = [(key, i) for key, entry in rverror.CATALOGUE.items() for i in entry.candidates(UNIT)]
    assert GAPS.equivalents(encoder, everything) == []
    assert GAPS.equivalents(play, everything) == []
