"""Holds a diagnosis against what is true of a unit, as the shared bench's score does."""

from __future__ import annotations

import cmath
import itertools
import math
import re
from collections.abc import Mapping
from typing import Any

OUTSIDE = "not in the catalogue"
#: Names of compliance, which are right wherever the stiffness is wrong.
SOFT = ("compliance", "stiffness", "contact_law", "load.torsion")
MOST_IN_A_SET = 4
NEAR_THE_NOISE = 1.15  #: held-out rms over the noise
NEAR_A_LINE = 0.2  #: orders
INDICES = ("disc", "crank", "pin", "lobe", "harmonic")


def causes(truth: Mapping[str, Any]) -> list[str]:
    """Keys of what is missing and in the catalogue."""
    return [effect["key"] for effect in truth["undeclared"] if effect["key"] != OUTSIDE]


def named_sets(truth: Mapping[str, Any], found: Mapping[str, Any]) -> list[set[str]]:
    """Keys of each addition with those it cannot be told from, less the additions that are true besides the causes."""
    sets = [{one["key"]} | {other["key"] for other in one.get("indistinguishable_from", [])} for one in found["added"]]
    what = truth.get("what", "")
    soft = SOFT if "stiff" in what or "power law" in what else ()
    besides = truth.get("also_true", [])
    return [keys for keys in sets if not any(any(word in key for word in soft) or key in besides for key in keys)]


def names_are_right(truth: Mapping[str, Any], found: Mapping[str, Any]) -> bool:
    """Whether every cause is in a small set of its own, and no set is left over."""
    wanted, sets = causes(truth), named_sets(truth, found)
    if len(sets) != len(wanted) or any(len(keys) > MOST_IN_A_SET for keys in sets):
        return False
    orders = itertools.permutations(sets)
    return any(all(key in keys for key, keys in zip(wanted, order, strict=True)) for order in orders)


def outcome(truth: Mapping[str, Any], found: Mapping[str, Any]) -> str:
    """``right``, or what is wrong.

    ``false``: something is named where nothing is missing; ``wrong``: a name that is no cause; ``wide``: too large a
    set; ``missed``: causes that are not named, and nothing beside those that are; ``line``: a line is not reported, or
    one where there is none; ``poor``: all names are right, and the held-out residual is not the noise.
    """
    wanted, sets = causes(truth), named_sets(truth, found)
    lines = [effect["order"] for effect in truth["undeclared"] if effect["key"] == OUTSIDE]
    if not names_are_right(truth, found):
        if not wanted and not lines:
            return "false"
        if any(not keys & set(wanted) for keys in sets) or len(sets) > len(wanted):
            return "wrong"
        return "wide" if any(len(keys) > MOST_IN_A_SET for keys in sets) else "missed"
    if lines:
        seen = [line["order"] for line in found.get("unexplained_orders", [])]
        reported = all(any(abs(order - at) < NEAR_A_LINE for at in seen) for order in lines)
        return "right" if found["verdict"] == "unexplained" and reported else "line"
    if not wanted:
        return "right" if found["verdict"] == "nothing_missing" or found["added"] else "line"
    held_out = found["after"]["heldout_rms_arcsec"]
    near = held_out is not None and held_out < NEAR_THE_NOISE * truth["noise_rms_arcsec"]
    return "right" if near else "poor"


def counted_from_marks(truth: Mapping[str, Any], found: Mapping[str, Any]) -> list[dict[str, Any]]:
    """What is missing, with the pins counted from the marks that were found.

    Where all else repeats with the crank, no run tells the marks from those a turn of the crank, one pitch of the pins,
    further on.  Marks that are k pitches ahead of those found make pin p the pin p - k.
    """
    note = next((n for n in found.get("notes", []) if n.startswith("index unknown")), "")
    placed = re.search(r"marks are (\S+) \+- .* whole turns of the crank, (\S+) deg", note)
    if not placed:
        return [dict(effect) for effect in truth["undeclared"]]
    at, pitch = map(float, placed.groups())
    ahead, pins = round((truth["marks_ahead_deg"] - at) / pitch), round(360 / pitch)
    return [_pins_back(effect, ahead, pins) for effect in truth["undeclared"]]


def _pins_back(effect: Mapping[str, Any], ahead: int, pins: int) -> dict[str, Any]:
    """An effect with its pins counted from one that is some pins further on."""
    if not effect["key"].startswith("cycloid.pin_"):
        return dict(effect)
    moved = dict(effect)
    if isinstance(effect.get("pin"), int):
        moved["pin"] = (effect["pin"] - ahead) % pins
    turn = cmath.exp(-2j * math.pi * effect.get("harmonic", 0) * ahead / pins)
    for way in ("radial", "tangential"):
        if f"{way}_cos" in effect:
            wave = complex(*(float(effect[f"{way}_{part}"].split()[0]) for part in ("cos", "sin"))) * turn
            moved |= {f"{way}_cos": f"{wave.real:.6f} um", f"{way}_sin": f"{wave.imag:.6f} um"}
    return moved


def sizes_inside(truth: Mapping[str, Any], found: Mapping[str, Any]) -> tuple[int, int]:
    """How many true sizes of effects that were found on their indices lie in their intervals, and of how many."""
    inside = total = 0
    for effect, one in itertools.product(counted_from_marks(truth, found), found["added"]):
        same = all(one["indices"].get(name) == effect[name] for name in INDICES if name in effect)
        if one["key"] != effect["key"] or not same:
            continue
        for name, fitted in one["parameters"].items():
            if isinstance(effect.get(name), str):
                value, unit = effect[name].split()
                total += unit == fitted["unit"]
                low, high = fitted["low"], fitted["high"]
                if unit == fitted["unit"] and low is not None and high is not None:
                    inside += low <= float(value) <= high
    return inside, total


def loud(truth: Mapping[str, Any], revolutions: float) -> bool:
    """Whether every effect has twice the rms of the noise of one run's mean revolution, or more."""
    noise = truth["noise_rms_arcsec"] / math.sqrt(max(revolutions, 1))
    return all(size >= 2 * noise for size in truth.get("effect_rms_arcsec", []))


def stiffness_inside(truth: Mapping[str, Any], found: Mapping[str, Any]) -> tuple[int, int]:
    """How many true stiffnesses lie in their intervals, and of how many that the runs tell.

    Of a power law the stiffness is that at a force which the library does not know: not counted.
    """
    true, inside, total = truth.get("true_over_declared_stiffness", {}), 0, 0
    if "contact_law" in truth:
        return 0, 0
    for one in found.get("stiffness", []):
        if one["name"] in true and one["determined"]:
            factor = float(true[one["name"]]) * one["declared"]
            total += 1
            inside += one["low"] <= factor <= one["high"]
    return inside, total
