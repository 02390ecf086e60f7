"""Friction: energy, limits and mirror images; a train of its own with Coulomb forces; textbook and makers' figures."""

from __future__ import annotations

import functools
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import rverror
from pages import DOCS, text
from rverror import Model, Reducer, effect
from rverror.geartrain import BearingPreload, Friction, Stiffness
from rverror.statics import Efficiency, NotConvergedError, efficiency, hysteresis
from rverror.statics.friction import mean_mesh_slip
from strategies import angles, reducers

UNIT = rverror.reducer("RV-40E")
THETA = 2 * np.pi / 40 * (np.arange(16) + 0.3) / 16
#: Stated assumptions for an RV-40E: pins and teeth in mixed lubrication, needle rollers and tapered rollers by their
#: makers' coefficients (0.0025 and 0.0018) at half of bores of some 20 mm, seals and main bearing 4 N*m at the output.
STATED = Friction(
    pin=0.05,
    mesh=0.05,
    crank_bearing=0.0025,
    crank_bearing_radius="10 mm",
    carrier_bearing=0.0018,
    carrier_bearing_radius="10 mm",
    drag="4 N*m",
)
PARTS = ("pin", "mesh", "crank_bearing", "carrier_bearing", "drag")


def of(unit: Reducer = UNIT, theta: np.ndarray = THETA, **more: object) -> Efficiency:
    options = {"torque": "412 N*m", "friction": STATED, "direction": 1.0} | more
    return efficiency(Model(unit), theta, **options)  # type: ignore[arg-type]


def scaled(friction: Friction, share: float) -> Friction:
    names = ("pin", "mesh", "crank_bearing", "carrier_bearing", "drag")
    return replace(friction, **{name: share * getattr(friction, name) for name in names})


def errors_of(unit: Reducer) -> tuple[rverror.Effect, ...]:
    return (
        effect("cycloid.pin_position", pin=3, radial="8 um", tangential="-5 um"),
        effect("crank.eccentricity", crank=0, disc=0, radial="6 um", tangential="2 um"),
        effect("coupling.carrier_bore_position", crank=1, radial="3 um", tangential="5 um"),
    )


def out_of_energy(found: Efficiency) -> float:
    """Power in less power out less power lost, over power through."""
    sign = 1 if found.drives == "input" else -1
    lost = sum(found.losses.values())
    left = abs(found.ratio) * found.input_torque - found.torque - sign * lost
    return float(np.abs(left).max() / (found.torque + np.max(lost)))


# --- energy -----------------------------------------------------------------------------------------------------------


@given(
    unit=reducers(),
    theta=angles(4),
    direction=st.sampled_from([1.0, -1.0]),
    drives=st.sampled_from(["input", "output"]),
    output=st.sampled_from(["carrier", "housing"]),
    share=st.floats(0.0, 1.0),
)
@settings(max_examples=40, deadline=None)
def test_power_that_goes_in_comes_out_or_is_lost_to_slip(
    unit: Reducer, theta: np.ndarray, direction: float, drives: str, output: str, share: float
) -> None:
    """The balance of the sun against forces times slip speeds: nominal motion closes no contact, so exactly."""
    model = Model(replace(unit, output=output), errors_of(unit))
    friction = Friction(
        pin=0.05 * share,
        mesh=0.1 * share,
        crank_bearing=0.002,
        crank_bearing_radius=0.3 * unit.crank_radius,
        carrier_bearing=0.003 * share,
        carrier_bearing_radius=0.2 * unit.crank_radius,
        drag=5e3,
    )
    found = efficiency(model, theta, torque=200e3, friction=friction, direction=direction, drives=drives)
    assert out_of_energy(found) < 1e-8


def test_closed_form_is_the_limit_of_stiff_parts_and_little_friction() -> None:
    """Rigid bearings: the closed form's forces; losses per coefficient are then those of first order."""
    stiff = Stiffness(crank_bearing=1e11, carrier_bearing=1e12, main_bearing=1e12)
    little = scaled(STATED, 1e-3)
    rigid = replace(UNIT, stiffness=stiff)
    for drives in ("input", "output"):
        here, there = (of(rigid, friction=little, drives=drives, method=m) for m in ("equilibrium", "closed"))
        assert out_of_energy(there) < 1e-12
        for part in PARTS:
            np.testing.assert_allclose(here.losses[part], there.losses[part], rtol=5e-3, err_msg=part)


