"""A unit of measured parts: parts at their places, the interval of its error, and what diagnosis finds beside them."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

import rverror
from pages import ROOT
from rverror.base.errors import InputError

sys.path.append(str(ROOT))

from benchmarks import parts_trial as trial

UNIT = trial.UNIT


def disc(serial: str, size: str) -> rverror.parts.MeasuredPart:
    wave = rverror.effect("cycloid.disc_profile", harmonic=2, cos=size, uncertainty="0.5 um")
    return rverror.parts.MeasuredPart("disc", serial, (wave,), "discs.csv")


DISCS = [disc("D17", "3 um"), disc("D18", "-2 um")]
HOUSING = rverror.parts.MeasuredPart(
    "housing", "H1", (rverror.effect("cycloid.pin_circle", harmonic=2, radial_cos="4 um"),)
)


def test_parts_stand_at_their_places() -> None:
    bare = rverror.Model(UNIT, (rverror.effect("crank.index", crank=0, angle="10 arcsec"),))
    unit = rverror.parts.unit_of_parts(bare, [*DISCS, HOUSING], {"disc": ["D18", "D17"]})
    first, second, ring = unit.effects[1:]
    assert unit.effects[0] == bare.effects[0]
    assert [(e.indices["disc"], e.values[0], e.uncertainty) for e in (first, second)] == [
        (0, -2e-3, 5e-4),
        (1, 3e-3, 5e-4),
    ]
    assert (first.origin, ring.origin, ring.uncertainty) == ("disc D18, discs.csv", "housing H1", None)
    assert rverror.parts.unit_of_parts(bare, DISCS).effects[1].values == (3e-3, 0.0)


def test_a_disc_at_the_other_place_is_turned_until_its_lobes_stand_right() -> None:
    """39 lobes are odd: half a turn takes crests to roots' places, so waves of odd harmonics change their sign."""
    bore = rverror.effect("cycloid.disc_bore_position", crank=0, radial="2 um")
    wave = rverror.effect("cycloid.disc_pitch", harmonic=1, cos="3 um", uncertainty="0.1 um")
    alike = [rverror.parts.MeasuredPart("disc", name, (bore, wave)) for name in ("A", "B")]
    unit = rverror.parts.unit_of_parts(rverror.Model(rverror.reducer("RV-40E")), alike)
    told = [(e.key, dict(e.indices), round(e.values[0], 12), e.uncertainty) for e in unit.effects]
    assert told == [
        ("cycloid.disc_bore_position", {"disc": 0, "crank": 0}, 2e-3, None),
        ("cycloid.disc_pitch", {"disc": 0, "harmonic": 1}, 3e-3, 1e-4),
        ("cycloid.disc_bore_position", {"disc": 1, "crank": 1}, 2e-3, None),
        ("cycloid.disc_pitch", {"disc": 1, "harmonic": 1}, -3e-3, 1e-4),
    ]
    three = rverror.reducer("RV-40E", cranks=3, planet_teeth=27)
    with pytest.raises(InputError, match="disc B: its lobes stand as those of disc 0, and do not fit at place 1"):
        rverror.parts.unit_of_parts(rverror.Model(three), alike)


@pytest.mark.parametrize(
    ("parts", "places", "told"),
    [
        (DISCS, {"disc": ["D17", "D99"]}, "place 'disc': 'D99' is not among the measured parts, D17, D18"),
        (DISCS, {"disc": ["D17", "D17"]}, "2 parts of kind disc for 2 in a unit; say which, each once"),
        (DISCS, {"crank": ["C1"]}, "place 'crank': 'C1' is not among"),
        (DISCS, {"wheel": ["C1"]}, "place 'wheel': 'C1' is not among"),
        (DISCS, {"wheel": []}, "place 'wheel': '' is not among"),
        ([*DISCS, disc("D19", "1 um")], None, "3 parts of kind disc for 2 in a unit; say which"),
        (DISCS[:1], None, "1 parts of kind disc for 2"),
    ],
)
def test_places_that_cannot_be_told(
    parts: list[rverror.parts.MeasuredPart], places: dict[str, list[str]], told: str
) -> None:
    with pytest.raises(InputError, match=told):
        rverror.parts.unit_of_parts(rverror.Model(UNIT), parts, places)


