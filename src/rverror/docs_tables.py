"""Pages of the documentation that are written from the code: the catalogue, and the frames and orders of a reducer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from rverror.catalogue import CATALOGUE, Index, IndexValue, Source
from rverror.compose import closed_form_forces, pose, source_matrix
from rverror.kinematics import frame_orders, fundamental_orders, samples_needed
from rverror.reducer import Drive, Reducer, reducer

#: What a waveform leaves in a record of the transmission error.
NOTHING = "nothing"
CONSTANT = "constant"
LOST_MOTION = "lost motion"
WAVE = "wave"

_WHY = {
    "involute.center_distance": "turns with the carrier, as the line of action does",
    "involute.sun_eccentricity": "a floating sun between evenly spaced planets gives way",
    "involute.sun_offset": "the sun floats",
    "involute.sun_pitch": "the meshes cancel what is no multiple of the number of planets",
    "involute.tooth_thinning": "sets the place of the loaded flank only; which gear lost the tooth is never visible",
    "involute.spline_clearance": "sets the place of the loaded flank only",
    "crank.index": "the crank stays turned by it",
    "cycloid.pin_circle": "evenly spaced discs cancel harmonics that are no multiple of their number",
    "coupling.carrier_bore_position": "turns with the carrier, as the force on the bore does",
    "coupling.bearing_clearance": "the force on a bore is constant in the carrier, and so is its journal's place",
    "coupling.carrier_runout": "the forces on all bores cancel",
    "thermal.growth": "changes play alone; the same rise of all parts leaves nothing",
    "load.torsion": "constant at constant torque",
    "sensor.time_offset": "at constant speed the reading lags by a constant angle, each way",
}


class Closed:
    """Closed-form motion and forces of a mechanism over one turn forward and one in reverse, made once."""

    def __init__(self, mechanism: Reducer | Drive, samples: int) -> None:
        """Pose the mechanism at `samples` angles and share the load out."""
        theta = 2 * np.pi * np.arange(samples) / samples
        senses = ((theta, 1), (theta[::-1], -1))
        motions = [pose(mechanism, angle, direction=d, time=theta, torque=1.0) for angle, d in senses]
        self._runs = [(motion, closed_form_forces(motion)) for motion in motions]
        # an influence of a thousandth of 1/r6 or of an angle is rounding where a column's own scale is 0
        self._least = 1e-3 / mechanism.crank_radius if isinstance(mechanism, Reducer) else 1e-3

    def visibility(self, entry: Source, indices: Mapping[str, IndexValue]) -> dict[str, str]:
        """What each parameter of a source leaves in a record over one output turn.

        Parameters
        ----------
        entry : Source
        indices : mapping
            Indices of the source.

        Returns
        -------
        dict
            For each parameter `NOTHING` at all; a `CONSTANT`, the same in both directions, which goes with the
            record's offset; `LOST_MOTION`, a constant that differs between the directions, visible only where forward
            and reverse runs share their zero; or a `WAVE`.
        """
        forward, reverse = (source_matrix(motion, forces, entry.key, indices) for motion, forces in self._runs)
        rounding = 1e-9 * max(float(np.abs(forward).max()), float(np.abs(reverse).max()), self._least)
        found = {}
        for parameter, f, r in zip(entry.parameters, forward, reverse, strict=True):
            if max(np.abs(f).max(), np.abs(r).max()) < rounding:
                found[parameter.name] = NOTHING
            elif max(np.ptp(f), np.ptp(r)) > rounding:
                found[parameter.name] = WAVE
            else:
                found[parameter.name] = LOST_MOTION if abs(f.mean() - r.mean()) > rounding else CONSTANT
        return found


def catalogue_markdown() -> str:
    """Text of the page ``docs/catalogue.md``, from the registry and the closed form of an RV-40E.

    Returns
    -------
    str
        Markdown, one line break at the end.
    """
    unit = reducer("RV-40E")
    closed = Closed(unit, samples_needed(unit))
    lines = [_CATALOGUE_HEAD, _line("key", "what", "indices", "parameters", "fixed in", "leading orders", "reference")]
    lines.append(_line(*["---"] * 7))
    lines += [_catalogue_line(unit, entry) for entry in CATALOGUE.values()]
    lines += ["", _INVISIBLE_HEAD, _line("key", "parameters and what they leave", "why")]
    lines.append(_line(*["---"] * 3))
    for entry in CATALOGUE.values():
        left = _left(closed, unit, entry) if entry.applies_to(unit) else ""
        if left:
            lines.append(_line(f"`{entry.key}`", left, _WHY.get(entry.key, "-")))
    return "\n".join([*lines, "", _CATALOGUE_TAIL])


def frames_markdown(unit: Reducer) -> str:
    """Table of the turns of every part of a reducer and the orders of what is fixed in it.

    Parameters
    ----------
    unit : Reducer

    Returns
    -------
    str
        Markdown table, one line break at the end.
    """
    turns, orders = frame_orders(unit), fundamental_orders(unit)
    lines = [_line("part", "turns in the housing", "turns in the carrier", "order of an error fixed in it")]
    lines.append(_line(*["---"] * 4))
    lines += [
        _line(part, f"{turn:+g}", f"{turn - turns['carrier']:+g}", f"{orders[part]:g} h")
        for part, turn in turns.items()
    ]
    return "\n".join(lines) + "\n"


def _catalogue_line(unit: Reducer, entry: Source) -> str:
    parameters = ", ".join(f"`{p.name}`" for p in entry.parameters)
    return _line(
        f"`{entry.key}`",
        entry.summary,
        ", ".join(f"`{index.name}`" for index in entry.indices) or "-",
        f"{parameters} ({entry.parameters[0].dimension.replace('_', ' ')})" if entry.parameters else "-",
        entry.frame,
        _leading_orders(unit, entry) if entry.applies_to(unit) else "h times the shaft's turns",
        entry.reference,
    )


def _leading_orders(unit: Reducer, entry: Source) -> str:
    """The first leading orders over the index sets that diagnosis tries."""
    found: dict[float, None] = {}
    for indices in entry.candidates(unit):
        found.update(dict.fromkeys(entry.orders(unit, indices)))
    first = [f"{order:g}" for order in sorted(found)]
    return ", ".join(first[:4]) + (" ..." if len(first) > 4 else "") or "-"


def _left(closed: Closed, unit: Reducer, entry: Source) -> str:
    """Parameters that leave no wave, grouped by what they leave and by the index sets for which they do."""
    candidates = list(entry.candidates(unit))
    try:
        by_set = [closed.visibility(entry, indices) for indices in candidates]
    except ValueError:  # not in the closed form
        return ""
    parts = []
    for parameter in entry.parameters:
        kinds = [found[parameter.name] for found in by_set]
        for kind in sorted(set(kinds) - {WAVE}):
            which = [indices for indices, k in zip(candidates, kinds, strict=True) if k == kind]
            parts.append((f"{kind}{_where(entry.indices, which, candidates)}", parameter.name))
    texts = dict.fromkeys(text for text, _ in parts)
    return "; ".join(", ".join(f"`{name}`" for t, name in parts if t == text) + f": {text}" for text in texts)


def _where(
    indices: Sequence[Index], which: Sequence[Mapping[str, IndexValue]], of: Sequence[Mapping[str, IndexValue]]
) -> str:
    """Index values that tell the chosen sets from the rest; empty where all are chosen."""
    if len(which) == len(of):
        return ""
    words = []
    for index in indices:
        chosen, every = ({str(s[index.name]): None for s in sets} for sets in (which, of))
        if len(chosen) < len(every):
            words.append(f"{index.name} {', '.join(chosen)}")
    return f" ({'; '.join(words)})"


def _line(*cells: str) -> str:
    return "| " + " | ".join(cells) + " |"


_CATALOGUE_HEAD = """# Catalogue of error sources

