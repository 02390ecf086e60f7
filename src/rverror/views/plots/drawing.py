"""Every plot one call away: `draw` finds the picture of a result; the plots themselves are in rooms of their own.

Axes in, axes out.  matplotlib comes with the extra ``plot``.
"""

from __future__ import annotations

import inspect
import tomllib
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from typing import Any

from rverror.base.errors import InputError
from rverror.base.text import did_you_mean
from rverror.views.html import shipped
from rverror.views.plots.figure import Axes

_TABLES = tomllib.loads(shipped("pictures.toml"))
#: Plots of each kind of result by name, the usual one first; the kinds by the names of their classes.
PICTURES: Mapping[str, Mapping[str, str]] = _TABLES["plots"]
#: Plots that show a kind of result; of any other the usual one.
ON_PAGE: Mapping[str, Sequence[str]] = _TABLES["page"]


def pictures_of(thing: Any) -> Mapping[str, Callable[..., Axes]]:
    """Plots of what kind a thing is; none of another."""
    names = (kind.__name__ for kind in type(thing).__mro__)
    found = next((PICTURES[name] for name in names if name in PICTURES), {})
    places = ((kind, *place.split(".")) for kind, place in found.items())
    return {kind: getattr(import_module(f"rverror.views.plots.{module}"), name) for kind, module, name in places}


def draw(thing: Any, ax: Axes | None = None, *, kind: str | None = None, **options: Any) -> Axes:
    """Draw a result.

    Parameters
    ----------
    thing : Model or Run or Diagnosis or other result
        One of the kinds of `PICTURES`; each of them has it as its method ``plot``.
    ax : Axes, optional
        Where to draw; a new figure where left out, which a notebook shows where its cell ends with the plot.
    kind : str, optional
        Which of its plots; the usual one where left out.
    **options
        What that plot takes.  Options of one name mean the same in all of them:

        - `theta`: nominal output angles, rad, which the plot chooses where left out.
        - `direction`: +1 forward, -1 reverse.
        - `time`, `torque`: as `transmission_error` takes them.
        - `ratio`: Reducer, Drive, Model or input turns per output turn; needed of a run that holds input angles.
        - `highest`: highest order to show.
        - `run`: which run of a diagnosis, counted from 0.
        - `limit`: of the peak-to-peak, rad or with a unit, such as ``"60 arcsec"``.

    Returns
    -------
    Axes

    Raises
    ------
    InputError
        If there is no such plot or option, the axes are of the wrong sort, or matplotlib is not installed.

    Examples
    --------
    >>> import rverror
    >>> unit = rverror.Model(rverror.reducer("RV-40E"), (rverror.effect("crank.index", crank=0, angle="1 arcmin"),))
    >>> draw(unit, kind="stacked").get_ylabel()
    'transmission error, arcsec'
    """
    if isinstance(ax, str):
        raise InputError(f"ax = {ax!r}: a plot is chosen by its name, kind={ax!r}; what stands first are axes")
    plots, name = pictures_of(thing), type(thing).__name__
    if not plots:
        raise InputError(f"a {name} has no plot; these have: {', '.join(PICTURES)}; give one of them")
    chosen = next(iter(plots)) if kind is None else kind
    if chosen not in plots:
        hint = did_you_mean(str(chosen), plots)
        raise InputError(f"kind = {chosen!r}: a {name} is drawn as {', '.join(plots)};{hint or ' choose one of them'}")
    taken = [option for option in list(inspect.signature(plots[chosen]).parameters)[1:] if option != "ax"]
    for option in options:
        if option not in taken:
            hint = did_you_mean(option, taken)
            listed = ", ".join(taken) or "no options"
            raise InputError(f"option {option!r}: kind {chosen!r} of a {name} takes {listed};{hint or ' leave it out'}")
    return plots[chosen](thing, ax=ax, **options)
