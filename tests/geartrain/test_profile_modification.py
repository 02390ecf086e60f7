"""Profile modification: initial gaps against exactly ground profiles, loaded pins against those of a rigid disc."""

from __future__ import annotations

import numpy as np
import pytest
from ledger import initial_gap
from scipy.optimize import brentq

import rverror
from rverror import Model, Reducer
from rverror.geartrain.action_line import Contacts
from rverror.geartrain.contacts import pose
from rverror.geartrain.cycloid import loaded_share, normal_gap
from rverror.geartrain.mechanism import Stiffness
from strategies import Array

UNITS = {name: rverror.reducer(name) for name in ("RV-40E", "RV-003")}
#: Equidistant and shift, mm: alone, together, and against each other, little and much.
MODIFICATIONS = [(0.004, 0.0), (0.0, 0.004), (0.003, 0.002), (-0.002, 0.005), (0.005, -0.002), (0.005, -0.0045)]


class GroundDisc:
    """A disc, ground exactly: the envelope of the tool's pins, on the tool's pin circle, at the reducer's eccentricity.

    Plane vectors are complex.  Each pin is taken in the lobe that it faces, so at the roll angle phi its centre is the
    point phi of the nominal trochoid in the disc's frame.  Neither pitch point nor arms nor K are used.
    """

    def __init__(self, unit: Reducer, *, equidistant: float, shift: float) -> None:
        self.unit = unit
        self.circle, self.tool = unit.pin_circle_radius - shift, unit.pin_radius + equidistant

    def trochoid(self, t: Array, circle: float, derivative: int = 0) -> Array:
        slow = 1j / self.unit.disc_lobes
        fast = slow * self.unit.pins
        rim = circle * slow**derivative * np.exp(slow * t)
        return np.asarray(rim - self.unit.eccentricity * fast**derivative * np.exp(fast * t))

    def gaps(self, roll: Array, turn: float) -> Array:
        """Distance of each pin's surface from the profile, from its foot there, after a turn of the disc, clockwise."""
        pin = self.trochoid(roll, self.unit.pin_circle_radius) * np.exp(1j * turn)
        t = roll.copy()
        for _ in range(50):
            curve, first, second = (self.trochoid(t, self.circle, d) for d in range(3))
            step = (first.conj() * (pin - curve)).real / (abs(first) ** 2 - (second.conj() * (pin - curve)).real)
            t = t + step
            if np.abs(step).max() < 1e-13:
                break
        first = self.trochoid(t, self.circle, 1)
        foot = self.trochoid(t, self.circle) + self.tool * 1j * first / abs(first)
        return np.asarray(abs(pin - foot) - self.unit.pin_radius)

    def first_contact(self, roll: Array) -> float:
        """Turn, clockwise, that brings the first pin to the profile."""
        reach = 0.02 / self.unit.eccentricity / self.unit.disc_lobes
        return float(brentq(lambda turn: self.gaps(roll, turn).min(), 0.0, reach, xtol=1e-15))


def pins_with_one_at(unit: Reducer, roll: float) -> Array:
    """Roll angles of all pins, in (-pi, pi], one of them as asked for."""
    angle = roll - 2 * np.pi * np.arange(unit.pins) / unit.pins
    return np.asarray(np.pi - (np.pi - angle) % (2 * np.pi))


def place_of_first_contact(unit: Reducer, equidistant: float, shift: float) -> float:
    """Roll angle at which the gap over the arm is least, by search."""
    roll = np.linspace(1e-3, np.pi - 1e-3, 400_001)
    ratio = normal_gap(unit, roll, equidistant=equidistant, shift=shift) / loaded_share(unit, roll)
    return float(roll[np.argmin(ratio)])