def test_without_friction_nothing_is_lost() -> None:
    model = Model(UNIT, errors_of(UNIT))
    for drives in ("input", "output"):
        found = efficiency(model, THETA, torque=412e3, friction=Friction(), direction=1.0, drives=drives)
        np.testing.assert_array_equal(found.error_change, 0)
        np.testing.assert_allclose(found.efficiency, 1, rtol=1e-9)
        assert found.by_part == dict.fromkeys(PARTS, 0.0)
    np.testing.assert_allclose(of(friction=Friction(), torque=0).input_torque, 0, atol=1e-9)


def test_changes_are_of_first_order_in_the_coefficients() -> None:
    """Halving them halves loss and change of the error, and halves again what is left of that."""
    no_drag = replace(STATED, drag=0.0)
    rows = {share: of(friction=scaled(no_drag, share)) for share in (0.02, 0.01, 0.005)}
    for values in (
        {share: row.error_change / share for share, row in rows.items()},
        {share: (1 / row.efficiency - 1) / share for share, row in rows.items()},
    ):
        far, near = values[0.02] - values[0.01], values[0.01] - values[0.005]
        assert np.abs(far).max() < 0.02 * np.abs(values[0.01]).min()
        np.testing.assert_allclose(far / near, 2, atol=0.02)


def test_friction_of_the_model_is_taken_where_none_is_given() -> None:
    own = Model(replace(UNIT, friction=STATED), errors_of(UNIT))
    bare = Model(UNIT, errors_of(UNIT))
    given = efficiency(bare, THETA, torque=100e3, friction=STATED, direction=1.0)
    taken = efficiency(own, THETA, torque=100e3, direction=1.0)
    other = efficiency(own, THETA, torque=100e3, direction=1.0, friction=Friction(pin=0.1))
    np.testing.assert_array_equal(taken.input_torque, given.input_torque)
    assert set(other.by_part.values()) == {0.0, other.by_part["pin"]}
    loops = [hysteresis(own, [0.1], torques=[50e3]), hysteresis(bare, [0.1], torques=[50e3], friction=STATED)]
    np.testing.assert_array_equal(loops[0].width, loops[1].width)
    for silent in (
        lambda: efficiency(bare, THETA, torque=100e3, direction=1.0),
        lambda: hysteresis(bare, [0.1], torques=[50e3]),
    ):
        with pytest.raises(ValueError, match=r"friction: no coefficients are stated; .*\[reducer\.friction\]"):
            silent()


def test_all_else_is_without_friction() -> None:
    own, bare = (Model(unit, errors_of(UNIT)) for unit in (replace(UNIT, friction=STATED), UNIT))
    here, there = (rverror.equilibrium(one, THETA, torque=20e3, direction=1.0) for one in (own, bare))
    np.testing.assert_array_equal(here.transmission_error, there.transmission_error)


# --- directions -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("drives", ["input", "output"])
def test_a_unit_run_backwards_is_its_mirror_image(drives: str) -> None:
    """Seen from behind, a unit without errors does in reverse at -theta what it does forward at theta."""
    for output in ("carrier", "housing"):
        unit = replace(UNIT, output=output, cranks=2)
        here = of(unit, direction=1.0, drives=drives)
        there = of(unit, -THETA, direction=-1.0, drives=drives)
        np.testing.assert_allclose(there.input_torque, here.input_torque, rtol=1e-9)
        np.testing.assert_allclose(there.error_change, -here.error_change, rtol=1e-6)


def test_errors_make_the_two_directions_differ() -> None:
    model = Model(UNIT, errors_of(UNIT))
    here, there = (
        efficiency(model, THETA, torque=20e3, friction=STATED, direction=direction) for direction in (1.0, -1.0)
    )
    assert abs(here.mean - there.mean) > 1e-5
    assert (here.error_change < 0).all()  # the output lags more in either direction
    assert (there.error_change > 0).all()


def test_with_the_input_driving_more_passes_than_one_less_the_loss_back() -> None:
    """To first order 1/(1 + x) against 1 - x."""
    forward, back = (of(friction=scaled(STATED, 0.02), drives=drives) for drives in ("input", "output"))
    np.testing.assert_allclose(1 / forward.efficiency - 1, 1 - back.efficiency, rtol=0.02)
    assert forward.mean > back.mean


# --- a train of its own -----------------------------------------------------------------------------------------------


