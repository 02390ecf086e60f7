"""Pictures and notebook pages of results.

The one room that calls upwards, and only when it is asked to: results are made low in the house, plots and pages above
them, and `model.plot()` has to reach the plot.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class Viewed:
    """What can be looked at: `plot` draws it, a notebook shows it as a table."""

    def plot(self, *, ax: Axes | None = None, **options: Any) -> Axes:
        """Draw it, as `rverror.plot.draw` does for its kind.

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
        from rverror.plot import draw

        return draw(self, ax=ax, **options)

    def _repr_html_(self) -> str:
        from rverror.notebook import page

        return page(self)
