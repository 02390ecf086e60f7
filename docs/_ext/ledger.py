r"""The ledger of the sources: what they print, what their formulas give, what rverror gives instead.

Every number of a row that is not printed in a source is computed here, from the formula that stands beside it or from
rverror's closed form; `markdown` writes the page ``docs/ledger.md``.  The four errors of source 000 come first: its own
formulas, taken with its own ratios and frames, beside the corrected figures.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from rverror.base.arrays import Array, radial_and_tangential
from rverror.base.units import ARCSEC
from rverror.geartrain.cycloid import initial_gap, loaded_share, pin_contacts, pin_positions
from rverror.geartrain.feedback import feedback_factor, loop_gain
from rverror.geartrain.kinematics import folded_order, frame_orders, fundamental_orders, samples_needed
from rverror.geartrain.mechanism import Reducer, reducer
from rverror.model.compose import influence
from rverror.model.effects import Model
from rverror.statics.friction import Friction, efficiency

#: Size of every error in source 000's case study, mm.
ERROR = 0.005
#: "Stage 2 ratio" that source 000 prints and divides by.
I2_PRINTED = 41.0
#: Peak-to-peak figures of source 000's case study, arcsec.
PRINTED_CASE = {"delta_11": 0.9, "delta_21": 8.2, "delta_31": 12.8, "delta_41": 30.5}


@dataclass(frozen=True)
class Figure:
    """A number with what it stands for and its unit."""

    label: str
    value: float
    unit: str = "arcsec"
    digits: int = 4

    def __str__(self) -> str:
        """Text of the figure, `digits` significant; what is below 1e-9 is rounding and reads 0."""
        value = 0.0 if abs(self.value) < 1e-9 else self.value
        number = f"{value:.{self.digits}g}"
        return " ".join(part for part in (self.label, number, self.unit) if part)


@dataclass(frozen=True, kw_only=True)
class Row:
    """One printed statement and its check.

    Attributes
    ----------
    key : str
        Name of the row.
    source : str
        First three digits of the source.
    statement : str
        What is printed, in our words.
    printed : tuple of Figure
        The printed numbers.
    formula : str
        The formula behind the computed numbers, LaTeX.
    computed : tuple of Figure
        What the formula gives.
    corrected : tuple of Figure
        What rverror gives instead; empty where there is nothing to correct or no influence behind it.
    verdict : str
        One line.
    """

    key: str
    source: str
    statement: str
    printed: tuple[Figure, ...]
    formula: str
    computed: tuple[Figure, ...]
    corrected: tuple[Figure, ...] = ()
    verdict: str


@functools.cache
def _rv40e() -> Reducer:
    return reducer("RV-40E")


@functools.cache
def _rv003() -> Reducer:
    return reducer("RV-003")


def _theta(unit: Reducer) -> Array:
    n = samples_needed(unit)
    return 2 * np.pi * np.arange(n) / n


def wave(unit: Reducer, key: str, parameter: str, size: float, *, direction: float = 1.0, **indices: Any) -> Array:
    """Output error over one turn that one parameter of one source makes, closed form, arcsec.

    Parameters
    ----------
    unit : Reducer
    key, parameter : str
        Source and its parameter.
    size : float
        mm or rad.
    direction : float, optional
        +1 forward, -1 reverse.
    **indices
        Indices of the source.

    Returns
    -------
    ndarray, shape (n,)
        n is `kinematics.samples_needed`.
    """
    columns = influence(unit, _theta(unit), key, direction=direction, **indices)
    return np.asarray(columns.matrix[columns.labels.index(parameter)] * size / ARCSEC)


def _mean(values: Array) -> float:
    return float(values.mean())


def _peak_to_peak(values: Array) -> float:
    return float(np.ptp(values))


def _amplitude(values: Array, order: float) -> float:
    """Amplitude of one whole order of a wave over one turn."""
    return float(2 * abs(np.fft.rfft(values)[round(order)]) / values.size)


# --- source 000: the four errors by its own formulas -------------------------------------------------------------


def bore_as_printed(unit: Reducer, error: float) -> Array:
    r"""Source 000's delta_41 over a turn, n14 . C06 delta / r6 with a tangential delta fixed in the carrier, rad.

    Both the action line and the error turn with theta_6, so nothing is left of the turn.
    """
    _, tangential = radial_and_tangential(_theta(unit))
    action_line = tangential
    return np.asarray((action_line * error * tangential).sum(axis=0) / unit.crank_radius)


def bore_fixed_in_housing(unit: Reducer, error: float) -> Array:
    """The same with the error held still in the housing, which no part of the carrier is, rad."""
    _, action_line = radial_and_tangential(_theta(unit))
    return np.asarray(action_line[1] * error / unit.crank_radius)


def cam_as_printed(unit: Reducer, error: tuple[float, float]) -> Array:
    """Source 000's delta_21 over a turn, n12 . C03 delta / (a i2), delta = (radial, tangential) on the cam, rad."""
    radial, tangential = radial_and_tangential(frame_orders(unit)["crank"] * _theta(unit))
    action_line = -tangential
    displacement = error[0] * radial + error[1] * tangential
    return np.asarray((action_line * displacement).sum(axis=0) / (unit.eccentricity * I2_PRINTED))


