r"""The ledger of the sources: what they print, what their formulas give, what rverror gives instead.

Every number of a row that is not printed in a source is computed here, from the formula that stands beside it or from
rverror's closed form; `markdown` writes the page ``docs/ledger.md``.  The four errors of source 000 come first: its own
formulas, taken with its own ratios and frames, beside the corrected figures.  What of the sources is in no row here
stands in `source_items`.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from rverror.base.arrays import Array, radial_and_tangential
from rverror.base.units import ARCSEC
from rverror.geartrain.contacts import closed_form_forces, pose
from rverror.geartrain.cycloid import (
    loaded_share,
    normal_gap,
    pin_contacts,
    pin_positions,
    profile,
)
from rverror.geartrain.feedback import feedback_factor, loop_gain
from rverror.geartrain.kinematics import folded_order, frame_orders, fundamental_orders, samples_needed, true_period
from rverror.geartrain.mechanism import Friction, Reducer, reducer
from rverror.model.compose import influence
from rverror.model.effects import Model
from rverror.statics.friction import efficiency, path_of_contact
from rverror.statics.worn_contacts import WearCoefficients, wear

#: Size of every error in source 000's case study, mm.
ERROR = 0.005
#: "Stage 2 ratio" that source 000 prints and divides by.
I2_PRINTED = 41.0
#: Peak-to-peak figures of source 000's case study, arcsec.
PRINTED_CASE = {"delta_11": 0.9, "delta_21": 8.2, "delta_31": 12.8, "delta_41": 30.5}
#: What a verdict begins with; `out of scope` is for `source_items` alone.
VERDICTS = ("reproduced", "corrected", "not reproducible")


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
        One line, which begins with one of `VERDICTS`.
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


def _peaks(values: Array) -> int:
    """Local maxima over one turn."""
    return int(((values > np.roll(values, 1)) & (values >= np.roll(values, -1))).sum())


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


def profile_as_printed(unit: Reducer, error: float) -> float:
    r"""Source 000's delta_31 of a normal error where the arm is longest, (1 / (n13 . n23)) e / (r cos(alpha_3)), rad.

    The arm of the normal is r cos(alpha_3), and n13 . n23 is cos(alpha_3) once more: e r / (a z_c)^2.
    """
    longest = math.acos(unit.short_width_coefficient)
    normal, arms, _ = pin_contacts(unit, np.array([[longest]]))
    pin, _ = radial_and_tangential(pin_positions(unit)[:1])
    centre, _ = radial_and_tangential(np.array([longest]))
    contact = unit.pin_circle_radius * pin + unit.pin_radius * normal[0, 0] - unit.eccentricity * centre
    radius, arm = float(np.hypot(*contact)[0]), float(arms[0, 0, 0])
    return error * radius / arm**2


def feedback_as_printed(unit: Reducer) -> Array:
    """Source 000's feedback over a turn as a share of the total, n11 . C06 (r1 + r2) [0, 1] / (r2 cos(alpha) i2).

    The action line stands still in the housing while the vector turns with the carrier.
    """
    alpha, r2 = unit.pressure_angle, unit.planet_pitch_radius
    _, tangential = radial_and_tangential(_theta(unit))
    action_line = np.array([[-math.cos(alpha)], [-math.sin(alpha)]])
    vector = (unit.sun_pitch_radius + r2) * tangential
    return np.asarray((action_line * vector).sum(axis=0) / (r2 * math.cos(alpha) * I2_PRINTED))


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
        formula=r"at the longest arm: printed $e\,r/(a z_c)^2$, the pressure angle in it twice; normal $e/(a z_c)$; "
        r"radial $e\sqrt{1-K^2}/(a z_p)$; $K = a z_p/R_p$",
        computed=(
            Figure("as printed", profile_as_printed(unit, ERROR) / ARCSEC),
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
        verdict="not reproducible: neither the printed formula nor the right one for a normal error gives it; 12.88 is "
        "that of a radial error, another formula. A constant normal error shifts, it does not cycle",
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
        verdict="reproduced as the swing between the two signs along the line of centres; one error of one sign is "
        "constant, and in the planet's frame, as printed, it would swing three times as far",
    )


def _feedback_row() -> Row:
    unit = _rv40e()
    one_step = (1 + unit.sun_teeth / unit.planet_teeth) / I2_PRINTED
    total = sum(PRINTED_CASE.values())
    share = _amplitude(feedback_as_printed(unit), 1)
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
            Figure("as printed, a sine once a turn, share of the total", share, ""),
            Figure("amplitude", share * max(PRINTED_CASE.values())),
            Figure("to", share * total),
        ),
        corrected=(
            Figure("loop gain", loop_gain(unit), ""),
            Figure("factor", feedback_factor(unit), ""),
            Figure(
                "change of the three that it acts on", (feedback_factor(unit) - 1) * (total - PRINTED_CASE["delta_41"])
            ),
        ),
        verdict="corrected: the size is met, as a sine whose action line stands still while the carrier turns; it "
        "turns along, so the loop takes a constant share away, has no last step and spares carrier bores",
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
        verdict="corrected: the three printed ratios contradict the formulas and the test of 004; 121 is right",
    )


def _disc_rotation_row() -> Row:
    unit = _rv40e()
    turns = frame_orders(unit)
    return Row(
        key="000 disc rotation",
        source="000",
        statement="turn of the disc for a turn of the crank",
        printed=(),
        formula=r"printed: $-1/(N_p - N_c)$; right: $-(z_p - z_c)/z_c$, both in the housing",
        computed=(Figure("", -1 / (unit.pins - unit.disc_lobes), ""),),
        corrected=(Figure("", turns["disc"] / turns["crank"], ""),),
        verdict="corrected: $z_c$ lost; as printed disc and crank would turn equally fast",
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
        verdict="corrected: pins (39), not discs (40): the frame decides; two equal discs in antiphase would cancel 39",
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


def _profile_001_row() -> Row:
    unit = _rv40e()
    R, r, e, turn = unit.pin_circle_radius, unit.pin_radius, unit.eccentricity, 2 * np.pi * np.arange(20000) / 20000
    x, y = ((R + r) * f(turn) - e * f((unit.pins + 1) * turn) for f in (np.cos, np.sin))
    printed, right = np.hypot(x, y), np.hypot(*profile(unit, unit.disc_lobes * turn))
    return Row(
        key="001 profile",
        source="001",
        statement="profile of a disc",
        printed=(),
        formula=r"printed: $(R_c + r)(\cos\phi, \sin\phi) - e(\cos, \sin)(Z_p + 1)\phi$; right: the offset by the pin "
        r"radius of $R_p(\cos\phi, \sin\phi) - a(\cos, \sin)(z_p \phi)$, to its inside",
        computed=(
            Figure("radii from", float(printed.min()), "mm"),
            Figure("to", float(printed.max()), "mm"),
            Figure("lobes", float(_peaks(printed)), ""),
        ),
        corrected=(
            Figure("radii from", float(right.min()), "mm"),
            Figure("to", float(right.max()), "mm"),
            Figure("lobes", float(_peaks(right)), ""),
        ),
        verdict="corrected: a disc larger than its pin circle with one lobe too many; the pin radius is taken off "
        "along the normal, not added to the radius",
    )


def _fourier_row() -> Row:
    unit = _rv40e()
    orders = fundamental_orders(unit)
    return Row(
        key="001 Fourier series",
        source="001",
        statement="the error as a series of harmonics of one turn of the input",
        printed=(),
        formula=r"waves per input turn: order over $R$",
        computed=(
            Figure("pins", orders["housing"] / unit.ratio, ""),
            Figure("disc, crank, planet", orders["disc"] / unit.ratio, ""),
        ),
        corrected=(Figure("period", true_period(unit), "turn of the output"),),
        verdict="corrected: most errors do not repeat with the input; the period is that of the output, and several "
        "turns of it where the ratio is not whole",
    )


# --- source 002: gap and displacement along the common normal ------------------------------------------------------


def _radicand(unit: Reducer, phi: Array) -> Array:
    K = unit.short_width_coefficient
    return np.asarray(1 + K**2 - 2 * K * np.cos(phi))


def initial_gap(reducer: Reducer, roll_angle: Array, *, equidistant: float, shift: float) -> Array:
    r"""Gap that is left along the common normal once a modified disc has turned to its first contact.

    The disc, its centre held, stays behind a forward motion by the angle h / (a z_c); that closes h s(phi), s from
    `loaded_share`, of the gap of `normal_gap`.  With x = (1 - K cos(phi)) / sin(phi) the gap over s is

        h(x) = equidistant sqrt(x^2 + K^2) + shift x,    x >= sqrt(1 - K^2),

    whose least value is taken

    - at the longest arm, cos(phi) = K, while equidistant sqrt(1 - K^2) + shift >= 0:
      h = equidistant + shift sqrt(1 - K^2);
    - else, where material is ground off along the normal and more than sqrt(1 - K^2) of it put back by the shift, on
      both sides of it: h = K sqrt(equidistant^2 - shift^2).

    Parameters
    ----------
    reducer : Reducer
    roll_angle : ndarray, shape (n,)
        Angle phi by which the eccentric direction leads the pin, rad; pins that drive have 0 < phi < pi.
    equidistant, shift : float
        As in `normal_gap`, mm; together 0 or more.

    Returns
    -------
    ndarray, shape (n,)
        mm; 0 at the first contact.

    Raises
    ------
    ValueError
        If the modifications together add material: at a lobe's root and tip no turn makes room for it.

    Notes
    -----
    Source 002, which loses the square roots, takes K for the ratio of two radii and prints an angle.  Its formula, put
    right, is the first case:

        equidistant (1 - s) + shift (1 - K cos(phi) - sqrt(1 - K^2) sin(phi)) / sqrt(S).

    It is of first order in the modification, and stands for a pin at the best place; the pins of a real disc stand a
    pitch apart.
    """
    if equidistant + shift < 0:
        raise ValueError(
            f"equidistant = {equidistant:g} mm, shift = {shift:g} mm: together they must be 0 or more, or the disc is "
            "too large for its pins at root and tip"
        )
    K = reducer.short_width_coefficient
    across = math.sqrt(1 - K**2)
    if equidistant * across + shift >= 0:
        turned = equidistant + shift * across
    else:
        turned = K * math.sqrt(equidistant**2 - shift**2)
    gap = normal_gap(reducer, roll_angle, equidistant=equidistant, shift=shift)
    return np.asarray(gap - turned * loaded_share(reducer, roll_angle))


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
    arm = pin_contacts(unit, eccentric[None])[1][0]
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


def _projection_row() -> Row:
    unit, um = _rv40e(), 1e3
    longest = math.acos(unit.short_width_coefficient)
    normal = pin_contacts(unit, np.array([[longest]]))[0][0, 0, :, 0]
    # pin 0 on +x; direction from the disc's centre to it
    to_pin = np.array([unit.pin_circle_radius, 0]) - unit.eccentricity * np.array(
        [math.cos(longest), math.sin(longest)]
    )
    printed = np.abs(to_pin) / np.hypot(*to_pin)
    return Row(
        key="002 projections",
        source="002",
        statement="errors of 5 um of a pin, radial and tangential, along the meshing line; those of a disc alike",
        printed=(),
        formula=r"$E_R \cos(\alpha - \varphi_R)$, $E_{AR} \sin(\alpha - \varphi_R)$, $\alpha$ printed as the direction "
        r"from the disc's centre to the pin; right: that of the normal, at the longest arm $\sqrt{1 - K^2}$ and $K$",
        computed=(
            Figure("radial", ERROR * float(printed[0]) * um, "um"),
            Figure("tangential", ERROR * float(printed[1]) * um, "um"),
        ),
        corrected=(
            Figure("radial", ERROR * float(abs(normal[0])) * um, "um"),
            Figure("tangential", ERROR * float(abs(normal[1])) * um, "um"),
        ),
        verdict="corrected: with the printed angle tangential errors, which count most where the load is, all but "
        "vanish",
    )


def _modification_row() -> Row:
    unit, um = _rv40e(), 1e3
    longest = np.array([math.acos(unit.short_width_coefficient)])
    along = math.sqrt(1 - unit.short_width_coefficient**2)
    opened = [float(normal_gap(unit, longest, equidistant=e, shift=s)[0]) for e, s in ((ERROR, 0.0), (0.0, ERROR))]
    return Row(
        key="002 modification",
        source="002",
        statement="equidistant and shift modification of 5 um as displacements along the meshing line",
        printed=(),
        formula=r"$\Delta r_{rp} \cos\tau$, $\Delta r_p \cos\tau$; $\cos\tau = (1 - K\cos\varphi)/\sqrt S$ is the "
        r"normal's share towards the centre; right: $\Delta r_{rp}$, $\Delta r_p \cos\tau$",
        computed=(
            Figure("at the longest arm, equidistant", ERROR * along * um, "um"),
            Figure("shift", ERROR * along * um, "um"),
        ),
        corrected=(Figure("equidistant", opened[0] * um, "um"), Figure("shift", opened[1] * um, "um")),
        verdict="corrected: an equidistant lies along the normal everywhere, nothing of it is lost; the shift is right",
    )


def _equal_forces_row() -> Row:
    unit = _rv40e()
    force = np.hypot(*np.moveaxis(closed_form_forces(pose(unit, _theta(unit), direction=1.0))["pin"][0], 1, 0))
    return Row(
        key="002 meshing forces",
        source="002",
        statement="meshing forces as a sum over the closed contacts, all of one size",
        printed=(),
        formula=r"printed: $F_0 \sum (\cos, \sin)(\omega t + \varphi_i)\,H(\delta_i - \Delta\varphi_i)$; right: each "
        r"force along its normal, in proportion to $\delta_i - \Delta\varphi_i$, without gaps to $l_i$",
        computed=(Figure("largest over mean of the closed contacts", 1, ""),),
        corrected=(
            Figure("largest over mean of the closed contacts", float(force.max() / force[force > 0].mean()), ""),
        ),
        verdict="corrected: neither sizes nor directions of the forces are those of a cycloid mesh; no force is "
        "printed",
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
        verdict="reproduced within 6 %, the table; the 500 of the text is not the table's slope",
    )


def _profile_003_row() -> Row:
    unit = _rv003()
    R, e, z, turn = unit.pin_circle_radius, unit.eccentricity, unit.pins, 2 * np.pi * np.arange(20000) / 20000
    x, y = (R * (f(turn) - e * f(z * turn)) for f in (np.sin, np.cos))
    printed = np.hypot(x, y)
    right = np.hypot(*(R * f(turn) - e * f(z * turn) for f in (np.sin, np.cos)))
    return Row(
        key="003 profile",
        source="003",
        statement="profile of a disc with the eccentricity, 1.3, for its $e$: the curve of the pin centres",
        printed=(),
        formula=r"printed: $R_z[\sin\phi - e\sin(z_b\phi)]$; right: $R_z\sin\phi - a\sin(z_b\phi)$, that is "
        r"$e = a/R_z$; cosine alike",
        computed=(
            Figure("radii from", float(printed.min()), "mm"),
            Figure("to", float(printed.max()), "mm", 5),
        ),
        corrected=(
            Figure("radii from", float(right.min()), "mm"),
            Figure("to", float(right.max()), "mm"),
        ),
        verdict="corrected: $e$ is no length where it stands, and the pin radius must come off along the normal, which "
        r"$+r_z(\cos\tau, \sin\tau)$ with an undefined $\tau$ does not say",
    )


def _tooth_share_row() -> Row:
    unit = _rv003()
    return Row(
        key="003 sun tooth",
        source="003",
        statement="wear of 0.14 mm as a share of the sun's tooth thickness",
        printed=(Figure("up to", 4, "%"),),
        formula=r"$0.14\,\mathrm{mm} / (\pi m / 2)$, $m = 2$ mm",
        computed=(Figure("", 0.14 / (math.pi * unit.module / 2) * 100, "%"),),
        verdict="corrected: rounded down",
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
        verdict="not reproducible: nearly twice the sun's slope, where both must be equal",
    )


def _wear_share_row() -> Row:
    unit = _rv003()
    recess, approach = path_of_contact(unit)
    alpha, r1, r2 = unit.pressure_angle, unit.sun_pitch_radius, unit.planet_pitch_radius

    def flank(radius: float, up: float, down: float) -> float:
        foot = radius * math.sin(alpha)
        return ((foot + up) ** 2 - (foot - down) ** 2) / (2 * radius * math.cos(alpha))

    sun, planets = (
        unit.sun_teeth * flank(r1, recess, approach),
        unit.cranks * unit.planet_teeth * flank(r2, approach, recess),
    )
    found = wear(
        Model(unit),
        torque="142 N*m",
        input_speed="1800 rpm",
        hours=[0, 1000],
        coefficients=WearCoefficients(sun="1e-10 mm^3/(N*m)", planet="1e-10 mm^3/(N*m)"),
        disc_width="9 mm",
        gear_width="8 mm",
    )
    return Row(
        key="003 share of wear",
        source="003",
        statement="wear of each planet as a share of the sun's, because three of them share the load",
        printed=(Figure("", 1 / 3, "", 2),),
        formula=r"Archard's law, $V_1 = V_2$: $z_1 s_1 / (3 z_2 s_2)$, $s$ the length of a flank that touches",
        computed=(Figure("", sun / planets, "", 3),),
        corrected=(Figure("", float(found.thinning["planet"][-1] / found.thinning["sun"][-1]), "", 3),),
        verdict="corrected: the source assumes it. A tooth of the sun meets three planets in a turn, but these also "
        "have 90 teeth for its 12, and longer flanks",
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
        verdict="not reproducible: law and text disagree, 8 arcsec of change in a span of 30. In the equilibrium the "
        "sign depends on the errors: [published numbers](published.md#003-friction)",
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
        verdict="corrected: a misprint, 0.40 %, and the printed speed belongs to another ratio",
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
            Figure("over $z_c$", printed / unit.disc_lobes),
            Figure("one contact alone", one_contact),
            Figure("too large by the factor", printed / one_contact, ""),
        ),
        corrected=(
            Figure("one pin among the loaded ones, peak-to-peak", _peak_to_peak(one)),
            Figure("all pins, constant", _mean(ring)),
        ),
        verdict="corrected: an angle of the crank, not of the output; over $z_c$ it is near what all pins together "
        "make. As printed it is too large by a factor of about 50 even for a single contact",
    )


def _sun_row() -> Row:
    unit, e = _rv40e(), 0.010
    waves = [wave(unit, "involute.sun_eccentricity", p, e) for p in ("x", "y")]
    planet = wave(unit, "involute.planet_eccentricity", "x", e, crank=0)
    return Row(
        key="004 sun eccentricity",
        source="004",
        statement="error from a sun that is eccentric by 10 um",
        printed=(),
        formula=r"$\frac{Z_r}{Z_s}\,e_s/r_s$ with the pins for the ring gear",
        computed=(
            Figure("", unit.pins / unit.sun_teeth * e / unit.sun_pitch_radius / ARCSEC),
            Figure("over the ratio in place of times $Z_r/Z_s$", e / unit.sun_pitch_radius / unit.ratio / ARCSEC),
        ),
        corrected=(
            Figure("floating sun, peak-to-peak", max(_peak_to_peak(w) for w in waves)),
            Figure("were it at one mesh alone, peak-to-peak", _peak_to_peak(planet)),
        ),
        verdict="corrected: there is no ring gear, and the sun's angle is divided by the ratio, not multiplied; "
        "between evenly spaced planets a floating sun gives way",
    )


def _maximum_row() -> Row:
    low, high = -0.0089, 0.0093
    forward, reverse = 56.33 / 60, 57.42 / 60
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
            Figure("1.092 less the forward 56.33 arcsec:", peak_to_peak - forward, "arcmin"),
            Figure("less the reverse 57.42 arcsec:", peak_to_peak - reverse, "arcmin"),
        ),
        verdict="corrected: definitions mixed, the figure is peak-to-peak; from the forward maximum, which is named "
        "beside it, it differs by 0.15, and 0.13 is the difference from the reverse one, cut off",
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
        verdict="corrected: too few, the gear mesh falls on the second harmonic of every disc and crank error",
    )


def _encoder_row() -> Row:
    unit = _rv40e()
    at_input, at_output = 0.39, 1.24
    turn = 360 * 3600
    return Row(
        key="004 encoders",
        source="004",
        statement="accuracy and lines of the encoders of the bench",
        printed=(
            Figure("input", at_input),
            Figure("of lines", 36000, "", 5),
            Figure("output", at_output),
            Figure("of lines", 18000, "", 5),
        ),
        formula=r"input over $R$; both: root of the sum of squares; line: a turn over the lines",
        computed=(
            Figure("input's share at the output", at_input / unit.ratio),
            Figure("both", math.hypot(at_input / unit.ratio, at_output)),
            Figure("line of the output's encoder", turn / 18000),
            Figure("of the input's, at the output", turn / 36000 / unit.ratio),
        ),
        verdict="reproduced as printed: the output's encoder alone counts, with 2 % of the measured error; its lines "
        "are wider than that error, so what is between them is interpolated",
    )


def _clearance_row() -> Row:
    unit, clearance = _rv40e(), 0.012
    onset = unit.stiffness.crank_bearing * clearance
    return Row(
        key="004 bearing clearance",
        source="004",
        statement="bearing with a clearance of 12 um as a spring that is there beyond the clearance alone",
        printed=(),
        formula=r"printed: $k d$, $k = K_n$ where $d > \epsilon$; right: $K_n (d - \epsilon)$; $K_n$ is not printed, "
        r"here $3\cdot 10^5$ N/mm",
        computed=(Figure("force at the first touch", onset, "N"),),
        corrected=(Figure("force at the first touch", 0, "N"),),
        verdict="corrected: as printed the force jumps where the clearance closes. 12 um to each side in all cam and "
        "crank bearings make 374 arcsec of lost motion, [six times a sold unit's](theory/rigidity.md#two-lists)",
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
        verdict="corrected: the figures are right, the formula is not",
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
        _disc_rotation_row(),
        _peak_row(),
        _profile_001_row(),
        _degrees_of_freedom_row(),
        _phase_row(),
        _fourier_row(),
        _projection_row(),
        _modification_row(),
        _gap_row(),
        _displacement_row(),
        _equal_forces_row(),
        _profile_003_row(),
        _spline_row(),
        _tooth_share_row(),
        _wear_row(),
        _planet_wear_row(),
        _wear_share_row(),
        _friction_row(),
        _mean_ratio_row(),
        _pin_radius_row(),
        _sun_row(),
        _encoder_row(),
        _maximum_row(),
        _sampling_row(),
        _clearance_row(),
        _formula_ratio_row(),
    )


_HEAD = """# Ledger of the published texts

What five published texts print, what their own formulas give, and what rverror gives instead. A text is called a source
here; error sources are in the [catalogue](catalogue.md). Numbers that no source prints are computed by
`docs/_ext/ledger.py`; this page is its output (`python docs/_ext/ledger.py`) and a test compares the two. What the
texts are: [bibliography](bibliography.md). Figures are for the RV-40E and errors of 5 um unless a row says otherwise;
"constant" is a shift of the output that does not change over the turn, positive where the output leads.

A figure "as printed" takes the source's own formula, frame and ratio. One of rverror is the closed form: rigid
bearings, equal contact stiffness, forward motion under load. A verdict begins with: reproduced; corrected (the right
formula or figure stands beside it); not reproducible. Every equation, figure and table of the texts, also those that
have no row here: [sources](sources.md).
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
    lines = [_line("row", "printed", "formula", "what it gives", "rverror", "verdict"), _line(*["---"] * 6)]
    lines += [
        _line(
            row.key,
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
