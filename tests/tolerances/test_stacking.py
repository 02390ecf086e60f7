"""Tolerances and stacks: draws against their covariance, influences against the composer, what is refused."""

from __future__ import annotations

import pickle
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.stats import qmc

import rverror
from rverror.base.errors import InputError
from rverror.model.catalogue import CATALOGUE, source
from rverror.tolerances.declared import PAIRS, Tolerance, tolerance
from rverror.tolerances.distribution import (
    Circle,
    Distribution,
    Normal,
    Rayleigh,
    Ring,
    SampledAmplitude,
    Samples,
    Triangular,
    TruncatedNormal,
    Uniform,
)
from rverror.tolerances.sampling_rule import SamplingRule
from rverror.tolerances.stacking import Stack, stack
from stack_covariance import of_rule, of_stack

UNIT = rverror.Model(rverror.reducer("RV-40E"))
THETA = np.linspace(0, 2 * np.pi, 64, endpoint=False)
MEASURED = (1e-3, 1.5e-3, 2e-3, 7e-3, 2.2e-3)
SCALARS = (Uniform(), Triangular(), Normal(), TruncatedNormal(0.5), Rayleigh(1.3), Samples(MEASURED))
PLANES = (Circle(), Ring(), SampledAmplitude(MEASURED))
#: Distribution, correlation, random phase: all that a rule can be.
CASES = [
    *product(SCALARS, (0.0, 0.3, 0.8, 1.0), (False, True)),
    *product(PLANES, (0.0, 1.0), (False, True)),
]


def points(dimensions: int, log2: int = 15) -> np.ndarray:
    return qmc.Sobol(dimensions, seed=5).random_base2(log2)


def named(case: tuple[Distribution, float, bool]) -> str:
    return f"{case[0].name} {case[1]} {case[2]}"


# --- draws ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("case", CASES, ids=named)
def test_draws_have_the_covariance_of_the_rule(case: tuple[Distribution, float, bool]) -> None:
    law, correlation, phase = case
    rule = SamplingRule(0, 0, 2, 2, law, correlation, phase)
    drawn = rule.standard(points(rule.variates.stop))
    assert drawn.shape == (2**15, 4)
    np.testing.assert_allclose(drawn.mean(axis=0), 0, atol=2e-3)
    np.testing.assert_allclose(np.cov(drawn.T), of_rule(rule), atol=3e-3 * max(1, law.variance))


@pytest.mark.parametrize("law", SCALARS, ids=lambda law: law.name)
@given(correlation=st.floats(0.05, 0.95))
@settings(max_examples=5, deadline=None)
def test_correlation_asked_is_the_pearson_correlation_of_the_values(law: Distribution, correlation: float) -> None:
    rule = SamplingRule(0, 0, 3, 1, law, correlation)
    got = np.corrcoef(rule.standard(points(4)).T)
    np.testing.assert_allclose(got[np.triu_indices(3, 1)], correlation, atol=4e-3)


def test_full_correlation_is_one_value_for_all_instances() -> None:
    for law in (*SCALARS, *PLANES):
        drawn = SamplingRule(0, 0, 3, 2, law, 1.0).standard(points(2, 4)[:, : 1 if law.name == "ring" else 2])
        np.testing.assert_array_equal(drawn[:, :2], drawn[:, 2:4])
        np.testing.assert_array_equal(drawn[:, :2], drawn[:, 4:])


def test_random_phase_leaves_the_lengths_and_takes_the_rest() -> None:
    rule = SamplingRule(0, 0, 2, 2, Rayleigh(), 1.0, True)
    a, b = np.moveaxis(rule.standard(points(rule.variates.stop, 12)).reshape(-1, 2, 2), 1, 0)
    np.testing.assert_allclose(np.hypot(*a.T), np.hypot(*b.T), rtol=1e-12)
    turn = np.angle((a[:, 0] + 1j * a[:, 1]) / (b[:, 0] + 1j * b[:, 1]))
    assert np.histogram(turn, bins=8, range=(-np.pi, np.pi))[0] == pytest.approx(512, abs=60)


