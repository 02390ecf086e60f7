"""Parts sorted into classes and matched by them: selective assembly.  Page ``theory/budget.md``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from rverror.base.errors import InputError
from rverror.base.text import shown

#: Most classes; at so many two parts of one class are the same size but for a thousandth.
MOST_CLASSES = 1000


@dataclass(frozen=True)
class SelectedFit:
    """Parts that are matched with those of another tolerance: a place of a unit gets both from one class.

    Attributes
    ----------
    other : str
        Name or key of the other tolerance; places are matched by the indices that both have.
    classes : int
        Classes of equal number into which the parts of either are sorted by size, 2 or more.
    opposite : bool
        Whether the largest go with the smallest.

    Raises
    ------
    InputError
        If there are too few or too many classes.
    """

    other: str
    classes: int
    opposite: bool = False

    def __post_init__(self) -> None:
        """Check the classes."""
        check_classes("fit", self.classes, least=2)


def fit_of(said: Any) -> SelectedFit:
    """Make a fit from ``{"with": "bores", "classes": 3, "opposite": True}``, as tolerance files have it.

    Raises
    ------
    InputError
        If it is neither that nor a `SelectedFit`.
    """
    if isinstance(said, SelectedFit):
        return said
    example = "write fit = { with = 'bores', classes = 3 }, and opposite = true where the largest go with the smallest"
    if not isinstance(said, Mapping) or not {"with", "classes"} <= said.keys() <= {"with", "classes", "opposite"}:
        raise InputError(f"fit = {shown(said)}: must say with and classes; {example}")
    other, opposite = said["with"], said.get("opposite", False)
    if not isinstance(other, str) or not isinstance(opposite, bool):
        raise InputError(f"fit = {shown(said)}: with is a name or a key, opposite true or false; {example}")
    return SelectedFit(other, said["classes"], opposite)


def check_classes(what: str, classes: int, *, least: int = 1) -> None:
    """Refuse what is no number of classes.

    Parameters
    ----------
    what : str
        What has them, for the message.
    classes : int
    least : int

    Raises
    ------
    InputError
    """
    whole = isinstance(classes, int) and not isinstance(classes, bool)
    if not whole or not least <= classes <= MOST_CLASSES:
        raise InputError(
            f"{what}: classes = {classes}: must be a whole number from {least} to {MOST_CLASSES}; beyond that give "
            "correlation = 1"
        )
