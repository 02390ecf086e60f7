"""Pages of the documentation that are written from the code: the catalogue, and the frames and orders of a reducer."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from rverror.base.units import DISPLAY_UNITS, to_display
from rverror.geartrain.action_line import CONTACT_AXES
from rverror.geartrain.contacts import closed_form_forces, pose
from rverror.geartrain.kinematics import frame_orders, fundamental_orders, samples_needed
from rverror.geartrain.mechanism import Drive, Mechanism, Reducer, reducer
from rverror.geartrain.source import Index, IndexValue, Parameter, Source
from rverror.model.catalogue import CATALOGUE
from rverror.model.compose import source_matrix

#: What a waveform leaves in a record of the transmission error.
NOTHING = "nothing"
CONSTANT = "constant"
LOST_MOTION = "lost motion"
WAVE = "wave"


#: What `Source.frame` says of what is fixed in no part.
_FIXED = {
    "direction": "no part, changes with the direction of motion",
    "bearing": "no part, turns with the load on the bearing",
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


def example_drive() -> Drive:
    """A drive of 14 to 1, for sources that act in no reducer."""
    return Drive(ratio=14.0, shafts={"motor": 14.0})


def mechanism_for(entry: Source) -> Mechanism:
    """Mechanism in which a source is shown: an RV-40E where it acts there, else `example_drive`.

    Parameters
    ----------
    entry : Source

    Returns
    -------
    Reducer or Drive
    """
    unit = reducer("RV-40E")
    return unit if entry.applies_to(unit) else example_drive()


def catalogue_markdown(more: Callable[[Source], str] | None = None) -> str:
    """Text of the page ``docs/catalogue.md``, from the registry and the closed form of an RV-40E.

    Parameters
    ----------
    more : callable, optional
        What else stands below each source, Markdown: pictures, where a page can show them.

    Returns
    -------
    str
        Markdown, one line break at the end.
    """
    unit = reducer("RV-40E")
    closed = Closed(unit, samples_needed(unit))
    left = {entry.key: _left(closed, unit, entry) if entry.applies_to(unit) else "" for entry in CATALOGUE.values()}
    lines = [_CATALOGUE_HEAD, _line("key", "what", "fixed in", "leading orders"), _line(*["---"] * 4)]
    lines += [
        _line(f"`{entry.key}`", entry.summary, entry.frame, _leading_orders(entry)) for entry in CATALOGUE.values()
    ]
    lines += ["", _SOURCES_HEAD]
    for entry in CATALOGUE.values():
        lines += [_section(entry, left[entry.key]), *([more(entry), ""] if more else [])]
    lines += [_INVISIBLE_HEAD, _line("key", "parameters and what they leave", "why"), _line(*["---"] * 3)]
    lines += [_line(f"`{key}`", text, CATALOGUE[key].hidden or "-") for key, text in left.items() if text]
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


def _section(entry: Source, left: str) -> str:
    """One source in full, as a heading, a sentence and a list."""
    felt = "; ".join(CONTACT_AXES[contact].partition(":")[0] for contact in _contacts(entry))
    lines = [
        f"### `{entry.key}`",
        "",
        entry.summary[0].upper() + entry.summary[1:] + ".",
        "",
        f"- Error vector: {entry.equation}.",
        f"- Felt at: {felt}. Fixed in: {_FIXED.get(entry.frame, entry.frame)}.",
        f"- Parameters: {_parameters(entry.parameters)}.",
    ]
    if entry.indices:
        lines.append("- Indices: " + ", ".join(f"`{index.name}`" for index in entry.indices) + ".")
    orders = _leading_orders(entry)
    lines.append(f"- Leading orders: {'none' if orders == '-' else orders.replace(' ...', ' and more')}.")
    if left:
        lines.append(f"- Leaves no wave: {left}.")
    lines.append(f"- Reference: {entry.reference}. Function: `{entry.vector.__module__}.{entry.vector.__name__}`.")
    return "\n".join([*lines, ""])


def shown_indices(entry: Source) -> dict[str, IndexValue]:
    """Index values with which a source is shown: of those that diagnosis tries the first of the lowest order.

    Parameters
    ----------
    entry : Source

    Returns
    -------
    dict
    """
    mechanism = mechanism_for(entry)
    return min(entry.candidates(mechanism), key=lambda indices: min(entry.orders(mechanism, indices), default=np.inf))


def _contacts(entry: Source) -> tuple[str, ...]:
    """Contacts at which a source has a vector."""
    motion = pose(mechanism_for(entry), [0.0, 0.1], time=[0.0, 1.0], torque=1.0)
    vector = entry.vector(motion, **shown_indices(entry))
    parts = vector if isinstance(vector, tuple) else (vector,)
    return tuple(dict.fromkeys(part.contact for part in parts))


def _parameters(parameters: Sequence[Parameter]) -> str:
    """Names and dimension, and the largest size that is plausible, in the unit in which people read it."""
    names, first = ", ".join(f"`{p.name}`" for p in parameters), parameters[0]
    size = f"{to_display(first.plausible, first.dimension):g} {DISPLAY_UNITS[first.dimension]}"
    bounds = f"from 0, plausible up to {size}" if first.least == 0 else f"plausible up to {size}"
    return f"{names} ({first.dimension.replace('_', ' ')}, {bounds})"


def _leading_orders(entry: Source) -> str:
    """The first leading orders over the index sets that diagnosis tries."""
    unit = mechanism_for(entry)
    if isinstance(unit, Drive):
        return "h times the shaft's turns"
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

Every source that rverror knows, written from the registry (`python docs/_ext/catalogue_tables.py`); a test compares
the two. Orders are per output turn of an RV-40E with two discs, the first few of those that diagnosis tries; "-" where
the closed form holds no order: a constant, or nothing. h is the harmonic. A source turns with the part that it is
"fixed in". Directions, frames and signs: [conventions](conventions.md). How a source becomes output error:
[the principle](theory/principle.md). The texts that references name by number: [bibliography](bibliography.md).
"""

