"""Pictures and notebook pages of results.

Results are made low in the house, plots and pages above them.  So what can be looked at only knows that there is a way
to draw it: the package's front door, which every import passes, registers the two functions that do it.
"""

from __future__ import annotations

from dataclasses import fields
from functools import singledispatch
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_LONGEST = 110  # letters of a line


@singledispatch
def picture_of(thing: Any, **options: Any) -> Axes:
    """Draw a result; `Viewed` is registered by the front door."""
    raise TypeError(f"{type(thing).__name__}: nothing draws it")


@singledispatch
def page_of(thing: Any) -> str:
    """Small HTML page of a result; `Viewed` is registered by the front door."""
    raise TypeError(f"{type(thing).__name__}: nothing shows it")


@singledispatch
def line_of(thing: Any) -> str:
    """What `repr` says of a result, in one line: its kind, and the sizes of its arrays; `Viewed` as on its page."""
    held = [(item.name, getattr(thing, item.name)) for item in fields(thing)]
    sizes = [f"{name} {value.shape}" for name, value in held if hasattr(value, "shape")]
    parts = [line_of(value) for _, value in held if isinstance(value, OneLine)]
    return f"{type(thing).__name__}: {', '.join((*parts, *sizes))}"


class OneLine:
    """What `repr` and `print` tell in one line, where a dataclass would print every array."""

    def __init_subclass__(cls) -> None:
        """Stand in the class itself before `dataclass` puts its own there."""
        super().__init_subclass__()
        cls.__repr__ = OneLine.__repr__  # type: ignore[method-assign]

    def __repr__(self) -> str:
        """One line."""
        line = line_of(self)
        return f"<{line if len(line) <= _LONGEST else line[: _LONGEST - 3] + '...'}>"


class Viewed(OneLine):
    """What can be looked at: `plot` draws it, a notebook shows it as a table."""

    def plot(self, ax: Axes | None = None, **options: Any) -> Axes:
        """Draw it, as `rverror.draw` does for its kind.

        A notebook whose cell ends with it shows the picture.

        Parameters
        ----------
        ax : Axes, optional
            Where to draw; a new figure where left out.
        **options
            What the plot of this kind takes.

        Returns
        -------
        Axes

        Raises
        ------
        InputError
            If matplotlib is not installed.
        """
        return picture_of(self, ax=ax, **options)

    def _repr_html_(self) -> str:
        return page_of(self)
