"""Makes the decisions of a recorded mission again, and tells where they differ."""
