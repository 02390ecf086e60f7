"""The gear train: its geometry and motion, the principle, and the five sub-assemblies with their error sources."""

from typing import TYPE_CHECKING

from rverror.base.lazy import attach

if TYPE_CHECKING:
    from rverror.geartrain.action_line import ErrorVector as ErrorVector
    from rverror.geartrain.kinematics import (
        OperatingConditions as OperatingConditions,
        folded_order as folded_order,
        frame_orders as frame_orders,
        fundamental_orders as fundamental_orders,
    )
    from rverror.geartrain.mechanism import (
        BearingPreload as BearingPreload,
        ContactLaw as ContactLaw,
        Drive as Drive,
        Friction as Friction,
        Inertia as Inertia,
        Reducer as Reducer,
        Stiffness as Stiffness,
        StiffnessUncertainty as StiffnessUncertainty,
        preset_origins as preset_origins,
        presets as presets,
        reducer as reducer,
    )
    from rverror.geartrain.source import Index as Index, Parameter as Parameter, Source as Source
    from rverror.geartrain.torque_over_turn import GravityArm as GravityArm
else:
    __getattr__, __dir__ = attach(__name__, renamed={"Conditions": "OperatingConditions"})
