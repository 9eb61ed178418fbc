"""A world: its file, its meshes, what rays and distances meet in it, and where the radio is bad."""
