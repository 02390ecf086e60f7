"""All that the five sources print: equations, tables, figures and numbers of their texts, each with one verdict.

`ITEMS` is the list; `markdown` writes the page ``docs/sources.md``.  A test reads the texts themselves, where they lie
beside the repository, and finds every display equation, table and figure in exactly one item, and every number of the
prose in the section of its source.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import ledger

#: What a verdict is.
VERDICTS = (*ledger.VERDICTS, "out of scope")
#: Titles of the sections.
SOURCES = {
    "000": "action line increments",
    "001": "review",
    "002": "tooth clearance",
    "003": "parametric simulation",
    "004": "test and virtual prototype",
}
_DOCS = Path(__file__).parents[1]


@dataclass(frozen=True)
class Item:
    """One thing that a source prints.

    Attributes
    ----------
    source : str
        First three digits of the source.
    what : str
        What is printed, in our words, with its numbers.
    verdict : str
        One of `VERDICTS`.
    why : str
        The reason, and what is right.
    held : tuple of str
        Where it is shown: ``"ledger ROW"``, ``"published TABLE"`` or a page, with an anchor after ``#``.
    tests : tuple of str
        Files of tests, below ``tests/``, for what is shown on other pages.
    equations : mapping of int to str
        Place in the source, counted from 1, and what the equation is for, LaTeX that stands in it.
    tables, figures : mapping of int to str
        Place in the source and words that stand in the table's first line, or with which the text points to the figure.
    """

    source: str
    what: str
    verdict: str
    why: str
    held: tuple[str, ...] = ()
    tests: tuple[str, ...] = ()
    equations: Mapping[int, str] = field(default_factory=dict)
    tables: Mapping[int, str] = field(default_factory=dict)
    figures: Mapping[int, str] = field(default_factory=dict)


@functools.cache
def headings(page: str) -> frozenset[str]:
    """Anchors of a page's headings, as the site makes them."""
    lines = (_DOCS / page).read_text(encoding="utf-8").splitlines()
    return frozenset(anchor(line.lstrip("#").strip()) for line in lines if line.startswith("#"))


def anchor(heading: str) -> str:
    """Anchor of a heading.

    Examples
    --------
    >>> anchor("003 step in the wear curves"), anchor("Error, torque, influence")
    ('003-step-in-the-wear-curves', 'error-torque-influence')
    """
    kept = "".join(c for c in heading.lower() if c.isalnum() or c in " -_")
    return kept.replace(" ", "-")


_LOADED = ("statics/test_loaded_state.py",)
_ORACLE = ("model/test_influence_oracle.py",)
_DOCUMENTS = ("project/test_docs.py",)