@functools.cache
def mean_slip_by_quadrature(unit: Reducer) -> float:
    """Distance from the pitch point under the force, drawn tooth by tooth on the line of action."""
    alpha, m = unit.pressure_angle, unit.module
    pitch = math.pi * m * math.cos(alpha)
    ends = []
    for r, mate in (
        (unit.sun_pitch_radius, unit.planet_pitch_radius),
        (unit.planet_pitch_radius, unit.sun_pitch_radius),
    ):
        ends.append(
            min(math.sqrt((r + m) ** 2 - (r * math.cos(alpha)) ** 2) - r * math.sin(alpha), mate * math.sin(alpha))
        )
    total = 0.0
    steps = 5000
    for phase in (np.arange(steps) + 0.5) / steps:
        places = [s for s in (np.arange(-3, 4) + phase) * pitch if -ends[1] < s < ends[0]]
        total += float(np.mean(np.abs(places)))
    return total / steps


def test_mean_slip_of_the_teeth_by_quadrature() -> None:
    """Pair after pair along the line of action, the force shared equally by those that touch."""
    for unit in (UNIT, rverror.reducer("RV-003")):
        assert mean_mesh_slip(unit) == pytest.approx(mean_slip_by_quadrature(unit), rel=1e-3)


class OwnTrain:
    """Parts of an RV reducer as drawn at one angle, with springs between them and forces that rub.

    Velocities come from drawing the parts a little later; every force, of spring or friction, acts at its point on both
    bodies.  Forces of friction are loads of the last solution, over and over.
    """

    def __init__(self, unit: Reducer, theta: float) -> None:
        self.unit = unit
        self.bodies: dict[str, int] = {}
        for name in ("carrier", *(f"disc{k}" for k in range(unit.discs)), *(f"crank{j}" for j in range(unit.cranks))):
            self.bodies[name] = 3 * len(self.bodies)
        self.sun = 3 * len(self.bodies)
        self.size = self.sun + 3  # the sun's angle, too: held, and its torque is what is asked for
        self.now = self.drawn(theta)
        step = 1e-5
        later, before = self.drawn(theta + step), self.drawn(theta - step)
        self.velocity = {name: (later[name] - before[name]) / (2 * step) for name in self.now}

    def drawn(self, theta: float) -> dict[str, np.ndarray]:
        """Place and angle of each body: discs roll inside the pins, planets on the sun."""
        unit = self.unit
        crank = -theta * unit.disc_lobes
        places = {"carrier": np.array([0, 0, theta])}
        for k in range(unit.discs):
            lead = crank + 2 * math.pi * k / unit.discs
            places[f"disc{k}"] = np.array(
                [unit.eccentricity * math.cos(lead), unit.eccentricity * math.sin(lead), theta]
            )
        for j in range(unit.cranks):
            at = theta + 2 * math.pi * j / unit.cranks
            places[f"crank{j}"] = np.array([unit.crank_radius * math.cos(at), unit.crank_radius * math.sin(at), crank])
        # pitch circles roll: r1 (sun - carrier) = -r2 (crank - carrier)
        turn = theta - unit.planet_teeth / unit.sun_teeth * (crank - theta)
        places["sun"] = np.array([0, 0, turn])
        return places

    def row(self, body: str, point: np.ndarray, way: np.ndarray) -> np.ndarray:
        """Motion along a way of a point of a body."""
        made = np.zeros(self.size)
        if body != "housing":
            first = self.sun if body == "sun" else self.bodies[body]
            arm = point - self.now[body][:2]
            made[first : first + 3] = way[0], way[1], arm[0] * way[1] - arm[1] * way[0]
        return made

    def turn(self, body: str) -> np.ndarray:
        made = np.zeros(self.size)
        made[(self.sun if body == "sun" else self.bodies[body]) + 2] = 1
        return made

    def speed(self, row: np.ndarray) -> float:
        """Of a row along the drawn motion."""
        return sum(
            float(row[first : first + 3] @ self.velocity[name])
            for name, first in (*self.bodies.items(), ("sun", self.sun))
        )

    def solved(self, torque: float, motion: float, load: float, friction: Friction) -> tuple[float, float, float]:
        """Turn of the carrier, torque on the sun, and power lost, under a signed torque on the carrier."""
        unit, stiff = self.unit, self.unit.stiffness
        springs: list[tuple[list[np.ndarray], float, list[tuple[np.ndarray, float]]]] = []
        ways = np.eye(2)
        for k in range(unit.discs):
            centre, angle = self.now[f"disc{k}"][:2], self.now[f"disc{k}"][2]
            for j in range(unit.cranks):
                at = angle + 2 * math.pi * j / unit.cranks
                place = centre + unit.crank_radius * np.array([math.cos(at), math.sin(at)])
                rows = [self.row(f"disc{k}", place, w) - self.row(f"crank{j}", place, w) for w in ways]
                couple = self.turn(f"crank{j}") - self.turn(f"disc{k}")
                rubs = friction.crank_bearing * float(friction.crank_bearing_radius or 0)
                springs.append((rows, stiff.crank_bearing, [(couple, rubs)]))
        for j in range(unit.cranks):
            place = self.now[f"crank{j}"][:2]
            rows = [self.row(f"crank{j}", place, w) - self.row("carrier", place, w) for w in ways]
            couple = self.turn(f"crank{j}") - self.turn("carrier")
            rubs = friction.carrier_bearing * float(friction.carrier_bearing_radius or 0)
            springs.append((rows, stiff.carrier_bearing, [(couple, rubs)]))
        zero = np.zeros(2)
        springs.append(([self.row("carrier", zero, w) for w in ways], stiff.main_bearing, []))
        springs.append(([self.row("sun", zero, w) for w in ways], stiff.sun_support, []))
        for k in range(unit.discs):
            centre = self.now[f"disc{k}"][:2]
            for i in range(unit.pins):
                at = 2 * math.pi * i / unit.pins
                pin = unit.pin_circle_radius * np.array([math.cos(at), math.sin(at)])
                normal = unit.pins * centre - pin  # to the pitch point, a z_p from the axis
                normal /= math.hypot(*normal)
                touch = pin + unit.pin_radius * normal
                along = self.row(f"disc{k}", touch, np.array([normal[1], -normal[0]]))
                springs.append(([-self.row(f"disc{k}", touch, normal)], stiff.pin_contact, [(along, friction.pin)]))
        for j in range(unit.cranks):
            outward = self.now[f"crank{j}"][:2] / unit.crank_radius
            tangent = np.array([-outward[1], outward[0]])
            point = unit.sun_pitch_radius * outward
            couple = self.turn(f"crank{j}") - self.turn("sun")
            for sense in (1.0, -1.0):
                way = math.cos(unit.pressure_angle) * sense * tangent + math.sin(unit.pressure_angle) * outward
                row = self.row("sun", point, way) - self.row(f"crank{j}", point, way)
                springs.append(([row], stiff.gear_mesh, [(couple, friction.mesh * mean_slip_by_quadrature(unit))]))
        play = dict.fromkeys(range(len(springs) - 2 * unit.cranks, len(springs)), -unit.gear_backlash / 2)
        free = np.arange(self.size - 1)  # not the sun's angle
        outer = np.zeros(self.size)
        outer[2] = load * torque
        rub, closed = np.zeros(self.size), np.ones(len(springs), dtype=bool)
        for n, (rows, _, _) in enumerate(springs):
            if len(rows) == 1:  # the side that the load presses
                closed[n] = self.pressed_by(rows[0], load)
        for _ in range(400):
            stiffness, offset = np.zeros((self.size, self.size)), np.zeros(self.size)
            for n, (rows, k, _) in enumerate(springs):
                if closed[n]:
                    for row in rows:
                        stiffness += k * np.outer(row, row)
                        offset += k * play.get(n, 0.0) * row
            x = np.zeros(self.size)
            x[free] = np.linalg.solve(stiffness[np.ix_(free, free)], (outer + rub - offset)[free])
            carried, lost, new = np.zeros(self.size), 0.0, np.zeros(self.size)
            held = closed.copy()
            for n, (rows, k, slides) in enumerate(springs):
                force = np.array([k * (float(row @ x) + play.get(n, 0.0)) for row in rows])
                if len(rows) == 1:
                    held[n] = force[0] > 0
                if not held[n]:
                    continue
                for row, f in zip(rows, force, strict=True):
                    carried -= f * row
                size = math.hypot(*force) if len(force) > 1 else float(force[0])
                for row, f in slides:
                    speed = motion * self.speed(row)
                    new -= math.copysign(f * size, speed) * row
                    lost += f * size * abs(speed)
            settled = np.abs(new - rub).max() < 1e-9 * torque and (held == closed).all()
            rub, closed = new, held
            if settled:
                return float(x[2]), -float((carried + rub)[-1]), lost
        raise AssertionError("no solution")

    def pressed_by(self, row: np.ndarray, load: float) -> bool:
        """Whether a contact closes as the carrier goes with the load and the sun stays, all else rolling along."""
        planets = np.array([row[self.bodies[f"crank{j}"] + 2] for j in range(self.unit.cranks)])
        if np.abs(planets).max() > 0:  # a flank: the crank turns against the carrier
            return float(planets.sum()) * -load > 0
        arm = sum(row[self.bodies[f"disc{k}"] + 2] for k in range(self.unit.discs))
        return float(arm) * load > 0


