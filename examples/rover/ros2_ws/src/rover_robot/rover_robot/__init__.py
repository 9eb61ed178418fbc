"""The rover's decisions besides its models: hooks, inputs and nodes of missions, and its part of the report."""