@pytest.mark.parametrize("modification", MODIFICATIONS, ids=str)
@pytest.mark.parametrize("name", UNITS)
def test_initial_gap_is_that_of_the_ground_profile(name: str, modification: tuple[float, float]) -> None:
    """The difference is quadratic in the modification: it falls fourfold where that is halved."""
    unit = UNITS[name]
    roll = pins_with_one_at(unit, place_of_first_contact(unit, *modification))
    wrong = []
    for part in (0.25, 0.125, 0.0625):
        equidistant, shift = (part * size for size in modification)
        disc = GroundDisc(unit, equidistant=equidistant, shift=shift)
        exact = disc.gaps(roll, disc.first_contact(roll))
        found = initial_gap(unit, roll, equidistant=equidistant, shift=shift)
        wrong.append(np.abs(exact - found).max() / (part * max(map(abs, modification))))
    assert wrong[0] < 0.02
    assert wrong[1] / wrong[0] == pytest.approx(0.5, abs=0.05)  # relative to the size: linear
    assert wrong[2] / wrong[1] == pytest.approx(0.5, abs=0.03)


@pytest.mark.parametrize("name", UNITS)
def test_ground_profile_fits_without_modification(name: str) -> None:
    unit = UNITS[name]
    roll = pins_with_one_at(unit, 0.4)
    assert np.abs(GroundDisc(unit, equidistant=0, shift=0).gaps(roll, 0.0)).max() < 1e-12


@pytest.mark.parametrize("modification", [*MODIFICATIONS, (-0.004, 0.004), (0.0, 0.0)], ids=str)
def test_initial_gap_is_what_a_turn_to_first_contact_leaves(modification: tuple[float, float]) -> None:
    unit = UNITS["RV-40E"]
    equidistant, shift = modification
    phi = np.linspace(1e-4, np.pi - 1e-4, 400_001)
    K = unit.short_width_coefficient
    root = np.sqrt(1 + K * K - 2 * K * np.cos(phi))
    opened = equidistant + shift * (1 - K * np.cos(phi)) / root
    closed = np.sin(phi) / root
    expected = opened - closed * (opened / closed).min()
    found = initial_gap(unit, phi, equidistant=equidistant, shift=shift)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)
    assert found.min() > -1e-15


def test_initial_gap_of_a_disc_that_just_fits() -> None:
    """As much put back by the shift as the offset takes off: tip and root touch, and no turn is left."""
    unit = UNITS["RV-40E"]
    phi = np.linspace(-3, 3, 100)
    found = initial_gap(unit, phi, equidistant=0.004, shift=-0.004)
    np.testing.assert_allclose(found, normal_gap(unit, phi, equidistant=0.004, shift=-0.004), rtol=0, atol=1e-15)


def test_initial_gap_of_the_handbook() -> None:
    """Source 002's formula with its roots restored, as handbooks print it: away from the mesh is their positive."""
    unit = UNITS["RV-003"]
    phi = np.linspace(0.1, 3.0, 50)
    K = 1.3 * 40 / 76.5
    S = 1 + K * K - 2 * K * np.cos(phi)
    dr_rp, dr_p = 0.004, -0.003
    handbook = dr_rp * (1 - np.sin(phi) / np.sqrt(S))
    handbook -= dr_p * (1 - K * np.cos(phi) - np.sqrt(1 - K * K) * np.sin(phi)) / np.sqrt(S)
    np.testing.assert_allclose(initial_gap(unit, phi, equidistant=dr_rp, shift=-dr_p), handbook, atol=1e-15)


def test_initial_gap_refuses_a_disc_that_does_not_fit() -> None:
    with pytest.raises(ValueError, match="together they must be 0 or more"):
        initial_gap(UNITS["RV-40E"], np.array([1.0]), equidistant=0.002, shift=-0.003)


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize("unit", [*UNITS.values(), rverror.reducer("RV-003", discs=1)], ids=lambda u: f"{u.discs}")
def test_closed_form_is_that_of_thinner_pins_and_of_a_wider_circle(unit: Reducer, direction: int) -> None:
    theta = np.linspace(0, 1, 101)
    equidistant, shift = rverror.influence(unit, theta, "cycloid.profile_modification", direction=direction).matrix
    thicker = rverror.influence(unit, theta, "cycloid.pin_radius", direction=direction, pin="all").matrix[0]
    wider = rverror.influence(unit, theta, "cycloid.pin_circle", direction=direction, harmonic=0).matrix[0]
    np.testing.assert_allclose(equidistant, -thicker, rtol=1e-12)
    np.testing.assert_allclose(shift, wider, rtol=1e-12)
    assert (direction * equidistant < 0).all()  # play: the output lags
    assert (direction * shift < 0).all()


