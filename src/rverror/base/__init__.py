"""Ground: arrays and vectors, units, errors, text and TOML files, chance."""
