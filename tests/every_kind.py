"""One small result of every kind, with names that would break a page that does not escape them."""

from __future__ import annotations

import functools
import math
from dataclasses import replace
from typing import Any
from unittest import mock

import numpy as np

import rverror
from rverror.base.units import ARCSEC
from rverror.compensation.outcome import CompensatedOrder, CompensatedTrace, HeldError, Unseen
from rverror.diagnosis.result import Addition, Candidate, Diagnosis, ElasticEstimate, Estimate, Line, Residual, Trace
from rverror.life.result import Changed, Grown, OrderChange, Remaining, RunsCompared, Trend
from rverror.lots.of_drives import DriveLot, LikePair, LotOrder, OwnOrder
from rverror.lots.result import Change, Difference, Interval, Lot, MadeBy, Outsider, Predicted, Shift
from rverror.matching.at_load import Quantity
from rverror.matching.result import Matched, MatchedUnit, MountedPart, WayToBuild
from rverror.runs.order_table import OrderCase, TableCondition
from rverror.tolerances import full_budget, loaded_units
from rverror.tolerances.cost import Grades, Reciprocal
from rverror.tolerances.specification import Limit

#: What runs say of a reducer: one stiffness, the backlash and one exponent, and nothing of another stiffness.
ELASTIC = (
    ElasticEstimate("pin_contact", "stiffness", 2.5e5, 2.25e5, 2e5, 2.5e5, True),
    ElasticEstimate("crank_bearing", "stiffness", 3e5, 3.1e5, 2e5, 4e5, False),
    ElasticEstimate("gear_backlash", "length", 0.02, 0.031, 0.029, 0.033, True),
    ElasticEstimate("pin_exponent", "number", 1.0, 1.125, math.nan, math.nan, True),
    ElasticEstimate("flank_exponent", "number", 1.0, 1.0, 1.0, 1.25, False),
)

#: Names of what `every_kind` makes, known without making it.
KINDS = (
    "Reducer", "Drive", "Effect", "Effects", "Model", "Run", "OrderTable", "Influence", "Equilibrium", "TorsionCurve",
    "Hysteresis", "Efficiency", "Efficiencies", "DutyEfficiency", "ContactPressure",
    "Wear", "Modes", "SpeedResponse", "RunUp", "Tolerance",
    "Tolerances", "Budget", "VirtualUnits", "ErrorBudget", "Allocation", "Front", "Compensation", "Lot",
    "Trend", "RunsCompared", "Matched", "DriveLot", "Diagnosis", "Diagnosis, nothing missing", "Diagnosis, torque",
)  # fmt: skip

HOSTILE = """<script>alert("1")</script> & 'b' <img src=x onerror=alert(1)>"""
TORQUE = 412e3

MODEL = rverror.Model(
    rverror.reducer("RV-40E", cranks=3),  # so that no two dimensions that stand side by side are of one length
    (
        rverror.effect("crank.eccentricity", crank=0, disc=1, radial="4 um", tangential="1 um", uncertainty="1 um"),
        rverror.effect("cycloid.pin_position", pin=3, radial="-2 um", origin=HOSTILE),
        rverror.effect("crank.index", crank=1, angle="3 arcsec"),
    ),
    HOSTILE,
)
ENDS = rverror.model.Bench(
    position_control_stiffness=0, input_coupling_stiffness="300 N*m/rad", input_inertia="1 kg*cm^2"
)
SWING = rverror.model.Bench(load_inertia="100 kg*m^2")
FRICTION = rverror.geartrain.Friction(
    pin=0.05, mesh=0.05, crank_bearing=0.0025, crank_bearing_radius="10 mm", drag="4 N*m"
)
ROLLERS = rverror.statics.RollerBearing(rollers=14, roller_diameter="5 mm", roller_length="8 mm", race_diameter="20 mm")
DRIVE = rverror.Drive(ratio=-14.0, shafts={"motor": 14.0, HOSTILE: 3.5}, name=HOSTILE)
THETA = 2 * np.pi * np.arange(256) / 256
TOLERANCES = (
    rverror.tolerance("crank.eccentricity", "5 um", cost=Reciprocal(12.0, 0.005)),
    rverror.tolerance(
        "sensor.encoder_eccentricity", "3 arcsec", cost=Reciprocal(20.0, 1e-5), bounds=("1 arcsec", "3 arcsec")
    ),
    rverror.tolerance(
        "cycloid.pin_radius",
        "2 um",
        correlation=0.3,
        mean="1 um",
        cost=Grades((0.002, 0.004), (3.0, 1.0), (HOSTILE, "coarse")),
    ),
)


