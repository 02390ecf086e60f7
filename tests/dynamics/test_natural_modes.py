"""Natural modes: against the equilibrium, closed forms, finite differences, and what must hold of any train."""

from __future__ import annotations

import dataclasses
import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings, strategies as st

import rverror
from rverror import Model, Reducer
from rverror.app.command_line import main
from rverror.dynamics import Modes, modes
from rverror.geartrain import Inertia, Stiffness
from rverror.model import Bench
from strategies import angles, reducers, scaled, variant

UNIT = rverror.reducer("RV-40E")
ENDS = Bench(
    input_inertia="1e-4 kg*m^2",
    position_control_stiffness="20 N*m/rad",
    input_coupling_stiffness="300 N*m/rad",
    load_inertia="1 kg*m^2",
    load_coupling_stiffness="1e5 N*m/rad",
)
KILOGRAM = 1e-3  # tonne
#: Where no pin stands exactly between drive and coast side.
UNREMARKABLE = angles(1).map(lambda row: float(row[0]))


def times(values: object, factor: float) -> dict[str, float]:
    """Every number of a dataclass but for ratios, times a factor; those not given are left out."""
    every = dataclasses.asdict(values)  # type: ignore[call-overload]
    return {name: value * factor for name, value in every.items() if value is not None and "damping" not in name}


# --- against the equilibrium ------------------------------------------------------------------------------------------


#: Contacts that open.
CLOSE = ("pin", "mesh")


def windup_by_modes(found: Modes) -> float:
    """Turn of the carrier per torque on it, all modes yielding: the sum of phi^2 / (omega^2 m)."""
    return float((found.shape["carrier"][2] ** 2 / ((2 * math.pi * found.frequency) ** 2 * KILOGRAM)).sum())


@settings(max_examples=15, deadline=None)
@given(unit=reducers(), theta=UNREMARKABLE, direction=st.sampled_from([1.0, -1.0]))
def test_modes_wind_up_as_the_equilibrium_does(unit: Reducer, theta: float, direction: float) -> None:
    """With linear contacts the equilibrium is linear in its load while the same ones carry."""
    model, step = Model(unit), 100.0
    low, high = (
        rverror.equilibrium(model, [theta], torque=1e5 + change, direction=direction) for change in (-step, step)
    )
    assume(all((low.contact_forces[one].any(axis=-2) == high.contact_forces[one].any(axis=-2)).all() for one in CLOSE))
    found = modes(model, torque=1e5, theta=theta, direction=direction)
    rise = float(high.transmission_error[0] - low.transmission_error[0])
    assert windup_by_modes(found) == pytest.approx(-direction * rise / (2 * step), rel=1e-5)


def test_modes_wind_up_as_the_equilibrium_does_where_contacts_open_and_follow_a_law() -> None:
    """The tangent at a load of 20 N*m, with pins lifted off by their errors and journals in their clearance."""
    effects = (
        rverror.effect("cycloid.disc_pitch", disc=0, harmonic=1, cos="5 um"),
        rverror.effect("cycloid.pin_position", pin=3, radial="-6 um"),
        rverror.effect("crank.bearing_clearance", clearance="3 um"),
    )
    law = rverror.geartrain.ContactLaw(pin_exponent=10 / 9, flank_exponent=10 / 9)
    model = Model(rverror.reducer("RV-40E", contact_law=law), effects)
    torque, step = 20e3, 1.0
    for theta in (0.1, 1.3):
        low, high = (
            rverror.equilibrium(model, [theta], torque=torque + change, direction=1.0).transmission_error[0]
            for change in (-step, step)
        )
        found = modes(model, torque=torque, theta=theta)
        assert windup_by_modes(found) == pytest.approx(-(high - low) / (2 * step), rel=1e-4)


# --- closed forms -----------------------------------------------------------------------------------------------------

STIFF = Stiffness(**dict.fromkeys(Stiffness.__dataclass_fields__, 1e10))