def center_distance_as_printed(unit: Reducer, error: float) -> Array:
    """Source 000's delta_11 over a turn with the error turning against its housing-fixed n11, rad."""
    alpha = unit.pressure_angle
    radial, _ = radial_and_tangential(frame_orders(unit)["planet"] * _theta(unit))
    action_line = np.array([[-math.cos(alpha)], [-math.sin(alpha)]])
    lever = unit.planet_pitch_radius * math.cos(alpha)
    return np.asarray((action_line * error * radial).sum(axis=0) / (lever * I2_PRINTED))


def _bore_row() -> Row:
    unit = _rv40e()
    as_printed = bore_as_printed(unit, ERROR) / ARCSEC
    in_housing = bore_fixed_in_housing(unit, ERROR) / ARCSEC
    one = wave(unit, "coupling.carrier_bore_position", "tangential", ERROR, crank=0)
    return Row(
        key="000 delta_41",
        source="000",
        statement="position error of the output bores: largest of the four, one cycle per turn",
        printed=(Figure("peak-to-peak", PRINTED_CASE["delta_41"]),),
        formula=r"$n_{14} \cdot C_{06}\,\delta_{41} / r_6$",
        computed=(
            Figure("peak-to-peak as printed, fixed in the carrier:", _peak_to_peak(as_printed)),
            Figure("constant", abs(_mean(as_printed))),
            Figure("peak-to-peak, were it fixed in the housing:", _peak_to_peak(in_housing)),
        ),
        corrected=(
            Figure("one bore, constant", _mean(one)),
            Figure("all bores, constant", _mean(one) * unit.cranks),
            Figure("peak-to-peak", _peak_to_peak(one)),
        ),
        verdict="not reproducible: error and action line turn together; order 1 does not come from this part",
    )


def _profile_row() -> Row:
    unit = _rv40e()
    a, K = unit.eccentricity, unit.short_width_coefficient
    first = wave(unit, "cycloid.disc_profile", "cos", ERROR, disc=0, harmonic=1)
    everywhere = wave(unit, "cycloid.pin_radius", "deviation", ERROR, pin="all")
    return Row(
        key="000 delta_31",
        source="000",
        statement="constant profile error of a disc along the normal, multi-cyclic",
        printed=(Figure("peak-to-peak", PRINTED_CASE["delta_31"]),),
        formula=r"at the longest arm: radial $e\sqrt{1-K^2}/(a z_p)$; normal $e/(a z_c)$; $K = a z_p/R_p$; "
        r"printed, the pressure angle stands in it twice",
        computed=(
            Figure("taken as radial", ERROR * math.sqrt(1 - K**2) / (a * unit.pins) / ARCSEC),
            Figure("normal, as it is said to be", ERROR / (a * unit.disc_lobes) / ARCSEC),
        ),
        corrected=(
            Figure("both discs, constant lead", _mean(everywhere)),
            Figure("its ripple of order 1560, peak-to-peak", _peak_to_peak(everywhere)),
            Figure(
                "one disc, first harmonic, order 40, amplitude", _amplitude(first, fundamental_orders(unit)["disc"])
            ),
        ),
        verdict="reproduced if the error acts as a radial one; a constant normal error shifts, it does not cycle",
    )