def test_random_phase_takes_no_variates_where_phases_are_random_anyway() -> None:
    for law, free in ((Rayleigh(), True), (Circle(), True), (Ring(), True), (Normal(), False), (Uniform(), False)):
        plain, turned = (SamplingRule(0, 0, 4, 2, law, 0.0, phase).variates.stop for phase in (False, True))
        assert (plain == turned) == free


@given(st.lists(st.sampled_from(CASES), min_size=1, max_size=6), st.integers(1, 4))
@settings(max_examples=30, deadline=None)
def test_rules_share_out_variates_and_components_without_a_rest(
    cases: list[tuple[Distribution, float, bool]], instances: int
) -> None:
    rules: list[SamplingRule] = []
    for law, correlation, phase in cases:
        last = rules[-1] if rules else None
        first = (last.variates.stop, last.components.stop) if last else (0, 0)
        rules.append(SamplingRule(*first, instances, 2, law, correlation, phase))
    count = rules[-1].components.stop
    entry = np.repeat(np.arange(len(rules)), 2 * instances)
    made = Stack(np.zeros(3), np.ones((count, 3)), (), entry, np.ones(len(rules)), ("",) * len(rules), tuple(rules))
    drawn = made.standard(np.random.default_rng(0).random((5, made.dimensions)))
    assert drawn.shape == (5, count)
    assert np.isfinite(drawn).all()
    assert made.variate_entry.size == made.dimensions
    assert np.array_equal(np.unique(made.variate_entry), np.arange(len(rules)))
    grouped = np.concatenate([group.components.ravel() for group in made.worst_groups])
    assert np.array_equal(np.sort(grouped), np.arange(count))
    assert of_stack(made).shape == (count, count)


def test_a_variate_moves_its_own_entry_alone() -> None:
    made = stack(
        UNIT, [tolerance("crank.eccentricity", "5 um", correlation=0.5), tolerance("crank.index", "1 arcmin")], THETA
    )
    uniforms = np.full((2, made.dimensions), 0.4)
    for variate, entry in enumerate(made.variate_entry):
        changed = uniforms.copy()
        changed[1, variate] = 0.9
        a, b = made.standard(changed)
        assert set(made.entry[a != b]) == {entry}


# --- the worst case's groups ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("law", "correlation", "phase", "kind", "shapes", "radius"),
    [
        (Normal(), 0.0, False, "box", [(1, 1)] * 4, 1.0),
        (Normal(), 0.9, False, "box", [(1, 1)] * 4, 1.0),
        (Normal(), 1.0, False, "box", [(2, 1)] * 2, 1.0),
        (Uniform(), 1.0, True, "circle", [(1, 2)] * 2, 2**0.5),
        (Rayleigh(), 0.0, False, "circle", [(1, 2)] * 2, 1.0),
        (Rayleigh(), 1.0, False, "circle", [(2, 2)], 1.0),
        (Ring(), 1.0, True, "circle", [(1, 2)] * 2, 1.0),
    ],
)
def test_groups(
    law: Distribution, correlation: float, phase: bool, kind: str, shapes: list[tuple[int, int]], radius: float
) -> None:
    groups = SamplingRule(0, 3, 2, 2, law, correlation, phase).worst_groups()
    assert [g.components.shape for g in groups] == shapes
    assert {g.kind for g in groups} == {kind}
    assert {g.radius for g in groups} == {radius}
    assert sorted(i for g in groups for i in g.components.ravel()) == [3, 4, 5, 6]


@pytest.mark.parametrize("case", [c for c in CASES if c[0].name not in ("normal", "rayleigh")], ids=named)
def test_bounded_draws_stay_in_their_groups(case: tuple[Distribution, float, bool]) -> None:
    rule = SamplingRule(0, 0, 2, 2, *case)
    drawn = rule.standard(points(rule.variates.stop, 10))
    for group in rule.worst_groups():
        for instance in group.components:
            assert np.hypot.reduce(drawn[:, instance], axis=1).max() <= group.radius + 1e-12


# --- the stack --------------------------------------------------------------------------------------------------------

