"""Clearance in bearings: published lags and ripples, limits, and derivatives at a finite clearance."""

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import rverror
from rverror.geartrain.mechanism import Stiffness
from rverror.model.compose import source_matrix
from rverror.statics import energy

ARCSEC = math.pi / 180 / 3600
UNIT = rverror.reducer("RV-40E")
THETA = 2 * np.pi * np.arange(4096) / 4096
CLEARANCE = 5e-3


def effect_of(key: str, clearance: float = CLEARANCE) -> rverror.Effect:
    return rverror.effect(key, clearance=clearance)


def shift(
    key: str,
    *,
    torque: float,
    direction: float,
    unit: rverror.Reducer = UNIT,
    clearance: float = CLEARANCE,
    theta: np.ndarray = THETA,
) -> np.ndarray:
    """What the clearance alone does to the output, arcsec."""
    model = rverror.Model(unit, (effect_of(key, clearance),))
    with_it = rverror.equilibrium(model, theta, torque=torque, direction=direction).transmission_error
    without = rverror.equilibrium(rverror.Model(unit), theta, torque=torque, direction=direction).transmission_error
    return np.asarray((with_it - without) / ARCSEC)


def amplitudes(values: np.ndarray) -> np.ndarray:
    return 2 * np.abs(np.fft.rfft(values)) / values.size


def test_closed_form_of_carrier_bearings() -> None:
    """Each bore carries 1/(n r6) along the tangent, and the meshes' separating force, tan(alpha)/(R n r1), across."""
    along = 1 / (2 * 27)
    across = math.tan(math.radians(20)) / (121 * 2 * 6.75)
    expected = -2 * math.hypot(along, across)
    for direction in (1, -1):
        found = rverror.influence(UNIT, THETA, "coupling.bearing_clearance", direction=direction).matrix[0]
        np.testing.assert_allclose(found, direction * expected, rtol=1e-9)


def test_closed_form_of_cam_bearings() -> None:
    """The force of a bearing, from the part errors that displace it: the sum of its lengths is the lag."""
    lengths = np.zeros(THETA.size)
    for crank in (0, 1):
        for disc in (0, 1):
            across = rverror.influence(UNIT, THETA, "crank.eccentricity", crank=crank, disc=disc).matrix
            lengths += np.hypot(*across)
    found = rverror.influence(UNIT, THETA, "crank.bearing_clearance").matrix[0]
    np.testing.assert_allclose(found, -lengths, rtol=1e-12)


@pytest.mark.parametrize("torque", [1e3, 20e3, 412e3])
def test_carrier_clearance_lags_by_its_angle_at_r6_and_does_not_ripple(torque: float) -> None:
    lag = CLEARANCE / 27 / ARCSEC  # 38.2
    for direction in (1, -1):
        found = shift("coupling.bearing_clearance", torque=torque, direction=direction)
        np.testing.assert_allclose(found, -direction * lag, rtol=1e-3)
        assert np.ptp(found) < 0.01


def test_cam_clearance_lags_and_ripples_at_80() -> None:
    """Published: order 80 with 2.7 arcsec and 39 arcsec of lag each way at 20 N*m."""
    forward = shift("crank.bearing_clearance", torque=20e3, direction=1)
    line = amplitudes(forward)
    assert -forward.mean() == pytest.approx(39, rel=0.05)
    assert line[80] == pytest.approx(2.7, rel=0.05)
    assert line[40] < 1e-3
    assert line[120] < 1e-3


def test_published_lines_of_a_light_load_are_folded() -> None:
    """Published for 1 N*m: 1.9 arcsec at order 80 and 1.6 at 160; that is what 480 angles a turn read.

    There the journals turn round their rims in jumps, so orders 240, 320, 400 are large, and 480 angles fold 400 and
    560 onto 80, 320 and 640 onto 160.  Sampled finely enough the lines are 1.46 and 1.06.
    """
    fine = shift("crank.bearing_clearance", torque=1e3, direction=1, theta=2 * np.pi * np.arange(4800) / 4800)
    folded, line = amplitudes(fine[::10]), amplitudes(fine)
    assert folded[80] == pytest.approx(1.9, rel=0.05)
    assert folded[160] == pytest.approx(1.6, rel=0.05)
    assert line[80] == pytest.approx(1.46, abs=0.01)
    assert line[160] == pytest.approx(1.06, abs=0.01)


