"""The node's parameters, and what follows from them."""

from __future__ import annotations

from dataclasses import dataclass

from lidar_obstacles.ahead import Body, LidarAheadSettings
from lidar_obstacles.cloud_health import CloudLimits
from lidar_obstacles.ground import GroundSettings
from perception_core import Corridor, HealthLimits, StampLimits, Support, tunable


@dataclass(frozen=True)
class LidarSettings:
    """Private parameters of /lidar_obstacles with their defaults; units in the names. Those with a range may be changed in flight."""

    enabled: bool = False
    """whether it looks ahead from the start; else `~enable` begins it"""
    # health
    timeout_s: float = tunable(0.35, 0.1, 5.0, "without a good sweep until broken")
    recover_s: float = tunable(1.0, 0.1, 30.0, "of good sweeps until mended")
    start_s: float = tunable(5.0, 0.5, 120.0, "of nothing at the start until broken")
    latency_s: float = tunable(0.0, 0.0, 2.0, "that the driver is known to need from the last return to the arrival")
    max_delay_s: float = tunable(0.35, 0.05, 5.0, "by which a sweep may be older than the known latency")
    min_returns: int = tunable(100, 1, 1_000_000, "returns of a sweep; fewer are none")
    thin_share: float = tunable(0.6, 0.0, 0.9, "of the returns just before; fewer are a broken sensor")
    max_range_m: float = tunable(250.0, 1.0, 2000.0, "by the sensor's specification")
    max_noise_m: float = tunable(0.12, 0.02, 10.0, "by which ranges may begin to scatter at once, where surfaces are smooth")
    max_speed_m_s: float = tunable(3.0, 0.5, 100.0, "of the vehicle; ranges on all sides that change faster are wrong")
    # corridor
    body_radius_m: float = tunable(1.0, 0.0, 5.0, "of the vehicle with propellers: returns from inside are its own")
    body_half_height_m: float = tunable(0.6, 0.0, 5.0, "of the vehicle, above and below base_link")
    length_m: float = tunable(12.0, 1.0, 50.0, "of the corridor")
    half_width_m: float = tunable(1.25, 0.1, 5.0, "of the corridor")
    half_height_m: float = tunable(0.6, 0.1, 5.0, "of the corridor")
    near_m: float = tunable(0.3, 0.0, 5.0, "from the vehicle's centre to where the corridor begins")
    floor_m: float = tunable(0.2, 0.0, 2.0, "above the ground; what is lower is ground")
    slope_deg: float = tunable(10.0, 0.0, 45.0, "of the steepest ground")
    min_points: int = tunable(3, 1, 1000, "returns within half a metre that are an obstacle")
    cell_m: float = tunable(0.25, 0.05, 2.0, "edge of the corridor's cells")
    min_ahead: int = tunable(4, 0, 1000, "returns from each five degrees of the view of the way ahead, or it is unknown")

    @property
    def health(self) -> HealthLimits:
        """When the LiDAR is broken."""
        return HealthLimits(timeout_s=self.timeout_s, recover_s=self.recover_s, start_s=self.start_s)

    @property
    def stamps(self) -> StampLimits:
        """When a sweep's stamp counts as faulty."""
        return StampLimits(latency_s=self.latency_s, max_delay_s=self.max_delay_s)

    @property
    def cloud(self) -> CloudLimits:
        """When a sweep counts as faulty."""
        return CloudLimits(
            min_returns=self.min_returns,
            thin_share=self.thin_share,
            max_range_m=self.max_range_m,
            max_speed_m_s=self.max_speed_m_s,
            max_noise_m=self.max_noise_m,
        )

    @property
    def ahead(self) -> LidarAheadSettings:
        """Where to look for obstacles. Three returns within half a metre: a pole gives that many, a speck of dust or rain does not."""
        corridor = Corridor(
            half_width_m=self.half_width_m,
            half_height_m=self.half_height_m,
            length_m=self.length_m,
            near_m=self.near_m,
            floor_m=self.floor_m,
        )
        return LidarAheadSettings(
            corridor=corridor,
            support=Support(min_points=self.min_points, cell_m=self.cell_m),
            body=Body(self.body_radius_m, self.body_half_height_m),
            ground=GroundSettings(slope_deg=self.slope_deg, length_m=self.length_m),
            min_ahead=self.min_ahead,
        )
