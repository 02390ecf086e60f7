"""rverror as a reference for other tools: cases with known answers, and the comparison with them."""

from typing import TYPE_CHECKING

from rverror.base.lazy import attach

if TYPE_CHECKING:
    from rverror.reference.cases import read_case as read_case
    from rverror.reference.comparison import Comparison as Comparison, compare as compare
else:
    __getattr__, __dir__ = attach(__name__)