def run() -> rverror.Run:
    """A run with everything that a run can have."""
    angle = np.concatenate([THETA, THETA[::-1]])
    return rverror.run_from_arrays(
        input_angle=121 * angle,
        output_angle=angle + 20 * ARCSEC * np.sin(angle),
        time=0.1 * np.arange(angle.size),
        torque="20 N*m",
        temperature="31.5 degC",
        index="A",
        metadata={"bench": HOSTILE, HOSTILE: "Ä. Ö."},
    )


def order_table() -> rverror.runs.OrderTable:
    """Both directions, two loads, one order that one case alone holds, names that would break a page."""
    return rverror.runs.orders_from_arrays(
        direction=["forward", "forward", "reverse", "forward"],
        torque=[20e3, 20e3, 20e3, 60e3],
        input_speed=10.0,
        temperature="31.5 degC",
        order=[39, 1, 39, 39],
        amplitude=np.array([2.0, 7.0, 1.5, 3.0]) * ARCSEC,
        phase=np.radians([10.0, -170.0, 0.0, 90.0]),
        sigma=np.array([0.1, 0.2, 0.1, 0.1]) * ARCSEC,
        index="A",
        metadata={"bench": HOSTILE, HOSTILE: "Ä. Ö."},
    )


def diagnosis(
    verdict: str = "explained", *, quantity: str = "angle", mechanism: Any = MODEL.mechanism, determined: bool = True
) -> Diagnosis:
    """A diagnosis by hand: of two runs that differ in length, sizes in whole arcsec, um or N*m."""
    unit = {"angle": ARCSEC, "torque": 1e3}[quantity]
    declared = rverror.Model(mechanism, (), HOSTILE)
    low, high = (4.0, 6.0) if determined else (math.nan, math.nan)
    dimension = "angle" if quantity == "angle" else "torque"
    cause = rverror.effect("sensor.encoder_eccentricity", cos=5 * ARCSEC, sin=-2 * ARCSEC)
    addition = Addition(
        cause,
        (
            Estimate("cos", dimension, 5 * unit, low * unit, high * unit),
            Estimate("sin", dimension, -2 * unit, -3 * unit, -1 * unit),
        ),
        (("sensor.encoder_ellipticity", {}), (HOSTILE, {"harmonic": HOSTILE})),
        (1.0, 80.5),
        2.5 * unit,
        (HOSTILE,),
    )
    lines = (
        Line(36.0, 7 * unit, 6 * unit, 8 * unit, (), 3 * unit, 4 * unit),
        Line(39.5, 2 * unit, 1 * unit, 3 * unit, (HOSTILE, "input shaft")),
    )
    added = () if verdict == "nothing_missing" else (addition,)
    traces = tuple(
        Trace(
            f"{HOSTILE} {at}",
            sense,
            np.linspace(0, 2 * np.pi, count, endpoint=False),
            np.full(count, 9 * unit),
            np.full(count, 4 * unit),
            np.full(count, 8 * unit),
            torque,
            index,
            left_out,
        )
        for at, (sense, count, torque, index, left_out) in enumerate(
            [
                (1.0, 20, 20e3, "A", None),
                (-1.0, 30, None, "unknown", (np.full(30, 6 * unit), np.full(30, 3 * unit))),
            ]
        )
    )
    if not isinstance(mechanism, rverror.Drive):
        aside = {"set_aside": np.radians([30.0, 31.0, 750.0]), "slips": np.radians([-90.0, 400.0])}
        traces = (replace(traces[0], **aside), replace(traces[1], set_aside=np.zeros(0), slips=np.zeros(0)))
    return Diagnosis(
        verdict=verdict,
        noise_rms=1.5 * unit,
        before=Residual(11 * unit, 61 * unit, 12 * unit),
        before_refitted=Residual(9 * unit, 51 * unit, 10 * unit),
        after=Residual(2 * unit, 13 * unit, 3 * unit),
        added=added,
        unexplained=lines if verdict == "unexplained" else (),
        model=declared.with_effects(*(one.effect for one in added)),
        declared=declared,
        candidates=(Candidate("crank.eccentricity", {"crank": 0, "disc": 1}, 3.5), Candidate(HOSTILE, {}, -1.0)),
        tried=145,
        traces=traces,
        notes=(HOSTILE, "second note"),
        quantity=quantity,
        elastic=() if isinstance(mechanism, rverror.Drive) else ELASTIC,
    )


