"""Pictures of a flight: what they show, how many they are, and what is written of a camera on ROS."""

from __future__ import annotations

import base64
import json
import threading
import time
from collections.abc import Callable
from pathlib import Path
from queue import Queue
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from alula_flight.thumbnails import DEPTH_M, WIDTH_PX, Thumbnails, depth_picture, period_s, pixels_of, thumbnail


def image(pixels: np.ndarray, encoding: str) -> SimpleNamespace:
    return SimpleNamespace(height=pixels.shape[0], width=pixels.shape[1], encoding=encoding, data=pixels.tobytes())


def test_near_is_bright_and_what_was_not_measured_is_black() -> None:
    metres = np.array([[0.5, 10.0, DEPTH_M, 60.0], [np.nan, np.inf, 0.0, -1.0]], np.float32)
    picture = depth_picture(metres)
    bright = picture.astype(int).sum(axis=2)
    assert bright[0, 0] > bright[0, 1] > bright[0, 2] == bright[0, 3] > 0
    assert (bright[1] == 0).all()


@pytest.mark.parametrize("encoding", ["rgb8", "bgr8", "mono8"])
def test_a_thumbnail_shows_the_picture_small(encoding: str) -> None:
    red = np.zeros((360, 640, 3), np.uint8)
    red[..., 0 if encoding == "rgb8" else 2] = 200
    red = red[..., 2] if encoding == "mono8" else red
    jpeg = thumbnail(pixels_of(image(red, encoding)))
    back = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
    assert back.shape == (WIDTH_PX * 9 // 16, WIDTH_PX, 3)
    expected = (200, 200, 200) if encoding == "mono8" else (0, 0, 200)
    assert np.abs(back.reshape(-1, 3).mean(axis=0) - expected).max() < 4
    assert len(jpeg) < 10_000


@pytest.mark.parametrize(("encoding", "cut"), [("yuv422", 0), ("rgb8", 5), ("32FC1", 3)])
def test_images_that_make_no_sense_are_refused(encoding: str, cut: int) -> None:
    bad = image(np.zeros((4, 4, 3), np.uint8), encoding)
    bad.data = bad.data[: len(bad.data) - cut]
    with pytest.raises(ValueError, match=r"encoding|reshape|size"):
        pixels_of(bad)


def test_pictures_of_hours_are_not_many_more() -> None:
    def count(duration_s: float) -> int:
        t_s, pictures = 0.0, 0
        while t_s < duration_s:
            t_s, pictures = t_s + period_s(t_s), pictures + 1
        return pictures

    assert count(180.0) == 180
    assert count(4 * 3600.0) < 1600


class Camera:
    """A camera that publishes one image to each subscriber as it comes, stamped with the time of its coming."""

    def __init__(self, topic: str) -> None:
        import rospy
        from sensor_msgs.msg import Image

        listener = rospy.SubscribeListener()
        listener.peer_subscribe = self._subscribed
        self.stamps_s: list[float] = []
        self._publisher = rospy.Publisher(topic, Image, subscriber_listener=listener, queue_size=1)

    def close(self) -> None:
        self._publisher.unregister()

    def _subscribed(self, _topic: str, _publish: object, publish_to_it: Callable[[object], None]) -> None:
        import rospy
        from sensor_msgs.msg import Image

        metres = np.full((36, 64), 5.0, np.float32)
        message = Image(height=36, width=64, encoding="32FC1", step=256, data=metres.tobytes())
        message.header.stamp = rospy.Time.now()
        self.stamps_s.append(message.header.stamp.to_sec())
        publish_to_it(message)


def test_a_camera_is_subscribed_to_for_one_image_a_second(ros_master: str, tmp_path: Path) -> None:
    written: Queue[float] = Queue()

    class Watched(Thumbnails):
        def add(self, camera: str, stamp_s: float, message: object) -> None:
            super().add(camera, stamp_s, message)
            written.put(stamp_s)
            if written.qsize() == 2:
                raise OSError("the disk is full: no more pictures, and no subscriptions beside the tests that follow")

    Watched(tmp_path, time.monotonic).listen({"depth": "/camera/depth"})
    (thread,) = (one for one in threading.enumerate() if one.name == "thumbnails depth")
    camera = Camera("/camera/depth")
    thread.join(60.0)
    assert not thread.is_alive()
    camera.close()
    stamps_s = [written.get_nowait() for _ in range(2)]
    lines = [json.loads(line) for line in (tmp_path / "pictures.jsonl").read_text().splitlines()]
    assert [line["camera"] for line in lines] == ["depth"] * 2
    assert [line["stamp_s"] for line in lines] == [round(stamp_s, 3) for stamp_s in stamps_s]
    assert stamps_s[1] - stamps_s[0] >= 0.9
    assert base64.b64decode(lines[0]["jpeg"])[:2] == b"\xff\xd8"
    assert camera.stamps_s[:2] == pytest.approx(stamps_s), "each image was asked for by a subscription of its own"
