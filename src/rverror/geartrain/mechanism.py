"""The reducer and its parts: checked geometry, stiffness, presets with the source of every number."""

from __future__ import annotations

import inspect
import math
import sys
import tomllib
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from fractions import Fraction
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import numpy as np

from rverror.base import units
from rverror.base.errors import InputError, check_kind
from rverror.base.quantities import COUNT, Checked, quantities, quantity
from rverror.base.text import did_you_mean
from rverror.base.viewed import Viewed

_STIFFNESS = quantity("stiffness", "200000 N/mm", above=0.0)


@dataclass(frozen=True, kw_only=True)
class Stiffness(Checked):
    """Stiffness of each contact, N/mm.

    Parameters
    ----------
    pin_contact : float
        One pin against one disc, along the contact normal.
    crank_bearing : float
        One cam bearing, radial.
    carrier_bearing : float
        One crank bearing in the carrier, radial.
    gear_mesh : float
        One sun-planet mesh, along the line of action.
    sun_support : float
        Radial support of the floating sun.
    main_bearing : float
        Carrier in the housing, radial.

    Notes
    -----
    The defaults are realistic for a reducer of the size of the RV-40E; none of the five sources prints a full set.
    Quantities and strings with a unit are converted.

    Examples
    --------
    >>> Stiffness(pin_contact="250 kN/mm").pin_contact
    250000.0
    """

    pin_contact: float = field(default=2e5, metadata=_STIFFNESS)
    crank_bearing: float = field(default=3e5, metadata=_STIFFNESS)
    carrier_bearing: float = field(default=3e5, metadata=_STIFFNESS)
    gear_mesh: float = field(default=2e5, metadata=_STIFFNESS)
    sun_support: float = field(default=1e2, metadata=_STIFFNESS)
    main_bearing: float = field(default=1e6, metadata=_STIFFNESS)


_SPREAD = quantity("number", "'25 %'", least=0.0, remedy=", a share; 0 is exact")


@dataclass(frozen=True, kw_only=True)
class StiffnessUncertainty(Checked):
    """How well each contact stiffness is known: 1 sigma of its logarithm; 0 is exact.

    Parameters
    ----------
    pin_contact, crank_bearing, carrier_bearing, gear_mesh, sun_support, main_bearing : float
        As in `Stiffness`; 0.25, near enough 25 %, where left out.

    Raises
    ------
    ValueError
        If a value is below 0 or no finite number.

    Notes
    -----
    Nobody knows a contact stiffness better than to a quarter unless it was measured: bearings are preloaded, housings
    bend.  `diagnose` refits every stiffness within it.

    Examples
    --------
    >>> StiffnessUncertainty(crank_bearing=0.1).gear_mesh
    0.25
    """

    pin_contact: float = field(default=0.25, metadata=_SPREAD)
    crank_bearing: float = field(default=0.25, metadata=_SPREAD)
    carrier_bearing: float = field(default=0.25, metadata=_SPREAD)
    gear_mesh: float = field(default=0.25, metadata=_SPREAD)
    sun_support: float = field(default=0.25, metadata=_SPREAD)
    main_bearing: float = field(default=0.25, metadata=_SPREAD)


#: N.  Force at which a declared contact stiffness holds where the contact closes by a power law: the middle, on a
#: logarithmic scale, of what the most loaded pin and the flanks of an RV-40E carry between a bench's 20 N*m (20 N,
#: 13 N) and the rated 412 N*m (400 N, 270 N), so a law changes the windup between these torques little.
REFERENCE_FORCE = 100.0


#: Standard deviations of the numbers of a contact law before a unit is measured: of an exponent that of a line
#: contact, 10/9, from linear; of the curvature half of what is between straight profiles, 0, and the geometry's, 1,
#: since a profile may be relieved where it is bent most.  And of the backlash, as a share of the declared one, since it
#: wears.
LAW_SPREAD = {"pin_exponent": 0.1, "flank_exponent": 0.1, "profile_curvature": 0.5}
BACKLASH_SPREAD = 0.5


