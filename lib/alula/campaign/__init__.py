"""Campaigns: many runs with faults, over mocks or in the simulator, and the response of the mission to each failure."""
