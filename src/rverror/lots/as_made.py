"""A lot as a tolerance file: what its processes made, for budgets and allocation to go on from."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from rverror.base.numbers import brief
from rverror.base.text import printable
from rverror.base.toml import quoted
from rverror.base.units import DISPLAY_UNITS, parse, to_display
from rverror.geartrain.source import IndexValue
from rverror.lots.result import Interval, Lot, MadeBy
from rverror.model.catalogue import source
from rverror.tolerances.declared import Tolerance
from rverror.tolerances.distribution import Normal, Rayleigh


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
    made = [
        _AsMade(one, one.deviation, _means(result, one)) for one in result.processes if one.above_zero and one.deviation
    ]
    if not made:
        return ""
    head = f"# as made: standard deviations of {result.units} units of {result.model}, with their 95 % intervals"
    return "\n".join([printable(head), *(line for one in made for line in one.lines()), *_bounds(result)]) + "\n"


def _bounds(result: Lot) -> Iterator[str]:
    """Comments that state how much the other processes make at most."""
    others = [(one, one.deviation.high) for one in result.processes if one.deviation and not one.above_zero]
    if others:
        yield "\n# Not above zero; without the signs in front these bound what `diagnose --prior` takes to be usual:"
    for one, most in others:
        yield from (f"# {line}".rstrip() for line in _AsMade(one, Interval(most, 0.0, most), {}).lines())


def _means(result: Lot, one: MadeBy) -> dict[str, float]:
    """Systematic errors of all parts of a process, by parameter."""
    return {
        shift.parameter: shift.size.value
        for shift in result.shifts
        if (shift.key, dict(shift.indices)) == (one.key, dict(one.indices)) and shift.parameter in one.parameters
    }


@dataclass(frozen=True)
class _AsMade:
    """One table of the file."""

    process: MadeBy
    deviation: Interval
    means: Mapping[str, float]

    @property
    def parameters(self) -> tuple[str, ...]:
        """Those that are chosen; none where all are."""
        every = [p.name for p in source(self.process.key).parameters]
        return () if set(every) == set(self.process.parameters) else self.process.parameters

    def lines(self) -> Iterator[str]:
        unit, law = DISPLAY_UNITS[self.process.dimension], self._law()
        size, low, high = (brief(to_display(x, self.process.dimension)) for x in _ends(self.deviation))
        yield ""
        yield "[[tolerance]]"
        yield f"key = {quoted(self.process.key)}"
        if self.process.indices:
            inside = ", ".join(f"{name} = {_value(value)}" for name, value in self.process.indices.items())
            yield f"indices = {{ {inside} }}"
        if self.parameters:
            yield f"parameters = [{', '.join(map(quoted, self.parameters))}]"
        width = _rounded(self.deviation.value / law.sigma, self.process.dimension)
        yield f"tolerance = {quoted(width)}  # standard deviation {size} {unit}, 95 % interval {low} to {high}"
        yield f"distribution = {quoted(law.name)}"
        means = self._means(parse(width, self.process.dimension))
        if means:
            inside = ", ".join(
                f'{name} = "{to_display(value, self.process.dimension):.6g} {unit}"' for name, value in means.items()
            )
            yield f"mean = {{ {inside} }}"
        for line in self._remarks():
            yield printable(f"# {line}")

    def _law(self) -> Normal:
        """Rayleigh where the parameters are vectors, else normal."""
        above = {p.name: p.least + 1 for p in source(self.process.key).parameters if p.name in self.process.parameters}
        means = {name: max(0.0, mean) for name, mean in above.items()}
        one = Tolerance(self.process.key, 1.0, Normal(), self.process.indices, self.parameters, means)
        return Rayleigh() if one.in_vectors else Normal()

    def _means(self, width: float) -> dict[str, float]:
        """Systematic errors, and where a size has a least value, what keeps it above."""
        found = {}
        for item in source(self.process.key).parameters:
            if item.name not in self.process.parameters:
                continue
            mean = max(self.means.get(item.name, 0.0), item.least + width)
            if mean:
                found[item.name] = mean
        return found

    def _remarks(self) -> Iterator[str]:
        if self.process.tolerance:
            yield f"tolerance of the drawing: {self.process.tolerance}"
        if self.process.alike:
            yield f"not told apart, and in it: {', '.join(self.process.alike)}"


def _ends(deviation: Interval) -> tuple[float, float, float]:
    return deviation.value, deviation.low, deviation.high


def _rounded(value: float, dimension: str) -> str:
    """Size with its unit, to four digits."""
    assert math.isfinite(value)
    return f"{to_display(value, dimension):.4g} {DISPLAY_UNITS[dimension]}"


def _value(value: IndexValue) -> str:
    return quoted(value) if isinstance(value, str) else str(value)
