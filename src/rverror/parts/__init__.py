"""Measured parts: what measuring machines say of cranks, discs, pins and housings, as errors of the catalogue."""
