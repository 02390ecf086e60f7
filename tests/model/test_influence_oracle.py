"""Every closed-form influence against the finite difference of an independent model of the whole gear train."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rverror
from oracle import REALISTIC, RIGID, Errors, Oracle, Springs, put, trochoid
from oracle_cases import CASES, ELSEWHERE

#: Golden-ratio steps: irregular against every order, and the same each time.
ANGLES = 2 * np.pi * np.mod(0.05 + 0.6180339887 * np.arange(14), 1)
STEP = 2e-6  # mm or rad; the most loaded pin is 2e-4 mm deep, the shallowest carry too little to matter
ARCSEC = np.pi / 180 / 3600
TESTS = Path(__file__).parents[1]

#: What remains of the oracle's compliances is 2e-3 at the most (see oracle.RIGID).
LIMIT = 5e-3


def unit_of(name: str) -> rverror.Reducer:
    if name == "odd pins":  # two discs that do not mesh in phase: nothing cancels by symmetry
        return rverror.reducer("RV-40E", disc_lobes=38, pins=39, cranks=3)
    return rverror.reducer(name)


def labels_of(unit: rverror.Reducer, key: str, index: dict[str, Any]) -> tuple[str, ...]:
    return rverror.influence(unit, [0.0], key, direction=1, **index).labels


@cache
def differences(name: str, sense: int) -> dict[str, np.ndarray]:
    """Finite differences of all cases at once."""
    unit = unit_of(name)
    terms = [(key, index, label) for key, index in CASES for label in labels_of(unit, key, index)]
    rows = iter(Oracle(unit, ANGLES, sense=sense).influence(terms, step=STEP))
    return {repr(case): np.array([next(rows) for _ in labels_of(unit, *case)]) for case in CASES}


def rms(values: np.ndarray) -> np.ndarray:
    return np.sqrt(np.mean(values**2, axis=-1))


def share_of_one_contact(unit: rverror.Reducer, key: str) -> float:
    """Size of an influence when nothing cancels it: that of one mesh, of all pins, of one carrier bore, rad per mm."""
    r1 = unit.module * unit.sun_teeth / 2
    ratio = 1 + unit.planet_teeth / unit.sun_teeth * unit.pins
    bore = 1 / (unit.cranks * unit.module * (unit.sun_teeth + unit.planet_teeth) / 2)
    mesh = 1 / (ratio * unit.cranks * r1 * np.cos(unit.pressure_angle))
    return {"involute": mesh, "cycloid": 1 / unit.pin_circle_radius, "coupling": bore, "crank": bore}[key.split(".")[0]]


@pytest.mark.parametrize("sense", [1, -1], ids=["forward", "reverse"])
@pytest.mark.parametrize("name", ["RV-40E", "RV-003", "odd pins"])
@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case[0]}-{'-'.join(map(str, case[1].values()))}")
def test_closed_form_is_the_finite_difference(case: tuple[str, dict[str, Any]], name: str, sense: int) -> None:
    key, index = case
    unit = unit_of(name)
    closed = rverror.influence(unit, ANGLES, key, direction=sense, **index)
    wrong = rms(differences(name, sense)[repr(case)] - closed.matrix)
    # waveforms that all but cancel between contacts are held against what one of the contacts would give alone
    scale, alone = rms(closed.matrix), share_of_one_contact(unit, key)
    scale = np.where(scale < 0.01 * alone, alone, scale)
    for label, error, bound in zip(closed.labels, wrong, LIMIT * scale, strict=True):
        assert error < bound, f"{key} {index} {label}: rms of the difference {error:.3g}, allowed {bound:.3g}"


def test_every_linear_source_is_covered() -> None:
    families = ("involute", "crank", "cycloid", "coupling")
    keys = {key for key in rverror.CATALOGUE if key.split(".")[0] in families}
    missing = keys - set(ELSEWHERE) - {key for key, _ in CASES}
    assert not missing, f"add a case of {missing} to CASES in tests/oracle_cases.py, or the test of it to ELSEWHERE"
    assert keys == set(ELSEWHERE) | {key for key, _ in CASES}
    for key, file in ELSEWHERE.items():
        assert key in (TESTS / file).read_text(encoding="utf-8"), f"tests/{file} has no test of {key}"


def test_four_planets_share_the_load_equally_while_all_carry() -> None:
    """Four planets on a floating sun are not determined by statics: a step must not lift one off."""
    unit = rverror.reducer("RV-40E", cranks=4)
    soft = Springs(pin=2e6, cam=2e10, carrier=2e13, mesh=2e6, sun=1e4, main=2e13)
    oracle = Oracle(unit, ANGLES, sense=1, springs=soft)
    for key, index in [("crank.index", {"crank": 1}), ("involute.planet_eccentricity", {"crank": 2})]:
        closed = rverror.influence(unit, ANGLES, key, direction=1, **index)
        found = oracle.influence([(key, index, label) for label in closed.labels], step=STEP)
        assert (rms(found - closed.matrix) < LIMIT * rms(closed.matrix)).all()


# The oracle itself: geometry, gradients, and the rows of the design that are exact at any stiffness.


@pytest.mark.parametrize("name", ["RV-40E", "RV-003", "odd pins"])
def test_oracle_closes_without_errors(name: str) -> None:
    """Pins lie on their trochoids, bores on their cams, and the gears roll, at every angle."""
    assert Oracle(unit_of(name), ANGLES, sense=1).assembly_gaps().max() < 1e-11


@pytest.mark.parametrize("sense", [1, -1])
def test_oracle_forces_are_gradients_of_its_energy(sense: int) -> None:
    unit = rverror.reducer("RV-003")
    oracle = Oracle(unit, ANGLES[:3], sense=sense)
    rng = np.random.default_rng(1)
    errors = Errors(unit, 1)
    for name in ("pin_centre", "disc_bore", "cam", "planet_axis", "planet_toothing", "sun_toothing", "carrier_bore"):
        field = getattr(errors, name)
        field += rng.normal(size=field.shape, scale=1e-2) + 1j * rng.normal(size=field.shape, scale=1e-2)
    u = rng.normal(size=(1, 3, oracle.unknowns), scale=1e-4)
    _, gradient, _, _ = oracle.contacts(u, errors)
    step = 1e-6
    for column in range(oracle.unknowns):
        shift = step * (np.arange(oracle.unknowns) == column)
        ahead, behind = oracle.contacts(u + shift, errors)[0], oracle.contacts(u - shift, errors)[0]
        np.testing.assert_allclose((ahead - behind) / (2 * step), gradient[..., column], rtol=1e-6, atol=1e-6)


def test_oracle_depth_is_the_distance_to_the_deformed_profile() -> None:
    """A disc drawn point by point, with its material added and its flanks moved, and pins pushed into it."""
    unit = rverror.reducer("RV-40E")
    theta, disc, size = 0.6, 1, 2e-4
    errors = Errors(unit, 1)
    for term, amount in [
        (("cycloid.disc_profile", {"disc": disc, "harmonic": 2}, "sin"), size),
        (("cycloid.disc_profile", {"disc": disc, "harmonic": 1}, "cos"), -size),
        (("cycloid.disc_pitch", {"disc": disc, "harmonic": 3}, "sin"), 3 * size),
        (("cycloid.pin_radius", {"pin": 4}, "deviation"), size),
    ]:
        put(errors, unit, 0, term, amount)
    oracle = Oracle(unit, [theta], sense=1)
    depth = oracle.contacts(np.zeros((1, 1, oracle.unknowns)), errors)[0][0, 0, disc * unit.pins :]
    gamma = 2 * np.pi * np.arange(unit.pins) / unit.pins
    centre = unit.eccentricity * np.exp(1j * (-unit.disc_lobes * theta + np.pi))
    for pin in range(unit.pins):
        seen = (unit.pin_circle_radius * np.exp(1j * gamma[pin]) - centre) * np.exp(-1j * theta)
        s = theta - gamma[pin] + np.linspace(-2e-3, 2e-3, 4001)
        curve = trochoid(unit, disc, s)[0]
        outwards = 1j * np.gradient(curve)
        outwards /= abs(outwards)
        surface = curve - unit.pin_radius * outwards
        psi = np.angle(surface)
        surface += (size * np.sin(2 * psi) - size * np.cos(psi)) * outwards
        surface += 3 * size * np.sin(3 * psi) * 1j * surface / abs(surface)
        radius = unit.pin_radius + (size if pin == 4 else 0)
        assert depth[pin] == pytest.approx(radius - abs(surface - seen).min(), abs=2e-3 * size)


@pytest.mark.parametrize("springs", [RIGID, REALISTIC], ids=["rigid", "realistic"])
@pytest.mark.parametrize("name", ["RV-40E", "RV-003"])
@pytest.mark.parametrize("sense", [1, -1])
def test_exact_rows_hold_in_the_oracle_at_any_stiffness(name: str, sense: int, springs: Springs) -> None:
    """At light load: under load the deflection's own ripple (order 1560) shifts with the pose, some 1e-5 of d."""
    unit = rverror.reducer(name)
    ratio = {"RV-40E": 121, "RV-003": 101}[name]
    pins = np.exp(2j * np.pi * np.arange(unit.pins) / unit.pins)
    bores = np.exp(2j * np.pi * np.arange(unit.cranks) / unit.cranks)
    r6 = {"RV-40E": 27.0, "RV-003": 42.0}[name]
    gears = unit.planet_teeth / unit.sun_teeth / ratio
    d = 2e-6
    ring = unit.pin_circle_radius * pins * (np.exp(1j * d) - 1)
    rows = [
        ("sun turned", {"sun_turn": d}, d / ratio),
        ("pin ring turned", {"pin_centre": ring}, (ratio - 1) / ratio * d),
        ("both turned", {"sun_turn": d, "pin_centre": ring}, d),
        ("pin ring and carrier axis shifted", {"pin_centre": d * np.exp(1j), "carrier_axis": d * np.exp(1j)}, 0.0),
        ("cranks lead their planets", {"lead": d}, -gears * d),
        ("cams ahead of their cranks", {"cam": 1j * d}, -gears * d / unit.eccentricity),
        ("disc bores ahead", {"disc_bore": 1j * d * bores}, unit.disc_lobes * gears * d / r6),
        ("carrier bores ahead", {"carrier_bore": 1j * d * bores}, -d / r6),
    ]
    errors = Errors(unit, len(rows))
    for case, (_, sizes, _) in enumerate(rows):
        for field, value in sizes.items():
            getattr(errors, field)[case] = value
    turned = Oracle(unit, ANGLES[:4], sense=sense, torque=412, springs=springs).output(errors)
    for (what, _, expected), found in zip(rows, turned, strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-7 * d / r6, err_msg=what)


