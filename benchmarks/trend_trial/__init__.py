"""One reducer measured over its life, for a trial of ``rverror trend``; poses are those of `lot_trial.exact`.

    python -m benchmarks.trend_trial.make --seed S --out FOLDER [--kind growing] [--sessions 20]
    python -m benchmarks.trend_trial --first S [--units N] [--kind growing] [--early]

`make` draws a unit's life and writes it; `judging` compares what is said of it with what is true.
"""
