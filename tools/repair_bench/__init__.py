"""Measures what `alula repair` costs: for the robots' own missions without a branch, and for robots that grow."""
