"""The closed loop: what measured runs say that a model lacks."""