@pytest.mark.parametrize("drives", ["input", "output"])
@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_equilibrium_against_a_train_of_its_own(drives: str, direction: float) -> None:
    """Turn of the output, torque at the input and loss, in both directions of motion and of power."""
    rubs = scaled(STATED, 2.0)
    for theta in (0.02, 0.9):
        found = of(theta=np.array([theta]), direction=direction, drives=drives, friction=rubs)
        load = -direction if drives == "input" else direction
        carried = 412e3 - load * direction * rubs.drag
        turned, at_sun, lost = OwnTrain(UNIT, theta).solved(carried, direction, load, rubs)
        sign = direction if drives == "input" else -direction
        assert found.input_torque[0] == pytest.approx(sign * at_sun, rel=1e-5)
        slip = sum(found.losses[part][0] for part in PARTS[:-1])
        assert slip == pytest.approx(lost, rel=1e-5)
        smooth, _, _ = OwnTrain(UNIT, theta).solved(carried, direction, load, Friction())
        assert found.error_change[0] == pytest.approx(turned - smooth, rel=1e-4)


# --- figures of textbooks and makers ----------------------------------------------------------------------------------


def test_rated_efficiency_lies_where_makers_print_it() -> None:
    """85 to 95 % at the rated load, under the assumptions stated above; the mixed share of each part."""
    found = of()
    assert 0.85 < found.mean < 0.95
    assert found.mean == pytest.approx(1 - sum(found.by_part.values()), abs=1e-9)
    assert found.by_part["pin"] == max(found.by_part.values())


