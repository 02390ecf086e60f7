"""Hypothesis profiles: no deadline on shared machines, the same examples every time in continuous integration."""

from __future__ import annotations

import os

from hypothesis import HealthCheck, settings

# speed is no test: a busy machine is no failure
_ANY_SPEED = [HealthCheck.too_slow]
settings.register_profile("rverror", deadline=None, max_examples=25, suppress_health_check=_ANY_SPEED)
settings.register_profile(
    "ci", deadline=None, max_examples=25, derandomize=True, database=None, suppress_health_check=_ANY_SPEED
)
settings.load_profile("ci" if os.environ.get("CI") else "rverror")
