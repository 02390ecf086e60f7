"""Simulated measurements become the errors they were made with, within the uncertainty that is stated."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
import scipy

import rverror
from pages import ROOT
from rverror.geartrain.contacts import pose
from rverror.geartrain.cycloid import disc_lobe
from rverror.parts import fits

sys.path.append(str(ROOT))

from benchmarks import parts_trial as trial

UNIT, UM = trial.UNIT, trial.UM


def read(folder: Path, mapping: str, lines: str) -> rverror.parts.PartsRead:
    (folder / "mapping.toml").write_text(mapping, encoding="utf-8")
    (folder / "part.csv").write_text(lines, encoding="utf-8")
    return rverror.load_parts(folder / "part.csv", UNIT, mapping=folder / "mapping.toml")


@pytest.mark.parametrize(
    ("name", "count"), [("lobe scan", 8), ("pin table", 10), ("cam scans", 40), ("pitch chart with runout", 30)]
)
def test_stated_uncertainty_holds(name: str, count: int) -> None:
    """95.4 % of a normal distribution lie within 2 sigma; the trial in benchmarks/ counts 300 parts of each."""
    by_effect = list(trial.deviations(name, count, 1))
    found = np.concatenate([each for _, each in by_effect])
    within = int(np.sum(np.abs(found) <= 2))
    low, high = scipy.stats.binom.interval(1 - 1e-4, found.size, 0.9545)
    assert low <= within <= high, f"{within} of {found.size}"
    # of pitch alone too: of a radius, read along its ray, the flanks tell more than the crests
    for part in (
        found,
        np.concatenate([each for key, each in by_effect if "pitch" in key or "pin_" in key] or [found]),
    ):
        low, high = scipy.stats.chi2.interval(1 - 1e-3, part.size)
        assert low <= part @ part <= high, f"{part @ part / part.size} times the variance"


def test_a_scan_without_noise_has_hardly_an_error(tmp_path: Path) -> None:
    truth, lines = trial.lobe_scan(np.random.default_rng(7), points=24, noise=0.0)
    (part,) = read(tmp_path, trial.LOBES, lines).parts
    for error in part.errors:
        assert error.values == pytest.approx(truth[rverror.base.describe(error.key, error.indices)], abs=0.03 * UM)


@pytest.mark.parametrize("place", [0, 1])
def test_a_worn_lobe_is_found_where_the_catalogue_counts_it(place: int) -> None:
    """The bump of `cycloid.disc_lobe` itself, at the crest that the equilibrium's contact angle tells."""
    lobe = 11
    _, curve, outward = trial.nominal_disc(place, 400)
    psi = np.angle(curve)
    # the catalogue's own vector, asked at the contacts of one crank turn: which psi does its lobe cover?
    theta = np.linspace(0, 2 * np.pi, 4000, endpoint=False)
    motion = pose(UNIT, theta)
    source = disc_lobe(motion, disc=place, lobe=lobe)
    size = np.linalg.norm(np.asarray(source.vector)[0, 0], axis=-2)
    met = size > 0.99
    crest = np.angle(np.exp(1j * motion.pin_angle[place][met]).mean())
    away = np.angle(np.exp(1j * (psi - crest)))
    half = np.pi / UNIT.disc_lobes
    worn = curve - 8 * UM * np.where(abs(away) < half, np.cos(np.pi * away / (2 * half)) ** 2, 0.0) * outward
    noise = 0.3 * UM * np.random.default_rng(1).standard_normal(worn.size)
    points = worn + noise * worn / abs(worn)
    found = fits.fit_lobes(UNIT, points[::7], harmonics=4, lobe_harmonics=2, sigma=0.3 * UM)
    assert (found.place, found.lobes) == (place, (lobe,))
    assert found.estimate.values[-1] == pytest.approx(-8 * UM, abs=4 * found.estimate.sigmas[-1])


def test_a_scan_about_the_bores_tells_their_places(tmp_path: Path) -> None:
    """A perfect disc, moved and turned: its bores, still where the machine has them, are off its lobes."""
    _, curve, _ = trial.nominal_disc(0, 4000)
    moved, turn = 0.008 - 0.005j, 2e-4
    seen = curve * np.exp(1j * turn) + moved
    angle = np.linspace(0, 2 * np.pi, 40 * UNIT.disc_lobes, endpoint=False) + 0.001
    order = np.argsort(np.angle(seen))
    radius = np.interp(angle, np.angle(seen)[order], abs(seen)[order], period=2 * np.pi)
    mapping = trial.LOBES.replace('"fit"', '"bores"')
    (part,) = read(tmp_path, mapping, trial.table("angle,radius", np.degrees(angle), radius)).parts
    bores = [error for error in part.errors if error.key == "cycloid.disc_bore_position"]
    assert len(bores) == UNIT.cranks
    for j, bore in enumerate(bores):
        along = np.exp(2j * np.pi * j / UNIT.cranks)
        error = ((UNIT.crank_radius * along - moved) * np.exp(-1j * turn) - UNIT.crank_radius * along) * np.conj(along)
        assert bore.values == pytest.approx((error.real, error.imag), abs=0.02 * UM)
    assert max(abs(v) for e in part.errors if e not in bores for v in e.values) < 0.02 * UM


