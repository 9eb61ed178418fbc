"""Replay the decisions of a recorded mission, and report where they differ."""