_EXPONENT = quantity("number", "1.11", least=1.0, most=1.5, remedy="; 1 is linear, 10/9 a line contact")
_CURVATURE = quantity("number", "1.0", least=0.0, most=2.0, remedy="; 0 is first order, 1 what the geometry says")


@dataclass(frozen=True, kw_only=True)
class ContactLaw(Checked):
    """Power laws by which pins and gear flanks close, f = F0 (k p / F0)^exponent, and how pins follow their discs.

    Parameters
    ----------
    pin_exponent : float
        Of a pin against a disc.
    flank_exponent : float
        Of a gear flank.
    profile_curvature : float
        Share of its curvature by which a disc's profile turns the normal of a pin that errors and load move along it:
        0 for normals of the error-free pose, as in the closed form, 1 for what the geometry says.

    Raises
    ------
    ValueError
        If an exponent does not lie between 1 and 1.5, or the curvature between 0 and 2.

    Notes
    -----
    1 is linear, 10/9 a line contact, 1.5 a point contact of Hertz.  F0 is `REFERENCE_FORCE`: under it a contact closes
    as its declared stiffness k says, whatever the exponent.

    Examples
    --------
    >>> ContactLaw(pin_exponent=10 / 9).flank_exponent
    1.0
    """

    pin_exponent: float = field(default=1.0, metadata=_EXPONENT)
    flank_exponent: float = field(default=1.0, metadata=_EXPONENT)
    profile_curvature: float = field(default=0.0, metadata=_CURVATURE)


#: Least and largest of each number of a contact law.
LAW_BOUNDS = {name: (one.least, one.most) for name, one in quantities(ContactLaw).items()}
_PRELOAD = quantity("length", "2 um", least=0.0, remedy="; it is an interference")


@dataclass(frozen=True, kw_only=True)
class BearingPreload(Checked):
    """Interference of preloaded bearings: how far their rollers are pressed in all around, mm; 0 for none.

    Parameters
    ----------
    crank_bearing : float
        Of each cam bearing.
    carrier_bearing : float
        Of each crank bearing in the carrier.

    Raises
    ------
    ValueError
        If a value is below 0.

    Notes
    -----
    A negative clearance.  Up to that displacement rollers on both sides carry, and the bearing is twice as stiff as
    declared; a clearance that wear or an effect adds takes from it.  A spring that preloads by a force F makes F over
    the bearing's stiffness.  Quantities and strings with a unit are converted.

    Examples
    --------
    >>> BearingPreload(crank_bearing="2 um").crank_bearing
    0.002
    """

    crank_bearing: float = field(default=0.0, metadata=_PRELOAD)
    carrier_bearing: float = field(default=0.0, metadata=_PRELOAD)


_COEFFICIENT = quantity("number", "0.05", least=0.0, remedy=", a coefficient of friction")
_FRICTION_RADIUS = quantity("length", "10 mm", above=0.0)


@dataclass(frozen=True, kw_only=True)
class Friction(Checked):
    """Coefficients of friction of each kind of contact.

    Parameters
    ----------
    pin : float
        Of a pin on a disc.
    mesh : float
        Of a gear flank, in the mean over its path of contact.
    crank_bearing, carrier_bearing : float
        Of a crank's bearing in a disc and in the carrier.
    crank_bearing_radius, carrier_bearing_radius : float or quantity, optional
        Radius at which it counts, mm; half the bore for the coefficients that makers of bearings print.
    drag : float or quantity
        Torque between carrier and housing whatever the load, of main bearing, seals and grease, N*mm.

    Raises
    ------
    ValueError
        If a value is below 0, or a bearing has a coefficient and no radius.

    Notes
    -----
    Efficiency and hysteresis know it; the loaded equilibrium, dynamics and diagnosis are without friction.

    Examples
    --------
    >>> Friction(pin=0.05, drag="5 N*m").drag
    5000.0
    """

    pin: float = field(default=0.0, metadata=_COEFFICIENT)
    mesh: float = field(default=0.0, metadata=_COEFFICIENT)
    crank_bearing: float = field(default=0.0, metadata=_COEFFICIENT)
    carrier_bearing: float = field(default=0.0, metadata=_COEFFICIENT)
    crank_bearing_radius: float | None = field(default=None, metadata=_FRICTION_RADIUS)
    carrier_bearing_radius: float | None = field(default=None, metadata=_FRICTION_RADIUS)
    drag: float = field(default=0.0, metadata=quantity("torque", "4 N*m", least=0.0))

    def __post_init__(self) -> None:
        """Convert to core units and check."""
        super().__post_init__()
        for name in ("crank_bearing", "carrier_bearing"):
            coefficient = getattr(self, name)
            if coefficient and getattr(self, f"{name}_radius") is None:
                raise ValueError(
                    f"{name}_radius is missing: {name} = {coefficient:g} counts at it; give it, like '10 mm'"
                )