@pytest.mark.parametrize("theta", [0.0, 0.7])
@pytest.mark.parametrize("name", ["RV-40E", "RV-003"])
def test_stiff_contacts_leave_two_inertias_on_the_input_coupling(name: str, theta: float) -> None:
    """omega^2 = k (1/J_motor + 1/J_train), the train's kinetic energy from its rolling motion per turn of the sun."""
    unit = rverror.reducer(name, stiffness=STIFF)
    bench = Bench(
        input_inertia="3e-4 kg*m^2",
        position_control_stiffness=0,
        input_coupling_stiffness="200 N*m/rad",
        load_inertia="0.5 kg*m^2",
    )
    found = modes(Model(unit, bench=bench), torque="100 N*m", theta=theta)
    own, R = found.inertia, unit.ratio
    crank, disc = unit.disc_lobes / R, unit.eccentricity * unit.disc_lobes / R  # rad and mm per rad of the sun
    train = own.sun_inertia + (own.carrier_inertia + bench.load_inertia) / R**2
    train += unit.cranks * (own.crank_inertia * crank**2 + own.crank_mass * (unit.crank_radius / R) ** 2)
    train += unit.discs * (own.disc_inertia / R**2 + own.disc_mass * disc**2)
    omega = math.sqrt(bench.input_coupling_stiffness * (1 / bench.input_inertia + 1 / train))
    assert found.frequency[0] == 0
    # contacts yield in series with the coupling, whose share of the energy is what is left of its stiffness
    left = found.strain_energy["input_coupling_stiffness"][1]
    assert left > 0.999
    assert found.frequency[1] == pytest.approx(math.sqrt(left) * omega / (2 * math.pi), rel=1e-6)
    # the free turn: each part by its own ratio
    sun = found.shape["sun"][2, 0]
    assert found.shape["carrier"][2, 0] == pytest.approx(sun / R, rel=1e-6)
    assert found.shape["crank 1"][2, 0] == pytest.approx(-sun * crank, rel=1e-6)
    assert np.hypot(*found.shape["disc 0"][:2, 0]) == pytest.approx(abs(sun) * disc, rel=1e-5)


def test_a_heavy_load_on_a_soft_coupling_swings_alone() -> None:
    """Carrier and train stand still: omega^2 = k / J."""
    bench = Bench(load_inertia="1000 kg*m^2", load_coupling_stiffness="1000 N*m/rad")
    found = modes(Model(UNIT, bench=bench))
    # the train's own windup of 1e-9 rad/(N*mm) yields beside the coupling's 1e-6
    soft = 1e-6 + windup_by_modes(modes(Model(UNIT)))
    assert found.frequency[0] == pytest.approx(math.sqrt(1 / soft / 1e6) / (2 * math.pi), rel=1e-5)
    assert found.shape["load"][0, 0] == pytest.approx(1 / math.sqrt(1000 * 1e6), rel=1e-3)  # rad per mm at 1 kg


def test_the_sun_of_two_planets_swings_on_its_support_and_is_marked() -> None:
    """Both lines of action are parallel: across them nothing but the support holds the sun."""
    found = modes(Model(UNIT))
    at = int(np.flatnonzero(found.of_sun_support)[0])
    assert found.of_sun_support.sum() == 1
    assert found.frequency[at] == pytest.approx(
        math.sqrt(UNIT.stiffness.sun_support / found.inertia.sun_mass) / (2 * math.pi), rel=1e-9
    )


def test_meshes_of_three_planets_hold_the_sun() -> None:
    assert not modes(Model(rverror.reducer("RV-40E", cranks=3))).of_sun_support.any()


# --- what must hold of any train --------------------------------------------------------------------------------------


@settings(max_examples=15, deadline=None)
@given(unit=reducers(), theta=UNREMARKABLE, factor=st.floats(0.01, 100))
def test_frequencies_grow_with_the_root_of_stiffness_and_fall_with_that_of_inertia(
    unit: Reducer, theta: float, factor: float
) -> None:
    before = modes(Model(unit, bench=ENDS), torque=1e5, theta=theta)
    stiff = variant(unit, stiffness=Stiffness(**times(unit.stiffness, factor)))
    springs = {n: v for n, v in times(ENDS, factor).items() if n.endswith("stiffness")}
    after = modes(Model(stiff, bench=replace(ENDS, **springs)), torque=1e5 * factor, theta=theta)
    np.testing.assert_allclose(after.frequency, before.frequency * math.sqrt(factor), rtol=1e-6)
    heavy = variant(unit, inertia=Inertia(**times(before.inertia, factor)))
    masses = {n: v for n, v in times(ENDS, factor).items() if n.endswith("inertia")}
    after = modes(Model(heavy, bench=replace(ENDS, **masses)), torque=1e5, theta=theta)
    np.testing.assert_allclose(after.frequency, before.frequency / math.sqrt(factor), rtol=1e-6)


