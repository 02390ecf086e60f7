"""The pages: generated ones are up to date, examples run, links lead somewhere, stated identities hold."""

import itertools
import math
import re
import shlex

import catalogue_tables
import numpy as np
import pytest

import rverror
from diagnosed_example import found_once
from modules import PUBLIC, named
from pages import DOCS, text
from rverror.app.command_line import main
from rverror.base.arrays import cross, dot, radial_and_tangential
from rverror.geartrain.action_line import Clearance
from rverror.geartrain.contacts import closed_form_forces, pose
from rverror.geartrain.feedback import feedback_factor, loop_gain
from rverror.model.catalogue import CATALOGUE, source
from rverror.model.compose import source_matrix

ROOT = DOCS.parent
PAGES = sorted(DOCS.rglob("*.md"))
FRONT = [ROOT / name for name in ("README.md", "CONTRIBUTING.md", "SECURITY.md")]
ARCSEC = math.pi / 648000


def names(page):
    return page.relative_to(DOCS).as_posix()


def test_catalogue_page_is_the_output_of_its_generator():
    assert text(DOCS / "catalogue.md") == catalogue_tables.catalogue_markdown(), (
        "docs/catalogue.md is out of date: python docs/_ext/catalogue_tables.py > docs/catalogue.md"
    )


def test_catalogue_page_names_every_source():
    page = text(DOCS / "catalogue.md")
    for key in CATALOGUE:
        assert f"| `{key}` |" in page


def test_conventions_hold_the_frames_of_kinematics():
    assert catalogue_tables.frames_markdown(rverror.reducer("RV-40E")) in text(DOCS / "conventions.md")


@pytest.mark.parametrize("page", [*PAGES, *FRONT], ids=lambda page: page.name)
def test_links_lead_to_pages(page):
    for target in re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", text(page)):
        assert (page.parent / target).exists(), f"{page.name}: {target}"


@pytest.mark.parametrize("page", PAGES, ids=names)
def test_keys_in_pages_are_those_of_the_catalogue(page):
    families = {key.partition(".")[0] for key in CATALOGUE}
    example = "cycloid.disc_bore_circle"
    for key in re.findall(r"`(\w+\.\w+)`", text(page)):
        named = key.endswith(".py") or key == example
        assert key.partition(".")[0] not in families or key in CATALOGUE or named, f"{names(page)}: {key}"


@pytest.mark.parametrize("page", [*PAGES, *FRONT], ids=lambda page: page.name)
def test_files_and_names_that_pages_name_are_there(page):
    for name in re.findall(r"`((?:src|tests|docs|examples|benchmarks)/[\w./-]+)`", text(page)):
        assert (ROOT / name).exists(), f"{page.name}: {name}"
    for name in re.findall(r"`(rverror\.[\w.]+)`", text(page)):
        assert named(name) is not None, page.name


def test_names_stand_in_the_files_that_the_guide_names():
    guide = " ".join(text(DOCS / "adding-an-effect.md").split())
    pairs = re.findall(r"`(\w+)`(?: at the end of that file)?(?: there)?,? in `((?:src|tests)/[\w/]+\.py)`", guide)
    assert {"NAMES", "READ", "put", "CASES", "TANGENTIAL"} <= {name for name, _ in pairs}
    for name, file in pairs:
        assert re.search(rf"^(?:def )?{name}\b", text(ROOT / file), flags=re.MULTILINE), f"{name} in {file}"


@pytest.mark.parametrize("page", [*PAGES, *FRONT], ids=lambda page: page.name)
def test_code_on_pages_imports_the_front_door_alone(page):
    for block in re.findall(r"```python\n(.*?)```", text(page), flags=re.DOTALL):
        assert not re.findall(r"^\s*(?:from|import) rverror\..*", block, flags=re.MULTILINE), page.name


@pytest.mark.parametrize("page", PAGES, ids=names)
def test_formulas_are_closed(page):
    prose = re.sub(r"```.*?```", "", text(page), flags=re.DOTALL)
    assert prose.count("$$") % 2 == 0
    for paragraph in re.sub(r"\$\$.*?\$\$", "", prose, flags=re.DOTALL).split("\n\n"):
        assert paragraph.count("$") % 2 == 0, f"{names(page)}: {paragraph[:80]}"


@pytest.fixture
def example_found_once(tmp_path_factory):
    with found_once(tmp_path_factory.getbasetemp() / "diagnosis-of-the-example"):
        yield


