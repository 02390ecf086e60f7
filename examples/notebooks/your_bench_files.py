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
# # Reading your bench's files
#
# You will learn how rverror reads the files that your bench writes, as they are: text with semicolons and decimal
# commas, MAT, HDF5, TDMS. You say once, in a mapping, how the bench names its columns, in which units, and which
# angle counts the other way; then the runs are diagnosed.
#
# The runs are SIMULATED and written here in the manner of a bench, into a temporary folder. Nothing was measured.
# HDF5 and TDMS need `pip install 'rverror[io]'`.

# %%
# %matplotlib inline
from contextlib import chdir
from pathlib import Path
from tempfile import TemporaryDirectory

import h5py
import numpy as np
from nptdms import ChannelObject, RootObject, TdmsWriter
from scipy.io import savemat

import rverror
from rverror import ARCSEC

temporary = TemporaryDirectory()
folder = Path(temporary.name)

# %% [markdown]
# ## What the bench writes
#
# An RV-40E at 20 N m, forward and reverse, three revolutions each. The input encoder has 9000 lines, read at all
# edges: 36000 counts a turn, and it triggers a sample every 3960 counts. The output encoder was mounted the other way
# round. The shop floor has measured a pitch error of one disc; it does not know of an eccentric cam. (This cell plays
# the bench; you have files instead.)

# %% tags=["hide-input"]
unit = rverror.reducer("RV-40E")
pitch = rverror.effect("cycloid.disc_pitch", disc=0, harmonic=1, cos="2 um", uncertainty="0.3 um")
cam = rverror.effect("crank.eccentricity", crank=0, disc=0, radial="2.5 um", tangential="-1.5 um")
declared = rverror.Model(unit, (pitch,), name="RV-40E, as declared")
simulated = rverror.runs.simulate_runs(
    declared.with_effects(cam),
    torques=("20 N*m",),
    points=1100,
    revolutions=3,
    method="equilibrium",
    noise="0.3 arcsec",
    correlation="2 deg",
    input_counts=36000,
    output_speed="10 deg/s",
    seed=5,
)
NAMES = ("forward", "reverse")


def counts(run):
    """What the input encoder counts."""
    return np.rint(run.input_angle / (2 * np.pi) * 36000).astype(int)


for name, run in zip(NAMES, simulated, strict=True):
    lines = ["Prüfstand;3", "Last;20 N*m", "Zeit [s];Geber Antrieb;Winkel Abtrieb [°];Öl [°C]"]
    for time, count, angle in zip(run.time, counts(run), np.degrees(run.output_angle), strict=True):
        lines.append(f"{time:.3f};{count};{-angle:.6f};40.2".replace(".", ","))
    (folder / f"{name}.csv").write_text("\n".join(lines), encoding="cp1252")
print("\n".join((folder / "forward.csv").read_text(encoding="cp1252").splitlines()[:6]))

# %% [markdown]
# ## From a refusal to a mapping
#
# Without a mapping the file is refused, in one line that says what to do.


# %%
def read(path, mapping=None):
    """Read a run; print the message where it is refused."""
    with chdir(folder):
        try:
            return rverror.load_run(path, unit, mapping=mapping)
        except rverror.InputError as problem:
            print("refused:", problem)


read("forward.csv")

# %% [markdown]
# So ask for a draft. It lists what the file holds, and the keys to fill in. From the shell: `rverror read forward.csv
# --draft -o bench.toml`.

# %%
with chdir(folder):
    print(rverror.runs.draft_mapping("forward.csv"))

# %% [markdown]
# Two names and their units, and where the load stands. One sign is still missing here, to see what happens:

# %%
MAPPING = """
[file]
encoding = "cp1252"

[columns]
input_angle = { name = "Geber Antrieb", unit = "counts", counts_per_turn = 36000 }
output_angle = { name = "Winkel Abtrieb [°]", unit = "deg" }
time = { name = "Zeit [s]", unit = "s" }

[header]
output_torque = { property = "Last" }
temperature = "40.2 degC"
"""
(folder / "bench.toml").write_text(MAPPING, encoding="utf-8")
read("forward.csv", "bench.toml")

# %% [markdown]
# The message is about the sign, and the remedy is in the mapping:

# %%
MAPPING = MAPPING.replace('unit = "deg" }', 'unit = "deg", sign = -1 }')
(folder / "bench.toml").write_text(MAPPING, encoding="utf-8")
runs = [read(f"{name}.csv", "bench.toml") for name in NAMES]
for run in runs:
    print(f"{run.path}: {run.size} samples, {run.torque / 1e3:g} N*m, {run.temperature:.2f} K")
    print("   ", "\n    ".join(run.notes))

