"""Random but valid reducers and motions for the property tests."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
from hypothesis import strategies as st

from rverror import Reducer

Array = npt.NDArray[np.float64]


def smallest_convex_radius(*, pins: int, pin_circle_radius: float, eccentricity: float) -> float:
    """Smallest convex radius of curvature of the pin-centre trochoid, from its derivatives, by search.

    The pin centre draws w(t) = R_p exp(i t) - a exp(i z_p t) on the disc; its curvature is Im(conj(w') w'') / |w'|^3.
    """
    t = np.linspace(0, 2 * math.pi / (pins - 1), 20001)
    slow, fast = pin_circle_radius * np.exp(1j * t), eccentricity * np.exp(1j * pins * t)
    first, second = 1j * (slow - pins * fast), -(slow - pins**2 * fast)
    curvature = (np.conj(first) * second).imag / np.abs(first) ** 3
    return float(1 / curvature.max())


@st.composite
def reducers(draw: st.DrawFn, *, cranks: tuple[int, int] = (2, 4), discs: tuple[int, int] = (1, 4)) -> Reducer:
    """Valid reducers: K from 0.3 to 0.95, pins neither overlapping nor undercutting, ratios mostly not whole."""
    pins = draw(st.integers(8, 60))
    pin_circle_radius = draw(st.floats(30, 150))
    eccentricity = draw(st.floats(0.3, 0.95)) * pin_circle_radius / pins
    bound = min(
        pin_circle_radius * math.sin(math.pi / pins),
        smallest_convex_radius(pins=pins, pin_circle_radius=pin_circle_radius, eccentricity=eccentricity),
    )
    pin_radius = draw(st.floats(0.2, 0.9)) * bound
    sun_teeth, planet_teeth = draw(st.integers(6, 30)), draw(st.integers(10, 60))
    crank_radius = draw(st.floats(0.25, 0.9)) * (pin_circle_radius - pin_radius - 2 * eccentricity)
    number_of_discs = draw(st.integers(*discs))
    number_of_cranks = draw(st.integers(*cranks))
    return Reducer(
        sun_teeth=sun_teeth,
        planet_teeth=planet_teeth,
        module=2 * crank_radius / (sun_teeth + planet_teeth),
        pressure_angle=math.radians(draw(st.floats(14, 30))),
        disc_lobes=pins - 1,
        pins=pins,
        pin_circle_radius=pin_circle_radius,
        pin_radius=pin_radius,
        eccentricity=eccentricity,
        cranks=max(number_of_cranks, 3) if number_of_discs == 1 else number_of_cranks,  # 2 would pass dead centres
        discs=number_of_discs,
        spline_radius=draw(st.floats(0.3, 0.9)) * crank_radius,
    )


@st.composite
def in_phase_reducers(draw: st.DrawFn) -> Reducer:
    """Reducers with two or more discs that mesh in phase: the number of discs divides the number of pins."""
    unit = draw(reducers(discs=(2, 4)))
    pins = math.ceil(unit.pins / unit.discs) * unit.discs
    shrink = unit.pins / pins  # keeps K and the room between pins
    return variant(
        unit,
        pins=pins,
        disc_lobes=pins - 1,
        eccentricity=unit.eccentricity * shrink,
        pin_radius=unit.pin_radius * shrink * 0.8,
    )


@st.composite
def angles(draw: st.DrawFn, size: int = 24) -> Array:
    """Rows of output angles at unremarkable places, so that no pin stands exactly between drive and coast side."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    return rng.uniform(-2 * math.pi, 2 * math.pi, size)


def variant(unit: Reducer, **changes: Any) -> Reducer:
    """Copy of a reducer with other values."""
    names = Reducer.__dataclass_fields__
    return Reducer(**({name: getattr(unit, name) for name in names} | changes))


def scaled(unit: Reducer, factor: float) -> Reducer:
    """The same reducer with every length times a factor."""
    lengths = ("module", "pin_circle_radius", "pin_radius", "eccentricity", "gear_backlash", "spline_radius")
    return variant(unit, **{name: getattr(unit, name) * factor for name in lengths})
