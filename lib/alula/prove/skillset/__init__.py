"""Proofs about one skillset: what is wrong in some block, and what can go wrong in some run, with that run as a counterexample."""
