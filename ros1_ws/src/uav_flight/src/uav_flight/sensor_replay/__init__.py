"""Recorded measurements through the perception's cores, in the order of their stamps and in virtual time."""
