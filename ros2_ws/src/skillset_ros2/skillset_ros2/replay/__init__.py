"""Replays from the functional layer's bag: the real hooks of a robot over what the layer said and answered."""

from skillset_ros2.replay.functional import from_bag

__all__ = ["from_bag"]
