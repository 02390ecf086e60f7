"""The tables of docs/ranking.md are what the library says; `python tests/model/test_ranking.py` prints them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rverror
from rverror.base.units import ARCSEC, to_display
from rverror.tolerances.closed_form import Budget, Contribution, budget
from rverror.tolerances.declared import Tolerance, tolerance
from rverror.tolerances.stacking import stack
from rverror.tolerances.tolerance_file import load_tolerances

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "ranking.md"
UNIT = rverror.Model(rverror.reducer("RV-40E"))
TANGENTIAL = ("tangential_cos", "tangential_sin")

#: What each source prints, and the tolerances that it is read as.
LIST_004 = (
    "sun gear base circle eccentricity, 10",
    "sun gear assembly error, 5",
    "planetary gear base circle eccentricity, 10",
    "pin gear slot deviation, 8",
    "pin gear diameter error, -8",
    "pin gear arc groove radius error, 10",
    "carrier crankshaft hole eccentricity, 5",
    "carrier assembly error, 5",
    "crankshaft eccentric cam error, -2 and 2",
    "bearing clearance, 12: cams",
    "bearing clearance, 12: carrier",
)
SENSITIVITY_004 = {
    "1: bearing clearance 10 to 15, +-12.5 arcsec, 35 %: cams": tolerance(
        "crank.bearing_clearance", "2.5 um", mean="12.5 um"
    ),
    "1: the same: carrier": tolerance("coupling.bearing_clearance", "2.5 um", mean="12.5 um"),
    "2: pin diameter -10 to 10, +-9.8 arcsec, 28 %: all alike": tolerance("cycloid.pin_radius", "5 um", pin="all"),
    "2: the same: each pin by itself": tolerance("cycloid.pin_radius", "5 um"),
    "3: sun eccentricity 5 to 15, +-6.3 arcsec, 18 %": tolerance("involute.sun_eccentricity", "15 um"),
    "4: disc lobe error 5 to 10, +-4.2 arcsec, 12 %": tolerance("cycloid.disc_lobe", "2.5 um", mean="7.5 um"),
    "5: assembly misalignment 2 to 8, +-2.1 arcsec, 7 %: carrier": tolerance("coupling.carrier_runout", "8 um"),
    "5: the same: sun": tolerance("involute.sun_offset", "8 um"),
}
LIST_001 = {
    "1: crank eccentricity variation, 2 um": tolerance("crank.eccentricity", "2 um"),
    "2: disc cumulative pitch error, 5 arcsec": tolerance("cycloid.disc_pitch", "0.776 um", harmonic=1),
    "3: pin cumulative pitch error, 10 arcsec: once around": tolerance(
        "cycloid.pin_circle", "1.551 um", harmonic=1, parameters=TANGENTIAL
    ),
    "3: the same: twice around": tolerance("cycloid.pin_circle", "1.551 um", harmonic=2, parameters=TANGENTIAL),
    "4: crank hole circumferential error, 3 um": tolerance(
        "cycloid.disc_bore_position", "3 um", parameters=["tangential"]
    ),
    "5: output wheel eccentricity, 5 um": tolerance("coupling.carrier_runout", "5 um"),
}
EQUAL_001 = {
    "1: crank eccentricity": tolerance("crank.eccentricity", "5 um"),
    "2: disc pitch": tolerance("cycloid.disc_pitch", "5 um", harmonic=1),
    "3: pin pitch, each pin": tolerance("cycloid.pin_position", "5 um", parameters=["tangential"]),
    "3: pin pitch, once around": tolerance("cycloid.pin_circle", "5 um", harmonic=1, parameters=TANGENTIAL),
    "3: pin pitch, twice around": tolerance("cycloid.pin_circle", "5 um", harmonic=2, parameters=TANGENTIAL),
    "4: crank hole, circumferential": tolerance("cycloid.disc_bore_position", "5 um", parameters=["tangential"]),
    "5: output wheel eccentricity": tolerance("coupling.carrier_runout", "5 um"),
}
LIST_000 = {
    "1: output plate hole, 30.5 arcsec": tolerance("coupling.carrier_bore_position", "5 um"),
    "2: cycloid profile, 12.8 arcsec": tolerance("cycloid.disc_profile", "5 um", harmonic=1),
    "3: crank eccentricity, 8.2 arcsec": tolerance("crank.eccentricity", "5 um"),
    "4: centre distance, 0.9 arcsec": tolerance("involute.center_distance", "5 um"),
}


def from_004() -> dict[str, Tolerance]:
    items = load_tolerances(ROOT / "examples" / "rv40e-tolerances.toml", UNIT)
    return dict(zip(LIST_004, items, strict=True))


def arcsec(value: float) -> str:
    return f"{value / ARCSEC:.2f}" if value >= 0.005 * ARCSEC else "0"


def row(printed: str, asked: Tolerance, item: Contribution, place: int) -> str:
    limits = [f"{name} {value}" for name, value in asked.indices.items()]
    limits += [" and ".join(asked.parameters)] if asked.parameters else []
    size = f"{to_display(item.width, item.dimension):.3g} um"
    rank = str(place) if item.effect == "wave" else "-"
    numbers = (f"{100 * item.share:.1f}", arcsec(item.mean_square**0.5), arcsec(item.worst_peak_to_peak))
    cells = (printed, ", ".join([f"`{asked.key}`", *limits, size]), rank, *numbers, arcsec(item.worst_offset))
    return "| " + " | ".join(cells) + " |"


def table(items: dict[str, Tolerance]) -> tuple[Budget, str]:
    result = budget(stack(UNIT, list(items.values())))
    order = sorted(result.contributions, key=lambda c: -c.share)
    lines = [
        "| printed | read as | rank here | share of the variance, % | rms | worst peak-to-peak | worst offset |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    found = zip(items.items(), result.contributions, strict=True)
    lines += [row(name, asked, c, order.index(c) + 1) for (name, asked), c in found]
    return result, "\n".join(lines) + "\n"


#: Effects of 004's table 4, +- arcsec, and the contributions printed beside them, %.
EFFECTS = {
    "bearing clearance": (12.5, 35),
    "pin diameter": (9.8, 28),
    "sun eccentricity": (6.3, 18),
    "disc lobe error": (4.2, 12),
    "assembly misalignment": (2.1, 7),
}


def shares() -> str:
    """What the printed contributions of 004's table 4 are shares of."""
    effects = [effect for effect, _ in EFFECTS.values()]
    lines = ["| source | effect | printed contribution, % | of the sum, % | of the squares, % |", "| --- " * 5 + "|"]
    for name, (effect, printed) in EFFECTS.items():
        of_sum, of_squares = 100 * effect / sum(effects), 100 * effect**2 / sum(e * e for e in effects)
        lines.append(f"| {name} | {effect} | {printed} | {of_sum:.1f} | {of_squares:.1f} |")
    return "\n".join(lines) + "\n"