def _cam_row() -> Row:
    unit = _rv40e()
    radial, tangential = (cam_as_printed(unit, e) / ARCSEC for e in ((ERROR, 0.0), (0.0, ERROR)))
    one = wave(unit, "crank.eccentricity", "radial", ERROR, crank=0, disc=0)
    every = [
        wave(unit, "crank.eccentricity", "tangential", ERROR, crank=j, disc=k)
        for j in range(unit.cranks)
        for k in range(unit.discs)
    ]
    return Row(
        key="000 delta_21",
        source="000",
        statement="eccentricity error of the crank: one cycle per turn",
        printed=(Figure("peak-to-peak", PRINTED_CASE["delta_21"]),),
        formula=r"$n_{12} \cdot C_{03}\,\delta_{21} / (a\, i_2)$, $i_2 = 41$",
        computed=(
            Figure("radial, peak-to-peak", _peak_to_peak(radial)),
            Figure("radial, constant", abs(_mean(radial))),
            Figure("tangential, peak-to-peak", _peak_to_peak(tangential)),
            Figure("tangential, constant", abs(_mean(tangential))),
        ),
        corrected=(
            Figure("tangential at all cams, constant", _mean(np.sum(every, axis=0))),
            Figure("radial at one cam, order 40, amplitude", _amplitude(one, fundamental_orders(unit)["crank"])),
        ),
        verdict="not reproducible: the radial error projects to 0, the tangential one is constant; order 40, never 1",
    )


def _center_distance_row() -> Row:
    unit = _rv40e()
    alpha, r2 = unit.pressure_angle, unit.planet_pitch_radius
    one = wave(unit, "involute.center_distance", "radial", ERROR, crank=0)
    return Row(
        key="000 delta_11",
        source="000",
        statement="centre distance error of the involute stage, nearly constant",
        printed=(Figure("peak-to-peak", PRINTED_CASE["delta_11"]),),
        formula=r"radial, of either sign: $2 e \tan\alpha / (r_2\, i_2)$, $i_2 = 41$",
        computed=(
            Figure("", 2 * ERROR * math.tan(alpha) / (r2 * I2_PRINTED) / ARCSEC),
            Figure(
                "turning with the planet against the fixed $n_{11}$:",
                _peak_to_peak(center_distance_as_printed(unit, ERROR)) / ARCSEC,
            ),
        ),
        corrected=(
            Figure("one planet, constant", _mean(one)),
            Figure("all planets, constant", _mean(one) * unit.cranks),
        ),
        verdict="reproduced as the swing between the two signs; one error of one sign is constant",
    )


def _feedback_row() -> Row:
    unit = _rv40e()
    one_step = (1 + unit.sun_teeth / unit.planet_teeth) / I2_PRINTED
    total = sum(PRINTED_CASE.values())
    return Row(
        key="000 feedback",
        source="000",
        statement="feedback through the carrier adds a little to the total",
        printed=(Figure("from", 1.0), Figure("to", 2.0)),
        formula=r"one step: $(1 + z_1/z_2)/41$ of the error; exact: "
        r"$1/(1 + (1 + z_1/z_2)/z_c) = z_c (z_2/z_1)/R$ times the error",
        computed=(
            Figure("of the largest printed error", one_step * max(PRINTED_CASE.values())),
            Figure("of the sum of the four", one_step * total),
        ),
        corrected=(
            Figure("loop gain", loop_gain(unit), ""),
            Figure("factor", feedback_factor(unit), ""),
            Figure(
                "change of the three that it acts on", (feedback_factor(unit) - 1) * (total - PRINTED_CASE["delta_41"])
            ),
        ),
        verdict="size reproduced, sign wrong: the loop takes away; it has no last step and spares carrier bores",
    )


