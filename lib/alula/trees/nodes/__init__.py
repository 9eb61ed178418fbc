"""BehaviorTree.CPP 4's own nodes, under their names and with their ports, one module a family."""
