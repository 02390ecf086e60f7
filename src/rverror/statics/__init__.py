"""The loaded gear train: the equilibrium of its floating parts, predictions at the load of a run, rigidity."""
