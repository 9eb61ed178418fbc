"""A camera that is turned inwards or outwards: a knock is known from the next pair on, a lasting one by the vehicle's own motion."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from sensor_msgs.msg import CameraInfo
from test_zed_depth_health import SCENES, believed, noisy, rig_for
from test_zed_depth_scale import PERIOD_S, VIEWS, flown

from perception_core import NS, FaultKind, Verdict
from perception_core.testing import wall_pair
from zed_depth import Landmarks, StereoGeometry, StereoPair, StereoRig, VergenceJudge, VergenceLimits, ZedSettings


def turned(image, shift_px) -> np.ndarray:
    """Return the right image of a camera that is turned so that disparities are larger by some pixels: inwards."""
    moved = np.array([[1.0, 0.0, -shift_px], [0.0, 1.0, 0.0]])
    return cv2.warpAffine(image, moved, (image.shape[1], image.shape[0]), borderMode=cv2.BORDER_REPLICATE, flags=cv2.INTER_CUBIC)


def in_flight(shift_px, *, knocked=0, poses=True, drift=0.0, until=VIEWS) -> list:
    """Return what the rig says of 9 m of flight in the yard, the camera turned from a view on, the autopilot's ways so much too long."""
    rows = flown()[:until]
    known = {stamp_ns: pose.copy() for stamp_ns, _, _, pose in rows}
    for pose in known.values():
        pose[0, 3] *= 1.0 + drift
    rig = StereoRig(ZedSettings(), known.get if poses else (lambda _stamp_ns: None))
    for side, shift in (("left", 0.0), ("right", -240.0 * 0.12)):
        P = [240.0, 0.0, 239.5, shift, 0.0, 240.0, 134.5, 0.0, 0.0, 0.0, 1.0, 0.0]  # noqa: N806 -- the message's name
        rig.take_info(side, CameraInfo(width=480, height=270, P=P))
    pairs = [
        StereoPair(stamp_ns, left, turned(right, shift_px if k >= knocked else 0.0)) for k, (stamp_ns, left, right, _) in enumerate(rows)
    ]
    return [rig.finding(pair) for pair in pairs]


@pytest.mark.parametrize("shift_px", [1.5, 2.0, 4.0])
@pytest.mark.parametrize("drift", [-0.05, 0.0, 0.05])
def test_a_camera_turned_inwards_from_the_start_is_known_within_6_s_of_flight(shift_px, drift) -> None:
    found = in_flight(shift_px, drift=drift, until=VIEWS + 6)
    first = next(k for k, finding in enumerate(found) if not finding.ok)
    assert first * PERIOD_S <= 6.0
    assert {finding.verdict for finding in found[first:]} == {Verdict.BROKEN}
    words = ("turned inwards against each other, by the vehicle's own motion", "too short by the vehicle's own motion")
    assert any(each in found[first].reason for each in words)


@pytest.mark.parametrize("shift_px", [1.5, -1.5, 4.0])
@pytest.mark.parametrize("poses", [True, False])
def test_a_knock_in_flight_is_known_at_the_next_view(shift_px, poses) -> None:
    found = in_flight(shift_px, knocked=5, poses=poses)
    assert all(finding.ok for finding in found[:5])
    assert {(finding.verdict, finding.fault) for finding in found[5:]} == {(Verdict.BROKEN, FaultKind.CALIBRATION)}
    told = "inwards against each other, all disparities changed by" if shift_px > 0 else "turned aside against each other"
    assert told in found[5].reason


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("shift_px", [1.5, 3.0, -1.5])
@pytest.mark.parametrize("since_check", [0, 2])
def test_no_pair_after_a_knock_is_believed_while_the_vehicle_stands_until_it_is_turned_back(scene, shift_px, since_check) -> None:
    rig, good = scene.rig(), 5 + since_check
    assert all(believed(rig, k, *scene.good(k)) for k in range(good))
    right = turned(np.asarray(scene.right, np.float32), shift_px)
    assert [k for k in range(good, good + 12) if believed(rig, k, noisy(scene.left, 300 + 2 * k), noisy(right, 301 + 2 * k))] == []
    after = [believed(rig, 20 + k, *scene.good(k)) for k in range(6)]
    assert after[-4:] == [True] * 4


def test_what_the_motion_says_counts_by_its_middle_and_is_forgotten_when_it_is_clearly_right() -> None:
    judge = VergenceJudge(VergenceLimits())
    judged = []
    for k, offset_px in enumerate([0.2, 5.0, 0.3, 4.0, 0.4, 1.3, 1.2, 0.9, 0.8, 0.7, 0.5, 0.4, 0.5, 0.3]):
        judge.judge(k * NS, offset_px)
        judged.append(judge.finding.ok)
    assert judged == [True] * 5 + [False] * 7 + [True] * 2