Every source that rverror knows, written from the registry (`python -m rverror.docs_tables`); a test compares the two.
Orders are per output turn of an RV-40E with two discs, the first few of those that diagnosis tries; "-" where the
closed form holds no order: a constant, or nothing. h is the harmonic. Directions, frames and signs:
[conventions](conventions.md). How a source turns into output error: [the principle](theory/principle.md).
"""

_INVISIBLE_HEAD = """## What a record of the transmission error does not show

A record has no zero of its own, so a constant goes with its offset. A constant that differs between the directions is
lost motion: it shows only where forward and reverse runs share one zero (`# index:` in the run files). Under the closed
form (rigid bearings, equal stiffness, all loaded pins in contact):
"""

_CATALOGUE_TAIL = """Further, among the sources that do leave waves:

- Equal errors of two discs, equally oriented, cancel their odd harmonics: disc profile, disc pitch, disc bores.
- Two discs in antiphase cancel the odd multiples of the housing's order that they share: of a pin's 39, 78, 117 only 78
  stays.
- Tangential errors that are alike at all cams, or at all bores of the discs, are constants.
- Which of several equal cranks or discs carries an error cannot be told from linear waveforms; contact at light load
  may break the tie.
- A pin or flank that is drawn back only unloads itself. Under the closed form it still carries its share; in a real
  unit its neighbours take over, so it leaves less than the wave, and no more as it is drawn back further.
"""


if __name__ == "__main__":
    print(catalogue_markdown(), end="")
