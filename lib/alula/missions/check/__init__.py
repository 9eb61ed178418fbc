"""A mission's file against the models of its robot: what of the file alone is wrong is found by ``alula.trees.check``."""