def test_efficiency_falls_with_less_load() -> None:
    """Drag weighs more, as on every maker's chart: 4 N*m against 20."""
    means = [of(torque=torque).mean for torque in ("412 N*m", "103 N*m", "20 N*m")]
    assert means == sorted(means, reverse=True)
    assert means[-1] < 1 / (1 + 4 / 20)


def test_gears_by_the_handbooks_loss_factor() -> None:
    """f H_v of the power that rolls, H_v = pi (1/z1 + 1/z2) (1 - e + e1^2 + e2^2)."""
    found = of(friction=Friction(mesh=1e-4), torque=100e3)
    z1, z2 = UNIT.sun_teeth, UNIT.planet_teeth
    pitch = math.pi * UNIT.module * math.cos(UNIT.pressure_angle)
    factor = mean_mesh_slip(UNIT) * 2 / pitch  # 1 - e + e1^2 + e2^2, by quadrature above
    loss = 1e-4 * math.pi * (1 / z1 + 1 / z2) * factor
    rolling = (121 - 1) / 121  # of the power that the sun brings; the rest goes round with the carrier
    np.testing.assert_allclose(found.losses["mesh"] / 100e3, loss * rolling, rtol=1e-3)


def test_pins_by_one_disc_on_its_pitch_point() -> None:
    """Closed form by hand: sum of f F_i D_i over the loaded half, F_i as the arms."""
    found = of(friction=Friction(pin=0.01), torque=100e3, method="closed")
    phi = (np.arange(200000) + 0.5) * math.pi / 200000
    K = UNIT.short_width_coefficient
    root = np.sqrt(1 + K**2 - 2 * K * np.cos(phi))
    arm = UNIT.eccentricity * UNIT.disc_lobes * np.sin(phi) / root
    slip = UNIT.pin_circle_radius * root - UNIT.pin_radius
    by_hand = 0.01 * 117 / 121 * (arm * slip).sum() / (arm**2).sum() * 100e3
    np.testing.assert_allclose(found.losses["pin"].mean(), by_hand, rtol=2e-3)


