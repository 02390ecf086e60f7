"""Pictures of the catalogue page: where the error of a source sits, and its influence over the output angle.

SVG text whose colours come from the page's style, as in the pictures of a report.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from catalogue_tables import mechanism_for, shown_indices
from svg_waveforms import waveforms

from rverror.base.arrays import Array
from rverror.base.units import ARCSEC, DISPLAY_UNITS, unit_factor
from rverror.geartrain.action_line import Clearance, Compliance, Contacts, ErrorVector
from rverror.geartrain.contacts import closed_form_forces, pose
from rverror.geartrain.mechanism import Drive, Reducer, reducer
from rverror.geartrain.source import IndexValue, Parameter, Source
from rverror.model.compose import source_matrix
from rverror.views.html import escaped
from rverror.views.plots.mechanism_view import PartPositions, part_positions

_SIZE = 300  # px, width and height of a sketch
_WIDTH = 340  # px, of an influence plot: a phone's
_ANGLE = 0.35  # rad, output angle of the sketches: nothing lies on an axis by chance
_ARROW = 0.17  # longest arrow over the radius of the housing
_WAVES = 4  # of the leading order, in an influence plot
_EVERY = 4  # of the points of a disc's outline, enough for its size here
_CENTRE = np.zeros(2)
_CRANK = 40.0  # order of the cranks of an RV-40E in its carrier
_NOTHING = 1e-9  # arcsec per unit of a parameter, below which an influence is rounding
_TURN_TIME = 60.0  # s per output turn, for sources that need time


def figures(entry: Source) -> str:
    """Pictures of one source as a piece of HTML.

    Parameters
    ----------
    entry : Source

    Returns
    -------
    str
        A sketch and, where anything of the source reaches the output, its influence; both with a caption.
    """
    indices = shown_indices(entry)
    which = ", ".join(f"{name} {value}" for name, value in indices.items())
    example = f" ({which})" if which else ""
    where = f"Where {entry.key}{example} sits"
    parts = [_figure(_sketch(entry, indices, title=where), _sketch_caption(entry, example))]
    drawn, silent = _influence(entry, indices)
    if drawn:
        title = f"Influence of {entry.key}{example} on the output error over the output angle"
        caption = '<span class="key forward">forward</span> <span class="key reverse">reverse</span>' + _conditions(
            entry
        )
        if silent:
            caption += f"; nothing comes of {', '.join(silent)}"
        parts.append(
            _figure(_plot(entry, indices, drawn, title=title), f"Influence{example}, closed form:<br/>{caption}")
        )
    else:
        parts.append('<p class="silent">Nothing of it reaches the output in the closed form.</p>')
    return '<div class="source">\n' + "\n".join(parts) + "\n</div>"


def symbol() -> str:
    """The mechanism that all sketches show, once for a page, as a piece of HTML that takes no room."""
    unit = reducer("RV-40E")
    return (
        '<svg width="0" height="0" aria-hidden="true" style="position:absolute"><symbol id="mechanism" '
        f'viewBox="{_view(unit)}" overflow="visible">{_mechanism(unit)}</symbol></svg>'
    )


def _figure(picture: str, caption: str) -> str:
    return f"<figure>{picture}<figcaption>{caption}</figcaption></figure>"


# --- influence --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Lines:
    """Influence of one parameter in the unit in which people read it, forward and in reverse."""

    parameter: Parameter
    forward: Array
    reverse: Array

    @property
    def label(self) -> str:
        return f"{self.parameter.name}, arcsec per {DISPLAY_UNITS[self.parameter.dimension]}"

    @property
    def largest(self) -> float:
        return float(max(np.abs(self.forward).max(), np.abs(self.reverse).max()))


def _span(entry: Source, indices: Mapping[str, IndexValue]) -> float:
    """Output angle of some waves of the leading order, or of the crank's where there is none; at most a turn, rad."""
    least = min(entry.orders(mechanism_for(entry), indices), default=_CRANK)
    return 2 * math.pi * min(_WAVES / least, 1.0)


