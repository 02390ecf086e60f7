"""Compensation: what is added to the command of the input so that the output goes where it is told."""

from typing import TYPE_CHECKING

from rverror.base.lazy import attach

if TYPE_CHECKING:
    from rverror.compensation.correction import Correction as Correction
    from rverror.compensation.making import compensate as compensate
    from rverror.compensation.outcome import Compensation as Compensation
    from rverror.compensation.table_files import (
        load_compensation as load_compensation,
        save_compensation as save_compensation,
    )
else:
    __getattr__, __dir__ = attach(__name__)
