"""ISO 1328-1 classes against printed values, what inspection would measure, and an allocation by hand."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st

import rverror
from rverror.base.errors import InputError
from rverror.tolerances.allocation import allocate
from rverror.tolerances.allocation_result import Allocation
from rverror.tolerances.grades import CLASSES, KEYS, class_of, gear_limit, gear_tolerance, it_width
from rverror.tolerances.stacking import stack
from rverror.tolerances.tolerance_file import load_tolerances, save_widths

UNIT = rverror.Model(rverror.reducer("RV-40E"))
SUN = {"diameter": 13.5, "module": 1.5}
gears = st.tuples(st.integers(5, 200), st.floats(0.5, 10.0)).filter(lambda g: g[0] * g[1] >= 5)


@pytest.mark.parametrize(
    ("deviation", "micrometres"), [("single pitch", 9.0), ("cumulative pitch", 29.0), ("runout", 26.0)]
)
def test_values_that_others_print(deviation, micrometres):
    """Class 6, 40 teeth of 3 mm: 8.94 and 28.80 before rounding, and 0.9 of the latter."""
    assert gear_tolerance(deviation, 6, diameter=120.0, module=3.0) * 1e3 == pytest.approx(micrometres)


@given(gears, st.sampled_from(CLASSES), st.sampled_from(["single pitch", "cumulative pitch", "runout"]))
def test_rounding_and_steps(gear, number, deviation):
    """Two classes are a factor of two but for rounding, which is by half a step at most; steps of 1, 0.5 and 0.1 um."""
    teeth, module = gear
    at = [gear_tolerance(deviation, a, diameter=teeth * module, module=module) * 1e3 for a in CLASSES]
    assert all(a < b for a, b in itertools.pairwise(at))
    size = at[number - 1]
    step = 1.0 if size > 10 else 0.5 if size >= 5 else 0.1
    assert size / step == pytest.approx(round(size / step), abs=1e-9)
    if number <= 9:
        wider = at[number + 1]
        slack = step + (0.5 if wider > 10 else 0.25 if wider >= 5 else 0.05)
        assert abs(wider - 2 * size) <= slack * (1 + 1e-9)


@given(st.integers(5, 60), st.floats(1.0, 5.0), st.integers(1, 4), st.sampled_from(CLASSES))
def test_a_wave_at_its_limit_is_measured_within_the_class(teeth, module, harmonic, number):
    """Cumulative and single pitch of all teeth, whatever the phase; of the two one is at its limit."""
    of = {"diameter": teeth * module, "module": module}
    amplitude = gear_limit("involute.sun_pitch", number, harmonics=[harmonic], **of)
    phases = np.linspace(0, 2 * np.pi, 721)[:, None]
    lead = amplitude * np.cos(harmonic * 2 * np.pi * np.arange(teeth + 1) / teeth + phases)
    single = np.abs(np.diff(lead, axis=1)).max() / gear_tolerance("single pitch", number, **of)
    wave = 2 * amplitude / gear_tolerance("cumulative pitch", number, **of)
    assert max(single, wave) == pytest.approx(1.0, abs=1e-3)


def test_several_waves_have_the_limit_of_the_tightest():
    alone = [gear_limit("involute.sun_pitch", 5, harmonics=[h], **SUN) for h in (1, 2, 4)]
    assert gear_limit("involute.sun_pitch", 5, harmonics=[1, 2, 4], **SUN) == min(alone)
    assert alone[:2] == pytest.approx([7.5e-3, 5.5e-3 / (2 * math.sin(math.radians(40)))])


def test_an_eccentric_gear_shows_the_first_wave_of_its_pitch():
    """At the output e is as a wave of e / cos(20 deg), so runout and cumulative pitch leave nearly the same error."""
    theta = 2 * np.pi * np.arange(4096) / 4096
    eccentric = rverror.influence(UNIT.mechanism, theta, "involute.planet_eccentricity", crank=0).matrix[0]
    pitch = rverror.influence(UNIT.mechanism, theta, "involute.planet_pitch", crank=0, harmonic=1).matrix[0]
    assert np.ptp(eccentric) == pytest.approx(np.ptp(pitch) / math.cos(math.radians(20)), rel=1e-3)
    by_runout = gear_limit("involute.planet_eccentricity", 6, diameter=40.5, module=1.5)
    by_pitch = gear_limit("involute.planet_pitch", 6, diameter=40.5, module=1.5)
    assert by_runout == pytest.approx(by_pitch * math.cos(math.radians(20)), rel=0.1)


@pytest.mark.parametrize("text", ["ISO 1328 5", "ISO 1328-1 5", "iso 1328  5", "ISO1328 5"])
def test_names_of_a_class(text):
    assert class_of(text) == 5
    assert class_of("IT5") is None


TEXT = """\
[[tolerance]]
key = "involute.sun_pitch"
indices = {{ harmonic = 1 }}
grade = "{grade}"
diameter = "13.5 mm"
module = "1.5 mm"  # of the preset
cost = {{ grades = {{ "ISO 1328 4" = 60, "ISO 1328 5" = 40 }}, diameter = "13.5 mm", module = "1.5 mm" }}

[[tolerance]]
key = "involute.planet_eccentricity"
grade = "ISO 1328 6"
diameter = "40.5 mm"
module = "1.5 mm"
cost = {{ grades = {{ "ISO 1328 5" = 55, "ISO 1328 6" = 30 }}, diameter = "40.5 mm", module = "1.5 mm" }}