def test_the_pages_figures() -> None:
    """Each number of the table and of the text beside it."""
    page = text(DOCS / "theory" / "friction.md")
    theta = 2 * np.pi * np.arange(101) / 101
    rows = re.findall(r"^\| (\d+) N m \| (.*) \|$", page, flags=re.MULTILINE)
    assert [int(torque) for torque, _ in rows] == [412, 103, 20]
    for torque, cells in rows:
        load = float(torque) * 1e3
        ahead, closed = (of(theta=theta, torque=load, method=method) for method in ("equilibrium", "closed"))
        back = of(theta=theta, torque=load, drives="output")
        *shares, at_input = map(float, cells.split(" | "))
        made = [ahead.mean, closed.mean, back.mean, *(ahead.by_part[part] for part in PARTS)]
        np.testing.assert_allclose(shares, 100 * np.array(made), atol=0.051)
        assert at_input == pytest.approx(ahead.input_torque.mean() / 1e3, abs=5.1e-4)
    change = of(theta=theta).error_change.mean() / rverror.ARCSEC
    windup = rverror.equilibrium(Model(UNIT), theta, torque="412 N*m", direction=1.0).transmission_error.mean()
    assert f"lags by {-change:.1f} arcsec" in page
    assert f"{100 * change * rverror.ARCSEC / windup:.1f} % of the windup" in page
    idle = of(theta=theta, torque=0).input_torque.mean() / 1e3
    assert f"{idle:.3f} N m at the input, {121 * idle:.1f} N m seen" in page
    twice = replace(scaled(STATED, 2.0), drag=6e3)
    assert f"{of(theta=theta, torque=0, friction=twice).input_torque.mean() / 1e3:.3f} N m for twice" in page
    assert f"teeth it is {100 * of(theta=theta, friction=replace(STATED, pin=0.01, mesh=0.01)).mean:.1f} %" in page
    width = hysteresis(Model(UNIT), theta[:16], torques=[0, 12.36e3, 412e3], friction=STATED).width.mean(axis=1)
    none, few, rated = width / rverror.ARCSEC
    assert f"{rated:.1f} arcsec at the rated torque, {few:.1f} at 3 %" in page
    assert f"{none:.1f} at\nnone" in page
    of(friction=Friction(pin=0.7))  # wedges above


#: What the second table of the page changes, by the name of its row.
CHANGED = {
    "nothing": STATED,
    "pins 0.02": replace(STATED, pin=0.02),
    "pins 0.1": replace(STATED, pin=0.1),
    "teeth 0.02": replace(STATED, mesh=0.02),
    "teeth 0.1": replace(STATED, mesh=0.1),
    "bearings halved": replace(STATED, crank_bearing=0.00125, carrier_bearing=0.0009),
    "bearings doubled": replace(STATED, crank_bearing=0.005, carrier_bearing=0.0036),
    "drag 2 N m": replace(STATED, drag=2e3),
    "drag 8 N m": replace(STATED, drag=8e3),
    "all less 15 %": scaled(STATED, 0.85),
}


def test_the_pages_table_over_load_and_speed() -> None:
    page = text(DOCS / "theory" / "friction.md")
    speeds = [float(speed) for speed in re.findall(r" (\d+) rpm (?=\|)", page)]
    rows = re.findall(r"^\| (?:all|a half,|a quarter,|a tenth,|light,) ([\d.]+) N m \| (.*) \|$", page, re.MULTILINE)
    assert [float(torque) for torque, _ in rows] == [412, 206, 103, 41.2, 20]
    for torque, cells in rows:
        drags = [4e3 * (speed / 15) ** (2 / 3) for speed in speeds]
        made = [of(torque=float(torque) * 1e3, friction=replace(STATED, drag=drag)).mean for drag in drags]
        np.testing.assert_allclose([float(cell) for cell in cells.split(" | ")], 100 * np.array(made), atol=0.051)
    assert f"{drags[0] / 1e3:.1f} N m at 1 rpm, {drags[-1] / 1e3:.1f} N m at 50 rpm" in page


def test_the_pages_table_of_assumptions() -> None:
    """And each row once more from the shares of the first alone.

    Friction adds at most its own share to what contacts carry (`test_friction_oracle.py`), so a loss changes in
    proportion to the coefficient but for that share of the change.
    """
    page = text(DOCS / "theory" / "friction.md")
    loads = (412e3, 103e3, 20e3)
    stated = [of(torque=torque) for torque in loads]
    made = {name: [of(torque=torque, friction=friction).mean for torque in loads] for name, friction in CHANGED.items()}
    for name, friction in CHANGED.items():
        (cells,) = re.findall(rf"^\| {re.escape(name)} \| (.*) \|$", page, re.MULTILINE)
        np.testing.assert_allclose([float(cell) for cell in cells.split(" | ")], 100 * np.array(made[name]), atol=0.051)
        for first, mean in zip(stated, made[name], strict=True):
            lost = {part: share / first.mean for part, share in first.by_part.items()}
            change = sum(x * (getattr(friction, part) / getattr(STATED, part) - 1) for part, x in lost.items())
            left = 1 / mean - (1 + sum(lost.values()) + change)
            assert abs(left) <= (sum(lost.values()) + max(change, 0)) * abs(change) + 1e-12
    won = 100 * (made["all less 15 %"][0] - made["nothing"][0])
    assert f"{won:.1f} points of efficiency" in page


# --- no load, at rest, self-locking -----------------------------------------------------------------------------------


