"""A rectified stereo pair to disparity and depth by semi-global matching (Hirschmueller; OpenCV's StereoSGBM)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Gray = NDArray[np.uint8]


MEDIAN_PX = 5
TEXTURE_PX = 21
NOISE_KERNEL = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], dtype=np.float32)


@dataclass(frozen=True)
class StereoGeometry:
    """Pinhole of the left rectified camera, in pixels, and the distance between the cameras in metres."""

    fx: float
    fy: float
    cx: float
    cy: float
    baseline_m: float

    @classmethod
    def from_projections(cls, left: NDArray[np.float64], right: NDArray[np.float64]) -> StereoGeometry:
        """Read the 3x4 projection matrices of both CameraInfos; raise ValueError when they are no rectified pair."""
        fx, baseline_m = float(left[0, 0]), -float(right[0, 3]) / float(right[0, 0] or np.nan)
        if not (fx > 0.0 and baseline_m > 0.0):
            raise ValueError(f"no rectified stereo pair: fx {fx:g} px, baseline {baseline_m:g} m (the right P[3] must be -fx * baseline)")
        return cls(fx=fx, fy=float(left[1, 1]), cx=float(left[0, 2]), cy=float(left[1, 2]), baseline_m=baseline_m)

    def depth_error_m(self, depth_m: float, disparity_error_px: float) -> float:
        """Return the error of a depth for an error of the disparity: it grows with the square of the depth."""
        return depth_m**2 / (self.fx * self.baseline_m) * disparity_error_px


@dataclass(frozen=True)
class MatcherSettings:
    """Parameters of the matching.

    With fx 240 px and 0.12 m between the cameras, 64 disparities reach from 0.45 m, half the vehicle's radius. The image is widened by as
    many columns at the left, or its left ``disparities`` columns would have no depth at all. Where the mean gradient along the row is below
    ``texture_per_noise`` times the image's noise there is nothing to match: sky and blank walls would else be matched by chance. A gradient
    of ``enough_texture`` grey levels a pixel is texture whatever the noise seems to be.
    """

    disparities: int = 64
    block_px: int = 5
    uniqueness_percent: int = 10
    speckle_px: int = 120
    speckle_range_px: int = 2
    left_right_px: int = 1
    texture_per_noise: float = 1.3
    enough_texture: float = 2.5


class StereoMatcher:
    """Match pairs of one size; not thread-safe."""

    def __init__(self, settings: MatcherSettings) -> None:
        self._settings = settings
        smoothness = settings.block_px**2
        self._sgbm = cv2.StereoSGBM_create(
            minDisparity=0,
            numDisparities=settings.disparities,
            blockSize=settings.block_px,
            P1=8 * smoothness,
            P2=32 * smoothness,
            disp12MaxDiff=settings.left_right_px,
            preFilterCap=31,
            uniquenessRatio=settings.uniqueness_percent,
            speckleWindowSize=settings.speckle_px,
            speckleRange=settings.speckle_range_px,
            mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY,
        )

    def disparity(self, left: Gray, right: Gray) -> NDArray[np.float32]:
        """Return the disparity of the left image in pixels, NaN where there is none; raise ValueError when the sizes differ."""
        if left.shape != right.shape or left.ndim != 2:
            raise ValueError(f"left image {left.shape} and right image {right.shape}: expected two grey images of one size")
        pad = self._settings.disparities
        wide = [cv2.copyMakeBorder(image, 0, 0, pad, 0, cv2.BORDER_REPLICATE) for image in (left, right)]
        sixteenths = np.asarray(self._sgbm.compute(*wide)[:, pad:])
        # Without the one or two rows above an upper edge, where blocks see the edge but nothing tells how far along the row they match.
        sixteenths = cv2.medianBlur(np.maximum(sixteenths, 0).astype(np.uint16), MEDIAN_PX)
        disparity: NDArray[np.float32] = sixteenths.astype(np.float32) / np.float32(16.0)
        disparity[(sixteenths == 0) | self._without_texture(left)] = np.nan
        return disparity

    def _without_texture(self, image: Gray) -> NDArray[np.bool_]:
        least = min(self._settings.texture_per_noise * noise_level(image), self._settings.enough_texture)
        gradient = np.abs(cv2.Sobel(image, cv2.CV_16S, 1, 0, ksize=1))
        mean = cv2.boxFilter(gradient, cv2.CV_32F, (TEXTURE_PX, 1))
        # The Sobel kernel [-1 0 1] spans two pixels.
        flat: NDArray[np.bool_] = np.asarray(mean) < 2.0 * least
        return flat


def noise_level(image: Gray) -> float:
    """Return the deviation of the noise in grey levels, seen where the image is flattest (Immerkaer 1996); texture everywhere raises it."""
    response = np.abs(cv2.filter2D(image, cv2.CV_16S, NOISE_KERNEL))
    local = cv2.boxFilter(response, cv2.CV_32F, (TEXTURE_PX, 5))
    return float(np.percentile(np.asarray(local)[::4, ::4], 1.0) * np.sqrt(np.pi / 2.0) / 6.0)


def depth_of(disparity_px: NDArray[np.float32], geometry: StereoGeometry) -> NDArray[np.float32]:
    """Return the depth in metres along the optical axis, NaN where the disparity is NaN."""
    return np.float32(geometry.fx * geometry.baseline_m) / disparity_px


def points_of(
    depth_m: NDArray[np.float32], geometry: StereoGeometry, *, max_range_m: float, stride_px: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the points (N, 3) in the left optical frame and the surface (N,) in square metres that each stands for.

    Every ``stride_px``-th pixel of every ``stride_px``-th row is taken; a pixel's surface is its footprint across the view.
    """
    z = depth_m[::stride_px, ::stride_px]
    rows, columns = np.nonzero(z <= max_range_m)
    z_of = z[rows, columns].astype(np.float64)
    x = (columns * stride_px - geometry.cx) / geometry.fx * z_of
    y = (rows * stride_px - geometry.cy) / geometry.fy * z_of
    return np.stack([x, y, z_of], axis=1), z_of**2 * (stride_px**2 / (geometry.fx * geometry.fy))
