"""What the diagnosis is decided by: every threshold, with its meaning and why it has that size."""

from __future__ import annotations

from dataclasses import dataclass

from rverror.base.units import ARCSEC
from rverror.geartrain.source import Source


@dataclass(frozen=True, kw_only=True)
class Policy:
    """What decides whether a cause is tried, named, kept or reported.

    One instance, `POLICY`, is the default of `diagnose`, which hands it down.  `dataclasses.replace` makes another.

    Examples
    --------
    Only encoder and cams are suspected:

    >>> Policy(keys=("sensor.encoder_eccentricity", "crank.eccentricity")).false_alarm
    0.001
    """

    # --- the same for all runs ----------------------------------------------------------------------------------------

    #: Keys of the catalogue that are tried; all where there are none.
    keys: tuple[str, ...] = ()
    #: Chance that noise alone names any candidate of a whole family, or any line of a spectrum.  A unit has three such
    #: families at most (candidates, lines, what settles): 0.3 % of units with nothing missing, where 1 % are allowed.
    false_alarm: float = 1e-3
    #: Of all intervals, by Student's distribution with the number of independent samples behind the noise.
    confidence: float = 0.95
    #: Chance that what fits worse by so much is the true cause: within it causes are named together.
    alike: float = 0.01
    #: Lines below it are not called unexplained, rad: the equilibrium does not claim to be better.
    accuracy: float = 0.03 * ARCSEC

    # --- reducers: what is known before -------------------------------------------------------------------------------

    #: Whether stiffness, backlash and exponents are refitted with the declared sizes.  No stiffness is known exactly.
    refit_stiffness: bool = True
    #: Standard deviation of the backlash, as a share of the declared one: it wears.
    backlash_share: float = 0.5
    #: Standard deviation of an exponent of the contact law: 10/9, a line contact, is one from linear.
    exponent_spread: float = 0.1
    #: Standard deviation of the share of its curvature by which a profile turns the normals of its pins, 1 by
    #: geometry: one may be relieved where it is bent most, or a run be simulated with straight ones.  Chosen: these
    #: are two off.
    curvature_spread: float = 0.5
    #: Share of its plausible size that is the standard deviation of an added size: two of them are what no one would be
    #: surprised at.  Causes with different numbers of sizes compare by it.
    workshop: float = 0.5

    # --- reducers: what is enough -------------------------------------------------------------------------------------

    #: Effects that are added to a reducer at most.  Chosen: sets of four fit what three others did.
    most_effects: int = 3
    #: Standard deviations that the squares of the residual may exceed their number by and be noise still.  Five: hardly
    #: ever by chance.
    by_chance: float = 5.0
    #: Squares, each counted as no more than noise makes it, over those that noise alone hardly exceeds, up to which
    #: faults of the readings may be all that is left and are looked for.  Chosen: some sixty spikes in 10,000 samples.
    nearly_noise: float = 1.1
    #: Independent values of what is not explained yet: some fifty orders in each of two directions, cos and sin.  With
    #: as many as there are samples declared sizes and stiffness leave all bounds to make up for what is missing.
    regular: float = 200.0
    #: Chance that declared sizes and stiffnesses lie as far from where they were declared: a fit that strains them more
    #: is none.
    strained: float = 1e-4
    #: Uncertainties by which a declared size may move before the notes say so: by chance once in 16,000.
    strained_size: float = 4.0
    #: Root mean square of an error that the equilibrium makes for ordinary sizes, rad: no cause is named for squares
    #: that it leaves.  Against exact poses and profiles 0.001 to 0.005 arcsec.
    model_error: float = 0.01 * ARCSEC
    #: Share of what was known of a size before: where the runs leave more open than that they do not tell it.  Chosen.
    untold: float = 0.8
    #: Share of what was added, rms, that is the model's own error: no second cause is named for squares of it.  Chosen:
    #: against exact poses errors of 3 to 4 arcsec are 0.02 to 0.3 % off, one of a pin by 15 um 0.6 %.
    added_share: float = 0.01
    #: Share of a run's samples, beside jumps of the gears, at which two fits differ: where it is less, jumps moved.
    #: Chosen: beside exact poses jumps of two lightly loaded units were out of place in 2 and 5 % of the samples.
    jumped: float = 0.05
    #: Share of the prediction about an order of the gears, and of what was added, within which a line of that order is
    #: no news.  Chosen: angles that are off by a quarter of a sample, 2048 a turn, leave 3 % of order 40.
    line_share: float = 0.03
    #: Of order tables: share of what is left of an order, and of what is measured of it, that a claim takes at least.
    #: Chosen: less than half is no cause of that order, and any sizes explain half of little.
    claim_takes: float = 0.5
    claim_counts: float = 0.1
    #: Times the squares that noise hardly exceeds, of what claims of a table may leave for whole sets to be searched.
    #: Chosen: a wrong first claim leaves so much of what bends; what else a real table holds is many times that.
    near_claims: float = 10.0
    #: Speeds of an order, in one direction at one load, from which a natural frequency is looked for: a parabola over
    #: the speed has three sizes, and a resonance beside it leaves two complex values to tell noise by.
    speeds: int = 6
    #: Natural frequencies that are told at most.  Chosen: ends a search that turns in a circle.
    resonances: int = 4
    #: Standard deviation of the logarithm of an inertia that is estimated from the geometry: its parts' widths are not
    #: stated.
    inertia_spread: float = 0.3
    #: Share of its largest torque below which a load that changes its sign says nothing: drag and friction decide there
    #: which side carries.  Chosen: makers print no-load running torques from 5 % of the rated torque on.
    light_load: float = 0.05
    #: Standard deviation of mean and first waves of a torque column, as a share of its largest: sensors have a class of
    #: 0.1 or 0.2 %, and noise adds to it.  As much of the windup is no news, and no encoder's.  Chosen.
    torque_share: float = 0.002
    #: What each row of a free line or drift must be worth in twice the logarithm of the evidence: that of a size which
    #: the runs tell 400 times as well as it was known.
    row_cost: float = 12.0
    #: Standard deviation of the gear's marks beyond which they are not placed, rad: wider, a linear interval means
    #: nothing.
    marks_placed: float = 1.0
    #: How far a line's order may lie from a multiple of a frame's, where the travel tells them apart.  Chosen.
    order_tolerance: float = 0.02

    # --- reducers: how long it is searched ----------------------------------------------------------------------------

    #: Solutions of the equilibrium after which no other set is looked at, and how often the search goes on once the
    #: noise is known better.  A solution takes a thread 5 to 20 ms, so that is half a minute on two cores.
    budget: int = 3000
    looks: int = 3
    #: Angles a turn of the crank at which unknown marks are tried, with every candidate, since what is missing may turn
    #: the match.  Chosen for time.
    offsets: int = 24

    # --- drives, and lines of any order -------------------------------------------------------------------------------

    #: Cycles a run that a line has at least, and turns that tell what settles from an encoder's order: less of a wave
    #: is a slope or a bow.
    least_cycles: float = 1.5
    #: Cycles a run within which an order is taken by one that is there: less than the travel resolves.
    taken: float = 0.7

    def tries(self, entry: Source) -> bool:
        """Tell whether diagnosis tries a source."""
        return entry.tried and self.allows(entry)

    def allows(self, entry: Source) -> bool:
        """Tell whether a source is among those that are asked for."""
        return not self.keys or entry.key in self.keys


POLICY = Policy()