def test_drive_and_coast_mirror_each_other() -> None:
    """Mirrored at the x axis theta becomes -theta, and a unit with both cranks and discs in line is its own image."""
    forward = shift("crank.bearing_clearance", torque=20e3, direction=1)
    reverse = shift("crank.bearing_clearance", torque=20e3, direction=-1)
    mirrored = np.roll(reverse[::-1], 1)
    np.testing.assert_allclose(forward, -mirrored, atol=1e-4)


def test_stiff_bearings_give_the_closed_form() -> None:
    """Bearings a thousandfold stiffer than pins; clearance far above their deflection, far below that of the pins."""
    stiff = Stiffness(pin_contact=2e5, crank_bearing=2e8, carrier_bearing=2e10, main_bearing=2e10, gear_mesh=2e7)
    unit = rverror.reducer("RV-40E", stiffness=stiff)
    for key in ("crank.bearing_clearance", "coupling.bearing_clearance"):
        found = shift(key, torque=412e3, direction=1, unit=unit, clearance=1e-4)
        closed = rverror.influence(unit, THETA, key, direction=1).matrix[0] * 1e-4 / ARCSEC
        assert np.sqrt(np.mean((found - closed) ** 2)) < 0.01 * np.sqrt(np.mean(closed**2))


@pytest.mark.parametrize("key", ["crank.bearing_clearance", "coupling.bearing_clearance"])
def test_forces_give_the_derivative_at_a_finite_clearance(key: str) -> None:
    errors = (
        effect_of("crank.bearing_clearance"),
        effect_of("coupling.bearing_clearance", 3e-3),
        rverror.effect("crank.eccentricity", crank=0, disc=1, radial="2 um"),
    )
    theta = THETA[::64]

    def output(change: float) -> np.ndarray:
        model = rverror.Model(UNIT, (*errors, effect_of(key, change)))
        return rverror.equilibrium(model, theta, torque=412e3, direction=1).transmission_error

    loaded = rverror.statics.linearise(rverror.Model(UNIT, errors), theta, torque=412e3, direction=1)
    found = source_matrix(loaded.motion, loaded.forces, key, {})[0]
    step = 1e-6
    difference = (output(2 * step) - output(step)) / step
    scale = np.sqrt(np.mean(difference**2))
    assert np.sqrt(np.mean((found - difference) ** 2)) < 1e-3 * scale


@pytest.mark.parametrize("clearance", [0.0, 1e-6, 0.1])
def test_no_clearance_a_trace_and_far_too_much(clearance: float) -> None:
    for unit in (UNIT, rverror.reducer("RV-003"), rverror.reducer("RV-40E", cranks=4)):
        model = rverror.Model(unit, (effect_of("crank.bearing_clearance", clearance),))
        theta = THETA[::128]
        state = rverror.equilibrium(model, theta, torque=20e3, direction=1)
        none = rverror.equilibrium(rverror.Model(unit), theta, torque=20e3, direction=1)
        lag = (none.transmission_error - state.transmission_error).mean()
        assert np.isfinite(state.transmission_error).all()
        if clearance == 0:
            assert abs(lag) < 1e-15
        else:
            # between the tangential part alone and the whole force: F/r6 and the closed form
            closed = -rverror.influence(unit, theta, "crank.bearing_clearance", direction=1).matrix[0].mean()
            assert 0.7 * closed < lag / clearance < 1.05 * closed


# --- without load -----------------------------------------------------------------------------------------------------

WAVE_OF_THREE = rverror.effect("cycloid.pin_circle", harmonic=3, radial_cos="5 um")


