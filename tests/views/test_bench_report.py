"""The bench's uncertainty stands beside measured figures where a model states encoders, and nowhere else."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pytest

import rverror
from every_kind import compensation, diagnosis
from rverror import ARCSEC, Diagnosis, to_html, to_json, to_text
from rverror.diagnosis.order_passport import passport
from rverror.diagnosis.result import OrderShare, Validation
from rverror.runs.order_table import OrderCase, TableCondition
from rverror.views.order_report import passport_json, passports

ENCODERS = rverror.model.Encoders(output_encoder="1.24 arcsec", input_encoder="0.39 arcsec")
#: k = 2 over the square root of three, by hand; the input's encoder adds three parts in a million.
RMS, PEAK, ORDER = 1.432, 2.864, 1.823


def found(encoders: rverror.model.Encoders = ENCODERS, **changes: object) -> Diagnosis:
    plain = replace(diagnosis("unexplained"), validation=(Validation("later.csv", 8 * ARCSEC, 3 * ARCSEC),))
    return replace(plain, declared=replace(plain.declared, encoders=encoders), **changes)  # type: ignore[arg-type]


def test_each_figure_of_the_report_has_it_beside_it() -> None:
    text = to_text(found())
    assert re.search(rf"^± bench, k = 2 +{RMS} +{PEAK} +{RMS}$", text, re.M)
    assert re.search(rf"later.csv +8 +3 +{RMS}", text)
    assert re.search(r"output encoder +even +1.732 +1.24 +0.7159 +2.48 +1.24\n", text)
    assert re.search(r"7 +6 to 8 +1.823", text)  # order 36
    assert re.search(r"2 +1 to 3 +0 ", text)  # 39.5 is no order of a shaft


def test_programs_and_page_have_the_same_numbers() -> None:
    data = to_json(found())
    stated = data["bench_uncertainty"]
    assert [stated[f"{name}_arcsec"] for name in ("rms", "heldout_rms", "peak_to_peak", "reading")] == pytest.approx(
        [RMS, RMS, PEAK, RMS], abs=5e-4
    )
    assert stated["coverage_factor"] == 2
    first = stated["parts"][0]
    assert first["limit"] / first["divisor"] == pytest.approx(first["standard"], rel=1e-5)
    assert [line["bench_uncertainty_arcsec"] for line in data["unexplained_orders"]] == pytest.approx(
        [ORDER, 0.0], abs=5e-4
    )
    assert "What the bench leaves uncertain" in to_html(found())


def test_nothing_is_shown_where_nothing_is_stated() -> None:
    bare = found(rverror.model.Encoders())
    assert to_json(bare)["bench_uncertainty"] is None
    told = to_text(bare), to_html(bare), to_text(diagnosis(quantity="torque")), json.dumps(to_json(bare))
    assert not any("k = 2" in text for text in told)
    ripple = diagnosis(quantity="torque")
    ripple = replace(ripple, declared=replace(ripple.declared, encoders=ENCODERS))
    assert "k = 2" not in to_text(ripple)  # encoders read no torque


def test_of_an_order_table_no_peak_to_peak_is_uncertain_by_a_number() -> None:
    """Orders that it does not hold are not known, so its sum of waves is no waveform of the bench's."""
    table = found(shares=(OrderShare(1.0, ARCSEC, 0.1, 0.2, 0.6, 0.1, 0.0),))
    stated = to_json(table)["bench_uncertainty"]
    assert stated["peak_to_peak_arcsec"] is None
    assert stated["rms_arcsec"] == pytest.approx(RMS, abs=5e-4)
    assert re.search(rf"^± bench, k = 2 +{RMS} +– +{RMS}$", to_text(table), re.M)


def test_a_passport_has_it_beside_amplitudes() -> None:
    cases = [
        OrderCase(
            condition=TableCondition(direction=1.0, torque=torque),
            orders=np.array([1.0, 11.3, 40.0]),
            waves=np.array([9.0, 2.0, 1.0 + torque / 1e5]) * ARCSEC + 0j,
        )
        for torque in (1e4, 5e4, 1e5, 2e5)
    ]
    bench = rverror.runs.bench_uncertainty(121, output_encoder="1.24 arcsec")
    found = passport(cases)
    told = passports(found, bench)
    stated = zip(told["passport_order"].values, told["passport_bench_uncertainty"].shown(display=True), strict=True)
    assert dict(stated) == pytest.approx({1.0: ORDER, 11.3: 0.0, 40.0: ORDER}, abs=5e-4)
    sizes = {one["order"]: one["bench_uncertainty_arcsec"] for one in passport_json(found, bench=bench)}
    assert sizes == pytest.approx({1.0: ORDER, 11.3: 0.0, 40.0: ORDER}, abs=5e-4)
    assert "passport_bench_uncertainty" not in passports(found)
    assert {one["bench_uncertainty_arcsec"] for one in passport_json(found)} == {None}


def test_a_models_own_page_tells_its_encoders() -> None:
    model = rverror.Model(rverror.Drive(ratio=14.0), encoders=ENCODERS)
    assert re.search(r"bench: output encoder +1.24 arcsec", to_text(model))


def test_a_compensation_has_it_and_says_that_the_table_holds_it() -> None:
    plain = compensation()
    made = replace(plain, model=replace(plain.model, encoders=ENCODERS))
    told = to_text(made)
    assert re.search(r"expanded, k = 2: .*rms ± \d", told)
    assert "bench uncertainty, arcsec" in told
    assert "the table holds it" in told
    assert to_json(made)["bench_uncertainty"]["rms_arcsec"] == pytest.approx(RMS, abs=5e-4)
    assert "±" not in to_text(plain)
    assert to_json(plain)["bench_uncertainty"] is None
