"""CameraInfos that are right, wrong, and of raw images; the rectification on a rendered chessboard."""

from __future__ import annotations

from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from zed_depth import CalibrationError, StereoCalibration
from zed_depth.calibration import BESIDE_PX

WIDTH, HEIGHT = 480, 270


def region(x_offset=0, y_offset=0, width=0, height=0) -> SimpleNamespace:
    return SimpleNamespace(x_offset=x_offset, y_offset=y_offset, width=width, height=height)


def info(*, right=False, fx=240.0, cx=240.0, cy=135.0, baseline_m=0.12, **changes) -> SimpleNamespace:
    shift = -fx * baseline_m if right else 0.0
    given = {
        "width": WIDTH,
        "height": HEIGHT,
        "distortion_model": "plumb_bob",
        "D": [],
        "K": [fx, 0, cx, 0, fx, cy, 0, 0, 1],
        "R": [1, 0, 0, 0, 1, 0, 0, 0, 1],
        "P": [fx, 0, cx, shift, 0, fx, cy, 0, 0, 0, 1, 0],
        "binning_x": 0,
        "binning_y": 0,
        "roi": region(),
    }
    return SimpleNamespace(**{**given, **changes})


def calibration(left=None, right=None, *, rectified=False, max_width_px=640) -> StereoCalibration:
    return StereoCalibration(left or info(), right or info(right=True), rectified=rectified, max_width_px=max_width_px)


def test_a_rectified_pair_is_taken_as_it_is() -> None:
    images = [np.random.default_rng(k).integers(0, 255, (HEIGHT, WIDTH)).astype(np.uint8) for k in (0, 1)]
    made = calibration(right=info(right=True, cx=234.0))
    assert all(np.array_equal(before, after) for before, after in zip(images, made.prepared(*images), strict=True))
    assert (made.geometry.baseline_m, made.geometry.offset_px) == (pytest.approx(0.12), 6.0)
    without_k = calibration(info(K=[0.0] * 9, R=[0.0] * 9), info(right=True, K=[0.0] * 9, R=[0.0] * 9))
    assert np.array_equal(without_k.prepared(*images)[0], images[0])


def test_large_images_are_scaled_with_their_geometry() -> None:
    big = {"width": 1280, "height": 720, "fx": 700.0, "cx": 639.5, "cy": 359.5}
    made = calibration(info(**big), info(right=True, **big))
    image = np.zeros((720, 1280), np.uint8)
    assert made.prepared(image, image)[0].shape == (360, 640)
    assert (made.geometry.fx, made.geometry.cx, made.geometry.cy) == (350.0, 319.5, 179.5)
    assert made.full.disparity_of(2.0) == pytest.approx(2 * made.geometry.disparity_of(2.0))


def test_binned_images_have_the_calibration_of_the_whole_sensor() -> None:
    whole = {"width": 960, "height": 540, "fx": 480.0, "cx": 480.0, "cy": 270.0, "binning_x": 2, "binning_y": 2}
    made = calibration(info(**whole), info(right=True, **whole))
    assert made.size == (HEIGHT, WIDTH)
    assert (made.geometry.fx, made.geometry.baseline_m) == (240.0, pytest.approx(0.12))


def test_a_part_of_the_sensor_has_the_calibration_of_the_whole() -> None:
    whole = {"width": 960, "height": 540, "fx": 480.0, "cx": 480.0, "cy": 270.0}
    parts = {"roi": region(96, 60, 768, 400), "binning_x": 2, "binning_y": 2}
    made = calibration(info(**whole, **parts), info(right=True, **whole, **parts))
    assert made.size == (200, 384)
    assert (made.geometry.fx, made.geometry.cx, made.geometry.cy) == (240.0, 192.0, 105.0)
    assert (made.geometry.baseline_m, made.geometry.offset_px) == (pytest.approx(0.12), 0.0)
    farther = calibration(info(**whole, roi=region(96, 60, 768, 400)), info(right=True, **whole, roi=region(80, 60, 768, 400)))
    assert farther.geometry.offset_px == -16.0  # the right part begins farther to the left


