"""Messages to arrays and back, settings, the worker on the newest item; needs ROS's Python, but no master."""

from __future__ import annotations

import threading
from dataclasses import dataclass

import numpy as np
import pytest
from geometry_msgs.msg import Quaternion, Transform, Vector3
from sensor_msgs.msg import Image, PointCloud2, PointField
from std_msgs.msg import Header

from perception_core import Nearest
from perception_core.ros import (
    NewestWorker,
    SettingsError,
    cloud_message,
    depth_message,
    image_to_array,
    matrix_of_transform,
    obstacle_message,
    sweep_of_cloud,
)
from perception_core.ros.settings import override

CLOUD = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4"), ("time", "<f4")])


def test_clouds_with_times_between_other_fields() -> None:
    raw = np.zeros(3, CLOUD)
    raw["x"], raw["z"], raw["time"] = [1, 2, np.nan], [4, 5, 6], [0.0, 0.05, 0.09]
    fields = [PointField(name, CLOUD.fields[name][1], PointField.FLOAT32, 1) for name in CLOUD.names]
    message = PointCloud2(fields=fields, width=3, height=1, point_step=CLOUD.itemsize, data=raw.tobytes())
    message.header.stamp.secs = 7
    sweep = sweep_of_cloud(message)
    assert sweep.points[:2].tolist() == [[1, 0, 4], [2, 0, 5]]
    assert sweep.times_s.tolist() == pytest.approx([0.0, 0.05, 0.09])
    assert sweep.end_ns == pytest.approx(7_090_000_000, abs=10)
    message.data = message.data[:-1]
    with pytest.raises(ValueError, match="59 bytes for 3 points of 20"):
        sweep_of_cloud(message)
    message.fields = fields[1:]
    with pytest.raises(ValueError, match="expected x, y, z"):
        sweep_of_cloud(message)


def test_clouds_without_times_come_back_as_they_went() -> None:
    points = np.random.default_rng(0).normal(size=(50, 3)).astype(np.float32)
    sweep = sweep_of_cloud(cloud_message(Header(), points))
    assert np.array_equal(sweep.points, points)
    assert not sweep.times_s.any()


def test_images_with_padded_rows_and_wrong_ones() -> None:
    rows = np.arange(24, dtype=np.uint8).reshape(3, 8)
    image = Image(height=3, width=6, step=8, encoding="mono8", data=rows.tobytes())
    assert np.array_equal(image_to_array(image), rows[:, :6])
    image.data = image.data[:-1]
    with pytest.raises(ValueError, match="23 bytes for 6x3"):
        image_to_array(image)
    image.encoding = "bgr8"
    with pytest.raises(ValueError, match="'bgr8'"):
        image_to_array(image)


def test_depth_images_keep_what_has_no_depth() -> None:
    depth = np.array([[1.5, np.nan]], dtype=np.float32)
    message = depth_message(Header(), depth)
    assert (message.encoding, message.step, message.width) == ("32FC1", 8, 2)
    assert np.array_equal(np.frombuffer(message.data, "<f4"), depth[0], equal_nan=True)


def test_obstacle_messages_say_infinity_for_nothing() -> None:
    none = obstacle_message(3_000_000_007, "zed", None)
    assert (none.detected, none.distance_m, none.header.stamp.to_nsec()) == (False, float("inf"), 3_000_000_007)
    some = obstacle_message(0, "lidar", Nearest(distance_m=4.0, point_enu_m=(1.0, 2.0, 3.0)))
    assert (some.detected, some.distance_m, some.nearest_enu_m.z, some.header.frame_id) == (True, 4.0, 3.0, "map")


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


def test_settings_are_checked() -> None:
    assert override(Some(), {"rate_hz": 5, "enabled": True}) == Some(rate_hz=5.0, enabled=True)
    with pytest.raises(SettingsError, match=r"unknown parameter ~rate; known: count, enabled, name, rate_hz"):
        override(Some(), {"rate": 5})
    for wrong in ({"count": 2.5}, {"count": True}, {"rate_hz": "fast"}, {"enabled": 1}):
        with pytest.raises(SettingsError, match="expected a"):
            override(Some(), wrong)


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
