"""Life: what grows and what jumped in one unit, told from its runs at different times."""
