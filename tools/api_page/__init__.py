"""Writes docs/api.md, the reference of the public names, from their docstrings."""