@settings(max_examples=15, deadline=None)
@given(unit=reducers(), theta=UNREMARKABLE)
@pytest.mark.parametrize(
    ("bench", "free"),
    [
        (Bench(), 0),
        (Bench(input_coupling_stiffness="300 N*m/rad"), 0),
        (Bench(position_control_stiffness="20 N*m/rad"), 0),
        (ENDS, 0),
        (Bench(position_control_stiffness=0), 1),
        (replace(ENDS, position_control_stiffness=0), 1),
    ],
    ids=["held", "coupled", "controlled", "both ends", "free", "both ends, free"],
)
def test_one_motion_is_free_where_nothing_holds_the_input(bench: Bench, free: int, unit: Reducer, theta: float) -> None:
    found = modes(Model(unit, bench=bench), torque=1e5, theta=theta)
    assert (found.frequency == 0).sum() == free
    assert found.frequency[free] > 0.1  # Hz; the softest of these springs moves the heaviest load faster
    assert (found.damping_ratio == np.where(found.frequency == 0, 0, 0.03)).all()


@pytest.mark.parametrize("bench", [Bench(), ENDS])
def test_shapes_have_a_modal_mass_of_one_kilogram_and_do_not_move_one_another(bench: Bench) -> None:
    found = modes(Model(rverror.reducer("RV-003"), bench=bench), torque="200 N*m", theta=0.4)
    own, products = found.inertia, np.zeros((found.frequency.size,) * 2)
    heavy = {"carrier": "carrier", "disc": "disc", "crank": "crank", "sun": "sun"}
    for part, rows in found.shape.items():
        if part in ("input", "load"):
            products += getattr(bench, f"{part}_inertia") * np.outer(rows[0], rows[0])
            continue
        kind = heavy[part.split()[0]]
        products += getattr(own, f"{kind}_mass") * rows[:2].T @ rows[:2]
        if len(rows) == 3:
            products += getattr(own, f"{kind}_inertia") * np.outer(rows[2], rows[2])
    np.testing.assert_allclose(products / KILOGRAM, np.eye(len(products)), atol=1e-9)
    for shares in (found.strain_energy, found.kinetic_energy):
        np.testing.assert_allclose(sum(shares.values()), 1, rtol=1e-9)


def test_the_first_of_what_moves_most_tells_the_sign() -> None:
    """Which of two equal motions is the larger by rounding differs from machine to machine, and so would the sign."""
    found = modes(Model(UNIT), theta=0.4)
    masses = {"carrier": "carrier", "disc": "disc", "crank": "crank", "sun": "sun"}
    weighed = []
    for part, rows in found.shape.items():
        kind = masses[part.split()[0]]
        mass, inertia = (getattr(found.inertia, f"{kind}_{what}") for what in ("mass", "inertia"))
        weighed += [math.sqrt(size) * row for size, row in zip((mass, mass, inertia), rows, strict=False)]
    moved = np.array(weighed)
    alike = np.abs(moved) > (1 - 1e-6) * np.abs(moved).max(axis=0)
    assert (alike.sum(axis=0) > 1).any()
    assert (moved[alike.argmax(axis=0), np.arange(moved.shape[1])] > 0).all()


def test_frequencies_come_back_after_a_turn_of_the_crank_against_the_carrier() -> None:
    """Without errors one pin is as another."""
    pitch = 2 * math.pi / UNIT.pins
    first, second = (modes(Model(UNIT, bench=ENDS), theta=theta).frequency for theta in (0.01, 0.01 + 7 * pitch))
    np.testing.assert_allclose(first, second, rtol=1e-9)


# --- what they change with --------------------------------------------------------------------------------------------


def with_times(model: Model, name: str, factor: float) -> Model:
    """The model with one stiffness or inertia times a factor."""
    unit, own = model.mechanism, modes(model).inertia
    assert isinstance(unit, Reducer)
    if name in Stiffness.__dataclass_fields__:
        changed = replace(unit.stiffness, **{name: getattr(unit.stiffness, name) * factor})
        return replace(model, mechanism=variant(unit, stiffness=changed))
    if name in Inertia.__dataclass_fields__:
        changed_inertia = replace(own, **{name: getattr(own, name) * factor})
        return replace(model, mechanism=variant(unit, inertia=changed_inertia))
    return replace(model, bench=replace(model.bench, **{name: getattr(model.bench, name) * factor}))


