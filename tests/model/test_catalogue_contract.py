"""The contract that every entry of the catalogue keeps; a new source is covered by being in the catalogue."""

from __future__ import annotations

import importlib
import pickle
import re
from dataclasses import fields
from typing import Any

import numpy as np
import pytest

import rverror
from rverror import CATALOGUE, Drive, Effect, Model, Reducer
from rverror.base.units import CORE_UNITS
from rverror.geartrain.action_line import CONTACT_AXES, Clearance, Compliance, Contacts, ErrorVector
from rverror.geartrain.contacts import closed_form_forces, pose
from rverror.geartrain.mechanism import Mechanism
from rverror.geartrain.source import Source
from rverror.model.catalogue import source
from rverror.model.compose import source_matrix
from strategies import Array, scaled
from tried import index_sets, period_and_samples

#: Every source, with the names of indices and parameters that files and scripts outside use.
NAMES = {
    "involute.center_distance": ("crank", "radial tangential"),
    "involute.sun_eccentricity": ("", "x y"),
    "involute.sun_offset": ("", "x y"),
    "involute.planet_eccentricity": ("crank", "x y"),
    "involute.sun_pitch": ("harmonic", "cos sin"),
    "involute.planet_pitch": ("crank harmonic", "cos sin"),
    "involute.mesh_compliance": ("crank", "compliance"),
    "involute.sun_compliance_wave": ("harmonic", "cos sin"),
    "involute.planet_compliance_wave": ("crank harmonic", "cos sin"),
    "involute.tooth_thinning": ("member", "thinning"),
    "involute.spline_clearance": ("crank", "clearance"),
    "crank.eccentricity": ("crank disc", "radial tangential"),
    "crank.bearing_clearance": ("", "clearance"),
    "crank.bearing_compliance": ("crank disc", "compliance"),
    "crank.index": ("crank", "angle"),
    "cycloid.disc_profile": ("disc harmonic", "cos sin"),
    "cycloid.disc_pitch": ("disc harmonic", "cos sin"),
    "cycloid.disc_lobe": ("disc lobe", "deviation"),
    "cycloid.lobe_profile": ("disc harmonic", "cos sin"),
    "cycloid.pin_position": ("pin", "radial tangential"),
    "cycloid.pin_circle_tilt": ("", "x y"),
    "cycloid.pin_circle": ("harmonic", "radial_cos radial_sin tangential_cos tangential_sin"),
    "cycloid.pin_radius": ("pin", "deviation"),
    "cycloid.pin_compliance": ("pin", "compliance"),
    "cycloid.pin_compliance_wave": ("harmonic", "cos sin"),
    "cycloid.profile_modification": ("", "equidistant shift"),
    "cycloid.disc_bore_position": ("disc crank", "radial tangential"),
    "coupling.carrier_bore_position": ("crank", "radial tangential"),
    "coupling.bearing_clearance": ("", "clearance"),
    "coupling.bearing_compliance": ("crank", "compliance"),
    "coupling.carrier_runout": ("", "x y"),
    "thermal.growth": ("", "housing discs cranks carrier gears"),
    "load.torsion": ("", "compliance"),
    "sensor.encoder_eccentricity": ("", "cos sin"),
    "sensor.encoder_ellipticity": ("", "cos sin"),
    "sensor.input_coupling": ("harmonic", "cos sin"),
    "sensor.encoder_distortion": ("harmonic", "cos sin"),
    "sensor.output_tilt": ("", "x y"),
    "load.torsion_wave": ("harmonic", "cos sin"),
    "load.input_torsion_wave": ("harmonic", "cos sin"),
    "empirical.order_by_direction": ("frame harmonic", "cos sin"),
    "empirical.order_by_load": ("frame harmonic sense", "cos sin"),
    "sensor.index_offset": ("", "offset"),
    "sensor.ratio_error": ("", "slope"),
    "sensor.drift": ("", "total"),
    "sensor.time_offset": ("", "offset"),
    "shaft.eccentricity": ("shaft harmonic", "cos sin"),
    "empirical.order": ("frame harmonic", "cos sin"),
    "compensation.wave": ("order sense", "cos sin"),
}
#: Neither constant nor periodic: they grow along the run.
RAMPS = ("sensor.ratio_error", "sensor.drift")
#: What a source may need beside the angles, N*mm.
TORQUE = 20e3
#: A mechanism per kind: whole and broken ratios, two and three cranks, one disc and several.
MECHANISMS: dict[str, Mechanism] = {
    "RV-40E": rverror.reducer("RV-40E"),
    "RV-003": rverror.reducer("RV-003"),
    "broken ratio": rverror.reducer("RV-40E", planet_teeth=24, cranks=3),
    "one disc": rverror.reducer("RV-003", discs=1),
    "four discs": rverror.reducer("RV-003", discs=4),
    "drive": Drive(ratio=-14.0, shafts={"motor": 14.0, "idler": -3.5}),
}


