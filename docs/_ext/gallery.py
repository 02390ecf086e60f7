"""The gallery of plots: a small picture of each, made by the line of code that stands beside it.

`python docs/_ext/gallery.py` draws the pictures of docs/gallery, of the README and of two pages of the theory, and
writes the table of the gallery into docs/plots.md; it takes a minute.  A test holds table, pictures and kinds together.
"""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from rverror.statics import Wear
from rverror.statics.duty import duty_words
from rverror.views import new_figure
from rverror.views.plots.figure import Figure, lines
from rverror.views.plots.labels import labelled
from rverror.views.plots.page_figures import figure_of
from rverror.views.shown_units import LENGTH

DOCS = Path(__file__).parents[1]
FOLDER = "gallery"
_COLUMNS = 3
_WIDTH = 720  # px
_COLOURS = 80  # of a palette: what lines, hatches, maps and their soft edges need
_BEGIN, _END = "<!-- gallery, written by docs/_ext/gallery.py -->", "<!-- end of gallery -->"

#: What the lines below draw; everything is simulated.
SETUP = """
import math
from dataclasses import replace
from importlib.resources import files
import numpy as np
import rverror
from rverror.lots.amplitudes import LotUnit

demo = files("rverror") / "data" / "demo"
declared = rverror.load_model(str(demo / "model.toml"))
runs = [rverror.load_run(str(demo / name), declared) for name in ("forward.csv", "reverse.csv")]
found = rverror.diagnose(declared, runs)
made = rverror.compensate(declared, runs)
last = runs[0].nominal_angle(declared) > 4 * np.pi
angles = ("input_angle", "output_angle", "direction")
two, third = (replace(runs[0], **{name: getattr(runs[0], name)[at] for name in angles}) for at in (~last, last))
foreseen = rverror.compensate(declared, [two], unseen=[third])

unit = rverror.Model(
    rverror.reducer("RV-40E"),
    (
        rverror.effect("crank.eccentricity", crank=0, disc=1, radial="4 um"),
        rverror.effect("cycloid.pin_circle", harmonic=2, radial_cos="3 um"),
        rverror.effect("involute.planet_eccentricity", crank=0, x="6 um"),
    ),
    "unit 7",
)
worm = rverror.Model(
    rverror.Drive(ratio=-14.0, shafts={"motor": 14.0, "idler": 3.5}),
    (
        rverror.effect("shaft.eccentricity", shaft="motor", harmonic=1, cos="12 arcsec"),
        rverror.effect("shaft.eccentricity", shaft="idler", harmonic=1, cos="30 arcsec"),
        rverror.effect("sensor.encoder_eccentricity", cos="8 arcsec", sin="3 arcsec"),
    ),
    "geared motor",
)
theta = 2 * np.pi * np.arange(512) / 512
state = rverror.equilibrium(unit, theta, torque="100 N*m")
torsion = rverror.statics.torsion_curve(unit, theta[:128:16], torques=[f"{t} N*m" for t in range(-60, 61, 5)])
pressed = rverror.statics.contact_pressure(unit, theta[:128], torque="412 N*m", disc_width="9 mm", gear_width="8 mm")
loaded = rverror.runs.simulate_runs(unit, torques=("20 N*m", "100 N*m", "400 N*m"), points=1024, revolutions=2,
                               method="equilibrium", noise="0.3 arcsec", seed=1)
table = rverror.runs.order_table_from_runs(loaded, unit, (39, 40, 78, 80, 120))

arm = replace(unit, bench=rverror.model.Bench(load_inertia="20 kg*m^2", damping_ratio=0.03))
modes = rverror.dynamics.modes(arm, torque="100 N*m")
speeds = rverror.dynamics.speed_response(arm, np.linspace(15, 1815, 61) * math.pi / 30, torque="412 N*m")
started = rverror.dynamics.run_up(arm, [0, 1, 1.5], np.array([0, 1815, 1815]) * math.pi / 30, torque="412 N*m")

rubs = rverror.geartrain.Friction(pin=0.05, mesh=0.05, crank_bearing=0.0025, crank_bearing_radius="10 mm",
                        carrier_bearing=0.0018, carrier_bearing_radius="10 mm", drag="4 N*m")
lossy = rverror.statics.efficiency(unit, theta[::16], torque="412 N*m", friction=rubs)
sizes = (6, 12, 25, 50, 100, 200, 412)
loop = rverror.statics.hysteresis(unit, theta[:128:16], friction=rubs,
                          torques=[f"{t} N*m" for t in (*(-size for size in sizes[::-1]), 0, *sizes)])
duty = dict(torque="412 N*m", input_speed="1815 rpm", disc_width="9 mm", gear_width="8 mm",
            coefficients=rverror.statics.WearCoefficients(disc="1e-10 mm^3/(N*m)", pin="1e-10 mm^3/(N*m)"))
worn = rverror.statics.wear(unit, hours=6000, **duty)
flawless = rverror.statics.wear(rverror.Model(unit.mechanism), hours=[0, 2000, 4000, 6000], **duty)

tolerances = (
    rverror.tolerance("crank.eccentricity", "5 um", cost=rverror.tolerances.cost.Reciprocal(10.0, 0.005)),
    rverror.tolerance("cycloid.pin_radius", "3 um", cost=rverror.tolerances.cost.Reciprocal(4.0, 0.003)),
    rverror.tolerance("involute.planet_eccentricity", "8 um", cost=rverror.tolerances.cost.Reciprocal(2.0, 0.008)),
)
limits = [rverror.limit("transmission_error", "40 arcsec", torque=f"{torque} N*m") for torque in (20, 412)]
limits.append(rverror.limit("lost_motion", "60 arcsec"))
budget = rverror.error_budget(rverror.Model(unit.mechanism), tolerances, count=8192, index_count=512,
                              limits=limits, loaded_count=400)
least = rverror.allocate(budget.model, tolerances, limit="45 arcsec", kind="worst")
limits = ["1 arcsec", "30 arcsec", "35 arcsec", "40 arcsec", "45 arcsec", "50 arcsec", "55 arcsec"]
front = rverror.tolerances.cost_front(budget.stack, limits, kind="worst")

small = rverror.Model(rverror.Reducer(sun_teeth=9, planet_teeth=27, module=1.5, pressure_angle="20 deg", disc_lobes=15,
                                      pins=16, pin_circle_radius=64, pin_radius=5, eccentricity=2.4,
                                      cranks=2, discs=2, name="small unit"))
drawing = (rverror.tolerance("crank.eccentricity", "10 um"), rverror.tolerance("cycloid.pin_position", "6 um"))
rng, turn = np.random.default_rng(4), 2 * np.pi * np.arange(128) / 128
units = []
for number in range(40):
    cams = [rverror.effect("crank.eccentricity", crank=k // 2, disc=k % 2, radial=x, tangential=y)
            for k, (x, y) in enumerate(rng.normal(0, 2e-3, (4, 2)))]
    pins = [rverror.effect("cycloid.pin_position", pin=k, radial=x, tangential=y)
            for k, (x, y) in enumerate(rng.normal(0, 2.5e-3, (16, 2)))]
    both = rverror.runs.simulate_runs(rverror.Model(small.mechanism, (*cams, *pins)), torques=("150 N*m",), points=128,
                                 revolutions=1, method="equilibrium", noise="0.2 arcsec", seed=number)
    units.append(LotUnit(f"{number:02}", tuple(both)))
lot = rverror.lot(small, units, tolerances=drawing)

life = []
for number, hours in enumerate((0, 200, 450, 600, 900, 1200, 1500, 1800)):
    bent = rverror.effect("crank.eccentricity", crank=1, disc=0, radial=3e-3, tangential=2e-6 * hours)
    thin = rverror.effect("involute.tooth_thinning", member="sun", thinning=2e-6 * max(hours - 600, 0))
    both = rverror.runs.simulate_runs(rverror.Model(small.mechanism, (bent, thin)), torques=("150 N*m",), points=256,
                                 revolutions=1, method="equilibrium", noise="0.2 arcsec", seed=number)
    life += [replace(run, index="A", metadata={"hours": str(hours)}) for run in both]
trend = rverror.trend(small, life)
compared = rverror.life.compare_runs(life[:2], life[-2:], small)

rng = np.random.default_rng(5)
parts = [rverror.parts.MeasuredPart("crank", f"C{n}", (rverror.effect("crank.eccentricity", disc=0, radial=x),
                                                 rverror.effect("crank.eccentricity", disc=1, radial=y)))
         for n, (x, y) in enumerate(rng.normal(0, 4e-3, (40, 2)))]
parts += [rverror.parts.MeasuredPart("housing", f"H{n}", tuple(rverror.effect("cycloid.pin_position", pin=k, radial=x)
                                                         for k, x in enumerate(of)))
          for n, of in enumerate(rng.normal(0, 3e-3, (20, 16)))]
matched = rverror.match(small, parts, [rverror.limit("transmission_error", "25 arcsec", torque="150 N*m")])

seven, drives = rverror.Model(rverror.Drive(ratio=7.0)), []
for number in range(12):
    parts = rng.normal(0, 1e-4, (2, 30)) / np.arange(1, 31) * (25.0 if number == 8 else 1.0)
    parts[0, 3] += 1e-4
    waves = np.arange(1, 31)[:, None] * turn
    te = parts[0] @ np.cos(waves) + parts[1] @ np.sin(waves) + 1e-7 * rng.normal(size=turn.size)
    drives.append(LotUnit(str(number), (rverror.run_from_arrays(input_angle=7 * turn, te=te, direction=1.0),)))
lot_of_drives = rverror.lots.lot_of_drives(seven, drives)
"""

