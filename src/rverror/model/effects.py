"""A model: a mechanism and the effects that are declared for it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from importlib import import_module
from itertools import chain
from types import MappingProxyType
from typing import Any, cast

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.errors import check_kind, warn_former
from rverror.base.numbers import with_unit
from rverror.base.text import describe
from rverror.base.viewed import Viewed
from rverror.geartrain.kinematics import whole_turn
from rverror.geartrain.mechanism import Drive, Mechanism, Reducer
from rverror.geartrain.source import IndexValue
from rverror.model.catalogue import CATALOGUE, source
from rverror.model.ends import Bench, Encoders
from rverror.model.results import Equilibrium, Influence

_MECHANISM = "give reducer('RV-40E'), a Reducer or a Drive"


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

    def __str__(self) -> str:
        """Key, indices and sizes: ``crank.eccentricity (crank 0, disc 1): radial 5 um``."""
        named = zip(source(self.key).parameters, self.values, strict=True)
        sizes = [f"{parameter.name} {with_unit(value, parameter.dimension)}" for parameter, value in named if value]
        return f"{describe(self.key, self.indices)}: {', '.join(sizes) or '0'}"

    def __repr__(self) -> str:
        """One line."""
        return f"<Effect {self}>"

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

    It is asked by its methods, of one output turn where no angles are given, and grows by effects:

    >>> worn = unit + effect("coupling.bearing_clearance", clearance="3 um")
    >>> unit.transmission_error().shape, worn.influence("30 deg", "crank.index", crank=1).matrix.shape
    ((4096,), (1, 1))
    >>> worn.equilibrium("78 Nm", theta=[0.0, 0.1]).theta.size
    2
    """

    mechanism: Mechanism
    effects: tuple[Effect, ...] = field(default=())
    name: str = ""
    bench: Bench = field(default_factory=Bench)
    encoders: Encoders = field(default_factory=Encoders)

    def __post_init__(self) -> None:
        """Check that each effect fits the mechanism."""
        hint = f"write Model(reducer({self.mechanism!r}), ...)" if isinstance(self.mechanism, str) else _MECHANISM
        check_kind("mechanism", self.mechanism, (Reducer, Drive), hint)
        many = "give them in a tuple, Model(unit, (one, another)), or add them: Model(unit) + one + another"
        check_kind("effects", self.effects, (tuple, list), many)
        object.__setattr__(self, "effects", tuple(self.effects))
        for item in self.effects:
            check_kind("effects: one", item, Effect, "make it with effect('crank.eccentricity', crank=0, ...)")
        check_kind("name", self.name, str, "give a text")
        check_kind("bench", self.bench, Bench, "give a Bench")
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

    def __add__(self, effect: Effect) -> Model:
        """Copy of the model with one effect more."""
        return self.with_effects(effect)

    @property
    def angles(self) -> Array:
        """Angles of one output turn that hold the orders of the mechanism and its effects, rad, shape (n,)."""
        orders = (source(e.key).orders(self.mechanism, e.indices) for e in self.effects)
        return whole_turn(self.mechanism, chain.from_iterable(orders))

    def transmission_error(
        self,
        theta: Any | None = None,
        *,
        direction: Any | None = None,
        time: Any | None = None,
        torque: Any | None = None,
    ) -> Array:
        """Transmission error in closed form, `rverror.transmission_error` of the model.

        Parameters
        ----------
        theta : array_like, str or quantity, shape (n,) or one angle, or OperatingConditions, optional
            Nominal output angle, rad; `angles` where left out.
        direction, time, torque : optional
            As in `rverror.influence`.

        Returns
        -------
        ndarray, shape (n,)
            rad.
        """
        compose = import_module("rverror.model.compose")  # which knows models
        return cast("Array", compose.transmission_error(self, theta, direction=direction, time=time, torque=torque))

    def influence(
        self,
        theta: Any | None = None,
        key: Any = None,
        *,
        direction: Any | None = None,
        time: Any | None = None,
        torque: Any | None = None,
        **indices: IndexValue,
    ) -> Influence:
        """Influence of one source on the output, `rverror.influence` of the mechanism.

        Parameters
        ----------
        theta : array_like, str or quantity, shape (n,) or one angle, or OperatingConditions, optional
            Nominal output angle, rad; one output turn where left out.
        key : str
            A key of the catalogue.
        direction, time, torque : optional
            As in `rverror.influence`.
        **indices
            Which crank, disc, pin, harmonic.

        Returns
        -------
        Influence

        Examples
        --------
        >>> import rverror
        >>> unit = Model(rverror.reducer("RV-40E"))
        >>> unit.influence([0.0, 0.1], "crank.index", crank=0).matrix.shape
        (1, 2)
        """
        if isinstance(theta, str) and theta in CATALOGUE:
            warn_former("model.influence(key, theta)", "model.influence(theta, key)")
            theta, key = key, theta
        compose = import_module("rverror.model.compose")
        conditions = {"direction": direction, "time": time, "torque": torque}
        return cast("Influence", compose.influence(self.mechanism, theta, key, **conditions, **indices))

    def equilibrium(
        self,
        torque: Any | None = None,
        theta: Any | None = None,
        *,
        direction: Any | None = None,
        time: Any | None = None,
    ) -> Equilibrium:
        """Loaded state, `rverror.equilibrium` of the model.

        Parameters
        ----------
        torque : float, str or quantity, optional
            Size of the output torque, N*mm; the reducer's rated torque where left out.
        theta : array_like, str or quantity, shape (n,) or one angle, or OperatingConditions, optional
            Nominal output angle, rad; `angles` where left out.
        direction, time : optional
            As in `rverror.equilibrium`.

        Returns
        -------
        Equilibrium
        """
        statics = import_module("rverror.statics.loaded_state")  # a room above
        return cast("Equilibrium", statics.equilibrium(self, theta, torque=torque, direction=direction, time=time))


