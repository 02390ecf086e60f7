"""What a bench is: what hangs on both ends of a reducer there, and the encoders that read them."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass

from rverror.base import units

#: Of every mode, a guess, where neither a ratio nor damping by contact is given.
DAMPING_RATIO = 0.03
#: Contacts and springs that can have damping of their own.
_DAMPED = (
    "pin_contact", "crank_bearing", "carrier_bearing", "gear_mesh", "sun_support", "main_bearing",
    "position_control", "input_coupling", "load_coupling",
)  # fmt: skip
#: Dimension of each number of a bench.
BENCH_DIMENSIONS: Mapping[str, str] = {
    "input_inertia": "inertia",
    "position_control_stiffness": "torsional_stiffness",
    "input_coupling_stiffness": "torsional_stiffness",
    "load_inertia": "inertia",
    "load_coupling_stiffness": "torsional_stiffness",
    "damping_ratio": "number",
    **{f"{name}_damping": "time" for name in _DAMPED},
}


#: Dimension of each number of its encoders.
ENCODER_DIMENSIONS: Mapping[str, str] = {
    "output_encoder": "angle",
    "input_encoder": "angle",
    "output_counts": "number",
    "input_counts": "number",
    "coupling_runout": "length",
    "coupling_radius": "length",
}


@dataclass(frozen=True, kw_only=True)
class Encoders:
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

    output_encoder: float = 0.0
    input_encoder: float = 0.0
    output_counts: float | None = None
    input_counts: float | None = None
    coupling_runout: float = 0.0
    coupling_radius: float | None = None

    def __post_init__(self) -> None:
        """Convert to core units and check each value."""
        for name, dimension in ENCODER_DIMENSIONS.items():
            value = getattr(self, name)
            if value is None:
                continue
            value = units.named_core(name, value, dimension)
            least, says = (1, "1 or more") if name.endswith("counts") else (0, "0 or more; it stands for plus or minus")
            if not least <= value < math.inf:
                raise ValueError(f"{name} = {value:g}: must be {says}")
            object.__setattr__(self, name, value)
        if self.coupling_radius is not None and not self.coupling_radius > 0:
            raise ValueError(f"coupling_radius = {self.coupling_radius:g} mm: must be above 0")
        if self.coupling_runout and self.coupling_radius is None:
            raise ValueError("coupling_runout has no coupling_radius, at which it was read; give both")

    def given(self) -> dict[str, float]:
        """Values that are stated."""
        return _given(self)


@dataclass(frozen=True, kw_only=True)
class Bench:
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

    input_inertia: float = 0.0
    position_control_stiffness: float | None = None
    input_coupling_stiffness: float | None = None
    load_inertia: float = 0.0
    load_coupling_stiffness: float | None = None
    damping_ratio: float | None = None
    pin_contact_damping: float | None = None
    crank_bearing_damping: float | None = None
    carrier_bearing_damping: float | None = None
    gear_mesh_damping: float | None = None
    sun_support_damping: float | None = None
    main_bearing_damping: float | None = None
    position_control_damping: float | None = None
    input_coupling_damping: float | None = None
    load_coupling_damping: float | None = None

    def __post_init__(self) -> None:
        """Convert to core units and check each value."""
        for name, dimension in BENCH_DIMENSIONS.items():
            value = getattr(self, name)
            if value is None:
                continue
            value = units.named_core(name, value, dimension)
            if value < 0:
                raise ValueError(f"{name} = {_told(value, dimension)}: must be 0 or more")
            object.__setattr__(self, name, value)
        for name in ("input_coupling_stiffness", "load_coupling_stiffness"):
            if getattr(self, name) == 0:
                raise ValueError(f"{name} = 0: a coupling must be above 0; leave it out for a rigid one")
        if self.damping_ratio is not None:
            if not self.damping_ratio < 1:
                raise ValueError(f"damping_ratio = {self.damping_ratio:g}: must be below 1, critical damping")
            if self.damping_times:
                raise ValueError("damping_ratio stands beside damping by contact; give one of them")
        if self.load_coupling_stiffness is not None and not self.load_inertia:
            raise ValueError("load_coupling_stiffness: nothing hangs on it; give load_inertia too, or leave it out")

    @property
    def damping_times(self) -> dict[str, float]:
        """Damping over stiffness of each contact and spring, s, by its name; empty where a ratio damps."""
        values = {name: getattr(self, f"{name}_damping") for name in _DAMPED}
        if all(value is None for value in values.values()):
            return {}
        return {name: value or 0.0 for name, value in values.items()}

    @property
    def ratio_of_modes(self) -> float:
        """Damping ratio of every mode, where contacts have no damping of their own."""
        return DAMPING_RATIO if self.damping_ratio is None else self.damping_ratio

    def given(self) -> dict[str, float]:
        """Values that are not those of a bench of which nothing is said."""
        return _given(self)


def _given(stated: Bench | Encoders) -> dict[str, float]:
    """Values that are not those of something of which nothing is said."""
    return {
        f.name: value for f in dataclasses.fields(stated) if (value := getattr(stated, f.name)) not in (None, f.default)
    }


def _told(value: float, dimension: str) -> str:
    shown = units.DISPLAY_UNITS[dimension]
    return f"{units.to_display(value, dimension):g}" + ("" if dimension == "number" else f" {shown}")