def compensation() -> rverror.compensation.Compensation:
    """A compensation of two loads and both directions, one run of which no fit saw, by hand."""
    at = [TableCondition(direction=s, torque=t) for s in (1.0, -1.0) for t in (20e3, 60e3)]
    cases = tuple(
        OrderCase(condition=c, orders=np.array([1.0, 40.0]), waves=np.array([-5 * ARCSEC, 2j * ARCSEC])) for c in at
    )
    return rverror.compensation.Compensation(
        correction=rverror.compensation.Correction(121.0, rverror.runs.OrderTable(cases=cases)),
        orders=(
            CompensatedOrder(1.0, (HOSTILE,), 5 * ARCSEC, 0.25 * ARCSEC, "measured"),
            CompensatedOrder(40.0, ("crank 40",), 2 * ARCSEC, math.nan, "predicted"),
        ),
        before=HeldError(4 * ARCSEC, math.nan, math.nan),
        after=HeldError(0.5 * ARCSEC, 0.4 * ARCSEC, 0.6 * ARCSEC),
        model=MODEL,
        stays=(HOSTILE,),
        notes=(HOSTILE, "second note"),
        unseen=(Unseen(HOSTILE, 4 * ARCSEC, 0.5 * ARCSEC),),
        traces=(
            CompensatedTrace(HOSTILE, THETA, 5 * ARCSEC * np.cos(THETA), 0 * THETA),
            CompensatedTrace("unseen.csv", THETA, 5 * ARCSEC * np.cos(THETA), 0 * THETA, unseen=True),
        ),
    )


def changed() -> tuple[Changed, ...]:
    """A growth of two parameters with rivals, and a jump of the measuring chain."""
    um = 1e-3
    sizes = tuple(
        Grown(name, "length", Interval(3 * um, 2 * um, 4 * um), Interval(um / 500, um / 600, um / 400))
        for name in ("cos", "sin")
    )
    jump = Grown("cos", "angle", Interval(7 * ARCSEC, 6 * ARCSEC, 8 * ARCSEC), Interval(0.0, 0.0, 0.0))
    return (
        Changed(
            "involute.planet_pitch", {"crank": 0, "harmonic": 1}, "settling", 0.0, 0.0, 50.0, 120.0, sizes, False,
            (("involute.planet_pitch", (("crank", 1), ("harmonic", 1))),), 350.0,
        ),
        Changed("sensor.encoder_eccentricity", {}, "step", 300.0, 300.0, 300.0, 0.0, (jump,), True, (), 90.0),
    )  # fmt: skip


def trend() -> Trend:
    """A trend by hand: five sessions, two conditions, one lost motion."""
    rows = np.linspace(0, 4, 5)[:, None] * ARCSEC
    left = Remaining("lost_motion", 90 * ARCSEC, 60 * ARCSEC, Interval(900.0, 700.0, math.inf))
    return Trend(
        HOSTILE, "hour", np.array([0.0, 100, 200, 300, 400]), ("forward at 20 N*m", "reverse at 20 N*m"), changed(),
        left, 30 * ARCSEC + np.hstack([rows, 2 * rows]), 50 * ARCSEC + rows, 50.5 * ARCSEC + rows, 0.3, (HOSTILE,),
    )  # fmt: skip


def runs_compared() -> RunsCompared:
    """Two measurements compared by hand."""
    size = Interval(0.5 * ARCSEC, 0.4 * ARCSEC, 0.6 * ARCSEC)
    order = OrderChange(4, "forward", 30 * ARCSEC, 0.5 * ARCSEC, size, 29.5 * ARCSEC, 1e-30)
    return RunsCompared(("forward",), (order,), changed(), 0.02 * ARCSEC, (HOSTILE,))


def matched() -> Matched:
    """Units matched by hand: three limits, one part turned, one that stays."""
    quantities = tuple(
        Quantity(limit, direction)
        for limit, direction in (
            (Limit("transmission_error", 30 * ARCSEC, 412e3), 1.0),
            (Limit("lost_motion", 60 * ARCSEC, 12.36e3), 1.0),
            (Limit("transmission_error", 30 * ARCSEC, 412e3), -1.0),
        )
    )
    units = tuple(
        MatchedUnit(
            (
                MountedPart("disc", 0, f"D{n}"),
                MountedPart("disc", 1, HOSTILE, 1),
                MountedPart("housing", None, f"H{n}"),
                MountedPart("roller", 0, f"R{n}"),
            ),
            MODEL,
            (20 * ARCSEC + n * ARCSEC, 50 * ARCSEC, 21 * ARCSEC),
            (1.0, 1.0, 0.5)[n],
        )
        for n in range(3)
    )
    turns = np.array([unit.turns for unit in units])
    ways = (
        WayToBuild("put together at random", 2 * turns, np.array([0.9, 1.3, 2.1]), np.array([[0.9], [1.3], [2.1]])),
        WayToBuild("matched", turns, np.array([0.83, 0.84, 0.85]), np.array([[0.8, 0.9]] * 2 + [[0.9, 1.1]]), cost=2.5),
    )
    allowed = (30 * ARCSEC, 60 * ARCSEC, 30 * ARCSEC)
    return Matched(HOSTILE, quantities, allowed, units, {"disc": ("D9", HOSTILE)}, 4, 4, ways, 0.05, (HOSTILE,))