def check_model(model: object) -> None:
    """Refuse what is given in place of a model.

    Parameters
    ----------
    model : object

    Raises
    ------
    InputError
    """
    remedy = "give rverror.Model(reducer, effects) or rverror.load_model(path)"
    check_kind("model", model, Model, "write Model(unit)" if isinstance(model, (Reducer, Drive)) else remedy)


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
        If a name is neither index nor parameter of the source, no parameter is given, a value has the wrong unit, or an
        index is one that no mechanism has.  Whether it is one of a unit's own, `Model` and `influence` say.

    Warns
    -----
    UserWarning
        If a plain number is far beyond what a workshop makes: 5 is 5 mm, not 5 um.

    Examples
    --------
    >>> effect("crank.eccentricity", crank=0, disc=1, radial="5 um").values
    (0.005, 0.0)
    """
    entry = source(key)
    known = {index.name: index for index in entry.indices}
    parameters = {parameter.name: parameter for parameter in entry.parameters}
    indices: dict[str, IndexValue] = {}
    values = dict.fromkeys(parameters, 0.0)
    for name, value in named.items():
        if name in known:
            if wrong := known[name].beyond(value):
                raise ValueError(f"{key}: {name} = {value!r}; {wrong}")
            indices[name] = value
        elif name in parameters:
            values[name] = units.named_core(f"{key}: {name}", value, parameters[name].dimension)
            if values[name] < parameters[name].least:
                size = with_unit(values[name], parameters[name].dimension)
                raise ValueError(f"{key}: {name} = {size}: must be {parameters[name].least:g} or more")
            if entry.acts != "marks":  # which stand anywhere
                parameters[name].doubt(f"{key}: {name}", value, values[name])
        else:
            raise ValueError(f"{key}: no index or parameter {name!r}; it takes {', '.join([*known, *parameters])}")
    if not named.keys() & parameters.keys():
        raise ValueError(f"{key}: no parameter given; it takes {', '.join(parameters)}")
    sigma = None
    if uncertainty is not None:
        sigma = units.named_core(f"{key}: uncertainty", uncertainty, entry.parameters[0].dimension)
        if sigma < 0:
            raise ValueError(f"{key}: uncertainty = {uncertainty}: must be 0 or more")
    return Effect(key, MappingProxyType(indices), tuple(values.values()), sigma, origin)
