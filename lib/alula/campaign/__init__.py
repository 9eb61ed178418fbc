"""Flies a campaign: many flights with faults, over mocks or in the simulator, and what became of each failure."""
