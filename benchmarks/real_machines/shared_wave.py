"""The wave that all units of a lot share, tried on units that were not in it.

python benchmarks/real_machines/shared_wave.py DRIVE.toml LOT OTHERS
"""

from __future__ import annotations

import argparse

import numpy as np

import rverror


def main() -> None:
    """Tell the lot's shared orders, and what taking them off leaves of each other unit."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("model", metavar="DRIVE.toml")
    options.add_argument("lot", metavar="LOT", help="folder of units, as for rverror lot")
    options.add_argument("others", metavar="OTHERS", help="folder of other units, three or more")
    given = options.parse_args()
    model = rverror.load_model(given.model)
    found = rverror.lots.lot_of_drives(model, rverror.lots.lot_inputs(given.lot, model).amplitudes())
    others = rverror.lots.lot_inputs(given.others, model).amplitudes()
    parts = others.values.reshape(len(others.serials), len(others.conditions), 2, -1) * np.sqrt(2)
    waves = parts[:, :, 0] - 1j * parts[:, :, 1]
    conditions = [str(one) for one in others.conditions]
    for one in found.orders:
        if not one.shared:
            continue
        mean = one.mean.value * np.exp(1j * one.phase)
        seen = waves[:, conditions.index(one.condition), one.order - 1]
        print(f"order {one.order}, {one.condition}: {one.mean.value / rverror.ARCSEC:.1f} arcsec at "
              f"{np.degrees(one.phase):.0f} deg in the lot")  # fmt: skip
        for serial, wave in zip(others.serials, seen, strict=True):
            print(f"    {serial}: {abs(wave) / rverror.ARCSEC:.1f} arcsec at {np.degrees(np.angle(wave)):.0f} deg, "
                  f"{abs(wave - mean) / rverror.ARCSEC:.1f} without the lot's wave")  # fmt: skip


if __name__ == "__main__":
    main()
