# %% [markdown]
# # Virtual RV-40E on a cluster
#
# A tolerance stack of an RV-40E, drawn in this process and on a Dask cluster of two worker processes: any executor of
# the standard library's kind computes the chunks, and the numbers are the same to the last bit.  A cluster of many
# machines is used in the same way: `Client("tcp://scheduler:8786")` in place of the local one, rverror installed on
# its workers.  Needs `pip install "dask[distributed]"`; without it, only the first part runs.

# %%
import os
import sys
import tempfile

# Many small matrix products: BLAS threads wait on one another.  Read as numpy is loaded; Dask does it by itself.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")

import numpy as np  # noqa: E402

import rverror  # noqa: E402
from rverror import ARCSEC  # noqa: E402

COUNT = 2000

unit = rverror.Model(rverror.reducer("RV-40E"))
tolerances = (
    rverror.tolerance("crank.eccentricity", "5 um"),
    rverror.tolerance("cycloid.disc_bore_position", "5 um"),
    rverror.tolerance("cycloid.disc_pitch", "4 um", harmonic=(1, 2), correlation=0.5),
    rverror.tolerance("cycloid.pin_position", "5 um"),
    rverror.tolerance("sensor.encoder_eccentricity", "5 arcsec"),
)
parts = rverror.tolerances.stack(unit, tolerances)


def told(units: rverror.tolerances.VirtualUnits) -> None:
    """P50, P95 and P99 of the peak-to-peak, and the yield at 40 arcsec."""
    for probability in (0.5, 0.95, 0.99):
        found = units.quantile(probability)
        low, value, high = (size / ARCSEC for size in (found.low, found.value, found.high))
        print(f"  P{100 * probability:<3g}{value:7.2f} arcsec ({low:.2f} to {high:.2f})")
    share = units.yield_at(40 * ARCSEC)
    print(f"  within 40 arcsec: {100 * share.value:.1f} % ({100 * share.low:.1f} to {100 * share.high:.1f})")


def on_a_cluster() -> tuple[rverror.tolerances.VirtualUnits, rverror.tolerances.VirtualUnits] | None:
    """The same units by a cluster, its chunks kept in a folder; then from the folder alone."""
    try:
        from distributed import Client, LocalCluster
    except ModuleNotFoundError:
        return None
    with (
        tempfile.TemporaryDirectory() as folder,
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):
        units = rverror.tolerances.virtual_units(parts, COUNT, executor=client.get_executor(), folder=folder)
        return units, rverror.tolerances.virtual_units(parts, COUNT, folder=folder)


# %% [markdown]
# A script whose workers are processes keeps its work below this line: they import the script too.

# %%
if __name__ == "__main__":
    here = rverror.tolerances.virtual_units(parts, COUNT)
    print(f"{here.count} virtual RV-40E, {parts.influence.shape[0]} part errors:")
    told(here)
    answer = on_a_cluster()
    if answer is None:
        print('no cluster: pip install "dask[distributed]"', file=sys.stderr)
    else:
        cluster, kept = answer
        equal = all(np.array_equal(cluster.peak_to_peak, units.peak_to_peak) for units in (here, kept))
        print(f"on a cluster of two processes: {'the same numbers' if equal else 'OTHER NUMBERS'}")
        print(f"from its folder: {kept.kept} chunks kept")
