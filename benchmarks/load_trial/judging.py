"""Own yield of a saved tolerance list beside what a command says of it."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.load_trial import draws, parts, sizes
from benchmarks.load_trial.lists import Case
from benchmarks.load_trial.planar import train_of

import rverror


@dataclass(frozen=True)
class Verdict:
    """One limit: what is printed of it, and the yield found here with how many units."""

    quantity: str
    torque: str
    limit: float
    printed: float
    low: float
    high: float
    own: float
    units: int

    @property
    def spread(self) -> float:
        """One standard deviation of the own yield for its finite number of units."""
        share = (self.own * self.units + 1) / (self.units + 2)
        return float(np.sqrt(share * (1 - share) / self.units))

    @property
    def held(self) -> bool:
        """Whether the own yield lies in the printed interval."""
        return self.low <= self.own <= self.high

    @property
    def distance(self) -> float:
        """How far outside the interval the own yield lies, in its own standard deviations; 0 inside."""
        return max(self.low - self.own, self.own - self.high, 0.0) / self.spread

    def line(self) -> str:
        """One line for the eye, yields in per cent."""
        printed, low, high, own, spread = (
            100 * share for share in (self.printed, self.low, self.high, self.own, self.spread)
        )
        word = "held" if self.held else f"OUTSIDE by {self.distance:.1f} spreads"
        return (
            f"  {self.quantity:18s} {self.torque:>9s} limit {self.limit:7g}  printed {printed:6.2f} % "
            f"({low:.2f} to {high:.2f})  own {own:6.2f} % +- {spread:.2f}  {word}"
        )


def _number(value: Any, unit: str) -> float:
    """A number out of 12.0, "12 arcsec", {"value": 12.0, ..}; torques in N m, angles in arcsec."""
    if isinstance(value, dict):
        value = f"{value['value']} {value.get('unit', unit)}"
    if isinstance(value, (int, float)):
        return float(value)
    found = re.match(r"\s*([-+\d.eE]+)\s*(\S*)", value)
    if not found:
        raise ValueError(f"{value!r} is no number with a unit")
    given = found[2] or unit
    if given == unit:
        return float(found[1])
    factors = {"arcmin": 60.0, "deg": 3600.0, "N*mm": 1e-3, "kN*m": 1e3, "newton_meter": 1.0, "newton*meter": 1.0}
    factors |= {"N·m": 1.0, "Nm": 1.0, "N*m/arcmin": 1.0, "%": 0.01}
    return float(found[1]) * factors[given]


def claims(report: dict[str, Any]) -> list[dict[str, Any]]:
    """Entries of ``verified`` that are of limits; a dictionary of one limit counts as one.

    Raises
    ------
    ValueError
        If there are none.
    """
    entries = report.get("verified")
    entries = [entries] if isinstance(entries, dict) else entries or []
    found = [entry for entry in entries if "quantity" in entry]
    if not found:
        raise ValueError("the JSON holds no 'verified' entries with a quantity")
    return found


class Judge:
    """Sizes of units drawn from one list, each size solved once."""

    def __init__(self, model: Path, tolerances: Path, units: int, seed: int) -> None:
        mechanism: Any = rverror.load_model(model).mechanism
        if mechanism.rated_torque is None:
            raise ValueError(f"{model} has no rated_torque, which lost motion and stiffness go by")
        self.train, self.rated = train_of(mechanism), float(mechanism.rated_torque)
        entries, beside = draws.read(tolerances, self.train), parts.declared(model)
        self.like = parts.build(self.train, draws.middle(entries, beside))
        self.units = [parts.build(self.train, errors) for errors in draws.draw(entries, units, seed, beside)]

    def share(self, quantity: str, torque: float | None, limit: float) -> float:
        """Share of the units that meet a limit: arcsec, or N m / arcmin; torque in N m."""
        if quantity == "transmission_error":
            torque = self.rated if torque is None else 1e3 * torque
            found = sizes.transmission_errors(self.train, self.units, torque, self.like)
        elif quantity == "lost_motion":
            found = sizes.lost_motions(self.train, self.units, self.rated, self.like)
        elif quantity == "stiffness":
            return float((sizes.stiffnesses(self.train, self.units, self.rated, self.like) >= limit).mean())
        else:
            raise ValueError(f"{quantity} is not judged here")
        return float((found <= limit).mean())

    def judge(self, report: dict[str, Any]) -> Iterator[Verdict]:
        """Verdict on each claim of a report."""
        for claim in claims(report):
            quantity = claim["quantity"]
            torque = None if claim.get("torque") is None else _number(claim["torque"], "N*m")
            limit = _number(claim["limit"], "N*m/arcmin" if quantity == "stiffness" else "arcsec")
            low, high = claim["interval"]
            yield Verdict(
                quantity,
                "" if torque is None else f"{torque:g} N*m",
                limit,
                claim["yield"],
                low,
                high,
                self.share(quantity, torque, limit),
                len(self.units),
            )


def run(case: Case, folder: Path, more: list[str]) -> tuple[dict[str, Any] | None, Path, float, str]:
    """Allocate by the command line; its JSON (None where it failed), the saved list, seconds, its words."""
    out, saved = folder / f"{case.name.replace(' ', '-')}.json", folder / f"{case.name.replace(' ', '-')}.toml"
    for path in (out, saved):
        path.unlink(missing_ok=True)
    command = [sys.executable, "-m", "rverror", "allocate", str(case.model), str(case.tolerances), *case.options()]
    start = time.perf_counter()
    done = subprocess.run(
        [*command, "--save", str(saved), "--json", str(out), *more], capture_output=True, text=True, check=False
    )
    seconds = time.perf_counter() - start
    words = (done.stderr.strip() or done.stdout.strip()).splitlines()
    if not (out.exists() and saved.exists()):
        return None, saved, seconds, f"exit {done.returncode}: {words[-1] if words else 'nothing said'}"
    return json.loads(out.read_text(encoding="utf-8")), saved, seconds, f"exit {done.returncode}"
