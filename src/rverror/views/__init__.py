"""What people see of results: text, JSON, pages, tables and plots."""

from typing import TYPE_CHECKING

from rverror.base.lazy import attach

if TYPE_CHECKING:
    from rverror.views.describing import input_files as input_files
    from rverror.views.plots.drawing import draw as draw
    from rverror.views.plots.figure import new_figure as new_figure
    from rverror.views.plots.spectra import order_map as order_map
    from rverror.views.plots.style import line_style as line_style
    from rverror.views.report import (
        to_csv as to_csv,
        to_html as to_html,
        to_json as to_json,
        to_text as to_text,
        to_xlsx as to_xlsx,
    )
    from rverror.views.tables import to_pandas as to_pandas, to_xarray as to_xarray
else:
    __getattr__, __dir__ = attach(__name__)
