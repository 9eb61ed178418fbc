"""Two CameraInfos to what the matching needs: checked, the images rectified where they are not, and scaled down where that is cheaper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import cv2
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Gray = NDArray[np.uint8]
    Mask = NDArray[np.bool_]

ROW_TOLERANCE_PX = 1.0  # by which the rows of both projections may disagree
FOCAL_LIMITS = (0.2, 10.0)  # of the width: views of 136 and of 6 degrees
BASELINE_LIMITS_M = (0.005, 3.0)
SIZE_LIMITS_PX = (32, 16_384)
CENTRE_LIMITS = (0.0, 1.0)  # of the size: the principal point of a cropped or convergent pair may be anywhere in the image, along one axis
SAME_SIZE = (0.3, 0.7)  # of the size: with half of its P, or twice, the point is beyond these to one side along both axes
BESIDE_PX = 5  # of what a raw image does not show: half of a block that is matched, and of a patch that is compared
LEAST_SEEN = 0.25  # of a rectified image that its raw image must show
FISHEYE = "equidistant"


class RegionLike(Protocol):
    """What is read of a sensor_msgs/RegionOfInterest: the part of the sensor that is sent, before binning; zeros: all of it."""

    x_offset: int
    y_offset: int
    width: int
    height: int


class InfoLike(Protocol):
    """What is read of a sensor_msgs/CameraInfo."""

    width: int
    height: int
    distortion_model: str
    D: Sequence[float]
    K: Sequence[float]
    R: Sequence[float]
    P: Sequence[float]
    binning_x: int
    binning_y: int
    roi: RegionLike


class CalibrationError(ValueError):
    """The camera_info can't be that of these images."""


@dataclass(frozen=True)
class StereoGeometry:
    """Pinhole of the left rectified camera, in pixels, and the distance between the cameras in metres.

    ``offset_px`` is the disparity of what is infinitely far away: the difference of the principal points, left minus right.
    """

    fx: float
    fy: float
    cx: float
    cy: float
    baseline_m: float
    offset_px: float = 0.0

    def disparity_of(self, depth_m: float) -> float:
        """Return the disparity in pixels at a depth."""
        return self.fx * self.baseline_m / depth_m + self.offset_px

    def scaled(self, divisor: int) -> StereoGeometry:
        """Return the geometry of images of which each ``divisor`` x ``divisor`` pixels were averaged."""
        return StereoGeometry(
            fx=self.fx / divisor,
            fy=self.fy / divisor,
            cx=(self.cx + 0.5) / divisor - 0.5,
            cy=(self.cy + 0.5) / divisor - 0.5,
            baseline_m=self.baseline_m,
            offset_px=self.offset_px / divisor,
        )