def test_running_and_starting_torque() -> None:
    """Drag alone where nothing is jammed, at 1/121 on the input, and what it loads the train with rubs too."""
    drag = Friction(drag="4 N*m")
    np.testing.assert_allclose(of(torque=0, friction=drag).input_torque, 4e3 / 121, rtol=1e-9)
    running = of(torque=0).input_torque
    assert (running > 4e3 / 121).all()
    np.testing.assert_array_equal(of(torque=0).efficiency, 0)
    at_rest = of(torque=0, friction=scaled(STATED, 1.5)).input_torque
    assert (at_rest > 1.5 * running).all()


def test_jammed_pins_rub_without_a_load() -> None:
    """Pins too thick by 10 um press on both sides: the torque at the input is their slip alone."""
    jammed = Model(UNIT, (effect("cycloid.pin_radius", pin="all", deviation="10 um"),))
    found = efficiency(jammed, THETA, torque=0, friction=Friction(pin=0.05), direction=1.0)
    np.testing.assert_allclose(found.input_torque * 121, found.losses["pin"], rtol=1e-6)
    assert found.input_torque.mean() == pytest.approx(2.3e3, rel=0.01)  # the page's
    assert (found.input_torque > 100 * of(torque=0, friction=Friction(pin=0.05)).input_torque).all()


def test_preloaded_bearings_rub_without_a_load() -> None:
    """Two rows of rollers face each other, each pressed by k e: 2 k e f r in 40 turns, however small the load."""
    more = {"crank_bearing": "3 um", "carrier_bearing": "2 um"}
    unit = replace(UNIT, bearing_preload=BearingPreload(**more))
    friction = replace(STATED, pin=0.0, mesh=0.0, drag=0.0)
    idle = of(unit, torque=0, friction=friction)
    cams, bores = 4 * 2 * 3e5 * 3e-3 * 0.0025, 2 * 2 * 3e5 * 2e-3 * 0.0018
    np.testing.assert_allclose(idle.input_torque, 40 * 10 * (cams + bores) / 121, rtol=1e-3)
    for torque in (5e3, 100e3, 412e3):
        for drives in ("input", "output"):
            assert out_of_energy(of(unit, torque=torque, drives=drives)) < 1e-8


def test_self_locking_is_said() -> None:
    """With 0.1 at 10 mm in 40 turns of the cranks, more than all of the power would be lost on its way back."""
    rough = Friction(crank_bearing=0.1, crank_bearing_radius=10.0)
    for method in ("equilibrium", "closed"):
        back = of(friction=rough, drives="output", method=method)
        assert back.self_locking
        assert (back.efficiency <= 0).all()
        forward = of(friction=rough, method=method)
        assert not forward.self_locking
        assert 0 < forward.mean < 0.5  # as a screw that locks
    assert not of(drives="output").self_locking


def test_what_locks_without_a_balance_is_called_self_locking() -> None:
    """0.1 at 20 mm takes some four times the power that 20 N m put in, at any load."""
    unit = rverror.reducer("RV-003")
    rough = Friction(crank_bearing=0.1, crank_bearing_radius=20.0, carrier_bearing=0.1, carrier_bearing_radius=20.0)
    rough = replace(rough, pin=0.1, mesh=0.1, drag=4e3)
    with pytest.raises(
        NotConvergedError, match=r"self-locking: friction takes \d+ % or more of what the output puts in"
    ):
        of(unit, torque=20e3, friction=rough, drives="output")
    back = of(unit, torque=20e3, friction=rough, drives="output", method="closed")
    assert back.self_locking
    assert back.mean < -1
    with pytest.raises(NotConvergedError, match="wedge"):  # the input drives: nothing locks
        of(friction=Friction(pin=0.8))


def test_what_has_no_balance_or_no_sense_is_refused() -> None:
    with pytest.raises(NotConvergedError, match=r"forces and friction do not balance at 16 of 16 angles .*wedge"):
        of(friction=Friction(pin=0.8))
    with pytest.raises(ValueError, match=r"torque = 3 N\*m: the output drives with more than the drag, 4 N\*m"):
        of(torque="3 N*m", drives="output")
    with pytest.raises(ValueError, match=r"crank_bearing_radius is missing: crank_bearing = 0\.002 counts at it"):
        Friction(crank_bearing=0.002)
    with pytest.raises(ValueError, match=r"pin = -0\.1: must be 0 or more"):
        Friction(pin=-0.1)
    with pytest.raises(ValueError, match=r"drag = -1 N\*m: must be 0 or more"):
        Friction(drag="-1 N*m")
    with pytest.raises(ValueError, match="carrier_bearing_radius = 0 mm: must be above 0"):
        Friction(carrier_bearing_radius=0.0)
    with pytest.raises(ValueError, match="drives = 'motor'"):
        of(drives="motor")
    with pytest.raises(ValueError, match="method = 'exact'"):
        of(method="exact")
    with pytest.raises(ValueError, match=r"torque = -1 N\*m: must be 0 or more"):
        of(torque="-1 N*m")
    with pytest.raises(ValueError, match=r"friction needs a \[reducer\] model"):
        efficiency(Model(rverror.Drive(ratio=50.0)), THETA, torque=1e3, friction=STATED)


