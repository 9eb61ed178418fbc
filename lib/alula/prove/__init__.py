"""Proofs: of one skillset (``skillset``), and of a mission together with the skillsets that it uses (``mission``).

``prove`` is all that others need for a skillset. See PROOFS.md beside the skillsets for each code with an example.
"""

from __future__ import annotations

from alula.prove.skillset.prover import prove

__all__ = ["prove"]
