"""One damaged lobe of a disc: as the waves of the profile that it is the sum of, and as the pulse that a pin feels."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, strategies as st

import rverror
from rverror import Reducer
from rverror.base.arrays import dot
from rverror.base.units import ARCSEC
from rverror.geartrain import cycloid
from rverror.geartrain.action_line import Contacts
from rverror.geartrain.contacts import pose
from strategies import reducers


def contacts(unit: Reducer, theta: np.ndarray) -> Contacts:
    motion = pose(unit, theta, direction=1.0)
    assert isinstance(motion, Contacts)
    return motion


@given(unit=reducers(), place=st.integers(0, 10**6), start=st.floats(-3, 3))
def test_a_lobe_is_the_sum_of_the_waves_of_its_shape(unit: Reducer, place: int, start: float) -> None:
    """Fourier series of cos^2 over one pitch: its coefficients fall with the cube of the harmonic."""
    disc, lobe = place % unit.discs, place % unit.disc_lobes
    motion = contacts(unit, start + np.linspace(0, 0.2, 7))
    pitch = 2 * np.pi / unit.disc_lobes
    # the pin on +x sits in a root when the eccentric points at it, and the disc rolls off by a lobe a turn
    root = -(disc / unit.discs) * pitch
    eccentric = 2 * np.pi * disc / unit.discs
    first = next(root + m * pitch for m in range(3 * unit.pins) if root + m * pitch > eccentric - 1e-9)
    crest = first + (lobe + 0.5) * pitch
    psi = pitch * (np.arange(4096) + 0.5) / 4096 - pitch / 2
    shape = np.cos(np.pi * psi / pitch) ** 2
    most = 12 * unit.disc_lobes
    total = 0.0
    for h in range(most):
        weight = float(np.mean(shape * np.cos(h * psi))) / unit.disc_lobes * (1 if h == 0 else 2)
        wave = cycloid.disc_profile(motion, disc=disc, harmonic=h).vector
        total = total + weight * (np.cos(h * crest) * wave[0] + np.sin(h * crest) * wave[1])
    found = cycloid.disc_lobe(motion, disc=disc, lobe=lobe)
    np.testing.assert_allclose(found.vector[0], total, rtol=0, atol=2e-3)


@pytest.mark.parametrize("lobe", [0, 17])
@pytest.mark.parametrize(
    ("name", "discs", "disc"),
    [*(("RV-40E", 2, k) for k in range(2)), *(("RV-003", 2, k) for k in range(2)), ("RV-40E", 3, 1), ("RV-40E", 3, 2)],
)
def test_the_crest_is_where_the_disc_is_widest(name: str, discs: int, disc: int, lobe: int) -> None:
    """The defect is largest at the contact that is farthest from the disc's centre, nothing at the nearest.

    Three discs do not divide 40 pins: the eccentrics of the second and third do not point into a root.
    """
    unit = rverror.reducer(name, discs=discs)
    motion = contacts(unit, np.linspace(0, 2 * np.pi, 4001))
    error = cycloid.disc_lobe(motion, disc=disc, lobe=lobe)
    size = dot(error.vector[0][0], motion.pin_normal[disc])  # (pins, n)
    gamma = 2 * np.pi * np.arange(unit.pins) / unit.pins
    pin = unit.pin_circle_radius * np.stack([np.cos(gamma), np.sin(gamma)], axis=1)[..., None]
    eccentric = unit.eccentricity * np.stack([np.cos(motion.eccentric[disc]), np.sin(motion.eccentric[disc])])
    point = pin + unit.pin_radius * motion.pin_normal[disc] - eccentric
    radius = np.hypot(point[:, 0], point[:, 1])
    crest, root = radius.max(), radius.min()
    on_it = size > 1e-6
    assert radius[size > 0.999].min() > root + 0.99 * (crest - root)
    assert radius[on_it & (size < 0.1)].max() < root + 0.2 * (crest - root)
    # z_p pins touch z_c lobes at any time
    assert on_it.sum(axis=0).mean() == pytest.approx(unit.pins / unit.disc_lobes, rel=0.01)


@pytest.mark.parametrize(("discs", "disc"), [(2, 0), (2, 1), (3, 1), (3, 2)])
def test_all_lobes_together_are_a_wave_of_the_profile(discs: int, disc: int) -> None:
    """cos^2 over every pitch: half of it uniform, half a wave of as many periods as lobes, with its roots there.

    A root is where the pin on +x would sit if the eccentric pointed at it, and the disc rolls off by a lobe a turn.
    """
    unit = rverror.reducer("RV-40E", discs=discs)
    motion = contacts(unit, np.linspace(0.1, 2.0, 11))
    lobes = sum(cycloid.disc_lobe(motion, disc=disc, lobe=lobe).vector[0] for lobe in range(unit.disc_lobes))
    uniform = cycloid.disc_profile(motion, disc=disc, harmonic=0).vector[0]
    cos, sin = cycloid.disc_profile(motion, disc=disc, harmonic=unit.disc_lobes).vector
    root = -2 * np.pi * disc / discs
    np.testing.assert_allclose(lobes, (uniform - np.cos(root) * cos - np.sin(root) * sin) / 2, rtol=0, atol=1e-12)


def test_a_raised_lobe_is_found_where_waves_of_the_profile_leave_lines() -> None:
    """Rare causes come last, after all others have failed; runs from the loaded equilibrium, with noise.

    Beside nothing declared two equal discs half a turn apart are alike: the lobe may be on either, and both are named.
    """
    unit, points, turns = rverror.reducer("RV-40E"), 1024, 3
    theta = 2 * np.pi * np.arange(points) / points
    missing = rverror.effect("cycloid.disc_lobe", disc=0, lobe=5, deviation="8 um")
    random, runs = np.random.default_rng(3), []
    for direction in (1, -1):
        state = rverror.equilibrium(rverror.Model(unit, (missing,)), theta, torque=20e3, direction=direction)
        error = np.tile(state.transmission_error, turns) + 0.3 * ARCSEC * random.standard_normal(turns * points)
        angle, order = 2 * np.pi * np.arange(turns * points) / points, slice(None, None, direction)
        runs.append(
            rverror.run_from_arrays(
                input_angle=unit.ratio * angle[order],
                output_angle=(angle + error)[order],
                direction="forward" if direction > 0 else "reverse",
                torque=20e3,
            )
        )
    found = rverror.diagnose(rverror.Model(unit), runs)
    (added,) = found.added
    names = [(added.effect.key, dict(added.effect.indices)), *added.indistinguishable]
    assert sorted(names, key=str) == [("cycloid.disc_lobe", {"disc": disc, "lobe": 5}) for disc in (0, 1)]
    assert found.verdict == "explained"
    size = found.added[0].estimates[0]
    assert size.low < 8e-3 < size.high
