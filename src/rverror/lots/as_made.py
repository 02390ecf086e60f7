"""A lot as a tolerance file: what its processes made, for budgets and allocation to go on from."""

from __future__ import annotations

from collections.abc import Mapping

from rverror.base.numbers import brief
from rverror.base.text import printable
from rverror.base.toml import quoted
from rverror.base.units import DISPLAY_UNITS, parse, to_display
from rverror.lots.result import Interval, Lot, MadeBy, sizes_of
from rverror.model.catalogue import source
from rverror.tolerances.declared import Tolerance
from rverror.tolerances.distribution import Normal, Rayleigh

_BOUNDS = "\n# Not above zero; without the signs in front these bound what `diagnose --prior` takes to be usual:"


def tolerances_as_made(result: Lot) -> str:
    """Text of a tolerance file whose standard deviations are those of the processes that are told from none.

    Parameters
    ----------
    result : Lot

    Returns
    -------
    str
        TOML, as `load_tolerances` reads it: of a capability of 1, T is three standard deviations of a scalar, and of
        a vector the length that 0.27 % exceed.  Behind it, as comments, processes that are not told from none, with
        the upper ends of their intervals: a budget does without them, a prior of `diagnose` gains by them.  Empty
        where no process is above zero.
    """
    tables = [
        _table(one, one.deviation, sizes_of(result.shifts, one.key, one.indices))
        for one in result.processes
        if one.above_zero and one.deviation is not None
    ]
    if not tables:
        return ""
    head = f"# as made: standard deviations of {result.units} units of {result.model}, with their 95 % intervals"
    lines = [printable(head), *(line for table in tables for line in table)]
    others = [(one, one.deviation.high) for one in result.processes if one.deviation and not one.above_zero]
    if others:
        lines.append(_BOUNDS)
    for one, most in others:
        lines += [f"# {line}".rstrip() for line in _table(one, Interval(most, 0.0, most), {})]
    return "\n".join(lines) + "\n"


def _table(process: MadeBy, deviation: Interval, means: Mapping[str, float]) -> list[str]:
    """Lines of one ``[[tolerance]]``: Rayleigh where the parameters are vectors, else normal."""
    every, dimension = source(process.key).parameters, process.dimension
    chosen = [p for p in every if p.name in process.parameters]
    possible = {p.name: max(0.0, p.least + 1) for p in chosen}
    one = Tolerance(process.key, 1.0, Normal(), process.indices, process.parameters, possible)
    law = Rayleigh() if one.in_vectors else Normal()
    width = _sized(deviation.value / law.sigma, dimension, ".4g")
    # where a size has a least value, the mean keeps it above
    middle = {p.name: max(means.get(p.name, 0.0), p.least + parse(width, dimension)) for p in chosen}
    size, low, high = (brief(to_display(x, dimension)) for x in (deviation.value, deviation.low, deviation.high))
    lines = ["", "[[tolerance]]", f"key = {quoted(process.key)}"]
    if process.indices:
        indices = {name: quoted(at) if isinstance(at, str) else str(at) for name, at in process.indices.items()}
        lines.append(f"indices = {_inline(indices)}")
    if len(chosen) < len(every):
        lines.append(f"parameters = [{', '.join(map(quoted, process.parameters))}]")
    said = f"standard deviation {size} {DISPLAY_UNITS[dimension]}, 95 % interval {low} to {high}"
    lines += [f"tolerance = {quoted(width)}  # {said}", f"distribution = {quoted(law.name)}"]
    if any(middle.values()):
        lines.append(f"mean = {_inline({n: quoted(_sized(x, dimension, '.6g')) for n, x in middle.items() if x})}")
    if process.tolerance:
        lines.append(printable(f"# tolerance of the drawing: {process.tolerance}"))
    if process.alike:
        lines.append(printable(f"# not told apart, and in it: {', '.join(process.alike)}"))
    return lines


def _inline(items: Mapping[str, str]) -> str:
    return "{ " + ", ".join(f"{name} = {value}" for name, value in items.items()) + " }"


def _sized(value: float, dimension: str, digits: str) -> str:
    return f"{to_display(value, dimension):{digits}} {DISPLAY_UNITS[dimension]}"
