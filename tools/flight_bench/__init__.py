"""What a flight costs: the processor time of each of its processes, by phase."""
