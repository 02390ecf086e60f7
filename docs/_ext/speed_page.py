"""The page of the error at speed, docs/theory/error-at-speed.md: its text, its numbers, and its pictures on the site.

`python docs/_ext/speed_page.py` writes the page; a test compares the two.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from rverror.base.units import ARCSEC
from rverror.dynamics.at_speed import CriticalSpeed, SpeedResponse, speed_response
from rverror.dynamics.natural_modes import modes
from rverror.dynamics.running_up import RunUp, run_up
from rverror.geartrain.mechanism import Reducer, Stiffness, reducer
from rverror.model.effects import Model, effect
from rverror.model.ends import Bench
from rverror.statics.rigidity import torsional_stiffness
from rverror.views.plots.figure import new_figure, svg_element

RPM = math.pi / 30
ARM = Bench(load_inertia="20 kg*m^2", damping_ratio=0.03)
#: The worked example: what its errors are, for the table.
ERRORS = (
    effect("crank.eccentricity", crank=0, disc=0, radial="5 um"),
    effect("cycloid.pin_circle", harmonic=2, radial_cos="1.5 um"),
    effect("crank.bearing_clearance", clearance="2.5 um"),
)
MODEL = Model(reducer("RV-40E"), ERRORS, bench=ARM)
TORQUE = 412e3
SPEEDS = np.linspace(15, 1815, 181) * RPM
#: Where an order comes from in this example.
FROM = {40: "the cam", 78: "the oval pin circle", 80: "clearance", 120: "clearance", 156: "pins", 160: "clearance"}


def response(change: str = "as it is") -> SpeedResponse:
    """Error against speed up to 15 rpm of the output, as it is or with one of the changes."""
    return _responses(change)


@functools.cache
def _responses(change: str) -> SpeedResponse:
    return speed_response(remedies()[change], SPEEDS, torque=TORQUE)


@functools.cache
def running() -> RunUp:
    """From rest to 1815 rpm in a second."""
    return run_up(MODEL, [0, 1, 1.5], np.array([0, 1815, 1815]) * RPM, torque=TORQUE)


def first_frequency(bench: Bench, unit: Reducer | None = None, *, torque: float = TORQUE) -> float:
    """Lowest natural frequency of the machine, Hz."""
    found = modes(Model(unit or reducer("RV-40E"), bench=bench), torque=torque)
    return float(found.frequency[(found.frequency > 0) & ~found.of_sun_support].min())


def matched(frequency: float, at: Callable[[float], float], low: float, high: float) -> float:
    """Inertia at which a frequency that falls with it has a value, by halving on a scale of ratios."""
    for _ in range(50):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if at(middle) > frequency else (low, middle)
    return high


# --- the measured reducer of ratio 81 ---------------------------------------------------------------------------------

#: Its natural frequency, Hz, and torsional stiffness, N*m/arcmin, as measured.
MEASURED_FREQUENCY, MEASURED_STIFFNESS = 51.5, 450.0


def unit_81(scale: float = 1.0) -> Reducer:
    """Geometry as its authors state it, crank circle kept; three cranks, two discs and pins of 5 mm are guessed."""
    own = Stiffness()
    names = ("pin_contact", "crank_bearing", "carrier_bearing", "gear_mesh", "sun_support", "main_bearing")
    return Reducer(
        sun_teeth=22,
        planet_teeth=44,
        module=65 / 33,
        pressure_angle="20 deg",
        disc_lobes=39,
        pins=40,
        pin_circle_radius=111.5,
        pin_radius=5.0,
        eccentricity=2.0,
        cranks=3,
        discs=2,
        rated_torque="1600 N*m",
        stiffness=Stiffness(**{name: scale * getattr(own, name) for name in names}),
    )


@functools.cache
def stiffness_81() -> float:
    """Torsional stiffness with default contacts, N*m/arcmin."""
    return float(np.mean(torsional_stiffness(Model(unit_81()), np.linspace(0, 0.1, 9)))) * math.radians(1 / 60) / 1e3


@functools.cache
def unit_81_as_stiff_as_measured() -> Reducer:
    """All contacts softer or stiffer alike: with linear contacts the whole is in proportion."""
    return unit_81(MEASURED_STIFFNESS / stiffness_81())


def load_81(frequency: float) -> float:
    """Moment of inertia of a load, kg*m^2, that makes the first frequency, the input held."""
    unit = unit_81_as_stiff_as_measured()
    return matched(frequency, lambda j: first_frequency(Bench(load_inertia=1e3 * j), unit, torque=1e6), 0.1, 1e3)


def input_81(frequency: float) -> float:
    """Moment of inertia of a free input, kg*m^2, that makes it, the output held by a load of 1e6 kg*m^2."""
    unit = unit_81_as_stiff_as_measured()

    def at(inertia: float) -> float:
        bench = Bench(input_inertia=1e3 * inertia, position_control_stiffness=0, load_inertia=1e9)
        return first_frequency(bench, unit, torque=1e6)

    return matched(frequency, at, 1e-5, 1.0)


# --- the page ---------------------------------------------------------------------------------------------------------


def arcsec(angle: float, digits: int = 0) -> str:
    """Angle as the page tells it."""
    return f"{angle / ARCSEC:.{digits}f}"


def peaks(most: int = 6) -> tuple[CriticalSpeed, ...]:
    """The largest critical speeds of the example."""
    return response().critical_speeds[:most]


def _peak_rows() -> str:
    found = response()
    rows = []
    for one in peaks():
        crawl = abs(found.crawl_waves[found.order.tolist().index(one.order)])
        cause = FROM.get(int(one.order), "both")
        speed, frequency = one.speed / RPM, one.order * one.speed / found.ratio / (2 * math.pi)
        rows.append(
            f"| {one.order:.0f} | {cause} | {arcsec(crawl, 2)} | {speed:.0f} | {frequency:.1f} | "
            f"{arcsec(one.amplitude, 1)} | {one.growth:.0f} |"
        )
    return "\n".join(rows)


def remedies() -> dict[str, Model]:
    """What can be done, each by itself."""
    own = Stiffness()
    names = ("pin_contact", "crank_bearing", "carrier_bearing", "gear_mesh")
    stiffer = Stiffness(**{name: 1.25 * getattr(own, name) for name in names})
    oval, clearance = replace(ERRORS[1], values=tuple(v / 2 for v in ERRORS[1].values)), ERRORS[2]
    return {
        "as it is": MODEL,
        "half the ovality of the pin circle": replace(MODEL, effects=(ERRORS[0], oval, clearance)),
        "half the clearance": replace(
            MODEL, effects=(*ERRORS[:2], effect("crank.bearing_clearance", clearance="1.25 um"))
        ),
        "twice the damping": replace(MODEL, bench=replace(ARM, damping_ratio=0.06)),
        "contacts stiffer by a quarter": replace(MODEL, mechanism=reducer("RV-40E", stiffness=stiffer)),
        "a quarter of the inertia": replace(MODEL, bench=replace(ARM, load_inertia=ARM.load_inertia / 4)),
    }


def _remedy_rows() -> str:
    rows = []
    for name, model in remedies().items():
        found = response(name)
        top = int(found.peak_to_peak.argmax())
        frequency = first_frequency(model.bench, model.mechanism if isinstance(model.mechanism, Reducer) else None)
        rows.append(
            f"| {name} | {frequency:.1f} | {arcsec(found.peak_to_peak[top])} | {found.speed[top] / RPM:.0f} | "
            f"{arcsec(found.peak_to_peak[-1])} |"
        )
    return "\n".join(rows)


def markdown() -> str:
    """Text of the page."""
    found, run = response(), running()
    bare = modes(Model(reducer("RV-40E")), torque=TORQUE)
    quarter = modes(Model(reducer("RV-40E")), torque=TORQUE, theta=math.pi / 80)
    low, high = ((one.frequency[~one.of_sun_support]).tolist() for one in (bare, quarter))
    rising = run.time <= 1
    bare_81 = first_frequency(Bench(), unit_81_as_stiff_as_measured(), torque=1e6)
    closed = max(float(share.max()) for share in found.pulled.values())
    values = {
        "frequency": f"{first_frequency(ARM):.1f}",
        "light": f"{first_frequency(Bench(load_inertia='5 kg*m^2')):.1f}",
        "cranks_low": f"{low[0]:.0f}",
        "cranks_high": f"{high[0]:.0f}",
        "carrier": f"{low[1]:.0f}",
        "growth": f"{math.hypot(1, 1 / (2 * ARM.damping_ratio)):.1f}",
        "peaks": _peak_rows(),
        "crawl": arcsec(float(np.ptp(found.crawl))),
        "largest": arcsec(float(found.peak_to_peak.max())),
        "at": f"{found.speed[found.peak_to_peak.argmax()] / RPM:.0f}",
        "last": arcsec(float(found.peak_to_peak[-1])),
        "mesh": f"{60 * low[0] * 121 / 1560:.0f}",
        "softer": f"{(bare_81 / MEASURED_FREQUENCY) ** 2:.1f}",
        "heavier": f"{round(ARM.load_inertia / (bare.inertia.carrier_inertia or math.inf), -3):.0f}",
        "forty": f"{60 * first_frequency(ARM) * 121 / 40:.0f}",
        "pulled": f"{100 * closed:.1f}",
        "remedies": _remedy_rows(),
        "run_windup": arcsec(float(np.ptp(run.windup))),
        "run_vibration": arcsec(float(np.ptp(run.vibration[rising]))),
        "still_vibration": arcsec(float(np.ptp(found.transmission_error - found.crawl, axis=1).max())),
        "run_torque": f"{run.output_torque.max() / 1e3:.0f}",
        "default_81": f"{stiffness_81():.0f}",
        "bare_81": f"{bare_81:.0f}",
        "load_81_low": f"{load_81(52.5):.1f}",
        "load_81": f"{load_81(MEASURED_FREQUENCY):.1f}",
        "load_81_high": f"{load_81(51.0):.1f}",
        "input_81": f"{1e3 * input_81(MEASURED_FREQUENCY):.2f}",
        **{f"speed_{k}": f"{60 * 81 * MEASURED_FREQUENCY / k:.0f}" for k in (156, 162, 240)},
    }
    return TEMPLATE.format(**values)


#: Pictures of the site: what draws each, and its words.
PICTURES: dict[str, tuple[str, Callable[[], SpeedResponse | RunUp], dict[str, object], str]] = {
    "campbell": ("campbell", response, {"most": 4}, "Campbell diagram of the RV-40E with its arm"),
    "order-map": ("order_map", response, {"highest": 170.0}, "Amplitude of each order over the input speed"),
    "run-up": ("waveform", running, {}, "Error while the arm is run up in a second"),
}


def picture(name: str) -> str:
    """A picture as a piece of HTML."""
    kind, make, options, words = PICTURES[name]
    figure, (ax,) = new_figure(1, width=7.5, height=3.6)
    make().plot(kind=kind, ax=ax, **options)
    drawn = svg_element(figure).replace("<svg ", f'<svg role="img" aria-label="{words}" ', 1)
    return f'<figure class="drawn">{drawn}<figcaption>{words}</figcaption></figure>'


TEMPLATE = """# From part errors to the error at speed

