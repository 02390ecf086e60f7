"""The compiled equilibrium: its matrix, its solutions and its starts, against dense linear algebra and other ways."""

from __future__ import annotations

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, strategies as st

import rverror
from rverror.geartrain.kinematics import OperatingConditions
from rverror.statics.energy import solve
from rverror.statics.loaded_state import Settled, statics_of
from strategies import angles, reducers

UNIT = rverror.reducer("RV-40E")
THETA = 2 * np.pi / 40 * np.arange(24) / 24
TORQUE = 20e3
LAWS = {
    "linear": rverror.geartrain.ContactLaw(),
    "line contact": rverror.geartrain.ContactLaw(pin_exponent=10 / 9, flank_exponent=10 / 9),
    "curved": rverror.geartrain.ContactLaw(profile_curvature=1.0),
}


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


def clearances(*sizes: str) -> tuple[rverror.Effect, ...]:
    keys = ("crank.bearing_clearance", "coupling.bearing_clearance")
    return tuple(rverror.effect(key, clearance=size) for key, size in zip(keys, sizes, strict=True))


def settled(
    unit: rverror.Reducer,
    effects: tuple[rverror.Effect, ...],
    theta: np.ndarray = THETA,
    *,
    direction: float = 1.0,
    torque: float = TORQUE,
    start: np.ndarray | None = None,
) -> Settled:
    found = statics_of(unit, OperatingConditions(theta, direction, torque)).settled(effects, start, response=True)
    return found


