"""Damping by contact: Rayleigh's closed form, and the work that each contact swallows."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import rverror
from rverror import Model, Reducer, effect
from rverror.base.arrays import slope
from rverror.dynamics import modes, speed_response
from rverror.dynamics.loaded_motion import loaded_motion
from rverror.dynamics.train import Train
from rverror.geartrain.contacts import pose
from rverror.model import Bench
from rverror.statics.loaded_state import Settled, statics_of
from strategies import reducers, variant

UNIT = rverror.reducer("RV-40E")
SMALL = variant(UNIT, pins=12, disc_lobes=11, eccentricity=3.0, pin_radius=6.0, name="small")
KINDS = tuple(name for name in Bench.__dataclass_fields__ if name.endswith("_damping"))
ENDS = Bench(
    input_inertia="1e-4 kg*m^2",
    position_control_stiffness="200 N*m/rad",
    input_coupling_stiffness="3000 N*m/rad",
    load_inertia="5 kg*m^2",
    load_coupling_stiffness="1e6 N*m/rad",
)
#: No two alike.
UNLIKE = replace(ENDS, **{name: (1 + at) * 1e-5 for at, name in enumerate(KINDS)})
ERRORS = (
    effect("crank.eccentricity", crank=0, disc=0, tangential="5 um"),
    effect("cycloid.disc_pitch", disc=1, harmonic=1, cos="4 um"),
)


def test_kinds_are_those_of_stiffness_and_springs() -> None:
    kinds = {name.removesuffix("_damping") for name in KINDS}
    springs = {name.removesuffix("_stiffness") for name in Bench.__dataclass_fields__ if name.endswith("_stiffness")}
    assert kinds == set(rverror.geartrain.Stiffness.__dataclass_fields__) | springs


@settings(max_examples=10, deadline=None)
@given(unit=reducers(), time=st.floats(1e-7, 1e-3))
def test_alike_everywhere_a_mode_is_damped_in_proportion_to_its_frequency(unit: Reducer, time: float) -> None:
    """C = beta K: zeta = beta omega / 2 (Rayleigh); each square of a frequency is known to rounding of the largest."""
    found = modes(Model(unit, bench=replace(ENDS, **dict.fromkeys(KINDS, time))), torque=1e5, theta=0.3)
    rounding = np.finfo(float).eps * found.frequency.size * (found.frequency[-1] / found.frequency) ** 2
    assert rounding[0] < 1e-3
    off = np.abs(found.damping_ratio / (time * math.pi * found.frequency) - 1)
    assert (off <= 1e-12 + rounding).all()


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_heavy_load_on_contacts_alike_is_the_textbooks_wavy_base(direction: float) -> None:
    """One mode of zeta = beta omega / 2: the error is e (1 + r^2 / (1 - r^2 + 2 i zeta r))."""
    time, load = 3e-3, Bench(load_inertia="500 kg*m^2")
    model = Model(UNIT, ERRORS[:1], bench=replace(load, **dict.fromkeys(KINDS, time)))
    found = speed_response(model, ["400 rpm", "700 rpm", "1500 rpm"], direction=direction)
    first = modes(model, direction=direction).frequency[0]
    at = found.order.tolist().index(40.0)
    share = 40 * found.speed / (2 * math.pi * UNIT.ratio) / first
    expected = 1 + share**2 / (1 - share**2 + 2j * direction * time * math.pi * first * share)
    np.testing.assert_allclose(found.waves[:, at] / found.crawl_waves[at], expected, rtol=2e-3)


def contact_rates(train: Train, tangent: Settled, rates: np.ndarray) -> dict[str, np.ndarray]:
    """Power that each contact swallows, contact by contact, N*mm/s, (n,), of rates of the coordinates, (size, n)."""
    times, reducer = train.bench.damping_times, train.reducer
    cams = reducer.discs * reducer.cranks
    lost = dict.fromkeys(times, np.zeros(rates.shape[1]))
    for k in range(reducer.discs):
        disc = rates[list(train.place(f"disc {k}"))]
        for pin in range(reducer.pins):
            closing = (tangent.contacts.pin_rows[:, k, :, pin].T * disc).sum(axis=0)
            lost["pin_contact"] = (
                lost["pin_contact"] + times["pin_contact"] * tangent.solution.pin_tangent[:, k, pin] * closing**2
            )
    flanks = np.einsum("nfc,cn->fn", train.flank_rows(tangent), rates)
    lost["gear_mesh"] = times["gear_mesh"] * (tangent.flank.T * flanks**2).sum(axis=0)
    floating = tangent.x.shape[1]
    joints = np.einsum("nqdc,cn->qdn", tangent.split(tangent.contacts.whole_rows)[1], rates[:floating])
    each = np.einsum("qdn,nqde,qen->qn", joints, tangent.joint, joints)
    for name, at in (
        ("crank_bearing", slice(0, cams)),
        ("carrier_bearing", slice(cams, -2)),
        ("main_bearing", slice(-2, -1)),
        ("sun_support", slice(-1, None)),
    ):
        lost[name] = times[name] * each[at].sum(axis=0)
    sun, motor, load, carrier = (train.place(part)[-1] for part in ("sun", "input", "load", "carrier"))
    bench = train.bench
    assert bench.position_control_stiffness is not None
    assert bench.input_coupling_stiffness is not None
    assert bench.load_coupling_stiffness is not None
    lost["position_control"] = times["position_control"] * bench.position_control_stiffness * rates[motor] ** 2
    lost["input_coupling"] = times["input_coupling"] * bench.input_coupling_stiffness * (rates[sun] - rates[motor]) ** 2
    lost["load_coupling"] = times["load_coupling"] * bench.load_coupling_stiffness * (rates[carrier] - rates[load]) ** 2
    return lost


def test_a_cycle_swallows_pi_c_omega_times_the_square_of_every_closing() -> None:
    """Shaken at the load about one pose: work put in, pi F y sin(phase), is the sum over contacts."""
    train = Train(SMALL, UNLIKE)
    tangent = statics_of(SMALL, pose(SMALL, [0.3], torque=1e5, direction=1.0)).settled(ERRORS)
    groups = train.stiffness(tangent)
    stiffness, damping = sum(groups.values())[0], train.damping(groups)[0]
    force = np.zeros(train.size)
    force[train.place("load")[0]] = 1e3
    for frequency in (20.0, 60.0, 400.0):
        omega = 2 * math.pi * frequency
        moved = np.linalg.solve(stiffness - omega**2 * np.diag(train.mass) + 1j * omega * damping, force)
        put_in = math.pi * (force * -moved.imag).sum()
        # c |omega delta|^2 times pi / omega: of cosine and sine parts
        parts = [contact_rates(train, tangent, omega * part[:, None]) for part in (moved.real, moved.imag)]
        swallowed = {name: math.pi / omega * sum(part[name][0] for part in parts) for name in parts[0]}
        assert put_in == pytest.approx(sum(swallowed.values()), rel=1e-9)
        assert min(swallowed.values()) > 0


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_power_put_in_at_speed_is_what_contacts_swallow(direction: float) -> None:
    """All modes kept: force times rate, less what the turning stiffness takes, is c rate^2 of every contact."""
    count, speed = 1024, 0.8 * direction
    theta = 2 * math.pi * np.arange(count) / count
    tangent = statics_of(SMALL, pose(SMALL, theta, torque=3e5, direction=direction)).settled(ERRORS)
    train = Train(SMALL, UNLIKE)
    reduced = loaded_motion(train, tangent, theta, 2 * math.pi).reduced(99)
    moved = reduced.response(speed)
    rate = speed * slope(moved, 1.0)
    # rates in the frames of the parts, as the housing sees them
    lost = contact_rates(train, tangent, reduced.pose(rate, 0.0, slice(None)))
    own = reduced.oscillator
    put_in = (speed**2 * reduced.forced.by_speed * rate).sum(axis=0).mean()
    stored = np.einsum("in,ijn,jn->n", rate, own.stiffness, moved).mean()
    assert put_in - stored == pytest.approx(sum(lost.values()).mean(), rel=1e-6)


def test_ratio_and_contacts_do_not_stand_together() -> None:
    with pytest.raises(ValueError, match="damping_ratio stands beside damping by contact; give one of them"):
        Bench(damping_ratio=0.02, gear_mesh_damping="10 us")
    with pytest.raises(ValueError, match=r"gear_mesh_damping = -0\.01 ms: must be 0 or more"):
        Bench(gear_mesh_damping="-10 us")
    assert Bench().ratio_of_modes == 0.03
    assert Bench(gear_mesh_damping="10 us").damping_times["gear_mesh"] == pytest.approx(1e-5)
    assert Bench(gear_mesh_damping="10 us").damping_times["pin_contact"] == 0
