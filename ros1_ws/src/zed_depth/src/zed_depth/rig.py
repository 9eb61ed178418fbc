"""The stereo rig: from raw images and camera_info to findings and depth, in the order of the pairs; no ROS."""

from __future__ import annotations

from dataclasses import dataclass, replace
from threading import Lock
from typing import TYPE_CHECKING

import numpy as np

from perception_core import FINE, NS, FaultKind, Finding, broken, first_trouble, unsure
from zed_depth.calibration import CalibrationError, InfoLike, StereoCalibration, StereoGeometry
from zed_depth.confidence import confidence_of
from zed_depth.depth_scale import ScaleJudge
from zed_depth.feature_motion import Compared, Views
from zed_depth.fixed_columns import fixed_columns_finding
from zed_depth.image_fit import fit_of
from zed_depth.image_health import SHARPNESS_FELL, ImageJudge
from zed_depth.info_change import change_finding
from zed_depth.stereo import DisparityRange, StereoMatcher, depth_of
from zed_depth.torn_images import TornJudge
from zed_depth.vergence import VergenceJudge, VergenceLimits
from zed_depth.view_health import ViewLimits, view_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from zed_depth.feature_motion import CameraPose
    from zed_depth.pairing import StereoPair
    from zed_depth.settings import ZedSettings

    Gray = NDArray[np.uint8]
    Mask = NDArray[np.bool_]

MEND_SHARE = 0.6  # of max_vertical_px
JUMPED_PX = 0.7  # the middle change of the disparities from pair to pair; with more, it is in doubt
NO_DEPTH = "what is in view has too little texture", "the images do not fit each other"
JUMP_STRIDE = 4
LEAST_COMPARED = 0.05  # of the pixels
SHARE_FELL = 0.92  # of the pixels that had a depth, or a parallax, in the pair before; with less, it is in doubt


@dataclass(frozen=True)
class Depth:
    """Depth of the matched left image: ``metres`` (h, w) float32, NaN where nothing is known.

    ``doubt`` says why what is not seen in it must not be taken for free, or nothing.
    """

    metres: NDArray[np.float32]
    geometry: StereoGeometry
    disparity_px: NDArray[np.float32]
    images: tuple[NDArray[np.uint8], NDArray[np.uint8]]
    doubt: str = ""

    def confidence(self) -> NDArray[np.float32]:
        """Return the confidence in each depth, (h, w) in 0 to 1."""
        return confidence_of(self.disparity_px, *self.images)


