"""The gear train: its geometry and motion, the principle, and the five sub-assemblies with their error sources."""