@dataclass(frozen=True)
class Camera:
    """One checked CameraInfo: what the rectification needs, for images of ``width`` x ``height``."""

    width: int
    height: int
    K: Floats
    D: Floats
    R: Floats
    P: Floats
    fisheye: bool

    @classmethod
    def of(cls, info: InfoLike, side: str) -> Camera:
        """Read and check one side's message; raise CalibrationError with a sentence."""
        D = np.array(info.D, dtype=np.float64)  # noqa: N806 -- the message's names
        K: Floats = np.array(info.K, dtype=np.float64).reshape(3, 3)  # noqa: N806
        R: Floats = np.array(info.R, dtype=np.float64).reshape(3, 3)  # noqa: N806
        P: Floats = np.array(info.P, dtype=np.float64).reshape(3, 4)  # noqa: N806
        if not all(np.isfinite(values).all() for values in (D, K, R, P)):
            raise CalibrationError(f"the {side} camera_info holds values that are not finite")
        bins = np.array([max(1, int(info.binning_x)), max(1, int(info.binning_y))])
        region = info.roi
        corner = np.array([region.x_offset, region.y_offset])
        size = np.array([region.width or info.width, region.height or info.height])
        if np.any(corner + size > (info.width, info.height)):
            raise CalibrationError(f"the {side} camera_info's region of interest is not within its {info.width}x{info.height} pixels")
        width, height = (int(length) for length in size // bins)
        least, most = SIZE_LIMITS_PX
        if not (least <= width <= most and least <= height <= most):
            raise CalibrationError(f"the {side} camera_info is for {width}x{height} images, expected {least} to {most} pixels each way")
        # K and P are those of the whole sensor.
        part = np.diag([1.0 / bins[0], 1.0 / bins[1], 1.0]) @ np.array([[1.0, 0.0, -corner[0]], [0.0, 1.0, -corner[1]], [0.0, 0.0, 1.0]])
        if not R.any():
            if D.any():
                raise CalibrationError(f"the {side} camera_info has a distortion but no rectification (R is zero): calibrate the pair")
            R = np.eye(3)  # noqa: N806
        if np.abs(R @ R.T - np.eye(3)).max() > 1e-3:
            raise CalibrationError(f"the {side} camera_info's R is no rotation")
        camera = cls(width=width, height=height, K=part @ K, D=D, R=R, P=part @ P, fisheye=info.distortion_model == FISHEYE)
        camera.check_projection(side)
        return camera

    def check_projection(self, side: str) -> None:
        """Raise CalibrationError unless P can be that of a camera with images of this size."""
        fx, fy, cx, cy = self.P[0, 0], self.P[1, 1], self.P[0, 2], self.P[1, 2]
        if not (fx > 0.0 and fy > 0.0):
            raise CalibrationError(f"the {side} camera_info's P has the focal lengths {fx:g} and {fy:g} px: the camera is not calibrated")
        low, high = (limit * self.width for limit in FOCAL_LIMITS)
        if not low <= fx <= high:
            raise CalibrationError(f"the {side} camera_info's fx of {fx:g} px is not that of images {self.width} px wide")
        centre = np.array([cx / self.width, cy / self.height])
        within = np.all((centre >= CENTRE_LIMITS[0]) & (centre <= CENTRE_LIMITS[1]))
        if not within or np.all(centre < SAME_SIZE[0]) or np.all(centre > SAME_SIZE[1]):
            raise CalibrationError(
                f"the {side} camera_info's principal point ({cx:.0f}, {cy:.0f}) is far from the middle of {self.width}x{self.height} images"
            )

    @property
    def rectified(self) -> bool:
        """Whether the images need no rectification."""
        if not self.K.any():
            return True
        same = np.abs(self.K - self.P[:, :3]).max() < 1e-6 * self.width
        return bool(same and not self.D.any() and np.abs(self.R - np.eye(3)).max() < 1e-9)

    def maps(self) -> tuple[NDArray[np.int16], NDArray[np.uint16]]:
        """Return OpenCV's maps from the rectified image to the raw one."""
        size = (self.width, self.height)
        if not (self.K[0, 0] > 0.0 and self.K[1, 1] > 0.0):
            raise CalibrationError(f"the camera_info's K has the focal lengths {self.K[0, 0]:g} and {self.K[1, 1]:g} px")
        try:
            if self.fisheye:
                first, second = cv2.fisheye.initUndistortRectifyMap(self.K, self.D[:4], self.R, self.P[:, :3], size, cv2.CV_16SC2)
            else:
                first, second = cv2.initUndistortRectifyMap(self.K, self.D, self.R, self.P[:, :3], size, cv2.CV_16SC2)
        except cv2.error as error:
            raise CalibrationError(f"the camera_info's K, D ({len(self.D)} numbers), R, P rectify no image: {error.err}") from error
        share = float(np.mean(self.shown(first)))
        if share < LEAST_SEEN:
            raise CalibrationError(
                f"the camera_info's raw image shows only {share:.0%} of its rectified one: its K, D, R, P are not of one camera"
            )
        return first, second

    def shown(self, places: NDArray[np.int16]) -> NDArray[np.bool_]:
        """Return which of the places (h, w, 2), column and row, are in the raw image."""
        inside: NDArray[np.bool_] = np.all((places >= 0) & (places < (self.width, self.height)), axis=2)
        return inside


def geometry_of(left: Camera, right: Camera) -> StereoGeometry:
    """Return the geometry of a rectified pair; raise CalibrationError when the projections are not those of one."""
    if (left.width, left.height) != (right.width, right.height):
        raise CalibrationError(f"the left camera_info is for {left.width}x{left.height} images, the right for {right.width}x{right.height}")
    fx, fy, cx, cy = (float(left.P[index]) for index in ((0, 0), (1, 1), (0, 2), (1, 2)))
    apart = {"fx": abs(right.P[0, 0] - fx), "fy": abs(right.P[1, 1] - fy), "cy": abs(right.P[1, 2] - cy)}
    for name, pixels in apart.items():
        if pixels > ROW_TOLERANCE_PX:
            raise CalibrationError(f"no rectified stereo pair: {name} of the left and the right P differ by {pixels:.1f} px")
    baseline_m = float(left.P[0, 3] / fx - right.P[0, 3] / right.P[0, 0])
    if not BASELINE_LIMITS_M[0] <= baseline_m <= BASELINE_LIMITS_M[1]:
        raise CalibrationError(f"no rectified stereo pair: the baseline is {baseline_m:g} m (the right P[3] must be -fx * baseline)")
    return StereoGeometry(fx=fx, fy=fy, cx=cx, cy=cy, baseline_m=baseline_m, offset_px=float(cx - right.P[0, 2]))


class StereoCalibration:
    """Make pairs of raw images ready for matching: rectified, and about ``max_width_px`` wide if they are larger."""

    def __init__(self, left: InfoLike, right: InfoLike, *, rectified: bool, max_width_px: int) -> None:
        """Raise CalibrationError; ``rectified``: the images are, though the camera_info may be that of the raw ones."""
        cameras = Camera.of(left, "left"), Camera.of(right, "right")
        self.size = (cameras[0].height, cameras[0].width)
        self.full = geometry_of(*cameras)
        self.divisor = max(1, round(cameras[0].width / max_width_px))
        self.geometry = self.full.scaled(self.divisor)
        self._maps = tuple(None if rectified or camera.rectified else camera.maps() for camera in cameras)
        self.unseen = tuple(self._unseen(camera, maps) for camera, maps in zip(cameras, self._maps, strict=True))
        """Which pixels of the prepared left and right image their raw image does not show, (h, w) each; None where it shows all of them."""

    def _unseen(self, camera: Camera, maps: tuple[NDArray[np.int16], NDArray[np.uint16]] | None) -> Mask | None:
        if maps is None:
            return None
        unseen: Mask = self._scaled(255 * camera.shown(maps[0]).astype(np.uint8)) < 255
        return unseen if unseen.any() else None

    def incomparable(self, reach_px: int) -> Mask | None:
        """Return which pixels (h, w) of the left image can't be found in the right one up to a disparity, or None.

        Where a raw image shows nothing, the prepared one repeats its border: these pixels, those beside them, and those that would be there
        in the right image.
        """
        beside = np.ones((2 * BESIDE_PX + 1, 2 * BESIDE_PX + 1), np.uint8)
        # The right image's are carried to the right alone, as far as a disparity is: so the anchor is the kernel's last column.
        reached = np.ones((1, max(0, reach_px) + 1), np.uint8)
        left, right = (None if each is None else cv2.dilate(each.astype(np.uint8), beside) for each in self.unseen)
        right = None if right is None else cv2.dilate(right, reached, anchor=(reached.shape[1] - 1, 0))
        masks = [np.asarray(each) > 0 for each in (left, right) if each is not None]
        return np.any(masks, axis=0) if masks else None

    def prepared(self, left: Gray, right: Gray) -> tuple[Gray, Gray]:
        """Return both images ready for matching; raise CalibrationError when they have another size than the camera_info says."""
        for side, image in (("left", left), ("right", right)):
            if image.shape != self.size:
                told, sent = (f"{shape[1]}x{shape[0]}" for shape in (self.size, image.shape))
                raise CalibrationError(f"camera_info is for {told} images, the {side} image is {sent}")
        return self._one(left, 0), self._one(right, 1)

    def _one(self, image: Gray, index: int) -> Gray:
        maps = self._maps[index]
        return self._scaled(
            image if maps is None else np.asarray(cv2.remap(image, *maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.uint8)
        )

    def _scaled(self, image: Gray) -> Gray:
        if self.divisor == 1:
            return image
        size = (image.shape[1] // self.divisor, image.shape[0] // self.divisor)
        whole = image[: size[1] * self.divisor, : size[0] * self.divisor]
        return np.asarray(cv2.resize(whole, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