def _ratio_row() -> Row:
    unit = _rv40e()
    turns = frame_orders(unit)
    i1, i2 = 1 + unit.planet_teeth / unit.sun_teeth, float(unit.pins - unit.disc_lobes)
    return Row(
        key="000 ratios",
        source="000",
        statement="ratios of the stages and of the whole",
        printed=(Figure("$i_1$", 4, ""), Figure("$i_2$", 41, ""), Figure("$i$", 164, "")),
        formula=r"as printed: $i_1 = 1 + N_r/N_s$ with the planet for the ring, $i_2 = N_p - N_c$; "
        r"right: $R = 1 + (z_2/z_1)\, z_p/(z_p - z_c)$",
        computed=(Figure("$i_1$", i1, ""), Figure("$i_2$", i2, ""), Figure("$i$", i1 * i2, "")),
        corrected=(
            Figure("$R$", unit.ratio, ""),
            Figure("crank in the housing", turns["crank"], "turns"),
            Figure("crank in the carrier", turns["crank"] - turns["carrier"], "turns"),
        ),
        verdict="the three printed ratios contradict the formulas and the test of 004; 121 is right",
    )


def _peak_row() -> Row:
    unit = _rv40e()
    orders, per_degree, last_digit = fundamental_orders(unit), 0.108, 0.0005
    return Row(
        key="000 spectral peak",
        source="000",
        statement="second peak of the measured spectrum, ascribed to disc lobes and pins",
        printed=(Figure("", per_degree, "cycles/deg"), Figure("period", 9.26, "deg")),
        formula=r"order $= 360 f$",
        computed=(
            Figure("order", 360 * per_degree, ""),
            Figure("from the period", 360 / 9.26, ""),
            Figure("at least", 360 * (per_degree - last_digit), ""),
            Figure("at most", 360 * (per_degree + last_digit), ""),
        ),
        corrected=(
            Figure("housing", orders["housing"], ""),
            Figure("disc, crank, planet", orders["disc"], ""),
        ),
        verdict="pins (39), not discs (40): the frame decides; two equal discs in antiphase would cancel 39",
    )


# --- source 001 --------------------------------------------------------------------------------------------------


def _degrees_of_freedom_row() -> Row:
    cranks, discs = 3, 2
    return Row(
        key="001 degrees of freedom",
        source="001",
        statement="size of the static model",
        printed=(Figure("", 20, ""),),
        formula=r"three each for carrier, discs and cranks, two for the sun: $3(1 + n_{discs} + n_{cranks}) + 2$",
        computed=(Figure("two discs, three cranks", 3 * (1 + discs + cranks) + 2, ""),),
        corrected=(Figure("RV-40E, two cranks", 3 * (1 + _rv40e().discs + _rv40e().cranks) + 2, ""),),
        verdict="reproduced",
    )


def _phase_row() -> Row:
    unit = _rv40e()
    first, second = (wave(unit, "cycloid.disc_pitch", "cos", ERROR, disc=k, harmonic=1) for k in range(2))
    order = fundamental_orders(unit)["disc"]
    return Row(
        key="001 phase of the discs",
        source="001",
        statement="cumulative pitch errors of two discs: opposed they add, in phase they lessen each other",
        printed=(),
        formula=r"first harmonic $e$ on each disc: the difference of the two discs' waves",
        computed=(),
        corrected=(
            Figure("one disc, order 40, amplitude", _amplitude(first, order)),
            Figure("in phase", _amplitude(first + second, order)),
            Figure("opposed", _amplitude(first - second, order)),
        ),
        verdict="reproduced: for odd harmonics equal discs cancel while all loaded pins stay loaded",
    )


# --- source 002: gap and displacement along the common normal ------------------------------------------------------


def _radicand(unit: Reducer, phi: Array) -> Array:
    K = unit.short_width_coefficient
    return np.asarray(1 + K**2 - 2 * K * np.cos(phi))


def initial_gap_as_printed(unit: Reducer, phi: Array, *, equidistant: float, shift: float) -> Array:
    """Source 002's initial gap as it stands, times r_p, with the K that it should have, mm."""
    K, S = unit.short_width_coefficient, _radicand(unit, phi)
    return np.asarray(-equidistant * (1 - K * np.sin(phi)) / S + shift * (1 - K * np.cos(phi)) / S)