CASES = [
    pytest.param(key, mechanism, id=f"{key} in {name}")
    for key, entry in CATALOGUE.items()
    for name, mechanism in MECHANISMS.items()
    if entry.applies_to(mechanism)
]
#: Where the number of discs and cranks does not matter.
FEW = [case for case in CASES if case.values[1] in (MECHANISMS["RV-40E"], MECHANISMS["drive"])]
ENTRIES = [pytest.param(key, entry, id=key) for key, entry in CATALOGUE.items()]


def sampled(mechanism: Mechanism) -> Array:
    turns, samples = period_and_samples(mechanism)
    return np.asarray(2 * np.pi * turns * np.arange(samples) / samples + 1.3e-4)


@pytest.fixture(scope="module")
def states() -> dict[tuple[int, int], Any]:
    """Pose and forces of each mechanism and direction over one true period, made once."""
    found = {}
    for mechanism in MECHANISMS.values():
        for direction in (1, -1):
            theta = sampled(mechanism)
            motion = pose(mechanism, theta, direction=direction, time=theta / 0.3, torque=TORQUE)
            found[id(mechanism), direction] = (motion, closed_form_forces(motion))
    return found


def frozen(motion: Any) -> list[bytes]:
    """What a pose was made with; what it works out from that when it is asked, it keeps beside."""
    given = [getattr(motion, field.name) for field in fields(motion)]
    return [array.tobytes() for array in given if isinstance(array, np.ndarray)]


@pytest.mark.parametrize(("key", "mechanism"), CASES)
def test_matrix(key: str, mechanism: Mechanism) -> None:
    """One row per parameter, float64, finite; the inputs as they were; the same again when asked again."""
    entry = CATALOGUE[key]
    theta = np.linspace(-1, 2, 37)
    before = theta.tobytes()
    for indices in index_sets(entry, mechanism):
        given = {"time": theta / 0.3, "torque": TORQUE}
        options: dict[str, Any] = {name: value for name, value in given.items() if name in entry.needs}
        found = rverror.influence(mechanism, theta, key, **options, **indices)
        assert found.matrix.shape == (len(entry.parameters), 37)
        assert found.matrix.dtype == np.float64
        assert np.isfinite(found.matrix).all()
        assert found.labels == tuple(p.name for p in entry.parameters)
        assert theta.tobytes() == before
        again = rverror.influence(mechanism, theta, key, **options, **indices)
        np.testing.assert_array_equal(again.matrix, found.matrix)
        found.matrix[:] = 0  # the caller's own; nothing shares it
        again = rverror.influence(mechanism, theta, key, **options, **indices)
        assert again.matrix.any() == (not np.array_equal(again.matrix, found.matrix))