@pytest.mark.parametrize(("cx", "cy"), [(84.0, 135.0), (432.0, 135.0), (240.0, 40.0), (144.0, 100.0)])
def test_the_principal_point_of_a_cropped_pair_may_be_anywhere_along_one_axis(cx, cy) -> None:
    made = calibration(info(cx=cx, cy=cy), info(right=True, cx=cx - 60.0, cy=cy))
    assert (made.geometry.cx, made.geometry.cy, made.geometry.offset_px) == (cx, cy, 60.0)


def test_what_the_raw_image_does_not_show_is_told_apart() -> None:
    """Rectified with a shorter focal length than that of the raw image, the image has a border that no camera saw."""
    raw = {"D": [-0.05, 0.0, 0.0, 0.0, 0.0], "K": [300.0, 0, 240.0, 0, 300.0, 135.0, 0, 0, 1], "fx": 240.0}
    unseen = calibration(info(**raw), info(right=True, **raw)).unseen
    for each in unseen:
        assert each is not None
        assert each.shape == (HEIGHT, WIDTH)
        assert each[:, :25].all()
        assert each[:8].all()
        assert not each[40:-40, 60:-60].any()
    assert calibration().unseen == (None, None)


def test_what_one_raw_image_does_not_show_can_not_be_compared_up_to_a_disparity() -> None:
    whole, narrow = info(), info(right=True, K=[300.0, 0, 240.0, 0, 300.0, 135.0, 0, 0, 1])
    made = calibration(whole, narrow)
    assert made.unseen[0] is None
    assert made.unseen[1] is not None
    last = int(np.flatnonzero(made.unseen[1][HEIGHT // 2, : WIDTH // 2])[-1])  # of the left border
    incomparable = made.incomparable(20)
    assert incomparable is not None
    assert np.flatnonzero(~incomparable[HEIGHT // 2])[0] == last + BESIDE_PX + 20 + 1
    assert calibration().incomparable(20) is None


NAN_P = [float("nan")] * 12
BAD_PAIRS = {
    "P of zeros": (info(P=[0] * 12), None, "P has the focal lengths 0 and 0 px: the camera is not calibrated"),
    "P of NaN": (info(P=NAN_P), None, "the left camera_info holds values that are not finite"),
    "K of infinity": (None, info(right=True, K=[float("inf")] * 9), "the right camera_info holds values that are not finite"),
    "no baseline": (None, info(), "the baseline is -0 m|the baseline is 0 m"),
    "swapped infos": (info(right=True), info(), r"the baseline is -0\.12 m"),
    "baseline in millimetres": (None, info(right=True, baseline_m=120.0), "the baseline is 120 m"),
    "other sizes": (None, info(right=True, width=640), "left camera_info is for 480x270 images, the right for 640x270"),
    "doubled P": (info(fx=480, cx=480, cy=270), None, r"principal point \(480, 270\) is far from the middle of 480x270 images"),
    "halved P": (info(fx=120, cx=119.75, cy=67.25), None, r"principal point \(120, 67\) is far from the middle of 480x270 images"),
    "outside": (info(cx=-20.0), None, r"principal point \(-20, 135\) is far from the middle"),
    "part beyond the sensor": (info(roi=region(100, 0, 480, 270)), None, "region of interest is not within its 480x270 pixels"),
    "P of another camera": (
        info(D=[-0.3, 0.1, 0, 0, 0], K=[900.0, 0, 240.0, 0, 900.0, 135.0, 0, 0, 1]),
        None,
        "raw image shows only 7% of its rectified one",
    ),
    "no size": (info(width=0, height=0), None, "the left camera_info is for 0x0 images, expected 32 to 16384 pixels each way"),
    "absurd size": (None, info(right=True, width=2**31), "the right camera_info is for 2147483648x270 images"),
    "D of no model": (info(D=[-0.3, 0.1, 0.0]), None, r"D \(3 numbers\), R, P rectify no image"),
    "K without focal lengths": (info(D=[-0.3, 0.1, 0, 0, 0], K=[0, 0, 1, 0, 0, 1, 0, 0, 1]), None, "K has the focal lengths 0 and 0 px"),
    "absurd focal length": (info(fx=9000), None, "fx of 9000 px is not that of images 480 px wide"),
    "rows apart": (None, info(right=True, cy=140.0), "cy of the left and the right P differ by 5.0 px"),
    "zoom apart": (None, info(right=True, fx=250.0), "fx of the left and the right P differ by 10.0 px"),
    "distortion without rectification": (info(D=[0.1, 0, 0, 0, 0], R=[0] * 9), None, "a distortion but no rectification"),
    "R no rotation": (info(R=[2, 0, 0, 0, 1, 0, 0, 0, 1]), None, "R is no rotation"),
}


@pytest.mark.parametrize("name", BAD_PAIRS)
def test_what_is_no_calibration_of_a_pair_is_told(name) -> None:
    left, right, sentence = BAD_PAIRS[name]
    with pytest.raises(CalibrationError, match=sentence):
        calibration(left, right)


def test_images_of_another_size_than_their_info_are_told() -> None:
    made = calibration(info(width=960, height=540, fx=480, cx=480, cy=270), info(right=True, width=960, height=540, fx=480, cx=480, cy=270))
    image = np.zeros((HEIGHT, WIDTH), np.uint8)
    with pytest.raises(CalibrationError, match="camera_info is for 960x540 images, the left image is 480x270"):
        made.prepared(image, image)


MODELS = {
    "plumb_bob": [-0.28, 0.07, 0.001, -0.0005, 0.0],
    "rational_polynomial": [-0.25, 0.05, 0.001, 0.0, 0.01, 0.02, 0.01, 0.0],
    "equidistant": [-0.02, 0.004, -0.001, 0.0],
}


@pytest.mark.parametrize("model", MODELS)
def test_raw_pairs_have_their_corners_where_the_projection_says(model) -> None:
    """Project points of a board into two distorted, turned cameras; their places in the rectified images give their depth."""
    board = np.array([[x, y, 1.5 + 0.2 * x] for y in np.linspace(-0.35, 0.35, 5) for x in np.linspace(-0.5, 0.6, 6)])
    matrix = np.array([[238.0, 0, 243.0], [0, 239.0, 131.0], [0, 0, 1]])
    turns = [cv2.Rodrigues(np.array(turn))[0] for turn in ((0.01, -0.02, 0.015), (-0.012, 0.017, -0.02))]
    infos, images = [], []
    for side, turn in enumerate(turns):
        seen = (board - [0.12 * side, 0, 0]) @ turn  # turn is the message's R: from the camera to the rectified frame
        distortion = np.array(MODELS[model])
        project = cv2.fisheye.projectPoints if model == "equidistant" else cv2.projectPoints
        arguments = (seen.reshape(-1, 1, 3), np.zeros(3), np.zeros(3), matrix, distortion)
        places = project(*arguments)[0].reshape(-1, 2)
        infos.append(info(right=bool(side), K=matrix.ravel(), R=turn.ravel(), D=distortion, distortion_model=model))
        images.append(_dots(places))
    prepared = calibration(*infos).prepared(*images)
    left, right = (_centres(image) for image in prepared)
    assert len(left) == len(right) == len(board)
    expected = np.stack([240 * board[:, 0] / board[:, 2] + 240, 240 * board[:, 1] / board[:, 2] + 135], axis=1)
    for place, depth_m in zip(expected, board[:, 2], strict=True):
        here = left[np.argmin(np.hypot(*(left - place).T))]
        there = right[np.argmin(np.hypot(*(right - place + [240 * 0.12 / depth_m, 0]).T))]
        assert here == pytest.approx(place, abs=0.35)
        assert 28.8 / (here[0] - there[0]) == pytest.approx(depth_m, rel=0.03)


def _dots(places) -> np.ndarray:
    rows, columns = np.mgrid[0:HEIGHT, 0:WIDTH]
    image = sum(np.exp(-((columns - x) ** 2 + (rows - y) ** 2) / 8.0) for x, y in places)
    return np.clip(255 * image, 0, 255).astype(np.uint8)


def _centres(image) -> np.ndarray:
    count, labels = cv2.connectedComponents((image > 60).astype(np.uint8))
    rows, columns = np.mgrid[0 : image.shape[0], 0 : image.shape[1]]
    weights = [np.where(labels == k, image, 0).astype(float) for k in range(1, count)]
    return np.array([[(w * columns).sum() / w.sum(), (w * rows).sum() / w.sum()] for w in weights])
