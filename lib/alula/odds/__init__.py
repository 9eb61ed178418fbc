"""How likely a mission ends in which way: what a robot's models can do, with figures of faults and results, by the model checker Storm."""