_SOURCES_HEAD = r"""## Each source

The output error is $\Delta\Theta = \sum \lambda\, n \cdot \delta$ over the contacts at which a source is felt: its
error vector $\delta$, displacement of the driving less that of the driven surface, times the force $\lambda n$ that the
contact carries per unit of output torque ([the principle](theory/principle.md)). Angles at the spline and at the output
take the place of vectors there. In the formulas:

- $p_i$, $r_j$, $\epsilon_k$: unit vectors from the housing's centre to pin $i$ and to crank $j$, and along the
  eccentric direction of disc $k$; $\perp$ turns one by a quarter turn counter-clockwise, and $t_j = r_j^\perp$.
- $n_i$: from pin $i$ into the disc along the contact normal; $\tau_i$: the tangent at that contact about the disc's
  centre, at the angle $\psi_i$ in the disc's frame; $\psi_l$ the crest of lobe $l$.
- $n_j$: from the sun into planet $j$ along the line of action of the flank that carries; $\chi$: where the teeth that
  mesh stand on their gear.
- $\gamma_i$, $\beta_j$: angles of pin $i$ and crank $j$ in the housing; $\varphi_i$: angle by
  which $\epsilon_k$ leads pin $i$; $\nu = -z_c/(z_p - z_c)$: turns of the cranks; $C(x)$: a turn by $x$.
- $e$ or what stands in its place: the parameters, in the order in which they are listed; $c$ and $s$ those of a cosine
  and a sine, $h$ the harmonic.
- $f_i$, $f_j$, $f_{kj}$: the force that a contact carries, N, proportional to the load; a vector at bearings.
- Upper signs: forward, or the flank that carries forward; lower signs: reverse. Clearances take the $\lambda$ of the
  bearings as positive.
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
