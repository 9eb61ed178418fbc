"""Camera images of all common encodings to grey ones of 8 bits; no ROS, a message is what has its attributes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import cv2
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray


class ImageLike(Protocol):
    """What is read of a sensor_msgs/Image."""

    height: int
    width: int
    encoding: str
    is_bigendian: int
    step: int
    data: bytes


@dataclass(frozen=True)
class Encoding:
    """How the pixels lie in memory, and OpenCV's conversion to grey; None: they are grey."""

    channels: int
    bits: int = 8
    to_gray: int | None = None


# ROS names a Bayer pattern by its first row, OpenCV by its second row's second and third pixel: BG for RGGB.
_BAYER = {
    "rggb": cv2.COLOR_BayerBG2GRAY,
    "bggr": cv2.COLOR_BayerRG2GRAY,
    "gbrg": cv2.COLOR_BayerGR2GRAY,
    "grbg": cv2.COLOR_BayerGB2GRAY,
}
_COLOURS = {
    "rgb": (3, cv2.COLOR_RGB2GRAY),
    "bgr": (3, cv2.COLOR_BGR2GRAY),
    "rgba": (4, cv2.COLOR_RGBA2GRAY),
    "bgra": (4, cv2.COLOR_BGRA2GRAY),
}
ENCODINGS = {
    **{name: Encoding(1) for name in ("mono8", "8UC1")},
    **{name: Encoding(1, 16) for name in ("mono16", "16UC1")},
    **{f"{name}{bits}": Encoding(channels, bits, code) for name, (channels, code) in _COLOURS.items() for bits in (8, 16)},
    **{f"bayer_{name}{bits}": Encoding(1, bits, code) for name, code in _BAYER.items() for bits in (8, 16)},
    "8UC3": Encoding(3, 8, cv2.COLOR_BGR2GRAY),
    "8UC4": Encoding(4, 8, cv2.COLOR_BGRA2GRAY),
    "yuv422": Encoding(2, 8, cv2.COLOR_YUV2GRAY_UYVY),
    "yuv422_yuy2": Encoding(2, 8, cv2.COLOR_YUV2GRAY_YUY2),
}
SHORT_BITS = (16, 14, 12, 10, 8)
SAMPLED = 4  # every so many pixels of so many rows tell how bright an image is
BRIGHTEST = 99.5  # percentile: a few hot pixels do not say how many bits there are


class GrayConverter:
    """Turn the images of one camera into grey ones; not thread-safe.

    A camera of 10, 12 or 14 bits sends 16 of them, filled from below: how many it uses is judged by the brightest pixels seen so far.
    """

    def __init__(self) -> None:
        self._bits = 8

    def gray(self, message: ImageLike) -> NDArray[np.uint8]:
        """Return (height, width) uint8; raise ValueError for an unknown encoding, an image without pixels, or too little data."""
        encoding = ENCODINGS.get(message.encoding)
        if encoding is None:
            raise ValueError(f"encoding {message.encoding!r}; known are {', '.join(sorted(ENCODINGS))}")
        pixels = _pixels(message, encoding)
        shallow = self._to_8_bits(pixels) if encoding.bits == 16 else np.ascontiguousarray(pixels, dtype=np.uint8)
        convert: Callable[..., NDArray[np.uint8]] = cv2.cvtColor
        return shallow if encoding.to_gray is None else convert(shallow, encoding.to_gray)

    def _to_8_bits(self, pixels: NDArray[np.integer]) -> NDArray[np.uint8]:
        needed = int(np.percentile(pixels[::SAMPLED, ::SAMPLED], BRIGHTEST)).bit_length()
        self._bits = max(self._bits, min(bits for bits in SHORT_BITS if bits >= needed))
        return np.asarray(np.minimum(pixels >> (self._bits - 8), 255), dtype=np.uint8)


def _pixels(message: ImageLike, encoding: Encoding) -> NDArray[np.integer]:
    """Return the pixels (height, width[, channels]), a view into the message."""
    height, width, step = message.height, message.width, message.step
    item = encoding.bits // 8
    row = width * encoding.channels * item
    if height == 0 or width == 0:
        raise ValueError(f"no pixels: {width}x{height}")
    if step < row or len(message.data) < (height - 1) * step + row:
        raise ValueError(f"{len(message.data)} bytes for {width}x{height} {message.encoding} with a step of {step}")
    order = ">" if message.is_bigendian else "<"
    strides = (step, encoding.channels * item, item)
    raw: NDArray[np.integer] = np.ndarray((height, width, encoding.channels), np.dtype(f"{order}u{item}"), message.data, 0, strides)
    return raw[:, :, 0] if encoding.channels == 1 else raw
