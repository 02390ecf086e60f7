"""Every row of the ledger against hand formulas with the printed numbers, and the page against its generator."""

import math

import ledger
import numpy as np
import pytest

from pages import DOCS
from rverror.geartrain.cycloid import loaded_share, normal_gap, pin_contacts, pin_positions
from rverror.geartrain.mechanism import reducer

ARCSEC = math.pi / 648000
E = 0.005
TAN20, COS20 = math.tan(math.radians(20)), math.cos(math.radians(20))
ROWS = {row.key: row for row in ledger.table()}


def figures(row, part):
    return [figure.value for figure in getattr(ROWS[row], part)]


def test_every_source_and_every_statement_of_the_design_has_a_row():
    assert len(ROWS) == len(ledger.table())
    assert {row.source for row in ROWS.values()} == {"000", "001", "002", "003", "004"}
    for row in ROWS.values():
        assert row.key.startswith(row.source)
        assert row.verdict.startswith(ledger.VERDICTS)
        assert not row.verdict.endswith(".")
        assert row.formula
        assert row.computed or row.corrected


def test_delta_41_is_constant_unless_fixed_in_the_housing():
    peak_to_peak, constant, in_housing = figures("000 delta_41", "computed")
    assert peak_to_peak == pytest.approx(0, abs=1e-9)
    assert constant == pytest.approx(E / 27 / ARCSEC, rel=1e-12)
    assert constant == pytest.approx(38.197, abs=1e-3)
    assert in_housing == pytest.approx(2 * E / 27 / ARCSEC, rel=1e-6)
    assert in_housing == pytest.approx(76.4, abs=0.05)
    one, every, ripple = figures("000 delta_41", "corrected")
    assert every == pytest.approx(-38.197, abs=1e-3)
    assert one == pytest.approx(every / 2)
    assert ripple == pytest.approx(0, abs=1e-9)


def test_delta_31_is_a_radial_error_at_the_longest_arm():
    literal, radial, normal = figures("000 delta_31", "computed")
    K = 1.25 * 40 / 64
    assert radial == pytest.approx(E * math.sqrt(1 - K * K) / (1.25 * 40) / ARCSEC)
    assert radial == pytest.approx(12.88, abs=0.005)
    assert normal == pytest.approx(E / (1.25 * 39) / ARCSEC)
    assert normal == pytest.approx(21.2, abs=0.05)
    # at the longest arm the normal stands across the eccentric direction, R_p sqrt(1 - K^2) from the pitch point to the
    # pin, so the contact lies sqrt((a z_c)^2 + (R_p sqrt(1 - K^2) - r_p)^2) from the disc's centre
    contact = math.hypot(48.75, 64 * math.sqrt(1 - K * K) - 3)
    assert literal == pytest.approx(E / (contact * (48.75 / contact) ** 2) / ARCSEC)
    assert literal == pytest.approx(26.5, abs=0.05)
    assert all(abs(value - 12.8) > 5 for value in (literal, normal))
    lead, ripple, first = figures("000 delta_31", "corrected")
    assert first == pytest.approx(9.90, rel=1e-3)
    assert ripple < 0.01 * lead
    # mean of sum(l) / sum(l^2) over the loaded half, by quadrature over the angle from pin to eccentric direction
    phi = (np.arange(4000) + 0.5) / 4000 * math.pi
    arm = 1.25 * 39 * np.sin(phi) / np.sqrt(1 + K * K - 2 * K * np.cos(phi))
    assert lead == pytest.approx(117 / 121 * E * arm.sum() / (arm**2).sum() / ARCSEC, rel=2e-3)


def test_delta_21_is_zero_or_constant():
    radial_pp, radial, tangential_pp, tangential = figures("000 delta_21", "computed")
    assert [radial_pp, radial, tangential_pp] == pytest.approx([0, 0, 0], abs=1e-9)
    assert tangential == pytest.approx(E / 1.25 / 41 / ARCSEC)
    assert 20 < tangential < 21
    every, amplitude = figures("000 delta_21", "corrected")
    assert every == pytest.approx(-3 / 121 * E / 1.25 / ARCSEC, rel=1e-9)
    assert every == pytest.approx(-20.456, abs=1e-3)
    assert 2 * amplitude == pytest.approx(18.467, rel=1e-3)


