"""The node's parameters, and what follows from them."""

from __future__ import annotations

from dataclasses import dataclass

from lidar_obstacles.ahead import AheadSettings
from perception_core import Corridor, HealthLimits, Support


@dataclass(frozen=True)
class LidarSettings:
    """Private parameters of /lidar_obstacles with their defaults; units in the names."""

    enabled: bool = False
    # health
    timeout_s: float = 0.35
    recover_s: float = 1.0
    start_s: float = 5.0
    min_returns: int = 20
    # corridor
    self_m: float = 1.2
    length_m: float = 12.0
    half_width_m: float = 1.25
    half_height_m: float = 0.6
    near_m: float = 0.3
    floor_m: float = 0.2
    min_points: int = 3
    cell_m: float = 0.25

    @property
    def health(self) -> HealthLimits:
        """When the LiDAR is broken."""
        return HealthLimits(timeout_s=self.timeout_s, recover_s=self.recover_s, start_s=self.start_s)

    @property
    def ahead(self) -> AheadSettings:
        """Where to look for obstacles. Three returns within half a metre: a pole gives that many, a speck of dust or rain does not."""
        corridor = Corridor(
            half_width_m=self.half_width_m,
            half_height_m=self.half_height_m,
            length_m=self.length_m,
            near_m=self.near_m,
            floor_m=self.floor_m,
        )
        return AheadSettings(corridor=corridor, support=Support(min_points=self.min_points, cell_m=self.cell_m), self_m=self.self_m)