def _gap_row() -> Row:
    unit = _rv40e()
    K = unit.short_width_coefficient
    contact, quarter = np.array([math.acos(K)]), np.array([math.pi / 2])
    um = 1e3
    return Row(
        key="002 initial gap",
        source="002",
        statement="initial gap along the common normal of a modified profile",
        printed=(),
        formula=r"printed: $-\Delta r_{rp}(1 - K\sin\varphi)/S + \Delta r_p(1 - K\cos\varphi)/S$ over $r_p$; right: "
        r"$\Delta r_{rp}\bigl(1 - \sin\varphi/\sqrt S\bigr) + \Delta r_p\bigl(1 - K\cos\varphi - "
        r"\sqrt{1-K^2}\sin\varphi\bigr)/\sqrt S$; $S = 1 + K^2 - 2K\cos\varphi$",
        computed=(
            Figure(
                "5 um equidistant, at the first contact",
                float(initial_gap_as_printed(unit, contact, equidistant=ERROR, shift=0)[0]) * um,
                "um",
            ),
            Figure("at 90 deg", float(initial_gap_as_printed(unit, quarter, equidistant=ERROR, shift=0)[0]) * um, "um"),
            Figure(
                "$K$ printed, pin circle over tip circle:",
                unit.pin_circle_radius / (unit.pin_circle_radius - unit.pin_radius + unit.eccentricity),
                "",
            ),
        ),
        corrected=(
            Figure("at the first contact", float(initial_gap(unit, contact, equidistant=ERROR, shift=0)[0]) * um, "um"),
            Figure("at 90 deg", float(initial_gap(unit, quarter, equidistant=ERROR, shift=0)[0]) * um, "um"),
            Figure("$K = a z_p/R_p$:", K, ""),
        ),
        verdict="corrected: square roots lost, $K$ mis-defined (printed it exceeds 1), dimension of an angle; holds "
        r"while $\Delta r_{rp}\sqrt{1-K^2} + \Delta r_p \ge 0$, else first contact moves off the longest arm",
    )


def _displacement_row() -> Row:
    unit = _rv40e()
    K = unit.short_width_coefficient
    eccentric = np.linspace(0, 2 * np.pi / unit.pins, 16)
    arm = pin_contacts(unit, eccentric=eccentric[None], disc_angle=np.zeros_like(eccentric)).arm[0]
    phi = eccentric - pin_positions(unit)[:, None]
    longest = unit.eccentricity * unit.disc_lobes
    contact = np.array([math.acos(K)])
    return Row(
        key="002 loaded displacement",
        source="002",
        statement="displacement along the normal of contact $i$ when the disc is loaded, as a share of the largest",
        printed=(),
        formula=r"printed: $\sin\varphi/S$; right: $\sin\varphi/\sqrt S = l_i/(a z_c)$, $S = 1 + K^2 - 2K\cos\varphi$",
        computed=(
            Figure("printed, share at the longest arm", float((np.sin(contact) / _radicand(unit, contact)).item()), ""),
        ),
        corrected=(
            Figure("share at the longest arm", float(loaded_share(unit, contact).item()), ""),
            Figure(
                r"largest $\lvert\sin\varphi/\sqrt S - l_i/(a z_c)\rvert$:",
                float(np.abs(loaded_share(unit, phi) - arm / longest).max()),
                "",
            ),
        ),
        verdict="corrected: square root lost; with it, it is the arm of the contact normal over the longest arm",
    )


# --- source 003 --------------------------------------------------------------------------------------------------


def _lost_motion(key: str, parameter: str, **indices: Any) -> float:
    """Lag forward less lag in reverse per mm of one parameter in 003's unit, arcsec/mm."""
    forward, reverse = (wave(_rv003(), key, parameter, 1.0, direction=d, **indices) for d in (1.0, -1.0))
    return abs(_mean(forward - reverse))


