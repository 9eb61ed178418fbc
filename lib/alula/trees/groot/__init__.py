"""Missions in the tools that people of BehaviorTree.CPP watch trees with: Groot2's protocol and its log."""