def test_a_disc_that_is_made_for_another_place(tmp_path: Path) -> None:
    _, curve, _ = trial.nominal_disc(1, 20)
    lines = trial.table("angle,radius", np.degrees(np.angle(curve)), abs(curve))
    assert any("those of disc 1" in note for note in read(tmp_path, trial.LOBES, lines).notes)
    with pytest.raises(rverror.InputError, match="place = 0, but its lobes stand as those of disc 1; correct place"):
        read(tmp_path, trial.LOBES + "place = 0\n", lines)
    with pytest.raises(rverror.InputError, match="place = 2: a unit has discs 0 to 1"):
        read(tmp_path, trial.LOBES + "place = 2\n", lines)
    (disc,) = read(tmp_path, trial.LOBES, lines).parts
    rverror.parts.save_parts(tmp_path / "parts.csv", [disc])
    assert disc.made_for == 1
    assert rverror.load_parts(tmp_path / "parts.csv", UNIT).parts == (disc,)


def test_a_deviation_scan_says_what_a_radius_scan_says(tmp_path: Path) -> None:
    """A wave of profile and nothing else, as deviations along the normal at polar angles."""
    angle = np.linspace(0, 2 * np.pi, 20 * UNIT.disc_lobes, endpoint=False)
    lines = trial.table("angle,dev", np.degrees(angle), 3 * np.cos(4 * angle) - 2 * np.sin(4 * angle))
    mapping = trial.LOBES.replace('radius = { name = "radius", unit = "mm"', 'deviation = { name = "dev", unit = "um"')
    (part,) = read(tmp_path, mapping, lines).parts
    for error in part.errors:
        wave = (error.key, dict(error.indices)) == ("cycloid.disc_profile", {"harmonic": 4})
        # second order of 3.6 um on a lobe's root of 1 mm
        assert error.values == pytest.approx((3 * UM, -2 * UM) if wave else (0.0, 0.0), abs=0.02 * UM)


@pytest.mark.parametrize(("datum", "lost"), [("given", ()), ("axis", ("turn",)), ("fit", ("turn", "move"))])
def test_a_datum_takes_what_the_page_says(tmp_path: Path, datum: str, lost: tuple[str, ...]) -> None:
    """A ring that is turned, moved and grown: growth is never lost."""
    gamma = 2 * np.pi * np.arange(UNIT.pins) / UNIT.pins
    turn, move, grown = 4e-5, 0.002 + 0.003j, 0.004
    places = (UNIT.pin_circle_radius + grown) * np.exp(1j * (gamma + turn)) + move
    mapping = trial.PINS.replace('"fit"', f'"{datum}"\nharmonics = 2').replace("diameter", "# diameter")
    lines = trial.table("pin,x,y,d", np.arange(UNIT.pins), places.real, places.imag, 0 * gamma)
    (part,) = read(tmp_path, mapping, lines).parts
    by_wave = {error.indices["harmonic"]: error.values for error in part.errors}
    tangential = 0.0 if "turn" in lost else UNIT.pin_circle_radius * turn
    x, y = (0.0, 0.0) if "move" in lost else (move.real, move.imag)
    # cos and sin of the radial wave, then of the tangential one: e along p_i and across it
    assert by_wave[0] == pytest.approx((grown, 0, tangential, 0), abs=1e-3 * UM)
    assert by_wave[1] == pytest.approx((x, y, y, -x), abs=1e-3 * UM)
    assert by_wave[2] == pytest.approx((0, 0, 0, 0), abs=1e-3 * UM)
    # a wave over n pins has the variance 2/n of a reading, wave 0 of it half; of wave 1 moving takes half
    spread = {error.indices["harmonic"]: (error.uncertainty or 0.0) / (0.5 * UM) for error in part.errors}
    assert spread[0] == pytest.approx(np.sqrt(1 / UNIT.pins), rel=0.01)
    assert spread[1] == pytest.approx(np.sqrt((1 if "move" in lost else 2) / UNIT.pins), rel=0.01)
    assert spread[2] == pytest.approx(np.sqrt(2 / UNIT.pins), rel=0.01)


