"""Lots: what the processes made, told from the measured errors of many finished units."""

from typing import TYPE_CHECKING

from rverror.base.lazy import attach

if TYPE_CHECKING:
    from rverror.lots.as_made import tolerances_as_made as tolerances_as_made
    from rverror.lots.compressed import lot_inputs as lot_inputs
    from rverror.lots.folder import lot_units as lot_units
    from rverror.lots.made import lot as lot
    from rverror.lots.of_drives import DriveLot as DriveLot, lot_of_drives as lot_of_drives
    from rverror.lots.outsider_diagnosis import diagnose_outsiders as diagnose_outsiders
    from rverror.lots.result import Lot as Lot
else:
    __getattr__, __dir__ = attach(__name__)
