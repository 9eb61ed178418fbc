"""What the drone's skills do: decisions, hooks over the functional layer, and an entry point for each skillset."""
