"""A second derivation of the loaded gear train that judges what ``rverror allocate --at`` claims.

    python -m benchmarks.load_trial [--first 0] [--lists 20] [--units 2000] [--no-examples | --only-examples]

It takes nothing from rverror but the numbers of a model file: geometry and contacts (`planar`, `kernel`), units drawn
from a tolerance file (`draws`), their sizes (`sizes`) and random lists (`lists`) are written here from the conventions.
"""
