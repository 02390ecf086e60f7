"""Limits as drawings write them: what each way of writing comes to, and what is refused."""

from __future__ import annotations

import pytest
from hypothesis import given, strategies as st

import rverror
from rverror.base.errors import InputError
from rverror.tolerances.declared import width_and_centre
from rverror.tolerances.distribution import Lognormal, Uniform

UM = st.integers(-400, 400).map(lambda tenths: tenths / 10)


@pytest.mark.parametrize("text", ["5 um", "±5 um", "+-5 um", "+/-5 um", "± 0.005 mm", "+/−5 um"])
def test_a_width_is_alike_to_both_sides(text: str) -> None:
    width, centre = width_and_centre(text, "length")
    assert width == pytest.approx(5e-3)
    assert centre is None


@given(UM, UM)
def test_two_limits_are_their_middle_and_half_of_what_they_leave(one: float, other: float) -> None:
    if one == other:
        return
    low, high = sorted((one, other))
    written = (
        f"{high:+g}/{low:+g} um",
        f"{low:+g} / {high:+g} um",
        f"{high:+g} um/{low:+g} um",
        f"{high:+g}/{low:+g} um".replace("-", "\N{MINUS SIGN}"),
        f"{high * 1e-3:+.9f}/{low * 1e-3:+.9f} mm",
        f"{high:+g} um / {low * 1e-3:+.9f} mm",
        [f"{low:g} um", f"{high:g} um"],
        (low * 1e-3, high * 1e-3),
    )
    for value in written:
        width, centre = width_and_centre(value, "length")
        assert width == pytest.approx((high - low) / 2 * 1e-3, abs=1e-12)
        assert centre == pytest.approx((high + low) / 2 * 1e-3, abs=1e-12)


def test_zero_needs_no_sign_and_a_unit_may_have_a_slash() -> None:
    assert width_and_centre("0/-8 um", "length") == pytest.approx((4e-3, -4e-3))
    assert width_and_centre("+8/0 um", "length") == pytest.approx((4e-3, 4e-3))
    assert width_and_centre("10 arcsec/turn", "slope")[1] is None


@pytest.mark.parametrize("value", ["+5/+5 um", ["2 um", "1 um"], ["1 um"], ["1 um", "2 um", "3 um"], "+2/-1", ""])
def test_limits_that_leave_nothing_are_refused(value: object) -> None:
    with pytest.raises(ValueError, match=r"limits|unit|number"):
        width_and_centre(value, "length")


def test_the_mean_of_a_tolerance_is_between_its_limits() -> None:
    item = rverror.tolerance("cycloid.pin_radius", "+0.02/-0.01 mm", distribution="uniform")
    assert item.distribution == Uniform()
    assert (item.width, item.mean["deviation"]) == pytest.approx((15e-3, 5e-3))
    clearance = rverror.tolerance(
        "crank.bearing_clearance", ["4 um", "16 um"], distribution="lognormal", shape=0.23104906
    )
    law = clearance.distribution
    assert isinstance(law, Lognormal)
    median = 8e-3  # sqrt(4 * 16): the value itself is lognormal, so its mean is exp(shape**2 / 2) medians
    assert clearance.mean["clearance"] == pytest.approx(median * 2.718281828459045 ** (law.shape**2 / 2))


@pytest.mark.parametrize(
    ("key", "given_", "words"),
    [
        ("crank.eccentricity", {"width": "+5/-2 um"}, ["two limits", "radial, tangential", "parameters"]),
        ("cycloid.pin_radius", {"width": "+5/-2 um", "mean": "1 um"}, ["mean", "leave it out"]),
        ("crank.bearing_clearance", {"width": ["-1 um", "9 um"]}, ["-1 um", "below 0"]),
        ("cycloid.pin_radius", {"width": "5 um", "shape": 0.3}, ["shape", "normal"]),
        ("cycloid.pin_radius", {"width": "5 um", "distribution": "lognormal", "shape": 0.0}, ["shape", "not 0"]),
        ("cycloid.pin_radius", {"width": "5 um", "distribution": "lognormal"}, ["shape = 0.3"]),
    ],
)
def test_what_does_not_go_together_is_one_line(key: str, given_: dict[str, object], words: list[str]) -> None:
    with pytest.raises(InputError) as caught:
        rverror.tolerance(key, **given_)  # type: ignore[arg-type]
    message = str(caught.value)
    assert "\n" not in message
    for word in words:
        assert word in message
