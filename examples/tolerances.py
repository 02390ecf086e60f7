# %% [markdown]
# # Tolerances of an RV-40E: what they make of the output error, and which ones to buy
#
# Four tolerances of the cycloid stage.  How large does the peak-to-peak get, which tolerance matters, what is the
# cheapest set that keeps 99 % of the units within 40 arcsec?

# %%
import rverror
from rverror import ARCSEC
from rverror.tolerances import cost as costs

unit = rverror.reducer("RV-40E")
model = rverror.Model(unit, name="RV-40E")
tolerances = (
    rverror.tolerance("crank.eccentricity", "5 um", cost=costs.ReciprocalSquare(price=12.0, at=0.005, base=5.0)),
    rverror.tolerance("cycloid.disc_bore_position", "6 um", cost=costs.Reciprocal(price=10.0, at=0.006, base=4.0)),
    rverror.tolerance("cycloid.pin_position", "6 um", cost=costs.Reciprocal(price=15.0, at=0.006, base=10.0)),
    # both discs are ground together, so their pitch errors are alike
    rverror.tolerance(
        "cycloid.disc_pitch", "4 um", harmonic=1, correlation=0.8, cost=costs.Reciprocal(price=6.0, at=0.004, base=2.0)
    ),
)  # prices are made up

# %% [markdown]
# The budget: closed form and virtual units.

# %%
budget = rverror.error_budget(model, tolerances, count=2**14, index_count=2**11)
print(rverror.to_text(budget, limit=40 * ARCSEC))

# %% [markdown]
# The allocation in closed form: least cost within the limit, checked by units that took no part in finding it.

# %%
bought = rverror.allocate(model, tolerances, limit="40 arcsec", verify=2**14)
print(rverror.to_text(bought))