def test_single_places_are_as_sure_as_the_datum_leaves_them(tmp_path: Path) -> None:
    """Two cams, turned in centres: of the tangential errors the turn takes half, of the radial ones nothing."""
    cams = UNIT.eccentricity * np.array([1, -1])
    mapping = trial.PINS.replace("housing", "crank").replace("diameter", "# diameter").replace('"fit"', '"axis"')
    (part,) = read(tmp_path, mapping, trial.table("pin,x,y,d", [0, 1], cams, 0 * cams, 0 * cams)).parts
    for error in part.errors:
        assert error.values == (0.0, 0.0)
        assert error.uncertainty == pytest.approx(0.5 * UM * np.sqrt((1 + 0.5) / 2), rel=0.01)


def test_waves_of_a_ring_are_its_single_pins(tmp_path: Path) -> None:
    """Both descriptions of one table make the same transmission error, but for what the waves leave."""
    gamma = 2 * np.pi * np.arange(UNIT.pins) / UNIT.pins
    errors = (3 * np.cos(2 * gamma) - np.sin(4 * gamma) + 1j * np.cos(3 * gamma)) * UM
    places = (UNIT.pin_circle_radius + errors) * np.exp(1j * gamma)
    lines = trial.table("pin,x,y,d", np.arange(UNIT.pins), places.real, places.imag, 0 * gamma)
    mapping = trial.PINS.replace("diameter", "# diameter")
    curves = []
    for more in ("", "harmonics = 5"):
        read_parts = read(tmp_path, mapping + more, lines)
        unit = rverror.parts.unit_of_parts(rverror.Model(UNIT), read_parts.parts)
        curves.append(rverror.transmission_error(unit, np.linspace(0, 1, 400)))
    assert np.ptp(curves[0]) > 3 * rverror.ARCSEC
    assert curves[1] == pytest.approx(curves[0], abs=1e-5 * rverror.ARCSEC)


def test_teeth_counted_clockwise_and_from_another_one(tmp_path: Path) -> None:
    """The same planet on another machine: teeth and pitch count the other way, and begin at another tooth."""
    rng = np.random.default_rng(3)
    teeth = UNIT.planet_teeth
    lead = 3 * rng.standard_normal(teeth)  # um, counter-clockwise, of each tooth in turn
    mapping = trial.TEETH.replace("pitch", "cumulative").replace('"fp"', '"F"').replace("runout", "# runout")
    (one,) = read(tmp_path, mapping, trial.table("tooth,F,Fr", np.arange(teeth), lead, lead)).parts
    start = 5
    backwards = [(start - i) % teeth for i in range(teeth)]
    other = (
        mapping.replace('unit = "um"', 'unit = "um", sign = -1') + f'sense = -1\nzero = "{360 * start / teeth} deg"\n'
    )
    lines = trial.table("tooth,F,Fr", np.arange(teeth) + 1, 7 - lead[backwards], lead)
    (two,) = read(tmp_path, other, lines).parts
    for a, b in zip(one.errors, two.errors, strict=True):
        assert b.values == pytest.approx(a.values, abs=1e-5 * UM)
        assert b.uncertainty == pytest.approx(0.4 * UM * np.sqrt(2 / teeth), rel=0.01)


def test_more_than_noise_widens_the_uncertainty_of_a_scan(tmp_path: Path) -> None:
    """A wave that is not fitted is no noise of the machine; where nothing is stated the residual says it all."""
    angle = np.linspace(0, 2 * np.pi, 20 * UNIT.disc_lobes, endpoint=False)
    noise = 0.3 * np.random.default_rng(2).standard_normal(angle.size)
    mapping = trial.LOBES.replace('radius = { name = "radius", unit = "mm"', 'deviation = { name = "dev", unit = "um"')
    found = {}
    for name, text, deviation in (
        ("noise", mapping, noise),
        ("form", mapping, noise + 3 * np.sqrt(2) * np.cos(17 * angle)),
        ("unstated", mapping.replace(', uncertainty = "0.3 um"', ""), noise),
        ("common", mapping + 'common = "0.5 um"', noise),
    ):
        (part,) = read(tmp_path, text, trial.table("angle,dev", np.degrees(angle), deviation)).parts
        found[name] = next(e.uncertainty for e in part.errors if dict(e.indices) == {"harmonic": 3}) or 0.0
    assert found["form"] == pytest.approx(10 * found["noise"], rel=0.1)
    assert found["unstated"] == pytest.approx(found["noise"], rel=0.1)
    assert found["common"] == pytest.approx(np.hypot(found["noise"], 0.5 * UM), rel=0.01)
