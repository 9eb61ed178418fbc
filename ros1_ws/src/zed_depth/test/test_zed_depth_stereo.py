"""Stereo on a real pair with ground truth (Middlebury's Motorcycle) and on synthetic walls; what is too near; pairing of images."""

from __future__ import annotations

import os
from pathlib import Path

import cv2
import numpy as np
import pytest

from perception_core import NS, Corridor, PoseBuffer, PoseUnavailableError, VehicleMotion
from perception_core.testing import wall_pair
from zed_depth import (
    DisparityRange,
    MatcherSettings,
    Pairing,
    StereoGeometry,
    StereoMatcher,
    ZedSettings,
    confidence_of,
    depth_of,
    look_ahead,
    points_of,
)

ZED = StereoGeometry(fx=240.0, fy=240.0, cx=240.0, cy=135.0, baseline_m=0.12)
ROOT = Path(__file__).resolve().parents[4]
DATA = Path(os.environ.get("ALULA_DATA", ROOT.parent / "shared" / "data")) / "stereo_motorcycle"


def disparity(left, right, *, first=0, count=64):
    return StereoMatcher(MatcherSettings(), DisparityRange(first, count)).disparity(left, right)


@pytest.mark.skipif(not DATA.exists(), reason=f"no real data at {DATA}: set ALULA_DATA")
def test_motorcycle_against_its_ground_truth() -> None:
    left, right = (cv2.imread(str(DATA / f"motorcycle_{side}.png"), cv2.IMREAD_GRAYSCALE) for side in ("left", "right"))
    truth = np.load(DATA / "motorcycle_disp.npz")["arr_0"]
    found = StereoMatcher(MatcherSettings(), DisparityRange(0, 80)).disparity(left, right)
    known = np.isfinite(truth)
    both = known & np.isfinite(found)
    bad = np.abs(found - truth) > 2.0
    # Measured: 5.9 % of the pixels with a disparity are off by more than 2 px, and 89 % of those with ground truth have one.
    assert bad[both].mean() < 0.07
    assert both.sum() / known.sum() > 0.85
    # Measured: 24.5 % bad in the tenth with the least confidence, 1 % in the half with the most.
    confidence = confidence_of(found, left, right)
    least, half = np.quantile(confidence[both], [0.1, 0.5])
    assert bad[both & (confidence <= least)].mean() > 0.15
    assert bad[both & (confidence >= half)].mean() < 0.02


@pytest.mark.parametrize("disparity_px", [3.6, 6.0, 10.5, 24.0])
def test_distance_of_a_wall_is_right_to_a_quarter_pixel(disparity_px) -> None:
    depth = depth_of(disparity(*wall_pair(disparity_px, seed=1)), ZED)
    expected_m = 28.8 / disparity_px
    assert np.isfinite(depth).mean() > 0.9
    assert abs(float(np.nanmedian(depth)) - expected_m) < 0.25 * expected_m**2 / (ZED.fx * ZED.baseline_m)


def test_the_number_of_threads_changes_no_bit_of_the_result() -> None:
    threads = cv2.getNumThreads()
    found = []
    try:
        for count in (1, 2, 3):
            cv2.setNumThreads(count)
            found.append(disparity(*wall_pair(8.5, seed=1)).tobytes())
    finally:
        cv2.setNumThreads(threads)
    assert len(set(found)) == 1


def test_the_left_columns_have_depth_too() -> None:
    found = disparity(*wall_pair(8.0, seed=2))
    assert np.isfinite(found[20:-20, 16:64]).mean() > 0.9


def test_sky_above_a_wall_is_nowhere() -> None:
    left, right = wall_pair(6.0, seed=3)
    noise = np.random.default_rng(4).normal(0.0, 2.0, (2, 120, 480))
    left[:120], right[:120] = (np.clip(190.0 + grain, 0, 255).astype(np.uint8) for grain in noise)
    found = disparity(left, right)
    assert np.isfinite(found[:115]).mean() < 0.002
    assert np.isfinite(found[125:]).mean() > 0.9


def test_points_lie_in_the_optical_frame_and_pixels_have_a_footprint() -> None:
    depth = np.full((270, 480), np.nan, dtype=np.float32)
    depth[136, 360] = 4.0
    depth[0, 0] = 9.0
    points, areas = points_of(depth, ZED, depth[::2, ::2] <= 8.0, stride_px=2)
    assert points == pytest.approx(np.array([[2.0, 4.0 / 240.0, 4.0]]))
    assert areas == pytest.approx([(2 * 4.0 / 240.0) ** 2])


def test_images_of_two_sizes_are_refused() -> None:
    with pytest.raises(ValueError, match="one size"):
        disparity(np.zeros((10, 20), np.uint8), np.zeros((10, 22), np.uint8))


