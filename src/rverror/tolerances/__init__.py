"""Tolerances: budgets, very many virtual units, and what the tolerances should be."""
