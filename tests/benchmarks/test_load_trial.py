"""The judge of benchmarks/load_trial: numbers that were checked elsewhere, one comparison, and its parts."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rverror
from pages import ROOT

sys.path.append(str(ROOT))

from benchmarks.load_trial import __main__ as trial, draws, grades, judging, lists, sizes
from benchmarks.load_trial.__main__ import main
from benchmarks.load_trial.kernel import Train, add_bearing
from benchmarks.load_trial.parts import KINDS, Error, build, declared, limits, size
from benchmarks.load_trial.planar import perfect, solve, train_of

ARCSEC = 180 * 3600 / math.pi
UNIT = rverror.reducer("RV-40E")
TRAIN = train_of(UNIT)
RIGID = TRAIN._replace(k_cam=1e9, k_bore=1e9, k_mesh=1e9, k_main=1e9)
E = 5e-3  # mm
F = 117 / 121
THETA = 2 * math.pi * np.arange(240) / 240 + 0.01
FINE = 2 * math.pi * np.arange(4096) / 4096


def change(train: Train, errors: list[Error], theta: Any = THETA, torque: float = 412e3, **turned: Any) -> Any:
    """Change of the output by errors, arcsec."""
    unit = build(train, errors)._replace(**turned)
    with_errors, without = solve(train, unit, theta, torque), solve(train, perfect(train), theta, torque)
    assert with_errors.settled.all()
    assert without.settled.all()
    return ARCSEC * (with_errors.output - without.output)


def each(train: Train, key: str, *values: float) -> list[Error]:
    """The same error at every instance of a source."""
    given = {"harmonic": 1} if "harmonic" in KINDS[key].indices else {}
    return [Error(key, index, values) for index in draws._instances(KINDS[key].indices, given, train)]


def order(y: Any, h: int) -> float:
    return 2 * abs(np.fft.rfft(y)[h]) / len(y)


TURNED = E / 1.25  # rad
RING = [Error("cycloid.pin_position", {"pin": i}, (0.0, 64 * TURNED)) for i in range(40)]


@pytest.mark.parametrize(
    ("errors", "turned", "expected"),
    [
        ([], TURNED, TURNED * ARCSEC / 121),
        (RING, 0.0, TURNED * ARCSEC * 120 / 121),
        (RING, TURNED, TURNED * ARCSEC),
        (each(TRAIN, "crank.index", TURNED), 0.0, -20.456),
        (each(TRAIN, "crank.eccentricity", 0.0, E), 0.0, -20.456),
        (each(TRAIN, "cycloid.disc_bore_position", 0.0, E), 0.0, 36.934),
        (each(TRAIN, "coupling.carrier_bore_position", 0.0, E), 0.0, -38.197),
    ],
)
def test_exact_rows_hold_at_any_stiffness(errors: list[Error], turned: float, expected: float) -> None:
    for train in (TRAIN, RIGID):
        found = change(train, errors, torque=2e6, input_turn=np.array([turned]))
        np.testing.assert_allclose(found, expected, rtol=3e-5, atol=1e-7)


def test_radial_errors_of_all_cams_make_next_to_nothing() -> None:
    radial = each(TRAIN, "crank.eccentricity", E, 0.0)
    rigid = change(RIGID, radial, FINE, torque=1e8)
    assert np.ptp(rigid) == pytest.approx(0.18, abs=0.005)
    assert order(rigid, 40) < 1e-4
    # bearings that give way leave a third of it
    assert np.ptp(change(TRAIN, radial, FINE, torque=1e8)) == pytest.approx(0.063, abs=0.002)


@pytest.mark.parametrize(("cranks", "expected"), [(2, 18.467), (3, 12.31)])
def test_one_cam_makes_order_40(cranks: int, expected: float) -> None:
    train = train_of(rverror.reducer("RV-40E", cranks=cranks))
    for values in ((E, 0.0), (0.0, E)):
        y = change(train, [Error("crank.eccentricity", {"crank": 0, "disc": 0}, values)], FINE)
        assert np.ptp(y) == pytest.approx(expected, rel=1e-3)
        assert 2 * order(y, 40) == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(("key", "expected"), [("cycloid.disc_pitch", 6.725), ("cycloid.disc_profile", 9.90)])
def test_waves_of_a_disc_on_rigid_bearings(key: str, expected: float) -> None:
    one = Error(key, {"disc": 0, "harmonic": 1}, (E, 0.0))
    y = change(RIGID, [one], torque=1e8)
    assert order(y, 40) == pytest.approx(expected, rel=1e-3)
    both = change(RIGID, [one, one._replace(indices={"disc": 1, "harmonic": 1})], torque=1e8)
    assert np.ptp(both) < 0.02


def test_an_error_along_one_line_of_action() -> None:
    a = TRAIN.pressure_angle  # the planet towards the sun's flank
    y = change(TRAIN, [Error("involute.center_distance", {"crank": 0}, (-E * math.sin(a), -E * math.cos(a)))])
    np.testing.assert_allclose(y, 0.672, rtol=2e-3)


def test_all_shifted_together_changes_nothing() -> None:
    x, y, theta = 4e-3, -3e-3, 0.7
    c, s = math.cos(theta), math.sin(theta)
    shifted = [
        Error("involute.sun_offset", {}, (x, y)),
        Error("coupling.carrier_runout", {}, (c * x + s * y, c * y - s * x)),
        Error("cycloid.pin_circle", {"harmonic": 1}, (x, y, y, -x)),
    ]
    # pin_circle's wave of 1 about the ring, (x, y).radial and (x, y).tangential, is a shift
    assert abs(change(TRAIN, shifted, np.array([theta]))[0]) < 1e-9


@pytest.mark.parametrize(("torque", "first", "second"), [(20e3, 2.73, 0.65), (1e3, 1.46, 1.06)])
def test_clearance_of_cam_bearings(torque: float, first: float, second: float) -> None:
    y = change(TRAIN, [Error("crank.bearing_clearance", {}, (E,))], FINE, torque)
    assert order(y, 80) == pytest.approx(first, abs=0.006)
    assert order(y, 160) == pytest.approx(second, abs=0.006)
    if torque == 20e3:
        assert -y.mean() == pytest.approx(39, abs=0.5)


def test_clearance_of_carrier_bearings() -> None:
    for way in (1, -1):
        y = change(TRAIN, [Error("coupling.bearing_clearance", {}, (E,))], torque=way * 20e3)
        assert -way * y.mean() == pytest.approx(38.2, abs=0.05)
        assert np.ptp(y) < 1e-3


def test_lost_motion_of_a_gap_at_all_pins() -> None:
    gap = [Error("cycloid.pin_radius", {"pin": "all"}, (-E,))]
    lost = change(TRAIN, gap, torque=-10) - change(TRAIN, gap, torque=10)  # N mm
    least = 2 * F * E / (1.25 * 39) * ARCSEC  # a pin where the arm is largest; that of the nearest is a little less
    assert least == pytest.approx(40.9, abs=0.05)
    assert np.all((lost > least) & (lost < 1.002 * least))


def test_torsional_stiffness() -> None:
    # pins alone give way: each disc takes its share F / nd of the torque with the arms l of its loaded pins
    train = TRAIN._replace(k_cam=1e10, k_bore=1e10, k_mesh=1e10)
    theta = 2 * math.pi * np.arange(48) / 48
    expected = []
    for angle in theta:
        eps, pin = -39 * angle, 2 * math.pi * np.arange(40) / 40
        n = 50 * np.exp(1j * eps) - 64 * np.exp(1j * pin)
        arms = 48.75 * (np.exp(-1j * eps) * n / abs(n)).imag
        expected.append(2 * 2e5 * np.sum(arms[arms > 0] ** 2) / F**2)
    stiffness = sizes.stiffnesses(train, [perfect(train)], 412e3, perfect(train))
    assert stiffness[0] == pytest.approx(min(expected) / 1e3 / (ARCSEC / 60), rel=2e-3)


def random_errors(rng: np.random.Generator, train: Train) -> list[Error]:
    """An error of some 4 um at every instance of every source, clearances too."""
    found = []
    for key, kind in KINDS.items():
        given = {"harmonic": [1, 2, 3]} if "harmonic" in kind.indices else {}
        for index in draws._instances(kind.indices, given, train):
            values = rng.normal(size=len(kind.parameters)) * (4e-4 if key == "crank.index" else 4e-3)
            found.append(Error(key, index, tuple(abs(values) if "clearance" in key else values)))
    return found


@pytest.mark.parametrize("preset", ["RV-40E", "RV-003"])
def test_the_same_as_the_equilibrium_of_rverror(preset: str) -> None:
    unit = rverror.reducer(preset)
    train = train_of(unit)
    errors = random_errors(np.random.default_rng(8), train)
    model = as_model(unit, errors)
    for torque in (20e3, 412e3):
        for way in (1.0, -1.0):
            own = solve(train, build(train, errors), THETA, way * torque)
            other = rverror.equilibrium(model, THETA, torque=torque, direction=way)
            assert own.settled.all()
            assert np.ptp(own.output) * ARCSEC > 20
            assert abs(own.output - other.transmission_error).max() * ARCSEC < 1e-5


def as_model(unit: Any, errors: list[Error]) -> rverror.Model:
    return rverror.Model(unit, [rverror.Effect(e.key, dict(e.indices), tuple(map(float, e.values))) for e in errors])


def test_a_unit_of_the_list_within_the_figures_of_the_maker() -> None:
    path = ROOT / "examples" / "rv40e-maker.toml"
    maker = rverror.load_model(path).mechanism
    train = train_of(maker)
    entries = draws.read(ROOT / "examples" / "rv40e-maker-tolerances.toml", train)
    (errors,) = draws.draw(entries, 1, seed=5, beside=declared(path))
    unit, model = build(train, errors), as_model(maker, errors)
    assert unit.clearance[0] > 0 > unit.clearance[1]  # cams play, carrier bearings are preloaded
    for torque in (20e3, 412e3):  # both sides of the preloaded ones carry, then one
        own, other = solve(train, unit, THETA[::4], torque), rverror.equilibrium(model, THETA[::4], torque=torque)
        assert own.settled.all()
        assert np.ptp(own.output) * ARCSEC > 5
        assert abs(own.output - other.transmission_error).max() * ARCSEC < 1e-5


def test_preload_of_all_bearings_beside_the_equilibrium_of_rverror() -> None:
    preload = rverror.geartrain.BearingPreload(crank_bearing=2e-3, carrier_bearing=1e-3)
    reducer = rverror.reducer("RV-40E", bearing_preload=preload)
    train = train_of(reducer)
    errors = [e for e in random_errors(np.random.default_rng(9), train) if "bearing_clearance" not in e.key]
    unit, model = build(train, errors), as_model(reducer, errors)
    for torque in (20e3, 100e3, 412e3):
        own, other = solve(train, unit, THETA[::4], torque), rverror.equilibrium(model, THETA[::4], torque=torque)
        assert own.settled.all()
        assert abs(own.output - other.transmission_error).max() * ARCSEC < 1e-5


def test_much_preload_makes_bearings_twice_as_stiff() -> None:
    tight = TRAIN._replace(preload_cam=1.0, preload_bore=1.0)
    stiff = TRAIN._replace(k_cam=2 * TRAIN.k_cam, k_bore=2 * TRAIN.k_bore)
    errors = random_errors(np.random.default_rng(3), TRAIN)
    loose = [e for e in errors if "bearing_clearance" not in e.key]
    found = [solve(train, build(train, loose), THETA, 412e3).output for train in (tight, stiff)]
    np.testing.assert_allclose(ARCSEC * found[0], ARCSEC * found[1], atol=1e-6)
    with_clearance = build(tight, errors)  # which takes from it
    assert -1 < with_clearance.clearance.min() < with_clearance.clearance.max() < -0.98


@pytest.mark.parametrize("c", [0.003, -0.003])
def test_a_bearing_is_the_slope_of_its_energy(c: float) -> None:
    k, h = 2.0, 1e-6

    def energy(d: Any) -> float:
        m = math.hypot(*d)
        return k / 2 * (max(m - c, 0.0) ** 2 + max(-c - m, 0.0) ** 2)

    def by_hand(d: Any) -> tuple[Any, Any]:
        g, blocks, coupling, crank = np.zeros(6), np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 3))
        add_bearing(k, c, d[0], d[1], 0.0, 0.0, 0.0, 0.0, 0, 3, g, blocks, coupling, crank, 0)
        np.testing.assert_array_equal(g[:2], -g[3:5])
        return g[3:5], np.triu(crank[:2, :2]) + np.triu(crank[:2, :2], 1).T

    for d in np.array([[0.001, 0.0005], [0.004, -0.003], [0.0, 0.0], [0.02, 0.01]]):
        steps = h * np.eye(2)
        force, stiffness = by_hand(d)
        np.testing.assert_allclose(force, [(energy(d + s) - energy(d - s)) / (2 * h) for s in steps], atol=1e-9)
        np.testing.assert_allclose(
            stiffness, [(by_hand(d + s)[0] - by_hand(d - s)[0]) / (2 * h) for s in steps], atol=1e-5
        )


def test_an_error_of_all_lobes_is_a_wave() -> None:
    # all of them together are (1 + cos(z_c (psi - psi_0))) / 2; disc 1 of an RV-40E has a crest at psi = 0
    lobes = [Error("cycloid.disc_lobe", {"disc": 1, "lobe": lobe}, (E,)) for lobe in range(39)]
    waves = [Error("cycloid.disc_profile", {"disc": 1, "harmonic": h}, (E / 2, 0.0)) for h in (0, 39)]
    np.testing.assert_allclose(change(TRAIN, lobes), change(TRAIN, waves), atol=1e-6)


def test_play_of_the_splines_is_lost_motion() -> None:
    play = each(TRAIN, "involute.spline_clearance", E)
    lost = change(TRAIN, play, torque=-100e3) - change(TRAIN, play, torque=100e3)
    np.testing.assert_allclose(lost, 27 / 9 / 121 / 7 * E * ARCSEC, rtol=1e-6)
    with pytest.raises(ValueError, match="spline_radius"):
        build(TRAIN._replace(spline_radius=math.nan), play)


GRADES = [
    ("cycloid.pin_position", f'grade = "IT{n}"\nsize = "{at} mm"')
    for n in (1, 4, 5, 7, 11, 18)
    for at in (2.5, 3, 10, 40, 64, 128, 251, 500)
] + [
    (key, f'grade = "ISO 1328 {n}"\ndiameter = "{d} mm"\nmodule = "1.5 mm"{more}')
    for n in (1, 5, 8, 11)
    for d in (13.5, 40.5)
    for key, more in (
        ("involute.sun_eccentricity", ""),
        ("involute.planet_pitch", "\nindices = { harmonic = 1 }"),
        ("involute.sun_pitch", "\nindices = { harmonic = 2 }"),
    )
]


def test_grades_have_the_widths_that_rverror_gives_them(tmp_path: Path) -> None:
    path = tmp_path / "tolerances.toml"
    path.write_text("".join(f'[[tolerance]]\nkey = "{key}"\n{lines}\n' for key, lines in GRADES))
    own = [entry.width for entry in draws.read(path, TRAIN)]
    theirs = [tolerance.width for tolerance in rverror.load_tolerances(path, rverror.Model(UNIT))]
    np.testing.assert_allclose(own, theirs, rtol=1e-12)
    assert grades.iso_286(4, 128) == 0.012
    assert grades.iso_1328("involute.sun_pitch", 5, 13.5, 1.5, 1) == 7.5e-3
    for table in ({"grade": "IT5", "size": "501 mm"}, {"grade": "fine"}):
        with pytest.raises(ValueError, match=r"not in the table|not judged"):
            grades.width({"key": "cycloid.pin_position", **table})


def test_an_angle_that_does_not_settle_is_told() -> None:
    errors = [Error("cycloid.pin_radius", {"pin": "all"}, (math.nan,))]
    assert not solve(TRAIN, build(TRAIN, errors), np.array([0.1]), 20e3).settled[0]


def test_peak_to_peak_on_few_angles_is_that_on_all() -> None:
    entries = draws.read(ROOT / "examples" / "rv40e-tolerances.toml", TRAIN)
    like = build(TRAIN, draws.middle(entries))
    turn = sizes.Turn(TRAIN, 20e3, like)
    for errors in draws.draw(entries, 8, seed=3):
        unit = build(TRAIN, errors)
        assert turn.peak_to_peak(unit) == pytest.approx(np.ptp(turn.whole(unit)), rel=0.01)


def test_sizes_as_they_are_written() -> None:
    assert size("-2.5 um") == pytest.approx(-2.5e-3)
    assert size("1e-3mm") == pytest.approx(1e-3)
    assert size("20 arcsec") == pytest.approx(20 / ARCSEC)
    assert limits("±5 um") == (pytest.approx(5e-3), 0)
    for given in ("0/-4 um", "+0 um/-4 um", ["-4 um", "0 mm"], "0/−4 µm"):
        assert limits(given) == (pytest.approx(2e-3), pytest.approx(-2e-3))
    with pytest.raises(ValueError, match="no size"):
        size("5 parsec")


LAWS = {
    "normal": 1 / 3,
    "uniform": 1 / math.sqrt(3),
    "triangular": 1 / math.sqrt(6),
    "rayleigh": 1 / math.sqrt(-2 * math.log(0.0027)),
    "circle": 0.5,
    "ring": math.sqrt(0.5),
}


@pytest.mark.parametrize("law", LAWS)
def test_what_a_width_means(law: str, tmp_path: Path) -> None:
    path = tmp_path / "tolerances.toml"
    path.write_text(
        f'[[tolerance]]\nkey = "crank.eccentricity"\ntolerance = "6 um"\ndistribution = "{law}"\nmean = "1 um"\n'
    )
    (entry,) = draws.read(path, TRAIN)
    x = entry.draw(np.random.default_rng(0), 40000)
    assert x.shape == (40000, 4, 2)
    np.testing.assert_allclose(x.std((0, 1)), 6e-3 * LAWS[law], rtol=0.01)
    np.testing.assert_allclose(x.mean((0, 1)), 1e-3, atol=5e-5)


def test_instances_have_draws_of_their_own(tmp_path: Path) -> None:
    path = tmp_path / "tolerances.toml"
    path.write_text(
        '[[tolerance]]\nkey = "crank.eccentricity"\nparameters = ["radial"]\nindices = { disc = 1 }\n'
        'tolerance = "+1/-5 um"\n\n'
        '[[tolerance]]\nkey = "cycloid.pin_radius"\nindices = { pin = "all" }\ntolerance = "0/-4 um"\n\n'
        '[[tolerance]]\nkey = "cycloid.pin_radius"\ntolerance = "4 um"\n'
    )
    cams, ring, pins = draws.read(path, TRAIN)
    assert (cams.law, len(cams.instances), len(ring.instances), len(pins.instances)) == ("normal", 2, 1, 40)
    units = [build(TRAIN, errors) for errors in draws.draw([cams, ring, pins], 500, seed=2)]
    moved = np.array([unit.cams for unit in units])
    assert not moved[..., 1].any()
    assert not moved[:, :, 0].any()
    assert abs(np.corrcoef(moved[:, 0, 1, 0], moved[:, 1, 1, 0])[0, 1]) < 0.15
    assert moved[:, :, 1, 0].mean() == pytest.approx(-2e-3, abs=2e-4)
    radius = np.array([unit.pin_radius for unit in units])
    assert radius.mean() == pytest.approx(-2e-3, abs=1e-4)
    assert radius.std() == pytest.approx(math.hypot(2e-3, 4e-3) / 3, rel=0.05)


def test_what_is_not_judged_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "tolerances.toml"
    for line in ('samples = ["1 um"]', "correlated_with = { bores = 0.6 }"):
        path.write_text(f'[[tolerance]]\nkey = "crank.eccentricity"\ntolerance = "1 um"\n{line}\n')
        with pytest.raises(ValueError, match="not judged"):
            draws.read(path, TRAIN)


@pytest.mark.parametrize("true", [True, False])
def test_a_random_list_is_judged(
    true: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    claim = {"quantity": "transmission_error", "units": 999, "method": "equilibrium"}
    said = {"yield": 0.9, "interval": [0.5, 1.0]} if true else {"yield": 0.01, "interval": [0.0, 0.02]}

    def allocate(case: lists.Case, folder: Path, more: list[str]) -> Any:
        assert case.options()[:4] == ["--limit", case.limit, "--at", "682 N*m"]
        assert rverror.load_tolerances(case.tolerances, rverror.load_model(case.model))
        entry = claim | said | {"limit": float(case.limit.split()[0])}
        verified = [entry | {"torque": torque} for torque in ("682 N*m", 682.0)]
        return json.loads(json.dumps({"cost_before": 2, "cost": 1, "verified": verified})), case.tolerances, 1.0, "ok"

    monkeypatch.setattr(lists, "UNITS", 10)
    monkeypatch.setattr(judging, "run", allocate)
    words = ["--lists", "1", "--first", "4", "--units", "10", "--no-examples", "--folder", str(tmp_path)]
    assert main(words) == (0 if true else 1)
    told = capsys.readouterr().out
    assert ("2 of 2 limits held" if true else "0 of 2 limits held; 2 more than 3 spreads outside") in told
    assert told.count("held\n") == (2 if true else 0)


def test_which_lists_are_judged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ran: list[lists.Case] = []
    seeds: list[int] = []

    class Nothing:
        def __init__(self, model: Path, tolerances: Path, units: int, seed: int) -> None:
            seeds.append(seed)

        def judge(self, report: Any) -> Any:
            return iter(())

    def allocate(case: lists.Case, folder: Path, more: list[str]) -> Any:
        ran.append(case)
        assert more == ["--jobs", "1"]
        return {}, case.tolerances, 1.0, "ok"

    monkeypatch.setattr(judging, "run", allocate)
    monkeypatch.setattr(judging, "Judge", Nothing)
    monkeypatch.setattr(trial, "random_case", lambda seed, folder: lists.Case(f"random {seed}", folder, folder, "", ()))
    main(["--only-examples", "--jobs", "1"])
    assert [case.name for case in ran] == ["rv40e-maker-tolerances", "rv40e-tolerances"]
    assert ran[0].model.name == "rv40e-maker.toml"
    assert ran[0].options()[4:] == ["--lost-motion", "60 arcsec", "--stiffness", "97.2 N*m/arcmin"]
    ran.clear()
    seeds.clear()
    for words in (["--first", "3", "--lists", "2", "--no-examples"], ["--first", "4", "--lists", "1"]):
        main([*words, "--jobs", "1"])
    assert [case.name for case in ran if "random" in case.name] == ["random 3", "random 4", "random 4"]
    assert len(ran) == 5
    assert seeds[1] == seeds[-1]  # the units of a list do not depend on what is judged beside it


def test_a_report_without_claims_is_refused() -> None:
    with pytest.raises(ValueError, match="verified"):
        judging.claims({"verified": {"quantile_arcsec": 3.0}})
