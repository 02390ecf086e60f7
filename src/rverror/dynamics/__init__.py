"""Dynamics: natural modes of the loaded gear train, its output error at speed, and its motion in time."""
