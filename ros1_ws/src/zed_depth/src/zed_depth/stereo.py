"""A rectified stereo pair to disparity and depth by semi-global matching (Hirschmueller; OpenCV's StereoSGBM)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from zed_depth.calibration import StereoGeometry

    Gray = NDArray[np.uint8]


MEDIAN_PX = 5
TEXTURE_PX = 21
NOISE_KERNEL = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], dtype=np.float32)
NOISE_EVERY = 5  # pairs; a camera's noise changes with the light, not from image to image
MOST_DISPARITIES = 256
COARSE = 6  # the search for what is too near is done in images of a sixth of the size ...
COARSE_SHARE = 0.5  # ... and up to half of their width
LOOK = 4  # the coarse disparity image, from which features are followed, is matched in images of a quarter of the size ...
LOOK_REACH = 0.3  # ... and this share of their width
SURELY_PX = 6.0  # by which a coarse disparity must be beyond the range: its own error


@dataclass(frozen=True)
class MatcherSettings:
    """Parameters of the matching.

    The image is widened by as many columns at the left as there are disparities, or these would have no depth at all. Where the mean
    gradient along the row is below ``texture_per_noise`` times the image's noise there is nothing to match: sky and blank walls would else
    be matched by chance. A gradient of ``enough_texture`` grey levels a pixel is texture whatever the noise seems to be.
    """

    block_px: int = 5
    uniqueness_percent: int = 10
    speckle_px: int = 120
    speckle_range_px: int = 2
    left_right_px: int = 1
    texture_per_noise: float = 1.3
    enough_texture: float = 2.5


@dataclass(frozen=True)
class DisparityRange:
    """The disparities that are searched, in pixels: from ``first`` on, ``count`` of them."""

    first: int = 0
    count: int = 64

    @classmethod
    def to_see(cls, geometry: StereoGeometry, near_m: float) -> DisparityRange:
        """Return the range from infinity to ``near_m``, or as near as `MOST_DISPARITIES` reach."""
        first = int(np.floor(geometry.offset_px))
        wanted = geometry.disparity_of(near_m) - first + 1
        return cls(first=first, count=min(MOST_DISPARITIES, 16 * int(np.ceil(wanted / 16))))

    @property
    def last(self) -> int:
        """The greatest disparity that is searched, pixels."""
        return self.first + self.count - 1


def sgbm(settings: MatcherSettings, search: DisparityRange, speckle_px: int) -> cv2.StereoSGBM:
    """Return OpenCV's semi-global matcher (3-way mode) for these disparities; ``speckle_px`` is the largest region to drop."""
    smoothness = settings.block_px**2
    return cv2.StereoSGBM_create(
        minDisparity=search.first,
        numDisparities=search.count,
        blockSize=settings.block_px,
        P1=8 * smoothness,
        P2=32 * smoothness,
        disp12MaxDiff=settings.left_right_px,
        preFilterCap=31,
        uniquenessRatio=settings.uniqueness_percent,
        speckleWindowSize=speckle_px,
        speckleRange=settings.speckle_range_px,
        mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY,
    )


