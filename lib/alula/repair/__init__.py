"""Writes the fallback branch that a mission lacks, and has it proved."""
