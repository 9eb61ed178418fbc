"""What is asked of recorded runs: causes, conformance to the model, expectations, comparison, replay."""