@pytest.mark.usefixtures("example_found_once")
@pytest.mark.parametrize("page", [p for p in PAGES if "```python" in text(p)], ids=names)
def test_examples_run(page):
    namespace = {"__name__": "example"}
    for block in re.findall(r"```python\n(.*?)```", text(page), flags=re.DOTALL):
        exec(compile(block, names(page), "exec"), namespace)
    if page.name == "index.md":
        assert namespace["peak_to_peak"] == pytest.approx(18.5, abs=0.05)


@pytest.mark.usefixtures("example_found_once")
def test_commands_of_the_start_page_run(tmp_path, monkeypatch, capsys):
    """Files as the page has them, commands in its order, and what it shows of their output."""
    monkeypatch.chdir(tmp_path)
    page = text(DOCS / "start.md")
    for name, written in re.findall(r"```toml\n# ([\w/-]+\.toml)\n(.*?)```", page, flags=re.DOTALL):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(written, encoding="utf-8")
    commands = re.findall(r"```console\n(.*?)```", page, flags=re.DOTALL)
    assert len(commands) >= 3
    for command in commands:
        program, *arguments = shlex.split(command)
        assert program == "rverror"
        assert main(arguments) == 0
    printed = capsys.readouterr().out
    (shown,) = re.findall(r"here shortened[^:]*:\n\n```text\n(.*?)```", page, flags=re.DOTALL)
    for line in shown.splitlines():
        # times and the last digits may differ from machine to machine
        words, all_words = (" ".join(re.sub(r"[-\d.,\[\]]+", "#", some).split()) for some in (line, printed))
        assert words in all_words, line
    assert "the model lacks crank.eccentricity" in printed
    assert rverror.load_model(tmp_path / "with-cause.toml").effects[-1].key == "crank.eccentricity"
    assert rverror.load_model(tmp_path / "measured.toml").effects[0].uncertainty == pytest.approx(5e-4)
    assert (tmp_path / "found.html").stat().st_size > 10_000
    # what the sections after it say of their results
    assert "shaft.eccentricity" in (tmp_path / "units-found" / "summary.csv").read_text(encoding="utf-8")
    (peak,) = re.findall(r"Critical speeds\n-+\nspeed, rpm .*\n +(\S+) +78 +\S+ +(\S+) +\S+ +\S+\n", printed)
    assert float(peak[0]) == pytest.approx(1690, abs=5)
    assert float(peak[1]) == pytest.approx(16, abs=0.5)
    assert rverror.load_model(tmp_path / "worn.toml").effects


# --- nomenclature --------------------------------------------------------------------------------------------------

SYMBOLS = re.findall(r"^\| \$(.+?)\$ \| (.+) \|$", text(DOCS / "nomenclature.md"), flags=re.MULTILINE)


def formulas(page):
    prose = re.sub(r"```.*?```", "", text(page), flags=re.DOTALL)
    return [block or inline for block, inline in re.findall(r"\$\$(.*?)\$\$|\$([^$]+?)\$", prose, flags=re.DOTALL)]


@pytest.mark.parametrize(("symbol", "rest"), SYMBOLS, ids=[symbol for symbol, _ in SYMBOLS])
def test_symbols_stand_where_the_nomenclature_says(symbol, rest):
    name, unit, chinese, german, python = rest.split(" | ")
    assert all((unit, chinese, german))
    before = "" if symbol.startswith("\\") else r"(?<![a-zA-Z\\])"
    found = re.compile(before + re.escape(symbol) + r"(?![a-zA-Z])")
    target = re.fullmatch(r"\[.+\]\((.+)\)", name)[1]
    assert any(found.search(formula) for formula in formulas(DOCS / target)), f"{symbol} is not in {target}"
    first, *path = python.strip("`").split(".")
    thing = named(PUBLIC.get(first, first))
    for part in path:
        assert hasattr(thing, part) or part in thing.__dataclass_fields__, python
        thing = getattr(thing, part, None)


def test_nomenclature_names_every_parameter_of_the_geometry():
    python = {rest.split(" | ")[4].strip("`") for _, rest in SYMBOLS}
    plain = {
        "module",
        "gear_backlash",
        "stiffness",
        "stiffness_uncertainty",
        "contact_law",
        "inertia",
        "bearing_preload",
        "friction",
        "rated_torque",
        "output",
        "name",
    }  # words, not symbols
    for name in rverror.Reducer.__dataclass_fields__:
        assert (f"Reducer.{name}" in python) != (name in plain), name


# --- the equations of the catalogue page, read once more with complex numbers ---------------------------------------