def test_obstacle_is_where_the_wall_stands_in_the_map() -> None:
    poses = PoseBuffer()
    half = 0.5**0.5
    poses.add(NS, (10.0, 5.0, 3.0), (0.0, 0.0, half, half))  # looking north
    optical = np.array([[0.0, 0, 1, 0.3], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
    depth = depth_of(disparity(*wall_pair(8.0, seed=5)), ZED)
    ahead = ZedSettings().ahead

    def look(stamp_ns, motion=VehicleMotion()):  # noqa: B008 -- a frozen value
        return look_ahead(depth, stamp_ns, geometry=ZED, T_base_camera=optical, poses=poses, motion=motion, settings=ahead)

    found = look(NS).nearest
    assert found is not None
    assert found.distance_m == pytest.approx(3.9, abs=0.2)
    assert found.point_enu_m[1] == pytest.approx(8.9, abs=0.3)
    back = look(NS, VehicleMotion(velocity_enu_m_s=(0.0, -1.0, 0.0)))
    assert (back.nearest, back.unknown) == (None, "the camera does not look where the vehicle goes")
    assert look(NS).unknown == ""
    depth[80:190, 210:270] = np.nan  # a nearer obstacle may be there
    assert look(NS).nearest is not None
    assert look(NS).unknown == "only 0% of a part of the view ahead has a depth"
    depth[:] = np.nan
    blind = look(NS)
    assert (blind.nearest, blind.unknown) == (None, "only 0% of a part of the view ahead has a depth")
    depth[:] = 30.0
    assert (look(NS).nearest, look(NS).unknown) == (None, "")
    depth[:, : depth.shape[1] // 2] = np.nan  # as where both lenses are covered alike
    assert (look(NS).nearest, look(NS).unknown) == (None, "only 0% of a part of the view ahead has a depth")
    depth[:] = 30.0
    depth[80:190, 210:270] = np.nan  # as behind a drop on both lenses: it hides 0.7 m at 3 m
    assert (look(NS).nearest, look(NS).unknown) == (None, "only 0% of a part of the view ahead has a depth")
    with pytest.raises(PoseUnavailableError):
        look(3 * NS)
    assert ahead.corridor == Corridor(length_m=8.0)


def grey(seed) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 255, (30, 40)).astype(np.uint8)


def test_pairs_are_of_one_moment_and_images_used_once() -> None:
    pairing = Pairing(tolerance_s=0.005)
    assert pairing.add("left", NS, grey(1)) is None
    assert pairing.add("right", NS - NS // 10, grey(2)) is None
    assert pairing.apart_s() == pytest.approx(0.1)
    pair = pairing.add("right", NS + 4_000_000, grey(3))
    assert pair is not None
    assert pair.stamp_ns == NS
    assert pairing.add("right", NS, grey(3)) is None


@pytest.mark.parametrize("images_late", [1, 5])
def test_images_of_one_side_that_come_later_than_the_others_next_ones_find_their_partners(images_late) -> None:
    pairing = Pairing(tolerance_s=0.005)
    pairs = []
    for k in range(20):
        pairs.append(pairing.add("left", NS + k * NS // 60, grey(k)))
        late = k - images_late
        if late >= 0:
            pairs.append(pairing.add("right", NS + late * NS // 60 + 1_000_000, grey(100 + late)))
        assert pairing.apart_s() == 0.0
    made = [pair for pair in pairs if pair is not None]
    assert [pair.stamp_ns for pair in made] == [NS + k * NS // 60 for k in range(20 - images_late)]
    assert all(np.array_equal(pair.left, grey(k)) and np.array_equal(pair.right, grey(100 + k)) for k, pair in enumerate(made))


@pytest.mark.parametrize("disparity_px", [70.0, 90.0, 120.0, 180.0])
def test_what_is_nearer_than_the_range_is_at_its_end_and_not_far_away(disparity_px) -> None:
    left, right = wall_pair(6.0, seed=1)
    near_left, near_right = (image[::-1] for image in wall_pair(disparity_px, seed=1))  # another texture than the wall's
    shift = int(disparity_px)
    left[80:190, 260:400] = near_left[80:190, 260:400]
    right[80:190, 260 - shift : 400 - shift] = near_right[80:190, 260 - shift : 400 - shift]
    found = disparity(left, right)
    near = found[95:175, 275:385]
    assert np.mean(near == 63.0) > 0.8
    assert np.mean(near < 55.0) < 0.02  # nothing of it is called farther away
    assert np.nanmedian(found[200:]) == pytest.approx(6.0, abs=0.1)
    assert np.mean(found == 63.0) < 1.6 * 110 * 140 / found.size


def test_the_range_reaches_as_near_as_it_is_told() -> None:
    hd720 = StereoGeometry(fx=700.0, fy=700.0, cx=640.0, cy=360.0, baseline_m=0.12)
    search = DisparityRange.to_see(hd720.scaled(2), 0.5)
    assert (search.first, search.count) == (0, 96)
    assert DisparityRange.to_see(ZED, 0.45) == DisparityRange(0, 80)
    assert hd720.scaled(2).disparity_of(0.5) <= search.last
    assert DisparityRange.to_see(hd720, 0.05).count == 256


@pytest.mark.parametrize("offset_px", [-12.0, 5.5])
def test_the_right_principal_point_counts(offset_px) -> None:
    geometry = StereoGeometry(fx=240.0, fy=240.0, cx=240.0, cy=135.0, baseline_m=0.12, offset_px=offset_px)
    search = DisparityRange.to_see(geometry, 0.45)
    found = disparity(*wall_pair(13.4 + offset_px, seed=1), first=search.first, count=search.count)
    depth = depth_of(found, geometry)
    assert float(np.nanmedian(depth[20:-20, 60:-60])) == pytest.approx(28.8 / 13.4, abs=0.04)
