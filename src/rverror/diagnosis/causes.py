"""What a cause is called: its source, and the place at which it acts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from rverror.geartrain.source import IndexValue
from rverror.model.effects import Effect

#: Key and indices.
Named = tuple[str, Mapping[str, IndexValue]]


def identity(name: Named) -> tuple[object, ...]:
    """Key and indices, to compare."""
    return (name[0], *sorted(name[1].items()))


def caused(name: Named, sizes: Iterable[float]) -> Effect:
    """Effect of a key and indices, of some sizes."""
    return Effect(name[0], dict(name[1]), tuple(map(float, sizes)))


def named(effect: Effect) -> tuple[object, ...]:
    """`identity` of an effect."""
    return identity((effect.key, effect.indices))