def test_delta_11_is_the_swing_between_two_signs():
    swing, turning = figures("000 delta_11", "computed")
    assert swing == pytest.approx(2 * E * TAN20 / (20.25 * 41) / ARCSEC)
    assert swing == pytest.approx(0.904, abs=5e-4)
    assert turning == pytest.approx(2 * E / (20.25 * COS20 * 41) / ARCSEC, rel=1e-3)
    one, every = figures("000 delta_11", "corrected")
    assert every == pytest.approx(-3 / 121 * E * TAN20 / 20.25 / ARCSEC)
    assert one == pytest.approx(every / 2)


def test_feedback_takes_away_and_has_no_last_step():
    low, high, share, least, most = figures("000 feedback", "computed")
    assert low == pytest.approx(30.5 * (4 / 3) / 41)
    assert high == pytest.approx((30.5 + 12.8 + 8.2 + 0.9) * (4 / 3) / 41)
    assert 0.95 < low < high < 2
    # (cos, sin) of the pressure angle against a vector that turns: amplitude 1, so (r1 + r2) / (r2 cos(alpha)) / 41
    assert share == pytest.approx((4 / 3) / COS20 / 41)
    assert share == pytest.approx(0.0346, abs=5e-5)
    assert [least, most] == pytest.approx([30.5 * share, 52.4 * share])
    assert 1 < least < most < 2
    assert ledger.feedback_as_printed(reducer("RV-40E")).mean() == pytest.approx(0, abs=1e-12)
    gain, factor, change = figures("000 feedback", "corrected")
    steps = np.cumsum(gain ** np.arange(20))
    assert steps[-1] == pytest.approx(factor, rel=1e-12)
    assert factor == pytest.approx(117 / 121, rel=1e-12)
    assert change == pytest.approx(-4 / 121 * (12.8 + 8.2 + 0.9))


def test_printed_ratios_contradict_each_other():
    printed, computed = figures("000 ratios", "printed"), figures("000 ratios", "computed")
    assert computed == [4, 1, 4]
    assert printed == [4, 41, 164]
    assert figures("000 ratios", "corrected") == [121, -39, -40]


def test_disc_turns_by_a_lobe_for_a_turn_of_the_crank():
    assert figures("000 disc rotation", "computed") == [-1]
    assert figures("000 disc rotation", "corrected") == [pytest.approx(-1 / 39)]


def test_spectral_peak_lies_at_the_pins():
    order, from_period, least, most = figures("000 spectral peak", "computed")
    assert order == pytest.approx(38.9, abs=0.05)
    assert from_period == pytest.approx(38.9, abs=0.05)
    housing, disc = figures("000 spectral peak", "corrected")
    assert least < housing < most < disc


def test_printed_profile_is_too_large():
    assert figures("001 profile", "computed") == [pytest.approx(64 + 3 - 1.25), pytest.approx(64 + 3 + 1.25), 40]
    assert figures("001 profile", "computed")[:2] == pytest.approx([65.75, 68.25])
    low, high, lobes = figures("001 profile", "corrected")
    assert [low, high, lobes] == [pytest.approx(59.75), pytest.approx(62.25), 39]
    ground, _ = ground_profile(
        reducer("RV-40E"), np.linspace(0, 78 * np.pi, 5000), pin_circle_radius=64.0, pin_radius=3.0
    )
    assert [abs(ground).min(), abs(ground).max()] == pytest.approx([low, high], abs=1e-3)


def test_error_does_not_repeat_with_the_input():
    pins, discs = figures("001 Fourier series", "computed")
    assert [pins, discs] == pytest.approx([39 / 121, 40 / 121])
    assert figures("001 Fourier series", "corrected") == [1]


def test_degrees_of_freedom():
    carrier, discs, cranks, sun = 3, 2 * 3, 3 * 3, 2
    assert figures("001 degrees of freedom", "computed") == [carrier + discs + cranks + sun]
    assert figures("001 degrees of freedom", "printed") == [20]
    assert figures("001 degrees of freedom", "corrected") == [17]


def test_opposed_pitch_errors_add_and_equal_ones_cancel():
    one, in_phase, opposed = figures("001 phase of the discs", "corrected")
    assert one == pytest.approx(6.725, rel=1e-3)
    assert in_phase == pytest.approx(0, abs=1e-9)
    assert opposed == pytest.approx(2 * one)


def test_initial_gap_at_the_first_contact_and_at_a_quarter_turn():
    K = 0.78125
    root = math.sqrt(1 - K * K)
    contact, quarter, printed_K = figures("002 initial gap", "computed")
    assert contact == pytest.approx(-5 * (1 - K * root) / (1 - K * K))
    assert quarter == pytest.approx(-5 * (1 - K) / (1 + K * K))
    assert printed_K > 1
    contact, quarter, right_K = figures("002 initial gap", "corrected")
    assert contact == pytest.approx(0, abs=1e-12)
    assert quarter == pytest.approx(5 * (1 - 1 / math.sqrt(1 + K * K)))
    assert right_K == K