def _spline_row() -> Row:
    unit = _rv003()
    assert unit.spline_radius is not None  # the preset has one
    lost = [_lost_motion("involute.spline_clearance", "clearance", crank=j) for j in range(unit.cranks)]
    return Row(
        key="003 spline clearance",
        source="003",
        statement="slope of the error over the spline's clearance; table: 45 to 80 arcsec over 0.046 to 0.097 mm",
        printed=(Figure("said", 500, "arcsec/mm"), Figure("table", (80 - 45) / (0.097 - 0.046), "arcsec/mm")),
        formula=r"$(1/r_s)(z_2/z_1)/R$, $r_s = 7$ mm",
        computed=(
            Figure(
                "",
                1 / unit.spline_radius * (unit.planet_teeth / unit.sun_teeth) / unit.ratio / ARCSEC,
                "arcsec/mm",
            ),
        ),
        corrected=(Figure("lost motion, all cranks", sum(lost), "arcsec/mm"),),
        verdict="the table is reproduced within 6 %; the 500 of the text is not the table's slope",
    )


def _wear_row() -> Row:
    unit = _rv003()
    return Row(
        key="003 sun wear",
        source="003",
        statement="error over the wear of the sun up to 0.06 mm: 42.6 to 52.0 arcsec",
        printed=(Figure("", (52.0 - 42.6) / 0.06, "arcsec/mm"),),
        formula=r"$1/(r_1 R)$, $r_1 = 12$ mm",
        computed=(Figure("", 1 / (unit.sun_pitch_radius * unit.ratio) / ARCSEC, "arcsec/mm"),),
        corrected=(
            Figure("lost motion", _lost_motion("involute.tooth_thinning", "thinning", member="sun"), "arcsec/mm"),
        ),
        verdict="reproduced within 8 %; the steep rise beyond 0.06 mm is not of this kind",
    )


def _planet_wear_row() -> Row:
    unit = _rv003()
    return Row(
        key="003 planet wear",
        source="003",
        statement="error over the wear of all planets up to 0.025 mm: 42.6 to 50.1 arcsec",
        printed=(Figure("", (50.1 - 42.6) / 0.025, "arcsec/mm"),),
        formula=r"$1/(r_1 R)$: a mesh does not know which of its flanks is thinner",
        computed=(Figure("", 1 / (unit.sun_pitch_radius * unit.ratio) / ARCSEC, "arcsec/mm"),),
        corrected=(
            Figure("lost motion", _lost_motion("involute.tooth_thinning", "thinning", member="planet"), "arcsec/mm"),
        ),
        verdict="not reproduced: nearly twice the sun's slope, where both must be equal",
    )


def _friction_row() -> Row:
    unit = _rv003()
    losses = efficiency(
        Model(unit),
        _theta(unit)[:1],
        torque=1e3,
        friction=Friction(pin=0.05, mesh=0.05),
        direction=1.0,
        method="closed",
    )
    return Row(
        key="003 friction",
        source="003",
        statement="error over a friction of 0.01 to 0.05: between 30 and 60 arcsec; and a law for it",
        printed=(Figure("from", 30), Figure("to", 60), Figure("at no friction", 50), Figure("slope", -200)),
        formula=r"$T_{e0} - \alpha f$",
        computed=(Figure("at 0.01", 50 - 200 * 0.01), Figure("at 0.05", 50 - 200 * 0.05)),
        corrected=(Figure("pins and flanks take at 0.05, closed form", 100 * (1 - losses.mean), "%", 2),),
        verdict="law and text disagree: 8 arcsec of change in a span of 30. In the equilibrium the sign depends on the "
        "errors: [published numbers](published.md#003-friction)",
    )


def _mean_ratio_row() -> Row:
    unit = _rv003()
    mean, speed = 100.593, 1800.0
    return Row(
        key="003 mean ratio",
        source="003",
        statement="mean ratio of the simulation and its error; output speed at 1800 rpm",
        printed=(Figure("ratio", mean, "", 6), Figure("error", 0.05, "%"), Figure("speed", 17.81, "rpm")),
        formula=r"$(R - i')/R$",
        computed=(
            Figure("error", (unit.ratio - mean) / unit.ratio * 100, "%"),
            Figure("speed from the mean ratio", speed / mean, "rpm"),
            Figure("ratio from the printed speed", speed / 17.81, "", 5),
        ),
        corrected=(Figure("speed", speed / unit.ratio, "rpm"),),
        verdict="misprint: 0.40 %, and the printed speed belongs to another ratio",
    )


