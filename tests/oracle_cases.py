"""Sources and indices whose influence is held against the independent model of `oracle`."""

from __future__ import annotations

from typing import Any

from rverror import CATALOGUE

CASES: list[tuple[str, dict[str, Any]]] = [
    ("involute.center_distance", {"crank": 1}),
    ("involute.sun_eccentricity", {}),
    ("involute.sun_offset", {}),
    ("involute.planet_eccentricity", {"crank": 0}),
    ("involute.planet_eccentricity", {"crank": 1}),
    ("involute.sun_pitch", {"harmonic": 1}),
    ("involute.sun_pitch", {"harmonic": 2}),
    ("involute.sun_pitch", {"harmonic": 3}),
    ("involute.planet_pitch", {"crank": 1, "harmonic": 1}),
    ("involute.planet_pitch", {"crank": 0, "harmonic": 2}),
    ("involute.tooth_thinning", {"member": "sun"}),
    ("involute.tooth_thinning", {"member": "planet"}),
    ("involute.spline_clearance", {"crank": 1}),
    ("crank.eccentricity", {"crank": 0, "disc": 0}),
    ("crank.eccentricity", {"crank": 1, "disc": 1}),
    ("crank.index", {"crank": 1}),
    ("cycloid.disc_profile", {"disc": 0, "harmonic": 1}),
    ("cycloid.disc_profile", {"disc": 1, "harmonic": 2}),
    ("cycloid.disc_profile", {"disc": 1, "harmonic": 3}),
    ("cycloid.disc_pitch", {"disc": 1, "harmonic": 1}),
    ("cycloid.disc_pitch", {"disc": 0, "harmonic": 2}),
    ("cycloid.pin_position", {"pin": 0}),
    ("cycloid.pin_position", {"pin": 7}),
    ("cycloid.pin_circle", {"harmonic": 0}),
    ("cycloid.pin_circle", {"harmonic": 1}),
    ("cycloid.pin_circle", {"harmonic": 2}),
    ("cycloid.pin_circle_tilt", {}),
    ("cycloid.pin_radius", {"pin": 11}),
    ("cycloid.pin_radius", {"pin": "all"}),
    ("cycloid.profile_modification", {}),
    ("cycloid.disc_bore_position", {"disc": 1, "crank": 0}),
    ("cycloid.disc_bore_position", {"disc": 0, "crank": 1}),
    ("coupling.carrier_bore_position", {"crank": 1}),
    ("coupling.carrier_runout", {}),
]


#: What is no step of the oracle, and the test that derives it by other means: clearances have no derivative at zero,
#: compliances act through the force that is carried, one lobe is a sum of waves of the profile.
ELSEWHERE = {
    "crank.bearing_clearance": "statics/test_clearance.py",
    "coupling.bearing_clearance": "statics/test_clearance.py",
    "cycloid.disc_lobe": "geartrain/test_disc_lobe.py",
    "cycloid.lobe_profile": "statics/test_wear.py",
    **{key: "statics/test_compliance.py" for key in CATALOGUE if "compliance" in key},
}
