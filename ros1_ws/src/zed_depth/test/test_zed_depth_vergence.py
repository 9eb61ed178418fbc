"""A camera that is turned inwards or outwards: a knock is known from the next pair on, a lasting one by the vehicle's own motion."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from sensor_msgs.msg import CameraInfo
from test_zed_depth_health import SCENES, believed, noisy
from test_zed_depth_scale import PERIOD_S, VIEWS, flown

from perception_core import NS, FaultKind, Verdict
from zed_depth import StereoPair, StereoRig, VergenceJudge, VergenceLimits, ZedSettings


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
    words = ("turned inwards against each other: by the vehicle's own motion", "too short by the vehicle's own motion")
    assert any(each in found[first].reason for each in words)


@pytest.mark.parametrize("shift_px", [1.5, -1.5, 4.0])
@pytest.mark.parametrize("poses", [True, False])
def test_a_knock_in_flight_is_known_at_the_next_view(shift_px, poses) -> None:
    found = in_flight(shift_px, knocked=5, poses=poses)
    assert all(finding.ok for finding in found[:5])
    assert {(finding.verdict, finding.fault) for finding in found[5:]} == {(Verdict.BROKEN, FaultKind.CALIBRATION)}
    told = "inwards against each other: all disparities changed by" if shift_px > 0 else "turned aside against each other"
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