def drive_lot() -> DriveLot:
    """A lot of drives by hand: two orders, a unit that differs in one, a pair."""
    size = Interval(20 * ARCSEC, 15 * ARCSEC, 25 * ARCSEC)
    orders = tuple(
        LotOrder(order, "forward", 5 * ARCSEC, 21 * ARCSEC, 900 * ARCSEC, size, 1.0, 9 * ARCSEC, chance)
        for order, chance in ((4, 1e-4), (50, 0.3))
    )
    own = OwnOrder(HOSTILE, 50, "forward", 900 * ARCSEC, 880 * ARCSEC, 40.0, 1e-6)
    pair = LikePair(("A", "B"), 2 * ARCSEC, 300 * ARCSEC, 5e-4)
    sizes = np.array([[20.0, 900.0], [5.0, 30.0], [21.0, 30.5]]) * ARCSEC
    return DriveLot(HOSTILE, (HOSTILE, "A", "B"), ("forward",), orders, (own,), (pair,), sizes, (HOSTILE,))


def lot() -> Lot:
    """A lot by hand with everything that a lot can have: sizes in whole um and arcsec."""

    def size(value: float, unit: float) -> Interval:
        return Interval(value * unit, (value - 0.2 * abs(value)) * unit, (value + 0.3 * abs(value)) * unit)

    def shifts(value: float, **indices: int) -> tuple[Shift, ...]:
        return tuple(
            Shift("crank.eccentricity", indices, name, "length", size(value, 1e-3)) for name in ("radial", "tangential")
        )

    two, two_waves = ("radial", "tangential"), ("cos", "sin")
    processes = (
        MadeBy(
            "crank.eccentricity",
            {},
            two,
            "length",
            size(2.0, 1e-3),
            True,
            0.75,
            (HOSTILE,),
            30,
            HOSTILE,
            1.25,
            1.125,
        ),
        MadeBy("crank.index", {}, ("angle",), "angle", size(4.0, ARCSEC), True, 0.2, (), 50),
        MadeBy("involute.planet_pitch", {"harmonic": 2}, two_waves, "length", size(1.0, 1e-3), True, 0.05),
        MadeBy("cycloid.pin_position", {}, ("radial",), "length", size(1.0, 1e-3), False, 0.0),
        MadeBy("cycloid.pin_radius", {}, ("deviation",), "length", None, False, 0.0),
    )
    return Lot(
        HOSTILE,
        40,
        ("forward at 20 N*m", "reverse at 20 N*m"),
        processes,
        (*shifts(3.0), *shifts(5.0, crank=0, disc=1)),
        (shifts(3.0)[0], shifts(5.0, crank=0, disc=1)[1]),
        {"pin_contact": Interval(1.125, 1.0, 1.25)},
        (Outsider(HOSTILE, 60.0, 1e-6, shifts(20.0, crank=1, disc=0), (HOSTILE,)),),
        (Difference("machine", HOSTILE, 20, 1e-4, shifts(6.0)[:1], ("crank.index",)),),
        (Change(HOSTILE, (HOSTILE, HOSTILE), "step", 1e-3, shifts(-7.0)[1], (HOSTILE,)),),
        (
            Predicted("forward at 20 N*m", 30 * ARCSEC, size(50.0, ARCSEC), (31 * ARCSEC, 52 * ARCSEC)),
            Predicted("reverse at 20 N*m", 32 * ARCSEC, size(54.0, ARCSEC), (33 * ARCSEC, 55 * ARCSEC)),
        ),
        0.25,
        np.array([1, 39, 40]),
        np.array([[3.0, 1.0, 2.0], [3.5, 1.5, 2.5]]) * ARCSEC,
        np.array([[2.5, 1.25, 2.0], [3.0, 1.25, 2.0]]) * ARCSEC,
        (HOSTILE, "second note"),
    )


def _efficiency(theta: Any, drives: str, direction: float) -> rverror.statics.Efficiency:
    return rverror.statics.efficiency(
        MODEL, theta, torque=TORQUE, friction=FRICTION, direction=direction, drives=drives, method="closed"
    )