class Plane:
    """Points and directions of an RV-40E as complex numbers; the symbols are those of the catalogue page."""

    def __init__(self, theta, direction):
        unit = self.unit = rverror.reducer("RV-40E")
        self.theta, self.sign = theta, direction
        self.R, self.nu = unit.ratio, -unit.disc_lobes / (unit.pins - unit.disc_lobes)
        self.beta = [theta + 2 * np.pi * j / unit.cranks for j in range(unit.cranks)]
        self.r = np.exp(1j * np.array(self.beta))
        self.t = 1j * self.r
        self.gamma = 2 * np.pi * np.arange(unit.pins)[:, None] / unit.pins
        self.p = np.exp(1j * self.gamma) * np.ones(theta.size)
        self.eps = np.exp(1j * (self.nu * theta + 2 * np.pi * np.arange(unit.discs)[:, None] / unit.discs))
        a, Rp, rp = unit.eccentricity, unit.pin_circle_radius, unit.pin_radius
        towards = a * unit.pins * self.eps[:, None] - Rp * self.p
        self.n = towards / abs(towards)
        self.q = Rp * self.p + rp * self.n
        point = self.q - a * self.eps[:, None]
        self.psi = np.angle(point * np.exp(-1j * theta))
        self.tau = 1j * point / abs(point)

    def wave(self, angle):
        return np.array([np.cos(angle), np.sin(angle)])


def away(angle):
    return np.angle(np.exp(1j * angle))


def lobe(g, disc, number):
    zc = g.unit.disc_lobes
    x = away(g.psi[disc] - 2 * np.pi * disc / g.unit.discs - 2 * np.pi * (number + 0.5) / zc)
    return np.where(abs(x) < np.pi / zc, np.cos(zc * x / 2) ** 2, 0)


def pushed(g):
    """Direction in which the loaded pins push the first disc: their arms about its centre are their weights."""
    from_centre = g.q[0] - g.unit.eccentricity * g.eps[0]
    arm = (from_centre.conj() * g.n[0]).imag
    force = (np.maximum(g.sign * arm, 0) * g.n[0]).sum(axis=0)
    return force / abs(force)


XY = np.array([[1], [1j]])
FLANKS = np.array([[1], [-1]])  # that of forward motion, that of reverse

