"""The stereo rig: from raw images and camera_info to findings and depth, in the order of the pairs; no ROS."""

from __future__ import annotations

from dataclasses import dataclass
from threading import Lock
from typing import TYPE_CHECKING

import numpy as np

from perception_core import FINE, NS, FaultKind, Finding, broken, first_trouble, unsure
from zed_depth.calibration import CalibrationError, InfoLike, StereoCalibration, StereoGeometry
from zed_depth.confidence import confidence_of
from zed_depth.image_health import ImageJudge
from zed_depth.stereo import DisparityRange, StereoMatcher, depth_of
from zed_depth.view_health import view_finding

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from zed_depth.pairing import StereoPair
    from zed_depth.settings import ZedSettings


@dataclass(frozen=True)
class Depth:
    """Depth of the matched left image: ``metres`` (h, w) float32, NaN where nothing is known."""

    metres: NDArray[np.float32]
    geometry: StereoGeometry
    disparity_px: NDArray[np.float32]
    images: tuple[NDArray[np.uint8], NDArray[np.uint8]]

    def confidence(self) -> NDArray[np.float32]:
        """Return the confidence in each depth, (h, w) in 0 to 1."""
        return confidence_of(self.disparity_px, *self.images)


class StereoRig:
    """Judge pairs and measure depth. ``finding`` and ``depth`` may be called from two threads, each from one only."""

    def __init__(self, settings: ZedSettings) -> None:
        self._settings = settings
        self._images = ImageJudge(settings.images)
        self._infos: dict[str, InfoLike] = {}
        self._lock = Lock()
        self._calibration: StereoCalibration | None = None
        self._info_finding = unsure(FaultKind.INFO, "no camera_info of both sides yet")
        self._matcher: tuple[StereoGeometry, StereoMatcher] | None = None
        self._view = FINE
        self._view_ns: int | None = None
        self._valid = FINE

    def take_info(self, side: str, info: InfoLike) -> None:
        """Take a camera_info of the side ``left`` or ``right``; the calibration is rebuilt only when it changes."""
        before = self._infos.get(side)
        if before is not None and _same(before, info):
            return
        self._infos[side] = info
        if len(self._infos) < 2:
            return
        calibration: StereoCalibration | None = None
        finding = FINE
        try:
            calibration = StereoCalibration(
                self._infos["left"],
                self._infos["right"],
                rectified=self._settings.rectified,
                max_width_px=self._settings.max_width_px,
            )
        except CalibrationError as error:
            finding = broken(FaultKind.INFO, str(error))
        with self._lock:
            self._calibration, self._info_finding, self._view_ns, self._valid = calibration, finding, None, FINE

    def finding(self, pair: StereoPair) -> Finding:
        """Return what this pair tells of the rig; call it once for each pair, in order."""
        images = self._images.finding(pair)
        with self._lock:
            calibration, info, valid = self._calibration, self._info_finding, self._valid
        if calibration is None or not images.ok:
            self._view_ns = None  # what comes after the trouble is looked at at once
            return first_trouble(info, images)
        due = self._view_ns is None or not self._view.ok or not 0 <= pair.stamp_ns - self._view_ns < self._settings.view_period_s * NS
        if due:
            try:
                prepared = calibration.prepared(pair.left, pair.right)
            except CalibrationError as error:
                return broken(FaultKind.INFO, str(error))
            self._view = view_finding(*prepared, offset_px=calibration.geometry.offset_px, limits=self._settings.view)
            self._view_ns = pair.stamp_ns
        return first_trouble(self._view, valid)

    def depth(self, pair: StereoPair) -> Depth:
        """Measure the depth of a pair; raise CalibrationError."""
        with self._lock:
            calibration = self._calibration
        if calibration is None:
            raise CalibrationError(self._info_finding.reason)
        matcher = self._matcher_for(calibration.geometry)
        images = calibration.prepared(pair.left, pair.right)
        disparity = matcher.disparity(*images)
        share = float(np.mean(np.isfinite(disparity)))
        finding = FINE if share >= self._settings.min_valid else unsure(FaultKind.VIEW, f"only {share:.1%} of the image has a depth")
        with self._lock:
            self._valid = finding
        return Depth(depth_of(disparity, calibration.geometry), calibration.geometry, disparity, images)

    def rest(self) -> None:
        """Forget the share of valid depth: no depth is measured for a while."""
        with self._lock:
            self._valid = FINE

    def _matcher_for(self, geometry: StereoGeometry) -> StereoMatcher:
        if self._matcher is None or self._matcher[0] != geometry:
            search = DisparityRange.to_see(geometry, self._settings.near_depth_m)
            self._matcher = geometry, StereoMatcher(self._settings.matcher, search)
        return self._matcher[1]


def _same(one: InfoLike, other: InfoLike) -> bool:
    names = ("width", "height", "distortion_model", "D", "K", "R", "P", "binning_x", "binning_y")
    return all(tuple(np.atleast_1d(getattr(one, name))) == tuple(np.atleast_1d(getattr(other, name))) for name in names)