def _influence(entry: Source, indices: Mapping[str, IndexValue]) -> tuple[list[_Lines], list[str]]:
    """Influence of each parameter, and the names of those of which nothing comes."""
    mechanism = mechanism_for(entry)
    theta = np.linspace(0, _span(entry, indices), 601)
    torque = mechanism.rated_torque if isinstance(mechanism, Reducer) else 1.0
    found = []
    for angle, direction in ((theta, 1.0), (theta[::-1], -1.0)):
        clock = _TURN_TIME * np.abs(angle - angle[0]) / (2 * math.pi)
        motion = pose(mechanism, angle, direction=direction, time=clock, torque=torque)
        rows = source_matrix(motion, closed_form_forces(motion), entry.key, indices) / ARCSEC
        found.append(rows if direction > 0 else rows[:, ::-1])
    units = [unit_factor(DISPLAY_UNITS[p.dimension], p.dimension) for p in entry.parameters]
    lines = [_Lines(p, u * f, u * r) for p, u, f, r in zip(entry.parameters, units, *found, strict=True)]
    silent = [line.parameter.name for line in lines if line.largest < _NOTHING]
    return [line for line in lines if line.parameter.name not in silent], silent


def _plot(entry: Source, indices: Mapping[str, IndexValue], lines: list[_Lines], *, title: str) -> str:
    panels = [(line.label, [("forward", line.forward), ("reverse", line.reverse)]) for line in lines]
    angle = np.degrees(np.linspace(0, _span(entry, indices), lines[0].forward.size))
    return waveforms(panels, angle, width=_WIDTH, title=title, panel_height=96 if len(lines) < 3 else 60)


def _conditions(entry: Source) -> str:
    """What the influence was computed for, where it depends on it."""
    if "torque" in entry.needs:
        return ", at the rated 412 N m"
    return ", one output turn a minute" if entry.key in ("sensor.time_offset", "sensor.drift") else ""


# --- sketch -----------------------------------------------------------------------------------------------------------


def _sketch_caption(entry: Source, example: str) -> str:
    names = [p.name for p in entry.parameters[:2]]
    said = [escaped(entry.summary[0].upper() + entry.summary[1:] + example)]
    if entry.frame in _OUTLINES:
        said.append(f"blue: what it is fixed in ({entry.frame})")
    if _has_arrows(entry):
        said.append("arrows: " + ", paler ".join(names))
    return "; ".join(said)


def _vectors(entry: Source, indices: Mapping[str, IndexValue]) -> tuple[ErrorVector | Clearance | Compliance, ...]:
    motion = pose(mechanism_for(entry), [_ANGLE, _ANGLE + 1e-3], time=[0.0, 1.0], torque=1.0)
    found = entry.vector(motion, **indices)
    return found if isinstance(found, tuple) else (found,)


def _has_arrows(entry: Source) -> bool:
    return any(
        isinstance(part, ErrorVector) and part.contact in ("pin", "cam", "carrier", "mesh")
        for part in _vectors(entry, shown_indices(entry))
    )


def _sketch(entry: Source, indices: Mapping[str, IndexValue], *, title: str) -> str:
    """Mechanism with the touched parts picked out and the error vectors as arrows, their lengths to one scale."""
    mechanism = mechanism_for(entry)
    head = f'<svg role="img" width="{_SIZE}" height="{_SIZE}" aria-label="{escaped(title)}"'
    if isinstance(mechanism, Drive):
        return f'{head} viewBox="-100 -100 200 200">{_shaft()}</svg>'
    motion = pose(mechanism, [_ANGLE])
    assert isinstance(motion, Contacts)
    where = part_positions(motion)
    parts = _OUTLINES[entry.frame](indices, mechanism, where) if entry.frame in _OUTLINES else []
    for vector in _vectors(entry, indices):
        parts += _marks(vector, mechanism, where)
    view, drawn = _view(mechanism), "".join(parts)
    x, y, width, height = view.split()
    base = f'<use href="#mechanism" x="{x}" y="{y}" width="{width}" height="{height}"/>'
    return f'{head} viewBox="{view}">{base}{drawn}</svg>'