[[tolerance]]
key = "cycloid.disc_bore_position"
grade = "IT5"
size = "32 mm"
cost = {{ grades = {{ IT3 = 90, IT4 = 40, IT5 = 22 }}, size = "32 mm" }}

[[tolerance]]
key = "crank.eccentricity"
tolerance = "5 um"
cost = {{ curve = "reciprocal", price = 12.0, at = "5 um" }}
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    file = tmp_path / "t.toml"
    file.write_text(TEXT.format(grade="ISO 1328 5"), encoding="utf-8")
    return file


def test_a_file_with_both_standards(path, tmp_path):
    pitch, planets, bores, _ = load_tolerances(path, UNIT)
    assert pitch.width == pytest.approx(7.5e-3)
    assert planets.width == pytest.approx(gear_tolerance("runout", 6, diameter=40.5, module=1.5) / 2)
    assert planets.distribution.vector  # the runout limits its length
    assert planets.cost.names == ("ISO 1328 5", "ISO 1328 6")
    assert bores.width == it_width("IT5", 32.0) / 2
    table = tmp_path / "t.csv"
    table.write_text(
        "key,grade,diameter[mm],module,harmonic\n"
        "involute.sun_pitch,ISO 1328 5,13.5,1.5 mm,1\ninvolute.planet_eccentricity,ISO 1328 6,40.5,1.5 mm,\n",
        encoding="utf-8",
    )
    assert [item.width for item in load_tolerances(table, UNIT)] == [pitch.width, planets.width]


def test_another_class_and_another_width_are_saved(path, tmp_path):
    items = load_tolerances(path, UNIT)
    finer = gear_limit("involute.sun_pitch", 4, **SUN)
    new = [finer, 4e-3, *(item.width for item in items[2:])]
    save_widths(path, tmp_path / "new.toml", new, grades=["ISO 1328 4", None, None, None])
    text = (tmp_path / "new.toml").read_text(encoding="utf-8")
    assert text.startswith(TEXT.format(grade="ISO 1328 4").partition("\n\n")[0])
    changed = text.split("\n\n")[1].splitlines()
    assert changed[2] == 'tolerance = "4 um"'
    assert not any(line.startswith("grade") for line in changed)
    assert [item.width for item in load_tolerances(tmp_path / "new.toml")] == pytest.approx(new)


def test_both_standards_and_a_curve_in_one_allocation(path):
    """Against all 12 combinations of grades, each with the widest cams that the limit leaves it."""
    items = load_tolerances(path, UNIT)
    laid = stack(UNIT, items, theta=2 * np.pi * np.arange(240) / 240)

    def size(widths):
        return rverror.tolerances.budget(replace(laid, width=np.array(widths))).worst.peak_to_peak

    limit = size([item.width for item in items]) * 0.9
    found = allocate(UNIT, items, laid.theta, limit=limit, kind="worst")
    assert isinstance(found, Allocation)
    best = math.inf
    tables = [list(zip(item.cost.widths, item.cost.prices, strict=True)) for item in items[:3]]
    for chosen in itertools.product(*tables):
        held, price = [w for w, _ in chosen], sum(p for _, p in chosen)
        if size([*held, 1e-9]) > limit:
            continue
        low, high = 5e-4, 5e-2  # of the width of the cams
        for _ in range(24):  # to 3e-7 of it
            middle = math.sqrt(low * high)
            low, high = (middle, high) if size([*held, middle]) <= limit else (low, middle)
        if low >= items[3].span[0]:
            best = min(best, price + items[3].cost.cost(min(low, items[3].span[1])))
    assert found.cost == pytest.approx(best, rel=1e-5)
    assert {g.split()[0] for g in found.grades[:2]} == {"ISO"}
    assert found.grades[2].startswith("IT")


@pytest.mark.parametrize(
    ("before", "after", "says"),
    [
        ('grade = "ISO 1328 5"', 'grade = "ISO 1328 12"', "line 4: no tolerance grade 'ISO 1328 12'; .* 1 to 11"),
        ('diameter = "13.5 mm"\n', "", r'line 4: a grade needs the gear.*; add diameter = "13.5 mm"'),
        ('diameter = "13.5 mm"\n', 'size = "13.5 mm"\ndiameter = "13.5 mm"\n', "line 4: size beside the grade"),
        ('diameter = "13.5 mm"\n', 'diameter = "3 mm"\n', "line 4: diameter 3 mm .* from 5 to 15000 mm"),
        ('diameter = "13.5 mm"\n', 'diameter = "6 mm"\n', "line 4: diameter 6 mm and module 1.5 mm make 4 teeth"),
        ('key = "involute.sun_pitch"\nindices = { harmonic = 1 }', 'key = "crank.eccentricity"', "no class for it"),
        ('grade = "ISO 1328 5"', 'grade = "IT5"', "line 4: a grade needs the size of the part"),
    ],
)
def test_what_is_wrong_is_named_with_its_line(path, before, after, says):
    text = path.read_text(encoding="utf-8")
    assert before in text
    path.write_text(text.replace(before, after, 1), encoding="utf-8")
    with pytest.raises(InputError, match=says) as caught:
        load_tolerances(path, UNIT)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("number", "size"), [(0, SUN), (12, SUN), (5, {"diameter": math.nan, "module": 1.5})])
def test_beyond_the_standard(number, size):
    for key in KEYS:
        with pytest.raises(InputError, match="ISO 1328-1"):
            gear_limit(key, number, **size)