@pytest.mark.parametrize(("key", "mechanism"), FEW)
def test_source_leaves_the_pose_alone_and_names_a_contact(key: str, mechanism: Mechanism) -> None:
    theta = np.linspace(-1, 2, 11)
    motion = pose(mechanism, theta, time=theta, torque=TORQUE)
    forces = closed_form_forces(motion)
    before, loads = frozen(motion), [f.tobytes() for f in forces.values()]
    for indices in index_sets(CATALOGUE[key], mechanism):
        error = CATALOGUE[key].vector(motion, **indices)
        for part in error if isinstance(error, tuple) else (error,):
            assert part.contact in CONTACT_AXES
            rows = part.share if isinstance(part, Compliance) else [0] if isinstance(part, Clearance) else part.vector
            terms = len(rows)
            assert terms == len(CATALOGUE[key].parameters)
        source_matrix(motion, forces, key, indices)
    assert frozen(motion) == before
    assert [f.tobytes() for f in forces.values()] == loads


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize(("key", "mechanism"), CASES)
def test_claimed_orders_are_the_strongest(
    key: str, mechanism: Mechanism, direction: int, states: dict[tuple[int, int], Any]
) -> None:
    """Orders found by a transform over one true period, so that each falls on a bin; none claimed, none there."""
    entry = CATALOGUE[key]
    turns, samples = period_and_samples(mechanism)
    motion, forces = states[id(mechanism), direction]
    for indices in index_sets(entry, mechanism):
        claimed = entry.orders(mechanism, indices)
        matrix = source_matrix(motion, forces, key, indices)
        if key in RAMPS:
            assert claimed == ()
            np.testing.assert_allclose(np.diff(matrix, n=2), 0, atol=1e-12 * np.ptp(matrix))
            assert np.ptp(matrix) > 0
            continue
        steady = matrix.mean(axis=1, keepdims=True)
        if not claimed:
            scale = max(np.abs(matrix).max(), natural_size(mechanism, entry))
            assert np.abs(matrix - steady).max() < 1e-9 * scale, indices
            continue
        lines = np.sqrt((np.abs(np.fft.rfft(matrix - steady)) ** 2).sum(axis=0))
        strongest = np.argsort(-lines)[: len(claimed)] / turns
        np.testing.assert_allclose(claimed, strongest, rtol=1e-12, err_msg=str(indices))
        assert max(claimed) < samples / turns / 2


def natural_size(mechanism: Mechanism, entry: Source) -> float:
    """Output angle that one unit of a parameter could make: below it a value is rounding, not an effect."""
    dimension = entry.parameters[0].dimension
    if dimension == "length" and isinstance(mechanism, Reducer):
        return 1 / (mechanism.ratio * mechanism.sun_pitch_radius)
    if dimension == "contact_compliance" and isinstance(mechanism, Reducer):
        return TORQUE / (mechanism.ratio * mechanism.sun_pitch_radius) ** 2
    return {"temperature_rise": 1e-6, "compliance": TORQUE}.get(dimension, 1e-3)


@pytest.mark.parametrize("factor", [0.1, 7.0])
@pytest.mark.parametrize("name", ["RV-40E", "one disc"])
def test_homogeneous_in_length(name: str, factor: float) -> None:
    """All lengths times s: columns per mm times 1/s, per mm/N times 1/s^2, the rest as it was."""
    small = MECHANISMS[name]
    assert isinstance(small, Reducer)
    theta = np.linspace(0.1, 2.5, 41)
    states = []
    for unit in (small, scaled(small, factor)):
        motion = pose(unit, theta, time=theta, torque=TORQUE)
        assert isinstance(motion, Contacts)
        states.append((motion, closed_form_forces(motion)))
    for key, entry in CATALOGUE.items():
        if not entry.applies_to(small):
            continue
        for indices in index_sets(entry, small):
            one, other = (source_matrix(*state, key, indices) for state in states)
            powers = {"length": 1, "contact_compliance": 2}
            power = np.array([powers.get(p.dimension, 0) for p in entry.parameters])[:, None]
            expected = one / factor**power
            size = natural_size(small, entry) / factor ** power.max()
            np.testing.assert_allclose(other, expected, rtol=1e-9, atol=1e-9 * size, err_msg=f"{key} {indices}")


@pytest.mark.parametrize(("key", "entry"), ENTRIES)
def test_entry_describes_itself(key: str, entry: Source) -> None:
    assert entry.key == key
    assert entry.reference.strip()
    assert entry.summary.strip()
    assert "\n" not in entry.summary
    assert entry.frame in {
        "housing", "carrier", "disc", "crank", "planet", "sun", "output", "shaft", "direction", "bearing",
    }  # fmt: skip
    assert entry.parameters
    for parameter in entry.parameters:
        assert parameter.dimension in CORE_UNITS
        assert 0 < parameter.plausible < np.inf
    assert len({p.dimension for p in entry.parameters}) == 1  # one uncertainty serves all components
    names = [i.name for i in entry.indices] + [p.name for p in entry.parameters]
    assert len(names) == len(set(names))
    taken = {"direction", "time", "torque", "forces", "key", "uncertainty", "origin"}  # by the calls they pass through
    assert not taken & set(names)