def _view(unit: Reducer) -> str:
    reach = 1.22 * unit.pin_circle_radius
    return f"{-reach:.1f} {-reach:.1f} {2 * reach:.1f} {2 * reach:.1f}"


def _mechanism(unit: Reducer) -> str:
    """All parts, drawn to size; radii of cams and housing are for sight only."""
    motion = pose(unit, [_ANGLE])
    assert isinstance(motion, Contacts)
    where = part_positions(motion)
    parts = [_circle(_CENTRE, _dial(unit), "dial"), _circle(_CENTRE, _housing(unit), "housing")]
    parts += [_circle(pin, unit.pin_radius, "pin") for pin in where.pins]
    parts += [_curve(outline, f"disc disc{k}") for k, outline in enumerate(where.outline)]
    parts += [_circle(cam, _cam(unit), f"disc disc{k}") for k, cams in enumerate(where.contact["cam"]) for cam in cams]
    parts.append(_circle(_CENTRE, unit.sun_pitch_radius, "gear"))
    parts += [_circle(crank, unit.planet_pitch_radius, "gear") for crank in where.cranks]
    parts += [_circle(_CENTRE, unit.crank_radius, "carrier"), *(_circle(crank, 1.5, "axis") for crank in where.cranks)]
    return "".join(parts)


def _chosen(indices: Mapping[str, IndexValue], name: str, points: Array) -> Array:
    """Those of an array's first axis that an index names; all where the source has no such index."""
    return points[[int(indices[name])]] if name in indices else points


def _hot_cams(indices: Mapping[str, IndexValue], unit: Reducer, where: PartPositions) -> list[str]:
    cams = _chosen(indices, "disc", where.contact["cam"]) if "disc" in indices else where.cranks[None]
    return [_circle(cam, _cam(unit), "hot") for row in cams for cam in _chosen(indices, "crank", row)]


#: Outline of the part in which an error is fixed, by frame.
_OUTLINES: Mapping[str, Callable[[Mapping[str, IndexValue], Reducer, PartPositions], list[str]]] = {
    "housing": lambda _, unit, where: [_circle(_CENTRE, _housing(unit), "hot")],
    "disc": lambda indices, unit, where: [_curve(line, "hot") for line in _chosen(indices, "disc", where.outline)],
    "carrier": lambda _, unit, where: [_circle(_CENTRE, unit.crank_radius, "hot")],
    "sun": lambda _, unit, where: [_circle(_CENTRE, unit.sun_pitch_radius, "hot")],
    "planet": lambda indices, unit, where: [
        _circle(axis, unit.planet_pitch_radius, "hot") for axis in _chosen(indices, "crank", where.cranks)
    ],
    "crank": _hot_cams,
    "output": lambda _, unit, where: [_circle(_CENTRE, _dial(unit), "hot")],
}


