"""The two example lists of an RV-40E: what their words say of lost motion, stiffness and error, on a few units."""

from __future__ import annotations

import re
import sys

import numpy as np
import pytest

import rverror
from pages import ROOT
from rverror import ARCSEC
from rverror.tolerances.grades import it_width

sys.path.append(str(ROOT / "benchmarks"))

import two_lists

EXAMPLES = ROOT / "examples"
MAKER = EXAMPLES / "rv40e-maker-tolerances.toml"
UNITS = 8


def lost_motions(model: rverror.Model, tolerances: list) -> np.ndarray:
    """Largest over the turn of some units, arcsec."""
    units = two_lists.drawn(model, tolerances, UNITS, 1)
    return np.array([rverror.lost_motion(unit, two_lists.PLACES).max() for unit in units]) / ARCSEC


@pytest.fixture(scope="module")
def maker() -> tuple[rverror.Model, list]:
    model = rverror.load_model(EXAMPLES / "rv40e-maker.toml")
    return model, list(rverror.load_tolerances(MAKER, model))


def test_the_nominal_unit_has_the_stiffness_of_the_maker(maker: tuple[rverror.Model, list]) -> None:
    stiffness = rverror.statics.torsional_stiffness(maker[0], two_lists.PLACES).mean() * 60 * ARCSEC * 1e-3
    assert stiffness == pytest.approx(108, abs=0.1)
    factor = {maker[0].mechanism.stiffness.__dict__[k] / v for k, v in rverror.geartrain.Stiffness().__dict__.items()}
    assert list(factor) == pytest.approx([1.415] * len(factor))


def test_units_of_the_list_keep_what_the_maker_prints(maker: tuple[rverror.Model, list]) -> None:
    found = np.array([two_lists.figures(unit) for unit in two_lists.drawn(*maker, 3, 1)])
    assert (found[:, :2] < two_lists.PEAK_TO_PEAK).all()
    assert (found[:, 4] > two_lists.STIFFNESS).all()
    lost = lost_motions(*maker)
    assert (lost < two_lists.LOST_MOTION).all()
    assert 30 < np.median(lost) < 45


def test_the_list_of_004_is_no_sold_unit() -> None:
    model = rverror.load_model(EXAMPLES / "rv40e.toml")
    lost = lost_motions(model, list(rverror.load_tolerances(EXAMPLES / "rv40e-tolerances.toml", model)))
    assert ((lost > 340) & (lost < 470)).all()
    assert lost.min() > 5 * two_lists.LOST_MOTION


def test_every_line_says_its_origin_and_the_arithmetic_is_right(maker: tuple[rverror.Model, list]) -> None:
    text = MAKER.read_text(encoding="utf-8")
    origins = re.findall(r"^\[\[tolerance\]\](?:  # (.*))?$", text, flags=re.MULTILINE)
    assert len(origins) == len(maker[1])
    for origin in origins:
        assert re.match(r"(00[0-4]|ISO 286-1|ISO 1328-1|assumed)\b", origin), origin
    assert all(item.cost is not None for item in maker[1])
    assert text.count("# illustrative") == len(origins)
    widths = {item.label: item.width * 1e3 for item in maker[1]}
    # ISO 1328-1, 1995, grade 5 to grade 2
    d, m = 122.0, 122 / 39
    pitch, form = 0.3 * m + 1.25 * d**0.5 + 7, 3.2 * m**0.5 + 0.22 * d**0.5 + 0.7
    finer = 2 * 2**1.5
    assert widths["cycloid.disc_pitch(harmonic=1)"] == pytest.approx(pitch / finer, abs=0.01)
    assert widths["runout of the lobes"] == pytest.approx(0.8 * pitch / finer, abs=0.03)
    assert widths["form of the discs"] == pytest.approx(form / finer, abs=0.01)
    assert widths["cycloid.pin_position"] == pytest.approx(it_width("IT4", 128) / 2 * 1e3)
    assert widths["cycloid.pin_circle(harmonic=2)"] == pytest.approx(10 * ARCSEC * 64e3 / 2, abs=0.01)


def test_it_prints_its_table(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """At few angles: numbers of units are compared above."""
    monkeypatch.setattr(two_lists, "PLACES", two_lists.PLACES[::16])
    two_lists.main([str(EXAMPLES / "rv40e.toml"), str(EXAMPLES / "rv40e-tolerances.toml"), "--units", "1", "--lines"])
    printed = capsys.readouterr().out
    assert "SIMULATED" in printed
    assert all(name in printed for name in two_lists.FIGURES)
    assert "coupling.bearing_clearance" in printed


def test_the_page_says_what_drives_the_error(maker: tuple[rverror.Model, list]) -> None:
    page = " ".join((ROOT / "docs" / "theory" / "rigidity.md").read_text(encoding="utf-8").split())
    found = rverror.tolerances.budget(rverror.tolerances.stack(*maker))
    first = sorted(found.contributions, key=lambda c: -c.share)[:4]
    assert [c.label for c in first] == [
        "runout of the lobes",
        "crank.eccentricity",
        "cycloid.disc_pitch(harmonic=1)",
        "cycloid.disc_bore_position",
    ]
    shares = [f"{100 * c.share:.0f}" for c in first]
    assert f"crank holes have {', '.join(shares[:3])} and {shares[3]} %" in page