ITEMS: tuple[Item, ...] = (
    # --- 000 ----------------------------------------------------------------------------------------------------
    Item(
        "000",
        "ratios of the stages and of the whole; the RV-40E's parameters, with ratios 4, 41 and 164",
        "corrected",
        "the planet stands for a ring gear; the geometry is right and is the preset, the ratio is 121",
        held=("ledger 000 ratios", "conventions.md#ratio-frames-and-orders"),
        tests=("geartrain/test_kinematics.py", "geartrain/test_mechanism.py"),
        equations={1: "i_1", 3: "i_{total}"},
        tables={3: "Parameter | Symbol | Value"},
    ),
    Item(
        "000",
        "turn of the disc for a turn of the crank",
        "corrected",
        "$z_c$ is lost",
        held=("ledger 000 disc rotation",),
        equations={2: r"\Delta \theta_{cycloid}"},
    ),
    Item(
        "000",
        "total ratios from 30 to over 200",
        "out of scope",
        "a survey of what is sold; any geometry that can be assembled is taken",
        tests=("geartrain/test_mechanism.py",),
    ),
    Item(
        "000",
        "action line increment: projection of an error onto the action line, over the cosine of the angle to the "
        "motion",
        "reproduced",
        "right for one contact; with many it is the contact's force that weighs the error",
        held=("theory/principle.md#one-contact",),
        tests=_DOCUMENTS,
        equations={4: r"\sigma_i"},
    ),
    Item(
        "000",
        "frames of housing, sun, planet, crank, disc and output, with matrices between them",
        "reproduced",
        "the same frames; the source leaves out how far each turns, which makes the orders",
        held=("conventions.md#ratio-frames-and-orders",),
        tests=("geartrain/test_kinematics.py",),
        tables={1: "Frame"},
    ),
    Item(
        "000",
        "direction of the involute action line, fixed in the housing",
        "corrected",
        "it turns with the carrier, and changes its flank with the direction of motion",
        held=("theory/involute.md#line-of-action-and-force",),
        tests=_ORACLE,
        equations={5: r"\mathbf{n}_{11}"},
    ),
    Item(
        "000",
        "planet's angle from an error of the centre distance",
        "reproduced",
        "for the part along the line of centres; its number in the case study is the swing between two signs",
        held=("ledger 000 delta_11",),
        equations={6: r"\Delta \theta_1^{(I)}"},
    ),
    Item(
        "000",
        "direction in which a crank drives a disc, across its eccentric direction; disc's angle from an error of "
        "the eccentricity",
        "corrected",
        "a cam also carries the torque of its disc, across the radius of the bore, against which the crank turns: its "
        "radial error makes order 40, where the formula has 0",
        held=("theory/crank.md#forces-in-the-cam-bearings",),
        tests=_ORACLE,
        equations={7: r"\mathbf{n}_{12}", 8: r"\Delta \theta_2^{(P)}"},
    ),
    Item(
        "000",
        "disc's angle from an error of its profile and from pin positions, one contact",
        "corrected",
        "the cosine of the pressure angle stands in it twice; many pins share the load, each by its arm",
        held=("theory/cycloid.md#load-sharing",),
        tests=_ORACLE,
        equations={9: r"\Delta \theta_3^{(C)}"},
    ),
    Item(
        "000",
        "output's angle from an error of a bore of the output, tangential to the crank circle",
        "corrected",
        "the lever is right, the sign is not: a bore that leads lets the output lag; it shares with the other "
        "bores, and is constant",
        held=("theory/coupling.md#sources",),
        tests=_ORACLE,
        equations={10: r"\mathbf{n}_{14}", 11: r"\Delta \theta_4^{(O)}"},
    ),
    Item(
        "000",
        "sum of the four stages, two of them over the second ratio; which error belongs to which",
        "corrected",
        "the four sub-assemblies and their errors are those of the catalogue; what each puts on the output is the "
        "force of its contact, not a ratio of stages",
        held=("theory/principle.md#many-contacts", "catalogue.md"),
        tests=_ORACLE,
        equations={12: r"\Delta \Theta"},
        tables={2: "Typical Primitive Error"},
    ),
    Item(
        "000",
        "feedback of the output's error through the carrier: vector, planet's angle, sum with it; 1 to 2 arcsec",
        "corrected",
        "it takes away 4/121 of what moves the cranks, adds nothing, and has no last step",
        held=("ledger 000 feedback", "theory/feedback.md"),
        tests=_DOCUMENTS,
        equations={13: r"\boldsymbol{\delta}_f", 14: r"\Delta \theta_{1f}", 15: r"\Delta \Theta_{total}"},
    ),
    Item(
        "000",
        "case study of four errors of 5 um (0.005 mm): 30.5, 12.8, 8.2 and 0.9 arcsec peak-to-peak, with their periods",
        "not reproducible",
        "three of the four come out of no formula of the text, and no part of the train makes a wave once a turn; "
        "the last is met",
        held=("ledger 000 delta_41", "ledger 000 delta_31", "ledger 000 delta_21", "ledger 000 delta_11"),
        tables={4: "Peak-to-Peak Output Error"},
    ),
    Item(
        "000",
        "ranking of the four: output bores, profile, eccentricity, centre distance",
        "corrected",
        "the bores make no wave at all; cams lead, before a profile that is one wave around the disc",
        held=("ranking.md#source-000-four-errors-of-5-um",),
        tests=("model/test_ranking.py",),
    ),
    Item(
        "000",
        "measured spectrum: peaks at 0.00278 and 0.108 cycles per degree",
        "corrected",
        "the second is order 39, fixed in the housing; the first, order 1, comes from outside the train: encoder or "
        "coupling",
        held=("ledger 000 spectral peak", "conventions.md#ratio-frames-and-orders"),
        tests=("geartrain/test_kinematics.py",),
        tables={5: "Spectral Peak"},
    ),
    Item(
        "000",
        "bench with motor, torque sensor, encoder and brake; a waveform that is said to agree",
        "not reproducible",
        "no record and no amplitude is printed",
    ),
    Item(
        "000",
        "outlook: bores of the disc, pin radius, profile modification, bearing clearance, temperature, a stochastic "
        "budget",
        "reproduced",
        "no formula is printed; all are sources of the catalogue, and the budget is there",
        held=("catalogue.md", "theory/budget.md"),
        tests=("model/test_catalogue_contract.py",),
    ),
    # --- 001 ----------------------------------------------------------------------------------------------------
    Item(
        "001",
        "profile of a disc",
        "corrected",
        "larger than the pin circle, and one lobe too many",
        held=("ledger 001 profile",),
        equations={1: r"(R_c + r) \cos(\phi)", 2: r"(R_c + r) \sin(\phi)"},
    ),
    Item(
        "001",
        r"lag and lead of pins off in radius, their sum of period $2\pi/(i+1)$ and two peaks, and its series to "
        "second order",
        "reproduced",
        "of the cycloid stage alone; to first order of the kinematics the second term is 0",
        held=("published 001 pin radius",),
        equations={3: r"\Delta \theta", 4: r"\Delta \theta_1"},
    ),
    Item(
        "001",
        "what pin radius, pin circle, ratio and tooth height do in one stage; less than 5 um helps",
        "corrected",
        "without numbers; uniform ones shift the output and ripple by less than 1 % of that, in proportion to the "
        "error, with no threshold",
        held=("ledger 000 delta_31", "theory/cycloid.md#limits-and-checks"),
        tests=_ORACLE,
        tables={1: "Table 1"},
    ),
    Item(
        "001",
        "static model of twenty degrees of freedom, its stiffness matrix and errors as forces",
        "reproduced",
        "the same parts; contacts that open, which the linear form leaves out, are in",
        held=("ledger 001 degrees of freedom", "theory/equilibrium.md#parts-contacts-energy"),
        tests=_LOADED,
        equations={5: r"\mathbf{K} \mathbf{x}", 10: r"\mathbf{K}"},
    ),
    Item(
        "001",
        "transmission error as actual output less input over ratio",
        "reproduced",
        "the same definition and sign",
        held=("conventions.md#motion-and-error",),
        tests=("runs/test_measurement.py",),
        equations={6: r"\theta_{err}"},
    ),
    Item(
        "001",
        "sensitivity to an eccentricity of a crank, as a derivative",
        "reproduced",
        "an influence; in closed form, and at a load by one equilibrium for all",
        held=("theory/equilibrium.md#influences-at-a-load",),
        tests=("model/test_influence_oracle.py", "statics/test_loaded_state.py"),
        equations={7: "S_{e_c}"},
    ),
    Item(
        "001",
        "total error as a series with products of errors",
        "not reproducible",
        "what does not add is no product: contacts open",
        held=("published 001 and 004 series of second order",),
        equations={8: "D_{jk}"},
    ),
    Item(
        "001",
        "Fourier series over a turn of the input",
        "corrected",
        "the period is that of the output",
        held=("ledger 001 Fourier series", "conventions.md#ratio-frames-and-orders"),
        tests=("geartrain/test_kinematics.py",),
        equations={9: "A_m"},
    ),
    Item(
        "001",
        "grinding and honing: profile error in proportion to the scatter of a surface finish",
        "out of scope",
        "a law of a process, without its constant; sizes of errors are inputs of the budget, with their distributions",
        held=("theory/budget.md#distributions",),
        equations={11: r"\delta_p"},
    ),
    Item(
        "001",
        "equation of motion with mass and damping; resonances and critical speeds",
        "reproduced",
        "about the loaded state, with errors that turn with their frames",
        held=("theory/dynamics.md#equations",),
        tests=("dynamics/test_at_speed.py", "dynamics/test_natural_modes.py"),
        equations={12: r"\mathbf{M} \ddot{\mathbf{x}}"},
    ),
    Item(
        "001",
        "impact of five errors alone and with others; combinations are not additive",
        "corrected",
        "at rated load errors of this size add to within per cents, at light load they do not; the pin radius alone "
        "is low, as printed, the output wheel's eccentricity is not high",
        held=("published 001 combined errors", "published 001 ranking of tolerances"),
        tables={2: "Table 2"},
    ),
    Item(
        "001",
        "five tolerances in order of rank, 2 um to 10 arcsec; the first stage is negligible",
        "corrected",
        "cams, disc bores and pins are alike, disc pitch is half of them, the output wheel nothing; some waves of "
        "the sun's pitch are not negligible",
        held=("published 001 ranking of tolerances", "ranking.md#source-001-what-to-control-first"),
        tests=("model/test_ranking.py",),
        tables={3: "Table 3"},
    ),
    Item(
        "001",
        "differences of eccentricity among cranks matter",
        "reproduced",
        "only the differences do",
        held=("published 001 crank eccentricity",),
    ),
    Item(
        "001",
        "pitch errors of two discs, 180 degrees out of phase or aligned; up to 50 % less",
        "corrected",
        "right for odd harmonics, and stronger than printed; even ones are the other way round",
        held=("published 001 phase of two discs", "ledger 001 phase of the discs"),
    ),
    Item(
        "001",
        "variance of the error over the number of discs",
        "reproduced",
        "from two discs on",
        held=("published 001 averaging over discs",),
    ),
    Item(
        "001",
        "prototypes that confirm the findings",
        "not reproducible",
        "no data are printed",
    ),
    Item(
        "001",
        "outlook: temperature, load, lubrication, wear, compensation",
        "reproduced",
        "no formula is printed; each is there. Lubrication enters by friction and its drag; compensation is a table "
        "from measured runs for the controller, not a loop around an output sensor",
        held=(
            "theory/thermal-and-load.md",
            "theory/friction.md",
            "theory/wear.md",
            "theory/compensation.md",
        ),
        tests=(
            "geartrain/test_thermal.py",
            "model/test_load.py",
            "statics/test_duty.py",
            "statics/test_friction.py",
            "statics/test_wear.py",
            "compensation/test_compensate.py",
        ),
    ),
    # --- 002 ----------------------------------------------------------------------------------------------------
    Item(
        "002",
        "errors of disc profile, disc pitch and pin position along the meshing line",
        "corrected",
        "the angle of the pin stands where that of the normal is right",
        held=("ledger 002 projections", "theory/cycloid.md#sources"),
        tests=_ORACLE,
        equations={
            1: "e_{pdjk}",
            2: "e_{Apdjk}",
            4: "e_{Rk}",
            5: "e_{ARk}",
            11: "e_{pdjk}",
            12: "e_{Apdjk}",
            14: "e_{Rk}",
            15: "e_{ARk}",
        },
    ),
    Item(
        "002",
        "equidistant and shift modification along the meshing line",
        "corrected",
        "the shift is right, an equidistant is not projected",
        held=("ledger 002 modification",),
        equations={3: "e_{rrp}", 13: "e_{rrp}"},
    ),
    Item(
        "002",
        "initial gap over the angle, as a formula and as a figure; $K$ as a ratio of radii",
        "corrected",
        "roots are lost and $K$ is another ratio; of the figure only a mention is left",
        held=("ledger 002 initial gap", "theory/cycloid.md#profile-modification"),
        tests=("geartrain/test_profile_modification.py",),
        equations={6: r"\Delta \phi_i", 16: r"\Delta \phi_i"},
        figures={1: "following figure"},
    ),
    Item(
        "002",
        "displacement of each contact under load as a share of the largest",
        "corrected",
        "a root is lost",
        held=("ledger 002 loaded displacement",),
        equations={7: r"\delta_i", 17: r"\delta_i"},
    ),
    Item(
        "002",
        "half of the pins engage at a time",
        "reproduced",
        "less what clearance and errors keep open",
        held=("theory/cycloid.md#load-sharing",),
        tests=("model/test_influence_oracle.py", "statics/test_loaded_state.py"),
    ),
    Item(
        "002",
        "stiffness of the mesh that varies with the angle of engagement",
        "reproduced",
        "it follows from which pins carry and where their normals point; no stiffness and no curve is printed",
        held=("theory/equilibrium.md#parts-contacts-energy", "theory/dynamics.md#frames"),
        tests=("statics/test_loaded_state.py", "dynamics/test_harmonic_balance.py"),
    ),
    Item(
        "002",
        "meshing forces over time as a sum of equal ones",
        "corrected",
        "forces are as the arms, along the normals",
        held=("ledger 002 meshing forces",),
        equations={8: "F_x(t)", 9: "F_y(t)"},
    ),
    Item(
        "002",
        "error as a square of the clearance; 10 um make 5 arcsec",
        "corrected",
        "the order of size; clearance alone makes lag, and ripple only beside part errors. No coefficient is printed",
        held=("published 002 sensitivity",),
        equations={10: "TE(C)", 18: "TE(C)"},
    ),
    Item(
        "002",
        "table of parameters: 1600 rpm, a range from -35 to 47 arcsec, radii and modifications without values",
        "not reproducible",
        "the unit is not named and no size is printed",
        tables={1: "Parameter | Symbol | Value | Description"},
    ),
    Item(
        "002",
        "table of joints of an ADAMS model",
        "reproduced",
        "the pairs are those of the equilibrium, with rolling contacts for gear pairs and a floating sun where the "
        "input shaft has a rigid bearing; a rigid one changes nothing at rated load",
        held=("theory/equilibrium.md#parts-contacts-energy",),
        tests=("project/test_published.py",),
        tables={2: "Constraint Type"},
    ),
    Item(
        "002",
        "grid of 30 mm, gravity, step function of the input",
        "out of scope",
        "settings of a programme; the planar train has no weight",
    ),
    Item(
        "002",
        "error from the integral of the output's speed",
        "reproduced",
        "columns of speeds are read and integrated; what that costs is derived: the zero and a straight line are lost, "
        "and slow orders are uncertain. No record is printed",
        held=("bench-files.md#speeds-in-place-of-angles", "theory/test-bench.md#angles-from-speeds"),
        tests=("runs/bench/test_integrated_speeds.py",),
    ),
    Item(
        "002",
        "range of model and simulation -35 to 47 arcsec, of the bench -35.8 to 42.8",
        "not reproducible",
        "neither unit, errors, clearance nor load is printed, and two methods that agree to the arcsec are no "
        "check; errors of 8 um make such a width",
        held=("published 002 load", "bibliography.md#002"),
        tables={3: "Methodology"},
    ),
    Item(
        "002",
        "table of 10 and 20 N m at 1600 and 2000 rpm",
        "corrected",
        "load lessens the width where part errors of 8 um meet a clearance wider than they are, clearances alone do "
        "not; what speed adds depends on an inertia that is not printed",
        held=("published 002 load", "published 002 speed", "theory/dynamics.md#harmonic-balance"),
        tests=("dynamics/test_at_speed.py",),
        tables={4: "Load Torque"},
    ),
    Item(
        "002",
        "outlook: optimisation of clearance, load capacity and efficiency together",
        "out of scope",
        "each can be computed for a design, and tolerances of least cost can be found under several limits, but no "
        "design is searched for",
        held=("theory/allocation.md", "theory/friction.md", "theory/contact-pressure.md"),
        tests=("tolerances/test_at_load.py",),
    ),
    # --- 003 ----------------------------------------------------------------------------------------------------
    Item(
        "003",
        "table of parameters; cranks at 120 degrees, planets of 30 and a sun of 12 teeth at 20 degrees, splines of "
        "14 teeth at 30 degrees",
        "reproduced",
        "preset RV-003; the crank circle and the splines' radius follow, 42 and 7 mm",
        held=("bibliography.md#003",),
        tests=("geartrain/test_mechanism.py",),
        tables={1: "Parameter Name"},
    ),
    Item(
        "003",
        "profile of a disc",
        "corrected",
        "a length stands for a ratio, and the offset has an undefined angle",
        held=("ledger 003 profile",),
        equations={1: r"\sin(z_b \phi)", 2: r"\cos(z_b \phi)"},
    ),
    Item(
        "003",
        "transmission error as output less input over ratio",
        "reproduced",
        "the same definition and sign",
        held=("conventions.md#motion-and-error",),
        tests=("runs/test_measurement.py",),
        equations={3: "T_e"},
    ),
    Item(
        "003",
        "ratio 101; mean ratio 100.593 with an error of 0.05 %, 17.81 rpm at 1800 rpm of the input",
        "corrected",
        "misprints: 0.40 %, and the two figures contradict each other",
        held=("ledger 003 mean ratio",),
    ),
    Item(
        "003",
        "start and stop by a step function over 0.03 s",
        "corrected",
        "an inertia of the load, not printed, decides what it winds up; braking opens contacts, which is not solved, "
        "and no windup makes the mean ratio",
        held=("published 003 start and stop", "theory/dynamics.md#run-up"),
        tests=("dynamics/test_running_up.py",),
    ),
    Item(
        "003",
        "error of 42.6 arcsec per turn, the baseline",
        "not reproducible",
        "a nominal train has only lag; no part error is printed, and the spline's line shows that a clearance is in it",
        held=(
            "published 003 spline clearance",
            "published 003 start and stop",
            "theory/equilibrium.md#what-would-catch-a-mistake",
        ),
        tests=_LOADED,
    ),
    Item(
        "003",
        "pin housing as output",
        "reproduced",
        "ratio -100",
        held=("theory/housing-output.md#ratio",),
        tests=("statics/test_housing_output.py",),
    ),
    Item(
        "003",
        "error over the wear of the sun, 0 to 0.14 mm, said to be 4 % of the tooth: slow to 0.06 mm, then up to 352 "
        "arcsec",
        "corrected",
        "the slow part is met within 8 %; the step is no lost thickness, and 0.14 mm are 4.46 %",
        held=(
            "ledger 003 sun wear",
            "ledger 003 sun tooth",
            "published 003 sun wear",
            "published 003 step in the wear curves",
        ),
        tables={2: "Sun Gear Wear"},
    ),
    Item(
        "003",
        "error over the wear of the planets: 50 arcsec at 0.025 mm, 172 at 0.05 mm",
        "not reproducible",
        "nearly twice the sun's slope before the step, where both must be equal",
        held=("ledger 003 planet wear", "published 003 planet wear", "published 003 step in the wear curves"),
        tables={3: "Planetary Gear Wear"},
    ),
    Item(
        "003",
        "wear of the planets a third of the sun's, because three share the load",
        "corrected",
        "an assumption of the source; by the law of wear it is a seventh: three planets share it among more teeth, too",
        held=("ledger 003 share of wear", "theory/wear.md#one-passage"),
        tests=("statics/test_wear.py",),
    ),
    Item(
        "003",
        "error over the spline's clearance, 45 to 80 arcsec over 0.046 to 0.097 mm, limit 0.070 mm; linear law with "
        "500 arcsec/mm; a plot that is left out",
        "reproduced",
        "within 7 %; 500 is not the slope of its own end points, and nothing happens at 0.070 mm",
        held=("ledger 003 spline clearance", "published 003 spline clearance"),
        equations={4: r"k_c \cdot C"},
        figures={1: "graph below"},
    ),
    Item(
        "003",
        "error over the coefficient of friction, 0.01 to 0.05, between 30 and 60 arcsec; linear law from 50 with a "
        "slope of 200",
        "not reproducible",
        "the law and the text contradict each other; friction lessens the ripple of some errors and adds to that of "
        "others, and always to lost motion",
        held=("ledger 003 friction", "published 003 friction", "theory/friction.md#slip"),
        tests=("statics/test_friction.py",),
        equations={5: "T_e(f)"},
    ),
    Item(
        "003",
        "error over the stiffness of the pin contacts, 10,000 to 1,000,000 N/mm, 55 to 45 arcsec by 100,000",
        "corrected",
        "the trend is right; windup falls as 1/K, which these figures do not",
        held=("published 003 contact stiffness",),
        tables={4: "Contact Stiffness"},
    ),
    Item(
        "003",
        "pin force up to 135 N, meshing frequency 22 Hz",
        "corrected",
        "135 N belong to 127.5 N m; 22 Hz is how often two discs load one pin, the mesh runs at 463 Hz",
        held=("published 003 contact force",),
    ),
    Item(
        "003",
        "outlook: thermal effects, load cycles",
        "reproduced",
        "no formula and no number; growth with temperature, and losses, heat and wear of a duty of several phases",
        held=(
            "theory/thermal-and-load.md#temperature-of-a-duty",
            "theory/friction.md#a-duty-cycle",
            "theory/wear.md#duties-of-several-phases",
        ),
        tests=("geartrain/test_thermal.py", "statics/test_duty.py", "statics/test_wear.py"),
    ),
    # --- 004 ----------------------------------------------------------------------------------------------------
    Item(
        "004",
        "ratios of the stages, total from 30 to over 200; ratio 121 of the test",
        "corrected",
        "the pins stand for a ring gear; the figure of the test is right",
        held=("ledger 004 ratio",),
        equations={1: "i_p", 2: "i_c"},
    ),
    Item(
        "004",
        "bench, its encoders (+-0.39 and +-1.24 arcsec), couplings (+-0.1 mm), RV-40E with 412 N m",
        "reproduced",
        "taken as printed: the encoders count for 1.24 arcsec at the output; an axial runout tilts a coupling, order "
        "2; the radius that tells the angle is not printed: 1.3 arcsec at 20 mm",
        held=("ledger 004 encoders", "theory/test-bench.md#what-a-bench-leaves-uncertain"),
        tests=("runs/test_bench_uncertainty.py",),
        tables={1: "Table 1"},
    ),
    Item(
        "004",
        "measured error at 15 rpm, 56.33 arcsec forward, 57.42 in reverse, two turns; a curve that is left out",
        "corrected",
        "a maximum that is set beside a peak-to-peak; as peak-to-peak it needs lobe errors beside table 2, a list that "
        "makes 400 arcsec of lost motion, so no sold unit",
        held=("published 004 error set", "theory/rigidity.md#two-lists"),
        figures={1: "Figure 1"},
    ),
    Item(
        "004",
        "1000 points a turn",
        "corrected",
        "too few for the meshes",
        held=("ledger 004 sampling",),
    ),
    Item(
        "004",
        "sizes of ten errors",
        "corrected",
        "the sizes are taken; in ripple cams of 2 um can exceed clearance and pins, to which the text gives it; the "
        "clearance makes 400 arcsec of lost motion where the maker prints 60: no sold unit",
        held=(
            "theory/rigidity.md#two-lists",
            "published 004 shares",
            "published 004 error set",
            "ranking.md#source-004-the-list-of-its-virtual-prototype",
        ),
        tests=("model/test_ranking.py",),
        tables={2: "Table 2"},
    ),
    Item(
        "004",
        "parts of the prototype",
        "reproduced",
        "the preset's two cranks, two discs and 40 pins",
        held=("bibliography.md#004",),
        tests=("geartrain/test_mechanism.py",),
        tables={3: "Table 3"},
    ),
    Item(
        "004",
        "flexible bodies for discs, pins and carrier",
        "out of scope",
        "parts bend at their contacts alone; no tilt, no motion out of the plane",
        held=("theory/dynamics.md#what-it-leaves-out",),
    ),
    Item(
        "004",
        "contact force by a power of the penetration, exponent 1.5, and damping",
        "corrected",
        "1.5 is that of a point contact; a pin is a line contact, 10/9",
        held=("theory/compliance.md#contact-laws",),
        tests=("statics/test_compliance.py",),
        equations={3: "F_n"},
    ),
    Item(
        "004",
        "bearing as spring and damper of six freedoms with a preload; clearance as a stiffness that sets in",
        "corrected",
        "three of the six freedoms are in the plane, the others out of scope; spring and damper have opposite "
        "signs, so one of them drives; the force must set in at the clearance, not jump there",
        held=("ledger 004 bearing clearance", "theory/equilibrium.md#parts-contacts-energy"),
        tests=("statics/test_clearance.py",),
        equations={4: "k_{11}"},
    ),
    Item(
        "004",
        "run-up to 10,890 degrees per second in 1 s, 412 N m, 10 s in 30,000 steps; error over time, -0.0089 to "
        "0.0093 degrees",
        "corrected",
        "wider than statics makes of table 2, whose lost motion of 400 arcsec no sold unit has; with an inertia of the "
        "load, not printed, of the printed size",
        held=("published 004 error set", "published 004 run-up", "theory/rigidity.md#two-lists"),
        figures={2: "plotted over time"},
    ),
    Item(
        "004",
        "maximum of 1.092 arcmin against a measured 0.94 (56.33 arcsec), difference 0.13",
        "corrected",
        "a peak-to-peak against a maximum, and the difference is that from the reverse maximum",
        held=("ledger 004 maximum",),
    ),
    Item(
        "004",
        "effects and contributions of five errors",
        "not reproducible",
        "the contributions are of effects, not of variances; sun and assembly leave nothing. Clearances of 10 to 15 "
        "um, printed first, alone make 310 to 470 arcsec of lost motion, which no sold unit has",
        held=(
            "published 004 sensitivities",
            "ranking.md#source-004-its-sensitivities",
            "theory/rigidity.md#two-lists",
        ),
        tests=("model/test_ranking.py",),
        tables={4: "Table 4"},
    ),
    Item(
        "004",
        "series of the error to second order",
        "not reproducible",
        "contacts open, which no product of errors holds",
        held=("published 001 and 004 series of second order",),
        equations={5: r"\Delta \theta"},
    ),
    Item(
        "004",
        "error from a pin's position",
        "corrected",
        "an angle of the crank",
        held=("ledger 004 pin position",),
        equations={6: r"\Delta \theta_c"},
    ),
    Item(
        "004",
        "error from the sun's eccentricity",
        "corrected",
        "no ring gear; divided by the ratio, not multiplied",
        held=("ledger 004 sun eccentricity",),
        equations={7: r"\Delta \theta_p"},
    ),
    Item(
        "004",
        "equation of motion of the carrier alone",
        "corrected",
        "the spring is wound up by output less input over ratio, not by the output's angle; one freedom is the "
        "limit of stiff parts",
        held=("theory/dynamics.md#equations",),
        tests=("dynamics/test_harmonic_balance.py", "dynamics/test_natural_modes.py"),
        equations={8: r"J \ddot{\theta}"},
    ),
    Item(
        "004",
        "five natural frequencies, 245 to 689 Hz",
        "not reproducible",
        "of flexible bodies in space; bending and axial motion are none of a planar train",
        held=("published 004 modes", "theory/dynamics.md#modes"),
        tests=("dynamics/test_natural_modes.py",),
        tables={5: "Table 5"},
    ),
    Item(
        "004",
        "lubrication: more damping lessens peaks by up to 15 %",
        "not reproducible",
        "no coefficient and no speed is printed; damping lessens what resonates, friction widens the loop of the "
        "torsion curve and moves peaks by a few per cent; the peaks are those of table 2, a list with some 400 arcsec "
        "of lost motion, so of no sold unit",
        held=(
            "published 004 lubrication",
            "theory/friction.md#slip",
            "theory/dynamics.md#damping",
            "theory/rigidity.md#two-lists",
        ),
        tests=("dynamics/test_at_speed.py",),
    ),
    Item(
        "004",
        "preload of 50 N on bearings lessens the error by 20 %",
        "not reproducible",
        "neither which bearings, in which direction, nor the clearance that is left is printed; pressed in by 50 N all "
        "around, the ripple changes by less than 1 %, and lost motion falls",
        held=("published 004 preload", "theory/rigidity.md#preloaded-bearings"),
        tests=("statics/test_preload.py",),
    ),
    Item(
        "004",
        "a modified profile improves the accuracy by 10 %",
        "not reproducible",
        "no size is printed; usual ones widen the ripple, by up to a tenth, or take 2 % off; that is of table 2, a "
        "list with some 400 arcsec of lost motion, so of no sold unit",
        held=("published 004 modified profile", "theory/rigidity.md#two-lists"),
    ),
    Item(
        "004",
        "outlook: compensation in real time, temperature, wear",
        "reproduced",
        "no formula, no number; temperature and wear are computed, and compensation is a table that the controller "
        "applies while the axis moves",
        held=("theory/compensation.md", "theory/thermal-and-load.md", "theory/wear.md"),
        tests=("compensation/test_compensate.py", "geartrain/test_thermal.py", "statics/test_wear.py"),
    ),
    Item(
        "004",
        "outlook: advanced materials",
        "out of scope",
        "no material and no property is printed; stiffness, inertia, expansion and wear coefficients are inputs",
        held=("conventions.md#two-methods",),
    ),
)