@pytest.mark.parametrize("place", [944, 3151])
def test_journals_that_float_beside_open_flanks_come_to_rest(place: int) -> None:
    """Nothing holds the cranks there: a whole Newton step led 1e10 mm away, and its halvings never back."""
    model = rverror.Model(UNIT, (effect_of("coupling.bearing_clearance", 2e-3), WAVE_OF_THREE))
    theta = np.array([2 * np.pi * place / 4095])
    found = rverror.statics.backlash(model, theta)
    assert found > rverror.statics.backlash(rverror.Model(UNIT, (WAVE_OF_THREE,)), theta)
    # the play ends where a small load begins to wind up
    assert found == pytest.approx(rverror.lost_motion(model, theta, percent=1e-4), abs=0.02 * ARCSEC)


SIZES_UM = st.floats(-8, 8)
GAPS_UM = st.floats(0.2, 20)
ORDINARY = st.one_of(
    st.tuples(st.just("coupling.bearing_clearance"), st.fixed_dictionaries({"clearance": GAPS_UM})),
    st.tuples(st.just("crank.bearing_clearance"), st.fixed_dictionaries({"clearance": GAPS_UM})),
    st.tuples(
        st.just("cycloid.pin_circle"),
        st.fixed_dictionaries({"harmonic": st.integers(1, 5), "radial_cos": SIZES_UM, "radial_sin": SIZES_UM}),
    ),
    st.tuples(
        st.just("cycloid.disc_bore_position"),
        st.fixed_dictionaries({"disc": st.just(0), "crank": st.just(1), "radial": SIZES_UM, "tangential": SIZES_UM}),
    ),
    st.tuples(
        st.just("cycloid.profile_modification"), st.fixed_dictionaries({"equidistant": GAPS_UM, "shift": GAPS_UM})
    ),
)


@settings(max_examples=8, deadline=None, derandomize=True)
@given(
    st.sampled_from(["RV-40E", "RV-003"]),
    st.sampled_from([2, 3]),
    st.lists(ORDINARY, min_size=1, max_size=3),
    st.floats(0, 6),
)
def test_backlash_of_ordinary_units_is_found(
    preset: str, cranks: int, errors: list[tuple[str, dict[str, float]]], first: float
) -> None:
    """The output gives way to more torque, so its play without load lies within its turn under any."""
    sized = [
        rverror.effect(key, **{n: v if isinstance(v, int) else f"{v} um" for n, v in named.items()})
        for key, named in errors
    ]
    model = rverror.Model(rverror.reducer(preset, cranks=cranks, rated_torque="412 N*m"), tuple(sized))
    theta = first + 0.01 * np.arange(3)
    free = rverror.statics.backlash(model, theta)
    assert (free >= 0).all()
    assert (free <= rverror.lost_motion(model, theta, percent=3)).all()


def test_what_is_wedged_has_no_play_and_none_below_it() -> None:
    """Pins on a circle that is shifted press a disc from two sides: nothing moves under a vanishing torque."""
    shifted = rverror.effect("cycloid.pin_circle", harmonic=1, radial_cos="3 um")
    free = rverror.statics.backlash(rverror.Model(UNIT, (shifted,)), 1.0 + 0.01 * np.arange(3))
    assert free[0] > 1e-6
    assert not np.signbit(free).any()
    np.testing.assert_array_equal(free[1:], 0.0)


def test_advice_fits_the_load(monkeypatch: pytest.MonkeyPatch) -> None:
    for limit in ("_MAX_STEPS", "_MAX_STEPS_NEAR", "_MAX_STEPS_UNLOADING"):
        monkeypatch.setattr(energy, limit, 0)
    model = rverror.Model(UNIT, (effect_of("crank.bearing_clearance"),))
    with pytest.raises(rverror.statics.NotConvergedError, match=r"far above 0\.1 mm$"):
        rverror.statics.backlash(model, [0.0])
    with pytest.raises(rverror.statics.NotConvergedError, match="or take a greater load"):
        rverror.lost_motion(model, [0.0])
