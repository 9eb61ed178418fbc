"""A source that FFmpeg reads in the place of a camera's topic: films in real time, and what can't be opened."""

from __future__ import annotations

import os
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from radio_link.loop import LARGEST_DATAGRAM, udp_socket
from video_stream.camera import Camera, CameraError, CameraSource, CameraThread
from video_stream.recorder import Film
from video_stream.wire import Seal, VideoPacket

from alula_testing.ros1 import refusal_of_node
from alula_testing.waits import HANGS_S, until

NODE = Path(__file__).parents[1] / "scripts/video_stream_node"
SIZE, FRAMES, PERIOD_S = (320, 180), 10, 0.05


class Clock:
    """A clock whose time passes only by waits."""

    def __init__(self, end_s: float) -> None:
        self.now_s = 100.0
        self._end_s = self.now_s + end_s

    def wait(self, seconds: float) -> bool:
        self.now_s += seconds
        return self.now_s >= self._end_s


def picture(number: int) -> np.ndarray:
    """A picture that tells its number by its brightness."""
    return np.full((SIZE[1], SIZE[0], 3), 20 + 20 * number, dtype=np.uint8)


@pytest.fixture
def film(tmp_path):
    path = tmp_path / "film.mkv"
    made = Film(path, SIZE)
    for number in range(FRAMES):
        made.add(picture(number), round(number * PERIOD_S * 1e9))
    made.close()
    return path


def test_a_film_is_shown_in_its_own_time_and_begins_again(film):
    clock = Clock(1.2)
    shown = [
        (clock.now_s - 100.0, round((float(image.mean()) - 20.0) / 20.0))
        for image in Camera(CameraSource(name=str(film))).pictures(lambda: clock.now_s, clock.wait)
    ]
    assert [number for _, number in shown[: 2 * FRAMES]] == 2 * list(range(FRAMES))
    for t_s, number in shown[:FRAMES]:
        assert t_s == pytest.approx(number * PERIOD_S, abs=0.021)
    assert len(shown) == pytest.approx(1.2 / PERIOD_S, abs=3)


def test_pictures_are_rgb_and_of_the_source_s_size(film):
    image = next(Camera(CameraSource(name=str(film))).pictures(lambda: 0.0, lambda _: False))
    assert (image.shape, image.dtype) == ((SIZE[1], SIZE[0], 3), np.uint8)


@pytest.mark.parametrize("name", ["/dev/video97", "/dev/null", "no_such_film.mp4", __file__])
def test_what_can_not_be_opened_is_told_with_its_name_and_the_remedy(name):
    with pytest.raises(CameraError, match=f"camera {name} can't be opened: .*; name a V4L2 device"):
        Camera(CameraSource(name=name))


def test_a_device_is_asked_for_size_and_rate(monkeypatch):
    asked = {}
    monkeypatch.setattr("video_stream.camera.av.open", lambda name, **options: asked.update(name=name, **options) or pytest.skip.Exception)
    with pytest.raises(AttributeError):
        Camera(CameraSource(name="/dev/video0", width=1280, height=720, fps=30.0))
    assert (asked["name"], asked["format"], asked["options"]) == ("/dev/video0", "v4l2", {"video_size": "1280x720", "framerate": "30"})


def test_a_source_that_ends_tells_why(film, tmp_path):
    pipe = tmp_path / "camera"
    os.mkfifo(pipe)
    feeder = threading.Thread(target=lambda: pipe.write_bytes(film.read_bytes()), daemon=True)
    feeder.start()
    given: list[np.ndarray] = []
    told: list[str] = []
    thread = CameraThread(CameraSource(name=str(pipe)), given.append, now_s=lambda: 0.0, ended=told.append)
    thread.start()
    until(lambda: told, "the camera's end", 10.0)
    assert told == [f"camera {pipe}: no more images come"]
    assert len(given) == FRAMES
    thread.close()
    feeder.join(10.0)


def test_a_missing_device_ends_the_node_with_one_line(ros_master):
    said = refusal_of_node([sys.executable, str(NODE), "_source:=/dev/video97", "_report_port:=0"], ros_master)
    assert "camera /dev/video97 can't be opened: No such file or directory" in said


def test_the_node_streams_a_source_by_the_computer_s_clock(ros_master, start_node, film):
    """No faster than the film; how much slower is the machine's affair, and what the film's own time is, the test above tells."""
    listener = udp_socket(0)
    listener.settimeout(HANGS_S)
    port = listener.getsockname()[1]
    key = "a secret of this test"
    begun_ns = time.time_ns()  # noqa: TID251 - it compares wall clocks
    start_node([str(NODE), f"_source:={film}", f"_video_port:={port}", "_report_port:=0", "_enabled:=true", f"_key:={key}"])
    stamps: dict[int, int] = {}
    while len(stamps) < 3 * FRAMES:
        packet = VideoPacket.parse(listener.recv(LARGEST_DATAGRAM), Seal(key.encode()))
        stamps[packet.mark.frame_id] = packet.mark.stamp_ns
    listener.close()
    times_s = [(stamps[number] - stamps[0]) / 1e9 for number in sorted(stamps)]
    assert stamps[0] > begun_ns, "without a simulator, the mission clock is the computer's"
    assert times_s == sorted(times_s)
    assert times_s[-1] / (len(times_s) - 1) > 0.75 * PERIOD_S