@pytest.mark.parametrize(("key", "entry"), ENTRIES)
def test_key_is_module_and_function(key: str, entry: Source) -> None:
    module, function = key.split(".")
    assert entry.vector.__module__.rpartition(".")[2] == module
    assert entry.vector is getattr(importlib.import_module(entry.vector.__module__), function)
    text = entry.vector.__doc__ or ""
    assert "Parameters\n" in text
    assert "Returns\n" in text
    for parameter in entry.parameters:
        assert parameter.name in text or {"cos", "sin"} >= {parameter.name}, parameter.name


@pytest.mark.parametrize(("key", "entry"), ENTRIES)
def test_what_is_at_the_output_is_what_no_contact_feels(key: str, entry: Source) -> None:
    unit = next(unit for unit in MECHANISMS.values() if entry.applies_to(unit))
    theta = np.linspace(0, 1, 5)
    motion = pose(unit, theta, time=theta, torque=TORQUE)
    error = entry.vector(motion, **index_sets(entry, unit)[0])
    parts = error if isinstance(error, tuple) else (error,)
    felt = {part.contact for part in parts if isinstance(part, (ErrorVector, Compliance))}
    assert entry.at_output == (felt == {"output"})
    assert entry.at_output or "output" not in felt


@pytest.mark.parametrize(("key", "entry"), ENTRIES)
def test_names_that_files_use(key: str, entry: Source) -> None:
    assert key in NAMES, f"add {key} with its indices and parameters to NAMES in tests/model/test_catalogue_contract.py"
    indices, parameters = NAMES[key]
    assert [i.name for i in entry.indices] == indices.split()
    assert [p.name for p in entry.parameters] == parameters.split()


@pytest.mark.parametrize(("key", "entry"), ENTRIES)
def test_reference_says_where_it_comes_from(key: str, entry: Source) -> None:
    """A source text by number, or none of them and what instead."""
    known = r"(none: |measuring chain$|any drive$|00[0-4]\b)"
    assert re.match(known, entry.reference), f"{key}: {entry.reference!r}; give a source text's number, or 'none: '"


def test_catalogue_is_complete_and_closed() -> None:
    assert set(NAMES) == set(CATALOGUE)
    with pytest.raises(TypeError):
        CATALOGUE["new"] = CATALOGUE["crank.index"]  # type: ignore[index]


def effect_of(entry: Source, mechanism: Mechanism) -> Effect:
    indices = index_sets(entry, mechanism)[-1]
    values = {p.name: 0.5 * p.plausible * (i + 1) for i, p in enumerate(entry.parameters)}
    return rverror.effect(entry.key, uncertainty=1e-4, origin="test", **indices, **values)


@pytest.mark.parametrize(("key", "mechanism"), FEW)
def test_effect_and_model_survive_a_pickle(key: str, mechanism: Mechanism) -> None:
    """A source travels as its key."""
    entry = CATALOGUE[key]
    one = effect_of(entry, mechanism)
    model = Model(mechanism, (one,), name="unit")
    back = pickle.loads(pickle.dumps(model))
    assert back == model
    assert back.effects[0] == one
    assert source(back.effects[0].key) is entry
    theta = np.linspace(0, 1, 9)
    te = [rverror.transmission_error(m, theta, time=theta, torque=TORQUE) for m in (model, back)]
    np.testing.assert_array_equal(*te)
    found = rverror.influence(mechanism, theta, key, time=theta, torque=TORQUE, **one.indices)
    expected = np.array(one.values) @ found.matrix
    np.testing.assert_allclose(te[0], expected, rtol=1e-12, atol=1e-20)


@pytest.mark.parametrize(("key", "mechanism"), FEW)
def test_bad_index_is_named(key: str, mechanism: Mechanism) -> None:
    entry = CATALOGUE[key]
    good = index_sets(entry, mechanism)[0]
    theta = np.linspace(0, 1, 5)
    with pytest.raises(ValueError, match=rf"{key}.*'colour'"):
        rverror.influence(mechanism, theta, key, **good, colour=1)
    for name in good:
        for wrong in (-1, 10_000, "none", True, 0.5, None):
            with pytest.raises(ValueError, match=rf"{key}: {name} = .*must be one of"):
                rverror.influence(mechanism, theta, key, **(good | {name: wrong}))
        without = {k: v for k, v in good.items() if k != name}
        with pytest.raises(ValueError, match=rf"{key}: index '{name}' is missing"):
            rverror.influence(mechanism, theta, key, **without)


