"""Matching: which measured parts to join, and how to turn them, so that most units keep their limits."""