#: Indices, and the vector of each parameter at the contact: complex for vectors, real for angles.
READ = {
    "involute.center_distance": ({"crank": 1}, lambda g: [-g.r[1], -g.t[1]]),
    "involute.sun_eccentricity": ({}, lambda g: XY * np.exp(1j * g.R * g.theta)),
    "involute.sun_offset": ({}, lambda g: XY),
    "involute.planet_eccentricity": ({"crank": 0}, lambda g: -XY * np.exp(1j * g.nu * g.theta)),
    "involute.sun_pitch": (
        {"harmonic": 2},
        lambda g: g.wave(2 * (g.beta - g.R * g.theta))[..., None, :] * g.t[:, None],
    ),
    "involute.planet_pitch": (
        {"crank": 1, "harmonic": 3},
        lambda g: g.wave(3 * (g.beta[1] + np.pi - g.nu * g.theta)) * g.t[1],
    ),
    "involute.tooth_thinning": ({"member": "sun"}, lambda g: [-0.5 * FLANKS * g.t[:, None]]),
    "involute.spline_clearance": ({"crank": 0}, lambda g: [0.5 / g.unit.spline_radius * FLANKS[:, None]]),
    "crank.eccentricity": ({"crank": 0, "disc": 1}, lambda g: [-g.eps[1], -1j * g.eps[1]]),
    "crank.index": ({"crank": 1}, lambda g: [1]),
    "cycloid.disc_profile": ({"disc": 1, "harmonic": 2}, lambda g: g.wave(2 * g.psi[1]) * g.n[1]),
    "cycloid.disc_pitch": ({"disc": 0, "harmonic": 3}, lambda g: -g.wave(3 * g.psi[0]) * g.tau[0]),
    "cycloid.disc_lobe": ({"disc": 1, "lobe": 7}, lambda g: [lobe(g, 1, 7) * g.n[1]]),
    "cycloid.lobe_profile": (
        {"disc": 1, "harmonic": 2},
        lambda g: g.wave(2 * (np.angle(g.eps[1]) - g.gamma)) * g.n[1],
    ),
    "cycloid.pin_position": ({"pin": 3}, lambda g: [g.p[3], 1j * g.p[3]]),
    "cycloid.pin_circle": ({"harmonic": 2}, lambda g: [w * e for e in (g.p, 1j * g.p) for w in g.wave(2 * g.gamma)]),
    "cycloid.pin_circle_tilt": ({}, lambda g: [w * np.array([[[1]], [[-1]]]) for w in (1, 1j)]),
    "cycloid.pin_radius": ({"pin": "all"}, lambda g: [g.n]),
    "cycloid.profile_modification": ({}, lambda g: [-g.n, g.p]),
    "cycloid.disc_bore_position": ({"disc": 0, "crank": 1}, lambda g: [g.r[1], g.t[1]]),
    "coupling.carrier_bore_position": ({"crank": 1}, lambda g: [-g.r[1], -g.t[1]]),
    "coupling.carrier_runout": ({}, lambda g: -XY * np.exp(1j * g.theta)),
    "load.torsion": ({}, lambda g: [-g.sign * TORQUE]),
    "load.torsion_wave": ({"harmonic": 3}, lambda g: -g.sign * TORQUE * g.wave(3 * g.theta)),
    "load.input_torsion_wave": ({"harmonic": 2}, lambda g: -g.sign * TORQUE * g.wave(2 * g.R * g.theta)),
    "sensor.encoder_distortion": ({"harmonic": 5}, lambda g: g.wave(5 * g.theta)),
    "sensor.output_tilt": ({}, lambda g: TORQUE * np.stack([pushed(g).real, pushed(g).imag])),
    "sensor.encoder_eccentricity": ({}, lambda g: g.wave(g.theta)),
    "sensor.encoder_ellipticity": ({}, lambda g: g.wave(2 * g.theta)),
    "sensor.input_coupling": ({"harmonic": 2}, lambda g: g.wave(2 * g.R * g.theta) / g.R),
    "sensor.index_offset": ({}, lambda g: [0]),
    "sensor.ratio_error": ({}, lambda g: [g.theta]),
    "sensor.drift": ({}, lambda g: [np.linspace(0, 1, g.theta.size)]),
    "sensor.time_offset": ({}, lambda g: [g.sign / SECONDS]),
    "empirical.order": ({"frame": "housing", "harmonic": 2}, lambda g: g.wave(2 * 39 * g.theta)),
    "empirical.order_by_direction": ({"frame": "output", "harmonic": 7}, lambda g: g.sign * g.wave(7 * g.theta)),
    "empirical.order_by_load": (
        {"frame": "output", "harmonic": 7, "sense": "opposite"},
        lambda g: g.sign * TORQUE * g.wave(7 * g.theta),
    ),
    "compensation.wave": ({"order": "7.5", "sense": "opposite"}, lambda g: g.sign * g.wave(7.5 * g.theta)),
}
TORQUE, SECONDS = 7.0, 0.5  # N*mm; s for each radian of the output


def plane(sign):
    theta = np.linspace(0, 1.4, 211)[::sign]
    g = Plane(theta, sign)
    return g, pose(g.unit, theta, direction=sign, time=SECONDS * abs(theta - theta[0]), torque=f"{TORQUE} N*mm")


def same_vectors(error, expected):
    vector = error.vector
    if error.contact in ("pin", "cam", "carrier", "mesh"):
        vector = vector[..., 0, :] + 1j * vector[..., 1, :]
    for one, other in zip(vector, expected, strict=True):
        shape = np.broadcast_shapes(one.shape, np.shape(other))
        np.testing.assert_allclose(np.broadcast_to(one, shape), np.broadcast_to(other, shape), rtol=0, atol=1e-9)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("key", READ)
def test_equations_of_the_catalogue_are_those_of_the_code(key, sign):
    g, motion = plane(sign)
    indices, read = READ[key]
    same_vectors(source(key).vector(motion, **indices), read(g))


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(
    ("key", "contact"), [("crank.bearing_clearance", "cam"), ("coupling.bearing_clearance", "carrier")]
)
def test_clearances_of_the_catalogue_lag_by_the_sum_of_the_forces(key, contact, sign):
    _, motion = plane(sign)
    assert source(key).vector(motion) == Clearance(contact=contact)
    forces = closed_form_forces(motion)
    size = np.hypot(forces[contact][..., 0, :], forces[contact][..., 1, :])
    lag = -sign * size.reshape(-1, motion.theta.size).sum(axis=0)
    np.testing.assert_allclose(source_matrix(motion, forces, key, {})[0], lag, rtol=1e-12)


