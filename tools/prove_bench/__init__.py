"""How far proofs scale: those of skillsets and those of missions, over models and trees that grow."""
