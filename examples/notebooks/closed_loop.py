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
# # From a bench run to the missing cause
#
# You will learn the whole loop on one RV-40E: declare what is known of its parts, read two bench runs, look at what
# the declared model leaves, let `rverror.diagnose` name the cause, weigh it against the other candidates, compare
# before and after, and save the new model.
#
# **The runs are SIMULATED.** They come with the package, from a virtual test bench that shares no code with the model
# that explains them here; nothing was measured.

# %%
# %matplotlib inline
from dataclasses import replace
from importlib import resources
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import rverror
from rverror import ARCSEC

shipped = resources.files("rverror") / "data" / "demo"

# %% [markdown]
# ## Declare
#
# A model file holds the reducer and the part errors that were measured on its parts, each with the uncertainty of
# that measurement.

# %%
model = rverror.load_model(shipped / "model.toml")
for effect in model.effects:
    sizes = ", ".join(f"{value * 1e3:+.2f}" for value in effect.values)
    print(f"{rverror.base.describe(effect.key, effect.indices):40} {sizes} um, +- {effect.uncertainty * 1e3:.1f} um")

# %% [markdown]
# What these parts should do to the output, by the closed form. Twelve waves of the strongest order, each effect with
# a line of its own:

# %%
model.plot()

# %% [markdown]
# ## Run
#
# One run forward, one in reverse, 20 N m at the output, three revolutions each. A run file holds the two angles; the
# transmission error is the output angle less the input angle over the ratio, and the model brings the ratio.

# %%
runs = [replace(rverror.load_run(shipped / name), path=name) for name in ("forward.csv", "reverse.csv")]
ax = runs[0].plot(ratio=model)
ax.set_title("forward.csv, SIMULATED")
ax

# %% [markdown]
# One slow wave over each revolution stands out, under a dense ripple. By order, waves per output turn, the ripple is
# at 40 and its multiples, as it is for errors of discs, cranks and the carrier; the slow wave is at 1, where no part
# of the gear train puts one. The black line is the noise floor, told by what differs between the revolutions.

# %%
ax = runs[0].plot(kind="spectrum", ratio=model, highest=190)
ax.set_title("forward.csv, SIMULATED")
ax

# %% [markdown]
# ## Diagnosis
#
# All sources of the catalogue are tried, on both runs together. The declared sizes may move within their uncertainty,
# so a measuring error of a part is not blamed on a new cause. A cause is named only if it is significant on
# revolutions that the fit did not see, and leaves nothing at the orders of its own frame.

# %%
found = rverror.diagnose(model, runs)
print(rverror.to_text(found))

# %% [markdown]
# ## The candidates
#
# Beside what is declared. A score is what a candidate takes off the noise-weighted sum of squares by its linear
# waveform; drawn is the distance behind the best. None of the others comes near.

# %%
found.plot(kind="candidates")

# %%
for addition in found.added:
    print(rverror.base.describe(addition.effect.key, addition.effect.indices))
    for estimate in addition.estimates:
        low, size, high = (value / ARCSEC for value in (estimate.low, estimate.value, estimate.high))
        print(f"  {estimate.name:4} {size:7.3f} arcsec  95 % [{low:.3f}, {high:.3f}]")
    same = ", ".join(rverror.base.describe(*other) for other in addition.indistinguishable)
    print("  these runs cannot tell it from:", same or "none, it stands alone")

# %% [markdown]
# ## Before and after
#
# The held-out figure is the one to trust: each revolution is predicted from a fit to the others. It comes down to the
# noise, which no model can take off.

# %%
stages = (
    ("as declared", found.before),
    ("declared sizes refitted", found.before_refitted),
    ("with what was added", found.after),
)
print(f"{'arcsec':24}      rms  held-out rms  peak-to-peak")
for name, residual in stages:
    rms, heldout, peak = (value / ARCSEC for value in (residual.rms, residual.heldout_rms, residual.peak_to_peak))
    print(f"{name:24} {rms:8.2f} {heldout:13.2f} {peak:13.2f}")
print(f"{'noise':24} {found.noise_rms / ARCSEC:8.2f}")

# %%
ax = found.plot(kind="residual")
ax.set_title("residual of forward.csv, left-out stretches, SIMULATED")
ax

# %% [markdown]
# The same by order. The order 1 is gone, which the new effect has explained. So are the lines at 40 and its
# multiples: these are the declared sizes, refitted within their uncertainty.

# %%
ax = found.plot(kind="spectrum", highest=190)
ax.set_title("residual of forward.csv, SIMULATED")
ax

# %% [markdown]
# ## The new model
#
# What was added is an ordinary effect. The new model is saved as a file, reads back equal, and predicts.

# %%
with TemporaryDirectory() as folder:
    path = Path(folder) / "new-model.toml"
    rverror.save_model(path, found.model)
    print(path.read_text(encoding="utf-8").rpartition("\n\n")[2])
    print("reads back equal:", rverror.load_model(path) == found.model)

# %%
points = 2048
theta = runs[0].nominal_angle(model)[:points]
mean_turn = runs[0].error(model).reshape(-1, points).mean(axis=0)
for name, one in (("declared", model), ("new", found.model)):
    predicted = rverror.equilibrium(one, theta, torque=runs[0].torque, direction=1).transmission_error
    print(f"left of the mean turn by the {name} model: {np.std(mean_turn - predicted) / ARCSEC:.2f} arcsec rms")

# %% [markdown]
# ## What to try next
#
# - Leave the reverse run out: an order 1 is known by itself, the causes of an order 40 are not. See [forward and
#   reverse](forward_and_reverse.py).
# - Take an effect out of the model, `replace(model, effects=model.effects[1:])`, and let the runs bring it back.
# - Your own files: [reading your bench's files](your_bench_files.py). An order that nothing explains: [from an
#   unexplained order to an error source of your own](unexplained_order.py).
# - From the shell: `rverror diagnose model.toml forward.csv reverse.csv --report found.html --save new-model.toml`.
