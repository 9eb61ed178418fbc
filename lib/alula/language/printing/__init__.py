"""The two notations as text: `text` has what they share, `paper` and `rl` how each writes a skill and a condition."""
