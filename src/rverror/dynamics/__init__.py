"""Dynamics: natural modes of the loaded gear train, its output error at speed, and its motion in time."""

from typing import TYPE_CHECKING

from rverror.base.lazy import attach

if TYPE_CHECKING:
    from rverror.dynamics.at_speed import (
        CriticalSpeed as CriticalSpeed,
        SpeedResponse as SpeedResponse,
        speed_response as speed_response,
    )
    from rverror.dynamics.natural_modes import Modes as Modes, modes as modes
    from rverror.dynamics.running_up import RunUp as RunUp, run_up as run_up
else:
    __getattr__, __dir__ = attach(__name__)
