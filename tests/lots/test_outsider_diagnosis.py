"""Units that are no members of a lot are diagnosed each by itself, with the lot's stiffness."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import pytest

import rverror
from gear_runs import UNIT, USUAL, runs_of
from rverror import to_json, to_text
from rverror.base.errors import InputError
from rverror.lots.result import Interval, Lot, Outsider
from rverror.model.effects import Model

FOUND = Lot(
    "unit", 40, ("forward at 20 N*m",), (), (), (), {"pin_contact": Interval(1.25, 1.1, 1.4)},
    (Outsider("017", 60.0, 1e-6, ()), Outsider("031", 50.0, 1e-5, ())), (), (), (), 0.5,
)  # fmt: skip


def runs(*effects: rverror.Effect) -> Sequence[rverror.Run]:
    return runs_of(Model(UNIT, effects), USUAL[:1], points=256, rms=0.2)


def test_a_unit_has_its_own_cause_and_the_lot_its_stiffness() -> None:
    spoilt = runs(rverror.effect("sensor.encoder_eccentricity", cos="40 arcsec"))
    found = rverror.lots.diagnose_outsiders(Model(UNIT), FOUND, {"017": spoilt})
    first, second = found.outsiders
    assert first.diagnosis is not None
    assert second == FOUND.outsiders[1]  # its runs were not given
    (added,) = first.diagnosis.added
    assert added.effect.key == "sensor.encoder_eccentricity"
    stiffness = first.diagnosis.declared.mechanism.stiffness
    assert stiffness.pin_contact == pytest.approx(1.25 * UNIT.stiffness.pin_contact)
    assert replace(stiffness, pin_contact=UNIT.stiffness.pin_contact) == UNIT.stiffness
    assert "Diagnosis of unit 017 alone: explained; sensor.encoder_eccentricity (cos " in to_text(found)
    told = to_json(found)["outliers"]
    assert (told[0]["diagnosis"]["verdict"], told[1]["diagnosis"]) == ("explained", None)
    assert told[0]["diagnosis"]["added"][0]["key"] == "sensor.encoder_eccentricity"


def test_runs_of_a_member_are_refused() -> None:
    with pytest.raises(InputError, match="unit '018' is no outsider of the lot; give runs of 017, 031"):
        rverror.lots.diagnose_outsiders(Model(UNIT), FOUND, {"018": ()})
