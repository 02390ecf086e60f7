"""A declared effect that does nothing over the runs at hand."""

from __future__ import annotations

import dataclasses

import numpy as np

import rverror
from rverror import effect
from rverror.geartrain import ErrorVector
from rverror.geartrain.kinematics import Pose
from rverror.model.catalogue import extended, source


def nothing(pose: Pose) -> ErrorVector:
    return ErrorVector(contact="output", vector=np.zeros((2, 1, pose.theta.size)))


def test_it_is_left_as_declared_and_hides_nothing() -> None:
    """Its column is zero at every sample: no division by its size, in the search or after it."""
    idle = dataclasses.replace(source("sensor.encoder_eccentricity"), key="sensor.idle", vector=nothing)
    with extended(idle):
        declared = effect("sensor.idle", cos="1 arcsec", uncertainty="1 arcsec")
        model = rverror.Model(rverror.reducer("RV-40E"), (declared,))
        missing = effect("sensor.encoder_eccentricity", cos="20 arcsec")
        runs = rverror.runs.simulate_runs(
            model.with_effects(missing),
            points=1024,
            torques=["20 N*m"],
            noise="0.3 arcsec",
            method="equilibrium",
            seed=2,
        )
        few = rverror.diagnosis.Policy(keys=(missing.key, "sensor.idle", "crank.eccentricity"))
        found = rverror.diagnose(model, runs, policy=few)
    assert [one.effect.key for one in found.added] == [missing.key]
    np.testing.assert_allclose(found.model.effects[0].values, declared.values, rtol=1e-6)
