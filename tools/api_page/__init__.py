"""Writes docs/reference/api.md, the reference of the public names, from their docstrings."""
