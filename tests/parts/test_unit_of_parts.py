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


THREE = rverror.reducer("RV-40E", cranks=3, planet_teeth=27)
ANGLES = np.linspace(0, 2 * np.pi, 50)


def body(effects: tuple[rverror.Effect, ...], place: int) -> tuple[dict[int, complex], np.ndarray, float]:
    """Of a disc as a piece of steel: its bores' centres by their cranks, its profile over the angle, a lobe's crest."""
    by_key = {key: [e for e in effects if e.key == key] for key in {e.key for e in effects}}
    bores = {}
    for e in by_key["cycloid.disc_bore_position"]:
        bores[e.indices["crank"]] = (27 + complex(*e.values)) * np.exp(2j * np.pi * e.indices["crank"] / 3)
    profile = sum(
        e.values[0] * np.cos(e.indices["harmonic"] * ANGLES) + e.values[1] * np.sin(e.indices["harmonic"] * ANGLES)
        for e in by_key["cycloid.disc_profile"]
    )
    (lobe,) = (e.indices["lobe"] for e in by_key["cycloid.disc_lobe"])
    root = np.ceil(place * 40 / 2) - place / 2  # the page's: pitches from bore 0 to the root from which lobes count
    return bores, profile, 2 * np.pi * (root + lobe + 0.5) / 39


@pytest.mark.parametrize("place", [0, 1])
@pytest.mark.parametrize("turn", [0, 1, 2])
def test_a_disc_turned_as_the_list_says_is_the_same_piece_of_steel(place: int, turn: int) -> None:
    """Bores, profile and the damaged lobe move by a third of a turn together; an angle knows no numbers of lobes."""
    rng = np.random.default_rng(3)
    errors = [
        rverror.Effect("cycloid.disc_bore_position", {"crank": c}, tuple(rng.normal(0, 4e-3, 2))) for c in (0, 1, 2)
    ]
    errors += [
        rverror.Effect("cycloid.disc_profile", {"harmonic": h}, tuple(rng.normal(0, 4e-3, 2))) for h in (1, 2, 3)
    ]
    errors.append(rverror.effect("cycloid.disc_lobe", lobe=17, deviation="9 um"))
    discs = [rverror.parts.MeasuredPart("disc", f"D{p}", tuple(errors), "", p) for p in (0, 1)]
    unit = rverror.parts.unit_of_parts(rverror.Model(THREE), discs, turns={"disc": [turn, 0][:: 1 - 2 * place]})
    bores, _, crest = body(tuple(errors), place)
    turned, wave, lobe = body(tuple(e for e in unit.effects if e.indices["disc"] == place), place)
    step = np.exp(2j * np.pi * turn / 3)
    for crank, centre in bores.items():
        assert turned[(crank + turn) % 3] == pytest.approx(centre * step, abs=1e-12)
    moved = sum(
        e.values[0] * np.cos(h * (ANGLES - 2 * np.pi * turn / 3))
        + e.values[1] * np.sin(h * (ANGLES - 2 * np.pi * turn / 3))
        for h, e in enumerate(errors[3:6], 1)
    )
    assert wave == pytest.approx(moved, abs=1e-12)
    assert np.exp(1j * lobe) == pytest.approx(np.exp(1j * crest) * step, abs=1e-12)


def test_a_disc_is_not_turned_to_where_its_lobes_do_not_fit() -> None:
    alike = [rverror.parts.MeasuredPart("disc", name, ()) for name in ("A", "B")]
    two = rverror.Model(rverror.reducer("RV-40E"))
    with pytest.raises(InputError, match=r"disc B: .*do not fit at place 1 turned by 0 pitches of its bores; choose"):
        rverror.parts.unit_of_parts(two, alike, turns={"disc": [0, 0]})
    rverror.parts.unit_of_parts(two, alike, turns={"disc": [0, -1]})
    with pytest.raises(InputError, match="turns of disc: 1 for 2 in a unit; give one for each place"):
        rverror.parts.unit_of_parts(two, alike, turns={"disc": [0]})
    crank = [rverror.parts.MeasuredPart("crank", name, ()) for name in ("A", "B")]
    with pytest.raises(InputError, match="crank B: turn = 2: only discs, suns and housings are turned"):
        rverror.parts.unit_of_parts(two, crank, turns={"crank": [0, 2]})


LIST = "unit,disc_0,disc_1,housing,disc_1_turn,transmission error at 412 N*m\n2,D18,D17,H1,1,12.5\n7,D17,D18,,0,13\n"


def test_a_list_for_the_shop_is_read(tmp_path: Path) -> None:
    path = tmp_path / "units.csv"
    for text in (LIST, LIST.replace(",", ";"), "\ufeff" + LIST.replace("\n", "\r\n")):
        path.write_text(text, encoding="utf-8", newline="")
        places, turns = rverror.parts.places_in_list(path, 2)
        assert (places, turns) == ({"disc": ("D18", "D17"), "housing": ("H1",)}, {"disc": (0, 1)})
    unit = rverror.parts.unit_of_parts(rverror.Model(UNIT), [*DISCS, HOUSING], places)
    assert [e.indices.get("disc") for e in unit.effects] == [0, 1, None]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (LIST, "no unit 3: the list has 2, 7 ...; give one that"),
        ("", "no unit 3: the list has no numbers in a column unit"),
        ("a,b\n1,2\n", "no unit 3: the list has no numbers in a column unit"),
        ("unit,disc_0,disc_2\n3,D17,D18\n", "columns of disc 0, 2; give one for each place, from disc_0 on"),
        ("unit,disc_0,disc_0_turn\n3,D17,x\n", "unit 3: a part turned by 'x'; give a whole number"),
    ],
)
def test_a_list_that_cannot_be_used(tmp_path: Path, text: str, told: str) -> None:
    (tmp_path / "units.csv").write_text(text)
    with pytest.raises(InputError, match=told):
        rverror.parts.places_in_list(tmp_path / "units.csv", 3)


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
    few = rverror.diagnosis.Policy(keys=("sensor.encoder_eccentricity", "crank.eccentricity", "cycloid.disc_pitch"))
    found = rverror.diagnose(unit, runs, policy=few)
    assert [effect.key for effect in found.model.effects[len(unit.effects) :]] == ["sensor.encoder_eccentricity"]
    added = found.model.effects[-1].values
    assert added == pytest.approx((8 * rverror.ARCSEC, 3 * rverror.ARCSEC), abs=0.1 * rverror.ARCSEC)
