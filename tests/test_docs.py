"""The pages: generated ones are up to date, examples run, links lead somewhere, stated identities hold."""

import itertools
import math
import re
from pathlib import Path

import numpy as np
import pytest

import rverror
from rverror import docs_tables
from rverror.action_line import cross, dot, radial_and_tangential
from rverror.catalogue import CATALOGUE, source
from rverror.compose import closed_form_forces, pose
from rverror.feedback import feedback_factor, loop_gain

DOCS = Path(__file__).resolve().parents[1] / "docs"
PAGES = sorted(DOCS.rglob("*.md"))
ARCSEC = math.pi / 648000


def text(page):
    return page.read_text(encoding="utf-8")


def names(page):
    return page.relative_to(DOCS).as_posix()


def test_catalogue_page_is_the_output_of_its_generator():
    assert text(DOCS / "catalogue.md") == docs_tables.catalogue_markdown(), (
        "docs/catalogue.md is out of date: python -m rverror.docs_tables > docs/catalogue.md"
    )


def test_catalogue_page_names_every_source_and_reasons_name_only_sources():
    page = text(DOCS / "catalogue.md")
    for key in CATALOGUE:
        assert f"| `{key}` |" in page
    assert set(docs_tables._WHY) <= set(CATALOGUE)


def test_conventions_hold_the_frames_of_kinematics():
    assert docs_tables.frames_markdown(rverror.reducer("RV-40E")) in text(DOCS / "conventions.md")


@pytest.mark.parametrize("page", PAGES, ids=names)
def test_links_lead_to_pages(page):
    for target in re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", text(page)):
        assert (page.parent / target).is_file(), f"{names(page)}: {target}"


@pytest.mark.parametrize("page", PAGES, ids=names)
def test_keys_in_pages_are_those_of_the_catalogue(page):
    families = {key.partition(".")[0] for key in CATALOGUE}
    example = "cycloid.disc_bore_circle"
    for key in re.findall(r"`(\w+\.\w+)`", text(page)):
        assert key.partition(".")[0] not in families or key in CATALOGUE or key == example, f"{names(page)}: {key}"


@pytest.mark.parametrize("page", PAGES, ids=names)
def test_formulas_are_closed(page):
    prose = re.sub(r"```.*?```", "", text(page), flags=re.DOTALL)
    assert prose.count("$$") % 2 == 0
    for paragraph in re.sub(r"\$\$.*?\$\$", "", prose, flags=re.DOTALL).split("\n\n"):
        assert paragraph.count("$") % 2 == 0, f"{names(page)}: {paragraph[:80]}"


@pytest.mark.parametrize("page", [p for p in PAGES if "```python" in text(p)], ids=names)
def test_examples_run(page):
    namespace = {"__name__": "example"}
    for block in re.findall(r"```python\n(.*?)```", text(page), flags=re.DOTALL):
        exec(compile(block, names(page), "exec"), namespace)
    if page.name == "index.md":
        assert namespace["peak_to_peak"] == pytest.approx(18.5, abs=0.05)


# --- the identities that the theory pages state ------------------------------------------------------------------

UNITS = {
    "RV-40E": rverror.reducer("RV-40E"),
    "RV-40E, 3 cranks": rverror.reducer("RV-40E", cranks=3),
    "RV-003": rverror.reducer("RV-003"),
    "RV-003, 1 disc": rverror.reducer("RV-003", discs=1),
    "other teeth, no common factor": rverror.reducer("RV-40E", sun_teeth=10, planet_teeth=26),
}
THETA = np.linspace(0.01, 2, 37)


@pytest.fixture(params=list(itertools.product(UNITS, (1, -1))), ids=lambda p: f"{p[0]} {p[1]:+d}")
def loaded(request):
    name, direction = request.param
    motion = pose(UNITS[name], THETA, direction=direction)
    return UNITS[name], direction, motion, closed_form_forces(motion)


def close(value, expected):
    np.testing.assert_allclose(value, np.broadcast_to(expected, np.shape(value)), rtol=0, atol=1e-12)


def moments(motion, forces):
    force = forces["pin"].sum(axis=1)
    moment = (motion.pin_arm * dot(forces["pin"], motion.pin_normal)).sum(axis=1)
    return force, moment


def test_feedback_closes_the_loop(loaded):
    unit, *_ = loaded
    F, g = feedback_factor(unit), loop_gain(unit)
    assert pytest.approx(sum(g**i for i in range(30)), rel=1e-12) == F
    assert pytest.approx(unit.disc_lobes * unit.planet_teeth / unit.sun_teeth / unit.ratio, rel=1e-12) == F


def test_pin_forces_make_the_moments_of_the_cycloid_page(loaded):
    unit, _, motion, forces = loaded
    force, moment = moments(motion, forces)
    direction, _ = radial_and_tangential(motion.eccentric)
    close(moment.sum(axis=0), feedback_factor(unit))
    close(cross(direction, force) * unit.eccentricity * unit.disc_lobes, moment)
    torque = moment + unit.eccentricity * cross(direction, force)
    close(torque.sum(axis=0), 1 - 1 / unit.ratio)


