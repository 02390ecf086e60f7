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
# # From an unexplained order to an error source of your own
#
# You will learn what to do with an order that no source of the catalogue has: read the clues in its frame, its load
# and its direction, describe it, then write the effect that explains it, and find out on a run that no fit has seen
# which of the two is worth more.
#
# The story is that of the script [extension.py](../../examples/extension.py), with pictures. An RV-40E stands on a
# bench whose load is a torque motor. The runs are SIMULATED, by the equilibrium under a torque that changes with the
# angle; nothing was measured.

# %%
# %matplotlib inline
import io
import runpy
from contextlib import redirect_stdout
from dataclasses import replace
from pathlib import Path

import numpy as np

import rverror
from rverror import ARCSEC

with redirect_stdout(io.StringIO()):  # what the script prints is shown step by step below
    story = runpy.run_path("../extension.py")
unit, runs, rated = (story[name] for name in ("unit", "runs", "rated"))
first, described, explained = (story[name] for name in ("first", "described", "explained"))

# %% [markdown]
# ## An order without a frame
#
# Two runs at 20 N m, forward and reverse, and a declared model of three effects. Diagnosis of these ends with:

# %%
print("verdict:", first.verdict)
for line in first.unexplained:
    low, size, high = (value / ARCSEC for value in (line.low, line.amplitude, line.high))
    frames = ", ".join(line.frames) or "none"
    print(f"order {line.order:g}: {size:.2f} arcsec, 95 % [{low:.2f}, {high:.2f}], frames that it fits: {frames}")

# %% [markdown]
# In the residual of the forward run one line stands high above the noise, where no frame of the reducer has one.

# %%
ax = first.plot(kind="spectrum", highest=130)
ax.set_title("residual of the forward run, SIMULATED")
ax

# %% [markdown]
# First make sure that it is no order of the reducer in disguise. Too few samples a turn fold a high order onto a low
# one:

# %%
orders = rverror.geartrain.fundamental_orders(unit)
print(", ".join(f"{frame} {order:g}" for frame, order in orders.items()))
for frame in ("gear mesh", "cycloid mesh"):
    shows = rverror.geartrain.folded_order(orders[frame], story["POINTS"])
    print(f"{frame} {orders[frame]:g} at {story['POINTS']} samples a turn shows at {shows:g}")

# %% [markdown]
# ## The clues
#
# The map shows all runs by load; the third one, at the rated torque, was kept from the diagnosis. The line at 36 is
# there in each, and in both directions.

# %%
ax = rverror.views.order_map([*runs, rated], ratio=unit, highest=130)
ax.set_title("order map of the runs, SIMULATED")
ax

# %% [markdown]
# Height and phase of the line, run by run, after the declared model is taken off. The interval comes from the
# revolutions.

# %%
points, turn = story["POINTS"], story["TURN"]


def left(run, model):
    """Measured less model over the output angle, one row for each revolution, rad."""
    way = int(run.direction[0])
    error = run.error(unit)[::way].reshape(-1, points)
    return error - rverror.equilibrium(model, turn, torque=run.torque, direction=way).transmission_error


def height(rest):
    """Order 36 of the mean revolution, complex, and half its 95 % interval by the scatter of the four, arcsec."""
    line = 2 / points * np.fft.rfft(rest)[:, 36] / ARCSEC
    along = (line * np.exp(-1j * np.angle(line.mean()))).real
    return line.mean(), 3.18 * np.std(along, ddof=1) / np.sqrt(len(line))  # Student's t, 3 degrees of freedom


heights = [height(left(run, first.model)) for run in (*runs, rated)]
for run, (mean, half) in zip((*runs, rated), heights, strict=True):
    way = "forward" if run.direction[0] > 0 else "reverse"
    crest = -np.degrees(np.angle(mean)) % 360 / 36
    print(f"{run.torque / 1e3:4.0f} N*m {way}: {abs(mean):.2f} +- {half:.2f} arcsec, first crest at {crest:.2f} deg")

# %% [markdown]
# Three clues. The line turns with the output: 36 whole waves, in the same place in each revolution. Its crests are at
# the same angle forward and in reverse, while the waves of part errors move by a phase ([forward and
# reverse](forward_and_reverse.py)). And it is a little smaller at the rated torque: an encoder's error would not know
# of the load, but a torque turns the output less where the reducer is stiffer.
#
# ## First way: describe it
#
# `empirical.order` puts two numbers on the line, and no cause. The script declares it with size 0 and an uncertainty,
# within which the next diagnosis fits it:

