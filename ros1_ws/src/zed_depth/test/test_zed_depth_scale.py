"""The scale of the depths against the vehicle's own motion: found where it is wrong, never accused where the autopilot drifts."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from sensor_msgs.msg import CameraInfo

from perception_core import NS, FaultKind, Verdict
from uav_simulator.sensors.mounts import ZED_LEFT
from uav_simulator.sensors.pose_track import Pose
from uav_simulator.sensors.stereo import StereoPair as StereoRenderer
from uav_simulator.world.config import find_world, load_world
from uav_simulator.world.parts import build_parts
from uav_simulator.world.scene import Scene
from zed_depth import Landmarks, ScaleJudge, ScaleLimits, StereoGeometry, StereoPair, StereoRig, ZedSettings, scale_of

ZED = StereoGeometry(fx=240.0, fy=240.0, cx=239.5, cy=134.5, baseline_m=0.12)
PERIOD_S = 0.4
VIEWS = 24
NO_IMAGE = np.zeros((0, 0), np.uint8)
LEVEL = (1.0, 0.0, 0.0, 0.0)


def views(seed, motion, *, scale=1.0, strangers=0) -> tuple[Landmarks, np.ndarray]:
    """Return 150 landmarks and their places after a motion; the depths are ``scale`` times too long."""
    rng = np.random.default_rng(seed)
    before = np.column_stack([rng.uniform(-4, 4, 150), rng.uniform(-2, 2, 150), rng.uniform(3, 9, 150)])
    after = before @ motion[:3, :3].T + motion[:3, 3]
    if strangers:
        after[:strangers] = after[rng.permutation(150)[:strangers]]
    places, later = (each[:, :2] / each[:, 2:] * 240.0 + [239.5, 134.5] + rng.normal(0, 0.5, (150, 2)) for each in (before, after))
    return Landmarks(NO_IMAGE, places, 28.8 / before[:, 2] / scale + rng.normal(0, 0.15, 150)), later


def forward(way_m: float) -> np.ndarray:
    motion = np.eye(4)
    motion[2, 3] = -way_m
    return motion


@pytest.mark.parametrize("scale", [0.7, 0.85, 1.0, 1.15, 1.4])
@pytest.mark.parametrize("way", [(0.0, 0.0, -0.9), (0.9, 0.0, 0.0), (0.4, 0.1, -0.8)])
def test_the_scale_of_two_views_is_found_also_among_strangers(scale, way) -> None:
    motion = np.eye(4)
    motion[:3, 3] = way
    estimate = scale_of(*views(1, motion, scale=scale, strangers=30), motion, ZED)
    assert estimate is not None
    assert estimate.scale == pytest.approx(scale, abs=0.04)
    assert estimate.sigma < 0.03


def test_an_error_of_the_attitude_is_no_error_of_the_scale() -> None:
    motion, told = forward(0.9), forward(0.9)
    turned = np.radians(1.5)
    told[:3, :3] = [[np.cos(turned), 0.0, np.sin(turned)], [0.0, 1.0, 0.0], [-np.sin(turned), 0.0, np.cos(turned)]]
    estimate = scale_of(*views(2, motion), told, ZED)
    assert estimate is not None
    assert estimate.scale == pytest.approx(1.0, abs=0.03)


def test_nothing_is_said_where_little_is_seen_twice_or_the_camera_turned_far() -> None:
    earlier, later = views(3, forward(0.9))
    few = Landmarks(NO_IMAGE, earlier.places[:20], earlier.disparity_px[:20])
    assert scale_of(few, later[:20], forward(0.9), ZED) is None
    told = np.diag([-1.0, 1.0, -1.0, 1.0])
    assert scale_of(earlier, later, told, ZED) is None
    strange = np.random.default_rng(4).uniform(0, 270, (150, 2))
    assert scale_of(earlier, strange, forward(0.9), ZED) is None


@cache
def flown() -> list[tuple[int, np.ndarray, np.ndarray, np.ndarray]]:
    """Return stamps, both images and the camera's true pose of a flight along the yard's first leg at 1 m/s, which then stands."""
    eyes = StereoRenderer(Scene(build_parts(load_world(find_world("yard")), 3)), 3)
    rows = []
    for k in range(VIEWS + 6):
        x = 1.0 + PERIOD_S * min(k, VIEWS)
        T_map_camera = np.eye(4)  # noqa: N806 -- T_target_source
        T_map_camera[:3, :3] = ZED_LEFT.matrix
        T_map_camera[:3, 3] = np.array([x, 0.0, 3.0]) + ZED_LEFT.translation
        rows.append((int(PERIOD_S * k * NS) + NS, *eyes.render(Pose(0.0, (x, 0.0, 3.0), LEVEL)), T_map_camera))
    return rows


def take_infos(rig, *, fx: float = 240.0, baseline_m: float = 0.12, right_cx: float = 239.5) -> None:
    for side, shift, cx in (("left", 0.0, 239.5), ("right", -fx * baseline_m, right_cx)):
        P = [fx, 0.0, cx, shift, 0.0, fx, 134.5, 0.0, 0.0, 0.0, 1.0, 0.0]  # noqa: N806 -- the message's name
        rig.take_info(side, CameraInfo(width=480, height=270, P=P))


def findings(*, drift: float = 0.0, poses: bool = True, until: int = VIEWS, changes=None, **infos: float) -> list:
    """Return what the rig says of the flight, with this camera_info and an autopilot whose ways are so much too long.

    ``changes`` are other camera_infos by the number of the pair before which they come.
    """
    rows = flown()[:until]
    known = {stamp_ns: pose.copy() for stamp_ns, _, _, pose in rows}
    for pose in known.values():
        pose[0, 3] *= 1.0 + drift
    rig = StereoRig(ZedSettings(), known.get if poses else (lambda _stamp_ns: None))
    take_infos(rig, **infos)
    found = []
    for k, (stamp_ns, left, right, _) in enumerate(rows):
        if changes and k in changes:
            take_infos(rig, **changes[k])
        found.append(rig.finding(StereoPair(stamp_ns, left, right)))
    return found


@pytest.mark.parametrize("drift", [-0.05, 0.0, 0.05])
def test_a_right_camera_info_is_never_accused_whatever_the_autopilot_drifts(drift) -> None:
    assert all(finding.ok for finding in findings(drift=drift, until=VIEWS + 6))


WRONG = {
    "baseline 18 % too long": ({"baseline_m": 0.12 * 1.18}, "too long by the vehicle's own motion"),
    "baseline 16 % too short": ({"baseline_m": 0.12 * 0.84}, "too short by the vehicle's own motion"),
    "focal length 18 % too long": ({"fx": 240.0 * 1.18}, "too long by the vehicle's own motion"),
    "focal length 16 % too short": ({"fx": 240.0 * 0.84}, "too short by the vehicle's own motion"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_scale_is_found_within_6_s_of_flight_and_stays_when_the_vehicle_stands(name) -> None:
    changed, sentence = WRONG[name]
    found = findings(**changed, until=VIEWS + 6)
    first = next(k for k, finding in enumerate(found) if not finding.ok)
    assert first * PERIOD_S <= 6.0
    assert {(finding.verdict, finding.fault) for finding in found[first:]} == {(Verdict.BROKEN, FaultKind.CALIBRATION)}
    assert sentence in found[-1].reason


def test_without_poses_or_without_motion_the_scale_is_not_judged() -> None:
    assert all(finding.ok for finding in findings(baseline_m=0.2, poses=False))
    assert all(finding.ok for finding in findings(baseline_m=0.2, until=3))


def test_a_wrong_scale_is_forgotten_when_motion_shows_a_right_one() -> None:
    judge = ScaleJudge(ScaleLimits())
    judged = []
    for k in range(30):
        judge.judge(k * NS, 1.3 if 10 <= k < 20 else 1.02)
        judged.append(judge.finding.verdict)
    # Half of the last six estimates accuse, more than half acquit.
    assert judged == [Verdict.OK] * 12 + [Verdict.BROKEN] * 11 + [Verdict.OK] * 7


CHANGED = {
    "baseline": ({"baseline_m": 0.18}, "the baseline from 0.120 to 0.180 m"),
    "focal length": ({"fx": 312.0}, "the focal length from 240.0 to 312.0 px"),
    "principal point": ({"right_cx": 249.5}, "the distance of both principal points from 0.0 to -10.0 px"),
}


@pytest.mark.parametrize("name", CHANGED)
def test_a_camera_info_that_changes_in_flight_is_not_believed_until_the_earlier_one_is_back(name) -> None:
    changed, sentence = CHANGED[name]
    found = findings(changes={6: changed, 14: {}})
    assert [finding.ok for finding in found] == [True] * 6 + [False] * 8 + [True] * 10
    assert (found[6].verdict, found[6].fault) == (Verdict.UNKNOWN, FaultKind.INFO)
    assert found[6].reason.startswith(f"camera_info has changed while images came, {sentence}: ")


def test_a_camera_info_that_is_mended_in_flight_is_believed_once_motion_shows_that_it_is_right() -> None:
    found = findings(baseline_m=0.15, changes={3: {}})
    assert found[2].ok
    assert found[3].verdict is Verdict.UNKNOWN
    assert found[-1].ok


def test_a_camera_info_of_the_same_camera_is_no_other_one() -> None:
    assert all(finding.ok for finding in findings(changes={6: {"baseline_m": 0.121}, 9: {"fx": 242.0}}))
