"""Parts of an RV-40E with influences at random, for what a lot tells of its units."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np

import rverror
from rverror.base.arrays import Array
from rverror.lots.processes import UnitParts, processes_of

UM = 1e-3


@cache
def parts() -> UnitParts:
    model = rverror.Model(rverror.reducer("RV-40E"))
    theta = np.linspace(0, 2 * np.pi, 400)
    run = rverror.run_from_arrays(
        output_angle=theta, input_angle=121 * theta, direction="forward", torque=20e3, ratio=model
    )
    return UnitParts(processes_of(model, run))


@dataclass(frozen=True)
class RandomUnits:
    """Units of so many amplitudes; a tenth of a workshop's spread, of cams 1 um, makes a share of the noise."""

    amplitudes: int
    share: float

    @cached_property
    def influence(self) -> Array:
        of = np.random.default_rng(0).standard_normal((self.amplitudes, len(parts().process)))
        return np.asarray(of / (0.1 * parts().plausible) * self.share)

    @cached_property
    def spread(self) -> Array:
        """Covariance of a unit."""
        of = self.influence * 0.1 * parts().plausible
        return np.asarray(np.eye(self.amplitudes) + of @ of.T)

    @cached_property
    def weight(self) -> Array:
        return np.asarray(np.linalg.inv(self.spread))

    def drawn(self, seed: int | np.random.Generator, count: int) -> Array:
        normal = np.random.default_rng(seed).standard_normal((count, self.amplitudes))
        return np.asarray(normal @ np.linalg.cholesky(self.spread).T)
