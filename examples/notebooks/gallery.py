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
# # What each error looks like
#
# You will see what every error source of the catalogue does to the output of an RV-40E: its waveform, its orders, its
# height at a size that a good workshop makes, and which errors a record of the transmission error does not show at
# all.
#
# All curves are SIMULATED, nothing is measured: the closed form, and in the last section the equilibrium, in which
# pins may lift off.

# %%
# %matplotlib inline
import numpy as np
from catalogue_tables import WAVE, Closed, shown_indices

import rverror
from rverror import ARCSEC

unit = rverror.reducer("RV-40E")

# %% [markdown]
# ## Where errors sit
#
# The reducer at one angle. Two discs in antiphase (their lobes outside, their centres marked) roll in the ring of
# pins; two cranks drive them through cams, the planet of each crank meshes with the sun, and the carrier is taken
# around by the cranks. The arrows are contact forces. An error moves the output by the force that its contact
# carries, per unit of output torque, times its own size along that force. All pictures below follow from this.

# %%
unit.plot(theta=0.1)

# %% [markdown]
# ## How to read the pictures
#
# One row is one source. On the left are a few waves of its transmission error, the offset taken off as on a bench; on
# the right its amplitudes by order, waves per output turn, on a logarithmic scale. The order tells in which part an
# error is FIXED: 40 and its multiples in carrier, disc, crank or planet, 39 and its multiples in the housing, 120 and
# its multiples in the sun, 1 and 2 at the output encoder.
#
# Lengths are 5 um, angles 10 arcsec, and a part is 10 K warmer. Where a source has an index (which pin, which
# harmonic), one with the lowest order is drawn; its fellows differ in phase. `direction` stands for what only the
# direction of motion changes, `bearing` for play in which the load moves a journal. Compliances of contacts are left
# out: their waves have no size of their own, they grow with the load.

# %%
theta = np.linspace(0, 2 * np.pi, 4 * 4096, endpoint=False)
SIZES = {
    "length": "5 um",
    "angle": "10 arcsec",
    "temperature_rise": "10 K",
    "compliance": "0.1 arcsec/(N*m)",
    "slope": "5 arcsec/turn",
    "time": "1 ms",
}


