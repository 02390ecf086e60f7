"""Lots of drives: what was put into simulated units comes out, chances are those of other derivations."""

from __future__ import annotations

import json
import math
import runpy
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy

import rverror
from pages import ROOT
from rverror import InputError
from rverror.app.command_line import main
from rverror.base.units import ARCSEC
from rverror.lots.amplitudes import LotUnit
from rverror.lots.of_drives import DriveLot, lot_of_drives, told_apart

MODEL = rverror.Model(rverror.Drive(ratio=7.0, name="seven"))
TURN = 2 * math.pi
ORDERS = 40
SHARED = (4, 80 * ARCSEC, 1.1)  # order, amplitude, phase


def waves(count: int, seed: int) -> np.ndarray:
    """Normal waves of orders 1 to 40, falling as 1/k, of units that share nothing, rad."""
    normal = np.random.default_rng(seed).standard_normal((2, count, ORDERS))
    return np.asarray((normal[0] + 1j * normal[1]) * 100 * ARCSEC / np.arange(1, ORDERS + 1))


def units(given: np.ndarray, *, zero: float = 0.0, noise: float = 0.5 * ARCSEC, seed: int = 9) -> list[LotUnit]:
    theta = np.arange(180) * TURN / 180
    found = []
    for number, own in enumerate(given):
        te = (own * np.exp(1j * np.outer(theta, np.arange(1, own.size + 1)))).real.sum(axis=1)
        te = te + noise * np.random.default_rng([seed, number]).standard_normal(theta.size)
        run = rverror.run_from_arrays(input_angle=7.0 * (theta + zero), te=te, direction="forward")
        found.append(LotUnit(f"u{number}", (run,)))
    return found


def known(seed: int = 3) -> np.ndarray:
    """Twelve units that share order 4; unit 7 has its own order 1, units 2 and 9 are one motor measured twice."""
    given = waves(12, seed)
    order, amplitude, phase = SHARED
    given[:, order - 1] = amplitude * np.exp(1j * phase) + 0.2 * given[:, order - 1]
    given[7, 0] = 3000 * ARCSEC * np.exp(2j)
    given[9] = given[2] * (1 + 0.02j)
    return given


@pytest.fixture(scope="module")
def found() -> DriveLot:
    return lot_of_drives(MODEL, units(known()))


def test_what_was_put_in_comes_out(found: DriveLot) -> None:
    (shared,) = [one for one in found.orders if one.shared]
    assert shared.order == SHARED[0]
    assert shared.mean.value == pytest.approx(SHARED[1], rel=0.1)
    assert shared.mean.high - shared.mean.low < 0.4 * SHARED[1]
    assert shared.phase == pytest.approx(SHARED[2], abs=0.1)
    assert [(one.serial, one.order) for one in found.own] == [("u7", 1)]
    assert found.own[0].amplitude == pytest.approx(3000 * ARCSEC, rel=1e-3)
    assert [pair.serials for pair in found.pairs] == [("u2", "u9")]
    assert found.pairs[0].difference < 0.05 * found.pairs[0].usual
    assert max(one.order for one in found.orders) <= ORDERS  # the rest is noise
    assert len(found.amplitudes) == 12


def test_the_zero_of_the_input_turns_phases_alone(found: DriveLot) -> None:
    """A zero that is a later turns order k by -k a, of every unit alike."""
    turned = lot_of_drives(MODEL, units(known(), zero=0.3))
    assert [one.order for one in turned.orders] == [one.order for one in found.orders]
    for one, other in zip(turned.orders, found.orders, strict=True):
        assert one.mean.value == pytest.approx(other.mean.value, rel=1e-6)
        assert math.remainder(one.phase - other.phase + 0.3 * one.order, TURN) == pytest.approx(0, abs=1e-6)
    assert [one.chance for one in turned.own] == pytest.approx([one.chance for one in found.own], rel=1e-4)


