"""Processes: classes of part errors of which all instances share one standard deviation.

Page ``theory/lots.md``.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.base.text import describe
from rverror.geartrain.mechanism import Reducer
from rverror.geartrain.source import IndexValue, Known, Parameter, Source, rv
from rverror.model.catalogue import CATALOGUE, source
from rverror.model.effects import Model
from rverror.tolerances.declared import Tolerance
from rverror.tolerances.loaded_units import Instance

_HARMONICS = 2  # of waves over a part, where no tolerances name them: runout and ovality


@dataclass(frozen=True)
class Process:
    """A class of part errors: one source, all parts of a kind.

    Attributes
    ----------
    key : str
        A key of the catalogue.
    indices : mapping of str to int or str
        What is not a matter of which part it is: the harmonic of a wave.
    instances : tuple of mapping
        The parts: whole sets of indices.
    parameters : tuple of Parameter
        Components that share the standard deviation.
    tolerance : Tolerance, optional
        Of the drawing.
    """

    key: str
    indices: Mapping[str, IndexValue]
    instances: tuple[Mapping[str, IndexValue], ...]
    parameters: tuple[Parameter, ...]
    tolerance: Tolerance | None = None

    @property
    def label(self) -> str:
        """Its name for people."""
        return label_of(self.key, self.indices, [p.name for p in self.parameters])

    @property
    def plausible(self) -> float:
        """Standard deviation of a workshop, core unit: a third of the largest size that surprises no one."""
        return self.parameters[0].plausible / 3


def label_of(key: str, indices: Mapping[str, IndexValue], parameters: Sequence[str]) -> str:
    """Source and place, with its parameters where not all of the source's are meant."""
    named = describe(key, indices)
    return f"{named} {', '.join(parameters)}" if len(parameters) < len(source(key).parameters) else named


@dataclass(frozen=True)
class UnitParts:
    """All parts of a unit whose errors vary from unit to unit, as components of one vector.

    Attributes
    ----------
    processes : tuple of Process
    """

    processes: tuple[Process, ...]

    @cached_property
    def effects(self) -> tuple[Instance, ...]:
        """Each part of each process, with where its components stand among the parameters of its source."""
        found, places = list[Instance](), itertools.count()
        for process in self.processes:
            names = [p.name for p in source(process.key).parameters]
            own = [names.index(p.name) for p in process.parameters]
            for indices in process.instances:
                found.append(Instance(process.key, dict(indices), tuple((at, next(places)) for at in own)))
        return tuple(found)

    @cached_property
    def process(self) -> npt.NDArray[np.intp]:
        """Process of each component, shape (p,)."""
        return np.repeat(np.arange(len(self.processes)), [len(p.instances) * len(p.parameters) for p in self.processes])

    @cached_property
    def effect(self) -> npt.NDArray[np.intp]:
        """Effect of each component, shape (p,)."""
        return np.repeat(np.arange(len(self.effects)), [len(one.at) for one in self.effects])

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameter of each component."""
        return tuple(p for process in self.processes for _ in process.instances for p in process.parameters)

    @cached_property
    def least(self) -> Array:
        """Least value of each component."""
        return np.array([p.least for p in self.parameters])

    @cached_property
    def plausible(self) -> Array:
        """Standard deviation of a workshop, core units, shape (p,)."""
        return np.array([self.processes[at].plausible for at in self.process])

    @cached_property
    def middle(self) -> Array:
        """Mean of each component by the drawing, none where it says none, core units, shape (p,)."""
        of = [self.processes[at].tolerance for at in self.process]
        return np.array(
            [0.0 if t is None else t.mean.get(p.name, 0.0) for t, p in zip(of, self.parameters, strict=True)]
        )

    def shifted(self, key: str, indices: Mapping[str, IndexValue], sizes: Mapping[str, float]) -> Array:
        """Errors of all components if parts with some indices are shifted alike, each parameter by its size, (p,)."""
        same = np.array([e.key == key and indices.items() <= e.indices.items() for e in self.effects])[self.effect]
        by = np.array([sizes.get(parameter.name, 0.0) for parameter in self.parameters])
        return np.where(same, by, 0.0)


def processes_of(model: Model, run: Known, tolerances: Iterable[Tolerance] | None = None) -> tuple[Process, ...]:
    """Processes whose parts a run can show: of the drawing's tolerances, or all of the catalogue.

    Parameters
    ----------
    model : Model
    run : Known
        What is known beside the angles.
    tolerances : iterable of Tolerance, optional

    Returns
    -------
    tuple of Process

    Raises
    ------
    InputError
        If two tolerances are about the same parts.
    """
    unit = rv(model.mechanism)
    if tolerances is not None:
        found = [p for one in tolerances for p in _by_harmonic(one.key, one.instances(unit), one.chosen, one)]
        _check_once(found)
        return tuple(found)
    found = []
    for entry in CATALOGUE.values():
        varied = tuple(p for p in entry.parameters if p.dimension in ("length", "angle") and p.least < 0)
        random = entry.in_lots and entry.tried and entry.periodic and varied  # from part to part
        if random and entry.applies_to(unit) and not entry.lacks(unit, run):
            found += processes_of_source(entry, unit, varied)
    return tuple(one for one in found if one.indices.get("harmonic", 1) in range(1, _HARMONICS + 1))


def processes_of_source(entry: Source, unit: Reducer, parameters: tuple[Parameter, ...]) -> list[Process]:
    """A process for each harmonic of a source that diagnosis tries, of all parts of its kind.

    Parameters
    ----------
    entry : Source
    unit : Reducer
    parameters : tuple of Parameter
        That vary.

    Returns
    -------
    list of Process
    """
    names = [index.name for index in entry.indices]
    tried = itertools.product(*([value for value in index.tried(unit) if value != "all"] for index in entry.indices))
    return _by_harmonic(entry.key, [dict(zip(names, some, strict=True)) for some in tried], parameters)


def _by_harmonic(
    key: str,
    instances: Iterable[Mapping[str, IndexValue]],
    parameters: tuple[Parameter, ...],
    tolerance: Tolerance | None = None,
) -> list[Process]:
    """A process for each harmonic that instances of a source have."""
    groups: dict[IndexValue | None, list[Mapping[str, IndexValue]]] = {}
    for indices in instances:
        groups.setdefault(indices.get("harmonic"), []).append(indices)
    return [
        Process(key, {} if harmonic is None else {"harmonic": harmonic}, tuple(some), parameters, tolerance)
        for harmonic, some in groups.items()
    ]


def _check_once(processes: Sequence[Process]) -> None:
    places = [
        (process.key, tuple(sorted(indices.items())), parameter.name)
        for process in processes
        for indices in process.instances
        for parameter in process.parameters
    ]
    for (key, indices, _), count in Counter(places).items():
        if count > 1:
            raise InputError(
                f"tolerances: {describe(key, dict(indices))} has two; a lot tells one spread of each: leave one out"
            )