def test_arms_follow_from_the_angle_of_the_pin(loaded):
    unit, _, motion, _ = loaded
    K = unit.short_width_coefficient
    phi = motion.eccentric[:, None] - 2 * np.pi * np.arange(unit.pins)[:, None] / unit.pins
    arm = unit.eccentricity * unit.disc_lobes * np.sin(phi) / np.sqrt(1 + K**2 - 2 * K * np.cos(phi))
    close(motion.pin_arm / unit.eccentricity / unit.disc_lobes, arm / unit.eccentricity / unit.disc_lobes)


def test_cams_balance_discs_and_cranks(loaded):
    unit, _, motion, forces = loaded
    force, moment = moments(motion, forces)
    _, tangential = radial_and_tangential(motion.crank_position)
    direction, _ = radial_and_tangential(motion.eccentric)
    close(forces["cam"].sum(axis=1), force)
    close(unit.crank_radius * dot(forces["cam"], tangential).sum(axis=1), moment)
    torque = (unit.eccentricity * cross(direction[:, None], forces["cam"])).sum(axis=0)
    close(torque + forces["spline"].sum(axis=(1, 2)), 0)


def test_carrier_bores_carry_the_output_torque(loaded):
    unit, direction, motion, forces = loaded
    radial, tangential = radial_and_tangential(motion.crank_position)
    close(dot(forces["carrier"], tangential).sum(axis=0) * unit.crank_radius, 1)
    close(forces["carrier"].sum(axis=0), forces["pin"].sum(axis=(0, 1)))
    if unit.discs > 1:
        close(dot(forces["carrier"], tangential) * unit.crank_radius, 1 / unit.cranks)
        separating = math.tan(unit.pressure_angle) / (unit.ratio * unit.cranks * unit.sun_pitch_radius)
        close(dot(forces["carrier"], radial), direction * separating)
        close(forces["carrier"].sum(axis=0), 0)


def test_sun_takes_in_the_input_torque(loaded):
    unit, _, motion, forces = loaded
    _, tangential = radial_and_tangential(motion.crank_position)
    torque = unit.sun_pitch_radius * dot(forces["mesh"], tangential[:, None]).sum(axis=(0, 1))
    close(torque, 1 / unit.ratio)


@pytest.mark.parametrize("key", ["involute.planet_eccentricity", "involute.planet_pitch", "involute.sun_pitch"])
def test_amplitudes_of_the_involute_page(key):
    unit = rverror.reducer("RV-40E")
    theta = np.arange(4096) * 2 * np.pi / 4096
    n, R, r1, cos = unit.cranks, unit.ratio, unit.sun_pitch_radius, math.cos(unit.pressure_angle)
    indices, order, expected = {
        "involute.planet_eccentricity": ({"crank": 1}, 40, 1 / (R * n * r1 * cos)),
        "involute.planet_pitch": ({"crank": 1, "harmonic": 2}, 80, 1 / (R * n * r1)),
        "involute.sun_pitch": ({"harmonic": 2}, 240, 1 / (R * r1)),
    }[key]
    matrix = rverror.influence(unit, theta, key, **indices).matrix
    np.testing.assert_allclose(2 * abs(np.fft.rfft(matrix))[:, order] / 4096, expected, rtol=1e-9)


def test_numbers_of_the_crank_page():
    theta = np.arange(4096) * 2 * np.pi / 4096
    for cranks, expected in ((2, 18.467), (3, 12.31)):
        unit = rverror.reducer("RV-40E", cranks=cranks)
        column = rverror.influence(unit, theta, "crank.eccentricity", crank=0, disc=0).matrix[1]
        assert np.ptp(column) * 0.005 / ARCSEC == pytest.approx(expected, rel=1e-3)
    unit = rverror.reducer("RV-40E")
    cams = [
        rverror.influence(unit, theta, "crank.eccentricity", crank=j, disc=k).matrix for j in (0, 1) for k in (0, 1)
    ]
    radial, tangential = sum(cams) * 0.005 / ARCSEC
    assert radial.mean() == pytest.approx(-7.95, abs=0.005)
    assert np.argmax(abs(np.fft.rfft(radial - radial.mean()))) == 1560
    assert tangential == pytest.approx(-20.456, abs=1e-3)


def test_visibility_tells_the_four_kinds_apart():
    closed = docs_tables.Closed(rverror.reducer("RV-40E"), 4096)
    bore = closed.visibility(source("coupling.carrier_bore_position"), {"crank": 0})
    assert bore == {"radial": docs_tables.LOST_MOTION, "tangential": docs_tables.CONSTANT}
    assert set(closed.visibility(source("involute.sun_offset"), {}).values()) == {docs_tables.NOTHING}
    assert set(closed.visibility(source("cycloid.disc_pitch"), {"disc": 0, "harmonic": 1}).values()) == {
        docs_tables.WAVE
    }


def test_one_disc_does_not_hide_what_two_hide():
    closed = docs_tables.Closed(rverror.reducer("RV-40E", discs=1, cranks=3), 4096)
    assert set(closed.visibility(source("coupling.carrier_runout"), {}).values()) == {docs_tables.WAVE}
    found = closed.visibility(source("cycloid.pin_circle"), {"harmonic": 1})
    assert set(found.values()) == {docs_tables.WAVE}
