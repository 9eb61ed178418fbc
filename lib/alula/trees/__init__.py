"""Behaviour Trees in BehaviorTree.CPP 4's XML: read, checked, ticked, drawn and watched."""
