"""Measures how long the command line takes to start."""