@pytest.mark.parametrize(("cranks", "peak_to_peak"), [(2, 18.467), (3, 12.31)])
def test_rows_of_order_40_hold_in_the_oracle(cranks: int, peak_to_peak: float) -> None:
    """Amplitudes of 5 um errors over one period of order 40, rigid bearings, as the design's table has them."""
    unit = rverror.reducer("RV-40E", cranks=cranks)
    n = 24
    oracle = Oracle(unit, 2 * np.pi / 40 * (np.arange(n) + 0.3) / n, sense=1)
    cam = {"crank": 0, "disc": 0}
    wave = {"disc": 0, "harmonic": 1}
    terms = [
        ("crank.eccentricity", cam, "radial"),
        ("crank.eccentricity", cam, "tangential"),
        ("cycloid.disc_pitch", wave, "cos"),
        ("cycloid.disc_profile", wave, "cos"),
    ]
    amplitude = 2 / n * abs(np.fft.rfft(oracle.influence(terms))[:, 1]) * 5e-3 / ARCSEC
    expected = [peak_to_peak / 2, peak_to_peak / 2, 6.725, 9.90]
    np.testing.assert_allclose(amplitude, expected, rtol=1e-3)


def test_both_discs_alike_cancel_order_40_in_the_oracle() -> None:
    unit = rverror.reducer("RV-40E")
    errors = Errors(unit, 2)
    errors.profile[0, :, 1] = STEP
    errors.flanks[1, :, 1] = STEP
    oracle = Oracle(unit, ANGLES, sense=1)
    alike = oracle.output(errors) / STEP
    wave = {"disc": 0, "harmonic": 1}
    one = oracle.influence([("cycloid.disc_profile", wave, "cos"), ("cycloid.disc_pitch", wave, "cos")], step=STEP)
    assert (rms(alike - alike.mean(axis=1, keepdims=True)) < 2e-3 * rms(one)).all()
