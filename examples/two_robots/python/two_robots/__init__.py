"""What a fleet of two robots adds to missions."""
