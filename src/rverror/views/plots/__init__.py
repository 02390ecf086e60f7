"""Plots, one call away: `drawing.draw` finds the one for what is shown."""