def dense_matrix(found: Settled) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness from whole rows of all contacts times their tangent stiffness, straight normals; and of their sizes."""
    contacts = found.contacts
    flank_rows, joint_rows = found.split(contacts.whole_rows)
    pins = np.zeros((*contacts.pin_rows.shape[:2], found.reducer.pins, found.x.shape[1]))
    for k in range(found.reducer.discs):
        pins[:, k, :, 3 + 3 * k : 6 + 3 * k] = np.swapaxes(contacts.pin_rows[:, k], 1, 2)
    both = []
    for of in (np.asarray, np.abs):  # sizes bound what rounding leaves of terms that cancel
        joints, flanks, own = of(joint_rows), of(flank_rows), of(pins)
        matrix = np.einsum("nqca,nqcd,nqdb->nab", joints, of(found.joint), joints)
        matrix += np.einsum("nfa,nf,nfb->nab", flanks, found.flank, flanks)
        both.append(matrix + np.einsum("nkpa,nkp,nkpb->nab", own, found.solution.pin_tangent, own))
    return both[0], both[1]


@given(
    unit=reducers(),
    theta=angles(),
    seed=st.integers(0, 2**32 - 1),
    direction=st.sampled_from([-1.0, 1.0]),
    output=st.sampled_from(["carrier", "housing"]),
    floats=st.booleans(),
)
def test_the_matrix_in_its_envelope_is_that_of_whole_rows(
    unit: rverror.Reducer, theta: np.ndarray, seed: int, direction: float, output: str, floats: bool
) -> None:
    unit = replace(unit, output=output)
    errors = bad_parts(unit, np.random.default_rng(seed), 4e-3) + (clearances("2 um", "3 um") if floats else ())
    torque = 0.1 * unit.stiffness.pin_contact * 1e-3 * unit.pin_circle_radius
    found = settled(unit, errors, theta, direction=direction, torque=torque)
    expected, size_of = dense_matrix(found)
    matrix = solve(found.problem, given=found.solution.x, matrix=True).matrix
    assert (np.abs(matrix - expected) <= 1e-13 * size_of).all()
    first, size = found.contacts.envelope, found.x.shape[1]
    outside = np.arange(size)[None] < first[:, None]
    assert not expected[:, outside].any()
    # the answer to a unit torque: by virtual work the change of each contact's force
    push = np.zeros(size)
    push[2] = unit.output_turn
    answer = found.solution.pose_change
    left = (expected @ answer[..., None])[..., 0] + push
    allowed = (size_of @ np.abs(answer)[..., None])[..., 0] + np.abs(push)
    assert (np.abs(left) <= 1e-9 * allowed).all()
    flanks = found.flank * np.einsum("nfa,na->nf", found.split(found.contacts.whole_rows)[0], answer)
    np.testing.assert_allclose(
        found.solution.row_change[:, : flanks.shape[1]], flanks, rtol=0, atol=1e-9 * np.abs(flanks).max()
    )


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("floats", [False, True])
@pytest.mark.parametrize("torque", [5e3, 412e3])
def test_wherever_it_starts_it_ends_in_the_one_pose_of_least_energy(law: str, floats: bool, torque: float) -> None:
    unit, rng = rverror.reducer("RV-40E", contact_law=LAWS[law]), np.random.default_rng(5)
    errors = bad_parts(unit, rng, 4e-3) + (clearances("3 um", "2 um") if floats else ())
    cold = settled(unit, errors, torque=torque)
    scale = np.abs(cold.x).max()
    for aside in (1e-5, 1e-4, 1e-3):
        start = cold.x + rng.normal(0, aside, cold.x.shape) / np.where(np.arange(cold.x.shape[1]) % 3 == 2, 64, 1)
        warm = settled(unit, errors, torque=torque, start=start)
        np.testing.assert_allclose(warm.x, cold.x, rtol=0, atol=1e-7 * scale)


def test_a_start_with_all_pins_open_is_found_its_way_back() -> None:
    """Without pins the held sun leaves the train one free motion: a Newton step along it has no length of its own."""
    unit = rverror.reducer("RV-40E", discs=3, cranks=3)
    theta = 2 * np.pi * np.arange(512) / 512
    ground = (rverror.effect("cycloid.profile_modification", equidistant="0.2 mm"),)
    nominal, cold = settled(unit, (), theta).x, settled(unit, ground, theta)
    assert (solve(cold.problem, given=nominal).pins < 0).all()
    warm = settled(unit, ground, theta, start=nominal)
    np.testing.assert_allclose(warm.x, cold.x, rtol=0, atol=1e-9 * abs(cold.x).max())


@pytest.mark.parametrize("lead", [0.0, 0.02, 3.0])
def test_flanks_lift_and_the_other_side_closes(lead: float) -> None:
    """A crank that lags its planet by far takes its flank off, or shuts the coast side of the next one."""
    unit = rverror.reducer("RV-40E", cranks=3, gear_backlash=2e-3)
    lags = tuple(rverror.effect("crank.index", crank=j, angle=f"{v * lead} mrad") for j, v in ((0, -1.0), (1, 1.0)))
    found = settled(unit, lags)
    loaded = found.solution.rows[:, :6].reshape(-1, 3, 2) > 0
    assert (loaded == [True, False]).all() == (lead < 1.0)
    assert (np.abs(found.solution.gradient).max(axis=1) <= found.problem.tolerance).all()
    np.testing.assert_array_equal(found.solution.row_force[:, :6] > 0, found.solution.rows[:, :6] > 0)


@pytest.mark.parametrize("floats", [False, True])
def test_threads_change_nothing(monkeypatch: pytest.MonkeyPatch, floats: bool) -> None:
    """Which angles start from which does not depend on how many threads there are: to the last bit."""
    theta = 2 * np.pi * np.arange(500) / 500
    errors = bad_parts(UNIT, np.random.default_rng(1), 4e-3) + (clearances("3 um", "2 um") if floats else ())
    poses = []
    for threads in ("1", "2", "5"):
        monkeypatch.setenv("NUMBA_NUM_THREADS", threads)
        poses.append(settled(UNIT, errors, theta).x)
    np.testing.assert_array_equal(poses[1], poses[0])
    np.testing.assert_array_equal(poses[2], poses[0])


def test_a_program_may_solve_on_threads_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each of them hands out work to the same two threads; nothing waits for ever, nothing is mixed up."""
    monkeypatch.setenv("NUMBA_NUM_THREADS", "2")
    theta = 2 * np.pi * np.arange(500) / 500
    units = [bad_parts(UNIT, np.random.default_rng(seed), 4e-3) for seed in range(6)]
    alone = [settled(UNIT, errors, theta).x for errors in units]
    with ThreadPoolExecutor(3) as pool:
        beside = list(pool.map(lambda errors: settled(UNIT, errors, theta).x, units))
    np.testing.assert_array_equal(beside, alone)


PLAIN = """
import numpy as np, rverror
from rverror.statics.prediction import predict
unit = rverror.reducer("RV-40E", contact_law=rverror.geartrain.ContactLaw(**{law}))
errors = (
    rverror.effect("cycloid.pin_position", pin=3, tangential="6 um"),
    rverror.effect("crank.bearing_clearance", clearance="{clearance} um"),
)
found = predict(rverror.Model(unit, errors), rverror.geartrain.OperatingConditions(np.linspace(0, 0.2, 4), 1.0, 20e3))
print(repr([*found.transmission_error, *found.matrix.ravel(), *found.softening.ravel()]))
"""


@pytest.mark.parametrize("clearance", [0, 3])
@pytest.mark.parametrize("law", ["dict()", "dict(pin_exponent=1.1, flank_exponent=1.2, profile_curvature=1.0)"])
def test_the_same_lines_run_as_plain_python(law: str, clearance: int) -> None:
    code = PLAIN.format(law=law, clearance=clearance)
    found = []
    for disabled in ("0", "1"):
        environment = {**os.environ, "NUMBA_DISABLE_JIT": disabled}
        done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
        found.append(np.array(eval(done.stdout, {"np": np})))
    np.testing.assert_allclose(found[0], found[1], rtol=1e-9, atol=1e-15)
