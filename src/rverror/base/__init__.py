"""Ground: arrays and vectors, units, errors, text and TOML files, chance."""

from typing import TYPE_CHECKING

from rverror.base.lazy import attach

if TYPE_CHECKING:
    from rverror.base.errors import InputError as InputError
    from rverror.base.text import describe as describe
    from rverror.base.units import ARCSEC as ARCSEC, to_core as to_core, to_display as to_display
else:
    __getattr__, __dir__ = attach(__name__)
