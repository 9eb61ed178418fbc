"""Measurements of the perception nodes; nothing that ships imports it."""