MIXED = (
    tolerance("crank.eccentricity", "5 um", disc=1),
    tolerance("cycloid.pin_radius", "3 um", distribution="uniform"),
    tolerance("cycloid.disc_pitch", "4 um", harmonic=[1, 3], mean={"cos": "1 um"}, distribution="normal"),
    tolerance("crank.bearing_clearance", "2 um", mean="6 um"),
    tolerance("involute.tooth_thinning", "10 um", member="sun"),
    tolerance("sensor.encoder_eccentricity", "3 arcsec", parameters=["sin"]),
    tolerance("thermal.growth", "2 K", mean={"discs": "5 K"}),
    tolerance("load.torsion", "0.1 arcsec/(N*m)", mean="0.3 arcsec/(N*m)"),
)


@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize("offset", ["0 deg", "25 deg"])
def test_a_unit_of_the_stack_is_the_model_with_its_values_as_effects(direction: float, offset: str) -> None:
    """TE = nominal + x @ influence, against the composer with one effect for each instance."""
    declared = rverror.effect("cycloid.pin_position", pin=3, radial="8 um")
    model = UNIT.with_effects(declared, rverror.effect("sensor.index_offset", offset=offset))
    made = stack(model, MIXED, THETA, direction=direction, torque="20 N*m")
    x = made.standard(np.random.default_rng(1).random((1, made.dimensions)))[0] * made.width[made.entry]
    effects = []
    for value, component, entry in zip(x, made.components, made.entry, strict=True):
        mean = MIXED[entry].mean.get(component.parameter, 0.0)
        values = tuple(value + mean if p.name == component.parameter else 0.0 for p in source(component.key).parameters)
        effects.append(rverror.Effect(component.key, component.indices, values))
    expected = rverror.transmission_error(model.with_effects(*effects), THETA, direction=direction, torque="20 N*m")
    np.testing.assert_allclose(made.nominal + x @ made.influence, expected, rtol=0, atol=1e-15)


def test_components_that_only_shift_are_exactly_constant_and_those_that_do_nothing_exactly_zero() -> None:
    made = stack(
        UNIT, [tolerance("coupling.carrier_bore_position", "5 um"), tolerance("involute.sun_offset", "5 um")], THETA
    )
    assert (np.ptp(made.influence, axis=1) == 0).all()
    assert (made.influence[made.entry == 1] == 0).all()
    bores = made.influence[made.entry == 0]
    expected = rverror.influence(UNIT.mechanism, THETA, "coupling.carrier_bore_position", crank=0).matrix
    np.testing.assert_allclose(bores[:2], expected, atol=1e-16)


def test_all_instances_unless_given() -> None:
    def count(**given: object) -> int:
        return len(tolerance("crank.eccentricity", "5 um", **given).instances(UNIT.mechanism))  # type: ignore[arg-type]

    assert (count(), count(disc=0), count(disc=[0, 1], crank=1)) == (4, 2, 2)
    pins = tolerance("cycloid.pin_radius", "5 um").instances(UNIT.mechanism)
    assert [i["pin"] for i in pins] == list(range(40))  # "all" is another way to say it
    assert len(tolerance("involute.tooth_thinning", "5 um").instances(UNIT.mechanism)) == 2


def test_all_pins_together_are_one_pin_entry_of_full_correlation() -> None:
    one, each = (
        stack(UNIT, [item], THETA)
        for item in (
            tolerance("cycloid.pin_radius", "5 um", pin="all"),
            tolerance("cycloid.pin_radius", "5 um", correlation=1),
        )
    )
    np.testing.assert_allclose(each.influence.sum(axis=0), one.influence[0], atol=1e-16)
    assert each.dimensions == one.dimensions == 1


