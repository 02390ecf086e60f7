"""Runs: files of measured or simulated angles, their checks, and the virtual test bench."""

from typing import TYPE_CHECKING

from rverror.base.lazy import attach

if TYPE_CHECKING:
    from rverror.runs.bench.draft import draft_mapping as draft_mapping
    from rverror.runs.bench.mapping import load_mapping as load_mapping
    from rverror.runs.faults import Faults as Faults, find_faults as find_faults
    from rverror.runs.measurement import (
        Run as Run,
        load_run as load_run,
        run_from_arrays as run_from_arrays,
        write_run as write_run,
    )
    from rverror.runs.measuring_chain import (
        BenchUncertainty as BenchUncertainty,
        bench_uncertainty as bench_uncertainty,
    )
    from rverror.runs.order_file import (
        load_orders as load_orders,
        orders_from_arrays as orders_from_arrays,
        write_orders as write_orders,
    )
    from rverror.runs.order_fit import order_table_from_runs as order_table_from_runs
    from rverror.runs.order_table import OrderTable as OrderTable
    from rverror.runs.virtual_bench import (
        coloured_noise as coloured_noise,
        simulate as simulate,
        simulate_runs as simulate_runs,
    )
else:
    __getattr__, __dir__ = attach(__name__)
