"""Every threshold of the diagnosis, with its meaning and why it has that size."""

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
    #: families at most (candidates, lines, what grows): 0.3 % of units with nothing missing, where 1 % are allowed.
    false_alarm: float = 1e-3
    #: Of all intervals, by Student's distribution with the number of independent samples behind the noise.
    confidence: float = 0.95
    #: Chance that what fits worse by so much is the true cause: within it causes are named together.
    alike: float = 0.01
    #: Lines below it are not called unexplained, rad: the equilibrium does not claim to be better.
    accuracy: float = 0.03 * ARCSEC
    #: Rounds of a search.  Chosen: far more than a search needs; it only ends one that turns in a circle.
    rounds: int = 24
    #: Share of a waveform, rms, below which the next measurement takes another one for the same.  Chosen: of an error
    #: ten times the noise it is half the noise.
    same_waveform: float = 0.05

    # --- whole periods: what is added ---------------------------------------------------------------------------------

    #: Effects that are added to a reducer at most.  Chosen: one more than the benches ask for.
    most_effects: int = 4
    #: Effects of one frame that may stand together before they are judged.  Chosen for time: each is a search more.
    together: int = 2
    #: A cause that leaves lines of its own frame stands beside another only if it took off this share of what is not
    #: noise.  Chosen: what each of `most_effects` equal causes would.
    good_part: float = 0.25
    #: Times its size before that the held-out rms may reach with an added effect.  Chosen: where it grows, declared
    #: sizes have moved far to fit as well, and only they gain.
    no_worse: float = 1.002
    #: An objective that falls by less is no better fit; chance takes one size there in 600 (chi-square of one degree).
    level: float = 10.0
    #: Standard deviations that the sum of the declared sizes' squares may exceed its mean by, before the next candidate
    #: is tried at the sizes as declared: many sizes exceed three once in 700.
    strained_prior: float = 3.0
    #: Uncertainties by which a declared size may move before the notes say so: by chance once in 16,000.
    strained_size: float = 4.0
    #: Standard deviations that the squares of the residual may exceed their number by and be noise still; beyond them
    #: what is not explained counts as noise of its own size.  Five: hardly ever by chance.
    by_chance: float = 5.0
    #: Standard deviations by which a plausible size must change the data for a parameter to be determined.  Chosen:
    #: with less, only a size a thousand times as large would show.
    seen: float = 1e-3

    # --- whole periods: lines -----------------------------------------------------------------------------------------

    #: How far a line's order may lie from a multiple of a frame's.  Chosen: orders of whole periods are exact.
    order_tolerance: float = 0.02
    #: Share of its strongest line at which an order counts as the effect's own.  Chosen.
    leading: float = 0.3
    #: Own orders of an effect that are listed and claimed.  Chosen.
    leading_orders: int = 4
    #: Share of the strongest line below which a line says nothing of the frame: it may be folded.  Chosen.
    large_line: float = 0.1

    # --- whole periods: who is refitted at the load -------------------------------------------------------------------

    #: Share of the leader's gain on left-out periods below which a candidate is not refitted.  Chosen: small, since
    #: linear waveforms rank parts almost at random where contacts open.
    negligible: float = 0.005
    #: Candidates that need a whole turn's equilibrium, of the linear ranking's best.  Chosen for time.
    slow_candidates: int = 6
    #: After one step alone: how many more, for how many of the best, of those that may come within so many times the
    #: best one's squares.  Chosen on trial units, for time.
    refit_rounds: tuple[tuple[int, int, float], ...] = ((1, 1000, 4.0), (4, 12, 3.0))
    #: Candidates that are refitted jointly with everything, beside those within `level` of the best.  Chosen for time.
    refitted: int = 4
    #: Times the best one's squares that a candidate may leave and be refitted jointly.  Chosen as `refit_rounds`.
    hopeless: float = 2.0
    #: Objective on few angles within which fits are compared on all.  Chosen on trial units, for time.
    close: float = 300.0
    #: Angles a period on which candidates are fitted first, where they hold the leading orders.  Chosen for time.
    coarse: tuple[int, ...] = (512, 1024)
    #: Share of the Nyquist order of so few angles that the highest leading order may have, to keep its flanks.  Chosen.
    coarse_share: float = 0.9
    #: Standard deviations of the squares by which a fit is so poor that it may have ended in the wrong place: once in
    #: 30,000 by chance.
    poor: float = 4.0
    #: Poor fits that start again, and of whose workshop sizes the best go on.  Chosen for time.
    restarted: int = 2
    best_starts: int = 3
    #: Share of the plausible size that is an ordinary one.  Chosen: of 30 um 6.
    workshop: float = 0.2
    #: Candidates that look like the best one and are fitted beside it.  Chosen: two cranks and two discs make three.
    twins: int = 3
    #: Share of its power that a twin's linear waveform may lack.  Chosen.
    twin_share: float = 0.02
    #: Share of the gaps that sources may lack and still close the very same ones: rounding.
    same_gaps: float = 1e-6

    # --- whole periods: zeros and marks -------------------------------------------------------------------------------

    #: Not known of a lost motion: a share of what the gear backlash makes of it, a nominal size that wears, and of the
    #: elastic windup, for no stiffness is known better.  Both are estimates.
    backlash_share: float = 0.5
    windup_share: float = 0.05
    #: Likely zeros of runs whose index is unknown, each with a search of its own; and angles a turn of the crank that
    #: compete for them, since what is missing may turn the match.  Chosen for time.
    likely_zeros: int = 2
    angles_around: int = 6
    #: Squares by which the best angle must beat the worst for the marks to show at all: one standard deviation.
    marks_show: float = 1.0
    #: Standard deviation beyond which the marks are not placed, rad: wider, the linear interval means nothing.
    marks_placed: float = 1.0

    # --- samples ------------------------------------------------------------------------------------------------------

    #: White noise that every reading has, rad, or as a share of a torque's deviation: a perfect fit is no certainty.
    floor: float = 1e-3 * ARCSEC
    torque_floor: float = 1e-6
    #: Share of the Nyquist order, where a run turns fastest, up to which candidates and lines are tried.  Chosen: a
    #: wave of nearly two samples is a beat that uneven steps tear apart.
    sampled: float = 0.95
    #: Independent samples that a noise estimate has at least.  Chosen: fewer give intervals that say nothing.
    least_samples: float = 4.0
    #: Share of its power that a candidate keeps beside what is there, or it is not tried: below, rounding decides.
    apart: float = 1e-4
    #: The same where its size would be one that no workshop makes.  Chosen: a slope over 40 deg makes all but 1 % of an
    #: encoder of degrees.
    apart_implausible: float = 0.05
    #: A size that no workshop makes goes after plausible ones that take off this share of the most.  Chosen.
    plausible_first: float = 0.5
    #: Cycles a run within which a stronger line goes before a candidate: a short run smears it over its neighbours.
    smeared: float = 6.0
    #: Cycles a run that a line has at least; less of a wave is a slope or a bow.
    least_cycles: float = 1.5
    #: Cycles a run within which an order is taken by one that is there, or two are one: less than the travel resolves.
    taken: float = 0.7
    same_order: float = 0.25
    #: Chance at which a maximum of the spectrum is looked at closer, how many of them in each run, and how many are
    #: then fitted.  Chosen for time.
    likely_line: float = 0.05
    peaks: int = 6
    fitted_peaks: int = 3
    #: Lines that are put in at the end.  Chosen.
    most_lines: int = 12
    #: Cycles a run by which a fitted order may miss a whole one and be told as that one.
    told_order: float = 0.05

    # --- what grows along a reducer's run -----------------------------------------------------------------------------

    #: Chance that the means of periods wander by as much: noise with a long memory moves whole turns.  Chosen: three
    #: turns have few degrees of freedom, and a smaller chance would refuse true drifts.
    wander: float = 0.01
    #: Share of a waveform that must differ between periods: rounding.
    differs: float = 1e-6

    def tries(self, entry: Source) -> bool:
        """Tell whether diagnosis tries a source."""
        return entry.tried and (not self.keys or entry.key in self.keys)


POLICY = Policy()
