"""How the output changes with stiffness, backlash and contact law: derivatives, power laws, shared geometry."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import rverror
from rverror.geartrain.kinematics import OperatingConditions
from rverror.geartrain.mechanism import REFERENCE_FORCE, ContactLaw, Reducer
from rverror.model.effects import Effect, effect
from rverror.statics import kernel
from rverror.statics.energy import solve
from rverror.statics.loaded_state import SOFTENING, Statics, statics_of
from rverror.statics.prediction import predict

pressed = kernel.pressed.py_func  # machine code holds it only in what calls it
THETA = 2 * np.pi * np.mod(0.05 + 0.6180339887 * np.arange(24), 1)
LINE = ContactLaw(pin_exponent=10 / 9, flank_exponent=10 / 9)
LAWS = [
    ContactLaw(), LINE, ContactLaw(pin_exponent=1.3), ContactLaw(flank_exponent=1.45),
    ContactLaw(profile_curvature=1.0), ContactLaw(pin_exponent=1.1, profile_curvature=0.7),
]  # fmt: skip


def errors(rng: np.random.Generator, *, clearance: bool = False, size: float = 4e-3) -> tuple[Effect, ...]:
    """Random errors of every sub-assembly."""
    several = (
        ("cycloid.pin_position", {"pin": 3}),
        ("cycloid.pin_circle", {"harmonic": 2}),
        ("cycloid.disc_pitch", {"disc": 0, "harmonic": 1}),
        ("crank.eccentricity", {"crank": 1, "disc": 0}),
        ("involute.sun_eccentricity", {}),
        ("coupling.carrier_bore_position", {"crank": 0}),
    )
    effects = []
    for key, indices in several:
        values = tuple(rng.normal(0, size, len(rverror.CATALOGUE[key].parameters)))
        effects.append(Effect(key, indices, values))
    if clearance:
        effects += [effect("crank.bearing_clearance", clearance=5e-3)]
        effects += [effect("coupling.bearing_clearance", clearance=3e-3)]
    return tuple(effects)


def changed(unit: Reducer, name: str, step: float) -> Reducer:
    """A reducer with one of `SOFTENING` moved by a step."""
    if name == "gear_backlash":
        return replace(unit, gear_backlash=unit.gear_backlash + step)
    if name.endswith(("exponent", "curvature")):
        return replace(unit, contact_law=replace(unit.contact_law, **{name: getattr(unit.contact_law, name) + step}))
    soft = replace(unit.stiffness, **{name: getattr(unit.stiffness, name) * math.exp(-step)})
    return replace(unit, stiffness=soft)


def statics(unit: Reducer, direction: float, torque: float) -> Statics:
    return statics_of(unit, OperatingConditions(THETA, direction, torque))


@pytest.mark.parametrize("clearance", [False, True])
@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize("law", LAWS, ids=str)
@pytest.mark.parametrize("name", ["RV-40E", "RV-003"])
def test_softening_is_the_derivative(
    monkeypatch: pytest.MonkeyPatch, name: str, law: ContactLaw, direction: float, clearance: bool
) -> None:
    """Against central differences of the equilibrium of all parts; angles where a contact opens meanwhile are left."""
    unit = rverror.reducer(name, contact_law=law)
    effects = errors(np.random.default_rng(7), clearance=clearance)
    torque = 100e3
    monkeypatch.setattr("rverror.statics.energy.GRADIENT_TOLERANCE", 1e-12)  # differences are small
    here = statics(unit, direction, torque)
    rows = here.predict(effects).softening
    assert rows.shape == (len(SOFTENING), THETA.size)
    for row, parameter in zip(rows, SOFTENING, strict=True):
        step = 1e-5 if parameter == "gear_backlash" else 1e-3 if parameter.endswith(("exponent", "curvature")) else 1e-4

        def solved(by: float, parameter: str = parameter) -> tuple[np.ndarray, np.ndarray]:
            state = here.elastic(changed(unit, parameter, by)).settled(effects).equilibrium()
            pins = np.linalg.norm(state.contact_forces["pin"], axis=2)
            return state.transmission_error, pins.reshape(-1, THETA.size)

        if parameter.endswith(("exponent", "curvature")):  # forwards, for it cannot be below 1 or 0, of fourth order
            ends = [solved(k * step) for k in range(5)]
            found = sum(c * turn for c, (turn, _) in zip((-25, 48, -36, 16, -3), ends, strict=True)) / (12 * step)
        else:
            ends = [solved(step), solved(-step)]
            found = (ends[0][0] - ends[1][0]) / (2 * step)
        pins = np.array([pins for _, pins in ends])
        # a pin that bears next to nothing is at a kink, or, by a power law, near one
        same = ((pins > 0) == (pins[0] > 0)).all(axis=(0, 1)) & ~((pins > 0) & (pins < 2.0)).any(axis=(0, 1))
        assert same.sum() >= 8, parameter
        bound = 1e-5 * max(np.abs(row).max(), 0.01 * np.abs(rows).max())
        np.testing.assert_allclose(found[same], row[same], rtol=0, atol=bound, err_msg=parameter)


def test_a_single_contact_closes_by_its_law() -> None:
    """By hand: 200 N on 2e5 N/mm at 100 N, exponent 10/9."""
    closing = REFERENCE_FORCE / 2e5 * 2**0.9
    force, tangent = pressed(closing, 2e5, 10 / 9, REFERENCE_FORCE)
    assert force == pytest.approx(200.0, rel=1e-14)
    assert tangent == pytest.approx(10 / 9 * 200 / closing, rel=1e-14)
    assert pressed(REFERENCE_FORCE / 2e5, 2e5, 10 / 9, REFERENCE_FORCE)[0] == pytest.approx(REFERENCE_FORCE, rel=1e-14)
    assert pressed(-1.0, 2e5, 10 / 9, REFERENCE_FORCE) == (0.0, 0.0)


@pytest.mark.parametrize("share", [0.0, 1.0])
@pytest.mark.parametrize("exponent", [1.0, 10 / 9, 1.5])
def test_force_and_stiffness_are_slopes_of_the_energy(exponent: float, share: float) -> None:
    law = ContactLaw(pin_exponent=exponent, flank_exponent=exponent, profile_curvature=share)
    unit, rng = rverror.reducer("RV-40E", contact_law=law), np.random.default_rng(3)
    settled = statics(unit, 1.0, 100e3).settled(errors(rng, size=20e-3))
    x = settled.x + rng.normal(0, 1e-3, settled.x.shape)
    way = rng.normal(0, 1e-3, x.shape)
    step = 1e-4
    ends = [solve(settled.problem, given=x + sign * step * way, matrix=True) for sign in (1, -1)]
    here = solve(settled.problem, given=x, matrix=True)
    slope = (ends[0].energy - ends[1].energy) / (2 * step)
    np.testing.assert_allclose(slope, (here.gradient * way).sum(axis=1), rtol=1e-6)
    matrix = here.matrix
    assert np.array_equal(matrix, np.swapaxes(matrix, 1, 2))
    bent = (ends[0].gradient - ends[1].gradient) / (2 * step)
    near = (np.abs(here.pins) < 1e-4).any(axis=(1, 2))  # of a kink
    assert (~near).sum() > 5
    scale = np.abs(bent).max()
    np.testing.assert_allclose(bent[~near], (matrix @ way[..., None])[..., 0][~near], rtol=0, atol=2e-5 * scale)


def test_a_nearly_linear_law_is_the_linear_one() -> None:
    effects = errors(np.random.default_rng(11))
    unit = rverror.reducer("RV-40E")
    plain = statics(unit, 1.0, 20e3).predict(effects)
    near = ContactLaw(pin_exponent=1 + 1e-9, flank_exponent=1 + 1e-9)
    found = statics(replace(unit, contact_law=near), 1.0, 20e3).predict(effects)
    for one, other in (
        (found.transmission_error, plain.transmission_error),
        (found.matrix, plain.matrix),
        (found.softening, plain.softening),
    ):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-7 * np.abs(other).max())


def test_a_line_contact_stiffens_with_load() -> None:
    """On hard bearings: compliance goes with the load to the power 1/n - 1."""
    hard = rverror.geartrain.Stiffness(crank_bearing=1e9, carrier_bearing=1e9)

    def softness(unit: Reducer, torque: float) -> float:
        model = rverror.Model(unit)
        more, less = (rverror.equilibrium(model, [0.3], torque=share * torque, direction=1) for share in (1.01, 0.99))
        return float((less.transmission_error - more.transmission_error)[0] / (0.02 * torque))

    linear = rverror.reducer("RV-40E", stiffness=hard)
    line = replace(linear, contact_law=LINE)
    assert softness(line, 400e3) / softness(line, 20e3) == pytest.approx(20 ** (9 / 10 - 1), rel=1e-2)
    assert softness(linear, 400e3) == pytest.approx(softness(linear, 20e3), rel=1e-6)


@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize("name", ["RV-40E", "RV-003"])
def test_compliances_and_backlash_make_all_that_a_perfect_unit_turns(name: str, direction: float) -> None:
    """A linear one is homogeneous: twice as compliant with twice the backlash turns twice as far (Euler's theorem)."""
    unit = rverror.reducer(name)
    found = statics(unit, direction, 200e3).predict(())
    weights = np.append(np.ones(6), unit.gear_backlash)
    np.testing.assert_allclose(weights @ found.softening[:7], found.transmission_error, rtol=1e-9)
    assert (found.softening[:4] * direction < 0).all()  # what is softer lags the more


@pytest.mark.parametrize("law", LAWS, ids=str)
def test_influences_are_the_derivatives_by_any_law(monkeypatch: pytest.MonkeyPatch, law: ContactLaw) -> None:
    monkeypatch.setattr("rverror.statics.energy.GRADIENT_TOLERANCE", 1e-12)
    unit = rverror.reducer("RV-40E", contact_law=law)
    effects = errors(np.random.default_rng(2))
    where, step = statics(unit, -1.0, 200e3), 1e-7
    rows = where.predict(effects).matrix
    at = 0
    for index, one in enumerate(effects):
        for term in range(len(one.values)):
            ends = []
            for sign in (1, -1):
                values = tuple(v + sign * step * (i == term) for i, v in enumerate(one.values))
                moved = (*effects[:index], replace(one, values=values), *effects[index + 1 :])
                ends.append(where.settled(moved).transmission_error)
            slope = (ends[0] - ends[1]) / (2 * step)
            assert np.median(np.abs(slope - rows[at])) < 1e-6 * np.abs(rows).max()
            at += 1


def test_other_stiffness_shares_the_geometry_and_is_exactly_itself() -> None:
    unit, effects = rverror.reducer("RV-40E"), errors(np.random.default_rng(4))
    other = replace(
        unit, stiffness=rverror.geartrain.Stiffness(pin_contact=1.2e5), gear_backlash=5e-3, contact_law=LINE
    )
    where = OperatingConditions(np.linspace(0.2, 6.0, 300), 1.0, 30e3)
    for some in (effects, effects[2:4]):
        first = statics_of(unit, where)
        for start in (None, first.predict(some).poses):
            second = first.elastic(other)
            found, alone = second.predict(some, start), statics_of(other, where).predict(some)
            for name in ("transmission_error", "matrix", "softening"):
                one, expected = getattr(found, name), getattr(alone, name)
                np.testing.assert_allclose(one, expected, rtol=0, atol=1e-8 * np.abs(expected).max())
            assert second.elastic(unit).predict(some).softening.shape == (10, 300)
            assert first.contacts is second.contacts
            assert np.abs(found.transmission_error - first.predict(some).transmission_error).min() > 1e-6


def test_the_closed_form_knows_no_stiffness() -> None:
    unit = rverror.reducer("RV-40E")
    assert predict(rverror.Model(unit), OperatingConditions(THETA, 1.0)).softening is None


def test_another_geometry_is_refused() -> None:
    unit = rverror.reducer("RV-40E")
    with pytest.raises(ValueError, match=r"pin_radius = 3.1, here 3.0: only stiffness, stiffness_uncertainty, gear"):
        statics_of(unit, OperatingConditions(THETA, 1.0, 1e3)).elastic(replace(unit, pin_radius=3.1))


@pytest.mark.parametrize("exponent", [0.99, 1.51, True, "10/9", math.nan])
def test_an_exponent_of_no_contact_is_refused(exponent: object) -> None:
    with pytest.raises(ValueError, match=r"^pin_exponent"):
        ContactLaw(pin_exponent=exponent)  # type: ignore[arg-type]


def test_without_load_a_law_leaves_the_limit_of_a_vanishing_one() -> None:
    unit, effects = rverror.reducer("RV-40E", contact_law=LINE), errors(np.random.default_rng(8))
    none, *slight = (
        rverror.equilibrium(rverror.Model(unit, effects), THETA, torque=torque, direction=1).transmission_error
        for torque in ("0 N*mm", "0.1 N*mm", "10 N*mm")
    )
    little, more = (np.abs(one - none).max() for one in slight)
    assert little < 0.05 * more < 1e-6