def test_light_load_on_bearings_with_clearance() -> None:
    """Journals on the rims of their clearance: the hardest balance that the equilibrium knows."""
    keys = ("crank.bearing_clearance", "coupling.bearing_clearance")
    model = Model(UNIT, tuple(effect(key, clearance="5 um") for key in keys))
    for drives in ("input", "output"):
        theta = np.linspace(0, 2 * np.pi, 40)
        friction = replace(STATED, drag=0.0)
        found = efficiency(model, theta, torque=2e3, friction=friction, direction=1.0, drives=drives)
        assert out_of_energy(found) < 1e-8


# --- the loop of the torsion curve ------------------------------------------------------------------------------------

TORQUES = np.array([-412e3, -100e3, -12e3, 0.0, 12e3, 100e3, 412e3])


def test_loop_without_friction_is_the_torsion_curve() -> None:
    loop = hysteresis(Model(UNIT, errors_of(UNIT)), THETA[:3], torques=TORQUES, friction=Friction())
    curve = rverror.statics.torsion_curve(Model(UNIT, errors_of(UNIT)), THETA[:3], torques=TORQUES)
    loaded = TORQUES != 0
    np.testing.assert_allclose(loop.rising[loaded], curve.angle[loaded], rtol=1e-9)
    np.testing.assert_allclose(loop.width[loaded], 0, atol=1e-12)
    play = rverror.statics.backlash(Model(UNIT, errors_of(UNIT)), THETA[:3])
    np.testing.assert_allclose(loop.width[~loaded][0], play, rtol=1e-6)


def test_drag_alone_makes_a_loop_of_its_windup_both_ways() -> None:
    drag = Friction(drag="4 N*m")
    loop = hysteresis(Model(UNIT), THETA[:2], torques=TORQUES, friction=drag)
    stiffness = rverror.statics.torsional_stiffness(Model(UNIT), THETA[:2])
    np.testing.assert_allclose(loop.width[0], 2 * 4e3 / stiffness, rtol=1e-3)
    np.testing.assert_allclose(loop.width[6], 2 * 4e3 / stiffness, rtol=1e-3)


def test_width_is_the_work_of_slip() -> None:
    """Work at the output goes into slip: per torque, to first order, the sum of f F times how far each contact slides.

    Slip is read off two poses of the equilibrium under slightly different torques, as the parts stand.
    """
    little, theta = Friction(pin=1e-4, crank_bearing=1e-4, crank_bearing_radius=10.0), np.array([0.02])
    for torque in (100e3, 412e3):
        loop = hysteresis(Model(UNIT), theta, torques=[torque], friction=little)
        low, state, high = (
            rverror.equilibrium(Model(UNIT), theta, torque=torque * more, direction=-1.0) for more in (0.999, 1, 1.001)
        )
        train, work = OwnTrain(UNIT, 0.02), 0.0
        disc, crank = (high.pose[part][..., 0] - low.pose[part][..., 0] for part in ("disc", "crank"))
        for k in range(2):
            centre = train.now[f"disc{k}"][:2]
            for i in range(40):
                force = state.contact_forces["pin"][k, i, :, 0]
                size = math.hypot(*force)
                if size == 0:
                    continue
                at = 2 * math.pi * i / 40
                pin = 64 * np.array([math.cos(at), math.sin(at)])
                touch, across = pin + 3 * force / size - centre, np.array([-force[1], force[0]]) / size
                moved = disc[k, :2] + disc[k, 2] * np.array([-touch[1], touch[0]])
                work += 1e-4 * size * abs(float(moved @ across))
            for j in range(2):
                size = math.hypot(*state.contact_forces["cam"][k, j, :, 0])
                work += 1e-3 * size * abs(float(crank[j, 2] - disc[k, 2]))
        np.testing.assert_allclose(loop.width[0, 0], 2 * work / (0.002 * torque), rtol=1e-3)