def ground_profile(unit, roll, *, pin_circle_radius, pin_radius):
    """Disc profile as the envelope of the pin, normal by differences: needs neither pitch point nor arms."""

    def centre(angle):
        on_disc = angle / unit.disc_lobes  # pin on the disc; the eccentric direction leads it by the roll angle
        curve = pin_circle_radius * np.exp(1j * on_disc) - unit.eccentricity * np.exp(1j * (on_disc + angle))
        return curve

    tangent = centre(roll + 1e-5) - centre(roll - 1e-5)
    inward = 1j * tangent / abs(tangent)
    return centre(roll) + pin_radius * inward, inward


@pytest.mark.parametrize("preset", ["RV-40E", "RV-003"])
def test_normal_gap_is_what_a_smaller_grinding_circle_takes_off(preset):
    """The shift's gap against the difference of two profiles, each ground on its own pin circle."""
    unit = reducer(preset)
    roll = np.linspace(0.05, 2 * np.pi, 200)
    nominal = {"pin_circle_radius": unit.pin_circle_radius, "pin_radius": unit.pin_radius}
    base, inward = ground_profile(unit, roll, **nominal)
    step = 1e-5
    for change, modification in (
        ({"pin_circle_radius": unit.pin_circle_radius - step}, {"equidistant": 0, "shift": 1}),
        ({"pin_radius": unit.pin_radius + step}, {"equidistant": 1, "shift": 0}),
    ):
        other, _ = ground_profile(unit, roll, **(nominal | change))
        taken_off = ((other - base) / step * inward.conjugate()).real
        np.testing.assert_allclose(taken_off, normal_gap(unit, roll, **modification), atol=2e-5)


@pytest.mark.parametrize("preset", ["RV-40E", "RV-003"])
def test_loaded_displacement_is_the_share_of_the_longest_arm(preset):
    unit = reducer(preset)
    eccentric = np.linspace(0, 2 * np.pi, 97)
    arm = pin_contacts(unit, eccentric[None])[1][0]
    phi = eccentric - pin_positions(unit)[:, None]
    share = loaded_share(unit, phi)
    np.testing.assert_allclose(share, arm / (unit.eccentricity * unit.disc_lobes), atol=1e-12)
    assert np.abs(share).max() <= 1 + 1e-12


def test_printed_displacement_exceeds_the_largest():
    K = 0.78125
    assert figures("002 loaded displacement", "computed") == pytest.approx([1 / math.sqrt(1 - K * K)])
    share, difference = figures("002 loaded displacement", "corrected")
    assert share == pytest.approx(1, abs=1e-12)
    assert difference < 1e-12


def test_projections_on_the_line_to_the_centre():
    # pin on +x, the disc's centre at a (K, sqrt(1 - K^2)): the longest arm
    K = 0.78125
    across, along = 1.25 * math.sqrt(1 - K * K), 64 - 1.25 * K
    printed = figures("002 projections", "computed")
    assert printed == pytest.approx([5 * along / math.hypot(along, across), 5 * across / math.hypot(along, across)])
    # the normal there is from the pin, (R_p, 0), to the pitch point, K R_p along the eccentric direction
    normal = 50 * complex(K, math.sqrt(1 - K * K)) - 64
    right = figures("002 projections", "corrected")
    assert right == pytest.approx([5 * abs(normal.real) / abs(normal), 5 * abs(normal.imag) / abs(normal)])
    assert right == pytest.approx([5 * math.sqrt(1 - K * K), 5 * K])
    assert printed[1] < 0.02 * right[1]


def test_equidistant_is_not_projected():
    root = math.sqrt(1 - 0.78125**2)
    assert figures("002 modification", "computed") == pytest.approx([5 * root, 5 * root])
    equidistant, shift = figures("002 modification", "corrected")
    unit, roll, step = reducer("RV-40E"), np.array([math.acos(0.78125)]), 1e-5
    base, inward = ground_profile(unit, roll, pin_circle_radius=64.0, pin_radius=3.0)
    for found, changed in ((equidistant, (64.0, 3.0 + step)), (shift, (64.0 - step, 3.0))):
        other, _ = ground_profile(unit, roll, pin_circle_radius=changed[0], pin_radius=changed[1])
        assert found == pytest.approx(5 * ((other - base) / step * inward.conjugate()).real[0], rel=1e-4)