# --- source 004 --------------------------------------------------------------------------------------------------


def _pin_radius_row() -> Row:
    unit = _rv40e()
    K = unit.short_width_coefficient
    printed = unit.disc_lobes / (unit.pins - unit.disc_lobes) * ERROR / unit.pin_circle_radius / ARCSEC
    one_contact = ERROR * math.sqrt(1 - K**2) / (unit.eccentricity * unit.pins) / ARCSEC
    one = wave(unit, "cycloid.pin_position", "radial", ERROR, pin=0)
    ring = wave(unit, "cycloid.pin_circle", "radial_cos", ERROR, harmonic=0)
    return Row(
        key="004 pin position",
        source="004",
        statement="error from a pin off its circle by 5 um",
        printed=(),
        formula=r"$\frac{z_c}{z_p - z_c}\,\delta r_p/r_p$; at the longest arm a radial pin error gives "
        r"$e\sqrt{1-K^2}/(a z_p)$",
        computed=(
            Figure("printed", printed),
            Figure("one contact alone", one_contact),
            Figure("too large by the factor", printed / one_contact, ""),
        ),
        corrected=(
            Figure("one pin among the loaded ones, peak-to-peak", _peak_to_peak(one)),
            Figure("all pins, constant", _mean(ring)),
        ),
        verdict="wrong by a factor of about 50 even for a single contact",
    )


def _sun_row() -> Row:
    unit, e = _rv40e(), 0.010
    waves = [wave(unit, "involute.sun_eccentricity", p, e) for p in ("x", "y")]
    return Row(
        key="004 sun eccentricity",
        source="004",
        statement="error from a sun that is eccentric by 10 um",
        printed=(),
        formula=r"$\frac{Z_r}{Z_s}\,e_s/r_s$ with the pins for the ring gear",
        computed=(Figure("", unit.pins / unit.sun_teeth * e / unit.sun_pitch_radius / ARCSEC),),
        corrected=(Figure("floating sun, peak-to-peak", max(_peak_to_peak(w) for w in waves)),),
        verdict="wrong: there is no ring gear, and a floating sun between evenly spaced planets gives way",
    )


def _maximum_row() -> Row:
    low, high, measured = -0.0089, 0.0093, 56.33
    peak_to_peak, largest = (high - low) * 60, max(-low, high) * 60
    return Row(
        key="004 maximum",
        source="004",
        statement="maximum of the simulated error, -0.0089 to 0.0093 deg; its difference from the measured maximum",
        printed=(Figure("maximum", 1.092, "arcmin"), Figure("difference", 0.13, "arcmin")),
        formula=r"peak-to-peak $= \max - \min$; maximum $= \max\lvert\Delta\rvert$",
        computed=(
            Figure("peak-to-peak", peak_to_peak, "arcmin"),
            Figure("maximum", largest, "arcmin"),
            Figure("1.092 less the measured 56.33 arcsec:", peak_to_peak - measured / 60, "arcmin"),
        ),
        verdict="definitions mixed: the figure is peak-to-peak; the difference is 0.15",
    )


def _sampling_row() -> Row:
    unit = _rv40e()
    orders = fundamental_orders(unit)
    return Row(
        key="004 sampling",
        source="004",
        statement="points per output turn of the test",
        printed=(Figure("", 1000, "points"),),
        formula=r"order $k$ at $N$ points appears at $\lvert k - N\,\mathrm{round}(k/N)\rvert$",
        computed=(
            Figure("gear mesh 1080 appears at", folded_order(orders["gear mesh"], 1000), ""),
            Figure("cycloid mesh 1560 appears at", folded_order(orders["cycloid mesh"], 1000), ""),
        ),
        corrected=(Figure("points needed", samples_needed(unit), ""),),
        verdict="warn: the gear mesh falls on the second harmonic of every disc and crank error",
    )