class StereoMatcher:
    """Match pairs of one size; not thread-safe."""

    def __init__(self, settings: MatcherSettings, search: DisparityRange) -> None:
        self._settings = settings
        self.search = search
        self._sgbm = sgbm(settings, search, settings.speckle_px)
        self._coarse = self._coarse_for(0)
        self.noise = 0.0
        """Deviation of the left images' noise, grey levels."""
        self._pairs = 0

    def _coarse_for(self, width: int) -> tuple[int, int, cv2.StereoSGBM]:
        count = max(16, 16 * int(width / COARSE * COARSE_SHARE / 16))
        return width, count, sgbm(self._settings, DisparityRange(0, count), self._settings.speckle_px // COARSE**2)

    def disparity(self, left: Gray, right: Gray) -> NDArray[np.float32]:
        """Return the disparity (h, w) of the left image in pixels; raise ValueError when the sizes differ.

        NaN where nothing is known. What is nearer than the range is at its end: at the near limit.
        """
        if left.shape != right.shape or left.ndim != 2:
            raise ValueError(f"left image {left.shape} and right image {right.shape}: expected two grey images of one size")
        sixteenths = _padded(self._sgbm, self.search.last, left, right)
        # Without the one or two rows above an upper edge, where blocks see the edge but nothing tells how far along the row they match.
        sixteenths = cv2.medianBlur(sixteenths, MEDIAN_PX)
        textured = self._textured(left)
        pixels: NDArray[np.float32] = np.multiply(sixteenths, np.float32(1.0 / 16.0), dtype=np.float32)
        pixels[(sixteenths < 16 * self.search.first) | (textured == 0)] = np.nan
        self._put_near(pixels, textured, left, right)
        return pixels

    def _put_near(self, pixels: NDArray[np.float32], textured: Gray, left: Gray, right: Gray) -> None:
        """Put what is nearer than the range to its end: in the range it would match something by chance, and that is farther away."""
        if self._coarse[0] != left.shape[1]:
            self._coarse = self._coarse_for(left.shape[1])
        _, count, matcher = self._coarse
        size = (left.shape[1] // COARSE, left.shape[0] // COARSE)
        if COARSE * count <= self.search.last or min(size) < 2 * self._settings.block_px:
            return
        small = [cv2.resize(image, size, interpolation=cv2.INTER_AREA) for image in (left, right)]
        coarse = _padded(matcher, count, *small).astype(np.float32) * np.float32(COARSE / 16.0)
        near = (coarse > self.search.last + SURELY_PX) & (cv2.resize(textured, size, interpolation=cv2.INTER_AREA) >= 128)
        # What the right camera can't see can't have been matched.
        near &= COARSE * np.arange(size[0], dtype=np.float32) >= coarse
        if near.any():
            whole = np.repeat(np.repeat(near, COARSE, axis=0), COARSE, axis=1)
            pixels[: whole.shape[0], : whole.shape[1]][whole] = self.search.last

    def _textured(self, image: Gray) -> Gray:
        """Return 255 where there is enough texture around a pixel to be matched, else 0, (h, w)."""
        if self._pairs % NOISE_EVERY == 0:
            self.noise = noise_level(image)
        self._pairs += 1
        least = min(self._settings.texture_per_noise * self.noise, self._settings.enough_texture)
        # The difference spans two pixels.
        difference = np.zeros_like(image)
        cv2.absdiff(image[:, 2:], image[:, :-2], dst=difference[:, 1:-1])
        mean = cv2.boxFilter(difference, cv2.CV_32F, (TEXTURE_PX, 1))
        # By numpy: OpenCV takes thirty times as long to compare an image with a number.
        textured: Gray = (np.asarray(mean) >= np.float32(2.0 * max(least, 0.1))).view(np.uint8) * np.uint8(255)
        return textured


def _padded(matcher: cv2.StereoSGBM, columns: int, left: Gray, right: Gray) -> NDArray[np.int16]:
    """Match images that are widened at the left, and return the disparities of the original ones, in sixteenths of a pixel."""
    pad = max(0, columns)
    wide = [cv2.copyMakeBorder(image, 0, 0, pad, 0, cv2.BORDER_REPLICATE) for image in (left, right)]
    return np.asarray(matcher.compute(*wide)[:, pad:])


def coarse_disparity(settings: MatcherSettings, left: Gray, right: Gray, offset_px: float) -> NDArray[np.float32]:
    """Return the disparity (h, w) in pixels, matched at a quarter of the size: good to a few pixels, at a sixtieth of the effort.

    Searched are disparities from that of infinity, ``offset_px``, to `LOOK_REACH` of the width beyond. NaN where nothing is known.
    """
    height, width = left.shape
    size = (width // LOOK, height // LOOK)
    search = DisparityRange(int(np.floor(offset_px / LOOK)) - 2, 16 * int(np.ceil(LOOK_REACH * size[0] / 16)))
    small = [np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), dtype=np.uint8) for image in (left, right)]
    sixteenths = _padded(sgbm(settings, search, settings.speckle_px // LOOK**2), search.last, *small)
    pixels = np.where(sixteenths < 16 * search.first, np.float32(np.nan), sixteenths * np.float32(LOOK / 16.0))
    return np.asarray(cv2.resize(pixels, (width, height), interpolation=cv2.INTER_NEAREST), dtype=np.float32)


def noise_level(image: Gray) -> float:
    """Return the deviation of the noise in grey levels, seen where the image is flattest (Immerkaer 1996); texture everywhere raises it."""
    response = np.abs(cv2.filter2D(image, cv2.CV_16S, NOISE_KERNEL))
    local = cv2.boxFilter(response, cv2.CV_32F, (TEXTURE_PX, 5))
    return float(np.percentile(np.asarray(local)[::4, ::4], 1.0) * np.sqrt(np.pi / 2.0) / 6.0)


def depth_of(disparity_px: NDArray[np.float32], geometry: StereoGeometry) -> NDArray[np.float32]:
    """Return the depth in metres along the optical axis, NaN where the disparity is, infinite where it is that of infinity or less."""
    parallax = disparity_px - np.float32(geometry.offset_px)
    depth: NDArray[np.float32] = np.float32(geometry.fx * geometry.baseline_m) / np.maximum(parallax, np.float32(1e-6))
    return depth


def points_of(
    depth_m: NDArray[np.float32], geometry: StereoGeometry, wanted: NDArray[np.bool_], *, stride_px: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the points (N, 3) in the left optical frame and the surface (N,) in square metres that each stands for.

    Every ``stride_px``-th pixel of every ``stride_px``-th row is taken if it is ``wanted``, a mask of these; a pixel's surface is its
    footprint across the view.
    """
    rows, columns = np.nonzero(wanted)
    z = depth_m[::stride_px, ::stride_px][rows, columns].astype(np.float64)
    x = (columns * stride_px - geometry.cx) / geometry.fx * z
    y = (rows * stride_px - geometry.cy) / geometry.fy * z
    return np.stack([x, y, z], axis=1), z**2 * (stride_px**2 / (geometry.fx * geometry.fy))