#: Indices, and the compliance of the contact in forward motion's shape: pins by disc, bearings, flanks.
COMPLIANT = {
    "cycloid.pin_compliance": ({"pin": 3}, "pin", (slice(None), slice(3, 4)), lambda g: [1]),
    "cycloid.pin_compliance_wave": ({"harmonic": 2}, "pin", (), lambda g: g.wave(2 * g.gamma)[:, None]),
    "crank.bearing_compliance": ({"crank": 1, "disc": 0}, "cam", (slice(0, 1), slice(1, 2)), lambda g: [1]),
    "coupling.bearing_compliance": ({"crank": 1}, "carrier", (slice(1, 2),), lambda g: [1]),
    "involute.mesh_compliance": ({"crank": 1}, "mesh", (slice(1, 2),), lambda g: [1]),
    "involute.sun_compliance_wave": (
        {"harmonic": 2}, "mesh", (), lambda g: g.wave(2 * (g.beta - g.R * g.theta))[:, :, None],
    ),
    "involute.planet_compliance_wave": (
        {"crank": 1, "harmonic": 3}, "mesh", (slice(1, 2),),
        lambda g: g.wave(3 * (g.beta[1] + np.pi - g.nu * g.theta))[:, None, None],
    ),
}  # fmt: skip


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("key", COMPLIANT)
def test_compliances_of_the_catalogue_give_way_under_the_force_that_is_carried(key, sign):
    g, motion = plane(sign)
    indices, contact, at, read = COMPLIANT[key]
    forces = closed_form_forces(motion)
    carried = sign * TORQUE * forces[contact][at]
    expected = []
    for wave in read(g):  # -e f at each contact, as an error vector is projected
        shown = np.broadcast_to(np.asarray(wave, float), (*carried.shape[:-2], carried.shape[-1]))
        work = (forces[contact][at] * carried).sum(axis=-2) * shown
        expected.append(-work.reshape(-1, motion.theta.size).sum(axis=0))
    np.testing.assert_allclose(source_matrix(motion, forces, key, indices), expected, rtol=1e-12)


def test_growth_of_the_catalogue():
    g, motion = plane(1)
    parts = {error.contact: error for error in source("thermal.growth").vector(motion)}
    a, r6, eta = g.unit.eccentricity, g.unit.crank_radius, 11.5e-6
    bore, offset = eta * r6 * g.r, eta * a * g.eps[:, None]
    expected = {  # housing, discs, cranks, carrier, gears
        "pin": [eta * g.q, offset - eta * g.q, 0, 0, 0],
        "cam": [0, bore, -offset, 0, 0],
        "carrier": [0, 0, 0, -bore, 0],
        "mesh": [0, 0, 0, 0, bore[:, None]],
    }
    for contact, terms in expected.items():
        same_vectors(parts.pop(contact), terms)
    assert parts == {}


def test_every_source_has_an_equation_that_is_read():
    others = {"crank.bearing_clearance", "coupling.bearing_clearance", "thermal.growth", "shaft.eccentricity"}
    assert all(entry.equation for entry in CATALOGUE.values())
    known = set(READ) | set(COMPLIANT) | others
    assert known >= set(CATALOGUE), f"derive {set(CATALOGUE) - known} once more in READ, tests/project/test_docs.py"
    assert known == set(CATALOGUE)


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
    closed = catalogue_tables.Closed(rverror.reducer("RV-40E"), 4096)
    bore = closed.visibility(source("coupling.carrier_bore_position"), {"crank": 0})
    assert bore == {"radial": catalogue_tables.LOST_MOTION, "tangential": catalogue_tables.CONSTANT}
    assert set(closed.visibility(source("involute.sun_offset"), {}).values()) == {catalogue_tables.NOTHING}
    assert set(closed.visibility(source("cycloid.disc_pitch"), {"disc": 0, "harmonic": 1}).values()) == {
        catalogue_tables.WAVE
    }


def test_one_disc_does_not_hide_what_two_hide():
    closed = catalogue_tables.Closed(rverror.reducer("RV-40E", discs=1, cranks=3), 4096)
    assert set(closed.visibility(source("coupling.carrier_runout"), {}).values()) == {catalogue_tables.WAVE}
    found = closed.visibility(source("cycloid.pin_circle"), {"harmonic": 1})
    assert set(found.values()) == {catalogue_tables.WAVE}


def test_the_readme_counts_the_sources_of_a_reducer() -> None:
    """Those that a part or a bench makes: no fitted waves, and none of drives of which the orders alone are known."""
    beside = {"empirical", "compensation", "shaft"}
    count = sum(key.partition(".")[0] not in beside for key in rverror.CATALOGUE)
    says = f"{count} error sources" in (ROOT / "README.md").read_text(encoding="utf-8")
    assert says, f"README.md has another number of error sources than the catalogue: {count}"