_HEAD = """# Every equation, figure and table of the published texts

The five texts from beginning to end: each equation, each table and each figure has one row with one verdict, and each
number of the prose stands in a row.

- **reproduced**: it comes out of rverror, within what the row says.
- **corrected**: some of it is wrong, or right under a condition that is not printed; the right one stands where the row
  leads.
- **not reproducible**: its own formula does not give it, or what it would need is not printed.
- **out of scope**: rverror does not model it, and the row says why.

Equations, tables and figures are counted in the order of each text, as the texts do not number equations. Figures are
not in the texts; what is said of them is. Rows of the [ledger](ledger.md) set formulas beside the right ones, tables of
[published numbers](published.md) results of whole gear trains. That nothing is left out is tested against the texts,
`tests/project/test_sources.py`. What they are: [bibliography](bibliography.md).
"""


def markdown() -> str:
    """Text of the page ``docs/sources.md``.

    Returns
    -------
    str
        Markdown, one line break at the end.
    """
    lines = [_HEAD, _line("source", *VERDICTS, "all"), _line(*["---"] * (len(VERDICTS) + 2))]
    for source, title in SOURCES.items():
        found = [item.verdict for item in ITEMS if item.source == source]
        lines.append(_line(f"{source} {title}", *(str(found.count(v)) for v in VERDICTS), str(len(found))))
    for source, title in SOURCES.items():
        lines += ["", f"## {source} {title}", ""]
        lines += [_line("printed", "place", "verdict", "why", "held by", "tests"), _line(*["---"] * 6)]
        lines += [_row(item) for item in ITEMS if item.source == source]
    return "\n".join(lines) + "\n"