def test_sensitivities_are_finite_differences() -> None:
    model, step = Model(UNIT, bench=ENDS), 1e-4
    found = modes(model)
    assert set(found.sensitivity) == {
        *Stiffness.__dataclass_fields__, *Inertia.__dataclass_fields__,
        *(name for name in Bench.__dataclass_fields__ if "damping" not in name),
    }  # fmt: skip
    for name, told in found.sensitivity.items():
        low, high = (modes(with_times(model, name, math.exp(sign * step))).frequency for sign in (-1, 1))
        np.testing.assert_allclose(told, (high - low) / (2 * step), atol=1e-5 * found.frequency.max(), rtol=1e-5)
        assert abs(told).max() > 1e-3 * found.frequency.min(), name


def test_what_is_given_is_not_estimated() -> None:
    unit = rverror.reducer("RV-40E", inertia=Inertia(disc_mass="1 kg", sun_inertia="2e-6 kg*m^2"))
    found = modes(Model(unit, bench=ENDS))
    assert (found.inertia.disc_mass, found.inertia.sun_inertia) == pytest.approx((1e-3, 2e-3), rel=1e-12)
    assert set(Inertia.__dataclass_fields__) - set(found.estimated) == {"disc_mass", "sun_inertia"}


@settings(max_examples=50, deadline=None)
@given(unit=reducers(cranks=(2, 6)), factor=st.floats(0.1, 10))
def test_estimates_are_positive_and_grow_with_the_size(unit: Reducer, factor: float) -> None:
    """Lengths times s: masses s^3, moments s^5."""
    one, other = (modes(Model(u), torque=1e4 * f**2).inertia for u, f in ((unit, 1.0), (scaled(unit, factor), factor)))
    for name in Inertia.__dataclass_fields__:
        power = 3 if name.endswith("mass") else 5
        assert getattr(other, name) == pytest.approx(getattr(one, name) * factor**power, rel=1e-9)
        assert getattr(one, name) > 0


# --- the way in -------------------------------------------------------------------------------------------------------


def test_what_cannot_move_is_refused() -> None:
    with pytest.raises(rverror.InputError, match=r"dynamics need a \[reducer\] model"):
        modes(Model(rverror.Drive(ratio=14.0)))
    with pytest.raises(rverror.InputError, match="reducer 'RV-003' has no rated_torque; give one of them"):
        modes(Model(rverror.reducer("RV-003")))
    with pytest.raises(rverror.InputError, match=r"torque = -1 N\*m: must be 0 or more"):
        modes(Model(UNIT), torque="-1 N*m")
    with pytest.raises(rverror.InputError, match="torque: 'N' is no unit of torque"):
        modes(Model(UNIT), torque="1 N")


def test_modes_of_a_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rverror.save_model(tmp_path / "m.toml", Model(UNIT, bench=ENDS))
    out, picture, page = (tmp_path / name for name in ("o.json", "o.png", "o.html"))
    written = ["--json", str(out), "--plot", str(picture), "--html", str(page)]
    assert main(["modes", str(tmp_path / "m.toml"), "--torque", "20 N*m", "--angle", "3 deg", *written]) == 0
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert "crank bearing" in page.read_text()
    told, found = json.loads(out.read_text()), modes(Model(UNIT, bench=ENDS), torque=20e3, theta=math.radians(3))
    assert [one["frequency_hz"] for one in told["modes"]] == pytest.approx(found.frequency.tolist(), rel=1e-12)
    for at, one in enumerate(told["modes"]):
        assert one["damping_ratio"] == pytest.approx(0.03)
        assert set(one["parts"]) == {"carrier", "disc 0", "disc 1", "crank 0", "crank 1", "sun", "input", "load"}
        assert one["parts"]["carrier"]["angle_rad_per_mm"] == pytest.approx(found.shape["carrier"][2, at])
    assert told["variables"]["of_sun_support"]["values"] == found.of_sun_support.tolist()
    printed = capsys.readouterr().out
    assert printed.startswith("Modes: 20 N*m, forward\n")
    assert re.search(r"^output angle +3 deg$", printed, re.M)
    assert "estimated from the geometry" in printed
    assert main(["modes", str(tmp_path / "m.toml"), "--torque", "20 kg"]) == 2
    assert "--torque" in capsys.readouterr().err
