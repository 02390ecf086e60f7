"""Units over their life: what grows, what jumped, what stayed, from runs of one unit at different times."""
