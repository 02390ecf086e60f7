"""How the pose follows each error: against the influences by virtual work, and against solutions with a little more."""

from __future__ import annotations

import numpy as np
import pytest

import rverror
from rverror import Effect, effect
from rverror.geartrain.contacts import pose
from rverror.statics.loaded_state import statics_of

UNIT = rverror.reducer("RV-40E")
TURNED = rverror.reducer(
    "RV-40E",
    contact_law=rverror.geartrain.ContactLaw(pin_exponent=10 / 9, flank_exponent=10 / 9, profile_curvature=1.0),
)
ANGLES = np.array([0.1, 0.6, 1.25])
ERRORS = (
    effect("crank.eccentricity", crank=0, disc=0, tangential="5 um"),
    effect("cycloid.pin_position", pin=3, radial="-6 um", tangential="2 um"),
    effect("cycloid.disc_pitch", disc=1, harmonic=1, cos="4 um"),
    effect("involute.sun_eccentricity", x="5 um"),
    effect("crank.bearing_clearance", clearance="3 um"),
    effect("cycloid.pin_compliance_wave", harmonic=1, cos="1e-6 mm/N"),
    effect("crank.bearing_compliance", crank=0, disc=1, compliance="2e-6 mm/N"),
    effect("coupling.bearing_compliance", crank=1, compliance="2e-6 mm/N"),
    effect("involute.mesh_compliance", crank=0, compliance="2e-6 mm/N"),
    effect("coupling.carrier_bore_position", crank=0, tangential="5 um"),
    effect("thermal.growth", housing="3 K"),
    effect("sensor.encoder_eccentricity", cos="9 arcsec"),
)


def changed(one: Effect, at: int, step: float) -> Effect:
    values = list(one.values)
    values[at] += step
    return Effect(one.key, one.indices, tuple(values))


@pytest.mark.parametrize(("unit", "beyond"), [(UNIT, 1e-8), (TURNED, 1e-7)], ids=["linear", "power law, turned pins"])
@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_the_carrier_follows_errors_by_their_influences(unit: rverror.Reducer, beyond: float, direction: float) -> None:
    solution = statics_of(unit, pose(unit, ANGLES, torque=100e3, direction=direction)).settled(ERRORS, response=True)
    told, influences = solution.pose_changes(ERRORS), solution.influences(ERRORS[:-1])
    np.testing.assert_allclose(
        told[:, 2, : len(influences)].T, influences, rtol=beyond, atol=1e-8 * np.abs(influences).max()
    )
    assert not told[:, :, len(influences) :].any()  # what only misreads moves nothing


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_pose_follows_errors_as_solutions_with_a_little_more_do(direction: float) -> None:
    statics = statics_of(UNIT, pose(UNIT, ANGLES, torque=100e3, direction=direction))
    told = statics.settled(ERRORS).pose_changes(ERRORS)
    column = 0
    for place, one in enumerate(ERRORS):
        step = 2e-3 * max(map(abs, one.values))  # forces balance to 1e-9, so not too little
        for at in range(len(one.values)):
            low, high = (
                statics.settled((*ERRORS[:place], changed(one, at, sign * step), *ERRORS[place + 1 :])).x
                for sign in (-1, 1)
            )
            found = (high - low) / (2 * step)
            size = max(np.abs(found).max(), np.abs(told[..., column]).max())
            np.testing.assert_allclose(told[..., column], found, atol=2e-3 * size, err_msg=f"{one.key} {at}")
            column += 1
    assert column == told.shape[2]