_MASS = quantity("mass", "0.8 kg", above=0.0, remedy="; leave it out for an estimate")
_MOMENT = quantity("inertia", "0.002 kg*m^2", above=0.0, remedy="; leave it out for an estimate")


@dataclass(frozen=True, kw_only=True)
class Inertia(Checked):
    """Mass of each part, tonne, and its moment of inertia about its own axis, tonne*mm^2.

    Parameters
    ----------
    carrier_mass, carrier_inertia : float, optional
        With the output flange and what is fixed to it.
    disc_mass, disc_inertia : float, optional
        Of one disc.
    crank_mass, crank_inertia : float, optional
        Of one crankshaft with its planet gear.
    sun_mass, sun_inertia : float, optional
        With the shaft on the reducer's side of the input coupling.

    Raises
    ------
    ValueError
        If a value is not above 0.

    Notes
    -----
    What is left out is estimated from the geometry, as of steel: `rverror.dynamics.train.whole_inertia`.  Quantities
    and strings with a unit are converted.

    Examples
    --------
    >>> Inertia(disc_mass="0.8 kg").disc_mass
    0.0008
    """

    carrier_mass: float | None = field(default=None, metadata=_MASS)
    carrier_inertia: float | None = field(default=None, metadata=_MOMENT)
    disc_mass: float | None = field(default=None, metadata=_MASS)
    disc_inertia: float | None = field(default=None, metadata=_MOMENT)
    crank_mass: float | None = field(default=None, metadata=_MASS)
    crank_inertia: float | None = field(default=None, metadata=_MOMENT)
    sun_mass: float | None = field(default=None, metadata=_MASS)
    sun_inertia: float | None = field(default=None, metadata=_MOMENT)


#: Parts that can be the output of a reducer while the other one is held.
OUTPUTS = ("carrier", "housing")


