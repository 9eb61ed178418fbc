"""Recorded measurements through the cores of nodes, in the order of their stamps and in virtual time."""

from node_core.replay.part import Arrival, Change, Replayed, SensorPart, dead, frozen

__all__ = ["Arrival", "Change", "Replayed", "SensorPart", "dead", "frozen"]
