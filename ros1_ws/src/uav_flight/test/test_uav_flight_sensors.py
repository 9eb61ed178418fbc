"""Measurements of a bag through the real perception nodes, in virtual time: what they say, twice the same, and with a failure."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import rosbag
from genpy import Time
from geometry_msgs.msg import Point, PoseStamped, Quaternion
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header, String
from tf2_msgs.msg import TFMessage
from uav_msgs.msg import GuidanceState

from perception_core.conversions import cloud_message
from perception_core.testing.flight import BASELINE_M, CX, CY, FX, _mounts
from perception_core.testing.sensors import box_cloud, wall_pair

START_S, LIFT_OFF_S, ENABLED_S, END_S = 100.0, 100.6, 101.0, 102.2
DISPARITY_PX = 8.0
TICKS = range(round((END_S - START_S) * 50))


def stamp(t_s: float) -> Time:
    return Time.from_sec(round(t_s, 3))


def call(service: str, request: dict, t_s: float) -> String:
    response = {"accepted": True, "reason": "", "state": "", "success": True, "message": ""}
    return String(json.dumps({"service": service, "request": request, "response": response, "error": "", "begin_s": t_s, "end_s": t_s}))


def write_stereo(bag: rosbag.Bag, t_s: float, seed: int) -> None:
    for side, image in zip(("left", "right"), wall_pair(DISPARITY_PX, seed=seed), strict=True):
        header = Header(stamp=stamp(t_s), frame_id=f"zed_{side}")
        info = CameraInfo(header=header, height=image.shape[0], width=image.shape[1])
        info.P = [FX, 0.0, CX, -FX * BASELINE_M if side == "right" else 0.0, 0.0, FX, CY, 0.0, 0.0, 0.0, 1.0, 0.0]
        bag.write(f"/zed/{side}/camera_info", info, stamp(t_s))
        height, width = image.shape
        message = Image(header=header, height=height, width=width, encoding="mono8", step=width, data=np.ascontiguousarray(image).tobytes())
        bag.write(f"/zed/{side}/image_raw", message, stamp(t_s))


@pytest.fixture(scope="module")
def measured(tmp_path_factory) -> Path:
    """A vehicle that hovers in front of a wall; the ZED watches from 101 s on."""
    path = tmp_path_factory.mktemp("measured") / "functional.bag"
    with rosbag.Bag(str(path), "w") as bag:
        bag.write("/tf_static", _mounts(), stamp(START_S))
        for tick in TICKS:
            t_s = START_S + tick / 50
            pose = PoseStamped(header=Header(stamp=stamp(t_s), frame_id="map"))
            pose.pose.position, pose.pose.orientation = Point(0.0, 0.0, 2.0), Quaternion(0.0, 0.0, 0.0, 1.0)
            bag.write("/uav_guidance/pose", pose, stamp(t_s))
            bag.write("/uav_guidance/state", GuidanceState(header=pose.header, position_enu_m=pose.pose.position), stamp(t_s))
            if tick % 5 == 0:
                write_stereo(bag, t_s, tick)
                cloud = cloud_message(Header(stamp=stamp(t_s), frame_id="lidar"), box_cloud((4.0, 0.0, 0.0), seed=tick))
                bag.write("/lidar/points", cloud, stamp(t_s))
        bag.write("/calls", call("/navigation/transition", {"resource": "flight_status", "to": "IN_AIR"}, LIFT_OFF_S), stamp(LIFT_OFF_S))
        bag.write("/calls", call("/zed_depth/enable", {"data": True}, ENABLED_S), stamp(ENABLED_S))
    return path


def perceive(source: Path, target: Path, *words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "node_core.replay", str(source), str(target), "--zero", str(LIFT_OFF_S), *words]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=200)


def perceived(source: Path, target: Path, *words: str) -> list[tuple]:
    done = perceive(source, target, *words)
    assert done.returncode == 0, done.stderr
    with rosbag.Bag(str(target)) as bag:
        return [(topic, data, t.to_sec()) for topic, (_, data, *_), t in bag.read_messages(raw=True)]


def transitions(path: Path) -> dict[tuple[str, str], float]:
    with rosbag.Bag(str(path)) as bag:
        calls = [json.loads(message.data) for _, message, _ in bag.read_messages(topics=["/calls"])]
    asked = [one for one in calls if one["service"] == "/perception/transition"]
    return {(one["request"]["resource"], one["request"]["to"]): one["end_s"] for one in asked}


def test_the_nodes_see_what_is_there_and_twice_the_same(measured, tmp_path):
    first = perceived(measured, tmp_path / "first.bag")
    assert first == perceived(measured, tmp_path / "second.bag")
    assert {("zed_status", "OK"), ("lidar_status", "OK")} == set(transitions(tmp_path / "first.bag"))
    with rosbag.Bag(str(tmp_path / "first.bag")) as bag:
        obstacles = [(message, t.to_sec()) for _, message, t in bag.read_messages(topics=["/zed_depth/obstacle"])]
    assert ENABLED_S < obstacles[0][1] < ENABLED_S + 0.3
    assert len(obstacles) >= 9
    assert obstacles[-1][0].distance_m == pytest.approx(FX * BASELINE_M / DISPARITY_PX, abs=0.5)
    assert not {topic for topic, _, _ in first} & {"/zed/left/image_raw", "/lidar/points"}


def test_what_was_said_before_the_measurements_begin_is_taken_from_the_record(measured, tmp_path):
    begin_s, said_s, later_s = START_S + 0.25, START_S + 0.1, START_S + 0.35
    late_topics, said = (
        {"/zed/left/image_raw", "/zed/right/image_raw", "/lidar/points"},
        [("lidar_status", said_s), ("zed_status", later_s)],
    )
    calls = [("/calls", call("/perception/transition", {"resource": name, "to": "OK"}, t_s), stamp(t_s)) for name, t_s in said]
    with rosbag.Bag(str(measured)) as bag, rosbag.Bag(str(tmp_path / "late.bag"), "w") as late:
        kept = [one for one in bag.read_messages() if one[0] not in late_topics or one[2].to_sec() >= begin_s]
        for topic, message, t in sorted([*kept, *calls], key=lambda one: one[2]):
            late.write(topic, message, t)
    perceived(tmp_path / "late.bag", tmp_path / "again.bag")
    with rosbag.Bag(str(tmp_path / "again.bag")) as bag:
        calls = [json.loads(message.data) for _, message, _ in bag.read_messages(topics=["/calls"])]
    told = [(one["request"]["resource"], one["end_s"]) for one in calls if one["service"] == "/perception/transition"]
    assert next(t_s for resource, t_s in told if resource == "lidar_status") == said_s
    again_s = [t_s for resource, t_s in told if resource == "zed_status"]
    assert later_s not in again_s
    assert begin_s < min(again_s)


def test_measurements_that_stay_away_are_noticed_by_the_node(measured, tmp_path):
    perceived(measured, tmp_path / "dead.bag", "--fail", "zed@0.8")
    told = transitions(tmp_path / "dead.bag")
    assert 0.1 < told["zed_status", "BROKEN"] - (LIFT_OFF_S + 0.8) < 0.6
    assert ("lidar_status", "BROKEN") not in told


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (("--fail", "zed:sideways@1"), "zed can't be 'sideways'"),
        (("--set", "guidance.speed=1"), "nodes are zed_depth"),
        (("--set", "zed_depth.no_such=1"), "unknown parameter ~no_such"),
    ],
)
def test_a_wrong_request_is_told_in_a_line(measured, tmp_path, words, complaint):
    done = perceive(measured, tmp_path / "none.bag", *words)
    assert done.returncode == 2
    assert complaint in done.stderr
    assert done.stderr.count("\n") == 1


def test_a_topic_of_another_type_is_refused_by_name_and_leaves_nothing(tmp_path):
    with rosbag.Bag(str(tmp_path / "scans.bag"), "w") as bag:
        bag.write("/base_scan", TFMessage(), stamp(START_S))
    done = perceive(tmp_path / "scans.bag", tmp_path / "none.bag", "--map", "/base_scan:=/lidar/points")
    assert done.returncode == 2
    words = "/base_scan (--map /base_scan:=/lidar/points) is of type tf2_msgs/TFMessage, expected sensor_msgs/PointCloud2"
    assert done.stderr == f"{tmp_path / 'scans.bag'}: {words}\n"
    assert not (tmp_path / "none.bag").exists()


def test_a_bag_without_measurements_is_refused(tmp_path):
    with rosbag.Bag(str(tmp_path / "bare.bag"), "w") as bag:
        bag.write("/tf_static", TFMessage(), stamp(START_S))
    done = perceive(tmp_path / "bare.bag", tmp_path / "none.bag")
    assert done.returncode == 2
    assert "holds no measurements" in done.stderr
