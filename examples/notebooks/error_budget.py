# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: percent
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # Error budget of an RV-40E
#
# You will learn what a list of tolerances makes of the output error: which of them matter, how large the peak-to-peak
# gets in most units and in the worst one, and what changes when contacts open at a light load.
#
# All units here are SIMULATED, drawn from tolerances that a published article lists. Nothing was measured.

# %%
# %matplotlib inline
import numpy as np

import rverror
from rverror import ARCSEC

# %% [markdown]
# ## The tolerances
#
# A model without errors and a file of eleven tolerances; both lie in `examples/`, one folder up. A tolerance holds
# for every part of its kind: `cycloid.pin_position` stands for two components at each of 40 pins. A bearing clearance
# has a mean of 12 um, and its tolerance is the spread about it.

# %%
model = rverror.load_model("../rv40e.toml")
tolerances = rverror.load_tolerances("../rv40e-tolerances.toml", model)
stack = rverror.tolerances.stack(model, tolerances)
components = np.bincount(stack.entry)
for label, width, count in zip(stack.labels, stack.width, components, strict=True):
    print(f"{label:31} +- {1e3 * width:4.1f} um   {count:3} components")

# %% [markdown]
# ## The budget
#
# One call: the closed form (variance, exact worst case), virtual units for quantiles, and Sobol indices. Here the
# numbers of units are small to be quick; leave them out for a result of record.

# %%
found = rverror.error_budget(model, tolerances, count=2**13, index_count=2**10, seed=1)
found

# %% [markdown]
# ## Which tolerance matters
#
# Two bars for each tolerance. The dark one is its share of the variance, mean over the turn. The hatched one is its
# total Sobol index of the peak-to-peak, with a 95 % interval. The eccentricity of the cams leads by either. The
# peak-to-peak takes the crests, so the rest need not follow the variance: the clearance of the cam bearings has a
# small share of it, but its mean makes a wave of order 80 by itself, and whatever stretches that wave moves every
# crest.

# %%
found.plot(kind="contributions")

# %% [markdown]
# Five tolerances make no wave. The sun floats between the planets and gives way, so its eccentricity and its offset
# leave nothing. An error of the carrier's bores, and play in them, shift the output by a constant, which is zeroed
# with the joint; the forces on a carrier off its axis cancel. Nobody need pay for these on account of the
# transmission error.

# %%
for entry in found.closed.contributions:
    if entry.effect == "offset":
        print(f"{entry.label:31} an offset, {entry.worst_offset / ARCSEC:.1f} arcsec at the most")
    elif entry.effect == "nothing":
        print(f"{entry.label:31} nothing")

# %% [markdown]
# ## How large it gets
#
# Each virtual unit has one peak-to-peak. Half of the units stay below P50, all but one in a hundred below P99. The
# tail on the right is thin, as it takes many unlucky parts at once to get there.

# %%
found.plot(kind="distribution", limit=28 * ARCSEC)

# %%
for level in (0.5, 0.95, 0.99):
    size = found.units.quantile(level)
    print(
        f"P{100 * level:<3g}{size.value / ARCSEC:7.2f} arcsec  95 % [{size.low / ARCSEC:.2f}, {size.high / ARCSEC:.2f}]"
    )
within = found.units.yield_at(28 * ARCSEC)
print(f"within 28 arcsec: {100 * within.value:.1f} %  95 % [{100 * within.low:.1f}, {100 * within.high:.1f}]")
worst = found.closed.worst.peak_to_peak
print(f"worst case {worst / ARCSEC:.1f} arcsec, {worst / found.units.quantile(0.99).value:.1f} times P99")

# %% [markdown]
# The worst case is exact: no unit within the tolerances is worse, and one is as bad. It needs every component that
# makes a wave at its limit, with the right sign, which no workshop will ever see. The next picture shows its envelope
# over the turn, and the expected error with one standard deviation about it. The expected error lies far below zero:
# with play in all bearings the output lags. That is a constant, too.

# %%
found.plot(kind="envelope")

# %% [markdown]
# ## What contacts change
#
# The closed form lets every loaded pin carry its share. At a light load, errors of a few micrometres lift pins off,
# and those that stay carry more. Forty units, each solved by the equilibrium at two loads, and what makers sell
# by, their lost motion, beside it. Sobol indices at the load take most of its time, and are left out here:

# %%
limits = [rverror.limit("transmission_error", "28 arcsec", torque=f"{torque} N*m") for torque in (20, 412)]
limits.append(rverror.limit("lost_motion"))
loaded = rverror.error_budget(model, tolerances, count=2**10, index_count=0, limits=limits, loaded_count=40)

# %%
loaded.plot(kind="at_load")

# %%
for one, share in zip(loaded.at_load.verified.limits, loaded.at_load.closed_form, strict=True):
    middle = one.limit.shown(one.quantile(0.5).value)
    told = "" if share is None else f", {100 * one.share:.0f} % within 28, by the closed form {100 * share:.0f} %"
    print(f"{one.limit.label}: P50 {middle:.1f} {one.limit.unit}{told}")

# %% [markdown]
# At the rated torque of 412 N m the closed form is not far off. At 20 N m most units are beyond the limit. And the
# lost motion of six minutes of arc says that these clearances are those of no reducer that is sold.
#
# ## What to try next
#
# - Halve the tolerance of the cams in the file, and see which one leads then.
# - Give the discs a tolerance: `rverror.tolerance("cycloid.disc_pitch", "4 um", harmonic=1, correlation=0.8)`.
# - Let the library find the widths: [tolerances of least cost](tolerance_allocation.py).
# - See what each error looks like by itself: [the gallery](gallery.py).