@functools.cache
def every_kind() -> dict[str, tuple[Any, dict[str, Any]]]:
    """Results by kind, each with what else its tables take; some two seconds."""
    stack = rverror.tolerances.stack(MODEL, TOLERANCES, theta=THETA)
    with (
        mock.patch.object(full_budget, "POINTS", 8),  # each solves five units
        mock.patch.multiple(loaded_units, FINE=720, POSITIONS=6),  # as the fixture few_angles
    ):
        budget = rverror.error_budget(
            MODEL, TOLERANCES, theta=THETA, torque=TORQUE, count=256, index_count=256, loaded_count=16
        )
    allocation = rverror.allocate(MODEL, TOLERANCES, THETA, limit="60 arcsec", kind="worst")
    front = rverror.tolerances.cost_front(stack, ["5 arcsec", "60 arcsec"], kind="worst")
    few = THETA[:6]
    return {
        "Reducer": (MODEL.mechanism, {}),
        "Drive": (DRIVE, {}),
        "Effect": (MODEL.effects[0], {}),
        "Effects": (MODEL.effects, {}),
        "Model": (MODEL, {}),
        "Run": (run(), {}),
        "OrderTable": (order_table(), {}),
        "Influence": (
            rverror.influence(MODEL.mechanism, THETA, "crank.eccentricity", crank=0, disc=1),
            {},
        ),
        "Equilibrium": (
            rverror.equilibrium(MODEL, few, torque=TORQUE, direction=1.0),
            {},
        ),
        "TorsionCurve": (
            rverror.statics.torsion_curve(MODEL, few[:2], torques=["-412 N*m", 0, "206 N*m"]),
            {},
        ),
        "Hysteresis": (
            rverror.statics.hysteresis(MODEL, few[:2], torques=["-412 N*m", 0, "206 N*m"], friction=FRICTION),
            {},
        ),
        "Efficiency": (_efficiency(few, "input", 1.0), {}),
        "Efficiencies": ([_efficiency(few, "input", 1.0), _efficiency(few, "output", -1.0)], {}),
        "DutyEfficiency": (
            rverror.statics.duty_efficiency(
                MODEL,
                few,
                duty=[
                    rverror.statics.DutyPhase(torque=TORQUE, speed=190.0),
                    rverror.statics.DutyPhase(torque=20e3, speed=300.0),
                ],
                friction=FRICTION,
                direction=1.0,
                method="closed",
                thermal_resistance="0.3 K/W",
            ),
            {},
        ),
        "ContactPressure": (
            rverror.statics.contact_pressure(
                MODEL, few, torque=TORQUE, direction=1.0, disc_width="9 mm", gear_width="8 mm", cam_bearing=ROLLERS
            ),
            {},
        ),
        "Wear": (
            rverror.statics.wear(
                MODEL,
                torque=TORQUE,
                input_speed=190.0,
                hours=[0, 500],
                coefficients=rverror.statics.WearCoefficients(disc=1e-13, sun=1e-13),
                disc_width=9.0,
                gear_width=8.0,
                direction=1.0,
            ),
            {},
        ),
        "Modes": (rverror.dynamics.modes(replace(MODEL, bench=ENDS), torque=TORQUE, theta=few[1]), {}),
        "SpeedResponse": (
            rverror.dynamics.speed_response(
                replace(MODEL, bench=SWING), np.linspace(40, 80, 5), torque=TORQUE, by_effect=True
            ),
            {},
        ),
        "RunUp": (
            rverror.dynamics.run_up(replace(MODEL, bench=SWING), [0, 0.01], [0, 40], torque=TORQUE, samples=9),
            {},
        ),
        "Tolerance": (TOLERANCES[0], {}),
        "Tolerances": (TOLERANCES, {}),
        "Budget": (budget.closed, {}),
        "VirtualUnits": (budget.units, {}),
        "ErrorBudget": (budget, {}),
        "Allocation": (allocation, {}),
        "Front": (front, {}),
        "Compensation": (compensation(), {}),
        "Lot": (lot(), {}),
        "Trend": (trend(), {}),
        "RunsCompared": (runs_compared(), {}),
        "Matched": (matched(), {}),
        "DriveLot": (drive_lot(), {}),
        "Diagnosis": (diagnosis("unexplained"), {}),
        "Diagnosis, nothing missing": (diagnosis("nothing_missing", mechanism=DRIVE), {}),
        "Diagnosis, torque": (diagnosis("explained", quantity="torque", mechanism=DRIVE, determined=False), {}),
    }