class StereoRig:
    """Judge pairs and measure depth. ``finding`` and ``depth`` may be called from two threads, each from one only.

    Both images are held against each other every ``view_period_s``, which takes as long as half a matching. A fault in between shows by
    what each pair tells at little cost: images that lost their sharpness are held against each other at once; where fewer pixels have a
    depth or a parallax than in the pair before, the pair is in doubt, and so are those after it until both images were found to fit again.
    Where depths are measured, each pair is judged by whether its images fit each other at them, else a pair of every ``view_period_s`` is.
    ``camera_pose`` tells the left camera's pose, without which the scale of the depths can't be judged.

    A camera_info that changes after good pairs makes the rig unknown, until the earlier one is back, or the vehicle's motion has shown
    that the depths are right with the new one.
    """

    def __init__(self, settings: ZedSettings, camera_pose: CameraPose = lambda _stamp_ns: None) -> None:
        self._settings = settings
        self._camera_pose = camera_pose
        self._begin_motion()
        self._images = ImageJudge(settings.images)
        self._torn = TornJudge()
        self._infos: dict[str, InfoLike] = {}
        self._lock = Lock()
        self._matching = Lock()
        self._calibration: StereoCalibration | None = None
        self._info_finding = unsure(FaultKind.INFO, "no camera_info of both sides yet")
        self._good_calibration: StereoCalibration | None = None  # that of the last good pair
        self._change = FINE  # of the calibration, from that one on
        self._matcher: tuple[StereoCalibration, StereoMatcher, Mask | None] | None = None
        self._view = FINE
        self._view_ns: int | None = None
        self._judged_ns: int | None = None  # the last pair that was held against another one, and of which it is known whether it fits
        self._sharpness: float | None = None  # of the images that were last held against each other
        self._valid = FINE  # of the last pair of which the depth was asked for
        self._fit = FINE  # of the last pair that was matched
        self._matched_ns: int | None = None
        # of the last pair that was not in doubt: shares of the pixels with a depth and with a parallax, and some disparities
        self._shares: dict[str, float] = {}
        self._sample: NDArray[np.float32] | None = None
        self._doubted_ns: int | None = None  # the first pair in doubt

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
            self._calibration, self._info_finding, self._view_ns = calibration, finding, None
            good = self._good_calibration
            self._change = FINE if good is None or calibration is None else change_finding(good, calibration)
            self._valid, self._fit, self._matched_ns = FINE, FINE, None
            self._shares, self._sample, self._doubted_ns = {}, None, None
        self._begin_motion()

    def _begin_motion(self) -> None:
        """Forget the earlier views, and the findings from them."""
        self._views, self._scale, self._vergence = Views(), ScaleJudge(self._settings.scale), VergenceJudge(VergenceLimits())

    def finding(self, pair: StereoPair) -> Finding:
        """Return the finding about this pair; call it once for each pair, in order."""
        images = first_trouble(self._images.finding(pair), fixed_columns_finding(pair.left, pair.right), self._torn.finding(pair))
        with self._lock:
            calibration, info = self._calibration, self._info_finding
        if calibration is None or not images.ok:
            self._view_ns = None  # what comes after the trouble is looked at at once
            return first_trouble(info, images)
        try:
            if self._match_due(pair):
                self._matched(calibration, pair)
            prepared = calibration.prepared(pair.left, pair.right) if self._due(pair) else None
        except CalibrationError as error:
            return broken(FaultKind.INFO, str(error))
        if prepared is not None:
            self._view_checked(pair.stamp_ns, prepared, calibration.geometry)
        with self._lock:
            finding = first_trouble(self._view, self._vergence.finding, self._scale.finding, self._fit, self._valid)
            if finding.ok and (self._change.ok or (self._scale.judged and self._vergence.judged)):
                self._good_calibration, self._change = calibration, FINE
            return first_trouble(finding, self._change)

    def _view_checked(self, stamp_ns: int, images: tuple[Gray, Gray], geometry: StereoGeometry) -> None:
        """Hold both images (h, w) against each other, and their features against those of views before."""
        view, judged = view_of(*images, offset_px=geometry.offset_px, limits=self._view_limits()), True
        self._view = view.finding
        if view.landmarks is not None and view.right is not None:
            knocked = self._vergence.look(stamp_ns, view.landmarks, view.right, geometry, self._camera_pose)
            judged = knocked is not None
            if knocked:
                self._views.clear()
            apart = self._views.take(stamp_ns, view.landmarks, self._camera_pose)
            if apart is not None:
                compared = Compared.of(*apart, geometry)
                self._vergence.compare(compared, geometry)
                self._scale.compare(compared, geometry)
        self._sharpness = self._images.sharpness
        with self._lock:
            self._view_ns = stamp_ns
            self._judged_ns = stamp_ns if judged else self._judged_ns

    def _view_limits(self) -> ViewLimits:
        """Return the limits; once found off, the rows must be clearly right again, or what is at the limit would flap."""
        limits = self._settings.view
        found = self._view.fault is FaultKind.CALIBRATION
        return replace(limits, max_vertical_px=MEND_SHARE * limits.max_vertical_px) if found else limits

    def _due(self, pair: StereoPair) -> bool:
        """Return whether both images must be held against each other now."""
        with self._lock:
            checked_ns, doubted_ns, judged_ns = self._view_ns, self._doubted_ns, self._judged_ns
        if checked_ns is None or not self._view.ok or (doubted_ns is not None and (judged_ns is None or judged_ns <= doubted_ns)):
            return True
        if self._sharpness is not None and self._images.sharpness < SHARPNESS_FELL * self._sharpness:
            return True
        return not 0 <= pair.stamp_ns - checked_ns < self._settings.view_period_s * NS

    def _match_due(self, pair: StereoPair) -> bool:
        """Return whether this pair must be matched to be judged: nothing else measures depths, or the last ones were not good."""
        with self._lock:
            matched_ns, ok = self._matched_ns, self._fit.ok and self._valid.ok
        return matched_ns is None or not ok or not 0 <= pair.stamp_ns - matched_ns < self._settings.view_period_s * NS

    def depth(self, pair: StereoPair) -> Depth:
        """Measure the depth of a pair; raise CalibrationError."""
        with self._lock:
            calibration = self._calibration
        if calibration is None:
            raise CalibrationError(self._info_finding.reason)
        depth = self._matched(calibration, pair)
        disparity = depth.disparity_px
        share = np.count_nonzero(np.isfinite(disparity)) / disparity.size
        parallax = disparity > calibration.geometry.offset_px + self._settings.view.min_parallax_px
        nearer = np.count_nonzero(parallax) / disparity.size
        with self._lock:
            self._valid = self._valid_finding(disparity)
            doubt = self._doubt({"depth": share, "parallax": nearer}, disparity[::JUMP_STRIDE, ::JUMP_STRIDE], pair.stamp_ns)
        return replace(depth, doubt=depth.doubt or doubt)

    def _valid_finding(self, disparity: NDArray[np.float32]) -> Finding:
        share = np.count_nonzero(np.isfinite(disparity)) / disparity.size
        enough = share >= self._settings.min_valid
        return FINE if enough else unsure(FaultKind.VIEW, f"only {share:.1%} of the image has a depth", *NO_DEPTH)

    def _matched(self, calibration: StereoCalibration, pair: StereoPair) -> Depth:
        """Match a pair, and judge whether its images fit; raise CalibrationError."""
        geometry, images = calibration.geometry, calibration.prepared(pair.left, pair.right)
        with self._matching:
            matcher, incomparable = self._matcher_for(calibration)
            disparity = matcher.disparity(*images)
            noise = matcher.noise
        if calibration.unseen[0] is not None:
            disparity[calibration.unseen[0]] = np.nan
        fit = fit_of(disparity, *images, last_px=matcher.search.last, noise=noise, incomparable=incomparable)
        with self._lock:
            self._fit, self._matched_ns = fit.finding, pair.stamp_ns
            if not self._valid.ok:
                self._valid = self._valid_finding(disparity)
        return Depth(depth_of(disparity, geometry), geometry, disparity, images, fit.finding.reason or fit.doubt)

    def _doubt(self, shares: dict[str, float], sample: NDArray[np.float32], stamp_ns: int) -> str:
        """Return why a pair with these shares of pixels and these disparities is in doubt, or an empty text; with the lock held."""
        before, doubted_ns, judged_ns = self._shares, self._doubted_ns, self._judged_ns
        fits = doubted_ns is not None and judged_ns is not None and doubted_ns < judged_ns <= stamp_ns
        again = doubted_ns is not None and stamp_ns < doubted_ns  # the clock went back
        fell = [name for name in before if shares[name] < SHARE_FELL * before[name]]
        jump_px = 0.0 if self._sample is None else middle_change(self._sample, sample)
        if fits or again or not (fell or abs(jump_px) > JUMPED_PX):
            self._shares, self._sample, self._doubted_ns = shares, sample, None
            return ""
        if doubted_ns is None:
            self._doubted_ns = stamp_ns
        if fell:
            return f"only {shares[fell[0]]:.0%} of the image has a {fell[0]}, {before[fell[0]]:.0%} had one just before"
        return f"the disparities changed by {jump_px:.1f} px from one pair to the next"

    def rest(self) -> None:
        """Forget the share of valid depth: no depth is measured for a while."""
        with self._lock:
            self._valid = FINE
            self._shares, self._sample, self._doubted_ns = {}, None, None

    def _matcher_for(self, calibration: StereoCalibration) -> tuple[StereoMatcher, Mask | None]:
        """Return the matcher of a calibration, and which pixels of the left image (h, w) it can't find in the right one."""
        if self._matcher is None or self._matcher[0] is not calibration:
            search = DisparityRange.to_see(calibration.geometry, self._settings.near_depth_m)
            matcher = StereoMatcher(self._settings.matcher, search)
            self._matcher = calibration, matcher, calibration.incomparable(int(np.ceil(search.last)))
        return self._matcher[1:]


def middle_change(before: NDArray[np.float32], now: NDArray[np.float32]) -> float:
    """Return the middle change of disparities (h, w), of the pixels that have one in both images; 0 where few have."""
    changes = (now - before)[np.isfinite(before) & np.isfinite(now)] if before.shape == now.shape else np.empty(0)
    return float(np.median(changes)) if len(changes) > LEAST_COMPARED * before.size else 0.0


def _same(one: InfoLike, other: InfoLike) -> bool:
    names = ("width", "height", "distortion_model", "D", "K", "R", "P", "binning_x", "binning_y", "roi")
    return all(tuple(np.atleast_1d(getattr(one, name))) == tuple(np.atleast_1d(getattr(other, name))) for name in names)