def _marks(vector: ErrorVector | Clearance | Compliance, unit: Reducer, where: PartPositions) -> Iterator[str]:
    """Arrows, turns or gaps at the contacts that a vector touches."""
    if isinstance(vector, Clearance):
        for point in where.contact[vector.contact].reshape(-1, 2):
            yield _circle(point, _cam(unit), "hot") + _circle(point, 1.25 * _cam(unit), "gap")
        return
    if isinstance(vector, Compliance):
        points = where.contact[vector.contact][vector.at]
        shown = points[0] if vector.contact == "pin" else points[:, 0] if vector.contact == "mesh" else points
        radius = unit.pin_radius if vector.contact == "pin" else 0.5 * _cam(unit)
        yield from (_circle(point, radius, "hot") for point in shown.reshape(-1, 2))
        return
    if vector.contact == "output":
        yield _turn(_CENTRE, _dial(unit) + 3)
        return
    if vector.contact == "spline":
        touched = where.cranks[vector.at[0]] if vector.at else where.cranks
        yield from (_turn(crank, 0.6 * unit.planet_pitch_radius) for crank in touched)
        return
    points = where.contact[vector.contact]
    arrows = np.broadcast_to(vector.vector[..., 0], (len(vector.vector), *points[vector.at].shape))
    points = points[vector.at]
    if vector.contact in ("pin", "mesh"):  # one disc stands for all that feel it alike, the flank that carries forward
        first = (0,) if vector.contact == "pin" else (slice(None), 0)
        points, arrows = points[first], arrows[(slice(None), *first)]
    longest = float(np.linalg.norm(arrows[:2], axis=-1).max(initial=0.0))
    for number, term in enumerate(arrows[:2]):
        for point, arrow in zip(points.reshape(-1, 2), term.reshape(-1, 2), strict=True):
            length = float(np.linalg.norm(arrow))
            if length > 0.03 * longest:
                yield _arrow(point, arrow / longest * _ARROW * unit.pin_circle_radius, f"vector term{number}")


def _shaft() -> str:
    """A shaft that turns about a point off its centre, for a drive of which nothing else is known."""
    return (
        _circle(_CENTRE, 80, "dial")
        + _circle(_CENTRE, 42, "gear")
        + _circle(np.array([9.0, 5.0]), 42, "hot")
        + _circle(_CENTRE, 2, "axis")
        + _arrow(np.zeros(2), np.array([18.0, 10.0]), "vector term0")
        + _turn(_CENTRE, 62)
    )


def _housing(unit: Reducer) -> float:
    return unit.pin_circle_radius + 1.3 * unit.pin_radius


def _dial(unit: Reducer) -> float:
    return 1.13 * unit.pin_circle_radius


def _cam(unit: Reducer) -> float:
    return 0.32 * unit.planet_pitch_radius


def _circle(centre: Array, radius: float, name: str) -> str:
    return f'<circle class="{name}" cx="{centre[0]:.2f}" cy="{-centre[1]:.2f}" r="{radius:.2f}"/>'


def _curve(points: Array, name: str) -> str:
    return f'<path class="{name}" d="M{"L".join(f"{x:.2f} {-y:.2f}" for x, y in points[:, ::_EVERY].T)}"/>'


def _arrow(start: Array, vector: Array, name: str) -> str:
    """A line with a head whose size does not shrink with its length."""
    end = start + vector
    along = vector / max(float(np.linalg.norm(vector)), 1e-12)
    across = np.array([-along[1], along[0]])
    left, right = (end - 3.2 * along + side * 1.7 * across for side in (1, -1))
    points = " ".join(f"{x:.2f},{-y:.2f}" for x, y in (end, left, right))
    return (
        f'<g class="{name}"><path d="M{start[0]:.2f} {-start[1]:.2f}L{end[0]:.2f} {-end[1]:.2f}"/>'
        f'<polygon points="{points}"/></g>'
    )


def _turn(centre: Array, radius: float) -> str:
    """An arc with a head: a turn about a centre, counter-clockwise."""
    first, last = math.radians(35), math.radians(85)
    start, end = (np.asarray(centre) + radius * np.array([math.cos(a), math.sin(a)]) for a in (first, last))
    ahead = np.array([-math.sin(last), math.cos(last)])
    arc = f"M{start[0]:.2f} {-start[1]:.2f}A{radius:.2f} {radius:.2f} 0 0 0 {end[0]:.2f} {-end[1]:.2f}"
    return f'<path class="turn" d="{arc}"/>' + _arrow(end, 4.0 * ahead, "vector term0")
