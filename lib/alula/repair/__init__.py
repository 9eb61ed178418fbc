"""Repair: write the fallback branch that a mission lacks, or a whole mission for a goal, and prove it."""
