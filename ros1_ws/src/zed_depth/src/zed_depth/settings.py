"""The node's parameters, and what follows from them."""

from __future__ import annotations

from dataclasses import dataclass

from perception_core import Corridor, HealthLimits, StampLimits, Support, tunable
from zed_depth.ahead import ZedAheadSettings
from zed_depth.depth_scale import ScaleLimits
from zed_depth.image_health import ImageLimits
from zed_depth.stereo import MatcherSettings
from zed_depth.view_health import ViewLimits


@dataclass(frozen=True)
class ZedSettings:
    """Private parameters of /zed_depth with their defaults; units in the names. Those with a range may be changed in flight."""

    enabled: bool = False
    """whether it looks ahead from the start; else `~enable` begins it"""
    threads: int = 2
    """of OpenCV, which matches four bands of the image by itself; the result does not depend on them"""
    rectified: bool = False
    """the images are, though their camera_info is that of the raw ones; else the camera_info decides"""
    # health
    timeout_s: float = tunable(0.35, 0.1, 5.0, "without a good pair until broken")
    recover_s: float = tunable(1.0, 0.1, 30.0, "of good pairs until mended")
    start_s: float = tunable(5.0, 0.5, 120.0, "of nothing at the start until broken")
    latency_s: float = tunable(0.0, 0.0, 2.0, "that the driver is known to need from the exposure to the arrival")
    max_delay_s: float = tunable(0.35, 0.05, 5.0, "by which a pair may be older than the known latency")
    sync_tolerance_s: float = tunable(0.005, 0.0, 0.1, "between the stamps of a pair's images")
    dark_mean: float = tunable(20.0, 0.0, 255.0, "grey levels; a darker image needs twice the contrast")
    min_contrast: float = tunable(4.0, 0.0, 100.0, "grey levels, deviation of the averaged image")
    max_saturated: float = tunable(0.6, 0.0, 1.0, "of the image that may be white")
    max_vertical_px: float = tunable(0.8, 0.1, 10.0, "by which matched features may be off their row")
    max_edge_px: float = tunable(6.0, 2.0, 20.0, "width of the strongest edges of a sharp image")
    view_period_s: float = tunable(0.4, 0.1, 5.0, "between two checks of both images against each other")
    max_scale_error: float = tunable(0.1, 0.02, 1.0, "by which depths may be too long or short by the vehicle's own motion")
    min_valid: float = tunable(0.02, 0.0, 1.0, "of the image that has a depth, or nothing is known")
    # matching
    max_width_px: int = tunable(640, 64, 4096, "of the images that are matched; larger ones are scaled down")
    near_depth_m: float = tunable(0.5, 0.1, 10.0, "that can be measured; what is nearer is told at this depth")
    block_px: int = tunable(5, 3, 21, "edge of the matched blocks, odd")
    uniqueness_percent: int = tunable(10, 0, 50, "by which the best match must be better than the second")
    speckle_px: int = tunable(120, 0, 2000, "of a patch of one depth that is believed")
    speckle_range_px: int = tunable(2, 1, 32, "of disparity within a patch")
    left_right_px: int = tunable(1, 0, 10, "between the matches from left and from right")
    texture_per_noise: float = tunable(1.3, 0.0, 10.0, "gradient that can be matched, in units of the noise")
    enough_texture: float = tunable(2.5, 0.0, 50.0, "grey levels a pixel that are texture whatever the noise")
    # corridor
    max_range_m: float = tunable(8.0, 1.0, 50.0, "of depths that are believed, and length of the corridor")
    stride_px: int = tunable(2, 1, 16, "of the pixels that become points")
    half_width_m: float = tunable(1.25, 0.1, 5.0, "of the corridor")
    half_height_m: float = tunable(0.6, 0.1, 5.0, "of the corridor")
    near_m: float = tunable(0.3, 0.0, 5.0, "from the vehicle's centre to where the corridor begins")
    floor_m: float = tunable(0.2, 0.0, 2.0, "above the map's ground; what is lower is ground")
    min_points: int = tunable(6, 1, 1000, "points within two cells that are an obstacle")
    min_area_m2: float = tunable(0.015, 0.0, 1.0, "of seen surface that are an obstacle")
    range_error_per_m: float = tunable(0.03, 0.0, 1.0, "growth of the corridor's cells with the square of the distance")
    min_known: float = tunable(0.05, 0.0, 1.0, "of the corridor's view that has a depth, or it is unknown")

    @property
    def health(self) -> HealthLimits:
        """When the camera is broken."""
        return HealthLimits(timeout_s=self.timeout_s, recover_s=self.recover_s, start_s=self.start_s)

    @property
    def stamps(self) -> StampLimits:
        """When a pair's stamp is not believed."""
        return StampLimits(latency_s=self.latency_s, max_delay_s=self.max_delay_s)

    @property
    def images(self) -> ImageLimits:
        """The limits beyond which an image is no picture."""
        return ImageLimits(dark_mean=self.dark_mean, min_contrast=self.min_contrast, max_saturated=self.max_saturated)

    @property
    def view(self) -> ViewLimits:
        """What is no stereo rig."""
        return ViewLimits(max_vertical_px=self.max_vertical_px, max_edge_px=self.max_edge_px)

    @property
    def scale(self) -> ScaleLimits:
        """When the scale of the depths is not believed."""
        return ScaleLimits(max_error=self.max_scale_error)

    @property
    def matcher(self) -> MatcherSettings:
        """The parameters of the stereo matcher, from those of the node."""
        return MatcherSettings(
            block_px=self.block_px | 1,
            uniqueness_percent=self.uniqueness_percent,
            speckle_px=self.speckle_px,
            speckle_range_px=self.speckle_range_px,
            left_right_px=self.left_right_px,
            texture_per_noise=self.texture_per_noise,
            enough_texture=self.enough_texture,
        )

    @property
    def ahead(self) -> ZedAheadSettings:
        """Where to look for obstacles; the corridor is as long as the camera sees."""
        corridor = Corridor(
            half_width_m=self.half_width_m,
            half_height_m=self.half_height_m,
            length_m=self.max_range_m,
            near_m=self.near_m,
            floor_m=self.floor_m,
        )
        support = Support(min_points=self.min_points, min_area_m2=self.min_area_m2, range_error_per_m=self.range_error_per_m)
        return ZedAheadSettings(
            corridor=corridor, support=support, max_range_m=self.max_range_m, stride_px=self.stride_px, min_known=self.min_known
        )
