"""Compensation: what is added to the command of the input so that the output goes where it is told."""
