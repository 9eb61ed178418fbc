"""Depth from the ZED's stereo pair, and the nearest obstacle ahead. The node is in ``zed_depth.node``."""

from zed_depth.ahead import AheadSettings, obstacle_ahead
from zed_depth.pairing import ImageLimits, Pairing, PairJudge, StereoPair
from zed_depth.settings import ZedSettings
from zed_depth.stereo import MatcherSettings, StereoGeometry, StereoMatcher, depth_of, points_of

__all__ = [
    "AheadSettings",
    "ImageLimits",
    "MatcherSettings",
    "PairJudge",
    "Pairing",
    "StereoGeometry",
    "StereoMatcher",
    "StereoPair",
    "ZedSettings",
    "depth_of",
    "obstacle_ahead",
    "points_of",
]
