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
# # From a measuring machine's file to the list for the assembly shop
#
# You will learn how measured parts are read, how those are found that are to be joined, and what that gains over
# putting them together as they come.
#
# All parts here are SIMULATED. How the list holds against an independent solver is on
# [the page on matching](../../docs/theory/matching.md).

# %%
# %matplotlib inline
import tempfile
from pathlib import Path

import numpy as np

import rverror
from rverror import ARCSEC

# %% [markdown]
# ## The unit
#
# A reducer of ratio 49 with 16 pins, small enough to be solved quickly. Its model has no errors: those are the parts'.

# %%
unit = rverror.Reducer(
    sun_teeth=9,
    planet_teeth=27,
    module="1.5 mm",
    pressure_angle="20 deg",
    disc_lobes=15,
    pins=16,
    pin_circle_radius="64 mm",
    pin_radius="5 mm",
    eccentricity="2.4 mm",
    cranks=2,
    discs=2,
    name="small unit",
)
model = rverror.Model(unit, name="small unit")

# %% [markdown]
# ## Measured parts
#
# The cranks come from a machine that writes decimal commas and semicolons: a row for each crank, with the error of its
# two cams. A mapping says what the columns are.

# %%
rng = np.random.default_rng(1)
folder = Path(tempfile.mkdtemp())
rows = ["No;cam 0 [um];cam 1 [um]"]
for number in range(16):
    sizes = [f"{size:.1f}".replace(".", ",") for size in rng.normal(0, 4, 2)]
    rows.append(f"C{number + 1};{';'.join(sizes)}")
(folder / "cranks.csv").write_text("\n".join(rows))
(folder / "cranks.toml").write_text("""
kind = "crank"
serial = "No"

[[error]]
key = "crank.eccentricity"
disc = 0
radial = { name = "cam 0 [um]", unit = "um", uncertainty = "0.3 um" }

[[error]]
key = "crank.eccentricity"
disc = 1
radial = { name = "cam 1 [um]", unit = "um", uncertainty = "0.3 um" }
""")
cranks = rverror.load_parts(folder / "cranks.csv", unit, mapping=folder / "cranks.toml").parts
print("\n".join(rows[:3]), cranks[0].errors[0], sep="\n")

# %% [markdown]
# Discs and housings are here already as parts: of each disc the runout and the oval of its profile, of each housing the
# place of every pin.

# %%
waves = [[rng.normal(0, 4e-3, 2) for _ in (1, 2)] for _ in range(16)]
discs = [
    rverror.parts.MeasuredPart(
        "disc",
        f"D{number + 1}",
        tuple(
            rverror.effect("cycloid.disc_profile", harmonic=h, cos=cos, sin=sin) for h, (cos, sin) in enumerate(of, 1)
        ),
    )
    for number, of in enumerate(waves)
]
places = rng.normal(0, 3e-3, (8, 16, 2))
housings = [
    rverror.parts.MeasuredPart(
        "housing",
        f"H{number + 1}",
        tuple(
            rverror.effect("cycloid.pin_position", pin=pin, radial=radial, tangential=tangential)
            for pin, (radial, tangential) in enumerate(of)
        ),
    )
    for number, of in enumerate(places)
]

# %% [markdown]
# ## Which parts to join
#
# Eight units can be made. The transmission error is to stay within 50 arcsec at 150 N m in both directions. Every unit
# of the list is solved by the equilibrium at this load; so are units that are put together at random.

# %%
limit = rverror.limit("transmission_error", "50 arcsec", torque="150 N*m")
found = rverror.match(model, [*cranks, *discs, *housings], [limit])
print(rverror.to_text(found))

# %% [markdown]
# All eight are good, where about half are at random. Three classes gain nothing: what cancels in a unit is a matter of
# directions, and a class knows sizes alone.

# %%
found.plot()
# %% [markdown]
# ## The list
#
# A row for each unit, for a spreadsheet. A disc turned by one pitch of its bores stands at the second place: its lobes
# fit there no other way.

# %%
(folder / "assembly.csv").write_text(rverror.views.to_csv(found, units=True))
print((folder / "assembly.csv").read_text().splitlines()[1])

# %% [markdown]
# Each unit has its model, with the errors of its parts, for any other calculation: here the error by the
# equilibrium at other angles than those of the list.

# %%
first = found.units[0]
state = rverror.equilibrium(first.model, 2 * np.pi * np.arange(1000) / 1000, torque="150 N*m")
print(f"{np.ptp(state.transmission_error) / ARCSEC:.1f} arcsec, in the list {first.turns[0] / ARCSEC:.1f}")

# %% [markdown]
# ## What to try next
#
# - Add the lost motion: a second limit, `rverror.limit("lost_motion", "200 arcsec", torque="5 N*m")`.
# - Leave out a third of the discs: the fewest parts say how many units can be made, the others stay.
# - Add measured rollers, parts of the kind `roller`: each is placed in the groove where it does most good.
# - The same from the shell: `rverror match parts.csv --model unit.toml --limit "50 arcsec" --save assembly.csv`.