# %% tags=["hide-input"]
def gallery(rows):
    """A row of waveform and spectrum for each source."""
    figure, _ = rverror.views.new_figure(len(rows), height=1.6)
    figure.clear()
    for (key, waves), (left, right) in zip(rows.items(), figure.subplots(len(rows), 2, squeeze=False), strict=True):
        strongest = max(waves.values(), key=np.ptp)
        lines = 2 / theta.size * np.abs(np.fft.rfft(strongest))[1:-1]
        order = 1 + np.argmax(lines)
        start = slice(0, 5 * theta.size // order + 1)
        for number, (parameter, wave) in enumerate(waves.items()):
            left.plot(
                np.degrees(theta[start]), wave[start], lw=1.2, label=parameter, **rverror.views.line_style(number)
            )
        left.set_title(key, fontsize="small", loc="left")
        place = {"loc": "lower right", "bbox_to_anchor": (1, 0.98)} if len(waves) < 4 else {"loc": "upper right"}
        left.legend(fontsize="xx-small", ncols=2, frameon=len(waves) > 3, **place)
        left.margins(x=0)
        if rverror.CATALOGUE[key].periodic:
            top = lines.max()
            seen = np.flatnonzero(lines > 1e-3 * top)
            last = 1 + np.flatnonzero(lines > 0.03 * top)[-1]
            right.set(yscale="log", ylim=(1e-3 * top, 3 * top), xlim=(0, max(5, 1.1 * last)))
            right.minorticks_off()
            right.vlines(1 + seen, 1e-3 * top, lines[seen], color="black", lw=1.2)
            right.set_title(f"strongest order {order}", fontsize="small", loc="left")
        else:
            right.set_axis_off()
            right.text(0.5, 0.5, "grows along the run, no order", ha="center", transform=right.transAxes)
        left.set_ylabel("arcsec", fontsize="small")
        right.set_ylabel("amplitude,\narcsec", fontsize="small")
        left.tick_params(labelsize="small")
        right.tick_params(labelsize="small")
    left.set_xlabel("output angle, deg (scales differ)", fontsize="small")
    right.set_xlabel("order, per output turn", fontsize="small")
    figure.suptitle("SIMULATED, closed form", fontsize="medium")
    return figure


# %% tags=["hide-input"]
closed = Closed(unit, 4096)
shown = {}  # waves of each source that leaves some


def family(*names):
    """Print what the sources of some families leave; a figure of the waves."""
    rows = {}
    for key, entry in rverror.CATALOGUE.items():
        soft = entry.parameters[0].dimension == "contact_compliance"
        if key.partition(".")[0] not in names or not entry.applies_to(unit) or soft:
            continue
        indices = shown_indices(entry)
        motion = {"direction": 1.0, "time": theta, "torque": 20e3}  # one rad a second; N*mm
        size = np.array([rverror.base.to_core(SIZES[p.dimension], p.dimension) for p in entry.parameters])
        waves = rverror.influence(unit, theta, key, **motion, **indices).matrix * size[:, None] / ARCSEC
        leaves = closed.visibility(entry, indices)
        print(f"{rverror.base.describe(key, indices)}, {SIZES[entry.parameters[0].dimension]}, fixed in: {entry.frame}")
        for (parameter, left), wave in zip(leaves.items(), waves, strict=True):
            height = f", peak-to-peak {np.ptp(wave):.3g} arcsec" if left == WAVE else ""
            print(f"    {parameter:14} {left}{height}")
        rows[key] = {
            p: wave - wave.mean() for (p, left), wave in zip(leaves.items(), waves, strict=True) if left == WAVE
        }
    shown.update(rows)
    drawn = {key: waves for key, waves in rows.items() if waves}
    return gallery(drawn) if drawn else None


# %% [markdown]
# ## Involute stage
#
# Errors of sun and planets are geared down by the cycloid stage: 5 um make one to three arcsec peak-to-peak. The sun
# floats between evenly spaced planets and gives way, so its eccentricity and its offset leave nothing, and of its
# pitch error only those harmonics stay that are a multiple of the number of planets. A wrong centre distance, thinned
# teeth and play of the spline set where the loaded flank stands: a constant, visible at most as lost motion between
# the directions.

# %%
family("involute")

# %% [markdown]
# ## Cranks
#
# A cam that is 5 um too eccentric makes 18 arcsec peak-to-peak, of order 40. A crank that is turned against its
# planet stays so: a constant. Play of the cam bearings is a wave although no part is out of shape: the force on a cam
# swings around, and the journal moves in its play with it.

# %%
family("crank")

# %% [markdown]
# ## Cycloid mesh
#
# What is fixed in one disc repeats 40 times a turn. One pin is passed by two discs in antiphase, so of 39 and its
# multiples the even ones stay, 78 first; it is one among many that carry, and counts little. A wave of two periods
# around all pins counts for more. What is alike at all pins or lobes leaves only a ripple, order 1560, as pins enter
# and leave the loaded half. Waves of odd harmonics around the pins cancel between the discs and leave nothing.

# %%
family("cycloid")

# %% [markdown]
# ## Output coupling
#
# No picture: nothing is left that moves. The forces at the carrier's bores turn with the carrier, and so do its
# errors. A tangential one is a constant, a radial one and play are lost motion. On a carrier off its axis the forces
# of all bores cancel.

# %%
family("coupling")

# %% [markdown]
# ## Load and temperature
#
# At a constant torque, windup beyond the contacts is a constant, the other way round in reverse: lost motion. Growth
# of a part is alike at all pins, so what is left is again the ripple of order 1560; growth of carrier and gears
# changes play alone.

# %%
family("load", "thermal")

# %% [markdown]
# ## Measuring chain
#
# Order 1 comes from outside the gear train: an encoder or a coupling off its axis. An error of the input encoder is
# divided by the ratio, 121. What grows along a run has no order. An index offset turns the waveform of the other
# errors and leaves nothing by itself; a delay between the encoders is lost motion. `empirical.order` writes down an
# order that was measured, in any frame, and explains nothing; `compensation.wave` is one of a table that a controller
# adds to the command.

# %%
family("sensor", "empirical", "compensation")

# %% [markdown]
# ## What a load changes
#
# The closed form has rigid bearings, and every pin of the loaded side carries. In the equilibrium bearings give way
# and pins lift off. Four errors of 5 um, by both:

# %%
tenth = np.linspace(0, np.pi / 5, 512, endpoint=False)
errors = {
    "eccentricity of a cam": rverror.effect("crank.eccentricity", crank=0, disc=0, radial="5 um"),
    "pitch error of a disc": rverror.effect("cycloid.disc_pitch", disc=0, harmonic=1, cos="5 um"),
    "one large pin": rverror.effect("cycloid.pin_radius", pin=0, deviation="5 um"),
    "play of the cam bearings": rverror.effect("crank.bearing_clearance", clearance="5 um"),
}
figure, axes = rverror.views.new_figure(len(errors), height=1.9)
for ax, (name, effect) in zip(axes, errors.items(), strict=True):
    model = rverror.Model(unit, (effect,))
    waves = {"closed form": rverror.transmission_error(model, tenth)}
    for torque in ("412 N*m", "20 N*m"):
        waves[f"equilibrium, {torque}"] = rverror.equilibrium(model, tenth, torque=torque).transmission_error
    for number, (label, wave) in enumerate(waves.items()):
        ax.plot(np.degrees(tenth), (wave - wave.mean()) / ARCSEC, label=label, **rverror.views.line_style(number))
    ax.set_title(f"{name}, SIMULATED", fontsize="medium")
    ax.set_ylabel("arcsec")
    ax.margins(x=0)
    heights = ", ".join(f"{label} {np.ptp(wave) / ARCSEC:.2f}" for label, wave in waves.items())
    print(f"{name}, peak-to-peak in arcsec: {heights}")
axes[0].legend(fontsize="small", loc="lower left")
axes[-1].set_xlabel("output angle, deg")
figure

# %% [markdown]
# The cam keeps its wave whatever gives way. The pitch error of a disc comes out smaller and of another shape at 20 N
# m: lobes that stand back carry nothing. A pin that is too large takes more than its share. For errors of pins and
# discs at a light load, trust the equilibrium.
#
# ## What to try next
#
# - Another unit: `rverror.reducer(...)` with your tooth numbers, and the orders move with them.
# - Another size in `SIZES`; or a model with all your errors at once, `rverror.Model(unit,
#   (...)).plot(kind="stacked")`.
# - `direction=-1.0` in `family`: what changes is what tells causes apart, see [forward and
#   reverse](forward_and_reverse.py).
# - The same as a table, with references: `rverror sources`, or the [catalogue](../../docs/catalogue.md).