def _row(item: Item) -> str:
    places = []
    if item.equations:
        symbols = dict.fromkeys(f"${mark}$" for mark in item.equations.values())
        places.append(f"eq. {_numbers(item.equations)}: {', '.join(symbols)}")
    for name, of in (("table", item.tables), ("figure", item.figures)):
        if of:
            places.append(f"{name} {_numbers(of)}")
    return _line(
        item.what,
        "; ".join(places) or "text",
        item.verdict,
        item.why,
        _references(item) or "-",
        ", ".join(f"`tests/{name}`" for name in tests(item)) or "-",
    )


def tests(item: Item) -> list[str]:
    """Files of tests, below ``tests/``, that hold an item: of the ledger, of published numbers, its own."""
    kinds = {name.partition(" ")[0] for name in item.held}
    own = [f"project/test_{kind}.py" for kind in ("ledger", "published") if kind in kinds]
    return list(dict.fromkeys([*own, *item.tests]))


def _references(item: Item) -> str:
    """Links to rows of the ledger, all in one, to tables of published numbers, and to pages."""
    rows = [name.removeprefix("ledger ") for name in item.held if name.startswith("ledger ")]
    links = [f"[ledger](ledger.md): {', '.join(rows)}"] if rows else []
    for name in item.held:
        kind, _, key = name.partition(" ")
        if kind == "published":
            links.append(f"[{key}](published.md#{anchor(key)})")
        elif kind != "ledger":
            links.append(f"[{Path(name.partition('#')[0]).stem}]({name})")
    return "; ".join(links)


def _numbers(places: Mapping[int, str]) -> str:
    return ", ".join(map(str, places))


def _line(*cells: str) -> str:
    return "| " + " | ".join(cells) + " |"


if __name__ == "__main__":
    print(markdown(), end="")
