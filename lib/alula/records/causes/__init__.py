"""What follows from what in a run: from a fault over resources, invariants and skills to the branch of the tree that answers it.

This is the one definition of it: the summary's recovery and answers, the report's table and the coverage of campaigns use it.
"""
