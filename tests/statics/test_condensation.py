"""Condensation onto the discs against the energy of all parts, where the loaded flanks carry and where they do not."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import rverror
from rverror.geartrain.contacts import pose
from rverror.statics.condensation import Stretch
from rverror.statics.energy import System, error_closing, geometry, loaded_system, minimise, refined, with_discs
from strategies import angles, reducers

TORQUE = 20e3
THETA = 2 * np.pi / 40 * np.arange(24) / 24


def laid_out(model: rverror.Model, theta: np.ndarray, *, direction: float, torque: float) -> tuple[Stretch, System]:
    motion = pose(model.mechanism, theta, direction=direction, torque=torque)
    contacts = geometry(motion)
    stretch = Stretch(contacts, model.mechanism, torque)
    return stretch, loaded_system(stretch, error_closing(contacts, model.effects), torque)


def bad_parts(unit: rverror.Reducer, rng: np.random.Generator, size: float) -> tuple[rverror.Effect, ...]:
    """One error of each sub-assembly; the crank that leads its planet moves flanks."""
    several = (
        ("cycloid.pin_position", {"pin": 3}),
        ("cycloid.disc_pitch", {"disc": 0, "harmonic": 1}),
        ("crank.eccentricity", {"crank": 1, "disc": 0}),
        ("coupling.carrier_bore_position", {"crank": 0}),
    )
    effects = []
    for key, indices in several:
        names = [p.name for p in rverror.CATALOGUE[key].parameters]
        sizes = dict(zip(names, rng.normal(0, size, len(names)), strict=True))
        effects.append(rverror.effect(key, **indices, **sizes))
    lead = rng.normal(0, size) / unit.crank_radius
    return (*effects, rverror.effect("crank.index", crank=0, angle=lead))


@settings(max_examples=25)
@given(unit=reducers(), theta=angles(), seed=st.integers(0, 2**32 - 1), direction=st.sampled_from([-1.0, 1.0]))
def test_discs_alone_take_the_pose_that_all_parts_take(
    unit: rverror.Reducer, theta: np.ndarray, seed: int, direction: float
) -> None:
    rng = np.random.default_rng(seed)
    model = rverror.Model(unit, bad_parts(unit, rng, 4e-3))
    torque = 0.1 * unit.stiffness.pin_contact * 1e-3 * unit.pin_circle_radius
    stretch, system = laid_out(model, theta, direction=direction, torque=torque)
    full, _, found = minimise(system, torque)
    flanks = (system.flank_rows @ full[..., None])[..., 0] + system.flank_error
    same = found & ((flanks > 0) == system.driving_flanks).all(axis=1)
    cold, _, settled = stretch.condensed.settled(system, torque, None)
    warm, _, again = stretch.condensed.settled(system, torque, cold + rng.normal(0, 1e-4, cold.shape))
    scale = abs(full).max()
    for x, ok in ((cold, settled), (warm, again)):
        assert ok[same].all()
        np.testing.assert_allclose(x[same], full[same], rtol=0, atol=1e-7 * scale)


def test_the_answer_to_a_force_is_that_of_all_parts() -> None:
    unit = rverror.reducer("RV-40E")
    model = rverror.Model(unit, bad_parts(unit, np.random.default_rng(1), 4e-3))
    stretch, system = laid_out(model, THETA, direction=1.0, torque=TORQUE)
    x, *_ = minimise(system, TORQUE)
    state = system.state(x)
    assert ((state.flanks > 0) == system.driving_flanks).all()
    assert ((state.pins > 0) != system.driving_pins).any()  # pins lift off: the matrix is that of the state
    force = np.random.default_rng(2).normal(0, 1e3, x.shape)
    more = 1e4 * np.broadcast_to(np.eye(3), (len(x), unit.discs, 3, 3))
    expected = refined(with_discs(system.newton_matrix(state), more, system.first_disc), force)
    found = stretch.condensed.answer(system, state, force, more)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * abs(expected).max())


@pytest.mark.parametrize("lead", [0.0, 0.02, 3.0])
def test_flanks_that_lift_are_left_to_the_energy_of_all_parts(lead: float) -> None:
    """A crank that lags its planet by far takes its flank off, or shuts the coast side of the next one."""
    unit = rverror.Reducer(
        **{
            name: getattr(rverror.reducer("RV-40E"), name)
            for name in rverror.Reducer.__dataclass_fields__
            if name not in ("cranks", "gear_backlash")
        },
        cranks=3,
        gear_backlash=2e-3,
    )
    lags = tuple(rverror.effect("crank.index", crank=j, angle=f"{v * lead} mrad") for j, v in ((0, -1.0), (1, 1.0)))
    model = rverror.Model(unit, lags)
    _, system = laid_out(model, THETA, direction=1.0, torque=TORQUE)
    x, _, found = minimise(system, TORQUE)
    assert found.all()
    flanks = (system.flank_rows @ x[..., None])[..., 0] + system.flank_error
    lifted = ((flanks > 0) != system.driving_flanks).any()
    assert lifted == (lead > 1.0)
    seen = rverror.equilibrium(model, THETA, torque=TORQUE, direction=1)
    np.testing.assert_allclose(seen.transmission_error, x[:, 2], rtol=0, atol=1e-9 * abs(x[:, 2]).max())


def test_a_start_with_all_pins_open_is_left_to_the_line_search() -> None:
    """Without pins the held sun leaves the train one free motion: some condensed stiffness is singular to the last bit.

    Three equal discs at 4096 angles have one of these.
    """
    unit = rverror.reducer("RV-40E", discs=3, cranks=3)
    theta = 2 * np.pi * np.arange(4096) / 4096
    ground = rverror.Model(unit, (rverror.effect("cycloid.profile_modification", equidistant="0.2 mm"),))
    stretch, system = laid_out(ground, theta, direction=1.0, torque=TORQUE)
    nominal, *_ = stretch.condensed.settled(
        laid_out(rverror.Model(unit), theta, direction=1.0, torque=TORQUE)[1], TORQUE, None
    )
    assert (system.closed(nominal).pins < 0).all()
    cold, _, found = stretch.condensed.settled(system, TORQUE, None)
    warm, _, again = stretch.condensed.settled(system, TORQUE, nominal)
    assert found.all()
    assert again.all()
    np.testing.assert_allclose(warm, cold, rtol=0, atol=1e-9 * abs(cold).max())
