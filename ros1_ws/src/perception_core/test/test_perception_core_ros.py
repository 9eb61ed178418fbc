"""Messages to arrays and back, settings, the worker on the newest item; needs ROS's Python, but no master."""

from __future__ import annotations

import threading
from dataclasses import dataclass

import numpy as np
import pytest
from geometry_msgs.msg import Quaternion, Transform, Vector3
from std_msgs.msg import Header

from node_core.ros import NewestWorker
from perception_core import Nearest, SettingsError, tunable
from perception_core.clouds import sweep_of_cloud
from perception_core.conversions import cloud_message, depth_message, matrix_of_transform, obstacle_message
from perception_core.ros.settings import override


def test_clouds_come_back_as_they_went_with_their_confidence() -> None:
    points = np.random.default_rng(0).normal(size=(50, 3)).astype(np.float32)
    sweep = sweep_of_cloud(cloud_message(Header(), points))
    assert np.array_equal(sweep.points, points)
    assert not sweep.times_s.any()
    message = cloud_message(Header(), points, np.full(50, 0.5, np.float32))
    assert [field.name for field in message.fields] == ["x", "y", "z", "confidence"]
    assert np.array_equal(sweep_of_cloud(message).points, points)


def test_depth_images_keep_what_has_no_depth() -> None:
    depth = np.array([[1.5, np.nan]], dtype=np.float32)
    message = depth_message(Header(), depth)
    assert (message.encoding, message.step, message.width) == ("32FC1", 8, 2)
    assert np.array_equal(np.frombuffer(message.data, "<f4"), depth[0], equal_nan=True)


def test_obstacle_messages_say_infinity_for_nothing() -> None:
    none = obstacle_message(3_000_000_007, "zed", None)
    assert (none.detected, none.distance_m, none.header.stamp.to_nsec()) == (False, float("inf"), 3_000_000_007)
    assert not none.unknown
    unknown = obstacle_message(0, "zed", None, "no texture")
    assert (unknown.detected, unknown.unknown, unknown.reason) == (False, True, "no texture")
    some = obstacle_message(0, "lidar", Nearest(distance_m=4.0, point_enu_m=(1.0, 2.0, 3.0), size_m=(0.5, 1.0, 2.0)))
    assert not some.unknown
    both = obstacle_message(0, "lidar", Nearest(distance_m=4.0, point_enu_m=(1.0, 2.0, 3.0), size_m=(0.5, 1.0, 2.0)), "a gap")
    assert (both.detected, both.distance_m, both.unknown, both.reason) == (True, 4.0, True, "a gap")
    assert (some.size_m.x, some.size_m.y, some.size_m.z) == (0.5, 1.0, 2.0)
    assert (some.detected, some.distance_m, some.nearest_enu_m.z, some.header.frame_id) == (True, 4.0, 3.0, "odom")


def test_a_transform_turns_then_shifts() -> None:
    half = 0.5**0.5
    matrix = matrix_of_transform(Transform(translation=Vector3(1, 2, 3), rotation=Quaternion(0, 0, half, half)))
    assert matrix @ [1, 0, 0, 1] == pytest.approx([1, 3, 3, 1])


@dataclass(frozen=True)
class Some:
    """Settings of a test."""

    rate_hz: float = 10.0
    count: int = 3
    name: str = "a"
    enabled: bool = False
    near_m: float = tunable(0.5, 0.1, 2.0, "of the corridor")


def test_settings_are_checked() -> None:
    assert override(Some(), {"rate_hz": 5, "enabled": True}) == Some(rate_hz=5.0, enabled=True)
    with pytest.raises(SettingsError, match=r"unknown parameter ~rate; known: count, enabled, name, near_m, rate_hz"):
        override(Some(), {"rate": 5})
    for wrong in ({"count": 2.5}, {"count": True}, {"rate_hz": "fast"}, {"enabled": 1}):
        with pytest.raises(SettingsError, match="expected a"):
            override(Some(), wrong)
    assert override(Some(), {"near_m": 2}).near_m == 2.0
    for wrong in (0.05, 2.5, float("nan")):
        with pytest.raises(SettingsError, match=r"~near_m is .*, expected 0\.1 to 2 \(of the corridor\)"):
            override(Some(), {"near_m": wrong})


def test_a_slow_worker_skips_to_the_newest() -> None:
    seen: list[int] = []
    started, go_on, last = threading.Event(), threading.Event(), threading.Event()

    def work(item: int) -> None:
        seen.append(item)
        started.set()
        assert go_on.wait(5.0)
        if item == 9:
            last.set()

    worker = NewestWorker[int](work)
    worker.offer(0)
    assert started.wait(5.0)
    for item in range(1, 10):
        worker.offer(item)
    go_on.set()
    assert last.wait(5.0)
    assert seen == [0, 9]
