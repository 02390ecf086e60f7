"""Life: what grows and what jumped in one unit, told from its runs at different times."""

from typing import TYPE_CHECKING

from rverror.base.lazy import attach

if TYPE_CHECKING:
    from rverror.life.compared import compare_runs as compare_runs
    from rverror.life.over_life import trend as trend
    from rverror.life.result import RunsCompared as RunsCompared, Trend as Trend
else:
    __getattr__, __dir__ = attach(__name__)
