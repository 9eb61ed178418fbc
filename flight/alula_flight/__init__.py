"""A run from start to report: what starts the processes of a flight, watches them, ends them, and tells what happened."""
