"""Missions that are files: BehaviorTree.CPP 4's XML whose leaves are skills."""
