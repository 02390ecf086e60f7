"""A model: the catalogue of all sources, the effects that are declared, and the output error in closed form."""
