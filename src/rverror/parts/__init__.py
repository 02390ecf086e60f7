"""Measured parts: what measuring machines say of cranks, discs, pins and housings, as errors of the catalogue."""

from typing import TYPE_CHECKING

from rverror.base.lazy import attach

if TYPE_CHECKING:
    from rverror.parts.measured import MeasuredPart as MeasuredPart
    from rverror.parts.parts_table import save_parts as save_parts
    from rverror.parts.reading import PartsRead as PartsRead, load_parts as load_parts
    from rverror.parts.unit import (
        UnitError as UnitError,
        places_in_list as places_in_list,
        unit_error as unit_error,
        unit_of_parts as unit_of_parts,
    )
else:
    __getattr__, __dir__ = attach(__name__)
