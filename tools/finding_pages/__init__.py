"""Writes the pages of the manual that list findings, from the rules and their examples in the library."""
