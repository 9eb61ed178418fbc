"""Faked neighbours for the live tests of the perception nodes: clock, guidance, mounts, the skillset, synthetic sensors."""

from perception_core.testing.faults import Expected, check_fault
from perception_core.testing.flight import FakeFlight, framed, send_raw
from perception_core.testing.sensors import box_cloud, wall_pair

__all__ = ["Expected", "FakeFlight", "box_cloud", "check_fault", "framed", "send_raw", "wall_pair"]
