"""Depth from the ZED's stereo pair, and the nearest obstacle ahead. The node is in ``zed_depth.node``."""

from zed_depth.ahead import ZedAheadSettings, look_ahead
from zed_depth.calibration import CalibrationError, StereoCalibration, StereoGeometry
from zed_depth.confidence import confidence_of
from zed_depth.depth_scale import ScaleJudge, ScaleLimits, scale_of
from zed_depth.feature_motion import Landmarks
from zed_depth.image_health import ImageJudge, ImageLimits
from zed_depth.pairing import Pairing, StereoPair
from zed_depth.rig import Depth, StereoRig
from zed_depth.settings import ZedSettings
from zed_depth.stereo import DisparityRange, MatcherSettings, StereoMatcher, depth_of, points_of
from zed_depth.vergence import VergenceJudge, VergenceLimits
from zed_depth.view_health import ViewLimits

__all__ = [
    "CalibrationError",
    "Depth",
    "DisparityRange",
    "ImageJudge",
    "ImageLimits",
    "Landmarks",
    "MatcherSettings",
    "Pairing",
    "ScaleJudge",
    "ScaleLimits",
    "StereoCalibration",
    "StereoGeometry",
    "StereoMatcher",
    "StereoPair",
    "StereoRig",
    "VergenceJudge",
    "VergenceLimits",
    "ViewLimits",
    "ZedAheadSettings",
    "ZedSettings",
    "confidence_of",
    "depth_of",
    "look_ahead",
    "points_of",
    "scale_of",
]
