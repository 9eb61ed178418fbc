"""Proofs about one skillset: what is wrong in some block, and what can go wrong in some run, with that run as a counterexample.

``prove`` is all that others need. See PROOFS.md beside the skillsets for each code with an example.
"""

from __future__ import annotations

from alula.prove.prover import prove

__all__ = ["prove"]
