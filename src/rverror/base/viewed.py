"""Pictures and notebook pages of results.

Results are made in the lower rooms, pictures and pages of them in `views`, which is loaded when one is asked for.
"""

from __future__ import annotations

from dataclasses import fields
from importlib import import_module
from typing import TYPE_CHECKING, Any, cast

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_LONGEST = 110  # letters of a line


class OneLine:
    """What `repr` and `print` tell in one line, where a dataclass would print every array."""

    def __init_subclass__(cls) -> None:
        """Stand in the class itself before `dataclass` puts its own there."""
        super().__init_subclass__()
        cls.__repr__ = OneLine.__repr__  # type: ignore[method-assign]

    def __repr__(self) -> str:
        """One line."""
        line = self._line()
        return f"<{line if len(line) <= _LONGEST else line[: _LONGEST - 3] + '...'}>"

    def _line(self) -> str:
        """Its kind, and the sizes of its arrays."""
        held = [(item.name, getattr(self, item.name)) for item in fields(self)]  # type: ignore[arg-type]
        sizes = [f"{name} {value.shape}" for name, value in held if hasattr(value, "shape")]
        parts = [value._line() for _, value in held if isinstance(value, OneLine)]
        return f"{type(self).__name__}: {', '.join((*parts, *sizes))}"


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
        return cast("Axes", import_module("rverror.views.plots.drawing").draw(self, ax=ax, **options))

    def _repr_html_(self) -> str:
        return str(import_module("rverror.views.notebook").page(self))

    def _line(self) -> str:
        return str(import_module("rverror.views.notebook").line(self))