#: Single errors of 5 um whose contacts open, and others.
LOADED = {
    "one cam": rverror.effect("crank.eccentricity", crank=0, disc=0, radial="5 um"),
    "one bore of a disc": rverror.effect("cycloid.disc_bore_position", crank=0, disc=0, radial="5 um"),
    "disc pitch, once around": rverror.effect("cycloid.disc_pitch", disc=0, harmonic=1, cos="5 um"),
    "disc profile, once around": rverror.effect("cycloid.disc_profile", disc=0, harmonic=1, cos="5 um"),
    "pin circle, twice around, tangential": rverror.effect("cycloid.pin_circle", harmonic=2, tangential_cos="5 um"),
    "one pin drawn in": rverror.effect("cycloid.pin_position", pin=3, radial="-5 um"),
    "one pin too thin": rverror.effect("cycloid.pin_radius", pin=3, deviation="-5 um"),
}


def loaded() -> str:
    """Peak-to-peak of single errors in closed form and by the equilibrium."""
    theta = np.linspace(0, 2 * np.pi, 1511, endpoint=False)
    lines = ["| error of 5 um | closed form | at 412 N m | at 20 N m |", "| --- " * 4 + "|"]
    for name, one in LOADED.items():
        unit = rverror.Model(UNIT.mechanism, (one,))
        sizes = [np.ptp(rverror.transmission_error(unit, theta, direction=1.0))]
        sizes += [
            np.ptp(rverror.equilibrium(unit, theta, torque=torque, direction=1.0).transmission_error)
            for torque in ("412 N*m", "20 N*m")
        ]
        lines.append("| " + " | ".join([name, *(f"{size / ARCSEC:.1f}" for size in sizes)]) + " |")
    return "\n".join(lines) + "\n"


TABLES = {
    "004, table 2": from_004,
    "004, table 4": lambda: SENSITIVITY_004,
    "001, table 3": lambda: LIST_001,
    "001, equal sizes": lambda: EQUAL_001,
    "000": lambda: LIST_000,
}


@pytest.mark.parametrize("name", TABLES)
def test_tables_of_the_page_are_what_the_library_says(name: str) -> None:
    _, expected = table(TABLES[name]())
    assert expected in PAGE.read_text(encoding="utf-8"), f"docs/ranking.md is out of date; it should hold:\n{expected}"


def test_printed_contributions_are_shares_of_the_sum() -> None:
    assert shares() in PAGE.read_text(encoding="utf-8"), f"docs/ranking.md should hold:\n{shares()}"
    total = sum(effect for effect, _ in EFFECTS.values())
    for effect, printed in EFFECTS.values():
        assert printed == pytest.approx(100 * effect / total, abs=1)


def test_what_the_load_makes_of_single_errors() -> None:
    assert loaded() in PAGE.read_text(encoding="utf-8"), f"docs/ranking.md should hold:\n{loaded()}"


if __name__ == "__main__":
    for title, items in TABLES.items():
        result, text = table(items())
        print(
            f"## {title}\nnominal p-p {result.nominal_peak_to_peak / ARCSEC:.2f}, rms {result.rms / ARCSEC:.2f}, "
            f"worst {result.worst.peak_to_peak / ARCSEC:.1f}, rss {result.rss / ARCSEC:.1f}, "
            f"offset {result.offset_mean / ARCSEC:.1f} +- {result.offset_deviation / ARCSEC:.2f}\n\n{text}"
        )
    print(shares())
    print(loaded())
