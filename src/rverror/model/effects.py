"""A model: a mechanism and the effects that are declared for it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

from rverror.base import units
from rverror.base.viewed import Viewed
from rverror.geartrain.mechanism import Drive, Mechanism
from rverror.geartrain.source import IndexValue
from rverror.model.catalogue import source
from rverror.model.ends import Bench, Encoders


@dataclass(frozen=True)
class Effect:
    """One error of one source, with its size.

    Attributes
    ----------
    key : str
        A key of the catalogue.
    indices : mapping of str to int or str
        Which crank, disc, pin, harmonic.
    values : tuple of float
        Size of each parameter of the source, core units (mm, rad, s).
    uncertainty : float, optional
        1 sigma of each component, core units; None where the size is taken as exact.
    origin : str
        Where the effect comes from; empty where it was declared.
    """

    key: str
    indices: Mapping[str, IndexValue]
    values: tuple[float, ...]
    uncertainty: float | None = None
    origin: str = ""

    def __reduce__(self) -> tuple[type[Effect], tuple[Any, ...]]:
        """Pickle by value: a mapping proxy cannot be pickled."""
        return Effect, (self.key, dict(self.indices), self.values, self.uncertainty, self.origin)


@dataclass(frozen=True)
class Model(Viewed):
    """A mechanism with its effects.

    Attributes
    ----------
    mechanism : Reducer or Drive
    effects : tuple of Effect
    name : str
    bench : Bench
        What hangs on both ends of a reducer, for its dynamics.
    encoders : Encoders
        How the bench reads both angles; measured figures then have its uncertainty beside them.

    Raises
    ------
    ValueError
        If an effect's index is not one of the mechanism's, or a drive has a bench.

    Examples
    --------
    >>> from rverror.geartrain.mechanism import reducer
    >>> unit = Model(reducer("RV-40E"), (effect("crank.index", crank=0, angle="2 mrad"),), "unit 17")
    >>> unit.effects[0].values
    (0.002,)
    """

    mechanism: Mechanism
    effects: tuple[Effect, ...] = field(default=())
    name: str = ""
    bench: Bench = field(default_factory=Bench)
    encoders: Encoders = field(default_factory=Encoders)

    def __post_init__(self) -> None:
        """Check that each effect fits the mechanism."""
        if isinstance(self.mechanism, Drive) and self.bench != Bench():
            raise ValueError("[bench] is for the dynamics of a [reducer]; a [drive] has no parts that could move")
        for item in self.effects:
            source(item.key).check_indices(self.mechanism, item.indices)

    @property
    def index_offset(self) -> float:
        """Angle by which the gear's marks are ahead of the bench's zero, rad, of all effects that act on them."""
        return sum((e.values[0] for e in self.effects if source(e.key).acts == "marks"), 0.0)

    def with_effects(self, *effects: Effect) -> Model:
        """Copy of the model with effects appended."""
        return replace(self, effects=(*self.effects, *effects))


def effect(key: str, *, uncertainty: Any | None = None, origin: str = "", **named: Any) -> Effect:
    """Make an effect from a key, its indices and its parameters by name.

    Parameters
    ----------
    key : str
        A key of the catalogue.
    uncertainty : float or str or quantity, optional
        1 sigma of each component.
    origin : str, optional
        Where it comes from.
    **named
        Indices of the source, and its parameters as quantities, strings with a unit, or plain numbers in mm and rad.
        A parameter that is left out is 0.

    Returns
    -------
    Effect

    Raises
    ------
    ValueError
        If a name is neither index nor parameter of the source, no parameter is given, or a value has the wrong unit.

    Examples
    --------
    >>> effect("crank.eccentricity", crank=0, disc=1, radial="5 um").values
    (0.005, 0.0)
    """
    entry = source(key)
    index_names = [index.name for index in entry.indices]
    parameters = {parameter.name: parameter for parameter in entry.parameters}
    indices: dict[str, IndexValue] = {}
    values = dict.fromkeys(parameters, 0.0)
    given = False
    for name, value in named.items():
        if name in index_names:
            indices[name] = value
        elif name in parameters:
            values[name] = units.named_core(f"{key}: {name}", value, parameters[name].dimension)
            if values[name] < parameters[name].least:
                unit = units.DISPLAY_UNITS[parameters[name].dimension]
                size = units.to_display(values[name], parameters[name].dimension)
                raise ValueError(f"{key}: {name} = {size:g} {unit}: must be {parameters[name].least:g} or more")
            given = True
        else:
            raise ValueError(
                f"{key}: no index or parameter {name!r}; it takes {', '.join([*index_names, *parameters])}"
            )
    if not given:
        raise ValueError(f"{key}: no parameter given; it takes {', '.join(parameters)}")
    sigma = None
    if uncertainty is not None:
        sigma = units.named_core(f"{key}: uncertainty", uncertainty, entry.parameters[0].dimension)
        if sigma < 0:
            raise ValueError(f"{key}: uncertainty = {uncertainty}: must be 0 or more")
    return Effect(key, MappingProxyType(indices), tuple(values.values()), sigma, origin)