def test_an_error_that_the_model_declares_is_not_counted_twice() -> None:
    declared = rverror.effect("cycloid.disc_profile", disc=1, harmonic=2, cos="1 um")
    with pytest.raises(
        InputError, match=r"disc_profile \(disc 1, harmonic 2\): it is measured, and the model declares it"
    ):
        rverror.parts.unit_of_parts(rverror.Model(UNIT, (declared,)), DISCS)


def test_the_interval_of_the_error_is_that_of_units_within_the_uncertainty() -> None:
    """Against units whose sizes are drawn and solved one by one."""
    unit = rverror.parts.unit_of_parts(rverror.Model(UNIT), [*DISCS, HOUSING])
    theta = np.linspace(0, 2 * np.pi / 20, 300)
    found = rverror.parts.unit_error(unit, theta)
    rng = np.random.default_rng(8)
    drawn = []
    for _ in range(400):
        effects = [
            rverror.Effect(
                e.key,
                e.indices,
                tuple(np.array(e.values) + (e.uncertainty or 0.0) * rng.standard_normal(len(e.values))),
            )
            for e in unit.effects
        ]
        drawn.append(rverror.transmission_error(rverror.Model(UNIT, tuple(effects)), theta))
    assert found.sigma == pytest.approx(np.std(drawn, axis=0), rel=0.15)
    assert found.transmission_error == pytest.approx(rverror.transmission_error(unit, theta))
    assert found.interval == pytest.approx(tuple(np.quantile(np.ptp(drawn, axis=1), (0.025, 0.975))), rel=0.1)
    assert found.peak_to_peak == np.ptp(found.transmission_error)
    exact = rverror.parts.unit_error(rverror.Model(UNIT, HOUSING.errors), theta)
    assert exact.interval == (exact.peak_to_peak, exact.peak_to_peak)


def test_diagnosis_names_what_assembly_added(tmp_path: Path) -> None:
    """Cams of two cranks from their scans; the output coupling was mounted off its centre."""
    rng = np.random.default_rng(4)
    (tmp_path / "cams.toml").write_text(trial.CAMS)
    real: list[rverror.Effect] = []
    for crank in range(UNIT.cranks):
        truth, lines = trial.cam_scans(rng)
        (tmp_path / f"C{crank}.csv").write_text(lines)
        for k in range(UNIT.discs):
            radial, tangential = truth[f"crank.eccentricity (disc {k})"]
            real.append(rverror.effect("crank.eccentricity", crank=crank, disc=k, radial=radial, tangential=tangential))
    files = [tmp_path / f"C{crank}.csv" for crank in range(UNIT.cranks)]
    cranks = rverror.load_parts(files, UNIT, mapping=tmp_path / "cams.toml").parts
    unit = rverror.parts.unit_of_parts(rverror.Model(UNIT), cranks)
    real.append(rverror.effect("sensor.encoder_eccentricity", cos="8 arcsec", sin="3 arcsec"))
    runs = [
        rverror.simulate(
            rverror.Model(UNIT, tuple(real)), torque="100 N*m", direction=direction, noise="0.3 arcsec", points=1024,
            method="equilibrium", seed=seed,
        )
        for seed, direction in ((1, 1.0), (2, -1.0))
    ]  # fmt: skip
    found = rverror.diagnose(unit, runs)
    assert [effect.key for effect in found.model.effects[len(unit.effects) :]] == ["sensor.encoder_eccentricity"]
    added = found.model.effects[-1].values
    assert added == pytest.approx((8 * rverror.ARCSEC, 3 * rverror.ARCSEC), abs=0.1 * rverror.ARCSEC)
