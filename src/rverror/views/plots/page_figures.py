"""The pictures of a result: on its page, and all in one figure."""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from rverror.base.errors import InputError
from rverror.diagnosis.result import Diagnosis
from rverror.geartrain.mechanism import Reducer
from rverror.model.catalogue import CATALOGUE
from rverror.model.effects import Model
from rverror.statics.duty import DutyEfficiency
from rverror.statics.friction import Efficiency
from rverror.views.plots.drawing import ON_PAGE, draw, pictures_of
from rverror.views.plots.figure import Figure, bare_figure
from rverror.views.plots.mechanism_view import mechanism
from rverror.views.plots.under_load import losses
from rverror.views.plots.zoomable import figure_element

_PAGE_ALONE = "residual"  # which one figure of all has no room for
_MOST_RUNS = 4
_WIDTH, _HEIGHT = 9.0, 3.6  # inches of a row


def figures_of(result: Any, **options: Any) -> Iterator[str]:
    """Figures of a page; plots for which a result has nothing to show are left out.

    Parameters
    ----------
    result
        One of the kinds of `drawing.PICTURES`; there is no picture of another.
    **options
        Of plots that take them: the `limit` of a distribution.
    """
    return (figure_element(figure, number) for number, figure in enumerate(_figures(result, options)))


def figure_of(result: Any, **options: Any) -> Figure:
    """One figure of a result, its plots in rows.

    Parameters
    ----------
    result, **options
        As of `figures_of`.
    """
    figure, rows = bare_figure(_WIDTH, _HEIGHT), []
    for kind, given in _plots(result, options):
        if kind != _PAGE_ALONE:
            ax = figure.add_subplot()
            try:
                rows.append(draw(result, ax, kind=kind, **given))
            except InputError:  # nothing of the kind
                ax.remove()
    figure.set_size_inches(_WIDTH, _HEIGHT * len(rows))
    grid = figure.add_gridspec(len(rows), 1)
    for row, ax in enumerate(rows):
        ax.set_subplotspec(grid[row, 0])
    return figure


def _figures(result: Any, options: Mapping[str, Any]) -> Iterator[Figure]:
    if isinstance(result, Diagnosis):
        yield from _causes(result)
    loads = result.phases if isinstance(result, DutyEfficiency) else result
    if isinstance(loads, Sequence) and loads and all(isinstance(one, Efficiency) for one in loads):
        yield losses(loads[0], beside=loads[1:]).figure  # type: ignore[misc]
    for kind, given in _plots(result, options):
        try:
            yield draw(result, kind=kind, **given).figure  # type: ignore[misc]
        except InputError:  # nothing of the kind
            continue


def _plots(result: Any, options: Mapping[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Kind and options of each plot that shows a result, one for each of its first runs."""
    own, runs = pictures_of(result), len(getattr(result, "traces", ()))
    for kind in ON_PAGE.get(type(result).__name__, tuple(own)[:1]):
        taken = inspect.signature(own[kind]).parameters
        given = {name: value for name, value in options.items() if name in taken}
        if "run" in taken:
            yield from ((kind, given | {"run": run}) for run in range(min(runs, _MOST_RUNS)))
        else:
            yield kind, given


def _causes(found: Diagnosis) -> Iterator[Figure]:
    """The reducer with the causes that were found, as error vectors at their contacts."""
    unit = found.declared.mechanism
    added = [one.effect for one in found.added if one.effect.key in CATALOGUE]
    at_contacts = tuple(effect for effect in added if CATALOGUE[effect.key].acts == "contacts")
    if at_contacts and isinstance(unit, Reducer):
        yield mechanism(Model(unit, at_contacts, found.declared.name)).figure  # type: ignore[misc]
