"""Duty cycles: energy, the temperature at which losses leave, and viscosity by hand."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import pytest

import rverror
from pages import DOCS, text
from rverror import Model
from rverror.geartrain import Friction
from rverror.statics import DutyPhase, Lubricant, duty_efficiency

UNIT = rverror.reducer("RV-40E")
NEW = Model(UNIT)
THETA = 2 * np.pi / 40 * np.arange(7) / 7
RUBS = Friction(pin=0.05, mesh=0.05, crank_bearing=0.0025, crank_bearing_radius="10 mm", drag="4 N*m")
DRAGS = Friction(drag="4 N*m")
CYCLE = [DutyPhase(torque=412e3, speed=190.0, hours=1), DutyPhase(torque=103e3, speed=380.0, hours=2)]
OIL = Lubricant(viscosity_40="150 cSt", viscosity_100="15 cSt", temperature="20 degC", speed=190.0)
WATT = 1e3  # N mm/s


def over(duty: Any, friction: Friction = RUBS, **more: Any) -> rverror.statics.DutyEfficiency:
    return duty_efficiency(NEW, THETA, duty=duty, friction=friction, direction=1.0, **more)


@pytest.mark.parametrize("drives", ["input", "output"])
def test_energy_of_a_cycle_is_that_of_its_phases(drives: str) -> None:
    """Out over in, and what is missing is what each kind of contact takes."""
    found = over(CYCLE, drives=drives)
    out = into = 0.0
    for one in CYCLE:
        alone = rverror.statics.efficiency(NEW, THETA, torque=one.torque, friction=RUBS, direction=1.0, drives=drives)
        at_output, at_input = one.torque * one.speed / 121, alone.input_torque.mean() * one.speed
        out += one.hours * (at_output if drives == "input" else at_input)
        into += one.hours * (at_input if drives == "input" else at_output)
    assert found.mean == pytest.approx(out / into, rel=1e-12)
    assert found.power == pytest.approx((out / 3, into / 3))
    assert sum(found.losses.values()) == pytest.approx(found.power[1] - found.power[0], rel=1e-6)


def test_one_phase_is_the_efficiency_and_two_halves_are_one() -> None:
    one, halves = over(CYCLE[0]), over([CYCLE[0]] * 2)
    alone = rverror.statics.efficiency(NEW, THETA, torque=412e3, friction=RUBS, direction=1.0)
    assert one.mean == halves.mean == pytest.approx(alone.mean, rel=1e-14)
    assert one.losses == pytest.approx(halves.losses)
    assert one.housing == one.inside == one.ambient == 293.15


def test_standing_takes_hours_and_no_power() -> None:
    """The mean loss, and with it the rise, falls to the share of the hours in which it turns."""
    rise = {}
    for name, rest in (("at work", []), ("half the time", [DutyPhase(torque=0, speed=0, hours=1)])):
        found = over([CYCLE[0], *rest], thermal_resistance="0.3 K/W", ambient="25 degC")
        rise[name] = found.housing - 298.15
    assert rise["half the time"] == pytest.approx(rise["at work"] / 2, rel=1e-9)


def test_idling_is_all_loss() -> None:
    found = over(DutyPhase(torque=0, speed=121.0), DRAGS, thermal_resistance="0.5 K/W")
    assert found.mean == 0
    assert found.housing - found.ambient == pytest.approx(0.5 * 4, rel=1e-6)
    assert over(DutyPhase(torque=1e3, speed=0)).mean == 0


def test_a_torque_in_the_wrong_unit_is_doubted() -> None:
    with pytest.warns(UserWarning, match="torque = 412 is taken as 412 N"):
        over(DutyPhase(torque=412, speed=1.0))


def test_losses_that_do_not_change_give_the_rise_in_closed_form() -> None:
    """Drag alone: torque times speed of the output times resistance."""
    found = over(CYCLE[0], DRAGS, thermal_resistance="0.5 K/W", inside_resistance="0.2 K/W")
    power = 4e3 * 190 / 121 / WATT
    assert found.housing - 293.15 == pytest.approx(0.5 * power, rel=1e-9)
    assert found.inside - found.housing == pytest.approx(0.2 * power, rel=1e-9)


def test_what_leaves_through_the_resistance_is_what_is_lost() -> None:
    found = over(CYCLE, lubricant=OIL, thermal_resistance="0.3 K/W", inside_resistance="0.1 K/W")
    out, into = found.power
    assert found.inside - found.ambient == pytest.approx(0.4 * (into - out) / WATT, rel=1e-6)
    cold = over(CYCLE, lubricant=OIL)
    assert sum(found.losses.values()) < 0.95 * sum(cold.losses.values())


def walther(temperature: float) -> float:
    """Viscosity as ASTM D341 has it, decimal logarithms: A - B log T through both points."""
    first, last = (math.log10(math.log10(v + 0.7)) for v in (150.0, 15.0))
    b = (first - last) / (math.log10(373.15) - math.log10(313.15))
    a = first + b * math.log10(313.15)
    return float(10 ** (10 ** (a - b * math.log10(temperature))) - 0.7)


def test_temperature_of_drag_alone_by_bisection() -> None:
    found = over(CYCLE[1], DRAGS, lubricant=OIL, thermal_resistance="5 K/W")
    low, high = 293.15, 600.0
    for _ in range(60):
        middle = (low + high) / 2
        drag = 4e3 * (2 * walther(middle) / walther(293.15)) ** (2 / 3)
        low, high = (middle, high) if 293.15 + 5 * drag * 380 / 121 / WATT > middle else (low, middle)
    assert found.housing == pytest.approx(low, abs=1e-6)
    assert found.housing > 320


def test_without_resistance_it_is_as_cold_as_its_surroundings() -> None:
    none = over(CYCLE, lubricant=OIL, ambient="5 degC")
    little = over(CYCLE, lubricant=OIL, ambient="5 degC", thermal_resistance="1e-9 K/W")
    assert none.housing == 278.15
    assert little.mean == pytest.approx(none.mean, rel=1e-9)


def test_a_given_temperature_is_taken_as_it_is() -> None:
    found = over(CYCLE, lubricant=OIL, thermal_resistance="0.3 K/W", temperature="50 degC")
    assert found.housing == found.inside == 323.15
    drag = 4e3 * (walther(323.15) / walther(293.15)) ** (2 / 3)
    assert found.phases[0].losses["drag"].mean() == pytest.approx(drag)


def test_share_of_the_seals_does_not_follow_the_oil() -> None:
    oil = Lubricant(viscosity_40=150, viscosity_100=15, temperature="20 degC", speed=190.0, viscous=0.25)
    assert oil.drag(4e3, temperature=350.0, speed=190.0) == pytest.approx(
        3e3 + OIL.drag(1e3, temperature=350.0, speed=190.0)
    )
    assert oil.viscosity(313.15) == pytest.approx(150)
    assert oil.viscosity(373.15) == pytest.approx(15)


def test_a_unit_that_is_warm_all_over_moves_its_output_by_nothing() -> None:
    """A similarity; what is warmer inside moves it by the page's 27.4 arcsec per 10 K, whatever all have in common."""
    even = over(CYCLE, thermal_resistance="0.3 K/W")
    hotter = over(CYCLE, thermal_resistance="0.3 K/W", inside_resistance="0.1 K/W")
    lost = [rverror.lost_motion(NEW.with_effects(*more), THETA).mean() for more in ((), (even.growth,))]
    assert even.growth.values[0] > 10
    assert lost[1] == pytest.approx(lost[0], rel=1e-6)
    moved = rverror.transmission_error(NEW.with_effects(hotter.growth), THETA, direction=1.0).mean()
    assert moved / rverror.ARCSEC == pytest.approx(2.74 * (hotter.inside - hotter.housing), rel=0.01)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: DutyPhase(torque=-1e3, speed=1.0), r"torque = -1 N\*m: must be 0 or more"),
        (lambda: DutyPhase(torque=1e3, speed=1.0, hours=0), "hours = 0: must be above 0"),
        (lambda: over([]), "give one or several DutyPhase"),
        (lambda: over(3.0), "give one or several DutyPhase"),
        (lambda: over(CYCLE, thermal_resistance="-1 K/W"), "thermal_resistance = -1 kelvin/W: must be 0 or more"),
        (lambda: over(CYCLE, ambient="-300 degC"), "ambient = .*must be above 0"),
        (lambda: Lubricant(viscosity_40=10, viscosity_100=20, temperature=300, speed=1), "must be below viscosity_40"),
        (
            lambda: Lubricant(viscosity_40=20, viscosity_100=5, temperature=300, speed=1, viscous=2),
            "viscous = 2: must be from 0 to 1, a share",
        ),
        (lambda: duty_efficiency(NEW, THETA, duty=CYCLE), "no coefficients are stated"),
    ],
)
def test_what_is_refused(call: Any, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        call()


def test_the_table_of_the_page_is_what_it_says() -> None:
    (table,) = re.findall(
        r"\| \$R_h\$.*?\n\| ---.*?\n(.*?)\n\n", text(DOCS / "theory" / "thermal-and-load.md"), re.DOTALL
    )
    rubs = Friction(
        pin=0.05,
        mesh=0.05,
        crank_bearing=0.0025,
        crank_bearing_radius="10 mm",
        carrier_bearing=0.0018,
        carrier_bearing_radius="10 mm",
        drag="4 N*m",
    )
    phases = [("412 N*m", "1815 rpm", 1), ("103 N*m", "3630 rpm", 2), ("0 N*m", "0 rpm", 1)]
    cycle = [DutyPhase(torque=torque, speed=speed, hours=hours) for torque, speed, hours in phases]
    oil = Lubricant(viscosity_40=150, viscosity_100=15, temperature="20 degC", speed="1815 rpm")
    for row in table.splitlines():
        resistance, *told = (float(cell) for cell in row.strip("|").split("|"))
        around = rverror.base.to_core(f"{resistance} K/W", "thermal_resistance")
        found = over(cycle, rubs, lubricant=oil, thermal_resistance=around, inside_resistance=around / 3)
        moved = rverror.transmission_error(NEW.with_effects(found.growth), THETA, direction=1.0).mean()
        lost = sum(found.losses.values()), found.losses["drag"]
        expected = [100 * found.mean, *(power / WATT for power in lost)]
        expected += [found.housing - 273.15, found.inside - 273.15, moved / rverror.ARCSEC]
        np.testing.assert_allclose(told, expected, atol=0.051)
