"""Runs: files of measured or simulated angles, their checks, and the virtual test bench."""