def test_forces_are_not_equal():
    # in proportion to the arms, sin(phi) / sqrt(1 + K^2 - 2 K cos(phi)) of the longest, over the loaded half
    phi = (np.arange(20000) + 0.5) / 20000 * math.pi
    arm = np.sin(phi) / np.sqrt(1 + 0.78125**2 - 2 * 0.78125 * np.cos(phi))
    assert figures("002 meshing forces", "computed") == [1]
    assert figures("002 meshing forces", "corrected") == [pytest.approx(1 / arm.mean(), rel=0.01)]


def test_profile_of_003_with_a_length_for_a_ratio():
    assert figures("003 profile", "computed") == pytest.approx([76.5 * 0.3, 76.5 * 2.3])
    assert figures("003 profile", "computed") == pytest.approx([23, 176], abs=0.06)
    assert figures("003 profile", "corrected") == pytest.approx([75.2, 77.8])
    ground, _ = ground_profile(
        reducer("RV-003"), np.linspace(0, 78 * np.pi, 5000), pin_circle_radius=76.5, pin_radius=0.0
    )
    assert [abs(ground).min(), abs(ground).max()] == pytest.approx([75.2, 77.8], abs=1e-3)


def test_wear_as_a_share_of_the_tooth():
    # half of the pitch, m pi
    assert figures("003 sun tooth", "computed") == [pytest.approx(14 / math.pi)]
    assert figures("003 sun tooth", "computed") == [pytest.approx(4.46, abs=0.005)]
    assert figures("003 sun tooth", "printed") == [4]


def test_spline_slope():
    said, of_table = figures("003 spline clearance", "printed")
    assert said == 500
    assert of_table == pytest.approx(686, abs=0.5)
    expected = 1 / 7 / 40.4 / ARCSEC
    assert expected == pytest.approx(729, abs=0.5)
    assert figures("003 spline clearance", "computed") == pytest.approx([expected])
    assert figures("003 spline clearance", "corrected") == pytest.approx([expected])
    assert abs(of_table / expected - 1) < 0.06


def test_wear_slopes():
    expected = 1 / 12 / 101 / ARCSEC
    assert expected == pytest.approx(170, abs=0.5)
    for row in ("003 sun wear", "003 planet wear"):
        assert figures(row, "computed") == pytest.approx([expected])
        assert figures(row, "corrected") == pytest.approx([expected])
    (sun,), (planet,) = figures("003 sun wear", "printed"), figures("003 planet wear", "printed")
    assert sun == pytest.approx(157, abs=0.5)
    assert abs(sun / expected - 1) < 0.08
    assert planet / expected > 1.7


def test_planets_wear_less_than_a_third_of_the_sun():
    """Flanks between the ends of the line of action and the tips, by the lengths of their involutes."""
    r1, r2, m = 12.0, 30.0, 2.0
    whole = (r1 + r2) * TAN20 * COS20
    tips = [math.sqrt((r + m) ** 2 - (r * COS20) ** 2) for r in (r1, r2)]
    first, last = max(whole - tips[1], 0), min(tips[0], whole)
    sun, planet = (last**2 - first**2) / r1, ((whole - first) ** 2 - (whole - last) ** 2) / r2
    expected = 12 * sun / (3 * 30 * planet)
    assert figures("003 share of wear", "computed") == pytest.approx([expected])
    assert figures("003 share of wear", "corrected") == pytest.approx([expected])
    assert expected < 0.5 * figures("003 share of wear", "printed")[0]


def test_friction_law_and_its_text_disagree():
    assert figures("003 friction", "computed") == pytest.approx([48, 40])
    low, high, none, slope = figures("003 friction", "printed")
    assert [none + slope * f for f in (0.01, 0.05)] == pytest.approx(figures("003 friction", "computed"))
    assert low < min(figures("003 friction", "computed"))
    assert max(figures("003 friction", "computed")) < high


def test_mean_ratio_is_a_misprint():
    error, speed, ratio = figures("003 mean ratio", "computed")
    assert error == pytest.approx(100 * (1 - 100.593 / 101))
    assert error == pytest.approx(0.40, abs=0.005)
    assert speed == pytest.approx(1800 / 100.593)
    assert round(speed, 2) != 17.81
    assert ratio == pytest.approx(101.07, abs=0.005)


