"""Faked neighbours for the live tests of the perception nodes: clock, guidance, mounts, the skillset, synthetic sensors."""

from perception_core.testing.flight import FakeFlight, framed, send_raw
from perception_core.testing.sensors import box_cloud, wall_pair

__all__ = ["FakeFlight", "box_cloud", "framed", "send_raw", "wall_pair"]
