"""The loaded gear train: the equilibrium of its floating parts, predictions at the load of a run, rigidity."""

from typing import TYPE_CHECKING

from rverror.base.lazy import attach

if TYPE_CHECKING:
    from rverror.statics.duty import (
        DutyEfficiency as DutyEfficiency,
        DutyPhase as DutyPhase,
        Lubricant as Lubricant,
        duty_efficiency as duty_efficiency,
    )
    from rverror.statics.friction import (
        Efficiency as Efficiency,
        Hysteresis as Hysteresis,
        efficiency as efficiency,
        hysteresis as hysteresis,
    )
    from rverror.statics.hertz import (
        ContactPressure as ContactPressure,
        PressurePeak as PressurePeak,
        RollerBearing as RollerBearing,
        contact_pressure as contact_pressure,
    )
    from rverror.statics.loaded_state import (
        Linearisation as Linearisation,
        NotConvergedError as NotConvergedError,
        equilibrium as equilibrium,
        linearise as linearise,
    )
    from rverror.statics.rigidity import (
        TorsionCurve as TorsionCurve,
        backlash as backlash,
        lost_motion as lost_motion,
        torsion_curve as torsion_curve,
        torsional_stiffness as torsional_stiffness,
    )
    from rverror.statics.worn_contacts import (
        FittedRunningIn as FittedRunningIn,
        RunningIn as RunningIn,
        Wear as Wear,
        WearCoefficients as WearCoefficients,
        fit_running_in as fit_running_in,
        wear as wear,
    )
else:
    __getattr__, __dir__ = attach(__name__)