def test_distance_and_chance_are_those_of_hotelling_against_the_others() -> None:
    """The unit left out, the F of two samples, one of them of one unit: the closed form needs no unit left out."""
    rng = np.random.default_rng(5)
    wave = rng.standard_normal(14) + 0.4j * rng.standard_normal(14)
    wave[5] += 6 + 2j
    members, odd = told_apart(wave, 0.9)
    assert list(odd) == [5]
    rest = wave[members]
    covariance = np.cov(rest.real, rest.imag)
    apart = np.array([(wave[5] - rest.mean()).real, (wave[5] - rest.mean()).imag])
    squared = float(apart @ np.linalg.solve(covariance, apart)) / (1 + 1 / rest.size)
    freedom = rest.size - 1
    chance = float(scipy.stats.f.sf(squared * (freedom - 1) / (2 * freedom), 2, freedom - 1))
    assert odd[5][0] == pytest.approx(math.sqrt(squared), rel=1e-9)
    assert odd[5][1] == pytest.approx(14 * 5 * chance, rel=1e-9)  # of 14 units, in five steps


def test_two_far_units_do_not_hide_one_another() -> None:
    """Together they take so much of the covariance that neither is told by itself."""
    wave = waves(12, 8)[:, 0] / ARCSEC
    wave[[3, 6]] = 4000
    assert sorted(told_apart(wave, 0.05)[1]) == [3, 6]
    wave[6] = 40_000j
    assert sorted(told_apart(wave, 0.05)[1]) == [3, 6]


def test_units_are_told_from_normal_ones_as_rarely_as_stated() -> None:
    """At 20 %: of 500 lots of nine no more than chance (three standard errors) allows, and some."""
    told = sum(bool(told_apart(waves(9, seed)[:, 0], 0.2)[1]) for seed in range(500))
    assert 10 < told < 500 * 0.2 + 3 * math.sqrt(500 * 0.2 * 0.8)


def test_a_shared_phase_is_as_likely_as_random_walks_make_it() -> None:
    """The chance of a sum of eight unit vectors, against a hundred thousand of them."""
    steps = np.exp(1j * TURN * np.random.default_rng(2).random((100_000, 8)))
    lengths = np.abs(steps.sum(axis=1))
    given = waves(8, 3)[:, :1]
    given = np.abs(given) * np.exp(1j * np.array([0.0, 0.3, -0.4, 0.8, -0.7, 0.2, 2.5, 0.1]))[:, None]
    (order,) = [one for one in lot_of_drives(MODEL, units(given)).orders if one.order == 1]
    own = abs(np.exp(1j * np.angle(given[:, 0])).sum())
    tests = len(lot_of_drives(MODEL, units(given)).orders)
    assert order.chance / tests == pytest.approx(float(np.mean(lengths >= own)), rel=0.15)


def test_lots_are_told_only_what_they_have() -> None:
    """Of 30 lots that share order 4 alone 5 % each: more than five of any is a chance of 1 in 300."""
    own, pairs, more, held = 0, 0, 0, 0
    for seed in range(30):
        given = waves(9, 100 + seed)
        given[:, 3] += SHARED[1] * np.exp(1j * SHARED[2])
        found = lot_of_drives(MODEL, units(given))
        own += bool(found.own)
        pairs += bool(found.pairs)
        more += any(one.shared and one.order != SHARED[0] for one in found.orders)
        held += any(one.order == SHARED[0] and SHARED[1] in one.mean for one in found.orders)
    assert max(own, pairs, more) <= 5
    assert held >= 25  # of 95 %


def test_noise_alone_has_no_orders_and_a_weak_wave_has_its_own() -> None:
    """5 % of lots of noise are told an order: more than five of 30 is a chance of 1 in 300.

    A wave whose power in all units together is 2.5 times that of noise is told as it should: of 24 degrees of freedom
    chance leaves a power of 2.2 times in an order of 90, and such a wave has 3.5 +/- 0.7 with the noise in it.
    """
    noise = 0.5 * ARCSEC
    given = np.zeros((12, ORDERS), dtype=complex)
    assert sum(bool(lot_of_drives(MODEL, units(given, noise=noise, seed=seed)).orders) for seed in range(30)) <= 5
    given[:, 6] = math.sqrt(2.5 * 4 * noise**2 / 180) * np.exp(1j * np.arange(12))
    found = [lot_of_drives(MODEL, units(given, noise=noise, seed=seed)).orders for seed in range(30)]
    assert sum(any(one.order == 7 for one in orders) for orders in found) >= 25


def test_copies_are_pairs_and_nothing_breaks() -> None:
    given = np.repeat(waves(1, 1), 7, axis=0)
    found = lot_of_drives(MODEL, units(given, noise=0.0))
    assert not found.own
    assert all(one.shared for one in found.orders)
    given[4] = waves(1, 2)
    odd = lot_of_drives(MODEL, units(given, noise=1e-9)).own
    assert {one.serial for one in odd} == {"u4"}
    assert all(one.distance > 100 for one in odd)


