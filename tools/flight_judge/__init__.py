"""Judges the flights of a campaign by the simulator's truth, without the report's code."""
