"""What is only of the drone in a run: its options and their checks, its autopilots, its faults, and how it lands."""
