"""Thumbnails of the robot's cameras, for the operator's page.

Images are large, so each camera is subscribed to for one image at a time; nothing in the run waits for it.
"""

from __future__ import annotations

import base64
import json
import logging
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from queue import Queue
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from alula.common.run_log import PICTURES_FILE

WIDTH_PX = 256
QUALITY = 55
DEPTH_M = 20.0
"""The depth that is drawn as the farthest; what was not measured is black."""
PERIOD_S = 1.0
STEADY_S = 300.0
"""Later than so long after its first picture, a camera's pictures become rarer in proportion: hours fit into some megabytes."""
LOOK_S = 0.2  # wall clock
COLOURS = {"rgb8": cv2.COLOR_RGB2BGR, "bgr8": None, "mono8": cv2.COLOR_GRAY2BGR}

log = logging.getLogger("alula.thumbnails")


def pixels_of(message: Any) -> NDArray[np.uint8]:
    """Return a sensor_msgs/Image as BGR, (H, W, 3) uint8; depth in colours from near (yellow) to far (violet).

    Raises:
        ValueError: its encoding is not known, or its size does not fit its data.
    """
    if message.encoding == "32FC1":
        return depth_picture(np.frombuffer(message.data, "<f4").reshape(message.height, message.width))
    if message.encoding not in COLOURS:
        raise ValueError(f"images of encoding {message.encoding!r} can't be shown")
    channels = () if message.encoding == "mono8" else (3,)
    pixels = np.frombuffer(message.data, np.uint8).reshape(message.height, message.width, *channels)
    conversion = COLOURS[message.encoding]
    return pixels if conversion is None else np.asarray(cv2.cvtColor(pixels, conversion), np.uint8)


def depth_picture(metres: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return depths (H, W), metres, as a picture; NaN, infinity and zero were not measured."""
    measured = np.isfinite(metres) & (metres > 0.0)
    near = np.where(measured, 1.0 - np.clip(metres, 0.0, DEPTH_M) / DEPTH_M, 0.0)
    picture = cv2.applyColorMap((255 * near).astype(np.uint8), cv2.COLORMAP_VIRIDIS)
    picture[~measured] = 0
    return np.asarray(picture, np.uint8)


def thumbnail(pixels: NDArray[np.uint8]) -> bytes:
    """Return a picture as a small JPEG."""
    height = max(1, round(pixels.shape[0] * WIDTH_PX / pixels.shape[1]))
    done, jpeg = cv2.imencode(
        ".jpg", cv2.resize(pixels, (WIDTH_PX, height), interpolation=cv2.INTER_AREA), [cv2.IMWRITE_JPEG_QUALITY, QUALITY]
    )
    if not done:
        raise ValueError("the picture can't be compressed")
    return bytes(jpeg)


def period_s(since_first_s: float) -> float:
    """Return how long after a picture the next one is due."""
    return PERIOD_S * max(1.0, since_first_s / STEADY_S)


def next_image(topic: str) -> Any:
    """Wait for an image, however long; it is subscribed to for so long only."""
    import rospy
    from sensor_msgs.msg import Image

    came: Queue[Any] = Queue()
    subscriber = rospy.Subscriber(topic, Image, came.put, queue_size=1)
    try:
        return came.get()
    finally:
        subscriber.unregister()


class Thumbnails:
    """Writes ``pictures.jsonl`` into a run's folder: ``{stamp_s, camera, jpeg}``, mission clock and base64. Needs an initialised rospy.

    ``now_s`` returns the mission clock: what is due is judged by when a picture came, as its stamp may be of another computer.
    """

    def __init__(self, folder: Path, now_s: Callable[[], float]) -> None:
        self._path = folder / PICTURES_FILE
        self._now_s = now_s
        self._lock = threading.Lock()

    def listen(self, cameras: Mapping[str, str]) -> None:
        """Begin with the topics of some cameras; ends with the process."""
        for camera, topic in cameras.items():
            threading.Thread(target=self._follow, args=(camera, topic), name=f"thumbnails {camera}", daemon=True).start()

    def _follow(self, camera: str, topic: str) -> None:
        import rospy

        first_s: float | None = None
        while not rospy.is_shutdown():
            try:
                message = next_image(topic)
                came_s = self._now_s()
                first_s = came_s if first_s is None else first_s
                self.add(camera, message.header.stamp.to_sec(), message)
                self._wait_until(came_s + period_s(came_s - first_s))
            except (ValueError, OSError) as error:
                log.warning("no more pictures of %s: %s", camera, error)
                return
            except rospy.ROSException:  # ROS shuts down, or its clock was set back
                continue

    def _wait_until(self, due_s: float) -> None:
        """Wait for a moment of the mission clock, at most ``LOOK_S`` longer; ``rospy.sleep`` would wake at each of its ticks."""
        import rospy

        while self._now_s() < due_s and not rospy.is_shutdown():
            time.sleep(LOOK_S)

    def add(self, camera: str, stamp_s: float, message: Any) -> None:
        """Write a picture; raise ValueError and OSError."""
        jpeg = base64.b64encode(thumbnail(pixels_of(message))).decode("ascii")
        line = json.dumps({"stamp_s": round(stamp_s, 3), "camera": camera, "jpeg": jpeg})
        with self._lock, self._path.open("a", encoding="ascii") as file:
            file.write(f"{line}\n")