def test_default_distribution_is_for_vectors_where_all_are() -> None:
    found = {
        key: tolerance(
            key,
            1e-3,
            mean=1.0 if known.parameters[0].least == 0 else None,
            **({"harmonic": 1} if any(i.name == "harmonic" for i in known.indices) else {}),
        ).distribution
        for key, known in CATALOGUE.items()
        if key != "sensor.index_offset"
    }
    assert found["crank.eccentricity"] == Rayleigh()
    assert found["cycloid.pin_circle"] == Rayleigh()  # two vectors
    assert found["cycloid.profile_modification"] == Normal()
    assert found["crank.bearing_clearance"] == Normal()
    for key, law in found.items():
        names = [p.name for p in CATALOGUE[key].parameters]
        assert (law.name == "rayleigh") == (
            len(names) % 2 == 0 and all(pair in PAIRS for pair in zip(names[::2], names[1::2], strict=True))
        )
    assert tolerance("crank.eccentricity", "5 um", parameters=["radial"]).distribution == Normal()


def test_samples_bring_width_and_mean() -> None:
    item = tolerance("crank.index", samples=["1 arcmin", "2 arcmin", "6 arcmin"])
    arcmin = np.pi / 180 / 60
    assert item.width == pytest.approx(3 * arcmin)
    made = stack(UNIT, [item], THETA)
    bare = stack(UNIT, [tolerance("crank.index", "1 arcmin")], THETA)
    np.testing.assert_allclose(made.nominal, 3 * arcmin * bare.influence.sum(axis=0), atol=1e-16)
    lengths = tolerance("crank.eccentricity", samples=["1 um", "4 um"], phase="random")
    assert (lengths.width, lengths.mean) == (pytest.approx(4e-3), {})
    assert lengths.distribution == SampledAmplitude((1e-3, 4e-3))


def test_labels_tell_entries_apart() -> None:
    items = [
        tolerance("cycloid.pin_radius", "5 um"),
        tolerance("cycloid.pin_radius", "2 um"),
        tolerance("crank.eccentricity", "5 um", disc=0, parameters=["radial"]),
    ]
    made = stack(UNIT, items, THETA)
    assert made.labels == ("cycloid.pin_radius #1", "cycloid.pin_radius #2", "crank.eccentricity(disc=0).radial")
    assert str(made.components[-1]) == "crank.eccentricity(crank=1, disc=0).radial"


def test_scaled_takes_other_widths() -> None:
    made = stack(UNIT, MIXED[:2], THETA)
    np.testing.assert_allclose(made.scaled(), made.influence * np.where(made.entry == 0, 5e-3, 3e-3)[:, None])
    np.testing.assert_allclose(made.scaled(2 * made.width), 2 * made.scaled())


def test_stack_and_tolerance_pickle() -> None:
    made = stack(UNIT, MIXED[:3], THETA)
    again = pickle.loads(pickle.dumps(made))
    uniforms = np.random.default_rng(2).random((3, made.dimensions))
    np.testing.assert_array_equal(again.standard(uniforms), made.standard(uniforms))
    assert pickle.loads(pickle.dumps(MIXED)) == MIXED


def test_a_drive_without_gears_has_tolerances_too() -> None:
    drive = rverror.Model(rverror.Drive(ratio=-14.0, shafts={"motor": 14.0}))
    made = stack(drive, [tolerance("shaft.eccentricity", "2 arcmin", harmonic=1)], THETA)
    assert made.influence.shape == (2, 64)


def test_default_angles_are_one_revolution() -> None:
    made = stack(UNIT, MIXED[:1])
    assert made.theta is not None
    assert made.theta.size == 4096
    assert made.theta[-1] + made.theta[1] == pytest.approx(2 * np.pi)


def test_span_is_a_tenth_to_ten_times_and_keeps_clearances() -> None:
    assert tolerance("crank.eccentricity", "2 um").span == pytest.approx((2e-4, 2e-2))
    assert tolerance("crank.eccentricity", "5 um").span == pytest.approx((5e-4, 3e-2))  # no workshop's part is worse
    assert tolerance("crank.eccentricity", "50 um").span == pytest.approx((5e-3, 5e-2))  # but what is given may be
    assert tolerance("crank.bearing_clearance", "2 um", mean="6 um").span == pytest.approx((2e-4, 6e-3))
    assert tolerance("crank.eccentricity", "5 um", bounds=("2 um", "8 um")).span == pytest.approx((2e-3, 8e-3))


