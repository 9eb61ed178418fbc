"""The node's parameters, and what follows from them."""

from __future__ import annotations

from dataclasses import dataclass

from perception_core import Corridor, HealthLimits, Support
from zed_depth.ahead import AheadSettings
from zed_depth.pairing import ImageLimits
from zed_depth.stereo import MatcherSettings


@dataclass(frozen=True)
class ZedSettings:
    """Private parameters of /zed_depth with their defaults; units in the names."""

    enabled: bool = False
    threads: int = 1
    # health
    timeout_s: float = 0.35
    recover_s: float = 1.0
    start_s: float = 5.0
    sync_tolerance_s: float = 0.005
    min_mean: float = 4.0
    min_std: float = 2.0
    # matching
    disparities: int = 64
    block_px: int = 5
    uniqueness_percent: int = 10
    speckle_px: int = 120
    speckle_range_px: int = 2
    left_right_px: int = 1
    texture_per_noise: float = 1.3
    enough_texture: float = 2.5
    # corridor
    max_range_m: float = 8.0
    stride_px: int = 2
    half_width_m: float = 1.25
    half_height_m: float = 0.6
    near_m: float = 0.3
    floor_m: float = 0.2
    min_points: int = 6
    min_area_m2: float = 0.015
    range_error_per_m: float = 0.03

    @property
    def health(self) -> HealthLimits:
        """When the camera is broken."""
        return HealthLimits(timeout_s=self.timeout_s, recover_s=self.recover_s, start_s=self.start_s)

    @property
    def images(self) -> ImageLimits:
        """What is no picture."""
        return ImageLimits(min_mean=self.min_mean, min_std=self.min_std)

    @property
    def matcher(self) -> MatcherSettings:
        """How to match."""
        return MatcherSettings(
            disparities=self.disparities,
            block_px=self.block_px,
            uniqueness_percent=self.uniqueness_percent,
            speckle_px=self.speckle_px,
            speckle_range_px=self.speckle_range_px,
            left_right_px=self.left_right_px,
            texture_per_noise=self.texture_per_noise,
            enough_texture=self.enough_texture,
        )

    @property
    def ahead(self) -> AheadSettings:
        """Where to look for obstacles; the corridor is as long as the camera sees."""
        corridor = Corridor(
            half_width_m=self.half_width_m,
            half_height_m=self.half_height_m,
            length_m=self.max_range_m,
            near_m=self.near_m,
            floor_m=self.floor_m,
        )
        support = Support(min_points=self.min_points, min_area_m2=self.min_area_m2, range_error_per_m=self.range_error_per_m)
        return AheadSettings(corridor=corridor, support=support, max_range_m=self.max_range_m, stride_px=self.stride_px)
