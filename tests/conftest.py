"""Hypothesis profiles: no deadline on shared machines, the same examples every time in continuous integration."""

from __future__ import annotations

import os

from hypothesis import settings

settings.register_profile("rverror", deadline=None, max_examples=25)
settings.register_profile("ci", deadline=None, max_examples=25, derandomize=True, database=None)
settings.load_profile("ci" if os.environ.get("CI") else "rverror")
