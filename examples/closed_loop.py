# %% [markdown]
# # From a bench run to the missing cause
#
# The example that `rverror demo` ships: an RV-40E as declared by its shop floor, and two simulated test-bench runs.
# They hold one effect that is not declared.

# %%
from importlib import resources

import rverror

shipped = resources.files("rverror") / "data" / "demo"

# %% [markdown]
# Three lines.

# %%
model = rverror.load_model(str(shipped / "model.toml"))
found = rverror.diagnose(model, [rverror.load_run(str(shipped / name)) for name in ("forward.csv", "reverse.csv")])
print(rverror.to_text(found))

# %% [markdown]
# What was added is an ordinary effect: the new model predicts, and can be saved with `rverror.save_model`.

# %%
for addition in found.added:
    print(addition.effect)
