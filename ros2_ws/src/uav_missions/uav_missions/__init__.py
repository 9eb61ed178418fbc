"""Missions of the drone as Behaviour Trees whose leaves are skills."""