STREET_FX, STREET = 360.0, (188, 620)  # of a wide image as it is matched


def yawed(image, degrees) -> np.ndarray:
    """Return the image of a camera that turned about its vertical axis, outwards where the angle is positive."""
    height, width = image.shape
    K = np.array([[STREET_FX, 0.0, width / 2], [0.0, STREET_FX, height / 2], [0.0, 0.0, 1.0]])  # noqa: N806 -- the camera's matrix
    turn = cv2.Rodrigues(np.radians([0.0, degrees, 0.0]))[0]
    return cv2.warpPerspective(np.asarray(image, np.float32), K @ turn @ np.linalg.inv(K), (width, height), borderMode=cv2.BORDER_REPLICATE)


def with_board(images, disparity_px) -> list[np.ndarray]:
    """Return a pair with a board of 1.4 by 1 m, of coarse texture, in its middle."""
    height, width = STREET
    size = round(1.4 * disparity_px / 0.12), round(disparity_px / 0.12)
    texture = cv2.resize(np.random.default_rng(3).uniform(20, 235, (size[1] // 4, size[0] // 4)), size, interpolation=cv2.INTER_CUBIC)
    seen = []
    for image, moved_px in zip(images, (0.0, disparity_px), strict=True):
        at = np.array([[1.0, 0.0, (width - size[0]) // 2 - moved_px], [0.0, 1.0, (height - size[1]) // 2]])
        cover = cv2.warpAffine(np.ones_like(texture), at, (width, height))
        seen.append(image * (1.0 - cover) + cv2.warpAffine(texture, at, (width, height)) * cover)
    return seen


@pytest.mark.parametrize("degrees", [-1.0, -0.6, 0.6])
@pytest.mark.parametrize("board_px", [None, 10.8])
def test_a_turn_of_a_wide_camera_is_known_at_the_next_pair_though_it_shifts_the_edges_more(degrees, board_px) -> None:
    """At 41 degrees from the middle the disparities change by 1.7 times as much as there."""
    left, right = (cv2.resize(image, STREET[::-1]) for image in wall_pair(2.0, seed=1))
    if board_px is not None:
        left, right = with_board((left, right), board_px)
    rig = rig_for(left, STREET_FX)
    assert all(believed(rig, k, noisy(left, k), noisy(right, 50 + k)) for k in range(7))
    knocked = yawed(right, degrees)
    pairs = [StereoPair(k * NS // 10, noisy(left, k), noisy(knocked, 50 + k)) for k in range(7, 12)]
    told = [(rig.finding(pair), rig.depth(pair).doubt) for pair in pairs]
    assert all(not finding.ok or doubt for finding, doubt in told)
    assert {finding.fault for finding, _ in told[1:]} == {FaultKind.CALIBRATION}


def test_a_view_that_can_not_be_judged_is_no_reference_for_the_next_one() -> None:
    """A knock that no comparison shows at once, for a glare or a passer-by, is still there in the next view."""
    rng = np.random.default_rng(5)
    left, right = wall_pair(9.5, seed=1)
    geometry = StereoGeometry(fx=240.0, fy=240.0, cx=240.0, cy=135.0, baseline_m=0.12)
    corners = cv2.goodFeaturesToTrack(left, 200, 0.01, 8).reshape(-1, 2)
    places = corners[(corners > 40).all(axis=1) & (corners < [440, 230]).all(axis=1)].astype(np.float64)
    strange, knocked = rng.integers(0, 255, left.shape).astype(np.uint8), turned(right, 3.0)
    looks = [(9.5, right), (9.5, strange), (12.5, knocked), (12.5, knocked)]
    judge = VergenceJudge(VergenceLimits())
    told = [
        judge.look(k * NS // 2, Landmarks(left, places, np.full(len(places), known_px)), image, geometry, lambda _: np.eye(4))
        for k, (known_px, image) in enumerate(looks)
    ]
    assert told == [False, None, True, False]
    assert "3.0 px at once" in judge.finding.reason


def test_where_the_left_camera_sees_something_else_the_next_view_is_held_against_that() -> None:
    places = np.stack(np.meshgrid(np.arange(60.0, 420.0, 40.0), np.arange(40.0, 230.0, 40.0)), axis=-1).reshape(-1, 2)
    geometry, judge = StereoGeometry(fx=240.0, fy=240.0, cx=240.0, cy=135.0, baseline_m=0.12), VergenceJudge(VergenceLimits())
    told = []
    for k, (disparity_px, wall) in enumerate([(9.5, 7), (4.0, 8), (4.0, 8)]):
        left, right = wall_pair(disparity_px, seed=k, wall=wall)
        seen = Landmarks(left, places, np.full(len(places), disparity_px))
        told.append(judge.look(k * NS // 2, seen, right, geometry, lambda _: None))
    assert told == [False, None, False]