An RV-40E: which orders its part errors make, which natural frequency they meet at which speed, and what to do
about it. The equations are those of [dynamics](dynamics.md); every number here is computed by
`docs/_ext/speed_page.py`, which writes this page (`python docs/_ext/speed_page.py`).

## The machine

An RV-40E moves an arm of 20 kg m² against 412 N m, up to 15 rpm, 1815 rpm of the input. One cam is eccentric by 5
um, the pin circle is oval by 1.5 um, the cams' bearings have 2.5 um of clearance. Stiffness is the default, inertia
of the parts [estimated](dynamics.md#inertia), damping 3 %.

```python
import numpy as np
import rverror

errors = (
    rverror.effect("crank.eccentricity", crank=0, disc=0, radial="5 um"),
    rverror.effect("cycloid.pin_circle", harmonic=2, radial_cos="1.5 um"),
    rverror.effect("crank.bearing_clearance", clearance="2.5 um"),
)
arm = rverror.model.Bench(load_inertia="20 kg*m^2", damping_ratio=0.03)
model = rverror.Model(rverror.reducer("RV-40E"), errors, bench=arm)
```

## From errors to orders, from orders to frequencies

An error's order follows from the part in which it is [fixed](../conventions.md): $k$ waves a turn of the output. At
output speed $n$ it drives at $f = k\\,n$.

| order | comes of | at 15 rpm of the output, Hz |
| --- | --- | --- |
| 39, 78 | pins and pin circle; two equal discs cancel 39 of what they share | 9.75, 19.5 |
| 40, 80, 160 | cranks, discs, planets; clearance makes 80 and its multiples | 10, 20, 40 |
| 120, 240 | sun | 30, 60 |
| 1080 | gear mesh | 270 |
| 1560 | cycloid mesh | 390 |

## What natural frequencies there are

`rverror.dynamics.modes(model)` tells them, with what holds each and what moves in it.

- **The load on the train's windup**, with this arm at {frequency} Hz, with 5 kg m² at {light}. It is the one that
  matters: all part errors turn the output, and so shake it. To its frequency belongs $2\\pi f = \\sqrt{{K_t/J}}$,
  $K_t$ the torsional stiffness.
- **The two cranks against each other**, {cranks_low} to {cranks_high} Hz, 80 times a turn up and down with the
  cranks' angle. The cycloid mesh would meet it from {mesh} rpm on, beyond what this unit turns.
- **The carrier alone**, {carrier} Hz, where no load hangs on it.
- A mode marked as one of the sun's support is none of the machine.

<!-- picture: campbell -->

## What makes the peaks

An order peaks at the input speed at which its line in the Campbell diagram meets a frequency,

$$n_{{in}} = \\frac{{60 f R}}{{k}} ,$$

and there grows to $\\sqrt{{1 + 1/(2\\zeta)^2}}$ times what it is at a crawl, {growth} at 3 % damping. High orders
meet the load first, at low speed, and are small; low orders meet it late, and are large. Order 40 would at {forty}
rpm, beyond what this unit turns. `rverror.dynamics.speed_response(model, speeds).critical_speeds`, the largest six:

| order | of | at a crawl, arcsec | peak at, rpm of the input | Hz | amplitude, arcsec | times |
| --- | --- | --- | --- | --- | --- | --- |
{peaks}

<!-- picture: order-map -->

The whole error, peak-to-peak: {crawl} arcsec at a crawl, {largest} at {at} rpm, {last} at 1815 rpm. The cam, which
leads at a crawl, is not what leads at speed. At its worst {pulled} % of the force of closed contacts would have to
be a pull; above 1 % the result says so, and is no prediction.

## What to do about it

Each change alone, over the same speeds:

| change | first frequency, Hz | largest peak-to-peak, arcsec | at, rpm | at 1815 rpm |
| --- | --- | --- | --- | --- |
{remedies}

- **The error that drives the peak** is worth more than the one that leads at a crawl. The order names it: 78 the
  pin circle's ovality, 80 clearance in the cams' bearings.
- **Damping** halves a peak where it doubles, and does little beside it.
- **Stiffness** moves a frequency by half as many per cent only, and a peak may move into the range of work as well
  as out of it.
- **Inertia**: with a lighter arm orders 78 and 80 meet it beyond the largest speed, and higher, smaller orders are
  left.
- **Speed**: keep away from the peaks in long moves, or pass them quickly.

Passing quickly is `rverror.dynamics.run_up(model, ["0 s", "1 s"], ["0 rpm", "1815 rpm"])`. Run up in a second, the arm
passes orders 160, 80 and 78, and the vibration is {run_vibration} arcsec peak-to-peak where at constant speed it
grows to {still_vibration}. In turn the arm winds the train up by {run_windup} arcsec, and the output carries up to
{run_torque} N m.

<!-- picture: run-up -->

## A measured one: 51.5 Hz

A reducer of ratio 81 (pins on 111.5 mm, eccentricity 2 mm) was recorded at up to 1600 N m by Bilancia and others
(Robotics and Computer-Integrated Manufacturing 2025, 10.1016/j.rcim.2024.102838); its orders 156, 162 and 240 peak
where they drive at 51 to 52.5 Hz, with some 2 to 3 % of damping: one natural frequency, seen at three speeds
({speed_156}, {speed_162} and {speed_240} rpm for 51.5 Hz). What is it? Its windup was measured, 450 N m per arcmin;
default contacts make {default_81}, so all are scaled alike.

- The bare train has its first mode at {bare_81} Hz by the model. It is not the reducer alone: that would take
  contacts {softer} times softer than its windup shows.
- With the input held, a load of {load_81} kg m² has it ({load_81_low} for 52.5, {load_81_high} for 51 Hz): the
  brake or motor of the bench with its coupling.
- With the output held, an input that nothing holds has it with {input_81}e-3 kg m², the rotor of a servo motor:
  times $R^2$, and with the train's own cranks and planets, which turn 40 times as fast as the output, that is the
  same inertia.

Both make one frequency, and the frequency alone does not tell one from the other, nor from a share of each; neither
inertia is known of that bench. A run with another load inertia, or another gain of the input's control, would tell.
Cranks, pin radius and stiffness of that unit are guesses; scaled to the measured windup they matter little.

## How far to trust it

- Estimated inertia matters little where a load leads: the arm has {heavier} times the carrier's.
- Stiffness is known to a quarter, so frequencies and critical speeds to some 12 %: look for a peak in a range, not
  at a number.
- Damping is a guess until a run at several speeds tells it; heights of peaks are in inverse proportion to it.
- Contacts that open end the prediction; light loads and heavy arms are where they do.
"""


if __name__ == "__main__":
    print(markdown(), end="")