# %% [markdown]
# What was found in the file by itself (separator, decimal sign, direction) is noted with the run. One count of the
# input is 0.3 arcsec at the output; this bench triggers on counts, so its samples stand right on them, while one that
# samples by a clock rounds each time. The direction is read from the angles, so one mapping serves both files. Two
# more slips, and what is said to them:

# %%
for wrong, right in (('"Geber Antrieb"', '"Geber"'), ("counts_per_turn = 36000", "counts_per_turn = 9000")):
    (folder / "wrong.toml").write_text(MAPPING.replace(wrong, right), encoding="utf-8")
    read("forward.csv", "wrong.toml")

# %% [markdown]
# ## The same runs as MAT, HDF5 and TDMS
#
# What kind of file it is shows in its content. A column of a MAT file is a variable, of HDF5 a data set, of TDMS a
# channel. Columns that are named as in a run file and bring their unit need no mapping: so it is in the HDF5 file
# here.

# %% tags=["hide-input"]
run = simulated[0]
savemat(
    folder / "forward.mat",
    {"run": {"phi_in": counts(run), "phi_out": -np.degrees(run.output_angle), "M": np.full(run.size, 20.0)}},
)
with h5py.File(folder / "forward.h5", "w") as file:
    for name, values in (("input_angle", np.degrees(run.input_angle)), ("output_angle", np.degrees(run.output_angle))):
        file[name] = values
        file[name].attrs["units"] = "deg"
    file.attrs["output_torque"] = "20 N*m"
with TdmsWriter(folder / "forward.tdms") as writer:
    channels = [
        ChannelObject("Encoder", "Drive side", counts(run)),
        ChannelObject("Encoder", "Output", -np.degrees(run.output_angle), {"unit_string": "deg"}),
    ]
    writer.write_segment([RootObject({"Load": "20 N*m"}), *channels])

# %% [markdown]
# The others need their names, and the sign. A name without its group is enough where only one column has it.

# %%
MAT = """
[columns]
input_angle = { name = "run/phi_in", unit = "counts", counts_per_turn = 36000 }
output_angle = { name = "run/phi_out", unit = "deg", sign = -1 }
output_torque = { name = "run/M", unit = "N*m" }
"""
TDMS = """
[columns]
input_angle = { name = "Drive side", unit = "counts", counts_per_turn = 36000 }
output_angle = { name = "Output", sign = -1 }
[header]
output_torque = { property = "Load" }
"""
(folder / "mat.toml").write_text(MAT, encoding="utf-8")
(folder / "tdms.toml").write_text(TDMS, encoding="utf-8")
for path, mapping in (
    ("forward.csv", "bench.toml"),
    ("forward.mat", "mat.toml"),
    ("forward.h5", None),
    ("forward.tdms", "tdms.toml"),
):
    found = read(path, mapping)
    off = np.abs(found.error(unit) - simulated[0].error(unit)).max() / ARCSEC
    print(f"{path:13} {found.size} samples, {found.torque / 1e3:g} N*m, at most {off:.4f} arcsec from what was written")

# %% [markdown]
# The text has six decimals of a degree, which is 0.0018 arcsec at the worst; the others hold every digit.
#
# ## From file to cause
#
# First look at the run, then at what the declared model lacks.

# %%
ax = runs[0].plot(kind="spectrum", ratio=declared, highest=130)
ax.set_title("forward.csv, SIMULATED")
ax

# %%
found = rverror.diagnose(declared, runs)
print("verdict:", found.verdict)
for addition in found.added:
    print(rverror.base.describe(addition.effect.key, addition.effect.indices))
    for e in addition.estimates:
        print(f"    {e.name:10} {1e3 * e.value:6.2f} um, 95 % [{1e3 * e.low:.2f}, {1e3 * e.high:.2f}]")
    for other in addition.indistinguishable:
        print("    or", rverror.base.describe(*other))
before, after = (residual.heldout_rms / ARCSEC for residual in (found.before, found.after))
print(f"held-out rms: {before:.2f} arcsec before, {after:.2f} after, noise {found.noise_rms / ARCSEC:.2f}")

# %%
ax = found.plot(kind="residual")
ax.set_title("residual of forward.csv, left-out stretches, SIMULATED")
ax

# %%
temporary.cleanup()

# %% [markdown]
# The bench was given 2.5 and -1.5 um on the cam of crank 0 and disc 0.
#
# ## What to try next
#
# - Your own file: `rverror read YOUR.csv --draft -o bench.toml`, fill in, `rverror read YOUR.csv --mapping
#   bench.toml`, and `rverror diagnose model.toml YOUR.csv --mapping bench.toml`.
# - [A bench's own files](../../docs/bench-files.md): every key of a mapping, and every refusal with its remedy.
# - What the diagnosis prints and draws: [from a bench run to the missing cause](closed_loop.py).
