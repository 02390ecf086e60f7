"""A passport as text, JSON and a section of a page: the same numbers, in units of people, nothing told too sharply."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from rverror.base.units import ARCSEC
from rverror.diagnosis.order_passport import OrderPassport, passport
from rverror.runs.order_table import OrderCase, TableCondition
from rverror.views.order_report import kinds_of_causes, passport_json, passports

RATIO = 81.0
ORDERS = np.array([1.0, 78.0, 240.0])
RPM = math.pi / 30.0


def waves(direction: float, torque: float, speed: float) -> np.ndarray:
    peak = 1.0 / complex(1.0 - (speed / (1130 * RPM)) ** 2, 0.05 * speed / (1130 * RPM))
    sizes = [60.0, 1j + 5.0 * direction * torque / 1e6, (0.5 + torque / 1e6) * peak]
    return np.array(sizes, dtype=np.complex128) * ARCSEC


@pytest.fixture(scope="module")
def found() -> tuple[OrderPassport, ...]:
    rng = np.random.default_rng(4)
    cases = [
        OrderCase(
            condition=TableCondition(direction=d, torque=q, input_speed=v * RPM, temperature=298.15),
            orders=ORDERS,
            waves=waves(d, q, v * RPM) + 0.02 * ARCSEC * (rng.normal(size=3) + 1j * rng.normal(size=3)),
        )
        for d in (1.0, -1.0)
        for v in (100.0, *range(400, 1900, 100))
        for q in (np.linspace(0, 1.8e6, 10) if v == 100.0 else (2e5, 1e6))
        if d > 0 or v == 100.0
    ]
    return passport(cases, ratio=RATIO)


@pytest.fixture(scope="module")
def bare() -> tuple[OrderPassport, ...]:
    """One case: an amplitude, no interval, no load."""
    condition = TableCondition(direction=-1.0)
    return passport([OrderCase(condition=condition, orders=np.array([39.0]), waves=np.array([2 * ARCSEC + 0j]))])


def by_order(data: list[dict[str, object]]) -> dict[object, dict[str, object]]:
    return {one["order"]: one for one in data}


def test_json_is_in_arcsec_and_newton_metres(found: tuple[OrderPassport, ...]) -> None:
    data = by_order(json.loads(json.dumps(passport_json(found), allow_nan=False)))
    assert set(data) == {1.0, 78.0, 240.0}
    meshing = data[78.0]
    forward, reverse = meshing["directions"]
    assert [forward["direction"], reverse["direction"]] == ["forward", "reverse"]
    for side, phase in ((forward, 0.0), (reverse, 180.0)):
        slope = side["per_1000_newton_metre_arcsec"]
        assert slope["low"] <= 5.0 <= slope["high"]
        assert slope["amplitude"] == pytest.approx(5.0, abs=0.1)
        assert abs(slope["phase_deg"]) == pytest.approx(phase, abs=1.5)
        assert side["constant_arcsec"]["amplitude"] == pytest.approx(1.0, abs=0.1)
        assert side["constant_arcsec"]["phase_deg"] == pytest.approx(90.0, abs=5)
    assert meshing["loads"] == "opposite"
    assert meshing["constants"] == "alike"
    assert meshing["reference_input_speed_rpm"] == pytest.approx(100.0)
    assert meshing["reference_temperature_degc"] == pytest.approx(25.0)
    assert sum(share or 0.0 for share in meshing["shares"].values()) == pytest.approx(1.0, abs=1e-3)
    # four deviations of a mean of 48 cases
    assert data[1.0]["amplitude_arcsec"] == pytest.approx(60.0, abs=4 * 0.02 / math.sqrt(48))
    assert data[1.0]["low"] < data[1.0]["amplitude_arcsec"] < data[1.0]["high"]


def test_a_part_that_can_be_zero_has_no_phase(found: tuple[OrderPassport, ...]) -> None:
    parts = [
        part
        for one in passport_json(found)
        for side in one["directions"]
        for part in side.values()
        if isinstance(part, dict)
    ]
    assert {part["low"] == 0.0 for part in parts} == {True, False}
    assert all((part["phase_deg"] is None) == (part["low"] == 0.0) for part in parts)


def test_the_table_says_the_same(found: tuple[OrderPassport, ...]) -> None:
    told = passports(found)
    for at, one in enumerate(passport_json(found)):
        sizes = [told[f"passport_amplitude{end}"].shown(display=True)[at] for end in ("", "_low", "_high")]
        assert sizes == pytest.approx([one[key] for key in ("amplitude_arcsec", "low", "high")], rel=1e-5)
    forward = told["law_with_load"].shown(display=True)[::2]
    slopes = [one["directions"][0]["per_1000_newton_metre_arcsec"]["amplitude"] for one in passport_json(found)]
    assert forward.tolist() == pytest.approx(slopes, rel=1e-5)
    words = " ".join(kinds_of_causes(found))
    assert all(kind in words for one in found for kind in one.kinds)


def test_what_is_not_told_has_no_number(bare: tuple[OrderPassport, ...]) -> None:
    (one,) = passport_json(bare)
    assert (one["low"], one["high"], one["directions"][0]["per_1000_newton_metre_arcsec"]) == (0.0, None, None)
    assert np.isnan(passports(bare)["law_with_load"].values).all()


def test_no_order_makes_no_entry() -> None:
    assert passport_json(()) == []


SETTINGS = {
    "torque": st.sampled_from([None, 0.0, 1e5, 5e5, 5.01e5, 1e6]),
    "input_speed": st.sampled_from([None, 10.0, 10.05, 50.0, 100.0]),
    "temperature": st.sampled_from([None, 298.0, 298.4, 310.0, 330.0]),
}
CONDITIONS = st.builds(TableCondition, direction=st.sampled_from([1.0, -1.0]), **SETTINGS)
SIZES = st.sampled_from([0.0, 1e-12, 1e-6, 1.1e-6, -2e-6, 1e-3])


@given(
    rows=st.lists(st.tuples(CONDITIONS, SIZES, SIZES, st.booleans()), min_size=1, max_size=14),
    ratio=st.sampled_from([None, 81.0, -39.0]),
)
@settings(max_examples=120, deadline=None)
def test_any_table_is_told_within_its_intervals(
    rows: list[tuple[TableCondition, float, float, bool]], ratio: float | None
) -> None:
    """Cases of few conditions, repeated, confounded, without noise or load: no crash, no interval inside out."""
    cases = [
        OrderCase(
            condition=condition,
            orders=np.array([39.0]),
            waves=np.array([complex(real, imaginary)]),
            sigma=np.array([1e-7]) if stated else None,
        )
        for condition, real, imaginary, stated in rows
    ]
    (one,) = passport(cases, ratio=ratio)
    # a sum of squares rounds
    assert one.low <= one.amplitude * (1 + 1e-9)
    assert one.amplitude <= one.high * (1 + 1e-9)
    assert sum(law.cases for law in one.laws) == len(rows)
    told = [share for share in one.shares.values() if share is not None]
    assert all(0.0 <= share <= 1.0 + 1e-12 for share in told)
    assert sum(told) == pytest.approx(1.0) or one.amplitude < 1e-11
    for law in one.laws:
        for part in (law.constant, law.slope, law.speed, law.temperature):
            assert part is None or 0.0 <= part.low <= part.amplitude <= part.high
    json.dumps(passport_json([one]), allow_nan=False)
    assert kinds_of_causes([one])
