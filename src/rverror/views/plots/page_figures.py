"""The pictures of a result's page."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Any

from rverror.base.errors import InputError
from rverror.compensation.outcome import Compensation
from rverror.diagnosis.result import Diagnosis
from rverror.geartrain.mechanism import Reducer
from rverror.lots.result import Lot
from rverror.model.catalogue import CATALOGUE
from rverror.model.effects import Model
from rverror.tolerances.allocation_result import Allocation
from rverror.tolerances.full_budget import ErrorBudget
from rverror.views.plots.diagnosed import diagnosis_figure
from rverror.views.plots.drawing import PICTURES, draw
from rverror.views.plots.figure import Figure
from rverror.views.plots.mechanism_view import mechanism
from rverror.views.plots.zoomable import figure_element

#: Plots on the page of a kind of result; of any other the usual one.
_KINDS: Mapping[type, tuple[str, ...]] = MappingProxyType(
    {
        Diagnosis: ("waveform", "residual", "spectrum", "resonances"),
        ErrorBudget: ("contributions", "distribution", "at_load"),
        Allocation: ("widths", "costs", "at_load"),
        Lot: ("processes", "shares", "orders", "predicted"),
        Compensation: ("orders", "waveform"),
    }
)
_EACH_RUN = frozenset({"residual", "spectrum", "waveform", "orders"})  # as far as they take a run
_MOST_RUNS = 4


def figures_of(result: Any, **options: Any) -> Iterator[str]:
    """Figures of a page; plots for which a result has nothing to show are left out.

    Parameters
    ----------
    result
        One of the kinds of `PICTURES`; there is no picture of another.
    **options
        Of plots that take them: the `limit` of a distribution.
    """
    return (figure_element(figure, number) for number, figure in enumerate(_figures(result, options)))


def _figures(result: Any, options: Mapping[str, Any]) -> Iterator[Figure]:
    if isinstance(result, Diagnosis):
        yield from _causes(result)
        if result.shares:
            yield diagnosis_figure(result)
            return
    own = next((PICTURES[one] for one in type(result).__mro__ if one in PICTURES), {})
    for kind in _KINDS.get(type(result), tuple(own)[:1]):
        taken = own[kind].__annotations__ if hasattr(own[kind], "__annotations__") else {}
        given = {name: value for name, value in options.items() if name in taken}
        for run in range(_MOST_RUNS if kind in _EACH_RUN and "run" in taken else 1):
            try:
                ax = draw(result, kind=kind, **(given | ({"run": run} if run else {})))
            except InputError:  # nothing of the kind, or no further run
                break
            yield ax.figure  # type: ignore[misc]


def _causes(found: Diagnosis) -> Iterator[Figure]:
    """The reducer with the causes that were found, as error vectors at their contacts."""
    unit = found.declared.mechanism
    added = [one.effect for one in found.added if one.effect.key in CATALOGUE]
    at_contacts = tuple(effect for effect in added if CATALOGUE[effect.key].acts == "contacts")
    if at_contacts and isinstance(unit, Reducer):
        yield mechanism(Model(unit, at_contacts, found.declared.name)).figure  # type: ignore[misc]
