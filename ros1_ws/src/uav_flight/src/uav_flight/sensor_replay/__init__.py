"""Recorded measurements through the real perception nodes, in the order of their stamps and in virtual time."""