#: Line that draws each picture.
LINES = {
    "model-waveform": "unit.plot()",
    "model-stacked": 'unit.plot(kind="stacked")',
    "model-polar": 'unit.plot(kind="polar")',
    "model-spectrum": 'unit.plot(kind="spectrum")',
    "model-mechanism": 'unit.plot(kind="mechanism", theta="30 deg", torque="20 N*m")',
    "influence-waveform": 'rverror.influence(unit.mechanism, theta[:64], "cycloid.pin_circle", harmonic=2).plot()',
    "influence-crank": 'rverror.influence(unit.mechanism, theta[:64], "crank.eccentricity", crank=0, disc=1).plot()',
    "influence-planet": 'rverror.influence(unit.mechanism, theta[:64], "involute.planet_eccentricity", crank=0).plot()',
    "influence-bore": 'rverror.influence(unit.mechanism, theta[:64], "coupling.carrier_bore_position", crank=0).plot()',
    "reducer-mechanism": 'rverror.reducer("RV-40E", output="housing").plot(theta="30 deg")',
    "drive-spectrum": 'worm.plot(kind="spectrum")',
    "equilibrium-waveform": "state.plot()",
    "equilibrium-spectrum": 'state.plot(kind="spectrum")',
    "torsioncurve-torsion": 'torsion.plot(rated="412 N*m")',
    "hysteresis-loop": 'loop.plot(rated="412 N*m")',
    "efficiency-losses": "lossy.plot()",
    "contactpressure-pressure": "pressed.plot()",
    "wear-hours": "worn.plot()",
    "modes-shape": "modes.plot()",
    "speedresponse-campbell": "speeds.plot()",
    "speedresponse-order_map": 'speeds.plot(kind="order_map")',
    "runup-waveform": "started.plot()",
    "run-waveform": "runs[0].plot(ratio=declared)",
    "run-spectrum": 'runs[0].plot(kind="spectrum", ratio=declared)',
    "runs-order_map": "rverror.views.order_map(loaded, ratio=unit, highest=170)",
    "ordertable-passport": "table.plot()",
    "diagnosis-waveform": "found.plot()",
    "diagnosis-spectrum": 'found.plot(kind="spectrum")',
    "diagnosis-residual": 'found.plot(kind="residual")',
    "diagnosis-candidates": 'found.plot(kind="candidates")',
    "compensation-orders": "made.plot()",
    "compensation-waveform": 'made.plot(kind="waveform")',
    "errorbudget-contributions": "budget.plot()",
    "errorbudget-distribution": 'budget.plot(kind="distribution", limit=50 * rverror.ARCSEC)',
    "errorbudget-envelope": 'budget.plot(kind="envelope")',
    "errorbudget-at_load": 'budget.plot(kind="at_load")',
    "allocation-widths": "least.plot()",
    "allocation-front": 'least.plot(kind="front", front=front)',
    "lot-processes": "lot.plot()",
    "lot-shares": 'lot.plot(kind="shares")',
    "trend-courses": "trend.plot()",
    "runscompared-orders": "compared.plot()",
    "matched-errors": "matched.plot()",
    "drivelot-orders": "lot_of_drives.plot()",
}


