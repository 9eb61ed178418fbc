"""What the decision side of a robot takes while nothing is asked of it."""
