"""What a bench is: what hangs on both ends of a reducer there, and the encoders that read them."""

from __future__ import annotations

from dataclasses import dataclass, field

from rverror.base.quantities import Checked, quantities, quantity

#: Of every mode, a guess, where neither a ratio nor damping by contact is given.
DAMPING_RATIO = 0.03
_DAMPING = "_damping"  # end of the names of dampings by contact
_ACCURACY = "; it stands for plus or minus"
_MOMENT = quantity("inertia", "0.002 kg*m^2", least=0.0)
_COUPLING = quantity("torsional_stiffness", "500 N*m/rad", above=0.0, remedy="; leave it out for a rigid coupling")
_TIME = quantity("time", "0.02 ms", least=0.0)


@dataclass(frozen=True, kw_only=True)
class Encoders(Checked):
    """How a bench reads both angles, as the makers of its parts state it; what is left out is taken as without error.

    Parameters
    ----------
    output_encoder, input_encoder : float
        Accuracy, plus or minus, at the encoder's own shaft, rad.
    output_counts, input_counts : float, optional
        Counts a turn, to which readings are rounded.
    coupling_runout : float
        Axial runout of the output encoder's coupling, plus or minus, mm.
    coupling_radius : float, optional
        Radius at which it was read, mm.

    Raises
    ------
    ValueError
        If a value is below 0, counts are below 1, or a runout has no radius.

    Notes
    -----
    Quantities and strings with a unit are converted.  `docs/theory/test-bench.md` has what they leave uncertain.

    Examples
    --------
    >>> round(Encoders(output_encoder="1 deg").output_encoder, 6)
    0.017453
    """

    output_encoder: float = field(default=0.0, metadata=quantity("angle", "1.24 arcsec", least=0.0, remedy=_ACCURACY))
    input_encoder: float = field(default=0.0, metadata=quantity("angle", "1.24 arcsec", least=0.0, remedy=_ACCURACY))
    output_counts: float | None = field(default=None, metadata=quantity("number", "8388608", least=1.0))
    input_counts: float | None = field(default=None, metadata=quantity("number", "8388608", least=1.0))
    coupling_runout: float = field(default=0.0, metadata=quantity("length", "0.1 mm", least=0.0, remedy=_ACCURACY))
    coupling_radius: float | None = field(default=None, metadata=quantity("length", "30 mm", above=0.0))

    def __post_init__(self) -> None:
        """Convert to core units and check."""
        super().__post_init__()
        if self.coupling_runout and self.coupling_radius is None:
            raise ValueError("coupling_runout has no coupling_radius, at which it was read; give both")


@dataclass(frozen=True, kw_only=True)
class Bench(Checked):
    """Both ends of a reducer, seen at its own shafts, and how motions die away.

    Parameters
    ----------
    input_inertia : float
        Of motor and shaft before the input coupling, tonne*mm^2.
    position_control_stiffness : float, optional
        Torque with which the control holds the input side per angle that it lags, N*mm/rad; 0 for a free input.  Left
        out, the input side turns evenly whatever comes.
    input_coupling_stiffness : float, optional
        Between the input side and the sun, N*mm/rad; rigid where left out.
    load_inertia : float
        Behind the load's coupling, tonne*mm^2.
    load_coupling_stiffness : float, optional
        Between carrier and load, N*mm/rad; rigid where left out.
    damping_ratio : float, optional
        Of every mode; where it is left out 0.03, a guess, unless there is damping by contact.
    pin_contact_damping, crank_bearing_damping, carrier_bearing_damping, gear_mesh_damping, sun_support_damping, \
main_bearing_damping, position_control_damping, input_coupling_damping, load_coupling_damping : float, optional
        Damping by contact, in place of a ratio: viscous damping of each contact or spring of the kind over its
        stiffness, s; 0 where others are given and this one is not.

    Raises
    ------
    ValueError
        If a value is below 0, a coupling is not above 0, the damping ratio is 1 or more or stands beside damping by
        contact, or a load's coupling has no load.

    Notes
    -----
    Quantities and strings with a unit are converted.  `docs/theory/dynamics.md` has the equations.

    Examples
    --------
    >>> Bench(load_inertia="2 kg*m^2").load_inertia
    2000.0
    """

    input_inertia: float = field(default=0.0, metadata=_MOMENT)
    position_control_stiffness: float | None = field(
        default=None, metadata=quantity("torsional_stiffness", "500 N*m/rad", least=0.0)
    )
    input_coupling_stiffness: float | None = field(default=None, metadata=_COUPLING)
    load_inertia: float = field(default=0.0, metadata=_MOMENT)
    load_coupling_stiffness: float | None = field(default=None, metadata=_COUPLING)
    damping_ratio: float | None = field(default=None, metadata=quantity("number", "'3 %'", least=0.0))
    pin_contact_damping: float | None = field(default=None, metadata=_TIME)
    crank_bearing_damping: float | None = field(default=None, metadata=_TIME)
    carrier_bearing_damping: float | None = field(default=None, metadata=_TIME)
    gear_mesh_damping: float | None = field(default=None, metadata=_TIME)
    sun_support_damping: float | None = field(default=None, metadata=_TIME)
    main_bearing_damping: float | None = field(default=None, metadata=_TIME)
    position_control_damping: float | None = field(default=None, metadata=_TIME)
    input_coupling_damping: float | None = field(default=None, metadata=_TIME)
    load_coupling_damping: float | None = field(default=None, metadata=_TIME)

    def __post_init__(self) -> None:
        """Convert to core units and check."""
        super().__post_init__()
        if self.damping_ratio is not None:
            if not self.damping_ratio < 1:
                raise ValueError(
                    f"damping_ratio = {self.damping_ratio:g}: must be below 1, critical damping; write it like '3 %'"
                )
            if self.damping_times:
                raise ValueError("damping_ratio stands beside damping by contact; give one of them")
        if self.load_coupling_stiffness is not None and not self.load_inertia:
            raise ValueError("load_coupling_stiffness: nothing hangs on it; give load_inertia too, or leave it out")

    @property
    def damping_times(self) -> dict[str, float]:
        """Damping over stiffness of each contact and spring, s, by its name; empty where a ratio damps."""
        values = {
            name.removesuffix(_DAMPING): getattr(self, name) for name in quantities(self) if name.endswith(_DAMPING)
        }
        if all(value is None for value in values.values()):
            return {}
        return {name: value or 0.0 for name, value in values.items()}

    @property
    def ratio_of_modes(self) -> float:
        """Damping ratio of every mode, where contacts have no damping of their own."""
        return DAMPING_RATIO if self.damping_ratio is None else self.damping_ratio
