"""Alula without ROS: the skill language, its proofs, managers, missions, records of runs and the operator's page."""