def test_index_is_no_float() -> None:
    """1.0 equals 1 but selects nothing from an array: it must be refused by name, not fail later."""
    with pytest.raises(ValueError, match=r"crank.index: crank = 1.0; it must be one of"):
        rverror.influence(MECHANISMS["RV-40E"], [0.0, 1.0], "crank.index", crank=1.0)  # type: ignore[arg-type]


@pytest.mark.parametrize(("key", "mechanism"), CASES)
def test_candidates_are_valid_and_differ(key: str, mechanism: Mechanism) -> None:
    entry = CATALOGUE[key]
    found = list(entry.candidates(mechanism))
    assert found
    for indices in found:
        entry.check_indices(mechanism, indices)
    assert len({tuple(i.items()) for i in found}) == len(found)


@pytest.mark.parametrize(("key", "entry"), ENTRIES)
def test_source_refuses_the_other_kind_of_mechanism(key: str, entry: Source) -> None:
    for mechanism in (MECHANISMS["RV-40E"], MECHANISMS["drive"]):
        if not entry.applies_to(mechanism):
            with pytest.raises(ValueError, match=f"{key} does not act"):
                entry.check_mechanism(mechanism)


def test_unknown_key_names_the_nearest() -> None:
    with pytest.raises(ValueError, match=r"no error source 'crank.eccentricty'; did you mean 'crank.eccentricity'"):
        source("crank.eccentricty")
    with pytest.raises(ValueError, match="no error source 'zzz'"):
        source("zzz")