def test_refusals() -> None:
    with pytest.raises(InputError, match="5 of drives, it takes 6"):
        lot_of_drives(MODEL, units(waves(5, 0)))
    with pytest.raises(InputError, match=r"give a model with \[drive\]; lot takes reducers"):
        lot_of_drives(rverror.Model(rverror.reducer("RV-40E")), [])
    turned = [replace(one, runs=(replace(one.runs[0], index="unknown"),)) for one in units(known())]
    with pytest.raises(InputError, match=r"index: unknown.*turn each to its marks"):
        lot_of_drives(MODEL, turned)
    with pytest.raises(InputError, match="give a list of units"):
        lot_of_drives(MODEL, ["a"])  # type: ignore[list-item]


# --- the command ------------------------------------------------------------------------------------------------------


def put(folder: Path, given: Sequence[LotUnit]) -> None:
    for unit in given:
        (folder / unit.serial).mkdir(parents=True)
        rverror.runs.write_run(folder / unit.serial / "run.csv", unit.runs[0])
    (folder / "drive.toml").write_text('name = "seven"\n[drive]\nratio = 7.0\n', "utf-8")


def test_the_command_tells_a_folder_and_its_compressed_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], found: DriveLot
) -> None:
    monkeypatch.chdir(tmp_path)
    put(Path("lot"), units(known()))
    words = ["lot", "lot", "--model", "lot/drive.toml"]
    assert main([*words, "--json", "lot.json", "--html", "lot.html"]) == 0
    printed = capsys.readouterr().out
    assert (
        "Order 4 has the same phase in all units. Differing from the others: 1 unit; nearly equal: 1 pair." in printed
    )
    told = json.loads(Path("lot.json").read_text("utf-8"))
    assert told["variables"]["own_unit"]["values"] == ["u7"]
    assert told["variables"]["order"]["values"] == [one.order for one in found.orders]
    assert "<h2>Pairs of nearly equal units</h2>" in Path("lot.html").read_text("utf-8")
    assert main([*words, "--compress", "lot.jsonl"]) == 0
    capsys.readouterr()
    assert main(["lot", "lot.jsonl", "--model", "lot/drive.toml"]) == 0
    assert capsys.readouterr().out.splitlines()[1] == printed.splitlines()[1]
    for option in (["--save", "x.toml"], ["--tolerances", "x.toml"], ["--diagnose", "2"]):
        assert main([*words, *option]) == 2
        assert "whose lot has orders and no processes" in capsys.readouterr().err


# --- tables of a firmware ---------------------------------------------------------------------------------------------

SOURCE = """
const float lookup[] = {{{}, }}; // degrees
const int __attribute__((__aligned__(256))) cents[256] PROGMEM = {{ // hundredths
{}}};
const int sine[] = {{{}}};  /* goes to and fro */
static const uint16_t names[] = {{ A, B }};
"""


def test_tables_of_a_firmware_become_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Wherever the zero of the motor lies, in degrees and in hundredths of them, and one that falls."""
    tool = runpy.run_path(str(ROOT / "benchmarks" / "real_machines" / "lookup_tables.py"))
    count = np.arange(512) / 512
    motor = count + 0.001 * np.cos(2 * TURN * count)
    degrees = ", ".join(f"{x:.4f}" for x in 360 * ((motor + 0.4) % 1))
    hundredths = ", ".join(str(round(x)) for x in 36000 * ((0.25 - motor[::2]) % 1))
    sine = ", ".join(str(round(x)) for x in 1000 * np.sin(TURN * count))
    file = tmp_path / "fw" / "Parameters.cpp"
    file.parent.mkdir()
    file.write_text(SOURCE.format(degrees, hundredths, sine), "utf-8")
    monkeypatch.setattr("sys.argv", ["lookup_tables", str(tmp_path / "lot"), str(file), str(file)])
    tool["main"]()
    captured = capsys.readouterr()
    assert "2 units in" in captured.out
    assert captured.err.count("left out") == 2
    for name in ("fw-Parameters", "fw-Parameters-2"):
        run = rverror.load_run(tmp_path / "lot" / name / "run.csv", 1.0)
        te = run.error(1.0)
        np.testing.assert_allclose(te - te.mean(), TURN * 0.001 * np.cos(2 * run.nominal_angle(1.0)), atol=2e-4)