REFUSED = [
    (lambda: tolerance("crank.excentricity", "5 um"), "did you mean 'crank.eccentricity'"),
    (lambda: tolerance("crank.eccentricity"), "no tolerance"),
    (lambda: tolerance("crank.eccentricity", "5 arcsec"), "tolerance: .*no unit of length"),
    (lambda: tolerance("crank.eccentricity", "-5 um"), "tolerance = -0.005: must be above 0"),
    (lambda: tolerance("crank.eccentricity", "5 um", lobe=3), "no index 'lobe'"),
    (lambda: tolerance("crank.eccentricity", "5 um", parameters=["radail"]), "did you mean 'radial'"),
    (lambda: tolerance("crank.eccentricity", "5 um", distribution="gauss"), "no distribution 'gauss'"),
    (lambda: tolerance("crank.eccentricity", "5 um", distribution="ring", capability=2), "capability beside"),
    (lambda: tolerance("crank.eccentricity", "5 um", capability=0), "capability = 0"),
    (lambda: tolerance("crank.eccentricity", "5 um", correlation=1.5), "correlation = 1.5: must be from 0 to 1"),
    (lambda: tolerance("crank.eccentricity", "5 um", correlation=-0.1), "correlation = -0.1"),
    (lambda: tolerance("crank.eccentricity", "5 um", distribution="circle", correlation=0.5), "use 'rayleigh'"),
    (lambda: tolerance("crank.eccentricity", "5 um", phase="free"), "phase = 'free': must be 'random'"),
    (lambda: tolerance("crank.eccentricity", "5 um", phase="random", mean={"radial": "1 um"}), "is no mean"),
    (lambda: tolerance("crank.eccentricity", "5 um", mean="1 um"), "which parameter"),
    (lambda: tolerance("crank.eccentricity", "5 um", mean={"x": "1 um"}), "mean of 'x'"),
    (lambda: tolerance("crank.index", "5 arcsec", phase="random"), "angle is none; leave phase out"),
    (lambda: tolerance("crank.index", "5 arcsec", distribution="rayleigh"), "is for vectors, and angle is none"),
    (lambda: tolerance("crank.eccentricity", "5 um", parameters=["radial"], distribution="circle"), "radial is none"),
    (lambda: tolerance("crank.bearing_clearance", "5 um"), "down to -5 um, below 0; give a mean of 5 um"),
    (lambda: tolerance("crank.bearing_clearance", samples=["-1 um", "3 um"]), "down to -1 um, below 0"),
    (lambda: tolerance("crank.bearing_clearance", "2 um", mean="5 um", bounds=("1 um", "6 um")), "give 5 um or less"),
    (lambda: tolerance("crank.eccentricity", "2 um", bounds=("3 um", "1 um")), "the smaller first"),
    (lambda: tolerance("crank.index", "2 arcsec", samples=["3 arcsec", "1 arcsec"]), "tolerance beside samples"),
    (lambda: tolerance("crank.index", samples=["3 arcsec", "1 arcsec"], mean="1 arcsec"), "mean beside samples"),
    (lambda: tolerance("crank.eccentricity", samples=["-3 um", "1 um"], phase="random"), "is no length"),
    (lambda: tolerance("sensor.index_offset", "1 deg"), "leave it out"),
    (lambda: stack(UNIT, [], THETA), "no tolerance"),
    (lambda: stack(UNIT, [tolerance("cycloid.disc_pitch", "5 um")], THETA), "no harmonic; give which ones"),
    (lambda: stack(UNIT, [tolerance("crank.eccentricity", "5 um", disc=2)], THETA), "disc = 2; it must be one of 0, 1"),
    (lambda: stack(UNIT, [tolerance("shaft.eccentricity", "5 arcsec", harmonic=1)], THETA), "does not act"),
]


@pytest.mark.parametrize(("make", "said"), REFUSED, ids=[said for _, said in REFUSED])
def test_what_does_not_go_together_is_refused(make: object, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        make()  # type: ignore[operator]


def test_a_tolerance_made_by_hand_is_checked_too() -> None:
    with pytest.raises(InputError, match="no index 'lobe'"):
        Tolerance("crank.eccentricity", 5e-3, Rayleigh(), {"lobe": 1})