@dataclass(frozen=True, kw_only=True)
class Reducer(Checked, Viewed):
    """Geometry of an RV reducer: an involute planetary stage that drives a cycloidal stage through cranks.

    Parameters
    ----------
    sun_teeth, planet_teeth : int
        Teeth of the sun and of each planet gear (z1, z2).
    module : float
        Module of the involute stage, mm.
    pressure_angle : float
        Pressure angle of the involute stage, rad.
    disc_lobes, pins : int
        Lobes of each cycloid disc and pins of the housing (z_c, z_p); z_p = z_c + 1.
    pin_circle_radius, pin_radius : float
        Radius of the circle through the pin centres and of a pin, mm.
    eccentricity : float
        Eccentricity of each cam, mm.
    cranks, discs : int
        Number of crankshafts, at least 2, and of cycloid discs.
    gear_backlash : float
        Play of each sun-planet mesh along the line of action, mm.
    stiffness : Stiffness
        Contact stiffnesses; the closed form does not use them.
    stiffness_uncertainty : StiffnessUncertainty
        How well they are known.
    contact_law : ContactLaw
        By which powers pins and flanks close; linear where left out.  The closed form does not use it.
    bearing_preload : BearingPreload
        Interference of cam and crank bearings; none where left out.  The closed form does not use it.
    friction : Friction
        Of its contacts, for efficiency and hysteresis; none is said where left out.
    inertia : Inertia
        Of its parts, for the dynamics; estimated where left out.
    rated_torque : float, optional
        Rated output torque, N*mm.
    spline_radius : float, optional
        Pitch radius of the planet-to-crank spline, mm; needed only for ``involute.spline_clearance``.
    output : str
        ``"carrier"``, with the housing held, or ``"housing"``, with the carrier held.
    name : str
        For reports.

    Raises
    ------
    ValueError
        If a value breaks the geometry; the message names the value, the bound and the remedy.

    Notes
    -----
    Plain numbers are mm and rad; pint quantities and strings such as ``"1.5 mm"`` are converted.

    Examples
    --------
    >>> unit = reducer("RV-40E")
    >>> unit.ratio, unit.crank_radius
    (121.0, 27.0)
    """

    sun_teeth: int = field(metadata=quantity(COUNT, "9", least=5))
    planet_teeth: int = field(metadata=quantity(COUNT, "27", least=5))
    module: float = field(metadata=quantity("length", "1.5 mm", above=0.0))
    pressure_angle: float = field(metadata=quantity("angle", "20 deg"))
    disc_lobes: int = field(metadata=quantity(COUNT, "39", least=3))
    pins: int = field(metadata=quantity(COUNT, "40", least=4))
    pin_circle_radius: float = field(metadata=quantity("length", "64 mm", above=0.0))
    pin_radius: float = field(metadata=quantity("length", "3 mm", above=0.0))
    eccentricity: float = field(metadata=quantity("length", "1.25 mm", above=0.0))
    cranks: int = field(metadata=quantity(COUNT, "2", least=2))
    discs: int = field(metadata=quantity(COUNT, "2", least=1))
    gear_backlash: float = field(default=0.020, metadata=quantity("length", "20 um", least=0.0))
    stiffness: Stiffness = field(default_factory=Stiffness)
    stiffness_uncertainty: StiffnessUncertainty = field(default_factory=StiffnessUncertainty)
    contact_law: ContactLaw = field(default_factory=ContactLaw)
    bearing_preload: BearingPreload = field(default_factory=BearingPreload)
    friction: Friction = field(default_factory=Friction)
    inertia: Inertia = field(default_factory=Inertia)
    rated_torque: float | None = field(default=None, metadata=quantity("torque", "412 N*m", above=0.0))
    spline_radius: float | None = field(default=None, metadata=quantity("length", "7 mm", above=0.0))
    output: str = OUTPUTS[0]
    name: str = "custom"

    def __post_init__(self) -> None:
        """Convert to mm and rad, check the geometry."""
        if self.output not in OUTPUTS:
            raise ValueError(f"output = {self.output!r}: must be one of {', '.join(map(repr, OUTPUTS))}")
        super().__post_init__()
        if not 0 < self.pressure_angle < math.radians(45):
            raise ValueError(
                f"pressure_angle = {math.degrees(self.pressure_angle):g} deg: must lie between 0 and 45 deg; "
                "plain numbers are rad, so write '20 deg' for degrees"
            )
        if self.pins != self.disc_lobes + 1:
            raise ValueError(
                f"pins = {self.pins} with disc_lobes = {self.disc_lobes}: an RV disc has one lobe less than there are "
                f"pins; use pins = {self.disc_lobes + 1} or disc_lobes = {self.pins - 1}"
            )
        if self.discs == 1 and self.cranks == 2:
            raise ValueError(
                "discs = 1 with cranks = 2: the crank linkage passes dead centres, where it can carry no torque; "
                "use discs = 2 or cranks = 3"
            )
        inner = self.pin_circle_radius - self.pin_radius - 2 * self.eccentricity
        if self.crank_radius >= inner:
            raise ValueError(
                f"module = {self.module:g} mm: the crank circle of {self.crank_radius:g} mm must lie inside the root "
                f"circle of {inner:g} mm; use a smaller module or a larger pin circle"
            )
        if not self.short_width_coefficient < 1:
            bound = self.pin_circle_radius / self.pins
            raise ValueError(
                f"eccentricity = {self.eccentricity:g} mm: K = a z_p / R_p = {self.short_width_coefficient:.4g} must "
                f"be below 1, so the eccentricity below {bound:.4g} mm"
            )
        bound = self.pin_circle_radius * math.sin(math.pi / self.pins)
        if self.pin_radius >= bound:
            raise ValueError(
                f"pin_radius = {self.pin_radius:g} mm: neighbouring pins overlap; it must be below {bound:.4g} mm"
            )
        bound = self.smallest_convex_radius
        if self.pin_radius >= bound:
            raise ValueError(
                f"pin_radius = {self.pin_radius:g} mm: the disc profile is undercut; it must be below the smallest "
                f"convex radius of the pin-centre trochoid, {bound:.4g} mm"
            )

    @cached_property
    def exact_carrier_ratio(self) -> Fraction:
        """R = 1 + (z2/z1) z_p/(z_p - z_c), turns of the input per turn of the carrier, both seen from the housing."""
        return 1 + Fraction(self.planet_teeth, self.sun_teeth) * self.pins / (self.pins - self.disc_lobes)

    @cached_property
    def exact_ratio(self) -> Fraction:
        """Input turns per output turn, as a fraction: R with the housing held, 1 - R with the carrier held."""
        return self.exact_carrier_ratio if self.output == "carrier" else 1 - self.exact_carrier_ratio

    @property
    def ratio(self) -> float:
        """Input turns per output turn; below 0 where the housing is the output and turns against the input."""
        return float(self.exact_ratio)

    @property
    def held(self) -> str:
        """Part that stands still while the output turns, and carries the motor and the reading head."""
        return OUTPUTS[1 - OUTPUTS.index(self.output)]

    @cached_property
    def output_turn(self) -> float:
        """Turn of the output per turn of the carrier in the housing with the input held: 1, or -R/(R - 1)."""
        return float(self.exact_carrier_ratio / self.exact_ratio)

    @property
    def crank_radius(self) -> float:
        """r6, radius of the circle through the crank axes: the centre distance m (z1 + z2) / 2, mm."""
        return self.module * (self.sun_teeth + self.planet_teeth) / 2

    @property
    def sun_pitch_radius(self) -> float:
        """Pitch radius of the sun gear, m z1 / 2, mm."""
        return self.module * self.sun_teeth / 2

    @property
    def planet_pitch_radius(self) -> float:
        """Pitch radius of a planet gear, m z2 / 2, mm."""
        return self.module * self.planet_teeth / 2

    @property
    def short_width_coefficient(self) -> float:
        """K = a z_p / R_p, the short width coefficient of the cycloid (source 002 prints it inverted)."""
        return self.eccentricity * self.pins / self.pin_circle_radius

    @property
    def smallest_convex_radius(self) -> float:
        r"""Smallest convex radius of curvature of the pin-centre trochoid, mm.

        The trochoid has :math:`\rho = R_p (1 + K^2 - 2K\cos\phi)^{3/2} / (1 + z_p K^2 - K (z_p + 1) \cos\phi)`;
        a disc profile, its offset by the pin radius, is undercut where the pin radius exceeds the smallest positive
        :math:`\rho`.  For K below (z_p - 2)/(2 z_p - 1) that is the value at the lobe's tip, else a minimum beside it.
        """
        K, z = self.short_width_coefficient, self.pins
        if (2 * z - 1) * K < z - 2:
            return self.pin_circle_radius * (1 + K) ** 2 / (1 + z * K)
        return self.pin_circle_radius * math.sqrt(27 * (1 - K**2) * (z - 1) / (z + 1) ** 3)


