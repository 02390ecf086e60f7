# %% [markdown]
# # From part errors to the output error of an RV-40E
#
# Four parts of an RV-40E are off by a few micrometres.  What does the output do over a turn, and which part matters?

# %%
import numpy as np

import rverror
from rverror import ARCSEC

unit = rverror.reducer("RV-40E")
model = rverror.Model(
    unit,
    (
        rverror.effect("crank.eccentricity", crank=0, disc=1, radial="5 um"),
        rverror.effect("cycloid.disc_pitch", disc=0, harmonic=1, cos="3 um"),
        rverror.effect("coupling.carrier_bore_position", crank=0, tangential="5 um"),
        rverror.effect("involute.planet_eccentricity", crank=1, x="10 um"),
    ),
    name="RV-40E with four part errors",
)
theta = np.linspace(0, 2 * np.pi, 4096, endpoint=False)

# %% [markdown]
# The closed form: rigid bearings, all pins of the driving side in contact.  Peak-to-peak is of the waveform; the
# carrier bore shifts the output by a constant, which a bench with an offset of its own cannot see.

# %%
parts = rverror.model.transmission_error_by_effect(model, theta)
for effect, part in zip(model.effects, parts, strict=True):
    print(f"{effect.key:32} peak-to-peak {np.ptp(part) / ARCSEC:6.2f} arcsec, mean {part.mean() / ARCSEC:7.2f} arcsec")
total = rverror.transmission_error(model, theta)
print(f"{'all, closed form':32} peak-to-peak {np.ptp(total) / ARCSEC:6.2f} arcsec")

# %% [markdown]
# Under load, with pins that can lift off.  At a bench's 20 N m the errors unload pins; at rated torque they hardly do.

# %%
for torque in ("20 N*m", "412 N*m"):
    state = rverror.equilibrium(model, theta, torque=torque)
    swing, pins = np.ptp(state.transmission_error) / ARCSEC, state.loaded_pins
    print(f"{'all, at ' + torque:32} peak-to-peak {swing:6.2f} arcsec, {pins.min()} to {pins.max()} pins a disc")
