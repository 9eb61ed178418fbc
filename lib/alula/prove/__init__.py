"""Proofs: of one skillset (``skillset.prover``), and of a mission together with the skillsets that it uses (``mission.prover``).

Nothing is imported here: counterexamples are played where no solver is installed. PROOFS.md beside the skillsets has an example for each
code.
"""