#: Parameters of a reducer that leave its geometry as it is.
ELASTIC = (
    "stiffness", "stiffness_uncertainty", "gear_backlash", "contact_law", "bearing_preload", "friction", "inertia",
)  # fmt: skip


def check_same_geometry(one: Reducer, other: Reducer) -> None:
    """Check that two reducers differ in nothing but `ELASTIC`.

    Raises
    ------
    ValueError
        Naming the first parameter that differs.
    """
    for item in fields(Reducer):
        given, wanted = getattr(one, item.name), getattr(other, item.name)
        if item.name not in ELASTIC and given != wanted:
            raise ValueError(
                f"{item.name} = {wanted!r}, here {given!r}: only {', '.join(ELASTIC)} may differ; "
                "prepare another geometry for it"
            )


@cache
def _presets() -> dict[str, dict[str, tuple[Any, str]]]:
    """Of every preset the keyword arguments of `Reducer`, each with its origin, from ``data/presets.toml``."""
    text = Path(__file__).parents[1].joinpath("data", "presets.toml").read_text(encoding="utf-8")
    return {
        name: {
            key: (Stiffness(**value) if key == "stiffness" else value, origin) for key, (value, origin) in own.items()
        }
        for name, own in tomllib.loads(text).items()
    }


def preset_parameters(name: str) -> dict[str, Any]:
    """Parameters of a preset, a new dictionary.

    Parameters
    ----------
    name : str
        One of `presets`.

    Returns
    -------
    dict
        Keyword arguments of `Reducer`, in mm, rad and N*mm.

    Raises
    ------
    ValueError
        If there is no such preset.
    """
    return {"name": name} | {key: value for key, (value, _) in _preset(name).items()}