#: Bearings a hundred to a thousand times as stiff as pins.
RIGID = Stiffness(pin_contact=2e5, crank_bearing=2e8, carrier_bearing=2e8, main_bearing=2e8, gear_mesh=2e7)


def rigid_disc(unit: Reducer, theta: Array, torque: float, *, equidistant: float, shift: float) -> tuple[Array, Array]:
    """Output lag and loaded pins of discs on rigid bearings, in forward motion: one unknown, their turn beta.

    Pin i closes by l_i beta - gap_i.  Virtual work with Theta = F beta: sum of k p_i l_i = F T.
    """
    factor = unit.disc_lobes * unit.planet_teeth / unit.sun_teeth / unit.ratio
    motion = pose(unit, theta, direction=1)
    assert isinstance(motion, Contacts)
    phi = motion.eccentric[:, None] - 2 * np.pi * np.arange(unit.pins)[:, None] / unit.pins
    arm = unit.eccentricity * unit.disc_lobes * loaded_share(unit, phi)
    gap = normal_gap(unit, phi, equidistant=equidistant, shift=shift)
    turns, counts = [], []
    for levers, gaps in zip(np.moveaxis(arm, -1, 0), np.moveaxis(gap, -1, 0), strict=True):

        def excess(beta: float, levers: Array = levers, gaps: Array = gaps) -> float:
            closing = np.maximum(levers * beta - gaps, 0)
            return float((unit.stiffness.pin_contact * closing * levers).sum() - factor * torque)

        beta = brentq(excess, 0, 0.01, xtol=1e-16, rtol=1e-14)
        turns.append(beta)
        counts.append((levers * beta > gaps).sum(axis=1))
    return factor * np.array(turns), np.array(counts).T


@pytest.mark.parametrize("torque", [2e3, 20e3, 412e3])
@pytest.mark.parametrize("modification", [(0.010, 0.0), (0.0, 0.010), (0.006, 0.004), (0.020, -0.015)], ids=str)
def test_equilibrium_is_that_of_a_rigid_disc_on_its_pins(modification: tuple[float, float], torque: float) -> None:
    unit = rverror.reducer("RV-40E", stiffness=RIGID)
    theta = np.linspace(0, 2 * np.pi / 40, 23)
    equidistant, shift = modification
    effect = rverror.effect("cycloid.profile_modification", equidistant=equidistant, shift=shift)
    modified = rverror.equilibrium(Model(unit, (effect,)), theta, torque=torque, direction=1)
    nominal = rverror.equilibrium(Model(unit), theta, torque=torque, direction=1)
    lag, loaded = rigid_disc(unit, theta, torque, equidistant=equidistant, shift=shift)
    without, half = rigid_disc(unit, theta, torque, equidistant=0.0, shift=0.0)
    found = nominal.transmission_error - modified.transmission_error
    np.testing.assert_allclose(found, lag - without, rtol=3e-4)
    np.testing.assert_array_equal(modified.loaded_pins, loaded)
    assert loaded.mean() < 0.75 * half.mean()


def test_modification_leaves_fewer_pins_and_load_brings_them_back() -> None:
    """Source 002's trend: the gap is overcome by load."""
    unit = UNITS["RV-40E"]
    theta = np.linspace(0, 2 * np.pi / 40, 11)

    def loaded(equidistant: float, torque: float) -> float:
        effect = rverror.effect("cycloid.profile_modification", equidistant=equidistant)
        return float(rverror.equilibrium(Model(unit, (effect,)), theta, torque=torque, direction=1).loaded_pins.mean())

    by_size = [loaded(size, 20e3) for size in (0.0, 0.002, 0.005, 0.02)]
    by_load = [loaded(0.005, torque) for torque in (1e3, 20e3, 100e3, 412e3)]
    assert by_size == sorted(by_size, reverse=True)
    assert by_load == sorted(by_load)
    assert by_size[0] > 2 * by_size[-1]
    assert by_load[-1] > 2 * by_load[0]
