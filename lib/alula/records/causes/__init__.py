"""Causes and effects in a run: from a fault over resources, invariants and skills to the branch of the tree that responds to it.

This is the one definition of it: the summary's recovery and responses, the report's table and the coverage of campaigns use it.
"""
