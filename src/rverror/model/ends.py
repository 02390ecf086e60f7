"""What hangs on both ends of a reducer on its bench or in its machine: inertias, and springs to them."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass

from rverror.base import units

#: Dimension of each number of a bench.
BENCH_DIMENSIONS: Mapping[str, str] = {
    "input_inertia": "inertia",
    "position_control_stiffness": "torsional_stiffness",
    "input_coupling_stiffness": "torsional_stiffness",
    "load_inertia": "inertia",
    "load_coupling_stiffness": "torsional_stiffness",
    "damping_ratio": "number",
}


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
    damping_ratio : float
        Of every mode; 0.03, a guess, where left out.

    Raises
    ------
    ValueError
        If a value is below 0, a coupling is not above 0, the damping is 1 or more, or a load's coupling has no load.

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
    damping_ratio: float = 0.03

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
        if not self.damping_ratio < 1:
            raise ValueError(f"damping_ratio = {self.damping_ratio:g}: must be below 1, critical damping")
        if self.load_coupling_stiffness is not None and not self.load_inertia:
            raise ValueError("load_coupling_stiffness: nothing hangs on it; give load_inertia too, or leave it out")

    def given(self) -> dict[str, float]:
        """Values that are not those of a bench of which nothing is said."""
        return {
            f.name: value for f in dataclasses.fields(self) if (value := getattr(self, f.name)) not in (None, f.default)
        }


def _told(value: float, dimension: str) -> str:
    shown = units.DISPLAY_UNITS[dimension]
    return f"{units.to_display(value, dimension):g}" + ("" if dimension == "number" else f" {shown}")
