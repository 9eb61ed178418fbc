"""The yard: its description, its meshes and what rays and distances meet in it."""
