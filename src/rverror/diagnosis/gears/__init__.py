"""The closed loop for reducers: one likelihood in samples, sizes that act through the loaded equilibrium."""