def preset_origins(name: str) -> dict[str, str]:
    """Origin of every number of a preset: who prints it, or the rule by which it was derived or assumed.

    Parameters
    ----------
    name : str
        One of `presets`.

    Returns
    -------
    dict of str to str
        By parameter of `Reducer`: a source of the bibliography, or ``inferred:``, ``derived:`` or ``assumed:`` and
        the rule.  What is not in it has the value that `Reducer` gives to any unit.

    Raises
    ------
    ValueError
        If there is no such preset.

    Examples
    --------
    >>> preset_origins("RV-40E")["module"]
    'inferred: m (z1 + z2) / 2 = 27 mm, the crank circle of 000'
    """
    return {key: origin for key, (_, origin) in _preset(name).items()}


def _preset(name: str) -> dict[str, tuple[Any, str]]:
    check_kind("preset", name, str, f"give one of {', '.join(presets())}, or parameters by their names")
    if name not in presets():
        raise ValueError(f"no preset {name!r};{did_you_mean(name, presets())} the presets are {', '.join(presets())}")
    return _presets()[name]


def presets() -> tuple[str, ...]:
    """Names of the presets, as `reducer` takes them.

    Returns
    -------
    tuple of str

    Examples
    --------
    >>> presets()[:3]
    ('RV-40E', 'RV-003', 'RV-20E')
    """
    return tuple(_presets())


def reducer(preset: str | None = None, **overrides: Any) -> Reducer:
    """Make a reducer from its parameters, or from a preset with any of its values replaced.

    Parameters
    ----------
    preset : str, optional
        ``"RV-40E"`` (sources 000 and 004), ``"RV-003"`` (source 003), ``"RV-80E"``, or ``"RV-20E"``, ``"RV-110E"`` or
        ``"RV-320E"``, whose lengths are assumed; `preset_origins` tells what each number rests on.  Without one every
        parameter that `Reducer` needs must be given, and none comes from a preset.
    **overrides
        Any parameter of `Reducer`: plain numbers (mm and rad), strings with a unit or quantities.

    Returns
    -------
    Reducer

    Raises
    ------
    ValueError
        If the preset or a parameter is unknown, a parameter is missing, or the geometry is impossible.

    Examples
    --------
    >>> reducer("RV-003").ratio
    101.0
    >>> reducer("RV-40E", cranks=3).cranks
    3
    >>> stage = dict(sun_teeth=12, planet_teeth=36, module="1.25 mm", pressure_angle="20 deg", cranks=3)
    >>> discs = dict(disc_lobes=29, pins=30, pin_circle_radius="65 mm", pin_radius=3.0, eccentricity="1.2 mm", discs=2)
    >>> reducer(**stage, **discs).ratio
    91.0
    """
    given = ({} if preset is None else preset_parameters(preset)) | overrides
    known = inspect.signature(Reducer).parameters
    for key in overrides:
        if key not in known:
            raise ValueError(f"no reducer parameter {key!r};{did_you_mean(key, known)} they are {', '.join(known)}")
    if missing := [name for name, one in known.items() if one.default is one.empty and name not in given]:
        raise InputError(
            f"reducer: no {', '.join(missing)}; give them, or name a preset beside what differs from it: "
            f"reducer({presets()[0]!r}, ...)"
        )
    return Reducer(**given)


