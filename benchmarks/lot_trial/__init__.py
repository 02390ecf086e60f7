"""Lots of finished reducers for a trial of ``rverror lot``; their equilibrium shares no physics with the package.

    python -m benchmarks.lot_trial.make --seed S --out FOLDER [--kind plain] [--units N]

`exact` solves one reducer at exact poses, compiled, from `benchmarks.load_trial`; `make` draws a lot and writes it;
`spoilt` tells what the data hold of its spoilt units.
"""
