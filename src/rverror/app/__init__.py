"""The command line."""

from typing import TYPE_CHECKING

from rverror.base.lazy import attach

if TYPE_CHECKING:
    from rverror.app.batch import diagnose_folder as diagnose_folder
else:
    __getattr__, __dir__ = attach(__name__)