@dataclass(frozen=True, kw_only=True)
class Drive:
    """Any geared drive of which only the ratio and the shaft orders are known.

    Parameters
    ----------
    ratio : float
        Input turns per output turn; negative where the output turns against the input.
    shafts : mapping of str to float
        Turns of each named shaft per output turn.

    Raises
    ------
    ValueError
        If the ratio or an order is zero or not finite.

    Examples
    --------
    >>> Drive(ratio=14.0, shafts={"motor": 14.0, "planet": 3.5}).shafts["planet"]
    3.5
    """

    ratio: float
    shafts: Mapping[str, float] = field(default_factory=dict)
    name: str = "drive"

    def __post_init__(self) -> None:
        """Check that every number is finite and not zero."""
        for label, value in {"ratio": self.ratio, **self.shafts}.items():
            number = isinstance(value, (int, float)) and not isinstance(value, bool)
            if not number or not 0 < abs(value) <= sys.float_info.max:  # false for nan; a whole number may be larger
                raise ValueError(f"{label} = {value!r}: must be a finite number other than 0, in turns per output turn")


#: What has an output error: a reducer whose parts are known, or any drive of which only the orders are.
Mechanism = Reducer | Drive

#: Least and largest load of a bench, of the rated torque; makers let some twice the rated torque start and stop a
#: reducer.  What is one of these in N*m is 0.2 % of the rated torque at most in N*mm, less than a bench holds steadily.
_LOADS = (5e-3, 2.0)


def core_torque(mechanism: Mechanism, torque: Any, *, name: str = "torque") -> float:
    """A torque on the output in N*mm, doubted where it was meant in N*m.

    Parameters
    ----------
    mechanism : Reducer or Drive
        What bears it.
    torque : float, str or quantity
    name : str
        What the caller names it.

    Returns
    -------
    float
        N*mm.

    Raises
    ------
    ValueError
        As `units.to_core`.

    Warns
    -----
    UserWarning
        As `doubt_torque`.

    Examples
    --------
    >>> core_torque(reducer("RV-40E"), "412 N*m")
    412000.0
    """
    size = units.named_core(name, torque, "torque")
    doubt_torque(mechanism, torque, name=name)
    return size


def doubt_torque(mechanism: Mechanism, torques: Any, *, name: str = "torque") -> None:
    """Warn of a plain number that is a load in N*m and none in N*mm, in which it is taken.

    Parameters
    ----------
    mechanism : Reducer or Drive
        What bears it; without a rated torque nothing is known.
    torques : float, str, quantity or array_like
        As typed.  What has a unit is believed; of several plain numbers the largest counts.
    name : str
        What the caller names it.

    Warns
    -----
    UserWarning
        If a thousand times the number is from 0.5 % to twice the rated torque.
    """
    rated = mechanism.rated_torque if isinstance(mechanism, Reducer) else None
    given = torques.tolist() if isinstance(torques, np.ndarray) else torques
    listed = given if isinstance(given, Sequence) and not isinstance(given, str) else [given]
    plain = [abs(float(one)) for one in listed if isinstance(one, (int, float)) and not isinstance(one, units.InCore)]
    if not rated or not plain or len(plain) < len(listed):
        return
    size, (least, largest) = max(plain), _LOADS
    if not least * rated <= 1e3 * size <= largest * rated:
        return
    what, remedy = (name, f"{name}=") if len(listed) == 1 else (f"largest of {name}", "")
    warnings.warn(
        f"{what} = {size:g} is taken as {size:g} N*mm, {size / rated:.2g} of the rated torque ({rated / 1e3:g} N*m); "
        f"write {remedy}'{size:g} N*m', or '{size:g} N*mm' where that is meant",
        stacklevel=4,
    )