def _formula_ratio_row() -> Row:
    unit = _rv40e()
    i_p, i_c = 1 + unit.pins / unit.sun_teeth, unit.pins / (unit.pins - unit.disc_lobes)
    return Row(
        key="004 ratio",
        source="004",
        statement="ratio of the tested unit, and the input speed of the simulation for 15 rpm at the output",
        printed=(Figure("ratio", 121, ""), Figure("input", 10890, "deg/s", 5)),
        formula=r"printed: $(1 + Z_r/Z_s)\, Z_p/(Z_p - Z_c)$ with the pins for the ring; right: "
        r"$R = 1 + (z_2/z_1)\, z_p/(z_p - z_c)$",
        computed=(Figure("printed formula", i_p * i_c, ""), Figure("from the speeds", 10890 / (15 * 6), "")),
        corrected=(Figure("$R$", unit.ratio, ""),),
        verdict="the figures are right, the formula is not",
    )


def table() -> tuple[Row, ...]:
    """Every row of the ledger, sources in order.

    Returns
    -------
    tuple of Row

    Examples
    --------
    >>> rows = {row.key: row for row in table()}
    >>> str(rows["000 delta_11"].computed[0])
    '0.9042 arcsec'
    """
    return (
        _bore_row(),
        _profile_row(),
        _cam_row(),
        _center_distance_row(),
        _feedback_row(),
        _ratio_row(),
        _peak_row(),
        _degrees_of_freedom_row(),
        _phase_row(),
        _gap_row(),
        _displacement_row(),
        _spline_row(),
        _wear_row(),
        _planet_wear_row(),
        _friction_row(),
        _mean_ratio_row(),
        _pin_radius_row(),
        _sun_row(),
        _maximum_row(),
        _sampling_row(),
        _formula_ratio_row(),
    )


_HEAD = """# Ledger of the sources

What the five source texts print, what their own formulas give, and what rverror gives instead. Numbers that no source
prints are computed by `docs/_ext/ledger.py`; this page is its output (`python docs/_ext/ledger.py`) and a test compares
the two. What the texts are: [bibliography](bibliography.md). Figures are for the RV-40E and errors of 5 um unless a row
says otherwise; "constant" is a shift of the output that does not change over the turn, positive where the output leads.

A figure "as printed" takes the source's own formula, frame and ratio. One of rverror is the closed form: rigid
bearings, equal contact stiffness, forward motion under load.
"""

_KEYS_OF_000 = ("000 delta_41", "000 delta_31", "000 delta_21", "000 delta_11")


def markdown() -> str:
    """Text of the page ``docs/ledger.md``.

    Returns
    -------
    str
        Markdown, one line break at the end.
    """
    rows = {row.key: row for row in table()}
    parts = [_HEAD, "## The case study of source 000\n", _case_study([rows[key] for key in _KEYS_OF_000])]
    parts.append("## Every statement\n")
    lines = [_line("source", "printed", "formula", "what it gives", "rverror", "verdict"), _line(*["---"] * 6)]
    lines += [
        _line(
            row.source,
            row.statement + (": " + _list(row.printed) if row.printed else ""),
            row.formula,
            _list(row.computed),
            _list(row.corrected),
            row.verdict,
        )
        for row in rows.values()
    ]
    parts.append("\n".join(lines) + "\n")
    return "\n".join(parts)


def _case_study(rows: list[Row]) -> str:
    lines = [_line("error, 5 um", "printed", "its formula", "rverror"), _line(*["---"] * 4)]
    for row in rows:
        symbol = row.key.partition(" ")[2].replace("delta_", r"$\delta_{") + "}$"
        lines.append(_line(symbol, _list(row.printed), _list(row.computed), _list(row.corrected)))
    return "\n".join(lines) + "\n"


def _list(figures: tuple[Figure, ...]) -> str:
    return "; ".join(map(str, figures)) or "-"


def _line(*cells: str) -> str:
    return "| " + " | ".join(cells) + " |"


if __name__ == "__main__":
    print(markdown(), end="")