@pytest.mark.parametrize(
    ("named", "message"),
    [
        ({"crank": 0, "disc": 0}, "no parameter given"),
        ({"crank": 0, "disc": 0, "radius": 1.0}, "no index or parameter 'radius'"),
        ({"crank": 0, "disc": 0, "radial": "5 deg"}, "radial: 'deg' is no unit of length"),
        ({"crank": 0, "disc": 0, "radial": 0.1, "uncertainty": -1.0}, "uncertainty = -1.0: must be 0 or more"),
    ],
)
def test_effect_refuses(named: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        rverror.effect("crank.eccentricity", **named)


@pytest.mark.parametrize(("key", "mechanism"), CASES)
def test_effect_refuses_an_index_that_no_mechanism_has(key: str, mechanism: Mechanism) -> None:
    """What needs no mechanism is refused where it is written; the rest, such as a third crank, where there is one."""
    entry = rverror.CATALOGUE[key]
    good = next(iter(entry.candidates(mechanism)))
    size = {entry.parameters[0].name: entry.parameters[0].plausible / 2}
    assert rverror.effect(key, **good, **size).indices == good
    for name in good:
        for wrong in (-1, True, 0.5, None):
            with pytest.raises(ValueError, match=rf"^{key}: {name} = {wrong}; it must be "):
                rverror.effect(key, **(good | {name: wrong}), **size)


def test_model_refuses_an_effect_of_a_part_it_lacks() -> None:
    far = rverror.effect("crank.index", crank=2, angle="1 arcmin")
    Model(MECHANISMS["RV-003"], (far,))
    with pytest.raises(ValueError, match=r"crank.index: crank = 2; it must be one of 0, 1, counted from 0"):
        Model(MECHANISMS["RV-40E"], (far,))
    assert Model(MECHANISMS["RV-003"]).with_effects(far, far).effects == (far, far)


def test_spline_clearance_needs_the_spline() -> None:
    bare = rverror.reducer("RV-40E", spline_radius=None)
    with pytest.raises(ValueError, match=r"spline_clearance needs .*spline_radius"):
        rverror.influence(bare, [0.0, 1.0], "involute.spline_clearance", crank=0)


def test_time_offset_needs_time() -> None:
    with pytest.raises(ValueError, match=r"time_offset needs time"):
        rverror.influence(MECHANISMS["RV-40E"], [0.0, 1.0], "sensor.time_offset")
    with pytest.raises(ValueError, match=r"two different times"):
        rverror.influence(MECHANISMS["RV-40E"], [0.0, 1.0], "sensor.time_offset", time=[3.0, 3.0])


def test_measuring_chain() -> None:
    """Readings need no gear train: eccentricity, scale, delay and drift by their definitions."""
    drive = MECHANISMS["drive"]
    theta, time = np.linspace(0, -7, 50), np.linspace(2, 12, 50)

    def rows(key: str, **options: Any) -> Array:
        return rverror.influence(drive, theta, key, **options).matrix

    np.testing.assert_allclose(rows("sensor.encoder_eccentricity"), [np.cos(theta), np.sin(theta)])
    np.testing.assert_allclose(rows("sensor.encoder_ellipticity"), [np.cos(2 * theta), np.sin(2 * theta)])
    coupling = rows("sensor.input_coupling", harmonic=2)
    np.testing.assert_allclose(-14 * coupling, [np.cos(28 * theta), np.sin(-28 * theta)], atol=1e-12)
    np.testing.assert_allclose(rows("sensor.ratio_error")[0], theta)
    np.testing.assert_allclose(rows("sensor.drift", time=time)[0], (time - 2) / 10, atol=1e-12)
    np.testing.assert_allclose(rows("sensor.drift")[0], np.arange(50) / 49)
    np.testing.assert_allclose(rows("sensor.time_offset", time=time), -0.7, rtol=1e-12)
    wave = rows("shaft.eccentricity", shaft="idler", harmonic=3)
    np.testing.assert_allclose(wave, [np.cos(10.5 * theta), -np.sin(10.5 * theta)], atol=1e-12)


@pytest.mark.parametrize("direction", [1, -1])
def test_play_lags_either_way(direction: int) -> None:
    """Half the play on either flank: lost motion thinning / (r1 R), and clearance / r_s (z2/z1) / R for all splines."""
    for name, r1, ratio in (("RV-40E", 6.75, 121), ("RV-003", 12.0, 101)):
        unit = MECHANISMS[name]
        assert isinstance(unit, Reducer)
        for member in ("sun", "planet"):
            worn = rverror.influence(unit, [0.0, 1.0], "involute.tooth_thinning", direction=direction, member=member)
            np.testing.assert_allclose(worn.matrix, -direction * 0.5 / (r1 * ratio), rtol=1e-12)
        play = [
            rverror.influence(unit, [0.0, 1.0], "involute.spline_clearance", direction=direction, crank=j).matrix
            for j in range(unit.cranks)
        ]
        step = unit.planet_teeth / unit.sun_teeth / ratio
        np.testing.assert_allclose(np.sum(play, axis=0), -direction * 0.5 / 7 * step, rtol=1e-12)


def test_published_slopes_of_wear_and_spline_play() -> None:
    """Measured on the three-crank unit: 157 arcsec per mm of sun wear, 45 to 80 arcsec over 0.046 to 0.097 mm."""
    per_arcsec = 180 * 3600 / np.pi
    unit = MECHANISMS["RV-003"]
    wear, play = (
        np.array(
            [
                sum(
                    rverror.influence(unit, [0.0, 1.0], key, direction=d, **indices).matrix[0, 0]
                    for indices in index_list
                )
                for d in (1, -1)
            ]
        )
        for key, index_list in (
            ("involute.tooth_thinning", [{"member": "sun"}]),
            ("involute.spline_clearance", [{"crank": j} for j in range(3)]),
        )
    )
    assert np.ptp(wear) * per_arcsec == pytest.approx(157, rel=0.09)
    assert np.ptp(play) * per_arcsec == pytest.approx((80 - 45) / (0.097 - 0.046), rel=0.07)


def test_center_distance_of_the_article() -> None:
    """Articles give 0.9 arcsec for a radial 5 um at one planet, as open single step 2 e tan(alpha) / (41 r2)."""
    unit = MECHANISMS["RV-40E"]
    one = rverror.influence(unit, [0.0, 1.0], "involute.center_distance", direction=1, crank=0).matrix
    step = np.tan(np.radians(20)) / (2 * 121 * 6.75)  # of two planets, r2 (z1/z2) = r1
    np.testing.assert_allclose(one[0], -step, rtol=1e-9)
    np.testing.assert_allclose(one[1], -1 / (2 * 121 * 6.75), rtol=1e-9)
