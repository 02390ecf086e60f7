"""The likelihood of a reducer's whole periods: harmonics in units of their noise."""