# %%
order = described.model.effects[-1]
cos, sin = (value / ARCSEC for value in order.values)
print(f"{order.key} in frame {order.indices['frame']}: cos {cos:.2f}, sin {sin:.2f} arcsec")
print("verdict:", described.verdict)

# %% [markdown]
# Nothing is missing at this load. Whether that is true elsewhere, two numbers cannot know.
#
# ## Second way: write the effect
#
# The load motor has 12 poles in 36 slots, so its torque cogs 36 times a turn. One function says what that does,
# torque times the compliance that the reducer has at the load at hand, and one entry puts it into the catalogue. As
# the script has them:

# %%
script = Path("../extension.py").read_text(encoding="utf-8")
print(script[script.index("@cache") : script.index("# %% [markdown]\n# Inside the block")])

# %% [markdown]
# Within `extended(entry)` diagnosis tries it among all other sources, and takes it. Its parameters are torques, which
# the motor's data sheet has too; the bench was given 4.13 and 2.82 N m.

# %%
print("verdict:", explained.verdict)
for addition in explained.added:
    for estimate in addition.estimates:
        low, size, high = (
            rverror.base.to_display(value, "torque") for value in (estimate.low, estimate.value, estimate.high)
        )
        print(f"{addition.effect.key}, {estimate.name}: {size:.2f} N*m, 95 % [{low:.2f}, {high:.2f}]")

# %% [markdown]
# A wrong guess is not taken, not even where nothing else is asked about. The same effect of a motor with 24 detents
# leaves the verdict as it was:

# %%
entry = story["entry"]
wrong = replace(entry, indices=(replace(entry.indices[0], tried=lambda mechanism: (24,)),))
with rverror.model.extended(wrong):
    guess = rverror.diagnose(first.declared, runs, policy=rverror.diagnosis.Policy(keys=("load.cogging",)))
print("verdict:", guess.verdict, [line.order for line in guess.unexplained], "added:", len(guess.added))

# %% [markdown]
# ## What each is worth: a run that no fit has seen
#
# The run at the rated torque, predicted by the three models. Each was fitted at 20 N m.

# %%
with rverror.model.extended(entry):
    for name, found in (("declared model", first), ("empirical order", described), ("cogging", explained)):
        mean, half = height(left(rated, found.model))
        print(f"{name:16} leaves {abs(mean):.2f} +- {half:.2f} arcsec of order 36 at 412 N*m")

# %% [markdown]
# The picture has the height of the line over the load: as measured, and as the two ways predict it from the runs at
# 20 N m.

# %%
torques = np.array([20, 50, 120, 250, 412])  # N*m
with rverror.model.extended(entry):
    motor = rverror.Model(unit, explained.model.effects[-1:])
    predicted = [
        np.ptp(rverror.transmission_error(motor, turn, torque=1e3 * torque)) / 2 / ARCSEC for torque in torques
    ]
figure, (ax,) = rverror.views.new_figure(width=7.0, height=3.6)
measured = [run.torque / 1e3 for run in (*runs, rated)]
ax.errorbar(
    measured,
    [abs(m) for m, _ in heights],
    yerr=[half for _, half in heights],
    fmt="o",
    color="black",
    capsize=3,
    label="in the runs, 95 %",
)
ax.plot(torques, np.full(torques.size, np.hypot(cos, sin)), label="empirical order", **rverror.views.line_style(1))
ax.plot(torques, predicted, label="cogging torque times compliance", **rverror.views.line_style(0))
ax.set(
    xlabel="output torque, N*m",
    ylabel="height of order 36, arcsec",
    title="predicted from 20 N*m, SIMULATED",
    ylim=(3.8, 4.2),
)
ax.legend(frameon=False)
figure

# %% [markdown]
# The declared model leaves the whole line. The empirical order has the height of 20 N m and leaves the difference,
# which stands clear of its interval. The written effect takes the stiffer reducer into account and leaves nothing
# that can be told from 0. So describe where you must predict this unit on this bench, and write where you want to
# understand.
#
# ## What to try next
#
# - Change the cogging in `extension.py` (36 detents, 5 N m) and run this again.
# - A second guess of your own: an encoder that misreads 36 times a turn, `ErrorVector(contact="output", ...)` without
#   the compliance. Which clue speaks against it?
# - [Adding an effect](../../docs/adding-an-effect.md): where an error in the gear train sits, and what a new entry
#   says.
