"""Lots: what the processes made, told from the measured errors of many finished units."""
