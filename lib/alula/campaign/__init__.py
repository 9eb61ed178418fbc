"""Does a campaign: many runs with faults, over mocks or in the simulator, and what became of each failure."""
