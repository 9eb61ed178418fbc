"""Images in all encodings become the same grey picture; what is no picture is refused."""

from __future__ import annotations

from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from perception_core.images import ENCODINGS, GrayConverter

GRAY = cv2.GaussianBlur(np.random.default_rng(1).uniform(0, 255, (24, 32)).astype(np.float32), (0, 0), 4.0)
GRAY = cv2.normalize(GRAY, None, 5, 250, cv2.NORM_MINMAX).astype(np.uint8)


def message(pixels, encoding, *, padding=0, bigendian=False) -> SimpleNamespace:
    pixels = pixels.astype(pixels.dtype.newbyteorder(">")) if bigendian else pixels
    rows = [row.tobytes() + bytes(padding) for row in pixels]
    height, width = pixels.shape[:2]
    return SimpleNamespace(
        height=height, width=width, encoding=encoding, is_bigendian=int(bigendian), step=len(rows[0]), data=b"".join(rows)
    )


def as_encoding(name) -> np.ndarray:
    encoding = ENCODINGS[name]
    channels = {1: GRAY, 2: np.dstack([GRAY, GRAY]), 3: np.dstack([GRAY] * 3), 4: np.dstack([GRAY] * 4)}[encoding.channels]
    return channels.astype(np.uint16) * 257 if encoding.bits == 16 else channels


@pytest.mark.parametrize("name", ENCODINGS)
@pytest.mark.parametrize(("padding", "bigendian"), [(0, False), (6, True)])
def test_the_same_picture_in_every_encoding(name, padding, bigendian) -> None:
    gray = GrayConverter().gray(message(as_encoding(name), name, padding=padding, bigendian=bigendian))
    assert (gray.shape, gray.dtype) == (GRAY.shape, np.uint8)
    tolerance = 12 if name.startswith("bayer") else 1  # neighbours are mixed
    assert np.abs(gray.astype(int) - GRAY)[2:-2, 2:-2].max() <= tolerance


def test_a_red_picture_is_bright_where_it_is_red() -> None:
    red = np.zeros((4, 4, 3), np.uint8)
    red[..., 0] = 200
    assert GrayConverter().gray(message(red, "rgb8")).mean() == pytest.approx(60, abs=1)
    assert GrayConverter().gray(message(red, "bgr8")).mean() == pytest.approx(23, abs=1)


def test_a_camera_of_12_bits_is_not_dark_and_does_not_flicker() -> None:
    converter = GrayConverter()
    assert converter.gray(message(GRAY.astype(np.uint16) << 4, "mono16")).max() == GRAY.max()
    assert converter.gray(message(GRAY.astype(np.uint16) << 2, "mono16")).max() == GRAY.max() >> 2


def test_a_hot_pixel_makes_no_camera_of_12_bits_dark() -> None:
    converter, deep = GrayConverter(), GRAY.astype(np.uint16) << 4
    deep[1, 2] = 65535
    assert np.array_equal(converter.gray(message(deep, "mono16"))[4:], GRAY[4:])
    assert converter.gray(message(deep, "mono16"))[1, 2] == 255


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"width": 0, "height": 0}, "no pixels: 0x0"),
        ({"data": b"\0" * 700}, "700 bytes for 32x24"),
        ({"step": 31}, "with a step of 31"),
        ({"encoding": "jpeg"}, "encoding 'jpeg'; known are 16UC1"),
    ],
)
def test_what_is_no_picture_is_refused(change, sentence) -> None:
    wrong = SimpleNamespace(**{**vars(message(GRAY, "mono8")), **change})
    with pytest.raises(ValueError, match=sentence):
        GrayConverter().gray(wrong)


@given(st.binary(max_size=300), st.integers(0, 40), st.integers(0, 40), st.integers(0, 200), st.sampled_from(sorted(ENCODINGS)))
@settings(max_examples=150)
def test_garbage_is_read_or_refused(data, width, height, step, encoding) -> None:
    garbage = SimpleNamespace(height=height, width=width, encoding=encoding, is_bigendian=0, step=step, data=data)
    try:
        gray = GrayConverter().gray(garbage)
    except ValueError:
        return
    assert gray.shape == (height, width)