def test_printed_pin_formula_is_fifty_times_too_large():
    printed, at_output, one_contact, factor = figures("004 pin position", "computed")
    assert printed == pytest.approx(39 * E / 64 / ARCSEC)
    assert printed == pytest.approx(628, abs=0.6)
    assert one_contact == pytest.approx(12.88, abs=0.005)
    assert at_output == pytest.approx(E / 64 / ARCSEC)
    assert at_output == pytest.approx(16.1, abs=0.05)
    assert 45 < factor < 55
    one_pin, ring = figures("004 pin position", "corrected")
    assert one_pin < 1
    # all pins away from the centre: mean of sum(l n.r) / sum(l^2) over the loaded half, by quadrature
    K = 0.78125
    phi = (np.arange(4000) + 0.5) / 4000 * math.pi
    root = np.sqrt(1 + K * K - 2 * K * np.cos(phi))
    arm, outward = 48.75 * np.sin(phi) / root, -(1 - K * np.cos(phi)) / root
    assert ring == pytest.approx(117 / 121 * E * (arm * outward).sum() / (arm**2).sum() / ARCSEC, rel=5e-3)


def test_sun_eccentricity_does_not_reach_the_output():
    turned = 0.010 / 6.75 / ARCSEC  # of a sun whose mesh is off by e_s
    assert figures("004 sun eccentricity", "computed") == pytest.approx([40 / 9 * turned, turned / 121])
    assert turned / 121 == pytest.approx(2.5, abs=0.05)
    floating, one_mesh = figures("004 sun eccentricity", "corrected")
    assert floating == pytest.approx(0, abs=1e-9)
    # amplitude (z2/z1) e / (R n r2 cos(alpha)) along the line of action
    assert one_mesh == pytest.approx(2 * 3 * 0.010 / (121 * 2 * 20.25 * COS20) / ARCSEC, rel=1e-4)


def test_the_outputs_encoder_counts_alone():
    share, both, line, input_line = figures("004 encoders", "computed")
    assert share == pytest.approx(0.39 / 121)
    assert both == pytest.approx(math.sqrt(1.24**2 + share**2))
    assert both == pytest.approx(1.24, abs=1e-5)
    assert both / 56.33 == pytest.approx(0.02, abs=0.005)
    assert line == pytest.approx(72)  # 0.02 deg
    assert line > 57.42
    assert input_line == pytest.approx(36 / 121)


def test_maximum_is_peak_to_peak():
    peak_to_peak, largest, difference, from_reverse = figures("004 maximum", "computed")
    assert peak_to_peak == pytest.approx(figures("004 maximum", "printed")[0])
    assert largest == pytest.approx(0.0093 * 60)
    assert difference == pytest.approx(1.092 - 56.33 / 60)
    assert round(difference, 2) == 0.15
    assert from_reverse == pytest.approx(1.092 - 57.42 / 60)
    assert math.floor(100 * from_reverse) / 100 == figures("004 maximum", "printed")[1] == 0.13


def test_clearance_as_a_stiffness_jumps():
    assert figures("004 bearing clearance", "computed") == pytest.approx([3e5 * 0.012])
    assert figures("004 bearing clearance", "corrected") == [0]


def test_sampling_folds_the_meshes():
    assert figures("004 sampling", "computed") == [80, 440]
    n = np.arange(1000)
    for order, folded in ((1080, 80), (1560, 440)):
        np.testing.assert_allclose(
            np.cos(2 * np.pi * order * n / 1000), np.cos(2 * np.pi * folded * n / 1000), atol=1e-9
        )
    assert figures("004 sampling", "corrected") == [4096]


def test_ratio_of_004():
    printed_formula, from_speeds = figures("004 ratio", "computed")
    assert printed_formula == pytest.approx((1 + 40 / 9) * 40)
    assert from_speeds == 121
    assert figures("004 ratio", "corrected") == [121]


def test_page_is_the_output_of_the_generator():
    page = (DOCS / "ledger.md").read_text(encoding="utf-8")
    assert page == ledger.markdown(), "docs/ledger.md is out of date: python docs/_ext/ledger.py > docs/ledger.md"


def test_tables_of_the_page_have_the_same_columns_in_every_line():
    columns = None
    for line in ledger.markdown().splitlines():
        if not line.startswith("|"):
            columns = None
            continue
        columns = columns or line.count(" | ")
        assert line.count(" | ") == columns, line


def test_figure_reads_rounding_as_zero():
    assert str(ledger.Figure("x", -1e-15)) == "x 0 arcsec"
    assert str(ledger.Figure("", 0.904246, "arcsec")) == "0.9042 arcsec"
