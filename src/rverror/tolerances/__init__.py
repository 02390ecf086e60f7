"""Tolerances: budgets, very many virtual units, and what the tolerances should be."""

from typing import TYPE_CHECKING

from rverror.base.lazy import attach

if TYPE_CHECKING:
    from rverror.tolerances import cost as cost, distribution as distribution
    from rverror.tolerances.allocation import (
        allocate as allocate,
        allocate_at_load as allocate_at_load,
        cost_front as cost_front,
    )
    from rverror.tolerances.allocation_result import Allocation as Allocation, FrontPoint as FrontPoint
    from rverror.tolerances.closed_form import Budget as Budget, budget as budget
    from rverror.tolerances.declared import Tolerance as Tolerance, tolerance as tolerance
    from rverror.tolerances.full_budget import ErrorBudget as ErrorBudget, error_budget as error_budget
    from rverror.tolerances.sampling import VirtualUnits as VirtualUnits, virtual_units as virtual_units
    from rverror.tolerances.specification import Limit as Limit, limit as limit
    from rverror.tolerances.stacking import Stack as Stack, stack as stack
    from rverror.tolerances.tolerance_file import load_tolerances as load_tolerances, save_widths as save_widths
else:
    __getattr__, __dir__ = attach(__name__)
