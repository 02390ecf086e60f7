"""What the diagnosis is decided by: every threshold, with its meaning and why it has that size."""

from __future__ import annotations

import math
from dataclasses import dataclass

from rverror.base.chance import chi_square
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

    # --- reducers: what is known before -------------------------------------------------------------------------------

    #: Whether stiffness, backlash and exponents are refitted with the declared sizes.  No stiffness is known exactly.
    refit_stiffness: bool = True
    #: Share of its plausible size that is the standard deviation of an added size: two of them are what no one would be
    #: surprised at.  Causes with different numbers of sizes compare by it.
    workshop: float = 0.5

    # --- reducers: what is enough -------------------------------------------------------------------------------------

    #: Effects that are added to a reducer at most: sets of four fit what three others did, so no more are told.
    most_effects: int = 3
    #: Standard deviations that the squares of the residual may exceed their number by and be noise still.  Five: hardly
    #: ever by chance.
    by_chance: float = 5.0
    #: Squares, each counted as no more than noise makes it, over those that noise alone hardly exceeds, up to which
    #: faults of the readings may be all that is left and are looked for: sixty spikes in 10,000 samples, of 16 squares
    #: each, make a tenth.
    nearly_noise: float = 1.1
    #: Independent values of what is not explained yet: some fifty orders in each of two directions, cos and sin.  With
    #: as many as there are samples declared sizes and stiffness leave all bounds to make up for what is missing.
    regular: float = 200.0
    #: Chance that declared sizes and stiffnesses lie as far from where they were declared: a fit that strains them more
    #: is none.
    strained: float = 1e-4
    #: Root mean square of an error that the equilibrium makes for ordinary sizes, rad: no cause is named for squares
    #: that it leaves.  Against exact poses and profiles 0.001 to 0.005 arcsec.
    model_error: float = 0.01 * ARCSEC
    #: Share of what was added, rms, that is the model's own error: no second cause is named for squares of it.
    #: Against exact poses errors of 3 to 4 arcsec are 0.02 to 0.3 % off, one of a pin by 15 um 0.6 %.
    added_share: float = 0.01
    #: Share of a run's samples, beside jumps of the gears, at which two fits differ: where it is less, jumps moved.
    #: Beside exact poses jumps of two lightly loaded units were out of place in 2 and 5 % of the samples.
    jumped: float = 0.05
    #: Share of the prediction about an order of the gears, and of what was added, within which a line of that order is
    #: no news: angles that are off by a quarter of a sample, 2048 a turn, leave 3 % of order 40.
    line_share: float = 0.03
    #: Of order tables: share of what is left of an order, and of what is measured of it, that a claim takes at least.
    #: Less than half is no cause of that order, and any sizes explain half of little.
    claim_takes: float = 0.5
    claim_counts: float = 0.1
    #: Times the squares that noise hardly exceeds, of what claims of a table may leave for whole sets to be searched.
    #: A wrong first claim leaves so much of what bends; what else a real table holds is many times that.
    near_claims: float = 10.0
    #: What each row of a free line or drift must be worth in twice the logarithm of the evidence: that of a size which
    #: the runs tell 400 times as well as it was known.
    row_cost: float = 12.0
    #: How far a line's order may lie from a multiple of a frame's, where the travel tells them apart: both are told to
    #: a hundredth.
    order_tolerance: float = 0.02

    # --- reducers: how long it is searched ----------------------------------------------------------------------------

    #: Solutions of the equilibrium after which no other set is looked at, and how often the search goes on once the
    #: noise is known better.  A solution takes a thread 5 to 20 ms, so that is half a minute on two cores.
    budget: int = 3000
    looks: int = 3
    #: Angles a turn of the crank at which unknown marks are tried, with every candidate, since what is missing may turn
    #: the match: fifteen degrees of the crank apart its wave is off by an eighth at most between two.
    offsets: int = 24

    # --- drives, and lines of any order -------------------------------------------------------------------------------

    #: Cycles a run that a line has at least, and turns that tell what settles from an encoder's order: less of a wave
    #: is a slope or a bow.
    least_cycles: float = 1.5
    #: Cycles a run within which an order is taken by one that is there: less than the travel resolves.
    taken: float = 0.7

    @property
    def most_strain(self) -> float:
        """Uncertainties by which one declared size moves as seldom as all do that are `strained`."""
        return math.sqrt(chi_square(self.strained, 1))

    @property
    def least_line(self) -> float:
        """Amplitude below which no line is told, rad: three times the `model_error`, which is one of ordinary sizes."""
        return 3 * self.model_error

    def tries(self, entry: Source) -> bool:
        """Tell whether diagnosis tries a source."""
        return entry.tried and self.allows(entry)

    def allows(self, entry: Source) -> bool:
        """Tell whether a source is among those that are asked for."""
        return not self.keys or entry.key in self.keys


#: Thresholds of `diagnose` where none are given.
POLICY = Policy()
