"""What it costs a mission that its tree is watched by Groot2."""
