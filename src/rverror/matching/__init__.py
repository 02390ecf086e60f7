"""Matching: which measured parts to join and how to turn them so that the most units keep their limits."""

from typing import TYPE_CHECKING

from rverror.base.lazy import attach

if TYPE_CHECKING:
    from rverror.matching.matched import match as match
    from rverror.matching.result import Matched as Matched
else:
    __getattr__, __dir__ = attach(__name__)