def worn_depths(found: Wear) -> Figure:
    """Depth that a lobe and the pin on it have lost together, over the roll angle."""
    figure, (ax,) = new_figure()
    depths = LENGTH.of(found.lobe_depth + found.pin_depth)
    named = zip((f"{hours:g} h" for hours in found.hours), depths, strict=True)
    lines(ax, np.degrees(found.roll_angle), list(named)[1:])
    x = "roll angle from root over tip to root, deg"
    labelled(ax, f"wear at {duty_words(found.duty)}", x=x, y="worn off, um", legend="beside")
    return figure


#: Pictures of pages other than the gallery: how each is drawn, and its width.
OTHERS: dict[str, tuple[Callable[[dict[str, Any]], Figure], int]] = {
    "before-and-after": (lambda of: figure_of(replace(of["found"], traces=of["found"].traces[:1])), 840),
    "theory/compensation": (lambda of: figure_of(replace(of["foreseen"], traces=of["foreseen"].traces[-1:])), 840),
    "theory/wear": (lambda of: worn_depths(of["flawless"]), 840),
}


def gallery() -> str:
    """Table of the thumbnails: each leads to its picture in full, with the line that draws it under it.

    The site lays its cells out as a grid, as many in a row as the screen has room for.
    """
    cells = [f"[![{line}]({FOLDER}/{name}.png)]({FOLDER}/{name}.png)<br>`{line}`" for name, line in LINES.items()]
    rows = ["| | | |", "| --- | --- | --- |"]
    for start in range(0, len(cells), _COLUMNS):
        taken = cells[start : start + _COLUMNS]
        rows.append("| " + " | ".join([*taken, *[""] * (_COLUMNS - len(taken))]) + " |")
    return "\n".join(rows)


def written(page: str) -> str:
    """The page with the gallery between its marks."""
    head, rest = page.split(_BEGIN)
    return f"{head}{_BEGIN}\n\n{gallery()}\n\n{_END}{rest.partition(_END)[2]}"


def small(figure: Any, *, width: int = _WIDTH) -> bytes:
    """Figure as a small PNG: so many dots wide, with a palette in place of all colours."""
    from PIL import Image

    raw, out = io.BytesIO(), io.BytesIO()
    figure.savefig(raw, format="png", dpi=width / figure.get_size_inches()[0], metadata={"Software": None})
    Image.open(raw).convert("RGB").quantize(_COLOURS, dither=Image.Dither.NONE).save(out, format="png", optimize=True)
    return out.getvalue()


def main() -> None:
    """Draw all and write the table."""
    names: dict[str, Any] = {}
    exec(SETUP, names)
    folder = DOCS / FOLDER
    folder.mkdir(exist_ok=True)
    for name, line in LINES.items():
        (folder / f"{name}.png").write_bytes(small(eval(line, names).figure))
    for name, (drawn, width) in OTHERS.items():
        (DOCS / f"{name}.png").write_bytes(small(drawn(names), width=width))
    page = DOCS / "plots.md"
    page.write_text(written(page.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
